//! A scene in time: the world at every frame, what the sensors measure of it, the recording.

use std::io::{Seek, Write};
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use rayon::prelude::*;

use super::body::{Block, blocks};
use super::camera::detector::{self, DetectorModel};
use super::camera::{Camera, Target};
use super::radar::Radar;
use super::radar::disturbance::{Outage, noise_db, outage};
use super::radar::misses::Missed;
use super::random::{Dice, Use, name};
use super::scatter::{Scatterer, scatterers};
use super::scene::structure::{PIECE_M, PIECE_ON_GRADE_M, Piece};
use super::scene::{Look, RadarSection, Scene};
use super::traffic::types::Class;
use super::traffic::{self, Region, Traffic};
use super::world::{Body, Sides, World};
use crate::geometry::ground::Ground;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::camera::{CameraFrame, RecordedCamera};
use crate::recording::problems::Problems;
use crate::recording::truth::{Label, Truth};
use crate::recording::write::RecordingWriter;
use crate::recording::{Frame, RadarDetection, Recording, Sensor};

/// Vehicles are known this far beyond the radar's range, metres: tracks begin before the field of view does.
const BEYOND_M: f64 = 40.0;
/// Draws of further radars are their own: their frames have numbers that no frame of the first has.
const FURTHER_BITS: u32 = 32;
/// Frames computed at once; what is in memory stays small however long the recording.
const BATCH: usize = 256;
/// Labels are written in steps of this, metres: nobody measures truth finer.
const LABEL_STEP_M: f64 = 1.0 / 1024.0;

/// A scene with its traffic, ready to be looked at at any instant.
pub struct Simulation {
    pub scene: Scene,
    pub traffic: Traffic,
    pub radar: Radar,
    /// Those beside the first.
    pub further_radars: Vec<Radar>,
    vehicles: Vec<Prepared>,
    /// What each radar misses, frame by frame.
    missed: Vec<Missed>,
    structures: Vec<Piece>,
    ground: Ground,
}

/// What never changes of a vehicle.
struct Prepared {
    blocks: Vec<Block>,
    scatterers: Vec<Scatterer>,
    sides: Sides,
}

/// What one radar frame gives; no frame where it is missing.
pub struct Step {
    pub time_ns: i64,
    pub radar: Option<Frame>,
    /// Of each further radar.
    pub further: Vec<Frame>,
    pub labels: Vec<Label>,
    /// Vehicles whose middle lies in the radar's field of view, hidden or not.
    pub in_view: usize,
}

/// What a recording has become.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Made {
    /// Frames of all radars written; those of an outage may be missing.
    pub frames: u64,
    pub camera_frames: u64,
    pub detections: u64,
    pub camera_boxes: u64,
    /// Distinct vehicles that drive in the recording.
    pub vehicles: usize,
    /// Vehicles in the radar's field of view, mean over all frames.
    pub vehicles_in_view: f64,
    pub most_vehicles_in_view: usize,
}

/// Everything that stands and drives at one instant, in one order: structures first.
struct Instant<'a> {
    bodies: Vec<Body<'a>>,
    returns: Vec<&'a [Scatterer]>,
    labels: Vec<Label>,
    /// Which vehicles drive, in this order behind the structures.
    driving: Vec<usize>,
}

impl Instant<'_> {
    /// Takes away what a radar misses.
    fn without(&mut self, missed: &[usize]) {
        let first = self.returns.len() - self.driving.len();
        for (vehicle, returns) in self.driving.iter().zip(&mut self.returns[first..]) {
            if missed.contains(vehicle) {
                *returns = &[];
            }
        }
    }
}

impl Simulation {
    /// Reads what the scene names and prepares it; `fcd` replaces the scene's own traffic.
    ///
    /// # Errors
    /// Those of the traffic's files.
    pub fn new(scene: Scene, fcd: Option<&Path>) -> Result<Self> {
        let looks = scene.looks();
        Self::seen_by(scene, fcd, &looks)
    }

