//! Detections per object against range, several recordings over each other, on a logarithmic axis.

use super::axes::{LEFT_PX, Plot, RIGHT_PX, Ticks};
use super::canvas::{Area, Canvas, Pen, Pixel};
use super::legend::{Entry, Surround, WIDTH_PX};
use super::palette::{CURVES, FAINT_INK, GRID, INK};
use super::text::{Align, Style};
use crate::evaluation::returns::{Band, Group, Returns};

const HEIGHT_PX: i32 = 480;
/// Nothing at all is drawn here.
const LEAST: f64 = 0.5;
const TICKS: [f64; 8] = [0.5, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];

/// The picture: one panel a group, one curve (median) and band (quartiles) a recording.
pub fn draw(all: &[Returns], caption: &str) -> Canvas {
    let entries = all.iter().zip(CURVES.iter().cycle()).map(|(returns, &pen)| {
        let label = format!("{} ({:.0} detections a frame)", returns.recording, returns.detections_a_frame);
        Entry::new(label, 46, move |canvas, area| {
            let y = area.top as f32 + area.height as f32 / 2.0;
            canvas.rectangle(Area::new(area.left, area.top, area.width, area.height), pen.colour.opacity(40));
            canvas.line([area.left as f32, y], [area.right() as f32, y], pen);
        })
    });
    let surround = Surround {
        title: "Detections per object in sight, against its distance".into(),
        caption: Some(caption.to_owned()),
        legend: vec![entries.collect()],
    };
    let bands = || all.iter().flat_map(|r| r.bands.values().flatten());
    let farthest = bands().map(|b| b.to_m).fold(50.0, f64::max);
    let most = bands().map(|b| b.upper_quartile).fold(10.0, f64::max);
    let top = TICKS.into_iter().find(|t| *t >= most).unwrap_or(TICKS[TICKS.len() - 1]);
    let above = surround.above_px() + 26;
    let half = (WIDTH_PX - RIGHT_PX) / 2;
    let mut canvas = Canvas::new(WIDTH_PX, above + HEIGHT_PX + 58 + surround.below_px());
    for (k, group) in Group::ALL.into_iter().enumerate() {
        let area = Area::new(k as i32 * half + LEFT_PX, above, half - LEFT_PX, HEIGHT_PX);
        let plot = Plot { area, x: [0.0, farthest], y: [LEAST, top].map(f64::log10) };
        canvas.text([area.left as f32, area.top as f32 - 9.0], group.name(), Style::new(15.0, INK).bold());
        axes(&mut canvas, &plot);
        canvas.within(area, |canvas| {
            for (returns, pen) in all.iter().zip(CURVES.iter().cycle()) {
                curve(canvas, &plot, returns.bands.get(&group).map_or(&[][..], |b| &b[..]), *pen);
            }
        });
    }
    surround.draw(&mut canvas, above + HEIGHT_PX + 58);
    canvas
}

fn at(plot: &Plot, band: &Band, detections: f64) -> Pixel {
    plot.at([(band.from_m + band.to_m) / 2.0, detections.max(LEAST).log10()])
}

fn curve(canvas: &mut Canvas, plot: &Plot, bands: &[Band], pen: Pen) {
    let upper = bands.iter().map(|b| at(plot, b, b.upper_quartile));
    let lower = bands.iter().rev().map(|b| at(plot, b, b.quartile));
    let outline: Vec<Pixel> = upper.chain(lower).collect();
    canvas.polygon(&outline, pen.colour.opacity(40));
    let medians: Vec<Pixel> = bands.iter().map(|b| at(plot, b, b.median)).collect();
    canvas.polyline(&medians, false, pen);
    medians.iter().for_each(|p| canvas.disc(*p, 3.5, pen.colour));
}

fn axes(canvas: &mut Canvas, plot: &Plot) {
    let Area { left, top, .. } = plot.area;
    let [left, top, right, bottom] = [left, top, plot.area.right(), plot.area.bottom()].map(|v| v as f32 - 0.5);
    let (thin, number) = (Pen::new(GRID, 1.0), Style::new(14.0, FAINT_INK));
    for tick in TICKS.into_iter().filter(|t| t.log10() <= plot.y[1] + 1e-9) {
        let y = (plot.row(tick.log10()).round() - 0.5) as f32;
        canvas.line([left, y], [right, y], thin);
        let label = if tick == LEAST { "none".into() } else { tick.to_string() };
        canvas.text_middle([left - 9.5, y], &label, number.align(Align::Right));
    }
    let ticks = Ticks::new(plot.x, 8.0);
    for tick in ticks.positions() {
        let x = (plot.column(tick).round() - 0.5) as f32;
        canvas.line([x, top], [x, bottom], thin);
        canvas.text([x, bottom + 20.5], &ticks.label(tick), number.align(Align::Centre));
    }
    let frame = [[left, top], [right, top], [right, bottom], [left, bottom]];
    canvas.polyline(&frame, true, Pen::new(FAINT_INK, 1.0));
    let title = Style::new(15.0, INK).align(Align::Centre);
    canvas.text([(left + right) / 2.0, bottom + 43.5], "distance, m", title);
    canvas.text_middle([left - 60.5, (top + bottom) / 2.0], "detections per object", title.upright());
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn more_detections_are_higher_and_none_has_a_place() {
        let band = |k: u32, n: f64| Band {
            from_m: f64::from(k) * 50.0,
            to_m: f64::from(k + 1) * 50.0,
            objects: 20,
            quartile: n,
            median: n,
            upper_quartile: n,
            none: 0.0,
        };
        let plot = Plot { area: Area::new(0, 0, 400, 300), x: [0.0, 100.0], y: [LEAST, 100.0].map(f64::log10) };
        assert!(at(&plot, &band(0, 9.0), 9.0)[1] < at(&plot, &band(0, 3.0), 3.0)[1]);
        assert_eq!(at(&plot, &band(1, 0.0), 0.0), [300.0, 300.0]);
        let returns = Returns {
            recording: "r".into(),
            detections_a_frame: 3.0,
            bands: BTreeMap::from([(Group::Light, vec![band(0, 30.0), band(1, 3.0)])]),
        };
        let canvas = draw(&[returns], "c");
        let blue = CURVES[0].colour;
        let drawn = |left: i32, right: i32| (left..right).flat_map(|x| (0..canvas.height()).map(move |y| (x, y)));
        assert!(drawn(LEFT_PX, WIDTH_PX / 2).any(|(x, y)| canvas.pixel(x, y) == blue), "the left panel is of cars");
        let inside = |y: &i32| (80..500).contains(y);
        assert!(
            !drawn(WIDTH_PX / 2 + 10, WIDTH_PX).filter(|(_, y)| inside(y)).any(|(x, y)| canvas.pixel(x, y) == blue)
        );
    }
}
