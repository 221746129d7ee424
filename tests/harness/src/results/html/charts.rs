//! The charts of a replay: operating curves, rates over distance and over time, and what the map says.

use super::chart::{Axis, Chart, Mark, Point, Series, legend};
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::breakdown::{BAND_M, band_name};
use crate::evaluation::counts::Counts;
use crate::evaluation::curve::CurvePoint;
use crate::evaluation::over_time::{self, Window};
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::Row;
use crate::results::pictures::canvas::{Colour, Pen};
use crate::results::pictures::palette::CURVES;

/// Fewer object-time-steps than this make no rate to rely on.
const FEW: u64 = 50;
/// Hidden at first: it reads the flat grid in a way nobody would use.
const HIDDEN: &str = "radar-2d-first";

const PERCENT: [f64; 2] = [0.0, 100.0];

/// Cells of a map, as shares of all of them, and detections of its frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shares {
    pub time_s: f64,
    pub visible: f64,
    pub invisible: f64,
    pub unknown: f64,
    pub detections: usize,
}

/// Charts that go with a table of rates; empty without labels.
pub fn of_rates(replay: &Replay, shown: &str, marks: &[(f64, String, String)]) -> String {
    let rows = &replay.summary.rows;
    if replay.recording.truth.is_none() || rows.is_empty() {
        return String::new();
    }
    let pens = pens(rows);
    let names: Vec<(&str, Pen, bool)> =
        rows.iter().zip(&pens).map(|(row, pen)| (row.name.as_str(), *pen, row.name != HIDDEN)).collect();
    let mut html = String::from("<div class=\"group\">\n") + &legend(&names);
    let curve = |title, of: fn(&Row) -> Operating| operating(title, rows, &pens, shown, of);
    let both = [curve("Objects: false visible against false invisible", objects), curve("Road cells: the same", cells)];
    html += "<div class=\"charts\">";
    for chart in both.iter().filter(|chart| chart.series.iter().any(|s| !s.points.is_empty())) {
        html += &chart.figure();
    }
    html += "</div>\n<p class=\"threshold\" hidden><label>Threshold on the grade <input type=\"range\" min=\"0\" max=\"256\" \
             value=\"128\"></label> <output></output></p>\n<div class=\"charts\">";
    for (title, unsafe_rate) in [("FVR by distance", true), ("FIR by distance", false)] {
        html += &by_distance(title, rows, &pens, shown, unsafe_rate).figure();
    }
    let windows: Vec<(&str, Vec<Window>)> = replay
        .scores
        .iter()
        .map(|score| (score.name.as_str(), over_time::windows(&replay.recording, &replay.samples, score)))
        .collect();
    for (title, unsafe_rate) in [("FVR over time", true), ("FIR over time", false)] {
        html += &by_time(title, replay, &windows, &names, shown, unsafe_rate, marks).figure();
    }
    html + "</div></div>\n"
}

/// A pen a row: those of the trade-off pictures, which leave one reading of the flat grid out.
fn pens(rows: &[Row]) -> Vec<Pen> {
    let (shown, hidden): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(|k| rows[*k].name != HIDDEN);
    let order: Vec<usize> = shown.into_iter().chain(hidden).collect();
    (0..rows.len()).map(|k| CURVES[order.iter().position(|o| *o == k).unwrap_or(k) % CURVES.len()]).collect()
}

/// A curve, its operating point, and the intervals of that: FVR, FIR.
struct Operating<'a> {
    curve: &'a [CurvePoint],
    rates: [Option<f64>; 2],
    intervals: [Option<Interval>; 2],
}

fn objects(row: &Row) -> Operating<'_> {
    let rates = [row.counts.fvr(), row.counts.fir()];
    Operating { curve: &row.curve, rates, intervals: [row.intervals.fvr, row.intervals.fir] }
}

fn cells(row: &Row) -> Operating<'_> {
    let rates = [row.cell_fvr(), row.cell_fir()];
    Operating { curve: &row.cell_curve, rates, intervals: [row.intervals.cell_fvr, row.intervals.cell_fir] }
}

fn operating<'a>(
    title: &'static str,
    rows: &'a [Row],
    pens: &[Pen],
    shown: &str,
    of: fn(&Row) -> Operating,
) -> Chart<'a> {
    let mut series = Vec::new();
    for (row, pen) in rows.iter().zip(pens) {
        let Operating { curve, rates: [fvr, fir], intervals } = of(row);
        let strong = row.name == shown;
        let says = |from: &str, fvr: f64, fir: f64| {
            format!("{}{from}: FVR {:.1} %, FIR {:.1} %", row.name, 100.0 * fvr, 100.0 * fir)
        };
        let on_curve = |p: &CurvePoint| Point {
            x: 100.0 * p.fir,
            y: 100.0 * p.fvr,
            says: says(&format!(", visible from grade {} on", p.threshold), p.fvr, p.fir),
            weak: false,
            threshold: Some(p.threshold),
        };
        let points = curve.iter().map(on_curve).collect();
        series.push(Series { name: &row.name, pen: *pen, strong, points, dotted: false, spread: [None; 2] });
        let (Some(fvr), Some(fir)) = (fvr, fir) else { continue };
        let point =
            Point { x: 100.0 * fir, y: 100.0 * fvr, says: says(", as it is", fvr, fir), weak: false, threshold: None };
        let [fvr, fir] = intervals.map(|i| i.map(|Interval(low, high)| [100.0 * low, 100.0 * high]));
        series.push(Series {
            name: &row.name,
            pen: *pen,
            strong,
            points: vec![point],
            dotted: true,
            spread: [fir, fvr],
        });
    }
    Chart {
        title,
        x: Axis { title: "FIR, % (costs availability)", range: PERCENT },
        y: Axis { title: "FVR, % (unsafe)", range: PERCENT },
        series,
        marks: Vec::new(),
        is_wide: false,
    }
}

