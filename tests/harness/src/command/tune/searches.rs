//! The searches of one command: each resumed from its file, and both ways side by side.

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Args;
use crate::command::progress::bar;
use crate::evaluation::Settings;
use crate::results::files::{OutputArgs, Target};
use crate::studies::tune::space::Space;
use crate::studies::tune::{Prepared, Search, State};

/// Every search that is run, each with its file.
pub struct Searches {
    /// How, and with which seed.
    wanted: Vec<(Search, u64, Option<StateFile>)>,
    done: Vec<State>,
}

/// Where a search is kept.
struct StateFile {
    path: PathBuf,
    /// What it had.
    known: Option<String>,
    target: Target,
}

impl Searches {
    pub fn open(args: &Args, inputs: &[PathBuf]) -> Result<Self> {
        // a state that is gone on with is replaced; it is looked at first
        let mut outputs = OutputArgs { force: true }.beside(inputs.to_vec());
        let mut file = |of: Option<PathBuf>| -> Result<_> {
            let Some(path) = of else { return Ok(None) };
            let full = path.metadata().is_ok_and(|m| m.len() > 0);
            let read = || std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()));
            let known = full.then(read).transpose()?;
            let target = outputs.file("--state", Some(&path))?.context("no file")?;
            Ok(Some(StateFile { path, known, target }))
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

    pub fn run(&mut self, evaluations: usize, space: &Space, training: &[Prepared], settings: &Settings) -> Result<()> {
        let searching = bar("tuning", (evaluations * self.wanted.len()) as u64);
        for (search, seed, file) in &self.wanted {
            let mut state = State::new(*search, *seed, space.clone(), training, settings);
            if let Some(StateFile { path, known: Some(known), .. }) = file {
                state.resume(known).with_context(|| format!("--state {}", path.display()))?;
            }
            state.evaluations.iter().take(evaluations).for_each(|_| searching.step());
            let save = |state: &State| -> Result<()> {
                searching.step();
                searching.say(&format!("tuning, best {:.1} of {:.1}", best(state), usual(state)));
                file.as_ref().map_or(Ok(()), |file| file.target.write(serde_json::to_string(state)? + "\n"))
            };
            state.run(evaluations, training, settings, &save)?;
            self.done.push(state);
        }
        Ok(())
    }

    /// The one that is judged.
    pub fn first(&self) -> Result<&State> {
        self.done.first().context("no search")
    }

    /// How often the process found less than chance; nothing where it was not asked.
    pub fn against_random(&self) -> String {
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

pub fn best(state: &State) -> f64 {
    state.best().map_or(f64::NAN, |e| e.loss)
}

pub fn usual(state: &State) -> f64 {
    state.evaluations.first().map_or(f64::NAN, |e| e.loss)
}
