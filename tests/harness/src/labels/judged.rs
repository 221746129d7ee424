//! How good proposals are: a person who knows the truth works through them, its actions and the labels it gets.
//!
//! The ground truth plays the person and judges the result; the proposals never see it.
//!
//! # Model
//! The person looks at each proposal, the best first. One that lies on a vehicle for most of its time is accepted; one
//! that continues or precedes an accepted piece of the same vehicle is accepted and joined; one that lies elsewhere, or
//! on a vehicle that is labelled there already, is rejected. Where a vehicle is seen well for a second and its label is
//! missing or elsewhere, the person sets points; a vehicle that nothing was offered for is drawn. Accepting, rejecting,
//! joining and correcting a class count one action each, drawing one, and each point that is set one.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;

use super::Site;
use super::near_face::{self, BoxStep, boxes};
use super::proposals::Proposal;
use super::tracks::{LabelPoint, LabelTrack};
use crate::estimators;
use crate::evaluation::Options;
use crate::evaluation::replay::Replay;
use crate::evaluation::samples::associate;
use crate::evaluation::summary::Row;
use crate::geometry::polygon::Convex;
use crate::geometry::solid::Solid;
use crate::recording::Recording;
use crate::recording::labels::class_size;
use crate::recording::truth::{Label, Object, Truth};

/// Share of the smaller footprint that two boxes of one vehicle have in common.
const OVERLAP: f64 = 0.2;
/// Share of its time a proposal has to lie on one vehicle to be accepted; where it leaves it, it is mended.
const ACCEPTED: f64 = 0.5;
/// Detections, and seconds between the first and the last, from which on a person sees that a vehicle is missing.
const SEEN: (u32, f64) = (15, 1.0);
/// How often the person looks for something to mend.
const LOOKS: usize = 3;
/// How far a drawn line is from the vehicle, metres.
const DRAWN_M: f64 = 0.8;

/// What the person did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Actions {
    pub accepted: u32,
    pub rejected: u32,
    pub joined: u32,
    pub reclassed: u32,
    pub drawn: u32,
    /// Points of what was drawn.
    pub points: u32,
    /// Points set to mend what was accepted.
    pub mended: u32,
}

impl Actions {
    pub fn all(&self) -> u32 {
        self.accepted + self.rejected + self.joined + self.reclassed + self.drawn + self.points + self.mended
    }
}

/// A recording's proposals, judged.
#[derive(Debug)]
pub struct Judged {
    pub name: String,
    /// Moving road users detected at least once.
    pub vehicles: usize,
    pub proposals: usize,
    pub actions: Actions,
    /// Steps of those vehicles from their first to their last detection, and how many are labelled.
    pub steps: [u64; 2],
    /// Those of them without a detection, and how many are labelled without a detection too.
    pub undetected: [u64; 2],
    /// Labelled steps, and how many of them have no real vehicle there.
    pub labelled: [u64; 2],
    /// Distance of box centres along and across the real heading, metres: means of the absolute values.
    pub off_m: [f64; 2],
    /// Labels that were made.
    pub tracks: Vec<LabelTrack>,
    /// Ids of those vehicles.
    detected: BTreeSet<String>,
}

impl Judged {
    pub fn actions_a_vehicle(&self) -> f64 {
        f64::from(self.actions.all()) / self.vehicles.max(1) as f64
    }
}

/// Truth of one frame with what was detected of it.
struct Instant {
    time_ns: i64,
    objects: Vec<Object>,
    /// Detections of each.
    detections: Vec<u32>,
}

/// One vehicle over the recording.
#[derive(Default)]
struct Vehicle {
    first: Option<usize>,
    last: usize,
    detections: u32,
}

