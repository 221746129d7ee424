//! A unit in a test bench: its sender sends every message at the moment it is due.

use crate::fixed::time::Time;
use crate::unit::settings::{Settings, SettingsSlots, StoredSettings};
use crate::unit::{InUnit, MapSender, sender};
use crate::wire::broadcast::{BroadcastConfig, Medium};
use crate::wire::message::Epoch;
use crate::wire::status::Reason;

/// Puts parameters and sender where they stay. `None` without settings, and without ones that can be worked with.
/// Apart, so that what this takes of the stack is free again before the first scan.
#[inline(never)]
pub fn start<E: InUnit, S: MapSender<E::Map>>(
    parameters: &mut Option<E::Parameters>,
    sender: &mut Option<S>,
    settings: Option<&Settings>,
    medium: Medium,
    epoch: Epoch,
    now: Time,
) {
    (*parameters, *sender) = (None, None);
    let Some(settings) = settings else { return };
    let Ok(header) = settings.build::<E>(parameters) else { return };
    let _ = S::start(sender, at_once(settings.unit.sensor, medium), header, epoch, now);
}

/// The same with what is kept beside the settings: lanes, heights, a table of probabilities. What the unit lacks, where a
/// table is kept that is not its own.
#[inline(never)]
pub fn start_stored<E: InUnit, S: MapSender<E::Map>>(
    parameters: &mut Option<E::Parameters>,
    sender: &mut Option<S>,
    stored: (&StoredSettings, &impl SettingsSlots),
    medium: Medium,
    epoch: Epoch,
    now: Time,
) -> Option<Reason> {
    (*parameters, *sender) = (None, None);
    let (settings, slots) = (stored.0.settings()?, stored.1);
    let header = settings.build_at::<E>(&StoredSettings::place(slots).ok()?, parameters).ok()?;
    sender::start_stored(sender, (at_once(settings.unit.sensor, medium), header), settings, slots, epoch, now)
}

/// A sender whose messages are due at once.
fn at_once(sensor: u8, medium: Medium) -> BroadcastConfig {
    BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(sensor, medium) }
}
