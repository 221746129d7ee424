//! Titles above, legends and captions below: what stands around a plot.

use super::canvas::{Area, Canvas};
use super::palette::{FAINT_INK, INK};
use super::text::Style;

/// Width of every picture, pixels.
pub const WIDTH_PX: i32 = 1400;
/// Free border at the left and right of texts, pixels.
const BORDER_PX: i32 = 22;

const TITLE: Style = Style::new(20.0, INK).bold();
const CAPTION: Style = Style::new(14.0, FAINT_INK);
const ENTRY: Style = Style::new(14.0, INK);

const TITLE_LINE_PX: i32 = 28;
const CAPTION_LINE_PX: i32 = 20;
const ROW_PX: i32 = 27;
const SYMBOL_GAP_PX: i32 = 8;
const ENTRY_GAP_PX: i32 = 26;

/// Draws a sample into its area.
type Symbol = Box<dyn Fn(&mut Canvas, Area)>;

/// One symbol and what it means.
pub struct Entry {
    label: String,
    symbol_px: i32,
    symbol: Symbol,
}

impl Entry {
    pub fn new(label: impl Into<String>, symbol_px: i32, symbol: impl Fn(&mut Canvas, Area) + 'static) -> Self {
        Self { label: label.into(), symbol_px, symbol: Box::new(symbol) }
    }

    /// What it means.
    pub fn label(&self) -> &str {
        &self.label
    }

    fn width(&self) -> i32 {
        self.symbol_px + SYMBOL_GAP_PX + ENTRY.width(&self.label).ceil() as i32
    }
}

/// The texts of one picture; each group of entries starts a row of its own.
pub struct Surround {
    pub title: String,
    pub caption: Option<String>,
    pub legend: Vec<Vec<Entry>>,
}

impl Surround {
    fn text_width() -> f32 {
        (WIDTH_PX - 2 * BORDER_PX) as f32
    }

    fn title_lines(&self) -> Vec<String> {
        TITLE.wrap(&self.title, Self::text_width())
    }

    fn caption_lines(&self) -> Vec<String> {
        self.caption.as_deref().map(|c| CAPTION.wrap(c, Self::text_width())).unwrap_or_default()
    }

    /// Rows of entries with their left edges.
    fn rows(&self) -> Vec<Vec<(i32, &Entry)>> {
        let mut rows: Vec<Vec<(i32, &Entry)>> = Vec::new();
        for group in &self.legend {
            let mut left = WIDTH_PX;
            for entry in group {
                if left + entry.width() > WIDTH_PX - BORDER_PX {
                    rows.push(Vec::new());
                    left = BORDER_PX;
                }
                if let Some(row) = rows.last_mut() {
                    row.push((left, entry));
                }
                left += entry.width() + ENTRY_GAP_PX;
            }
        }
        rows
    }

    /// Pixels above the first plot.
    pub fn above_px(&self) -> i32 {
        30 + TITLE_LINE_PX * self.title_lines().len() as i32
    }

    /// Pixels below the last plot with its axis.
    pub fn below_px(&self) -> i32 {
        let caption = self.caption_lines().len() as i32;
        10 + ROW_PX * self.rows().len() as i32 + CAPTION_LINE_PX * caption + if caption > 0 { 20 } else { 8 }
    }

    /// Draws the texts around plots that end at `plots_bottom`, axis titles included.
    pub fn draw(&self, canvas: &mut Canvas, plots_bottom: i32) {
        for (k, line) in self.title_lines().iter().enumerate() {
            canvas.text([BORDER_PX as f32, (34 + TITLE_LINE_PX * k as i32) as f32], line, TITLE);
        }
        let mut top = plots_bottom + 10;
        for row in self.rows() {
            for (left, entry) in row {
                (entry.symbol)(canvas, Area::new(left, top + 4, entry.symbol_px, ROW_PX - 8));
                let text_left = (left + entry.symbol_px + SYMBOL_GAP_PX) as f32;
                canvas.text_middle([text_left, (top + ROW_PX / 2) as f32], &entry.label, ENTRY);
            }
            top += ROW_PX;
        }
        for line in self.caption_lines() {
            top += CAPTION_LINE_PX;
            canvas.text([BORDER_PX as f32, top as f32], &line, CAPTION);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_legend_wraps_inside_the_picture() {
        let entry = |k: usize| Entry::new(format!("an estimator with a long name, {k}"), 30, |_, _| ());
        let surround = Surround { title: "t".into(), caption: None, legend: vec![(0..9).map(entry).collect()] };
        let rows = surround.rows();
        assert!(rows.len() > 1);
        assert_eq!(rows.iter().map(Vec::len).sum::<usize>(), 9);
        for (left, entry) in rows.into_iter().flatten() {
            assert!(left >= BORDER_PX && left + entry.width() <= WIDTH_PX - BORDER_PX);
        }
    }
}
