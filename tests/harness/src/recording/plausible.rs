//! What a recording says that contradicts itself: a velocity's sign or scale, and a mount, that its own detections deny.
//!
//! # Method
//! A detection that moves is paired with detections of a later frame that have its radial velocity and lie where it
//! would lie by then: `velocity * time` farther away. Pairs are formed by chance, too, so what is asked is what most
//! pairs agree on.
//!
//! - *Sign*: over one frame, pairs with the velocity as it stands against pairs with its opposite.
//! - *Scale*: by [tracks](super::scale) of positions alone.
//! - *Yaw*: over a second, the direction in the road frame from one to the other. Most pairs have that of the road's
//!   axis. A few degrees off it the yaw is wrong by as much. Farther off it may as well be another road's, or one's square
//!   to it: then no angle is advised. Nothing is said of a direction in which labelled vehicles drive, too.
//! - *Height and pitch*: the median height above the road of what moves, over its distance. By a height that is wrong
//!   it is off everywhere, by a pitch that is wrong the more the farther.
//!
//! Only detections that an estimator can use are asked: where they are [no such](super::used), velocities and directions mean
//! nothing. What labels deny of a mount is told [from them](against_labels), and no more of its yaw then.

use std::cell::LazyCell;

use viewshed::sensor::noise::NoiseConfig;

use super::frames::{Frames, step};
use super::pairs::{Directions, LEAST_SPEED_MPS, MOST_FRAMES, Signs, USUAL_HEIGHT_M, axis_deg, folded};
use super::problems::{MOUNT, Problems};
use super::scale::Tracks;
use super::used::Used;
use super::{Frame, RadarDetection, Recording, against_labels, sensor};
use crate::geometry::looks;
use crate::geometry::pose::SensorPose;

/// What is farther off is named: degrees and metres.
const YAW_DEG: f64 = 1.5;
const PITCH_DEG: f64 = 0.8;
const HEIGHT_M: f64 = 0.6;

/// Farther off it may be another road.
const MOST_YAW_DEG: f64 = 6.0;

/// By how much a mount as given is more than what the detections say; `None` where they say nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MountError {
    pub yaw_deg: Option<f64>,
    /// Direction of most traffic from the road's axis where that is too far off to be the yaw's error for sure, -90 to 90.
    pub off_axis_deg: Option<f64>,
    /// Pitch in degrees and height in metres.
    pub pitch_and_height: Option<(f64, f64)>,
}

/// What is asked of the frames of a recording, of so many in all.
pub struct Asked {
    used: Used,
    /// What takes frames that follow one another from a place that stays.
    following: Option<Following>,
    taken: usize,
    step: usize,
    /// Some of the frames, spread over the recording.
    some: Vec<Frame>,
}

struct Following {
    signs: Signs,
    tracks: Tracks,
    directions: Directions,
}

impl Asked {
    /// Nothing of a camera.
    pub fn of(recording: &Recording, frames: usize) -> Option<Self> {
        let follow = !recording.sensor.platform_moving && !recording.sensor.frames_independent;
        let following = || Following {
            signs: Signs::new(frames),
            tracks: Tracks::new(frames),
            directions: Directions::new(frames, &recording.pose),
        };
        let ask = || Self {
            used: Used::of(recording),
            following: follow.then(following),
            taken: 0,
            step: step(frames, MOST_FRAMES),
            some: Vec::new(),
        };
        recording.of_camera().is_none().then(ask)
    }

    /// Takes the next frame.
    pub fn frame(&mut self, frame: &Frame) {
        self.used.frame(frame);
        let used = &self.used;
        let points = LazyCell::new(|| used.points(frame));
        if let Some(Following { signs, tracks, directions }) = &mut self.following {
            signs.frame(&points);
            tracks.frame(frame, &points);
            directions.frame(frame.time_ns, &points);
        }
        if self.taken.is_multiple_of(self.step) {
            self.some.push(points.clone());
        }
        self.taken += 1;
    }

    /// Adds what contradicts itself to the recording's problems.
    pub fn tell(self, recording: &mut Recording, frames: &dyn Frames, start_ns: i64) {
        self.used.tell(recording, frames, start_ns);
        if recording.ground.is_level() {
            for doubt in looks::doubts(&sensor::sensor(recording, &NoiseConfig::default())) {
                recording.problems.add(MOUNT, format!("{doubt}; --mount sets it"), start_ns);
            }
        }
        of_used(recording, self.following, &self.some, start_ns);
    }
}

