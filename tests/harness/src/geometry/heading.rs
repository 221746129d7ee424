//! Headings along a path of places.

/// The heading is taken between the places this far behind and ahead, metres.
pub const BASE_M: f64 = 4.0;
/// What nowhere gets this far from its start stands, metres.
pub const STANDS_M: f64 = 0.5;

/// Heading at each place of a path: from the place behind to the place ahead, each the nearest in time that is far
/// enough away. So standing changes nothing.
pub fn headings(path: &[[f64; 2]], base_m: f64) -> Vec<f64> {
    let distance = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]).hypot(b[1] - a[1]);
    if !moves(path) {
        return vec![0.0; path.len()];
    }
    // both pointers only go forward; where nothing is far enough, the end of the path is taken
    let mut all = Vec::with_capacity(path.len());
    for (k, here) in path.iter().enumerate() {
        let behind = path[..k].iter().rev().find(|p| distance(**p, *here) >= base_m).or(path.first());
        let ahead = path[k..].iter().find(|p| distance(**p, *here) >= base_m).or(path.last());
        let (Some(a), Some(b)) = (behind, ahead) else { continue };
        let heading = (b[1] - a[1]).atan2(b[0] - a[0]);
        let clear = distance(*a, *b) >= STANDS_M;
        all.push(clear.then_some(heading));
    }
    // too short a way to tell
    carried(all)
}

/// Headings that nobody knows: as before, or as after.
pub fn carried(all: Vec<Option<f64>>) -> Vec<f64> {
    let first = all.iter().flatten().next().copied().unwrap_or(0.0);
    all.into_iter()
        .scan(first, |last, heading| {
            *last = heading.unwrap_or(*last);
            Some(*last)
        })
        .collect()
}

/// Whether a path gets away from its start.
pub fn moves(path: &[[f64; 2]]) -> bool {
    path.first().is_some_and(|first| path.iter().any(|p| (p[0] - first[0]).hypot(p[1] - first[1]) >= STANDS_M))
}
