//! Probabilities as a table: how far each can be believed, and what the risks came to.

use anyhow::Result;
use serde_json::{Value, json};

use super::json::Options;
use super::table::{Extent, tables};
use super::{ORIGIN, percent};
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::probability::Threshold;
use crate::studies::experiment::calibration::{Figure, Judged, Predictor, Risk};

/// Bars that a table has to reach.
const MOST_ERROR: f64 = 0.05;
const LEAST_RESOLUTION_SHARE: f64 = 0.9;
const LEAST_AUC_GAIN: f64 = -0.01;
/// Of the risk asked for: what is met, and the upper end of its interval.
const MOST_RISK: [f64; 2] = [1.25, 1.5];

/// Everything as text.
pub fn text(all: &[Judged], extent: Extent) -> String {
    let mut text = String::new();
    for judged in all {
        text += &format!(
            "{}: fitted on {}, judged on {}\n{}\n{}\n{}\n\n",
            judged.name,
            counted(judged.fit),
            counted(judged.report),
            predictors(&judged.predictors, extent),
            bars(judged),
            risks(&judged.risks, extent)
        );
    }
    text += "table: at most 1 kB, on the unit; grade: the grade as it is, over 255; offline: the same fit without limits of size.\n\
            risk: of what is called visible, the share that is missed. Two-sample KS over track means is no bar: even a\n\
            perfect probability has 0.25 to 0.5 there.\n";
    format!("{text}\n{ORIGIN}\n")
}

fn counted(of: crate::studies::experiment::calibration::Extent) -> String {
    let days = if of.days > 1 { format!("{} days, ", of.days) } else { String::new() };
    format!("{days}{} {}, {} samples", of.units, of.kind, of.samples)
}

fn figure(figure: Figure) -> String {
    let spread = figure.interval.map(|Interval(low, high)| format!("\n{low:.3}…{high:.3}"));
    figure.value.map_or_else(|| "n/a".into(), |v| format!("{v:.3}")) + &spread.unwrap_or_default()
}

fn predictors(all: &[Predictor], extent: Extent) -> String {
    let heading =
        ["p from", "ECE", "KS", "Brier", "less base\nrate's", "reliability", "resolution", "AUC", "two-sample\nKS"];
    let row = |p: &Predictor| {
        vec![
            p.name.to_owned(),
            figure(p.ece),
            figure(p.ks),
            format!("{:.4}", p.metrics.brier),
            figure(p.against_base_rate),
            format!("{:.4}", p.metrics.reliability),
            format!("{:.4}", p.metrics.resolution),
            figure(p.auc),
            p.two_sample_ks.map_or_else(|| "n/a".into(), |v| format!("{v:.2}")),
        ]
    };
    tables(&heading, &all.iter().map(row).collect::<Vec<_>>(), 1, extent)
}

fn said(reached: bool) -> &'static str {
    if reached { "reached" } else { "NOT reached" }
}

/// Whether the table is as good as it should be.
fn bars(judged: &Judged) -> String {
    let Some(table) = judged.predictors.first() else { return String::new() };
    let below = |f: Figure, most: f64| said(f.value.is_some_and(|v| v <= most));
    let above = |f: Figure, least: f64| said(f.value.is_some_and(|v| v >= least));
    let line = |f: Figure| figure(f).replacen('\n', ", ", 1);
    let better = table.against_base_rate.interval.is_some_and(|Interval(_, high)| high < 0.0);
    format!(
        "ECE ≤ {MOST_ERROR}: {}; KS ≤ {MOST_ERROR}: {}; Brier score below the base rate's, interval excluding 0: {}\n\
         resolution over the offline fit's ≥ {LEAST_RESOLUTION_SHARE}: {} ({})\n\
         AUC less the grade's ≥ {LEAST_AUC_GAIN}: {} ({})",
        below(table.ece, MOST_ERROR),
        below(table.ks, MOST_ERROR),
        said(better),
        line(judged.resolution_share),
        above(judged.resolution_share, LEAST_RESOLUTION_SHARE),
        line(judged.auc_gain),
        above(judged.auc_gain, LEAST_AUC_GAIN)
    )
}

fn risks(all: &[Risk], extent: Extent) -> String {
    let heading = ["risk asked", "visible is", "risk met %", "visible %", "FIR %", ""];
    let row = |r: &Risk| {
        let spread = r.interval.map(|Interval(low, high)| format!("\n{:.1}–{:.1}", 100.0 * low, 100.0 * high));
        let threshold = match r.threshold {
            Threshold::Everything => "everything".into(),
            Threshold::From(p) => format!("p ≥ {:.3}", f64::from(p) / 255.0),
            Threshold::Nothing => "nothing".into(),
        };
        let met =
            r.kept.risk.zip(r.interval).map(|(risk, Interval(_, high))| {
                said(risk <= MOST_RISK[0] * r.asked && high <= MOST_RISK[1] * r.asked)
            });
        vec![
            format!("{:.0} %", 100.0 * r.asked),
            threshold,
            percent(r.kept.risk) + &spread.unwrap_or_default(),
            percent(r.kept.visible_share),
            percent(r.kept.fir),
            met.unwrap_or("no threshold keeps it").to_owned(),
        ]
    };
    tables(&heading, &all.iter().map(row).collect::<Vec<_>>(), 1, extent)
}

/// The file of `--json`.
///
/// # Errors
/// None that a report can have.
pub fn json(all: &[Judged], plan: &Value, options: Options) -> Result<String> {
    let all = json!({
        "units": all,
        "plan": plan,
        "options": { "evaluation": options.evaluation, "estimators": options.estimators },
        "origin": ORIGIN,
    });
    Ok(serde_json::to_string_pretty(&all)? + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::probability::risk::Kept;

    #[test]
    fn a_risk_is_met_where_both_it_and_its_bound_are_and_says_where_none_can_be() {
        let risk = |asked, risk: Option<f64>, high: f64, threshold| Risk {
            asked,
            threshold,
            kept: Kept { risk, visible_share: Some(0.5), fir: Some(0.4) },
            interval: risk.map(|r| Interval(r / 2.0, high)),
        };
        let text = risks(
            &[
                risk(0.1, Some(0.124), 0.149, Threshold::From(204)),
                risk(0.1, Some(0.09), 0.151, Threshold::From(204)),
                risk(0.1, Some(0.126), 0.14, Threshold::Everything),
                risk(0.1, None, 0.0, Threshold::Nothing),
            ],
            Extent::Wide,
        );
        assert_eq!(text.matches("NOT reached").count(), 2, "{text}");
        assert_eq!(text.matches(" reached").count(), 3, "{text}");
        assert!(text.contains("p ≥ 0.800") && text.contains("no threshold keeps it"), "{text}");
    }
}
