//! How much of the stack was ever used: what is no longer painted.

use crate::start::PAINT;

unsafe extern "C" {
    static __stack_start: u32;
    static __stack_end: u32;
}

/// Most bytes used so far, and how many there are.
pub fn used() -> [u32; 2] {
    let (top, end) = ((&raw const __stack_start).addr(), (&raw const __stack_end).addr());
    // SAFETY: words between the linker's limits of the stack
    let painted = |at: &usize| unsafe { core::ptr::read_volatile(*at as *const u32) } == PAINT;
    let lowest = (end..top).step_by(4).find(|at| !painted(at)).unwrap_or(top);
    [(top - lowest) as u32, (top - end) as u32]
}
