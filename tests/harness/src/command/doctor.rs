//! `viewshed doctor`: what is wrong with a radar's log, and what to do.

use std::path::PathBuf;
use std::process::ExitCode;
#[cfg(target_os = "linux")]
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::print;
use crate::command::options::{KindArgs, seconds as period};
#[cfg(target_os = "linux")]
use crate::command::progress::bar;
use crate::doctor::findings::Severity;
#[cfg(target_os = "linux")]
use crate::doctor::heard;
use crate::doctor::{Examined, examine};
#[cfg(target_os = "linux")]
use crate::recording::can_log::live;
use crate::recording::{self, ReadOptions};
#[cfg(target_os = "linux")]
use crate::results::files::until_ctrl_c;
use crate::results::files::{OutputArgs, Target};

/// Exit code for a log in which something is wrong or doubtful.
const WRONG: u8 = 1;

/// Say what is on a radar's bus or line, what should be, what is wrong and what to do
///
/// Reads a CAN log of `candump` (with -L, or -t a, d or z), of Vector's tools (ASC) or of SavvyCAN or python-can (CSV), or a capture of a
/// TI mmWave radar's data port or of the native format; each also gzipped. Or listens to a bus: `--can can0`. Which identifiers were seen and which an ARS408
/// in its mode would send, with their lengths; its scans, counters, settings and faults; and what to do about what is
/// wrong. Exit code 1 if something is wrong or doubtful, 2 if the log cannot be read.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The log; - reads standard input
    #[arg(value_name = "LOG")]
    log: Option<PathBuf>,
    /// Listen to this SocketCAN interface in place of a log
    #[arg(long, value_name = "INTERFACE", conflicts_with_all = ["log", "detections", "interface"])]
    can: Option<String>,
    /// How long to listen to it, in seconds [default: 10]
    #[arg(long = "for", value_name = "SECONDS", requires = "can", conflicts_with = "log", value_parser = period)]
    seconds: Option<f64>,
    /// Write everything that was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write every detection of the radar as CSV, as the estimators would be given it
    #[arg(long, value_name = "FILE")]
    detections: Option<PathBuf>,
    /// Only this bus of a CAN log: can0, or the channel of an ASC log
    #[arg(long, value_name = "NAME")]
    interface: Option<String>,
    /// Only the sensor with this id, if there are several
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
    let mut outputs = args.outputs.beside(args.log.iter().flat_map(|log| recording::files(log)));
    let json = outputs.file("--json", args.json.as_deref())?;
    let detections = outputs.file("--detections", args.detections.as_deref())?;
    let KindArgs { radar: profile, cluster_states: wanted, ti_header, ti_dialect } = args.kind;
    let interface = args.interface.clone();
    let sensor_id = args.sensor_id;
    let options = ReadOptions { interface, sensor_id, profile, wanted, ti_header, ti_dialect, ..Default::default() };
    let report = match (&args.can, &args.log) {
        (Some(interface), _) => listen(interface, args.seconds.unwrap_or(USUAL_S), &options)?,
        (None, Some(log)) => examine(log, &options)?,
        (None, None) => bail!("say what to examine: LOG, - for standard input, or a bus to listen to: --can INTERFACE"),
    };
    print(&report.text())?;
    if let Some(file) = json {
        file.write(serde_json::to_string_pretty(&report)? + "\n")?;
    }
    if let (Some(file), Some(log)) = (detections, &args.log) {
        write_detections(&file, &recording::read(log, &options)?)?;
    }
    print(&outputs.told())?;
    let wrong = report.findings().iter().any(|f| f.severity <= Severity::Warning);
    Ok(if wrong { ExitCode::from(WRONG) } else { ExitCode::SUCCESS })
}

/// How long a bus is listened to, seconds: everything that a radar says once a second comes several times.
const USUAL_S: f64 = 10.0;

/// What is on a bus now. Ctrl-C ends it early.
#[cfg(target_os = "linux")]
fn listen(interface: &str, seconds: f64, known: &ReadOptions) -> Result<Examined> {
    let bus = live::Bus::open(interface)?;
    let stop = until_ctrl_c().context("Ctrl-C")?;
    let waiting = bar(&format!("listening to {interface} for {seconds} s"), 0);
    let (started, mut lines) = (Instant::now(), Vec::new());
    bus.listen(Some(Duration::from_secs_f64(seconds)), &stop, |heard| {
        if let live::Heard::Frame(line) = heard {
            lines.push(line);
        }
        Ok(())
    })?;
    drop(waiting);
    Ok(heard(interface, started.elapsed().as_secs_f64(), &lines, known))
}

#[cfg(not(target_os = "linux"))]
fn listen(_: &str, _: f64, _: &ReadOptions) -> Result<Examined> {
    bail!("--can listens to SocketCAN, which Linux has; record the bus and name the log")
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
