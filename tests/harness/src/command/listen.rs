//! `viewshed listen`: a log of a bus in, the maps on it out.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
#[cfg(target_os = "linux")]
use std::time::Duration;

use anyhow::{Context, Result, bail};
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::message::{Addresses, Plane};

use super::key::KeyArgs;
use super::options::seconds;
use super::print;
use crate::bus::listening::{Counted, Heard, Listening, Map, Moment, SENSORS, StatusSeen, as_sent, shown};
use crate::bus::logged::{self, Log, Logged};
use crate::geometry::azimuths;
use crate::geometry::pose::SensorPose;
use crate::recording::FieldOfView;
use crate::recording::can_log;
use crate::recording::file;
#[cfg(target_os = "linux")]
use crate::results::files::until_ctrl_c;
use crate::results::files::{Folder, OutputArgs, Target};
use crate::results::pictures::birdseye;
use crate::results::pictures::cells::Carries;
use crate::results::pictures::polar::{self, PolarGrid};
use crate::results::pictures::scene::{Scene, Window};

/// Decode the maps that sensors broadcast on a CAN bus, in its log, or in one of a serial line by viewshed bus
///
/// Prints what every sensor says of itself, what happened to its frames, and what its maps show. With a key
/// only authentic messages count, without one only those that are not authenticated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// CAN log of `candump` (with -L, or -t a, d or z), Vector ASC or SavvyCAN CSV, or one of a serial line by viewshed bus
    /// --log; each also gzipped; - reads standard input
    #[arg(value_name = "LOG", required_unless_present = "can")]
    log: Option<PathBuf>,
    /// Listen to this SocketCAN interface in place of a log, until Ctrl-C
    #[arg(long, value_name = "INTERFACE", conflicts_with_all = ["log", "interface"])]
    can: Option<String>,
    /// Listen to it for this time only, in seconds
    #[arg(long = "for", value_name = "SECONDS", requires = "can", conflicts_with = "log", value_parser = seconds)]
    seconds: Option<f64>,
    /// Only this bus of a CAN log: can0, or the channel of an ASC log [default: all]
    #[arg(long, value_name = "NAME")]
    interface: Option<String>,
    /// Write what was found as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write pictures of every sensor's map into this folder now and then: azimuth over range, and from above
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Time between two looks at the maps, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, allow_negative_numbers = true, value_parser = seconds)]
    every: f64,
    /// Sensors on 29-bit identifiers from 0x4000000 on, instead of 0x400 to 0x4FF
    #[arg(long)]
    extended: bool,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    key: KeyArgs,
}

