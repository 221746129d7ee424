//! What the two bits of a cell say of its probability: never more than the table does.
//!
//! # Model
//! A cell that is known has at least the first level, one that is visible at least the second, and one whose bit in the
//! plane of probability is set at least the third. Each says so by itself, so planes of different scans may be joined:
//! the third level is given out where the cell is visible, too. Bits that are lost count as not set, and the levels do
//! not fall, so a lost bit never makes a cell more probable.

use super::Probability;

/// Least probabilities by what is said of a cell, and which table they are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Known, 1/255.
    known: u8,
    /// Visible.
    visible: u8,
    /// Visible, and the bit of the plane of probability set; above 0.
    clear: u8,
    /// Lowest 16 bits of the table's check sum.
    table: u16,
}

impl Levels {
    /// None is above the one after it, and the last one above 0; larger ones are lowered.
    pub(super) fn new(known: u8, visible: u8, clear: u8, table: u16) -> Self {
        let clear = clear.max(1);
        let visible = visible.min(clear);
        Self { known: known.min(visible), visible, clear, table }
    }

    /// Those of bytes as a header has them; `None` if no sender says these.
    pub fn from_bytes([known, visible, clear, a, b]: [u8; 5]) -> Option<Self> {
        let holds = clear > 0 && known <= visible && visible <= clear;
        holds.then_some(Self { known, visible, clear, table: u16::from_be_bytes([a, b]) })
    }

    /// As a header has them.
    pub fn to_bytes(self) -> [u8; 5] {
        let [a, b] = self.table.to_be_bytes();
        [self.known, self.visible, self.clear, a, b]
    }

    /// The least probability of a cell that is known, by its two bits.
    pub fn of(&self, visible: bool, clear: bool) -> Probability {
        Probability::from_raw(match (visible, clear) {
            (true, true) => self.clear,
            (true, false) => self.visible,
            (false, _) => self.known,
        })
    }

    /// Which probability sets the bit of the plane of probability.
    pub(super) fn clear(&self) -> Probability {
        Probability::from_raw(self.clear)
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
        for bytes in [[60, 200, 240, 1, 2], [0, 0, 1, 0, 0], [0, 240, 240, 0, 9], [255, 255, 255, 0, 0]] {
            let levels = Levels::from_bytes(bytes).unwrap();
            assert_eq!(levels.to_bytes(), bytes);
            for (visible, clear) in [(false, false), (false, true), (true, false), (true, true)] {
                for (v, c) in [(false, false), (false, true), (true, false), (true, true)] {
                    let lost = (v <= visible) && (c <= clear);
                    let whole = levels.of(visible, clear);
                    assert!(!lost || levels.of(v, c) <= whole, "{bytes:?}: {visible} {clear} as {v} {c}");
                }
            }
        }
    }

    #[test]
    fn levels_no_sender_says_are_none() {
        for bytes in [[0, 0, 0, 1, 2], [0, 0, 0, 0, 0], [9, 8, 8, 0, 0], [0, 9, 8, 0, 0]] {
            assert_eq!(Levels::from_bytes(bytes), None, "{bytes:?}");
        }
        assert_eq!(Levels::new(9, 9, 0, 5).to_bytes(), [1, 1, 1, 0, 5], "what is made always holds");
    }
}
