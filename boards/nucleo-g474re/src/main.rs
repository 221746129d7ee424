//! An ARS408 on FDCAN1, maps out on FDCAN2 and on the serial line of the debug probe. Not run on hardware.
//!
//! | what | where | taken from |
//! |---|---|---|
//! | HSE | 24 MHz crystal | Zephyr, `boards/st/nucleo_g474re/nucleo_g474re.dts`, `clk_hse` |
//! | core | PLL: 24 MHz / 6 x 85 / 2 = 170 MHz; AHB, APB / 1 | the same, `pll`, `rcc` |
//! | FDCAN | HSE, 24 MHz | the same, `fdcan1` |
//! | random numbers | HSI48 | the same, `clk_hsi48`, `rng` |
//! | FDCAN1, radar | receive PA11, transmit PA12 | the same, `fdcan1` |
//! | FDCAN2, broadcast | receive PB12, transmit PB13 | pins of the part: Zephyr's `hal_stm32`, `dts/st/g4/stm32g474r(b-c-e)tx-pinctrl.dtsi`; on the board right morpho connector 16 and 30: `boards/st/nucleo_g474re/st_morpho_connector.dtsi` |
//! | serial line | LPUART1, transmit PA2, receive PA3, 115 200 baud | `nucleo_g474re.dts`, `lpuart1` |
//! | status output | LD2, PA5, high is on | the same, `green_led` |
//! | watchdog | IWDG | the same, `iwdg` |
//! | settings, heights | last four pages of 2 kB, in Zephyr's `storage_partition` | the same, `flash0`; page and word: `stm32-metapac` |
//!
//! Zephyr as of commit 19a6a69e3473, `hal_stm32` as of 161c4b2a1b86. Not verified against ST's manual of the
//! board (UM2505): solder bridges. Both buses need a transceiver. PB5 and PB6, the other pins of
//! FDCAN2, are left alone: PB6 is CC1 of a USB-C port as well (`stm32-metapac`). The flash is to have two banks
//! (option bit DBANK): embassy stops otherwise.
#![no_std]
#![no_main]

use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{DMA1_CH1, DMA1_CH2, FDCAN1, FDCAN2, LPUART1, RNG};
use embassy_stm32::rcc::{Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, can, dma, flash, pac, rng};
use stm32::can::open;
use stm32::crash;
use stm32::unit::{REQUESTS, Wiring, run};
use viewshed::board::{CycleCounter, FlashSlots, ResetFlags, RoadsideStart, StoredSettings, UnitConfig};
use viewshed::small::supervised::{Ars408, CHECK};
use viewshed::{Ars408Config, Epoch};

const CAN_CLOCK_HZ: u32 = 24_000_000;
/// Frames of the radar between interrupt and loop: 30 ms of a full bus.
const FRAMES: usize = 128;
/// The slots of settings and heights, from the beginning of the flash.
const SLOTS: [u32; 4] = [0x7_F000, 0x7_F800, 0x7_E000, 0x7_E800];
/// Several frames.
const WATCHDOG_US: u32 = 1_000_000;

stm32::memory!(small, Sender, FRAMES);

bind_interrupts!(struct Irqs {
    FDCAN1_IT0 => can::IT0InterruptHandler<FDCAN1>;
    FDCAN1_IT1 => can::IT1InterruptHandler<FDCAN1>;
    FDCAN2_IT0 => can::IT0InterruptHandler<FDCAN2>;
    FDCAN2_IT1 => can::IT1InterruptHandler<FDCAN2>;
    LPUART1 => usart::InterruptHandler<LPUART1>;
    DMA1_CHANNEL1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<DMA1_CH2>;
    RNG => rng::InterruptHandler<RNG>;
});

fn config() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz(24_000_000), mode: HseMode::Oscillator });
    rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    rcc.sys = Sysclk::PLL1_R;
    // above 150 MHz
    rcc.boost = true;
    rcc.mux.fdcansel = mux::Fdcansel::HSE;
    config
}

/// Asked once: the flags are cleared.
fn reset_flags(crash: bool) -> ResetFlags {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    ResetFlags {
        // this part has one flag for both
        power_on: flags.borrstf(),
        brown_out: false,
        watchdog: flags.iwdgrstf() || flags.wwdgrstf(),
        software: flags.sftrstf(),
        crash,
        pin: flags.pinrstf(),
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(config());
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let mut watchdog = IndependentWatchdog::new(p.IWDG, WATCHDOG_US);
    watchdog.unleash();
    let last = crash::last();
    let flags = reset_flags(last.crashed);
    defmt::info!("reset: {}", flags);

    let faulty = last.faulty(flags);
    let slots = FlashSlots::new(flash::Flash::new_blocking(p.FLASH), SLOTS, |slot| crash::readable(faulty, slot));
    crash::read_done();
    let stored = StoredSettings::read(&slots, CHECK.on_can(CAN_CLOCK_HZ));
    let [radar_timing, broadcast_timing] = stored.buses().map(|bus| bus.timing(CAN_CLOCK_HZ));
    let can = can::CanConfigurator::new(p.FDCAN1, p.PA11, p.PA12, Irqs);
    let (radar_receiver, radar) = open(can, pac::FDCAN1, radar_timing, &RADAR_QUEUE);
    let can = can::CanConfigurator::new(p.FDCAN2, p.PB12, p.PB13, Irqs);
    let broadcast = open(can, pac::FDCAN2, broadcast_timing, &REQUESTS);

    let mut line = usart::Config::default();
    line.baudrate = UnitConfig::SERVICE_BAUD;
    let line = Uart::new(p.LPUART1, p.PA3, p.PA2, p.DMA1_CH1, p.DMA1_CH2, Irqs, line).expect("a baud rate it has");
    let epoch = Epoch::new(rng::Rng::new(p.RNG, Irqs).next_u32() as u8);
    let identity = stm32::identity("nucleo-g474re", [100, 96]);
    let cycles = Some(CycleCounter { count: DWT::cycle_count, hz: 170_000_000 });
    let start = RoadsideStart { identity, epoch, stored, reset_cause: flags.into(), cycles };
    let wiring = Wiring { radar, broadcast, line, slots, light: Output::new(p.PA5, Level::Low, Speed::Low), watchdog };
    let scans = scans(radar_receiver).expect("room for one");
    run(start, memory(), move || Ars408::new(Ars408Config::sensor(stored.unit().radar_id)), scans, wiring).await
}
