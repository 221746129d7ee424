//! What labels say of a mount: where labelled vehicles lie, and where detections of their distance and speed do.
//!
//! # Method
//! The distance and the radial velocity of a labelled vehicle do not depend on how the sensor is turned. So a detection that
//! has both of them is most likely the vehicle's, and the difference of the two azimuths is by how much the yaw is wrong.
//! Pairs are formed by chance, too: what most agree on counts. In the same way places are compared of detections that
//! have a vehicle's azimuth and speed, for a mount of which the position is wrong.

use super::problems::MOUNT;
use super::truth::Object;
use super::{Frame, Recording};
use crate::geometry::pose::{SensorPose, Spherical};

/// What is slower tells no direction, m/s along the line of sight.
const LEAST_SPEED_MPS: f64 = 3.0;
/// A detection of a vehicle has its radial velocity within this, m/s.
const SPEED_MPS: f64 = 1.0;
/// Pairs that have to agree.
const LEAST_PAIRS: usize = 100;
/// Farther off is named: a reflection may lie at either end of a vehicle.
const YAW_DEG: f64 = 3.0;
const PLACE_M: f64 = 6.0;
/// Of two peaks that are apart the higher has to be so many times as high.
const STANDS_OUT: usize = 2;
/// A vehicle within this distance in which hardly one has a detection is looked at, metres.
const NEAR_M: f64 = 100.0;
/// Labelled vehicles in view, and the share of them that has to have a detection at its place.
const LEAST_VEHICLES: usize = 200;
const LEAST_SHARE: f64 = 0.1;

/// A labelled vehicle as the sensor would measure it where the mount is right.
struct Expected {
    object: Object,
    place: Spherical,
    /// m/s, + receding; `None` of one that has a single label.
    radial_mps: Option<f64>,
}

/// A detection that may be a vehicle's: how much farther left than the vehicle it lies, degrees, and the sum of both
/// azimuths, which is none where left and right are exchanged.
struct Turned {
    expected_deg: f64,
    difference_deg: f64,
    sum_deg: f64,
}

/// Adds what labels deny of a mount to the recording's problems; whether there is something. `frames` are some of its own.
pub fn check(recording: &mut Recording, frames: &[Frame], start_ns: i64) -> bool {
    let Some(what) = contradiction(recording, frames) else { return false };
    recording.problems.add(MOUNT, what, start_ns);
    true
}

fn contradiction(recording: &Recording, frames: &[Frame]) -> Option<String> {
    let truth = recording.truth.as_ref()?;
    let frames: Vec<(&Frame, Vec<Expected>)> = frames
        .iter()
        .map(|frame| {
            let expected = |object: Object| Expected::new(object, &recording.pose);
            (frame, truth.at(frame.time_ns).into_iter().map(expected).collect())
        })
        .collect();
    let follows = !recording.sensor.frames_independent && !recording.sensor.platform_moving;
    let said = follows.then(|| turned(&frames, &recording.pose).or_else(|| moved(&frames, &recording.pose)));
    said.flatten().or_else(|| apart(&frames, recording))
}

impl Expected {
    fn new(object: Object, pose: &SensorPose) -> Self {
        let [x, y, z] = object.solid.center;
        let place = pose.to_spherical([x, y, z]);
        let (to_x, to_y) = (x - pose.position[0], y - pose.position[1]);
        let radial_mps = object.velocity.map(|[vx, vy]| (vx * to_x + vy * to_y) / place.range_m.max(1.0));
        Self { object, place, radial_mps }
    }

    /// How far from the middle in range a reflection may lie, metres.
    fn reach_m(&self) -> f64 {
        self.object.solid.size[0] / 2.0 + 1.0
    }

    /// Whether it moves along the line of sight as fast as this.
    fn moves_as(&self, radial_mps: f32) -> bool {
        self.radial_mps.is_some_and(|v| v.abs() >= LEAST_SPEED_MPS && (v - f64::from(radial_mps)).abs() <= SPEED_MPS)
    }
}

