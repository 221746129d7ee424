//! A person who knows the truth and works at the label page: what it does, and how many actions that takes.
//!
//! # Model
//! The person looks at the proposals way by way. One that lies on a vehicle for most of its time is right; one that
//! continues or precedes a piece of the same vehicle is right, too, and is joined; one that lies elsewhere, or on a
//! vehicle that has a better one there, is wrong. The fewer of a way are pointed at, the others go with one key. Then it
//! looks where a vehicle is seen for a second, by a few detections at least, and its label is missing or elsewhere: it
//! rests the mouse on the vehicle at some places, sees where the vehicle would be [followed](Follower) to from there, and
//! takes the way that mends most. What none mends gets points. A vehicle that nothing was offered for begins so, too, and
//! is drawn where no way holds.
//!
//! # Actions
//! Each key for a way or for a proposal that is pointed at, joining, correcting a class and taking a way that is followed
//! count one; drawing one, and each point that is set one. Looking does not count: views, zooms, the time slider, and
//! ways that are shown while the mouse rests.

use std::collections::BTreeMap;

use super::Site;
use super::near_face::{self, BoxStep, boxes};
use super::proposals::Proposal;
use super::proposals::follow::Follower;
use super::tracks::{LabelPoint, LabelTrack};
use crate::geometry::solid::Solid;
use crate::recording::labels::class_size;
use crate::recording::truth::{Label, Object, Truth};

/// Share of the smaller footprint that two boxes of one vehicle have in common.
const OVERLAP: f64 = 0.2;
/// Share of its time a proposal has to lie on one vehicle to be accepted; where it leaves it, it is mended.
const ACCEPTED: f64 = 0.5;
/// Detections, and seconds between the first and the last, from which on a person sees that a vehicle is missing.
const SEEN: (u32, f64) = (5, 1.0);
/// How long an end of a label has to be elsewhere to be cut off, seconds.
const CUT_S: f64 = 2.0;
/// How often the person looks for something to mend.
const LOOKS: usize = 3;
/// How often it has one vehicle followed, and at how many places of a stretch it looks before.
const FOLLOWED: usize = 6;
const PLACES: usize = 8;
/// Points of a streak that is straight, and from how many seconds on it is long.
const STRAIGHT: (usize, f64) = (2, 5.0);
/// Frames a way has to mend to be taken.
const HELPS: usize = 10;
/// Most is seen where there are most detections within so many frames.
const AROUND: usize = 10;
/// How far a drawn line is from the vehicle, metres: of a long one this share of its length, at most so far.
const DRAWN: f64 = 0.17;
const DRAWN_M: f64 = 0.8;
const DRAWN_MOST_M: f64 = 1.5;

/// What the person did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Actions {
    pub accepted: u32,
    pub rejected: u32,
    pub joined: u32,
    pub reclassed: u32,
    /// Ways that were followed and taken.
    pub followed: u32,
    /// Ends that were cut off.
    pub cut: u32,
    /// Points set to mend what was accepted.
    pub mended: u32,
    pub drawn: u32,
    /// Points of what was drawn.
    pub points: u32,
}

impl Actions {
    pub fn all(&self) -> u32 {
        let offered = self.accepted + self.rejected + self.joined + self.reclassed;
        offered + self.followed + self.cut + self.mended + self.drawn + self.points
    }
}

/// Truth of one frame with what was detected of it.
pub struct Instant {
    pub time_ns: i64,
    pub objects: Vec<Object>,
    /// Detections of each.
    pub detections: Vec<u32>,
}

impl Instant {
    /// A road user with its detections.
    fn of(&self, vehicle: usize) -> Option<(&Object, u32)> {
        let k = self.objects.iter().position(|o| o.track == vehicle)?;
        Some((&self.objects[k], self.detections[k]))
    }
}

/// One vehicle over the recording.
#[derive(Default)]
pub struct Vehicle {
    pub first: Option<usize>,
    pub last: usize,
    pub detections: u32,
}

/// What the person knows, and its tool.
pub struct Person<'a> {
    pub truth: &'a Truth,
    pub instants: &'a [Instant],
    /// Tracks of the truth that count.
    pub moving: &'a [bool],
    /// Those that were detected.
    pub vehicles: &'a BTreeMap<usize, Vehicle>,
    pub follower: &'a Follower,
    pub site: Site,
}

/// Frames in which a vehicle is seen well and its label is missing or elsewhere.
#[derive(Clone, Copy)]
struct Missing {
    begin: usize,
    end: usize,
    detections: u32,
}

