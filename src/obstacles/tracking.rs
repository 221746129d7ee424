//! Parameters of obstacle tracking, checked and in integers.

use super::profile::HIT;
use super::size::{SizeConfig, Sizes};
use crate::config::{ConfigError, above, within};
use crate::math;
use crate::reflection::{Noise, Reflection};
use crate::time::Step;
use crate::trig::Direction;

/// How detections become moving obstacles.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ObstacleConfig {
    /// Slowest radial motion, projected on the road, that starts an obstacle, m/s.
    pub min_speed_mps: f32,
    /// Largest difference between measured and explained radial velocity, m/s.
    pub doppler_gate_mps: f32,
    /// Longest stretch without reflections within one vehicle, metres.
    pub gap_m: f32,
    /// Shortest headway between vehicles, seconds: what is farther apart is two vehicles.
    pub headway_s: f32,
    /// Shortest headway that vehicles keep for long, seconds: what follows closer is coupled.
    pub coupled_headway_s: f32,
    /// Way both must have come for that, metres.
    pub coupled_way_m: f32,
    /// Largest difference in speed of what is coupled, m/s.
    pub coupled_speed_mps: f32,
    /// Shortest gap between vehicles standing in a queue, metres.
    pub standstill_m: f32,
    /// How far beside the outline a detection may lie before noise is allowed for, metres.
    pub lateral_gate_m: f32,
    /// Standard deviations of noise allowed for.
    pub gate_sigmas: f32,
    /// Longest vehicle, metres.
    pub max_length_m: f32,
    /// How long the outline remembers, seconds.
    pub outline_memory_s: f32,
    /// Detections that make an end of the outline.
    pub outline_min_hits: f32,
    /// Share of all detections that makes an end of the outline.
    pub outline_share: f32,
    /// How long the lateral place remembers, seconds.
    pub lateral_memory_s: f32,
    /// Share of a lateral innovation that goes into the lateral speed.
    pub drift_gain: f32,
    /// Detections that confirm an obstacle.
    pub confirm_hits: f32,
    /// Detections' worth of evidence an obstacle can hold.
    pub max_evidence: f32,
    /// Loss of evidence while unconfirmed and unseen, detections per second.
    pub tentative_loss_per_s: f32,
    /// Loss of evidence while unseen in plain view, detections per second.
    pub visible_loss_per_s: f32,
    /// Loss of evidence while unseen in a shadow, detections per second.
    pub hidden_loss_per_s: f32,
    #[doc(hidden)]
    pub x: [f32; 16],
    /// Widths and heights by length.
    pub sizes: SizeConfig,
}