    /// The same for sensors that look elsewhere than the scene's own; its range is theirs too.
    ///
    /// # Errors
    /// Those of the traffic's files.
    pub fn seen_by(scene: Scene, fcd: Option<&Path>, looks: &[Look]) -> Result<Self> {
        let source = scene.source(fcd)?;
        let mount = &scene.radar.mount;
        let center = [mount.x_m, mount.y_m];
        let farthest_m = looks.iter().map(|look| look.distance(center)).fold(0.0, f64::max);
        let region = Region {
            from_s: scene.from_s(),
            to_s: scene.from_s() + scene.duration_s,
            center,
            radius_m: scene.radar.field_of_view.range_m[1] + farthest_m + BEYOND_M,
        };
        let mut traffic = traffic::read(&source, &region)?;
        traffic.keep(|place| looks.iter().any(|look| look.reaches(place)));
        ensure!(
            !traffic.vehicles.is_empty(),
            "{}: an empty scene: vehicles come near, but none where a sensor looks; check the yaw of the mounts",
            source.path.display()
        );
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
        let ground = scene.ground()?;
        let longest_m = if ground.is_level() { PIECE_M } else { PIECE_ON_GRADE_M };
        let mut structures: Vec<Piece> =
            scene.structures.iter().flat_map(|s| s.pieces(scene.seed, longest_m)).collect();
        structures.iter_mut().for_each(|piece| lift(&ground, &mut piece.label.solid));
        let radar = |section: &RadarSection| {
            let mut radar = section.radar();
            radar.pose.position[2] += ground.height(radar.pose.position[0]);
            radar
        };
        let further_radars: Vec<Radar> = scene.radars().iter().skip(1).map(radar).collect();
        let radar = radar(&scene.radar);
        let (rate_hz, from_s) = (scene.radar.rate_hz, scene.from_s());
        let missed = (0..).zip([&radar].into_iter().chain(&further_radars)).map(|(k, radar)| {
            let [x, y, _] = radar.pose.position;
            let times = (0..count(&scene, rate_hz)).map(|number| from_s + number as f64 / rate_hz);
            Missed::new(&radar.model.misses, &traffic, [x, y], scene.seed.wrapping_add(k << FURTHER_BITS), times)
        });
        let missed = missed.collect();
        Ok(Self { radar, further_radars, vehicles, missed, structures, ground, traffic, scene })
    }

    /// That vehicles of the traffic jump, in words.
    pub fn jumps(&self) -> Option<String> {
        let (jump, n) = self.traffic.jumps.as_ref()?;
        Some(format!(
            "vehicle `{}` jumps {:.0} m in {:.1} s at {:.1} s of the traffic (SUMO teleports what blocks others; {n} jumps in all): it is left out between, and another one after",
            jump.id, jump.way_m, jump.passed_s, jump.time_s
        ))
    }

    /// When the last vehicle leaves, seconds since the begin.
    pub fn traffic_ends_s(&self) -> f64 {
        let ends = self.traffic.vehicles.iter().filter_map(|v| v.ends_s());
        ends.fold(0.0, f64::max) - self.scene.from_s()
    }

    /// Radar frames of the whole recording.
    pub fn frames(&self) -> u64 {
        count(&self.scene, self.scene.radar.rate_hz)
    }

    /// Camera frames of the whole recording.
    pub fn camera_frames(&self) -> u64 {
        self.scene.camera.as_ref().map_or(0, |c| count(&self.scene, c.rate_hz))
    }

    fn time_ns(&self, since_s: f64) -> i64 {
        self.scene.start_ns() + (since_s * 1e9).round() as i64
    }

    /// Everything that happens at one radar frame.
    ///
    /// # Errors
    /// A vehicle that drives through a sensor.
    pub fn step(&self, number: u64) -> Result<Step> {
        let section = &self.scene.radar;
        let since_s = number as f64 / section.rate_hz;
        let time_ns = self.time_ns(since_s);
        let mut instant = self.instant(since_s, time_ns);
        instant.without(self.missed_at(0, number));
        let Instant { bodies, returns, labels, .. } = instant;
        self.passes_below(&labels, since_s)?;
        let radar = match outage(&section.outage, since_s) {
            Some(Outage::Missing) => None,
            Some(Outage::Empty) => Some(Vec::new()),
            None => {
                let mut dice = Dice::new(self.scene.seed, Use::Interference, number);
                let noise = noise_db(&section.interference, &section.model.interference, since_s, &mut dice);
                let world = World::over(&self.ground, self.radar.pose.position, bodies);
                Some(self.radar.scan(&world, &returns, self.scene.seed, number, noise))
            }
        };
        let in_view = self.in_view(&labels);
        let frame = |detections| Frame { time_ns, detections, refused: 0, unwanted: Vec::new(), fault: false };
        let further = (1..).zip(&self.further_radars);
        let further = further
            .map(|(k, radar)| {
                let own = number + (k << FURTHER_BITS);
                frame(self.scan_without(radar, since_s, own, self.missed_at(k, number)))
            })
            .collect();
        Ok(Step { time_ns, radar: radar.map(frame), further, labels, in_view })
    }

