//! Mounts that are turned against what is configured from the first day on: who disagrees with whom, and who of them is wrong.
//!
//! Each sensor of a site in turn hangs a degree to the left, and a degree to the right, of what its configuration says,
//! and sensors are compared by what they follow. The lanes of the road are a third sensor where they are known.

use anyhow::Result;
use rayon::prelude::*;
use serde::Serialize;
use viewshed::fusion::{Alignment, AlignmentConfig};
use viewshed::sensor::road::RoadPoint;

use super::fault::{TURN_DEG, misplaced};
use super::{Followed, Follows, follow};
use crate::estimators::{self, Lane, camera_3d::time};
use crate::evaluation::Settings;
use crate::evaluation::sensor_set::newest;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::Recording;

/// Up to three sensors, and the road.
pub(super) const PLACES: usize = 4;
const ROAD: usize = PLACES - 1;
/// Two sensors follow the same vehicle if it is nearest to both and no farther away, metres.
const SAME_M: f64 = 4.0;
/// A vehicle keeps to a lane whose middle is no farther away, metres, and that goes its way within 20 degrees.
const LANE_M: f64 = 1.75;
const ALONG: f64 = 0.94;

/// What comparing sensors said.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Turned {
    /// Mounts that were turned; how many were named as a pair with another one, how many within 30 s, and after how
    /// many seconds, summed.
    pub turned: u64,
    pub pairs: u64,
    pub within_30_s: u64,
    pub named_after_s: f64,
    pub slowest_s: f64,
    /// Of those that a third sensor or lanes could tell: who was turned, to the right side; and whoever else was named.
    pub judged: u64,
    pub rightly: u64,
    pub wrongly: u64,
    /// Mounts in order: pairs that disagreed, sensors that were named, and for how long pairs were compared, seconds.
    pub wrong_pairs: u64,
    pub wrong_sensors: u64,
    pub compared_s: f64,
}

impl std::ops::AddAssign for Turned {
    fn add_assign(&mut self, o: Self) {
        self.turned += o.turned;
        self.pairs += o.pairs;
        self.within_30_s += o.within_30_s;
        self.named_after_s += o.named_after_s;
        self.slowest_s = self.slowest_s.max(o.slowest_s);
        self.judged += o.judged;
        self.rightly += o.rightly;
        self.wrongly += o.wrongly;
        self.wrong_pairs += o.wrong_pairs;
        self.wrong_sensors += o.wrong_sensors;
        self.compared_s += o.compared_s;
    }
}

/// A lane's middle, in pieces: from, to.
pub type Pieces = Vec<[[f64; 2]; 2]>;

/// The middles of lanes.
pub fn pieces(lanes: &[Lane]) -> Pieces {
    let metres = |p: [f32; 2]| p.map(f64::from);
    lanes.iter().flat_map(|l| l.points.windows(2).map(|w| [metres(w[0]), metres(w[1])])).collect()
}

/// Turns every sensor of a site in turn; `broken`: otherwise they are compared in order only.
///
/// # Errors
/// Parameters of estimators that cannot be.
pub fn compare(
    all: &[Recording],
    follows: &[Follows],
    lanes: &Pieces,
    settings: &Settings,
    broken: bool,
) -> Result<Turned> {
    let sides = if broken { &[1.0, -1.0][..] } else { &[] };
    let cases: Vec<(usize, f64)> =
        (0..all.len().min(ROAD)).flat_map(|k| sides.iter().map(move |side| (k, *side))).collect();
    let poses: Vec<SensorPose> = all.iter().map(|r| r.pose).collect();
    let follows: Vec<&Follows> = follows.iter().collect();
    let mut sum = one(all, &poses, &follows, lanes, None, settings)?;
    let turned = cases.par_iter().map(|&(k, side)| {
        let recording = misplaced(&all[k], side * TURN_DEG, 0.0);
        let own = follow(&recording, settings)?;
        let (mut poses, mut follows) = (poses.clone(), follows.clone());
        (poses[k], follows[k]) = (recording.pose, &own);
        one(all, &poses, &follows, lanes, Some((k, side)), settings)
    });
    for one in turned.collect::<Result<Vec<_>>>()? {
        sum += one;
    }
    Ok(sum)
}

