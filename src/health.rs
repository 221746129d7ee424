//! Whether the sensor's silence means a free road, a blind sensor or no sensor at all.
//!
//! A healthy frame within its hold time is evidence for the whole field of view, so an empty road
//! is visible. A run of empty frames after traffic is a sensor that went blind, and no frames at all
//! make everything unknown.

use crate::config::{ConfigError, within};
use crate::time::Time;

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
    /// How long frames may be empty after traffic before the sensor counts as blind.
    pub blind_after_s: f32,
    /// A longer gap between frames resets the grids.
    pub reset_gap_s: f32,
}

impl Default for HealthConfig {
    fn default() -> Self {
        Self { hold_s: 0.5, blind_after_s: 1.0, reset_gap_s: 1.0 }
    }
}

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
        let micros = |name, v| within(name, v, 0.01, 60.0).map(|s: f32| crate::math::round_i32(s * 1e6) as u64);
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
    /// Frames come, but they have been empty since there was traffic, or the sensor says so.
    Blind,
    /// No frame within the hold time.
    Stale,
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
}

impl Default for Health {
    fn default() -> Self {
        Self::NEW
    }
}

impl Health {
    /// Before the first frame.
    pub const NEW: Self = Self { last_frame: None, traffic: false, empty_since: None, blind: false };

    /// Takes note of a frame. `detections` counts what the radar reported, gated or not; `fault` is
    /// its own flag.
    pub fn frame(&mut self, now: Time, detections: usize, fault: bool, limits: &HealthLimits) -> Continuity {
        let continuity = match self.last_frame {
            None => Continuity::First,
            Some(last) => match now.since(last) {
                None | Some(0) => Continuity::ClockStepped,
                Some(gap) if gap > limits.reset_gap_us => Continuity::Gap,
                Some(gap) => Continuity::Follows(gap),
            },
        };
        if continuity.resets() {
            // a run of empty frames has to be seen without a break; a blind sensor stays blind
            self.empty_since = None;
        }
        if detections > 0 {
            self.traffic = true;
            self.empty_since = None;
            self.blind = false;
        } else if self.traffic {
            let since = *self.empty_since.get_or_insert(now);
            self.blind |= now.since(since).is_some_and(|quiet| quiet >= limits.blind_after_us);
        }
        self.blind |= fault;
        self.last_frame = Some(now);
        continuity
    }

    /// The sensor's condition at a moment.
    pub fn condition(&self, now: Time, limits: &HealthLimits) -> Condition {
        match self.last_frame {
            None => Condition::Starting,
            Some(last) if now.since(last).is_none_or(|age| age > limits.hold_us) => Condition::Stale,
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

    #[test]
    fn an_empty_road_from_the_start_is_healthy() {
        let (mut h, l) = (Health::NEW, limits());
        assert_eq!(h.condition(at(0), &l), Condition::Starting);
        for i in 0..100 {
            h.frame(at(i * 66), 0, false, &l);
            assert_eq!(h.condition(at(i * 66), &l), Condition::Healthy);
        }
    }

    #[test]
    fn silence_after_traffic_is_blindness_until_something_is_seen() {
        let (mut h, l) = (Health::NEW, limits());
        h.frame(at(0), 5, false, &l);
        for i in 1..15 {
            h.frame(at(i * 66), 0, false, &l);
        }
        assert_eq!(h.condition(at(14 * 66), &l), Condition::Healthy);
        h.frame(at(1065), 0, false, &l);
        assert_eq!(h.condition(at(1065), &l), Condition::Healthy);
        h.frame(at(1066), 0, false, &l);
        assert_eq!(h.condition(at(1066), &l), Condition::Blind, "a second after the first empty frame");
        h.frame(at(1132), 1, false, &l);
        assert_eq!(h.condition(at(1132), &l), Condition::Healthy);
        h.frame(at(1198), 1, true, &l);
        assert_eq!(h.condition(at(1198), &l), Condition::Blind, "the sensor says so itself");
    }

    #[test]
    fn a_map_holds_half_a_second() {
        let (mut h, l) = (Health::NEW, limits());
        h.frame(at(0), 5, false, &l);
        assert_eq!(h.condition(at(500), &l), Condition::Healthy);
        assert_eq!(h.condition(at(501), &l), Condition::Stale);
    }

    #[test]
    fn gaps_and_steps_of_the_clock_reset() {
        let (mut h, l) = (Health::NEW, limits());
        assert_eq!(h.frame(at(5000), 1, false, &l), Continuity::First);
        assert_eq!(h.frame(at(5066), 1, false, &l), Continuity::Follows(66_000));
        assert_eq!(h.frame(at(6066), 1, false, &l), Continuity::Follows(1_000_000));
        assert_eq!(h.frame(at(7067), 1, false, &l), Continuity::Gap);
        assert_eq!(h.frame(at(7067), 1, false, &l), Continuity::ClockStepped);
        assert_eq!(h.frame(at(3000), 0, false, &l), Continuity::ClockStepped);
        assert!(Continuity::Gap.resets() && !Continuity::First.resets());
        // a step back never makes a later moment look fresh
        assert_eq!(h.condition(at(2000), &l), Condition::Stale);
    }
}
