//! The native format: any bytes on a serial line, and scans that come back as they were sent.

use viewshed::camera::boxes::{BoxRejection, ImageBox};
use viewshed::camera::calibration::{Calibration, Intrinsics};
use viewshed::camera::{Camera3d, Camera3dConfig, Camera3dParameters};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::native::{
    NativeConfig, NativeMedium, NativeOutcome, NativeReceiver, NativeSender, NativeSerialReceiver, id,
};
use viewshed::sensor::mount::Mount;
use viewshed::wire::e2e::Profile;

/// A detection of ten bytes, by a layout of this file's own.
fn detection(b: &[u8]) -> Detection {
    let two = |i: usize| i16::from_be_bytes([b[i], b[i + 1]]);
    Detection {
        range_cm: (two(0) as u16).max(1),
        azimuth: Angle::from_raw(two(2)),
        elevation: (b[8] & 1 == 1).then(|| Angle::from_raw(two(4) >> 1)),
        radial_velocity_cm_s: two(6),
        rcs_half_dbsm: (b[8] & 2 == 2).then(|| i16::from(b[9] as i8).max(-127)),
        snr_half_db: (b[8] & 4 == 4).then(|| i16::from(b[9]).min(254)),
        marked: false,
    }
}

/// One input.
pub fn run(bytes: &[u8]) {
    // anything on the line
    let mut line = NativeSerialReceiver::<16>::new(NativeConfig::sensor(1));
    let mut rest = bytes;
    while !rest.is_empty() {
        let (taken, _) = line.push(rest, Time::from_micros(1));
        assert!(taken > 0);
        rest = &rest[taken..];
        while line.poll(Time::from_micros(1)).is_some() {}
    }
    // anything that passes the check sum: of every 32 bytes, 28 are content
    let mut receiver = NativeReceiver::<16>::new(NativeConfig::sensor(1));
    for (i, message) in bytes.chunks_exact(34).enumerate() {
        let mut message = message.to_vec();
        // version, sensor, and scan numbers and parts near each other, so that much fits
        (message[3], message[4]) = (0x10 | message[3] & 3, 1);
        (message[5], message[6], message[7]) = (message[5] & 3, message[6] & 3, message[7] & 3);
        message[8..14].fill(0);
        Profile::P05.protect(&mut message, 0x4001, i as u8);
        let see = |outcome: NativeOutcome<'_>| {
            if let NativeOutcome::Scan(scan) = outcome {
                assert!(scan.detections.len() <= 16 && scan.detections.iter().all(|d| d.range_cm > 0));
            }
        };
        let now = Time::from_micros(1000 * u64::from(message[14]));
        see(receiver.push(&message, now));
        let mut polled = 0;
        while let Some(outcome) = receiver.poll(now) {
            see(outcome);
            polled += 1;
            assert!(polled <= 2);
        }
    }
    pictures(bytes);
    // there and back
    let sent: Vec<Detection> = bytes.chunks_exact(10).take(300).map(detection).collect();
    for medium in [NativeMedium::CanFd, NativeMedium::Serial] {
        let mut sender = NativeSender::new(1);
        let mut receiver = NativeReceiver::<300>::new(NativeConfig::sensor(1));
        let mut got = None;
        for message in sender.scan(Time::from_micros(77), false, &sent, medium) {
            let outcome = match medium {
                NativeMedium::CanFd => receiver.push_frame(&message.frame(id(1)).unwrap(), Time::from_micros(0)),
                NativeMedium::Serial => receiver.push(message.bytes(), Time::from_micros(0)),
            };
            if let NativeOutcome::Scan(scan) = outcome {
                got = Some((scan.time.micros(), scan.detections.to_vec()));
            }
        }
        assert_eq!(got, Some((77, sent.clone())));
    }
}

/// Any bytes as boxes of a camera, through to a map.
fn pictures(bytes: &[u8]) {
    let calibration = Calibration {
        intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1600.0; 2], center_px: [960.0, 540.0] },
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 6.0, roll_deg: 0.0 },
    };
    let parameters = Camera3dParameters::<40, 12>::new(&calibration.normalised(), &Camera3dConfig::default()).unwrap();
    let (mut camera, mut map) = (Camera3d::<40, 12>::new(), parameters.map());
    let mut receiver = NativeReceiver::<64, ImageBox>::boxes(NativeConfig::camera(1));
    for (i, records) in bytes.chunks(220).enumerate() {
        let mut message = vec![0, 0, 0, 0x12, 1, i as u8, 0, 1, i as u8, 0, 0, 0, 0, 0];
        message.extend(records);
        Profile::P05.protect(&mut message, 0x4101, i as u8);
        if let NativeOutcome::Scan(scan) = receiver.push(&message, Time::from_micros(0)) {
            let classes = records.chunks_exact(10).filter(|r| r[8] != 0);
            assert_eq!(classes.count(), scan.detections.len() + usize::from(scan.refused));
            let report = camera.process(&parameters, scan.time, scan.detections, scan.status(), &mut map);
            let rejected: u32 = BoxRejection::ALL.iter().map(|r| report.rejections.count(*r)).sum();
            let all = scan.detections.len() + usize::from(scan.refused);
            assert_eq!(usize::from(report.used) + rejected as usize, all);
        }
    }
}
