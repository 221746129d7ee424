//! Which reflections in a lane are of one vehicle: pieces that move as one are put together and cut anew.
//!
//! # Model
//! Vehicles that creep one behind the other move as one, and so do the pieces of a long one. Pieces of one lane with a
//! constant distance are laid side by side in a common frame, and their reflections counted along it. These heaps are
//! cut into as few vehicles as possible, each of a length that exists. Ends and wheels reflect: between the two
//! ends of a short vehicle may be nothing, along a long one there is something everywhere.

use super::path::Path;
use super::reflections::Instant;

/// Above this speed vehicles keep such distances that they are not taken for one, m/s.
const SLOW_MPS: f64 = 8.0;
/// Frames two pieces have to be seen together in.
const TOGETHER: usize = 8;
/// How much the distance of two pieces that move as one changes (one standard deviation), metres, and their speeds differ.
const WOBBLE_M: f64 = 0.9;
const SPEED_MPS: f64 = 0.5;
/// Pieces farther apart than this are two vehicles, metres.
const APART_M: f64 = 5.0;
/// Cells along the lane in which reflections are counted, metres.
const CELL_M: f64 = 0.5;
/// A cell with less than this share of the fullest one of its neighbourhood is empty; how far that reaches, cells.
const EMPTY: f64 = 0.08;
const NEIGHBOURHOOD: usize = 16;
/// Longest short vehicle, longest vehicle, metres: the extent of what reflects, noise included.
const SHORT_M: f64 = 6.6;
const LONG_M: f64 = 18.0;
/// Longest part of a long vehicle that does not reflect, metres.
const VOID_M: f64 = 2.5;

/// Paths of lanes, put together and cut anew; the others as they are.
pub fn assembled(paths: Vec<Path>, instants: &[Instant]) -> Vec<Path> {
    let convoys = convoys(&paths);
    let mut all = Vec::new();
    for convoy in convoys {
        match &convoy[..] {
            [(only, _)] if paths[*only].lane.is_none() || paths[*only].mean_speed() > SLOW_MPS => {
                all.push(paths[*only].clone());
            }
            _ => all.extend(vehicles(&paths, &convoy, instants)),
        }
    }
    all
}

/// Paths that move as one, each with how far it is ahead of the first, metres.
fn convoys(paths: &[Path]) -> Vec<Vec<(usize, f64)>> {
    let mut pairs: Vec<(f64, usize, usize, f64)> = Vec::new();
    for (a, first) in paths.iter().enumerate() {
        for (b, second) in paths.iter().enumerate().skip(a + 1) {
            if let Some((cost, ahead)) = rigid(first, second) {
                pairs.push((cost, a, b, ahead));
            }
        }
    }
    // the steadiest pairs first
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut of: Vec<(usize, f64)> = (0..paths.len()).map(|k| (k, 0.0)).collect();
    for (_, a, b, ahead) in pairs {
        let ((one, at_a), (other, at_b)) = (of[a], of[b]);
        if one != other {
            let shift = at_a + ahead - at_b;
            for (convoy, at) in of.iter_mut().filter(|(convoy, _)| *convoy == other) {
                (*convoy, *at) = (one, *at + shift);
            }
        }
    }
    let mut all: Vec<Vec<(usize, f64)>> = vec![Vec::new(); paths.len()];
    for (k, (convoy, at)) in of.into_iter().enumerate() {
        all[convoy].push((k, at));
    }
    all.retain(|convoy| !convoy.is_empty());
    all
}

/// How unsteady the distance of two paths in a lane is, and that distance; `None` if they do not move as one.
fn rigid(a: &Path, b: &Path) -> Option<(f64, f64)> {
    let (one, other) = (a.lane.as_ref()?, b.lane.as_ref()?);
    if !std::sync::Arc::ptr_eq(one, other) {
        return None;
    }
    if a.mean_speed().max(b.mean_speed()) > SLOW_MPS {
        return None;
    }
    let (begin, end) = (a.first.max(b.first), a.last().min(b.last()));
    let shorter = a.motions.len().min(b.motions.len());
    if end < begin || end - begin + 1 < TOGETHER.max(shorter / 2) {
        return None;
    }
    let (mut sum, mut squares, mut speeds) = (0.0, 0.0, 0.0_f64);
    for frame in begin..=end {
        let (m, n, (s, c)) = (a.at(frame)?, b.at(frame)?, a.heading_at(frame)?.sin_cos());
        let along = (n.place()[0] - m.place()[0]) * c + (n.place()[1] - m.place()[1]) * s;
        if along.abs() > LONG_M + 10.0 {
            return None;
        }
        (sum, squares) = (sum + along, squares + along * along);
        speeds += (n.velocity()[0] - m.velocity()[0]) * c + (n.velocity()[1] - m.velocity()[1]) * s;
    }
    let n = (end - begin + 1) as f64;
    let (ahead, speed) = (sum / n, speeds / n);
    let wobble = (squares / n - ahead * ahead).max(0.0).sqrt();
    let apart = (ahead + b.reach[0] - a.reach[1]).max(a.reach[0] - ahead - b.reach[1]);
    (wobble < WOBBLE_M && speed.abs() < SPEED_MPS && apart < APART_M).then_some((wobble + speed.abs(), ahead))
}

