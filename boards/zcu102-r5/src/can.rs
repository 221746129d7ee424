//! The CAN controllers of the Zynq UltraScale+, polled.
//!
//! # References
//! AMD, "Zynq UltraScale+ Device Technical Reference Manual" (UG1085) and register reference (UG1087), CAN.

use viewshed::unit::can_bus::{BitTiming, CanPort};
use viewshed::wire::frame::{CanFrame, CanId};

const RESET: usize = 0x00;
const MODE: usize = 0x04;
const PRESCALER: usize = 0x08;
const TIMING: usize = 0x0C;
const STATUS: usize = 0x18;
const INTERRUPTS: usize = 0x1C;
const CLEAR: usize = 0x24;
const SEND: usize = 0x30;
const RECEIVE: usize = 0x50;
/// A frame waits in the receive queue.
const NOT_EMPTY: u32 = 1 << 7;
/// The controller went bus-off.
const BUS_OFF: u32 = 1 << 9;
/// The transmit queue is full.
const FULL: u32 = 1 << 10;
/// Frames sent in a row at most: half of the far controller's queue.
const ROW: u32 = 16;
/// Looks at the far controller's queue before a frame is given up.
const PATIENCE: u32 = 500_000_000;

/// A controller, and in the emulator the one at the far end of its bus: sending into its full queue would end
/// the emulator.
pub struct Can {
    base: usize,
    far: usize,
    timing: BitTiming,
    sent: u32,
}

impl Can {
    /// CAN 0, with CAN 1 at the far end.
    pub fn new(timing: BitTiming) -> Self {
        Self { base: 0xFF06_0000, far: 0xFF07_0000, timing, sent: 0 }
    }

    fn read(&self, register: usize) -> u32 {
        // SAFETY: registers of this controller, readable at any time
        unsafe { core::ptr::read_volatile((self.base + register) as *const u32) }
    }

    fn write(&mut self, register: usize, value: u32) {
        // SAFETY: as above; one core, no interrupts
        unsafe { core::ptr::write_volatile((self.base + register) as *mut u32, value) }
    }

    /// Whether the far controller's queue has been emptied.
    fn far_is_empty(&self) -> bool {
        // SAFETY: a register of the far controller, which the emulated core sees as well
        unsafe { core::ptr::read_volatile((self.far + INTERRUPTS) as *const u32) & NOT_EMPTY == 0 }
    }
}

impl CanPort for Can {
    fn receive(&mut self) -> Option<CanFrame> {
        if self.read(INTERRUPTS) & NOT_EMPTY == 0 {
            return None;
        }
        let id = self.read(RECEIVE);
        let length = (self.read(RECEIVE + 4) >> 28).min(8) as usize;
        let (first, second) = (self.read(RECEIVE + 8).to_be_bytes(), self.read(RECEIVE + 12).to_be_bytes());
        self.write(CLEAR, NOT_EMPTY);
        let mut data = [0; 8];
        data.iter_mut().zip(first.iter().chain(&second)).for_each(|(to, from)| *to = *from);
        // extended identifiers are nobody's here
        let id = if id & 1 << 19 == 0 { CanId::standard((id >> 21) as u16)? } else { return None };
        CanFrame::classic(id, data.get(..length)?)
    }

    fn send(&mut self, frame: &CanFrame) -> bool {
        let CanId::Standard(id) = frame.id else { return false };
        if self.read(STATUS) & FULL != 0 {
            return false;
        }
        if self.sent % ROW == 0 {
            let mut looks = 0;
            while !self.far_is_empty() {
                looks += 1;
                if looks > PATIENCE {
                    return false;
                }
            }
        }
        self.sent = self.sent.wrapping_add(1);
        let mut words = [0_u32; 2];
        for (k, byte) in frame.data().iter().take(8).enumerate() {
            if let Some(word) = words.get_mut(k / 4) {
                *word |= u32::from(*byte) << (24 - 8 * (k % 4));
            }
        }
        self.write(SEND, u32::from(id) << 21);
        self.write(SEND + 4, (frame.data().len() as u32) << 28);
        self.write(SEND + 8, words[0]);
        self.write(SEND + 12, words[1]);
        true
    }

    fn abort(&mut self) {
        // the queue is emptied by a reset only; the start that follows brings it back
        self.write(RESET, 1);
    }

    fn bus_off(&mut self) -> bool {
        let off = self.read(INTERRUPTS) & BUS_OFF != 0;
        if off {
            self.write(CLEAR, BUS_OFF);
        }
        off
    }

    fn start(&mut self, silent: bool) {
        self.write(RESET, 0);
        self.write(PRESCALER, u32::from(self.timing.prescaler).saturating_sub(1));
        let t = self.timing;
        let bits = u32::from(t.jump_width).saturating_sub(1) << 7
            | u32::from(t.segment_2).saturating_sub(1) << 4
            | u32::from(t.segment_1).saturating_sub(1);
        self.write(TIMING, bits);
        // snooping is listening without acknowledging
        self.write(MODE, if silent { 1 << 2 } else { 0 });
        self.write(RESET, 1 << 1);
    }
}
