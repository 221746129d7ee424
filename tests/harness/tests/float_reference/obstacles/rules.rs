//! Parameters of tracking in metres and seconds.

use viewshed::obstacles::config::ObstacleConfig;
use viewshed::obstacles::parameters::{
    INERTIA, MERGE_PARALLEL, MOST_HITS_A_FRAME, RECENTRE_BINS, YOUNG_FRAMES, YOUNG_INERTIA,
};
use viewshed::obstacles::size::SizeConfig;
use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::{Ground, Placed, along};

/// Least projection of the line of sight on the road that shows motion along it.
const LEAST_PROJECTION: f64 = 0.15;
/// Standard deviations of Doppler that what stands still may show.
const STANDING_SIGMAS: f64 = 4.0;
/// Fastest an obstacle starts, m/s.
const FASTEST: f64 = 70.0;

/// Lengths in metres, times in seconds, speeds in m/s, evidence in detections.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    pub min_speed: f64,
    pub doppler_gate: f64,
    pub gap: f64,
    pub lateral_gate: f64,
    pub sigmas: f64,
    pub max_length: f64,
    pub outline_memory: f64,
    pub outline_min_hits: f64,
    pub outline_share: f64,
    pub lateral_memory: f64,
    pub drift_gain: f64,
    pub confirm_hits: f64,
    pub max_evidence: f64,
    pub tentative_loss: f64,
    pub visible_loss: f64,
    pub hidden_loss: f64,
    /// Shortest headway between vehicles, and gap where they stand.
    pub headway: f64,
    pub standstill: f64,
    /// Headway below which what has come this far together, equally fast, is one vehicle.
    pub coupled_headway: f64,
    pub coupled_way: f64,
    pub coupled_speed: f64,
    pub sizes: SizeConfig,
    pub range_sigma: f64,
    pub speed_sigma: f64,
    /// Radians.
    pub azimuth_sigma: f64,
    /// The road's axis in the levelled frame.
    pub road: Ground,
    /// How far obstacles are followed.
    pub limit: f64,
    pub merge_lateral: f64,
    pub abreast: f64,
    pub merge_speed: f64,
    /// Least cosine between headings.
    pub merge_parallel: f64,
    pub half_width: f64,
    pub outline_sigmas: f64,
    pub turning_noise: f64,
    pub off_axis: f64,
    pub off_axis_share: f64,
    pub off_axis_follow: f64,
    pub off_axis_margin: f64,
    pub length_growth: f64,
    pub length_memory: f64,
    pub slow: f64,
    pub off_axis_sigmas: f64,
    pub heading_sigmas: f64,
    pub standing_speed: f64,
    pub standing_visible_loss: f64,
    pub standing_hidden_loss: f64,
    /// dBsm.
    pub weak_rcs: f64,
    pub low_rcs: f64,
    pub lorry_rcs: f64,
    pub fixture_after: f64,
    /// Frames.
    pub young: u32,
    pub young_inertia: f64,
    pub inertia: f64,
    pub most_hits_a_frame: f64,
    pub mover: f64,
    pub fixture_speed: f64,
    pub turning_speed: f64,
    pub recentre_bins: f64,
}

impl Rules {
    pub fn new(c: &ObstacleConfig, noise: &NoiseConfig, road: Ground, limit: f64) -> Self {
        let real = f64::from;
        Self {
            min_speed: real(c.min_speed_mps),
            doppler_gate: real(c.doppler_gate_mps),
            gap: real(c.gap_m),
            lateral_gate: real(c.lateral_gate_m),
            sigmas: real(c.gate_sigmas),
            max_length: real(c.max_length_m),
            outline_memory: real(c.outline_memory_s),
            outline_min_hits: real(c.outline_min_hits),
            outline_share: real(c.outline_share),
            lateral_memory: real(c.lateral_memory_s),
            drift_gain: real(c.drift_gain),
            confirm_hits: real(c.confirm_hits),
            max_evidence: real(c.max_evidence),
            tentative_loss: real(c.tentative_loss_per_s),
            visible_loss: real(c.visible_loss_per_s),
            hidden_loss: real(c.hidden_loss_per_s),
            headway: real(c.headway_s),
            standstill: real(c.standstill_m),
            coupled_headway: real(c.coupled_headway_s),
            coupled_way: real(c.coupled_way_m),
            coupled_speed: real(c.coupled_speed_mps),
            sizes: c.sizes,
            range_sigma: real(noise.range_m),
            speed_sigma: real(noise.radial_velocity_mps),
            azimuth_sigma: real(noise.azimuth_deg).to_radians(),
            road,
            limit,
            merge_lateral: real(c.merge_lateral_m),
            abreast: real(c.abreast_m),
            merge_speed: real(c.merge_speed_mps),
            merge_parallel: f64::from(MERGE_PARALLEL) / 16384.0,
            half_width: real(c.half_width_m),
            outline_sigmas: real(c.outline_sigmas),
            turning_noise: real(c.turning_noise_mps),
            off_axis: real(c.off_axis_mps),
            off_axis_share: real(c.off_axis_share),
            off_axis_follow: real(c.off_axis_follow),
            off_axis_margin: real(c.off_axis_margin_m),
            length_growth: real(c.length_growth_s),
            length_memory: real(c.length_memory_s),
            slow: real(c.slow_mps),
            off_axis_sigmas: real(c.off_axis_sigmas),
            heading_sigmas: real(c.heading_sigmas),
            standing_speed: real(c.standing_speed_mps),
            standing_visible_loss: real(c.standing_visible_loss_per_s),
            standing_hidden_loss: real(c.standing_hidden_loss_per_s),
            weak_rcs: real(c.weak_rcs_dbsm),
            low_rcs: real(c.low_rcs_dbsm),
            lorry_rcs: real(c.lorry_rcs_dbsm),
            fixture_after: real(c.fixture_after_s),
            young: u32::from(YOUNG_FRAMES),
            young_inertia: f64::from(YOUNG_INERTIA) / 16384.0,
            inertia: f64::from(INERTIA) / 16384.0,
            most_hits_a_frame: f64::from(MOST_HITS_A_FRAME),
            mover: real(c.mover_way_m),
            fixture_speed: real(c.min_speed_mps) / 2.0,
            turning_speed: real(c.turning_speed_mps),
            recentre_bins: f64::from(RECENTRE_BINS),
        }
    }

    /// Heading and speed of something that moves along the road and shows this radial velocity; nothing
    /// where it may be standing, or nearly crosses the line of sight.
    pub fn course(&self, d: &Placed) -> Option<(Ground, f64)> {
        let projection = along(self.road, d.sight);
        let speed = d.radial_velocity / projection;
        let shows = projection.abs() >= LEAST_PROJECTION
            && d.radial_velocity.abs() >= STANDING_SIGMAS * self.speed_sigma
            && speed.abs() >= self.min_speed
            && speed.abs() <= FASTEST;
        shows.then(|| (self.road.map(|c| c * speed.signum()), speed.abs()))
    }
}
