//! The radar-2d estimator, the conventional baseline: occupancy and sight on a flat Cartesian grid.
//!
//! ```text
//! detections -> gate -> reflections on the ground -> Cartesian grid -> sightlines -> map
//! ```

pub mod cartesian;
pub mod sightlines;

use crate::fixed::math;
use crate::fixed::time::{Step, Time};
use crate::frame::detection::Detection;
use crate::frame::gate::{Gate, GateConfig, Rejections};
use crate::frame::health::{Condition, Continuity, FrameStatus, Health, HealthConfig, HealthLimits};
use crate::frame::reflection::Reflection;
use crate::frame::scan::Scan;
use crate::map::query::Footprint;
use crate::map::{CellState, Visibility, VisibilityMap};
use crate::radar_2d::cartesian::{CELL_CM, CartesianConfig, CartesianGrid, CartesianParameters, OCCUPIED};
use crate::radar_2d::sightlines::{Fan, Sightlines};
use crate::sensor::Sensor;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::field_of_view::Limits;
use crate::sensor::mount::Levelling;
use crate::sensor::noise::Noise;
use crate::sensor::road::RoadPoint;

/// Everything that can be set, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Radar2dConfig {
    /// Which detections count.
    pub gate: GateConfig,
    /// The grid.
    pub cartesian: CartesianConfig,
    /// Height at which a place is in view or not, metres.
    pub slice_height_m: f32,
    /// When maps end.
    pub health: HealthConfig,
}

impl Default for Radar2dConfig {
    fn default() -> Self {
        Self {
            gate: GateConfig::default(),
            cartesian: CartesianConfig::default(),
            slice_height_m: 1.0,
            health: HealthConfig::default(),
        }
    }
}

/// The configuration, checked and in integers.
#[derive(Debug, Clone)]
pub struct Radar2dParameters {
    levelling: Levelling,
    view: Limits,
    gate: Gate,
    noise: Noise,
    cartesian: CartesianParameters,
    fan: Fan,
    slice_height_cm: i32,
    health: HealthLimits,
}

impl Radar2dParameters {
    /// Checks a configuration for a grid of `NX` by `8 * NW` cells and `N` rays.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with.
    pub fn new<const NX: usize, const NW: usize, const N: usize>(
        sensor: &Sensor,
        config: &Radar2dConfig,
    ) -> Result<Self, ConfigError> {
        let levelling = sensor.mount.levelling()?;
        let view = sensor.field_of_view.limits()?;
        let slice = within("slice_height_m", config.slice_height_m, 0.0, 10.0)?;
        let fan = Fan::new(&view, N, CELL_CM);
        let range_max_m = sensor.field_of_view.range_max_m;
        let corners = fan.outline(view.range_cm[1]).map(|(x, y)| levelling.unplace(x, y));
        Ok(Self {
            gate: config.gate.gate(&view)?,
            noise: sensor.noise.noise()?,
            cartesian: config.cartesian.parameters::<NX, NW>(corners, range_max_m)?,
            fan,
            slice_height_cm: math::round_i32(slice * 100.0),
            health: config.health.limits()?,
            levelling,
            view,
        })
    }
}

impl Radar2dParameters {
    /// Whether a place lies below the field of view's upper limit: what is nearer than the view reflects as well.
    fn reaches(&self, r: &Reflection) -> bool {
        let place = [r.x_cm, r.y_cm, self.slice_height_cm - self.levelling.height_cm];
        self.view.reaches(self.levelling.unlevel(place))
    }
}

/// Which places behind an occupied one count as visible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Radar2dReading {
    /// All up to the last occupied cell on the ray: the sensor measured there.
    Last,
    /// All up to the end of the first occupied run.
    First,
}

/// The estimator's state: a grid of `NX` by `8 * NW` cells, `N` rays, `D` detections.
#[derive(Debug, Clone)]
pub struct Radar2d<const NX: usize, const NW: usize, const N: usize, const D: usize> {
    scan: Scan<D>,
    grid: CartesianGrid<NX, NW>,
    sightlines: Sightlines<N>,
    health: Health,
    /// Whether the last frame left a map.
    known: bool,
    rejections: Rejections,
}

impl<const NX: usize, const NW: usize, const N: usize, const D: usize> Default for Radar2d<NX, NW, N, D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const NX: usize, const NW: usize, const N: usize, const D: usize> Radar2d<NX, NW, N, D> {
    /// Knows nothing; to be placed in static memory.
    pub const fn new() -> Self {
        Self {
            scan: Scan::new(),
            grid: CartesianGrid::new(),
            sightlines: Sightlines::new(),
            health: Health::NEW,
            known: false,
            rejections: Rejections::NONE,
        }
    }

    /// Forgets everything but the counters.
    pub fn reset(&mut self) {
        self.grid.clear();
        self.sightlines.clear();
        self.health = Health::NEW;
        self.known = false;
    }

