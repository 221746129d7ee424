//! Streaks in a lane: reflections that go on in one place of a vehicle, while it drives and while it stands.
//!
//! # Model
//! In a lane only the place along it counts, so that what stands can be followed as well as what drives: nothing else
//! gets into its place. A streak knows place and speed along the lane (Kalman, smoothed afterwards); Doppler tells the
//! speed where the line of sight does not cross the lane. One that stands waits for [`WAITS_S`], hidden by what passes.

use super::lane::Lane;
use super::motion::{Motion, smooth};
use super::reflections::{Instant, STANDS_MPS};
use super::tracker::across_m;

/// How far from the middle of a lane reflections of its vehicles lie, metres; and the share of a place's spread.
const WITHIN_M: f64 = 1.5;
const SPREAD: f64 = 0.4;
/// Spread of a place along the line of sight, metres, and of the speed that Doppler tells, m/s.
const RADIAL_M: f64 = 0.3;
const DOPPLER_MPS: f64 = 0.3;
/// Cosine between lane and line of sight from which on Doppler tells the speed.
const TELLS_COS: f64 = 0.25;
/// Nobody drives against the lane faster than this; what is faster than that is followed elsewhere, m/s.
const AGAINST_MPS: f64 = -1.5;
const FASTEST_MPS: f64 = 10.0;
/// Farthest a reflection lies from its streak, metres.
const GATE_M: f64 = 1.0;
/// Two streaks as close as this, metres, and as fast, m/s, are one.
const ONE_M: f64 = 0.35;
const ALIKE_MPS: f64 = 1.5;
/// Reflections that far from one are beside it, metres.
const BESIDE_M: std::ops::Range<f64> = 0.4..1.3;
/// Speed below which one stands, m/s.
pub const STANDS_BELOW_MPS: f64 = 0.4;
/// How long one is waited for: when it stands, when it moves, when it is young, seconds; and how long it is young, frames.
const WAITS_S: f64 = 2.0;
const COASTS_S: f64 = 0.8;
const YOUNG_S: f64 = 0.35;
const YOUNG: usize = 6;
/// Weight of a frame in how often it is seen lately; a streak with fewer frames than this is a part of another one.
const LATELY: f64 = 0.04;
const SAME: usize = 30;

/// One of them: a place along the lane for every frame.
#[derive(Debug, Clone)]
pub struct Streak {
    pub members: Vec<(usize, usize)>,
    pub first: usize,
    /// Place along the lane, metres, and speed, m/s.
    pub along: Vec<[f64; 2]>,
    /// Reflections shortly behind and ahead of it.
    pub beside: [usize; 2],
}

impl Streak {
    pub fn last(&self) -> usize {
        self.first + self.along.len().saturating_sub(1)
    }

    pub fn at(&self, frame: usize) -> Option<[f64; 2]> {
        self.along.get(frame.checked_sub(self.first)?).copied()
    }
}

/// A reflection in the lane.
struct Seen {
    index: usize,
    along_m: f64,
    spread_m: f64,
    /// Speed along the lane and its spread.
    speed: Option<[f64; 2]>,
}

struct Running {
    motion: Motion,
    members: Vec<(usize, usize)>,
    first: usize,
    filtered: Vec<(f64, Motion)>,
    hits: usize,
    /// Share of the frames in which it was seen lately.
    seen: f64,
    last_s: f64,
    last_frame: usize,
    beside: [usize; 2],
}

/// The streaks of a lane.
pub fn streaks(lane: &Lane, instants: &[Instant]) -> Vec<Streak> {
    let (mut running, mut done): (Vec<Running>, Vec<Streak>) = Default::default();
    let mut before_s = None;
    for (frame, instant) in instants.iter().enumerate() {
        let dt_s = before_s.map_or(0.0, |t: f64| instant.time_s - t);
        before_s = Some(instant.time_s);
        for r in &mut running {
            r.motion.predict(dt_s);
        }
        let seen = seen(lane, instant);
        let mut own: Vec<Vec<usize>> = vec![Vec::new(); running.len()];
        let mut free = Vec::new();
        for (i, s) in seen.iter().enumerate() {
            let costs = running.iter().enumerate().filter_map(|(k, r)| Some((k, r.cost(s)?)));
            match costs.min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((k, _)) => own[k].push(i),
                None => free.push(i),
            }
        }
        for (r, own) in running.iter_mut().zip(&own) {
            r.take(frame, instant.time_s, own, &seen);
        }
        running.sort_by(|a, b| a.motion.state[0].total_cmp(&b.motion.state[0]));
        let mut k = 1;
        while k < running.len() {
            let [a, b] = [&running[k - 1], &running[k]];
            let close = b.motion.state[0] - a.motion.state[0] < ONE_M;
            if !close || (b.motion.state[2] - a.motion.state[2]).abs() > ALIKE_MPS {
                k += 1;
                continue;
            }
            // what waits there has left unseen, or was seen less since it is of the other
            let fewer = b.seen < a.seen;
            let mut out = running.remove(if fewer { k } else { k - 1 });
            if out.filtered.len() > SAME {
                done.extend(out.streak());
            } else {
                running[k - 1].members.append(&mut out.members);
            }
        }
        running.retain_mut(|r| {
            let waits_s = match () {
                () if r.hits < YOUNG => YOUNG_S,
                () if r.motion.state[2].abs() < STANDS_BELOW_MPS => WAITS_S,
                () => COASTS_S,
            };
            let ends = instant.time_s - r.last_s > waits_s || r.motion.state[2].abs() > FASTEST_MPS;
            if ends {
                done.extend(r.streak());
            }
            !ends
        });
        running.extend(births(frame, instant.time_s, &free, &seen));
    }
    done.extend(running.iter_mut().filter_map(Running::streak));
    done
}

