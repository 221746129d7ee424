//! End-to-end protection by AUTOSAR's profiles 11 (8 bytes) and 05 (CAN FD, serial).
//!
//! # Model
//! Profile 11, variant A: byte 0 is a CRC-8 (polynomial 0x1D, start 0) over the data ID, low byte
//! first, and bytes 1 to the end; the low nibble of byte 1 counts 0 to 14. Profile 05: bytes 0 and 1
//! are a CRC-16 (polynomial 0x1021, start 0xFFFF), low byte first, over bytes 2 to the end and the
//! data ID, low byte first; byte 2 counts 0 to 255. The data ID is not sent: a message taken for
//! another fails its check.
//!
//! # Limits
//! In 8-byte frames profile 11 finds all errors of one or two bits and all bursts up to 7 bits; of
//! the 41 664 patterns of three bits 198 pass, of arbitrary content one frame in 256. Profile 05
//! finds all errors up to three bits in 64 bytes and all bursts up to 13; of arbitrary content one
//! frame in 65 536 passes.
//!
//! # References
//! AUTOSAR, Specification of E2E Protocol (PRS), profiles 11 and 05; the vectors in the tests.

use crc::Crc;

static CRC_8: Crc<u8> = Crc::<u8>::new(&crc::CRC_8_GSM_A);
static CRC_16: Crc<u16> = Crc::<u16>::new(&crc::CRC_16_IBM_3740);

/// Why a frame is not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum E2eError {
    /// Too short to hold check sum and counter.
    TooShort {
        /// Bytes there are.
        length: usize,
    },
    /// The check sum does not fit data and data ID.
    Check,
}

/// Which profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Profile {
    /// 8-byte frames.
    P11,
    /// Longer ones.
    P05,
}

impl Profile {
    /// Numbers the counter takes before it starts over.
    pub const fn counter_period(self) -> u16 {
        match self {
            Self::P11 => 15,
            Self::P05 => 256,
        }
    }

    /// The counter after this one.
    #[allow(clippy::cast_possible_truncation)] // below the period
    pub const fn next(self, counter: u8) -> u8 {
        ((counter as u16 + 1) % self.counter_period()) as u8
    }

    /// Writes counter and check sum into a message; nothing if it is too short to hold them.
    pub fn protect(self, message: &mut [u8], data_id: u16, counter: u8) {
        match self {
            Self::P11 => {
                if let Some(byte) = message.get_mut(1) {
                    *byte = (*byte & 0xF0) | (counter % 15);
                }
                let sum = check_p11(message, data_id);
                if let Some(byte) = message.first_mut() {
                    *byte = sum;
                }
            }
            Self::P05 => {
                if let Some(byte) = message.get_mut(2) {
                    *byte = counter;
                }
                let sum = check_p05(message, data_id).to_le_bytes();
                if let Some(bytes) = message.first_chunk_mut() {
                    *bytes = sum;
                }
            }
        }
    }

    /// Checks a message and gives its counter.
    ///
    /// # Errors
    /// A message too short, or a check sum that does not fit.
    pub fn check(self, message: &[u8], data_id: u16) -> Result<u8, E2eError> {
        let short = E2eError::TooShort { length: message.len() };
        let (fits, counter) = match (self, message) {
            (Self::P11, [sum, counter, ..]) => (*sum == check_p11(message, data_id), counter & 0x0F),
            (Self::P05, [low, high, counter, ..]) => {
                (u16::from_le_bytes([*low, *high]) == check_p05(message, data_id), *counter)
            }
            _ => return Err(short),
        };
        // profile 11 knows no counter 15
        if fits && u16::from(counter) < self.counter_period() { Ok(counter) } else { Err(E2eError::Check) }
    }
}

/// The check sum of profile 11 for a message.
fn check_p11(message: &[u8], data_id: u16) -> u8 {
    let mut sum = CRC_8.digest();
    sum.update(&data_id.to_le_bytes());
    sum.update(message.get(1..).unwrap_or(&[]));
    sum.finalize()
}

