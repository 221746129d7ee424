//! Moving obstacles: detections that move together, followed from frame to frame.
//!
//! A grid alone smears what moves 1.7 m a frame, and shows neither how long nor how high a thing
//! is. Doppler tells how each detection moves, so those of one vehicle can be gathered in its own
//! moving frame, where a second of them draws its outline. The outline's length tells the class,
//! the class the height, and the box goes into the grid as solid evidence.
//!
//! # Limits
//! At most `N` obstacles. When the list is full, a new one replaces the one with the least evidence
//! if that is unconfirmed, and is dropped and counted otherwise.

mod body;
#[cfg(test)]
mod by_hand;
mod by_range;
pub mod config;
mod gathered;
mod joining;
pub mod motion;
pub mod obstacle;
mod own_way;
pub mod profile;
mod search;
pub mod size;
pub mod tallness;
pub mod tracking;

use heapless::Vec;

use crate::reflection::Reflection;
use crate::solid::Solid;
use crate::time::Step;
use by_range::ByRange;
use obstacle::Obstacle;
use tracking::Tracking;

/// How far behind the sensor an obstacle is followed, centimetres.
const BEHIND_CM: i32 = -2000;

/// The obstacles of one sensor.
#[derive(Debug, Clone)]
pub struct Obstacles<const N: usize> {
    list: Vec<Obstacle, N, u16>,
    dropped: u32,
}

/// Which detections found an obstacle: one bit each, in the scan's order.
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
        Self { list: Vec::new(), dropped: 0 }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.list.clear();
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
    pub fn solids<'a>(&'a self, t: &'a Tracking) -> impl Iterator<Item = Solid> + 'a {
        self.list.iter().filter(|o| o.existence >= t.confirmed && o.age >= 2 && o.is_mover(t)).map(|o| o.solid(t))
    }

    /// Takes one frame's detections: moves every obstacle on, gives each detection to the obstacle
    /// it fits best, starts new ones from the rest, joins parts of one vehicle and drops what is no
    /// longer believed in. `in_view` tells whether a place is in plain view (by the previous map).
    pub fn step<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        step: Step,
        t: &Tracking,
        in_view: impl Fn(i32, i32) -> bool,
    ) -> Claimed<D> {
        let kept = t.kept_over(step);
        for o in &mut self.list {
            o.predict(step, kept.lateral, t);
        }
        let by_range = ByRange::<D>::sort(reflections, t.limit_cm);
        let mut claimed = self.associate(reflections, &by_range, kept.outline, t);
        for o in &mut self.list {
            o.settle(step, t);
        }
        self.found(reflections, &by_range, &mut claimed, t);
        self.join_parts(t);
        self.doubt_the_unseen(step, t, in_view);
        claimed
    }

    /// Gives each detection to the obstacle it fits best, or else to the one whose wheel it may be; of
    /// equals, to the elder in the list.
    #[allow(clippy::cast_possible_truncation)] // the list is bounded
    fn associate<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        outline_kept: i32,
        t: &Tracking,
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

    /// Starts obstacles from detections that move along the road and belong to nobody. At most half
    /// as many in a frame as there is room for in all; the rest waits for the next.
    fn found<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        claimed: &mut Claimed<D>,
        t: &Tracking,
    ) {
        let mut room = N / 2;
        for (i, seed) in reflections.iter().enumerate() {
            if claimed.contains(i) {
                continue;
            }
            let Some((heading, speed)) = t.course(seed) else { continue };
            if room == 0 {
                return;
            }
            if self.list.is_full() && self.list.iter().all(|o| o.existence >= t.confirmed) {
                // there will be none in this frame
                self.dropped = self.dropped.saturating_add(1);
                return;
            }
            room -= 1;
            let mut newborn = Obstacle::new(seed, heading, speed);
            newborn.absorb(seed, t);
            claimed.insert(i);
            let mut search = newborn.search(t);
            let (from, to) = search.distances_cm();
            for place in by_range.between(from - t.max_length_cm, to + t.max_length_cm) {
                if !search.reaches(place.x_cm, place.y_cm) {
                    continue;
                }
                let j = usize::from(place.index);
                let Some(r) = reflections.get(j).filter(|_| !claimed.contains(j)) else { continue };
                let error = search.speed_error(r);
                if error <= t.doppler_gate
                    && search.offset(r, t).and_then(|offset| search.misfit(r, offset, error, t)).is_some()
                {
                    newborn.absorb(r, t);
                    newborn.reach(r);
                    claimed.insert(j);
                    search = newborn.search(t);
                }
            }
            newborn.settle(Step::from_micros(0), t);
            self.admit(newborn, t);
        }
    }

    fn admit(&mut self, newborn: Obstacle, t: &Tracking) {
        let Err(newborn) = self.list.push(newborn) else { return };
        let weakest = self.list.iter_mut().min_by_key(|o| o.existence);
        match weakest {
            Some(o) if o.existence < t.confirmed && o.existence < newborn.existence => *o = newborn,
            _ => self.dropped = self.dropped.saturating_add(1),
        }
    }

    /// Joins obstacles that are parts of one vehicle: the one with more detections takes the other,
    /// which is left without evidence and so dropped. So is what lies within a vehicle.
    fn join_parts(&mut self, t: &Tracking) {
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
                } else if elder.hits / 2 >= younger.hits && elder.encloses(younger, t) {
                    younger.existence = 0;
                }
            }
            rest = others;
        }
    }

    /// Takes evidence from obstacles nobody saw, quickly where they should have been seen, and
    /// drops those without evidence or out of reach.
    fn doubt_the_unseen(&mut self, step: Step, t: &Tracking, in_view: impl Fn(i32, i32) -> bool) {
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
            o.existence -= step.times(loss);
        }
        self.list.retain(|o| {
            let (x, y) = o.anchor();
            o.existence > 0 && !o.is_fixture(t) && x > BEHIND_CM && x < t.limit_cm && y.abs() < t.limit_cm
        });
    }
}

