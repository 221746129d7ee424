//! Lanes of traffic, where an integrator gives them: which way things drive at a place.
//!
//! Off the road's axis Doppler alone does not say where a thing goes, and a heading that is wrong for a second puts its
//! box metres aside. A lane says it at once: of a newborn, of what crawls or stands, and of what is hidden in a bend.
//!
//! # Model
//! A lane is a polyline in the direction of its traffic. A motion fits it by two squared distances in their standard
//! deviations: how far to the side of it the thing lies, and how far the motion is from any speed along it. The best
//! fit below a limit is taken; off all lanes nothing changes.
//!
//! # Limits
//! At most [`MOST_LANES`] lanes of [`MOST_SEGMENTS`] segments in all, none without the feature `lanes`; what is wrong with
//! one is refused by name.

use heapless::Vec;

use crate::fixed::math::{length, mul_shift};
use crate::fixed::trig::{self, Direction};
use crate::sensor::config::{ConfigError, Problem, within};
use crate::sensor::mount::Levelling;
use crate::sensor::road::RoadPoint;
use crate::sensor::site::{LaneList, Points};

/// A lane: a polyline in the direction of its traffic, metres in road coordinates, x along the road and y to the left.
pub type Lane = &'static [[f32; 2]];

/// Whether there is room for any.
pub const ROOM: bool = cfg!(feature = "lanes");
/// Most lanes.
pub const MOST_LANES: usize = if ROOM { 64 } else { 0 };
/// Most segments of all lanes together.
pub const MOST_SEGMENTS: usize = if ROOM { 128 } else { 0 };

/// The segment of what follows no lane.
pub(super) const NO_LANE: u8 = u8::MAX;
/// The segment of what follows a lane that was [learnt](super::learnt_lanes).
pub(super) const LEARNT: u8 = u8::MAX - 1;

/// Farthest that a point may lie from the sensor along either axis, centimetres: [`Levelling::place`] ends at 450 m.
const FARTHEST_CM: i32 = 40_000;
/// Shortest segment, centimetres.
const SHORTEST_CM: i32 = 50;
/// Length of a unit of a stored place: two centimetres, so that 400 m fit 16 bits.
const UNIT_SHIFT: u32 = 1;

/// Segments this near to each other lie on one line, and what they share of it is more than rounding if it is longer, centimetres:
/// points are rounded to two, and a direction to five in 800 m.
const ON_LINE_CM: i32 = 10;

/// Lanes in the levelled frame.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Lanes {
    segments: Vec<Segment, MOST_SEGMENTS, u8>,
    lanes: u8,
}

/// One straight piece of a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Segment {
    /// Where it starts, 2 cm.
    start: (i16, i16),
    heading: Direction,
    /// 2 cm
    length: u16,
    lane: u8,
}

/// A place on a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct OnLane {
    /// Number of the segment.
    pub segment: u8,
    /// Direction of its traffic.
    pub heading: Direction,
    /// How far the place lies to the left of the lane's middle, centimetres.
    pub left_cm: i32,
}

/// What is known of a motion for which a lane is looked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// Levelled, centimetres.
    pub place: (i32, i32),
    /// Variance of the place to any side, cm^2.
    pub place_variance: i32,
    /// Line of sight to it.
    pub sight: Direction,
    /// Speed along the line of sight, cm/s.
    pub radial: i32,
    /// Speed to the left of it, cm/s, and its variance.
    pub across: i32,
    pub across_variance: i32,
    /// Where it headed so far; what stands or crawls does not turn round.
    pub heading: Option<Direction>,
}

/// Standard deviation of the radial speed that vehicles on a lane show beside its direction, squared, (cm/s)^2.
const RADIAL_VARIANCE: i32 = 50 * 50;
/// One, in the scale of a misfit.
const UNIT: i32 = 16;
/// Greatest misfit of a motion on a lane: three standard deviations.
pub(super) const MOST_MISFIT: i32 = 9 * UNIT;
/// Speeds above this are no vehicle's, cm/s.
const MOST_SPEED: i32 = 8000;
/// Farthest from a lane's middle, centimetres.
const WIDEST_CM: i32 = 400;
/// How far beyond an end of a segment a place may lie, centimetres.
const BEYOND_CM: i32 = 150;

