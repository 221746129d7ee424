//! Finds parameters of `radar-3d` on training recordings, and says what they are worth on others.
//!
//! # Model
//! Each evaluation runs `radar-3d` over all training recordings and takes the mean of each rate over them: FVR, FIR,
//! cell FVR and cell FIR, in points. Loss = their sum, and twice what each rate of each recording is above that of the
//! usual parameters, in the mean over the recordings: a rate is not bought with another, nor a place with another. The first evaluation is of the usual parameters, [`INITIAL`] more of random ones,
//! the others where a Gaussian [`process`](gaussian) expects most, or at random throughout for comparison. The size of the
//! grid, and with it memory, is searched where a space names `grid`: a choice of two. Instructions hardly depend on the rest.

pub mod gaussian;
pub mod plan;
pub mod space;

use anyhow::{Context, Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::cells::CellCounts;
use crate::evaluation::counts::Counts;
use crate::evaluation::paired::Counted;
use crate::evaluation::samples::{self, FrameSamples};
use crate::evaluation::score::score;
use crate::evaluation::units::Units;
use crate::recording::Recording;
use gaussian::Process;
use space::Space;

/// Random points before the process is asked.
pub const INITIAL: usize = 12;

/// Weight of what a recording's rate is above the usual parameters'.
const PENALTY: f64 = 2.0;

/// How the next point is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Search {
    /// Where a Gaussian process expects most
    Bayes,
    /// Anywhere, to compare with
    Random,
}

impl Search {
    pub fn name(self) -> &'static str {
        match self {
            Self::Bayes => "bayes",
            Self::Random => "random",
        }
    }
}

/// FVR, FIR, cell FVR, cell FIR in points; `None` where a recording, or all of them, has none.
pub type Rates = [Option<f64>; 4];

/// One set of values tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    pub values: Vec<f64>,
    /// Of each recording.
    pub each: Vec<Rates>,
    /// Their means.
    pub rates: Rates,
    pub loss: f64,
}

/// A search as far as it has come; what its file holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    pub search: Search,
    pub seed: u64,
    /// Names of the training recordings.
    pub training: Vec<String>,
    /// Everything else that an evaluation depends on: options of the evaluation and of the estimators, as text.
    pub options: String,
    pub space: Space,
    pub evaluations: Vec<Evaluation>,
}

impl State {
    pub fn new(search: Search, seed: u64, space: Space, training: &[Prepared], settings: &Settings) -> Self {
        let training = training.iter().map(|p| p.recording.name.clone()).collect();
        let options = format!("{:?} {:?} {:?}", settings.reading, settings.evaluation, settings.estimators);
        Self { search, seed, training, options, space, evaluations: Vec::new() }
    }

    /// Takes over what a file of this search holds.
    ///
    /// # Errors
    /// Text that is no state, and a state of another search, by what differs.
    pub fn resume(&mut self, text: &str) -> Result<()> {
        let found: Self = serde_json::from_str(text).context("not a state of `viewshed tune`")?;
        for (what, same) in [
            ("--search", found.search == self.search),
            ("--seed", found.seed == self.seed),
            ("training recordings", found.training == self.training),
            ("search space", found.space == self.space),
            ("options", found.options == self.options),
        ] {
            ensure!(same, "it is of a search with other {what}; name another file, or give what it was begun with");
        }
        self.evaluations = found.evaluations;
        Ok(())
    }

    /// The evaluation with the least loss.
    pub fn best(&self) -> Option<&Evaluation> {
        self.evaluations.iter().min_by(|a, b| a.loss.total_cmp(&b.loss))
    }

