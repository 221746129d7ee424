//! Where the sensor stands, and the levelled frame everything is computed in.
//!
//! Pitch and roll are undone once per detection. The *levelled frame* has its origin on the ground
//! below the sensor, x along the boresight's heading, y left, z up: a line of sight is still one
//! constant (azimuth, slope), and the slice plane is level for every azimuth.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::road::RoadPoint;

/// Mounting pose in the road frame.
///
/// # Units
/// Metres and degrees. Rotations follow REP-103: yaw + left, pitch + nose down, roll + left side up.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Mount {
    /// Along the road.
    pub x_m: f32,
    /// To the left.
    pub y_m: f32,
    /// Above the road.
    pub height_m: f32,
    /// Heading of the boresight.
    pub yaw_deg: f32,
    /// Positive looks down.
    pub pitch_deg: f32,
    /// Positive lifts the left side.
    pub roll_deg: f32,
}

/// Places farther away than this along either axis are taken to lie at it, centimetres.
const REACH_CM: i32 = 45_000;

/// The mount in integers: levels detections and places road points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levelling {
    /// Height of the sensor, centimetres.
    pub height_cm: i32,
    /// Sensor on the road plane, centimetres.
    origin: RoadPoint,
    /// The boresight's heading in the road frame.
    heading: Direction,
    /// Rows: levelled x, y, z; columns: sensor x, y, z; 2^-14.
    rotation: [[i32; 3]; 3],
}

impl Levelling {
    /// No mount: everything lies at the origin.
    pub(crate) const NOWHERE: Self =
        Self { height_cm: 0, origin: RoadPoint::new(0, 0), heading: Direction { x: 0, y: 0 }, rotation: [[0; 3]; 3] };
}

impl Mount {
    /// Checks the pose and computes its integer form.
    ///
    /// # Errors
    /// A height outside 0.1 to 20 m (the slope scale ends there), a pitch or roll beyond 45
    /// degrees, a position beyond 10 km.
    pub fn levelling(&self) -> Result<Levelling, ConfigError> {
        let height = within("mount.height_m", self.height_m, 0.1, 20.0)?;
        let x = within("mount.x_m", self.x_m, -10_000.0, 10_000.0)?;
        let y = within("mount.y_m", self.y_m, -10_000.0, 10_000.0)?;
        let yaw = within("mount.yaw_deg", self.yaw_deg, -360.0, 360.0)?;
        let pitch = within("mount.pitch_deg", self.pitch_deg, -45.0, 45.0)?.to_radians();
        let roll = within("mount.roll_deg", self.roll_deg, -45.0, 45.0)?.to_radians();
        let (sp, cp, sr, cr) = (math::sin(pitch), math::cos(pitch), math::sin(roll), math::cos(roll));
        let rows = [[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]];
        Ok(Levelling {
            height_cm: math::round_i32(height * 100.0),
            origin: RoadPoint::new(math::round_i32(x * 100.0), math::round_i32(y * 100.0)),
            heading: trig::direction(Angle::from_degrees(yaw)),
            rotation: rows.map(|row| row.map(|v| math::round_i32(v * 16384.0))),
        })
    }
}

impl Levelling {
    /// Of a sensor whose maps are level already, as received ones are: only its place and heading matter.
    pub fn on_road(origin: RoadPoint, height_cm: i32, heading: Angle) -> Self {
        let level = [[trig::ONE, 0, 0], [0, trig::ONE, 0], [0, 0, trig::ONE]];
        Self { height_cm, origin, heading: trig::direction(heading), rotation: level }
    }

    /// Levelled components of a sensor-frame vector; 2^-14 in, 2^-14 out.
    pub fn level(&self, v: [i32; 3]) -> [i32; 3] {
        self.rotation.map(|[a, b, c]| (a * v[0] + b * v[1] + c * v[2]) >> 14)
    }

    /// How much a sensor-frame vector rises, 2^-14 in, 2^-14 out.
    pub fn rise(&self, v: [i32; 3]) -> i32 {
        let [a, b, c] = self.rotation[2];
        (a * v[0] + b * v[1] + c * v[2]) >> 14
    }

    /// The sensor's upward axis, levelled, 2^-14.
    pub fn up(&self) -> [i32; 3] {
        let [x, y, z] = &self.rotation;
        [x[2], y[2], z[2]]
    }

    /// Sensor-frame components of a levelled vector, any unit up to 2^16.
    #[allow(clippy::cast_possible_truncation)] // a turned vector keeps its length
    pub fn unlevel(&self, v: [i32; 3]) -> [i32; 3] {
        let [x, y, z] = self.rotation;
        let turned = |(a, b, c): (i32, i32, i32)| {
            let sum = i64::from(a) * i64::from(v[0]) + i64::from(b) * i64::from(v[1]) + i64::from(c) * i64::from(v[2]);
            (sum >> 14) as i32
        };
        [turned((x[0], y[0], z[0])), turned((x[1], y[1], z[1])), turned((x[2], y[2], z[2]))]
    }

