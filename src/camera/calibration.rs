//! Where a camera hangs and how it projects: three ways in, one [`Calibration`] out.
//!
//! - [`Calibration`] itself, from intrinsics and a measured mount;
//! - [`Calibration::from_points`], from four or more points whose place on the road is known, and
//!   [`Calibration::from_points_alone`] where not even the focal length is;
//! - [`Calibration::from_ground_plane`], from intrinsics and the road plane in the camera's coordinates.
//!
//! The camera is a pinhole: boxes have to be those of the rectified image. Pixels count from the upper left corner,
//! u to the right, v down. As every sensor here it looks along its x axis, with y left and z up; the optical frame
//! of other software (x right, y down, z ahead) appears in the ground plane only.

use crate::camera::boxes::NORMAL_PX;
use crate::camera::homography::{self, Homography};
pub use crate::camera::points::{CalibrationError, PointPair};
use crate::fixed::math;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::mount::Mount;

/// How a camera projects.
///
/// # Units
/// Pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Intrinsics {
    /// Width and height of the image.
    pub size_px: [u16; 2],
    /// Focal length along u and v.
    pub focal_px: [f32; 2],
    /// Where the optical axis meets the image, u and v.
    pub center_px: [f32; 2],
}

/// A camera as it is installed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Calibration {
    /// How it projects.
    pub intrinsics: Intrinsics,
    /// Where it hangs.
    pub mount: Mount,
}

/// Optical axes (right, down, ahead) in the road frame, and the camera's place.
struct Pose {
    axes: [[f64; 3]; 3],
    place_m: [f64; 3],
}

impl Calibration {
    /// From intrinsics and points of the road. Answers with the residual too: how far, as a root of mean squares
    /// in pixels, the points lie from where the calibrated camera sees them. More than a few pixels is a wrong
    /// pair, or an image that is not rectified.
    ///
    /// # Errors
    /// Points that determine no view, and a mount outside its limits.
    pub fn from_points(intrinsics: &Intrinsics, points: &[PointPair]) -> Result<(Self, f32), CalibrationError> {
        intrinsics.check()?;
        let seen = homography::fit(points)?;
        fitted(*intrinsics, &intrinsics.centred(&seen), points)
    }

    /// The same where only the image's size in pixels is known: the optical axis is taken to meet its middle, pixels
    /// to be square, and the focal length comes from the points as well.
    ///
    /// # Errors
    /// Those of [`from_points`](Self::from_points), and points that leave the focal length open.
    pub fn from_points_alone(size_px: [u16; 2], points: &[PointPair]) -> Result<(Self, f32), CalibrationError> {
        let center_px = size_px.map(|side| f32::from(side) / 2.0);
        let unit = Intrinsics { size_px, focal_px: [1.0; 2], center_px };
        let rows = unit.centred(&homography::fit(points)?);
        let focal = focal_length(&rows).ok_or(CalibrationError::FocalLengthOpen)?;
        #[allow(clippy::cast_possible_truncation)] // to single precision
        let intrinsics = Intrinsics { focal_px: [focal as f32; 2], ..unit };
        intrinsics.check()?;
        let [first, second, third] = rows;
        fitted(intrinsics, &[first.map(|v| v / focal), second.map(|v| v / focal), third], points)
    }

    /// From intrinsics and the road plane `a x + b y + c z + d = 0` in optical coordinates (x right, y down, z
    /// ahead), of any scale and sign. A plane gives height, pitch and roll; where on the road the camera hangs and
    /// which way it looks has to be given, in metres and degrees.
    ///
    /// # Errors
    /// A plane without a normal or through the camera, and a mount outside its limits.
    pub fn from_ground_plane(
        intrinsics: &Intrinsics,
        plane: [f32; 4],
        place_m: [f32; 2],
        yaw_deg: f32,
    ) -> Result<Self, CalibrationError> {
        intrinsics.check()?;
        let [a, b, c, d] = plane;
        let length = math::sqrt(a * a + b * b + c * c);
        let height_m = d.abs() / length;
        if !(length > 0.0 && height_m > 0.0 && height_m.is_finite()) {
            return Err(CalibrationError::NoPlane);
        }
        // the normal on the camera's side points up
        let up = [a, b, c].map(|v| if d > 0.0 { v / length } else { -v / length });
        let (ahead, left, above) = (up[2], -up[0], -up[1]);
        let pitch = math::atan2(-ahead, math::sqrt(left * left + above * above));
        let calibration = Self {
            intrinsics: *intrinsics,
            mount: Mount {
                x_m: place_m[0],
                y_m: place_m[1],
                height_m,
                yaw_deg,
                pitch_deg: pitch.to_degrees(),
                roll_deg: math::atan2(left, above).to_degrees(),
            },
        };
        calibration.mount.levelling()?;
        Ok(calibration)
    }

