//! CenterNet: a heat of centres for each class, and how far the edges are from a centre.
//!
//! # References
//! X. Zhou, D. Wang, P. Krähenbühl, "Objects as Points", arXiv 1904.07850: a centre is a peak among its eight neighbours.

use anyhow::Result;

use super::{Output, Raw, Shape, score};

/// Which outputs are what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    heat: usize,
    extent: Extent,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Extent {
    /// Left, top, right, bottom of the cell's corner, pixels of the input.
    Edges(usize),
    /// Width and height, and where in the cell the centre lies, both in cells.
    Size { size: usize, offset: usize },
}

impl Layout {
    /// Its outputs, and the number of classes.
    pub fn of(outputs: &[Shape]) -> Option<(Self, Option<usize>)> {
        let with = |channels: usize| {
            outputs.iter().enumerate().filter(move |(_, (_, s))| s.len() == 4 && s[0] == 1 && s[1] == channels)
        };
        let of_name = |part: &str| with(2).find(|(_, (name, _))| name.contains(part)).map(|(k, _)| k);
        let extent = match with(4).next() {
            Some((k, _)) if with(4).count() == 1 => Extent::Edges(k),
            _ => {
                let size = of_name("wh").or(of_name("size"))?;
                Extent::Size { size, offset: of_name("reg").or(of_name("off"))? }
            }
        };
        let (Extent::Edges(other) | Extent::Size { size: other, .. }) = extent;
        let cells = outputs.get(other)?.1.get(2..)?;
        let same = |s: &[usize]| s.len() == 4 && s[0] == 1 && s[1] != 4 && s[1] != 2 && s.get(2..) == Some(cells);
        let mut heats = outputs.iter().enumerate().filter(|(_, (_, s))| same(s));
        let (heat, (_, shape)) = heats.next()?;
        heats.next().is_none().then(|| (Self { heat, extent }, shape.get(1).copied()))
    }

    pub fn boxes(&self, outputs: &[Output], least: f64, input: [u32; 2]) -> Result<Vec<Raw>> {
        let heat = &outputs[self.heat];
        let [_, classes, rows, columns] = heat.shape[..] else { return Ok(Vec::new()) };
        let stride = [f64::from(input[0]) / columns as f64, f64::from(input[1]) / rows as f64];
        let value =
            |output: &Output, channel: usize, y: usize, x: usize| output.values[(channel * rows + y) * columns + x];
        let mut boxes = Vec::new();
        for class in 0..classes {
            for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                let own = value(heat, class, y, x);
                if score(own, heat)? < least {
                    continue;
                }
                let near = |middle: usize, count: usize| middle.saturating_sub(1)..(middle + 2).min(count);
                let mut around = near(y, rows).flat_map(|v| near(x, columns).map(move |u| (v, u)));
                if around.any(|(v, u)| value(heat, class, v, u) > own) {
                    continue;
                }
                let edges = match self.extent {
                    Extent::Edges(k) => {
                        let [l, t, r, b] = [0, 1, 2, 3].map(|c| f64::from(value(&outputs[k], c, y, x)));
                        let [u, v] = [x as f64 * stride[0], y as f64 * stride[1]];
                        [u - l, v - t, u + r, v + b]
                    }
                    Extent::Size { size, offset } => {
                        let [wide, high] = [0, 1].map(|c| f64::from(value(&outputs[size], c, y, x)) * stride[c] / 2.0);
                        let [du, dv] = [0, 1].map(|c| f64::from(value(&outputs[offset], c, y, x)));
                        let [u, v] = [(x as f64 + du) * stride[0], (y as f64 + dv) * stride[1]];
                        [u - wide, v - high, u + wide, v + high]
                    }
                };
                boxes.push(Raw { class, score: f64::from(own), edges });
            }
        }
        Ok(boxes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn output(name: &str, shape: &[usize], set: &[(usize, f32)]) -> Output {
        let mut values = vec![0.0; shape.iter().product()];
        set.iter().for_each(|(at, value)| values[*at] = *value);
        Output { name: name.into(), shape: shape.to_vec(), values }
    }

    fn layout(outputs: &[Output]) -> Layout {
        let shapes: Vec<Shape> = outputs.iter().map(|o| (o.name.as_str(), o.shape.as_slice())).collect();
        Layout::of(&shapes).unwrap().0
    }

    // 3 classes, 4 rows of 6 cells, an input of 24 x 16: four pixels a cell
    const AT: usize = 6 * 2 + 3;

    #[test]
    fn a_peak_is_a_box_and_its_neighbour_is_none() {
        let heat = output("heat", &[1, 3, 4, 6], &[(24 + AT, 0.8), (24 + AT + 1, 0.7), (48 + AT + 1, 0.5), (24, 0.2)]);
        let edges = output(
            "wh",
            &[1, 4, 4, 6],
            &[(AT, 5.0), (24 + AT, 6.0), (48 + AT, 7.0), (72 + AT, 8.0), (AT + 1, 1.0), (48 + AT + 1, 1.0)],
        );
        let all = [edges, heat];
        let boxes = layout(&all).boxes(&all, 0.3, [24, 16]).unwrap();
        let found: Vec<(usize, [f64; 4])> = boxes.iter().map(|b| (b.class, b.edges)).collect();
        assert_eq!(found, [(1, [12.0 - 5.0, 8.0 - 6.0, 12.0 + 7.0, 8.0 + 8.0]), (2, [15.0, 8.0, 17.0, 8.0])]);
        assert!((boxes[0].score - 0.8).abs() < 1e-6);
    }

    #[test]
    fn sizes_and_offsets_are_in_cells() {
        let heat = output("hm", &[1, 3, 4, 6], &[(AT, 0.9)]);
        let size = output("wh", &[1, 2, 4, 6], &[(AT, 2.0), (24 + AT, 1.0)]);
        let offset = output("reg", &[1, 2, 4, 6], &[(AT, 0.5), (24 + AT, 0.25)]);
        let all = [heat, offset, size];
        let boxes = layout(&all).boxes(&all, 0.3, [24, 16]).unwrap();
        // centre at 3.5 x 4, 2.25 x 4; 8 x 4 pixels
        assert_eq!(boxes[0].edges, [10.0, 7.0, 18.0, 11.0]);
    }

    #[test]
    fn other_outputs_are_none_of_it() {
        assert_eq!(Layout::of(&[("a", &[1, 80, 128, 128]), ("b", &[1, 4, 64, 64])]), None, "cells do not agree");
        assert_eq!(Layout::of(&[("a", &[1, 80, 128, 128])]), None);
        assert_eq!(
            Layout::of(&[("a", &[1, 80, 8, 8]), ("b", &[1, 2, 8, 8]), ("c", &[1, 2, 8, 8])]),
            None,
            "which is which?"
        );
    }
}
