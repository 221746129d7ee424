//! Messages and maps that no sender of this recording sends.

use viewshed::fixed::bits::Bits;
use viewshed::fixed::time::Time;
use viewshed::map::azimuths::Narrow;
use viewshed::probability::Levels;
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::header::{Clock, Header};
use viewshed::wire::message::{Epoch, Message, Packet};
use viewshed::wire::scan_number::ScanNumber;
use viewshed_harness::bus::traffic::{Maps, Scan, W};

use crate::input::Bus;
use crate::random::Random;
use crate::sender::{Plan, SENSOR, Sent, on_bus};

/// Makes intact messages beside a sender's own.
pub struct Maker {
    pub bus: Bus,
    /// The sender beside which they are.
    pub sender: Plan,
    pub header: Header,
}

impl Maker {
    fn message(&self, at: u64, sensor: u8, number: u8, epoch: Epoch, own: &[u8], random: &mut Random) -> Option<Sent> {
        let packing = self.bus.medium().packing(false);
        let packet = Packet::new(packing, sensor, Message::from_number(number)?, epoch, own);
        let filled = viewshed::wire::frame::fd_length(packet.bytes().len()).filter(|_| self.bus == Bus::CanFd);
        let sent = on_bus(self.bus, &packet.protect(random.below(15) as u8, filled))?;
        Some(Sent { at, clock: false, ..sent })
    }

    /// An intact frame of another epoch.
    pub fn stray(&self, at: u64, random: &mut Random) -> Option<Sent> {
        let number = [0, 1, 2, 6][random.below(4) as usize];
        let mut own = bytes(6, random);
        if number == 0 {
            // a status as there are some
            own[0] &= 0x51;
        }
        let epoch = Epoch::new(self.sender.epoch.number() + 1 + random.below(15) as u8);
        self.message(at, SENSOR, number, epoch, &own, random)
    }

    /// A message that says nothing of the maps asked for.
    pub fn other(&self, at: u64, random: &mut Random) -> Option<Sent> {
        let any = Epoch::new(random.below(16) as u8);
        let length = if self.bus == Bus::Can { 6 } else { 6 + random.below(40) as usize };
        let mut own = bytes(length, random);
        match random.below(6) {
            // another sensor
            0 => self.message(at, SENSOR + 1, random.below(32) as u8, any, &own, random),
            // configuration and the installation's own, of any epoch
            1 | 2 => {
                let number = [4, 5, 24 + random.below(8) as u8][random.below(3) as usize];
                self.message(at, SENSOR, number, any, &own, random)
            }
            // planes that are not asked for
            3 => {
                own[0] = ScanNumber::at(Time::from_micros(at + self.sender.ahead - 20_000)).byte();
                self.message(at, SENSOR, 12 + random.below(12) as u8, self.sender.epoch, &own, random)
            }
            // a status page, a state and a reason of a later version
            4 => {
                own[0] = 0x65 + (random.below(9) as u8) * 16;
                self.message(at, SENSOR, 0, self.sender.epoch, &own, random)
            }
            // an identifier that is none of them
            _ => Some(Sent {
                at,
                id: (self.bus != Bus::Serial).then(|| {
                    let low = random.below(0x400) as u16;
                    viewshed::wire::frame::CanId::standard(low)
                })?,
                data: bytes(8, random),
                clock: false,
            }),
        }
    }

    /// A refresh of the last three azimuths that no sender writes and every receiver reads: without known cells, edges where
    /// none is known, known cells of which none is visible.
    pub fn edges_of_nothing(&self, at: u64, random: &mut Random) -> Vec<Sent> {
        let scan = ScanNumber::at(Time::from_micros(at + self.sender.ahead)).byte();
        let first = self.header.azimuths.saturating_sub(3);
        let messages: Vec<(u8, Vec<u8>)> = if self.bus == Bus::Can {
            let own = |word: u64| [&[scan, first << 1 | (word >> 32) as u8], &(word as u32).to_be_bytes()[..]].concat();
            [(6, EDGES_OF_NOTHING_CLASSIC[0]), (8, EDGES_OF_NOTHING_CLASSIC[1]), (9, EDGES_OF_NOTHING_CLASSIC[2])]
                .map(|(number, word)| (number, own(word)))
                .to_vec()
        } else {
            vec![(6, [&[scan, first], &EDGES_OF_NOTHING_LONG.map(u32::to_be_bytes).concat()[..]].concat())]
        };
        let sent = messages
            .into_iter()
            .filter_map(|(number, own)| self.message(at, SENSOR, number, self.sender.epoch, &own, random));
        sent.collect()
    }

