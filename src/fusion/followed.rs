//! Which observations of moving obstacles are of the same one, and how often two sensors have agreed on it.
//!
//! # Model
//! Each obstacle is looked for where the one before would be by now, at its speed between the last observations,
//! smoothed. What lies within 2.5 m of that and was not observed in this frame yet is the same one; anything else is
//! new. What was not observed for half a second is forgotten.

use crate::fixed::math;
use crate::fixed::time::Time;
use crate::sensor::road::RoadPoint;

/// Obstacles that are followed at once.
const MOST: usize = 48;
/// How far from where it is expected an obstacle may be, centimetres.
const GATE_CM: i32 = 250;
/// Until when it is expected, microseconds.
const FORGOTTEN_US: u64 = 500_000;
/// Faster than anything on a road, cm/s.
const FASTEST_CM_S: i32 = 10_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct One {
    at: RoadPoint,
    /// cm/s.
    speed: (i32, i32),
    last: Option<Time>,
    /// Frames in which both sensors detected it, saturating.
    by_both: u8,
}

/// The obstacles that another sensor follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Followed([One; MOST]);

impl Followed {
    pub(super) const NONE: Self = Self([One { at: RoadPoint::new(0, 0), speed: (0, 0), last: None, by_both: 0 }; MOST]);

    /// An obstacle is observed, by both sensors or by the other alone; in how many frames both have, before this one.
    pub(super) fn take(&mut self, now: Time, at: RoadPoint, both: bool) -> u8 {
        let distance = |one: &One| -> Option<i32> {
            let since_us = now.since(one.last?).filter(|us| (1..FORGOTTEN_US).contains(us))?;
            let ms = i32::try_from(since_us / 1000).ok()?;
            let off = |now: i32, then: i32, speed: i32| now.saturating_sub(then).saturating_sub(speed * ms / 1000);
            let (x, y) = (off(at.x_cm, one.at.x_cm, one.speed.0), off(at.y_cm, one.at.y_cm, one.speed.1));
            let near = x.unsigned_abs().max(y.unsigned_abs()) <= GATE_CM.unsigned_abs();
            near.then(|| math::length(x, y)).filter(|d| *d <= GATE_CM)
        };
        let known = self.0.iter_mut().filter_map(|one| Some((distance(one)?, one))).min_by_key(|(d, _)| *d);
        if let Some((_, one)) = known {
            one.go(now, at);
            let before = one.by_both;
            one.by_both = before.saturating_add(u8::from(both));
            return before;
        }
        // in place of what was forgotten, or of what was observed longest ago
        if let Some(oldest) = self.0.iter_mut().min_by_key(|one| one.last.map(Time::micros)) {
            *oldest = One { at, speed: (0, 0), last: Some(now), by_both: u8::from(both) };
        }
        0
    }
}

impl One {
    fn go(&mut self, now: Time, to: RoadPoint) {
        let since = self.last.and_then(|last| now.since(last)).unwrap_or(0);
        let us = i32::try_from(since).unwrap_or(i32::MAX).max(1);
        // a few metres at most: the gate
        let part = |from: i32, to: i32, speed: i32| {
            let new = (i64::from(to) - i64::from(from)) * 1_000_000 / i64::from(us);
            let new = i32::try_from(new).unwrap_or(FASTEST_CM_S).clamp(-FASTEST_CM_S, FASTEST_CM_S);
            speed + (new - speed) / 8
        };
        self.speed = (part(self.at.x_cm, to.x_cm, self.speed.0), part(self.at.y_cm, to.y_cm, self.speed.1));
        (self.at, self.last) = (to, Some(now));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Time {
        Time::from_micros(1000 * ms)
    }

    #[test]
    fn a_vehicle_is_the_same_one_while_it_drives_on_and_the_next_is_another() {
        let mut followed = Followed::NONE;
        // 20 m/s along y, another one 8 m behind it, 15 frames a second
        for k in 0..30 {
            let y = 133 * k;
            assert_eq!(
                followed.take(ms(66 * u64::try_from(k).unwrap()), RoadPoint::new(500, y), true),
                u8::try_from(k).unwrap()
            );
            assert_eq!(followed.take(ms(66 * u64::try_from(k).unwrap()), RoadPoint::new(500, y - 800), false), 0);
        }
        // where the first will be after three frames without it
        assert_eq!(followed.take(ms(66 * 33), RoadPoint::new(500, 133 * 33), false), 30);
        // too late
        assert_eq!(followed.take(ms(66 * 45), RoadPoint::new(500, 133 * 45), false), 0);
    }

    #[test]
    fn one_observation_a_frame_and_no_more_than_there_is_room_for() {
        let mut followed = Followed::NONE;
        for k in 0..100 {
            assert_eq!(followed.take(ms(5), RoadPoint::new(0, 1000 * k), true), 0);
        }
        assert_eq!(followed.take(ms(5), RoadPoint::new(0, 99_000), true), 0, "of the same frame: another one");
        // the latest are followed
        assert_eq!(followed.take(ms(70), RoadPoint::new(0, 99_000), true), 1);
        assert_eq!(followed.take(ms(70), RoadPoint::new(0, 0), true), 0);
    }

    #[test]
    fn places_at_the_end_of_the_numbers_do_no_harm() {
        let mut followed = Followed::NONE;
        followed.take(ms(1), RoadPoint::new(i32::MAX, i32::MIN), true);
        assert_eq!(followed.take(ms(2), RoadPoint::new(i32::MIN, i32::MAX), true), 0);
        assert_eq!(followed.take(ms(0), RoadPoint::new(i32::MAX, i32::MIN), true), 0, "a clock that steps back");
    }
}
