//! The daemon's loop: receive, process, encode, transmit, sign of life.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use log::{info, warn};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use viewshed::board::{BlockError, Flow, StoredSettings};
use viewshed::{PolarMap, Reason, Time, UnitState};

use super::Unit;
use super::input::{self, Input, Step, Work};
use super::size::supervised::{CHECK, Map, Parameters, State};
use super::size::{QuantisedSender as Sender, State as Radar3d};
use crate::config::{ClockSource, Config, Grid};
use crate::output::{Output, version};
use crate::state::{FileSlots, KeptEpoch};
use crate::systemd::Systemd;

/// Waits between two looks: while something is to be sent, and otherwise.
const BUSY: Duration = Duration::from_millis(1);
const CALM: Duration = Duration::from_millis(5);
/// A step of the clock while a log is read, microseconds.
const TICK_US: u64 = 1_000;
/// How long is said, at the end, that there is no map any more: a status is due every 250 ms.
const FAREWELL_TICKS: u64 = 300;

/// Works until it is stopped, or to the end of a log.
///
/// # Errors
/// What cannot be retried: a log, a folder, settings.
pub fn run(config: &Config, stop: &AtomicBool) -> Result<()> {
    let folder = config.state_dir.as_deref();
    // if it cannot be made, what is written there says so
    let _ = folder.map(std::fs::create_dir_all);
    let settings = config.settings();
    let mut slots = FileSlots::open(folder, settings.as_ref());
    let stored = StoredSettings::read(&slots, CHECK);
    let of_line = |stored: &StoredSettings| stored.settings().map(|s| config.of_place(*s));
    if config.has_service() && settings.is_some() && of_line(&stored).is_some_and(|s| Some(s) != settings) {
        warn!("a configuration block written over the line goes before the file's mount, field of view and figures");
    }
    if let Some(unused) = config.unused() {
        warn!("{unused}");
    }
    let mut input = input::open(config)?;
    let mut output = Output::new(config)?;
    let mut state = Box::new(State::new(Radar3d::new()));
    let mut map: Box<Map> = Box::new(PolarMap::NOWHERE);
    let mut clock = Clock::new(config, input.begins());
    let mut systemd = Systemd::new();
    let mut kept = KeptEpoch::new(folder);
    loop {
        let epoch = kept.next();
        output.keep_up(clock.now(), &mut slots);
        let stored = StoredSettings::read(&slots, CHECK);
        input.start(epoch, stored, &mut output);
        // where blocks are taken the newest that can run, else what the file says
        let settings = if config.has_service() { of_line(&stored) } else { config.settings() };
        let none = stored.position().err().map(|refused| refused.error).filter(|_| settings.is_none());
        // a block that could run by itself, and not with what the file alone says of the place
        let misfit = settings.as_ref().and_then(|s| CHECK.settings(s).err()).map(BlockError::Parameter);
        let (settings, refused) = (settings.filter(|_| misfit.is_none()), none.or(misfit));
        if let Some(reason) = &refused {
            warn!("{reason}: safe state until a block is written");
        }
        let (mut parameters, mut sender, mut no_table) = (None::<Parameters>, None, None);
        if let Some(settings) = &settings {
            let medium = config.medium().context("output.base_id is no identifier")?;
            // what does not build was refused above
            let header = settings.build::<State>(&mut parameters).map_err(|e| anyhow!("{e}"))?;
            let now = input.now(clock.now());
            let given = config.probability.as_ref().map(|given| given.read(config.grid == Grid::Reference, settings));
            let quantiser = match given.transpose() {
                Ok(table) => table.zip(parameters.as_ref()).map(|(table, (p, _))| {
                    info!("{}", table.said());
                    table.quantiser(p.visible_from())
                }),
                Err(e) => {
                    warn!("{e:#}: maps are by grades");
                    no_table = Some(format!("{e:#}"));
                    None
                }
            };
            let new =
                Sender::new(config.broadcast(medium), header, quantiser, epoch, now).map_err(|e| anyhow!("{e}"))?;
            sender = Some(Box::new(new));
        }
        let mut unit =
            parameters.as_ref().zip(sender.as_mut()).map(|(p, s)| Unit::new(p, &mut *state, &mut *map, &mut **s));
        if let Some(unit) = &mut unit {
            unit.broadcast().status_mut().firmware = version();
            if no_table.is_some() {
                unit.lacks(Reason::NoProbabilities);
            }
        }
        output.start(config, epoch, input.now(clock.now()), stored);
        info!("started, epoch {}", epoch.number());
        systemd.ready();
        let mut watch = Watch { refused, no_table, ..Watch::default() };
        let last = loop {
            if stop.load(Ordering::Relaxed) {
                info!("stopping");
                break Step::End;
            }
            wait(input.as_ref(), &clock, output.is_busy() || unit.as_mut().is_some_and(|u| !u.broadcast().idle()));
            let now = clock.next();
            if output.keep_up(now, &mut slots) == Flow::Restart {
                break Step::Restart;
            }
            let (began, offered) = (Instant::now(), unit.as_ref().and_then(Unit::offered));
            let step = input.step(now, &mut Work { unit: &mut unit, slots: &mut slots, output: &mut output });
            if let Some(unit) = &mut unit {
                kept.follow(unit.broadcast().epoch());
            }
            let Step::Now(now) = step else { break step };
            if let Some(unit) = &mut unit {
                if unit.offered() != offered && config.input.clock == ClockSource::System {
                    unit.took(now, began.elapsed().as_micros() as u64);
                }
                output.send(now, unit, input.line());
            }
            output.answer(now, unit.is_none(), &slots);
            if watch.look(unit.as_mut(), &output) {
                systemd.frame_done();
            }
            systemd.status(|| watch.text(&output));
        };
        if last == Step::Restart {
            info!("restart with the newest configuration block");
            continue;
        }
        systemd.stopping();
        if let Some(unit) = &mut unit {
            farewell(unit, input.as_mut(), &mut output, &mut slots, &mut clock);
        }
        info!("{}", watch.text(&output));
        return output.finish();
    }
}

