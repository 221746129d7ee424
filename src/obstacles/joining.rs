//! Parts of one vehicle that were taken for several.
//!
//! # Model
//! Parts are one vehicle where they are in line, equally fast, and no farther apart than vehicles keep at that speed. In a queue gaps
//! do not tell: there two ends as far apart as a car's are one car's, and a face that lies less than a car and a gap behind
//! another face is its other end. A whole car is no part of a lorry, and two whole cars are not one.
//! What is low is not kept from what is tall in general: trailers reflect low in their middle, and would fall apart.

use core::ops::RangeInclusive;

use super::body::LONGEST_LOW_CM;
use super::gathered::sigma_of_weight;
use super::obstacle::{FRACTION, Obstacle};
use super::parameters::{MERGE_PARALLEL, TrackingParameters};
use super::profile::BIN_CM;
use crate::fixed::math::{hypot_gate, length};
use crate::fixed::trig::Direction;

/// Least distance between the faces of two cars in a row: a short car's length and a gap, centimetres.
const SPACING_CM: i32 = 480;
/// Longest outline of one end of a car, to its nearest axle, and of a car that shows both its ends, with what noise adds,
/// centimetres.
const END_CM: i32 = 200;
/// See [`END_CM`].
const CAR_CM: RangeInclusive<i32> = 400..=520;
/// Outline of a car that has shown all of itself, with what echoes of others add, centimetres. A lorry's trailer
/// shows longer low parts.
const WHOLE_CAR_CM: RangeInclusive<i32> = 400..=600;
/// Farthest that two outlines of one whole car lie apart, centimetres.
const TWICE_CM: i32 = 100;
/// The same of a delivery van, which is tall: its end, to behind the cab, and all of it.
const VAN_END_CM: i32 = 250;
/// See [`VAN_END_CM`].
const VAN_CM: RangeInclusive<i32> = 400..=660;
/// Widest gap between parts of a lorry that stands, centimetres: less than anybody leaves behind one.
const TOUCHING_CM: i32 = 150;
/// Least cosine between their headings, 2^-14: 43 degrees. What stopped while it turned was not seen to drive where it
/// points.
const CROOKED: i32 = 12_000;
/// Largest difference of speed of the ends of one car, 2^-8 cm/s: a metre a second.
const ENDS_SPEED: i32 = 100 << FRACTION;

impl Obstacle {
    /// Whether another obstacle is near enough to be a part of the same vehicle, or to lie within it.
    #[inline]
    pub fn is_near(&self, other: &Self, t: &TrackingParameters) -> bool {
        let far = (2 * t.max_length_cm) << FRACTION;
        (self.position.0 - other.position.0).abs() <= far && (self.position.1 - other.position.1).abs() <= far
    }

    /// Whether another obstacle, a [near](Self::is_near) one, is a part of the same vehicle: in line, equally fast, and no farther
    /// away than vehicles keep from each other at this speed.
    #[inline]
    pub fn is_one_with(&self, other: &Self, t: &TrackingParameters) -> bool {
        let apart = hypot_gate(self.velocity.0 - other.velocity.0, self.velocity.1 - other.velocity.1);
        if apart > t.merge_speed {
            return false;
        }
        if self.heading.cosine(other.heading) < MERGE_PARALLEL {
            return self.is_one_lorry_with(other, t);
        }
        let (ox, oy) = other.global(other.extent.middle_cm(), 0);
        let (along, left) = self.local(ox, oy);
        let half = other.extent.length_cm() / 2;
        let (rear, front) = (along - half, along + half);
        let gap = (rear - self.extent.front_cm).max(self.extent.rear_cm - front);
        let uncertain = (t.sigmas * (self.lateral_sigma() + other.lateral_sigma())) >> 4;
        let abreast = if gap <= 0 { t.abreast_cm } else { 0 };
        if left.abs() > abreast.max(t.merge_lateral_cm + uncertain) {
            return false;
        }
        let length = front.max(self.extent.front_cm) - rear.min(self.extent.rear_cm);
        let coupled = i32::from(self.travelled_cm.min(other.travelled_cm)) >= t.coupled_way_cm
            && apart <= t.coupled_speed
            && left.abs() <= t.merge_lateral_cm;
        let widest = if coupled { self.headway_cm(t.coupled_headway, t) } else { self.gap_cm(t) };
        // nothing low is as long as a lorry
        let low = self.tallness.is_low() && other.tallness.is_low();
        let longest = if low { LONGEST_LOW_CM } else { t.max_length_cm };
        let one = (gap <= widest && length <= longest)
            || (apart <= ENDS_SPEED && self.has_other_end(other, along, length, t));
        one && !self.is_another_car_than(other, (along - self.extent.middle_cm()).abs().max(left.abs()), t)
    }

