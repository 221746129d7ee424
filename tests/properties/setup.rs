//! Every parameter with its limits, and random setups within them.

use proptest::prelude::*;
use viewshed::radar_2d::Radar2dConfig;
use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;

/// A sensor and both estimators' configurations.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    pub sensor: Sensor,
    pub radar_3d: Radar3dConfig,
    pub radar_2d: Radar2dConfig,
}

impl Default for Setup {
    fn default() -> Self {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 3.0, roll_deg: 0.0 };
        let field_of_view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        };
        let sensor = Sensor { mount, field_of_view, noise: NoiseConfig::default() };
        Self { sensor, radar_3d: Radar3dConfig::default(), radar_2d: Radar2dConfig::default() }
    }
}

/// A parameter: its name in errors, its limits, and how it is set.
pub struct Parameter {
    pub name: &'static str,
    pub limits: [f32; 2],
    pub set: fn(&mut Setup, f32),
}

/// One line for each parameter: name, limits, and the fields it is.
macro_rules! parameters {
    ($($name:literal $min:literal $max:literal $($field:ident).+ $(, $other:ident . $($more:ident).+)? ;)*) => {
        &[$(Parameter {
            name: $name,
            limits: [$min, $max],
            set: |setup, value| {
                setup.$($field).+ = value;
                $(setup.$other.$($more).+ = value;)?
            },
        }),*]
    };
}

/// Those of the sensor, which both estimators read.
pub const OF_SENSOR: &[Parameter] = parameters! {
    "mount.x_m" -10_000.0 10_000.0 sensor.mount.x_m;
    "mount.y_m" -10_000.0 10_000.0 sensor.mount.y_m;
    "mount.height_m" 0.1 20.0 sensor.mount.height_m;
    "mount.yaw_deg" -360.0 360.0 sensor.mount.yaw_deg;
    "mount.pitch_deg" -45.0 45.0 sensor.mount.pitch_deg;
    "mount.roll_deg" -45.0 45.0 sensor.mount.roll_deg;
    "field_of_view.azimuth_min_deg" -85.0 85.0 sensor.field_of_view.azimuth_min_deg;
    "field_of_view.azimuth_max_deg" -85.0 85.0 sensor.field_of_view.azimuth_max_deg;
    "field_of_view.elevation_min_deg" -85.0 85.0 sensor.field_of_view.elevation_min_deg;
    "field_of_view.elevation_max_deg" -85.0 85.0 sensor.field_of_view.elevation_max_deg;
    "field_of_view.range_min_m" 0.0 400.0 sensor.field_of_view.range_min_m;
    "field_of_view.range_max_m" 1.0 400.0 sensor.field_of_view.range_max_m;
    "noise.range_m" 0.01 5.0 sensor.noise.range_m;
    "noise.azimuth_deg" 0.01 10.0 sensor.noise.azimuth_deg;
    "noise.elevation_deg" 0.01 20.0 sensor.noise.elevation_deg;
    "noise.radial_velocity_mps" 0.01 5.0 sensor.noise.radial_velocity_mps;
    "noise.reflector_height_m" 0.0 3.0 sensor.noise.reflector_height_m;
};

/// Those both estimators have.
pub const OF_BOTH: &[Parameter] = parameters! {
    "gate.min_snr_db" -100.0 200.0 radar_3d.gate.min_snr_db, radar_2d.gate.min_snr_db;
    "gate.min_rcs_dbsm" -100.0 100.0 radar_3d.gate.min_rcs_dbsm, radar_2d.gate.min_rcs_dbsm;
    "gate.max_speed_mps" 1.0 327.0 radar_3d.gate.max_speed_mps, radar_2d.gate.max_speed_mps;
    "gate.min_speed_mps" 0.0 20.0 radar_3d.gate.min_speed_mps, radar_2d.gate.min_speed_mps;
    "gate.elevation_margin_deg" 0.0 90.0 radar_3d.gate.elevation_margin_deg, radar_2d.gate.elevation_margin_deg;
    "health.hold_s" 0.01 60.0 radar_3d.health.hold_s, radar_2d.health.hold_s;
    "health.blind_after_s" 0.01 60.0 radar_3d.health.blind_after_s, radar_2d.health.blind_after_s;
    "health.reset_gap_s" 0.01 60.0 radar_3d.health.reset_gap_s, radar_2d.health.reset_gap_s;
};

