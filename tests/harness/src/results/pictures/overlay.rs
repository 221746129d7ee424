//! What is drawn over the ground of a bird's-eye picture: boxes, detections, the sensor.

use super::axes::Plot;
use super::canvas::{Canvas, Colour, Pen, Pixel};
use super::labels::Labels;
use super::palette::{DETECTION, INK, Outcome, outline};
use super::text::Style;
use crate::estimators::Lane;
use crate::evaluation::samples::Cell;
use crate::geometry::pose::{SensorPose, Spherical};
use crate::geometry::solid::Solid;
use crate::recording::FieldOfView;

/// Length of a Doppler tick, pixels per m/s.
pub const DOPPLER_PX_PER_MPS: f32 = 1.0;
/// Slower detections get no tick, m/s.
const DOPPLER_LEAST_MPS: f32 = 0.5;

const DETECTION_PX: f32 = 2.3;
const SENSOR_PX: f32 = 11.0;
const FIELD_OF_VIEW: Pen = Pen::new(Colour::hex(0x3C434C), 1.3).dashed(&[7.0, 5.0]);
const ROAD: Pen = Pen::new(Colour::hex(0xFFFFFF), 1.4);
const LANE: Pen = Pen::new(Colour::hex(0x6A3D9A), 1.6);
/// Length of the arrow heads of a lane, pixels; of a short one its half.
const ARROW_PX: f32 = 9.0;
/// One head every so many metres, the first so many metres inside the picture.
const ARROWS_M: f64 = 25.0;
const FIRST_ARROW_M: f64 = 12.0;

/// A ground-truth box: outline by outcome, a tick from its centre to its front.
pub fn truth_box(canvas: &mut Canvas, plot: &Plot, solid: &Solid, outcome: Option<Outcome>) {
    let pen = outline(outcome);
    let corners = solid.footprint().map(|p| plot.at(p));
    let heading = [[0.0, 0.0], [solid.size[0] / 2.0, 0.0]].map(|p| plot.at(solid.global(p)));
    canvas.polyline(&corners, true, pen.halo());
    canvas.polyline(&heading, false, pen.halo());
    canvas.polyline(&corners, true, pen);
    canvas.polyline(&heading, false, Pen { dash: &[], ..pen });
}

/// A detection with its Doppler tick.
pub fn detection(canvas: &mut Canvas, at: Pixel, sensor: Pixel, radial_velocity_mps: f32) {
    if radial_velocity_mps.abs() >= DOPPLER_LEAST_MPS {
        let tip = doppler_tip(at, sensor, radial_velocity_mps);
        canvas.line(at, tip, Pen::new(Colour::WHITE.opacity(150), 2.8));
        canvas.line(at, tip, Pen::new(DETECTION, 1.2));
    }
    canvas.disc(at, DETECTION_PX + 0.9, Colour::WHITE);
    canvas.disc(at, DETECTION_PX, DETECTION);
}

/// End of a Doppler tick: along the line of sight, away from the sensor where the detection
/// recedes (+), towards it where it approaches (-).
pub fn doppler_tip(at: Pixel, sensor: Pixel, radial_velocity_mps: f32) -> Pixel {
    let (dx, dy) = (at[0] - sensor[0], at[1] - sensor[1]);
    let reach = radial_velocity_mps * DOPPLER_PX_PER_MPS / dx.hypot(dy).max(1e-3);
    [at[0] + dx * reach, at[1] + dy * reach]
}

/// The sensor as an arrow head; `ahead` is some place on its boresight.
pub fn sensor(canvas: &mut Canvas, at: Pixel, ahead: Pixel) {
    let (dx, dy) = (ahead[0] - at[0], ahead[1] - at[1]);
    let length = dx.hypot(dy).max(1e-6);
    let (c, s) = (dx / length * SENSOR_PX, dy / length * SENSOR_PX);
    let corner = |along: f32, right: f32| [at[0] + along * c - right * s, at[1] + along * s + right * c];
    let corners = [corner(1.0, 0.0), corner(-0.8, 0.75), corner(-0.4, 0.0), corner(-0.8, -0.75)];
    canvas.polyline(&corners, true, Pen::new(Colour::WHITE, 4.0));
    canvas.polygon(&corners, INK);
}

