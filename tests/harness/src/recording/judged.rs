//! Whether a recording's points can be judged: what a unit with default settings concludes of them, frame by frame.

use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::frame::gate::{Gate, GateConfig, Rejection, Rejections};
use viewshed::frame::health::{Condition, Health, HealthConfig, HealthLimits, Points};
use viewshed::frame::repeats::Repeats;
use viewshed::sensor::field_of_view::FieldOfView;

use super::problems::{POINTS, Problems};
use super::usable::{self, measurement};
use super::{Frame, Recording};

/// What a doctor knows of the view: nothing.
const ANYWHERE: FieldOfView = FieldOfView {
    azimuth_min_deg: -85.0,
    azimuth_max_deg: 85.0,
    elevation_min_deg: -80.0,
    elevation_max_deg: 80.0,
    range_min_m: 0.1,
    range_max_m: 400.0,
};

/// Reasons that leave nothing known.
const REASONS: [Rejection; 4] = [Rejection::Quality, Rejection::Rcs, Rejection::Velocity, Rejection::Unwanted];

/// What is said of those that an ARS408 leaves out itself, and a guess of why.
const MARKED: &str = "entries that the radar itself marks as predicted, deleted, invalid or ambiguous";
const CLONES: &str = "clones fill these marks as they like: --cluster-states takes clusters of more states, and marks of objects are left out by switching clusters on";

/// Frames in which points keep coming and nearly none is let through.
#[derive(Debug, Clone, PartialEq)]
pub struct Unusable {
    pub frames: usize,
    pub of: usize,
    /// Of the first of them.
    pub first_us: u64,
    /// For what most points were left out until the last of them, and how many.
    pub reason: Rejection,
    pub points: u32,
}

impl Unusable {
    /// In a sentence, with a guess of why.
    pub fn said(&self) -> String {
        let (points, hint) = match self.reason {
            Rejection::Unwanted => (MARKED.to_owned(), CLONES),
            other => (format!("points {}", usable::in_words(other)), usable::hint(other.name())),
        };
        format!(
            "in {} of {} frames points come again and at most one in twenty of them is let through ({} {points}): so nothing is known then, and the map is unknown; {hint}",
            self.frames, self.of, self.points,
        )
    }
}

/// Watches frames as a unit does.
pub struct Watch {
    /// None where the defaults cannot be worked with, which a test denies.
    by: Option<(Gate, HealthLimits)>,
    repeats: Repeats,
    health: Health,
    rejections: Rejections,
    frames: usize,
    unusable: Option<(usize, u64, Rejections)>,
}

impl Default for Watch {
    /// Of a radar whose view is not known.
    fn default() -> Self {
        Self::by(ANYWHERE.limits().and_then(|view| GateConfig::default().gate(&view)).ok())
    }
}

impl Watch {
    fn by(gate: Option<Gate>) -> Self {
        let by = gate.zip(HealthConfig::default().limits().ok());
        let (repeats, health) = (Repeats::NEW, Health::NEW);
        Self { by, repeats, health, rejections: Rejections::NONE, frames: 0, unusable: None }
    }

    /// Takes a frame.
    pub fn frame(&mut self, now: Time, detections: &[Detection]) {
        let Some((gate, limits)) = &self.by else { return };
        self.frames += 1;
        let mut unjudged = self.repeats.frame(now);
        let passed = detections.iter().filter(|d| gate.takes(d, &mut self.rejections, &mut unjudged)).count() as u32;
        let again = unjudged.end();
        // what lies elsewhere or is no detection is told by others
        self.health.frame(now, &Points { inside: passed, passed, again, ..Points::default() }, false, limits);
        if self.health.condition(now, limits) == Condition::Unusable {
            let (frames, _, rejections) = self.unusable.get_or_insert((0, now.micros(), Rejections::NONE));
            (*frames, *rejections) = (*frames + 1, self.rejections);
        }
    }

    /// What was found; `None` where points could be judged.
    pub fn end(self) -> Option<Unusable> {
        let (frames, first_us, rejections) = self.unusable?;
        let reason = REASONS.into_iter().max_by_key(|reason| rejections.count(*reason))?;
        Some(Unusable { frames, of: self.frames, first_us, reason, points: rejections.count(reason) })
    }
}

/// Watches the frames of a recording; not those that do not follow one another.
pub struct Watching {
    watch: Option<Watch>,
    detections: Vec<Detection>,
}

impl Watching {
    /// Of a recording's radar.
    pub fn of(recording: &Recording) -> Self {
        let follow = !recording.sensor.frames_independent;
        let watch = || Watch::by(usable::gate(recording, &GateConfig::default()));
        Self { watch: follow.then(watch), detections: Vec::new() }
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        let Some(watch) = &mut self.watch else { return };
        self.detections.clear();
        let as_unit = |(d, marked)| Some(Detection { marked, ..Detection::new(&measurement(d)).ok()? });
        self.detections.extend(frame.all().filter_map(as_unit));
        watch.frame(Time::from_micros(u64::try_from(frame.time_ns / 1000).unwrap_or(0)), &self.detections);
    }

    /// Adds it to the recording's problems where nothing is known of some of its frames.
    pub fn tell(self, problems: &mut Problems) {
        let Some(found) = self.watch.and_then(Watch::end) else { return };
        let first_ns = i64::try_from(found.first_us).unwrap_or(i64::MAX / 1000).saturating_mul(1000);
        problems.add_many(POINTS, found.said(), first_ns, u64::from(found.points));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::recording::RadarDetection;

    /// Ten vehicles that come nearer for 6 s, with this SNR, RCS and speed by the factor.
    fn said(snr_db: f32, rcs_dbsm: f32, faster: f32, marked: bool) -> String {
        let mut recording = made_up::recording(90, 0);
        for (k, frame) in (0_u16..).zip(&mut recording.frames) {
            frame.time_ns = i64::from(k) * 66_000_000;
            let one = |i: u16| RadarDetection {
                range_m: 40.0 + f32::from(i * 10) - 0.066 * f32::from(k) * 3.0,
                azimuth_rad: 0.02 * f32::from(i),
                elevation_rad: None,
                radial_velocity_mps: -3.0 * faster,
                rcs_dbsm: Some(rcs_dbsm),
                snr_db: Some(snr_db),
            };
            let list = if marked { &mut frame.unwanted } else { &mut frame.detections };
            list.extend((0..10).map(one));
        }
        let mut watching = Watching::of(&recording);
        recording.frames.iter().for_each(|frame| watching.frame(frame));
        watching.tell(&mut recording.problems);
        recording.problems.iter().map(|p| p.what).collect()
    }

    #[test]
    fn a_doctor_watches() {
        assert!(Watch::default().by.is_some());
    }

    #[test]
    fn points_that_nearly_all_fail_one_gate_are_told_with_the_reason() {
        assert_eq!(said(20.0, 5.0, 1.0, false), "");
        for (told, words) in [
            (said(-3.0, 5.0, 1.0, false), ["900 points with too low an SNR", "never filled"]),
            (said(20.0, -60.0, 1.0, false), ["900 points with too low an RCS", "never filled"]),
            (said(20.0, 5.0, 30.0, false), ["900 points with a velocity", "m/s"]),
            (said(20.0, 5.0, 1.0, true), ["900 entries that the radar itself marks", "--cluster-states"]),
        ] {
            assert!(told.starts_with("in 44 of 90 frames"), "{told}");
            assert!(words.iter().all(|word| told.contains(word)), "{told}");
        }
    }
}
