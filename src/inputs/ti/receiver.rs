//! Bytes in, scans out.

use super::family::{FrameHeader, ITEM_HEADER, LONGEST, MAGIC, PADDING, TiFamily};
use super::learning::Learning;
use super::points::{Entries, LONGEST_RECORD, Layout, Record, TiDialect};
use crate::fixed::time::Time;
use crate::inputs::collected::{Added, Collected};
use crate::inputs::{RadarScan, count, usable};

/// What is known of the radar's firmware.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TiConfig {
    /// Its kind of header; `None`: to be learnt.
    pub family: Option<TiFamily>,
    /// What its messages do not say.
    pub dialect: TiDialect,
}

impl TiConfig {
    /// The family is learnt, the dialect the usual one.
    pub const LEARN: Self = Self { family: None, dialect: TiDialect::USUAL };
}

/// What bytes led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TiOutcome<'a> {
    /// They were taken, and nothing is complete yet.
    Taken,
    /// The kind of header is known now; scans come from the next frame on.
    Learnt(TiFamily),
    /// A frame is complete.
    Scan(RadarScan<'a>),
    /// A frame is dropped.
    Broken(Flaw),
}

/// Why a frame is dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Flaw {
    /// The next one began before its end.
    Cut,
    /// Its header cannot be one of this family.
    Header,
    /// Its items do not fill it.
    Items,
    /// An item is no whole number of records.
    Records,
    /// Most of the points announced are not there.
    Points,
}

/// What was seen and what was wrong, since the start; saturating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TiCounters {
    /// Magic words.
    pub frames: u32,
    /// Scans given out.
    pub scans: u32,
    /// Frames used up by learning.
    pub learning: u32,
    /// Frames dropped.
    pub broken: u32,
    /// Frames that never came, by their number.
    pub lost: u32,
    /// Times the numbers started over.
    pub restarts: u32,
    /// Times the family was forgotten because nothing fitted any more.
    pub relearnt: u32,
    /// Bytes outside of frames, up to the last magic word.
    pub stray_bytes: u32,
    /// Items stepped over.
    pub other_items: u32,
    /// Points with values that are none.
    pub no_point: u32,
    /// Points dropped because the list was full, of crowded places first.
    pub overflow: u32,
}

/// Collects scans from a serial line.
#[derive(Debug, Clone)]
pub struct Ti<const N: usize> {
    config: TiConfig,
    family: Option<TiFamily>,
    learning: Learning,
    /// Frames broken in a row.
    broken_in_a_row: u8,
    /// The last eight bytes, the latest on top.
    window: u64,
    /// Bytes of the frame so far; 0 outside.
    position: u32,
    /// Bytes since the last frame.
    outside: u32,
    head: [u8; LONGEST],
    stage: Stage,
    header: FrameHeader,
    /// Items left, the current one included.
    left: u32,
    /// Where the current stage ends.
    end: u32,
    layout: Layout,
    record: [u8; LONGEST_RECORD],
    filled: usize,
    started: Time,
    points: u16,
    /// Of these, points with values that are none.
    refused: u16,
    ratios: u16,
    collected: Collected<N>,
    last: Option<(u32, u32)>,
    counters: TiCounters,
}

/// What the next bytes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Not of interest before the next magic word.
    Searching,
    /// The header.
    Header,
    /// Type and length of an item.
    Item,
    /// An item's payload, to be stepped over.
    Other,
    /// An item's records.
    Records,
    /// Zeros up to the frame's end.
    Padding,
}

/// So many broken frames in a row mean that another firmware runs.
const FORGET_AFTER: u8 = 10;

/// Numbers farther apart are a restart, not lost frames.
const FARTHEST: u32 = 10_000;

impl<const N: usize> Ti<N> {
    /// Before the first byte.
    pub const fn new(config: TiConfig) -> Self {
        Self {
            config,
            family: config.family,
            learning: Learning::NEW,
            broken_in_a_row: 0,
            window: 0,
            position: 0,
            outside: 0,
            head: [0; LONGEST],
            stage: Stage::Searching,
            header: FrameHeader::NONE,
            left: 0,
            end: 0,
            layout: Layout::Cartesian,
            record: [0; LONGEST_RECORD],
            filled: 0,
            started: Time::from_micros(0),
            points: 0,
            refused: 0,
            ratios: 0,
            collected: Collected::new(),
            last: None,
            counters: TiCounters {
                frames: 0,
                scans: 0,
                learning: 0,
                broken: 0,
                lost: 0,
                restarts: 0,
                relearnt: 0,
                stray_bytes: 0,
                other_items: 0,
                no_point: 0,
                overflow: 0,
            },
        }
    }

