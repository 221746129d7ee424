//! The far end of an emulated board's CAN bus: its second controller, driven register by register from here.
//!
//! The emulator ends if a frame is sent into a full queue, so both sides look at the far controller's queue first.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use viewshed::bench::flash::Flash;
use viewshed::bench::record::{Closing, Record};
use viewshed::wire::frame::{CanFrame, CanId};

use super::Board;
use super::can_twin::{self, Sent, Step};
use super::machine::{CONTROL, Emulator, Folder};

/// Socket of the emulator's register access, in its folder.
pub const REGISTERS: &str = "registers.sock";

/// The board's controller and ours.
const NEAR: u32 = 0xFF06_0000;
const FAR: u32 = 0xFF07_0000;
const NOT_EMPTY: u32 = 1 << 7;
/// Frames sent in a row.
const ROW: usize = 16;

/// A board on a CAN bus with us.
pub struct CanBoard {
    replies: BufReader<UnixStream>,
    registers: UnixStream,
    sent: usize,
    /// Everything the board sent.
    pub answer: Vec<CanFrame>,
    emulator: Emulator,
    folder: Folder,
}

impl CanBoard {
    /// Starts a board with what it keeps.
    ///
    /// # Errors
    /// No emulator.
    pub fn start(image: &Path, flash: &Flash) -> Result<Self> {
        let folder = Folder::new()?;
        std::fs::write(folder.0.join("flash.bin"), flash.bytes()).context("cannot write the flash")?;
        Self::power_on(image, folder)
    }

    /// Takes its power away and gives it back.
    ///
    /// # Errors
    /// No emulator.
    pub fn restart(self, image: &Path) -> Result<Self> {
        let Self { emulator, folder, .. } = self;
        drop(emulator);
        Self::power_on(image, folder)
    }

    /// What it keeps.
    ///
    /// # Errors
    /// Not what a board keeps.
    pub fn flash(&self) -> Result<Flash> {
        let bytes = std::fs::read(self.folder.0.join("flash.bin")).context("the board keeps nothing")?;
        Ok(Flash::new(bytes.try_into().ok().context("the flash has another size")?))
    }

    /// What it said of itself when it was restarted last.
    pub fn closing(&self) -> Option<Closing> {
        let bytes = std::fs::read(self.folder.0.join("answer.bin")).ok()?;
        match Record::from_bytes(bytes.first_chunk()?)? {
            Record::Closing(closing) => Some(closing),
            _ => None,
        }
    }

    fn power_on(image: &Path, folder: Folder) -> Result<Self> {
        for socket in [REGISTERS, CONTROL] {
            let _ = std::fs::remove_file(folder.0.join(socket));
        }
        let listener = UnixListener::bind(folder.0.join(REGISTERS)).context("cannot open the register socket")?;
        listener.set_nonblocking(true)?;
        let emulator = Emulator::on_can(Board::Zcu102R5, image, &folder.0)?;
        let started = Instant::now();
        let registers = loop {
            match listener.accept() {
                Ok((stream, _)) => break stream,
                Err(e) if e.kind() == ErrorKind::WouldBlock && started.elapsed() < Duration::from_secs(20) => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                Err(e) => return Err(e).context("the emulator does not open its registers"),
            }
        };
        registers.set_nonblocking(false)?;
        registers.set_read_timeout(Some(Duration::from_secs(20)))?;
        let replies = BufReader::new(registers.try_clone()?);
        let mut board = Self { replies, registers, sent: 0, answer: Vec::new(), emulator, folder };
        emulator_on(&mut board)?;
        Ok(board)
    }

    fn command(&mut self, command: &str) -> Result<String> {
        writeln!(self.registers, "{command}")?;
        loop {
            let mut reply = String::new();
            if self.replies.read_line(&mut reply)? == 0 {
                bail!("the emulator has ended");
            }
            if let Some(value) = reply.strip_prefix("OK") {
                return Ok(value.trim().to_owned());
            }
            if !reply.starts_with("IRQ") {
                bail!("the emulator refused {command}: {reply}");
            }
        }
    }

    fn read(&mut self, address: u32) -> Result<u32> {
        let value = self.command(&format!("readl {address:#x}"))?;
        u32::from_str_radix(value.trim_start_matches("0x"), 16).with_context(|| format!("a register reads {value}"))
    }

    fn write(&mut self, address: u32, value: u32) -> Result<()> {
        self.command(&format!("writel {address:#x} {value:#x}")).map(drop)
    }

