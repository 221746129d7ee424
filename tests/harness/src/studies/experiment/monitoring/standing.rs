//! What usually stands where a radar looks: a third of its view that goes dark, a mount that is turned, and dirt,
//! without any traffic that another sensor would see.
//!
//! A radar learns for [`LEARNED_S`] seconds from the beginning of its recording. Then, each in a run of its own:
//! nothing happens; a third of its view goes dark; it is turned by a degree to either side; dirt grows, [`DIRT_DB`] in
//! half of what is left of the recording, and what falls below the weakest that was detected before is lost.

use anyhow::Result;
use rayon::prelude::*;
use serde::Serialize;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::fusion::{Fixtures, FixturesConfig};

use super::{SECTORS, THIRDS, darkened};
use crate::estimators::{self, camera_3d::time};
use crate::evaluation::Settings;
use crate::recording::Recording;

const LEARNED_S: u16 = 40;
/// Attenuation there and back, dB.
const DIRT_DB: f64 = 10.0;
const TURN_DEG: f64 = 1.0;
/// What a radar has room for.
const FIXTURES: usize = 64;

type Standing = Fixtures<FIXTURES, SECTORS>;

/// What standing things said of radars.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Stood {
    pub radars: u64,
    /// What they learned to stand.
    pub fixtures: u64,
    /// Sectors that went dark with two fixtures or more in them, and how many of them were named, and within 10 s;
    /// seconds, summed.
    pub dark: u64,
    pub dark_named: u64,
    pub within_10_s: u64,
    pub dark_after_s: f64,
    /// Mounts turned, and named with the right side; seconds, summed.
    pub turned: u64,
    pub turned_named: u64,
    pub turned_after_s: f64,
    /// Radars with dirt, and named; dB there were by then, summed.
    pub dirty: u64,
    pub dirty_named: u64,
    pub dirty_at_db: f64,
    /// In order: whatever was named, and the seconds they were watched for.
    pub wrong: u64,
    pub watched_s: f64,
}

impl std::ops::AddAssign for Stood {
    fn add_assign(&mut self, o: Self) {
        self.radars += o.radars;
        self.fixtures += o.fixtures;
        self.dark += o.dark;
        self.dark_named += o.dark_named;
        self.within_10_s += o.within_10_s;
        self.dark_after_s += o.dark_after_s;
        self.turned += o.turned;
        self.turned_named += o.turned_named;
        self.turned_after_s += o.turned_after_s;
        self.dirty += o.dirty;
        self.dirty_named += o.dirty_named;
        self.dirty_at_db += o.dirty_at_db;
        self.wrong += o.wrong;
        self.watched_s += o.watched_s;
    }
}

#[derive(Debug, Clone, Copy)]
enum Case {
    InOrder,
    Dark(usize),
    Turned(f64),
    Dirt,
}

/// Watches the radars of a site; `broken`: otherwise in order only.
///
/// # Errors
/// Parameters of estimators that cannot be.
pub fn stand(all: &[Recording], settings: &Settings, broken: bool) -> Result<Stood> {
    let mut cases = vec![Case::InOrder];
    if broken {
        cases.extend((0..THIRDS).map(Case::Dark));
        cases.extend([Case::Turned(1.0), Case::Turned(-1.0), Case::Dirt]);
    }
    let radars = all.iter().filter(|r| r.of_camera().is_none());
    let runs: Vec<(&Recording, Case)> = radars.flat_map(|r| cases.iter().map(move |case| (r, *case))).collect();
    let mut sum = Stood::default();
    for one in runs.par_iter().map(|(r, case)| one(r, *case, settings)).collect::<Result<Vec<_>>>()? {
        sum += one;
    }
    Ok(sum)
}

