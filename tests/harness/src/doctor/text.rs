//! The report to be read.

use std::collections::BTreeSet;
use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};

use super::can::Identifier;
use super::findings::{Finding, Severity};
use super::sensor::{Sensor, named};
use super::{Report, native, ti};

/// The report of a bus.
pub fn can(report: &Report) -> String {
    let buses: BTreeSet<&str> = report.identifiers.iter().map(|i| i.interface.as_str()).collect();
    let on = match buses.iter().collect::<Vec<_>>()[..] {
        [one] if *one != report.log => format!(" on {one}"),
        _ => String::new(),
    };
    let mut text = format!("{}: {} frames{on} in {:.1} s\n", report.log, report.frames, report.duration_s);
    if !report.identifiers.is_empty() {
        let _ = writeln!(text, "{}", identifiers(&report.identifiers));
    }
    for sensor in &report.sensors {
        text += &sensor_lines(sensor);
    }
    for problem in &report.problems {
        let _ = writeln!(text, "{}: {} ({}x)", problem.topic, problem.what, problem.count);
    }
    text + &findings(&report.findings)
}

/// The report of a TI capture.
pub fn ti(report: &ti::Report) -> String {
    let header = report.header.map_or_else(|| "unknown".into(), |bytes| format!("{bytes} bytes"));
    let mut text = format!(
        "{}: {} bytes, {} frames of TI mmWave, header {header}: {} scans, {} of them empty, {} points\n",
        report.log, report.bytes, report.frames, report.scans, report.empty_scans, report.points
    );
    for (kind, n) in &report.items {
        let _ = writeln!(text, "item of type {kind}: {n}x");
    }
    for (what, n) in report.counters.iter().filter(|(_, n)| **n > 0) {
        let _ = writeln!(text, "{what}: {n}x");
    }
    text + &findings(&report.findings)
}

/// The report of the native format.
pub fn native(report: &native::Report) -> String {
    let mut text = format!("{}: {} messages of the native format\n", report.log, report.messages);
    for s in &report.sensors {
        let _ = write!(
            text,
            "sensor {}: {} messages, {} scans, {} detections",
            s.sensor, s.messages, s.scans, s.detections
        );
        if let Some(p) = s.period_ms {
            let _ = write!(text, ", every {:.1} ms ({:.1} to {:.1})", p.median, p.min, p.max);
        }
        text += "\n";
    }
    text + &findings(&report.findings)
}

fn findings(all: &[Finding]) -> String {
    let mut text = "\n".to_owned();
    if all.is_empty() {
        text += "Nothing is wrong.\n";
    }
    for finding in all {
        let word = match finding.severity {
            Severity::Error => "WRONG",
            Severity::Warning => "doubtful",
            Severity::Note => "note",
        };
        let _ = writeln!(text, "{word}: {}\n    -> {}", finding.what, finding.remedy);
    }
    text
}

fn identifiers(all: &[Identifier]) -> Table {
    // of a log of one bus its name is said once, above
    let several = all.iter().any(|i| i.interface != all[0].interface);
    let bus = |name: &str| several.then(|| name.to_owned());
    let mut table = Table::new();
    table.load_style(presets::UTF8_FULL_CONDENSED);
    let heading = ["id", "message", "sensor", "frames", "per\nsecond", "bytes", "expected"];
    table.set_header(bus("bus").into_iter().chain(heading.map(str::to_owned)));
    for i in all {
        let lengths: Vec<String> = i.lengths.iter().map(ToString::to_string).collect();
        let expected = match (i.expected, i.frames, i.expected_length) {
            (true, 0, _) => "missing".to_owned(),
            (_, _, Some(length)) => format!("{length} bytes"),
            _ => String::new(),
        };
        let figures = [
            i.id.clone(),
            i.message.unwrap_or("").to_owned(),
            i.sensor.map_or_else(String::new, |s| s.to_string()),
            i.frames.to_string(),
            format!("{:.1}", i.rate_hz),
            lengths.join(", "),
            expected,
        ];
        table.add_row(bus(&i.interface).into_iter().chain(figures));
    }
    for column in [2, 3, 4].map(|k| k + usize::from(several)) {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
            column.set_padding((0, 1));
        }
    }
    table
}

/// What a counter of the decoder counts; `None` for frames and scans, which are no flaws.
fn in_words(counter: &str) -> Option<&'static str> {
    Some(match counter {
        "incomplete" => "scans of which some is missing",
        "broken" => "scans of which most is missing",
        "lost" => "scans lost, by their counter",
        "restarts" => "restarts of the radar",
        "too_short" => "frames too short",
        "no_scan" => "entries outside of a scan",
        "repeated" => "entries twice",
        "surplus" => "entries more than announced",
        "unknown_entry" => "entries of another scan",
        "no_range" => "entries at no measurable range",
        "unwanted" => "entries left out by the radar's own marks",
        "overflow" => "entries more than there is room for",
        _ => return None,
    })
}

fn sensor_lines(s: &Sensor) -> String {
    let mut text = format!(
        "sensor {} on {}: {:?}, {} of {} scans, {} entries",
        s.sensor, s.interface, s.output, s.scans, s.announced, s.entries
    );
    if let Some(p) = s.period_ms {
        let _ = write!(text, ", every {:.1} ms ({:.1} to {:.1})", p.median, p.min, p.max);
    }
    if let Some(step) = s.counter_step {
        let _ = write!(text, ", counter in steps of {step}");
    }
    if let Some(version) = &s.version {
        let _ = write!(text, ", software {version}");
    }
    let counted = |(name, n): (&str, u32)| Some((n, in_words(name)?)).filter(|(n, _)| *n > 0);
    let counted = named(&s.counters).into_iter().filter_map(counted).map(|(n, what)| format!("{n} {what}"));
    let counted: Vec<String> = counted.collect();
    if !counted.is_empty() {
        let _ = write!(text, "\n    not used, of {} frames: {}", s.counters.frames, counted.join(", "));
    }
    text + "\n"
}
