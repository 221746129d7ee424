//! `viewshed detect`: pictures in, boxes as CSV or MCAP out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use viewshed_harness::command::print;
use viewshed_harness::command::progress::bar;
use viewshed_harness::recording::boxes::{camera_file, read_camera, rows};
use viewshed_harness::recording::camera::{CameraFrame, RecordedCamera};
use viewshed_harness::recording::write::RecordingWriter;
use viewshed_harness::results::files::OutputArgs;
use viewshed_harness::results::files::one_file::is_one_file;

use crate::classes::Classes;
use crate::detector::{Detector, Settings};
use crate::heads::Head;
use crate::network::{Network, Values};
use crate::picture;

/// Find vehicles in pictures with a neural network, for viewshed's camera
///
/// The network is an ONNX file of your own, with a CenterNet, YOLO or SSD head. Boxes are written as a recording that
/// `viewshed replay` reads; without --csv and --mcap the rows are printed.
#[derive(Debug, clap::Parser)]
#[command(name = "viewshed detect", bin_name = "viewshed detect", version)]
pub struct Args {
    /// Pictures (JPEG, PNG) and folders of them, in the order of time
    #[arg(value_name = "PICTURE_OR_FOLDER", required = true)]
    pictures: Vec<PathBuf>,
    /// Network, an ONNX file
    #[arg(long, value_name = "M.onnx")]
    model: PathBuf,
    /// What its outputs mean [default: told by their shapes]
    #[arg(long, value_name = "HEAD")]
    head: Option<Head>,
    /// What its input is [default: 255 for CenterNet, 1 for YOLO, -1..1 for SSD]
    #[arg(long, value_name = "VALUES", allow_hyphen_values = true)]
    values: Option<Values>,
    /// Width and height of an input that leaves them open
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Names of its classes, one a line [default: those of COCO]
    #[arg(long, value_name = "FILE")]
    classes: Option<PathBuf>,
    /// Least score of a box
    #[arg(long, value_name = "SCORE", default_value_t = 0.3, value_parser = share)]
    score: f64,
    /// Overlap (intersection over union) from which two boxes are of one vehicle
    #[arg(long, value_name = "SHARE", default_value_t = 0.45, value_parser = share)]
    same: f64,
    /// Look at the picture in N rows of overlapping squares too, for what is far away
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    tiles: u32,
    /// Overlap of these squares, share of their side
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, value_parser = overlap)]
    tile_overlap: f64,
    /// How far below its boxes vehicles end, share of a box's height: measure it on pictures with labels
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, allow_hyphen_values = true, value_parser = offset)]
    bottom_offset: f64,
    /// Calibration of the camera (mount and intrinsics, TOML), needed for --mcap
    #[arg(long, value_name = "NAME.camera.toml")]
    camera: Option<PathBuf>,
    /// Pictures a second
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = rate)]
    rate: f64,
    /// Write boxes as CSV; with --camera its calibration is written beside them
    #[arg(long, value_name = "NAME.boxes.csv", help_heading = "Results")]
    csv: Option<PathBuf>,
    /// Write boxes as messages (Detection2DArray, CameraInfo)
    #[arg(long, value_name = "REC.mcap", help_heading = "Results")]
    mcap: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
}

fn within(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "no number".to_owned())?;
    (least..=most).contains(&value).then_some(value).ok_or(format!("it must lie in {least} to {most}"))
}

fn share(text: &str) -> Result<f64, String> {
    within(text, 0.01, 1.0)
}

fn overlap(text: &str) -> Result<f64, String> {
    within(text, 0.0, 0.8)
}

fn offset(text: &str) -> Result<f64, String> {
    within(text, -0.5, 0.5)
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, 0.01, 1000.0)
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides.ok_or_else(|| "width and height are needed, such as 640x384".to_owned())
}

