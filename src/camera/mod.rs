//! The camera-3d estimator: boxes of a detector in, a map of what the camera sees out.
//!
//! A unit often has a camera beside the radar. Its boxes give what a radar does not: size and class.
//!
//! ```text
//! image boxes -> checked -> lifted onto the road -> voxels, which fade -> lines of sight
//!                                                                               |
//!                        rays of a polar map, sent <- map: mean visibility above each cell
//! ```
//!
//! # Model
//! A box and its class become an upright box on the road ([`lift`]), that fills voxels of 1 x 1 x 0.5 m ahead of
//! the camera. Lines of sight are cast through them, and a cell is visible where the mean visibility of
//! the voxels 0 to 4 m above it reaches [`Camera3dConfig::visible_share`]. That is a choice between trucks and cars:
//! of a car, 1.5 m high, nothing shows while 62 % of the column does, and a truck shows enough of itself long before.
//!
//! A camera that is silent, says that it is faulty, or finds nothing at all any more is no evidence, and the map is
//! unknown ([`crate::frame::health`]). So are cells outside of the image and beyond the grid.
//!
//! # Limits
//! 200 x 60 cells: 62 kB of state and parameters, 24 kB a map. [`MOST_BOXES`] boxes a frame. The road is flat, and
//! the traffic has one heading: a vehicle that turns is placed right and filled along the road.
//!
//! # References
//! Börger, Zapf, Kopytjuk, Li, Gläser, "Sensor Visibility Estimation: Metrics and Methods for Systematic Performance
//! Evaluation and Improvement", arXiv 2211.06308.
//!
//! # Example
//!
//! ```
//! use viewshed::camera::boxes::{ImageBox, VehicleClass};
//! use viewshed::camera::calibration::{Calibration, Intrinsics};
//! use viewshed::camera::{Camera3dConfig, Camera3dParameters, CameraProfile};
//! use viewshed::fixed::time::Time;
//! use viewshed::map::query::{self, Answer};
//! use viewshed::sensor::mount::Mount;
//! use viewshed::sensor::road::RoadPoint;
//!
//! // on a gantry, 6 m up, looking 6 degrees down
//! let calibration = Calibration {
//!     intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1663.0, 1663.0], center_px: [960.0, 540.0] },
//!     mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 6.0, roll_deg: 0.0 },
//! };
//! let parameters = Camera3dParameters::new(&calibration, &Camera3dConfig::default())?;
//! // on a controller: a static
//! let mut camera = Box::new(CameraProfile::new());
//! let mut map = parameters.map();
//!
//! // a truck straight ahead, its rear at 40 m
//! let truck = ImageBox::from_pixels([907.0, 398.0, 1013.0, 614.0], VehicleClass::Truck).expect("finite");
//! camera.process(&parameters, Time::from_micros(0), &[truck], false, &mut map);
//! let ahead = |x_m| RoadPoint::from_metres(x_m, 0.5).map(|point| query::point(&map, point));
//! assert_eq!(ahead(30.5)?, Answer::VisibleFree);
//! assert_eq!(ahead(70.5)?, Answer::Invisible);
//! # Ok::<(), viewshed::sensor::config::ConfigError>(())
//! ```

pub mod boxes;
pub mod calibration;
mod homography;
pub mod lift;
pub mod map;
mod points;
mod projection;
mod sight;
mod voxels;

use crate::camera::boxes::{BoxRejection, BoxRejections, ImageBox, SUBPIXELS};
use crate::camera::calibration::Calibration;
use crate::camera::lift::{LiftedBox, Lifting};
use crate::camera::map::CameraMap;
use crate::camera::projection::Projection;
use crate::camera::sight::{Skyline, View};
use crate::camera::voxels::{FULL, Standing, Voxels};
use crate::estimator::{Estimator, Progress};
use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::time::{Step, Time};
use crate::fixed::trig::{self, Direction};
use crate::frame::health::{Condition, Continuity, FrameStatus, Health, HealthConfig, HealthLimits, Points};
use crate::map::polar::PolarGeometry;
use crate::sensor::config::{ConfigError, Problem, within};
use crate::sensor::mount::Levelling;

