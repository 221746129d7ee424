//! The maps in a log of a bus.

use std::collections::BTreeMap;

use serde::Serialize;
use viewshed::fixed::time::Time;
use viewshed::map::{CellState, Visibility};
use viewshed::wire::message::{Addresses, Plane};
use viewshed::wire::receive::{ReceivedMap, ReceiverLimits, SenderCondition};
use viewshed::wire::serial::Unstuffer;

use super::ears::{Ears, Key};
use super::logged::Logged;
use crate::geometry::azimuths::EVEN;
use crate::recording::can_log::Line;
use crate::recording::serial_log::Chunk;

/// Sensors, azimuths, words of ranges and planes there is room for: all of them.
pub const SENSORS: u8 = 8;
const A: usize = 128;
const W: usize = 8;
const P: usize = 3;

/// A received map at a moment.
pub type Map<'a> = ReceivedMap<'a, A, W, P>;

/// Listens to a log.
pub struct Listening {
    ears: Ears<{ SENSORS as usize }, A, W, P>,
    /// Serial lines by their device.
    lines: BTreeMap<String, Unstuffer>,
    limits: ReceiverLimits,
    frames: u64,
    last: Time,
}

/// Cells of one map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// On the log's clock.
    pub time_s: f64,
    pub visible: usize,
    pub invisible: usize,
    pub unknown: usize,
    /// Of the cells that are known, the mean of the least probability that a vehicle there is detected; of a sender
    /// with a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
}

/// What one sensor said.
#[derive(Debug, Clone, Serialize)]
pub struct Heard {
    pub sensor: u8,
    pub condition: String,
    pub epoch: Option<u8>,
    pub header: Option<Mounted>,
    pub status: Option<StatusSeen>,
    pub counters: Counted,
    pub maps: Vec<Moment>,
}

/// Mount and geometry.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mounted {
    pub x_m: f64,
    pub y_m: f64,
    pub height_m: f64,
    pub yaw_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
    pub azimuths: u8,
    /// Right edge of the first, left edge of the last.
    pub azimuth_deg: [f64; 2],
    /// Where some are narrower than the others: the first of them, the first behind them, and how many times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub narrow: Option<[u8; 3]>,
    pub ranges: u16,
    pub cell_m: f64,
    /// Whether cells say how sure they are, and whether something stands there.
    pub grades: bool,
    pub occupancy: bool,
    pub fingerprint: u32,
    /// Of a sender with a table of probabilities.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<LevelsSeen>,
}

/// What a cell's bits say of its probability at least.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelsSeen {
    /// Known; visible; visible with the bit of the plane of probability.
    pub least: [f64; 3],
    /// Lowest 16 bits of the table's check sum.
    pub table: u16,
}

/// The status.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StatusSeen {
    pub state: String,
    pub reason: String,
    pub reset_cause: String,
    pub uptime_s: u32,
    pub firmware: [u8; 3],
    pub wire_version: u8,
    pub fingerprint: u32,
    pub radar_lost: u16,
    pub dropped: u16,
    pub e2e_errors: u16,
    pub bus_off: u16,
    /// Its own time for the last frame and for the longest, ms; none if it does not measure them.
    pub frame_ms: [Option<f64>; 2],
}

/// What happened to its frames.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Counted {
    pub accepted: u32,
    pub protection: u32,
    pub not_authentic: u32,
    pub lost: u32,
    pub repeated: u32,
    pub out_of_sequence: u32,
    pub late: u32,
    pub epoch: u32,
    pub early: u32,
    pub malformed: u32,
}

impl Listening {
    /// With a key, to authenticated messages and no others.
    pub fn new(addresses: Addresses, key: Option<&Key>) -> Self {
        let sensors = std::array::from_fn(|number| number as u8);
        let limits = ReceiverLimits::DEFAULT;
        let ears = Ears::new(sensors, addresses, limits, key);
        Self { ears, lines: BTreeMap::new(), limits, frames: 0, last: Time::from_micros(0) }
    }

    /// Takes a line of the log.
    pub fn take(&mut self, line: &Line) {
        let Some(frame) = line.frame() else { return };
        self.frames += 1;
        self.last = Time::from_micros(u64::try_from(line.time_ns / 1000).unwrap_or(0));
        // what is refused is counted there
        let _ = self.ears.frame(self.last, frame);
    }

    /// Lets time pass in which nothing came: maps grow old.
    pub fn pass(&mut self, time_ns: i64) {
        self.last = Time::from_micros(u64::try_from(time_ns / 1000).unwrap_or(0));
    }

    /// Takes whatever a log holds.
    pub fn take_logged(&mut self, logged: &Logged) {
        match logged {
            Logged::Frame(line) => self.take(line),
            Logged::Chunk(chunk) => self.take_bytes(chunk),
        }
    }

    /// Takes bytes of a serial line.
    pub fn take_bytes(&mut self, chunk: &Chunk) {
        self.last = Time::from_micros(u64::try_from(chunk.time_ns / 1000).unwrap_or(0));
        let unstuffer = self.lines.entry(chunk.device.clone()).or_default();
        let mut rest = &chunk.bytes[..];
        while !rest.is_empty() {
            let (taken, message) = unstuffer.push(rest);
            if let Some(message) = message.filter(|message| !message.is_empty()) {
                self.frames += 1;
                let _ = self.ears.message(self.last, message);
            }
            rest = &rest[taken..];
        }
    }

    /// The time of what came last, or of the last look at silence; on the log's clock.
    pub fn time_s(&self) -> f64 {
        self.last.micros() as f64 / 1e6
    }

