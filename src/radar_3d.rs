//! The radar-3d estimator: all stages in order, from detections to a polar map.
//!
//! ```text
//!                       azimuth's noise, by fixtures
//!                                    ^ |
//!                                    | v
//! detections -> gate -> reflections on the ground -> moving obstacles -+-> boxes -> shadows -+
//!                                                                      |                     |
//!      unclaimed detections -> evidence -> spherical grid <------------+                     |
//!                                               |                                            v
//!                                               +-> ray casting -> slice at h -> settling -> polar map: grade, bit, occupancy
//! ```

use crate::estimator::{Estimator, Progress};
use crate::fixed::math;
use crate::fixed::time::{Step, Time};
use crate::frame::by_range::ByRange;
use crate::frame::detection::Detection;
use crate::frame::gate::{Gate, GateConfig, Rejections};
use crate::frame::health::{Condition, Continuity, FrameStatus, Health, HealthConfig, HealthLimits};
use crate::frame::reflection::Reflection;
use crate::frame::repeatability::Repeatability;
use crate::frame::scan::Scan;
use crate::grid::axes::Axes;
use crate::grid::evidence::{Around, BODY_CM, BODY_REFLECTIONS, EvidenceConfig, InverseSensor};
use crate::grid::raycast;
use crate::grid::settling::{Settling, SettlingConfig, SettlingTimes};
use crate::grid::shadow;
use crate::grid::spherical::SphericalGrid;
use crate::map::polar::PolarMap;
use crate::obstacles::config::ObstacleConfig;
use crate::obstacles::lanes::Lane;
use crate::obstacles::parameters::TrackingParameters;
use crate::obstacles::{Claimed, Obstacles};
use crate::sensor::Sensor;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::ground::Ground;
use crate::sensor::mount::Levelling;
use crate::sensor::noise::Noise;
use crate::sensor::site::{LaneList, Points, Site};

/// Everything that can be set, in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Radar3dConfig {
    /// Which detections count.
    pub gate: GateConfig,
    /// Moving things.
    pub obstacles: ObstacleConfig,
    /// Unmoving things.
    pub evidence: EvidenceConfig,
    /// The result.
    pub visibility: VisibilityConfig,
    /// When maps end.
    pub health: HealthConfig,
    /// When they begin.
    pub settling: SettlingConfig,
    /// Which way traffic goes, where that is known, of a crossing say: lanes as polylines in the direction of their
    /// traffic, metres in road coordinates, x along the road and y to the left. No part of a file's table.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub lanes: &'static [Lane],
    /// Where the road is not flat, its height over its length: x along the road and height, metres, in road coordinates,
    /// linear in between and level beyond. Only differences count. No part of a file's table.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub ground: &'static [[f32; 2]],
}

impl Radar3dConfig {
    /// What it says of the place.
    pub fn place(&self) -> Site<'static> {
        Site { lanes: LaneList::Metres(self.lanes), heights: Points::Metres(self.ground) }
    }
}

/// How the result is read off the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct VisibilityConfig {
    /// Height above the road at which visibility is judged, metres.
    pub slice_height_m: f32,
    /// Least graded visibility that counts as visible; of a camera's unit, the share of the column above a cell that
    /// has to be seen.
    pub visible_from: f32,
    /// Least occupancy that counts as occupied.
    pub occupied_from: f32,
    /// Where the far road lies, whole degrees from the boresight's heading, + left: azimuths within ten degrees of it are
    /// four times narrower than the others. Without it all are alike. Of radar-3d only.
    pub far_road_deg: Option<i8>,
}

impl Default for VisibilityConfig {
    fn default() -> Self {
        Self { slice_height_m: 1.0, visible_from: 0.5, occupied_from: 0.5, far_road_deg: None }
    }
}

impl VisibilityConfig {
    /// Least grade that counts as visible.
    ///
    /// # Errors
    /// A share that is none.
    pub fn least_grade(&self) -> Result<u8, ConfigError> {
        threshold("visibility.visible_from", self.visible_from)
    }
}

