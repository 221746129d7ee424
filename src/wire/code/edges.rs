//! Where the bits of a ray turn over, and which of these places are expected next.

use super::known::Known;

/// The edges of a ray, one after another.
#[derive(Debug, Clone, Copy)]
pub struct Edges<'a, const W: usize> {
    words: &'a [u32; W],
    /// The word at hand.
    word: usize,
    /// Its cells still to come whose bit is not the one before.
    differ: u32,
    /// The bit before, in every place.
    before: u32,
    /// First cell beyond the ray.
    end: usize,
}

impl<'a, const W: usize> Edges<'a, W> {
    /// Of a ray's bits and known cells, from a cell on.
    #[inline]
    pub fn new(words: &'a [u32; W], known: Known, from: usize) -> Self {
        let before = from.saturating_sub(1).max(known.near());
        let word = before / 32;
        let at_hand = words.get(word).copied().unwrap_or(0);
        let bit = if at_hand >> (before % 32) & 1 == 1 { u32::MAX } else { 0 };
        let differ = (at_hand ^ bit) & (u32::MAX << (before % 32));
        Self { words, word, differ, before: bit, end: known.end() }
    }
}

impl<const W: usize> Iterator for Edges<'_, W> {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        while self.differ == 0 {
            // no bit is set outside the known cells, so that only their end differs, too
            self.differ = *self.words.get(self.word + 1)? ^ self.before;
            self.word += 1;
        }
        let place = self.differ.trailing_zeros();
        self.before = !self.before;
        self.differ = !self.differ & (u32::MAX << place);
        let edge = 32 * self.word + place as usize;
        (edge < self.end).then_some(edge)
    }
}

/// The edges of a ray, to be looked at in any order.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeList {
    /// Cells in ascending order. A ray has 256 at most, and none of them is an edge in the first.
    cells: [u8; 255],
    count: usize,
}

impl EdgeList {
    pub const NONE: Self = Self { cells: [0; 255], count: 0 };

    /// Becomes that of a ray with these edges.
    #[allow(clippy::cast_possible_truncation)] // a cell of 256
    pub fn read<const W: usize>(&mut self, edges: Edges<'_, W>) {
        let mut count = 0;
        for (cell, edge) in self.cells.iter_mut().zip(edges) {
            *cell = edge as u8;
            count += 1;
        }
        self.count = count;
    }

    #[allow(clippy::cast_possible_truncation)] // a cell of 256
    pub fn push(&mut self, edge: usize) {
        if let Some(cell) = self.cells.get_mut(self.count) {
            *cell = edge as u8;
            self.count += 1;
        }
    }

    pub fn clear(&mut self) {
        self.count = 0;
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub fn get(&self, place: usize) -> Option<usize> {
        if place < self.count { self.cells.get(place).map(|cell| usize::from(*cell)) } else { None }
    }
}

/// Follows the expected edges of a ray while its edges are encoded.
pub(super) struct Hints<'a> {
    edges: &'a EdgeList,
    /// Edges that are passed.
    passed: usize,
    /// The bit the first of the others turns to; edges alternate.
    bit: bool,
    /// Edges from here on say nothing.
    end: usize,
}

impl<'a> Hints<'a> {
    /// The edges of an expected ray that begins with this bit, from a cell on and before another one.
    pub fn new(edges: &'a EdgeList, first: bool, from: usize, end: usize) -> Self {
        let mut hints = Self { edges, passed: 0, bit: !first, end };
        hints.pass(from);
        hints
    }

    /// Passes the edges before this cell.
    #[inline]
    pub fn pass(&mut self, from: usize) {
        // bounded by the number of edges
        while self.edges.get(self.passed).is_some_and(|edge| edge < from) {
            self.passed += 1;
            self.bit = !self.bit;
        }
    }

    /// The first expected edge that turns `bit` over.
    #[inline]
    pub fn next(&self, bit: bool) -> Option<usize> {
        let edge = self.edges.get(self.passed + usize::from(self.bit == bit));
        edge.filter(|edge| *edge < self.end)
    }
}
