//! The way of a vehicle from a click on, in one direction of time, and how much it is worth.

use super::super::reflections::STANDS_MPS;
use super::around::Around;
use super::state::{FITS, State};

/// How long it is followed unseen while it moves, and while it stands, seconds.
const COASTS_S: f64 = 2.5;
const WAITS_S: f64 = 8.0;
/// What a frame of a way has to be worth for the way to go on over it; what one counts for while it stands, and against it
/// while it is not seen.
const GOES_ON: f64 = 0.1;
const STANDING: f64 = 0.01;
const WAITING: f64 = 0.05;
/// Share of the usual number of standing reflections by which it is still there, and the weight of a frame in that.
const STAYS: f64 = 0.5;
const LATELY: f64 = 0.05;
/// It meets the label where it is this near, along by a share of its length and at most so many metres, across in metres,
/// and as fast, m/s, for so many frames.
const MEETS_LENGTHS: f64 = 0.35;
const MEETS_ALONG_M: f64 = 2.5;
const MEETS_M: f64 = 1.5;
const MEETS_MPS: f64 = 2.0;
const MEETS_FRAMES: usize = 5;
/// What the label says nearer than this to the click is no meeting, seconds.
const APART_S: f64 = 0.3;
/// What a frame without a reflection counts for against a way when ways are compared, meeting the label for it, missing it
/// against it, and each second of the label that it replaces.
const UNSEEN: f64 = 0.3;
const MET: f64 = 5.0;
const MISSED: f64 = 15.0;
const REPLACED: f64 = 1.0;
/// So far from the click a frame counts for less by a factor of e, seconds.
const COUNTS_S: f64 = 3.0;
/// Reflections that show a vehicle as well as more would.
const WELL: f64 = 3.0;

/// A frame of a way.
#[derive(Debug, Clone)]
pub struct Step {
    pub frame: usize,
    pub state: State,
    /// Its reflections.
    pub own: Vec<usize>,
}

/// A way through the frames, in the order it was followed.
#[derive(Debug, Clone, Default)]
pub struct Way {
    pub steps: Vec<Step>,
    /// How well the reflections fit.
    good: f64,
    /// Whether it came to the label that is there.
    pub met: bool,
}

impl Around<'_> {
    /// The way from a frame on, which is its first step, for as long as it is seen.
    pub fn follow(&self, frame: usize, begin: State, backwards: bool) -> Way {
        let mut way = Way::default();
        let mut state = begin;
        let begin_s = self.seconds(frame);
        let (mut before_s, mut seen_s) = (begin_s, begin_s);
        // up to where it is worth it, and how much
        let (mut kept, mut worth, mut best, mut stood) = (1, 0.0, 0.0, true);
        let (mut meeting, mut usual) = (0, 0.0);
        let frames: Vec<usize> =
            if backwards { (0..=frame).rev().collect() } else { (frame..self.instants.len()).collect() };
        for k in frames {
            let now_s = self.seconds(k);
            state.motion.predict(now_s - before_s);
            before_s = now_s;
            let mut fitting = state.fitting(k, self);
            // as long as what stands is as many as ever, it has not left, whatever passes
            if state.stands() {
                let stands = |(i, _): &(usize, f64)| self.instants[k].reflections[*i].doppler_mps.abs() <= STANDS_MPS;
                let many = fitting.iter().filter(|f| stands(f)).count() as f64;
                if many > 0.0 && many >= STAYS * usual {
                    fitting.retain(stands);
                }
                usual += LATELY * (many - usual);
            }
            let own: Vec<usize> = fitting.iter().map(|(i, _)| *i).collect();
            state.measure(k, &own, self);
            let good = self.good(k, &fitting);
            way.good += self.counts(k, frame) * good;
            stood &= state.stands();
            let empty = own.is_empty();
            if !empty {
                seen_s = now_s;
            }
            worth += if empty {
                -WAITING
            } else if stood {
                STANDING
            } else {
                good - GOES_ON
            };
            way.steps.push(Step { frame: k, state, own });
            if worth >= best && !empty {
                (kept, best) = (way.steps.len(), worth);
            }
            let apart = (now_s - begin_s).abs() > APART_S;
            meeting = if apart && self.meets(k, &state) { meeting + 1 } else { 0 };
            if meeting >= MEETS_FRAMES {
                way.met = true;
                return way;
            }
            let waits_s = if state.stands() { WAITS_S } else { COASTS_S };
            if (now_s - seen_s).abs() > waits_s {
                break;
            }
        }
        way.steps.truncate(kept);
        way
    }

    /// How much better a way is than the label that it replaces.
    pub fn worth(&self, way: &Way, frame: usize, backwards: bool) -> f64 {
        let (first, last) = if backwards { (0, frame) } else { (frame, self.own.len()) };
        let goes_on = self.own[first..last].iter().any(Option::is_some);
        let end = match (way.met, goes_on) {
            (true, _) => MET,
            (false, true) => -MISSED,
            (false, false) => 0.0,
        };
        let before = way.steps.iter().filter_map(|step| {
            let label = State::labelled(self, step.frame)?;
            Some(self.counts(step.frame, frame) * self.good(step.frame, &label.fitting(step.frame, self)))
        });
        let replaced = way.steps.iter().filter(|step| self.label(step.frame).is_some());
        let ends = [replaced.clone().next(), replaced.clone().next_back()]
            .map(|s| s.map_or(0.0, |step| self.seconds(step.frame)));
        way.good - before.sum::<f64>() + end - REPLACED * (ends[1] - ends[0]).abs()
    }

    /// How much a frame counts that is so far from the click.
    fn counts(&self, frame: usize, click: usize) -> f64 {
        (-(self.seconds(frame) - self.seconds(click)).abs() / COUNTS_S).exp()
    }

    /// How well the reflections of a frame fit.
    fn good(&self, frame: usize, fitting: &[(usize, f64)]) -> f64 {
        if fitting.is_empty() {
            return -UNSEEN;
        }
        let all = &self.instants[frame].reflections;
        let weights = fitting.iter().map(|(i, _)| self.weight(&all[*i]));
        let n = weights.clone().sum::<f64>();
        if n < 0.01 {
            return 0.0;
        }
        let cost = fitting.iter().zip(weights).map(|((_, cost), w)| w * cost).sum::<f64>() / n;
        (n / WELL).min(1.0) * (1.0 - cost / FITS)
    }

    /// Whether it is where its label is.
    fn meets(&self, frame: usize, state: &State) -> bool {
        let Some((step, velocity)) = self.label(frame).zip(self.velocity(frame)) else {
            return false;
        };
        let (s, c) = step.heading_rad.sin_cos();
        let [dx, dy] = [0, 1].map(|k| state.motion.place()[k] - step.center[k]);
        let [along, left] = [dx * c + dy * s, -dx * s + dy * c];
        let [vx, vy] = state.motion.velocity();
        along.abs() < (MEETS_LENGTHS * self.size[0] + 0.5).min(MEETS_ALONG_M)
            && left.abs() < MEETS_M
            && (vx - velocity[0]).hypot(vy - velocity[1]) < MEETS_MPS
    }
}
