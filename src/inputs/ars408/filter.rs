//! Limits on what a sensor sends, set inside the sensor.

use super::message::Message;
use crate::inputs::signal::Signal;
use crate::wire::frame::CanFrame;

/// Fields of the message.
pub mod field {
    use super::Signal;

    /// Of clusters or of objects.
    pub const OBJECTS: Signal = Signal::new(7, 1);
    /// Which quantity.
    pub const INDEX: Signal = Signal::new(6, 4);
    /// Switched on.
    pub const ACTIVE: Signal = Signal::new(2, 1);
    /// Makes the message count.
    pub const VALID: Signal = Signal::new(1, 1);
    /// Lower limit.
    pub const MIN: Signal = Signal::new(11, 12);
    /// Upper limit.
    pub const MAX: Signal = Signal::new(27, 12);
    /// Lower limit of the distance to the front.
    pub const FRONT_MIN: Signal = Signal::new(12, 13);
    /// Upper limit of it.
    pub const FRONT_MAX: Signal = Signal::new(28, 13);
}

/// What is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Limited {
    /// How many are sent.
    Number = 0,
    /// Distance, metres.
    Distance = 1,
    /// Azimuth, degrees, + left.
    Azimuth = 2,
    /// Speed of what comes nearer, m/s.
    Approaching = 3,
    /// Speed of what moves away, m/s.
    Receding = 4,
    /// Radar cross-section, dBsm.
    Rcs = 5,
    /// How long an object has been tracked, seconds.
    Lifetime = 6,
    /// Size of an object, m².
    Size = 7,
    /// Class of the probability that an object exists.
    Existence = 8,
    /// Distance to the left, metres.
    Left = 9,
    /// Distance to the front, metres.
    Front = 10,
    /// Speed to the left, m/s.
    LeftSpeed = 11,
    /// Speed against the boresight, m/s.
    OncomingSpeed = 12,
    /// Speed to the right, m/s.
    RightSpeed = 13,
    /// Speed along the boresight, m/s.
    DepartingSpeed = 14,
}

impl Limited {
    /// One step in millionths of the unit, and what zero stands for in thousandths.
    const fn scale(self) -> (i64, i64) {
        match self {
            Self::Number | Self::Existence => (1_000_000, 0),
            Self::Distance | Self::Lifetime => (100_000, 0),
            Self::Azimuth | Self::Rcs => (25_000, -50_000),
            Self::Size => (25_000, 0),
            Self::Left => (200_000, -409_500),
            Self::Front => (200_000, -500_000),
            Self::Approaching
            | Self::Receding
            | Self::LeftSpeed
            | Self::OncomingSpeed
            | Self::RightSpeed
            | Self::DepartingSpeed => (31_500, 0),
        }
    }
}

/// A limit on what is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Filter {
    /// Of objects rather than clusters.
    pub objects: bool,
    /// Switched on.
    pub active: bool,
    /// What is limited.
    pub limited: Limited,
    /// Smallest value sent, thousandths of the unit.
    pub min_milli: i32,
    /// Largest value sent, thousandths of the unit.
    pub max_milli: i32,
}

impl Filter {
    /// The message's bytes; limits that do not fit are cut to the largest or smallest that does.
    pub fn bytes(&self) -> [u8; 5] {
        let (min, max) = match self.limited {
            Limited::Front => (field::FRONT_MIN, field::FRONT_MAX),
            _ => (field::MIN, field::MAX),
        };
        let (lsb_micro, offset_milli) = self.limited.scale();
        let raw = |milli: i32, signal: Signal| {
            let largest = (1_i64 << signal.length()) - 1;
            let steps = ((i64::from(milli) - offset_milli) * 1000 + lsb_micro / 2).div_euclid(lsb_micro);
            u32::try_from(steps.clamp(0, largest)).unwrap_or(0)
        };
        let fields = [
            (field::OBJECTS, u32::from(self.objects)),
            (field::INDEX, self.limited as u32),
            (field::ACTIVE, u32::from(self.active)),
            (field::VALID, 1),
            (min, raw(self.min_milli, min)),
            (max, raw(self.max_milli, max)),
        ];
        let [b0, b1, b2, b3, b4, ..] = fields.into_iter().fold(0, |word, (s, v)| s.put(word, v)).to_be_bytes();
        [b0, b1, b2, b3, b4]
    }

    /// The frame for a sensor; always there.
    pub fn frame(&self, sensor: u8) -> Option<CanFrame> {
        CanFrame::classic(Message::FilterConfiguration.id(sensor), &self.bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    fn frame(objects: bool, limited: Limited, min_milli: i32, max_milli: i32) -> std::string::String {
        let filter = Filter { objects, active: true, limited, min_milli, max_milli };
        format!("{:?}", filter.frame(1).unwrap())
    }

    #[test]
    fn limits_have_their_scales() {
        // 0 to 150 m: 1500 = 0x5DC
        assert_eq!(frame(false, Limited::Distance, 0, 150_000), "212#0E000005DC");
        // -45 to 45 degrees: 200 and 3800
        assert_eq!(frame(true, Limited::Azimuth, -45_000, 45_000), "212#9600C80ED8");
        // at least -10 dBsm: 1600 = 0x640, to 52.375
        assert_eq!(frame(false, Limited::Rcs, -10_000, 52_375), "212#2E06400FFF");
        // 13 bits: -100 to 500 m, 2000 = 0x7D0 and 5000 = 0x1388
        assert_eq!(frame(false, Limited::Front, -100_000, 500_000), "212#5607D01388");
        // 25.2 m/s: 800 = 0x320
        assert_eq!(frame(true, Limited::DepartingSpeed, 0, 25_200), "212#F600000320");
    }

    #[test]
    fn what_does_not_fit_is_cut() {
        assert_eq!(frame(false, Limited::Distance, -5, i32::MAX), "212#0E00000FFF");
        assert_eq!(frame(false, Limited::Left, i32::MIN, 0), "212#4E00000800");
    }
}
