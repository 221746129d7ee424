//! Which proposals drive the same way: they are shown together, and one key accepts them all.
//!
//! A line that lies on another for most of its length, in its direction, is of that way. Ways are taken in the order of
//! how many lie on them, so a lane comes before the one that changes to it.

use super::lane::Lane;
use crate::labels::tracks::{LabelPoint, LabelTrack};

/// How far beside a line another is of its way, metres: half a lane.
const BESIDE_M: f64 = 1.75;
/// How far before its start and after its end, metres: what is seen of a vehicle begins and ends anywhere.
const BEYOND_M: f64 = 30.0;
/// Share of its places that lie there.
const SHARE: f64 = 0.8;
/// Places of a line that are looked at.
const PLACES: usize = 24;
/// So many that are alone on their way are shown together.
const ALONE: u32 = 6;
/// Below this length a line has no direction, metres.
const DIRECTED_M: f64 = 4.0;

/// A place on a line, and the direction there.
type Place = ([f64; 2], [f64; 2]);

/// The number of each track's way, from 0; ways on which more lie come first. Cost: the square of the tracks' number,
/// 0.1 s for 300.
pub fn ways(tracks: &[&LabelTrack]) -> Vec<u32> {
    with_others(&apart(tracks))
}

/// The same, each that is alone on its way with a number of its own.
fn apart(tracks: &[&LabelTrack]) -> Vec<u32> {
    let lines: Vec<Line> = tracks.iter().map(|t| Line::of(&t.points)).collect();
    let on: Vec<Vec<usize>> =
        lines.iter().map(|way| (0..lines.len()).filter(|k| way.carries(&lines[*k])).collect()).collect();
    let mut way = vec![None; lines.len()];
    for number in 0.. {
        let free = |on: &[usize]| on.iter().filter(|k| way[**k].is_none()).count();
        // of ways that carry as many the first, which is the better proposal's
        let best = (0..lines.len()).filter(|k| way[*k].is_none()).max_by_key(|k| (free(&on[*k]), usize::MAX - k));
        let Some(best) = best else { break };
        way[best] = Some(number);
        for k in &on[best] {
            way[*k].get_or_insert(number);
        }
    }
    way.into_iter().flatten().collect()
}

/// The ways with those that are alone on their way put together, a few at a time.
fn with_others(ways: &[u32]) -> Vec<u32> {
    let of = |way: u32| ways.iter().filter(|w| **w == way).count();
    let first_alone = ways.iter().copied().filter(|way| of(*way) == 1).min();
    let mut alone = 0;
    let all = ways.iter().map(|way| match first_alone {
        // the ways of most come first, so those alone come last
        Some(first) if *way >= first => {
            alone += 1;
            first + (alone - 1) / ALONE
        }
        _ => *way,
    });
    all.collect()
}

/// Where a track goes, whenever that is.
struct Line {
    corners: Vec<[f64; 2]>,
    places: Vec<Place>,
    directed: bool,
}

impl Line {
    fn of(points: &[LabelPoint]) -> Self {
        let lane = Lane { points: points.iter().map(|p| [p.x_m, p.y_m]).collect(), straight: None };
        let length_m: f64 = lane.points.windows(2).map(|s| distance(s[0], s[1])).sum();
        // the last place is not beyond the end by rounding
        let along = |k: usize| length_m * k as f64 / (PLACES - 1) as f64 * (1.0 - 1e-9);
        let mut places: Vec<Place> = (0..PLACES).filter_map(|k| lane.at(along(k))).collect();
        if places.is_empty() {
            places.extend(lane.points.first().map(|place| (*place, [0.0; 2])));
        }
        Self { corners: lane.points, places, directed: length_m >= DIRECTED_M }
    }

    /// Whether another lies on this one.
    fn carries(&self, other: &Self) -> bool {
        let on = other.places.iter().filter(|place| self.has(place, other.directed)).count();
        on as f64 >= SHARE * other.places.len() as f64
    }

    fn has(&self, &(place, direction): &Place, directed: bool) -> bool {
        let last = self.corners.len().saturating_sub(2);
        // a place in a bend is beside several segments, and any of them may have its direction
        self.corners.windows(2).enumerate().any(|(k, segment)| {
            let length = distance(segment[0], segment[1]);
            if length < 1e-9 {
                return false;
            }
            let [c, s] = [0, 1].map(|i| (segment[1][i] - segment[0][i]) / length);
            let [dx, dy] = [0, 1].map(|i| place[i] - segment[0][i]);
            let (along, left) = (dx * c + dy * s, dy * c - dx * s);
            // bends leave gaps between the segments, which are as wide as the way
            let before = if k == 0 { BEYOND_M } else { BESIDE_M };
            let after = if k == last { BEYOND_M } else { BESIDE_M };
            left.abs() <= BESIDE_M
                && (-before..=length + after).contains(&along)
                && (!directed || direction[0] * c + direction[1] * s > 0.0)
        })
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(places: &[[f64; 2]]) -> LabelTrack {
        let points = places.iter().enumerate().map(|(k, [x, y])| [k as f64, *x, *y].into()).collect();
        LabelTrack { id: "a".into(), class: "car".into(), size_m: None, points }
    }

    fn of(all: &[LabelTrack]) -> Vec<u32> {
        apart(&all.iter().collect::<Vec<_>>())
    }

    #[test]
    fn lanes_directions_and_turns_are_ways_of_their_own() {
        let lane = track(&[[0.0, 0.0], [100.0, 0.0]]);
        let part = track(&[[20.0, 0.8], [60.0, 0.5]]);
        let before = track(&[[-20.0, 0.5], [60.0, 0.5]]);
        let far_before = track(&[[-200.0, 0.5], [-120.0, 0.5]]);
        let beside = track(&[[0.0, 3.5], [100.0, 3.5]]);
        let oncoming = track(&[[100.0, 0.5], [0.0, 0.5]]);
        let turning = track(&[[0.0, 0.0], [40.0, 0.0], [45.0, 5.0], [45.0, 60.0]]);
        let standing = track(&[[71.0, 0.2], [70.0, 0.0]]);
        let all = [lane, part, before, far_before, beside, oncoming, turning, standing];
        let ways = of(&all);
        assert_eq!(ways[..3], [0, 0, 0]);
        assert_eq!(ways[7], 0, "what hardly moves has no direction");
        let mut others = ways[3..7].to_vec();
        others.sort_unstable();
        assert_eq!(others, [1, 2, 3, 4], "{ways:?}");
    }

    #[test]
    fn the_way_of_most_comes_first_and_every_line_has_one() {
        let [a, b] = [0.0, 20.0].map(|y| move |from: f64| track(&[[from, y], [from + 50.0, y]]));
        assert_eq!(of(&[a(0.0), b(0.0), b(5.0), b(9.0)]), [1, 0, 0, 0]);
        assert_eq!(of(&[]), Vec::<u32>::new());
        // those that are alone are shown a few at a time
        assert_eq!(with_others(&[1, 0, 0, 2, 3, 4, 5, 6, 7]), [1, 0, 0, 1, 1, 1, 1, 1, 2]);
        assert_eq!(with_others(&[1, 0, 1, 0]), [1, 0, 1, 0]);
        // a line without a length is its own way, or lies on another
        assert_eq!(of(&[track(&[[5.0, 5.0], [5.0, 5.0]])]), [0]);
        assert_eq!(of(&[track(&[[5.0, 0.5], [5.0, 0.5]]), a(0.0)]), [0, 0]);
    }
}
