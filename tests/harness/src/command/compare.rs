//! `viewshed compare`: two files of `--json` in, differences with paired intervals out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::print;
use crate::evaluation::cells::CellCounts;
use crate::evaluation::counts::Counts;
use crate::evaluation::paired::{Counted, differences};
use crate::results::files::OutputArgs;
use crate::results::report::compare::{self as report, Compared};
use crate::results::report::table;

/// Compare two runs over the same recordings: is one better, or is the difference chance?
///
/// Both files were written by `viewshed replay --json` or `viewshed experiment --json`, before and after a change of the
/// library, of its configuration or of the options. Tracks are drawn again with replacement, and for cells runs of ten
/// seconds, the same ones of both runs, so that what they have in common drops out. A rate is better or worse where the
/// interval of its difference excludes 0, and n/a where the recording is too short for an interval: cells take 80 s.
///
/// At crossings the tracker amplifies the smallest difference: a change that alters nothing in truth can move the rates of
/// a single scene by several points. Judge such changes by several scenes or seeds together.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The run before the change
    #[arg(value_name = "BEFORE.json")]
    before: PathBuf,
    /// The run after it
    #[arg(value_name = "AFTER.json")]
    after: PathBuf,
    /// Compare this estimator only [default: all that both have]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Draws behind each interval
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    bootstrap: u32,
    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the differences as JSON
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
}

/// One set of samples in a file, with what each estimator counted.
struct Set {
    name: String,
    units: Vec<String>,
    estimators: Vec<(String, Counted)>,
}

/// Reads, draws, prints.
///
/// # Errors
/// A file that cannot be read or is of no run, and two that are not of the same samples.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut outputs = args.outputs.beside([args.before.clone(), args.after.clone()]);
    let json_file = outputs.file("--json", args.json.as_deref())?;
    let (before, after) = (read(&args.before)?, read(&args.after)?);
    let names = || args.before.display().to_string() + " and " + &args.after.display().to_string();
    let mut all = Vec::new();
    let (pairs, left_out) = paired(&before, &after);
    for Pair { called, a, b } in pairs {
        same_samples(&called, a, b).with_context(names)?;
        for (name, counted) in &a.estimators {
            let wanted = args.estimator.as_ref().is_none_or(|wanted| wanted == name);
            let Some((_, other)) = b.estimators.iter().find(|(other, _)| wanted && other == name) else { continue };
            ensure!(
                counted.by_block.len() == other.by_block.len(),
                "{}: {name} of `{called}` was judged in {} seconds in one and {} in the other",
                names(),
                counted.by_block.len(),
                other.by_block.len()
            );
            all.push(Compared {
                of: called.clone(),
                estimator: name.clone(),
                units: a.units.len(),
                blocks: counted.by_block.len(),
                differences: differences(counted, other, args.bootstrap, args.seed),
            });
        }
    }
    if all.is_empty() {
        let list = |sets: &[Set]| sets.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
        match &args.estimator {
            Some(name) => bail!("{}: no estimator `{name}` in both", names()),
            None => bail!("{} have nothing in common: {}; {}", names(), list(&before), list(&after)),
        }
    }
    print(&report::text(&all, table::Extent::Terminal))?;
    for (path, of_file) in [&args.before, &args.after].into_iter().zip(&left_out) {
        if !of_file.is_empty() {
            print(&format!("Not compared, in {} alone: {}.\n", path.display(), of_file.join("; ")))?;
        }
    }
    if let Some(file) = json_file {
        file.write(report::json(&all)?)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Two sets that are compared, and what they are called together.
struct Pair<'a> {
    called: String,
    a: &'a Set,
    b: &'a Set,
}

/// The first set of a name in one file is that of the other, the second the second; and what each file has beyond.
fn paired<'a>(before: &'a [Set], after: &'a [Set]) -> (Vec<Pair<'a>>, [Vec<String>; 2]) {
    let numbered = |sets: &'a [Set]| -> Vec<(&'a Set, usize)> {
        let of_name = |k: usize| sets[..k].iter().filter(|other| other.name == sets[k].name).count();
        sets.iter().enumerate().map(|(k, set)| (set, of_name(k))).collect()
    };
    let called = |(set, number): &(&Set, usize)| match number {
        0 => set.name.clone(),
        n => format!("{} ({})", set.name, n + 1),
    };
    let same = |(a, n): &(&Set, usize), (b, m): &(&Set, usize)| a.name == b.name && n == m;
    let [of_before, of_after] = [numbered(before), numbered(after)];
    let pair = |one: &(&'a Set, usize)| {
        let (b, _) = of_after.iter().find(|other| same(one, other))?;
        Some(Pair { called: called(one), a: one.0, b })
    };
    let alone = |sets: &[(&Set, usize)], others: &[(&Set, usize)]| {
        sets.iter().filter(|one| !others.iter().any(|other| same(one, other))).map(called).collect()
    };
    let left_out = [alone(&of_before, &of_after), alone(&of_after, &of_before)];
    (of_before.iter().filter_map(pair).collect(), left_out)
}

