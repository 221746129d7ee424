//! The words of a block in, as far as they are there, rays out.

use super::block::{AGE_BITS, Context, Kind};
use super::expectation::{
    Before, Expected, Last, Progress, distance_table, edge_table, end_table, first_table, ray_table, shift, stop_table,
};
use super::interval::{Decoder, Form, OutOfWords};
use super::model::{AS_EXPECTED, EDGES, GONE, KNOWN, MODEL, NEW, REACH};
use super::ray::{Known, Ray};
use crate::bits::Bits;

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
    let mut decoder = Decoder::new(words, form).ok()?;
    let age = decoder.plain(AGE_BITS).ok()?;
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The azimuth that could not be read; 0 if reading begins at the start.
    azimuth: u8,
    as_expected: bool,
    still: bool,
    used: u8,
    value: u64,
    width: u64,
}

impl Place {
    /// At the block's start.
    pub const START: Self = Self { azimuth: 0, as_expected: true, still: true, used: 0, value: 0, width: 0 };

    fn of<const W: usize>(azimuth: usize, progress: &Progress<W>, decoder: &Decoder<'_>) -> Self {
        let (used, value, width) = decoder.state();
        let Before { as_expected, still, .. } = progress.before;
        let number = |n: usize| u8::try_from(n).ok();
        match number(azimuth).zip(number(used)) {
            Some((azimuth, used)) if !progress.before.first => Self { azimuth, as_expected, still, used, value, width },
            _ => Self::START,
        }
    }

    /// Goes on here: the decoder, what is known of the next azimuth, and which it is. `None` if the
    /// azimuth before is not at hand any more.
    fn go_on<'a, const W: usize>(
        &self,
        words: &'a [u64],
        context: &Context,
        kind: Kind,
        reader: &impl Reader<W>,
    ) -> Option<(Decoder<'a>, Progress<W>, usize)> {
        let azimuth = usize::from(self.azimuth);
        let before = azimuth.checked_sub(1)?;
        let neighbour = reader.taken(before)?;
        let neighbour_was = if kind == Kind::Refresh { Ray::UNKNOWN } else { reader.was(before)? };
        let before = Before { first: false, as_expected: self.as_expected, still: self.still };
        let decoder = Decoder::resume(words, context.form, (usize::from(self.used), self.value, self.width));
        Some((decoder, Progress { before, neighbour, neighbour_was }, azimuth))
    }
}

/// Reads what is there of a block, from its start or from where words ended before.
pub fn decode<const W: usize>(
    words: &[u64],
    context: &Context,
    kind: Kind,
    start: usize,
    place: &mut Place,
    reader: &mut impl Reader<W>,
) -> Ending {
    let (mut decoder, mut progress, from) = match place.go_on(words, context, kind, reader) {
        Some(there) => there,
        None => {
            let Ok(mut decoder) = Decoder::new(words, context.form) else { return Ending::OutOfWords };
            if kind != Kind::Refresh && decoder.plain(AGE_BITS).is_err() {
                return Ending::OutOfWords;
            }
            (decoder, Progress::new(context.usual), start)
        }
    };
    for azimuth in from..context.azimuths {
        *place = Place::of(azimuth, &progress, &decoder);
        if !progress.before.first {
            match stop_table(decoder.room()).map(|table| decoder.symbol(table)) {
                None | Some(Ok(1)) => return complete(&decoder),
                Some(Err(OutOfWords)) => return Ending::OutOfWords,
                Some(Ok(_)) => {}
            }
        }
        let refreshed = match kind {
            Kind::Refresh => Ray::UNKNOWN,
            Kind::Delta { .. } => match reader.was(azimuth) {
                Some(ray) => ray,
                None => return Ending::NoRefresh,
            },
        };
        let expected = progress.expected(kind, &refreshed);
        match decode_ray(&mut decoder, kind, progress.before, &expected) {
            Ok(ray) => {
                reader.take(azimuth, &ray);
                progress.advance(&ray, &expected, &refreshed);
            }
            Err(NotARay::OutOfWords) => return Ending::OutOfWords,
            Err(NotARay::Malformed) => return Ending::Malformed,
        }
    }
    complete(&decoder)
}

