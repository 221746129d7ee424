//! How many points of a frame come again in the next: what is there does, noise does not.
//!
//! # Model
//! A vehicle, a rail or a post reflects again, where it was or where its own Doppler takes it in the time between. Thermal noise,
//! rain and interference lie elsewhere in each frame. Where the speed itself is what cannot be right, the place alone is compared.
//!
//! # Limits
//! `WATCHED` points of a frame are compared with all of the next; what they show is taken for all of the frame.
//!
//! # Cost
//! Six bytes a watched point, and a comparison for each point with each of them.

use heapless::Vec;

use crate::fixed::angle::Angle;
use crate::fixed::time::Time;
use crate::frame::detection::Detection;

/// Points of a frame that are compared with the next.
const WATCHED: usize = 32;
/// Frames farther apart are not compared, microseconds.
const LONGEST_US: u64 = 1_000_000;
/// How far from where it is expected a point comes again, centimetres of range: about the length of what reflects of a car.
const RANGE_CM: i32 = 100;
/// The same where its speed is not known: what traffic goes in a frame besides.
const RANGE_AT_ANY_SPEED_CM: i32 = 400;
/// How far beside, in units of [`Angle`]: 1.5 degrees.
const AZIMUTH: i32 = 273;
/// And a metre of what goes across, in these units times centimetres of range.
const ACROSS: i32 = 1_043_038;
/// How much the speed differs.
const SPEED_CM_S: i32 = 150;

/// A point to be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Point {
    range_cm: u16,
    azimuth: Angle,
    /// Where it can be right.
    speed_cm_s: Option<i16>,
}

impl Point {
    /// A detection whose speed can be right, or cannot.
    pub const fn new(d: &Detection, has_speed: bool) -> Self {
        let speed_cm_s = if has_speed { Some(d.radial_velocity_cm_s) } else { None };
        Self { range_cm: d.range_cm, azimuth: d.azimuth, speed_cm_s }
    }

    /// Whether it can be the same, so many microseconds later.
    #[allow(clippy::cast_possible_truncation)] // a second at most
    fn is(self, later: Self, passed_us: u64) -> bool {
        let [range, later_range] = [self.range_cm, later.range_cm].map(i32::from);
        let [azimuth, later_azimuth] = [self.azimuth, later.azimuth].map(|a| i32::from(a.raw()));
        if (later_azimuth - azimuth).abs() > AZIMUTH + ACROSS / later_range.max(1) {
            return false;
        }
        let grown = later_range - range;
        let (Some(speed), Some(later_speed)) = (self.speed_cm_s, later.speed_cm_s) else {
            return grown.abs() <= RANGE_AT_ANY_SPEED_CM;
        };
        let [speed, later_speed] = [speed, later_speed].map(i32::from);
        let moved = (i64::from(speed) * passed_us as i64 / 1_000_000) as i32;
        (speed - later_speed).abs() <= SPEED_CM_S && (grown.abs() <= RANGE_CM || (grown - moved).abs() <= RANGE_CM)
    }
}

/// The points of the last frame.
#[derive(Debug, Clone, Default)]
pub struct Repeats {
    last: Option<Time>,
    watched: Vec<Point, WATCHED, u16>,
    /// Points there were.
    all: u32,
}

impl Repeats {
    /// Before the first frame.
    pub const NEW: Self = Self { last: None, watched: Vec::new(), all: 0 };

    /// Begins a frame.
    pub fn frame(&mut self, now: Time) -> Comparing<'_> {
        let passed_us = self.last.and_then(|last| now.since(last)).filter(|us| *us <= LONGEST_US);
        self.last = Some(now);
        let watched = count(&self.watched);
        Comparing { repeats: self, passed_us, watched, again: Vec::new(), new: Vec::new(), all: 0 }
    }
}

/// A frame's points as they come.
#[derive(Debug)]
pub struct Comparing<'a> {
    repeats: &'a mut Repeats,
    passed_us: Option<u64>,
    watched: u32,
    again: Vec<Point, WATCHED, u16>,
    new: Vec<Point, WATCHED, u16>,
    all: u32,
}

impl Comparing<'_> {
    /// Takes one.
    pub fn add(&mut self, point: Point) {
        self.all = self.all.saturating_add(1);
        let watched = &mut self.repeats.watched;
        let before = self.passed_us.and_then(|us| watched.iter().position(|before| before.is(point, us)));
        // each is found once; those that were are watched on
        let list = match before {
            Some(before) => {
                take(watched, before);
                &mut self.again
            }
            None => &mut self.new,
        };
        let _ = list.push(point);
    }

    /// They stand in the place of the last frame's; about how many of those came again.
    pub fn end(mut self) -> u32 {
        let before = self.repeats.all;
        let came = count(&self.again).saturating_mul(before).checked_div(self.watched).unwrap_or(0);
        // by reference: what drops a list by value could panic
        for point in &self.new {
            let _ = self.again.push(*point);
        }
        (self.repeats.watched, self.repeats.all) = (self.again, self.all);
        came
    }
}

