//! A long row of bits: what one mount sees, place by place.

/// Bits that are set, cleared, joined and counted together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bits(Vec<u64>);

impl Bits {
    pub fn new(len: usize) -> Self {
        Self(vec![0; len.div_ceil(64)])
    }

    pub fn set(&mut self, index: usize) {
        self.0[index / 64] |= 1 << (index % 64);
    }

    pub fn get(&self, index: usize) -> bool {
        self.0[index / 64] >> (index % 64) & 1 == 1
    }

    pub fn count(&self) -> u64 {
        self.0.iter().map(|w| u64::from(w.count_ones())).sum()
    }
}

/// How many bits are set in at least one, and in at least two, of several rows of one length.
pub fn at_least(rows: &[&Bits]) -> [u64; 2] {
    let words = rows.first().map_or(0, |r| r.0.len());
    let mut counts = [0; 2];
    for k in 0..words {
        let (mut once, mut twice) = (0_u64, 0_u64);
        for row in rows {
            twice |= once & row.0[k];
            once |= row.0[k];
        }
        counts[0] += u64::from(once.count_ones());
        counts[1] += u64::from(twice.count_ones());
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn once_and_twice_are_counted_over_word_borders() {
        let row = |set: &[usize]| {
            let mut bits = Bits::new(130);
            set.iter().for_each(|&k| bits.set(k));
            bits
        };
        let (a, b, c) = (row(&[0, 63, 64, 129]), row(&[63, 64]), row(&[5, 64]));
        assert_eq!((a.count(), a.get(63), a.get(62)), (4, true, false));
        assert_eq!(at_least(&[&a]), [4, 0]);
        assert_eq!(at_least(&[&a, &b]), [4, 2]);
        assert_eq!(at_least(&[&a, &b, &c]), [5, 2]);
        assert_eq!(at_least(&[]), [0, 0]);
    }
}
