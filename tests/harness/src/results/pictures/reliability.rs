//! The reliability diagram: what was said against what was detected.

use super::axes::{BELOW_PX, LEFT_PX, Plot, RIGHT_PX};
use super::canvas::{Area, Canvas, Pen, Pixel};
use super::legend::{Entry, Surround, WIDTH_PX};
use super::palette::{CURVES, FAINT_INK, GRID};
use crate::evaluation::calibration::Bin;

const HEIGHT_PX: i32 = 700;

/// One predictor's bins.
pub struct Reliability {
    pub name: String,
    pub bins: Vec<Bin>,
}

/// Draws curves over the diagonal, on which a probability means what it says.
pub fn draw(all: &[Reliability], title: &str, caption: &str) -> Canvas {
    let entries = all.iter().zip(CURVES.iter().cycle()).map(|(curve, &pen)| {
        Entry::new(curve.name.clone(), 46, move |canvas, area| {
            let y = area.top as f32 + area.height as f32 / 2.0;
            canvas.line([area.left as f32, y], [area.right() as f32, y], pen);
            canvas.disc([area.left as f32 + 23.0, y], 4.0, pen.colour);
        })
    });
    let surround =
        Surround { title: title.to_owned(), caption: Some(caption.to_owned()), legend: vec![entries.collect()] };
    let area = Area::new(LEFT_PX, surround.above_px(), WIDTH_PX - LEFT_PX - RIGHT_PX, HEIGHT_PX);
    let plot = Plot { area, x: [0.0, 1.0], y: [0.0, 1.0] };
    let bottom = area.bottom() + BELOW_PX;
    let mut canvas = Canvas::new(WIDTH_PX, bottom + surround.below_px());
    surround.draw(&mut canvas, bottom);
    plot.grid(&mut canvas, GRID);
    canvas.within(area, |canvas| {
        canvas.line(plot.at([0.0, 0.0]), plot.at([1.0, 1.0]), Pen::new(FAINT_INK, 1.5));
        for (curve, pen) in all.iter().zip(CURVES.iter().cycle()) {
            let line: Vec<Pixel> = curve.bins.iter().map(|b| plot.at([b.said, b.detected])).collect();
            canvas.polyline(&line, false, *pen);
            line.iter().for_each(|p| canvas.disc(*p, 4.0, pen.colour));
        }
    });
    plot.axes(&mut canvas, "probability said, mean of the bin", "share detected");
    canvas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_runs_right_and_what_was_detected_up() {
        let bin = Bin { said: 0.25, detected: 0.75, samples: 10.0 };
        let canvas = draw(&[Reliability { name: "table".into(), bins: vec![bin] }], "t", "c");
        let colour = CURVES[0].colour;
        let inside = |y: i32| (120..700).contains(&y);
        let drawn: Vec<(i32, i32)> = (LEFT_PX + 4..WIDTH_PX)
            .flat_map(|x| (0..canvas.height()).map(move |y| (x, y)))
            .filter(|&(x, y)| inside(y) && canvas.pixel(x, y) == colour)
            .collect();
        let mean = |of: fn(&(i32, i32)) -> i32| drawn.iter().map(of).sum::<i32>() / drawn.len() as i32;
        let width = WIDTH_PX - LEFT_PX - RIGHT_PX;
        assert!((mean(|p| p.0) - (LEFT_PX + width / 4)).abs() < 3);
        assert!(mean(|p| p.1) < 420, "in the upper half: {}", mean(|p| p.1));
    }
}
