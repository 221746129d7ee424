//! One moving obstacle: where it is, how it moves, and the outline its reflections have drawn.

use super::BEHIND_CM;
use super::gathered::Gathered;
use super::lanes::NO_LANE;
use super::motion::FreeMotion;
use super::parameters::{
    EVEN_SPREAD, INERTIA, MOST_HITS_A_FRAME, RECENTRE_BINS, TrackingParameters, YOUNG_FRAMES, YOUNG_INERTIA,
    speed_error,
};
use super::profile::{BIN_CM, Extent, Profile};
use super::reflectivity::Reflectivity;
use super::tallness::Tallness;
use crate::fixed::math::{hypot_gate, mul_shift, ratio};
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;
use crate::frame::reflection::Reflection;

/// Fraction bits of positions and velocities.
pub(super) const FRACTION: u32 = 8;

/// A moving obstacle in the levelled frame.
///
/// The *anchor* is a point on its centre line that moves with it; the outline is kept relative to
/// the anchor.
#[derive(Debug, Clone)]
pub struct Obstacle {
    /// Anchor, 2^-8 cm.
    pub(super) position: (i32, i32),
    /// 2^-8 cm/s.
    pub(super) velocity: (i32, i32),
    /// Direction of travel.
    pub heading: Direction,
    pub(super) profile: Profile,
    /// Outline along the heading, relative to the anchor.
    pub extent: Extent,
    /// Weight of the lateral estimate: the sum of its detections', fading.
    pub(super) lateral_weight: i32,
    /// Variance of where across it the detections lie, their noise taken off, cm^2; below 0 where that was less than
    /// assumed.
    pub(super) spread: i32,
    /// Length it has shown for long, 2^-4 cm.
    pub(super) shown_length: i32,
    /// Evidence that it is there, 2^-8 detections.
    pub existence: i32,
    /// Detections so far, saturating.
    pub hits: u16,
    /// Frames since it appeared; goes round in the upper half of its range.
    pub age: u16,
    /// Way made so far, centimetres, saturating.
    pub(super) travelled_cm: u16,
    pub(super) tallness: Tallness,
    pub(super) reflectivity: Reflectivity,
    /// Its motion where the road's direction is not assumed.
    pub(super) free: FreeMotion,
    /// Frames in a row in which motion along its heading did not explain where it is.
    pub(super) unexplained: u8,
    /// How much of the last frames hid the end that is turned to the sensor, 2^-8.
    pub(super) hidden_end: i16,
    /// Whether what is seen of it can only be its [farther end](super::room).
    pub(super) farther_end: bool,
    /// Whether it goes its own way, with speed and heading from `free`.
    pub(super) free_heading: bool,
    /// Variance of that heading, 2^-16 rad^2, saturating, and the greatest there is while it does not.
    pub(super) heading_variance: u16,
    /// Segment of the lane it follows, [`LEARNT`](super::lanes::LEARNT), or [`NO_LANE`].
    pub(super) lane: u8,
    /// Way to go until [lanes are learnt](super::learnt_lanes) from it again, centimetres, and what it has gone beyond.
    pub(super) teaches_in_cm: i16,
    /// What this frame's detections add up to.
    pub(super) gathered: Gathered,
}

/// Variance of the place of a newborn, cm^2: somewhere on a car.
pub(super) const NEWBORN_PLACE: i32 = 150 * 150;
/// Variance of its speed across the line of sight, (cm/s)^2: as fast as traffic crosses.
pub(super) const NEWBORN_SPEED: i32 = 1000 * 1000;
/// Detections over which the spread to the sides is taken.
const SPREAD_MEMORY: i32 = 40;
/// Greatest weight of a lateral estimate: [`ratio`]'s limit.
pub(super) const MOST_WEIGHT: i32 = 1 << 26;
/// Fraction bits of the length it has shown.
const LENGTH_FRACTION: u32 = 4;
/// Fastest drift to one side that turns a heading, 2^-8 cm/s: a metre a second.
const FASTEST_DRIFT: i32 = 100 << FRACTION;

