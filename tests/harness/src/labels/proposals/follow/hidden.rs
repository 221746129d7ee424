//! Where a vehicle stood that was hidden, and how it drove off, told by where its label begins and by one reflection.
//!
//! # Model
//! What begins in the middle of the view and drives slowly came from behind something, and it stood not long ago. A
//! reflection that stood behind the beginning, in its way, is nobody else's and lies as far back as it takes to reach its
//! speed, is where it stood: there it waits from that reflection on, and drives off with the acceleration that brings it
//! to the beginning with the speed it has there. Of several such places the one with most reflections is taken. Whether
//! it is right is the person's to say, who sees it before taking it.

use super::super::reflections::{Reflection, STANDS_MPS};
use super::super::tracker::across_m;
use super::around::Around;
use crate::geometry::solid::Solid;
use crate::labels::near_face::{self, BoxStep, STEP_S};

/// A click means the beginning of a label so near to it, seconds and metres.
const AFTER_S: f64 = 1.0;
const BEFORE_S: f64 = 0.2;
const NEAR_M: f64 = 3.0;
/// Speeds at the beginning of what stood shortly before, m/s, taken over so many seconds.
const SPEEDS_MPS: std::ops::Range<f64> = 1.0..8.0;
const SPEED_S: f64 = 1.0;
/// How hard road users drive off, m/s².
const LEAST_MPS2: f64 = 0.7;
const MOST_MPS2: f64 = 3.5;
/// How long it may have stood unseen, seconds.
const LONGEST_S: f64 = 60.0;
/// How far beside its way a reflection of it lies, and how far apart along it those of one place, metres.
const BESIDE_M: f64 = 1.0;
const ALIKE_M: f64 = 1.0;

/// A reflection that may be of the vehicle as it stood.
#[derive(Debug, Clone, Copy)]
struct Stood {
    frame: usize,
    /// From the vehicle's centre then to where its label begins, metres.
    back_m: f64,
}

