//! The inverse sensor model: what a detection, and the lack of one, say of a cell.
//!
//! # Model
//! *Positive*: around a detection that belongs to no moving obstacle, evidence spreads as a scaled
//! Gaussian over range and azimuth (the sensor's noise). Things stand on the road, so a stack fills
//! from the ground up to the reflection's height and fades above it as the height's Gaussian. The
//! height is the measured one drawn towards a prior, by the inverse of their variances: far away,
//! where a degree is metres, an unmoving reflection is taken as low until it is seen near. What is
//! *of a body*, one of several reflections within a vehicle's size, may be as high as a vehicle: its
//! prior is vague. A guard rail's posts stand alone. And what was measured half a standard deviation
//! above a level fills it whatever the prior says; where that is higher than a car, the thing is a mast,
//! a sign or a wall, which reflects anywhere, and twice as high. Each detection draws a stack towards its own profile,
//! so that repeated noisy heights average instead of piling up: a level is filled where most
//! detections prove it.
//!
//! *Negative*: the space in front of a detection is free along its line of sight, and above it, for
//! things stand on the road. Where nothing was detected, evidence fades: slowly in a shadow, where
//! nothing could have been detected, and faster the better the cell is seen. Both are exponentials of time,
//! right to 5 % for 5 to 50 frames a second and memories of 0.05 to 600 s: from full to half, 600 s long
//! or in two frames. A byte has no room for what a frame takes of it, so all cells are rounded down after
//! adding the same part of a step, in each frame another.
//!
//! No background is learnt over minutes: evidence draws heights together within a second, and a mast is narrower than a column.
//!
//! # Limits
//! Evidence spreads over two standard deviations of range, at most 8 range cells to each side: noise of 5 m
//! on cells of 1 m is cut off at 1.6. Work grows with it:
//! `cargo bench -p viewshed-harness --bench instructions -- radar-3d radar-3d-blurred`.
//!
//! # References
//! Slutsky and Dobkin, "Dual inverse sensor model for radar occupancy grids", IV 2019.
//! Elfes, "Using occupancy grids for mobile robot perception and navigation", 1989.

use crate::fixed::math;
use crate::fixed::time::Step;
use crate::frame::reflection::Reflection;
use crate::grid::axes::{Axes, column_centre};
use crate::grid::raycast::BLOCKED;
use crate::grid::spherical::{Column, SphericalGrid};
use crate::map::polar::PolarMap;
#[cfg(feature = "tuned")]
use crate::sensor::config::numbers;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::noise::NoiseConfig;

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

#[cfg(feature = "tuned")]
impl EvidenceConfig {
    /// Every number of it, in the order of the fields, for fingerprints.
    pub fn numbers(&self) -> [f32; 6] {
        numbers!(self => Self: gain, clearing, hidden_memory_s, visible_memory_s, height_prior_m, height_prior_sigma_m)
    }
}

/// Reflections of a body in one frame, and how far from one the others lie at most on either axis, centimetres.
pub const BODY_REFLECTIONS: usize = 4;
/// See [`BODY_REFLECTIONS`].
pub const BODY_CM: i32 = 250;
/// Variance of the height of a body that was measured, cm^2: a vehicle's.
const BODY_VARIANCE: i32 = 150 * 150;

/// Height from which what stands is a mast, a sign or a wall, centimetres. Any part of such a thing reflects, half its
/// height on average.
const TALL_CM: i32 = 200;

/// What a frame shows around an unmoving reflection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Around {
    /// Nobody knows: a first frame, in which anything may move. It is all the evidence there is and counts in full.
    Unknown,
    /// Too little for a body.
    Nothing,
    /// [Others](BODY_REFLECTIONS), of one body.
    Body,
}

/// Lines of sight of one frame that clear a column.
const SIGHTS: u8 = 6;

