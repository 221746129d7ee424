//! Recordings in the native scan format: captures of a serial line, and CAN FD frames in a log.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use viewshed::fixed::time::Time;
use viewshed::inputs::RadarScan;
use viewshed::inputs::native::{NativeConfig, NativeCounters, NativeOutcome, NativeReceiver, VERSION, data_id, id};
use viewshed::wire::e2e::Profile;
use viewshed::wire::serial::Unstuffer;

use super::can_log::Line;
use super::can_log::log::Lines;
use super::capture::{self, Kind};
use super::problems::Problems;
use super::{Frame, ReadOptions, Recording};

/// Detections of a scan that are kept.
const MOST_DETECTIONS: usize = 4096;

/// Bytes at the start of a file in which a message must lie.
const WITHIN: usize = 1 << 16;

/// Whole messages with the time they came at, in microseconds; 0 where that is not known.
pub type Messages = Vec<(u64, Vec<u8>)>;

/// The messages of a serial capture, and how many were broken.
pub fn unstuff(mut bytes: &[u8]) -> (Messages, u32) {
    let mut unstuffer = Unstuffer::new();
    let mut messages = Vec::new();
    while !bytes.is_empty() {
        let (taken, message) = unstuffer.push(bytes);
        messages.extend(message.map(|message| (0, message.to_vec())));
        bytes = &bytes[taken.clamp(1, bytes.len())..];
    }
    (messages, unstuffer.errors())
}

/// The data of a frame that is such a message.
pub fn message(line: &Line) -> Option<&[u8]> {
    let frame = line.frame()?;
    sensor(frame.data()).filter(|sensor| frame.id == id(*sensor)).map(|_| frame.data())
}

/// The data of CAN FD frames that are such messages.
pub fn of_log<L: Lines + ?Sized>(lines: &L) -> Messages {
    let mut messages = Messages::new();
    lines.each(&mut |line| {
        let micros = u64::try_from(line.time_ns / 1000).unwrap_or(0);
        messages.extend(message(line).map(|data| (micros, data.to_vec())));
    });
    messages
}

/// Whether a file looks like a serial capture.
pub fn is_capture(bytes: &[u8]) -> bool {
    let (messages, _) = unstuff(&bytes[..bytes.len().min(WITHIN)]);
    messages.iter().any(|(_, message)| sensor(message).is_some())
}

/// The sensor a message is of, if its check sum fits.
pub fn sensor(message: &[u8]) -> Option<u8> {
    let &[_, _, _, version, sensor, ..] = message else { return None };
    if version >> 4 != VERSION {
        return None;
    }
    Profile::P05.check(message, data_id(sensor)).ok().map(|_| sensor)
}

/// Messages of each sensor.
pub fn sensors(messages: &Messages) -> BTreeMap<u8, usize> {
    let mut found = BTreeMap::new();
    for sensor in messages.iter().filter_map(|(_, m)| sensor(m)) {
        *found.entry(sensor).or_default() += 1;
    }
    found
}

/// Reads the scans of one sensor.
///
/// # Errors
/// Several sensors and none named, or no whole scan.
pub fn read(name: String, messages: &Messages, broken: u32, options: &ReadOptions) -> Result<Recording> {
    let found = sensors(messages);
    let listed = || found.iter().map(|(s, n)| format!("{s} ({n} messages)")).collect::<Vec<_>>().join(", ");
    let sensor = match (options.sensor_id, &found.keys().copied().collect::<Vec<_>>()[..]) {
        (Some(id), _) if found.contains_key(&id) => id,
        (None, [only]) => *only,
        (Some(id), _) => bail!("{name}: no scan of sensor {id}; sensors found: {}", listed()),
        (None, _) => bail!("{name}: several sensors: {}; choose one with --sensor-id", listed()),
    };
    let mut problems = Problems::default();
    let mut frames: Vec<Frame> = Vec::new();
    let counters = scans(sensor, messages, |scan| {
        let time_ns = i64::try_from(scan.time.micros()).unwrap_or(i64::MAX).saturating_mul(1000);
        if scan.fault {
            problems.add("native", "scan of a radar that reports a fault", time_ns);
        }
        let detections = scan.detections.iter().map(capture::detection).collect();
        frames.push(Frame {
            time_ns,
            detections,
            refused: scan.refused.into(),
            unwanted: scan.unwanted().iter().map(capture::detection).collect(),
            fault: scan.fault,
        });
    });
    let Some(start) = frames.first().map(|f| f.time_ns) else {
        bail!("{name}: no whole scan of sensor {sensor}; `viewshed doctor` says what there is")
    };
    problems.add_many("native", "message too long or cut, refused", start, u64::from(broken));
    // a line carries the messages of other sensors too
    let others: usize = found.iter().filter(|(s, _)| **s != sensor).map(|(_, n)| n).sum();
    for (what, n) in flaws(&counters, others) {
        problems.add_many("native", what, start, u64::from(n));
    }
    let kind = Kind {
        name: format!("native sensor {sensor}"),
        azimuth_deg: 60.0,
        elevation_deg: 16.0,
        range_m: [1.0, 200.0],
        has_elevation: frames.iter().flat_map(|f| &f.detections).any(|d| d.elevation_rad.is_some()),
    };
    Ok(capture::recording(name, kind, frames, problems, options))
}

/// Feeds a receiver with messages; `scan` is given every scan that comes of them.
pub fn scans(sensor: u8, messages: &Messages, mut scan: impl FnMut(&RadarScan<'_>)) -> NativeCounters {
    let mut receiver = NativeReceiver::<MOST_DETECTIONS>::new(NativeConfig::sensor(sensor));
    let mut give = |outcome: NativeOutcome<'_>| {
        if let NativeOutcome::Scan(s) = outcome {
            scan(&s);
        }
    };
    let mut end = 0;
    for (micros, message) in messages {
        let now = Time::from_micros(*micros);
        while let Some(outcome) = receiver.poll(now) {
            give(outcome);
        }
        give(receiver.push(message, now));
        while let Some(outcome) = receiver.poll(now) {
            give(outcome);
        }
        end = *micros;
    }
    while let Some(outcome) = receiver.poll(Time::from_micros(end.saturating_add(10_000_000))) {
        give(outcome);
    }
    *receiver.counters()
}

/// What the decoder counted, in words; messages of other sensors are no damage.
pub fn flaws(c: &NativeCounters, others: usize) -> [(&'static str, u32); 8] {
    [
        ("scan of which parts are missing", c.incomplete),
        ("scan of which most is missing, dropped", c.broken),
        ("message that never came, by its counter", c.lost),
        ("message damaged, refused", c.damaged.saturating_sub(u32::try_from(others).unwrap_or(u32::MAX))),
        ("message of an unknown version, refused", c.version),
        ("message that contradicts others, refused", c.inconsistent),
        ("part that came twice or late, refused", c.repeated.saturating_add(c.late)),
        ("detection beyond what is kept, dropped", c.overflow),
    ]
}
