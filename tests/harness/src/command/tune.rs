//! `viewshed tune`: parameters of `radar-3d` found on training recordings, and what they are worth on others.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

use super::print;
use super::progress::bar;
use crate::command::options::SettingsArgs;
use crate::evaluation::Settings;
use crate::evaluation::paired::{Counted, differences};
use crate::recording;
use crate::results::files::{Folder, OutputArgs};
use crate::results::pictures::tradeoff::{
    self, Counted as Axes, Curve, CurvePoint, Marker, MarkerKind, Span, TradeOff,
};
use crate::results::report::compare::{self as report, Compared};
use crate::results::report::table::Extent;
use crate::studies::tune::space::Space;
use crate::studies::tune::{Evaluation, Prepared, Rates, Search, State, count, joined};

/// Find parameters of radar-3d on some recordings and judge them on others
///
/// Each evaluation runs radar-3d over all training recordings. Loss: FVR + FIR + cell FVR + cell FIR in points, means
/// over the recordings, and twice what any of them is above that of the usual parameters. A Gaussian process says which
/// values to try next. Both sets are reported, before and after, with paired intervals: believe the second.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Labelled recordings to tune on
    #[arg(value_name = "TRAIN", required = true)]
    train: Vec<PathBuf>,
    /// Labelled recordings to judge on, none of them trained on
    #[arg(long, value_name = "TEST", required = true, num_args = 1..)]
    test: Vec<PathBuf>,
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
    /// Keep the search in this file, and go on with it where the file has one
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    state: Option<PathBuf>,
    /// Write tuned.toml (for --config of replay and experiment) and fronts of FVR against FIR into this folder
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
    let settings = args.settings.settings()?;
    let space = match &args.space {
        None => Space::default(),
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            Space::parse(&text, &settings.estimators).with_context(|| format!("--space {}", path.display()))?
        }
    };
    space.check(&settings.estimators)?;
    let read = args.train.iter().chain(&args.test).flat_map(|path| recording::files(path));
    let inputs: Vec<PathBuf> = read.chain(args.settings.files()).chain(args.space.clone()).collect();
    let outputs = args.outputs.beside(inputs.iter().cloned());
    let folder = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    let known = args.state.as_deref().filter(|path| path.metadata().is_ok_and(|m| m.len() > 0));
    let known =
        known.map(|path| std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display())));
    let known = known.transpose()?;
    // a state that is gone on with is replaced; it was looked at before
    let mut states = OutputArgs { force: true }.beside(inputs);
    let state_file = states.file("--state", args.state.as_deref())?;
    let (training, test) = (prepared(&args.train, &settings)?, prepared(&args.test, &settings)?);
    for (path, p) in args.train.iter().zip(&training) {
        let name = &p.recording.name;
        let also = test.iter().zip(&args.test).any(|(t, other)| t.recording.name == *name || other == path);
        ensure!(!also, "{name} is both trained and judged on; leave it out of one");
    }
    let mut state = State::new(args.search, args.search_seed, space, &training, &settings);
    if let (Some(text), Some(path)) = (&known, &args.state) {
        state.resume(text).with_context(|| format!("--state {}", path.display()))?;
    }
    let wanted = usize::from(args.evaluations);
    let searching = bar("tuning", wanted as u64);
    state.evaluations.iter().take(wanted).for_each(|_| searching.step());
    let save = |state: &State| -> Result<()> {
        searching.step();
        searching.say(&format!("tuning, best {:.1} of {:.1}", best(state), usual(state)));
        state_file.as_ref().map_or(Ok(()), |file| file.write(serde_json::to_string(state)? + "\n"))
    };
    state.run(wanted, &training, &settings, &save)?;
    drop(searching);
    let found = state.best().context("no evaluation")?.clone();
    let tuned = state.space.apply(&settings.estimators, &found.values)?;
    let mut all = Vec::new();
    for (of, set) in [("training", &training), ("judged", &test)] {
        let [before, after] = [&settings.estimators, &tuned].map(|o| count(set, o, &settings).map(|all| joined(&all)));
        all.push(compared(of, &before?, &after?, &settings));
    }
    print(&text(&state, &found, &all))?;
    if let Some(folder) = &folder {
        folder.file("tuned.toml")?.write(toml(&state, &found, args)?)?;
        pictures(folder, &state, &found)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
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

fn best(state: &State) -> f64 {
    state.best().map_or(f64::NAN, |e| e.loss)
}

fn usual(state: &State) -> f64 {
    state.evaluations.first().map_or(f64::NAN, |e| e.loss)
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
    let how = match state.search {
        Search::Bayes => "Bayesian",
        Search::Random => "random",
    };
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

/// The values as a configuration.
fn toml(state: &State, found: &Evaluation, args: &Args) -> Result<String> {
    let mut tables: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (p, v) in state.space.parameter.iter().zip(&found.values) {
        let (table, key) = p.key.rsplit_once('.').map_or(("", p.key.as_str()), |(t, k)| (t, k));
        let table = [Some("estimators"), Some(table).filter(|t| !t.is_empty())];
        let table = table.into_iter().flatten().collect::<Vec<_>>().join(".");
        tables.entry(table).or_default().push(format!("{key} = {v:?}"));
    }
    let mut text = format!(
        "# Found by `viewshed tune` in {} evaluations on {}; seed {}. For `viewshed replay --config`.\n\
         # Judged on {} others.\n",
        state.evaluations.len(),
        state.training.join(", "),
        state.seed,
        args.test.len()
    );
    for (table, lines) in tables {
        text += &format!("\n[{table}]\n{}\n", lines.join("\n"));
    }
    Ok(text)
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
