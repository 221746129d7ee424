//! Whether sensors place the same obstacles at the same bearings: a mount that was turned, or is not as it was
//! configured.
//!
//! # Model
//! Two sensors follow the same vehicle. Seen from the first, the other one's place for it lies at another bearing than
//! its own: that is the residual, of both signs from vehicle to vehicle, as they see other sides of it, and of one sign
//! where a mount is turned. The median of it is followed by its sign alone: each window (`window_ms`) the median moves
//! by `step_deg`, times the share of residuals above it less the share below, so that wrong pairs weigh as much as any.
//! A turn is known in the frame of the sensor that is turned and of the one that is not, where it is smaller or larger
//! with the distances.
//!
//! A pair disagrees from `limit_deg` on, in the frame of either, until both have sunk to `release_deg`. Who of them is
//! turned, a third one tells: a sensor is turned if it disagrees with at least two others that agree with each other.
//! The road is such a third one where its lanes are known: the place it gives for a vehicle is the nearest on the
//! middle of a lane that goes its way. So `S` are all sensors, and one more for the road if it is asked.
//!
//! # Limits
//! Bearings of what is 15 to 120 m away; nearer, the sides of a vehicle are degrees apart. A turn of more than a lane
//! at that distance is another lane's to the road, and to a sensor what is more than 4 m apart is not the same.
//! Vehicles that all drive the same way, and are all seen from one side, leave half a degree in order. 0.3 kB for
//! three.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::time::Time;
use crate::fixed::trig;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::{Levelling, Mount};
use crate::sensor::road::RoadPoint;

use super::window::Window;

/// When a pair disagrees.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct AlignmentConfig {
    /// Median residual from which a pair disagrees, degrees.
    pub limit_deg: f32,
    /// To which it has to sink for it to agree again, degrees.
    pub release_deg: f32,
    /// Most that the median moves in a window, degrees.
    pub step_deg: f32,
    /// Length of a window, ms.
    pub window_ms: u16,
}

impl Default for AlignmentConfig {
    fn default() -> Self {
        Self { limit_deg: 0.7, release_deg: 0.4, step_deg: 0.1, window_ms: 1000 }
    }
}

/// Bearings count from here to there, centimetres.
const FROM_CM: i32 = 1500;
const TO_CM: i32 = 12_000;
/// Farther apart it is not the same vehicle, centimetres.
const SAME_CM: i32 = 400;
/// Least residuals of a window that moves the median.
const LEAST: u16 = 5;
/// Windows until which the median moves faster than by `step_deg`, and how much faster.
const FIRST: [(u16, i64); 2] = [(3, 4), (6, 2)];
/// Windows before which no pair disagrees, and after which one that does not agrees.
const SETTLED: u16 = 6;
const ENOUGH: u16 = 10;
/// Fraction bits of a median.
const FRACTION: u32 = 8;

/// Of one sensor against another, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Residual {
    /// 2^-24 turns.
    median: i32,
    above: u16,
    below: u16,
    /// Windows that moved it, saturating.
    windows: u16,
    disagrees: bool,
}

/// `S` sensors on one road, each against each.
#[derive(Debug, Clone)]
pub struct Alignment<const S: usize> {
    sensors: [Option<Levelling>; S],
    limit: i32,
    release: i32,
    step: i32,
    window: Window,
    pairs: [[Residual; S]; S],
}

impl<const S: usize> Alignment<S> {
    /// For sensors by their mounts; none for the road.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within limits
    pub fn new(mounts: &[Option<Mount>; S], config: &AlignmentConfig) -> Result<Self, ConfigError> {
        let turns = |degrees: f32| math::round_i32(degrees * (16_777_216.0 / 360.0));
        let limit = within("alignment.limit_deg", config.limit_deg, 0.1, 10.0)?;
        let release = within("alignment.release_deg", config.release_deg, 0.0, limit)?;
        let step = within("alignment.step_deg", config.step_deg, 0.01, 1.0)?;
        within("alignment.window_ms", f32::from(config.window_ms), 100.0, 60_000.0)?;
        let mut sensors = [None; S];
        for (to, mount) in sensors.iter_mut().zip(mounts) {
            *to = mount.as_ref().map(Mount::levelling).transpose()?;
        }
        Ok(Self {
            sensors,
            limit: turns(limit),
            release: turns(release),
            step: turns(step),
            window: Window::of_ms(config.window_ms),
            pairs: [[Residual { median: 0, above: 0, below: 0, windows: 0, disagrees: false }; S]; S],
        })
    }

