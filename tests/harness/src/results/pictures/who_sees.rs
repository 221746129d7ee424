//! Who of several sensors sees what: their fused map from above.

use viewshed::fusion::FusedCell;
use viewshed::map::{CellState, Visibility};
use viewshed::sensor::road::RoadPoint;

use super::axes::BELOW_PX;
use super::canvas::{Area, Canvas, Colour};
use super::legend::{Entry, Surround, WIDTH_PX};
use super::scene::Window;
use super::text::Style;
use super::{cells, overlay, palette};
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::FieldOfView;

/// Pixels above and to the right of a sensor where its name stands.
const NAME_PX: f32 = 14.0;

/// One of the sensors.
#[derive(Debug, Clone)]
pub struct Sensor {
    pub name: String,
    pub pose: SensorPose,
    pub field_of_view: FieldOfView,
}

/// Everything on the picture.
pub struct WhoSees<'a> {
    /// What each of the sensors says of a place.
    pub place: &'a dyn Fn(RoadPoint) -> FusedCell,
    pub sensors: &'a [Sensor],
    pub window: Window,
    /// Labelled objects.
    pub boxes: &'a [Solid],
    pub slice_height_m: f64,
    pub title: String,
    pub caption: Option<String>,
}

/// Draws it, about 1400 px wide.
pub fn draw(scene: &WhoSees<'_>) -> Canvas {
    let surround =
        Surround { title: scene.title.clone(), caption: scene.caption.clone(), legend: legend(scene.sensors) };
    let plot = scene.window.plot(surround.above_px());
    let bottom = plot.area.bottom() + BELOW_PX;
    let mut canvas = Canvas::new(WIDTH_PX, bottom + surround.below_px());
    surround.draw(&mut canvas, bottom);
    canvas.within(plot.area, |canvas| {
        let whole = |[low, high]: [f64; 2]| low.floor() as i32..high.ceil() as i32;
        for i in whole(plot.x) {
            for j in whole(plot.y) {
                let [x, y] = [f64::from(i), f64::from(j)];
                let cell = (scene.place)(RoadPoint::cell_centre(i, j));
                cells::shade(canvas, &plot, [x, x + 1.0], [y, y + 1.0], |px, py| ground(&cell, px, py));
            }
        }
        plot.grid(canvas, Colour::hex(0x3C434C).opacity(38));
        for sensor in scene.sensors {
            overlay::field_of_view(canvas, &plot, &sensor.pose, &sensor.field_of_view, scene.slice_height_m);
        }
        scene.boxes.iter().for_each(|solid| overlay::truth_box(canvas, &plot, solid, None));
        for sensor in scene.sensors {
            let [x, y, _] = sensor.pose.position;
            let (left, ahead) = sensor.pose.yaw_rad().sin_cos();
            let at = plot.at([x, y]);
            overlay::sensor(canvas, at, plot.at([x + ahead, y + left]));
            canvas.text([at[0] + NAME_PX, at[1] - NAME_PX], &sensor.name, Style::new(15.0, palette::INK).bold());
        }
    });
    plot.axes(&mut canvas, "x, along the road (m)", "y, to the left (m)");
    canvas
}

fn ground(cell: &FusedCell, x: i32, y: i32) -> Colour {
    let seen = palette::seen_by(cell.seen_by);
    palette::ground_of(&cell.state, seen.unwrap_or(Colour::WHITE), x, y)
}

fn legend(sensors: &[Sensor]) -> Vec<Vec<Entry>> {
    let plain = |label: String, colour: Colour| {
        Entry::new(label, 36, move |canvas: &mut Canvas, area: Area| canvas.rectangle(area, colour))
    };
    let mut seen: Vec<Entry> = sensors
        .iter()
        .enumerate()
        .map(|(k, sensor)| plain(format!("seen by {} only", sensor.name), palette::sensor(k)))
        .collect();
    if sensors.len() > 1 {
        seen.push(plain("seen by several".into(), palette::SEVERAL));
    }
    let state = |visibility| CellState { visibility, grade: 0, occupancy: 0, occupied: false };
    let of = |label: &str, visibility| {
        let state = state(visibility);
        Entry::new(label, 36, move |canvas: &mut Canvas, area: Area| {
            canvas.shade(area, |x, y| palette::ground(&state, x, y));
        })
    };
    let hidden = of("hidden from all who know of it", Visibility::Invisible);
    vec![seen, vec![hidden, of("unknown", Visibility::Unknown), overlay::samples::vehicle(), cells::occupied()]]
}

#[cfg(test)]
mod tests {
    use viewshed::fixed::time::Time;
    use viewshed::fusion::{Fusion, FusionConfig};
    use viewshed::map::VisibilityMap;
    use viewshed::map::query::Footprint;

    use super::*;

    /// Visible where x lies below this, centimetres; invisible beyond.
    struct Until(i32);

    impl VisibilityMap for Until {
        fn at(&self, point: RoadPoint) -> CellState {
            let visible = point.x_cm < self.0;
            let visibility = if visible { Visibility::Visible } else { Visibility::Invisible };
            CellState { visibility, grade: if visible { 255 } else { 0 }, occupancy: 0, occupied: false }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    #[test]
    fn each_place_has_the_colour_of_who_sees_it() {
        let mut fusion = Box::new(Fusion::<2, 30, 20>::NOWHERE);
        fusion.set(RoadPoint::new(0, -1000), 100, FusionConfig::default()).unwrap();
        let now = Time::from_micros(1_000_000);
        fusion.offer(0, now, now, &Until(1000)).unwrap();
        fusion.offer(1, now, now, &Until(2000)).unwrap();
        let colour = |x_m: i32| ground(&fusion.at(now).place(RoadPoint::new(100 * x_m + 50, 0)), 1, 1);
        assert_eq!(colour(5), palette::SEVERAL);
        assert_eq!(colour(15), palette::sensor(1));
        // grades are held from 1 on: 0 is unknown
        let hidden = CellState { visibility: Visibility::Invisible, grade: 1, occupancy: 0, occupied: false };
        assert_eq!(colour(25), palette::ground(&hidden, 1, 1));
        assert_ne!(palette::sensor(0), palette::sensor(1));
    }
}
