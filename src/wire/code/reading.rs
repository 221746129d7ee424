//! The words of a block in, as far as they are there, rays out.

use super::block::{AGE_BITS, Basis, Context};
use super::edges::{EdgeList, Hints};
use super::expectation::{Before, EdgeTables, Expectation, Last, distance_table, first_table, shift, stop_table};
use super::interval::{Decoder, Form, OutOfWords};
use super::model::{AS_EXPECTED, BELOW, EDGES, GONE, KNOWN, NEW, REACH};
use super::ray::{Known, Ray};
use crate::fixed::bits::Bits;
use core::ops::Range;

/// Why a block's decoding ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Ending {
    /// The block is complete.
    Complete,
    /// A further word is needed to go on.
    OutOfWords,
    /// The words say something no encoder says.
    Malformed,
    /// The refresh a delta names is not at hand for an azimuth.
    NoRefresh,
}

/// How many ticks older the refresh is that a delta with this first word names.
pub fn age(words: &[u64], form: Form) -> Option<u8> {
    // plain bits at the start are the first word's own
    let age = words.first()? >> form.bits.saturating_sub(AGE_BITS);
    u8::try_from(age + 1).ok()
}

/// Takes the rays of a block, azimuth by azimuth.
pub trait Reader<const W: usize> {
    /// The ray of an azimuth in the refresh a delta names, if it is at hand.
    fn was(&self, azimuth: usize) -> Option<Ray<W>>;

    /// A ray as it is now.
    fn take(&mut self, azimuth: usize, ray: &Ray<W>);

    /// A ray that was taken from this block before, if it is still at hand.
    fn taken(&self, _azimuth: usize) -> Option<Ray<W>> {
        None
    }
}

/// Where reading goes on when a further word comes.
///
/// Without it each word has its block read from the start again: a receiver on classic CAN then takes half as long again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resume {
    /// The azimuth that could not be read; 0 if reading begins at the start.
    azimuth: u8,
    as_expected: bool,
    still: bool,
    used: u8,
    value: u64,
    width: u64,
}

impl Resume {
    /// At the block's start.
    pub const START: Self = Self { azimuth: 0, as_expected: true, still: true, used: 0, value: 0, width: 0 };

    /// Somewhere behind the start.
    #[cfg(test)]
    pub fn at(azimuth: u8) -> Self {
        Self { azimuth, used: 1, ..Self::START }
    }

    fn of(azimuth: usize, before: Before, (used, value, width): (usize, u64, u64)) -> Self {
        let Before { as_expected, still, .. } = before;
        let number = |n: usize| u8::try_from(n).ok();
        match number(azimuth).zip(number(used)) {
            Some((azimuth, used)) if !before.first => Self { azimuth, as_expected, still, used, value, width },
            _ => Self::START,
        }
    }

    /// What went before the azimuth to go on with: the ray, and what it was in the refresh. `None` at the
    /// start, or if it is not at hand any more.
    fn after<const W: usize>(&self, kind: Basis, reader: &impl Reader<W>) -> Option<(Ray<W>, Ray<W>)> {
        let before = usize::from(self.azimuth).checked_sub(1)?;
        let neighbour = reader.taken(before)?;
        Some((neighbour, if kind == Basis::Refresh { Ray::UNKNOWN } else { reader.was(before)? }))
    }
}

/// Reads what is there of a block, from its start or from where words ended before.
pub fn decode<const W: usize>(
    words: &[u64],
    context: &Context,
    kind: Basis,
    start: usize,
    place: &mut Resume,
    reader: &mut impl Reader<W>,
) -> Ending {
    let Ok(mut decoder) = Decoder::new(words, context.form) else { return Ending::OutOfWords };
    let (mut before, mut from) = (Before::START, start);
    let (neighbour, neighbour_was) = match place.after(kind, reader) {
        Some(after) => {
            from = usize::from(place.azimuth);
            before = Before { first: false, as_expected: place.as_expected, still: place.still };
            decoder = Decoder::resume(words, context.form, (usize::from(place.used), place.value, place.width));
            after
        }
        None => {
            if kind != Basis::Refresh && decoder.plain(AGE_BITS).is_err() {
                return Ending::OutOfWords;
            }
            (Ray::clear(context.usual), Ray::UNKNOWN)
        }
    };
    let mut progress = Expectation::after(kind, before, neighbour, neighbour_was);
    let (ending, (azimuth, before, state)) =
        go(&mut decoder, &mut progress, (from..context.azimuths, context.ranges), reader);
    *place = Resume::of(azimuth, before, state);
    ending
}

