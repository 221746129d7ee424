//! How few bits a map needs: the entropy of its cells, given what is known already.
//!
//! Counted, not modelled: for every known cell the neighbours that a decoder has before it make a
//! context, and the bits of the cell under that context are counted over the whole recording.

use serde::Serialize;
use viewshed::wire::code::ray::Ray;

use super::traffic::{Maps, Scan, W};

/// Bytes a scan.
#[derive(Debug, Clone, Serialize)]
pub struct Entropy {
    /// Given the neighbours nearer and to the right.
    pub neighbours: f64,
    /// Given the previous scan too.
    pub previous_scan: f64,
}

/// Bits of one cell's context.
const CONTEXT_BITS: u32 = 15;

impl Entropy {
    pub fn new(maps: &Maps) -> Self {
        let mut counts = [vec![[0_u32; 2]; 1 << CONTEXT_BITS], vec![[0_u32; 2]; 1 << CONTEXT_BITS]];
        let mut scans = 0;
        for pair in maps.scans.windows(2) {
            let [was, now] = pair else { continue };
            scans += 1;
            for (azimuth, ray) in now.rays.iter().enumerate() {
                for cell in ray.known.near()..ray.known.end() {
                    let neighbours = neighbours(now, azimuth, cell);
                    let with_previous = neighbours << 7 | previous(was, azimuth, cell);
                    let bit = usize::from(ray.get(cell));
                    counts[0][neighbours][bit] += 1;
                    counts[1][with_previous][bit] += 1;
                }
            }
        }
        let bytes = |counts: &[[u32; 2]]| counts.iter().map(bits).sum::<f64>() / 8.0 / f64::from(scans.max(1));
        Self { neighbours: bytes(&counts[0]), previous_scan: bytes(&counts[1]) }
    }
}

/// Entropy of one context's cells, in bits.
fn bits(counts: &[u32; 2]) -> f64 {
    let [a, b] = counts.map(f64::from);
    let of = |n: f64| if n > 0.0 { n * ((a + b) / n).log2() } else { 0.0 };
    of(a) + of(b)
}

fn at(ray: Option<&Ray<W>>, cell: usize) -> usize {
    usize::from(ray.is_some_and(|ray| ray.get(cell)))
}

/// Two cells nearer, four cells of the azimuth to the right and two of the one beyond.
fn neighbours(scan: &Scan, azimuth: usize, cell: usize) -> usize {
    let ray = |back: usize| azimuth.checked_sub(back).and_then(|a| scan.rays.get(a));
    let nearer = |back: usize| cell.checked_sub(back).map_or(0, |c| at(ray(0), c));
    let right = [cell.wrapping_sub(1), cell, cell + 1, cell + 2].map(|c| at(ray(1), c));
    let beyond = [cell, cell + 1].map(|c| at(ray(2), c));
    [nearer(1), nearer(2)].into_iter().chain(right).chain(beyond).fold(0, |all, bit| all << 1 | bit)
}

/// The cell in the previous scan, with three farther, the one nearer and the ones to both sides.
fn previous(scan: &Scan, azimuth: usize, cell: usize) -> usize {
    let ray = |a: usize| scan.rays.get(a);
    let along = [cell.wrapping_sub(1), cell, cell + 1, cell + 2, cell + 3].map(|c| at(ray(azimuth), c));
    let aside = [at(ray(azimuth + 1), cell), at(ray(azimuth.wrapping_sub(1)), cell)];
    along.into_iter().chain(aside).fold(0, |all, bit| all << 1 | bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coin_has_a_bit_and_a_certainty_none() {
        assert_eq!(bits(&[8, 8]), 16.0);
        assert_eq!(bits(&[0, 99]), 0.0);
        assert!((bits(&[1, 3]) - 3.245).abs() < 0.001);
    }
}
