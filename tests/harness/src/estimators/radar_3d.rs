//! `radar-3d` on the reference grid, or on the small one.

use anyhow::Result;
use serde::{Deserialize, Serialize};
use viewshed::fixed::time::Time;
use viewshed::fixed::trig::Direction;
use viewshed::frame::health::Condition;
use viewshed::map::VisibilityMap;
use viewshed::map::polar::{PolarGeometry, PolarMap};
use viewshed::radar_3d::{Radar3d, Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::sensor::mount::Mount;
use viewshed::unit::profile::{reference::State, small};

use super::{Estimator, Lane, PolarCells};
use super::{Intake, MOST_DETECTIONS, polar_cells};
use crate::geometry::solid::Solid;
use crate::recording::Frame;

/// Range cells, azimuths and elevations of the reference grid.
pub const RANGES: usize = State::RANGES;
pub const AZIMUTHS: usize = State::AZIMUTHS;
pub const ELEVATIONS: usize = State::ELEVATIONS;

/// Vehicles for which the list had no room, as reports say it.
const NO_ROOM: [&str; 2] = ["no room in the list of 96 obstacles", "no room in the list of 28 obstacles"];
const _: () = assert!(State::OBSTACLES == 96 && small::State::OBSTACLES == 28, "the report names the list's limit");

/// Length of a piece of a learnt lane, a little less than its cell is wide, metres.
const PIECE_M: f64 = 2.0;

/// A size of the grid, and of the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Grid {
    /// 200 x 128 x 12 cells, for parts with 512 kB
    #[default]
    Reference,
    /// 100 x 96 x 4 cells, 28 vehicles and 160 detections a frame, for parts with 128 kB
    Small,
}

impl Grid {
    pub fn is_reference(&self) -> bool {
        *self == Self::Reference
    }

    pub const ALL: [Self; 2] = [Self::Reference, Self::Small];

    /// Ranges and azimuths.
    pub const fn grid(self) -> [u8; 2] {
        match self {
            Self::Reference => [RANGES as u8, AZIMUTHS as u8],
            Self::Small => [small::State::RANGES as u8, small::State::AZIMUTHS as u8],
        }
    }

    /// As on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Small => "small",
        }
    }
}

struct Driver<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> {
    name: String,
    parameters: Box<Radar3dParameters<R, A, E>>,
    state: Box<Radar3d<R, A, E, W, N, D>>,
    map: Box<PolarMap<R, A>>,
    mount: Mount,
    intake: Intake,
    no_room: u32,
    condition: Condition,
    /// What was counted before the recording that is judged.
    counted_before: Vec<(&'static str, u64)>,
}

type OfReference<const D: usize> = Driver<RANGES, AZIMUTHS, ELEVATIONS, { State::WORDS }, { State::OBSTACLES }, D>;
type OfSmall = Driver<
    { small::State::RANGES },
    { small::State::AZIMUTHS },
    { small::State::ELEVATIONS },
    { small::State::WORDS },
    { small::State::OBSTACLES },
    { small::State::DETECTIONS },
>;

/// The estimator on a grid of one's choice, as a row of tables. The reference grid has storage for 256 detections unless
/// more are asked for, the small one for its own number.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn new(grid: Grid, name: &str, sensor: &Sensor, config: &Radar3dConfig) -> Result<Box<dyn Estimator>> {
    Ok(match grid {
        Grid::Reference if config.gate.max_detections <= 256 => {
            Box::new(OfReference::<256>::new(name, sensor, config)?)
        }
        Grid::Reference => Box::new(OfReference::<MOST_DETECTIONS>::new(name, sensor, config)?),
        Grid::Small => {
            let mut config = *config;
            config.gate.max_detections = config.gate.max_detections.min(small::State::DETECTIONS as u16);
            Box::new(OfSmall::new(name, sensor, &config)?)
        }
    })
}

/// Where the cells of its map lie, and from which grade on they are visible.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn grid(sensor: &Sensor, config: &Radar3dConfig) -> Result<(PolarGeometry, u8)> {
    let parameters = Radar3dParameters::<RANGES, AZIMUTHS, ELEVATIONS>::new(sensor, config)?;
    Ok((parameters.axes().polar(parameters.levelling()), parameters.visible_from()))
}

/// Runs the estimator over frames and shows its map after each, with the frame's time and what the map is worth.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn maps(
    frames: &[Frame],
    sensor: &Sensor,
    config: &Radar3dConfig,
    visit: impl FnMut(Time, &PolarMap<RANGES, AZIMUTHS>, Condition),
) -> Result<()> {
    if config.gate.max_detections <= 256 {
        maps_with::<256>(frames, sensor, config, visit)
    } else {
        maps_with::<MOST_DETECTIONS>(frames, sensor, config, visit)
    }
}

