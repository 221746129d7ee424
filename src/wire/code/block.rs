//! Rays in, the words of one block out, and back: the code of the map.
//!
//! # Model
//! A block encodes consecutive azimuths from a start on. A *refresh* decodes alone: a ray is expected
//! to be like the one before it in the block, the first like the usual one of the header. A *delta*
//! is encoded against the refresh it names: the first ray is expected to be as it was, every other as
//! [`Ray::expected`] has it. What differs is encoded edge by edge: the next edge lies a few cells from
//! the expected one, or the expected one is gone, or there is a new one at a distance. Blocked and
//! clear stretches are long, so most rays take less than a bit.
//!
//! A ray too ragged for any block goes out in plain bits, outside this code.
//!
//! # Limits
//! 256 azimuths, 256 range cells. Decoding a block never loops more than (azimuths x 2 cells) times,
//! whatever the words say.

pub use super::basis::Basis;
use super::edges::{EdgeList, Hints};
use super::expectation::{EdgeTables, Expectation, Last, distance_table, first_table, shift, stop_table};
use super::interval::{Coder, Encoder, Form, Words};
use super::model::{AS_EXPECTED, BELOW, EDGES, GONE, IN_FULL, KNOWN, NEW, REACH, STOPS_BELOW};
use super::ray::{Known, Ray};

/// Bits that say how many ticks older a delta's refresh is, less one.
pub const AGE_BITS: u32 = 4;

/// What sender and receiver of a block agree on beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Context {
    /// Size and most number of the words.
    pub form: Form,
    /// The header's usually known cells.
    pub usual: Known,
    /// The header's number of azimuths.
    pub azimuths: usize,
    /// The header's number of range cells.
    pub ranges: usize,
}

/// The rays a block is made of or built on.
pub trait Rays<const W: usize> {
    /// The ray of an azimuth as it is now, if it is to be encoded in this block.
    fn now(&self, azimuth: usize) -> Option<&Ray<W>>;

    /// The ray of an azimuth in the refresh a delta names, if it is at hand.
    fn was(&self, azimuth: usize) -> Option<&Ray<W>>;
}

/// A block as words.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    words: Words,
    room: u32,
    /// First azimuth after the block; the start itself if nothing fitted.
    pub end: usize,
}

impl Block {
    /// Encodes as many azimuths from `start` on as fit, up to the first for which there is no ray.
    pub fn new<const W: usize>(context: &Context, kind: Basis, start: usize, rays: &impl Rays<W>) -> Self {
        let mut words = Words::NONE;
        let mut encoder = Encoder::new(&mut words, context.form);
        let end = encode(&mut encoder, context, kind, start, rays);
        let room = encoder.room();
        encoder.finish();
        Self { words, room, end }
    }

    /// Bits left.
    pub fn room(&self) -> u32 {
        self.room
    }

    /// The words, the first the most significant.
    pub fn words(&self) -> &[u64] {
        self.words.as_slice()
    }
}

/// Encodes as many azimuths from `start` on as fit, up to the first for which there is no ray; returns
/// the first azimuth after them.
pub fn encode<const W: usize>(
    coder: &mut impl Coder,
    context: &Context,
    kind: Basis,
    start: usize,
    rays: &impl Rays<W>,
) -> usize {
    if let Basis::Delta { ticks } = kind {
        // the first word has room
        let _ = coder.plain(AGE_BITS, usize::from(ticks.saturating_sub(1)));
    }
    let azimuths = context.azimuths;
    let mut progress = Expectation::new(kind, context.usual);
    for azimuth in start..azimuths {
        let before = coder.mark();
        let encoded = encode_ray(&mut progress, coder, azimuth, rays);
        if encoded.is_none() || (azimuth + 1 < azimuths && !can_stop(coder)) {
            coder.rewind(before);
            if azimuth > start {
                let _ = stop(coder);
            }
            return azimuth;
        }
    }
    azimuths
}

fn can_stop(coder: &mut impl Coder) -> bool {
    let room = coder.room();
    // "no further ray" takes 8 bits at most
    if !(STOPS_BELOW..=10).contains(&room) {
        return true;
    }
    let before = coder.mark();
    let stops = stop(coder).is_some();
    coder.rewind(before);
    stops
}