    /// The same camera with a picture of 1024 x 1024 pixels, in which an edge is a share of the picture, whatever
    /// the size a detector is given: for boxes by [`ImageBox::of_picture`](crate::camera::boxes::ImageBox::of_picture),
    /// and for those of the native format.
    pub fn normalised(&self) -> Self {
        let Intrinsics { size_px, focal_px, center_px } = self.intrinsics;
        let [width, height] = size_px.map(|side| f32::from(NORMAL_PX) / f32::from(side));
        let scaled = |[u, v]: [f32; 2]| [u * width, v * height];
        let intrinsics =
            Intrinsics { size_px: [NORMAL_PX; 2], focal_px: scaled(focal_px), center_px: scaled(center_px) };
        Self { intrinsics, mount: self.mount }
    }

    /// From a mount and the angles at which the picture ends, right and left in its middle row, below and above in
    /// its middle column: normalised.
    pub(crate) fn of_view(mount: &Mount, view: &FieldOfView) -> Self {
        let tangent = |degrees: f32| math::sin(degrees.to_radians()) / math::cos(degrees.to_radians());
        let (left, right) = (tangent(view.azimuth_max_deg), tangent(-view.azimuth_min_deg));
        let (up, down) = (tangent(view.elevation_max_deg), tangent(-view.elevation_min_deg));
        let side = f32::from(NORMAL_PX);
        let focal_px = [side / (left + right), side / (up + down)];
        let intrinsics =
            Intrinsics { size_px: [NORMAL_PX; 2], focal_px, center_px: [focal_px[0] * left, focal_px[1] * up] };
        Self { intrinsics, mount: *mount }
    }

    /// The field of view of the image up to a range, metres: everything inside of it is in the image. The corners
    /// of the image decide about elevation, so a strip at the middle of its upper and lower border is left out.
    pub fn field_of_view(&self, range_m: f32) -> FieldOfView {
        let Intrinsics { size_px, focal_px, center_px } = self.intrinsics;
        let [width, height] = size_px.map(f32::from);
        let (left, right) = (center_px[0] / focal_px[0], (width - center_px[0]) / focal_px[0]);
        let (up, down) = (center_px[1] / focal_px[1], (height - center_px[1]) / focal_px[1]);
        let side = if left > right { left } else { right };
        let slant = math::sqrt(1.0 + side * side);
        let degrees = |tangent: f32| math::atan2(tangent, 1.0).to_degrees();
        FieldOfView {
            azimuth_min_deg: -degrees(right),
            azimuth_max_deg: degrees(left),
            elevation_min_deg: -degrees(down / slant),
            elevation_max_deg: degrees(up / slant),
            range_min_m: 0.0,
            range_max_m: range_m,
        }
    }
}

