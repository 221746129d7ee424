//! Obstacles that turn or cross: their own way across the road, or around a corner.
//!
//! Most traffic follows the road, and its axis gives a heading that Doppler alone cannot. Beside that,
//! every obstacle's motion is followed without a heading. Where the two differ for certain, and to the
//! side, the obstacle leaves the road's axis and goes on with the motion that was seen.
//!
//! # Model
//! Its speed across the line of sight is known badly, so its outline would drift off along it: a tenth of the way in a frame it
//! follows the centre of what is detected, which is compared with the centre of all that the outline holds. (Its middle would
//! put lorries too near to the sensor, since they reflect on the near side.) Its heading turns
//! into the direction of its motion by a filter of one state: a turn adds variance by the way that is made, and the motion tells a
//! heading as well as its speed is known, over that speed. So what brakes, or creeps, keeps the heading it drove with.

use super::doppler_slope::Target;
use super::lanes::{LEARNT, NO_LANE};
use super::motion::{Across, Seen};
use super::obstacle::{FRACTION, Obstacle};
use super::parameters::TrackingParameters;
use super::profile::{BIN_CM, Extent, Profile};
use crate::fixed::math::{length, mul_shift, ratio};
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;

/// Frames in a row in which motion along the heading must fail.
const OFF_AXIS_FRAMES: u8 = 2;
/// Variance that a turn adds to a heading, 2^-16 rad^2 for a centimetre of way: a radian, the tightest turn, in 6 m at one
/// standard deviation, or 13 degrees in a metre.
const TURN: i32 = 33;
/// Time over which the free motion is a mean, 2^-16 s: what frames say of a heading within it is nearly the same.
const SHARED: i32 = (1 << 16) / 3;
/// Greatest variance of a heading that is told from others, 2^-16 rad^2.
const ANY: i32 = u16::MAX as i32;
/// Least variance of where a frame's detections have their centre, cm^2.
const LEAST_VARIANCE: i32 = 20 * 20;

impl Obstacle {
    /// Whether the heading of one that goes its own way is known better than what it was while faster.
    pub(super) fn knows_its_way(&self, t: &TrackingParameters) -> bool {
        let (vx, vy) = self.free.velocity;
        let speed = length(vx >> FRACTION, vy >> FRACTION);
        self.speed() > t.turning_speed && self.free.is_sure_of(speed, t.heading_sigmas)
    }

    /// Lets the free motion follow this frame's detections.
    pub(super) fn follow(&mut self, t: &TrackingParameters) {
        let g = self.gathered;
        let (along, left) = ((g.offset.0 << FRACTION) / g.count.max(1), (g.offset.1 << FRACTION) / g.count.max(1));
        let (hx, hy) = (i32::from(self.heading.x), i32::from(self.heading.y));
        let length_cm = self.extent.length_cm().max(t.sizes.min_length_cm);
        let own = g.sight.along(self.velocity.0, self.velocity.1);
        self.free.update(&Seen {
            count: g.count,
            centre: (
                self.position.0 + mul_shift(along, hx, 14) - mul_shift(left, hy, 14),
                self.position.1 + mul_shift(along, hy, 14) + mul_shift(left, hx, 14),
            ),
            variance: g.centre_variance(self.heading, length_cm).max(LEAST_VARIANCE),
            sight: g.sight,
            radial: own + ((g.radial / g.count.max(1)) << 4),
        });
        let (x, y) = self.middle();
        let target = Target { range_cm: length(x, y), speed_cm_s: self.speed() >> FRACTION, sight: g.sight };
        if let Some(off) = g.slope.across(g.count, g.radial, &target, &t.noise) {
            let along_heading = off.sight.across(self.velocity.0, self.velocity.1) >> FRACTION;
            self.free.take_across(&Across { speed: along_heading + off.speed, ..off });
        }
        if self.free_heading {
            let (dx, dy) = (self.free.place.0 - self.position.0, self.free.place.1 - self.position.1);
            // not the middle of the outline: of a lorry the nearer end shows more of itself
            let centre = self.profile.mean_cm().unwrap_or(self.extent.middle_cm());
            let ahead = self.heading.along(dx, dy) - (centre << FRACTION);
            let by = mul_shift(ahead, t.off_axis_follow, 16);
            self.position.0 += mul_shift(by, hx, 14);
            self.position.1 += mul_shift(by, hy, 14);
        }
    }

