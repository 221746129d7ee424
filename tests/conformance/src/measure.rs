//! What a receiver's answers are worth: never wrongly visible, and how much arrives.

use viewshed_harness::bus::traffic::Maps;

use crate::input::Input;
use crate::library::{Library, Visible};
use crate::world::{START, World};

/// A + D, microseconds.
const AGE_AND_DELAY_US: u64 = 400_000;

/// Share of the newest map's visible cells that counts as shown again.
const AGAIN: f64 = 0.9;

/// Figures of one run or of several.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Figures {
    pub looks: u64,
    /// Looks with a cell shown visible that was visible in no map of the last A + D of the same sender.
    pub wrong_looks: u64,
    pub wrong_cells: u64,
    /// Visible cells of the newest map, and those of them that were shown.
    pub newest: u64,
    pub shown: u64,
    /// Looks at which another receiver answered otherwise than the library's.
    pub differ: u64,
    /// The longest it took until a map was shown again after a queue had drained and a header had come.
    pub again_us: u64,
}

impl Figures {
    /// Share of the newest map's visible cells that was shown.
    pub fn arrived(&self) -> f64 {
        self.shown as f64 / self.newest.max(1) as f64
    }

    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            looks: self.looks + other.looks,
            wrong_looks: self.wrong_looks + other.wrong_looks,
            wrong_cells: self.wrong_cells + other.wrong_cells,
            newest: self.newest + other.newest,
            shown: self.shown + other.shown,
            differ: self.differ + other.differ,
            again_us: self.again_us.max(other.again_us),
        }
    }
}

/// Compares what is shown with what was measured.
pub struct Measure<'a> {
    maps: &'a Maps,
    world: &'a World,
    figures: Figures,
    /// Moments from which on a map is to be shown again.
    waiting: Vec<u64>,
    /// The first look that shown what it must not: time since the start, cells.
    pub first_wrong: Option<(u64, u64)>,
}

impl<'a> Measure<'a> {
    pub fn new(maps: &'a Maps, world: &'a World) -> Self {
        let maps = world.made_up.as_ref().unwrap_or(maps);
        Self { maps, world, figures: Figures::default(), waiting: world.drained.clone(), first_wrong: None }
    }

    /// What a receiver shows at a true time.
    pub fn look(&mut self, at: u64, shown: &Visible) {
        let count = |row: &[u32]| row.iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        self.figures.looks += 1;
        let wrong = self.world.lives.iter().map(|life| {
            let end = life.scans.partition_point(|(measured, _)| *measured <= at);
            let lately =
                || life.scans[..end].iter().rev().take_while(|(measured, _)| measured + AGE_AND_DELAY_US >= at);
            let rows = shown.iter().enumerate();
            rows.map(|(azimuth, shown)| {
                let mut left = *shown;
                for (_, map) in lately() {
                    let words = self.maps.scans[*map].rays.get(azimuth).map(|ray| ray.bits().words());
                    left.iter_mut().zip(words.into_iter().flatten()).for_each(|(left, was)| *left &= !was);
                }
                count(&left)
            })
            .sum::<u64>()
        });
        let wrong = wrong.min().unwrap_or(0);
        if wrong > 0 && at < self.world.strict_to {
            self.figures.wrong_looks += 1;
            self.figures.wrong_cells += wrong;
            self.first_wrong.get_or_insert((at - START, wrong));
        }
        let newest = self.world.lives.iter().filter_map(|life| {
            let end = life.scans.partition_point(|(measured, _)| *measured <= at);
            end.checked_sub(1).map(|last| life.scans[last])
        });
        let Some((_, map)) = newest.max() else { return };
        let (mut all, mut arrived) = (0, 0);
        for (azimuth, ray) in self.maps.scans[map].rays.iter().enumerate() {
            let words = ray.bits().words();
            all += count(words);
            let shown = shown.get(azimuth).map_or(0, |shown| {
                shown.iter().zip(words).map(|(shown, was)| u64::from((shown & was).count_ones())).sum::<u64>()
            });
            arrived += shown;
        }
        self.figures.newest += all;
        self.figures.shown += arrived;
        for since in self.waiting.extract_if(.., |since| arrived as f64 >= AGAIN * all as f64 && *since <= at) {
            self.figures.again_us = self.figures.again_us.max(at - since);
        }
    }

    /// The figures of the whole run.
    pub fn figures(mut self) -> Figures {
        // what was never shown again
        let end = self.world.inputs.last().map_or(START, |(at, _)| *at);
        let longest = self.waiting.iter().map(|since| end.saturating_sub(*since)).max().unwrap_or(0);
        self.figures.again_us = self.figures.again_us.max(longest);
        self.figures
    }
}

/// The library's figures of a run, and what it answers.
pub fn library(maps: &Maps, world: &World) -> (Figures, Option<(u64, u64)>, Vec<String>) {
    let (mut library, mut measure) = (Library::default(), Measure::new(maps, world));
    let mut answers = Vec::new();
    for (at, input) in &world.inputs {
        if let Input::Look { time } | Input::Cells { time } = input {
            measure.look(*at, &library.visible(*time));
        }
        answers.extend(library.take(input));
    }
    let first = measure.first_wrong;
    (measure.figures(), first, answers)
}

/// The figures of a receiver that answered every look with cells.
///
/// # Errors
/// The first answer that is none, or how many are missing.
pub fn answered<'a>(maps: &Maps, world: &World, answers: impl Iterator<Item = &'a str>) -> Result<Figures, String> {
    let mut measure = Measure::new(maps, world);
    let mut looks = world.inputs.iter().filter_map(|(at, input)| match input {
        Input::Look { time } | Input::Cells { time } => Some((*at, *time)),
        _ => None,
    });
    // probabilities are compared with the library's alone
    for answer in answers.filter(|answer| answer.split(' ').nth(1) != Some("p")) {
        let mut fields = answer.split(' ');
        let Some((at, time)) = looks.next() else { return Err("more answers than looks".into()) };
        if fields.next() != Some(&time.to_string()) {
            return Err(format!("`{}` is no answer to `cells {time}`", answer.get(..40).unwrap_or(answer)));
        }
        let rows = fields.map(|row| {
            let mut words = [0; crate::library::W];
            for (cell, _) in row.bytes().enumerate().filter(|(cell, state)| *state == b'.' && *cell < 256) {
                words[cell / 32] |= 1 << (cell % 32);
            }
            words
        });
        measure.look(at, &rows.collect());
    }
    match looks.count() {
        0 => Ok(measure.figures()),
        missing => Err(format!("{missing} answers are missing")),
    }
}
