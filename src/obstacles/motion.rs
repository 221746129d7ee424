//! Motion in the plane with the heading left open: speed along the line of sight from Doppler, across
//! it from where the detections are.
//!
//! # Model
//! The sensor measures the component of the velocity along the line of sight to centimetres a second
//! in every frame. The one across follows from place: a Kalman filter of two states, place and speed
//! across the line of sight, whose measurement is the centre of a frame's detections. It is right wherever
//! a thing goes, and slow: 2 m/s after half a second. Where detections of one frame span an angle, how
//! Doppler changes over it (`doppler_slope`) tells that speed sooner.

use crate::fixed::math::{mul_shift, ratio};
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;

/// Largest correction of a speed in one frame, and largest speed along an axis, 2^-8 cm/s: 20 and 70 m/s.
const MOST_PUSH: i32 = 2000 << 8;
const MOST_SPEED: i32 = 7000 << 8;
/// Greatest variance of a place, cm^2, and of a speed, (cm/s)^2: 20 m and 20 m/s.
const MOST_VARIANCE: i32 = 2000 * 2000;
/// Most that the first grows a second, so that the longest gap, a minute, fits into 32 bits.
const MOST_GROWTH: i32 = i32::MAX / 64;

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

/// What one frame says of a motion.
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

/// A speed across the line of sight.
#[derive(Debug, Clone, Copy)]
pub struct Across {
    /// Line of sight.
    pub sight: Direction,
    /// To its left, cm/s.
    pub speed: i32,
    /// (cm/s)^2.
    pub variance: i32,
}

impl FreeMotion {
    /// At a place of this variance (cm^2), with a velocity (2^-8 cm/s) whose component across the line
    /// of sight has this variance ((cm/s)^2).
    pub fn new(place: (i32, i32), place_variance: i32, velocity: (i32, i32), speed_variance: i32) -> Self {
        Self { place, velocity, variance: [place_variance, 0, speed_variance] }
    }

    /// Whether a speed (cm/s) is more than so many standard deviations of the speed across.
    pub fn is_sure_of(&self, speed_cm_s: i32, sigmas: i32) -> bool {
        let speed = speed_cm_s.min(MOST_SPEED >> 8);
        // 2^-4 standard deviations
        speed * speed > mul_shift(self.variance[2], sigmas * sigmas, 8)
    }

    /// Variance of the speed across the line of sight, (cm/s)^2.
    pub fn speed_variance(&self) -> i32 {
        self.variance[2]
    }

    /// Moves on by a time step, over which the variance of the speed grows by `turning_noise` a second
    /// ((cm/s)^2).
    pub fn predict(&mut self, step: Step, turning_noise: i32) {
        self.place.0 += step.times(self.velocity.0);
        self.place.1 += step.times(self.velocity.1);
        let [place, both, speed] = self.variance;
        let grown = step.times(speed);
        self.variance = [
            (place + step.times((2 * both + grown).min(MOST_GROWTH))).min(MOST_VARIANCE),
            (both + grown).min(MOST_VARIANCE),
            (speed + step.times(turning_noise)).min(MOST_VARIANCE),
        ];
    }

