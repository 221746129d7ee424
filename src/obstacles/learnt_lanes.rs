//! Lanes that a unit learns while it runs: which way vehicles were seen to drive at a place.
//!
//! At a crossing nobody may have said where [lanes](super::lanes) are. But the next vehicle goes where the last ones
//! went: of a newborn, and of what stands or crawls, that tells the heading which Doppler alone does not.
//!
//! # Model
//! The road is cut into cells of 2.56 m. Once a cell, a vehicle whose heading is known for certain leaves it there,
//! with how far beside the cell's middle it drove; each cell keeps the running means of up to four directions. A motion
//! fits the directions around it as it fits given lanes, and the mean of what lies within 1.2 m across, one cell along
//! and 20 degrees of the best is its lane, once enough vehicles have driven there. Vehicles teach the heading that is
//! measured of them, not the one they were given here, so that the lanes do not confirm themselves.
//!
//! # Limits
//! 164 m ahead, behind and to either side; 2688 courses on the reference grid, 784 on the small one. Cells share sets
//! of four courses; one that is full gives up the course that fewest drove. What is learnt stays over gaps and steps of
//! the clock, changes by a twelfth with each vehicle, and is lost with the power. Mirror images that pass for vehicles
//! teach, too. None without the feature `learning`.
//!
//! # Cost
//! 16.1 kB on the reference grid, 4.7 kB on the small one. Nine cells are looked at for every obstacle that follows a
//! learnt lane in every frame, and for the others in one of four.
//!
//! # What was tried
//! On thirteen of the training crossings of `tests/recordings/tuning.toml`, after the unit had run over twice 90 s of
//! other days there; cells FVR / FIR in percent from the 30th second on, vehicles from `geometry-slice`. Synthetic
//! data. Then what the same rules did to training queues and motorways, within the recording alone.
//!
//! | rule | crossings | vehicles | queues | motorways |
//! |---|---|---|---|---|
//! | nothing learnt | 16.9 / 11.2 | +3.9 / +8.3 | 18.1 / 6.6 | 12.6 / 14.2 |
//! | boxes as on given lanes: moved to the middle, a quarter of the margin | 16.2 / 10.1 | | 17.0 / 7.8 | 11.1 / 15.2 |
//! | the margin of what goes its own way, none along the road | 14.1 / 11.5 | +2.7 / +8.0 | 19.1 / 6.8 | 13.9 / 12.4 |
//! | headings known to ten standard deviations teach, an eighth of the margin along the road | 14.9 / 11.0 | | 17.9 / 7.4 | 12.4 / 13.8 |
//! | and not moved to the middle; three vehicles make a lane | 14.7 / 11.1 | +1.9 / +8.1 | 17.1 / 7.5 | 12.1 / 14.3 |
//! | two vehicles; four | 14.4 / 10.9; 15.3 / 10.8 | +1.3 / +8.3; +2.1 / +8.3 | | |
//! | three, and one course is what lies within 30 degrees, not in one eighth of all directions: kept | 14.5 / 11.2 | +2.0 / +8.5 | 17.9 / 7.5 | 12.1 / 14.3 |
//! | that after 90 s of one other day; within the recording alone | 15.2 / 11.0; 16.7 / 10.9 | +1.4 / +8.3; +5.4 / +7.5 | | |
//!
//! Two vehicles may be two parts of one that was not yet joined, so that three are asked for. On the fourteenth
//! crossing a bus and a lorry that stand side by side 12 m from the radar are the greater part of what is hidden; it
//! called 15 to 45 % of that visible, more often with lanes. On six crossings that are reported 21.3 / 12.1 became 17.7
//! / 11.6, and vehicles +6.7 / +8.3 became +4.9 / +7.2 (`viewshed experiment --scene crossing --learn-lanes`).

use core::num::NonZeroU16;

use heapless::Vec;

use super::lanes::{MOST_MISFIT, Motion};
use crate::fixed::angle::Angle;
use crate::fixed::trig::{self, Direction};

/// Whether there is room for any.
pub const ROOM: bool = cfg!(feature = "learning");
/// Vehicles that make a lane, where a unit is told to learn and not told of how many.
pub(super) const VEHICLES: f32 = 3.0;

/// Side of a cell, 2^8 cm.
const CELL_SHIFT: u32 = 8;
/// Cells along either axis, 2^7: the sensor is in the middle.
const CELLS_SHIFT: u32 = 7;
const CELLS: i32 = 1 << CELLS_SHIFT;
/// Sets of courses for each obstacle there is room for, and courses of a set.
const SETS_EACH: usize = if ROOM { 7 } else { 0 };
const COURSES: usize = 4;
/// Vehicles over which a course is averaged.
const MEMORY: u8 = 12;
/// Least cosine of what drives one course, 2^-14: 30 degrees.
const ONE_COURSE: i32 = 14_189;
/// Least cosine of what goes the same way, 2^-14: 20 degrees.
const PARALLEL: i32 = 15_396;
/// Farthest that places of one lane lie beside each other, centimetres.
const ONE_LANE_CM: i32 = 120;
/// Cells of its way that are looked at around a place: each vehicle counts in all of them.
const CELLS_AROUND: i32 = 3;

