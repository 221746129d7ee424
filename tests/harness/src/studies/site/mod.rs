//! Where to mount a radar: candidate mounts over simulated traffic, alone and in sets.
//!
//! # Model
//! Every candidate measures the same traffic at the same instants with the scene's radar. It covers a vehicle
//! where the evaluation's rules say that it has been detected (D_O), and it sees a road cell where the cell's
//! centre, 1 m above the road, lies in its field of view and has an exact line of sight past all boxes.
//! Shares are of one whole for all candidates: every vehicle-time-step, and every free road cell at every
//! instant, that some candidate has in its field of view. So a mount that looks at little has little.
//!
//! # References
//! V. Chvátal, "A Greedy Heuristic for the Set-Covering Problem" (1979), for sets too many to try ([`sets`]).

pub mod bits;
pub mod sets;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Result, ensure};
use rayon::prelude::*;
use serde::Serialize;

use crate::evaluation::Options;
use crate::evaluation::counts::rate;
use crate::evaluation::samples::{Cell, associate};
use crate::geometry::ground::Ground;
use crate::geometry::polygon::Convex;
use crate::geometry::sight::shadow;
use crate::geometry::solid::Solid;
use crate::recording::Recording;
use crate::recording::problems::Problems;
use crate::recording::truth::{Label, Object, Truth};
use crate::twin::scene::{Look, Mount, Scene};
use crate::twin::simulate::Simulation;
use bits::Bits;

/// Steps in which traffic is followed to find the road, seconds.
const ROAD_STEP_S: f64 = 0.1;

/// Options of a search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Search {
    pub mounts: Vec<Mount>,
    /// Time between two instants that are looked at, seconds.
    pub every_s: f64,
    /// Stretch of the road that matters, x in metres; all that some candidate looks at without it.
    pub stretch_m: Option<[f64; 2]>,
}

/// One mount with all it sees.
#[derive(Debug, Clone)]
pub struct Candidate {
    pub mount: Mount,
    /// Vehicle-time-steps it detects, of all that count.
    pub detected: Bits,
    /// Vehicle-time-steps in its own field of view, and those of them that it detects.
    pub in_view: [u64; 2],
    /// Road-cell-time-steps in its sight.
    pub visible: Bits,
}

impl Candidate {
    /// Coverage rate: share of the vehicle-time-steps in its own field of view that it detects.
    pub fn coverage_rate(&self) -> Option<f64> {
        rate(self.in_view[1], self.in_view[0])
    }
}

/// A mount that cannot be, with the reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    pub mount: Mount,
    pub reason: String,
}

/// Everything found.
#[derive(Debug)]
pub struct Site {
    pub candidates: Vec<Candidate>,
    pub left_out: Vec<LeftOut>,
    /// Road cells that count.
    pub cells: Vec<Cell>,
    /// Times each of them was free of vehicles.
    pub free: Vec<u32>,
    pub instants: usize,
    /// Road cell of each bit of [`Candidate::visible`].
    pub cell_of_bit: Vec<u32>,
    /// Vehicle-time-steps that count.
    pub object_steps: u64,
    /// Free road-cell-time-steps that count.
    pub cell_steps: u64,
}

/// The traffic at one instant, the same for all candidates.
struct Instant {
    since_s: f64,
    objects: Vec<Object>,
    /// Vehicles that count, and the bit of each.
    counted: Vec<(usize, usize)>,
    /// Road cells that count, and the bit of each.
    cells: Vec<(usize, usize)>,
}

