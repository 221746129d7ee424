//! Where a slow vehicle was before it was first seen, and is after it was last seen: behind whom it drives.
//!
//! # Model
//! In a lane each drives as the one ahead did, a little later and some metres behind (Newell, "A simplified car-following
//! theory", 2002): with `d` the place of the one ahead that much earlier, from the vehicle on, when it is first seen,
//!
//! ```text
//!   place(t) = place of the one ahead(t - LATER_S) - d
//! ```
//!
//! and the other way round for the one behind. So who appears in a queue, from behind another one, has stood or crept
//! there before, and those who were seen meanwhile tell where. What is fast has been gone on with straight ahead.
//!
//! # Limits
//! Lane changes while hidden. It ends where nobody near tells it, at the end of the field of view, and where it would be
//! in the place of another one.

use super::{Proposal, View};
use crate::geometry::solid::Solid;
use crate::labels::near_face::{BoxStep, boxes, drawn};

/// How much later one does as the one ahead did, seconds.
const LATER_S: f64 = 1.3;
/// Faster ones are not gone on with here, m/s.
const SLOW_MPS: f64 = 6.0;
/// How far ahead or behind the other one is at most, and how far beside, metres; cosine of their headings.
const NEAR_M: f64 = 30.0;
const BESIDE_M: f64 = 1.5;
const SAME_COS: f64 = 0.97;
/// Time between two places, how long it goes on at most, and how long to be worth it, seconds.
const STEP_S: f64 = 0.25;
const LONGEST_S: f64 = 60.0;
const SHORTEST_S: f64 = 1.0;
/// Two boxes are in one place from this share of the smaller one on.
const SHARED: f64 = 0.1;
/// How far the line may be from the places, metres.
const TOLERANCE_M: f64 = 0.8;

/// An offered vehicle's boxes.
struct Boxes {
    size: [f64; 3],
    steps: Vec<BoxStep>,
}

impl Boxes {
    fn at(&self, time_s: f64) -> Option<BoxStep> {
        let next = self.steps.partition_point(|s| s.time_s < time_s - 1e-6);
        let b = *self.steps.get(next)?;
        let Some(a) = next.checked_sub(1).and_then(|k| self.steps.get(k)) else {
            return (b.time_s - time_s < 1e-3).then_some(b);
        };
        let f = (time_s - a.time_s) / (b.time_s - a.time_s).max(1e-6);
        let center = [0, 1].map(|k| a.center[k] + f * (b.center[k] - a.center[k]));
        Some(BoxStep { time_s, center, heading_rad: b.heading_rad })
    }

    fn solid(&self, time_s: f64) -> Option<Solid> {
        Some(self.at(time_s)?.solid(self.size))
    }

    fn speed(&self, from_s: f64, to_s: f64) -> f64 {
        let (Some(a), Some(b)) = (self.at(from_s), self.at(to_s)) else { return f64::INFINITY };
        (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]) / (to_s - from_s).abs().max(1e-6)
    }
}

/// The proposals, gone on with at both ends where others tell it.
pub fn gone_on(mut all: Vec<Proposal>, view: &View) -> Vec<Proposal> {
    let sensor = view.sensor;
    let mut known: Vec<Boxes> =
        all.iter().map(|p| Boxes { size: p.track.size(), steps: boxes(&p.track, sensor) }).collect();
    let mut order: Vec<usize> = (0..all.len()).collect();
    let first_s = |k: &usize| known[*k].steps.first().map_or(0.0, |s| s.time_s);
    // whom others are behind comes before them
    order.sort_by(|a, b| first_s(a).total_cmp(&first_s(b)));
    for (forwards, order) in [(false, order.clone()), (true, order.into_iter().rev().collect())] {
        for k in order {
            let mut added = added(&known, k, forwards, view);
            if (added.len() as f64) * STEP_S < SHORTEST_S {
                continue;
            }
            let Boxes { size, steps } = &mut known[k];
            let points = &mut all[k].track.points;
            if forwards {
                let Some(last) = steps.last().copied() else { continue };
                let line = [&[last], &added[..]].concat();
                points.extend(drawn(&line, *size, sensor, TOLERANCE_M).into_iter().filter(|p| p.time_s > last.time_s));
                steps.append(&mut added);
            } else {
                let Some(first) = steps.first().copied() else { continue };
                added.reverse();
                let line = [&added[..], &[first]].concat();
                let mut before = drawn(&line, *size, sensor, TOLERANCE_M);
                before.retain(|p| p.time_s < first.time_s);
                points.splice(0..0, before);
                added.append(steps);
                *steps = added;
            }
        }
    }
    all
}

