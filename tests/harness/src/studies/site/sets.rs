//! Sets of mounts, best first: all of them where they can be tried, otherwise grown from the best.

use rayon::prelude::*;
use serde::Serialize;

use super::bits::{Bits, at_least};
use super::{Candidate, Site};

/// Sets that are tried one by one; beyond that each set grows by its best next member.
const MOST_SETS: u64 = 200_000;
/// Sets that are grown further.
const KEPT: usize = 64;

/// What a set of mounts sees, as shares of what counts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// Indices into [`Site::candidates`], ascending.
    pub members: Vec<usize>,
    /// Vehicle-time-steps detected by at least one of them, and by at least two.
    pub detected: [f64; 2],
    /// Free road cells in sight of at least one of them, and of at least two.
    pub road: [f64; 2],
}

/// What comes first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Rank {
    /// Vehicles detected by at least one sensor
    #[default]
    Vehicles,
    /// Road in sight of at least one sensor
    Road,
    /// Vehicles detected by at least two sensors
    VehiclesTwice,
    /// Road in sight of at least two sensors
    RoadTwice,
}

impl Ranked {
    /// What is compared first, and what decides among equals.
    pub fn key(&self, by: Rank) -> [f64; 4] {
        let ([c, cc], [r, rr]) = (self.detected, self.road);
        match by {
            Rank::Vehicles => [c, r, cc, rr],
            Rank::Road => [r, c, rr, cc],
            Rank::VehiclesTwice => [cc, rr, c, r],
            Rank::RoadTwice => [rr, cc, r, c],
        }
    }
}

impl Site {
    /// All sets of `size` mounts, best first; beyond `MOST_SETS` only those that grow from good smaller ones.
    pub fn ranked(&self, size: usize, by: Rank) -> Vec<Ranked> {
        let n = self.candidates.len();
        if size == 0 || size > n {
            return Vec::new();
        }
        let all = (0..size as u64).fold(1_u64, |c, k| c.saturating_mul(n as u64 - k) / (k + 1));
        let sets = if size == 1 || all <= MOST_SETS {
            combinations(n, size)
        } else {
            // a second sensor gives nothing twice to one alone, so single ones are ranked by once
            let once = if size == 2 { single(by) } else { by };
            let mut grown: Vec<Vec<usize>> = self
                .ranked(size - 1, once)
                .into_iter()
                .take(KEPT)
                .flat_map(|set| (0..n).map(move |next| [&set.members[..], &[next]].concat()))
                .collect();
            grown.iter_mut().for_each(|set| set.sort_unstable());
            grown.retain(|set| set.windows(2).all(|pair| pair[0] != pair[1]));
            grown.sort_unstable();
            grown.dedup();
            grown
        };
        let mut ranked: Vec<Ranked> = sets.into_par_iter().map(|members| self.rank(members)).collect();
        let order = |a: &Ranked, b: &Ranked| {
            let keys = a.key(by).into_iter().zip(b.key(by));
            keys.map(|(x, y)| y.total_cmp(&x)).find(|o| o.is_ne()).unwrap_or_else(|| a.members.cmp(&b.members))
        };
        ranked.sort_by(order);
        ranked
    }

    fn rank(&self, members: Vec<usize>) -> Ranked {
        let rows =
            |of: fn(&Candidate) -> &Bits| -> Vec<&Bits> { members.iter().map(|&k| of(&self.candidates[k])).collect() };
        let shares = |rows: Vec<&Bits>, whole: u64| at_least(&rows).map(|n| n as f64 / whole as f64);
        Ranked {
            detected: shares(rows(|c| &c.detected), self.object_steps),
            road: shares(rows(|c| &c.visible), self.cell_steps),
            members,
        }
    }
}

fn single(by: Rank) -> Rank {
    match by {
        Rank::Vehicles | Rank::VehiclesTwice => Rank::Vehicles,
        Rank::Road | Rank::RoadTwice => Rank::Road,
    }
}

/// Every ascending choice of `size` out of `n`.
fn combinations(n: usize, size: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for _ in 0..size {
        all = all
            .into_iter()
            .flat_map(|set: Vec<usize>| {
                let first = set.last().map_or(0, |last| last + 1);
                (first..n).map(move |next| [&set[..], &[next]].concat())
            })
            .collect();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::scene::Mount;

    /// Candidates by the object-steps they detect; each sees as many cells.
    fn site(detected: &[&[usize]]) -> Site {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let candidate = |set: &&[usize]| {
            let mut bits = Bits::new(10);
            set.iter().for_each(|&k| bits.set(k));
            Candidate { mount, detected: bits.clone(), visible: bits, in_view: [0, 0] }
        };
        Site {
            candidates: detected.iter().map(candidate).collect(),
            left_out: Vec::new(),
            cells: Vec::new(),
            free: Vec::new(),
            instants: 1,
            cell_of_bit: Vec::new(),
            object_steps: 10,
            cell_steps: 10,
        }
    }

    #[test]
    fn the_best_pair_need_not_hold_the_best_single_mount() {
        let site = site(&[&[0, 1, 2, 3, 4, 5], &[0, 1, 2, 6, 7], &[3, 4, 5, 8, 9]]);
        assert_eq!(site.ranked(1, Rank::Vehicles)[0].members, [0]);
        let pairs = site.ranked(2, Rank::Vehicles);
        assert_eq!((pairs.len(), pairs[0].members.as_slice(), pairs[0].detected), (3, &[1, 2][..], [1.0, 0.0]));
        let twice = site.ranked(2, Rank::VehiclesTwice);
        assert_eq!((twice[0].members.as_slice(), twice[0].detected[1]), (&[0, 1][..], 0.3));
        assert_eq!(site.ranked(3, Rank::Vehicles)[0].detected, [1.0, 0.6]);
        assert!(site.ranked(4, Rank::Vehicles).is_empty());
    }

    #[test]
    fn combinations_are_all_of_them_once() {
        assert_eq!(combinations(4, 2), [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]);
        assert_eq!(combinations(5, 3).len(), 10);
    }
}
