//! What is on the bus or line, what should be, what is wrong, and what to do about it.

pub mod can;
pub mod findings;
pub mod native;
pub mod sensor;
pub mod text;
pub mod ti;

use std::path::Path;

use anyhow::{Result, bail};
use serde::Serialize;
use viewshed::inputs::ars408::profile::Ars408Profile;

use crate::recording::can_log::log::{Found, Lines};
use crate::recording::can_log::{self, FORMATS, Line};
use crate::recording::file::{self, Content, Source};
use crate::recording::foreign;
use crate::recording::problems::{Problem, Problems};
use crate::recording::ti::is_capture;
use crate::recording::{self, ReadOptions, ignored};
use can::Identifier;
use findings::{Finding, Severity};
use sensor::Sensor;

/// Everything that is said of one log.
#[derive(Debug, Serialize)]
pub struct Report {
    pub log: String,
    pub kind: &'static str,
    /// By whose scales entries are read.
    #[serde(skip)]
    pub profile: &'static Ars408Profile,
    pub frames: usize,
    pub duration_s: f64,
    /// Frames in the busiest second.
    pub busiest_second: usize,
    pub identifiers: Vec<Identifier>,
    pub sensors: Vec<Sensor>,
    pub problems: Vec<Problem>,
    pub findings: Vec<Finding>,
}

/// A judged log of any kind.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Examined {
    Can(Report),
    Ti(ti::Report),
    Native(native::Report),
}

impl Examined {
    pub fn findings(&self) -> &[Finding] {
        match self {
            Self::Can(report) => &report.findings,
            Self::Ti(report) => &report.findings,
            Self::Native(report) => &report.findings,
        }
    }

    fn findings_mut(&mut self) -> &mut Vec<Finding> {
        match self {
            Self::Can(report) => &mut report.findings,
            Self::Ti(report) => &mut report.findings,
            Self::Native(report) => &mut report.findings,
        }
    }

    /// Leaves out the sensors that are not meant. Where the one that is meant is not there, all are shown.
    fn only(&mut self, sensor: u8) {
        let heard: Vec<u8> = match self {
            Self::Can(report) => report.sensors.iter().map(|s| s.sensor).collect(),
            Self::Native(report) => report.sensors.iter().map(|s| s.sensor).collect(),
            Self::Ti(_) => {
                let what = ignored::said("--sensor-id", "CAN logs and captures of the native format");
                findings::add(self.findings_mut(), Severity::Note, what, "a capture of a TI radar is of one sensor");
                return;
            }
        };
        if !heard.contains(&sensor) {
            let listed = heard.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
            let listed = if listed.is_empty() { "none".to_owned() } else { listed };
            let what = format!("sensor {sensor} is not there; sensors heard: {listed}");
            let remedy = "name another with --sensor-id, or give the radar this id (2x0, SensorID) and start it again";
            findings::add(self.findings_mut(), Severity::Error, what, remedy);
        } else if let Self::Native(report) = self {
            report.sensors.retain(|s| s.sensor == sensor);
        }
    }

    /// The report to be read.
    pub fn text(&self) -> String {
        match self {
            Self::Can(report) => text::can(report),
            Self::Ti(report) => text::ti(report),
            Self::Native(report) => text::native(report),
        }
    }
}

/// Reads a log and judges it by what is known of its radar.
///
/// # Errors
/// A file that cannot be read or is no such log.
pub fn examine(path: &Path, known: &ReadOptions) -> Result<Examined> {
    let log = match file::shown(path) {
        name if path.as_os_str() == file::STANDARD_INPUT => name.into_owned(),
        _ => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
    };
    examine_source(log, &Source::of(path)?, known)
}

/// Judges a log of this name.
///
/// # Errors
/// Those of [`examine`].
pub fn examine_source(log: String, source: &Source, known: &ReadOptions) -> Result<Examined> {
    let (mut examined, damage) = match can_log::log::find(source)? {
        Some(found) => can(log, found, known)?,
        None => {
            let Content { bytes, damage } = source.read()?;
            (examine_bytes(log, &bytes, known)?, damage)
        }
    };
    known.sensor_id.into_iter().for_each(|sensor| examined.only(sensor));
    if let Some(damage) = damage {
        findings::add(examined.findings_mut(), Severity::Warning, damage, file::DAMAGE_REMEDY);
    }
    Ok(examined)
}

