//! The Cartesian occupancy grid of the conventional baseline: 1 m cells on the road.
//!
//! # Model
//! Each detection adds a scaled bivariate Gaussian over range and azimuth noise, turned into the
//! road's axes (Elfes 1989), cut off at one and a half standard deviations. Everything fades by a constant
//! amount per second, quickly enough for moving objects. A cell is a byte; half of full is occupied.
//!
//! # Limits
//! Eight cells are one word and are faded together; words that hold nothing are skipped.
//!
//! # References
//! Elfes, "Using occupancy grids for mobile robot perception and navigation", Computer 22(6), 1989.

use crate::fixed::bits::Bits;
use crate::fixed::math;
use crate::fixed::time::Step;
use crate::fixed::trig::ONE;
use crate::frame::reflection::Reflection;
use crate::sensor::config::{ConfigError, Problem, within};
use crate::sensor::mount::Levelling;
use crate::sensor::noise::Noise;
use crate::sensor::road::RoadPoint;

/// Side of a cell, centimetres.
pub const CELL_CM: i32 = 100;

/// Spread of a cell: its side over the root of twelve.
const SPREAD_CM: i32 = 29;

/// Occupancy from which a cell is occupied: the top bit.
pub const OCCUPIED: u8 = 128;

/// How the Cartesian grid gathers evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct CartesianConfig {
    /// Peak of one detection's Gaussian, share of full occupancy.
    pub peak: f32,
    /// Time in which full occupancy fades to nothing, seconds.
    pub memory_s: f32,
}

impl Default for CartesianConfig {
    fn default() -> Self {
        Self { peak: 0.7, memory_s: 0.4 }
    }
}

/// Squared distances, in sixteenths of a squared standard deviation, up to one and a half of them.
const TABLE: usize = 36;

/// [`CartesianConfig`] in integers, with the grid's place on the road.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CartesianParameters {
    /// Peak times exp(-x^2 / 2) by x^2 in sixteenths.
    gaussian: [u8; TABLE],
    /// Occupancy lost in a second, 2^-8.
    loss: i32,
    /// First cell along and across the road.
    origin: (i32, i32),
}

impl CartesianConfig {
    /// Checks the parameters and centres the grid on what is in view.
    ///
    /// # Errors
    /// Names the parameter outside its limits; the range if the field of view does not fit the grid.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes and cell indices
    pub fn parameters<const NX: usize, const NW: usize>(
        &self,
        corners: impl Iterator<Item = RoadPoint>,
        range_max_m: f32,
    ) -> Result<CartesianParameters, ConfigError> {
        let peak = within("cartesian.peak", self.peak, 0.01, 1.0)?;
        let memory = within("cartesian.memory_s", self.memory_s, 0.01, 60.0)?;
        let (mut low, mut high) = ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN));
        for p in corners {
            let cell = (p.x_cm.div_euclid(CELL_CM), p.y_cm.div_euclid(CELL_CM));
            low = (low.0.min(cell.0), low.1.min(cell.1));
            high = (high.0.max(cell.0), high.1.max(cell.1));
        }
        let (spare_x, spare_y) = (NX as i32 - (high.0 - low.0) - 1, 8 * NW as i32 - (high.1 - low.1) - 1);
        if spare_x < 0 || spare_y < 0 {
            let problem = Problem::OutOfLimits { min: 1.0, max: NX.min(8 * NW) as f32 / 2.0 };
            return Err(ConfigError { parameter: "field_of_view.range_max_m", value: range_max_m, problem });
        }
        let mut gaussian = [0; TABLE];
        for (i, g) in gaussian.iter_mut().enumerate() {
            let square = (i as f32 + 0.5) / 16.0;
            *g = math::round_i32(math::exp_coarse(-0.5 * square) * peak * 255.0).clamp(0, 255) as u8;
        }
        Ok(CartesianParameters {
            gaussian,
            loss: math::round_i32(255.0 * 256.0 / memory),
            origin: (low.0 - spare_x / 2, low.1 - spare_y / 2),
        })
    }
}

