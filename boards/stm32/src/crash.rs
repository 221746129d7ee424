//! A panic or a fault ends in a reset that the status then reports.
//!
//! Flash memory that lost its power while it was written faults when it is read. So that the start does not
//! end there for ever, what is being read is remembered over the reset.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

/// Whether it crashed, and the slot that was being read. Not cleared at the start; a board places it where no
/// cache holds it back.
#[unsafe(link_section = ".crash")]
static mut MARKS: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

const CRASHED: u32 = 0xC4A5_4EED;
/// A slot's number is added.
const READING: u32 = 0x5107_0000;

fn read(mark: usize) -> u32 {
    // SAFETY: one of two words that this file alone touches; any value is one
    unsafe { read_volatile((&raw const MARKS).cast::<u32>().add(mark & 1)) }
}

fn write(mark: usize, value: u32) {
    // SAFETY: as above
    unsafe { write_volatile((&raw mut MARKS).cast::<u32>().add(mark & 1), value) }
}

/// How the last run ended; true or false at random when power comes.
#[derive(Debug, Clone, Copy)]
pub struct Last {
    /// In a panic or a fault.
    pub crashed: bool,
    reading: u32,
}

/// Asked once, at the start.
pub fn last() -> Last {
    let last = Last { crashed: read(0) == CRASHED, reading: read(1) };
    write(0, 0);
    write(1, 0);
    last
}

impl Last {
    /// Whether a slot can be read: not if the last run crashed in it. To be followed by [`read_done`].
    pub fn readable(&self, slot: usize) -> bool {
        let reading = READING + slot as u32;
        write(1, reading);
        !(self.crashed && self.reading == reading)
    }
}

/// The slots are read.
pub fn read_done() {
    write(1, 0);
}

fn reset() -> ! {
    write(0, CRASHED);
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

/// The flash memory of some parts calls here where its check bits do not hold.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    defmt::error!("non-maskable interrupt");
    reset()
}
