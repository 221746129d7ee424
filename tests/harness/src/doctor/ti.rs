//! A capture of a TI mmWave radar's data port.

use std::collections::BTreeMap;

use serde::Serialize;
use viewshed::fixed::time::Time;
use viewshed::inputs::ti::{Entries, Ti, TiConfig, TiDialect, TiFamily, TiOutcome};

use super::findings::{self, Finding, Severity};
use crate::recording::ReadOptions;
use crate::recording::capture::weak;
use crate::recording::judged::Watch;
use crate::recording::ti::{MAGIC, PERIOD_S, feed, flaw, flaws, learn, of_cars, records_of_cars};

/// What is said of a capture.
#[derive(Debug, Serialize)]
pub struct Report {
    pub log: String,
    pub kind: &'static str,
    pub bytes: usize,
    /// Bytes of the header, if it could be learnt.
    pub header: Option<u32>,
    /// Magic words.
    pub frames: usize,
    pub scans: usize,
    pub empty_scans: usize,
    pub points: usize,
    pub points_with_snr: usize,
    /// Items by their type.
    pub items: BTreeMap<u32, usize>,
    /// Frames dropped, by their flaw.
    pub broken: BTreeMap<&'static str, usize>,
    pub counters: BTreeMap<&'static str, u32>,
    pub findings: Vec<Finding>,
}

/// Points that tell that a value never changes.
const TELLING: usize = 50;

/// Judges a capture, by the header and the dialect that are known or else by what can be learnt.
pub fn examine(log: String, bytes: &[u8], known: &ReadOptions) -> Report {
    let family = known.ti_header.or_else(|| learn(bytes));
    let dialect = known.ti_dialect.unwrap_or(TiDialect::USUAL);
    let mut report = Report {
        log,
        kind: "ti",
        bytes: bytes.len(),
        header: family.map(TiFamily::header),
        frames: bytes.windows(MAGIC.len()).filter(|w| *w == MAGIC).count(),
        scans: 0,
        empty_scans: 0,
        points: 0,
        points_with_snr: 0,
        items: family.map(|f| items(bytes, f)).unwrap_or_default(),
        broken: BTreeMap::new(),
        counters: BTreeMap::new(),
        findings: Vec::new(),
    };
    let (mut only_ratio, mut watch) = (None, Watch::default());
    if let Some(family) = family {
        let mut radar = Ti::<1024>::new(TiConfig { family: Some(family), dialect });
        feed(&mut radar, bytes, |outcome| match outcome {
            TiOutcome::Scan(s) => {
                watch.frame(Time::from_micros((report.scans as f64 * PERIOD_S * 1e6) as u64), s.all);
                report.scans += 1;
                report.empty_scans += usize::from(s.detections.is_empty());
                report.points += s.detections.len();
                for ratio in s.detections.iter().filter_map(|d| d.snr_half_db) {
                    report.points_with_snr += 1;
                    let same = report.points_with_snr == 1 || only_ratio == Some(ratio);
                    only_ratio = Some(ratio).filter(|_| same);
                }
            }
            TiOutcome::Broken(why) => *report.broken.entry(flaw(why)).or_default() += 1,
            _ => {}
        });
        report.counters = flaws(radar.counters()).into_iter().collect();
    }
    report.findings = match records_of_cars(bytes) {
        Some(size) => {
            let [what, remedy] = of_cars(size);
            vec![Finding { severity: Severity::Error, what, remedy }]
        }
        None => judge(&report, family, dialect.entries),
    };
    if let Some(raw) = only_ratio.filter(|raw| f32::from(*raw) / 2.0 < weak()[0] && report.points_with_snr >= TELLING) {
        findings::add(
            &mut report.findings,
            Severity::Warning,
            format!(
                "the signal-to-noise ratio of all {} points is {} dB, below the gate: it is not filled",
                report.points_with_snr,
                f32::from(raw) / 2.0
            ),
            "look for the firmware's side information: replays take it as not measured, and a unit knows nothing of the road until then",
        );
    } else if let Some(unusable) = watch.end() {
        findings::add(&mut report.findings, Severity::Warning, unusable.said(), findings::UNUSABLE);
    }
    report
}

