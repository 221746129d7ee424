//! The library's receiver, fed and answering as `README.md` says.

use std::fmt::Write as _;

use flate2::Crc;
use viewshed::fixed::time::Time;
use viewshed::wire::code::ray::Ray;
use viewshed::wire::message::{Addresses, Plane};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::Unstuffer;

use crate::input::{Bus, Input};

/// Most azimuths, and words of 32 ranges, of any map.
pub const A: usize = 128;
pub const W: usize = 8;

/// Visible cells, azimuth by azimuth, a bit each.
pub type Visible = Vec<[u32; W]>;

/// A receiver and what it listens to.
pub struct Library {
    bus: Bus,
    sensor: u8,
    receiver: Box<Receiver<1, A, W, 2>>,
    line: Unstuffer,
}

impl Default for Library {
    fn default() -> Self {
        Self::new(Bus::Can, 0)
    }
}

impl Library {
    pub fn new(bus: Bus, sensor: u8) -> Self {
        let receiver = Box::new(Receiver::new([sensor], Addresses::STANDARD, ReceiverLimits::DEFAULT));
        Self { bus, sensor, receiver, line: Unstuffer::new() }
    }

    /// Takes a line; the answer if it is a question.
    pub fn take(&mut self, input: &Input) -> Option<String> {
        match input {
            Input::Start { bus, sensor } => *self = Self::new(*bus, *sensor),
            Input::Frame { time, .. } => {
                if let Some(frame) = input.frame(self.bus) {
                    // what is refused changes nothing
                    let _ = self.receiver.frame(Time::from_micros(*time), &frame);
                }
            }
            Input::Bytes { time, data } => self.bytes(Time::from_micros(*time), data),
            Input::Look { time } => return Some(self.look(*time)),
            Input::Cells { time } => return Some(self.cells(*time)),
            Input::Probability { time } => return Some(self.probability(*time)),
        }
        None
    }

    fn bytes(&mut self, now: Time, mut data: &[u8]) {
        while !data.is_empty() {
            let (taken, message) = self.line.push(data);
            if let Some(message) = message {
                let _ = self.receiver.message(now, message);
            }
            data = &data[taken..];
        }
    }

    /// Ranges and rays; none where nothing is shown.
    fn rays(&self, time: u64) -> (usize, Vec<Ray<W>>) {
        let map = self.receiver.map(self.sensor, Time::from_micros(time));
        let Some(header) = map.header() else { return (0, Vec::new()) };
        let rays = (0..usize::from(header.azimuths)).map(|azimuth| map.ray(Plane::Visibility, azimuth));
        (usize::from(header.ranges), rays.collect())
    }

    /// What is visible at a time.
    pub fn visible(&self, time: u64) -> Visible {
        self.rays(time).1.iter().map(|ray| *ray.bits().words()).collect()
    }

    fn look(&self, time: u64) -> String {
        let (ranges, rays) = self.rays(time);
        let (mut crc, mut visible, mut invisible) = (Crc::new(), 0, 0);
        let mut row = vec![0; ranges];
        for ray in &rays {
            // thousands of cells a look, and a thousand looks a run: eight at a time
            let bytes = ray.bits().words().iter().flat_map(|word| word.to_le_bytes());
            for (cells, byte) in row.chunks_mut(8).zip(bytes) {
                cells.copy_from_slice(&STATES[usize::from(byte)][..cells.len()]);
            }
            let known = ray.known.near().min(ranges)..ray.known.end().min(ranges);
            let seen: u32 = ray.bits().words().iter().map(|word| word.count_ones()).sum();
            visible += seen;
            invisible += known.len() as u32 - seen;
            row[..known.start].fill(0);
            row[known.end..].fill(0);
            crc.update(&row);
        }
        let hash = if visible + invisible == 0 { 0 } else { crc.sum() };
        format!("{time} {visible} {invisible} {hash:08x}")
    }

    fn probability(&self, time: u64) -> String {
        let map = self.receiver.map(self.sensor, Time::from_micros(time));
        let (ranges, azimuths) = map.header().map_or((0, 0), |h| (usize::from(h.ranges), usize::from(h.azimuths)));
        let (mut crc, mut cells, mut sum) = (Crc::new(), 0, 0);
        for azimuth in 0..azimuths {
            let row: Vec<_> = (0..ranges).map(|range| map.probability(azimuth, range)).collect();
            cells += row.iter().flatten().count();
            let row: Vec<u8> = row.iter().map(|p| p.map_or(0, |p| p.raw())).collect();
            sum += row.iter().map(|p| u64::from(*p)).sum::<u64>();
            crc.update(&row);
        }
        let hash = if cells == 0 { 0 } else { crc.sum() };
        format!("{time} p {cells} {sum} {hash:08x}")
    }

    fn cells(&self, time: u64) -> String {
        let (ranges, rays) = self.rays(time);
        let mut text = time.to_string();
        if rays.iter().all(|ray| ray.known.is_empty()) {
            return text;
        }
        for ray in &rays {
            text.push(' ');
            text.extend((0..ranges).map(|cell| ['?', '#', '.'][usize::from(state(ray, cell))]));
        }
        text
    }
}

/// States of eight known cells, by their bits.
static STATES: [[u8; 8]; 256] = {
    let mut states = [[1; 8]; 256];
    let mut at = 0;
    while at < 256 * 8 {
        states[at / 8][at % 8] += ((at / 8) >> (at % 8) & 1) as u8;
        at += 1;
    }
    states
};

/// 0 unknown, 1 not visible, 2 visible.
fn state(ray: &Ray<W>, cell: usize) -> u8 {
    if ray.known.contains(cell) { 1 + u8::from(ray.get(cell)) } else { 0 }
}

/// Answers every line.
pub fn answers<'a>(lines: impl IntoIterator<Item = &'a Input>) -> String {
    let mut library = Library::default();
    lines.into_iter().filter_map(|input| library.take(input)).fold(String::new(), |mut text, answer| {
        let _ = writeln!(text, "{answer}");
        text
    })
}
