//! Where the sensor stands: road frame to sensor frame and back, in double precision.

/// Mounting pose of a sensor in the road frame.
///
/// Rotation is REP-103: yaw about z (left), then pitch about y (positive = nose down), then roll
/// about x. Lengths in metres, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorPose {
    pub position: [f64; 3],
    /// Rows are road axes, columns sensor axes: `road = rotation * sensor + position`.
    rotation: [[f64; 3]; 3],
}

/// A point as a radar names it: slant range in metres, azimuth (+ left) and elevation (+ up) in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spherical {
    pub range_m: f64,
    pub azimuth_rad: f64,
    pub elevation_rad: f64,
}

impl SensorPose {
    pub fn new(position: [f64; 3], yaw_rad: f64, pitch_rad: f64, roll_rad: f64) -> Self {
        let (sy, cy) = yaw_rad.sin_cos();
        let (sp, cp) = pitch_rad.sin_cos();
        let (sr, cr) = roll_rad.sin_cos();
        Self {
            position,
            rotation: [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ],
        }
    }

    /// From a unit quaternion (x, y, z, w), as `tf2` carries it.
    pub fn from_quaternion(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Self {
        Self {
            position,
            rotation: [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
                [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
                [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
            ],
        }
    }

    pub fn yaw_rad(&self) -> f64 {
        self.rotation[1][0].atan2(self.rotation[0][0])
    }

    pub fn pitch_rad(&self) -> f64 {
        (-self.rotation[2][0]).clamp(-1.0, 1.0).asin()
    }

    pub fn roll_rad(&self) -> f64 {
        self.rotation[2][1].atan2(self.rotation[2][2])
    }

    /// Road-frame direction of a sensor-frame vector.
    pub fn rotate_to_road(&self, v: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    /// Sensor-frame direction of a road-frame vector.
    pub fn rotate_to_sensor(&self, v: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|c| self.rotation[0][c] * v[0] + self.rotation[1][c] * v[1] + self.rotation[2][c] * v[2])
    }

    pub fn to_sensor(&self, road: [f64; 3]) -> [f64; 3] {
        self.rotate_to_sensor([road[0] - self.position[0], road[1] - self.position[1], road[2] - self.position[2]])
    }

    pub fn to_spherical(&self, road: [f64; 3]) -> Spherical {
        let [x, y, z] = self.to_sensor(road);
        Spherical {
            range_m: (x * x + y * y + z * z).sqrt(),
            azimuth_rad: y.atan2(x),
            elevation_rad: z.atan2(x.hypot(y)),
        }
    }

    pub fn to_road(&self, s: Spherical) -> [f64; 3] {
        let v = self.rotate_to_road(direction(s.azimuth_rad, s.elevation_rad));
        [0, 1, 2].map(|i| self.position[i] + s.range_m * v[i])
    }

    /// The point at `range_m` under `azimuth_rad` that lies `height_m` above the road: where a
    /// radar without elevation is taken to have measured. Where no such point exists (the range
    /// is shorter than the mount is high), the lowest point of that range and azimuth.
    pub fn at_height(&self, range_m: f64, azimuth_rad: f64, height_m: f64) -> Spherical {
        // z(elevation) = position.z + range (a cos e + b sin e)
        let [c, s] = [azimuth_rad.cos(), azimuth_rad.sin()];
        let a = self.rotation[2][0] * c + self.rotation[2][1] * s;
        let b = self.rotation[2][2];
        let wanted = (height_m - self.position[2]) / range_m;
        let amplitude = a.hypot(b);
        // a cos e + b sin e = amplitude sin(e + phase)
        let phase = a.atan2(b);
        Spherical { range_m, azimuth_rad, elevation_rad: (wanted / amplitude).clamp(-1.0, 1.0).asin() - phase }
    }
}

/// Unit vector of an azimuth and elevation, in the sensor frame.
pub fn direction(azimuth_rad: f64, elevation_rad: f64) -> [f64; 3] {
    let (sa, ca) = azimuth_rad.sin_cos();
    let (se, ce) = elevation_rad.sin_cos();
    [ce * ca, ce * sa, se]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) {
        for i in 0..3 {
            assert!((a[i] - b[i]).abs() < 1e-9, "{a:?} is not {b:?}");
        }
    }

    #[test]
    fn positive_pitch_looks_down_and_positive_yaw_looks_left() {
        let down = SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.1, 0.0);
        assert!(down.rotate_to_road([1.0, 0.0, 0.0])[2] < 0.0);
        let left = SensorPose::new([0.0; 3], 0.1, 0.0, 0.0);
        assert!(left.rotate_to_road([1.0, 0.0, 0.0])[1] > 0.0);
        let rolled = SensorPose::new([0.0; 3], 0.0, 0.0, 0.1);
        assert!(rolled.rotate_to_road([0.0, 1.0, 0.0])[2] > 0.0, "left side up");
    }

    #[test]
    fn euler_angles_survive_the_quaternion() {
        let (yaw, pitch, roll) = (0.5_f64, -0.2_f64, 0.1_f64);
        let (sy, cy) = (yaw / 2.0).sin_cos();
        let (sp, cp) = (pitch / 2.0).sin_cos();
        let (sr, cr) = (roll / 2.0).sin_cos();
        let q = [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ];
        let p = SensorPose::from_quaternion([1.0, 2.0, 3.0], q);
        assert!((p.yaw_rad() - yaw).abs() < 1e-12);
        assert!((p.pitch_rad() - pitch).abs() < 1e-12);
        assert!((p.roll_rad() - roll).abs() < 1e-12);
        close(
            p.rotate_to_road([0.3, 0.4, 0.5]),
            SensorPose::new([1.0, 2.0, 3.0], yaw, pitch, roll).rotate_to_road([0.3, 0.4, 0.5]),
        );
    }

    #[test]
    fn spherical_and_road_coordinates_are_inverse() {
        let pose = SensorPose::new([1.0, -2.0, 5.0], 0.3, 0.07, -0.02);
        let point = [80.0, 12.0, 1.5];
        close(pose.to_road(pose.to_spherical(point)), point);
    }

    #[test]
    fn a_radar_without_elevation_is_taken_at_the_asked_height() {
        let pose = SensorPose::new([0.0, 0.0, 6.0], 0.2, 0.07, 0.03);
        let s = pose.at_height(50.0, -0.6, 1.0);
        assert!((pose.to_road(s)[2] - 1.0).abs() < 1e-9);
        assert!(s.elevation_rad < 0.0);
        assert_eq!(s.range_m, 50.0);
        assert!(pose.at_height(2.0, 0.0, 1.0).elevation_rad.is_finite());
    }
}