    /// Takes bytes, up to the first that something comes of, and says how many; the rest is to be
    /// pushed again.
    pub fn push(&mut self, bytes: &[u8], now: Time) -> (usize, TiOutcome<'_>) {
        for (i, byte) in bytes.iter().enumerate() {
            match self.take(*byte, now) {
                None => {}
                Some(Event::Learnt(family)) => return (i + 1, TiOutcome::Learnt(family)),
                Some(Event::Broken(flaw)) => return (i + 1, TiOutcome::Broken(flaw)),
                Some(Event::Complete) => return (i + 1, self.complete()),
            }
        }
        (bytes.len(), TiOutcome::Taken)
    }

    /// The kind of header, once known.
    pub fn family(&self) -> Option<TiFamily> {
        self.family
    }

    /// What was seen and what was wrong.
    pub fn counters(&self) -> &TiCounters {
        &self.counters
    }

    fn take(&mut self, byte: u8, now: Time) -> Option<Event> {
        self.window = self.window >> 8 | u64::from(byte) << 56;
        if self.window == MAGIC {
            return self.begin(now);
        }
        if self.position == 0 {
            self.outside = self.outside.saturating_add(1);
            return None;
        }
        if let Some(place) = usize::try_from(self.position).ok().and_then(|at| self.head.get_mut(at)) {
            *place = byte;
        }
        self.position = self.position.saturating_add(1);
        let Some(family) = self.family else {
            self.learning.take(self.position, self.window, &self.head);
            return None;
        };
        if self.stage == Stage::Records {
            self.fill(byte);
        }
        if self.position != self.end {
            return None;
        }
        if let Err(flaw) = self.step(family) {
            return self.broken(flaw);
        }
        if self.stage == Stage::Padding && self.position == self.header.total {
            self.position = 0;
            self.stage = Stage::Searching;
            return Some(Event::Complete);
        }
        None
    }

    /// A magic word, wherever it came.
    fn begin(&mut self, now: Time) -> Option<Event> {
        count(&mut self.counters.frames);
        // all of the word but its last byte has been counted already
        let (length, within) = (self.position.saturating_sub(7), self.position > 0);
        let strays = core::mem::take(&mut self.outside).saturating_sub(7);
        self.counters.stray_bytes = self.counters.stray_bytes.saturating_add(strays);
        let event = match self.family {
            None if within => {
                count(&mut self.counters.learning);
                self.family = self.learning.end(length);
                self.family.map(Event::Learnt)
            }
            Some(_) if within && self.stage != Stage::Searching => self.broken(Flaw::Cut),
            _ => None,
        };
        self.head = [0; LONGEST];
        self.position = ITEM_HEADER;
        self.stage = Stage::Header;
        self.end = self.family.map_or(0, TiFamily::header);
        self.started = now;
        (self.points, self.refused, self.ratios) = (0, 0, 0);
        self.collected.clear();
        event
    }

    fn broken(&mut self, flaw: Flaw) -> Option<Event> {
        count(&mut self.counters.broken);
        self.stage = Stage::Searching;
        self.position = 0;
        self.broken_in_a_row = self.broken_in_a_row.saturating_add(1);
        if self.config.family.is_none() && self.broken_in_a_row >= FORGET_AFTER {
            count(&mut self.counters.relearnt);
            self.family = None;
            self.learning = Learning::NEW;
            self.broken_in_a_row = 0;
        }
        Some(Event::Broken(flaw))
    }

    /// The stage is at its end: goes to the next.
    #[allow(clippy::cast_possible_truncation)] // halves of the window
    fn step(&mut self, family: TiFamily) -> Result<(), Flaw> {
        match self.stage {
            Stage::Header => {
                self.header = family.read(&self.head).ok_or(Flaw::Header)?;
                self.left = self.header.items;
                self.next()
            }
            Stage::Item => {
                let (kind, length) = (self.window as u32, (self.window >> 32) as u32);
                let payload = family.payload(length).ok_or(Flaw::Items)?;
                self.end = self.position.saturating_add(payload);
                if self.end > self.header.total {
                    return Err(Flaw::Items);
                }
                self.stage = match self.layout(family, kind) {
                    Some(layout) => {
                        (self.layout, self.filled) = (layout, 0);
                        Stage::Records
                    }
                    None => {
                        count(&mut self.counters.other_items);
                        Stage::Other
                    }
                };
                if payload == 0 { self.item_ends() } else { Ok(()) }
            }
            Stage::Records if self.filled > 0 || self.layout.miscounts(self.points) => Err(Flaw::Records),
            Stage::Records | Stage::Other => self.item_ends(),
            Stage::Searching | Stage::Padding => Ok(()),
        }
    }