    /// Whether one of both is a whole car, and the other something tall, or another whole car whose middle lies so far away: a
    /// car behind a lorry, or beside another where the place of one was guessed.
    fn is_another_car_than(&self, other: &Self, offset_cm: i32, t: &TrackingParameters) -> bool {
        match (self.is_whole_car(t), other.is_whole_car(t)) {
            (true, true) => offset_cm > TWICE_CM,
            (true, false) => other.tallness.is_tall(),
            (false, true) => self.tallness.is_tall(),
            (false, false) => false,
        }
    }

    /// Whether it is low for certain and has shown all of a car.
    fn is_whole_car(&self, t: &TrackingParameters) -> bool {
        let shown = self.extent.length_cm().max(self.remembered_length_cm(t));
        self.existence >= t.confirmed && self.tallness.is_low() && WHOLE_CAR_CM.contains(&shown)
    }

    /// Whether another obstacle that points elsewhere is a part of the same lorry: both stand, are tall, and touch along
    /// the line between their middles, which lies more ahead of this one than beside it.
    fn is_one_lorry_with(&self, other: &Self, t: &TrackingParameters) -> bool {
        let both = |is: fn(&Self, &TrackingParameters) -> bool| is(self, t) && is(other, t);
        if !both(Self::is_standing)
            || !both(|o, _| o.tallness.is_tall())
            || self.heading.cosine(other.heading) < CROOKED
        {
            return false;
        }
        let ((x, y), (other_x, other_y)) = (self.middle(), other.middle());
        let (dx, dy) = (other_x - x, other_y - y);
        let beside = self.heading.across(dx, dy).abs();
        let (apart, shown) = (length(dx, dy), self.extent.length_cm() + other.extent.length_cm());
        2 * beside < self.heading.along(dx, dy).abs()
            && apart < shown / 2 + TOUCHING_CM
            && apart + shown / 2 <= t.max_length_cm
    }

    /// Whether another obstacle, in line, as fast and together so long with this one, which is seen better, is the other end of the
    /// same car. Gaps do not tell: in a queue cars are as close to each other as their own ends are. But no face of another
    /// car lies less than a car's length and a gap behind a face. And two ends as far apart as a car's are one car's, two tall
    /// ones as a van's one van's; it then has both, so the next end is the next vehicle's.
    fn has_other_end(&self, other: &Self, along: i32, length: i32, t: &TrackingParameters) -> bool {
        let ahead = along > self.extent.middle_cm();
        // what lies ahead of the sensor shows it the face that is nearer, and its other end is farther away
        let behind_its_face = ahead == self.shows_its_rear();
        let confirmed = self.existence.min(other.existence) >= t.confirmed;
        let tall = self.tallness.is_tall() && other.tallness.is_tall();
        let (end_cm, over_all_cm) = if tall { (VAN_END_CM, VAN_CM) } else { (END_CM, CAR_CM) };
        let ends = self.extent.length_cm().max(other.extent.length_cm()) <= end_cm;
        (behind_its_face && length < SPACING_CM) || (confirmed && ends && over_all_cm.contains(&length))
    }

