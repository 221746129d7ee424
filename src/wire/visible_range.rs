//! The guaranteed visible range per azimuth, rounded down: the message a DBC can describe.
//!
//! # Model
//! For each azimuth the end of the first visible stretch, if that begins where the field of view
//! does; else 0. The scan's number, the first azimuth, then one byte an azimuth, 2 m a step: 4
//! azimuths in a classic message, up to 56 in a long one. Azimuths beyond the last are 0.
//!
//! A consumer takes an azimuth's range for as long as it trusts a map's age, counted from the scan's
//! number, and 0 after that.

use super::code::ray::Ray;
use super::message::{CLASSIC_BYTES, LONG_BYTES};
use super::scan_number::ScanNumber;

/// Length of a step, centimetres.
pub const STEP_CM: u32 = 200;

/// Azimuths of a classic message.
pub const CLASSIC_AZIMUTHS: usize = CLASSIC_BYTES - 2;

/// Azimuths of a long message.
pub const LONG_AZIMUTHS: usize = LONG_BYTES - 2;

/// The guaranteed visible range of an azimuth, in steps, rounded down; at most 510 m.
#[allow(clippy::cast_possible_truncation)] // bounded
pub fn steps<const W: usize>(ray: &Ray<W>, cell_cm: u16) -> u8 {
    let end_cm = ray.clear_to() as u32 * u32::from(cell_cm);
    (end_cm / STEP_CM).min(255) as u8
}

/// Own bytes of a message, and how many they are.
#[allow(clippy::cast_possible_truncation)] // 128 azimuths
pub fn emit(scan: ScanNumber, first: usize, steps: impl Iterator<Item = u8>) -> ([u8; LONG_BYTES], usize) {
    let mut own = [0; LONG_BYTES];
    let mut length = 0;
    for (to, from) in own.iter_mut().zip([scan.byte(), first as u8].into_iter().chain(steps)) {
        *to = from;
        length += 1;
    }
    (own, length)
}

/// Ranges of consecutive azimuths in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ranges<'a> {
    /// Number of the scan.
    pub scan: ScanNumber,
    /// First azimuth.
    pub first: u8,
    /// Steps of the azimuths from the first on.
    pub steps: &'a [u8],
}

impl<'a> Ranges<'a> {
    /// From a message's own bytes; `None` if they are too few.
    pub fn parse(own: &'a [u8]) -> Option<Self> {
        match own {
            [scan, first, steps @ ..] if !steps.is_empty() => {
                Some(Self { scan: ScanNumber::from_byte(*scan), first: *first, steps })
            }
            _ => None,
        }
    }

    /// The range of an azimuth in metres, if it is in this message.
    pub fn metres(&self, azimuth: u8) -> Option<u16> {
        let place = azimuth.checked_sub(self.first)?;
        self.steps.get(usize::from(place)).map(|steps| u16::from(*steps) * 2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::code::ray::Known;
    use super::*;
    use crate::fixed::bits::Bits;

    #[test]
    fn the_range_ends_at_the_first_blocked_cell_and_is_rounded_down() {
        let mut bits = Bits::<7>::span(10, 57);
        bits.set(60);
        let ray = Ray::new(Known::new(10, 200), bits);
        assert_eq!(steps(&ray, 100), 28, "56 m of 57");
        assert_eq!(steps(&Ray::<7>::clear(Known::new(10, 200)), 250), 250);
        assert_eq!(steps(&Ray::<8>::clear(Known::new(0, 256)), 400), 255, "510 m at most");
        let blocked_at_once = Ray::new(Known::new(9, 200), bits);
        assert_eq!((steps(&blocked_at_once, 100), steps(&Ray::<7>::UNKNOWN, 100)), (0, 0));
    }

    #[test]
    fn a_message_is_these_bytes() {
        let (own, length) = emit(ScanNumber::from_byte(0x21), 40, [0, 100, 99, 255].into_iter());
        assert_eq!(own[..length], [0x21, 40, 0, 100, 99, 255]);
        let ranges = Ranges::parse(&own[..length]).unwrap();
        assert_eq!((ranges.scan.byte(), ranges.metres(41), ranges.metres(43)), (0x21, Some(200), Some(510)));
        assert_eq!((ranges.metres(39), ranges.metres(44)), (None, None));
        assert_eq!(Ranges::parse(&[1, 2]), None);
    }
}
