//! The native scan format: bytes, round trips, and what is lost or damaged on the way.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::native::{
    MOST_BYTES, NativeConfig, NativeMedium, NativeMessage, NativeOutcome, NativeReceiver, NativeSender,
    NativeSerialReceiver, Refusal, id,
};
use viewshed::wire::e2e::{E2eError, Profile};
use viewshed::wire::frame::{CanFrame, CanId};

const SENSOR: u8 = 7;

fn at(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

fn car() -> Detection {
    Detection {
        range_cm: 5000,
        azimuth: Angle::from_raw(0x0123),
        elevation: Some(Angle::from_raw(-2)),
        radial_velocity_cm_s: -2500,
        rcs_half_dbsm: Some(-20),
        snr_half_db: Some(30),
        marked: false,
    }
}

/// A detection that differs from others in its range.
fn nth(n: usize) -> Detection {
    Detection { range_cm: 100 + n as u16, elevation: None, rcs_half_dbsm: None, snr_half_db: None, ..car() }
}

fn messages(sender: &mut NativeSender, ms: u64, detections: &[Detection], medium: NativeMedium) -> Vec<NativeMessage> {
    sender.scan(at(ms), false, detections, medium).collect()
}

/// Pushes a message and polls; the scans that came out.
fn push<const N: usize>(receiver: &mut NativeReceiver<N>, bytes: &[u8], ms: u64) -> Vec<(u32, Vec<Detection>, u16)> {
    let mut scans = Vec::new();
    let mut keep = |outcome: NativeOutcome<'_>| {
        if let NativeOutcome::Scan(s) = outcome {
            scans.push((s.number, s.detections.to_vec(), s.missing));
        }
    };
    keep(receiver.push(bytes, at(ms)));
    while let Some(outcome) = receiver.poll(at(ms)) {
        keep(outcome);
    }
    scans
}

#[test]
fn a_scan_has_the_bytes_described() {
    let mut sender = NativeSender::new(SENSOR);
    let time = Time::from_micros(0x0605_0403_0201);
    let scan: Vec<NativeMessage> = sender.scan(time, false, &[car()], NativeMedium::Serial).collect();
    let [message] = scan[..] else { panic!() };
    let header = [0x12, SENSOR, 0, 0, 1, 1, 2, 3, 4, 5, 6];
    let record = [0x88, 0x13, 0x23, 0x01, 0xFE, 0xFF, 0x3C, 0xF6, 0xEC, 30];
    assert_eq!(message.bytes()[2], 0, "counter");
    assert_eq!(message.bytes()[3..14], header);
    assert_eq!(message.bytes()[14..], record);
    // CRC-16 of the bytes after it and of the data ID 0x4007
    assert_eq!(message.bytes()[..2], [0xEE, 0x6C]);
    // on the line: zeros become distances
    let mut line = [0; 40];
    let n = message.stuff(&mut line).unwrap();
    let stuffed = [
        0x03, 0xEE, 0x6C, 0x03, 0x12, 0x07, 0x01, 0x12, 0x01, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x88, 0x13, 0x23,
        0x01, 0xFE, 0xFF, 0x3C, 0xF6, 0xEC, 0x1E, 0x00,
    ];
    assert_eq!(line[..n], stuffed);
}

#[test]
fn an_empty_faulty_scan_has_the_bytes_described() {
    let mut sender = NativeSender::new(SENSOR);
    messages(&mut sender, 0, &[], NativeMedium::CanFd);
    let nothing = Detection { elevation: None, rcs_half_dbsm: None, snr_half_db: None, ..car() };
    let [empty] = sender.scan(at(1), true, &[], NativeMedium::CanFd).collect::<Vec<_>>()[..] else { panic!() };
    let frame = empty.frame(id(SENSOR)).unwrap();
    assert_eq!(frame.id, CanId::Standard(0x107));
    // time 1 000 us, padded to 16 bytes
    assert_eq!(frame.data()[2..], [1, 0x11, SENSOR, 1, 0, 1, 0xE8, 3, 0, 0, 0, 0, 0, 0]);
    let [unmeasured] = sender.scan(at(1), false, &[nothing], NativeMedium::CanFd).collect::<Vec<_>>()[..] else {
        panic!()
    };
    assert_eq!(unmeasured.bytes()[14..], [0x88, 0x13, 0x23, 0x01, 0, 0x80, 0x3C, 0xF6, 0x80, 0xFF]);
    let mut receiver = NativeReceiver::<4>::new(NativeConfig::sensor(SENSOR));
    let NativeOutcome::Scan(scan) = receiver.push_frame(&frame, at(5)) else { panic!() };
    assert!(scan.fault && scan.detections.is_empty());
    assert_eq!((scan.time, scan.received, scan.number), (at(1), at(5), 1));
}