/// Of sensors by their poses, and the road.
///
/// # Errors
/// Mounts that cannot be.
pub(super) fn alignment(poses: &[SensorPose]) -> Result<Alignment<PLACES>> {
    let mut mounts = [None; PLACES];
    mounts.iter_mut().zip(poses).take(ROAD).for_each(|(to, pose)| *to = Some(estimators::mount(pose)));
    Ok(Alignment::new(&mounts, &AlignmentConfig::default())?)
}

/// What a sensor follows at a time; none without a frame that is new enough.
pub(super) fn at<'f>(recording: &Recording, follows: &'f Follows, time_ns: i64) -> Option<&'f Followed> {
    newest(recording, time_ns).and_then(|k| follows.get(k))
}

/// Compares what all sensors follow at a time, with each other and with the lanes.
///
/// # Errors
/// Places that are none.
pub(super) fn observe(
    alignment: &mut Alignment<PLACES>,
    now: &[Option<&Followed>],
    lanes: &Pieces,
    time_ns: i64,
) -> Result<()> {
    let now: Vec<&[Solid]> = now.iter().take(ROAD).map(|f| f.map_or(&[][..], |f| &f.where_seen)).collect();
    for a in 0..now.len() {
        for b in a + 1..now.len() {
            for (own, theirs) in the_same(now[a], now[b]) {
                alignment.observe(a, point(own)?, b, point(theirs)?);
            }
        }
        for solid in now[a] {
            if let Some(at) = on_lane(solid, lanes) {
                alignment.observe(a, point([solid.center[0], solid.center[1]])?, ROAD, point(at)?);
            }
        }
    }
    alignment.advance(time(time_ns));
    Ok(())
}

/// Compares all sensors from the warm-up on; poses and what is followed may be other than the recordings'.
fn one(
    all: &[Recording],
    poses: &[SensorPose],
    follows: &[&Follows],
    lanes: &Pieces,
    turned: Option<(usize, f64)>,
    settings: &Settings,
) -> Result<Turned> {
    let sensors = all.len().min(ROAD);
    let mut alignment = alignment(poses)?;
    let Some(first) = all.first() else { return Ok(Turned::default()) };
    let start = first.frames.first().map_or(0, |f| f.time_ns);
    let mut pair_named = None;
    let (mut disagreed, mut named) = ([[false; PLACES]; PLACES], [None; PLACES]);
    let mut since = 0.0;
    for frame in &first.frames {
        since = (frame.time_ns - start) as f64 * 1e-9 - settings.evaluation.warm_up_s;
        if since < 0.0 {
            continue;
        }
        let now: Vec<_> = all.iter().zip(follows).map(|(r, follows)| at(r, follows, frame.time_ns)).collect();
        observe(&mut alignment, &now, lanes, frame.time_ns)?;
        for a in 0..sensors {
            for (b, disagreed) in disagreed[a].iter_mut().enumerate().take(sensors).skip(a + 1) {
                let is_one = turned.is_none_or(|(k, _)| k == a || k == b);
                if alignment.disagree(a, b) && is_one {
                    pair_named.get_or_insert(since);
                    *disagreed = true;
                }
            }
            if let Some(by) = alignment.turned(a) {
                named[a].get_or_insert(by.raw() > 0);
            }
        }
    }
    let mut counts = Turned::default();
    let pairs = (sensors * sensors.saturating_sub(1) / 2) as f64;
    match turned {
        None => {
            counts.wrong_pairs = disagreed.iter().flatten().filter(|d| **d).count() as u64;
            counts.wrong_sensors = named.iter().flatten().count() as u64;
            counts.compared_s = pairs * since.max(0.0);
        }
        Some((k, side)) => {
            counts.turned = 1;
            if let Some(after) = pair_named {
                counts.pairs = 1;
                counts.within_30_s = u64::from(after <= 30.0);
                (counts.named_after_s, counts.slowest_s) = (after, after);
            }
            if sensors > 2 || !lanes.is_empty() {
                counts.judged = 1;
                counts.rightly = u64::from(named[k] == Some(side > 0.0));
                let others = (0..sensors).filter(|other| *other != k && named[*other].is_some()).count();
                counts.wrongly = others as u64 + u64::from(named[k] == Some(side < 0.0));
            }
        }
    }
    Ok(counts)
}

