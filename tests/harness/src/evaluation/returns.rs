//! Detections per object against range: what tells one radar, real or simulated, from another.
//!
//! Counted are objects with a line of sight to some part of their box, so that what is hidden does not count
//! against the sensor, in two groups: cars and vans, trucks and buses.

use std::collections::BTreeMap;

use serde::Serialize;

use super::samples::FrameSamples;
use crate::recording::Recording;

/// Width of a range band, metres.
pub const BAND_M: f64 = 12.5;
/// Fewest objects a band is reported with.
const FEWEST: usize = 10;

/// Vehicles that are compared with each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Group {
    Light,
    Heavy,
}

impl Group {
    pub const ALL: [Self; 2] = [Self::Light, Self::Heavy];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Light => "cars and vans",
            Self::Heavy => "trucks and buses",
        }
    }

    fn of(class: &str) -> Option<Self> {
        match class {
            "car" | "van" => Some(Self::Light),
            "truck" | "bus" => Some(Self::Heavy),
            _ => None,
        }
    }
}

/// Detections per object within one band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Ground distance from the sensor, metres.
    pub from_m: f64,
    pub to_m: f64,
    /// Object-time-steps.
    pub objects: usize,
    pub quartile: f64,
    pub median: f64,
    pub upper_quartile: f64,
    /// Share without any detection.
    pub none: f64,
}

/// What one recording gives.
#[derive(Debug, Clone, Serialize)]
pub struct Returns {
    pub recording: String,
    /// All detections of a frame, on average, whatever they belong to.
    pub detections_a_frame: f64,
    pub bands: BTreeMap<Group, Vec<Band>>,
}

impl Returns {
    pub fn new(recording: &Recording, samples: &[FrameSamples]) -> Self {
        let mut counts: BTreeMap<(Group, u32), Vec<u32>> = BTreeMap::new();
        let tracks = recording.truth.as_ref().map_or(&[][..], |t| &t.tracks);
        for sample in samples.iter().flat_map(|f| &f.objects).filter(|s| s.box_in_sight) {
            if let Some(group) = tracks.get(sample.track).and_then(|t| Group::of(&t.class)) {
                counts.entry((group, (sample.distance_m / BAND_M) as u32)).or_default().push(sample.detections);
            }
        }
        let mut bands: BTreeMap<Group, Vec<Band>> = BTreeMap::new();
        for ((group, k), mut counts) in counts {
            if counts.len() >= FEWEST {
                counts.sort_unstable();
                bands.entry(group).or_default().push(band(k, &counts));
            }
        }
        let detections: usize = recording.frames.iter().map(|f| f.detections.len()).sum();
        Self {
            recording: recording.name.clone(),
            detections_a_frame: detections as f64 / recording.frames.len().max(1) as f64,
            bands,
        }
    }

    /// Median of a stretch, its bands weighted by their objects.
    pub fn median(&self, group: Group, [from_m, to_m]: [f64; 2]) -> Option<f64> {
        let bands = self.bands.get(&group).into_iter().flatten().filter(|b| b.from_m >= from_m && b.to_m <= to_m);
        let (sum, objects) = bands.fold((0.0, 0), |(s, n), b| (s + b.median * b.objects as f64, n + b.objects));
        (objects > 0).then(|| sum / objects as f64)
    }
}

/// `sorted` is not empty.
fn band(k: u32, sorted: &[u32]) -> Band {
    let at = |share: f64| {
        let place = share * (sorted.len() - 1) as f64;
        let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
        f64::from(low) + place.fract() * (f64::from(high) - f64::from(low))
    };
    Band {
        from_m: f64::from(k) * BAND_M,
        to_m: f64::from(k + 1) * BAND_M,
        objects: sorted.len(),
        quartile: at(0.25),
        median: at(0.5),
        upper_quartile: at(0.75),
        none: sorted.partition_point(|n| *n == 0) as f64 / sorted.len() as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::{frames, recording, sample};
    use super::*;

    #[test]
    fn quartiles_lie_between_values_and_the_hidden_are_not_counted() {
        let of = |track: usize, detections: u32, in_sight: bool| {
            let mut s = sample(track, 30.0, detections > 0, in_sight);
            s.detections = detections;
            s.box_in_sight = in_sight;
            s
        };
        // 12 cars with 0 to 11 detections, and one hidden with many
        let mut objects: Vec<_> = (0..12).map(|k| of(k, k as u32, true)).collect();
        objects.push(of(12, 500, false));
        let samples = frames([objects]);
        let returns = Returns::new(&recording(1, 13), &samples);
        let band = returns.bands[&Group::Light][0];
        assert_eq!((band.from_m, band.to_m, band.objects), (25.0, 37.5, 12));
        assert_eq!((band.quartile, band.median, band.upper_quartile), (2.75, 5.5, 8.25));
        assert_eq!((band.none, returns.median(Group::Light, [25.0, 50.0])), (1.0 / 12.0, Some(5.5)));
        assert_eq!(returns.median(Group::Heavy, [25.0, 50.0]), None);
    }
}
