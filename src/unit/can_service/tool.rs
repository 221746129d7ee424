//! The integrator's end: what to send, and what the answers say.

use super::{ANSWER, BlockAnswer, BlockRequest, Came, REQUEST, frame, received};
use crate::unit::identity::Identified;
use crate::unit::reply::{Piece, Refusal, Said};
use crate::unit::settings::{BlockKind, Which, announced_length};
use crate::wire::broadcast::Medium;
use crate::wire::frame::CanFrame;
use crate::wire::message::Epoch;

/// Makes the messages towards a unit. At most one every millisecond suits every unit.
#[derive(Debug, Clone)]
pub struct Tool {
    sensor: u8,
    medium: Medium,
    counter: u8,
}

impl Tool {
    /// For the unit of a sensor.
    pub const fn new(sensor: u8, medium: Medium) -> Self {
        Self { sensor, medium, counter: 0 }
    }

    /// A whole block, to be written into the slot of its kind that is not in use. Of one that is not of this library's layout
    /// the first 1020 bytes at most.
    pub fn write(&mut self, block: &[u8]) -> impl Iterator<Item = CanFrame> {
        let length = u16::try_from(block.len()).unwrap_or(u16::MAX);
        let part = |(number, bytes): (u8, &[u8])| {
            let mut four = [0; 4];
            four.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
            BlockRequest::Part { number, bytes: four }
        };
        let parts = (0..u8::MAX).zip(block.chunks(4)).map(part);
        let last = block.last_chunk::<4>().copied().unwrap_or([0; 4]);
        let all = core::iter::once(BlockRequest::Begin { length }).chain(parts);
        all.chain([BlockRequest::Complete { last }]).filter_map(|request| self.frame(request))
    }

    /// A part of a block again, and its completion: after an answer that it is missing.
    pub fn again(&mut self, block: &[u8], part: u8) -> impl Iterator<Item = CanFrame> {
        let bytes = block.get(4 * usize::from(part)..).and_then(|rest| rest.first_chunk::<4>()).copied();
        let last = block.last_chunk::<4>().copied().unwrap_or([0; 4]);
        let again = bytes.map(|bytes| BlockRequest::Part { number: part, bytes });
        again.into_iter().chain([BlockRequest::Complete { last }]).filter_map(|request| self.frame(request))
    }

    /// Asks for a block.
    pub fn read(&mut self, which: Which) -> Option<CanFrame> {
        self.frame(BlockRequest::Read(which))
    }

    /// Asks for a restart with the newest block.
    pub fn restart(&mut self) -> Option<CanFrame> {
        self.frame(BlockRequest::Restart)
    }

    /// Asks for both slots of a kind to be emptied.
    pub fn clear(&mut self, kind: BlockKind) -> Option<CanFrame> {
        self.frame(BlockRequest::Clear(kind))
    }

    /// Asks every unit of the sensor's number which one it is; all have answered 0.3 s later.
    pub fn identify(&mut self) -> Option<CanFrame> {
        self.frame(BlockRequest::Identify)
    }

    /// Of the units of the sensor's number this chip's alone takes what follows; 0: all of them.
    pub fn address(&mut self, chip: u32) -> Option<CanFrame> {
        self.frame(BlockRequest::Address { chip })
    }

    fn frame(&mut self, request: BlockRequest) -> Option<CanFrame> {
        // requests are of no epoch
        frame(&self.medium, self.sensor, REQUEST, Epoch::new(0), &mut self.counter, request.own())
    }
}

/// Collects a unit's answers.
#[derive(Debug, Clone)]
pub struct Answers {
    sensor: u8,
    medium: Medium,
    block: Piece,
    /// Parts that came.
    came: Came,
    refusal: Option<Refusal>,
}

impl Answers {
    /// Of the unit of a sensor.
    pub const fn new(sensor: u8, medium: Medium) -> Self {
        Self { sensor, medium, block: Piece::EMPTY, came: Came::NONE, refusal: None }
    }

    /// Takes a frame; what the unit said, once it is complete.
    pub fn take(&mut self, frame: &CanFrame) -> Option<Said> {
        let own = received(frame, &self.medium, self.sensor, ANSWER)?;
        match BlockAnswer::read(own)? {
            BlockAnswer::Written { sequence } => Some(Said::Written(sequence)),
            BlockAnswer::Started { slot, sequence } => {
                self.came = Came::NONE;
                Some(Said::Started((slot != u8::MAX).then_some((slot, sequence))))
            }
            BlockAnswer::Identified { is_bench, chip } => {
                Some(Said::Identified(Identified::by_chip(self.sensor, is_bench, chip)))
            }
            BlockAnswer::Cleared => Some(Said::Cleared),
            BlockAnswer::Refused { reason, detail } => {
                let refusal = Refusal::new(reason, detail);
                self.refusal = (reason & 0xF == Refusal::PARAMETER).then_some(refusal);
                self.refusal.is_none().then_some(Said::Refused(refusal))
            }
            BlockAnswer::Name { number, letters } => {
                let refusal = self.refusal.as_mut()?;
                let at = 4 * usize::from(number);
                if let Some(place) = refusal.name.get_mut(at..at + 4) {
                    place.copy_from_slice(&letters);
                }
                if letters.contains(&0) { self.refusal.take().map(Said::Refused) } else { None }
            }
            BlockAnswer::Part { number, bytes } => self.part(number, bytes),
        }
    }

    fn part(&mut self, number: u8, bytes: [u8; 4]) -> Option<Said> {
        if number == 0 {
            // a block is read from its beginning on
            (self.came, self.block) = (Came::NONE, Piece::EMPTY);
        }
        if !self.block.put(4 * usize::from(number), &bytes) {
            return None;
        }
        self.came.set(usize::from(number));
        // the second part says how long the block is
        let parts = announced_length(self.block.bytes())?.div_ceil(4);
        let has_length = self.came.get(1);
        if has_length && (0..parts).all(|part| self.came.get(part)) {
            self.came = Came::NONE;
            return Some(Said::Block(self.block));
        }
        None
    }
}
