//! Detections placed on the ground of the levelled frame.
//!
//! A detection marks a reflection point of something standing on the road. Its measured elevation
//! is noisy (1 degree is 2.6 m at 150 m), so the *place* is taken where range and azimuth meet a
//! usual reflector height, and the *height* is kept beside it as measured.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction, ONE};
use crate::frame::detection::Detection;
use crate::sensor::ground::Ground;
use crate::sensor::mount::Levelling;
use crate::sensor::noise::Noise;

/// A reflection point on the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reflection {
    /// Place in the levelled frame, centimetres.
    pub x_cm: i32,
    /// Place in the levelled frame, centimetres, + left.
    pub y_cm: i32,
    /// Distance along the ground, centimetres.
    pub ground_cm: u16,
    /// Ground components of the unit line of sight (shorter than one where it points down).
    pub sight: Direction,
    /// Radial velocity, cm/s, + receding.
    pub radial_velocity_cm_s: i16,
    /// Standard deviation across the line of sight, centimetres.
    pub across_cm: u16,
    /// Measured height above the road and its standard deviation, centimetres.
    pub height_cm: Option<(i16, u16)>,
    /// Radar cross section, half dBsm, where the radar measures it.
    pub rcs_half_dbsm: Option<i16>,
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // unit vectors within 2^14, lengths clamped
impl Noise {
    /// Places a detection on flat ground, with its height where its elevation was measured.
    pub fn place(&self, d: &Detection, levelling: &Levelling) -> Reflection {
        self.place_on(d, levelling, &Ground::LEVEL)
    }

    /// Places a detection on the ground, with its height where its elevation was measured.
    pub fn place_on(&self, d: &Detection, levelling: &Levelling, ground: &Ground) -> Reflection {
        let azimuth = trig::direction(d.azimuth);
        let mut placed = self.place_along(d, azimuth, levelling, 0);
        let mut foot_cm = 0;
        if !ground.is_level() {
            // what lies higher is a little farther along the ground, where the road is not much higher again
            foot_cm = ground.height_cm(placed.x_cm, placed.y_cm);
            placed = self.place_along(d, azimuth, levelling, foot_cm);
            foot_cm = ground.height_cm(placed.x_cm, placed.y_cm);
        }
        let height_cm = d.elevation.map(|elevation| self.height(d, azimuth, elevation, levelling, foot_cm));
        Reflection { height_cm, ..placed }
    }

    /// Places a detection on flat ground, its height left open.
    pub fn place_flat(&self, d: &Detection, levelling: &Levelling) -> Reflection {
        self.place_along(d, trig::direction(d.azimuth), levelling, 0)
    }

    /// At the height of usual reflectors above ground of the height `foot_cm`.
    fn place_along(&self, d: &Detection, azimuth: Direction, levelling: &Levelling, foot_cm: i32) -> Reflection {
        let range = i32::from(d.range_cm);
        // the half-plane of this azimuth, levelled: ahead (elevation 0) and up
        let ahead = levelling.level([i32::from(azimuth.x), i32::from(azimuth.y), 0]);
        let up = levelling.up();
        let fall = ((self.reflector_height_cm + foot_cm - levelling.height_cm) << 14) / range.max(1);
        let (cosine, sine) = meet_height(fall, ahead[2], up[2]);
        let (x, y) = ((ahead[0] * cosine + up[0] * sine) >> 14, (ahead[1] * cosine + up[1] * sine) >> 14);
        let (x_cm, y_cm) = ((x * range) >> 14, (y * range) >> 14);
        Reflection {
            x_cm,
            y_cm,
            ground_cm: math::length(x_cm, y_cm) as u16,
            sight: Direction { x: x as i16, y: y as i16 },
            radial_velocity_cm_s: d.radial_velocity_cm_s,
            across_cm: math::mul_shift(range, self.azimuth, 16).clamp(1, 65_535) as u16,
            height_cm: None,
            rcs_half_dbsm: d.rcs_half_dbsm,
        }
    }

    /// Height above the road and its standard deviation, centimetres.
    fn height(
        &self,
        d: &Detection,
        azimuth: Direction,
        elevation: Angle,
        levelling: &Levelling,
        foot_cm: i32,
    ) -> (i16, u16) {
        let range = i32::from(d.range_cm);
        let up = trig::direction(elevation);
        let level = |part: i16| (i32::from(part) * i32::from(up.x)) >> 14;
        let rise = levelling.rise([level(azimuth.x), level(azimuth.y), i32::from(up.y)]);
        let height = levelling.height_cm - foot_cm + ((rise * range) >> 14);
        let sigma = math::mul_shift(range, self.elevation, 16);
        (height.clamp(-30_000, 30_000) as i16, sigma.clamp(1, 65_535) as u16)
    }
}

impl Reflection {
    /// Levelled azimuth.
    pub fn bearing(&self) -> Angle {
        trig::bearing(self.x_cm, self.y_cm)
    }
}

