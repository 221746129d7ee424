//! The native format's boxes of a camera: bytes, round trips, and what nobody should send.

use proptest::prelude::*;
use viewshed::camera::boxes::{BoxRejection, ImageBox, VehicleClass};
use viewshed::camera::calibration::{Calibration, Intrinsics};
use viewshed::camera::{Camera3dConfig, Camera3dParameters, CameraProfile};
use viewshed::fixed::time::Time;
use viewshed::inputs::native::{
    NativeConfig, NativeMedium, NativeMessage, NativeOutcome, NativeReceiver, NativeSender, NativeSerialReceiver,
    box_data_id, box_id,
};
use viewshed::sensor::mount::Mount;
use viewshed::wire::e2e::Profile;
use viewshed::wire::frame::CanId;

const CAMERA: u8 = 7;

fn at(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

fn boxed(edges: [f32; 4], class: VehicleClass) -> ImageBox {
    ImageBox::of_picture(edges, [1920, 1080], class).unwrap()
}

fn messages(boxes: &[ImageBox], medium: NativeMedium) -> Vec<NativeMessage> {
    NativeSender::new(CAMERA).boxes(at(5), false, boxes, medium).collect()
}

/// What comes out of a receiver for `N` boxes: the boxes, and how many were refused.
fn received<const N: usize>(messages: &[NativeMessage]) -> Option<(Vec<ImageBox>, u16)> {
    let mut receiver = NativeReceiver::<N, ImageBox>::boxes(NativeConfig::camera(CAMERA));
    let mut got = None;
    for message in messages {
        if let NativeOutcome::Scan(scan) = receiver.push(message.bytes(), at(5)) {
            got = Some((scan.detections.to_vec(), scan.refused));
        }
    }
    got
}

#[test]
fn a_picture_has_the_bytes_described() {
    // a quarter from the left, a half from above; ends a quarter right of and below the picture
    let truck = boxed([480.0, 540.0, 2400.0, 1350.0], VehicleClass::Truck);
    let outside = boxed([-480.0, 0.0, 0.0, 1080.0], VehicleClass::Pedestrian);
    let [message] = messages(&[truck, outside], NativeMedium::Serial)[..] else { panic!() };
    assert_eq!(message.bytes()[3..14], [0x12, CAMERA, 0, 0, 1, 0x88, 0x13, 0, 0, 0, 0]);
    assert_eq!(message.bytes()[14..24], [0x00, 0x10, 0x00, 0x20, 0x00, 0x50, 0x00, 0x50, 3, 0]);
    assert_eq!(message.bytes()[24..], [0x00, 0xF0, 0x00, 0x00, 0x00, 0x00, 0x00, 0x40, 7, 0]);
    assert_eq!(Profile::P05.check(message.bytes(), 0x4107), Ok(0));
    let [padded] = messages(&[truck], NativeMedium::CanFd)[..] else { panic!() };
    let frame = padded.frame(box_id(CAMERA)).unwrap();
    assert_eq!((frame.id, frame.data().len()), (CanId::Extended(0x100_0107), 24));
    assert_eq!(received::<4>(&[padded]), Some((vec![truck], 0)));
    let [empty] = messages(&[], NativeMedium::CanFd)[..] else { panic!() };
    assert_eq!(received::<4>(&[empty]), Some((vec![], 0)), "a picture without boxes is one");
}

#[test]
fn a_class_of_a_later_version_is_counted_and_its_neighbours_stay() {
    let car = boxed([480.0, 540.0, 600.0, 640.0], VehicleClass::Car);
    let [message] = messages(&[car, car, car], NativeMedium::Serial)[..] else { panic!() };
    let mut bytes = message.bytes().to_vec();
    bytes[14 + 10 + 8] = 8;
    Profile::P05.protect(&mut bytes, box_data_id(CAMERA), 0);
    let mut receiver = NativeReceiver::<4, ImageBox>::boxes(NativeConfig::camera(CAMERA));
    let NativeOutcome::Scan(scan) = receiver.push(&bytes, at(5)) else { panic!() };
    assert_eq!((scan.detections, scan.refused, scan.status().refused), (&[car, car][..], 1, 1));
}

#[test]
fn of_five_hundred_boxes_the_largest_stay_and_the_rest_is_counted() {
    let nth = |n: usize| {
        let side = 10.0 + (n * 7919 % 500) as f32;
        boxed([100.0, 500.0, 100.0 + side, 500.0 + side], VehicleClass::Car)
    };
    let all: Vec<ImageBox> = (0..500).map(nth).collect();
    assert_eq!(received::<500>(&messages(&all, NativeMedium::CanFd)), Some((all.clone(), 0)));
    let mut receiver = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(CAMERA));
    let mut kept = Vec::new();
    for message in messages(&all, NativeMedium::Serial) {
        if let NativeOutcome::Scan(scan) = receiver.push(message.bytes(), at(5)) {
            kept = scan.detections.to_vec();
        }
    }
    assert_eq!((kept.len(), receiver.counters().overflow), (64, 436));
    let largest: Vec<ImageBox> = (0..500).filter(|n| n * 7919 % 500 >= 440).map(nth).collect();
    assert!(largest.iter().all(|b| kept.contains(b)));
}

