//! Which streaks of a lane are of one vehicle.
//!
//! # Model
//! Vehicles pull away and brake one after the other, so that their distances change by metres; those of the ends and
//! wheels of one vehicle do not. Pairs of streaks are put together, the steadiest first, as long as all distances are
//! steady. What is put together so may still be several vehicles that creep alike: a row of streaks is cut where
//! that makes the likeliest vehicles, by their lengths, by the voids in them, by how far distances change, and by
//! where reflections lie beside a streak, since beyond the ends of a vehicle nothing reflects.

use std::collections::HashMap;

use super::streaks::{STANDS_BELOW_MPS, Streak};

/// Longest vehicle, metres, noise included; longest one of which only the ends reflect.
const LONG_M: f64 = 19.0;
const SHORT_M: f64 = 6.6;
/// Longest part of a long vehicle that does not reflect, metres, and longest that is usual.
const VOID_M: f64 = 4.0;
const USUAL_VOID_M: f64 = 3.8;
/// How much the distance of two streaks of one vehicle changes at most while they move (root mean square), metres, and
/// how much it seems to.
const STEADY_M: f64 = 0.4;
const ALIKE_M: f64 = 0.2;
/// Streaks this close tell whether traffic flows evenly, metres: it does not if this share of their distances change.
const NEAR_M: f64 = 12.0;
const CHANGING: f64 = 0.4;
/// Streaks on either side of a cut whose distances count.
const BESIDE_CUT: usize = 3;
/// Two vehicles are seldom closer than this, metres.
const CLOSE_M: f64 = 1.5;
/// How far beyond the ends of a vehicle what stands inside it may seem to, metres.
const INSIDE_M: f64 = 0.5;
/// Fewest frames in which two streaks have to move together, and how far, metres.
const FRAMES: usize = 8;
const MOVED_M: f64 = 1.0;
/// A vehicle of a queue: its way, metres, reflections, and how many frames it is slower than this, m/s.
const WAY_M: f64 = 2.0;
const FEWEST: usize = 20;
const SLOW_MPS: f64 = 2.5;
const SLOW_FRAMES: usize = 15;

/// A vehicle: its reflections, each with how far ahead of the middle it lies.
pub struct Vehicle {
    pub members: Vec<((usize, usize), f64)>,
    pub first: usize,
    pub last: usize,
}

/// Streaks that move as one, each with how far it is ahead of one of them, metres.
type Group = Vec<(usize, f64)>;

/// Vehicles of a lane's streaks.
pub fn vehicles(mut all: Vec<Streak>) -> Vec<Vehicle> {
    all.sort_by_key(|s| s.first);
    let row = Row::new(&all);
    let mut groups: Vec<Group> = row.moving_as_one().into_iter().flat_map(|group| row.cut(group)).collect();
    groups.sort_by_key(|group| group.first().map(|(k, _)| *k));
    row.take_in_what_stands(&mut groups);
    groups.iter().filter_map(|group| row.vehicle(group)).collect()
}

/// How two streaks move together.
#[derive(Clone, Copy)]
struct Together {
    /// How far the second is ahead of the first, metres.
    ahead_m: f64,
    /// How much that changes while they move, metres; `None` if they do not.
    changes_m: Option<f64>,
    moved_m: f64,
}

impl Together {
    fn new(a: &Streak, b: &Streak) -> Option<Self> {
        let (begin, end) = (a.first.max(b.first), a.last().min(b.last()));
        if end < begin + FRAMES {
            return None;
        }
        let common: Vec<([f64; 2], [f64; 2])> = (begin..=end).filter_map(|f| Some((a.at(f)?, b.at(f)?))).collect();
        let ahead_m = common.iter().map(|(a, b)| b[0] - a[0]).sum::<f64>() / common.len() as f64;
        if ahead_m.abs() > LONG_M {
            return None;
        }
        let moving: Vec<f64> = common
            .iter()
            .filter(|(a, b)| a[1].abs().max(b[1].abs()) > STANDS_BELOW_MPS)
            .map(|(a, b)| (b[0] - a[0] - ahead_m).powi(2))
            .collect();
        let moved_m = (common.last()?.0[0] - common.first()?.0[0]).abs();
        let known = moving.len() >= FRAMES && moved_m >= MOVED_M;
        let changes_m = known.then(|| (moving.iter().sum::<f64>() / moving.len() as f64).sqrt());
        Some(Self { ahead_m, changes_m, moved_m })
    }
}

