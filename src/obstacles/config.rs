//! What can be set of obstacle tracking, in SI units.

use super::clutter;
use super::lanes::Lanes;
use super::learnt_lanes;
use super::parameters::TrackingParameters;
use super::profile::HIT;
use super::reflectivity;
use super::size::SizeConfig;
#[cfg(feature = "tuned")]
use super::size::SizePoint;
use crate::fixed::math;
use crate::fixed::trig::Direction;
#[cfg(feature = "tuned")]
use crate::sensor::config::numbers;
use crate::sensor::config::{ConfigError, above, within};
use crate::sensor::noise::Noise;

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
    /// Farthest that parts of one vehicle lie beside each other, metres.
    pub merge_lateral_m: f32,
    /// Nearest that the middles of two vehicles side by side can be, metres.
    pub abreast_m: f32,
    /// Largest difference in speed of parts of one vehicle, m/s.
    pub merge_speed_mps: f32,
    /// Half the width that detections of one vehicle spread over, metres.
    pub half_width_m: f32,
    /// Way after which an obstacle is a mover, and stays one when it stops, metres.
    pub mover_way_m: f32,
    /// Speed above which motion gives the heading, m/s.
    pub turning_speed_mps: f32,
    /// Standard deviations of azimuth noise taken off either end of an outline.
    pub outline_sigmas: f32,
    /// Change of speed that turning makes within a second, m/s.
    pub turning_noise_mps: f32,
    /// Standard deviations by which the motion that is seen must differ from the one along the heading, before
    /// an obstacle goes its own way.
    pub off_axis_sigmas: f32,
    /// Least speed to the side for that, m/s.
    pub off_axis_mps: f32,
    /// Least share of the speed for that.
    pub off_axis_share: f32,
    /// Share of the way to the place seen that the outline of what goes its own way is moved in a frame.
    pub off_axis_follow: f32,
    /// How much farther than its width the box of what goes its own way reaches to either side, metres: its place
    /// across is known to so much, and what may be in the way is not drawn smaller. Half of it less than 14.5 degrees
    /// off the road's axis.
    pub off_axis_margin_m: f32,
    /// How long an outline must be longer until the box is, seconds.
    pub length_growth_s: f32,
    /// How long the box stays longer than an outline of which a part is hidden, seconds.
    pub length_memory_s: f32,
    /// Speed below which the box does so, m/s.
    pub slow_mps: f32,
    /// Standard deviations a speed must have to give the heading of what goes its own way.
    pub heading_sigmas: f32,
    /// Speed below which a mover has come to a stop, m/s.
    pub standing_speed_mps: f32,
    /// Loss of evidence of what stands, unseen in plain view, detections per second. A radar misses what
    /// stands more often than what moves, and a full list misses anything.
    pub standing_visible_loss_per_s: f32,
    /// Loss of evidence of what stands in a shadow, detections per second: as long as a red light lasts.
    pub standing_hidden_loss_per_s: f32,
    /// Radar cross section (`reflectivity.rs`) below which what is short is a pedestrian or rider, dBsm.
    pub weak_rcs_dbsm: f32,
    /// Radar cross section below which nothing of any length is a lorry that shows nothing high, dBsm.
    pub low_rcs_dbsm: f32,
    /// Radar cross section half way between a car's and a lorry's, dBsm.
    pub lorry_rcs_dbsm: f32,
    /// Seconds that something unmoving must have been seen at its place until its detections are kept from obstacles
    /// (`fixtures.rs`); 0: never.
    pub fixture_after_s: f32,
    /// Vehicles that must have driven on a place before the way they went is learnt (`learnt_lanes.rs`) as
    /// a lane; 0: none is learnt.
    pub lane_vehicles: f32,
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
            standstill_m: 1.6,
            lateral_gate_m: 1.0,
            gate_sigmas: 2.0,
            max_length_m: 19.0,
            outline_memory_s: 2.0,
            outline_min_hits: 2.5,
            outline_share: 0.06,
            lateral_memory_s: 0.8,
            drift_gain: 0.01,
            confirm_hits: 2.25,
            max_evidence: 12.0,
            tentative_loss_per_s: 10.0,
            visible_loss_per_s: 9.0,
            hidden_loss_per_s: 2.0,
            merge_lateral_m: 1.0,
            abreast_m: 1.8,
            merge_speed_mps: 2.0,
            half_width_m: 0.8,
            mover_way_m: 1.0,
            turning_speed_mps: 2.0,
            outline_sigmas: 0.7,
            turning_noise_mps: 1.0,
            off_axis_sigmas: 3.0,
            off_axis_mps: 1.5,
            off_axis_share: 0.15,
            off_axis_follow: 0.1,
            off_axis_margin_m: 0.7,
            length_growth_s: 1.0,
            length_memory_s: 3.0,
            slow_mps: 4.0,
            heading_sigmas: 4.0,
            standing_speed_mps: 0.7,
            standing_visible_loss_per_s: 5.0,
            standing_hidden_loss_per_s: 0.06,
            weak_rcs_dbsm: -3.0,
            low_rcs_dbsm: 5.0,
            lorry_rcs_dbsm: 11.0,
            fixture_after_s: 30.0,
            lane_vehicles: 0.0,
            sizes: SizeConfig::default(),
        }
    }
}