/// What drove through a cell in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Course {
    cell: Option<Cell>,
    /// Mean heading.
    heading: Angle,
    /// Vehicles, saturating.
    vehicles: u8,
    /// How far to the left of the cell's middle they drove, 2 cm.
    left: i8,
}

/// Lanes as they were driven, for a list of `N` obstacles.
#[derive(Debug, Clone)]
pub struct LearntLanes<const N: usize> {
    sets: [[[Course; COURSES]; SETS_EACH]; N],
}

/// Number of a cell, one more than that: 1 to 2^14.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cell(NonZeroU16);

impl Course {
    const NONE: Self = Self { cell: None, vehicles: 0, heading: Angle::ZERO, left: 0 };

    /// How far a place lies to the left of it, centimetres.
    fn left_of(&self, heading: Direction, cell: Cell, place: (i32, i32)) -> i32 {
        cell.left_cm(heading, place) - i32::from(self.left) * 2
    }

    /// Takes one more vehicle.
    #[allow(clippy::cast_possible_truncation)] // means lie between what they are of
    fn add(&mut self, angle: Angle, left: i8) {
        let seen = i32::from(self.vehicles.min(MEMORY - 1)) + 1;
        self.vehicles = self.vehicles.saturating_add(1);
        let turn = i32::from(angle.raw().wrapping_sub(self.heading.raw()));
        self.heading = Angle::from_raw(self.heading.raw().wrapping_add((turn / seen) as i16));
        self.left += ((i32::from(left) - i32::from(self.left)) / seen) as i8;
    }
}

impl Cell {
    /// The cell of a place; `None` beyond all.
    fn at((x, y): (i32, i32)) -> Option<Self> {
        Self::numbered((x >> CELL_SHIFT) + CELLS / 2, (y >> CELL_SHIFT) + CELLS / 2)
    }

    fn numbered(x: i32, y: i32) -> Option<Self> {
        let exists = ROOM && (0..CELLS).contains(&x) && (0..CELLS).contains(&y);
        let number = u16::try_from((x << CELLS_SHIFT) + y + 1).ok().filter(|_| exists)?;
        NonZeroU16::new(number).map(Self)
    }

    /// Along x and along y.
    fn numbers(self) -> [i32; 2] {
        let number = i32::from(self.0.get()) - 1;
        [number >> CELLS_SHIFT, number & (CELLS - 1)]
    }

    /// It and those around it.
    fn and_around(self) -> impl Iterator<Item = Self> {
        let [x, y] = self.numbers();
        (x - 1..=x + 1).flat_map(move |x| (y - 1..=y + 1).filter_map(move |y| Self::numbered(x, y)))
    }

    /// How far a place lies to the left of a line in this direction through its middle, centimetres.
    fn left_cm(self, heading: Direction, (x, y): (i32, i32)) -> i32 {
        let [middle_x, middle_y] = self.numbers().map(|v| ((v - CELLS / 2) << CELL_SHIFT) + (1 << (CELL_SHIFT - 1)));
        heading.across(x - middle_x, y - middle_y)
    }
}

impl<const N: usize> Default for LearntLanes<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> LearntLanes<N> {
    /// Nothing was seen yet.
    pub const fn new() -> Self {
        Self { sets: [[[Course::NONE; COURSES]; SETS_EACH]; N] }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.sets.as_flattened_mut().as_flattened_mut().fill(Course::NONE);
    }

    /// Where a cell's courses are, among those of others.
    fn set(&self, cell: Cell) -> Option<usize> {
        usize::from(cell.0.get()).checked_rem(self.sets.as_flattened().len())
    }

    /// Takes that a vehicle drove here, unless it was seen in this cell last; in which cell.
    #[allow(clippy::cast_possible_truncation)] // a place is within 2 m of its cell's middle
    pub(super) fn learn(&mut self, place: (i32, i32), heading: Direction, last: Option<Cell>) -> Option<Cell> {
        let cell = Cell::at(place)?;
        if last == Some(cell) {
            return last;
        }
        let angle = trig::bearing(i32::from(heading.x), i32::from(heading.y));
        let left = (cell.left_cm(heading, place) / 2) as i8;
        let number = self.set(cell)?;
        let set = self.sets.as_flattened_mut().get_mut(number)?;
        let same = |c: &&mut Course| c.cell == Some(cell) && trig::direction(c.heading).cosine(heading) > ONE_COURSE;
        if let Some(course) = set.iter_mut().find(same) {
            course.add(angle, left);
        } else if let Some(least) = set.iter_mut().min_by_key(|course| course.vehicles) {
            if least.vehicles <= 1 {
                *least = Course { cell: Some(cell), vehicles: 1, heading: angle, left };
            } else {
                least.vehicles -= 1;
            }
        }
        Some(cell)
    }

