//! Which detections the estimators may use; every rejection is counted by its reason.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::frame::detection::Detection;
use crate::frame::repeats::{Comparing, Point};
use crate::sensor::config::{ConfigError, above, within};
use crate::sensor::field_of_view::Limits;

/// Limits on single detections.
///
/// # Units
/// dB, dBsm, m/s, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct GateConfig {
    /// Weakest signal-to-noise ratio; detections without one pass.
    pub min_snr_db: f32,
    /// Smallest radar cross-section; detections without one pass.
    pub min_rcs_dbsm: f32,
    /// Radial speeds above this are implausible.
    pub max_speed_mps: f32,
    /// Radial speeds below this are dropped; 0 keeps queues and traffic passing broadside.
    pub min_speed_mps: f32,
    /// Noise allowed for beyond the field of view's elevation limits. An angle, never metres: a
    /// third of true detections at 150 m compute below the road.
    pub elevation_margin_deg: f32,
    /// Detections of a frame that are used at most (which: `frame/thinning.rs`); the storage may hold fewer.
    pub max_detections: u16,
}

impl Default for GateConfig {
    fn default() -> Self {
        Self {
            min_snr_db: 5.0,
            min_rcs_dbsm: -40.0,
            max_speed_mps: 70.0,
            min_speed_mps: 0.0,
            elevation_margin_deg: 3.0,
            max_detections: 256,
        }
    }
}

/// Why a detection was rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Rejection {
    /// Outside the field of view's range.
    Range,
    /// Outside the field of view's azimuth.
    Azimuth,
    /// Outside the field of view's elevation by more than the noise margin.
    Elevation,
    /// Signal-to-noise ratio too low.
    Quality,
    /// Radar cross-section too small.
    Rcs,
    /// Radial velocity implausible, or too slow where only movers are wanted.
    Velocity,
    /// The list was full of others of a greater priority, or of the same and earlier.
    Overflow,
    /// No detection at all: not finite, at no distance, or absurd. Dropped by whoever decoded it.
    Refused,
    /// Left out by the sensor's own marks, wherever it lies.
    Unwanted,
}

impl Rejection {
    /// Every reason, in the order of `Rejections::counts`.
    pub const ALL: [Self; 9] = [
        Self::Range,
        Self::Azimuth,
        Self::Elevation,
        Self::Quality,
        Self::Rcs,
        Self::Velocity,
        Self::Overflow,
        Self::Refused,
        Self::Unwanted,
    ];

    /// Whether a point lies outside the field of view.
    pub const fn is_outside(self) -> bool {
        matches!(self, Self::Range | Self::Azimuth | Self::Elevation)
    }

    /// Short name for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Range => "range",
            Self::Azimuth => "azimuth",
            Self::Elevation => "elevation",
            Self::Quality => "quality",
            Self::Rcs => "rcs",
            Self::Velocity => "velocity",
            Self::Overflow => "overflow",
            Self::Refused => "no detection",
            Self::Unwanted => "unwanted",
        }
    }
}

/// How many detections were rejected, by reason; saturating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rejections {
    counts: [u32; Rejection::ALL.len()],
}

impl Rejections {
    /// Nothing rejected.
    pub const NONE: Self = Self { counts: [0; Rejection::ALL.len()] };

    /// Counts one.
    pub fn add(&mut self, reason: Rejection) {
        self.add_many(reason, 1);
    }

    /// Counts so many.
    pub fn add_many(&mut self, reason: Rejection, count: u32) {
        if let Some(n) = self.counts.get_mut(reason as usize) {
            *n = n.saturating_add(count);
        }
    }

    /// Adds another count.
    pub fn add_all(&mut self, other: &Self) {
        for (n, m) in self.counts.iter_mut().zip(other.counts) {
            *n = n.saturating_add(m);
        }
    }

    /// Count of one reason.
    pub fn count(&self, reason: Rejection) -> u32 {
        self.counts.get(reason as usize).copied().unwrap_or(0)
    }

    /// Of these, points outside the field of view.
    pub fn outside(&self) -> u32 {
        let outside = Rejection::ALL.into_iter().filter(|reason| reason.is_outside());
        outside.fold(0, |sum: u32, reason| sum.saturating_add(self.count(reason)))
    }

    /// Sum over all reasons.
    pub fn total(&self) -> u32 {
        self.counts.iter().fold(0, |sum: u32, n| sum.saturating_add(*n))
    }
}