#[cfg(test)]
mod tests {
    use super::by_hand::{car, change_speed, follow, reflection, rules};
    use super::*;
    use std::vec::Vec;

    fn boxes<const N: usize>(list: &Obstacles<N>) -> Vec<Solid> {
        list.solids(&rules()).collect()
    }

    /// A car that came along the road and has stopped 50 m ahead.
    fn stopped() -> (Obstacles<16>, Solid) {
        let mut list = Obstacles::new();
        let mut cars = [car([30.0, 3.0], [1.0, 0.0], 10.0)];
        follow(&mut list, &mut cars, 2.0, true);
        change_speed(&mut list, &mut cars, 0.0);
        follow(&mut list, &mut cars, 2.0, true);
        let found = boxes(&list);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((f64::from(found[0].x_cm) / 100.0 - cars[0].at[0]).abs() < 1.5, "{found:?}");
        (list, found[0])
    }

    #[test]
    fn what_has_stopped_keeps_its_box_through_a_red_light_in_a_shadow() {
        let (mut list, found) = stopped();
        follow(&mut list, &mut [], 30.0, false);
        let after = boxes(&list);
        assert_eq!(after.len(), 1);
        assert!((after[0].x_cm - found.x_cm).abs() < 50 && after[0].height_cm == found.height_cm, "{after:?}");
        // seen free, it is given up
        follow(&mut list, &mut [], 6.0, true);
        assert!(boxes(&list).is_empty());
    }

    #[test]
    fn what_was_moving_is_given_up_in_a_shadow() {
        let mut list = Obstacles::<16>::new();
        follow(&mut list, &mut [car([30.0, 3.0], [1.0, 0.0], 10.0)], 2.0, true);
        assert_eq!(boxes(&list).len(), 1);
        follow(&mut list, &mut [], 8.0, false);
        assert!(boxes(&list).is_empty());
    }

    #[test]
    fn a_lorry_that_stands_for_an_hour_stays_the_same_box() {
        let mut list = Obstacles::<16>::new();
        let mut lorry = [car([30.0, 5.0], [1.0, 0.0], 6.0)];
        lorry[0].size = [9.0, 2.0];
        follow(&mut list, &mut lorry, 3.0, true);
        change_speed(&mut list, &mut lorry, 0.0);
        follow(&mut list, &mut lorry, 3.0, true);
        let before = boxes(&list);
        follow(&mut list, &mut lorry, 3600.0, true);
        let after = boxes(&list);
        assert_eq!((before.len(), after.len()), (1, 1));
        assert!((after[0].x_cm - before[0].x_cm).abs() < 100 && (after[0].y_cm - before[0].y_cm).abs() < 50);
        assert!((after[0].half_length_cm - before[0].half_length_cm).abs() < 50, "{before:?} {after:?}");
    }

    #[test]
    fn a_crowd_of_standing_detections_makes_no_obstacle() {
        let crowd: Vec<Reflection> =
            (0..256).map(|i| reflection([10.0 + f64::from(i % 16) * 8.0, f64::from(i / 16) - 8.0], [0.0; 2])).collect();
        let mut list = Obstacles::<16>::new();
        for _ in 0..100 {
            let claimed = list.step::<256>(&crowd, Step::from_micros(66_972), &rules(), |_, _| true);
            assert!((0..256).all(|i| !claimed.contains(i)));
        }
        assert_eq!((list.iter().count(), list.dropped()), (0, 0));
    }

    #[test]
    fn a_jam_the_unit_started_in_is_followed_once_it_moves() {
        let mut list = Obstacles::<16>::new();
        let mut cars: Vec<_> = (0..6).map(|k| car([30.0 + 8.0 * f64::from(k), 3.0], [1.0, 0.0], 0.0)).collect();
        follow(&mut list, &mut cars, 5.0, true);
        assert!(boxes(&list).is_empty());
        change_speed(&mut list, &mut cars, 2.0);
        follow(&mut list, &mut cars, 3.0, true);
        assert_eq!(boxes(&list).len(), 6);
    }
}
