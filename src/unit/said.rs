//! What a unit says to its integrator, whatever line it came over.

use super::identity::Identified;
use super::settings::BLOCK_LEN;
use super::timing::Took;

/// Why a unit refused a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// As in [`BlockError::code`](crate::unit::settings::BlockError::code), or
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

/// What a unit says.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // no allocator here
pub enum Said {
    /// A block was written, with this sequence.
    Written(u32),
    /// The block that was asked for, every byte of it and 0xFF after a shorter layout; its own check sum is still to be looked at.
    Block([u8; BLOCK_LEN]),
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