/// Listens to a log or a bus.
///
/// # Errors
/// A log that cannot be read, an interface that cannot be listened to, and one that has no broadcast.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut outputs = args.outputs.beside(args.log.clone().into_iter().chain(args.key.file()));
    let json = outputs.file("--json", args.json.as_deref())?;
    let pictures = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    let addresses = if args.extended { Addresses::EXTENDED } else { Addresses::STANDARD };
    let key = args.key.key()?;
    let mut session = Session {
        listening: Listening::new(addresses, key.as_ref()),
        maps: vec![Vec::new(); usize::from(SENSORS)],
        pictures,
        every_ns: (args.every * 1e9) as i64,
        begin_ns: None,
        next_ns: 0,
        told: false,
    };
    let (log, unread, problems) = match (&args.can, &args.log) {
        (Some(interface), _) => {
            session.told = true;
            live(interface, args.seconds, &mut session)?;
            (Cow::Borrowed(interface.as_str()), 0, Vec::new())
        }
        (None, Some(log)) => {
            let Log { lines, unread, problems } = logged::read(log, args.interface.as_deref())?;
            for logged in &lines {
                match logged {
                    Logged::Frame(line) => session.at(line.time_ns)?.take(line),
                    Logged::Chunk(chunk) => session.at(chunk.time_ns)?.take_bytes(chunk),
                }
            }
            (file::shown(log), unread, problems)
        }
        (None, None) => bail!("neither a log nor an interface"),
    };
    session.look()?;
    let Session { listening, mut maps, .. } = session;
    let sensors: Vec<Heard> = listening
        .sensors()
        .into_iter()
        .filter_map(|n| listening.heard(n, std::mem::take(&mut maps[usize::from(n)])))
        .collect();
    if sensors.is_empty() {
        let (frames, not_authentic) = (listening.frames(), listening.not_authentic());
        match (not_authentic, key) {
            (0, _) if frames == 0 => bail!("{log}: no frame came; `viewshed doctor` says what to check"),
            (0, _) => bail!(
                "{log}: none of its {frames} frames is of a broadcast; `viewshed doctor` says what is there, and --extended takes those of 29 bits"
            ),
            (n, None) => {
                bail!("{log}: {n} of its {frames} frames are authenticated; give the sender's key with --key-file")
            }
            (n, Some(_)) => {
                bail!("{log}: {n} of its {frames} frames are of a broadcast, and none is authentic with this key")
            }
        }
    }
    print(&report(&sensors, &listening, &problems))?;
    if let Some(file) = json {
        let report = serde_json::json!({
            "frames": listening.frames(),
            "foreign": listening.foreign(),
            "lines_not_read": unread,
            "sensors": sensors,
        });
        file.write(serde_json::to_string_pretty(&report).context("the report as JSON")? + "\n")?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Maps as they are heard, looked at now and then.
struct Session {
    listening: Listening,
    maps: Vec<Vec<Moment>>,
    pictures: Option<Folder>,
    every_ns: i64,
    begin_ns: Option<i64>,
    next_ns: i64,
    /// Each look is printed.
    told: bool,
}

impl Session {
    /// What is to be given what came at a time; looks at the maps before it where that is due.
    fn at(&mut self, time_ns: i64) -> Result<&mut Listening> {
        if self.begin_ns.is_none() {
            (self.begin_ns, self.next_ns) = (Some(time_ns), time_ns + self.every_ns);
        }
        if time_ns >= self.next_ns {
            self.look()?;
            let missed = (time_ns - self.next_ns) / self.every_ns;
            self.next_ns += (missed + 1) * self.every_ns;
        }
        Ok(&mut self.listening)
    }

    fn look(&mut self) -> Result<()> {
        look(&self.listening, &mut self.maps, self.pictures.as_ref())?;
        if !self.told {
            return Ok(());
        }
        let begin_s = self.begin_ns.unwrap_or(0) as f64 * 1e-9;
        let sensors = self.listening.sensors();
        let mut text = String::new();
        let passed_s = (self.listening.time_s() - begin_s).max(0.0);
        for sensor in &sensors {
            // never the map as it was: who is silent shows nothing
            let now = self.listening.moment(*sensor).map_or_else(|| UNKNOWN.to_owned(), |m| shares(&m));
            let _ = writeln!(text, "{passed_s:7.1} s  sensor {sensor}: {now}");
        }
        if sensors.is_empty() {
            let _ = writeln!(text, "{passed_s:7.1} s  no broadcast among {} frames", self.listening.frames());
        }
        print(&text)
    }
}

/// Listens to an interface.
#[cfg(target_os = "linux")]
fn live(interface: &str, seconds: Option<f64>, session: &mut Session) -> Result<()> {
    let bus = can_log::live::Bus::open(interface)?;
    let stop = until_ctrl_c().context("Ctrl-C")?;
    bus.listen(seconds.map(Duration::from_secs_f64), &stop, |heard| {
        match heard {
            can_log::live::Heard::Frame(line) => session.at(line.time_ns)?.take(&line),
            can_log::live::Heard::Nothing(time_ns) => session.at(time_ns)?.pass(time_ns),
        }
        Ok(())
    })
}

#[cfg(not(target_os = "linux"))]
fn live(_: &str, _: Option<f64>, _: &mut Session) -> Result<()> {
    bail!("--can listens to SocketCAN, which Linux has; record the bus and name the log")
}

/// Said of a sensor that has been silent for too long.
const UNKNOWN: &str = "silent, so all of its map is unknown";

/// How much of a map is visible.
fn shares(m: &Moment) -> String {
    let all = (m.visible + m.invisible + m.unknown).max(1) as f64;
    let share = |n: usize| 100.0 * n as f64 / all;
    let (visible, invisible, unknown) = (share(m.visible), share(m.invisible), share(m.unknown));
    let p = m.probability.map_or(String::new(), |p| format!("; a known cell has p >= {p:.2} in the mean"));
    format!("{visible:.1} % of the cells visible, {invisible:.1} % not, {unknown:.1} % unknown{p}")
}

/// Counts, and draws, every sensor's map as it is now.
fn look(listening: &Listening, maps: &mut [Vec<Moment>], out: Option<&Folder>) -> Result<()> {
    for sensor in listening.sensors() {
        let Some(moment) = listening.moment(sensor) else { continue };
        if let Some(folder) = out {
            let name = format!("sensor-{sensor}-{:04}", maps[usize::from(sensor)].len());
            let [polar, above] = ["", "-from-above"].map(|kind| folder.file(format!("{name}{kind}.png")));
            draw(listening, sensor, moment.time_s, [&polar?, &above?])?;
        }
        maps[usize::from(sensor)].push(moment);
    }
    Ok(())
}

/// Draws a map as it is sent, azimuth over range, and from above.
fn draw(listening: &Listening, sensor: u8, time_s: f64, [polar_file, above_file]: [&Target; 2]) -> Result<()> {
    let map = listening.map(sensor);
    let Some(header) = map.header() else { return Ok(()) };
    let carries =
        Carries { grades: map.has(Plane::Grade) && header.probability.is_none(), occupancy: map.has(Plane::Occupancy) };
    let (azimuth_rad, far_m) = (
        azimuths::ends_rad(header.azimuth_origin, header.azimuth_span),
        f64::from(header.ranges) * f64::from(header.cell_cm) / 100.0,
    );
    let title = format!("sensor {sensor} as received, {time_s:.3} s");
    let grid = PolarGrid {
        azimuths: usize::from(header.azimuths),
        ranges: usize::from(header.ranges),
        azimuth_rad,
        narrow: header.narrow.to_bytes(),
        range_m: [0.0, far_m],
        state: &|azimuth, range| shown(&map, azimuth, range),
        carries,
        title: title.clone(),
        caption: None,
    };
    polar::draw(&grid).save(polar_file)?;
    let mount = &header.mount;
    let metres = |cm: i32| f64::from(cm) / 100.0;
    let [x, y] = [metres(mount.origin.x_cm), metres(mount.origin.y_cm)];
    let [yaw, pitch, roll] = [mount.yaw, mount.pitch, mount.roll].map(|angle| f64::from(angle.radians()));
    let [right, left] = azimuth_rad;
    let arc = (0..=16).map(|k| yaw + right + (left - right) * f64::from(k) / 16.0);
    let reached = arc.map(|heading| [x + far_m * heading.cos(), y + far_m * heading.sin()]);
    let scene = Scene {
        map: &OnRoad(&map),
        carries,
        pose: SensorPose::new([x, y, metres(mount.height_cm.into())], yaw, pitch, roll),
        // what a header says of it
        field_of_view: FieldOfView { azimuth_rad, elevation_rad: [-1.5, 1.5], range_m: [0.0, far_m] },
        slice_height_m: 1.0,
        window: Window::around([[x, y]].into_iter().chain(reached), 2.0),
        detections: &[],
        boxes: Vec::new(),
        road: &[],
        lanes: [].as_slice().into(),
        lanes_numbered: false,
        title,
        caption: None,
        highlight: None,
    };
    birdseye::draw(&scene).save(above_file)
}

/// A received map in road coordinates, occupied only where that is sent.
struct OnRoad<'m>(&'m Map<'m>);

impl VisibilityMap for OnRoad<'_> {
    fn at(&self, point: RoadPoint) -> CellState {
        as_sent(self.0, self.0.at(point))
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        self.0.cells_in(area, &mut |state| visit(as_sent(self.0, state)));
    }
}