/// Places of one beyond its first or last, each farther from that in time.
fn added(known: &[Boxes], k: usize, forwards: bool, view: &View) -> Vec<BoxStep> {
    let own = &known[k];
    let sign = if forwards { 1.0 } else { -1.0 };
    let end = if forwards { own.steps.last() } else { own.steps.first() };
    let Some(mut from) = end.copied() else { return Vec::new() };
    if own.speed(from.time_s, from.time_s - sign * 1.0) > SLOW_MPS {
        return Vec::new();
    }
    let start_s = from.time_s;
    let mut all: Vec<BoxStep> = Vec::new();
    // one tells it as long as it is known, then another one may
    while let Some((other, later_s)) = neighbour(known, k, &from, sign) {
        let Some(there) = known[other].at(from.time_s + later_s) else { break };
        let before = all.len();
        loop {
            let time_s = start_s + sign * STEP_S * (all.len() + 1) as f64;
            if (time_s - start_s).abs() > LONGEST_S || !(0.0..=view.latest_s).contains(&time_s) {
                return all;
            }
            let Some(now) = known[other].at(time_s + later_s) else { break };
            let center = [0, 1].map(|i| from.center[i] + now.center[i] - there.center[i]);
            let step = BoxStep { time_s, center, heading_rad: from.heading_rad };
            let solid = step.solid(own.size);
            let meets = |(i, b): (usize, &Boxes)| i != k && b.solid(time_s).is_some_and(|s| s.shared(&solid) >= SHARED);
            if !(view.contains)(center) || known.iter().enumerate().any(meets) {
                return all;
            }
            all.push(step);
        }
        match all.last() {
            Some(last) if all.len() > before => from = *last,
            _ => break,
        }
    }
    all
}

