//! The own bytes of the messages that carry a map's cells.
//!
//! # Model
//! Numbers are big-endian.
//!
//! | | classic, 6 bytes | long |
//! |---|---|---|
//! | words of a block | scan 8 bits, first azimuth 7, one word of 33 | scan, first azimuth, then words of 4 bytes |
//! | plain | scan 8 bits, azimuth 7, segment 4, 29 cells | scan, azimuth, first and last known cell, then cells, 8 a byte |
//!
//! Segment `s` of a classic plain message holds the cells from `29 s` on, the nearest in the highest
//! bit. Segment 15 holds first and last known cell in the highest 16 of the 29 bits; it comes first.
//! A bit is 1 for visible.

use super::code::interval::MOST_WORDS;
use super::code::ray::{Known, Ray};
use super::message::{CLASSIC_BYTES, LONG_BYTES};
use super::scan_number::ScanNumber;
use crate::fixed::bits::Bits;

/// Cells of a classic plain message.
pub const SEGMENT: usize = 29;

/// The segment that holds the limits of the known cells.
pub const LIMITS: u8 = 15;

/// Segments that cover 256 cells.
pub const SEGMENTS: u8 = 9;

const WORD: u64 = (1 << 33) - 1;

/// A scan, an azimuth and 33 bits, as a classic message has them.
fn classic(scan: ScanNumber, azimuth: usize, bits: u64) -> [u8; CLASSIC_BYTES] {
    let all = u64::from(scan.byte()) << 40 | (azimuth as u64 & 0x7F) << 33 | bits & WORD;
    let [_, _, bytes @ ..] = all.to_be_bytes();
    bytes
}

/// A word of a block for a classic message.
pub fn word(scan: ScanNumber, start: usize, word: u64) -> [u8; CLASSIC_BYTES] {
    classic(scan, start, word)
}

/// The words of a block for a long message, and how many bytes they take.
#[allow(clippy::cast_possible_truncation)] // 32 bits a word, 128 azimuths
pub fn words(scan: ScanNumber, start: usize, words: &[u64]) -> ([u8; LONG_BYTES], usize) {
    let mut own = [0; LONG_BYTES];
    let bytes = words.iter().flat_map(|word| (*word as u32).to_be_bytes());
    own.iter_mut().zip([scan.byte(), start as u8].into_iter().chain(bytes)).for_each(|(to, from)| *to = from);
    (own, (2 + 4 * words.len()).min(LONG_BYTES))
}

/// A segment of a ray in plain bits, for a classic message.
pub fn segment<const W: usize>(scan: ScanNumber, azimuth: usize, ray: &Ray<W>, segment: u8) -> [u8; CLASSIC_BYTES] {
    let bits = if segment == LIMITS {
        let [near, last] = ray.known.limits();
        u64::from(near) << 21 | u64::from(last) << 13
    } else {
        let from = usize::from(segment) * SEGMENT;
        (from..from + SEGMENT).fold(0, |bits, cell| bits << 1 | u64::from(ray.get(cell)))
    };
    classic(scan, azimuth, u64::from(segment) << 29 | bits)
}

/// Whether a segment of a ray holds known cells, or its limits.
pub fn has_segment(known: Known, segment: u8) -> bool {
    let from = usize::from(segment) * SEGMENT;
    segment == LIMITS || (from < known.end() && from + SEGMENT > known.near())
}

/// A whole ray in plain bits, for a long message, and how many bytes it takes.
#[allow(clippy::cast_possible_truncation)] // 128 azimuths
pub fn plain<const W: usize>(scan: ScanNumber, azimuth: usize, ray: &Ray<W>) -> ([u8; LONG_BYTES], usize) {
    let mut own = [0; LONG_BYTES];
    let [near, last] = ray.known.limits();
    let cells = ray.bits().words().iter().flat_map(|word| word.reverse_bits().to_be_bytes());
    let all = [scan.byte(), azimuth as u8, near, last].into_iter().chain(cells);
    own.iter_mut().zip(all).for_each(|(to, from)| *to = from);
    (own, 4 + ray.known.end().div_ceil(8))
}

/// What a map message holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MapMessage {
    /// Number of the scan.
    pub scan: ScanNumber,
    /// The first azimuth.
    pub start: usize,
    words: [u64; MOST_WORDS],
    count: usize,
}

/// The start and the words of a message; `None` if it is too short.
#[allow(clippy::cast_possible_truncation)] // a byte
pub fn parse(own: &[u8], long: bool) -> Option<MapMessage> {
    let mut words = [0; MOST_WORDS];
    if long {
        let [scan, start, bytes @ ..] = own else { return None };
        let (chunks, _) = bytes.as_chunks::<4>();
        words.iter_mut().zip(chunks).for_each(|(to, from)| *to = u64::from(u32::from_be_bytes(*from)));
        let count = chunks.len().min(MOST_WORDS);
        return Some(MapMessage { scan: ScanNumber::from_byte(*scan), start: usize::from(*start), words, count });
    }
    let [a, b, c, d, e, f] = *own.first_chunk::<CLASSIC_BYTES>()?;
    let all = u64::from_be_bytes([0, 0, a, b, c, d, e, f]);
    words[0] = all & WORD;
    Some(MapMessage { scan: ScanNumber::from_byte(a), start: (all >> 33) as usize & 0x7F, words, count: 1 })
}

