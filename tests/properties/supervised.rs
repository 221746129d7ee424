//! An estimator that watches its own radar: the same map as alone while all is well, unknown where the radar is blind.

use viewshed::estimator::Estimator;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::frame::health::Condition;
use viewshed::fusion::{FixturesConfig, Supervised, Supervision};
use viewshed::map::VisibilityMap;
use viewshed::map::polar::PolarMap;
use viewshed::sensor::road::RoadPoint;
use viewshed::unit::profile::small::{Map, State};

use crate::setup::Setup;

/// Posts beside the road, in the first sector of six (right) and in the last (left), and ahead.
const POSTS: [(u16, f32); 6] = [(2000, -50.0), (3500, -48.0), (2000, 50.0), (3500, 48.0), (4000, 5.0), (6000, 8.0)];

struct Watched {
    parameters: <Supervised<State> as Estimator>::Parameters,
    state: Box<Supervised<State>>,
    map: Box<Map>,
    frame: u64,
}

impl Watched {
    fn new(supervised: bool) -> Self {
        let mut setup = Setup::default();
        setup.sensor.mount.pitch_deg = 12.0;
        let config = FixturesConfig { learned_windows: 20, ..FixturesConfig::default() };
        let watch: Supervision = (setup.sensor.mount, [-60.0, 60.0], config);
        let config = ((setup.sensor, setup.radar_3d), supervised.then_some(watch));
        let parameters = Supervised::<State>::parameters(&config).unwrap();
        let mut map: Box<Map> = Box::new(PolarMap::NOWHERE);
        Supervised::<State>::prepare(&parameters, &mut map);
        Self { parameters, state: Box::new(Supervised::new(State::new())), map, frame: 0 }
    }

    /// So many seconds of ten frames each; what is said last.
    fn run(&mut self, seconds: u64, change: impl Fn(Detection) -> Option<Detection>) -> Condition {
        let mut condition = Condition::Starting;
        for _ in 0..10 * seconds {
            let posts = POSTS.map(|(range_cm, azimuth)| Detection {
                range_cm,
                azimuth: Angle::from_degrees(azimuth),
                elevation: Some(Angle::from_degrees(-15.0)),
                radial_velocity_cm_s: 0,
                rcs_half_dbsm: Some(20),
                snr_half_db: None,
                marked: false,
            });
            let seen: Vec<Detection> = posts.into_iter().filter_map(&change).collect();
            self.frame += 1;
            let now = Time::from_micros(100_000 * self.frame);
            let status = false.into();
            condition = self.state.process(&self.parameters, now, &seen, status, &mut self.map, &mut || {}).condition;
        }
        condition
    }

    fn knows(&self, x_m: f32, y_m: f32) -> bool {
        self.map.at(RoadPoint::from_metres(x_m, y_m).unwrap()).visibility != viewshed::map::Visibility::Unknown
    }
}

/// The left third of the view sees nothing.
fn left_dark(d: Detection) -> Option<Detection> {
    (d.azimuth.raw() < Angle::from_degrees(20.0).raw()).then_some(d)
}

#[test]
fn in_order_the_map_is_the_estimators_own() {
    let (mut alone, mut watched) = (Watched::new(false), Watched::new(true));
    assert_eq!([alone.run(60, Some), watched.run(60, Some)], [Condition::Healthy; 2]);
    assert_eq!(alone.map, watched.map);
    assert_eq!(watched.state.standing().unwrap().learned(), Some(POSTS.len()));
    assert!(alone.state.standing().is_none());
}

#[test]
fn a_sector_without_what_stands_in_it_is_unknown_until_it_is_back() {
    let mut watched = Watched::new(true);
    watched.run(25, Some);
    let places = [(17.0, 20.0), (17.0, -20.0), (30.0, 0.0)];
    assert!(places.iter().all(|(x, y)| watched.knows(*x, *y)));
    assert_eq!(watched.run(12, left_dark), Condition::SectorBlind);
    assert_eq!(places.map(|(x, y)| watched.knows(x, y)), [false, true, true], "the left one only");
    // every azimuth whose middle lies in the sector, and no other
    let unknown = |azimuth| watched.map.grades(azimuth).unwrap().iter().all(|grade| *grade == 0);
    let geometry = watched.map.geometry();
    let middle_deg = |azimuth: usize| {
        let right = f64::from(geometry.azimuth_origin.radians()).to_degrees();
        right + (azimuth as f64 + 0.5) / State::AZIMUTHS as f64 * f64::from(geometry.azimuth_span) / 65_536.0 * 360.0
    };
    assert!(middle_deg(State::AZIMUTHS - 1) > 60.0, "beyond the view's edge: it is pitched");
    assert!((0..State::AZIMUTHS).all(|azimuth| unknown(azimuth) == (middle_deg(azimuth) > 40.0)));
    // it stays so while no frame comes, and while the radar is silent nothing is known at all
    let last = Time::from_micros(100_000 * watched.frame);
    assert_eq!(watched.state.expire(&watched.parameters, last, &mut watched.map), Condition::SectorBlind);
    let later = Time::from_micros(last.micros() + 5_000_000);
    assert_eq!(watched.state.expire(&watched.parameters, later, &mut watched.map), Condition::Stale);
    assert!(!watched.knows(30.0, 0.0));
    assert_eq!(watched.run(12, Some), Condition::Healthy);
    assert!(places.iter().all(|(x, y)| watched.knows(*x, *y)));
}

#[test]
fn a_turned_mount_and_dirt_are_said_and_the_map_goes_on() {
    for (change, said) in [
        (
            (|d| Some(Detection { azimuth: d.azimuth + Angle::from_degrees(1.0), ..d })) as fn(Detection) -> _,
            Condition::Misaligned,
        ),
        (|d| Some(Detection { rcs_half_dbsm: Some(8), ..d }), Condition::Weaker),
    ] {
        let mut watched = Watched::new(true);
        watched.run(25, Some);
        assert_eq!(watched.run(150, change), said);
        assert!(said.has_map() && watched.knows(30.0, 0.0));
    }
}

#[test]
fn what_was_learned_is_forgotten_with_the_map() {
    let mut watched = Watched::new(true);
    watched.run(25, Some);
    watched.run(12, left_dark);
    watched.state.forget(&mut watched.map);
    assert_eq!(watched.run(12, left_dark), Condition::Settling, "usual from now on, as after a start");
    assert_eq!(watched.state.standing().unwrap().learned(), None);
}
