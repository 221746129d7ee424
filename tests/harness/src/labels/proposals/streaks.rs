//! Streaks in a lane: reflections that go on in one place of a vehicle, while it drives and while it stands.
//!
//! # Model
//! In a lane only the place along it counts, so that what stands can be followed as well as what drives: nothing else
//! gets into its place. A streak knows place and speed along the lane (Kalman, smoothed afterwards); Doppler tells the
//! speed where the line of sight does not cross the lane. One that stands waits for [`WAITS_S`], hidden by what passes.

use super::lane::Lane;
use super::motion::{Motion, smooth};
use super::pairs;
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
/// A streak that ended is gone on with: standing after so long, moving after so long, seconds, so far away, metres.
const STANDS_S: f64 = 25.0;
const MOVES_S: f64 = 2.0;
const AWAY_M: f64 = 0.7;

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

    /// How badly another one goes on with it after a gap, by the seconds of frames; `None` where it does not.
    fn goes_on(&self, after: &Self, time: impl Fn(usize) -> f64) -> Option<f64> {
        if after.first <= self.last() {
            return None;
        }
        let gap_s = time(after.first) - time(self.last());
        let ([x, u], [y, v]) = (self.along.last()?, after.along.first()?);
        let stands = u.abs().max(v.abs()) < 1.5 * STANDS_BELOW_MPS;
        let (off, within) =
            if stands { (y - x, AWAY_M) } else { (y - x - 0.5 * (u + v) * gap_s, AWAY_M + 0.5 * gap_s) };
        // what is seen shortly is no beginning or end of a long stop
        let lasts_s = |s: &Self| time(s.last()) - time(s.first);
        let in_time = if stands {
            gap_s < STANDS_S.min(lasts_s(self)).min(lasts_s(after))
        } else {
            gap_s < MOVES_S && (u - v).abs() < 2.0
        };
        (in_time && off.abs() < within).then(|| off.abs() / within + gap_s / 10.0)
    }

    /// It and another one after it, with places between.
    fn with(mut self, after: &Self) -> Option<Self> {
        let ([x, _], [y, _]) = (*self.along.last()?, after.along.first()?);
        let gap = after.first - self.last();
        self.along.extend((1..gap).map(|k| [x + k as f64 / gap as f64 * (y - x), 0.0]));
        self.along.extend(&after.along);
        self.members.extend(&after.members);
        self.beside = [0, 1].map(|k| self.beside[k] + after.beside[k]);
        Some(self)
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
        done.extend(ended_in_another(&mut running));
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
    let time = |frame: usize| instants.get(frame).map_or(0.0, |i| i.time_s);
    pairs::joined(done, |(_, before), (_, after)| before.goes_on(after, time), |first, second| first.with(&second))
}

/// Takes out those that have come to the place of another one, and gives the streaks they were.
fn ended_in_another(running: &mut Vec<Running>) -> Vec<Streak> {
    let mut ended = Vec::new();
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
            ended.extend(out.streak());
        } else {
            running[k - 1].members.append(&mut out.members);
        }
    }
    ended
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

#[cfg(test)]
mod tests {
    use super::super::reflections::Reflection;
    use super::super::reflections::tests::seen_from_origin;
    use super::*;

    const FRAMES: usize = 200;

    fn lane() -> Lane {
        Lane { points: vec![[0.0, 3.0], [150.0, 3.0]], straight: None }
    }

    /// A reflection at x metres along the lane of what drives that fast, seen from beside the lane's beginning.
    fn reflection(x: f64, speed: f64) -> Reflection {
        seen_from_origin([x, 3.0], speed)
    }

    /// Frames 0.1 s apart with one at 60 m that stands, brakes before it or drives off at 10 s, as `moves` says by the
    /// second: place, speed and whether it is seen.
    fn seen(moves: impl Fn(f64) -> (f64, f64, bool)) -> Vec<Instant> {
        let instant = |k: usize| {
            let time_s = k as f64 * 0.1;
            let (x, speed, there) = moves(time_s);
            Instant { time_s, reflections: there.then(|| reflection(x, speed)).into_iter().collect() }
        };
        (0..FRAMES).map(instant).collect()
    }

    /// Stands at 60 m until 10 s, then gains 1 m/s every second.
    fn drives_off(s: f64) -> (f64, f64) {
        let since = (s - 10.0).max(0.0);
        (60.0 + 0.5 * since * since, since)
    }

    #[test]
    fn one_that_stands_and_then_drives_is_one_streak_from_the_beginning() {
        let all = streaks(&lane(), &seen(|s| (drives_off(s).0, drives_off(s).1, true)));
        let [one] = &all[..] else { panic!("{} streaks", all.len()) };
        assert_eq!((one.first, one.members.len()), (0, one.along.len()));
        for (k, [x, speed]) in one.along.iter().enumerate() {
            let (at, fast) = drives_off(k as f64 * 0.1);
            assert!(
                (x - at).abs() < 0.4 && (speed - fast).abs() < 0.5,
                "frame {k}: {x} m of {at}, {speed} m/s of {fast}"
            );
        }
    }

    #[test]
    fn one_that_stands_is_waited_for_and_one_that_leaves_unseen_is_another() {
        let hidden = |from: f64, to: f64| move |s: f64| (drives_off(s).0, drives_off(s).1, s < from || s > to);
        let all = streaks(&lane(), &seen(hidden(4.0, 6.5)));
        assert_eq!(all.len(), 1, "it stood behind what passed");
        assert_eq!(all[0].along.len(), all[0].last() + 1, "a place for every frame of it");
        // from 60 m to 68 m unseen
        assert_eq!(streaks(&lane(), &seen(hidden(6.0, 14.0))).len(), 2);
    }

    #[test]
    fn two_that_stand_two_metres_apart_are_two_and_know_who_is_beside_them() {
        let mut instants = seen(|s| (drives_off(s).0, drives_off(s).1, true));
        instants.iter_mut().for_each(|i| i.reflections.extend([reflection(62.0, 0.0), reflection(63.0, 0.0)]));
        instants.truncate(90);
        let mut all = streaks(&lane(), &instants);
        all.sort_by(|a, b| a.along[0][0].total_cmp(&b.along[0][0]));
        let places: Vec<f64> = all.iter().map(|s| s.along[0][0].round()).collect();
        assert_eq!(places, [60.0, 62.0, 63.0]);
        assert_eq!(all[0].beside, [0, 0]);
        assert!(all[1].beside[0] == 0 && all[1].beside[1] > 60 && all[2].beside[0] > 60 && all[2].beside[1] == 0);
    }

    #[test]
    fn what_lies_beside_the_lane_drives_against_it_or_is_fast_is_followed_elsewhere() {
        let mut beside = seen(|_| (60.0, 0.0, true));
        beside.iter_mut().for_each(|i| i.reflections[0].place[1] = 6.5);
        assert!(streaks(&lane(), &beside).is_empty());
        assert!(streaks(&lane(), &seen(|s| (100.0 - 3.0 * s, -3.0, true))).is_empty());
        assert!(streaks(&lane(), &seen(|s| (10.0 + 20.0 * s, 20.0, s < 5.0))).is_empty());
        let mut fixture = seen(|_| (60.0, 0.0, true));
        fixture.iter_mut().for_each(|i| i.reflections[0].fixture = true);
        assert!(streaks(&lane(), &fixture).is_empty());
    }
}
