//! One object looked at closely: a ring round it, an enlarged plot, and every box by name.

use super::axes::Plot;
use super::canvas::{Canvas, Pen, Pixel};
use super::labels::Labels;
use super::overlay;
use super::palette::{INK, outline};
use super::scene::{Highlight, Scene, Window};
use super::text::Style;
use crate::geometry::solid::Solid;

const RING: Pen = Pen::new(INK, 2.5);

/// The ring round the object and, on the overview, the frame of the enlarged part.
pub fn mark(canvas: &mut Canvas, plot: &Plot, highlight: &Highlight, enlarged: bool) {
    let ring = ring(plot, &highlight.solid);
    canvas.polyline(&ring, true, RING.halo());
    canvas.polyline(&ring, true, RING);
    if !enlarged {
        let Window { x_m: [x0, x1], y_m: [y0, y1] } = highlight.window;
        let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|p| plot.at(p));
        canvas.polyline(&corners, true, Pen::new(INK, 1.2));
    }
}

/// An ellipse along the box that leaves some pixels free at its corners.
fn ring(plot: &Plot, solid: &Solid) -> Vec<Pixel> {
    const FREE_PX: f64 = 6.0;
    let half = |size: f64| size * std::f64::consts::FRAC_1_SQRT_2 + FREE_PX / plot.scale();
    let on_ring = |k: u32| {
        let (s, c) = (f64::from(k) / 72.0 * std::f64::consts::TAU).sin_cos();
        plot.at(solid.global([c * half(solid.size[0]), s * half(solid.size[1])]))
    };
    (0..72).map(on_ring).collect()
}

/// TV, FV, TI or FI beside every counted box.
pub fn name_boxes(canvas: &mut Canvas, scene: &Scene, plot: &Plot) {
    let mut labels = Labels::new(plot.area);
    for b in &scene.boxes {
        labels.avoid_all(&b.solid.footprint().map(|p| plot.at(p)));
    }
    let sensor = plot.at([scene.pose.position[0], scene.pose.position[1]]);
    for d in scene.detections {
        let [x, y, _] = d.road_position(&scene.pose, scene.slice_height_m);
        let at = plot.at([x, y]);
        labels.avoid_line(at, overlay::doppler_tip(at, sensor, d.radial_velocity_mps));
    }
    if let Some(highlight) = &scene.highlight {
        let ring = ring(plot, &highlight.solid);
        ring.iter().zip(ring.iter().cycle().skip(1)).for_each(|(a, b)| labels.avoid_line(*a, *b));
    }
    for b in &scene.boxes {
        let Some(outcome) = b.outcome else { continue };
        if !plot.shows([b.solid.center[0], b.solid.center[1]]) {
            continue;
        }
        let style = Style::new(15.0, outline(Some(outcome)).colour).bold().halo();
        let around: Vec<Pixel> = match &scene.highlight {
            Some(highlight) if highlight.solid == b.solid => ring(plot, &b.solid),
            _ => b.solid.footprint().map(|p| plot.at(p)).to_vec(),
        };
        let middle = around.iter().map(|p| p[0]).sum::<f32>() / around.len() as f32;
        let above = around.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
        let below = around.iter().map(|p| p[1]).fold(f32::NEG_INFINITY, f32::max);
        // beside the upper edge or else the lower one
        for y in [above, below] {
            if labels.place(canvas, [middle, y], outcome.short(), style, 18.0) {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose::SensorPose;
    use crate::results::pictures::canvas::Area;

    fn car() -> Solid {
        Solid { center: [80.0, 4.0, 0.75], yaw_rad: 0.3, size: [4.6, 1.8, 1.5] }
    }

    #[test]
    fn the_enlarged_part_leans_towards_the_sensor() {
        let pose = SensorPose::new([0.0, 0.0, 5.0], 0.0, 0.0, 0.0);
        let Window { x_m, y_m } = Highlight::on(car(), &pose, "note").window;
        assert!(80.0 - x_m[0] > x_m[1] - 80.0 && x_m[1] > 90.0);
        assert!(y_m[0] < -4.0 && y_m[1] > 10.0);
    }

    #[test]
    fn the_ring_clears_the_box_on_all_sides() {
        let plot = Plot { area: Area::new(0, 0, 400, 400), x: [70.0, 90.0], y: [-6.0, 14.0] };
        let ring = ring(&plot, &car());
        let corners = car().footprint().map(|p| plot.at(p));
        let nearest =
            ring.iter().flat_map(|r| corners.map(|c| (r[0] - c[0]).hypot(r[1] - c[1]))).fold(f32::INFINITY, f32::min);
        assert!((4.0..12.0).contains(&nearest), "{nearest}");
    }
}
