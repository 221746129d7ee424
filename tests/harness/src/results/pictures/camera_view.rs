//! A camera's picture with the road, the map and the lifted boxes drawn into it.
//!
//! Whether mount and calibration are right is seen at a glance: the lines of the road lie on the road, and a lifted
//! box stands where the detector's box is.

use viewshed::map::VisibilityMap;
use viewshed::sensor::road::RoadPoint;

use super::canvas::{Area, Canvas, Colour, Pen, Pixel};
use super::palette;
use super::text::Style;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::camera::{Box2d, Intrinsics};

/// What is drawn.
pub struct View<'a> {
    pub intrinsics: Intrinsics,
    pub pose: SensorPose,
    pub map: &'a dyn VisibilityMap,
    /// What the detector found.
    pub boxes: &'a [Box2d],
    /// What became of it on the road.
    pub lifted: &'a [Solid],
    pub title: String,
    pub caption: Option<String>,
}

/// Width of the picture.
const WIDTH_PX: f64 = 1280.0;
/// Height of the line below it.
const FOOT_PX: i32 = 26;
/// Cells that are drawn, from the camera: ahead, and to each side.
const CELLS: [std::ops::Range<i32>; 2] = [0..200, -40..40];
/// Lines of the road: across every 20 m, along every 5 m.
const LINES_M: [usize; 2] = [20, 5];

const SKY: Colour = Colour::hex(0xF4F5F6);
const LINE: Pen = Pen::new(Colour::hex(0x8A9199), 1.0);
const DETECTED: Pen = Pen::new(Colour::hex(0x1B1F24), 1.5).dashed(&[5.0, 3.0]);
const LIFTED: Pen = Pen::new(Colour::hex(0xC8001E), 1.5);

pub fn draw(view: &View) -> Canvas {
    let [width, height] = view.intrinsics.size_px.map(f64::from);
    let scale = WIDTH_PX / width;
    let picture = Area::new(0, 0, WIDTH_PX as i32, (height * scale).round() as i32);
    let mut canvas = Canvas::new(picture.width, picture.height + FOOT_PX);
    let at = |place: [f64; 3]| {
        let near = view.pose.to_sensor(place)[0] > 1.0;
        let pixel = view.intrinsics.pixel_of(&view.pose, place).filter(|_| near)?;
        // far outside of the picture nothing is drawn anyway
        let inside = pixel.iter().all(|v| v.abs() < 20.0 * width);
        inside.then(|| pixel.map(|v| (v * scale) as f32))
    };
    canvas.within(picture, |canvas| {
        canvas.rectangle(picture, SKY);
        ground(canvas, view, &at);
        lines(canvas, view, &at);
        for solid in view.lifted {
            wires(canvas, solid, &at);
        }
        for b in view.boxes {
            let [l, t, r, b] = b.edges.map(|v| (v * scale) as f32);
            canvas.polyline(&[[l, t], [r, t], [r, b], [l, b]], true, DETECTED);
        }
    });
    let style = Style::new(12.0, palette::INK);
    let foot = (picture.height + FOOT_PX / 2) as f32 + 4.0;
    let legend =
        "blue visible, orange invisible · dashed: detected · red: lifted onto the road · lines every 20 m and 5 m";
    let text = [Some(view.title.as_str()), Some(legend), view.caption.as_deref()];
    canvas.text([8.0, foot], &text.into_iter().flatten().collect::<Vec<_>>().join(" · "), style);
    canvas
}

/// A place of the road around the camera, which looks along its own heading.
fn place(pose: &SensorPose, ahead: f64, left: f64) -> [f64; 2] {
    let (sin, cos) = pose.yaw_rad().sin_cos();
    let [x, y, _] = pose.position;
    [x + cos * ahead - sin * left, y + sin * ahead + cos * left]
}

fn ground(canvas: &mut Canvas, view: &View, at: &impl Fn([f64; 3]) -> Option<Pixel>) {
    let [ahead, aside] = CELLS;
    for i in ahead.rev() {
        for j in aside.clone() {
            let corner = |di: i32, dj: i32| {
                let [x, y] = place(&view.pose, f64::from(i + di), f64::from(j + dj));
                at([x, y, 0.0])
            };
            let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
            let [x, y] = place(&view.pose, f64::from(i) + 0.5, f64::from(j) + 0.5);
            let Ok(point) = RoadPoint::from_metres(x as f32, y as f32) else { continue };
            canvas.polygon(&[a, b, c, d], palette::ground(&view.map.at(point), 1, 0));
        }
    }
}

