//! A classic CAN bus: bit timing, what a board's controller offers, and how it is kept on the bus.

use crate::fixed::time::Time;
use crate::sensor::config::{ConfigError, Problem, within};
use crate::wire::frame::CanFrame;

/// A bus as the integrator knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct BusConfig {
    /// Bits per second.
    pub bit_rate: u32,
    /// Where in the bit it is sampled, thousandths.
    pub sample_point_permille: u16,
    /// Start without acknowledging or sending, until frames prove the bit rate right.
    pub listen_first: bool,
}

impl Default for BusConfig {
    /// What the ARS408 family and most vehicles use.
    fn default() -> Self {
        Self { bit_rate: 500_000, sample_point_permille: 800, listen_first: true }
    }
}

/// A bit in time quanta, synchronisation segment included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BitTiming {
    /// Clock periods to a quantum.
    pub prescaler: u16,
    /// Quanta from the synchronisation segment's end to the sample point.
    pub segment_1: u16,
    /// Quanta after the sample point.
    pub segment_2: u8,
    /// Most quanta a resynchronisation moves the sample point.
    pub jump_width: u8,
}

/// Quanta a bit may have, as every classic controller allows them.
const QUANTA: core::ops::RangeInclusive<u32> = 8..=25;

impl BusConfig {
    /// Checks the figures.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_precision_loss)] // bit rates are small
    pub fn check(&self, bus: &'static str) -> Result<(), ConfigError> {
        let [rate, point] = names(bus);
        within(rate, self.bit_rate as f32, 10_000.0, 1_000_000.0)?;
        within(point, f32::from(self.sample_point_permille), 500.0, 900.0).map(|_| ())
    }

    /// Checks that a controller clocked at `clock_hz` has a divider for the bit rate.
    ///
    /// # Errors
    /// Names the bit rate.
    #[allow(clippy::cast_precision_loss)] // bit rates are small
    pub fn check_clock(&self, bus: &'static str, clock_hz: u32) -> Result<(), ConfigError> {
        let [parameter, _] = names(bus);
        let problem = Problem::NoDivider { clock_hz };
        let refused = ConfigError { parameter, value: self.bit_rate as f32, problem };
        self.timing(clock_hz).map(|_| ()).ok_or(refused)
    }

    /// Register values for a controller clocked at `clock_hz`: the finest quantum that meets the bit
    /// rate exactly, with the sample point as near as it gets. `None` if no divider meets the rate.
    #[allow(clippy::cast_possible_truncation)] // at most 25 quanta
    pub fn timing(&self, clock_hz: u32) -> Option<BitTiming> {
        let periods = clock_hz.checked_div(self.bit_rate).filter(|p| p * self.bit_rate == clock_hz)?;
        let quanta = QUANTA.rev().find(|q| periods.is_multiple_of(*q))?;
        let sample = (quanta * u32::from(self.sample_point_permille) + 500) / 1000;
        let sample = sample.clamp(2, quanta - 1);
        let segment_2 = (quanta - sample).min(8);
        Some(BitTiming {
            prescaler: u16::try_from(periods / quanta).ok()?,
            segment_1: (quanta - segment_2 - 1) as u16,
            segment_2: segment_2 as u8,
            jump_width: segment_2.min(4) as u8,
        })
    }
}

/// Parameters of a bus.
fn names(bus: &'static str) -> [&'static str; 2] {
    match bus {
        "radar_bus" => ["radar_bus.bit_rate", "radar_bus.sample_point_permille"],
        _ => ["broadcast_bus.bit_rate", "broadcast_bus.sample_point_permille"],
    }
}

/// A polled CAN controller, as every board offers its own.
pub trait CanPort {
    /// A frame from the receive queue.
    fn receive(&mut self) -> Option<CanFrame>;
    /// Puts a frame into a mailbox; `false` if there is no room or the controller is not on the bus.
    fn send(&mut self, frame: &CanFrame) -> bool;
    /// Takes back what the mailboxes still hold.
    fn abort(&mut self);
    /// What the controller's error counters say.
    fn bus_off(&mut self) -> bool;
    /// Puts the controller on the bus, silent (neither acknowledging nor sending) or not; after a
    /// bus-off this is the way back.
    fn start(&mut self, silent: bool);
    /// When the frame that was taken last had come, where that is known.
    fn arrived(&self) -> Option<Time> {
        None
    }
    /// Frames in the mailboxes, where the controller counts them.
    fn waiting(&mut self) -> usize {
        0
    }
    /// Frames lost since the last call because the receive queue was full, where they are counted.
    fn take_lost(&mut self) -> u32 {
        0
    }
}

