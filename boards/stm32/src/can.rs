//! An FDCAN controller in classic mode, received from its interrupt.
//!
//! embassy sets the controller up and takes frames out of its memory. Going on the bus, silent or not, and
//! coming back after a bus-off is done here, as embassy's driver is in one mode for good.
//!
//! # References
//! ST, "STM32H742, STM32H743/753 and STM32H750 Value line" (RM0433) and "STM32G4 series" (RM0440) reference
//! manuals, FDCAN: CCCR, PSR, TXBRP, TXBCR. Register names and bits are those of `stm32-metapac`, not
//! verified against the manuals' pages.

use core::cell::RefCell;
use core::num::{NonZeroU8, NonZeroU16};
use core::task::Poll;

use critical_section::Mutex;
use embassy_futures::poll_once;
use embassy_stm32::can::config::{FdCanConfig, GlobalFilter, NominalBitTiming, TxBufferMode};
use embassy_stm32::can::{CanConfigurator, CanRx, CanTx, OperatingMode, frame};
use embassy_stm32::pac::can::Fdcan;
use viewshed::board::{BitTiming, CanPort, FrameQueue};
use viewshed::{CanFrame, Time};

use crate::now;

/// Looks at a register that follows within a few of the controller's clocks.
const PATIENCE: u32 = 100_000;
/// Transmit buffers of embassy's layout of the message memory.
const MAILBOXES: u32 = 0b111;

/// Frames between the interrupt and the loop: a scan of an ARS408 goes on while the map of the one before
/// is made, at most four classic frames a millisecond.
pub type Queue<const N: usize> = Mutex<RefCell<FrameQueue<N>>>;

/// An empty queue.
pub const fn queue<const N: usize>() -> Queue<N> {
    Mutex::new(RefCell::new(FrameQueue::new()))
}

/// The half that receives, for a task in the interrupt's executor.
pub struct Receiver {
    can: CanRx<'static>,
    registers: Fdcan,
}

impl Receiver {
    /// Moves frames into the queue for ever.
    pub async fn run<const N: usize>(mut self, queue: &Queue<N>) -> ! {
        loop {
            let envelope = self.can.read().await;
            let came = now();
            let lost = self.registers.ir().read().rfl(0);
            if lost {
                // only ones clear a flag, so the others stay
                self.registers.ir().write(|w| w.set_rfl(0, true));
            }
            critical_section::with(|cs| {
                let mut queue = queue.borrow_ref_mut(cs);
                if lost {
                    queue.count_lost();
                }
                // errors on the bus are the controller's to count, remote frames carry nothing
                if let Some(frame) = envelope.ok().and_then(|e| CanFrame::from_embedded(&e.frame)) {
                    queue.push(&frame, came);
                }
            });
        }
    }
}

/// The half that sends and keeps the mode.
pub struct Port<const N: usize> {
    can: CanTx<'static>,
    registers: Fdcan,
    queue: &'static Queue<N>,
    /// Without a divider for its bit rate a controller stays off the bus.
    usable: bool,
    arrived: Option<Time>,
}

/// Sets a controller up. It listens until the port is started.
pub fn open<const N: usize>(
    mut configurator: CanConfigurator<'static>,
    registers: Fdcan,
    timing: Option<BitTiming>,
    queue: &'static Queue<N>,
) -> (Receiver, Port<N>) {
    let nominal = timing.and_then(nominal);
    let filter =
        GlobalFilter::default().set_reject_remote_standard_frames(true).set_reject_remote_extended_frames(true);
    configurator.set_config(
        FdCanConfig::default()
            .set_nominal_bit_timing(nominal.unwrap_or_default())
            .set_global_filter(filter)
            // maps are sent in order
            .set_tx_buffer_mode(TxBufferMode::Fifo)
            // the library decides when, and counts
            .set_automatic_bus_off_recovery(false),
    );
    let (can, receiver, _) = configurator.start(OperatingMode::BusMonitoringMode).split();
    let usable = nominal.is_some();
    if !usable {
        defmt::warn!("no divider meets the bit rate of a bus: it stays off");
    }
    (Receiver { can: receiver, registers }, Port { can, registers, queue, usable, arrived: None })
}

fn nominal(timing: BitTiming) -> Option<NominalBitTiming> {
    Some(NominalBitTiming {
        prescaler: NonZeroU16::new(timing.prescaler).filter(|p| p.get() <= 512)?,
        seg1: u8::try_from(timing.segment_1).ok().and_then(NonZeroU8::new)?,
        seg2: NonZeroU8::new(timing.segment_2)?,
        sync_jump_width: NonZeroU8::new(timing.jump_width)?,
    })
}

impl<const N: usize> Port<N> {
    /// Leaves the bus and opens the registers of the mode; what the mailboxes hold is gone then.
    fn leave(&mut self) {
        self.registers.cccr().modify(|w| w.set_init(true));
        for _ in 0..PATIENCE {
            if self.registers.cccr().read().init() {
                break;
            }
        }
        self.registers.cccr().modify(|w| w.set_cce(true));
    }
}

impl<const N: usize> CanPort for Port<N> {
    fn receive(&mut self) -> Option<CanFrame> {
        let (frame, came) = critical_section::with(|cs| self.queue.borrow_ref_mut(cs).pop())?;
        self.arrived = Some(came);
        Some(frame)
    }

    fn arrived(&self) -> Option<Time> {
        self.arrived
    }

    fn send(&mut self, frame: &CanFrame) -> bool {
        let Some(frame) = frame.to_embedded::<frame::Frame>().filter(|_| self.usable) else { return false };
        // ready at once where a mailbox is free, and nothing is written otherwise
        matches!(poll_once(self.can.write(&frame)), Poll::Ready(None))
    }

    fn abort(&mut self) {
        self.registers.txbcr().write(|w| w.0 = MAILBOXES);
    }

    fn bus_off(&mut self) -> bool {
        // the controller leaves by itself; on its way back it still calls itself off
        self.registers.psr().read().bo() && self.registers.cccr().read().init()
    }

    fn start(&mut self, silent: bool) {
        self.leave();
        if !self.usable {
            return;
        }
        self.registers.cccr().modify(|w| w.set_mon(silent));
        self.registers.cccr().modify(|w| w.set_cce(false));
        self.registers.cccr().modify(|w| w.set_init(false));
    }

    fn waiting(&mut self) -> usize {
        (self.registers.txbrp().read().0 & MAILBOXES).count_ones() as usize
    }

    fn take_lost(&mut self) -> u32 {
        critical_section::with(|cs| self.queue.borrow_ref_mut(cs).take_lost())
    }
}
