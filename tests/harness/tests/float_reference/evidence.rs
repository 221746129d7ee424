//! The inverse sensor model: what a detection, and the lack of one, say of a cell.

use viewshed::grid::evidence::{Around, BODY_CM, BODY_REFLECTIONS, EvidenceConfig};
use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::Placed;
use crate::grid::{Axes, Grid};
use crate::raycast::Map;

/// Standard deviations of azimuth a detection's evidence reaches.
const REACH: f64 = 2.0;
/// Range cells to each side of its own that a detection's evidence reaches at most.
const MOST_REACH: usize = 8;
/// Lines of sight of one frame that clear a column.
const SIGHTS: usize = 6;

/// Standard deviation of the height of a body that was measured, metres.
const BODY_SIGMA: f64 = 1.5;

/// Height from which what stands is twice as high as its reflection.
const TALL: f64 = 2.0;

/// What a frame shows around one of the reflections that belong to no obstacle.
pub fn around(d: &Placed, unclaimed: &[Placed]) -> Around {
    let reach = f64::from(BODY_CM) / 100.0;
    let near = |p: &&Placed| (0..2).all(|k| (p.at[k] - d.at[k]).abs() <= reach);
    let body = unclaimed.iter().filter(near).count() >= BODY_REFLECTIONS;
    if body { Around::Body } else { Around::Nothing }
}

/// The model for one grid.
#[derive(Debug, Clone, Copy)]
pub struct InverseSensor {
    config: EvidenceConfig,
    /// Standard deviation of azimuth, columns.
    azimuth_sigma: f64,
    /// Standard deviation of range with that of an even spread over a cell, metres.
    range_sigma: f64,
    /// Range cells to each side of its own that a detection's evidence reaches.
    range_reach: usize,
}

/// exp(-x^2 / 2)
fn bell(x: f64) -> f64 {
    (-0.5 * x * x).exp()
}

impl InverseSensor {
    pub fn new(config: &EvidenceConfig, noise: &NoiseConfig, axes: &Axes) -> Self {
        let azimuth_rad = f64::from(noise.azimuth_deg).to_radians();
        let range_sigma = f64::from(noise.range_m).hypot(axes.cell_m / 12.0_f64.sqrt());
        Self {
            config: *config,
            azimuth_sigma: azimuth_rad / axes.span_rad * axes.units(axes.azimuths as f64),
            range_sigma,
            range_reach: ((2.0 * range_sigma / axes.cell_m + 0.5) as usize).clamp(1, MOST_REACH),
        }
    }

    /// Height of an unmoving reflection and its standard deviation: measured and prior, weighted by
    /// the inverse of their variances.
    fn height(&self, d: &Placed, around: Around) -> (f64, f64) {
        let (prior, sigma) = (f64::from(self.config.height_prior_m), f64::from(self.config.height_prior_sigma_m));
        let Some((measured, noise)) = d.height else { return (prior, sigma) };
        let sigma = if around == Around::Body { sigma.max(BODY_SIGMA) } else { sigma };
        let weights = [sigma.powi(-2), noise.powi(-2)];
        let sum = weights[0] + weights[1];
        ((prior * weights[0] + measured * weights[1]) / sum, sum.recip().sqrt())
    }

    /// Lets all evidence fade by a time step, by how well each cell was seen.
    pub fn fade(&self, grid: &mut Grid, seen: &Map, axes: &Axes, step_s: f64) {
        let keep = |memory_s: f32| (-step_s / f64::from(memory_s)).exp();
        let (hidden, visible) = (keep(self.config.hidden_memory_s), keep(self.config.visible_memory_s));
        for a in 0..axes.azimuths {
            for r in 0..axes.ranges {
                let keep = hidden + (visible - hidden) * seen.grade(a, r).unwrap_or(0.0);
                for cell in grid.stack_mut(a, r) {
                    *cell *= keep;
                }
            }
        }
    }

