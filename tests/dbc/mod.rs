//! Frames read by a description.

use std::collections::BTreeMap;

use can_dbc::{ByteOrder, Dbc, MultiplexIndicator, Signal, ValueType};
use viewshed::wire::frame::CanFrame;

/// Signals of a frame by name.
pub type Signals = BTreeMap<String, f64>;

/// The raw value of a signal; `None` where the data ends before it does.
fn raw(signal: &Signal, data: &[u8]) -> Option<i64> {
    let bit = |bit: u64| data.get(bit as usize / 8).map(|byte| u64::from(byte >> (bit % 8) & 1));
    let value = match signal.byte_order {
        ByteOrder::LittleEndian => (0..signal.size).rev().try_fold(0, |v, i| Some(v << 1 | bit(signal.start_bit + i)?)),
        ByteOrder::BigEndian => {
            let first = signal.start_bit / 8 * 8 + 7 - signal.start_bit % 8;
            (first..first + signal.size).try_fold(0, |v: u64, i| Some(v << 1 | bit(i / 8 * 8 + 7 - i % 8)?))
        }
    }?;
    let unused = 64 - signal.size;
    Some(match signal.value_type {
        ValueType::Signed => (value << unused) as i64 >> unused,
        ValueType::Unsigned => value as i64,
    })
}

/// What can-dbc's reading of the file makes of a frame.
pub fn decode(dbc: &Dbc, frame: &CanFrame) -> (String, Signals) {
    let message = dbc.messages.iter().find(|m| m.id.raw() == frame.id.raw()).unwrap_or_else(|| panic!("{frame:?}"));
    // messages of CAN FD end where there is no more to say
    assert!(message.size as usize == frame.data().len() || (frame.fd && message.size as usize > frame.data().len()));
    let switch = message.signals.iter().find(|s| s.multiplexer_indicator == MultiplexIndicator::Multiplexor);
    let switch = switch.and_then(|s| raw(s, frame.data())).map(|raw| raw as u64);
    let present = message.signals.iter().filter(|s| match s.multiplexer_indicator {
        MultiplexIndicator::MultiplexedSignal(page) => Some(page) == switch,
        _ => true,
    });
    let value = |s: &Signal| Some((s.name.clone(), raw(s, frame.data())? as f64 * s.factor + s.offset));
    (message.name.clone(), present.filter_map(value).collect())
}