impl Lanes {
    /// Takes lanes over.
    ///
    /// # Errors
    /// Too many lanes or segments; a lane of one point, with a point that is repeated or too far from the sensor, or
    /// that crosses itself or goes back along itself: by the number of the lane, from 0.
    pub fn new(levelling: &Levelling, lanes: LaneList<'_>) -> Result<Self, ConfigError> {
        let mut all = Self::default();
        all.set(levelling, lanes).map(|()| all)
    }

    /// The same where they stay.
    ///
    /// # Errors
    /// As [`new`](Self::new); which lanes are there then is not said.
    #[inline(never)] // once a start
    pub fn set(&mut self, levelling: &Levelling, mut lanes: LaneList<'_>) -> Result<(), ConfigError> {
        self.segments.clear();
        self.lanes = 0;
        if !ROOM {
            if lanes.next().is_none() {
                return Ok(());
            }
            return Err(ConfigError { parameter: "lanes", value: 0.0, problem: Problem::TooManyLanes });
        }
        for points in lanes.take(MOST_LANES + 1) {
            self.add(levelling, points)?;
        }
        Ok(())
    }

    /// Whether there are none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !ROOM || self.segments.is_empty()
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // limits are checked
    fn add(&mut self, levelling: &Levelling, points: Points<'_>) -> Result<(), ConfigError> {
        let lane = self.lanes;
        let refuse = |problem| Err(ConfigError { parameter: "lanes", value: f32::from(lane), problem });
        if MOST_LANES.checked_sub(usize::from(lane) + 1).is_none() {
            return refuse(Problem::TooManyLanes);
        }
        if points.take(2).count() < 2 {
            return refuse(Problem::OnePoint);
        }
        let first = self.segments.len();
        let mut last = None;
        for [x, y] in points {
            let place = levelling.place(RoadPoint::from_metres(
                within("lanes.points", x, -10_000.0, 10_000.0)?,
                within("lanes.points", y, -10_000.0, 10_000.0)?,
            )?);
            if place.0.abs() > FARTHEST_CM || place.1.abs() > FARTHEST_CM {
                return refuse(Problem::TooFar);
            }
            if let Some((fx, fy)) = last.replace(place) {
                let (dx, dy) = (place.0 - fx, place.1 - fy);
                // in units: across the whole view a segment is longer than a length in centimetres may be
                let long = length(dx >> UNIT_SHIFT, dy >> UNIT_SHIFT);
                if long < SHORTEST_CM >> UNIT_SHIFT {
                    return refuse(Problem::PointTwice);
                }
                let segment = Segment {
                    start: ((fx >> UNIT_SHIFT) as i16, (fy >> UNIT_SHIFT) as i16),
                    heading: Direction::of(dx, dy),
                    length: long as u16,
                    lane,
                };
                let crosses = self.segments.iter().skip(first).any(|other| other.crosses(&segment));
                if crosses {
                    return refuse(Problem::CrossesItself);
                }
                if self.segments.push(segment).is_err() {
                    return refuse(Problem::TooManyPoints);
                }
            }
        }
        self.lanes += 1;
        Ok(())
    }

    /// The place on a lane that a motion fits best.
    #[allow(clippy::cast_possible_truncation)] // the list is bounded
    pub(super) fn best(&self, m: &Motion) -> Option<OnLane> {
        let mut found = None;
        let mut least = MOST_MISFIT;
        for (k, s) in self.segments.iter().enumerate() {
            let (along, left) = s.local(m.place);
            if left.abs() > WIDEST_CM || along < -BEYOND_CM || along > s.length_cm() + BEYOND_CM {
                continue;
            }
            let Some(misfit) = m.misfit(s.heading, left) else { continue };
            if misfit < least {
                least = misfit;
                found = Some(OnLane { segment: k as u8, heading: s.heading, left_cm: left });
            }
        }
        found
    }