#[test]
fn scans_are_cut_into_parts_that_fit() {
    let many: Vec<Detection> = (0..23).map(nth).collect();
    let mut sender = NativeSender::new(SENSOR);
    let lengths = |m: &[NativeMessage]| m.iter().map(|m| m.bytes().len()).collect::<Vec<_>>();
    let fd = messages(&mut sender, 0, &many, NativeMedium::CanFd);
    assert_eq!(lengths(&fd), [64, 64, 64, 64, 48], "44 bytes go into a frame of 48");
    let serial = messages(&mut sender, 0, &many, NativeMedium::Serial);
    assert_eq!(lengths(&serial), [234, 24]);
    assert!(serial[0].frame(id(SENSOR)).is_none() && serial.iter().all(|m| m.bytes().len() <= MOST_BYTES));
    // beyond what 255 parts hold nothing is sent
    let crowd: Vec<Detection> = (0..1300).map(nth).collect();
    assert_eq!(messages(&mut sender, 0, &crowd, NativeMedium::CanFd).len(), 255);
}

#[test]
fn values_beyond_a_records_are_cut_not_wrapped() {
    let mut sender = NativeSender::new(SENSOR);
    let wild = Detection { rcs_half_dbsm: Some(-300), snr_half_db: Some(999), ..car() };
    let message = messages(&mut sender, 0, &[wild], NativeMedium::Serial)[0];
    let mut receiver = NativeReceiver::<4>::new(NativeConfig::sensor(SENSOR));
    let [(_, detections, _)] = &push(&mut receiver, message.bytes(), 0)[..] else { panic!() };
    assert_eq!((detections[0].rcs_half_dbsm, detections[0].snr_half_db), (Some(-127), Some(254)));
}

#[test]
fn other_sensors_versions_and_damage_are_refused_by_reason() {
    let mut sender = NativeSender::new(SENSOR);
    let message = messages(&mut sender, 0, &[car()], NativeMedium::Serial)[0];
    let mut receiver = NativeReceiver::<4>::new(NativeConfig::sensor(SENSOR + 1));
    fn refused(outcome: NativeOutcome<'_>) -> bool {
        outcome == NativeOutcome::Refused(Refusal::Check(E2eError::Check))
    }
    assert!(refused(receiver.push(message.bytes(), at(0))), "another sensor's");
    let mut receiver = NativeReceiver::<4>::new(NativeConfig::sensor(SENSOR));
    let mut bytes = message.bytes().to_vec();
    for flip in 0..8 * bytes.len() {
        bytes[flip / 8] ^= 1 << (flip % 8);
        assert!(refused(receiver.push(&bytes, at(0))), "bit {flip}");
        bytes[flip / 8] ^= 1 << (flip % 8);
    }
    bytes[3] = 0x20;
    Profile::P05.protect(&mut bytes, 0x4007, 1);
    assert_eq!(receiver.push(&bytes, at(0)), NativeOutcome::Refused(Refusal::Version(2)));
    bytes[3] = 0x10;
    bytes[6] = 1;
    Profile::P05.protect(&mut bytes, 0x4007, 2);
    assert_eq!(receiver.push(&bytes, at(0)), NativeOutcome::Refused(Refusal::Inconsistent), "part 1 of 1");
    assert!(matches!(receiver.push(&[1, 2], at(0)), NativeOutcome::Refused(Refusal::Check(E2eError::TooShort { .. }))));
    let other = CanFrame::fd(CanId::Standard(0x101), message.bytes()).unwrap();
    assert_eq!(receiver.push_frame(&other, at(0)), NativeOutcome::NotMine);
    let c = receiver.counters();
    assert_eq!((c.damaged as usize, c.version, c.inconsistent), (8 * bytes.len() + 1, 1, 1));
}

