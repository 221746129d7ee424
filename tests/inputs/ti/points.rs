//! Every kind of point: bytes to units, axes and signs.

use viewshed::frame::detection::Detection;
use viewshed::inputs::ti::{Entries, Flaw, PolarPoints, Ti, TiAngleUnit, TiConfig, TiDialect, TiFamily};

use super::frames::{Frame, floats, shorts};
use super::{Got, feed, radar};

/// The detections of a frame.
fn detections(dialect: TiDialect, frame: &Frame) -> Vec<Detection> {
    let mut radar = Ti::<64>::new(TiConfig { family: Some(frame.family), dialect });
    match &feed(&mut radar, &frame.bytes(), 1000)[..] {
        [Got::Scan(_, detections, 0)] => detections.clone(),
        other => panic!("{other:?}"),
    }
}

fn usual(frame: &Frame) -> Vec<Detection> {
    detections(TiDialect::USUAL, frame)
}

fn degrees(angle: viewshed::fixed::angle::Angle) -> f32 {
    angle.radians().to_degrees()
}

#[test]
fn a_frame_of_sdk_3_byte_by_byte() {
    let bytes = [
        0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08, 0x07, // magic word
        0x04, 0x00, 0x05, 0x03, // version 3.5.0.4
        0x60, 0x00, 0x00, 0x00, // 96 bytes
        0x43, 0x68, 0x0A, 0x00, // xWR6843
        0x2A, 0x00, 0x00, 0x00, // frame 42
        0x40, 0xE2, 0x01, 0x00, // cycles
        0x01, 0x00, 0x00, 0x00, // one point
        0x02, 0x00, 0x00, 0x00, // two items
        0x00, 0x00, 0x00, 0x00, // sub-frame 0
        0x01, 0x00, 0x00, 0x00, 0x10, 0x00, 0x00, 0x00, // points, 16 bytes
        0x00, 0x00, 0x40, 0x40, // x = 3 m to the right
        0x00, 0x00, 0x80, 0x40, // y = 4 m ahead
        0x00, 0x00, 0x00, 0x3F, // z = 0.5 m up
        0x00, 0x00, 0x20, 0xC0, // -2.5 m/s: coming nearer
        0x07, 0x00, 0x00, 0x00, 0x04, 0x00, 0x00, 0x00, // side info, 4 bytes
        0xC8, 0x00, 0x90, 0x01, // 20 dB above noise of 40 dB
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // to a multiple of 32
        0, 0, 0, 0, 0, 0, 0, 0,
    ];
    let Got::Scan(42, detections, 0) = &feed(&mut radar(TiFamily::Bytes40), &bytes, 7)[0] else { panic!() };
    let [d] = detections[..] else { panic!() };
    assert_eq!(d.range_cm, 502, "of 3, 4 and 0.5");
    assert!((degrees(d.azimuth) + 36.87).abs() < 0.01, "to the right is negative");
    assert!((degrees(d.elevation.unwrap()) - 5.71).abs() < 0.01);
    assert_eq!((d.radial_velocity_cm_s, d.snr_half_db, d.rcs_half_dbsm), (-250, Some(40), None));
}

#[test]
fn left_and_receding_are_positive() {
    let d = usual(&Frame::new(TiFamily::Bytes40, 1).cartesian(&[[-10.0, 10.0, -1.0, 3.0]]))[0];
    assert!((degrees(d.azimuth) - 45.0).abs() < 0.01);
    assert!(d.elevation.unwrap().raw() < 0);
    assert_eq!(d.radial_velocity_cm_s, 300);
}

#[test]
fn an_antenna_without_elevation_measures_none() {
    let frame = Frame::new(TiFamily::Bytes40, 1).cartesian(&[[0.0, 10.0, 0.0, 0.0]]);
    assert_eq!(detections(TiDialect { has_elevation: false, ..TiDialect::USUAL }, &frame)[0].elevation, None);
    assert!(usual(&frame)[0].elevation.is_some());
}

#[test]
fn spherical_points_are_in_radians_or_degrees() {
    let rad = Frame::new(TiFamily::Bytes40, 1).item(1000, 1, floats(&[[50.0, 0.2, 0.05, 7.0]]));
    let deg = Frame::new(TiFamily::Bytes40, 1).item(1000, 1, floats(&[[50.0, 11.459, 2.865, 7.0]]));
    let d = usual(&rad)[0];
    assert_eq!((d.range_cm, d.radial_velocity_cm_s), (5000, 700));
    assert!((d.azimuth.radians() + 0.2).abs() < 1e-4, "azimuth to the right is negative");
    assert!((d.elevation.unwrap().radians() - 0.05).abs() < 1e-4);
    let same = detections(TiDialect { angles: TiAngleUnit::Degrees, ..TiDialect::USUAL }, &deg)[0];
    assert!((same.azimuth.raw() - d.azimuth.raw()).abs() <= 1);
}

