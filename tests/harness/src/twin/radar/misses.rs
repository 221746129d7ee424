//! Frames in which a radar detects nothing of a vehicle in plain sight.
//!
//! # Model
//! Each vehicle has a chain of two states. At a range it is missed in a stationary share of the frames; what was so a time dt ago
//! tells of now by exp(-dt / `burst_s`). So P(missed | missed before) = share + (1 - share) exp(-dt / `burst_s`), and a radar of 10
//! and one of 20 frames a second miss in bursts of the same length.
//!
//! # References
//! `REAL` is of a stationary 4D radar over six lanes beside a camera, 2026: no point on a moving vehicle in 5 to 10 % of the frames at
//! 30 to 45 m, 11 to 14 % to 75 m and 19 to 25 % to 103 m, P(missed | missed before) 0.57 to 0.76 at some 15 frames a second.
//! Upper bounds, as boxes and points were matched by a calibration of their own.

use std::str::FromStr;

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use crate::twin::random::{Dice, Use, name};
use crate::twin::traffic::Traffic;

/// How often a radar misses.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Misses {
    /// From a range on, metres, the share of the frames; nearest first, none before the first. Empty: never.
    pub share: Vec<[f64; 2]>,
    /// Time over which it is forgotten whether the last frame was missed, seconds.
    pub burst_s: f64,
}

/// As a real radar.
const REAL: [[f64; 2]; 4] = [[0.0, 0.05], [30.0, 0.075], [45.0, 0.12], [75.0, 0.22]];
/// 0.65 = s + (1 - s) exp(-1 / 15 s / burst), where s is 0.12.
const BURST_S: f64 = 0.131;

/// `none`, `real`, or a share at all ranges.
impl FromStr for Misses {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let share = match text {
            "none" => return Ok(Self::default()),
            "real" => REAL.to_vec(),
            _ => match text.parse::<f64>() {
                Ok(share) => vec![[0.0, share]],
                Err(_) => bail!("`{text}` is none of none, real and a share of the frames from 0 to 0.9"),
            },
        };
        let misses = Self { share, burst_s: BURST_S };
        misses.check()?;
        Ok(misses)
    }
}

impl Misses {
    /// # Errors
    /// What is outside its limits, by name.
    pub fn check(&self) -> Result<()> {
        for [range_m, share] in &self.share {
            ensure!((0.0..=0.9).contains(share), "model.misses.share is {share}, it must lie in 0 to 0.9");
            ensure!((0.0..=10_000.0).contains(range_m), "model.misses.share begins at {range_m} m");
        }
        ensure!(self.share.is_sorted_by(|a, b| a[0] < b[0]), "model.misses.share: ranges do not grow");
        ensure!(
            (0.0..=60.0).contains(&self.burst_s),
            "model.misses.burst_s is {}, it must lie in 0 to 60",
            self.burst_s
        );
        Ok(())
    }

    /// Whether nothing is ever missed.
    pub fn is_none(&self) -> bool {
        self.share.is_empty()
    }

    /// Share of the frames in which what is so far away is missed.
    pub fn share_at(&self, range_m: f64) -> f64 {
        self.share.iter().rev().find(|[from_m, _]| range_m >= *from_m).map_or(0.0, |[_, share]| *share)
    }

    /// P(missed now), by what was `dt_s` ago, if that is known.
    fn probability(&self, range_m: f64, before: Option<bool>, dt_s: f64) -> f64 {
        let share = self.share_at(range_m);
        let kept = if self.burst_s > 0.0 { (-dt_s / self.burst_s).exp() } else { 0.0 };
        match before {
            Some(true) => share + (1.0 - share) * kept,
            Some(false) => share * (1.0 - kept),
            None => share,
        }
    }
}

/// Which vehicles of a traffic a radar misses, frame by frame.
#[derive(Debug, Default)]
pub struct Missed(Vec<Vec<usize>>);

