//! `viewshed listen`: a log of a bus in, the maps on it out.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use viewshed::wire::message::Addresses;

use super::key::KeyArgs;
use super::print;
use crate::bus::listening::{Heard, Listening, Moment, SENSORS, shown};
use crate::recording::can_log::{self, FORMATS, Format, Line};
use crate::recording::problems::Problems;
use crate::recording::serial_log::Chunk;
use crate::recording::{file, foreign};
use crate::results::files::{Folder, OutputArgs, Target};
use crate::results::pictures::polar::{self, PolarGrid};

/// Decode the maps that sensors broadcast in a CAN log, or in one of a serial line by viewshed bus
///
/// Prints what every sensor says of itself, what happened to its frames, and what its maps show. With a key
/// only authentic messages count, without one only those that are not authenticated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// CAN log of `candump` (with -L, or -t a, d or z), Vector ASC or SavvyCAN CSV, or one of a serial line by viewshed bus
    /// --log; each also gzipped; - reads standard input
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Only this bus of a CAN log: can0, or the channel of an ASC log [default: all]
    #[arg(long, value_name = "NAME")]
    interface: Option<String>,
    /// Write what was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a picture of every sensor's map into this folder now and then
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Time between two looks at the maps, in seconds of the log
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    every: f64,
    /// Sensors on 29-bit identifiers from 0x4000000 on, instead of 0x400 to 0x4FF
    #[arg(long)]
    extended: bool,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    key: KeyArgs,
}