    /// Takes what a frame says.
    pub fn update(&mut self, seen: &Seen) {
        let sight = seen.sight;
        let off = (seen.centre.0 - self.place.0, seen.centre.1 - self.place.1);
        let (ahead, left) = (sight.along(off.0, off.1), sight.across(off.0, off.1));
        let [place, both, speed] = self.variance;
        let total = (place + seen.variance).max(1);
        // gains in 2^-12, the second one per second
        let (to_place, to_speed) = (ratio::<12>(place, total), ratio::<12>(both, total));
        let radial = seen.radial - sight.along(self.velocity.0, self.velocity.1);
        let radial = radial - radial / (seen.count + 1).max(1);
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

    /// Takes a speed across the line of sight that was measured.
    pub fn take_across(&mut self, seen: &Across) {
        let sight = seen.sight;
        let [place, both, speed] = self.variance;
        let total = (speed + seen.variance).max(1);
        // gains in 2^-12, the first one in seconds
        let (to_place, to_speed) = (ratio::<12>(both, total), ratio::<12>(speed, total));
        let off = (seen.speed << 8) - sight.across(self.velocity.0, self.velocity.1);
        self.push(sight, 0, mul_shift(off, to_speed, 12));
        let (dx, dy) = turned(sight, 0, mul_shift(off, to_place, 12));
        self.place.0 += dx;
        self.place.1 += dy;
        self.variance = [
            (place - mul_shift(both, to_place, 12)).max(1),
            both - mul_shift(both, to_speed, 12),
            (speed - mul_shift(speed, to_speed, 12)).max(1),
        ];
    }

    fn push(&mut self, sight: Direction, ahead: i32, left: i32) {
        let most = |v: i32| v.clamp(-MOST_PUSH, MOST_PUSH);
        let (dx, dy) = turned(sight, most(ahead), most(left));
        self.velocity.0 = (self.velocity.0 + dx).clamp(-MOST_SPEED, MOST_SPEED);
        self.velocity.1 = (self.velocity.1 + dy).clamp(-MOST_SPEED, MOST_SPEED);
    }
}

/// A vector given ahead and to the left of a direction, in the direction's own axes.
fn turned(d: Direction, ahead: i32, left: i32) -> (i32, i32) {
    let (x, y) = (i32::from(d.x), i32::from(d.y));
    (mul_shift(ahead, x, 14) - mul_shift(left, y, 14), mul_shift(ahead, y, 14) + mul_shift(left, x, 14))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_US: u64 = 66_972;
    /// 1 m/s in a second, (cm/s)^2.
    const TURNING: i32 = 100 * 100;

    /// Follows a point that starts 40 m ahead and 5 m to the right, from a wrong velocity on.
    fn followed(velocity: [f64; 2], start: (i32, i32), frames: usize) -> [f64; 2] {
        let mut at = [40.0, -5.0];
        let fine = |v: f64| (v * 25_600.0).round() as i32;
        let mut motion = FreeMotion::new((fine(at[0]), fine(at[1])), 150 * 150, start, 1000 * 1000);
        let step = Step::from_micros(STEP_US);
        for _ in 0..frames {
            motion.predict(step, TURNING);
            for k in [0, 1] {
                at[k] += velocity[k] * STEP_US as f64 * 1e-6;
            }
            let distance = f64::hypot(at[0], at[1]);
            motion.update(&Seen {
                count: 2,
                centre: (fine(at[0]), fine(at[1])),
                variance: 100 * 100,
                sight: Direction::of(fine(at[0]), fine(at[1])),
                radial: fine((velocity[0] * at[0] + velocity[1] * at[1]) / distance),
            });
        }
        [motion.velocity.0, motion.velocity.1].map(|v| f64::from(v) / 25_600.0)
    }

    #[test]
    fn what_crosses_is_found_to_cross_whichever_way() {
        for velocity in [[0.0, 10.0], [0.0, -10.0], [-6.0, 6.0]] {
            let found = followed(velocity, (1500 << 8, 0), 20);
            let off = f64::hypot(found[0] - velocity[0], found[1] - velocity[1]);
            assert!(off < 1.0, "{found:?} for {velocity:?}");
        }
    }

    #[test]
    fn the_speed_along_the_line_of_sight_is_right_at_once() {
        let found = followed([20.0, 0.0], (0, 0), 4);
        assert!((found[0] - 20.0).abs() < 1.0, "{found:?}");
    }

    #[test]
    fn a_speed_across_that_is_measured_counts_as_much_as_it_is_sure() {
        let after = |variance| {
            let mut motion = FreeMotion::new((4000 << 8, 0), 150 * 150, (500 << 8, 0), 1000 * 1000);
            motion.take_across(&Across { sight: Direction::AHEAD, speed: -900, variance });
            (motion.velocity.0 >> 8, motion.velocity.1 >> 8, motion.speed_variance())
        };
        let (ahead, across, variance) = after(10 * 10);
        assert!(ahead == 500 && (-905..=-895).contains(&across) && variance < 300, "{across} {variance}");
        let (ahead, across, variance) = after(1000 * 1000);
        assert!(ahead == 500 && (-455..=-445).contains(&across), "{across}");
        assert!((490_000..=510_000).contains(&variance), "{variance}");
        // what has moved on since it was sure of its place lies as much farther to that side
        let mut motion = FreeMotion::new((4000 << 8, 0), 150 * 150, (0, 0), 1000 * 1000);
        motion.predict(Step::from_micros(500_000), 0);
        motion.take_across(&Across { sight: Direction::AHEAD, speed: 800, variance: 10 });
        assert!((390..=410).contains(&(motion.place.1 >> 8)), "{:?}", motion.place);
    }

    #[test]
    fn the_longer_it_is_unseen_the_less_is_sure() {
        let mut motion = FreeMotion::new((0, 0), 100, (0, 0), 100 * 100);
        assert!(motion.is_sure_of(500, 3 << 4) && !motion.is_sure_of(200, 3 << 4));
        (0..300).for_each(|_| motion.predict(Step::from_micros(STEP_US), TURNING));
        assert!(!motion.is_sure_of(500, 3 << 4));
    }

    #[test]
    fn the_longest_gap_leaves_nothing_sure_and_nothing_negative() {
        for variance in [1, 1000 * 1000, MOST_VARIANCE] {
            let mut motion = FreeMotion::new((0, 0), 150 * 150, (0, 0), variance);
            for _ in 0..3 {
                motion.predict(Step::from_micros(60_000_000), MOST_VARIANCE);
                let [place, both, speed] = motion.variance;
                assert!(place > 0 && both > 0 && speed == MOST_VARIANCE, "{:?} from {variance}", motion.variance);
            }
            assert_eq!(motion.variance, [MOST_VARIANCE; 3]);
        }
    }

    #[test]
    fn no_measurement_makes_it_faster_than_anything_drives() {
        let mut motion = FreeMotion::new((0, 0), 1, (0, 0), 1000 * 1000);
        for k in 0..1000 {
            motion.predict(Step::from_micros(500_000), TURNING);
            let far = if k % 2 == 0 { 60_000 << 8 } else { -(60_000 << 8) };
            let seen = Seen { count: 256, centre: (far, -far), variance: 400, sight: Direction::AHEAD, radial: far };
            motion.update(&seen);
            assert!(motion.velocity.0.abs() <= MOST_SPEED && motion.velocity.1.abs() <= MOST_SPEED);
        }
    }
}
