//! What is wrong, and what to do.

use std::collections::BTreeSet;

use serde::Serialize;
use viewshed::inputs::ars408::configuration::Ars408Configuration;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::motion::standing;
use viewshed::wire::frame::CanFrame;

use super::can::Bus;
use super::sensor::{Output, Sensor};
use super::{LIVE, Report};
use crate::recording::kind;

/// How much it matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// There is no usable input until it is mended.
    Error,
    /// The input is worse than it could be.
    Warning,
    /// Good to know.
    Note,
}

/// One thing that is wrong or worth knowing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    pub severity: Severity,
    pub what: String,
    #[serde(rename = "do")]
    pub remedy: String,
}

/// What to do about points of which nothing is known.
pub const UNUSABLE: &str =
    "compare with the vehicles on the road: a unit says that its radar is unusable until they pass";

/// Frames of 8 bytes that fit into a second of 500 kbit/s, stuff bits included.
const MOST_FRAMES: usize = 3700;

/// A log that tells what a radar leaves out, seconds: it says some of it once a second.
const LEAST_S: f64 = 1.5;

#[derive(Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn add(&mut self, severity: Severity, what: impl Into<String>, remedy: impl Into<String>) {
        self.0.push(Finding { severity, what: what.into(), remedy: remedy.into() });
    }
}

/// Everything found, the worst first.
pub fn judge(report: &Report, heard: &Bus) -> Vec<Finding> {
    let mut found = Findings::default();
    bus(&mut found, report, heard);
    for sensor in &report.sensors {
        scans(&mut found, sensor, report);
        settings(&mut found, sensor);
        faults(&mut found, sensor);
        told_motion(&mut found, sensor, heard);
    }
    lengths(&mut found, report);
    found.0.sort_by_key(|f| f.severity);
    found.0
}

/// Adds one to those found, in its place.
pub fn add(found: &mut Vec<Finding>, severity: Severity, what: String, remedy: &str) {
    found.push(Finding { severity, what, remedy: remedy.into() });
    found.sort_by_key(|f| f.severity);
}

/// What is said of a bus on which nothing came.
pub fn silence(seconds: f64) -> Finding {
    Finding {
        severity: Severity::Error,
        what: format!("no frame came within {seconds:.1} s"),
        remedy: "check that this is the radar's bus, its supply, 500 kbit/s on both sides, and termination at both ends (the radar has none of its own)".into(),
    }
}

/// Whether the log's clock steps back, or the log begins again.
fn runs_backwards(report: &Report) -> bool {
    report.problems.iter().any(|p| p.what == "time runs backwards")
}

