//! A unit's configuration from here: found, checked, written, read back, restarted.
//!
//! ```text
//! unit.toml ──> file ──> blocks ─────┐
//!                                    ├──> link: serial port, CAN bus ──> unit
//! what a unit says <── steps <───────┘
//! ```
//! A file is the whole truth of a unit: lanes, heights and a table of probabilities that it does not have are taken from the
//! unit. Nothing is written before a unit said which one it is. A unit keeps its old block whatever happens on the way: it takes a
//! new one whole, into the slot that is not in use, and from its next start on.

pub mod can;
pub mod file;
pub mod grids;
pub mod kept;
pub mod link;
pub mod serial;
#[cfg(target_os = "linux")]
pub mod socketcan;

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use viewshed::unit::can_service::INCOMPLETE;
use viewshed::unit::identity::Identified;
use viewshed::unit::reply::{Refusal, Said};
use viewshed::unit::service::PART_LEN;
use viewshed::unit::settings::{BlockError, BlockKind, Settings, Which};
use viewshed::unit::timing::Took;

use file::UnitFile;
use grids::Grid;
use link::{Ask, Link};

/// Time after which a question is put again.
const AGAIN: Duration = Duration::from_millis(500);
/// Time in which an answer is whole: on a bus it comes in forty parts, each after what is more urgent, and a question put
/// again begins it anew.
const ANSWER: Duration = Duration::from_secs(2);
/// Time in which all units of a bus have said which ones they are.
const ALL: Duration = Duration::from_millis(400);
/// Time a unit may take to erase and write a slot: parts with large sectors take seconds.
const WRITING: Duration = Duration::from_secs(10);
/// What counts whatever goes wrong while a block is sent.
const OLD: &str = "its old block is in force";
/// Parts that are sent again at most.
const MOST_LOST: usize = 64;

/// Which unit is meant.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted {
    /// By its sensor's number.
    pub sensor: Option<u8>,
    /// By its chip.
    pub chip: Option<u32>,
}

/// A unit that answered.
pub struct Found<'l> {
    link: &'l mut dyn Link,
    /// What it says of itself.
    pub unit: Identified,
    /// Others have this number of a sensor too: it was named by its chip, and they wait.
    named: Option<u8>,
}

impl Drop for Found<'_> {
    fn drop(&mut self) {
        if let Some(sensor) = self.named {
            self.link.to(Some(sensor));
            // if the bus is gone they wait until their next start
            let _ = self.link.ask(Ask::Address(0));
        }
    }
}

/// What is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Stored {
    pub sequence: u32,
    pub settings: Settings,
}

/// Looks for the unit that is meant, for this long.
///
/// # Errors
/// None answers, several do, or another one: with what was heard, and what to do.
pub fn find<'l>(link: &'l mut dyn Link, wanted: Wanted, patience: Duration) -> Result<Found<'l>> {
    let mut units: Vec<Identified> = Vec::new();
    loop {
        let begun = Instant::now();
        while units.is_empty() && begun.elapsed() < patience {
            // all of them: who else is there is worth a line
            link.to(None);
            link.ask(Ask::Identify)?;
            let until = Instant::now() + if link.is_bus() { ALL } else { AGAIN };
            while let Some(said) = link.hear(until)? {
                let Said::Identified(unit) = said else { continue };
                if !units.contains(&unit) {
                    units.push(unit);
                }
                if !link.is_bus() {
                    break;
                }
            }
        }
        if !units.is_empty() || !link.next_rate()? {
            break;
        }
    }
    ensure!(!units.is_empty(), "{}", silence(link));
    let meant: Vec<&Identified> = units
        .iter()
        .filter(|unit| wanted.sensor.is_none_or(|sensor| sensor == unit.sensor))
        .filter(|unit| wanted.chip.is_none_or(|chip| chip == unit.chip))
        .collect();
    let list = || units.iter().map(|unit| format!("\n  {}", name(unit))).collect::<String>();
    let unit = match meant[..] {
        [unit] => *unit,
        [] => bail!("{}: the unit that is meant does not answer; there is{}", link.place(), list()),
        _ => bail!("{}: {} units answer; say which one with --chip{}", link.place(), meant.len(), list()),
    };
    let named = units.iter().filter(|other| other.sensor == unit.sensor).count() > 1;
    link.to(Some(unit.sensor));
    if named {
        ensure!(
            unit.chip != 0,
            "{}: units of sensor {} without a chip's number cannot be told apart",
            link.place(),
            unit.sensor
        );
        link.ask(Ask::Address(unit.chip))?;
        let until = Instant::now() + AGAIN;
        let heard = loop {
            match link.hear(until)? {
                Some(Said::Identified(other)) if other.chip == unit.chip => break true,
                Some(_) => {}
                None => break false,
            }
        };
        ensure!(heard, "{}: chip {:08X} does not answer to its name; nothing was written", link.place(), unit.chip);
    }
    Ok(Found { link, unit, named: named.then_some(unit.sensor) })
}

