//! Tracklets: reflections that follow one another by place and Doppler, in one direction of time.
//!
//! # Model
//! A tracklet knows place, velocity and how far its reflections reach along its heading. A reflection belongs to the
//! tracklet whose prediction it fits best; what belongs to none and moves begins tracklets. A tracklet without
//! reflections goes on as predicted for [`COAST_S`], then ends.

use std::collections::HashMap;

use super::lane::{Beside, Lane, nearest};
use super::motion::Motion;
use super::reflections::{Instant, Reflection, STANDS_MPS};

/// Doppler from which on a reflection may begin a tracklet, m/s.
const MOVES_MPS: f64 = 0.6;
/// How long a tracklet lasts without reflections, seconds; a young one less.
const COAST_S: f64 = 1.5;
const YOUNG_COAST_S: f64 = 0.35;
/// Frames with reflections from which on it is no longer young.
const GROWN_FRAMES: usize = 6;
/// Speed below which a heading is not read from the velocity, m/s.
const HEADED_MPS: f64 = 2.0;
/// Speed below which vehicles may stand in a queue, m/s.
const SLOW_MPS: f64 = 6.0;
/// Speed below which something whose Doppler says it stands is taken to stand, m/s.
const STOPPED_MPS: f64 = 1.0;
/// Longest vehicle, metres.
pub const LONGEST_M: f64 = 18.0;
/// Doppler of one vehicle's reflections differs by about this, m/s.
pub const DOPPLER_MPS: f64 = 0.35;

/// How closely vehicles keep to the middle of their lane, metres, and along it, m/s.
const IN_LANE_M: f64 = 0.5;
const IN_LANE_MPS: f64 = 0.3;

/// Half of a lane, metres.
const LANE_HALF_M: f64 = 1.8;

/// Reflections of one road user: frame and index in it, in the order they were found.
#[derive(Debug, Clone, Default)]
pub struct Tracklet {
    pub members: Vec<(usize, usize)>,
    /// Number of the lane it keeps to.
    pub lane: Option<usize>,
}

struct Running {
    motion: Motion,
    heading: Option<[f64; 2]>,
    /// Where its reflections lie along the heading, from the place on, metres.
    reach: [f64; 2],
    members: Vec<(usize, usize)>,
    frames: usize,
    last_s: f64,
    lane: Option<usize>,
}

/// Neighbouring frames are wrong alike, so each counts for less.
pub const ALIKE: f64 = 2.0;

/// Spread of a place across the line of sight, metres.
pub fn across_m(distance_m: f64) -> f64 {
    0.4 + 0.008 * distance_m
}

/// Tracklets of all frames, forwards in time or backwards.
pub fn tracklets(instants: &[Instant], lanes: &[Lane], backwards: bool, progress: &dyn Fn(f64)) -> Vec<Tracklet> {
    let sign = if backwards { -1.0 } else { 1.0 };
    let (mut running, mut done): (Vec<Running>, Vec<Tracklet>) = Default::default();
    let mut before_s = None;
    for step in 0..instants.len() {
        let frame = if backwards { instants.len() - 1 - step } else { step };
        let instant = &instants[frame];
        let now_s = sign * instant.time_s;
        let dt_s = before_s.map_or(0.0, |t: f64| now_s - t);
        before_s = Some(now_s);
        for r in &mut running {
            r.motion.predict(dt_s);
        }
        let owners = owners(&running, &instant.reflections, sign, now_s);
        for (k, r) in running.iter_mut().enumerate() {
            let own: Vec<usize> = (0..owners.len()).filter(|i| owners[*i] == Some(k)).collect();
            r.take(frame, &own, &instant.reflections, lanes, sign, now_s);
        }
        running.retain_mut(|r| {
            let young = r.frames < GROWN_FRAMES;
            let lost = now_s - r.last_s > if young { YOUNG_COAST_S } else { COAST_S };
            if lost && !young {
                done.push(Tracklet { members: std::mem::take(&mut r.members), lane: r.lane });
            }
            !lost
        });
        let free: Vec<usize> = (0..owners.len()).filter(|i| owners[*i].is_none()).collect();
        running.extend(births(frame, &free, &instant.reflections, lanes, sign, now_s));
        if step % 32 == 0 {
            progress(step as f64 / instants.len() as f64);
        }
    }
    done.extend(
        running.into_iter().filter(|r| r.frames >= GROWN_FRAMES).map(|r| Tracklet { members: r.members, lane: r.lane }),
    );
    done
}

