//! A replay as text: the paper's table, and what has to be known to read it.

use comfy_table::{Cell, CellAlignment, Table, presets};

use super::{notes, percent};
use crate::evaluation::Options;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::bounds::SLICE;
use crate::evaluation::breakdown::band_name;
use crate::evaluation::counts::Counts;
use crate::evaluation::mount_error::Sensitivity;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::{Row, Summary};

/// The table of one recording with the notes below it.
pub fn text(replay: &Replay, options: &Options) -> String {
    let rates_of = |replay: &Replay| match &replay.recording.truth {
        Some(_) => rates(&replay.summary).to_string(),
        None => notes::WITHOUT_LABELS.to_owned(),
    };
    let mut text = format!("{}\n{}\n", notes::heading(replay), rates_of(replay));
    for line in notes::below(replay, options) {
        text += &line;
        text.push('\n');
    }
    if replay.summary.rows.iter().any(|r| !r.breakdown.occlusion.is_empty()) {
        text += &by_occlusion(&replay.summary);
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

pub(super) fn signed(points: Option<f64>, interval: Option<Interval>) -> String {
    let spread = interval.map(|Interval(low, high)| format!("\n{low:+.1}…{high:+.1}"));
    points.map_or_else(|| "n/a".into(), |p| format!("{p:+.1}")) + &spread.unwrap_or_default()
}

pub fn table(heading: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_FULL_CONDENSED).set_header(heading.to_vec());
    for row in rows {
        table.add_row(row.into_iter().enumerate().map(|(column, text)| {
            let side = if column == 0 { CellAlignment::Left } else { CellAlignment::Right };
            Cell::new(text).set_alignment(side)
        }));
    }
    table
}

/// Rates in per cent with their intervals, one row an estimator.
pub(super) fn rates(summary: &Summary) -> Table {
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
    table(&heading, summary.rows.iter().map(rate_row))
}

fn rate_row(row: &Row) -> Vec<String> {
    let (c, i, d) = (&row.counts, &row.intervals, &row.to_slice);
    // the bound's distance to itself has no spread
    let spread = |interval| if row.name == SLICE { None } else { interval };
    vec![
        row.name.clone(),
        with_interval(c.tvr(), i.tvr),
        with_interval(c.fvr(), i.fvr),
        with_interval(c.tir(), i.tir),
        with_interval(c.fir(), i.fir),
        with_interval(row.cell_fvr(), i.cell_fvr),
        with_interval(row.cell_fir(), i.cell_fir),
        signed(d.fvr_points, spread(d.fvr_interval)),
        signed(d.fir_points, spread(d.fir_interval)),
    ]
}

/// FVR / FIR of every estimator by class and by distance.
pub fn breakdown(summary: &Summary) -> String {
    let by_class =
        grouped(summary, "class", |r| r.breakdown.class.iter().map(|(class, &c)| (class.clone(), c)).collect());
    let by_distance = grouped(summary, "distance, m", |r| {
        r.breakdown.distance.iter().map(|(&band, &c)| (band_name(band), c)).collect()
    });
    format!("{by_class}\n{by_distance}\n")
}

fn by_occlusion(summary: &Summary) -> String {
    grouped(summary, "occlusion", |r| r.breakdown.occlusion.iter().map(|(&g, &c)| (g.to_string(), c)).collect())
}

fn grouped(summary: &Summary, by: &str, groups: impl Fn(&Row) -> Vec<(String, Counts)>) -> String {
    let names: Vec<&str> = summary.rows.iter().map(|r| r.name.as_str()).collect();
    let heading = [&[by, "samples", "coverage %"], &names[..]].concat();
    let columns: Vec<Vec<(String, Counts)>> = summary.rows.iter().map(groups).collect();
    let rows = columns.first().into_iter().flatten().enumerate().map(|(k, (group, counts))| {
        let pair = |c: &Counts| format!("{} / {}", percent(c.fvr()), percent(c.fir()));
        let cells = columns.iter().map(|column| column.get(k).map_or_else(String::new, |(_, c)| pair(c)));
        [group.clone(), counts.total().to_string(), percent(counts.coverage())].into_iter().chain(cells).collect()
    });
    format!("FVR / FIR in % by {by}:\n{}", table(&heading, rows))
}

/// How the rates of every estimator move with a wrong mount, in points.
pub fn mount_error(sensitivities: &[Sensitivity]) -> String {
    let describe = |s: &Sensitivity| match (s.error.pitch_deg, s.error.height_m) {
        (pitch, 0.0) => format!("pitch {pitch:+} deg"),
        (_, height) => format!("height {height:+} m"),
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
    let table = table(&heading, rows);
    format!("What a wrong mount does, given to the estimators and not to the truth (points):\n{table}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_to_divide_by_reads_not_applicable() {
        assert_eq!(percent(None), "n/a");
        assert_eq!(with_interval(Some(0.125), Some(Interval(0.1, 0.2))), "12.5\n10.0–20.0");
        assert_eq!(signed(Some(-3.04), None), "-3.0");
        assert_eq!(signed(None, None), "n/a");
    }
}
