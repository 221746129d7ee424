//! The counts again, by class, distance and occlusion grade.

use std::collections::BTreeMap;

use super::counts::Counts;
use super::samples::{FrameSamples, Sample};
use super::score::Score;
use crate::recording::Recording;

/// Width of a distance band, metres.
pub const BAND_M: f64 = 50.0;

/// One estimator's counts by group.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Breakdown {
    pub class: BTreeMap<String, Counts>,
    /// By number of the band: band k reaches from k x 50 m to (k + 1) x 50 m of ground distance.
    pub distance: BTreeMap<u32, Counts>,
    /// By human occlusion grade, 0 (free) to 2 (mostly hidden); only objects that have one.
    pub occlusion: BTreeMap<u8, Counts>,
}

/// `0-50` for band 0.
pub fn band_name(band: u32) -> String {
    let width = BAND_M as u32;
    format!("{}-{}", band * width, (band + 1) * width)
}

impl Breakdown {
    pub fn new(recording: &Recording, samples: &[FrameSamples], score: &Score) -> Self {
        let mut groups = Self::default();
        let Some(truth) = &recording.truth else { return groups };
        for (frame, verdicts) in samples.iter().zip(&score.verdicts) {
            for (sample, verdict) in frame.objects.iter().zip(verdicts) {
                let mut one = Counts::default();
                one.add(verdict.visible, sample.detected);
                let track = &truth.tracks[sample.track];
                *groups.class.entry(track.class.clone()).or_default() += one;
                *groups.distance.entry((sample.distance_m / BAND_M) as u32).or_default() += one;
                if let Some(grade) = occlusion(recording, sample) {
                    *groups.occlusion.entry(grade).or_default() += one;
                }
            }
        }
        groups
    }
}

/// The human occlusion grade of an object, if it was given one.
pub fn occlusion(recording: &Recording, sample: &Sample) -> Option<u8> {
    let truth = recording.truth.as_ref()?;
    recording.occlusion.get(&truth.tracks.get(sample.track)?.id).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_named_by_their_ends() {
        assert_eq!((band_name(0), band_name(3)), ("0-50".into(), "150-200".into()));
    }
}
