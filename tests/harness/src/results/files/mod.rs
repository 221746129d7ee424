//! Files out: never over an input, over other files only when asked to, whole or not at all.
//!
//! Every command names its inputs and outputs here before it starts, and can write to nothing else: a
//! [`Target`] comes from [`Outputs`] only.

pub mod one_file;
mod unfinished;

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, Result, bail, ensure};

use crate::recording::file::STANDARD_INPUT;
use one_file::is_one_file;
pub use unfinished::{Unfinished, until_ctrl_c};

/// `--force`.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct OutputArgs {
    /// Replace files that exist already; what is read is never replaced
    ///
    /// Pictures and tables in a folder are replaced without it.
    #[arg(long, help_heading = "Results")]
    pub force: bool,
}

impl OutputArgs {
    /// The outputs of a command that reads these files.
    pub fn beside(self, inputs: impl IntoIterator<Item = PathBuf>) -> Outputs {
        let (inputs, force) = (inputs.into_iter().collect(), self.force);
        Outputs { inputs, force, named: Vec::new(), written: Written::default() }
    }
}

/// A file by its path, or a folder with its files.
type Place = (PathBuf, Option<BTreeSet<PathBuf>>);

/// What was written, in the order it was finished.
#[derive(Debug, Clone, Default)]
struct Written(Arc<Mutex<Vec<Place>>>);

impl Written {
    fn add(&self, path: &Path, folder: Option<&Path>) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = folder.unwrap_or(path);
        match all.iter_mut().find(|(known, _)| known == place) {
            Some((_, files)) => drop(files.as_mut().map(|files| files.insert(path.to_owned()))),
            None => all.push((place.to_owned(), folder.map(|_| BTreeSet::from([path.to_owned()])))),
        }
    }
}

/// Checks where a command may write.
pub struct Outputs {
    inputs: Rc<[PathBuf]>,
    force: bool,
    /// Outputs so far, with their options.
    named: Vec<(String, PathBuf)>,
    written: Written,
}

impl Outputs {
    /// More files that are read, named before any output.
    pub fn reads(&mut self, inputs: impl IntoIterator<Item = PathBuf>) {
        self.inputs = self.inputs.iter().cloned().chain(inputs).collect();
    }

    /// The file an option names, if it does.
    ///
    /// # Errors
    /// It is an input or another output, also through links; a folder, or in one that does not exist; a file
    /// that exists, without `--force`; `-`, which elsewhere is standard input.
    pub fn file(&mut self, option: &str, path: Option<&Path>) -> Result<Option<Target>> {
        let Some(path) = path else { return Ok(None) };
        ensure!(
            path != Path::new(STANDARD_INPUT),
            "{option} - is no name of a file; write to standard output with `{option} /dev/stdout`, to a file of that name with `{option} ./-`"
        );
        not_read(option, path, &self.inputs)?;
        if !is_stream(path) {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
                bail!(
                    "{option}: cannot write {}: there is no folder {}; make it with `mkdir -p {1}`",
                    path.display(),
                    folder.display()
                );
            }
            can_be_written(option, folder.unwrap_or(Path::new(".")))?;
            if let Some((other, _)) = self.named.iter().find(|(_, named)| is_one_file(named, path)) {
                bail!("{option} {}: {other} writes this file too; name another", path.display());
            }
            // an empty file holds nothing that could be lost: mktemp makes such
            let holds_something = path.symlink_metadata().is_ok() && path.metadata().map_or(true, |m| m.len() > 0);
            ensure!(
                self.force || !holds_something,
                "{option} {} exists; add --force to replace it, or name another file",
                path.display()
            );
        }
        self.named.push((option.to_owned(), path.to_owned()));
        Ok(Some(Target { path: path.to_owned(), folder: None, written: self.written.clone() }))
    }

    /// The picture an option names, if it does.
    ///
    /// # Errors
    /// Those of [`Outputs::file`], and a name that ends in that of another kind: nothing but PNG is drawn.
    pub fn picture(&mut self, option: &str, path: Option<&Path>) -> Result<Option<Target>> {
        if let Some(path) = path.filter(|path| !is_stream(path)) {
            not_read(option, path, &self.inputs)?;
            let is_png = path.extension().is_none_or(|extension| extension.eq_ignore_ascii_case("png"));
            let png = path.with_extension("png");
            ensure!(is_png, "{option} {}: pictures are PNG; name it {}", path.display(), png.display());
        }
        self.file(option, path)
    }

    /// The folder an option names. Its files may be replaced.
    ///
    /// # Errors
    /// It is a file, or cannot be made or written to; `-`, which elsewhere is standard input.
    pub fn folder(&self, option: &str, path: &Path) -> Result<Folder> {
        ensure!(
            path != Path::new(STANDARD_INPUT),
            "{option} - is no name of a folder; make one of that name with `{option} ./-`"
        );
        ensure!(!path.exists() || path.is_dir(), "{option} {} is a file, and a folder is needed", path.display());
        let there = path.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
        ensure!(there.is_dir(), "{option} {}: {} is a file, and a folder is needed", path.display(), there.display());
        can_be_written(option, there)?;
        let (option, path, root) = (option.to_owned(), path.to_owned(), path.to_owned());
        Ok(Folder { option, path, root, inputs: self.inputs.clone(), written: self.written.clone() })
    }

    /// A line for each file and folder that was written, and one for pictures there that were not.
    pub fn told(&self) -> String {
        let all = self.written.0.lock().unwrap_or_else(PoisonError::into_inner);
        let line = |(path, files): &Place| match files {
            None => format!("wrote {}\n", path.display()),
            Some(files) => {
                let (n, s) = (files.len(), if files.len() == 1 { "" } else { "s" });
                format!("wrote {n} file{s} into {}\n{}", path.display(), told_of_others(path, files))
            }
        };
        all.iter().map(line).collect()
    }
}

