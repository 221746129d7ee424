//! Which of the radars with an ARS408's messages a log is of, by which scales its entries make sense.
//!
//! # Method
//! Two radars send the same identifiers with other scales. By the wrong ones scans are not whole, entries lie beyond what
//! such a radar sees or behind it, and from one scan to the next distances do not change as the velocities say.

use viewshed::inputs::RadarScan;
use viewshed::inputs::ars408::Ars408Config;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;

use super::ars408_feed::Feed;
use super::can_log::Line;
use super::pairs::Signs;
use super::{Frame, capture};

/// Lines of a log that are enough to tell.
pub const MOST_LINES: usize = 100_000;

/// Beyond this no radar of the kind sees, centimetres.
const FARTHEST_CM: u16 = 25_500;
/// Share of entries that may lie beyond by the right scales.
const FEW: f64 = 0.02;
/// Whole scans, and pairs of entries, that have to speak for another kind; and how many times as many as for the own.
const LEAST_SCANS: usize = 10;
const LEAST_PAIRS: usize = 50;
const TIMES: usize = 3;
/// Time between scans in which what is slow has moved, too.
const APART_NS: i64 = 400_000_000;

/// How a sensor's frames look by the scales of one radar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Whole scans.
    pub scans: usize,
    /// Share of entries where the radar does not look.
    pub implausible: f64,
    /// Entries whose distance changes as their velocity says.
    pub agree: usize,
}

impl Fit {
    /// By these scales; `lines` are of one interface.
    pub fn of(lines: &[&Line], sensor: u8, profile: &Ars408Profile) -> Self {
        let mut feed = Feed::<1024>::new(Ars408Config {
            wanted: Ars408Wanted::ALL,
            profile: *profile,
            ..Ars408Config::sensor(sensor)
        });
        let (mut frames, mut entries, mut odd) = (Vec::new(), 0, 0);
        let mut take = |scan: &RadarScan<'_>| {
            entries += scan.detections.len();
            // behind: more than a quarter turn to a side
            let is_odd = |range_cm: u16, azimuth: i16| range_cm > FARTHEST_CM || azimuth.unsigned_abs() > 1 << 14;
            odd += scan.detections.iter().filter(|d| is_odd(d.range_cm, d.azimuth.raw())).count();
            frames.push(Frame {
                time_ns: i64::try_from(scan.time.micros()).unwrap_or(i64::MAX / 1000).saturating_mul(1000),
                detections: scan.detections.iter().map(capture::detection).collect(),
                refused: 0,
                unwanted: Vec::new(),
                fault: false,
            });
        };
        lines.iter().for_each(|line| feed.push(line, &mut take));
        feed.end(&mut take);
        let implausible = if entries > 0 { odd as f64 / entries as f64 } else { 0.0 };
        // what is slow has not moved enough from one scan to the next
        let mut apart: Vec<Frame> = Vec::new();
        for frame in &frames {
            if apart.last().is_none_or(|last| frame.time_ns.saturating_sub(last.time_ns) >= APART_NS) {
                apart.push(frame.clone());
            }
        }
        Self { scans: frames.len(), implausible, agree: Signs::of(&frames).counted().0 + Signs::of(&apart).counted().0 }
    }

    /// Why the frames rather are of a radar by whose scales they look like `other`.
    fn why_rather(&self, other: &Self) -> Option<String> {
        if other.scans >= LEAST_SCANS && other.scans > TIMES * self.scans {
            return Some(format!("{} scans are whole, by the other {}", self.scans, other.scans));
        }
        if self.implausible > FEW && self.implausible > TIMES as f64 * other.implausible {
            return Some(format!(
                "{:.0} % of its entries lie beyond 255 m or behind it, by the other {:.0} %",
                100.0 * self.implausible,
                100.0 * other.implausible
            ));
        }
        (other.agree >= LEAST_PAIRS && other.agree > TIMES * self.agree).then(|| {
            format!(
                "the distance of {} entries changes as their velocity says, by the other that of {}",
                self.agree, other.agree
            )
        })
    }
}

/// The kind of radar that these frames rather are of, and why.
pub fn rather(lines: &[&Line], sensor: u8, profile: &Ars408Profile) -> Option<(&'static str, String)> {
    let own = Fit::of(lines, sensor, profile);
    let others = Ars408Profile::ALL.into_iter().filter(|other| other.name != profile.name);
    others.into_iter().find_map(|other| Some((other.name, own.why_rather(&Fit::of(lines, sensor, &other))?)))
}

/// What is said of it.
pub fn said(of: &str, profile: &Ars408Profile, (name, why): &(&str, String)) -> String {
    format!("{of} is rather an {name} than an {}: by the scales of an {0} {why}", profile.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::can_log::log;
    use crate::recording::file::Source;
    use crate::recording::problems::Problems;

    #[test]
    fn frames_read_as_of_another_kind_are_told() {
        let log = include_bytes!("../../../recordings/ars408-made-up.log");
        let found = log::find(&Source::of_bytes(log)).unwrap().unwrap();
        let lines = found.read(None, &mut Problems::default(), &mut |_| false).unwrap().collect();
        let lines: Vec<&Line> = lines.iter().collect();
        // clusters and objects
        for sensor in [0, 3] {
            assert_eq!(rather(&lines, sensor, &Ars408Profile::ARS408), None);
            let (name, why) = rather(&lines, sensor, &Ars408Profile::SR75).unwrap();
            assert_eq!(name, "ARS408", "{why}");
        }
    }

    #[test]
    fn each_sign_speaks_for_itself() {
        let right = Fit { scans: 100, implausible: 0.001, agree: 400 };
        assert_eq!(right.why_rather(&Fit { scans: 100, implausible: 0.5, agree: 20 }), None);
        assert_eq!(right.why_rather(&right), None);
        for wrong in [Fit { scans: 3, ..right }, Fit { implausible: 0.03, ..right }, Fit { agree: 90, ..right }] {
            assert!(wrong.why_rather(&right).is_some(), "{wrong:?}");
        }
    }
}
