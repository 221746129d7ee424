//! A run: senders, a bus with one fault, and what a receiver is fed of it.

use std::fmt::Write as _;

use anyhow::{Result, bail};
use viewshed::wire::header::Header;
use viewshed::wire::message::Epoch;
use viewshed_harness::bus::traffic::Maps;

use crate::class::Class;
use crate::input::{Bus, Input};
use crate::made_up::{self, Maker};
use crate::random::Random;
use crate::sender::{Life, Mailboxes, Plan, SCAN_US, SENSOR, Sent, send};

/// Microseconds in a millisecond.
const MS: u64 = 1000;
const S: u64 = 1_000_000;

/// True time at which a receiver starts.
pub const START: u64 = 20 * S;

/// After this a frame of a backlog follows the one before, microseconds.
fn drain_us(bus: Bus) -> u64 {
    if bus == Bus::Can { MS } else { 12 * MS }
}

/// When looks are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Looks {
    /// Every 20 to 50 ms.
    Often,
    /// Every 100 ms.
    Log,
}

/// A run.
pub struct World {
    /// What the maps are of, where they are not the recording's.
    pub made_up: Option<Maps>,
    pub lives: Vec<Life>,
    /// True time, and what the receiver is fed then.
    pub inputs: Vec<(u64, Input)>,
    /// From these moments on a map is to be shown again: a queue is drained and a header has come since.
    pub drained: Vec<u64>,
    /// After this moment what is shown may be wrong: a delay has stayed for so long that it is taken for none, or two
    /// senders speak as one.
    pub strict_to: u64,
}

/// The receiver's clock.
struct Clock {
    ahead: u64,
    /// Millionths it is fast, and a million.
    rate: u64,
    /// At a true time forward by this much, microseconds.
    jumps: Vec<(u64, i64)>,
}

impl Clock {
    fn read(&self, at: u64) -> u64 {
        let jumped: i64 = self.jumps.iter().filter(|(when, _)| *when <= at).map(|(_, by)| by).sum();
        (self.ahead + at * self.rate / 1_000_000).saturating_add_signed(jumped)
    }
}

struct Faults {
    random: Random,
    bus: Bus,
    /// What the first sender does, and of what its maps are.
    sender: Plan,
    header: Header,
    end: u64,
    strict_to: u64,
    drained: Vec<u64>,
    jumps: Vec<(u64, i64)>,
    starts: Vec<u64>,
}

impl World {
    /// A run of a class over a bus. The same seed makes the same run.
    ///
    /// # Errors
    /// Maps the library's sender refuses.
    pub fn new(maps: &Maps, bus: Bus, class: Class, seed: u64, length_us: u64, looks: Looks) -> Result<Self> {
        let mut random = Random::new(seed << 16 | (class as u64) << 8 | bus as u64);
        let end = START + length_us;
        let (mut sent, mut lives) = (Vec::new(), Vec::new());
        let plans = plans(class, &mut random, end);
        let made_up = match class {
            Class::MadeUpMaps => Some(made_up::maps(maps, &mut random)),
            Class::Probabilities => Some(made_up::with_probabilities(maps)),
            Class::NarrowAzimuths => Some(made_up::with_narrow(made_up::with_probabilities(maps))),
            _ => None,
        };
        let maps = made_up.as_ref().unwrap_or(maps);
        for plan in &plans {
            let (more, life) = send(maps, bus, plan)?;
            sent.extend(more);
            lives.push(life);
        }
        sent.sort_by_key(|one| one.at);
        let [sender, ..] = plans[..] else { bail!("nobody sends") };
        // whose words are whose no receiver can see
        let strict_to = match plans[..] {
            [_, second] if class == Class::SynchronisedSenders => second.from,
            _ => u64::MAX,
        };
        let mut faults = Faults {
            random,
            bus,
            sender,
            header: maps.header,
            end,
            strict_to,
            drained: Vec::new(),
            jumps: Vec::new(),
            starts: vec![START],
        };
        let mut sent = faults.apply(class, sent);
        // those of one moment stay in the order they were sent in
        sent.sort_by_key(|one| one.at);
        let Faults { mut random, drained, jumps, starts, strict_to, .. } = faults;
        let clock = Clock { ahead: random.between(100 * S, 200 * S), rate: 999_800 + 200 * random.below(3), jumps };
        let mut inputs: Vec<(u64, u8, Input)> =
            starts.into_iter().map(|at| (at, 0, Input::Start { bus, sensor: SENSOR })).collect();
        for one in sent.into_iter().filter(|one| (START..end).contains(&one.at)) {
            received(one, &clock, &mut random, &mut inputs);
        }
        let mut at = START;
        while at < end {
            inputs.push((at, 2, Input::Look { time: clock.read(at) }));
            if matches!(class, Class::Probabilities | Class::NarrowAzimuths) {
                inputs.push((at, 2, Input::Probability { time: clock.read(at) }));
            }
            at += if looks == Looks::Log { 100 * MS } else { random.between(20 * MS, 50 * MS) };
        }
        inputs.sort_by_key(|(at, order, _)| (*at, *order));
        let inputs = inputs.into_iter().map(|(at, _, input)| (at, input)).collect();
        Ok(Self { made_up, lives, inputs, drained, strict_to })
    }

