//! Where a vehicle stood that was hidden, and how it drove off, told by where its label begins and by one reflection.
//!
//! # Model
//! What begins in the middle of the view and drives slowly came from behind something, and it stood not long ago. A
//! reflection that stood behind the beginning, in its way, is nobody else's and lies as far back as it takes to reach its
//! speed, is where it stood: there it waits from that reflection on, and drives off with the acceleration that brings it
//! to the beginning with the speed it has there. Of several such places the one with most reflections is taken. Whether
//! it is right is the person's to say, who sees it before taking it.

use std::ops::Range;

use super::super::reflections::{Reflection, STANDS_MPS};
use super::super::tracker::across_m;
use super::around::Around;
use crate::labels::near_face::{self, BoxStep, STEP_S};
use crate::labels::tracks::LabelPoint;

/// A click means the beginning of a label so near to it, seconds and metres.
const AFTER_S: f64 = 1.0;
const BEFORE_S: f64 = 0.2;
const NEAR_M: f64 = 3.0;
/// Speeds at the beginning of what stood shortly before, m/s, taken over so many seconds.
const SPEEDS_MPS: Range<f64> = 1.0..8.0;
const SPEED_S: f64 = 1.0;
/// How hard road users drive off, m/s².
const LEAST_MPS2: f64 = 0.7;
const MOST_MPS2: f64 = 3.5;
/// How long it may have stood unseen, seconds.
const LONGEST_S: f64 = 60.0;
/// How far beside its way a reflection of it lies, and how far apart along it those of one place, metres.
const BESIDE_M: f64 = 1.0;
const ALIKE_M: f64 = 1.0;
/// Share of a box that another one has at most.
const SHARED: f64 = 0.1;

/// How it drove off from where it stood.
#[derive(Debug, Clone, Copy)]
struct Departure {
    /// Where its label begins, and its speed there, m/s.
    begin: BoxStep,
    speed: f64,
    /// From its centre when it stood to that place, metres.
    back_m: f64,
}

impl Departure {
    fn lasts_s(&self) -> f64 {
        2.0 * self.back_m / self.speed
    }

    fn begins_s(&self) -> f64 {
        self.begin.time_s - self.lasts_s()
    }

    fn mps2(&self) -> f64 {
        self.speed / self.lasts_s()
    }

    /// Where it is at a time before its label begins.
    fn at(&self, time_s: f64) -> BoxStep {
        let on = ((time_s - self.begins_s()) / self.lasts_s()).clamp(0.0, 1.0);
        let behind_m = self.back_m * (1.0 - on * on);
        let [x, y] = self.begin.center;
        let (s, c) = self.begin.heading_rad.sin_cos();
        BoxStep { time_s, center: [x - behind_m * c, y - behind_m * s], ..self.begin }
    }

    /// It stands from a time on and drives off.
    fn way(&self, from_s: f64) -> Vec<BoxStep> {
        let parts = (self.lasts_s() / STEP_S).ceil();
        let moving = (1..parts as u32).map(|k| self.begins_s() + self.lasts_s() * f64::from(k) / parts);
        [from_s, self.begins_s()].into_iter().chain(moving).map(|time_s| self.at(time_s)).collect()
    }
}

