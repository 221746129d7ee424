//! One ARS408 on the bus: its scans, its counters, what it says of itself.

use std::collections::BTreeMap;

use serde::Serialize;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;
use viewshed::inputs::ars408::receiver::{cluster_status, object_status};
use viewshed::inputs::ars408::state::{RadarState, Version};
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Counters};
use viewshed::inputs::signal::word;

use crate::recording::ars408::scans;
use crate::recording::can_log::Line;
use crate::recording::kind;

/// What a sensor sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Output {
    Nothing,
    Objects,
    Clusters,
}

/// A sensor that was heard.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sensor {
    pub interface: String,
    pub sensor: u8,
    pub output: Output,
    /// Scans announced by a status message.
    pub announced: usize,
    /// Scans decoded.
    pub scans: usize,
    /// Entries in them.
    pub entries: usize,
    pub period_ms: Option<Spread>,
    /// How far the measurement counter usually advances.
    pub counter_step: Option<u16>,
    /// Share of entries beyond 260 m or behind the sensor, where it does not look.
    pub implausible: f64,
    /// The kind of radar by whose scales its frames make more sense, and why.
    pub rather: Option<(&'static str, String)>,
    pub version: Option<String>,
    #[serde(serialize_with = "state")]
    pub state: Option<RadarState>,
    /// State messages that report each fault.
    pub faults: BTreeMap<&'static str, usize>,
    #[serde(serialize_with = "counters")]
    pub counters: Ars408Counters,
}

/// Least, middle and greatest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    pub min: f64,
    pub median: f64,
    pub max: f64,
}

impl Spread {
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self { min: *values.first()?, median: *values.get(values.len() / 2)?, max: *values.last()? })
    }
}

/// Every sensor that sent something.
pub fn all(lines: &[Line], profile: &Ars408Profile) -> Vec<Sensor> {
    let mut of_sensor: BTreeMap<(&str, u8), Vec<&Line>> = BTreeMap::new();
    for line in lines {
        let Some(frame) = line.frame().filter(|f| !f.fd) else { continue };
        if let Some((message, sensor)) = Message::of(frame.id)
            && message.from_sensor()
        {
            of_sensor.entry((&line.interface, sensor)).or_default().push(line);
        }
    }
    of_sensor.into_iter().map(|((interface, sensor), lines)| examine(interface, sensor, &lines, profile)).collect()
}

fn examine(interface: &str, sensor: u8, lines: &[&Line], profile: &Ars408Profile) -> Sensor {
    let mut radar = Ars408::<1024>::new(Ars408Config {
        wanted: Ars408Wanted::ALL,
        profile: *profile,
        ..Ars408Config::sensor(sensor)
    });
    let (mut times, mut entries, mut odd) = (Vec::new(), 0, 0);
    scans(&mut radar, lines, |scan| {
        times.push(scan.time.micros());
        entries += scan.detections.len();
        // behind: more than a quarter turn to a side
        odd +=
            scan.detections.iter().filter(|d| d.range_cm > 26_000 || d.azimuth.raw().unsigned_abs() > 1 << 14).count();
    });
    let frames = |wanted: Message| {
        let mine = lines.iter().filter_map(|l| l.frame());
        mine.filter(move |f| f.id == wanted.id(sensor) && f.data().len() >= wanted.length())
    };
    let clusters = frames(Message::ClusterStatus).map(|f| cluster_status::COUNTER.get(word(f.data())));
    let objects = frames(Message::ObjectStatus).map(|f| object_status::COUNTER.get(word(f.data())));
    let (clusters, objects): (Vec<u32>, Vec<u32>) = (clusters.collect(), objects.collect());
    let states: Vec<RadarState> = frames(Message::RadarState).filter_map(|f| RadarState::read(f.data())).collect();
    let version = frames(Message::Version).filter_map(|f| Version::read(f.data())).next_back();
    Sensor {
        interface: interface.to_owned(),
        sensor,
        output: match (clusters.len(), objects.len()) {
            (0, 0) => Output::Nothing,
            (c, o) if c > o => Output::Clusters,
            _ => Output::Objects,
        },
        announced: clusters.len() + objects.len(),
        scans: times.len(),
        entries,
        period_ms: Spread::of(times.windows(2).map(|w| w[1].saturating_sub(w[0]) as f64 / 1000.0).collect()),
        counter_step: step(if clusters.len() > objects.len() { &clusters } else { &objects }),
        implausible: if entries > 0 { odd as f64 / entries as f64 } else { 0.0 },
        rather: kind::rather(lines, sensor, profile),
        version: version.map(|v| v.release.map(|n| n.to_string()).join(".")),
        state: states.last().copied(),
        faults: faults(&states),
        counters: *radar.counters(),
    }
}

/// The usual advance of a counter of 16 bits.
fn step(counts: &[u32]) -> Option<u16> {
    let mut advances: BTreeMap<u16, usize> = BTreeMap::new();
    for pair in counts.windows(2) {
        *advances.entry((pair[1].wrapping_sub(pair[0]) & 0xFFFF) as u16).or_default() += 1;
    }
    advances.into_iter().max_by_key(|(_, n)| *n).map(|(advance, _)| advance)
}

/// A fault by its name, and whether a state message reports it.
type Fault = (&'static str, fn(&RadarState) -> bool);

fn faults(states: &[RadarState]) -> BTreeMap<&'static str, usize> {
    let kinds: [Fault; 7] = [
        ("supply voltage", |s| s.voltage_error),
        ("temperature", |s| s.temperature_error),
        ("temporary error", |s| s.temporary_error),
        ("persistent error", |s| s.persistent_error),
        ("interference", |s| s.interference),
        ("speed missing", |s| s.speed_missing),
        ("yaw rate missing", |s| s.yaw_rate_missing),
    ];
    let counted = kinds.into_iter().map(|(name, has)| (name, states.iter().filter(|s| has(s)).count()));
    counted.filter(|(_, n)| *n > 0).collect()
}

fn state<S: serde::Serializer>(state: &Option<RadarState>, serializer: S) -> Result<S::Ok, S::Error> {
    let value = state.map(|s| {
        serde_json::json!({
            "sensor_id": s.sensor_id,
            "max_distance_m": s.max_distance_m,
            "output": s.output.map(|o| format!("{o:?}").to_lowercase()),
            "quality": s.quality,
            "extended": s.extended,
            "order": s.order.map(|o| format!("{o:?}").to_lowercase()),
            "speed_missing": s.speed_missing,
            "yaw_rate_missing": s.yaw_rate_missing,
            "interference": s.interference,
            "fault": s.fault(),
        })
    });
    value.serialize(serializer)
}

fn counters<S: serde::Serializer>(c: &Ars408Counters, serializer: S) -> Result<S::Ok, S::Error> {
    named(c).into_iter().collect::<BTreeMap<_, _>>().serialize(serializer)
}

/// The decoder's counters by name.
pub fn named(c: &Ars408Counters) -> [(&'static str, u32); 13] {
    [
        ("frames", c.frames),
        ("scans", c.scans),
        ("incomplete", c.incomplete),
        ("broken", c.broken),
        ("lost", c.lost),
        ("restarts", c.restarts),
        ("too_short", c.too_short),
        ("no_scan", c.no_scan),
        ("repeated", c.repeated),
        ("surplus", c.surplus),
        ("unknown_entry", c.unknown_entry),
        ("no_range", c.no_range),
        ("overflow", c.overflow),
    ]
}
