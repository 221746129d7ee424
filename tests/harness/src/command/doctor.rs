//! `viewshed doctor`: what is wrong with a radar's log, and what to do.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

use super::print;
use crate::command::options::KindArgs;
use crate::doctor::examine;
use crate::doctor::findings::Severity;
use crate::recording::{self, ReadOptions};
use crate::results::files::{OutputArgs, Target};

/// Exit code for a log in which something is wrong.
const WRONG: u8 = 1;

/// Say what is on a radar's bus or line, what should be, what is wrong and what to do
///
/// Reads a CAN log of `candump` (with -L, or -t a, d or z), of Vector's tools (ASC) or of SavvyCAN (CSV), or a capture of a
/// TI mmWave radar's data port or of the native format; each also gzipped. Which identifiers were seen and which an ARS408
/// in its mode would send, with their lengths; its scans, counters, settings and faults; and what to do about what is
/// wrong. Exit code 1 if something is wrong, 2 if the log cannot be read.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The log; - reads standard input
    log: PathBuf,
    /// Write everything that was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write every detection of the radar as CSV, as the estimators would be given it
    #[arg(long, value_name = "FILE")]
    detections: Option<PathBuf>,
    /// Only this bus of a CAN log: can0, or the channel of an ASC log
    #[arg(long, value_name = "NAME")]
    interface: Option<String>,
    /// Sensor id for --detections, if there are several
    #[arg(long, value_name = "ID")]
    sensor_id: Option<u8>,
    #[command(flatten)]
    kind: KindArgs,
    #[command(flatten)]
    outputs: OutputArgs,
}

/// Examines one log.
///
/// # Errors
/// Files that cannot be read or written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut outputs = args.outputs.beside(recording::files(&args.log));
    let json = outputs.file("--json", args.json.as_deref())?;
    let detections = outputs.file("--detections", args.detections.as_deref())?;
    let KindArgs { radar: profile, ti_header, ti_dialect } = args.kind;
    let interface = args.interface.clone();
    let options =
        ReadOptions { interface, sensor_id: args.sensor_id, profile, ti_header, ti_dialect, ..Default::default() };
    let report = examine(&args.log, &options)?;
    print(&report.text())?;
    if let Some(file) = json {
        file.write(serde_json::to_string_pretty(&report)? + "\n")?;
    }
    if let Some(file) = detections {
        write_detections(&file, &recording::read(&args.log, &options)?)?;
    }
    let wrong = report.findings().iter().any(|f| f.severity == Severity::Error);
    Ok(if wrong { ExitCode::from(WRONG) } else { ExitCode::SUCCESS })
}

/// One row a detection; a scan without any has a row without values.
fn write_detections(target: &Target, recording: &recording::Recording) -> Result<()> {
    let mut csv = csv::Writer::from_writer(target.create()?);
    csv.write_record([
        "scan",
        "time_s",
        "range_m",
        "azimuth_deg",
        "elevation_deg",
        "radial_velocity_mps",
        "rcs_dbsm",
        "snr_db",
    ])?;
    let some = |v: Option<f32>, digits: usize| v.map_or_else(String::new, |v| format!("{v:.digits$}"));
    for (scan, frame) in recording.frames.iter().enumerate() {
        let time = format!("{}.{:06}", frame.time_ns / 1_000_000_000, frame.time_ns % 1_000_000_000 / 1000);
        if frame.detections.is_empty() {
            csv.write_record([&scan.to_string(), &time, "", "", "", "", "", ""])?;
        }
        for d in &frame.detections {
            csv.write_record([
                scan.to_string(),
                time.clone(),
                format!("{:.2}", d.range_m),
                format!("{:.4}", d.azimuth_rad.to_degrees()),
                some(d.elevation_rad.map(f32::to_degrees), 4),
                format!("{:.2}", d.radial_velocity_mps),
                some(d.rcs_dbsm, 1),
                some(d.snr_db, 1),
            ])?;
        }
    }
    let file = csv.into_inner().map_err(|e| e.into_error());
    file.with_context(|| format!("cannot write {}", target.path().display()))?.finish()
}