    /// Sends frames and takes what comes back.
    ///
    /// # Errors
    /// The board takes no more.
    pub fn send(&mut self, frames: &[CanFrame]) -> Result<()> {
        let mut queue: VecDeque<&CanFrame> = frames.iter().collect();
        let mut since = Instant::now();
        while let Some(frame) = queue.front() {
            if self.sent.is_multiple_of(ROW) && self.read(NEAR + 0x1C)? & NOT_EMPTY != 0 {
                self.collect()?;
                if since.elapsed() > Duration::from_secs(30) {
                    bail!("the board takes no more frames");
                }
                continue;
            }
            let mut words = [0_u32; 2];
            for (k, byte) in frame.data().iter().enumerate() {
                words[k / 4] |= u32::from(*byte) << (24 - 8 * (k % 4));
            }
            self.write(FAR + 0x30, frame.id.raw() << 21)?;
            self.write(FAR + 0x34, (frame.data().len() as u32) << 28)?;
            self.write(FAR + 0x38, words[0])?;
            self.write(FAR + 0x3C, words[1])?;
            self.sent += 1;
            queue.pop_front();
            since = Instant::now();
        }
        Ok(())
    }

    /// Sends a script and compares every frame that comes back with those of the same program here, from
    /// the board's start on; gives what was sent step by step.
    ///
    /// # Errors
    /// The first frame that differs.
    pub fn run(&mut self, flash: &mut Flash, steps: &[Step]) -> Result<Vec<Sent>> {
        let expected = can_twin::answer(flash, steps);
        self.exchange(steps, &expected)?;
        let all: Vec<&CanFrame> = expected.iter().flat_map(|sent| &sent.frames).collect();
        if let Some(first) = self.answer.iter().zip(&all).position(|(a, b)| a != *b) {
            bail!("frame {first} of the board is {:?}, here it is {:?}", self.answer[first], all[first]);
        }
        if self.answer.len() != all.len() {
            bail!("the board sent {} frames, {} are due", self.answer.len(), all.len());
        }
        Ok(expected)
    }

    /// Sends a script to a board from which this is expected, and takes what comes.
    ///
    /// # Errors
    /// The board takes no more.
    pub fn exchange(&mut self, steps: &[Step], expected: &[Sent]) -> Result<()> {
        let mut due = 0;
        for (step, sent) in steps.iter().zip(expected) {
            self.send(&step.all().collect::<Vec<_>>())?;
            due += sent.frames.len();
            if sent.starts_over {
                self.wait_for(due, Duration::from_secs(5))?;
            }
        }
        self.wait_for(due, Duration::from_secs(5))?;
        // and nothing more
        self.wait_for(due + 1, Duration::from_millis(50))
    }

    /// Takes frames until there are this many, or none for a while.
    ///
    /// # Errors
    /// The emulator ended.
    pub fn wait_for(&mut self, frames: usize, silence: Duration) -> Result<()> {
        let mut last = Instant::now();
        while self.answer.len() < frames && last.elapsed() < silence {
            if self.collect()? {
                last = Instant::now();
            }
        }
        Ok(())
    }

    /// Empties our controller's queue.
    fn collect(&mut self) -> Result<bool> {
        let before = self.answer.len();
        while self.read(FAR + 0x1C)? & NOT_EMPTY != 0 {
            let id = self.read(FAR + 0x50)? >> 21;
            let length = (self.read(FAR + 0x54)? >> 28).min(8) as usize;
            let words = [self.read(FAR + 0x58)?, self.read(FAR + 0x5C)?];
            self.write(FAR + 0x24, NOT_EMPTY)?;
            let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_be_bytes()).take(length).collect();
            let id = CanId::standard(id as u16).context("an extended identifier")?;
            self.answer.extend(CanFrame::classic(id, &bytes));
        }
        Ok(self.answer.len() > before)
    }
}

/// Puts our controller on the bus and waits for the board's.
fn emulator_on(board: &mut CanBoard) -> Result<()> {
    for (register, value) in [(0x00, 1), (0x00, 0), (0x04, 0), (0x00, 2)] {
        board.write(FAR + register, value)?;
    }
    let started = Instant::now();
    // its status says that it takes part, or listens
    while board.read(NEAR + 0x18)? & (1 << 3 | 1 << 12) == 0 {
        if started.elapsed() > Duration::from_secs(20) {
            bail!("the board does not come to its bus");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