/// Occupancy of `NX` cells along the road by `8 * NW` across; `NW` up to 64.
#[derive(Debug, Clone)]
pub struct CartesianGrid<const NX: usize, const NW: usize> {
    rows: [Row<NW>; NX],
    /// Occupancy that is still to be taken from every cell, 2^-16.
    owed: i32,
}

/// The cells of one metre along the road, from right to left.
#[derive(Debug, Clone)]
struct Row<const NW: usize> {
    words: [u64; NW],
    /// Words that may hold something.
    used: Bits<2>,
}

/// One in every byte of a word.
const ONES: u64 = 0x0101_0101_0101_0101;
/// The top bit of every byte of a word.
const TOPS: u64 = 0x8080_8080_8080_8080;

/// Takes `loss` from every byte, none below zero.
fn fade_word(word: u64, loss: u8) -> u64 {
    let loss = u64::from(loss) * ONES;
    // subtract with each byte's top bit held up, then see which bytes would have borrowed
    let low = (word | TOPS) - (loss & !TOPS);
    let difference = low ^ ((word ^ !loss) & TOPS);
    let borrows = ((!word & loss) | (!(word ^ loss) & difference)) & TOPS;
    let mask = (borrows << 1).wrapping_sub(borrows >> 7);
    difference & !mask
}