fn stop(coder: &mut impl Coder) -> Option<()> {
    stop_table(coder.room()).map_or(Some(()), |table| coder.symbol(table, 1))
}

/// Encodes an azimuth; `None` if it does not fit.
fn encode_ray<const W: usize>(
    progress: &mut Expectation<W>,
    coder: &mut impl Coder,
    azimuth: usize,
    rays: &impl Rays<W>,
) -> Option<()> {
    let ray = rays.now(azimuth)?;
    let was = match progress.kind {
        Basis::Refresh => &Ray::UNKNOWN,
        Basis::Delta { .. } => rays.was(azimuth).filter(|was| was.known == ray.known)?,
    };
    if !progress.before.first {
        coder.symbol(stop_table(coder.room())?, 0)?;
    }
    let expected = progress.expect(was);
    let table = progress.table();
    let as_expected = *ray == expected;
    if as_expected {
        coder.symbol(table, AS_EXPECTED)?;
    } else {
        if ray.known == expected.known {
            coder.symbol(table, EDGES)?;
        } else {
            coder.symbol(table, KNOWN)?;
            encode_limit(coder, ray.known.near(), expected.known.near())?;
            encode_limit(coder, ray.known.end(), expected.known.end())?;
        }
        let tables = EdgeTables::of(progress.kind);
        let (hints, edges) = progress.edges();
        edges.read(ray.edges());
        encode_edges(coder, tables, (ray, edges), (&expected, hints))?;
    }
    progress.advance(ray, was, as_expected);
    Some(())
}

/// Encodes the edges of a ray; `None` if they do not fit.
fn encode_edges<const W: usize>(
    coder: &mut impl Coder,
    tables: EdgeTables,
    (ray, edges): (&Ray<W>, &EdgeList),
    (expected, hints): (&Ray<W>, &EdgeList),
) -> Option<()> {
    if ray.known.is_empty() {
        return Some(());
    }
    let (mut bit, expected_bit) = (ray.first(), expected.known.is_empty() || expected.first());
    coder.symbol(first_table(expected_bit), usize::from(bit != expected_bit))?;
    let (mut place, mut last) = (ray.known.near(), Last::None);
    let mut hints = Hints::new(hints, expected_bit, place + 1, ray.known.end());
    let mut encoded = 0;
    loop {
        let edge = edges.get(encoded);
        if let Some(hint) = hints.next(bit) {
            let table = tables.edge(bit, last);
            match edge {
                Some(edge) if edge + REACH >= hint && edge <= hint + REACH => {
                    coder.symbol(table, edge + REACH - hint)?;
                    last = shift(edge, hint);
                    place = edge;
                }
                Some(edge) if edge < hint => {
                    coder.symbol(table, NEW)?;
                    encode_distance(coder, bit, edge - place)?;
                    last = Last::Other;
                    place = edge;
                }
                _ => {
                    coder.symbol(table, GONE)?;
                    last = Last::Other;
                    hints.pass(hint + 1);
                    continue;
                }
            }
        } else {
            let table = tables.end(bit, last);
            let Some(edge) = edge else { return coder.symbol(table, 0) };
            coder.symbol(table, 1)?;
            encode_distance(coder, bit, edge - place)?;
            last = Last::Other;
            place = edge;
        }
        encoded += 1;
        bit = !bit;
        hints.pass(place + 1);
    }
}

#[inline(never)]
fn encode_distance(coder: &mut impl Coder, bit: bool, distance: usize) -> Option<()> {
    let bits = distance.checked_ilog2()?;
    coder.symbol(distance_table(bit), bits as usize)?;
    coder.plain(bits, distance)
}

#[inline(never)]
fn encode_limit(coder: &mut impl Coder, limit: usize, expected: usize) -> Option<()> {
    let near = [expected, expected.wrapping_sub(1), expected + 1];
    let symbol = near.iter().position(|n| *n == limit).unwrap_or(IN_FULL);
    coder.symbol(&BELOW.limit, symbol)?;
    if symbol == IN_FULL { coder.plain(9, limit) } else { Some(()) }
}
