//! One moving obstacle: where it is, how it moves, and the outline its reflections have drawn.

use super::profile::{BIN_CM, Extent, Profile};
use super::tallness::Tallness;
use super::tracking::Tracking;
use crate::fixed::math::{hypot_gate, length, mul_shift, ratio, root};
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;
use crate::frame::reflection::Reflection;
use crate::obstacles::solid::Solid;
use crate::sensor::noise::Noise;

/// Fraction bits of positions and velocities.
const FRACTION: u32 = 8;

/// A moving obstacle in the levelled frame.
///
/// The *anchor* is a point on its centre line that moves with it; the outline is kept relative to
/// the anchor.
#[derive(Debug, Clone)]
pub struct Obstacle {
    /// Anchor, 2^-8 cm.
    position: (i32, i32),
    /// 2^-8 cm/s.
    velocity: (i32, i32),
    /// Direction of travel.
    pub heading: Direction,
    profile: Profile,
    /// Outline along the heading, relative to the anchor.
    pub extent: Extent,
    /// Weight of the lateral estimate; [`weight`] of each detection, fading.
    lateral_weight: i32,
    /// Evidence that it is there, 2^-8 detections.
    pub existence: i32,
    /// Detections so far, saturating.
    pub hits: u16,
    /// Frames since it appeared, saturating.
    pub age: u16,
    /// Way made so far, centimetres, saturating.
    travelled_cm: u16,
    tallness: Tallness,
    /// What this frame's detections add up to.
    gathered: Gathered,
}

/// Greatest weight of a lateral estimate: [`ratio`]'s limit.
const MOST_WEIGHT: i32 = 1 << 26;

/// Sums over the detections of one frame.
#[derive(Debug, Clone, Copy, Default)]
struct Gathered {
    count: i32,
    /// Speed error along the heading: sum of projection x error (2^-10 cm/s), and of projection
    /// squared (2^-14).
    speed: (i32, i32),
    /// Lateral place: sum of weight x offset, and of weights.
    lateral: (i32, i32),
}

/// Weight of a lateral measurement with a standard deviation in centimetres: the inverse variance,
/// with half a metre for where on the vehicle it reflects.
fn weight(sigma_cm: i32) -> i32 {
    (1 << 24) / (2500 + sigma_cm * sigma_cm).max(1)
}

/// Standard deviation of a detection along a heading, centimetres.
fn sigma_along(heading: Direction, r: &Reflection, noise: &Noise) -> i32 {
    let across_cm = i32::from(r.across_cm);
    let (along, across) = (heading.cosine(r.sight).abs(), heading.sine(r.sight).abs());
    hypot_gate((noise.range_cm * along) >> 14, (across_cm * across) >> 14)
}

/// Standard deviation of a detection across a heading, centimetres.
fn sigma_across(heading: Direction, r: &Reflection, noise: &Noise) -> i32 {
    let across_cm = i32::from(r.across_cm);
    let (along, across) = (heading.cosine(r.sight).abs(), heading.sine(r.sight).abs());
    hypot_gate((noise.range_cm * across) >> 14, (across_cm * along) >> 14)
}

/// An obstacle with what every comparison needs at hand.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    heading: Direction,
    /// 2^-4 cm/s
    velocity: (i32, i32),
    extent: Extent,
    anchor: (i32, i32),
    /// Longest stretch of it without reflections.
    gap_cm: i32,
    /// Farthest from the anchor a detection of this obstacle can lie along either axis.
    reach_cm: i32,
    /// The square which that spans: its corner of least coordinates, and its side.
    corner: (i32, i32),
    side_cm: u32,
}

/// A detection in an obstacle's axes, centimetres.
#[derive(Debug, Clone, Copy)]
pub struct Offset {
    /// To the left of the centre line.
    left: i32,
    /// Beside the strip detections of a vehicle spread over.
    beside: i32,
    /// Beyond either end of the outline.
    beyond: i32,
}

/// How far noise carries a detection beyond its obstacle, centimetres.
const NOISE_REACH_CM: i32 = 600;

impl Search {
    /// Least and greatest distance from the sensor a detection of this obstacle can have.
    pub fn distances_cm(&self) -> (i32, i32) {
        let (x, y) = self.anchor;
        let distance = length(x, y).max(1);
        // how far the square that is searched, in the obstacle's axes, reaches along the line of sight; and
        // as far it reaches to its sides, whose corners lie a little farther out
        let part = (self.heading.along(x, y).abs() + self.heading.across(x, y).abs()).min(3 * distance / 2);
        let reach = (self.reach_cm * part) / distance;
        (distance - reach, distance + reach + reach * reach / distance / 2)
    }

