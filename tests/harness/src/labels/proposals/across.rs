//! Where a vehicle is across its way: its flank tells, and the others that drive in its lane.
//!
//! # Model
//! What reflects of a vehicle ends at the flank on the side of the sensor, whether it comes from that flank, from all
//! around or from what is under it. That tells where its middle is as far as the sensor is near and to the side of it.
//! Of what is seen from behind and from far away, or between others, it tells little: such vehicles seem to lie up to a
//! metre to the side. But all of a lane drive in its middle, within [`IN_LANE_M`]. So with `v` the variance of what the
//! reflections of one vehicle tell and `m` what most of its lane tell,
//!
//! ```text
//!   left = (own / v + m / IN_LANE_M^2) / (1 / v + 1 / IN_LANE_M^2)
//! ```
//!
//! `m` is the median of all in the lane, each counting as often as its flank was seen: the lane itself was learnt from
//! reflections, too, and lies nearer to the sensor than the middles of the vehicles.
//!
//! # Limits
//! A lane of which no vehicle is seen from the side lies where the median of its reflections is. Who drives along the
//! edge of its lane for long is put into its middle where it was never seen from the side, and 0.4 of the way to it where
//! 400 reflections show its flank.

use std::collections::HashMap;
use std::sync::Arc;

use super::lane::Lane;
use super::path::{Path, quantile};
use super::reflections::Instant;

/// Sine of the aspect from which on reflections tell the flank, from how far at most, metres, and how many.
const SIDE_SIN: f64 = 0.06;
const SIDE_WITHIN_M: f64 = 60.0;
const SIDE_BY: usize = 20;
/// How far beyond the side of a vehicle the sensor has to be to see that, metres.
const CLEAR_M: f64 = 1.0;
/// How far from the middle the flank seems, of the width: noise spreads it. Reflections that do not spread over as much
/// of the width show no flank.
const HALF: f64 = 0.52;
const WIDE: f64 = 0.6;
/// How well reflections that tell no flank show where a vehicle is, and a flank that is seen long, metres: half of a
/// width, and what is left of the noise.
const UNSEEN_M: f64 = 0.9;
const SEEN_M: f64 = 0.15;
/// How far from the middle of a lane those in it drive, metres.
const IN_LANE_M: f64 = 0.3;

/// How far to the left of a path the middle of its vehicle is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Beside {
    left_m: f64,
    /// Reflections that tell its flank.
    by: usize,
}

impl Beside {
    /// As the reflections of one vehicle of this width tell it.
    fn of(path: &Path, instants: &[Instant], width_m: f64) -> Self {
        let mut sides = [Vec::new(), Vec::new()];
        let mut all = Vec::new();
        for (frame, r) in path.reflections(instants) {
            let Some((heading_rad, [_, left])) = path.heading_at(frame).zip(path.local(frame, r)) else { continue };
            let (s, c) = heading_rad.sin_cos();
            let sin = -r.sight[0] * s + r.sight[1] * c;
            all.push(left);
            // of what drives under the sensor, what lies to its left is left of the sensor, and no flank
            let sensor_m = left - sin * r.distance_m;
            if sin.abs() >= SIDE_SIN && r.distance_m < SIDE_WITHIN_M && sensor_m.abs() > 0.5 * width_m + CLEAR_M {
                sides[usize::from(sin > 0.0)].push(if sin > 0.0 { left } else { -left });
            }
        }
        let half_m = HALF * width_m;
        let (mut sum, mut by) = (0.0, 0);
        for (values, sign) in sides.iter().zip([-1.0, 1.0]) {
            let Some(edge) = quantile(values, 0.1).filter(|_| values.len() >= SIDE_BY) else { continue };
            let (Some(middle), Some(other)) = (quantile(values, 0.5), quantile(values, 0.9)) else { continue };
            let share = ((other - edge) / (WIDE * width_m)).min(1.0);
            sum += sign * (middle + share * (edge + half_m - middle)) * values.len() as f64;
            by += values.len();
        }
        let left_m = if by > 0 { sum / by as f64 } else { quantile(&all, 0.5).unwrap_or(0.0) };
        Self { left_m, by }
    }