    /// Direction of the lane that a motion fits best, of those that at least so many vehicles drove on.
    #[allow(clippy::cast_possible_truncation)] // a mean of turns of less than a right angle
    pub(super) fn heading(&self, motion: &Motion, vehicles: i32) -> Option<Direction> {
        let here = Cell::at(motion.place)?;
        let mut around: Vec<(Angle, Direction, i32, i32), { 9 * COURSES }> = Vec::new();
        let mut best = None;
        let mut least = MOST_MISFIT;
        for cell in here.and_around() {
            let Some(set) = self.set(cell).and_then(|number| self.sets.as_flattened().get(number)) else { continue };
            for course in set.iter().filter(|course| course.cell == Some(cell)) {
                let heading = trig::direction(course.heading);
                let left = course.left_of(heading, cell, motion.place);
                let _ = around.push((course.heading, heading, left, i32::from(course.vehicles)));
                let Some(misfit) = motion.misfit(heading, left) else { continue };
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
    fn drive(lanes: &mut LearntLanes<96>, vehicles: usize, from: (i32, i32), to: (i32, i32)) {
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
            let mut lanes = LearntLanes::<96>::new();
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
        assert_eq!(LearntLanes::<96>::new().heading(&newborn(4500, -1500, -800), 0), None);
    }

    #[test]
    fn each_of_two_ways_through_a_place_is_kept_and_doppler_tells_which() {
        let mut lanes = LearntLanes::<96>::new();
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
        let mut lanes = LearntLanes::<96>::new();
        let ahead = Direction::AHEAD;
        let cell = lanes.learn((5000, 100), ahead, None);
        (0..10).for_each(|k| assert_eq!(lanes.learn((5000 + k, 100), ahead, cell), cell));
        assert_eq!(lanes.sets.as_flattened().as_flattened().iter().map(|c| c.vehicles).sum::<u8>(), 1);
        // 15 degrees to the left from now on: within one eighth
        let turned = Direction::of(9659, 2588);
        (0..60).for_each(|_| assert!(lanes.learn((5000, 100), turned, None).is_some()));
        let course = lanes.sets.as_flattened().as_flattened().iter().find(|c| c.vehicles > 0).unwrap();
        assert!((course.heading.radians().to_degrees() - 15.0).abs() < 0.5, "{course:?}");
        lanes.clear();
        assert!(lanes.sets.as_flattened().as_flattened().iter().all(|c| *c == Course::NONE));
    }

    #[test]
    fn cells_that_share_a_set_are_told_apart_and_the_least_driven_goes() {
        let mut lanes = LearntLanes::<96>::new();
        let set = |lanes: &LearntLanes<96>, (x, y)| lanes.set(Cell::numbered(x, y).unwrap()).unwrap();
        let sharing: Vec<(i32, i32), 16> = (0..CELLS)
            .flat_map(|x| (0..CELLS).map(move |y| (x, y)))
            .filter(|cell| set(&lanes, *cell) == set(&lanes, (80, 70)))
            .take(5)
            .collect();
        let at = |(x, y): (i32, i32)| ((x - CELLS / 2) * 256 + 128, (y - CELLS / 2) * 256 + 128);
        let mut drive = |cell, vehicles| {
            (0..vehicles).for_each(|_| {
                let _ = lanes.learn(at(cell), Direction::AHEAD, None);
            })
        };
        sharing[..4].iter().for_each(|cell| drive(*cell, 9));
        // a fifth has to be driven on as often as one of them before it finds room
        drive(sharing[4], 8);
        let seen = |lanes: &LearntLanes<96>| {
            let of = |cell: &(i32, i32)| {
                let own = Cell::numbered(cell.0, cell.1);
                let courses =
                    lanes.sets.as_flattened().as_flattened().iter().filter(move |c| c.cell == own && own.is_some());
                courses.map(|c| c.vehicles).sum::<u8>()
            };
            sharing.iter().map(of).collect::<Vec<u8, 16>>()
        };
        assert_eq!((seen(&lanes)[4], seen(&lanes).iter().sum::<u8>()), (0, 28));
        (0..30).for_each(|_| _ = lanes.learn(at(sharing[4]), Direction::AHEAD, None));
        assert!(seen(&lanes)[4] > 0 && seen(&lanes).iter().filter(|n| **n > 0).count() == 4, "{:?}", seen(&lanes));
    }

    #[test]
    fn beyond_all_cells_nothing_is_learnt() {
        let mut lanes = LearntLanes::<96>::new();
        for place in [(16_400, 0), (0, -16_500), (i32::MAX, i32::MIN)] {
            assert_eq!(lanes.learn(place, Direction::AHEAD, None), None);
            assert_eq!(lanes.heading(&newborn(place.0 / 2, place.1 / 2, 100), 0), None);
        }
        assert!(lanes.learn((16_383, -16_384), Direction::AHEAD, None).is_some());
    }

    #[test]
    fn headings_on_either_side_of_straight_back_have_a_mean_between_them() {
        let mut lanes = LearntLanes::<96>::new();
        for y in [-300, 300, -300, 300] {
            let back = Direction::of(-10_000, y);
            (0..20).fold(None, |last, k| lanes.learn((5000 - 60 * k, 0), back, last));
        }
        let heading = degrees(lanes.heading(&newborn(4400, 0, -900), 1)).unwrap();
        assert!(heading.abs() > 179.0, "{heading}");
    }
}