    /// [`Levelling::unlevel`] without rounding, for start-up tables.
    pub fn unlevel_exact(&self, v: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.rotation.map(|row| row.map(|c| c as f32 / 16384.0));
        core::array::from_fn(|k| [x, y, z].iter().zip(v).map(|(row, v)| row.get(k).copied().unwrap_or(0.0) * v).sum())
    }

    /// Levelled ground coordinates of a road point, centimetres. One farther away than 450 m along an axis of the road comes
    /// out somewhere beyond 449 m: it is on no map.
    #[allow(clippy::cast_possible_truncation)] // clamped
    pub fn place(&self, p: RoadPoint) -> (i32, i32) {
        let (dx, dy) = (p.x_cm.wrapping_sub(self.origin.x_cm), p.y_cm.wrapping_sub(self.origin.y_cm));
        // beyond 400 m no sensor sees; the clamp keeps squares of the result in 32 bits
        let (dx, dy) = (dx.clamp(-REACH_CM, REACH_CM), dy.clamp(-REACH_CM, REACH_CM));
        let (hx, hy) = (i64::from(self.heading.x), i64::from(self.heading.y));
        let (dx, dy) = (i64::from(dx), i64::from(dy));
        (((dx * hx + dy * hy) >> 14) as i32, ((dy * hx - dx * hy) >> 14) as i32)
    }

    /// [`Levelling::place`] for points within 900 m of the sensor, in 32 bits.
    #[inline]
    pub fn place_near(&self, p: RoadPoint) -> (i32, i32) {
        let (dx, dy) = (p.x_cm.wrapping_sub(self.origin.x_cm), p.y_cm.wrapping_sub(self.origin.y_cm));
        let (hx, hy) = (i32::from(self.heading.x), i32::from(self.heading.y));
        let sum = |a: i32, b: i32| a.wrapping_add(b) >> 14;
        (sum(dx.wrapping_mul(hx), dy.wrapping_mul(hy)), sum(dy.wrapping_mul(hx), -dx.wrapping_mul(hy)))
    }

    /// Road point of a place in the levelled frame, centimetres.
    pub fn unplace(&self, x_cm: i32, y_cm: i32) -> RoadPoint {
        let (x, y) = self.unturn(x_cm, y_cm);
        RoadPoint::new(self.origin.x_cm + x, self.origin.y_cm + y)
    }

    /// A levelled ground vector in the road's axes.
    pub fn unturn(&self, x: i32, y: i32) -> (i32, i32) {
        (self.road_axis().along(x, y), self.road_axis().across(x, y))
    }

    /// The road's x axis, seen in the levelled frame.
    pub fn road_axis(&self) -> Direction {
        Direction { x: self.heading.x, y: -self.heading.y }
    }

    /// The sensor's place on the road plane.
    pub fn origin(&self) -> RoadPoint {
        self.origin
    }

    /// Heading of the boresight in the road frame.
    pub fn heading(&self) -> Direction {
        self.heading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mount() -> Mount {
        Mount { x_m: 10.0, y_m: -2.0, height_m: 6.0, yaw_deg: 90.0, pitch_deg: 10.0, roll_deg: 0.0 }
    }

    #[test]
    fn positive_pitch_looks_down_and_positive_roll_lifts_the_left() {
        let l = mount().levelling().unwrap();
        assert_eq!(l.level([16384, 0, 0]), [16135, 0, -2845]);
        let rolled = Mount { roll_deg: 10.0, pitch_deg: 0.0, ..mount() }.levelling().unwrap();
        assert_eq!(rolled.level([0, 16384, 0])[2], 2845);
    }

    #[test]
    fn a_road_point_to_the_left_of_a_left_looking_sensor_is_ahead() {
        let l = mount().levelling().unwrap();
        // sensor at (10, -2) looks along +y
        assert_eq!(l.place(RoadPoint::new(1000, 4800)), (5000, 0));
        assert_eq!(l.place(RoadPoint::new(900, -200)), (0, 100));
        assert_eq!(l.place_near(RoadPoint::new(900, -200)), (0, 100));
        assert_eq!(l.unplace(5000, 0), RoadPoint::new(1000, 4800));
        assert_eq!(l.unplace(0, 100), RoadPoint::new(900, -200));
        assert_eq!(l.road_axis(), Direction { x: 0, y: -16384 });
    }

    #[test]
    fn levelling_and_back_is_the_same_vector() {
        let l = Mount { roll_deg: -7.0, ..mount() }.levelling().unwrap();
        let back = l.unlevel(l.level([10_000, -5_000, 3_000]));
        for (a, b) in back.iter().zip([10_000, -5_000, 3_000]) {
            assert!((a - b).abs() <= 3, "{back:?}");
        }
    }

    #[test]
    fn a_mount_below_ground_is_named() {
        let e = Mount { height_m: -6.0, ..mount() }.levelling().unwrap_err();
        assert_eq!(e.parameter, "mount.height_m");
    }
}
