//! False visible against false invisible: one curve per estimator, bounds and named points.
//!
//! Rates are shares (0 to 1) as the evaluation gives them, drawn in per cent.

use super::axes::{BELOW_PX, LEFT_PX, Plot, RIGHT_PX, Ticks};
use super::canvas::{Area, Canvas, Colour, Pen, Pixel};
use super::labels::{Labels, spaced};
use super::legend::{Entry, Surround, WIDTH_PX};
use super::palette::{CURVES, FAINT_INK, GRID, INK};
use super::text::{Align, Style};

const HEIGHT_PX: i32 = 700;
/// Least distance between two thresholds written along a curve, pixels.
const THRESHOLD_GAP_PX: f32 = 110.0;
/// Least distance between two dots on a curve, pixels.
const DOT_GAP_PX: f32 = 14.0;

/// A threshold, where there is one to be written beside the curve, and the rates it gives.
#[derive(Debug, Clone, Copy)]
pub struct CurvePoint {
    pub threshold: Option<f64>,
    pub fvr: f64,
    pub fir: f64,
}

/// An estimator's rates over its thresholds, in the order of the thresholds.
#[derive(Debug, Clone)]
pub struct Curve {
    pub name: String,
    pub points: Vec<CurvePoint>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkerKind {
    /// Where an estimator is operated; has the colour of the curve of the same name.
    OperatingPoint,
    /// What exact lines of sight at one height allow: `geometry-slice`.
    Slice,
    /// What exact lines of sight to any height allow: `geometry-box`.
    Box,
}

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    Objects,
    Cells,
}

impl Counted {
    /// Titles of the axes: FVR, FIR.
    const fn axes(self) -> [&'static str; 2] {
        match self {
            Self::Objects => [
                "FVR = FV / (FV + TI): objects not detected, yet called visible (%)",
                "FIR = FI / (TV + FI): objects detected, yet called invisible (%)",
            ],
            Self::Cells => [
                "cell FVR: road cells out of sight, yet called visible, of all out of sight (%)",
                "cell FIR: road cells in sight, yet called invisible, of all in sight (%)",
            ],
        }
    }
}