/// Finds and writes.
///
/// # Errors
/// Pictures, a model or a calibration that cannot be used, files that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode> {
    let pictures = picture::find(&args.pictures)?;
    let read = pictures.iter().chain([&args.model]).chain(&args.camera).chain(&args.classes).cloned();
    let mut outputs = args.outputs.beside(read);
    let csv = outputs.file("--csv", args.csv.as_deref())?;
    let beside = match (&args.csv, &args.camera) {
        (Some(csv), Some(camera)) => {
            let file = camera_file(csv).with_context(|| format!("--csv {}: name it NAME.boxes.csv", csv.display()))?;
            // it may lie there already
            let other = Some(file.as_path()).filter(|file| !is_one_file(file, camera));
            outputs.file("the camera beside --csv", other)?
        }
        _ => None,
    };
    let mcap = outputs.file("--mcap", args.mcap.as_deref())?;
    ensure!(
        mcap.is_none() || args.camera.is_some(),
        "--mcap needs the camera's calibration: --camera NAME.camera.toml"
    );
    let camera = args.camera.as_deref().map(read_camera).transpose().context("--camera")?;

    let classes = args.classes.as_deref().map_or_else(|| Ok(Classes::coco()), Classes::read)?;
    let network = Network::read(&args.model, args.head, args.values, args.size, &classes)?;
    let settings = Settings {
        score: args.score,
        same: args.same,
        rows: args.tiles,
        overlap: args.tile_overlap,
        bottom_offset: args.bottom_offset,
    };
    let detector = Detector { network, classes, settings };
    let frames = frames(&detector, &pictures, camera.as_ref(), args.rate)?;

    if let Some(file) = &csv {
        file.write(rows(&frames))?;
    }
    if let (Some(file), Some(path)) = (&beside, &args.camera) {
        file.write(std::fs::read(path).with_context(|| path.display().to_string())?)?;
    }
    if let (Some(file), Some(camera)) = (&mcap, &camera) {
        let mut writer = RecordingWriter::of_camera(file.create()?, &camera.pose, 0)?;
        for frame in &frames {
            writer.camera_frame(frame, &camera.intrinsics)?;
        }
        writer.finish()?.finish()?;
    }
    if csv.is_none() && mcap.is_none() {
        print(&rows(&frames))?;
    }
    let boxes: usize = frames.iter().map(|f| f.boxes.len()).sum();
    eprintln!("{} pictures, {boxes} boxes", frames.len());
    eprint!("{}", outputs.told());
    Ok(ExitCode::SUCCESS)
}

fn frames(
    detector: &Detector,
    pictures: &[PathBuf],
    camera: Option<&RecordedCamera>,
    rate_hz: f64,
) -> Result<Vec<CameraFrame>> {
    let looking = bar("looking at pictures", pictures.len() as u64);
    let mut frames = Vec::with_capacity(pictures.len());
    let mut first: Option<([u32; 2], &Path)> = None;
    for (k, path) in pictures.iter().enumerate() {
        let picture = picture::read(path)?;
        let size = [picture.width(), picture.height()];
        let shown = |[w, h]: [u32; 2]| format!("{w} x {h} pixels");
        if let Some(camera) = camera.filter(|c| c.intrinsics.size_px != size) {
            bail!(
                "{} has {}, and the camera's calibration is for {}: give the calibration of these pictures",
                path.display(),
                shown(size),
                shown(camera.intrinsics.size_px)
            );
        }
        let (other, of) = *first.get_or_insert((size, path));
        ensure!(
            other == size,
            "{} has {}, and {} has {}: pictures of one camera are of one size",
            path.display(),
            shown(size),
            of.display(),
            shown(other)
        );
        let boxes = detector.boxes(&picture).with_context(|| path.display().to_string())?;
        frames.push(CameraFrame { time_ns: (k as f64 / rate_hz * 1e9).round() as i64, boxes, refused: 0 });
        looking.step();
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn no_option_contradicts_another() {
        Args::command().debug_assert();
    }

    #[test]
    fn sizes_and_shares_are_checked() {
        assert_eq!(size("640x384"), Ok([640, 384]));
        assert!(size("640").is_err() && share("0").is_err() && share("NaN").is_err() && offset("-0.6").is_err());
        assert_eq!(offset("-0.02"), Ok(-0.02));
    }
}
