//! The words of blocks, frame by frame, in any order.
//!
//! # Model
//! Words of blocks that are not complete wait in one row, the one that came last at the end. A word that
//! comes again moves there, and takes the place of the one before: with another sender of the same number, epoch and
//! clock it may say something else, and what was read of the one before is no beginning of its block. The row is full:
//! its first word makes room. With [`ROOM`] words all first words of a refresh may come before the second ones, or
//! frames be displaced by 50 ms.
//!
//! # ReceiverLimits
//! Eight bytes a word.

use crate::wire::code::reading;
use crate::wire::scan_number::ScanNumber;

/// Words that wait for others of their blocks.
pub const ROOM: usize = 36;

/// Words of a block on classic CAN.
const WORDS: usize = 4;

/// Bits of a word.
const WORD_BITS: u32 = 33;

/// Which block of a plane a word belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct BlockKey {
    pub scan: ScanNumber,
    pub start: u8,
}

/// A word with its place: bit 51 the block's kind, if it is the first word; 43 to 50 scan, 35 to 42 first azimuth, 33 and 34
/// which word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Waiting(u64);

impl Waiting {
    fn new(place: BlockKey, index: usize, delta: bool, word: u64) -> Self {
        let key = u64::from(place.scan.byte()) << 10 | u64::from(place.start) << 2 | (index as u64 & 3);
        Self(u64::from(delta) << 51 | key << WORD_BITS | word & ((1 << WORD_BITS) - 1))
    }

    #[allow(clippy::cast_possible_truncation)] // 18 bits
    fn key(self) -> u32 {
        (self.0 >> WORD_BITS) as u32 & 0x3_FFFF
    }

    fn is_of(self, place: BlockKey) -> bool {
        self.key() >> 2 == Self::new(place, 0, false, 0).key() >> 2
    }

    fn index(self) -> usize {
        self.key() as usize & 3
    }

    #[allow(clippy::cast_possible_truncation)] // a byte
    fn scan(self) -> ScanNumber {
        ScanNumber::from_byte((self.key() >> 10) as u8)
    }
}

/// The words of a plane that wait.
#[derive(Debug, Clone)]
pub(super) struct Assembly {
    /// The first `count` of them, in the order they came in.
    words: [Waiting; ROOM],
    count: u8,
    /// Where reading goes on, if nothing else was taken since.
    read: Option<(BlockKey, reading::Resume)>,
}

/// The words of a block that are there from the first on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Begun {
    /// Whether it is a delta.
    pub delta: bool,
    /// Where reading goes on.
    pub reading: reading::Resume,
    words: [u64; WORDS],
    count: usize,
}

impl Begun {
    pub fn words(&self) -> &[u64] {
        self.words.get(..self.count).unwrap_or(&[])
    }
}

impl Assembly {
    pub const NEW: Self = Self { words: [Waiting(0); ROOM], count: 0, read: None };

    fn waiting(&self) -> &[Waiting] {
        self.words.get(..usize::from(self.count)).unwrap_or(&[])
    }

    /// Keeps those that are to be kept, in their order.
    fn retain(&mut self, keep: impl Fn(Waiting) -> bool) {
        let mut kept = 0;
        for from in 0..usize::from(self.count) {
            let Some(word) = self.words.get(from).copied().filter(|word| keep(*word)) else { continue };
            if let Some(to) = self.words.get_mut(usize::from(kept)) {
                *to = word;
            }
            kept += 1;
        }
        self.count = kept;
    }

    /// A block was read up to here; if it was read to its end, its words are not needed any more.
    pub fn read_up_to(&mut self, block: BlockKey, reading: reading::Resume, ended: bool) {
        self.read = Some((block, reading)).filter(|_| !ended);
        if ended {
            self.retain(|word| !word.is_of(block));
        }
    }

    /// Something else was taken: what is to be read is read from its first word.
    pub fn interrupt(&mut self) {
        self.read = None;
    }

    pub fn forget(&mut self) {
        (self.count, self.read) = (0, None);
    }

    /// Drops what is too old, before its number comes again.
    pub fn purge(&mut self, too_old: impl Fn(ScanNumber) -> bool) {
        if self.waiting().iter().any(|word| too_old(word.scan())) {
            self.retain(|word| !too_old(word.scan()));
        }
    }

