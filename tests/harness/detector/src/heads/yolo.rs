//! YOLO: one output with a box, and its classes, in every row or column.
//!
//! As versions 5 (objectness and classes), 8 and 11 (classes alone) and 10 (suppressed already) are exported to
//! ONNX; boxes in pixels of the input.

use anyhow::Result;

use super::{Output, Raw, Shape, score};

/// How the output is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// [1, 4 + classes, n]: middle, width and height, then the classes' scores.
    Columns(usize),
    /// [1, n, 5 + classes]: the same with objectness, by which they are multiplied.
    Rows(usize),
    /// [1, n, 6]: left, top, right, bottom, score, class.
    Final(usize),
}

/// The least and most classes: a row of 6 is a box that is done, one of 5 has none.
const CLASSES: std::ops::RangeInclusive<usize> = 1..=1000;

impl Layout {
    /// Its output, and the number of classes where it tells.
    pub fn of(outputs: &[Shape]) -> Option<(Self, Option<usize>)> {
        // some exports have what the output was made of beside it
        let mut found = outputs.iter().enumerate().filter_map(|(k, (_, shape))| {
            let [1, a, b] = **shape else { return None };
            if b == 6 {
                return Some((Self::Final(k), None));
            }
            match a < b {
                true => CLASSES.contains(&a.checked_sub(4)?).then(|| (Self::Columns(k), Some(a - 4))),
                false => CLASSES.contains(&b.checked_sub(5)?).then(|| (Self::Rows(k), Some(b - 5))),
            }
        });
        let own = found.next()?;
        found.next().is_none().then_some(own)
    }

    pub fn boxes(&self, outputs: &[Output], least: f64) -> Result<Vec<Raw>> {
        let (Self::Columns(k) | Self::Rows(k) | Self::Final(k)) = *self;
        let output = &outputs[k];
        let [_, a, b] = output.shape[..] else { return Ok(Vec::new()) };
        let value = |row: usize, column: usize| output.values[row * b + column];
        let around = |[x, y, w, h]: [f32; 4]| [x - w / 2.0, y - h / 2.0, x + w / 2.0, y + h / 2.0].map(f64::from);
        let mut boxes = Vec::new();
        match self {
            Self::Final(_) => {
                for n in 0..a {
                    let own = score(value(n, 4), output)?;
                    if own >= least {
                        let edges = [0, 1, 2, 3].map(|c| f64::from(value(n, c)));
                        boxes.push(Raw { class: value(n, 5).round().max(0.0) as usize, score: own, edges });
                    }
                }
            }
            Self::Columns(_) => {
                for n in 0..b {
                    let edges = around([0, 1, 2, 3].map(|c| value(c, n)));
                    best((4..a).map(|c| value(c, n)), 1.0, output, least, edges, &mut boxes)?;
                }
            }
            Self::Rows(_) => {
                for n in 0..a {
                    let object = score(value(n, 4), output)?;
                    let edges = around([0, 1, 2, 3].map(|c| value(n, c)));
                    best((5..b).map(|c| value(n, c)), object, output, least, edges, &mut boxes)?;
                }
            }
        }
        Ok(boxes)
    }
}

/// The surest class of a box, if it is sure enough.
fn best(
    scores: impl Iterator<Item = f32>,
    object: f64,
    output: &Output,
    least: f64,
    edges: [f64; 4],
    boxes: &mut Vec<Raw>,
) -> Result<()> {
    let best = scores.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
    if let Some((class, value)) = best {
        let score = score(value, output)? * object;
        if score >= least {
            boxes.push(Raw { class, score, edges });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(shape: [usize; 3], values: Vec<f32>) -> Vec<Raw> {
        let all = [Output { name: "output0".into(), shape: shape.to_vec(), values }];
        Layout::of(&[("output0", &shape)]).unwrap().0.boxes(&all, 0.3).unwrap()
    }

    const BOX: [f64; 4] = [80.0, 190.0, 120.0, 210.0];

    #[test]
    fn columns_have_classes_alone() {
        // 2 classes, 8 boxes, of which the third and the fourth are sure enough
        let mut values = vec![0.0; 6 * 8];
        for (row, value) in [100.0, 200.0, 40.0, 20.0, 0.2, 0.7].into_iter().enumerate() {
            values[row * 8 + 2] = value;
        }
        for (row, value) in [10.0, 20.0, 4.0, 2.0, 0.31, 0.1].into_iter().enumerate() {
            values[row * 8 + 3] = value;
        }
        let found = boxes([1, 6, 8], values);
        assert_eq!(
            found.iter().map(|b| (b.class, b.edges)).collect::<Vec<_>>(),
            [(1, BOX), (0, [8.0, 19.0, 12.0, 21.0])]
        );
    }

    #[test]
    fn rows_have_objectness_too() {
        let mut values = vec![0.0; 9 * 8];
        values[8..16].copy_from_slice(&[100.0, 200.0, 40.0, 20.0, 0.5, 0.1, 0.2, 0.8]);
        values[16..24].copy_from_slice(&[100.0, 200.0, 40.0, 20.0, 0.5, 0.1, 0.2, 0.5]);
        let found = boxes([1, 9, 8], values);
        assert_eq!(found.len(), 1, "0.5 of 0.5 is too little");
        assert_eq!((found[0].class, found[0].edges), (2, BOX));
        assert!((found[0].score - 0.4).abs() < 1e-6);
    }

    #[test]
    fn six_numbers_are_a_box_that_is_done() {
        let mut values = vec![0.0; 12];
        values[..6].copy_from_slice(&[80.0, 190.0, 120.0, 210.0, 0.9, 7.0]);
        let found = boxes([1, 2, 6], values);
        assert_eq!(found.iter().map(|b| (b.class, b.edges)).collect::<Vec<_>>(), [(7, BOX)]);
    }

    #[test]
    fn other_outputs_are_none_of_it() {
        for shape in [&[1, 5, 5][..], &[2, 84, 8400], &[1, 84], &[1, 4, 8400]] {
            assert_eq!(Layout::of(&[("o", shape)]), None, "{shape:?}");
        }
    }
}