impl Missing {
    fn frames(&self) -> usize {
        self.end + 1 - self.begin
    }
}

impl Person<'_> {
    /// Works through proposals: the labels with the vehicle each is of, and what that took.
    pub fn works_through(&self, proposals: &[Proposal]) -> (Vec<(usize, LabelTrack)>, Actions) {
        let mut actions = Actions::default();
        let mut labels = self.accepts(proposals, &mut actions);
        let offered = labels.len();
        for (k, vehicle) in self.vehicles {
            if labels.iter().all(|(l, _)| l != k) && self.is_seen(vehicle) {
                let (id, class) = (self.truth.tracks[*k].id.clone(), self.truth.tracks[*k].class.clone());
                labels.push((*k, LabelTrack { id, class, size_m: None, points: Vec::new() }));
            }
        }
        for k in 0..labels.len() {
            let Some(seen) = self.vehicles.get(&labels[k].0) else { continue };
            if k >= offered {
                // of another class than a car it is said before
                actions.reclassed += u32::from(labels[k].1.class != "car");
            }
            self.follows(&mut labels, k, seen, &mut actions);
            let (vehicle, track) = &mut labels[k];
            actions.cut += self.cuts(*vehicle, track);
            if track.points.is_empty() {
                actions.drawn += 1;
                let span = seen.first.map_or(0..=0, |first| first..=seen.last);
                track.points = self.nears(&self.instants[span], *vehicle, track.size());
                actions.points += track.points.len() as u32;
                continue;
            }
            // what was set changes the boxes beside it, so the person looks again
            for _ in 0..LOOKS {
                let points = self.mends(*vehicle, track, seen);
                actions.mended += points;
                if points == 0 {
                    break;
                }
            }
        }
        (labels, actions)
    }

    /// Accepted pieces, joined, by vehicle.
    fn accepts(&self, proposals: &[Proposal], actions: &mut Actions) -> Vec<(usize, LabelTrack)> {
        let mut pieces: BTreeMap<usize, Vec<LabelTrack>> = BTreeMap::new();
        // right and wrong ones of each way
        let mut ways: BTreeMap<u32, [u32; 2]> = BTreeMap::new();
        for (proposal, vehicle) in proposals.iter().zip(self.vehicles_of(proposals)) {
            let [right, wrong] = ways.entry(proposal.way).or_default();
            match vehicle {
                Some(vehicle) => {
                    *right += 1;
                    pieces.entry(vehicle).or_default().push(proposal.track.clone());
                }
                None => *wrong += 1,
            }
        }
        for [right, wrong] in ways.into_values() {
            // the few are pointed at, the others go with one key
            let (accepted, rejected) = match (right, wrong) {
                (0, _) => (0, 1),
                (_, 0) => (1, 0),
                _ if wrong <= right => (1, wrong),
                _ => (right, 1),
            };
            actions.accepted += accepted;
            actions.rejected += rejected;
        }
        let mut labels = Vec::new();
        for (vehicle, mut pieces) in pieces {
            pieces.sort_by(|a, b| a.points[0].time_s.total_cmp(&b.points[0].time_s));
            let joined = pieces.into_iter().map(Ok).reduce(|before, piece| {
                actions.joined += 1;
                before?.joined(&piece?)
            });
            let Some(Ok(mut whole)) = joined else { continue };
            let Truth { tracks, .. } = self.truth;
            whole.id = tracks[vehicle].id.clone();
            if whole.class != tracks[vehicle].class {
                actions.reclassed += 1;
                whole.classify(&tracks[vehicle].class);
            }
            labels.push((vehicle, whole));
        }
        labels
    }

    /// The vehicle each proposal is accepted for.
    pub fn vehicles_of(&self, proposals: &[Proposal]) -> Vec<Option<usize>> {
        let mut all: Vec<Option<usize>> = Vec::new();
        for proposal in proposals {
            let label = Truth::new(labels(&proposal.track, &self.site));
            let (mut steps, mut hits) = (0_u64, BTreeMap::<usize, u64>::new());
            for instant in self.instants {
                let Some(own) = label.at(instant.time_ns).first().map(|o| o.solid) else { continue };
                steps += 1;
                for o in instant.objects.iter().filter(|o| self.moving[o.track] && overlaps(&own, &o.solid)) {
                    *hits.entry(o.track).or_default() += 1;
                }
            }
            let best = hits.into_iter().max_by_key(|(_, n)| *n).filter(|(_, n)| *n as f64 >= ACCEPTED * steps as f64);
            let vehicle = best.map(|(vehicle, _)| vehicle);
            // one that is labelled at that time already is rejected
            let labelled = |before: &Proposal| same_time(&before.track, &proposal.track);
            let again =
                vehicle.is_some() && proposals.iter().zip(&all).any(|(before, v)| *v == vehicle && labelled(before));
            all.push(vehicle.filter(|_| !again));
        }
        all
    }

    fn seconds(&self, frame: usize) -> f64 {
        self.instants[frame].time_ns.saturating_sub(self.site.start_ns) as f64 * 1e-9
    }

    fn is_seen(&self, vehicle: &Vehicle) -> bool {
        let lasts_s = vehicle.first.map_or(0.0, |first| self.seconds(vehicle.last) - self.seconds(first));
        vehicle.detections >= SEEN.0 && lasts_s >= SEEN.1
    }

    /// Where something of a label is to be mended: where enough of the vehicle is seen.
    fn missing(&self, vehicle: usize, track: &LabelTrack, seen: &Vehicle) -> Vec<Missing> {
        let mut all = self.lacking(vehicle, track, seen);
        all.retain(|m| m.detections >= SEEN.0 && self.seconds(m.end) - self.seconds(m.begin) >= SEEN.1);
        all
    }

    /// Where a label is missing or elsewhere, hidden as the vehicle may be.
    fn lacking(&self, vehicle: usize, track: &LabelTrack, seen: &Vehicle) -> Vec<Missing> {
        let label = Truth::new(labels(track, &self.site));
        let Some(first) = seen.first else { return Vec::new() };
        let mut all: Vec<Missing> = Vec::new();
        let mut open = false;
        for frame in first..=seen.last {
            let instant = &self.instants[frame];
            let Some((_, detections)) = instant.of(vehicle) else { continue };
            let good = lies_on(&label, instant, vehicle) == Some(true);
            match all.last_mut() {
                Some(m) if open && !good => (m.end, m.detections) = (frame, m.detections + detections),
                _ if !good => all.push(Missing { begin: frame, end: frame, detections }),
                _ => {}
            }
            open = !good;
        }
        all
    }

    /// Frames in which there is a label, and the vehicle is not there.
    fn elsewhere(&self, vehicle: usize, track: &LabelTrack) -> usize {
        let label = Truth::new(labels(track, &self.site));
        let wrong = |instant: &&Instant| lies_on(&label, instant, vehicle) == Some(false);
        self.instants.iter().filter(wrong).count()
    }

    /// Follows a vehicle where its label is missing or elsewhere: from the place at which the way that is shown mends
    /// most of all stretches.
    fn follows(&self, labels: &mut [(usize, LabelTrack)], k: usize, seen: &Vehicle, actions: &mut Actions) {
        let others: Vec<LabelTrack> =
            labels.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, (_, track))| track.clone()).collect();
        let (vehicle, track) = &mut labels[k];
        let wrong = |track: &LabelTrack| {
            let lacking = self.lacking(*vehicle, track, seen).iter().map(Missing::frames).sum::<usize>();
            lacking + self.elsewhere(*vehicle, track)
        };
        for _ in 0..FOLLOWED {
            // a long straight streak has its two points as soon
            let bent = |m: &&Missing| {
                let points = self.nears(&self.instants[m.begin..=m.end], *vehicle, track.size());
                points.len() > STRAIGHT.0 || self.seconds(m.end) - self.seconds(m.begin) < STRAIGHT.1
            };
            let stretches = self.missing(*vehicle, track, seen);
            let places = stretches.iter().filter(bent).flat_map(|m| self.looks_at(*vehicle, track, m));
            // and where the label begins: it may have stood before
            let places = places.chain(track.points.first().copied());
            let ways = places.filter_map(|place| self.follower.through(track, place, &others));
            let Some((left, way)) = ways.map(|way| (wrong(&way), way)).min_by_key(|(left, _)| *left) else { return };
            // of a vehicle without a label it has to give most
            let before = wrong(track);
            let enough = if track.points.is_empty() { before / 2 } else { before.saturating_sub(HELPS) };
            if left >= enough {
                return;
            }
            actions.followed += 1;
            *track = way;
        }
    }

    /// Cuts off what of both ends of a label is elsewhere for long; how many.
    fn cuts(&self, vehicle: usize, track: &mut LabelTrack) -> u32 {
        let label = Truth::new(labels(track, &self.site));
        let good = |instant: &Instant| lies_on(&label, instant, vehicle) == Some(true);
        let first_s = self.instants.iter().position(good).map(|k| self.seconds(k));
        let last_s = self.instants.iter().rposition(good).map(|k| self.seconds(k));
        let mut cut = 0;
        if let Some((time_s, [begin_s, _])) = first_s.zip(track.span_s())
            && time_s - begin_s >= CUT_S
            && let Ok([_, kept]) = track.split(time_s, &track.id)
        {
            (*track, cut) = (kept, cut + 1);
        }
        if let Some((time_s, [_, end_s])) = last_s.zip(track.span_s())
            && end_s - time_s >= CUT_S
            && let Ok([kept, _]) = track.split(time_s, &track.id)
        {
            (*track, cut) = (kept, cut + 1);
        }
        cut
    }

    /// Places on the near face at which the person looks where a press would lead: where most is seen of each part of a
    /// stretch.
    fn looks_at(&self, vehicle: usize, track: &LabelTrack, missing: &Missing) -> Vec<LabelPoint> {
        let seen = |frame: &usize| -> u32 {
            let near = &self.instants[frame.saturating_sub(AROUND)..(frame + AROUND).min(self.instants.len())];
            near.iter().filter_map(|i| i.of(vehicle)).map(|(_, detections)| detections).sum()
        };
        let part = |p: usize| {
            missing.begin + p * missing.frames() / PLACES..missing.begin + (p + 1) * missing.frames() / PLACES
        };
        let places = (0..PLACES).filter_map(|p| part(p).max_by_key(seen));
        places
            .filter_map(|frame| self.nears(&self.instants[frame..=frame], vehicle, track.size()).first().copied())
            .collect()
    }

    /// Sets points where the label is missing or elsewhere; how many.
    fn mends(&self, vehicle: usize, track: &mut LabelTrack, seen: &Vehicle) -> u32 {
        let mut set = 0;
        for missing in self.missing(vehicle, track, seen) {
            let [from_s, to_s] = [missing.begin, missing.end].map(|frame| self.seconds(frame));
            let points = self.nears(&self.instants[missing.begin..=missing.end], vehicle, track.size());
            track.points.retain(|p| p.time_s < from_s || p.time_s > to_s);
            track.points.extend(&points);
            track.points.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            set += points.len() as u32;
        }
        set
    }

    /// The near face of a real vehicle in few points.
    fn nears(&self, instants: &[Instant], vehicle: usize, size: [f64; 3]) -> Vec<LabelPoint> {
        let step = |instant: &Instant| {
            let solid = instant.of(vehicle)?.0.solid;
            let time_s = instant.time_ns.saturating_sub(self.site.start_ns) as f64 * 1e-9;
            Some(BoxStep { time_s, center: [solid.center[0], solid.center[1]], heading_rad: solid.yaw_rad })
        };
        let steps: Vec<BoxStep> = instants.iter().filter_map(step).collect();
        near_face::drawn(&steps, size, self.site.sensor, (DRAWN * size[0]).clamp(DRAWN_M, DRAWN_MOST_M))
    }
}

