//! Radars and cameras: bytes or CAN frames in, complete scans in the units of [`Detection`] or boxes out.
//!
//! Every decoder is an accumulator. It is fed with single CAN frames or with chunks of bytes cut
//! anywhere, gets the time with each, and answers with a named outcome: nothing yet, a
//! [`RadarScan`], or what was wrong. Bad input is counted and never stops a decoder.

pub mod ars408;
pub mod collected;
pub mod native;
mod polar;
pub mod signal;
pub mod ti;

use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::health::FrameStatus;
use crate::wire::frame::CanFrame;

/// The detections of one scan of a radar, or the boxes of one picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RadarScan<'a, T = Detection> {
    /// When it was measured, on the radar's clock; when its first frame came, on the caller's,
    /// where the radar sends no time.
    pub time: Time,
    /// When its first frame came, on the caller's clock.
    pub received: Time,
    /// The radar's own number of the scan.
    pub number: u32,
    /// What was measured and passed the radar's own quality marks.
    pub detections: &'a [T],
    /// The same, and behind it what was [left out by them](Detection::marked): estimators look at where that lies.
    pub all: &'a [T],
    /// Announced and not arrived; the most it can be, where that is not known exactly.
    pub missing: u16,
    /// Points that arrived and are no detections: not finite, at no distance, or absurd; boxes of no known class.
    pub refused: u16,
    /// Whether the radar says that something is wrong with it.
    pub fault: bool,
}

impl<T> RadarScan<'_, T> {
    /// What the estimators get besides the detections.
    pub fn status(&self) -> FrameStatus {
        FrameStatus { fault: self.fault, refused: self.refused }
    }

    /// What was left out by the radar's own marks.
    pub fn unwanted(&self) -> &[T] {
        self.all.get(self.detections.len()..).unwrap_or(&[])
    }

    /// As a frame for an estimator.
    pub fn frame(&self) -> Frame<'_, [T]> {
        Frame { measured: self.time, input: self.all, incomplete: self.missing > 0, status: self.status() }
    }
}

/// What a sensor measured at a time, for an estimator.
#[derive(Debug)]
pub struct Frame<'a, I: ?Sized> {
    /// When.
    pub measured: Time,
    /// What.
    pub input: &'a I,
    /// Something of it was announced and did not arrive.
    pub incomplete: bool,
    /// What the sensor says of itself, and what was refused.
    pub status: FrameStatus,
}

/// A decoder that feeds an estimator: pieces of a sensor's line in, frames out.
pub trait Feed {
    /// What comes over the line at a time: a CAN frame, some bytes, a message.
    type Piece: ?Sized;
    /// What a frame holds.
    type Input: ?Sized;

    /// Takes a piece; `each` is given what is complete by then.
    fn take(&mut self, piece: &Self::Piece, now: Time, each: &mut impl FnMut(&Frame<'_, Self::Input>));

    /// Gives out what is over because nothing came.
    fn wait(&mut self, now: Time, each: &mut impl FnMut(&Frame<'_, Self::Input>));

    /// Frames that never came, since the start.
    fn lost(&self) -> u32;
}

impl<const N: usize> Feed for ars408::Ars408<N> {
    type Piece = CanFrame;
    type Input = [Detection];

    fn take(&mut self, piece: &CanFrame, now: Time, each: &mut impl FnMut(&Frame<'_, [Detection]>)) {
        if let ars408::Ars408Outcome::Scan(scan) = self.push(piece, now) {
            each(&scan.frame());
        }
        self.wait(now, each);
    }

    fn wait(&mut self, now: Time, each: &mut impl FnMut(&Frame<'_, [Detection]>)) {
        while let Some(outcome) = self.poll(now) {
            if let ars408::Ars408Outcome::Scan(scan) = outcome {
                each(&scan.frame());
            }
        }
    }

    fn lost(&self) -> u32 {
        self.counters().lost
    }
}

impl<const N: usize> Feed for ti::Ti<N> {
    type Piece = [u8];
    type Input = [Detection];

    fn take(&mut self, mut piece: &[u8], now: Time, each: &mut impl FnMut(&Frame<'_, [Detection]>)) {
        while !piece.is_empty() {
            let (taken, outcome) = self.push(piece, now);
            if let ti::TiOutcome::Scan(scan) = outcome {
                each(&scan.frame());
            }
            // a receiver that took nothing would hold up everything
            piece = piece.get(taken.max(1)..).unwrap_or(&[]);
        }
    }

    fn wait(&mut self, _: Time, _: &mut impl FnMut(&Frame<'_, [Detection]>)) {}

    fn lost(&self) -> u32 {
        self.counters().lost
    }
}

/// Time on this line is that of its scans: what follows one is looked at by its stamp.
impl<const N: usize, T: native::NativeEntry> Feed for native::NativeReceiver<N, T> {
    type Piece = [u8];
    type Input = [T];

    fn take(&mut self, piece: &[u8], now: Time, each: &mut impl FnMut(&Frame<'_, [T]>)) {
        let mut now = now;
        if let native::NativeOutcome::Scan(scan) = self.push(piece, now) {
            now = scan.time;
            each(&scan.frame());
        }
        self.wait(now, each);
    }

    fn wait(&mut self, now: Time, each: &mut impl FnMut(&Frame<'_, [T]>)) {
        let mut now = now;
        while let Some(outcome) = self.poll(now) {
            if let native::NativeOutcome::Scan(scan) = outcome {
                now = scan.time;
                each(&scan.frame());
            }
        }
    }

    fn lost(&self) -> u32 {
        self.counters().lost
    }
}

/// Whether enough of a scan arrived to be used: a scan of which most is missing would be taken for
/// a free road.
pub(crate) const fn usable(announced: u16, arrived: u16) -> bool {
    arrived as u32 * 2 >= announced as u32
}

/// One more, never wrapping.
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
