//! Emulated boards: a job goes in as a file, the answer comes out as one.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use viewshed::bench::job::JobEntry;
use viewshed::unit::settings::Settings;

use super::Board;
use super::scans::{Scan, job};

/// Longer than any recording that is worth emulating takes.
const TIME_LIMIT: Duration = Duration::from_secs(900);

/// Runs a job in batch mode and gives the answer.
///
/// # Errors
/// No emulator, one that does not end, one that ends without an answer.
pub fn batch<T: JobEntry>(
    board: Board,
    image: &Path,
    settings: &Settings,
    scans: &[Scan<T>],
    dump: Option<usize>,
) -> Result<Vec<u8>> {
    let folder = Folder::new()?;
    let dump = dump.and_then(|frame| u32::try_from(frame).ok());
    std::fs::write(folder.0.join("job.bin"), job(settings, scans, dump)).context("cannot write the job")?;
    let mut child = Emulator::start(board, image, &folder.0, Lines::None)?;
    let code = child.wait()?;
    let answer = std::fs::read(folder.0.join("answer.bin")).unwrap_or_default();
    // 1: refused, with its reason in the closing record
    if code != Some(0) && (code != Some(1) || answer.is_empty()) {
        let log = std::fs::read_to_string(folder.0.join("log")).unwrap_or_default();
        bail!("{} ended with {code:?}: {}", board.name(), log.trim());
    }
    Ok(answer)
}

/// A running emulator; ends when dropped.
pub struct Emulator {
    child: Child,
}

/// What the board's serial lines are connected to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// Nothing.
    None,
    /// Sockets in the emulator's folder.
    Sockets(&'static [&'static str]),
    /// A CAN bus between both of the board's controllers; the registers of the second are ours.
    CanBus,
}

impl Emulator {
    /// Starts a board with an image; its files lie in the folder.
    ///
    /// # Errors
    /// No emulator.
    pub fn start(board: Board, image: &Path, folder: &Path, lines: Lines) -> Result<Self> {
        let mut command = match board {
            Board::Mps2An386 => cortex_m("mps2-an386", image),
            Board::Mps2An500 => cortex_m("mps2-an500", image),
            Board::Zcu102R5 => cortex_r(image),
        };
        command.args(["-display", "none", "-monitor", "none", "-semihosting-config", "enable=on,target=native"]);
        match lines {
            Lines::None => {
                command.args(["-serial", "none"]);
            }
            Lines::CanBus => {
                command.args(["-serial", "none", "-object", "can-bus,id=bus"]);
                command.args(["-machine", "canbus0=bus", "-machine", "canbus1=bus", "-accel", "tcg"]);
                command.args(["-qtest", "unix:registers.sock", "-qtest-log", "none"]);
            }
            Lines::Sockets(names) => {
                for (k, name) in names.iter().enumerate() {
                    command.arg("-chardev").arg(format!("socket,id=line{k},path={name}"));
                    command.arg("-serial").arg(format!("chardev:line{k}"));
                }
            }
        }
        let log = std::fs::File::create(folder.join("log")).context("cannot write the emulator's log")?;
        command.current_dir(folder).stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log);
        let program = command.get_program().to_string_lossy().into_owned();
        let child = command
            .spawn()
            .with_context(|| format!("cannot run {program}; on Debian and Ubuntu: apt-get install qemu-system-arm"))?;
        let emulator = Self { child };
        if board == Board::Zcu102R5 {
            power_on(&folder.join(CONTROL))?;
        }
        Ok(emulator)
    }

    /// Starts a board with a CAN bus to its second controller and with its registers open to us.
    ///
    /// # Errors
    /// No emulator.
    #[cfg(unix)]
    pub fn on_can(board: Board, image: &Path, folder: &Path) -> Result<Self> {
        Self::start(board, image, folder, Lines::CanBus)
    }

    /// Waits for the firmware to end and gives its exit code.
    ///
    /// # Errors
    /// It takes longer than any recording that is worth emulating.
    pub fn wait(&mut self) -> Result<Option<i32>> {
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status.code());
            }
            if started.elapsed() > TIME_LIMIT {
                bail!("the emulator did not end within {} s", TIME_LIMIT.as_secs());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // it does not always end when asked to
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An instruction takes 64 ns, so that the board's timers count instructions.
fn cortex_m(machine: &str, image: &Path) -> Command {
    let mut command = Command::new("qemu-system-arm");
    command.args(["-M", machine, "-icount", "shift=6", "-kernel"]).arg(image);
    command
}

/// Socket the emulator is controlled by, in its folder.
pub const CONTROL: &str = "control.sock";

/// The real-time core is processor 4, and off at first.
fn cortex_r(image: &Path) -> Command {
    let mut command = Command::new("qemu-system-aarch64");
    command.args(["-M", "xlnx-zcu102", "-smp", "5", "-m", "256M", "-S"]);
    command.args(["-global", "xlnx-zynqmp.boot-cpu=rpu-cpu[0]"]);
    command.arg("-qmp").arg(format!("unix:{CONTROL},server=on,wait=off"));
    command.arg("-device").arg(format!("loader,file={},cpu-num=4", image.display()));
    command
}

#[cfg(unix)]
fn power_on(control: &Path) -> Result<()> {
    use std::io::{BufRead, BufReader, Write};
    use std::os::unix::net::UnixStream;

    let started = Instant::now();
    let mut socket = loop {
        match UnixStream::connect(control) {
            Ok(socket) => break socket,
            Err(error) if started.elapsed() > Duration::from_secs(20) => {
                return Err(error).context("cannot connect to the emulator");
            }
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    socket.set_read_timeout(Some(Duration::from_secs(20)))?;
    let mut replies = BufReader::new(socket.try_clone()?).lines();
    for command in [
        r#"{"execute":"qmp_capabilities"}"#,
        r#"{"execute":"qom-set","arguments":{"path":"/machine/soc/rpu-cluster/rpu-cpu[0]","property":"start-powered-off","value":false}}"#,
        r#"{"execute":"system_reset"}"#,
        r#"{"execute":"cont"}"#,
    ] {
        writeln!(socket, "{command}")?;
        loop {
            let reply = replies.next().context("the emulator does not answer")??;
            if reply.contains("\"error\"") {
                bail!("the emulator refused {command}: {reply}");
            }
            // greetings and events come between
            if reply.contains("\"return\"") {
                break;
            }
        }
    }
    Ok(())
}

#[cfg(not(unix))]
fn power_on(_: &Path) -> Result<()> {
    bail!("this board can be emulated on Unix only")
}

/// A folder that goes when it is dropped.
pub struct Folder(pub PathBuf);

impl Folder {
    /// A new one.
    ///
    /// # Errors
    /// It cannot be created.
    pub fn new() -> Result<Self> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("viewshed-board-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