/// The configuration, checked and in integers.
#[derive(Debug, Clone)]
pub struct Radar3dParameters<const R: usize, const A: usize, const E: usize> {
    axes: Axes<R, A, E>,
    levelling: Levelling,
    gate: Gate,
    noise: Noise,
    tracking: TrackingParameters,
    inverse_sensor: InverseSensor,
    health: HealthLimits,
    settling: SettlingTimes,
    visible_from: u8,
    occupied_from: u8,
}

/// Longest time from frame to frame that is none of a gap, microseconds.
const LONGEST_STEP_US: u64 = 1_000_000;

/// How far behind the field of view's range obstacles are followed, centimetres.
const BEYOND_CM: i32 = 2500;

/// Stages of a frame.
const STAGES: usize = 7;

impl<const R: usize, const A: usize, const E: usize> Radar3dParameters<R, A, E> {
    /// Checks a configuration.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with.
    pub fn new(sensor: &Sensor, config: &Radar3dConfig) -> Result<Self, ConfigError> {
        Self::at(sensor, config, &config.place())
    }

    /// The same at another place than the configuration's own.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn at(sensor: &Sensor, config: &Radar3dConfig, place: &Site<'_>) -> Result<Self, ConfigError> {
        let levelling = sensor.mount.levelling()?;
        let view = sensor.field_of_view.limits()?;
        let noise = sensor.noise.noise()?;
        let ground = Ground::new(&levelling, place.heights)?;
        let VisibilityConfig { slice_height_m, far_road_deg, .. } = config.visibility;
        let axes = Axes::on(ground, &levelling, &sensor.field_of_view, slice_height_m, far_road_deg)?;
        let limit_cm = view.range_cm[1] + BEYOND_CM;
        let mut tracking = config.obstacles.tracking(noise, levelling.road_axis(), limit_cm)?;
        tracking.lanes.set(&levelling, place.lanes)?;
        Ok(Self {
            levelling,
            gate: config.gate.gate(&view)?,
            noise,
            tracking,
            inverse_sensor: config.evidence.inverse_sensor(&sensor.noise, &axes)?,
            health: config.health.limits()?,
            settling: config.settling.times()?,
            visible_from: config.visibility.least_grade()?,
            occupied_from: threshold("visibility.occupied_from", config.visibility.occupied_from)?,
            axes,
        })
    }

    /// An empty map for these parameters.
    pub fn map(&self) -> PolarMap<R, A> {
        PolarMap::unknown(self.axes.polar(&self.levelling), self.visible_from, self.occupied_from)
    }

    /// Makes a map one for these parameters, where it lies: controllers have no stack for a second.
    pub fn prepare(&self, map: &mut PolarMap<R, A>) {
        map.prepare(self.axes.polar(&self.levelling), self.visible_from, self.occupied_from);
    }

    /// Whether a place is on the map, or nearer than what is in view on it. What stands at the sensor's feet
    /// reflects below the field of view; what lies behind its far edge was never measured.
    fn reaches(&self, r: &Reflection) -> bool {
        let end = self.axes.column(r.bearing()).map_or(0, |a| self.axes.view(a).end);
        self.axes.range_cell(i32::from(r.ground_cm)).is_some_and(|cell| cell < end)
    }

    /// Least grade that counts as visible.
    pub fn visible_from(&self) -> u8 {
        self.visible_from
    }

    /// The grid's axes.
    pub fn axes(&self) -> &Axes<R, A, E> {
        &self.axes
    }

    /// How well the sensor measures, as configured.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// The parameters of obstacle tracking.
    pub fn tracking(&self) -> &TrackingParameters {
        &self.tracking
    }

    /// The mount.
    pub fn levelling(&self) -> &Levelling {
        &self.levelling
    }
}

