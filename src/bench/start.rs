//! A unit in a test bench: its sender sends every message at the moment it is due.

use crate::fixed::time::Time;
use crate::unit::settings::Settings;
use crate::unit::{InUnit, MapSender};
use crate::wire::broadcast::{BroadcastConfig, Medium};
use crate::wire::header::Header;
use crate::wire::message::Epoch;

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
    start_sender(sender, header, (settings.unit.sensor, medium), epoch, now);
}

#[inline(never)]
fn start_sender<M, S: MapSender<M>>(
    sender: &mut Option<S>,
    header: Header,
    (number, medium): (u8, Medium),
    epoch: Epoch,
    now: Time,
) {
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(number, medium) };
    *sender = S::start(config, header, epoch, now).ok();
}
