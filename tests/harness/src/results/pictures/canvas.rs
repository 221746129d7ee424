//! What every picture is drawn with: anti-aliased lines, polygons and discs on white, PNG out.

use anyhow::{Context, Result};
use tiny_skia::{
    Color, ColorU8, FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform,
};

use crate::results::files::Target;

/// A place on the picture, pixels, x to the right, y **down**.
pub type Pixel = [f32; 2];

/// An 8-bit colour with opacity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour {
    pub red: u8,
    pub green: u8,
    pub blue: u8,
    pub alpha: u8,
}

impl Colour {
    pub const WHITE: Self = Self::hex(0xFFFFFF);

    /// Opaque, from 0xRRGGBB.
    pub const fn hex(rgb: u32) -> Self {
        let [_, red, green, blue] = rgb.to_be_bytes();
        Self { red, green, blue, alpha: 255 }
    }

    pub const fn opacity(self, alpha: u8) -> Self {
        Self { alpha, ..self }
    }

    /// `self` at 0, `other` at 1.
    pub fn mix(self, other: Self, share: f32) -> Self {
        let share = share.clamp(0.0, 1.0);
        let mix = |a: u8, b: u8| (f32::from(a) + share * (f32::from(b) - f32::from(a))).round() as u8;
        Self {
            red: mix(self.red, other.red),
            green: mix(self.green, other.green),
            blue: mix(self.blue, other.blue),
            alpha: mix(self.alpha, other.alpha),
        }
    }
}

/// A rectangle of whole pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    pub left: i32,
    pub top: i32,
    pub width: i32,
    pub height: i32,
}

impl Area {
    pub const fn new(left: i32, top: i32, width: i32, height: i32) -> Self {
        Self { left, top, width, height }
    }

    pub const fn right(&self) -> i32 {
        self.left + self.width
    }

    pub const fn bottom(&self) -> i32 {
        self.top + self.height
    }

    pub const fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right() && other.left < self.right() && self.top < other.bottom() && other.top < self.bottom()
    }

    pub const fn holds(&self, other: &Self) -> bool {
        self.left <= other.left
            && self.top <= other.top
            && other.right() <= self.right()
            && other.bottom() <= self.bottom()
    }
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Pen {
    pub colour: Colour,
    pub width_px: f32,
    /// Lengths of dash and gap in pixels; empty for a solid line.
    pub dash: &'static [f32],
}

impl Pen {
    pub const fn new(colour: Colour, width_px: f32) -> Self {
        Self { colour, width_px, dash: &[] }
    }

    pub const fn dashed(self, dash: &'static [f32]) -> Self {
        Self { dash, ..self }
    }

    /// The white line under this one that keeps it readable on any ground.
    pub const fn halo(self) -> Self {
        Self { colour: Colour::WHITE, width_px: self.width_px + 2.0, dash: &[] }
    }
}

/// A picture while it is drawn; white at first.
pub struct Canvas {
    pixmap: Pixmap,
    clip: Option<(Area, Mask)>,
}

impl Canvas {
    pub fn new(width: i32, height: i32) -> Self {
        let side = |v: i32| v.clamp(1, 20_000) as u32;
        // at least one pixel and at most 1.6 GB, which is what `Pixmap` asks for
        let mut pixmap = Pixmap::new(side(width), side(height)).expect("sides are in range");
        pixmap.fill(Color::WHITE);
        Self { pixmap, clip: None }
    }

    pub fn width(&self) -> i32 {
        self.pixmap.width() as i32
    }

    pub fn height(&self) -> i32 {
        self.pixmap.height() as i32
    }

    /// Draws with everything outside `area` left as it is.
    pub fn within(&mut self, area: Area, draw: impl FnOnce(&mut Self)) {
        let mask = Mask::new(self.pixmap.width(), self.pixmap.height()).zip(rectangle(area)).map(|(mut mask, rect)| {
            mask.fill_path(&PathBuilder::from_rect(rect), FillRule::Winding, false, Transform::identity());
            (area, mask)
        });
        let outer = std::mem::replace(&mut self.clip, mask);
        draw(self);
        self.clip = outer;
    }

    /// Fills whole pixels, edges sharp.
    pub fn rectangle(&mut self, area: Area, colour: Colour) {
        self.shade(area, |_, _| colour);
    }

    /// Fills whole pixels, each with the colour of its column and row.
    pub fn shade(&mut self, area: Area, colour: impl Fn(i32, i32) -> Colour) {
        let mut limits = Area::new(0, 0, self.width(), self.height());
        if let Some((clip, _)) = &self.clip {
            limits = *clip;
        }
        let width = self.width();
        for y in area.top.max(limits.top).max(0)..area.bottom().min(limits.bottom()).min(self.height()) {
            for x in area.left.max(limits.left).max(0)..area.right().min(limits.right()).min(width) {
                let pixel = &mut self.pixmap.pixels_mut()[(y * width + x) as usize];
                let over = colour(x, y);
                let under = Colour { red: pixel.red(), green: pixel.green(), blue: pixel.blue(), alpha: pixel.alpha() };
                let mixed = under.mix(over.opacity(255), f32::from(over.alpha) / 255.0);
                *pixel = ColorU8::from_rgba(mixed.red, mixed.green, mixed.blue, 255).premultiply();
            }
        }
    }