#[test]
fn compressed_points_have_units_of_their_own() {
    // elevation and azimuth 0.01 rad, velocity 0.1 m/s, range 0.05 m, ratio 0.5
    let units = floats(&[[0.01, 0.01, 0.1, 0.05, 0.5]]);
    // elevation -5, azimuth 30, velocity -120, range 1000, ratio 200
    let point = [vec![0xFB, 30], shorts(&[-120, 1000, 200])].concat();
    let frame = Frame::new(TiFamily::Bytes40, 1).item(1020, 1, [units, point].concat());
    let d = usual(&frame)[0];
    assert_eq!((d.range_cm, d.radial_velocity_cm_s), (5000, -1200));
    assert!((d.azimuth.radians() + 0.3).abs() < 1e-4);
    assert!((d.elevation.unwrap().radians() + 0.05).abs() < 1e-4);
    assert_eq!(d.snr_half_db, Some(40), "a ratio of 100 is 20 dB");
}

#[test]
fn polar_points_come_behind_52_bytes() {
    let flat = Frame::new(TiFamily::Bytes52, 1).item(6, 1, floats(&[[30.0, -0.1, 4.0, 1000.0]]));
    let d = usual(&flat)[0];
    assert_eq!((d.range_cm, d.radial_velocity_cm_s, d.elevation, d.snr_half_db), (3000, 400, None, Some(60)));
    assert!((d.azimuth.radians() - 0.1).abs() < 1e-4);
    let raised = Frame::new(TiFamily::Bytes52, 1).item(6, 1, floats(&[[30.0, -0.1, 0.02, 4.0, 1000.0]]));
    let d = detections(TiDialect { polar_points: PolarPoints::Raised, ..TiDialect::USUAL }, &raised)[0];
    assert!((d.elevation.unwrap().radians() - 0.02).abs() < 1e-4);
    assert_eq!((d.radial_velocity_cm_s, d.snr_half_db), (400, Some(60)));
}

#[test]
fn behind_52_bytes_an_item_of_type_7_is_no_side_info() {
    let points = floats(&[[30.0, -0.1, 4.0, 1000.0]]);
    let frame = Frame::new(TiFamily::Bytes52, 1).item(6, 1, points).item(7, 0, vec![0xFF; 68]);
    assert_eq!(usual(&frame)[0].snr_half_db, Some(60));
}

#[test]
fn a_frame_behind_48_bytes_byte_by_byte() {
    let bytes = [
        0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08, 0x07, // magic word
        0x04, 0x00, 0x05, 0x03, // version 3.5.0.4
        0x60, 0x00, 0x00, 0x00, // 96 bytes
        0x43, 0x68, 0x0A, 0x00, // xWR6843
        0x07, 0x00, 0x00, 0x00, // frame 7
        0x00, 0x00, 0x00, 0x00, // sub-frame 0
        0x10, 0x27, 0x00, 0x00, 0x20, 0x4E, 0x00, 0x00, // margins
        0x64, 0x00, 0x00, 0x00, 0xC8, 0x00, 0x00, 0x00, // times
        0x01, 0x00, 0x34, 0x12, // one item; check sum
        0x06, 0x00, 0x00, 0x00, 0x24, 0x00, 0x00, 0x00, // points, 36 bytes with these 8
        0x0A, 0xD7, 0x23, 0x3C, 0x0A, 0xD7, 0x23, 0x3C, // elevation and azimuth in 0.01 rad
        0xCD, 0xCC, 0xCC, 0x3D, // velocity in 0.1 m/s
        0x0A, 0xD7, 0x23, 0x3C, // range in 0.01 m
        0x0A, 0xD7, 0x23, 0x3D, // ratio in 0.04
        0x05, 0xEC, // 0.05 rad up, 0.2 rad to the left
        0xF6, 0xFF, // -1 m/s
        0xF4, 0x01, // 5 m
        0xC4, 0x09, // 100: 20 dB
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ];
    let Got::Scan(7, detections, 0) = &feed(&mut radar(TiFamily::Bytes48), &bytes, 7)[0] else { panic!() };
    let [d] = detections[..] else { panic!() };
    assert_eq!((d.range_cm, d.radial_velocity_cm_s, d.snr_half_db), (500, -100, Some(40)));
    assert!((d.azimuth.radians() - 0.2).abs() < 1e-4 && (d.elevation.unwrap().radians() - 0.05).abs() < 1e-4);
}

/// Units of an item of type 301, what it says of its points, and points: x, y, z, velocity, then ratio and noise.
fn extended(announced: [i16; 2], points: &[([i16; 4], [u8; 2])]) -> Vec<u8> {
    let units = floats(&[[0.01, 0.02, 0.25, 1.0]]);
    let points = points.iter().flat_map(|(four, two)| [shorts(four), two.to_vec()].concat());
    [units, shorts(&announced), points.collect()].concat()
}

