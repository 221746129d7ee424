//! The Cartesian occupancy grid of the conventional baseline: 1 m cells on the road.
//!
//! # Model
//! Each detection adds a scaled bivariate Gaussian over range and azimuth noise, turned into the
//! road's axes (Elfes 1989); everything fades with one memory, short enough for moving objects.
//!
//! # References
//! Elfes, "Using occupancy grids for mobile robot perception and navigation", Computer 22(6), 1989.

use crate::bits::Bits;
use crate::config::{ConfigError, Problem, within};
use crate::map::RoadPoint;
use crate::math;
use crate::mount::Levelling;
use crate::reflection::{Noise, Reflection};

/// Side of a cell, centimetres.
pub const CELL_CM: i32 = 100;

/// How the Cartesian grid gathers evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct CartesianConfig {
    /// Peak of one detection's Gaussian, share of full occupancy.
    pub peak: f32,
    /// How long evidence lasts, seconds.
    pub memory_s: f32,
    /// Least occupancy that counts as occupied.
    pub occupied_from: f32,
}

impl Default for CartesianConfig {
    fn default() -> Self {
        Self { peak: 0.7, memory_s: 0.2, occupied_from: 0.5 }
    }
}

/// Steps of the Gaussian table to one standard deviation.
const STEPS_PER_SIGMA: i32 = 16;
/// Two and a half standard deviations: below 5 % of the peak nothing is added.
const TABLE: usize = 40;

/// [`CartesianConfig`] in integers, with the grid's place on the road.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CartesianParameters {
    /// exp(-x^2 / 2) of full occupancy times peak, by sixteenths of a standard deviation.
    gaussian: [u8; TABLE],
    /// 2^-16 s
    pub(crate) memory: i32,
    pub(crate) occupied_from: u8,
    /// First cell along and across the road.
    pub(crate) origin: (i32, i32),
}

impl CartesianConfig {
    /// Checks the parameters and centres the grid on what is in view.
    ///
    /// # Errors
    /// Names the parameter outside its limits; the range if the field of view does not fit `NX` by
    /// `NY` cells.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes and cell indices
    pub fn parameters<const NX: usize, const NY: usize>(
        &self,
        corners: impl Iterator<Item = RoadPoint>,
        range_max_m: f32,
    ) -> Result<CartesianParameters, ConfigError> {
        let peak = within("cartesian.peak", self.peak, 0.01, 1.0)?;
        let memory = within("cartesian.memory_s", self.memory_s, 0.01, 60.0)?;
        let occupied = within("cartesian.occupied_from", self.occupied_from, 0.01, 1.0)?;
        let (mut low, mut high) = ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN));
        for p in corners {
            let cell = (p.x_cm.div_euclid(CELL_CM), p.y_cm.div_euclid(CELL_CM));
            low = (low.0.min(cell.0), low.1.min(cell.1));
            high = (high.0.max(cell.0), high.1.max(cell.1));
        }
        let (spare_x, spare_y) = (NX as i32 - (high.0 - low.0) - 1, NY as i32 - (high.1 - low.1) - 1);
        if spare_x < 0 || spare_y < 0 {
            let problem = Problem::OutOfLimits { min: 1.0, max: NX.min(NY) as f32 / 2.0 };
            return Err(ConfigError { parameter: "field_of_view.range_max_m", value: range_max_m, problem });
        }
        let mut gaussian = [0; TABLE];
        for (i, g) in gaussian.iter_mut().enumerate() {
            let x = i as f32 / STEPS_PER_SIGMA as f32;
            *g = math::round_i32(math::exp_coarse(-0.5 * x * x) * peak * 255.0).clamp(0, 255) as u8;
        }
        Ok(CartesianParameters {
            gaussian,
            memory: math::round_i32(memory * 65536.0),
            occupied_from: math::round_i32(occupied * 255.0).clamp(1, 255) as u8,
            origin: (low.0 - spare_x / 2, low.1 - spare_y / 2),
        })
    }
}

/// Occupancy of `NX` cells along the road by `NY` across; `NY` up to 512.
#[derive(Debug, Clone)]
pub struct CartesianGrid<const NX: usize, const NY: usize> {
    rows: [Row<NY>; NX],
}