#[test]
fn a_lost_part_costs_itself_and_most_parts_lost_cost_the_scan() {
    let many: Vec<Detection> = (0..13).map(nth).collect();
    let mut sender = NativeSender::new(SENSOR);
    let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
    let first = messages(&mut sender, 0, &many, NativeMedium::CanFd);
    let second = messages(&mut sender, 70, &many, NativeMedium::CanFd);
    let third = messages(&mut sender, 140, &many[..2], NativeMedium::CanFd);
    assert!(push(&mut receiver, first[0].bytes(), 0).is_empty());
    assert!(push(&mut receiver, first[2].bytes(), 1).is_empty());
    // the next scan ends it
    let got = push(&mut receiver, second[1].bytes(), 70);
    let kept: Vec<Detection> = [&many[..5], &many[10..]].concat();
    assert_eq!(got, [(0, kept, 5)]);
    // one of three is not a scan; a message that is a whole scan comes out after it
    let got = push(&mut receiver, third[0].bytes(), 140);
    assert_eq!(got, [(2, many[..2].to_vec(), 0)]);
    let c = receiver.counters();
    assert_eq!((c.scans, c.incomplete, c.broken, c.lost), (2, 1, 1, 3));
}

#[test]
fn a_scan_does_not_wait_for_ever() {
    let many: Vec<Detection> = (0..10).map(nth).collect();
    let mut sender = NativeSender::new(SENSOR);
    let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
    let parts = messages(&mut sender, 0, &many, NativeMedium::CanFd);
    receiver.push(parts[0].bytes(), at(10));
    assert_eq!(receiver.poll(at(110)), None);
    assert!(matches!(receiver.poll(at(111)), Some(NativeOutcome::Scan(s)) if s.missing == 5));
    assert_eq!(receiver.push(parts[1].bytes(), at(112)), NativeOutcome::Refused(Refusal::Late));
    assert_eq!(receiver.counters().late, 1);
}

#[test]
fn parts_may_come_in_any_order_and_twice() {
    let many: Vec<Detection> = (0..10).map(nth).collect();
    let mut sender = NativeSender::new(SENSOR);
    let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
    let parts = messages(&mut sender, 0, &many, NativeMedium::CanFd);
    assert_eq!(receiver.push(parts[1].bytes(), at(0)), NativeOutcome::Taken);
    assert_eq!(receiver.push(parts[1].bytes(), at(0)), NativeOutcome::Refused(Refusal::Repeated));
    let swapped: Vec<Detection> = [&many[5..], &many[..5]].concat();
    assert_eq!(push(&mut receiver, parts[0].bytes(), 1), [(0, swapped, 0)]);
    assert_eq!(receiver.push(parts[0].bytes(), at(2)), NativeOutcome::Refused(Refusal::Late));
}

#[test]
fn a_sender_that_starts_over_is_heard_again() {
    let mut receiver = NativeReceiver::<4>::new(NativeConfig::sensor(SENSOR));
    for run in [40, 5] {
        let mut sender = NativeSender::new(SENSOR);
        let scans: usize = (0..run)
            .map(|i| push(&mut receiver, messages(&mut sender, i, &[], NativeMedium::Serial)[0].bytes(), i).len())
            .sum();
        assert_eq!(scans as u64, run);
    }
    // right after a few scans it takes a few
    let mut sender = NativeSender::new(SENSOR);
    let heard = (0..20).position(|i| {
        !push(&mut receiver, messages(&mut sender, i, &[], NativeMedium::Serial)[0].bytes(), i).is_empty()
    });
    assert_eq!(heard, Some(5));
}

#[test]
fn scans_that_are_not_fetched_are_told() {
    let mut sender = NativeSender::new(SENSOR);
    let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
    let long: Vec<Detection> = (0..10).map(nth).collect();
    receiver.push(messages(&mut sender, 0, &long, NativeMedium::CanFd)[0].bytes(), at(0));
    let next = messages(&mut sender, 1, &[], NativeMedium::CanFd)[0];
    assert!(matches!(receiver.push(next.bytes(), at(1)), NativeOutcome::Scan(s) if s.missing == 5));
    assert_eq!(receiver.push(next.bytes(), at(1)), NativeOutcome::Refused(Refusal::NotPolled));
    assert!(matches!(receiver.poll(at(1)), Some(NativeOutcome::Scan(s)) if s.detections.is_empty()));
}

fn any_detection() -> impl Strategy<Value = Detection> {
    let measured = |range: std::ops::Range<i16>| prop::option::of(range);
    (1_u16.., any::<i16>(), measured(-16_384..16_384), any::<i16>(), measured(-127..128), measured(0..255)).prop_map(
        |(range_cm, azimuth, elevation, radial_velocity_cm_s, rcs_half_dbsm, snr_half_db)| Detection {
            range_cm,
            azimuth: Angle::from_raw(azimuth),
            elevation: elevation.map(Angle::from_raw),
            radial_velocity_cm_s,
            rcs_half_dbsm,
            snr_half_db,
            marked: false,
        },
    )
}

