//! Road to image and back, in integers.
//!
//! Image coordinates are tangents from the optical axis, + left and + up, so that a left edge is greater than a
//! right one. Places are of the levelled frame (see [`crate::sensor::mount`]), centimetres, heights above the road.

use crate::camera::boxes::SUBPIXELS;
use crate::camera::calibration::Calibration;
use crate::fixed::math;
use crate::sensor::config::ConfigError;
use crate::sensor::mount::Levelling;

/// One, in the scale of tangents.
const TANGENT: i32 = 1 << 16;

/// Scale of the rotation.
const ROTATION_BITS: u32 = 20;

/// Nearest distance ahead that is projected: 50 cm, 2^-4.
const NEAREST: i32 = 50 << 4;

/// Farthest place on the road that a pixel is taken to show, centimetres.
const FARTHEST_CM: i32 = 60_000;

/// A checked calibration.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    pub(crate) levelling: Levelling,
    pub(crate) height_cm: i32,
    /// Rows: levelled x, y, z; columns: ahead, left, up; 2^-20.
    rotation: [[i32; 3]; 3],
    /// Tangent of a sixteenth of a pixel, 2^-32, u and v.
    step: [i32; 2],
    /// The optical axis, sixteenths of a pixel.
    center: [i32; 2],
    /// Width and height of the image, sixteenths of a pixel.
    pub(crate) size: [i32; 2],
    /// The image's left, top, right and bottom border, tangents.
    pub(crate) border: [i32; 4],
}

impl Projection {
    /// # Errors
    /// Names the parameter outside its limits.
    pub(crate) fn new(calibration: &Calibration) -> Result<Self, ConfigError> {
        let Calibration { intrinsics: i, mount } = calibration;
        i.check()?;
        let levelling = mount.levelling()?;
        let (pitch, roll) = (mount.pitch_deg.to_radians(), mount.roll_deg.to_radians());
        let (sp, cp, sr, cr) = (math::sin(pitch), math::cos(pitch), math::sin(roll), math::cos(roll));
        let rows = [[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]];
        let mut projection = Self {
            levelling,
            height_cm: levelling.height_cm,
            rotation: rows.map(|row| row.map(|v| math::round_i32(v * (1 << ROTATION_BITS) as f32))),
            step: i.focal_px.map(|f| math::round_i32(4_294_967_296.0 / (SUBPIXELS as f32 * f))),
            center: i.center_px.map(|c| math::round_i32(c * SUBPIXELS as f32)),
            size: i.size_px.map(|side| i32::from(side) * SUBPIXELS),
            border: [0; 4],
        };
        let [width, height] = projection.size;
        projection.border = projection.tangents_of([0, 0, width, height]);
        Ok(projection)
    }

    /// Edges in sixteenths of a pixel (left, top, right, bottom) as tangents.
    pub(crate) fn tangents_of(&self, [l, t, r, b]: [i32; 4]) -> [i32; 4] {
        let of = |at: i32, center: i32, step: i32| math::mul_shift(center.saturating_sub(at), step, 16);
        let u = |at| of(at, self.center[0], self.step[0]);
        let v = |at| of(at, self.center[1], self.step[1]);
        [u(l), v(t), u(r), v(b)]
    }

    /// Sixteenths of a pixel as a tangent, along v.
    pub(crate) fn tangent_of_rows(&self, subpixels: i32) -> i32 {
        math::mul_shift(subpixels, self.step[1], 16)
    }

    /// Levelled direction of an image point, 2^-16.
    #[allow(clippy::cast_possible_truncation)] // tangents below 82: 8192 pixels over a focal length of 100
    pub(crate) fn ray(&self, left: i32, up: i32) -> [i32; 3] {
        self.rotation.map(|[a, l, u]| {
            let sum = i64::from(a) * i64::from(TANGENT) + i64::from(l) * i64::from(left) + i64::from(u) * i64::from(up);
            (sum >> ROTATION_BITS) as i32
        })
    }

    /// A vector's components ahead, left and up as levelled ones, for start-up tables.
    pub(crate) fn level(&self, [ahead, left, up]: [f32; 3]) -> [f32; 3] {
        self.rotation
            .map(|[a, l, u]| (a as f32 * ahead + l as f32 * left + u as f32 * up) / (1 << ROTATION_BITS) as f32)
    }

