//! A camera: the 2D boxes a detector would put around what it sees of the vehicles.
//!
//! [`Camera::view`] projects and finds what is not hidden, exactly; [`detector`] errs like a detector.
//! Pixels count from the upper left corner, u to the right, v down; the camera looks along its x axis
//! (REP-103), the optical frame with z ahead is written beside it.

pub mod detector;

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use crate::geometry::pose::SensorPose;
use crate::geometry::sight::{Uncovered, uncovered_outlines};
use crate::geometry::solid::Solid;
use crate::recording::camera::{Box2d, Intrinsics};
use detector::DetectorModel;

/// A mounted camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub pose: SensorPose,
    pub intrinsics: Intrinsics,
    pub model: DetectorModel,
}

/// What is seen of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Index of the object.
    pub object: usize,
    /// Around what is visible, pixels: left, top, right, bottom.
    pub edges: [f64; 4],
    /// Visible share of its outline, what lies outside of the image included.
    pub share: f64,
}

impl Camera {
    /// What is visible of each object past all others (and past `screens`, which are not objects).
    pub fn view(&self, objects: &[Solid], screens: &[Solid]) -> Vec<Sighting> {
        let seen = uncovered_outlines(&self.pose, objects, screens, &self.intrinsics.frame());
        let sighting = |s: &Uncovered| {
            let ([l, t], [r, b]) = (self.intrinsics.pixel(s.high), self.intrinsics.pixel(s.low));
            Sighting { object: s.object, edges: [l, t, r, b], share: s.share }
        };
        seen.iter().map(sighting).collect()
    }
}

/// An object to be looked at: what it is called and where it stands.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    pub class: &'a str,
    pub solid: Solid,
}

/// How a scene writes a camera's image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    pub width_px: u32,
    pub height_px: u32,
    /// Horizontal angle of view of square pixels around the optical axis; or the calibration of a camera there is.
    pub view_deg: Option<f64>,
    /// Focal length along u and v, and where the optical axis meets the image.
    pub focal_px: Option<[f64; 2]>,
    pub center_px: Option<[f64; 2]>,
}

impl Image {
    /// # Errors
    /// Neither an angle of view nor a calibration, both, or figures no camera has.
    pub fn check(&self) -> Result<()> {
        for (name, side) in [("width_px", self.width_px), ("height_px", self.height_px)] {
            ensure!((16..=20_000).contains(&side), "image.{name} is {side}, it must lie in 16 to 20000");
        }
        match (self.view_deg, self.focal_px, self.center_px) {
            (Some(view_deg), None, None) => {
                ensure!((1.0..=170.0).contains(&view_deg), "image.view_deg is {view_deg}, it must lie in 1 to 170");
            }
            (None, Some(focal), Some(center)) => {
                let within = |v: f64, low: f64, high: f64| (low..=high).contains(&v);
                ensure!(focal.iter().all(|f| within(*f, 50.0, 20_000.0)), "image.focal_px must lie in 50 to 20000");
                let inside = within(center[0], 1.0, f64::from(self.width_px))
                    && within(center[1], 1.0, f64::from(self.height_px));
                ensure!(inside, "image.center_px lies outside of the image");
            }
            _ => bail!("image: give view_deg, or focal_px and center_px of a camera there is"),
        }
        Ok(())
    }

    pub fn intrinsics(&self) -> Intrinsics {
        let size_px = [self.width_px, self.height_px];
        if let (Some(focal_px), Some(center_px)) = (self.focal_px, self.center_px) {
            return Intrinsics { size_px, focal_px, center_px };
        }
        let half_rad = (self.view_deg.unwrap_or(90.0) / 2.0).to_radians();
        Intrinsics::centred(size_px, f64::from(self.width_px) / 2.0 / half_rad.tan())
    }
}

impl Camera {
    /// The boxes of one frame.
    pub fn detect(&self, targets: &[Target], screens: &[Solid], seed: u64, number: u64) -> Vec<Box2d> {
        let solids: Vec<Solid> = targets.iter().map(|t| t.solid).collect();
        let sightings = self.view(&solids, screens);
        detector::detect(self, &sightings, targets, seed, number)
    }
}

