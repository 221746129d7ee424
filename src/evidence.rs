//! The inverse sensor model: what a detection, and the lack of one, say of a cell.
//!
//! # Model
//! *Positive*: around a detection that belongs to no moving obstacle, evidence spreads as a scaled
//! Gaussian over range and azimuth (the sensor's noise). Things stand on the road, so a stack fills
//! from the ground up to the reflection's height and fades above it as the height's Gaussian. The
//! height is the measured one drawn towards a prior, by the inverse of their variances: far away,
//! where a degree is metres, an unmoving reflection is taken as low until it is seen near. Each
//! detection draws a stack towards its own profile, so that repeated noisy heights average instead
//! of piling up.
//!
//! *Negative*: the space in front of a detection is free along its line of sight, and above it, for
//! things stand on the road. Where nothing was detected, evidence fades: slowly in a shadow, where
//! nothing could have been detected, and faster the better the cell is seen. Both are per second.
//!
//! # References
//! Slutsky and Dobkin, "Dual inverse sensor model for radar occupancy grids", IV 2019.
//! Elfes, "Using occupancy grids for mobile robot perception and navigation", 1989.

use crate::axes::Axes;
use crate::config::{ConfigError, within};
use crate::math;
use crate::polar::PolarMap;
use crate::reflection::{NoiseConfig, Reflection};
use crate::spherical::{Column, SphericalGrid};
use crate::time::Step;

/// How evidence of unmoving things comes and goes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct EvidenceConfig {
    /// Share of the way one detection draws the cell it lies in towards its profile.
    pub gain: f32,
    /// Share of evidence a line of sight takes from the cells it passes.
    pub clearing: f32,
    /// How long evidence lasts in a shadow, seconds.
    pub hidden_memory_s: f32,
    /// How long it lasts in plain view without a detection, seconds.
    pub visible_memory_s: f32,
    /// Height of unmoving reflectors unless measured otherwise, metres.
    pub height_prior_m: f32,
    /// Standard deviation of that prior, metres.
    pub height_prior_sigma_m: f32,
}

impl Default for EvidenceConfig {
    fn default() -> Self {
        Self {
            gain: 0.3,
            clearing: 0.25,
            hidden_memory_s: 5.0,
            visible_memory_s: 1.0,
            height_prior_m: 0.5,
            height_prior_sigma_m: 0.4,
        }
    }
}

/// Lines of sight of one frame that clear a column.
const SIGHTS: u8 = 6;

/// Steps of the Gaussian table to one standard deviation.
const STEPS_PER_SIGMA: i32 = 16;
/// The table ends where the Gaussian is below half a step of eight bits.
const TABLE: usize = 56;

/// The inverse sensor model in integers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InverseSensor {
    /// exp(-x^2 / 2) in 2^-8, by sixteenths of a standard deviation.
    gaussian: [u8; TABLE],
    /// 2^-8
    gain: i32,
    /// 2^-8
    clearing: i32,
    /// 2^-16 s
    hidden_memory: i32,
    /// 2^-16 s
    visible_memory: i32,
    height_prior_cm: i32,
    height_prior_variance: i32,
    /// Standard deviation of azimuth, 2^-8 columns.
    azimuth_sigma: i32,
    /// Standard deviation of range, half a cell's spread included, centimetres.
    range_sigma: i32,
}