impl<const NX: usize, const NW: usize> Default for CartesianGrid<NX, NW> {
    fn default() -> Self {
        Self::new()
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes and cell indices
impl<const NX: usize, const NW: usize> CartesianGrid<NX, NW> {
    /// Nothing occupied.
    pub const fn new() -> Self {
        const { assert!(NW <= Bits::<2>::CAPACITY) }
        Self { rows: [const { Row { words: [0; NW], used: Bits::NONE } }; NX], owed: 0 }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        for row in &mut self.rows {
            row.words = [0; NW];
            row.used = Bits::NONE;
        }
        self.owed = 0;
    }

    /// Lets everything fade by a time step.
    pub fn fade(&mut self, step: Step, p: &CartesianParameters) {
        let lost = (i64::from(p.loss) * i64::from(step.raw())) >> 8;
        let owed = i64::from(self.owed) + lost.clamp(0, 255 << 16);
        self.owed = (owed & 0xFFFF) as i32;
        let loss = (owed >> 16).min(255) as u8;
        for row in &mut self.rows {
            let mut from = 0;
            while let Some(i) = row.used.next(from) {
                if let Some(word) = row.words.get_mut(i) {
                    *word = fade_word(*word, loss);
                    if *word == 0 {
                        row.used.clear(i);
                    }
                }
                from = i + 1;
            }
        }
    }

    /// Adds the Gaussian of one detection.
    pub fn add(&mut self, r: &Reflection, noise: &Noise, levelling: &Levelling, p: &CartesianParameters) {
        let place = levelling.unplace(r.x_cm, r.y_cm);
        let (ci, cj) = (place.x_cm.div_euclid(CELL_CM), place.y_cm.div_euclid(CELL_CM));
        // the line of sight on the ground, in the road's axes
        let (ux, uy) = levelling.unturn(i32::from(r.sight.x), i32::from(r.sight.y));
        // a cell is no point: its own spread, a side over the root of twelve, joins the noise
        let along = math::hypot_gate(noise.range_cm, SPREAD_CM);
        let across = math::hypot_gate(i32::from(r.across_cm), SPREAD_CM);
        // a metre along x and y, in quarters of a standard deviation along and across the sight, 2^-14
        let (ka, kc) = (400 * ONE / along, 400 * ONE / across);
        let (ax, ay) = ((ux * (ka >> 4)) >> 10, (uy * (ka >> 4)) >> 10);
        let (cx, cy) = (-((uy * (kc >> 4)) >> 10), (ux * (kc >> 4)) >> 10);
        let reach = |a: i32, b: i32| {
            ((3 * math::hypot_gate((along * a) >> 14, (across * b) >> 14) + CELL_CM) / (2 * CELL_CM)).min(8)
        };
        let (reach_x, reach_y) = (reach(ux, uy), reach(uy, ux));
        // rows and columns of the grid that the Gaussian reaches
        let clipped =
            |centre: i32, reach: i32, size: usize| (centre - reach).max(0)..(centre + reach + 1).min(size as i32);
        let (ci, cj) = (ci - p.origin.0, cj - p.origin.1);
        let (rows, cells) = (clipped(ci, reach_x, NX), clipped(cj, reach_y, 8 * NW));
        // from the detection to the centre of the first cell, in 2^-14 quarters
        let (dx, dy) = (
            (rows.start + p.origin.0) * CELL_CM + CELL_CM / 2 - place.x_cm,
            (cells.start + p.origin.1) * CELL_CM + CELL_CM / 2 - place.y_cm,
        );
        let start = |x: i32, y: i32| (dx * (x >> 2) + dy * (y >> 2)) / (CELL_CM / 4);
        let (mut a0, mut c0) = (start(ax, ay), start(cx, cy));
        for i in rows {
            let (mut a, mut c) = (a0, c0);
            (a0, c0) = (a0 + ax, c0 + cx);
            let Some(row) = self.rows.get_mut(i as usize) else { return };
            for y in cells.clone() {
                let (qa, qc) = (a >> 14, c >> 14);
                (a, c) = (a + ay, c + cy);
                if let Some(&weight) = p.gaussian.get((qa * qa + qc * qc) as usize) {
                    row.add(y as usize, weight);
                }
            }
        }
    }

    /// Occupancy of the cell (i, j) of the road.
    pub fn occupancy(&self, i: i32, j: i32, p: &CartesianParameters) -> Option<u8> {
        let row = self.rows.get(usize::try_from(i - p.origin.0).ok()?)?;
        let y = usize::try_from(j - p.origin.1).ok()?;
        row.words.get(y / 8).map(|word| (word >> (8 * (y % 8))) as u8)
    }

    /// Visits the occupied cells: the cell along and across the road.
    pub fn each_occupied(&self, p: &CartesianParameters, mut visit: impl FnMut(i32, i32)) {
        for (x, row) in self.rows.iter().enumerate() {
            for w in row.used.iter() {
                let mut tops = row.words.get(w).copied().unwrap_or(0) & TOPS;
                while tops != 0 {
                    let byte = tops.trailing_zeros() / 8;
                    visit(p.origin.0 + x as i32, p.origin.1 + 8 * w as i32 + byte as i32);
                    tops &= tops - 1;
                }
            }
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // one byte of the word
impl<const NW: usize> Row<NW> {
    fn add(&mut self, y: usize, weight: u8) {
        let Some(word) = self.words.get_mut(y / 8) else { return };
        let shift = 8 * (y % 8);
        let sum = ((*word >> shift) as u8).saturating_add(weight);
        *word = (*word & !(0xFF << shift)) | u64::from(sum) << shift;
        self.used.set(y / 8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_occupancy_fades_in_its_memory_at_any_frame_rate() {
        for memory_s in [0.4_f32, 3.0, 60.0] {
            for frames in [5, 15, 50] {
                let corners = [RoadPoint::new(0, -300), RoadPoint::new(900, 300)].into_iter();
                let config = CartesianConfig { memory_s, ..CartesianConfig::default() };
                let p = config.parameters::<16, 2>(corners, 10.0).unwrap();
                let mut grid = CartesianGrid::<16, 2>::new();
                grid.rows[3].add(5, 255);
                let mut lasted = 0;
                while grid.rows[3].words[0] != 0 {
                    grid.fade(Step::from_micros(1_000_000 / frames), &p);
                    lasted += 1;
                }
                let error_s = lasted as f32 / frames as f32 - memory_s;
                assert!(error_s.abs() < 0.01 * memory_s + 1.01 / frames as f32, "{memory_s} s at {frames}: {error_s}");
            }
        }
    }

    #[test]
    fn eight_cells_fade_as_one_does() {
        for loss in [0_u8, 1, 85, 127, 128, 200, 255] {
            for base in 0..=255_u8 {
                let cells: [u8; 8] = core::array::from_fn(|i| base.wrapping_add((i as u8).wrapping_mul(37)));
                let faded = fade_word(u64::from_le_bytes(cells), loss).to_le_bytes();
                assert_eq!(faded, cells.map(|c| c.saturating_sub(loss)), "{cells:?} - {loss}");
            }
        }
    }
}
