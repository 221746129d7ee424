//! `viewshed tune`: parameters of `radar-3d` found on training recordings, and what they are worth on others.

mod searches;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

use super::print;
use super::progress::bar;
use crate::command::options::SettingsArgs;
use crate::evaluation::Settings;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::paired::{Counted, differences};
use crate::recording;
use crate::results::files::{Folder, OutputArgs};
use crate::results::pictures::tradeoff::{
    self, Counted as Axes, Curve, CurvePoint, Marker, MarkerKind, Span, TradeOff,
};
use crate::results::report::compare::{self as report, Compared};
use crate::results::report::table::Extent;
use crate::studies::tune::plan::{Plan, Run};
use crate::studies::tune::space::{GRID, Space};
use crate::studies::tune::{Evaluation, Prepared, Rates, Search, State, count, joined};
use searches::{Searches, usual};

/// Find parameters of radar-3d on some recordings and judge them on others
///
/// Each evaluation runs radar-3d over all training recordings. Loss: FVR + FIR + cell FVR + cell FIR in points, means
/// over the recordings, and twice what each recording's is above that of the usual parameters. A Gaussian process says
/// which values to try next. Both sets are reported, before and after, with paired intervals: believe the second.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Labelled recordings to tune on
    #[arg(value_name = "TRAIN", required_unless_present = "plan")]
    train: Vec<PathBuf>,
    /// Labelled recordings to judge on, none of them trained on
    #[arg(long, value_name = "TEST", required_unless_present = "plan", num_args = 1..)]
    test: Vec<PathBuf>,
    /// Simulate both as this file says (TOML; tests/recordings/tuning.toml is one); its warm-up replaces --warm-up
    #[arg(long, value_name = "FILE", requires = "unit", conflicts_with_all = ["train", "test"])]
    plan: Option<PathBuf>,
    /// Which of the plan's units: motorway, crossing or queue of the one that is shipped
    #[arg(long, value_name = "NAME", requires = "plan")]
    unit: Option<String>,
    /// Parameters and their limits (TOML) [default: 12 of radar-3d, which the results list]
    ///
    /// A table for each, at most 12:
    ///
    ///   [[parameter]]
    ///   key = "radar_3d.obstacles.gap_m"
    ///   low = 4.0
    ///   high = 10.0
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    space: Option<PathBuf>,
    /// Evaluations, the usual parameters among them
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u16).range(2..=2000))]
    evaluations: u16,
    /// How the next values are found
    #[arg(long, value_enum, value_name = "HOW", default_value_t = Search::Bayes)]
    search: Search,
    /// Seed of the search
    #[arg(long, value_name = "N", default_value_t = 1)]
    search_seed: u64,
    /// Search with so many seeds both ways, and say how often the process found less loss than chance
    ///
    /// The seeds follow --search-seed, whose own search is the one that is judged. With --state, each search has a file
    /// of its own, FILE.HOW-SEED.
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(u16).range(1..=100), conflicts_with = "search")]
    against_random: Option<u16>,
    /// Say what each parameter is worth: how the sum of the rates changes, on what is judged, with its usual value in
    /// place of the tuned one
    #[arg(long)]
    ablation: bool,
    /// Keep the search in this file, and go on with it where the file has one
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    state: Option<PathBuf>,
    /// Write tuned.toml (for --config of replay and experiment), daemon.toml (tables for the file of the Linux daemon)
    /// and fronts of FVR against FIR into this folder
    #[arg(long, value_name = "DIR", help_heading = "Results")]
    out: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// Reads, searches, judges, prints.
