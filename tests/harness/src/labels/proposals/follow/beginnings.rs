//! How a vehicle may move where a person clicked on it.
//!
//! Doppler tells the speed for a heading, where the line of sight does not cross it. Headings are tried all around; that of
//! its label nearby and those of others that went there are likelier. What stands for a while at the click stands.

use std::f64::consts::TAU;

use super::super::motion::Motion;
use super::super::reflections::{Reflection, STANDS_MPS};
use super::super::tracker::DOPPLER_MPS;
use super::around::Around;
use super::state::{STANDS_BELOW_MPS, State};
use crate::labels::near_face;

/// How exact a click is, metres.
pub const CLICK_M: f64 = 0.6;
/// Directions that are tried, and speeds where Doppler tells none, m/s.
const DIRECTIONS: usize = 24;
const SPEEDS_MPS: [f64; 4] = [0.0, 3.0, 6.0, 10.0];
/// Fastest way that is tried, m/s.
const FASTEST_MPS: f64 = 45.0;
/// Cosine between heading and line of sight from which on Doppler tells the speed.
const TELLS_COS: f64 = 0.35;
/// Reflections this near to the click tell its Doppler, in seconds and metres.
const NEAR_S: f64 = 0.15;
const NEAR_M: f64 = 2.5;
/// What speaks for a heading in which others went here.
const USUAL: f64 = 4.0;
/// What speaks against a velocity that the label does not reach with this acceleration, m/s², and against one at all of what
/// stands.
const HARD: f64 = 15.0;
const HARDEST_MPS2: f64 = 4.0;
const STOOD: f64 = 30.0;
/// A click so near to where the label ends may mean that it stood there, metres.
const STOOD_M: f64 = 3.0;
/// It stands at the click where nothing moves so near to it for so long, metres and seconds.
const STANDS_WITHIN_M: f64 = 1.2;
const STANDS_FOR_S: f64 = 1.0;

impl Around<'_> {
    /// States to begin with, heading and speed of what is at the click, and how much speaks for each.
    pub fn beginnings(&self, frame: usize, near: [f64; 2]) -> Vec<(f64, State)> {
        let now_s = self.seconds(frame);
        let close = |r: &&Reflection| (r.place[0] - near[0]).hypot(r.place[1] - near[1]) < NEAR_M;
        let all = self.instants.iter().filter(|i| (i.time_s - now_s).abs() <= NEAR_S);
        let mut dopplers: Vec<f64> =
            all.flat_map(|i| i.reflections.iter().filter(close)).map(|r| r.doppler_mps).collect();
        dopplers.sort_by(f64::total_cmp);
        dopplers.dedup_by(|a, b| (*a - *b).abs() < DOPPLER_MPS);
        let [dx, dy] = [near[0] - self.sensor[0], near[1] - self.sensor[1]];
        let sight = dy.atan2(dx);
        let all_around = (0..DIRECTIONS).map(|k| (TAU * k as f64 / DIRECTIONS as f64, 0.0));
        let mut headings: Vec<(f64, f64)> = all_around.collect();
        // where its label goes near this time, and where others went here
        let near_s = |k: &usize| (self.seconds(*k) - now_s).abs();
        let labelled = (0..self.own.len()).filter(|k| self.label(*k).is_some());
        let nearest = labelled.min_by(|a, b| near_s(a).total_cmp(&near_s(b)));
        let own = nearest.and_then(|k| State::labelled(self, k));
        headings.extend(own.map(|own| (own.heading_rad, USUAL)));
        let here =
            self.others.iter().flatten().filter(|other| {
                (other.center[0] - near[0]).hypot(other.center[1] - near[1]) < 0.5 * other.size[0] + 1.0
            });
        for other in here {
            let known = |(heading, likely): &(f64, f64)| *likely > 0.0 && (heading - other.yaw_rad).cos() > 0.98;
            if !headings.iter().any(known) {
                headings.push((other.yaw_rad, USUAL));
            }
        }
        let stood = self.stood_there(frame, near);
        let mut speeds: Vec<(f64, f64, f64)> = Vec::new();
        for (heading, likely) in headings {
            let cos = (heading - sight).cos();
            if cos.abs() < TELLS_COS {
                speeds.extend(SPEEDS_MPS.map(|v| (heading, v, likely)));
            } else {
                let along = dopplers.iter().map(|d| d / cos).filter(|v| (-0.3..FASTEST_MPS).contains(v));
                speeds.extend(along.map(|v| (heading, v.max(0.0), likely)));
            }
        }
        let state = |(heading_rad, speed, likely): (f64, f64, f64)| {
            let (s, c) = heading_rad.sin_cos();
            let place = near_face::center(near, heading_rad, self.size, self.sensor);
            let velocity = [speed * c, speed * s];
            let motion = Motion::new(place, velocity, CLICK_M, [c, s], [1.0, 0.5]);
            // nobody brakes or turns that hard
            let gap_s = nearest.map_or(0.0, |k| near_s(&k));
            let hard = own.is_some_and(|own| {
                let [u, v] = own.motion.velocity();
                (velocity[0] - u).hypot(velocity[1] - v) > HARDEST_MPS2 * gap_s + 4.0
            });
            let moves = stood && speed > STANDS_BELOW_MPS;
            let unlikely = if moves {
                STOOD
            } else if hard {
                HARD
            } else {
                0.0
            };
            (likely - unlikely, State { motion, heading_rad })
        };
        let mut all: Vec<(f64, State)> = speeds.into_iter().map(state).collect();
        // it may stand where its label ends, whatever its heading
        let stands = own.filter(|own| {
            let face = near_face::near(own.motion.place(), own.heading_rad, self.size, self.sensor);
            own.motion.speed() < 2.0 * STANDS_BELOW_MPS && (face[0] - near[0]).hypot(face[1] - near[1]) < STOOD_M
        });
        all.extend(stands.map(|own| {
            let motion = Motion::new(own.motion.place(), [0.0; 2], 0.3, [1.0, 0.0], [0.3; 2]);
            (2.0 * USUAL, State { motion, ..own })
        }));
        all
    }

    /// Whether something stands there for a while, and nothing moves there.
    fn stood_there(&self, frame: usize, near: [f64; 2]) -> bool {
        let now_s = self.seconds(frame);
        let while_s = self.instants.iter().filter(|i| (i.time_s - now_s).abs() <= STANDS_FOR_S);
        let (mut all, mut stands, mut moves) = (0, 0, 0);
        for instant in while_s {
            let any = |within_m: f64, moving: bool| {
                instant.reflections.iter().any(|r| {
                    (r.place[0] - near[0]).hypot(r.place[1] - near[1]) < within_m
                        && (r.doppler_mps.abs() > STANDS_MPS) == moving
                })
            };
            all += 1;
            stands += usize::from(any(NEAR_M, false));
            moves += usize::from(any(STANDS_WITHIN_M, true));
        }
        10 * stands >= 8 * all && 10 * moves <= all
    }
}