    /// Those that no other is below in both rates of a pair (0, 1: objects; 2, 3: cells), by rising FIR.
    pub fn front(&self, fvr: usize, fir: usize) -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> =
            self.evaluations.iter().filter_map(|e| e.rates[fir].zip(e.rates[fvr])).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut least = f64::INFINITY;
        points.retain(|p| {
            let better = p.1 < least;
            least = least.min(p.1);
            better
        });
        points
    }

    /// Runs until there are so many evaluations. `save` is called after each.
    ///
    /// # Errors
    /// Values that the library refuses, by the parameter's name, and those of `save`.
    pub fn run(
        &mut self,
        evaluations: usize,
        training: &[Prepared],
        settings: &Settings,
        save: &dyn Fn(&Self) -> Result<()>,
    ) -> Result<()> {
        let usual = self.space.usual(&settings.estimators)?;
        while self.evaluations.len() < evaluations {
            let point = if self.evaluations.is_empty() { usual.clone() } else { self.next() };
            let values = self.space.values(&point);
            let options = self.space.apply(&settings.estimators, &values)?;
            let each: Vec<Rates> = count(training, &options, settings)?.iter().map(rates).collect();
            let loss = loss(&each, self.evaluations.first().map_or(&each, |first| &first.each));
            self.evaluations.push(Evaluation { values, rates: means(&each), each, loss });
            save(self)?;
        }
        Ok(())
    }

    fn next(&self) -> Vec<f64> {
        let mut random = gaussian::generator(self.seed, self.evaluations.len());
        let dimensions = self.space.parameter.len();
        if self.search == Search::Random || self.evaluations.len() <= INITIAL {
            return gaussian::anywhere(dimensions, &mut random);
        }
        let (points, losses) = self.points();
        match Process::fit(&points, &losses, &mut random) {
            Some(process) => process.next(&mut random),
            None => gaussian::anywhere(dimensions, &mut random),
        }
    }

    fn points(&self) -> (Vec<Vec<f64>>, Vec<f64>) {
        let unit = |values: &[f64]| {
            let limits = self.space.parameter.iter().zip(values);
            limits.map(|(p, v)| (v - p.low) / (p.high - p.low)).collect()
        };
        self.evaluations.iter().map(|e| (unit(&e.values), e.loss)).unzip()
    }

    /// Share of each parameter in how fast the loss changes; `None` before there are enough evaluations.
    pub fn importance(&self) -> Option<Vec<f64>> {
        let (points, losses) = self.points();
        if points.len() <= INITIAL {
            return None;
        }
        Process::fit(&points, &losses, &mut gaussian::generator(self.seed, usize::MAX)).map(|p| p.importance())
    }
}

/// A labelled recording whose samples are known.
pub struct Prepared {
    pub recording: Recording,
    samples: Vec<FrameSamples>,
    units: Units,
}

impl Prepared {
    /// # Errors
    /// A recording without labels, of a camera, or in which nothing counts.
    pub fn new(recording: Recording, settings: &Settings, progress: &(dyn Fn() + Sync)) -> Result<Self> {
        let name = &recording.name;
        ensure!(
            recording.truth.is_some(),
            "{name} has no labels: without them nothing says which parameters are better"
        );
        ensure!(recording.of_camera().is_none(), "{name} is of a camera; radar-3d is tuned");
        let samples = samples::collect(&recording, &settings.evaluation, progress);
        ensure!(samples.iter().any(|s| !s.objects.is_empty()), "{name}: no labelled object counts in any frame");
        let units = Units::new(&recording, &samples);
        Ok(Self { recording, samples, units })
    }
}

/// What `radar-3d` with these options counts on each recording.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn count(recordings: &[Prepared], options: &estimators::Options, settings: &Settings) -> Result<Vec<Counted>> {
    let one = |p: &Prepared| -> Result<Counted> {
        let mut own = estimators::own(&p.recording, options)?;
        let score = score(own.as_mut(), &p.recording, &p.samples, settings.evaluation.grid, &|| ());
        let by_unit = p.units.by_object(|counts: &mut Counts, frame, object| {
            counts.add(score.verdicts[frame][object].visible, p.samples[frame].objects[object].detected);
        });
        let by_block = p.units.by_block(|counts: &mut CellCounts, frame| *counts += score.cells[frame].counts);
        Ok(Counted { by_unit, by_block })
    };
    recordings.par_iter().map(one).collect()
}

/// Several recordings as one, for intervals.
pub fn joined(all: &[Counted]) -> Counted {
    let mut joined = Counted::default();
    for one in all {
        joined.by_unit.extend(&one.by_unit);
        joined.by_block.extend(&one.by_block);
    }
    joined
}

/// Rates of a recording, in points.
pub fn rates(counted: &Counted) -> Rates {
    let (mut objects, mut cells) = (Counts::default(), CellCounts::default());
    counted.by_unit.iter().for_each(|&c| objects += c);
    counted.by_block.iter().for_each(|&c| cells += c);
    [objects.fvr(), objects.fir(), cells.fvr(), cells.fir()].map(|rate| rate.map(|rate| short(100.0 * rate)))
}

/// Means over the recordings that have a rate.
pub fn means(each: &[Rates]) -> Rates {
    std::array::from_fn(|k| {
        let known: Vec<f64> = each.iter().filter_map(|rates| rates[k]).collect();
        (!known.is_empty()).then(|| short(known.iter().sum::<f64>() / known.len() as f64))
    })
}

