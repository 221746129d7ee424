//! Recordings from CAN logs of an ARS408 or one of its kin.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::{Result, bail};
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::{Ars408Config, Ars408Counters};

use super::ars408_feed::is_classic;
use super::can_log::log::{Found, Log};
use super::can_log::{Format, Line};
use super::capture::{self, Kind};
use super::frames::Survey;
use super::problems::{POINTS, Problems};
use super::unheld::{self, Scans};
use super::{Frame, ReadOptions, Recording, kind, native};

/// Beyond the time asked for, what is read to make the last scan whole and to find lines that come late, seconds.
const MORE_S: f64 = 3.0;

/// Scans closer together than this are of a log whose times are in another unit than its format says, milliseconds: these
/// radars send one about every 70.
const LEAST_PERIOD_MS: f64 = 7.0;

/// Reads the scans of one sensor; of a log that goes on beyond the time asked for only what is needed. The scans are
/// [read again](Scans), so many at once, or held.
///
/// # Errors
/// No scan of such a radar, or several sensors and none named, or no such interface; times that cannot be.
pub fn read(
    name: &str,
    found: &Found,
    options: &ReadOptions,
    part: Option<usize>,
) -> Result<(Recording, Option<String>)> {
    // what comes first may be of no use: then all of it is read
    if options.to_s.is_some()
        && let Ok((recording, damage, whole)) = read_up_to(name, found, options, options.to_s, part)
        && (whole || recording.duration_s() >= options.to_s.unwrap_or(0.0))
    {
        return Ok((recording, damage));
    }
    let (recording, damage, _) = read_up_to(name, found, options, None, part)?;
    Ok((recording, damage))
}

/// Reads up to a time after the first radar frame; and whether that was all of the log.
fn read_up_to(
    name: &str,
    found: &Found,
    options: &ReadOptions,
    to_s: Option<f64>,
    part: Option<usize>,
) -> Result<(Recording, Option<String>, bool)> {
    let mut problems = Problems::default();
    let (mut heard, mut native, mut begin, mut whole) = (Heard::default(), false, None, true);
    let log = found.clone().read(options.interface.as_deref(), &mut problems, &mut |line| {
        let of_native = native::message(line).is_some();
        native |= of_native;
        let sensor = sensor_of(line);
        if let Some(sensor) = sensor {
            heard.add(&line.interface, sensor);
        }
        if begin.is_none() && (of_native || sensor.is_some_and(|s| options.sensor_id.is_none_or(|id| id == s))) {
            begin = Some(line.time_ns);
        }
        let passed = begin.map_or(0.0, |begin| line.time_ns.saturating_sub(begin) as f64 * 1e-9);
        let enough = to_s.is_some_and(|to_s| passed > to_s + MORE_S);
        whole &= !enough;
        enough
    })?;
    let damage = log.damage().map(str::to_owned);
    if log.stands_still() {
        bail!("{name}: all frames bear the same time, so no map can be made: log them with times, in microseconds");
    }
    if native && heard.0.is_empty() {
        return Ok((native::read(name.to_owned(), &native::of_log(&log), 0, options)?, damage, whole));
    }
    let recording = of_log(name, log, &heard, problems, options, part)?;
    Ok((recording, damage, whole))
}