fn examine_bytes(log: String, bytes: &[u8], known: &ReadOptions) -> Result<Examined> {
    if bytes.is_empty() {
        bail!("{log} is empty");
    }
    if let Some(foreign) = foreign::named(bytes) {
        bail!("{log} cannot be read: {foreign}");
    }
    if !bytes.starts_with(mcap::MAGIC) {
        if is_capture(bytes) {
            return Ok(Examined::Ti(ti::examine(log, bytes, known)));
        }
        if recording::native::is_capture(bytes) {
            let (messages, broken) = recording::native::unstuff(bytes);
            return Ok(Examined::Native(native::examine(log, &messages, broken)));
        }
    }
    bail!(
        "{log} is not a log of {FORMATS}, not a capture of a TI mmWave radar's data port, which has the bytes 02 01 04 03 06 05 08 07 before each frame, nor a capture of the native format. Record a bus with `candump -L can0 > new.log`; MCAP recordings are judged by `viewshed replay`"
    );
}

/// The kind of a report on a bus that was listened to.
pub const LIVE: &str = "SocketCAN";

/// Judges what was heard of a bus within some seconds.
pub fn heard(interface: &str, seconds: f64, lines: &[Line], known: &ReadOptions) -> Examined {
    let mut examined = judged(interface.to_owned(), LIVE, lines, &Problems::default(), known, seconds);
    known.sensor_id.into_iter().for_each(|sensor| examined.only(sensor));
    if let (Examined::Can(report), []) = (&mut examined, lines) {
        report.findings = vec![findings::silence(seconds)];
    }
    examined
}

fn can(log: String, found: Found, known: &ReadOptions) -> Result<(Examined, Option<String>)> {
    let mut problems = Problems::default();
    let kind = found.format.name();
    let lines = found.read(known.interface.as_deref(), &mut problems, &mut |_| false)?;
    let duration_s = lines.duration_s();
    Ok((judged(log, kind, &lines, &problems, known, duration_s), lines.damage().map(str::to_owned)))
}

fn judged<L: Lines + ?Sized>(
    log: String,
    kind: &'static str,
    lines: &L,
    problems: &Problems,
    known: &ReadOptions,
    duration_s: f64,
) -> Examined {
    let profile = known.profile.unwrap_or(&Ars408Profile::ARS408);
    let sensors = sensor::all(lines, profile, known.wanted);
    if sensors.is_empty() {
        let native = recording::native::of_log(lines);
        if !native.is_empty() {
            return Examined::Native(native::examine(log, &native, 0));
        }
    }
    let bus = can::Bus::of(lines);
    let mut report = Report {
        log,
        kind,
        profile,
        frames: bus.frames,
        duration_s,
        busiest_second: bus.busiest_second,
        identifiers: bus.identifiers(&sensors, duration_s),
        problems: problems.iter().collect(),
        findings: Vec::new(),
        sensors,
    };
    if let Some(sensor) = known.sensor_id.filter(|id| report.sensors.iter().any(|s| s.sensor == *id)) {
        report.sensors.retain(|s| s.sensor == sensor);
    }
    report.findings = findings::judge(&report, &bus);
    Examined::Can(report)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    #[test]
    fn a_packed_log_that_is_damaged_is_named_whoever_reads_it() {
        let log = include_bytes!("../../../recordings/ars408-made-up.log");
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(log).unwrap();
        let mut packed = packed.finish().unwrap();
        let path = std::env::temp_dir().join(format!("viewshed-damaged-{}.log.gz", std::process::id()));
        let known = ReadOptions { sensor_id: Some(0), ..ReadOptions::default() };
        let told = |packed: &[u8]| {
            std::fs::write(&path, packed).unwrap();
            let (examined, recording) = (examine(&path, &known).unwrap(), recording::read(&path, &known).unwrap());
            let of_file =
                |f: &&Finding| f.what.contains("is damaged or cut off") && f.what.contains("viewshed-damaged");
            let findings = examined.findings().iter().filter(of_file).map(|f| f.severity).collect::<Vec<_>>();
            (findings, recording.problems.count("log.gz is damaged or cut off"))
        };
        assert_eq!(told(&packed), (vec![], 0));
        // the sum at the end
        let sum = packed.len() - 8;
        packed[sum] ^= 1;
        assert_eq!(told(&packed), (vec![Severity::Warning], 1));
        std::fs::remove_file(path).unwrap();
    }
}
