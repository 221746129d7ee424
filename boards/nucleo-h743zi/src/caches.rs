//! Caches on, but not for what others than the core read and write.
//!
//! Without them the core waits for AXI SRAM and flash at each access. DMA controllers do not see the data
//! cache, so their region is not cached; neither are the slots of stored blocks, which are erased without its knowledge.
//!
//! # References
//! Arm, "ARMv7-M Architecture Reference Manual" (DDI 0403), B3.5: MPU_RBAR, MPU_RASR, MPU_CTRL.

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::{CPUID, MPU, SCB};

use crate::{FLASH_BASE, SLOTS_BYTES, SLOTS_FROM};

/// Not executed, read and written, normal memory that is not cached.
const NOT_CACHED: u32 = 1 << 28 | 0b011 << 24 | 0b001 << 19;
const ENABLE: u32 = 1;
/// What no region names stays as it is without a memory protection unit.
const BACKGROUND: u32 = 1 << 2;

unsafe extern "C" {
    static _dma_start: u32;
    static _dma_bytes: u32;
}

/// Before the first DMA transfer.
pub fn enable(mpu: &mut MPU, scb: &mut SCB, cpuid: &mut CPUID) {
    let dma = ((&raw const _dma_start).addr(), (&raw const _dma_bytes).addr());
    let slots = ((FLASH_BASE + SLOTS_FROM) as usize, SLOTS_BYTES as usize);
    for (number, (start, bytes)) in (0..).zip([dma, slots]) {
        // a power of two, at a multiple of itself
        let size = bytes.trailing_zeros() - 1;
        // SAFETY: the regions hold data only, and nothing of them is cached yet
        unsafe {
            mpu.rnr.write(number);
            mpu.rbar.write(start as u32);
            mpu.rasr.write(NOT_CACHED | size << 1 | ENABLE);
        }
    }
    // SAFETY: as above
    unsafe { mpu.ctrl.write(BACKGROUND | ENABLE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    compiler_fence(Ordering::SeqCst);
    scb.enable_icache();
    scb.enable_dcache(cpuid);
}
