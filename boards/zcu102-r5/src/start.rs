//! From reset to `main`: floating point on, stack painted, variables cleared.

use core::arch::global_asm;

/// What the unused stack is painted with.
pub const PAINT: u32 = 0xCCCC_CCCC;

global_asm!(
    r#"
    .section .text.start, "ax"
    .global _start
    .arm
    .fpu vfpv3-d16
_start:
    mrc p15, 0, r0, c1, c0, 2      @ CPACR: coprocessors 10 and 11, the floating-point unit
    orr r0, r0, #0x00f00000
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000            @ FPEXC.EN
    vmsr fpexc, r0
    ldr sp, =__stack_start
    mov r2, #0
    ldr r0, =__bss_start
    ldr r1, =__bss_end
    bl 2f
    ldr r0, =__bench_start
    ldr r1, =__bench_end
    bl 2f
    ldr r2, ={paint}
    ldr r0, =__stack_end
    mov r1, sp
    bl 2f
    bl main
1:  wfi
    b 1b
2:  cmp r0, r1                     @ fills r0 .. r1 with r2
    strlo r2, [r0], #4
    blo 2b
    bx lr
"#,
    paint = const PAINT,
);
