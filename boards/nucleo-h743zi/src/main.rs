//! An ARS408 on FDCAN1, maps out on FDCAN2 and on the serial line of the debug probe. Not run on hardware.
//!
//! | what | where | taken from |
//! |---|---|---|
//! | HSE | 8 MHz from the debug probe, bypass | Zephyr, `boards/st/nucleo_h743zi/nucleo_h743zi.dts`, `clk_hse` |
//! | core | PLL1: 8 MHz / 2 x 240 / 2 = 480 MHz; AHB / 2, APB / 2 | the same, `pll`, `rcc` |
//! | FDCAN | PLL2 Q: 8 MHz / 4 x 120 / 3 = 80 MHz | the same, `pll2`, `fdcan1` |
//! | random numbers | HSI48 | the same, `clk_hsi48`, `rng` |
//! | FDCAN1, radar | receive PD0, transmit PD1 | the same, `fdcan1` |
//! | FDCAN2, broadcast | receive PB5, transmit PB6 | pins of the part: Zephyr's `hal_stm32`, `dts/st/h7/stm32h743zitx-pinctrl.dtsi`; on the board D11 and D1: `boards/st/nucleo_h743zi/arduino_r3_connector.dtsi` |
//! | serial line | USART3, transmit PD8, receive PD9, 115 200 baud | `nucleo_h743zi.dts`, `usart3` |
//! | status output | LD1, PB0, high is on | the same, `green_led` |
//! | watchdog | IWDG1 | the same, `iwdg1` |
//! | settings, heights, lanes, table of probabilities | the eight sectors of bank 2, 128 kB each, written by 32 bytes | Zephyr, `dts/arm/st/h7/stm32h743.dtsi`, `flash0` |
//!
//! Zephyr as of commit 0225b4db0265, `hal_stm32` as of 257c26c17af3. Not verified against ST's manuals of the
//! board (UM1974 for MB1137, UM2407 for MB1364): solder bridges, and whether D1 and D11 are free of other uses
//! there; nor is whether the part's revision allows 480 MHz. Both buses need a transceiver.
#![no_std]
#![no_main]

mod caches;
mod tightly_coupled;

use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{DMA1_CH0, DMA1_CH1, FDCAN1, FDCAN2, RNG, USART3};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, can, dma, flash, pac, rng};
use stm32::can::open;
use stm32::crash;
use stm32::unit::{REQUESTS, Wiring, run};
use viewshed::board::{CycleCounter, FlashSlots, ResetFlags, RoadsideStart, SettingsCheck, StoredSettings, UnitConfig};
use viewshed::reference::QuantisedSender;
use viewshed::reference::supervised::{Ars408, State};
use viewshed::{Ars408Config, Epoch};

const CAN_CLOCK_HZ: u32 = 80_000_000;
/// Frames of the radar between interrupt and loop: 60 ms of a full bus.
const FRAMES: usize = 256;
const FLASH_BASE: u32 = 0x0800_0000;
/// The slots of settings, heights, lanes and tables, from the beginning of the flash.
const SLOTS: [u32; 8] = [0x1C_0000, 0x1E_0000, 0x10_0000, 0x12_0000, 0x14_0000, 0x16_0000, 0x18_0000, 0x1A_0000];
/// All of them, from there.
const SLOTS_FROM: u32 = 0x10_0000;
const SLOTS_BYTES: u32 = 0x10_0000;
/// More than two sectors take to be erased, in which the loop stands still: taken as 4 s each at worst, which is not
/// verified against the data sheet.
const WATCHDOG_US: u32 = 10_000_000;

stm32::memory!(reference, QuantisedSender, FRAMES);

bind_interrupts!(struct Irqs {
    FDCAN1_IT0 => can::IT0InterruptHandler<FDCAN1>;
    FDCAN1_IT1 => can::IT1InterruptHandler<FDCAN1>;
    FDCAN2_IT0 => can::IT0InterruptHandler<FDCAN2>;
    FDCAN2_IT1 => can::IT1InterruptHandler<FDCAN2>;
    USART3 => usart::InterruptHandler<USART3>;
    DMA1_STREAM0 => dma::InterruptHandler<DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    RNG => rng::InterruptHandler<RNG>;
});

