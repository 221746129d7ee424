//! The report to be read.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};

use super::can::Identifier;
use super::findings::{Finding, Severity};
use super::sensor::{Sensor, named};
use super::{Report, native, ti};

/// The report of a bus.
pub fn can(report: &Report) -> String {
    let mut text = format!("{}: {} frames in {:.1} s\n", report.log, report.frames, report.duration_s);
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
    let mut table = Table::new();
    table.load_style(presets::UTF8_FULL_CONDENSED);
    table.set_header(["interface", "id", "message", "sensor", "frames", "per second", "bytes", "expected"]);
    for i in all {
        let lengths: Vec<String> = i.lengths.iter().map(ToString::to_string).collect();
        let expected = match (i.expected, i.frames, i.expected_length) {
            (true, 0, _) => "missing".to_owned(),
            (_, _, Some(length)) => format!("{length} bytes"),
            _ => String::new(),
        };
        table.add_row([
            i.interface.clone(),
            i.id.clone(),
            i.message.unwrap_or("").to_owned(),
            i.sensor.map_or_else(String::new, |s| s.to_string()),
            i.frames.to_string(),
            format!("{:.1}", i.rate_hz),
            lengths.join(", "),
            expected,
        ]);
    }
    for column in [4, 5] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
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
    let counted: Vec<String> =
        named(&s.counters).iter().skip(2).filter(|(_, n)| *n > 0).map(|(name, n)| format!("{name} {n}")).collect();
    if !counted.is_empty() {
        let _ = write!(text, "; {}", counted.join(", "));
    }
    text + "\n"
}
