//! The bench over files in the folder of an emulator or debugger, whatever trap a core reaches them by.
//!
//! `job.bin` comes in, `answer.bin` goes out, `flash.bin` is what the unit keeps.

use core::ffi::CStr;

use super::Bench;
use super::flash::{FLASH_LEN, Flash};
use super::record::Record;
use crate::unit::settings::SettingsSlots;
use crate::wire::message::Epoch;

const JOB: &CStr = c"job.bin";
const ANSWER: &CStr = c"answer.bin";
const FLASH: &CStr = c"flash.bin";

/// A file of the host, as a board reaches it.
pub trait HostFile: Sized {
    /// Opens a file for reading.
    fn open(name: &CStr) -> Option<Self>;
    /// Opens a file for writing, empty.
    fn create(name: &CStr) -> Option<Self>;
    /// Reads up to as many bytes as the buffer has; 0 at the end.
    fn read(&mut self, buffer: &mut [u8]) -> usize;
    /// Writes some of the bytes; how many, 0 if it takes none.
    fn write(&mut self, bytes: &[u8]) -> usize;
}

/// What a board knows of its core.
pub trait Core {
    /// Ticks of a free-running 32-bit counter that counts instructions; 0 where there is none.
    fn ticks(&mut self) -> u32;
    /// Its ticks to 256 instructions; 0 where it does not count instructions.
    fn ticks_per_256(&self) -> u32;
    /// Most bytes of stack used so far, and how many there are.
    fn stack(&self) -> [u32; 2];
}

/// Job and answer.
#[derive(Debug)]
pub struct Files<F, C> {
    job: F,
    answer: F,
    core: C,
}

impl<F: HostFile, C: Core> Files<F, C> {
    /// Opens them; `None` without a host that has them.
    pub fn open(core: C) -> Option<Self> {
        Some(Self { job: F::open(JOB)?, answer: F::create(ANSWER)?, core })
    }
}

impl<F: HostFile, C: Core> Bench for Files<F, C> {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        self.job.read(buffer)
    }

    /// What the host does not take is missing there, and it will say so.
    fn write(&mut self, bytes: &[u8]) {
        write_all(&mut self.answer, bytes);
    }

    fn ticks(&mut self) -> u32 {
        self.core.ticks()
    }

    fn ticks_per_256(&self) -> u32 {
        self.core.ticks_per_256()
    }

    fn stack(&self) -> [u32; 2] {
        self.core.stack()
    }
}

/// Leaves one record as the answer.
pub fn answer<F: HostFile>(record: &Record) {
    if let Some(mut file) = F::create(ANSWER) {
        write_all(&mut file, &record.to_bytes());
    }
}

fn write_all(file: &mut impl HostFile, bytes: &[u8]) {
    let mut rest = bytes;
    while !rest.is_empty() {
        match file.write(rest) {
            0 => return,
            n => rest = rest.get(n..).unwrap_or(&[]),
        }
    }
}

/// Flash that lies in a file, so that it outlasts the emulator.
#[derive(Debug)]
pub struct FlashFile<F> {
    flash: Flash,
    file: core::marker::PhantomData<F>,
}

impl<F: HostFile> FlashFile<F> {
    /// Reads it; erased where there is none.
    pub fn open() -> Self {
        let mut bytes = [0xFF; FLASH_LEN];
        let mut filled = 0;
        if let Some(mut file) = F::open(FLASH) {
            while let Some(rest) = bytes.get_mut(filled..).filter(|rest| !rest.is_empty()) {
                match file.read(rest) {
                    0 => break,
                    n => filled += n,
                }
            }
        }
        Self { flash: Flash::new(bytes), file: core::marker::PhantomData }
    }

    /// Counts a start.
    pub fn start(&mut self) -> Epoch {
        let epoch = self.flash.start();
        self.keep();
        epoch
    }

    fn keep(&self) {
        if let Some(mut file) = F::create(FLASH) {
            write_all(&mut file, self.flash.bytes());
        }
    }
}

impl<F: HostFile> SettingsSlots for FlashFile<F> {
    fn slot(&self, slot: usize) -> &[u8] {
        self.flash.slot(slot)
    }

    fn write(&mut self, slot: usize, block: &[u8]) {
        self.flash.write(slot, block);
        self.keep();
    }
}