/// A lane's streaks and how each two of them move.
struct Row<'a> {
    all: &'a [Streak],
    known: HashMap<(usize, usize), Together>,
    /// How unevenly traffic flows, 0 to 1: where it flows evenly, all distances stay and tell nothing.
    uneven: f64,
}

impl<'a> Row<'a> {
    fn new(all: &'a [Streak]) -> Self {
        let pairs = (0..all.len()).flat_map(|a| (a + 1..all.len()).map(move |b| (a, b)));
        let known: HashMap<_, _> =
            pairs.filter_map(|(a, b)| Some(((a, b), Together::new(&all[a], &all[b])?))).collect();
        let near: Vec<f64> = known.values().filter(|t| t.ahead_m.abs() < NEAR_M).filter_map(|t| t.changes_m).collect();
        let changing = near.iter().filter(|c| **c > STEADY_M).count() as f64 / near.len().max(1) as f64;
        Self { all, known, uneven: (changing / CHANGING).min(1.0) }
    }

    fn together(&self, a: usize, b: usize) -> Option<&Together> {
        self.known.get(&(a.min(b), a.max(b)))
    }

    /// How far one is ahead of another, metres.
    fn ahead_m(&self, of: usize, one: usize) -> Option<f64> {
        let t = self.together(of, one)?;
        Some(if of < one { t.ahead_m } else { -t.ahead_m })
    }

    /// Streaks whose distances are steady, the steadiest put together first.
    fn moving_as_one(&self) -> Vec<Group> {
        let mut pairs: Vec<(f64, usize, usize)> = self
            .known
            .iter()
            .filter_map(|((a, b), t)| Some((t.changes_m.filter(|c| *c < STEADY_M)? + 0.3 / (1.0 + t.moved_m), *a, *b)))
            .collect();
        pairs.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let mut group_of: Vec<usize> = (0..self.all.len()).collect();
        let mut groups: Vec<Group> = (0..self.all.len()).map(|k| vec![(k, 0.0)]).collect();
        for (_, a, b) in pairs {
            let (one, other) = (group_of[a], group_of[b]);
            if one == other {
                continue;
            }
            let changes: Vec<f64> = groups[one]
                .iter()
                .flat_map(|(i, _)| groups[other].iter().filter_map(|(j, _)| self.together(*i, *j)?.changes_m))
                .collect();
            if changes.iter().sum::<f64>() >= STEADY_M * changes.len() as f64 {
                continue;
            }
            let place = |group: &Group, k: usize| group.iter().find(|(i, _)| *i == k).map_or(0.0, |(_, at)| *at);
            let ahead_m = self.ahead_m(a, b).unwrap_or(0.0);
            let shift = place(&groups[one], a) + ahead_m - place(&groups[other], b);
            for (j, at) in std::mem::take(&mut groups[other]) {
                group_of[j] = one;
                groups[one].push((j, at + shift));
            }
        }
        groups.retain(|group| !group.is_empty());
        groups
    }

    /// The likeliest vehicles of a row of streaks that move as one.
    fn cut(&self, mut group: Group) -> Vec<Group> {
        group.sort_by(|i, j| i.1.total_cmp(&j.1));
        let places: Vec<f64> = group.iter().map(|(_, at)| *at).collect();
        let apart: Vec<f64> = (1..group.len())
            .map(|k| {
                let [behind, ahead] = [group[k - 1].0, group[k].0];
                inwards(&self.all[ahead]) - inwards(&self.all[behind]) + self.loosely(&group, k)
            })
            .collect();
        cuts(&places, &apart).into_iter().map(|(from, to)| group[from..to].to_vec()).collect()
    }

    /// How much the distances over a place in a row change, negative where they do not.
    fn loosely(&self, group: &Group, k: usize) -> f64 {
        let behind = &group[k.saturating_sub(BESIDE_CUT)..k];
        let ahead = &group[k..(k + BESIDE_CUT).min(group.len())];
        let pairs = behind.iter().flat_map(|(i, _)| ahead.iter().filter_map(|(j, _)| self.together(*i, *j)));
        let (sum, moved_m) = pairs
            .filter_map(|t| Some((t.changes_m?, t.moved_m)))
            .fold((0.0, 0.0), |(sum, all), (changes, moved)| (sum + changes * moved, all + moved));
        if moved_m == 0.0 {
            return 0.0;
        }
        let over = (sum / moved_m - ALIKE_M) / 0.1;
        if over > 0.0 { over.min(3.0) } else { 1.5 * over * self.uneven }
    }