    /// At the end another look, so much before the last time by the receiver's clock.
    pub fn look_again(&mut self, back_us: u64) {
        let last = self.inputs.last().and_then(|(at, input)| Some((*at, input.time()?)));
        if let Some((at, time)) = last {
            self.inputs.push((at, Input::Look { time: time.saturating_sub(back_us) }));
        }
    }

    /// The lines that are fed to a receiver.
    pub fn lines(&self) -> impl Iterator<Item = &Input> {
        self.inputs.iter().map(|(_, input)| input)
    }

    /// The lines of the first so many microseconds as text.
    pub fn text(&self, length_us: u64) -> String {
        let lines = self.inputs.iter().take_while(|(at, _)| *at < START + length_us).map(|(_, input)| input);
        lines.fold(String::new(), |mut text, input| {
            let _ = writeln!(text, "{input}");
            text
        })
    }

    /// The same with every look asking for cells.
    #[must_use]
    pub fn asking_for_cells(mut self) -> Self {
        for (_, input) in &mut self.inputs {
            if let Input::Look { time } = *input {
                *input = Input::Cells { time };
            }
        }
        self
    }
}

fn received(one: Sent, clock: &Clock, random: &mut Random, inputs: &mut Vec<(u64, u8, Input)>) {
    let time = clock.read(one.at);
    let Some(id) = one.id else {
        // a line is read in pieces
        let mut rest = &one.data[..];
        while !rest.is_empty() {
            let (piece, more) = rest.split_at((1 + random.below(40) as usize).min(rest.len()));
            inputs.push((one.at, 1, Input::Bytes { time, data: piece.to_vec() }));
            rest = more;
        }
        return;
    };
    inputs.push((one.at, 1, Input::Frame { time, id, data: one.data }));
}

/// What senders do.
fn plans(class: Class, random: &mut Random, end: u64) -> Vec<Plan> {
    let mailboxes = match class {
        Class::Mailboxes => Some(Mailboxes { count: 64, frame_us: MS }),
        Class::MailboxesFull => Some(Mailboxes { count: 16, frame_us: 1750 }),
        _ => None,
    };
    // a receiver that starts into a backlog finds a sender that was there before
    let from = if class == Class::DrainAtStart { START - 5 * S } else { START };
    let mut plan = Plan {
        from,
        to: end,
        epoch: Epoch::new(random.below(16) as u8),
        ahead: random.below(100 * S),
        first_map: random.below(400) as usize,
        mailboxes,
        // where words are lost, too: one that is taken for a word that is missing shows
        visible_range: matches!(
            class,
            Class::Others | Class::Loss1 | Class::Loss5 | Class::Loss20 | Class::Probabilities | Class::NarrowAzimuths
        ),
    };
    let mut all = Vec::new();
    if class == Class::SenderRestarts {
        while plan.from < end {
            let to = plan.from + random.between(3 * S, 8 * S);
            all.push(Plan { to: to.min(end), ..plan });
            let down = if random.chance(500) { random.below(SCAN_US) } else { random.below(3 * S) };
            plan = Plan { from: to + down, epoch: plan.epoch.next(), ahead: random.below(100 * S), ..plan };
            plan.first_map += 40;
        }
        return all;
    }
    all.push(plan);
    if class == Class::TwoSenders {
        let from = START + random.between(3 * S, 6 * S);
        let to = (from + random.between(3 * S, 10 * S)).min(end);
        let epoch = Epoch::new(plan.epoch.number() + 1 + random.below(15) as u8);
        all.push(Plan { from, to, epoch, ahead: random.below(100 * S), first_map: plan.first_map + 200, ..plan });
    }
    if class == Class::SynchronisedSenders {
        // whole scans after the first, so that its scans have the same numbers
        let from = START + SCAN_US * (random.between(3 * S, 6 * S) / SCAN_US);
        let to = (from + random.between(4 * S, 8 * S)).min(end);
        all.push(Plan { from, to, first_map: plan.first_map + 200, ..plan });
    }
    all
}

