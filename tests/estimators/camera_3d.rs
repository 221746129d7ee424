//! The camera-3d estimator from outside: boxes in, maps out.

use std::mem::size_of;

use viewshed::camera::boxes::{BoxRejection, ImageBox, VehicleClass};
use viewshed::camera::calibration::{Calibration, Intrinsics};
use viewshed::camera::map::CameraMap;
use viewshed::camera::{Camera3dConfig, Camera3dParameters, CameraProfile, MOST_BOXES};
use viewshed::fixed::time::Time;
use viewshed::frame::health::Condition;
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::sensor::mount::Mount;
use viewshed::sensor::road::RoadPoint;

const FOCAL_PX: f64 = 1600.0;

/// Level at 6 m, 62 degrees wide.
fn calibration() -> Calibration {
    Calibration {
        intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [FOCAL_PX as f32; 2], center_px: [960.0, 540.0] },
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 },
    }
}

/// The box a level camera sees a vehicle in: its near end, its middle to the left, its size, metres.
fn seen(class: VehicleClass, near: f64, left: f64, [length, width, height]: [f64; 3]) -> ImageBox {
    let mut edges = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
    for x in [near, near + length] {
        for y in [left - width / 2.0, left + width / 2.0] {
            for z in [0.0, height] {
                let (u, v) = (960.0 - FOCAL_PX * y / x, 540.0 - FOCAL_PX * (z - 6.0) / x);
                edges = [edges[0].min(u), edges[1].min(v), edges[2].max(u), edges[3].max(v)];
            }
        }
    }
    ImageBox::from_pixels(edges.map(|v| v as f32), class).unwrap()
}

fn truck(near: f64, left: f64) -> ImageBox {
    seen(VehicleClass::Truck, near, left, [12.0, 2.55, 4.0])
}

fn car(near: f64, left: f64) -> ImageBox {
    seen(VehicleClass::Car, near, left, [4.6, 1.8, 1.5])
}

struct Bench {
    parameters: Camera3dParameters<200, 60>,
    camera: Box<CameraProfile>,
    map: CameraMap<200, 60>,
}

impl Bench {
    fn new(config: &Camera3dConfig) -> Self {
        let parameters = Camera3dParameters::new(&calibration(), config).unwrap();
        let map = parameters.map();
        Self { parameters, camera: Box::new(CameraProfile::new()), map }
    }

    fn frame(&mut self, ms: u64, boxes: &[ImageBox]) -> Condition {
        let now = Time::from_micros(ms * 1000);
        self.camera.process(&self.parameters, now, boxes, false, &mut self.map).condition
    }

    fn at(&self, x_m: f32, y_m: f32) -> Answer {
        query::point(&self.map, RoadPoint::from_metres(x_m, y_m).unwrap())
    }

    fn known(&self) -> usize {
        let cells = (0..200).flat_map(|i| (-30..30).map(move |j| RoadPoint::cell_centre(i, j)));
        cells.filter(|p| self.map.at(*p).visibility != Visibility::Unknown).count()
    }
}

fn seeing(boxes: &[ImageBox]) -> Bench {
    let mut bench = Bench::new(&Camera3dConfig::default());
    bench.frame(0, boxes);
    bench
}

#[test]
fn a_truck_hides_what_is_behind_it_and_nothing_else() {
    let bench = seeing(&[truck(40.0, 3.5)]);
    assert_eq!(bench.at(30.5, 2.5), Answer::VisibleFree, "before it");
    assert_eq!(bench.at(40.5, 3.5), Answer::VisibleOccupied, "its rear");
    assert_eq!(bench.at(50.5, 3.5), Answer::VisibleOccupied, "all of it is seen as its rear is");
    assert_eq!(bench.at(60.5, 4.5), Answer::Invisible);
    assert_eq!(bench.at(60.5, -3.5), Answer::VisibleFree, "the other side");
    assert_eq!(bench.at(60.5, 12.5), Answer::VisibleFree, "two lanes farther left");
    assert_eq!(bench.at(60.5, 50.0), Answer::Unknown, "out of the image");
    assert_eq!(bench.at(-10.0, 0.0), Answer::Unknown);
    let behind = Footprint::new(RoadPoint::new(6500, 480), 0.0, 4.6, 1.8).unwrap();
    assert_eq!(query::object(&bench.map, &behind), Answer::Invisible);
}