/// A rate of counts with what it is a share of: FVR of the undetected, or FIR of the detected.
fn rate(counts: &Counts, unsafe_rate: bool) -> Option<(f64, u64)> {
    let (rate, of) =
        if unsafe_rate { (counts.fvr(), counts.fv + counts.ti) } else { (counts.fir(), counts.fi + counts.tv) };
    rate.map(|rate| (100.0 * rate, of))
}

fn title_of(unsafe_rate: bool) -> (&'static str, &'static str) {
    if unsafe_rate { ("FVR, % (unsafe)", "undetected") } else { ("FIR, % (costs availability)", "detected") }
}

fn by_distance<'a>(title: &'static str, rows: &'a [Row], pens: &[Pen], shown: &str, unsafe_rate: bool) -> Chart<'a> {
    let (axis, of_which) = title_of(unsafe_rate);
    let series = rows.iter().zip(pens).map(|(row, pen)| {
        let points = row.breakdown.distance.iter().filter_map(|(&band, counts)| {
            let (rate, of) = rate(counts, unsafe_rate)?;
            let says = format!("{}, {} m: {rate:.1} % of {of} {of_which}", row.name, band_name(band));
            Some(Point { x: (f64::from(band) + 0.5) * BAND_M, y: rate, says, weak: of < FEW, threshold: None })
        });
        Series {
            name: &row.name,
            pen: *pen,
            strong: row.name == shown,
            points: points.collect(),
            dotted: true,
            spread: [None; 2],
        }
    });
    let farthest = rows.iter().filter_map(|row| row.breakdown.distance.keys().max()).max().copied().unwrap_or(3);
    Chart {
        title,
        x: Axis { title: "distance over ground, m", range: [0.0, (f64::from(farthest) + 1.0) * BAND_M] },
        y: Axis { title: axis, range: PERCENT },
        series: series.collect(),
        marks: Vec::new(),
        is_wide: false,
    }
}

fn by_time<'a>(
    title: &'static str,
    replay: &Replay,
    windows: &[(&'a str, Vec<Window>)],
    names: &[(&str, Pen, bool)],
    shown: &str,
    unsafe_rate: bool,
    marks: &[(f64, String, String)],
) -> Chart<'a> {
    let (axis, of_which) = title_of(unsafe_rate);
    let series = windows.iter().map(|(name, windows)| {
        let points = windows.iter().filter_map(|w| {
            let (rate, of) = rate(&w.objects, unsafe_rate)?;
            let says = format!("{name}, {:.1} to {:.1} s: {rate:.1} % of {of} {of_which}", w.from_s, w.to_s);
            Some(Point { x: (w.from_s + w.to_s) / 2.0, y: rate, says, weak: of < FEW, threshold: None })
        });
        let pen = names.iter().find(|(other, ..)| other == name).map_or(CURVES[0], |(_, pen, _)| *pen);
        Series { name, pen, strong: *name == shown, points: points.collect(), dotted: true, spread: [None; 2] }
    });
    Chart {
        title,
        x: Axis { title: "time since the first frame, s", range: [0.0, replay.recording.duration_s().max(1.0)] },
        y: Axis { title: axis, range: PERCENT },
        series: series.collect(),
        marks: marks.iter().map(|(x, name, link)| Mark { x: *x, name: name.clone(), link: link.clone() }).collect(),
        is_wide: false,
    }
}

/// How much of the map is what, over time; needs no labels.
pub fn of_shares(shares: &[Shares]) -> String {
    let (Some(first), Some(last)) = (shares.first(), shares.last()) else { return String::new() };
    // as many points as a chart has pixels for
    let step = shares.len().div_ceil(300).max(1);
    let of = |name: &'static str, hex: u32, dash: &'static [f32], share: fn(&Shares) -> f64| {
        let pen = Pen::new(Colour::hex(hex), 2.5).dashed(dash);
        let points = shares.iter().step_by(step).map(|s| Point {
            x: s.time_s,
            y: 100.0 * share(s),
            says: format!(
                "{:.1} s, {name}: {:.1} % of the cells; {} detections",
                s.time_s,
                100.0 * share(s),
                s.detections
            ),
            weak: false,
            threshold: None,
        });
        Series { name, pen, strong: false, points: points.collect(), dotted: false, spread: [None; 2] }
    };
    let series = vec![
        of("visible", 0x2f7fb8, &[], |s| s.visible),
        of("invisible", 0xc2601a, &[9.0, 4.0], |s| s.invisible),
        of("unknown", 0x777d85, &[2.5, 3.5], |s| s.unknown),
    ];
    let names: Vec<(&str, Pen, bool)> = series.iter().map(|s| (s.name, s.pen, true)).collect();
    let legend = legend(&names);
    let chart = Chart {
        title: "What the map says over time",
        x: Axis { title: "time since the first frame, s", range: [first.time_s.min(0.0), last.time_s.max(1.0)] },
        y: Axis { title: "share of the map's cells, %", range: PERCENT },
        series,
        marks: Vec::new(),
        is_wide: true,
    };
    format!("<div class=\"group\">\n{legend}<div class=\"charts\">{}</div></div>\n", chart.figure())
}
