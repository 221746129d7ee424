//! The unit between the drivers: what it shares with the tasks, and its loop.

use embassy_executor::{InterruptExecutor, SpawnToken};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{Uart, UartTx};
use embassy_stm32::wdg::{IndependentWatchdog, Instance};
use embassy_time::Timer;
use embedded_hal::digital::OutputPin;
use viewshed::board::{Flow, Roadside, RoadsideMemory, RoadsidePorts, RoadsideStart, SettingsSlots, StatusOutput};
use viewshed::{CanFrame, Feed, InUnit, MapSender};

use crate::can::{Port, Queue, Receiver, queue};
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

/// What a board has wired up.
pub struct Wiring<P, O, W: Instance + 'static, const N: usize> {
    /// The radar's bus.
    pub radar: Port<N>,
    /// The broadcast's bus, both halves.
    pub broadcast: (Receiver, Port<32>),
    /// The serial line.
    pub line: Uart<'static, Async>,
    /// Where settings are kept.
    pub slots: P,
    /// The status output.
    pub light: O,
    /// Fed with every frame.
    pub watchdog: IndependentWatchdog<'static, W>,
}

/// The large parts of a unit, in statics of a board, and its radar's receive queue.
///
/// Defines `RADAR_QUEUE`, the task `scans` that fills it, and `memory()`, to be called once. A macro, as neither
/// statics nor tasks can be generic.
#[macro_export]
macro_rules! memory {
    ($size:ident, $sender:ident, $frames:expr) => {
        static RADAR_QUEUE: $crate::can::Queue<{ $frames }> = $crate::can::queue();

        #[embassy_executor::task]
        async fn scans(receiver: $crate::can::Receiver) -> ! {
            receiver.run(&RADAR_QUEUE).await
        }

        fn memory()
        -> viewshed::board::RoadsideMemory<'static, viewshed::$size::supervised::State, viewshed::$size::$sender> {
            use static_cell::{ConstStaticCell, StaticCell};
            use viewshed::$size::supervised::{Map, Parameters, State};
            use viewshed::$size::$sender as Sender;
            static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new(viewshed::$size::State::new()));
            static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
            static PARAMETERS: ConstStaticCell<Option<Parameters>> = ConstStaticCell::new(None);
            static BROADCAST: StaticCell<Option<Sender>> = StaticCell::new();
            static SERIAL: StaticCell<Option<Sender>> = StaticCell::new();
            viewshed::board::RoadsideMemory {
                parameters: PARAMETERS.take(),
                state: STATE.take(),
                map: MAP.take(),
                broadcast: BROADCAST.init(None),
                serial: SERIAL.init(None),
            }
        }
    };
}

/// Starts the tasks and runs the unit with what `decoder` makes; resets the controller where an integrator asks
/// for it.
pub async fn run<E, S, F, P, O, W, const N: usize>(
    start: RoadsideStart,
    memory: RoadsideMemory<'static, E, S>,
    decoder: impl FnOnce() -> F,
    scans: SpawnToken<impl Send>,
    wiring: Wiring<P, O, W, N>,
) -> !
where
    E: InUnit,
    S: MapSender<E::Map>,
    F: Feed<Piece = CanFrame, Input = E::Input>,
    P: SettingsSlots,
    O: OutputPin,
    W: Instance + 'static,
{
    let Wiring { radar, broadcast: (requested, broadcast), line, slots, light, mut watchdog } = wiring;
    let (transmitter, receiver) = line.split();
    let buffers = crate::dma::take().expect("taken once");
    let serial = Line::new(receiver.into_ring_buffered(&mut buffers.receive), &OUT);
    interrupt::UART5.set_priority(Priority::P6);
    let spawner = INTERRUPTS.start(interrupt::UART5);
    spawner.spawn(requests(requested).expect("room for one"));
    spawner.spawn(transmit(transmitter, &mut buffers.send).expect("room for one"));
    spawner.spawn(scans);

    let mut ports = RoadsidePorts { radar, broadcast, serial, slots };
    let mut unit = Roadside::start(start, memory, decoder(), now(), &mut ports);
    let mut light = StatusOutput::new(light);
    let mut shown = None;
    loop {
        let step = unit.step(now(), &mut ports);
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
