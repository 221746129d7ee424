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
use crate::results::files::{Folder, OutputArgs, Target};
use crate::results::pictures::tradeoff::{
    self, Counted as Axes, Curve, CurvePoint, Marker, MarkerKind, Span, TradeOff,
};
use crate::results::report::compare::{self as report, Compared};
use crate::results::report::table::Extent;
use crate::studies::tune::plan::{Plan, Run};
use crate::studies::tune::space::Space;
use crate::studies::tune::{Evaluation, Prepared, Rates, Search, State, count, joined};

/// Find parameters of radar-3d on some recordings and judge them on others
///
/// Each evaluation runs radar-3d over all training recordings. Loss: FVR + FIR + cell FVR + cell FIR in points, means
/// over the recordings, and twice what each recording's is above that of the usual parameters. A Gaussian process says which
/// values to try next. Both sets are reported, before and after, with paired intervals: believe the second.
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
    /// The seeds follow --search-seed, whose own search is the one that is judged. With --state, each search has a file of its own,
    /// FILE.HOW-SEED.
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(u16).range(1..=100), conflicts_with = "search")]
    against_random: Option<u16>,
    /// Keep the search in this file, and go on with it where the file has one
    #[arg(long, value_name = "FILE", help_heading = "Results")]
    state: Option<PathBuf>,
    /// Write tuned.toml (for --config of replay and experiment), daemon.toml (tables for the file of the Linux daemon) and fronts of FVR
    /// against FIR into this folder
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
    let unit = plan.as_ref().zip(args.unit.as_ref()).map(|(plan, name)| plan.unit(name)).transpose()?;
    let read = args.train.iter().chain(&args.test).flat_map(|path| recording::files(path));
    let mut inputs: Vec<PathBuf> = read.chain(args.settings.files()).chain(args.space.clone()).collect();
    if let (Some(plan), Some(unit)) = (&plan, unit) {
        inputs.extend(args.plan.clone());
        inputs.extend(plan.files(unit)?);
        settings.evaluation.warm_up_s = unit.warm_up_s;
    }
    let outputs = args.outputs.beside(inputs.iter().cloned());
    let folder = args.out.as_deref().map(|path| outputs.folder("--out", path)).transpose()?;
    let mut searches = Searches::open(args, &inputs)?;
    let (training, test) = match (&plan, unit) {
        (Some(plan), Some(unit)) => {
            (simulated(plan, &unit.train, &settings)?, simulated(plan, &unit.report, &settings)?)
        }
        _ => (prepared(&args.train, &settings)?, prepared(&args.test, &settings)?),
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
    let mut all = Vec::new();
    for (of, set) in [("training", &training), ("judged", &test)] {
        let [before, after] = [&settings.estimators, &tuned].map(|o| count(set, o, &settings).map(|all| joined(&all)));
        all.push(compared(of, &before?, &after?, &settings));
    }
    print(&(text(state, &found, &all) + &searches.against_random()))?;
    if let Some(folder) = &folder {
        folder.file("tuned.toml")?.write(toml(state, &found, test.len(), ""))?;
        folder.file("daemon.toml")?.write(toml(state, &found, test.len(), "estimators.radar_3d."))?;
        pictures(folder, state, &found)?;
    }
    print(&outputs.told())?;
    Ok(ExitCode::SUCCESS)
}

/// Every search that is run, each with its file.
struct Searches {
    /// How, seed, file, and what the file had.
    wanted: Vec<(Search, u64, Option<(PathBuf, Option<String>, Target)>)>,
    done: Vec<State>,
}

impl Searches {
    fn open(args: &Args, inputs: &[PathBuf]) -> Result<Self> {
        // a state that is gone on with is replaced; it is looked at first
        let mut outputs = OutputArgs { force: true }.beside(inputs.to_vec());
        let mut file = |of: Option<PathBuf>| -> Result<_> {
            let Some(path) = of else { return Ok(None) };
            let full = path.metadata().is_ok_and(|m| m.len() > 0);
            let read = || std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()));
            let known = full.then(read).transpose()?;
            let file = outputs.file("--state", Some(&path))?.context("no file")?;
            Ok(Some((path, known, file)))
        };
        let mut wanted = Vec::new();
        let seed = args.search_seed;
        let Some(seeds) = args.against_random else {
            return Ok(Self { wanted: vec![(args.search, seed, file(args.state.clone())?)], done: Vec::new() });
        };
        for seed in (0..u64::from(seeds)).map(|k| seed.wrapping_add(k)) {
            for search in [Search::Bayes, Search::Random] {
                let path = args.state.as_ref().map(|path| {
                    let mut path = path.clone().into_os_string();
                    path.push(format!(".{}-{seed}", search.name()));
                    PathBuf::from(path)
                });
                wanted.push((search, seed, file(path)?));
            }
        }
        Ok(Self { wanted, done: Vec::new() })
    }

    fn run(&mut self, evaluations: usize, space: &Space, training: &[Prepared], settings: &Settings) -> Result<()> {
        let searching = bar("tuning", (evaluations * self.wanted.len()) as u64);
        for (search, seed, file) in &self.wanted {
            let mut state = State::new(*search, *seed, space.clone(), training, settings);
            if let Some((path, Some(text), _)) = file {
                state.resume(text).with_context(|| format!("--state {}", path.display()))?;
            }
            state.evaluations.iter().take(evaluations).for_each(|_| searching.step());
            let save = |state: &State| -> Result<()> {
                searching.step();
                searching.say(&format!("tuning, best {:.1} of {:.1}", best(state), usual(state)));
                file.as_ref().map_or(Ok(()), |(_, _, file)| file.write(serde_json::to_string(state)? + "\n"))
            };
            state.run(evaluations, training, settings, &save)?;
            self.done.push(state);
        }
        Ok(())
    }

    /// The one that is judged.
    fn first(&self) -> Result<&State> {
        self.done.first().context("no search")
    }

    /// How often the process found less than chance; nothing where it was not asked.
    fn against_random(&self) -> String {
        let mut text = String::new();
        let (mut won, mut seeds) = (0, 0);
        for pair in self.done.chunks_exact(2) {
            let [bayes, random] = [best(&pair[0]), best(&pair[1])];
            text += &format!("  seed {}: loss {bayes:.2}, at random {random:.2}\n", pair[0].seed);
            won += usize::from(bayes < random);
            seeds += 1;
        }
        if seeds == 0 {
            return text;
        }
        format!(
            "The process found less loss than chance with {won} of {seeds} seeds, as many evaluations each:\n{text}"
        )
    }
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

/// The values as a configuration: tables of `--config` below `[estimators]`, or of the daemon's file.
fn toml(state: &State, found: &Evaluation, judged: usize, of: &str) -> String {
    let mut tables: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (p, v) in state.space.parameter.iter().zip(&found.values) {
        let key = format!("estimators.{}", p.key);
        let Some((table, key)) = key.strip_prefix(of).and_then(|key| key.rsplit_once('.')) else { continue };
        tables.entry(table.to_owned()).or_default().push(format!("{key} = {v:?}"));
    }
    let mut text = format!(
        "# Found by `viewshed tune` in {} evaluations on {}; seed {}.\n# Judged on {judged} others.\n",
        state.evaluations.len(),
        state.training.join(", "),
        state.seed,
    );
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
