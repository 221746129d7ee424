//! A scene in time: the world at every frame, what the sensors measure of it, the recording.

use std::io::{Seek, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};
use rayon::prelude::*;

use super::body::{Block, blocks};
use super::radar::Radar;
use super::radar::disturbance::{Outage, noise_db, outage};
use super::random::{Dice, Use, name};
use super::scatter::{Scatterer, scatterers};
use super::scene::Scene;
use super::scene::structure::Piece;
use super::traffic::types::Class;
use super::traffic::{self, Region, Traffic};
use super::world::{Body, Sides, World};
use crate::recording::write::RecordingWriter;
use crate::recording::{Frame, Sensor};
use crate::truth::Label;

/// Vehicles are known this far beyond the radar's range, metres: tracks begin before the field of view does.
const BEYOND_M: f64 = 40.0;
/// Frames computed at once; what is in memory stays small however long the recording.
const BATCH: usize = 256;
/// Labels are written in steps of this, metres: nobody measures truth finer.
const LABEL_STEP_M: f64 = 1.0 / 1024.0;

/// A scene with its traffic, ready to be looked at at any instant.
pub struct Simulation {
    pub scene: Scene,
    pub traffic: Traffic,
    pub radar: Radar,
    vehicles: Vec<Prepared>,
    structures: Vec<Piece>,
}

/// What never changes of a vehicle.
struct Prepared {
    blocks: Vec<Block>,
    scatterers: Vec<Scatterer>,
    sides: Sides,
}

/// What one frame gives; no radar frame where it is missing.
pub struct Step {
    pub time_ns: i64,
    pub radar: Option<Frame>,
    pub labels: Vec<Label>,
}

impl Simulation {
    /// Reads what the scene names and prepares it; `fcd` replaces the scene's own traffic.
    ///
    /// # Errors
    /// Those of the traffic's files.
    pub fn new(scene: Scene, fcd: Option<&Path>) -> Result<Self> {
        let source = scene.source(fcd)?;
        let mount = &scene.radar.mount;
        let region = Region {
            from_s: scene.from_s(),
            to_s: scene.from_s() + scene.duration_s,
            center: [mount.x_m, mount.y_m],
            radius_m: scene.radar.field_of_view.range_m[1] + BEYOND_M,
        };
        let traffic = traffic::read(&source, &region)?;
        let vehicles = traffic
            .vehicles
            .iter()
            .map(|v| {
                let mut dice = Dice::new(scene.seed, Use::Vehicle, name(&v.id));
                Prepared {
                    blocks: blocks(&v.kind),
                    scatterers: scatterers(&v.kind, &mut dice),
                    sides: if matches!(v.kind.class, Class::Truck | Class::Bus) { Sides::Vehicle } else { Sides::Dull },
                }
            })
            .collect();
        let structures = scene.structures.iter().flat_map(|s| s.pieces(scene.seed)).collect();
        Ok(Self { radar: scene.radar.radar(), vehicles, structures, traffic, scene })
    }

    /// Radar frames of the whole recording.
    pub fn frames(&self) -> u64 {
        // a frame at the very end belongs to the next recording
        (self.scene.duration_s * self.scene.radar.rate_hz - 1e-9).floor() as u64 + 1
    }

    /// Everything that happens at one radar frame.
    ///
    /// # Errors
    /// A vehicle that drives through the sensor.
    pub fn step(&self, number: u64) -> Result<Step> {
        let section = &self.scene.radar;
        let since_s = number as f64 / section.rate_hz;
        let time_ns = self.scene.start_ns() + (since_s * 1e9).round() as i64;
        let (bodies, returns, labels) = self.instant(since_s, time_ns)?;
        let radar = match outage(&section.outage, since_s) {
            Some(Outage::Missing) => None,
            Some(Outage::Empty) => Some(Vec::new()),
            None => {
                let mut dice = Dice::new(self.scene.seed, Use::Interference, number);
                let noise = noise_db(&section.interference, &section.model.interference, since_s, &mut dice);
                let world = World::new(self.radar.pose.position, bodies);
                Some(self.radar.scan(&world, &returns, self.scene.seed, number, noise))
            }
        };
        Ok(Step { time_ns, radar: radar.map(|detections| Frame { time_ns, detections }), labels })
    }

    /// Bodies, what they return, and their labels, in one order.
    fn instant(&self, since_s: f64, time_ns: i64) -> Result<(Vec<Body<'_>>, Vec<&[Scatterer]>, Vec<Label>)> {
        let eye = self.radar.pose.position;
        let mut bodies = Vec::new();
        let mut returns = Vec::new();
        let mut labels = Vec::new();
        for piece in &self.structures {
            let Piece { label, blocks, scatterers, sides } = piece;
            bodies.push(Body { solid: label.solid, velocity: [0.0; 2], blocks, sides: *sides });
            returns.push(scatterers.as_slice());
            labels.push(Label { time_ns, ..label.clone() });
        }
        for (k, pose) in self.traffic.at(self.scene.from_s() + since_s) {
            let (vehicle, prepared) = (&self.traffic.vehicles[k], &self.vehicles[k]);
            let solid = pose.solid;
            if solid.footprint_distance([eye[0], eye[1]]) <= 0.0 && eye[2] <= solid.top() {
                bail!(
                    "{} `{}` drives through radar `{}` at {since_s:.2} s: the mount at ({}, {}) is {} m high",
                    vehicle.kind.class.name(),
                    vehicle.id,
                    self.scene.radar.name,
                    eye[0],
                    eye[1],
                    eye[2]
                );
            }
            bodies.push(Body { solid, velocity: pose.velocity, blocks: &prepared.blocks, sides: prepared.sides });
            returns.push(prepared.scatterers.as_slice());
            let round = |v: f64| (v / LABEL_STEP_M).round() * LABEL_STEP_M;
            let [x, y, z] = solid.center;
            labels.push(Label {
                time_ns,
                id: vehicle.id.clone(),
                class: vehicle.kind.class.name().to_owned(),
                solid: crate::geometry::solid::Solid {
                    center: [round(x), round(y), z],
                    yaw_rad: round(solid.yaw_rad),
                    size: solid.size,
                },
            });
        }
        Ok((bodies, returns, labels))
    }

    /// What the recording says of the radar.
    pub fn sensor(&self) -> Sensor {
        Sensor {
            name: self.scene.radar.name.clone(),
            field_of_view: self.radar.field_of_view,
            has_elevation: self.radar.has_elevation,
            frames_independent: false,
            platform_moving: false,
            licence: self.scene.licence.clone(),
        }
    }

    /// Simulates everything and writes it. `progress` is told each frame done.
    ///
    /// # Errors
    /// Those of [`Simulation::step`], and a sink that takes no more.
    pub fn record<W: Write + Seek>(&self, sink: W, progress: &(dyn Fn() + Sync)) -> Result<W> {
        let mut writer = RecordingWriter::new(sink, &self.sensor(), &self.radar.pose, self.scene.start_ns())?;
        let frames = self.frames();
        for first in (0..frames).step_by(BATCH) {
            let last = (first + BATCH as u64).min(frames);
            let steps: Vec<Result<Step>> = (first..last)
                .into_par_iter()
                .map(|number| {
                    progress();
                    self.step(number)
                })
                .collect();
            for step in steps {
                let step = step?;
                if let Some(frame) = &step.radar {
                    writer.frame(frame)?;
                }
                writer.objects(step.time_ns, &step.labels)?;
            }
        }
        writer.finish().context("cannot complete the recording")
    }
}
