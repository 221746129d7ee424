//! ClutterMap that a unit on a pole learns: what reflects at the same place for long and is no vehicle.
//!
//! Masts, posts and guard rails stand beside lanes, as near to them as boxes are wide. A vehicle that stops beside a mast, or
//! crosses the line of sight there, which shows no Doppler either, takes its detections for its own: the box grows to it, and
//! stays on it when the vehicle has gone.
//!
//! # Model
//! A detection that does not move and belongs to no obstacle is a candidate. One that is seen again and again at its place, and
//! never stays away for 3 s, is a fixture after half a minute. Time in which it may be a part of a vehicle does not count: within
//! 2 m of a vehicle's centre line and 10 m of its outline; nor does more than a second of a gap between frames. From then on
//! detections that do not move and lie there belong to no obstacle, but to the grid. (Sooner than half a minute, parts of
//! lorries that stand would be learnt.) A fixture that stays away for 3 s in plain view is forgotten; hidden, it stays for
//! three minutes.
//!
//! What is learnt late needs another rule: an obstacle that stands, reflects at one point alone and reflects high is a mast. Something as tall
//! as a van is 2 m wide or 6 m long, and shows it. A lorry of which one point alone is ever seen is taken for a mast, too, unless it
//! reflects like a lorry; the grid then hides what is behind that point, and no more.
//!
//! # Limits
//! As many as obstacles, candidates among them; where there is no room, what comes later is not learnt. Gaps and steps of the
//! clock leave them as they are. They are lost with the power.
//!
//! # Cost
//! 20 bytes each: 1.9 kB on the reference grid. A stretch of the sorted detections is looked through for each in every frame; an
//! eighth of them, in turn, is compared with all obstacles where it is a candidate.

use heapless::Vec;

use super::obstacle::Obstacle;
use super::parameters::TrackingParameters;
use super::{Claimed, Obstacles};
use crate::fixed::math::length;
use crate::fixed::time::{Phase, Step};
use crate::frame::by_range::{ByRange, MOST_AROUND};
use crate::frame::reflection::Reflection;

/// Fastest radial velocity of what does not move, cm/s.
const STANDS_CM_S: u16 = 50;
/// How far along the line of sight from its place a fixture is seen, centimetres.
const ALONG_CM: i32 = 60;
/// How far across it, beside what noise allows for, centimetres.
const ACROSS_CM: i32 = 15;
/// A second, in the unit of time here: 2^-8 s.
pub(super) const SECOND: u16 = 256;
/// How long it stays away before it is forgotten.
const AWAY: u16 = 3 * SECOND;
/// Time that it is hidden counts as so much less.
const HIDDEN: u16 = 64;
/// How near the centre line of an obstacle, and beyond its outline, parts of it are looked for, centimetres.
const PART_CM: [i32; 2] = [200, 1000];
/// One in so many candidates is compared with the obstacles in a frame.
const TURNS: usize = 8;
/// Most that a frame adds to times: longer, nobody looked.
const MOST_PASSED: u16 = SECOND;
/// What a fixture has been known for: no candidate's time comes so far.
const LEARNT: u16 = u16::MAX;
/// New candidates in a frame.
const MOST_NEW: usize = 4;
/// Share of the way to where it is seen by which its place follows: a 16th.
const FOLLOWS: i32 = 16;
/// Outline of what shows one point, centimetres, and how far that spreads to its sides, cm^2.
const POINT: (i32, i32) = (150, 3500);

/// A place that reflects.
#[derive(Debug, Clone, Copy)]
struct Reflector {
    /// Centimetres times [`FOLLOWS`], in the levelled frame.
    place: (i32, i32),
    /// How far away that is, centimetres.
    distance_cm: i32,
    /// How long it has been known and was no part of a vehicle, 2^-8 s; [`LEARNT`] of a fixture.
    known_for: u16,
    /// How long ago it was compared with the obstacles, 2^-8 s.
    compared: u16,
    /// How long it has not been seen, 2^-8 s, and what of hidden time is left over.
    away: u16,
    hidden: u16,
}

/// What reflects at the same place, for long or as a candidate.
#[derive(Debug, Clone)]
pub(super) struct ClutterMap<const N: usize> {
    list: Vec<Reflector, N, u16>,
    phase: Phase,
    /// The first that is compared with the obstacles in the next frame.
    turn: usize,
}

fn stands(r: &Reflection) -> bool {
    r.radial_velocity_cm_s.unsigned_abs() <= STANDS_CM_S
}