/// Azimuth limits and greatest range, where they lie `height_m` above the road.
pub fn field_of_view(canvas: &mut Canvas, plot: &Plot, pose: &SensorPose, view: &FieldOfView, height_m: f64) {
    let on_road = |range_m: f64, azimuth_rad: f64| -> Option<Pixel> {
        let s: Spherical = pose.at_height(range_m, azimuth_rad, height_m);
        let [x, y, z] = pose.to_road(s);
        ((z - height_m).abs() < 0.01).then(|| plot.at([x, y]))
    };
    let between = |[lo, hi]: [f64; 2], k: i32| lo + (hi - lo) * f64::from(k) / 90.0;
    for azimuth in view.azimuth_rad {
        let limit: Vec<Pixel> = (0..=90).filter_map(|k| on_road(between(view.range_m, k), azimuth)).collect();
        canvas.polyline(&limit, false, FIELD_OF_VIEW);
    }
    let arc: Vec<Pixel> = (0..=90).filter_map(|k| on_road(view.range_m[1], between(view.azimuth_rad, k))).collect();
    canvas.polyline(&arc, false, FIELD_OF_VIEW);
}

/// The border of the road's cells.
pub fn road(canvas: &mut Canvas, plot: &Plot, cells: &[Cell]) {
    let on_road: std::collections::BTreeSet<Cell> = cells.iter().copied().collect();
    for &(i, j) in &on_road {
        let [x, y] = [f64::from(i), f64::from(j)];
        for (beside, from, to) in [
            ((i + 1, j), [x + 1.0, y], [x + 1.0, y + 1.0]),
            ((i - 1, j), [x, y], [x, y + 1.0]),
            ((i, j + 1), [x, y + 1.0], [x + 1.0, y + 1.0]),
            ((i, j - 1), [x, y], [x + 1.0, y]),
        ] {
            if !on_road.contains(&beside) {
                canvas.line(plot.at(from), plot.at(to), ROAD);
            }
        }
    }
}

/// A lane of traffic, with an arrow head where it ends and more on its way: it may end outside the picture.
pub fn lane(canvas: &mut Canvas, plot: &Plot, lane: &Lane) {
    let points: Vec<Pixel> = lane.points.iter().map(|p| plot.at(p.map(f64::from))).collect();
    arrow(canvas, &points);
    let (mut inside_m, mut next_m) = (0.0, FIRST_ARROW_M);
    for [from, to] in metres_inside(plot, lane) {
        inside_m += (to[0] - from[0]).hypot(to[1] - from[1]);
        if inside_m >= next_m {
            next_m += ARROWS_M;
            head(canvas, plot.at(from), plot.at(to), ARROW_PX);
        }
    }
}

/// The number of every lane, from 1, beside where it comes into the picture.
pub fn number_lanes(canvas: &mut Canvas, plot: &Plot, lanes: &[Lane]) {
    let style = Style::new(14.0, LANE.colour).bold().halo();
    let mut labels = Labels::new(plot.area);
    for (number, lane) in (1..).zip(lanes) {
        // a little inside, where the frame leaves room
        let Some([_, at]) = metres_inside(plot, lane).take(NUMBER_M).last() else { continue };
        let (at, number) = (plot.at(at), format!("{number}"));
        if !labels.place(canvas, at, &number, style, 40.0) {
            canvas.text_middle(at, &number, style);
        }
    }
}

/// How far inside the picture the number of a lane is, metres.
const NUMBER_M: usize = 4;

/// The parts of a lane that are shown, in pieces of about a metre.
fn metres_inside<'a>(plot: &'a Plot, lane: &'a Lane) -> impl Iterator<Item = [[f64; 2]; 2]> + 'a {
    let pairs = lane.points.windows(2).filter_map(|pair| <[[f32; 2]; 2]>::try_from(pair).ok());
    let pieces = pairs.flat_map(|pair| {
        let [[ax, ay], [bx, by]] = pair.map(|p| p.map(f64::from));
        let pieces = (bx - ax).hypot(by - ay).ceil().clamp(1.0, 2000.0);
        let place = move |k: f64| [ax + (bx - ax) * k / pieces, ay + (by - ay) * k / pieces];
        (0..pieces as u32).map(f64::from).map(move |k| [place(k), place(k + 1.0)])
    });
    pieces.filter(|[from, to]| plot.shows(*from) && plot.shows(*to))
}

fn arrow(canvas: &mut Canvas, points: &[Pixel]) {
    canvas.polyline(points, false, LANE);
    let [.., from, to] = points else { return };
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    head(canvas, *from, *to, ARROW_PX.min(length / 2.0));
}

