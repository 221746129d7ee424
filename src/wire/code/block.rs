//! Rays in, the words of one block out, and back: the code of the map.
//!
//! # Model
//! A block tells consecutive azimuths from a start on. A *refresh* decodes alone: a ray is expected
//! to be like the one before it in the block, the first like the usual one of the header. A *delta*
//! is told against the refresh it names: the first ray is expected to be as it was, every other as
//! [`Ray::expected`] has it. What differs is told edge by edge: the next edge lies a few cells from
//! the expected one, or the expected one is gone, or there is a new one at a distance. Blocked and
//! clear stretches are long, so most rays take less than a bit.
//!
//! A ray too ragged for any block goes out in plain bits, outside this code.
//!
//! # Limits
//! 256 azimuths, 256 range cells. Decoding a block never loops more than (azimuths x 2 cells) times,
//! whatever the words say.

use super::interval::{Coder, Decoder, Encoder, Form, OutOfWords};
use super::model::{AS_EXPECTED, EDGES, GONE, KNOWN, MODEL, NEW, REACH, STOP_CLASSES, STOPS_BELOW, TOLD};
use super::ray::{Known, Ray};
use crate::bits::Bits;

/// Bits that tell how many ticks older a delta's refresh is, less one.
pub const AGE_BITS: u32 = 4;

/// What a block is built on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kind {
    /// Decodes alone.
    Refresh,
    /// On the refresh this many ticks older, 1 to 16.
    Delta {
        /// Its age before this scan.
        ticks: u8,
    },
}

impl Kind {
    fn index(self) -> usize {
        usize::from(self != Self::Refresh)
    }
}

/// What went before a ray, and how a ray is told by it: the index into the tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Before {
    first: bool,
    as_expected: bool,
    /// The neighbour is as it was in the refresh.
    still: bool,
}

impl Before {
    const START: Self = Self { first: true, as_expected: true, still: true };

    fn index(self, kind: Kind) -> usize {
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
enum Last {
    None,
    Same,
    Nearer,
    Farther,
    Other,
}

/// The frequencies for an edge after another.
fn edge_table(kind: Kind, bit: bool, last: Last) -> &'static [u8] {
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

fn end_table(kind: Kind, bit: bool, last: Last) -> &'static [u8] {
    let [a, b] = &MODEL.end;
    let [dark, light] = if kind.index() == 0 { a } else { b };
    let [shift, other] = if bit { light } else { dark };
    if matches!(last, Last::None | Last::Other) { other } else { shift }
}

fn distance_table(bit: bool) -> &'static [u8] {
    let [dark, light] = &MODEL.distance;
    if bit { light } else { dark }
}

fn first_table(bit: bool) -> &'static [u8] {
    let [dark, light] = &MODEL.first;
    if bit { light } else { dark }
}

fn ray_table<const W: usize>(kind: Kind, before: Before, expected: &Ray<W>) -> &'static [u8] {
    let edges = !expected.toggles().is_empty();
    let tables = MODEL.ray.get(before.index(kind)).unwrap_or(&MODEL.ray[0]);
    let [without, with] = tables;
    if edges { with } else { without }
}

/// The frequencies of "no further ray" with this room; `None` where it goes without saying.
pub(crate) fn stop_table(room: u32) -> Option<&'static [u8]> {
    if room < STOPS_BELOW {
        return None;
    }
    let class = STOP_CLASSES.iter().filter(|from| room >= **from).count();
    MODEL.stop.get(class).map(|t| t.as_slice())
}

/// Follows the expected edges of a ray while its edges are told.
struct Expected<'a, const W: usize> {
    ray: &'a Ray<W>,
    toggles: Bits<W>,
    /// Expected edges before this cell are behind.
    from: usize,
}

impl<'a, const W: usize> Expected<'a, W> {
    fn new(ray: &'a Ray<W>) -> Self {
        Self { ray, toggles: ray.toggles(), from: 0 }
    }

    /// The first expected edge that turns `bit` over, before cell `end`.
    fn next(&self, bit: bool, end: usize) -> Option<usize> {
        let mut at = self.toggles.next(self.from)?;
        if self.ray.get(at) == bit {
            // edges alternate, so the one after it turns the other way
            at = self.toggles.next(at + 1)?;
        }
        (at < end).then_some(at)
    }
}

