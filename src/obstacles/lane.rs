//! An obstacle that follows a lane.

use super::lanes::{LEARNT, Motion, NO_LANE};
use super::learnt_lanes::{LearntLanes, PARALLEL, spacing_cm};
use super::motion::FreeMotion;
use super::obstacle::{FRACTION, NEWBORN_PLACE, NEWBORN_SPEED, Obstacle};
use super::parameters::{LEAST_PROJECTION, TrackingParameters};
use crate::fixed::math::{hypot_gate, mul_shift};
use crate::fixed::trig::Direction;

/// Every how many frames an obstacle looks for a better lane.
const LOOK_EVERY: u16 = 4;

/// Variance of where across its lane a vehicle is seen, cm^2: half of its width, and where in the lane it drives.
const ASIDE_VARIANCE: i32 = 120 * 120;
/// Variance of the speed beside the lane's direction that is left open, (cm/s)^2: what else a motion may do.
const BESIDE_VARIANCE: i32 = 100 * 100;
/// Share of the way to the middle of its lane by which a box is moved there, 2^-8, and the way that counts at most.
const TO_THE_MIDDLE: i32 = 160;
/// See [`TO_THE_MIDDLE`].
const MOST_ASIDE_CM: i32 = 150;

/// Detections of a vehicle that shows where a lane is, its least speed, 2^-8 cm/s, and how many standard deviations of what
/// is measured across the line of sight that is, 2^-4.
const TEACHING_HITS: u16 = 12;
/// See [`TEACHING_HITS`].
const TEACHING_SPEED: i32 = 300 << FRACTION;
/// See [`TEACHING_HITS`].
const TEACHING_SIGMAS: i32 = 10 << 4;

/// Least distance of a vehicle that teaches, in lengths of its outline.
const TEACHING_LENGTHS: i32 = 3;

/// Outline from which a vehicle's heading is known by its length, centimetres.
const SETTLED_CM: i32 = 800;
/// Least cosine between the road's axis and a motion that is measured, where they agree, 2^-14: 8 degrees.
const AGREES: i32 = 16_225;

impl Obstacle {
    /// Middle of what is seen of it, centimetres.
    pub(super) fn middle(&self) -> (i32, i32) {
        self.global(self.extent.middle_cm(), 0)
    }

    /// Takes the lane that its motion fits best, if there is any.
    pub(super) fn find_lane(&mut self, t: &TrackingParameters) {
        if t.lanes.is_empty() {
            return;
        }
        let motion = self.motion_for_lanes();
        if let Some(on) = t.lanes.best(&motion) {
            self.take(on.segment, on.heading, motion.radial, motion.sight);
        }
    }

    /// Takes a given lane, or else one that was learnt.
    pub(super) fn find_any_lane<const N: usize>(&mut self, learnt: &LearntLanes<N>, t: &TrackingParameters) {
        self.find_lane(t);
        self.find_learnt(learnt, t);
    }

    fn motion_for_lanes(&self) -> Motion {
        let place = self.middle();
        let sight = Direction::of(place.0, place.1);
        let (vx, vy) = (self.free.velocity.0 >> FRACTION, self.free.velocity.1 >> FRACTION);
        let newborn = self.age == 0;
        let radial = sight.along(vx, vy);
        Motion {
            place,
            place_variance: ASIDE_VARIANCE + self.gathered.across_cm * self.gathered.across_cm,
            sight,
            radial,
            across: if newborn { 0 } else { sight.across(vx, vy) },
            across_variance: if newborn { NEWBORN_SPEED } else { self.free.speed_variance() + BESIDE_VARIANCE },
            heading: (self.lane != NO_LANE || self.free_heading).then_some(self.heading),
        }
    }

    fn take(&mut self, lane: u8, heading: Direction, radial: i32, sight: Direction) {
        let speed = if self.lane == NO_LANE {
            // what it showed along the line of sight, where that says anything
            let along = heading.along(self.free.velocity.0, self.free.velocity.1);
            speed_along(heading, sight, radial).map_or(along, |s| s.clamp(0, 7000) << FRACTION)
        } else {
            self.heading.along(self.velocity.0, self.velocity.1)
        };
        self.lane = lane;
        // should it go its own way again, its motion tells the heading at once
        (self.free_heading, self.heading_variance) = (false, u16::MAX);
        self.unexplained = 0;
        self.head(heading, speed);
        if self.age == 0 {
            self.free = FreeMotion::new(self.position, NEWBORN_PLACE, self.velocity, NEWBORN_SPEED);
        }
    }

