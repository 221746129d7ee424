//! The example on the shipped log of an ARS408's bus.

use viewshed::{CanFrame, CanId, RoadPoint, Time, small};
use viewshed_example::ars408_unit::Guard;

mod pole;

use pole::sensor;

const LOG: &str = include_str!("../../recordings/ars408-made-up.log");

/// `(seconds) can0 ID#BYTES`.
fn frame(line: &str) -> Option<(Time, CanFrame)> {
    let (time, rest) = line.strip_prefix('(')?.split_once(") can0 ")?;
    let (id, data) = rest.split_once('#')?;
    let bytes =
        (0..data.len() / 2).map(|k| u8::from_str_radix(&data[2 * k..2 * k + 2], 16)).collect::<Result<Vec<_>, _>>();
    let id = CanId::standard(u16::from_str_radix(id, 16).ok()?)?;
    let micros = time.replace('.', "").parse().ok()?;
    Some((Time::from_micros(micros), CanFrame::classic(id, &bytes.ok()?)?))
}

/// The log three times over: it lasts two seconds.
fn log() -> impl Iterator<Item = (Time, CanFrame)> {
    let later = |time: Time, round: u64| Time::from_micros(time.micros() + round * 2_000_000);
    (0..3).flat_map(move |round| LOG.lines().filter_map(frame).map(move |(time, frame)| (later(time, round), frame)))
}

#[test]
fn the_road_ahead_is_free_while_scans_come_and_unknown_soon_after() {
    let (mut input, mut radar) = (Box::new(Guard::INPUT), Box::new(small::Radar::new()));
    let mut guard = Guard::start(&mut input, &mut radar, &sensor(2.0)).unwrap();
    let near = RoadPoint::from_metres(20.0, -2.0).unwrap();
    let behind = RoadPoint::from_metres(-20.0, 0.0).unwrap();
    assert!(!guard.is_free(near, Time::from_micros(0)).unwrap(), "no scan yet");
    let (mut now, mut frames, mut free) = (Time::from_micros(0), 0, 0);
    for (time, frame) in log() {
        guard.take(&frame, time);
        (now, frames) = (time, frames + 1);
        free += u32::from(guard.is_free(near, time).unwrap());
        assert!(!guard.is_free(behind, time).unwrap(), "nobody looks there");
    }
    // two seconds after the start the road ahead has settled
    assert!(frames > 5000 && 2 * free > frames, "{free} of {frames}");
    let later = Time::from_micros(now.micros() + 600_000);
    assert!(!guard.is_free(near, later).unwrap(), "silence is no free road");
}

#[test]
fn nothing_is_free_while_parts_of_the_last_scan_are_missing() {
    let (mut input, mut radar) = (Box::new(Guard::INPUT), Box::new(small::Radar::new()));
    let mut guard = Guard::start(&mut input, &mut radar, &sensor(2.0)).unwrap();
    let near = RoadPoint::from_metres(20.0, -2.0).unwrap();
    let (mut scans, mut free) = (0, 0);
    let is = |frame: &CanFrame, id: u16| Some(frame.id) == CanId::standard(id);
    // of every second scan the third entry never comes
    for (time, frame) in log() {
        scans += usize::from(is(&frame, 0x600));
        if is(&frame, 0x701) && frame.data().first() == Some(&2) && scans % 2 == 0 {
            continue;
        }
        guard.take(&frame, time);
        // a scan is over when the next one begins
        if is(&frame, 0x600) && scans > 40 {
            let is_free = guard.is_free(near, time).unwrap();
            assert!(!(is_free && scans % 2 == 1), "scan {scans} is free by one with a hole");
            free += usize::from(is_free);
        }
    }
    assert!(free > 5, "{free} of {scans}");
}
