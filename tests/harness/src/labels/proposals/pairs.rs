//! Pieces put together in pairs, the best pair first.

/// Joins the best pairs, each piece once, until none fits any more. `cost` says how badly the second piece goes with the
/// first, each with its number, or that it does not; `join` may drop both.
pub fn joined<T>(
    mut all: Vec<T>,
    cost: impl Fn((usize, &T), (usize, &T)) -> Option<f64>,
    join: impl Fn(T, T) -> Option<T>,
) -> Vec<T> {
    loop {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (a, first) in all.iter().enumerate() {
            for (b, second) in all.iter().enumerate() {
                pairs.extend(cost((a, first), (b, second)).map(|cost| (cost, a, b)));
            }
        }
        if pairs.is_empty() {
            return all;
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut parts: Vec<Option<T>> = all.into_iter().map(Some).collect();
        for (_, a, b) in pairs {
            if parts[a].is_none() || parts[b].is_none() {
                continue;
            }
            if let (Some(first), Some(second)) = (parts[a].take(), parts[b].take()) {
                parts.push(join(first, second));
            }
        }
        all = parts.into_iter().flatten().collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_pair_is_joined_first_each_piece_once_and_as_long_as_any_fits() {
        // intervals that follow one another within 3; the smallest gap is the best
        let gap = |(_, a): (usize, &(i32, i32)), (_, b): (usize, &(i32, i32))| {
            let gap = b.0 - a.1;
            (0..=3).contains(&gap).then_some(f64::from(gap))
        };
        let all = vec![(0, 2), (5, 6), (3, 4), (20, 21)];
        assert_eq!(joined(all, gap, |a, b| Some((a.0, b.1))), [(20, 21), (0, 6)]);
        assert_eq!(joined(vec![(0, 1), (2, 3)], gap, |_, _| None), []);
        assert_eq!(joined(Vec::<(i32, i32)>::new(), gap, |a, _| Some(a)), []);
    }
}