/// A share of one as a byte, at least 2: grade 1 is blocked.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limits are checked
fn threshold(name: &'static str, share: f32) -> Result<u8, ConfigError> {
    within(name, share, 0.01, 1.0).map(|s| math::round_i32(s * 255.0 + 0.25).clamp(2, 255) as u8)
}

/// The estimator's state: `R` ranges (up to `32 W`), `A` azimuths, `E` elevations, `N` obstacles, `D`
/// detections.
#[derive(Debug, Clone)]
pub struct Radar3d<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> {
    scan: Scan<D>,
    repeatability: Repeatability,
    obstacles: Obstacles<N>,
    grid: SphericalGrid<R, A, E, W>,
    health: Health,
    settling: Settling<A>,
    is_settled: bool,
    rejections: Rejections,
}

/// What a frame did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameReport {
    /// How the frame follows the last.
    pub continuity: Continuity,
    /// What the sensor's frames say of it.
    pub condition: Condition,
    /// Detections used.
    pub used: u16,
    /// Detections rejected in this frame, by reason.
    pub rejections: Rejections,
    /// Obstacles followed, confirmed or not.
    pub obstacles: u16,
    /// New obstacles that found the list full, since the start: vehicles beyond are not followed and hide nothing.
    pub obstacles_dropped: u32,
}

#[cfg(feature = "defmt")]
impl FrameReport {
    /// Says what an engineer at the unit should know, and all of it at trace level.
    fn log(&self) {
        if self.continuity.resets() {
            defmt::warn!("grids start over: {}", self.continuity);
        }
        if self.condition != Condition::Healthy {
            defmt::warn!("map unknown: {}", self.condition);
        }
        defmt::trace!("{}", self);
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> Default
    for Radar3d<R, A, E, W, N, D>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>
    Radar3d<R, A, E, W, N, D>
{
    /// Range cells.
    pub const RANGES: usize = R;
    /// Azimuths.
    pub const AZIMUTHS: usize = A;
    /// Elevation rows.
    pub const ELEVATIONS: usize = E;
    /// Words of 32 range cells.
    pub const WORDS: usize = W;
    /// Moving obstacles.
    pub const OBSTACLES: usize = N;
    /// Detections a scan.
    pub const DETECTIONS: usize = D;

    /// Knows nothing; to be placed in static memory.
    pub const fn new() -> Self {
        Self {
            scan: Scan::new(),
            repeatability: Repeatability::new(),
            obstacles: Obstacles::new(),
            grid: SphericalGrid::new(),
            health: Health::NEW,
            settling: Settling::NEW,
            is_settled: false,
            rejections: Rejections::NONE,
        }
    }

    /// Forgets everything but the counters.
    pub fn reset(&mut self) {
        self.repeatability = Repeatability::new();
        self.obstacles.clear();
        self.obstacles.forget_what_was_learnt();
        self.grid.clear();
        self.health = Health::NEW;
        self.settling = Settling::NEW;
    }

    /// Takes a radar frame and brings the map up to its time. `status` is the sensor's own fault flag, and where there can be any
    /// with it the number of points that are no detections.
    pub fn process<'a>(
        &mut self,
        p: &Radar3dParameters<R, A, E>,
        now: Time,
        detections: impl IntoIterator<Item = &'a Detection, IntoIter: Clone>,
        status: impl Into<FrameStatus>,
        map: &mut PolarMap<R, A>,
    ) -> FrameReport {
        self.process_traced(p, now, detections, status, map, &mut || {})
    }

    /// [`process`](Self::process) that calls `ended` as each of its seven stages ends.
    pub fn process_traced<'a>(
        &mut self,
        p: &Radar3dParameters<R, A, E>,
        now: Time,
        detections: impl IntoIterator<Item = &'a Detection, IntoIter: Clone>,
        status: impl Into<FrameStatus>,
        map: &mut PolarMap<R, A>,
        ended: &mut impl FnMut(),
    ) -> FrameReport {
        let status = status.into();
        let noise = self.repeatability.noise(&p.noise);
        let place = |d: &Detection| noise.place_on(d, &p.levelling, p.axes.ground());
        let points = self.scan.gather(now, detections.into_iter(), status, &p.gate, place);
        let points = self.scan.within_reach(points, |r| p.reaches(r));
        let continuity = self.health.frame(now, &points, status.fault, &p.health);
        if continuity == Continuity::Unjudged {
            for _ in 0..STAGES {
                ended();
            }
            let condition = self.expire(p, now, map);
            return self.report(continuity, condition);
        }
        if continuity.resets() {
            self.obstacles.clear();
            self.grid.clear();
            self.settling = Settling::NEW;
        }
        let (step, gap) = match continuity {
            Continuity::Follows(micros) if micros > LONGEST_STEP_US => {
                (Step::from_micros(LONGEST_STEP_US), Step::from_micros(micros - LONGEST_STEP_US))
            }
            Continuity::Follows(micros) => (Step::from_micros(micros), Step::NONE),
            _ => (Step::NONE, Step::NONE),
        };
        if gap > Step::NONE {
            self.bridge(p, gap, map);
        }
        ended();
        let by_range = ByRange::sort(self.scan.reflections(), p.tracking.limit_cm);
        if gap == Step::NONE && matches!(continuity, Continuity::Follows(_)) {
            self.repeatability.compare(self.scan.reflections(), &by_range, &p.noise);
        }
        let claimed = self.follow_obstacles(p, &by_range, step, map);
        ended();
        self.update_grid(p, step, continuity, (&by_range, &claimed), map, ended);
        let condition = self.health.condition(now, &p.health);
        if condition == Condition::Healthy {
            raycast::cast(&self.grid, &p.axes, map);
        } else {
            map.forget();
        }
        ended();
        self.put_obstacles(p, map);
        // in a gap nobody looked, and what cannot be judged is no look
        let looked = if gap > Step::NONE || self.health.in_doubt() { Step::NONE } else { step };
        let condition = self.settle(p, condition, (step, looked), map);
        ended();
        self.report(continuity, condition)
    }

