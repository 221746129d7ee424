//! A user of the library, who has the product's public names and no others.
//!
//! Built and run by `tests/architecture`, without the feature `bench`.

use std::error::Error;

use viewshed::query::{self, Answer, Footprint};
use viewshed::small::{Map, Parameters, Sender, State};
use viewshed::{
    Addresses, Angle, Ars408, Ars408Config, BroadcastConfig, Calibration, Camera3d, Camera3dConfig, Camera3dParameters,
    CanFrame, CanId, Condition, Detection, Epoch, Estimator, Feed, FieldOfView, Frame, ImageBox, Intrinsics,
    Measurement, Medium, Mount, NativeConfig, NativeMedium, NativeReceiver, NativeSender, NoiseConfig, PointPair,
    PolarMap, Radar3dConfig, Radar3dParameters, Receiver, ReceiverLimits, RoadGrid, RoadPoint, Sensor, Settings,
    SettlingConfig, Ti, TiConfig, Time, Unit, UnitState, VehicleClass, Visibility, VisibilityMap,
};

/// Range cells and azimuths of the small size, and a receiver of its maps.
const RANGES: usize = State::RANGES;
const AZIMUTHS: usize = State::AZIMUTHS;
type Far = Receiver<1, AZIMUTHS, { State::WORDS }>;

const FRAMES: u64 = 40;
const PERIOD_US: u64 = 66_667;

#[cfg(feature = "board")]
mod board;

fn main() -> Result<(), Box<dyn Error>> {
    let settings = Settings::of(gantry());
    estimators_and_questions(&settings)?;
    a_unit_and_its_receiver(&settings)?;
    #[cfg(feature = "board")]
    board::a_session_from_start_to_restart(&settings);
    a_camera()?;
    decoders();
    println!("the face is enough");
    Ok(())
}

/// 6 m above the road, looking 4 degrees down.
fn gantry() -> Sensor {
    Sensor {
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 100.0,
        },
        noise: NoiseConfig::default(),
    }
}

fn at(frame: u64) -> Time {
    Time::from_micros(1_000_000 + frame * PERIOD_US)
}

/// A parked truck's rear, 40 m ahead.
fn truck() -> Result<Vec<Detection>, Box<dyn Error>> {
    let reflection = |y_m: f32| Measurement {
        range_m: 40.0,
        azimuth_rad: y_m / 40.0,
        elevation_rad: Some(-0.05),
        radial_velocity_mps: 0.0,
        rcs_dbsm: Some(20.0),
        snr_db: Some(25.0),
    };
    Ok([-1.0, 0.0, 1.0].iter().map(|y| Detection::new(&reflection(*y))).collect::<Result<_, _>>()?)
}

/// The estimator, its map, and what may be asked of any map.
fn estimators_and_questions(settings: &Settings) -> Result<(), Box<dyn Error>> {
    // the truck was never seen moving, and nobody waits here until it is taken for none
    let config = Radar3dConfig { gate: settings.gate, settling: SettlingConfig::AT_ONCE, ..Radar3dConfig::default() };
    let parameters: Parameters = Radar3dParameters::new(&settings.sensor, &config)?;
    let (mut radar, mut map) = (Box::new(State::new()), parameters.map());
    let detections = truck()?;
    for frame in 0..FRAMES {
        let report = radar.process(&parameters, at(frame), &detections, false, &mut map);
        assert_eq!(report.condition, Condition::Healthy);
    }
    let ahead = RoadPoint::from_metres(20.0, 0.0)?;
    assert_eq!(query::point(&map, ahead), Answer::VisibleFree);
    let car = Footprint::new(RoadPoint::from_metres(30.0, 3.5)?, 0.0, 4.6, 1.8)?;
    assert_eq!(query::area(&map, &car), Answer::VisibleFree);
    let mut grid = Box::new(RoadGrid::<100, 40>::unknown(0, -20));
    grid.resample(&map);
    assert_eq!(grid.cell(20, 0).visibility, Visibility::Visible);
    assert_eq!(State::expire(&radar, &parameters, at(10 * FRAMES), &mut map), Condition::Stale);
    assert_eq!(query::point(&map, ahead), Answer::Unknown);
    Ok(())
}

