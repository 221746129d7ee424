//! The motion of what carries a sensor, which it expects; a fixed one has to receive that it stands.
//!
//! Without these messages [`RadarState`](super::state::RadarState) reports them missing and the
//! sensor's own classes of motion are wrong.

use super::message::Message;
use crate::inputs::signal::{Signal, word};
use crate::wire::frame::CanFrame;

/// Speed, 0.02 m/s.
pub const SPEED: Signal = Signal::new(4, 13);
/// Direction of the speed: 0 standstill, 1 forward, 2 backward.
pub const DIRECTION: Signal = Signal::new(7, 2);
/// Yaw rate, 0.01 degrees a second, 0x8000 being none.
pub const YAW_RATE: Signal = Signal::new(7, 16);

/// Speed and yaw rate of a sensor that does not move, to be sent ten to twenty times a second.
pub fn standing(sensor: u8) -> impl Iterator<Item = CanFrame> {
    let frames = [(Message::Speed, [0x00, 0x00]), (Message::YawRate, [0x80, 0x00])];
    frames.into_iter().filter_map(move |(message, bytes)| CanFrame::classic(message.id(sensor), &bytes))
}

/// Speed in cm/s, negative backward, out of the frame's data.
#[allow(clippy::cast_possible_wrap)] // 13 bits
pub fn speed_cm_s(data: &[u8]) -> i32 {
    let word = word(data);
    let speed = 2 * SPEED.get(word) as i32;
    match DIRECTION.get(word) {
        2 => -speed,
        _ => speed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;
    use std::vec::Vec;

    #[test]
    fn a_standing_sensor_is_told_so() {
        let sent: Vec<_> = standing(0).map(|f| format!("{f:?}")).collect();
        assert_eq!(sent, ["300#0000", "301#8000"]);
        let sent: Vec<_> = standing(3).map(|f| format!("{f:?}")).collect();
        assert_eq!(sent, ["330#0000", "331#8000"]);
        assert!(standing(0).all(|f| speed_cm_s(f.data()) == 0));
    }

    #[test]
    fn speeds_have_signs() {
        assert_eq!(speed_cm_s(&[0x40 | 0x03, 0xE8]), 2000, "forward");
        assert_eq!(speed_cm_s(&[0x80 | 0x03, 0xE8]), -2000, "backward");
    }
}