impl Missed {
    /// Of a radar at a place of the road, which looks at `frames` times.
    pub fn new(
        misses: &Misses,
        traffic: &Traffic,
        place: [f64; 2],
        seed: u64,
        frames: impl Iterator<Item = f64>,
    ) -> Self {
        if misses.is_none() {
            return Self::default();
        }
        let mut chains: Vec<Option<(Dice, bool, f64)>> = vec![None; traffic.vehicles.len()];
        let frame = |time_s: f64| {
            let mut missed = Vec::new();
            for (k, pose) in traffic.at(time_s) {
                let [x, y, _] = pose.solid.center;
                let range_m = (x - place[0]).hypot(y - place[1]);
                let (mut dice, before) = match chains[k].take() {
                    Some((dice, was_missed, last_s)) => (dice, Some((was_missed, time_s - last_s))),
                    None => (Dice::new(seed, Use::Misses, name(&traffic.vehicles[k].id)), None),
                };
                let p = misses.probability(range_m, before.map(|(was, _)| was), before.map_or(0.0, |(_, dt_s)| dt_s));
                let is_missed = dice.chance(p);
                if is_missed {
                    missed.push(k);
                }
                chains[k] = Some((dice, is_missed, time_s));
            }
            missed
        };
        Self(frames.map(frame).collect())
    }

    /// The vehicles missed in a frame, in order.
    pub fn at(&self, frame: u64) -> &[usize] {
        usize::try_from(frame).ok().and_then(|frame| self.0.get(frame)).map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of the frames missed, and missed after one that was, of a chain at a range and rate.
    fn measured(misses: &Misses, range_m: f64, rate_hz: f64) -> [f64; 2] {
        let mut dice = Dice::new(3, Use::Misses, 1);
        let mut states = Vec::new();
        for _ in 0..200_000 {
            let p = misses.probability(range_m, states.last().copied(), 1.0 / rate_hz);
            states.push(dice.chance(p));
        }
        let share = |of: &mut dyn Iterator<Item = bool>| {
            let (missed, all) = of.fold((0, 0), |(missed, all), is| (missed + i32::from(is), all + 1));
            f64::from(missed) / f64::from(all.max(1))
        };
        let after = states.windows(2).filter(|two| two[0]).map(|two| two[1]).collect::<Vec<_>>();
        [share(&mut states.iter().copied()), share(&mut after.into_iter())]
    }

    #[test]
    fn a_real_radar_misses_more_far_away_in_bursts_of_the_same_length_at_any_rate() {
        let real: Misses = "real".parse().unwrap();
        for (range_m, share) in [(10.0, 0.05), (40.0, 0.075), (60.0, 0.12), (100.0, 0.22)] {
            for rate_hz in [10.0, 20.0] {
                let [all, _] = measured(&real, range_m, rate_hz);
                assert!((all - share).abs() < 0.01, "{range_m} m: {all}");
            }
        }
        let [_, again] = measured(&real, 60.0, 15.0);
        assert!((again - 0.65).abs() < 0.02, "{again}");
        // 1 / (1 - P(missed | missed)) frames, but for the share that chance adds
        let [_, slow] = measured(&real, 60.0, 10.0);
        let [_, fast] = measured(&real, 60.0, 20.0);
        assert!(fast > again && again > slow, "{fast} {again} {slow}");
    }

    #[test]
    fn what_cannot_be_is_named() {
        let error = |text: &str| text.parse::<Misses>().unwrap_err().to_string();
        assert!(error("often").contains("`often` is none of none, real"));
        assert!(error("1.5").contains("model.misses.share is 1.5"));
        assert_eq!("none".parse::<Misses>().unwrap(), Misses::default());
        let twice = Misses { share: vec![[10.0, 0.1], [10.0, 0.2]], burst_s: 0.1 };
        assert!(twice.check().unwrap_err().to_string().contains("do not grow"));
    }
}