/// The check sum of profile 05 for a message.
fn check_p05(message: &[u8], data_id: u16) -> u16 {
    let mut sum = CRC_16.digest();
    sum.update(message.get(2..).unwrap_or(&[]));
    sum.update(&data_id.to_le_bytes());
    sum.finalize()
}

/// How a message follows the one before of the same data ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sequence {
    /// The next one, or the first.
    Ok,
    /// Some were lost, not more than allowed.
    SomeLost {
        /// How many, if it was not a multiple of the counter's period more.
        lost: u8,
    },
    /// The same counter again.
    Repeated,
    /// A gap that is not allowed.
    Wrong,
}

/// Follows the counters of one data ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counter {
    /// The counter before, plus one; 0 before the first.
    last: u16,
}

impl Counter {
    /// Before the first message.
    pub const NEW: Self = Self { last: 0 };

    /// Takes note of a checked message's counter. A step of at most `max_step` is in sequence.
    pub fn follow(&mut self, profile: Profile, counter: u8, max_step: u8) -> Sequence {
        let before = self.last.checked_sub(1);
        self.last = u16::from(counter) + 1;
        let Some(before) = before else { return Sequence::Ok };
        let period = profile.counter_period();
        let step = (u16::from(counter) + period - before % period) % period;
        match u8::try_from(step) {
            Ok(0) => Sequence::Repeated,
            Ok(1) => Sequence::Ok,
            Ok(step) if step <= max_step => Sequence::SomeLost { lost: step - 1 },
            _ => Sequence::Wrong,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_11_has_the_published_check_sums() {
        for (counter, expected) in [(0, [0xCC, 0x00]), (1, [0x91, 0x01])] {
            let mut message = [0; 8];
            Profile::P11.protect(&mut message, 0x123, counter);
            assert_eq!(message[..2], expected);
            assert_eq!(Profile::P11.check(&message, 0x123), Ok(counter));
            assert_eq!(Profile::P11.check(&message, 0x124), Err(E2eError::Check), "another message's data ID");
        }
    }

    #[test]
    fn profile_05_has_the_published_check_sums() {
        for (counter, expected) in [(0, [0x1C, 0xCA, 0x00]), (1, [0xCF, 0x8D, 0x01])] {
            let mut message = [0; 8];
            Profile::P05.protect(&mut message, 0x1234, counter);
            assert_eq!(message[..3], expected);
            assert_eq!(Profile::P05.check(&message, 0x1234), Ok(counter));
        }
    }

    #[test]
    fn the_upper_nibble_of_byte_1_is_the_messages_own() {
        let mut message = [0, 0xA0, 1, 2, 3, 4, 5, 6];
        Profile::P11.protect(&mut message, 0x123, 7);
        assert_eq!(message[1], 0xA7);
    }

    #[test]
    fn short_messages_and_impossible_counters_are_refused() {
        assert_eq!(Profile::P11.check(&[0], 0), Err(E2eError::TooShort { length: 1 }));
        assert_eq!(Profile::P05.check(&[0, 0], 0), Err(E2eError::TooShort { length: 2 }));
        Profile::P05.protect(&mut [0], 0, 0);
        let mut message = [0, 0x0F, 0, 0];
        message[0] = check_p11(&message, 5);
        assert_eq!(Profile::P11.check(&message, 5), Err(E2eError::Check));
    }

    #[test]
    fn sequences_are_judged_by_the_step_of_the_counter() {
        let mut counter = Counter::NEW;
        let mut follow = |c| counter.follow(Profile::P11, c, 3);
        assert_eq!(follow(13), Sequence::Ok);
        assert_eq!(follow(14), Sequence::Ok);
        assert_eq!(follow(0), Sequence::Ok, "15 is no counter");
        assert_eq!(follow(0), Sequence::Repeated);
        assert_eq!(follow(3), Sequence::SomeLost { lost: 2 });
        assert_eq!(follow(7), Sequence::Wrong);
        let mut counter = Counter::NEW;
        assert_eq!(counter.follow(Profile::P05, 255, 1), Sequence::Ok);
        assert_eq!(counter.follow(Profile::P05, 0, 1), Sequence::Ok);
    }
}