    /// Whether another obstacle lies within this one, where nothing else can be: a wheel that was taken
    /// for a vehicle, or an echo between the two.
    #[inline]
    pub fn encloses(&self, other: &Self, t: &TrackingParameters) -> bool {
        let far = t.max_length_cm << FRACTION;
        if (self.position.0 - other.position.0).abs() > far || (self.position.1 - other.position.1).abs() > far {
            return false;
        }
        let (x, y) = other.global(other.extent.middle_cm(), 0);
        let (along, left) = self.local(x, y);
        left.abs() <= t.merge_lateral_cm && self.extent.beyond_cm(along) == 0
    }

    /// Whether another obstacle lies within this one, which has far more detections, so that it is nothing of its own.
    pub(super) fn takes_away(&self, other: &Self, t: &TrackingParameters) -> bool {
        self.hits / 2 >= other.hits && self.encloses(other, t) && !self.coasts_over(other, t)
    }

    /// Whether it moves on without being seen, so that its place is guessed, and the other is seen to stand.
    fn coasts_over(&self, other: &Self, t: &TrackingParameters) -> bool {
        let guessed = !self.seen() && !self.is_standing(t);
        guessed && other.seen() && other.is_standing(t) && other.existence >= t.confirmed
    }

    /// Whether what moves within this one can be itself, which leaves: it stands, and nothing of it is seen
    /// standing any more.
    pub fn may_be_leaving_as(&self, mover: &Self, t: &TrackingParameters) -> bool {
        self.is_standing(t)
            && !self.seen()
            && mover.seen()
            && mover.speed() > t.standing_speed
            && self.encloses(mover, t)
    }

    /// Takes over what was known of the vehicle before it left: way, length and height.
    pub fn inherit(&mut self, before: &Self) {
        self.travelled_cm = self.travelled_cm.max(before.travelled_cm);
        self.shown_length = self.shown_length.max(before.shown_length);
        self.tallness.join(&before.tallness);
        self.reflectivity.join(&before.reflectivity);
    }

    /// Turns about its middle into the line between the middles of both.
    fn point_along_the_line_to(&mut self, other: &Self) {
        let ((x, y), (other_x, other_y)) = (self.middle(), other.middle());
        let line = Direction::of(other_x - x, other_y - y);
        self.turn_to(if self.heading.cosine(line) < 0 { line.reversed() } else { line });
    }

    /// Where this frame's detections of both have their centre: it has moved, but neither of them has.
    fn centre_with(&self, other: &Self) -> (i32, i32) {
        let ((x, y), count) = (self.free.place, other.gathered.count);
        let both = (self.gathered.count + count).max(1);
        (x + (other.free.place.0 - x) / both * count, y + (other.free.place.1 - y) / both * count)
    }

    /// Standard deviation of the lateral place, centimetres.
    fn lateral_sigma(&self) -> i32 {
        sigma_of_weight(self.lateral_weight)
    }

