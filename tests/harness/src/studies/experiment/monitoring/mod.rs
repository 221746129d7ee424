//! Who of several sensors is wrong: what others that look there say of each, what usually stands in its view says, and
//! both; and what visibility is worth to them.
//!
//! Every sensor of a site runs in order, and with each [fault] from a moment on. [With its own map](Sight) a miss
//! counts only where that says visible, and a fixture is asked for only there; without it, wherever the sensor looks.
//! [`turned`] is of mounts that are wrong from the first day.

pub mod fault;
mod judges;
pub mod turned;

use anyhow::Result;
use rayon::prelude::*;
use serde::Serialize;

use self::fault::{Fault, THIRDS, dirt_db};
use self::judges::{Judges, LEARNED_S, SECTORS, Said};
use self::turned::Pieces;
use crate::estimators::{self, Estimator, camera_3d::lifted};
use crate::evaluation::Settings;
use crate::geometry::solid::Solid;
use crate::recording::camera::RecordedCamera;
use crate::recording::{Frame, Recording};

/// After the warm-up a sensor is in order for so long at least, seconds.
const IN_ORDER_S: f64 = 20.0;

/// Who says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judge {
    Others,
    Standing,
    Either,
}

impl Judge {
    pub const ALL: [Self; 3] = [Self::Others, Self::Standing, Self::Either];
}

/// Whether the sensor's own map counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sight {
    With,
    Without,
}

impl Sight {
    pub const ALL: [Self; 2] = [Self::With, Self::Without];
}

/// What is said to be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    Blind,
    Turned,
    Tilted,
    Weaker,
}

impl Finding {
    pub const ALL: [Self; 4] = [Self::Blind, Self::Turned, Self::Tilted, Self::Weaker];

    /// Within how many seconds it should be said.
    pub const fn in_time_s(self) -> f64 {
        if matches!(self, Self::Blind) { 10.0 } else { 30.0 }
    }
}

/// What one judge said of one kind of fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Faults; how many were named, and in time; after how many seconds, summed; and the slowest.
    pub cases: u64,
    pub named: u64,
    pub in_time: u64,
    pub after_s: f64,
    pub slowest_s: f64,
    /// Of sensors in order.
    pub wrong: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, o: Self) {
        self.cases += o.cases;
        self.named += o.named;
        self.in_time += o.in_time;
        self.after_s += o.after_s;
        self.slowest_s = self.slowest_s.max(o.slowest_s);
        self.wrong += o.wrong;
    }
}

/// What all judges said.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Judged {
    /// By finding, judge and sight.
    pub tallies: [[[Tally; 2]; 3]; 4],
    /// Thirds gone dark in which something that both had seen was missed within 10 s, enough stands, or either.
    pub could_tell: [u64; 3],
    /// dB of dirt when it was named, summed.
    pub dirt_db: f64,
    /// Fixtures learned, of how many radars.
    pub fixtures: u64,
    pub radars: u64,
    /// How long sensors in order were judged, and of them radars, seconds.
    pub sensors_s: f64,
    pub radars_s: f64,
}

impl Judged {
    pub fn of(&self, finding: Finding, judge: Judge, sight: Sight) -> &Tally {
        &self.tallies[finding as usize][judge as usize][sight as usize]
    }

    fn of_mut(&mut self, finding: Finding, judge: Judge, sight: Sight) -> &mut Tally {
        &mut self.tallies[finding as usize][judge as usize][sight as usize]
    }
}

impl std::ops::AddAssign for Judged {
    fn add_assign(&mut self, o: Self) {
        let tallies = self.tallies.as_flattened_mut().as_flattened_mut();
        tallies.iter_mut().zip(o.tallies.as_flattened().as_flattened()).for_each(|(sum, one)| *sum += *one);
        self.could_tell.iter_mut().zip(o.could_tell).for_each(|(sum, one)| *sum += one);
        self.dirt_db += o.dirt_db;
        self.fixtures += o.fixtures;
        self.radars += o.radars;
        self.sensors_s += o.sensors_s;
        self.radars_s += o.radars_s;
    }
}

/// What a sensor follows at a frame: a radar's confirmed obstacles, a camera's vehicles.
#[derive(Debug, Clone, Default)]
pub struct Followed {
    pub all: Vec<Solid>,
    /// Places whose bearings are compared.
    pub where_seen: Vec<Solid>,
}

impl Followed {
    fn by(running: &dyn Estimator) -> Self {
        Self { all: running.obstacles(), where_seen: running.where_seen() }
    }

