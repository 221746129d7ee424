//! How the sender is: state, reasons, counters; at least twice a second, also when faulty.
//!
//! # Model
//! Six pages of four bytes. State and reason stand in every message; a long message carries all
//! pages one after another, a classic one carries one. All numbers are big-endian.
//!
//! | page | bytes |
//! |---|---|
//! | 0 | uptime, s |
//! | 1 | firmware version: major, minor, patch; wire version |
//! | 2 | fingerprint of the configuration |
//! | 3 | radar frames lost, 2 bytes; azimuths of maps dropped on sending, 2 bytes |
//! | 4 | frames received with failed protection, 2 bytes; times bus-off, 2 bytes |
//! | 5 | cause of the last reset, 1 byte; how long the last frame took and the longest since the start, 12 bits each, 0.1 ms |
//!
//! Counters stay at their largest value. A time is rounded up; 0: not measured; 4095: 409.5 ms or more.

use super::message::{CLASSIC_BYTES, WIRE_VERSION};

/// Pages of a status.
pub const PAGES: u8 = 6;

/// Own bytes of a long status.
pub const LONG: usize = 2 + 4 * PAGES as usize;

/// What the sender's maps are worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UnitState {
    /// No map yet.
    #[default]
    Starting,
    /// Maps are sent.
    Ok,
    /// The radar is blind: maps say unknown.
    Blind,
    /// Maps are sent, but something is not as it should be.
    Degraded,
    /// No maps.
    Fault,
}

/// Why a state is not ok.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// None.
    #[default]
    None,
    /// The radar sends nothing.
    RadarSilent,
    /// The radar reports a fault of its own.
    RadarFault,
    /// The radar is not configured as it should be.
    RadarConfiguration,
    /// Scans arrive incomplete.
    IncompleteScans,
    /// The configuration block cannot be used.
    Configuration,
    /// A clock stepped.
    ClockStepped,
    /// The bus takes fewer frames than there are.
    BusOverload,
    /// The controller was bus-off.
    BusOff,
    /// The time of a frame was exceeded.
    Overrun,
    /// Points keep coming, but none that can be used: not finite, all outside the field of view, or nearly all too weak, too fast
    /// or left out by the radar's own marks.
    UnusablePoints,
    /// Other sensors see what it should see, or what stands there is not seen any more: a part of its maps is unknown.
    SectorBlind,
    /// The mount is turned or tilted, or is not as it was configured: maps lie beside what they show.
    Misaligned,
    /// It sees less of what stands there, or sees it weaker, than it did: dirt, snow.
    Weaker,
    /// The table of probabilities that was given is not used: maps are by grades.
    NoProbabilities,
    /// Since a start or gap lines of sight were not yet looked along for long enough: what is behind is unknown.
    Settling,
    /// A number given by the integrator, or by a later version.
    Other(u8),
}

impl Reason {
    /// The reason's number.
    pub const fn number(self) -> u8 {
        match self {
            Self::None => 0,
            Self::RadarSilent => 1,
            Self::RadarFault => 2,
            Self::RadarConfiguration => 3,
            Self::IncompleteScans => 4,
            Self::Configuration => 5,
            Self::ClockStepped => 6,
            Self::BusOverload => 7,
            Self::BusOff => 8,
            Self::Overrun => 9,
            Self::UnusablePoints => 10,
            Self::SectorBlind => 11,
            Self::Misaligned => 12,
            Self::Weaker => 13,
            Self::NoProbabilities => 14,
            Self::Settling => 15,
            Self::Other(number) => number,
        }
    }

    /// The reason of a number.
    pub const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::None,
            1 => Self::RadarSilent,
            2 => Self::RadarFault,
            3 => Self::RadarConfiguration,
            4 => Self::IncompleteScans,
            5 => Self::Configuration,
            6 => Self::ClockStepped,
            7 => Self::BusOverload,
            8 => Self::BusOff,
            9 => Self::Overrun,
            10 => Self::UnusablePoints,
            11 => Self::SectorBlind,
            12 => Self::Misaligned,
            13 => Self::Weaker,
            14 => Self::NoProbabilities,
            15 => Self::Settling,
            other => Self::Other(other),
        }
    }
}

/// Why the sender last started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// Not given.
    #[default]
    Unknown,
    /// Power came.
    PowerOn,
    /// The reset pin.
    External,
    /// Asked for, as after a change of configuration.
    Software,
    /// The watchdog.
    Watchdog,
    /// The supply fell too low.
    BrownOut,
    /// A panic or a processor fault.
    Crash,
    /// A number of a later version.
    Other(u8),
}