fn loss(each: &[Rates], usual: &[Rates]) -> f64 {
    let above =
        |(own, usual): (&Option<f64>, &Option<f64>)| own.zip(*usual).map_or(0.0, |(own, usual)| (own - usual).max(0.0));
    let worse: f64 = each.iter().zip(usual).flat_map(|(own, usual)| own.iter().zip(usual).map(above)).sum();
    let sum: f64 = means(each).iter().flatten().sum();
    short(sum + PENALTY * worse / each.len().max(1) as f64)
}

/// Rounded to a millionth, so that it comes back from a file as it was.
fn short(points: f64) -> f64 {
    (points * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> State {
        let evaluation = |fvr: f64, fir: f64| Evaluation {
            values: vec![0.5; space::MOST],
            each: vec![[Some(fvr), Some(fir), None, None]],
            rates: [Some(fvr), Some(fir), None, None],
            loss: fvr + fir,
        };
        State {
            search: Search::Bayes,
            seed: 3,
            training: vec!["a".into()],
            options: String::new(),
            space: Space::default(),
            evaluations: vec![
                evaluation(20.0, 10.0),
                evaluation(30.0, 5.0),
                evaluation(25.0, 12.0),
                evaluation(9.0, 15.0),
            ],
        }
    }

    #[test]
    fn a_rate_is_not_bought_with_another_nor_a_place_with_another() {
        let usual = [[Some(20.0), Some(10.0), Some(8.0), None]];
        assert_eq!(loss(&usual, &usual), 38.0);
        assert_eq!(loss(&[[Some(15.0), Some(10.0), Some(8.0), None]], &usual), 33.0);
        // 5 points better in one, 3 worse in another: no gain
        assert_eq!(loss(&[[Some(15.0), Some(13.0), Some(8.0), None]], &usual), 42.0);
        let of = |fvr: [f64; 2]| fvr.map(|fvr| [Some(fvr), Some(10.0), Some(8.0), None]);
        // 10 points better at one place, 6 worse at another: 36, and half of twice 6
        assert_eq!(loss(&of([10.0, 26.0]), &of([20.0, 20.0])), 42.0);
        assert_eq!(loss(&of([18.0, 18.0]), &of([20.0, 20.0])), 36.0);
    }

    #[test]
    fn the_front_is_what_nothing_is_better_than() {
        assert_eq!(state().front(0, 1), [(5.0, 30.0), (10.0, 20.0), (15.0, 9.0)]);
        assert!(state().front(2, 3).is_empty());
        assert_eq!(state().best().unwrap().rates[0], Some(9.0));
    }

    #[test]
    fn a_search_goes_on_from_its_own_file_only() {
        let mut long = state();
        // more digits than a file gives back
        long.evaluations[0].loss =
            loss(&[[Some(38.345_864_661_654_13), Some(22.690_381_079_195_994), None, None]], &[[None; 4]]);
        let mut back = State { evaluations: Vec::new(), ..state() };
        back.resume(&serde_json::to_string(&long).unwrap()).unwrap();
        assert_eq!(back, long);
        let kept = serde_json::to_string(&state()).unwrap();
        let mut empty = State { evaluations: Vec::new(), ..state() };
        empty.resume(&kept).unwrap();
        assert_eq!(empty, state());
        let refused = |change: &dyn Fn(&mut State), text: &str| {
            let mut other = state();
            change(&mut other);
            format!("{:#}", other.resume(text).unwrap_err())
        };
        assert!(refused(&|s| s.seed = 4, &kept).contains("other --seed"));
        assert!(refused(&|s| s.search = Search::Random, &kept).contains("other --search"));
        assert!(refused(&|s| s.training.push("b".into()), &kept).contains("other training recordings"));
        assert!(refused(&|s| s.space.parameter[0].low = 0.1, &kept).contains("other search space"));
        assert!(refused(&|s| s.options = "x".into(), &kept).contains("other options"));
        assert!(refused(&|_| (), "{}").contains("not a state"));
    }

    #[test]
    fn rates_are_means_over_recordings_and_missing_ones_are_left_out() {
        let one = |fv: u64, ti: u64| Counted { by_unit: vec![Counts { tv: 9, fi: 1, fv, ti }], by_block: Vec::new() };
        // 1 of 10 and 30 of 60, the long recording no more than the short one
        let of = |all: [Counted; 2]| means(&all.each_ref().map(rates));
        assert_eq!(of([one(1, 9), one(30, 30)]), [Some(30.0), Some(10.0), None, None]);
        assert_eq!(of([one(1, 9), one(0, 0)])[0], Some(10.0));
    }
}
