//! Buffers DMA controllers read and write, in the region a board keeps for them.

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// Received bytes: 88 ms of them at 115 200 baud.
pub const RECEIVE: usize = 1024;
/// Bytes sent in one go.
pub const SEND: usize = 256;

/// Both directions of the serial line.
pub struct Buffers {
    /// Received.
    pub receive: [u8; RECEIVE],
    /// To be sent.
    pub send: [u8; SEND],
}

/// The start does not clear this region.
#[unsafe(link_section = ".dma")]
static mut SERIAL: MaybeUninit<Buffers> = MaybeUninit::uninit();
static TAKEN: AtomicBool = AtomicBool::new(false);

/// The serial line's buffers; `None` the second time.
pub fn take() -> Option<&'static mut Buffers> {
    if TAKEN.swap(true, Ordering::AcqRel) {
        return None;
    }
    // SAFETY: handed out once, filled before it is used
    unsafe { (*(&raw mut SERIAL)).write(Buffers { receive: [0; RECEIVE], send: [0; SEND] }) }.into()
}