/// A unit in words.
pub fn name(unit: &Identified) -> String {
    let board = if unit.board().is_empty() { String::new() } else { format!("{}, ", unit.board()) };
    let bench = if unit.is_bench { ", a test bench" } else { "" };
    let [major, minor, patch] = unit.firmware;
    let firmware = if unit.firmware == [0; 3] { String::new() } else { format!(", firmware {major}.{minor}.{patch}") };
    let [ranges, azimuths] = unit.grid;
    let grid = if unit.grid == [0; 2] { String::new() } else { format!(", grid {ranges} x {azimuths}") };
    format!("{board}sensor {}, chip {:08X}{firmware}{grid}{bench}", unit.sensor, unit.chip)
}

/// Why nobody answers, from what was heard.
fn silence(link: &dyn Link) -> String {
    let (place, noise) = (link.place(), link.noise());
    let sensors: Vec<String> = noise.sensors.keys().map(ToString::to_string).collect();
    if !sensors.is_empty() {
        return format!(
            "{place}: sensor {} sends, and does not answer: is what it sends connected and what it receives not? \
             A daemon takes requests with output.service = true",
            sensors.join(", ")
        );
    }
    match (noise.pieces, link.is_bus()) {
        (0, true) => format!(
            "{place}: not a single frame. Is the interface up (`ip -details link show {place}`), the bit rate right, the bus \
             terminated with 120 ohm at both ends, and the unit powered?"
        ),
        (0, false) => format!(
            "{place}: nothing answers. Is the unit powered, and is this its port? After a press of its reset button it listens \
             at 115 200 baud for two seconds: press it while this runs"
        ),
        (n, true) => format!("{place}: {n} frames, none of a viewshed unit; is the unit on this bus?"),
        (n, false) => format!(
            "{place}: {n} bytes came, no message of a viewshed unit among them: another device, or another bit rate (--baud)"
        ),
    }
}

