//! Recordings from CAN logs of an ARS408 or one of its kin.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use viewshed::fixed::time::Time;
use viewshed::inputs::RadarScan;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Counters, Ars408Outcome};

use super::can_log::{self, Format, Line};
use super::capture::{self, Kind};
use super::problems::{POINTS, Problems};
use super::{Frame, ReadOptions, Recording, kind, native};

/// Entries of a scan that are kept; clones announce more than 255.
const MOST_ENTRIES: usize = 1024;

/// Reads the scans of one sensor.
///
/// # Errors
/// No scan of such a radar, or several sensors and none named, or no such interface.
pub fn read(name: String, bytes: &[u8], format: Format, options: &ReadOptions) -> Result<Recording> {
    let mut problems = Problems::default();
    let lines = can_log::read(bytes, format, options.interface.as_deref(), &mut problems)?;
    let native = native::of_log(&lines);
    if !native.is_empty() && !lines.iter().any(|l| sensor_of(l).is_some()) {
        return native::read(name, &native, 0, options);
    }
    let (interface, sensor) = choose(&name, &lines, options)?;
    let mine: Vec<&Line> = lines.iter().filter(|line| line.interface == interface).collect();
    let elsewhere = lines.iter().filter(|l| l.interface != interface && sensor_of(l) == Some(sensor)).count();
    let start = mine.first().map_or(0, |l| l.time_ns);
    problems.add_many(
        &interface,
        "frames of the same sensor id on another interface, left out",
        start,
        elsewhere as u64,
    );
    let profile = *options.profile.unwrap_or(&Ars408Profile::ARS408);
    let usual = Ars408Config::sensor(sensor);
    let wanted = options.wanted.unwrap_or(usual.wanted);
    let mut radar = Ars408::<MOST_ENTRIES>::new(Ars408Config { profile, wanted, ..usual });
    let mut frames = Vec::new();
    scans(&mut radar, &mine, |scan| {
        if scan.fault {
            problems.add(&interface, "scan of a radar that reports a fault", nanoseconds(scan.time));
        }
        if scan.unwanted > 0 && scan.detections.is_empty() {
            problems.add(
                &interface,
                "scan of which every entry was left out: it says nothing of the road",
                nanoseconds(scan.time),
            );
        }
        let detections = scan.detections.iter().map(capture::detection).collect();
        frames.push(Frame {
            time_ns: nanoseconds(scan.time),
            detections,
            refused: scan.refused.into(),
            unwanted: scan.unwanted.into(),
            fault: scan.fault,
        });
    });
    if frames.is_empty() {
        if let Some(rather) = kind::rather(&mine, sensor, &profile) {
            let what = kind::said(&format!("sensor {sensor} on {interface}"), &profile, &rather);
            bail!("{name}: {what}; read it with --radar {}", rather.0);
        }
        bail!("{name}: no whole scan of sensor {sensor} on {interface}; `viewshed doctor` says what is on the bus");
    }
    report(&mut problems, &interface, start, radar.counters());
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
    Ok(capture::recording(name, kind, frames, problems, options))
}

/// Feeds a radar with frames; `scan` is given every scan that comes of them, to the last.
pub fn scans<const N: usize>(radar: &mut Ars408<N>, lines: &[&Line], mut scan: impl FnMut(&RadarScan<'_>)) {
    let mut give = |outcome: Ars408Outcome<'_>| {
        if let Ars408Outcome::Scan(s) = outcome {
            scan(&s);
        }
    };
    let mut end = 0;
    for line in lines {
        let Some(frame) = line.frame() else { continue };
        let micros = u64::try_from(line.time_ns / 1000).unwrap_or(0);
        let now = Time::from_micros(micros);
        // what timed out before this frame came
        radar.poll(now).map(&mut give);
        give(radar.push(frame, now));
        radar.poll(now).map(&mut give);
        end = micros;
    }
    radar.poll(Time::from_micros(end.saturating_add(10_000_000))).map(&mut give);
}

fn nanoseconds(time: Time) -> i64 {
    i64::try_from(time.micros()).unwrap_or(i64::MAX).saturating_mul(1000)
}

/// The sensor whose scan a frame belongs to.
fn sensor_of(line: &Line) -> Option<u8> {
    let (message, sensor) = Message::of(line.frame().filter(|f| !f.fd)?.id)?;
    let scan = [Message::ClusterStatus, Message::ClusterGeneral, Message::ObjectStatus, Message::ObjectGeneral];
    scan.contains(&message).then_some(sensor)
}

/// Interface and sensor id to be read.
fn choose(name: &str, lines: &[Line], options: &ReadOptions) -> Result<(String, u8)> {
    let mut found: BTreeMap<(String, u8), usize> = BTreeMap::new();
    for line in lines {
        if let Some(sensor) = sensor_of(line) {
            *found.entry((line.interface.clone(), sensor)).or_default() += 1;
        }
    }
    let listed = || found.iter().map(|((i, s), n)| format!("{s} on {i} ({n} frames)")).collect::<Vec<_>>().join(", ");
    let wanted = found.iter().filter(|((_, sensor), _)| options.sensor_id.is_none_or(|id| id == *sensor));
    let Some((chosen, _)) = wanted.clone().max_by_key(|(_, n)| **n) else {
        match options.sensor_id {
            Some(id) if !found.is_empty() => bail!("{name}: no scan of sensor {id}; sensors found: {}", listed()),
            _ => bail!(
                "{name}: no scan of an ARS408 or its kin in this log (0x600, 0x60A, 0x60B, 0x701); `viewshed doctor` says what there is"
            ),
        }
    };
    if wanted.clone().any(|((_, sensor), _)| *sensor != chosen.1) {
        bail!("{name}: several sensors: {}; choose one with --sensor-id", listed());
    }
    Ok(chosen.clone())
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
        ("entry beyond those announced, refused", c.surplus),
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

    use super::*;
    use crate::estimators::{self, Options};

    const LOG: &str = include_str!("../../../recordings/ars408-made-up.log");

    /// Whether any estimator's map ever has a visible cell, and how many scans carry a fault.
    fn seen(log: &str) -> (bool, usize) {
        let mount = Some([0.0, 0.0, 5.0, 0.0, 0.03, 0.0]);
        let options = ReadOptions { sensor_id: Some(0), mount, ..ReadOptions::default() };
        let recording = read("log".into(), log.as_bytes(), Format::Candump, &options).unwrap();
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
            read("log".into(), of_state(0x02).as_bytes(), Format::Candump, &options).unwrap()
        };
        let (without, with) = (read(0x00), read(0x02));
        let entries = |r: &Recording| r.frames.iter().map(|f| f.detections.len()).sum::<usize>();
        let unwanted = |r: &Recording| r.frames.iter().map(|f| f.unwanted).sum::<u64>();
        assert_eq!((entries(&without), unwanted(&with)), (0, 0));
        assert_eq!(unwanted(&without), entries(&with) as u64);
        let said: Vec<_> = without.problems.iter().map(|p| (p.what, p.count)).collect();
        assert!(said.iter().any(|(what, n)| what.contains("left out: it says nothing") && *n == 28), "{said:?}");
        assert!(said.iter().any(|(what, n)| what.contains("--cluster-states") && *n == unwanted(&without)), "{said:?}");
    }
}