    /// Turns about its middle.
    pub(super) fn turn_to(&mut self, heading: Direction) {
        let (x, y) = self.middle();
        self.heading = heading;
        let (turned_x, turned_y) = self.middle();
        self.position.0 += (x - turned_x) << FRACTION;
        self.position.1 += (y - turned_y) << FRACTION;
    }

    /// Turns about its middle and goes on at a speed.
    fn head(&mut self, heading: Direction, speed: i32) {
        let part = |c: i16| mul_shift(speed, i32::from(c), 14);
        self.velocity = (part(heading.x), part(heading.y));
        self.turn_to(heading);
    }

    /// Turns with the lane it is on; at its end, into the next.
    pub(super) fn keep_to_lane(&mut self, t: &TrackingParameters) {
        if !self.is_on_given_lane() {
            return;
        }
        if let Some(on) = t.lanes.along(self.lane, self.middle()) {
            let speed = self.heading.along(self.velocity.0, self.velocity.1);
            self.lane = on.segment;
            self.head(on.heading, speed);
        } else {
            let before = self.lane;
            self.find_lane(t);
            if self.lane == before {
                self.lane = NO_LANE;
            }
        }
    }

    /// Looks for a better lane now and then.
    pub(super) fn look_for_lane(&mut self, t: &TrackingParameters) {
        if !t.lanes.is_empty() && self.age % LOOK_EVERY == 1 {
            self.find_lane(t);
        }
    }

    /// Takes the [learnt lane](super::learnt_lanes) that its motion fits best, where none is given and its own way is not
    /// known better.
    fn find_learnt<const N: usize>(&mut self, lanes: &LearntLanes<N>, t: &TrackingParameters) {
        let knows = self.free_heading && self.knows_its_way(t) && !self.goes_along_the_road(t);
        if t.lane_vehicles == 0 || knows || !matches!(self.lane, NO_LANE | LEARNT) {
            return;
        }
        let motion = self.motion_for_learnt(self.gathered.across_cm, t);
        if let Some(heading) = self.learnt_heading(&motion, lanes, t) {
            self.take(LEARNT, heading, motion.radial, motion.sight);
        }
    }

    /// Turns with the learnt lane it is on. Where that ends it goes on as it goes, along the road or its own way.
    pub(super) fn keep_to_learnt<const N: usize>(&mut self, lanes: &LearntLanes<N>, t: &TrackingParameters) {
        if self.lane != LEARNT {
            return;
        }
        // nothing is detected of it yet in this frame, so it is taken for measured as badly as the sensor may
        let (x, y) = self.middle();
        let across_cm = mul_shift(hypot_gate(x, y), t.noise.azimuth, 16);
        if let Some(heading) = self.learnt_heading(&self.motion_for_learnt(across_cm, t), lanes, t) {
            self.head(heading, self.heading.along(self.velocity.0, self.velocity.1));
        } else {
            self.lane = NO_LANE;
            self.free_heading = !self.goes_along_the_road(t);
        }
    }

    /// The same as for given lanes, but for the place: lanes are learnt from the middles of boxes.
    fn motion_for_learnt(&self, across_cm: i32, t: &TrackingParameters) -> Motion {
        let motion = self.motion_for_lanes();
        let place_variance = ASIDE_VARIANCE + across_cm * across_cm;
        if self.age == 0 {
            return Motion { place_variance, ..motion };
        }
        let (along, aside) = self.middle_of_box(&self.size(t));
        Motion { place: self.global(along, aside), place_variance, ..motion }
    }

