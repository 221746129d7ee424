//! Lanes that a unit learns while it runs: which way vehicles were seen to drive at a place.
//!
//! At a crossing nobody may have said where [lanes](super::lanes) are. But the next vehicle goes where the last ones went:
//! of a newborn, and of what stands or crawls, that tells the heading which Doppler alone does not.
//!
//! # Model
//! The road is cut into cells of 2.56 m. Once a cell, a vehicle whose heading is known for certain leaves it there, with
//! how far beside the cell's middle it drove; each cell keeps the running means of up to four directions. A motion fits
//! the directions around it as it fits given lanes, and the mean of what lies within 1.2 m across, one cell along and 20
//! degrees of the best is its lane, once enough vehicles have driven there. Vehicles teach the heading that is measured
//! of them, not the one they were given here, so that the lanes do not confirm themselves.
//!
//! # Limits
//! 164 m ahead, behind and to either side. Cells 82 m apart share a set of four directions; one that is full
//! gives up the direction that fewest drove on. What is learnt stays over gaps and steps of the clock, changes by a twelfth
//! with each vehicle, and is lost with the power. None without the feature `lanes`.
//!
//! # Cost
//! 24.6 kB. Nine cells are looked at for every obstacle that follows a learnt lane in every frame, and for the others in
//! one of four.
//!
//! # What was tried
//! On thirteen of the training crossings of `tests/recordings/tuning.toml`, after the unit had run over twice 90 s of other
//! days there; cells FVR / FIR in percent from the 30th second on, vehicles from `geometry-slice`. Synthetic data. Then
//! what the same rules did to training queues and motorways, within the recording alone.
//!
//! | rule | crossings | vehicles | queues | motorways |
//! |---|---|---|---|---|
//! | nothing learnt | 16.9 / 11.2 | +3.9 / +8.3 | 18.1 / 6.6 | 12.6 / 14.2 |
//! | boxes as on given lanes: moved to the middle, a quarter of the margin | 16.2 / 10.1 | | 17.0 / 7.8 | 11.1 / 15.2 |
//! | the margin of what goes its own way, none along the road | 14.1 / 11.5 | +2.7 / +8.0 | 19.1 / 6.8 | 13.9 / 12.4 |
//! | headings known to ten standard deviations teach, an eighth of the margin along the road | 14.9 / 11.0 | | 17.9 / 7.4 | 12.4 / 13.8 |
//! | and not moved to the middle; three vehicles make a lane: kept | 14.7 / 11.1 | +1.9 / +8.1 | 17.1 / 7.5 | 12.1 / 14.3 |
//! | two vehicles; four | 14.4 / 10.9; 15.3 / 10.8 | +1.3 / +8.3; +2.1 / +8.3 | | |
//! | three, after 90 s; within the recording alone | 15.1 / 11.0; 16.8 / 10.5 | +1.4 / +8.4; +4.9 / +7.5 | | |
//!
//! Two vehicles may be two parts of one that was not yet joined, so that three are asked for.

use heapless::Vec;

use super::lanes::{MOST_MISFIT, Motion, ROOM, UNIT};
use crate::fixed::angle::Angle;
use crate::fixed::trig::{self, Direction};

/// Side of a cell, 2^8 cm.
const CELL_SHIFT: u32 = 8;
/// Cells along either axis: the sensor is in the middle.
const CELLS: i32 = 1 << 7;
/// Of these, as many have sets of their own, 2^.
const OWN_SHIFT: u32 = 5;
const SETS: usize = if ROOM { 1 << (2 * OWN_SHIFT) } else { 0 };
/// Directions of traffic in a set.
const WAYS: usize = 4;
/// Vehicles over which a course is averaged.
const MEMORY: u8 = 12;
/// Fraction bits of a place across.
const FRACTION: u32 = 6;
/// Least cosine of what goes the same way, 2^-14: 20 degrees.
const PARALLEL: i32 = 15_396;
/// Farthest that places of one lane lie beside each other, centimetres.
const ONE_LANE_CM: i32 = 120;
/// Cells of its way that are looked at around a place: each vehicle counts in all of them.
const CELLS_AROUND: i32 = 3;
/// Flag of a tag that is one.
const TAKEN: u8 = 1 << 7;
/// Bits of a tag that say which cell it is.
const CELL_BITS: u8 = TAKEN | 0xF;

