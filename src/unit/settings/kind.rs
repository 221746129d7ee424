//! The kinds of blocks a unit keeps.

use super::BLOCK_LEN;
use super::kept::{BYTES_AROUND, TABLE_LEN};
use crate::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};
use crate::sensor::ground::MOST_HEIGHTS;
use crate::sensor::place::{HEIGHT_LEN, LANE_HEAD_LEN, LANE_POINT_LEN};

/// What a block is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// Settings of the sensor, its buses and the unit.
    Settings,
    /// Heights of the road.
    Heights,
    /// Lanes of traffic.
    Lanes,
    /// A table of probabilities.
    Probabilities,
}

/// Bytes of the longest block there is room for.
pub const MOST_BLOCK_LEN: usize = {
    let (mut most, mut k) = (0, 0);
    while k < Kind::ALL.len() {
        let here = LENGTHS[k];
        most = if here > most { here } else { most };
        k += 1;
    }
    most
};

/// Bytes of all slots together, each up to a whole word of any flash memory.
pub const ALL_SLOTS_LEN: usize = {
    let (mut all, mut k) = (0, 0);
    while k < Kind::ALL.len() {
        all += 2 * LENGTHS[k].next_multiple_of(32);
        k += 1;
    }
    all
};

/// Slots of all kinds.
pub const SLOTS: usize = 2 * Kind::ALL.len();

const LENGTHS: [usize; 4] = [
    BLOCK_LEN,
    if MOST_HEIGHTS > 0 { BYTES_AROUND + HEIGHT_LEN * MOST_HEIGHTS } else { 0 },
    if MOST_LANES > 0 { BYTES_AROUND + LANE_HEAD_LEN * MOST_LANES + LANE_POINT_LEN * MOST_SEGMENTS } else { 0 },
    TABLE_LEN,
];

impl Kind {
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
            Self::Settings => LENGTHS[0],
            Self::Heights => LENGTHS[1],
            Self::Lanes => LENGTHS[2],
            Self::Probabilities => LENGTHS[3],
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_slots_and_marks_are_each_kinds_own() {
        for (number, kind) in (0..).zip(Kind::ALL) {
            assert_eq!((kind.number(), Kind::from_number(number)), (number, Some(kind)));
            assert_eq!(
                (Kind::of_block(&kind.magic()), Kind::of_clear_mark(&kind.clear_mark())),
                (Some(kind), Some(kind))
            );
            assert!(kind.slots().iter().all(|slot| Kind::of_slot(*slot) == Some(kind)));
        }
        assert_eq!((Kind::from_number(4), Kind::of_slot(SLOTS), Kind::of_block(b"VSXB")), (None, None, None));
        assert_eq!(Kind::Settings.clear_mark(), *b"VSCF", "as firmware before the other kinds has it");
    }

    #[test]
    fn no_block_is_longer_than_a_kilobyte_and_than_parts_of_four_bytes_have_numbers() {
        assert!(MOST_BLOCK_LEN <= 4 * 255, "{MOST_BLOCK_LEN}");
        assert!(Kind::ALL.iter().all(|kind| kind.most_len().is_multiple_of(4)));
    }
}
