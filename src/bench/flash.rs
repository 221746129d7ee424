//! What a unit keeps over a loss of power, for boards and hosts of a test bench that have no flash.

use crate::unit::settings::{ALL_SLOTS_LEN, BlockKind, SettingsSlots, in_copy};
use crate::wire::message::Epoch;

/// Bytes of it: all slots, starts.
pub const FLASH_LEN: usize = ALL_SLOTS_LEN + 1;

/// The slots of all kinds of blocks, and how often the unit started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flash {
    bytes: [u8; FLASH_LEN],
}

impl Flash {
    /// Nothing was ever written.
    pub const ERASED: Self = Self { bytes: [0xFF; FLASH_LEN] };

    /// As it was kept.
    pub const fn new(bytes: [u8; FLASH_LEN]) -> Self {
        Self { bytes }
    }

    /// To be kept.
    pub const fn bytes(&self) -> &[u8; FLASH_LEN] {
        &self.bytes
    }

    /// The bytes of a slot, to damage them.
    pub fn slot_mut(&mut self, slot: usize) -> &mut [u8] {
        let length = BlockKind::of_slot(slot).map_or(0, BlockKind::most_len);
        self.bytes.get_mut(in_copy(slot)).and_then(|slot| slot.get_mut(..length)).unwrap_or_default()
    }

    /// Counts a start; its epoch is not that of the 15 before.
    pub fn start(&mut self) -> Epoch {
        match self.bytes.last_mut() {
            Some(starts) => {
                *starts = starts.wrapping_add(1);
                Epoch::new(*starts)
            }
            None => Epoch::new(0),
        }
    }
}

impl SettingsSlots for Flash {
    fn slot(&self, slot: usize) -> &[u8] {
        let length = BlockKind::of_slot(slot).map_or(0, BlockKind::most_len);
        self.bytes.get(in_copy(slot)).and_then(|slot| slot.get(..length)).unwrap_or(&[])
    }

    fn write(&mut self, slot: usize, block: &[u8]) {
        self.slot_mut(slot).iter_mut().zip(block).for_each(|(to, from)| *to = *from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::settings::{BLOCK_LEN, SLOTS};

    #[test]
    fn slots_and_starts_are_kept_apart() {
        let mut flash = Flash::ERASED;
        assert_eq!(flash.start(), Epoch::new(0));
        flash.write(1, &[7; BLOCK_LEN]);
        flash.write(BlockKind::Lanes.slots()[1], &[8; BLOCK_LEN]);
        flash.write(SLOTS, &[9; BLOCK_LEN]);
        let mut kept = Flash::new(*flash.bytes());
        assert_eq!((kept.slot(0), kept.slot(1)), (&[0xFF; BLOCK_LEN][..], &[7; BLOCK_LEN][..]));
        assert_eq!(kept.start(), Epoch::new(1));
        assert_eq!(kept.slot(5)[..BLOCK_LEN], [8; BLOCK_LEN]);
        assert!(kept.slot(SLOTS).is_empty());
    }
}