impl ObstacleConfig {
    /// Every number of it, in the order of the fields, for fingerprints.
    #[cfg(feature = "tuned")]
    pub fn numbers(&self) -> impl Iterator<Item = f32> {
        let own = numbers!(self => Self:
            min_speed_mps, doppler_gate_mps, gap_m, headway_s, coupled_headway_s, coupled_way_m,
            coupled_speed_mps, standstill_m, lateral_gate_m, gate_sigmas, max_length_m,
            outline_memory_s, outline_min_hits, outline_share, lateral_memory_s, drift_gain,
            confirm_hits, max_evidence, tentative_loss_per_s, visible_loss_per_s, hidden_loss_per_s,
            merge_lateral_m, abreast_m, merge_speed_mps, half_width_m, mover_way_m, turning_speed_mps,
            outline_sigmas, turning_noise_mps, off_axis_sigmas, off_axis_mps, off_axis_share,
            off_axis_follow, off_axis_margin_m, length_growth_s, length_memory_s, slow_mps,
            heading_sigmas, standing_speed_mps, standing_visible_loss_per_s, standing_hidden_loss_per_s,
            weak_rcs_dbsm, low_rcs_dbsm, lorry_rcs_dbsm, fixture_after_s,
            lane_vehicles;
            but sizes
        );
        let SizeConfig { points, min_length_m } = self.sizes;
        let sizes = points.into_iter().flat_map(|point| numbers!(&point => SizePoint: length_m, width_m, height_m));
        own.into_iter().chain(sizes).chain([min_length_m])
    }

    /// The same where lanes are learnt, from the usual number of vehicles if it says none.
    pub fn learning(self) -> Self {
        if self.lane_vehicles < 1.0 { Self { lane_vehicles: learnt_lanes::VEHICLES, ..self } } else { self }
    }