/// Those of radar-3d.
pub const OF_RADAR_3D: &[Parameter] = parameters! {
    "obstacles.min_speed_mps" 0.3 20.0 radar_3d.obstacles.min_speed_mps;
    "obstacles.doppler_gate_mps" 0.1 10.0 radar_3d.obstacles.doppler_gate_mps;
    "obstacles.gap_m" 0.5 20.0 radar_3d.obstacles.gap_m;
    "obstacles.headway_s" 0.0 5.0 radar_3d.obstacles.headway_s;
    "obstacles.standstill_m" 0.0 10.0 radar_3d.obstacles.standstill_m;
    "obstacles.coupled_headway_s" 0.0 5.0 radar_3d.obstacles.coupled_headway_s;
    "obstacles.coupled_way_m" 0.0 100.0 radar_3d.obstacles.coupled_way_m;
    "obstacles.coupled_speed_mps" 0.0 5.0 radar_3d.obstacles.coupled_speed_mps;
    "obstacles.lateral_gate_m" 0.0 5.0 radar_3d.obstacles.lateral_gate_m;
    "obstacles.gate_sigmas" 0.0 8.0 radar_3d.obstacles.gate_sigmas;
    "obstacles.max_length_m" 2.0 22.0 radar_3d.obstacles.max_length_m;
    "obstacles.outline_memory_s" 0.05 60.0 radar_3d.obstacles.outline_memory_s;
    "obstacles.outline_min_hits" 0.1 50.0 radar_3d.obstacles.outline_min_hits;
    "obstacles.outline_share" 0.0 0.4 radar_3d.obstacles.outline_share;
    "obstacles.lateral_memory_s" 0.05 60.0 radar_3d.obstacles.lateral_memory_s;
    "obstacles.drift_gain" 0.0 0.5 radar_3d.obstacles.drift_gain;
    "obstacles.confirm_hits" 0.0 1000.0 radar_3d.obstacles.confirm_hits;
    "obstacles.max_evidence" 0.0 1000.0 radar_3d.obstacles.max_evidence;
    "obstacles.tentative_loss_per_s" 0.0 1000.0 radar_3d.obstacles.tentative_loss_per_s;
    "obstacles.visible_loss_per_s" 0.0 1000.0 radar_3d.obstacles.visible_loss_per_s;
    "obstacles.hidden_loss_per_s" 0.0 1000.0 radar_3d.obstacles.hidden_loss_per_s;
    "obstacles.merge_lateral_m" 0.0 5.0 radar_3d.obstacles.merge_lateral_m;
    "obstacles.abreast_m" 0.5 5.0 radar_3d.obstacles.abreast_m;
    "obstacles.merge_speed_mps" 0.0 20.0 radar_3d.obstacles.merge_speed_mps;
    "obstacles.half_width_m" 0.1 3.0 radar_3d.obstacles.half_width_m;
    "obstacles.mover_way_m" 0.0 50.0 radar_3d.obstacles.mover_way_m;
    "obstacles.turning_speed_mps" 0.5 20.0 radar_3d.obstacles.turning_speed_mps;
    "obstacles.outline_sigmas" 0.0 8.0 radar_3d.obstacles.outline_sigmas;
    "obstacles.turning_noise_mps" 0.1 10.0 radar_3d.obstacles.turning_noise_mps;
    "obstacles.off_axis_sigmas" 0.0 8.0 radar_3d.obstacles.off_axis_sigmas;
    "obstacles.off_axis_mps" 0.0 50.0 radar_3d.obstacles.off_axis_mps;
    "obstacles.length_growth_s" 0.05 60.0 radar_3d.obstacles.length_growth_s;
    "obstacles.length_memory_s" 0.05 60.0 radar_3d.obstacles.length_memory_s;
    "obstacles.slow_mps" 0.0 50.0 radar_3d.obstacles.slow_mps;
    "obstacles.off_axis_follow" 0.0 1.0 radar_3d.obstacles.off_axis_follow;
    "obstacles.off_axis_margin_m" 0.0 2.0 radar_3d.obstacles.off_axis_margin_m;
    "obstacles.off_axis_share" 0.0 2.0 radar_3d.obstacles.off_axis_share;
    "obstacles.heading_sigmas" 0.0 8.0 radar_3d.obstacles.heading_sigmas;
    "obstacles.standing_speed_mps" 0.0 5.0 radar_3d.obstacles.standing_speed_mps;
    "obstacles.standing_visible_loss_per_s" 0.0 1000.0 radar_3d.obstacles.standing_visible_loss_per_s;
    "obstacles.standing_hidden_loss_per_s" 0.0 1000.0 radar_3d.obstacles.standing_hidden_loss_per_s;
    "obstacles.weak_rcs_dbsm" -60.0 60.0 radar_3d.obstacles.weak_rcs_dbsm;
    "obstacles.low_rcs_dbsm" -60.0 60.0 radar_3d.obstacles.low_rcs_dbsm;
    "obstacles.lorry_rcs_dbsm" -60.0 60.0 radar_3d.obstacles.lorry_rcs_dbsm;
    "obstacles.fixture_after_s" 0.0 200.0 radar_3d.obstacles.fixture_after_s;
    "obstacles.lane_vehicles" 0.0 80.0 radar_3d.obstacles.lane_vehicles;
    "sizes.min_length_m" 0.3 20.0 radar_3d.obstacles.sizes.min_length_m;
    "evidence.gain" 0.0 1.0 radar_3d.evidence.gain;
    "evidence.clearing" 0.0 1.0 radar_3d.evidence.clearing;
    "evidence.hidden_memory_s" 0.05 600.0 radar_3d.evidence.hidden_memory_s;
    "evidence.visible_memory_s" 0.05 600.0 radar_3d.evidence.visible_memory_s;
    "evidence.height_prior_m" 0.0 5.0 radar_3d.evidence.height_prior_m;
    "evidence.height_prior_sigma_m" 0.01 5.0 radar_3d.evidence.height_prior_sigma_m;
    "visibility.slice_height_m" 0.0 10.0 radar_3d.visibility.slice_height_m;
    "visibility.visible_from" 0.01 1.0 radar_3d.visibility.visible_from;
    "visibility.occupied_from" 0.01 1.0 radar_3d.visibility.occupied_from;
};

