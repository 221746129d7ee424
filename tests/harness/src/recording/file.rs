//! The bytes of a recording: of a file, plain or gzip, or of standard input.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, ErrorKind, IsTerminal, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use anyhow::{Context, Result, anyhow, bail};
use flate2::read::MultiGzDecoder;

/// The path that stands for standard input.
pub const STANDARD_INPUT: &str = "-";

/// What a gzip file begins with.
const GZIP: [u8; 2] = [0x1F, 0x8B];

/// What a file holds.
#[derive(Debug, PartialEq, Eq)]
pub struct Content {
    /// Unpacked.
    pub bytes: Vec<u8>,
    /// That not all could be unpacked as it was packed, with the file's name.
    pub damage: Option<String>,
}

/// What to do about that.
pub const DAMAGE_REMEDY: &str = "record again, or pack the original again";

/// All bytes, unpacked, for those who need not say whether they are whole.
///
/// # Errors
/// Those of [`read`].
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    read(path).map(|content| content.bytes)
}

/// All bytes, unpacked. Standard input and pipes are read once and kept.
///
/// # Errors
/// A file that cannot be read or unpacked; a terminal as standard input.
pub fn read(path: &Path) -> Result<Content> {
    Source::of(path)?.read()
}

/// Where the bytes of a recording are: they can be read from their begin as often as wanted, and are kept in memory only
/// where they come once.
#[derive(Debug, Clone)]
pub struct Source {
    shown: String,
    held: Held,
}

#[derive(Debug, Clone)]
enum Held {
    File(PathBuf),
    Memory(Arc<[u8]>),
}

impl Source {
    /// Those of a file, of standard input or of a pipe.
    ///
    /// # Errors
    /// A folder, a terminal as standard input, a pipe that cannot be read.
    pub fn of(path: &Path) -> Result<Self> {
        let shown = shown(path).into_owned();
        if path.is_dir() {
            bail!("cannot read {shown}: it is a folder; name a recording in it, of a ROS 2 bag the .mcap");
        }
        let held = if path == Path::new(STANDARD_INPUT) {
            Held::Memory(standard_input()?)
        } else if is_pipe(path) {
            Held::Memory(pipe(path).with_context(|| format!("cannot read {shown}"))?)
        } else {
            Held::File(path.to_owned())
        };
        Ok(Self { shown, held })
    }

    /// Bytes that are there already.
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Self { shown: "bytes".into(), held: Held::Memory(bytes.into()) }
    }

    /// Reads from the begin.
    ///
    /// # Errors
    /// A file that cannot be opened.
    pub fn open(&self) -> Result<Unpacked> {
        let place = || format!("cannot read {}", self.shown);
        let mut plain: Box<dyn BufRead> = match &self.held {
            Held::File(path) => Box::new(BufReader::with_capacity(1 << 16, File::open(path).with_context(place)?)),
            Held::Memory(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
        };
        let packed = plain.fill_buf().with_context(place)?.starts_with(&GZIP);
        let source: Box<dyn Read> = if packed { Box::new(MultiGzDecoder::new(plain)) } else { Box::new(plain) };
        Ok(Unpacked { shown: self.shown.clone(), source, packed, any: false, damage: None })
    }

    /// The first bytes, at most `count`.
    ///
    /// # Errors
    /// Those of [`Self::read`].
    pub fn begin(&self, count: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.open()?.take(count).read_to_end(&mut bytes).with_context(|| format!("cannot read {}", self.shown))?;
        Ok(bytes)
    }

    /// All bytes.
    ///
    /// # Errors
    /// A file that cannot be read or unpacked.
    pub fn read(&self) -> Result<Content> {
        let mut bytes = Vec::new();
        let mut unpacked = self.open()?;
        unpacked.read_to_end(&mut bytes).with_context(|| format!("cannot read {}", self.shown))?;
        Ok(Content { bytes, damage: unpacked.damage })
    }

    /// The path to be shown.
    pub fn shown(&self) -> &str {
        &self.shown
    }
}

/// Bytes, unpacked as they are read; of a packed file that is damaged, those before the break.
pub struct Unpacked {
    shown: String,
    source: Box<dyn Read>,
    packed: bool,
    any: bool,
    damage: Option<String>,
}

impl Unpacked {
    /// That not all could be unpacked, with the file's name; known when all was read.
    pub fn damage(&self) -> Option<&str> {
        self.damage.as_deref()
    }
}

impl Read for Unpacked {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        if self.damage.is_some() {
            return Ok(0);
        }
        match self.source.read(into) {
            Err(error) if self.packed && self.any && error.kind() != ErrorKind::Interrupted => {
                let of = &self.shown;
                let damage = format!("the packed file {of} is damaged or cut off, read as far as it goes: {error}");
                self.damage = Some(damage);
                Ok(0)
            }
            read => {
                self.any |= read.as_ref().is_ok_and(|n| *n > 0);
                read
            }
        }
    }
}