/// Cosine and sine of the elevation at which a half-plane meets a height: ahead cos + up sin = fall,
/// all 2^-14; straight up or down where it never does.
#[allow(clippy::cast_possible_wrap, clippy::cast_sign_loss, clippy::cast_possible_truncation)] // squares of 2^14 fit
fn meet_height(fall: i32, ahead: i32, up: i32) -> (i32, i32) {
    let square = (ahead * ahead + up * up).max(1);
    let fall = fall.clamp(-ONE, ONE);
    let (fall, rest) = match square - fall * fall {
        rest @ 0.. => (fall, math::root(rest.unsigned_abs()) as i32),
        _ => (fall.signum() * math::root(square.unsigned_abs()) as i32, 0),
    };
    let scaled = |v: i32| (v / (square >> 14).max(1)).clamp(-ONE, ONE);
    (scaled(ahead * fall + up * rest), scaled(up * fall - ahead * rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::mount::Mount;
    use crate::sensor::noise::NoiseConfig;
    #[cfg(feature = "ground")]
    use crate::sensor::site::Points;

    fn place(range_m: f32, azimuth_deg: f32, elevation_deg: Option<f32>, pitch_deg: f32) -> Reflection {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg, roll_deg: 0.0 };
        let d = Detection {
            range_cm: (range_m * 100.0) as u16,
            azimuth: Angle::from_degrees(azimuth_deg),
            elevation: elevation_deg.map(Angle::from_degrees),
            radial_velocity_cm_s: 100,
            rcs_half_dbsm: None,
            snr_half_db: Some(30),
            marked: false,
        };
        let (noise, levelling) = (NoiseConfig::default().noise().unwrap(), mount.levelling().unwrap());
        noise.place(&d, &levelling)
    }

    #[test]
    fn a_reflection_lies_at_reflector_height_under_its_azimuth() {
        let r = place(100.0, 30.0, None, 0.0);
        // sqrt(100^2 - 5.2^2) = 99.86 m along the ground
        assert!((i32::from(r.ground_cm) - 9986).abs() <= 3, "{r:?}");
        assert!((r.x_cm - 8648).abs() <= 5 && (r.y_cm - 4993).abs() <= 5, "{r:?}");
        assert_eq!(r.height_cm, None);
        assert!((i32::from(r.across_cm) - 87).abs() <= 1, "half a degree at 100 m");
    }

    #[test]
    fn pitch_turns_the_line_of_sight_and_not_the_place() {
        let level = place(60.0, 40.0, None, 0.0);
        let down = place(60.0, 40.0, None, 4.0);
        assert!(level.ground_cm.abs_diff(down.ground_cm) <= 5);
        // looking down, the same sensor azimuth meets the ground a little farther out
        assert!(down.bearing().raw() > level.bearing().raw());
        assert!((down.bearing().raw() - level.bearing().raw()) < 80);
    }

    #[test]
    fn elevation_up_is_height_up() {
        let (up, _) = place(100.0, 0.0, Some(-1.0), 0.0).height_cm.unwrap();
        let (down, sigma) = place(100.0, 0.0, Some(-3.0), 0.0).height_cm.unwrap();
        assert!((up - (600 - 175)).abs() <= 3 && (down - (600 - 523)).abs() <= 3, "{up} {down}");
        assert!(sigma.abs_diff(174) <= 1);
        let (pitched, _) = place(100.0, 0.0, Some(0.0), 3.0).height_cm.unwrap();
        assert!((pitched - (600 - 523)).abs() <= 3, "nose down lowers the axis: {pitched}");
    }

    #[cfg(feature = "ground")]
    #[test]
    fn heights_are_above_a_road_that_climbs_or_falls() {
        for (yaw_deg, grade) in [(0.0, 0.04), (0.0, -0.04), (180.0, 0.04)] {
            let mount = Mount { x_m: 30.0, y_m: 0.0, height_m: 6.0, yaw_deg, pitch_deg: 2.0, roll_deg: 0.0 };
            let levelling = mount.levelling().unwrap();
            let ground =
                Ground::new(&levelling, Points::Metres(&[[-200.0, -200.0 * grade], [200.0, 200.0 * grade]])).unwrap();
            // a plate 0.8 m above the road 100 m ahead
            let climb = f64::from(grade) * if yaw_deg == 0.0 { 100.0 } else { -100.0 };
            let rise = climb + 0.8 - 6.0;
            let d = Detection {
                range_cm: (100.0_f64.hypot(rise) * 100.0).round() as u16,
                azimuth: Angle::ZERO,
                elevation: Some(Angle::from_degrees((rise.atan2(100.0).to_degrees() + 2.0) as f32)),
                radial_velocity_cm_s: 100,
                rcs_half_dbsm: None,
                snr_half_db: Some(30),
                marked: false,
            };
            let r = NoiseConfig::default().noise().unwrap().place_on(&d, &levelling, &ground);
            assert!((i32::from(r.ground_cm) - 10_000).abs() <= 3, "{grade}: {r:?}");
            let (height, _) = r.height_cm.unwrap();
            assert!((height - 80).abs() <= 4, "{yaw_deg} {grade}: {height} cm");
        }
    }

    #[test]
    fn a_range_shorter_than_the_mast_lies_below_the_sensor() {
        let r = place(4.0, 20.0, None, 0.0);
        assert!(r.ground_cm < 20, "{r:?}");
    }
}
