//! What a unit keeps over a loss of power, for boards and hosts of a test bench that have no flash.

use crate::unit::settings::{BLOCK_LEN, SettingsSlots};
use crate::wire::message::Epoch;

/// Bytes of it: two slots, starts.
pub const FLASH_LEN: usize = 2 * BLOCK_LEN + 1;

/// Both slots of the configuration block, and how often the unit started.
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
        self.bytes.get_mut(slot * BLOCK_LEN..(slot + 1) * BLOCK_LEN).unwrap_or_default()
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
        self.bytes.get(slot * BLOCK_LEN..(slot + 1) * BLOCK_LEN).unwrap_or(&[])
    }

    fn write(&mut self, slot: usize, block: &[u8; BLOCK_LEN]) {
        if let Some(place) = self.slot_mut(slot).first_chunk_mut() {
            *place = *block;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_starts_are_kept_apart() {
        let mut flash = Flash::ERASED;
        assert_eq!(flash.start(), Epoch::new(0));
        flash.write(1, &[7; BLOCK_LEN]);
        flash.write(2, &[8; BLOCK_LEN]);
        let mut kept = Flash::new(*flash.bytes());
        assert_eq!((kept.slot(0), kept.slot(1)), (&[0xFF; BLOCK_LEN][..], &[7; BLOCK_LEN][..]));
        assert_eq!(kept.start(), Epoch::new(1));
        assert!(kept.slot(2).is_empty());
    }
}