    /// Takes over what another obstacle knows of the same vehicle.
    #[allow(clippy::cast_possible_truncation)] // a share of the offset
    pub fn join(&mut self, other: &Self, t: &TrackingParameters) {
        if self.heading.cosine(other.heading) < MERGE_PARALLEL {
            self.point_along_the_line_to(other);
        }
        // the histogram is no longer than the longest vehicle: its middle first
        let (ax, ay) = other.anchor();
        let (along, _) = self.local(ax, ay);
        let rear = self.extent.rear_cm.min(along + other.extent.rear_cm);
        let front = self.extent.front_cm.max(along + other.extent.front_cm);
        self.recentre((rear + front) / 2 / BIN_CM);
        let (along, left) = self.local(ax, ay);
        self.profile.merge(&other.profile, along);
        let weight = self.lateral_weight.saturating_add(other.lateral_weight).max(1);
        let share = (i64::from(left << FRACTION) * i64::from(other.lateral_weight) / i64::from(weight)) as i32;
        self.move_left(share);
        self.lateral_weight = weight;
        self.free.place = self.centre_with(other);
        self.existence = (self.existence + other.existence).min(t.existence_max);
        self.hits = self.hits.saturating_add(other.hits);
        self.travelled_cm = self.travelled_cm.max(other.travelled_cm);
        self.tallness.join(&other.tallness);
        self.reflectivity.join(&other.reflectivity);
        self.tallness.set_reflected(self.reflectivity.evidence(t.lorry_rcs));
        self.update_extent(t);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Obstacles;
    use super::super::made_up::{rules, seen_at, tall};
    use super::super::obstacle::MOST_WEIGHT;
    use super::super::profile::Extent;
    use super::super::tallness::Tallness;
    use super::*;
    use crate::fixed::time::Step;
    use crate::fixed::trig::Direction;

    const AHEAD: Direction = Direction::AHEAD;

    /// Two obstacles in one lane, `apart_cm` between the first's front and the second's rear end.
    fn two(apart_cm: i32, left_cm: i32, speed: i32) -> (Obstacle, Obstacle) {
        let mut a = Obstacle::new(&seen_at(5000, 0, 0), AHEAD, 2000);
        a.extent = Extent { rear_cm: -200, front_cm: 200 };
        let mut b = Obstacle::new(&seen_at(5000 + 400 + apart_cm, left_cm, 0), AHEAD, speed);
        b.extent = Extent { rear_cm: -200, front_cm: 200 };
        (a.lateral_weight, b.lateral_weight) = (MOST_WEIGHT, MOST_WEIGHT);
        (a, b)
    }

    /// Certain to be low.
    fn low() -> Tallness {
        let mut t = Tallness::default();
        (0..100).for_each(|_| t.add(70, 30));
        assert!(t.is_low());
        t
    }

    #[test]
    fn parts_of_one_vehicle_are_in_line_equally_fast_and_close() {
        let t = rules();
        let one = |apart, left, speed| {
            let (a, b) = two(apart, left, speed);
            let (forward, back) = (a.is_one_with(&b, &t), b.is_one_with(&a, &t));
            assert_eq!(forward, back, "{apart} {left} {speed}");
            forward
        };
        assert!(one(500, 50, 2000) && one(500, -50, 2100));
        assert!(!one(500, 50, 2300), "another speed");
        assert!(!one(500, 250, 2000) && !one(500, -250, 2000), "another lane");
        assert!(!one(800, 0, 2000), "farther than the gap within a vehicle");
        let (a, mut b) = two(500, 0, 2000);
        b.heading = AHEAD.left();
        assert!(!a.is_one_with(&b, &t), "across the road");
        // together longer than any vehicle
        let (mut a, b) = two(600, 0, 2000);
        a.extent.rear_cm = -1000;
        assert!(!a.is_one_with(&b, &t));
    }

    #[test]
    fn two_cars_close_behind_each_other_are_not_joined_to_a_lorry() {
        let t = rules();
        let (mut a, mut b) = two(250, 0, 2000);
        a.tallness = low();
        assert!(a.is_one_with(&b, &t), "one of them may be high");
        b.tallness = low();
        assert!(!a.is_one_with(&b, &t), "10.5 m");
        let (mut a, mut b) = two(50, 0, 2000);
        (a.tallness, b.tallness) = (low(), low());
        assert!(a.is_one_with(&b, &t), "8.5 m");
    }

    #[test]
    fn a_whole_car_is_no_part_of_a_lorry_nor_of_another_car() {
        let t = rules();
        let one = |apart, change: &dyn Fn(&mut Obstacle, &mut Obstacle)| {
            let (mut car, mut other) = two(apart, 0, 2000);
            (car.tallness, other.tallness) = (low(), tall());
            car.existence = t.confirmed;
            change(&mut car, &mut other);
            let (forward, back) = (car.is_one_with(&other, &t), other.is_one_with(&car, &t));
            assert_eq!(forward, back, "{apart} cm");
            forward
        };
        assert!(!one(200, &|_, _| ()), "a lorry close ahead");
        assert!(one(200, &|car, _| car.existence -= 1), "perhaps no car");
        assert!(one(200, &|car, _| car.tallness = Tallness::default()), "perhaps not low");
        assert!(one(200, &|_, other| other.tallness = Tallness::default()), "perhaps not tall");
        assert!(one(200, &|car, _| car.extent = Extent { rear_cm: -10, front_cm: 380 }), "a part of something");
        assert!(one(200, &|car, _| car.extent.rear_cm = -410), "as a trailer's low part");
        // a creeping one whose rear is hidden for now
        let hidden = |car: &mut Obstacle, other: &mut Obstacle, shown_cm: i32| {
            (car.velocity.0, other.velocity.0) = (200 << FRACTION, 200 << FRACTION);
            car.extent.rear_cm = 0;
            car.shown_length = shown_cm << 4;
        };
        assert!(!one(200, &|car, other| hidden(car, other, 450)) && one(200, &|car, other| hidden(car, other, 200)));
        let two_cars = |car: &mut Obstacle, other: &mut Obstacle| {
            (other.tallness, other.existence) = (low(), t.confirmed);
            assert!(car.tallness.is_low());
        };
        assert!(!one(-290, &two_cars), "1.1 m apart within one another: the place of one was guessed");
        assert!(one(-310, &two_cars), "0.9 m: one car, found twice");
    }

    /// Evidence left of a car that stands within a lorry that drives.
    fn left_of_a_car_within_a_lorry(change: impl Fn(&mut Obstacle, &mut Obstacle)) -> i32 {
        let t = rules();
        let (mut lorry, mut car) = two(-400, 0, 0);
        (lorry.hits, car.hits) = (500, 100);
        (lorry.existence, car.existence) = (t.existence_max, t.confirmed);
        (lorry.travelled_cm, car.travelled_cm) = (5000, 1000);
        car.gathered.count = 4;
        change(&mut lorry, &mut car);
        let mut all = Obstacles::<2>::new();
        [lorry, car].into_iter().for_each(|o| all.list.push(o).unwrap());
        all.join_parts(&t);
        all.iter().nth(1).unwrap().existence
    }

    #[test]
    fn a_lorry_that_is_not_seen_and_only_seems_to_have_come_so_far_takes_no_standing_car_away() {
        let t = rules();
        assert_eq!(left_of_a_car_within_a_lorry(|_, _| ()), t.confirmed);
        let gone = |change: fn(&mut Obstacle, &mut Obstacle)| left_of_a_car_within_a_lorry(change) == 0;
        assert!(gone(|lorry, _| lorry.gathered.count = 4), "it is seen there, and nothing else can be");
        assert!(gone(|_, car| car.gathered.count = 0), "nothing says that the car is still there");
        assert!(gone(|_, car| car.existence -= 1), "perhaps nothing");
        assert!(gone(|_, car| car.travelled_cm = 0), "a fixture it passes");
        assert!(gone(|_, car| car.velocity.0 = 500 << FRACTION), "a part of it that is seen again");
        assert!(gone(|lorry, _| lorry.velocity.0 = 0), "it stands itself, and this is a part of it");
    }

    /// Two ends of cars that creep at 2 m/s, as long as given and so far apart between their outer ends, the second
    /// ahead of the first and both ahead of the sensor.
    fn ends(lengths_cm: [i32; 2], over_all_cm: i32, x_cm: i32) -> [Obstacle; 2] {
        let t = rules();
        let of = |rear_cm: i32, length_cm: i32| {
            let mut o = Obstacle::new(&seen_at(rear_cm + length_cm / 2, 0, 0), AHEAD, 200);
            o.extent = Extent { rear_cm: -length_cm / 2, front_cm: length_cm / 2 };
            (o.lateral_weight, o.existence) = (MOST_WEIGHT, t.existence_max);
            o
        };
        [of(x_cm, lengths_cm[0]), of(x_cm + over_all_cm - lengths_cm[1], lengths_cm[1])]
    }

    #[test]
    fn what_begins_behind_a_face_by_less_than_a_car_and_a_gap_is_that_cars_other_end() {
        let t = rules();
        // neither is short; ahead of the sensor the face is the rear, behind it the front
        let [near, far] = ends([206, 10], 460, 3000);
        assert!(near.is_one_with(&far, &t) && !far.is_one_with(&near, &t));
        let [far, near] = ends([10, 206], 460, -3500);
        assert!(near.is_one_with(&far, &t) && !far.is_one_with(&near, &t));
        let [near, far] = ends([210, 40], 500, 3000);
        assert!(!near.is_one_with(&far, &t), "the next car's face");
        let [near, mut far] = ends([206, 10], 460, 3000);
        far.velocity.0 += 130 << FRACTION;
        assert!(!near.is_one_with(&far, &t), "it comes nearer");
    }

    #[test]
    fn two_ends_as_far_apart_as_a_cars_are_one_car_and_the_next_is_the_next_cars() {
        let t = rules();
        let one = |lengths: [i32; 2], over_all: i32, x: i32| {
            let [a, b] = ends(lengths, over_all, x);
            (a.is_one_with(&b, &t), b.is_one_with(&a, &t))
        };
        assert_eq!(one([95, 95], 500, 3000), (true, true));
        assert_eq!(one([95, 95], 500, -3500), (true, true));
        assert_eq!(one([95, 95], 540, 3000), (false, false), "ends of two cars");
        assert!(!one([40, 40], 390, -3500).0, "too short for a car; its face is the other one");
        assert_eq!(one([490, 95], 900, 3000), (false, false), "one that has both its ends");
        assert_eq!(one([200, 40], 500, 3000), (true, true), "to its axle");
        assert_eq!(one([210, 40], 500, 3000), (false, false), "more than an end");
        let van = |lengths: [i32; 2], over_all: i32, ends_tall: usize| {
            let mut pair = ends(lengths, over_all, 3000);
            pair.iter_mut().take(ends_tall).for_each(|o| o.tallness = tall());
            pair[0].is_one_with(&pair[1], &t)
        };
        assert!(van([100, 200], 640, 2) && !van([100, 200], 640, 1), "only what is tall at both ends is a van");
        assert!(!van([100, 200], 680, 2) && !van([100, 260], 640, 2), "two vehicles");
        let [mut a, b] = ends([95, 95], 500, 3000);
        a.existence = t.confirmed - 1;
        assert!(!a.is_one_with(&b, &t) && !b.is_one_with(&a, &t), "perhaps it is nothing");
    }

    /// Two parts of a lorry that stands, in line, so far apart, that point so many degrees to either side.
    fn crooked(apart_cm: i32, degrees: f64) -> [Obstacle; 2] {
        let t = rules();
        let part = |x: i32, degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let heading = Direction::of((cos * 1e4) as i32, (sin * 1e4) as i32);
            let mut o = Obstacle::new(&seen_at(x, 0, 0), heading, 0);
            o.extent = Extent { rear_cm: -350, front_cm: 350 };
            (0..20).for_each(|k| o.profile.add(if k % 2 == 0 { -340 } else { 340 }));
            (o.travelled_cm, o.existence, o.tallness) = (1000, t.existence_max, tall());
            o
        };
        [part(3000, -degrees), part(3700 + apart_cm, degrees)]
    }