    /// Turns into the free motion's direction, as far as that is known better than the heading it has. A vehicle turns by the
    /// way it makes, so one that brakes keeps its heading, while its motion tells less and less.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    pub(super) fn turn_with_motion(&mut self, step: Step) {
        let motion = Direction::of(self.velocity.0, self.velocity.1);
        let fine = self.speed();
        let (speed, way_cm) = (fine >> FRACTION, step.times(fine) >> FRACTION);
        let variance = (i32::from(self.heading_variance) + way_cm.min(ANY / TURN) * TURN).min(ANY);
        // the variance across, over the square of the speed; 2^-16
        let (across, square) = (self.free.speed_variance(), speed * speed);
        let seen = if across < square { ratio::<8>(across << 4, (square >> 4).max(1)).min(ANY) } else { ANY };
        let seen = (seen * SHARED / step.raw().max(1)).clamp(seen, 1 << 20);
        if self.heading.cosine(motion) < 0 {
            (self.heading, self.heading_variance) = (motion, seen.min(ANY) as u16);
            return;
        }
        let gain = ratio::<12>(variance, (variance + seen).max(1));
        let turned = |from: i16, to: i16| (i32::from(from) << 12) + (i32::from(to) - i32::from(from)) * gain;
        self.heading = Direction::of(turned(self.heading.x, motion.x), turned(self.heading.y, motion.y));
        self.heading_variance = (variance - mul_shift(variance, gain, 12)).clamp(0, ANY) as u16;
    }

    /// Goes on along the heading it has, as fast along it as the free motion is: across the line of sight, Doppler
    /// says nothing of a speed, and a place that stays does.
    pub(super) fn keep_heading(&mut self) {
        let (vx, vy) = self.free.velocity;
        let speed = self.heading.along(vx, vy);
        let part = |c: i16| mul_shift(speed, i32::from(c), 14);
        self.velocity = (part(self.heading.x), part(self.heading.y));
    }

    /// Judges whether motion along the heading explains where it is seen; if not for long, it goes its own way. What stands
    /// on a learnt lane has driven there: what is seen of a lorry beside the radar moves though it does not.
    pub(super) fn question_heading(&mut self, t: &TrackingParameters) {
        if self.free_heading || (self.lane == LEARNT && self.is_standing(t)) {
            return;
        }
        let (fx, fy) = self.free.velocity;
        let (dx, dy) = ((fx - self.velocity.0) >> FRACTION, (fy - self.velocity.1) >> FRACTION);
        let aside = self.heading.across(dx, dy).abs();
        let least = t.off_axis_cm_s.max(mul_shift(self.speed(), t.off_axis_share, 16 + FRACTION));
        if aside > least && self.free.is_sure_of(length(dx, dy), t.off_axis_sigmas) {
            self.unexplained += 1;
        } else {
            self.unexplained = 0;
        }
        if self.unexplained >= OFF_AXIS_FRAMES {
            self.lane = NO_LANE;
            self.find_lane(t);
            if !self.is_on_lane() {
                self.leave_axis();
            }
        }
    }

    /// Goes on from the free motion, with a new outline.
    fn leave_axis(&mut self) {
        self.free_heading = true;
        self.position = self.free.place;
        self.velocity = self.free.velocity;
        self.heading = Direction::of(self.velocity.0, self.velocity.1);
        self.profile = Profile::EMPTY;
        self.extent = Extent { rear_cm: -BIN_CM / 2, front_cm: BIN_CM / 2 };
        self.lateral_weight = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Obstacles;
    use super::super::made_up::{PERIOD_S, car, follow, reflection, rules, seen_at};
    use super::super::motion::FreeMotion;
    use super::super::obstacle::{FRACTION, Obstacle};
    use crate::fixed::time::Step;
    use crate::fixed::trig::Direction;
    use crate::frame::by_range::ByRange;
    use crate::frame::reflection::Reflection;
    use std::vec::Vec;

    /// Headings of the boxes after a time, degrees from the road's axis, and their places, metres.
    fn boxes(at: [f64; 2], heading: [f64; 2], speed: f64, seconds: f64) -> (Vec<[f64; 3]>, [f64; 2]) {
        let mut list = Obstacles::<16>::new();
        let mut cars = [car(at, heading, speed)];
        follow(&mut list, &mut cars, seconds, true);
        let t = rules();
        let of = |s: crate::obstacles::solid::Solid| {
            let degrees = f64::from(s.heading.y).atan2(f64::from(s.heading.x)).to_degrees();
            [degrees, f64::from(s.x_cm) / 100.0, f64::from(s.y_cm) / 100.0]
        };
        (list.solids(&t).map(of).collect(), cars[0].at)
    }

    #[test]
    fn a_car_that_crosses_gets_its_own_heading_and_one_box_where_it_is() {
        for (heading, expected) in [([0.0, 1.0], 90.0), ([0.0, -1.0], -90.0)] {
            let (boxes, at) = boxes([40.0, -12.0 * heading[1]], heading, 9.0, 2.0);
            assert_eq!(boxes.len(), 1, "{boxes:?}");
            let [degrees, x, y] = boxes[0];
            assert!((degrees - expected).abs() < 12.0, "{boxes:?}");
            assert!((x - at[0]).abs() < 1.0 && (y - at[1]).abs() < 1.5, "{boxes:?}, it is at {at:?}");
        }
    }

    #[test]
    fn a_car_on_an_arm_14_degrees_off_the_axis_gets_that_heading() {
        for side in [1.0, -1.0] {
            let (boxes, at) = boxes([60.0, 10.0 * side], [0.972, -0.233 * side], 11.0, 2.0);
            assert_eq!(boxes.len(), 1, "{boxes:?}");
            let [degrees, _, y] = boxes[0];
            assert!((degrees + 13.5 * side).abs() < 3.0, "{boxes:?}");
            assert!((y - at[1]).abs() < 0.8, "{boxes:?}, it is at {at:?}");
        }
    }

    /// Middle along x of the box of a lorry 12 m long that crosses at 40 m with this velocity along y, how far that is ahead
    /// of the lorry's own; its `shown` end, 1 for its front, reflects four times as often as the rest.
    fn ahead_of_the_lorry(velocity: f64, shown: f64) -> f64 {
        let (mut list, t) = (Obstacles::<16>::new(), rules());
        let heading = velocity.signum();
        let mut y = -18.0 * heading;
        for _ in 0..50 {
            let places = [6.0, 5.5, 5.0, 4.5, 1.0, -2.5, -6.0].map(|a| [40.0, y + a * shown * heading]);
            let seen: Vec<Reflection> = places.iter().map(|p| reflection(*p, [0.0, velocity])).collect();
            let step = Step::from_micros((PERIOD_S * 1e6) as u64);
            list.step(&seen, &ByRange::<64>::sort(&seen, t.limit_cm), step, &t, |_, _| true);
            y += velocity * PERIOD_S;
        }
        let solids: Vec<_> = list.solids(&t).collect();
        assert_eq!(solids.len(), 1, "{solids:?}");
        (f64::from(solids[0].y_cm) / 100.0 - (y - velocity * PERIOD_S)) * heading
    }

    #[test]
    fn a_lorry_that_shows_one_end_more_than_the_other_is_not_drawn_nearer_to_that_end() {
        for velocity in [8.0, -8.0] {
            for shown in [1.0, -1.0] {
                let ahead = ahead_of_the_lorry(velocity, shown);
                assert!(ahead.abs() < 0.5, "{ahead} m ahead at {velocity} m/s, end {shown}");
            }
        }
    }

    /// How far one that goes along x at so many m/s turns to the left in a step, degrees, when its free motion, known to
    /// a standard deviation in cm/s, points `degrees` to the left.
    fn turned(mps: f64, seconds: f64, sigma: i32, degrees: f64) -> f64 {
        let speed = mps * 25_600.0;
        let velocity = [degrees.to_radians().cos(), degrees.to_radians().sin()].map(|c| (c * speed) as i32);
        let mut o = Obstacle::new(&seen_at(4000, 0, 0), Direction::AHEAD, 0);
        o.velocity = (velocity[0], velocity[1]);
        o.free = FreeMotion::new((4000 << FRACTION, 0), 100, o.velocity, sigma * sigma);
        (o.free_heading, o.heading_variance) = (true, 16);
        o.turn_with_motion(Step::from_micros((seconds * 1e6) as u64));
        f64::from(o.heading.y).atan2(f64::from(o.heading.x)).to_degrees()
    }

    #[test]
    fn a_vehicle_turns_by_the_way_it_makes_towards_where_it_is_seen_to_go() {
        for side in [1.0, -1.0] {
            let turned = |mps, seconds, sigma| turned(mps, seconds, sigma, 20.0 * side) * side;
            let (fast, slow) = (turned(12.0, PERIOD_S, 50), turned(2.5, PERIOD_S, 50));
            assert!(fast > 12.0 && slow < 4.0 && slow > 0.5, "{fast} and {slow} degrees of 20");
            assert!(turned(12.0, PERIOD_S, 200) < fast / 2.0, "its motion is known worse");
            let (once, often) = (turned(8.0, 0.2, 100), turned(8.0, 0.05, 100));
            assert!(often < once / 3.0, "{often} and {once} degrees: four frames in the time of one tell no more");
        }
    }

    #[test]
    fn a_motion_that_is_hardly_one_turns_nothing_however_sure_it_need_not_be() {
        for mps in [0.0, 0.01, 0.02, 0.05, 0.1] {
            let turned = turned(mps, PERIOD_S, 2000, 20.0);
            assert!((-0.5..2.0).contains(&turned), "{turned} degrees at {mps} m/s");
        }
    }

    #[test]
    fn what_is_seen_to_go_the_other_way_goes_the_other_way() {
        let turned = turned(5.0, PERIOD_S, 100, 170.0);
        assert!((turned - 170.0).abs() < 1.0, "{turned} degrees");
    }

    #[test]
    fn a_car_on_the_road_keeps_the_roads_heading() {
        for (heading, expected) in [([1.0, 0.0], 0.0), ([-1.0, 0.0], 180.0)] {
            let (boxes, _) = boxes([50.0 - 25.0 * heading[0], 6.0], heading, 20.0, 2.0);
            assert_eq!(boxes.len(), 1, "{boxes:?}");
            assert!((boxes[0][0].abs() - expected).abs() < 4.0, "{boxes:?}");
        }
    }
}
