//! The stored block a unit runs with, and whether it could run with one that came.
//!
//! Both are decided by the same function, which builds what the settings are for: a block that is answered
//! "written" starts, and one that cannot start is refused with its parameter's name. Of the blocks stored
//! only those that can start count. If there is none, the unit has no maps and answers its service: the
//! safe state.

use super::block::{is_layout_1, length};
use super::{BLOCK_LEN, BlockError, Newest, Settings, UnitConfig};
use crate::sensor::config::ConfigError;
use crate::unit::can_bus::BusConfig;

/// Where configuration blocks are kept.
pub trait SettingsSlots {
    /// The bytes of a slot, 0 or 1.
    fn slot(&self, slot: usize) -> &[u8];
    /// Writes a slot.
    fn write(&mut self, slot: usize, block: &[u8; BLOCK_LEN]);
}

/// Whether a unit can be built with settings: with its grid, its senders and its controller's clock.
#[derive(Debug, Clone, Copy)]
pub struct SettingsCheck {
    build: fn(&Settings) -> Result<(), ConfigError>,
    /// Clock of the CAN controllers this program sets the bit rate of.
    can_clock_hz: Option<u32>,
}

impl SettingsCheck {
    /// By this function; [`SettingsCheck::of`] is the one for an estimator and a sender.
    pub const fn by(build: fn(&Settings) -> Result<(), ConfigError>) -> Self {
        Self { build, can_clock_hz: None }
    }

    /// And for CAN controllers of this clock, whose dividers have to meet the bit rates.
    pub const fn on_can(self, clock_hz: u32) -> Self {
        Self { can_clock_hz: Some(clock_hz), ..self }
    }

    /// Tries it. Takes as long and as much of the stack as a start.
    ///
    /// # Errors
    /// Names the parameter that stands against it.
    pub fn settings(&self, settings: &Settings) -> Result<(), ConfigError> {
        if let Some(clock_hz) = self.can_clock_hz {
            settings.radar_bus.check_clock("radar_bus", clock_hz)?;
            settings.broadcast_bus.check_clock("broadcast_bus", clock_hz)?;
        }
        (self.build)(settings)
    }
}

/// The block a unit runs with, or why there is none.
#[derive(Debug, Clone, Copy)]
pub struct StoredSettings {
    found: Result<Newest, BlockError>,
    check: SettingsCheck,
}

impl StoredSettings {
    /// The newest block that the unit can run with.
    pub fn read(slots: &impl SettingsSlots, check: SettingsCheck) -> Self {
        Self { found: newest(slots, check).map_err(worst), check }
    }

    /// What to work with; none in the safe state.
    pub fn settings(&self) -> Option<&Settings> {
        self.found.as_ref().ok().map(|newest| &newest.settings)
    }

    /// The slot and the sequence of the block in use.
    ///
    /// # Errors
    /// Why there is none.
    #[allow(clippy::cast_possible_truncation)] // 0 or 1
    pub fn place(&self) -> Result<(u8, u32), BlockError> {
        self.found.map(|newest| (newest.slot as u8, newest.next_sequence.wrapping_sub(1)))
    }

    /// The block in use, as it is stored; empty without one, or once its slot was emptied.
    pub fn block<'s>(&self, slots: &'s impl SettingsSlots) -> &'s [u8] {
        self.found.as_ref().map_or(&[], |newest| Self::in_slot(slots, newest.slot))
    }

    /// The slot of the block that counts from the next start on, which is another one after a write; none in empty slots.
    /// Takes as long as two starts.
    pub fn newest_slot(&self, slots: &impl SettingsSlots) -> Option<usize> {
        newest(slots, self.check).ok().map(|newest| newest.slot)
    }

    /// The block in a slot, as long as its layout; empty without one.
    pub fn in_slot(slots: &impl SettingsSlots, slot: usize) -> &[u8] {
        let bytes = slots.slot(slot);
        // a slot is as long as the longest layout
        bytes.get(..length(bytes)).unwrap_or(&[])
    }

    /// Both buses as the block in use describes them: the radar's, the broadcast's. By default without one.
    pub fn buses(self) -> [BusConfig; 2] {
        self.settings().map_or_else(Default::default, |s| [s.radar_bus, s.broadcast_bus])
    }

    /// The unit's own numbers and rates by the block in use; by default without one.
    pub fn unit(&self) -> UnitConfig {
        self.settings().map_or_else(UnitConfig::default, |settings| settings.unit)
    }

    /// Checks a block that came and writes it into the slot not in use; its sequence. It counts from the
    /// next start on.
    ///
    /// # Errors
    /// Why the unit could not start with it; nothing is written then.
    pub fn write(&self, block: &[u8], slots: &mut impl SettingsSlots) -> Result<u32, BlockError> {
        let (_, mut settings) = Settings::from_block(block)?;
        if is_layout_1(block) {
            settings.unit = self.unit();
        }
        self.check.settings(&settings).map_err(BlockError::Parameter)?;
        let (slot, sequence) = newest(slots, self.check).map_or((0, 1), |n| (n.next_slot, n.next_sequence));
        slots.write(slot, &settings.to_block(sequence));
        // what was written counts, not what was meant
        Settings::from_block(slots.slot(slot)).map(|(sequence, _)| sequence)
    }

    /// Empties both slots: from the next start on the unit is as it was before its first block.
    pub fn clear(slots: &mut impl SettingsSlots) {
        for slot in [0, 1] {
            slots.write(slot, &[0xFF; BLOCK_LEN]);
        }
    }
}

fn newest(slots: &impl SettingsSlots, check: SettingsCheck) -> Result<Newest, [BlockError; 2]> {
    Settings::newest([slots.slot(0), slots.slot(1)], |settings| check.settings(settings))
}

/// Of two refusals the one that says more: an empty slot says least.
fn worst([first, second]: [BlockError; 2]) -> BlockError {
    if first == BlockError::Empty { second } else { first }
}