    pub fn line(&mut self, from: Pixel, to: Pixel, pen: Pen) {
        self.polyline(&[from, to], false, pen);
    }

    pub fn polyline(&mut self, points: &[Pixel], closed: bool, pen: Pen) {
        if let Some(path) = path(points, closed) {
            self.stroke(&path, pen);
        }
    }

    pub fn polygon(&mut self, points: &[Pixel], colour: Colour) {
        if let Some(path) = path(points, true) {
            self.fill(&path, colour);
        }
    }

    pub fn disc(&mut self, [x, y]: Pixel, radius_px: f32, colour: Colour) {
        if let Some(path) = PathBuilder::from_circle(x, y, radius_px) {
            self.fill(&path, colour);
        }
    }

    pub fn ring(&mut self, [x, y]: Pixel, radius_px: f32, pen: Pen) {
        if let Some(path) = PathBuilder::from_circle(x, y, radius_px) {
            self.stroke(&path, pen);
        }
    }

    pub(super) fn fill(&mut self, path: &tiny_skia::Path, colour: Colour) {
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        self.pixmap.fill_path(path, &paint(colour), FillRule::Winding, Transform::identity(), mask);
    }

    pub(super) fn stroke(&mut self, path: &tiny_skia::Path, pen: Pen) {
        let stroke = Stroke {
            width: pen.width_px,
            line_cap: if pen.dash.is_empty() { LineCap::Round } else { LineCap::Butt },
            line_join: LineJoin::Round,
            dash: if pen.dash.is_empty() { None } else { StrokeDash::new(pen.dash.to_vec(), 0.0) },
            ..Stroke::default()
        };
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        self.pixmap.stroke_path(path, &paint(pen.colour), &stroke, Transform::identity(), mask);
    }

    /// The colour of one pixel; white outside the picture.
    pub fn pixel(&self, x: i32, y: i32) -> Colour {
        let inside = u32::try_from(x).ok().zip(u32::try_from(y).ok());
        inside.and_then(|(x, y)| self.pixmap.pixel(x, y)).map_or(Colour::WHITE, |p| Colour {
            red: p.red(),
            green: p.green(),
            blue: p.blue(),
            alpha: p.alpha(),
        })
    }

    /// # Errors
    /// What the encoder says.
    pub fn png(&self) -> Result<Vec<u8>> {
        self.pixmap.encode_png().context("cannot encode a PNG picture")
    }

    /// # Errors
    /// A file that cannot be written, by name.
    pub fn save(&self, target: &Target) -> Result<()> {
        target.write(self.png()?)
    }
}

fn rectangle(area: Area) -> Option<Rect> {
    Rect::from_ltrb(area.left as f32, area.top as f32, area.right() as f32, area.bottom() as f32)
}

fn paint(colour: Colour) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(colour.red, colour.green, colour.blue, colour.alpha);
    paint.anti_alias = true;
    paint
}

fn path(points: &[Pixel], closed: bool) -> Option<tiny_skia::Path> {
    let (first, rest) = points.split_first()?;
    let mut builder = PathBuilder::new();
    builder.move_to(first[0], first[1]);
    for p in rest {
        builder.line_to(p[0], p[1]);
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Colour = Colour::hex(0xFF0000);

    #[test]
    fn hex_reads_red_first() {
        assert_eq!(Colour::hex(0x010203), Colour { red: 1, green: 2, blue: 3, alpha: 255 });
    }

    #[test]
    fn nothing_is_drawn_outside_the_clip() {
        let mut canvas = Canvas::new(20, 20);
        canvas.within(Area::new(5, 5, 10, 10), |c| {
            c.polygon(&[[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]], RED);
            c.rectangle(Area::new(0, 0, 3, 3), RED);
        });
        assert_eq!((canvas.pixel(5, 5), canvas.pixel(14, 14)), (RED, RED));
        assert_eq!([canvas.pixel(4, 5), canvas.pixel(15, 14), canvas.pixel(1, 1)], [Colour::WHITE; 3]);
        canvas.rectangle(Area::new(0, 0, 3, 3), RED);
        assert_eq!(canvas.pixel(1, 1), RED, "the clip ends with its scope");
    }

    #[test]
    fn y_points_down_and_half_opacity_mixes() {
        let mut canvas = Canvas::new(4, 4);
        canvas.rectangle(Area::new(1, 3, 1, 1), Colour::hex(0).opacity(128));
        assert_eq!(canvas.pixel(1, 3).red, 127);
        assert_eq!(canvas.pixel(1, 0), Colour::WHITE);
    }

    #[test]
    fn the_file_is_a_png() {
        assert_eq!(Canvas::new(3, 2).png().unwrap()[..4], [0x89, b'P', b'N', b'G']);
    }
}
