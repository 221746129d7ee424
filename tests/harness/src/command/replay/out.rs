//! What `--out` leaves in a folder: the table as text, and pictures; those of a camera in `camera`.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::PathBuf;

use anyhow::{Result, ensure};

use super::risk::RiskArgs;
use super::{Replayed, SHOWN, SHOWN_OF_CAMERA, pictures};
use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::examples;
use crate::results::files::Folder;

/// The folder of each recording: the one named for a single recording, one inside it for each of several.
///
/// # Errors
/// Two recordings of one name: the second would overwrite the first.
pub fn folders(dir: &Folder, recordings: &[PathBuf]) -> Result<Vec<Folder>> {
    if recordings.len() == 1 {
        return Ok(vec![dir.clone()]);
    }
    let names: Vec<&OsStr> = recordings.iter().map(|path| path.file_stem().unwrap_or_default()).collect();
    let distinct = names.iter().collect::<BTreeSet<_>>().len();
    ensure!(distinct == names.len(), "--out: two of the recordings have one name; replay them one by one");
    Ok(names.iter().map(|name| dir.folder(name)).collect())
}

/// Fills one recording's folder.
pub fn write(folder: &Folder, text: &str, one: &Replayed, risk: &RiskArgs, settings: &Settings) -> Result<()> {
    let Replayed { replay, examples, shown_frame, .. } = one;
    folder.file("table.txt")?.write(text)?;
    let shown = if replay.recording.of_camera().is_some() { SHOWN_OF_CAMERA } else { SHOWN };
    let drawn = risk.estimators(&replay.recording, settings)?;
    pictures::write(folder, replay, drawn, shown, examples, *shown_frame, settings)?;
    if let Some(camera) = &replay.camera {
        let score = camera.score(SHOWN_OF_CAMERA);
        // its frames are at times of their own
        let time_ns = shown_frame.and_then(|k| replay.recording.frames.get(k)).map(|f| f.time_ns);
        let apart = |time_ns: i64| move |k: &usize| camera.recording.frames[*k].time_ns.abs_diff(time_ns);
        let of_camera = time_ns.and_then(|t| (0..camera.recording.frames.len()).min_by_key(apart(t)));
        let examples = score.map(|s| examples::find(&camera.recording, &camera.samples, s)).unwrap_or_default();
        let drawn = estimators::all(&camera.recording, &settings.estimators)?;
        pictures::write(&folder.folder("camera"), camera, drawn, SHOWN_OF_CAMERA, &examples, of_camera, settings)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::results::files::OutputArgs;

    #[test]
    fn several_recordings_have_a_folder_each() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let folder = OutputArgs::default().beside([]).folder("--out", Path::new("o")).unwrap();
        let of = |names: &[&str]| {
            folders(&folder, &paths(names)).map(|all| all.iter().map(|f| f.path().to_owned()).collect())
        };
        assert_eq!(of(&["a/x.mcap"]).ok(), Some(paths(&["o"])));
        assert_eq!(of(&["a/x.mcap", "y.mcap"]).ok(), Some(paths(&["o/x", "o/y"])));
        assert!(of(&["a/x.mcap", "b/x.mcap"]).is_err());
    }
}
