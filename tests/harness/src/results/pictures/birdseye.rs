//! One frame from above: the map as ground, boxes, detections with Doppler ticks, the sensor.
//!
//! The road runs to the right (x), its left side is up (y), both axes at the same scale. The
//! ground is what the map answers at the centre of every 1 m cell.

use viewshed::map::VisibilityMap;
use viewshed::sensor::road::RoadPoint;

use super::axes::{BELOW_PX, Plot};
use super::canvas::{Canvas, Colour, Pen};
use super::legend::{Surround, WIDTH_PX};
use super::palette::INK;
use super::scene::Scene;
use super::text::Style;
use super::{cells, closeup, overlay};

/// From this scale on every cell is outlined.
const CELL_GRID_PX_PER_M: f64 = 14.0;
const NOTE_PX: i32 = 40;
const SIGHT: Pen = Pen::new(Colour::hex(0x1B1F24), 1.2).dashed(&[2.0, 4.0]);

/// Draws what a highlight enlarges, and nothing around it: one frame of a strip.
pub fn tile(scene: &Scene, width_px: i32) -> Option<Canvas> {
    let highlight = scene.highlight.as_ref()?;
    let plot = highlight.window.filling(width_px);
    let mut canvas = Canvas::new(plot.area.width, plot.area.height);
    panel(&mut canvas, scene, &plot, true);
    Some(canvas)
}

struct Layout {
    surround: Surround,
    overview: Plot,
    enlarged: Option<Plot>,
    /// Lower edge of the last plot, axis included.
    plots_bottom: i32,
}

/// Draws a frame, about 1400 px wide.
pub fn draw(scene: &Scene) -> Canvas {
    let layout = layout(scene);
    let mut canvas = Canvas::new(WIDTH_PX, layout.plots_bottom + layout.surround.below_px());
    layout.surround.draw(&mut canvas, layout.plots_bottom);
    panel(&mut canvas, scene, &layout.overview, false);
    axes(&mut canvas, &layout.overview);
    if let (Some(plot), Some(highlight)) = (&layout.enlarged, &scene.highlight) {
        let at = [plot.area.left as f32, (plot.area.top - 12) as f32];
        canvas.text(at, &highlight.note, Style::new(16.0, INK).bold());
        panel(&mut canvas, scene, plot, true);
        axes(&mut canvas, plot);
    }
    canvas
}

fn axes(canvas: &mut Canvas, plot: &Plot) {
    plot.axes(canvas, "x, along the road (m)", "y, to the left (m)");
}

fn layout(scene: &Scene) -> Layout {
    let mut ground = cells::legend(scene.carries);
    if !scene.road.is_empty() {
        ground.push(overlay::samples::road());
    }
    if !scene.lanes.is_empty() {
        ground.push(overlay::samples::lanes());
    }
    let mut legend = vec![ground];
    if !scene.boxes.is_empty() {
        legend.push(overlay::samples::boxes());
    }
    legend.push(overlay::samples::radar(!scene.detections.is_empty()));
    let surround = Surround { title: scene.title.clone(), caption: scene.caption.clone(), legend };
    let overview = scene.window.plot(surround.above_px());
    let mut plots_bottom = overview.area.bottom() + BELOW_PX;
    let enlarged = scene.highlight.as_ref().map(|h| h.window.plot(plots_bottom + NOTE_PX));
    if let Some(plot) = &enlarged {
        plots_bottom = plot.area.bottom() + BELOW_PX;
    }
    Layout { surround, overview, enlarged, plots_bottom }
}

