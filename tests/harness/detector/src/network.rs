//! A neural network out of an ONNX file, run on this machine's processor.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use tract_onnx::prelude::*;
use tract_onnx::tract_core::internal::DimLike;
use tract_onnx::tract_hir::infer::Factoid;

use crate::classes::Classes;
use crate::heads::{Head, Layout, Output, Raw, Shape};

/// What an input's values are, of 0 to 255 in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Values {
    /// 0 to 255
    #[value(name = "255")]
    Bytes,
    /// 0 to 1
    #[value(name = "1")]
    Unit,
    /// -1 to 1
    #[value(name = "-1..1")]
    Signed,
}

/// A network, ready to run.
pub struct Network {
    model: Arc<TypedRunnableModel>,
    names: Vec<String>,
    layout: Layout,
    /// Width and height of its input.
    pub input: [u32; 2],
    /// Whether red, green and blue are planes, or stand together.
    planes: bool,
    values: Values,
}

/// Sides an input may have, pixels.
const SIDES: std::ops::RangeInclusive<usize> = 32..=4096;

impl Network {
    /// Reads a network; `size` is width and height of an input that leaves them open, `values` what it expects if
    /// that is not what its head has as a rule.
    ///
    /// # Errors
    /// A file that is no ONNX model, operators that are not known, an input that is no picture, outputs of no head.
    pub fn read(
        path: &Path,
        head: Option<Head>,
        values: Option<Values>,
        size: Option<[u32; 2]>,
        classes: &Classes,
    ) -> Result<Self> {
        let place = || format!("--model {}", path.display());
        ensure!(path.is_file(), "{}: there is no such file", place());
        let model = onnx().model_for_path(path);
        let model = model.with_context(|| format!("{}: no ONNX model that can be read", place()))?;
        let (shape, input, planes) = input(&model, size).with_context(place)?;
        let outlets = model.output_outlets()?.to_vec();
        let named =
            |outlet: &OutletId| model.outlet_label(*outlet).unwrap_or(model.node(outlet.node).name.as_str()).to_owned();
        let names: Vec<String> = outlets.iter().map(named).collect();
        let fixed = model.with_input_fact(0, f32::fact(shape).into()).and_then(|m| m.into_optimized());
        let fixed = fixed.with_context(|| format!("{}: cannot be run", place()))?;
        let mut shapes = Vec::new();
        for (k, name) in names.iter().enumerate() {
            let shape = fixed.output_fact(k)?.shape.as_concrete().map(<[usize]>::to_vec);
            shapes.push(shape.with_context(|| format!("{}: output `{name}` has no fixed shape", place()))?);
        }
        let pairs: Vec<Shape> = names.iter().zip(&shapes).map(|(n, s)| (n.as_str(), s.as_slice())).collect();
        let layout = Layout::of(&pairs, head, classes).with_context(place)?;
        let values = values.unwrap_or(match layout {
            Layout::Centernet(_) => Values::Bytes,
            Layout::Yolo(_) => Values::Unit,
            Layout::Ssd(_) => Values::Signed,
        });
        let model = fixed.into_runnable().with_context(place)?;
        Ok(Self { model, names, layout, input, planes, values })
    }

    /// The boxes of an input, three planes from 0 to 255, with a score of `least` or more.
    ///
    /// # Errors
    /// The network fails, or answers with what are no scores.
    pub fn boxes(&self, planes: &[f32], least: f64) -> Result<Vec<Raw>> {
        let of_byte = |v: f32| match self.values {
            Values::Bytes => v,
            Values::Unit => v / 255.0,
            Values::Signed => v / 127.5 - 1.0,
        };
        let [width, height] = self.input.map(|side| side as usize);
        let area = width * height;
        let tensor = if self.planes {
            let values: Vec<f32> = planes.iter().map(|v| of_byte(*v)).collect();
            Tensor::from_shape(&[1, 3, height, width], &values)
        } else {
            let values: Vec<f32> = (0..3 * area).map(|k| of_byte(planes[k % 3 * area + k / 3])).collect();
            Tensor::from_shape(&[1, height, width, 3], &values)
        };
        let results = self.model.run(tvec!(tensor?.into())).context("the model failed")?;
        let mut outputs = Vec::with_capacity(results.len());
        for (value, name) in results.iter().zip(&self.names) {
            let value = value.cast_to::<f32>().with_context(|| format!("output `{name}`"))?;
            let view = value.to_plain_array_view::<f32>()?;
            let (shape, values) = (view.shape().to_vec(), view.iter().copied().collect());
            outputs.push(Output { name: name.clone(), shape, values });
        }
        self.layout.boxes(&outputs, least, self.input)
    }
}

/// Shape, width and height, and whether colours are planes.
fn input(model: &InferenceModel, size: Option<[u32; 2]>) -> Result<(Vec<usize>, [u32; 2], bool)> {
    let inputs = model.input_outlets()?.len();
    ensure!(inputs == 1, "has {inputs} inputs, and one picture is given");
    let fact = model.input_fact(0)?;
    let shown = format!("[{:?}]", fact.shape);
    let dims: Vec<Option<usize>> = match fact.shape.rank().concretize() {
        Some(4) => {
            (0..4).map(|k| fact.shape.dim(k).and_then(|d| d.concretize()).and_then(|d| d.to_usize().ok())).collect()
        }
        _ => bail!(
            "its input is {shown}, and a picture has four dimensions: [1, 3, height, width] or [1, height, width, 3]"
        ),
    };
    let planes = match (dims[1], dims[3]) {
        (Some(3), _) => true,
        (_, Some(3)) => false,
        _ => bail!("its input is {shown}: neither [1, 3, height, width] nor [1, height, width, 3]"),
    };
    ensure!(
        matches!(dims[0], None | Some(1)),
        "its input is {shown}: it takes several pictures at once; export it for one"
    );
    let [rows, columns] = if planes { [dims[2], dims[3]] } else { [dims[1], dims[2]] };
    let side = |own: Option<usize>, told: Option<u32>, what: &str| -> Result<usize> {
        let told = told.map(|side| side as usize);
        let side = match (own, told) {
            (Some(own), Some(told)) if own != told => bail!("its input has a {what} of {own}, --size says {told}"),
            (Some(side), _) | (None, Some(side)) => side,
            (None, None) => bail!("its input leaves the {what} open: give --size WIDTHxHEIGHT"),
        };
        ensure!(SIDES.contains(&side), "a {what} of {side} pixels, it must lie in 32 to 4096");
        Ok(side)
    };
    let width = side(columns, size.map(|s| s[0]), "width")?;
    let height = side(rows, size.map(|s| s[1]), "height")?;
    let shape = if planes { vec![1, 3, height, width] } else { vec![1, height, width, 3] };
    Ok((shape, [width as u32, height as u32], planes))
}
