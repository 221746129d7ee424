//! What mounts see: heat maps over height, place, yaw and pitch, and the road as the best of them see it.

use super::axes::{LEFT_PX, Plot, RIGHT_PX};
use super::canvas::{Area, Canvas};
use super::heatmap::{self, Fields};
use super::legend::{Surround, WIDTH_PX};
use super::overlay;
use super::palette::INK;
use super::text::Style;
use crate::evaluation::samples::Cell;
use crate::results::report::site::name;
use crate::studies::site::Site;
use crate::studies::site::sets::Ranked;
use crate::twin::scene::Mount;

/// Height of a row of heat maps, pixels.
const FIELDS_PX: i32 = 330;
/// Room of a road map's axis and the title above it, pixels.
const ROAD_AROUND_PX: i32 = 100;

/// The picture. `ranked` are sets of one, two, ... mounts, best first.
pub fn draw(site: &Site, ranked: &[Vec<Ranked>], title: &str) -> Canvas {
    let surround = Surround {
        title: title.to_owned(),
        caption: Some(
            "Each field is the best of all mounts that share its two figures; colours span the least to the \
             greatest share of any mount. Shares are of all vehicles, and of all road free of vehicles, that any candidate could \
             have in its field of view."
                .into(),
        ),
        legend: vec![vec![heatmap::legend("road: share of time in sight, 0 to 100 %")]],
    };
    let singles = ranked.first().map_or(&[][..], |r| &r[..]);
    let roads: Vec<&Ranked> = ranked.iter().filter_map(|sets| sets.first()).collect();
    let frame = frame(&site.cells);
    let road_px = frame.map_or(0, |[x, y]| {
        (f64::from(WIDTH_PX - LEFT_PX - RIGHT_PX) * (y[1] - y[0]) / (x[1] - x[0])).round().clamp(60.0, 700.0) as i32
    });
    let top = surround.above_px();
    let bottom = top + 2 * FIELDS_PX + roads.len() as i32 * (road_px + ROAD_AROUND_PX);
    let mut canvas = Canvas::new(WIDTH_PX, bottom + surround.below_px());
    let half = (WIDTH_PX - 30) / 2;
    for (column, (what, of)) in
        [("vehicles detected, %", detected as fn(&Ranked) -> f64), ("road in sight, %", road)].into_iter().enumerate()
    {
        let left = column as i32 * (half + 15);
        let place =
            fields(site, singles, what, of, ("across the road, m (+ left)", |m| m.y_m), ("height, m", |m| m.height_m));
        place.draw(&mut canvas, Area::new(left, top, half, FIELDS_PX));
        let turn =
            fields(site, singles, what, of, ("yaw, ° (+ left)", |m| m.yaw_deg), ("pitch, ° (+ down)", |m| m.pitch_deg));
        turn.draw(&mut canvas, Area::new(left, top + FIELDS_PX, half, FIELDS_PX));
    }
    for (k, set) in roads.iter().enumerate() {
        let above = top + 2 * FIELDS_PX + k as i32 * (road_px + ROAD_AROUND_PX) + 34;
        let Some([x, y]) = frame else { continue };
        let plot = Plot { area: Area::new(LEFT_PX, above, WIDTH_PX - LEFT_PX - RIGHT_PX, road_px), x, y };
        let members: Vec<String> = set.members.iter().map(|&m| name(&site.candidates[m].mount)).collect();
        let title = format!(
            "Best {}: {}",
            if k == 0 { "mount".into() } else { format!("{} mounts", k + 1) },
            members.join("; ")
        );
        canvas.text([plot.area.left as f32, above as f32 - 10.0], &title, Style::new(15.0, INK).bold());
        heatmap::cells(&mut canvas, &plot, &shares(site, set));
        for &m in &set.members {
            let mount = &site.candidates[m].mount;
            let (s, c) = mount.yaw_deg.to_radians().sin_cos();
            let at = [mount.x_m, mount.y_m];
            overlay::sensor(&mut canvas, plot.at(at), plot.at([at[0] + c, at[1] + s]));
        }
        plot.axes(&mut canvas, "x, along the road (m)", "y (m)");
    }
    surround.draw(&mut canvas, bottom);
    canvas
}

fn detected(set: &Ranked) -> f64 {
    set.detected[0]
}

fn road(set: &Ranked) -> f64 {
    set.road[0]
}

/// A figure of a mount, with its title.
type Axis = (&'static str, fn(&Mount) -> f64);

fn fields(site: &Site, singles: &[Ranked], what: &str, of: fn(&Ranked) -> f64, x: Axis, y: Axis) -> Fields {
    let values = |axis: Axis| {
        let mut values: Vec<f64> = singles.iter().map(|s| axis.1(&site.candidates[s.members[0]].mount)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let (columns, rows) = (values(x), values(y));
    let best = |row: f64, column: f64| {
        let at = |s: &&Ranked| {
            let mount = &site.candidates[s.members[0]].mount;
            x.1(mount) == column && y.1(mount) == row
        };
        singles.iter().filter(at).map(of).reduce(f64::max)
    };
    Fields {
        range: [
            singles.iter().map(of).fold(f64::INFINITY, f64::min),
            singles.iter().map(of).fold(f64::NEG_INFINITY, f64::max),
        ],
        title: what.to_owned(),
        x_title: x.0,
        y_title: y.0,
        shares: rows.iter().flat_map(|&r| columns.iter().map(move |&c| (r, c))).map(|(r, c)| best(r, c)).collect(),
        x: columns,
        y: rows,
    }
}

/// What the cells span, a little more.
fn frame(cells: &[Cell]) -> Option<[[f64; 2]; 2]> {
    let span = |of: fn(&Cell) -> i32| {
        let values = || cells.iter().map(of);
        Some([f64::from(values().min()?) - 4.0, f64::from(values().max()?) + 5.0])
    };
    Some([span(|c| c.0)?, span(|c| c.1)?])
}

/// Share of time each cell was in sight of some member, of the time it was free.
fn shares(site: &Site, set: &Ranked) -> Vec<(Cell, f64)> {
    let seen = site.seen_by(&set.members);
    let shares = site.cells.iter().zip(&site.free).zip(seen);
    shares.filter(|((_, free), _)| **free > 0).map(|((c, free), n)| (*c, f64::from(n) / f64::from(*free))).collect()
}