proptest! {
    #[test]
    fn scans_come_back_over_can_fd(
        scans in prop::collection::vec(prop::collection::vec(any_detection(), 0..60), 1..6),
    ) {
        let mut sender = NativeSender::new(SENSOR);
        let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
        for (i, detections) in scans.iter().enumerate() {
            let mut got = Vec::new();
            for message in messages(&mut sender, i as u64, detections, NativeMedium::CanFd) {
                let frame = message.frame(id(SENSOR)).unwrap();
                got.extend(push(&mut receiver, frame.data(), i as u64));
            }
            prop_assert_eq!(got, [(i as u32, detections.clone(), 0)]);
        }
        prop_assert_eq!(receiver.counters().lost, 0);
    }

    #[test]
    fn scans_come_back_over_a_serial_line_whatever_the_chunks(
        scans in prop::collection::vec(prop::collection::vec(any_detection(), 0..60), 1..6),
        chunk in prop::sample::select(&[1_usize, 11, 17, 4096][..]),
        rubbish in prop::collection::vec(any::<u8>(), 0..50),
    ) {
        let mut sender = NativeSender::new(SENSOR);
        let mut line = rubbish;
        // two zeros bring any line into step
        line.extend([0, 0]);
        for (i, detections) in scans.iter().enumerate() {
            for message in messages(&mut sender, i as u64, detections, NativeMedium::Serial) {
                let mut stuffed = [0; 300];
                let n = message.stuff(&mut stuffed).unwrap();
                line.extend(&stuffed[..n]);
            }
        }
        let mut receiver = NativeSerialReceiver::<64>::new(NativeConfig::sensor(SENSOR));
        let mut got: Vec<Vec<Detection>> = Vec::new();
        for mut bytes in line.chunks(chunk) {
            while !bytes.is_empty() {
                let (taken, outcome) = receiver.push(bytes, at(0));
                bytes = &bytes[taken..];
                if let NativeOutcome::Scan(s) = outcome {
                    got.push(s.detections.to_vec());
                }
                prop_assert_eq!(receiver.poll(at(0)), None);
            }
        }
        prop_assert_eq!(got, scans);
    }

    #[test]
    fn any_bytes_are_taken(bytes in prop::collection::vec(any::<u8>(), 0..2000), ms in 0_u64..1000) {
        let mut receiver = NativeSerialReceiver::<8>::new(NativeConfig::sensor(SENSOR));
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let (taken, _) = receiver.push(rest, at(ms));
            prop_assert!(taken > 0);
            rest = &rest[taken..];
            receiver.poll(at(ms));
        }
    }

    /// Messages lost, repeated and exchanged at random: what comes out was sent in that scan, at most once.
    #[test]
    fn nothing_is_made_up(
        sizes in prop::collection::vec(0_usize..40, 2..12),
        fates in prop::collection::vec(0_u8..12, 1..97),
    ) {
        let mut sender = NativeSender::new(SENSOR);
        let mut receiver = NativeReceiver::<64>::new(NativeConfig::sensor(SENSOR));
        let mut line: Vec<NativeMessage> = Vec::new();
        let mut fate = fates.iter().cycle();
        for (i, size) in sizes.iter().enumerate() {
            let detections: Vec<Detection> = (0..*size).map(|n| nth(100 * i + n)).collect();
            for message in messages(&mut sender, i as u64, &detections, NativeMedium::CanFd) {
                match fate.next().unwrap() {
                    0 => {}
                    1 => line.extend([message, message]),
                    2 => line.insert(line.len().saturating_sub(1), message),
                    _ => line.push(message),
                }
            }
        }
        let mut scans = Vec::new();
        for (ms, message) in line.iter().enumerate() {
            scans.extend(push(&mut receiver, message.bytes(), ms as u64));
        }
        let mut numbers: Vec<u32> = scans.iter().map(|s| s.0).collect();
        numbers.dedup();
        prop_assert_eq!(numbers.len(), scans.len());
        for (number, detections, missing) in scans {
            let sent = sizes[number as usize];
            let mut ranges: Vec<u16> = detections.iter().map(|d| d.range_cm - 100).collect();
            ranges.sort_unstable();
            ranges.dedup();
            prop_assert_eq!(ranges.len(), detections.len());
            prop_assert!(ranges.iter().all(|r| usize::from(*r) / 100 == number as usize));
            prop_assert!(detections.len() + usize::from(missing) >= sent && detections.len() <= sent);
        }
    }
}
