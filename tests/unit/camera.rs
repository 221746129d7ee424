//! A camera's unit: boxes of a native line in, maps at a receiver out.

use viewshed::camera::boxes::{ImageBox, VehicleClass};
use viewshed::camera::map::AZIMUTHS;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::native::{NativeConfig, NativeMedium, NativeReceiver, NativeSender};
use viewshed::map::query::{self, Answer};
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;
use viewshed::sensor::{field_of_view::FieldOfView, mount::Mount};
use viewshed::unit::Unit;
use viewshed::unit::identity::Identity;
use viewshed::unit::profile::camera::{CHECK, Map, Parameters, Sender, State};
use viewshed::unit::serial_service::SerialLine;
use viewshed::unit::session::SerialSession;
use viewshed::unit::settings::{Settings, StoredSettings};
use viewshed::wire::broadcast::{BroadcastConfig, Medium};
use viewshed::wire::message::{Addresses, Epoch};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::Unstuffer;
use viewshed::wire::status::{Reason, UnitState};

use crate::block::Block;

const PERIOD_US: u64 = 66_667;

/// 60 degrees wide, level, at 6 m; the picture is as high as it is wide.
fn settings() -> Settings {
    let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
    let field_of_view = FieldOfView {
        azimuth_min_deg: -30.0,
        azimuth_max_deg: 30.0,
        elevation_min_deg: -30.0,
        elevation_max_deg: 30.0,
        range_min_m: 0.0,
        range_max_m: 200.0,
    };
    Settings::of_camera(mount, field_of_view)
}

/// The box a vehicle is seen in: its near end, its middle to the left, its length, width and height.
fn seen(class: VehicleClass, near: f32, left: f32, [length, width, height]: [f32; 3]) -> ImageBox {
    let focal = 1000.0 / (2.0 * 30_f32.to_radians().tan());
    let mut edges = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
    for x in [near, near + length] {
        for (y, z) in [(left - width / 2.0, 0.0), (left + width / 2.0, height)] {
            let (u, v) = (500.0 - focal * y / x, 500.0 - focal * (z - 6.0) / x);
            edges = [edges[0].min(u), edges[1].min(v), edges[2].max(u), edges[3].max(v)];
        }
    }
    ImageBox::of_picture(edges, [1000, 1000], class).unwrap()
}

fn road() -> [ImageBox; 2] {
    [seen(VehicleClass::Truck, 40.0, 3.5, [12.0, 2.55, 4.0]), seen(VehicleClass::Car, 30.0, -4.0, [4.6, 1.8, 1.5])]
}

fn at(frame: u64) -> Time {
    Time::from_micros(1_000_000 + frame * PERIOD_US)
}

fn parameters_and_sender(settings: &Settings, medium: Medium) -> (Parameters, Box<Sender>) {
    let mut parameters = None;
    let header = settings.build::<State>(&mut parameters).unwrap();
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(0, medium) };
    let sender = Sender::new(config, header, Epoch::new(7), Time::from_micros(0)).unwrap();
    (parameters.unwrap(), Box::new(sender))
}

#[derive(Default)]
struct Line(Vec<u8>);

impl SerialLine for Line {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.0.extend(bytes);
        true
    }
}

/// What a receiver at the end of a line takes of its bytes.
fn hear(receiver: &mut Receiver<1, AZIMUTHS, 7>, line: &mut Line, now: Time) {
    let (mut unstuffer, bytes) = (Unstuffer::new(), std::mem::take(&mut line.0));
    let mut rest = &bytes[..];
    while !rest.is_empty() {
        let (taken, message) = unstuffer.push(rest);
        rest = &rest[taken..];
        // replies of the service are none of its business
        message.map(|message| receiver.message(now, message).is_ok());
    }
}

