//! The library's estimators, driven by recordings.

pub mod at_risk;
mod before;
pub mod camera_3d;
pub mod fused;
mod radar_2d;
pub mod radar_3d;
mod reference;
mod site;
pub mod usable;

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use viewshed::camera::Camera3dConfig;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::{Detection, NotADetection};
use viewshed::frame::gate::{Rejection, Rejections};
use viewshed::frame::health::{Condition, FrameStatus};
use viewshed::grid::settling::SettlingConfig;
use viewshed::map::polar::{PolarGeometry, PolarMap};
use viewshed::map::{CellState, VisibilityMap};
use viewshed::obstacles::lanes;
use viewshed::radar_2d::{Radar2dConfig, Radar2dReading};
use viewshed::radar_3d::Radar3dConfig;
use viewshed::sensor::Sensor;
use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::azimuths;
use crate::geometry::ground::Ground;
use crate::geometry::polyline::spaced;
use crate::geometry::solid::Solid;
use crate::recording::{Frame, Recording};

/// A visibility estimator as the harness drives it: one radar frame in, one map out.
pub trait Estimator: Send {
    fn name(&self) -> &str;

    /// Forgets every frame seen, but not what was counted (called before each frame of a recording
    /// of independent frames).
    fn reset(&mut self);

    /// Runs over what was before the recording that is judged: what is learnt of that stays, and nothing of it is counted.
    fn run_in(&mut self, frames: &[Frame]) {
        frames.iter().for_each(|frame| self.step(frame));
    }

    /// Takes a radar frame and brings the map up to its time.
    fn step(&mut self, frame: &Frame);

    fn map(&self) -> &dyn VisibilityMap;

    /// The map's own polar cells, where it has any.
    fn polar(&self) -> Option<PolarCells<'_>> {
        None
    }

    /// The moving things it believes in, which cast the map's shadows; road frame.
    fn obstacles(&self) -> Vec<Solid> {
        Vec::new()
    }

    /// The same about the middle of what is seen of them, for bearings that are compared with another sensor's.
    fn where_seen(&self) -> Vec<Solid> {
        self.obstacles()
    }

    /// Where it has learnt lanes, each a short piece in the direction of its traffic.
    fn learnt_lanes(&self) -> Vec<Lane> {
        Vec::new()
    }

    /// What was rejected or dropped since construction, by reason.
    fn counters(&self) -> Vec<(&'static str, u64)> {
        Vec::new()
    }

    /// What its map is worth after the last frame; not healthy as long as it has not [settled](viewshed::grid::settling), or
    /// points come that cannot be used.
    fn condition(&self) -> Condition {
        Condition::Healthy
    }

    /// Azimuth's noise that it now works with, degrees, where that is learnt and not the configured one.
    fn azimuth_noise_deg(&self) -> Option<f64> {
        None
    }
}

/// The cells of a polar map: azimuths from right to left, ranges from near to far.
pub struct PolarCells<'a> {
    pub azimuths: usize,
    pub ranges: usize,
    /// Outer edges, radians from the boresight's heading, + left.
    pub azimuth_rad: [f64; 2],
    /// The first azimuth that is narrower than the others, the first behind them, how many times.
    pub narrow: [u8; 3],
    /// Length of a cell along the ground, metres.
    pub cell_m: f64,
    /// State of (azimuth, range).
    pub cell: Box<dyn Fn(usize, usize) -> CellState + 'a>,
}

/// Parameters of all estimators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Detections of a frame an estimator may use, of those that pass its gate; of more, those of crowded places go first.
    pub max_detections: usize,
    /// Share of a cell that boxes must fill for `true-boxes` to call it occupied.
    pub reference_share: f64,
    /// The grid of the estimator that is tuned, watched or drawn; on the small one, it runs beside `radar-3d` in tables.
    #[serde(skip_serializing_if = "Grid::is_reference")]
    pub grid: Grid,
    /// Where the far road lies. Each thing that is said of a site has a row of its own beside `radar-3d` in tables, this one
    /// `radar-3d-narrow`; and `radar-3d-site` has all of them, as the unit there would.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub far_road: Option<FarRoad>,
    /// How well the sensor measures.
    pub noise: NoiseConfig,
    pub radar_2d: Radar2dConfig,
    pub radar_3d: Radar3dConfig,
    pub camera_3d: Camera3dConfig,
    /// Which way traffic goes: the row `radar-3d-lanes`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lanes: Vec<Lane>,
    /// Height of the road over its length, metres, where it is not the recording's own: the row `radar-3d-ground`, and
    /// `true-boxes` with it.
    #[serde(skip_serializing_if = "Profile::is_empty")]
    pub ground: Profile,
    /// What is wrong with the heights that estimators are given.
    #[serde(skip_serializing_if = "GroundError::is_none")]
    pub ground_error: GroundError,
    /// What a unit has seen of the place before, and learnt its lanes from: the row `radar-3d-learning`.
    #[serde(skip)]
    pub before: Before,
}