    #[allow(clippy::cast_possible_truncation)] // bounded lists
    fn report(&mut self, continuity: Continuity, condition: Condition) -> FrameReport {
        self.rejections.add_all(self.scan.rejections());
        let report = FrameReport {
            continuity,
            condition,
            used: self.scan.reflections().len() as u16,
            rejections: *self.scan.rejections(),
            obstacles: self.obstacles.iter().count() as u16,
            obstacles_dropped: self.obstacles.dropped(),
        };
        #[cfg(feature = "defmt")]
        report.log();
        report
    }

    /// Moves what is known on over a gap in the frames, less certain the longer it was. Nothing was looked at.
    fn bridge(&mut self, p: &Radar3dParameters<R, A, E>, gap: Step, map: &mut PolarMap<R, A>) {
        map.forget();
        self.settling.gap(gap, &p.settling, &self.grid);
        self.obstacles.bridge(gap, &p.tracking);
        p.inverse_sensor.fade(&mut self.grid, map, gap);
    }

    /// Takes off the map what is not settled, if there is one.
    fn settle(
        &mut self,
        p: &Radar3dParameters<R, A, E>,
        condition: Condition,
        (step, looked): (Step, Step),
        map: &mut PolarMap<R, A>,
    ) -> Condition {
        if condition == Condition::Unusable {
            // nobody knows what came meanwhile
            self.settling.gap(step, &p.settling, &self.grid);
        }
        if condition != Condition::Healthy {
            return condition;
        }
        self.is_settled = self.settling.settle(looked, &p.settling, &p.axes, &self.grid, map);
        self.condition(condition)
    }

    /// What is to be said of a map, settled or not, of a sensor in this condition.
    fn condition(&self, of_frames: Condition) -> Condition {
        if of_frames == Condition::Healthy && !self.is_settled { Condition::Settling } else { of_frames }
    }

