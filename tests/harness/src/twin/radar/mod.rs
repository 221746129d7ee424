//! A radar: what it would measure of one instant of the world.
//!
//! In the order of the signal: [`antenna`] and r^-4 give each path its strength, [`echoes`] collects the
//! paths (straight, by the road, by mirrors), [`cells`] adds up what the sensor cannot resolve, [`detector`]
//! sets the threshold, [`measure`] makes noisy, rounded detections. [`disturbance`] is what comes from
//! outside: interference, outages, and [`misses`] which vehicles a frame does not show. [`model`] holds every parameter with its source.

pub mod antenna;
pub mod cells;
pub mod detector;
pub mod disturbance;
pub mod echo;
pub mod echoes;
pub mod measure;
pub mod mirrors;
pub mod misses;
pub mod model;

use super::random::{Dice, Use};
use super::scatter::Scatterer;
use super::world::World;
use crate::geometry::pose::SensorPose;
use crate::recording::{FieldOfView, RadarDetection};
use model::RadarModel;

/// A mounted radar.
#[derive(Debug, Clone)]
pub struct Radar {
    pub pose: SensorPose,
    pub field_of_view: FieldOfView,
    pub has_elevation: bool,
    pub model: RadarModel,
}

impl Radar {
    /// Everything detected in one frame, in the order of range, Doppler and azimuth.
    ///
    /// `noise_db` is how far the noise has risen; `number` makes the frame's draws its own.
    pub fn scan(
        &self,
        world: &World,
        returns: &[&[Scatterer]],
        seed: u64,
        number: u64,
        noise_db: f64,
    ) -> Vec<RadarDetection> {
        let mut dice = Dice::new(seed, Use::RadarFrame, number);
        let noise = 10_f64.powf(noise_db / 10.0);
        let echoes = echoes::collect(self, world, returns, noise, &mut dice);
        let cells = cells::resolve(self, echoes, &mut dice);
        let peaks = detector::detect(&self.model.detector, cells);
        let mut detections: Vec<RadarDetection> =
            peaks.iter().filter_map(|p| measure::measure(self, p, noise, &mut dice)).collect();
        detections.extend(
            detector::false_alarms(self, &mut dice).iter().filter_map(|p| measure::measure(self, p, noise, &mut dice)),
        );
        let most = self.model.max_detections;
        if detections.len() > most {
            // the strongest stay, in their order
            let mut strengths: Vec<f32> = detections.iter().filter_map(|d| d.snr_db).collect();
            strengths.sort_by(|a, b| b.total_cmp(a));
            let weakest = strengths[most - 1];
            let mut room = most - strengths.iter().filter(|s| **s > weakest).count();
            detections.retain(|d| match d.snr_db {
                Some(snr) if snr > weakest => true,
                Some(snr) if snr == weakest && room > 0 => {
                    room -= 1;
                    true
                }
                _ => false,
            });
        }
        detections
    }
}

/// Small worlds for the tests of the stages.
#[cfg(test)]
pub mod made_up {
    use super::*;
    use crate::geometry::solid::Solid;
    use crate::twin::body::{Block, blocks};
    use crate::twin::scatter::scatterers;
    use crate::twin::traffic::types::{Class, Kind};
    use crate::twin::world::{Body, Sides};

    /// On a gantry at 6 m, level, looking along x.
    pub fn radar() -> Radar {
        Radar {
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            field_of_view: FieldOfView {
                azimuth_rad: [-60_f64.to_radians(), 60_f64.to_radians()],
                elevation_rad: [-0.3, 0.3],
                range_m: [3.0, 200.0],
            },
            has_elevation: true,
            model: RadarModel::default(),
        }
    }

    struct Standing {
        solid: Solid,
        velocity: [f64; 2],
        blocks: Vec<Block>,
        scatterers: Vec<Scatterer>,
        sides: Sides,
    }

    pub struct Scene(Vec<Standing>);

    impl Scene {
        /// Vehicles of a class at a place with a velocity, all along the road.
        pub fn new(vehicles: &[(Class, [f64; 2], [f64; 2])]) -> Self {
            let vehicle = |(k, &(class, [x, y], velocity)): (usize, &(Class, [f64; 2], [f64; 2]))| {
                let kind = Kind { class, size: class.size() };
                Standing {
                    solid: Solid { center: [x, y, kind.size[2] / 2.0], yaw_rad: 0.0, size: kind.size },
                    velocity,
                    blocks: blocks(&kind),
                    scatterers: scatterers(&kind, &mut Dice::new(1, Use::Vehicle, k as u64)),
                    sides: if class == Class::Truck { Sides::Vehicle } else { Sides::Dull },
                }
            };
            Self(vehicles.iter().enumerate().map(vehicle).collect())
        }

        pub fn with(&self, radar: &Radar, run: impl FnOnce(&World, &[&[Scatterer]])) {
            let bodies = self.0.iter().map(|s| {
                let Standing { solid, velocity, blocks, sides, .. } = s;
                Body { solid: *solid, velocity: *velocity, blocks, sides: *sides }
            });
            let world = World::new(radar.pose.position, bodies.collect());
            let returns: Vec<&[Scatterer]> = self.0.iter().map(|s| s.scatterers.as_slice()).collect();
            run(&world, &returns);
        }
    }
}