#[test]
fn extended_points_have_units_of_their_own_too() {
    // 3 m to the right, 4 m ahead, 0.5 m up, -2.5 m/s, 20 dB; and one 10 m to the left whose ratio needs 8 bits
    let points = [([300, 400, 50, -125], [80, 9]), ([-1000, 1000, -100, 150], [200, 9])];
    let frame = Frame::new(TiFamily::Bytes40, 1).item(301, 2, extended([1, 1], &points)).item(306, 0, vec![0; 24]);
    let d = usual(&frame);
    assert_eq!((d[0].range_cm, d[0].radial_velocity_cm_s, d[0].snr_half_db), (502, -250, Some(40)));
    assert!((degrees(d[0].azimuth) + 36.87).abs() < 0.01 && (degrees(d[0].elevation.unwrap()) - 5.71).abs() < 0.01);
    assert_eq!((d[1].radial_velocity_cm_s, d[1].snr_half_db), (300, Some(100)));
    assert!((degrees(d[1].azimuth) - 45.0).abs() < 0.01 && d[1].elevation.unwrap().raw() < 0);
    // a firmware that does not say how many
    let silent = Frame::new(TiFamily::Bytes40, 1).item(301, 2, extended([0, 0], &points));
    assert_eq!(usual(&silent), d);
    // and one whose points are of another size
    let other = Frame::new(TiFamily::Bytes40, 1).item(301, 2, extended([2, 1], &points));
    assert_eq!(feed(&mut radar(TiFamily::Bytes40), &other.bytes(), 99), [Got::Broken(Flaw::Records)]);
}

/// Targets: number, place and velocity, then what is of no interest; so many bytes each.
fn targets<const N: usize>(rows: &[[f32; N]], bytes: usize) -> Vec<u8> {
    let one = |row: &[f32; N]| {
        let mut bytes_of = [vec![3, 0, 0, 0], floats(&[*row])].concat();
        bytes_of.resize(bytes, 0x7F);
        bytes_of
    };
    rows.iter().flat_map(one).collect()
}

#[test]
fn targets_are_left_out_or_stand_in_place_of_the_points() {
    // 3 m to the right and 4 m ahead, coming nearer with 5 m/s; 6 m to the left and 8 m ahead, across
    let [near, across] = [[3.0, 4.0, 0.0, -3.0, -4.0, 0.0], [-6.0, 8.0, 1.0, 4.0, 3.0, 0.0]];
    let instead = TiDialect { entries: Entries::Targets, ..TiDialect::USUAL };
    let solid = targets(&[near, across], 112);
    let flat = targets(&[[3.0, 4.0, -3.0, -4.0], [-6.0, 8.0, 4.0, 3.0]], 68);
    let point = [[0.0, 20.0, 0.0, 1.0]];
    let polar = floats(&[[20.0, 0.0, 1.0, 100.0]]);
    let compressed = [floats(&[[0.01, 0.01, 0.1, 0.01, 1.0]]), shorts(&[0, 10, 2000, 9])].concat();
    let frames = [
        (
            Frame::new(TiFamily::Bytes40, 1).cartesian(&point).item(7, 0, shorts(&[9, 0])).item(1010, 0, solid.clone()),
            true,
        ),
        (Frame::new(TiFamily::Bytes40, 1).cartesian(&point).item(308, 0, solid.clone()).item(309, 0, vec![0]), true),
        (Frame::new(TiFamily::Bytes48, 1).item(6, 1, compressed).item(7, 0, solid), true),
        (Frame::new(TiFamily::Bytes52, 1).item(6, 1, polar).item(7, 0, flat), false),
    ];
    for (frame, raised) in frames {
        let points: Vec<_> = usual(&frame).iter().map(|d| d.range_cm).collect();
        assert_eq!(points, [2000], "points only: {frame:?}");
        let [near, across] = detections(instead, &frame)[..] else { panic!("{frame:?}") };
        assert_eq!((near.range_cm, near.radial_velocity_cm_s, near.snr_half_db), (500, -500, None));
        assert!((degrees(near.azimuth) + 36.87).abs() < 0.01 && (degrees(across.azimuth) - 36.87).abs() < 0.01);
        assert_eq!((across.radial_velocity_cm_s, across.range_cm), (0, if raised { 1005 } else { 1000 }));
        assert_eq!(across.elevation.is_some_and(|e| e.raw() > 0), raised);
    }
    // a frame without targets is an empty scan, whatever points it announces
    assert!(detections(instead, &Frame::new(TiFamily::Bytes40, 1).cartesian(&point)).is_empty());
    let at_the_sensor = Frame::new(TiFamily::Bytes40, 1).item(1010, 0, targets(&[[0.0; 6]], 112));
    assert!(detections(instead, &at_the_sensor).is_empty());
    let cut = Frame::new(TiFamily::Bytes40, 1).item(1010, 0, vec![0; 111]);
    let mut radar = Ti::<4>::new(TiConfig { family: Some(TiFamily::Bytes40), dialect: instead });
    assert_eq!(feed(&mut radar, &cut.bytes(), 99), [Got::Broken(Flaw::Records)]);
}