///
/// # Errors
/// Recordings without labels or in both sets, a space that cannot be searched, a state of another search.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut settings = args.settings.settings()?;
    let space = match &args.space {
        None => Space::default(),
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            Space::parse(&text, &settings.estimators).with_context(|| format!("--space {}", path.display()))?
        }
    };
    space.check(&settings.estimators)?;
    let plan = args.plan.as_deref().map(Plan::read).transpose()?;
    let of_plan = plan.as_ref().zip(args.unit.as_ref());
    let of_plan = of_plan.map(|(plan, name)| plan.unit(name).map(|unit| (plan, unit))).transpose()?;
    let read = args.train.iter().chain(&args.test).flat_map(|path| recording::files(path));
    let mut inputs: Vec<PathBuf> = read.chain(args.settings.files()).chain(args.space.clone()).collect();
    if let Some((plan, unit)) = of_plan {
        inputs.extend(args.plan.clone());
        inputs.extend(plan.files(unit)?);
        settings.evaluation.warm_up_s = unit.warm_up_s;
    }
    let outputs = args.outputs.beside(inputs.iter().cloned());
    let folder = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    let mut searches = Searches::open(args, &inputs)?;
    let (training, test) = match of_plan {
        Some((plan, unit)) => (simulated(plan, &unit.train, &settings)?, simulated(plan, &unit.report, &settings)?),
        None => (prepared(&args.train, &settings)?, prepared(&args.test, &settings)?),
    };
    for (path, p) in args.train.iter().zip(&training) {
        let name = &p.recording.name;
        let also = test.iter().zip(&args.test).any(|(t, other)| t.recording.name == *name || other == path);
        ensure!(!also, "{name} is both trained and judged on; leave it out of one");
    }
    searches.run(usize::from(args.evaluations), &space, &training, &settings)?;
    let state = searches.first()?;
    let found = state.best().context("no evaluation")?.clone();
    let tuned = state.space.apply(&settings.estimators, &found.values)?;
    let counted = |set: &[Prepared], options| count(set, options, &settings).map(|all| joined(&all));
    let both = |set: &[Prepared]| Ok::<_, anyhow::Error>([counted(set, &settings.estimators)?, counted(set, &tuned)?]);
    let [of_training, of_test] = [both(&training)?, both(&test)?];
    let all = [("training", &of_training), ("judged", &of_test)];
    let all = all.map(|(of, [before, after])| compared(of, before, after, &settings));
    let mut told = text(state, &found, &all);
    if args.ablation {
        told += &ablation(state, &found, &of_test[1], &test, &settings)?;
    }
    print(&(told + &searches.against_random()))?;
    if let Some(folder) = &folder {
        folder.file("tuned.toml")?.write(toml(state, &found, test.len(), ""))?;
        folder.file("daemon.toml")?.write(toml(state, &found, test.len(), "estimators.radar_3d."))?;
        pictures(folder, state, &found)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Simulates recordings of a plan.
fn simulated(plan: &Plan, runs: &[Run], settings: &Settings) -> Result<Vec<Prepared>> {
    let one = |run: &Run| {
        let frames = plan.frames(run)?;
        let simulating = bar(&format!("simulating {}", run.scene.display()), 2 * frames);
        let recording = plan.recording(run, settings, &|| simulating.step())?;
        Prepared::new(recording, settings, &|| simulating.step())
    };
    runs.iter().map(one).collect()
}

fn prepared(paths: &[PathBuf], settings: &Settings) -> Result<Vec<Prepared>> {
    let one = |path: &PathBuf| {
        let recording = recording::read(path, &settings.reading).with_context(|| path.display().to_string())?;
        let judging = bar(&format!("reading {}", recording.name), recording.frames.len() as u64);
        Prepared::new(recording, settings, &|| judging.step())
    };
    let all = paths.iter().map(one).collect::<Result<Vec<_>>>()?;
    for (k, p) in all.iter().enumerate() {
        let name = &p.recording.name;
        ensure!(all[..k].iter().all(|other| other.recording.name != *name), "two recordings are called {name}");
    }
    Ok(all)
}

fn compared(of: &str, before: &Counted, after: &Counted, settings: &Settings) -> Compared {
    let options = &settings.evaluation;
    Compared {
        of: of.to_owned(),
        estimator: "radar-3d".into(),
        units: before.by_unit.len(),
        blocks: before.by_block.len(),
        differences: differences(before, after, options.bootstrap, options.seed),
    }
}

fn text(state: &State, found: &Evaluation, all: &[Compared]) -> String {
    let how = state.search.name();
    let mut text = format!(
        "{} evaluations ({how} search, seed {}): loss {:.2} of the usual parameters, {:.2} of the best\n",
        state.evaluations.len(),
        state.seed,
        usual(state),
        found.loss
    );
    let importance = state.importance();
    for (k, (p, v)) in state.space.parameter.iter().zip(&found.values).enumerate() {
        let share = importance.as_ref().map_or_else(String::new, |i| format!(", importance {:.0} %", 100.0 * i[k]));
        let before = state.evaluations.first().map_or(f64::NAN, |e| e.values[k]);
        text += &format!("  {} = {v} (usually {before}, searched {} to {}{share})\n", p.key, p.low, p.high);
    }
    text += &format!("\n{}", report::text(all, Extent::Terminal));
    let sum = |c: &Compared| c.differences.iter().find(|d| d.rate == "sum").and_then(|d| d.points);
    if let [training, test] = all
        && let Some((a, b)) = sum(training).zip(sum(test))
    {
        text += &format!(
            "Gap: the sum of the rates changed by {a:+.1} points where it was tuned and by {b:+.1} where it was not.\n"
        );
    }
    text
}

/// What of `tuned` is lost where one parameter has its usual value again.
fn ablation(
    state: &State,
    found: &Evaluation,
    tuned: &Counted,
    test: &[Prepared],
    settings: &Settings,
) -> Result<String> {
    let usual = state.evaluations.first().context("no evaluation")?;
    let putting_back = bar("putting back", state.space.parameter.len() as u64);
    let mut text =
        String::from("Sum of the rates judged, with the usual value of one parameter in place of the tuned one:\n");
    for (k, p) in state.space.parameter.iter().enumerate() {
        let mut values = found.values.clone();
        values[k] = usual.values[k];
        let without = joined(&count(test, &state.space.apply(&settings.estimators, &values)?, settings)?);
        let options = &settings.evaluation;
        let all = differences(tuned, &without, options.bootstrap, options.seed);
        let sum = all.iter().find(|d| d.rate == "sum").context("no sum")?;
        let points = sum.points.map_or_else(|| "-".into(), |points| format!("{points:+.1}"));
        let interval =
            sum.interval.map_or_else(String::new, |Interval(low, high)| format!(" ({low:+.1} to {high:+.1})"));
        text += &format!("  {} = {} again: {points}{interval}\n", p.key, usual.values[k]);
        putting_back.step();
    }
    Ok(text)
}

/// The values as a configuration: tables of `--config` below `[estimators]`, or of the daemon's file.
fn toml(state: &State, found: &Evaluation, judged: usize, of: &str) -> String {
    let mut tables: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (p, v) in state.space.parameter.iter().zip(&found.values) {
        let key = format!("estimators.{}", p.key);
        let Some((table, key)) = key.strip_prefix(of).and_then(|key| key.rsplit_once('.')) else { continue };
        tables.entry(table.to_owned()).or_default().push(format!("{key} = {}", p.written(*v)));
    }
    let mut text = format!(
        "# Found by `viewshed tune` in {} evaluations on {}; seed {}.\n# Others judged: {judged}.\n",
        state.evaluations.len(),
        state.training.join(", "),
        state.seed,
    );
    let grid = state.space.parameter.iter().zip(&found.values).find(|(p, _)| p.key == GRID);
    if let Some((p, v)) = grid.filter(|_| !of.is_empty()) {
        text += &format!("\n{GRID} = {}\n", p.written(*v));
    }
    for (table, lines) in tables {
        text += &format!("\n[{table}]\n{}\n", lines.join("\n"));
    }
    text
}

fn pictures(folder: &Folder, state: &State, found: &Evaluation) -> Result<()> {
    for (name, counted, [fvr, fir]) in [("objects", Axes::Objects, [0, 1]), ("cells", Axes::Cells, [2, 3])] {
        let front = state.front(fvr, fir);
        if front.is_empty() {
            continue;
        }
        let point = |&(fir, fvr): &(f64, f64)| CurvePoint { threshold: None, fvr: fvr / 100.0, fir: fir / 100.0 };
        let marker = |name: &str, rates: &Rates| {
            let (fvr, fir) = rates[fvr].zip(rates[fir])?;
            let kind = MarkerKind::OperatingPoint;
            let (fvr, fir) = (fvr / 100.0, fir / 100.0);
            Some(Marker { name: name.into(), kind, fvr, fir, fvr_interval: None, fir_interval: None })
        };
        let usual = state.evaluations.first().and_then(|e| marker("usual", &e.rates));
        let chart = TradeOff {
            curves: vec![Curve { name: "front of what was tried".into(), points: front.iter().map(point).collect() }],
            markers: usual.into_iter().chain(marker("tuned", &found.rates)).collect(),
            counted,
            span: Span::Auto,
            title: format!("{name}: no evaluation has less of both"),
            caption: Some(format!("{} evaluations, means over the training recordings", state.evaluations.len())),
        };
        folder.file(format!("front-{name}.png"))?.write(tradeoff::draw(&chart).png()?)?;
    }
    Ok(())
}