    /// The same lane at a place farther along, or before; `None` beyond its ends, or off it.
    pub(super) fn along(&self, segment: u8, place: (i32, i32)) -> Option<OnLane> {
        let mut k = segment;
        let mut here = self.segments.get(usize::from(k))?;
        // no farther than one lane has segments
        for _ in &self.segments {
            let (along, left) = here.local(place);
            let step = if along > here.length_cm() {
                1
            } else if along < 0 {
                -1
            } else {
                0
            };
            let next = k.checked_add_signed(step).and_then(|n| self.segments.get(usize::from(n)).map(|s| (n, s)));
            match next.filter(|(_, s)| step != 0 && s.lane == here.lane) {
                // in the wedge between two segments each calls the other
                Some((n, s)) if step > 0 || s.local(place).0 < s.length_cm() => (k, here) = (n, s),
                _ => {
                    let inside = along >= -BEYOND_CM && along <= here.length_cm() + BEYOND_CM;
                    return (inside && left.abs() <= WIDEST_CM).then_some(OnLane {
                        segment: k,
                        heading: here.heading,
                        left_cm: left,
                    });
                }
            }
        }
        None
    }
}

impl Segment {
    fn length_cm(&self) -> i32 {
        i32::from(self.length) << UNIT_SHIFT
    }

    /// A place along it and to its left, centimetres.
    fn local(&self, (x, y): (i32, i32)) -> (i32, i32) {
        let start = self.start_cm();
        let (dx, dy) = (x - start.0, y - start.1);
        (self.heading.along(dx, dy), self.heading.across(dx, dy))
    }

    fn start_cm(&self) -> (i32, i32) {
        (i32::from(self.start.0) << UNIT_SHIFT, i32::from(self.start.1) << UNIT_SHIFT)
    }

    fn end_cm(&self) -> (i32, i32) {
        let ((x, y), heading) = (self.start_cm(), self.heading);
        let ahead = |part: i16| (self.length_cm() * i32::from(part)) >> 14;
        (x + ahead(heading.x), y + ahead(heading.y))
    }

    /// Whether two segments cross or lie on each other, ends not counted.
    fn crosses(&self, other: &Self) -> bool {
        let parts = |a: &Self, b: &Self| {
            let (from, to) = (a.local(b.start_cm()).1, a.local(b.end_cm()).1);
            (from > 2 && to < -2) || (from < -2 && to > 2)
        };
        (parts(self, other) && parts(other, self)) || self.lies_on(other)
    }

    /// Whether two segments share a stretch of one line.
    fn lies_on(&self, other: &Self) -> bool {
        // the direction of the longer is known better
        let (long, short) = if self.length < other.length { (other, self) } else { (self, other) };
        let ((a, left_a), (b, left_b)) = (long.local(short.start_cm()), long.local(short.end_cm()));
        let shared = a.max(b).min(long.length_cm()) - a.min(b).max(0);
        left_a.abs().max(left_b.abs()) <= ON_LINE_CM && shared > ON_LINE_CM
    }
}