/// The tracklet each reflection fits best.
fn owners(running: &[Running], reflections: &[Reflection], sign: f64, now_s: f64) -> Vec<Option<usize>> {
    let fits = |r: &Reflection| {
        let costs = running.iter().enumerate().filter_map(|(k, t)| Some((k, t.cost(r, sign, now_s)?)));
        costs.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    reflections.iter().map(|r| if r.fixture { None } else { fits(r) }).collect()
}

impl Running {
    /// How badly a reflection fits; `None` where it does not.
    fn cost(&self, r: &Reflection, sign: f64, now_s: f64) -> Option<f64> {
        let [x, y] = self.motion.place();
        let [dx, dy] = [r.place[0] - x, r.place[1] - y];
        // squares, since most of all pairs end here
        if dx * dx + dy * dy > (LONGEST_M + 8.0) * (LONGEST_M + 8.0) {
            return None;
        }
        let [ux, uy] = r.sight;
        let h = [0.0, 0.0, ux, uy];
        let [vx, vy] = self.motion.velocity();
        let doppler = sign * r.doppler_mps - (ux * vx + uy * vy);
        let doppler_spread = DOPPLER_MPS.hypot(self.motion.variance(h).sqrt().min(1.0));
        if doppler.abs() > 3.0 * doppler_spread {
            return None;
        }
        let missed = (now_s - self.last_s).min(COAST_S);
        let [along, left, beyond];
        match self.heading {
            Some([c, s]) => {
                along = dx * c + dy * s;
                left = -dx * s + dy * c;
                // what is beyond the reach, and what would make it longer than any vehicle
                beyond = (self.reach[0] - along).max(along - self.reach[1]).max(0.0);
                let longer = along.max(self.reach[1]) - along.min(self.reach[0]);
                if longer > LONGEST_M {
                    return None;
                }
            }
            None => {
                // radially it is known better than across
                let ground = ux.hypot(uy).max(1e-6);
                along = (dx * ux + dy * uy) / ground;
                left = (-dx * uy + dy * ux) / ground;
                beyond = (along.abs() - 1.5).max(0.0);
            }
        }
        let side = match self.lane {
            Some(_) => 0.6 + 0.5 * across_m(r.distance_m),
            None => 0.6 + across_m(r.distance_m) + 0.5 * missed,
        };
        // queues move as one: what is slow may only reach as far as it did
        let slow = (self.motion.speed() / SLOW_MPS).min(1.0);
        let ahead = 0.4 + 0.6 * slow + 1.2 * missed * slow;
        if beyond > 2.0 * ahead || left.abs() > 2.0 * side {
            return None;
        }
        Some((beyond / ahead).powi(2) + (left / side).powi(2) + (doppler / doppler_spread).powi(2))
    }

    fn take(&mut self, frame: usize, own: &[usize], reflections: &[Reflection], lanes: &[Lane], sign: f64, now_s: f64) {
        if own.is_empty() {
            return;
        }
        let all: Vec<Reflection> = own.iter().map(|i| reflections[*i]).collect();
        measure(&mut self.motion, &all, sign, self.heading, Some(self.reach[1] - self.reach[0]));
        let in_lane = self.lane.and_then(|k| lanes.get(k)?.beside(self.motion.place()));
        if let Some(b) = &in_lane {
            keep_to(&mut self.motion, b);
            self.heading = Some(b.heading.map(|v| sign * v));
        }
        let stands = self.motion.speed() < STOPPED_MPS;
        let speed = self.motion.speed();
        if speed > HEADED_MPS && self.frames >= 3 && in_lane.is_none() {
            let [vx, vy] = self.motion.velocity();
            if self.heading.is_none() {
                self.reach = [0.0, 0.0];
            }
            self.heading = Some([vx / speed, vy / speed]);
        }
        // around something that stands everything that stands looks like a part of it
        if let Some([c, s]) = self.heading.filter(|_| !stands) {
            let [x, y] = self.motion.place();
            let along = all.iter().map(|r| (r.place[0] - x) * c + (r.place[1] - y) * s);
            let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
            // grows soon, shrinks slowly: not every frame shows the whole vehicle
            let follow = |old: f64, new: f64, outwards: bool| old + if outwards { 0.4 } else { 0.02 } * (new - old);
            self.reach =
                [follow(self.reach[0], low, low < self.reach[0]), follow(self.reach[1], high, high > self.reach[1])];
        }
        self.members.extend(own.iter().map(|i| (frame, *i)));
        self.frames += 1;
        self.last_s = now_s;
    }
}

/// Measures place and Doppler of one frame's reflections, of a vehicle of this length or whose middle they tell.
pub fn measure(motion: &mut Motion, all: &[Reflection], sign: f64, heading: Option<[f64; 2]>, length_m: Option<f64>) {
    let n = all.len().max(1) as f64;
    let mean = |f: &dyn Fn(&Reflection) -> f64| all.iter().map(f).sum::<f64>() / n;
    let [x, y] = [mean(&|r| r.place[0]), mean(&|r| r.place[1])];
    let (ux, uy) = (mean(&|r| r.sight[0]), mean(&|r| r.sight[1]));
    let ground = ux.hypot(uy).max(1e-6);
    let [c, s] = [ux / ground, uy / ground];
    let distance_m = mean(&|r| r.distance_m);
    // reflections come from anywhere on the vehicle
    let anywhere = length_m.map_or(0.0, |m| (m / 3.0).clamp(0.5, 4.0));
    let aspect = heading.map_or([0.7, 0.7], |[a, b]| [(a * c + b * s).abs(), (b * c - a * s).abs()]);
    let radial = 0.5_f64.hypot(anywhere * aspect[0]);
    let across = across_m(distance_m).hypot(anywhere * aspect[1]);
    motion.update([c, s, 0.0, 0.0], c * x + s * y, ALIKE * radial);
    motion.update([-s, c, 0.0, 0.0], -s * x + c * y, ALIKE * across);
    let doppler = mean(&|r| sign * r.doppler_mps);
    motion.update([0.0, 0.0, ux, uy], doppler, DOPPLER_MPS);
    if doppler.abs() < STANDS_MPS && motion.speed() < STOPPED_MPS {
        motion.stop(DOPPLER_MPS);
    }
}

/// Groups of free reflections that move alike begin tracklets.
fn births(
    frame: usize,
    free: &[usize],
    reflections: &[Reflection],
    lanes: &[Lane],
    sign: f64,
    now_s: f64,
) -> Vec<Running> {
    let mut left: Vec<usize> =
        free.iter().copied().filter(|i| reflections[*i].doppler_mps.abs() >= MOVES_MPS).collect();
    let lane_of: HashMap<usize, Option<usize>> = left.iter().map(|i| (*i, own_lane(&reflections[*i], lanes))).collect();
    let mut all = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            let a = reflections[group[next]];
            left.retain(|i| {
                let b = reflections[*i];
                let near = (a.place[0] - b.place[0]).hypot(a.place[1] - b.place[1]) < 2.0 + across_m(a.distance_m);
                let alike = near
                    && lane_of.get(i) == lane_of.get(&group[next])
                    && (a.doppler_mps - b.doppler_mps).abs() < 2.0 * DOPPLER_MPS;
                if alike {
                    group.push(*i);
                }
                !alike
            });
            next += 1;
        }
        let members: Vec<Reflection> = group.iter().map(|i| reflections[*i]).collect();
        let n = members.len() as f64;
        let mean = |f: &dyn Fn(&Reflection) -> f64| members.iter().map(f).sum::<f64>() / n;
        let place = [mean(&|r| r.place[0]), mean(&|r| r.place[1])];
        let [ux, uy] = [mean(&|r| r.sight[0]), mean(&|r| r.sight[1])];
        let ground = ux.hypot(uy).max(1e-6);
        let radial = sign * mean(&|r| r.doppler_mps) / ground;
        let direction = [ux / ground, uy / ground];
        let lane = lane_of.get(&first).copied().flatten();
        let mut motion = Motion::new(
            place,
            direction.map(|v| v * radial),
            across_m(members[0].distance_m),
            direction,
            [1.0, (0.5 * radial.abs()).clamp(2.0, 12.0)],
        );
        let beside = lane.and_then(|k| lanes.get(k)?.beside(place));
        if let Some(b) = &beside {
            keep_to(&mut motion, b);
        }
        all.push(Running {
            motion,
            heading: beside.map(|b| b.heading.map(|v| sign * v)),
            reach: [-1.0, 1.0],
            members: group.iter().map(|i| (frame, *i)).collect(),
            frames: 1,
            last_s: now_s,
            lane,
        });
    }
    all
}

/// Holds a motion in its lane.
pub fn keep_to(motion: &mut Motion, beside: &Beside) {
    let [c, s] = beside.heading;
    let [x, y] = motion.place();
    let across = -s * x + c * y;
    motion.update([-s, c, 0.0, 0.0], across - beside.left_m, IN_LANE_M);
    motion.update([0.0, 0.0, -s, c], 0.0, IN_LANE_MPS);
}

/// The lane whose direction of travel a reflection's Doppler fits.
fn own_lane(r: &Reflection, lanes: &[Lane]) -> Option<usize> {
    let sign = r.doppler_mps.signum();
    let towards = r.sight.map(|v| v * sign);
    nearest(lanes, r.place, Some(towards), LANE_HALF_M + across_m(r.distance_m)).map(|(k, _)| k)
}
