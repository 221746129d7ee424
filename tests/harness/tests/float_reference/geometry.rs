//! Levelling and placing: a measurement in the sensor frame becomes a point on the road.

use viewshed::frame::detection::Measurement;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed_harness::geometry::pose::{SensorPose, Spherical};

/// A vector on the ground of the levelled frame: ahead and to the left.
pub type Ground = [f64; 2];

/// Component of a vector along a unit vector.
pub fn along(unit: Ground, v: Ground) -> f64 {
    unit[0] * v[0] + unit[1] * v[1]
}

/// Component of a vector to the left of a unit vector.
pub fn across(unit: Ground, v: Ground) -> f64 {
    unit[0] * v[1] - unit[1] * v[0]
}

pub fn difference(a: Ground, b: Ground) -> Ground {
    [a[0] - b[0], a[1] - b[1]]
}

/// `a + length * unit`
pub fn moved(a: Ground, unit: Ground, length: f64) -> Ground {
    [a[0] + length * unit[0], a[1] + length * unit[1]]
}

/// The unit vector a quarter turn to the left.
pub fn left(unit: Ground) -> Ground {
    [-unit[1], unit[0]]
}

/// The levelled frame: origin on the ground below the sensor, x along the boresight's heading.
#[derive(Debug, Clone, Copy)]
pub struct Levelled {
    pub height_m: f64,
    origin: Ground,
    yaw_rad: f64,
    /// The sensor in this frame: pitch and roll are left, yaw is not.
    sensor: SensorPose,
}

impl Levelled {
    pub fn new(mount: &Mount) -> Self {
        let [height_m, x, y] = [mount.height_m, mount.x_m, mount.y_m].map(f64::from);
        let [yaw, pitch, roll] = [mount.yaw_deg, mount.pitch_deg, mount.roll_deg].map(|a| f64::from(a).to_radians());
        let sensor = SensorPose::new([0.0, 0.0, height_m], 0.0, pitch, roll);
        Self { height_m, origin: [x, y], yaw_rad: yaw, sensor }
    }

    /// A road point in this frame.
    pub fn place(&self, road: Ground) -> Ground {
        let heading = [self.yaw_rad.cos(), self.yaw_rad.sin()];
        let d = difference(road, self.origin);
        [along(heading, d), across(heading, d)]
    }

    /// The road's x axis, seen in this frame.
    pub fn road_axis(&self) -> Ground {
        [self.yaw_rad.cos(), -self.yaw_rad.sin()]
    }

    /// How the sensor sees a point of this frame.
    pub fn seen(&self, point: [f64; 3]) -> Spherical {
        self.sensor.to_spherical(point)
    }
}

/// A reflection on the road, levelled frame; metres, radians, m/s.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    pub at: Ground,
    /// Ground components of the unit line of sight.
    pub sight: Ground,
    pub radial_velocity: f64,
    /// Standard deviation across the line of sight.
    pub sigma_across: f64,
    /// Measured height above the road and its standard deviation.
    pub height: Option<(f64, f64)>,
    /// Radar cross section, dBsm.
    pub rcs: Option<f64>,
}

impl Placed {
    pub fn ground(&self) -> f64 {
        self.at[0].hypot(self.at[1])
    }

    pub fn bearing(&self) -> f64 {
        self.at[1].atan2(self.at[0])
    }
}