    /// Direction of the learnt lane a motion fits best. What stands, or is drawn as long as a lorry, was seen to drive where it
    /// points, and keeps to that within 20 degrees.
    fn learnt_heading<const N: usize>(
        &self,
        motion: &Motion,
        lanes: &LearntLanes<N>,
        t: &TrackingParameters,
    ) -> Option<Direction> {
        let is_settled = self.is_standing(t) || (self.is_mover(t) && self.extent.length_cm() >= SETTLED_CM);
        let heading = lanes.heading(motion, t.lane_vehicles)?;
        (!is_settled || heading.cosine(self.heading) > PARALLEL).then_some(heading)
    }

    /// Looks for a better learnt lane now and then.
    pub(super) fn look_for_learnt<const N: usize>(&mut self, lanes: &LearntLanes<N>, t: &TrackingParameters) {
        if self.age % LOOK_EVERY == 1 {
            self.find_learnt(lanes, t);
        }
    }

    /// Shows where a lane is, if it is a vehicle that drives and its heading is known: what is measured of it, or the road's
    /// axis where that agrees with it.
    pub(super) fn teach<const N: usize>(&mut self, lanes: &mut LearntLanes<N>, t: &TrackingParameters) {
        let drives = self.seen() && self.existence >= t.confirmed && self.hits >= TEACHING_HITS && self.is_mover(t);
        let speed = self.speed();
        let known = speed >= TEACHING_SPEED && self.free.is_sure_of(speed >> FRACTION, TEACHING_SIGMAS);
        if t.lane_vehicles == 0 || !drives || !known || self.teaches_in_cm > 0 {
            return;
        }
        // of what fills a wide angle the reflections move along the side that it shows, and its motion seems another
        let (x, y) = self.middle();
        if hypot_gate(x, y) < TEACHING_LENGTHS * self.extent.length_cm() {
            return;
        }
        let (vx, vy) = self.free.velocity;
        let measured = Direction::of(vx, vy);
        let follows_axis = self.lane == NO_LANE && !self.free_heading;
        if follows_axis && measured.cosine(self.heading) < AGREES {
            return;
        }
        let heading = if follows_axis { self.heading } else { measured };
        let (along, aside) = self.middle_of_box(&self.size(t));
        lanes.learn(self.global(along, aside), heading);
        // in the mean as often, whatever way it makes in a frame
        let spacing = spacing_cm(heading);
        let next = self.teaches_in_cm.saturating_add(spacing);
        self.teaches_in_cm = if next > 0 { next } else { spacing };
    }

    /// Whether it follows a lane that was given.
    #[inline]
    fn is_on_given_lane(&self) -> bool {
        !matches!(self.lane, NO_LANE | LEARNT)
    }

    /// Whether it follows a lane, given or learnt.
    #[inline]
    pub(super) fn is_on_lane(&self) -> bool {
        self.lane != NO_LANE
    }

    /// How far to the left its middle is moved towards the middle of its lane, centimetres.
    pub(super) fn towards_lane(&self, place: (i32, i32), t: &TrackingParameters) -> i32 {
        let Some(on) = t.lanes.along(self.lane, place) else { return 0 };
        -mul_shift(on.left_cm.clamp(-MOST_ASIDE_CM, MOST_ASIDE_CM), TO_THE_MIDDLE, 8)
    }
}

/// Speed along a heading that explains a radial one, cm/s; `None` nearly across it.
fn speed_along(heading: Direction, sight: Direction, radial: i32) -> Option<i32> {
    let c = sight.cosine(heading);
    if c.abs() < LEAST_PROJECTION { None } else { (radial << 14).checked_div(c) }
}

#[cfg(test)]
mod tests {
    use super::super::Obstacles;
    use super::super::lanes::{Lane, Lanes};
    use super::super::made_up::{PERIOD_S, Vehicle, car, rules};
    use super::super::parameters::TrackingParameters;
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::fixed::time::Step;
    use crate::frame::by_range::ByRange;
    use crate::frame::reflection::Reflection;
    use crate::sensor::mount::Levelling;
    use crate::sensor::road::RoadPoint;
    use crate::sensor::site::LaneList;
    use std::vec::Vec;

    /// The default rules with lanes; the sensor stands at the origin and looks along x.
    fn with_lanes(lanes: &[Lane]) -> TrackingParameters {
        let level = Levelling::on_road(RoadPoint::new(0, 0), 600, Angle::ZERO);
        TrackingParameters { lanes: Lanes::new(&level, LaneList::Metres(lanes)).unwrap(), ..rules() }
    }