fn point([x, y]: [f64; 2]) -> Result<RoadPoint> {
    Ok(RoadPoint::from_metres(x as f32, y as f32)?)
}

/// Middles of what two sensors follow, where each is the nearest to the other.
fn the_same(a: &[Solid], b: &[Solid]) -> Vec<([f64; 2], [f64; 2])> {
    let at = |s: &Solid| [s.center[0], s.center[1]];
    let apart = |a: &Solid, b: &Solid| (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]);
    let nearest = |of: &Solid, among: &[Solid]| {
        let near = among.iter().enumerate().min_by(|x, y| apart(of, x.1).total_cmp(&apart(of, y.1)))?;
        (apart(of, near.1) <= SAME_M).then_some(near.0)
    };
    let pairs = a.iter().enumerate().filter_map(|(i, own)| {
        let j = nearest(own, b)?;
        (nearest(&b[j], a) == Some(i)).then(|| (at(own), at(&b[j])))
    });
    pairs.collect()
}

/// The nearest place on the middle of a lane that goes a vehicle's way.
fn on_lane(solid: &Solid, lanes: &Pieces) -> Option<[f64; 2]> {
    let [x, y, _] = solid.center;
    let (sin, cos) = solid.yaw_rad.sin_cos();
    let places = lanes.iter().filter_map(|[from, to]| {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy);
        let along = ((x - from[0]) * dx + (y - from[1]) * dy) / length;
        if (dx * cos + dy * sin) < ALONG * length || !(0.0..=length).contains(&along) {
            return None;
        }
        let place = [from[0] + along * dx / length, from[1] + along * dy / length];
        let away = (place[0] - x).hypot(place[1] - y);
        (away <= LANE_M).then_some((away, place))
    });
    places.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle(x: f64, y: f64, yaw_deg: f64) -> Solid {
        Solid { center: [x, y, 0.8], yaw_rad: yaw_deg.to_radians(), size: [4.5, 1.8, 1.6] }
    }

    #[test]
    fn a_vehicle_is_compared_with_the_lane_that_goes_its_way() {
        let lanes = vec![[[0.0, 0.0], [100.0, 0.0]], [[100.0, 3.0], [0.0, 3.0]]];
        assert_eq!(on_lane(&vehicle(40.0, 1.4, 2.0), &lanes), Some([40.0, 0.0]));
        assert_eq!(on_lane(&vehicle(40.0, 1.4, 178.0), &lanes), Some([40.0, 3.0]));
        assert_eq!(on_lane(&vehicle(40.0, 1.4, 90.0), &lanes), None, "it crosses");
        assert_eq!(on_lane(&vehicle(40.0, -2.0, 0.0), &lanes), None, "beside the road");
    }

    #[test]
    fn the_same_is_what_is_nearest_to_each_other() {
        let a = [vehicle(0.0, 0.0, 0.0), vehicle(5.0, 0.0, 0.0)];
        let b = [vehicle(3.5, 0.0, 0.0), vehicle(40.0, 0.0, 0.0)];
        assert_eq!(the_same(&a, &b), [([5.0, 0.0], [3.5, 0.0])]);
    }
}