impl Obstacle {
    /// A new obstacle at a detection, travelling along `heading` at a speed in cm/s.
    pub fn new(seed: &Reflection, heading: Direction, speed_cm_s: i32) -> Self {
        let fine = |v: i32| v << FRACTION;
        let part = |c: i16| ((speed_cm_s << 4) * i32::from(c)) >> (14 + 4 - FRACTION);
        let position = (fine(seed.x_cm), fine(seed.y_cm));
        let velocity = (part(heading.x), part(heading.y));
        Self {
            position,
            velocity,
            free: FreeMotion::new(position, NEWBORN_PLACE, velocity, NEWBORN_SPEED),
            unexplained: 0,
            hidden_end: 0,
            farther_end: false,
            free_heading: false,
            heading_variance: u16::MAX,
            lane: NO_LANE,
            teaches_in_cm: 0,
            heading,
            profile: Profile::EMPTY,
            extent: Extent { rear_cm: -BIN_CM / 2, front_cm: BIN_CM / 2 },
            lateral_weight: 0,
            spread: EVEN_SPREAD,
            shown_length: 0,
            existence: 0,
            hits: 0,
            age: 0,
            travelled_cm: 0,
            tallness: Tallness::default(),
            reflectivity: Reflectivity::default(),
            gathered: Gathered::NONE,
        }
    }

    /// Anchor, centimetres.
    pub fn anchor(&self) -> (i32, i32) {
        (self.position.0 >> FRACTION, self.position.1 >> FRACTION)
    }

    /// Velocity, cm/s.
    pub fn velocity(&self) -> (i32, i32) {
        (self.velocity.0 >> FRACTION, self.velocity.1 >> FRACTION)
    }

    /// Whether this frame brought a detection.
    pub fn seen(&self) -> bool {
        self.gathered.count > 0
    }

    /// A place in the obstacle's axes: ahead of the anchor and to its left, centimetres.
    pub fn local(&self, x_cm: i32, y_cm: i32) -> (i32, i32) {
        let (ax, ay) = self.anchor();
        (self.heading.along(x_cm - ax, y_cm - ay), self.heading.across(x_cm - ax, y_cm - ay))
    }

    /// The place `along` ahead of the anchor and `left` of it, centimetres.
    pub fn global(&self, along: i32, left: i32) -> (i32, i32) {
        let (ax, ay) = self.anchor();
        let (hx, hy) = (i32::from(self.heading.x), i32::from(self.heading.y));
        (ax + ((along * hx - left * hy) >> 14), ay + ((along * hy + left * hx) >> 14))
    }

    /// Whether its rear is the end that is turned to the sensor, not its front.
    pub(super) fn shows_its_rear(&self) -> bool {
        let (x, y) = self.anchor();
        self.heading.along(x, y) > 0
    }

    /// Moves it on by a time step, which leaves a part (2^-16) of its lateral weight, and forgets the last
    /// frame's sums.
    pub fn predict(&mut self, step: Step, lateral_kept: i32, t: &TrackingParameters) {
        let (dx, dy) = (step.times(self.velocity.0), step.times(self.velocity.1));
        self.position.0 += dx;
        self.position.1 += dy;
        let way = u16::try_from(hypot_gate(dx, dy) >> FRACTION).unwrap_or(u16::MAX);
        self.travelled_cm = self.travelled_cm.saturating_add(way);
        self.teaches_in_cm = self.teaches_in_cm.saturating_sub_unsigned(way);
        self.free.predict(step, t.turning_noise);
        self.lateral_weight = mul_shift(self.lateral_weight, lateral_kept, 16);
        self.gathered = Gathered::NONE;
        // goes round high up, so that what is done every few frames goes on
        self.age = self.age.checked_add(1).unwrap_or(u16::MAX / 2 + 1);
        self.keep_to_lane(t);
    }

    /// Whether it has moved far enough to be no fixture that clutter gave a speed.
    pub fn is_mover(&self, t: &TrackingParameters) -> bool {
        i32::from(self.travelled_cm) >= t.mover_cm
    }