    /// What stands all the time is of the vehicle that stands there.
    fn take_in_what_stands(&self, groups: &mut Vec<Group>) {
        let stands = |streak: &Streak| {
            let begin = streak.along.first().map_or(0.0, |[x, _]| *x);
            streak.along.iter().all(|[x, _]| (x - begin).abs() <= MOVED_M)
        };
        for k in (0..self.all.len()).filter(|k| stands(&self.all[*k])) {
            let Some(own) = groups.iter().position(|group| matches!(group[..], [(only, _)] if only == k)) else {
                continue;
            };
            let holds = |group: &&mut Group| {
                let ahead = || group.iter().filter_map(|(i, _)| self.ahead_m(k, *i));
                let (low, high) = ahead().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
                group.len() > 1 && ahead().count() > 1 && low < INSIDE_M && high > -INSIDE_M
            };
            let Some(group) = groups.iter_mut().find(holds) else { continue };
            let Some(at) = group.iter().find_map(|(i, at)| Some(at + self.ahead_m(*i, k)?)) else { continue };
            group.push((k, at));
            groups.remove(own);
        }
    }

    /// Its vehicle, if it has reflections and a way and is slow for a time.
    fn vehicle(&self, group: &Group) -> Option<Vehicle> {
        let (low, high) = range(group.iter().map(|(_, at)| *at));
        let middle = 0.5 * (low + high);
        let streaks = || group.iter().filter_map(|(k, at)| Some((self.all.get(*k)?, at - middle)));
        let members: Vec<((usize, usize), f64)> =
            streaks().flat_map(|(streak, on)| streak.members.iter().map(move |m| (*m, on))).collect();
        let (from, to) = range(streaks().flat_map(|(streak, on)| streak.along.iter().map(move |[x, _]| x - on)));
        let slow = |streak: &Streak| streak.along.iter().filter(|[_, v]| v.abs() < SLOW_MPS).count();
        let slow = streaks().map(|(streak, _)| slow(streak)).max()?;
        let first = members.iter().map(|(m, _)| m.0).min()?;
        let last = members.iter().map(|(m, _)| m.0).max()?;
        let enough = members.len() >= FEWEST && to - from >= WAY_M && slow >= SLOW_FRAMES;
        enough.then_some(Vehicle { members, first, last })
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// How much a streak looks like a rear, 1, or a front, -1: nothing reflects beyond the ends of a vehicle.
fn inwards(streak: &Streak) -> f64 {
    let [behind, ahead] = streak.beside.map(|n| n as f64);
    (ahead - behind) / (ahead + behind + 5.0 + 0.05 * streak.along.len() as f64)
}

/// How unlikely it is that what reflects of a vehicle is so long, with such a void in it; infinite where it cannot be.
fn unlikely(length_m: f64, void_m: f64) -> f64 {
    match length_m {
        m if m < 1.2 => 2.5,
        m if m < 3.3 => 2.0,
        m if m < 5.4 => 0.0,
        m if m <= SHORT_M => 0.2,
        m if m > LONG_M || void_m > VOID_M => f64::INFINITY,
        m => f64::from(u8::from(m < 9.5)) * 0.7 + f64::from(u8::from(void_m > USUAL_VOID_M)) * 0.5,
    }
}

/// Vehicles in a row of streaks, from where to where: places along the row, and between each two how much speaks for a cut.
fn cuts(places: &[f64], apart: &[f64]) -> Vec<(usize, usize)> {
    // best up to each streak: how good, and where its last vehicle begins
    let mut best: Vec<(f64, usize)> = vec![(0.0, 0)];
    for end in 0..places.len() {
        let mut most = (f64::NEG_INFINITY, end);
        let (mut inside, mut void_m) = (0.0, 0.0_f64);
        for begin in (0..=end).rev() {
            if begin < end {
                inside -= apart[begin];
                void_m = void_m.max(places[begin + 1] - places[begin]);
            }
            let length_m = places[end] - places[begin];
            if length_m > LONG_M {
                break;
            }
            let between = begin.checked_sub(1).map_or(0.0, |before| {
                let close = if places[begin] - places[before] < CLOSE_M { 3.0 } else { 0.0 };
                apart[before] - close
            });
            // and fewer are likelier than more
            let good = best[begin].0 + inside + between - unlikely(length_m, void_m) - 0.2;
            if good > most.0 {
                most = (good, begin);
            }
        }
        best.push(most);
    }
    let mut all = Vec::new();
    let mut end = places.len();
    while end > 0 {
        let begin = best[end].1;
        all.push((begin, end));
        end = begin;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A streak from frame 0 on that is so far ahead, with a reflection a frame; `way(s)` is how far it has come.
    fn streak(frame_of: usize, ahead_m: f64, beside: [usize; 2], way: impl Fn(f64) -> f64) -> Streak {
        let place = |k: usize| ahead_m + way(k as f64 * 0.1);
        let along = (0..200).map(|k| [place(k), (place(k + 1) - place(k)) / 0.1]).collect();
        Streak { members: (0..200).map(|k| (k, frame_of)).collect(), first: 0, along, beside }
    }

    /// Pulls away at that second and drives 6 m/s after three more.
    fn pulls_away(at_s: f64) -> impl Fn(f64) -> f64 {
        move |s| {
            let since = (s - at_s).max(0.0);
            since.min(3.0).powi(2) + 6.0 * (since - 3.0).max(0.0)
        }
    }

    /// Rear and front of three cars 4 m long and 2.5 m apart, which pull away so many seconds after one another.
    fn queue(delay_s: f64) -> Vec<Streak> {
        let ends = (0..3).flat_map(|car| [(car, 0.0, [0, 40]), (car, 4.0, [40, 0])]);
        let streaks = ends.enumerate().map(|(k, (car, on, beside))| {
            streak(k, 6.5 * car as f64 + on, beside, pulls_away(5.0 - delay_s * car as f64))
        });
        streaks.collect()
    }

    /// Streaks of each vehicle, from the hindmost on.
    fn found(all: Vec<Streak>) -> Vec<Vec<usize>> {
        let mut all: Vec<Vec<usize>> = vehicles(all)
            .into_iter()
            .map(|v| {
                let mut own: Vec<usize> = v.members.iter().map(|((_, of), _)| *of).collect();
                own.sort_unstable();
                own.dedup();
                own
            })
            .collect();
        all.sort();
        all
    }

    #[test]
    fn ends_of_one_car_are_one_and_not_the_front_of_one_and_the_rear_of_the_next() {
        assert_eq!(found(queue(1.5)), [[0, 1], [2, 3], [4, 5]]);
    }

    #[test]
    fn cars_that_creep_alike_are_told_by_what_reflects_beside_their_ends() {
        assert_eq!(found(queue(0.0)), [[0, 1], [2, 3], [4, 5]]);
    }

    #[test]
    fn a_lorry_is_one_by_the_wheels_between_its_ends_and_its_reflections_know_its_middle() {
        let places = [0.0, 3.5, 7.0, 10.5, 14.0];
        let beside = [[0, 40], [30, 30], [30, 30], [30, 30], [40, 0]];
        let all = places.iter().zip(beside).enumerate();
        let lorry: Vec<Streak> = all.map(|(k, (at, beside))| streak(k, *at, beside, pulls_away(5.0))).collect();
        assert_eq!(found(lorry.clone()), [[0, 1, 2, 3, 4]]);
        let vehicle = vehicles(lorry).remove(0);
        for ((_, k), ahead_m) in vehicle.members {
            assert!((ahead_m - (places[k] - 7.0)).abs() < 0.1, "{k}: {ahead_m} m ahead of the middle");
        }
    }

    #[test]
    fn what_never_moves_is_no_vehicle_and_what_stands_between_the_ends_of_one_is_its() {
        let stands = |_: f64| 0.0;
        assert_eq!(
            found(vec![streak(0, 0.0, [0, 0], stands), streak(1, 4.0, [0, 0], stands)]),
            Vec::<Vec<usize>>::new()
        );
        let mut all = queue(1.5);
        // seen only while the second car stands, in its middle
        let mut inside = streak(6, 8.5, [5, 5], stands);
        inside.along.truncate(30);
        inside.members.truncate(30);
        all.push(inside);
        assert_eq!(found(all), [vec![0, 1], vec![2, 3, 6], vec![4, 5]]);
    }

    #[test]
    fn rows_are_cut_into_vehicles_of_likely_lengths() {
        // 4 m, a gap of 3 m, 4 m
        assert_eq!(cuts(&[0.0, 4.0, 7.0, 11.0], &[0.0; 3]), [(2, 4), (0, 2)]);
        // nothing is longer than a lorry
        let long: Vec<f64> = (0..12).map(|k| 3.0 * f64::from(k)).collect();
        assert!(cuts(&long, &[-1.0; 11]).iter().all(|(from, to)| long[to - 1] - long[*from] <= LONG_M));
        assert_eq!(cuts(&[], &[]), []);
    }
}