impl Reflector {
    fn new(r: &Reflection) -> Self {
        let place = (r.x_cm * FOLLOWS, r.y_cm * FOLLOWS);
        Self { place, distance_cm: length(r.x_cm, r.y_cm), known_for: 0, compared: 0, away: 0, hidden: 0 }
    }

    fn is_learnt(&self) -> bool {
        self.known_for == LEARNT
    }

    fn place_cm(&self) -> (i32, i32) {
        (self.place.0 / FOLLOWS, self.place.1 / FOLLOWS)
    }

    /// Detections that do not move and lie within twice the reach of what can be of it; and whether they lie within that.
    fn around<'a, const D: usize>(
        &self,
        reflections: &'a [Reflection],
        by_range: &'a ByRange<D>,
        t: &TrackingParameters,
    ) -> impl Iterator<Item = (usize, &'a Reflection, bool)> + 'a {
        let ((x, y), distance, sigmas) = (self.place_cm(), self.distance_cm, t.sigmas);
        let around = by_range.between(distance - 2 * ALONG_CM, distance + 2 * ALONG_CM).iter().take(MOST_AROUND);
        around.filter_map(move |place| {
            let (dx, dy, i) = (place.x_cm - x, place.y_cm - y, usize::from(place.index));
            let r = reflections.get(i).filter(|r| stands(r))?;
            let along = r.sight.along(dx, dy).abs();
            if along > 2 * ALONG_CM {
                return None;
            }
            let across = r.sight.across(dx, dy).abs();
            let reach = ACROSS_CM + ((sigmas * i32::from(r.across_cm)) >> 4);
            let within = |times: i32| along <= times * ALONG_CM && across <= times * reach;
            within(2).then(|| (i, r, within(1)))
        })
    }

    /// Takes the first of what was seen of it, or nothing.
    fn follow(&mut self, r: Option<&Reflection>, passed: u16, in_view: impl Fn(i32, i32) -> bool) {
        let (x, y) = self.place_cm();
        if let Some(r) = r {
            (self.away, self.hidden) = (0, 0);
            self.place = (self.place.0 + r.x_cm - x, self.place.1 + r.y_cm - y);
            let (x, y) = self.place_cm();
            self.distance_cm = length(x, y);
        } else if !self.is_learnt() || in_view(x, y) {
            self.away = self.away.saturating_add(passed);
        } else {
            self.hidden = self.hidden.saturating_add(passed);
            self.away = self.away.saturating_add(self.hidden / HIDDEN);
            self.hidden %= HIDDEN;
        }
    }
}

impl<const N: usize> ClutterMap<N> {
    pub const fn new() -> Self {
        Self { list: Vec::new(), phase: Phase::START, turn: 0 }
    }

    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// Whose turn it is: one in [`TURNS`], and in as many frames all.
    fn next_turn(&mut self) -> core::ops::Range<usize> {
        let first = if self.turn < self.list.len() { self.turn } else { 0 };
        self.turn = first + self.list.len().div_ceil(TURNS);
        first..self.turn
    }

    /// Forgets what stays away; whose turn is next does not change by it.
    fn forget_what_went(&mut self) {
        let (mut place, mut before) = (0, 0);
        let turn = self.turn;
        self.list.retain(|fixture| {
            let stays = fixture.away < AWAY;
            before += usize::from(!stays && place < turn);
            place += 1;
            stays
        });
        self.turn = turn.saturating_sub(before);
    }
}

impl<const N: usize> Obstacles<N> {
    /// Which detections are of fixtures.
    pub(super) fn of_fixtures<const D: usize>(
        &self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        t: &TrackingParameters,
    ) -> Claimed<D> {
        let mut kept = Claimed::NONE;
        for fixture in self.fixtures.list.iter().filter(|f| f.is_learnt()) {
            fixture.around(reflections, by_range, t).filter(|seen| seen.2).for_each(|(i, ..)| kept.insert(i));
        }
        kept
    }