#[test]
fn points_of_sdk_1_are_indices_and_fixed_point() {
    // two points, 8 binary places; range index, Doppler index, peak, x, y, z
    let payload = shorts(&[2, 8, 55, -4, 900, 256, 5120, 0, 60, 3, 800, -512, 2560, 128]);
    let mut frame = Frame::new(TiFamily::Bytes36, 1).item(1, 2, payload);
    let dialect = TiDialect { doppler_step_mps: Some(0.5), ..TiDialect::USUAL };
    let d = detections(dialect, &frame);
    assert_eq!(d.iter().map(|d| d.radial_velocity_cm_s).collect::<Vec<_>>(), [-200, 150]);
    // x = 1 m to the right, y = 20 m; x = 2 m to the left, y = 10 m, z = 0.5 m
    assert_eq!(d.iter().map(|d| d.range_cm).collect::<Vec<_>>(), [2002, 1021]);
    assert!(d[0].azimuth.raw() < 0 && d[1].azimuth.raw() > 0);
    // the same after 40 bytes, by the version
    (frame.family, frame.version) = (TiFamily::Bytes40, 0x0200_0004);
    assert_eq!(detections(dialect, &frame), d);
    // and without a Doppler step there is no velocity, so no detection
    assert!(usual(&frame).is_empty());
}

#[test]
fn side_info_finds_its_points_past_those_that_are_none() {
    let points = [[0.0, 10.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 30.0, 0.0, 0.0]];
    let frame =
        Frame::new(TiFamily::Bytes40, 1).cartesian(&points).item(7, 0, shorts(&[101, 0, 202, 0, 303, 0, -104, 0]));
    let mut radar = radar(TiFamily::Bytes40);
    let got = feed(&mut radar, &frame.bytes(), 1000);
    let [Got::Scan(_, detections, 0)] = &got[..] else { panic!("{got:?}") };
    let kept: Vec<_> = detections.iter().map(|d| (d.range_cm, d.snr_half_db)).collect();
    assert_eq!(kept, [(1000, Some(20)), (3000, Some(-21))], "10.1 and -10.4 dB");
    assert_eq!(radar.counters().no_point, 2);
}

#[test]
fn extreme_ratios_are_no_trouble() {
    let points = [[0.0, 10.0, 0.0, 0.0], [0.0, 10.0, 0.0, 0.0]];
    let frame = Frame::new(TiFamily::Bytes40, 1).cartesian(&points).item(7, 0, shorts(&[i16::MAX, 0, i16::MIN, 0]));
    let ratios: Vec<_> = usual(&frame).iter().map(|d| d.snr_half_db.unwrap()).collect();
    assert_eq!(ratios, [6553, -6554]);
}

#[test]
fn a_full_list_keeps_the_first_or_the_strongest() {
    let mut radar = Ti::<2>::new(TiConfig { family: Some(TiFamily::Bytes40), dialect: TiDialect::USUAL });
    let points: Vec<[f32; 4]> = (1..=4).map(|i| [0.0, 10.0 * i as f32, 0.0, 0.0]).collect();
    let frame = Frame::new(TiFamily::Bytes40, 1).cartesian(&points).item(7, 0, shorts(&[10, 0, 20, 0, 30, 0, 40, 0]));
    let got = feed(&mut radar, &frame.bytes(), 1000);
    let [Got::Scan(_, d, 0)] = &got[..] else { panic!("{got:?}") };
    assert_eq!(d.iter().map(|d| (d.range_cm, d.snr_half_db)).collect::<Vec<_>>(), [(1000, Some(2)), (2000, Some(4))]);
    assert_eq!(radar.counters().overflow, 2);
    let units = floats(&[[0.01, 0.01, 0.1, 0.05, 1.0]]);
    let points: Vec<u8> = [[400, 10], [800, 1000], [1200, 100]]
        .iter()
        .flat_map(|p| [vec![0, 0], shorts(&[0, p[0], p[1]])].concat())
        .collect();
    let frame = Frame::new(TiFamily::Bytes40, 2).item(1020, 3, [units, points].concat());
    let got = feed(&mut radar, &frame.bytes(), 1000);
    let [Got::Scan(_, d, 0)] = &got[..] else { panic!("{got:?}") };
    assert_eq!(d.iter().map(|d| d.snr_half_db.unwrap()).collect::<Vec<_>>(), [60, 40]);
}
