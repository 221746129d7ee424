//! A field of a CAN message in Motorola bit order, as a DBC writes it: `start|length@0+`.

/// Where a field lies: its most significant bit, counted as DBC files do (7 is the top of byte 0, 15
/// the top of byte 1), and its length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signal {
    start: u8,
    length: u8,
}

impl Signal {
    /// A field of 1 to 32 bits in the first 8 bytes.
    pub const fn new(start: u8, length: u8) -> Self {
        Self { start, length }
    }

    /// The most significant bit, as a DBC counts.
    pub const fn start(self) -> u8 {
        self.start
    }

    /// Bits.
    pub const fn length(self) -> u8 {
        self.length
    }

    /// Bits below the field when the message is read as one number, first byte on top.
    const fn below(self) -> u32 {
        let above = (self.start & !7) as u32 + (7 - (self.start & 7) as u32);
        64_u32.saturating_sub(above + self.length as u32)
    }

    const fn mask(self) -> u64 {
        (1 << self.length) - 1
    }

    /// The field of a message read by [`word`].
    #[allow(clippy::cast_possible_truncation)] // at most 32 bits
    pub const fn get(self, word: u64) -> u32 {
        ((word >> self.below()) & self.mask()) as u32
    }

    /// The message with the field set; what does not fit is cut off.
    #[must_use]
    pub const fn put(self, word: u64, value: u32) -> u64 {
        let (mask, below) = (self.mask(), self.below());
        (word & !(mask << below)) | ((value as u64 & mask) << below)
    }
}

/// A message as one number, first byte on top; bytes that are not there are zero, those after the
/// eighth are left out.
pub fn word(data: &[u8]) -> u64 {
    data.iter().take(8).zip((0..8).rev()).fold(0, |word, (byte, place)| word | u64::from(*byte) << (8 * place))
}

/// A field that stands for a quantity: `raw * lsb + offset`, in whole units of the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// Where it lies.
    pub signal: Signal,
    /// What one step stands for.
    pub lsb: i32,
    /// What zero stands for.
    pub offset: i32,
}

impl Quantity {
    /// A field with its scale.
    pub const fn new(signal: Signal, lsb: i32, offset: i32) -> Self {
        Self { signal, lsb, offset }
    }

    /// The value in a message.
    #[allow(clippy::cast_possible_wrap)] // fields have at most 16 bits
    pub const fn get(self, word: u64) -> i32 {
        (self.signal.get(word) as i32).wrapping_mul(self.lsb).wrapping_add(self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_run_from_their_top_bit_to_the_right_across_bytes() {
        let w = word(&[0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xF0]);
        assert_eq!(Signal::new(7, 8).get(w), 0x12);
        assert_eq!(Signal::new(15, 13).get(w), (0x34 << 5) | (0x56 >> 3));
        assert_eq!(Signal::new(17, 10).get(w), (0x56 & 3) << 8 | 0x78);
        assert_eq!(Signal::new(63, 8).get(w), 0xF0);
        assert_eq!(Signal::new(50, 3).get(w), 0xDE & 7);
    }

    #[test]
    fn what_is_put_is_got_and_nothing_else_changes() {
        for start in 0..64 {
            for length in 1..=13 {
                let s = Signal::new(start, length);
                if (start & !7) + 7 - (start & 7) + length > 64 {
                    continue;
                }
                assert_eq!(s.get(s.put(0, 0x1555)), 0x1555 & ((1 << length) - 1));
                assert_eq!(s.put(u64::MAX, u32::MAX), u64::MAX);
                assert_eq!(
                    s.put(0x5555_5555_5555_5555, 0).count_ones() + s.get(0x5555_5555_5555_5555).count_ones(),
                    32
                );
            }
        }
    }

    #[test]
    fn short_messages_read_as_zeros() {
        assert_eq!(word(&[0xFF]), 0xFF << 56);
        assert_eq!(word(&[1, 2, 3, 4, 5, 6, 7, 8, 9]), 0x0102_0304_0506_0708);
    }
}
