//! Text as filled glyph outlines, in DejaVu Sans from inside the program.

use std::sync::LazyLock;

use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

use super::canvas::{Canvas, Colour, Pen, Pixel};

/// Height of capitals and digits, in font sizes.
const CAP_HEIGHT: f32 = 0.73;

static REGULAR: LazyLock<Face<'static>> = LazyLock::new(|| face(dejavu::sans::regular()));
static BOLD: LazyLock<Face<'static>> = LazyLock::new(|| face(dejavu::sans::bold()));

fn face(bytes: &'static [u8]) -> Face<'static> {
    // the bytes are part of the program and every test that draws text parses them
    Face::parse(bytes, 0).expect("the built-in font is well formed")
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    Left,
    Centre,
    Right,
}

/// How a line of text is set.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    pub size_px: f32,
    pub colour: Colour,
    pub bold: bool,
    pub align: Align,
    /// Reads from the bottom to the top.
    pub upright: bool,
    /// White rim, for text on a map.
    pub halo: bool,
}

impl Style {
    pub const fn new(size_px: f32, colour: Colour) -> Self {
        Self { size_px, colour, bold: false, align: Align::Left, upright: false, halo: false }
    }

    pub const fn bold(self) -> Self {
        Self { bold: true, ..self }
    }

    pub const fn align(self, align: Align) -> Self {
        Self { align, ..self }
    }

    pub const fn upright(self) -> Self {
        Self { upright: true, ..self }
    }

    pub const fn halo(self) -> Self {
        Self { halo: true, ..self }
    }

    fn face(&self) -> &'static Face<'static> {
        if self.bold { &BOLD } else { &REGULAR }
    }

    fn scale(&self) -> f32 {
        self.size_px / f32::from(self.face().units_per_em())
    }

    /// Length of a line, pixels.
    pub fn width(&self, text: &str) -> f32 {
        let face = self.face();
        let units: u32 =
            text.chars().map(|c| u32::from(face.glyph_hor_advance(glyph(face, c)).unwrap_or_default())).sum();
        units as f32 * self.scale()
    }

    /// Breaks a text at its blanks into lines of at most `width_px`; a longer word stays whole.
    pub fn wrap(&self, text: &str, width_px: f32) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}")) <= width_px => {
                    line.push(' ');
                    line.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
        lines
    }
}

impl Canvas {
    /// Sets a line of text; `at` is on its baseline, at the end or middle `style.align` says.
    pub fn text(&mut self, at: Pixel, text: &str, style: Style) {
        let Some(path) = outline(at, text, style) else { return };
        if style.halo {
            self.stroke(&path, Pen::new(Colour::WHITE, 3.0));
        }
        self.fill(&path, style.colour);
    }

    /// Sets a line of text with its capitals centred on `at` across the reading direction.
    pub fn text_middle(&mut self, [x, y]: Pixel, text: &str, style: Style) {
        let shift = (style.size_px * CAP_HEIGHT / 2.0).round();
        self.text(if style.upright { [x + shift, y] } else { [x, y + shift] }, text, style);
    }
}

fn glyph(face: &Face, c: char) -> GlyphId {
    face.glyph_index(c).unwrap_or_default()
}

fn outline([x, y]: Pixel, text: &str, style: Style) -> Option<Path> {
    let (face, scale) = (style.face(), style.scale());
    let mut line = Line { builder: PathBuilder::new(), scale, pen: 0.0 };
    for c in text.chars() {
        let id = glyph(face, c);
        face.outline_glyph(id, &mut line);
        line.pen += f32::from(face.glyph_hor_advance(id).unwrap_or_default()) * scale;
    }
    let start = match style.align {
        Align::Left => 0.0,
        Align::Centre => -line.pen / 2.0,
        Align::Right => -line.pen,
    };
    // whole pixels keep stems and baselines sharp
    let placed = if style.upright {
        Transform::from_row(0.0, -1.0, 1.0, 0.0, x.round(), (y - start).round())
    } else {
        Transform::from_translate((x + start).round(), y.round())
    };
    line.builder.finish()?.transform(placed)
}

/// Glyphs of one line, from font units (y up) to pixels (y down).
struct Line {
    builder: PathBuilder,
    scale: f32,
    /// Where the next glyph starts, pixels.
    pen: f32,
}

impl Line {
    fn x(&self, x: f32) -> f32 {
        self.pen + x * self.scale
    }

    fn y(&self, y: f32) -> f32 {
        -y * self.scale
    }
}

impl OutlineBuilder for Line {
    fn move_to(&mut self, x: f32, y: f32) {
        self.builder.move_to(self.x(x), self.y(y));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.builder.line_to(self.x(x), self.y(y));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.builder.quad_to(self.x(x1), self.y(y1), self.x(x), self.y(y));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.builder.cubic_to(self.x(x1), self.y(y1), self.x(x2), self.y(y2), self.x(x), self.y(y));
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLACK: Colour = Colour::hex(0);

    fn ink(canvas: &Canvas, columns: std::ops::Range<i32>, rows: std::ops::Range<i32>) -> i32 {
        rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
            .map(|(x, y)| 255 - i32::from(canvas.pixel(x, y).red))
            .sum()
    }

    #[test]
    fn letters_stand_on_the_baseline_the_right_way_up() {
        let mut canvas = Canvas::new(40, 40);
        canvas.text([10.0, 30.0], "L", Style::new(20.0, BLACK));
        assert_eq!(ink(&canvas, 0..40, 31..40), 0, "nothing below the baseline");
        assert!(ink(&canvas, 10..25, 25..31) > ink(&canvas, 10..25, 14..20), "the foot of the L is at the bottom");
    }

    #[test]
    fn upright_text_reads_upwards() {
        let mut canvas = Canvas::new(40, 60);
        canvas.text([30.0, 50.0], "L.", Style::new(30.0, BLACK).upright());
        assert_eq!(ink(&canvas, 31..40, 0..60), 0, "the baseline is to the right");
        assert!(ink(&canvas, 0..40, 30..50) > ink(&canvas, 0..40, 10..30), "the L comes before the point");
    }

    #[test]
    fn width_is_what_is_drawn_and_alignment_follows_it() {
        let style = Style::new(16.0, BLACK).align(Align::Right);
        let mut canvas = Canvas::new(100, 20);
        canvas.text([90.0, 16.0], "HHH", style);
        let left = 90 - style.width("HHH") as i32;
        assert_eq!(ink(&canvas, 0..left - 1, 0..20) + ink(&canvas, 91..100, 0..20), 0);
        assert!(ink(&canvas, left..left + 5, 0..20) > 0);
    }

    #[test]
    fn text_is_broken_at_blanks() {
        let style = Style::new(16.0, BLACK);
        let lines = style.wrap("seen by nobody", style.width("seen by") + 1.0);
        assert_eq!(lines, ["seen by", "nobody"]);
    }
}