    fn item_ends(&mut self) -> Result<(), Flaw> {
        self.left = self.left.saturating_sub(1);
        self.next()
    }

    /// The stage after an item or the header.
    fn next(&mut self) -> Result<(), Flaw> {
        let rest = self.header.total.checked_sub(self.position).ok_or(Flaw::Items)?;
        (self.stage, self.end) = match self.left {
            0 if rest < PADDING => (Stage::Padding, self.header.total),
            1.. if rest >= ITEM_HEADER => (Stage::Item, self.position + ITEM_HEADER),
            _ => return Err(Flaw::Items),
        };
        Ok(())
    }

    /// Takes a byte of a record.
    fn fill(&mut self, byte: u8) {
        if let Some(place) = self.record.get_mut(self.filled) {
            *place = byte;
        }
        // of the longest records the rest is of no interest
        self.filled += 1;
        if self.filled == self.layout.record() {
            self.filled = 0;
            self.take_record();
        }
    }

    /// How an item is laid out; `None` if it is of no interest.
    fn layout(&self, family: TiFamily, kind: u32) -> Option<Layout> {
        let layout = match (family, kind) {
            (TiFamily::Bytes48, 6) => Some(Layout::CompressedHead),
            (TiFamily::Bytes48, 7) => Some(Layout::Targets),
            (TiFamily::Bytes52, 6) => Some(Layout::Polar(self.config.dialect.polar_points)),
            (TiFamily::Bytes52, 7) => Some(Layout::FlatTargets),
            (TiFamily::Bytes48 | TiFamily::Bytes52, _) => None,
            (_, 1) if self.header.sdk <= 2 => Some(Layout::IndexedHead),
            (_, 1) => Some(Layout::Cartesian),
            (_, 7) => Some(Layout::SideInfo),
            (_, 1000) => Some(Layout::Spherical),
            (_, 1020) => Some(Layout::CompressedHead),
            (_, 301) => Some(Layout::ExtendedHead),
            (_, 308 | 1010) => Some(Layout::Targets),
            _ => None,
        };
        layout.filter(|layout| layout.wanted(self.config.dialect.entries))
    }

    /// Takes a whole record.
    fn take_record(&mut self) {
        match self.layout.read(&self.record, &self.config.dialect) {
            Record::Head(after) => self.layout = after,
            Record::Point(point) => {
                match point.map(|point| self.collected.add(self.points, point)) {
                    Err(_) => {
                        count(&mut self.counters.no_point);
                        self.refused = self.refused.saturating_add(1);
                    }
                    Ok(Added::Full) => count(&mut self.counters.overflow),
                    Ok(Added::Kept) => {}
                }
                self.points = self.points.saturating_add(1);
            }
            Record::Snr(snr) => {
                let place = self.collected.place(self.ratios, usize::from(self.ratios));
                if let Some(detection) = place.and_then(|place| self.collected.get_mut(place)) {
                    detection.snr_half_db = Some(snr);
                }
                self.ratios = self.ratios.saturating_add(1);
            }
        }
    }

    fn complete(&mut self) -> TiOutcome<'_> {
        let header = self.header;
        // points, not targets, are announced
        let of_header = header.points.filter(|_| self.config.dialect.entries == Entries::Points);
        let announced = of_header.unwrap_or(self.points);
        if !usable(announced, self.points) {
            count(&mut self.counters.broken);
            return TiOutcome::Broken(Flaw::Points);
        }
        self.broken_in_a_row = 0;
        self.follow(&header);
        count(&mut self.counters.scans);
        TiOutcome::Scan(RadarScan {
            time: self.started,
            received: self.started,
            number: header.number,
            detections: self.collected.detections(),
            all: self.collected.detections(),
            missing: announced.saturating_sub(self.points),
            refused: self.refused,
            fault: false,
        })
    }

    fn follow(&mut self, header: &FrameHeader) {
        let Some((last, sub_frame)) = self.last.replace((header.number, header.sub_frame)) else { return };
        match header.number.wrapping_sub(last) {
            // sub-frames share a number
            0 if sub_frame != header.sub_frame => {}
            advance @ 1..=FARTHEST => self.counters.lost = self.counters.lost.saturating_add(advance - 1),
            _ => count(&mut self.counters.restarts),
        }
    }
}

/// What a byte led to.
enum Event {
    Learnt(TiFamily),
    Complete,
    Broken(Flaw),
}
