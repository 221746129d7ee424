//! What a unit says of itself, with or without a configuration: which program on which board, and which one of many.

use crate::fixed::bytes::Reader;
use crate::wire::header::fingerprint;

/// The program on a board, and the chip it runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity {
    /// The board's name as its folder has it; its first 24 letters are sent.
    pub board: &'static str,
    /// Number of the chip among others of its kind, a check sum over the longer one it was made with; 0 where it has none.
    pub chip: u32,
    /// Whether its serial line takes scans and the time, as a test bench's does. A unit that is not a bench takes requests
    /// of the integrator only.
    pub is_bench: bool,
    /// Cells of its grid: ranges, azimuths.
    pub grid: [u8; 2],
}

/// What a unit said of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identified {
    /// The sensor's number it answers to.
    pub sensor: u8,
    /// As in [`Identity`].
    pub is_bench: bool,
    /// As in [`Identity`].
    pub chip: u32,
    /// Ranges and azimuths of the grid.
    pub grid: [u8; 2],
    /// Major, minor and patch number; zeros on a CAN bus, where the status says it.
    pub firmware: [u8; 3],
    board: [u8; Identity::MOST_LETTERS],
}

impl Identity {
    const MOST_LETTERS: usize = 24;
    /// Bytes on a serial line before the letters of the name.
    pub(crate) const HEAD_LEN: usize = 11;

    /// Of a program that does not say which one it is.
    pub const UNNAMED: Self = Self { board: "", chip: 0, is_bench: false, grid: [0; 2] };

    /// The shorter number of a chip, from the one it was made with.
    pub fn number(unique: &[u8]) -> u32 {
        fingerprint(unique)
    }

    /// Sensor, kind, grid, firmware, chip.
    pub(crate) fn head(&self, sensor: u8, firmware: [u8; 3]) -> [u8; Self::HEAD_LEN] {
        let [ranges, azimuths] = self.grid;
        let [major, minor, patch] = firmware;
        let [a, b, c, d] = self.chip.to_le_bytes();
        [sensor, u8::from(self.is_bench), ranges, azimuths, major, minor, patch, a, b, c, d]
    }

    /// The letters that are sent.
    pub(crate) fn letters(&self) -> &'static [u8] {
        let name = self.board.as_bytes();
        name.get(..Self::MOST_LETTERS).unwrap_or(name)
    }
}

impl Identified {
    /// Of a unit on a CAN bus, which says no more.
    pub(crate) const fn by_chip(sensor: u8, is_bench: bool, chip: u32) -> Self {
        Self { sensor, is_bench, chip, grid: [0; 2], firmware: [0; 3], board: [0; Identity::MOST_LETTERS] }
    }

    /// From what [`Identity::head`] and the letters made.
    pub(crate) fn read(body: &[u8]) -> Option<Self> {
        let mut r = Reader(body);
        let [sensor, kind, ranges, azimuths] = r.take()?;
        let (firmware, chip) = (r.take()?, r.u32()?);
        let mut board = [0; Identity::MOST_LETTERS];
        board.iter_mut().zip(r.0).for_each(|(to, from)| *to = *from);
        Some(Self { sensor, is_bench: kind != 0, chip, grid: [ranges, azimuths], firmware, board })
    }

    /// The board's name; empty where it was not said.
    pub fn board(&self) -> &str {
        let letters = self.board.split(|byte| *byte == 0).next().unwrap_or(&[]);
        core::str::from_utf8(letters).unwrap_or("")
    }
}

/// Major, minor and patch number of this version.
pub const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(digits: &str) -> u8 {
    let (mut rest, mut value) = (digits.as_bytes(), 0_u8);
    while let [digit, tail @ ..] = rest {
        value = value.saturating_mul(10).saturating_add(*digit - b'0');
        rest = tail;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn what_is_sent_reads_back() {
        let identity = Identity { board: "nucleo-h743zi", chip: 0x0102_0304, is_bench: true, grid: [200, 120] };
        let sent: Vec<u8> = [&identity.head(5, [1, 2, 3]), identity.letters()].concat();
        assert_eq!(sent[..11], [5, 1, 200, 120, 1, 2, 3, 4, 3, 2, 1]);
        let read = Identified::read(&sent).unwrap();
        assert_eq!((read.sensor, read.is_bench, read.chip, read.board()), (5, true, 0x0102_0304, "nucleo-h743zi"));
        assert_eq!((read.grid, read.firmware), ([200, 120], [1, 2, 3]));
        assert_eq!(Identified::read(&sent[..10]), None);
        let long = Identity { board: "a-board-with-a-name-nobody-would-choose", ..identity };
        let sent = [&long.head(0, [0; 3]), long.letters()].concat();
        assert_eq!(Identified::read(&sent).unwrap().board(), "a-board-with-a-name-nobo");
    }
}