/// Where the far road lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FarRoad {
    /// Along the road's axis, on the side the sensor looks to.
    AlongRoad,
    /// So many degrees from the sensor's heading, + left.
    Degrees(i8),
}

impl FarRoad {
    /// Degrees from a sensor's heading.
    pub fn degrees(self, sensor: &Sensor) -> i8 {
        match self {
            // the axis has two ends, 180 degrees apart: the nearer one
            Self::AlongRoad => (-sensor.mount.yaw_deg - 180.0 * (-sensor.mount.yaw_deg / 180.0).round()).round() as i8,
            Self::Degrees(degrees) => degrees,
        }
    }
}

/// What a survey of the road has wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundError {
    /// So many times as high.
    pub times: f64,
    /// So far ahead along the road, metres.
    pub ahead_m: f64,
}

impl Default for GroundError {
    fn default() -> Self {
        Self { times: 1.0, ahead_m: 0.0 }
    }
}

impl GroundError {
    fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Heights of a road that is not flat.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Place along the road and height, metres in road coordinates.
    pub points: Vec<[f64; 2]>,
}

impl Profile {
    fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// A lane: a polyline in the direction of its traffic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lane {
    /// Metres in road coordinates.
    pub points: Vec<[f32; 2]>,
}

impl Lane {
    /// Shortest segment, metres: the library refuses half a metre.
    const SHORTEST_M: f64 = 0.6;
    /// How far beyond its range a radar's obstacles are followed, metres.
    pub const BEYOND_RANGE_M: f64 = 25.0;

    /// Of these places, in whole centimetres; `None` of a single place.
    pub fn of(places: &[[f64; 2]]) -> Option<Self> {
        let places = spaced(places.to_vec(), Self::SHORTEST_M);
        let points = places.iter().map(|p| p.map(|v| (v * 100.0).round() as f32 / 100.0));
        (places.len() > 1).then(|| Self { points: points.collect() })
    }
}

/// Lanes as the library takes them, kept as long as the program runs: they are few.
fn kept(given: &[Lane]) -> &'static [lanes::Lane] {
    given.iter().map(|lane| -> lanes::Lane { lane.points.clone().leak() }).collect::<Vec<_>>().leak()
}

impl Default for Options {
    fn default() -> Self {
        Self {
            max_detections: 256,
            reference_share: 0.5,
            grid: Grid::Reference,
            far_road: None,
            noise: NoiseConfig::default(),
            radar_2d: Radar2dConfig::default(),
            radar_3d: Radar3dConfig::default(),
            camera_3d: Camera3dConfig::default(),
            lanes: Vec::new(),
            ground: Profile::default(),
            ground_error: GroundError::default(),
            before: Before::default(),
        }
    }
}

impl Options {
    /// Whether there can be tables of probabilities for its maps.
    ///
    /// # Errors
    /// Another grid than theirs.
    pub fn has_tables(&self) -> Result<()> {
        ensure!(
            self.grid.is_reference(),
            "tables of probabilities are of the reference grid, not of --grid-size small"
        );
        Ok(())
    }

    /// Takes the height at which truth is judged over to every estimator.
    pub fn judge_at(&mut self, slice_height_m: f64) {
        self.radar_2d.slice_height_m = slice_height_m as f32;
        self.radar_3d.visibility.slice_height_m = slice_height_m as f32;
        // columns that cameras judge end at 4 m
        self.camera_3d.slice_height_m = slice_height_m.min(4.0) as f32;
    }
}

/// Most detections a frame that storage is compiled for.
pub const MOST_DETECTIONS: usize = 4096;

