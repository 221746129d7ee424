//! The native format, on a serial line or in CAN FD frames.

use std::collections::BTreeMap;

use serde::Serialize;

use super::findings::UNUSABLE;
use super::findings::{Finding, Severity};
use super::sensor::Spread;
use crate::recording::judged::Watch;
use crate::recording::native::{Messages, flaws, scans, sensors};

/// What is said of a capture.
#[derive(Debug, Serialize)]
pub struct Report {
    pub log: String,
    pub kind: &'static str,
    pub messages: usize,
    /// Messages too long or cut.
    pub framing_errors: u32,
    pub sensors: Vec<Sensor>,
    pub findings: Vec<Finding>,
}

/// One sensor.
#[derive(Debug, Serialize)]
pub struct Sensor {
    pub sensor: u8,
    pub messages: usize,
    pub scans: usize,
    pub detections: usize,
    pub period_ms: Option<Spread>,
    pub faults: usize,
    /// What a unit concludes of points that come again and are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unusable: Option<String>,
    pub counters: BTreeMap<&'static str, u32>,
}

/// Judges messages.
pub fn examine(log: String, messages: &Messages, framing_errors: u32) -> Report {
    let found = sensors(messages);
    let one = |(&sensor, &n): (&u8, &usize)| {
        let (mut times, mut detections, mut faults) = (Vec::new(), 0, 0);
        let mut watch = Watch::default();
        let counters = scans(sensor, messages, |scan| {
            times.push(scan.time.micros());
            watch.frame(scan.time, scan.all);
            detections += scan.detections.len();
            faults += usize::from(scan.fault);
        });
        let mut counters: BTreeMap<_, _> = flaws(&counters, 0).into_iter().collect();
        // what does not pass this sensor's check may be another's
        counters.remove("message damaged, refused");
        let periods = times.windows(2).map(|w| w[1].saturating_sub(w[0]) as f64 / 1000.0).collect();
        let (period_ms, unusable) = (Spread::of(periods), watch.end().map(|found| found.said()));
        Sensor { sensor, messages: n, scans: times.len(), detections, period_ms, faults, unusable, counters }
    };
    let known: usize = found.values().sum();
    let sensors: Vec<Sensor> = found.iter().map(one).collect();
    let mut findings = Vec::new();
    let mut add =
        |severity, what: String, remedy: &str| findings.push(Finding { severity, what, remedy: remedy.into() });
    if known < messages.len() {
        add(
            Severity::Warning,
            format!("{} messages are damaged or of another kind", messages.len() - known),
            "check baud rate and wiring; broadcasts of visibility on the same line are no scans",
        );
    }
    if framing_errors > 1 {
        add(
            Severity::Warning,
            format!("{framing_errors} messages are too long or cut"),
            "bytes are lost: use flow control or a larger buffer",
        );
    }
    for s in &sensors {
        if let Some(unusable) = &s.unusable {
            add(Severity::Warning, format!("sensor {}: {unusable}", s.sensor), UNUSABLE);
        }
        for (what, n) in s.counters.iter().filter(|(_, n)| **n > 0) {
            add(
                Severity::Warning,
                format!("sensor {}: {what} ({n}x)", s.sensor),
                "bytes or frames are lost: a larger buffer, a faster line",
            );
        }
        if s.faults > 0 {
            add(
                Severity::Error,
                format!("sensor {} reports a fault in {} scans", s.sensor, s.faults),
                "see the radar's own state",
            );
        }
        if s.scans == 0 {
            add(Severity::Error, format!("sensor {}: no whole scan", s.sensor), "record for longer than a scan takes");
        }
    }
    findings.sort_by_key(|f| f.severity);
    Report { log, kind: "native", messages: messages.len(), framing_errors, sensors, findings }
}
