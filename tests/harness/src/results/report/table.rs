//! A replay as text: the paper's table, and what has to be known to read it.

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::{notes, percent};
use crate::evaluation::Options;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::bounds::SLICE;
use crate::evaluation::breakdown::band_name;
use crate::evaluation::causes::{Cause, Causes};
use crate::evaluation::counts::Counts;
use crate::evaluation::mount_error::Sensitivity;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::{Row, Summary};

/// Columns of a terminal, which tables fit unless they are asked for wide.
const TERMINAL: usize = 80;

/// How much is shown of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// What fits a terminal.
    Terminal,
    /// Everything, side by side.
    Wide,
}

impl Extent {
    /// As `--wide` says.
    pub fn of(wide: bool) -> Self {
        if wide { Self::Wide } else { Self::Terminal }
    }
}

/// The table of one recording with the notes below it.
pub fn text(replay: &Replay, options: &Options, extent: Extent) -> String {
    let rates_of = |replay: &Replay| match &replay.recording.truth {
        Some(_) => rates(&replay.summary, extent).to_string(),
        None => notes::WITHOUT_LABELS.to_owned(),
    };
    let mut text = format!("{}\n{}\n", notes::heading(replay), rates_of(replay));
    for line in notes::below(replay, options) {
        text += &line;
        text.push('\n');
    }
    if replay.summary.rows.iter().any(|r| !r.breakdown.occlusion.is_empty()) {
        text += &by_occlusion(&replay.summary, extent);
        text.push('\n');
    }
    if replay.recording.of_camera().is_some() {
        text += &(notes::RULE_OF_CAMERA.to_owned() + "\n");
    }
    if let Some(camera) = &replay.camera {
        text += &format!("\n{}\n{}\n", notes::heading(camera), rates_of(camera));
        for line in notes::of_camera(camera) {
            text += &line;
            text.push('\n');
        }
    }
    text
}

fn with_interval(rate: Option<f64>, interval: Option<Interval>) -> String {
    let spread = interval.map(|Interval(low, high)| format!("\n{:.1}–{:.1}", 100.0 * low, 100.0 * high));
    percent(rate) + &spread.unwrap_or_default()
}

/// Points with their sign, and their interval.
pub fn signed(points: Option<f64>, interval: Option<Interval>) -> String {
    let spread = interval.map(|Interval(low, high)| format!("\n{low:+.1}…{high:+.1}"));
    points.map_or_else(|| "n/a".into(), |p| format!("{p:+.1}")) + &spread.unwrap_or_default()
}