fn one(own: &Recording, case: Case, settings: &Settings) -> Result<Stood> {
    let start = own.frames.first().map_or(0, |f| f.time_ns);
    // a window more than it takes
    let from_s = f64::from(LEARNED_S) + 2.0;
    let (from_ns, end_ns) = (start + (from_s * 1e9) as i64, own.frames.last().map_or(start, |f| f.time_ns));
    let recording = match case {
        Case::InOrder => own.clone(),
        Case::Dark(third) => darkened(own, third, from_ns),
        Case::Turned(side) => {
            let mut turned = own.clone();
            let later = turned.frames.iter_mut().filter(|f| f.time_ns >= from_ns);
            // what is straight ahead of the world lies to the right of a sensor that looks to the left
            let by = (-side * TURN_DEG).to_radians() as f32;
            later.flat_map(|f| &mut f.detections).for_each(|d| d.azimuth_rad += by);
            turned
        }
        Case::Dirt => dirty(own, from_ns, end_ns),
    };
    let view = own.sensor.field_of_view.azimuth_rad.map(|v| v.to_degrees() as f32);
    let config = FixturesConfig { learned_windows: LEARNED_S, ..FixturesConfig::default() };
    let mut standing = Standing::new(&estimators::mount(&own.pose), view, &config)?;
    let mut running = estimators::own(&recording, &settings.estimators)?;
    let mut counts = Stood { radars: u64::from(matches!(case, Case::InOrder)), ..Stood::default() };
    let mut before = [false; SECTORS + 4];
    let mut first = [None::<f64>; SECTORS + 4];
    let mut expected = [false; SECTORS];
    for frame in &recording.frames {
        running.step(frame);
        let now: Time = time(frame.time_ns);
        let detections = frame.detections.iter().filter_map(|d| Detection::new(&estimators::measurement(d)).ok());
        detections.for_each(|d| standing.observe(&d));
        let map = running.map();
        standing.advance(now, |at| map.at(at).visible());
        let since = (frame.time_ns - from_ns) as f64 * 1e-9;
        if since < 0.0 {
            continue;
        }
        (0..SECTORS).for_each(|k| expected[k] |= standing.expects(k));
        let levels = [
            standing.turned().is_some_and(|a| a.raw() > 0),
            standing.turned().is_some_and(|a| a.raw() < 0),
            standing.weaker_half_db().is_some() || standing.fewer().is_some(),
            standing.tilted().is_some(),
        ];
        let named = (0..SECTORS).map(|k| standing.is_blind(k)).chain(levels);
        for (k, named) in named.enumerate() {
            if named && !before[k] {
                first[k].get_or_insert(since);
                counts.wrong += u64::from(matches!(case, Case::InOrder));
            }
            before[k] = named;
        }
    }
    match case {
        Case::InOrder => {
            counts.fixtures = standing.learned().unwrap_or(0) as u64;
            counts.watched_s = ((end_ns - from_ns) as f64 * 1e-9).max(0.0);
        }
        Case::Dark(third) => {
            for sector in (0..SECTORS).filter(|k| k * THIRDS / SECTORS == third && expected[*k]) {
                counts.dark += 1;
                if let Some(after) = first[sector] {
                    counts.dark_named += 1;
                    counts.within_10_s += u64::from(after <= 10.0);
                    counts.dark_after_s += after;
                }
            }
        }
        Case::Turned(side) => {
            counts.turned = u64::from(standing.learned().is_some_and(|n| n > 0));
            if let Some(after) = first[SECTORS + usize::from(side < 0.0)] {
                (counts.turned_named, counts.turned_after_s) = (1, after);
            }
        }
        Case::Dirt => {
            counts.dirty = u64::from(standing.learned().is_some_and(|n| n > 0));
            if let Some(after) = first[SECTORS + 2] {
                (counts.dirty_named, counts.dirty_at_db) =
                    (1, dirt_db(from_ns + (after * 1e9) as i64, from_ns, end_ns));
            }
        }
    }
    Ok(counts)
}

/// Attenuation at a time.
fn dirt_db(at_ns: i64, from_ns: i64, end_ns: i64) -> f64 {
    let share = 2.0 * (at_ns - from_ns) as f64 / (end_ns - from_ns).max(1) as f64;
    DIRT_DB * share.clamp(0.0, 1.0)
}

fn dirty(own: &Recording, from_ns: i64, end_ns: i64) -> Recording {
    let mut dirty = own.clone();
    let weakest = own.frames.iter().flat_map(|f| &f.detections).filter_map(|d| d.snr_db).fold(f32::INFINITY, f32::min);
    for frame in dirty.frames.iter_mut().filter(|f| f.time_ns >= from_ns) {
        let loss = dirt_db(frame.time_ns, from_ns, end_ns) as f32;
        for d in &mut frame.detections {
            d.snr_db = d.snr_db.map(|v| v - loss);
            d.rcs_dbsm = d.rcs_dbsm.map(|v| v - loss);
        }
        frame.detections.retain(|d| d.snr_db.is_none_or(|v| v >= weakest));
    }
    dirty
}