impl ResetCause {
    /// The cause's number.
    pub const fn number(self) -> u8 {
        match self {
            Self::Unknown => 0,
            Self::PowerOn => 1,
            Self::External => 2,
            Self::Software => 3,
            Self::Watchdog => 4,
            Self::BrownOut => 5,
            Self::Crash => 6,
            Self::Other(number) => number,
        }
    }

    /// The cause of a number.
    pub const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::Unknown,
            1 => Self::PowerOn,
            2 => Self::External,
            3 => Self::Software,
            4 => Self::Watchdog,
            5 => Self::BrownOut,
            6 => Self::Crash,
            other => Self::Other(other),
        }
    }
}

/// The whole status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// What the maps are worth.
    pub state: UnitState,
    /// Why not more.
    pub reason: Reason,
    /// Why the sender last started.
    pub reset_cause: ResetCause,
    /// Since the start, seconds.
    pub uptime_s: u32,
    /// Major, minor, patch.
    pub firmware: [u8; 3],
    /// Wire version.
    pub wire_version: u8,
    /// Fingerprint of the configuration.
    pub fingerprint: u32,
    /// Radar frames lost.
    pub radar_lost: u16,
    /// Azimuths of maps dropped on sending.
    pub dropped: u16,
    /// Frames received with failed protection.
    pub e2e_errors: u16,
    /// Times the controller was bus-off.
    pub bus_off: u16,
    /// How long it worked on the last frame and on the longest since the start.
    pub frame_times: [FrameTime; 2],
}

/// How long the sender worked on a frame, in steps of 0.1 ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameTime(u16);

impl FrameTime {
    /// The longest that can be said; what takes longer is said so.
    pub const MOST: Self = Self(0xFFF);

    /// Counts of a clock of so many counts a second, rounded up, so that no frame takes no time.
    pub fn of(counts: u32, hz: u32) -> Self {
        let steps = (u64::from(counts) * 10_000).div_ceil(u64::from(hz.max(1)));
        u16::try_from(steps.max(1)).map_or(Self::MOST, |steps| Self(steps).min(Self::MOST))
    }

    /// Tenths of a millisecond; none if it is not measured.
    pub const fn tenths_of_ms(self) -> Option<u16> {
        match self.0 {
            0 => None,
            steps => Some(steps),
        }
    }
}

/// Why bytes are no status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotAStatus {
    /// Bytes are missing.
    TooShort,
    /// A state that does not exist.
    State {
        /// Its number.
        state: u8,
    },
}

impl Status {
    /// A status before anything is known.
    pub const fn starting(fingerprint: u32) -> Self {
        Self {
            state: UnitState::Starting,
            reason: Reason::None,
            reset_cause: ResetCause::Unknown,
            uptime_s: 0,
            firmware: [0; 3],
            wire_version: WIRE_VERSION,
            fingerprint,
            radar_lost: 0,
            dropped: 0,
            e2e_errors: 0,
            bus_off: 0,
            frame_times: [FrameTime(0); 2],
        }
    }

    fn page(&self, page: u8) -> [u8; 4] {
        let pair = |a: u16, b: u16| (u32::from(a) << 16 | u32::from(b)).to_be_bytes();
        let [major, minor, patch] = self.firmware;
        match page {
            0 => self.uptime_s.to_be_bytes(),
            1 => [major, minor, patch, self.wire_version],
            2 => self.fingerprint.to_be_bytes(),
            3 => pair(self.radar_lost, self.dropped),
            4 => pair(self.e2e_errors, self.bus_off),
            _ => {
                let [last, longest] = self.frame_times.map(|FrameTime(steps)| u32::from(steps));
                (u32::from(self.reset_cause.number()) << 24 | last << 12 | longest).to_be_bytes()
            }
        }
    }

    fn take_page(&mut self, page: u8, bytes: [u8; 4]) {
        let [a, b, c, d] = bytes;
        let pair = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
        match page {
            0 => self.uptime_s = u32::from_be_bytes(bytes),
            1 => (self.firmware, self.wire_version) = ([a, b, c], d),
            2 => self.fingerprint = u32::from_be_bytes(bytes),
            3 => (self.radar_lost, self.dropped) = pair,
            4 => (self.e2e_errors, self.bus_off) = pair,
            5 => {
                self.reset_cause = ResetCause::from_number(a);
                let (last, longest) = (u16::from_be_bytes([b, c]) >> 4, u16::from_be_bytes([c, d]) & 0xFFF);
                self.frame_times = [FrameTime(last), FrameTime(longest)];
            }
            // of a later version
            _ => {}
        }
    }

    /// Own bytes of the classic message that carries a page, 0 to 5.
    pub fn emit_page(&self, page: u8) -> [u8; CLASSIC_BYTES] {
        let [a, b, c, d] = self.page(page);
        [page << 4 | self.state as u8, self.reason.number(), a, b, c, d]
    }