/// Most boxes of a frame that are used.
pub const MOST_BOXES: usize = 500;

/// Everything that can be set, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Camera3dConfig {
    /// Heading of the traffic in the road frame, degrees; the opposite direction is the same.
    pub traffic_heading_deg: f32,
    /// Standard deviation of a box's edge, pixels.
    pub edge_noise_px: f32,
    /// Farthest cell in view, metres.
    pub range_max_m: f32,
    /// Time in which full occupancy fades to nothing, seconds.
    pub memory_s: f32,
    /// Height at which a cell is in view or not, metres.
    pub slice_height_m: f32,
    /// Least mean visibility of the voxels above a cell that counts as visible.
    pub visible_share: f32,
    /// When maps end.
    pub health: HealthConfig,
}

impl Default for Camera3dConfig {
    fn default() -> Self {
        Self {
            traffic_heading_deg: 0.0,
            edge_noise_px: 2.0,
            range_max_m: 200.0,
            memory_s: 0.2,
            slice_height_m: 1.0,
            visible_share: 0.6,
            health: HealthConfig::default(),
        }
    }
}

/// The configuration, checked and in integers, for `NX` rows of `NY` cells.
#[derive(Debug, Clone)]
pub struct Camera3dParameters<const NX: usize, const NY: usize> {
    projection: Projection,
    lifting: Lifting,
    view: View<NX>,
    /// Evidence lost in a second, 2^-8.
    loss: i32,
    health: HealthLimits,
    visible_from: u8,
}

/// Evidence from which a cell is occupied: half of full.
const OCCUPIED_FROM: u8 = 128;

impl<const NX: usize, const NY: usize> Camera3dParameters<NX, NY> {
    /// Checks a configuration.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limits are checked
    pub fn new(calibration: &Calibration, config: &Camera3dConfig) -> Result<Self, ConfigError> {
        let projection = Projection::new(calibration)?;
        let range = within("range_max_m", config.range_max_m, 1.0, 400.0)?;
        let slice = within("slice_height_m", config.slice_height_m, 0.0, 4.0)?;
        let heading = within("traffic_heading_deg", config.traffic_heading_deg, -360.0, 360.0)?;
        let noise = within("edge_noise_px", config.edge_noise_px, 0.1, 100.0)?;
        let memory = within("memory_s", config.memory_s, 0.01, 600.0)?;
        let share = within("visible_share", config.visible_share, 0.01, 1.0)?;
        let view = View::new::<NY>(&projection, math::round_i32(slice * 100.0), math::round_i32(range * 100.0));
        let pitch_deg = calibration.mount.pitch_deg;
        let nothing = ConfigError { parameter: "mount.pitch_deg", value: pitch_deg, problem: Problem::NothingInView };
        Ok(Self {
            lifting: Lifting {
                heading: turned(projection.levelling.road_axis(), trig::direction(Angle::from_degrees(heading))),
                edge_noise: projection.tangent_of_rows(math::round_i32(noise * SUBPIXELS as f32)),
            },
            view: view.ok_or(nothing)?,
            loss: math::round_i32(f32::from(FULL) * 256.0 / memory),
            health: config.health.limits()?,
            visible_from: (math::round_i32(share * 254.0) + 1).clamp(2, 255) as u8,
            projection,
        })
    }

    /// An empty map for these parameters.
    pub fn map(&self) -> CameraMap<NX, NY> {
        CameraMap::unknown(*self.levelling(), self.azimuth(), self.visible_from, OCCUPIED_FROM)
    }

    /// Right and left end of the view, from the boresight's heading.
    fn azimuth(&self) -> [Angle; 2] {
        self.view.tangents.map(|t| Angle::from_radians(math::atan2(t, 1.0)))
    }

    /// The mount.
    pub(crate) fn levelling(&self) -> &Levelling {
        &self.projection.levelling
    }

    /// Where the cells lie of the polar map as which maps are sent.
    pub(crate) fn geometry(&self) -> PolarGeometry {
        map::geometry(self.levelling(), self.azimuth())
    }