#[test]
fn left_and_right_are_mirrored() {
    let (left, right) = (seeing(&[truck(40.0, 6.0), car(30.0, -2.5)]), seeing(&[truck(40.0, -6.0), car(30.0, 2.5)]));
    let mut differ = 0;
    for i in 0..200 {
        for j in 0..30 {
            let (a, b) = (left.map.at(RoadPoint::cell_centre(i, j)), right.map.at(RoadPoint::cell_centre(i, -1 - j)));
            differ += usize::from(a != b);
        }
    }
    assert!(differ < 60, "{differ} of 6000 cells");
    assert!(left.at(60.5, 8.5) == Answer::Invisible && left.at(60.5, -8.5) == Answer::VisibleFree);
}

#[test]
fn over_a_car_the_upper_half_of_a_column_is_seen_which_is_a_question_of_the_threshold() {
    let share = |visible_share| {
        let mut bench = Bench::new(&Camera3dConfig { visible_share, ..Camera3dConfig::default() });
        bench.frame(0, &[car(30.0, 0.5)]);
        bench.at(35.5, 0.5)
    };
    // behind 34.6 m the line over 1.5 m is at 1.4 m: two thirds of 4 m are above it
    assert_eq!((share(0.5), share(0.75)), (Answer::VisibleFree, Answer::Invisible));
    assert_eq!(seeing(&[car(30.0, 0.5)]).at(60.5, 0.5), Answer::VisibleFree, "seen over");
}

#[test]
fn what_is_no_longer_seen_fades_in_its_memory() {
    let mut bench = seeing(&[truck(40.0, 0.5)]);
    bench.frame(66, &[car(20.0, -8.5)]);
    assert_eq!(bench.at(60.5, 0.5), Answer::Invisible, "66 ms after a missed box");
    bench.frame(200, &[car(20.0, -8.5)]);
    assert_eq!(bench.at(60.5, 0.5), Answer::VisibleFree);
}

#[test]
fn a_silent_camera_ages_to_unknown_never_to_visible() {
    let mut bench = Bench::new(&Camera3dConfig::default());
    assert_eq!(bench.known(), 0, "before the first frame");
    bench.frame(0, &[truck(40.0, 0.5)]);
    assert!(bench.known() > 5000, "{}", bench.known());
    let Bench { parameters, camera, map } = &mut bench;
    assert_eq!(camera.expire(parameters, Time::from_micros(500_000), map), Condition::Healthy);
    assert_eq!(camera.expire(parameters, Time::from_micros(500_001), map), Condition::Stale);
    assert_eq!(bench.known(), 0);
}

#[test]
fn a_camera_that_went_blind_or_says_so_is_unknown() {
    let mut bench = seeing(&[truck(40.0, 0.5)]);
    let conditions: Vec<Condition> = (1..=17).map(|k| bench.frame(k * 66, &[])).collect();
    assert_eq!((conditions[14], conditions[16]), (Condition::Healthy, Condition::Blind));
    assert_eq!(bench.known(), 0);
    assert_eq!(bench.frame(18 * 66, &[car(30.0, 0.5)]), Condition::Healthy);
    let Bench { parameters, camera, map } = &mut bench;
    let report = camera.process(parameters, Time::from_micros(1_300_000), &[car(30.0, 0.5)], true, map);
    assert_eq!((report.condition, bench.known()), (Condition::Blind, 0));
}

#[test]
fn a_camera_that_sees_vehicles_in_the_sky_only_is_not_calibrated() {
    let mut bench = Bench::new(&Camera3dConfig::default());
    let sky = ImageBox::from_pixels([900.0, 300.0, 960.0, 360.0], VehicleClass::Car).unwrap();
    let conditions: Vec<Condition> = (0..17).map(|k| bench.frame(k * 66, &[sky])).collect();
    assert_eq!((conditions[15], conditions[16]), (Condition::Healthy, Condition::Unusable));
    assert_eq!(bench.known(), 0);
    assert_eq!(bench.camera.rejections().count(BoxRejection::AboveHorizon), 17);
}