/// Frames that prove the bit rate right.
const PROOF: u8 = 8;
/// First and longest wait before a return to the bus, microseconds.
const BACK_OFF_US: [u64; 2] = [100_000, 5_000_000];
/// Time without another bus-off after which waiting begins anew, microseconds.
const CALM_US: u64 = 10_000_000;

/// Where a controller stands towards its bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusState {
    /// Silent, until frames prove the bit rate right; how many came.
    Listening(u8),
    /// Takes part.
    Active,
    /// Off until this time.
    Off(Time),
}

/// Keeps a controller on its bus: listens first, waits after a bus-off, longer each time, and counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusKeeper {
    listen_first: bool,
    state: BusState,
    back_off_us: u64,
    /// The last return to the bus.
    returned: Option<Time>,
    bus_off: u16,
}

impl BusKeeper {
    /// Puts the controller on the bus for the first time.
    pub fn start(config: &BusConfig, port: &mut impl CanPort) -> Self {
        let listen_first = config.listen_first;
        port.start(listen_first);
        let state = if listen_first { BusState::Listening(0) } else { BusState::Active };
        Self { listen_first, state, back_off_us: BACK_OFF_US[0], returned: None, bus_off: 0 }
    }

    /// To be called at least every 10 ms.
    pub fn poll(&mut self, now: Time, port: &mut impl CanPort) {
        match self.state {
            // a clock that stepped back does not keep it off
            BusState::Off(until) if until.since(now).is_none_or(|us| us == 0 || us > BACK_OFF_US[1]) => {
                port.start(self.listen_first);
                self.state = if self.listen_first { BusState::Listening(0) } else { BusState::Active };
                self.returned = Some(now);
            }
            BusState::Off(_) => {}
            _ if port.bus_off() => {
                // nothing old leaves when it returns
                port.abort();
                self.bus_off = self.bus_off.saturating_add(1);
                let calm = self.returned.is_some_and(|t| now.since(t).is_none_or(|us| us >= CALM_US));
                if calm {
                    self.back_off_us = BACK_OFF_US[0];
                }
                self.state = BusState::Off(Time::from_micros(now.micros().saturating_add(self.back_off_us)));
                self.back_off_us = (self.back_off_us * 2).min(BACK_OFF_US[1]);
            }
            _ => {}
        }
    }

    /// The next frame, if one came.
    pub fn receive(&mut self, port: &mut impl CanPort) -> Option<CanFrame> {
        let frame = port.receive()?;
        if let BusState::Listening(heard) = &mut self.state {
            *heard += 1;
            if *heard >= PROOF {
                port.start(false);
                self.state = BusState::Active;
            }
        }
        Some(frame)
    }

    /// Sends a frame; `false` if it could not go out now.
    pub fn send(&mut self, frame: &CanFrame, port: &mut impl CanPort) -> bool {
        self.state == BusState::Active && port.send(frame)
    }

    /// Where the controller stands.
    pub fn state(&self) -> BusState {
        self.state
    }

    /// Whether it takes part.
    pub fn is_active(&self) -> bool {
        self.state == BusState::Active
    }