fn of_log(
    name: &str,
    log: Log,
    heard: &Heard,
    mut problems: Problems,
    options: &ReadOptions,
    part: Option<usize>,
) -> Result<Recording> {
    let (interface, sensor) = choose(name, heard, options)?;
    let elsewhere = heard.0.iter().filter(|(i, s, _)| *i != interface && *s == sensor).map(|(.., n)| n).sum::<u64>();
    let profile = *options.profile.unwrap_or(&Ars408Profile::ARS408);
    let usual = Ars408Config::sensor(sensor);
    let wanted = options.wanted.unwrap_or(usual.wanted);
    let format = log.format();
    let mut scans =
        Scans::new(log, &interface, Ars408Config { profile, wanted, ..usual }, part.unwrap_or(unheld::PART));
    let (mut start, mut flexible, mut first) = (None, 0, Vec::new());
    let (mut frames, mut survey, mut periods) = (Vec::new(), Survey::default(), Periods::default());
    let mut take = |frame: Frame| {
        if frame.fault {
            problems.add(&interface, "scan of a radar that reports a fault", frame.time_ns);
        }
        if !frame.unwanted.is_empty() && frame.detections.is_empty() {
            let what = "scan of which every entry was left out: it says nothing of the road";
            problems.add(&interface, what, frame.time_ns);
        }
        survey.frame(&frame);
        periods.frame(frame.time_ns);
        if part.is_none() {
            frames.push(frame);
        }
        ControlFlow::Continue(())
    };
    let mut line = |line: &Line| {
        start.get_or_insert(line.time_ns);
        if first.len() < kind::MOST_LINES {
            first.push(line.clone());
        }
        flexible += u64::from(sensor_of(line) == Some(sensor) && line.frame().is_some_and(|frame| frame.fd));
    };
    let counters = scans.decode(&mut line, &mut take);
    let start = start.unwrap_or(0);
    problems.add_many(&interface, "frames of the same sensor id on another interface, left out", start, elsewhere);
    problems.add_many(
        &interface,
        "frames that are marked as CAN FD, taken as the classic ones a radar sends",
        start,
        flexible,
    );
    if format == Format::PythonCan {
        problems.add("log", "Python-can's CSV does not say on which bus a frame was: all are taken for one bus", start);
    }
    let mine: Vec<&Line> = first.iter().collect();
    if survey.extent.frames == 0 {
        if let Some(rather) = kind::rather(&mine, sensor, &profile) {
            let what = kind::said(&format!("sensor {sensor} on {interface}"), &profile, &rather);
            bail!("{name}: {what}; read it with --radar {}", rather.0);
        }
        bail!("{name}: no whole scan of sensor {sensor} on {interface}; `viewshed doctor` says what is on the bus");
    }
    periods.plausible(name)?;
    report(&mut problems, &interface, start, &counters);
    if let Some(rather) = kind::rather(&mine, sensor, &profile) {
        let what = kind::said(&format!("sensor {sensor}"), &profile, &rather);
        problems.add(POINTS, format!("{what}; read it with --radar {}", rather.0), start);
    }
    let kind = Kind {
        name: format!("{} {sensor} on {interface}", profile.name),
        azimuth_deg: 60.0,
        elevation_deg: 10.0,
        range_m: [0.2, 250.0],
        has_elevation: profile.cluster.up_cm.is_some(),
    };
    let recording = capture::without_frames(name.to_owned(), kind, survey.extent.first_ns, problems, options);
    scans.surveyed(survey);
    Ok(Recording { frames, scans: part.map(|_| Arc::new(scans)), ..recording })
}

/// Times from one scan to the next, of which the middle one tells the unit. Those that are too short are counted by
/// microseconds, in which scans have their times.
#[derive(Default)]
struct Periods {
    last_ns: Option<i64>,
    all: usize,
    back: usize,
    short: BTreeMap<i64, usize>,
}

impl Periods {
    fn frame(&mut self, time_ns: i64) {
        let Some(last_ns) = self.last_ns.replace(time_ns) else { return };
        let period = time_ns.saturating_sub(last_ns);
        self.all += 1;
        if period < 0 {
            self.back += 1;
        } else if (period as f64 * 1e-6) < LEAST_PERIOD_MS {
            *self.short.entry(period).or_default() += 1;
        }
    }

    /// Refuses times of which no map can be made.
    fn plausible(&self, name: &str) -> Result<()> {
        let middle = (self.all / 2).checked_sub(self.back).filter(|_| self.all >= 5);
        let mut passed = 0;
        let period = self.short.iter().find(|(_, n)| {
            passed += **n;
            middle.is_some_and(|middle| passed > middle)
        });
        if let Some((period, _)) = period {
            let period_ms = *period as f64 * 1e-6;
            bail!(
                "{name}: a scan every {period_ms:.2} ms, and these radars send one about every 70: the log's times seem to be in another unit than its format has; write them in microseconds (SavvyCAN) or seconds"
            );
        }
        Ok(())
    }
}

/// The sensor whose scan a frame belongs to.
fn sensor_of(line: &Line) -> Option<u8> {
    let frame = line.frame()?;
    let (message, sensor) = Message::of(frame.id)?;
    let scan = [Message::ClusterStatus, Message::ClusterGeneral, Message::ObjectStatus, Message::ObjectGeneral];
    (scan.contains(&message) && is_classic(frame)).then_some(sensor)
}

/// Frames of scans, by interface and sensor.
#[derive(Default)]
struct Heard(Vec<(String, u8, u64)>);

impl Heard {
    fn add(&mut self, interface: &str, sensor: u8) {
        match self.0.iter_mut().find(|(i, s, _)| *s == sensor && i == interface) {
            Some((.., n)) => *n += 1,
            None => self.0.push((interface.to_owned(), sensor, 1)),
        }
    }
}

/// Interface and sensor id to be read.
fn choose(name: &str, heard: &Heard, options: &ReadOptions) -> Result<(String, u8)> {
    let mut found = heard.0.clone();
    found.sort();
    let listed = || found.iter().map(|(i, s, n)| format!("{s} on {i} ({n} frames)")).collect::<Vec<_>>().join(", ");
    let wanted = found.iter().filter(|(_, sensor, _)| options.sensor_id.is_none_or(|id| id == *sensor));
    let Some((interface, sensor, _)) = wanted.clone().max_by_key(|(.., n)| *n) else {
        match options.sensor_id {
            Some(id) if !found.is_empty() => bail!("{name}: no scan of sensor {id}; sensors found: {}", listed()),
            _ => bail!(
                "{name}: no scan of an ARS408 or its kin in this log (0x600, 0x60A, 0x60B, 0x701); `viewshed doctor` says what there is"
            ),
        }
    };
    if wanted.clone().any(|(_, other, _)| other != sensor) {
        bail!("{name}: several sensors: {}; choose one with --sensor-id", listed());
    }
    Ok((interface.clone(), *sensor))
}

