//! Tables of rates as HTML, figure for figure those of the text.

use std::fmt::Write as _;

use super::escaped;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::breakdown::band_name;
use crate::evaluation::causes::Causes;
use crate::evaluation::counts::Counts;
use crate::evaluation::mount_error::Sensitivity;
use crate::evaluation::summary::{Row, Summary};
use crate::results::report::percent;
use crate::results::report::table::{CAUSES, causes_caption, causes_rows, signed};

/// A table whose first column is text; cells are HTML.
pub fn table(caption: &str, heading: &[String], rows: &[(bool, Vec<String>)]) -> String {
    let mut html = format!("<div class=\"table\"><table><caption>{}</caption><thead><tr>", escaped(caption));
    for name in heading {
        let _ = write!(html, "<th scope=\"col\">{name}</th>");
    }
    html += "</tr></thead><tbody>\n";
    for (strong, row) in rows {
        html += if *strong { "<tr class=\"strong\">" } else { "<tr>" };
        for (column, cell) in row.iter().enumerate() {
            let _ = match column {
                0 => write!(html, "<th scope=\"row\">{cell}</th>"),
                _ => write!(html, "<td>{cell}</td>"),
            };
        }
        html += "</tr>\n";
    }
    html + "</tbody></table></div>\n"
}

fn with_interval(rate: Option<f64>, interval: Option<Interval>) -> String {
    let spread = interval.map(|Interval(low, high)| format!("<small>{:.1}–{:.1}</small>", 100.0 * low, 100.0 * high));
    percent(rate) + &spread.unwrap_or_default()
}

fn points(points: Option<f64>) -> String {
    escaped(&signed(points, None))
}

/// Every estimator's rates with their intervals.
pub fn rates(summary: &Summary, shown: &str) -> String {
    let heading = [
        "estimator",
        "<abbr title=\"of the detected, called visible\">TVR</abbr> %",
        "<abbr title=\"of the undetected, called visible: unsafe\">FVR</abbr> %",
        "<abbr title=\"of the undetected, called invisible\">TIR</abbr> %",
        "<abbr title=\"of the detected, called invisible: costs availability\">FIR</abbr> %",
        "cell FVR %",
        "cell FIR %",
        "FVR from slice, points",
        "FIR from slice, points",
    ]
    .map(str::to_owned);
    let row = |row: &Row| {
        let (c, i) = (&row.counts, &row.intervals);
        let cells = vec![
            escaped(&row.name),
            with_interval(c.tvr(), i.tvr),
            with_interval(c.fvr(), i.fvr),
            with_interval(c.tir(), i.tir),
            with_interval(c.fir(), i.fir),
            with_interval(row.cell_fvr(), i.cell_fvr),
            with_interval(row.cell_fir(), i.cell_fir),
            points(row.to_slice.fvr_points),
            points(row.to_slice.fir_points),
        ];
        (row.name == shown, cells)
    };
    table("Rates with their 95 % intervals", &heading, &summary.rows.iter().map(row).collect::<Vec<_>>())
}

/// FVR / FIR by class, by distance, and by occlusion where somebody graded it.
pub fn breakdown(summary: &Summary, shown: &str) -> String {
    let class = |r: &Row| r.breakdown.class.iter().map(|(class, &c)| (class.clone(), c)).collect();
    let band = |r: &Row| r.breakdown.distance.iter().map(|(&band, &c)| (band_name(band), c)).collect();
    let grade = |r: &Row| r.breakdown.occlusion.iter().map(|(&grade, &c)| (grade.to_string(), c)).collect();
    grouped(summary, shown, "class", class)
        + &grouped(summary, shown, "distance, m", band)
        + &grouped(summary, shown, "occlusion", grade)
}

fn grouped(summary: &Summary, shown: &str, by: &str, groups: impl Fn(&Row) -> Vec<(String, Counts)>) -> String {
    let columns: Vec<Vec<(String, Counts)>> = summary.rows.iter().map(groups).collect();
    if columns.first().is_none_or(Vec::is_empty) {
        return String::new();
    }
    let mut heading: Vec<String> = [by, "samples", "coverage %"].map(str::to_owned).to_vec();
    let name = |row: &Row| {
        let name = escaped(&row.name);
        if row.name == shown { format!("<strong>{name}</strong>") } else { name }
    };
    heading.extend(summary.rows.iter().map(name));
    let rows = columns.first().into_iter().flatten().enumerate().map(|(k, (group, counts))| {
        let pair = |c: &Counts| format!("{} / {}", percent(c.fvr()), percent(c.fir()));
        let cells = columns.iter().map(|column| column.get(k).map_or_else(String::new, |(_, c)| pair(c)));
        let first = [escaped(group), counts.total().to_string(), percent(counts.coverage())];
        (false, first.into_iter().chain(cells).collect())
    });
    table(&format!("FVR / FIR in % by {by}"), &heading, &rows.collect::<Vec<_>>())
}

/// Why cells are wrong.
pub fn causes(causes: &Causes) -> String {
    let escaped = |(sum, row): (bool, Vec<String>)| (sum, row.iter().map(|cell| escaped(cell)).collect());
    let rows: Vec<(bool, Vec<String>)> = causes_rows(causes).into_iter().map(escaped).collect();
    let heading = CAUSES.map(str::to_owned);
    table(&causes_caption(causes), &heading, &rows)
}

/// How the rates move with a wrong mount.
pub fn mount_error(sensitivities: &[Sensitivity]) -> String {
    let describe = |s: &Sensitivity| match (s.error.pitch_deg, s.error.height_m) {
        (pitch, 0.0) => format!("pitch {pitch:+} deg"),
        (_, height) => format!("height {height:+} m"),
    };
    let heading: Vec<String> =
        ["estimator".into(), "rates".into()].into_iter().chain(sensitivities.iter().map(describe)).collect();
    let names = sensitivities.first().map(|s| s.estimators.iter().map(|m| m.name.clone())).into_iter().flatten();
    let rows = names.enumerate().flat_map(|(k, name)| {
        [(false, "FVR / FIR"), (true, "cell FVR / FIR")].map(|(cells, of)| {
            let moved = sensitivities.iter().map(|s| match s.estimators.get(k) {
                Some(m) if cells => format!("{} / {}", points(m.cell_fvr_points), points(m.cell_fir_points)),
                Some(m) => format!("{} / {}", points(m.fvr_points), points(m.fir_points)),
                None => String::new(),
            });
            (false, [escaped(&name), of.to_owned()].into_iter().chain(moved).collect::<Vec<_>>())
        })
    });
    let caption = "What a wrong mount does, given to the estimators and not to the truth (points)";
    table(caption, &heading, &rows.collect::<Vec<_>>())
}