    fn frame(list: &mut Obstacles<16>, seen: &[Reflection], t: &TrackingParameters) {
        let step = Step::from_micros((PERIOD_S * 1e6) as u64);
        list.step(seen, &ByRange::<64>::sort(seen, t.limit_cm), step, t, |_, _| false);
    }

    fn follow(list: &mut Obstacles<16>, car: &mut Vehicle, frames: usize, t: &TrackingParameters) {
        for _ in 0..frames {
            frame(list, &car.reflections(), t);
            car.moved(PERIOD_S);
        }
    }

    /// Heading of the obstacle with the most detections, degrees from x.
    fn degrees(list: &Obstacles<16>) -> f64 {
        let o = list.iter().max_by_key(|o| o.hits).unwrap();
        f64::from(o.heading.y).atan2(f64::from(o.heading.x)).to_degrees()
    }

    const ACROSS: Lane = &[[40.0, -60.0], [40.0, 60.0]];

    #[test]
    fn on_a_lane_across_the_road_a_car_has_its_heading_in_the_first_frame() {
        let first = |t: &TrackingParameters| {
            let (mut list, mut car) = (Obstacles::new(), car([40.0, -20.0], [0.0, 1.0], 9.0));
            follow(&mut list, &mut car, 1, t);
            degrees(&list)
        };
        assert!((first(&with_lanes(&[ACROSS])) - 90.0).abs() < 1.0);
        assert!((first(&rules()) - 180.0).abs() < 1.0, "as it comes nearer, without a lane it comes along the road");
    }

    #[test]
    fn hidden_in_a_bend_it_goes_round_the_bend() {
        let t = with_lanes(&[&[[20.0, 0.0], [60.0, 0.0], [68.0, 3.0], [72.0, 11.0], [72.0, 60.0]]]);
        let (mut list, mut car) = (Obstacles::new(), car([30.0, 0.0], [1.0, 0.0], 10.0));
        follow(&mut list, &mut car, 30, &t);
        for _ in 0..45 {
            frame(&mut list, &[], &t);
        }
        let o = list.iter().next().unwrap();
        let (x, y) = o.anchor();
        assert!((degrees(&list) - 90.0).abs() < 1.0 && (x - 7200).abs() < 100 && y > 500, "{o:?}");
    }

    #[test]
    fn what_turns_off_a_lane_leaves_the_axis() {
        let t = with_lanes(&[ACROSS]);
        let (mut list, mut car) = (Obstacles::new(), car([40.0, -25.0], [0.0, 1.0], 9.0));
        follow(&mut list, &mut car, 15, &t);
        assert_eq!(list.iter().next().unwrap().lane, 0);
        (car.heading, car.velocity) = ([0.8, -0.6], [7.2, -5.4]);
        follow(&mut list, &mut car, 25, &t);
        let o = list.iter().max_by_key(|o| o.existence).unwrap();
        assert_eq!(o.lane, NO_LANE);
    }

    #[test]
    fn far_from_all_lanes_nothing_changes() {
        let boxes = |t: &TrackingParameters| {
            let (mut list, mut car) = (Obstacles::new(), car([30.0, 12.0], [1.0, 0.0], 9.0));
            follow(&mut list, &mut car, 20, t);
            list.solids(t).collect::<Vec<_>>()
        };
        assert_eq!(boxes(&rules()), boxes(&with_lanes(&[&[[20.0, -30.0], [120.0, -30.0]]])));
    }

    #[test]
    fn a_box_lies_nearer_to_the_middle_of_its_lane_than_what_is_seen() {
        let middle = |t: &TrackingParameters| {
            let (mut list, mut car) = (Obstacles::new(), car([30.0, 11.0], [1.0, 0.0], 9.0));
            follow(&mut list, &mut car, 20, t);
            list.solids(t).next().unwrap().y_cm
        };
        let (off, on) = (middle(&rules()), middle(&with_lanes(&[&[[20.0, 10.0], [120.0, 10.0]]])));
        assert!(off > 1050 && (off - on - (off - 1000) * TO_THE_MIDDLE / 256).abs() < 12, "{off} and {on}");
    }

