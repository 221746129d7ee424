//! What outlasts the daemon: the epoch of its maps and the configuration blocks, in the state folder.

use std::fs;
use std::io::{ErrorKind, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use log::{error, warn};
use viewshed::board::{BLOCK_LEN, SettingsSlots};
use viewshed::{Epoch, Settings};

/// The files that are kept.
pub const FILES: [&str; 2] = [EPOCH, SLOTS];
const EPOCH: &str = "epoch";
const SLOTS: &str = "slots";

/// The epoch of the maps, kept in the folder so that no start takes the one before.
pub struct KeptEpoch {
    path: Option<PathBuf>,
    last: Option<Epoch>,
}

impl KeptEpoch {
    pub fn new(folder: Option<&Path>) -> Self {
        Self { path: folder.map(|folder| folder.join(EPOCH)), last: None }
    }

    /// That of a start: after the last one, or after that of the last start of the daemon. Where nothing can be kept, the
    /// first one is by chance: one start in 16 then has the epoch of the one before.
    pub fn next(&mut self) -> Epoch {
        let chance = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| (d.as_micros() & 0xFF) as u8);
        let kept = || fs::read_to_string(self.path.as_ref()?).ok()?.trim().parse().ok().map(Epoch::new);
        let next = self.last.or_else(kept).map_or(Epoch::new(chance), Epoch::next);
        if self.path.is_none() && self.last.is_none() {
            warn!("no state folder: the epoch is by chance, and blocks are not kept");
        }
        self.follow(next);
        next
    }

    /// That of the sender now, which goes on by itself where the radar's clock steps back.
    pub fn follow(&mut self, epoch: Epoch) {
        if self.last.replace(epoch) == Some(epoch) {
            return;
        }
        let Some(path) = &self.path else { return };
        if let Err(e) = replace(path, epoch.number().to_string().as_bytes()) {
            warn!("{}: {e}: the epoch is not kept", path.display());
        }
    }
}

/// Writes a file whole or not at all.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let new = path.with_extension("new");
    let mut file = fs::File::create(&new)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(new, path)?;
    sync_folder(path)
}

/// Names outlast a loss of power only once their folder is written.
fn sync_folder(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match fs::File::open(folder)?.sync_all() {
        // some file systems have no such thing
        Err(e) if e.kind() == ErrorKind::InvalidInput => Ok(()),
        done => done,
    }
}

/// Bytes of a block of layout 1, of which an older file has two.
const LAYOUT_1_LEN: usize = 148;

/// What holds no block and is not empty: the head of one, and no check sum that fits.
const UNREADABLE: [u8; BLOCK_LEN] = {
    let mut block = [0; BLOCK_LEN];
    let [low, high] = (BLOCK_LEN as u16).to_le_bytes();
    [block[0], block[1], block[2], block[3], block[4], block[6], block[7]] = [b'V', b'S', b'C', b'B', 2, low, high];
    block
};

/// The two slots of configuration blocks: in a file once one was written, before that, and once both were emptied, the
/// settings of the configuration file.
pub struct FileSlots {
    path: Option<PathBuf>,
    slots: [[u8; BLOCK_LEN]; 2],
    /// What the configuration file says.
    of_file: [u8; BLOCK_LEN],
}

impl FileSlots {
    /// Reads the slots. Where none was written, the first holds these settings; where that cannot be told, neither holds
    /// any.
    pub fn open(folder: Option<&Path>, settings: Option<&Settings>) -> Self {
        let path = folder.map(|folder| folder.join(SLOTS));
        let mut slots = [[0xFF; BLOCK_LEN]; 2];
        let of_file = settings.map_or([0xFF; BLOCK_LEN], |settings| settings.to_block(1));
        let kept = match path.as_ref().map(|path| (path, fs::read(path))) {
            Some((_, Ok(kept))) => kept,
            Some((path, Err(e))) if e.kind() != ErrorKind::NotFound => {
                error!("{}: {e}: which configuration blocks were written is not known", path.display());
                return Self { path: Some(path.clone()), slots: [UNREADABLE; 2], of_file };
            }
            _ => Vec::new(),
        };
        let length = if kept.len() == 2 * LAYOUT_1_LEN { LAYOUT_1_LEN } else { BLOCK_LEN };
        for (slot, bytes) in slots.iter_mut().zip(kept.chunks(length)) {
            slot[..bytes.len()].copy_from_slice(bytes);
        }
        if kept.is_empty() {
            slots[0] = of_file;
        }
        Self { path, slots, of_file }
    }

    fn is_empty(&self) -> bool {
        self.slots.as_flattened().iter().all(|byte| *byte == 0xFF)
    }

