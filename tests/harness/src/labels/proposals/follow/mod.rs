//! One vehicle, followed from where a person points at it: a click in place of the points of a line.
//!
//! # Model
//! The person says where the near face was at one time, and the label which class, so the box is known. From there it is
//! followed forwards and backwards in time: a reflection is its own where it lies in the predicted box, as far as a place
//! is known, with the Doppler of the predicted velocity, and in no other label's box. Which way it goes is tried out all
//! around; the way stays on which most reflections fit. It ends where it meets the label that is there already, or where
//! nothing fits any more. Smoothed over all of it, with the click and the label at both ends as measurements, it takes
//! the place of the label between. On the beginning of a label a click asks for what was before it: `hidden`, where the
//! vehicle stood that nothing but one reflection shows.

mod around;
mod beginnings;
mod hidden;
mod state;
mod way;

use rayon::prelude::*;

use super::motion::{Motion, smooth};
use super::reflections::{self, Instant};
use crate::geometry::heading::{BASE_M, STANDS_M, headings};
use crate::labels::Site;
use crate::labels::near_face::{BoxStep, drawn};
use crate::labels::tracks::{FARTHEST, LabelPoint, LabelTrack};
use crate::recording::Recording;
use around::{Around, Standing};
use beginnings::CLICK_M;
use state::State;
use way::{Step, Way};

/// How far the polyline may be from what was followed, metres.
const TOLERANCE_M: f64 = 0.4;
/// How exact the label is where the way meets it, metres.
const LABEL_M: f64 = 0.2;
/// Fewest frames of a way, the click counted for both sides.
const FEWEST: usize = 5;
/// A point of the label that nothing reaches from where the way ended, m/s beyond its speed, is wrong, too.
const REACHES_MPS: f64 = 4.0;

/// The reflections of a recording, to follow vehicles in.
#[derive(Debug)]
pub struct Follower {
    instants: Vec<Instant>,
    standing: Standing,
    site: Site,
    /// Frames that do not follow one another show nobody's way.
    independent: bool,
}

impl Follower {
    pub fn new(recording: &Recording) -> Self {
        let instants = reflections::instants(recording);
        let standing = Standing::of(&instants);
        Self { instants, standing, site: Site::of(recording), independent: recording.sensor.frames_independent }
    }

    /// The track with the way of what is at a click, in place of what it was there before; `None` where nothing is.
    /// A track without points begins with it. `others` are not taken for it.
    pub fn through(&self, track: &LabelTrack, click: LabelPoint, others: &[LabelTrack]) -> Option<LabelTrack> {
        if self.independent || [click.time_s, click.x_m, click.y_m].iter().any(|v| !(-FARTHEST..=FARTHEST).contains(v))
        {
            return None;
        }
        let frame = self.nearest(click.time_s)?;
        let around = Around::of(track, others, &self.instants, &self.standing, self.site.sensor);
        if let Some(hidden) = around.hidden(click) {
            let before = drawn(&hidden, around.size, around.sensor, TOLERANCE_M);
            let points = before.into_iter().chain(track.points.iter().copied()).collect();
            return Some(LabelTrack { points, ..track.clone() }).filter(|track| track.check().is_ok());
        }
        let both = |begin: State| [false, true].map(|backwards| around.follow(frame, begin, backwards));
        let tried = around.beginnings(frame, [click.x_m, click.y_m]).into_par_iter().map(|(likely, begin)| {
            let ways = both(begin);
            let worth = ways.iter().zip([false, true]).map(|(way, backwards)| around.worth(way, frame, backwards));
            (likely + worth.sum::<f64>(), begin)
        });
        // only the best way is kept: those of a long recording are long
        let tried: Vec<(f64, State)> = tried.collect();
        let (_, begin) = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let both = both(begin);
        if both.iter().map(|way| way.steps.len()).sum::<usize>() < FEWEST {
            return None;
        }
        let steps = smoothed(&around, &both, frame, begin);
        let points = drawn(&steps, around.size, around.sensor, TOLERANCE_M);
        Some(replaced(track, points, &both)).filter(|track| track.check().is_ok())
    }

    fn nearest(&self, time_s: f64) -> Option<usize> {
        let next = self.instants.partition_point(|i| i.time_s < time_s);
        let beside = [next.checked_sub(1), Some(next)].into_iter().flatten();
        let away_s = |k: usize| Some((k, (self.instants.get(k)?.time_s - time_s).abs()));
        beside.filter_map(away_s).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }
}

/// The track with new points where the way was.
fn replaced(track: &LabelTrack, points: Vec<LabelPoint>, [after, before]: &[Way; 2]) -> LabelTrack {
    let (Some(first), Some(last)) = (points.first().copied(), points.last().copied()) else { return track.clone() };
    let speed = |way: &Way| way.steps.last().map_or(0.0, |step| step.state.motion.speed());
    let reached = |from: LabelPoint, way: &Way, p: &LabelPoint| {
        let way_m = (p.x_m - from.x_m).hypot(p.y_m - from.y_m);
        way.met || way_m <= (speed(way) + REACHES_MPS) * (p.time_s - from.time_s).abs() + 1.0
    };
    let kept = track.points.iter().filter(|p| match () {
        () if p.time_s < first.time_s => reached(first, before, p),
        () if p.time_s > last.time_s => reached(last, after, p),
        () => false,
    });
    let mut all: Vec<LabelPoint> = kept.copied().chain(points).collect();
    all.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    LabelTrack { points: all, ..track.clone() }
}

