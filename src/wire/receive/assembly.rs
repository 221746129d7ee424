//! The words of blocks, frame by frame, in any order.

use crate::wire::code::block::Kind;
use crate::wire::code::reading;
use crate::wire::message::Plane;
use crate::wire::scan_number::ScanNumber;

/// Blocks under way at a time; the one that waited longest makes room.
const SLOTS: usize = 4;

/// Words of a block on classic CAN.
const WORDS: usize = 4;

/// Which block a word belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub plane: Plane,
    pub scan: ScanNumber,
    pub start: u8,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    place: Place,
    /// Whether it is a delta; told by the first word.
    delta: bool,
    /// Which words are there, a bit each; none: the slot is free.
    there: u8,
    words: [u64; WORDS],
    /// Where reading goes on.
    reading: reading::Place,
}

/// Blocks under way, the one touched last first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Assembly {
    slots: [Slot; SLOTS],
}

/// The words of a block that are there from the first on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Begun {
    /// Whether it is a delta.
    pub delta: bool,
    /// Where reading goes on.
    pub reading: reading::Place,
    words: [u64; WORDS],
    count: usize,
}

impl Begun {
    pub fn words(&self) -> &[u64] {
        self.words.get(..self.count).unwrap_or(&[])
    }
}

impl Assembly {
    pub const NEW: Self = Self {
        slots: [Slot {
            place: Place { plane: Plane::Visibility, scan: ScanNumber::from_byte(0), start: 0 },
            delta: false,
            there: 0,
            words: [0; WORDS],
            reading: reading::Place::START,
        }; SLOTS],
    };

    /// Notes how far the block touched last was read.
    pub fn read_up_to(&mut self, place: reading::Place) {
        if let Some(slot) = self.slots.first_mut() {
            slot.reading = place;
        }
    }

    pub fn forget(&mut self) {
        *self = Self::NEW;
    }

    /// Drops what is too old, before its number comes again.
    pub fn purge(&mut self, too_old: impl Fn(ScanNumber) -> bool) {
        self.slots.iter_mut().filter(|slot| too_old(slot.place.scan)).for_each(|slot| slot.there = 0);
    }

    /// Takes a word; what can be read now that could not before. `kind` comes with the first word.
    pub fn take(&mut self, place: Place, index: usize, kind: Option<Kind>, word: u64) -> Option<Begun> {
        let found = self.slots.iter().position(|slot| slot.there != 0 && slot.place == place);
        let free = || self.slots.iter().position(|slot| slot.there == 0).unwrap_or(SLOTS - 1);
        let at = found.unwrap_or_else(free);
        // the one touched last comes first, so the last one waited longest
        let touched = *self.slots.get(at)?;
        for i in (0..at).rev() {
            let slot = *self.slots.get(i)?;
            *self.slots.get_mut(i + 1)? = slot;
        }
        let slot = self.slots.first_mut()?;
        *slot = touched;
        if found.is_none() {
            *slot = Slot { place, delta: false, there: 0, words: [0; WORDS], reading: reading::Place::START };
        }
        let before = slot.there.trailing_ones();
        *slot.words.get_mut(index)? = word;
        slot.there |= 1 << index;
        if let Some(kind) = kind {
            slot.delta = kind != Kind::Refresh;
        }
        let count = slot.there.trailing_ones();
        let begun = Begun { delta: slot.delta, reading: slot.reading, words: slot.words, count: count as usize };
        (count > before).then_some(begun)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(start: u8) -> Place {
        Place { plane: Plane::Visibility, scan: ScanNumber::from_byte(9), start }
    }

    #[test]
    fn words_come_in_any_order() {
        let mut a = Assembly::NEW;
        assert!(a.take(place(3), 2, None, 30).is_none());
        assert!(a.take(place(3), 1, None, 20).is_none());
        let begun = a.take(place(3), 0, Some(Kind::Delta { ticks: 1 }), 10).unwrap();
        assert_eq!((begun.words(), begun.delta), (&[10, 20, 30][..], true));
        assert_eq!(a.take(place(3), 3, None, 40).unwrap().words(), [10, 20, 30, 40]);
        assert!(a.take(place(3), 1, None, 20).is_none(), "nothing new");
    }

    #[test]
    fn the_block_that_waited_longest_makes_room() {
        let mut a = Assembly::NEW;
        (0..4).for_each(|start| assert!(a.take(place(start), 1, None, u64::from(start)).is_none()));
        a.take(place(0), 2, None, 7);
        a.take(place(4), 0, Some(Kind::Refresh), 1);
        assert_eq!(a.take(place(0), 0, Some(Kind::Refresh), 5).unwrap().words(), [5, 0, 7]);
        assert_eq!(a.take(place(1), 0, Some(Kind::Refresh), 5).unwrap().words(), [5], "its second word is gone");
    }

    #[test]
    fn what_is_too_old_is_forgotten() {
        let mut a = Assembly::NEW;
        a.take(place(0), 1, None, 1);
        a.purge(|scan| scan == ScanNumber::from_byte(9));
        assert_eq!(a.take(place(0), 0, Some(Kind::Refresh), 5).unwrap().words(), [5]);
    }
}
