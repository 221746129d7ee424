//! Which blocks of instructions ran, how often, and how often their last one jumped: from QEMU's log (`-d exec,nochain,in_asm`).

use std::collections::HashMap;
use std::io::BufRead;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// One instruction as QEMU's disassembler writes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instruction {
    pub address: u32,
    pub bytes: u32,
    pub mnemonic: String,
    pub operands: String,
}

/// Instructions that run one after another; at most the last one jumps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    pub instructions: Vec<Instruction>,
    /// Times it ran in what is counted.
    pub times: u64,
    /// Of these, how often what ran next did not follow it in memory.
    pub jumped: u64,
}

impl Block {
    fn end(&self) -> Option<u32> {
        self.instructions.last().map(|last| last.address.wrapping_add(last.bytes))
    }
}

/// Parts of the names of functions that work on a frame: the estimator, and its map into messages. A method of a trait is named in
/// another way.
const OF_A_FRAME: [&str; 9] =
    ["frame", "grid", "obstacles", "radar_3d", "fixed", "sensor", "map", "wire", "unit17Unit"];
/// Of functions that anybody calls: what they do is done for the caller.
const ANYBODYS: [&str; 6] = ["compiler_builtins", "__aeabi_", "memcpy", "memset", "memcmp", "int_sqrt"];

fn is_of_a_frame(function: &str) -> bool {
    let room =
        |from: &str| function.split_once(from).map(|(_, rest)| rest.trim_start_matches(|c: char| c.is_ascii_digit()));
    let rooms = [room("viewshed5rooms"), room("viewshed..rooms..")].into_iter().flatten().next();
    rooms.is_some_and(|rest| OF_A_FRAME.iter().any(|name| rest.starts_with(name)))
}