/// Cells of a ray in plain bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plain<const W: usize> {
    /// All of it.
    Whole(Ray<W>),
    /// Its known cells.
    Limits(Known),
    /// Some of its visible cells.
    Cells(Bits<W>),
}

impl MapMessage {
    /// The words.
    pub fn words(&self) -> &[u64] {
        self.words.get(..self.count).unwrap_or(&[])
    }

    /// What a plain message holds; `None` if it makes no sense.
    pub fn plain<const W: usize>(&self, own: &[u8], long: bool) -> Option<Plain<W>> {
        let within = |limits| Known::from_limits(limits).filter(|known| known.end() <= Bits::<W>::CAPACITY);
        if long {
            let [_, _, near, last, cells @ ..] = own else { return None };
            let known = within([*near, *last]).filter(|known| known.end() <= 8 * cells.len())?;
            let mut words = [0; W];
            for (word, bytes) in words.iter_mut().zip(cells.chunks(4)) {
                // the last word of a short ray may lack bytes
                let filled = bytes.iter().chain([0; 3].iter()).take(4);
                *word = filled.fold(0_u32, |word, byte| word << 8 | u32::from(*byte)).reverse_bits();
            }
            return Some(Plain::Whole(Ray::new(known, Bits::from_words(words))));
        }
        let word = *self.words.first()?;
        let segment = u8::try_from(word >> 29).ok()?;
        if segment == LIMITS {
            let [_, _, _, _, near, last, _, _] = (word << 3).to_be_bytes();
            return within([near, last]).map(Plain::Limits);
        }
        if segment >= SEGMENTS {
            return None;
        }
        let from = usize::from(segment) * SEGMENT;
        let mut bits = Bits::NONE;
        (0..SEGMENT).filter(|i| word >> (SEGMENT - 1 - i) & 1 == 1).for_each(|i| bits.set(from + i));
        Some(Plain::Cells(bits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SCAN: ScanNumber = ScanNumber::from_byte(0xA5);

    #[test]
    fn a_word_is_these_bytes() {
        let own = word(SCAN, 119, 0x1_2345_6789);
        assert_eq!(own, [0xA5, 119 << 1 | 1, 0x23, 0x45, 0x67, 0x89]);
        let got = parse(&own, false).unwrap();
        assert_eq!((got.scan, got.start, got.words()), (SCAN, 119, &[0x1_2345_6789_u64][..]));
        assert_eq!(parse(&own[..5], false), None);
    }

    #[test]
    fn words_are_these_bytes() {
        let (own, n) = words(SCAN, 7, &[0x0102_0304, 5]);
        assert_eq!(own[..n], [0xA5, 7, 1, 2, 3, 4, 0, 0, 0, 5]);
        let got = parse(&own[..n], true).unwrap();
        assert_eq!((got.start, got.words()), (7, &[0x0102_0304_u64, 5][..]));
        assert_eq!((parse(&[1], true), words(SCAN, 0, &[1; 14]).1), (None, 58));
    }

    #[test]
    fn plain_cells_are_these_bytes() {
        let ray = Ray::<7>::new(Known::new(15, 200), Bits::span(28, 31));
        assert_eq!(segment(SCAN, 1, &ray, LIMITS), [0xA5, 0x03, 0xE1, 0xF8, 0xE0, 0x00]);
        assert_eq!(segment(SCAN, 1, &ray, 0), [0xA5, 0x02, 0x00, 0x00, 0x00, 0x01]);
        assert_eq!(segment(SCAN, 1, &ray, 1), [0xA5, 0x02, 0x38, 0x00, 0x00, 0x00]);
        let (own, n) = plain(SCAN, 1, &ray);
        assert_eq!((n, &own[..8]), (29, &[0xA5, 1, 15, 199, 0, 0, 0, 0x0E][..]));
    }

    proptest! {
        #[test]
        fn a_plain_ray_comes_back(near in 0..200_usize, end in 0..=224_usize, words: [u32; 7], azimuth in 0..128_usize) {
            let ray = Ray::<7>::new(Known::new(near, end), Bits::from_words(words));
            let (own, n) = plain(SCAN, azimuth, &ray);
            let message = parse(&own[..n], true).unwrap();
            prop_assert_eq!(message.start, azimuth);
            prop_assert_eq!(message.plain(&own[..n], true), Some(Plain::Whole(ray)));
            prop_assert_eq!(message.plain::<7>(&own[..n - 1], true), None);
            let (mut known, mut cells) = (Known::NONE, Bits::<7>::NONE);
            for number in (0..SEGMENTS).chain([LIMITS]).filter(|s| has_segment(ray.known, *s)) {
                let own = segment(SCAN, azimuth, &ray, number);
                let message = parse(&own, false).unwrap();
                prop_assert_eq!((message.scan, message.start), (SCAN, azimuth));
                match message.plain::<7>(&own, false).unwrap() {
                    Plain::Limits(k) => known = k,
                    Plain::Cells(bits) => bits.iter().for_each(|cell| cells.set(cell)),
                    Plain::Whole(_) => panic!("a classic message holds no whole ray"),
                }
            }
            prop_assert_eq!(Ray::new(known, cells), ray);
        }
    }
}