/// Behind an intact block nothing is left of the number.
fn complete(decoder: &Decoder<'_>) -> Ending {
    if decoder.rest() == 0 { Ending::Complete } else { Ending::Malformed }
}

/// The words do not tell a ray.
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

fn decode_ray<const W: usize>(
    decoder: &mut Decoder<'_>,
    kind: Kind,
    before: Before,
    expected: &Ray<W>,
) -> Result<Ray<W>, NotARay> {
    let known = match decoder.symbol(ray_table(kind, before, expected))? {
        AS_EXPECTED => return Ok(*expected),
        EDGES => expected.known,
        KNOWN if kind == Kind::Refresh => {
            let near = decode_limit(decoder, expected.known.near())?;
            let end = decode_limit(decoder, expected.known.end())?;
            limits::<W>(near, end)?
        }
        _ => return Err(NotARay::Malformed),
    };
    decode_edges(decoder, kind, known, expected)
}

/// Known cells as told: nothing, or within the row.
fn limits<const W: usize>(near: usize, end: usize) -> Result<Known, NotARay> {
    let known = Known::new(near, end);
    let none = near == Known::NONE.near() && end == Known::NONE.end();
    if (known.is_empty() && !none) || end > Bits::<W>::CAPACITY { Err(NotARay::Malformed) } else { Ok(known) }
}

/// Reads edges up to the end of a ray with these known cells.
fn decode_edges<const W: usize>(
    decoder: &mut Decoder<'_>,
    kind: Kind,
    known: Known,
    expected: &Ray<W>,
) -> Result<Ray<W>, NotARay> {
    if known.is_empty() {
        return Ok(Ray::UNKNOWN);
    }
    let expected_bit = expected.known.is_empty() || expected.first();
    let first = expected_bit ^ (decoder.symbol(first_table(expected_bit))? == 1);
    let mut bit = first;
    let mut toggles = Bits::NONE;
    let mut hints = Expected::new(expected);
    let (mut place, mut last) = (known.near(), Last::None);
    hints.from = place + 1;
    // each turn leaves an expected or a told edge behind
    for _ in 0..2 * Bits::<W>::CAPACITY {
        if let Some(hint) = hints.next(bit, known.end()) {
            match decoder.symbol(edge_table(kind, bit, last))? {
                GONE => {
                    last = Last::Other;
                    hints.from = hint + 1;
                    continue;
                }
                NEW => {
                    place += decode_distance(decoder, bit)?;
                    last = Last::Other;
                }
                told => {
                    let edge = (hint + told).checked_sub(REACH).filter(|e| *e > place).ok_or(NotARay::Malformed)?;
                    last = shift(edge, hint);
                    place = edge;
                }
            }
        } else if decoder.symbol(end_table(kind, bit, last))? == 0 {
            return Ok(ray_of(known, &toggles, first));
        } else {
            place += decode_distance(decoder, bit)?;
            last = Last::Other;
        }
        if place >= known.end() {
            return Err(NotARay::Malformed);
        }
        toggles.set(place);
        bit = !bit;
        hints.from = hints.from.max(place + 1);
    }
    Err(NotARay::Malformed)
}

/// The ray with these edges whose first known cell has this bit.
fn ray_of<const W: usize>(known: Known, toggles: &Bits<W>, first: bool) -> Ray<W> {
    let mut lit = first;
    let words = toggles.words().map(|mut word| {
        // each bit the parity of the edges up to it
        for shift in [1, 2, 4, 8, 16] {
            word ^= word << shift;
        }
        let parity = word >> 31 == 1;
        let bits = if lit { !word } else { word };
        lit ^= parity;
        bits
    });
    Ray::new(known, Bits::from_words(words))
}

fn decode_distance(decoder: &mut Decoder<'_>, bit: bool) -> Result<usize, NotARay> {
    let bits = decoder.symbol(distance_table(bit))?;
    let low = decoder.plain(u32::try_from(bits).unwrap_or(0))?;
    Ok((1 << bits) | low)
}

