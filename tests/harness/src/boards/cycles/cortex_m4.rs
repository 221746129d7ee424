//! Cycles of blocks on a Cortex-M4.
//!
//! # References
//! Arm, "Cortex-M4 Technical Reference Manual" (DDI 0439), tables 3-1 and 7-1. P, the refill of the pipeline, is 1 to 3; a division
//! takes 2 to 12; a load takes 1 behind another access and 2 otherwise. An instruction behind IT counts whether or not its condition held.
//!
//! The most has the flash without any cache as well: a wait for each 8 bytes of code, and for the target of each jump.

use super::Range;
use super::trace::{Block, Instruction};

/// Cycles of all times a block ran. `wait_states` are the flash's at the core's clock.
pub fn cycles(block: &Block, wait_states: u32) -> Range {
    let mut once = Range::default();
    let mut behind_access = false;
    for instruction in &block.instructions {
        once += one(instruction, behind_access);
        behind_access = is_access(&instruction.mnemonic);
    }
    let bytes: u32 = block.instructions.iter().map(|i| i.bytes).sum();
    once += Range { least: 0.0, most: f64::from(wait_states) * f64::from(bytes) / 8.0 };
    let mut all = once.times(block.times as f64);
    all += Range { least: 1.0, most: 3.0 + f64::from(wait_states) }.times(block.jumped as f64);
    all
}

fn is_access(mnemonic: &str) -> bool {
    ["ldr", "str", "vldr", "vstr"].iter().any(|start| mnemonic.starts_with(start))
}

/// One instruction; the refill behind a jump is counted where it happens.
fn one(instruction: &Instruction, behind_access: bool) -> Range {
    let Instruction { mnemonic, operands, .. } = instruction;
    let starts = |starts: &[&str]| starts.iter().any(|start| mnemonic.starts_with(start));
    if starts(&["ldrd", "strd"]) {
        Range::of(3.0)
    } else if starts(&["ldm", "stm", "push", "pop", "vpush", "vpop", "vldm", "vstm"]) {
        Range::of(1.0 + registers(operands))
    } else if is_access(mnemonic) {
        Range { least: if behind_access || mnemonic.starts_with("str") { 1.0 } else { 2.0 }, most: 2.0 }
    } else if starts(&["udiv", "sdiv"]) {
        Range { least: 2.0, most: 12.0 }
    } else if starts(&["vdiv", "vsqrt"]) {
        Range::of(14.0)
    } else if starts(&["vmla", "vmls", "vfma", "vfms", "vnmla", "vnmls", "vfnma", "vfnms"]) {
        Range::of(3.0)
    } else if starts(&["tbb", "tbh"]) {
        Range::of(2.0)
    } else if matches!(mnemonic.as_str(), "it" | "itt" | "ite" | "ittt" | "itte" | "itet" | "itee")
        || starts(&["itt", "ite"])
    {
        // folded into the one before where that has two bytes
        Range { least: 0.0, most: 1.0 }
    } else {
        Range::of(1.0)
    }
}

/// Words that a list of registers has.
fn registers(operands: &str) -> f64 {
    let list = operands.split_once('{').map_or("", |(_, list)| list);
    let words = |name: &str| if name.trim().starts_with('d') { 2 } else { 1 };
    f64::from(list.split(',').map(words).sum::<u32>())
}

#[cfg(test)]
mod tests {
    use super::super::trace::{Block, Instruction};
    use super::cycles;

    fn block(lines: &[(&str, &str)], times: u64, jumped: u64) -> Block {
        let instruction = |(mnemonic, operands): &(&str, &str)| Instruction {
            address: 0,
            bytes: 2,
            mnemonic: (*mnemonic).to_owned(),
            operands: (*operands).to_owned(),
        };
        Block { instructions: lines.iter().map(instruction).collect(), times, jumped }
    }

    #[test]
    fn cycles_are_those_of_arms_table() {
        let range = |lines: &[(&str, &str)]| {
            let cycles = cycles(&block(lines, 1, 0), 0);
            (cycles.least, cycles.most)
        };
        assert_eq!(
            range(&[("adds", "r0, r1, r2"), ("mla", "r0, r1, r2, r3"), ("umull", "r0, r1, r2, r3")]),
            (3.0, 3.0)
        );
        assert_eq!(range(&[("ldr", "r0, [r1]"), ("ldrb", "r0, [r1]"), ("str.w", "r0, [r1]")]), (4.0, 6.0));
        assert_eq!(range(&[("push", "{r4, r5, r7, lr}")]), (5.0, 5.0));
        assert_eq!(range(&[("vpop", "{d8, d9}")]), (5.0, 5.0));
        assert_eq!(range(&[("sdiv", "r0, r1, r2"), ("vdiv.f32", "s0, s1, s2")]), (16.0, 26.0));
        assert_eq!(range(&[("vmla.f32", "s0, s1, s2"), ("vmul.f32", "s0, s1, s2")]), (4.0, 4.0));
        assert_eq!(range(&[("ldrd", "r0, r1, [r2]"), ("itte", "eq"), ("tbb", "[pc, r0]")]), (5.0, 6.0));
    }

    #[test]
    fn jumps_refill_the_pipeline_and_wait_for_the_flash() {
        let looped = block(&[("subs", "r0, #1"), ("bne", "#0x10")], 10, 9);
        let cached = cycles(&looped, 0);
        assert_eq!((cached.least, cached.most), (29.0, 47.0));
        // 4 bytes of 8 that come at once, and 9 targets
        assert_eq!(cycles(&looped, 4).most, 47.0 + 10.0 * 2.0 + 9.0 * 4.0);
        assert_eq!(cycles(&looped, 4).least, cached.least);
    }
}