/// The vehicles of a convoy.
fn vehicles(paths: &[Path], convoy: &[(usize, f64)], instants: &[Instant]) -> Vec<Path> {
    // where each reflection is along the convoy
    let mut placed: Vec<((usize, usize), f64)> = Vec::new();
    for (k, ahead) in convoy {
        let path = &paths[*k];
        for (member, (frame, r)) in path.members.iter().zip(path.reflections(instants)) {
            if let Some([along, _]) = path.local(frame, r) {
                placed.push((*member, along + ahead));
            }
        }
    }
    let Some(lowest) = placed.iter().map(|p| p.1).min_by(f64::total_cmp) else { return Vec::new() };
    let cell = |along: f64| ((along - lowest) / CELL_M) as usize;
    let cells = placed.iter().map(|p| cell(p.1)).max().unwrap_or(0) + 1;
    let mut counts = vec![0_usize; cells];
    for (_, along) in &placed {
        counts[cell(*along)] += 1;
    }
    let lane = convoy.first().and_then(|(k, _)| paths[*k].lane.clone());
    let cuts = cut(&counts);
    let mut members: Vec<Vec<(usize, usize)>> = vec![Vec::new(); cuts.len()];
    for (member, along) in placed {
        // what lies between two vehicles is of the nearer
        let at = cell(along);
        let away = |(from, to): &(usize, usize)| from.saturating_sub(at).max(at.saturating_sub(*to));
        if let Some(k) = (0..cuts.len()).min_by_key(|k| away(&cuts[*k])) {
            members[k].push(member);
        }
    }
    members.into_iter().filter_map(|m| Path::new(m, lane.clone(), instants)).collect()
}

/// First and last cell of each vehicle: as few as possible.
fn cut(counts: &[usize]) -> Vec<(usize, usize)> {
    let full: Vec<usize> = (0..counts.len())
        .filter(|k| {
            let near = &counts[k.saturating_sub(NEIGHBOURHOOD)..(k + NEIGHBOURHOOD + 1).min(counts.len())];
            counts[*k] as f64 > EMPTY * near.iter().copied().max().unwrap_or(0) as f64
        })
        .collect();
    // fewest vehicles up to each full cell, and of these the ones with the least emptiness inside
    let mut best: Vec<(usize, usize, usize)> = vec![(0, 0, 0)];
    for end in 0..full.len() {
        let mut least: Option<(usize, usize, usize)> = None;
        let mut widest = 0;
        for begin in (0..=end).rev() {
            if begin < end {
                widest = widest.max(full[begin + 1] - full[begin] - 1);
            }
            let length_m = (full[end] - full[begin] + 1) as f64 * CELL_M;
            let possible = length_m <= SHORT_M || (length_m <= LONG_M && widest as f64 * CELL_M <= VOID_M);
            let (vehicles, empty, _) = best[begin];
            let candidate = (vehicles + 1, empty + (full[end] - full[begin]) - (end - begin), begin);
            if possible && least.is_none_or(|l| (candidate.0, candidate.1) < (l.0, l.1)) {
                least = Some(candidate);
            }
            if length_m > LONG_M {
                break;
            }
        }
        // one cell alone is always possible
        best.push(least.unwrap_or((best[end].0 + 1, best[end].1, end)));
    }
    let mut all = Vec::new();
    let mut end = full.len();
    while end > 0 {
        let begin = best[end].2;
        all.push((full[begin], full[end - 1]));
        end = begin;
    }
    all.reverse();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of heaps at these places, metres.
    fn counts(heaps_m: &[f64]) -> Vec<usize> {
        let cell = |m: f64| (m / CELL_M) as usize;
        let mut counts = vec![0; cell(heaps_m.iter().copied().fold(0.0, f64::max)) + 1];
        heaps_m.iter().for_each(|m| counts[cell(*m)] += 100);
        counts
    }

    #[test]
    fn two_cars_close_together_stay_two_and_a_truck_is_one() {
        // rear and front of two cars, 9 m from one to the next
        assert_eq!(cut(&counts(&[0.0, 4.0, 9.0, 13.0])), [(0, 8), (18, 26)]);
        // the ends and wheels of a truck
        let truck = [0.0, 1.0, 2.0, 5.0, 8.0, 11.0, 14.0, 15.0, 16.0];
        assert_eq!(cut(&counts(&truck)), [(0, 32)]);
        // and a car behind it
        let both: Vec<f64> = [0.0, 4.0].into_iter().chain(truck.map(|m| m + 9.0)).collect();
        assert_eq!(cut(&counts(&both)), [(0, 8), (18, 50)]);
        assert_eq!(cut(&[]), []);
    }

    #[test]
    fn what_is_thin_between_two_heaps_joins_nothing() {
        let mut counts = counts(&[0.0, 4.0, 9.0, 13.0]);
        (9..18).for_each(|k| counts[k] = 5);
        assert_eq!(cut(&counts).len(), 2);
    }
}