    /// Whether it stands still without ever having moved.
    pub fn is_fixture(&self, t: &TrackingParameters) -> bool {
        !self.is_mover(t) && self.age >= 2 && self.speed() < t.fixture_speed
    }

    /// Whether it is where obstacles are followed.
    pub(super) fn is_within_reach(&self, t: &TrackingParameters) -> bool {
        let (x, y) = self.anchor();
        x > BEHIND_CM && x < t.limit_cm && y.abs() < t.limit_cm
    }

    /// Whether it has come to a stop.
    pub fn is_standing(&self, t: &TrackingParameters) -> bool {
        self.is_mover(t) && self.speed() < t.standing_speed
    }

    /// Longest stretch without reflections within one vehicle: no longer than vehicles keep from each
    /// other at this speed.
    pub(super) fn gap_cm(&self, t: &TrackingParameters) -> i32 {
        t.gap_cm.min(self.headway_cm(t.headway, t))
    }

    /// Distance that vehicles this fast keep at a headway (2^-16 s).
    pub(super) fn headway_cm(&self, headway: i32, t: &TrackingParameters) -> i32 {
        let speed = self.speed() >> FRACTION;
        t.standstill_cm + mul_shift(speed, headway, 16)
    }

    /// Takes a detection that belongs to it.
    pub fn absorb(&mut self, r: &Reflection, t: &TrackingParameters) {
        let (along, left) = self.local(r.x_cm, r.y_cm);
        let error = speed_error((self.velocity.0 >> 4, self.velocity.1 >> 4), r);
        self.gathered.add(r, self.heading, (along, left), error, &t.noise);
        self.profile.add(along);
        if let Some((height, sigma)) = r.height_cm {
            self.tallness.add(i32::from(height), i32::from(sigma));
        }
    }

    /// Takes a detection of one of its wheels: their Doppler says nothing of its speed.
    pub fn absorb_wheel(&mut self, r: &Reflection) {
        let (along, _) = self.local(r.x_cm, r.y_cm);
        self.profile.add(along);
    }

    /// Stretches the outline of a newborn to a detection, so that the next finds it.
    pub fn reach(&mut self, r: &Reflection) {
        let (along, _) = self.local(r.x_cm, r.y_cm);
        self.extent.front_cm = self.extent.front_cm.max(along);
        self.extent.rear_cm = self.extent.rear_cm.min(along);
    }

    /// Keeps a part (2^-16) of the outline; to be called before this frame's detections are absorbed.
    pub fn fade_outline(&mut self, kept: i32) {
        self.profile.fade(kept);
    }

    /// Brings motion, place and outline up to date with what was absorbed.
    #[allow(clippy::cast_possible_truncation)] // counts of one frame
    pub fn settle(&mut self, step: Step, t: &TrackingParameters) {
        let g = self.gathered;
        if g.count == 0 {
            return;
        }
        if let Some(rcs) = g.rcs_half_dbsm {
            self.reflectivity.add(rcs);
            self.tallness.set_reflected(self.reflectivity.evidence(t.lorry_rcs));
        }
        self.follow(t);
        let weight = self.lateral_weight.saturating_add(g.lateral.1).clamp(1, MOST_WEIGHT);
        let offset = ratio::<FRACTION>(g.lateral.0, weight);
        if self.free_heading && self.knows_its_way(t) {
            self.velocity = self.free.velocity;
            self.turn_with_motion(step);
            self.move_left(offset);
        } else {
            if self.free_heading {
                self.keep_heading();
            } else {
                let inertia = if self.age < YOUNG_FRAMES { YOUNG_INERTIA } else { INERTIA };
                self.push_along(ratio::<12>(g.speed.0, g.speed.1 + inertia));
            }
            self.move_left(offset);
            if self.age >= YOUNG_FRAMES && !self.is_on_lane() {
                self.turn(offset, step, t);
            }
        }
        self.lateral_weight = weight;
        let off = g.spread(self.heading).clamp(self.least_spread(), 4 * EVEN_SPREAD) - self.spread;
        self.spread += off * g.count / (g.count + SPREAD_MEMORY).max(1);
        self.question_heading(t);
        self.look_for_lane(t);
        self.update_extent(t);
        self.remember_length(step, t);
        self.hits = self.hits.saturating_add(g.count as u16);
        let gained = g.count.min(MOST_HITS_A_FRAME) << 8;
        self.existence = (self.existence + gained).min(t.existence_max);
    }

