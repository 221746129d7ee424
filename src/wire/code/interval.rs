//! The number code: symbols in, a few words of a big number out, and back.
//!
//! # Model
//! A message is one number below `2^(B n)`, sent as `n` words of `B` bits, the first the most
//! significant. Coding narrows an interval. It starts with the first word and width `w = 2^B`; when
//! `w` falls below `2^16` and a further word is allowed, interval and width are multiplied by `2^B`
//! and that word's bits are joined on. A symbol with the cumulative frequencies `c .. c + f` of 256
//! keeps the part `[w c / 256, w (c + f) / 256)`, divisions rounded down. A plain bit keeps the
//! lower or the upper half, the lower being `w / 2` rounded down. The message is the lower end of
//! what is left, so it decodes to the same symbols, and after the last of them the decoder holds 0.
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
    /// A point to come back to.
    type Mark: Copy;

    /// A symbol of a table, which gives for each symbol the frequencies below it, of 256; `None` if it
    /// does not fit.
    fn symbol<const N: usize>(&mut self, below: &'static [u8; N], symbol: usize) -> Option<()>;

    /// The lowest `count` bits of a value, the highest of them first; `None` if they do not fit.
    fn plain(&mut self, count: u32, value: usize) -> Option<()>;

    /// Bits left, at most.
    fn room(&self) -> u32;

    /// This point.
    fn mark(&self) -> Self::Mark;

    /// Forgets what came after a point.
    fn rewind(&mut self, mark: Self::Mark);
}

/// The words of a message, the first the most significant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words {
    words: [u64; MOST_WORDS],
    count: usize,
}

impl Words {
    /// No word yet.
    pub const NONE: Self = Self { words: [0; MOST_WORDS], count: 0 };

    /// The part of the interval's lower end that lies in a word, the carries of what follows not yet taken
    /// over; it becomes the last word.
    fn put(&mut self, count: usize, low: u64) {
        if let Some(word) = count.checked_sub(1).and_then(|last| self.words.get_mut(last)) {
            (*word, self.count) = (low, count);
        }
    }

    /// One after another.
    pub fn as_slice(&self) -> &[u64] {
        self.words.get(..self.count).unwrap_or(&[])
    }
}

/// Codes symbols into words.
#[derive(Debug)]
pub struct Encoder<'a> {
    words: &'a mut Words,
    at: Mark,
    form: Form,
}

/// A point of an encoder.
#[derive(Debug, Clone, Copy)]
pub struct Mark {
    /// Lower end of the interval, as far as it came since the last word was joined on.
    low: u64,
    width: u64,
    used: usize,
}

impl<'a> Encoder<'a> {
    /// No symbol coded yet.
    pub fn new(words: &'a mut Words, form: Form) -> Self {
        let form = Form { most: form.most.min(MOST_WORDS), ..form };
        Self { words, at: Mark { low: 0, width: 1 << form.bits, used: 1 }, form }
    }

    /// Completes the words.
    pub fn finish(self) {
        let Self { words, at, form } = self;
        words.put(at.used, at.low);
        let mut carry = 0;
        for word in words.words.iter_mut().take(at.used).rev() {
            carry += *word;
            *word = carry & ((1 << form.bits) - 1);
            carry >>= form.bits;
        }
    }

    #[inline]
    fn widen(&mut self) {
        if self.at.width < NARROW {
            self.join();
        }
    }

    #[inline(never)]
    fn join(&mut self) {
        let at = &mut self.at;
        if at.used < self.form.most {
            self.words.put(at.used, at.low);
            *at = Mark { low: 0, width: at.width << self.form.bits, used: at.used + 1 };
        }
    }

    /// Keeps `[from, to)` of the interval. What is added to `low` within a word is less than the width the
    /// word began with.
    #[inline]
    fn keep(&mut self, from: u64, to: u64) -> Option<()> {
        if from >= to {
            return None;
        }
        self.at.low += from;
        self.at.width = to - from;
        Some(())
    }
}

impl Coder for Encoder<'_> {
    type Mark = Mark;

    #[inline]
    fn symbol<const N: usize>(&mut self, below: &'static [u8; N], symbol: usize) -> Option<()> {
        self.widen();
        let width = self.at.width;
        let part = |below: &u8| (width * u64::from(*below)) >> 8;
        // below the first there is nothing
        let from = if symbol == 0 { 0 } else { part(below.get(symbol)?) };
        let to = below.get(symbol + 1).map_or(width, part);
        self.keep(from, to)
    }

    #[inline(never)]
    fn plain(&mut self, count: u32, value: usize) -> Option<()> {
        for bit in (0..count).rev() {
            self.widen();
            let (half, width) = (self.at.width >> 1, self.at.width);
            if value >> bit & 1 == 0 { self.keep(0, half)? } else { self.keep(half, width)? }
        }
        Some(())
    }

    #[inline]
    fn room(&self) -> u32 {
        room(self.at.width, self.at.used, self.form)
    }

    #[inline]
    fn mark(&self) -> Mark {
        self.at
    }

    #[inline]
    fn rewind(&mut self, mark: Mark) {
        self.at = mark;
    }
}

/// Bits left in the interval and in words not yet joined on, rounded down.
#[inline]
#[allow(clippy::cast_possible_truncation)] // 14 words
fn room(width: u64, used: usize, form: Form) -> u32 {
    (width | 1).ilog2() + form.most.saturating_sub(used) as u32 * form.bits
}

