//! Which cells of an azimuth are known: one stretch, or none.

/// The cells of an azimuth there is evidence for: `near..=last`, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Known {
    /// First and last cell, the first less or more one, so that nothing known is 0 in every bit.
    stored: [u8; 2],
}

impl Known {
    /// Nothing is known.
    pub const NONE: Self = Self::stored([1, 0]);

    const fn stored([near, last]: [u8; 2]) -> Self {
        Self { stored: [near ^ 1, last] }
    }

    /// The cells `near..end`; none if that is empty or reaches beyond 256 cells.
    #[allow(clippy::cast_possible_truncation)] // checked
    pub const fn new(near: usize, end: usize) -> Self {
        if near < end && end <= 256 { Self::stored([near as u8, (end - 1) as u8]) } else { Self::NONE }
    }

    /// First and last cell as bytes; 1 and 0 where nothing is known.
    pub const fn limits(self) -> [u8; 2] {
        let [near, last] = self.stored;
        [near ^ 1, last]
    }

    /// From first and last cell; `None` if they are in the wrong order, unless they are 1 and 0.
    pub const fn from_limits(limits: [u8; 2]) -> Option<Self> {
        let [near, last] = limits;
        if near <= last || (near == 1 && last == 0) { Some(Self::stored(limits)) } else { None }
    }

    /// Whether no cell is known.
    pub const fn is_empty(self) -> bool {
        let [near, last] = self.limits();
        near > last
    }

    /// First known cell.
    pub const fn near(self) -> usize {
        let [near, _] = self.limits();
        near as usize
    }

    /// First cell beyond; not above [`Known::near`] where nothing is known.
    pub const fn end(self) -> usize {
        let [near, last] = self.limits();
        if near > last { 0 } else { last as usize + 1 }
    }

    /// Whether a cell is known.
    pub const fn contains(self, cell: usize) -> bool {
        cell >= self.near() && cell < self.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_cells_are_an_interval() {
        assert_eq!(Known::new(3, 3), Known::NONE);
        assert_eq!(Known::new(3, 257), Known::NONE);
        assert!(Known::new(0, 256).contains(255) && !Known::NONE.contains(0) && !Known::NONE.contains(1));
        assert_eq!((Known::NONE.end(), Known::new(0, 256).end()), (0, 256));
    }
}
