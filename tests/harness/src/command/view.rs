//! `viewshed view`: look at maps in a browser.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
#[cfg(unix)]
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail, ensure};
use viewshed::unit::settings::UnitConfig;
use viewshed::wire::message::Addresses;

use super::key::KeyArgs;
use super::label::open;
use super::options::{SettingsArgs, given};
use super::replay::risk::{quantiser, share};
use super::{complain, print};
use crate::bus::ears::Key;
use crate::bus::listening::Listening;
use crate::bus::logged::{self, Log, Logged};
use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::probability::file::Fitted;
use crate::pages::server::{LOOPBACK, Server};
use crate::pages::view::broadcast::Receiving;
use crate::pages::view::{About, Viewing, recorded};
#[cfg(target_os = "linux")]
use crate::recording::can_log;
#[cfg(unix)]
use crate::recording::serial_log::Chunk;
use crate::recording::{self, Recording, file, ignored};

/// Look at the maps of a recording, of a broadcast's log, or of a unit that is running, in a browser on this machine
///
/// Serves a page at an address that is printed, and opens it: the map from above with occupancy, obstacles, detections
/// and labelled vehicles, figures over time, what is known of a cell, and the map drawn into the camera's picture. Of a
/// recording it shows beside the sender's map the one that a receiver on a CAN FD bus has. `?` in the page lists all keys.
///
///   viewshed view site.mcap             # a recording, played and stepped through
///   viewshed view bus.log               # what viewshed listen reads: a CAN log, or one of a serial line
///   viewshed view --port /dev/ttyUSB0   # a unit behind a serial port, live
///   viewshed view --can can0            # all units on a bus, live
///
/// Nothing is ever sent to a unit or a bus. Ctrl-C ends the server. Only this machine can reach it, with the secret in
/// its address; any number of pages may look at once.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// A recording that viewshed replay takes, or a log of a broadcast that viewshed listen takes
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// Listen to a unit behind this serial port
    #[arg(long, value_name = "PATH", conflicts_with_all = ["file", "can"], help_heading = "Live")]
    port: Option<String>,
    /// Bit rate of the port
    #[arg(long, value_name = "BAUD", default_value_t = UnitConfig::SERVICE_BAUD, requires = "port", conflicts_with_all = ["file", "can"], help_heading = "Live")]
    baud: u32,
    /// Listen to this SocketCAN interface
    #[arg(long, value_name = "INTERFACE", conflicts_with = "file", help_heading = "Live")]
    can: Option<String>,
    /// Sensors on 29-bit identifiers from 0x4000000 on, instead of 0x400 to 0x4FF
    #[arg(long, help_heading = "Broadcast")]
    extended: bool,
    /// Time between two instants of a log, in seconds [default: 0.1]
    #[arg(long, value_name = "SECONDS", value_parser = super::options::seconds, help_heading = "Broadcast")]
    every: Option<f64>,
    /// Print the address and open no browser
    #[arg(long, help_heading = "Page")]
    no_open: bool,
    /// Port of the page; 0 is any that is free
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Page")]
    page_port: u16,
    /// Address of this machine to serve the page at
    ///
    /// Anything but the default lets others reach the page who know its address, over a connection that others can
    /// read; prefer `ssh -L`.
    #[arg(long, value_name = "ADDRESS", default_value_t = LOOPBACK, help_heading = "Page")]
    bind: IpAddr,
    #[command(flatten)]
    key: KeyArgs,
    /// Table of this recording's unit, NAME.probability.toml of `viewshed experiment --calibration --tables`
    ///
    /// A click on a cell then says how often a vehicle there is detected, and what a receiver knows of that.
    #[arg(long, value_name = "FILE", requires = "file", help_heading = "Probability")]
    probability: Option<PathBuf>,
    /// What is sent is visible where at most this share of vehicles is missed, above 0 to below 1
    #[arg(long, value_name = "SHARE", requires = "probability", value_parser = share, help_heading = "Probability")]
    risk: Option<f64>,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// Serves the page until the program is ended.
///
/// # Errors
/// A source that cannot be read, a port that is taken.
pub fn run(args: &Args) -> Result<ExitCode> {
    let addresses = if args.extended { Addresses::EXTENDED } else { Addresses::STANDARD };
    let key = args.key.key()?;
    let settings = args.settings.settings()?;
    let (viewing, says) = match (&args.file, &args.port, &args.can) {
        (Some(path), ..) => from_file(path, args, addresses, key.as_ref(), settings)?,
        (_, Some(port), _) => from_port(port, args, addresses, key.as_ref())?,
        (_, _, Some(interface)) => from_can(interface, args, addresses, key.as_ref())?,
        _ => bail!(
            "say what to look at: FILE, a recording or the log of a broadcast; or what is live, --port PATH or --can INTERFACE"
        ),
    };
    let server = Server::bind(args.bind, args.page_port)?;
    print(&format!("{says}\n{}\nCtrl-C ends the server.\n", server.url()))?;
    if !args.no_open && !open(&server.url()) {
        print("No browser was found: open the address above.\n")?;
    }
    let routes = viewing.routes(&server);
    server.serve(routes).context("the server")?;
    Ok(ExitCode::SUCCESS)
}

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    Recording,
    Log,
    Port,
    Can,
}

