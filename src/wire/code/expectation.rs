//! What both sides of a block know before each symbol: what is expected, and how frequent what is.

use super::basis::Basis;
use super::edges::EdgeList;
use super::model::{BELOW, STOP_CLASSES, STOPS_BELOW};
use super::ray::{Known, Ray};

/// What went before a ray, and how a ray is encoded by it: the index into the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Before {
    pub first: bool,
    pub as_expected: bool,
    /// The neighbour is as it was in the refresh.
    pub still: bool,
}

impl Before {
    pub const START: Self = Self { first: true, as_expected: true, still: true };

    pub fn index(self, kind: Basis) -> usize {
        match kind {
            Basis::Refresh if self.first => 0,
            Basis::Refresh => 1 + usize::from(!self.as_expected),
            Basis::Delta { .. } if self.first => 3,
            Basis::Delta { .. } => 4 + usize::from(!self.as_expected) + 2 * usize::from(!self.still),
        }
    }
}

/// How the edge before was encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Last {
    None,
    Same,
    Nearer,
    Farther,
    Other,
}

/// The frequencies for the edges of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeTables {
    edge: &'static [[[u8; 13]; 5]; 2],
    end: &'static [[[u8; 2]; 2]; 2],
}

impl EdgeTables {
    pub fn of(kind: Basis) -> Self {
        let ([refresh, delta], [refresh_end, delta_end]) = (&BELOW.edge, &BELOW.end);
        match kind {
            Basis::Refresh => Self { edge: refresh, end: refresh_end },
            Basis::Delta { .. } => Self { edge: delta, end: delta_end },
        }
    }

    /// Where an edge is expected.
    pub fn edge(&self, bit: bool, last: Last) -> &'static [u8; 13] {
        let [dark, light] = self.edge;
        let tables = if bit { light } else { dark };
        tables.get(last as usize).unwrap_or(&tables[0])
    }

    /// Where none is expected any more.
    pub fn end(&self, bit: bool, last: Last) -> &'static [u8; 2] {
        let [dark, light] = self.end;
        let [shift, other] = if bit { light } else { dark };
        if matches!(last, Last::None | Last::Other) { other } else { shift }
    }
}

pub(super) fn distance_table(bit: bool) -> &'static [u8; 8] {
    let [dark, light] = &BELOW.distance;
    if bit { light } else { dark }
}

pub(super) fn first_table(bit: bool) -> &'static [u8; 2] {
    let [dark, light] = &BELOW.first;
    if bit { light } else { dark }
}

/// The frequencies of "no further ray" with this room; `None` where it goes without saying.
#[inline]
pub(super) fn stop_table(room: u32) -> Option<&'static [u8; 2]> {
    if room < STOPS_BELOW {
        return None;
    }
    // most often there is plenty
    let [.., plenty] = &BELOW.stop;
    if STOP_CLASSES.last().is_some_and(|from| room >= *from) { Some(plenty) } else { scarce_table(room) }
}

#[inline(never)]
fn scarce_table(room: u32) -> Option<&'static [u8; 2]> {
    BELOW.stop.get(STOP_CLASSES.iter().filter(|from| room >= **from).count())
}

pub(super) fn shift(edge: usize, hint: usize) -> Last {
    match edge.cmp(&hint) {
        core::cmp::Ordering::Less => Last::Nearer,
        core::cmp::Ordering::Equal => Last::Same,
        core::cmp::Ordering::Greater => Last::Farther,
    }
}

/// What the rays encoded so far say of the next.
#[derive(Debug, Clone)]
pub(super) struct Expectation<const W: usize> {
    pub kind: Basis,
    pub before: Before,
    /// The ray before, or the usual one.
    neighbour: Ray<W>,
    /// What it was in the refresh.
    neighbour_was: Ray<W>,
    /// The expected edges of the next ray, and those of the ray at hand, where they are encoded.
    lists: [EdgeList; 2],
    swapped: bool,
}

impl<const W: usize> Expectation<W> {
    /// At a block's start.
    pub fn new(kind: Basis, usual: Known) -> Self {
        Self::after(kind, Before::START, Ray::clear(usual), Ray::UNKNOWN)
    }

    /// After an azimuth.
    pub fn after(kind: Basis, before: Before, neighbour: Ray<W>, neighbour_was: Ray<W>) -> Self {
        let mut lists = [EdgeList::NONE; 2];
        lists[0].read(neighbour.edges());
        Self { kind, before, neighbour, neighbour_was, lists, swapped: false }
    }

    /// The expected edges of the next ray, and a place for its own.
    pub fn edges(&mut self) -> (&EdgeList, &mut EdgeList) {
        let [a, b] = &mut self.lists;
        if self.swapped { (b, a) } else { (a, b) }
    }

    fn hints(&mut self) -> &mut EdgeList {
        let [a, b] = &mut self.lists;
        if self.swapped { b } else { a }
    }

    /// The frequencies of how the next ray is encoded.
    pub fn table(&mut self) -> &'static [u8; 3] {
        let [without, with] = BELOW.ray.get(self.before.index(self.kind)).unwrap_or(&BELOW.ray[0]);
        if self.hints().is_empty() { without } else { with }
    }

    /// What the next ray is expected to be; `was` is its ray in the refresh.
    pub fn expect(&mut self, was: &Ray<W>) -> Ray<W> {
        let expected = match self.kind {
            // the hints are the neighbour's already
            Basis::Refresh => return self.neighbour,
            // as is the first
            Basis::Delta { .. } if self.before.still => *was,
            Basis::Delta { .. } => was.expected(&self.neighbour, &self.neighbour_was),
        };
        self.hints().read(expected.edges());
        expected
    }

    /// Goes on after a ray; unless it is as expected, its edges were noted.
    pub fn advance(&mut self, ray: &Ray<W>, was: &Ray<W>, as_expected: bool) {
        self.swapped ^= !as_expected;
        self.before = Before { first: false, as_expected, still: ray == was };
        (self.neighbour, self.neighbour_was) = (*ray, *was);
    }
}
