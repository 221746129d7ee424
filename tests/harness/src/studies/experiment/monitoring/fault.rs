//! What goes wrong with a sensor while it runs.

use crate::geometry::pose::SensorPose;
use crate::recording::Recording;

/// Parts of the view that go dark one after another.
pub const THIRDS: usize = 3;
/// How far mounts are turned and tilted, degrees.
pub const TURN_DEG: f64 = 1.0;
/// Attenuation there and back when dirt is thickest, dB.
pub const DIRT_DB: f64 = 10.0;

/// A fault, from a moment on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    None,
    /// A third of the view sees nothing, counted from right to left.
    Dark(usize),
    /// The mount turns by [`TURN_DEG`], to the left where positive.
    Turned(f64),
    /// It tilts by as much, upwards where positive.
    Tilted(f64),
    /// Dirt grows to [`DIRT_DB`] in half of what is left of the recording.
    Dirt,
}

impl Fault {
    /// Every fault.
    pub fn all() -> Vec<Self> {
        let sides = [1.0, -1.0];
        let dark = (0..THIRDS).map(Self::Dark);
        dark.chain(sides.map(Self::Turned)).chain(sides.map(Self::Tilted)).chain([Self::Dirt]).collect()
    }

    /// The recording with the fault from a time on; of a camera's, the frames before it are with it, too, where the mount
    /// moves.
    pub fn of(self, own: &Recording, from_ns: i64) -> Recording {
        let mut faulty = own.clone();
        match self {
            Self::None => {}
            Self::Dark(third) => darken(&mut faulty, third, from_ns),
            Self::Turned(side) | Self::Tilted(side) if own.of_camera().is_some() => {
                let to_left = if matches!(self, Self::Turned(_)) { side * TURN_DEG } else { 0.0 };
                let up = if matches!(self, Self::Tilted(_)) { side * TURN_DEG } else { 0.0 };
                faulty = misplaced(own, to_left, up);
            }
            // what is straight ahead of the world lies to the right of a sensor that looks to the left
            Self::Turned(side) => {
                each(&mut faulty, from_ns, |d| d.azimuth_rad -= (side * TURN_DEG).to_radians() as f32);
            }
            Self::Tilted(side) => each(&mut faulty, from_ns, |d| {
                d.elevation_rad = d.elevation_rad.map(|v| v - (side * TURN_DEG).to_radians() as f32);
            }),
            Self::Dirt => soil(&mut faulty, from_ns),
        }
        faulty
    }
}

fn each(recording: &mut Recording, from_ns: i64, change: impl FnMut(&mut crate::recording::RadarDetection)) {
    let later = recording.frames.iter_mut().filter(|f| f.time_ns >= from_ns);
    later.flat_map(|f| &mut f.detections).for_each(change);
}

/// The recording of a sensor that hangs so many degrees to the left, and up, of what its configuration says.
pub fn misplaced(recording: &Recording, left_deg: f64, up_deg: f64) -> Recording {
    let mut turned = recording.clone();
    let to = |pose: &SensorPose| {
        let (yaw, pitch) = (pose.yaw_rad() - left_deg.to_radians(), pose.pitch_rad() + up_deg.to_radians());
        SensorPose::new(pose.position, yaw, pitch, pose.roll_rad())
    };
    turned.pose = to(&recording.pose);
    if let Some(camera) = &mut turned.camera {
        camera.pose = to(&camera.pose);
    }
    turned
}

fn darken(dark: &mut Recording, third: usize, from_ns: i64) {
    let is_dark = |share: f64| (share * THIRDS as f64).floor() as i64 == third as i64;
    let [right, left] = dark.sensor.field_of_view.azimuth_rad;
    for frame in dark.frames.iter_mut().filter(|f| f.time_ns >= from_ns) {
        frame.detections.retain(|d| !is_dark((f64::from(d.azimuth_rad) - right) / (left - right)));
    }
    if let Some(camera) = &mut dark.camera {
        let width = f64::from(camera.intrinsics.size_px[0]);
        for frame in camera.frames.iter_mut().filter(|f| f.time_ns >= from_ns) {
            // columns of the image run from left to right
            frame.boxes.retain(|b| !is_dark(1.0 - (b.edges[0] + b.edges[2]) / 2.0 / width));
        }
    }
}

/// Attenuation at a time.
pub fn dirt_db(at_ns: i64, from_ns: i64, end_ns: i64) -> f64 {
    let share = 2.0 * (at_ns - from_ns) as f64 / (end_ns - from_ns).max(1) as f64;
    DIRT_DB * share.clamp(0.0, 1.0)
}