    #[test]
    fn parts_of_a_standing_lorry_that_touch_are_one_along_their_line_though_they_point_elsewhere() {
        let t = rules();
        for (apart, degrees, one) in [(100, 15.0, true), (100, 25.0, false), (200, 15.0, false), (-300, 15.0, true)] {
            let [a, b] = crooked(apart, degrees);
            assert_eq!((a.is_one_with(&b, &t), b.is_one_with(&a, &t)), (one, one), "{apart} cm, {degrees} degrees");
        }
        let [a, b] = crooked(100, 15.0);
        let not = |change: &dyn Fn(&mut Obstacle)| {
            let mut changed = b.clone();
            change(&mut changed);
            assert!(!a.is_one_with(&changed, &t) && !changed.is_one_with(&a, &t), "{changed:?}");
        };
        not(&|b| b.tallness = Tallness::default());
        not(&|b| b.velocity.0 = t.standing_speed + 1);
        not(&|b| b.travelled_cm = 0);
        not(&|b| b.position.1 += 450 << FRACTION);
        not(&|b| b.extent.front_cm = 2000);
        for reversed in [false, true] {
            let [mut a, mut b] = crooked(100, 15.0);
            if reversed {
                (a.heading, b.heading) = (a.heading.reversed(), b.heading.reversed());
            }
            a.join(&b, &t);
            assert_eq!(a.heading, if reversed { AHEAD.reversed() } else { AHEAD }, "the way it drove");
            let (x, y) = a.middle();
            assert!((x - 3400).abs() < 300 && y.abs() < 30, "{x} {y}");
        }
    }