    /// Cells in view straight ahead, from and to.
    pub(crate) fn ahead(&self) -> [usize; 2] {
        self.view.ahead::<NY>()
    }

    /// Lifts the boxes of a frame onto the road; what is not used is counted by reason.
    #[allow(clippy::cast_possible_truncation)] // bounded lists
    pub fn lift(&self, boxes: &[ImageBox], mut visit: impl FnMut(LiftedBox)) -> BoxRejections {
        let mut rejections = BoxRejections::NONE;
        let used = boxes.get(..MOST_BOXES).unwrap_or(boxes);
        rejections.add(BoxRejection::TooMany, boxes.len().saturating_sub(MOST_BOXES) as u32);
        for own in used {
            let lifted = lift::check(own, &self.projection)
                .and_then(|()| self.lifting.lift(own, lift::free_edges(own, used, &self.projection), &self.projection));
            match lifted {
                Ok(lifted) => visit(lifted),
                Err(reason) => rejections.add(reason, 1),
            }
        }
        rejections
    }
}

/// A direction turned by another.
#[allow(clippy::cast_possible_truncation)] // both are unit vectors
fn turned(by: Direction, own: Direction) -> Direction {
    let (x, y) = (i32::from(own.x), i32::from(own.y));
    let (bx, by) = (i32::from(by.x), i32::from(by.y));
    Direction::of((x * bx - y * by) >> 7, (x * by + y * bx) >> 7)
}

/// The estimator's state.
#[derive(Debug, Clone)]
pub struct Camera3d<const NX: usize, const NY: usize> {
    voxels: Voxels<NX, NY>,
    skyline: Skyline,
    health: Health,
    rejections: BoxRejections,
}

/// 200 m ahead, 30 m to each side.
pub type CameraProfile = Camera3d<200, 60>;

/// What a frame did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CameraReport {
    /// How the frame follows the last.
    pub continuity: Continuity,
    /// What the camera's frames say of it.
    pub condition: Condition,
    /// Boxes used.
    pub used: u16,
    /// Boxes rejected in this frame, by reason.
    pub rejections: BoxRejections,
}

impl<const NX: usize, const NY: usize> Default for Camera3d<NX, NY> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const NX: usize, const NY: usize> Camera3d<NX, NY> {
    /// Knows nothing; to be placed in static memory.
    pub const fn new() -> Self {
        Self { voxels: Voxels::EMPTY, skyline: Skyline::NEW, health: Health::NEW, rejections: BoxRejections::NONE }
    }

    /// Forgets everything but the counters.
    pub fn reset(&mut self) {
        self.voxels.clear();
        self.health = Health::NEW;
    }

    /// Takes a camera frame and brings the map up to its time. `status` is the camera's own fault flag, and where
    /// there can be any with it the number of boxes that were none.
    pub fn process(
        &mut self,
        p: &Camera3dParameters<NX, NY>,
        now: Time,
        boxes: &[ImageBox],
        status: impl Into<FrameStatus>,
        map: &mut CameraMap<NX, NY>,
    ) -> CameraReport {
        self.process_traced(p, now, boxes, status, map, &mut || {})
    }

    /// [`process`](Self::process) that calls `ended` as each of its two stages ends: boxes into voxels, lines of sight.
    #[allow(clippy::cast_possible_truncation)] // bounded lists
    fn process_traced(
        &mut self,
        p: &Camera3dParameters<NX, NY>,
        now: Time,
        boxes: &[ImageBox],
        status: impl Into<FrameStatus>,
        map: &mut CameraMap<NX, NY>,
        ended: &mut impl FnMut(),
    ) -> CameraReport {
        let status = status.into();
        let used = boxes.get(..MOST_BOXES).unwrap_or(boxes);
        let inside = used.iter().filter(|b| lift::check(b, &p.projection).is_ok()).count() as u32;
        let refused = status.refused.into();
        let points = Points { inside, outside: used.len() as u32 - inside, refused, ..Points::default() };
        let continuity = self.begin(p, now, &points, status.fault);
        let (mut filled, mut off_grid) = (0_u16, 0);
        let mut rejections = p.lift(boxes, |lifted| match self.fill(p, &lifted) {
            true => filled = filled.saturating_add(1),
            false => off_grid += 1,
        });
        rejections.add(BoxRejection::OffGrid, off_grid);
        rejections.add(BoxRejection::Refused, refused);
        self.rejections.add_all(&rejections);
        ended();
        let condition = self.finish(p, now, map);
        ended();
        CameraReport { continuity, condition, used: filled, rejections }
    }