impl Around<'_> {
    /// The way from where the vehicle stood to where its label begins, for a click on that beginning. `None` where it did
    /// not stand before, or nothing shows where.
    pub fn hidden(&self, click: [f64; 3]) -> Option<Vec<BoxStep>> {
        let first = self.own.iter().position(Option::is_some)?;
        let begin = self.label(first)?;
        let [time_s, x, y] = click;
        let near = near_face::near(begin.center, begin.heading_rad, self.size, self.sensor);
        let meant =
            (-BEFORE_S..=AFTER_S).contains(&(time_s - begin.time_s)) && (x - near[0]).hypot(y - near[1]) <= NEAR_M;
        let speed = self.speed_at(first)?;
        if !meant || !SPEEDS_MPS.contains(&speed) {
            return None;
        }
        let stood = self.candidates(first, &begin, speed);
        let alike = |s: &Stood| stood.iter().filter(|o| (o.back_m - s.back_m).abs() <= ALIKE_M).count();
        let place = stood.iter().max_by_key(|s| (alike(s), s.frame))?;
        let from = stood.iter().filter(|o| (o.back_m - place.back_m).abs() <= ALIKE_M).map(|o| o.frame).min()?;
        Some(self.drives_off(from, &begin, place.back_m, speed))
    }

    /// Over the first second of its label, m/s.
    fn speed_at(&self, first: usize) -> Option<f64> {
        let begin = self.label(first)?;
        let later = (first + 1..self.own.len()).map_while(|k| self.label(k));
        let end = later.take_while(|l| l.time_s <= begin.time_s + SPEED_S).last()?;
        let way_m = (end.center[0] - begin.center[0]).hypot(end.center[1] - begin.center[1]);
        Some(way_m / (end.time_s - begin.time_s))
    }

    /// Reflections that may be of it as it stood: those after the last time that another one was there.
    fn candidates(&self, first: usize, begin: &BoxStep, speed: f64) -> Vec<Stood> {
        let mut found = Vec::new();
        for frame in (0..first).rev().take_while(|k| begin.time_s - self.seconds(*k) <= LONGEST_S) {
            for r in self.instants[frame].reflections.iter().filter(|r| r.doppler_mps.abs() <= STANDS_MPS && !r.fixture)
            {
                let Some(back_m) = self.back_m(r, begin) else { continue };
                let mps2 = speed * speed / (2.0 * back_m);
                // it stood until it drove off
                let stood = begin.time_s - self.seconds(frame) >= 2.0 * back_m / speed;
                if stood
                    && (LEAST_MPS2..=MOST_MPS2).contains(&mps2)
                    && !self.is_another_s(frame, r, f64::INFINITY)
                    && !self.was_another_s(frame..first, begin, back_m, speed)
                {
                    found.push(Stood { frame, back_m });
                }
            }
        }
        found
    }

    /// How far behind the beginning the vehicle's centre was whose near face is this reflection.
    fn back_m(&self, r: &Reflection, begin: &BoxStep) -> Option<f64> {
        let center = near_face::center(r.place, begin.heading_rad, self.size, self.sensor);
        let (s, c) = begin.heading_rad.sin_cos();
        let [dx, dy] = [0, 1].map(|k| center[k] - begin.center[k]);
        let (back_m, left_m) = (-(dx * c + dy * s), dy * c - dx * s);
        (back_m > 0.0 && left_m.abs() <= BESIDE_M + 0.5 * across_m(r.distance_m)).then_some(back_m)
    }

    /// Whether another label's box lies where it would have been in one of these frames.
    fn was_another_s(&self, frames: std::ops::Range<usize>, begin: &BoxStep, back_m: f64, speed: f64) -> bool {
        let shares = |solid: &Solid, frame: usize| {
            let there = place(begin, back_m, speed, self.seconds(frame)).solid(self.size);
            solid.shared(&there) > 0.1
        };
        frames.into_iter().any(|k| self.others.get(k).is_some_and(|others| others.iter().any(|o| shares(o, k))))
    }

    /// It stands from this frame on and drives off.
    fn drives_off(&self, from: usize, begin: &BoxStep, back_m: f64, speed: f64) -> Vec<BoxStep> {
        let from_s = self.seconds(from);
        let off_s = begin.time_s - 2.0 * back_m / speed;
        let moving = ((begin.time_s - off_s) / STEP_S).ceil() as u32;
        let times = (1..moving).map(|k| off_s + (begin.time_s - off_s) * f64::from(k) / f64::from(moving));
        [from_s, off_s]
            .into_iter()
            .chain(times)
            .map(|t| BoxStep { time_s: t, ..place(begin, back_m, speed, t) })
            .collect()
    }
}

/// Where it is at a time before its label begins, when it drives off with one acceleration.
fn place(begin: &BoxStep, back_m: f64, speed: f64, time_s: f64) -> BoxStep {
    let needs_s = 2.0 * back_m / speed;
    let on = ((time_s - begin.time_s + needs_s) / needs_s).clamp(0.0, 1.0);
    let (s, c) = begin.heading_rad.sin_cos();
    let behind_m = back_m * (1.0 - on * on);
    let center = [begin.center[0] - behind_m * c, begin.center[1] - behind_m * s];
    BoxStep { time_s, center, heading_rad: begin.heading_rad }
}

#[cfg(test)]
mod tests {
    use super::super::super::reflections::Instant;
    use super::super::super::reflections::tests::seen_from_origin;
    use super::super::around::Standing;
    use super::*;
    use crate::labels::near_face::{boxes, drawn};
    use crate::labels::tracks::{LabelPoint, LabelTrack};

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
        click: impl Fn(&LabelPoint) -> [f64; 3],
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

    fn on_it(p: &LabelPoint) -> [f64; 3] {
        [p.time_s, p.x_m, p.y_m]
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
            let click = |p: &LabelPoint| [p.time_s + ds, p.x_m + dx, p.y_m];
            assert_eq!(hidden(FACE, 0.0, click, &[]).is_some(), meant, "{ds} s, {dx} m");
        }
    }
}