/// A table whose first column is text and whose others are figures.
pub fn table(heading: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Table {
    let mut table = Table::new();
    let cell = |(column, text): (usize, String)| {
        let side = if column == 0 { CellAlignment::Left } else { CellAlignment::Right };
        Cell::new(text).set_alignment(side)
    };
    let heading = heading.iter().map(|name| (*name).to_owned()).enumerate().map(cell);
    table.load_style(presets::UTF8_FULL_CONDENSED).set_header(heading.collect::<Vec<_>>());
    for row in rows {
        table.add_row(row.into_iter().enumerate().map(cell));
    }
    // figures stand away from what is left of them
    table.column_iter_mut().skip(1).for_each(|column| {
        column.set_padding((0, 1));
    });
    table
}

/// The same as text; in a terminal as several tables below each other where one would be too wide, each with the
/// first `fixed` columns.
pub fn tables(heading: &[&str], rows: &[Vec<String>], fixed: usize, extent: Extent) -> String {
    let longest = |text: &str| text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
    // with its border and the space to it
    let width = |k: usize| {
        let cells = rows.iter().filter_map(|row| row.get(k)).map(|cell| longest(cell));
        2 + usize::from(k == 0) + cells.chain(heading.get(k).map(|name| longest(name))).max().unwrap_or(0)
    };
    let begin = 1 + (0..fixed).map(width).sum::<usize>();
    let mut parts: Vec<Vec<usize>> = vec![Vec::new()];
    let mut used = begin;
    for k in fixed..heading.len() {
        let begun = parts.last().is_some_and(|part| !part.is_empty());
        if extent == Extent::Terminal && begun && used + width(k) > TERMINAL {
            used = begin;
            parts.push(Vec::new());
        }
        used += width(k);
        parts.last_mut().into_iter().for_each(|part| part.push(k));
    }
    let part = |shown: &Vec<usize>| {
        let columns = || (0..fixed).chain(shown.iter().copied());
        let heading: Vec<&str> = columns().filter_map(|k| heading.get(k).copied()).collect();
        let rows = rows.iter().map(|row| columns().filter_map(|k| row.get(k).cloned()).collect());
        table(&heading, rows).to_string()
    };
    parts.iter().map(part).collect::<Vec<_>>().join("\n")
}

/// Rates in per cent with their intervals, one row an estimator. In a terminal without what follows from the rest: the
/// intervals of TVR and TIR, which are those of FIR and FVR turned over, and the distances to a bound.
pub(super) fn rates(summary: &Summary, extent: Extent) -> Table {
    let heading = [
        "estimator",
        "TVR %",
        "FVR %",
        "TIR %",
        "FIR %",
        "cell\nFVR %",
        "cell\nFIR %",
        "FVR from\nslice, points",
        "FIR from\nslice, points",
    ];
    let shown = if extent == Extent::Wide { heading.len() } else { heading.len() - 2 };
    let rows = summary.rows.iter().map(|row| rate_row(row, extent).into_iter().take(shown).collect());
    table(&heading[..shown], rows)
}

fn rate_row(row: &Row, extent: Extent) -> Vec<String> {
    let (c, i, d) = (&row.counts, &row.intervals, &row.to_slice);
    // the bound's distance to itself has no spread
    let spread = |interval| if row.name == SLICE { None } else { interval };
    let wide = |interval| if extent == Extent::Wide { interval } else { None };
    vec![
        row.name.clone(),
        with_interval(c.tvr(), wide(i.tvr)),
        with_interval(c.fvr(), i.fvr),
        with_interval(c.tir(), wide(i.tir)),
        with_interval(c.fir(), i.fir),
        with_interval(row.cell_fvr(), i.cell_fvr),
        with_interval(row.cell_fir(), i.cell_fir),
        signed(d.fvr_points, spread(d.fvr_interval)),
        signed(d.fir_points, spread(d.fir_interval)),
    ]
}

/// FVR / FIR of every estimator by class and by distance.
pub fn breakdown(summary: &Summary, extent: Extent) -> String {
    let of_class = |r: &Row| r.breakdown.class.iter().map(|(class, &c)| (class.clone(), c)).collect();
    let of_band = |r: &Row| r.breakdown.distance.iter().map(|(&band, &c)| (band_name(band), c)).collect();
    let by_class = grouped(summary, "class", of_class, extent);
    let by_distance = grouped(summary, "distance, m", of_band, extent);
    format!("{by_class}\n{by_distance}\n")
}

fn by_occlusion(summary: &Summary, extent: Extent) -> String {
    let of_grade = |r: &Row| r.breakdown.occlusion.iter().map(|(&g, &c)| (g.to_string(), c)).collect();
    grouped(summary, "occlusion", of_grade, extent)
}

fn grouped(summary: &Summary, by: &str, groups: impl Fn(&Row) -> Vec<(String, Counts)>, extent: Extent) -> String {
    let names: Vec<&str> = summary.rows.iter().map(|r| r.name.as_str()).collect();
    let heading = [&[by, "samples", "coverage %"], &names[..]].concat();
    let columns: Vec<Vec<(String, Counts)>> = summary.rows.iter().map(groups).collect();
    let rows = columns.first().into_iter().flatten().enumerate().map(|(k, (group, counts))| {
        let pair = |c: &Counts| format!("{} / {}", percent(c.fvr()), percent(c.fir()));
        let cells = columns.iter().map(|column| column.get(k).map_or_else(String::new, |(_, c)| pair(c)));
        [group.clone(), counts.total().to_string(), percent(counts.coverage())].into_iter().chain(cells).collect()
    });
    let rows: Vec<Vec<String>> = rows.collect();
    format!("FVR / FIR in % by {by}:\n{}", tables(&heading, &rows, 3, extent))
}

/// Why cells of an estimator are wrong, in points of their rates.
pub fn causes(causes: &Causes, extent: Extent) -> String {
    let rows: Vec<Vec<String>> = causes_rows(causes).into_iter().map(|(_, row)| row).collect();
    format!("{}:\n{}\n", causes_caption(causes), tables(&CAUSES, &rows, 1, extent))
}

pub fn causes_caption(causes: &Causes) -> String {
    format!("Why cells of {} are wrong, by how the vehicle moves that hides them or whose box does", causes.estimator)
}

/// Columns of [`causes_rows`].
pub const CAUSES: [&str; 7] = ["in points", "all", "stands", "across", "along", "unmoving", "none"];

/// Each rate, marked, with what adds up to it below.
pub fn causes_rows(causes: &Causes) -> Vec<(bool, Vec<String>)> {
    let points = |v: f64| if v > 0.0 { format!("{v:.1}") } else { String::new() };
    let row = |c: &Cause| {
        let m = &c.by_motion;
        let cells = [c.points, m.stands, m.across, m.along, m.unmoving, m.none].map(points);
        (false, std::iter::once(c.name.to_owned()).chain(cells).collect())
    };
    let sum = |name: &str, rate: Option<f64>| {
        let rest = std::iter::repeat_n(String::new(), CAUSES.len() - 2);
        (true, [name.to_owned(), percent(rate)].into_iter().chain(rest).collect())
    };
    let mut rows = vec![sum("hidden, called visible", causes.cells.fvr())];
    rows.extend(causes.wrongly_visible().iter().map(row));
    rows.push(sum("clear, called invisible", causes.cells.fir()));
    rows.extend(causes.wrongly_invisible().iter().map(row));
    rows
}

/// How the rates of every estimator move with a wrong mount, in points.
pub fn mount_error(sensitivities: &[Sensitivity], extent: Extent) -> String {
    let describe = |s: &Sensitivity| match (s.error.pitch_deg, s.error.height_m) {
        (pitch, 0.0) => format!("pitch\n{pitch:+} deg"),
        (_, height) => format!("height\n{height:+} m"),
    };
    let headings: Vec<String> = sensitivities.iter().map(describe).collect();
    let heading: Vec<&str> = ["estimator", "rates"].into_iter().chain(headings.iter().map(String::as_str)).collect();
    let names = sensitivities.first().map(|s| s.estimators.iter().map(|m| m.name.clone())).into_iter().flatten();
    let rows = names.enumerate().flat_map(|(k, name)| {
        let moved = |cells: bool| {
            sensitivities.iter().map(move |s| {
                let m = &s.estimators[k];
                let (fvr, fir) =
                    if cells { (m.cell_fvr_points, m.cell_fir_points) } else { (m.fvr_points, m.fir_points) };
                format!("{} / {}", signed(fvr, None), signed(fir, None))
            })
        };
        let row =
            |name: &str, of: &str, cells| [name.to_owned(), of.to_owned()].into_iter().chain(moved(cells)).collect();
        [row(&name, "FVR / FIR", false), row("", "cell FVR / FIR", true)]
    });
    let tables = tables(&heading, &rows.collect::<Vec<_>>(), 2, extent);
    format!("What a wrong mount does, given to the estimators and not to the truth (points):\n{tables}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_too_wide_for_a_terminal_goes_on_below_with_its_first_columns() {
        let heading: Vec<String> = (0..9).map(|k| format!("a column {k}")).collect();
        let heading: Vec<&str> = heading.iter().map(String::as_str).collect();
        let rows: Vec<Vec<String>> = vec![(0..9).map(|k| format!("value {k}")).collect()];
        let text = tables(&heading, &rows, 2, Extent::Terminal);
        assert!(text.lines().all(|line| line.chars().count() <= TERMINAL), "{text}");
        assert_eq!(text.matches("value 1").count(), text.matches('╞').count());
        assert!((0..9).all(|k| text.contains(&format!("value {k}"))), "{text}");
        assert_eq!(tables(&heading, &rows, 2, Extent::Wide).matches('╞').count(), 1);
    }

    #[test]
    fn nothing_to_divide_by_reads_not_applicable() {
        assert_eq!(percent(None), "n/a");
        assert_eq!(with_interval(Some(0.125), Some(Interval(0.1, 0.2))), "12.5\n10.0–20.0");
        assert_eq!(signed(Some(-3.04), None), "-3.0");
        assert_eq!(signed(None, None), "n/a");
    }
}
