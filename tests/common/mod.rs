//! A small world for the library's integration tests: boxes that reflect at their corners.

#![allow(dead_code)] // each test file uses a part

use viewshed::bench::start;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::grid::settling::SettlingConfig;
use viewshed::map::polar::PolarMap;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::radar_3d::{FrameReport, Radar3d, Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::sensor::road::RoadPoint;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::{Broadcaster, Medium};
use viewshed::wire::message::Epoch;

pub const R: usize = 200;
pub const A: usize = 120;
pub const E: usize = 16;

pub type State = Radar3d<R, A, E, 7, 96, 256>;
pub type Parameters = Radar3dParameters<R, A, E>;
pub type Map = PolarMap<R, A>;

/// Microseconds between frames: 15 a second.
pub const FRAME_US: u64 = 66_667;

pub fn gantry(height_m: f32, yaw_deg: f32) -> Sensor {
    Sensor {
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg, pitch_deg: 3.0, roll_deg: 0.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        },
        noise: NoiseConfig::default(),
    }
}

/// A unit of 50 x 40 x 8 cells.
pub type SmallState = Radar3d<50, 40, 8, 2, 16, 64>;
pub type SmallSender = Broadcaster<40, 2>;

/// Its parameters and its sender in a test bench.
pub fn small_unit(
    settings: &Settings,
    medium: Medium,
    epoch: u8,
    now: Time,
) -> (Radar3dParameters<50, 40, 8>, SmallSender) {
    let (mut parameters, mut sender) = (None, None);
    start::<SmallState, _>(&mut parameters, &mut sender, Some(settings), medium, Epoch::new(epoch), now);
    (parameters.unwrap(), sender.unwrap())
}

/// An upright box that moves along the road, metres and m/s.
#[derive(Debug, Clone, Copy)]
pub struct Vehicle {
    pub x: f64,
    pub y: f64,
    pub speed: f64,
    pub length: f64,
    pub width: f64,
}

impl Vehicle {
    pub fn truck(x: f64, y: f64, speed: f64) -> Self {
        Self { x, y, speed, length: 16.5, width: 2.5 }
    }

    pub fn car(x: f64, y: f64, speed: f64) -> Self {
        Self { x, y, speed, length: 4.4, width: 1.8 }
    }

    pub fn at(&self, seconds: f64) -> Self {
        Self { x: self.x + self.speed * seconds, ..*self }
    }

    /// Reflection points along both sides, every 3 m and at the ends, bumper high.
    pub fn points(&self) -> impl Iterator<Item = [f64; 3]> {
        let Self { x, y, length, width, .. } = *self;
        let steps = (length / 3.0).ceil() as i32;
        (0..=steps).flat_map(move |k| {
            [-0.5, 0.5].map(|side| [x + length * (f64::from(k) / f64::from(steps) - 0.5), y + side * width, 0.8])
        })
    }

    /// What the radar measures of these points.
    pub fn detections(&self, sensor: &Sensor, elevation: bool) -> Vec<Detection> {
        self.points().filter_map(|point| detection(sensor, point, [self.speed, 0.0], elevation)).collect()
    }
}

/// What the radar measures of a road point with a velocity; `None` out of range.
pub fn detection(sensor: &Sensor, point: [f64; 3], velocity: [f64; 2], elevation: bool) -> Option<Detection> {
    let m = &sensor.mount;
    let (dx, dy, dz) = (point[0] - f64::from(m.x_m), point[1] - f64::from(m.y_m), point[2] - f64::from(m.height_m));
    let (sy, cy) = f64::from(m.yaw_deg).to_radians().sin_cos();
    let (sp, cp) = f64::from(m.pitch_deg).to_radians().sin_cos();
    let (ahead, left) = (cy * dx + sy * dy, -sy * dx + cy * dy);
    // the nose-down turn undone
    let (x, z) = (cp * ahead - sp * dz, sp * ahead + cp * dz);
    let range = (dx * dx + dy * dy + dz * dz).sqrt();
    let radial = (velocity[0] * dx + velocity[1] * dy) / range;
    (range < 600.0 && range > 0.1).then(|| Detection {
        range_cm: (range * 100.0).round() as u16,
        azimuth: Angle::from_radians(left.atan2(x) as f32),
        elevation: elevation.then(|| Angle::from_radians(z.atan2(x.hypot(left)) as f32)),
        radial_velocity_cm_s: (radial * 100.0).round() as i16,
        rcs_half_dbsm: Some(20),
        snr_half_db: Some(50),
        marked: false,
    })
}

/// An estimator with its map, fed frame by frame.
#[derive(Clone)]
pub struct Rig {
    pub sensor: Sensor,
    pub parameters: Box<Parameters>,
    pub state: Box<State>,
    pub map: Box<Map>,
    pub frames: u64,
}

impl Rig {
    /// Of a unit that has run for long: what is there is believed from the first frame on.
    pub fn new(sensor: Sensor) -> Self {
        Self::with(sensor, &Radar3dConfig { settling: SettlingConfig::AT_ONCE, ..Radar3dConfig::default() })
    }

    pub fn with(sensor: Sensor, config: &Radar3dConfig) -> Self {
        let parameters = Box::new(Parameters::new(&sensor, config).unwrap());
        let map = Box::new(parameters.map());
        Self { sensor, parameters, state: Box::new(State::new()), map, frames: 0 }
    }

    pub fn now(&self) -> Time {
        Time::from_micros(1_000_000 + self.frames * FRAME_US)
    }

    pub fn seconds(&self) -> f64 {
        (self.frames * FRAME_US) as f64 * 1e-6
    }

    pub fn frame(&mut self, detections: &[Detection]) -> FrameReport {
        let report = self.state.process(&self.parameters, self.now(), detections, false, &mut self.map);
        self.frames += 1;
        report
    }

    /// Lets vehicles drive for a number of frames; they start where they are given.
    pub fn drive(&mut self, vehicles: &[Vehicle], frames: u32, elevation: bool) {
        for _ in 0..frames {
            let t = self.seconds();
            let all: Vec<_> = vehicles.iter().flat_map(|v| v.at(t).detections(&self.sensor, elevation)).collect();
            self.frame(&all);
        }
    }

    /// Time of the last frame, seconds.
    pub fn last(&self) -> f64 {
        ((self.frames - 1) * FRAME_US) as f64 * 1e-6
    }

    pub fn visibility(&self, x_m: f64, y_m: f64) -> Visibility {
        self.map.at(RoadPoint::new((x_m * 100.0) as i32, (y_m * 100.0) as i32)).visibility
    }

    /// The road from above: rows from left (top) to right, 2.5 m each; x ahead to the right, 5 m a
    /// character. `.` visible, `#` invisible, `O` visible and occupied, `?` unknown.
    pub fn draw(&self, x_m: std::ops::Range<i32>, y_m: std::ops::Range<i32>) -> String {
        let mut picture = String::from("\n");
        let rows: Vec<i32> = (y_m.start * 100..y_m.end * 100).step_by(250).collect();
        for y in rows.into_iter().rev() {
            for x in (x_m.start * 100..x_m.end * 100).step_by(500) {
                let state = self.map.at(RoadPoint::new(x + 250, y + 125));
                picture.push(match (state.visibility, state.occupied) {
                    (Visibility::Unknown, _) => '?',
                    (Visibility::Invisible, _) => '#',
                    (Visibility::Visible, false) => '.',
                    (Visibility::Visible, true) => 'O',
                });
            }
            picture.push('\n');
        }
        picture
    }
}