pub use crate::recording::sensor::{mount, sensor};
pub use crate::recording::usable::{ABSURD, DROPPED, NO_RANGE, NOT_FINITE, measurement};
pub use before::Before;
pub use radar_2d::MOST_RANGE_M;
pub use radar_3d::Grid;
pub use site::{site_rows, unit_row};

/// Every estimator for a recording, in the order of the table. `true-boxes` needs ground truth.
///
/// # Errors
/// A parameter the library refuses, by name, and a field of view that grids here do not cover.
pub fn all(recording: &Recording, options: &Options) -> Result<Vec<Box<dyn Estimator>>> {
    if let Some(camera) = recording.of_camera() {
        return camera_3d::all(camera, recording.truth.as_ref(), &options.camera_3d);
    }
    let (sensor, told) = unit(recording, options)?;
    let mut radar_2d = options.radar_2d;
    radar_2d.gate.max_detections = told.gate.max_detections;
    let radar_3d = site::untold(&told, options);
    let mut estimators = vec![
        radar_2d::new("radar-2d", Radar2dReading::Last, &sensor, &radar_2d)?,
        radar_2d::new("radar-2d-first", Radar2dReading::First, &sensor, &radar_2d)?,
        radar_3d::new(Grid::Reference, "radar-3d", &sensor, &radar_3d)?,
    ];
    let name = own_name(options);
    if !options.grid.is_reference() {
        estimators.push(radar_3d::new(options.grid, name, &sensor, &radar_3d)?);
    }
    for (what, config) in site::said(&radar_3d, &told) {
        estimators.push(radar_3d::new(options.grid, &format!("{name}-{what}"), &sensor, &config)?);
    }
    if let Some(frames) = options.before.frames() {
        let config = Radar3dConfig { obstacles: radar_3d.obstacles.learning(), ..radar_3d };
        let mut learning = radar_3d::new(options.grid, &format!("{name}-learning"), &sensor, &config)?;
        learning.run_in(frames);
        estimators.push(learning);
    }
    if let Some(truth) = &recording.truth {
        estimators.push(reference::new(recording, truth, &sensor, &ground(recording, options)?, options)?);
    }
    Ok(estimators)
}

/// What a unit in a recording's place is given: its sensor, and all that is said of it and of the site.
///
/// # Errors
/// A field of view that grids here do not cover; points of which [none can be used](usable::check); heights that are none.
pub fn unit(recording: &Recording, options: &Options) -> Result<(Sensor, Radar3dConfig)> {
    let (sensor, max_detections) = radar(recording, options)?;
    let mut config = options.radar_3d;
    config.gate.max_detections = max_detections;
    if let Some(far_road) = options.far_road {
        config.visibility.far_road_deg = Some(far_road.degrees(&sensor));
    }
    let ground = ground(recording, options)?;
    if !ground.is_level() {
        config.ground = given(&ground, options.ground_error)?.kept();
    }
    config.lanes = kept(&options.lanes);
    if recording.sensor.frames_independent {
        config.settling = SettlingConfig::AT_ONCE;
    }
    Ok((sensor, config))
}

/// Name of the estimator of [`own`], of a radar.
fn own_name(options: &Options) -> &'static str {
    if options.grid.is_reference() { "radar-3d" } else { "radar-3d-small" }
}

/// The heights that estimators are given for these.
fn given(ground: &Ground, error: GroundError) -> Result<Ground> {
    let wrong = |[x, height]: &[f64; 2]| [x + error.ahead_m, height * error.times];
    Ground::new(ground.points().iter().map(wrong).collect())
}

/// The road's heights: those of the options, or else the recording's own.
fn ground(recording: &Recording, options: &Options) -> Result<Ground> {
    if options.ground.is_empty() { Ok(recording.ground.clone()) } else { Ground::new(options.ground.points.clone()) }
}

/// The estimator whose map a sensor sends: `radar-3d` with all that is said of the [site](fn@unit), or `camera-3d` of a
/// camera's own recording.
///
/// # Errors
/// Those of [`all`].
pub fn own(recording: &Recording, options: &Options) -> Result<Box<dyn Estimator>> {
    if let Some(camera) = recording.of_camera() {
        let all = camera_3d::all(camera, None, &options.camera_3d)?;
        return all.into_iter().find(|e| e.name() == "camera-3d").context("no estimator for the camera");
    }
    let (sensor, config) = unit(recording, options)?;
    radar_3d::new(options.grid, own_name(options), &sensor, &config)
}