    /// With what the others in its lane tell.
    fn in_lane(self, others_m: f64) -> f64 {
        let seen = 1.0 + self.by as f64 / SIDE_BY as f64;
        let own = (SEEN_M.powi(2) + UNSEEN_M.powi(2) / seen).recip();
        let lane = IN_LANE_M.powi(2).recip();
        (own * self.left_m + lane * others_m) / (own + lane)
    }
}

/// How far to the left of its path the middle of each vehicle is, metres; of paths with the width of their vehicles.
pub fn lefts_m(vehicles: &[(&Path, f64)], instants: &[Instant]) -> Vec<f64> {
    let own: Vec<Beside> = vehicles.iter().map(|(path, width_m)| Beside::of(path, instants, *width_m)).collect();
    let lanes = || vehicles.iter().map(|(path, _)| path.lane.as_ref().map(Arc::as_ptr));
    let mut by_lane: HashMap<*const Lane, Vec<Beside>> = HashMap::new();
    for (lane, beside) in lanes().zip(&own) {
        let Some(lane) = lane else { continue };
        by_lane.entry(lane).or_default().push(*beside);
    }
    let medians: HashMap<_, _> = by_lane.into_iter().filter_map(|(lane, all)| Some((lane, median(all)?))).collect();
    let left_m = |(lane, own): (Option<*const Lane>, &Beside)| {
        lane.and_then(|lane| medians.get(&lane)).map_or(own.left_m, |others_m| own.in_lane(*others_m))
    };
    lanes().zip(&own).map(left_m).collect()
}

