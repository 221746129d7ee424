//! What a 2D detector makes of what is visible: misses, pixel noise, merged boxes, false boxes.
//!
//! # Model
//! The probability of a box is a logistic function of the logarithm of the visible height, times a ramp of
//! the visible share; edges err by a constant and a share of the box; boxes that overlap too much are put
//! out as one around both.
//!
//! # Where the numbers come from
//! `viewshed detect --tiles 2` with a small CenterNet (MobileNetV3, 512 x 512) on four roadside pictures of 1920 x 1080
//! with labels: one of a crossing (Rope3D) and three of a motorway (BrnoCompSpeed), 29 vehicles at 16 to 170 m, all
//! found. The threshold of the score, 0.3, was chosen on these pictures.
//! - Misses by height: each vehicle in each view of it, the whole picture and tiles of four sizes, 182 in all. Of free
//!   ones none of 5 was found below 12 px of the network's input, 20 of 22 from 12 to 24 px, 127 of 130 above; the
//!   likeliest curve is half at 13 px, 0.25 wide. A tile of 618 px is shrunk to 512: 16 px of the picture.
//! - By visible share: partly hidden ones, of which 53 to 97 % shows, were found in 18 of 20 views above 24 px: a ramp
//!   that reaches one at 0.7. None shows less: where it begins is a guess.
//! - Edges: free vehicles, 88 edges, by likelihood; the systematic part, which `--bottom-offset` takes away, left out.
//! - Overlap of two boxes: the default of `--same`. The real one leaves the surer of the two instead.
//! - False boxes: 2 in four pictures (a road sign, a taxi's sign), with scores below 0.35. Eleven more boxes were
//!   around vehicles without a label.
//!
//! # References
//! - D. Hoiem, Y. Chodpathumwan, Q. Dai, "Diagnosing Error in Object Detectors", ECCV 2012: size and
//!   occlusion decide.
//! - A. Geiger, P. Lenz, R. Urtasun, "Are we ready for Autonomous Driving? The KITTI Vision Benchmark Suite",
//!   CVPR 2012: heights of 25 and 40 px as limits of hard and easy.
//! - P. Felzenszwalb et al., "Object Detection with Discriminatively Trained Part-Based Models", TPAMI 2010:
//!   overlap of 50 % at which boxes are taken for one.

use anyhow::{Result, ensure};
use serde::{Deserialize, Serialize};

use super::{Camera, Sighting, Target};
use crate::recording::camera::Box2d;
use crate::twin::random::{Dice, Use};

/// How a detector errs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorModel {
    /// Probability of a large, free object.
    pub best: f64,
    /// Visible height at which half of that is left, pixels.
    pub half_height_px: f64,
    /// Width of the fall around it, in natural logarithms of height.
    pub fall: f64,
    /// Visible share up to which nothing is found, and from which on all is as if free.
    pub share: [f64; 2],
    /// Error of an edge: pixels, and share of the box's side (standard deviations).
    pub noise_px: f64,
    pub noise_share: f64,
    /// Overlap (intersection over union) from which two boxes are one.
    pub merge_overlap: f64,
    /// Mean number of boxes around nothing, a frame.
    pub false_boxes: f64,
}

impl Default for DetectorModel {
    fn default() -> Self {
        Self {
            best: 0.98,
            half_height_px: 16.0,
            fall: 0.25,
            share: [0.1, 0.7],
            noise_px: 2.7,
            noise_share: 0.035,
            merge_overlap: 0.45,
            false_boxes: 0.5,
        }
    }
}

impl DetectorModel {
    /// # Errors
    /// The first parameter outside its limits, by name.
    pub fn check(&self) -> Result<()> {
        let limits = [
            ("best", self.best, 0.0, 1.0),
            ("half_height_px", self.half_height_px, 1.0, 1000.0),
            ("fall", self.fall, 0.01, 10.0),
            ("share[0]", self.share[0], 0.0, 1.0),
            ("share[1]", self.share[1], self.share[0] + 1e-6, 1.0),
            ("noise_px", self.noise_px, 0.0, 100.0),
            ("noise_share", self.noise_share, 0.0, 0.5),
            ("merge_overlap", self.merge_overlap, 0.01, 1.0),
            ("false_boxes", self.false_boxes, 0.0, 100.0),
        ];
        for (name, value, low, high) in limits {
            ensure!((low..=high).contains(&value), "detector.{name} is {value}, it must lie in {low} to {high}");
        }
        Ok(())
    }

    fn probability(&self, height_px: f64, share: f64) -> f64 {
        let size = 1.0 / (1.0 + (-(height_px / self.half_height_px).ln() / self.fall).exp());
        let free = ((share - self.share[0]) / (self.share[1] - self.share[0])).clamp(0.0, 1.0);
        self.best * size * free
    }
}

/// Least side of a box, pixels.
const SMALLEST_PX: f64 = 4.0;

