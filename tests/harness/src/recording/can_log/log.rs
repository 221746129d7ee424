//! A log of any format, read line by line as often as wanted, each bus in the order of time.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};

use super::order::{Disorder, Plan, Survey};
use super::{Format, Line, Reader, begin, kind_of};
use crate::recording::file::{Source, Unpacked};
use crate::recording::problems::Problems;
use crate::recording::text;

/// Lines that are held in memory to be sorted, at most.
const MOST_SORTED: u64 = 8_000_000;

/// Frames that may bear one time: those of a scan from a logger that is slow.
const MOST_AT_ONCE: u64 = 300;

/// Frames one after the other, again from the first whenever asked.
pub trait Lines {
    fn each(&self, see: &mut dyn FnMut(&Line));
}

impl Lines for [Line] {
    fn each(&self, see: &mut dyn FnMut(&Line)) {
        self.iter().for_each(see);
    }
}

impl Lines for Vec<Line> {
    fn each(&self, see: &mut dyn FnMut(&Line)) {
        self.iter().for_each(see);
    }
}

/// A log of a CAN bus.
pub struct Log {
    source: Source,
    format: Format,
    reader: Reader,
    interface: Option<String>,
    /// Lines of text to be read.
    end: u64,
    /// Added to each time, so that none is before 0; the sign is turned before.
    shift_ns: i64,
    turned: bool,
    survey: Survey,
    plan: Plan,
    sorted: Option<Vec<Line>>,
    damage: Option<String>,
}

/// A log whose format is known.
#[derive(Clone)]
pub struct Found {
    source: Source,
    pub format: Format,
    reader: Reader,
}

/// What a file holds; `None` if it is no such log.
///
/// # Errors
/// A file that cannot be read.
pub fn find(source: &Source) -> Result<Option<Found>> {
    let lines = begin(source)?;
    let format = Format::of(&lines);
    Ok(format.map(|format| Found { source: source.clone(), format, reader: Reader::new(format, &lines) }))
}

/// A source's text, line by line.
fn open(source: &Source) -> Result<text::Lines<Unpacked>> {
    Ok(text::Lines::new(source.open()?))
}

impl Found {
    /// Looks through the log, of one interface if it is named; lines that are none are counted, and what is wrong with its
    /// times. `enough` is given each frame as it stands in the log; once it says so the rest is not read.
    ///
    /// # Errors
    /// A file that cannot be read; nothing is of the interface that is named; a log too large to be sorted here.
    pub fn read(
        self,
        interface: Option<&str>,
        problems: &mut Problems,
        enough: &mut dyn FnMut(&Line) -> bool,
    ) -> Result<Log> {
        let Self { source, format, reader } = self;
        let place = || format!("cannot read {}", source.shown());
        let mut text = open(&source)?;
        let (mut survey, mut others, mut skipped) = (Survey::default(), BTreeSet::new(), Problems::default());
        let (mut going, mut last, mut end) = (reader.clone(), 0, 0);
        while let Some(line) = text.next_line().with_context(place)? {
            end += 1;
            match going.line(&line) {
                Some(Ok(line)) if interface.is_some_and(|name| name != line.interface) => {
                    others.insert(line.interface);
                }
                Some(Ok(line)) => {
                    survey.see(&line);
                    last = line.time_ns;
                    if enough(&line) {
                        break;
                    }
                }
                Some(Err(why)) => skipped.add("log", format!("line skipped: {}", kind_of(&why)), last),
                None => {}
            }
        }
        if let Some(name) = interface.filter(|_| survey.all.lines == 0) {
            let found: Vec<_> = others.into_iter().collect();
            bail!("no frame on interface {name}; interfaces found: {}", found.join(", "));
        }
        let zeros = text.zeros();
        let damage = text.source().damage().map(str::to_owned);
        let turned = format == Format::SavvyCan && survey.all.max < 0 && survey.all.falls();
        if turned {
            survey = Survey::default();
        }
        let mut log = Log {
            source: source.clone(),
            format,
            reader,
            interface: interface.map(str::to_owned),
            end,
            shift_ns: 0,
            turned,
            survey,
            plan: Plan::AsItIs,
            sorted: None,
            damage,
        };
        if turned {
            let mut survey = Survey::default();
            log.each(&mut |line| survey.see(line));
            log.survey = survey;
        }
        let min = log.survey.all.min;
        log.shift_ns = if log.survey.all.lines > 0 && min < 0 { min.saturating_neg() } else { 0 };
        log.plan = log.survey.plan();
        let start = min.saturating_add(log.shift_ns);
        let (sign, shift) = (if turned { -1 } else { 1 }, log.shift_ns);
        for problem in skipped.iter() {
            let time = problem.first_time_ns.saturating_mul(sign).saturating_add(shift);
            problems.add_many(&problem.topic, problem.what, time, problem.count);
        }
        problems.add_many("log", "zero bytes, skipped", start, zeros);
        if turned {
            problems.add("log", "times have a minus sign and fall: they are taken without it", start);
        } else if shift > 0 {
            let what = format!("times before 0: {:.6} s are added to all, so that none is", shift as f64 * 1e-9);
            problems.add("log", what, start);
        }
        log.sort(problems, start)?;
        Ok(log)
    }
}

