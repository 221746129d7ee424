//! The kinds of blocks a unit keeps.

use core::ops::Range;

use super::BLOCK_LEN;
use crate::obstacles::lanes::{self, MOST_LANES, MOST_SEGMENTS};
use crate::sensor::ground::{self, MOST_HEIGHTS};
use crate::sensor::site::{HEIGHT_LEN, LANE_HEAD_LEN, LANE_POINT_LEN};

/// What a block is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum BlockKind {
    /// Settings of the sensor, its buses and the unit.
    Settings,
    /// Heights of the road.
    Heights,
    /// Lanes of traffic.
    Lanes,
    /// A table of probabilities.
    Probabilities,
}

/// Bytes of magic, layout, length and sequence.
pub(super) const HEADER_LEN: usize = 12;
/// Bytes of the check sum.
pub(super) const SUM_LEN: usize = 4;
/// Bytes of the two numbers before points, or a table.
pub(super) const COUNT_LEN: usize = 4;
/// Bytes of a block that are neither points nor a table.
const BYTES_AROUND: usize = HEADER_LEN + COUNT_LEN + SUM_LEN;
/// Bytes of a block with a table; 0 where there is no room for one.
#[cfg(feature = "probability")]
pub(super) const TABLE_LEN: usize = (BYTES_AROUND + crate::probability::BLOCK_LEN).next_multiple_of(4);
#[cfg(not(feature = "probability"))]
const TABLE_LEN: usize = 0;

/// Bytes of the longest block of heights, and of lanes; 0 without room for any.
const HEIGHTS_LEN: usize = if ground::ROOM { BYTES_AROUND + HEIGHT_LEN * MOST_HEIGHTS } else { 0 };
const LANES_LEN: usize =
    if lanes::ROOM { BYTES_AROUND + LANE_HEAD_LEN * MOST_LANES + LANE_POINT_LEN * MOST_SEGMENTS } else { 0 };

/// Bytes of the longest block there is room for.
pub const MOST_BLOCK_LEN: usize = max(max(BLOCK_LEN, HEIGHTS_LEN), max(LANES_LEN, TABLE_LEN));

/// Bytes of all slots together, each up to a whole word of any flash memory.
pub const ALL_SLOTS_LEN: usize = 2 * (word(BLOCK_LEN) + word(HEIGHTS_LEN) + word(LANES_LEN) + word(TABLE_LEN));

/// Bytes of a block of any kind, as its head says; none before that came.
pub fn announced_length(head: &[u8]) -> Option<usize> {
    let [.., low, high] = *head.first_chunk::<8>()?;
    Some(usize::from(u16::from_le_bytes([low, high])))
}

/// Where a slot lies in a copy of all of them.
pub fn in_copy(slot: usize) -> Range<usize> {
    let length = |slot| BlockKind::of_slot(slot).map_or(0, |kind| word(kind.most_len()));
    let from = (0..slot).map(length).sum();
    from..from + length(slot)
}

/// Slots of all kinds.
pub const SLOTS: usize = 2 * BlockKind::ALL.len();

// parts of four bytes have numbers of one byte
const _: () = assert!(MOST_BLOCK_LEN <= 4 * 255);

const fn max(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

/// Up to a whole word of any flash memory, which has at most 32 bytes.
pub(super) const fn word(length: usize) -> usize {
    length.next_multiple_of(32)
}

impl BlockKind {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Settings, Self::Heights, Self::Lanes, Self::Probabilities];

    /// Of a number on the wire.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }

    /// On the wire.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Bytes of the longest block of it; 0 where this firmware has no room for it.
    pub const fn most_len(self) -> usize {
        match self {
            Self::Settings => BLOCK_LEN,
            Self::Heights => HEIGHTS_LEN,
            Self::Lanes => LANES_LEN,
            Self::Probabilities => TABLE_LEN,
        }
    }

    /// Numbers of its two slots.
    pub const fn slots(self) -> [usize; 2] {
        let first = 2 * self as usize;
        [first, first + 1]
    }

    /// The kind whose slot this is.
    pub fn of_slot(slot: usize) -> Option<Self> {
        Self::ALL.get(slot / 2).copied()
    }

    /// What its blocks begin with.
    pub const fn magic(self) -> [u8; 4] {
        match self {
            Self::Settings => *b"VSCB",
            Self::Heights => *b"VSHB",
            Self::Lanes => *b"VSLB",
            Self::Probabilities => *b"VSPB",
        }
    }

    /// Marks the emptying of its slots: not every message that passes its check sum by chance does it, and firmware that
    /// does not know the kind empties nothing.
    pub const fn clear_mark(self) -> [u8; 4] {
        let [a, b, kind, _] = self.magic();
        [a, b, kind, b'F']
    }

    /// The kind of the block that begins like this.
    pub fn of_block(block: &[u8]) -> Option<Self> {
        let magic = block.first_chunk::<4>()?;
        Self::ALL.into_iter().find(|kind| kind.magic() == *magic)
    }

    /// The kind whose slots are to be emptied.
    pub fn of_clear_mark(mark: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.clear_mark() == *mark)
    }
}

/// Which block is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Which {
    /// What it is of.
    pub kind: BlockKind,
    /// The one that counts from the next restart on, instead of the one in use.
    pub newest: bool,
}

impl Which {
    /// The one in use.
    pub const fn in_use(kind: BlockKind) -> Self {
        Self { kind, newest: false }
    }

    /// The one that counts from the next restart on.
    pub const fn newest(kind: BlockKind) -> Self {
        Self { kind, newest: true }
    }

    /// On the wire.
    pub const fn number(self) -> u8 {
        2 * self.kind.number() + self.newest as u8
    }

    /// Of a number on the wire.
    pub fn from_number(number: u8) -> Option<Self> {
        BlockKind::from_number(number / 2).map(|kind| Self { kind, newest: number & 1 == 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_slots_and_marks_are_each_kinds_own() {
        for (number, kind) in (0..).zip(BlockKind::ALL) {
            assert_eq!((kind.number(), BlockKind::from_number(number)), (number, Some(kind)));
            assert_eq!(
                (BlockKind::of_block(&kind.magic()), BlockKind::of_clear_mark(&kind.clear_mark())),
                (Some(kind), Some(kind))
            );
            assert!(kind.slots().iter().all(|slot| BlockKind::of_slot(*slot) == Some(kind)));
        }
        assert_eq!(
            (BlockKind::from_number(4), BlockKind::of_slot(SLOTS), BlockKind::of_block(b"VSXB")),
            (None, None, None)
        );
        assert_eq!(BlockKind::Settings.clear_mark(), *b"VSCF", "as firmware before the other kinds has it");
    }

    #[test]
    fn blocks_are_whole_parts_of_four_bytes() {
        assert!(BlockKind::ALL.iter().all(|kind| kind.most_len().is_multiple_of(4)));
    }
}