    /// Where an image point lies if it is this high above the road; `None` at and beyond the horizon.
    pub(crate) fn on_plane(&self, [left, up]: [i32; 2], height_cm: i32) -> Option<[i32; 2]> {
        let [x, y, z] = self.ray(left, up);
        let fall = self.height_cm - height_cm;
        // the ray falls where the camera is above the plane
        let (fall, steep) = if fall >= 0 { (fall, -z) } else { (-fall, z) };
        // 32 bits: farther than the farthest in two steps of this is beyond the horizon
        if steep <= 0 || i64::from(fall) * i64::from(TANGENT) > i64::from(steep) * i64::from(FARTHEST_CM) {
            return None;
        }
        let reach = |d: i32| math::mul_shift(d, math::ratio::<8>(fall << 8, steep), 16);
        let place = [reach(x), reach(y)];
        place.iter().all(|v| v.abs() <= FARTHEST_CM).then_some(place)
    }

    /// Components ahead, left and up of a levelled vector from the camera; 2^-4.
    #[allow(clippy::cast_possible_truncation)] // a turned vector keeps its length
    pub(crate) fn towards(&self, [x, y, z]: [i32; 3]) -> [i32; 3] {
        let [[ax, lx, ux], [ay, ly, uy], [az, lz, uz]] = self.rotation;
        let of = |a: i32, b: i32, c: i32| {
            let sum = i64::from(a) * i64::from(x) + i64::from(b) * i64::from(y) + i64::from(c) * i64::from(z);
            (sum >> (ROTATION_BITS - 4)) as i32
        };
        [of(ax, ay, az), of(lx, ly, lz), of(ux, uy, uz)]
    }

    /// Tangents left and up of a vector's components, of any scale from 2^-4; `None` behind the camera.
    pub(crate) fn tangents([ahead, left, up]: [i32; 3]) -> Option<[i32; 2]> {
        (ahead >= NEAREST).then(|| [math::ratio::<16>(left, ahead), math::ratio::<16>(up, ahead)])
    }

    /// Whether a place of the levelled frame is in the image.
    pub(crate) fn in_image(&self, [x, y, height]: [i32; 3]) -> bool {
        let [l, t, r, b] = self.border;
        Self::tangents(self.towards([x, y, height - self.height_cm]))
            .is_some_and(|[left, up]| left <= l && left >= r && up <= t && up >= b)
    }
}

/// Plain double precision, for tests.
#[cfg(test)]
pub(crate) mod exact {
    use crate::camera::calibration::Calibration;

