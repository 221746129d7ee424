//! Lanes that a unit learns while it runs: which way vehicles were seen to drive at a place.
//!
//! At a crossing nobody may have said where [lanes](super::lanes) are. But the next vehicle goes where the last ones
//! went: of a newborn, and of what stands or crawls, that tells the heading which Doppler alone does not.
//!
//! # Model
//! The road is cut into cells of 2.56 m. Every cell's length of its way, a vehicle whose heading is known for certain leaves
//! that in the cell it is in, with how far beside the cell's middle it drove: a course, a running mean of all that drove within
//! 30 degrees. A motion fits the courses around it as it fits given lanes. The best of those is its lane that, with what lies
//! within 1.2 m across, one cell along and 20 degrees of it, counts as many vehicles as make one; its direction is the mean of
//! these. So one vehicle that strays across a lane changes nothing. Vehicles teach the heading that is measured of them, not
//! the one they were given here, so that the lanes do not confirm themselves; or the road's axis, where what is measured agrees.
//!
//! What stands, and what shows a lorry's length, keeps the heading it drove with: a lane at the same place turns it by no more
//! than 20 degrees. A vehicle that crosses the road, and whose heading is known, takes no lane.
//!
//! # Limits
//! 164 m ahead, to either side and behind, of which 20 m are followed; 2688 courses on the reference grid, 784 on the small one.
//! About 24 cells share a set of four courses; a full set gives up the course that fewest drove. A course follows its vehicles
//! by a twelfth each. When one has counted 255, all forget half: so a lane where nobody drives any more is none after some
//! hundred vehicles elsewhere. What is learnt stays over gaps and steps of the clock, and is lost with the power. Mirror images
//! that pass for vehicles teach, too. None without the feature `learning`.
//!
//! A vehicle that is nearer than three lengths of its outline teaches nothing: its reflections move along its side, so its
//! heading is measured wrongly.
//!
//! # Cost
//! 16.1 kB on the reference grid, 4.7 kB on the small one. Nine cells are looked at for every obstacle that follows a
//! learnt lane in every frame, and for the others in one of four.

use core::num::NonZeroU16;

use heapless::Vec;

use super::Obstacles;
use super::lanes::{MOST_MISFIT, Motion};
use super::parameters::TrackingParameters;
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
pub(super) const PARALLEL: i32 = 15_396;
/// Farthest that places of one lane lie beside each other, centimetres.
const ONE_LANE_CM: i32 = 120;
/// A vehicle that drives straight through the nine cells around a place is counted so many times in them.
const COUNTS_EACH: i32 = 3;

