//! A receiver in C, written from the specification alone, makes the same maps of the same log.

#![allow(clippy::cast_possible_truncation, clippy::indexing_slicing, clippy::unwrap_used, clippy::panic)] // a test may fail

mod shadows;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use shadows::{A, Map, Random, Shadows, W, header};
use viewshed::map::Visibility;
use viewshed::time::Time;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Epoch};
use viewshed::wire::receive::{Limits, Receiver};

/// What a bus does to frames, shares of them.
#[derive(Debug, Clone, Copy)]
struct Faults {
    lost: f64,
    late: f64,
    repeated: f64,
    flipped: f64,
    restarts: f64,
}

const NONE: Faults = Faults { lost: 0.0, late: 0.0, repeated: 0.0, flipped: 0.0, restarts: 0.0 };
const ALL: Faults = Faults { lost: 0.05, late: 0.02, repeated: 0.03, flipped: 0.02, restarts: 0.005 };

/// Frames of two sensors with the times they arrive, sensor 1 on classic CAN, sensor 6 on CAN FD.
fn traffic(scans: u64, faults: Faults, seed: u64) -> Vec<(u64, CanFrame)> {
    let mut random = Random::new(seed);
    let mut all = Vec::new();
    for (sensor, medium) in [(1, Medium::Can(Addresses::STANDARD)), (6, Medium::CanFd(Addresses::STANDARD))] {
        let config = BroadcastConfig { visible_range_ms: Some(500), ..BroadcastConfig::new(sensor, medium) };
        let start = |epoch, us| Broadcaster::<A, W>::new(config, header(3), epoch, Time::from_micros(us)).unwrap();
        let mut sender = start(Epoch::new(sensor), 50_000_000);
        let mut shadows = Shadows::new(seed + u64::from(sensor));
        let mut map = Map(Vec::new());
        for ms in 0..67 * scans {
            let us = 1_000_000_000 + 1000 * ms + u64::from(sensor);
            let clock = Time::from_micros(50_000_000 + 1000 * ms);
            if ms % 67 == 0 {
                if random.chance(faults.restarts) {
                    sender = start(sender.epoch().next(), clock.micros());
                }
                map = shadows.next();
                let _ = sender.scan(clock, &map);
            }
            let Some(frame) = sender.next_frame(clock) else { continue };
            let mut data = frame.data().to_vec();
            if random.chance(faults.flipped) {
                let bit = random.below(8 * data.len() as u64) as usize;
                data[bit / 8] ^= 1 << (bit % 8);
            }
            let frame = if frame.fd { CanFrame::fd(frame.id, &data) } else { CanFrame::classic(frame.id, &data) };
            let frame = frame.unwrap();
            if !random.chance(faults.lost) {
                all.push((us + if random.chance(faults.late) { random.below(2_000_000) } else { 0 }, frame));
            }
            if random.chance(faults.repeated) {
                all.push((us + random.below(2_000_000), frame));
            }
        }
        assert!(!map.0.is_empty());
    }
    all.sort_by_key(|(us, _)| *us);
    all
}

/// The log as candump -L writes it.
fn log(frames: &[(u64, CanFrame)]) -> String {
    frames.iter().fold(String::new(), |mut text, (us, frame)| {
        let CanId::Standard(id) = frame.id else { panic!("11 bits are meant") };
        let (s, us) = (us / 1_000_000, us % 1_000_000);
        let _ = write!(text, "({s}.{us:06}) can0 {id:03X}#{}", if frame.fd { "#1" } else { "" });
        frame.data().iter().for_each(|byte| {
            let _ = write!(text, "{byte:02X}");
        });
        text.push('\n');
        text
    })
}

/// What the library's receiver makes of it, in the C receiver's words.
fn ours(frames: &[(u64, CanFrame)]) -> String {
    let sensors = [0, 1, 2, 3, 4, 5, 6, 7];
    let mut receiver = Box::new(Receiver::<8, 128, 8>::new(sensors, Addresses::STANDARD, Limits::DEFAULT));
    let (mut text, mut next) = (String::new(), None);
    for (us, frame) in frames {
        let due = *next.get_or_insert(us + 100_000);
        if *us >= due {
            sensors.iter().for_each(|sensor| maps(&receiver, *sensor, *us, &mut text));
            next = Some(us + 100_000);
        }
        let _ = receiver.frame(Time::from_micros(*us), frame);
    }
    text
}

fn maps(receiver: &Receiver<8, 128, 8>, sensor: u8, us: u64, text: &mut String) {
    let map = receiver.map(sensor, Time::from_micros(us));
    let Some(header) = map.header() else { return };
    let (mut visible, mut invisible, mut hash) = (0, 0, 14_695_981_039_346_656_037_u64);
    for azimuth in 0..usize::from(header.azimuths) {
        for range in 0..usize::from(header.ranges) {
            let state = map.cell(azimuth, range).visibility;
            visible += u32::from(state == Visibility::Visible);
            invisible += u32::from(state == Visibility::Invisible);
            hash = (hash ^ state as u64).wrapping_mul(1_099_511_628_211);
        }
    }
    let _ = writeln!(text, "{us} {sensor} {visible} {invisible} {hash:016x}");
}

/// The C receiver, built; `None` without a compiler.
fn built() -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/receiver/receiver.c");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("receiver");
    if Command::new("cc").arg("--version").output().is_err() {
        println!("skipped: no C compiler `cc` (on Debian and Ubuntu: apt-get install gcc libc6-dev)");
        return None;
    }
    let output = Command::new("cc")
        .args(["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&target)
        .arg(source)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(target)
}

#[test]
fn a_receiver_written_from_the_specification_makes_the_same_maps() {
    let Some(receiver) = built() else { return };
    for (name, scans, faults) in [("clean", 150, NONE), ("faulty", 1500, ALL)] {
        let frames = traffic(scans, faults, 5);
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.log"));
        std::fs::write(&path, log(&frames)).unwrap();
        let output = Command::new(&receiver).arg(&path).output().unwrap();
        assert!(output.status.success());
        let theirs = String::from_utf8(output.stdout).unwrap();
        let ours = ours(&frames);
        let differing = ours.lines().zip(theirs.lines()).find(|(a, b)| a != b);
        assert_eq!(differing, None, "{name}");
        assert_eq!(ours.lines().count(), theirs.lines().count(), "{name}");
        for sensor in ["1", "6"] {
            let told = ours.lines().filter(|line| line.split(' ').nth(1) == Some(sensor)).count();
            // most of the 100 ms there are
            assert!(told as u64 > scans * 67 / 100 * 4 / 10, "{name}: {told} maps of sensor {sensor}");
        }
    }
}