/// A head of this length whose tip is at the second of two places, in their direction.
fn head(canvas: &mut Canvas, from: Pixel, to: Pixel, head: f32) {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let length = dx.hypot(dy).max(1e-6);
    let (c, s) = (dx / length * head, dy / length * head);
    let barb = |right: f32| [to[0] - c - right * s, to[1] - s + right * c];
    canvas.polyline(&[barb(0.5), to, barb(-0.5)], false, LANE);
}

/// Samples of the pens, for the legend.
pub mod samples {
    use super::{DOPPLER_PX_PER_MPS, FIELD_OF_VIEW, Outcome, Pen, ROAD, outline};
    use crate::results::pictures::canvas::{Area, Colour};
    use crate::results::pictures::legend::Entry;

    const EXAMPLE_MPS: f32 = 20.0;

    fn middle(area: Area) -> f32 {
        area.top as f32 + area.height as f32 / 2.0
    }

    pub fn boxes() -> Vec<Entry> {
        let mut entries: Vec<Entry> = Outcome::ALL.iter().map(|&o| truth_box(o.meaning(), Some(o))).collect();
        entries.push(truth_box("not counted", None));
        entries
    }

    /// A box, whatever became of it.
    pub fn vehicle() -> Entry {
        truth_box("labelled object", None)
    }

    fn truth_box(label: &str, outcome: Option<Outcome>) -> Entry {
        Entry::new(label, 36, move |canvas, area| {
            let pen = outline(outcome);
            let [left, right] = [area.left as f32 + 2.0, area.right() as f32 - 2.0];
            let [top, bottom] = [area.top as f32 + 3.0, area.bottom() as f32 - 3.0];
            canvas.polyline(&[[left, top], [right, top], [right, bottom], [left, bottom]], true, pen);
            let centre = [(left + right) / 2.0, middle(area)];
            canvas.line(centre, [right, centre[1]], Pen { dash: &[], ..pen });
        })
    }

    /// The sensor, and its detections where there are any.
    pub fn radar(detections: bool) -> Vec<Entry> {
        let tick = |label: String, velocity: f32| {
            let width = (EXAMPLE_MPS * DOPPLER_PX_PER_MPS) as i32 + 12;
            Entry::new(label, width, move |canvas, area| {
                let y = middle(area);
                let x = if velocity > 0.0 { area.left + 6 } else { area.right() - 6 };
                super::detection(canvas, [x as f32, y], [area.left as f32 - 500.0, y], velocity);
            })
        };
        let line = |label: &str, pen: Pen, ground: Option<Colour>| {
            Entry::new(label, 36, move |canvas, area| {
                if let Some(ground) = ground {
                    canvas.rectangle(area, ground);
                }
                canvas.line([area.left as f32, middle(area)], [area.right() as f32, middle(area)], pen);
            })
        };
        let mut entries = vec![
            Entry::new("sensor", 26, |canvas, area| {
                super::sensor(canvas, [area.left as f32 + 13.0, middle(area)], [area.right() as f32, middle(area)]);
            }),
            line("field of view", FIELD_OF_VIEW, None),
        ];
        let ticks = [
            tick(
                format!("detection receding at {EXAMPLE_MPS} m/s: tick away from the sensor (here at the left)"),
                EXAMPLE_MPS,
            ),
            tick(format!("approaching at {EXAMPLE_MPS} m/s: towards it"), -EXAMPLE_MPS),
        ];
        entries.extend(ticks.into_iter().filter(|_| detections));
        entries
    }

    pub fn lanes() -> Entry {
        Entry::new("lane of traffic", 36, |canvas, area| {
            let y = middle(area);
            super::arrow(canvas, &[[area.left as f32, y], [area.right() as f32, y]]);
        })
    }