/// An angle in degrees, -180 to 180.
fn wrapped(rad: f64) -> f64 {
    (rad.to_degrees() + 180.0).rem_euclid(360.0) - 180.0
}

fn pairs(frames: &[(&Frame, Vec<Expected>)]) -> Vec<Turned> {
    let mut pairs = Vec::new();
    for (frame, expected) in frames {
        for e in expected.iter().filter(|e| e.place.range_m >= 10.0) {
            let its = frame.detections.iter().filter(|d| {
                (f64::from(d.range_m) - e.place.range_m).abs() <= e.reach_m() && e.moves_as(d.radial_velocity_mps)
            });
            pairs.extend(its.map(|d| Turned {
                expected_deg: e.place.azimuth_rad.to_degrees(),
                difference_deg: wrapped(f64::from(d.azimuth_rad) - e.place.azimuth_rad),
                sum_deg: wrapped(f64::from(d.azimuth_rad) + e.place.azimuth_rad),
            }));
        }
    }
    pairs
}

/// A yaw that is wrong, or left and right exchanged.
fn turned(frames: &[(&Frame, Vec<Expected>)], pose: &SensorPose) -> Option<String> {
    let pairs = pairs(frames);
    // straight ahead left and right are the same
    let beside = || pairs.iter().filter(|p| (4.0..90.0).contains(&p.expected_deg.abs()));
    let near = |of: fn(&Turned) -> f64| beside().filter(|p| of(p).abs() <= 1.5).count();
    let (same, exchanged) = (near(|p| p.difference_deg), near(|p| p.sum_deg));
    if exchanged >= LEAST_PAIRS && exchanged > 3 * same {
        return Some(format!(
            "left and right are exchanged, of labels or of detections: {exchanged} labelled vehicles have a detection of their distance and speed on the other side, {same} where they are; azimuth is + to the left, as y"
        ));
    }
    let within = |middle: f64, half: f64| {
        pairs.iter().map(|p| p.difference_deg).filter(move |d| wrapped((d - middle).to_radians()).abs() <= half)
    };
    let mut histogram = vec![0_usize; 360];
    for pair in &pairs {
        if let Some(bin) = histogram.get_mut((pair.difference_deg + 180.0).floor() as usize) {
            *bin += 1;
        }
    }
    // three bins together
    let count = |k: usize| [359, 0, 1].iter().map(|off| histogram[(k + off) % 360]).sum::<usize>();
    let most = (0..360).max_by_key(|k| count(*k))?;
    let peak = most as f64 - 179.5;
    let apart = |k: &usize| k.abs_diff(most).min(360 - k.abs_diff(most)) > 6;
    let elsewhere = (0..360).filter(apart).map(count).max()?;
    if count(most) < LEAST_PAIRS || count(most) < STANDS_OUT * elsewhere {
        return None;
    }
    let mut near: Vec<f64> = within(peak, 3.0).map(|d| peak + wrapped((d - peak).to_radians())).collect();
    near.sort_by(f64::total_cmp);
    let off = *near.get(near.len() / 2)?;
    if off.abs() < YAW_DEG {
        return None;
    }
    // in tenths, and none of them -0
    let tenths = |deg: f64| (10.0 * deg).round() / 10.0 + 0.0;
    let right = tenths(wrapped(pose.yaw_rad() - off.to_radians()));
    let [x, y, z] = pose.position;
    let (given, word) = (pose.yaw_rad().to_degrees(), if off > 0.0 { "large" } else { "small" });
    Some(format!(
        "labelled vehicles do not lie where detections of their distance and speed do, of which {} agree: yaw {given:.1} degrees seems {:.1} too {word}; try --mount={x},{y},{z},{right:.1},{:.1},{:.1}",
        near.len(),
        off.abs(),
        tenths(pose.pitch_rad().to_degrees()),
        tenths(pose.roll_rad().to_degrees())
    ))
}

