//! The path of a road user through all its reflections, both directions of time used.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::lane::Lane;
use super::motion::{Motion, smooth};
use super::reflections::{Instant, Reflection};
use super::tracker::{across_m, keep_to, measure};
use crate::geometry::heading::{BASE_M, headings};

/// A gap in which it moved less than this although it lasted longer than that: it stood.
const STOOD_M: f64 = 4.0;
const STOOD_S: f64 = 2.0;
/// Speed from which on the heading is that of the velocity, m/s.
const HEADED_MPS: f64 = 3.0;

/// Within this distance heights are trusted, if there are so many, metres.
pub const HEIGHT_WITHIN_M: f64 = 80.0;
const ENOUGH: usize = 10;

/// Reflections of a road user, and where it was from the first to the last of them.
#[derive(Debug, Clone)]
pub struct Path {
    /// Frame and index in it, in the order of time.
    pub members: Vec<(usize, usize)>,
    /// Frame of the first place.
    pub first: usize,
    /// A motion for every frame.
    pub motions: Vec<(f64, Motion)>,
    pub headings_rad: Vec<f64>,
    /// Where the reflections lie along the heading, from the place on: 5 % and 95 %.
    pub reach: [f64; 2],
    /// Height of the higher reflections, metres.
    pub top_m: f64,
    /// The lane it keeps to.
    pub lane: Option<Arc<Lane>>,
    /// Where it was in a queue: frames and lane.
    pub queued: Vec<Queued>,
}

/// Frames in which a path is in a queue, and the lane of that.
#[derive(Debug, Clone)]
pub struct Queued {
    pub frames: RangeInclusive<usize>,
    pub lane: Arc<Lane>,
}

impl Path {
    /// `None` without members.
    pub fn new(members: Vec<(usize, usize)>, lane: Option<Arc<Lane>>, instants: &[Instant]) -> Option<Self> {
        Self::in_queues(members, lane, Vec::new(), instants)
    }

    /// One that was in queues. `None` without members.
    pub fn in_queues(
        mut members: Vec<(usize, usize)>,
        lane: Option<Arc<Lane>>,
        queued: Vec<Queued>,
        instants: &[Instant],
    ) -> Option<Self> {
        members.sort_unstable();
        members.dedup();
        let (first, last) = (members.first()?.0, members.last()?.0);
        let (motions, headings_rad) = (Vec::new(), Vec::new());
        let mut path = Self { members, first, motions, headings_rad, reach: [0.0; 2], top_m: 0.0, lane, queued };
        // how long it is tells how much a place can be trusted, and the other way round
        for _ in 0..2 {
            path.motions = smooth(&path.filtered(last, instants)?);
            path.headings_rad = path.headings();
            path.reach = path.reached(instants);
        }
        path.top_m = path.top(instants)?;
        Some(path)
    }

    pub fn last(&self) -> usize {
        self.first + self.motions.len().saturating_sub(1)
    }

    pub fn at(&self, frame: usize) -> Option<&Motion> {
        self.motions.get(frame.checked_sub(self.first)?).map(|(_, motion)| motion)
    }

    pub fn heading_at(&self, frame: usize) -> Option<f64> {
        self.headings_rad.get(frame.checked_sub(self.first)?).copied()
    }

    /// The lane it keeps to then.
    fn lane_at(&self, frame: usize) -> Option<&Arc<Lane>> {
        self.queued.iter().find(|q| q.frames.contains(&frame)).map(|q| &q.lane).or(self.lane.as_ref())
    }

    /// How far it gets from its start, metres.
    pub fn travel_m(&self) -> f64 {
        let Some((_, first)) = self.motions.first() else { return 0.0 };
        let [x, y] = first.place();
        let away = self.motions.iter().map(|(_, m)| (m.place()[0] - x).hypot(m.place()[1] - y));
        away.fold(0.0, f64::max)
    }

    /// Over all its time, m/s.
    pub fn mean_speed(&self) -> f64 {
        self.motions.iter().map(|(_, m)| m.speed()).sum::<f64>() / self.motions.len().max(1) as f64
    }

