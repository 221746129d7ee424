//! What comes from outside at certain times: interference and outages.

use serde::{Deserialize, Serialize};

use super::model::Interference;
use crate::twin::random::Dice;

/// Noise that rises for a while: a jammer, a parked radar of the same band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseInterval {
    /// Seconds since the start of the recording.
    pub from_s: f64,
    pub to_s: f64,
    pub noise_rise_db: f64,
}

/// What a frame is during an outage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outage {
    /// Frames come and hold nothing: ice on the radome, a blind front end.
    Empty,
    /// No frames come: a broken link, a restart.
    Missing,
}

/// A sensor that fails for a while.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutageInterval {
    /// Seconds since the start of the recording.
    pub from_s: f64,
    pub to_s: f64,
    pub frames: Outage,
}

/// Rise of the noise in one frame, dB: intervals and a burst that may meet it.
pub fn noise_db(intervals: &[NoiseInterval], bursts: &Interference, time_s: f64, dice: &mut Dice) -> f64 {
    let steady: f64 = intervals.iter().filter(|i| (i.from_s..i.to_s).contains(&time_s)).map(|i| i.noise_rise_db).sum();
    let (met, rise) = (dice.chance(bursts.probability), dice.exponential() * bursts.noise_rise_db);
    steady + if met { rise } else { 0.0 }
}

/// What happens to a frame; `None` for a sound one.
pub fn outage(intervals: &[OutageInterval], time_s: f64) -> Option<Outage> {
    let met: Vec<Outage> =
        intervals.iter().filter(|i| (i.from_s..i.to_s).contains(&time_s)).map(|i| i.frames).collect();
    // of two, the worse
    [Outage::Missing, Outage::Empty].into_iter().find(|o| met.contains(o))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::random::Use;

    #[test]
    fn intervals_add_up_and_bursts_are_as_frequent_as_told() {
        let at = |from_s, to_s, noise_rise_db| NoiseInterval { from_s, to_s, noise_rise_db };
        let intervals = [at(1.0, 3.0, 4.0), at(2.0, 3.0, 2.0)];
        let never = Interference { probability: 0.0, noise_rise_db: 10.0 };
        let mut dice = Dice::new(1, Use::RadarFrame, 1);
        let mut rise = |time_s| noise_db(&intervals, &never, time_s, &mut dice);
        assert_eq!([0.9, 1.0, 2.5, 3.0].map(&mut rise), [0.0, 4.0, 6.0, 0.0]);
        let often = Interference { probability: 0.25, noise_rise_db: 10.0 };
        let met = (0..4000).filter(|_| noise_db(&[], &often, 0.0, &mut dice) > 0.0).count();
        assert!((900..1100).contains(&met), "{met}");
    }

    #[test]
    fn a_missing_frame_is_worse_than_an_empty_one() {
        let at = |from_s, to_s, frames| OutageInterval { from_s, to_s, frames };
        let intervals = [at(1.0, 3.0, Outage::Empty), at(2.0, 4.0, Outage::Missing)];
        assert_eq!(
            [0.0, 1.0, 2.0, 3.5].map(|t| outage(&intervals, t)),
            [None, Some(Outage::Empty), Some(Outage::Missing), Some(Outage::Missing)]
        );
    }
}
