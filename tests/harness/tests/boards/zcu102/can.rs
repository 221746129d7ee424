//! The CAN bus: an ARS408's clusters in, every map out, frame by frame the same.

use std::time::Duration;

use viewshed::detection::Detection;
use viewshed::settings::Settings;
use viewshed::time::Time;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::Addresses;
use viewshed::wire::receive::{Limits, Receiver};
use viewshed::wire::status::State;
use viewshed_harness::boards::can::{CanBoard, answer, time_frame};
use viewshed_harness::boards::{Board, Profile, firmware};

use crate::shipped;

/// A scan as an ARS408 in cluster mode sends it.
fn clusters(counter: u16, detections: &[Detection]) -> Vec<CanFrame> {
    let far = detections.len().saturating_sub(125) as u8;
    let near = detections.len() as u8 - far;
    let [high, low] = counter.to_be_bytes();
    let frame = |id, bytes: &[u8]| CanFrame::classic(CanId::Standard(id), bytes).unwrap();
    let mut frames = vec![frame(0x600, &[near, far, high, low, 0x10])];
    for (k, d) in detections.iter().enumerate() {
        let (range, azimuth) = (f64::from(d.range_cm) / 100.0, f64::from(d.azimuth.radians()));
        let raw = |v: f64, step: f64, offset: f64| ((v - offset) / step).round() as u64;
        let speed = f64::from(d.radial_velocity_cm_s) / 100.0;
        let fields = [
            (k as u64, 8),
            (raw(range * azimuth.cos(), 0.2, -500.0), 13),
            (0, 1),
            (raw((range * azimuth.sin()).clamp(-102.0, 102.0), 0.2, -102.3), 10),
            (raw(speed * azimuth.cos(), 0.25, -128.0), 10),
            (raw(speed * azimuth.sin(), 0.25, -64.0), 9),
            (0, 2),
            (0, 3),
            (raw(10.0, 0.5, -64.0), 8),
        ];
        let word = fields.iter().fold(0_u64, |w, (v, bits)| w << bits | v);
        frames.push(frame(0x701, &word.to_be_bytes()));
    }
    frames
}

fn script(count: usize) -> (Settings, Vec<CanFrame>, Vec<Time>) {
    let (mut settings, scans) = shipped(f64::INFINITY);
    settings.radar_bus.listen_first = false;
    let (mut frames, mut times) = (Vec::new(), Vec::new());
    for k in 0..count {
        let scan = &scans[k % scans.len()];
        let time = Time::from_micros(1_000_000 + k as u64 * 66_667);
        times.push(time);
        frames.push(time_frame(time));
        frames.extend(clusters(k as u16, &scan.detections[..scan.detections.len().min(240)]));
    }
    (settings, frames, times)
}

#[test]
#[ignore = "needs QEMU"]
fn every_frame_of_two_hundred_scans_is_the_same_and_a_receiver_has_the_maps() {
    let count = std::env::var("VIEWSHED_CAN_SCANS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    let (settings, frames, times) = script(count);
    assert!(frames.len() > count * 100, "at least a hundred clusters a scan: {}", frames.len());
    let expected = answer(&settings, &frames).unwrap();
    assert!(expected.len() > count * 10, "{}", expected.len());
    println!("{count} scans, {} frames in, {} frames out", frames.len(), expected.len());
    let image = firmware::build(Board::Zcu102R5, Profile::Reference, "live").unwrap();
    let mut board = CanBoard::start(&image, &settings).unwrap();
    board.send(&frames).unwrap();
    board.wait_for(expected.len(), Duration::from_secs(5)).unwrap();
    let first = board.answer.iter().zip(&expected).position(|(a, b)| a != b);
    assert_eq!((first, board.answer.len()), (None, expected.len()));

    let mut receiver = Receiver::<1, 120, 7>::new([0], Addresses::STANDARD, Limits::DEFAULT);
    let per_scan = expected.len() / times.len();
    for (k, frame) in board.answer.iter().enumerate() {
        let now = times[(k / per_scan.max(1)).min(times.len() - 1)];
        let _ = receiver.frame(now, frame);
    }
    assert_eq!(receiver.sensor(0).and_then(|s| s.status()).map(|s| s.state), Some(State::Ok));
    assert!(receiver.sensor(0).unwrap().header().is_some());
}