/// Where an azimuth begins.
type At = (usize, Before, (usize, u64, u64));

/// Reads azimuths; also where the last begins that was looked at.
fn go<const W: usize>(
    decoder: &mut Decoder<'_>,
    progress: &mut Expectation<W>,
    (azimuths, ranges): (Range<usize>, usize),
    reader: &mut impl Reader<W>,
) -> (Ending, At) {
    let mut at = (azimuths.start, progress.before, decoder.state());
    for azimuth in azimuths {
        at = (azimuth, progress.before, decoder.state());
        if !progress.before.first {
            match stop_table(decoder.room()).map(|table| decoder.symbol(table)) {
                None | Some(Ok(1)) => return (complete(decoder), at),
                Some(Err(OutOfWords)) => return (Ending::OutOfWords, at),
                Some(Ok(_)) => {}
            }
        }
        let refreshed = match progress.kind {
            Basis::Refresh => Ray::UNKNOWN,
            Basis::Delta { .. } => match reader.was(azimuth) {
                Some(ray) => ray,
                None => return (Ending::NoRefresh, at),
            },
        };
        let mut ray = progress.expect(&refreshed);
        match decode_ray(decoder, progress, ranges, &mut ray) {
            Ok(as_expected) => {
                reader.take(azimuth, &ray);
                progress.advance(&ray, &refreshed, as_expected);
            }
            Err(NotARay::OutOfWords) => return (Ending::OutOfWords, at),
            Err(NotARay::Malformed) => return (Ending::Malformed, at),
        }
    }
    (complete(decoder), at)
}

/// After an intact block nothing is left of the number.
fn complete(decoder: &Decoder<'_>) -> Ending {
    if decoder.rest() == 0 { Ending::Complete } else { Ending::Malformed }
}

/// The words do not encode a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum NotARay {
    /// A further word is needed.
    OutOfWords,
    /// The words say something no encoder says.
    Malformed,
}

impl From<OutOfWords> for NotARay {
    fn from(_: OutOfWords) -> Self {
        Self::OutOfWords
    }
}

/// Makes the expected ray the one that is encoded; whether it is as expected.
fn decode_ray<const W: usize>(
    decoder: &mut Decoder<'_>,
    progress: &mut Expectation<W>,
    ranges: usize,
    ray: &mut Ray<W>,
) -> Result<bool, NotARay> {
    let known = match decoder.symbol(progress.table())? {
        AS_EXPECTED => return Ok(true),
        EDGES => ray.known,
        KNOWN if progress.kind == Basis::Refresh => {
            let near = decode_limit(decoder, ray.known.near())?;
            let end = decode_limit(decoder, ray.known.end())?;
            limits::<W>(near, end, ranges)?
        }
        _ => return Err(NotARay::Malformed),
    };
    let tables = EdgeTables::of(progress.kind);
    let (hints, edges) = progress.edges();
    let encoded = decode_edges(decoder, tables, known, (ray, hints), edges)?;
    let as_expected = *ray == encoded;
    *ray = encoded;
    Ok(as_expected)
}

/// Known cells as encoded: nothing, or within the row.
fn limits<const W: usize>(near: usize, end: usize, ranges: usize) -> Result<Known, NotARay> {
    let known = Known::new(near, end);
    let none = near == Known::NONE.near() && end == Known::NONE.end();
    if (known.is_empty() && !none) || end > ranges.min(Bits::<W>::CAPACITY) {
        Err(NotARay::Malformed)
    } else {
        Ok(known)
    }
}

