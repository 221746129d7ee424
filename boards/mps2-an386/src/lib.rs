//! What the MPS2 board with a Cortex-M4F has, as QEMU's `mps2-an386` emulates it.
//!
//! The only unsafe code of this board is here: registers, the stack's limits and the panic handler.
#![no_std]

mod interrupts;
pub mod semihost;
pub mod stack;
pub mod timer;
pub mod uart;

#[cfg(not(feature = "small"))]
pub use viewshed::profile::reference as profile;
#[cfg(feature = "small")]
pub use viewshed::profile::small as profile;

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

/// What the bench wants to know of this core.
pub struct Core(timer::Timer);

impl Core {
    /// Starts its counter.
    pub fn start() -> Self {
        Self(timer::Timer::start())
    }
}

impl viewshed::pil::files::Core for Core {
    fn ticks(&mut self) -> u32 {
        self.0.ticks()
    }

    fn ticks_per_256(&self) -> u32 {
        timer::TICKS_PER_256
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