    fn lifted(all: Vec<Solid>) -> Self {
        Self { where_seen: all.clone(), all }
    }
}

/// The same at each of its frames.
pub type Follows = Vec<Followed>;

/// Runs a sensor's estimator.
///
/// # Errors
/// Parameters of estimators that cannot be.
pub fn follow(recording: &Recording, settings: &Settings) -> Result<Follows> {
    if let Some(camera) = recording.of_camera() {
        let lifts = |frame| lifted(camera, frame, &settings.estimators.camera_3d).map(Followed::lifted);
        return camera.frames.iter().map(lifts).collect();
    }
    let mut running = estimators::own(recording, &settings.estimators)?;
    let obstacles = recording.frames.iter().map(|frame| {
        running.step(frame);
        Followed::by(running.as_ref())
    });
    Ok(obstacles.collect())
}

/// Judges every sensor of a site; `broken` with every fault, too.
///
/// # Errors
/// Parameters of estimators or monitors that cannot be.
pub fn judge(
    all: &[Recording],
    follows: &[Follows],
    lanes: &Pieces,
    settings: &Settings,
    broken: bool,
) -> Result<Judged> {
    let faults = [Fault::None].into_iter().chain(broken.then(Fault::all).into_iter().flatten());
    let cases: Vec<(usize, Fault)> = faults.flat_map(|fault| (0..all.len()).map(move |k| (k, fault))).collect();
    let site = Site { all, follows, lanes, settings };
    let mut sum = Judged::default();
    for one in cases.par_iter().map(|&(k, fault)| site.case(k, fault)).collect::<Result<Vec<_>>>()? {
        sum += one;
    }
    Ok(sum)
}

struct Site<'a> {
    all: &'a [Recording],
    follows: &'a [Follows],
    lanes: &'a Pieces,
    settings: &'a Settings,
}

/// When something was first named after the fault came.
type First = Option<f64>;

/// Of one sight.
#[derive(Debug, Clone, Copy, Default)]
struct Watched {
    before: Said,
    blind: [[First; SECTORS]; 3],
    turned: [First; 3],
    tilted: First,
    weaker: First,
    wrong: [[u64; 3]; 4],
}

impl Watched {
    /// Takes what is said `since` the fault.
    fn take(&mut self, now: &Said, since: f64) {
        let before = std::mem::replace(&mut self.before, *now);
        let mut each = |finding: Finding, judge: usize, first: &mut First, now: bool, before: bool| {
            if now && !before {
                self.wrong[finding as usize][judge] += 1;
                if since >= 0.0 {
                    first.get_or_insert(since);
                }
            }
        };
        for judge in 0..Judge::ALL.len() {
            for k in 0..SECTORS {
                each(Finding::Blind, judge, &mut self.blind[judge][k], now.blind[judge][k], before.blind[judge][k]);
            }
            each(Finding::Turned, judge, &mut self.turned[judge], now.turned[judge], before.turned[judge]);
        }
        for judge in [Judge::Standing as usize, Judge::Either as usize] {
            each(Finding::Tilted, judge, &mut self.tilted, now.tilted, before.tilted);
            each(Finding::Weaker, judge, &mut self.weaker, now.weaker, before.weaker);
        }
    }
}