impl Default for ObstacleConfig {
    fn default() -> Self {
        Self {
            min_speed_mps: 1.5,
            doppler_gate_mps: 1.2,
            gap_m: 7.0,
            headway_s: 0.4,
            coupled_headway_s: 0.6,
            coupled_way_m: 12.0,
            coupled_speed_mps: 0.5,
            standstill_m: 1.0,
            lateral_gate_m: 1.0,
            gate_sigmas: 2.0,
            max_length_m: 19.0,
            outline_memory_s: 2.0,
            outline_min_hits: 2.5,
            outline_share: 0.06,
            lateral_memory_s: 1.0,
            drift_gain: 0.01,
            confirm_hits: 3.0,
            max_evidence: 12.0,
            tentative_loss_per_s: 10.0,
            visible_loss_per_s: 9.0,
            hidden_loss_per_s: 2.0,
            x: [3.0, 2.0, 3.0, 0.7, 9.0, 2.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            sizes: SizeConfig::default(),
        }
    }
}

/// [`ObstacleConfig`] in integers; lengths in centimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the fields are the configuration's, in the units below
pub struct Tracking {
    pub min_speed_cm_s: i32,
    /// 2^-4 cm/s
    pub doppler_gate: i32,
    pub gap_cm: i32,
    pub lateral_gate_cm: i32,
    /// 2^-4
    pub sigmas: i32,
    pub max_length_cm: i32,
    /// 2^-16 s
    pub headway: i32,
    /// 2^-16 s
    pub coupled_headway: i32,
    pub coupled_way_cm: i32,
    /// 2^-8 cm/s
    pub coupled_speed: i32,
    pub standstill_cm: i32,
    /// 2^-16 s
    pub outline_memory: i32,
    /// Profile hits.
    pub outline_min_hits: i32,
    /// 2^-8
    pub outline_share: i32,
    /// 2^-16 s
    pub lateral_memory: i32,
    /// 2^-16
    pub drift_gain: i32,
    /// 2^-8 detections
    pub confirmed: i32,
    /// 2^-8 detections
    pub existence_max: i32,
    /// 2^-8 detections per second
    pub tentative_loss: i32,
    /// 2^-8 detections per second
    pub visible_loss: i32,
    /// 2^-8 detections per second
    pub hidden_loss: i32,
    pub merge_lateral_cm: i32,
    /// Least distance between the middles of two vehicles side by side.
    pub abreast_cm: i32,
    /// 2^-8 cm/s
    pub merge_speed: i32,
    /// Least cosine between headings, 2^-14.
    pub merge_parallel: i32,
    /// Half the width detections of one vehicle spread over.
    pub half_width_cm: i32,
    /// Frames an obstacle is young: its motion follows its detections quickly.
    pub young: u16,
    /// Detections' worth of trust in the speed so far, 2^-14; while young and later.
    pub young_inertia: i32,
    pub inertia: i32,
    /// Detections of one frame that count as evidence.
    pub most_hits_a_frame: i32,
    /// Way after which an obstacle is a mover, and stays one when it stops.
    pub mover_cm: i32,
    /// Speed below which one that never moved is a fixture, 2^-8 cm/s.
    pub fixture_speed: i32,
    /// Speed above which motion tells the heading, 2^-8 cm/s.
    pub turning_speed: i32,
    /// Bins the outline's middle may leave the anchor.
    pub recentre_bins: i32,
    /// Standard deviations by which a free motion must differ from the one along the heading, the least
    /// difference, and frames in a row.
    pub roam_sigmas: i32,
    pub roam_speed_cm_s: i32,
    pub roam_frames: u8,
    pub aside: i32,
    pub tall_length: bool,
    pub memory_speed_cm_s: i32,
    /// 2^-4
    pub shrink: i32,
    pub nojoin: bool,
    /// Of the speed, 2^-16.
    pub roam_share: i32,
    /// 2^-8 cm/s
    pub standing_speed: i32,
    /// 2^-8 detections per second
    pub standing_visible_loss: i32,
    pub standing_hidden_loss: i32,
    pub sizes: Sizes,
    pub noise: Noise,
    /// The road's axis in the levelled frame.
    pub road: Direction,
    /// How far obstacles are followed.
    pub limit_cm: i32,
}

impl ObstacleConfig {
    /// Checks the parameters and rounds them. `road` is the road's axis in the levelled frame, and
    /// obstacles are followed as far as `limit_cm`.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    pub fn tracking(&self, noise: Noise, road: Direction, limit_cm: i32) -> Result<Tracking, ConfigError> {
        let cm = |name, v, min, max| within(name, v, min, max).map(|m| math::round_i32(m * 100.0));
        let seconds = |name, v| within(name, v, 0.05, 60.0).map(|s| math::round_i32(s * 65536.0));
        let hits = |name, v| within(name, v, 0.0, 1000.0).map(|h| math::round_i32(h * 256.0));
        let gap_cm = cm("obstacles.gap_m", self.gap_m, 0.5, 20.0)?;
        let max_length_cm = cm("obstacles.max_length_m", self.max_length_m, 2.0, 22.0)?;
        let confirmed = hits("obstacles.confirm_hits", self.confirm_hits)?;
        let existence_max = hits("obstacles.max_evidence", self.max_evidence)?;
        if existence_max < confirmed {
            // nothing would ever be confirmed
            above("obstacles.max_evidence", self.max_evidence, self.confirm_hits)?;
        }
        Ok(Tracking {
            min_speed_cm_s: cm("obstacles.min_speed_mps", self.min_speed_mps, 0.3, 20.0)?,
            doppler_gate: cm("obstacles.doppler_gate_mps", self.doppler_gate_mps, 0.1, 10.0)? << 4,
            gap_cm,
            lateral_gate_cm: cm("obstacles.lateral_gate_m", self.lateral_gate_m, 0.0, 5.0)?,
            sigmas: math::round_i32(within("obstacles.gate_sigmas", self.gate_sigmas, 0.0, 8.0)? * 16.0),
            max_length_cm,
            headway: math::round_i32(within("obstacles.headway_s", self.headway_s, 0.0, 5.0)? * 65536.0),
            coupled_headway: math::round_i32(
                within("obstacles.coupled_headway_s", self.coupled_headway_s, 0.0, 5.0)? * 65536.0,
            ),
            coupled_way_cm: cm("obstacles.coupled_way_m", self.coupled_way_m, 0.0, 100.0)?,
            coupled_speed: math::round_i32(
                within("obstacles.coupled_speed_mps", self.coupled_speed_mps, 0.0, 5.0)? * 25_600.0,
            ),
            standstill_cm: cm("obstacles.standstill_m", self.standstill_m, 0.0, 10.0)?,
            outline_memory: seconds("obstacles.outline_memory_s", self.outline_memory_s)?,
            outline_min_hits: math::round_i32(
                within("obstacles.outline_min_hits", self.outline_min_hits, 0.1, 50.0)? * HIT as f32,
            ),
            outline_share: math::round_i32(within("obstacles.outline_share", self.outline_share, 0.0, 0.4)? * 256.0),
            lateral_memory: seconds("obstacles.lateral_memory_s", self.lateral_memory_s)?,
            drift_gain: math::round_i32(within("obstacles.drift_gain", self.drift_gain, 0.0, 0.5)? * 65536.0),
            confirmed,
            existence_max,
            tentative_loss: hits("obstacles.tentative_loss_per_s", self.tentative_loss_per_s)?,
            visible_loss: hits("obstacles.visible_loss_per_s", self.visible_loss_per_s)?,
            hidden_loss: hits("obstacles.hidden_loss_per_s", self.hidden_loss_per_s)?,
            merge_lateral_cm: 100,
            abreast_cm: 180,
            merge_speed: 200 << 8,
            merge_parallel: 15_500, // 19 degrees
            half_width_cm: 80,
            young: 5,
            young_inertia: 1 << 13,
            inertia: 4 << 14,
            most_hits_a_frame: 3,
            mover_cm: 200,
            fixture_speed: math::round_i32(self.min_speed_mps * 100.0) << 7,
            turning_speed: 200 << 8,
            recentre_bins: 6,
            roam_sigmas: math::round_i32(self.x[0]),
            roam_speed_cm_s: math::round_i32(self.x[1] * 100.0),
            roam_share: math::round_i32(self.x[6] * 65536.0),
            shrink: math::round_i32(self.x[7] * 16.0),
            nojoin: self.x[8] > 0.0,
            memory_speed_cm_s: math::round_i32(self.x[9] * 100.0),
            aside: math::round_i32(self.x[10] * 256.0),
            tall_length: self.x[11] > 0.0,
            roam_frames: math::round_i32(self.x[2]) as u8,
            standing_speed: math::round_i32(self.x[3] * 25_600.0),
            standing_visible_loss: math::round_i32(self.x[4] * 256.0),
            standing_hidden_loss: math::round_i32(self.x[5] * 256.0),
            sizes: self.sizes.sizes()?,
            noise,
            road,
            limit_cm,
        })
    }
}

