//! One plane of a map on its way out: which azimuths are still to be encoded, and on what they build.
//!
//! # Model
//! Azimuths are encoded in runs of the same kind. One that was refreshed not long ago, whose known cells
//! are as they were, is encoded against that refresh; any other is refreshed. An azimuth that no block
//! can hold goes out in plain bits. Only what was handed out whole is built upon.

use core::ops::Range;

use crate::wire::code::block::{Basis, Block, Context, Rays};
use crate::wire::code::ray::Ray;
use crate::wire::message::Azimuths;
use crate::wire::scan_number::ScanNumber;

/// Most ticks between a refresh and a delta on it.
pub const MOST_TICKS: u8 = 16;

/// How a scan is encoded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encoding {
    pub context: Context,
    /// Whether everything is refreshed.
    pub all: bool,
}

/// What goes out next of a plane.
#[derive(Debug, Clone, Copy)]
pub(super) enum Next {
    /// Azimuths `start..` up to the block's end.
    Block { kind: Basis, start: usize, block: Block },
    /// An azimuth in plain bits.
    Plain { azimuth: usize },
}

/// A plane as it is sent.
#[derive(Debug, Clone, Copy)]
pub(super) struct OutgoingPlane<const A: usize, const W: usize> {
    /// The scan being encoded.
    now: [Ray<W>; A],
    pending: Azimuths,
    /// The refresh of each azimuth, and its scan.
    was: [Ray<W>; A],
    was_scan: [ScanNumber; A],
    /// Which azimuths have one to build on.
    refreshed: Azimuths,
    /// How many ticks older it is than the scan being encoded, where it may be built on; else 0.
    ticks: [u8; A],
}

/// The azimuths of a plane that are encoded in one way, from a start on.
struct Run<'a, const A: usize, const W: usize> {
    plane: &'a OutgoingPlane<A, W>,
    kind: Basis,
    encoding: &'a Encoding,
}

impl<const A: usize, const W: usize> Rays<W> for Run<'_, A, W> {
    fn now(&self, azimuth: usize) -> Option<&Ray<W>> {
        let pending = self.plane.pending.get(azimuth) && self.plane.kind(azimuth, self.encoding) == self.kind;
        self.plane.now.get(azimuth).filter(|_| pending)
    }

    fn was(&self, azimuth: usize) -> Option<&Ray<W>> {
        self.plane.was.get(azimuth)
    }
}

impl<const A: usize, const W: usize> OutgoingPlane<A, W> {
    /// Nothing to encode. All bits are 0, so that no image holds a copy.
    pub const fn new() -> Self {
        Self {
            now: [Ray::UNKNOWN; A],
            pending: Azimuths::NONE,
            was: [Ray::UNKNOWN; A],
            was_scan: [ScanNumber::from_byte(0); A],
            refreshed: Azimuths::NONE,
            ticks: [0; A],
        }
    }

    /// Takes some azimuths of a scan; what was still to be encoded of the one before is not encoded any more.
    pub fn offer(&mut self, scan: ScanNumber, part: Range<usize>, ray: impl Fn(usize) -> Ray<W>) {
        self.pending = Azimuths::span(part.start, part.end.min(A));
        let was = self.was.iter().zip(&self.was_scan);
        let azimuths = self.now.iter_mut().zip(&mut self.ticks).zip(was).enumerate().take(part.end).skip(part.start);
        for (azimuth, ((now, ticks), (was, was_scan))) in azimuths {
            *now = ray(azimuth);
            *ticks = scan.ticks_after(*was_scan);
            if *ticks > MOST_TICKS {
                self.refreshed.clear(azimuth);
            }
            if now.known != was.known || !self.refreshed.get(azimuth) {
                *ticks = 0;
            }
        }
    }

    /// Builds on nothing from here on.
    pub fn forget(&mut self) {
        self.refreshed = Azimuths::NONE;
        self.pending = Azimuths::NONE;
    }

    /// Azimuths still to be encoded.
    pub fn pending(&self) -> u32 {
        self.pending.count()
    }

    /// Encodes no more of this scan.
    pub fn give_up(&mut self) {
        self.pending = Azimuths::NONE;
    }

    /// How an azimuth is encoded.
    fn kind(&self, azimuth: usize, encoding: &Encoding) -> Basis {
        match self.ticks.get(azimuth) {
            Some(&ticks @ 1..) if !encoding.all => Basis::Delta { ticks },
            _ => Basis::Refresh,
        }
    }

    /// What goes out next, looking from an azimuth on and then from the first.
    pub fn next(&mut self, encoding: &Encoding, from: usize) -> Option<Next> {
        let start = self.pending.next(from).or_else(|| self.pending.next(0))?;
        let mut kind = self.kind(start, encoding);
        let mut block = self.block(encoding, kind, start);
        if block.end == start && kind != Basis::Refresh {
            // against its refresh it does not fit
            self.refreshed.clear(start);
            if let Some(ticks) = self.ticks.get_mut(start) {
                *ticks = 0;
            }
            kind = Basis::Refresh;
            block = self.block(encoding, kind, start);
        }
        if kind == Basis::Refresh {
            // receivers may take any part of it
            (start..block.end.max(start + 1)).for_each(|azimuth| self.refreshed.clear(azimuth));
        }
        Some(if block.end == start { Next::Plain { azimuth: start } } else { Next::Block { kind, start, block } })
    }

    fn block(&self, encoding: &Encoding, kind: Basis, start: usize) -> Block {
        let run = Run { plane: self, kind, encoding };
        Block::new(&encoding.context, kind, start, &run)
    }

    /// What was handed out whole is encoded.
    pub fn encoded(&mut self, kind: Option<Basis>, start: usize, end: usize, scan: ScanNumber) {
        for azimuth in start..end.min(A) {
            self.pending.clear(azimuth);
            if kind == Some(Basis::Refresh) {
                self.refreshed.set(azimuth);
                if let (Some(was), Some(now)) = (self.was.get_mut(azimuth), self.now.get(azimuth)) {
                    *was = *now;
                }
                if let Some(was_scan) = self.was_scan.get_mut(azimuth) {
                    *was_scan = scan;
                }
            }
        }
    }

    /// An azimuth of the scan being encoded.
    pub fn now(&self, azimuth: usize) -> &Ray<W> {
        self.now.get(azimuth).unwrap_or(&Ray::UNKNOWN)
    }
}
