//! Which commands are measured, and what they printed.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use viewshed::estimator::ESTIMATOR_VERSION;
use viewshed::wire::header::fingerprint;

use super::photo;

/// The plan, from the repository's root.
pub const PLAN: &str = "tests/results.toml";
/// What was printed, and on what.
pub const KEPT: &str = "tests/results.json";
/// The same to read.
pub const PAGE: &str = "tests/RESULTS.md";
/// Pictures that pages show.
pub const PICTURES: &str = "tests/pictures";
/// Stands in a command for a folder of the part's own, which is gone afterwards.
pub const OUT: &str = "{out}";

/// All that is measured.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub part: Vec<Part>,
}

/// Commands that belong together.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub name: String,
    /// What it shows, in a sentence.
    pub shows: String,
    /// Short enough for every run of the tests.
    #[serde(default)]
    pub quick: bool,
    /// Arguments of `viewshed`, run one after the other in the repository's root; `{out}` is a folder of their own.
    pub run: Vec<String>,
    /// Which tables the page of results shows, counted through all that is printed, from 1 on; all where none is named.
    #[serde(default)]
    pub tables: Vec<usize>,
    /// Pictures of pages, by their names in `tests/pictures`, and what they are: a picture of `{out}`, a page
    /// there, or `view ARGUMENTS#SECONDS` of the viewer.
    #[serde(default)]
    pub pictures: BTreeMap<String, String>,
}

impl Part {
    /// Whether the page of results shows a table.
    pub fn shows_table(&self, number: usize) -> bool {
        self.tables.is_empty() || self.tables.contains(&number)
    }
}

impl Plan {
    /// Reads it.
    ///
    /// # Errors
    /// A file that is none, a name that is there twice.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(PLAN);
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("{}: not the repository's root", path.display()))?;
        let plan: Self = toml::from_str(&text).with_context(|| path.display().to_string())?;
        for (k, part) in plan.part.iter().enumerate() {
            ensure!(plan.part[..k].iter().all(|other| other.name != part.name), "{PLAN}: {} is there twice", part.name);
        }
        Ok(plan)
    }

    /// Those of these names, all without any.
    ///
    /// # Errors
    /// A name that is not there.
    pub fn named(&self, names: &[String]) -> Result<Vec<&Part>> {
        for name in names {
            let known: Vec<&str> = self.part.iter().map(|part| part.name.as_str()).collect();
            ensure!(known.contains(&name.as_str()), "--only {name}: {PLAN} has {}", known.join(", "));
        }
        Ok(self.part.iter().filter(|part| names.is_empty() || names.contains(&part.name)).collect())
    }
}

/// What a part printed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub run: Vec<String>,
    /// Check sum of the sources and recordings it was measured on.
    pub sources: String,
    pub estimator_version: u16,
    pub seconds: u64,
    pub machine: String,
    /// What each command printed, line by line.
    pub printed: Vec<Vec<String>>,
}

/// Whether a part's pictures are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pictures {
    Made,
    Left,
}

/// All that was kept, by part.
pub type Kept = BTreeMap<String, Measured>;

/// Reads what was kept; nothing where there is no file.
///
/// # Errors
/// A file that is none.
pub fn kept(root: &Path) -> Result<Kept> {
    let path = root.join(KEPT);
    if !path.exists() {
        return Ok(Kept::new());
    }
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

impl Measured {
    /// Runs a part's commands by this very program, and has its pictures made.
    ///
    /// # Errors
    /// A command that cannot be run, or ends with an error; a picture that did not come of them.
    pub fn by_running(part: &Part, root: &Path, sources: &str, pictures: Pictures) -> Result<Self> {
        let program = std::env::current_exe().context("this program's own path")?;
        let begun = Instant::now();
        let out = tempfile::tempdir().context("a folder for what the part writes")?;
        let folder = out.path().to_string_lossy();
        let run = |line: &String| -> Result<Vec<String>> {
            let words = line.split_whitespace().map(|word| word.replace(OUT, &folder));
            let output = Command::new(&program).args(words).current_dir(root).output();
            let output = output.with_context(|| format!("viewshed {line}"))?;
            if !output.status.success() {
                bail!("viewshed {line}: {}", String::from_utf8_lossy(&output.stderr).trim());
            }
            Ok(String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect())
        };
        let printed = part.run.iter().map(run).collect::<Result<Vec<_>>>()?;
        if pictures == Pictures::Made {
            for (name, of) in &part.pictures {
                photo::make(of, [out.path(), root], &root.join(PICTURES).join(name))?;
            }
        }
        let without_folder = |line: &String| line.replace(&*folder, OUT);
        Ok(Self {
            run: part.run.clone(),
            sources: sources.to_owned(),
            estimator_version: ESTIMATOR_VERSION,
            seconds: begun.elapsed().as_secs(),
            machine: machine(),
            printed: printed.iter().map(|lines| lines.iter().map(without_folder).collect()).collect(),
        })
    }
}

/// The processor, and how many of it.
fn machine() -> String {
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let names: Vec<&str> = cpus
        .lines()
        .filter(|line| line.starts_with("model name"))
        .filter_map(|line| line.split_once(": ").map(|(_, name)| name))
        .collect();
    format!("{} x {}", names.len().max(1), names.first().unwrap_or(&std::env::consts::ARCH))
}

/// A check sum of all that figures hang on: sources, plans and recordings, as they are now.
///
/// # Errors
/// Where git is not there, which says what belongs to the repository, or this is none.
pub fn sources(root: &Path) -> Result<String> {
    let listed = Command::new("git")
        .args(["ls-files", "-co", "--exclude-standard", "Cargo.lock", "src", "tests/harness/src", "tests/recordings"])
        .current_dir(root)
        .output();
    let listed = listed.context("git, which says what belongs to the repository")?;
    ensure!(listed.status.success(), "{}: no repository of git", root.display());
    let listed = String::from_utf8_lossy(&listed.stdout);
    // pages change nothing
    let mut files: Vec<&str> = listed.lines().filter(|line| !line.ends_with(".md")).collect();
    files.sort_unstable();
    // one that was removed is none
    let of = |name: &str| Some(format!("{name} {:08x}\n", fingerprint(&std::fs::read(root.join(name)).ok()?)));
    let all: String = files.into_iter().filter_map(of).collect();
    Ok(format!("{:08x}", fingerprint(all.as_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plan_is_one_and_its_parts_are_named() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let plan = Plan::read(&root).unwrap();
        assert!(plan.part.iter().any(|part| part.quick) && plan.part.iter().all(|part| !part.run.is_empty()));
        let named = plan.named(&[plan.part[1].name.clone()]).unwrap();
        assert_eq!(named.len(), 1);
        let error = plan.named(&["nothing".into()]).unwrap_err().to_string();
        assert!(error.contains("--only nothing") && error.contains(&plan.part[0].name), "{error}");
    }
}
