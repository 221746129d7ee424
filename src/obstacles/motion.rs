//! Motion in the plane with the heading left open: speed along the line of sight from Doppler, across
//! it from where the detections are.
//!
//! # Model
//! The sensor measures the component of the velocity along the line of sight to centimetres a second
//! in every frame, and nothing of the one across. That one follows from place: a Kalman filter of two
//! states, place and speed across the line of sight, whose measurement is the centre of a frame's
//! detections. It is right wherever a thing goes, and slow: 2 m/s after half a second.

use crate::math::{mul_shift, ratio};
use crate::time::Step;
use crate::trig::Direction;

/// Growth of the variance of the speed across: a vehicle changes it by 2 m/s within a second,
/// (cm/s)^2 per second.
const TURNING_NOISE: i32 = 200 * 200;
/// Greatest variance of a place, cm^2, and of a speed, (cm/s)^2: 20 m and 20 m/s.
const MOST_VARIANCE: i32 = 2000 * 2000;

/// Place and velocity without a heading.
#[derive(Debug, Clone, Copy)]
pub struct FreeMotion {
    /// Middle of what is seen, 2^-8 cm.
    pub place: (i32, i32),
    /// 2^-8 cm/s.
    pub velocity: (i32, i32),
    /// Across the line of sight: variance of the place (cm^2), covariance (cm^2/s), variance of the
    /// speed ((cm/s)^2).
    variance: [i32; 3],
}

/// What one frame tells of a motion.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Detections.
    pub count: i32,
    /// Their centre, 2^-8 cm.
    pub centre: (i32, i32),
    /// Variance of that centre across the line of sight, cm^2.
    pub variance: i32,
    /// Line of sight to it.
    pub sight: Direction,
    /// Measured radial velocity, 2^-8 cm/s.
    pub radial: i32,
}

impl FreeMotion {
    /// At a place of this variance (cm^2), with a velocity (2^-8 cm/s) whose component across the line
    /// of sight has this variance ((cm/s)^2).
    pub fn new(place: (i32, i32), place_variance: i32, velocity: (i32, i32), speed_variance: i32) -> Self {
        Self { place, velocity, variance: [place_variance, 0, speed_variance] }
    }

    /// Standard deviation of the speed across the line of sight, squared, (cm/s)^2.
    pub fn speed_variance(&self) -> i32 {
        self.variance[2]
    }

    /// Moves on by a time step.
    pub fn predict(&mut self, step: Step) {
        self.place.0 += step.times(self.velocity.0);
        self.place.1 += step.times(self.velocity.1);
        let [place, both, speed] = self.variance;
        let grown = step.times(speed);
        self.variance = [
            (place + step.times(2 * both + grown)).min(MOST_VARIANCE),
            (both + grown).min(MOST_VARIANCE),
            (speed + step.times(TURNING_NOISE)).min(MOST_VARIANCE),
        ];
    }

    /// Takes what a frame tells.
    pub fn update(&mut self, seen: &Seen) {
        let sight = seen.sight;
        let off = (seen.centre.0 - self.place.0, seen.centre.1 - self.place.1);
        let (ahead, left) = (sight.along(off.0, off.1), sight.across(off.0, off.1));
        let [place, both, speed] = self.variance;
        let total = (place + seen.variance).max(1);
        // gains in 2^-12, the second one per second
        let (to_place, to_speed) = (ratio::<12>(place, total), ratio::<12>(both, total));
        let radial = seen.radial - sight.along(self.velocity.0, self.velocity.1);
        let radial = radial * seen.count / (seen.count + 1);
        let across = mul_shift(left, to_speed, 12);
        self.push(sight, radial, across);
        // ranges are good to decimetres, but where on the vehicle the reflection is varies as across
        let (ahead, left) = (mul_shift(ahead, to_place, 12), mul_shift(left, to_place, 12));
        let (dx, dy) = turned(sight, ahead, left);
        self.place.0 += dx;
        self.place.1 += dy;
        self.variance = [
            (place - mul_shift(place, to_place, 12)).max(1),
            both - mul_shift(both, to_place, 12),
            (speed - mul_shift(both, to_speed, 12)).max(1),
        ];
    }

    fn push(&mut self, sight: Direction, ahead: i32, left: i32) {
        let (dx, dy) = turned(sight, ahead, left);
        self.velocity.0 += dx;
        self.velocity.1 += dy;
    }
}

/// A vector given ahead and to the left of a direction, in the direction's own axes.
fn turned(d: Direction, ahead: i32, left: i32) -> (i32, i32) {
    let (x, y) = (i32::from(d.x), i32::from(d.y));
    (mul_shift(ahead, x, 14) - mul_shift(left, y, 14), mul_shift(ahead, y, 14) + mul_shift(left, x, 14))
}