/// Which pictures beside those of this run are in its folders, where there are any.
fn told_of_others(root: &Path, written: &BTreeSet<PathBuf>) -> String {
    let folders: BTreeSet<&Path> = written.iter().filter_map(|path| path.parent()).collect();
    let entries = folders.iter().flat_map(std::fs::read_dir).flatten().flatten().map(|entry| entry.path());
    let is_picture = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "png");
    let others: BTreeSet<PathBuf> = entries.filter(is_picture).filter(|path| !written.contains(path)).collect();
    let shown = |path: &PathBuf| path.strip_prefix(root).unwrap_or(path).display().to_string();
    let mut names: Vec<String> = others.iter().take(OTHERS_SHOWN).map(shown).collect();
    if others.len() > OTHERS_SHOWN {
        names.push(format!("{} more", others.len() - OTHERS_SHOWN));
    }
    if names.is_empty() { String::new() } else { format!("not of this run, but there before: {}\n", names.join(", ")) }
}

/// How many of them are named.
const OTHERS_SHOWN: usize = 8;

/// Finds out before anything is computed whether files can be made in a folder.
fn can_be_written(option: &str, folder: &Path) -> Result<()> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    unfinished::try_in(folder).with_context(|| format!("{option}: no file can be made in {}", folder.display()))
}

/// A folder that is filled. It is made with its first file.
#[derive(Debug, Clone)]
pub struct Folder {
    option: String,
    path: PathBuf,
    /// The one that was named, which this is or is in.
    root: PathBuf,
    inputs: Rc<[PathBuf]>,
    written: Written,
}

impl Folder {
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A folder in it.
    pub fn folder(&self, name: impl AsRef<Path>) -> Self {
        Self { path: self.path.join(name), ..self.clone() }
    }

    /// A file in it.
    ///
    /// # Errors
    /// It is an input, also through links; the folder cannot be made.
    pub fn file(&self, name: impl AsRef<Path>) -> Result<Target> {
        std::fs::create_dir_all(&self.path)
            .with_context(|| format!("cannot make the folder {}", self.path.display()))?;
        let path = self.path.join(name);
        not_read(&self.option, &path, &self.inputs)?;
        Ok(Target { path, folder: Some(self.root.clone()), written: self.written.clone() })
    }
}

/// A file that may be written.
#[derive(Debug)]
pub struct Target {
    path: PathBuf,
    /// The folder that was named, where not the file was.
    folder: Option<PathBuf>,
    written: Written,
}

impl Target {
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Begins the file. Until it is finished the target is what it was.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn create(&self) -> Result<Unfinished> {
        let (written, folder, path) = (self.written.clone(), self.folder.clone(), self.path.clone());
        Unfinished::create(&self.path, move || written.add(&path, folder.as_deref()))
    }

    /// Writes the whole file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, bytes: impl AsRef<[u8]>) -> Result<()> {
        let mut file = self.create()?;
        file.write_all(bytes.as_ref()).with_context(|| format!("cannot write {}", self.path.display()))?;
        file.finish()
    }
}

