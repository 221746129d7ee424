//! Tracklets to paths: what both directions of time found, pieces of one long vehicle, pieces before and after a gap.

use std::collections::HashMap;
use std::sync::Arc;

use super::lane::Lane;
use super::pairs;
use super::path::Path;
use super::reflections::Instant;
use super::tracker::{LONGEST_M, Tracklet};

/// Share of the smaller tracklet's reflections that two tracklets of one road user have in common.
const COMMON: f64 = 0.3;
/// Longest gap in which something that moves is followed, seconds.
const GAP_S: f64 = 10.0;
/// Longest gap in which it may have changed lanes, seconds, and how far that is at most, metres.
const CHANGES_S: f64 = 3.0;
const LANE_M: f64 = 4.2;
/// Share of the shorter path's time in which both may be seen, and how far apart they are then, metres.
const OVER_SHARE: f64 = 0.35;
const OVER_M: f64 = 1.5;
/// Frames of an overlap that is no more than a gap is.
const SHORT: usize = 8;
/// Longest gap in a turn, seconds, and speed at most, m/s.
const TURN_GAP_S: f64 = 5.0;
const TURN_MPS: f64 = 10.0;
/// Longest gap in which something that stands is waited for, seconds.
const STANDING_GAP_S: f64 = 90.0;
/// Speed below which vehicles may keep so close together that they look like one, m/s.
const SLOW_MPS: f64 = 8.0;
/// Cars are not higher than this, metres.
const LOW_M: f64 = 1.8;
/// Nor longer than this.
const CAR_M: f64 = 6.0;
/// Frames two pieces have to be seen together in.
const TOGETHER: usize = 8;

/// Tracklets of both directions: a backward one adds what was before and after the forward one it shares most with.
pub fn both_ways(forward: &[Tracklet], backward: &[Tracklet]) -> Vec<Tracklet> {
    let mut owner: HashMap<(usize, usize), usize> = HashMap::new();
    for (k, t) in forward.iter().enumerate() {
        owner.extend(t.members.iter().map(|m| (*m, k)));
    }
    // pairs by what they share
    let mut pairs = Vec::new();
    for (b, t) in backward.iter().enumerate() {
        let mut shared: HashMap<usize, usize> = HashMap::new();
        for f in t.members.iter().filter_map(|m| owner.get(m)) {
            *shared.entry(*f).or_default() += 1;
        }
        pairs.extend(shared.into_iter().map(|(f, n)| (n, f, b)));
    }
    pairs.sort_unstable_by(|a, b| b.cmp(a));
    let mut all: Vec<Tracklet> = forward.to_vec();
    let (mut taken_f, mut taken_b) = (vec![false; forward.len()], vec![false; backward.len()]);
    for (n, f, b) in pairs {
        let enough = n as f64 >= COMMON * forward[f].members.len().min(backward[b].members.len()) as f64;
        let other_lane = forward[f].lane.zip(backward[b].lane).is_some_and(|(f, b)| f != b);
        if taken_f[f] || taken_b[b] || !enough || other_lane {
            continue;
        }
        (taken_f[f], taken_b[b]) = (true, true);
        let frames = forward[f].members.iter().map(|m| m.0);
        let (Some(first), Some(last)) = (frames.clone().min(), frames.max()) else { continue };
        let beyond = backward[b].members.iter().filter(|m| m.0 < first || m.0 > last);
        let beyond: Vec<(usize, usize)> = beyond.copied().filter(|m| !owner.contains_key(m)).collect();
        owner.extend(beyond.iter().map(|m| (*m, f)));
        all[f].members.extend(beyond);
    }
    // what only the backward direction found
    for (b, t) in backward.iter().enumerate().filter(|(b, _)| !taken_b[*b]) {
        let own: Vec<(usize, usize)> = t.members.iter().copied().filter(|m| !owner.contains_key(m)).collect();
        if own.len() * 2 > backward[b].members.len() {
            all.push(Tracklet { members: own, lane: t.lane });
        }
    }
    all
}

/// Joins pieces of one vehicle that are seen at the same time and move as one.
pub fn abreast(paths: Vec<Path>, instants: &[Instant]) -> Vec<Path> {
    let rigid = |(a, first): (usize, &Path), (b, second): (usize, &Path)| (a < b).then(|| rigid(first, second))?;
    pairs::joined(paths, rigid, |first, second| one(first, second, instants))
}

/// Joins pieces before and after a gap.
pub fn through_gaps(paths: Vec<Path>, instants: &[Instant]) -> Vec<Path> {
    let follows = |(_, before): (usize, &Path), (_, after): (usize, &Path)| follows(before, after);
    pairs::joined(paths, follows, |first, second| one(first, second, instants))
}