/// The boxes of one frame, in the order of the objects, false ones last.
pub fn detect(camera: &Camera, seen: &[Sighting], targets: &[Target], seed: u64, number: u64) -> Vec<Box2d> {
    let mut dice = Dice::new(seed, Use::CameraFrame, number);
    let (model, image) = (&camera.model, &camera.intrinsics);
    let limits = image.size_px.map(f64::from);
    let mut boxes: Vec<Box2d> = Vec::new();
    for sighting in seen {
        // five draws an object, found or not
        let found = dice.uniform();
        let errors = [dice.normal(), dice.normal(), dice.normal(), dice.normal()];
        let [l, t, r, b] = sighting.edges;
        let probability = model.probability(b - t, sighting.share);
        if found >= probability {
            continue;
        }
        let sides = [r - l, b - t];
        let edge = |k: usize| {
            let error = errors[k] * model.noise_px.hypot(model.noise_share * sides[k % 2]);
            (sighting.edges[k] + error).clamp(0.0, limits[k % 2])
        };
        let edges = [edge(0), edge(1), edge(2), edge(3)];
        if edges[2] - edges[0] >= SMALLEST_PX && edges[3] - edges[1] >= SMALLEST_PX {
            boxes.push(Box2d { class: targets[sighting.object].class.to_owned(), score: probability, edges });
        }
    }
    let mut boxes = merge(boxes, model.merge_overlap);
    for _ in 0..dice.poisson(model.false_boxes) {
        let sides = [dice.between(10.0, 80.0), dice.between(10.0, 60.0)];
        let corner = [0, 1].map(|k| dice.between(0.0, (limits[k] - sides[k]).max(1.0)));
        let edges = [corner[0], corner[1], corner[0] + sides[0], corner[1] + sides[1]];
        boxes.push(Box2d { class: "car".into(), score: dice.between(0.3, 0.6), edges });
    }
    boxes
}

/// Joins boxes that overlap too much, until none do; the greater gives the class.
fn merge(mut boxes: Vec<Box2d>, overlap: f64) -> Vec<Box2d> {
    let mut k = 0;
    while k < boxes.len() {
        let Some(other) = (k + 1..boxes.len()).find(|&i| boxes[k].overlap(&boxes[i]) > overlap) else {
            k += 1;
            continue;
        };
        let other = boxes.remove(other);
        let own = &mut boxes[k];
        if other.area() > own.area() {
            own.class = other.class;
        }
        own.score = own.score.max(other.score);
        own.edges = [
            own.edges[0].min(other.edges[0]),
            own.edges[1].min(other.edges[1]),
            own.edges[2].max(other.edges[2]),
            own.edges[3].max(other.edges[3]),
        ];
        k = 0;
    }
    boxes
}

#[cfg(test)]
mod tests {
    use super::super::made_up::camera;
    use super::*;
    use crate::geometry::solid::Solid;

    fn car(x: f64, y: f64) -> Target<'static> {
        Target { class: "car", solid: Solid { center: [x, y, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] } }
    }

    fn found(targets: &[Target], screens: &[Solid]) -> f64 {
        let camera = camera();
        (0..500).map(|n| camera.detect(targets, screens, 1, n).iter().filter(|b| b.score > 0.6).count()).sum::<usize>()
            as f64
            / 500.0
    }

    #[test]
    fn misses_grow_with_distance_and_occlusion() {
        let near = found(&[car(40.0, 0.0)], &[]);
        assert!((near - 0.98).abs() < 0.03, "{near}");
        assert!(camera().model.probability(16.0, 1.0) < 0.5 && camera().model.probability(8.0, 1.0) < 0.1);
        let wall = Solid { center: [35.0, 0.55, 5.0], yaw_rad: 0.0, size: [1.0, 1.6, 10.0] };
        let sighting = camera().view(&[car(40.0, 0.0).solid], &[wall])[0];
        assert!(camera().model.probability(60.0, sighting.share) < 0.7, "{}", sighting.share);
    }

    #[test]
    fn boxes_one_behind_the_other_are_one() {
        let edges = |l, t, r, b| Box2d { class: "car".into(), score: 0.9, edges: [l, t, r, b] };
        let apart = vec![edges(0.0, 0.0, 10.0, 10.0), edges(8.0, 0.0, 18.0, 10.0)];
        assert_eq!(merge(apart, 0.5).len(), 2);
        let mut truck = edges(0.0, -6.0, 12.0, 10.0);
        truck.class = "truck".into();
        let joined = merge(vec![edges(0.0, 0.0, 10.0, 10.0), truck], 0.5);
        assert_eq!((joined.len(), joined[0].class.as_str(), joined[0].edges), (1, "truck", [0.0, -6.0, 12.0, 10.0]));
    }

    #[test]
    fn edges_err_by_the_noise_told() {
        let camera = camera();
        let target = [car(40.0, 0.0)];
        let exact = camera.view(&[target[0].solid], &[])[0].edges;
        let errors: Vec<f64> = (0..2000)
            .filter_map(|n| {
                camera.detect(&target, &[], 1, n).first().filter(|b| b.score > 0.6).map(|b| b.edges[3] - exact[3])
            })
            .collect();
        let spread = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        let expected = 2.7_f64.hypot(0.035 * (exact[3] - exact[1]));
        assert!((spread - expected).abs() < 0.15 * expected, "{spread} {expected}");
    }

    #[test]
    fn a_frame_is_the_same_again() {
        let targets = [car(40.0, 0.0), car(60.0, 4.0)];
        assert_eq!(camera().detect(&targets, &[], 1, 7), camera().detect(&targets, &[], 1, 7));
    }
}
