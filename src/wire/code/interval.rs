//! The number code: symbols in, a few words of a big number out, and back.
//!
//! # Model
//! A message is one number below `2^(B n)`, sent as `n` words of `B` bits, the first the most
//! significant. Coding narrows an interval. It starts with the first word and width `w = 2^B`; when
//! `w` falls below `2^16` and a further word is allowed, interval and width are multiplied by `2^B`
//! and that word's bits are joined on. A symbol with the cumulative frequencies `c .. c + f` of 256
//! keeps the part `[w c / 256, w (c + f) / 256)`, divisions rounded down. A plain bit keeps the
//! lower or the upper half, the lower being `w / 2` rounded down. The message is the lower end of
//! what is left, so it decodes to the same symbols, and behind the last of them the decoder holds 0.
//!
//! No division, no renormalisation, no table but the frequencies; 64-bit products of a width below
//! 2^49 and 256.
//!
//! # Limits
//! A symbol whose part of the interval is empty does not fit, and the encoder says so. 14 words.
//!
//! # References
//! J. Rissanen, "Generalized Kraft inequality and arithmetic coding", IBM J. Res. Dev. 20 (1976).

/// Size and most number of words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form {
    /// Bits of a word.
    pub bits: u32,
    /// Most words of a message.
    pub most: usize,
}

impl Form {
    /// Classic CAN: what a frame has left, four frames to a message.
    pub const CLASSIC: Self = Self { bits: 33, most: 4 };
    /// CAN FD and serial: one frame to a message.
    pub const LONG: Self = Self { bits: 32, most: 14 };
    /// As [`Form::LONG`], with room for the authenticator.
    pub const LONG_SECURED: Self = Self { bits: 32, most: 12 };
}

/// Most words of any form.
pub const MOST_WORDS: usize = 14;

/// Below this width a further word is joined on.
const NARROW: u64 = 1 << 16;

/// Something that takes symbols.
pub trait Coder {
    /// A symbol of a table of frequencies that sum to 256; `None` if it does not fit.
    fn symbol(&mut self, table: &'static [u8], symbol: usize) -> Option<()>;

    /// The lowest `count` bits of a value, the highest of them first; `None` if they do not fit.
    fn plain(&mut self, count: u32, value: usize) -> Option<()>;

    /// Bits left, at most.
    fn room(&self) -> u32;
}

/// Codes symbols. A copy is a point to come back to.
#[derive(Debug, Clone, Copy)]
pub struct Encoder {
    words: [u64; MOST_WORDS],
    used: usize,
    width: u64,
    form: Form,
}

impl Encoder {
    /// No symbol coded yet.
    pub const fn new(form: Form) -> Self {
        Self { words: [0; MOST_WORDS], used: 1, width: 1 << form.bits, form }
    }

    /// The words so far.
    pub fn words(&self) -> &[u64] {
        self.words.get(..self.used).unwrap_or(&[])
    }

    fn join(&mut self) {
        if self.width < NARROW && self.used < self.form.most.min(MOST_WORDS) {
            self.used += 1;
            self.width <<= self.form.bits;
        }
    }

    /// Keeps `[from, to)` of the interval.
    fn keep(&mut self, from: u64, to: u64) -> Option<()> {
        if from >= to {
            return None;
        }
        self.width = to - from;
        if from == 0 {
            return Some(());
        }
        let mut carry = from;
        // bounded by the number of words
        for word in self.words.iter_mut().take(self.used).rev() {
            carry += *word;
            *word = carry & ((1 << self.form.bits) - 1);
            carry >>= self.form.bits;
            if carry == 0 {
                break;
            }
        }
        Some(())
    }
}

impl Coder for Encoder {
    #[inline]
    fn symbol(&mut self, table: &'static [u8], symbol: usize) -> Option<()> {
        self.join();
        let below: u64 = table.iter().take(symbol).map(|f| u64::from(*f)).sum();
        let frequency = u64::from(*table.get(symbol)?);
        self.keep((self.width * below) >> 8, (self.width * (below + frequency)) >> 8)
    }

    fn plain(&mut self, count: u32, value: usize) -> Option<()> {
        for bit in (0..count).rev() {
            self.join();
            let half = self.width >> 1;
            if value >> bit & 1 == 0 { self.keep(0, half)? } else { self.keep(half, self.width)? }
        }
        Some(())
    }

    fn room(&self) -> u32 {
        room(self.width, self.used, self.form)
    }
}

/// Bits left in the interval and in words not yet joined on, rounded down.
fn room(width: u64, used: usize, form: Form) -> u32 {
    let more = u32::try_from(form.most.saturating_sub(used)).unwrap_or(0);
    width.checked_ilog2().unwrap_or(0) + more * form.bits
}

/// A word is needed that is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutOfWords;

/// Decodes symbols.
#[derive(Debug, Clone, Copy)]
pub struct Decoder<'a> {
    words: &'a [u64],
    used: usize,
    value: u64,
    width: u64,
    form: Form,
}

impl<'a> Decoder<'a> {
    /// Of the words that are there; more may follow later, up to the form's most.
    ///
    /// # Errors
    /// No word at all.
    pub fn new(words: &'a [u64], form: Form) -> Result<Self, OutOfWords> {
        let value = *words.first().ok_or(OutOfWords)?;
        Ok(Self { words, used: 1, value, width: 1 << form.bits, form })
    }

    /// Words joined on so far, what is left of the number, and the interval's width.
    pub(super) fn state(&self) -> (usize, u64, u64) {
        (self.used, self.value, self.width)
    }

