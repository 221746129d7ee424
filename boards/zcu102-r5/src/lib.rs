//! What the Cortex-R5F of a Zynq UltraScale+ has, as QEMU's `xlnx-zcu102` emulates it.
//!
//! The only unsafe code of this board is here: start-up, the stack's limits and the panic handler.
#![no_std]

pub mod can;
pub mod profile;
pub mod semihost;
pub mod stack;
mod start;

/// A panic that could happen anywhere in the image makes this symbol needed, and nobody has it: the
/// image does not link.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe extern "C" {
        fn this_image_can_panic() -> !;
    }
    // SAFETY: never linked
    unsafe { this_image_can_panic() }
}
