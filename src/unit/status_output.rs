//! An output pin or a lamp that says whether the maps hold.
//!
//! # Model
//!
//! | state | output |
//! |---|---|
//! | ok, degraded | on: maps are sent |
//! | starting, blind | half a second on, half a second off |
//! | fault | a tenth of a second on, a tenth off |
//!
//! Whoever takes the output for more than a lamp asks for the rest as well: a board that hangs holds its
//! last level until its watchdog resets it.

use embedded_hal::digital::OutputPin;

use crate::fixed::time::Time;
use crate::wire::status::UnitState;

/// Half a period of blinking, microseconds.
const SLOW_US: u64 = 500_000;
const FAST_US: u64 = 100_000;

/// Drives the pin.
#[derive(Debug)]
pub struct StatusOutput<P> {
    pin: P,
}

/// Whether the output is on.
fn on(state: UnitState, now: Time) -> bool {
    let half = |us: u64| (now.micros() / us).is_multiple_of(2);
    match state {
        UnitState::Ok | UnitState::Degraded => true,
        UnitState::Starting | UnitState::Blind => half(SLOW_US),
        UnitState::Fault => half(FAST_US),
    }
}

impl<P: OutputPin> StatusOutput<P> {
    /// On a pin whose high level is on.
    pub fn new(pin: P) -> Self {
        Self { pin }
    }

    /// To be called at least every 50 ms.
    ///
    /// # Errors
    /// The pin's own.
    pub fn show(&mut self, state: UnitState, now: Time) -> Result<(), P::Error> {
        if on(state, now) { self.pin.set_high() } else { self.pin.set_low() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::convert::Infallible;
    use std::string::String;

    #[derive(Default)]
    struct Pin(bool);

    impl embedded_hal::digital::ErrorType for Pin {
        type Error = Infallible;
    }

    impl OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0 = false;
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0 = true;
            Ok(())
        }
    }

    /// Two seconds, a character every 50 ms.
    fn pattern(state: UnitState) -> String {
        let mut output = StatusOutput::new(Pin::default());
        let at = |k: u64| Time::from_micros(k * 50_000);
        (0..40)
            .map(|k| {
                output.show(state, at(k)).unwrap();
                if output.pin.0 { '#' } else { '.' }
            })
            .collect()
    }

    #[test]
    fn each_state_looks_different_enough() {
        assert_eq!(pattern(UnitState::Ok), "########################################");
        assert_eq!(pattern(UnitState::Degraded), pattern(UnitState::Ok), "maps are sent");
        assert_eq!(pattern(UnitState::Blind), "##########..........##########..........");
        assert_eq!(pattern(UnitState::Starting), pattern(UnitState::Blind));
        assert_eq!(pattern(UnitState::Fault), "##..##..##..##..##..##..##..##..##..##..");
    }
}