    #[test]
    fn joining_two_parts_that_stand_is_no_motion() {
        let t = rules();
        let (mut a, mut b) = two(0, 60, 0);
        // three frames of standing still, each seen where it is
        let step = Step::from_micros(67_000);
        let frame = |o: &mut Obstacle, places: &[(i32, i32)]| {
            o.predict(step, 1 << 16, &t);
            places.iter().for_each(|(x, y)| o.absorb(&seen_at(*x, *y, 0), &t));
            o.settle(step, &t);
        };
        let (rear, front) = ([(4900, 0), (5100, 0)], [(5300, 120), (5500, 120), (5450, 120), (5350, 120)]);
        for _ in 0..30 {
            frame(&mut a, &rear);
            frame(&mut b, &front);
        }
        a.join(&b, &t);
        let before = a.free.velocity;
        for _ in 0..5 {
            frame(&mut a, &[&rear[..], &front[..]].concat());
        }
        let pushed = (a.free.velocity.1 - before.1).abs() >> FRACTION;
        assert!(pushed < 15, "{pushed} cm/s to the side");
    }

    #[test]
    fn only_what_lies_between_the_ends_is_enclosed() {
        let t = rules();
        let (a, b) = two(-350, 0, 2000);
        assert!(a.encloses(&b, &t), "its middle 50 cm ahead of the other's");
        let (a, b) = two(-100, 0, 2000);
        assert!(!a.encloses(&b, &t), "its middle 300 cm ahead");
        let (a, b) = two(-350, 150, 2000);
        assert!(!a.encloses(&b, &t), "beside it");
    }

    #[test]
    fn joined_obstacles_reach_from_end_to_end_and_lie_where_the_surer_one_did() {
        let t = rules();
        let (mut a, mut b) = two(500, 40, 2000);
        for (o, x) in [(&mut a, 5000), (&mut b, 5900)] {
            (0..20).for_each(|_| o.profile.add(-180));
            (0..20).for_each(|_| o.profile.add(180));
            assert_eq!(o.anchor().0, x);
        }
        a.lateral_weight = MOST_WEIGHT / 4;
        (a.hits, b.hits, b.travelled_cm) = (30, 10, 700);
        a.join(&b, &t);
        let (rear, front) = (a.anchor().0 + a.extent.rear_cm, a.anchor().0 + a.extent.front_cm);
        assert!((rear - 4820).abs() < 60 && (front - 6080).abs() < 60, "{rear} to {front}");
        assert!((30..=34).contains(&a.anchor().1), "four fifths of the way: {:?}", a.anchor());
        assert_eq!((a.hits, a.travelled_cm), (40, 700));
    }
}