#[cfg(test)]
pub mod made_up {
    use super::*;

    /// At 6 m, level, 60 degrees wide.
    pub fn camera() -> Camera {
        Camera {
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            intrinsics: Intrinsics::centred([1920, 1080], 960.0 / 30.0_f64.to_radians().tan()),
            model: DetectorModel::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::made_up::camera;
    use super::*;

    fn solid(x: f64, y: f64, size: [f64; 3]) -> Solid {
        Solid { center: [x, y, size[2] / 2.0], yaw_rad: 0.0, size }
    }

    #[test]
    fn an_image_is_an_angle_of_view_or_a_calibration() {
        let image = |text: &str| toml::from_str::<Image>(text).map_err(anyhow::Error::from);
        let size = "width_px = 1920\nheight_px = 1200\n";
        let checked = |text: &str| image(&format!("{size}{text}")).and_then(|i| i.check().map(|()| i.intrinsics()));
        assert_eq!(checked("view_deg = 90.0").unwrap().focal_px.map(f64::round), [960.0; 2]);
        let real = checked("focal_px = [2788.9, 2783.3]\ncenter_px = [907.8, 589.1]").unwrap();
        assert_eq!((real.focal_px[1], real.center_px[0]), (2783.3, 907.8));
        let error = |text: &str| format!("{:#}", checked(text).unwrap_err());
        assert!(error("").contains("give view_deg, or focal_px and center_px"));
        assert!(error("view_deg = 60.0\nfocal_px = [1000.0, 1000.0]").contains("give view_deg, or"));
        assert!(error("focal_px = [1.0, 1.0]\ncenter_px = [900.0, 600.0]").contains("50 to 20000"));
        assert!(error("focal_px = [1e3, 1e3]\ncenter_px = [2000.0, 600.0]").contains("outside of the image"));
        assert!(error("view_deg = 180.0").contains("image.view_deg is 180, it must lie in 1 to 170"));
    }

    #[test]
    fn left_is_left_and_down_is_down() {
        let seen = camera().view(&[solid(50.0, 10.0, [4.0, 2.0, 1.5])], &[]);
        let [left, top, right, bottom] = seen[0].edges;
        assert!(right < 960.0 && top > 540.0 && left < right && top < bottom);
        // focal length 960 / tan(30) = 1663 px; the rear face at 48 m: v = 540 + 1663 x 6 / 48
        assert!((bottom - (540.0 + 1662.8 * 6.0 / 48.0)).abs() < 0.1, "{bottom}");
        assert!((left - (960.0 - 1662.8 * 11.0 / 48.0)).abs() < 0.1, "{left}");
        assert_eq!(seen[0].share, 1.0);
    }

    #[test]
    fn the_box_goes_around_what_is_visible_only() {
        let car = solid(60.0, 0.0, [4.0, 2.0, 1.5]);
        let wall = solid(50.0, 1.0, [1.0, 2.0, 10.0]);
        let free = camera().view(&[car], &[])[0];
        let half = camera().view(&[car], &[wall])[0];
        assert!(half.share < 0.6 && half.share > 0.3, "{}", half.share);
        assert!(half.edges[0] > free.edges[0] + 10.0 && half.edges[2] == free.edges[2], "its left half is hidden");
        assert!(camera().view(&[car], &[solid(50.0, 0.0, [1.0, 6.0, 10.0])]).is_empty());
    }

    #[test]
    fn an_object_half_outside_ends_at_the_border() {
        // the border is at 30 degrees: y = 0.577 x
        let seen = camera().view(&[solid(40.0, 22.5, [4.0, 2.0, 1.5])], &[]);
        assert_eq!(seen[0].edges[0], 0.0);
        assert!(seen[0].share < 1.0);
        assert!(camera().view(&[solid(-40.0, 0.0, [4.0, 2.0, 1.5])], &[]).is_empty(), "behind");
    }
}