#[test]
fn boxes_on_a_serial_line_become_the_map_of_a_receiver_each_cell_as_the_nearest_and_never_better() {
    let settings = settings();
    let (parameters, mut sender) = parameters_and_sender(&settings, Medium::Serial);
    let (mut state, mut map) = (Box::new(State::new()), Box::new(Map::NOWHERE));
    let (mut slots, mut line) = (Block(settings.to_block(1)), Line::default());
    let mut session = SerialSession::<64, ImageBox>::start(
        0,
        Identity::UNNAMED,
        Epoch::new(7),
        StoredSettings::read(&slots, CHECK),
        &mut line,
    );
    assert_eq!(session.settings(), Some(&settings));
    let mut unit = Some(Unit::new(&parameters, &mut *state, &mut *map, &mut *sender));
    let mut receiver = Box::new(Receiver::<1, AZIMUTHS, 7>::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT));
    let mut camera = NativeSender::new(0);
    for frame in 0..20 {
        let mut stuffed = [0; 300];
        for message in camera.boxes(at(frame), false, &road(), NativeMedium::Serial) {
            let n = message.stuff(&mut stuffed).unwrap();
            session.take(&stuffed[..n], &mut unit, &mut slots, &mut line, &mut |_, _| {});
        }
        hear(&mut receiver, &mut line, at(frame));
    }
    let unit = unit.as_mut().unwrap();
    assert_eq!((unit.frames(), unit.broadcast().status_mut().state), (20, UnitState::Ok));
    let at_unit = |x, y| query::point(unit.map(), RoadPoint::from_metres(x, y).unwrap());
    assert_eq!((at_unit(30.5, 3.5), at_unit(65.5, 4.5)), (Answer::VisibleFree, Answer::Invisible));

    let received = receiver.map(0, at(19));
    let header = received.header().unwrap();
    let (origin_rad, span_rad) =
        (f64::from(header.azimuth_origin.radians()), f64::from(header.azimuth_span) / 65_536.0 * std::f64::consts::TAU);
    assert!((60.0..64.0).contains(&span_rad.to_degrees()), "{span_rad}");
    let (mut visible, mut invisible, mut unknown) = (0, 0, 0);
    for (a, r) in (0..AZIMUTHS).flat_map(|a| (0..200).map(move |r| (a, r))) {
        let cell = received.cell(a, r).visibility;
        let azimuth = origin_rad + (a as f64 + 0.5) * span_rad / AZIMUTHS as f64;
        let range = f64::from(r as u32) + 0.5;
        // a middle within 5 cm of a cell's border may be taken for either
        let near = [(-0.05, -0.05), (-0.05, 0.05), (0.05, -0.05), (0.05, 0.05)];
        let own = near.map(|(dx, dy)| {
            let (x, y) = (range * azimuth.cos() + dx, range * azimuth.sin() + dy);
            unit.map().at(RoadPoint::from_metres(x as f32, y as f32).unwrap()).visibility
        });
        // an unknown cell between known ones is sent as not visible
        let worse = cell == Visibility::Invisible && own.contains(&Visibility::Unknown);
        assert!(own.contains(&cell) || worse, "{a} {r}: {cell:?} of {own:?}");
        match cell {
            Visibility::Visible => visible += 1,
            Visibility::Invisible => invisible += 1,
            Visibility::Unknown => unknown += 1,
        }
    }
    assert!(visible > 10_000 && invisible > 300 && unknown > 1000, "{visible} {invisible} {unknown}");
}

#[test]
fn a_camera_that_stops_is_told_and_its_map_is_unknown() {
    let settings = settings();
    let (parameters, mut sender) = parameters_and_sender(&settings, Medium::Can(Addresses::STANDARD));
    let (mut state, mut map) = (Box::new(State::new()), Box::new(Map::NOWHERE));
    let mut unit = Unit::new(&parameters, &mut *state, &mut *map, &mut *sender);
    let mut feed = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(0));
    let ahead = |unit: &Unit<'_, State, Sender>| unit.map().at(RoadPoint::new(3050, 350)).visibility;
    assert_eq!(ahead(&unit), Visibility::Unknown, "before the first picture");
    let mut camera = NativeSender::new(0);
    for frame in 0..15 {
        for message in camera.boxes(at(frame), false, &road(), NativeMedium::CanFd) {
            unit.take(&mut feed, message.bytes(), at(frame));
        }
    }
    assert_eq!((unit.frames(), ahead(&unit)), (15, Visibility::Visible));
    let after = |ms: u64| Time::from_micros(at(14).micros() + 1000 * ms);
    unit.wait(&mut feed, after(500));
    assert_eq!(ahead(&unit), Visibility::Visible);
    unit.wait(&mut feed, after(501));
    let status = unit.broadcast().status_mut();
    assert_eq!((status.state, status.reason), (UnitState::Blind, Reason::RadarSilent));
    assert_eq!(ahead(&unit), Visibility::Unknown);
    assert_eq!(unit.offered(), Some(after(501)), "and that is sent");
}

