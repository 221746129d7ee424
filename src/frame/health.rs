//! Whether the sensor's silence means a free road, a blind sensor or no sensor at all.
//!
//! A healthy frame within its hold time is evidence along every line of sight, so an empty road is visible once it has
//! [settled](crate::grid::settling). A run of empty frames after traffic is a sensor that went blind, and no frames at all
//! make everything unknown.
//!
//! Rejected is not empty. Where points keep coming and nothing can be concluded from them, everything is unknown, and the
//! sensor, its mount or a setting is not what it is taken for:
//!
//! - none of them can be used for a second: not finite, in another unit, all outside the field of view;
//! - they come again and [cannot be judged](crate::frame::unjudged), too weak for the gate, too fast or left out by the sensor's own
//!   marks, and nearly none is let through.
//!
//! A frame of which all that lies in view was left out by the sensor's own marks is neither empty nor evidence: it is as if it
//! had not come.

use crate::fixed::time::Time;
use crate::frame::unjudged::Unjudged;
use crate::sensor::config::{ConfigError, within};

/// When maps end.
///
/// # Units
/// Seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct HealthConfig {
    /// How long a map holds after its frame.
    pub hold_s: f32,
    /// How long frames may be empty after traffic before the sensor counts as blind; and how long, also
    /// from the first frame on, their points may be none that can be used.
    pub blind_after_s: f32,
    /// A longer gap between frames is a new start. Over a shorter one what is known is moved on.
    pub reset_gap_s: f32,
}

impl Default for HealthConfig {
    fn default() -> Self {
        Self { hold_s: 0.5, blind_after_s: 1.0, reset_gap_s: 60.0 }
    }
}

/// A run of frames has no longer gap, microseconds.
const BREAK_US: u64 = 1_000_000;

/// [`HealthConfig`] in microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HealthLimits {
    hold_us: u64,
    blind_after_us: u64,
    reset_gap_us: u64,
}

impl HealthConfig {
    /// Checks the times.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_sign_loss)] // limits are positive
    pub fn limits(&self) -> Result<HealthLimits, ConfigError> {
        let micros = |name, v| within(name, v, 0.01, 60.0).map(|s: f32| crate::fixed::math::round_i32(s * 1e6) as u64);
        Ok(HealthLimits {
            hold_us: micros("health.hold_s", self.hold_s)?,
            blind_after_us: micros("health.blind_after_s", self.blind_after_s)?,
            reset_gap_us: micros("health.reset_gap_s", self.reset_gap_s)?,
        })
    }
}

/// What the sensor's frames say of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Condition {
    /// No frame yet.
    Starting,
    /// The last frame is evidence.
    Healthy,
    /// It is, but lines of sight were not yet looked along for long enough since a start or gap: what is behind is unknown.
    Settling,
    /// Frames come, but they have been empty since there was traffic, or the sensor says so.
    Blind,
    /// No frame within the hold time.
    Stale,
    /// Points keep coming, but none that can be used: not finite, outside the field of view, or nearly all too weak or left out
    /// by the sensor's own marks.
    Unusable,
    /// Evidence, but not of all sectors: nothing is seen of what stands in one, and it is unknown on the map.
    SectorBlind,
    /// Evidence, but what stands has moved: the mount is turned or tilted.
    Misaligned,
    /// Evidence, but less is seen of what stands, or weaker, as through dirt or snow.
    Weaker,
}

impl Condition {
    /// Whether there is a map.
    pub const fn has_map(self) -> bool {
        matches!(self, Self::Healthy | Self::Settling | Self::SectorBlind | Self::Misaligned | Self::Weaker)
    }
}

/// What a frame says besides its detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameStatus {
    /// The sensor's own fault flag.
    pub fault: bool,
    /// Points that are no detections, see [`NotADetection`](crate::frame::detection::NotADetection): whoever
    /// decodes a frame drops them and counts them here.
    pub refused: u16,
}

impl From<bool> for FrameStatus {
    /// Of a frame every point of which was a detection.
    fn from(fault: bool) -> Self {
        Self { fault, refused: 0 }
    }
}

