//! What the two bits of a cell say of its probability: never more than the table does.
//!
//! # Model
//! A cell has the bit of the visibility plane and the bit of the finer plane. Each pair of bits has a least
//! probability; not visible with the finer bit not set has 0. Where the finer bit is not at hand what is said is what
//! both of its values allow. Bits that are lost count as not set, and none of the levels is above the last one, so a
//! lost bit never makes a cell more probable.

use super::Probability;

/// Least probabilities by a cell's bits, and which table they are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Not visible, the finer bit set, 1/255.
    hidden: u8,
    /// Visible, the finer bit not set.
    visible: u8,
    /// Visible, the finer bit set: the greatest.
    clear: u8,
    /// Lowest 16 bits of the table's check sum.
    table: u16,
}

impl Levels {
    /// Each at most the last one, which is above 0; larger ones are lowered.
    pub(super) fn new(hidden: u8, visible: u8, clear: u8, table: u16) -> Self {
        let clear = clear.max(1);
        Self { hidden: hidden.min(clear), visible: visible.min(clear), clear, table }
    }

    /// Those of bytes as a header has them; `None` if no sender says these.
    pub fn from_bytes([hidden, visible, clear, a, b]: [u8; 5]) -> Option<Self> {
        let holds = clear > 0 && hidden <= clear && visible <= clear;
        holds.then_some(Self { hidden, visible, clear, table: u16::from_be_bytes([a, b]) })
    }

    /// As a header has them.
    pub fn to_bytes(&self) -> [u8; 5] {
        let [a, b] = self.table.to_be_bytes();
        [self.hidden, self.visible, self.clear, a, b]
    }

    /// The least probability of a cell that is known, by its bits; `None` for a finer bit that is not at hand.
    pub fn of(&self, visible: bool, finer: Option<bool>) -> Probability {
        Probability::from_raw(match (visible, finer) {
            (true, Some(true)) => self.clear,
            (true, None | Some(false)) => self.visible,
            (false, Some(true)) => self.hidden,
            (false, None | Some(false)) => 0,
        })
    }

    /// The level that a cell has to reach for its finer bit.
    pub(super) fn finer(&self, visible: bool) -> u8 {
        if visible { self.clear } else { self.hidden }
    }

    /// Lowest 16 bits of the table's check sum.
    pub fn table(&self) -> u16 {
        self.table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_that_are_lost_never_make_a_cell_more_probable() {
        for bytes in [[60, 200, 240, 1, 2], [0, 0, 1, 0, 0], [240, 0, 240, 0, 9], [255, 255, 255, 0, 0]] {
            let levels = Levels::from_bytes(bytes).unwrap();
            assert_eq!(levels.to_bytes(), bytes);
            for (visible, finer) in [(false, false), (false, true), (true, false), (true, true)] {
                let whole = levels.of(visible, Some(finer));
                for (v, f) in [(false, false), (false, true), (true, false), (true, true)] {
                    let lost = (v <= visible) && (f <= finer);
                    assert!(!lost || levels.of(v, Some(f)) <= whole, "{bytes:?}: {visible} {finer} as {v} {f}");
                }
                assert!(levels.of(visible, None) <= whole);
                assert!(levels.of(false, None) <= whole);
            }
        }
    }

    #[test]
    fn levels_no_sender_says_are_none() {
        for bytes in [[0, 0, 0, 1, 2], [0, 0, 0, 0, 0], [9, 0, 8, 0, 0], [0, 9, 8, 0, 0]] {
            assert_eq!(Levels::from_bytes(bytes), None, "{bytes:?}");
        }
        assert_eq!(Levels::new(9, 9, 0, 5).to_bytes(), [1, 1, 1, 0, 5], "what is made always holds");
    }
}
