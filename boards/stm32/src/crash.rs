//! A panic or a fault ends in a reset that the status then reports.
//!
//! Flash memory that lost its power while it was written faults when it is read. So that the start does not
//! end there for ever, what is being read is remembered over the resets.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{read_volatile, write_volatile};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use viewshed::board::{FaultySlots, ResetFlags};

/// Whether it crashed, and which slots were being read. Not cleared at the start; a board places it where no
/// cache holds it back.
#[unsafe(link_section = ".crash")]
static mut MARKS: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

const CRASHED: u32 = 0xC4A5_4EED;

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
    read: u32,
}

/// Asked once, at the start.
pub fn last() -> Last {
    let last = Last { crashed: read(0) == CRASHED, read: read(1) };
    write(0, 0);
    read_done();
    last
}

impl Last {
    /// The slots in which it and the runs before crashed.
    pub fn faulty(&self, flags: ResetFlags) -> FaultySlots {
        FaultySlots::found(self.read, flags.into())
    }
}

/// Whether a slot can be read, which is remembered. To be followed by [`read_done`].
pub fn readable(faulty: FaultySlots, slot: usize) -> bool {
    write(1, faulty.reading(slot));
    faulty.is_readable(slot)
}

/// The slots are read.
pub fn read_done() {
    write(1, FaultySlots::NOT_READING);
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
