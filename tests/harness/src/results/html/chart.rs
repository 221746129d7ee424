//! A chart as inline SVG: curves, points with their intervals, and what each point says.
//!
//! It is whole without a script. The page's script reads `data-points` (place in the chart and words, one a point) to
//! say what is under the mouse or the arrow keys.

use std::fmt::Write as _;

use serde_json::json;

use super::escaped;
use crate::results::pictures::Ticks;
use crate::results::pictures::canvas::Pen;

const WIDTH: f64 = 560.0;
const WIDE: f64 = 1160.0;
const HEIGHT: f64 = 350.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 12.0;
const BELOW: f64 = 50.0;

/// An axis, with its quantity and unit as title.
pub struct Axis {
    pub title: &'static str,
    pub range: [f64; 2],
}

/// A place on the chart and what it says.
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub says: String,
    /// Of few samples: drawn hollow.
    pub weak: bool,
    /// Grade from which on cells are visible, on operating curves.
    pub threshold: Option<u16>,
}

/// One estimator's curve, or a single point with its intervals.
pub struct Series<'a> {
    pub name: &'a str,
    pub pen: Pen,
    /// The estimator that the report is about.
    pub strong: bool,
    pub points: Vec<Point>,
    /// A disc at each point.
    pub dotted: bool,
    /// Intervals of x and y about the only point.
    pub spread: [Option<[f64; 2]>; 2],
}

/// A link at the upper edge to something further down the page.
pub struct Mark {
    pub x: f64,
    pub name: String,
    pub link: String,
}

pub struct Chart<'a> {
    pub title: &'static str,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series<'a>>,
    pub marks: Vec<Mark>,
    /// Over the whole page.
    pub is_wide: bool,
}

impl Chart<'_> {
    fn width(&self) -> f64 {
        if self.is_wide { WIDE } else { WIDTH }
    }

    fn column(&self, x: f64) -> f64 {
        let [low, high] = self.x.range;
        LEFT + (x - low) / (high - low) * (self.width() - LEFT - RIGHT)
    }

    fn row(&self, y: f64) -> f64 {
        let [low, high] = self.y.range;
        HEIGHT - BELOW - (y - low) / (high - low) * (HEIGHT - TOP - BELOW)
    }

    /// The figure with its title.
    pub fn figure(&self) -> String {
        let names: Vec<&str> = self.series.iter().filter(|s| !s.points.is_empty()).map(|s| s.name).collect();
        let label = format!("{}: {} over {}, of {}", self.title, self.y.title, self.x.title, names.join(", "));
        let mut svg = format!(
            "<figure class=\"chart{}\"><figcaption>{}</figcaption>\n<svg viewBox=\"0 0 {} {HEIGHT}\" role=\"img\" \
             tabindex=\"0\" aria-label=\"{}\">",
            if self.is_wide { " wide" } else { "" },
            escaped(self.title),
            self.width(),
            escaped(&label)
        );
        self.axes(&mut svg);
        // the one the report is about lies on top
        for strong in [false, true] {
            self.series.iter().filter(|s| s.strong == strong).for_each(|s| self.series(&mut svg, s));
        }
        for mark in &self.marks {
            let x = self.column(mark.x);
            let _ = write!(
                svg,
                "<a class=\"mark\" href=\"#{}\"><title>{}</title><path d=\"M{:.1} {TOP} l6 -10 h-12 z\"/><line x1=\"{x:.1}\" \
                 x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{}\"/></a>",
                escaped(&mark.link),
                escaped(&mark.name),
                x,
                HEIGHT - BELOW
            );
        }
        svg + "</svg></figure>\n"
    }

    fn axes(&self, svg: &mut String) {
        let (right, bottom) = (self.width() - RIGHT, HEIGHT - BELOW);
        let ticks = Ticks::new(self.x.range, (right - LEFT) / 62.0);
        for tick in ticks.positions() {
            let x = self.column(tick);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{}</text>",
                bottom + 18.0,
                ticks.label(tick)
            );
        }
        let ticks = Ticks::new(self.y.range, (bottom - TOP) / 44.0);
        for tick in ticks.positions() {
            let y = self.row(tick);
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/><text x=\"{}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{}</text>",
                LEFT - 8.0,
                y + 5.0,
                ticks.label(tick)
            );
        }
        let _ = write!(
            svg,
            "<text class=\"title\" x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text><text class=\"title\" \
             transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (LEFT + right) / 2.0,
            HEIGHT - 9.0,
            escaped(self.x.title),
            (TOP + bottom) / 2.0,
            escaped(self.y.title)
        );
    }

    fn series(&self, svg: &mut String, s: &Series) {
        if s.points.is_empty() {
            return;
        }
        let at = |p: &Point| (self.column(p.x), self.row(p.y));
        let points: Vec<_> = s
            .points
            .iter()
            .map(|p| json!([round(self.column(p.x)), round(self.row(p.y)), p.says, p.threshold]))
            .collect();
        let _ = write!(
            svg,
            "<g class=\"series{}\" data-series=\"{}\" style=\"--curve:{}\" data-points=\"{}\">",
            if s.strong { " strong" } else { "" },
            escaped(s.name),
            colour(s.pen),
            escaped(&json!(points).to_string())
        );
        let [spread_x, spread_y] = s.spread;
        if let Some(p) = s.points.first() {
            let (x, y) = at(p);
            if let Some([low, high]) = spread_x {
                let [low, high] = [self.column(low), self.column(high)];
                let _ = write!(svg, "<path class=\"spread\" d=\"M{low:.1} {y:.1} H{high:.1}\"/>");
            }
            if let Some([low, high]) = spread_y {
                let [low, high] = [self.row(low), self.row(high)];
                let _ = write!(svg, "<path class=\"spread\" d=\"M{x:.1} {low:.1} V{high:.1}\"/>");
            }
        }
        if s.points.len() > 1 {
            let mut line = String::new();
            for p in &s.points {
                let (x, y) = at(p);
                let _ = write!(line, "{x:.1},{y:.1} ");
            }
            let _ = write!(svg, "<polyline points=\"{}\"{}/>", line.trim_end(), dash(s.pen));
        }
        if s.dotted || s.points.len() == 1 {
            for p in &s.points {
                let (x, y) = at(p);
                let weak = if p.weak { " class=\"weak\"" } else { "" };
                let _ = write!(svg, "<circle{weak} cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"/>");
            }
        }
        *svg += "</g>";
    }
}