fn not_read(option: &str, path: &Path, inputs: &[PathBuf]) -> Result<()> {
    let shown = path.display();
    ensure!(!path.is_dir(), "{option} {shown} is a folder, and a file is needed");
    // a terminal can be read and written; a name under /dev can be a file that is read
    if is_stream(path) && !path.is_file() {
        return Ok(());
    }
    if let Some(input) = inputs.iter().find(|input| is_one_file(input, path)) {
        bail!("{option} {shown} would destroy {}, which is read; name another file", input.display());
    }
    Ok(())
}

/// Whether a path is a pipe, a device or an open file of this program, which nothing can take the place of.
fn is_stream(path: &Path) -> bool {
    let own = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc/self/fd"];
    own.iter().any(|own| path.starts_with(own)) || path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A fresh folder for one test.
    fn folder(test: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("viewshed-output-{test}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        path
    }

    fn outputs(inputs: &[&Path], force: bool) -> Outputs {
        OutputArgs { force }.beside(inputs.iter().map(|p| p.to_path_buf()))
    }

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn an_output_that_is_an_input_is_refused_whatever_its_name() {
        let folder = folder("input");
        let input = folder.join("in.mcap");
        fs::write(&input, "recorded").unwrap();
        fs::hard_link(&input, folder.join("hard")).unwrap();
        let mut paths = vec![input.clone(), folder.join("hard"), folder.join("../").join(&input)];
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("in.mcap", folder.join("soft")).unwrap();
            paths.push(folder.join("soft"));
        }
        for path in &paths {
            for force in [false, true] {
                let error = outputs(&[&input], force).file("--csv", Some(path)).unwrap_err().to_string();
                assert!(error.contains("--csv") && error.contains("which is read"), "{error}");
            }
            // and as a picture, where files may be replaced
            let name = path.file_name().unwrap();
            let into = outputs(&[&input], true).folder("--out", &folder).unwrap();
            assert!(into.file(name).is_err(), "{}", path.display());
        }
        assert_eq!(fs::read(&input).unwrap(), b"recorded");
        // also one that is not there yet
        let later = folder.join("later.log");
        assert!(outputs(&[&later], true).file("--log", Some(&later)).is_err());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_file_that_exists_needs_force_and_an_empty_one_does_not() {
        let folder = folder("force");
        let (file, empty) = (folder.join("r.json"), folder.join("empty"));
        fs::write(&file, "before").unwrap();
        fs::write(&empty, "").unwrap();
        let error = outputs(&[], false).file("--json", Some(&file)).unwrap_err().to_string();
        assert!(error.contains("r.json exists; add --force"), "{error}");
        outputs(&[], false).file("--json", Some(&empty)).unwrap().unwrap().write("now").unwrap();
        outputs(&[], true).file("--json", Some(&file)).unwrap().unwrap().write("now").unwrap();
        assert_eq!((fs::read(&file).unwrap(), fs::read(&empty).unwrap()), (b"now".to_vec(), b"now".to_vec()));
        assert_eq!(names(&folder), ["empty", "r.json"]);
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn pictures_of_an_earlier_run_are_named() {
        let folder = folder("earlier");
        let draw = |names: &[&str]| {
            let outputs = outputs(&[], false);
            let into = outputs.folder("--out", &folder).unwrap();
            names.iter().for_each(|name| into.folder("camera").file(name).unwrap().write("drawn").unwrap());
            outputs.told()
        };
        assert!(!draw(&["a.png", "b.png", "table.txt"]).contains("before"));
        let told = draw(&["b.png"]);
        let camera = Path::new("camera").join("a.png");
        assert!(told.contains("wrote 1 file into"), "{told}");
        assert!(told.ends_with(&format!("not of this run, but there before: {}\n", camera.display())), "{told}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn two_outputs_are_two_files() {
        let folder = folder("two");
        let mut outputs = outputs(&[], true);
        outputs.file("--json", Some(&folder.join("a"))).unwrap();
        let error = outputs.file("--csv", Some(&folder.join(".").join("a"))).unwrap_err().to_string();
        assert!(error.contains("--json writes this file too"), "{error}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_folder_is_made_with_its_first_file_and_filled_again_without_force() {
        let folder = folder("folder");
        let into = outputs(&[], false).folder("--out", &folder.join("new")).unwrap();
        assert_eq!(names(&folder), [""; 0]);
        for text in ["first", "second"] {
            into.folder("deep").file("table.txt").unwrap().write(text).unwrap();
        }
        assert_eq!(fs::read(folder.join("new/deep/table.txt")).unwrap(), b"second");
        fs::write(folder.join("file"), "").unwrap();
        assert!(outputs(&[], true).folder("--out", &folder.join("file")).is_err());
        assert!(outputs(&[], true).file("--json", Some(&folder.join("new"))).is_err());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_place_nothing_can_be_written_to_is_found_before() {
        let folder = folder("place");
        fs::write(folder.join("file"), "x").unwrap();
        let into = |path: &str| outputs(&[], false).folder("--out", &folder.join(path)).map(|_| ()).unwrap_err();
        assert!(into("file/in/it").to_string().contains("is a file, and a folder is needed"));
        let missing = outputs(&[], false).file("--json", Some(&folder.join("no/r.json"))).unwrap_err().to_string();
        assert!(missing.contains("there is no folder") && missing.contains("mkdir -p"), "{missing}");
        #[cfg(target_os = "linux")]
        {
            // no file can be made in /proc, by root neither
            let error = outputs(&[], false).folder("--out", Path::new("/proc/maps")).unwrap_err().to_string();
            assert_eq!(error, "--out: no file can be made in /proc");
            assert!(outputs(&[], false).file("--json", Some(Path::new("/proc/r.json"))).is_err());
        }
        assert_eq!(names(&folder), ["file"], "the attempt leaves nothing");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_picture_is_not_called_what_it_is_not() {
        let picture = |name: &str| outputs(&[], false).picture("--out", Some(Path::new(name)));
        let error = picture("map.jpg").unwrap_err().to_string();
        assert_eq!(error, "--out map.jpg: pictures are PNG; name it map.png");
        for name in ["absent", "absent.png", "absent.PNG", "/dev/null"] {
            assert!(picture(name).unwrap().is_some(), "{name}");
        }
    }

    #[test]
    fn what_was_written_is_told_and_what_was_not_is_not() {
        let folder = folder("told");
        let mut outputs = outputs(&[], false);
        let (a, b) = (folder.join("a.json"), folder.join("b.json"));
        let file = outputs.file("--json", Some(&a)).unwrap().unwrap();
        let never = outputs.file("--csv", Some(&b)).unwrap().unwrap();
        let into = outputs.folder("--out", &folder.join("maps")).unwrap();
        outputs.file("--log", Some(Path::new("/dev/null"))).unwrap().unwrap().write("x").unwrap();
        drop(never.create().unwrap());
        for name in ["x.png", "y.png"] {
            into.folder("deep").file(name).unwrap().write("x").unwrap();
        }
        file.write("{}").unwrap();
        let maps = folder.join("maps");
        assert_eq!(outputs.told(), format!("wrote 2 files into {}\nwrote {}\n", maps.display(), a.display()));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn what_is_not_finished_leaves_the_target_as_it_was() {
        let folder = folder("unfinished");
        let path = folder.join("a.csv");
        let target = outputs(&[], true).file("--csv", Some(&path)).unwrap().unwrap();
        let mut file = target.create().unwrap();
        file.write_all(&[b'x'; 100_000]).unwrap();
        drop(file);
        assert_eq!(names(&folder), [""; 0]);
        target.write("whole").unwrap();
        let mut file = target.create().unwrap();
        file.write_all(b"half").unwrap();
        assert_eq!((fs::read(&path).unwrap(), names(&folder).len()), (b"whole".to_vec(), 2));
        drop(file);
        assert_eq!((fs::read(&path).unwrap(), names(&folder).len()), (b"whole".to_vec(), 1));
        fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn links_are_written_through_and_pipes_as_they_are() {
        let folder = folder("links");
        fs::write(folder.join("real"), "before").unwrap();
        std::os::unix::fs::symlink("real", folder.join("link")).unwrap();
        outputs(&[], true).file("--json", Some(&folder.join("link"))).unwrap().unwrap().write("now").unwrap();
        assert!(folder.join("link").is_symlink());
        assert_eq!(fs::read(folder.join("real")).unwrap(), b"now");
        outputs(&[], false).file("--json", Some(Path::new("/dev/null"))).unwrap().unwrap().write("x").unwrap();
        assert!(!Path::new("/dev/null").is_file());
        fs::remove_dir_all(folder).unwrap();
    }
}