impl Around<'_> {
    /// The way from where the vehicle stood to where its label begins, for a click on that beginning. `None` where it did
    /// not stand before, or nothing shows where.
    pub fn hidden(&self, click: LabelPoint) -> Option<Vec<BoxStep>> {
        let first = self.own.iter().position(Option::is_some)?;
        let begin = self.label(first)?;
        let near = near_face::near(begin.center, begin.heading_rad, self.size, self.sensor);
        let meant = (-BEFORE_S..=AFTER_S).contains(&(click.time_s - begin.time_s))
            && (click.x_m - near[0]).hypot(click.y_m - near[1]) <= NEAR_M;
        let speed = self.speed_at(first)?;
        if !meant || !SPEEDS_MPS.contains(&speed) {
            return None;
        }
        let stood = self.candidates(first, begin, speed);
        let alike = |d: &Departure| {
            let back_m = d.back_m;
            stood.iter().filter(move |(_, o)| (o.back_m - back_m).abs() <= ALIKE_M)
        };
        let (_, departure) = stood.iter().max_by_key(|(frame, d)| (alike(d).count(), *frame))?;
        let from = alike(departure).map(|(frame, _)| *frame).min()?;
        Some(departure.way(self.seconds(from)))
    }

    /// Over the first second of its label, m/s.
    fn speed_at(&self, first: usize) -> Option<f64> {
        let begin = self.label(first)?;
        let later = (first + 1..self.own.len()).map_while(|k| self.label(k));
        let end = later.take_while(|l| l.time_s <= begin.time_s + SPEED_S).last()?;
        let way_m = (end.center[0] - begin.center[0]).hypot(end.center[1] - begin.center[1]);
        Some(way_m / (end.time_s - begin.time_s))
    }

    /// Reflections that may be of it as it stood, by their frames: those after the last time that another one was there.
    fn candidates(&self, first: usize, begin: BoxStep, speed: f64) -> Vec<(usize, Departure)> {
        let mut found = Vec::new();
        for frame in (0..first).rev().take_while(|k| begin.time_s - self.seconds(*k) <= LONGEST_S) {
            let stand = |r: &&Reflection| r.doppler_mps.abs() <= STANDS_MPS && !r.fixture;
            for r in self.instants[frame].reflections.iter().filter(stand) {
                let Some(back_m) = self.back_m(r, &begin) else { continue };
                let departure = Departure { begin, speed, back_m };
                if self.seconds(frame) <= departure.begins_s()
                    && (LEAST_MPS2..=MOST_MPS2).contains(&departure.mps2())
                    && !self.is_another_s(frame, r, f64::INFINITY)
                    && !self.was_another_s(frame..first, &departure)
                {
                    found.push((frame, departure));
                }
            }
        }
        found
    }

    /// How far behind the beginning the vehicle's centre was whose near face is this reflection.
    fn back_m(&self, r: &Reflection, begin: &BoxStep) -> Option<f64> {
        let center = near_face::center(r.place, begin.heading_rad, self.size, self.sensor);
        let [ahead_m, left_m] = begin.solid(self.size).local(center);
        (ahead_m < 0.0 && left_m.abs() <= BESIDE_M + 0.5 * across_m(r.distance_m)).then_some(-ahead_m)
    }

    /// Whether another label's box lies where it would have been in one of these frames.
    fn was_another_s(&self, mut frames: Range<usize>, departure: &Departure) -> bool {
        frames.any(|frame| {
            let there = departure.at(self.seconds(frame)).solid(self.size);
            self.others.get(frame).is_some_and(|others| others.iter().any(|o| o.shared(&there) > SHARED))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::reflections::Instant;
    use super::super::super::reflections::tests::seen_from_origin;
    use super::super::around::Standing;
    use super::*;
    use crate::labels::near_face::{boxes, drawn};
    use crate::labels::tracks::LabelTrack;

    const LEFT_M: f64 = 30.0;
    const OFF_S: f64 = 20.0;

    /// Place along x of a car that stands at 5 m and drives off with 1.2 m/s² at 20 s.
    fn x_m(s: f64) -> f64 {
        5.0 + 0.6 * (s - OFF_S).max(0.0).powi(2)
    }

    fn car(id: &str, from: f64, to: f64, x: impl Fn(f64) -> f64) -> LabelTrack {
        let steps: Vec<BoxStep> = (0..=((to - from) / 0.1).round() as u32)
            .map(|k| from + f64::from(k) * 0.1)
            .map(|s| BoxStep { time_s: s, center: [x(s), LEFT_M], heading_rad: 0.0 })
            .collect();
        let size = [4.6, 1.8, 1.5];
        LabelTrack { id: id.into(), class: "car".into(), size_m: None, points: drawn(&steps, size, [0.0; 2], 0.05) }
    }

    /// What is made of a click on the beginning of its label, 4 s after it drove off. At 6 s something reflects at `stood`,
    /// with this Doppler.
    fn hidden(
        stood: [f64; 2],
        doppler_mps: f64,
        click: impl Fn(&LabelPoint) -> LabelPoint,
        others: &[LabelTrack],
    ) -> Option<LabelTrack> {
        let instants: Vec<Instant> = (0..300)
            .map(|k| {
                let time_s = f64::from(k) * 0.1;
                let r = Reflection { doppler_mps, ..seen_from_origin(stood, 0.0) };
                Instant { time_s, reflections: if k == 60 { vec![r] } else { Vec::new() } }
            })
            .collect();
        let standing = Standing::of(&instants);
        let label = car("1", OFF_S + 4.0, OFF_S + 8.0, x_m);
        let around = Around::of(&label, others, &instants, &standing, [0.0, 0.0]);
        let steps = around.hidden(click(&label.points[0]))?;
        Some(LabelTrack { points: drawn(&steps, around.size, [0.0; 2], 0.1), ..label })
    }

    fn on_it(p: &LabelPoint) -> LabelPoint {
        *p
    }

    const FACE: [f64; 2] = [5.2, LEFT_M - 0.9];

    #[test]
    fn one_reflection_behind_a_label_tells_where_it_stood_and_when_it_drove_off() {
        let made = hidden(FACE, 0.0, on_it, &[]).unwrap();
        assert_eq!(made.span_s().map(|s| (s[0] * 10.0).round()), Some(60.0));
        for b in boxes(&made, [0.0, 0.0]) {
            let off_m = (b.center[0] - x_m(b.time_s)).hypot(b.center[1] - LEFT_M);
            assert!(off_m < 1.2 && b.heading_rad.abs() < 0.1, "{off_m} m off at {} s: {b:?}", b.time_s);
        }
    }

    #[test]
    fn what_moves_lies_elsewhere_or_is_another_s_tells_nothing() {
        assert!(hidden(FACE, 1.0, on_it, &[]).is_none(), "moves");
        assert!(hidden([5.2, LEFT_M + 3.0], 0.0, on_it, &[]).is_none(), "in another lane");
        assert!(hidden([25.0, LEFT_M - 0.9], 0.0, on_it, &[]).is_none(), "ahead");
        assert!(hidden([12.5, LEFT_M - 0.9], 0.0, on_it, &[]).is_none(), "too near to get so fast");
        assert!(hidden([-25.0, LEFT_M - 0.9], 0.0, on_it, &[]).is_none(), "too far to be so slow");
        let other = |from, to| [car("2", from, to, |_| 5.0)];
        assert!(hidden(FACE, 0.0, on_it, &other(5.0, 7.0)).is_none(), "another's reflection");
        assert!(hidden(FACE, 0.0, on_it, &other(10.0, 12.0)).is_none(), "another stood there later");
        assert!(hidden(FACE, 0.0, on_it, &other(1.0, 4.0)).is_some(), "another stood there before");
    }

    #[test]
    fn only_a_click_on_the_beginning_asks_for_it() {
        for (ds, dx, meant) in [(0.5, 1.0, true), (-1.0, 0.0, false), (2.0, 0.0, false), (0.0, 5.0, false)] {
            let click = |p: &LabelPoint| LabelPoint { time_s: p.time_s + ds, x_m: p.x_m + dx, ..*p };
            assert_eq!(hidden(FACE, 0.0, click, &[]).is_some(), meant, "{ds} s, {dx} m");
        }
    }
}
