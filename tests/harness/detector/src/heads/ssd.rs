//! SSD: boxes as shares of the picture, their scores beside them.
//!
//! As models are exported whose boxes are decoded: corners, not offsets from anchors. `detection_boxes` are TensorFlow's,
//! top, left, bottom, right, with classes from 1; other names are left, top, right, bottom, with classes from 1 as
//! well, since class 0 is the background.

use anyhow::Result;

use super::{Output, Raw, Shape, score};

/// Which outputs are what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    boxes: usize,
    scores: usize,
    /// Where the surest class is told beside its score; otherwise each class has one.
    classes: Option<usize>,
    top_first: bool,
}

impl Layout {
    /// Its outputs, and the number of classes where it tells.
    pub fn of(outputs: &[Shape]) -> Option<(Self, Option<usize>)> {
        let only = |wanted: &dyn Fn(&Shape) -> bool| {
            let mut found = outputs.iter().enumerate().filter(|(_, o)| wanted(o)).map(|(k, _)| k);
            found.next().filter(|_| found.next().is_none())
        };
        let corners = |s: &[usize]| s.len() == 3 && s[0] == 1 && s[2] == 4;
        // scores of three classes and the background have that shape too
        let named = |(name, s): &Shape| corners(s) && name.contains("box");
        let boxes = only(&|(_, s)| corners(s)).or(only(&named))?;
        let (name, shape) = outputs[boxes];
        let count = shape[1];
        let top_first = name.starts_with("detection_boxes");
        let each = |s: &[usize]| s.len() == 3 && s[0] == 1 && s[1] == count && s[2] > 1;
        if let Some(scores) = only(&|(other, s)| each(s) && *other != name) {
            let classes = outputs[scores].1[2] - 1;
            return Some((Self { boxes, scores, classes: None, top_first }, Some(classes)));
        }
        let flat = |s: &[usize]| *s == [1, count];
        let scores = only(&|(name, s)| flat(s) && name.contains("score"))?;
        let classes = only(&|(name, s)| flat(s) && (name.contains("class") || name.contains("label")))?;
        Some((Self { boxes, scores, classes: Some(classes), top_first }, None))
    }

    pub fn boxes(&self, outputs: &[Output], least: f64, input: [u32; 2]) -> Result<Vec<Raw>> {
        let (boxes, scores) = (&outputs[self.boxes], &outputs[self.scores]);
        let [width, height] = input.map(f64::from);
        let mut found = Vec::new();
        for (n, corners) in boxes.values.chunks_exact(4).enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| f64::from(corners[k]));
            let [l, t, r, b] = if self.top_first { [b, a, d, c] } else { [a, b, c, d] };
            let (class, value) = match self.classes {
                Some(k) => (outputs[k].values[n].round().max(0.0) as usize, scores.values[n]),
                None => {
                    let count = scores.shape[2];
                    let own = scores.values[n * count..(n + 1) * count].iter().copied().enumerate().skip(1);
                    own.max_by(|(_, a), (_, b)| a.total_cmp(b)).unwrap_or((0, 0.0))
                }
            };
            let own = score(value, scores)?;
            // the background is no class
            let Some(class) = class.checked_sub(1) else { continue };
            if own >= least {
                found.push(Raw { class, score: own, edges: [l * width, t * height, r * width, b * height] });
            }
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(outputs: &[Output]) -> Vec<Raw> {
        let shapes: Vec<Shape> = outputs.iter().map(|o| (o.name.as_str(), o.shape.as_slice())).collect();
        Layout::of(&shapes).unwrap().0.boxes(outputs, 0.3, [300, 200]).unwrap()
    }

    fn output(name: &str, shape: &[usize], values: &[f32]) -> Output {
        Output { name: name.into(), shape: shape.to_vec(), values: values.to_vec() }
    }

    const BOX: [f32; 4] = [30.0, 40.0, 60.0, 80.0];

    fn edges(raw: &Raw) -> [f32; 4] {
        raw.edges.map(|v| v.round() as f32)
    }

    #[test]
    fn a_score_for_each_class_has_the_background_first() {
        let corners = output("boxes", &[1, 2, 4], &[0.1, 0.2, 0.2, 0.4, 0.0, 0.0, 1.0, 1.0]);
        let scores = output("scores", &[1, 2, 4], &[0.1, 0.2, 0.1, 0.6, 0.9, 0.05, 0.03, 0.02]);
        let found = boxes(&[scores, corners]);
        assert_eq!(found.iter().map(|b| (b.class, edges(b))).collect::<Vec<_>>(), [(2, BOX)]);
    }

    #[test]
    fn the_order_of_tensorflow_is_top_first_and_classes_count_from_one() {
        let corners = output("detection_boxes:0", &[1, 2, 4], &[0.2, 0.1, 0.4, 0.2, 0.0, 0.0, 0.0, 0.0]);
        let scores = output("detection_scores:0", &[1, 2], &[0.8, 0.1]);
        let classes = output("detection_classes:0", &[1, 2], &[3.0, 1.0]);
        let count = output("num_detections:0", &[1], &[1.0]);
        let found = boxes(&[corners, classes, count, scores]);
        assert_eq!(
            found.iter().map(|b| (b.class, edges(b))).collect::<Vec<_>>(),
            [(2, BOX)],
            "3 is car, number 2 of COCO's 80"
        );
    }

    #[test]
    fn other_outputs_are_none_of_it() {
        assert_eq!(Layout::of(&[("boxes", &[1, 10, 4])]), None);
        assert_eq!(Layout::of(&[("boxes", &[1, 10, 4]), ("a", &[1, 10]), ("b", &[1, 10])]), None, "which is which?");
        assert_eq!(Layout::of(&[("boxes", &[1, 10, 4]), ("scores", &[1, 9, 81])]), None, "numbers do not agree");
        let (_, classes) = Layout::of(&[("boxes", &[1, 10, 4]), ("scores", &[1, 10, 91])]).unwrap();
        assert_eq!(classes, Some(90), "one is the background");
    }
}