    /// Clears what stands in the detections' lines of sight, of the first [`SIGHTS`] in a column.
    pub fn clear(&self, placed: &[Placed], axes: &Axes, grid: &mut Grid) {
        let mut sights = vec![0; axes.azimuths];
        for d in placed {
            let Some(a) = column(axes, d).filter(|a| sights[*a] < SIGHTS) else { continue };
            sights[a] += 1;
            self.clear_column(d, a, axes, grid);
        }
    }

    /// Clears one line of sight: the rows that lie above it altogether.
    fn clear_column(&self, d: &Placed, a: usize, axes: &Axes, grid: &mut Grid) {
        let (height, _) = self.height(d, Around::Nothing);
        let row = axes.row_place(axes.slope(height, d.ground())).ceil() as usize;
        let end = ((d.ground() / axes.cell_m) as usize).saturating_sub(self.range_reach + 1).min(axes.ranges);
        for r in 0..end {
            for cell in grid.stack_mut(a, r).iter_mut().skip(row) {
                *cell *= 1.0 - f64::from(self.config.clearing);
            }
        }
    }

    /// Height up to which a detection says that something is there, whatever the prior says.
    fn proven(d: &Placed, around: Around) -> f64 {
        let proven = d.height.filter(|_| around != Around::Unknown).map(|(measured, noise)| measured - noise / 2.0);
        proven.map_or(f64::NEG_INFINITY, |proven| if proven > TALL { 2.0 * proven } else { proven })
    }

    /// Adds the evidence of a detection that belongs to no obstacle. In a first frame it is all the
    /// evidence there is and counts in full.
    pub fn add(&self, d: &Placed, around: Around, axes: &Axes, grid: &mut Grid) {
        let gain = if around == Around::Unknown { 1.0 } else { f64::from(self.config.gain) };
        let (height, sigma) = self.height(d, around);
        let proven = Self::proven(d, around);
        let place = axes.units(axes.column_place(d.bearing()));
        let middle = (d.ground() / axes.cell_m) as usize;
        for a in 0..axes.azimuths {
            let reach = REACH * self.azimuth_sigma;
            let [right, centre, left] = [0.0, 0.5, 1.0].map(|part| axes.units(a as f64 + part));
            if left < place - reach || right > place + reach {
                continue;
            }
            for r in middle.saturating_sub(self.range_reach)..(middle + self.range_reach + 1).min(axes.ranges) {
                let [across, along] = [centre - place, (r as f64 + 0.5) * axes.cell_m - d.ground()];
                let weight = gain * bell(across / self.azimuth_sigma) * bell(along / self.range_sigma);
                for (row, cell) in grid.stack_mut(a, r).iter_mut().enumerate() {
                    let level = axes.height_m + axes.row_centre(row) * d.ground();
                    let holds = if level <= proven { 1.0 } else { bell((level - height).max(0.0) / sigma) };
                    *cell += weight * (holds - *cell);
                }
            }
        }
    }
}