    /// What the camera sees at one of its frames.
    ///
    /// # Errors
    /// A vehicle that drives through a sensor.
    pub fn camera_step(&self, camera: &Camera, rate_hz: f64, number: u64) -> Result<CameraFrame> {
        let (_, mut frames) = self.camera_views(camera, rate_hz, number, &[camera.model])?;
        frames.pop().context("a frame of each detector")
    }

    /// Everything at one of a camera's frames, and what each of several detectors finds of it.
    ///
    /// # Errors
    /// A vehicle that drives through a sensor.
    pub fn camera_views(
        &self,
        camera: &Camera,
        rate_hz: f64,
        number: u64,
        detectors: &[DetectorModel],
    ) -> Result<(Vec<Label>, Vec<CameraFrame>)> {
        let since_s = number as f64 / rate_hz;
        let time_ns = self.time_ns(since_s);
        let labels = self.instant(since_s, time_ns).labels;
        self.passes_below(&labels, since_s)?;
        let is_vehicle = |l: &&Label| Class::named(&l.class).is_some();
        let targets: Vec<Target> =
            labels.iter().filter(is_vehicle).map(|l| Target { class: &l.class, solid: l.solid }).collect();
        let screens: Vec<Solid> = labels.iter().filter(|l| !is_vehicle(l)).map(|l| l.solid).collect();
        let solids: Vec<Solid> = targets.iter().map(|t| t.solid).collect();
        let seen = camera.view(&solids, &screens);
        let boxes = |model| {
            let camera = Camera { model, ..camera.clone() };
            detector::detect(&camera, &seen, &targets, self.scene.seed, number)
        };
        let frame = |model: &DetectorModel| CameraFrame { time_ns, boxes: boxes(*model), refused: 0 };
        let frames = detectors.iter().map(frame).collect();
        Ok((labels, frames))
    }

    /// Boxes of everything at an instant, whatever looks at it.
    pub fn labels(&self, since_s: f64) -> Vec<Label> {
        self.instant(since_s, self.time_ns(since_s)).labels
    }

    /// What a radar mounted anywhere measures at an instant; `number` makes the draws its own.
    pub fn scan(&self, radar: &Radar, since_s: f64, number: u64) -> Vec<RadarDetection> {
        self.scan_without(radar, since_s, number, &[])
    }

    /// The vehicles that a radar misses in a frame.
    fn missed_at(&self, radar: u64, frame: u64) -> &[usize] {
        usize::try_from(radar).ok().and_then(|radar| self.missed.get(radar)).map_or(&[], |missed| missed.at(frame))
    }

    fn scan_without(&self, radar: &Radar, since_s: f64, number: u64, missed: &[usize]) -> Vec<RadarDetection> {
        let mut instant = self.instant(since_s, self.time_ns(since_s));
        instant.without(missed);
        let Instant { bodies, returns, .. } = instant;
        radar.scan(&World::over(&self.ground, radar.pose.position, bodies), &returns, self.scene.seed, number, 0.0)
    }