/// The cells of one metre along the road.
#[derive(Debug, Clone)]
struct Row<const NY: usize> {
    cells: [u8; NY],
    used: Bits<16>,
}

impl<const NX: usize, const NY: usize> Default for CartesianGrid<NX, NY> {
    fn default() -> Self {
        Self::new()
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes and cell indices
impl<const NX: usize, const NY: usize> CartesianGrid<NX, NY> {
    /// Nothing occupied.
    pub const fn new() -> Self {
        const { assert!(NY <= Bits::<16>::CAPACITY) }
        Self { rows: [const { Row { cells: [0; NY], used: Bits::NONE } }; NX] }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        for row in &mut self.rows {
            row.cells = [0; NY];
            row.used = Bits::NONE;
        }
    }

    /// Multiplies all occupancy by `keep`, 2^-16.
    pub fn fade(&mut self, keep: i32) {
        for row in &mut self.rows {
            if row.used.is_empty() {
                continue;
            }
            for j in row.used.iter() {
                if let Some(cell) = row.cells.get_mut(j) {
                    *cell = ((i32::from(*cell) * keep) >> 16) as u8;
                }
            }
            let mut used = row.used;
            for j in row.used.iter() {
                if row.cells.get(j) == Some(&0) {
                    used.clear(j);
                }
            }
            row.used = used;
        }
    }

    /// Adds the Gaussian of one detection.
    pub fn add(&mut self, r: &Reflection, noise: &Noise, levelling: &Levelling, p: &CartesianParameters) {
        let place = levelling.unplace(r.x_cm, r.y_cm);
        let (ci, cj) = (place.x_cm.div_euclid(CELL_CM), place.y_cm.div_euclid(CELL_CM));
        // the line of sight on the ground, in the road's axes
        let toward = levelling.unturn(r.x_cm, r.y_cm);
        let length = i32::from(r.ground_cm.max(1));
        let (ux, uy) = ((toward.0 << 14) / length, (toward.1 << 14) / length);
        // a cell is no point: half its side joins the noise
        let along = noise.range_cm + CELL_CM / 2;
        let across = i32::from(r.across_cm) + CELL_CM / 2;
        let reach = (across.max(along) * 5 / 2 / CELL_CM).min(8);
        for i in ci - reach..=ci + reach {
            let Some(row) = usize::try_from(i - p.origin.0).ok().and_then(|i| self.rows.get_mut(i)) else { continue };
            for j in cj - reach..=cj + reach {
                let (dx, dy) = (i * CELL_CM + CELL_CM / 2 - place.x_cm, j * CELL_CM + CELL_CM / 2 - place.y_cm);
                let (a, b) = ((dx * ux + dy * uy) >> 14, (dy * ux - dx * uy) >> 14);
                let (a, b) = (a * STEPS_PER_SIGMA / along, b * STEPS_PER_SIGMA / across);
                let steps = ((a * a + b * b) as u32).isqrt() as usize;
                let (Some(&weight), Some(y)) = (p.gaussian.get(steps), usize::try_from(j - p.origin.1).ok()) else {
                    continue;
                };
                if let Some(cell) = row.cells.get_mut(y) {
                    *cell = cell.saturating_add(weight);
                    row.used.set(y);
                }
            }
        }
    }

    /// Occupancy of the cell (i, j) of the road.
    pub fn occupancy(&self, i: i32, j: i32, p: &CartesianParameters) -> Option<u8> {
        let row = self.rows.get(usize::try_from(i - p.origin.0).ok()?)?;
        row.cells.get(usize::try_from(j - p.origin.1).ok()?).copied()
    }

    /// Centres of the occupied cells.
    pub fn occupied<'a>(&'a self, p: &'a CartesianParameters) -> impl Iterator<Item = RoadPoint> + 'a {
        self.rows.iter().enumerate().flat_map(move |(x, row)| {
            let i = p.origin.0 + x as i32;
            row.used
                .iter()
                .filter(|y| row.cells.get(*y).is_some_and(|c| *c >= p.occupied_from))
                .map(move |y| RoadPoint::cell_centre(i, p.origin.1 + y as i32))
        })
    }
}