/// Types of the items, as far as the frames hold together.
fn items(bytes: &[u8], family: TiFamily) -> BTreeMap<u32, usize> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let mut found = BTreeMap::new();
    let starts = bytes.windows(MAGIC.len()).enumerate().filter(|(_, w)| *w == MAGIC).map(|(at, _)| at);
    for start in starts {
        let (own, count) = match family {
            TiFamily::Bytes48 => (0, word(start + 44).map(|n| n & 0xFFFF)),
            TiFamily::Bytes52 => (0, word(start + 48).map(|n| n & 0xFFFF)),
            _ => (8, word(start + 32)),
        };
        let mut at = start + family.header() as usize;
        for _ in 0..count.unwrap_or(0).min(64) {
            let (Some(kind), Some(length)) = (word(at), word(at + 4)) else { break };
            if length > 1 << 19 {
                break;
            }
            *found.entry(kind as u32).or_default() += 1;
            at += length.max(8 - own) + own;
        }
    }
    found
}

/// What items of a type are, where that helps to say what is missing.
fn is_targets(kind: u32, family: Option<TiFamily>) -> bool {
    matches!((kind, family), (308 | 1010, _) | (7, Some(TiFamily::Bytes48 | TiFamily::Bytes52)))
}

fn judge(report: &Report, family: Option<TiFamily>, entries: Entries) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut add = |severity, what: String, remedy: &str| found.push(Finding { severity, what, remedy: remedy.into() });
    let counted = |what: &str| report.counters.get(what).copied().unwrap_or(0);
    if report.header.is_none() {
        add(
            Severity::Error,
            format!("{} magic words, but no kind of header fits three frames in a row", report.frames),
            "name the header with --ti-header if you know it; else capture the data port, 921600 baud, 8N1, binary, for some seconds with something in view; if frames have no items, switch points on (guiMonitor -1 1 ...)",
        );
        return found;
    }
    if report.scans == 0 {
        add(
            Severity::Error,
            "no frame is whole".into(),
            "check the baud rate of the data port, 921600, and --ti-header if it was given",
        );
    } else if report.points == 0 {
        let items: Vec<String> = report.items.keys().map(ToString::to_string).collect();
        let what = if entries == Entries::Targets { "targets" } else { "points" };
        let tracked = entries == Entries::Points && report.items.keys().any(|kind| is_targets(*kind, family));
        add(
            Severity::Error,
            format!("no {what} in {} frames; items of type {}", report.scans, items.join(", ")),
            if tracked {
                "switch points on, or take the targets that are there with --ti-dialect targets"
            } else {
                "switch points on: the first value after the sub-frame in guiMonitor is 1 or 2. SDK 1 and 2 send Doppler steps, which need the configuration's velocity resolution: --ti-dialect doppler=M/S"
            },
        );
    }
    let broken: usize = report.broken.values().sum();
    if broken > 1 {
        let kinds: Vec<String> = report.broken.iter().map(|(why, n)| format!("{why} ({n})")).collect();
        add(
            Severity::Warning,
            format!("{broken} frames are damaged: {}", kinds.join(", ")),
            "bytes are lost: use flow control or a larger buffer, a shorter cable, fewer heat maps, a lower frame rate",
        );
    }
    if counted("frame that never came, by its number") > 0 {
        add(
            Severity::Warning,
            format!("{} frames never came, by their number", counted("frame that never came, by its number")),
            "the line is too slow for what is sent: switch profiles and heat maps off in guiMonitor",
        );
    }
    if counted("byte outside of frames") > 0 {
        add(
            Severity::Note,
            format!("{} bytes outside of frames", counted("byte outside of frames")),
            "at the start of a capture they are the rest of a frame; else check baud rate and that nothing else writes to the data port",
        );
    }
    if entries == Entries::Points && report.points > 0 && report.points_with_snr * 2 < report.points {
        add(
            Severity::Note,
            "points come without a signal-to-noise ratio".into(),
            "switch side information on (guiMonitor with 1, not 2), so that weak points can be gated",
        );
    }
    found.sort_by_key(|f| f.severity);
    found
}
