//! A board's live program, emulated or real: a recording goes in scan by scan, and what it sends is compared
//! with the same program here.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use serde::Serialize;
use viewshed::fixed::time::Time;
use viewshed::map::Visibility;
use viewshed::unit::reply::Said;
use viewshed::unit::settings::Settings;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Message, Received};
use viewshed::wire::receive::{ReceivedMap, Receiver, ReceiverLimits};
use viewshed::wire::serial::Unstuffer;

use super::can::CanBoard;
use super::can_twin::{self, Step, flashed};
use super::check::{self, Difference};
use super::listener::SENSOR;
use super::live::{self, Script};
use super::machine::{Emulator, Folder, Lines};
use super::report::Cost;
use super::scans::Scan;
use super::serial::{Far, LINES, Port, Waiting};
use super::{Board, Profile, firmware};
use crate::configure;
use crate::configure::link::{Ask, Link};

/// Scans without an answer after which a board is taken for absent.
const MOST_SILENT: usize = 5;
/// Time a board is given for what is due after a scan.
const MOST_TIME: Duration = Duration::from_secs(3);
/// Azimuths and words of ranges there is room for.
const A: usize = 128;
const W: usize = 8;

/// What came over a bus or a line.
#[derive(Debug, Clone, PartialEq)]
enum Heard {
    Frame(CanFrame),
    Message(Vec<u8>),
}

/// What was sent here and there for a scan.
struct Turn {
    time: Time,
    host: Vec<Heard>,
    board: Vec<Heard>,
}

/// How it ended.
#[derive(Debug, Clone, Serialize)]
pub struct Live {
    pub recording: String,
    /// The board, or the port it is behind.
    pub board: String,
    pub profile: &'static str,
    pub scans: usize,
    /// Scans after which both sent the same and receivers of both have the same map.
    pub equal: usize,
    /// Messages of the board, and cells a receiver of it reports visible in the end.
    pub messages: usize,
    pub visible_cells: usize,
    /// Instructions a frame of the estimator, where the board counts them.
    pub instructions: Option<Cost>,
    /// What differs first.
    pub first_difference: Option<String>,
    #[serde(skip)]
    pub difference: Option<Difference>,
}

/// What a real board may say differently: it has a past, and a reset cause of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Past {
    None,
    Its,
}

/// Runs scans through the live program of an emulated board with serial lines.
///
/// # Errors
/// No firmware, no emulator, a board that does not answer.
pub fn serial(board: Board, profile: Profile, name: &str, settings: &Settings, scans: &[Scan]) -> Result<Live> {
    let image = firmware::build(board, profile, "live")?;
    let folder = Folder::new()?;
    let waiting = Waiting::new(&folder.0)?;
    let _emulator = Emulator::start(board, &image, &folder.0, Lines::Sockets(&LINES))?;
    let mut far = waiting.accept()?;
    let turns = exchange(&mut far, profile, settings, scans)?;
    let instructions = Cost::of(check::traced(&far.trace).into_iter());
    Ok(Live { instructions, ..judge(&turns, name, board.name(), profile, Past::None) })
}

/// Runs scans through a board behind a serial port.
///
/// # Errors
/// No port, a board that does not answer.
pub fn port(path: &Path, baud: u32, profile: Profile, name: &str, settings: &Settings, scans: &[Scan]) -> Result<Live> {
    let path = path.to_string_lossy();
    is_bench(&path, baud, profile)?;
    let mut far = Port::open(&path, baud)?;
    let turns = exchange(&mut far, profile, settings, scans)?;
    Ok(judge(&turns, name, &path, profile, Past::Its))
}

/// Asks what is behind a port before anything is sent to it.
fn is_bench(path: &str, baud: u32, profile: Profile) -> Result<()> {
    let mut link = configure::serial::open(path, Some(baud))?;
    // one question: an answer to a second would still be on the line when the scans go out
    link.to(None);
    link.ask(Ask::Identify)?;
    let until = Instant::now() + MOST_TIME;
    let unit = loop {
        match link.hear(until)? {
            Some(Said::Identified(unit)) => break unit,
            Some(_) => {}
            None => break configure::find(&mut link, configure::Wanted::default(), Duration::from_millis(100))?.unit,
        }
    };
    ensure!(
        unit.is_bench,
        "{path}: {} is no test bench: its image takes no scans on this line, but a radar's on its CAN bus. Nothing was written. \
         To compare a controller with this computer, flash a bench image (boards/README.md), or use --board for an emulated one",
        unit.board()
    );
    let [ranges, azimuths] = unit.grid;
    let its =
        Profile::ALL.into_iter().find(|profile| profile.grid() == unit.grid).map_or("none of these", Profile::name);
    ensure!(
        unit.grid == profile.grid(),
        "{path}: {} has the grid {ranges} x {azimuths}, which is --profile {}; nothing was written",
        unit.board(),
        its
    );
    Ok(())
}