/// Way between two places that a vehicle teaches, centimetres: a cell's side where it drives along the cells, and as much
/// more as its way through them is longer where it drives across them.
#[allow(clippy::cast_possible_truncation)] // at most the diagonal of a cell
pub(super) fn spacing_cm(heading: Direction) -> i16 {
    let (x, y) = (heading.x.unsigned_abs(), heading.y.unsigned_abs());
    (((u32::from(x) + u32::from(y)) << CELL_SHIFT) >> 14) as i16
}

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
        let share = |off: i32| (off + off.signum() * seen / 2) / seen;
        let turn = i32::from(angle.raw().wrapping_sub(self.heading.raw()));
        self.heading = Angle::from_raw(self.heading.raw().wrapping_add(share(turn) as i16));
        self.left += share(i32::from(left) - i32::from(self.left)) as i8;
    }

    /// Forgets half of the vehicles it has seen; one that has seen one is no more.
    fn forget_half(&mut self) {
        self.vehicles /= 2;
        if self.vehicles == 0 {
            *self = Self::NONE;
        }
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

    fn middle(self) -> [i32; 2] {
        self.numbers().map(|v| ((v - CELLS / 2) << CELL_SHIFT) + (1 << (CELL_SHIFT - 1)))
    }

    /// How far a place lies to the left of a line in this direction through its middle, centimetres.
    fn left_cm(self, heading: Direction, (x, y): (i32, i32)) -> i32 {
        let [middle_x, middle_y] = self.middle();
        heading.across(x - middle_x, y - middle_y)
    }

    /// The place so far to the left of its middle, centimetres.
    fn beside(self, heading: Direction, left_cm: i32) -> (i32, i32) {
        let ([x, y], left) = (self.middle(), heading.left());
        (x + ((i32::from(left.x) * left_cm) >> 14), y + ((i32::from(left.y) * left_cm) >> 14))
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

    /// Takes that a vehicle drove here. When a course has seen all that it can count, all forget half of what they saw: so
    /// where nobody drives any more there is no lane, after some hundred vehicles elsewhere.
    #[allow(clippy::cast_possible_truncation)] // a place is within 2 m of its cell's middle
    pub(super) fn learn(&mut self, place: (i32, i32), heading: Direction) {
        let Some(cell) = Cell::at(place) else { return };
        let angle = trig::bearing(i32::from(heading.x), i32::from(heading.y));
        let left = (cell.left_cm(heading, place) / 2) as i8;
        let Some(set) = self.set(cell).and_then(|number| self.sets.as_flattened_mut().get_mut(number)) else { return };
        let same = |c: &&mut Course| c.cell == Some(cell) && trig::direction(c.heading).cosine(heading) > ONE_COURSE;
        if let Some(course) = set.iter_mut().find(same) {
            course.add(angle, left);
            if course.vehicles == u8::MAX {
                self.sets.as_flattened_mut().as_flattened_mut().iter_mut().for_each(Course::forget_half);
            }
        } else if let Some(least) = set.iter_mut().min_by_key(|course| course.vehicles) {
            if least.vehicles <= 1 {
                *least = Course { cell: Some(cell), vehicles: 1, heading: angle, left };
            } else {
                least.vehicles -= 1;
            }
        }
    }

    /// Direction of the lane that a motion fits best, of those that at least so many vehicles drove on.
    pub(super) fn heading(&self, motion: &Motion, vehicles: i32) -> Option<Direction> {
        let around = self.around(Cell::at(motion.place)?, motion.place);
        let mut best = None;
        let mut least = MOST_MISFIT;
        for course in &around {
            let Some(misfit) = motion.misfit(course.direction, course.left_cm).filter(|misfit| *misfit < least) else {
                continue;
            };
            // one that strayed across a lane does not take it away
            if let Some(heading) = agreed(course, &around, vehicles) {
                least = misfit;
                best = Some(heading);
            }
        }
        best
    }

    /// Where lanes are known, and which way each goes there: a place for each cell and course that at least so many
    /// vehicles drove, centimetres in the levelled frame.
    pub fn places(&self, vehicles: i32) -> impl Iterator<Item = ((i32, i32), Direction)> {
        self.sets.as_flattened().as_flattened().iter().filter_map(move |course| {
            let cell = course.cell?;
            let place = cell.beside(trig::direction(course.heading), i32::from(course.left) * 2);
            let around = self.around(cell, place);
            let own = around.iter().find(|near| near.angle == course.heading && near.left_cm.abs() <= 2)?;
            Some((place, agreed(own, &around, vehicles)?))
        })
    }

    /// Courses of a cell and those around it, as seen from a place in it.
    fn around(&self, cell: Cell, place: (i32, i32)) -> Vec<Near, { 9 * COURSES }> {
        let mut around = Vec::new();
        for cell in cell.and_around() {
            let Some(set) = self.set(cell).and_then(|number| self.sets.as_flattened().get(number)) else { continue };
            for course in set.iter().filter(|course| course.cell == Some(cell)) {
                let direction = trig::direction(course.heading);
                let left_cm = course.left_of(direction, cell, place);
                let vehicles = i32::from(course.vehicles);
                let _ = around.push(Near { angle: course.heading, direction, left_cm, vehicles });
            }
        }
        around
    }
}

impl<const N: usize> Obstacles<N> {
    /// Where lanes were learnt, a place for each cell and course, and which way they go there; centimetres in the
    /// levelled frame. None where none are to be learnt.
    pub fn learnt_lanes(&self, t: &TrackingParameters) -> impl Iterator<Item = ((i32, i32), Direction)> {
        self.lanes.places(t.lane_vehicles)
    }
}

/// A course near a place, which lies so far to the left of it.
struct Near {
    angle: Angle,
    direction: Direction,
    left_cm: i32,
    vehicles: i32,
}

/// Mean direction of a course and of those around it that are of its lane, if at least so many vehicles drove there.
#[allow(clippy::cast_possible_truncation)] // a mean of turns of less than a right angle
fn agreed(best: &Near, around: &[Near], vehicles: i32) -> Option<Direction> {
    let (mut seen, mut turn) = (0, 0);
    for near in around {
        if near.direction.cosine(best.direction) > PARALLEL && (near.left_cm - best.left_cm).abs() < ONE_LANE_CM {
            seen += near.vehicles;
            turn += i32::from(near.angle.raw().wrapping_sub(best.angle.raw())) * near.vehicles;
        }
    }
    let mean = turn.checked_div(seen)? as i16;
    (seen >= COUNTS_EACH * vehicles).then(|| trig::direction(Angle::from_raw(best.angle.raw().wrapping_add(mean))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Learns from so many vehicles that go from one place to another, centimetres.
    fn drive<const N: usize>(lanes: &mut LearntLanes<N>, vehicles: usize, from: (i32, i32), to: (i32, i32)) {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let heading = Direction::of(dx, dy);
        let (length, spacing) = (crate::fixed::math::length(dx, dy), i32::from(spacing_cm(heading)));
        for vehicle in 0..vehicles as i32 {
            // each begins somewhere else on its way
            for k in 0..length / spacing {
                let way = k * spacing + vehicle * 71 % spacing;
                lanes.learn((from.0 + dx * way / length, from.1 + dy * way / length), heading);
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
    fn places_lie_where_vehicles_drove_and_point_where_they_went() {
        let mut lanes = LearntLanes::<96>::new();
        drive(&mut lanes, 4, (5000, -3000), (3000, 3000));
        drive(&mut lanes, 2, (9000, 3000), (9000, -3000));
        let known: std::vec::Vec<_> = lanes.places(3).collect();
        // every cell of 63 m of way
        assert!((18..=40).contains(&known.len()), "{known:?}");
        let lane = Direction::of(-2000, 6000);
        for ((x, y), heading) in known {
            assert!(lane.across(x - 5000, y + 3000).abs() < 60, "({x}, {y}) beside the lane");
            assert!(degrees(Some(heading)).is_some_and(|h| (h - 108.4).abs() < 1.5), "({x}, {y}): {heading:?}");
        }
        assert!(lanes.places(2).any(|((x, y), heading)| x > 8900 && y.abs() < 3000 && heading.y < -16_000));
    }

    #[test]
    fn two_vehicles_make_no_lane_whichever_way_they_go_and_four_do() {
        for degrees in [0, 15, 30, 45, 60, 90, 135, 200] {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let at = |metres: f64| (5000 + (metres * 100.0 * cos) as i32, (metres * 100.0 * sin) as i32);
            let known = |vehicles| {
                let mut lanes = LearntLanes::<96>::new();
                drive(&mut lanes, vehicles, at(-30.0), at(30.0));
                // what comes nearer or goes away as it would on this way
                let newborn = |m: f64| {
                    let sight = Direction::of(at(m).0, at(m).1);
                    newborn(at(m).0, at(m).1, sight.along((900.0 * cos) as i32, (900.0 * sin) as i32))
                };
                (-20..20).filter(|m| lanes.heading(&newborn(f64::from(*m)), 3).is_some()).count()
            };
            assert!(known(2) <= 4 && known(4) >= 36, "{degrees} degrees: {} and {} of 40 places", known(2), known(4));
        }
    }

    #[test]
    fn one_that_strays_across_a_lane_does_not_take_it_away() {
        let mut lanes = LearntLanes::<96>::new();
        drive(&mut lanes, 20, (3000, 0), (9000, 0));
        for degrees in [20.0_f64, 45.0, 90.0] {
            let mut lanes = lanes.clone();
            let (sin, cos) = degrees.to_radians().sin_cos();
            let at = |m: f64| (6000 + (m * cos) as i32, (m * sin) as i32);
            drive(&mut lanes, 1, at(-1500.0), at(1500.0));
            for x in (5500..6500).step_by(50) {
                let heading = self::degrees(lanes.heading(&newborn(x, 20, 1000), 3)).unwrap();
                assert!(heading.abs() < 4.0, "{degrees} degrees, at {x} cm: {heading}");
            }
        }
    }

    #[test]
    fn a_changed_lane_is_learnt_anew() {
        let mut lanes = LearntLanes::<96>::new();
        lanes.learn((5000, 100), Direction::AHEAD);
        // 15 degrees to the left from now on, and half a metre
        let turned = Direction::of(9659, 2588);
        (0..60).for_each(|_| lanes.learn((5000, 150), turned));
        let course = lanes.sets.as_flattened().as_flattened().iter().find(|c| c.vehicles > 0).unwrap();
        assert!((course.heading.radians().to_degrees() - 15.0).abs() < 0.5, "{course:?}");
        let cell = Cell::at((5000, 150)).unwrap();
        assert!(course.left_of(turned, cell, (5000, 150)).abs() <= 12, "{course:?}");
        lanes.clear();
        assert!(lanes.sets.as_flattened().as_flattened().iter().all(|c| *c == Course::NONE));
    }

    #[test]
    fn where_nobody_drives_any_more_there_is_no_lane_after_some_hundred_vehicles_elsewhere() {
        let mut lanes = LearntLanes::<96>::new();
        let (old, new) = (newborn(6000, 10, 1000), newborn(6000, 1000, 1000));
        drive(&mut lanes, 200, (3000, 0), (9000, 0));
        assert!(lanes.heading(&old, 3).is_some());
        drive(&mut lanes, 500, (3000, 1000), (9000, 1000));
        assert!(lanes.heading(&old, 3).is_some() && lanes.heading(&new, 3).is_some(), "a quiet lane stays one");
        drive(&mut lanes, 1000, (3000, 1000), (9000, 1000));
        assert!(lanes.heading(&old, 3).is_none() && lanes.heading(&new, 3).is_some());
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
            (0..vehicles).for_each(|_| lanes.learn(at(cell), Direction::AHEAD));
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
        (0..30).for_each(|_| lanes.learn(at(sharing[4]), Direction::AHEAD));
        assert!(seen(&lanes)[4] > 0 && seen(&lanes).iter().filter(|n| **n > 0).count() == 4, "{:?}", seen(&lanes));
    }

    #[test]
    fn beyond_all_cells_nothing_is_learnt() {
        let mut lanes = LearntLanes::<96>::new();
        for place in [(16_400, 0), (0, -16_500), (i32::MAX, i32::MIN)] {
            lanes.learn(place, Direction::AHEAD);
            assert_eq!(lanes.heading(&newborn(place.0 / 2, place.1 / 2, 100), 0), None);
        }
        let known = |lanes: &LearntLanes<96>| lanes.sets.as_flattened().as_flattened().iter().any(|c| c.cell.is_some());
        assert!(!known(&lanes));
        lanes.learn((16_383, -16_384), Direction::AHEAD);
        assert!(known(&lanes));
    }

    #[test]
    fn headings_on_either_side_of_straight_back_have_a_mean_between_them() {
        let mut lanes = LearntLanes::<96>::new();
        for y in [-300, 300, -300, 300] {
            let back = Direction::of(-10_000, y);
            (0..5).for_each(|k| lanes.learn((5000 - 256 * k, 0), back));
        }
        let heading = degrees(lanes.heading(&newborn(4400, 0, -900), 1)).unwrap();
        assert!(heading.abs() > 179.0, "{heading}");
    }
}