/// The gate in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gate {
    range_cm: [i32; 2],
    azimuth: [Angle; 2],
    elevation: [Angle; 2],
    min_snr_half_db: i16,
    min_rcs_half_dbsm: i16,
    max_speed_cm_s: i32,
    min_speed_cm_s: i32,
    /// Detections of a frame that are used at most.
    pub max_detections: usize,
}

impl GateConfig {
    /// Checks the limits and joins them with the field of view.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation)] // limits are checked
    pub fn gate(&self, view: &Limits) -> Result<Gate, ConfigError> {
        let snr = within("gate.min_snr_db", self.min_snr_db, -100.0, 200.0)?;
        let rcs = within("gate.min_rcs_dbsm", self.min_rcs_dbsm, -100.0, 100.0)?;
        let fast = within("gate.max_speed_mps", self.max_speed_mps, 1.0, 327.0)?;
        let slow = within("gate.min_speed_mps", self.min_speed_mps, 0.0, 20.0)?;
        above("gate.max_speed_mps", fast, slow)?;
        within("gate.max_detections", f32::from(self.max_detections), 1.0, 65_535.0)?;
        let margin = within("gate.elevation_margin_deg", self.elevation_margin_deg, 0.0, 90.0)?;
        let wide = |limit: Angle, by: f32| Angle::from_radians((limit.radians() + by.to_radians()).clamp(-1.57, 1.57));
        let [low, high] = view.elevation;
        Ok(Gate {
            range_cm: view.range_cm,
            azimuth: view.azimuth,
            elevation: [wide(low, -margin), wide(high, margin)],
            min_snr_half_db: math::round_i32(snr * 2.0) as i16,
            min_rcs_half_dbsm: math::round_i32(rcs * 2.0) as i16,
            max_speed_cm_s: math::round_i32(fast * 100.0),
            min_speed_cm_s: math::round_i32(slow * 100.0),
            max_detections: usize::from(self.max_detections),
        })
    }
}

impl Gate {
    /// Whether a detection may be used.
    ///
    /// # Errors
    /// The first reason it may not.
    pub fn judge(&self, d: &Detection) -> Result<(), Rejection> {
        if d.marked { Err(Rejection::Unwanted) } else { self.judge_unmarked(d) }
    }

    /// Whether a detection of a frame may be used. Of others the reason is counted, and those that cannot be judged are
    /// compared with those of the frame before.
    pub fn takes(&self, d: &Detection, rejections: &mut Rejections, unjudged: &mut Comparing<'_>) -> bool {
        let Err(reason) = self.judge(d) else { return true };
        rejections.add(reason);
        if let Some(point) = self.cannot_judge(d, reason) {
            unjudged.add(point);
        }
        false
    }

    /// Whether a detection that was rejected for this cannot be told from noise or cannot be right, and was not left out by
    /// choice or because of where it lies: what is there is then not known.
    fn cannot_judge(&self, d: &Detection, reason: Rejection) -> Option<Point> {
        let speed = i32::from(d.radial_velocity_cm_s).abs();
        let is_outside = match reason {
            Rejection::Unwanted => self.judge_unmarked(d).is_err_and(Rejection::is_outside),
            other => other.is_outside(),
        };
        let is_chosen = speed < self.min_speed_cm_s;
        (!is_outside && !is_chosen).then(|| Point::new(d, speed <= self.max_speed_cm_s))
    }