/// Maps that say unknown, and a status that says that there is none.
fn farewell(unit: &mut Unit<'_>, input: &mut dyn Input, output: &mut Output, slots: &mut FileSlots, clock: &mut Clock) {
    unit.reset();
    let start = input.now(clock.next());
    // by steps: a machine that is slow at its end says the same
    for step in 1..=FAREWELL_TICKS {
        if !clock.is_steps() {
            std::thread::sleep(BUSY);
        }
        output.keep_up(clock.next(), slots);
        let now = Time::from_micros(start.micros() + step * TICK_US);
        unit.idle(now);
        output.send(now, unit, input.line());
    }
}

/// Until something comes, or it is time to look again.
fn wait(input: &dyn Input, clock: &Clock, busy: bool) {
    if clock.is_steps() {
        return;
    }
    let timeout = Timespec::try_from(if busy { BUSY } else { CALM }).unwrap_or(Timespec { tv_sec: 0, tv_nsec: 0 });
    let fd = input.fd();
    let mut fds: Vec<PollFd<'_>> = fd.iter().map(|fd| PollFd::new(fd, PollFlags::IN)).collect();
    // a signal ends it early, and is seen by the loop
    let _ = poll(&mut fds, Some(&timeout));
}

/// The unit's time where the input has none of its own.
struct Clock {
    steps: bool,
    base: Time,
    started: Instant,
    ticks: u64,
}

impl Clock {
    fn new(config: &Config, base: Time) -> Self {
        let steps = config.input.clock == ClockSource::Input && config.input.candump.is_some();
        Self { steps, base, started: Instant::now(), ticks: 0 }
    }

    fn is_steps(&self) -> bool {
        self.steps
    }

    fn now(&self) -> Time {
        let past = if self.steps { self.ticks * TICK_US } else { self.started.elapsed().as_micros() as u64 };
        Time::from_micros(self.base.micros() + past)
    }

    /// Goes on: by itself, or by a step.
    fn next(&mut self) -> Time {
        self.ticks += u64::from(self.steps);
        self.now()
    }
}

/// Looks at what the unit does.
#[derive(Default)]
struct Watch {
    offered: Option<Time>,
    maps: u64,
    /// Messages of the safe state.
    said: u64,
    shown: Option<(UnitState, Reason)>,
    /// What is wrong with the radar, as it was said last.
    found: Option<Reason>,
    /// Why there is no unit.
    refused: Option<BlockError>,
    /// Why the table of probabilities that is given is not used.
    no_table: Option<String>,
}

impl Watch {
    /// Whether a frame was completed since the last look: estimated, and its map given to the sender. In the
    /// safe state, whether that was sent.
    fn look(&mut self, unit: Option<&mut Unit<'_>>, output: &Output) -> bool {
        let Some(unit) = unit else {
            let said = output.sent + output.refused;
            return std::mem::replace(&mut self.said, said) != said;
        };
        let status = unit.broadcast().status_mut();
        let shown = (status.state, status.reason);
        // what one frame does not say the next does: only states are worth a line, and what is wrong for long
        let lasts = matches!(shown.1, Reason::SectorBlind | Reason::Misaligned | Reason::Weaker | Reason::Settling);
        let found = lasts && self.found.replace(shown.1) != Some(shown.1);
        if shown.0 == UnitState::Ok {
            self.found = None;
        }
        if found || self.shown.is_none_or(|before| before.0 != shown.0) {
            let reason = if shown.1 == Reason::None { String::new() } else { format!(": {:?}", shown.1) };
            match shown.0 {
                UnitState::Starting | UnitState::Ok => info!("radar {:?}{reason}", shown.0),
                _ => warn!("radar {:?}{reason}", shown.0),
            }
        }
        self.shown = Some(shown);
        let done = unit.offered() != self.offered;
        self.offered = unit.offered();
        self.maps += u64::from(done);
        done
    }

    fn text(&self, output: &Output) -> String {
        let state = match (&self.refused, self.shown) {
            (Some(reason), _) => format!("safe state: {reason}"),
            (None, shown) => format!("radar {:?}", shown.map_or(UnitState::Starting, |(state, _)| state)),
        };
        let table = self.no_table.as_ref().map_or(String::new(), |why| format!("; maps are by grades: {why}"));
        format!("{state}; {} maps, {} messages sent, {} refused{table}", self.maps, output.sent, output.refused)
    }
}
