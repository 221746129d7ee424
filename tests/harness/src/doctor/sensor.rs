//! One ARS408 on the bus: its scans, its counters, what it says of itself.

use std::collections::BTreeMap;

use serde::Serialize;
use viewshed::inputs::RadarScan;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;
use viewshed::inputs::ars408::receiver::{cluster_status, object_status};
use viewshed::inputs::ars408::state::{RadarState, Version};
use viewshed::inputs::ars408::{Ars408Config, Ars408Counters};
use viewshed::inputs::signal::word;
use viewshed::wire::frame::CanFrame;

use crate::recording::ars408_feed::{Feed, classic};
use crate::recording::can_log::Line;
use crate::recording::can_log::log::Lines;
use crate::recording::capture::weak;
use crate::recording::judged::Watch;
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
    /// The RCS of all entries, where it never changes and is below the gate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub only_rcs_dbsm: Option<f32>,
    /// What a unit concludes of points that come again and are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unusable: Option<String>,
    /// Share of the scans of which nothing is known for that.
    pub unusable_share: f64,
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
pub fn all<L: Lines + ?Sized>(lines: &L, profile: &Ars408Profile, wanted: Option<Ars408Wanted>) -> Vec<Sensor> {
    let mut found: Vec<Examining> = Vec::new();
    lines.each(&mut |line| {
        let Some(frame) = classic(line).filter(|f| !f.fd) else { return };
        let Some((message, sensor)) = Message::of(frame.id).filter(|(message, _)| message.sent_by_sensor()) else {
            return;
        };
        let place = found.iter().position(|one| one.sensor == sensor && one.interface == line.interface);
        let place = place.unwrap_or_else(|| {
            found.push(Examining::new(&line.interface, sensor, profile, wanted));
            found.len() - 1
        });
        found[place].take(line, &frame, message);
    });
    found.sort_by(|a, b| (&a.interface, a.sensor).cmp(&(&b.interface, b.sensor)));
    found.into_iter().map(Examining::end).collect()
}

/// What was heard of a sensor so far.
struct Examining {
    interface: String,
    sensor: u8,
    feed: Feed<1024>,
    scans: Scans,
    clusters: Vec<u32>,
    objects: Vec<u32>,
    /// General entries of clusters and of objects.
    entries: [usize; 2],
    states: Vec<RadarState>,
    version: Option<Version>,
    profile: Ars408Profile,
    /// The first lines, which show by whose scales they make sense.
    first: Vec<Line>,
}

#[derive(Default)]
struct Scans {
    times: Vec<u64>,
    entries: usize,
    odd: usize,
    only_rcs: Option<i16>,
    watch: Watch,
}

/// Entries that tell that a value never changes.
const TELLING: usize = 50;

impl Scans {
    fn take(&mut self, scan: &RadarScan<'_>) {
        self.times.push(scan.time.micros());
        self.watch.frame(scan.time, scan.all);
        for detection in scan.all {
            let same = self.entries == 0 || self.only_rcs == detection.rcs_half_dbsm;
            self.only_rcs = detection.rcs_half_dbsm.filter(|_| same);
            self.entries += 1;
        }
        // behind: more than a quarter turn to a side
        self.odd += scan.all.iter().filter(|d| d.range_cm > 26_000 || d.azimuth.raw().unsigned_abs() > 1 << 14).count();
    }
}

impl Examining {
    fn new(interface: &str, sensor: u8, profile: &Ars408Profile, wanted: Option<Ars408Wanted>) -> Self {
        let usual = Ars408Config::sensor(sensor);
        let wanted = wanted.unwrap_or(usual.wanted);
        let config = Ars408Config { wanted, profile: *profile, ..usual };
        Self {
            interface: interface.to_owned(),
            sensor,
            feed: Feed::new(config),
            scans: Scans::default(),
            clusters: Vec::new(),
            objects: Vec::new(),
            entries: [0; 2],
            states: Vec::new(),
            version: None,
            profile: *profile,
            first: Vec::new(),
        }
    }

    fn take(&mut self, line: &Line, frame: &CanFrame, message: Message) {
        if self.first.len() < kind::MOST_LINES {
            self.first.push(line.clone());
        }
        let scans = &mut self.scans;
        self.feed.push(line, &mut |scan| scans.take(scan));
        let data = frame.data();
        if data.len() < message.length() {
            return;
        }
        match message {
            Message::ClusterStatus => self.clusters.push(cluster_status::COUNTER.get(word(data))),
            Message::ObjectStatus => self.objects.push(object_status::COUNTER.get(word(data))),
            Message::ClusterGeneral => self.entries[0] += 1,
            Message::ObjectGeneral => self.entries[1] += 1,
            Message::RadarState => self.states.extend(RadarState::read(data)),
            Message::Version => self.version = Version::read(data).or(self.version.take()),
            _ => {}
        }
    }

    fn end(mut self) -> Sensor {
        let Scans { times, entries, odd, only_rcs, watch } = {
            let scans = &mut self.scans;
            self.feed.end(&mut |scan| scans.take(scan));
            std::mem::take(scans)
        };
        let unusable = watch.end();
        let (clusters, objects) = (self.clusters, self.objects);
        Sensor {
            interface: self.interface,
            sensor: self.sensor,
            output: match (clusters.len(), objects.len()) {
                // a filter may leave the status messages out
                (0, 0) if self.entries == [0; 2] => Output::Nothing,
                (0, 0) if self.entries[0] > self.entries[1] => Output::Clusters,
                (c, o) if c > o => Output::Clusters,
                _ => Output::Objects,
            },
            announced: clusters.len() + objects.len(),
            scans: times.len(),
            entries,
            period_ms: Spread::of(times.windows(2).map(|w| w[1].saturating_sub(w[0]) as f64 / 1000.0).collect()),
            counter_step: step(if clusters.len() > objects.len() { &clusters } else { &objects }),
            only_rcs_dbsm: only_rcs
                .map(|rcs| f32::from(rcs) / 2.0)
                .filter(|rcs| *rcs < weak()[1] && entries >= TELLING),
            unusable_share: unusable.as_ref().map_or(0.0, |found| found.frames as f64 / found.of.max(1) as f64),
            unusable: unusable.map(|found| found.said()),
            rather: kind::rather(&self.first.iter().collect::<Vec<_>>(), self.sensor, &self.profile),
            implausible: if entries > 0 { odd as f64 / entries as f64 } else { 0.0 },
            version: self.version.map(|v| v.release.map(|n| n.to_string()).join(".")),
            state: self.states.last().copied(),
            faults: faults(&self.states),
            counters: *self.feed.radar.counters(),
        }
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
pub fn named(c: &Ars408Counters) -> [(&'static str, u32); 14] {
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
        ("unwanted", c.unwanted),
        ("overflow", c.overflow),
    ]
}
