//! Whether the end of a vehicle that is turned to the sensor is in sight.
//!
//! Along a queue a radar looks over the roofs: of a car it sees the side that is turned to it, and the car behind hides
//! the end. What was detected then lies on that side, and the middle of the vehicle half its width behind. The last map
//! tells where that is so.

use super::Obstacles;
use super::obstacle::Obstacle;
use super::parameters::{EVEN_SPREAD, TrackingParameters};
use super::solid::Solid;

/// A whole one, 2^-8.
pub(super) const ALL: i32 = 1 << 8;
/// Frames over which what the maps say is smoothed: a cell more or less in sight is no reason to move a box.
const FRAMES: i32 = 4;

impl<const N: usize> Obstacles<N> {
    /// Boxes of the confirmed, those whose end is hidden about the middle of what is seen of them. Two sensors that see
    /// a vehicle from both sides each tell its middle from their own, and all that is wrong with that has one sign; so
    /// bearings are compared by these.
    pub fn where_seen<'a>(&'a self, t: &'a TrackingParameters) -> impl Iterator<Item = Solid> + 'a {
        self.confirmed(t)
            .map(|o| if i32::from(o.hidden_end) > ALL / FRAMES { o.about_what_is_seen().solid(t) } else { o.solid(t) })
    }
}

impl Obstacle {
    /// Looks on the last map whether the nearer end of a slow one that was detected is hidden. The end of what is fast
    /// counts as in sight: it keeps its distance.
    #[allow(clippy::cast_possible_truncation)] // from 0 to 256
    pub(super) fn look_for_end(&mut self, t: &TrackingParameters, in_view: impl Fn(i32, i32) -> bool) {
        if !self.seen() {
            return;
        }
        let hidden = self.speed() < t.slow_speed && !self.nearer_end(t).iter().all(|&(x, y)| in_view(x, y));
        let hidden = if hidden { ALL } else { 0 };
        let before = i32::from(self.hidden_end);
        self.hidden_end = (before + (hidden - before) / FRAMES) as i16;
    }

    /// The same as if its end were in sight and it reflected on both sides alike.
    fn about_what_is_seen(&self) -> Self {
        Self { hidden_end: 0, spread: EVEN_SPREAD, ..self.clone() }
    }

    /// Least variance across it that a frame may show, cm^2. Where the end is hidden, all of it may be noise; a mean of
    /// values cut off at 0 would keep a part of that.
    pub(super) fn least_spread(&self) -> i32 {
        if i32::from(self.hidden_end) > ALL / 2 { -4 * EVEN_SPREAD } else { 0 }
    }

    /// The corners of its nearer end and the middle between them, centimetres.
    fn nearer_end(&self, t: &TrackingParameters) -> [(i32, i32); 3] {
        let solid = self.solid(t);
        let [front_left, rear_left, rear_right, front_right] = solid.corners();
        let is_ahead = solid.heading.along(solid.x_cm, solid.y_cm) > 0;
        let (a, b) = if is_ahead { (rear_left, rear_right) } else { (front_left, front_right) };
        [a, middle(a, b), b]
    }
}

fn middle(a: (i32, i32), b: (i32, i32)) -> (i32, i32) {
    ((a.0 + b.0) / 2, (a.1 + b.1) / 2)
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{PERIOD_S, reflection, rules};
    use super::*;
    use crate::fixed::time::Step;
    use crate::frame::by_range::ByRange;
    use std::vec::Vec;

    /// Follows a car whose side is detected, 4 m to the left of the sensor, and gives how far the middle of its box then
    /// lies behind that side, metres; `in_view` takes places in metres ahead of its middle and to the left of its side.
    fn behind_its_side(x_m: f64, speed: f64, seconds: f64, in_view: impl Fn(f64, f64) -> bool) -> f64 {
        let boxes: Vec<_> = followed(x_m, speed, seconds, in_view).solids(&rules()).collect();
        assert_eq!(boxes.len(), 1);
        f64::from(boxes[0].y_cm) / 100.0 - 4.0
    }

    fn followed(x_m: f64, speed: f64, seconds: f64, in_view: impl Fn(f64, f64) -> bool) -> Obstacles<4> {
        let (mut list, t) = (Obstacles::<4>::new(), rules());
        let frames = (seconds / PERIOD_S) as i32;
        for k in 0..frames {
            let x = x_m + speed * PERIOD_S * f64::from(k - frames);
            let reflections: Vec<_> =
                [-2.0, -1.0, 0.0, 1.0, 2.0].map(|a| reflection([x + a, 4.0], [speed, 0.0])).into();
            let step = Step::from_micros((PERIOD_S * 1e6) as u64);
            let seen = |x_cm, y_cm| in_view(f64::from(x_cm) / 100.0 - x, f64::from(y_cm) / 100.0 - 4.0);
            list.step(&reflections, &ByRange::<8>::sort(&reflections, t.limit_cm), step, &t, seen);
        }
        list
    }

    #[test]
    fn a_car_whose_end_is_hidden_lies_behind_its_side() {
        for x in [80.0, -12.0] {
            let hidden = behind_its_side(x, 2.0, 12.0, |_, _| false);
            assert!((0.75..1.0).contains(&hidden), "{x}: {hidden} m, half of 1.8 m");
        }
    }

    #[test]
    fn a_car_whose_end_is_in_sight_is_where_it_is_detected() {
        // 3 degrees off its axis nearly all that is seen is its end
        let in_sight = behind_its_side(80.0, 2.0, 12.0, |_, _| true);
        assert!(in_sight < 0.4, "{in_sight} m");
        // the front of a car ahead may be hidden, its rear is the end that counts
        assert_eq!(behind_its_side(80.0, 2.0, 12.0, |ahead, _| ahead < 0.0), in_sight);
        let hidden = behind_its_side(80.0, 2.0, 12.0, |ahead, _| ahead > 0.0);
        assert!(hidden > in_sight + 0.4, "{hidden} m");
        // it is hidden where any part of it is
        assert!(behind_its_side(80.0, 2.0, 12.0, |_, left| left < 1.0) > in_sight + 0.2);
    }

    #[test]
    fn bearings_are_of_what_is_seen_even_where_an_end_is_hidden() {
        let off = |in_view: bool| {
            let (list, t) = (followed(80.0, 2.0, 12.0, |_, _| in_view), rules());
            let middle = |solid: Option<Solid>| f64::from(solid.unwrap().y_cm) / 100.0 - 4.0;
            [middle(list.solids(&t).next()), middle(list.where_seen(&t).next())]
        };
        let [[inferred, seen], in_sight] = [off(false), off(true)];
        assert!(inferred > 0.7 && seen.abs() < 0.1, "{inferred} and {seen} m behind its side");
        assert_eq!(in_sight[0], in_sight[1], "nothing is hidden");
    }

    #[test]
    fn a_fast_one_is_taken_to_show_its_end() {
        let fast = |in_view: fn(f64, f64) -> bool| behind_its_side(80.0, 10.0, 4.0, in_view);
        assert_eq!(fast(|_, _| false), fast(|_, _| true));
    }
}
