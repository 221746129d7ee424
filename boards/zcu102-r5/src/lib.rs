//! What the Cortex-R5F of a Zynq UltraScale+ has, as QEMU's `xlnx-zcu102` emulates it.
//!
//! The only unsafe code of this board is here: start-up, the stack's limits and the panic handler.
#![no_std]

pub mod can;
pub mod semihost;
pub mod stack;
mod start;

#[cfg(not(feature = "small"))]
pub use viewshed::profile::reference as profile;
#[cfg(feature = "small")]
pub use viewshed::profile::small as profile;

/// What the bench wants to know of this core, whose instructions the emulator cannot count.
pub struct Core;

impl viewshed::pil::files::Core for Core {
    fn ticks(&mut self) -> u32 {
        0
    }

    fn ticks_per_256(&self) -> u32 {
        0
    }

    fn stack(&self) -> [u32; 2] {
        stack::used()
    }
}

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
