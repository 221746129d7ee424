//! From the near face, which reflects and is drawn, to the box behind it, and back.
//!
//! # Model
//! The line of sight meets the vehicle under an aspect: with `a` the angle between its heading and the line of sight,
//! the box centre lies beyond the near face by
//!
//! ```text
//!   along the heading:   length / 2 * sat(cos a / 0.5)     seen from behind or ahead: the rear or the front is near
//!   to its left:         width  / 2 * sat(sin a / 0.7)     seen from the side: the flank is near
//! ```
//!
//! with `sat` a limit to -1..1. So both directions of travel and both sides of the road have their signs from the
//! geometry, and between end and flank the point slides without a jump. Between two points of a track the centre moves
//! in a straight line, not the near face: that slides along a vehicle that passes the sensor, the faster the closer it
//! passes. The heading is that of the centres' path; a vehicle that stands keeps the heading it came with, or leaves
//! with, and one that never moves looks along the road. A step aside in a moment, as simulators change lanes, turns
//! nobody: headings are not taken across it.
//!
//! # Limits
//! In a turn the heading is the mean over the few metres it is taken over; a test has 0.12 rad and 0.3 m for a car.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::tracks::{LabelPoint, LabelTrack};
use crate::geometry::heading::{BASE_M, STANDS_M, carried, headings, moves};
use crate::geometry::polyline::kept;
use crate::geometry::solid::Solid;

/// Time between two boxes of a track, seconds.
pub const STEP_S: f64 = 0.1;
/// Of a long vehicle the heading is taken between the places this share of its length behind and ahead, its ends:
/// its centre turns about the near face with its heading, and over a shorter way that would turn it more and more.
const HEADING_LENGTHS: f64 = 0.5;
/// How often the near face is computed anew, and how often halved: to a tenth of a millimetre.
const ROUNDS: usize = 40;
const HALVINGS: usize = 20;
/// How far the drawn line may be from the near face between two points, metres.
const LINE_M: f64 = 2.0;
/// A step aside: between two points so near in time, seconds, so far, metres, and so much across the way that it came or
/// goes on, as a cosine.
const STEP_ASIDE_S: f64 = 0.25;
const STEP_ASIDE_M: f64 = 1.5;
const STEP_ASIDE_COS: f64 = 0.7;
/// Cosine of the aspect from which on the near face is the rear or the front.
const END_COS: f64 = 0.5;
/// Sine of the aspect from which on it is the flank.
const FLANK_SIN: f64 = 0.7;

/// A box centre and heading at one time. In JSON an array of four numbers: `[time_s, x_m, y_m, heading_rad]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct BoxStep {
    /// Seconds since the first radar frame.
    pub time_s: f64,
    /// Centre, road frame, metres.
    pub center: [f64; 2],
    /// From +x, counter-clockwise.
    pub heading_rad: f64,
}

impl BoxStep {
    /// The box of a road user of this size, on the ground.
    pub fn solid(&self, size: [f64; 3]) -> Solid {
        let [x, y] = self.center;
        Solid { center: [x, y, size[2] / 2.0], yaw_rad: self.heading_rad, size }
    }
}

impl From<[f64; 4]> for BoxStep {
    fn from([time_s, x, y, heading_rad]: [f64; 4]) -> Self {
        Self { time_s, center: [x, y], heading_rad }
    }
}

impl From<BoxStep> for [f64; 4] {
    fn from(b: BoxStep) -> Self {
        [b.time_s, b.center[0], b.center[1], b.heading_rad]
    }
}