impl Site<'_> {
    /// One sensor with one fault, or in order.
    fn case(&self, k: usize, fault: Fault) -> Result<Judged> {
        let Self { all, settings, .. } = *self;
        let own = &all[k];
        let is_radar = own.of_camera().is_none();
        let start = own.frames.first().map_or(0, |f| f.time_ns);
        let end = own.frames.last().map_or(start, |f| f.time_ns);
        let after = |s: f64| start + (s * 1e9) as i64;
        // a window more than learning takes
        let warm_s = settings.evaluation.warm_up_s.max(f64::from(LEARNED_S) + 2.0);
        let from_ns = after(warm_s.max(settings.evaluation.warm_up_s + IN_ORDER_S));
        let broken = (fault != Fault::None).then(|| fault.of(own, from_ns));
        let recording = broken.as_ref().unwrap_or(own);
        let aligned_from = after(settings.evaluation.warm_up_s);
        let slice_m = settings.evaluation.slice_height_m;
        let mut judges = Judges::new(all, self.follows, k, self.lanes, slice_m, aligned_from)?;
        let mut running = estimators::own(recording, &settings.estimators)?;
        let mut watched = [Watched::default(); 2];
        let (mut missed, mut expected) = ([false; SECTORS], [false; SECTORS]);
        for (n, frame) in recording.frames.iter().enumerate() {
            running.step(frame);
            let lifts = recording.of_camera().map(|camera| lifts(camera, n, settings)).transpose()?;
            let seen = lifts.as_ref().map_or_else(|| places(recording, frame, settings), |lifts| middles(lifts));
            // a camera's recording is with the fault from its beginning
            let in_order = broken.is_none() || (!is_radar && frame.time_ns < from_ns);
            let broken_now = || lifts.map_or_else(|| Followed::by(running.as_ref()), Followed::lifted);
            let with_fault = if in_order { Followed::default() } else { broken_now() };
            let follows = if in_order { self.follows[k].get(n).unwrap_or(&with_fault) } else { &with_fault };
            let misses = judges.step(frame, running.map(), &seen, follows)?;
            let since = (frame.time_ns - from_ns) as f64 * 1e-9;
            for (watched, sight) in watched.iter_mut().zip(Sight::ALL) {
                if frame.time_ns < after(warm_s) {
                    // it learns what is usual meanwhile
                    watched.before = judges.said(sight);
                } else {
                    watched.take(&judges.said(sight), since);
                }
            }
            if since >= 0.0 {
                (0..SECTORS).for_each(|s| {
                    missed[s] |= misses[s] && since <= Finding::Blind.in_time_s();
                    expected[s] |= judges.expects(s);
                });
            }
        }
        let mut judged = Judged::default();
        for (watched, sight) in watched.iter().zip(Sight::ALL) {
            for judge in Judge::ALL {
                // only what stands tells of tilts and dirt, and only a radar has that
                let tells = is_radar || judge != Judge::Standing;
                let mut case = |finding: Finding, first: First| {
                    judged.of_mut(finding, judge, sight).add(first, finding);
                };
                let j = judge as usize;
                match fault {
                    Fault::None => {
                        for finding in Finding::ALL {
                            judged.of_mut(finding, judge, sight).wrong = watched.wrong[finding as usize][j];
                        }
                    }
                    Fault::Dark(third) if tells => {
                        let firsts = (0..SECTORS).filter(|s| in_third(*s, third)).filter_map(|s| watched.blind[j][s]);
                        case(Finding::Blind, firsts.min_by(f64::total_cmp));
                    }
                    Fault::Turned(_) if tells => case(Finding::Turned, watched.turned[j]),
                    Fault::Tilted(_) if is_radar && judge != Judge::Others => case(Finding::Tilted, watched.tilted),
                    Fault::Dirt if is_radar && judge != Judge::Others => case(Finding::Weaker, watched.weaker),
                    _ => {}
                }
            }
        }
        let seconds = (end - after(warm_s)).max(0) as f64 * 1e-9;
        match fault {
            Fault::None => {
                judged.sensors_s = seconds;
                if is_radar {
                    (judged.radars, judged.radars_s, judged.fixtures) = (1, seconds, judges.fixtures());
                }
            }
            Fault::Dark(third) => {
                let any = |of: &[bool]| (0..SECTORS).any(|s| in_third(s, third) && of[s]);
                let [others, standing] = [any(&missed), any(&expected)];
                judged.could_tell = [others, standing, others || standing].map(u64::from);
            }
            Fault::Dirt => {
                let named = watched[Sight::With as usize].weaker;
                judged.dirt_db = named.map_or(0.0, |s| dirt_db(from_ns + (s * 1e9) as i64, from_ns, end));
            }
            Fault::Turned(_) | Fault::Tilted(_) => {}
        }
        Ok(judged)
    }
}

impl Tally {
    fn add(&mut self, first: First, finding: Finding) {
        self.cases += 1;
        if let Some(after) = first {
            self.named += 1;
            self.in_time += u64::from(after <= finding.in_time_s());
            self.after_s += after;
            self.slowest_s = self.slowest_s.max(after);
        }
    }
}

fn in_third(sector: usize, third: usize) -> bool {
    sector * THIRDS / SECTORS == third
}

/// A camera's vehicles in one of its pictures.
fn lifts(camera: &RecordedCamera, frame: usize, settings: &Settings) -> Result<Vec<Solid>> {
    let Some(boxes) = camera.frames.get(frame) else { return Ok(Vec::new()) };
    lifted(camera, boxes, &settings.estimators.camera_3d)
}

fn middles(solids: &[Solid]) -> Vec<[f64; 2]> {
    solids.iter().map(|s| [s.center[0], s.center[1]]).collect()
}

