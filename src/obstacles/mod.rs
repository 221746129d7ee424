//! Moving obstacles: detections that move together, followed from frame to frame.
//!
//! A grid alone smears what moves 1.7 m a frame, and shows neither how long nor how high a thing
//! is. Doppler shows how each detection moves, so those of one vehicle can be gathered in its own
//! moving frame, where a second of them draws its outline. The outline's length gives the class,
//! the class the height, and the box casts its shadow on the map (`grid/shadow.rs`); cells of the grid stay as they are.
//!
//! # Model
//! *Association.* A detection belongs to the obstacle whose outline, place and speed it fits best within a gate (`search.rs`).
//! What fits none and moves begins one (`newborn.rs`). Parts that drive in line, equally fast, with gaps smaller than vehicles
//! keep at that speed, become one (`joining.rs`).
//!
//! *Motion.* Beside the motion along the road's axis each has one without a heading ([motion]), to which it changes where the two
//! differ for certain (`off_axis.rs`). Lanes that are given or learnt say where vehicles head ([lanes], [learnt_lanes]).
//!
//! *Extent.* The outline is a fading histogram of reflections ([profile]). A length is remembered while a part is hidden, and a box
//! lies behind the side that is seen, since only that side reflects (`hidden_end.rs`, `farther_end.rs`).
//!
//! *Height.* Length gives it ([size]); elevations ([tallness]) and the radar cross section ([reflectivity]) correct it.
//!
//! *End.* Evidence is lost quickly in plain view, slowly in a shadow, and more slowly still by what stands: a radar misses
//! stationary objects more often.
//!
//! # Limits
//! At most `N` obstacles. When the list is full, a new one replaces the one with the least evidence
//! if that is unconfirmed, and is dropped and counted otherwise. An obstacle that was never seen moving is none: it hides
//! what the grid knows of it.
//!
//! What was tried, and what it was worth: `tests/STUDIES.md`.

mod body;
mod clutter;
pub mod config;
mod doppler_slope;
mod farther_end;
mod gathered;
mod hidden_end;
mod joining;
mod lane;
pub mod lanes;
pub mod learnt_lanes;
#[cfg(test)]
mod made_up;
pub mod motion;
mod newborn;
pub mod obstacle;
mod off_axis;
pub mod parameters;
pub mod profile;
pub mod reflectivity;
mod search;
pub mod size;
pub mod solid;
#[cfg(test)]
mod stops;
pub mod tallness;

use heapless::Vec;

use crate::fixed::time::{Phase, Step};
use crate::frame::by_range::ByRange;
use crate::frame::reflection::Reflection;
use crate::obstacles::solid::Solid;
use clutter::ClutterMap;
use learnt_lanes::LearntLanes;
use obstacle::Obstacle;
use parameters::TrackingParameters;

/// How far behind the sensor an obstacle is followed, centimetres.
const BEHIND_CM: i32 = -2000;

/// The obstacles of one sensor.
#[derive(Debug, Clone)]
pub struct Obstacles<const N: usize> {
    list: Vec<Obstacle, N, u16>,
    lanes: LearntLanes<N>,
    fixtures: ClutterMap<N>,
    dropped: u32,
    phase: Phase,
}

/// Which detections found an obstacle: a flag each, in the scan's order.
#[derive(Debug, Clone, Copy)]
pub struct Claimed<const D: usize>([bool; D]);

impl<const D: usize> Claimed<D> {
    const NONE: Self = Self([false; D]);

    /// Whether detection `i` belongs to an obstacle.
    pub fn contains(&self, i: usize) -> bool {
        self.0.get(i).copied().unwrap_or(false)
    }

    fn insert(&mut self, i: usize) {
        if let Some(flag) = self.0.get_mut(i) {
            *flag = true;
        }
    }
}

impl<const N: usize> Default for Obstacles<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Obstacles<N> {
    /// No obstacles.
    pub const fn new() -> Self {
        Self {
            list: Vec::new(),
            lanes: LearntLanes::new(),
            fixtures: ClutterMap::new(),
            dropped: 0,
            phase: Phase::START,
        }
    }

