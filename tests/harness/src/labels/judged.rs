//! How good proposals are: a [person](super::person) who knows the truth works through them, its actions and the labels
//! it gets.
//!
//! The ground truth plays the person and judges the result; proposals, and what is followed from a click, never see it.

use std::collections::BTreeMap;

use anyhow::Result;

use super::Site;
use super::person::{Actions, Instant, Person, Vehicle, labels, overlaps, road_users};
use super::proposals::Proposal;
use super::proposals::follow::Follower;
use super::tracks::LabelTrack;
use crate::estimators;
use crate::evaluation::Options;
use crate::evaluation::replay::Replay;
use crate::evaluation::samples::associate;
use crate::evaluation::summary::Row;
use crate::recording::Recording;
use crate::recording::truth::{Label, Object, Truth};

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
    /// Ids of those vehicles, and when each was detected first and last.
    detected: BTreeMap<String, [i64; 2]>,
}

impl Judged {
    pub fn actions_a_vehicle(&self) -> f64 {
        f64::from(self.actions.all()) / self.vehicles.max(1) as f64
    }
}

/// Works through proposals and judges the labels. A recording without truth gives `None`.
pub fn judge(recording: &Recording, proposals: &[Proposal], options: &Options) -> Option<Judged> {
    let truth = recording.truth.as_ref()?;
    let known = Known::of(recording, truth, options);
    let (labels, actions) = known.person(truth).works_through(proposals);
    let Known { instants, moving, vehicles, .. } = known;
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
        detected: vehicles
            .iter()
            .filter_map(|(k, v)| {
                let times_ns = [instants.get(v.first?)?.time_ns, instants.get(v.last)?.time_ns];
                Some((truth.tracks[*k].id.clone(), times_ns))
            })
            .collect(),
    };
    judged.compare(recording, &instants, &vehicles, &moving, options);
    Some(judged)
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
    let vehicles = Known::of(recording, truth, options).person(truth).vehicles_of(proposals);
    Some(vehicles.into_iter().map(decision).collect())
}

/// What a person who knows the truth knows.
struct Known {
    instants: Vec<Instant>,
    moving: Vec<bool>,
    vehicles: BTreeMap<usize, Vehicle>,
    follower: Follower,
    site: Site,
}

impl Known {
    fn of(recording: &Recording, truth: &Truth, options: &Options) -> Self {
        let instant = |frame: &crate::recording::Frame| {
            let objects = truth.at(frame.time_ns);
            let detections = associate(recording, &objects, &frame.detections, options);
            Instant { time_ns: frame.time_ns, objects, detections }
        };
        let instants: Vec<Instant> = recording.frames.iter().map(instant).collect();
        let moving = road_users(truth);
        let mut vehicles: BTreeMap<usize, Vehicle> = BTreeMap::new();
        for (frame, instant) in instants.iter().enumerate() {
            for (o, n) in instant.objects.iter().zip(&instant.detections).filter(|(o, n)| moving[o.track] && **n > 0) {
                let vehicle = vehicles.entry(o.track).or_default();
                vehicle.first.get_or_insert(frame);
                (vehicle.last, vehicle.detections) = (frame, vehicle.detections + n);
            }
        }
        Self { instants, moving, vehicles, follower: Follower::new(recording), site: Site::of(recording) }
    }

    fn person<'a>(&'a self, truth: &'a Truth) -> Person<'a> {
        let Self { instants, moving, vehicles, follower, site } = self;
        Person { truth, instants, moving, vehicles, follower, site: *site }
    }
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

    /// The radar rows of the table of `replay`: with the ground truth, with perfect labels, with these labels. Perfect
    /// are the real boxes of each detected vehicle from its first to its last detection: labels cannot hold what nobody
    /// saw, so the first two differ as much as the purpose does.
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
        let perfect = Truth::new(recording.frames.iter().flat_map(|f| self.perfect(recording, f.time_ns)).collect());
        let mut made: Vec<Label> = self.tracks.iter().flat_map(|t| labels(t, &site)).collect();
        made.iter_mut().for_each(|label| recording.ground.lift(&mut label.solid));
        let made = Truth::new(made);
        let rows = |truth: Option<Truth>| -> Result<Vec<Row>> {
            let recording = Recording { truth, ..recording.clone() };
            let mut radar = estimators::all(&recording, estimators)?;
            radar.retain(|e| e.name().starts_with("radar-"));
            let options = Options { bootstrap: 0, ..options.clone() };
            Ok(Replay::new(recording, &mut radar, &options, &|| ()).summary.rows)
        };
        Ok([rows(recording.truth.clone())?, rows(Some(perfect))?, rows(Some(made))?])
    }

    /// The real boxes of the vehicles that have been detected before and will be again.
    fn perfect(&self, recording: &Recording, time_ns: i64) -> Vec<Label> {
        let Some(truth) = &recording.truth else { return Vec::new() };
        let label = |o: Object| {
            let track = &truth.tracks[o.track];
            let [first, last] = self.detected.get(&track.id)?;
            let (id, class, solid) = (track.id.clone(), track.class.clone(), o.solid);
            (*first..=*last).contains(&time_ns).then_some(Label { time_ns, id, class, solid })
        };
        truth.at(time_ns).into_iter().filter_map(label).collect()
    }

    /// The figures as lines of text.
    pub fn text(&self) -> String {
        let share = |[all, part]: [u64; 2]| 100.0 * part as f64 / all.max(1) as f64;
        let a = self.actions;
        format!(
            "{}: {} vehicles, {} proposals; {:.2} actions a vehicle \
             (accept {}, reject {}, join {}, class {}, follow {}, cut {}, mend {} points, draw {} with {} points)\n  \
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
            a.followed,
            a.cut,
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