    fn keep(&self, slot: usize) -> std::io::Result<()> {
        let Some(path) = &self.path else {
            warn!("a configuration block was written; without a state folder it is kept until the daemon ends");
            return Ok(());
        };
        if self.is_empty() {
            return match fs::remove_file(path) {
                // no block was written
                Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
                Err(e) => Err(e),
                Ok(()) => sync_folder(path),
            };
        }
        let file = fs::OpenOptions::new().create(true).truncate(false).write(true).open(path)?;
        // new, or with blocks of the layout before
        if file.metadata()?.len() != self.slots.as_flattened().len() as u64 {
            file.write_all_at(self.slots.as_flattened(), 0)?;
        }
        file.write_all_at(&self.slots[slot], (slot * BLOCK_LEN) as u64)?;
        file.sync_all()?;
        sync_folder(path)
    }
}

impl SettingsSlots for FileSlots {
    fn slot(&self, slot: usize) -> &[u8] {
        self.slots.get(slot).map_or(&[], |block| block)
    }

    fn write(&mut self, slot: usize, block: &[u8]) {
        let Some(place) = self.slots.get_mut(slot) else { return };
        let before = *place;
        place.iter_mut().zip(block).for_each(|(to, from)| *to = *from);
        if let Err(e) = self.keep(slot) {
            error!("{}: {e}: a configuration block is lost", self.path.as_deref().unwrap_or(Path::new("")).display());
            // reading it back is to show that it was not written
            self.slots[slot] = before;
        }
        if self.is_empty() {
            self.slots[0] = self.of_file;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewshed::board::{BlockError, StoredSettings};
    use viewshed::unit::settings::BlockKind;
    use viewshed::{ConfigError, FieldOfView, Mount, NoiseConfig, Sensor, reference::CHECK};

    fn settings(height_m: f32) -> Settings {
        Settings::of(Sensor {
            mount: Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 },
            field_of_view: FieldOfView {
                azimuth_min_deg: -60.0,
                azimuth_max_deg: 60.0,
                elevation_min_deg: -16.0,
                elevation_max_deg: 16.0,
                range_min_m: 3.0,
                range_max_m: 200.0,
            },
            noise: NoiseConfig::default(),
        })
    }

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("viewshedd-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn height(slots: &FileSlots) -> Result<f32, BlockError> {
        let stored = StoredSettings::read(slots, CHECK);
        stored.position().map_err(|refused| refused.error).map(|_| stored.settings().unwrap().sensor.mount.height_m)
    }

    #[test]
    fn epochs_go_on_from_start_to_start() {
        let folder = folder("epochs");
        let start = || KeptEpoch::new(Some(&folder)).next();
        let first = start();
        assert_eq!(start(), first.next());
        fs::write(folder.join("epoch"), "15").unwrap();
        assert_eq!(start().number(), 0);
        fs::write(folder.join("epoch"), "rubbish").unwrap();
        start();
        assert!(fs::read_to_string(folder.join("epoch")).unwrap().parse::<u8>().is_ok());
        // those that a sender went on to by itself are gone as well
        let mut epoch = KeptEpoch::new(Some(&folder));
        let own = epoch.next().next().next();
        epoch.follow(own);
        assert_eq!((start(), epoch.next()), (own.next(), own.next()));
        fs::remove_dir_all(folder).unwrap();
        // also where nothing can be kept, a restart is a new epoch
        let mut epoch = KeptEpoch::new(None);
        let first = epoch.next();
        assert_eq!(epoch.next(), first.next());
    }

    #[test]
    fn the_files_settings_count_until_a_block_is_written_and_a_damaged_block_is_not_used() {
        let folder = folder("slots");
        let mut slots = FileSlots::open(Some(&folder), Some(&settings(6.0)));
        assert_eq!(height(&slots), Ok(6.0));
        assert!(!folder.join("slots").exists());
        slots.write(1, &settings(7.0).to_block(2));
        let slots = FileSlots::open(Some(&folder), Some(&settings(8.0)));
        assert_eq!(height(&slots), Ok(7.0), "a written block goes before the file");
        let mut bytes = fs::read(folder.join("slots")).unwrap();
        bytes[BLOCK_LEN + 40] ^= 1;
        fs::write(folder.join("slots"), &bytes).unwrap();
        assert_eq!(height(&FileSlots::open(Some(&folder), Some(&settings(8.0)))), Ok(6.0), "the older one");
        bytes[40] ^= 1;
        fs::write(folder.join("slots"), &bytes).unwrap();
        let damaged = FileSlots::open(Some(&folder), Some(&settings(8.0)));
        assert_eq!(height(&damaged), Err(BlockError::CheckSum), "never silently another");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn emptied_slots_are_the_files_settings_again() {
        let folder = folder("emptied");
        let mut slots = FileSlots::open(Some(&folder), Some(&settings(6.0)));
        slots.write(1, &settings(7.0).to_block(2));
        assert_eq!(height(&slots), Ok(7.0));
        (0..2).for_each(|slot| slots.write(slot, &[0xFF; BLOCK_LEN]));
        assert_eq!(height(&slots), Ok(6.0));
        assert!(!folder.join("slots").exists());
        assert_eq!(height(&FileSlots::open(Some(&folder), Some(&settings(8.0)))), Ok(8.0));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn slots_that_are_emptied_before_a_block_was_written_stay_the_files() {
        let folder = folder("emptied-first");
        let mut slots = FileSlots::open(Some(&folder), Some(&settings(6.0)));
        for _ in 0..2 {
            StoredSettings::clear(BlockKind::Settings, &mut slots);
            assert_eq!((height(&slots), folder.join("slots").exists()), (Ok(6.0), false));
        }
        assert_eq!(height(&FileSlots::open(Some(&folder), Some(&settings(8.0)))), Ok(8.0));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn slots_that_cannot_be_read_are_not_taken_for_slots_that_were_never_written() {
        let folder = folder("unreadable");
        fs::create_dir(folder.join("slots")).unwrap();
        let mut slots = FileSlots::open(Some(&folder), Some(&settings(6.0)));
        assert_eq!(height(&slots), Err(BlockError::CheckSum), "never silently the file's");
        // what cannot be kept is not answered as written, either
        assert!(StoredSettings::read(&slots, CHECK).write(&settings(7.0).to_block(0), &mut slots).is_err());
        fs::remove_dir(folder.join("slots")).unwrap();
        assert!(StoredSettings::read(&slots, CHECK).write(&settings(7.0).to_block(0), &mut slots).is_ok());
        assert_eq!(height(&FileSlots::open(Some(&folder), Some(&settings(6.0)))), Ok(7.0));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_file_of_the_layout_before_is_read_and_grows_with_the_first_write() {
        let folder = folder("older");
        let old = |height_m, sequence: u32| {
            let mut block = settings(height_m).to_block(sequence)[..LAYOUT_1_LEN].to_vec();
            (block[4], block[6]) = (1, 148);
            let sum = crc32(&block[..LAYOUT_1_LEN - 4]);
            block[LAYOUT_1_LEN - 4..].copy_from_slice(&sum.to_le_bytes());
            block
        };
        fs::write(folder.join("slots"), [old(6.0, 1), old(7.0, 2)].concat()).unwrap();
        let mut slots = FileSlots::open(Some(&folder), None);
        assert_eq!(height(&slots), Ok(7.0));
        slots.write(0, &settings(8.0).to_block(3));
        assert_eq!(fs::metadata(folder.join("slots")).unwrap().len(), 2 * BLOCK_LEN as u64);
        let slots = FileSlots::open(Some(&folder), None);
        assert_eq!(height(&slots), Ok(8.0));
        // the other one is still there, should power fail now
        let mut bytes = fs::read(folder.join("slots")).unwrap();
        bytes[40] ^= 1;
        fs::write(folder.join("slots"), &bytes).unwrap();
        assert_eq!(height(&FileSlots::open(Some(&folder), None)), Ok(7.0));
        fs::remove_dir_all(folder).unwrap();
    }

    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |sum, byte| {
            (0..8).fold(
                sum ^ u32::from(*byte),
                |sum: u32, _| if sum & 1 == 1 { sum >> 1 ^ 0xEDB8_8320 } else { sum >> 1 },
            )
        })
    }

    #[test]
    fn a_block_that_cannot_run_is_not_written_and_not_used() {
        let folder = folder("limits");
        // in no view: 1 m above ground from 6 m high, 4 m far
        let mut short = settings(6.0);
        (short.sensor.field_of_view.range_min_m, short.sensor.field_of_view.range_max_m) = (0.5, 4.0);
        let mut slots = FileSlots::open(Some(&folder), Some(&settings(6.0)));
        let refused = StoredSettings::read(&slots, CHECK).write(&short.to_block(0), &mut slots);
        assert!(matches!(refused.map_err(|e| e.error), Err(BlockError::Parameter(ConfigError { .. }))), "{refused:?}");
        assert!(!folder.join("slots").exists());
        // an older version stored it
        slots.write(1, &short.to_block(9));
        assert_eq!(height(&FileSlots::open(Some(&folder), None)), Ok(6.0), "the one before");
        slots.write(0, &short.to_block(8));
        let Err(BlockError::Parameter(e)) = height(&FileSlots::open(Some(&folder), None)) else { panic!("used") };
        assert!(e.parameter.starts_with("field_of_view."), "{e}");
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn without_settings_and_blocks_there_is_nothing_to_work_with() {
        assert_eq!(height(&FileSlots::open(None, None)), Err(BlockError::Empty));
    }
}