/// Where range and azimuth meet the usual reflector height; the measured height is kept beside it.
pub fn place(m: &Measurement, noise: &NoiseConfig, levelled: &Levelled) -> Placed {
    let [range_m, azimuth_rad] = [m.range_m, m.azimuth_rad].map(f64::from);
    let s = levelled.sensor.at_height(range_m, azimuth_rad, f64::from(noise.reflector_height_m));
    let [x, y, _] = levelled.sensor.to_road(s);
    let sigma = |degrees: f32| range_m * f64::from(degrees).to_radians();
    let height = m.elevation_rad.map(|e| {
        let [.., z] = levelled.sensor.to_road(Spherical { range_m, azimuth_rad, elevation_rad: f64::from(e) });
        (z, sigma(noise.elevation_deg))
    });
    Placed {
        at: [x, y],
        sight: [x / range_m, y / range_m],
        radial_velocity: f64::from(m.radial_velocity_mps),
        sigma_across: sigma(noise.azimuth_deg),
        height,
        rcs: super::gate::half_db(m.rcs_dbsm).map(|half| half / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Random, mounts, raise, within};
    use viewshed::frame::detection::Detection;
    use viewshed::sensor::road::RoadPoint;

    #[test]
    fn detections_are_placed_within_7_cm_and_a_twentieth_of_a_degree() {
        let noise = NoiseConfig::default();
        let integer = noise.noise().unwrap();
        let mut random = Random::new(1);
        let [mut place_cm, mut bearing_deg, mut sight, mut height_cm, mut sigma_cm] = [0.0; 5];
        let (mut bias_cm, mut n) = ([0.0; 2], 0.0);
        for mount in mounts() {
            let (levelled, levelling) = (Levelled::new(&mount), mount.levelling().unwrap());
            for _ in 0..4000 {
                let m = random.measurement();
                let exact = place(&m, &noise, &levelled);
                let d = Detection::new(&m).unwrap();
                let got = integer.place(&d, &levelling);
                let [x, y] = [0, 1].map(|k| f64::from([got.x_cm, got.y_cm][k]) - 100.0 * exact.at[k]);
                raise(&mut place_cm, x.hypot(y));
                raise(&mut place_cm, f64::from(got.ground_cm) - 100.0 * exact.ground());
                bias_cm = [bias_cm[0] + x, bias_cm[1] + y];
                n += 1.0;
                // below the sensor an angle says nothing
                if exact.ground() > 20.0 {
                    raise(&mut bearing_deg, (f64::from(got.bearing().radians()) - exact.bearing()).to_degrees());
                }
                raise(&mut sight, f64::from(got.sight.x) / 16384.0 - exact.sight[0]);
                raise(&mut sight, f64::from(got.sight.y) / 16384.0 - exact.sight[1]);
                raise(&mut sigma_cm, f64::from(got.across_cm) - 100.0 * exact.sigma_across);
                let (got, exact) = (got.height_cm.unwrap(), exact.height.unwrap());
                raise(&mut height_cm, f64::from(got.0) - 100.0 * exact.0);
                raise(&mut sigma_cm, f64::from(got.1) - 100.0 * exact.1);
            }
        }
        within("place, cm", place_cm, 7.0);
        within("mean error ahead, cm", (bias_cm[0] / n).abs(), 1.5);
        within("mean error to the left, cm", (bias_cm[1] / n).abs(), 1.5);
        within("bearing, degrees", bearing_deg, 0.05);
        within("line of sight", sight, 0.0006);
        within("measured height, cm", height_cm, 4.5);
        // rounded down
        within("standard deviations, cm", sigma_cm, 1.01);
    }

    #[test]
    fn road_points_are_placed_within_2_cm() {
        let mut random = Random::new(2);
        let [mut place_cm, mut axis] = [0.0; 2];
        for mount in mounts() {
            let (levelled, levelling) = (Levelled::new(&mount), mount.levelling().unwrap());
            for _ in 0..1000 {
                let p = RoadPoint::new(random.whole(-20_000, 20_000), random.whole(-20_000, 20_000));
                let exact = levelled.place([p.x_cm, p.y_cm].map(|v| f64::from(v) / 100.0));
                let (x, y) = levelling.place(p);
                raise(&mut place_cm, f64::from(x) - 100.0 * exact[0]);
                raise(&mut place_cm, f64::from(y) - 100.0 * exact[1]);
            }
            raise(&mut axis, f64::from(levelling.road_axis().x) / 16384.0 - levelled.road_axis()[0]);
            raise(&mut axis, f64::from(levelling.road_axis().y) / 16384.0 - levelled.road_axis()[1]);
        }
        within("place, cm", place_cm, 2.0);
        within("road axis", axis, 0.0002);
    }
}
