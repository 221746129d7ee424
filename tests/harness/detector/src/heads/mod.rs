//! What a network's outputs mean: a head, chosen by the outputs' shapes or by hand.

mod centernet;
mod ssd;
mod yolo;

use anyhow::{Result, bail};

use crate::classes::Classes;

/// An output of a network.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

/// A kind of network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Head {
    /// Heat [1, classes, h, w] and distances to the edges [1, 4, h, w]; or sizes and offsets [1, 2, h, w] each
    Centernet,
    /// Boxes and classes in one: [1, 4 + classes, n], [1, n, 5 + classes] or [1, n, 6] after suppression
    Yolo,
    /// Boxes [1, n, 4] as shares of the picture with scores [1, n, classes], or with scores and classes [1, n] each
    Ssd,
}

/// A box in the network's input: edges in its pixels, a class by number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raw {
    pub class: usize,
    pub score: f64,
    /// Left, top, right, bottom.
    pub edges: [f64; 4],
}

/// How outputs are read: the head with what of which output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    Centernet(centernet::Layout),
    Yolo(yolo::Layout),
    Ssd(ssd::Layout),
}

/// Name and shape of an output.
pub type Shape<'a> = (&'a str, &'a [usize]);

impl Layout {
    /// The head these outputs are of, or that of the user's choice.
    ///
    /// # Errors
    /// Outputs that are of none, by name and shape; a number of classes that is not that of their names.
    pub fn of(outputs: &[Shape], chosen: Option<Head>, classes: &Classes) -> Result<Self> {
        let tried = chosen.map_or(vec![Head::Centernet, Head::Ssd, Head::Yolo], |head| vec![head]);
        for head in &tried {
            let found = match head {
                Head::Centernet => centernet::Layout::of(outputs).map(|(l, n)| (Self::Centernet(l), n)),
                Head::Yolo => yolo::Layout::of(outputs).map(|(l, n)| (Self::Yolo(l), n)),
                Head::Ssd => ssd::Layout::of(outputs).map(|(l, n)| (Self::Ssd(l), n)),
            };
            if let Some((layout, count)) = found {
                if let Some(count) = count {
                    classes.check(count)?;
                }
                return Ok(layout);
            }
        }
        let shown: Vec<String> = outputs.iter().map(|(name, shape)| format!("`{name}` {shape:?}")).collect();
        bail!(
            "outputs of no head that is known{}: {}. Known are{}",
            chosen.map_or(String::new(), |_| " by that name".into()),
            shown.join(", "),
            tried.iter().map(|head| format!("\n  {}", what(*head))).collect::<String>()
        )
    }

    /// The boxes with a score of `least` or more; `input` is the width and height of what the network was given.
    ///
    /// # Errors
    /// Values that cannot be scores.
    pub fn boxes(&self, outputs: &[Output], least: f64, input: [u32; 2]) -> Result<Vec<Raw>> {
        let mut boxes = match self {
            Self::Centernet(layout) => layout.boxes(outputs, least, input)?,
            Self::Yolo(layout) => layout.boxes(outputs, least)?,
            Self::Ssd(layout) => layout.boxes(outputs, least, input)?,
        };
        boxes.retain(|b| b.edges.iter().all(|v| v.is_finite()) && b.edges[0] < b.edges[2] && b.edges[1] < b.edges[3]);
        Ok(boxes)
    }
}

fn what(head: Head) -> String {
    use clap::ValueEnum;
    let own = head.to_possible_value();
    own.map_or(String::new(), |v| {
        format!("{}: {}", v.get_name(), v.get_help().map(ToString::to_string).unwrap_or_default())
    })
}

/// A score as it stands in an output.
///
/// # Errors
/// It is none: a network whose last step, a sigmoid, was left out.
fn score(value: f32, output: &Output) -> Result<f64> {
    if !(-1e-4..=1.0 + 1e-4).contains(&value) {
        bail!(
            "output `{}` has {value} where a score of 0 to 1 is expected: export the model with its last sigmoid",
            output.name
        );
    }
    Ok(f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_known_by_their_outputs() {
        let of = |outputs: &[Shape]| Layout::of(outputs, None, &Classes::coco());
        assert!(matches!(of(&[("heat", &[1, 80, 128, 128]), ("wh", &[1, 4, 128, 128])]), Ok(Layout::Centernet(_))));
        assert!(matches!(of(&[("output0", &[1, 84, 8400])]), Ok(Layout::Yolo(_))));
        assert!(matches!(of(&[("boxes", &[1, 1917, 4]), ("scores", &[1, 1917, 91])]), Ok(Layout::Ssd(_))));
    }

    #[test]
    fn outputs_of_no_head_are_named_with_their_shapes() {
        let error = |head| format!("{:#}", Layout::of(&[("logits", &[1, 1000])], head, &Classes::coco()).unwrap_err());
        let all = error(None);
        assert!(
            all.contains("`logits` [1, 1000]") && all.contains("centernet: Heat") && all.contains("ssd: Boxes"),
            "{all}"
        );
        let yolo = error(Some(Head::Yolo));
        assert!(yolo.contains("yolo: Boxes") && !yolo.contains("centernet"), "{yolo}");
        let few = Layout::of(&[("output0", &[1, 7, 8400])], Some(Head::Yolo), &Classes::coco()).unwrap_err();
        assert!(few.to_string().contains("tells 3 classes apart"), "{few}");
    }

    #[test]
    fn a_missing_sigmoid_is_told() {
        let heat = Output { name: "heat".into(), shape: vec![1, 80, 1, 1], values: vec![-3.0; 80] };
        let wide = Output { name: "wh".into(), shape: vec![1, 4, 1, 1], values: vec![2.0; 4] };
        let layout = Layout::of(&[("heat", &[1, 80, 1, 1]), ("wh", &[1, 4, 1, 1])], None, &Classes::coco()).unwrap();
        let error = layout.boxes(&[heat, wide], 0.3, [4, 4]).unwrap_err().to_string();
        assert!(error.contains("`heat` has -3") && error.contains("sigmoid"), "{error}");
    }
}