    /// Two sensors follow what may be one vehicle, the first at `own`, the other at `theirs`. Whether it counted. Radars tell
    /// where it is seen (`Obstacles::where_seen`), not where its middle is inferred to be.
    pub fn observe(&mut self, first: usize, own: RoadPoint, other: usize, theirs: RoadPoint) -> bool {
        let apart = |a: i32, b: i32| a.saturating_sub(b).clamp(-SAME_CM - 1, SAME_CM + 1);
        if first == other || math::length(apart(own.x_cm, theirs.x_cm), apart(own.y_cm, theirs.y_cm)) > SAME_CM {
            return false;
        }
        let one = self.residual(first, own, other, theirs);
        let reverse = self.residual(other, theirs, first, own);
        one | reverse
    }

    fn residual(&mut self, of: usize, own: RoadPoint, against: usize, theirs: RoadPoint) -> bool {
        let Some(levelling) = self.sensors.get(of).copied().flatten() else { return false };
        let Some(residual) = self.pairs.get_mut(of).and_then(|row| row.get_mut(against)) else { return false };
        let ((x, y), (tx, ty)) = (levelling.place(own), levelling.place(theirs));
        if !(FROM_CM..=TO_CM).contains(&math::length(x, y)) {
            return false;
        }
        let off = i32::from((trig::bearing(tx, ty) - trig::bearing(x, y)).raw()) << FRACTION;
        let count = if off > residual.median { &mut residual.above } else { &mut residual.below };
        *count = count.saturating_add(1);
        true
    }

    /// Closes the window when it is over. Time that steps back begins a new one.
    pub fn advance(&mut self, now: Time) {
        if !self.window.is_over(now) {
            return;
        }
        for residual in self.pairs.iter_mut().flatten() {
            let (above, below) = (i64::from(residual.above), i64::from(residual.below));
            if above + below < i64::from(LEAST) {
                // too few tell nothing; they wait for more
                continue;
            }
            // faster at first, when it has farthest to go
            let (_, faster) = FIRST.into_iter().find(|(until, _)| residual.windows < *until).unwrap_or((0, 1));
            let moved = faster * i64::from(self.step) * (above - below) / (above + below);
            residual.median += i32::try_from(moved).unwrap_or(0);
            (residual.above, residual.below) = (0, 0);
            residual.windows = residual.windows.saturating_add(1);
            let limit = if residual.disagrees { self.release } else { self.limit };
            residual.disagrees = residual.windows >= SETTLED && residual.median.abs() >= limit;
        }
    }

    fn pair(&self, of: usize, against: usize) -> Option<&Residual> {
        self.pairs.get(of).and_then(|row| row.get(against))
    }

    /// Whether two sensors place the same vehicles differently.
    pub fn disagree(&self, a: usize, b: usize) -> bool {
        [self.pair(a, b), self.pair(b, a)].into_iter().flatten().any(|residual| residual.disagrees)
    }

    /// Whether they have been compared for long enough and place them alike.
    fn agree(&self, a: usize, b: usize) -> bool {
        let enough = [self.pair(a, b), self.pair(b, a)].into_iter().flatten().any(|r| r.windows >= ENOUGH);
        enough && !self.disagree(a, b)
    }

    /// How far the first seems to be turned to the left by what the other sees, median; none before they were compared.
    pub fn median(&self, of: usize, against: usize) -> Option<Angle> {
        let residual = self.pair(of, against).filter(|r| r.windows > 0)?;
        i16::try_from(residual.median >> FRACTION).ok().map(Angle::from_raw)
    }

    /// How far a sensor is turned to the left, where two others that agree with each other disagree with it.
    pub fn turned(&self, sensor: usize) -> Option<Angle> {
        self.sensors.get(sensor).copied().flatten()?;
        let others = || (0..S).filter(|k| *k != sensor && self.disagree(sensor, *k));
        let judges = others().flat_map(|a| others().filter(move |b| a < *b).map(move |b| (a, b)));
        let (a, b) = judges.into_iter().find(|(a, b)| self.agree(*a, *b))?;
        let medians = [a, b].map(|k| self.median(sensor, k));
        medians.into_iter().flatten().min_by_key(|m| m.raw().unsigned_abs())
    }
}
