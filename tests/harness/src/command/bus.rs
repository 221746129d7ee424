//! `viewshed bus`: what a recording's maps cost on a bus.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use clap::builder::PossibleValuesParser;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::code::block::Basis;
use viewshed::wire::code::interval::Form;

use super::key::KeyArgs;
use super::print;
use super::progress::bar;
use super::replay::risk::{quantiser, share};
use super::replay::shipped;
use crate::bus::ears::Key;
use crate::bus::entropy::Entropy;
use crate::bus::load::Load;
use crate::bus::loss::{Arrived, LOSSES};
use crate::bus::report::{Dropped, Report};
use crate::bus::symbols::{self, Symbols};
use crate::bus::traffic::{AUTHENTICATED, BUSES, Maps, Traffic};
use crate::command::options::MapArgs;
use crate::estimators::at_risk;
use crate::evaluation::probability::file::Fitted;
use crate::recording::can_log::{Content, Line};
use crate::recording::serial_log::Chunk;
use crate::recording::{self, file};
use crate::results::files::{OutputArgs, Target};
use crate::results::report::notes;

/// Send a recording's maps over CAN, CAN FD and a serial line and report what they cost
///
/// Every frame the sender sends is counted: maps, header and status, with the stuff bits of its actual
/// bytes and the intermission. Then frames are lost at random, and a receiver's map is compared with the
/// sender's after every scan. With a key, CAN FD and the serial line appear twice: bare and authenticated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings, of any kind that replay reads [default: those shipped in tests/recordings]
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Write what was found as JSON: an object, for several recordings an array
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    /// Write the frames of one bus as `candump -L` does, to be read by viewshed listen and others
    ///
    /// Those of the serial line as `(seconds) device bytes`. With a key they are authenticated.
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    log: Option<PathBuf>,
    /// The bus of --log
    #[arg(
        long,
        value_name = "NAME",
        default_value = "classic-500k",
        requires = "log",
        value_parser = PossibleValuesParser::new(BUSES.map(|bus| bus.name)),
        help_heading = "Results"
    )]
    bus: String,
    /// Send the guaranteed visible range of every azimuth once in this time, too
    #[arg(long, value_name = "MS", help_heading = "Sender")]
    visible_range: Option<u16>,
    /// Send probabilities by this unit's table, NAME.probability.toml of `viewshed experiment --calibration --tables`
    #[arg(long, value_name = "FILE", help_heading = "Sender")]
    probability: Option<PathBuf>,
    /// Send as visible what keeps this risk, the share of vehicles in it that are missed, above 0 to below 1
    #[arg(long, value_name = "SHARE", requires = "probability", value_parser = share, help_heading = "Sender")]
    risk: Option<f64>,
    /// Number of the sensor, which decides the identifiers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..8), help_heading = "Sender")]
    sensor: u8,
    /// Print the code's frequency tables as counted on these recordings, instead
    #[arg(long, conflicts_with_all = ["json", "log"], help_heading = "Results")]
    count_symbols: bool,
    #[command(flatten)]
    key: KeyArgs,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    maps: MapArgs,
}

/// Least time from the first map to the last, seconds: scans come after a receiver has settled, and between the first
/// frame after the quiet of the start and the last one lies a second, the window of a load, also where there is but the
/// status four times a second.
const LEAST_S: f64 = 1.8;

