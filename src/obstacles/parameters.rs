//! Parameters of obstacle tracking, checked and in integers.

use super::lanes::Lanes;
use super::size::Sizes;
use crate::fixed::math::length;
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;
use crate::frame::reflection::Reflection;
use crate::sensor::noise::Noise;

/// [`ObstacleConfig`](super::config::ObstacleConfig) in integers; lengths in centimetres.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)] // the fields are the configuration's, in the units below
pub struct TrackingParameters {
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
    pub abreast_cm: i32,
    /// 2^-8 cm/s
    pub merge_speed: i32,
    pub half_width_cm: i32,
    pub mover_cm: i32,
    /// Speed below which one that never moved is a fixture, 2^-8 cm/s.
    pub fixture_speed: i32,
    /// 2^-8 cm/s
    pub turning_speed: i32,
    /// 2^-4
    pub outline_sigmas: i32,
    /// (cm/s)^2 per second
    pub turning_noise: i32,
    /// 2^-4
    pub off_axis_sigmas: i32,
    pub off_axis_cm_s: i32,
    /// 2^-16
    pub off_axis_follow: i32,
    pub off_axis_margin_cm: i32,
    /// 2^-16 s
    pub length_growth: i32,
    /// 2^-16 s
    pub length_memory: i32,
    /// 2^-8 cm/s
    pub slow_speed: i32,
    /// 2^-16
    pub off_axis_share: i32,
    /// 2^-4
    pub heading_sigmas: i32,
    /// 2^-8 cm/s
    pub standing_speed: i32,
    /// 2^-8 detections per second
    pub standing_visible_loss: i32,
    /// 2^-8 detections per second
    pub standing_hidden_loss: i32,
    /// 2^-6 half dBsm
    pub weak_rcs: i32,
    /// 2^-6 half dBsm
    pub low_rcs: i32,
    /// 2^-6 half dBsm
    pub lorry_rcs: i32,
    pub sizes: Sizes,
    pub noise: Noise,
    /// The road's axis in the levelled frame.
    pub road: Direction,
    /// How far obstacles are followed.
    pub limit_cm: i32,
    /// Which way traffic goes at a place, where that is given.
    pub lanes: Lanes,
    /// Vehicles that make a lane; 0: none is learnt.
    pub lane_vehicles: i32,
    /// 2^-8 s
    pub fixture_after: u16,
}

/// Frames an obstacle is young: its motion follows its detections quickly.
pub const YOUNG_FRAMES: u16 = 5;
/// Detections' worth of trust in the speed so far while young, and later, 2^-14.
pub const YOUNG_INERTIA: i32 = 1 << 13;
/// See [`YOUNG_INERTIA`].
pub const INERTIA: i32 = 4 << 14;
/// Detections of one frame that count as evidence: more are of one reflection.
pub const MOST_HITS_A_FRAME: i32 = 3;
/// Least cosine between the headings of parts of one vehicle, 2^-14: 19 degrees.
pub const MERGE_PARALLEL: i32 = 15_500;
/// Bins the outline's middle may leave the anchor before that is moved: 3 m of the histogram's 24.
pub const RECENTRE_BINS: i32 = 6;

/// Variance across a car that reflects on both its sides alike, cm^2.
pub(super) const EVEN_SPREAD: i32 = 85 * 85;

/// Difference between a detection's radial velocity and the one a motion (2^-4 cm/s) explains,
/// 2^-4 cm/s.
pub(super) fn speed_error(velocity: (i32, i32), r: &Reflection) -> i32 {
    (i32::from(r.radial_velocity_cm_s) << 4) - r.sight.along(velocity.0, velocity.1)
}

impl TrackingParameters {
    /// What a time step leaves of every obstacle's memories.
    pub fn kept_over(&self, step: Step) -> Kept {
        Kept { lateral: step.keep(self.lateral_memory), outline: step.keep(self.outline_memory) }
    }

