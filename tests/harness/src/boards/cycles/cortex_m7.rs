//! Cycles of blocks on a Cortex-M7, by `llvm-mca` and its model of that core.
//!
//! At least: a block as if it ran again and again, so that it overlaps with itself. At most: as if nothing overlapped with what runs
//! before and behind it. Neither knows of caches.
//!
//! # References
//! LLVM, "llvm-mca - LLVM Machine Code Analyzer"; `llvm/lib/Target/ARM/ARMScheduleM7.td`.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use super::Range;
use super::trace::{Block, Instruction};

const REPEATED: u32 = 100;

/// Cycles of all times each block ran, in their order.
///
/// # Errors
/// No `llvm-mca`, or one that does not understand an instruction.
pub fn cycles(blocks: &[Block]) -> Result<Vec<Range>> {
    let mut text = String::from(".syntax unified\n.thumb\n");
    for (number, block) in blocks.iter().enumerate() {
        let _ = writeln!(text, "@ LLVM-MCA-BEGIN {number}");
        text.push_str(&assembly(&block.instructions));
        text.push_str("@ LLVM-MCA-END\n");
    }
    let alone = analyse(&text, 1)?;
    let again = analyse(&text, REPEATED)?;
    if [alone.len(), again.len()] != [blocks.len(); 2] {
        bail!("llvm-mca tells of {} and {} of {} blocks", alone.len(), again.len(), blocks.len());
    }
    let ranges = blocks.iter().zip(alone).zip(again).map(|((block, alone), again)| {
        let again = again / f64::from(REPEATED);
        Range { least: again.min(alone), most: alone.max(again) }.times(block.times as f64)
    });
    Ok(ranges.collect())
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Answer {
    code_regions: Vec<Region>,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Region {
    summary_view: Summary,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Summary {
    total_cycles: f64,
}

fn analyse(text: &str, iterations: u32) -> Result<Vec<f64>> {
    let mut child = Command::new("llvm-mca")
        .args(["-mtriple=thumbv7em-none-eabihf", "-mcpu=cortex-m7", "-json"])
        .arg(format!("-iterations={iterations}"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("cannot run llvm-mca; on Debian and Ubuntu: apt-get install llvm")?;
    let mut input = child.stdin.take().context("no input")?;
    let text = text.to_owned();
    let writer = std::thread::spawn(move || input.write_all(text.as_bytes()));
    let output = child.wait_with_output()?;
    writer.join().map_err(|_| anyhow::anyhow!("cannot write to llvm-mca"))??;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).lines().take(3).collect::<Vec<_>>().join("; ");
        bail!("llvm-mca failed: {said}");
    }
    let answer: Answer = serde_json::from_slice(&output.stdout).context("llvm-mca's answer")?;
    Ok(answer.code_regions.into_iter().map(|region| region.summary_view.total_cycles).collect())
}

/// What `llvm-mca` takes: targets of jumps within reach, calls as jumps (it takes a call for 100 cycles), and no conditions,
/// as a block may begin or end within what stands behind an IT.
fn assembly(instructions: &[Instruction]) -> String {
    let mut text = String::new();
    // what an IT is for: its condition or the opposite one, for so many instructions
    let (mut conditions, mut left) = (Vec::new(), 0);
    for Instruction { mnemonic, operands, .. } in instructions {
        if mnemonic.starts_with("it") {
            (conditions, left) = ([operands.as_str(), opposite(operands)].to_vec(), mnemonic.len() - 1);
            continue;
        }
        let (name, kind) =
            mnemonic.split_once('.').map_or((mnemonic.as_str(), None), |(name, kind)| (name, Some(kind)));
        let conditional = conditions.iter().filter(|_| left > 0).find_map(|condition| name.strip_suffix(condition));
        let name = conditional.unwrap_or(name);
        left = left.saturating_sub(1);
        let kind = kind.map_or_else(String::new, |kind| format!(".{kind}"));
        let _ = match name {
            "cbz" | "cbnz" => {
                let register = operands.split(',').next().unwrap_or_default();
                writeln!(text, "{name} {register}, #4")
            }
            "bl" => writeln!(text, "b #4"),
            "blx" => writeln!(text, "bx {operands}"),
            // the model has no comparison with zero
            _ if name.starts_with("vcmp") && operands.ends_with("#0") => {
                let register = operands.split(',').next().unwrap_or_default();
                writeln!(text, "{name}{kind} {register}, {register}")
            }
            // of 16 bits, so that each condition reaches
            _ if operands.starts_with("#0x") && name.starts_with('b') && !name.starts_with("bk") => {
                writeln!(text, "{name} #4")
            }
            _ => writeln!(text, "{name}{kind} {operands}"),
        };
    }
    text
}

fn opposite(condition: &str) -> &'static str {
    const PAIRS: [[&str; 2]; 7] =
        [["eq", "ne"], ["hs", "lo"], ["mi", "pl"], ["vs", "vc"], ["hi", "ls"], ["ge", "lt"], ["gt", "le"]];
    let pair = PAIRS.iter().find(|pair| pair.contains(&condition));
    pair.map_or("al", |[a, b]| if *a == condition { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::super::trace::Instruction;
    use super::assembly;

    #[test]
    fn what_llvm_would_not_take_is_rewritten() {
        let lines = [
            ("ite", "hi"),
            ("addhi", "r0, #1"),
            ("addls.w", "r0, #2"),
            ("lsls", "r1, r4, #14"),
            ("vmov.f32", "s0, s1"),
            ("bl", "#0x919a"),
            ("cbz", "r2, #0x94da"),
            ("bne.w", "#0x10"),
            ("vcmp.f32", "s2, #0"),
            ("bic", "r0, r0, #1"),
        ];
        let instruction = |(mnemonic, operands): (&str, &str)| Instruction {
            address: 0,
            bytes: 2,
            mnemonic: mnemonic.to_owned(),
            operands: operands.to_owned(),
        };
        let text = assembly(&lines.map(instruction));
        assert_eq!(
            text,
            "add r0, #1\nadd.w r0, #2\nlsls r1, r4, #14\nvmov.f32 s0, s1\nb #4\ncbz r2, #4\nbne #4\nvcmp.f32 s2, s2\nbic r0, r0, #1\n"
        );
    }
}