/// Tells a ray; `None` if it does not fit.
fn encode_ray<const W: usize>(
    coder: &mut impl Coder,
    kind: Kind,
    before: Before,
    ray: &Ray<W>,
    expected: &Ray<W>,
) -> Option<()> {
    let table = ray_table(kind, before, expected);
    if ray == expected {
        return coder.symbol(table, AS_EXPECTED);
    }
    if ray.known == expected.known {
        coder.symbol(table, EDGES)?;
    } else {
        coder.symbol(table, KNOWN)?;
        encode_limit(coder, ray.known.near(), expected.known.near())?;
        encode_limit(coder, ray.known.end(), expected.known.end())?;
    }
    if ray.known.is_empty() {
        return Some(());
    }
    let (mut bit, expected_bit) = (ray.first(), expected.known.is_empty() || expected.first());
    coder.symbol(first_table(expected_bit), usize::from(bit != expected_bit))?;
    let toggles = ray.toggles();
    let mut hints = Expected::new(expected);
    let (mut place, mut last) = (ray.known.near(), Last::None);
    hints.from = place + 1;
    loop {
        let edge = toggles.next(place + 1);
        match (hints.next(bit, ray.known.end()), edge) {
            (Some(hint), edge) => {
                let table = edge_table(kind, bit, last);
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
                        hints.from = hint + 1;
                        continue;
                    }
                }
            }
            (None, Some(edge)) => {
                coder.symbol(end_table(kind, bit, last), 1)?;
                encode_distance(coder, bit, edge - place)?;
                last = Last::Other;
                place = edge;
            }
            (None, None) => return coder.symbol(end_table(kind, bit, last), 0),
        }
        bit = !bit;
        hints.from = hints.from.max(place + 1);
    }
}

fn shift(edge: usize, hint: usize) -> Last {
    match edge.cmp(&hint) {
        core::cmp::Ordering::Less => Last::Nearer,
        core::cmp::Ordering::Equal => Last::Same,
        core::cmp::Ordering::Greater => Last::Farther,
    }
}

fn encode_distance(coder: &mut impl Coder, bit: bool, distance: usize) -> Option<()> {
    let bits = distance.checked_ilog2()?;
    coder.symbol(distance_table(bit), bits as usize)?;
    coder.plain(bits, distance)
}

fn encode_limit(coder: &mut impl Coder, limit: usize, expected: usize) -> Option<()> {
    let near = [expected, expected.wrapping_sub(1), expected + 1];
    let symbol = near.iter().position(|n| *n == limit).unwrap_or(TOLD);
    coder.symbol(&MODEL.limit, symbol)?;
    if symbol == TOLD { coder.plain(9, limit) } else { Some(()) }
}

/// The words do not tell a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotARay {
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

/// What sender and receiver of a block agree on beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Context {
    /// Size and most number of the words.
    pub form: Form,
    /// The header's usually known cells.
    pub usual: Known,
    /// The header's number of azimuths.
    pub azimuths: usize,
}

/// The rays a block is made of or built on.
pub trait Rays<const W: usize> {
    /// The ray of an azimuth as it is now, if it is to be told in this block.
    fn now(&self, azimuth: usize) -> Option<&Ray<W>>;

    /// The ray of an azimuth in the refresh a delta names, if it is at hand.
    fn was(&self, azimuth: usize) -> Option<&Ray<W>>;
}

/// A block as words.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    encoder: Encoder,
    /// First azimuth behind the block; the start itself if nothing fitted.
    pub end: usize,
}

/// Tells as many azimuths from `start` on as fit, up to the first for which there is no ray; returns
/// the first azimuth behind them.
pub fn encode<const W: usize>(
    coder: &mut (impl Coder + Clone),
    context: &Context,
    kind: Kind,
    start: usize,
    rays: &impl Rays<W>,
) -> usize {
    if let Kind::Delta { ticks } = kind {
        // the first word has room
        let _ = coder.plain(AGE_BITS, usize::from(ticks.saturating_sub(1)));
    }
    let azimuths = context.azimuths;
    let mut progress = Progress::new(context.usual);
    for azimuth in start..azimuths {
        let before = coder.clone();
        let told = progress.tell(coder, kind, azimuth, rays);
        if told.is_none() || (azimuth + 1 < azimuths && !can_stop(coder)) {
            *coder = before;
            if azimuth > start {
                let _ = stop(coder);
            }
            return azimuth;
        }
    }
    azimuths
}

