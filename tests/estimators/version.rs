//! The version of the estimators: it rises whenever the same scans give other maps.

use crate::common::{FRAME_US, Rig, Vehicle, detection, gantry};
use viewshed::bench::fingerprint::Fingerprint;
use viewshed::estimator::MAPS;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::map::VisibilityMap;
use viewshed::obstacles::config::ObstacleConfig;
use viewshed::radar_2d::{Radar2d, Radar2dConfig, Radar2dParameters, Radar2dReading};
use viewshed::radar_3d::{Radar3dConfig, VisibilityConfig};
use viewshed::sensor::Sensor;
use viewshed::sensor::road::RoadPoint;

/// Scans of traffic that comes, goes and comes to a stop, with posts beside it; measured with noise.
struct Road {
    random: u32,
    elevation: bool,
    vehicles: Vec<Vehicle>,
}

impl Road {
    fn new(elevation: bool) -> Self {
        let vehicles = vec![
            Vehicle::truck(130.0, 5.5, -22.0),
            Vehicle::car(150.0, 2.0, -28.0),
            Vehicle::car(60.0, 2.0, -12.0),
            Vehicle::car(20.0, -2.0, 24.0),
            Vehicle::truck(30.0, -5.5, 15.0),
        ];
        Self { random: 1, elevation, vehicles }
    }

    /// From -`most` to `most`.
    fn noise(&mut self, most: i16) -> i16 {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.random >> 16) as i16 % (most + 1)
    }

    /// The next scan; with brakes on, what is left of it stops.
    fn scan(&mut self, sensor: &Sensor, braking: bool) -> Vec<Detection> {
        let dt = FRAME_US as f64 * 1e-6;
        for v in &mut self.vehicles {
            let slower = if braking { 6.0 * dt } else { 0.0 };
            *v = Vehicle { speed: v.speed.signum() * (v.speed.abs() - slower).max(0.0), ..v.at(dt) };
        }
        let of_vehicles = self.vehicles.iter().flat_map(|v| v.detections(sensor, self.elevation));
        let posts = [40.0, 75.0, 110.0].map(|x| detection(sensor, [x, 9.0, 1.5], [0.0; 2], self.elevation));
        let exact: Vec<Detection> = of_vehicles.chain(posts.into_iter().flatten()).collect();
        let mut measured = Vec::new();
        for d in exact {
            // one in four is missed
            if self.noise(30_000) % 4 != 0 {
                measured.push(Detection {
                    range_cm: d.range_cm.saturating_add_signed(self.noise(25)),
                    azimuth: Angle::from_raw(d.azimuth.raw() + self.noise(80)),
                    radial_velocity_cm_s: d.radial_velocity_cm_s + self.noise(15),
                    ..d
                });
            }
        }
        measured
    }
}

/// Traffic that drives, for some seconds after a gap; then it stops, and a while later the posts are learnt.
fn of_radar_3d(elevation: bool, far_road_deg: Option<i8>) -> Fingerprint {
    let visibility = VisibilityConfig { far_road_deg, ..VisibilityConfig::default() };
    let obstacles = ObstacleConfig { fixture_after_s: 3.0, ..ObstacleConfig::default() };
    let mut rig = Rig::with(gantry(6.0, 4.0), &Radar3dConfig { visibility, obstacles, ..Radar3dConfig::default() });
    let (mut road, mut sum) = (Road::new(elevation), Fingerprint::default());
    for frame in 0..90 {
        if frame == 20 || frame == 25 {
            // 0.7 s, and 3 s
            rig.frames += if frame == 20 { 10 } else { 45 };
        }
        let scan = road.scan(&rig.sensor, frame > 40);
        rig.frame(&scan);
        let map = Fingerprint::of_map(&*rig.map).value();
        sum.bytes(&map.to_le_bytes());
    }
    sum
}

fn of_radar_2d(reading: Radar2dReading) -> Fingerprint {
    let sensor = gantry(6.0, 4.0);
    let p = Box::new(Radar2dParameters::new::<208, 45, 320>(&sensor, &Radar2dConfig::default()).unwrap());
    let mut state = Box::new(Radar2d::<208, 45, 320, 256>::new());
    let (mut road, mut sum) = (Road::new(true), Fingerprint::default());
    for frame in 0..20 {
        let scan = road.scan(&sensor, false);
        state.process(&p, Time::from_micros(1_000_000 + frame * FRAME_US), &scan, false);
        if frame % 5 == 4 {
            let map = state.map(&p, reading);
            let cells = (0..180).flat_map(|i| (-20..20).map(move |j| RoadPoint::cell_centre(i, j)));
            cells.map(|at| map.at(at)).for_each(|c| sum.bytes(&[c.grade, c.occupancy, u8::from(c.visible())]));
        }
    }
    sum
}

#[test]
fn other_maps_of_the_same_scans_are_of_another_version() {
    let scenes = [
        ("radar-3d", of_radar_3d(true, None)),
        ("radar-3d without elevation", of_radar_3d(false, None)),
        ("radar-3d with narrow azimuths", of_radar_3d(true, Some(3))),
        ("radar-2d", of_radar_2d(Radar2dReading::Last)),
        ("radar-2d-first", of_radar_2d(Radar2dReading::First)),
    ];
    let mut all = Fingerprint::default();
    for (scene, sum) in &scenes {
        println!("{scene}: {:016x}", sum.value());
        all.bytes(&sum.value().to_le_bytes());
    }
    let (version, known) = MAPS;
    let now = all.value();
    assert!(
        now == known,
        "the maps of version {version} have changed: tables of probabilities that were fitted to them fit no more. If that is meant, \
         in src/estimator.rs:\n\npub const MAPS: (u16, u64) = ({}, {now:#018x});\n",
        version + 1
    );
    for (k, (scene, sum)) in scenes.iter().enumerate() {
        assert!(scenes[..k].iter().all(|(_, other)| other != sum), "{scene} is the same as another");
    }
}