/// What the detections contradict that an estimator can use; `frames` are some of theirs.
fn of_used(recording: &mut Recording, following: Option<Following>, frames: &[Frame], start: i64) {
    let add = |problems: &mut Problems, what: String| problems.add(MOUNT, what, start);
    let (as_it_stands, reversed) = following.as_ref().map(|f| f.signs.counted()).unwrap_or_default();
    if reversed > 100 && reversed > 2 * as_it_stands {
        let what = format!(
            "velocities have the wrong sign, by how ranges change ({reversed} pairs against {as_it_stands}): + is receding; turn them with --velocity-sign approaching"
        );
        add(&mut recording.problems, what);
        return;
    }
    let directions = following.map(|Following { tracks, directions, .. }| (tracks.end(), directions));
    if let Some((Some(contradiction), _)) = &directions {
        recording.problems.add("velocity", contradiction.told(), start);
        return;
    }
    let denied = against_labels::check(recording, frames, start);
    let Some((_, directions)) = directions else { return };
    let mut error = mount_error(&directions.end(), frames, &recording.pose);
    if denied {
        (error.yaw_deg, error.off_axis_deg) = (None, None);
    }
    if let Some(yaw) = error.yaw_deg.filter(|yaw| yaw.abs() >= YAW_DEG && !is_a_road(*yaw, recording, frames)) {
        add(
            &mut recording.problems,
            told(
                "yaw",
                yaw,
                "degrees",
                recording.pose.yaw_rad().to_degrees(),
                "traffic does not run along the road's axis",
            ),
        );
    }
    if let Some(off) = error.off_axis_deg.filter(|off| off_any(*off) >= YAW_DEG && !is_a_road(*off, recording, frames))
    {
        let what = format!(
            "traffic runs {:.1} degrees off the road's axis and {:.1} off what is square to it: yaw {:.1} degrees is wrong, or the axis is of another road; look at the picture",
            off.abs(),
            90.0 - off.abs(),
            recording.pose.yaw_rad().to_degrees()
        );
        add(&mut recording.problems, what);
    }
    // on a road that is known not to be flat both follow the road
    if let Some((pitch, height)) = error.pitch_and_height.filter(|_| recording.ground.is_level()) {
        if pitch.abs() >= PITCH_DEG {
            add(
                &mut recording.problems,
                told(
                    "pitch",
                    pitch,
                    "degrees",
                    recording.pose.pitch_rad().to_degrees(),
                    "what moves does not stay on the road with distance",
                ),
            );
        }
        // a pitch that is wrong takes the height with it
        if height.abs() >= HEIGHT_M && pitch.abs() < PITCH_DEG {
            add(
                &mut recording.problems,
                told("height", height, "m", recording.pose.position[2], "what moves is not on the road"),
            );
        }
    }
}

/// How far a direction is from the road's axis and from what is square to it, whichever is nearer; degrees.
fn off_any(direction: f64) -> f64 {
    direction.abs().min(90.0 - direction.abs())
}

fn told(what: &str, error: f64, unit: &str, given: f64, why: &str) -> String {
    let word = if error > 0.0 { "large" } else { "small" };
    format!("{why}: {what} {given:.1} {unit} seems {:.1} too {word}; --mount sets it", error.abs())
}

/// By how much the mount is off, by directions of pairs and by where frames have points.
fn mount_error(directions: &[f64], frames: &[Frame], pose: &SensorPose) -> MountError {
    let off = commonest(directions);
    let is_error = |off: &f64| off.abs() <= MOST_YAW_DEG;
    MountError {
        yaw_deg: off.filter(is_error),
        off_axis_deg: off.filter(|off| !is_error(off)),
        pitch_and_height: pitch_and_height(frames, pose),
    }
}

/// The direction that most have, where one stands out from those beside it and from chance; degrees, -90 to 90.
fn commonest(directions: &[f64]) -> Option<f64> {
    // an axis has no front: what is near one end is near the other
    let again = directions.iter().map(|d| if *d < 0.0 { d + 180.0 } else { d - 180.0 });
    let mut sorted: Vec<f64> = directions.iter().copied().chain(again).collect();
    sorted.sort_by(f64::total_cmp);
    let within = |middle: f64, half: f64| {
        let start = sorted.partition_point(|d| *d < middle - half);
        &sorted[start..sorted.partition_point(|d| *d <= middle + half)]
    };
    let steps = (0..360).map(|step| -90.0 + 0.5 * f64::from(step));
    let most = steps.max_by_key(|middle| within(*middle, 1.5).len())?;
    let near = within(most, 2.5);
    // where roads bend no direction stands out
    let stands_out = 100 * within(most, 1.5).len() >= 42 * within(most, 4.0).len();
    let agreed = near.len() >= 300 && 3 * near.len() >= within(most, 15.0).len();
    (stands_out && agreed).then(|| near.iter().sum::<f64>() / near.len() as f64)
}

