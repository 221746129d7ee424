//! What visibility is worth to whoever watches sensors: the same monitor with the watched sensor's map, and without it.
//!
//! Each sensor of a site is watched by the others, in order and with a third of its view gone dark. With its own map a
//! miss counts only where that says visible; without, wherever the sensor looks. [`turned`] turns mounts, [`standing`]
//! asks what usually stands where a radar looks.

pub mod standing;
pub mod turned;

use anyhow::Result;
use rayon::prelude::*;
use serde::Serialize;
use viewshed::fusion::{Monitor, MonitorConfig, Observed};
use viewshed::map::{CellState, Visibility};
use viewshed::sensor::road::RoadPoint;

use crate::estimators::{
    self,
    camera_3d::{lifted, time},
};
use crate::evaluation::Settings;
use crate::evaluation::sensor_set::newest;
use crate::geometry::solid::Solid;
use crate::recording::{Frame, Recording};

const SECTORS: usize = 6;
/// Parts of the view that go dark one after another.
const THIRDS: usize = 3;
/// After the warm-up a sensor is in order for so long, seconds.
const IN_ORDER_S: f64 = 20.0;
/// A sensor detects what another one follows if it detects something in its outline or so near to it, metres: ends that
/// neither has seen are guessed.
const SAME_M: f64 = 3.0;

/// What a monitor said of a sensor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Alerts {
    /// Sectors that went dark, were not judged blind before, and in which another sensor followed within 10 s what both
    /// had seen before, and how many of them were named at all; how long that took, seconds, summed.
    pub dark: u64,
    pub named: u64,
    pub named_after_s: f64,
    pub slowest_s: f64,
    /// Of them within 10 s.
    pub within_10_s: u64,
    /// Sensors in order: alerts, and the seconds they were watched for.
    pub wrong: u64,
    pub watched_s: f64,
}

impl std::ops::AddAssign for Alerts {
    fn add_assign(&mut self, o: Self) {
        self.dark += o.dark;
        self.named += o.named;
        self.named_after_s += o.named_after_s;
        self.slowest_s = self.slowest_s.max(o.slowest_s);
        self.within_10_s += o.within_10_s;
        self.wrong += o.wrong;
        self.watched_s += o.watched_s;
    }
}

/// With visibility, and without.
pub type Worth = [Alerts; 2];

/// What a sensor follows at each of its frames: a radar's confirmed obstacles, a camera's vehicles.
pub type Follows = Vec<Vec<Solid>>;

/// Runs a sensor's estimator.
///
/// # Errors
/// Parameters of estimators that cannot be.
pub fn follow(recording: &Recording, settings: &Settings) -> Result<Follows> {
    if let Some(camera) = recording.of_camera() {
        return camera.frames.iter().map(|frame| lifted(camera, frame, &settings.estimators.camera_3d)).collect();
    }
    let mut running = estimators::own(recording, &settings.estimators)?;
    let obstacles = recording.frames.iter().map(|frame| {
        running.step(frame);
        running.obstacles()
    });
    Ok(obstacles.collect())
}

/// Watches every sensor of a site by the others; `broken` with thirds of them gone dark, too.
///
/// # Errors
/// Parameters of estimators or monitors that cannot be.
pub fn watch(all: &[Recording], follows: &[Follows], settings: &Settings, broken: bool) -> Result<Worth> {
    let thirds = if broken { THIRDS } else { 0 };
    let cases: Vec<(usize, Option<usize>)> =
        (0..all.len()).flat_map(|k| [(k, None)].into_iter().chain((0..thirds).map(move |t| (k, Some(t))))).collect();
    let worth = cases.par_iter().map(|&(k, third)| one(all, k, follows, third, settings));
    let mut sum = Worth::default();
    for one in worth.collect::<Result<Vec<_>>>()? {
        sum.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
    }
    Ok(sum)
}