/// Where a radar detects something on the road.
fn places(recording: &Recording, frame: &Frame, settings: &Settings) -> Vec<[f64; 2]> {
    let height = settings.evaluation.slice_height_m;
    let all = frame.detections.iter().map(|d| d.road_position(&recording.pose, height));
    all.map(|[x, y, _]| [x, y]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up::recording;
    use crate::geometry::pose::SensorPose;
    use crate::recording::RadarDetection;

    /// A vehicle that comes nearer, 25 m ahead of a sensor at the origin and 35 m of one 60 m away that looks back, 15
    /// degrees to the left of the first; two posts between them and beside it, which it hides from neither.
    fn site() -> [Recording; 2] {
        let mut both = [recording(1200, 1), recording(1200, 1)];
        both[1].pose = SensorPose::new([60.0, 0.0, 6.0], std::f64::consts::PI, 0.0, 0.0);
        for recording in &mut both {
            let detection = |x: f64, y: f64, radial_velocity_mps: f32| {
                let s = recording.pose.to_spherical([x, y, 1.0]);
                RadarDetection {
                    range_m: s.range_m as f32,
                    azimuth_rad: s.azimuth_rad as f32,
                    elevation_rad: Some(s.elevation_rad as f32),
                    radial_velocity_mps,
                    rcs_dbsm: Some(10.0),
                    snr_db: Some(20.0),
                }
            };
            let vehicle = detection(25.0, 6.7, -8.0);
            let all = vec![vehicle, vehicle, vehicle, detection(12.0, 1.2, 0.0), detection(18.0, 1.0, 0.0)];
            recording.frames.iter_mut().for_each(|f| f.detections.clone_from(&all));
            // what is weaker yet is detected, too
            recording.frames[0].detections[0].snr_db = Some(5.0);
        }
        both
    }

    fn judged(broken: bool) -> Judged {
        let mut settings = Settings::default();
        settings.evaluation.warm_up_s = 10.0;
        let site = site();
        // both follow one vehicle that stands and still moves towards them
        let solid = Solid { center: [25.0, 6.7, 0.8], yaw_rad: 0.0, size: [4.0, 2.0, 1.6] };
        let follows = [0, 1].map(|k| vec![Followed::lifted(vec![solid]); site[k].frames.len()]);
        judge(&site, &follows, &Vec::new(), &settings, broken).unwrap()
    }

    #[test]
    fn what_goes_wrong_is_named_by_who_can_tell_and_sensors_in_order_are_not() {
        let judged = judged(true);
        for finding in Finding::ALL {
            for judge in Judge::ALL {
                for sight in Sight::ALL {
                    assert_eq!(judged.of(finding, judge, sight).wrong, 0, "{finding:?} {judge:?} {sight:?}");
                }
            }
        }
        assert!((judged.sensors_s - 2.0 * 77.9).abs() < 0.2 && judged.sensors_s == judged.radars_s, "{judged:?}");
        assert_eq!((judged.radars, judged.fixtures), (2, 4));
        // of three thirds of each sensor one has the vehicle in it, and the posts
        assert_eq!(judged.could_tell, [2, 2, 2], "{judged:?}");
        let of = |finding, judge| judged.of(finding, judge, Sight::Without);
        let others = of(Finding::Blind, Judge::Others);
        assert_eq!((others.cases, others.named, others.in_time), (6, 2, 2), "{others:?}");
        assert!(others.slowest_s > 2.0 && others.slowest_s < 9.0, "{others:?}");
        let either = of(Finding::Blind, Judge::Either);
        assert_eq!((either.cases, either.named), (6, 2));
        assert!(either.after_s <= others.after_s, "the first of both counts");
        for finding in [Finding::Turned, Finding::Tilted] {
            let by = of(finding, Judge::Standing);
            assert_eq!((by.cases, by.named), (4, 4), "{finding:?} {by:?}");
        }
        let dirt = of(Finding::Weaker, Judge::Standing);
        assert_eq!((dirt.cases, of(Finding::Weaker, Judge::Others).cases), (2, 0));
        assert_eq!(dirt.named, 2);
        assert!((6.0..=20.0).contains(&judged.dirt_db), "of both: {}", judged.dirt_db);
    }

    #[test]
    fn in_order_only_asks_for_no_faults() {
        let judged = judged(false);
        assert_eq!(judged.of(Finding::Blind, Judge::Either, Sight::With).cases, 0);
        assert!(judged.sensors_s > 0.0);
    }
}
