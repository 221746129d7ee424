//! Speed across the line of sight, from how Doppler changes over a vehicle.
//!
//! # Model
//! All points of what drives straight on move alike, but each shows the part of that motion along its own line of sight. So
//! Doppler changes over a vehicle by its speed across for each radian that it spans: after Kellner, Barjenbruch, Klappstein,
//! Dickmann and Dietmayer, *Instantaneous lateral velocity estimation of a vehicle using Doppler radar* (FUSION 2013). A frame
//! fits that slope by least squares, and what the noise of azimuths adds to the spread of angles is taken off it.
//!
//! # Limits
//! A turn shows the same, by the speed of turning times the distance: 3 degrees a second are taken for noise. What lies higher than
//! is assumed shows more of its speed to a sensor on a mast, which is noise as well: 2 m of height. Where azimuths' noise makes up
//! more than a quarter of the spread, as of one reflection, and of a rear end far ahead, nothing is said.
//!
//! # Cost
//! Four multiplications for each detection, and of 64 bits six divisions for each obstacle that spans an angle.

use super::motion::Across;
use crate::fixed::math;
use crate::fixed::trig::Direction;
use crate::sensor::noise::Noise;

/// Standard deviation of the speed of turning that is taken for noise, 2^-10 rad/s.
const TURNING: i64 = 51;
/// How much higher or lower than assumed a reflection may lie, cm: of a lorry's roof, 2 m.
const HEIGHT_CM: i64 = 200;
/// Parts of the spread of angles of which one may be noise.
const MOST_NOISE: i64 = 4;
/// Greatest standard deviation of a speed that says anything, cm/s.
const MOST_SIGMA: i64 = 2000;
/// Fraction bits of angles and of errors.
const ANGLE: u32 = 10;
/// See [`ANGLE`].
const ERROR: u32 = 4;

/// Where and how fast something is that detections are of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target {
    pub range_cm: i32,
    pub speed_cm_s: i32,
    /// Line of sight to it along the ground, shorter than one where it points down.
    pub sight: Direction,
}

impl Target {
    /// How wrong the part of its speed along the line of sight is where a reflection lies [so much](HEIGHT_CM) higher than
    /// assumed, cm/s.
    fn error_of_height(&self) -> i64 {
        let (x, y) = (i64::from(self.sight.x), i64::from(self.sight.y));
        let down = math::root(u32::try_from((1 << 28) - x * x - y * y).unwrap_or(0));
        ((i64::from(self.speed_cm_s) * i64::from(down)) >> 14) * HEIGHT_CM / i64::from(self.range_cm.max(1))
    }
}

/// Sums over the detections of one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct DopplerSlope {
    /// Line of sight to the first of them, along the ground.
    first: Direction,
    /// Sum of the sines of the angles from it, + to the left, 2^-10; of their squares, 2^-20; and of sine x error, 2^-14 cm/s.
    sums: [i32; 3],
}

impl DopplerSlope {
    pub const NONE: Self = Self { first: Direction::AHEAD, sums: [0; 3] };

    /// Adds a detection, the first or another, whose radial velocity is `error` (2^-4 cm/s) off.
    pub fn add(&mut self, is_first: bool, sight: Direction, error: i32) {
        if is_first {
            self.first = Direction::of(i32::from(sight.x), i32::from(sight.y));
        }
        let angle = self.first.sine(sight) >> (14 - ANGLE);
        let [angles, squares, products] = &mut self.sums;
        *angles += angle;
        *squares = squares.saturating_add(angle * angle);
        *products = products.saturating_add(angle.saturating_mul(error));
    }