impl Site {
    /// Lets every candidate look. `progress` is called after each candidate.
    ///
    /// # Errors
    /// Those of the traffic; no candidate that can be; nothing that any of them looks at.
    pub fn search(
        scene: Scene,
        fcd: Option<&Path>,
        search: &Search,
        options: &Options,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        ensure!(!search.mounts.is_empty(), "no candidate mount");
        let azimuths = scene.radar.field_of_view.azimuth_deg;
        let looks: Vec<Look> = search.mounts.iter().map(|m| Look::new(m, azimuths)).collect();
        let simulation = Simulation::seen_by(scene, fcd, &looks)?;
        let traffic = Traffic::new(&simulation);
        let (mounts, left_out) = possible(&simulation.scene, &search.mounts, &traffic);
        ensure!(
            !mounts.is_empty(),
            "none of {} candidate mounts is possible; the first: {}",
            search.mounts.len(),
            left_out.first().map_or("", |l| l.reason.as_str())
        );
        let views: Vec<Recording> = mounts.iter().map(|m| blank(&simulation, m)).collect();
        let height_m = options.slice_height_m;
        let in_some_view = |[x, y]: [f64; 2]| {
            let on_stretch = search.stretch_m.is_none_or(|[from, to]| (from..=to).contains(&x));
            on_stretch && views.iter().any(|v| v.sensor.field_of_view.contains(v.pose.to_spherical([x, y, height_m])))
        };
        let cells: Vec<Cell> = traffic
            .road
            .iter()
            .copied()
            .filter(|&(i, j)| in_some_view([f64::from(i) + 0.5, f64::from(j) + 0.5]))
            .collect();
        let (instants, [object_steps, cell_steps]) =
            traffic.instants(&simulation, search.every_s, &cells, options, &in_some_view);
        ensure!(
            object_steps > 0 && cell_steps > 0,
            "no candidate has a moving vehicle in its field of view{}",
            if search.stretch_m.is_some() { " on that stretch" } else { "" }
        );
        let mut free = vec![0; cells.len()];
        instants.iter().flat_map(|t| &t.cells).for_each(|&(k, _)| free[k] += 1);
        let look = |view: Recording, mount: &Mount| {
            let mut candidate = Candidate {
                mount: *mount,
                detected: Bits::new(object_steps),
                in_view: [0, 0],
                visible: Bits::new(cell_steps),
            };
            let mut radar = simulation.radar.clone();
            radar.pose = view.pose;
            for (number, instant) in instants.iter().enumerate() {
                let detections = simulation.scan(&radar, instant.since_s, number as u64);
                let counts = associate(&view, &instant.objects, &detections, options);
                for &(object, bit) in &instant.counted {
                    let [x, y, _] = instant.objects[object].solid.center;
                    let own = view.sensor.field_of_view.contains(view.pose.to_spherical([x, y, height_m]));
                    let detected = counts[object] >= options.min_detections;
                    candidate.in_view[0] += u64::from(own);
                    candidate.in_view[1] += u64::from(own && detected);
                    if detected {
                        candidate.detected.set(bit);
                    }
                }
                let shadows: Vec<Convex> =
                    instant.objects.iter().filter_map(|o| shadow(view.pose.position, &o.solid, height_m)).collect();
                for &(cell, bit) in &instant.cells {
                    let (i, j) = cells[cell];
                    let centre = [f64::from(i) + 0.5, f64::from(j) + 0.5];
                    let place = view.pose.to_spherical([centre[0], centre[1], height_m]);
                    if view.sensor.field_of_view.contains(place) && !shadows.iter().any(|s| s.contains(centre)) {
                        candidate.visible.set(bit);
                    }
                }
            }
            progress();
            candidate
        };
        let candidates = views.into_par_iter().zip(&mounts).map(|(view, mount)| look(view, mount)).collect();
        Ok(Self {
            candidates,
            left_out,
            cells,
            free,
            instants: instants.len(),
            cell_of_bit: instants.iter().flat_map(|t| t.cells.iter().map(|&(cell, _)| cell as u32)).collect(),
            object_steps: object_steps as u64,
            cell_steps: cell_steps as u64,
        })
    }
}

impl Site {
    /// Times each road cell was in sight of at least one of some candidates.
    pub fn seen_by(&self, members: &[usize]) -> Vec<u32> {
        let mut seen = vec![0; self.cells.len()];
        for (bit, &cell) in self.cell_of_bit.iter().enumerate() {
            seen[cell as usize] += u32::from(members.iter().any(|&m| self.candidates[m].visible.get(bit)));
        }
        seen
    }
}

/// Where everything drives, before any sensor looks.
struct Traffic {
    truth: Truth,
    road: BTreeSet<Cell>,
    duration_s: f64,
}

impl Traffic {
    fn new(simulation: &Simulation) -> Self {
        let duration_s = simulation.scene.duration_s;
        let steps = (duration_s / ROAD_STEP_S).floor() as u32;
        let all: Vec<Vec<Label>> =
            (0..=steps).into_par_iter().map(|k| simulation.labels(f64::from(k) * ROAD_STEP_S)).collect();
        let truth = Truth::new(all.into_iter().flatten().collect());
        let mut road = BTreeSet::new();
        for track in truth.tracks.iter().filter(|t| t.moves()) {
            track.solids().for_each(|s| road.extend(s.cells()));
        }
        Self { truth, road, duration_s }
    }