/// The nearest in its lane that is known the next step, too, and how much later it does the same.
fn neighbour(known: &[Boxes], k: usize, from: &BoxStep, sign: f64) -> Option<(usize, f64)> {
    let (s, c) = from.heading_rad.sin_cos();
    let near = |(i, b): (usize, &Boxes)| {
        let at = b.at(from.time_s)?;
        let [dx, dy] = [at.center[0] - from.center[0], at.center[1] - from.center[1]];
        let (along, beside) = (dx * c + dy * s, -dx * s + dy * c);
        let later_s = if along > 0.0 { -LATER_S } else { LATER_S };
        let next = |ahead: f64| b.at(from.time_s + later_s + sign * ahead).is_some();
        let fits = i != k
            && along.abs() < NEAR_M
            && beside.abs() < BESIDE_M
            && (at.heading_rad - from.heading_rad).cos() > SAME_COS
            && next(0.0)
            && next(STEP_S);
        fits.then_some((along.abs(), i, later_s))
    };
    let nearest = known.iter().enumerate().filter_map(near).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((nearest.1, nearest.2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::tracks::LabelTrack;

    const SENSOR: [f64; 2] = [0.0, 0.0];
    const VIEW: View = View { sensor: SENSOR, contains: &|[x, _]| x < 150.0, latest_s: 20.0 };

    /// A car in the lane at `y`, so far along it over time.
    fn car(id: &str, from_s: f64, to_s: f64, y: f64, along: impl Fn(f64) -> f64) -> Proposal {
        let n = ((to_s - from_s) / STEP_S).round() as usize;
        let step = |k: usize| {
            let time_s = from_s + STEP_S * k as f64;
            BoxStep { time_s, center: [along(time_s), y], heading_rad: 0.0 }
        };
        let steps: Vec<BoxStep> = (0..=n).map(step).collect();
        let points = drawn(&steps, [4.6, 1.8, 1.5], SENSOR, 0.05);
        let track = LabelTrack { id: id.into(), class: "car".into(), size_m: None, points };
        Proposal { track, score: 1.0, detections: 99, way: 0 }
    }

    /// Stands until 10 s, then pulls away to 4 m/s.
    fn first(time_s: f64) -> f64 {
        let moving = (time_s - 10.0).max(0.0);
        60.0 + if moving < 4.0 { 0.5 * moving * moving } else { 8.0 + 4.0 * (moving - 4.0) }
    }

    fn second(time_s: f64) -> f64 {
        first(time_s - LATER_S) - 8.0
    }

    fn off_m(p: &Proposal, time_s: f64, real_m: f64) -> f64 {
        let boxes = Boxes { size: p.track.size(), steps: boxes(&p.track, SENSOR) };
        (boxes.at(time_s).map_or(f64::INFINITY, |b| b.center[0]) - real_m).abs()
    }

    #[test]
    fn who_appears_in_a_queue_has_stood_behind_the_one_ahead_and_before_the_one_behind() {
        let all = vec![car("1", 0.0, 20.0, 3.0, first), car("2", 13.0, 20.0, 3.0, second)];
        let all = gone_on(all, &VIEW);
        for time_s in [1.5, 6.0, 10.0, 12.0] {
            assert!(off_m(&all[1], time_s, second(time_s)) < 0.8, "{time_s}");
        }
        assert_eq!(all[0].track.points, car("1", 0.0, 20.0, 3.0, first).track.points);
        // the other way round, and at the other end
        let all = vec![car("1", 13.0, 20.0, 3.0, first), car("2", 0.0, 20.0, 3.0, second)];
        assert!(off_m(&gone_on(all, &VIEW)[0], 6.0, first(6.0)) < 0.8);
        let all = vec![car("1", 0.0, 20.0, 3.0, first), car("2", 0.0, 13.0, 3.0, second)];
        assert!(off_m(&gone_on(all, &VIEW)[1], 18.0, second(18.0)) < 0.8);
    }

    #[test]
    fn it_is_not_told_by_the_next_lane_nor_by_who_comes_towards_it_nor_for_what_is_fast() {
        let alone = |all: Vec<Proposal>| {
            let before: Vec<LabelTrack> = all.iter().map(|p| p.track.clone()).collect();
            let after = gone_on(all, &VIEW);
            assert_eq!(after.into_iter().map(|p| p.track).collect::<Vec<_>>(), before);
        };
        alone(vec![car("1", 0.0, 20.0, 3.0, first), car("2", 13.0, 20.0, 6.5, second)]);
        alone(vec![car("1", 0.0, 20.0, 3.0, |t| 100.0 - first(t)), car("2", 13.0, 20.0, 3.0, |t| 2.0 * t)]);
        let fast = |from_m: f64| move |t: f64| from_m + 7.0 * t;
        alone(vec![car("1", 0.0, 12.0, 3.0, fast(20.0)), car("2", 6.0, 12.0, 3.0, fast(2.0))]);
    }

    #[test]
    fn it_ends_where_it_would_be_in_another_ones_place_and_where_nothing_is_seen() {
        // another one stands where the second one would have come from
        let ahead = |t: f64| 60.0 + 2.0 * t;
        let behind = |t: f64| ahead(t - LATER_S) - 8.0;
        let all = vec![car("1", 0.0, 20.0, 3.0, ahead), car("2", 13.0, 20.0, 3.0, behind)];
        let stands = car("3", 0.0, 9.0, 3.0, |t| 60.0 + 0.01 * t);
        let free_s = gone_on(all.clone(), &VIEW)[1].track.points[0].time_s;
        let all = gone_on([all, vec![stands]].concat(), &VIEW);
        let kept_s = all[1].track.points[0].time_s;
        // neither does it go on out of view
        let all = vec![car("1", 0.0, 20.0, 3.0, |t| 120.0 + 4.0 * t), car("2", 0.0, 5.0, 3.0, |t| 110.0 + 4.0 * t)];
        let ends_s = gone_on(all, &VIEW)[1].track.span_s().unwrap()[1];
        assert!(ends_s > 9.0 && ends_s < 10.1, "{ends_s}");
        assert!(free_s <= 2.0 && kept_s > 4.0 && kept_s < 13.0, "{free_s} {kept_s}");
    }
}