    /// Takes a radar frame. `status` is the sensor's own fault flag, and where there can be any with it the number of
    /// points that are no detections.
    pub fn process<'a>(
        &mut self,
        p: &Radar2dParameters,
        now: Time,
        detections: impl IntoIterator<Item = &'a Detection, IntoIter: Clone>,
        status: impl Into<FrameStatus>,
    ) -> Condition {
        let status = status.into();
        let place = |d: &Detection| p.noise.place_flat(d, &p.levelling);
        let points = self.scan.gather(now, detections.into_iter(), status, &p.gate, place);
        self.rejections.add_all(self.scan.rejections());
        let points = self.scan.within_reach(points, |r| p.reaches(r));
        match self.health.frame(now, &points, status.fault, &p.health) {
            Continuity::Follows(micros) => self.grid.fade(Step::from_micros(micros), &p.cartesian),
            Continuity::First => {}
            Continuity::Gap | Continuity::ClockStepped => self.grid.clear(),
            Continuity::Unjudged => return self.expire(p, now),
        }
        for r in self.scan.reflections() {
            self.grid.add(r, &p.noise, &p.levelling, &p.cartesian);
        }
        self.sightlines.clear();
        let sightlines = &mut self.sightlines;
        self.grid.each_occupied(&p.cartesian, |i, j| {
            let (x, y) = p.levelling.place_near(RoadPoint::cell_centre(i, j));
            sightlines.block(x, y, &p.fan);
        });
        self.expire(p, now)
    }

    /// Makes the map unknown when its time has run out; to be called when no frame comes.
    pub fn expire(&mut self, p: &Radar2dParameters, now: Time) -> Condition {
        let condition = self.health.condition(now, &p.health);
        self.known = condition == Condition::Healthy;
        condition
    }

    /// The map, by one reading.
    pub fn map<'a>(&'a self, p: &'a Radar2dParameters, reading: Radar2dReading) -> Radar2dMap<'a, NX, NW, N> {
        let visible_from = match reading {
            Radar2dReading::Last => 2,
            Radar2dReading::First => 255,
        };
        Radar2dMap { grid: &self.grid, sightlines: &self.sightlines, known: self.known, visible_from, parameters: p }
    }

    /// Detections rejected since the start, by reason.
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }
}

/// The map of the last frame.
#[derive(Debug, Clone)]
pub struct Radar2dMap<'a, const NX: usize, const NW: usize, const N: usize> {
    grid: &'a CartesianGrid<NX, NW>,
    sightlines: &'a Sightlines<N>,
    known: bool,
    visible_from: u8,
    parameters: &'a Radar2dParameters,
}

impl<const NX: usize, const NW: usize, const N: usize> Radar2dMap<'_, NX, NW, N> {
    fn looks_at(&self, (x, y): (i32, i32)) -> bool {
        let p = self.parameters;
        self.known && p.view.contains(p.levelling.unlevel([x, y, p.slice_height_cm - p.levelling.height_cm]))
    }

    fn state(&self, grade: u8, occupancy: u8) -> CellState {
        CellState {
            visibility: if grade >= self.visible_from { Visibility::Visible } else { Visibility::Invisible },
            grade,
            occupancy,
            occupied: occupancy >= OCCUPIED,
        }
    }
}

impl<const NX: usize, const NW: usize, const N: usize> VisibilityMap for Radar2dMap<'_, NX, NW, N> {
    fn at(&self, point: RoadPoint) -> CellState {
        let p = self.parameters;
        let (x, y) = p.levelling.place(point);
        if !self.looks_at((x, y)) {
            return CellState::UNKNOWN;
        }
        let grade = self.sightlines.grade(x, y, &p.fan);
        let cell = (point.x_cm.div_euclid(CELL_CM), point.y_cm.div_euclid(CELL_CM));
        self.state(grade, self.grid.occupancy(cell.0, cell.1, &p.cartesian).unwrap_or(0))
    }

    /// One state: rays and occupied cells do not share edges. Between corners of parts of half a metre the edge of the
    /// view is straight to a centimetre or two, by which parts reach over.
    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        let p = self.parameters;
        let (mut inside, mut occupancy) = (true, 0);
        area.parts(CELL_CM / 2, |part| {
            inside &= part.corners().iter().all(|corner| self.looks_at(p.levelling.place(*corner)));
        });
        area.each_square(RoadPoint::new(0, 0), CELL_CM, |i, j| {
            occupancy = self.grid.occupancy(i, j, &p.cartesian).unwrap_or(0).max(occupancy);
        });
        let grade = self.sightlines.least_grade(area, &p.levelling, &p.fan);
        visit(if inside { self.state(grade, occupancy) } else { CellState::UNKNOWN });
    }
}