/// What drove through a cell in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Course {
    /// Which of the cells that share the set, and in which eighth of all directions; 0: none.
    tag: u8,
    /// Vehicles, saturating.
    vehicles: u8,
    /// Mean heading.
    heading: Angle,
    /// How far to the left of the cell's middle they drove, 2^-6 cm.
    left: i16,
}

/// Lanes as they were driven.
#[derive(Debug, Clone)]
pub struct LearntLanes {
    sets: [[Course; WAYS]; SETS],
}

/// Number of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cell {
    x: u8,
    y: u8,
}

impl Course {
    const NONE: Self = Self { tag: 0, vehicles: 0, heading: Angle::ZERO, left: 0 };

    /// How far a place lies to the left of it, in a cell around this middle, centimetres.
    fn left_of(&self, heading: Direction, middle: (i32, i32), place: (i32, i32)) -> i32 {
        heading.across(place.0 - middle.0, place.1 - middle.1) - (i32::from(self.left) >> FRACTION)
    }
}

impl Cell {
    /// The cell of a place; `None` beyond all.
    fn at((x, y): (i32, i32)) -> Option<Self> {
        Self::numbered((x >> CELL_SHIFT) + CELLS / 2, (y >> CELL_SHIFT) + CELLS / 2)
    }

    fn numbered(x: i32, y: i32) -> Option<Self> {
        let number = |v: i32| u8::try_from(v).ok().filter(|_| v < CELLS);
        number(x).zip(number(y)).map(|(x, y)| Self { x, y })
    }

    /// It and those around it.
    fn and_around(self) -> impl Iterator<Item = Self> {
        let beside = |v: u8| i32::from(v) - 1..=i32::from(v) + 1;
        beside(self.x).flat_map(move |x| beside(self.y).filter_map(move |y| Self::numbered(x, y)))
    }

    fn set(self) -> usize {
        let own = |v: u8| usize::from(v) & ((1 << OWN_SHIFT) - 1);
        (own(self.x) << OWN_SHIFT) | own(self.y)
    }

    /// Tag without a direction.
    fn tag(self) -> u8 {
        TAKEN | (self.x >> OWN_SHIFT) << 2 | self.y >> OWN_SHIFT
    }

    fn middle(self) -> (i32, i32) {
        let at = |v: u8| ((i32::from(v) - CELLS / 2) << CELL_SHIFT) + (1 << (CELL_SHIFT - 1));
        (at(self.x), at(self.y))
    }
}

/// Number of an eighth of all directions, the first about that of x, in its bits of a tag.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // angles wrap
fn eighth(heading: Angle) -> u8 {
    ((heading.raw() as u16).wrapping_add(1 << 12) >> 13 << 4) as u8
}

impl Default for LearntLanes {
    fn default() -> Self {
        Self::new()
    }
}

impl LearntLanes {
    /// Nothing was seen yet.
    pub const fn new() -> Self {
        Self { sets: [[Course::NONE; WAYS]; SETS] }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.sets.as_flattened_mut().fill(Course::NONE);
    }

    /// Takes that a vehicle drove here; in which cell.
    #[allow(clippy::cast_possible_truncation)] // places are within a cell, turns within an eighth
    pub(super) fn learn(&mut self, place: (i32, i32), heading: Direction, last: Option<Cell>) -> Option<Cell> {
        let cell = Cell::at(place).filter(|_| ROOM)?;
        if last == Some(cell) {
            return last;
        }
        let angle = trig::bearing(i32::from(heading.x), i32::from(heading.y));
        let middle = cell.middle();
        let left = heading.across(place.0 - middle.0, place.1 - middle.1) << FRACTION;
        let tag = cell.tag() | eighth(angle);
        let set = self.sets.get_mut(cell.set())?;
        if let Some(course) = set.iter_mut().find(|course| course.tag == tag) {
            let seen = i32::from(course.vehicles.min(MEMORY - 1)) + 1;
            course.vehicles = course.vehicles.saturating_add(1);
            let turn = i32::from(angle.raw().wrapping_sub(course.heading.raw()));
            course.heading = Angle::from_raw(course.heading.raw().wrapping_add((turn / seen) as i16));
            course.left = (i32::from(course.left) + (left - i32::from(course.left)) / seen) as i16;
        } else if let Some(least) = set.iter_mut().min_by_key(|course| course.vehicles) {
            if least.vehicles <= 1 {
                *least = Course { tag, vehicles: 1, heading: angle, left: left as i16 };
            } else {
                least.vehicles -= 1;
            }
        }
        Some(cell)
    }