    /// Heading and speed of something that moves and shows this radial velocity: along the road, or along the line of
    /// sight where nothing drives so fast along the road that it would show that. `None` where it may be standing, or
    /// is slow and nearly crosses the line of sight.
    pub fn course(&self, r: &Reflection) -> Option<(Direction, i32)> {
        let radial = i32::from(r.radial_velocity_cm_s);
        // what stands still shows no more than the noise of its Doppler
        if radial.abs() < 4 * self.noise.radial_velocity_cm_s {
            return None;
        }
        let along = self.road.along(i32::from(r.sight.x), i32::from(r.sight.y));
        // nearly broadside Doppler says nothing about motion along the road
        let speed = if along.abs() < LEAST_PROJECTION { i32::MAX } else { (radial << 14).checked_div(along)? };
        if speed.abs() > FASTEST_ALONG_CM_S {
            // along the ground: a line of sight that points down has a part there shorter than one
            let (x, y) = (i32::from(r.sight.x), i32::from(r.sight.y));
            let sight = Direction::of(x, y);
            let speed = (radial.abs() << 14) / length(x, y).max(1);
            let heading = if radial > 0 { sight } else { sight.reversed() };
            return (radial.abs() >= LEAST_RADIAL_CM_S && speed <= FASTEST_CM_S).then_some((heading, speed));
        }
        let heading = if speed > 0 { self.road } else { self.road.reversed() };
        (speed.abs() >= self.min_speed_cm_s).then_some((heading, speed.abs()))
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
pub(super) const LEAST_PROJECTION: i32 = (15 << 14) / 100;

/// Speeds above this are no vehicle's.
const FASTEST_CM_S: i32 = 7000;

/// Faster than this, 160 km/h, nothing drives that is seen nearly from the side: it does not go along the road.
const FASTEST_ALONG_CM_S: i32 = 4500;

/// Least radial speed of what goes along the line of sight: slower, it may be going round a corner or be a wheel.
const LEAST_RADIAL_CM_S: i32 = 300;

#[cfg(test)]
mod tests {
    use super::super::made_up::{rules, seen_at};
    use super::*;

    #[test]
    fn a_course_is_where_its_doppler_says_along_the_road() {
        let t = rules();
        let at = |x_cm: i32, y_cm: i32, radial_velocity_cm_s| {
            let sight = Direction::of(x_cm, y_cm);
            t.course(&Reflection {
                x_cm,
                y_cm,
                ground_cm: 5000,
                sight,
                radial_velocity_cm_s,
                across_cm: 40,
                height_cm: None,
                rcs_half_dbsm: None,
            })
        };
        assert_eq!(at(5000, 0, 2000), Some((t.road, 2000)));
        assert_eq!(at(5000, 0, -2000), Some((t.road.reversed(), 2000)));
        // 60 degrees to the side half of the speed shows
        let (heading, speed) = at(2500, 4330, -1000).unwrap();
        assert!(heading == t.road.reversed() && (speed - 2000).abs() < 5);
        assert_eq!(at(300, 5000, 200), None, "nearly broadside, and slow");
        for radial in [-800, 800] {
            let (heading, speed) = at(300, 5000, radial).unwrap();
            let ahead = heading.along(300, 5000);
            assert!(
                speed == 800 && ahead.signum() == i32::from(radial).signum(),
                "towards the sensor, or away from it"
            );
        }
        // from a mast: 45 degrees down, and the line of sight along the ground is a heading as long as any other
        let down = Reflection { sight: Direction { x: 0, y: 11_585 }, ..seen_at(0, 800, 500) };
        let (heading, speed) = t.course(&down).unwrap();
        assert!(length(i32::from(heading.x), i32::from(heading.y)).abs_diff(1 << 14) < 4, "{heading:?}");
        assert!((706..=708).contains(&speed), "{speed}");
        assert_eq!(at(1000, 5000, -800), Some((t.road.reversed(), 4079)), "nearly as fast as anything drives");
        assert_eq!(at(5000, 0, 55), None, "within the noise of what stands");
        assert_eq!(at(5000, 0, 120), None, "slower than what starts an obstacle");
        assert_eq!(at(5000, 0, 7100), None, "no vehicle's speed");
        assert_eq!(at(5000, 0, 5000), Some((Direction::AHEAD, 5000)), "straight ahead, whatever the reason");
    }
}