/// The grid of the map of [`own`], of a radar, and its least visible grade.
///
/// # Errors
/// As for [`own`].
pub fn own_grid(recording: &Recording, options: &Options) -> Result<(PolarGeometry, u8)> {
    options.has_tables()?;
    let (sensor, config) = unit(recording, options)?;
    radar_3d::grid(&sensor, &config)
}

/// A recording's radar, and how many detections of a frame are used.
fn radar(recording: &Recording, options: &Options) -> Result<(Sensor, u16)> {
    let max_detections = match u16::try_from(options.max_detections) {
        Ok(n) if n > 0 && options.max_detections <= MOST_DETECTIONS => n,
        _ => bail!("--max-detections {} is outside 1 to {MOST_DETECTIONS}", options.max_detections),
    };
    let view = &recording.sensor.field_of_view;
    if view.range_m[1] > MOST_RANGE_M {
        let [a, e] = [view.azimuth_rad, view.elevation_rad].map(|ends| ends.map(f64::to_degrees));
        bail!(
            "{}: its field of view reaches {} m, and grids here {MOST_RANGE_M} m: give it with --fov={:.0},{:.0},{:.0},{:.0},{:.0},{MOST_RANGE_M}",
            recording.name,
            view.range_m[1],
            a[0],
            a[1],
            e[0],
            e[1],
            view.range_m[0]
        );
    }
    usable::check(recording, options)?;
    Ok((sensor(recording, &options.noise), max_detections))
}

/// A polar map's cells, for pictures and for judging on them.
fn polar_cells<const R: usize, const A: usize>(map: &PolarMap<R, A>) -> PolarCells<'_> {
    let g = map.geometry();
    PolarCells {
        azimuths: A,
        ranges: R,
        azimuth_rad: azimuths::ends_rad(g.azimuth_origin, g.azimuth_span),
        narrow: g.narrow.to_bytes(),
        cell_m: f64::from(g.cell_cm) / 100.0,
        cell: Box::new(|a, r| map.cell(a, r)),
    }
}

/// Turns recorded frames into the library's input and counts what cannot be.
#[derive(Debug, Default)]
pub(crate) struct Intake {
    detections: Vec<Detection>,
    dropped: u64,
    not_finite: u64,
    range: u64,
    absurd: u64,
}

impl Intake {
    pub(crate) fn take(&mut self, frame: &Frame) -> (Time, &[Detection], FrameStatus) {
        self.detections.clear();
        let mut refused = u16::try_from(frame.refused).unwrap_or(u16::MAX);
        self.dropped += frame.refused;
        for (d, marked) in frame.all() {
            let why = match Detection::new(&measurement(d)) {
                Ok(d) => {
                    self.detections.push(Detection { marked, ..d });
                    continue;
                }
                Err(why) => why,
            };
            refused = refused.saturating_add(1);
            match why {
                NotADetection::NotFinite => self.not_finite += 1,
                NotADetection::Range => self.range += 1,
                NotADetection::Absurd => self.absurd += 1,
            }
        }
        let micros = u64::try_from(frame.time_ns / 1000).unwrap_or(0);
        (Time::from_micros(micros), &self.detections, FrameStatus { fault: frame.fault, refused })
    }