/// Reads edges up to the end of a ray with these known cells.
fn decode_edges<const W: usize>(
    decoder: &mut Decoder<'_>,
    tables: EdgeTables,
    known: Known,
    (expected, hints): (&Ray<W>, &EdgeList),
    edges: &mut EdgeList,
) -> Result<Ray<W>, NotARay> {
    edges.clear();
    if known.is_empty() {
        return Ok(Ray::UNKNOWN);
    }
    let expected_bit = expected.known.is_empty() || expected.first();
    let first = expected_bit ^ (decoder.symbol(first_table(expected_bit))? == 1);
    let mut bit = first;
    let (mut place, mut last) = (known.near(), Last::None);
    let mut painted = Painter::NONE;
    if first {
        painted.turn(place);
    }
    let mut hints = Hints::new(hints, expected_bit, place + 1, known.end());
    // each turn leaves an expected or an encoded edge behind
    for _ in 0..2 * Bits::<W>::CAPACITY {
        if let Some(hint) = hints.next(bit) {
            match decoder.symbol(tables.edge(bit, last))? {
                GONE => {
                    last = Last::Other;
                    hints.pass(hint + 1);
                    continue;
                }
                NEW => {
                    place += decode_distance(decoder, bit)?;
                    last = Last::Other;
                }
                encoded => {
                    let edge = (hint + encoded).checked_sub(REACH).filter(|e| *e > place).ok_or(NotARay::Malformed)?;
                    last = shift(edge, hint);
                    place = edge;
                }
            }
        } else if decoder.symbol(tables.end(bit, last))? == 0 {
            if bit {
                painted.turn(known.end());
            }
            return Ok(Ray::within(known, painted.bits()));
        } else {
            place += decode_distance(decoder, bit)?;
            last = Last::Other;
        }
        if place >= known.end() {
            return Err(NotARay::Malformed);
        }
        edges.push(place);
        painted.turn(place);
        bit = !bit;
        hints.pass(place + 1);
    }
    Err(NotARay::Malformed)
}

/// A row of bits, painted from edge to edge.
struct Painter<const W: usize> {
    /// As each word is if no cell before it is set.
    words: [u32; W],
    /// Words with an odd number of edges, a bit each.
    odd: u32,
}

impl<const W: usize> Painter<W> {
    const NONE: Self = Self { words: [0; W], odd: 0 };

    /// Turns the bits over from a cell on; beyond the row nothing happens.
    #[inline]
    fn turn(&mut self, cell: usize) {
        if let Some(word) = self.words.get_mut(cell / 32) {
            *word ^= u32::MAX << (cell % 32);
            self.odd ^= 1 << (cell / 32);
        }
    }

    /// All that was painted.
    fn bits(mut self) -> Bits<W> {
        let mut before = 0;
        for word in &mut self.words {
            *word ^= before;
            before ^= 0_u32.wrapping_sub(self.odd & 1);
            self.odd >>= 1;
        }
        Bits::from_words(self.words)
    }
}

#[inline(always)]
fn decode_distance(decoder: &mut Decoder<'_>, bit: bool) -> Result<usize, NotARay> {
    let bits = decoder.symbol(distance_table(bit))?;
    let low = decoder.plain(u32::try_from(bits).unwrap_or(0))?;
    Ok((1 << bits) | low)
}