    /// Takes a word; what can be read now that could not before. Whether the block is a delta comes with the
    /// first word.
    pub fn take(&mut self, place: BlockKey, index: usize, delta: bool, word: u64) -> Option<Begun> {
        let new = Waiting::new(place, index, delta, word);
        let again = self.waiting().iter().any(|waiting| waiting.key() == new.key());
        if again {
            self.retain(|waiting| waiting.key() != new.key());
        } else if usize::from(self.count) == ROOM {
            self.words.copy_within(1.., 0);
            self.count -= 1;
        }
        *self.words.get_mut(usize::from(self.count))? = new;
        self.count += 1;
        // whatever comes, reading goes on there at most once
        let read = self.read.take();
        if again {
            return None;
        }
        let mut begun = Begun { delta: false, reading: reading::Resume::START, words: [0; WORDS], count: 0 };
        let mut there = 0_u8;
        for waiting in self.waiting().iter().filter(|waiting| waiting.is_of(place)) {
            there |= 1 << waiting.index();
            *begun.words.get_mut(waiting.index())? = waiting.0 & ((1 << WORD_BITS) - 1);
            begun.delta |= waiting.0 >> 51 & 1 == 1;
        }
        begun.count = there.trailing_ones() as usize;
        if let Some((block, reading)) = read
            && block == place
        {
            begun.reading = reading;
        }
        // only then the new one is among them
        (begun.count > index).then_some(begun)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(start: u8) -> BlockKey {
        BlockKey { scan: ScanNumber::from_byte(9), start }
    }

    #[test]
    fn words_come_in_any_order() {
        let mut a = Assembly::NEW;
        assert!(a.take(place(3), 2, false, 30).is_none());
        assert!(a.take(place(3), 1, false, 20).is_none());
        let begun = a.take(place(3), 0, true, 10).unwrap();
        assert_eq!((begun.words(), begun.delta), (&[10, 20, 30][..], true));
        assert_eq!(a.take(place(3), 3, false, 0x1_FFFF_FFFF).unwrap().words(), [10, 20, 30, 0x1_FFFF_FFFF]);
        assert!(a.take(place(3), 1, false, 20).is_none(), "nothing new");
    }

    #[test]
    fn all_first_words_of_a_map_may_come_before_the_second_ones() {
        let mut a = Assembly::NEW;
        for start in 0..35 {
            assert_eq!(a.take(place(start), 0, true, u64::from(start)).unwrap().words(), [u64::from(start)]);
        }
        for start in 0..35 {
            assert_eq!(a.take(place(start), 1, false, 7).unwrap().words(), [u64::from(start), 7]);
            a.read_up_to(place(start), reading::Resume::START, true);
        }
        assert!(a.waiting().is_empty());
    }

    #[test]
    fn a_word_that_comes_again_waits_from_then_on() {
        let mut a = Assembly::NEW;
        (0..36).for_each(|start| assert!(a.take(place(start), 1, false, 1).is_none()));
        assert!(a.take(place(0), 1, false, 1).is_none());
        assert!(a.take(place(50), 1, false, 1).is_none());
        assert_eq!(a.take(place(0), 0, false, 2).unwrap().words(), [2, 1]);
        assert_eq!(a.take(place(1), 0, false, 2).unwrap().words(), [2], "it made room");
    }

    #[test]
    fn a_word_that_comes_again_has_its_block_read_from_the_beginning() {
        let read = reading::Resume::at(2);
        for (index, delta, word) in [(0, false, 11), (0, true, 10), (1, false, 21), (0, false, 10)] {
            let mut a = Assembly::NEW;
            a.take(place(3), 0, false, 10);
            a.take(place(3), 1, false, 20);
            a.read_up_to(place(3), read, false);
            assert!(a.take(place(3), index, delta, word).is_none(), "nothing is read with it");
            let begun = a.take(place(3), 2, false, 30).unwrap();
            assert_eq!(begun.reading, reading::Resume::START, "{index} {delta} {word}");
            let words = [if index == 0 { word } else { 10 }, if index == 1 { word } else { 20 }, 30];
            assert_eq!((begun.words(), begun.delta), (&words[..], delta));
        }
        let mut a = Assembly::NEW;
        a.take(place(3), 0, false, 10);
        a.read_up_to(place(3), read, false);
        assert_eq!(a.take(place(3), 1, false, 20).unwrap().reading, read, "goes on where it ended");
    }

    #[test]
    fn what_is_too_old_is_forgotten() {
        let mut a = Assembly::NEW;
        a.take(place(0), 1, false, 1);
        a.purge(|scan| scan == ScanNumber::from_byte(9));
        assert_eq!(a.take(place(0), 0, false, 5).unwrap().words(), [5]);
    }
}
