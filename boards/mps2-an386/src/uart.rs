//! The CMSDK UARTs, polled.
//!
//! # References
//! Arm, "Cortex-M System Design Kit Technical Reference Manual" (DDI 0479), APB UART; base addresses:
//! "Application Note AN386", memory map.

use viewshed::unit::transmitter::BytePort;

use crate::Register;

/// Looks at a transmitter that takes no byte before its line is stalled: longer than any emulator pauses.
pub const PATIENCE: u32 = 40_000_000;

/// A UART with its transmitter and receiver on.
#[derive(Clone, Copy)]
pub struct Uart {
    data: Register,
    state: Register,
}

impl Uart {
    /// UART 0, 1 or 2.
    pub fn start(number: usize) -> Self {
        let base = 0x4000_4000 + 0x1000 * (number & 3);
        // the emulator ignores the divider, which has to be 16 at least
        Register(base + 0x10).write(16);
        Register(base + 8).write(3);
        Self { data: Register(base), state: Register(base + 4) }
    }

    /// A byte, if one came.
    pub fn read(&self) -> Option<u8> {
        (self.state.read() & 2 != 0).then(|| self.data.read() as u8)
    }
}

impl BytePort for Uart {
    fn put(&mut self, byte: u8) -> bool {
        let room = self.state.read() & 1 == 0;
        if room {
            self.data.write(u32::from(byte));
        }
        room
    }
}