/// A position that is wrong.
fn moved(frames: &[(&Frame, Vec<Expected>)], pose: &SensorPose) -> Option<String> {
    const BIN_M: f64 = 2.0;
    // farther, and vehicles that follow one another at one distance look like one that is elsewhere
    const BINS: i32 = 16;
    let side = (2 * BINS + 1) as usize;
    let mut histogram = vec![0_usize; side * side];
    let at = |x: i32, y: i32| {
        let inside = x.abs() <= BINS && y.abs() <= BINS;
        inside.then(|| (x + BINS) as usize * side + (y + BINS) as usize)
    };
    for (frame, expected) in frames {
        for e in expected {
            let solid = &e.object.solid;
            for d in frame.detections.iter().filter(|d| e.moves_as(d.radial_velocity_mps)) {
                let place = d.road_position(pose, solid.center[2]);
                // to its middle, but for what of the vehicle lies between
                let (sin, cos) = solid.yaw_rad.sin_cos();
                let (dx, dy) = (place[0] - solid.center[0], place[1] - solid.center[1]);
                let shortened = |v: f64, half: f64| v.signum() * (v.abs() - half).max(0.0);
                let along = shortened(dx * cos + dy * sin, solid.size[0] / 2.0);
                let across = shortened(dy * cos - dx * sin, solid.size[1] / 2.0);
                let bin = [along * cos - across * sin, along * sin + across * cos].map(|v| (v / BIN_M).round() as i32);
                if let Some(k) = at(bin[0], bin[1]) {
                    histogram[k] += 1;
                }
            }
        }
    }
    let count = |x: i32, y: i32| {
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (x + i, y + j)));
        around.filter_map(|(x, y)| at(x, y)).map(|k| histogram[k]).sum::<usize>()
    };
    let places = || (-BINS..=BINS).flat_map(|x| (-BINS..=BINS).map(move |y| (x, y)));
    let most = places().max_by_key(|(x, y)| count(*x, *y))?;
    let apart = |(x, y): &(i32, i32)| (x - most.0).abs().max((y - most.1).abs()) > 3;
    let elsewhere = places().filter(apart).map(|(x, y)| count(x, y)).max()?;
    let agree = count(most.0, most.1);
    let [dx, dy] = [most.0, most.1].map(|bin| f64::from(bin) * BIN_M);
    if agree < LEAST_PAIRS || agree < STANDS_OUT * elsewhere || dx.hypot(dy) < PLACE_M {
        return None;
    }
    let [x, y, _] = pose.position;
    Some(format!(
        "labelled vehicles do not lie where detections of their speed do, of which {agree} agree: these lie {dx:+.0} m along x and {dy:+.0} m along y; the mount's place {x:.1},{y:.1} m is wrong (try {:.1},{:.1} with --mount), or the labels' origin or clock",
        x - dx,
        y - dy
    ))
}

/// Labels and detections that have nothing to do with each other, whatever the reason.
fn apart(frames: &[(&Frame, Vec<Expected>)], recording: &Recording) -> Option<String> {
    let (mut in_view, mut found) = (0, 0);
    for (frame, expected) in frames {
        for e in expected.iter().filter(|e| e.place.range_m <= NEAR_M) {
            if !recording.sensor.field_of_view.contains(e.place) {
                continue;
            }
            in_view += 1;
            let wide = (e.reach_m() / e.place.range_m).atan();
            found += usize::from(frame.detections.iter().any(|d| {
                (f64::from(d.range_m) - e.place.range_m).abs() <= e.reach_m()
                    && (f64::from(d.azimuth_rad) - e.place.azimuth_rad).abs() <= wide
            }));
        }
    }
    (in_view >= LEAST_VEHICLES && (found as f64) < LEAST_SHARE * in_view as f64).then(|| {
        format!(
            "of {in_view} labelled vehicles in view within {NEAR_M} m {found} have a detection at their place: the mount is wrong, or place or clock of the labels"
        )
    })
}