fn decode_limit(decoder: &mut Decoder<'_>, expected: usize) -> Result<usize, NotARay> {
    match decoder.symbol(&MODEL.limit)? {
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
        Context { form, usual: USUAL, azimuths }
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
            assert!(self.taken[azimuth].is_none(), "told twice");
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
    fn through(map: &Map, form: Form, kind: Kind) -> (Vec<Ray<2>>, usize) {
        let count = map.now.len();
        let context = Context { form, usual: USUAL, azimuths: count };
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
                &mut { Place::START },
                &mut Closures(was, |a, told| {
                    assert_eq!(a, next);
                    next += 1;
                    got[a] = told;
                }),
            );
            assert_eq!((ending, next), (Ending::Complete, block.end));
            words += block.words().len();
            // fewer words give fewer rays, and the same ones; further words go on from there
            let mut resuming = Resuming { was: &map.was, taken: vec![None; count] };
            let mut place = Place::START;
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
            prop_assert_eq!(through(&map, form, Kind::Refresh).0, map.now);
        }

        #[test]
        fn any_map_comes_back_from_deltas(
            rays in prop::collection::vec((any_ray(), prop::collection::vec(0..64_usize, 0..6), any::<bool>()), 1..40),
            ticks in 1..=16_u8,
        ) {
            let was: Vec<_> = rays.iter().map(|(was, ..)| *was).collect();
            let now = rays.iter().map(|(was, edges, same)| if *same { *was } else { ray(was.known, edges) }).collect();
            let map = Map { now, was };
            let block = Block::new(&context(Form::CLASSIC, map.now.len()), Kind::Delta { ticks }, 0, &map);
            prop_assert_eq!(age(block.words(), Form::CLASSIC), Some(ticks));
            prop_assert_eq!(through(&map, Form::CLASSIC, Kind::Delta { ticks }).0, map.now);
        }

        #[test]
        fn any_words_end_one_way_or_another(
            words in prop::collection::vec(0..1_u64 << 33, 0..5),
            delta: bool,
            start in 0..130_usize,
            usual in (0..64_usize, 0..=64_usize),
        ) {
            let kind = if delta { Kind::Delta { ticks: 3 } } else { Kind::Refresh };
            let mut taken = 0;
            let was = |a: usize| (a % 7 != 6).then(|| ray(USUAL, &[a % 50, 55]));
            let usual = Known::new(usual.0, usual.1);
            let context = Context { usual, ..context(Form::CLASSIC, 120) };
            decode::<2>(&words, &context, kind, start, &mut { Place::START }, &mut Closures(was, |a: usize, _| {
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
        let block = Block::new(&context(Form::CLASSIC, 4), Kind::Delta { ticks: 4 }, 0, &map);
        let bits = 132 - block.room();
        assert!(block.end == 4 && bits <= 32, "{bits} bits, and 4 of them for the refresh's age");
    }

    #[test]
    fn a_delta_without_its_refresh_tells_nothing() {
        let map = Map { now: vec![ray(USUAL, &[9])], was: vec![ray(USUAL, &[])] };
        let kind = Kind::Delta { ticks: 1 };
        let block = Block::new(&context(Form::LONG, 1), kind, 0, &map);
        let ending = decode::<2>(
            block.words(),
            &context(Form::LONG, 1),
            kind,
            0,
            &mut { Place::START },
            &mut Closures(|_| None, |_, _| panic!("taken")),
        );
        assert_eq!(ending, Ending::NoRefresh);
    }

    #[test]
    fn known_cells_that_changed_need_a_refresh() {
        let map = Map { now: vec![ray(Known::new(4, 60), &[])], was: vec![ray(USUAL, &[])] };
        assert_eq!(Block::new(&context(Form::LONG, 1), Kind::Delta { ticks: 1 }, 0, &map).end, 0);
        assert_eq!(Block::new(&context(Form::LONG, 1), Kind::Refresh, 0, &map).end, 1);
    }
}