impl Intrinsics {
    /// # Errors
    /// A side outside 16 to 8192 pixels, a focal length outside 50 to 20 000, a centre outside of the image.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        let [width, height] = self.size_px.map(f32::from);
        within("intrinsics.size_px[0]", width, 16.0, 8192.0)?;
        within("intrinsics.size_px[1]", height, 16.0, 8192.0)?;
        within("intrinsics.focal_px[0]", self.focal_px[0], 50.0, 20_000.0)?;
        within("intrinsics.focal_px[1]", self.focal_px[1], 50.0, 20_000.0)?;
        within("intrinsics.center_px[0]", self.center_px[0], 1.0, width - 1.0)?;
        within("intrinsics.center_px[1]", self.center_px[1], 1.0, height - 1.0)?;
        Ok(())
    }

    /// A homography to pixels as one to tangents right of and below the optical axis.
    fn centred(&self, [first, second, third]: &Homography) -> Homography {
        let row = |row: &[f64; 3], focal: f32, center: f32| {
            let (focal, center) = (f64::from(focal), f64::from(center));
            let mut third = third.iter();
            row.map(|v| (v - center * third.next().copied().unwrap_or(0.0)) / focal)
        };
        [row(first, self.focal_px[0], self.center_px[0]), row(second, self.focal_px[1], self.center_px[1]), *third]
    }
}

/// The focal length for which both axes of the road are seen equally long and at a right angle, pixels.
fn focal_length([a, b, c]: &Homography) -> Option<f64> {
    // x . y = 0 and x . x = y . y, each linear in the focal length's square
    let (p1, q1) = (a[0] * a[1] + b[0] * b[1], c[0] * c[1]);
    let (p2, q2) = (a[0] * a[0] + b[0] * b[0] - a[1] * a[1] - b[1] * b[1], c[0] * c[0] - c[1] * c[1]);
    let square = -(p1 * q1 + p2 * q2) / (q1 * q1 + q2 * q2);
    (square.is_finite() && square > 0.0).then(|| math::sqrt_double(square))
}

