//! Files beside a recording, and the part of it that is wanted.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Result, bail, ensure};

use super::frames::{Correction, Extent, Frames, Survey, Wanted};
use super::judged::Watching;
use super::labels::{self, LabelClock, LabelsRead};
use super::plausible::Asked;
use super::{LabelsFrom, ReadOptions, Recording, file, labelled};
use crate::recording::truth::{LabelsBeside, Truth};

/// Labels and occlusion grades beside a recording, there or not.
pub fn files(path: &Path) -> [PathBuf; 2] {
    let name = file::unpacked_stem(path);
    // those of NAME.boxes.csv are called after NAME too
    let name = name.strip_suffix(".boxes").unwrap_or(&name);
    ["labels", "occlusion"].map(|suffix| path.with_file_name(format!("{name}.{suffix}.csv")))
}

/// Adds `NAME.labels.csv`, in place of the labels inside unless those are asked for, and `NAME.occlusion.csv`, and cuts to
/// the time asked for.
///
/// # Errors
/// Files that cannot be read, labels that are asked for and not there, and a time without frames.
pub fn complete(mut recording: Recording, path: &Path, options: &ReadOptions) -> Result<Recording> {
    let [labels_csv, occlusion_csv] = files(path);
    match &options.labels {
        LabelsFrom::Usual if labels_csv.exists() => add_labels(&mut recording, &labels_csv, options)?,
        LabelsFrom::Usual => {}
        LabelsFrom::Beside => {
            ensure!(labels_csv.exists(), "--labels beside: there is no {}", labels_csv.display());
            add_labels(&mut recording, &labels_csv, options)?;
        }
        LabelsFrom::Recording => {
            let name = &recording.name;
            ensure!(recording.truth.is_some(), "--labels recording: {name} has no labels of its own");
        }
        LabelsFrom::File(file) => add_labels(&mut recording, file, options)?,
    }
    if occlusion_csv.exists() {
        recording.occlusion = labels::read_occlusion(&occlusion_csv)?;
    }
    let scans = recording.scans.take();
    if let Some(mut scans) = scans.and_then(Arc::into_inner) {
        check(&mut recording, &mut scans, options);
        recording.scans = Some(Arc::new(scans));
    } else {
        let mut frames = std::mem::take(&mut recording.frames);
        check(&mut recording, &mut frames, options);
        recording.frames = frames;
    }
    if recording.extent().frames == 0 {
        bail!("{}: no frame between --from and --to", path.display());
    }
    Ok(recording)
}

/// Whether there are labels for a recording besides its own.
pub fn has_labels(path: &Path, options: &ReadOptions) -> bool {
    options.labels != LabelsFrom::Usual || files(path)[0].exists()
}

/// Adds what is wrong with a recording's frames to its problems, corrects what can be, and leaves those that are wanted.
fn check(recording: &mut Recording, frames: &mut dyn Frames, options: &ReadOptions) {
    let (reversed, scale) = (options.approaching_is_positive, options.velocity_scale);
    frames.correct(Correction { reversed, scale, ..Correction::default() });
    let Survey { extent, clock, unfilled } = frames.survey();
    let start_ns = extent.first_ns;
    if !recording.sensor.frames_independent {
        clock.tell(&mut recording.problems);
    }
    let unfilled = unfilled.tell(recording, start_ns);
    frames.correct(Correction { unfilled, ..Correction::default() });
    let (mut watching, mut asked) = (Watching::of(recording), Asked::of(recording, extent.frames));
    let wanted = Wanted { start_ns, from_s: options.from_s, to_s: options.to_s };
    let mut left = Extent::default();
    frames.each(&mut |frame| {
        watching.frame(frame);
        asked.iter_mut().for_each(|asked| asked.frame(frame));
        if wanted.has(frame.time_ns) {
            left.frame(frame);
        }
    });
    watching.tell(&mut recording.problems);
    if let Some(asked) = asked {
        asked.tell(recording, frames, start_ns);
    }
    labelled::check(recording, frames, &extent);
    frames.cut(wanted, left);
}