/// Boxes of the whole way: filtered again from its beginning, with the click and the label at its ends, and back.
fn smoothed(around: &Around, [after, before]: &[Way; 2], click: usize, begin: State) -> Vec<BoxStep> {
    let mut steps: Vec<&Step> = before.steps.iter().rev().collect();
    steps.extend(after.steps.iter().skip(1));
    let Some(first) = steps.first() else { return Vec::new() };
    let velocity = first.state.motion.velocity();
    let mut motion = Motion::new(first.state.motion.place(), velocity, 2.0, [1.0, 0.0], [2.0; 2]);
    let mut filtered = Vec::with_capacity(steps.len());
    let ends = [(before.met, 0), (after.met, steps.len() - 1)];
    let mut last_s = None;
    for (k, step) in steps.iter().enumerate() {
        let now_s = around.seconds(step.frame);
        motion.predict(last_s.map_or(0.0, |last_s| now_s - last_s));
        last_s = Some(now_s);
        let mut now = State { motion, ..step.state };
        now.measure(step.frame, &step.own, around);
        motion = now.motion;
        let fixed = [(step.frame == click).then(|| (begin.motion.place(), CLICK_M))].into_iter().flatten().chain(
            ends.iter()
                .filter(|(met, at)| *met && *at == k)
                .filter_map(|_| Some((around.label(step.frame)?.center, LABEL_M))),
        );
        for ([x, y], spread) in fixed {
            motion.update([1.0, 0.0, 0.0, 0.0], x, spread);
            motion.update([0.0, 1.0, 0.0, 0.0], y, spread);
        }
        filtered.push((now_s, motion));
    }
    let smoothed = smooth(&filtered);
    let places: Vec<[f64; 2]> = smoothed.iter().map(|(_, m)| m.place()).collect();
    let by_place = headings(&places, BASE_M);
    let still = places.iter().all(|p| (p[0] - places[0][0]).hypot(p[1] - places[0][1]) < STANDS_M);
    let all = smoothed.iter().zip(by_place).zip(&steps);
    all.map(|(((time_s, m), by_place), step)| {
        let heading_rad = if still { step.state.heading_rad } else { by_place };
        BoxStep { time_s: *time_s, center: m.place(), heading_rad }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::super::reflections::tests::seen_from_origin;
    use super::*;
    use crate::labels::near_face::near;

    const CAR: [f64; 3] = [4.6, 1.8, 1.5];
    const LEFT_M: f64 = 20.0;
    /// From one car to the next, bumper to bumper.
    const APART_M: f64 = 4.8;

    /// Place along x and speed of a car that drives 10 m/s, brakes from 4 s on, stands from 9 s to 12 s and drives off.
    fn stops(s: f64) -> [f64; 2] {
        let (braking, off) = ((s - 4.0).clamp(0.0, 5.0), (s - 12.0).max(0.0));
        [-40.0 + 10.0 * s.min(4.0) + 10.0 * braking - braking * braking + off * off, 10.0 - 2.0 * braking + 2.0 * off]
    }

    /// Frames 0.1 s apart with the car's near face at that distance to the left, and one close behind it in its lane.
    fn follower(cars: usize) -> Follower {
        let instant = |k: usize| {
            let time_s = k as f64 * 0.1;
            let [x, speed] = stops(time_s);
            let face = LEFT_M - 0.5 * CAR[1];
            let of = |car: usize| {
                let back = x - APART_M * car as f64;
                [-2.2, -0.7, 0.8, 2.2].map(|on| seen_from_origin([back + on, face], speed))
            };
            // masts behind the road
            let masts = (0..20).map(|k| seen_from_origin([8.0 * f64::from(k) - 60.0, 30.0], 0.0));
            Instant { time_s, reflections: (0..cars).flat_map(of).chain(masts).collect() }
        };
        let instants: Vec<Instant> = (0..160).map(instant).collect();
        let standing = Standing::of(&instants);
        let site = Site { sensor: [0.0, 0.0], start_ns: 0, end_ns: 16_000_000_000 };
        Follower { instants, standing, site, independent: false }
    }

    /// Where its near face is.
    fn face(s: f64, behind_m: f64) -> LabelPoint {
        let [x, _] = stops(s);
        let [x_m, y_m] = near([x - behind_m, LEFT_M], 0.0, CAR, [0.0, 0.0]);
        LabelPoint { time_s: s, x_m, y_m }
    }

    fn track(id: &str, points: Vec<LabelPoint>) -> LabelTrack {
        LabelTrack { id: id.into(), class: "car".into(), size_m: None, points }
    }

    /// Farthest that boxes lie from the car that is so far behind, metres.
    fn off_m(track: &LabelTrack, behind_m: f64) -> f64 {
        let boxes = crate::labels::near_face::boxes(track, [0.0, 0.0]);
        let off = boxes.iter().map(|b| {
            let [x, _] = stops(b.time_s);
            (b.center[0] - x + behind_m).hypot(b.center[1] - LEFT_M)
        });
        off.fold(0.0, f64::max)
    }

    #[test]
    fn a_click_on_a_car_gives_its_way_through_braking_standing_and_driving_off() {
        for time_s in [2.0, 6.0, 10.5, 14.0] {
            let made = follower(1).through(&track("1", Vec::new()), face(time_s, 0.0), &[]).unwrap();
            let [begin, end] = made.span_s().unwrap();
            assert!(begin < 0.5 && end > 15.0, "clicked at {time_s} s: {begin} to {end} s");
            assert!(off_m(&made, 0.0) < 1.5, "clicked at {time_s} s: {} m off", off_m(&made, 0.0));
            assert_eq!((made.id.as_str(), made.class.as_str()), ("1", "car"));
        }
    }

    #[test]
    fn where_a_label_is_wrong_it_is_replaced_and_beyond_its_points_stay() {
        let follower = follower(1);
        let good = |from: u32, to: u32| (from..=to).map(|k| face(f64::from(k) * 0.5, 0.0));
        // on the masts between 4 s and 8 s
        let wrong = (9..=15).map(|k| LabelPoint { time_s: 0.5 * f64::from(k), x_m: 10.0, y_m: 30.0 });
        let before = track("1", good(0, 8).chain(wrong).chain(good(16, 30)).collect());
        assert!(off_m(&before, 0.0) > 8.0);
        let made = follower.through(&before, face(6.0, 0.0), &[]).unwrap();
        assert!(off_m(&made, 0.0) < 1.5, "{} m off", off_m(&made, 0.0));
        for kept in [0.0, 1.0, 2.0, 11.0, 13.0, 15.0] {
            let point = |t: &LabelTrack| t.points.iter().find(|p| p.time_s == kept).copied();
            assert!(point(&made).is_some() && point(&made) == point(&before), "{kept} s: {:?}", made.points);
        }
        // what is missing is added, at the end and at the beginning
        for (part, click_s) in [(good(0, 10).collect(), 8.0), (good(16, 30).collect(), 4.0)] {
            let made = follower.through(&track("1", part), face(click_s, 0.0), &[]).unwrap();
            let [begin, end] = made.span_s().unwrap();
            assert!(begin < 0.5 && end > 14.5 && off_m(&made, 0.0) < 1.5, "{begin} to {end} s, {}", off_m(&made, 0.0));
        }
    }

    #[test]
    fn of_two_cars_bumper_to_bumper_the_one_is_followed_that_was_clicked_on() {
        for behind_m in [0.0, APART_M] {
            let made = follower(2).through(&track("1", Vec::new()), face(10.0, behind_m), &[]).unwrap();
            assert!(off_m(&made, behind_m) < 1.5, "{} m off", off_m(&made, behind_m));
        }
    }

    #[test]
    fn what_lies_in_the_box_of_another_label_is_its() {
        let follower = follower(1);
        let ahead = track("2", [0.0, 16.0].map(|s| LabelPoint { time_s: s, ..face(10.5, -APART_M) }).to_vec());
        let state = |around: &Around| {
            let motion = Motion::new([stops(10.5)[0], LEFT_M], [0.0; 2], 0.2, [1.0, 0.0], [0.2; 2]);
            let fits = |on: f64| {
                let r = seen_from_origin([stops(10.5)[0] + on, LEFT_M - 0.5], 0.0);
                State { motion, heading_rad: 0.0 }.cost(105, &r, around).is_some()
            };
            [fits(2.0), fits(2.6), fits(6.0)]
        };
        let around = |others: &[LabelTrack]| {
            Around::of(&track("1", Vec::new()), others, &follower.instants, &follower.standing, [0.0, 0.0])
        };
        assert_eq!(state(&around(&[])), [true, true, false], "at its front, just ahead of it, on the next car");
        assert_eq!(state(&around(&[ahead])), [true, false, false]);
    }

    #[test]
    fn nothing_is_followed_where_nothing_is_nor_beyond_all_numbers_nor_through_single_frames() {
        let mut follower = follower(1);
        let none = track("1", Vec::new());
        let away = LabelPoint { time_s: 6.0, x_m: 60.0, y_m: -40.0 };
        assert_eq!(follower.through(&none, away, &[]), None);
        for wild in [f64::NAN, f64::INFINITY, 1e300] {
            assert_eq!(follower.through(&none, LabelPoint { x_m: wild, ..away }, &[]), None);
            assert_eq!(follower.through(&none, LabelPoint { time_s: wild, ..away }, &[]), None);
        }
        follower.independent = true;
        assert_eq!(follower.through(&none, face(6.0, 0.0), &[]), None);
        follower.instants.clear();
        follower.independent = false;
        assert_eq!(follower.through(&none, face(6.0, 0.0), &[]), None);
    }
}