    /// A header of the sender's epoch with something wrong.
    pub fn header(&self, at: u64, random: &mut Random) -> Option<Sent> {
        let clock = Clock { time_ms: (at + self.sender.ahead) / 1000, synchronised: false };
        let header = Header { planes: 1, ..self.header };
        let group = 1 + random.below(6) as u8;
        let mut own = match self.bus {
            Bus::Can => header.emit_group(&clock, group).to_vec(),
            Bus::CanFd | Bus::Serial => {
                let (own, length) = header.emit(&clock);
                own[..length].to_vec()
            }
        };
        match random.below(6) {
            // another wire version, seldom, as it blanks
            0 => own[0] ^= 1 + random.below(15) as u8,
            // the check of group 6
            1 => *own.last_mut()? ^= 1 + random.below(255) as u8,
            // a group of a later version
            2 if self.bus == Bus::Can => own[0] |= 0x70,
            3 if self.bus != Bus::Can => own.truncate(6 + random.below(30) as usize),
            // contradicts
            _ => {
                let at = 1 + random.below(own.len() as u64 - 1) as usize;
                own[at] ^= 1 << random.below(8);
            }
        }
        self.message(at, SENSOR, 1, self.sender.epoch, &own, random)
    }
}

/// The words of that block: `known` with near 1 and end 0 in plain bits; `edges`; `known` with near 10 and end 30 in plain
/// bits, first otherwise, no edge. A receiver that reads edges of the second azimuth reads something else of the third.
const EDGES_OF_NOTHING_CLASSIC: [u64; 3] = [0x1_EAF8_1921, 0x1_50A8_9D09, 0x0_5360_0000];
const EDGES_OF_NOTHING_LONG: [u32; 3] = [0xF57C_0C90, 0x542A_2741, 0x8A6C_0000];

fn bytes(count: usize, random: &mut Random) -> Vec<u8> {
    (0..count).map(|_| random.below(256) as u8).collect()
}

/// Maps with noise, limits that change, and azimuths without known cells; their geometry is the given maps'.
pub fn maps(like: &Maps, random: &mut Random) -> Maps {
    let ranges = usize::from(like.header.ranges);
    let azimuths = usize::from(like.header.azimuths);
    let mut rays = like.scans[random.below(like.scans.len() as u64) as usize].rays.clone();
    let mut scans = Vec::new();
    for scan in &like.scans[..240.min(like.scans.len())] {
        for _ in 0..3 {
            let azimuth = random.below(azimuths as u64) as usize;
            rays[azimuth] = ray(&rays[azimuth], ranges, random);
        }
        if random.chance(50) {
            // a wall passes
            let from = random.below(azimuths as u64) as usize;
            let wide = ray(&rays[from], ranges, random);
            rays[from..(from + 20).min(azimuths)].fill(wide);
        }
        scans.push(Scan { measured: scan.measured, rays: rays.clone(), probable: Vec::new(), state: scan.state });
    }
    Maps { estimator: like.estimator.clone(), header: like.header, scans, holes: 0 }
}

/// The same maps with a plane of probability, whose bits are those of a map some scans later.
pub fn with_probabilities(like: &Maps) -> Maps {
    let later = like.scans.iter().cycle().skip(5);
    let scan = |(scan, later): (&Scan, &Scan)| {
        let probable = scan.rays.iter().zip(&later.rays).map(|(ray, later)| Ray::new(ray.known, *later.bits()));
        Scan { probable: probable.collect(), ..scan.clone() }
    };
    let header = Header { probability: Levels::from_bytes([61, 178, 242, 0xAB, 0xCD]), ..like.header };
    let scans = like.scans.iter().zip(later).map(scan).collect();
    Maps { estimator: like.estimator.clone(), header, scans, holes: 0 }
}

/// The same maps as of azimuths of which the middle third is narrow.
pub fn with_narrow(like: Maps) -> Maps {
    let azimuths = like.header.azimuths;
    let narrow = Narrow::from_bytes([azimuths / 3, azimuths - azimuths / 3, 4], azimuths).unwrap_or(Narrow::NONE);
    Maps { header: Header { narrow, ..like.header }, ..like }
}

fn ray(before: &Ray<W>, ranges: usize, random: &mut Random) -> Ray<W> {
    let any = |random: &mut Random| random.below(ranges as u64 + 1) as usize;
    let known = match random.below(8) {
        0 => Known::NONE,
        1 => Known::new(before.known.near() + 1, before.known.end()),
        2 => Known::new(before.known.near(), before.known.end().saturating_sub(1)),
        3 => Known::new(any(random) / 2, ranges),
        4 => Known::new(0, ranges),
        5 => Known::new(any(random), any(random)),
        _ => before.known,
    };
    let mut bits = *before.bits();
    match random.below(4) {
        // noise, which is sent in plain cells
        0 => bits = Bits::from_words(std::array::from_fn(|_| random.below(1 << 32) as u32)),
        1 => bits = Bits::span(0, any(random)),
        2 => bits = Bits::span(any(random), ranges),
        _ => {
            let (from, to) = (any(random), any(random));
            (from..to).for_each(|cell| bits.clear(cell));
        }
    }
    Ray::new(known, bits)
}