/// One sensor, watched by the others.
fn one(
    all: &[Recording],
    watched: usize,
    follows: &[Follows],
    dark: Option<usize>,
    settings: &Settings,
) -> Result<Worth> {
    let own = &all[watched];
    let start = own.frames.first().map_or(0, |f| f.time_ns);
    let since_s = |frame: &Frame| (frame.time_ns - start) as f64 * 1e-9;
    let from_s = settings.evaluation.warm_up_s + IN_ORDER_S;
    let broken = dark.map(|third| darkened(own, third, start + (from_s * 1e9) as i64));
    let recording = broken.as_ref().unwrap_or(own);
    let view = own.sensor.field_of_view.azimuth_rad.map(f64::to_degrees);
    let new =
        || Monitor::<SECTORS>::new(&estimators::mount(&own.pose), view.map(|v| v as f32), &MonitorConfig::default());
    // a monitor for each that watches: an obstacle that two of them follow would be two
    let mut watching = Vec::new();
    for other in (0..all.len()).filter(|other| *other != watched) {
        watching.push((other, [new()?, new()?]));
    }
    let mut worth = Worth::default();
    let mut blind = [[false; SECTORS]; 2];
    let mut named = [[None::<f64>; SECTORS]; 2];
    let mut passed = [false; SECTORS];
    // before it went dark: that is no finding
    let mut blind_before = [[false; SECTORS]; 2];
    let mut running = estimators::own(recording, &settings.estimators)?;
    for (k, frame) in recording.frames.iter().enumerate() {
        running.step(frame);
        let (since, now) = (since_s(frame), time(frame.time_ns));
        let seen = places(recording, k, settings)?;
        let map = running.map();
        for (other, monitors) in &mut watching {
            let Some(theirs) = newest(&all[*other], frame.time_ns) else { continue };
            for solid in follows[*other].get(theirs).into_iter().flatten() {
                let [x, y, _] = solid.center;
                let place = own.pose.to_spherical([x, y, settings.evaluation.slice_height_m]);
                if !own.sensor.field_of_view.contains(place) {
                    continue;
                }
                let detected = seen.iter().any(|p| solid.footprint_distance(*p) <= SAME_M);
                let at = RoadPoint::from_metres(x as f32, y as f32)?;
                let anywhere = CellState { visibility: Visibility::Visible, grade: 255, occupancy: 0, occupied: false };
                let [with, without] = monitors;
                with.observe(now, at, map.at(at), detected);
                let observed = without.observe(now, at, anywhere, detected);
                if let (true, Some(sector)) = ((from_s..from_s + 10.0).contains(&since), without.sector(at)) {
                    passed[sector] |= observed == Observed::Miss;
                }
            }
            monitors.iter_mut().for_each(|monitor| monitor.advance(now));
        }
        for w in 0..2 {
            for sector in 0..SECTORS {
                let now = watching.iter().any(|(_, monitors)| monitors[w].is_blind(sector));
                let before = std::mem::replace(&mut blind[w][sector], now);
                let alert = now && !before;
                // it learns what is usual meanwhile
                if since < settings.evaluation.warm_up_s {
                    continue;
                }
                if dark.is_none() {
                    worth[w].wrong += u64::from(alert);
                } else if since < from_s {
                    blind_before[w][sector] = now;
                } else if alert {
                    named[w][sector].get_or_insert(since - from_s);
                }
            }
        }
    }
    // the same sectors for both, or their shares would be of different things
    let counts = |sector: usize| passed[sector] && !blind_before.iter().any(|before| before[sector]);
    for (alerts, named) in worth.iter_mut().zip(named) {
        let Some(third) = dark else {
            alerts.watched_s = recording.frames.last().map_or(0.0, since_s) - settings.evaluation.warm_up_s;
            continue;
        };
        for sector in (0..SECTORS).filter(|sector| sector * THIRDS / SECTORS == third && counts(*sector)) {
            alerts.dark += 1;
            if let Some(after) = named[sector] {
                alerts.named += 1;
                alerts.named_after_s += after;
                alerts.slowest_s = alerts.slowest_s.max(after);
                alerts.within_10_s += u64::from(after <= 10.0);
            }
        }
    }
    Ok(worth)
}