    /// Whether a place is near enough to look closer.
    #[inline]
    pub fn reaches(&self, x_cm: i32, y_cm: i32) -> bool {
        // one comparison for both ends; across the road first, for what is compared lies at the same range
        let within = |v: i32, corner: i32| v.wrapping_sub(corner).cast_unsigned() <= self.side_cm;
        within(y_cm, self.corner.1) && within(x_cm, self.corner.0)
    }

    /// Where a detection lies in the obstacle's axes; `None` where it is out of reach, whatever the direction
    /// of its noise.
    #[inline]
    pub fn offset(&self, r: &Reflection, t: &Tracking) -> Option<Offset> {
        let (dx, dy) = (r.x_cm - self.anchor.0, r.y_cm - self.anchor.1);
        let noise = (t.sigmas * (t.noise.range_cm + i32::from(r.across_cm))) >> 4;
        let left = self.heading.across(dx, dy);
        let beside = (left.abs() - t.half_width_cm).max(0);
        if beside > t.lateral_gate_cm + noise {
            return None;
        }
        let beyond = self.extent.beyond_cm(self.heading.along(dx, dy));
        (beyond <= self.gap_cm + noise).then_some(Offset { left, beside, beyond })
    }

    /// Difference between a detection's radial velocity and the one the obstacle's motion explains, 2^-4 cm/s.
    #[inline]
    pub fn speed_error(&self, r: &Reflection) -> i32 {
        speed_error(self.velocity, r).abs()
    }

    /// Whether a detection may come from a wheel of this obstacle, which returns anything between standstill
    /// and twice its speed.
    #[inline]
    pub fn is_speed_of_wheel(&self, r: &Reflection, t: &Tracking) -> bool {
        let body = r.sight.along(self.velocity.0, self.velocity.1);
        let wheel = i32::from(r.radial_velocity_cm_s) << 4;
        let spun = if body < 0 { -wheel } else { wheel };
        (0..=2 * body.abs() + t.doppler_gate).contains(&spun)
    }

    /// How badly a detection with this offset and error of its speed fits, 2^-8; `None` where it cannot belong
    /// to this obstacle.
    pub fn misfit(&self, r: &Reflection, offset: Offset, error: i32, t: &Tracking) -> Option<i32> {
        let Offset { left, beside, beyond } = offset;
        if self.extent.length_cm() + beyond > t.max_length_cm + 100 {
            return None;
        }
        // far along the vehicle or far to its side, but not both
        let part = |distance: i32, gate: i32, sigma: i32| (distance << 8) / (gate + ((t.sigmas * sigma) >> 4)).max(1);
        let ahead = if beyond > 0 { part(beyond, self.gap_cm, sigma_along(self.heading, r, &t.noise)) } else { 0 };
        let sigma_across = sigma_across(self.heading, r, &t.noise);
        let aside = if beside > 0 { part(beside, t.lateral_gate_cm, sigma_across) } else { 0 };
        if ahead > 256 || aside > 256 || ahead * ahead + aside * aside > 256 * 256 {
            return None;
        }
        // each term is a squared distance in its own scale: 0.7 m along, the width and noise across,
        // half a metre a second (twice) in speed
        let by_length = beyond * beyond / 19;
        let by_width =
            (left * left * 16) / ((t.half_width_cm * t.half_width_cm + sigma_across * sigma_across) / 16).max(1);
        let by_speed = error * error / 1250;
        Some(by_length + by_width + by_speed)
    }
}

/// Difference between a detection's radial velocity and the one a motion (2^-4 cm/s) explains,
/// 2^-4 cm/s.
fn speed_error(velocity: (i32, i32), r: &Reflection) -> i32 {
    (i32::from(r.radial_velocity_cm_s) << 4) - r.sight.along(velocity.0, velocity.1)
}