fn panel(canvas: &mut Canvas, scene: &Scene, plot: &Plot, enlarged: bool) {
    let pose = &scene.pose;
    let sensor = plot.at([pose.position[0], pose.position[1]]);
    canvas.within(plot.area, |canvas| {
        ground(canvas, scene.map, plot);
        plot.grid(canvas, Colour::hex(0x3C434C).opacity(38));
        overlay::road(canvas, plot, scene.road);
        scene.lanes.iter().for_each(|lane| overlay::lane(canvas, plot, lane));
        overlay::field_of_view(canvas, plot, pose, &scene.field_of_view, scene.slice_height_m);
        if let Some(highlight) = &scene.highlight {
            let [x, y, _] = highlight.solid.center;
            canvas.line(sensor, plot.at([x, y]), SIGHT);
        }
        // what counts lies on top
        for counted in [false, true] {
            for b in scene.boxes.iter().filter(|b| b.outcome.is_some() == counted) {
                overlay::truth_box(canvas, plot, &b.solid, b.outcome);
            }
        }
        if let Some(highlight) = &scene.highlight {
            closeup::mark(canvas, plot, highlight, enlarged);
        }
        for d in scene.detections {
            let [x, y, _] = d.road_position(pose, scene.slice_height_m);
            overlay::detection(canvas, plot.at([x, y]), sensor, d.radial_velocity_mps);
        }
        let [x, y, _] = pose.position;
        let (left, ahead) = pose.yaw_rad().sin_cos();
        overlay::sensor(canvas, sensor, plot.at([x + ahead, y + left]));
        if scene.lanes_numbered {
            overlay::number_lanes(canvas, plot, &scene.lanes);
        }
        if enlarged {
            closeup::name_boxes(canvas, scene, plot);
        }
    });
}

fn ground(canvas: &mut Canvas, map: &dyn VisibilityMap, plot: &Plot) {
    let cells_of = |[lo, hi]: [f64; 2]| lo.floor() as i32..hi.ceil() as i32;
    for i in cells_of(plot.x) {
        for j in cells_of(plot.y) {
            let [x, y] = [f64::from(i), f64::from(j)];
            cells::fill(canvas, plot, [x, x + 1.0], [y, y + 1.0], &map.at(RoadPoint::cell_centre(i, j)));
        }
    }
    if plot.scale() < CELL_GRID_PX_PER_M {
        return;
    }
    let pen = Pen::new(Colour::WHITE.opacity(90), 1.0);
    for i in cells_of(plot.x) {
        let x = f64::from(i);
        canvas.line(plot.at([x, plot.y[0]]), plot.at([x, plot.y[1]]), pen);
    }
    for j in cells_of(plot.y) {
        let y = f64::from(j);
        canvas.line(plot.at([plot.x[0], y]), plot.at([plot.x[1], y]), pen);
    }
}

#[cfg(test)]
mod tests {
    use viewshed::map::{CellState, Visibility};

    use super::*;
    use crate::geometry::pose::SensorPose;
    use crate::geometry::solid::Solid;
    use crate::recording::{FieldOfView, RadarDetection};
    use crate::results::pictures::canvas::Area;
    use crate::results::pictures::palette;
    use crate::results::pictures::scene::{Highlight, Window};

    struct Half(fn(RoadPoint) -> bool);

    const CLEAR: CellState = CellState { visibility: Visibility::Visible, grade: 255, occupancy: 0, occupied: false };
    const BLOCKED: CellState = CellState { visibility: Visibility::Invisible, grade: 0, ..CLEAR };

    impl VisibilityMap for Half {
        fn at(&self, point: RoadPoint) -> CellState {
            if (self.0)(point) { CLEAR } else { BLOCKED }
        }

        fn cells_in(&self, area: &viewshed::query::Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    fn scene(map: &Half) -> Scene<'_> {
        Scene {
            map,
            carries: cells::Carries::ALL,
            pose: SensorPose::new([0.0, 0.0, 5.0], 0.0, 0.0, 0.0),
            field_of_view: FieldOfView { azimuth_rad: [-1.0, 1.0], elevation_rad: [-0.3, 0.1], range_m: [1.0, 150.0] },
            slice_height_m: 1.0,
            window: Window { x_m: [-10.0, 90.0], y_m: [-20.0, 20.0] },
            detections: &[],
            boxes: Vec::new(),
            road: &[],
            lanes: [].as_slice().into(),
            lanes_numbered: false,
            title: "title".into(),
            caption: None,
            highlight: None,
        }
    }