    pub fn road() -> Entry {
        Entry::new("road cells", 36, |canvas, area| {
            canvas.rectangle(area, Colour::hex(0x9CCBEC));
            canvas.line([area.left as f32, middle(area)], [area.right() as f32, middle(area)], ROAD);
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::pictures::canvas::Area;

    #[test]
    fn a_lane_has_its_arrow_head_where_its_traffic_goes_to() {
        let window = crate::results::pictures::scene::Window { x_m: [0.0, 100.0], y_m: [-10.0, 10.0] };
        let plot = window.filling(500);
        let dark = |points: Vec<[f32; 2]>, [x, y]: [f64; 2]| {
            let mut canvas = Canvas::new(plot.area.width, plot.area.height);
            lane(&mut canvas, &plot, &Lane { points });
            let [right, down] = plot.at([x, y]).map(|v| v as i32);
            let near = |d: i32| (-3..=3).any(|e| canvas.pixel(right + e, down + d) == LANE.colour);
            // the line itself is here, too: its barbs are 4 pixels beside it
            near(-3) && near(3)
        };
        let [begin, end] = [[20.0, 2.0], [80.0, 2.0]];
        let along = vec![[20.0, 2.0], [80.0, 2.0]];
        let back: Vec<[f32; 2]> = along.iter().rev().copied().collect();
        assert!(dark(along.clone(), [78.8, end[1]]) && !dark(along, [21.2, begin[1]]));
        assert!(dark(back.clone(), [21.2, begin[1]]) && !dark(back, [78.8, end[1]]));
    }

    #[test]
    fn a_lane_that_ends_outside_the_picture_shows_its_direction_and_number_inside() {
        let window = crate::results::pictures::scene::Window { x_m: [0.0, 100.0], y_m: [-10.0, 10.0] };
        let plot = window.filling(500);
        let through = Lane { points: vec![[-80.0, 0.0], [180.0, 0.0]] };
        let mut canvas = Canvas::new(plot.area.width, plot.area.height);
        lane(&mut canvas, &plot, &through);
        // barbs are up to 4 pixels beside the line, behind the tip
        let barbs = |columns: std::ops::Range<i32>| columns.filter(|&x| canvas.pixel(x, 53) != Colour::WHITE).count();
        let heads = (0..4).filter(|k| barbs(k * 125..(k + 1) * 125) > 0).count();
        assert_eq!((heads, barbs(70..170)), (4, 0), "at 12, 37, 62 and 87 m");
        let mut numbered = Canvas::new(plot.area.width, plot.area.height);
        number_lanes(&mut numbered, &plot, &[through]);
        let ink = |columns: std::ops::Range<i32>| {
            columns.flat_map(|x| (0..100).map(move |y| (x, y))).filter(|&(x, y)| numbered.pixel(x, y).red < 130).count()
        };
        assert!(ink(0..60) > 10 && ink(60..500) == 0, "where it comes in");
    }

    fn dark(canvas: &Canvas, columns: std::ops::Range<i32>, row: i32) -> usize {
        columns.filter(|&x| canvas.pixel(x, row).red < 90).count()
    }

    #[test]
    fn a_receding_tick_points_away_from_the_sensor_and_an_approaching_one_towards_it() {
        for (velocity, towards, away) in [(20.0, 0, 15), (-20.0, 15, 0)] {
            let mut canvas = Canvas::new(200, 40);
            detection(&mut canvas, [100.0, 20.5], [10.0, 20.5], velocity);
            let (near, far) = (dark(&canvas, 70..95, 20), dark(&canvas, 105..130, 20));
            assert!(near >= towards && far >= away, "{velocity} m/s: {near} {far}");
            assert!(near.min(far) == 0, "{velocity} m/s: {near} {far}");
        }
    }

    #[test]
    fn the_heading_tick_ends_at_the_front() {
        // driving to the left of the road (+y): the tick runs up from the centre
        let solid = Solid { center: [10.0, 10.0, 1.0], yaw_rad: std::f64::consts::FRAC_PI_2, size: [10.0, 4.0, 2.0] };
        let plot = Plot { area: Area::new(0, 0, 200, 200), x: [0.0, 20.0], y: [0.0, 20.0] };
        let mut canvas = Canvas::new(200, 200);
        truth_box(&mut canvas, &plot, &solid, Some(Outcome::TrueVisible));
        assert!(canvas.pixel(100, 75).red < 90, "between centre and front");
        assert!(canvas.pixel(100, 125).red > 200, "nothing towards the back");
        assert!(canvas.pixel(100, 50).red < 90 && canvas.pixel(80, 100).red < 90, "front edge and left side");
    }

    #[test]
    fn the_field_of_view_opens_to_the_left_for_positive_azimuths() {
        let pose = SensorPose::new([0.0, 0.0, 5.0], 0.0, 0.0, 0.0);
        let view = FieldOfView { azimuth_rad: [0.0, 0.5], elevation_rad: [-1.0, 1.0], range_m: [1.0, 80.0] };
        let plot = Plot { area: Area::new(0, 0, 200, 200), x: [0.0, 100.0], y: [-50.0, 50.0] };
        let mut canvas = Canvas::new(200, 200);
        field_of_view(&mut canvas, &plot, &pose, &view, 1.0);
        let ink = |rows: std::ops::Range<i32>| {
            rows.flat_map(|y| (0..200).map(move |x| (x, y))).filter(|&(x, y)| canvas.pixel(x, y).red < 128).count()
        };
        assert!(ink(0..98) > 50 && ink(102..200) == 0);
    }
}