fn round(v: f64) -> f64 {
    (v * 10.0).round() / 10.0
}

fn colour(pen: Pen) -> String {
    format!("#{:02x}{:02x}{:02x}", pen.colour.red, pen.colour.green, pen.colour.blue)
}

fn dash(pen: Pen) -> String {
    let lengths: Vec<String> = pen.dash.iter().map(|length| length.to_string()).collect();
    if lengths.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", lengths.join(" ")) }
}

/// Buttons that show and hide series in every chart of a group, each with a sample of its line.
pub fn legend(series: &[(&str, Pen, bool)]) -> String {
    let mut html = String::from("<p class=\"legend\">");
    for (name, pen, shown) in series {
        let _ = write!(
            html,
            "<button type=\"button\" data-series=\"{0}\" aria-pressed=\"{shown}\" style=\"--curve:{1}\"><svg viewBox=\"0 0 34 10\" \
             aria-hidden=\"true\"><line x1=\"1\" x2=\"33\" y1=\"5\" y2=\"5\"{2}/></svg>{0}</button> ",
            escaped(name),
            colour(*pen),
            dash(*pen)
        );
    }
    html + "</p>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::pictures::palette::CURVES;

    fn chart(name: &str) -> Chart<'_> {
        let point = |x, y| Point { x, y, says: format!("\"{x}\" & <{y}>"), weak: false, threshold: Some(7) };
        Chart {
            title: "title",
            x: Axis { title: "x", range: [0.0, 100.0] },
            y: Axis { title: "y", range: [0.0, 100.0] },
            series: vec![Series {
                name,
                pen: CURVES[1],
                strong: true,
                points: vec![point(0.0, 0.0), point(100.0, 100.0)],
                dotted: false,
                spread: [None; 2],
            }],
            marks: Vec::new(),
            is_wide: false,
        }
    }

    #[test]
    fn x_runs_right_and_y_runs_up() {
        let figure = chart("a").figure();
        let expected = format!("{LEFT:.1},{:.1} {:.1},{TOP:.1}", HEIGHT - BELOW, WIDTH - RIGHT);
        assert!(figure.contains(&format!("<polyline points=\"{expected}\" stroke-dasharray=\"9 4\"")), "{figure}");
    }

    #[test]
    fn what_a_point_says_cannot_end_its_attribute() {
        let figure = chart("<b>\"").figure();
        assert!(!figure.contains("<b>") && !figure.contains("& <"), "{figure}");
        assert!(figure.contains("\\&quot;0\\&quot; &amp; &lt;0&gt;"), "{figure}");
    }
}