    /// Checks the parameters and rounds them. `road` is the road's axis in the levelled frame, and
    /// obstacles are followed as far as `limit_cm`.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limits are checked
    pub fn tracking(&self, noise: Noise, road: Direction, limit_cm: i32) -> Result<TrackingParameters, ConfigError> {
        let cm = |name, v, min, max| within(name, v, min, max).map(|m| math::round_i32(m * 100.0));
        let seconds = |name, v| within(name, v, 0.05, 60.0).map(|s| math::round_i32(s * 65536.0));
        let sigmas = |name, v| within(name, v, 0.0, 8.0).map(|s| math::round_i32(s * 16.0));
        let fine = |name, v, min, max| within(name, v, min, max).map(|s| math::round_i32(s * 25_600.0));
        let turning = within("obstacles.turning_noise_mps", self.turning_noise_mps, 0.1, 10.0)?;
        let hits = |name, v| within(name, v, 0.0, 1000.0).map(|h| math::round_i32(h * 256.0));
        let half_db = (2 << reflectivity::FRACTION) as f32;
        let rcs = |name, v| within(name, v, -60.0, 60.0).map(|dbsm| math::round_i32(dbsm * half_db));
        let most = if learnt_lanes::ROOM { 80.0 } else { 0.0 };
        let gap_cm = cm("obstacles.gap_m", self.gap_m, 0.5, 20.0)?;
        let max_length_cm = cm("obstacles.max_length_m", self.max_length_m, 2.0, 22.0)?;
        let confirmed = hits("obstacles.confirm_hits", self.confirm_hits)?;
        let existence_max = hits("obstacles.max_evidence", self.max_evidence)?;
        if existence_max < confirmed {
            // nothing would ever be confirmed
            above("obstacles.max_evidence", self.max_evidence, self.confirm_hits)?;
        }
        Ok(TrackingParameters {
            min_speed_cm_s: cm("obstacles.min_speed_mps", self.min_speed_mps, 0.3, 20.0)?,
            doppler_gate: cm("obstacles.doppler_gate_mps", self.doppler_gate_mps, 0.1, 10.0)? << 4,
            gap_cm,
            lateral_gate_cm: cm("obstacles.lateral_gate_m", self.lateral_gate_m, 0.0, 5.0)?,
            sigmas: sigmas("obstacles.gate_sigmas", self.gate_sigmas)?,
            max_length_cm,
            headway: math::round_i32(within("obstacles.headway_s", self.headway_s, 0.0, 5.0)? * 65536.0),
            coupled_headway: math::round_i32(
                within("obstacles.coupled_headway_s", self.coupled_headway_s, 0.0, 5.0)? * 65536.0,
            ),
            coupled_way_cm: cm("obstacles.coupled_way_m", self.coupled_way_m, 0.0, 100.0)?,
            coupled_speed: fine("obstacles.coupled_speed_mps", self.coupled_speed_mps, 0.0, 5.0)?,
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
            merge_lateral_cm: cm("obstacles.merge_lateral_m", self.merge_lateral_m, 0.0, 5.0)?,
            abreast_cm: cm("obstacles.abreast_m", self.abreast_m, 0.5, 5.0)?,
            merge_speed: fine("obstacles.merge_speed_mps", self.merge_speed_mps, 0.0, 20.0)?,
            half_width_cm: cm("obstacles.half_width_m", self.half_width_m, 0.1, 3.0)?,
            mover_cm: cm("obstacles.mover_way_m", self.mover_way_m, 0.0, 50.0)?,
            fixture_speed: math::round_i32(self.min_speed_mps * 100.0) << 7,
            turning_speed: fine("obstacles.turning_speed_mps", self.turning_speed_mps, 0.5, 20.0)?,
            outline_sigmas: sigmas("obstacles.outline_sigmas", self.outline_sigmas)?,
            turning_noise: math::round_i32(turning * turning * 10_000.0),
            off_axis_sigmas: sigmas("obstacles.off_axis_sigmas", self.off_axis_sigmas)?,
            off_axis_cm_s: cm("obstacles.off_axis_mps", self.off_axis_mps, 0.0, 50.0)?,
            off_axis_share: math::round_i32(
                within("obstacles.off_axis_share", self.off_axis_share, 0.0, 2.0)? * 65536.0,
            ),
            off_axis_margin_cm: cm("obstacles.off_axis_margin_m", self.off_axis_margin_m, 0.0, 2.0)?,
            length_growth: seconds("obstacles.length_growth_s", self.length_growth_s)?,
            length_memory: seconds("obstacles.length_memory_s", self.length_memory_s)?,
            slow_speed: fine("obstacles.slow_mps", self.slow_mps, 0.0, 50.0)?,
            off_axis_follow: math::round_i32(
                within("obstacles.off_axis_follow", self.off_axis_follow, 0.0, 1.0)? * 65536.0,
            ),
            heading_sigmas: sigmas("obstacles.heading_sigmas", self.heading_sigmas)?,
            standing_speed: fine("obstacles.standing_speed_mps", self.standing_speed_mps, 0.0, 5.0)?,
            standing_visible_loss: hits("obstacles.standing_visible_loss_per_s", self.standing_visible_loss_per_s)?,
            standing_hidden_loss: hits("obstacles.standing_hidden_loss_per_s", self.standing_hidden_loss_per_s)?,
            weak_rcs: rcs("obstacles.weak_rcs_dbsm", self.weak_rcs_dbsm)?,
            low_rcs: rcs("obstacles.low_rcs_dbsm", self.low_rcs_dbsm)?,
            lorry_rcs: rcs("obstacles.lorry_rcs_dbsm", self.lorry_rcs_dbsm)?,
            sizes: self.sizes.sizes()?,
            noise,
            road,
            limit_cm,
            lanes: Lanes::default(),
            fixture_after: math::round_i32(
                within("obstacles.fixture_after_s", self.fixture_after_s, 0.0, 200.0)? * f32::from(clutter::SECOND),
            ) as u16,
            lane_vehicles: math::round_i32(within("obstacles.lane_vehicles", self.lane_vehicles, 0.0, most)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::noise::NoiseConfig;

    #[test]
    fn an_impossible_parameter_is_named() {
        let e = ObstacleConfig { gap_m: -1.0, ..ObstacleConfig::default() };
        let noise = NoiseConfig::default().noise().unwrap();
        let e = e.tracking(noise, Direction::AHEAD, 20_000).unwrap_err();
        assert_eq!(e.parameter, "obstacles.gap_m");
    }
}