/// Sends one recording after the other.
///
/// # Errors
/// A recording that cannot be read, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.maps.settings()?;
    let paths = if args.recordings.is_empty() { shipped::recordings()? } else { args.recordings.clone() };
    settings.reading.check_for(paths.len())?;
    if args.log.is_some() && paths.len() > 1 {
        bail!("--log writes one recording and {} are to be sent; name one", paths.len());
    }
    let mut outputs = args.outputs.beside(paths.iter().flat_map(|path| recording::files(path)));
    outputs.reads(args.maps.files().chain(args.key.file()).chain(args.probability.clone()));
    let json = outputs.file("--json", args.json.as_deref())?;
    let log = outputs.file("--log", args.log.as_deref())?;
    let key = args.key.key()?;
    let classic = BUSES.iter().any(|bus| bus.name == args.bus && matches!(bus.medium, Medium::Can(_)));
    if key.is_some() && args.log.is_some() && classic {
        bail!("--log: classic CAN has no room for an authenticator; name --bus fd-500k-2M or serial-230400");
    }
    let (mut reports, mut symbols) = (Vec::new(), Symbols::new());
    paths.iter().try_for_each(|path| file::there(path))?;
    for path in &paths {
        let recording = recording::read(path, &settings.reading)?;
        let progress = bar(&format!("replaying {}", recording.name), recording.frames.len() as u64);
        let fitted = args.probability.as_ref().map(|path| Fitted::read(path)).transpose()?;
        let of_unit = fitted.map(|fitted| quantiser(fitted, args.risk, &recording, &settings)).transpose()?;
        let table = of_unit.as_ref().map(|(quantiser, _)| quantiser);
        let maps = Maps::new(&recording, &settings.estimators, table, &|| progress.step())?;
        drop(progress);
        if args.count_symbols {
            count(&mut symbols, &maps);
            continue;
        }
        let report = send(&recording.name, &maps, args, key.as_ref(), log.as_ref())?;
        print(&(report.text() + &notes::problems(&recording).join("\n") + "\n"))?;
        reports.push(report);
    }
    if args.count_symbols {
        print(&symbols.model())?;
    } else if let Some(file) = json {
        let text = match &reports[..] {
            [one] => serde_json::to_string_pretty(one),
            several => serde_json::to_string_pretty(several),
        };
        file.write(text.context("the report as JSON")? + "\n")?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

fn send(name: &str, maps: &Maps, args: &Args, key: Option<&Key>, log: Option<&Target>) -> Result<Report> {
    let span_s = maps.lasts_s();
    ensure!(
        span_s >= LEAST_S,
        "{name}: {span_s:.2} s of maps are too few to say what they cost: a load is of a whole second, and a receiver takes one and a half to settle; {LEAST_S} s are needed"
    );
    let (mut buses, mut received, mut dropped) = (Vec::new(), Vec::new(), Vec::new());
    let logged = if key.is_some() { format!("{}-authenticated", args.bus) } else { args.bus.clone() };
    let authenticated = AUTHENTICATED.into_iter().filter_map(|bus| key.map(|key| (bus, Some(key))));
    for (bus, key) in BUSES.into_iter().map(|bus| (bus, None)).chain(authenticated) {
        let traffic = Traffic::new(maps, bus, args.visible_range, args.sensor, key)?;
        buses.push(Load::new(&traffic));
        // the same frames travel over both classic buses
        if bus.name != "classic-1M" {
            received.extend(LOSSES.map(|loss| Arrived::new(maps, &traffic, loss, args.sensor, key)));
        }
        if traffic.dropped > 0 {
            dropped.push(Dropped { bus: bus.name, azimuths: traffic.dropped, of: traffic.offered });
        }
        if let Some(log) = log.filter(|_| bus.name == logged) {
            write_log(log, &traffic)?;
        }
    }
    Ok(Report {
        recording: name.to_owned(),
        estimator: if args.risk.is_some() { at_risk::NAME.to_owned() } else { maps.estimator.clone() },
        scans: maps.scans.len(),
        scans_per_second: (maps.scans.len() - 1) as f64 / span_s,
        buses,
        received,
        entropy_bytes_per_scan: Entropy::new(maps),
        dropped,
        holes: maps.holes,
    })
}

fn write_log(log: &Target, traffic: &Traffic) -> Result<()> {
    let mut text = String::new();
    for sent in &traffic.sent {
        let time_ns = i64::try_from(sent.at.micros()).unwrap_or(i64::MAX / 1000) * 1000;
        let line = match sent.frame {
            Some(frame) => Line { time_ns, interface: "can0".to_owned(), content: Content::Data(frame) }.to_string(),
            None => {
                let time_ns = time_ns + (sent.duration_s * 1e9) as i64;
                Chunk { time_ns, device: "ttyS0".to_owned(), bytes: sent.bytes.clone() }.to_string()
            }
        };
        writeln!(text, "{line}").context("a line of the log")?;
    }
    log.write(text)
}

/// Scans from one refresh to the next, as a sender does at 15 a second.
const PERIOD: usize = 3;

fn count(symbols: &mut Symbols, maps: &Maps) {
    let mut was = Vec::new();
    // before that there is hardly a map
    for (k, scan) in maps.scans.iter().skip(15).enumerate() {
        let ticks = (k % PERIOD * 10 / 3) as u8;
        if ticks == 0 {
            was.clone_from(&scan.rays);
        }
        let kind = if ticks == 0 { Basis::Refresh } else { Basis::Delta { ticks } };
        symbols.count(&symbols::Scan { now: &scan.rays, was: &was }, Form::CLASSIC, kind, maps.header.usual);
    }
}