#[allow(clippy::cast_possible_truncation)] // a few points
fn count(list: &[Point]) -> u32 {
    list.len() as u32
}

/// Takes a point out; the last takes its place. Unlike `swap_remove`, cannot panic.
fn take(list: &mut Vec<Point, WATCHED, u16>, place: usize) {
    if let (Some(last), true) = (list.last().copied(), place < list.len()) {
        if let Some(point) = list.get_mut(place) {
            *point = last;
        }
        list.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec as StdVec;

    fn point(range_m: f32, azimuth_deg: f32, speed_mps: f32) -> Point {
        let speed_cm_s = Some((speed_mps * 100.0) as i16);
        Point { range_cm: (range_m * 100.0) as u16, azimuth: Angle::from_degrees(azimuth_deg), speed_cm_s }
    }

    /// Points that came again in a frame at this time, milliseconds.
    fn frame(repeats: &mut Repeats, ms: u64, points: &[Point]) -> u32 {
        let mut comparing = repeats.frame(Time::from_micros(ms * 1000));
        points.iter().for_each(|point| comparing.add(*point));
        comparing.end()
    }

    /// Points that came again, frame by frame, 100 ms apart.
    fn again(frames: &[&[Point]]) -> StdVec<u32> {
        let mut repeats = Repeats::NEW;
        let each = |(i, points): (u64, &&[Point])| frame(&mut repeats, i * 100, points);
        (0..).zip(frames).map(each).collect()
    }

    #[test]
    fn what_stands_and_what_moves_by_its_doppler_comes_again() {
        let (post, car) = (point(40.0, 10.0, 0.0), point(60.0, -5.0, -30.0));
        assert_eq!(again(&[&[post, car], &[point(57.0, -5.0, -30.0), post], &[post]]), [0, 2, 1]);
        // receding is positive: it does not come nearer
        assert_eq!(again(&[&[point(60.0, 0.0, 30.0)], &[point(57.0, 0.0, 30.0)]]), [0, 0]);
        assert_eq!(again(&[&[point(60.0, 0.0, 30.0)], &[point(63.0, 0.0, 30.0)]]), [0, 1]);
    }

    #[test]
    fn what_lies_elsewhere_or_moves_otherwise_does_not() {
        let first = point(50.0, 0.0, 0.0);
        for other in [point(51.1, 0.0, 0.0), point(48.9, 0.0, 0.0), point(50.0, 3.0, 0.0), point(50.0, 0.0, 2.0)] {
            assert_eq!(again(&[&[first], &[other]]), [0, 0], "{other:?}");
        }
        // near by a metre is more degrees
        assert_eq!(again(&[&[point(10.0, 0.0, 0.0)], &[point(10.0, 6.0, 0.0)]]), [0, 1]);
    }

    #[test]
    fn without_a_speed_that_can_be_right_the_place_counts() {
        let at = |range_m| Point { speed_cm_s: None, ..point(range_m, 0.0, 0.0) };
        assert_eq!(again(&[&[at(50.0)], &[at(53.9)], &[at(58.0)]]), [0, 1, 0]);
    }

    #[test]
    fn each_point_comes_again_once() {
        let p = point(50.0, 0.0, 0.0);
        assert_eq!(again(&[&[p], &[p, p, p], &[p]]), [0, 1, 1]);
    }

    #[test]
    fn of_many_points_those_watched_speak_for_all_whatever_their_order() {
        let all: StdVec<Point> = (0..200_u16).map(|i| point(3.0 + f32::from(i), 0.0, 5.0)).collect();
        let later: StdVec<Point> = (0..200_u16).map(|i| point(203.5 - f32::from(i), 0.0, 5.0)).collect();
        assert_eq!(again(&[&all, &later]), [0, 200]);
        assert_eq!(again(&[&all, &later[100..]]).last(), Some(&200), "those watched are among them");
        assert_eq!(again(&[&all, &later[..100]]).last(), Some(&0), "and here they are not");
    }

    #[test]
    fn nothing_is_said_over_a_gap_or_a_step_back() {
        let p = point(50.0, 0.0, 0.0);
        let mut repeats = Repeats::NEW;
        for (ms, came) in [(5000, 0), (5100, 1), (6101, 0), (6201, 1), (2000, 0), (2100, 1)] {
            assert_eq!(frame(&mut repeats, ms, &[p]), came, "{ms} ms");
        }
    }

    /// Rain: 20 points a frame within 30 m of the sensor, at the speed of drops.
    #[test]
    fn noise_seldom_comes_again() {
        let mut state = 7_u32;
        let mut draw = |most: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0 * most
        };
        let mut repeats = Repeats::NEW;
        let mut sum = 0;
        for i in 0..1000 {
            let drops: StdVec<Point> =
                (0..20).map(|_| point(3.0 + draw(27.0), draw(120.0) - 60.0, draw(6.0) - 3.0)).collect();
            sum += frame(&mut repeats, i * 70, &drops);
        }
        assert!(sum < 2 * 1000, "{sum} of 20000, which is fewer than two a frame");
    }
}
