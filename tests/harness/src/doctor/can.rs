//! The identifiers of a log: which were seen, which were expected.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use viewshed::inputs::ars408::message::Message;
use viewshed::wire::frame::CanId;

use super::sensor::{Output, Sensor};
use crate::recording::can_log::{Content, Line};

/// One identifier on one interface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identifier {
    pub interface: String,
    /// Hexadecimal, 3 or 8 digits.
    pub id: String,
    /// The message it is, where it is one of an ARS408.
    pub message: Option<&'static str>,
    pub sensor: Option<u8>,
    pub frames: usize,
    pub rate_hz: f64,
    /// Lengths seen, in bytes.
    pub lengths: Vec<usize>,
    pub expected_length: Option<usize>,
    /// Whether a radar in this mode sends it, or wants to be sent it.
    pub expected: bool,
}

pub fn duration_s(lines: &[Line]) -> f64 {
    let times = lines.iter().map(|l| l.time_ns);
    match (times.clone().min(), times.max()) {
        (Some(first), Some(last)) => last.saturating_sub(first) as f64 * 1e-9,
        _ => 0.0,
    }
}

/// Most frames of one interface within a second.
pub fn busiest_second(lines: &[Line]) -> usize {
    let mut seconds: BTreeMap<(&str, i64), usize> = BTreeMap::new();
    for line in lines {
        *seconds.entry((&line.interface, line.time_ns.div_euclid(1_000_000_000))).or_default() += 1;
    }
    seconds.into_values().max().unwrap_or(0)
}

#[derive(Default)]
struct Seen {
    frames: usize,
    lengths: BTreeSet<usize>,
}

/// All identifiers seen, and those that the sensors' modes let expect.
pub fn identifiers(lines: &[Line], sensors: &[Sensor]) -> Vec<Identifier> {
    let mut seen: BTreeMap<(String, u32, bool), Seen> = BTreeMap::new();
    for line in lines {
        let (id, length) = match &line.content {
            Content::Data(frame) => (frame.id, Some(frame.data().len())),
            Content::Remote(id) => (*id, None),
            Content::Error(_) => continue,
        };
        let extended = matches!(id, CanId::Extended(_));
        let one = seen.entry((line.interface.clone(), id.raw(), extended)).or_default();
        one.frames += 1;
        one.lengths.extend(length);
    }
    for sensor in sensors {
        for message in expected(sensor) {
            seen.entry((sensor.interface.clone(), message.id(sensor.sensor).raw(), false)).or_default();
        }
    }
    let seconds = duration_s(lines);
    let identifier = |((interface, raw, extended), seen): ((String, u32, bool), Seen)| {
        let id = if extended { None } else { u16::try_from(raw).ok().and_then(CanId::standard) };
        let of_sensor = id.and_then(Message::of);
        let sensor = of_sensor.and_then(|(_, s)| sensors.iter().find(|x| x.sensor == s && x.interface == interface));
        let message = of_sensor.map(|(message, _)| message).filter(|_| sensor.is_some());
        Identifier {
            id: if extended { format!("{raw:08X}") } else { format!("{raw:03X}") },
            message: message.map(Message::name),
            sensor: sensor.map(|s| s.sensor),
            rate_hz: if seconds > 0.0 { seen.frames as f64 / seconds } else { 0.0 },
            frames: seen.frames,
            lengths: seen.lengths.into_iter().collect(),
            expected_length: message.map(Message::length),
            expected: sensor.zip(message).is_some_and(|(s, m)| expected(s).contains(&m)),
            interface,
        }
    };
    seen.into_iter().map(identifier).collect()
}

/// The messages of a sensor in its mode, and those it wants.
fn expected(sensor: &Sensor) -> Vec<Message> {
    let mut messages = vec![Message::RadarState, Message::Version, Message::Speed, Message::YawRate];
    let quality = sensor.state.is_some_and(|s| s.quality);
    match sensor.output {
        Output::Clusters => {
            messages.extend([Message::ClusterStatus, Message::ClusterGeneral]);
            messages.extend(quality.then_some(Message::ClusterQuality));
        }
        Output::Objects => {
            messages.extend([Message::ObjectStatus, Message::ObjectGeneral]);
            messages.extend(quality.then_some(Message::ObjectQuality));
            messages.extend(sensor.state.is_some_and(|s| s.extended).then_some(Message::ObjectExtended));
        }
        Output::Nothing => messages.extend([Message::ClusterStatus, Message::ClusterGeneral]),
    }
    messages
}
