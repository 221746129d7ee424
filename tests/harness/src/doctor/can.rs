//! The identifiers of a log: which were seen, which were expected.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::motion;
use viewshed::wire::frame::CanId;
use viewshed::wire::message::Addresses;

use super::sensor::{Output, Sensor};
use crate::bus::listening::Listening;
use crate::recording::can_log::log::Lines;
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

/// What is said of a bus without knowing its radars, found in one go.
#[derive(Default)]
pub struct Bus {
    pub frames: usize,
    /// Most frames of one interface within a second.
    pub busiest_second: usize,
    seen: BTreeMap<String, BTreeMap<(u32, bool), Seen>>,
    /// Error frames by their class.
    pub errors: BTreeMap<u32, usize>,
    /// Sensors whose visibility broadcast is there, on the usual identifiers.
    pub broadcasters: Vec<u8>,
    /// Frames on 400 to 4FF, where visibility is broadcast by default.
    pub broadcasts: usize,
    /// Frames with a radar's identifier in 29 bits, and those marked as CAN FD.
    pub extended: usize,
    pub flexible: usize,
    /// The greatest speed that sensors are told, by interface and sensor, cm/s.
    pub told_cm_s: BTreeMap<(String, u8), i32>,
}

#[derive(Default, Clone)]
struct Seen {
    frames: usize,
    lengths: BTreeSet<usize>,
}

impl Bus {
    pub fn of<L: Lines + ?Sized>(lines: &L) -> Self {
        let mut bus = Self::default();
        let mut seconds: BTreeMap<String, (i64, usize)> = BTreeMap::new();
        let mut listening = Listening::new(Addresses::STANDARD, None);
        lines.each(&mut |line| {
            bus.frames += 1;
            let now = line.time_ns.div_euclid(1_000_000_000);
            let (second, frames) = entry(&mut seconds, &line.interface);
            if *second != now {
                (*second, *frames) = (now, 0);
            }
            *frames += 1;
            bus.busiest_second = bus.busiest_second.max(*frames);
            listening.take(line);
            bus.take(line);
        });
        bus.broadcasters = listening.sensors();
        bus
    }

    fn take(&mut self, line: &Line) {
        let (id, length) = match &line.content {
            Content::Data(frame) => (frame.id, Some(frame.data().len())),
            Content::Remote(id) => (*id, None),
            Content::Error(class) => {
                *self.errors.entry(*class).or_default() += 1;
                return;
            }
        };
        let is_extended = matches!(id, CanId::Extended(_));
        let one = entry(&mut self.seen, &line.interface).entry((id.raw(), is_extended)).or_default();
        one.frames += 1;
        one.lengths.extend(length);
        let Some(frame) = line.frame() else { return };
        self.broadcasts += usize::from(matches!(id, CanId::Standard(0x400..=0x4FF)));
        let in_11_bits = u16::try_from(id.raw()).ok().and_then(CanId::standard).and_then(Message::of);
        let Some((message, sensor)) = in_11_bits else { return };
        self.extended += usize::from(is_extended);
        self.flexible += usize::from(!is_extended && frame.fd && frame.data().len() <= 8);
        if message == Message::Speed && !is_extended && frame.data().len() >= 2 {
            let told = self.told_cm_s.entry((line.interface.clone(), sensor)).or_default();
            *told = (*told).max(motion::speed_cm_s(frame.data()).abs());
        }
    }

    /// All identifiers seen, and those that the sensors' modes let expect.
    pub fn identifiers(&self, sensors: &[Sensor], seconds: f64) -> Vec<Identifier> {
        let seen = self.seen.iter().flat_map(|(interface, seen)| {
            seen.iter().map(|((raw, extended), seen)| ((interface.clone(), *raw, *extended), seen.clone()))
        });
        identifiers(seen.collect(), sensors, seconds)
    }
}

/// Of an interface; its name is copied once.
fn entry<'a, T: Default>(all: &'a mut BTreeMap<String, T>, interface: &str) -> &'a mut T {
    if !all.contains_key(interface) {
        all.insert(interface.to_owned(), T::default());
    }
    all.entry(interface.to_owned()).or_default()
}

fn identifiers(mut seen: BTreeMap<(String, u32, bool), Seen>, sensors: &[Sensor], seconds: f64) -> Vec<Identifier> {
    for sensor in sensors {
        for message in expected(sensor) {
            seen.entry((sensor.interface.clone(), message.id(sensor.sensor).raw(), false)).or_default();
        }
    }
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