#[test]
fn what_is_inverted_outside_or_in_the_sky_reaches_the_estimator_which_counts_it() {
    let boxes = [
        boxed([900.0, 600.0, 1000.0, 700.0], VehicleClass::Car),
        boxed([1000.0, 600.0, 900.0, 700.0], VehicleClass::Car),
        boxed([900.0, 700.0, 1000.0, 600.0], VehicleClass::Bus),
        boxed([1930.0, 600.0, 2400.0, 700.0], VehicleClass::Van),
        boxed([900.0, 1100.0, 1000.0, 1400.0], VehicleClass::Truck),
        boxed([900.0, 300.0, 1000.0, 400.0], VehicleClass::Car),
        boxed([900.0, 500.0, 1000.0, 540.0], VehicleClass::Car),
    ];
    let (got, _) = received::<64>(&messages(&boxes, NativeMedium::CanFd)).unwrap();
    // level, so that the horizon is in the middle row
    let calibration = Calibration {
        intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1600.0; 2], center_px: [960.0, 540.0] },
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 },
    };
    let parameters = Camera3dParameters::<200, 60>::new(&calibration.normalised(), &Camera3dConfig::default()).unwrap();
    let (mut camera, mut map) = (Box::new(CameraProfile::new()), parameters.map());
    let report = camera.process(&parameters, at(5), &got, false, &mut map);
    let count = |reason| report.rejections.count(reason);
    assert_eq!(
        (report.used, count(BoxRejection::Inverted), count(BoxRejection::Outside), count(BoxRejection::AboveHorizon)),
        (1, 2, 2, 2)
    );
}

#[test]
fn a_normalised_camera_sees_shares_of_a_picture_as_the_camera_itself_sees_pixels() {
    let calibration = Calibration {
        intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1600.0, 1590.0], center_px: [970.0, 530.0] },
        mount: Mount { x_m: 3.0, y_m: 1.0, height_m: 6.0, yaw_deg: 5.0, pitch_deg: 6.0, roll_deg: -1.0 },
    };
    let config = Camera3dConfig::default();
    let own = Camera3dParameters::<200, 60>::new(&calibration, &config).unwrap();
    let normal = Camera3dParameters::<200, 60>::new(&calibration.normalised(), &config).unwrap();
    for edges in [[900.0, 600.0, 1000.0, 700.0], [300.0, 500.0, 380.0, 560.0], [1500.0, 420.0, 1560.0, 460.0]] {
        let place = |p: &Camera3dParameters<200, 60>, b: ImageBox| {
            let mut place = None;
            p.lift(&[b], |lifted| place = Some(lifted.footprint.centre));
            place.unwrap()
        };
        let (a, b) = (
            place(&own, ImageBox::from_pixels(edges, VehicleClass::Car).unwrap()),
            place(&normal, boxed(edges, VehicleClass::Car)),
        );
        let far = (a.x_cm / 100).pow(2) / 600 + 10;
        assert!((a.x_cm - b.x_cm).abs() <= far && (a.y_cm - b.y_cm).abs() <= 30, "{a:?} {b:?}");
    }
}

fn any_box() -> impl Strategy<Value = ImageBox> {
    let classes = [VehicleClass::Car, VehicleClass::Van, VehicleClass::Truck, VehicleClass::Pedestrian];
    (prop::array::uniform4(-3839.0_f32..3839.0), prop::sample::select(classes.to_vec()))
        .prop_map(|(edges, class)| ImageBox::of_picture(edges, [1920, 1920], class).unwrap())
}

proptest! {
    #[test]
    fn boxes_come_back_over_any_line_whatever_the_chunks(
        boxes in prop::collection::vec(any_box(), 0..70),
        chunk in prop::sample::select(&[1_usize, 11, 17, 4096][..]),
    ) {
        prop_assert_eq!(received::<70>(&messages(&boxes, NativeMedium::CanFd)), Some((boxes.clone(), 0)));
        let mut line = vec![1, 2, 3, 0, 0];
        for message in messages(&boxes, NativeMedium::Serial) {
            let mut stuffed = [0; 300];
            let n = message.stuff(&mut stuffed).unwrap();
            line.extend(&stuffed[..n]);
        }
        let mut receiver = NativeSerialReceiver::<70, ImageBox>::boxes(NativeConfig::camera(CAMERA));
        let mut got = Vec::new();
        for mut bytes in line.chunks(chunk) {
            while !bytes.is_empty() {
                let (taken, outcome) = receiver.push(bytes, at(0));
                bytes = &bytes[taken..];
                if let NativeOutcome::Scan(s) = outcome {
                    got.push(s.detections.to_vec());
                }
            }
        }
        prop_assert_eq!(got, [boxes]);
    }
}
