//! The experiment's file (TOML): a scene, a training day, reporting days with their seeds.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::evaluation::Settings;
use crate::recording::{Recording, mcap};
use crate::twin::radar::misses::Misses;
use crate::twin::scene::Scene;
use crate::twin::simulate::Simulation;

/// Reads the plan of an experiment; `finish` is given the file's folder as well, and checks the plan.
///
/// # Errors
/// File, line and key of what cannot be read, and what `finish` refuses.
pub fn read<P: DeserializeOwned>(path: &Path, finish: impl FnOnce(&mut P, PathBuf) -> Result<()>) -> Result<P> {
    let place = || format!("experiment {}", path.display());
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", place()))?;
    let mut plan = toml::from_str(&text).with_context(place)?;
    finish(&mut plan, path.parent().unwrap_or(Path::new("")).to_owned()).with_context(place)?;
    Ok(plan)
}

/// What is simulated, and what each day is for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Scene file, seen from the plan's folder as all paths here.
    pub scene: PathBuf,
    /// Length of each day's recording, seconds.
    pub duration_s: f64,
    /// What may be tuned on.
    pub training: Day,
    /// What is reported, and never tuned on.
    pub reporting: Vec<Day>,
    /// Folder of the file.
    #[serde(skip)]
    pub folder: PathBuf,
    /// What its radar misses, in place of what the scene says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub misses: Option<Misses>,
}

/// Traffic of one day and the seed of everything else.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Day {
    pub fcd: PathBuf,
    pub seed: u64,
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// File, line and key of what cannot be read; a day that is reported and trained on, or twice in it.
    pub fn read(path: &Path) -> Result<Self> {
        read(path, |plan: &mut Self, folder| {
            plan.folder = folder;
            plan.check()
        })
    }

    fn check(&self) -> Result<()> {
        ensure!(!self.reporting.is_empty(), "no [[reporting]] day");
        for (k, day) in self.reporting.iter().enumerate() {
            let name = day.fcd.display();
            if day.fcd == self.training.fcd {
                bail!("`{name}` is the training day and cannot be reported");
            }
            ensure!(self.reporting[..k].iter().all(|d| d.fcd != day.fcd), "`{name}` is reported twice");
        }
        Ok(())
    }

    /// One day, ready to be simulated.
    ///
    /// # Errors
    /// Those of the scene and of its traffic.
    pub fn simulation(&self, day: &Day) -> Result<Simulation> {
        let mut scene = Scene::read(&self.folder.join(&self.scene))?;
        scene.seed = day.seed;
        scene.duration_s = self.duration_s;
        scene.set_misses(self.misses.as_ref());
        // boxes of a camera are no input of what is compared here
        scene.camera = None;
        Simulation::new(scene, Some(&self.folder.join(&day.fcd)))
    }
}

impl Plan {
    /// The training day and the reporting days.
    pub fn days(&self) -> impl Iterator<Item = &Day> {
        [&self.training].into_iter().chain(&self.reporting)
    }

    /// Every file that is read for its days, beside its own.
    ///
    /// # Errors
    /// Those of the scene.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let path = self.folder.join(&self.scene);
        let scene = Scene::read(&path)?;
        let days = self.days().map(|day| scene.files(Some(&self.folder.join(&day.fcd))));
        let files = days.collect::<Result<Vec<_>>>()?;
        Ok([path].into_iter().chain(files.into_iter().flatten()).collect())
    }
}

impl Day {
    /// That of its traffic.
    pub fn name(&self) -> String {
        name(&self.fcd)
    }
}

/// What is simulated, as the bytes of a recording and read back like any other. `progress` is called after each frame.
///
/// # Errors
/// Those of the traffic.
pub fn recorded(
    simulation: &Simulation,
    name: &str,
    settings: &Settings,
    progress: &(dyn Fn() + Sync),
) -> Result<(Vec<u8>, Recording)> {
    let (sink, _) = simulation.record(Cursor::new(Vec::new()), progress)?;
    let bytes = sink.into_inner();
    let recording = mcap::parse(&bytes, name.to_owned(), &settings.reading);
    Ok((bytes, recording.with_context(|| format!("the simulated recording of {name}"))?))
}

/// `day-1` of `motorway/day-1.fcd.xml.gz`.
pub fn name(fcd: &Path) -> String {
    let file = fcd.file_name().unwrap_or_default().to_string_lossy();
    file.split('.').next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = r#"
scene = "s.toml"
duration_s = 60.0
[training]
fcd = "a/day-0.fcd.xml.gz"
seed = 1
[[reporting]]
fcd = "a/day-1.fcd.xml.gz"
seed = 2
"#;

    fn parse(text: &str) -> Result<Plan> {
        let plan: Plan = toml::from_str(text)?;
        plan.check()?;
        Ok(plan)
    }

    #[test]
    fn a_day_is_named_after_its_traffic() {
        assert_eq!(parse(LEAST).unwrap().reporting[0].name(), "day-1");
    }

    #[test]
    fn nothing_is_reported_that_was_trained_on() {
        let error = |text: &str| format!("{:#}", parse(text).unwrap_err());
        assert!(error(&LEAST.replace("day-1", "day-0")).contains("is the training day"));
        let twice = format!("{LEAST}[[reporting]]\nfcd = \"a/day-1.fcd.xml.gz\"\nseed = 3\n");
        assert!(error(&twice).contains("reported twice"));
        assert!(
            error(&LEAST.replace("seed = 2", "sead = 2")).contains("line 9"),
            "{}",
            error(&LEAST.replace("seed = 2", "sead = 2"))
        );
    }
}