/// Runs an image in a folder with its job in it, and gives the blocks of its frames that ran.
///
/// # Errors
/// No emulator, or a log without blocks.
pub fn run(image: &Path, folder: &Path) -> Result<Vec<Block>> {
    let mut child = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-kernel"])
        .arg(image)
        .args(["-display", "none", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-d", "exec,nochain,in_asm", "-D", "/dev/stdout"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot run qemu-system-arm; on Debian and Ubuntu: apt-get install qemu-system-arm")?;
    let log = std::io::BufReader::with_capacity(1 << 20, child.stdout.take().context("no output")?);
    let blocks = read(log);
    let status = child.wait()?;
    let blocks = blocks?;
    if !status.success() || blocks.is_empty() {
        bail!("the emulator ended with {status} after {} blocks of its frames", blocks.len());
    }
    Ok(blocks)
}

/// Reads a log.
///
/// # Errors
/// What reading says.
pub fn read(mut log: impl BufRead) -> Result<Vec<Block>> {
    let mut blocks: HashMap<u32, Block> = HashMap::new();
    let mut line = Vec::new();
    // the block that is being listed, the one that ran last, and whether a frame is worked on
    let (mut listed, mut last, mut at_work) = (None, None, false);
    loop {
        line.clear();
        if log.read_until(b'\n', &mut line)? == 0 {
            return Ok(blocks.into_values().filter(|block| block.times > 0).collect());
        }
        let text = String::from_utf8_lossy(&line);
        if text.starts_with("IN:") {
            listed = None;
        } else if let Some((address, function)) = executed(&text) {
            if let Some(before) = last.take().and_then(|start| blocks.get_mut(&start)) {
                before.jumped += u64::from(before.end() != Some(address));
            }
            if !ANYBODYS.iter().any(|part| function.contains(part)) {
                at_work = is_of_a_frame(function);
            }
            if let (true, Some(block)) = (at_work, blocks.get_mut(&address)) {
                block.times += 1;
                last = Some(address);
            }
        } else if let Some(instruction) = instruction(&text) {
            let start = *listed.get_or_insert(instruction.address);
            let new = || Block { instructions: Vec::new(), times: 0, jumped: 0 };
            let block = blocks.entry(start).or_insert_with(new);
            // listed again: the emulator had forgotten it
            if instruction.address == start {
                block.instructions.clear();
            }
            block.instructions.push(instruction);
        }
    }
}

/// `Trace 0: 0x7fdce8000100 [00800408/000000c0/00000110/ff000200] Reset`
fn executed(line: &str) -> Option<(u32, &str)> {
    let (_, rest) = line.strip_prefix("Trace")?.split_once('[')?;
    let (states, function) = rest.split_once(']')?;
    Some((u32::from_str_radix(states.split('/').nth(1)?, 16).ok()?, function.trim()))
}

/// `0x000000c0:  f009 f86b  bl       #0x919a`
fn instruction(line: &str) -> Option<Instruction> {
    let (address, rest) = line.strip_prefix("0x")?.split_once(':')?;
    let address = u32::from_str_radix(address, 16).ok()?;
    let mut words = rest.split_whitespace();
    let first = u32::from_str_radix(words.next()?, 16).ok()?;
    // Thumb: what begins with 11101, 11110 or 11111 has two halfwords
    let bytes = if first >= 0xE800 { words.next().map(|_| 4)? } else { 2 };
    let mnemonic = words.next()?.to_owned();
    Some(Instruction { address, bytes, mnemonic, operands: words.collect::<Vec<_>>().join(" ") })
}

#[cfg(test)]
mod tests {
    use super::{is_of_a_frame, read};

    const LOG: &str = "\
----------------
IN: Reset
0x000000c0:  f009 f86b  bl       #0x919a

Trace 0: 0x7fdce8000100 [00800408/000000c0/00000110/ff000200] Reset
----------------
IN: _ZN8viewshed5rooms4grid7raycast4cast17h0E
0x0000919a:  4281       cmp      r1, r0
0x0000919c:  d001       beq      #0x91a2

Trace 0: 0x7fdce8000240 [00800408/0000919a/00000110/ff000200] _ZN8viewshed5rooms4grid7raycast4cast17h0E
----------------
IN: __aeabi_memcpy
0x0000919e:  b580       push     {r7, lr}

Trace 0: 0x7fdce8000500 [00800408/0000919e/00000110/ff000200] __aeabi_memcpy
Trace 0: 0x7fdce8000240 [00800408/0000919a/00000110/ff000200] _ZN8viewshed5rooms4grid7raycast4cast17h0E
Trace 0: 0x7fdce8000100 [00800408/000000c0/00000110/ff000200] Reset
Trace 0: 0x7fdce8000500 [00800408/0000919e/00000110/ff000200] __aeabi_memcpy
";

    #[test]
    fn functions_of_a_frame_are_told_by_their_names() {
        for name in [
            "_ZN8viewshed5rooms4grid7raycast4cast17h0E",
            "_ZN103_$LT$viewshed..rooms..radar_3d..Radar3d$LT$_$GT$$u20$as$u20$viewshed..rooms..estimator..Estimator$GT$7process17h0E",
            "_ZN8viewshed5rooms4unit17Unit$LT$E$C$S$GT$5frame17h0E",
        ] {
            assert!(is_of_a_frame(name), "{name}");
        }
        for name in [
            "Reset",
            "_ZN8viewshed5bench3run3run17h0E",
            "_ZN8viewshed5rooms4unit5build17h0E",
            "_ZN4libm4math4sqrt5sqrtf17h0E",
        ] {
            assert!(!is_of_a_frame(name), "{name}");
        }
    }

    #[test]
    fn blocks_of_a_frame_are_counted_and_what_they_call() {
        let mut blocks = read(LOG.as_bytes()).unwrap();
        blocks.sort_by_key(|block| block.instructions[0].address);
        let [compared, copied] = &blocks[..] else { panic!("{blocks:?}") };
        // once on to what follows, once away
        assert_eq!((compared.times, compared.jumped, compared.instructions.len()), (2, 1, 2));
        assert_eq!((compared.instructions[1].bytes, compared.instructions[1].mnemonic.as_str()), (2, "beq"));
        assert_eq!(copied.times, 1, "not the one that others call");
        assert_eq!(copied.instructions[0].operands, "{r7, lr}");
    }
}