fn read(path: &Path) -> Result<Vec<Set>> {
    let place = || path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", place()))?;
    let value: Value = serde_json::from_str(&text).with_context(place)?;
    let mut sets = Vec::new();
    collect(&value, "", &mut sets).with_context(place)?;
    ensure!(!sets.is_empty(), "{}: {}", place(), nothing_in(&value));
    Ok(sets)
}

/// Why a file has nothing to compare.
fn nothing_in(value: &Value) -> &'static str {
    fn has_run(value: &Value) -> bool {
        let all = value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice);
        all.iter().any(|one| one.get("units").is_some() && one.get("estimators").is_some())
    }
    if has_run(value) {
        "a run of a recording without labels, and rates are of labelled objects: put NAME.labels.csv beside the recording (`viewshed label` makes one), and replay it again"
    } else {
        "no run of labelled samples; write one with `viewshed replay --json`"
    }
}

/// Every object of the file that has units and estimators; `within` names what it lies in.
fn collect(value: &Value, within: &str, sets: &mut Vec<Set>) -> Result<()> {
    match value {
        Value::Array(all) => all.iter().try_for_each(|one| collect(one, within, sets)),
        Value::Object(map) => {
            let said = ["recording", "name", "counted"].iter().find_map(|key| map.get(*key)?.as_str());
            let name = [within, said.unwrap_or_default()].into_iter().filter(|n| !n.is_empty());
            let name = name.collect::<Vec<_>>().join(", ");
            if let (Some(Value::Array(units)), Some(Value::Array(estimators))) =
                (map.get("units"), map.get("estimators"))
            {
                let units: Vec<String> = units.iter().filter_map(|u| u.as_str().map(str::to_owned)).collect();
                let estimators = estimators.iter().filter_map(|e| estimator(e, units.len()).transpose());
                let estimators = estimators.collect::<Result<Vec<_>>>().with_context(|| name.clone())?;
                // a recording without labels has nothing to compare
                if !units.is_empty() {
                    sets.push(Set { name: name.clone(), units, estimators });
                }
            }
            map.iter().filter(|(key, _)| *key != "plan").try_for_each(|(key, inner)| {
                // the camera of a recording has no name of its own
                let of_camera = format!("{name}, camera");
                collect(inner, if key == "camera" { &of_camera } else { &name }, sets)
            })
        }
        _ => Ok(()),
    }
}

fn estimator(value: &Value, units: usize) -> Result<Option<(String, Counted)>> {
    let Some(name) = value["name"].as_str() else { return Ok(None) };
    let rows = |key: &str| -> Result<Vec<[u64; 4]>> {
        let rows =
            value[key].as_array().with_context(|| format!("{name} has no `{key}`: written by an older version"))?;
        rows.iter()
            .map(|row| numbers(row).with_context(|| format!("{name}: `{key}` has {row}, not four counts")))
            .collect()
    };
    let by_unit: Vec<Counts> = rows("by_unit")?.into_iter().map(|[tv, fv, ti, fi]| Counts { tv, fv, ti, fi }).collect();
    ensure!(by_unit.len() == units, "{name} has counts of {} units, and there are {units}", by_unit.len());
    let block = |[blocked, blocked_visible, clear, clear_not_visible]: [u64; 4]| CellCounts {
        blocked,
        blocked_visible,
        clear,
        clear_not_visible,
    };
    let by_block = rows("by_block")?.into_iter().map(block).collect();
    Ok(Some((name.to_owned(), Counted { by_unit, by_block })))
}

