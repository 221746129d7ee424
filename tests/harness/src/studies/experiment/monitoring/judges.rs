//! Who judges a sensor: the other sensors that look there, and what usually stands in its view.

use anyhow::Result;
use viewshed::frame::detection::Detection;
use viewshed::fusion::{Alignment, Fixtures, FixturesConfig, Monitor, MonitorConfig, Observed};
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use super::turned::{PLACES, Pieces, alignment, at, observe};
use super::{Followed, Follows, Judge, Sight};
use crate::estimators::{self, camera_3d::time};
use crate::recording::{Frame, Recording};

pub const SECTORS: usize = 6;
/// How long a radar learns what stands, seconds.
pub const LEARNED_S: u16 = 40;
/// What a monitor without visibility takes the sensor's map for.
const ANYWHERE: CellState = CellState { visibility: Visibility::Visible, grade: 255, occupancy: 0, occupied: false };
/// What a radar has room for.
const FIXTURES: usize = 64;
/// A sensor detects what another one follows if it detects something in its outline or so near to it, metres: ends that
/// neither has seen are guessed.
const SAME_M: f64 = 3.0;

/// What is said of a sensor at a moment, by each judge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Said {
    pub blind: [[bool; SECTORS]; Judge::ALL.len()],
    /// A pair with another sensor disagrees; what stands has moved to the side.
    pub turned: [bool; Judge::ALL.len()],
    /// What stands has moved up or down.
    pub tilted: bool,
    /// Less is seen of what stands, or weaker.
    pub weaker: bool,
}

/// All judges of one sensor.
pub struct Judges<'a> {
    all: &'a [Recording],
    follows: &'a [Follows],
    watched: usize,
    /// One for each other sensor: an obstacle that two of them follow would be two.
    others: Vec<(usize, [Monitor<SECTORS>; 2])>,
    standing: Option<[Fixtures<FIXTURES, SECTORS>; 2]>,
    alignment: Alignment<PLACES>,
    lanes: &'a Pieces,
    slice_m: f64,
    aligned_from_ns: i64,
}

impl<'a> Judges<'a> {
    /// Of one of all sensors; `follows` is what each of them follows in order.
    ///
    /// # Errors
    /// Parameters that cannot be.
    pub fn new(
        all: &'a [Recording],
        follows: &'a [Follows],
        watched: usize,
        lanes: &'a Pieces,
        slice_m: f64,
        aligned_from_ns: i64,
    ) -> Result<Self> {
        let own = &all[watched];
        let view = own.sensor.field_of_view.azimuth_rad.map(|v| v.to_degrees() as f32);
        let mount = estimators::mount(&own.pose);
        let monitor = || Monitor::new(&mount, view, &MonitorConfig::default());
        let mut others = Vec::new();
        for other in (0..all.len()).filter(|other| *other != watched) {
            others.push((other, [monitor()?, monitor()?]));
        }
        let config = FixturesConfig { learned_windows: LEARNED_S, ..FixturesConfig::default() };
        let fixtures = || Fixtures::new(&mount, view, &config);
        let standing = if own.of_camera().is_none() { Some([fixtures()?, fixtures()?]) } else { None };
        let poses: Vec<_> = all.iter().map(|r| r.pose).collect();
        Ok(Self {
            all,
            follows,
            watched,
            others,
            standing,
            alignment: alignment(&poses)?,
            lanes,
            slice_m,
            aligned_from_ns,
        })
    }

    /// Takes a frame of the sensor with its own map, the places where it detects something and what it follows. In
    /// which sectors it misses what others follow and both have seen before.
    ///
    /// # Errors
    /// Places that are none.
    pub fn step(
        &mut self,
        frame: &Frame,
        map: &dyn VisibilityMap,
        seen: &[[f64; 2]],
        follows: &Followed,
    ) -> Result<[bool; SECTORS]> {
        let (own, now) = (&self.all[self.watched], time(frame.time_ns));
        let of = |k: usize| {
            if k == self.watched { Some(follows) } else { at(&self.all[k], &self.follows[k], frame.time_ns) }
        };
        let followed: Vec<_> = (0..self.all.len()).map(of).collect();
        let mut missed = [false; SECTORS];
        for (other, monitors) in &mut self.others {
            let Some(theirs) = followed[*other] else { continue };
            for solid in &theirs.all {
                let [x, y, _] = solid.center;
                let place = own.pose.to_spherical([x, y, self.slice_m]);
                if !own.sensor.field_of_view.contains(place) {
                    continue;
                }
                let detected = seen.iter().any(|p| solid.footprint_distance(*p) <= SAME_M);
                let at = RoadPoint::from_metres(x as f32, y as f32)?;
                let [with, without] = &mut *monitors;
                with.observe(now, at, map.at(at), detected);
                if without.observe(now, at, ANYWHERE, detected) == Observed::Miss {
                    without.sector(at).into_iter().for_each(|k| missed[k] = true);
                }
            }
            monitors.iter_mut().for_each(|monitor| monitor.advance(now));
        }
        if let Some(standing) = &mut self.standing {
            let detections = frame.detections.iter().map(estimators::measurement);
            let detections: Vec<Detection> = detections.filter_map(|m| Detection::new(&m).ok()).collect();
            for (fixtures, sight) in standing.iter_mut().zip(Sight::ALL) {
                detections.iter().for_each(|d| fixtures.observe(d));
                fixtures.advance(now, |at| sight == Sight::Without || map.at(at).visible());
            }
        }
        if frame.time_ns >= self.aligned_from_ns {
            observe(&mut self.alignment, &followed, self.lanes, frame.time_ns)?;
        }
        Ok(missed)
    }

    /// What they say now.
    pub fn said(&self, sight: Sight) -> Said {
        let sight = sight as usize;
        let fixtures = self.standing.as_ref().map(|both| &both[sight]);
        let others = |k: usize| self.others.iter().any(|(_, monitors)| monitors[sight].is_blind(k));
        let of_others = std::array::from_fn(others);
        let of_standing = std::array::from_fn(|k| fixtures.is_some_and(|f| f.is_blind(k)));
        let pair = (0..self.all.len()).any(|k| k != self.watched && self.alignment.disagree(self.watched, k));
        let moved = fixtures.is_some_and(|f| f.turned().is_some());
        Said {
            blind: [of_others, of_standing, std::array::from_fn(|k| of_others[k] || of_standing[k])],
            turned: [pair, moved, pair || moved],
            tilted: fixtures.is_some_and(|f| f.tilted().is_some()),
            weaker: fixtures.is_some_and(|f| f.weaker_half_db().is_some() || f.fewer().is_some()),
        }
    }

    /// Whether enough stands in a sector, and is not in a shadow, for it to be judged.
    pub fn expects(&self, sector: usize) -> bool {
        self.standing.as_ref().is_some_and(|[with, _]| with.expects(sector))
    }

    /// What the sensor learned to stand.
    pub fn fixtures(&self) -> u64 {
        self.standing.as_ref().and_then(|[with, _]| with.learned()).unwrap_or(0) as u64
    }
}