    /// The default rules, and lanes are learnt from three vehicles.
    fn learning() -> TrackingParameters {
        TrackingParameters { lane_vehicles: 3, ..rules() }
    }

    /// After so many cars have crossed at 40 m, one after the other.
    fn after_cars(cars: usize, t: &TrackingParameters) -> Obstacles<16> {
        let mut list = Obstacles::new();
        for _ in 0..cars {
            follow(&mut list, &mut car([40.0, -35.0], [0.0, 1.0], 9.0), 90, t);
            list.clear();
        }
        list
    }

    #[test]
    fn where_cars_have_crossed_the_next_has_its_heading_in_the_first_frame() {
        // ahead of the sensor Doppler says nothing: from the right, it still comes nearer
        let first = |cars, t: &TrackingParameters, velocity| {
            let mut list = after_cars(cars, t);
            follow(&mut list, &mut car([40.0, -13.0 * velocity], [0.0, velocity], 9.0), 1, t);
            degrees(&list)
        };
        assert!((first(4, &learning(), 1.0) - 90.0).abs() < 4.0, "{}", first(4, &learning(), 1.0));
        for (cars, t, velocity) in [(1, learning(), 1.0), (4, rules(), 1.0), (4, learning(), -1.0)] {
            assert!(
                (first(cars, &t, velocity).abs() - 180.0).abs() < 1.0,
                "along the road: {}",
                first(cars, &t, velocity)
            );
        }
    }

    #[test]
    fn what_drives_by_nearer_than_three_lengths_teaches_nothing() {
        let t = learning();
        let nearest = |x| {
            let mut list = Obstacles::<16>::new();
            for _ in 0..4 {
                follow(&mut list, &mut car([x, -35.0], [0.0, 1.0], 9.0), 120, &t);
                list.clear();
            }
            let distances = list.learnt_lanes(&t).map(|((x, y), _)| f64::from(x).hypot(f64::from(y)) / 100.0);
            distances.fold(f64::INFINITY, f64::min)
        };
        // the car is 4.5 m long
        assert!((12.5..20.0).contains(&nearest(6.0)), "{} m", nearest(6.0));
        assert!((14.0..18.0).contains(&nearest(15.0)), "{} m", nearest(15.0));
    }

    /// How often a car teaches on 40 m of way, by what it has counted of its way before.
    fn taught(before_cm: u16) -> usize {
        let (t, mut lanes) = (learning(), LearntLanes::<16>::new());
        let mut o = Obstacle::new(&super::super::made_up::seen_at(4000, 0, 0), Direction::AHEAD, 1000);
        (o.existence, o.hits, o.travelled_cm) = (t.existence_max, 100, before_cm);
        let step = Step::from_micros(100_000);
        let mut taught = 0;
        for _ in 0..40 {
            o.predict(step, 1 << 16, &t);
            o.gathered.count = 1;
            o.free = FreeMotion::new(o.position, 100, o.velocity, 10);
            let before = o.teaches_in_cm;
            o.teach(&mut lanes, &t);
            taught += usize::from(o.teaches_in_cm != before);
        }
        taught
    }

    #[test]
    fn a_vehicle_teaches_as_often_however_far_it_has_come() {
        // a cell is 2.56 m
        assert_eq!(taught(0), 16);
        assert_eq!(taught(u16::MAX - 2000), 16);
        assert_eq!(taught(u16::MAX), 16);
    }

    #[test]
    fn learnt_lanes_outlast_the_vehicles_until_they_are_forgotten() {
        let t = learning();
        let mut list = after_cars(4, &t);
        list.forget_what_was_learnt();
        follow(&mut list, &mut car([40.0, -13.0], [0.0, 1.0], 9.0), 1, &t);
        assert!((degrees(&list).abs() - 180.0).abs() < 1.0, "{}", degrees(&list));
    }