/// Range cells to each side of its own that a detection's evidence reaches at most.
const MOST_REACH: i32 = 8;

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
    /// Standard deviation of azimuth, 2^-8 units of the columns.
    azimuth_sigma: i32,
    /// Standard deviation of range, half a cell's spread included, centimetres.
    range_sigma: i32,
    /// Range cells to each side of its own that a detection's evidence reaches.
    range_reach: i32,
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
        let range_sigma = math::round_i32(math::sqrt(range_cm * range_cm + cell * cell / 12.0)).max(1);
        Ok(InverseSensor {
            gaussian,
            gain: share("evidence.gain", self.gain)?,
            clearing: share("evidence.clearing", self.clearing)?,
            hidden_memory: seconds("evidence.hidden_memory_s", self.hidden_memory_s)?,
            visible_memory: seconds("evidence.visible_memory_s", self.visible_memory_s)?,
            height_prior_cm: math::round_i32(prior * 100.0),
            height_prior_variance: math::round_i32(sigma * sigma * 10_000.0),
            azimuth_sigma: math::round_i32(
                azimuth_turns * (axes.narrow.units(A) as f32 * 256.0) / f32::from(axes.azimuth_span),
            )
            .max(1),
            range_sigma,
            // cells of which the centre can lie within two standard deviations
            range_reach: ((2 * range_sigma + axes.cell_cm / 2) / axes.cell_cm.max(1)).clamp(1, MOST_REACH),
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
    #[inline(never)]
    fn height(&self, r: &Reflection, around: Around) -> (i32, i32) {
        let (height, variance) = match r.height_cm {
            Some((measured, sigma)) => {
                let least = if around == Around::Body { BODY_VARIANCE } else { 0 };
                let prior = self.height_prior_variance.max(least);
                let (measured, sigma) = (i32::from(measured), i32::from(sigma));
                let noise = sigma.min(10_000) * sigma.min(10_000);
                let weight = (prior << 8) / (prior + noise).max(1);
                (
                    self.height_prior_cm + (((measured - self.height_prior_cm) * weight) >> 8),
                    math::mul_shift(noise, weight, 8),
                )
            }
            None => (self.height_prior_cm, self.height_prior_variance),
        };
        (height, (math::root(variance.unsigned_abs()) as i32).max(1))
    }

    /// Height up to which a detection says that something is there, centimetres, whatever the prior says.
    fn proven_cm(r: &Reflection, around: Around) -> i32 {
        match r.height_cm {
            Some((measured, sigma)) if around != Around::Unknown => {
                let proven = i32::from(measured) - i32::from(sigma / 2);
                if proven > TALL_CM { 2 * proven } else { proven }
            }
            _ => i32::MIN,
        }
    }

    /// Lets all evidence fade by a time step, by how well each cell was seen.
    pub fn fade<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        grid: &mut SphericalGrid<R, A, E, W>,
        seen: &PolarMap<R, A>,
        step: Step,
    ) {
        let (hidden, visible) = (step.decay(self.hidden_memory), step.decay(self.visible_memory));
        let (hidden, faster) = (i64::from(hidden), i64::from(visible) - i64::from(hidden));
        let rounding = grid.next_rounding() >> 8;
        for (a, column) in grid.columns_mut().enumerate() {
            let grades = seen.grades(a);
            column.change(|r, stack| {
                let grade = grades.and_then(|g| g.get(r)).copied().unwrap_or(0);
                // 1 is blocked: nothing of it, or a long memory would be cut short by a thousandth of a view
                let part = i64::from(grade.saturating_sub(BLOCKED));
                let keep = (hidden + ((faster * (part + (part >> 7))) >> 8)) as u32;
                for cell in stack {
                    // 255 * 2^24 + 2^24 - 1 at most
                    *cell = ((u32::from(*cell) * keep + rounding) >> 24) as u8;
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
        // the detection's own cell, its spread and one cell before stay
        let end = (i32::from(r.ground_cm) / axes.cell_cm.max(1) - self.range_reach - 1).max(0) as usize;
        let mut row = None;
        column.change_before(end, |stack| {
            let row = *row.get_or_insert_with(|| {
                let (height, _) = self.height(r, Around::Nothing);
                let height = height + axes.ground().height_cm(r.x_cm, r.y_cm);
                ((axes.row_place(axes.slope(height, i32::from(r.ground_cm))) + 255) >> 8) as usize
            });
            for v in stack.iter_mut().skip(row) {
                *v -= ((i32::from(*v) * self.clearing) >> 8) as u8;
            }
        });
    }

    /// Adds the evidence of a detection that belongs to no obstacle.
    pub fn add<const R: usize, const A: usize, const E: usize, const W: usize>(
        &self,
        r: &Reflection,
        around: Around,
        axes: &Axes<R, A, E>,
        grid: &mut SphericalGrid<R, A, E, W>,
    ) {
        let gain = if around == Around::Unknown { 256 } else { self.gain };
        let ground_cm = i32::from(r.ground_cm);
        let (height, sigma) = self.height(r, around);
        let proven = Self::proven_cm(r, around);
        let foot_cm = axes.ground().height_cm(r.x_cm, r.y_cm);
        let mut profile = [0_u8; E];
        for (row, p) in profile.iter_mut().enumerate() {
            let level = axes.height_at(axes.row_centre(row), ground_cm) - foot_cm;
            *p = if level <= proven { 255 } else { self.bell((level - height).max(0), sigma) as u8 };
        }
        let place = axes.column_unit(r.bearing());
        let reach = 2 * self.azimuth_sigma;
        let column = |unit| axes.narrow.place(unit) >> 8;
        let (first, last) = (column(place - reach).max(0), column(place + reach).min(A as i32 - 1));
        let middle = ground_cm / axes.cell_cm.max(1);
        for a in first..=last {
            let Some(column) = grid.column_mut(a as usize) else { continue };
            let by_azimuth = self.bell(axes.narrow.unit(column_centre(a as usize)) - place, self.azimuth_sigma);
            for cell in (middle - self.range_reach).max(0)..=(middle + self.range_reach).min(R as i32 - 1) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::mount::{Levelling, Mount};

    const VIEW: FieldOfView = FieldOfView {
        azimuth_min_deg: -30.0,
        azimuth_max_deg: 30.0,
        elevation_min_deg: -30.0,
        elevation_max_deg: 16.0,
        range_min_m: 1.0,
        range_max_m: 60.0,
    };

    type SmallAxes = Axes<60, 4, 4>;
    type Grid = SphericalGrid<60, 4, 4>;

    fn axes() -> (Levelling, SmallAxes) {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let levelling = mount.levelling().unwrap();
        (levelling, Axes::new(&levelling, &VIEW, 1.0).unwrap())
    }

    /// Seconds until a cell that held `from` holds less than `to`, and what a byte without rounding would take.
    fn faded(config: &EvidenceConfig, grade: u8, frames_per_s: u64, from: u8, to: u8) -> f64 {
        let (levelling, axes) = axes();
        let sensor = config.inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let mut seen = PolarMap::unknown(axes.polar(&levelling), 128, 128);
        seen.rows_mut(1).unwrap().0.fill(grade);
        let mut grid = Grid::new();
        grid.column_mut(1).unwrap().evidence(30).unwrap()[2] = from;
        let step = Step::from_micros(1_000_000 / frames_per_s);
        let mut frames = 0;
        while grid.column_mut(1).unwrap().stacks().any(|(_, s)| s[2] >= to) {
            sensor.fade(&mut grid, &seen, step);
            frames += 1;
            assert!(frames < 50 * 3000, "it never fades");
        }
        f64::from(frames) / frames_per_s as f64
    }

    #[test]
    fn evidence_fades_by_the_second_at_any_frame_rate_and_for_every_memory() {
        for memory_s in [0.05, 0.3, 1.0, 5.0, 120.0, 600.0_f32] {
            for frames_per_s in [5, 10, 15, 20, 50] {
                let config = EvidenceConfig { hidden_memory_s: memory_s, ..EvidenceConfig::default() };
                for (from, to, share) in [(255, 128, 0.05), (128, 64, 0.07)] {
                    let exact = f64::from(memory_s) * (f64::from(from) / f64::from(to)).ln();
                    let got = faded(&config, 1, frames_per_s, from, to);
                    let frame_s = 1.0 / frames_per_s as f64;
                    assert!(
                        got > exact * (1.0 - share) - frame_s && got < exact * (1.0 + share) + frame_s,
                        "{memory_s} s at {frames_per_s} a second, {from} to {to}: {got} s, exact {exact} s"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_in_view_fades_by_its_own_memory_and_what_is_half_in_view_between() {
        let config = EvidenceConfig { hidden_memory_s: 8.0, visible_memory_s: 2.0, ..EvidenceConfig::default() };
        let [hidden, half, visible] = [0, 128, 255].map(|grade| faded(&config, grade, 20, 255, 128));
        assert!((hidden - 5.54).abs() < 0.28 && (visible - 1.39).abs() < 0.12, "{hidden} {visible}");
        // rates add up: half of 1 / 8 s and half of 1 / 2 s
        assert!((half - 2.22).abs() < 0.12, "{half}");
    }

    #[test]
    fn no_time_takes_nothing() {
        let (levelling, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let seen = PolarMap::unknown(axes.polar(&levelling), 128, 128);
        let mut grid = Grid::new();
        *grid.column_mut(0).unwrap().evidence(7).unwrap() = [255, 200, 8, 1];
        (0..100).for_each(|_| sensor.fade(&mut grid, &seen, Step::from_micros(0)));
        assert_eq!(grid.column_mut(0).unwrap().stacks().next(), Some((7, &[255, 200, 8, 1])));
    }

    /// A reflection straight ahead in column 2 of 4, its height unknown.
    fn ahead(ground_cm: u16) -> Reflection {
        Reflection {
            x_cm: i32::from(ground_cm),
            y_cm: i32::from(ground_cm) / 8,
            ground_cm,
            sight: crate::fixed::trig::Direction::AHEAD,
            radial_velocity_cm_s: 0,
            across_cm: 20,
            height_cm: None,
            rcs_half_dbsm: None,
        }
    }

    /// Range cells that hold something after a detection in the middle of cell 30, and those before it that a
    /// line of sight to it leaves as they were.
    fn reached(range_m: f32) -> (std::vec::Vec<usize>, usize) {
        let (_, axes) = axes();
        let noise = NoiseConfig { range_m, ..NoiseConfig::default() };
        let sensor = EvidenceConfig::default().inverse_sensor(&noise, &axes).unwrap();
        let mut grid = Grid::new();
        sensor.add(&ahead(3050), Around::Unknown, &axes, &mut grid);
        let cells = grid.column_mut(2).unwrap().stacks().map(|(r, _)| r).collect();
        let column = grid.column_mut(2).unwrap();
        (0..30).for_each(|r| column.evidence(r).unwrap().fill(200));
        sensor.clear(&[ahead(3050)], &axes, &mut grid);
        let spared = grid.column_mut(2).unwrap().stacks().filter(|(r, s)| *r < 30 && s[3] == 200).count();
        (cells, spared)
    }

    #[test]
    fn evidence_spreads_by_the_noise_and_no_farther_than_eight_cells() {
        assert_eq!(reached(0.25), ((29..=31).collect(), 2));
        // 1.03 m with the cell's own spread: centres within 2.06 m, and one cell more is spared
        assert_eq!(reached(1.0), ((28..=32).collect(), 3));
        assert_eq!(reached(5.0), ((22..=38).collect(), 9));
    }

    #[test]
    fn a_line_of_sight_clears_above_itself_and_not_below() {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let mut grid = Grid::new();
        grid.column_mut(2).unwrap().evidence(10).unwrap().fill(200);
        sensor.clear(&[ahead(3050)], &axes, &mut grid);
        let (_, stack) = grid.column_mut(2).unwrap().stacks().next().unwrap();
        let row = ((axes.row_place(axes.slope(50, 3050)) + 255) >> 8) as usize;
        assert!(row > 0 && row < 4);
        for (k, cell) in stack.iter().enumerate() {
            assert_eq!(*cell, if k < row { 200 } else { 150 }, "row {k}");
        }
    }

    #[test]
    fn a_reflection_fills_its_stack_from_the_ground_up() {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let mut grid = Grid::new();
        sensor.add(&Reflection { height_cm: Some((100, 5)), ..ahead(3050) }, Around::Unknown, &axes, &mut grid);
        let full = grid.column_mut(2).unwrap().evidence(30).unwrap().to_vec();
        // 60 m away is the slice's lowest slope: everything up to 1 m, and less and less above
        assert!(full.is_sorted_by(|a, b| a >= b) && full[0] > 120 && full[3] < 30, "{full:?}");
        // a later detection counts by its gain only
        let mut grid = Grid::new();
        sensor.add(&Reflection { height_cm: Some((100, 5)), ..ahead(3050) }, Around::Nothing, &axes, &mut grid);
        let part = i32::from(grid.column_mut(2).unwrap().evidence(30).unwrap()[0]);
        assert!((part - i32::from(full[0]) * 3 / 10).abs() <= 3, "{part} of {full:?}");
    }

    #[test]
    fn a_sure_height_counts_and_a_vague_one_is_drawn_to_the_prior() {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let height = |measured, sigma| {
            sensor.height(&Reflection { height_cm: Some((measured, sigma)), ..ahead(3050) }, Around::Nothing)
        };
        // half a metre by default, 0.4 m uncertain
        assert_eq!(sensor.height(&ahead(3050), Around::Nothing), (50, 40));
        let (sure, sigma) = height(300, 4);
        assert!((295..=300).contains(&sure) && sigma <= 4, "{sure} {sigma}");
        let (equal, sigma) = height(300, 40);
        assert!((equal - 175).abs() <= 2 && (sigma - 28).abs() <= 1, "{equal} {sigma}");
        let (vague, sigma) = height(300, 400);
        assert!((50..=54).contains(&vague) && (34..=40).contains(&sigma), "{vague} {sigma}");
    }

    #[test]
    fn the_height_of_a_body_is_vague_where_it_was_measured() {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let height = |height_cm| sensor.height(&Reflection { height_cm, ..ahead(3050) }, Around::Body);
        assert_eq!(height(None), (50, 40));
        let (equal, sigma) = height(Some((300, 150)));
        assert!((equal - 175).abs() <= 2 && (sigma - 106).abs() <= 1, "{equal} {sigma}");
    }

    /// Rows of the stack of a thing 30.5 m away that are full after so many detections at these heights, in turn.
    fn full_rows(heights_cm: &[i16], sigma_cm: u16, detections: usize) -> usize {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let mut grid = Grid::new();
        for h in heights_cm.iter().cycle().take(detections) {
            let r = Reflection { height_cm: Some((*h, sigma_cm)), ..ahead(3050) };
            sensor.add(&r, Around::Nothing, &axes, &mut grid);
        }
        let stack = grid.column_mut(2).unwrap().evidence(30).unwrap();
        stack.iter().filter(|v| **v >= 128).count()
    }

    #[test]
    fn levels_that_most_detections_prove_are_filled_whatever_the_prior_says() {
        let (_, axes) = axes();
        let rows_to = |cm| (0..4).filter(|row| axes.height_at(axes.row_centre(*row), 3050) <= cm).count();
        assert!(rows_to(120) < rows_to(450), "the grid tells them apart");
        // a bollard that reflects 1.4 m above the road, a sign at 2.6 m, a post at 0.6 m; noise of a standard deviation
        assert_eq!(full_rows(&[140, 80, 200, 140], 60, 40), rows_to(120));
        assert_eq!(full_rows(&[260, 200, 320, 260], 60, 40), rows_to(450));
        assert!(full_rows(&[60, 0, 120, 60], 60, 40) <= rows_to(120));
        assert!(full_rows(&[60, 60, 60, 330], 60, 40) <= rows_to(120), "one in four proves nothing");
    }

    #[test]
    fn six_lines_of_sight_clear_a_column_and_no_more() {
        let (_, axes) = axes();
        let sensor = EvidenceConfig::default().inverse_sensor(&NoiseConfig::default(), &axes).unwrap();
        let left = |sights: usize| {
            let mut grid = Grid::new();
            grid.column_mut(2).unwrap().evidence(10).unwrap().fill(255);
            grid.column_mut(1).unwrap().evidence(10).unwrap().fill(255);
            sensor.clear(&std::vec![ahead(3050); sights], &axes, &mut grid);
            assert!(grid.column_mut(1).unwrap().stacks().all(|(_, s)| *s == [255; 4]), "another column");
            grid.column_mut(2).unwrap().stacks().next().unwrap().1[3]
        };
        assert!(left(5) > left(6));
        assert_eq!(left(6), left(40));
        let mut grid = Grid::new();
        grid.column_mut(2).unwrap().evidence(35).unwrap().fill(255);
        sensor.clear(&[ahead(3050)], &axes, &mut grid);
        assert!(grid.column_mut(2).unwrap().stacks().all(|(_, s)| *s == [255; 4]), "behind the detection");
    }
}