    /// Forgets all but the lanes they drove on and the fixtures beside them.
    pub fn clear(&mut self) {
        self.list.clear();
        self.phase = Phase::START;
    }

    /// Forgets the [lanes](learnt_lanes) and fixtures that were learnt.
    pub fn forget_what_was_learnt(&mut self) {
        self.lanes.clear();
        self.fixtures.clear();
    }

    /// All, confirmed or not.
    pub fn iter(&self) -> impl Iterator<Item = &Obstacle> {
        self.list.iter()
    }

    /// New obstacles that found no room, saturating; where none would find any, one for the frame.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Boxes of the confirmed.
    pub fn solids<'a>(&'a self, t: &'a TrackingParameters) -> impl Iterator<Item = Solid> + 'a {
        self.confirmed(t).map(|o| o.solid(t))
    }

    fn confirmed<'a>(&'a self, t: &'a TrackingParameters) -> impl Iterator<Item = &'a Obstacle> {
        self.list.iter().filter(|o| o.existence >= t.confirmed && o.age >= 2 && o.is_mover(t))
    }

    /// Takes one frame's detections: moves every obstacle on, gives each detection to the obstacle
    /// it fits best, starts new ones from the rest, joins parts of one vehicle and drops what is no
    /// longer believed in. `in_view` says whether a place is in plain view (by the previous map).
    pub fn step<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        step: Step,
        t: &TrackingParameters,
        in_view: impl Fn(i32, i32) -> bool,
    ) -> Claimed<D> {
        let kept = t.kept_over(step);
        for o in &mut self.list {
            o.predict(step, kept.lateral, t);
            o.keep_to_learnt(&self.lanes, t);
        }
        let of_fixtures = self.of_fixtures(reflections, by_range, t);
        let mut claimed = self.associate(reflections, by_range, &of_fixtures, kept.outline, t);
        for o in &mut self.list {
            o.settle(step, t);
            o.look_for_learnt(&self.lanes, t);
        }
        self.found(reflections, by_range, &of_fixtures, &mut claimed, t);
        self.learn_fixtures(reflections, by_range, &claimed, step, t, &in_view);
        self.join_parts(t);
        self.find_farther_ends(t);
        self.list.iter_mut().for_each(|o| o.look_for_end(t, &in_view));
        self.doubt_the_unseen(step, t, in_view);
        self.list.iter_mut().for_each(|o| o.teach(&mut self.lanes, t));
        claimed
    }

    /// Moves all on over a gap in the frames in which nobody looked. What moves is believed in for seconds, what stands for
    /// as long as a red light lasts, and neither what was not confirmed.
    pub fn bridge(&mut self, gap: Step, t: &TrackingParameters) {
        let (mut left, second) = (gap, Step::from_micros(1_000_000));
        self.list.retain(|o| o.existence >= t.confirmed);
        for o in self.list.iter_mut().filter(|o| o.is_standing(t)) {
            o.existence = o.existence.saturating_sub(gap.times(t.standing_hidden_loss));
        }
        while left.raw() > 0 && self.list.iter().any(|o| !o.is_standing(t)) {
            let step = left.min(second);
            left = left.less(step);
            let kept = t.kept_over(step);
            for o in self.list.iter_mut().filter(|o| !o.is_standing(t)) {
                o.predict(step, kept.lateral, t);
                o.keep_to_learnt(&self.lanes, t);
                o.existence -= step.times(t.hidden_loss);
            }
            self.list.retain(|o| o.existence > 0 && o.is_within_reach(t));
        }
        self.list.retain(|o| o.existence > 0);
    }

    /// Gives each detection to the obstacle it fits best, or else to the one whose wheel it may be; of
    /// equals, to the elder in the list. What is of fixtures belongs to none.
    #[allow(clippy::cast_possible_truncation)] // the list is bounded
    fn associate<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        of_fixtures: &Claimed<D>,
        outline_kept: i32,
        t: &TrackingParameters,
    ) -> Claimed<D> {
        const { assert!(N < u16::MAX as usize) }
        const NONE: (i32, u16) = (i32::MAX, u16::MAX);
        let mut best = [(NONE, NONE); D];
        let mut moving = Claimed::<D>::NONE;
        for (i, _) in reflections.iter().enumerate().filter(|(_, r)| t.course(r).is_some()) {
            moving.insert(i);
        }
        for (k, o) in self.list.iter().enumerate() {
            let search = o.search(t);
            let confirmed = o.existence >= t.confirmed;
            let (from, to) = search.distances_cm();
            for place in by_range.between(from, to) {
                if !search.reaches(place.x_cm, place.y_cm) {
                    continue;
                }
                let i = usize::from(place.index);
                if of_fixtures.contains(i) {
                    continue;
                }
                let (Some(r), Some((body, wheel))) = (reflections.get(i), best.get_mut(i)) else { continue };
                let Some(offset) = search.offset(r, t) else { continue };
                let error = search.speed_error(r);
                if error <= t.doppler_gate {
                    if let Some(misfit) = search.misfit(r, offset, error, t)
                        && misfit < body.0
                    {
                        *body = (misfit, k as u16);
                    }
                } else if confirmed
                    && body.1 == u16::MAX
                    && moving.contains(i)
                    && search.is_speed_of_wheel(r, t)
                    && let Some(misfit) = search.misfit(r, offset, 0, t)
                    && misfit < wheel.0
                {
                    *wheel = (misfit, k as u16);
                }
            }
        }
        let mut claimed = Claimed::NONE;
        for (i, (r, ((_, body), _))) in reflections.iter().zip(&best).enumerate() {
            let Some(o) = self.list.get_mut(usize::from(*body)) else { continue };
            if !o.seen() {
                o.fade_outline(outline_kept);
            }
            o.absorb(r, t);
            claimed.insert(i);
        }
        for (i, (r, (_, (_, wheel)))) in reflections.iter().zip(&best).enumerate() {
            if claimed.contains(i) {
                continue;
            }
            let Some(o) = self.list.get_mut(usize::from(*wheel)) else { continue };
            o.absorb_wheel(r);
            claimed.insert(i);
        }
        claimed
    }

    /// Joins obstacles that are parts of one vehicle: the one with more detections takes the other,
    /// which is left without evidence and so dropped. So is what lies within a vehicle, unless one of them stands and the other
    /// is not seen: then it is that vehicle itself, which leaves, or another that one only seems to have reached.
    fn join_parts(&mut self, t: &TrackingParameters) {
        let mut rest = self.list.as_mut_slice();
        while let Some((a, others)) = rest.split_first_mut() {
            for b in others.iter_mut().filter(|b| b.existence > 0) {
                if a.existence <= 0 {
                    break;
                }
                if !a.is_near(b, t) {
                    continue;
                }
                let (elder, younger) = if a.hits >= b.hits { (&mut *a, b) } else { (b, &mut *a) };
                if elder.is_one_with(younger, t) {
                    elder.join(younger, t);
                    younger.existence = 0;
                } else if elder.may_be_leaving_as(younger, t) {
                    if younger.existence >= t.confirmed {
                        younger.inherit(elder);
                        elder.existence = 0;
                    }
                } else if elder.takes_away(younger, t) {
                    younger.existence = 0;
                }
            }
            rest = others;
        }
    }

    /// Takes evidence from obstacles nobody saw, quickly where they should have been seen, and
    /// drops those without evidence or out of reach.
    fn doubt_the_unseen(&mut self, step: Step, t: &TrackingParameters, in_view: impl Fn(i32, i32) -> bool) {
        for o in &mut self.list {
            if o.seen() || o.existence <= 0 {
                continue;
            }
            let places = [o.extent.front_cm, o.extent.middle_cm(), o.extent.rear_cm];
            let loss = if o.existence < t.confirmed {
                t.tentative_loss
            } else {
                let seen = places.iter().any(|&along| {
                    let (x, y) = o.global(along, 0);
                    in_view(x, y)
                });
                match (o.is_standing(t), seen) {
                    (false, true) => t.visible_loss,
                    (false, false) => t.hidden_loss,
                    (true, true) => t.standing_visible_loss,
                    (true, false) => t.standing_hidden_loss,
                }
            };
            o.existence -= self.phase.times(step, loss);
        }
        self.phase = self.phase.after(step);
        self.list.retain(|o| o.existence > 0 && !o.is_fixture(t) && !o.is_a_mast(t) && o.is_within_reach(t));
    }
}

