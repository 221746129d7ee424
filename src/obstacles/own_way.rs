//! Obstacles that go their own way: across the road, or around a corner.
//!
//! Most traffic follows the road, and its axis gives a heading that Doppler alone cannot. Beside that,
//! every obstacle's motion is followed without a heading. Where the two differ for certain, and to the
//! side, the obstacle leaves the road's axis and goes on with the motion that was seen.

use super::doppler_slope::Target;
use super::lanes::{LEARNT, NO_LANE};
use super::motion::{Across, Seen};
use super::obstacle::{FRACTION, Obstacle};
use super::profile::{BIN_CM, Extent, Profile};
use super::tracking::Tracking;
use crate::fixed::math::{length, mul_shift};
use crate::fixed::trig::Direction;

/// Frames in a row in which motion along the heading must fail.
const OWN_WAY_FRAMES: u8 = 2;
/// Least variance of where a frame's detections have their centre, cm^2.
const LEAST_VARIANCE: i32 = 20 * 20;

impl Obstacle {
    /// Whether the heading of one that goes its own way is known better than what it was while faster.
    pub(super) fn knows_its_way(&self, t: &Tracking) -> bool {
        let (vx, vy) = self.free.velocity;
        let speed = length(vx >> FRACTION, vy >> FRACTION);
        self.speed() > t.turning_speed && self.free.is_sure_of(speed, t.heading_sigmas)
    }

    /// Lets the free motion follow this frame's detections.
    pub(super) fn follow(&mut self, t: &Tracking) {
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
            let ahead = self.heading.along(dx, dy) - (self.extent.middle_cm() << FRACTION);
            let by = mul_shift(ahead, t.own_way_follow, 16);
            self.position.0 += mul_shift(by, hx, 14);
            self.position.1 += mul_shift(by, hy, 14);
        }
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
    pub(super) fn question_heading(&mut self, t: &Tracking) {
        if self.free_heading || (self.lane == LEARNT && self.is_standing(t)) {
            return;
        }
        let (fx, fy) = self.free.velocity;
        let (dx, dy) = ((fx - self.velocity.0) >> FRACTION, (fy - self.velocity.1) >> FRACTION);
        let aside = self.heading.across(dx, dy).abs();
        let least = t.own_way_cm_s.max(mul_shift(self.speed(), t.own_way_share, 16 + FRACTION));
        if aside > least && self.free.is_sure_of(length(dx, dy), t.own_way_sigmas) {
            self.unexplained += 1;
        } else {
            self.unexplained = 0;
        }
        if self.unexplained >= OWN_WAY_FRAMES {
            self.lane = NO_LANE;
            self.find_lane(t);
            if !self.is_on_lane() {
                self.go_own_way();
            }
        }
    }

    /// Goes on from the free motion, with a new outline.
    fn go_own_way(&mut self) {
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
    use super::super::by_hand::{car, follow, rules};
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

    #[test]
    fn a_car_on_the_road_keeps_the_roads_heading() {
        for (heading, expected) in [([1.0, 0.0], 0.0), ([-1.0, 0.0], 180.0)] {
            let (boxes, _) = boxes([50.0 - 25.0 * heading[0], 6.0], heading, 20.0, 2.0);
            assert_eq!(boxes.len(), 1, "{boxes:?}");
            assert!((boxes[0][0].abs() - expected).abs() < 4.0, "{boxes:?}");
        }
    }
}