fn standard_input() -> Result<Arc<[u8]>> {
    static READ: OnceLock<Result<Arc<[u8]>, String>> = OnceLock::new();
    let mut input = std::io::stdin().lock();
    if READ.get().is_none() && input.is_terminal() {
        bail!("`-` is standard input, and that is a terminal: give a file, or pipe a log into it");
    }
    let read = READ.get_or_init(|| {
        let mut bytes = Vec::new();
        input.read_to_end(&mut bytes).map(|_| bytes.into()).map_err(|error| error.to_string())
    });
    read.clone().map_err(|error| anyhow!("cannot read standard input: {error}"))
}

/// Whether what is read from a path is gone afterwards: a named pipe, or `<(command)` of a shell.
fn is_pipe(path: &Path) -> bool {
    path.metadata().is_ok_and(|about| !about.is_file())
}

/// The bytes of a pipe, which come once: who asks again is given the same.
fn pipe(path: &Path) -> std::io::Result<Arc<[u8]>> {
    static READ: Mutex<BTreeMap<PathBuf, Arc<[u8]>>> = Mutex::new(BTreeMap::new());
    let mut read = READ.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(bytes) = read.get(path) {
        return Ok(Arc::clone(bytes));
    }
    let bytes: Arc<[u8]> = std::fs::read(path)?.into();
    read.insert(path.to_owned(), Arc::clone(&bytes));
    Ok(bytes)
}

/// Whether there is something of this name; what is read for minutes need not begin if the next is a typing error.
///
/// # Errors
/// There is nothing, or it cannot be seen.
pub fn there(path: &Path) -> Result<()> {
    if path != Path::new(STANDARD_INPUT) {
        path.metadata().with_context(|| format!("cannot read {}", shown(path)))?;
    }
    Ok(())
}

/// The path to be shown.
pub fn shown(path: &Path) -> Cow<'_, str> {
    if path == Path::new(STANDARD_INPUT) { "standard input".into() } else { path.to_string_lossy() }
}

/// The name of a recording: its file's, without what comes after the last point and without `.gz`.
pub fn stem(path: &Path) -> String {
    if path == Path::new(STANDARD_INPUT) {
        return "stdin".into();
    }
    unpacked_stem(path)
}

/// The name of the file that is packed in this one, if one is, without what comes after the last point.
pub fn unpacked_stem(path: &Path) -> String {
    Path::new(&unpacked_name(path)).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The name of the file that is packed in this one, if one is.
pub fn unpacked_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.strip_suffix(".gz").unwrap_or(&name).to_owned()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    #[test]
    fn packed_files_are_unpacked_and_cut_ones_up_to_the_break() {
        let folder = std::env::temp_dir().join(format!("viewshed-packed-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.log.gz");
        // two members, as `cat a.gz b.gz` makes them
        let packed = |text: &str| {
            let mut gz = GzEncoder::new(Vec::new(), Compression::fast());
            gz.write_all(text.as_bytes()).unwrap();
            gz.finish().unwrap()
        };
        let text = "(1.0) can0 60A#01C24910\n".repeat(4000);
        std::fs::write(&path, [packed("first\n"), packed(&text)].concat()).unwrap();
        assert_eq!(bytes(&path).unwrap(), format!("first\n{text}").into_bytes());
        let whole = packed(&text);
        assert_eq!(read(&path).unwrap().damage, None);
        // the sum of a member, and the end
        let mut flipped = whole.clone();
        flipped[whole.len() - 8] ^= 1;
        for damaged in [&flipped[..], &whole[..whole.len() - 12]] {
            std::fs::write(&path, damaged).unwrap();
            let Content { bytes, damage } = read(&path).unwrap();
            assert!(text.as_bytes().starts_with(&bytes));
            assert!(damage.unwrap().contains("a.log.gz is damaged or cut off"));
        }
        std::fs::write(&path, &whole[..10]).unwrap();
        assert!(bytes(&path).unwrap_err().to_string().contains("a.log.gz"));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_folder_is_no_recording() {
        let error = bytes(&std::env::temp_dir()).unwrap_err().to_string();
        assert!(error.starts_with("cannot read ") && error.contains("name a recording in it"), "{error}");
    }

    #[test]
    fn names_are_of_what_is_packed() {
        let names = ["logs/a.log.gz", "a.mcap", "b", "-", "c.boxes.csv"].map(|path| stem(Path::new(path)));
        assert_eq!(names, ["a", "a", "b", "stdin", "c.boxes"]);
    }
}
