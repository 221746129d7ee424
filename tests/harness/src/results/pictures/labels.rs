//! Short texts beside points, none on top of another, and points spaced out along a line.

use super::canvas::{Area, Canvas, Pen, Pixel};
use super::palette::FAINT_INK;
use super::text::{Align, Style};

/// Distances from the point that are tried, pixels.
const GAPS_PX: [f32; 5] = [8.0, 14.0, 26.0, 42.0, 62.0];
/// From this gap on a thin line joins text and point.
const LEADER_PX: f32 = 20.0;
/// Distance from the point at which the line starts, pixels.
const LEADER_START_PX: f32 = 9.0;
/// Right, above, left, below, then the corners (x right, y down).
const SIDES: [Pixel; 8] =
    [[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [-1.0, 1.0]];

/// Places already taken.
pub struct Labels {
    bounds: Area,
    taken: Vec<Area>,
}

impl Labels {
    pub fn new(bounds: Area) -> Self {
        Self { bounds, taken: Vec::new() }
    }

    /// Keeps labels off a disc.
    pub fn avoid(&mut self, [x, y]: Pixel, radius_px: f32) {
        let side = (2.0 * radius_px).ceil() as i32;
        self.taken.push(Area::new((x - radius_px) as i32, (y - radius_px) as i32, side, side));
    }

    /// Keeps labels off a line.
    pub fn avoid_line(&mut self, from: Pixel, to: Pixel) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let steps = (dx.hypot(dy) / 6.0).ceil().clamp(1.0, 1000.0) as usize;
        for k in 0..=steps {
            let f = k as f32 / steps as f32;
            self.avoid([from[0] + f * dx, from[1] + f * dy], 3.0);
        }
    }

    /// Keeps labels off the rectangle around points.
    pub fn avoid_all(&mut self, points: &[Pixel]) {
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        let [x, y] = [0, 1].map(|k| points.iter().fold(none, |[lo, hi], p| [lo.min(p[k]), hi.max(p[k])]));
        let side = |[lo, hi]: [f32; 2]| (lo.floor() as i32, (hi - lo).ceil() as i32 + 1);
        let ((left, width), (top, height)) = (side(x), side(y));
        self.taken.push(Area::new(left, top, width, height));
    }

    /// Sets a text beside a point, no farther than `reach_px` away; whether there was room.
    pub fn place(&mut self, canvas: &mut Canvas, point: Pixel, text: &str, style: Style, reach_px: f32) -> bool {
        let (width, height) = (style.width(text).ceil() + 6.0, style.size_px.ceil() + 2.0);
        for gap in GAPS_PX.into_iter().filter(|g| *g <= reach_px) {
            for [right, down] in SIDES {
                let slant = if right * down == 0.0 { 1.0 } else { 0.7 };
                let beside = |reach: f32| [point[0] + right * slant * reach, point[1] + down * slant * reach];
                let near = beside(gap);
                let middle = [near[0] + right * width / 2.0, near[1] + down * height / 2.0];
                let area = Area::new(
                    (middle[0] - width / 2.0) as i32,
                    (middle[1] - height / 2.0) as i32,
                    width as i32,
                    height as i32,
                );
                if !self.bounds.holds(&area) || self.taken.iter().any(|t| t.overlaps(&area)) {
                    continue;
                }
                if gap >= LEADER_PX {
                    canvas.line(beside(LEADER_START_PX), near, Pen::new(FAINT_INK, 1.0));
                }
                canvas.text_middle(middle, text, style.align(Align::Centre));
                self.taken.push(area);
                return true;
            }
        }
        false
    }
}

/// Both ends of a line and points between them that are at least `gap_px` from the one before.
pub fn spaced(line: &[Pixel], gap_px: f32) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    for (k, &p) in line.iter().enumerate() {
        if chosen.last().is_none_or(|&last| distance(line[last], p) >= gap_px) {
            chosen.push(k);
        }
    }
    let end = line.len().saturating_sub(1);
    if chosen.len() > 1 && chosen.last() != Some(&end) {
        // too near the end: the end itself takes its place
        chosen.pop();
        chosen.push(end);
    }
    chosen
}

fn distance(a: Pixel, b: Pixel) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::pictures::canvas::Colour;

    #[test]
    fn labels_of_one_point_never_overlap_and_stay_inside() {
        let bounds = Area::new(0, 0, 200, 120);
        let mut canvas = Canvas::new(200, 120);
        let mut labels = Labels::new(bounds);
        let style = Style::new(14.0, Colour::hex(0));
        let placed = (0..40).filter(|_| labels.place(&mut canvas, [100.0, 60.0], "radar", style, 100.0)).count();
        assert!((6..40).contains(&placed), "{placed}");
        for (i, a) in labels.taken.iter().enumerate() {
            assert!(bounds.holds(a));
            assert!(labels.taken[i + 1..].iter().all(|b| !a.overlaps(b)));
        }
    }

    #[test]
    fn a_line_is_kept_free() {
        let mut canvas = Canvas::new(200, 100);
        let mut labels = Labels::new(Area::new(0, 0, 200, 100));
        labels.avoid_line([0.0, 50.0], [200.0, 50.0]);
        assert!(labels.place(&mut canvas, [100.0, 50.0], "x", Style::new(14.0, Colour::hex(0)), 30.0));
        let area = labels.taken[labels.taken.len() - 1];
        assert!(area.bottom() <= 48 || area.top >= 52);
    }

    #[test]
    fn dots_keep_their_distance_and_hold_both_ends() {
        let line: Vec<Pixel> = (0..257_u16).map(|k| [f32::from(k) / 2.0, 0.0]).collect();
        let dots = spaced(&line, 14.0);
        assert_eq!((dots.first(), dots.last()), (Some(&0), Some(&256)));
        assert!(dots.windows(2).all(|d| line[d[1]][0] - line[d[0]][0] >= 14.0));
        assert!(spaced(&[], 14.0).is_empty());
    }
}