    /// Pixel of a point of the road frame, metres; `None` behind the camera.
    pub(crate) fn pixel(calibration: &Calibration, point: [f64; 3]) -> Option<[f64; 2]> {
        let (i, m) = (&calibration.intrinsics, &calibration.mount);
        let (sy, cy) = f64::from(m.yaw_deg).to_radians().sin_cos();
        let (sp, cp) = f64::from(m.pitch_deg).to_radians().sin_cos();
        let (sr, cr) = f64::from(m.roll_deg).to_radians().sin_cos();
        let [x, y, z] = [point[0] - f64::from(m.x_m), point[1] - f64::from(m.y_m), point[2] - f64::from(m.height_m)];
        // undo yaw, then pitch, then roll
        let (x, y) = (cy * x + sy * y, cy * y - sy * x);
        let (x, z) = (cp * x - sp * z, sp * x + cp * z);
        let (y, z) = (cr * y + sr * z, cr * z - sr * y);
        let of = |k: usize, side: f64| f64::from(i.center_px[k]) - f64::from(i.focal_px[k]) * side / x;
        (x > 0.0).then(|| [of(0, y), of(1, z)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::calibration::Intrinsics;
    use crate::sensor::mount::Mount;

    fn calibration(yaw_deg: f32, pitch_deg: f32, roll_deg: f32) -> Calibration {
        let intrinsics = Intrinsics { size_px: [1920, 1080], focal_px: [1600.0, 1600.0], center_px: [960.0, 540.0] };
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg, pitch_deg, roll_deg };
        Calibration { intrinsics, mount }
    }

    fn projection(yaw_deg: f32, pitch_deg: f32, roll_deg: f32) -> Projection {
        Projection::new(&calibration(yaw_deg, pitch_deg, roll_deg)).unwrap()
    }

    #[test]
    fn left_is_a_smaller_column_and_near_a_greater_row() {
        let pixel = |yaw, pitch, roll, point| exact::pixel(&calibration(yaw, pitch, roll), point);
        // 1600 px at 50 m: 32 px a metre; the road lies 6 m below
        assert_eq!(pixel(0.0, 0.0, 0.0, [50.0, 10.0, 0.0]), Some([960.0 - 320.0, 540.0 + 192.0]));
        assert_eq!(pixel(0.0, 0.0, 0.0, [50.0, -10.0, 6.0]), Some([960.0 + 320.0, 540.0]));
        assert_eq!(pixel(0.0, 0.0, 0.0, [-50.0, 0.0, 0.0]), None);
        let ahead = [50.0, 0.0, 0.0];
        assert!(pixel(0.0, 6.0, 0.0, ahead).unwrap()[1] < 732.0, "looking down lifts the road in the image");
        assert!(pixel(10.0, 0.0, 0.0, ahead).unwrap()[0] > 1200.0, "turned left, ahead is to the right");
        assert!(pixel(0.0, 0.0, 5.0, ahead).unwrap()[0] > 975.0, "left side up, the road below swings to the right");
    }

    #[test]
    fn integers_see_what_double_precision_sees() {
        for (yaw, pitch, roll) in [(0.0, 0.0, 0.0), (15.0, 6.0, 0.0), (-20.0, 12.0, -4.0)] {
            let (c, p) = (calibration(yaw, pitch, roll), projection(yaw, pitch, roll));
            for point in [[20.0, 3.0, 0.0], [50.0, -9.0, 4.0], [150.0, 20.0, 1.5], [190.0, -15.0, 0.0]] {
                let Some([u, v]) = exact::pixel(&c, point) else { continue };
                let road = crate::sensor::road::RoadPoint::from_metres(point[0] as f32, point[1] as f32).unwrap();
                let (x, y) = p.levelling.place(road);
                let [left, up] =
                    Projection::tangents(p.towards([x, y, (point[2] * 100.0) as i32 - p.height_cm])).unwrap();
                let got = [960.0 - f64::from(left) / 65536.0 * 1600.0, 540.0 - f64::from(up) / 65536.0 * 1600.0];
                // places are rounded to centimetres: 0.8 px at 20 m
                let off = 0.1 + 16.0 / point[0];
                assert!((got[0] - u).abs() < off && (got[1] - v).abs() < off, "{point:?}: {got:?} for {u} {v}");
            }
        }
    }

    #[test]
    fn a_pixel_leads_back_to_its_place_at_any_height() {
        for (pitch, roll) in [(0.0, 0.0), (6.0, 0.0), (12.0, -4.0)] {
            let p = projection(0.0, pitch, roll);
            for (x, y, z) in [(2000, 300, 0), (5000, -900, 0), (15_000, 2000, 150), (9000, 0, 400), (19_000, 1500, 0)] {
                let [left, up] = Projection::tangents(p.towards([x, y, z - 600])).unwrap();
                let [gx, gy] = p.on_plane([left, up], z).unwrap();
                // two steps of 2^-16 in slope, over the height the ray falls
                let off = 2 + 2 * (x / 100) * (x / 100) * 100 / (65_536 / 100 * (600 - z));
                assert!((gx - x).abs() <= off && (gy - y).abs() <= 2 + off / 5, "{x} {y} {z}: {gx} {gy}");
            }
        }
    }

    #[test]
    fn the_horizon_and_what_is_above_show_no_road() {
        let p = projection(0.0, 0.0, 0.0);
        assert_eq!(p.on_plane([0, 0], 0), None);
        assert_eq!(p.on_plane([0, 1000], 0), None);
        assert!(p.on_plane([0, -1000], 0).is_some());
        assert!(p.on_plane([0, 1000], 700).is_some(), "a plane above the camera is seen above the horizon");
        assert_eq!(p.on_plane([0, -1000], 700), None);
    }

    #[test]
    fn the_image_ends_at_its_border() {
        let p = projection(0.0, 0.0, 0.0);
        // 960 px of 1600: 0.6
        assert!(p.in_image([1000, 599, 600]) && !p.in_image([1000, 602, 600]));
        assert!(p.in_image([1000, -599, 600]) && !p.in_image([1000, -602, 600]));
        assert!(p.in_image([2000, 0, 0]) && !p.in_image([1700, 0, 0]), "the near road is below the image");
    }
}
