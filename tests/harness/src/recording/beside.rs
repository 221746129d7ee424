//! Files beside a recording, and the part of it that is wanted.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use super::{Frame, ReadOptions, Recording, clock, labels, plausible};
use crate::recording::truth::{LabelsBeside, Truth};

/// Labels and occlusion grades beside a recording, there or not.
pub fn files(path: &Path) -> [PathBuf; 2] {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    // those of NAME.boxes.csv are called after NAME too
    let name = name.strip_suffix(".boxes").unwrap_or(&name);
    ["labels", "occlusion"].map(|suffix| path.with_file_name(format!("{name}.{suffix}.csv")))
}

/// Adds `NAME.labels.csv` (replaces the labels inside) and `NAME.occlusion.csv`, and cuts to the time asked for.
///
/// # Errors
/// Files that cannot be read, and a time without frames.
pub fn complete(mut recording: Recording, path: &Path, options: &ReadOptions) -> Result<Recording> {
    let [labels_csv, occlusion_csv] = files(path);
    if labels_csv.exists() {
        let start_ns = recording.frames.first().map_or(0, |f| f.time_ns);
        let end_ns = recording.frames.last().map_or(0, |f| f.time_ns);
        let (labels, sized_by_class) = labels::read_labels(&labels_csv, start_ns, end_ns)?;
        labels::check_places(&labels_csv, &labels, &recording.pose, 1.2 * recording.sensor.field_of_view.range_m[1])?;
        let file = labels_csv.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let beside = Some(LabelsBeside { file, sized_by_class });
        let ground = recording.truth.take().map(|truth| truth.ground).unwrap_or_default();
        recording.truth = Some(Truth { beside, ground, ..Truth::new(labels) });
    }
    if occlusion_csv.exists() {
        recording.occlusion = labels::read_occlusion(&occlusion_csv)?;
    }
    if options.approaching_is_positive {
        let all = recording.frames.iter_mut().flat_map(|frame| &mut frame.detections);
        all.for_each(|d| d.radial_velocity_mps = -d.radial_velocity_mps);
    }
    if !recording.sensor.frames_independent {
        clock::check(&recording.frames, &mut recording.problems);
    }
    plausible::check(&mut recording);
    restrict(&mut recording, options);
    if recording.frames.is_empty() {
        bail!("{}: no frame between --from and --to", path.display());
    }
    Ok(recording)
}

fn restrict(recording: &mut Recording, options: &ReadOptions) {
    let Some(start) = recording.frames.first().map(|f| f.time_ns) else { return };
    let since = |f: &Frame| f.time_ns.saturating_sub(start) as f64 * 1e-9;
    recording
        .frames
        .retain(|f| options.from_s.is_none_or(|t| since(f) >= t) && options.to_s.is_none_or(|t| since(f) <= t));
}