    /// Frames so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Frames that are of none of the sensors.
    pub fn foreign(&self) -> u32 {
        self.ears.receiver().foreign()
    }

    /// The sensors heard, by number.
    pub fn sensors(&self) -> Vec<u8> {
        let heard = |number: &u8| self.ears.receiver().sensor(*number).is_some_and(|s| s.epoch().is_some());
        (0..SENSORS).filter(heard).collect()
    }

    /// Messages of all sensors that are not authentic, or that there was no key for.
    pub fn not_authentic(&self) -> u32 {
        let sensors = (0..SENSORS).filter_map(|number| self.ears.receiver().sensor(number));
        sensors.map(|sensor| sensor.counters().not_authentic).fold(0, u32::saturating_add)
    }

    /// A sensor's map as it is now.
    pub fn map(&self, sensor: u8) -> Map<'_> {
        self.ears.receiver().map(sensor, self.last)
    }

    /// Counts a sensor's map as it is now; `None` where it is unknown what there is to count.
    pub fn moment(&self, sensor: u8) -> Option<Moment> {
        let map = self.map(sensor);
        let header = map.header()?;
        let mut moment = Moment { time_s: self.time_s(), visible: 0, invisible: 0, unknown: 0, probability: None };
        let (mut cells, mut sum) = (0_u32, 0.0);
        for azimuth in 0..usize::from(header.azimuths) {
            let ray = map.ray(Plane::Visibility, azimuth);
            let (known, visible) = (ray.known.end().saturating_sub(ray.known.near()), ray.bits().count() as usize);
            moment.visible += visible;
            moment.invisible += known - visible;
            moment.unknown += usize::from(header.ranges) - known;
            let ranges = header.probability.map_or(0, |_| usize::from(header.ranges));
            for p in (0..ranges).filter_map(|range| map.probability(azimuth, range)) {
                (cells, sum) = (cells + 1, sum + f64::from(p.raw()) / 255.0);
            }
        }
        moment.probability = (cells > 0).then(|| sum / f64::from(cells));
        Some(moment)
    }

    /// Everything heard of a sensor; `maps` as counted on the way.
    pub fn heard(&self, number: u8, maps: Vec<Moment>) -> Option<Heard> {
        let sensor = self.ears.receiver().sensor(number)?;
        let header = sensor.header().map(|h| {
            let degrees = |angle: viewshed::fixed::angle::Angle| f64::from(angle.radians()).to_degrees();
            let right = degrees(h.azimuth_origin);
            Mounted {
                x_m: f64::from(h.mount.origin.x_cm) / 100.0,
                y_m: f64::from(h.mount.origin.y_cm) / 100.0,
                height_m: f64::from(h.mount.height_cm) / 100.0,
                yaw_deg: degrees(h.mount.yaw),
                pitch_deg: degrees(h.mount.pitch),
                roll_deg: degrees(h.mount.roll),
                azimuths: h.azimuths,
                azimuth_deg: [right, right + f64::from(h.azimuth_span) / 65536.0 * 360.0],
                narrow: Some(h.narrow.to_bytes()).filter(|narrow| *narrow != EVEN),
                ranges: h.ranges,
                cell_m: f64::from(h.cell_cm) / 100.0,
                grades: self.map(number).has(Plane::Grade) && h.probability.is_none(),
                occupancy: self.map(number).has(Plane::Occupancy),
                fingerprint: h.fingerprint,
                probability: h.probability.map(|levels| {
                    let bits = [(false, false), (true, false), (true, true)];
                    let least = bits.map(|(visible, clear)| levels.of(visible, clear));
                    LevelsSeen { least: least.map(|p| f64::from(p.raw()) / 255.0), table: levels.table() }
                }),
            }
        });
        let status = sensor.status().map(|s| StatusSeen {
            state: format!("{:?}", s.state),
            reason: format!("{:?}", s.reason),
            reset_cause: format!("{:?}", s.reset_cause),
            uptime_s: s.uptime_s,
            firmware: s.firmware,
            wire_version: s.wire_version,
            fingerprint: s.fingerprint,
            radar_lost: s.radar_lost,
            dropped: s.dropped,
            e2e_errors: s.e2e_errors,
            bus_off: s.bus_off,
            frame_ms: s.frame_times.map(|time| time.tenths_of_ms().map(|tenths| f64::from(tenths) / 10.0)),
        });
        let c = sensor.counters();
        let counters = Counted {
            accepted: c.accepted,
            protection: c.protection,
            not_authentic: c.not_authentic,
            lost: c.lost,
            repeated: c.repeated,
            out_of_sequence: c.out_of_sequence,
            late: c.late,
            epoch: c.epoch,
            early: c.early,
            malformed: c.malformed,
        };
        let condition = match sensor.condition(self.last, &self.limits) {
            SenderCondition::Waiting => "waiting",
            SenderCondition::NoHeader => "no header",
            SenderCondition::Unusable => "unusable",
            SenderCondition::Conflict => "conflict",
            SenderCondition::Ok => "ok",
        };
        let epoch = sensor.epoch().map(|epoch| epoch.number());
        Some(Heard { sensor: number, condition: condition.into(), epoch, header, status, counters, maps })
    }
}

/// A cell as pictures show it: occupied only where that is sent.
pub fn shown(map: &Map<'_>, azimuth: usize, range: usize) -> CellState {
    as_sent(map, map.cell(azimuth, range))
}

/// A cell of a map, occupied only where that is sent.
pub fn as_sent(map: &Map<'_>, cell: CellState) -> CellState {
    let occupied = cell.occupied && map.has(Plane::Occupancy) && cell.visibility != Visibility::Unknown;
    CellState { occupied, ..cell }
}