#[test]
fn a_gap_or_a_step_of_the_clock_forgets_what_was_occupied() {
    for second in [60_200, 0] {
        let mut bench = Bench::new(&Camera3dConfig { memory_s: 60.0, ..Camera3dConfig::default() });
        bench.frame(100, &[truck(40.0, 0.5)]);
        bench.frame(150, &[car(20.0, -8.5)]);
        assert_eq!(bench.at(60.5, 0.5), Answer::Invisible);
        bench.frame(second, &[car(20.0, -8.5)]);
        assert_eq!(bench.at(60.5, 0.5), Answer::VisibleFree, "{second}");
    }
}

#[test]
fn every_box_is_used_or_counted_with_its_reason() {
    let pixels = |edges| ImageBox::from_pixels(edges, VehicleClass::Car).unwrap();
    let mut boxes = vec![
        car(30.0, 0.0),
        pixels([700.0, 600.0, 600.0, 700.0]),
        pixels([2000.0, 600.0, 2100.0, 700.0]),
        pixels([900.0, 100.0, 960.0, 160.0]),
        pixels([900.0, 570.0, 910.0, 575.0]),
    ];
    boxes.resize(MOST_BOXES + 1, car(50.0, 3.0));
    let mut bench = Bench::new(&Camera3dConfig::default());
    let status = viewshed::frame::health::FrameStatus { refused: 2, ..Default::default() };
    let report = bench.camera.process(&bench.parameters, Time::from_micros(0), &boxes, status, &mut bench.map);
    let counts = BoxRejection::ALL.map(|reason| report.rejections.count(reason));
    // inverted, outside, above the horizon, off the grid, too many, refused
    assert_eq!((counts, report.used), ([1, 1, 1, 1, 1, 2], 496));
    bench.frame(66, &boxes[..2]);
    assert_eq!(bench.camera.rejections().count(BoxRejection::Inverted), 2, "since the start");
}

#[test]
fn a_grid_of_200_by_60_by_8_voxels_fits_64_kb_with_all_its_state() {
    let (state, parameters) = (size_of::<CameraProfile>(), size_of::<Camera3dParameters<200, 60>>());
    println!("camera-3d 200 x 60 x 8: state {state} B, parameters {parameters} B");
    assert!(state + parameters <= 61_700, "{state} + {parameters}");
}

#[test]
fn a_parameter_that_cannot_be_worked_with_is_named() {
    let error = |config: Camera3dConfig| Camera3dParameters::<200, 60>::new(&calibration(), &config).unwrap_err();
    assert_eq!(error(Camera3dConfig { visible_share: 1.5, ..Camera3dConfig::default() }).parameter, "visible_share");
    assert_eq!(error(Camera3dConfig { memory_s: 0.0, ..Camera3dConfig::default() }).parameter, "memory_s");
    let mut up = calibration();
    up.mount.pitch_deg = -40.0;
    let error = Camera3dParameters::<200, 60>::new(&up, &Camera3dConfig::default()).unwrap_err();
    assert!(error.to_string().contains("check height and pitch"), "{error}");
}

#[test]
fn any_boxes_in_any_order_leave_a_map_within_its_field_of_view() {
    let mut seed = 7_u64;
    let mut next = |most: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % most
    };
    let classes = [VehicleClass::Car, VehicleClass::Bus, VehicleClass::Bicycle, VehicleClass::Truck];
    let mut bench = seeing(&[car(50.0, 0.0)]);
    let in_view = bench.known();
    for k in 1..200 {
        let boxes: Vec<ImageBox> = (0..next(60))
            .map(|_| {
                let (l, t) = (next(2200) as f32 - 100.0, next(1300) as f32 - 100.0);
                let edges = [l, t, l + next(700) as f32 - 50.0, t + next(500) as f32 - 50.0];
                ImageBox::from_pixels(edges, classes[next(4) as usize]).unwrap()
            })
            .collect();
        if bench.frame(k * 66, &boxes) == Condition::Healthy {
            assert_eq!(bench.known(), in_view, "frame {k}");
        }
    }
}