impl Args {
    /// The options that are given and ignored, each with what it is for.
    fn ignored(&self, source: Source) -> Vec<String> {
        let of_recordings = if source == Source::Recording { Vec::new() } else { self.settings.given() };
        let of_logs = given([("--every", source != Source::Log && self.every.is_some())]);
        let addressed = matches!(source, Source::Log | Source::Can);
        let of_buses = given([("--extended", !addressed && self.extended)]);
        let of_broadcasts = if source == Source::Recording { self.key.given() } else { Vec::new() };
        [
            (of_recordings, "recordings"),
            (of_logs, "logs of a broadcast"),
            (of_buses, "broadcasts on CAN"),
            (of_broadcasts, "broadcasts"),
        ]
        .into_iter()
        .flat_map(|(options, of)| options.into_iter().map(move |option| ignored::said(option, of)))
        .collect()
    }
}

/// What was found, and what was passed over.
fn told(says: String, ignored: &[String]) -> String {
    [&[says], ignored].concat().join("\n")
}

/// A log of a broadcast if it holds one, else a recording.
fn from_file(
    path: &Path,
    args: &Args,
    addresses: Addresses,
    key: Option<&Key>,
    settings: Settings,
) -> Result<(Arc<Viewing>, String)> {
    let fitted = args.probability.as_ref().map(|path| Fitted::read(path)).transpose()?;
    if let Ok(log) = logged::read(path, None) {
        let mut trial = Listening::new(addresses, key);
        log.lines.iter().for_each(|line| trial.take_logged(line));
        if !trial.sensors().is_empty() {
            ensure!(
                fitted.is_none(),
                "--probability: {} is the log of a broadcast, which says itself what its sender's table is",
                file::shown(path)
            );
            let ignored = args.ignored(Source::Log);
            return Ok(from_log(path, log, Listening::new(addresses, key), args.every, &ignored));
        }
        ensure!(
            trial.not_authentic() == 0,
            "{}: its broadcast is authenticated; give the sender's key with --key-file",
            file::shown(path)
        );
    }
    let radars = recording::read_each(path, &settings.reading).with_context(|| path.display().to_string())?;
    let mut radars: Vec<Recording> = radars.into_iter().map(|(radar, _)| radar).collect();
    let ignored = args.ignored(Source::Recording);
    if let Some(first) = radars.first_mut() {
        let start = first.frames.first().map_or(0, |frame| frame.time_ns);
        ignored.iter().for_each(|said| first.problems.add(ignored::TOPIC, said, start));
    }
    let recording = radars.first().context("no radar")?;
    ensure!(
        recording.of_camera().is_none(),
        "{}: a camera without a radar; `viewshed replay --report` shows what became of its boxes",
        recording.name
    );
    radars.iter().try_for_each(|radar| estimators::usable::check(radar, &settings.estimators))?;
    let table = fitted.map(|fitted| quantiser(fitted, args.risk, recording, &settings)).transpose()?;
    let viewing = Viewing::recording(&radars, path, settings.evaluation.slice_height_m);
    let frames: Vec<String> = radars.iter().map(|radar| radar.frames.len().to_string()).collect();
    let says = told(format!("{}: {} radar frames", file::stem(path), frames.join(" and ")), &ignored);
    let filling = viewing.clone();
    std::thread::spawn(move || {
        if let Err(error) = recorded::fill(&filling.instants, &radars, &settings, table.as_ref()) {
            complain(&error);
            filling.instants.end(format!("failed: {error:#}"));
        }
    });
    Ok((viewing, says))
}

fn from_log(
    path: &Path,
    Log { lines, problems, .. }: Log,
    listening: Listening,
    every_s: Option<f64>,
    ignored: &[String],
) -> (Arc<Viewing>, String) {
    let name = file::shown(path).into_owned();
    let problems = [ignored, &problems].concat();
    let says = told(format!("{name}: {} lines of a broadcast", lines.len()), ignored);
    let viewing = Viewing::broadcast(About::broadcast(name, "log", problems));
    let filling = viewing.clone();
    std::thread::spawn(move || {
        let count = lines.len();
        let outcome = listened(&filling, lines, listening, every_s.unwrap_or(EVERY_S));
        filling.instants.end(match outcome {
            Ok(()) => format!("{count} lines"),
            Err(error) => format!("failed: {error:#}"),
        });
    });
    (viewing, says)
}

/// Time between two instants of a log, unless it is said.
const EVERY_S: f64 = 0.1;

fn listened(viewing: &Viewing, lines: Vec<Logged>, listening: Listening, every_s: f64) -> Result<()> {
    let mut receiving = Receiving::new(listening);
    let every_ns = (every_s * 1e9).max(1e6) as i64;
    let mut next_ns = lines.first().map_or(0, Logged::time_ns) + every_ns;
    for line in &lines {
        // a clock that jumps by hours makes one step, not thousands
        if line.time_ns().abs_diff(next_ns) > 3_600_000_000_000 {
            next_ns = line.time_ns();
        }
        while line.time_ns() >= next_ns {
            receiving.listening.pass(next_ns);
            receiving.look(&viewing.instants)?;
            next_ns += every_ns;
        }
        receiving.take(line);
    }
    receiving.look(&viewing.instants)
}

