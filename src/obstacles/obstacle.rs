//! One moving obstacle: where it is, how it moves, and the outline its reflections have drawn.

use super::motion::{FreeMotion, Seen};
use super::profile::{BIN_CM, Extent, Profile};
use super::tallness::Tallness;
use super::tracking::Tracking;
use crate::math::{hypot_gate, length, mul_shift, ratio, root};
use crate::reflection::{Noise, Reflection};
use crate::solid::Solid;
use crate::time::Step;
use crate::trig::Direction;

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
    /// Variance of where across it the detections lie, noise taken off, cm^2.
    spread: i32,
    /// Evidence that it is there, 2^-8 detections.
    pub existence: i32,
    /// Detections so far, saturating.
    pub hits: u16,
    /// Frames since it appeared, saturating.
    pub age: u16,
    /// Way made so far, centimetres, saturating.
    travelled_cm: u16,
    tallness: Tallness,
    /// Its motion where the road's direction is not assumed.
    free: FreeMotion,
    /// Frames in a row in which motion along its heading did not explain where it is.
    unexplained: u8,
    /// Whether it goes its own way: speed and heading from `free`.
    roaming: bool,
    /// What this frame's detections add up to.
    gathered: Gathered,
}

/// Variance of the place of a newborn, cm^2: somewhere on a car.
const NEWBORN_PLACE: i32 = 150 * 150;
/// Variance of its speed across the line of sight, (cm/s)^2: as fast as traffic crosses.
const NEWBORN_SPEED: i32 = 1000 * 1000;
/// The same of what was slow and has a heading.
const SLOW_SPEED: i32 = 150 * 150;

/// Variance across a vehicle that reflects on both its sides, cm^2.
const EVEN_SPREAD: i32 = 85 * 85;
/// Detections over which the spread is taken.
const SPREAD_MEMORY: i32 = 40;

/// Greatest weight of a lateral estimate: [`ratio`]'s limit.
const MOST_WEIGHT: i32 = 1 << 26;

/// Sums over the detections of one frame.
#[derive(Debug, Clone, Copy)]
struct Gathered {
    count: i32,
    /// Speed error along the heading: sum of projection x error (2^-10 cm/s), and of projection
    /// squared (2^-14).
    speed: (i32, i32),
    /// Lateral place: sum of weight x offset, and of weights.
    lateral: (i32, i32),
    /// Place: sums of the offsets ahead of the anchor and to its left, cm.
    offset: (i32, i32),
    /// Sum of the squared offsets to the left, cm^2.
    squares: i32,
    /// Sum of the radial speed errors, 2^-4 cm/s.
    radial: i32,
    /// Line of sight to the last.
    sight: Direction,
    /// Noise of the last across it, cm.
    across_cm: i32,
}