#[inline(always)]
fn decode_limit(decoder: &mut Decoder<'_>, expected: usize) -> Result<usize, NotARay> {
    match decoder.symbol(&BELOW.limit)? {
        0 => Ok(expected),
        1 => expected.checked_sub(1).ok_or(NotARay::Malformed),
        2 => Ok(expected + 1),
        _ => Ok(decoder.plain(9)?),
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::{Block, Rays};
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    const USUAL: Known = Known::new(3, 60);

    fn context(form: Form, azimuths: usize) -> Context {
        Context { form, usual: USUAL, azimuths, ranges: 64 }
    }

    /// Reads into closures.
    struct Closures<F, G>(F, G);

    impl<F: Fn(usize) -> Option<Ray<2>>, G: FnMut(usize, Ray<2>)> Reader<2> for Closures<F, G> {
        fn was(&self, azimuth: usize) -> Option<Ray<2>> {
            self.0(azimuth)
        }
        fn take(&mut self, azimuth: usize, ray: &Ray<2>) {
            self.1(azimuth, *ray);
        }
    }

    /// Remembers what it took.
    struct Resuming<'a> {
        was: &'a [Ray<2>],
        taken: Vec<Option<Ray<2>>>,
    }

    impl Reader<2> for Resuming<'_> {
        fn was(&self, azimuth: usize) -> Option<Ray<2>> {
            self.was.get(azimuth).copied()
        }
        fn take(&mut self, azimuth: usize, ray: &Ray<2>) {
            assert!(self.taken[azimuth].is_none(), "encoded twice");
            self.taken[azimuth] = Some(*ray);
        }
        fn taken(&self, azimuth: usize) -> Option<Ray<2>> {
            self.taken[azimuth]
        }
    }

    struct Map {
        now: Vec<Ray<2>>,
        was: Vec<Ray<2>>,
    }

    impl Rays<2> for Map {
        fn now(&self, azimuth: usize) -> Option<&Ray<2>> {
            self.now.get(azimuth)
        }
        fn was(&self, azimuth: usize) -> Option<&Ray<2>> {
            self.was.get(azimuth)
        }
    }

    /// Rays with edges at these cells.
    fn ray(known: Known, edges: &[usize]) -> Ray<2> {
        let mut bits = Bits::NONE;
        let mut lit = true;
        for cell in 0..64 {
            lit ^= edges.contains(&cell);
            if lit {
                bits.set(cell);
            }
        }
        Ray::new(known, bits)
    }

    fn any_ray() -> impl Strategy<Value = Ray<2>> {
        let known = prop_oneof![
            6 => Just(USUAL),
            1 => (0..64_usize, 0..=64_usize).prop_map(|(near, end)| Known::new(near, end)),
        ];
        let edges = prop_oneof![
            8 => prop::collection::vec(0..64_usize, 0..4),
            1 => prop::collection::vec(0..64_usize, 0..64),
        ];
        (known, edges).prop_map(|(known, edges)| ray(known, &edges))
    }

    /// All blocks of a map, decoded again.
    fn through(map: &Map, form: Form, kind: Basis) -> (Vec<Ray<2>>, usize) {
        let count = map.now.len();
        let context = Context { form, usual: USUAL, azimuths: count, ranges: 64 };
        let mut got = vec![Ray::UNKNOWN; count];
        let (mut at, mut words) = (0, 0);
        while at < count {
            let block = Block::new(&context, kind, at, map);
            if block.end == at {
                got[at] = map.now[at];
                at += 1;
                continue;
            }
            let mut next = at;
            let was = |a: usize| map.was.get(a).copied();
            let ending = decode(
                block.words(),
                &context,
                kind,
                at,
                &mut { Resume::START },
                &mut Closures(was, |a, encoded| {
                    assert_eq!(a, next);
                    next += 1;
                    got[a] = encoded;
                }),
            );
            assert_eq!((ending, next), (Ending::Complete, block.end));
            words += block.words().len();
            // fewer words give fewer rays, and the same ones; further words go on from there
            let mut resuming = Resuming { was: &map.was, taken: vec![None; count] };
            let mut place = Resume::START;
            for n in 1..=block.words().len() {
                let ending = decode(&block.words()[..n], &context, kind, at, &mut place, &mut resuming);
                let done = n == block.words().len();
                assert_eq!(ending, if done { Ending::Complete } else { Ending::OutOfWords });
                assert!(resuming.taken.iter().zip(&map.now).all(|(t, now)| t.is_none_or(|t| t == *now)));
            }
            assert!((at..block.end).all(|a| resuming.taken[a].is_some()));
            at = block.end;
        }
        (got, words)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 200 } else { 2000 }))]

        #[test]
        fn any_map_comes_back_from_refreshes(now in prop::collection::vec(any_ray(), 1..40), long: bool) {
            let map = Map { was: Vec::new(), now };
            let form = if long { Form::LONG } else { Form::CLASSIC };
            prop_assert_eq!(through(&map, form, Basis::Refresh).0, map.now);
        }

        #[test]
        fn any_map_comes_back_from_deltas(
            rays in prop::collection::vec((any_ray(), prop::collection::vec(0..64_usize, 0..6), any::<bool>()), 1..40),
            ticks in 1..=16_u8,
        ) {
            let was: Vec<_> = rays.iter().map(|(was, ..)| *was).collect();
            let now = rays.iter().map(|(was, edges, same)| if *same { *was } else { ray(was.known, edges) }).collect();
            let map = Map { now, was };
            let block = Block::new(&context(Form::CLASSIC, map.now.len()), Basis::Delta { ticks }, 0, &map);
            prop_assert_eq!(age(block.words(), Form::CLASSIC), Some(ticks));
            prop_assert_eq!(through(&map, Form::CLASSIC, Basis::Delta { ticks }).0, map.now);
        }

        #[test]
        fn any_words_end_one_way_or_another(
            words in prop::collection::vec(0..1_u64 << 33, 0..5),
            delta: bool,
            start in 0..130_usize,
            usual in (0..64_usize, 0..=64_usize),
        ) {
            let kind = if delta { Basis::Delta { ticks: 3 } } else { Basis::Refresh };
            let mut taken = 0;
            let was = |a: usize| (a % 7 != 6).then(|| ray(USUAL, &[a % 50, 55]));
            let usual = Known::new(usual.0, usual.1);
            let context = Context { usual, ..context(Form::CLASSIC, 120) };
            decode::<2>(&words, &context, kind, start, &mut { Resume::START }, &mut Closures(was, |a: usize, _| {
                assert!(a >= start && a < 120);
                taken += 1;
            }));
            prop_assert!(taken <= 120);
        }
    }

    #[test]
    fn a_shadow_that_moves_on_is_a_shift() {
        let was = vec![ray(USUAL, &[]), ray(USUAL, &[20, 30]), ray(USUAL, &[20, 30]), ray(USUAL, &[])];
        let now = vec![ray(USUAL, &[]), ray(USUAL, &[18, 28]), ray(USUAL, &[18, 28]), ray(USUAL, &[])];
        let map = Map { now, was };
        let block = Block::new(&context(Form::CLASSIC, 4), Basis::Delta { ticks: 4 }, 0, &map);
        let bits = 132 - block.room();
        assert!(block.end == 4 && bits <= 32, "{bits} bits, and 4 of them for the refresh's age");
    }

    #[test]
    fn a_delta_without_its_refresh_gives_no_ray() {
        let map = Map { now: vec![ray(USUAL, &[9])], was: vec![ray(USUAL, &[])] };
        let kind = Basis::Delta { ticks: 1 };
        let block = Block::new(&context(Form::LONG, 1), kind, 0, &map);
        let ending = decode::<2>(
            block.words(),
            &context(Form::LONG, 1),
            kind,
            0,
            &mut { Resume::START },
            &mut Closures(|_| None, |_, _| panic!("taken")),
        );
        assert_eq!(ending, Ending::NoRefresh);
    }

    #[test]
    fn known_cells_that_changed_need_a_refresh() {
        let map = Map { now: vec![ray(Known::new(4, 60), &[])], was: vec![ray(USUAL, &[])] };
        assert_eq!(Block::new(&context(Form::LONG, 1), Basis::Delta { ticks: 1 }, 0, &map).end, 0);
        assert_eq!(Block::new(&context(Form::LONG, 1), Basis::Refresh, 0, &map).end, 1);
    }
}