/// Those of radar-2d.
pub const OF_RADAR_2D: &[Parameter] = parameters! {
    "cartesian.peak" 0.01 1.0 radar_2d.cartesian.peak;
    "cartesian.memory_s" 0.01 60.0 radar_2d.cartesian.memory_s;
    "slice_height_m" 0.0 10.0 radar_2d.slice_height_m;
};

/// All of them.
pub fn all() -> impl Iterator<Item = &'static Parameter> {
    [OF_SENSOR, OF_BOTH, OF_RADAR_3D, OF_RADAR_2D].into_iter().flatten()
}

/// Where in its limits a parameter lies, as a part of the way from one to the other.
fn part() -> impl Strategy<Value = f32> {
    prop_oneof![1 => Just(0.0), 1 => Just(1.0), 3 => 0.0..1.0_f32]
}

/// Setups with every parameter within its limits, and no limits reversed. Where the road is out of
/// view altogether, the field of view is the usual one.
pub fn setups() -> impl Strategy<Value = Setup> {
    // from all but a few parameters at their usual values to none
    let changed = prop_oneof![Just(0.03), Just(0.2), Just(1.0)];
    let parts = proptest::collection::vec((0.0..1.0, part()), all().count());
    let sizes = proptest::collection::vec((0.5..39.0_f32, 0.3..6.0_f32, 0.3..8.0_f32), 4);
    let sizes = proptest::option::weighted(0.2, sizes);
    let most = proptest::option::weighted(0.2, 1..=u16::MAX);
    let far_road = proptest::option::weighted(0.3, 0.0..=1.0_f32);
    (changed, parts, sizes, most, far_road).prop_map(|(changed, parts, sizes, most, far_road)| {
        let mut setup = Setup::default();
        for (p, (roll, part)) in all().zip(parts) {
            if roll < changed {
                (p.set)(&mut setup, (p.limits[0] + (p.limits[1] - p.limits[0]) * part).clamp(p.limits[0], p.limits[1]));
            }
        }
        let v = &mut setup.sensor.field_of_view;
        in_order(&mut v.azimuth_min_deg, &mut v.azimuth_max_deg, 85.0);
        in_order(&mut v.elevation_min_deg, &mut v.elevation_max_deg, 85.0);
        in_order(&mut v.range_min_m, &mut v.range_max_m, 400.0);
        if let Some(most) = most {
            setup.radar_3d.gate.max_detections = most;
            setup.radar_2d.gate.max_detections = most;
        }
        if let Some(mut sizes) = sizes {
            sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
            let points = &mut setup.radar_3d.obstacles.sizes.points;
            for (i, (p, (length, width, height))) in points.iter_mut().zip(sizes).enumerate() {
                (p.length_m, p.width_m, p.height_m) = (length + 0.25 * i as f32, width, height);
            }
        }
        let (gate, obstacles) = (&mut setup.radar_3d.gate, &mut setup.radar_3d.obstacles);
        gate.max_speed_mps = gate.max_speed_mps.max(gate.min_speed_mps + 1.0);
        setup.radar_2d.gate.max_speed_mps = gate.max_speed_mps;
        obstacles.max_evidence = obstacles.max_evidence.max(obstacles.confirm_hits);
        if Radar3dParameters::<2, 2, 2>::new(&setup.sensor, &setup.radar_3d).is_err() {
            setup.sensor.field_of_view = Setup::default().sensor.field_of_view;
        }
        let view = &setup.sensor.field_of_view;
        let [right, left] = [view.azimuth_min_deg.ceil(), view.azimuth_max_deg.floor()];
        let far_road = far_road.filter(|_| right <= left).map(|part| (right + part * (left - right)).round() as i8);
        setup.radar_3d.visibility.far_road_deg = far_road;
        setup
    })
}

/// Puts limits in ascending order, a little apart.
fn in_order(low: &mut f32, high: &mut f32, most: f32) {
    if *low > *high {
        std::mem::swap(low, high);
    }
    if *high - *low < 0.5 {
        *high = (*low + 0.5).min(most);
        *low = (*high - 0.5).min(*low);
    }
}