/// The path of two pieces.
fn one(first: Path, second: Path, instants: &[Instant]) -> Option<Path> {
    let lane = common(&first, &second);
    let members = [first.members, second.members].concat();
    let queued = [first.queued, second.queued].concat();
    Path::in_queues(members, lane, queued, instants)
}

/// How little two paths look like pieces of one vehicle; `None` where they are not.
fn rigid(a: &Path, b: &Path) -> Option<f64> {
    let (begin, end) = (a.first.max(b.first), a.last().min(b.last()));
    let shorter = a.motions.len().min(b.motions.len());
    if end < begin || end - begin + 1 < TOGETHER.max(shorter / 2) {
        return None;
    }
    if differ(a, b) || (a.lane.is_some() && b.lane.is_some() && a.mean_speed().max(b.mean_speed()) < SLOW_MPS) {
        return None;
    }
    let (mut along, mut left, mut speeds) = (Vec::new(), Vec::new(), 0.0_f64);
    for frame in begin..=end {
        let (m, n, (s, c)) = (a.at(frame)?, b.at(frame)?, a.heading_at(frame)?.sin_cos());
        let [dx, dy] = [n.place()[0] - m.place()[0], n.place()[1] - m.place()[1]];
        if dx.hypot(dy) > LONGEST_M + 5.0 {
            return None;
        }
        along.push(dx * c + dy * s);
        left.push(-dx * s + dy * c);
        let [vx, vy] = [n.velocity()[0] - m.velocity()[0], n.velocity()[1] - m.velocity()[1]];
        speeds += vx * c + vy * s;
    }
    let n = along.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (shift, side, speed) = (mean(&along), mean(&left), speeds / n);
    let wobble = (along.iter().map(|v| (v - shift).powi(2)).sum::<f64>() / n).sqrt();
    let reach = [a.reach[0].min(shift + b.reach[0]), a.reach[1].max(shift + b.reach[1])];
    let apart = (shift + b.reach[0] - a.reach[1]).max(a.reach[0] - shift - b.reach[1]);
    // two cars, or a truck and a car behind it: one of the two is low
    let long = reach[1] - reach[0] > CAR_M && a.mean_speed().min(b.mean_speed()) < SLOW_MPS;
    if long && a.top_m.min(b.top_m) < LOW_M {
        return None;
    }
    let one = side.abs() < if apart < 0.0 { 2.0 } else { 1.4 }
        && speed.abs() < 0.6
        && wobble < 1.0
        && reach[1] - reach[0] < LONGEST_M
        && apart < 6.0;
    one.then_some(side.abs() + speed.abs() + wobble + apart.max(0.0) / 6.0)
}

/// How badly one path goes on as another; `None` where it does not.
fn follows(before: &Path, after: &Path) -> Option<f64> {
    if after.last() <= before.last() || after.first <= before.first {
        return None;
    }
    let fast = before.motions.last()?.1.speed().max(after.motions.first()?.1.speed()) > TURN_MPS;
    if after.first <= before.last() && !fast {
        let over = overlaps(before, after);
        if over.is_some() || after.first + SHORT < before.last() {
            return over;
        }
    }
    let (from_s, from) = before.motions.last()?;
    let (to_s, to) = after.motions.first()?;
    let gap_s = to_s - from_s;
    if !(-0.5..=STANDING_GAP_S).contains(&gap_s) {
        return None;
    }
    let way = [0, 1].map(|k| to.place()[k] - from.place()[k]);
    let (u, v) = (from.velocity(), to.velocity());
    let mean = [0, 1].map(|k| 0.5 * (u[k] + v[k]));
    let distance = way[0].hypot(way[1]);
    if gap_s > 0.7 && distance < 4.0 && from.speed().min(to.speed()) < 2.0 && from.speed().max(to.speed()) < 4.0 {
        return Some(distance / 2.0 + gap_s / 60.0);
    }
    let change = (v[0] - u[0]).hypot(v[1] - u[1]);
    if gap_s > GAP_S || change > 2.0 + 1.5 * gap_s.max(0.0) {
        return turns(way, u, v, gap_s);
    }
    let speed = mean[0].hypot(mean[1]);
    let [c, s] = if speed > 1.0 { mean.map(|v| v / speed) } else { [1.0, 0.0] };
    let rest = [0, 1].map(|k| way[k] - mean[k] * gap_s);
    let (along, left) = (rest[0] * c + rest[1] * s, -rest[0] * s + rest[1] * c);
    let wait = gap_s.abs();
    let length = (before.reach[1] - before.reach[0]).max(after.reach[1] - after.reach[0]).clamp(0.0, 10.0);
    // changing lanes it moved to the side
    let side = if differ(before, after) && gap_s.abs() < CHANGES_S { LANE_M } else { 0.0 };
    let left = (left.abs() - side).max(0.0) + if side > 0.0 { 0.3 } else { 0.0 };
    let (along, left) =
        (along.abs() / (2.0 + 0.5 * length + 0.08 * speed * wait + 0.3 * wait), left.abs() / (1.2 + 0.3 * wait));
    (along < 1.0 && left < 1.0).then_some(along + left + wait / 5.0)
}