    /// Speed, 2^-8 cm/s.
    pub(super) fn speed(&self) -> i32 {
        hypot_gate(self.velocity.0, self.velocity.1)
    }

    /// Adds to the speed along the heading, 2^-8 cm/s.
    fn push_along(&mut self, dv: i32) {
        self.velocity.0 += mul_shift(dv, i32::from(self.heading.x), 14);
        self.velocity.1 += mul_shift(dv, i32::from(self.heading.y), 14);
    }

    /// Moves the anchor to the left, 2^-8 cm.
    pub(super) fn move_left(&mut self, offset: i32) {
        self.position.0 -= mul_shift(offset, i32::from(self.heading.y), 14);
        self.position.1 += mul_shift(offset, i32::from(self.heading.x), 14);
    }

    /// Lets a lasting drift to one side turn the heading.
    fn turn(&mut self, offset: i32, step: Step, t: &TrackingParameters) {
        // at most a metre a second, which a ratio of one would exceed
        let (drift, step) = (mul_shift(offset, t.drift_gain, 16), step.raw().clamp(1, 1 << 20));
        let dv = ratio::<16>(drift.clamp(-step, step), step).clamp(-FASTEST_DRIFT, FASTEST_DRIFT);
        let left = self.heading.left();
        self.velocity.0 += mul_shift(dv, i32::from(left.x), 14);
        self.velocity.1 += mul_shift(dv, i32::from(left.y), 14);
        if self.speed() > t.turning_speed {
            self.heading = Direction::of(self.velocity.0, self.velocity.1);
        }
    }

    /// Lets the length it has shown follow the outline: quickly where that grows, slowly where a part of it
    /// is hidden.
    fn remember_length(&mut self, step: Step, t: &TrackingParameters) {
        let off = (self.extent.length_cm() << LENGTH_FRACTION) - self.shown_length;
        let memory = if off > 0 { t.length_growth } else { t.length_memory };
        self.shown_length += mul_shift(off, (1 << 16) - step.keep(memory), 16);
    }

    /// Length it has shown for long, centimetres, while slow.
    pub(super) fn remembered_length_cm(&self, t: &TrackingParameters) -> i32 {
        if self.speed() < t.slow_speed { self.shown_length >> LENGTH_FRACTION } else { 0 }
    }

    /// Reads the outline and keeps the anchor near its middle.
    pub(super) fn update_extent(&mut self, t: &TrackingParameters) {
        let Some(mut extent) = self.profile.extent(t.outline_min_hits, t.outline_share) else { return };
        // azimuth's noise lengthens what stands across the line of sight
        let noise = (self.gathered.smear_cm(self.heading) * t.outline_sigmas) >> 4;
        let shrink = noise.min(extent.length_cm() / 4);
        extent.front_cm -= shrink;
        extent.rear_cm += shrink;
        self.extent = extent;
        let bins = extent.middle_cm() / BIN_CM;
        if bins.abs() >= RECENTRE_BINS {
            self.recentre(bins);
        }
    }