/// Whether many labelled vehicles drive in this direction: then a road runs there, whatever the axis is of.
fn is_a_road(direction: f64, recording: &Recording, frames: &[Frame]) -> bool {
    let Some(truth) = &recording.truth else { return false };
    let driven: Vec<f64> = frames
        .iter()
        .flat_map(|frame| truth.at(frame.time_ns))
        .filter(|object| object.speed().is_some_and(|speed| speed >= f64::from(LEAST_SPEED_MPS)))
        .filter_map(|object| object.velocity.map(axis_deg))
        .collect();
    let near = |middle: f64| driven.iter().filter(|d| folded(**d - middle).abs() <= 1.5).count();
    let most = (0..180).map(|k| near(f64::from(k) - 90.0)).max().unwrap_or(0);
    most > 0 && 3 * near(direction) >= most
}

fn pitch_and_height(frames: &[Frame], pose: &SensorPose) -> Option<(f64, f64)> {
    const BIN_M: f64 = 10.0;
    let mut heights: Vec<Vec<f64>> = vec![Vec::new(); 16];
    let moves = |d: &&RadarDetection| d.radial_velocity_mps.abs() >= LEAST_SPEED_MPS && d.elevation_rad.is_some();
    for frame in frames {
        for d in frame.detections.iter().filter(moves) {
            let bin = (f64::from(d.range_m) / BIN_M) as usize;
            if let Some(bin) = heights.get_mut(bin) {
                bin.push(d.road_position(pose, USUAL_HEIGHT_M)[2]);
            }
        }
    }
    // a line through the medians of the distances that have enough
    let medians: Vec<(f64, f64)> = heights
        .iter_mut()
        .enumerate()
        .filter(|(_, heights)| heights.len() >= 200)
        .map(|(k, heights)| {
            heights.sort_by(f64::total_cmp);
            ((k as f64 + 0.5) * BIN_M, heights[heights.len() / 2])
        })
        .collect();
    let n = medians.len() as f64;
    let span = medians.last()?.0 - medians.first()?.0;
    if n < 4.0 || span < 40.0 {
        return None;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| medians.iter().map(of).sum::<f64>() / n;
    let (r, z) = (mean(|m| m.0), mean(|m| m.1));
    let slope = medians.iter().map(|m| (m.0 - r) * (m.1 - z)).sum::<f64>()
        / medians.iter().map(|m| (m.0 - r).powi(2)).sum::<f64>();
    Some((-slope.atan().to_degrees(), z - slope * r - USUAL_HEIGHT_M))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;
    use crate::geometry::pose::Spherical;
    use crate::geometry::solid::Solid;
    use crate::recording::truth::{Label, Truth};

    /// Traffic on a road in this direction, seen by a radar of yaw 0 that is said to have `yaw_deg`.
    fn traffic(direction_deg: f64, yaw_deg: f64, labelled: bool) -> Recording {
        let mut recording = made_up::recording(300, 0);
        let (s, c) = direction_deg.to_radians().sin_cos();
        let mut labels = Vec::new();
        for (k, frame) in recording.frames.iter_mut().enumerate() {
            frame.time_ns = k as i64 * 100_000_000;
            for vehicle in 0..12 {
                let (lane, speed) = if vehicle % 2 == 0 { (-8.0, 15.0) } else { (-4.5, -17.0) };
                let along = (37.0 * f64::from(vehicle) + speed * 0.1 * k as f64).rem_euclid(444.0) - 222.0;
                let place = [c * along - s * lane, s * along + c * lane, USUAL_HEIGHT_M];
                let Spherical { range_m, azimuth_rad, elevation_rad } = recording.pose.to_spherical(place);
                if range_m > 200.0 || azimuth_rad.abs() > 1.0 || elevation_rad.abs() > 0.5 {
                    continue;
                }
                let radial = (place[0] * c + place[1] * s) * speed / range_m;
                frame.detections.push(RadarDetection {
                    range_m: range_m as f32,
                    azimuth_rad: azimuth_rad as f32,
                    elevation_rad: Some(elevation_rad as f32),
                    radial_velocity_mps: radial as f32,
                    rcs_dbsm: None,
                    snr_db: None,
                });
                let solid = Solid { center: place, yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
                // a vehicle that begins anew is another
                let lap = (37.0 * f64::from(vehicle) + speed * 0.1 * k as f64).div_euclid(444.0);
                let id = format!("{vehicle} {lap}");
                labels.push(Label { time_ns: frame.time_ns, id, class: "car".into(), solid });
            }
        }
        recording.truth = labelled.then(|| Truth::new(labels));
        recording.pose = SensorPose::new(recording.pose.position, yaw_deg.to_radians(), 0.0, 0.0);
        recording
    }

    fn said(mut recording: Recording) -> String {
        let mut asked = Asked::of(&recording, recording.frames.len()).unwrap();
        recording.frames.iter().for_each(|frame| asked.frame(frame));
        let frames = recording.frames.clone();
        asked.tell(&mut recording, &frames, frames[0].time_ns);
        recording.problems.iter().map(|p| p.what).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_yaw_that_is_little_wrong_is_told_by_how_much() {
        for yaw in [-5.0, -3.0, 3.0, 5.0_f64] {
            let said = said(traffic(0.0, yaw, false));
            let word = if yaw > 0.0 { "large" } else { "small" };
            assert!(said.contains(&format!("yaw {yaw:.1} degrees seems {:.1} too {word}", yaw.abs())), "{said}");
        }
        assert_eq!(said(traffic(0.0, 0.0, false)), "");
    }

    #[test]
    fn a_yaw_that_is_badly_wrong_is_named_and_no_angle_advised_but_by_labels() {
        for yaw in [-84.0, -60.0, -28.0, -14.0, -8.0, 8.0, 10.0, 15.0, 30.0, 45.0, 84.0_f64] {
            let unlabelled = said(traffic(0.0, yaw, false));
            let off = format!("runs {:.1} degrees off the road's axis and {:.1} off", yaw.abs(), 90.0 - yaw.abs());
            assert!(unlabelled.contains(&off) && unlabelled.contains("look at the picture"), "{yaw}: {unlabelled}");
            assert!(!unlabelled.contains("too large") && !unlabelled.contains("too small"), "{yaw}: {unlabelled}");
        }
        for yaw in [-178.0, -120.0, -90.0, -14.0, -4.0, 4.0, 30.0, 90.0, 135.0, 180.0_f64] {
            // labels are in the frame of the road, whatever the mount is said to be
            let said = said(traffic(0.0, yaw, true));
            let word = if yaw > 0.0 { "large" } else { "small" };
            // half a turn is as far either way
            let value =
                if yaw == 180.0 { "seems 180.0 too".into() } else { format!("seems {:.1} too {word}", yaw.abs()) };
            assert!(said.contains(&value) && said.contains(",0.0,0.0,0.0"), "{yaw}: {said}");
            assert_eq!(said.lines().count(), 1, "{yaw}: {said}");
        }
    }

    #[test]
    fn labels_deny_a_place_and_sides_that_are_exchanged() {
        let mut elsewhere = traffic(0.0, 0.0, true);
        let [x, y, z] = elsewhere.pose.position;
        elsewhere.pose = SensorPose::new([x + 24.0, y, z], 0.0, 0.0, 0.0);
        let told = said(elsewhere);
        assert!(told.contains("these lie +24 m along x and +0 m along y"), "{told}");
        let mut exchanged = traffic(0.0, 0.0, true);
        exchanged.frames.iter_mut().flat_map(|f| &mut f.detections).for_each(|d| d.azimuth_rad = -d.azimuth_rad);
        let told = said(exchanged);
        assert!(told.contains("left and right are exchanged"), "{told}");
        let mut late = traffic(0.0, 0.0, true);
        late.frames.iter_mut().flat_map(|f| &mut f.detections).for_each(|d| d.range_m += 30.0);
        late.sensor.frames_independent = true;
        let told = said(late);
        assert!(told.contains("labelled vehicles in view within 100 m 18 have a detection at their place"), "{told}");
    }

    #[test]
    fn of_detections_that_nobody_can_use_nothing_follows() {
        let mut degrees = traffic(0.0, 0.0, false);
        degrees.frames.iter_mut().flat_map(|f| &mut f.detections).for_each(|d| {
            d.azimuth_rad = d.azimuth_rad.to_degrees() + 4.0;
            d.radial_velocity_mps = -d.radial_velocity_mps;
        });
        let told = said(degrees);
        assert!(told.contains("points rejected") && !told.contains("wrong sign"), "{told}");
    }

    #[test]
    fn a_road_that_is_not_the_axis_s_is_no_error_where_labelled_vehicles_drive_along_it() {
        for direction in [-38.0, -10.0, 4.0, 30.0] {
            assert_eq!(said(traffic(direction, 0.0, true)), "", "{direction}");
            assert!(said(traffic(direction, 0.0, false)).contains("the road's axis"), "{direction}");
        }
        assert_eq!(said(traffic(90.0, 0.0, false)), "", "square to the axis");
    }
}