    /// Goes on where another decoder of the same words was.
    pub(super) fn resume(words: &'a [u64], form: Form, (used, value, width): (usize, u64, u64)) -> Self {
        Self { words, used, value, width, form }
    }

    /// Bits left, at most: what the encoder had left at this point.
    pub fn room(&self) -> u32 {
        room(self.width, self.used, self.form)
    }

    /// What is left of the number; 0 behind the last symbol of an intact message.
    pub fn rest(&self) -> u64 {
        self.value
    }

    /// Words joined on so far.
    pub fn used(&self) -> usize {
        self.used
    }

    fn join(&mut self) -> Result<(), OutOfWords> {
        if self.width < NARROW && self.used < self.form.most.min(MOST_WORDS) {
            let word = *self.words.get(self.used).ok_or(OutOfWords)?;
            self.value = (self.value << self.form.bits) | word;
            self.width <<= self.form.bits;
            self.used += 1;
        }
        Ok(())
    }

    /// The next symbol of a table.
    ///
    /// # Errors
    /// A word is needed that is not there.
    pub fn symbol(&mut self, table: &[u8]) -> Result<usize, OutOfWords> {
        self.join()?;
        let (mut below, mut from) = (0, 0);
        for (symbol, frequency) in table.iter().enumerate() {
            below += u64::from(*frequency);
            let to = (self.width * below) >> 8;
            if self.value < to {
                self.value -= from;
                self.width = to - from;
                return Ok(symbol);
            }
            from = to;
        }
        // frequencies sum to 256 and the value lies below the width, so this is not reached
        Ok(0)
    }

    /// The next `count` plain bits.
    ///
    /// # Errors
    /// A word is needed that is not there.
    pub fn plain(&mut self, count: u32) -> Result<usize, OutOfWords> {
        let mut value = 0;
        for _ in 0..count {
            self.join()?;
            let half = self.width >> 1;
            let upper = self.value >= half;
            if upper {
                self.value -= half;
                self.width -= half;
            } else {
                self.width = half;
            }
            value = value << 1 | usize::from(upper);
        }
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    static SKEWED: [u8; 3] = [250, 5, 1];
    static EVEN: [u8; 4] = [64; 4];

    #[derive(Debug, Clone, Copy)]
    enum Step {
        Skewed(usize),
        Even(usize),
        Plain(u32, usize),
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        prop::collection::vec(
            prop_oneof![
                4 => (0..3_usize).prop_map(Step::Skewed),
                1 => (0..4_usize).prop_map(Step::Even),
                1 => (1..8_u32, 0..256_usize).prop_map(|(n, v)| Step::Plain(n, v & ((1 << n) - 1))),
            ],
            0..200,
        )
    }

    fn code(e: &mut Encoder, step: Step) -> Option<()> {
        match step {
            Step::Skewed(s) => e.symbol(&SKEWED, s),
            Step::Even(s) => e.symbol(&EVEN, s),
            Step::Plain(n, v) => e.plain(n, v),
        }
    }

    proptest! {
        #[test]
        fn what_fits_comes_back(steps in steps(), form in prop::sample::select(&[Form::CLASSIC, Form::LONG][..])) {
            let mut e = Encoder::new(form);
            let mut coded = Vec::new();
            for step in steps {
                let before = e;
                if code(&mut e, step).is_none() {
                    e = before;
                    break;
                }
                coded.push((step, e.room()));
            }
            let mut d = Decoder::new(e.words(), form).unwrap();
            for (step, room) in coded {
                let (got, want) = match step {
                    Step::Skewed(s) => (d.symbol(&SKEWED), s),
                    Step::Even(s) => (d.symbol(&EVEN), s),
                    Step::Plain(n, v) => (d.plain(n), v),
                };
                prop_assert_eq!(got, Ok(want));
                prop_assert_eq!(d.room(), room, "both sides know what is left");
            }
            prop_assert_eq!(d.rest(), 0);
            prop_assert_eq!(d.used(), e.words().len());
        }

        #[test]
        fn any_words_decode_to_something(words in prop::collection::vec(0..1_u64 << 32, 1..14)) {
            let mut d = Decoder::new(&words, Form::LONG).unwrap();
            for _ in 0..1000 {
                if d.symbol(&SKEWED).is_err() || d.plain(3).is_err() {
                    break;
                }
                prop_assert!(d.rest() < 1 << 50);
            }
        }
    }

    #[test]
    fn the_interval_is_used_to_the_last_bits() {
        // four words of 33 bits hold 66 symbols of two bits
        let mut e = Encoder::new(Form::CLASSIC);
        let mut symbols = 0;
        while e.symbol(&EVEN, 1 + symbols % 3).is_some() {
            symbols += 1;
        }
        assert_eq!((symbols, e.words().len(), e.room()), (66, 4, 0));
    }

    #[test]
    fn a_missing_word_is_told() {
        let mut e = Encoder::new(Form::CLASSIC);
        (0..20).for_each(|_| e.symbol(&EVEN, 3).unwrap());
        assert_eq!(e.words().len(), 2);
        let mut d = Decoder::new(&e.words()[..1], Form::CLASSIC).unwrap();
        let seen = (0..20).take_while(|_| d.symbol(&EVEN) == Ok(3)).count();
        assert_eq!(seen, 9, "33 bits less 9 symbols are below 2^16");
        assert!(Decoder::new(&[], Form::LONG).is_err());
    }
}