/// Least time between two instants of what is live: faster ones nobody sees.
#[cfg(unix)]
const LIVE: Duration = Duration::from_millis(30);
/// Longest time between two while nothing comes: maps grow old.
#[cfg(unix)]
const SILENT: Duration = Duration::from_millis(100);

/// Looks at what came, as often as is worth it.
#[cfg(unix)]
struct Live {
    viewing: Arc<Viewing>,
    receiving: Receiving,
    last: Instant,
    /// Something came since.
    is_new: bool,
}

#[cfg(unix)]
impl Live {
    fn new(viewing: Arc<Viewing>, listening: Listening) -> Self {
        Self { viewing, receiving: Receiving::new(listening), last: Instant::now(), is_new: false }
    }

    /// `is_quiet`: nothing more is there to be read right now.
    fn look(&mut self, is_quiet: bool) -> Result<()> {
        let passed = self.last.elapsed();
        if (self.is_new && is_quiet && passed >= LIVE) || passed >= SILENT {
            (self.last, self.is_new) = (Instant::now(), false);
            self.receiving.look(&self.viewing.instants)?;
        }
        Ok(())
    }
}

#[cfg(unix)]
fn now_ns() -> i64 {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(passed.as_nanos()).unwrap_or(i64::MAX)
}

/// The source ends: pages say so, and what was shown stays until the program ends.
#[cfg(unix)]
fn ended(viewing: &Viewing, error: &anyhow::Error) {
    complain(error);
    viewing.instants.end(format!("ended: {error:#}"));
}

#[cfg(unix)]
fn from_port(path: &str, args: &Args, addresses: Addresses, key: Option<&Key>) -> Result<(Arc<Viewing>, String)> {
    use std::io::{ErrorKind, Read};

    let mut port = crate::configure::serial::open_port(path, args.baud)?;
    let ignored = args.ignored(Source::Port);
    let viewing = Viewing::broadcast(About::broadcast(path.to_owned(), "live", ignored.clone()));
    let mut live = Live::new(viewing.clone(), Listening::new(addresses, key));
    let device = path.to_owned();
    std::thread::spawn(move || {
        let mut listen = || -> Result<()> {
            let mut buffer = [0; 4096];
            loop {
                match port.read(&mut buffer) {
                    Ok(n) if n > 0 => {
                        let bytes = buffer[..n].to_vec();
                        let chunk = Chunk { time_ns: now_ns(), device: device.clone(), bytes };
                        live.receiving.take(&Logged::Chunk(chunk));
                        live.is_new = true;
                        // what is not a whole buffer was all there was
                        live.look(n < buffer.len())?;
                    }
                    // it said that there is something to read, and there is nothing: the other side has hung up
                    Ok(_) => bail!("{device}: the port is gone"),
                    Err(e)
                        if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
                    {
                        live.receiving.listening.pass(now_ns());
                        live.look(true)?;
                    }
                    Err(e) => return Err(e).with_context(|| format!("{device}: the port is gone")),
                }
            }
        };
        if let Err(error) = listen() {
            ended(&live.viewing, &error);
        }
    });
    Ok((viewing, told(format!("listening to {path}"), &ignored)))
}

#[cfg(not(unix))]
fn from_port(_: &str, _: &Args, _: Addresses, _: Option<&Key>) -> Result<(Arc<Viewing>, String)> {
    bail!("--port is for Unix; record the line with viewshed bus --log and name the log")
}

#[cfg(target_os = "linux")]
fn from_can(interface: &str, args: &Args, addresses: Addresses, key: Option<&Key>) -> Result<(Arc<Viewing>, String)> {
    let bus = can_log::live::Bus::open(interface)?;
    let ignored = args.ignored(Source::Can);
    let viewing = Viewing::broadcast(About::broadcast(interface.to_owned(), "live", ignored.clone()));
    let mut live = Live::new(viewing.clone(), Listening::new(addresses, key));
    std::thread::spawn(move || {
        let never = std::sync::atomic::AtomicBool::new(false);
        let outcome = bus.listen(None, &never, |heard| {
            match heard {
                can_log::live::Heard::Frame(line) => {
                    live.receiving.take(&Logged::Frame(line));
                    live.is_new = true;
                }
                can_log::live::Heard::Nothing(time_ns) => live.receiving.listening.pass(time_ns),
            }
            live.look(true)
        });
        if let Err(error) = outcome {
            ended(&live.viewing, &error);
        }
    });
    Ok((viewing, told(format!("listening to {interface}"), &ignored)))
}

#[cfg(not(target_os = "linux"))]
fn from_can(_: &str, _: &Args, _: Addresses, _: Option<&Key>) -> Result<(Arc<Viewing>, String)> {
    bail!("--can listens to SocketCAN, which Linux has; record the bus and name the log")
}
