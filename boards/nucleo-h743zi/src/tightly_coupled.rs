//! Code and state where the core reaches them without waiting: the estimator in the instruction memory, the map in the data memory.
//!
//! `regions.x` says which functions and statics lie there, by their names. The start-up code of `cortex-m-rt` does not know
//! these memories, so that they are filled here.

use core::ptr;

unsafe extern "C" {
    static mut _itcm_start: u32;
    static _itcm_end: u32;
    static _itcm_stored: u32;
    static mut _dtcm_start: u32;
    static _dtcm_end: u32;
}

/// Before anything else: nothing that lies there may have been called or looked at.
pub fn fill() {
    let bytes = |from: *const u32, to: *const u32| to.addr().saturating_sub(from.addr());
    // SAFETY: the linker's symbols bound memory that holds nothing yet, and in flash what belongs there; both begin at
    // multiples of 4. Volatile: the functions that lie there are no objects the compiler knows of
    unsafe {
        let code = &raw mut _itcm_start;
        for k in 0..bytes(code, &raw const _itcm_end) / 4 {
            code.add(k).write_volatile(ptr::read_volatile((&raw const _itcm_stored).add(k)));
        }
        let state = &raw mut _dtcm_start;
        for k in 0..bytes(state, &raw const _dtcm_end) / 4 {
            state.add(k).write_volatile(0);
        }
    }
    // what was written is fetched from now on
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