/// How badly a turn explains a gap: half of the time with each velocity.
fn turns(way: [f64; 2], u: [f64; 2], v: [f64; 2], gap_s: f64) -> Option<f64> {
    let [before, after] = [u, v].map(|v| v[0].hypot(v[1]));
    let turned = u[0] * v[0] + u[1] * v[1] > -0.3 * before * after;
    if !(-0.5..=TURN_GAP_S).contains(&gap_s) || before.max(after) > TURN_MPS || !turned {
        return None;
    }
    let rest = [0, 1].map(|k| way[k] - 0.5 * (u[k] + v[k]) * gap_s);
    let wrong = rest[0].hypot(rest[1]) / (2.0 + gap_s.abs());
    (wrong < 1.0).then_some(1.0 + wrong + gap_s.abs() / 5.0)
}

/// How far two paths are apart while one goes over into the other; `None` where they are not one.
fn overlaps(before: &Path, after: &Path) -> Option<f64> {
    let frames = after.first..=before.last();
    let shorter = before.motions.len().min(after.motions.len());
    let common = before.last() + 1 - after.first;
    if common as f64 > OVER_SHARE * shorter as f64 {
        return None;
    }
    let length_m = (before.reach[1] - before.reach[0]).max(after.reach[1] - after.reach[0]).clamp(0.0, LONGEST_M);
    let mut away_m = 0.0;
    // changing lanes it moved to the side
    let side = if differ(before, after) { LANE_M } else { 0.0 };
    for frame in frames {
        let ([a, b], [x, y], (s, c)) =
            (before.at(frame)?.place(), after.at(frame)?.place(), after.heading_at(frame)?.sin_cos());
        let (along, left) = ((a - x) * c + (b - y) * s, (b - y) * c - (a - x) * s);
        away_m += along.hypot((left.abs() - side).max(0.0)) / common as f64;
    }
    (away_m < OVER_M + 0.3 * length_m).then_some(away_m / (OVER_M + 0.3 * length_m))
}

/// Whether they keep to different lanes.
fn differ(a: &Path, b: &Path) -> bool {
    a.lane.as_ref().zip(b.lane.as_ref()).is_some_and(|(a, b)| !Arc::ptr_eq(a, b))
}

/// The lane of both; none if they differ.
fn common(a: &Path, b: &Path) -> Option<Arc<Lane>> {
    if differ(a, b) { None } else { a.lane.clone().or_else(|| b.lane.clone()) }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::*;

    /// A path along x from a frame on, ten frames a second.
    fn path(first: usize, frames: usize, speed: f64, left_m: f64) -> Path {
        let motion = |frame: usize| {
            let t = frame as f64 * 0.1;
            (t, Motion::new([speed * t, left_m], [speed, 0.0], 0.1, [1.0, 0.0], [0.1; 2]))
        };
        let motions: Vec<(f64, Motion)> = (first..first + frames).map(motion).collect();
        let headings_rad = vec![0.0; frames];
        Path {
            members: vec![(first, 0)],
            first,
            motions,
            headings_rad,
            reach: [-2.0, 2.0],
            top_m: 1.5,
            lane: None,
            queued: Vec::new(),
        }
    }

    #[test]
    fn pieces_that_overlap_for_a_while_in_one_place_are_one_and_neighbours_are_not() {
        let before = path(0, 60, 3.0, 0.0);
        assert!(follows(&before, &path(45, 60, 3.0, 0.8)).is_some());
        assert_eq!(follows(&before, &path(45, 60, 3.0, 3.5)), None);
        // most of the time beside one another: two vehicles, or pieces of a long one
        assert_eq!(follows(&before, &path(20, 60, 3.0, 0.8)), None);
    }

    #[test]
    fn a_turn_joins_what_comes_with_what_leaves_where_it_may_get_to() {
        let (east, north) = ([6.0, 0.0], [0.0, 6.0]);
        assert!(turns([6.0, 6.0], east, north, 2.0).is_some());
        assert_eq!(turns([-6.0, 6.0], east, north, 2.0), None);
        assert_eq!(turns([6.0, 6.0], east, [-6.0, 0.0], 2.0), None);
        assert_eq!(turns([18.0, 18.0], east, north, 6.0), None);
        assert_eq!(turns([20.0, 20.0], [20.0, 0.0], [0.0, 20.0], 2.0), None);
    }
}
