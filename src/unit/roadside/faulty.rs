//! Slots that crash a controller when they are read: flash memory that lost its power while it was written.
//!
//! # Model
//! A word of memory that outlasts a reset says which slot is being read, and which ones are not read any more. A start
//! after a crash leaves out these and the one that was being read, so it ends after as many crashes as there are such
//! slots. What else ends a run forgets them all, and so does a start that has read the rest: a slot may have been written
//! since.

use crate::unit::settings::SLOTS;
use crate::wire::status::ResetCause;

/// In the upper half of the word while slots are read.
const MARK: u32 = 0x5107;

/// Which slots must not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultySlots {
    /// A bit for each.
    slots: u8,
}

// a bit for each, and a number of eight bits
const _: () = assert!(SLOTS <= u8::BITS as usize);

impl FaultySlots {
    /// What the word is when no slot is read.
    pub const NOT_READING: u32 = 0;

    /// By the word as the last run left it, and how that ended: when power comes memory says anything.
    pub fn found(word: u32, cause: ResetCause) -> Self {
        let [number, slots, ..] = word.to_le_bytes();
        let crashed_reading = cause == ResetCause::Crash && word >> 16 == MARK;
        Self { slots: if crashed_reading { slots | bit(usize::from(number)) } else { 0 } }
    }

    /// What the word is to be while a slot is read.
    #[allow(clippy::cast_possible_truncation)] // one of eight
    pub fn reading(self, slot: usize) -> u32 {
        let [low, high, ..] = MARK.to_le_bytes();
        u32::from_le_bytes([slot as u8, self.slots, low, high])
    }

    /// Whether a slot can be read.
    pub fn is_readable(self, slot: usize) -> bool {
        self.slots & bit(slot) == 0
    }
}

fn bit(slot: usize) -> u8 {
    u32::try_from(slot).ok().and_then(|slot| 1_u8.checked_shl(slot)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A start on a controller with such slots; how the run ends, and the word it leaves.
    fn start(faulty: &[usize], word: u32, cause: ResetCause) -> Result<FaultySlots, u32> {
        let found = FaultySlots::found(word, cause);
        for slot in 0..SLOTS {
            let word = found.reading(slot);
            if found.is_readable(slot) && faulty.contains(&slot) {
                return Err(word);
            }
        }
        Ok(found)
    }

    /// Starts until one gets through, the first when power comes; how many, and what the last one left out.
    fn starts(faulty: &[usize], mut word: u32) -> (usize, FaultySlots) {
        let mut cause = ResetCause::PowerOn;
        for number in 1..=SLOTS + 1 {
            match start(faulty, word, cause) {
                Ok(found) => return (number, found),
                Err(left) => (word, cause) = (left, ResetCause::Crash),
            }
        }
        panic!("resets for ever");
    }

    #[test]
    fn a_controller_with_several_faulty_slots_starts_after_as_many_crashes() {
        for faulty in [&[][..], &[1], &[1, 2], &[0, 7], &[0, 1, 2, 3, 4, 5, 6, 7]] {
            for word in [0, u32::MAX, 0x5107_FFFF] {
                let (number, found) = starts(faulty, word);
                assert_eq!(number, faulty.len() + 1, "{faulty:?}");
                (0..SLOTS).for_each(|slot| assert_eq!(found.is_readable(slot), !faulty.contains(&slot)));
            }
        }
    }

    #[test]
    fn only_a_crash_while_slots_were_read_says_anything_of_them() {
        let all = FaultySlots { slots: 0 };
        let word = FaultySlots { slots: 0b110 }.reading(4);
        assert_eq!(FaultySlots::found(word, ResetCause::Crash), FaultySlots { slots: 0b1_0110 });
        for cause in [ResetCause::PowerOn, ResetCause::BrownOut, ResetCause::Software, ResetCause::Watchdog] {
            assert_eq!(FaultySlots::found(word, cause), all, "{cause:?}");
        }
        assert_eq!(FaultySlots::found(FaultySlots::NOT_READING, ResetCause::Crash), all, "a crash of the loop");
        assert_eq!(FaultySlots::found(0xFFFF_0201, ResetCause::Crash), all, "anything");
    }
}