/// What the decoder counted, as problems of the input.
fn report(problems: &mut Problems, interface: &str, start: i64, c: &Ars408Counters) {
    let counted = [
        ("scan of which entries or qualities are missing", c.incomplete),
        ("scan of which most is missing, dropped", c.broken),
        ("scan that never came, by the radar's counter", c.lost),
        ("radar started over", c.restarts),
        ("frame too short, refused", c.too_short),
        ("entry without a status message before it, refused", c.no_scan),
        ("entry or status that came twice, refused", c.repeated),
        ("entry beyond those announced; from the third such scan on they are taken", c.surplus),
        ("quality of an entry that did not arrive", c.unknown_entry),
        ("entry at no distance or beyond 655 m, dropped", c.no_range),
        (
            "entry that the radar itself marks as predicted, invalid (--cluster-states) or of ambiguous speed, left out",
            c.unwanted,
        ),
        ("entry beyond what is kept, dropped", c.overflow),
    ];
    for (what, n) in counted {
        problems.add_many(interface, what, start, u64::from(n));
    }
}

#[cfg(test)]
mod tests {
    use viewshed::inputs::ars408::quality::Ars408Wanted;
    use viewshed::sensor::road::RoadPoint;

    use super::super::can_log::log;
    use super::*;
    use crate::estimators::{self, Options};
    use crate::recording::file::Source;

    const LOG: &str = include_str!("../../../recordings/ars408-made-up.log");

    /// Whether any estimator's map ever has a visible cell, and how many scans carry a fault.
    fn seen(log: &str) -> (bool, usize) {
        let mount = Some([0.0, 0.0, 5.0, 0.0, 0.03, 0.0]);
        let options = ReadOptions { sensor_id: Some(0), mount, ..ReadOptions::default() };
        let found = log::find(&Source::of_bytes(log.as_bytes())).unwrap().unwrap();
        let (recording, _) = read("log", &found, &options, None).unwrap();
        let mut seen = false;
        for estimator in &mut estimators::all(&recording, &Options::default()).unwrap() {
            for frame in &recording.frames {
                estimator.step(frame);
                let cells = (5..60).flat_map(|x| (-5..5).map(move |y| (x as f32 + 0.5, y as f32 + 0.5)));
                seen |=
                    cells.into_iter().any(|(x, y)| estimator.map().at(RoadPoint::from_metres(x, y).unwrap()).visible());
            }
        }
        (seen, recording.frames.iter().filter(|frame| frame.fault).count())
    }

    #[test]
    fn a_radar_that_reports_a_fault_sees_nothing() {
        assert_eq!(seen(LOG), (true, 0));
        // a persistent error in every message of its state
        let faulty = LOG.replace("201#401F40", "201#401F60");
        assert_eq!(seen(&faulty), (false, 28));
    }

    /// Every cluster of the log in this state, the byte's upper five bits.
    fn of_state(state: u8) -> String {
        let marked = |line: &str| match line.split_once("702#") {
            Some((before, data)) => format!("{before}702#{}{:02X}", &data[..8], state << 3 | 3),
            None => line.to_owned(),
        };
        LOG.lines().map(|line| marked(line) + "\n").collect()
    }

    #[test]
    fn a_radar_all_of_whose_clusters_are_left_out_sees_nothing_and_is_asked_for_others() {
        // "valid cluster with azimuth correction due to elevation", and "invalid due to near-field artefact"
        assert!(seen(&of_state(0x08)).0);
        assert!(!seen(&of_state(0x02)).0, "neither empty nor evidence");
        let read = |state| {
            let wanted = Ars408Wanted::default().with_clusters([state]);
            let options = ReadOptions { sensor_id: Some(0), wanted, ..ReadOptions::default() };
            let found = log::find(&Source::of_bytes(of_state(0x02).as_bytes())).unwrap().unwrap();
            read("log", &found, &options, None).unwrap().0
        };
        let (without, with) = (read(0x00), read(0x02));
        let entries = |r: &Recording| r.frames.iter().map(|f| f.detections.len()).sum::<usize>();
        let unwanted = |r: &Recording| r.frames.iter().map(|f| f.unwanted.len() as u64).sum::<u64>();
        assert_eq!((entries(&without), unwanted(&with)), (0, 0));
        assert_eq!(unwanted(&without), entries(&with) as u64);
        let said: Vec<_> = without.problems.iter().map(|p| (p.what, p.count)).collect();
        assert!(said.iter().any(|(what, n)| what.contains("left out: it says nothing") && *n == 28), "{said:?}");
        assert!(said.iter().any(|(what, n)| what.contains("--cluster-states") && *n == unwanted(&without)), "{said:?}");
    }
}
