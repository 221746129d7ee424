//! The unit between the drivers: what it shares with the tasks, and its loop.

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{Uart, UartTx};
use embassy_stm32::wdg::{IndependentWatchdog, Instance};
use embassy_time::Timer;
use embedded_hal::digital::OutputPin;
use viewshed::{
    CanFrame, CanPort, Feed, Flow, InUnit, MapSender, Roadside, RoadsidePorts, SettingsSlots, StatusOutput,
};

use crate::can::{Queue, Receiver, queue};
use crate::dma::SEND;
use crate::now;
use crate::serial::{Line, Out, send};

/// Frames of the broadcast bus between interrupt and loop, where an integrator asks one thing a millisecond.
pub static REQUESTS: Queue<32> = queue();

static OUT: Out = Out::new();
static INTERRUPTS: InterruptExecutor = InterruptExecutor::new();

/// Of a peripheral that is not used: the tasks run in it, whatever the loop does.
#[interrupt]
unsafe fn UART5() {
    // SAFETY: called from this interrupt only
    unsafe { INTERRUPTS.on_interrupt() }
}

#[embassy_executor::task]
async fn requests(receiver: Receiver) -> ! {
    receiver.run(&REQUESTS).await
}

#[embassy_executor::task]
async fn transmit(transmitter: UartTx<'static, Async>, buffer: &'static mut [u8; SEND]) -> ! {
    send(transmitter, &OUT, buffer).await
}

/// Starts the tasks of the broadcast bus and the serial line; the line, and where a board starts the task of its
/// radar's bus.
pub fn start(broadcast: Receiver, line: Uart<'static, Async>) -> (Line, SendSpawner) {
    let (transmitter, receiver) = line.split();
    let buffers = crate::dma::take().expect("taken once");
    let serial = Line::new(receiver.into_ring_buffered(&mut buffers.receive), &OUT);
    interrupt::UART5.set_priority(Priority::P6);
    let spawner = INTERRUPTS.start(interrupt::UART5);
    spawner.spawn(requests(broadcast).expect("room for one"));
    spawner.spawn(transmit(transmitter, &mut buffers.send).expect("room for one"));
    (serial, spawner)
}

/// Runs the unit, and resets the controller where an integrator asks for it. Borrowed, as a future keeps what it is
/// given several times.
pub async fn run<E, S, F, R, B, P, O, W>(
    unit: &mut Roadside<'static, E, S, F>,
    ports: &mut RoadsidePorts<R, B, Line, P>,
    light: O,
    mut watchdog: IndependentWatchdog<'static, W>,
) -> !
where
    E: InUnit,
    S: MapSender<E::Map>,
    F: Feed<Piece = CanFrame, Input = E::Input>,
    R: CanPort,
    B: CanPort,
    P: SettingsSlots,
    O: OutputPin,
    W: Instance,
{
    let mut light = StatusOutput::new(light);
    let mut shown = None;
    loop {
        let step = unit.step(now(), ports);
        let _ = light.show(step.state, now());
        if shown.replace(step.state) != Some(step.state) {
            defmt::info!("{}", step.state);
        }
        if step.frame_done {
            watchdog.pet();
        }
        if step.flow == Flow::Restart {
            cortex_m::peripheral::SCB::sys_reset();
        }
        Timer::after_micros(500).await;
    }
}