#[cfg(test)]
mod tests {
    use super::made_up::{rules as tracking, seen_at};
    use super::*;
    use crate::fixed::trig::Direction;
    use std::vec::Vec as StdVec;

    fn reflection(x_cm: i32, y_cm: i32, radial_velocity_cm_s: i16) -> Reflection {
        Reflection { ground_cm: x_cm as u16, sight: Direction::AHEAD, ..seen_at(x_cm, y_cm, radial_velocity_cm_s) }
    }

    fn sorted<const D: usize>(reflections: &[Reflection]) -> ByRange<D> {
        ByRange::sort(reflections, tracking().limit_cm)
    }

    /// One obstacle with so much evidence; what it loses in a tenth of a second without a detection.
    fn lost(existence: i32, in_view: impl Fn(i32, i32) -> bool) -> i32 {
        let mut all = Obstacles::<4>::new();
        let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
        (o.existence, o.extent) = (existence, profile::Extent { rear_cm: -200, front_cm: 200 });
        let _ = all.list.push(o);
        let _: Claimed<4> = all.step(&[], &sorted(&[]), Step::from_micros(100_000), &tracking(), in_view);
        existence - all.iter().next().map_or(0, |o| o.existence)
    }

    #[test]
    fn what_is_unseen_is_doubted_quickly_in_view_and_slowly_in_a_shadow() {
        let t = tracking();
        let tenth = |per_s: i32| Step::from_micros(100_000).times(per_s);
        let confirmed = t.confirmed + 1000;
        assert_eq!(lost(confirmed, |_, _| false), tenth(t.hidden_loss));
        assert_eq!(lost(confirmed, |_, _| true), tenth(t.visible_loss));
        // it is at 52 m by then; one end in view is enough
        assert_eq!(lost(confirmed, |x, _| x > 5350), tenth(t.visible_loss));
        assert_eq!(lost(confirmed, |x, _| x < 5050), tenth(t.visible_loss));
        assert_eq!(lost(confirmed, |x, _| x > 5450), tenth(t.hidden_loss));
        assert_eq!(lost(t.confirmed - 1, |_, _| true), tenth(t.tentative_loss));
        assert!(t.hidden_loss < t.visible_loss && t.visible_loss < t.tentative_loss);
    }