    fn counters(&self, rejections: &Rejections) -> Vec<(&'static str, u64)> {
        // those that are no detections are counted apart here
        let gate = Rejection::ALL.into_iter().filter(|r| *r != Rejection::Refused);
        let gate = gate.map(|r| (r.name(), u64::from(rejections.count(r))));
        let absurd = (ABSURD, self.absurd);
        let intake = [(DROPPED, self.dropped), (NOT_FINITE, self.not_finite), (NO_RANGE, self.range), absurd];
        gate.chain(intake).filter(|(_, n)| *n > 0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::recording;
    use crate::recording::RadarDetection;

    /// Options of a site of which all is said.
    fn all_said() -> Options {
        Options {
            far_road: Some(FarRoad::Degrees(7)),
            lanes: vec![Lane { points: vec![[10.0, 2.0], [90.0, 2.0]] }],
            ground: Profile { points: vec![[0.0, 0.0], [100.0, 3.0]] },
            ..Options::default()
        }
    }

    #[test]
    fn what_is_said_of_a_site_has_a_row_each_and_one_with_all() {
        let all_said = all_said();
        let rows = |options: Options| {
            let all = all(&recording(1, 1), &options).unwrap();
            let site =
                all.iter().map(|e| e.name().to_owned()).filter(|n| n.starts_with("radar-3d")).collect::<Vec<_>>();
            site.join(" ")
        };
        assert_eq!(rows(Options::default()), "radar-3d");
        let lanes = Options { lanes: all_said.lanes.clone(), ..Options::default() };
        assert_eq!(rows(lanes.clone()), "radar-3d radar-3d-lanes");
        assert_eq!(
            rows(Options { far_road: Some(FarRoad::AlongRoad), ..lanes }),
            "radar-3d radar-3d-narrow radar-3d-lanes radar-3d-site"
        );
        let every = "radar-3d radar-3d-narrow radar-3d-ground radar-3d-lanes radar-3d-site";
        assert_eq!(rows(all_said.clone()), every);
        let small = rows(Options { grid: Grid::Small, ..all_said });
        assert_eq!(
            small,
            every.replace("radar-3d", "radar-3d-small").replacen("radar-3d-small", "radar-3d radar-3d-small", 1)
        );
        for said in 0..4 {
            assert_eq!(site_rows(said), [0, 1, 3, 4][said as usize]);
        }
    }

    #[test]
    fn a_unit_that_ran_before_learns_lanes_and_counts_only_what_is_judged() {
        let judged = recording(1, 3);
        let rows = |before| {
            let running = all(&judged, &Options { before, ..Options::default() }).unwrap();
            running.into_iter().map(|e| (e.name().to_owned(), e.counters())).filter(|(n, _)| n.starts_with("radar-3d"))
        };
        assert_eq!(rows(Before::default()).count(), 1);
        let mut hour = recording(1, 20);
        let wrong = RadarDetection {
            range_m: 50.0,
            azimuth_rad: 3.0,
            elevation_rad: None,
            radial_velocity_mps: 0.0,
            rcs_dbsm: None,
            snr_db: None,
        };
        hour.frames.iter_mut().for_each(|frame| frame.detections.push(wrong));
        let both = rows(Before::of([hour.clone(), hour])).collect::<Vec<_>>();
        assert_eq!(both, ["radar-3d", "radar-3d-learning"].map(|name| (name.to_owned(), Vec::new())));
    }

    #[test]
    fn a_unit_is_given_all_that_is_said_of_its_site() {
        let options = Options { max_detections: 300, ..all_said() };
        let (_, config) = unit(&recording(1, 1), &options).unwrap();
        assert_eq!((config.visibility.far_road_deg, config.gate.max_detections), (Some(7), 300));
        assert_eq!((config.ground, config.lanes.len()), (&[[0.0, 0.0], [100.0, 3.0]][..], 1));
        assert_eq!(config.lanes[0], &[[10.0, 2.0], [90.0, 2.0]][..]);
        let own = own(&recording(1, 1), &options).unwrap();
        assert_eq!((own.name(), own.polar().unwrap().narrow[2]), ("radar-3d", 4));
        let (_, level) = unit(&recording(1, 1), &Options::default()).unwrap();
        assert_eq!(level, Radar3dConfig::default(), "of a level road nothing is said");
    }

    #[test]
    fn heights_are_given_as_wrong_as_they_are_asked_for() {
        let ground = Ground::new(vec![[0.0, 1.0], [50.0, 3.0], [100.0, 0.0]]).unwrap();
        let points = |times, ahead_m| given(&ground, GroundError { times, ahead_m }).unwrap().points().to_vec();
        assert_eq!(points(1.0, 0.0), ground.points());
        assert_eq!(points(0.5, 15.0), [[15.0, 0.5], [65.0, 1.5], [115.0, 0.0]]);
        let error = given(&ground, GroundError { times: 3.0, ahead_m: 0.0 }).unwrap_err().to_string();
        assert!(error.contains("the grade is -0.180, above 0.12"), "{error}");
    }
}
