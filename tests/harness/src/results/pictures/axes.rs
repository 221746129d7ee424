//! From data to pixels: plot areas, round tick positions, frames and titles.

use super::canvas::{Area, Canvas, Colour, Pen, Pixel};
use super::palette::{FAINT_INK, INK};
use super::text::{Align, Style};

/// Room a plot needs around its area for ticks and titles, pixels.
pub const LEFT_PX: i32 = 82;
pub const RIGHT_PX: i32 = 28;
pub const BELOW_PX: i32 = 58;

/// Closest ticks, pixels.
const TICK_GAP_X_PX: f64 = 62.0;
const TICK_GAP_Y_PX: f64 = 38.0;

const TICKS: Style = Style::new(14.0, FAINT_INK);
const TITLES: Style = Style::new(15.0, INK);

/// An area of the picture and the data it shows: x to the right, y **up**.
#[derive(Debug, Clone, Copy)]
pub struct Plot {
    pub area: Area,
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Plot {
    pub fn column(&self, x: f64) -> f64 {
        f64::from(self.area.left) + (x - self.x[0]) / (self.x[1] - self.x[0]) * f64::from(self.area.width)
    }

    pub fn row(&self, y: f64) -> f64 {
        f64::from(self.area.bottom()) - (y - self.y[0]) / (self.y[1] - self.y[0]) * f64::from(self.area.height)
    }

    pub fn at(&self, [x, y]: [f64; 2]) -> Pixel {
        [self.column(x) as f32, self.row(y) as f32]
    }

    /// Pixels per unit of x.
    pub fn scale(&self) -> f64 {
        f64::from(self.area.width) / (self.x[1] - self.x[0])
    }

    pub fn shows(&self, [x, y]: [f64; 2]) -> bool {
        (self.x[0]..=self.x[1]).contains(&x) && (self.y[0]..=self.y[1]).contains(&y)
    }

    /// Lines through every tick, inside the area.
    pub fn grid(&self, canvas: &mut Canvas, colour: Colour) {
        let pen = Pen::new(colour, 1.0);
        let Area { left, top, .. } = self.area;
        for tick in self.x_ticks().positions() {
            let x = crisp(self.column(tick));
            canvas.line([x, top as f32], [x, self.area.bottom() as f32], pen);
        }
        for tick in self.y_ticks().positions() {
            let y = crisp(self.row(tick));
            canvas.line([left as f32, y], [self.area.right() as f32, y], pen);
        }
    }

    /// Frame, ticks with numbers, and titles (quantity and unit).
    pub fn axes(&self, canvas: &mut Canvas, x_title: &str, y_title: &str) {
        let pen = Pen::new(FAINT_INK, 1.0);
        let [left, right] = [self.area.left, self.area.right()].map(|v| v as f32 - 0.5);
        let [top, bottom] = [self.area.top, self.area.bottom()].map(|v| v as f32 - 0.5);
        canvas.polyline(&[[left, top], [right, top], [right, bottom], [left, bottom]], true, pen);
        let ticks = self.x_ticks();
        for tick in ticks.positions() {
            let x = crisp(self.column(tick));
            canvas.line([x, bottom], [x, bottom + 5.0], pen);
            canvas.text([x, bottom + 20.5], &ticks.label(tick), TICKS.align(Align::Centre));
        }
        let ticks = self.y_ticks();
        for tick in ticks.positions() {
            let y = crisp(self.row(tick));
            canvas.line([left - 5.0, y], [left, y], pen);
            canvas.text_middle([left - 9.5, y], &ticks.label(tick), TICKS.align(Align::Right));
        }
        let style = TITLES.align(Align::Centre);
        canvas.text([(left + right) / 2.0, bottom + 43.5], x_title, style);
        canvas.text_middle([left - 60.5, (top + bottom) / 2.0], y_title, style.upright());
    }

    fn x_ticks(&self) -> Ticks {
        Ticks::new(self.x, f64::from(self.area.width) / TICK_GAP_X_PX)
    }

    fn y_ticks(&self) -> Ticks {
        Ticks::new(self.y, f64::from(self.area.height) / TICK_GAP_Y_PX)
    }
}

/// Middle of the pixel, where a line of one pixel is sharp.
fn crisp(v: f64) -> f32 {
    (v.round() - 0.5) as f32
}

/// Multiples of 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy)]
pub struct Ticks {
    range: [f64; 2],
    step: f64,
    decimals: usize,
}

impl Ticks {
    /// The narrowest step that makes at most `most` intervals (at least one).
    pub fn new(range: [f64; 2], most: f64) -> Self {
        let least = ((range[1] - range[0]) / most.max(1.0)).max(1e-9);
        let decade = least.log10().floor();
        let power = 10_f64.powf(decade);
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * power >= least * (1.0 - 1e-9)).unwrap_or(10.0);
        let step = factor * power;
        Self { range, step, decimals: (-(step.log10() + 1e-9).floor()).max(0.0) as usize }
    }

    pub fn positions(&self) -> impl Iterator<Item = f64> + use<> {
        let step = self.step;
        let first = (self.range[0] / step - 1e-9).ceil() as i64;
        let last = (self.range[1] / step + 1e-9).floor() as i64;
        (first..=last).map(move |k| k as f64 * step)
    }

    pub fn label(&self, position: f64) -> String {
        format!("{position:.*}", self.decimals).replace('-', "\u{2212}")
    }

    /// The least multiple of the step that is not below `value`.
    pub fn round_up(&self, value: f64) -> f64 {
        (value / self.step - 1e-9).ceil() * self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_x_runs_right_and_data_y_runs_up() {
        let plot = Plot { area: Area::new(100, 10, 200, 50), x: [0.0, 20.0], y: [-5.0, 5.0] };
        assert_eq!(plot.at([0.0, -5.0]), [100.0, 60.0]);
        assert_eq!(plot.at([20.0, 5.0]), [300.0, 10.0]);
        assert_eq!(plot.scale(), 10.0);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = |range, most| {
            let t = Ticks::new(range, most);
            t.positions().map(|p| t.label(p)).collect::<Vec<_>>()
        };
        assert_eq!(labels([-25.0, 25.0], 5.0), ["−20", "−10", "0", "10", "20"]);
        assert_eq!(labels([0.0, 1.0], 5.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels([3.0, 210.0], 4.5), ["50", "100", "150", "200"]);
        assert_eq!(Ticks::new([0.0, 37.0], 10.0).round_up(36.2), 40.0);
    }
}
