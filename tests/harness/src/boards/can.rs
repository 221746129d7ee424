//! The far end of an emulated board's CAN bus: its second controller, driven register by register from here.
//!
//! The emulator ends if a frame is sent into a full queue, so both sides look at the far controller's queue first.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use viewshed::can_session::{CanSession, TIME_ID};
use viewshed::inputs::ars408::Config;
use viewshed::pil::job::Job;
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::settings::Settings;
use viewshed::time::Time;
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Epoch};

use super::Board;
use super::machine::{Emulator, Folder};

/// Socket of the emulator's register access, in its folder.
pub const REGISTERS: &str = "registers.sock";

/// The board's controller and ours.
const NEAR: u32 = 0xFF06_0000;
const FAR: u32 = 0xFF07_0000;
const NOT_EMPTY: u32 = 1 << 7;
/// Frames sent in a row.
const ROW: usize = 16;

/// A frame that tells the board the time.
pub fn time_frame(time: Time) -> CanFrame {
    CanFrame::classic(TIME_ID, &time.micros().to_be_bytes()).expect("eight bytes")
}

/// What a board with the reference grid sends for these frames.
///
/// # Errors
/// Settings the library refuses.
pub fn answer(settings: &Settings, frames: &[CanFrame]) -> Result<Vec<CanFrame>> {
    let parameters = Radar3dParameters::<200, 120, 16>::new(&settings.sensor, &settings.radar_3d())?;
    let mut state = Box::new(Radar3d::<200, 120, 16, 7, 64, 256>::new());
    let mut map = Box::new(parameters.map());
    let (medium, epoch) = (Medium::Can(Addresses::STANDARD), Epoch::new(1));
    let sender = bench_sender::<200, 120, 16, 7>(settings, &parameters, medium, epoch, Time::from_micros(0));
    let mut sender = Box::new(sender.context("maps of this sensor cannot be sent")?);
    let mut unit = Unit::new(&parameters, &mut state, &mut map, &mut sender);
    let mut session = CanSession::<256>::new(Config::sensor(0));
    let mut sent = Vec::new();
    for frame in frames {
        session.bench_frame(frame, &mut unit);
        sent.extend(std::iter::from_fn(|| unit.next_frame(session.now())));
    }
    Ok(sent)
}

/// A board on a CAN bus with us.
pub struct CanBoard {
    replies: BufReader<UnixStream>,
    registers: UnixStream,
    sent: usize,
    /// Everything the board sent.
    pub answer: Vec<CanFrame>,
    _emulator: Emulator,
    _folder: Folder,
}

impl CanBoard {
    /// Starts a board with its settings.
    ///
    /// # Errors
    /// No emulator.
    pub fn start(image: &Path, settings: &Settings) -> Result<Self> {
        let folder = Folder::new()?;
        std::fs::write(folder.0.join("job.bin"), Job { settings: *settings, dump: None }.to_bytes())?;
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
        let mut board = Self { replies, registers, sent: 0, answer: Vec::new(), _emulator: emulator, _folder: folder };
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
    // its status says that it is in normal mode
    while board.read(NEAR + 0x18)? & 1 << 3 == 0 {
        if started.elapsed() > Duration::from_secs(20) {
            bail!("the board does not come to its bus");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}