impl Tracking {
    /// What a time step leaves of every obstacle's memories.
    pub fn kept_over(&self, step: Step) -> Kept {
        Kept { lateral: step.keep(self.lateral_memory), outline: step.keep(self.outline_memory) }
    }

    /// Heading and speed of something that moves along the road and shows this radial velocity;
    /// `None` where it may be standing, or nearly crosses the line of sight.
    pub fn course(&self, r: &Reflection) -> Option<(Direction, i32)> {
        let along = self.road.along(i32::from(r.sight.x), i32::from(r.sight.y));
        let radial = i32::from(r.radial_velocity_cm_s);
        // nearly broadside Doppler says nothing about motion along the road, and what stands still
        // shows no more than the noise of its Doppler
        if along.abs() < LEAST_PROJECTION || radial.abs() < 4 * self.noise.radial_velocity_cm_s {
            return None;
        }
        let speed = (radial << 14).checked_div(along)?;
        let heading = if speed > 0 { self.road } else { self.road.reversed() };
        (self.min_speed_cm_s..=FASTEST_CM_S).contains(&speed.abs()).then_some((heading, speed.abs()))
    }
}

/// What a time step leaves of an obstacle's memories, 2^-16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kept {
    /// Of the weight of its lateral place.
    pub lateral: i32,
    /// Of its outline.
    pub outline: i32,
}

/// Least share of a motion along the road that must show in its Doppler, 2^-14: 81 degrees off.
const LEAST_PROJECTION: i32 = (15 << 14) / 100;

/// Speeds above this are no vehicle's.
const FASTEST_CM_S: i32 = 7000;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflection::NoiseConfig;

    #[test]
    fn an_impossible_parameter_is_named() {
        let e = ObstacleConfig { gap_m: -1.0, ..ObstacleConfig::default() };
        let noise = NoiseConfig::default().noise().unwrap();
        let e = e.tracking(noise, Direction::AHEAD, 20_000).unwrap_err();
        assert_eq!(e.parameter, "obstacles.gap_m");
    }
}