impl Faults {
    fn apply(&mut self, class: Class, sent: Vec<Sent>) -> Vec<Sent> {
        match class {
            Class::Lossless
            | Class::SenderRestarts
            | Class::TwoSenders
            | Class::SynchronisedSenders
            | Class::Mailboxes
            | Class::MailboxesFull => sent,
            Class::MadeUpMaps => self.add(sent, S, 3 * S, Maker::edges_of_nothing),
            Class::Loss1 => self.lose(sent, 10),
            Class::Loss5 | Class::Probabilities | Class::NarrowAzimuths => self.lose(sent, 50),
            Class::Loss20 => self.lose(sent, 200),
            Class::Reordered => self.delay(sent, 1000, 100 * MS),
            Class::Jitter => self.delay(sent, 1000, 50 * MS),
            Class::Late1 => self.delay(sent, 10, 3 * S),
            Class::Repeated20 => self.repeat(sent, 200),
            Class::LateAndRepeated => {
                // not one of the other: 5.12 s together would be no delay at all
                let again = sent.len();
                let mut sent = self.repeat(sent, 50);
                let again = sent.split_off(again);
                let mut sent = self.delay(sent, 50, 3 * S);
                sent.extend(again);
                sent
            }
            Class::DrainAtStart => {
                let backlog = self.random.between(S, 5 * S / 2);
                let sent = sent.into_iter().filter(|one| one.at > START - backlog).collect();
                self.drain(sent, START - backlog, START)
            }
            Class::DrainAfterStall => {
                let mut sent = sent;
                let mut from = START + self.random.between(3 * S, 4 * S);
                while from < self.end {
                    let to = from + self.random.between(2600 * MS, 3 * S);
                    sent = self.drain(sent, from, to);
                    from += self.random.between(12 * S, 16 * S);
                }
                sent
            }
            Class::Cuts => {
                let mut sent = sent;
                let mut from = START + self.random.between(2 * S, 4 * S);
                while from < self.end {
                    let most = if self.random.chance(500) { 600 * MS } else { 6 * S };
                    let to = from + self.random.between(50 * MS, most);
                    sent.retain(|one| !(from..to).contains(&one.at));
                    from = to + self.random.between(S, 4 * S);
                }
                sent
            }
            Class::ReceiverRestarts => {
                let mut at = START + self.random.between(2 * S, 5 * S);
                while at < self.end {
                    self.starts.push(at);
                    at += self.random.between(2 * S, 6 * S);
                }
                sent
            }
            Class::Flips => self.flip(sent),
            Class::Strays => self.add(sent, 450 * MS, 3 * S, Maker::stray),
            Class::Others => self.add(sent, 20 * MS, 120 * MS, Maker::other),
            Class::HeaderFaults => self.add(sent, 500 * MS, 7 * S, Maker::header),
            Class::ClockJumps => self.jump(sent),
            Class::Echo => self.echo(sent),
            Class::DelayPasses => {
                let from = START + self.random.between(3 * S, 4 * S);
                let to = from + self.random.between(500 * MS, 5 * S);
                let by = self.random.between(150 * MS, 4900 * MS);
                let late =
                    |one: Sent| Sent { at: if (from..to).contains(&one.at) { one.at + by } else { one.at }, ..one };
                sent.into_iter().map(late).collect()
            }
            Class::DelayStays => {
                let from = START + self.random.between(3 * S, 4 * S);
                let by = self.random.between(150 * MS, 4900 * MS);
                self.strict_to = from + by + 5120 * MS;
                let late = |one: Sent| Sent { at: if one.at < from { one.at } else { one.at + by }, ..one };
                sent.into_iter().map(late).collect()
            }
        }
    }