    /// How often it was bus-off.
    pub fn bus_off(&self) -> u16 {
        self.bus_off
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_clocks_meet_the_usual_rates() {
        for clock_hz in [8_000_000, 16_000_000, 24_000_000, 40_000_000, 80_000_000, 100_000_000] {
            for bit_rate in [125_000, 250_000, 500_000, 1_000_000] {
                for sample_point_permille in [750, 800, 875] {
                    let t = BusConfig { bit_rate, sample_point_permille, listen_first: true }.timing(clock_hz).unwrap();
                    let quanta = 1 + u32::from(t.segment_1) + u32::from(t.segment_2);
                    assert_eq!(u32::from(t.prescaler) * quanta * bit_rate, clock_hz);
                    let point = 1000 * (1 + u32::from(t.segment_1)) / quanta;
                    assert!(point.abs_diff(u32::from(sample_point_permille)) <= 65, "{clock_hz} {bit_rate} {point}");
                    assert!(t.jump_width <= t.segment_2 && t.segment_2 <= 8 && t.segment_1 <= 16 + 8);
                }
            }
        }
    }

    #[test]
    fn a_rate_no_divider_meets_is_refused() {
        assert_eq!(BusConfig { bit_rate: 333_333, ..BusConfig::default() }.timing(8_000_000), None);
        assert_eq!(BusConfig { bit_rate: 0, ..BusConfig::default() }.timing(8_000_000), None);
        let odd = BusConfig { bit_rate: 333_333, ..BusConfig::default() };
        let refused = odd.check_clock("broadcast_bus", 8_000_000).unwrap_err();
        assert_eq!(
            std::string::ToString::to_string(&refused),
            "broadcast_bus.bit_rate is 333333, which no divider of 8000000 Hz meets"
        );
        assert_eq!(odd.check_clock("radar_bus", 333_333 * 8), Ok(()));
        let wrong = BusConfig { bit_rate: 2_000_000, ..BusConfig::default() };
        assert_eq!(wrong.check("radar_bus").unwrap_err().parameter, "radar_bus.bit_rate");
    }

    #[derive(Default)]
    struct Port {
        frames: u32,
        off: bool,
        silent: bool,
        starts: u32,
        aborted: u32,
        sent: u32,
    }

    impl CanPort for Port {
        fn receive(&mut self) -> Option<CanFrame> {
            self.frames = self.frames.checked_sub(1)?;
            CanFrame::classic(crate::wire::frame::CanId::Standard(1), &[])
        }

        fn send(&mut self, _: &CanFrame) -> bool {
            assert!(!self.silent && !self.off, "a silent controller does not send");
            self.sent += 1;
            true
        }

        fn abort(&mut self) {
            self.aborted += 1;
        }

        fn bus_off(&mut self) -> bool {
            self.off
        }

        fn start(&mut self, silent: bool) {
            (self.silent, self.off) = (silent, false);
            self.starts += 1;
        }
    }

    fn at(ms: u64) -> Time {
        Time::from_micros(ms * 1000)
    }

    #[test]
    fn it_listens_until_frames_prove_the_bit_rate() {
        let mut port = Port { frames: 8, ..Port::default() };
        let frame = CanFrame::classic(crate::wire::frame::CanId::Standard(1), &[]).unwrap();
        let mut keeper = BusKeeper::start(&BusConfig::default(), &mut port);
        for heard in 0..8 {
            assert_eq!(keeper.state(), BusState::Listening(heard));
            assert!(port.silent && !keeper.send(&frame, &mut port));
            assert!(keeper.receive(&mut port).is_some());
        }
        assert!(!port.silent && keeper.send(&frame, &mut port));
        assert_eq!((keeper.state(), port.sent), (BusState::Active, 1));
    }

    #[test]
    fn after_a_bus_off_it_waits_longer_each_time_and_old_frames_are_gone() {
        let mut port = Port::default();
        let mut keeper = BusKeeper::start(&BusConfig { listen_first: false, ..BusConfig::default() }, &mut port);
        let (mut now, mut waits) = (0, std::vec::Vec::new());
        for _ in 0..8 {
            port.off = true;
            keeper.poll(at(now), &mut port);
            let (went, starts) = (now, port.starts);
            while port.starts == starts {
                now += 10;
                keeper.poll(at(now), &mut port);
            }
            waits.push(now - went);
        }
        assert_eq!(waits, [100, 200, 400, 800, 1600, 3200, 5000, 5000]);
        assert_eq!((keeper.bus_off(), port.aborted), (8, 8));
        // after ten calm seconds it begins anew
        now += 10_000;
        port.off = true;
        keeper.poll(at(now), &mut port);
        assert_eq!(keeper.state(), BusState::Off(at(now + 100)));
        // and a clock that steps back does not keep it off
        keeper.poll(at(0), &mut port);
        assert_eq!(keeper.state(), BusState::Active);
    }
}