impl Obstacle {
    /// A new obstacle at a detection, travelling along `heading` at a speed in cm/s.
    pub fn new(seed: &Reflection, heading: Direction, speed_cm_s: i32) -> Self {
        let fine = |v: i32| v << FRACTION;
        let part = |c: i16| ((speed_cm_s << 4) * i32::from(c)) >> (14 + 4 - FRACTION);
        Self {
            position: (fine(seed.x_cm), fine(seed.y_cm)),
            velocity: (part(heading.x), part(heading.y)),
            heading,
            profile: Profile::EMPTY,
            extent: Extent { rear_cm: -BIN_CM / 2, front_cm: BIN_CM / 2 },
            lateral_weight: 0,
            existence: 0,
            hits: 0,
            age: 0,
            travelled_cm: 0,
            tallness: Tallness::default(),
            gathered: Gathered::default(),
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

    /// Moves it on by a time step, which leaves a part (2^-16) of its lateral weight, and forgets the last
    /// frame's sums.
    pub fn predict(&mut self, step: Step, lateral_kept: i32) {
        let (dx, dy) = (step.times(self.velocity.0), step.times(self.velocity.1));
        self.position.0 += dx;
        self.position.1 += dy;
        let way = u16::try_from(hypot_gate(dx, dy) >> FRACTION).unwrap_or(u16::MAX);
        self.travelled_cm = self.travelled_cm.saturating_add(way);
        self.lateral_weight = mul_shift(self.lateral_weight, lateral_kept, 16);
        self.gathered = Gathered::default();
        self.age = self.age.saturating_add(1);
    }

    /// Whether it has moved far enough to be no fixture that clutter gave a speed.
    pub fn is_mover(&self, t: &Tracking) -> bool {
        i32::from(self.travelled_cm) >= t.mover_cm
    }

    /// Whether it stands still without ever having moved.
    pub fn is_fixture(&self, t: &Tracking) -> bool {
        !self.is_mover(t) && self.age >= 2 && hypot_gate(self.velocity.0, self.velocity.1) < t.fixture_speed
    }

    /// Longest stretch without reflections within one vehicle: no longer than vehicles keep from each
    /// other at this speed.
    fn gap_cm(&self, t: &Tracking) -> i32 {
        t.gap_cm.min(self.headway_cm(t.headway, t))
    }

    /// Distance that vehicles this fast keep at a headway (2^-16 s).
    fn headway_cm(&self, headway: i32, t: &Tracking) -> i32 {
        let speed = hypot_gate(self.velocity.0, self.velocity.1) >> FRACTION;
        t.standstill_cm + mul_shift(speed, headway, 16)
    }

    /// What it takes to look for this obstacle's detections.
    pub fn search(&self, t: &Tracking) -> Search {
        let outline = self.extent.front_cm.max(-self.extent.rear_cm);
        let gap_cm = self.gap_cm(t);
        let anchor = self.anchor();
        let reach_cm = outline + gap_cm + NOISE_REACH_CM;
        Search {
            heading: self.heading,
            velocity: (self.velocity.0 >> 4, self.velocity.1 >> 4),
            extent: self.extent,
            anchor,
            gap_cm,
            reach_cm,
            corner: (anchor.0 - reach_cm, anchor.1 - reach_cm),
            side_cm: 2 * reach_cm.unsigned_abs(),
        }
    }

    /// Takes a detection that belongs to it.
    pub fn absorb(&mut self, r: &Reflection, t: &Tracking) {
        let (along, left) = self.local(r.x_cm, r.y_cm);
        let projection = self.heading.cosine(r.sight);
        let error = speed_error((self.velocity.0 >> 4, self.velocity.1 >> 4), r);
        let w = weight(sigma_across(self.heading, r, &t.noise));
        let g = &mut self.gathered;
        g.count += 1;
        g.speed.0 = g.speed.0.saturating_add((projection * error) >> 8);
        g.speed.1 += (projection * projection) >> 14;
        g.lateral.0 = g.lateral.0.saturating_add(w * left);
        g.lateral.1 = g.lateral.1.saturating_add(w);
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
    pub fn settle(&mut self, step: Step, t: &Tracking) {
        let g = self.gathered;
        if g.count == 0 {
            return;
        }
        let inertia = if self.age < t.young { t.young_inertia } else { t.inertia };
        self.push_along(ratio::<12>(g.speed.0, g.speed.1 + inertia));
        let weight = self.lateral_weight.saturating_add(g.lateral.1).clamp(1, MOST_WEIGHT);
        let offset = ratio::<FRACTION>(g.lateral.0, weight);
        self.move_left(offset);
        self.lateral_weight = weight;
        if self.age >= t.young {
            self.turn(offset, step, t);
        }
        self.update_extent(t);
        self.hits = self.hits.saturating_add(g.count as u16);
        let gained = g.count.min(t.most_hits_a_frame) << 8;
        self.existence = (self.existence + gained).min(t.existence_max);
    }

    /// Adds to the speed along the heading, 2^-8 cm/s.
    fn push_along(&mut self, dv: i32) {
        self.velocity.0 += mul_shift(dv, i32::from(self.heading.x), 14);
        self.velocity.1 += mul_shift(dv, i32::from(self.heading.y), 14);
    }

    /// Moves the anchor to the left, 2^-8 cm.
    fn move_left(&mut self, offset: i32) {
        self.position.0 -= mul_shift(offset, i32::from(self.heading.y), 14);
        self.position.1 += mul_shift(offset, i32::from(self.heading.x), 14);
    }

    /// Lets a lasting drift to one side turn the heading.
    fn turn(&mut self, offset: i32, step: Step, t: &Tracking) {
        // at most a metre a second, which a ratio of one would exceed
        let (drift, step) = (mul_shift(offset, t.drift_gain, 16), step.raw().clamp(1, 1 << 20));
        let dv = ratio::<16>(drift.clamp(-step, step), step).clamp(-(100 << FRACTION), 100 << FRACTION);
        let left = self.heading.left();
        self.velocity.0 += mul_shift(dv, i32::from(left.x), 14);
        self.velocity.1 += mul_shift(dv, i32::from(left.y), 14);
        if hypot_gate(self.velocity.0, self.velocity.1) > t.turning_speed {
            self.heading = Direction::of(self.velocity.0, self.velocity.1);
        }
    }

    /// Reads the outline and keeps the anchor near its middle.
    fn update_extent(&mut self, t: &Tracking) {
        let Some(extent) = self.profile.extent(t.outline_min_hits, t.outline_share) else { return };
        self.extent = extent;
        let bins = extent.middle_cm() / BIN_CM;
        if bins.abs() >= t.recentre_bins {
            self.recentre(bins);
        }
    }

    /// Moves the anchor forward by bins of the profile; everything stays where it is.
    fn recentre(&mut self, bins: i32) {
        self.profile.shift(bins);
        let by = bins * BIN_CM;
        self.position.0 += mul_shift(by << FRACTION, i32::from(self.heading.x), 14);
        self.position.1 += mul_shift(by << FRACTION, i32::from(self.heading.y), 14);
        self.extent = Extent { rear_cm: self.extent.rear_cm - by, front_cm: self.extent.front_cm - by };
    }

    /// Whether another obstacle is near enough to be a part of the same vehicle, or to lie within it.
    #[inline]
    pub fn is_near(&self, other: &Self, t: &Tracking) -> bool {
        let far = (2 * t.max_length_cm) << FRACTION;
        (self.position.0 - other.position.0).abs() <= far && (self.position.1 - other.position.1).abs() <= far
    }

    /// Whether another obstacle, a [near](Self::is_near) one, is a part of the same vehicle: in line, equally fast, and no farther
    /// away than vehicles keep from each other at this speed.
    #[inline]
    pub fn is_one_with(&self, other: &Self, t: &Tracking) -> bool {
        let (dvx, dvy) = (self.velocity.0 - other.velocity.0, self.velocity.1 - other.velocity.1);
        if hypot_gate(dvx, dvy) > t.merge_speed {
            return false;
        }
        if self.heading.cosine(other.heading) < t.merge_parallel {
            return false;
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
            && hypot_gate(dvx, dvy) <= t.coupled_speed
            && left.abs() <= t.merge_lateral_cm;
        let widest = if coupled { self.headway_cm(t.coupled_headway, t) } else { self.gap_cm(t) };
        gap <= widest && length <= t.max_length_cm
    }

    /// Whether another obstacle lies within this one, where nothing else can be: a wheel that was taken
    /// for a vehicle, or an echo between the two.
    #[inline]
    pub fn encloses(&self, other: &Self, t: &Tracking) -> bool {
        let far = t.max_length_cm << FRACTION;
        if (self.position.0 - other.position.0).abs() > far || (self.position.1 - other.position.1).abs() > far {
            return false;
        }
        let (x, y) = other.global(other.extent.middle_cm(), 0);
        let (along, left) = self.local(x, y);
        left.abs() <= t.merge_lateral_cm && self.extent.beyond_cm(along) == 0
    }

    /// Standard deviation of the lateral place, centimetres.
    fn lateral_sigma(&self) -> i32 {
        let variance = (1_u32 << 24) / self.lateral_weight.max(1).unsigned_abs();
        root(variance).min(1000) as i32
    }

    /// Takes over what another obstacle knows of the same vehicle.
    #[allow(clippy::cast_possible_truncation)] // a share of the offset
    pub fn join(&mut self, other: &Self, t: &Tracking) {
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
        self.existence = (self.existence + other.existence).min(t.existence_max);
        self.hits = self.hits.saturating_add(other.hits);
        self.travelled_cm = self.travelled_cm.max(other.travelled_cm);
        self.tallness.join(&other.tallness);
        self.update_extent(t);
    }

    /// The box it fills: the outline lengthened to what is usual, behind the face the radar sees.
    pub fn solid(&self, t: &Tracking) -> Solid {
        let size = t.sizes.of(self.extent.length_cm());
        let (x, y) = self.global(self.extent.middle_cm(), 0);
        let hidden = (size.length_cm - self.extent.length_cm()).max(0) / 2;
        let receding = self.heading.along(x, y) >= 0;
        let (x, y) = self.global(self.extent.middle_cm() + if receding { hidden } else { -hidden }, 0);
        Solid {
            x_cm: x,
            y_cm: y,
            heading: self.heading,
            half_length_cm: size.length_cm / 2,
            half_width_cm: size.width_cm / 2,
            height_cm: size.height_cm.max(self.tallness.floor_cm()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacles::tracking::ObstacleConfig;
    use crate::sensor::noise::NoiseConfig;

    const AHEAD: Direction = Direction::AHEAD;

    fn tracking() -> Tracking {
        let noise = NoiseConfig::default().noise().unwrap();
        ObstacleConfig::default().tracking(noise, AHEAD, 22_500).unwrap()
    }

    fn reflection(x_cm: i32, y_cm: i32, radial_velocity_cm_s: i16) -> Reflection {
        Reflection {
            x_cm,
            y_cm,
            ground_cm: length(x_cm, y_cm) as u16,
            sight: Direction::of(x_cm, y_cm),
            radial_velocity_cm_s,
            across_cm: 40,
            height_cm: None,
            strength: 0,
        }
    }

    #[test]
    fn a_wheel_turns_the_way_its_vehicle_drives_between_standstill_and_twice_its_speed() {
        let t = tracking();
        for (heading, sign) in [(AHEAD, 1), (AHEAD.reversed(), -1)] {
            let search = Obstacle::new(&reflection(5000, 0, sign * 2000), heading, 2000).search(&t);
            let may = |speed: i16| search.is_speed_of_wheel(&reflection(5000, 0, sign * speed), &t);
            assert!(may(0) && may(500) && may(3900), "{heading:?}");
            assert!(!may(-500) && !may(-2000) && !may(4500), "{heading:?}");
        }
    }

    #[test]
    fn an_obstacle_moves_the_way_it_drives() {
        let mut o = Obstacle::new(&reflection(5000, 300, -2000), AHEAD.reversed(), 2000);
        o.predict(Step::from_micros(500_000), 1 << 16);
        assert_eq!(o.anchor(), (4000, 300));
        assert_eq!((o.age, o.travelled_cm), (1, 1000));
        o.lateral_weight = 1000;
        o.predict(Step::from_micros(0), 1 << 15);
        assert_eq!(o.lateral_weight, 500);
    }

    #[test]
    fn detections_pull_speed_and_place_towards_themselves() {
        let t = tracking();
        let mut o = Obstacle::new(&reflection(5000, 0, 2000), AHEAD, 2000);
        o.predict(Step::from_micros(66_667), 1 << 16);
        let (x, _) = o.anchor();
        // faster than it, and to its left
        (0..4).for_each(|_| o.absorb(&reflection(x, 60, 2100), &t));
        o.settle(Step::from_micros(66_667), &t);
        assert!((2050..=2100).contains(&o.velocity().0), "{:?}", o.velocity());
        assert!((50..=60).contains(&o.anchor().1), "{:?}", o.anchor());
        assert_eq!(o.existence, t.most_hits_a_frame << 8, "of four detections three count");
    }

    #[test]
    fn the_surer_of_two_detections_says_where_it_is() {
        let t = tracking();
        let mut o = Obstacle::new(&reflection(5000, 0, 2000), AHEAD, 2000);
        o.absorb(&Reflection { across_cm: 20, ..reflection(5000, 60, 2000) }, &t);
        o.absorb(&Reflection { across_cm: 400, ..reflection(5000, -60, 2000) }, &t);
        o.settle(Step::from_micros(66_667), &t);
        assert!(o.anchor().1 > 50, "{:?}", o.anchor());
    }

    #[test]
    fn a_newborn_stretches_to_what_is_found_before_and_behind_it() {
        let mut o = Obstacle::new(&reflection(5000, 0, 2000), AHEAD, 2000);
        o.reach(&reflection(4600, 0, 2000));
        assert_eq!(o.extent, Extent { rear_cm: -400, front_cm: BIN_CM / 2 });
        o.reach(&reflection(5300, 0, 2000));
        o.reach(&reflection(5100, 0, 2000));
        assert_eq!(o.extent, Extent { rear_cm: -400, front_cm: 300 });
    }

    #[test]
    fn a_drift_to_the_left_turns_the_heading_to_the_left() {
        let t = tracking();
        let mut o = Obstacle::new(&reflection(5000, 0, 2000), AHEAD, 2000);
        for _ in 0..20 {
            o.predict(Step::from_micros(66_667), 60_000);
            let (x, y) = o.anchor();
            o.absorb(&reflection(x, y + 30, 2000), &t);
            o.settle(Step::from_micros(66_667), &t);
        }
        assert!(o.heading.y > 50 && o.velocity().1 > 5, "{:?} {:?}", o.heading, o.velocity());
    }

    #[test]
    fn noise_lies_across_the_line_of_sight() {
        let t = tracking();
        let r = Reflection { across_cm: 300, ..reflection(0, 8000, 0) };
        // seen broadside, the noise across the line of sight lies along the road
        assert!((sigma_along(AHEAD, &r, &t.noise) - 300).abs() < 25);
        assert!((sigma_across(AHEAD, &r, &t.noise) - t.noise.range_cm).abs() < 5);
        let r = Reflection { across_cm: 300, ..reflection(8000, 0, 0) };
        assert!((sigma_across(AHEAD, &r, &t.noise) - 300).abs() < 25);
    }

    /// Two obstacles in one lane, `apart_cm` between the first's front and the second's rear end.
    fn two(apart_cm: i32, left_cm: i32, speed: i32) -> (Obstacle, Obstacle) {
        let mut a = Obstacle::new(&reflection(5000, 0, 0), AHEAD, 2000);
        a.extent = Extent { rear_cm: -200, front_cm: 200 };
        let mut b = Obstacle::new(&reflection(5000 + 400 + apart_cm, left_cm, 0), AHEAD, speed);
        b.extent = Extent { rear_cm: -200, front_cm: 200 };
        (a.lateral_weight, b.lateral_weight) = (MOST_WEIGHT, MOST_WEIGHT);
        (a, b)
    }

    #[test]
    fn parts_of_one_vehicle_are_in_line_equally_fast_and_close() {
        let t = tracking();
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
    fn only_what_lies_between_the_ends_is_enclosed() {
        let t = tracking();
        let (a, b) = two(-350, 0, 2000);
        assert!(a.encloses(&b, &t), "its middle 50 cm ahead of the other's");
        let (a, b) = two(-100, 0, 2000);
        assert!(!a.encloses(&b, &t), "its middle 300 cm ahead");
        let (a, b) = two(-350, 150, 2000);
        assert!(!a.encloses(&b, &t), "beside it");
    }

    #[test]
    fn joined_obstacles_reach_from_end_to_end_and_lie_where_the_surer_one_did() {
        let t = tracking();
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

    #[test]
    fn what_was_hidden_of_a_vehicle_lies_behind_its_face() {
        let t = tracking();
        for heading in [AHEAD, AHEAD.reversed()] {
            let solid = Obstacle::new(&reflection(5000, 0, 0), heading, 2000).solid(&t);
            assert!(solid.x_cm - solid.half_length_cm > 4900, "{heading:?}: {solid:?}");
        }
    }

    #[test]
    fn what_never_moved_and_stands_is_a_fixture() {
        let t = tracking();
        let mut o = Obstacle::new(&reflection(5000, 0, 0), AHEAD, 20);
        o.age = 2;
        assert!(o.is_fixture(&t) && !o.is_mover(&t));
        o.travelled_cm = 200;
        assert!(!o.is_fixture(&t) && o.is_mover(&t), "a vehicle that stopped");
        let mut o = Obstacle::new(&reflection(5000, 0, 0), AHEAD, 200);
        o.age = 2;
        assert!(!o.is_fixture(&t));
    }
}
