//! How often radar-3d's maps use each symbol of the wire's code: where its tables come from.

use viewshed::wire::code::block::{self, Basis, Context, Rays};
use viewshed::wire::code::interval::{Coder, Encoder, Form, Mark, Words};
use viewshed::wire::code::model::{BELOW, Model};
use viewshed::wire::code::ray::{Known, Ray};

/// Counts per symbol, table after table in the order of [`Model`].
#[derive(Debug, Clone, Default)]
pub struct Symbols(Vec<Vec<u64>>);

/// Every table of a model, in order.
fn tables(model: &'static Model) -> Vec<&'static [u8]> {
    let mut all: Vec<&[u8]> = Vec::new();
    all.extend(model.ray.as_flattened().iter().map(|t| t.as_slice()));
    all.extend(model.first.iter().map(|t| t.as_slice()));
    all.extend(model.edge.as_flattened().as_flattened().iter().map(|t| t.as_slice()));
    all.extend(model.end.as_flattened().as_flattened().iter().map(|t| t.as_slice()));
    all.extend(model.distance.iter().map(|t| t.as_slice()));
    all.push(&model.limit);
    all.extend(model.stop.iter().map(|t| t.as_slice()));
    all
}

/// An encoder that remembers the symbols it took.
struct Counting<'a> {
    encoder: Encoder<'a>,
    seen: Vec<(*const u8, usize)>,
}

impl Coder for Counting<'_> {
    type Mark = (Mark, usize);

    fn symbol<const N: usize>(&mut self, below: &'static [u8; N], symbol: usize) -> Option<()> {
        self.encoder.symbol(below, symbol)?;
        self.seen.push((below.as_ptr(), symbol));
        Some(())
    }

    fn plain(&mut self, count: u32, value: usize) -> Option<()> {
        self.encoder.plain(count, value)
    }

    fn room(&self) -> u32 {
        self.encoder.room()
    }

    fn mark(&self) -> Self::Mark {
        (self.encoder.mark(), self.seen.len())
    }

    fn rewind(&mut self, (mark, seen): Self::Mark) {
        self.encoder.rewind(mark);
        self.seen.truncate(seen);
    }
}

/// Rays of a scan and of the refresh before it.
pub struct Scan<'a, const W: usize> {
    pub now: &'a [Ray<W>],
    pub was: &'a [Ray<W>],
}

impl<const W: usize> Rays<W> for Scan<'_, W> {
    fn now(&self, azimuth: usize) -> Option<&Ray<W>> {
        self.now.get(azimuth)
    }

    fn was(&self, azimuth: usize) -> Option<&Ray<W>> {
        self.was.get(azimuth)
    }
}

impl Symbols {
    pub fn new() -> Self {
        Self(tables(&BELOW).iter().map(|t| vec![0; t.len()]).collect())
    }

    /// Counts the symbols of one scan; returns the words it took.
    pub fn count<const W: usize>(&mut self, scan: &Scan<'_, W>, form: Form, kind: Basis, usual: Known) -> usize {
        let context = Context { form, usual, azimuths: scan.now.len(), ranges: 32 * W };
        let all = tables(&BELOW);
        let (mut at, mut words) = (0, 0);
        while at < scan.now.len() {
            let mut words_out = Words::NONE;
            let mut coder = Counting { encoder: Encoder::new(&mut words_out, form), seen: Vec::new() };
            let end = block::encode(&mut coder, &context, kind, at, scan);
            let Counting { encoder, seen } = coder;
            encoder.finish();
            for (table, symbol) in seen {
                if let Some(place) = all.iter().position(|t| t.as_ptr() == table) {
                    self.0[place][symbol] += 1;
                }
            }
            words += if end == at { 12 } else { words_out.as_slice().len() };
            at = end.max(at + 1);
        }
        words
    }

    /// The counts as frequencies of 256, as `model.in` holds them; every symbol keeps at least one.
    pub fn model(&self) -> String {
        let rows: Vec<String> = self.0.iter().map(|counts| format!("{:?}", frequencies(counts))).collect();
        let mut rows = rows.iter().map(String::as_str);
        let mut take = |n: usize| format!("[{}]", rows.by_ref().take(n).collect::<Vec<_>>().join(", "));
        let nest = |outer: usize, take: &mut dyn FnMut() -> String| {
            format!("[{}]", (0..outer).map(|_| take()).collect::<Vec<_>>().join(",\n        "))
        };
        let ray = nest(8, &mut || take(2));
        let first = take(2);
        let edge = nest(2, &mut || format!("[{},\n         {}]", take(5), take(5)));
        let end = nest(2, &mut || format!("[{}, {}]", take(2), take(2)));
        let distance = take(2);
        let limit = take(1);
        let stop = take(8);
        let limit = limit.trim_start_matches('[').trim_end_matches(']');
        format!(
            "Model {{\n    ray: {ray},\n    first: {first},\n    edge: {edge},\n    end: {end},\n    distance: {distance},\n    limit: [{limit}],\n    stop: {stop},\n}}\n"
        )
    }
}

/// Shares of 256, none below 1, rounded so that they sum to 256.
fn frequencies(counts: &[u64]) -> Vec<u8> {
    let total: f64 = counts.iter().map(|c| *c as f64 + 0.5).sum();
    let mut shares: Vec<u8> =
        counts.iter().map(|c| ((*c as f64 + 0.5) / total * 256.0).round().clamp(1.0, 255.0) as u8).collect();
    loop {
        let sum: i32 = shares.iter().map(|s| i32::from(*s)).sum();
        // the largest share bears the rounding best
        let Some(largest) = shares.iter_mut().max() else { return shares };
        match sum.cmp(&256) {
            std::cmp::Ordering::Less => *largest += 1,
            std::cmp::Ordering::Equal => return shares,
            std::cmp::Ordering::Greater => *largest -= 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_sum_to_256_and_leave_room_for_what_was_never_seen() {
        for counts in [&[0_u64, 0, 0][..], &[1_000_000, 0], &[1, 1, 1, 1, 1, 1, 1], &[7; 13]] {
            let shares = frequencies(counts);
            assert_eq!(shares.iter().map(|s| u32::from(*s)).sum::<u32>(), 256);
            assert!(shares.iter().all(|s| *s > 0));
        }
    }
}