/// Takes the labels of a file.
fn add_labels(recording: &mut Recording, labels_csv: &Path, options: &ReadOptions) -> Result<()> {
    let Extent { first_ns: start_ns, last_ns: end_ns, .. } = recording.extent();
    let LabelsRead { mut labels, sized_by_class, turned_by_path, clock: labels_clock } =
        labels::read_labels(labels_csv, start_ns, end_ns)?;
    labels::check_places(labels_csv, &labels, &recording.pose, 1.2 * recording.sensor.field_of_view.range_m[1])?;
    // they say nothing of heights
    labels.iter_mut().for_each(|label| recording.ground.lift(&mut label.solid));
    let file = labels_csv.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if labels_clock == LabelClock::Either {
        let start_s = start_ns as f64 * 1e-9;
        let what = format!(
            "times fit the recording's own clock and as counted from its first frame, which are {start_s:.3} s apart; the first is taken: if they count from the first frame, add {start_s:.3} s to each"
        );
        recording.problems.add(&file, what, start_ns);
    }
    let new = Truth::new(labels);
    let left_out = recording.truth.take().map(|own| own.tracks.len()).filter(|objects| *objects > 0);
    if let Some(objects) = left_out.filter(|_| options.labels == LabelsFrom::Usual) {
        let what = format!(
            "its labels of {} objects take the place of the recording's own of {objects}; --labels recording takes those, --labels beside these without this line",
            new.tracks.len()
        );
        recording.problems.add(&file, what, start_ns);
    }
    let beside = Some(LabelsBeside { file, sized_by_class, turned_by_path, left_out });
    recording.truth = Some(Truth { beside, ..new });
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;
    use crate::evaluation::samples::{collect, made_up};
    use crate::geometry::ground::Ground;
    use crate::geometry::solid::Solid;
    use crate::recording::Frame;
    use crate::recording::truth::Label;
    use crate::recording::write::RecordingWriter;

    /// A fresh folder for one test.
    fn folder(test: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("viewshed-beside-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    /// Two trucks that drive over a crest, one behind the other.
    fn labels(recording: &Recording, ground: &Ground) -> Vec<Label> {
        let label = |time_ns: i64, id: &str, x: f64, y: f64| {
            let mut solid = Solid { center: [x, y, 2.0], yaw_rad: 0.0, size: [16.5, 2.55, 4.0] };
            ground.lift(&mut solid);
            Label { time_ns, id: id.into(), class: "truck".into(), solid }
        };
        let at = |f: &Frame| {
            let moved = 10.0 * f.time_ns as f64 * 1e-9;
            [label(f.time_ns, "a", 30.0 + moved, 0.0), label(f.time_ns, "b", 75.0 + moved, 0.0)]
        };
        recording.frames.iter().flat_map(at).collect()
    }

    fn rows(labels: &[Label]) -> String {
        let row = |l: &Label| {
            let [x, y, _] = l.solid.center;
            format!("{:.9},{},truck,{x},{y},0\n", l.time_ns as f64 * 1e-9, l.id)
        };
        labels.iter().map(row).fold("time_s,object_id,class,x_m,y_m,heading_rad\n".to_owned(), |all, row| all + &row)
    }

    #[test]
    fn labels_beside_a_recording_stand_on_its_ground_as_those_inside() {
        let folder = folder("ground");
        let ground = Ground::new(vec![[0.0, -2.0], [60.0, 1.0], [150.0, -5.0]]).unwrap();
        let blank = made_up::recording(30, 0);
        let labels = labels(&blank, &ground);
        let write = |name: &str, inside: bool| {
            let mut writer = RecordingWriter::new(Cursor::new(Vec::new()), &blank.sensor, &blank.pose, 0).unwrap();
            writer.ground(&ground).unwrap();
            for frame in &blank.frames {
                writer.frame(frame).unwrap();
                if inside {
                    writer.objects(frame.time_ns, labels.iter().filter(|l| l.time_ns == frame.time_ns)).unwrap();
                }
            }
            let path = folder.join(name);
            std::fs::write(&path, writer.finish().unwrap().into_inner()).unwrap();
            path
        };
        let read = |path: &Path| crate::recording::read(path, &ReadOptions::default()).unwrap();
        let inside = read(&write("inside.mcap", true));
        let path = write("beside.mcap", false);
        let unlabelled = read(&path);
        assert!(unlabelled.truth.is_none());
        assert_eq!(unlabelled.ground, ground, "an unlabelled recording has its road, too");
        std::fs::write(files(&path)[0].clone(), rows(&labels)).unwrap();
        let beside = read(&path);
        assert_eq!((&beside.ground, &inside.ground), (&ground, &ground));
        // labels beside one that has its own are told, and either can be chosen
        let both = write("both.mcap", true);
        std::fs::write(files(&both)[0].clone(), rows(&labels[..1])).unwrap();
        let with = |labels| crate::recording::read(&both, &ReadOptions { labels, ..ReadOptions::default() });
        let told = |r: &Recording| (r.truth.as_ref().unwrap().tracks.len(), r.problems.count("take the place"));
        assert_eq!(told(&with(LabelsFrom::Usual).unwrap()), (1, 1));
        assert_eq!(told(&with(LabelsFrom::Beside).unwrap()), (1, 0));
        assert_eq!(told(&with(LabelsFrom::Recording).unwrap()), (2, 0));
        assert_eq!(told(&with(LabelsFrom::File(files(&path)[0].clone())).unwrap()), (2, 0));
        std::fs::remove_file(files(&both)[0].clone()).unwrap();
        assert!(with(LabelsFrom::Beside).unwrap_err().to_string().contains("there is no"));
        let own = ReadOptions { labels: LabelsFrom::Recording, ..ReadOptions::default() };
        std::fs::rename(files(&path)[0].clone(), folder.join("kept.csv")).unwrap();
        let error = crate::recording::read(&path, &own).unwrap_err().to_string();
        assert!(error.contains("beside has no labels of its own"), "{error}");
        std::fs::rename(folder.join("kept.csv"), files(&path)[0].clone()).unwrap();
        let slice = |recording: &Recording| -> Vec<_> {
            let frames = collect(recording, &Default::default(), &|| ());
            let objects = frames.iter().flat_map(|f| &f.objects);
            let seen: Vec<_> = objects.map(|o| (o.track, o.slice_in_sight, o.box_in_sight, o.solid.center)).collect();
            seen
        };
        let (a, b) = (slice(&inside), slice(&beside));
        assert!(a.len() > 20 && a.iter().any(|o| o.1) && a.iter().any(|o| !o.1), "{a:?}");
        for (a, b) in a.iter().zip(&b) {
            assert_eq!((a.0, a.1, a.2), (b.0, b.1, b.2));
            assert!((a.3[2] - b.3[2]).abs() < 1e-6, "{a:?} {b:?}");
        }
        assert_eq!(a.len(), b.len());
        // packed it has the same labels beside it
        let packed = folder.join("beside.mcap.gz");
        let mut gz = GzEncoder::new(Vec::new(), Compression::fast());
        gz.write_all(&std::fs::read(&path).unwrap()).unwrap();
        std::fs::write(&packed, gz.finish().unwrap()).unwrap();
        std::fs::remove_file(path).unwrap();
        assert_eq!(slice(&read(&packed)), b);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