impl Block {
    /// Tells as many azimuths from `start` on as fit, up to the first for which there is no ray.
    pub fn new<const W: usize>(context: &Context, kind: Kind, start: usize, rays: &impl Rays<W>) -> Self {
        let mut encoder = Encoder::new(context.form);
        let end = encode(&mut encoder, context, kind, start, rays);
        Self { encoder, end }
    }

    /// The words, the first the most significant.
    pub fn words(&self) -> &[u64] {
        self.encoder.words()
    }
}

fn can_stop(coder: &(impl Coder + Clone)) -> bool {
    coder.room() < STOPS_BELOW || stop(&mut coder.clone()).is_some()
}

fn stop(coder: &mut impl Coder) -> Option<()> {
    stop_table(coder.room()).map_or(Some(()), |table| coder.symbol(table, 1))
}

/// What the rays told so far say of the next.
#[derive(Debug, Clone, Copy)]
struct Progress<const W: usize> {
    before: Before,
    /// The ray before, or the usual one.
    neighbour: Ray<W>,
    /// What it was in the refresh.
    neighbour_was: Ray<W>,
}

impl<const W: usize> Progress<W> {
    fn new(usual: Known) -> Self {
        Self { before: Before::START, neighbour: Ray::clear(usual), neighbour_was: Ray::UNKNOWN }
    }

    /// What the next ray is expected to be; `was` is its ray in the refresh.
    fn expected(&self, kind: Kind, was: &Ray<W>) -> Ray<W> {
        match kind {
            Kind::Refresh => self.neighbour,
            Kind::Delta { .. } if self.before.first => *was,
            Kind::Delta { .. } => was.expected(&self.neighbour, &self.neighbour_was),
        }
    }

    fn advance(&mut self, ray: &Ray<W>, expected: &Ray<W>, was: &Ray<W>) {
        self.before = Before { first: false, as_expected: ray == expected, still: ray == was };
        (self.neighbour, self.neighbour_was) = (*ray, *was);
    }

    fn tell(&mut self, coder: &mut impl Coder, kind: Kind, azimuth: usize, rays: &impl Rays<W>) -> Option<()> {
        let ray = rays.now(azimuth)?;
        let was = match kind {
            Kind::Refresh => &Ray::UNKNOWN,
            Kind::Delta { .. } => rays.was(azimuth).filter(|was| was.known == ray.known)?,
        };
        if !self.before.first {
            coder.symbol(stop_table(coder.room())?, 0)?;
        }
        let expected = self.expected(kind, was);
        encode_ray(coder, kind, self.before, ray, &expected)?;
        self.advance(ray, &expected, was);
        Some(())
    }
}

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
}

/// Reads what is there of a block.
pub fn decode<const W: usize>(
    words: &[u64],
    context: &Context,
    kind: Kind,
    start: usize,
    reader: &mut impl Reader<W>,
) -> Ending {
    let Ok(mut decoder) = Decoder::new(words, context.form) else { return Ending::OutOfWords };
    if kind != Kind::Refresh && decoder.plain(AGE_BITS).is_err() {
        return Ending::OutOfWords;
    }
    let mut progress = Progress::new(context.usual);
    for azimuth in start..context.azimuths {
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

#[cfg(test)]
mod tests {
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
                &mut Closures(was, |a, told| {
                    assert_eq!(a, next);
                    next += 1;
                    got[a] = told;
                }),
            );
            assert_eq!((ending, next), (Ending::Complete, block.end));
            words += block.words().len();
            // fewer words give fewer rays, and the same ones
            for n in 1..block.words().len() {
                decode(
                    &block.words()[..n],
                    &context,
                    kind,
                    at,
                    &mut Closures(was, |a, told| {
                        assert_eq!(told, map.now[a]);
                    }),
                );
            }
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
            decode::<2>(&words, &context, kind, start, &mut Closures(was, |a: usize, _| {
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
        let bits = 132 - block.encoder.room();
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
