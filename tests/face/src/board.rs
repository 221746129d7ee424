//! Who builds a unit has the names of `viewshed::board` as well.

use viewshed::board::{BLOCK_LEN, Flow, Identity, SerialLine, SerialSession, SettingsSlots, StoredSettings};
use viewshed::small::{CHECK, Sender, State};
use viewshed::{Epoch, Settings, Unit};

/// Where blocks are kept.
struct InRam([[u8; BLOCK_LEN]; 2]);

impl SettingsSlots for InRam {
    fn slot(&self, slot: usize) -> &[u8] {
        self.0.get(slot).map_or(&[], |slot| slot)
    }
    fn write(&mut self, slot: usize, block: &[u8]) {
        self.0[slot][..block.len()].copy_from_slice(block);
    }
}

/// What was sent.
struct Line(usize);

impl SerialLine for Line {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.0 += bytes.len();
        true
    }
}

/// A unit without settings says so; one with a block takes its line's bytes.
pub fn a_session_from_start_to_restart(settings: &Settings) {
    let (mut slots, mut line) = (InRam([[0xFF; BLOCK_LEN]; 2]), Line(0));
    let stored = StoredSettings::read(&slots, CHECK);
    assert!(stored.settings().is_none() && stored.write(&settings.to_block(0), &mut slots).is_ok());
    let stored = StoredSettings::read(&slots, CHECK);
    let mut session = SerialSession::<256>::start(0, Identity::UNNAMED, Epoch::new(1), stored, &mut line);
    let started = line.0;
    let mut unit = None::<Unit<'_, State, Sender>>;
    let flow = session.take(&[0, 1, 2, 0], &mut unit, &mut slots, &mut line, &mut |_, _| {});
    assert!(started > 0 && flow == Flow::Continue && session.settings() == Some(settings));
}