    #[test]
    fn what_leaves_a_learnt_lane_leaves_the_axis() {
        let t = learning();
        let (mut list, mut car) = (after_cars(4, &t), car([40.0, -14.0], [0.0, 1.0], 9.0));
        follow(&mut list, &mut car, 10, &t);
        assert_eq!(list.iter().max_by_key(|o| o.hits).unwrap().lane, LEARNT);
        (car.heading, car.velocity) = ([0.8, -0.6], [7.2, -5.4]);
        follow(&mut list, &mut car, 30, &t);
        let o = list.iter().max_by_key(|o| o.existence).unwrap();
        assert_eq!(o.lane, NO_LANE);
        assert!((degrees(&list) + 37.0).abs() < 15.0, "{}", degrees(&list));
    }

    /// What crosses at 40 m and then crawls, as one that is drawn 16 m long along the road's axis or as a car.
    fn stopped(length_cm: i32, speed_cm_s: i32, t: &TrackingParameters) -> f64 {
        let lanes = after_cars(6, t);
        let mut o = Obstacle::new(&super::super::made_up::seen_at(4000, 100, 0), Direction::AHEAD, speed_cm_s);
        o.travelled_cm = 2000;
        o.age = 20;
        (o.extent.rear_cm, o.extent.front_cm) = (-length_cm / 2, length_cm / 2);
        (0..20).for_each(|_| {
            o.age += 1;
            o.look_for_learnt(&lanes.lanes, t);
            o.keep_to_learnt(&lanes.lanes, t);
        });
        f64::from(o.heading.y).atan2(f64::from(o.heading.x)).to_degrees()
    }

    #[test]
    fn what_stands_or_is_as_long_as_a_lorry_is_not_turned_onto_a_lane_across() {
        let t = learning();
        for (length_cm, speed) in [(1600, 0), (1600, 150), (400, 0)] {
            assert!(stopped(length_cm, speed, &t).abs() < 1.0, "{length_cm} cm at {speed} cm/s");
        }
        assert!((stopped(400, 150, &t) - 90.0).abs() < 4.0, "a car that crawls is");
    }

    #[test]
    fn after_an_hour_it_still_looks_for_a_lane_and_is_no_newborn() {
        let (step, t) = (Step::from_micros(0), rules());
        let mut o = Obstacle::new(&super::super::made_up::seen_at(4000, 100, 0), Direction::AHEAD, 0);
        o.age = u16::MAX - 9;
        let mut looks = 0;
        for _ in 0..40 {
            o.predict(step, 1 << 16, &t);
            looks += usize::from(o.age % LOOK_EVERY == 1);
            assert!(o.age > 1000, "{}", o.age);
        }
        assert_eq!(looks, 10);
    }

    #[test]
    fn where_a_learnt_lane_across_the_road_ends_the_box_keeps_the_margin_off_the_axis() {
        let t = learning();
        let mut list = after_cars(4, &t);
        // 4 s after the last cell that was driven on
        follow(&mut list, &mut car([40.0, -13.0], [0.0, 1.0], 9.0), 20, &t);
        let on = list.iter().max_by_key(|o| o.hits).unwrap().clone();
        assert_eq!(on.lane, LEARNT);
        let width = |o: &Obstacle| o.solid(&t).half_width_cm;
        let mut off = on.clone();
        off.keep_to_learnt(&LearntLanes::<16>::new(), &t);
        assert_eq!((off.lane, off.free_heading, width(&off)), (NO_LANE, true, width(&on)));
        // along the road it is one of the road's again
        let mut along = on;
        along.heading = Direction::AHEAD;
        along.keep_to_learnt(&LearntLanes::<16>::new(), &t);
        assert_eq!((along.lane, along.free_heading), (NO_LANE, false));
    }

    #[test]
    fn given_lanes_go_before_learnt_ones() {
        let crossing = after_cars(4, &learning());
        let given = TrackingParameters { lane_vehicles: 3, ..with_lanes(&[&[[38.5, -60.0], [41.5, 60.0]]]) };
        let mut list = crossing.clone();
        follow(&mut list, &mut car([40.0, -13.0], [0.0, 1.0], 9.0), 1, &given);
        let o = list.iter().max_by_key(|o| o.hits).unwrap();
        assert_eq!((o.lane, (degrees(&list) - 88.6).abs() < 0.5), (0, true), "{}", degrees(&list));
    }
}
