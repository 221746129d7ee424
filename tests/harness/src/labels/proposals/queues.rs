//! Vehicles in queues: streaks of one lane whose distance stays the same while they move.
//!
//! # Model
//! Vehicles pull away and brake one after the other, so that their distances change by metres; those of the ends and
//! wheels of one vehicle do not. Pairs of streaks are put together, the steadiest first, as long as all distances are
//! steady and the length is a vehicle's. What the tracker found of these vehicles before they came into the queue and
//! after they left it is theirs; what it made of the reflections of several of them is dropped.

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::lane::Lane;
use super::path::{Path, Queued};
use super::reflections::Instant;
use super::streaks::{STANDS_BELOW_MPS, Streak, streaks};

/// Longest vehicle, metres, noise included; longest one of which only the ends reflect.
const LONG_M: f64 = 19.0;
const SHORT_M: f64 = 6.6;
/// Longest part of a long vehicle that does not reflect, metres.
const VOID_M: f64 = 4.0;
/// How much the distance of two streaks of one vehicle changes while they move (root mean square), metres.
const STEADY_M: f64 = 0.4;
/// How much the distance of two streaks of one vehicle seems to change, metres.
const ALIKE_M: f64 = 0.2;
/// Farthest two streaks of one vehicle are apart on average when it is not sure that they move as one, metres.
const INSIDE_M: f64 = 0.5;
/// Fewest frames in which two streaks have to move together, and how far, metres.
const FRAMES: usize = 8;
const MOVED_M: f64 = 1.0;
/// A streak that ended is gone on with: standing after so long, moving after so long, seconds, so far away, metres.
const STANDS_S: f64 = 25.0;
const MOVES_S: f64 = 2.0;
const AWAY_M: f64 = 0.7;
/// A vehicle of a queue: its way, metres, reflections, and how many frames it is slower than this, m/s.
const WAY_M: f64 = 2.0;
const FEWEST: usize = 20;
const SLOW_MPS: f64 = 2.5;
const SLOW_FRAMES: usize = 15;
/// Share of its reflections that a vehicle of another lane has already from which on it is that one.
const TAKEN: f64 = 0.4;
/// How long after the beginning and before the end of the queue the tracker has to agree, frames, with how many
/// reflections and which share of them; within as many frames it goes on.
const AGREES: usize = 15;
const ALIKE: usize = 5;
const AGREE: f64 = 0.6;
/// Share of a path's reflections that have to be left for it to stay.
const LEFT: f64 = 0.5;

/// A vehicle: its reflections, each with how far ahead of the middle it lies.
struct Vehicle {
    lane: usize,
    members: Vec<((usize, usize), f64)>,
    first: usize,
    last: usize,
}

