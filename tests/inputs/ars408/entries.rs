//! Single entries: bytes to units, signs and scales.

use viewshed::fixed::angle::Angle;
use viewshed::frame::detection::Detection;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome};

use super::{at, frame, radar};

/// The detections of a scan with one entry.
fn single(radar: &mut Ars408<64>, status: &str, general: &str) -> Vec<Detection> {
    assert_eq!(radar.push(&frame(status), at(0)), Ars408Outcome::Taken);
    match radar.push(&frame(general), at(1)) {
        Ars408Outcome::Scan(scan) => {
            assert_eq!((scan.time, scan.received), (at(0), at(0)));
            scan.detections.to_vec()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_cluster_ahead_to_the_right_and_coming_nearer() {
    // number 7: 50.0 m ahead, 10.1 m to the right, 20 m/s nearer, oncoming, 10 dBsm
    let detections = single(&mut radar(), "600#0100123410", "701#0755F1CD6C200294");
    let [d] = detections[..] else { panic!("{detections:?}") };
    assert_eq!(d.range_cm, 5101);
    // atan(-10.1 / 50) = -0.19932 rad
    assert!((d.azimuth.radians() + 0.199_32).abs() < 4e-4, "{}", d.azimuth.radians());
    assert_eq!(d.radial_velocity_cm_s, -1960, "20 m/s, less what is across the line of sight");
    assert_eq!((d.rcs_half_dbsm, d.snr_half_db, d.elevation), (Some(20), None, None));
}

#[test]
fn an_object_ahead_to_the_left_moving_away() {
    // 100.0 m ahead, 20.0 m to the left, 10 m/s away and 2 m/s to the left, -5.5 dBsm
    // raw: 3000, 1123, 552, 264, 117
    let detections = single(&mut radar(), "60A#01123410", "60B#035DC4638A210075");
    let [d] = detections[..] else { panic!("{detections:?}") };
    assert_eq!(d.range_cm, 10_198);
    assert!((d.azimuth.radians() - 0.197_40).abs() < 4e-4);
    // (10 * 100 + 2 * 20) / 101.98
    assert_eq!(d.radial_velocity_cm_s, 1020);
    assert_eq!(d.rcs_half_dbsm, Some(-11));
}

#[test]
fn the_limits_of_every_field_are_those_of_the_description() {
    // all zero: -500 m, -102.3 m
    let [d] = single(&mut radar(), "600#0100000010", "701#0000000000000000")[..] else { panic!() };
    assert_eq!((d.range_cm, d.rcs_half_dbsm), (51_036, Some(-128)));
    assert!((d.azimuth.radians() + 2.939_8).abs() < 4e-4, "behind, to the right");
    // (500 * 128 + 102.3 * 64) / 510.36
    assert_eq!(d.radial_velocity_cm_s, 13_823);
    // all ones: 1138.2 m is beyond what a detection holds
    let mut radar = radar();
    assert_eq!(single(&mut radar, "600#0100000210", "701#00FFFFFFFFFFE0FF").len(), 0);
    assert_eq!(radar.counters().no_range, 1);
    // 0.0 m ahead, 102.1 m to the left: 2500 = 0x9C4, 1022 = 0x3FE
    let [d] = single(&mut radar, "600#0100000410", "701#004E23FE80200080")[..] else { panic!() };
    assert_eq!(d.range_cm, 10_210);
    assert!(((d.azimuth - Angle::QUARTER).raw()).abs() <= 2);
}

/// As an ARS408-21 in cluster mode sent them: a published log of a PIX vehicle.
#[test]
fn a_real_scan_of_clusters() {
    let mut radar = Ars408::<128>::new(Ars408Config::sensor(0));
    assert_eq!(radar.push(&frame("600#5024581110"), at(0)), Ars408Outcome::Taken);
    // 80 near and 36 far; here all are the first
    let cluster = |n: u8| frame(&format!("701#{n:02X}4E81FC80200147"));
    assert!((0..115).all(|n| radar.push(&cluster(n), at(1)) == Ars408Outcome::Taken));
    let Ars408Outcome::Scan(scan) = radar.push(&cluster(115), at(2)) else { panic!("115 are not all") };
    assert_eq!((scan.number, scan.missing, scan.detections.len()), (0x5811, 0, 116));
    // 2.4 m ahead and 0.7 m to the right, at rest, -28.5 dBsm
    let d = scan.detections[0];
    assert_eq!((d.range_cm, d.radial_velocity_cm_s, d.rcs_half_dbsm), (250, 0, Some(-57)));
    assert!((d.azimuth.radians() + 0.283_79).abs() < 4e-4, "{}", d.azimuth.radians());
}

#[test]
fn near_and_far_clusters_are_added() {
    let mut radar = radar();
    let frames = ["600#0102000010", "701#014E23FE80200080", "701#0255F1CD6C200294"];
    assert!(frames.iter().all(|f| radar.push(&frame(f), at(0)) == Ars408Outcome::Taken));
    let Ars408Outcome::Scan(scan) = radar.push(&frame("701#0355F1CD6C200294"), at(1)) else { panic!() };
    assert_eq!((scan.detections.len(), scan.missing), (3, 0));
}

#[test]
fn a_clone_has_scales_and_a_height_of_its_own() {
    let mut radar = Ars408::<64>::new(Ars408Config { profile: Ars408Profile::SR75, ..Ars408Config::sensor(0) });
    // 40.0 m ahead, 30.0 m to the left, 12.0 m up, 5 m/s away: 2800, 1600, 304, 420
    let detections = single(&mut radar, "600#0001000010", "701#0157864069260094");
    let [d] = detections[..] else { panic!("{detections:?}") };
    assert_eq!((d.range_cm, d.radial_velocity_cm_s), (5142, 500));
    assert!((d.azimuth.radians() - 0.643_5).abs() < 4e-4);
    assert!((d.elevation.unwrap().radians() - 0.235_54).abs() < 4e-4);
    // its count has 16 bits: 0x0102 are 258, not 3
    let mut frames = vec!["600#0102000110".to_owned()];
    frames.extend((0..258).map(|n| format!("701#{:02X}57864069260094", n % 256)));
    let outcomes: Vec<bool> =
        frames.iter().map(|f| matches!(radar.push(&frame(f), at(70)), Ars408Outcome::Scan(_))).collect();
    assert_eq!(outcomes.iter().position(|complete| *complete), Some(258));
    assert_eq!(radar.counters().overflow, 258 - 64, "this one has room for 64");
}

#[test]
fn the_radars_own_marks_sort_out() {
    let mut radar = radar();
    let general = |n: u8| format!("701#{n:02X}55F1CD6C200294");
    // invalid state in the upper five bits of byte 4, ambiguity in the lower three
    let quality = |n: u8, marks: u8| format!("702#{n:02X}000000{marks:02X}");
    let mut frames = vec!["600#0400000010".to_owned()];
    frames.extend((1..=4).map(general));
    // before the first quality message scans do not wait
    for f in &frames[..4] {
        assert_eq!(radar.push(&frame(f), at(0)), Ars408Outcome::Taken);
    }
    assert!(matches!(radar.push(&frame(&frames[4]), at(0)), Ars408Outcome::Scan(s) if s.detections.len() == 4));
    assert_eq!(radar.push(&frame(&quality(1, 0x03)), at(1)), Ars408Outcome::Taken);
    // from then on they do
    frames[0] = "600#0400000210".into();
    frames.extend([quality(1, 0x03), quality(2, 0x04), quality(3, 0x01)]);
    for f in &frames {
        assert_eq!(radar.push(&frame(f), at(70)), Ars408Outcome::Taken, "{f}");
    }
    let Ars408Outcome::Scan(scan) = radar.push(&frame(&quality(4, 0x0B)), at(71)) else { panic!() };
    assert_eq!(scan.detections.len(), 2, "the ambiguous and the invalid one are gone");
    assert_eq!((scan.unwanted().len(), scan.missing, scan.refused), (2, 0, 0), "they arrived");
    assert!(scan.unwanted().iter().all(|d| d.marked) && scan.frame().input.len() == 4, "estimators are told where");
    assert_eq!((radar.counters().unwanted, radar.counters().incomplete), (2, 0));
    let all = Ars408Config { wanted: Ars408Wanted::ALL, ..Ars408Config::sensor(0) };
    assert_eq!(Ars408::<64>::new(all).config().wanted, Ars408Wanted::ALL);
}