/// A unit fed with an integrator's own format, its broadcast on CAN, and a receiver's map.
fn a_unit_and_its_receiver(settings: &Settings) -> Result<(), Box<dyn Error>> {
    let mut parameters = None;
    let header = settings.build::<State>(&mut parameters)?;
    let parameters = parameters.ok_or("just built")?;
    let medium = Medium::Can(Addresses::STANDARD);
    let mut sender = Box::new(Sender::new(BroadcastConfig::new(0, medium), header, Epoch::new(7), at(0))?);
    let (mut state, mut map) = (Box::new(State::new()), Box::new(Map::NOWHERE));
    let mut unit = Unit::new(&parameters, &mut *state, &mut *map, &mut *sender);
    let mut receiver = Box::new(Far::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT));
    let (mut radar, mut feed) = (NativeSender::new(0), NativeReceiver::<256>::new(NativeConfig::sensor(0)));
    let detections = truck()?;
    for frame in 0..FRAMES {
        for message in radar.scan(at(frame), false, &detections, NativeMedium::Serial) {
            unit.take(&mut feed, message.bytes(), at(frame));
        }
        for ms in 0..60 {
            let now = Time::from_micros(at(frame).micros() + 1000 * ms);
            if let Some(frame) = unit.next_frame(now) {
                // the first of an epoch is not believed alone
                let _ = receiver.frame(now, &frame);
            }
        }
    }
    // what the truck may hide has not settled yet
    assert_eq!(unit.broadcast().status_mut().state, UnitState::Degraded);
    let now = at(FRAMES);
    let received = receiver.map(0, now);
    let equal = |a: usize, r: usize| received.cell(a, r).visible() == unit.map().cell(a, r).visible();
    assert!((0..AZIMUTHS).all(|a| (0..RANGES).all(|r| equal(a, r))), "every cell arrives");
    assert!(received.at(RoadPoint::from_metres(20.0, 0.0)?).visible());
    Ok(())
}

/// A camera calibrated by points of the road, its boxes over the native format, its map.
fn a_camera() -> Result<(), Box<dyn Error>> {
    // at 6 m, level
    let seen =
        |x: f32, y: f32| PointPair { road_m: [x, y], image_px: [960.0 - 1600.0 * y / x, 540.0 + 1600.0 * 6.0 / x] };
    let points = [seen(20.0, -8.0), seen(20.0, 9.0), seen(90.0, 7.0), seen(110.0, -10.0)];
    let intrinsics = Intrinsics { size_px: [1920, 1080], focal_px: [1600.0; 2], center_px: [960.0, 540.0] };
    let (calibration, residual_px) = Calibration::from_points(&intrinsics, &points)?;
    assert!(residual_px < 0.5 && (calibration.mount.height_m - 6.0).abs() < 0.1);
    let parameters = Camera3dParameters::<200, 60>::new(&calibration.normalised(), &Camera3dConfig::default())?;
    let (mut camera, mut map) = (Box::new(Camera3d::<200, 60>::new()), parameters.map());
    // a truck's rear at 40 m
    let truck = ImageBox::of_picture([909.0, 602.0, 1011.0, 780.0], [1920, 1080], VehicleClass::Truck);
    let boxes = [truck.ok_or("edges that are finite")?];
    let (mut sender, mut feed) = (NativeSender::new(0), NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(0)));
    for message in sender.boxes(at(0), false, &boxes, NativeMedium::CanFd) {
        feed.take(message.bytes(), at(0), &mut |frame| {
            camera.process(&parameters, frame.measured, frame.input, frame.status, &mut map);
        });
    }
    assert_eq!(query::point(&map, RoadPoint::from_metres(30.5, 0.5)?), Answer::VisibleFree);
    assert_eq!(query::point(&map, RoadPoint::from_metres(65.5, 0.5)?), Answer::Invisible);
    Ok(())
}

/// A sensor that is none of the library's.
struct Loop;

impl Feed for Loop {
    type Piece = bool;
    type Input = [Detection];

    fn take(&mut self, piece: &bool, now: Time, each: &mut impl FnMut(&Frame<'_, [Detection]>)) {
        each(&Frame { measured: now, input: &[], incomplete: !piece, status: false.into() });
    }
    fn wait(&mut self, _: Time, _: &mut impl FnMut(&Frame<'_, [Detection]>)) {}
    fn lost(&self) -> u32 {
        0
    }
}

/// How many frames a feed gives out of a piece.
fn frames<F: Feed>(feed: &mut F, piece: &F::Piece) -> usize {
    let mut frames = 0;
    feed.take(piece, at(0), &mut |_| frames += 1);
    frames
}

fn decoders() {
    let none = CanFrame::classic(CanId::Standard(0x60B), &[0; 8]).expect("8 bytes fit");
    assert_eq!(frames(&mut Ars408::<64>::new(Ars408Config::sensor(0)), &none), 0);
    assert_eq!(frames(&mut Ti::<64>::new(TiConfig::LEARN), &[1, 2, 3]), 0);
    assert_eq!(frames(&mut Loop, &true), 1);
    assert_eq!(Angle::from_degrees(90.0), Angle::QUARTER);
    let _: fn(&<State as Estimator>::Parameters) -> PolarMap<RANGES, AZIMUTHS> = Parameters::map;
}
