//! A USART on DMA: a ring that receives, a pipe that a task sends from.

use core::task::Poll;

use embassy_futures::poll_once;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{RingBufferedUartRx, UartTx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use viewshed::board::{SerialLine, SerialPort, UnitConfig};

use crate::dma::SEND;

/// Bytes that wait to be sent: a refresh of the map with header and status.
pub const WAITING: usize = 2048;

/// Between the loop and the task that sends.
pub type Out = Pipe<CriticalSectionRawMutex, WAITING>;

/// The line as the loop sees it.
pub struct Line {
    receiver: RingBufferedUartRx<'static>,
    out: &'static Out,
}

impl Line {
    /// Puts both directions together.
    pub fn new(receiver: RingBufferedUartRx<'static>, out: &'static Out) -> Self {
        Self { receiver, out }
    }
}

impl SerialLine for Line {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.out.free_capacity() >= bytes.len() && self.out.try_write(bytes) == Ok(bytes.len())
    }
}

impl SerialPort for Line {
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        match poll_once(self.receiver.read(buffer)) {
            Poll::Ready(Ok(came)) => came,
            // noise and overruns cost bytes, which the messages' check sums notice; the next read goes on
            Poll::Ready(Err(_)) | Poll::Pending => 0,
        }
    }

    fn set_baud(&mut self, baud: u32) {
        // both directions have one divider; a refused rate leaves the part switched off
        if self.receiver.set_baudrate(baud).is_err() {
            let _ = self.receiver.set_baudrate(UnitConfig::SERVICE_BAUD);
        }
    }
}

/// Sends for ever what the loop puts into the pipe, by way of a buffer DMA reaches.
pub async fn send(mut transmitter: UartTx<'static, Async>, out: &'static Out, buffer: &'static mut [u8; SEND]) -> ! {
    loop {
        let length = out.read(buffer).await;
        if let Some(bytes) = buffer.get(..length) {
            let _ = transmitter.write(bytes).await;
        }
    }
}
