//! Several sensors' estimators, fused: `viewshed::fusion` over their maps.

use anyhow::{Result, anyhow, ensure};
use viewshed::fixed::time::Time;
use viewshed::fusion::{FusedCell, Fusion, FusionConfig, MOST_SENSORS};
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use super::Estimator;
use super::camera_3d::time;
use crate::recording::Frame;

/// Name of the fused map.
pub const FUSED: &str = "fused";

/// Cells of the road, of one metre.
const CELLS: usize = 320;

type Road = Fusion<MOST_SENSORS, CELLS, CELLS>;

/// Stack that a road is made on, bytes: it is moved to the heap once it is there.
const STACK: usize = 4 * size_of::<Road>() + (1 << 20);

struct Member {
    estimator: Box<dyn Estimator>,
    frames: Vec<Frame>,
    /// Frames it was given.
    taken: usize,
}

/// Estimators whose maps are fused.
pub struct Fused {
    members: Vec<Member>,
    road: Box<Road>,
    now: Time,
    every: usize,
    steps: usize,
}

/// Estimators with their frames, on a grid around these cells of the road, metres. Maps are fused at each `every`-th
/// frame, as no others are judged.
///
/// # Errors
/// More estimators than can be fused, a road larger than the grid.
pub fn new(members: Vec<(Box<dyn Estimator>, Vec<Frame>)>, road: &[(i32, i32)], every: usize) -> Result<Box<Fused>> {
    ensure!(members.len() <= MOST_SENSORS, "{} sensors; {MOST_SENSORS} can be fused", members.len());
    let ends =
        |of: fn(&(i32, i32)) -> i32| (road.iter().map(of).min().unwrap_or(0), road.iter().map(of).max().unwrap_or(0));
    let ((x, x_end), (y, y_end)) = (ends(|c| c.0), ends(|c| c.1));
    let long = [x_end - x, y_end - y].into_iter().max().unwrap_or(0) as usize;
    ensure!(long < CELLS, "the road is {long} m long or wide; {CELLS} m can be fused");
    let made = std::thread::Builder::new().stack_size(STACK).spawn(|| Box::new(Road::NOWHERE));
    let mut fusion = made?.join().map_err(|_| anyhow!("a road of {} bytes cannot be made", size_of::<Road>()))?;
    fusion.set(RoadPoint::new(100 * x, 100 * y), 100, FusionConfig::default())?;
    let members = members.into_iter().map(|(estimator, frames)| Member { estimator, frames, taken: 0 }).collect();
    Ok(Box::new(Fused { members, road: fusion, now: Time::from_micros(0), every, steps: 0 }))
}

impl Fused {
    /// What each of the estimators says of a place now.
    pub fn place(&self, point: RoadPoint) -> FusedCell {
        self.road.at(self.now).place(point)
    }
}

impl Estimator for Fused {
    fn name(&self) -> &str {
        FUSED
    }

    fn reset(&mut self) {
        (0..self.members.len()).for_each(|k| self.road.forget(k));
        self.members.iter_mut().for_each(|m| m.estimator.reset());
    }

    fn step(&mut self, frame: &Frame) {
        self.now = time(frame.time_ns);
        let judged = self.steps.is_multiple_of(self.every);
        self.steps += 1;
        for (k, member) in self.members.iter_mut().enumerate() {
            while let Some(own) = member.frames.get(member.taken).filter(|own| own.time_ns <= frame.time_ns) {
                member.estimator.step(own);
                member.taken += 1;
            }
            let newest = member.taken.checked_sub(1).and_then(|k| member.frames.get(k));
            if let (true, Some(own)) = (judged, newest) {
                // one that is late is not taken, and counted
                let _ = self.road.offer(k, time(own.time_ns), self.now, member.estimator.map());
            }
        }
    }

    fn map(&self) -> &dyn VisibilityMap {
        self
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let taken = (0..self.members.len()).filter_map(|k| self.road.taken(k));
        let late: u64 = taken.map(|t| u64::from(t.late)).sum();
        [("late maps", late)].into_iter().filter(|(_, n)| *n > 0).collect()
    }
}

impl VisibilityMap for Fused {
    fn at(&self, point: RoadPoint) -> CellState {
        self.road.at(self.now).at(point)
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        self.road.at(self.now).cells_in(area, visit);
    }
}
