//! What a unit says to its integrator, whatever line it came over.

use super::identity::Identified;
use super::settings::{BlockKind, MOST_BLOCK_LEN, Which};
use super::timing::Took;

/// Why a unit refused a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// As in [`StoredError::code`](crate::unit::settings::StoredError::code), or
    /// [`INCOMPLETE`](crate::unit::can_service::INCOMPLETE).
    pub reason: u8,
    /// What goes with it: a layout, a parameter's value, the first missing part.
    pub detail: [u8; 4],
    pub(crate) name: [u8; Refusal::MOST_LETTERS],
}

impl Refusal {
    pub(crate) const MOST_LETTERS: usize = 48;
    /// Reason of a refusal for a parameter: its name follows.
    pub(crate) const PARAMETER: u8 = 5;

    /// Without a name.
    pub(crate) const fn new(reason: u8, detail: [u8; 4]) -> Self {
        Self { reason, detail, name: [0; Self::MOST_LETTERS] }
    }

    /// What the block is of, and what is wrong with it, as in
    /// [`BlockError::code`](crate::unit::settings::BlockError::code).
    pub fn of_kind(&self) -> (Option<BlockKind>, u8) {
        (BlockKind::from_number(self.reason >> 4), self.reason & 0xF)
    }

    /// The parameter's name; empty if the refusal is not about one.
    pub fn parameter(&self) -> &str {
        let letters = self.name.split(|byte| *byte == 0).next().unwrap_or(&[]);
        core::str::from_utf8(letters).unwrap_or("")
    }

    /// The parameter's value.
    pub fn value(&self) -> f32 {
        f32::from_be_bytes(self.detail)
    }
}

/// A block, or a part of one.
#[derive(Clone, Copy, PartialEq)]
pub struct Piece {
    bytes: [u8; MOST_BLOCK_LEN],
    length: usize,
}

impl core::fmt::Debug for Piece {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.bytes()).finish()
    }
}

impl Piece {
    /// Nothing.
    pub const EMPTY: Self = Self { bytes: [0; MOST_BLOCK_LEN], length: 0 };

    /// Of these bytes, as many as a block has.
    pub fn new(bytes: &[u8]) -> Self {
        let mut new = Self::EMPTY;
        new.put(0, bytes);
        new
    }

    /// Puts bytes at a place; what ends behind them is as long as before. Whether there was room.
    pub fn put(&mut self, place: usize, bytes: &[u8]) -> bool {
        let room = place.checked_add(bytes.len()).and_then(|end| self.bytes.get_mut(place..end));
        let Some(room) = room else { return false };
        room.copy_from_slice(bytes);
        self.length = self.length.max(place + bytes.len());
        true
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}

/// What a unit says.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // no allocator here
pub enum Said {
    /// A block was written, with this sequence.
    Written(u32),
    /// The block that was asked for; its own check sum is still to be looked at.
    Block(Piece),
    /// A part of a block, and its place in it; nothing behind its end.
    Part(Which, u16, Piece),
    /// A part of a block came; from this place on they are missing.
    Came(u16),
    /// The unit starts, with the block of a slot and its sequence or without one.
    Started(Option<(u8, u32)>),
    /// A block was refused, or there is none.
    Refused(Refusal),
    /// Which unit it is.
    Identified(Identified),
    /// Both slots are empty; it counts from the next start on.
    Cleared,
    /// How long frames take.
    Took(Took),
}