/// Where the points of a frame were, used or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Points {
    /// In the field of view, strong enough or not.
    pub inside: u32,
    /// Outside of it.
    pub outside: u32,
    /// Nowhere: no detections.
    pub refused: u32,
    /// Left out by the sensor's own marks, wherever they were.
    pub unwanted: u32,
    /// Let through by the gate.
    pub passed: u32,
    /// Of those that cannot be judged about as many came again from the frame before, see
    /// [`Gate::takes`](crate::frame::gate::Gate::takes).
    pub again: u32,
}

impl Points {
    /// Whether nothing is known of what was measured in view: it was left out.
    fn unjudged(&self) -> bool {
        self.unwanted > 0 && self.inside == 0
    }

    /// Whether there are points and nothing can be said from them. A field of view narrower than the
    /// radar's leaves most of its points outside; but no radar has most of them refused, and of angles
    /// in degrees a few always look like radians near the axis.
    fn unusable(&self) -> bool {
        let placed = self.inside.saturating_add(self.outside);
        self.refused > placed || (self.inside == 0 && placed.saturating_add(self.refused) > 0)
    }
}

/// How a frame follows the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Continuity {
    /// The first frame.
    First,
    /// Microseconds since the last frame.
    Follows(u64),
    /// A gap too long for the grids to bridge.
    Gap,
    /// The clock stepped back or stood still.
    ClockStepped,
    /// Nothing of the frame could be judged: it is no evidence, and the next one follows the one before it.
    Unjudged,
}

impl Continuity {
    /// Whether the grids start over.
    pub fn resets(self) -> bool {
        matches!(self, Self::Gap | Self::ClockStepped)
    }
}

/// Keeps track of the sensor's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Health {
    last_frame: Option<Time>,
    /// Whether there has been traffic.
    traffic: bool,
    /// First of the empty frames since then.
    empty_since: Option<Time>,
    blind: bool,
    /// First and last of the frames with points of which none could be used.
    unusable: Option<(Time, Time)>,
    /// The last frame, evidence or not.
    last: Option<Time>,
    unjudged: Unjudged,
    misled: Misled,
}

/// By what everything is unknown though points come. The first is zero, as all of a new unit's state is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Misled {
    /// By nothing.
    No,
    /// None can be used.
    Unusable,
    /// They come again, and nearly none is let through.
    Unjudged,
}

impl Default for Health {
    fn default() -> Self {
        Self::NEW
    }
}

impl Health {
    /// Before the first frame.
    pub const NEW: Self = Self {
        last_frame: None,
        traffic: false,
        empty_since: None,
        blind: false,
        unusable: None,
        last: None,
        unjudged: Unjudged::NONE,
        misled: Misled::No,
    };

    /// Takes note of a frame and of what the radar reported in it, gated or not; `fault` is its own flag.
    pub fn frame(&mut self, now: Time, points: &Points, fault: bool, limits: &HealthLimits) -> Continuity {
        self.judge(now, points);
        if points.unjudged() {
            self.blind |= fault;
            return Continuity::Unjudged;
        }
        let continuity = match self.last_frame {
            None => Continuity::First,
            Some(last) => match now.since(last) {
                None | Some(0) => Continuity::ClockStepped,
                Some(gap) if gap > limits.reset_gap_us => Continuity::Gap,
                Some(gap) => Continuity::Follows(gap),
            },
        };
        let broken = match continuity {
            Continuity::Follows(gap) => gap > BREAK_US,
            _ => true,
        };
        if broken {
            // a run of frames has to be seen without a break; a blind sensor stays blind
            (self.empty_since, self.unusable) = (None, None);
        }
        let long = |since: Time| now.since(since).is_some_and(|us| us >= limits.blind_after_us);
        if points.unusable() {
            let (since, _) = self.unusable.unwrap_or((now, now));
            self.unusable = Some((since, now));
            if self.misled == Misled::No && long(since) {
                self.misled = Misled::Unusable;
            }
        } else if points.inside > 0 {
            self.unusable = None;
            if self.misled == Misled::Unusable {
                self.misled = Misled::No;
            }
        }
        if *points != Points::default() {
            self.traffic = true;
            self.empty_since = None;
            // what measures places, wherever they are, is not blind
            self.blind &= points.inside == 0 && points.outside == 0;
        } else {
            // a stray point now and then does not keep coming
            let stray = |(_, last): &(Time, Time)| now.since(*last).is_none_or(|us| us >= limits.blind_after_us / 2);
            self.unusable = self.unusable.filter(|run| !stray(run));
            if self.traffic {
                let since = *self.empty_since.get_or_insert(now);
                self.blind |= long(since);
            }
        }
        self.blind |= fault;
        self.last_frame = Some(now);
        continuity
    }

