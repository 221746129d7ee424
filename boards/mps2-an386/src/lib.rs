//! What the MPS2 board with a Cortex-M4F has, as QEMU's `mps2-an386` emulates it.
//!
//! The only unsafe code of this board is here: registers, the stack's limits and the panic handler.
#![no_std]

pub mod profile;
pub mod semihost;
pub mod stack;
pub mod timer;
pub mod uart;

/// A register of a peripheral.
#[derive(Clone, Copy)]
struct Register(usize);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: the addresses in this crate are registers of this board, readable at any time
        unsafe { core::ptr::read_volatile(self.0 as *const u32) }
    }

    fn write(self, value: u32) {
        // SAFETY: as above; one core, no interrupts
        unsafe { core::ptr::write_volatile(self.0 as *mut u32, value) }
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