    fn follow_obstacles(
        &mut self,
        p: &Radar3dParameters<R, A, E>,
        by_range: &ByRange<D>,
        step: Step,
        map: &PolarMap<R, A>,
    ) -> Claimed<D> {
        let in_view = |x, y| map.locate(x, y).is_some_and(|(a, r)| map.cell(a, r).visible());
        let reflections = self.scan.reflections();
        self.obstacles.step(reflections, by_range, step, &p.tracking, in_view)
    }

    fn update_grid(
        &mut self,
        p: &Radar3dParameters<R, A, E>,
        step: Step,
        continuity: Continuity,
        (by_range, claimed): (&ByRange<D>, &Claimed<D>),
        map: &PolarMap<R, A>,
        ended: &mut impl FnMut(),
    ) {
        let first = !matches!(continuity, Continuity::Follows(_));
        p.inverse_sensor.fade(&mut self.grid, map, step);
        ended();
        let reflections = self.scan.reflections();
        p.inverse_sensor.clear(reflections, &p.axes, &mut self.grid);
        ended();
        for (i, r) in reflections.iter().enumerate() {
            // what moves leaves no lasting evidence; in a first frame nobody knows yet what moves
            let around = if first {
                Around::Unknown
            } else if claimed.contains(i) || p.tracking.course(r).is_some() {
                continue;
            } else if by_range.is_one_of(BODY_REFLECTIONS, BODY_CM, r, |k| !claimed.contains(k)) {
                Around::Body
            } else {
                Around::Nothing
            };
            p.inverse_sensor.add(r, around, &p.axes, &mut self.grid);
        }
        ended();
    }

    fn put_obstacles(&mut self, p: &Radar3dParameters<R, A, E>, map: &mut PolarMap<R, A>) {
        for solid in self.obstacles.solids(&p.tracking) {
            shadow::cast(&solid, &p.axes, &mut self.grid, map);
        }
    }

    /// Makes the map unknown when its time has run out; to be called when no frame comes.
    pub fn expire(&self, p: &Radar3dParameters<R, A, E>, now: Time, map: &mut PolarMap<R, A>) -> Condition {
        let condition = self.health.condition(now, &p.health);
        if condition != Condition::Healthy {
            map.forget();
        }
        self.condition(condition)
    }

    /// Detections rejected since the start, by reason.
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }

    /// How well the sensor measures vehicles, their azimuth as fixtures have shown it.
    pub fn noise(&self, p: &Radar3dParameters<R, A, E>) -> Noise {
        self.repeatability.noise(&p.noise)
    }

    /// The moving obstacles.
    pub fn obstacles(&self) -> &Obstacles<N> {
        &self.obstacles
    }

    /// The occupancy grid.
    pub fn grid(&self) -> &SphericalGrid<R, A, E, W> {
        &self.grid
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> Estimator
    for Radar3d<R, A, E, W, N, D>
{
    type Config = (Sensor, Radar3dConfig);
    type Parameters = Radar3dParameters<R, A, E>;
    type Input = [Detection];
    type Map = PolarMap<R, A>;

    fn parameters((sensor, config): &Self::Config) -> Result<Self::Parameters, ConfigError> {
        Radar3dParameters::new(sensor, config)
    }

    fn prepare(parameters: &Self::Parameters, map: &mut Self::Map) {
        parameters.prepare(map);
    }

    fn forget(&mut self, map: &mut Self::Map) {
        self.reset();
        map.forget();
    }

    fn process(
        &mut self,
        parameters: &Self::Parameters,
        measured: Time,
        input: &[Detection],
        status: FrameStatus,
        map: &mut Self::Map,
        ended: &mut impl FnMut(),
    ) -> Progress {
        let report = self.process_traced(parameters, measured, input, status, map, ended);
        Progress { continuity: report.continuity, condition: report.condition, used: report.used }
    }

    fn expire(&mut self, parameters: &Self::Parameters, now: Time, map: &mut Self::Map) -> Condition {
        Self::expire(self, parameters, now, map)
    }
}
