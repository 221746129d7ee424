//! Detections on the road, and which of them are fixtures: what stands in one place over the recording.

use std::collections::HashMap;

use super::lane::{Lane, nearest};
use crate::geometry::pose::{SensorPose, direction};
use crate::recording::Recording;

/// Height at which a detection without elevation is taken to lie, metres.
const HEIGHT_M: f64 = 1.0;
/// Doppler up to which a reflection may stand, m/s.
pub const STANDS_MPS: f64 = 0.4;
/// Share of all frames in which a cell has standing reflections from which on it holds a fixture.
const FIXTURE_SHARE: f64 = 0.4;

/// How far from a lane's middle vehicles stand, metres.
const ON_LANE_M: f64 = 1.8;

/// One detection in the road frame.
#[derive(Debug, Clone, Copy)]
pub struct Reflection {
    pub place: [f64; 2],
    pub height_m: f64,
    /// Unit vector from the sensor, its part in the plane.
    pub sight: [f64; 2],
    /// Ground distance, metres.
    pub distance_m: f64,
    /// m/s, + receding.
    pub doppler_mps: f64,
    pub fixture: bool,
    /// How far ahead of its vehicle's middle it lies, metres, where that is known.
    pub ahead_m: Option<f64>,
}

impl Reflection {
    /// It as if it lay in the middle of its vehicle, where that is known.
    pub fn of_middle(&self, heading: Option<[f64; 2]>) -> Self {
        let Some((ahead_m, [c, s])) = self.ahead_m.zip(heading) else { return *self };
        Self { place: [self.place[0] - ahead_m * c, self.place[1] - ahead_m * s], ..*self }
    }
}

/// One frame of them.
#[derive(Debug, Clone)]
pub struct Instant {
    /// Seconds since the first frame.
    pub time_s: f64,
    pub reflections: Vec<Reflection>,
}

/// All frames of a recording, those whose time does not go on left out.
pub fn instants(recording: &Recording) -> Vec<Instant> {
    let start_ns = recording.frames.first().map_or(0, |f| f.time_ns);
    let mut all: Vec<Instant> = Vec::new();
    for frame in &recording.frames {
        let time_s = frame.time_ns.saturating_sub(start_ns) as f64 * 1e-9;
        if all.last().is_some_and(|last| time_s <= last.time_s) {
            continue;
        }
        let placed = frame.detections.iter().map(|d| {
            let place = d.road_position(&recording.pose, HEIGHT_M);
            reflection(&recording.pose, place, f64::from(d.radial_velocity_mps))
        });
        all.push(Instant { time_s, reflections: placed.filter(|r| r.doppler_mps.is_finite()).collect() });
    }
    mark_fixtures(&mut all);
    all
}

/// What stands where vehicles drive is no fixture.
pub fn free_lanes(instants: &mut [Instant], lanes: &[Lane]) {
    for r in instants.iter_mut().flat_map(|i| &mut i.reflections).filter(|r| r.fixture) {
        r.fixture = nearest(lanes, r.place, None, ON_LANE_M).is_none();
    }
}

fn reflection(pose: &SensorPose, [x, y, z]: [f64; 3], doppler_mps: f64) -> Reflection {
    let s = pose.to_spherical([x, y, z]);
    let [ux, uy, _] = pose.rotate_to_road(direction(s.azimuth_rad, s.elevation_rad));
    let distance_m = (x - pose.position[0]).hypot(y - pose.position[1]);
    Reflection { place: [x, y], height_m: z, sight: [ux, uy], distance_m, doppler_mps, fixture: false, ahead_m: None }
}

/// Marks standing reflections in cells of 1 m by 1 degree that have some in many frames.
fn mark_fixtures(instants: &mut [Instant]) {
    let cell = |r: &Reflection| (r.distance_m.round() as i32, r.sight[1].atan2(r.sight[0]).to_degrees().round() as i32);
    let stands = |r: &Reflection| r.doppler_mps.abs() <= STANDS_MPS;
    // frames with something, and the last of them, so that a frame counts once
    let mut frames: HashMap<(i32, i32), (u32, usize)> = HashMap::new();
    for (k, instant) in instants.iter().enumerate() {
        for r in instant.reflections.iter().filter(|r| stands(r)) {
            let (count, last) = frames.entry(cell(r)).or_insert((0, usize::MAX));
            if *last != k {
                (*count, *last) = (*count + 1, k);
            }
        }
    }
    let enough = FIXTURE_SHARE * instants.len() as f64;
    for r in instants.iter_mut().flat_map(|i| &mut i.reflections) {
        r.fixture = stands(r) && frames.get(&cell(r)).is_some_and(|(count, _)| f64::from(*count) >= enough);
    }
}

#[cfg(test)]
pub mod tests {
    use super::Reflection;

    /// Of what drives along x that fast, seen from the origin.
    pub fn seen_from_origin([x, y]: [f64; 2], speed: f64) -> Reflection {
        let distance_m = x.hypot(y);
        let sight = [x / distance_m, y / distance_m];
        let doppler_mps = speed * sight[0];
        Reflection { place: [x, y], height_m: 1.0, sight, distance_m, doppler_mps, fixture: false, ahead_m: None }
    }
}