impl Motion {
    /// How badly it fits a lane in this direction, to the left of whose middle it lies so far (centimetres); `None` for the opposite direction.
    pub(super) fn misfit(&self, heading: Direction, left: i32) -> Option<i32> {
        // speed s along the heading shows as s c along the line of sight and s k across it; the best s leaves
        // (radial k - across c)^2 / (k^2 radial variance + c^2 across variance)
        let (c, k) = (self.sight.cosine(heading), self.sight.sine(heading));
        let squared = |v: i32| (v * v) >> 14;
        let off = (self.radial * k - self.across * c) >> 14;
        let variance = mul_shift(squared(k), RADIAL_VARIANCE, 14) + mul_shift(squared(c), self.across_variance, 14);
        let off = off.clamp(-MOST_SPEED, MOST_SPEED);
        let by_speed = off * off / (variance / UNIT).max(1);
        let weight = (self.across_variance / RADIAL_VARIANCE).clamp(1, 1000);
        let speed = ((self.radial * c) >> 14) * weight + ((self.across * k) >> 14);
        if speed < -30 * weight {
            return None;
        }
        let turned = self.heading.map_or(0, |h| (trig::ONE - h.cosine(heading)) >> 6);
        let by_place = left * left / (self.place_variance / UNIT).max(1);
        Some(by_speed + turned + by_place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use std::vec;
    use std::vec::Vec;

    fn level() -> Levelling {
        Levelling::on_road(RoadPoint::new(0, 0), 600, Angle::ZERO)
    }

    fn lanes(all: &[Lane]) -> Lanes {
        Lanes::new(&level(), LaneList::Metres(all)).unwrap()
    }

    /// A motion that is seen for the first time, with a radial speed.
    fn newborn(x: i32, y: i32, radial: i32) -> Motion {
        Motion {
            place: (x, y),
            place_variance: 120 * 120,
            sight: Direction::of(x, y),
            radial,
            across: 0,
            across_variance: 1000 * 1000,
            heading: None,
        }
    }

    #[test]
    fn a_lane_that_cannot_be_is_refused_by_its_number() {
        let good: Lane = &[[0.0, 0.0], [50.0, 0.0]];
        let refused = |lane: Lane| Lanes::new(&level(), LaneList::Metres(&[good, lane])).unwrap_err();
        for (lane, problem) in [
            (&[][..], Problem::OnePoint),
            (&[[1.0, 2.0]], Problem::OnePoint),
            (&[[1.0, 2.0], [1.1, 2.0]], Problem::PointTwice),
            (&[[10.0, 2.0], [500.0, 2.0]], Problem::TooFar),
            (&[[0.0, 0.0], [50.0, 0.0], [50.0, 20.0], [20.0, -20.0]], Problem::CrossesItself),
            // back along itself: at once, to its beginning and beyond, and after a turn
            (&[[0.0, 0.0], [50.0, 0.0], [20.0, 0.0]], Problem::CrossesItself),
            (&[[10.0, 3.0], [50.0, 13.0], [10.0, 3.0]], Problem::CrossesItself),
            (&[[20.0, 0.0], [50.0, 0.0], [0.0, 0.0]], Problem::CrossesItself),
            (&[[0.0, 0.0], [0.5, 0.0], [0.0, 0.0]], Problem::CrossesItself),
            (&[[0.0, 0.0], [50.0, 0.0], [70.0, 20.0], [70.0, 0.0], [20.0, 0.0]], Problem::CrossesItself),
            (&[[-399.0, -399.0], [399.0, 301.0], [0.0, -49.0]], Problem::CrossesItself),
        ] {
            let e = refused(lane);
            assert_eq!((e.parameter, e.value, e.problem), ("lanes", 1.0, problem), "{e}");
        }
        let e = refused(&[[0.0, 0.0], [f32::NAN, 0.0]]);
        assert_eq!((e.parameter, e.problem), ("lanes.points", Problem::NotFinite));
    }

    #[test]
    fn a_lane_that_bends_touches_itself_or_closes_does_not_cross_itself() {
        for lane in [
            // back beside itself, as near as lanes may be
            &[[0.0, 0.0], [50.0, 0.0], [50.0, 20.0], [0.0, 20.0]][..],
            &[[0.0, 0.0], [50.0, 0.0], [0.0, 0.5]],
            &[[0.0, 0.0], [50.0, 0.0], [50.0, 0.6], [0.0, 0.6]],
            // on along one line, in short pieces and long ones
            &[[0.0, 0.0], [0.5, 0.1], [1.0, 0.2], [100.0, 20.0], [399.0, 79.8]],
            // a loop that ends where it began, at a corner and on a straight
            &[[10.0, 0.0], [50.0, 0.0], [50.0, 40.0], [10.0, 0.0]],
            &[[30.0, 0.0], [50.0, 0.0], [50.0, 40.0], [10.0, 40.0], [10.0, 0.0], [30.0, 0.0]],
            // it ends on itself
            &[[0.0, 0.0], [50.0, 0.0], [50.0, 20.0], [25.0, 0.0]],
        ] {
            assert!(Lanes::new(&level(), LaneList::Metres(&[lane])).is_ok(), "{lane:?}");
        }
        // another lane may lie on it
        lanes(&[&[[0.0, 0.0], [50.0, 0.0]], &[[50.0, 0.0], [20.0, 0.0]]]);
    }

    #[test]
    fn more_than_there_is_room_for_is_refused() {
        let lane: Lane = &[[0.0, 0.0], [50.0, 0.0]];
        assert!(Lanes::new(&level(), LaneList::Metres(&vec![lane; MOST_LANES])).is_ok());
        assert_eq!(
            Lanes::new(&level(), LaneList::Metres(&vec![lane; MOST_LANES + 1])).unwrap_err().problem,
            Problem::TooManyLanes
        );
        let long: Vec<[f32; 2]> = (0..MOST_SEGMENTS + 2).map(|k| [k as f32 * 2.0, 0.0]).collect();
        let long: &'static [[f32; 2]] = long.leak();
        assert!(Lanes::new(&level(), LaneList::Metres(&[&long[1..]])).is_ok());
        assert_eq!(Lanes::new(&level(), LaneList::Metres(&[long])).unwrap_err().problem, Problem::TooManyPoints);
    }

    #[test]
    fn of_lanes_at_a_place_doppler_tells_which() {
        // along the line of sight, across it, and back
        let all = lanes(&[&[[0.0, 0.0], [100.0, 0.0]], &[[50.0, -40.0], [50.0, 40.0]], &[[100.0, 3.0], [0.0, 3.0]]]);
        let found = |m: &Motion| all.best(m).map(|on| on.segment);
        assert_eq!(found(&newborn(5000, 0, 1000)), Some(0));
        assert_eq!(found(&newborn(5000, 150, -1000)), Some(2));
        // seen before: it shows nothing along the line of sight, and moves to the left
        let across = Motion { across: 900, across_variance: 200 * 200, ..newborn(5000, 100, 20) };
        assert_eq!(found(&across), Some(1));
        assert_eq!(found(&Motion { across: -900, ..across }), None, "against the traffic of all");
        assert_eq!(found(&newborn(5000, 900, 1000)), None, "beside all of them");
        assert_eq!(found(&newborn(10_500, 0, 1000)), None, "beyond its end");
    }

    #[test]
    fn a_lane_from_one_end_of_the_view_to_the_other_has_no_end_in_between() {
        let all = lanes(&[&[[-399.0, 0.0], [399.0, 0.0]], &[[-399.0, -399.0], [399.0, 399.0]]]);
        let at = |segment, x, y| all.along(segment, (x, y)).map(|on| on.left_cm);
        for x in [-39_800, 0, 6_000, 7_000, 20_000, 39_800] {
            assert_eq!(at(0, x, 150), Some(150), "{x}");
            assert!(at(1, x, x).is_some_and(|left| left.abs() <= 3), "{x}: {:?}", at(1, x, x));
        }
        assert_eq!((at(0, 40_200, 0), at(0, -40_200, 0)), (None, None));
        let across: Lane = &[[-399.0, 0.0], [399.0, 0.0], [399.0, 20.0], [200.0, 20.0], [200.0, -20.0]];
        let e = Lanes::new(&level(), LaneList::Metres(&[across])).unwrap_err();
        assert_eq!(e.problem, Problem::CrossesItself, "200 m ahead");
    }

    #[test]
    fn what_stands_does_not_turn_round() {
        let all = lanes(&[&[[0.0, 0.0], [100.0, 0.0]], &[[100.0, 2.0], [0.0, 2.0]]]);
        let standing = |heading| Motion { heading: Some(heading), across_variance: 100, ..newborn(5000, 100, 0) };
        let found = |m: &Motion| all.best(m).map(|on| on.heading);
        assert_eq!(found(&standing(Direction::AHEAD)), Some(Direction::AHEAD));
        assert_eq!(found(&standing(Direction::AHEAD.reversed())), Some(Direction::AHEAD.reversed()));
    }

    #[test]
    fn a_place_is_found_again_along_its_lane_and_lost_beyond_its_end() {
        let all = lanes(&[&[[0.0, 8.0], [9.0, 8.0]], &[[0.0, 0.0], [40.0, 0.0], [60.0, 20.0], [60.0, 80.0]]]);
        let at = |x, y| all.along(1, (x, y)).map(|on| (on.segment, on.left_cm));
        assert_eq!(at(1000, 100), Some((1, 100)));
        assert_eq!(at(6100, 5000), Some((3, -100)));
        assert_eq!(all.along(3, (1000, -100)).map(|on| (on.segment, on.left_cm)), Some((1, -100)), "backwards too");
        assert_eq!(at(6000, 8100).map(|(k, _)| k), Some(3), "a metre behind its end");
        assert_eq!((at(6000, 8400), at(1000, 600)), (None, None));
        assert_eq!(all.along(200, (0, 0)), None, "no such segment");
    }
}