/// What lies in the lane and may be of a vehicle that keeps to it, along it.
fn seen(lane: &Lane, instant: &Instant) -> Vec<Seen> {
    let all = instant.reflections.iter().enumerate().filter(|(_, r)| !r.fixture);
    let all = all.filter_map(|(index, r)| {
        let beside = lane.beside(r.place)?;
        let across = across_m(r.distance_m);
        if beside.left_m.abs() > WITHIN_M + SPREAD * across {
            return None;
        }
        let ([ux, uy], [c, s]) = (r.sight, beside.heading);
        let cos = ux * c + uy * s;
        let speed = (cos.abs() > TELLS_COS).then(|| [r.doppler_mps / cos, DOPPLER_MPS / cos.abs()]);
        let fits = speed.is_none_or(|[v, _]| v > AGAINST_MPS && v < 1.5 * FASTEST_MPS);
        let spread_m = (RADIAL_M * cos).hypot(0.5 * across * (1.0 - cos * cos).max(0.0).sqrt());
        // across the lane nothing of its own moves
        let fits = fits && (speed.is_some() || r.doppler_mps.abs() < 3.0 * STANDS_MPS + FASTEST_MPS * TELLS_COS);
        fits.then_some(Seen { index, along_m: beside.along_m, spread_m, speed })
    });
    all.collect()
}

impl Running {
    /// How badly a reflection fits; `None` where it does not.
    fn cost(&self, s: &Seen) -> Option<f64> {
        let off = (s.along_m - self.motion.state[0]).abs();
        if off > GATE_M {
            return None;
        }
        let spread = self.motion.variance([1.0, 0.0, 0.0, 0.0]).sqrt().hypot(s.spread_m);
        let faster = s.speed.map_or(0.0, |[v, spread]| {
            (v - self.motion.state[2]).abs() / spread.hypot(self.motion.variance([0.0, 0.0, 1.0, 0.0]).sqrt()).max(0.35)
        });
        (off < 3.0 * spread && faster < 3.5).then(|| (off / spread).powi(2) + faster.powi(2))
    }

    fn take(&mut self, frame: usize, now_s: f64, own: &[usize], seen: &[Seen]) {
        self.seen += LATELY * (f64::from(u8::from(!own.is_empty())) - self.seen);
        if own.is_empty() {
            if self.motion.state[2].abs() < STANDS_BELOW_MPS {
                self.motion.update([0.0, 0.0, 1.0, 0.0], 0.0, 0.05);
            }
        } else {
            let n = own.len() as f64;
            let mean = |f: &dyn Fn(&Seen) -> f64| own.iter().map(|i| f(&seen[*i])).sum::<f64>() / n;
            self.motion.update([1.0, 0.0, 0.0, 0.0], mean(&|s| s.along_m), mean(&|s| s.spread_m));
            for [v, spread] in own.iter().filter_map(|i| seen[*i].speed) {
                self.motion.update([0.0, 0.0, 1.0, 0.0], v, spread);
            }
            self.members.extend(own.iter().map(|i| (frame, seen[*i].index)));
            (self.hits, self.last_s, self.last_frame) = (self.hits + 1, now_s, frame);
        }
        for s in seen {
            let ahead_m = s.along_m - self.motion.state[0];
            if BESIDE_M.contains(&ahead_m.abs()) {
                self.beside[usize::from(ahead_m > 0.0)] += 1;
            }
        }
        self.filtered.push((now_s, self.motion));
    }

    fn streak(&mut self) -> Option<Streak> {
        if self.hits < YOUNG {
            return None;
        }
        self.filtered.truncate(self.last_frame + 1 - self.first);
        let along = smooth(&self.filtered).into_iter().map(|(_, m)| [m.state[0], m.state[2]]).collect();
        let members = std::mem::take(&mut self.members);
        Some(Streak { members, first: self.first, along, beside: self.beside })
    }
}

/// Streaks that begin with what belongs to none.
fn births(frame: usize, now_s: f64, free: &[usize], seen: &[Seen]) -> Vec<Running> {
    let mut left: Vec<usize> = free.to_vec();
    left.sort_by(|a, b| seen[*a].along_m.total_cmp(&seen[*b].along_m));
    let mut all: Vec<Running> = Vec::new();
    for i in left {
        let s = &seen[i];
        let speed = s.speed.unwrap_or([0.0, 3.0]);
        if speed[0].abs() > FASTEST_MPS {
            continue;
        }
        if let Some(before) = all.last_mut()
            && s.along_m - before.motion.state[0] < 2.0 * ONE_M
            && (speed[0] - before.motion.state[2]).abs() < 1.0
        {
            before.members.push((frame, s.index));
            continue;
        }
        let motion = Motion::new([s.along_m, 0.0], [speed[0], 0.0], s.spread_m, [1.0, 0.0], [speed[1], 0.1]);
        all.push(Running {
            motion,
            members: vec![(frame, s.index)],
            first: frame,
            filtered: vec![(now_s, motion)],
            hits: 1,
            seen: LATELY,
            last_s: now_s,
            last_frame: frame,
            beside: [0; 2],
        });
    }
    all
}