/// Runs a script through the live program of an emulated board with a CAN bus.
///
/// # Errors
/// No firmware, no emulator, a board that takes no frames.
pub fn can(board: Board, name: &str, settings: &Settings, steps: &[Step]) -> Result<Live> {
    let image = firmware::build(board, Profile::Reference, "live")?;
    let mut settings = *settings;
    // everything is on the script's clock, from the first frame on
    settings.radar_bus.listen_first = false;
    let mut flash = flashed(&settings);
    let mut running = CanBoard::start(&image, &flash)?;
    let expected = can_twin::answer(&mut flash, steps);
    running.exchange(steps, &expected)?;
    let mut rest = running.answer.as_slice();
    let turns: Vec<Turn> = expected
        .iter()
        .map(|sent| {
            let (board, after) = rest.split_at(sent.frames.len().min(rest.len()));
            rest = after;
            let heard = |frames: &[CanFrame]| frames.iter().copied().map(Heard::Frame).collect();
            Turn { time: sent.time, host: heard(&sent.frames), board: heard(board) }
        })
        .collect();
    ensure!(rest.is_empty(), "the board sent {} frames too many", rest.len());
    Ok(judge(&turns, name, board.name(), Profile::Reference, Past::None))
}

/// Configures a board and sends scan after scan; the next when it has answered the one before.
fn exchange(far: &mut impl Far, profile: Profile, settings: &Settings, scans: &[Scan]) -> Result<Vec<Turn>> {
    let mut script = Script::default();
    script.configure(settings);
    let configured = script.bytes.len();
    let Some(first) = scans.first() else { bail!("the recording has no scans") };
    scans.iter().for_each(|scan| script.scan(scan, first.time));
    let expected = live::answer(profile, &script.bytes);
    let (mut host, mut board) = (Messages::default(), Messages::default());
    let (mut turns, mut from, mut silent) = (Vec::new(), 0, 0);
    // what both say before their restart may differ: a real board has a past, and was asked for its name
    far.send(&script.bytes[..configured])?;
    from += configured;
    started(far)?;
    // what is said at the start comes before the next byte is taken
    let said_before = [far.answer().len(), expected.lengths.get(configured).copied().unwrap_or(0)];
    for (to, time) in &script.marks {
        let before = far.answer().len();
        far.send(&script.bytes[from..*to])?;
        from = *to;
        let due = expected.lengths.get(to - 1).copied().unwrap_or(0);
        far.wait_for(said_before[0] + due.saturating_sub(said_before[1]), MOST_TIME)?;
        silent = if far.answer().len() > before || due == before { 0 } else { silent + 1 };
        ensure!(silent < MOST_SILENT, "the board has not answered {MOST_SILENT} scans");
        turns.push(Turn { time: *time, host: host.take(&expected.bytes[..due]), board: board.take(far.answer()) });
    }
    Ok(turns)
}

/// Waits until a board has started with its configuration, and has said what it says then.
fn started(far: &mut impl Far) -> Result<()> {
    let until = Instant::now() + MOST_TIME;
    let (mut messages, mut has_started) = (Messages::default(), false);
    while !has_started && Instant::now() < until {
        let before = far.answer().len();
        far.wait_for(before + 1, Duration::from_millis(50))?;
        has_started = messages.take(far.answer()).iter().any(|heard| match heard {
            Heard::Message(message) => matches!(Said::read(message, live::SENSOR), Some(Said::Started(Some(_)))),
            Heard::Frame(_) => false,
        });
    }
    // a bench has no clock of its own: then it is silent
    let mut before = 0;
    while far.answer().len() > before {
        before = far.answer().len();
        far.wait_for(before + 1, Duration::from_millis(200))?;
    }
    Ok(())
}

/// Takes the messages out of a growing stream.
#[derive(Default)]
struct Messages {
    unstuffer: Unstuffer,
    taken: usize,
}

impl Messages {
    fn take(&mut self, stream: &[u8]) -> Vec<Heard> {
        let mut messages = Vec::new();
        while self.taken < stream.len() {
            let (taken, message) = self.unstuffer.push(&stream[self.taken..]);
            self.taken += taken;
            messages.extend(message.map(|message| Heard::Message(message.to_vec())));
        }
        messages
    }
}

