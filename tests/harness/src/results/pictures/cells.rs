//! A map's cells as coloured ground, seamless, and the legend that goes with it.

use viewshed::map::{CellState, Visibility};

use super::axes::Plot;
use super::canvas::{Area, Canvas, Colour, Pen};
use super::legend::Entry;
use super::palette;

/// Fills the rectangle `x` x `y` (data units) with the colour of a cell, edges on whole pixels.
pub fn fill(canvas: &mut Canvas, plot: &Plot, x: [f64; 2], y: [f64; 2], state: &CellState) {
    shade(canvas, plot, x, y, |px, py| palette::ground(state, px, py));
}

/// The same with any colour.
pub fn shade(canvas: &mut Canvas, plot: &Plot, x: [f64; 2], y: [f64; 2], colour: impl Fn(i32, i32) -> Colour) {
    let [left, right] = x.map(|v| plot.column(v).round() as i32);
    let [bottom, top] = y.map(|v| plot.row(v).round() as i32);
    canvas.shade(Area::new(left, top, right - left, bottom - top), colour);
}

/// What the cells of a map say beside visible, invisible and unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Carries {
    /// How sure it is.
    pub grades: bool,
    /// Whether something stands there.
    pub occupancy: bool,
}

impl Carries {
    /// As an estimator's.
    pub const ALL: Self = Self { grades: true, occupancy: true };
}

/// Visible, invisible, unknown, occupied; only what the cells carry.
pub fn legend(carries: Carries) -> Vec<Entry> {
    let state = |visibility, grade| CellState { visibility, grade, occupancy: 0, occupied: false };
    let swatch = |label: &str, width: i32, at: fn(f32) -> u8, of: Visibility| {
        Entry::new(label, width, move |canvas, area| {
            for x in area.left..area.right() {
                let share = (x - area.left) as f32 / area.width as f32;
                canvas.shade(Area::new(x, area.top, 1, area.height), |px, py| {
                    palette::ground(&state(of, at(share)), px, py)
                });
            }
            border(canvas, area);
        })
    };
    let mut entries = if carries.grades {
        vec![
            swatch("visible (paler: lower grade)", 56, |f| 255 - (127.0 * f) as u8, Visibility::Visible),
            swatch("invisible (paler: higher grade)", 56, |f| (127.0 * f) as u8, Visibility::Invisible),
        ]
    } else {
        vec![swatch("visible", 34, |_| 255, Visibility::Visible), swatch("invisible", 34, |_| 0, Visibility::Invisible)]
    };
    entries.push(swatch("unknown", 34, |_| 0, Visibility::Unknown));
    entries.extend(carries.occupancy.then(occupied));
    entries
}

/// The lattice over what is occupied.
pub fn occupied() -> Entry {
    Entry::new("occupied, over visible and invisible", 56, move |canvas, area| {
        let half = Area { width: area.width / 2, ..area };
        for (visibility, left) in [(Visibility::Visible, area.left), (Visibility::Invisible, area.left + half.width)] {
            let grade = if visibility == Visibility::Visible { 255 } else { 0 };
            let occupied = CellState { visibility, grade, occupancy: 0, occupied: true };
            canvas.shade(Area { left, ..half }, |px, py| palette::ground(&occupied, px, py));
        }
        border(canvas, area);
    })
}

fn border(canvas: &mut Canvas, area: Area) {
    let [left, right] = [area.left, area.right()].map(|v| v as f32 - 0.5);
    let [top, bottom] = [area.top, area.bottom()].map(|v| v as f32 - 0.5);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    canvas.polyline(&corners, true, Pen::new(Colour::hex(0x8A9098), 1.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_legend_has_what_the_cells_carry_and_no_more() {
        let labels = |grades, occupancy| {
            let entries = legend(Carries { grades, occupancy });
            entries.iter().map(|entry| entry.label().to_owned()).collect::<Vec<_>>().join("; ")
        };
        assert_eq!(labels(false, false), "visible; invisible; unknown");
        assert!(labels(true, false).contains("lower grade") && !labels(true, false).contains("occupied"));
        assert!(labels(false, true).ends_with("unknown; occupied, over visible and invisible"));
    }

    #[test]
    fn neighbouring_cells_leave_no_seam_and_do_not_overlap() {
        let plot = Plot { area: Area::new(0, 0, 97, 31), x: [0.0, 13.0], y: [0.0, 4.0] };
        let mut canvas = Canvas::new(97, 31);
        // each fill darkens by the same share, so a pixel hit twice or never would stand out
        let dark = CellState { visibility: Visibility::Visible, grade: 255, occupancy: 255, occupied: true };
        for i in 0..13 {
            for j in 0..4 {
                let [x, y] = [f64::from(i), f64::from(j)];
                fill(&mut canvas, &plot, [x, x + 1.0], [y, y + 1.0], &dark);
            }
        }
        assert!((0..31).all(|y| (0..97).all(|x| canvas.pixel(x, y) == palette::ground(&dark, x, y))));
    }
}