impl Gathered {
    const NONE: Self = Self {
        count: 0,
        speed: (0, 0),
        lateral: (0, 0),
        offset: (0, 0),
        squares: 0,
        radial: 0,
        sight: Direction::AHEAD,
        across_cm: 0,
    };
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
        let (position, velocity) =
            ((fine(seed.x_cm), fine(seed.y_cm)), (part(heading.x), part(heading.y)));
        Self {
            position,
            velocity,
            free: FreeMotion::new(position, NEWBORN_PLACE, velocity, NEWBORN_SPEED),
            unexplained: 0,
            roaming: false,
            heading,
            profile: Profile::EMPTY,
            extent: Extent { rear_cm: -BIN_CM / 2, front_cm: BIN_CM / 2 },
            lateral_weight: 0,
            spread: EVEN_SPREAD,
            existence: 0,
            hits: 0,
            age: 0,
            travelled_cm: 0,
            tallness: Tallness::default(),
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

    /// Moves it on by a time step, which leaves a part (2^-16) of its lateral weight, and forgets the last
    /// frame's sums.
    pub fn predict(&mut self, step: Step, lateral_kept: i32, t: &Tracking) {
        let (dx, dy) = (step.times(self.velocity.0), step.times(self.velocity.1));
        self.position.0 += dx;
        self.position.1 += dy;
        let way = u16::try_from(hypot_gate(dx, dy) >> FRACTION).unwrap_or(u16::MAX);
        self.travelled_cm = self.travelled_cm.saturating_add(way);
        self.free.predict(step);
        self.lateral_weight = mul_shift(self.lateral_weight, self.kept_by_way(lateral_kept, t), 16);
        self.gathered = Gathered::NONE;
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

    /// Whether it has come to a stop.
    pub fn is_standing(&self, t: &Tracking) -> bool {
        self.is_mover(t) && self.speed() < t.standing_speed
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
        g.offset.0 += along;
        g.offset.1 += left;
        g.squares = g.squares.saturating_add(left * left);
        g.radial += error;
        g.sight = r.sight;
        g.across_cm = i32::from(r.across_cm);
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
    pub fn fade_outline(&mut self, kept: i32, t: &Tracking) {
        self.profile.fade(self.kept_by_way(kept, t));
    }

    /// What a memory keeps (2^-16) by the way made rather than by time: what stands stays what it is.
    fn kept_by_way(&self, kept: i32, t: &Tracking) -> i32 {
        let speed = (self.speed() >> FRACTION).min(t.memory_speed_cm_s);
        (1 << 16) - ((1 << 16) - kept) * speed / t.memory_speed_cm_s.max(1)
    }

    /// Brings motion, place and outline up to date with what was absorbed.
    #[allow(clippy::cast_possible_truncation)] // counts of one frame
    pub fn settle(&mut self, step: Step, t: &Tracking) {
        let g = self.gathered;
        if g.count == 0 {
            return;
        }
        self.follow(t);
        let weight = self.lateral_weight.saturating_add(g.lateral.1).clamp(1, MOST_WEIGHT);
        let offset = ratio::<FRACTION>(g.lateral.0, weight);
        if self.roaming && self.speed() > t.turning_speed {
            self.velocity = self.free.velocity;
            self.heading = Direction::of(self.velocity.0, self.velocity.1);
            self.move_left(offset);
        } else {
            let inertia = if self.age < t.young { t.young_inertia } else { t.inertia };
            self.push_along(ratio::<12>(g.speed.0, g.speed.1 + inertia));
            self.move_left(offset);
            if self.age >= t.young {
                self.turn(offset, step, t);
            }
        }
        self.lateral_weight = weight;
        let noise = (g.across_cm * self.heading.cosine(g.sight)) >> 14;
        let spread = (g.squares / g.count - noise * noise).clamp(0, 4 * EVEN_SPREAD);
        self.spread += (spread - self.spread) * g.count / (g.count + SPREAD_MEMORY);
        self.question(t);
        self.update_extent(t);
        self.hits = self.hits.saturating_add(g.count as u16);
        let gained = g.count.min(t.most_hits_a_frame) << 8;
        self.existence = (self.existence + gained).min(t.existence_max);
    }

    /// Speed, 2^-8 cm/s.
    fn speed(&self) -> i32 {
        hypot_gate(self.velocity.0, self.velocity.1)
    }

    /// Lets the free motion follow this frame's detections.
    fn follow(&mut self, t: &Tracking) {
        let g = self.gathered;
        let (along, left) = ((g.offset.0 << FRACTION) / g.count, (g.offset.1 << FRACTION) / g.count);
        let (hx, hy) = (i32::from(self.heading.x), i32::from(self.heading.y));
        let centre = (
            self.position.0 + mul_shift(along, hx, 14) - mul_shift(left, hy, 14),
            self.position.1 + mul_shift(along, hy, 14) + mul_shift(left, hx, 14),
        );
        // a vehicle reflects anywhere along the side it shows
        let shown = (self.extent.length_cm().max(t.sizes.min_length_cm) * self.heading.sine(g.sight).abs()) >> 14;
        let seen = Seen {
            count: g.count,
            centre,
            variance: ((shown * shown / 12 + 50 * 50 + g.across_cm * g.across_cm) / g.count).max(400),
            sight: g.sight,
            radial: ((g.radial / g.count) << 4) + g.sight.along(self.velocity.0, self.velocity.1),
        };
        self.free.update(&seen);
    }

    /// Judges whether motion along the heading explains where it is seen; if not for long, it goes its own way.
    fn question(&mut self, t: &Tracking) {
        if self.roaming {
            if self.speed() <= t.turning_speed {
                self.free = FreeMotion::new(self.position, NEWBORN_PLACE, self.velocity, SLOW_SPEED);
            }
            return;
        }
        let (dx, dy) =
            ((self.free.velocity.0 - self.velocity.0) >> FRACTION, (self.free.velocity.1 - self.velocity.1) >> FRACTION);
        let off = length(dx, dy);
        let sure = off * off > t.roam_sigmas * t.roam_sigmas * self.free.speed_variance();
        let aside = self.heading.across(dx, dy).abs();
        let way_off = aside > t.roam_speed_cm_s && aside > mul_shift(self.speed(), t.roam_share, 16 + FRACTION);
        if way_off && sure {
            self.unexplained += 1;
        } else {
            self.unexplained = 0;
        }
        if self.unexplained >= t.roam_frames {
            self.roam();
        }
    }

    /// Goes on from the free motion.
    fn roam(&mut self) {
        self.roaming = true;
        self.position = self.free.place;
        self.velocity = self.free.velocity;
        self.heading = Direction::of(self.velocity.0, self.velocity.1);
        self.profile = Profile::EMPTY;
        self.extent = Extent { rear_cm: -BIN_CM / 2, front_cm: BIN_CM / 2 };
        self.lateral_weight = 0;
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
        let Some(mut extent) = self.profile.extent(t.outline_min_hits, t.outline_share) else { return };
        let g = self.gathered;
        let smear = (g.across_cm * self.heading.sine(g.sight).abs()) >> 14;
        let shrink = ((smear * t.shrink) >> 4).min(extent.length_cm() / 4);
        extent.front_cm -= shrink;
        extent.rear_cm += shrink;
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
        if (self.is_standing(t) || other.is_standing(t)) && self.is_mover(t) && other.is_mover(t) && t.nojoin {
            return false;
        }
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
        let tall = self.tallness.floor_cm();
        let least = if t.tall_length { match tall { ..260 => 0, 260..310 => 600, 310..360 => 750, _ => 900 } } else { 0 };
        let size = t.sizes.of(self.extent.length_cm().max(least));
        let (x, y) = self.global(self.extent.middle_cm(), 0);
        let hidden = (size.length_cm - self.extent.length_cm()).max(0) / 2;
        let (ahead, left) = (self.heading.along(x, y), self.heading.across(x, y));
        // the side the radar sees is where the detections are, the other one behind it
        let (side, end) = (size.length_cm * left.abs(), size.width_cm * ahead.abs());
        let shown = (side / ((side + end) / 512).max(1)).min(256);
        let unseen = (size.width_cm / 2 - root((self.spread + self.spread / 8).unsigned_abs()) as i32).max(0);
        let aside = (((unseen * shown) >> 8) * t.aside) >> 8;
        let (x, y) = self.global(
            self.extent.middle_cm() + if ahead >= 0 { hidden } else { -hidden },
            if left >= 0 { aside } else { -aside },
        );
        Solid {
            x_cm: x,
            y_cm: y,
            heading: self.heading,
            half_length_cm: size.length_cm / 2,
            half_width_cm: size.width_cm / 2,
            height_cm: size.height_cm.max(tall),
        }
    }
}