impl Found<'_> {
    /// Where it is.
    pub fn place(&self) -> &str {
        self.link.place()
    }

    /// Asks until it answers with what `answer` takes.
    fn ask<T>(&mut self, what: Ask<'_>, patience: Duration, answer: impl Fn(Said) -> Option<T>) -> Result<Option<T>> {
        let begun = Instant::now();
        while begun.elapsed() < patience {
            self.link.ask(what)?;
            let until = Instant::now() + ANSWER;
            while let Some(said) = self.link.hear(until)? {
                if let Some(answer) = answer(said) {
                    return Ok(Some(answer));
                }
            }
        }
        Ok(None)
    }

    fn read_block(&mut self, what: Ask<'_>) -> Result<Result<Stored, BlockError>> {
        let heard = self.ask(what, 4 * ANSWER, |said| match said {
            Said::Block(block) if block.bytes().is_empty() => Some(Err(BlockError::Empty)),
            Said::Block(block) => {
                Some(Settings::from_block(block.bytes()).map(|(sequence, settings)| Stored { sequence, settings }))
            }
            // there is none
            Said::Refused(_) => Some(Err(BlockError::Empty)),
            _ => None,
        })?;
        match heard {
            Some(block) => Ok(block),
            None => bail!("{}: the unit does not answer any more; nothing was changed", self.place()),
        }
    }

    /// The block it runs with.
    ///
    /// # Errors
    /// It does not answer.
    pub fn in_use(&mut self) -> Result<Result<Stored, BlockError>> {
        self.read_block(Ask::Read(Which::in_use(BlockKind::Settings)))
    }

    /// The block it will run with from its next start on.
    ///
    /// # Errors
    /// It does not answer.
    pub fn newest(&mut self) -> Result<Result<Stored, BlockError>> {
        self.read_block(Ask::Read(Which::newest(BlockKind::Settings)))
    }

    /// Writes settings and reads them back; the block's sequence.
    ///
    /// # Errors
    /// It refuses them, by the parameter's name; it falls silent; it says other ones afterwards.
    pub fn write(&mut self, settings: &Settings) -> Result<u32> {
        let sequence = self.send(&settings.to_block(0))?;
        let (place, stored) = (self.place().to_owned(), self.newest()?);
        // a unit keeps lanes and heights in blocks of their own
        let alone = Settings { lanes: &[], ground: &[], ..*settings };
        let same = stored.as_ref().is_ok_and(|stored| *stored == Stored { sequence, settings: alone });
        ensure!(same, "{place}: what reads back is not what was written: {stored:?}; {OLD}");
        Ok(sequence)
    }

    /// Sends a block until the unit says that it is written; its sequence.
    fn send(&mut self, block: &[u8]) -> Result<u32> {
        let (place, old) = (self.place().to_owned(), OLD);
        // the last part on a bus, the one that is missing on a serial line
        let last_part = u8::try_from(block.len() / 4 - 1).unwrap_or(u8::MAX);
        let mut missing = None;
        self.link.ask(Ask::Write(block))?;
        let (begun, mut lost) = (Instant::now(), 0);
        let sequence = loop {
            let until = (begun + WRITING).min(Instant::now() + 4 * AGAIN);
            match self.link.hear(until)? {
                Some(Said::Written(sequence)) => break sequence,
                Some(Said::Refused(refusal)) if refusal.reason == INCOMPLETE && lost < MOST_LOST => {
                    lost += 1;
                    // without its first part the beginning may be lost as well
                    let part = refusal.detail[0];
                    self.link.ask(if part == 0 { Ask::Write(block) } else { Ask::Again(block, part) })?;
                }
                Some(Said::Refused(refusal)) => bail!("{place}: the unit refuses the block: {}; {old}", why(&refusal)),
                Some(Said::Came(next)) => {
                    missing = Some(next);
                    self.link.ask(Ask::Part(block, next))?;
                }
                Some(Said::Started(_)) => {
                    bail!("{place}: the unit started anew while it was written: its power? {old}; try again")
                }
                Some(_) => {}
                // its end may be lost, or the answer; a unit that is writing answers nothing
                None if begun.elapsed() < WRITING => self.link.ask(match missing {
                    None if !self.link.is_bus() && block.len() > PART_LEN => Ask::Write(block),
                    None => Ask::Again(block, last_part),
                    Some(next) => Ask::Part(block, next),
                })?,
                None => bail!(
                    "{place}: the unit does not answer since the block was sent; {old} or the new one, whole: --read tells"
                ),
            }
        };
        Ok(sequence)
    }

    /// Starts it over, and waits until it says with which block: its slot and sequence.
    ///
    /// # Errors
    /// It does not come back.
    pub fn restart(&mut self) -> Result<Option<u32>> {
        // it comes back by the number in its newest block
        let sensor = self.newest()?.map_or(0, |stored| stored.settings.unit.sensor);
        self.link.ask(Ask::Restart)?;
        self.link.restarted(self.unit.is_bench)?;
        self.link.to(Some(sensor));
        let begun = Instant::now();
        while begun.elapsed() < WRITING {
            match self.link.hear(Instant::now() + 2 * AGAIN)? {
                Some(Said::Started(place)) => {
                    self.unit.sensor = sensor;
                    return Ok(place.map(|(_, sequence)| sequence));
                }
                Some(Said::Identified(unit)) if unit.chip == self.unit.chip => {
                    self.unit = unit;
                    return Ok(self.in_use()?.ok().map(|stored| stored.sequence));
                }
                Some(_) => {}
                // what it said first may be lost
                None => self.link.ask(Ask::Identify)?,
            }
        }
        bail!("{}: the unit does not say that it started; is it powered?", self.place())
    }

    /// Empties both slots of a kind.
    ///
    /// # Errors
    /// It does not answer.
    pub fn clear(&mut self, kind: BlockKind) -> Result<()> {
        let cleared = self.ask(Ask::Clear(kind), WRITING, |said| (said == Said::Cleared).then_some(()))?;
        ensure!(cleared.is_some(), "{}: the unit does not say that its slots are empty; --read tells", self.place());
        Ok(())
    }

    /// How long its frames take.
    ///
    /// # Errors
    /// It does not count that, or not on this line.
    pub fn timing(&mut self) -> Result<Took> {
        let place = self.place().to_owned();
        ensure!(!self.link.is_bus(), "{place}: a unit says on its serial line only how long frames take: --port PATH");
        let took =
            self.ask(Ask::Timing, 2 * ANSWER, |said| if let Said::Took(took) = said { Some(took) } else { None })?;
        took.with_context(|| format!("{place}: {} does not time its frames", self.unit.board()))
    }

    /// What it refuses before it is asked: settings that its grid cannot run with, a table of another unit.
    ///
    /// # Errors
    /// Names the parameter, or says what the table is of.
    pub fn check(&self, file: &UnitFile) -> Result<()> {
        let Some(grid) = Grid::of(self.unit.grid) else { return Ok(()) };
        let settings = grid.check.settings(&file.settings).err().map(|error| error.to_string());
        if let Some(error) = settings.or_else(|| grids::table_refused(file, self.unit.grid)) {
            let [ranges, azimuths] = self.unit.grid;
            bail!("{error} (on a grid of {ranges} x {azimuths}); nothing was sent");
        }
        Ok(())
    }
}

/// A refusal in words.
fn why(refusal: &Refusal) -> String {
    let (_, reason) = refusal.of_kind();
    let [a, b, ..] = refusal.detail;
    match reason {
        1 => "nothing of a block arrived".into(),
        2 => "it is cut off".into(),
        3 => {
            format!(
                "its layout {} is none this firmware reads; use the viewshed that is as old as the firmware",
                u16::from_be_bytes([a, b])
            )
        }
        4 => "its check sum does not hold".into(),
        5 => format!("{} is {}, which it cannot run with", refusal.parameter(), refusal.value()),
        INCOMPLETE => {
            format!("part {} never arrived, {MOST_LOST} times: too much is lost on this line", refusal.detail[0])
        }
        7 => "its firmware, or its memory, has no room for such blocks".into(),
        8 => "edges of the table do not rise".into(),
        9 => format!("the table falls with the grade, in azimuth {a}, range {b}"),
        10 => format!(
            "the table was fitted with another configuration; with these settings, lanes and heights it is {:08x}",
            u32::from_be_bytes(refusal.detail)
        ),
        12 => format!("the table was fitted on a grid of {a} x {b}"),
        other => format!("reason {other}"),
    }
}