    /// What counts at every instant, with the number of vehicle bits and of cell bits in all.
    fn instants(
        &self,
        simulation: &Simulation,
        every_s: f64,
        cells: &[Cell],
        options: &Options,
        in_view: &(dyn Fn([f64; 2]) -> bool + Sync),
    ) -> (Vec<Instant>, [usize; 2]) {
        let places: BTreeMap<Cell, usize> = cells.iter().enumerate().map(|(k, c)| (*c, k)).collect();
        let (mut instants, mut bits) = (Vec::new(), [0, 0]);
        let count = (self.duration_s / every_s).floor() as u32;
        for k in 0..=count {
            let since_s = f64::from(k) * every_s;
            let objects = self.truth.at(simulation.scene.start_ns() + (since_s * 1e9).round() as i64);
            let moves = |o: &Object| o.speed().is_none_or(|v| v >= options.min_speed_mps);
            let mut counted = Vec::new();
            for (k, _) in
                objects.iter().enumerate().filter(|(_, o)| moves(o) && in_view([o.solid.center[0], o.solid.center[1]]))
            {
                counted.push((k, bits[0]));
                bits[0] += 1;
            }
            let taken: BTreeSet<usize> =
                objects.iter().flat_map(|o| o.solid.cells()).filter_map(|c| places.get(&c).copied()).collect();
            let mut free = Vec::new();
            for cell in (0..cells.len()).filter(|c| !taken.contains(c)) {
                free.push((cell, bits[1]));
                bits[1] += 1;
            }
            instants.push(Instant { since_s, objects, counted, cells: free });
        }
        (instants, bits)
    }
}

/// Mounts that can be, and the others with what stands or drives in their way.
fn possible(scene: &Scene, mounts: &[Mount], traffic: &Traffic) -> (Vec<Mount>, Vec<LeftOut>) {
    let hit = |mount: &Mount| {
        traffic.truth.tracks.iter().find(|t| t.moves() && t.solids().any(|s: &Solid| mount.is_inside(s)))
    };
    let check = |mount: &Mount| -> Result<()> {
        let mut own = scene.clone();
        own.camera = None;
        own.radar.mount = *mount;
        own.check()?;
        let hit = hit(mount);
        ensure!(
            hit.is_none(),
            "{}",
            hit.map_or(String::new(), |t| format!("{} `{}` drives through it", t.class, t.id))
        );
        Ok(())
    };
    let (mut fit, mut left_out) = (Vec::new(), Vec::new());
    for mount in mounts {
        match check(mount) {
            Ok(()) => fit.push(*mount),
            Err(e) => left_out.push(LeftOut { mount: *mount, reason: format!("{e:#}") }),
        }
    }
    (fit, left_out)
}

/// A recording of a mounted radar that has recorded nothing: pose and field of view for the evaluation.
fn blank(simulation: &Simulation, mount: &Mount) -> Recording {
    Recording {
        name: String::new(),
        sensor: simulation.sensor(),
        pose: mount.pose(),
        frames: Vec::new(),
        scans: None,
        ground: Ground::default(),
        truth: None,
        occlusion: BTreeMap::new(),
        camera: None,
        problems: Problems::default(),
    }
}

/// A grid of mounts: every height with every place, yaw and pitch.
///
/// # Errors
/// Nothing to try, or more than anyone waits for.
pub fn grid(base: &Mount, axes: [&[f64]; 5]) -> Result<Vec<Mount>> {
    const MOST: usize = 5000;
    let count: usize = axes.iter().map(|a| a.len()).product();
    ensure!(count > 0 && count <= MOST, "{count} candidate mounts; from 1 to {MOST} can be tried");
    let [heights, along, across, yaws, pitches] = axes;
    let mut mounts = Vec::with_capacity(count);
    for &height_m in heights {
        for &x_m in along {
            for &y_m in across {
                for &yaw_deg in yaws {
                    for &pitch_deg in pitches {
                        mounts.push(Mount { x_m, y_m, height_m, yaw_deg, pitch_deg, ..*base });
                    }
                }
            }
        }
    }
    Ok(mounts)
}