    /// What `count` detections whose errors add up to `errors` (2^-4 cm/s) say of the error of a speed across. They are of
    /// something `range_cm` away, which drives at `speed_cm_s`; the sensor sees it along `sight`.
    #[allow(clippy::cast_possible_truncation)] // a mean of sines, and what was limited
    pub fn across(&self, count: i32, errors: i32, target: &Target, noise: &Noise) -> Option<Across> {
        let [angles, squares, products] = self.sums.map(i64::from);
        let n = i64::from(count);
        let sigma = i64::from(noise.azimuth >> (16 - ANGLE)).max(1);
        let of_noise = (n - 1) * sigma * sigma;
        // of most it is told without a division: they spread no more than around the first of them
        if n < 2 || squares < MOST_NOISE * of_noise {
            return None;
        }
        let spread = squares - angles * angles / n;
        let own = spread - of_noise;
        if own <= 0 || spread < MOST_NOISE * of_noise {
            return None;
        }
        let slope = ((products - angles * i64::from(errors) / n) << (ANGLE - ERROR)) / own;
        let doppler = i64::from(noise.radial_velocity_cm_s).pow(2) + target.error_of_height().pow(2);
        let turning = (i64::from(target.range_cm) * TURNING) >> ANGLE;
        // noise of angles makes the slope as much less sure as it adds to their spread
        let variance = (doppler << (2 * ANGLE)) / own * spread / own + turning * turning;
        if variance > MOST_SIGMA * MOST_SIGMA {
            return None;
        }
        let (ahead, left) = (self.first, self.first.left());
        let mean = (angles / n) as i32;
        let turned = |ahead: i16, left: i16| (i32::from(ahead) << ANGLE) + i32::from(left) * mean;
        Some(Across {
            sight: Direction::of(turned(ahead.x, left.x), turned(ahead.y, left.y)),
            speed: slope.clamp(-2 * MOST_SIGMA, 2 * MOST_SIGMA) as i32,
            variance: variance as i32,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{reflection, rules};
    use super::*;
    use crate::frame::reflection::Reflection;

    /// What points at these places, metres, which all move at `velocity`, say where `assumed` is expected of them, m/s.
    fn across(
        places: &[[f64; 2]],
        velocity: [f64; 2],
        assumed: [f64; 2],
        sight: impl Fn(&Reflection) -> Direction,
    ) -> Option<Across> {
        let mut slope = DopplerSlope::NONE;
        let (mut errors, mut target) = (0, Target { range_cm: 0, speed_cm_s: 0, sight: Direction::AHEAD });
        for (k, place) in places.iter().enumerate() {
            let r = reflection(*place, velocity);
            let expected = r.sight.along((assumed[0] * 1600.0) as i32, (assumed[1] * 1600.0) as i32);
            let error = (i32::from(r.radial_velocity_cm_s) << 4) - expected;
            slope.add(k == 0, r.sight, error);
            errors += error;
            let speed_cm_s = (f64::hypot(velocity[0], velocity[1]) * 100.0) as i32;
            target = Target { range_cm: i32::from(r.ground_cm), speed_cm_s, sight: sight(&r) };
        }
        slope.across(places.len() as i32, errors, &target, &rules().noise)
    }

    fn level(r: &Reflection) -> Direction {
        r.sight
    }

    /// A side 4.4 m long before the radar, along y.
    const SIDE: [[f64; 2]; 4] = [[20.0, -2.2], [20.0, 1.5], [20.0, -0.7], [20.0, 2.2]];

    #[test]
    fn what_crosses_shows_how_fast_in_one_frame_and_to_which_side() {
        for speed in [9.0, -9.0, 3.0] {
            let off = across(&SIDE, [0.0, speed], [0.0, 0.0], level).unwrap();
            let found = f64::from(off.speed) / 100.0;
            // the spread of angles is taken to hold the noise that azimuths have, which these have not
            assert!((1.0..1.25).contains(&(found / speed)), "{found} m/s for {speed}");
            assert!(off.sight.x > 16_000 && off.sight.y.abs() < 400, "{:?}", off.sight);
        }
    }

    #[test]
    fn it_is_the_error_of_what_is_assumed() {
        let off = across(&SIDE, [-4.0, 9.0], [-4.0, 9.0], level).unwrap();
        assert!(off.speed.abs() < 30, "{off:?}");
        let off = across(&SIDE, [-4.0, 6.0], [-4.0, 9.0], level).unwrap();
        assert!((-380..=-290).contains(&off.speed), "{off:?}");
    }

    #[test]
    fn one_reflection_or_a_rear_end_far_ahead_says_nothing() {
        assert!(across(&SIDE[..1], [0.0, 9.0], [0.0, 0.0], level).is_none());
        assert!(across(&[[100.0, -0.9], [100.0, 0.9]], [20.0, 0.0], [20.0, 0.0], level).is_none());
    }

    #[test]
    fn the_farther_it_is_and_the_lower_below_the_more_may_be_a_turn_or_a_height() {
        let variance = |places: &[[f64; 2]], sight: fn(&Reflection) -> Direction| {
            across(places, [0.0, 9.0], [0.0, 0.0], sight).unwrap().variance
        };
        // a turn of 3 degrees a second is 1 m/s at 20 m, and 2 m/s at 40 m
        let near = variance(&SIDE, level);
        assert!((100 * 100..150 * 150).contains(&near), "{near}");
        let far = SIDE.map(|[_, y]| [40.0, 2.0 * y]);
        assert!((190 * 190..240 * 240).contains(&variance(&far, level)), "{}", variance(&far, level));
        // 45 degrees down
        let down = variance(&SIDE, |_| Direction { x: 11_585, y: 0 });
        assert!(down > 4 * near, "{down}");
    }

    #[test]
    fn no_sums_are_too_great() {
        let mut slope = DopplerSlope::NONE;
        for k in 0..1000 {
            let sight = if k % 2 == 0 { Direction::AHEAD } else { Direction::AHEAD.left() };
            slope.add(k == 0, sight, if k % 2 == 0 { i32::MIN } else { i32::MAX });
        }
        let target = Target { range_cm: 1, speed_cm_s: 7000, sight: Direction { x: 0, y: 0 } };
        let all = slope.across(1000, i32::MAX, &target, &rules().noise);
        assert!(all.is_none_or(|off| off.speed.abs() <= 4000 && off.variance >= 0), "{all:?}");
    }
}