/// What a decoder holds with a further word joined on, if one is allowed.
#[inline(never)]
fn joined(words: &[u64], form: Form, (used, value, width): (usize, u64, u64)) -> Result<(usize, u64, u64), OutOfWords> {
    if used >= form.most {
        return Ok((used, value, width));
    }
    let word = *words.get(used).ok_or(OutOfWords)?;
    Ok((used + 1, (value << form.bits) | word, width << form.bits))
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
    #[inline]
    pub fn room(&self) -> u32 {
        room(self.width, self.used, self.form)
    }

    /// What is left of the number; 0 after the last symbol of an intact message.
    pub fn rest(&self) -> u64 {
        self.value
    }

    /// Words joined on so far.
    pub fn used(&self) -> usize {
        self.used
    }

    #[inline]
    fn widen(&mut self) -> Result<(), OutOfWords> {
        if self.width < NARROW {
            (self.used, self.value, self.width) = joined(self.words, self.form, self.state())?;
        }
        Ok(())
    }

    /// The next symbol of a table, which gives for each symbol the frequencies below it, of 256.
    ///
    /// # Errors
    /// A word is needed that is not there.
    #[inline]
    pub fn symbol<const N: usize>(&mut self, below: &[u8; N]) -> Result<usize, OutOfWords> {
        self.widen()?;
        let part = |symbol: usize| below.get(symbol).map(|below| (self.width * u64::from(*below)) >> 8);
        let (mut symbol, mut from) = (0, 0);
        let mut look = |step: usize| match part(symbol + step) {
            Some(next) if self.value >= next => {
                (symbol, from) = (symbol + step, next);
                true
            }
            _ => false,
        };
        if N <= 4 {
            // the first is the most frequent
            while look(1) {}
        } else {
            const { assert!(N <= 16) };
            [8, 4, 2, 1].into_iter().for_each(|step| _ = look(step));
        }
        let to = part(symbol + 1).unwrap_or(self.width);
        self.value -= from;
        self.width = to - from;
        Ok(symbol)
    }

    /// The next `count` plain bits.
    ///
    /// # Errors
    /// A word is needed that is not there.
    #[inline(always)]
    pub fn plain(&mut self, count: u32) -> Result<usize, OutOfWords> {
        let mut value = 0;
        for _ in 0..count {
            self.widen()?;
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

    static SKEWED: [u8; 3] = [0, 250, 255];
    static EVEN: [u8; 4] = [0, 64, 128, 192];
    static MANY: [u8; 13] = [0, 1, 6, 20, 60, 100, 101, 120, 180, 200, 210, 220, 255];

    #[derive(Debug, Clone, Copy)]
    enum Step {
        Skewed(usize),
        Even(usize),
        Many(usize),
        Plain(u32, usize),
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        prop::collection::vec(
            prop_oneof![
                4 => (0..3_usize).prop_map(Step::Skewed),
                1 => (0..4_usize).prop_map(Step::Even),
                2 => (0..13_usize).prop_map(Step::Many),
                1 => (1..8_u32, 0..256_usize).prop_map(|(n, v)| Step::Plain(n, v & ((1 << n) - 1))),
            ],
            0..200,
        )
    }

    fn code(e: &mut Encoder<'_>, step: Step) -> Option<()> {
        match step {
            Step::Skewed(s) => e.symbol(&SKEWED, s),
            Step::Even(s) => e.symbol(&EVEN, s),
            Step::Many(s) => e.symbol(&MANY, s),
            Step::Plain(n, v) => e.plain(n, v),
        }
    }

    proptest! {
        #[test]
        fn what_fits_comes_back(steps in steps(), form in prop::sample::select(&[Form::CLASSIC, Form::LONG][..])) {
            let mut words = Words::NONE;
            let mut e = Encoder::new(&mut words, form);
            let mut coded = Vec::new();
            for step in steps {
                let before = e.mark();
                // what is coded and taken back again leaves no trace
                let _ = (code(&mut e, Step::Even(3)), code(&mut e, Step::Plain(7, 127)));
                e.rewind(before);
                if code(&mut e, step).is_none() {
                    e.rewind(before);
                    break;
                }
                coded.push((step, e.room()));
            }
            e.finish();
            prop_assert!(words.as_slice().iter().all(|word| word >> form.bits == 0));
            let mut d = Decoder::new(words.as_slice(), form).unwrap();
            for (step, room) in coded {
                let (got, want) = match step {
                    Step::Skewed(s) => (d.symbol(&SKEWED), s),
                    Step::Even(s) => (d.symbol(&EVEN), s),
                    Step::Many(s) => (d.symbol(&MANY), s),
                    Step::Plain(n, v) => (d.plain(n), v),
                };
                prop_assert_eq!(got, Ok(want));
                prop_assert_eq!(d.room(), room, "both sides know what is left");
            }
            prop_assert_eq!(d.rest(), 0);
            prop_assert_eq!(d.used(), words.as_slice().len());
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
        let mut words = Words::NONE;
        let mut e = Encoder::new(&mut words, Form::CLASSIC);
        let mut symbols = 0;
        while e.symbol(&EVEN, 1 + symbols % 3).is_some() {
            symbols += 1;
        }
        assert_eq!(e.room(), 0);
        e.finish();
        assert_eq!((symbols, words.as_slice().len()), (66, 4));
    }

    #[test]
    fn a_missing_word_is_told() {
        let mut words = Words::NONE;
        let mut e = Encoder::new(&mut words, Form::CLASSIC);
        (0..20).for_each(|_| e.symbol(&EVEN, 3).unwrap());
        e.finish();
        assert_eq!(words.as_slice().len(), 2);
        let mut d = Decoder::new(&words.as_slice()[..1], Form::CLASSIC).unwrap();
        let seen = (0..20).take_while(|_| d.symbol(&EVEN) == Ok(3)).count();
        assert_eq!(seen, 9, "33 bits less 9 symbols are below 2^16");
        assert!(Decoder::new(&[], Form::LONG).is_err());
    }
}