    /// Learns from detections that belong to no obstacle.
    pub(super) fn learn_fixtures<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        claimed: &Claimed<D>,
        step: Step,
        t: &TrackingParameters,
        in_view: impl Fn(i32, i32) -> bool,
    ) {
        let fixtures = &mut self.fixtures;
        let passed = u16::try_from(fixtures.phase.times(step, i32::from(SECOND))).unwrap_or(u16::MAX).min(MOST_PASSED);
        fixtures.phase = fixtures.phase.after(step);
        let turn = fixtures.next_turn();
        let mut known = *claimed;
        for (place, fixture) in fixtures.list.iter_mut().enumerate() {
            let mut seen = None;
            for (i, r, is_of_it) in fixture.around(reflections, by_range, t).filter(|(i, ..)| !claimed.contains(*i)) {
                known.insert(i);
                seen = seen.or(Some(r).filter(|_| is_of_it));
            }
            fixture.follow(seen, passed, &in_view);
            fixture.compared = fixture.compared.saturating_add(passed);
            if fixture.is_learnt() || !turn.contains(&place) {
                continue;
            }
            let since = core::mem::take(&mut fixture.compared);
            let (x, y) = fixture.place_cm();
            if !self.list.iter().any(|o| o.may_have_a_part_at(x, y, t)) {
                let known_for = fixture.known_for.saturating_add(since);
                fixture.known_for = if known_for < t.fixture_after { known_for } else { LEARNT };
            }
        }
        fixtures.forget_what_went();
        let new = reflections.iter().enumerate().filter(|(i, r)| stands(r) && !known.contains(*i));
        // of several detections of one thing the next frame knows all but the first
        let mut last = None;
        for (_, r) in new.take(if t.fixture_after > 0 { MOST_NEW } else { 0 }) {
            let is_of_last = |last: &Reflection| (last.x_cm - r.x_cm).abs() + (last.y_cm - r.y_cm).abs() < 2 * ALONG_CM;
            if !last.is_some_and(is_of_last) {
                // where there is no room it is not learnt
                let _ = fixtures.list.push(Reflector::new(r));
            }
            last = Some(r);
        }
    }
}

impl Obstacle {
    /// Whether what reflects at a place may be a part of it that its outline lacks.
    fn may_have_a_part_at(&self, x: i32, y: i32, t: &TrackingParameters) -> bool {
        let (along, left) = self.local(x, y);
        let near = left.abs() < PART_CM[0] && self.extent.beyond_cm(along) < PART_CM[1];
        near && self.existence >= t.confirmed && self.is_mover(t)
    }