    /// Whether points that cannot be judged keep coming.
    fn judge(&mut self, now: Time, points: &Points) {
        if self.last.is_none_or(|last| now.since(last).is_none_or(|us| us > BREAK_US)) {
            self.unjudged = Unjudged::NONE;
        }
        self.last = Some(now);
        self.unjudged.frame(now, points.passed, points.again);
        if self.unjudged.for_long(now) {
            self.misled = Misled::Unjudged;
        } else if self.misled == Misled::Unjudged && self.unjudged.is_over() {
            (self.misled, self.unjudged) = (Misled::No, Unjudged::NONE);
        }
    }

    /// Whether what came in the last half second was points that cannot be judged: it is no evidence of what is free.
    pub fn in_doubt(&self) -> bool {
        self.unjudged.is_now()
    }

    /// The sensor's condition at a moment.
    pub fn condition(&self, now: Time, limits: &HealthLimits) -> Condition {
        let held =
            |last: Option<Time>| last.is_some_and(|last| now.since(last).is_some_and(|age| age <= limits.hold_us));
        match self.last_frame {
            _ if self.misled == Misled::Unjudged && held(self.last) => Condition::Unusable,
            None => Condition::Starting,
            Some(_) if !held(self.last_frame) => Condition::Stale,
            Some(_) if self.misled != Misled::No => Condition::Unusable,
            Some(_) if self.blind => Condition::Blind,
            Some(_) => Condition::Healthy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> HealthLimits {
        HealthConfig::default().limits().unwrap()
    }

    fn at(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    fn inside(inside: u32) -> Points {
        Points { inside, ..Points::default() }
    }

    #[test]
    fn an_empty_road_from_the_start_is_healthy() {
        let (mut h, l) = (Health::NEW, limits());
        assert_eq!(h.condition(at(0), &l), Condition::Starting);
        for i in 0..100 {
            h.frame(at(i * 66), &inside(0), false, &l);
            assert_eq!(h.condition(at(i * 66), &l), Condition::Healthy);
        }
    }

    #[test]
    fn silence_after_traffic_is_blindness_until_something_is_seen() {
        let (mut h, l) = (Health::NEW, limits());
        h.frame(at(0), &inside(5), false, &l);
        for i in 1..15 {
            h.frame(at(i * 66), &inside(0), false, &l);
        }
        assert_eq!(h.condition(at(14 * 66), &l), Condition::Healthy);
        h.frame(at(1065), &inside(0), false, &l);
        assert_eq!(h.condition(at(1065), &l), Condition::Healthy);
        h.frame(at(1066), &inside(0), false, &l);
        assert_eq!(h.condition(at(1066), &l), Condition::Blind, "a second after the first empty frame");
        h.frame(at(1132), &inside(1), false, &l);
        assert_eq!(h.condition(at(1132), &l), Condition::Healthy);
        h.frame(at(1198), &inside(1), true, &l);
        assert_eq!(h.condition(at(1198), &l), Condition::Blind, "the sensor says so itself");
    }

    #[test]
    fn a_map_holds_half_a_second() {
        let (mut h, l) = (Health::NEW, limits());
        h.frame(at(0), &inside(5), false, &l);
        assert_eq!(h.condition(at(500), &l), Condition::Healthy);
        assert_eq!(h.condition(at(501), &l), Condition::Stale);
    }

    #[test]
    fn gaps_and_steps_of_the_clock_reset() {
        let (mut h, l) = (Health::NEW, limits());
        assert_eq!(h.frame(at(5000), &inside(1), false, &l), Continuity::First);
        assert_eq!(h.frame(at(5066), &inside(1), false, &l), Continuity::Follows(66_000));
        assert_eq!(h.frame(at(6066), &inside(1), false, &l), Continuity::Follows(1_000_000));
        assert_eq!(h.frame(at(66_066), &inside(1), false, &l), Continuity::Follows(60_000_000));
        assert_eq!(h.frame(at(126_067), &inside(1), false, &l), Continuity::Gap);
        assert_eq!(h.frame(at(126_067), &inside(1), false, &l), Continuity::ClockStepped);
        assert_eq!(h.frame(at(3000), &inside(0), false, &l), Continuity::ClockStepped);
        assert!(Continuity::Gap.resets() && !Continuity::First.resets());
        // a step back never makes a later moment look fresh
        assert_eq!(h.condition(at(2000), &l), Condition::Stale);
    }

    /// Condition after each frame of the same points, every 66 ms.
    fn run(h: &mut Health, from_ms: u64, frames: u64, points: Points) -> std::vec::Vec<Condition> {
        let l = limits();
        let times = (0..frames).map(|i| at(from_ms + i * 66));
        times
            .map(|t| {
                h.frame(t, &points, false, &l);
                h.condition(t, &l)
            })
            .collect()
    }

    const NO_POINTS: Points = Points { inside: 0, outside: 0, refused: 0, unwanted: 0, passed: 0, again: 0 };
    const NOT_FINITE: Points = Points { refused: 80, ..NO_POINTS };
    const OUTSIDE: Points = Points { outside: 3, ..NO_POINTS };

    #[test]
    fn rejected_is_not_empty_from_the_first_frame_on() {
        let mostly = Points { inside: 5, outside: 4, refused: 10, unwanted: 3, ..NO_POINTS };
        for points in [NOT_FINITE, OUTSIDE, mostly] {
            let mut h = Health::NEW;
            let conditions = run(&mut h, 0, 20, points);
            assert_eq!(conditions[15], Condition::Healthy, "990 ms: {points:?}");
            assert_eq!(conditions[16], Condition::Unusable, "1056 ms: {points:?}");
            assert_eq!(run(&mut h, 20 * 66, 1, inside(0)), [Condition::Unusable], "silence does not mend it");
            assert_eq!(run(&mut h, 21 * 66, 1, inside(1)), [Condition::Healthy], "a point in view does");
        }
    }

    #[test]
    fn a_view_narrower_than_the_radars_and_weak_clutter_are_healthy() {
        for points in [Points { inside: 1, outside: 90, refused: 1, unwanted: 5, ..NO_POINTS }, inside(1)] {
            assert!(run(&mut Health::default(), 0, 60, points).iter().all(|c| *c == Condition::Healthy), "{points:?}");
        }
        // a car beyond the view's edge, now and then one within
        let mut h = Health::NEW;
        for i in 0..20 {
            for (at, points) in [(0, OUTSIDE), (330, inside(0)), (660, inside(1))] {
                assert_eq!(run(&mut h, i * 990 + at, 1, points), [Condition::Healthy]);
            }
        }
    }

    #[test]
    fn a_frame_that_was_left_out_is_neither_empty_nor_evidence() {
        let (mut h, l) = (Health::NEW, limits());
        let left_out = Points { unwanted: 12, ..Points::default() };
        assert!(run(&mut h, 0, 30, left_out).iter().all(|c| *c == Condition::Starting));
        run(&mut h, 2000, 1, inside(5));
        let conditions = run(&mut h, 2066, 30, left_out);
        assert!(conditions[..7].iter().all(|c| *c == Condition::Healthy), "until the hold time is over");
        assert!(conditions[7..].iter().all(|c| *c == Condition::Stale), "{conditions:?}");
        // what comes next follows the last that was judged
        let mut h = Health::NEW;
        run(&mut h, 0, 1, inside(5));
        assert_eq!(h.frame(at(66), &left_out, false, &l), Continuity::Unjudged);
        assert_eq!(h.frame(at(132), &inside(0), false, &l), Continuity::Follows(132_000));
        // with a detection in view it is one like others, and a fault is one anyway
        let some = Points { inside: 1, ..left_out };
        assert_eq!(run(&mut h, 198, 1, some), [Condition::Healthy]);
        h.frame(at(264), &left_out, true, &l);
        assert_eq!(h.condition(at(264), &l), Condition::Blind);
    }

    #[test]
    fn two_stray_points_a_second_apart_do_not_keep_coming() {
        let mut h = Health::NEW;
        for i in 0..6 {
            for (at, frames, points) in [(0, 1, OUTSIDE), (66, 12, inside(0))] {
                let conditions = run(&mut h, i * 13 * 66 + at, frames, points);
                assert!(conditions.iter().all(|c| *c == Condition::Healthy), "{i}: {conditions:?}");
            }
        }
    }

    /// Points that come again and cannot be judged, and those let through.
    fn unjudged(again: u32, passed: u32) -> Points {
        Points { inside: again + passed, passed, again, ..NO_POINTS }
    }

    #[test]
    fn points_that_come_again_and_cannot_be_judged_are_no_free_road_after_three_seconds() {
        let mut h = Health::NEW;
        let conditions = run(&mut h, 0, 47, unjudged(5, 0));
        assert!(conditions[..46].iter().all(|c| *c == Condition::Healthy), "2970 ms: {conditions:?}");
        assert_eq!(conditions[46], Condition::Unusable, "3036 ms");
        assert!(h.in_doubt());
        assert_eq!(run(&mut h, 47 * 66, 60, inside(0)).last(), Some(&Condition::Unusable), "silence does not mend it");
        assert_eq!(run(&mut h, 107 * 66, 1, unjudged(0, 4)), [Condition::Unusable], "nor do a few points");
        assert_eq!(run(&mut h, 108 * 66, 1, unjudged(0, 1)), [Condition::Healthy], "it is over when they pass");
    }

    #[test]
    fn one_in_twenty_that_is_let_through_is_none_and_more_are_evidence() {
        assert_eq!(run(&mut Health::default(), 0, 60, unjudged(19, 1)).last(), Some(&Condition::Unusable));
        for points in [unjudged(18, 1), unjudged(4, 0), unjudged(100, 6)] {
            assert!(run(&mut Health::default(), 0, 600, points).iter().all(|c| *c == Condition::Healthy), "{points:?}");
        }
        // after a day's traffic it is the last seconds that count
        let mut h = Health::NEW;
        run(&mut h, 0, 6000, unjudged(0, 80));
        let conditions = run(&mut h, 6000 * 66, 76, unjudged(80, 0));
        assert_eq!((conditions[0], conditions[75]), (Condition::Healthy, Condition::Unusable), "within 5 s");
    }

    #[test]
    fn frames_all_of_whose_points_are_left_out_are_unusable_too() {
        let (mut h, l) = (Health::NEW, limits());
        let marked = Points { unwanted: 9, again: 9, ..NO_POINTS };
        let conditions = run(&mut h, 0, 47, marked);
        assert_eq!((conditions[45], conditions[46]), (Condition::Starting, Condition::Unusable));
        assert_eq!(h.condition(at(46 * 66 + 501), &l), Condition::Starting, "and then nothing comes");
        // a gap begins another run
        assert_eq!(run(&mut h, 10_000, 20, marked).last(), Some(&Condition::Unusable), "it lasts until they pass");
        let mut h = Health::NEW;
        for i in 0..20 {
            assert_eq!(run(&mut h, i * 4000, 30, unjudged(9, 0)).last(), Some(&Condition::Healthy), "{i}");
        }
    }

    #[test]
    fn points_that_are_none_do_not_end_blindness_and_points_outside_do() {
        let mut h = Health::NEW;
        run(&mut h, 0, 1, inside(5));
        assert_eq!(run(&mut h, 66, 20, inside(0)).last(), Some(&Condition::Blind));
        assert_eq!(run(&mut h, 21 * 66, 1, NOT_FINITE), [Condition::Blind]);
        assert_eq!(run(&mut h, 22 * 66, 1, OUTSIDE), [Condition::Healthy]);
    }
}