/// Listens to a log.
///
/// # Errors
/// A log that cannot be read, or holds no broadcast.
pub fn run(args: &Args) -> Result<ExitCode> {
    if args.every.is_nan() || args.every <= 0.0 {
        bail!("--every {} is not above 0", args.every);
    }
    let (logged, unread) = logged(&args.log, args.interface.as_deref())?;
    let mut outputs = args.outputs.beside([args.log.clone()].into_iter().chain(args.key.file()));
    let json = outputs.file("--json", args.json.as_deref())?;
    let pictures = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    let addresses = if args.extended { Addresses::EXTENDED } else { Addresses::STANDARD };
    let key = args.key.key()?;
    let mut listening = Listening::new(addresses, key.as_ref());
    let mut maps: Vec<Vec<Moment>> = vec![Vec::new(); usize::from(SENSORS)];
    let mut next = None;
    let every_ns = (args.every * 1e9) as i64;
    for logged in &logged {
        let time_ns = match logged {
            Logged::Frame(line) => line.time_ns,
            Logged::Chunk(chunk) => chunk.time_ns,
        };
        let due = *next.get_or_insert(time_ns + every_ns);
        if time_ns >= due {
            look(&listening, &mut maps, pictures.as_ref())?;
            next = Some(due + (time_ns - due) / every_ns * every_ns + every_ns);
        }
        match logged {
            Logged::Frame(line) => listening.take(line),
            Logged::Chunk(chunk) => listening.take_bytes(chunk),
        }
    }
    look(&listening, &mut maps, pictures.as_ref())?;
    let sensors: Vec<Heard> = listening
        .sensors()
        .into_iter()
        .filter_map(|n| listening.heard(n, std::mem::take(&mut maps[usize::from(n)])))
        .collect();
    if sensors.is_empty() {
        let (log, frames, not_authentic) = (file::shown(&args.log), listening.frames(), listening.not_authentic());
        match (not_authentic, key) {
            (0, _) => bail!("{log}: none of its {frames} frames is of a broadcast"),
            (n, None) => {
                bail!("{log}: {n} of its {frames} frames are authenticated; give the sender's key with --key-file")
            }
            (n, Some(_)) => {
                bail!("{log}: {n} of its {frames} frames are of a broadcast, and none is authentic with this key")
            }
        }
    }
    print(&report(&sensors, &listening, unread))?;
    if let Some(file) = json {
        let report = serde_json::json!({
            "frames": listening.frames(),
            "foreign": listening.foreign(),
            "lines_not_read": unread,
            "sensors": sensors,
        });
        file.write(serde_json::to_string_pretty(&report).context("the report as JSON")? + "\n")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A line of a log.
enum Logged {
    Frame(Line),
    Chunk(Chunk),
}

/// The lines of a log, and how many are none.
fn logged(path: &Path, interface: Option<&str>) -> Result<(Vec<Logged>, u64)> {
    let bytes = file::bytes(path)?;
    if let Some(format) = Format::of(&bytes) {
        let mut problems = Problems::default();
        let lines = can_log::read(&bytes, format, interface, &mut problems)?;
        return Ok((lines.into_iter().map(Logged::Frame).collect(), problems.count("line skipped")));
    }
    let text = String::from_utf8_lossy(&bytes);
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    let (mut chunks, mut unread) = (Vec::new(), 0);
    for line in lines {
        match Chunk::parse(line) {
            Ok(chunk) => chunks.push(Logged::Chunk(chunk)),
            Err(_) => unread += 1,
        }
    }
    if chunks.is_empty() {
        let why = foreign::named(&bytes).unwrap_or_else(|| format!("it is no log of {FORMATS}, nor of a serial line"));
        bail!("{} cannot be read: {why}", file::shown(path));
    }
    Ok((chunks, unread))
}

/// Counts, and draws, every sensor's map as it is now.
fn look(listening: &Listening, maps: &mut [Vec<Moment>], out: Option<&Folder>) -> Result<()> {
    for sensor in listening.sensors() {
        let Some(moment) = listening.moment(sensor) else { continue };
        if let Some(folder) = out {
            let name = format!("sensor-{sensor}-{:04}.png", maps[usize::from(sensor)].len());
            draw(listening, sensor, moment.time_s, &folder.file(name)?)?;
        }
        maps[usize::from(sensor)].push(moment);
    }
    Ok(())
}

fn draw(listening: &Listening, sensor: u8, time_s: f64, target: &Target) -> Result<()> {
    let map = listening.map(sensor);
    let Some(header) = map.header() else { return Ok(()) };
    let right = f64::from(header.azimuth_origin.radians());
    let span = f64::from(header.azimuth_span) / 65536.0 * std::f64::consts::TAU;
    let grid = PolarGrid {
        azimuths: usize::from(header.azimuths),
        ranges: usize::from(header.ranges),
        azimuth_rad: [right, right + span],
        range_m: [0.0, f64::from(header.ranges) * f64::from(header.cell_cm) / 100.0],
        state: &|azimuth, range| shown(&map, azimuth, range),
        title: format!("sensor {sensor} as received, {time_s:.3} s"),
        caption: None,
    };
    polar::draw(&grid).save(target)
}

fn report(sensors: &[Heard], listening: &Listening, unread: u64) -> String {
    let mut text = String::new();
    for heard in sensors {
        let _ = writeln!(text, "sensor {}: {}", heard.sensor, heard.condition);
        if let Some(h) = &heard.header {
            let _ = writeln!(
                text,
                "  mounted at x {:.2} m, y {:.2} m, {:.2} m above the road, yaw {:.2}, pitch {:.2}, roll {:.2} degrees\n  \
                 {} azimuths from {:.2} to {:.2} degrees, {} ranges of {} m; configuration {:08X}",
                h.x_m,
                h.y_m,
                h.height_m,
                h.yaw_deg,
                h.pitch_deg,
                h.roll_deg,
                h.azimuths,
                h.azimuth_deg[0],
                h.azimuth_deg[1],
                h.ranges,
                h.cell_m,
                h.fingerprint
            );
        }
        if let Some(s) = &heard.status {
            let _ = writeln!(
                text,
                "  state {} ({}), up for {} s, firmware {}.{}.{}, wire version {}; lost from the radar {}, dropped {}, \
                 E2E errors {}, bus-off {}",
                s.state,
                s.reason,
                s.uptime_s,
                s.firmware[0],
                s.firmware[1],
                s.firmware[2],
                s.wire_version,
                s.radar_lost,
                s.dropped,
                s.e2e_errors,
                s.bus_off
            );
        }
        let c = &heard.counters;
        let _ = writeln!(
            text,
            "  frames: {} used; {} failed the protection, {} not authentic, {} missing by their counters, {} repeated, {} out of sequence, \
             {} late, {} of another epoch, {} before their header or refresh, {} malformed",
            c.accepted,
            c.protection,
            c.not_authentic,
            c.lost,
            c.repeated,
            c.out_of_sequence,
            c.late,
            c.epoch,
            c.early,
            c.malformed
        );
        if let Some(m) = heard.maps.last() {
            let all = (m.visible + m.invisible + m.unknown).max(1) as f64;
            let share = |n: usize| 100.0 * n as f64 / all;
            let _ = writeln!(
                text,
                "  {} looks at its map; the last: {:.1} % of the cells visible, {:.1} % not, {:.1} % unknown",
                heard.maps.len(),
                share(m.visible),
                share(m.invisible),
                share(m.unknown)
            );
        }
    }
    let _ = writeln!(text, "{} frames, {} of others", listening.frames(), listening.foreign());
    if unread > 0 {
        let _ = writeln!(text, "{unread} lines are no frames");
    }
    text
}