/// What falls below the weakest that was detected before is lost.
fn soil(own: &mut Recording, from_ns: i64) {
    let end_ns = own.frames.last().map_or(from_ns, |f| f.time_ns);
    let weakest = own.frames.iter().flat_map(|f| &f.detections).filter_map(|d| d.snr_db).fold(f32::INFINITY, f32::min);
    for frame in own.frames.iter_mut().filter(|f| f.time_ns >= from_ns) {
        let loss = dirt_db(frame.time_ns, from_ns, end_ns) as f32;
        for d in &mut frame.detections {
            d.snr_db = d.snr_db.map(|v| v - loss);
            d.rcs_dbsm = d.rcs_dbsm.map(|v| v - loss);
        }
        frame.detections.retain(|d| d.snr_db.is_none_or(|v| v >= weakest));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::recording;
    use crate::recording::RadarDetection;

    /// Ten frames of 0.1 s with what lies 15 degrees to the left, at the horizon.
    fn own() -> Recording {
        let mut own = recording(10, 1);
        let detection = RadarDetection {
            range_m: 30.0,
            azimuth_rad: 15_f32.to_radians(),
            elevation_rad: Some(0.0),
            radial_velocity_mps: 0.0,
            rcs_dbsm: Some(10.0),
            snr_db: Some(20.0),
        };
        own.frames.iter_mut().for_each(|f| f.detections = vec![detection; 3]);
        own
    }

    #[test]
    fn a_third_is_counted_from_right_to_left_and_goes_dark_at_its_time() {
        let own = own();
        let at = own.frames[5].time_ns;
        let left = |third: usize| Fault::Dark(third).of(&own, at).frames.iter().map(|f| f.detections.len()).collect();
        let whole: Vec<usize> = vec![3; own.frames.len()];
        let counts: [Vec<usize>; 3] = [0, 1, 2].map(left);
        let [right, left] = own.sensor.field_of_view.azimuth_rad.map(f64::to_degrees);
        let hit = ((15.0 - right) / (left - right) * 3.0) as usize;
        for (third, counts) in counts.iter().enumerate() {
            assert_eq!(counts[..5], whole[..5], "not yet");
            assert_eq!(counts[5], if third == hit { 0 } else { 3 }, "third {third}, hit {hit}");
        }
    }

    #[test]
    fn a_sensor_that_turns_left_sees_things_farther_right_and_one_that_tilts_up_sees_them_lower() {
        let own = own();
        let at = own.frames[5].time_ns;
        let first = |fault: Fault, k: usize| fault.of(&own, at).frames[k].detections[0];
        assert_eq!(first(Fault::Turned(1.0), 4), own.frames[4].detections[0]);
        assert!((first(Fault::Turned(1.0), 5).azimuth_rad.to_degrees() - 14.0).abs() < 1e-3);
        assert!((first(Fault::Turned(-1.0), 5).azimuth_rad.to_degrees() - 16.0).abs() < 1e-3);
        assert!((first(Fault::Tilted(1.0), 5).elevation_rad.unwrap().to_degrees() + 1.0).abs() < 1e-3);
        // the configuration of what hangs so from the first day says the opposite
        let day = misplaced(&own, 1.0, 0.0);
        assert!((day.pose.yaw_rad() - own.pose.yaw_rad() + 1_f64.to_radians()).abs() < 1e-9);
        assert!((misplaced(&own, 0.0, 1.0).pose.pitch_rad() - own.pose.pitch_rad() - 1_f64.to_radians()).abs() < 1e-9);
    }

    #[test]
    fn dirt_is_thickest_halfway_and_takes_what_is_too_weak() {
        let mut own = own();
        own.frames[0].detections[0].snr_db = Some(12.0);
        let end = own.frames[9].time_ns;
        assert_eq!([0, end / 4, end / 2, end].map(|t| dirt_db(t, 0, end)), [0.0, 5.0, 10.0, 10.0]);
        let dirty = Fault::Dirt.of(&own, own.frames[1].time_ns);
        assert_eq!(dirty.frames[0], own.frames[0]);
        assert!(dirty.frames[2].detections[0].rcs_dbsm < Some(10.0) && dirty.frames[2].detections.len() == 3);
        assert_eq!(dirty.frames[9].detections.len(), 0, "10 dB less than 20 is below 12");
    }
}