#[test]
fn a_picture_of_which_a_part_is_lost_is_told_and_one_that_is_mostly_lost_is_no_free_road() {
    let settings = settings();
    let (parameters, mut sender) = parameters_and_sender(&settings, Medium::Serial);
    let (mut state, mut map) = (Box::new(State::new()), Box::new(Map::NOWHERE));
    let mut unit = Unit::new(&parameters, &mut *state, &mut *map, &mut *sender);
    let mut feed = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(0));
    let boxes: Vec<ImageBox> = road().into_iter().cycle().take(23).collect();
    let mut camera = NativeSender::new(0);
    for frame in 0..6 {
        let parts: Vec<_> = camera.boxes(at(frame), false, &boxes, NativeMedium::CanFd).collect();
        assert_eq!(parts.len(), 5);
        let arrive = if frame == 3 { 2 } else { 4 };
        for part in &parts[..arrive] {
            unit.take(&mut feed, part.bytes(), at(frame));
        }
        unit.wait(&mut feed, Time::from_micros(at(frame).micros() + 30_000));
    }
    // each ends the one before
    assert_eq!((unit.frames(), feed.counters().incomplete, feed.counters().broken), (4, 4, 1));
    let status = unit.broadcast().status_mut();
    assert_eq!((status.state, status.reason), (UnitState::Degraded, Reason::IncompleteScans));
}

#[test]
fn a_radar_and_a_camera_of_one_number_do_not_take_each_others_messages() {
    let detection = Detection {
        range_cm: 5000,
        azimuth: viewshed::fixed::angle::Angle::ZERO,
        elevation: None,
        radial_velocity_cm_s: 0,
        rcs_half_dbsm: None,
        snr_half_db: None,
        marked: false,
    };
    let mut radar = NativeReceiver::<64>::new(NativeConfig::sensor(3));
    let mut camera = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(3));
    let mut sender = NativeSender::new(3);
    for medium in [NativeMedium::CanFd, NativeMedium::Serial] {
        for message in sender.boxes(at(0), false, &road(), medium) {
            let _ = radar.push(message.bytes(), at(0));
        }
        for message in sender.scan(at(0), false, &[detection], medium) {
            let _ = camera.push(message.bytes(), at(0));
        }
    }
    assert_eq!((radar.counters().damaged, radar.counters().messages), (2, 0));
    assert_eq!((camera.counters().damaged, camera.counters().messages), (2, 0));
    assert_ne!(radar.config().id, camera.config().id);
}

#[test]
fn settings_no_camera_can_run_with_are_refused_by_name() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = settings();
        change(&mut settings);
        CHECK.settings(&settings).unwrap_err().parameter
    };
    assert!(CHECK.settings(&settings()).is_ok());
    assert_eq!(refused(|s| s.sensor.mount.height_m = 0.0), "mount.height_m");
    assert_eq!(refused(|s| s.sensor.mount.pitch_deg = -40.0), "mount.pitch_deg", "nothing of the road in view");
    assert_eq!(refused(|s| s.sensor.field_of_view.range_max_m = 0.0), "field_of_view.range_max_m");
    assert_eq!(refused(|s| s.sensor.field_of_view.azimuth_min_deg = 40.0), "field_of_view.azimuth_max_deg");
    assert_eq!(refused(|s| s.sensor.field_of_view.elevation_max_deg = f32::NAN), "field_of_view.elevation_max_deg");
    assert_eq!(refused(|s| s.visibility.far_road_deg = Some(0)), "visibility.far_road_deg", "of radars only");
}

#[test]
fn the_share_of_a_column_that_has_to_be_seen_is_a_setting() {
    let visible = |share: Option<f32>| {
        let mut settings = settings();
        settings.visibility.visible_from = share.unwrap_or(settings.visibility.visible_from);
        let (_, read) = Settings::from_block(&settings.to_block(1)).unwrap();
        let (parameters, mut sender) = parameters_and_sender(&read, Medium::Serial);
        let (mut state, mut map) = (Box::new(State::new()), Box::new(Map::NOWHERE));
        let mut unit = Unit::new(&parameters, &mut *state, &mut *map, &mut *sender);
        let mut feed = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(0));
        let mut camera = NativeSender::new(0);
        for message in camera.boxes(at(0), false, &road(), NativeMedium::CanFd) {
            unit.take(&mut feed, message.bytes(), at(0));
        }
        assert_eq!(unit.frames(), 1);
        let cells = (0..60).map(|x| RoadPoint::from_metres(60.5 + x as f32, 4.5).unwrap());
        cells.filter(|cell| unit.map().at(*cell).visible()).count()
    };
    let (usual, few, most) = (visible(None), visible(Some(0.3)), visible(Some(0.9)));
    assert_eq!(usual, visible(Some(0.6)), "the estimator's own share, not a radar's");
    assert!(few > usual && usual > most, "{few} {usual} {most}");
}