fn bus(found: &mut Findings, report: &Report, heard: &Bus) {
    if report.duration_s < LEAST_S {
        found.add(
            Severity::Warning,
            format!("the log lasts {:.1} s, which is too short to say what is missing", report.duration_s),
            if report.kind == LIVE {
                "listen for ten seconds or more (--for 10)"
            } else {
                "record ten seconds or more"
            },
        );
    }
    let problems: u64 = report.problems.iter().filter(|p| p.what.starts_with("line skipped")).map(|p| p.count).sum();
    let sorted =
        |what: &str| what.contains("in the order of time") || what.contains("before 0") || what.contains("minus");
    for problem in report.problems.iter().filter(|p| sorted(&p.what)) {
        found.add(
            Severity::Note,
            format!("{}: {} ({}x)", problem.topic, problem.what, problem.count),
            "nothing for this report; where the log came from its times are not as they should be",
        );
    }
    if problems > 0 {
        found.add(
            Severity::Warning,
            format!("{problems} lines of the log are no frames"),
            "record with `candump -L`, and cut whole lines",
        );
    }
    if runs_backwards(report) {
        found.add(
            Severity::Warning,
            "time runs backwards in the log",
            "record one bus a log, and let no clock be set while recording",
        );
    }
    for (class, n) in &heard.errors {
        let (what, remedy) = match *class {
            c if c & 0x40 != 0 => ("the controller went off the bus", "check bit rate, wiring and termination"),
            c if c & 0x20 != 0 => ("frames are not acknowledged", "a second node must be on the bus, awake"),
            c if c & 0x04 != 0 => {
                ("the controller reports errors (overrun, warning or passive level)", "check load, wiring and bit rate")
            }
            _ => ("the bus reports errors", "check bit rate, wiring and termination"),
        };
        found.add(Severity::Error, format!("{what}: {n} error frames of class {class:03X}"), remedy);
    }
    let broadcasters = &heard.broadcasters;
    if report.sensors.is_empty() && !broadcasters.is_empty() {
        found.add(
            Severity::Note,
            "no radar is on this bus, but the visibility broadcast of a unit",
            "`viewshed listen` shows its maps",
        );
    } else if report.sensors.is_empty() && (report.frames == 0 || problems > report.frames as u64) {
        // what was not understood says nothing of the bus
        found.add(
            Severity::Error,
            format!(
                "the log could not be understood: of its lines {} are frames and {problems} are not",
                report.frames
            ),
            "the lines above say why; record with `candump -L`, or export as Vector ASC",
        );
    } else if report.sensors.is_empty() {
        let seen: Vec<&str> = report.identifiers.iter().map(|i| i.id.as_str()).collect();
        let listed = match &seen[..] {
            [] => "no identifier at all".to_owned(),
            some if some.len() > 20 => format!("{} identifiers, {} to {}", some.len(), some[0], some[some.len() - 1]),
            some => format!("identifiers {}", some.join(", ")),
        };
        found.add(
            Severity::Error,
            format!("nothing of an ARS408 or its kin was heard; seen: {listed}"),
            "check that this is the radar's bus, its supply, 500 kbit/s on both sides, and termination at both ends (the radar has none of its own)",
        );
    }
    marked(found, heard);
    if report.sensors.len() > 1 {
        let ids: BTreeSet<u8> = report.sensors.iter().map(|s| s.sensor).collect();
        let listed: Vec<String> = report.sensors.iter().map(|s| format!("{} on {}", s.sensor, s.interface)).collect();
        found.add(
            Severity::Note,
            format!("several sensors: {}", listed.join(", ")),
            if ids.len() > 1 {
                "`viewshed replay --sensor-id ID` reads one of them"
            } else {
                "`viewshed replay` reads the interface with more frames"
            },
        );
    }
    let ours = heard.broadcasts;
    if !broadcasters.is_empty() {
        let listed: Vec<String> = broadcasters.iter().map(u8::to_string).collect();
        found.add(
            Severity::Note,
            format!("{ours} frames on 400 to 4FF, and visibility is broadcast there by sensor {}", listed.join(", ")),
            "`viewshed listen` shows its maps",
        );
    } else if ours > 0 {
        found.add(
            Severity::Note,
            format!("{ours} frames on 400 to 4FF, where visibility is broadcast by default"),
            "nothing, if they are; another device there would be taken for a damaged broadcast",
        );
    }
}

/// Frames of a radar that are not as it sends them.
fn marked(found: &mut Findings, heard: &Bus) {
    if heard.extended > 0 {
        found.add(
            Severity::Warning,
            format!("{} frames have a radar's identifier in 29 bits", heard.extended),
            "the radar uses 11 bits: set gateway or adapter to standard frames",
        );
    }
    if heard.flexible > 0 {
        found.add(
            Severity::Warning,
            format!("{} frames have a radar's identifier and are marked as CAN FD", heard.flexible),
            "the radar sends classic frames, and a unit takes no others: set gateway or adapter to classic CAN; of a log they are read",
        );
    }
}