/// The camera that sees the road by these tangents.
#[allow(clippy::cast_possible_truncation)] // to single precision
fn fitted(
    intrinsics: Intrinsics,
    seen: &Homography,
    points: &[PointPair],
) -> Result<(Calibration, f32), CalibrationError> {
    let pose = pose(seen)?;
    let [right, down, ahead] = pose.axes;
    let [x, y, z] = pose.place_m.map(|v| v as f32);
    let level = math::sqrt_double(ahead[0] * ahead[0] + ahead[1] * ahead[1]);
    let mount = Mount {
        x_m: x,
        y_m: y,
        height_m: z,
        yaw_deg: math::atan2(ahead[1] as f32, ahead[0] as f32).to_degrees(),
        pitch_deg: math::atan2(-ahead[2] as f32, level as f32).to_degrees(),
        roll_deg: math::atan2(-right[2] as f32, -down[2] as f32).to_degrees(),
    };
    mount.levelling()?;
    let squares: f64 = points
        .iter()
        .map(|p| {
            let [x, y] = p.road_m.map(f64::from);
            let from = [x - pose.place_m[0], y - pose.place_m[1], -pose.place_m[2]];
            let [right, down, ahead] = pose.axes.map(|axis| dot(axis, from));
            let off = |tangent: f64, k: usize| {
                let of = |pair: &[f32; 2]| f64::from(pair.get(k).copied().unwrap_or(0.0));
                of(&intrinsics.center_px) + of(&intrinsics.focal_px) * tangent - of(&p.image_px)
            };
            let (u, v) = (off(right / ahead, 0), off(down / ahead, 1));
            u * u + v * v
        })
        .sum();
    let residual_px = math::sqrt_double(squares / points.len().max(1) as f64) as f32;
    Ok((Calibration { intrinsics, mount }, residual_px))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn cross([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

fn scaled(v: [f64; 3], length: f64) -> [f64; 3] {
    let own = math::sqrt_double(dot(v, v));
    v.map(|c| c * length / own)
}

/// Takes a homography apart: its columns are the road's axes and origin as the camera sees them.
fn pose([a, b, c]: &Homography) -> Result<Pose, CalibrationError> {
    let (along, across, origin) = ([a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]);
    let length = |v: [f64; 3]| math::sqrt_double(dot(v, v));
    let unit = (length(along) + length(across)) / 2.0;
    if !(unit > 0.0 && unit.is_finite()) {
        return Err(CalibrationError::Degenerate);
    }
    // noise leaves the axes not quite at a right angle: both give way by the same
    let (p, q) = (scaled(along, 1.0), scaled(across, 1.0));
    let sum = scaled(core::array::from_fn(|k| at(&p, k) + at(&q, k)), core::f64::consts::FRAC_1_SQRT_2);
    let difference = scaled(core::array::from_fn(|k| at(&p, k) - at(&q, k)), core::f64::consts::FRAC_1_SQRT_2);
    let x: [f64; 3] = core::array::from_fn(|k| at(&sum, k) + at(&difference, k));
    let y: [f64; 3] = core::array::from_fn(|k| at(&sum, k) - at(&difference, k));
    let up = cross(x, y);
    let t = origin.map(|v| v / unit);
    let place_m = [-dot(x, t), -dot(y, t), -dot(up, t)];
    let above_road = place_m[2] > 0.0;
    if !above_road {
        return Err(CalibrationError::Mirrored);
    }
    let [r, d, h] = core::array::from_fn(|k| [at(&x, k), at(&y, k), at(&up, k)]);
    Ok(Pose { axes: [r, d, h], place_m })
}

fn at(v: &[f64; 3], k: usize) -> f64 {
    v.get(k).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::projection::exact;
    use std::string::ToString;
    use std::vec::Vec;

    const INTRINSICS: Intrinsics =
        Intrinsics { size_px: [1920, 1080], focal_px: [1663.0, 1663.0], center_px: [960.0, 540.0] };

    const MOUNT: Mount = Mount { x_m: 10.0, y_m: -3.0, height_m: 6.5, yaw_deg: 12.0, pitch_deg: 7.0, roll_deg: -2.0 };

    /// Points as a camera sees them.
    fn points(calibration: &Calibration, road: &[[f32; 2]]) -> Vec<PointPair> {
        let pair = |&[x, y]: &[f32; 2]| PointPair {
            road_m: [x, y],
            image_px: exact::pixel(calibration, [f64::from(x), f64::from(y), 0.0]).unwrap().map(|v| v as f32),
        };
        road.iter().map(pair).collect()
    }

    const ROAD: [[f32; 2]; 6] = [[40.0, -4.0], [38.0, 10.0], [90.0, 2.0], [110.0, 25.0], [60.0, 12.0], [55.0, 3.0]];

    fn close(got: &Calibration, expected: &Calibration, tolerance: f32) {
        let values = |c: &Calibration| {
            let m = c.mount;
            [m.x_m, m.y_m, m.height_m, m.yaw_deg, m.pitch_deg, m.roll_deg, c.intrinsics.focal_px[0] / 100.0]
        };
        for (a, b) in values(got).iter().zip(values(expected)) {
            assert!((a - b).abs() < tolerance, "{got:?}");
        }
    }

    #[test]
    fn points_give_the_mount_back_and_its_residual() {
        let exact = Calibration { intrinsics: INTRINSICS, mount: MOUNT };
        let mut pairs = points(&exact, &ROAD);
        let (got, residual) = Calibration::from_points(&INTRINSICS, &pairs).unwrap();
        close(&got, &exact, 0.02);
        assert!(residual < 0.05, "{residual}");
        let (got, residual) = Calibration::from_points_alone([1920, 1080], &pairs).unwrap();
        close(&got, &exact, 0.1);
        assert!(residual < 0.05, "{residual}");
        // one pair of six is 12 px off: at least a third of that is left
        pairs[4].image_px[0] += 12.0;
        let (_, residual) = Calibration::from_points(&INTRINSICS, &pairs).unwrap();
        assert!(residual > 1.0, "{residual}");
    }

    #[test]
    fn mirrored_points_are_refused_and_not_calibrated() {
        let exact = Calibration { intrinsics: INTRINSICS, mount: MOUNT };
        let mut pairs = points(&exact, &ROAD);
        pairs.iter_mut().for_each(|p| p.road_m[1] = -p.road_m[1]);
        let error = Calibration::from_points(&INTRINSICS, &pairs).unwrap_err();
        assert_eq!(error, CalibrationError::Mirrored);
        assert!(error.to_string().contains("y runs to the left"));
    }

    #[test]
    fn a_camera_that_looks_straight_down_has_no_focal_length() {
        let road = [[-4.0, -3.0], [5.0, -2.0], [4.0, 4.0], [-3.0, 2.0]];
        let pairs =
            road.map(|[x, y]: [f32; 2]| PointPair { road_m: [x, y], image_px: [960.0 - 90.0 * y, 540.0 - 90.0 * x] });
        let error = Calibration::from_points_alone([1920, 1080], &pairs).unwrap_err();
        assert_eq!(error, CalibrationError::FocalLengthOpen);
    }

    #[test]
    fn a_level_plane_below_is_a_level_camera() {
        // y = 6.5 below; pitched 7 degrees down the road rises ahead in optical coordinates
        let level = Calibration::from_ground_plane(&INTRINSICS, [0.0, 2.0, 0.0, -13.0], [10.0, -3.0], 12.0).unwrap();
        close(
            &level,
            &Calibration { intrinsics: INTRINSICS, mount: Mount { pitch_deg: 0.0, roll_deg: 0.0, ..MOUNT } },
            1e-3,
        );
        let (s, c) = 7.0_f32.to_radians().sin_cos();
        for sign in [1.0, -1.0] {
            let plane = [0.0, -c, -s, 6.5].map(|v| sign * v);
            let pitched = Calibration::from_ground_plane(&INTRINSICS, plane, [10.0, -3.0], 12.0).unwrap();
            close(&pitched, &Calibration { intrinsics: INTRINSICS, mount: Mount { roll_deg: 0.0, ..MOUNT } }, 1e-3);
        }
        // the left side up by 2 degrees: up leans to the camera's right
        let (s, c) = 2.0_f32.to_radians().sin_cos();
        let rolled = Calibration::from_ground_plane(&INTRINSICS, [-s, -c, 0.0, 6.5], [0.0, 0.0], 0.0).unwrap();
        assert!((rolled.mount.roll_deg - 2.0).abs() < 1e-3, "{rolled:?}");
        let none = Calibration::from_ground_plane(&INTRINSICS, [0.0, 0.0, 0.0, 5.0], [0.0, 0.0], 0.0);
        assert_eq!(none, Err(CalibrationError::NoPlane));
    }

    #[test]
    fn everything_in_the_field_of_view_is_in_the_image() {
        let view = Calibration { intrinsics: INTRINSICS, mount: MOUNT }.field_of_view(200.0);
        assert!((view.azimuth_max_deg - 30.0).abs() < 0.01 && (view.azimuth_min_deg + 30.0).abs() < 0.01);
        let wide = Intrinsics { center_px: [700.0, 500.0], ..INTRINSICS };
        let view = Calibration { intrinsics: wide, mount: MOUNT }.field_of_view(200.0);
        assert!(view.azimuth_max_deg < -view.azimuth_min_deg, "less to the left of the centre");
        assert!(view.elevation_max_deg < -view.elevation_min_deg, "less above it");
        for azimuth in [view.azimuth_min_deg, view.azimuth_max_deg] {
            for elevation in [view.elevation_min_deg, view.elevation_max_deg] {
                let (a, e) = (azimuth.to_radians(), elevation.to_radians());
                let (u, v) = (700.0 - 1663.0 * a.tan(), 500.0 - 1663.0 * e.tan() / a.cos());
                assert!((-0.1..=1920.1).contains(&u) && (-0.1..=1080.1).contains(&v), "{u} {v}");
            }
        }
    }

    #[test]
    fn an_absurd_camera_is_named() {
        let flat = Intrinsics { focal_px: [0.0, 1663.0], ..INTRINSICS };
        let error = Calibration::from_ground_plane(&flat, [0.0, 1.0, 0.0, -6.0], [0.0, 0.0], 0.0).unwrap_err();
        assert_eq!(error.to_string(), "intrinsics.focal_px[0] is 0, outside 50 to 20000");
        let high = Calibration::from_ground_plane(&INTRINSICS, [0.0, 1.0, 0.0, -60.0], [0.0, 0.0], 0.0).unwrap_err();
        assert_eq!(high.to_string(), "mount.height_m is 60, outside 0.1 to 20");
    }
}