fn numbers(row: &Value) -> Option<[u64; 4]> {
    let numbers: Vec<u64> = row.as_str()?.split(' ').map(|n| n.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

/// Refuses two runs that did not judge the same objects.
fn same_samples(name: &str, a: &Set, b: &Set) -> Result<()> {
    ensure!(
        a.units.len() == b.units.len(),
        "`{name}` has {} tracks in one and {} in the other: give both the same recording, labels and options of the evaluation",
        a.units.len(),
        b.units.len()
    );
    if let Some((x, y)) = a.units.iter().zip(&b.units).find(|(x, y)| x != y) {
        bail!("`{name}` has the track {x} in one where the other has {y}: they are of different recordings or labels");
    }
    for (estimator, counted) in &a.estimators {
        let Some((_, other)) = b.estimators.iter().find(|(n, _)| n == estimator) else { continue };
        let told = |c: &Counts| (c.tv + c.fi, c.fv + c.ti);
        if let Some(k) = (0..a.units.len()).find(|&k| told(&counted.by_unit[k]) != told(&other.by_unit[k])) {
            bail!(
                "`{name}`: the track {} was detected in other frames in one than in the other: compare runs of the same recording and options of the evaluation",
                a.units[k]
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn run_of(name: &str, units: &[&str], by_unit: &[&str]) -> Value {
        json!({ "recording": name, "units": units, "estimators": [
            { "name": "radar-3d", "by_unit": by_unit, "by_block": ["10 1 90 9"] },
        ]})
    }

    fn sets(value: &Value) -> Result<Vec<Set>> {
        let mut sets = Vec::new();
        collect(value, "", &mut sets).map(|()| sets)
    }

    #[test]
    fn runs_are_found_wherever_they_lie_in_a_file() {
        let one = run_of("a", &["1", "2"], &["1 2 3 4", "5 6 7 8"]);
        let mut of_camera = run_of("c", &["9"], &["1 2 3 4"]);
        of_camera.as_object_mut().unwrap().remove("recording");
        let nested = json!({ "variants": [{ "counted": "main", "pooled": one, "scenes": [one] }], "plan": one,
            "recording": "r", "camera": of_camera });
        let mut found = sets(&nested).unwrap();
        found.sort_by(|a, b| b.name.cmp(&a.name));
        let names: Vec<&str> = found.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["r, main, a", "r, main, a", "r, camera"]);
        let counted = &found[0].estimators[0].1;
        assert_eq!(counted.by_unit[1], Counts { tv: 5, fv: 6, ti: 7, fi: 8 });
        assert_eq!(counted.by_block[0].blocked_visible, 1);
    }

    #[test]
    fn runs_without_labels_are_told_from_files_of_something_else() {
        let of = |value: Value| (sets(&value).unwrap().len(), nothing_in(&value));
        assert_eq!(of(json!({ "findings": [] })).0, 0);
        assert!(of(json!({ "findings": [] })).1.contains("write one with `viewshed replay --json`"));
        let (found, said) = of(run_of("a", &[], &[]));
        assert!(found == 0 && said.contains("a recording without labels"), "{said}");
    }

    #[test]
    fn runs_of_other_samples_are_refused_by_the_first_that_differs() {
        let set = |units: &[&str], by_unit: &[&str]| sets(&run_of("a", units, by_unit)).unwrap().remove(0);
        let refused = |a: &Set, b: &Set| same_samples("a", a, b).unwrap_err().to_string();
        let a = set(&["1", "2"], &["1 2 3 4", "5 6 7 8"]);
        assert!(refused(&a, &set(&["1"], &["1 2 3 4"])).contains("2 tracks in one and 1 in the other"));
        assert!(
            refused(&a, &set(&["1", "3"], &["1 2 3 4", "5 6 7 8"])).contains("track 2 in one where the other has 3")
        );
        let other = set(&["1", "2"], &["1 2 3 4", "6 6 7 8"]);
        assert!(refused(&a, &other).contains("track 2 was detected in other frames"));
        // another map of the same objects
        assert!(same_samples("a", &a, &set(&["1", "2"], &["2 1 4 3", "5 6 7 8"])).is_ok());
    }

    #[test]
    fn recordings_of_one_name_are_compared_in_their_order_and_what_is_left_over_is_named() {
        let (one, other) = (run_of("a", &["1"], &["1 2 3 4"]), run_of("a", &["5", "6"], &["1 2 3 4", "5 6 7 8"]));
        let all = sets(&json!([one, other, run_of("b", &["1"], &["1 2 3 4"])])).unwrap();
        let (pairs, left_out) = paired(&all, &all);
        let called: Vec<&str> = pairs.iter().map(|p| p.called.as_str()).collect();
        assert_eq!((called, left_out), (vec!["a", "a (2)", "b"], [vec![], vec![]]));
        assert!(
            pairs.iter().all(|p| same_samples(&p.called, p.a, p.b).is_ok()),
            "a file is of the same samples as itself"
        );
        let few = sets(&json!([one, run_of("c", &["1"], &["1 2 3 4"])])).unwrap();
        let (pairs, left_out) = paired(&all, &few);
        assert_eq!((pairs.len(), left_out), (1, [vec!["a (2)".into(), "b".into()], vec!["c".into()]]));
    }

    #[test]
    fn counts_that_are_none_are_refused_by_their_key() {
        let wrong = |by_unit: &[&str]| format!("{:#}", sets(&run_of("a", &["1"], by_unit)).err().unwrap());
        assert!(wrong(&["1 2 3"]).contains("`by_unit` has \"1 2 3\", not four counts"));
        assert!(wrong(&[]).contains("counts of 0 units, and there are 1"));
        let old = json!({ "recording": "a", "units": ["1"], "estimators": [{ "name": "radar-3d" }] });
        assert!(format!("{:#}", sets(&old).err().unwrap()).contains("has no `by_unit`: written by an older version"));
    }
}