    /// Direction of the lane that a motion fits best, of those that at least so many vehicles drove on.
    #[allow(clippy::cast_possible_truncation)] // a mean of turns within an eighth
    pub(super) fn heading(&self, motion: &Motion, vehicles: i32) -> Option<Direction> {
        let here = Cell::at(motion.place).filter(|_| ROOM)?;
        let mut around: Vec<(Angle, Direction, i32, i32), { 9 * WAYS }> = Vec::new();
        let mut best = None;
        let mut least = MOST_MISFIT;
        for cell in here.and_around() {
            let Some(set) = self.sets.get(cell.set()) else { continue };
            for course in set.iter().filter(|course| course.tag & CELL_BITS == cell.tag()) {
                let heading = trig::direction(course.heading);
                let left = course.left_of(heading, cell.middle(), motion.place);
                let _ = around.push((course.heading, heading, left, i32::from(course.vehicles)));
                let Some(by_motion) = motion.misfit(heading) else { continue };
                let misfit = by_motion + left * left / (motion.place_variance / UNIT).max(1);
                if misfit < least {
                    least = misfit;
                    best = Some((course.heading, heading, left));
                }
            }
        }
        let (angle, heading, left) = best?;
        let (mut seen, mut turn) = (0, 0);
        for (a, h, l, n) in around {
            if h.cosine(heading) > PARALLEL && (l - left).abs() < ONE_LANE_CM {
                seen += n;
                turn += i32::from(a.raw().wrapping_sub(angle.raw())) * n;
            }
        }
        let mean = turn.checked_div(seen)? as i16;
        (seen >= CELLS_AROUND * vehicles).then(|| trig::direction(Angle::from_raw(angle.raw().wrapping_add(mean))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Learns from so many vehicles that go from one place to another, centimetres, a frame every 60 cm.
    fn drive(lanes: &mut LearntLanes, vehicles: usize, from: (i32, i32), to: (i32, i32)) {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let steps = dx.abs().max(dy.abs()) / 60;
        for _ in 0..vehicles {
            let mut last = None;
            for k in 0..=steps {
                let place = (from.0 + dx * k / steps, from.1 + dy * k / steps);
                last = lanes.learn(place, Direction::of(dx, dy), last);
            }
        }
    }

    /// Something seen for the first time, which shows a radial speed.
    fn newborn(x: i32, y: i32, radial: i32) -> Motion {
        let place_variance = 120 * 120;
        let sight = Direction::of(x, y);
        let across_variance = 1000 * 1000;
        Motion { place: (x, y), place_variance, sight, radial, across: 0, across_variance, heading: None }
    }

    fn degrees(heading: Option<Direction>) -> Option<f64> {
        heading.map(|h| f64::from(h.y).atan2(f64::from(h.x)).to_degrees())
    }

    #[test]
    fn where_three_have_driven_the_fourth_goes_the_same_way_and_not_back() {
        let at = |vehicles, x, y, radial| {
            let mut lanes = LearntLanes::new();
            drive(&mut lanes, vehicles, (5000, -3000), (3000, 3000));
            degrees(lanes.heading(&newborn(x, y, radial), 3))
        };
        // it comes nearer on the first half of its way
        let heading = at(3, 4500, -1500, -800).unwrap();
        assert!((heading - 108.4).abs() < 1.5, "{heading}");
        assert!(at(3, 4600, -1450, -800).is_some(), "a metre beside it");
        assert_eq!(at(3, 4500, -1500, 800), None, "against the traffic");
        assert_eq!(at(2, 4500, -1500, -800), None, "two make no lane");
        assert_eq!(at(3, 5200, -1500, -800), None, "seven metres beside it");
        assert_eq!(LearntLanes::new().heading(&newborn(4500, -1500, -800), 0), None);
    }

    #[test]
    fn each_of_two_ways_through_a_place_is_kept_and_doppler_tells_which() {
        let mut lanes = LearntLanes::new();
        drive(&mut lanes, 4, (2000, 0), (8000, 0));
        drive(&mut lanes, 4, (5000, -3000), (5000, 3000));
        let along = degrees(lanes.heading(&newborn(5000, 10, 1000), 3)).unwrap();
        assert!(along.abs() < 1.0, "{along}");
        let across = Motion { across: 900, across_variance: 200 * 200, ..newborn(5000, 10, 20) };
        let across = degrees(lanes.heading(&across, 3)).unwrap();
        assert!((across - 90.0).abs() < 1.0, "{across}");
    }

    #[test]
    fn a_vehicle_counts_once_a_cell_and_a_changed_lane_is_learnt_anew() {
        let mut lanes = LearntLanes::new();
        let ahead = Direction::AHEAD;
        let cell = lanes.learn((5000, 100), ahead, None);
        (0..10).for_each(|k| assert_eq!(lanes.learn((5000 + k, 100), ahead, cell), cell));
        assert_eq!(lanes.sets.as_flattened().iter().map(|c| c.vehicles).sum::<u8>(), 1);
        // 15 degrees to the left from now on: within one eighth
        let turned = Direction::of(9659, 2588);
        (0..60).for_each(|_| assert!(lanes.learn((5000, 100), turned, None).is_some()));
        let course = lanes.sets.as_flattened().iter().find(|c| c.vehicles > 0).unwrap();
        assert!((course.heading.radians().to_degrees() - 15.0).abs() < 0.5, "{course:?}");
        lanes.clear();
        assert!(lanes.sets.as_flattened().iter().all(|c| *c == Course::NONE));
    }

    #[test]
    fn cells_that_share_a_set_are_told_apart_and_the_least_driven_goes() {
        let mut lanes = LearntLanes::new();
        let far = 32 << CELL_SHIFT;
        for (x, y) in [(4000, 700), (4000 + far, 700), (4000, 700 - far), (4000 - far, 700 - far)] {
            assert_eq!(Cell::at((x, y)).unwrap().set(), Cell::at((4000, 700)).unwrap().set());
            (0..9).for_each(|_| drive(&mut lanes, 1, (x - 500, y), (x + 500, y)));
        }
        assert!(lanes.heading(&newborn(4000, 700, 500), 3).is_some());
        // a fifth has to be driven on as often as one of them before it finds room
        let fifth = |lanes: &LearntLanes| lanes.heading(&newborn(4000 + far, 700 + far, 500), 1).is_some();
        drive(&mut lanes, 3, (3500 + far, 700 + far), (4500 + far, 700 + far));
        assert!(!fifth(&lanes));
        drive(&mut lanes, 20, (3500 + far, 700 + far), (4500 + far, 700 + far));
        assert!(fifth(&lanes));
    }

    #[test]
    fn beyond_all_cells_nothing_is_learnt() {
        let mut lanes = LearntLanes::new();
        for place in [(16_400, 0), (0, -16_500), (i32::MAX, i32::MIN)] {
            assert_eq!(lanes.learn(place, Direction::AHEAD, None), None);
            assert_eq!(lanes.heading(&newborn(place.0 / 2, place.1 / 2, 100), 0), None);
        }
        assert!(lanes.learn((16_383, -16_384), Direction::AHEAD, None).is_some());
    }

    #[test]
    fn headings_on_either_side_of_straight_back_have_a_mean_between_them() {
        let mut lanes = LearntLanes::new();
        for y in [-300, 300, -300, 300] {
            let back = Direction::of(-10_000, y);
            (0..20).fold(None, |last, k| lanes.learn((5000 - 60 * k, 0), back, last));
        }
        let heading = degrees(lanes.heading(&newborn(4400, 0, -900), 1)).unwrap();
        assert!(heading.abs() > 179.0, "{heading}");
    }
}