    #[test]
    fn over_a_gap_what_moves_is_believed_in_for_seconds_and_what_stands_for_a_minute() {
        let t = tracking();
        let after = |speed: i32, gap_s: u64| {
            let mut all = Obstacles::<4>::new();
            let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, speed);
            (o.existence, o.travelled_cm) = (t.existence_max, 1000);
            let _ = all.list.push(o);
            all.bridge(Step::from_micros(gap_s * 1_000_000), &t);
            all.iter().next().map(|o| (o.anchor().0, o.existence > t.confirmed))
        };
        assert_eq!(after(2000, 3), Some((11_000, true)), "60 m on");
        assert_eq!(after(-2000, 2), Some((1000, true)));
        assert_eq!(after(2000, 10), None);
        assert_eq!(after(0, 59), Some((5000, true)));
        let mut all = Obstacles::<4>::new();
        let mut tentative = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
        tentative.existence = t.confirmed - 1;
        let _ = all.list.push(tentative);
        all.bridge(Step::from_micros(100_000), &t);
        assert_eq!(all.iter().count(), 0, "what was not confirmed is forgotten");
    }

    #[test]
    fn a_full_list_gives_up_its_weakest_for_what_has_more_evidence() {
        let t = tracking();
        let mut all = Obstacles::<2>::new();
        let of = |existence| {
            let mut o = Obstacle::new(&reflection(5000, 0, 0), Direction::AHEAD, 2000);
            o.existence = existence;
            o
        };
        [300, 500].map(of).into_iter().for_each(|o| all.admit(o, &t));
        let evidence = |all: &Obstacles<2>| all.iter().map(|o| o.existence).collect::<StdVec<_>>();
        all.admit(of(400), &t);
        assert_eq!((evidence(&all), all.dropped()), ([400, 500].to_vec(), 0));
        all.admit(of(350), &t);
        assert_eq!((evidence(&all), all.dropped()), ([400, 500].to_vec(), 1));
        [900, 1000].map(of).into_iter().for_each(|o| all.admit(o, &t));
        all.admit(of(5000), &t);
        assert_eq!((evidence(&all), all.dropped()), ([900, 1000].to_vec(), 2), "the confirmed stay");
    }

    #[test]
    fn the_part_with_more_detections_takes_the_other() {
        let t = tracking();
        let mut all = Obstacles::<2>::new();
        for (x, hits) in [(5000, 5), (5500, 50)] {
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.hits) = (1000, hits);
            let _ = all.list.push(o);
        }
        all.join_parts(&t);
        let left: StdVec<(i32, u16)> = all.iter().map(|o| (o.existence, o.hits)).collect();
        assert_eq!(left, [(0, 5), (2000, 55)]);
    }

    #[test]
    fn a_detection_goes_to_the_obstacle_it_fits_best() {
        let t = tracking();
        let mut all = Obstacles::<4>::new();
        // together longer than any vehicle
        for (x, front_cm) in [(6200, 1250), (5000, 25)] {
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.extent) = (t.confirmed, profile::Extent { rear_cm: -25, front_cm });
            let _ = all.list.push(o);
        }
        let seen = [reflection(5450, 0, 2000)];
        let claimed: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(0), &t, |_, _| false);
        assert!(claimed.contains(0) && !claimed.contains(1));
        assert_eq!(all.iter().map(|o| o.hits).collect::<StdVec<_>>(), [0, 1], "7 m from one, 4 m from the other");
    }

    #[test]
    fn boxes_are_of_the_confirmed_and_what_has_no_evidence_left_or_is_behind_the_sensor_goes() {
        let t = tracking();
        let after = |x, existence| {
            let mut all = Obstacles::<4>::new();
            let mut o = Obstacle::new(&reflection(x, 0, 0), Direction::AHEAD, 2000);
            (o.existence, o.age) = (existence, 5);
            let _ = all.list.push(o);
            let _: Claimed<4> = all.step(&[], &sorted(&[]), Step::from_micros(200_000), &t, |_, _| false);
            (all.iter().count(), all.solids(&t).count())
        };
        assert_eq!(after(5000, t.confirmed + 1000), (1, 1));
        assert_eq!(after(5000, t.confirmed - 1), (1, 0));
        assert_eq!(after(5000, 1), (0, 0));
        assert_eq!(after(BEHIND_CM - 500, t.confirmed + 1000), (0, 0));
        assert_eq!(after(t.limit_cm, t.confirmed + 1000), (0, 0));
    }

    #[test]
    fn a_frame_starts_half_as_many_as_there_is_room_for() {
        let (t, mut all) = (tracking(), Obstacles::<4>::new());
        let seen = [-900, -300, 300, 900].map(|y| reflection(5000, y, 2000));
        let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(0), &t, |_, _| true);
        assert_eq!(all.iter().count(), 2);
        let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(1), &t, |_, _| true);
        assert_eq!(all.iter().count(), 4);
    }

    #[test]
    fn only_confirmed_movers_become_boxes() {
        let (t, mut all, mut frames) = (tracking(), Obstacles::<4>::new(), 0);
        while all.solids(&t).next().is_none() {
            assert!(frames < 20, "never");
            let seen = [reflection(5000 + 133 * frames, 0, 2000), reflection(5200 + 133 * frames, 0, 2000)];
            let _: Claimed<4> = all.step(&seen, &sorted(&seen), Step::from_micros(66_667), &t, |_, _| true);
            frames += 1;
        }
        // after 2 m of way, which takes it two frames after the first
        assert_eq!(frames, 3);
    }
}