/// From the near face to the box centre, as a vector in the road frame. `near`, `sensor` in the road frame, metres.
pub fn offset(near: [f64; 2], heading_rad: f64, size: [f64; 3], sensor: [f64; 2]) -> [f64; 2] {
    let [dx, dy] = [near[0] - sensor[0], near[1] - sensor[1]];
    let distance = dx.hypot(dy).max(1e-6);
    let (s, c) = heading_rad.sin_cos();
    let cos_aspect = (dx * c + dy * s) / distance;
    let sin_aspect = (-dx * s + dy * c) / distance;
    let along = size[0] / 2.0 * (cos_aspect / END_COS).clamp(-1.0, 1.0);
    let left = size[1] / 2.0 * (sin_aspect / FLANK_SIN).clamp(-1.0, 1.0);
    [along * c - left * s, along * s + left * c]
}

/// The box centre behind a near face.
pub fn center(near: [f64; 2], heading_rad: f64, size: [f64; 3], sensor: [f64; 2]) -> [f64; 2] {
    let o = offset(near, heading_rad, size, sensor);
    [near[0] + o[0], near[1] + o[1]]
}

/// The near face of a box: the inverse of [`center`], to a millimetre where the sensor is not in the box.
pub fn near(center: [f64; 2], heading_rad: f64, size: [f64; 3], sensor: [f64; 2]) -> [f64; 2] {
    // in coordinates along the heading and to its left, from the sensor on
    let (s, c) = heading_rad.sin_cos();
    let [dx, dy] = [center[0] - sensor[0], center[1] - sensor[1]];
    let [along, left] = [dx * c + dy * s, -dx * s + dy * c];
    let [half_length, half_width] = [size[0] / 2.0, size[1] / 2.0];
    // each is found alone, the other being known, and again until neither changes
    let mut near = [along, left];
    for _ in 0..ROUNDS {
        let before = near;
        near[0] =
            rising(along, half_length, |a| half_length * (a / a.hypot(near[1]).max(1e-6) / END_COS).clamp(-1.0, 1.0));
        near[1] =
            rising(left, half_width, |l| half_width * (l / l.hypot(near[0]).max(1e-6) / FLANK_SIN).clamp(-1.0, 1.0));
        if (near[0] - before[0]).hypot(near[1] - before[1]) < 1e-4 {
            break;
        }
    }
    [sensor[0] + near[0] * c - near[1] * s, sensor[1] + near[0] * s + near[1] * c]
}