    /// Pixels of a quarter of the plot (right = 0 or 1, down = 0 or 1) that have a state's colour.
    fn share(canvas: &Canvas, plot: &Plot, right: i32, down: i32, state: &CellState) -> f64 {
        let Area { left, top, width, height } = plot.area;
        let (w, h) = (width / 2, height / 2);
        let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (left + right * w + x, top + down * h + y)));
        pixels.filter(|&(x, y)| canvas.pixel(x, y) == palette::ground(state, x, y)).count() as f64 / f64::from(w * h)
    }

    #[test]
    fn left_of_the_road_is_up_and_ahead_is_to_the_right() {
        let map = Half(|p| p.y_cm > 0 && p.x_cm > 4000);
        let scene = scene(&map);
        let (canvas, plot) = (draw(&scene), layout(&scene).overview);
        assert!(share(&canvas, &plot, 1, 0, &CLEAR) > 0.8, "ahead and left is the upper right quarter");
        for (right, down) in [(0, 0), (0, 1), (1, 1)] {
            assert_eq!(share(&canvas, &plot, right, down, &CLEAR), 0.0);
            assert!(share(&canvas, &plot, right, down, &BLOCKED) > 0.8);
        }
    }

    #[test]
    fn a_detection_to_the_left_of_the_sensor_is_drawn_above_it() {
        let map = Half(|_| true);
        let detections = [RadarDetection {
            range_m: 60.0,
            azimuth_rad: 0.2,
            elevation_rad: None,
            radial_velocity_mps: -20.0,
            rcs_dbsm: None,
            snr_db: None,
        }];
        let scene = Scene { detections: &detections, ..scene(&map) };
        let (canvas, plot) = (draw(&scene), layout(&scene).overview);
        let [x, y, _] = detections[0].road_position(&scene.pose, 1.0);
        assert!(y > 5.0);
        let [px, py] = plot.at([x, y]).map(|v| v as i32);
        assert!(py < plot.area.top + plot.area.height / 2);
        assert!(canvas.pixel(px, py).red < 60, "the dot");
        let dark = |side: f64| {
            (4..14).any(|k| {
                let reach = f64::from(k) / plot.scale() * side / x.hypot(y);
                let [px, py] = plot.at([x * (1.0 + reach), y * (1.0 + reach)]).map(|v| v as i32);
                canvas.pixel(px, py).red < 90
            })
        };
        assert!(dark(-1.0) && !dark(1.0), "it approaches: the tick points to the sensor");
    }

    #[test]
    fn a_highlight_adds_a_plot_that_shows_the_object_and_what_is_before_it() {
        let solid = Solid { center: [80.0, 4.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
        let map = Half(|_| true);
        let plain = scene(&map);
        let highlight = Highlight::on(solid, &plain.pose, "note");
        let marked = Scene { highlight: Some(highlight), ..scene(&map) };
        assert!(layout(&marked).enlarged.unwrap().shows([80.0, 4.0]));
        assert!(draw(&marked).height() > draw(&plain).height() + 200);
    }

    #[test]
    fn a_tile_is_the_enlarged_part_and_nothing_else() {
        let solid = Solid { center: [80.0, 4.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
        let map = Half(|_| true);
        let plain = scene(&map);
        assert!(tile(&plain, 720).is_none(), "nothing is highlighted");
        let tile = tile(&Scene { highlight: Some(Highlight::on(solid, &plain.pose, "note")), ..plain }, 720).unwrap();
        assert_eq!((tile.width(), tile.height()), (720, 260), "72 m x 26 m");
        assert_eq!(tile.pixel(3, 256), palette::ground(&CLEAR, 3, 256), "ground up to the corner");
    }

    #[test]
    fn a_sensor_turned_left_points_up() {
        let map = Half(|_| true);
        let yaw = std::f64::consts::FRAC_PI_2;
        let scene = Scene { pose: SensorPose::new([40.0, 0.0, 5.0], yaw, 0.0, 0.0), ..scene(&map) };
        let (canvas, plot) = (draw(&scene), layout(&scene).overview);
        let [x, y] = plot.at([40.0, 0.0]).map(|v| v as i32);
        let ink = |dy: i32| (x - 20..x + 20).filter(|&px| canvas.pixel(px, y + dy).red < 60).count();
        assert!(ink(-9) > 0, "the tip is above");
        assert!(ink(7) > 0 && ink(12) == 0, "the barbs are below");
    }

    #[test]
    fn the_same_scene_gives_the_same_bytes() {
        let map = Half(|p| p.x_cm > 0);
        assert_eq!(draw(&scene(&map)).png().unwrap(), draw(&scene(&map)).png().unwrap());
    }

    #[test]
    fn a_window_without_points_is_still_one() {
        let w = Window::around([], 2.0);
        assert_eq!((w.x_m, w.y_m), ([-10.0, 10.0], [-10.0, 10.0]));
        assert_eq!(Window::around([[0.0, 0.0], [100.3, 50.0]], 5.0).x_m, [-5.0, 106.0]);
    }
}