    fn instant(&self, since_s: f64, time_ns: i64) -> Instant<'_> {
        let mut instant = Instant { bodies: Vec::new(), returns: Vec::new(), labels: Vec::new(), driving: Vec::new() };
        for piece in &self.structures {
            let Piece { label, blocks, scatterers, sides } = piece;
            instant.bodies.push(Body { solid: label.solid, velocity: [0.0; 2], blocks, sides: *sides });
            instant.returns.push(scatterers);
            instant.labels.push(Label { time_ns, ..label.clone() });
        }
        for (k, pose) in self.traffic.at(self.scene.from_s() + since_s) {
            let (vehicle, prepared) = (&self.traffic.vehicles[k], &self.vehicles[k]);
            let mut solid = pose.solid;
            lift(&self.ground, &mut solid);
            instant.bodies.push(Body {
                solid,
                velocity: pose.velocity,
                blocks: &prepared.blocks,
                sides: prepared.sides,
            });
            instant.returns.push(&prepared.scatterers);
            instant.driving.push(k);
            let round = |v: f64| (v / LABEL_STEP_M).round() * LABEL_STEP_M;
            let [x, y, z] = solid.center;
            let z = if self.ground.is_level() { z } else { round(z) };
            instant.labels.push(Label {
                time_ns,
                id: vehicle.id.clone(),
                class: vehicle.kind.class.name().to_owned(),
                solid: Solid { center: [round(x), round(y), z], yaw_rad: round(solid.yaw_rad), size: solid.size },
            });
        }
        instant
    }

    fn in_view(&self, labels: &[Label]) -> usize {
        let view = |l: &&Label| self.radar.field_of_view.contains(self.radar.pose.to_spherical(l.solid.center));
        // structures come first and are not counted
        labels[self.structures.len()..].iter().filter(view).count()
    }

    /// Every vehicle passes below (or above) every sensor of the scene.
    fn passes_below(&self, labels: &[Label], since_s: f64) -> Result<()> {
        for (sensor, mount) in self.scene.mounts() {
            if let Some(hit) = labels[self.structures.len()..].iter().find(|l| mount.is_inside(&self.on_flat(&l.solid)))
            {
                bail!(
                    "{} `{}` drives through {sensor} at {since_s:.2} s: it is {} m high, the mount at ({}, {}) {} m",
                    hit.class,
                    hit.id,
                    hit.solid.top(),
                    mount.x_m,
                    mount.y_m,
                    mount.height_m
                );
            }
        }
        Ok(())
    }

    /// A box as it would stand on a flat road.
    fn on_flat(&self, solid: &Solid) -> Solid {
        let [x, y, z] = solid.center;
        Solid { center: [x, y, z - self.ground.height(x)], ..*solid }
    }

    /// What the recording says of the first radar.
    pub fn sensor(&self) -> Sensor {
        Sensor {
            name: self.scene.radar.name.clone(),
            field_of_view: self.radar.field_of_view,
            has_elevation: self.radar.has_elevation,
            frames_independent: false,
            platform_moving: false,
            synthetic: true,
            licence: self.scene.licence.clone(),
        }
    }

    /// What the recording says of each radar, and where it hangs.
    pub fn radars(&self) -> Vec<(Sensor, SensorPose)> {
        let first = self.sensor();
        let further = self.scene.further_radars.iter().zip(&self.further_radars);
        let further =
            further.map(|(section, radar)| (Sensor { name: section.name.clone(), ..first.clone() }, radar.pose));
        std::iter::once((first.clone(), self.radar.pose)).chain(further).collect()
    }

    /// Simulates everything, a recording a sensor: the radars, then the camera, whose view ends at `camera_range_m`. `progress` is
    /// called after each radar frame.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn recordings(&self, camera_range_m: f64, progress: &(dyn Fn() + Sync)) -> Result<Vec<Recording>> {
        let steps = in_parallel(0..self.frames(), |number| {
            progress();
            self.step(number)
        })?;
        let radars = self.radars();
        let mut frames = vec![Vec::new(); radars.len()];
        let mut labels = Vec::new();
        for step in steps {
            labels.extend(step.labels);
            if let Some((first, further)) = frames.split_first_mut() {
                first.extend(step.radar);
                further.iter_mut().zip(step.further).for_each(|(all, one)| all.push(one));
            }
        }
        let truth = Some(Truth::new(labels));
        let recording = |((sensor, pose), frames): ((Sensor, SensorPose), Vec<Frame>)| Recording {
            name: sensor.name.clone(),
            sensor,
            pose,
            frames,
            scans: None,
            ground: self.ground.clone(),
            truth: truth.clone(),
            occlusion: Default::default(),
            camera: None,
            problems: Problems::default(),
        };
        let mut recordings: Vec<Recording> = radars.into_iter().zip(frames).map(recording).collect();
        if let Some(section) = &self.scene.camera {
            let camera = section.camera();
            let frames = in_parallel(0..self.camera_frames(), |n| self.camera_step(&camera, section.rate_hz, n))?;
            let recorded = RecordedCamera { pose: camera.pose, intrinsics: camera.intrinsics, frames, alone: true };
            let alone = recorded.alone(section.name.clone(), self.sensor(), truth, camera_range_m);
            recordings.push(Recording { ground: self.ground.clone(), ..alone });
        }
        Ok(recordings)
    }

    /// Simulates everything and writes it. `progress` is called after each radar frame.
    ///
    /// # Errors
    /// Those of [`Simulation::step`], and a sink that takes no more.
    pub fn record<W: Write + Seek>(&self, sink: W, progress: &(dyn Fn() + Sync)) -> Result<(W, Made)> {
        let start_ns = self.scene.start_ns();
        let camera = self.scene.camera.as_ref().map(|section| (section.camera(), section.rate_hz));
        let camera_pose = camera.as_ref().map(|(camera, _)| &camera.pose);
        let mut writer = RecordingWriter::of_several(sink, &self.radars(), camera_pose, start_ns)?;
        if !self.ground.is_level() {
            writer.ground(&self.ground)?;
        }
        let frames = self.frames();
        let mut made = Made { vehicles: self.traffic.vehicles.len(), ..Made::default() };
        let mut camera_first = 0;
        for first in (0..frames).step_by(BATCH) {
            let last = (first + BATCH as u64).min(frames);
            let steps = in_parallel(first..last, |number| {
                progress();
                self.step(number)
            })?;
            let mut pictures = Vec::new();
            if let Some((camera, rate_hz)) = &camera {
                // those before the next batch of the radar; after the last, all
                let before = (last as f64 / self.scene.radar.rate_hz * rate_hz).ceil() as u64;
                let camera_last = if last == frames { self.camera_frames() } else { before.min(self.camera_frames()) };
                pictures = in_parallel(camera_first..camera_last, |n| self.camera_step(camera, *rate_hz, n))?;
                camera_first = camera_last;
            }
            made.camera_frames += pictures.len() as u64;
            made.camera_boxes += pictures.iter().map(|f| f.boxes.len() as u64).sum::<u64>();
            let mut pictures = pictures.iter().peekable();
            let mut until = |time_ns: i64, writer: &mut RecordingWriter<W>| -> Result<()> {
                while let (Some(frame), Some((camera, _))) = (pictures.next_if(|f| f.time_ns <= time_ns), &camera) {
                    writer.camera_frame(frame, &camera.intrinsics)?;
                }
                Ok(())
            };
            for step in &steps {
                until(step.time_ns, &mut writer)?;
                made.vehicles_in_view += step.in_view as f64 / frames as f64;
                made.most_vehicles_in_view = made.most_vehicles_in_view.max(step.in_view);
                let further = (1..).zip(&step.further);
                for (radar, frame) in step.radar.iter().map(|frame| (0, frame)).chain(further) {
                    made.frames += 1;
                    made.detections += frame.detections.len() as u64;
                    writer.frame_of(radar, frame)?;
                }
                writer.objects(step.time_ns, &step.labels)?;
            }
            until(i64::MAX, &mut writer)?;
        }
        let sink = writer.finish().context("cannot complete the recording")?;
        Ok((sink, made))
    }
}

/// Frames of a whole recording at a rate.
fn count(scene: &Scene, rate_hz: f64) -> u64 {
    // a frame at the very end belongs to the next recording
    (scene.duration_s * rate_hz - 1e-9).floor() as u64 + 1
}

/// Puts what would stand on a flat road upon the ground below its middle.
fn lift(ground: &Ground, solid: &mut Solid) {
    solid.center[2] += ground.height(solid.center[0]);
}

/// Computes numbered frames in parallel, in their order; the first error wins.
fn in_parallel<T: Send>(numbers: Range<u64>, compute: impl Fn(u64) -> Result<T> + Sync + Send) -> Result<Vec<T>> {
    let all: Vec<Result<T>> = numbers.into_par_iter().map(compute).collect();
    all.into_iter().collect()
}