fn scans(found: &mut Findings, sensor: &Sensor, report: &Report) {
    let (name, c) = (of(sensor), &sensor.counters);
    if sensor.announced == 0 && sensor.output != Output::Nothing {
        let status = if sensor.output == Output::Clusters { Message::ClusterStatus } else { Message::ObjectStatus };
        found.add(
            Severity::Error,
            format!(
                "{name}: {:03X} ({}) is missing: entries come, and the status message that begins each scan does not",
                status.id(sensor.sensor).raw(),
                status.name()
            ),
            "let the log or the gateway pass it: a filter on identifiers leaves it out",
        );
        return;
    }
    if sensor.announced == 0 {
        let heard = match sensor.state.map(|s| s.output) {
            Some(output) => format!(
                "it says its output is {}",
                output.map_or("of an unknown kind".into(), |o| format!("{o:?}").to_lowercase())
            ),
            None => "and no state message either".into(),
        };
        found.add(
            Severity::Error,
            format!("{name} is there but sends no scans; {heard}"),
            format!("switch clusters on, and read 2{}1 back: {}", sensor.sensor, clusters(sensor)),
        );
        return;
    }
    // what is missing and odd by the wrong scales is no more than a consequence
    if let Some(rather) = &sensor.rather {
        found.add(
            Severity::Error,
            kind::said(&name, report.profile, rather),
            format!("read it with --radar {}, here and in `viewshed replay`, and compare distances", rather.0),
        );
        return;
    }
    if sensor.scans == 0 {
        found.add(
            Severity::Error,
            format!("{name} announces {} scans and none is complete", sensor.announced),
            "its entries do not arrive: record without filters on identifiers, and check the receive queue",
        );
    }
    let full = format!(
        "give the receiver a longer queue; the busiest second has {} frames of about {MOST_FRAMES} that 500 kbit/s carries",
        report.busiest_second
    );
    for (n, what) in [
        (c.incomplete, "scans miss entries or qualities"),
        (c.broken, "scans miss most of their entries and are dropped"),
        (c.lost, "scans never came, by the radar's counter"),
        (c.no_scan, "entries came without a status message"),
    ] {
        let severity = match n {
            // a log may begin and end within a scan
            0..=2 => Severity::Note,
            // of so little no map is made
            n if 3 * u64::from(n) >= sensor.announced as u64 => Severity::Error,
            _ => Severity::Warning,
        };
        if n > 0 {
            found.add(severity, format!("{name}: {n} {what}"), full.clone());
        }
    }
    // of a log that begins again so does the radar's counter
    if c.restarts > 0 && !runs_backwards(report) {
        found.add(Severity::Warning, format!("{name} started over {} times", c.restarts), "check its supply");
    }
    if c.surplus > 0 {
        found.add(
            Severity::Warning,
            format!("{name}: {} entries came beyond those that the status messages announce", c.surplus),
            "nothing for the map: from the third such scan on they are taken. A gateway or clone that counts wrongly, or two devices with one sensor id",
        );
    }
    if c.repeated > 0 {
        found.add(
            Severity::Warning,
            format!("{name}: {} entries or status messages came twice", c.repeated),
            "two devices with one sensor id, or a log with every frame twice: give each sensor an id of its own (2x0, SensorID)",
        );
    }
    if let Some(period) = sensor.period_ms.filter(|p| !(40.0..=150.0).contains(&p.median)) {
        found.add(
            Severity::Warning,
            format!("{name}: a scan every {:.0} ms; an ARS408 sends one about every 70", period.median),
            "check the time stamps of the log",
        );
    }
    if let Some(rcs) = sensor.only_rcs_dbsm {
        found.add(
            Severity::Warning,
            format!("{name}: the RCS of all {} entries is {rcs} dBsm: it is not filled", sensor.entries),
            "look for the gateway's or the clone's settings: replays take it as not measured, and a unit knows nothing of the road until then",
        );
    } else if let Some(unusable) = &sensor.unusable {
        found.add(
            if sensor.unusable_share > 0.5 { Severity::Error } else { Severity::Warning },
            format!("{name}: {unusable}"),
            UNUSABLE,
        );
    }
    if sensor.implausible > 0.2 {
        found.add(
            Severity::Warning,
            format!("{name}: {:.0} % of its entries lie beyond 260 m or behind it", 100.0 * sensor.implausible),
            "a clone with scales that are not known here? Compare distances with the truth",
        );
    }
}