/// The recording with a third of its view dark from a time on.
fn darkened(own: &Recording, third: usize, from_ns: i64) -> Recording {
    let mut dark = own.clone();
    let is_dark = |share: f64| (share * THIRDS as f64).floor() as i64 == third as i64;
    let [right, left] = own.sensor.field_of_view.azimuth_rad;
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
    dark
}

/// Where a sensor detects something on the road.
fn places(recording: &Recording, frame: usize, settings: &Settings) -> Result<Vec<[f64; 2]>> {
    if let Some(camera) = recording.of_camera() {
        let Some(boxes) = camera.frames.get(frame) else { return Ok(Vec::new()) };
        let solids = lifted(camera, boxes, &settings.estimators.camera_3d)?;
        return Ok(solids.iter().map(|s| [s.center[0], s.center[1]]).collect());
    }
    let height = settings.evaluation.slice_height_m;
    let all = recording.frames.get(frame).map_or(&[][..], |f| &f.detections);
    Ok(all.iter().map(|d| d.road_position(&recording.pose, height)).map(|[x, y, _]| [x, y]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::by_hand::recording;
    use crate::geometry::pose::SensorPose;
    use crate::recording::RadarDetection;

    /// A vehicle that comes nearer, 25 m ahead of a sensor at the origin and 35 m of one 60 m away that looks back, 15
    /// degrees to the left of the first.
    fn site() -> [Recording; 2] {
        let mut both = [recording(1200, 1), recording(1200, 1)];
        both[1].pose = SensorPose::new([60.0, 0.0, 6.0], std::f64::consts::PI, 0.0, 0.0);
        for recording in &mut both {
            let s = recording.pose.to_spherical([25.0, 6.7, 1.0]);
            let detection = RadarDetection {
                range_m: s.range_m as f32,
                azimuth_rad: s.azimuth_rad as f32,
                elevation_rad: Some(s.elevation_rad as f32),
                radial_velocity_mps: -8.0,
                rcs_dbsm: Some(10.0),
                snr_db: Some(20.0),
            };
            recording.frames.iter_mut().for_each(|f| f.detections = vec![detection; 3]);
        }
        both
    }

    #[test]
    fn a_third_that_goes_dark_is_named_and_sensors_in_order_are_not() {
        let mut settings = Settings::default();
        settings.evaluation.warm_up_s = 10.0;
        let site = site();
        // both follow one vehicle that stands and still moves towards them
        let solid = Solid { center: [25.0, 6.7, 0.8], yaw_rad: 0.0, size: [4.0, 2.0, 1.6] };
        let follows = [0, 1].map(|k| vec![vec![solid]; site[k].frames.len()]);
        let [with, without] = watch(&site, &follows, &settings, true).unwrap();
        // one sector of each sensor has the vehicle in it; nobody sees anything in the others
        for alerts in [with, without] {
            assert_eq!((alerts.dark, alerts.wrong), (2, 0), "{alerts:?}");
            assert!((alerts.watched_s - 2.0 * 109.9).abs() < 0.2, "{alerts:?}");
        }
        assert_eq!((without.named, without.within_10_s), (2, 2), "{without:?}");
        assert!(without.slowest_s > 2.0 && without.slowest_s < 9.0, "{without:?}");
        assert_eq!(watch(&site, &follows, &settings, false).unwrap()[1].dark, 0, "in order only");
    }

    #[test]
    fn a_third_is_counted_from_right_to_left() {
        let [own, _] = site();
        let left = darkened(&own, 2, 0);
        assert_eq!(left.frames[5].detections.len(), 3);
        assert_eq!(darkened(&own, 1, 0).frames[5].detections.len(), 0);
        assert_eq!(darkened(&own, 0, 0).frames[5].detections.len(), 3);
        assert_eq!(darkened(&own, 1, 1_000_000_000).frames[5].detections.len(), 3, "not yet");
    }
}
