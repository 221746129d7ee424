//! Parts of a picture that are looked at one by one, so that far vehicles are not shrunk away.
//!
//! Squares in rows, each overlapping the next: a vehicle smaller than the overlap is whole in one of them.

/// A part of a picture, pixels: left, top, right, bottom.
pub type Part = [u32; 4];

/// Squares of `rows` rows that overlap by `overlap` of their side or more, row by row.
///
/// One row, or none, is no tiling.
pub fn tiles([width, height]: [u32; 2], rows: u32, overlap: f64) -> Vec<Part> {
    if rows < 2 {
        return Vec::new();
    }
    let beside = |k: u32| f64::from(k) - f64::from(k - 1) * overlap;
    let side = (f64::from(height) / beside(rows)).ceil().min(f64::from(width)) as u32;
    let count = |length: u32| {
        let left = f64::from(length.saturating_sub(side)) / (f64::from(side) * (1.0 - overlap));
        (left - 1e-9).ceil().max(0.0) as u32 + 1
    };
    let places = |length: u32, count: u32| {
        let room = f64::from(length.saturating_sub(side));
        (0..count).map(move |k| (room * f64::from(k) / f64::from(count.max(2) - 1)).round() as u32)
    };
    // a picture higher than wide has squares of its width, and takes more rows
    places(height, count(height).max(rows))
        .flat_map(|top| places(width, count(width)).map(move |left| [left, top, left + side, top + side]))
        .map(|[l, t, r, b]| [l, t, r.min(width), b.min(height)])
        .collect()
}

/// Whether a box ends where its part does, and the picture goes on there: another part shows more of it.
pub fn is_cut(edges: [f64; 4], part: Part, [width, height]: [u32; 2], margin_px: f64) -> bool {
    let [l, t, r, b] = part.map(f64::from);
    (part[0] > 0 && edges[0] < l + margin_px)
        || (part[1] > 0 && edges[1] < t + margin_px)
        || (part[2] < width && edges[2] > r - margin_px)
        || (part[3] < height && edges[3] > b - margin_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_cover_the_picture_and_overlap_as_told() {
        for (size, rows, overlap) in
            [([1920, 1080], 2, 0.25), ([1920, 1080], 3, 0.1), ([640, 1200], 2, 0.25), ([500, 500], 4, 0.5)]
        {
            let all = tiles(size, rows, overlap);
            let side = all[0][2] - all[0][0];
            assert!(all.iter().all(|p| p[2] - p[0] == side && p[2] <= size[0] && p[3] <= size[1]), "{all:?}");
            assert_eq!((all[0][0], all[0][1]), (0, 0));
            assert_eq!((all[all.len() - 1][2], all[all.len() - 1][3]), (size[0], size[1]), "{all:?}");
            let row: Vec<&Part> = all.iter().filter(|p| p[1] == 0).collect();
            let least = overlap * f64::from(side) - 2.0;
            assert!(row.windows(2).all(|w| f64::from(w[0][2] - w[1][0]) >= least), "{row:?}");
        }
        assert_eq!(tiles([1920, 1080], 2, 0.25).len(), 8);
        assert_eq!(tiles([1920, 1080], 1, 0.25), Vec::<Part>::new());
    }

    #[test]
    fn a_box_is_cut_by_a_tile_but_not_by_the_picture() {
        let (size, part) = ([1920, 1080], [0, 0, 618, 618]);
        assert!(!is_cut([0.0, 0.0, 100.0, 100.0], part, size, 4.0), "the picture's own border");
        assert!(is_cut([500.0, 100.0, 616.0, 200.0], part, size, 4.0));
        assert!(is_cut([100.0, 500.0, 200.0, 617.0], part, size, 4.0));
        let last = [1302, 462, 1920, 1080];
        assert!(is_cut([1303.0, 600.0, 1400.0, 700.0], last, size, 4.0));
        assert!(is_cut([1400.0, 463.0, 1500.0, 700.0], last, size, 4.0));
        assert!(!is_cut([1800.0, 1000.0, 1920.0, 1080.0], last, size, 4.0));
    }
}