    /// Whether it stands, shows one point alone, and that is as high as only wide or long vehicles are.
    pub(super) fn is_a_mast(&self, t: &TrackingParameters) -> bool {
        let point = self.extent.length_cm() < POINT.0 && self.spread < POINT.1;
        let stands = self.seen() && self.speed() < 2 * t.standing_speed;
        point && stands && self.tallness.is_tall() && !self.reflectivity.is_above(t.lorry_rcs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{PERIOD_S, car, change_speed, follow, rules, seen_at, tall};
    use super::super::profile::Extent;
    use super::*;
    use crate::fixed::trig::Direction;

    const MAST: (i32, i32) = (5000, 450);

    /// A mast's detection in the given frame, off its place by noise.
    fn mast(k: usize) -> Reflection {
        let noise = [0, 20, -15, 5, -20, 10][k % 6];
        seen_at(MAST.0 + noise / 2, MAST.1 + noise, 0)
    }

    fn step<const N: usize>(list: &mut Obstacles<N>, seen: &[Reflection], in_view: bool) {
        let t = rules();
        let step = Step::from_micros((PERIOD_S * 1e6) as u64);
        list.step(seen, &ByRange::<16>::sort(seen, t.limit_cm), step, &t, |_, _| in_view);
    }

    fn watch<const N: usize>(list: &mut Obstacles<N>, seconds: f64, seen: impl Fn(usize) -> Option<Reflection>) {
        for k in 0..(seconds / PERIOD_S) as usize {
            step(list, seen(k).as_slice(), true);
        }
    }

    fn is_fixture<const N: usize>(list: &Obstacles<N>, r: &Reflection) -> bool {
        let t = rules();
        list.of_fixtures(&[*r], &ByRange::<16>::sort(&[*r], t.limit_cm), &t).contains(0)
    }

    fn learnt() -> Obstacles<16> {
        let mut list = Obstacles::new();
        watch(&mut list, 32.0, |k| Some(mast(k)));
        assert!(is_fixture(&list, &mast(0)));
        list
    }

    #[test]
    fn what_reflects_at_its_place_for_half_a_minute_is_a_fixture() {
        let mut list = Obstacles::<16>::new();
        watch(&mut list, 28.0, |k| Some(mast(k)));
        assert!(!is_fixture(&list, &mast(0)));
        watch(&mut list, 3.0, |k| Some(mast(k)));
        assert!(is_fixture(&list, &mast(0)));
        let at = |dx, dy, v| is_fixture(&list, &seen_at(MAST.0 + dx, MAST.1 + dy, v));
        assert!(at(0, 0, 40) && at(0, 0, -40) && !at(0, 0, 60) && !at(0, 0, -60), "it does not move");
        // its range is measured better than its azimuth
        assert!(at(50, 0, 0) && !at(75, 0, 0) && at(0, 80, 0) && !at(0, 130, 0) && !at(0, -130, 0));
    }

    #[test]
    fn a_gap_counts_as_no_longer_than_it_is_and_than_a_second() {
        // seven frames and a gap, so many times; which of the eight it is
        let after_gaps = |seconds: u64, times: usize, which: usize| {
            let (mut list, t) = (Obstacles::<16>::new(), rules());
            for k in 0..8 * times {
                let gap = if k % 8 == which { seconds * 1_000_000 } else { 67_000 };
                let (seen, step) = ([mast(k)], Step::from_micros(gap));
                list.step(&seen, &ByRange::<16>::sort(&seen, t.limit_cm), step, &t, |_, _| true);
            }
            is_fixture(&list, &mast(0))
        };
        for which in 0..8 {
            // 12 x 1.5 s
            assert!(!after_gaps(1, 12, which) && !after_gaps(50, 12, which), "the gap is before frame {which}");
            assert!(after_gaps(1, 24, which), "35 s");
        }
    }

    #[test]
    fn what_comes_and_goes_before_it_in_the_list_changes_no_turns() {
        // others, each seen once at a place of its own, that are forgotten one by one
        let other = |k: usize| seen_at(2000 + 300 * k as i32, -2500, 0);
        for others in 40..48 {
            let mut list = Obstacles::<64>::new();
            (0..others).for_each(|k| step(&mut list, &[other(k)], true));
            watch(&mut list, 27.0, |k| Some(mast(k)));
            assert!(!is_fixture(&list, &mast(0)), "after 27 s behind {others} others");
            watch(&mut list, 5.0, |k| Some(mast(k)));
            assert!(is_fixture(&list, &mast(0)), "after 32 s behind {others} others");
        }
    }

    #[test]
    fn one_frame_in_five_is_enough_and_three_seconds_without_one_are_too_many() {
        let mut list = Obstacles::<16>::new();
        watch(&mut list, 32.0, |k| (k % 5 == 0).then(|| mast(k)));
        assert!(is_fixture(&list, &mast(0)));
        let mut list = Obstacles::<16>::new();
        for _ in 0..4 {
            watch(&mut list, 20.0, |k| Some(mast(k)));
            watch(&mut list, 3.2, |_| None);
        }
        assert!(!is_fixture(&list, &mast(0)), "it began anew each time");
    }

    #[test]
    fn it_is_forgotten_where_its_place_is_seen_free_and_stays_while_that_is_hidden() {
        let away = |seconds: f64, in_view: bool| {
            let mut list = learnt();
            (0..(seconds / PERIOD_S) as usize).for_each(|_| step(&mut list, &[], in_view));
            !is_fixture(&list, &mast(0))
        };
        assert!(!away(2.5, true) && away(3.5, true));
        assert!(!away(150.0, false) && away(230.0, false));
    }

    #[test]
    fn what_obstacles_claim_and_what_moves_teaches_nothing() {
        let mut list = Obstacles::<16>::new();
        let mut cars = [car([30.0, 3.0], [1.0, 0.0], 10.0)];
        follow(&mut list, &mut cars, 2.0, true);
        change_speed(&mut list, &mut cars, 0.0);
        follow(&mut list, &mut cars, 40.0, true);
        let seen: std::vec::Vec<Reflection> = cars[0].reflections();
        assert!(list.solids(&rules()).count() == 1 && seen.iter().all(|r| !is_fixture(&list, r)), "a car that stopped");
        let mut list = Obstacles::<16>::new();
        watch(&mut list, 40.0, |_| Some(seen_at(5000, 0, 90)));
        assert!(!is_fixture(&list, &seen_at(5000, 0, 0)), "what turns at its place");
    }

    #[test]
    fn what_may_be_a_part_of_a_vehicle_is_none() {
        let beside_a_car = |at: (i32, i32), change: fn(&mut Obstacle)| {
            let (t, mut list) = (rules(), Obstacles::<16>::new());
            let mut o = Obstacle::new(&seen_at(5000, 0, 0), Direction::AHEAD, 0);
            (o.existence, o.travelled_cm, o.hits) = (t.existence_max, 5000, 500);
            o.extent = Extent { rear_cm: -200, front_cm: 200 };
            change(&mut o);
            for _ in 0..(40.0 / PERIOD_S) as usize {
                list.list.clear();
                list.list.push(o.clone()).unwrap();
                let r = seen_at(at.0, at.1, 0);
                let none = Claimed::NONE;
                let sorted = ByRange::<16>::sort(&[r], t.limit_cm);
                list.learn_fixtures(&[r], &sorted, &none, Step::from_micros(67_000), &t, |_, _| true);
            }
            is_fixture(&list, &seen_at(at.0, at.1, 0))
        };
        assert!(!beside_a_car((6100, 0), |_| ()) && !beside_a_car((3900, 150), |_| ()));
        assert!(beside_a_car((6300, 0), |_| ()) && beside_a_car((3700, 0), |_| ()), "11 m beyond its ends");
        assert!(beside_a_car((5000, 250), |_| ()) && beside_a_car((5000, -250), |_| ()), "beside it");
        assert!(beside_a_car((5500, 0), |o| o.existence = 10), "perhaps there is none");
        assert!(beside_a_car((5500, 0), |o| o.travelled_cm = 0), "a fixture itself");
    }

    #[test]
    fn its_detections_belong_to_no_obstacle() {
        let cross = |mut list: Obstacles<16>| {
            // a lorry that stands beside it, seen but for its end there
            let t = rules();
            let mut o = Obstacle::new(&seen_at(4400, 350, 0), Direction::AHEAD, 0);
            (o.existence, o.travelled_cm) = (t.existence_max, 5000);
            o.extent = Extent { rear_cm: -400, front_cm: 400 };
            list.list.push(o).unwrap();
            let seen = [seen_at(4100, 350, 0), mast(0)];
            let sorted = ByRange::<16>::sort(&seen, t.limit_cm);
            let claimed = list.step(&seen, &sorted, Step::from_micros(67_000), &t, |_, _| true);
            [claimed.contains(0), claimed.contains(1)]
        };
        assert_eq!(cross(Obstacles::new()), [true, true]);
        assert_eq!(cross(learnt()), [true, false]);
    }

    #[test]
    fn what_is_learnt_outlasts_a_gap_and_no_reset() {
        let mut list = learnt();
        list.clear();
        assert!(is_fixture(&list, &mast(0)));
        list.forget_what_was_learnt();
        assert!(!is_fixture(&list, &mast(0)));
    }

    #[test]
    fn several_detections_of_one_thing_are_one_fixture_and_a_full_list_keeps_what_it_has() {
        let mut list = Obstacles::<2>::new();
        let places = [2000, 3000, 4000, 5000];
        for _ in 0..(35.0 / PERIOD_S) as usize {
            let seen = places.map(|x| [seen_at(x, 0, 0), seen_at(x + 30, 20, 0)]).as_flattened().to_vec();
            step(&mut list, &seen, true);
        }
        let fixtures = places.map(|x| is_fixture(&list, &seen_at(x, 0, 0)));
        assert_eq!(fixtures, [true, true, false, false]);
    }

    #[test]
    fn none_is_learnt_where_that_is_configured() {
        let t = TrackingParameters { fixture_after: 0, ..rules() };
        let (mut list, seen) = (Obstacles::<16>::new(), [mast(0)]);
        let sorted = ByRange::<16>::sort(&seen, t.limit_cm);
        for _ in 0..600 {
            list.step(&seen, &sorted, Step::from_micros(67_000), &t, |_, _| true);
        }
        assert!(!is_fixture(&list, &mast(0)));
    }

    #[test]
    fn what_stands_shows_one_point_and_is_as_high_as_a_van_is_a_mast() {
        let t = rules();
        let is_mast = |change: fn(&mut Obstacle)| {
            let mut o = Obstacle::new(&seen_at(5000, 0, 0), Direction::AHEAD, 0);
            o.absorb(&seen_at(5000, 0, 0), &t);
            (o.extent, o.spread, o.tallness) = (Extent { rear_cm: -20, front_cm: 20 }, 400, tall());
            change(&mut o);
            o.is_a_mast(&t)
        };
        assert!(is_mast(|_| ()));
        assert!(!is_mast(|o| o.extent.front_cm = 140), "its end is 1.6 m away");
        assert!(!is_mast(|o| o.spread = 4000), "it is 2 m wide");
        assert!(!is_mast(|o| o.tallness = crate::obstacles::tallness::Tallness::default()), "perhaps a car's corner");
        assert!(!is_mast(|o| (0..20).for_each(|_| o.reflectivity.add(40))), "it reflects as a lorry does");
        assert!(!is_mast(|o| o.velocity.0 = 200 << 8), "it moves");
        assert!(!is_mast(|o| o.gathered.count = 0), "nobody sees what it shows");
    }
}