    fn judge_unmarked(&self, d: &Detection) -> Result<(), Rejection> {
        let within = |v: Angle, [low, high]: [Angle; 2]| v >= low && v <= high;
        let range = i32::from(d.range_cm);
        let speed = i32::from(d.radial_velocity_cm_s).abs();
        if range < self.range_cm[0] || range > self.range_cm[1] {
            Err(Rejection::Range)
        } else if !within(d.azimuth, self.azimuth) {
            Err(Rejection::Azimuth)
        } else if d.elevation.is_some_and(|e| !within(e, self.elevation)) {
            Err(Rejection::Elevation)
        } else if d.snr_half_db.is_some_and(|s| s < self.min_snr_half_db) {
            Err(Rejection::Quality)
        } else if d.rcs_half_dbsm.is_some_and(|r| r < self.min_rcs_half_dbsm) {
            Err(Rejection::Rcs)
        } else if speed > self.max_speed_cm_s || speed < self.min_speed_cm_s {
            Err(Rejection::Velocity)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::field_of_view::FieldOfView;

    fn gate(config: GateConfig) -> Gate {
        let view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 45.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 10.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        };
        config.gate(&view.limits().unwrap()).unwrap()
    }

    const D: Detection = Detection {
        range_cm: 10_000,
        azimuth: Angle::ZERO,
        elevation: None,
        radial_velocity_cm_s: -2500,
        rcs_half_dbsm: Some(20),
        snr_half_db: Some(40),
        marked: false,
    };

    #[test]
    fn every_limit_has_its_reason() {
        let g = gate(GateConfig { min_speed_mps: 1.0, ..GateConfig::default() });
        let degrees = Angle::from_degrees;
        let cases = [
            (Detection { range_cm: 299, ..D }, Rejection::Range),
            (Detection { range_cm: 20_001, ..D }, Rejection::Range),
            (Detection { azimuth: degrees(46.0), ..D }, Rejection::Azimuth),
            (Detection { azimuth: degrees(-61.0), ..D }, Rejection::Azimuth),
            (Detection { elevation: Some(degrees(13.5)), ..D }, Rejection::Elevation),
            (Detection { elevation: Some(degrees(-19.5)), ..D }, Rejection::Elevation),
            (Detection { snr_half_db: Some(9), ..D }, Rejection::Quality),
            (Detection { rcs_half_dbsm: Some(-81), ..D }, Rejection::Rcs),
            (Detection { radial_velocity_cm_s: 7001, ..D }, Rejection::Velocity),
            (Detection { radial_velocity_cm_s: -99, ..D }, Rejection::Velocity),
        ];
        for (d, reason) in cases {
            assert_eq!(g.judge(&d), Err(reason), "{d:?}");
        }
        assert_eq!(g.judge(&D), Ok(()));
        assert_eq!(g.judge(&Detection { azimuth: degrees(-59.0), ..D }), Ok(()), "right is negative");
    }

    #[test]
    fn what_cannot_be_judged_is_told_from_what_was_chosen_and_from_what_lies_elsewhere() {
        let g = gate(GateConfig { min_speed_mps: 1.0, ..GateConfig::default() });
        let left_out = |d: &Detection| g.judge(d).err().and_then(|reason| g.cannot_judge(d, reason));
        let weak = Detection { snr_half_db: Some(0), ..D };
        let small = Detection { rcs_half_dbsm: Some(-128), ..D };
        let fast = Detection { radial_velocity_cm_s: 7001, ..D };
        let marked = Detection { marked: true, ..D };
        assert_eq!(g.judge(&marked), Err(Rejection::Unwanted));
        for d in [weak, small, marked] {
            assert_eq!(left_out(&d), Some(Point::new(&d, true)), "{d:?}");
            for chosen in [Detection { radial_velocity_cm_s: 99, ..d }, Detection { range_cm: 20_001, ..d }] {
                assert_eq!(left_out(&chosen), None, "{chosen:?}");
            }
        }
        for d in [fast, Detection { marked: true, ..fast }, Detection { snr_half_db: Some(0), ..fast }] {
            assert_eq!(left_out(&d), Some(Point::new(&d, false)), "{d:?}");
        }
        assert_eq!(left_out(&D), None);
    }

    #[test]
    fn what_is_not_measured_passes_and_standing_still_is_no_reason() {
        let g = gate(GateConfig::default());
        let bare = Detection { snr_half_db: None, rcs_half_dbsm: None, radial_velocity_cm_s: 0, ..D };
        assert_eq!(g.judge(&bare), Ok(()));
    }

    #[test]
    fn the_elevation_margin_is_an_angle() {
        let g = gate(GateConfig::default());
        // at 200 m, 2 degrees below the limit is 7 m below the road: still noise
        let d = Detection { range_cm: 20_000, elevation: Some(Angle::from_degrees(-18.0)), ..D };
        assert_eq!(g.judge(&d), Ok(()));
    }

    #[test]
    fn counts_saturate_and_add_up() {
        let mut a = Rejections::default();
        a.add(Rejection::Rcs);
        let mut b = a;
        b.add_all(&a);
        assert_eq!((b.count(Rejection::Rcs), b.count(Rejection::Range), b.total()), (2, 0, 2));
        for (i, reason) in Rejection::ALL.iter().enumerate() {
            assert_eq!(*reason as usize, i, "ALL is in the order of the counts");
        }
    }
}