/// The value that is `sum` with its offset added, which rises with it and is at most `most`: by halving.
fn rising(sum: f64, most: f64, offset: impl Fn(f64) -> f64) -> f64 {
    let [mut low, mut high] = [sum - most, sum + most];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle + offset(middle) < sum { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The boxes of a track: at its points and every [`STEP_S`] between the first and the last. Between two points the
/// centre moves in a straight line at constant speed: the near face slides along a vehicle that passes the sensor.
pub fn boxes(track: &LabelTrack, sensor: [f64; 2]) -> Vec<BoxStep> {
    let (times, at) = times(&track.points);
    let nears: Vec<[f64; 2]> = track.points.iter().map(|p| [p.x_m, p.y_m]).collect();
    let size = track.size();
    let mut centers = between(&nears, &times, &at);
    let base_m = BASE_M.max(HEADING_LENGTHS * size[0]);
    let pieces = pieces(&track.points, &at, centers.len());
    let mut headings = headings_of(&centers, &pieces, base_m);
    // the heading is that of the centres, which depend on it
    for _ in 0..4 {
        let own: Vec<[f64; 2]> =
            nears.iter().zip(&at).map(|(near, k)| center(*near, headings[*k], size, sensor)).collect();
        centers = between(&own, &times, &at);
        headings = headings_of(&centers, &pieces, base_m);
    }
    let all = times.into_iter().zip(centers).zip(headings);
    all.map(|((time_s, center), heading_rad)| BoxStep { time_s, center, heading_rad }).collect()
}

/// The parts of a track between steps aside, as ranges of its times; `at` are the numbers of its points' times. What lies
/// within a step is in none.
fn pieces(points: &[LabelPoint], at: &[usize], times: usize) -> Vec<Range<usize>> {
    let way = |a: &LabelPoint, b: &LabelPoint| [b.x_m - a.x_m, b.y_m - a.y_m];
    let length = |[x, y]: [f64; 2]| x.hypot(y);
    let cos = |a: [f64; 2], b: [f64; 2]| (a[0] * b[0] + a[1] * b[1]) / (length(a) * length(b)).max(1e-9);
    let far = |from: &LabelPoint, to: &LabelPoint| Some(way(from, to)).filter(|w| length(*w) >= STANDS_M);
    let aside = |k: usize| {
        let (from, to) = (&points[k], &points[k + 1]);
        let step = way(from, to);
        if to.time_s - from.time_s > STEP_ASIDE_S || length(step) < STEP_ASIDE_M {
            return false;
        }
        let came = points[..k].iter().rev().find_map(|p| far(p, from));
        let goes = points[k + 2..].iter().find_map(|p| far(to, p));
        let mut ways = [came, goes].into_iter().flatten().peekable();
        ways.peek().is_some() && ways.all(|w| cos(w, step).abs() < STEP_ASIDE_COS)
    };
    let steps = (0..points.len().saturating_sub(1)).filter(|k| aside(*k)).map(|k| (at[k] + 1, at[k + 1]));
    let mut begin = 0;
    steps.chain([(times, times)]).map(|(end, next)| std::mem::replace(&mut begin, next)..end).collect()
}

/// Headings at all places, those of each piece by itself; what is in no piece or stands has its neighbour's.
fn headings_of(path: &[[f64; 2]], pieces: &[Range<usize>], base_m: f64) -> Vec<f64> {
    let mut all = vec![None; path.len()];
    for piece in pieces.iter().filter(|p| moves(&path[(*p).clone()])) {
        for (heading, known) in all[piece.clone()].iter_mut().zip(headings(&path[piece.clone()], base_m)) {
            *heading = Some(known);
        }
    }
    carried(all)
}

/// Places at all times, from those at the times with these numbers.
fn between(places: &[[f64; 2]], times: &[f64], at: &[usize]) -> Vec<[f64; 2]> {
    let mut all = Vec::with_capacity(times.len());
    for (k, from) in places.iter().enumerate() {
        let (Some(to), Some(next)) = (places.get(k + 1), at.get(k + 1)) else {
            all.push(*from);
            continue;
        };
        let [a, b] = [times[at[k]], times[*next]];
        let mix = |t: f64| [0, 1].map(|i| from[i] + (to[i] - from[i]) * (t - a) / (b - a));
        all.extend(times[at[k]..*next].iter().map(|t| mix(*t)));
    }
    all
}

/// The fewest points to draw whose boxes are nowhere farther than `tolerance_m` from these, and whose line is
/// near enough to the near face to be recognised.
pub fn drawn(steps: &[BoxStep], size: [f64; 3], sensor: [f64; 2], tolerance_m: f64) -> Vec<LabelPoint> {
    let nears = nears(steps, size, sensor);
    let centers: Vec<LabelPoint> =
        steps.iter().map(|b| LabelPoint { time_s: b.time_s, x_m: b.center[0], y_m: b.center[1] }).collect();
    let wrong = |a: usize, b: usize, k: usize| {
        let center = error(centers[a], centers[b], centers[k]) / tolerance_m;
        center.max(error(nears[a], nears[b], nears[k]) / LINE_M)
    };
    kept(nears.len(), &wrong).into_iter().map(|k| nears[k]).collect()
}

/// Near faces of boxes.
pub fn nears(steps: &[BoxStep], size: [f64; 3], sensor: [f64; 2]) -> Vec<LabelPoint> {
    let point = |b: &BoxStep| {
        let [x_m, y_m] = near(b.center, b.heading_rad, size, sensor);
        LabelPoint { time_s: b.time_s, x_m, y_m }
    };
    steps.iter().map(point).collect()
}

/// Times of the points and every step between, and the number of each point's.
fn times(points: &[LabelPoint]) -> (Vec<f64>, Vec<usize>) {
    let (mut times, mut at) = (Vec::new(), Vec::new());
    for (k, point) in points.iter().enumerate() {
        at.push(times.len());
        let a = point.time_s;
        times.push(a);
        if let Some(b) = points.get(k + 1).map(|p| p.time_s) {
            // a microsecond longer than a step is a step
            let parts = ((b - a - 1e-6) / STEP_S).ceil().clamp(1.0, 1e6);
            times.extend((1..parts as u32).map(|k| a + (b - a) * f64::from(k) / parts));
        }
    }
    (times, at)
}

/// Distance of `p` from where the line from `a` to `b` is at its time.
fn error(a: LabelPoint, b: LabelPoint, p: LabelPoint) -> f64 {
    let f = (p.time_s - a.time_s) / (b.time_s - a.time_s);
    (a.x_m + f * (b.x_m - a.x_m) - p.x_m).hypot(a.y_m + f * (b.y_m - a.y_m) - p.y_m)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    const TRUCK: [f64; 3] = [16.5, 2.55, 4.0];
    const CAR: [f64; 3] = [4.6, 1.8, 1.5];

    fn close(a: [f64; 2], b: [f64; 2], within: f64) {
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) <= within, "{a:?} is not {b:?}");
    }

    fn track(class: &str, points: &[[f64; 3]]) -> LabelTrack {
        LabelTrack {
            id: "1".into(),
            class: class.into(),
            size_m: None,
            points: points.iter().map(|p| (*p).into()).collect(),
        }
    }

    #[test]
    fn a_truck_s_centre_is_half_a_length_beyond_its_rear_or_its_front() {
        // far ahead of the sensor; driving away its rear is near, coming its front, and the centre is farther in both
        for heading in [0.0, PI] {
            close(center([80.0, 0.0], heading, TRUCK, [0.0, 0.0]), [88.25, 0.0], 1e-9);
            close(center([-80.0, 0.0], heading, TRUCK, [0.0, 0.0]), [-88.25, 0.0], 1e-9);
        }
    }

    #[test]
    fn a_crossing_truck_s_centre_is_half_a_width_beyond_its_flank() {
        for heading in [FRAC_PI_2, -FRAC_PI_2] {
            close(center([30.0, 0.0], heading, TRUCK, [0.0, 0.0]), [31.275, 0.0], 1e-9);
        }
        // and on the other axis, beside the sensor on either side
        for heading in [0.0, PI] {
            close(center([0.0, 8.0], heading, TRUCK, [0.0, 0.0]), [0.0, 9.275], 1e-9);
            close(center([0.0, -8.0], heading, TRUCK, [0.0, 0.0]), [0.0, -9.275], 1e-9);
        }
    }

    #[test]
    fn the_sensor_s_place_decides_not_the_origin() {
        close(center([80.0, 0.0], 0.0, TRUCK, [200.0, 0.0]), [71.75, 0.0], 1e-9);
        close(center([80.0, 0.0], FRAC_PI_2, CAR, [80.0, -40.0]), [80.0, 2.3], 1e-9);
    }

    #[test]
    fn near_face_and_centre_are_inverse_in_all_directions() {
        for size in [CAR, TRUCK] {
            for turn in 0..24 {
                for place in [[40.0, 3.5], [90.0, -12.0], [15.0, 20.0], [30.0, 0.0]] {
                    let heading = f64::from(turn) * PI / 12.0;
                    let near_m = near(place, heading, size, [1.0, 2.0]);
                    close(center(near_m, heading, size, [1.0, 2.0]), place, 1e-3);
                }
            }
        }
    }

    #[test]
    fn boxes_of_both_directions_of_travel_lie_behind_the_line_that_was_drawn() {
        let away = boxes(&track("truck", &[[0.0, 60.0, -5.0], [2.0, 100.0, -5.0]]), [0.0, 0.0]);
        let coming = boxes(&track("truck", &[[0.0, 100.0, 5.0], [2.0, 60.0, 5.0]]), [0.0, 0.0]);
        for (steps, heading, near) in [(&away, 0.0, [60.0, 100.0]), (&coming, PI, [100.0, 60.0])] {
            assert_eq!(steps.len(), 21);
            for (step, near) in [(steps[0], near[0]), (steps[20], near[1])] {
                assert!((step.center[0] - near - 8.25).abs() < 0.05, "{step:?}");
                assert!((step.heading_rad - heading).cos().abs() < 1.0 + 1e-9);
                assert!((step.heading_rad - heading).sin().abs() < 0.02 && (step.heading_rad - heading).cos() > 0.0);
            }
        }
    }

    #[test]
    fn a_truck_that_passes_the_sensor_keeps_its_speed_although_its_near_face_slides_along_it() {
        for (speed, left) in [(20.0, 5.0), (-20.0, -5.0)] {
            let truth: Vec<BoxStep> = (0..=60)
                .map(|k| f64::from(k) * 0.1)
                .map(|t| BoxStep {
                    time_s: t,
                    center: [speed * (t - 3.0), left],
                    heading_rad: if speed > 0.0 { 0.0 } else { PI },
                })
                .collect();
            let points = drawn(&truth, TRUCK, [0.0, 0.0], 0.4);
            assert!(points.len() < 10, "{} points", points.len());
            let steps = boxes(&LabelTrack { points, ..track("truck", &[]) }, [0.0, 0.0]);
            for pair in steps.windows(2) {
                let mps = (pair[1].center[0] - pair[0].center[0]) / (pair[1].time_s - pair[0].time_s);
                assert!((mps - speed).abs() < 0.5, "{mps} m/s at {} s", pair[0].time_s);
                close(pair[0].center, [speed * (pair[0].time_s - 3.0), left], 0.4);
            }
            // two points, at front and rear, are enough for the boxes
            let ends = [truth[0], truth[60]];
            let two = LabelTrack { points: nears(&ends, TRUCK, [0.0, 0.0]), ..track("truck", &[]) };
            for (a, b) in truth.iter().zip(boxes(&two, [0.0, 0.0])) {
                close(a.center, b.center, 0.1);
            }
        }
    }

    #[test]
    fn a_vehicle_that_stands_keeps_the_heading_it_came_with() {
        // comes along +y, stands at a red light with the unsteadiness of a hand, and goes on
        let drawn = [[0.0, 30.0, -20.0], [4.0, 30.0, 0.0], [9.0, 30.05, 0.02], [12.0, 30.0, 0.0], [16.0, 30.0, 20.0]];
        let steps = boxes(&track("car", &drawn), [0.0, 0.0]);
        for step in &steps {
            assert!((step.heading_rad - FRAC_PI_2).abs() < 0.15, "{step:?}");
        }
        // one that only stands looks along the road
        let parked = boxes(&track("car", &[[0.0, 30.0, 5.0], [9.0, 30.1, 5.0]]), [0.0, 0.0]);
        assert!(parked.iter().all(|s| s.heading_rad == 0.0));
        close(parked[0].center, [32.3, 5.0 + 0.9 * (5.0_f64.atan2(30.0).sin() / FLANK_SIN)], 1e-6);
    }

    #[test]
    fn a_step_aside_as_simulators_change_lanes_turns_nobody() {
        // a truck beside the sensor drives up, stands for 10 s, is in the lane beside and drives on
        let at = |time_s: f64, x: f64, y: f64| BoxStep { time_s, center: [x, y], heading_rad: 0.0 };
        let truth = [
            at(0.0, -2.5, -1.75),
            at(4.0, 5.5, -1.75),
            at(14.0, 5.5, -1.75),
            at(14.1, 5.5, -5.25),
            at(18.0, 26.0, -5.25),
        ];
        let drawn = LabelTrack { points: nears(&truth, TRUCK, [-10.0, 3.0]), ..track("truck", &[]) };
        for b in boxes(&drawn, [-10.0, 3.0]) {
            assert!(b.heading_rad.abs() < 0.02, "{b:?}");
        }
        // of a slower radar, with times between those of the step
        let mut slower = drawn.clone();
        slower.points[2].time_s = 13.86;
        assert!(boxes(&slower, [-10.0, 3.0]).iter().all(|b| b.heading_rad.abs() < 0.02));
        // what comes after the step alone tells the way of what stood before it
        let stood = LabelTrack { points: drawn.points[2..].to_vec(), ..drawn.clone() };
        assert!(boxes(&stood, [-10.0, 3.0]).iter().all(|b| b.heading_rad.abs() < 0.02));
        // who takes two seconds for it turns
        let slow = [truth[0], truth[1], at(6.0, 15.5, -5.25), at(8.0, 26.0, -5.25)];
        let slow = LabelTrack { points: nears(&slow, TRUCK, [-10.0, 3.0]), ..drawn };
        assert!(boxes(&slow, [-10.0, 3.0]).iter().any(|b| b.heading_rad < -0.1));
    }

    #[test]
    fn a_box_survives_the_way_to_its_near_face_and_back_through_a_turn() {
        // a quarter turn of 12 m radius, at 6 m/s, seen from the corner
        let at = |t: f64| {
            let turned = (6.0 * t / 12.0 - 1.0).clamp(0.0, FRAC_PI_2);
            let [before, after] = [(6.0 * t).min(12.0), (6.0 * t - 12.0 - 12.0 * FRAC_PI_2).max(0.0)];
            let x = 30.0 + before + 12.0 * turned.sin();
            BoxStep { time_s: t, center: [x, 10.0 + 12.0 * (1.0 - turned.cos()) + after], heading_rad: turned }
        };
        let truth: Vec<BoxStep> = (0..90).map(|k| at(f64::from(k) * 0.1)).collect();
        let drawn = LabelTrack { points: nears(&truth, CAR, [0.0, 0.0]), ..track("car", &[]) };
        for (a, b) in truth.iter().zip(boxes(&drawn, [0.0, 0.0])) {
            assert!((a.heading_rad - b.heading_rad).abs() < 0.12, "{a:?} {b:?}");
            close(a.center, b.center, 0.3);
        }
    }

    fn simplify(points: &[LabelPoint], tolerance_m: f64) -> Vec<LabelPoint> {
        let wrong = |a: usize, b: usize, k: usize| error(points[a], points[b], points[k]) / tolerance_m;
        kept(points.len(), &wrong).into_iter().map(|k| points[k]).collect()
    }

    fn points(all: &[[f64; 3]]) -> Vec<LabelPoint> {
        all.iter().map(|p| (*p).into()).collect()
    }

    #[test]
    fn constant_speed_needs_two_points_and_a_stop_one_more_at_each_end() {
        let at = |k: f64| [k, (4.0 * k).min(20.0), 0.0];
        let stop: Vec<[f64; 3]> = (0..20).map(|k| at(f64::from(k))).collect();
        let few = simplify(&points(&stop), 0.1);
        assert_eq!(few, points(&[[0.0, 0.0, 0.0], [5.0, 20.0, 0.0], [19.0, 20.0, 0.0]]));
        assert_eq!(simplify(&few[..2], 0.1), few[..2]);
        assert!(simplify(&[], 1.0).is_empty());
    }

    #[test]
    fn nothing_that_is_left_out_was_farther_than_the_tolerance() {
        let wave: Vec<LabelPoint> =
            (0..400).map(|k| f64::from(k) * 0.1).map(|t| [t, 20.0 * t, 3.0 * t.sin()].into()).collect();
        let few = simplify(&wave, 0.5);
        assert!((10..60).contains(&few.len()), "{} points", few.len());
        for p in &wave {
            let next = few.partition_point(|q| q.time_s < p.time_s).max(1);
            assert!(error(few[next - 1], few[next], *p) <= 0.5);
        }
    }
}