impl EvidenceConfig {
    /// Checks the parameters and computes the kernel.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes
    pub fn inverse_sensor<const R: usize, const A: usize, const E: usize>(
        &self,
        noise: &NoiseConfig,
        axes: &Axes<R, A, E>,
    ) -> Result<InverseSensor, ConfigError> {
        let share = |name, v| within(name, v, 0.0, 1.0).map(|s| math::round_i32(s * 256.0));
        let seconds = |name, v| within(name, v, 0.05, 600.0).map(|s| math::round_i32(s * 65536.0));
        let prior = within("evidence.height_prior_m", self.height_prior_m, 0.0, 5.0)?;
        let sigma = within("evidence.height_prior_sigma_m", self.height_prior_sigma_m, 0.01, 5.0)?;
        let mut gaussian = [0; TABLE];
        for (i, g) in gaussian.iter_mut().enumerate() {
            let x = i as f32 / STEPS_PER_SIGMA as f32;
            *g = math::round_i32(math::exp_coarse(-0.5 * x * x) * 255.0).clamp(0, 255) as u8;
        }
        let azimuth_turns = noise.azimuth_deg / 360.0 * 65536.0;
        let cell = axes.cell_cm as f32;
        let range_cm = noise.range_m * 100.0;
        Ok(InverseSensor {
            gaussian,
            gain: share("evidence.gain", self.gain)?,
            clearing: share("evidence.clearing", self.clearing)?,
            hidden_memory: seconds("evidence.hidden_memory_s", self.hidden_memory_s)?,
            visible_memory: seconds("evidence.visible_memory_s", self.visible_memory_s)?,
            height_prior_cm: math::round_i32(prior * 100.0),
            height_prior_variance: math::round_i32(sigma * sigma * 10_000.0),
            azimuth_sigma: math::round_i32(azimuth_turns * (A as f32 * 256.0) / f32::from(axes.azimuth_span)).max(1),
            range_sigma: math::round_i32(math::sqrt(range_cm * range_cm + cell * cell / 12.0)).max(1),
        })
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // bytes and cell indices
impl InverseSensor {
    /// exp(-x^2 / 2) of `offset / sigma`, 0 to 255.
    fn bell(&self, offset: i32, sigma: i32) -> i32 {
        let step = offset.abs() * STEPS_PER_SIGMA / sigma.max(1);
        i32::from(self.gaussian.get(step as usize).copied().unwrap_or(0))
    }

    /// Height of an unmoving reflection and its standard deviation, centimetres.
    fn height(&self, r: &Reflection) -> (i32, i32) {
        let prior = self.height_prior_variance;
        let (height, variance) = match r.height_cm {
            Some((measured, sigma)) => {
                let (measured, sigma) = (i32::from(measured), i32::from(sigma));
                let noise = sigma.min(10_000) * sigma.min(10_000);
                let weight = (prior << 8) / (prior + noise).max(1);
                (
                    self.height_prior_cm + (((measured - self.height_prior_cm) * weight) >> 8),
                    math::mul_shift(noise, weight, 8),
                )
            }
            None => (self.height_prior_cm, prior),
        };
        (height, (math::root(variance.unsigned_abs()) as i32).max(1))
    }

    /// Lets all evidence fade by a time step, by how well each cell was seen.
    pub fn fade<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        grid: &mut SphericalGrid<R, A, E, W>,
        seen: &PolarMap<R, A>,
        step: Step,
    ) {
        let (hidden, visible) = (step.keep(self.hidden_memory), step.keep(self.visible_memory));
        for (a, column) in grid.columns_mut().enumerate() {
            let grades = seen.grades(a);
            column.change(|r, stack| {
                let grade = grades.and_then(|g| g.get(r)).copied().unwrap_or(0);
                let keep = hidden + (((visible - hidden) * i32::from(grade)) >> 8);
                for cell in stack {
                    *cell = ((i32::from(*cell) * keep) >> 16) as u8;
                }
            });
        }
    }

    /// Clears what stands in the detections' lines of sight, at most `SIGHTS` in a column: more
    /// would take little that is left.
    pub fn clear<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        reflections: &[Reflection],
        axes: &Axes<R, A, E>,
        grid: &mut SphericalGrid<R, A, E, W>,
    ) {
        let mut sights = [0_u8; A];
        for r in reflections {
            let Some(a) = axes.column(r.bearing()) else { continue };
            if let (Some(n @ ..SIGHTS), Some(column)) = (sights.get_mut(a), grid.column_mut(a)) {
                *n += 1;
                self.clear_column(r, axes, column);
            }
        }
    }

    fn clear_column<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        r: &Reflection,
        axes: &Axes<R, A, E>,
        column: &mut Column<R, E, W>,
    ) {
        // the detection's own cell and its spread stay
        let end = (i32::from(r.ground_cm) / axes.cell_cm.max(1) - 2).max(0) as usize;
        let mut row = None;
        column.change_before(end, |stack| {
            let row = *row.get_or_insert_with(|| {
                let (height, _) = self.height(r);
                ((axes.row_place(axes.slope(height, i32::from(r.ground_cm))) + 255) >> 8) as usize
            });
            for v in stack.iter_mut().skip(row) {
                *v -= ((i32::from(*v) * self.clearing) >> 8) as u8;
            }
        });
    }

    /// Adds the evidence of a detection that belongs to no obstacle. In a `first` frame it is all the
    /// evidence there is and counts in full.
    pub fn add<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        r: &Reflection,
        first: bool,
        axes: &Axes<R, A, E>,
        grid: &mut SphericalGrid<R, A, E, W>,
    ) {
        let gain = if first { 256 } else { self.gain };
        let ground_cm = i32::from(r.ground_cm);
        let (height, sigma) = self.height(r);
        let mut profile = [0_u8; E];
        for (row, p) in profile.iter_mut().enumerate() {
            let above = axes.height_at(axes.row_centre(row), ground_cm) - height;
            *p = self.bell(above.max(0), sigma) as u8;
        }
        let place = axes.column_place(r.bearing());
        let reach = 2 * self.azimuth_sigma;
        let (first, last) = (((place - reach) >> 8).max(0), ((place + reach) >> 8).min(A as i32 - 1));
        let middle = ground_cm / axes.cell_cm.max(1);
        for a in first..=last {
            let Some(column) = grid.column_mut(a as usize) else { continue };
            let by_azimuth = self.bell(a * 256 + 128 - place, self.azimuth_sigma);
            for cell in (middle - 1).max(0)..=(middle + 1).min(R as i32 - 1) {
                let offset = cell * axes.cell_cm + axes.cell_cm / 2 - ground_cm;
                let weight = (gain * by_azimuth * self.bell(offset, self.range_sigma)) >> 16;
                if weight < 4 {
                    continue;
                }
                let Some(stack) = column.evidence(cell as usize) else { continue };
                for (v, &p) in stack.iter_mut().zip(&profile) {
                    let gap = i32::from(p) - i32::from(*v);
                    *v = (i32::from(*v) + ((gap * weight) >> 8)) as u8;
                }
            }
        }
    }
}