/// The median, each counting as often as its flank was seen.
fn median(mut all: Vec<Beside>) -> Option<f64> {
    all.sort_by(|a, b| a.left_m.total_cmp(&b.left_m));
    let half: usize = all.iter().map(|b| b.by + 1).sum::<usize>() / 2;
    let mut before = 0;
    let reaches = |b: &&Beside| {
        before += b.by + 1;
        before > half
    };
    all.iter().find(reaches).map(|b| b.left_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::proposals::motion::Motion;
    use crate::labels::proposals::reflections::tests::seen_from_origin;

    /// The path of a lorry that drives along x past a sensor at the origin, from `from_m` on, and reflects at these
    /// distances to the left of its middle; the path is as far left of the middle.
    fn lorry(
        instants: &mut Vec<Instant>,
        [from_m, y]: [f64; 2],
        reflects: &[f64],
        path_left_m: f64,
        lane: Option<&Arc<Lane>>,
    ) -> Path {
        let speed = 15.0;
        let (mut members, mut motions) = (Vec::new(), Vec::new());
        for k in 0..30 {
            let time_s = 0.1 * k as f64;
            let x = from_m - time_s * speed;
            if instants.len() <= k {
                instants.push(Instant { time_s, reflections: Vec::new() });
            }
            for left in reflects {
                members.push((k, instants[k].reflections.len()));
                // its left is -y
                instants[k].reflections.push(seen_from_origin([x, y - left], -speed));
            }
            motions.push((time_s, Motion::new([x, y - path_left_m], [-speed, 0.0], 0.1, [-1.0, 0.0], [0.1, 0.1])));
        }
        let headings_rad = vec![std::f64::consts::PI; 30];
        let (lane, queued) = (lane.cloned(), Vec::new());
        Path { members, first: 0, motions, headings_rad, reach: [-8.0, 8.0], top_m: 2.5, lane, queued }
    }

    /// Reflections of a flank 1.275 m to the side.
    fn flank(side: f64) -> Vec<f64> {
        (0..20).map(|k| side * (1.275 - 0.02 * f64::from(k * k % 19) * 5.0)).collect()
    }

    #[test]
    fn the_flank_is_where_reflections_end_on_the_side_of_the_sensor() {
        let told_m = |y: f64, reflects: &[f64], path_left_m: f64| {
            let mut instants = Vec::new();
            let path = lorry(&mut instants, [50.0, y], reflects, path_left_m, None);
            Beside::of(&path, &instants, 2.55).left_m + path_left_m
        };
        // the sensor sees the left flank of what is at +y, the right one at -y
        for path_left_m in [0.0, 0.7, -0.7] {
            for (y, side) in [(6.0, 1.0), (-6.0, -1.0)] {
                let one = flank(side);
                let both: Vec<f64> = one.iter().chain(&[-1.3, -1.2, 1.3, 1.2]).copied().collect();
                assert!(told_m(y, &one, path_left_m).abs() < 0.2, "{}", told_m(y, &one, path_left_m));
                assert!(told_m(y, &both, path_left_m).abs() < 0.2, "{}", told_m(y, &both, path_left_m));
            }
        }
        // the sensor is above it: what lies to its left is no flank
        assert!(told_m(0.3, &[1.0, 0.9, -1.0, -0.9, 0.1], 0.0).abs() < 0.15);
        // one place that reflects tells no flank
        assert!((told_m(6.0, &[0.3], 0.0) - 0.3).abs() < 0.01);
    }

    #[test]
    fn who_is_seen_from_behind_only_drives_where_the_others_of_its_lane_do() {
        for (y, side) in [(6.0, 1.0), (-6.0, -1.0)] {
            let lane = Arc::new(Lane { points: vec![[140.0, y], [0.0, y]], straight: None });
            let mut instants = Vec::new();
            // three that pass with their flanks in view; two far away that reflect to the side of the sensor
            let mut paths: Vec<Path> = [0.1, 0.0, -0.1]
                .map(|off| {
                    let reflects: Vec<f64> = flank(side).iter().map(|left| left + off).collect();
                    lorry(&mut instants, [50.0, y], &reflects, 0.2 * side, Some(&lane))
                })
                .into();
            paths.extend(
                [0.9, 1.1].map(|left| lorry(&mut instants, [130.0, y], &[left * side], 0.2 * side, Some(&lane))),
            );
            let told_m = |paths: &[&Path], instants: &[Instant]| -> Vec<f64> {
                let vehicles: Vec<(&Path, f64)> = paths.iter().map(|path| (*path, 2.55)).collect();
                lefts_m(&vehicles, instants).into_iter().map(|left_m| left_m + 0.2 * side).collect()
            };
            let all: Vec<&Path> = paths.iter().collect();
            let off = told_m(&all, &instants);
            assert!(off[0] > off[1] && off[1] > off[2], "{off:?}");
            assert!(off.iter().all(|told| told.abs() < 0.25), "{off:?}");
            // who is seen well and drives to the side goes less than half of the way; who keeps to no lane stays
            let aside: Vec<f64> = flank(side).iter().map(|left| left + 0.8).collect();
            let aside = lorry(&mut instants, [50.0, y], &aside, 0.2 * side, Some(&lane));
            let all: Vec<&Path> = paths.iter().chain([&aside]).collect();
            let told = told_m(&all, &instants)[5];
            assert!((0.35..0.8).contains(&told), "{told}");
            let alone = lorry(&mut instants, [130.0, y], &[0.9 * side], 0.2 * side, None);
            let all: Vec<&Path> = paths.iter().chain([&alone]).collect();
            assert!((told_m(&all, &instants)[5] - 0.9 * side).abs() < 0.05);
        }
    }

    #[test]
    fn the_median_counts_by_flanks_seen() {
        let all =
            |of: &[(f64, usize)]| median(of.iter().map(|(left_m, by)| Beside { left_m: *left_m, by: *by }).collect());
        assert_eq!(all(&[]), None);
        assert_eq!(all(&[(0.9, 0), (0.7, 0), (0.8, 0)]), Some(0.8));
        assert_eq!(all(&[(0.9, 0), (0.7, 0), (0.1, 50)]), Some(0.1));
    }
}