/// Which tracks of the truth move and have a class with a size.
pub fn road_users(truth: &Truth) -> Vec<bool> {
    truth.tracks.iter().map(|t| t.moves() && class_size(&t.class).is_some()).collect()
}

/// The labels of a track, as reading its file gives them.
pub fn labels(track: &LabelTrack, site: &Site) -> Vec<Label> {
    let size = track.size();
    let label = |b: BoxStep| Label {
        time_ns: site.start_ns.saturating_add((b.time_s * 1e9).round() as i64),
        id: track.id.clone(),
        class: track.class.clone(),
        solid: b.solid(size),
    };
    let boxes = if track.points.is_empty() { Vec::new() } else { boxes(track, site.sensor) };
    boxes.into_iter().map(label).collect()
}

/// Whether the label of an instant lies on the vehicle; `None` without a label.
fn lies_on(label: &Truth, instant: &Instant, vehicle: usize) -> Option<bool> {
    let label = label.at(instant.time_ns).first()?.solid;
    Some(instant.of(vehicle).is_some_and(|(real, _)| overlaps(&label, &real.solid)))
}

/// Whether two boxes are of one vehicle.
pub fn overlaps(a: &Solid, b: &Solid) -> bool {
    a.shared(b) >= OVERLAP
}

fn same_time(a: &LabelTrack, b: &LabelTrack) -> bool {
    match (a.span_s(), b.span_s()) {
        (Some([a, b]), Some([c, d])) => a <= d && c <= b,
        _ => false,
    }
}
