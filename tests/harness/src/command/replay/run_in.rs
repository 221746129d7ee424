//! `--run-in`: recordings a unit has run over before the one that is judged.

use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

use crate::estimators::Before;
use crate::recording::{self, LabelsFrom, ReadOptions, Recording};

/// Recordings of one radar, oldest first.
pub struct RunIn {
    recordings: Vec<Recording>,
}

impl RunIn {
    /// Reads them.
    ///
    /// # Errors
    /// One that cannot be read, is of a camera or of frames that do not follow one another.
    pub fn read(paths: &[PathBuf], reading: &ReadOptions) -> Result<Self> {
        // --from, --to and --labels are of what is judged
        let labels = LabelsFrom::Usual;
        let reading = ReadOptions { from_s: None, to_s: None, labels, ..reading.clone() };
        let read = |path: &PathBuf| -> Result<Recording> {
            let recording = recording::read(path, &reading).with_context(|| format!("--run-in {}", path.display()))?;
            let follows = recording.of_camera().is_none() && !recording.sensor.frames_independent;
            ensure!(follows, "--run-in {}: there are no radar frames that follow one another", path.display());
            Ok(recording)
        };
        Ok(Self { recordings: paths.iter().map(read).collect::<Result<_>>()? })
    }

    /// What estimators see before.
    pub fn before(&self) -> Before {
        Before::of(self.recordings.iter().cloned())
    }

    /// Refuses a recording of another radar, and the one that is judged.
    ///
    /// # Errors
    /// Which of them that is.
    pub fn check(&self, judged: &Recording) -> Result<()> {
        for before in &self.recordings {
            let (name, of) = (&before.name, &judged.name);
            ensure!(
                before.pose == judged.pose,
                "--run-in {name}: its radar does not hang where that of {of} does, and what it learnt would be of another place"
            );
            let mut shared = false;
            judged.all().parts(&mut |part| {
                shared = part.first().is_some_and(|first| before.frames.contains(first));
                ControlFlow::Break(())
            });
            ensure!(!shared, "--run-in {name}: it has frames of {of} itself; take another hour of the same place");
        }
        Ok(())
    }
}
