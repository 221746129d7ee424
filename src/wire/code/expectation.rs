//! What both sides of a block know before each symbol: what is expected, and how frequent what is.

use super::block::Kind;
use super::model::{MODEL, STOP_CLASSES, STOPS_BELOW};
use super::ray::{Known, Ray};
use crate::bits::Bits;

/// What went before a ray, and how a ray is told by it: the index into the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Before {
    pub first: bool,
    pub as_expected: bool,
    /// The neighbour is as it was in the refresh.
    pub still: bool,
}

impl Before {
    pub const START: Self = Self { first: true, as_expected: true, still: true };

    pub fn index(self, kind: Kind) -> usize {
        match (kind, self) {
            (Kind::Refresh, Self { first: true, .. }) => 0,
            (Kind::Refresh, Self { as_expected: true, .. }) => 1,
            (Kind::Refresh, _) => 2,
            (_, Self { first: true, .. }) => 3,
            (_, Self { still: true, as_expected: true, .. }) => 4,
            (_, Self { still: true, .. }) => 5,
            (_, Self { as_expected: true, .. }) => 6,
            _ => 7,
        }
    }
}

/// How the edge before was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Last {
    None,
    Same,
    Nearer,
    Farther,
    Other,
}

/// The frequencies for an edge after another.
pub(super) fn edge_table(kind: Kind, bit: bool, last: Last) -> &'static [u8] {
    let [a, b] = &MODEL.edge;
    let [dark, light] = if kind.index() == 0 { a } else { b };
    let [none, same, nearer, farther, other] = if bit { light } else { dark };
    match last {
        Last::None => none,
        Last::Same => same,
        Last::Nearer => nearer,
        Last::Farther => farther,
        Last::Other => other,
    }
}

pub(super) fn end_table(kind: Kind, bit: bool, last: Last) -> &'static [u8] {
    let [a, b] = &MODEL.end;
    let [dark, light] = if kind.index() == 0 { a } else { b };
    let [shift, other] = if bit { light } else { dark };
    if matches!(last, Last::None | Last::Other) { other } else { shift }
}

pub(super) fn distance_table(bit: bool) -> &'static [u8] {
    let [dark, light] = &MODEL.distance;
    if bit { light } else { dark }
}

pub(super) fn first_table(bit: bool) -> &'static [u8] {
    let [dark, light] = &MODEL.first;
    if bit { light } else { dark }
}

pub(super) fn ray_table<const W: usize>(kind: Kind, before: Before, expected: &Ray<W>) -> &'static [u8] {
    let edges = expected.has_toggles();
    let tables = MODEL.ray.get(before.index(kind)).unwrap_or(&MODEL.ray[0]);
    let [without, with] = tables;
    if edges { with } else { without }
}

/// The frequencies of "no further ray" with this room; `None` where it goes without saying.
pub(super) fn stop_table(room: u32) -> Option<&'static [u8]> {
    if room < STOPS_BELOW {
        return None;
    }
    // most often there is plenty
    let most = STOP_CLASSES.len();
    let plenty = STOP_CLASSES.last().is_some_and(|from| room >= *from);
    let class = if plenty { most } else { STOP_CLASSES.iter().filter(|from| room >= **from).count() };
    MODEL.stop.get(class).map(|t| t.as_slice())
}

/// Follows the expected edges of a ray while its edges are told.
pub(super) struct Expected<'a, const W: usize> {
    pub ray: &'a Ray<W>,
    pub toggles: Bits<W>,
    /// Expected edges before this cell are behind.
    pub from: usize,
}

impl<'a, const W: usize> Expected<'a, W> {
    pub fn new(ray: &'a Ray<W>) -> Self {
        Self { ray, toggles: ray.toggles(), from: 0 }
    }

    /// The first expected edge that turns `bit` over, before cell `end`.
    pub fn next(&self, bit: bool, end: usize) -> Option<usize> {
        let mut at = self.toggles.next(self.from)?;
        if self.ray.get(at) == bit {
            // edges alternate, so the one after it turns the other way
            at = self.toggles.next(at + 1)?;
        }
        (at < end).then_some(at)
    }
}

pub(super) fn shift(edge: usize, hint: usize) -> Last {
    match edge.cmp(&hint) {
        core::cmp::Ordering::Less => Last::Nearer,
        core::cmp::Ordering::Equal => Last::Same,
        core::cmp::Ordering::Greater => Last::Farther,
    }
}

/// What the rays told so far say of the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Progress<const W: usize> {
    pub before: Before,
    /// The ray before, or the usual one.
    pub neighbour: Ray<W>,
    /// What it was in the refresh.
    pub neighbour_was: Ray<W>,
}

impl<const W: usize> Progress<W> {
    pub fn new(usual: Known) -> Self {
        Self { before: Before::START, neighbour: Ray::clear(usual), neighbour_was: Ray::UNKNOWN }
    }

    /// What the next ray is expected to be; `was` is its ray in the refresh.
    pub fn expected(&self, kind: Kind, was: &Ray<W>) -> Ray<W> {
        match kind {
            Kind::Refresh => self.neighbour,
            Kind::Delta { .. } if self.before.first => *was,
            Kind::Delta { .. } => was.expected(&self.neighbour, &self.neighbour_was),
        }
    }

    pub fn advance(&mut self, ray: &Ray<W>, expected: &Ray<W>, was: &Ray<W>) {
        self.before = Before { first: false, as_expected: ray == expected, still: ray == was };
        (self.neighbour, self.neighbour_was) = (*ray, *was);
    }
}