/// A state's name as it is read: "BusOff" is "bus off".
fn in_words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

/// What a unit says of its state, and why where there is something to say.
fn state(status: &StatusSeen) -> String {
    match status.reason.as_str() {
        "None" => in_words(&status.state),
        reason => format!("{} ({})", in_words(&status.state), in_words(reason)),
    }
}

/// What happened to a sensor's frames: those that were not used by reason, with their total; and what their counters
/// say, which decides nothing: a frame that came again was used or refused like any other.
fn used(c: &Counted) -> String {
    let reasons = [
        (c.protection, "failed the protection"),
        (c.not_authentic, "not authentic"),
        (c.late, "late"),
        (c.epoch, "first of an epoch, or of another"),
        (c.early, "before their header or refresh"),
        (c.malformed, "malformed"),
    ];
    let said = |counts: &[(u32, &str)]| -> String {
        counts.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!(", {n} {why}")).collect()
    };
    let unused: u64 = reasons.iter().map(|(n, _)| u64::from(*n)).sum();
    let mut text = format!("frames: {} came, {} used", u64::from(c.accepted) + unused, c.accepted);
    if unused > 0 {
        text += &format!(", {unused} not: {}", said(&reasons).trim_start_matches(", "));
    }
    let odd = said(&[(c.repeated, "came again"), (c.out_of_sequence, "came out of sequence")]);
    text + &format!("; by their counters {} never came{odd}", c.lost)
}

