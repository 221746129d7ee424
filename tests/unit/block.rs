//! The settings a session starts with, in memory: one slot.

use viewshed::unit::settings::{BLOCK_LEN, SettingsSlots};

pub struct Block(pub [u8; BLOCK_LEN]);

impl SettingsSlots for Block {
    fn slot(&self, slot: usize) -> &[u8] {
        if slot == 0 { &self.0 } else { &[] }
    }

    fn write(&mut self, _: usize, block: &[u8]) {
        self.0[..block.len()].copy_from_slice(block);
    }
}