    /// Moves the anchor forward by bins of the profile; everything stays where it is.
    pub(super) fn recentre(&mut self, bins: i32) {
        self.profile.shift(bins);
        let by = bins * BIN_CM;
        self.position.0 += mul_shift(by << FRACTION, i32::from(self.heading.x), 14);
        self.position.1 += mul_shift(by << FRACTION, i32::from(self.heading.y), 14);
        self.extent = Extent { rear_cm: self.extent.rear_cm - by, front_cm: self.extent.front_cm - by };
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{rules, seen_at};
    use super::*;

    const AHEAD: Direction = Direction::AHEAD;

    #[test]
    fn an_obstacle_moves_the_way_it_drives() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 300, -2000), AHEAD.reversed(), 2000);
        o.predict(Step::from_micros(500_000), 1 << 16, &t);
        assert_eq!(o.anchor(), (4000, 300));
        assert_eq!((o.age, o.travelled_cm), (1, 1000));
        o.lateral_weight = 1000;
        o.predict(Step::from_micros(0), 1 << 15, &t);
        assert_eq!(o.lateral_weight, 500);
    }

    #[test]
    fn detections_pull_speed_and_place_towards_themselves() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        o.predict(Step::from_micros(66_667), 1 << 16, &t);
        let (x, _) = o.anchor();
        // faster than it, and to its left
        (0..4).for_each(|_| o.absorb(&seen_at(x, 60, 2100), &t));
        o.settle(Step::from_micros(66_667), &t);
        assert!((2050..=2100).contains(&o.velocity().0), "{:?}", o.velocity());
        assert!((50..=60).contains(&o.anchor().1), "{:?}", o.anchor());
        assert_eq!(o.existence, MOST_HITS_A_FRAME << 8, "of four detections three count");
    }

    #[test]
    fn the_surer_of_two_detections_says_where_it_is() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        o.absorb(&Reflection { across_cm: 20, ..seen_at(5000, 60, 2000) }, &t);
        o.absorb(&Reflection { across_cm: 400, ..seen_at(5000, -60, 2000) }, &t);
        o.settle(Step::from_micros(66_667), &t);
        assert!(o.anchor().1 > 50, "{:?}", o.anchor());
    }

    #[test]
    fn what_lies_in_a_row_but_for_noise_has_no_spread_where_an_end_is_hidden() {
        assert!(spread_of_noise(256).abs() < 300, "{} cm^2", spread_of_noise(256));
        assert!(spread_of_noise(0) > 500, "{} cm^2", spread_of_noise(0));
    }

    /// Spread of detections in a row with noise as it is assumed to be, cm^2.
    fn spread_of_noise(hidden_end: i16) -> i32 {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        for k in 0..400 {
            o.predict(Step::from_micros(66_667), 1 << 16, &t);
            (o.lateral_weight, o.hidden_end) = (MOST_WEIGHT, hidden_end);
            let (x, y) = o.anchor();
            // standard deviation 40 cm, as assumed: every other frame shows more than that
            let off = if k % 2 == 0 { 55 } else { 14 };
            o.absorb(&seen_at(x, y + off, 2000), &t);
            (o.position.1, o.velocity.1) = (0, 0);
            o.settle(Step::from_micros(66_667), &t);
        }
        o.spread
    }

    #[test]
    fn a_newborn_stretches_to_what_is_found_before_and_behind_it() {
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        o.reach(&seen_at(4600, 0, 2000));
        assert_eq!(o.extent, Extent { rear_cm: -400, front_cm: BIN_CM / 2 });
        o.reach(&seen_at(5300, 0, 2000));
        o.reach(&seen_at(5100, 0, 2000));
        assert_eq!(o.extent, Extent { rear_cm: -400, front_cm: 300 });
    }

    #[test]
    fn a_drift_to_the_left_turns_the_heading_to_the_left() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        for _ in 0..20 {
            o.predict(Step::from_micros(66_667), 60_000, &t);
            let (x, y) = o.anchor();
            o.absorb(&seen_at(x, y + 30, 2000), &t);
            o.settle(Step::from_micros(66_667), &t);
        }
        assert!(o.heading.y > 50 && o.velocity().1 > 5, "{:?} {:?}", o.heading, o.velocity());
    }

    #[test]
    fn what_never_moved_and_stands_is_a_fixture() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 0), AHEAD, 20);
        o.age = 2;
        assert!(o.is_fixture(&t) && !o.is_mover(&t));
        o.travelled_cm = 200;
        assert!(!o.is_fixture(&t) && o.is_mover(&t), "a vehicle that stopped");
        let mut o = Obstacle::new(&seen_at(5000, 0, 0), AHEAD, 200);
        o.age = 2;
        assert!(!o.is_fixture(&t));
    }
}