fn report(sensors: &[Heard], listening: &Listening, problems: &[String]) -> String {
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
            if let Some([first, end, times]) = h.narrow {
                let _ = writeln!(text, "  azimuths {first} to {} are {times} times narrower than the others", end - 1);
            }
            if let Some(p) = &h.probability {
                let [known, visible, clear] = p.least;
                let _ = writeln!(
                    text,
                    "  probabilities by a table whose check sum ends in {:04x}: known {known:.2}, visible {visible:.2} or {clear:.2}",
                    p.table
                );
            }
        }
        if let Some(s) = &heard.status {
            let _ = writeln!(
                text,
                "  state {}, up for {} s, firmware {}.{}.{}, wire version {}; lost from the radar {}, dropped {}, \
                 E2E errors {}, bus-off {}",
                state(s),
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
            if let [Some(last), Some(longest)] = s.frame_ms {
                let _ = writeln!(text, "  frames: the last took it {last:.1} ms, the longest {longest:.1} ms");
            }
        }
        let _ = writeln!(text, "  {}", used(&heard.counters));
        if let Some(m) = heard.maps.last() {
            let end = if listening.moment(heard.sensor).is_none() {
                format!("; in the end {UNKNOWN}")
            } else {
                String::new()
            };
            let _ = writeln!(text, "  {} looks at its map; the last: {}{end}", heard.maps.len(), shares(m));
        }
    }
    let _ = writeln!(text, "{} frames in all, {} of others", listening.frames(), listening.foreign());
    for problem in problems {
        let _ = writeln!(text, "{problem}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_said_in_words() {
        let said = |state_name: &str, reason: &str| {
            state(&StatusSeen {
                state: state_name.into(),
                reason: reason.into(),
                reset_cause: "PowerOn".into(),
                uptime_s: 1,
                firmware: [0; 3],
                wire_version: 1,
                fingerprint: 0,
                radar_lost: 0,
                dropped: 0,
                e2e_errors: 0,
                bus_off: 0,
                frame_ms: [None; 2],
            })
        };
        assert_eq!(said("Ok", "None"), "ok");
        assert_eq!(said("Unavailable", "NoFrames"), "unavailable (no frames)");
    }
}