    fn lose(&mut self, mut sent: Vec<Sent>, parts_in_1000: u64) -> Vec<Sent> {
        sent.retain(|_| !self.random.chance(parts_in_1000));
        sent
    }

    fn delay(&mut self, mut sent: Vec<Sent>, parts_in_1000: u64, most_us: u64) -> Vec<Sent> {
        for one in &mut sent {
            if self.random.chance(parts_in_1000) {
                one.at += self.random.below(most_us);
            }
        }
        sent
    }

    fn repeat(&mut self, mut sent: Vec<Sent>, parts_in_1000: u64) -> Vec<Sent> {
        for i in 0..sent.len() {
            if self.random.chance(parts_in_1000) {
                let again = Sent { at: sent[i].at + self.random.below(3 * S), ..sent[i].clone() };
                sent.push(again);
            }
        }
        sent
    }

    /// What comes from `from` on waits until `to`, and goes on in order, as fast as the queue drains.
    fn drain(&mut self, mut sent: Vec<Sent>, from: u64, to: u64) -> Vec<Sent> {
        let step = drain_us(self.bus);
        let (mut last, mut empty) = (to - step, false);
        for one in sent.iter_mut().filter(|one| one.at >= from) {
            empty |= one.at >= last + step;
            if empty && one.clock {
                self.drained.push(one.at);
                break;
            }
            if !empty {
                one.at = last + step;
                last = one.at;
            }
        }
        sent
    }

    fn flip(&mut self, mut sent: Vec<Sent>) -> Vec<Sent> {
        for one in &mut sent {
            if self.random.chance(3) {
                let keep = self.random.below(one.data.len() as u64) as usize;
                // CAN FD has no length between these
                let keep =
                    [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].into_iter().rev().find(|n| *n <= keep);
                one.data.truncate(keep.unwrap_or(0));
            } else if self.random.chance(20) && !one.data.is_empty() {
                let bit = self.random.below(8 * one.data.len() as u64) as usize;
                one.data[bit / 8] ^= 1 << (bit % 8);
            }
        }
        sent
    }

    /// Messages that are made up, one after another with these times between them.
    fn add<Made: IntoIterator<Item = Sent>>(
        &mut self,
        mut sent: Vec<Sent>,
        least_us: u64,
        most_us: u64,
        make: fn(&Maker, u64, &mut Random) -> Made,
    ) -> Vec<Sent> {
        let maker = Maker { bus: self.bus, sender: self.sender, header: self.header };
        let mut at = START + self.random.below(2 * S);
        while at < self.end {
            sent.extend(make(&maker, at, &mut self.random));
            at += self.random.between(least_us, most_us);
        }
        sent
    }

    /// Clocks jump, by anything but whole periods of the scan numbers, which no receiver can notice.
    fn jump(&mut self, mut sent: Vec<Sent>) -> Vec<Sent> {
        let mut at = START + self.random.between(2 * S, 4 * S);
        while at < self.end {
            let by = match self.random.below(4) {
                0 => self.random.between(MS, 100 * MS),
                1 => self.random.between(100 * MS, 2500 * MS),
                2 => self.random.between(2500 * MS, 4900 * MS),
                _ => self.random.between(5340 * MS, 10_000 * MS),
            };
            let by = by as i64 * if self.random.chance(500) { 1 } else { -1 };
            self.jumps.push((at, by));
            if self.random.chance(500) {
                // in a silence
                let before = self.random.below(300 * MS);
                let after = self.random.between(100 * MS, 2 * S);
                sent.retain(|one| !(at - before..at + after).contains(&one.at));
            }
            at += self.random.between(3 * S, 7 * S);
        }
        sent
    }

    fn echo(&mut self, mut sent: Vec<Sent>) -> Vec<Sent> {
        let from = START + self.random.between(2 * S, 4 * S);
        let to = from + self.random.between(4 * S, 10 * S);
        let by = self.random.between(2600 * MS, 4900 * MS);
        let again = |one: &Sent| Sent { at: one.at + by, ..one.clone() };
        let again: Vec<Sent> = sent.iter().filter(|one| (from..to).contains(&one.at)).map(again).collect();
        sent.extend(again);
        sent
    }
}