    /// The same with vehicles whose place on the road is known already, from another source or from truth. What
    /// lies beyond the grid is left out.
    #[allow(clippy::cast_possible_truncation)] // saturated
    pub fn process_lifted(
        &mut self,
        p: &Camera3dParameters<NX, NY>,
        now: Time,
        vehicles: &[LiftedBox],
        status: impl Into<FrameStatus>,
        map: &mut CameraMap<NX, NY>,
    ) -> Condition {
        let status = status.into();
        let inside = vehicles.len().min(u32::MAX as usize) as u32;
        let points = Points { inside, refused: status.refused.into(), ..Points::default() };
        self.begin(p, now, &points, status.fault);
        for vehicle in vehicles {
            self.fill(p, vehicle);
        }
        self.finish(p, now, map)
    }

    fn begin(&mut self, p: &Camera3dParameters<NX, NY>, now: Time, points: &Points, fault: bool) -> Continuity {
        let continuity = self.health.frame(now, points, fault, &p.health);
        match continuity {
            Continuity::Follows(micros) => self.voxels.fade(Step::from_micros(micros), p.loss),
            Continuity::First | Continuity::Unjudged => {}
            Continuity::Gap | Continuity::ClockStepped => self.voxels.clear(),
        }
        continuity
    }

    fn fill(&mut self, p: &Camera3dParameters<NX, NY>, vehicle: &LiftedBox) -> bool {
        let levelling = &p.projection.levelling;
        let footprint = &vehicle.footprint;
        self.voxels.fill(&Standing {
            at: levelling.place(footprint.centre),
            heading: turned(levelling.road_axis(), footprint.heading),
            half_length: footprint.half_length_cm,
            half_width: footprint.half_width_cm,
            height: vehicle.height_cm,
        })
    }

    fn finish(&mut self, p: &Camera3dParameters<NX, NY>, now: Time, map: &mut CameraMap<NX, NY>) -> Condition {
        let condition = self.health.condition(now, &p.health);
        if condition == Condition::Healthy {
            let Self { voxels, skyline, .. } = self;
            let (grades, occupancy) = map.rows_mut();
            p.view.cast(voxels, skyline, grades, occupancy);
        } else {
            map.forget();
        }
        condition
    }

    /// Makes the map unknown when its time has run out; to be called when no frame comes.
    pub fn expire(&self, p: &Camera3dParameters<NX, NY>, now: Time, map: &mut CameraMap<NX, NY>) -> Condition {
        let condition = self.health.condition(now, &p.health);
        if condition != Condition::Healthy {
            map.forget();
        }
        condition
    }

    /// Boxes rejected since the start, by reason.
    pub fn rejections(&self) -> &BoxRejections {
        &self.rejections
    }
}

impl<const NX: usize, const NY: usize> Estimator for Camera3d<NX, NY> {
    type Config = (Calibration, Camera3dConfig);
    type Parameters = Camera3dParameters<NX, NY>;
    type Input = [ImageBox];
    type Map = CameraMap<NX, NY>;

    fn parameters((calibration, config): &Self::Config) -> Result<Self::Parameters, ConfigError> {
        Camera3dParameters::new(calibration, config)
    }

    fn prepare(parameters: &Self::Parameters, map: &mut Self::Map) {
        map.prepare(*parameters.levelling(), parameters.azimuth(), parameters.visible_from, OCCUPIED_FROM);
    }

    fn forget(&mut self, map: &mut Self::Map) {
        self.reset();
        map.forget();
    }

    fn process(
        &mut self,
        parameters: &Self::Parameters,
        measured: Time,
        input: &[ImageBox],
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