    /// Its reflections with the frame each is of.
    pub fn reflections<'a>(&'a self, instants: &'a [Instant]) -> impl Iterator<Item = (usize, &'a Reflection)> {
        self.members.iter().filter_map(|&(frame, i)| Some((frame, instants.get(frame)?.reflections.get(i)?)))
    }

    /// Place of a reflection along and left of the heading, from the path on.
    pub fn local(&self, frame: usize, r: &Reflection) -> Option<[f64; 2]> {
        let ([x, y], (s, c)) = (self.at(frame)?.place(), self.heading_at(frame)?.sin_cos());
        let [dx, dy] = [r.place[0] - x, r.place[1] - y];
        Some([dx * c + dy * s, -dx * s + dy * c])
    }

    fn filtered(&self, last: usize, instants: &[Instant]) -> Option<Vec<(f64, Motion)>> {
        let mut filtered: Vec<(f64, Motion)> = Vec::with_capacity(last - self.first + 1);
        let length_m = self.reach[1] - self.reach[0];
        let mut next = 0;
        let mut motion: Option<Motion> = None;
        for (frame, instant) in instants.iter().enumerate().take(last + 1).skip(self.first) {
            let begin = next;
            while self.members.get(next).is_some_and(|m| m.0 == frame) {
                next += 1;
            }
            let heading = self.heading_at(frame).map(|h| [h.cos(), h.sin()]);
            let own = self.members[begin..next].iter().filter_map(|m| instant.reflections.get(m.1));
            let own: Vec<Reflection> = own.map(|r| r.of_middle(heading)).collect();
            let mut now = match (motion, filtered.last()) {
                (Some(mut now), Some((before_s, _))) => {
                    now.predict(instant.time_s - before_s);
                    now
                }
                _ => beginning(&own)?,
            };
            let known = heading.is_some() && own.iter().all(|r| r.ahead_m.is_some());
            let length_m = (!known).then_some(length_m);
            if !own.is_empty() {
                measure(&mut now, &own, 1.0, heading, length_m);
            } else if self.stood(begin, instants) {
                now.stop(0.3);
            }
            if let Some(b) = self.lane_at(frame).and_then(|lane| lane.beside(now.place())) {
                keep_to(&mut now, &b);
            }
            motion = Some(now);
            filtered.push((instant.time_s, now));
        }
        Some(filtered)
    }

    /// Whether it stood in the gap before this member.
    fn stood(&self, next: usize, instants: &[Instant]) -> bool {
        let place = |k: usize| {
            let (frame, i) = *self.members.get(k)?;
            Some((instants.get(frame)?.time_s, instants.get(frame)?.reflections.get(i)?.place))
        };
        let Some(((a_s, a), (b_s, b))) = next.checked_sub(1).and_then(place).zip(place(next)) else { return false };
        b_s - a_s > STOOD_S && (b[0] - a[0]).hypot(b[1] - a[1]) < STOOD_M
    }

    fn headings(&self) -> Vec<f64> {
        let places: Vec<[f64; 2]> = self.motions.iter().map(|(_, m)| m.place()).collect();
        let by_place = headings(&places, BASE_M);
        let all = (self.first..).zip(self.motions.iter().zip(by_place)).map(|(frame, ((_, m), by_place))| {
            if let Some(b) = self.lane_at(frame).and_then(|lane| lane.beside(m.place())) {
                return b.heading[1].atan2(b.heading[0]);
            }
            let [vx, vy] = m.velocity();
            if m.speed() >= HEADED_MPS { vy.atan2(vx) } else { by_place }
        });
        all.collect()
    }

    /// 85 % of the heights nearby; where there are too few, the median of all, since farther away they are vague.
    fn top(&self, instants: &[Instant]) -> Option<f64> {
        let heights = |within_m: f64| -> Vec<f64> {
            self.reflections(instants).filter(|(_, r)| r.distance_m < within_m).map(|(_, r)| r.height_m).collect()
        };
        let near = heights(HEIGHT_WITHIN_M);
        if near.len() < ENOUGH { quantile(&heights(f64::INFINITY), 0.5) } else { quantile(&near, 0.85) }
    }

    fn reached(&self, instants: &[Instant]) -> [f64; 2] {
        let along: Vec<f64> =
            self.reflections(instants).filter_map(|(frame, r)| Some(self.local(frame, r)?[0])).collect();
        [0.05, 0.95].map(|q| quantile(&along, q).unwrap_or(0.0))
    }
}

/// The motion that the first reflections show.
fn beginning(own: &[Reflection]) -> Option<Motion> {
    let r = own.first()?;
    let ground = r.sight[0].hypot(r.sight[1]).max(1e-6);
    let direction = r.sight.map(|v| v / ground);
    let radial = r.doppler_mps / ground;
    let velocity = direction.map(|v| v * radial);
    Some(Motion::new(
        r.place,
        velocity,
        2.0 * across_m(r.distance_m),
        direction,
        [1.0, (0.6 * radial.abs()).clamp(4.0, 15.0)],
    ))
}

/// The value below which this share lies.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    sorted.get((last as f64 * share).round() as usize).copied()
}