    /// Own bytes of a long message.
    pub fn emit(&self) -> [u8; LONG] {
        let mut bytes = [0; LONG];
        let pages = (0..PAGES).flat_map(|page| self.page(page));
        let all = [self.state as u8, self.reason.number()].into_iter().chain(pages);
        bytes.iter_mut().zip(all).for_each(|(to, from)| *to = from);
        bytes
    }

    /// Takes a message's own bytes: one page, or all of them. Of a page that is not known only state and reason.
    ///
    /// # Errors
    /// Bytes missing, or a state that does not exist.
    pub fn take(&mut self, own: &[u8]) -> Result<(), NotAStatus> {
        let [first, reason, pages @ ..] = own else { return Err(NotAStatus::TooShort) };
        let state = match first & 0x0F {
            0 => UnitState::Starting,
            1 => UnitState::Ok,
            2 => UnitState::Blind,
            3 => UnitState::Degraded,
            4 => UnitState::Fault,
            state => return Err(NotAStatus::State { state }),
        };
        let (chunks, _) = pages.as_chunks::<4>();
        let mut new = Self { state, reason: Reason::from_number(*reason), ..*self };
        match chunks {
            [] => return Err(NotAStatus::TooShort),
            [page] => new.take_page(first >> 4, *page),
            pages if pages.len() >= usize::from(PAGES) => {
                (0..PAGES).zip(pages).for_each(|(number, page)| new.take_page(number, *page));
            }
            _ => return Err(NotAStatus::TooShort),
        }
        *self = new;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATUS: Status = Status {
        state: UnitState::Blind,
        reason: Reason::RadarSilent,
        reset_cause: ResetCause::Watchdog,
        uptime_s: 0x0102_0304,
        firmware: [1, 2, 3],
        wire_version: 1,
        fingerprint: 0xCAFE_F00D,
        radar_lost: 0x1122,
        dropped: 0x3344,
        e2e_errors: 0x5566,
        bus_off: 7,
        frame_times: [FrameTime(0x123), FrameTime(0x456)],
    };

    #[test]
    fn the_long_status_is_these_bytes() {
        let expected = [
            2, 1, 1, 2, 3, 4, 1, 2, 3, 1, 0xCA, 0xFE, 0xF0, 0x0D, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0, 7, 4, 0x12,
            0x34, 0x56,
        ];
        assert_eq!(STATUS.emit(), expected);
        let mut got = Status::starting(0);
        got.take(&expected).unwrap();
        assert_eq!(got, STATUS);
    }

    #[test]
    fn a_time_is_rounded_up_and_ends_at_the_greatest() {
        let tenths = |counts, hz| FrameTime::of(counts, hz).tenths_of_ms();
        assert_eq!(tenths(480_000, 480_000_000), Some(10));
        assert_eq!(tenths(480_001, 480_000_000), Some(11));
        assert_eq!(tenths(0, 480_000_000), Some(1), "0 means that it is not measured");
        assert_eq!(tenths(u32::MAX, 1_000), Some(4095));
        assert_eq!(tenths(1, 0), Some(4095), "a clock that stands");
        assert_eq!(FrameTime::default().tenths_of_ms(), None);
    }

    #[test]
    fn pages_add_up_to_the_status() {
        assert_eq!(STATUS.emit_page(3), [0x32, 1, 0x11, 0x22, 0x33, 0x44]);
        let mut got = Status::starting(0);
        for page in 0..6 {
            got.take(&STATUS.emit_page(page)).unwrap();
            assert_eq!((got.state, got.reason), (UnitState::Blind, Reason::RadarSilent), "in every page");
        }
        assert_eq!(got, STATUS);
    }

    #[test]
    fn of_a_page_of_a_later_version_state_and_reason_count() {
        let mut got = STATUS;
        assert_eq!(got.take(&[0x63, 99, 1, 2, 3, 4]), Ok(()));
        assert_eq!(got, Status { state: UnitState::Degraded, reason: Reason::Other(99), ..STATUS });
    }

    #[test]
    fn what_is_no_status_changes_nothing() {
        let mut got = STATUS;
        assert_eq!(got.take(&[0x05, 0, 0, 0, 0, 0]), Err(NotAStatus::State { state: 5 }));
        assert_eq!(got.take(&[0x00, 0, 1]), Err(NotAStatus::TooShort));
        assert_eq!(got.take(&[0x00, 0, 1, 2, 3, 4, 5, 6, 7, 8]), Err(NotAStatus::TooShort));
        assert_eq!(got, STATUS);
        for number in 0..=255 {
            assert_eq!(Reason::from_number(number).number(), number);
            assert_eq!(ResetCause::from_number(number).number(), number);
        }
    }
}
