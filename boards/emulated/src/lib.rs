//! What the emulated boards share: the emulator's files, the batch program, and that nothing panics.
//!
//! Not a board; has no registers or regions.
#![no_std]

mod batch;
pub mod semihost;

pub use {semihosting, static_cell, viewshed};

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