/// Works through proposals and judges the labels. A recording without truth gives `None`.
pub fn judge(recording: &Recording, proposals: &[Proposal], options: &Options) -> Option<Judged> {
    let truth = recording.truth.as_ref()?;
    let site = Site::of(recording);
    let instants = instants(recording, truth, options);
    let moving = road_users(truth);
    let mut vehicles: BTreeMap<usize, Vehicle> = BTreeMap::new();
    for (frame, instant) in instants.iter().enumerate() {
        for (o, n) in instant.objects.iter().zip(&instant.detections).filter(|(o, n)| moving[o.track] && **n > 0) {
            let vehicle = vehicles.entry(o.track).or_default();
            vehicle.first.get_or_insert(frame);
            (vehicle.last, vehicle.detections) = (frame, vehicle.detections + n);
        }
    }
    let (pieces, mut actions) = work_through(proposals, &instants, &moving, &site);
    let mut labels: Vec<(usize, LabelTrack)> = Vec::new();
    for (vehicle, mut pieces) in pieces {
        pieces.sort_by(|a, b| a.points[0].time_s.total_cmp(&b.points[0].time_s));
        let mut whole: Option<LabelTrack> = None;
        for piece in pieces {
            whole = Some(match whole {
                None => piece,
                Some(before) => {
                    actions.joined += 1;
                    before.joined(&piece).ok()?
                }
            });
        }
        let mut whole = whole?;
        whole.id = truth.tracks[vehicle].id.clone();
        let class = &truth.tracks[vehicle].class;
        if whole.class != *class {
            actions.reclassed += 1;
            whole.class = class.clone();
        }
        if let Some(seen) = vehicles.get(&vehicle) {
            // what was set changes the boxes beside it, so the person looks again
            for _ in 0..LOOKS {
                let points = mend(&mut whole, &instants, vehicle, seen, &site);
                actions.mended += points;
                if points == 0 {
                    break;
                }
            }
        }
        labels.push((vehicle, whole));
    }
    for (k, vehicle) in &vehicles {
        let Some(first) = vehicle.first else { continue };
        let lasts_s = (instants[vehicle.last].time_ns - instants[first].time_ns) as f64 * 1e-9;
        let labelled = labels.iter().any(|(l, _)| l == k);
        if !labelled && vehicle.detections >= SEEN.0 && lasts_s >= SEEN.1 {
            let track = drawn(&instants[first..=vehicle.last], *k, truth, &site);
            actions.drawn += 1;
            actions.points += track.points.len() as u32;
            labels.push((*k, track));
        }
    }
    let mut judged = Judged {
        name: recording.name.clone(),
        vehicles: vehicles.len(),
        proposals: proposals.len(),
        actions,
        steps: [0; 2],
        undetected: [0; 2],
        labelled: [0; 2],
        off_m: [0.0; 2],
        tracks: labels.iter().map(|(_, track)| track.clone()).collect(),
        detected: vehicles.keys().map(|k| truth.tracks[*k].id.clone()).collect(),
    };
    judged.compare(recording, &instants, &vehicles, &moving, options);
    Some(judged)
}

fn instants(recording: &Recording, truth: &Truth, options: &Options) -> Vec<Instant> {
    let instant = |frame: &crate::recording::Frame| {
        let objects = truth.at(frame.time_ns);
        let detections = associate(recording, &objects, &frame.detections, options);
        Instant { time_ns: frame.time_ns, objects, detections }
    };
    recording.frames.iter().map(instant).collect()
}

/// What the person does with a proposal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Decision {
    /// It becomes a label of this class.
    Accept {
        class: String,
    },
    Reject,
}

/// What the person does with each proposal, for scripts that do it in the page. A recording without truth gives `None`.
pub fn decide(recording: &Recording, proposals: &[Proposal], options: &Options) -> Option<Vec<Decision>> {
    let truth = recording.truth.as_ref()?;
    let decision = |vehicle: Option<usize>| match vehicle {
        Some(vehicle) => Decision::Accept { class: truth.tracks[vehicle].class.clone() },
        None => Decision::Reject,
    };
    let vehicles =
        vehicles_of(proposals, &instants(recording, truth, options), &road_users(truth), &Site::of(recording));
    Some(vehicles.into_iter().map(decision).collect())
}

/// Which tracks of the truth move and have a class with a size.
fn road_users(truth: &Truth) -> Vec<bool> {
    truth.tracks.iter().map(|t| t.moves() && class_size(&t.class).is_some()).collect()
}

/// Accepted pieces by vehicle.
fn work_through(
    proposals: &[Proposal],
    instants: &[Instant],
    moving: &[bool],
    site: &Site,
) -> (BTreeMap<usize, Vec<LabelTrack>>, Actions) {
    let mut pieces: BTreeMap<usize, Vec<LabelTrack>> = BTreeMap::new();
    let mut actions = Actions::default();
    for (proposal, vehicle) in proposals.iter().zip(vehicles_of(proposals, instants, moving, site)) {
        match vehicle {
            Some(vehicle) => {
                actions.accepted += 1;
                pieces.entry(vehicle).or_default().push(proposal.track.clone());
            }
            None => actions.rejected += 1,
        }
    }
    (pieces, actions)
}

