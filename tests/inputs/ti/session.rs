//! A unit at a radar's data port.

use viewshed::bench::start;
use viewshed::fixed::time::Time;
use viewshed::inputs::ti::{Ti, TiConfig, TiDialect, TiFamily};
use viewshed::radar_3d::Radar3d;
use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::unit::Unit;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::{Broadcaster, Medium};
use viewshed::wire::message::{Addresses, Epoch};
use viewshed::wire::status::{Reason, UnitState};

use super::frames::Frame;

#[test]
fn frames_of_nothing_but_nan_are_blindness_with_a_reason_and_end_with_the_first_good_point() {
    let good = [1.0, 30.0, -5.0, -12.0];
    let shown = |points: &[[f32; 4]]| run(|_| points.to_vec(), 64);
    assert_eq!(shown(&[[f32::NAN; 4]; 9]), (UnitState::Blind, Reason::UnusablePoints, 0));
    assert_eq!(shown(&[]).0, UnitState::Ok);
    // a point to the right of the field of view, x and y taken for one another
    assert_eq!(shown(&[[30.0, 1.0, -5.0, 0.0]]), (UnitState::Blind, Reason::UnusablePoints, 0));
    assert_eq!(shown(&[[f32::NAN; 4], good]).0, UnitState::Ok);
    assert!(shown(&[[f32::NAN; 4], good]).2 > 1000);
    let mended = run(|k| vec![if k < 30 { [f32::NAN; 4] } else { good }], 32);
    assert_eq!((mended.0, mended.1), (UnitState::Degraded, Reason::Settling), "a map again, of what is near");
    assert_eq!(run(|k| vec![if k < 30 { [f32::NAN; 4] } else { good }], 64).0, UnitState::Ok);
}

type Small = Radar3d<50, 40, 8, 2, 16, 64>;

/// A unit with settings, and its radar.
fn with_unit<T>(test: impl FnOnce(&mut Unit<'_, Small, Broadcaster<40, 2>>, &mut Ti<64>) -> T) -> T {
    let (medium, begin) = (Medium::Can(Addresses::STANDARD), Time::from_micros(0));
    let (mut parameters, mut sender) = (None, None);
    start::<Small, _>(&mut parameters, &mut sender, Some(&settings()), medium, Epoch::new(1), begin);
    let (parameters, mut sender) = (parameters.unwrap(), sender.unwrap());
    let (mut state, mut map) = (Box::new(Small::new()), parameters.map());
    let mut radar = Ti::new(TiConfig { family: Some(TiFamily::Bytes40), dialect: TiDialect::USUAL });
    test(&mut Unit::new(&parameters, &mut *state, &mut map, &mut sender), &mut radar)
}

/// State, reason and visible cells after so many frames, 20 a second.
fn run(points: impl Fn(u32) -> Vec<[f32; 4]>, frames: u32) -> (UnitState, Reason, usize) {
    with_unit(|unit, radar| {
        for k in 0..frames {
            let now = Time::from_micros(500_000 + 50_000 * u64::from(k));
            unit.take(radar, &Frame::new(TiFamily::Bytes40, k).cartesian(&points(k)).bytes(), now);
            unit.wait(radar, now);
            // a bus that takes nothing is a trouble of its own
            while unit.next_frame(now).is_some() {}
        }
        let status = *unit.broadcast().status_mut();
        let visible =
            (0..40).flat_map(|a| (0..50).map(move |r| (a, r))).filter(|(a, r)| unit.map().cell(*a, *r).visible());
        (status.state, status.reason, visible.count())
    })
}

fn settings() -> Settings {
    Settings::of(Sensor {
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 3.0, roll_deg: 0.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 100.0,
        },
        noise: NoiseConfig::default(),
    })
}

#[test]
fn every_frame_becomes_a_map_and_silence_is_reported() {
    with_unit(|unit, radar| {
        let mut now = Time::from_micros(0);
        for k in 0..60_u32 {
            now = Time::from_micros(500_000 + 50_000 * u64::from(k));
            // frame 7 never comes
            let frame = Frame::new(TiFamily::Bytes40, if k < 7 { k } else { k + 1 });
            let bytes = frame.cartesian(&[[1.0, 30.0, -5.0, -12.0], [2.0, 40.0, -5.0, -12.0]]).bytes();
            for chunk in bytes.chunks(17) {
                unit.take(radar, chunk, now);
            }
            unit.wait(radar, now);
            assert_eq!(unit.offered(), Some(now), "scan {k}");
            assert_eq!(unit.next_line(now, &mut [0; 242]), None, "a sender for CAN gives no lines");
            assert!(std::iter::from_fn(|| unit.next_frame(now)).count() > 0);
        }
        assert_eq!(radar.counters().scans, 60);
        let status = *unit.broadcast().status_mut();
        assert_eq!((status.state, status.radar_lost), (UnitState::Ok, 1));
        // two points of three: reported as long as it is recent, not until the next look
        let mut frame = Frame::new(TiFamily::Bytes40, 61);
        frame.points = 1;
        now = Time::from_micros(now.micros() + 50_000);
        unit.take(radar, &frame.cartesian(&[[1.0, 30.0, -5.0, -12.0], [2.0, 40.0, -5.0, -12.0]]).bytes(), now);
        for k in 0..4 {
            unit.wait(radar, Time::from_micros(now.micros() + k * 10_000));
            let status = *unit.broadcast().status_mut();
            assert_eq!((status.state, status.reason), (UnitState::Degraded, Reason::IncompleteScans), "{k}");
        }
        unit.take(radar, &[0x55; 300], now);
        unit.wait(radar, Time::from_micros(now.micros() + 600_000));
        let status = *unit.broadcast().status_mut();
        assert_eq!((status.state, status.reason), (UnitState::Blind, Reason::RadarSilent));
    });
}
