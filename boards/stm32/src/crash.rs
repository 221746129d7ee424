//! A panic or a fault ends in a reset that the status then tells of.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

/// Not cleared at the start; a board places it where no cache holds it back.
#[unsafe(link_section = ".crash")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

const CRASHED: u32 = 0xC4A5_4EED;

/// Whether the last run ended in a crash. Asked once, and true at random when power comes.
pub fn take() -> bool {
    let mark = (&raw mut MARK).cast::<u32>();
    // SAFETY: a word of memory that only this function, at the start, and `mark` touch
    unsafe {
        let crashed = read_volatile(mark) == CRASHED;
        write_volatile(mark, 0);
        crashed
    }
}

fn reset() -> ! {
    // SAFETY: as above; whatever ran before does not go on
    unsafe { write_volatile((&raw mut MARK).cast::<u32>(), CRASHED) };
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if let Some(place) = info.location() {
        defmt::error!("panic in {=str}, line {=u32}", place.file(), place.line());
    }
    reset()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}", frame.pc());
    reset()
}