fn column(axes: &Axes, d: &Placed) -> Option<usize> {
    let place = axes.column_place(d.bearing());
    (place >= 0.0 && place < axes.azimuths as f64).then_some(place as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Levelled, place};
    use crate::scene::{self, AZIMUTHS, IntegerAxes, IntegerGrid, RANGES, Random, mounts, raise, within};
    use viewshed::fixed::time::Step;
    use viewshed::frame::detection::Measurement;
    use viewshed::grid::evidence::InverseSensor as IntegerSensor;
    use viewshed::map::polar::PolarMap;
    use viewshed::sensor::mount::{Levelling, Mount};
    use viewshed::sensor::noise::Noise;

    /// One mount's model and grid, in integers and in real numbers.
    struct Both {
        axes: Box<IntegerAxes>,
        noise: Noise,
        levelling: Levelling,
        integer: IntegerSensor,
        grid: Box<IntegerGrid>,
        exact_axes: Axes,
        levelled: Levelled,
        exact: InverseSensor,
        exact_grid: Grid,
    }

    impl Both {
        fn new(mount: &Mount) -> Self {
            let (axes, exact_axes) = scene::axes(mount);
            let (config, noise) = (EvidenceConfig::default(), NoiseConfig::default());
            Self {
                integer: config.inverse_sensor(&noise, &axes).unwrap(),
                axes,
                noise: noise.noise().unwrap(),
                levelling: mount.levelling().unwrap(),
                grid: Box::default(),
                exact: InverseSensor::new(&config, &noise, &exact_axes),
                exact_grid: Grid::new(&exact_axes),
                exact_axes,
                levelled: Levelled::new(mount),
            }
        }

        fn clear_grids(&mut self) {
            self.grid.clear();
            self.exact_grid.clear();
        }

        fn add(&mut self, m: &Measurement, around: Around) {
            let r = scene::reflection(m, &self.noise, &self.levelling);
            self.integer.add(&r, around, &self.axes, &mut self.grid);
            let d = place(m, &NoiseConfig::default(), &self.levelled);
            self.exact.add(&d, around, &self.exact_axes, &mut self.exact_grid);
        }

        fn clear(&mut self, m: &Measurement) {
            let r = scene::reflection(m, &self.noise, &self.levelling);
            self.integer.clear(&[r], &self.axes, &mut self.grid);
            let d = place(m, &NoiseConfig::default(), &self.levelled);
            self.exact.clear(&[d], &self.exact_axes, &mut self.exact_grid);
        }

        /// Both grids the same: `value` of 255 wherever `filled` says.
        fn fill(&mut self, value: u8, filled: impl Fn(usize, usize) -> bool) {
            for a in 0..AZIMUTHS {
                for r in (0..RANGES).filter(|r| filled(a, *r)) {
                    self.grid.column_mut(a).and_then(|c| c.evidence(r)).unwrap().fill(value);
                    self.exact_grid.stack_mut(a, r).fill(f64::from(value) / 255.0);
                }
            }
        }

        /// Mean and largest absolute difference, steps of 255, and % of cells more than 4 steps off.
        fn off(&self) -> [f64; 3] {
            self.off_in(|_| true)
        }

        /// The same in some rows.
        fn off_in(&self, counts: impl Fn(usize) -> bool) -> [f64; 3] {
            let found = scene::differences(&self.grid, &self.exact_grid).into_iter().filter(|(_, row)| counts(*row));
            let found: Vec<f64> = found.map(|(off, _)| off.abs()).collect();
            let n = (found.len() as f64).max(1.0);
            let far_off = found.iter().filter(|f| **f > 4.0).count() as f64;
            [found.iter().sum::<f64>() / n, found.iter().copied().fold(0.0, f64::max), 100.0 * far_off / n]
        }
    }

    /// How far from a level an edge of what is proven lies at least where both grids are on the same side of it, metres:
    /// heights in whole centimetres, a row's place in steps of 1/256, twice that above [`TALL`].
    const EDGE: f64 = 0.1;

    impl Both {
        /// Whether a row is so near the edge of what a detection proves that one grid may fill it and the other not.
        fn is_edge(&self, m: &Measurement, around: Around, row: usize) -> bool {
            let d = place(m, &NoiseConfig::default(), &self.levelled);
            let level = self.exact_axes.height_m + self.exact_axes.row_centre(row) * d.ground();
            let proven = InverseSensor::proven(&d, around);
            // just below or above the height from which it counts twice
            let once = if proven > TALL { proven / 2.0 } else { proven };
            let may_be_twice = (once - TALL).abs() <= EDGE && (TALL - EDGE..=2.0 * (TALL + EDGE)).contains(&level);
            may_be_twice || (level - proven).abs() <= EDGE
        }
    }

    /// Mean and largest difference after so many detections at one place, over 200 places a mount, away from the edge
    /// of what is proven; and % of all cells more than 4 steps off.
    fn added(times: usize, around: Around) -> [f64; 3] {
        let (mut random, [mut mean, mut worst, mut far_off]) = (Random::new(10), [0.0; 3]);
        for mount in mounts() {
            let mut both = Both::new(&mount);
            for _ in 0..200 {
                both.clear_grids();
                let m = random.reflection(&both.levelled);
                (0..times).for_each(|_| both.add(&m, around));
                let off = both.off_in(|row| !both.is_edge(&m, around, row));
                mean += off[0] / 600.0;
                raise(&mut worst, off[1]);
                far_off += both.off()[2] / 600.0;
            }
        }
        [mean, worst, far_off]
    }

    #[test]
    fn a_detection_adds_the_same_evidence() {
        for around in [Around::Nothing, Around::Body] {
            let [mean, worst, far_off] = added(1, around);
            // each cell that is filled is a part of a step off: the more, the higher the thing
            within(&format!("one detection, {around:?}, mean, steps of 255"), mean, 0.85);
            within(&format!("one detection, {around:?}, worst, steps of 255"), worst, 11.0);
            within(&format!("one detection, {around:?}, more than 4 steps off, % of cells"), far_off, 1.0);
        }
        // the weight of a measured height has 8 bits: 5 of 256 at 150 m
        let [mean, worst, _] = added(1, Around::Unknown);
        within("first frame, mean, steps of 255", mean, 1.4);
        within("first frame, worst, steps of 255", worst, 45.0);
    }

    #[test]
    fn repeated_detections_stop_short_at_the_rim() {
        // where weight times what is missing is less than one step, the integer grid stays
        let [mean, worst, _] = added(40, Around::Nothing);
        within("forty detections, mean, steps of 255", mean, 15.5);
        within("forty detections, worst, steps of 255", worst, 136.0);
    }

    #[test]
    fn a_line_of_sight_clears_the_same_cells() {
        let mut random = Random::new(12);
        let [mut mean, mut far_off] = [0.0; 2];
        for mount in mounts() {
            let mut both = Both::new(&mount);
            both.fill(200, |a, r| !(a + r).is_multiple_of(3));
            for _ in 0..300 {
                let m = random.reflection(&both.levelled);
                both.clear(&m);
            }
            raise(&mut mean, both.off()[0]);
            raise(&mut far_off, both.off()[2]);
        }
        within("mean, steps of 255", mean, 1.6);
        // a line of sight near the edge of a row, or of a column: of narrow ones there are three times as many
        within("more than 4 steps off, % of cells", far_off, 4.0);
    }

    /// Largest difference after a second of frames, from full, in a shadow, in half-shadow and in view.
    fn faded(frames: u64) -> [f64; 3] {
        [1, 128, 255].map(|grade| {
            let mut both = Both::new(&mounts()[0]);
            both.fill(255, |a, r| (a + r).is_multiple_of(7));
            let mut seen = Box::new(PolarMap::unknown(both.axes.polar(&both.levelling), 128, 128));
            (0..AZIMUTHS).for_each(|a| seen.rows_mut(a).unwrap().0.fill(grade));
            let mut exact_seen = Map::unknown(&both.exact_axes);
            exact_seen.fill(f64::from(grade) / 255.0);
            for _ in 0..frames {
                both.integer.fade(&mut both.grid, &seen, Step::from_micros(1_000_000 / frames));
                both.exact.fade(&mut both.exact_grid, &exact_seen, &both.exact_axes, 1.0 / frames as f64);
            }
            both.off()[1]
        })
    }

    #[test]
    fn a_second_of_frames_fades_as_the_exponential_however_many_they_are() {
        for frames in [5, 15, 60] {
            let [hidden, half, visible] = faded(frames);
            within(&format!("{frames} frames, hidden, steps of 255"), hidden, 3.0);
            within(&format!("{frames} frames, half visible, steps of 255"), half, 3.0);
            within(&format!("{frames} frames, visible, steps of 255"), visible, 3.0);
        }
    }
}