fn config() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz(8_000_000), mode: HseMode::Bypass });
    let pll = Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV2,
        mul: PllMul::MUL240,
        fracn: None,
        divp: Some(PllDiv::DIV2),
        divq: None,
        divr: None,
    };
    rcc.pll1 = Some(pll);
    rcc.pll2 = Some(Pll { prediv: PllPreDiv::DIV4, mul: PllMul::MUL120, divp: None, divq: Some(PllDiv::DIV3), ..pll });
    rcc.sys = Sysclk::PLL1_P;
    rcc.voltage_scale = VoltageScale::Scale0;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    (rcc.apb1_pre, rcc.apb2_pre) = (APBPrescaler::DIV2, APBPrescaler::DIV2);
    (rcc.apb3_pre, rcc.apb4_pre) = (APBPrescaler::DIV2, APBPrescaler::DIV2);
    rcc.mux.fdcansel = mux::Fdcansel::PLL2_Q;
    config
}

/// Asked once: the flags are cleared.
fn reset_flags(crash: bool) -> ResetFlags {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    ResetFlags {
        power_on: flags.porrstf(),
        brown_out: flags.borrstf(),
        watchdog: flags.iwdg1rstf() || flags.wwdg1rstf(),
        software: flags.sftrstf(),
        crash,
        pin: flags.pinrstf(),
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    tightly_coupled::fill();
    let p = embassy_stm32::init(config());
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    caches::enable(&mut core.MPU, &mut core.SCB, &mut core.CPUID);
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let mut watchdog = IndependentWatchdog::new(p.IWDG1, WATCHDOG_US);
    watchdog.unleash();
    let last = crash::last();
    let flags = reset_flags(last.crashed);
    defmt::info!("reset: {}", flags);

    let faulty = last.faulty(flags);
    let slots = FlashSlots::new(flash::Flash::new_blocking(p.FLASH), SLOTS, |slot| crash::readable(faulty, slot));
    crash::read_done();
    let stored = StoredSettings::read(&slots, SettingsCheck::of::<State, QuantisedSender>().on_can(CAN_CLOCK_HZ));
    let [radar_timing, broadcast_timing] = stored.buses().map(|bus| bus.timing(CAN_CLOCK_HZ));
    let can = can::CanConfigurator::new(p.FDCAN1, p.PD0, p.PD1, Irqs);
    let (radar_receiver, radar) = open(can, pac::FDCAN1, radar_timing, &RADAR_QUEUE);
    let can = can::CanConfigurator::new(p.FDCAN2, p.PB5, p.PB6, Irqs);
    let broadcast = open(can, pac::FDCAN2, broadcast_timing, &REQUESTS);

    let mut line = usart::Config::default();
    line.baudrate = UnitConfig::SERVICE_BAUD;
    let line = Uart::new(p.USART3, p.PD9, p.PD8, p.DMA1_CH0, p.DMA1_CH1, Irqs, line).expect("a baud rate it has");
    let epoch = Epoch::new(rng::Rng::new(p.RNG, Irqs).next_u32() as u8);
    let identity = stm32::identity("nucleo-h743zi", [200, 128]);
    let cycles = Some(CycleCounter { count: DWT::cycle_count, hz: 480_000_000 });
    let start = RoadsideStart { identity, epoch, stored, reset_cause: flags.into(), cycles };
    let wiring = Wiring { radar, broadcast, line, slots, light: Output::new(p.PB0, Level::Low, Speed::Low), watchdog };
    let scans = scans(radar_receiver).expect("room for one");
    run(start, memory(), move || Ars408::new(Ars408Config::sensor(stored.unit().radar_id)), scans, wiring).await
}