impl Heard {
    fn received(&self) -> Option<Received<'_>> {
        match self {
            Self::Frame(frame) => Received::from_frame(frame, &Addresses::STANDARD).ok(),
            Self::Message(message) => Received::from_bytes(message).ok(),
        }
    }

    /// What has to be the same of a board with a past: what it says of its maps.
    fn said(&self) -> Option<(Message, &[u8])> {
        let received = self.received().filter(|r| r.message != Message::Status)?;
        Some((received.message, received.own))
    }

    fn text(&self) -> String {
        match self {
            Self::Frame(frame) => format!("{frame:?}"),
            Self::Message(message) => message.iter().map(|byte| format!("{byte:02X}")).collect(),
        }
    }
}

struct Ear(Box<Receiver<1, A, W>>);

impl Ear {
    fn hear(&mut self, now: Time, heard: &[Heard]) {
        for one in heard {
            // what is refused leaves the map as it is
            match one {
                Heard::Frame(frame) => drop(self.0.frame(now, frame).is_ok()),
                Heard::Message(message) => drop(self.0.message(now, message).is_ok()),
            }
        }
    }

    fn map(&self, now: Time) -> ReceivedMap<'_, A, W, 1> {
        self.0.map(SENSOR, now)
    }
}

fn judge(turns: &[Turn], name: &str, board: &str, profile: Profile, past: Past) -> Live {
    let ear = || Ear(Box::new(Receiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT)));
    let [mut here, mut there] = [ear(), ear()];
    let mut live = Live {
        recording: name.to_owned(),
        board: board.to_owned(),
        profile: profile.name(),
        scans: turns.len(),
        equal: 0,
        messages: 0,
        visible_cells: 0,
        instructions: None,
        first_difference: None,
        difference: None,
    };
    for (k, turn) in turns.iter().enumerate() {
        here.hear(turn.time, &turn.host);
        there.hear(turn.time, &turn.board);
        live.messages += turn.board.len();
        let messages = first_message(turn, past);
        let maps = cells(k, &here.map(turn.time), &there.map(turn.time));
        if live.difference.is_none() && maps.as_ref().is_some_and(|maps| maps.host != maps.board) {
            live.difference.clone_from(&maps);
        }
        let differs = messages.or_else(|| {
            let maps = maps.as_ref().filter(|maps| maps.host != maps.board)?;
            Some(maps.text())
        });
        match differs {
            None => live.equal += 1,
            Some(what) => live.first_difference = live.first_difference.or(Some(what)),
        }
        live.visible_cells = maps.map_or(0, |maps| maps.board.iter().filter(|cell| cell[0] == u8::MAX).count());
    }
    live
}

/// The first message that is not the same.
fn first_message(turn: &Turn, past: Past) -> Option<String> {
    let differ = |host: &[&Heard], board: &[&Heard], same: &dyn Fn(&Heard, &Heard) -> bool| {
        let at = host.iter().zip(board).position(|(h, b)| !same(h, b));
        let at = at.or_else(|| (host.len() != board.len()).then(|| host.len().min(board.len())))?;
        let text = |heard: &[&Heard]| heard.get(at).map_or("nothing".into(), |one| one.text());
        Some(format!("message {at} after {} us: {} here, {} there", turn.time.micros(), text(host), text(board)))
    };
    let counts = |heard: &&Heard| past == Past::None || heard.said().is_some();
    let host: Vec<&Heard> = turn.host.iter().filter(counts).collect();
    let board: Vec<&Heard> = turn.board.iter().filter(counts).collect();
    match past {
        Past::None => differ(&host, &board, &|h, b| h == b),
        Past::Its => differ(&host, &board, &|h, b| h.said() == b.said()),
    }
}

/// Both maps cell by cell; `None` where neither has one.
fn cells(frame: usize, here: &ReceivedMap<'_, A, W, 1>, there: &ReceivedMap<'_, A, W, 1>) -> Option<Difference> {
    let header = here.header().or(there.header())?;
    let (azimuths, ranges) = (usize::from(header.azimuths), usize::from(header.ranges));
    let grades = |map: &ReceivedMap<'_, A, W, 1>| {
        let grade = |k: usize| match map.cell(k / ranges, k % ranges).visibility {
            Visibility::Unknown => 0,
            Visibility::Invisible => 1,
            Visibility::Visible => u8::MAX,
        };
        (0..azimuths * ranges).map(|k| [grade(k), 0]).collect()
    };
    Some(Difference::new(frame, ranges, &header.geometry(), grades(here), grades(there)))
}