fn settings(found: &mut Findings, sensor: &Sensor) {
    let name = of(sensor);
    if sensor.output == Output::Objects {
        found.add(
            Severity::Note,
            format!("{name} sends objects, which it has tracked and thinned out"),
            format!("clusters show more of what hides what: {}", clusters(sensor)),
        );
    }
    let Some(state) = sensor.state else {
        if sensor.announced > 0 {
            found.add(
                Severity::Warning,
                format!("{name} sends no state (2{}1): neither faults nor settings are known", sensor.sensor),
                "let the log or the gateway pass it",
            );
        }
        return;
    };
    if state.sensor_id != sensor.sensor {
        found.add(
            Severity::Warning,
            format!("{name} says that its id is {}", state.sensor_id),
            "a new id takes effect at the next start: power it off and on",
        );
    }
    if !state.quality && sensor.output != Output::Nothing {
        found.add(
            Severity::Warning,
            format!(
                "{name} sends no quality: predicted, ambiguous and invalid entries cannot be told from measured ones"
            ),
            format!("switch it on: {}", clusters(sensor)),
        );
    }
}

fn faults(found: &mut Findings, sensor: &Sensor) {
    let name = of(sensor);
    for (fault, n) in &sensor.faults {
        let (severity, remedy) = match *fault {
            "interference" => {
                (Severity::Warning, "another radar of the band faces it: turn one, or set another frequency".to_owned())
            }
            "speed missing" | "yaw rate missing" => {
                let frames: Vec<String> = standing(sensor.sensor).map(|f| cansend(sensor, &f)).collect();
                (Severity::Warning, format!("tell it every 50 ms that it stands: {}", frames.join(" and ")))
            }
            "supply voltage" => (Severity::Error, "it wants 8 to 32 V at its plug, under load".to_owned()),
            "temperature" => (Severity::Error, "let it cool; shade it".to_owned()),
            _ => (Severity::Error, "power it off and on; if it stays, replace it".to_owned()),
        };
        found.add(severity, format!("{name} reports {fault} in {n} state messages"), remedy);
    }
}

/// A fixed sensor that is told it moves.
fn told_motion(found: &mut Findings, sensor: &Sensor, heard: &Bus) {
    let fastest = heard.told_cm_s.get(&(sensor.interface.clone(), sensor.sensor)).copied().unwrap_or(0);
    if fastest > 0 {
        found.add(
            if fastest > 50 { Severity::Warning } else { Severity::Note },
            format!("{} is told that it moves, at up to {:.2} m/s", of(sensor), f64::from(fastest) / 100.0),
            "a fixed radar is to be told that it stands; velocities of a moving one are wrong here",
        );
    }
}

fn lengths(found: &mut Findings, report: &Report) {
    for i in &report.identifiers {
        let (Some(expected), Some(message)) = (i.expected_length, i.message) else { continue };
        if i.lengths.iter().any(|l| *l < expected) {
            found.add(
                Severity::Error,
                format!("{} ({message}) comes with {} bytes, and {expected} are needed", i.id, listed(&i.lengths)),
                "another device uses this identifier, or a gateway cuts it",
            );
        } else if i.lengths.iter().any(|l| *l > expected) {
            found.add(
                Severity::Note,
                format!(
                    "{} ({message}) comes with {} bytes, of which the first {expected} are read",
                    i.id,
                    listed(&i.lengths)
                ),
                "nothing has to be done: the bytes behind mean nothing to a radar",
            );
        }
        if i.expected && i.frames == 0 && !matches!(message, "SpeedInformation" | "YawRateInformation") {
            found.add(
                Severity::Warning,
                format!("{} ({message}) was expected and not seen", i.id),
                "let the log or the gateway pass it",
            );
        }
    }
}

/// Lengths in words: "2 or 8".
fn listed(lengths: &[usize]) -> String {
    lengths.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or ")
}

/// The line that switches clusters on.
fn clusters(sensor: &Sensor) -> String {
    Ars408Configuration::CLUSTERS.frame(sensor.sensor).map_or_else(String::new, |f| cansend(sensor, &f))
}

/// A line for a shell that sends a frame. Where the log numbers its buses, that of SocketCAN's first.
fn cansend(sensor: &Sensor, frame: &CanFrame) -> String {
    let named = sensor.interface.starts_with(|c: char| c.is_ascii_alphabetic());
    let interface = if named { &sensor.interface } else { "can0" };
    format!("`cansend {interface} {frame:?}`")
}

fn of(sensor: &Sensor) -> String {
    format!("sensor {} on {}", sensor.sensor, sensor.interface)
}