/// Paths with those of slow vehicles in lanes anew.
pub fn queued(paths: Vec<Path>, lanes: &[Arc<Lane>], instants: &mut [Instant]) -> Vec<Path> {
    let mut vehicles: Vec<Vehicle> = lanes
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, lane)| vehicles(k, joined(streaks(lane, instants), instants)))
        .collect();
    vehicles.sort_by_key(|v| std::cmp::Reverse(v.members.len()));
    // lanes overlap at crossings: what has most is right
    let mut owner: HashMap<(usize, usize), usize> = HashMap::new();
    let mut kept: Vec<Vehicle> = Vec::new();
    for mut v in vehicles {
        let before = v.members.len();
        v.members.retain(|(m, _)| !owner.contains_key(m));
        if (v.members.len() as f64) < (1.0 - TAKEN) * before as f64 {
            continue;
        }
        owner.extend(v.members.iter().map(|(m, _)| (*m, kept.len())));
        kept.push(v);
    }
    for ((frame, i), ahead_m) in kept.iter().flat_map(|v| &v.members) {
        instants[*frame].reflections[*i].ahead_m = Some(*ahead_m);
    }
    let mut all: Vec<Vec<(usize, usize)>> = kept.iter().map(|v| v.members.iter().map(|(m, _)| *m).collect()).collect();
    // what the tracker has before and after
    for (k, v) in kept.iter().enumerate() {
        for end in [End::First, End::Last] {
            let best = paths.iter().filter_map(|p| Some((end.goes_on(p, v, k, &owner)?, p))).max_by_key(|(n, _)| *n);
            let beyond = best.iter().flat_map(|(_, p)| end.beyond(p, v));
            let beyond: Vec<(usize, usize)> = beyond.filter(|m| !owner.contains_key(m)).collect();
            owner.extend(beyond.iter().map(|m| (*m, k)));
            all[k].extend(beyond);
        }
    }
    let instants = &*instants;
    let mut result: Vec<Path> = Vec::new();
    for path in paths {
        let left: Vec<(usize, usize)> = path.members.iter().copied().filter(|m| !owner.contains_key(m)).collect();
        if left.len() == path.members.len() {
            result.push(path);
        } else if left.len() as f64 >= LEFT * path.members.len() as f64 {
            result.extend(Path::new(left, path.lane.clone(), instants));
        }
    }
    let made = all.into_par_iter().zip(&kept).filter_map(|(members, v)| {
        let lane = lanes.get(v.lane)?;
        let queued = vec![Queued { frames: v.first..=v.last, lane: lane.clone() }];
        Path::in_queues(members, Some(lane.clone()), queued, instants)
    });
    result.extend(made.collect::<Vec<Path>>());
    result
}

/// An end of a vehicle's time in the queue.
#[derive(Clone, Copy)]
enum End {
    First,
    Last,
}

impl End {
    /// In how many reflections a path agrees with a vehicle at this end, if it does and goes on soon.
    fn goes_on(self, path: &Path, v: &Vehicle, k: usize, owner: &HashMap<(usize, usize), usize>) -> Option<usize> {
        if path.first > v.last || path.last() < v.first {
            return None;
        }
        let inside = |m: &&(usize, usize)| match self {
            Self::First => (v.first..=v.first + AGREES).contains(&m.0),
            Self::Last => m.0 <= v.last && m.0 + AGREES >= v.last,
        };
        let (all, own) = path
            .members
            .iter()
            .filter(inside)
            .fold((0, 0), |(all, own), m| (all + 1, own + usize::from(owner.get(m) == Some(&k))));
        let next = match self {
            Self::First => self.beyond(path, v).map(|m| v.first - m.0).min()?,
            Self::Last => self.beyond(path, v).map(|m| m.0 - v.last).min()?,
        };
        (own >= ALIKE && own as f64 >= AGREE * all as f64 && next <= AGREES).then_some(own)
    }

    /// A path's reflections before or after the queue.
    fn beyond<'a>(self, path: &'a Path, v: &'a Vehicle) -> impl Iterator<Item = (usize, usize)> + 'a {
        path.members.iter().copied().filter(move |m| match self {
            Self::First => m.0 < v.first,
            Self::Last => m.0 > v.last,
        })
    }
}