/// The vehicle each proposal is accepted for.
fn vehicles_of(proposals: &[Proposal], instants: &[Instant], moving: &[bool], site: &Site) -> Vec<Option<usize>> {
    let mut all: Vec<Option<usize>> = Vec::new();
    for proposal in proposals {
        let label = Truth::new(labels(&proposal.track, site));
        let (mut steps, mut hits) = (0_u64, BTreeMap::<usize, u64>::new());
        for instant in instants {
            let Some(own) = label.at(instant.time_ns).first().map(|o| o.solid) else { continue };
            steps += 1;
            for o in instant.objects.iter().filter(|o| moving[o.track] && overlaps(&own, &o.solid)) {
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

fn same_time(a: &LabelTrack, b: &LabelTrack) -> bool {
    match (a.span_s(), b.span_s()) {
        (Some([a, b]), Some([c, d])) => a <= d && c <= b,
        _ => false,
    }
}

/// Sets points where the vehicle is seen and the label is missing or elsewhere; how many.
fn mend(track: &mut LabelTrack, instants: &[Instant], vehicle: usize, seen: &Vehicle, site: &Site) -> u32 {
    let label = Truth::new(labels(track, site));
    let Some(first) = seen.first else { return 0 };
    // runs of frames without a label on the vehicle
    let mut runs: Vec<(usize, usize, u32)> = Vec::new();
    let mut open = false;
    for (frame, instant) in instants.iter().enumerate().take(seen.last + 1).skip(first) {
        let real = instant.objects.iter().position(|o| o.track == vehicle);
        let Some((real, n)) = real.map(|k| (&instant.objects[k], instant.detections[k])) else { continue };
        let good = label.at(instant.time_ns).first().is_some_and(|l| overlaps(&l.solid, &real.solid));
        match runs.last_mut() {
            Some(run) if open && !good => *run = (run.0, frame, run.2 + n),
            _ if !good => runs.push((frame, frame, n)),
            _ => {}
        }
        open = !good;
    }
    let mut set = 0;
    for (begin, end, detections) in runs {
        let [from_s, to_s] = [begin, end].map(|f| instants[f].time_ns.saturating_sub(site.start_ns) as f64 * 1e-9);
        if detections < SEEN.0 || to_s - from_s < SEEN.1 {
            continue;
        }
        let points = nears_of(&instants[begin..=end], vehicle, track.size(), site);
        track.points.retain(|p| p.time_s < from_s || p.time_s > to_s);
        track.points.extend(&points);
        track.points.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        set += points.len() as u32;
    }
    set
}

/// The near face of a real vehicle in few points.
fn nears_of(instants: &[Instant], vehicle: usize, size: [f64; 3], site: &Site) -> Vec<LabelPoint> {
    let steps: Vec<BoxStep> = instants
        .iter()
        .filter_map(|i| {
            let solid = i.objects.iter().find(|o| o.track == vehicle)?.solid;
            let time_s = i.time_ns.saturating_sub(site.start_ns) as f64 * 1e-9;
            Some(BoxStep { time_s, center: [solid.center[0], solid.center[1]], heading_rad: solid.yaw_rad })
        })
        .collect();
    near_face::drawn(&steps, size, site.sensor, DRAWN_M)
}

/// What a person who sees the vehicle would draw.
fn drawn(instants: &[Instant], vehicle: usize, truth: &Truth, site: &Site) -> LabelTrack {
    let track = &truth.tracks[vehicle];
    let size = class_size(&track.class).unwrap_or([4.6, 1.8, 1.5]);
    let points = nears_of(instants, vehicle, size, site);
    LabelTrack { id: track.id.clone(), class: track.class.clone(), size_m: None, points }
}

/// The labels of a track, as reading its file gives them.
fn labels(track: &LabelTrack, site: &Site) -> Vec<Label> {
    let size = track.size();
    let label = |b: BoxStep| Label {
        time_ns: site.start_ns.saturating_add((b.time_s * 1e9).round() as i64),
        id: track.id.clone(),
        class: track.class.clone(),
        solid: Solid { center: [b.center[0], b.center[1], size[2] / 2.0], yaw_rad: b.heading_rad, size },
    };
    boxes(track, site.sensor).into_iter().map(label).collect()
}

fn overlaps(a: &Solid, b: &Solid) -> bool {
    let reach = a.size[0].hypot(a.size[1]) + b.size[0].hypot(b.size[1]);
    if (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]) * 2.0 > reach {
        return false;
    }
    let [p, q] = [a, b].map(|s| Convex::hull(s.footprint().to_vec()));
    p.within(&q).area() >= OVERLAP * p.area().min(q.area())
}

impl Judged {
    fn compare(
        &mut self,
        recording: &Recording,
        instants: &[Instant],
        vehicles: &BTreeMap<usize, Vehicle>,
        moving: &[bool],
        options: &Options,
    ) {
        let site = Site::of(recording);
        let made = Truth::new(self.tracks.iter().flat_map(|t| labels(t, &site)).collect());
        let Some(truth) = &recording.truth else { return };
        let (mut off, mut compared) = ([0.0; 2], 0_u64);
        for (frame, (instant, own)) in instants.iter().zip(&recording.frames).enumerate() {
            let objects = made.at(instant.time_ns);
            let detections = associate(recording, &objects, &own.detections, options);
            for o in &objects {
                self.labelled[0] += 1;
                let real = instant.objects.iter().any(|t| moving[t.track] && overlaps(&o.solid, &t.solid));
                self.labelled[1] += u64::from(!real);
            }
            for (o, n) in instant.objects.iter().zip(&instant.detections) {
                let Some(vehicle) = vehicles.get(&o.track) else { continue };
                if !vehicle.first.is_some_and(|first| (first..=vehicle.last).contains(&frame)) {
                    continue;
                }
                let id = &truth.tracks[o.track].id;
                let label = objects.iter().position(|l| made.tracks[l.track].id == *id);
                let label = label.filter(|k| overlaps(&objects[*k].solid, &o.solid));
                self.steps[0] += 1;
                self.steps[1] += u64::from(label.is_some());
                if *n == 0 {
                    self.undetected[0] += 1;
                    self.undetected[1] += u64::from(label.is_some_and(|k| detections[k] == 0));
                }
                if let Some(k) = label {
                    let [x, y, _] = objects[k].solid.center;
                    let d = o.solid.local([x, y]);
                    off = [off[0] + d[0].abs(), off[1] + d[1].abs()];
                    compared += 1;
                }
            }
        }
        self.off_m = off.map(|v| v / compared.max(1) as f64);
    }

    /// The radar rows of the table of `replay`: with the ground truth, with its vehicles that were detected at least
    /// once, with these labels. Labels cannot hold what nobody saw, so the first two differ as much as the purpose does.
    ///
    /// # Errors
    /// A recording that cannot be replayed.
    pub fn tables(
        &self,
        recording: &Recording,
        options: &Options,
        estimators: &estimators::Options,
    ) -> Result<[Vec<Row>; 3]> {
        let site = Site::of(recording);
        let mut seen = recording.truth.clone().unwrap_or_default();
        seen.tracks.retain(|t| self.detected.contains(&t.id));
        let made = Truth::new(self.tracks.iter().flat_map(|t| labels(t, &site)).collect());
        let rows = |truth: Option<Truth>| -> Result<Vec<Row>> {
            let recording = Recording { truth, ..recording.clone() };
            let mut radar = estimators::all(&recording, estimators)?;
            radar.retain(|e| e.name().starts_with("radar-"));
            let options = Options { bootstrap: 0, ..options.clone() };
            Ok(Replay::new(recording, &mut radar, &options, &|| ()).summary.rows)
        };
        Ok([rows(recording.truth.clone())?, rows(Some(seen))?, rows(Some(made))?])
    }

    /// The figures as lines of text.
    pub fn text(&self) -> String {
        let share = |[all, part]: [u64; 2]| 100.0 * part as f64 / all.max(1) as f64;
        let a = self.actions;
        format!(
            "{}: {} vehicles, {} proposals; {:.2} actions a vehicle \
             (accept {}, reject {}, join {}, class {}, mend {} points, draw {} with {} points)\n  \
             labelled {:.1} % of {} steps; {:.1} % of {} without detection are labelled so; \
             {:.1} % of {} labelled steps without a vehicle; off by {:.1} m along, {:.1} m across\n",
            self.name,
            self.vehicles,
            self.proposals,
            self.actions_a_vehicle(),
            a.accepted,
            a.rejected,
            a.joined,
            a.reclassed,
            a.mended,
            a.drawn,
            a.points,
            share(self.steps),
            self.steps[0],
            share(self.undetected),
            self.undetected[0],
            share(self.labelled),
            self.labelled[0],
            self.off_m[0],
            self.off_m[1]
        )
    }
}