impl Log {
    pub fn format(&self) -> Format {
        self.format
    }

    /// That not all could be unpacked.
    pub fn damage(&self) -> Option<&str> {
        self.damage.as_deref()
    }

    /// Of the bus that was logged for the longest: each may have a clock of its own.
    pub fn duration_s(&self) -> f64 {
        self.survey.buses.values().map(|bus| bus.max.saturating_sub(bus.min)).max().unwrap_or(0) as f64 * 1e-9
    }

    /// The first time.
    pub fn start_ns(&self) -> i64 {
        self.survey.all.min.saturating_add(self.shift_ns)
    }

    /// All frames bear one time, and they are too many for that.
    pub fn stands_still(&self) -> bool {
        self.survey.all.lines > MOST_AT_ONCE && self.survey.all.min == self.survey.all.max
    }

    /// Says what is wrong with the order, and sorts where that takes all lines.
    fn sort(&mut self, problems: &mut Problems, start: i64) -> Result<()> {
        for (bus, disorder) in self.survey.disorders() {
            match disorder {
                Disorder::Near(lines, lag) => {
                    let by = lag as f64 * 1e-6;
                    let what = format!("lines that are not in the order of time, by up to {by:.1} ms: read in it");
                    problems.add_many(bus, what, start, lines);
                }
                Disorder::NewestFirst => {
                    problems.add(bus, "the newest line comes first: read in the order of time", start);
                }
                Disorder::Parts(parts) => {
                    let what = "parts of the log that are not in the order of time: read in it";
                    problems.add_many(bus, what, start, parts);
                }
                Disorder::ClockSet(times) => problems.add_many(bus, "time runs backwards", start, times),
            }
        }
        if self.plan != Plan::Sorted {
            return Ok(());
        }
        let lines = self.survey.all.lines;
        if lines > MOST_SORTED {
            bail!(
                "{}: its {lines} lines are not in the order of time, and too many to be sorted here: {}",
                self.source.shown(),
                self.format.sorting()
            );
        }
        let mut sorted = Vec::with_capacity(usize::try_from(lines).unwrap_or(0));
        self.in_its_order(&mut |line| {
            sorted.push(line);
            ControlFlow::Continue(())
        });
        self.survey.sort(&mut sorted);
        self.sorted = Some(sorted);
        Ok(())
    }

    /// Every frame as the log has it, until `see` has seen enough. A file that cannot be read any more ends there.
    fn in_its_order(&self, see: &mut dyn FnMut(Line) -> ControlFlow<()>) {
        let Ok(mut text) = open(&self.source) else { return };
        let mut reader = self.reader.clone();
        for _ in 0..self.end {
            let Ok(Some(line)) = text.next_line() else { return };
            let Some(Ok(mut line)) = reader.line(&line) else { continue };
            if self.interface.as_ref().is_some_and(|name| *name != line.interface) {
                continue;
            }
            let time = if self.turned { line.time_ns.saturating_neg() } else { line.time_ns };
            line.time_ns = time.saturating_add(self.shift_ns);
            if see(line).is_break() {
                return;
            }
        }
    }

    /// Each bus in the order of time, until `see` has seen enough.
    pub fn until(&self, see: &mut dyn FnMut(&Line) -> ControlFlow<()>) {
        match (&self.plan, &self.sorted) {
            (Plan::Sorted, Some(lines)) => {
                let _ = lines.iter().try_for_each(see);
            }
            (Plan::HeldBack { together }, _) => {
                let (mut held_back, flow) = (self.survey.held_back(*together), Cell::new(ControlFlow::Continue(())));
                let mut show = |line: &Line| {
                    if flow.get().is_continue() {
                        flow.set(see(line));
                    }
                };
                self.in_its_order(&mut |line| {
                    held_back.push(line, &mut show);
                    flow.get()
                });
                held_back.end(&mut show);
            }
            _ => self.in_its_order(&mut |line| see(&line)),
        }
    }

    /// All frames in memory.
    pub fn collect(&self) -> Vec<Line> {
        let mut lines = Vec::new();
        self.each(&mut |line| lines.push(line.clone()));
        lines
    }
}

impl Lines for Log {
    /// Each bus in the order of time.
    fn each(&self, see: &mut dyn FnMut(&Line)) {
        self.until(&mut |line| {
            see(line);
            ControlFlow::Continue(())
        });
    }
}