/// A named point, with intervals where known.
#[derive(Debug, Clone)]
pub struct Marker {
    pub name: String,
    pub kind: MarkerKind,
    pub fvr: f64,
    pub fir: f64,
    /// Lower and upper end.
    pub fvr_interval: Option<[f64; 2]>,
    pub fir_interval: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Span {
    /// Both axes from 0 to 100 %.
    Full,
    /// From 0 to a little beyond the farthest point of each axis.
    Auto,
}

/// Everything on one chart.
#[derive(Debug, Clone)]
pub struct TradeOff {
    pub curves: Vec<Curve>,
    pub markers: Vec<Marker>,
    pub counted: Counted,
    pub span: Span,
    pub title: String,
    /// What has to be said of the data.
    pub caption: Option<String>,
}

/// Draws the chart, 1400 px wide. What has a rate that is not finite is left out.
pub fn draw(chart: &TradeOff) -> Canvas {
    let chart = &finite(chart);
    let (surround, plot) = layout(chart);
    let bottom = plot.area.bottom() + BELOW_PX;
    let mut canvas = Canvas::new(WIDTH_PX, bottom + surround.below_px());
    surround.draw(&mut canvas, bottom);
    plot.grid(&mut canvas, GRID);
    let mut labels = Labels::new(plot.area);
    canvas.within(plot.area, |canvas| {
        for (curve, pen) in chart.curves.iter().zip(CURVES.iter().cycle()) {
            let line: Vec<Pixel> = curve.points.iter().map(|p| at(&plot, p.fvr, p.fir)).collect();
            canvas.polyline(&line, false, *pen);
            for k in spaced(&line, DOT_GAP_PX) {
                canvas.disc(line[k], 3.0, pen.colour);
            }
            for pair in line.windows(2) {
                labels.avoid_line(pair[0], pair[1]);
            }
        }
    });
    for marker in &chart.markers {
        intervals(&mut canvas, &plot, &mut labels, marker, colour(chart, marker));
    }
    for marker in &chart.markers {
        let point = at(&plot, marker.fvr, marker.fir);
        symbol(&mut canvas, point, marker.kind, colour(chart, marker));
        labels.avoid(point, 11.0);
    }
    for marker in &chart.markers {
        let style = Style::new(15.0, colour(chart, marker)).bold().halo();
        labels.place(&mut canvas, at(&plot, marker.fvr, marker.fir), &marker.name, style, f32::INFINITY);
    }
    for (curve, pen) in chart.curves.iter().zip(CURVES.iter().cycle()) {
        thresholds(&mut canvas, &plot, &mut labels, curve, pen.colour);
    }
    let [fvr, fir] = chart.counted.axes();
    plot.axes(&mut canvas, fvr, fir);
    canvas
}

fn finite(chart: &TradeOff) -> TradeOff {
    let mut chart = chart.clone();
    chart.markers.retain(|m| m.fvr.is_finite() && m.fir.is_finite());
    for marker in &mut chart.markers {
        marker.fvr_interval = marker.fvr_interval.filter(|i| i.iter().all(|v| v.is_finite()));
        marker.fir_interval = marker.fir_interval.filter(|i| i.iter().all(|v| v.is_finite()));
    }
    for curve in &mut chart.curves {
        curve.points.retain(|p| p.fvr.is_finite() && p.fir.is_finite());
    }
    chart
}

fn layout(chart: &TradeOff) -> (Surround, Plot) {
    let mut entries: Vec<Entry> = chart
        .curves
        .iter()
        .zip(CURVES.iter().cycle())
        .map(|(curve, &pen)| {
            Entry::new(curve.name.clone(), 46, move |canvas, area| {
                let y = area.top as f32 + area.height as f32 / 2.0;
                canvas.line([area.left as f32, y], [area.right() as f32, y], pen);
                canvas.disc([area.left as f32 + 23.0, y], 3.0, pen.colour);
            })
        })
        .collect();
    let mut kinds = |kind: MarkerKind, label: &str| {
        if chart.markers.iter().any(|m| m.kind == kind) {
            entries.push(Entry::new(label, 18, move |canvas, area| {
                let y = area.top as f32 + area.height as f32 / 2.0;
                symbol(canvas, [area.left as f32 + 9.0, y], kind, INK);
            }));
        }
    };
    kinds(MarkerKind::OperatingPoint, "operating point (bars: interval)");
    kinds(MarkerKind::Slice, "geometry-slice");
    kinds(MarkerKind::Box, "geometry-box: bounds by exact geometry");
    if chart.curves.iter().flat_map(|c| &c.points).any(|p| p.threshold.is_some()) {
        entries.push(Entry::new("threshold of a point on a curve", 26, |canvas, area| {
            let middle = [area.left as f32 + 13.0, area.top as f32 + area.height as f32 / 2.0];
            canvas.text_middle(middle, "128", Style::new(12.0, INK).align(Align::Centre));
        }));
    }
    let surround = Surround { title: chart.title.clone(), caption: chart.caption.clone(), legend: vec![entries] };
    let area = Area::new(LEFT_PX, surround.above_px(), WIDTH_PX - LEFT_PX - RIGHT_PX, HEIGHT_PX);
    let ends = |interval: Option<[f64; 2]>, value: f64| interval.map_or(value, |i| i[1].max(value));
    let axis = |of_curve: fn(&CurvePoint) -> f64, of_marker: &dyn Fn(&Marker) -> f64| {
        let values = chart.curves.iter().flat_map(|c| &c.points).map(of_curve);
        let most = values.chain(chart.markers.iter().map(of_marker)).fold(0.0, f64::max);
        match chart.span {
            Span::Full => [0.0, 100.0],
            Span::Auto => {
                let most = (most * 106.0).clamp(1.0, 100.0);
                [0.0, Ticks::new([0.0, most], 12.0).round_up(most).min(100.0)]
            }
        }
    };
    let x = axis(|p| p.fvr, &|m| ends(m.fvr_interval, m.fvr));
    let y = axis(|p| p.fir, &|m| ends(m.fir_interval, m.fir));
    (surround, Plot { area, x, y })
}

fn at(plot: &Plot, fvr: f64, fir: f64) -> Pixel {
    plot.at([fvr * 100.0, fir * 100.0])
}

fn colour(chart: &TradeOff, marker: &Marker) -> Colour {
    let own = chart.curves.iter().zip(CURVES.iter().cycle()).find(|(c, _)| c.name == marker.name);
    own.map_or(INK, |(_, pen)| pen.colour)
}

fn symbol(canvas: &mut Canvas, [x, y]: Pixel, kind: MarkerKind, colour: Colour) {
    match kind {
        MarkerKind::OperatingPoint => {
            canvas.disc([x, y], 8.5, Colour::WHITE);
            canvas.disc([x, y], 6.5, colour);
        }
        MarkerKind::Slice | MarkerKind::Box => {
            let corners = match kind {
                MarkerKind::Slice => [[x, y - 8.0], [x + 8.0, y], [x, y + 8.0], [x - 8.0, y]],
                _ => [[x - 6.5, y - 6.5], [x + 6.5, y - 6.5], [x + 6.5, y + 6.5], [x - 6.5, y + 6.5]],
            };
            canvas.polygon(&corners, Colour::WHITE);
            canvas.polyline(&corners, true, Pen::new(colour, 2.2));
        }
    }
}

fn intervals(canvas: &mut Canvas, plot: &Plot, labels: &mut Labels, marker: &Marker, colour: Colour) {
    const CAP_PX: f32 = 5.0;
    let pen = Pen::new(colour, 1.4);
    let fvr = marker.fvr_interval.map(|ends| (ends.map(|v| at(plot, v, marker.fir)), [0.0, CAP_PX]));
    let fir = marker.fir_interval.map(|ends| (ends.map(|v| at(plot, marker.fvr, v)), [CAP_PX, 0.0]));
    for ([from, to], cap) in [fvr, fir].into_iter().flatten() {
        canvas.line(from, to, pen);
        labels.avoid_line(from, to);
        for [x, y] in [from, to] {
            canvas.line([x - cap[0], y - cap[1]], [x + cap[0], y + cap[1]], pen);
        }
    }
}

/// Writes thresholds beside dots of a curve, spaced out.
fn thresholds(canvas: &mut Canvas, plot: &Plot, labels: &mut Labels, curve: &Curve, colour: Colour) {
    let style = Style::new(12.0, colour.mix(FAINT_INK, 0.3)).halo();
    let line: Vec<Pixel> = curve.points.iter().map(|p| at(plot, p.fvr, p.fir)).collect();
    let dots = spaced(&line, DOT_GAP_PX);
    let dotted: Vec<Pixel> = dots.iter().map(|&k| line[k]).collect();
    for k in spaced(&dotted, THRESHOLD_GAP_PX) {
        if let Some(threshold) = curve.points[dots[k]].threshold {
            labels.place(canvas, dotted[k], &format!("{threshold}"), style, 15.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marker(name: &str, kind: MarkerKind, fvr: f64, fir: f64) -> Marker {
        Marker { name: name.into(), kind, fvr, fir, fvr_interval: None, fir_interval: None }
    }

    fn chart(span: Span) -> TradeOff {
        let points = [(10.0, 0.30, 0.05), (100.0, 0.10, 0.20)];
        TradeOff {
            curves: vec![Curve {
                name: "radar-3d".into(),
                points: points
                    .map(|(threshold, fvr, fir)| CurvePoint { threshold: Some(threshold), fvr, fir })
                    .to_vec(),
            }],
            markers: vec![marker("radar-3d", MarkerKind::OperatingPoint, 0.80, 0.20)],
            counted: Counted::Objects,
            span,
            title: "title".into(),
            caption: None,
        }
    }

    #[test]
    fn the_two_bounds_and_the_two_things_counted_look_different() {
        let with = |kind: MarkerKind, counted: Counted| {
            let chart = TradeOff { counted, ..chart(Span::Full) };
            let bound = TradeOff { markers: vec![marker("geometry", kind, 0.5, 0.5)], ..chart };
            let (canvas, (_, plot)) = (draw(&bound), layout(&bound));
            let [x, y] = at(&plot, 0.5, 0.5).map(|v| v as i32);
            // a corner that a square has and a diamond has not
            ((-7..=-6).any(|d| canvas.pixel(x + d, y + d).red < 90), canvas.png().unwrap())
        };
        let (slice, slice_picture) = with(MarkerKind::Slice, Counted::Objects);
        let (of_box, _) = with(MarkerKind::Box, Counted::Objects);
        assert!(of_box && !slice);
        assert_ne!(slice_picture, with(MarkerKind::Slice, Counted::Cells).1, "the axes say what is counted");
        assert!(Counted::Cells.axes().iter().all(|title| title.contains("road cells") && !title.contains("detected")));
    }

    #[test]
    fn false_visible_runs_right_and_false_invisible_up() {
        let chart = chart(Span::Full);
        let (canvas, (_, plot)) = (draw(&chart), layout(&chart));
        let coloured = |right: f64, up: f64| {
            let x = plot.area.left + (right * f64::from(plot.area.width)) as i32;
            let y = plot.area.bottom() - (up * f64::from(plot.area.height)) as i32;
            canvas.pixel(x, y) == CURVES[0].colour
        };
        assert!(coloured(0.80, 0.20), "the marker");
        assert!(!coloured(0.20, 0.80));
        assert!(coloured(0.30, 0.05) && coloured(0.10, 0.20), "the ends of the curve");
    }

    #[test]
    fn an_automatic_span_holds_every_point_and_interval() {
        let mut chart = chart(Span::Auto);
        chart.markers[0].fir_interval = Some([0.1, 0.43]);
        let (_, plot) = layout(&chart);
        assert!(plot.x[1] > 80.0 && plot.y[1] > 43.0 && plot.y[1] <= 50.0, "{:?} {:?}", plot.x, plot.y);
        chart.markers[0].fvr = 1.0;
        assert_eq!(layout(&chart).1.x, [0.0, 100.0]);
    }

    #[test]
    fn a_chart_without_points_is_drawn() {
        let empty = TradeOff { curves: Vec::new(), markers: Vec::new(), ..chart(Span::Auto) };
        assert_eq!(draw(&empty).width(), WIDTH_PX);
    }

    #[test]
    fn a_rate_that_is_not_available_hides_its_point_only() {
        let plain = chart(Span::Auto);
        let mut with_gap = plain.clone();
        with_gap.curves[0].points.insert(1, CurvePoint { threshold: Some(50.0), fvr: f64::NAN, fir: 0.1 });
        with_gap.markers.push(marker("nothing", MarkerKind::OperatingPoint, f64::NAN, 0.1));
        assert_eq!(draw(&with_gap).png().unwrap(), draw(&plain).png().unwrap());
    }
}
