//! Heat maps: a table of shares as coloured, numbered fields, and shares of road cells.

use super::axes::Plot;
use super::canvas::{Area, Canvas, Colour, Pen};
use super::legend::Entry;
use super::palette::{FAINT_INK, INK};
use super::text::{Align, Style};
use crate::evaluation::samples::Cell;

/// From nothing to all: dark to light blue-green to yellow, growing lighter all the way (after viridis).
const RAMP: [u32; 6] = [0x440154, 0x414487, 0x2A788E, 0x22A884, 0x7AD151, 0xFDE725];
/// Nobody tried it, or it cannot be.
const NOTHING: Colour = Colour::hex(0xE6E8EB);

/// Colour of a share between the least (0) and the greatest (1).
pub fn colour(share: f64) -> Colour {
    let place = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let below = (place.floor() as usize).min(RAMP.len() - 2);
    Colour::hex(RAMP[below]).mix(Colour::hex(RAMP[below + 1]), (place - below as f64) as f32)
}

/// One heat map of numbered fields.
pub struct Fields {
    pub title: String,
    pub x_title: &'static str,
    pub y_title: &'static str,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Share of (x, y), row by row from the least y; `None` where there is none.
    pub shares: Vec<Option<f64>>,
    /// Shares at the ends of the colours.
    pub range: [f64; 2],
}

/// Room around the fields, pixels.
const LEFT_PX: i32 = 82;
const ABOVE_PX: i32 = 34;
const BELOW_PX: i32 = 58;

impl Fields {
    /// Draws into an area, room for title and axes included.
    pub fn draw(&self, canvas: &mut Canvas, area: Area) {
        let inner = Area::new(
            area.left + LEFT_PX,
            area.top + ABOVE_PX,
            area.width - LEFT_PX - 10,
            area.height - ABOVE_PX - BELOW_PX,
        );
        canvas.text([inner.left as f32, area.top as f32 + 20.0], &self.title, Style::new(15.0, INK).bold());
        let [least, most] = self.range;
        let edge = |k: usize, count: usize, from: i32, length: i32| from + length * k as i32 / count.max(1) as i32;
        let number = Style::new(14.0, FAINT_INK);
        for (row, y) in self.y.iter().enumerate() {
            let bottom = inner.bottom() - edge(row, self.y.len(), 0, inner.height);
            let top = inner.bottom() - edge(row + 1, self.y.len(), 0, inner.height);
            let middle = (top + bottom) as f32 / 2.0;
            canvas.text_middle([inner.left as f32 - 9.0, middle], &label(*y), number.align(Align::Right));
            for column in 0..self.x.len() {
                let [left, right] = [column, column + 1].map(|k| edge(k, self.x.len(), inner.left, inner.width));
                let field = Area::new(left, top, right - left - 1, bottom - top - 1);
                let share = self.shares.get(row * self.x.len() + column).copied().flatten();
                let relative = share.map(|s| if most > least { (s - least) / (most - least) } else { 1.0 });
                canvas.rectangle(field, relative.map_or(NOTHING, colour));
                let ink = if relative.is_some_and(|r| r < 0.55) { Colour::WHITE } else { INK };
                let text = share.map_or_else(|| "–".into(), |s| format!("{:.1}", 100.0 * s));
                if field.width > 34 {
                    let at = [(left + right) as f32 / 2.0, middle];
                    canvas.text_middle(at, &text, Style::new(14.0, ink).align(Align::Centre));
                }
            }
        }
        for (column, x) in self.x.iter().enumerate() {
            let [left, right] = [column, column + 1].map(|k| edge(k, self.x.len(), inner.left, inner.width));
            let at = [(left + right) as f32 / 2.0, inner.bottom() as f32 + 20.0];
            canvas.text(at, &label(*x), number.align(Align::Centre));
        }
        let title = Style::new(15.0, INK).align(Align::Centre);
        let [middle_x, middle_y] =
            [(inner.left + inner.right()) as f32 / 2.0, (inner.top + inner.bottom()) as f32 / 2.0];
        canvas.text([middle_x, inner.bottom() as f32 + 43.0], self.x_title, title);
        canvas.text_middle([inner.left as f32 - 60.0, middle_y], self.y_title, title.upright());
    }
}

fn label(value: f64) -> String {
    value.to_string().replace('-', "\u{2212}")
}

/// Road cells, each in the colour of its share from 0 to 1.
pub fn cells(canvas: &mut Canvas, plot: &Plot, shares: &[(Cell, f64)]) {
    canvas.within(plot.area, |canvas| {
        for &((i, j), share) in shares {
            let [left, right] = [i, i + 1].map(|v| plot.column(f64::from(v)).round() as i32);
            let [bottom, top] = [j, j + 1].map(|v| plot.row(f64::from(v)).round() as i32);
            canvas.rectangle(Area::new(left, top, right - left, bottom - top), colour(share));
        }
    });
}

/// The ramp with what its ends mean.
pub fn legend(label: &str) -> Entry {
    Entry::new(label, 120, |canvas, area| {
        canvas.shade(area, |x, _| colour(f64::from(x - area.left) / f64::from(area.width)));
        let [left, right] = [area.left as f32, area.right() as f32];
        let [top, bottom] = [area.top as f32, area.bottom() as f32];
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        canvas.polyline(&corners, true, Pen::new(FAINT_INK, 1.0));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_lighter_all_the_way() {
        let light = |share: f64| {
            let c = colour(share);
            0.299 * f64::from(c.red) + 0.587 * f64::from(c.green) + 0.114 * f64::from(c.blue)
        };
        for k in 0..50 {
            assert!(light(f64::from(k + 1) / 50.0) > light(f64::from(k) / 50.0), "{k}");
        }
    }

    #[test]
    fn the_least_y_is_at_the_bottom_and_the_least_x_at_the_left() {
        let fields = Fields {
            title: String::new(),
            x_title: "",
            y_title: "",
            x: vec![0.0, 1.0],
            y: vec![0.0, 1.0],
            shares: vec![Some(1.0), None, None, Some(0.0)],
            range: [0.0, 1.0],
        };
        let mut canvas = Canvas::new(492, 292);
        fields.draw(&mut canvas, Area::new(0, 0, 492, 292));
        // fields of 200 x 100 from (82, 34)
        assert_eq!(canvas.pixel(90, 225), colour(1.0));
        assert_eq!(canvas.pixel(470, 40), colour(0.0));
        assert_eq!(canvas.pixel(90, 40), NOTHING);
    }
}
