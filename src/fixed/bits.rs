//! Rows of bits: which cells of a row hold something, or can be seen.

/// A set of cells in a row of `32 * W`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bits<const W: usize>([u32; W]);

/// The range cells of an azimuth, at most 256.
pub type RangeBits = Bits<8>;

impl<const W: usize> Default for Bits<W> {
    fn default() -> Self {
        Self::NONE
    }
}

impl<const W: usize> Bits<W> {
    /// Most cells a row can hold.
    pub const CAPACITY: usize = 32 * W;

    /// No bit set.
    pub const NONE: Self = Self([0; W]);

    /// From words of 32 bits, the first bit the lowest of the first word.
    pub const fn from_words(words: [u32; W]) -> Self {
        Self(words)
    }

    /// As words of 32 bits.
    pub const fn words(&self) -> &[u32; W] {
        &self.0
    }

    /// The bits `from..to`.
    pub fn span(from: usize, to: usize) -> Self {
        let mut out = Self::NONE;
        for (i, word) in out.0.iter_mut().enumerate() {
            let below = |end: usize| match end.saturating_sub(i * 32) {
                n @ 0..32 => (1_u32 << n) - 1,
                _ => u32::MAX,
            };
            *word = below(to) & !below(from);
        }
        out
    }

    /// The same bits in a row of another length; those beyond its end are lost.
    #[must_use]
    pub fn resized<const V: usize>(&self) -> Bits<V> {
        let mut out = Bits::NONE;
        for (to, from) in out.0.iter_mut().zip(self.0) {
            *to = from;
        }
        out
    }

    /// Whether bit `i` is set; beyond the end none is.
    pub fn get(&self, i: usize) -> bool {
        self.0.get(i / 32).is_some_and(|word| word >> (i % 32) & 1 == 1)
    }

    /// Sets bit `i`; beyond the end nothing happens.
    #[inline]
    pub fn set(&mut self, i: usize) {
        if let Some(word) = self.0.get_mut(i / 32) {
            *word |= 1 << (i % 32);
        }
    }

    /// Clears bit `i`.
    pub fn clear(&mut self, i: usize) {
        if let Some(word) = self.0.get_mut(i / 32) {
            *word &= !(1 << (i % 32));
        }
    }

    /// The first set bit at or after `from`.
    #[inline]
    pub fn next(&self, from: usize) -> Option<usize> {
        let mut word = from / 32;
        let mut left = *self.0.get(word)? & (u32::MAX << (from % 32));
        while left == 0 {
            word += 1;
            left = *self.0.get(word)?;
        }
        Some(word * 32 + left.trailing_zeros() as usize)
    }

    /// The last set bit.
    pub fn last(&self) -> Option<usize> {
        let word = self.0.iter().rposition(|w| *w != 0)?;
        let zeros = self.0.get(word)?.leading_zeros() as usize;
        Some(word * 32 + 31 - zeros)
    }

    /// Set bits in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        let mut words = self.0.iter();
        let mut left = 0;
        let mut end = 0;
        core::iter::from_fn(move || {
            while left == 0 {
                left = *words.next()?;
                end += 32;
            }
            let bit = left.trailing_zeros() as usize;
            left &= left - 1;
            Some(end - 32 + bit)
        })
    }

    /// How many bits are set.
    pub fn count(&self) -> u32 {
        self.0.iter().map(|w| w.count_ones()).sum()
    }

    /// Whether none is set.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|w| *w == 0)
    }

    /// Bits of both.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let mut out = *self;
        for (a, b) in out.0.iter_mut().zip(other.0) {
            *a &= b;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn bits(set: &[usize]) -> RangeBits {
        let mut b = Bits::NONE;
        for &i in set {
            b.set(i);
        }
        b
    }

    #[test]
    fn set_bits_come_back_in_order() {
        let set = [0, 31, 32, 100, 255];
        let b = bits(&set);
        assert_eq!(b.iter().collect::<Vec<_>>(), set);
        assert_eq!((b.count(), b.last(), b.next(33), b.next(256)), (5, Some(255), Some(100), None));
        assert!(b.get(31) && !b.get(30) && !b.get(300));
    }

    #[test]
    fn spans_cross_words_and_rows_change_length() {
        assert_eq!(RangeBits::span(30, 66).iter().collect::<Vec<_>>(), (30..66).collect::<Vec<_>>());
        assert_eq!((RangeBits::span(0, 256).count(), RangeBits::span(9, 9).count()), (256, 0));
        assert_eq!(bits(&[3, 40, 100]).resized::<2>().iter().collect::<Vec<_>>(), [3, 40]);
        assert_eq!(bits(&[3, 40]).resized::<2>().words(), &[8, 256]);
    }

    #[test]
    fn clearing_and_intersecting() {
        let mut b = bits(&[3, 40]);
        b.clear(3);
        assert_eq!(b, bits(&[40]));
        assert_eq!(b.and(&bits(&[3, 41])), RangeBits::NONE);
        assert!(RangeBits::NONE.is_empty() && RangeBits::NONE.last().is_none());
        b.set(1000);
        assert_eq!(b.count(), 1);
    }
}