fn lines(canvas: &mut Canvas, view: &View, at: &impl Fn([f64; 3]) -> Option<Pixel>) {
    let [ahead, aside] = CELLS;
    let point = |i: i32, j: i32| {
        let [x, y] = place(&view.pose, f64::from(i), f64::from(j));
        at([x, y, 0.0])
    };
    for i in ahead.clone().step_by(LINES_M[0]) {
        let across: Vec<Pixel> = aside.clone().filter_map(|j| point(i, j)).collect();
        canvas.polyline(&across, false, LINE);
        if let Some([x, y]) = point(i, 0) {
            canvas.text([x + 3.0, y - 2.0], &format!("{i} m"), Style::new(11.0, palette::FAINT_INK));
        }
    }
    for j in aside.step_by(LINES_M[1]) {
        let along: Vec<Pixel> = ahead.clone().filter_map(|i| point(i, j)).collect();
        canvas.polyline(&along, false, LINE);
    }
}

/// The edges of an upright box.
fn wires(canvas: &mut Canvas, solid: &Solid, at: &impl Fn([f64; 3]) -> Option<Pixel>) {
    let corners = solid.footprint();
    let ring = |z: f64| corners.iter().map(|[x, y]| at([*x, *y, z])).collect::<Option<Vec<Pixel>>>();
    let (Some(foot), Some(roof)) = (ring(solid.center[2] - solid.size[2] / 2.0), ring(solid.top())) else { return };
    canvas.polyline(&foot, true, LIFTED);
    canvas.polyline(&roof, true, LIFTED);
    for (a, b) in foot.iter().zip(&roof) {
        canvas.line(*a, *b, LIFTED);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewshed::map::{CellState, Visibility};

    /// Visible up to 50 m, invisible to the left of what is beyond.
    struct Half;

    impl VisibilityMap for Half {
        fn at(&self, point: RoadPoint) -> CellState {
            let visible = point.x_cm < 5000 || point.y_cm < 0;
            let visibility = if visible { Visibility::Visible } else { Visibility::Invisible };
            CellState { visibility, grade: if visible { 255 } else { 1 }, occupancy: 0, occupied: false }
        }

        fn cells_in(&self, area: &viewshed::query::Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    fn view<'a>(boxes: &'a [Box2d], lifted: &'a [Solid]) -> View<'a> {
        View {
            intrinsics: Intrinsics::centred([1280, 720], 1280.0),
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            map: &Half,
            boxes,
            lifted,
            title: "by hand".into(),
            caption: None,
        }
    }

    #[test]
    fn what_is_left_and_far_on_the_road_is_left_and_high_in_the_picture() {
        let canvas = draw(&view(&[], &[]));
        // 6 m below, 77 m ahead: 100 px below the horizon; 2.5 m aside: 42 px
        let (left, right) = (canvas.pixel(640 - 42, 460), canvas.pixel(640 + 42, 460));
        assert!(left.red > left.blue && right.blue > right.red, "{left:?} {right:?}");
        // 30 m ahead
        let near = canvas.pixel(640 - 100, 360 + 256);
        assert!(near.blue > near.red, "{near:?}");
        assert_eq!(canvas.pixel(640, 200), SKY, "above the horizon");
    }

    #[test]
    fn a_lifted_box_is_drawn_where_the_camera_would_see_it() {
        let car = Solid { center: [42.3, 0.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };
        let edges = [640.0 - 28.8, 360.0 + 1280.0 * 4.5 / 44.6, 640.0 + 28.8, 360.0 + 1280.0 * 6.0 / 40.0];
        let boxes = [Box2d { class: "car".into(), score: 1.0, edges }];
        let red = |c: &Canvas, x: i32, y: i32| {
            let p = c.pixel(x, y);
            p.red > 150 && p.green < 120
        };
        let (lifted, detected) = (draw(&view(&[], &[car])), draw(&view(&boxes, &[])));
        let bottom = 360 + 192;
        assert!((-2..=2).any(|d| red(&lifted, 650, bottom + d)), "its near end is at 40 m");
        assert!(!(-2..=2).any(|d| red(&detected, 650, bottom + d)));
        let dark = |c: &Canvas| (600..680).filter(|x| c.pixel(*x, bottom).red < 60).count();
        assert!(dark(&detected) > 20 && dark(&draw(&view(&[], &[]))) == 0, "dashes where the detector's box ends");
    }
}