fn maps_with<const D: usize>(
    frames: &[Frame],
    sensor: &Sensor,
    config: &Radar3dConfig,
    mut visit: impl FnMut(Time, &PolarMap<RANGES, AZIMUTHS>, Condition),
) -> Result<()> {
    let mut driver = OfReference::<D>::new("radar-3d", sensor, config)?;
    for frame in frames {
        driver.step(frame);
        let measured = Time::from_micros(u64::try_from(frame.time_ns / 1000).unwrap_or(0));
        visit(measured, &driver.map, driver.condition);
    }
    Ok(())
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>
    Driver<R, A, E, W, N, D>
{
    fn new(name: &str, sensor: &Sensor, config: &Radar3dConfig) -> Result<Self> {
        let parameters = Box::new(Radar3dParameters::new(sensor, config)?);
        let map = Box::new(parameters.map());
        let (state, intake) = (Box::new(Radar3d::new()), Intake::default());
        let (name, mount) = (name.to_owned(), sensor.mount);
        Ok(Self {
            name,
            parameters,
            state,
            map,
            mount,
            intake,
            no_room: 0,
            condition: Condition::Starting,
            counted_before: Vec::new(),
        })
    }

    /// A place ahead of the sensor and to its left, in road coordinates, metres.
    fn place_on_road(&self, [ahead, left]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = f64::from(self.mount.yaw_deg).to_radians().sin_cos();
        let (x, y) = (f64::from(self.mount.x_m), f64::from(self.mount.y_m));
        [x + cos * ahead - sin * left, y + sin * ahead + cos * left]
    }

    /// A box of the levelled frame, which is the road's, moved to the sensor and turned to its heading.
    fn on_road(&self, s: &viewshed::obstacles::solid::Solid) -> Solid {
        let metres = |cm: i32| f64::from(cm) / 100.0;
        let ([x, y], height_m) = (self.place_on_road([metres(s.x_cm), metres(s.y_cm)]), metres(s.height_cm));
        let turned = f64::from(s.heading.y).atan2(f64::from(s.heading.x));
        Solid {
            center: [x, y, height_m / 2.0],
            yaw_rad: turned + f64::from(self.mount.yaw_deg).to_radians(),
            size: [2.0 * metres(s.half_length_cm), 2.0 * metres(s.half_width_cm), height_m],
        }
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> Estimator
    for Driver<R, A, E, W, N, D>
{
    fn name(&self) -> &str {
        &self.name
    }

    fn reset(&mut self) {
        self.state.reset();
        self.map.forget();
    }

    fn run_in(&mut self, frames: &[Frame]) {
        frames.iter().for_each(|frame| self.step(frame));
        self.counted_before = self.counters();
    }

    fn step(&mut self, frame: &Frame) {
        let (now, detections, status) = self.intake.take(frame);
        let report = self.state.process(&self.parameters, now, detections, status, &mut self.map);
        self.no_room = report.obstacles_dropped;
        self.condition = report.condition;
    }

    fn map(&self) -> &dyn VisibilityMap {
        &*self.map
    }

    fn polar(&self) -> Option<PolarCells<'_>> {
        Some(polar_cells(&self.map))
    }

    fn obstacles(&self) -> Vec<Solid> {
        self.state.obstacles().solids(self.parameters.tracking()).map(|s| self.on_road(&s)).collect()
    }

    fn where_seen(&self) -> Vec<Solid> {
        self.state.obstacles().where_seen(self.parameters.tracking()).map(|s| self.on_road(&s)).collect()
    }

    fn learnt_lanes(&self) -> Vec<Lane> {
        let pieces = self.state.obstacles().learnt_lanes(self.parameters.tracking());
        let piece = |((x_cm, y_cm), heading): ((i32, i32), Direction)| {
            let middle = [x_cm, y_cm].map(|cm| f64::from(cm) / 100.0);
            let half = [heading.x, heading.y].map(|part| f64::from(part) / 16_384.0 * PIECE_M / 2.0);
            let ends =
                [-1.0, 1.0].map(|end| self.place_on_road([middle[0] + end * half[0], middle[1] + end * half[1]]));
            Lane { points: ends.map(|end| end.map(|v| v as f32)).to_vec() }
        };
        pieces.map(piece).collect()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let no_room = NO_ROOM[usize::from(N != State::OBSTACLES)];
        let full = [(no_room, u64::from(self.no_room))].into_iter().filter(|(_, n)| *n > 0);
        let all = self.intake.counters(self.state.rejections()).into_iter().chain(full);
        let before = |name| self.counted_before.iter().find(|(of, _)| *of == name).map_or(0, |(_, n)| *n);
        all.map(|(name, n)| (name, n - before(name))).filter(|(_, n)| *n > 0).collect()
    }

    fn condition(&self) -> Condition {
        self.condition
    }

    fn azimuth_noise_deg(&self) -> Option<f64> {
        let noise = self.state.noise(&self.parameters);
        (noise != *self.parameters.noise()).then(|| f64::from(noise.azimuth_deg()))
    }
}

#[cfg(test)]
mod tests {
    use viewshed::sensor::field_of_view::FieldOfView;
    use viewshed::sensor::noise::NoiseConfig;

    use super::*;
    use crate::estimators::FarRoad;
    use crate::geometry::azimuths::{EVEN, bearing_rad};
    use crate::recording::RadarDetection;

    const VIEW: FieldOfView = FieldOfView {
        azimuth_min_deg: -60.0,
        azimuth_max_deg: 60.0,
        elevation_min_deg: -16.0,
        elevation_max_deg: 16.0,
        range_min_m: 3.0,
        range_max_m: 200.0,
    };

    #[test]
    fn the_narrow_one_has_the_columns_of_the_same_view_denser_along_the_road() {
        for (yaw_deg, far_road) in [(0.0, 0), (20.0, -20), (-170.0, -10), (180.0, 0), (200.0, -20), (-35.4, 35)] {
            let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg, pitch_deg: 3.0, roll_deg: 0.0 };
            let sensor = Sensor { mount, field_of_view: VIEW, noise: NoiseConfig::default() };
            let mut config = Radar3dConfig::default();
            let usual = reference(&sensor, &config);
            assert_eq!(FarRoad::AlongRoad.degrees(&sensor), far_road, "{yaw_deg}");
            config.visibility.far_road_deg = Some(far_road);
            let narrow = reference(&sensor, &config);
            let (a, b) = (usual.polar().unwrap(), narrow.polar().unwrap());
            assert_eq!((b.azimuths, b.ranges), (a.azimuths, a.ranges));
            assert_eq!((a.azimuth_rad, a.cell_m, a.narrow), (b.azimuth_rad, b.cell_m, EVEN));
            let [first, end, times] = b.narrow;
            let middle = bearing_rad(b.azimuth_rad, b.narrow, b.azimuths, f64::from(first + end) / 2.0).to_degrees();
            assert!(
                times == 4 && end - first > 40 && (middle - f64::from(far_road)).abs() < 1.0,
                "{yaw_deg}: {middle}"
            );
        }
    }

    fn reference(sensor: &Sensor, config: &Radar3dConfig) -> Box<dyn Estimator> {
        new(Grid::Reference, "radar-3d", sensor, config).unwrap()
    }

    /// So many vehicles that come nearer, 6 m and 12 degrees apart.
    fn frame(k: i64, vehicles: usize) -> Frame {
        let detection = |n: usize| RadarDetection {
            range_m: 30.0 + 6.0 * (n % 26) as f32 - 8.0 * 0.066 * k as f32,
            azimuth_rad: 0.2 * ((n / 26) as f32 - 2.0),
            elevation_rad: None,
            radial_velocity_mps: -8.0,
            rcs_dbsm: Some(15.0),
            snr_db: Some(20.0),
        };
        Frame {
            time_ns: 1_000_000_000 + k * 66_000_000,
            detections: (0..vehicles).map(detection).collect(),
            refused: 0,
            unwanted: Vec::new(),
            fault: false,
        }
    }

    #[test]
    fn an_obstacle_stands_on_the_road_where_its_reflections_are() {
        // looks back along the road, from (100, 20): what is to its left has the smaller y
        let mount = Mount { x_m: 100.0, y_m: 20.0, height_m: 6.0, yaw_deg: 180.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let sensor = Sensor { mount, field_of_view: VIEW, noise: NoiseConfig::default() };
        let mut estimator = reference(&sensor, &Radar3dConfig::default());
        let mut one = frame(0, 1);
        one.detections[0].azimuth_rad = 0.1;
        for k in 0..20 {
            one.time_ns = 1_000_000_000 + k * 66_000_000;
            one.detections[0].range_m = 60.0 - 8.0 * 0.066 * k as f32;
            estimator.step(&one);
        }
        let found = estimator.obstacles();
        assert_eq!(found.len(), 1, "{found:?}");
        let [x, y, _] = found[0].center;
        // 50 m before the sensor, and the middle of the vehicle is some metres behind its face
        assert!((40.0..52.0).contains(&x) && (13.0..17.5).contains(&y), "{found:?}");
    }

    #[test]
    fn a_list_of_obstacles_that_is_full_is_reported_with_its_limit() {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 3.0, roll_deg: 0.0 };
        let sensor = Sensor { mount, field_of_view: VIEW, noise: NoiseConfig::default() };
        let no_room = |vehicles: usize| {
            let mut estimator = reference(&sensor, &Radar3dConfig::default());
            (0..40).for_each(|k| estimator.step(&frame(k, vehicles)));
            estimator.counters().into_iter().find(|(what, _)| what.contains("96 obstacles")).map_or(0, |(_, n)| n)
        };
        assert_eq!(no_room(60), 0);
        assert!(no_room(130) > 0);
    }
}