/// Streaks with those that go on after a gap.
fn joined(mut all: Vec<Streak>, instants: &[Instant]) -> Vec<Streak> {
    let time = |frame: usize| instants.get(frame).map_or(0.0, |i| i.time_s);
    loop {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (a, before) in all.iter().enumerate() {
            for (b, after) in all.iter().enumerate() {
                if after.first <= before.last() {
                    continue;
                }
                let gap_s = time(after.first) - time(before.last());
                let (Some([x, u]), Some([y, v])) = (before.along.last(), after.along.first()) else { continue };
                let stand = u.abs().max(v.abs()) < 1.5 * STANDS_BELOW_MPS;
                let off = if stand { y - x } else { y - x - 0.5 * (u + v) * gap_s };
                let within = if stand { AWAY_M } else { AWAY_M + 0.5 * gap_s };
                // what is seen shortly is no beginning or end of a long stop
                let lasts_s = (before.along.len().min(after.along.len())) as f64 * 0.067;
                let goes_on =
                    if stand { gap_s < STANDS_S.min(lasts_s) } else { gap_s < MOVES_S && (u - v).abs() < 2.0 };
                if goes_on && off.abs() < within {
                    pairs.push((off.abs() / within + gap_s / 10.0, a, b));
                }
            }
        }
        if pairs.is_empty() {
            return all;
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut parts: Vec<Option<Streak>> = all.into_iter().map(Some).collect();
        for (_, a, b) in pairs {
            if parts[a].is_none() || parts[b].is_none() {
                continue;
            }
            if let (Some(mut one), Some(other)) = (parts[a].take(), parts[b].take()) {
                let (Some([x, _]), Some([y, _])) = (one.along.last().copied(), other.along.first()) else { continue };
                let gap = other.first - one.last();
                for k in 1..gap {
                    let f = k as f64 / gap as f64;
                    one.along.push([x + f * (y - x), 0.0]);
                }
                one.along.extend(&other.along);
                one.members.extend(&other.members);
                one.beside = [0, 1].map(|k| one.beside[k] + other.beside[k]);
                parts.push(Some(one));
            }
        }
        all = parts.into_iter().flatten().collect();
    }
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

fn together(a: &Streak, b: &Streak) -> Option<Together> {
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
    Some(Together { ahead_m, changes_m, moved_m })
}

/// Vehicles of a lane's streaks.
fn vehicles(lane: usize, mut all: Vec<Streak>) -> Vec<Vehicle> {
    all.sort_by_key(|s| s.first);
    let n = all.len();
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    let mut known: HashMap<(usize, usize), Together> = HashMap::new();
    for a in 0..n {
        for b in a + 1..n {
            let Some(t) = together(&all[a], &all[b]) else { continue };
            known.insert((a, b), t);
            if let Some(changes_m) = t.changes_m.filter(|c| *c < STEADY_M) {
                pairs.push((changes_m + 0.3 / (1.0 + t.moved_m), a, b));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    // each streak's vehicle, and how far it is ahead of its first
    let mut of: Vec<(usize, f64)> = (0..n).map(|k| (k, 0.0)).collect();
    let mut groups: Vec<Vec<usize>> = (0..n).map(|k| vec![k]).collect();
    for (_, a, b) in pairs {
        let ((one, at_a), (other, at_b)) = (of[a], of[b]);
        if one == other {
            continue;
        }
        let shift = at_a + known[&(a, b)].ahead_m - at_b;
        let changes: Vec<f64> = groups[one]
            .iter()
            .flat_map(|i| groups[other].iter().map(move |j| (*i.min(j), *i.max(j))))
            .filter_map(|pair| known.get(&pair)?.changes_m)
            .collect();
        let fits = changes.iter().sum::<f64>() < STEADY_M * changes.len() as f64;
        if fits {
            for j in std::mem::take(&mut groups[other]) {
                of[j] = (one, of[j].1 + shift);
                groups[one].push(j);
            }
        }
    }
    // where traffic flows evenly all distances stay
    let near: Vec<f64> = known.values().filter(|t| t.ahead_m.abs() < 12.0).filter_map(|t| t.changes_m).collect();
    let uneven = (near.iter().filter(|c| **c > STEADY_M).count() as f64 / near.len().max(1) as f64 / 0.4).min(1.0);
    // what moves as one may be several that creep alike
    let mut single = Vec::new();
    for g in groups.iter_mut().filter(|g| !g.is_empty()) {
        g.sort_by(|i, j| of[*i].1.total_cmp(&of[*j].1));
        let places: Vec<f64> = g.iter().map(|k| of[*k].1).collect();
        let apart: Vec<f64> = (1..g.len())
            .map(|k| {
                let pairs = g[k.saturating_sub(3)..k]
                    .iter()
                    .flat_map(|i| g[k..(k + 3).min(g.len())].iter().map(move |j| (*i.min(j), *i.max(j))));
                let (sum, weight) = pairs
                    .filter_map(|p| {
                        let t = known.get(&p)?;
                        Some((t.changes_m?, t.moved_m))
                    })
                    .fold((0.0, 0.0), |(s, w), (c, m)| (s + c * m, w + m));
                let rigid = if weight > 0.0 {
                    let c = sum / weight;
                    if c > ALIKE_M { ((c - ALIKE_M) / 0.1).min(3.0) } else { (c - ALIKE_M) / 0.1 * 1.5 * uneven }
                } else {
                    0.0
                };
                inwards(&all[g[k]]) - inwards(&all[g[k - 1]]) + rigid
            })
            .collect();
        for (from, to) in cut(&places, &apart) {
            single.push(g[from..to].to_vec());
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); n];
    for g in single {
        let first = g[0];
        g.iter().for_each(|k| of[*k].0 = first);
        groups[first] = g;
    }
    // what stands all the time is of the vehicle that stands there
    for k in 0..n {
        if groups[k].len() != 1 || all[k].along.iter().any(|[x, _]| (x - all[k].along[0][0]).abs() > MOVED_M) {
            continue;
        }
        let holds = |g: &Vec<usize>| {
            let places: Vec<f64> = g
                .iter()
                .filter_map(|i| {
                    let t = known.get(&(*i.min(&k), *i.max(&k)))?;
                    Some(if *i < k { -t.ahead_m } else { t.ahead_m })
                })
                .collect();
            let (low, high) =
                places.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
            places.len() > 1 && low < INSIDE_M && high > -INSIDE_M
        };
        let Some(g) = (0..n).find(|g| groups[*g].len() > 1 && holds(&groups[*g])) else { continue };
        let Some((i, t)) = groups[g].iter().find_map(|i| Some((*i, known.get(&(*i.min(&k), *i.max(&k)))?))) else {
            continue;
        };
        of[k] = (g, of[i].1 + if i < k { t.ahead_m } else { -t.ahead_m });
        groups[k].clear();
        groups[g].push(k);
    }
    let groups = groups.into_iter().filter(|g| !g.is_empty());
    groups.filter_map(|g| vehicle(lane, &g, &all, &of)).collect()
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
        m => f64::from(u8::from(m < 9.5)) * 0.7 + f64::from(u8::from(void_m > 3.8)) * 0.5,
    }
}

/// Vehicles in a row of streaks that move as one, from where to where.
fn cut(places: &[f64], apart: &[f64]) -> Vec<(usize, usize)> {
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
                let near = if places[begin] - places[before] < 1.5 { 3.0 } else { 0.0 };
                apart[before] - near
            });
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

fn vehicle(lane: usize, group: &[usize], all: &[Streak], of: &[(usize, f64)]) -> Option<Vehicle> {
    let places = group.iter().map(|k| of[*k].1);
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let middle = 0.5 * (low + high);
    let on = |k: &usize| of[*k].1 - middle;
    let members: Vec<((usize, usize), f64)> =
        group.iter().flat_map(|k| all[*k].members.iter().map(move |m| (*m, on(k)))).collect();
    let along = || group.iter().flat_map(|k| all[*k].along.iter().map(move |[x, _]| x - on(k)));
    let (from, to) = along().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let slow = group.iter().map(|k| all[*k].along.iter().filter(|[_, v]| v.abs() < SLOW_MPS).count()).max()?;
    let first = members.iter().map(|(m, _)| m.0).min()?;
    let last = members.iter().map(|(m, _)| m.0).max()?;
    let enough = members.len() >= FEWEST && to - from >= WAY_M && slow >= SLOW_FRAMES;
    enough.then_some(Vehicle { lane, members, first, last })
}
