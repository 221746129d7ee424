//! Units on a CAN bus.

use std::time::Instant;

use anyhow::Result;
use viewshed::unit::can_service::{Answers, Tool};
use viewshed::unit::reply::Said;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Received};

use super::link::{Ask, Link, Noise};

/// A CAN bus: an interface of this machine, or one of an emulator.
pub trait CanBus {
    /// Sends a frame.
    ///
    /// # Errors
    /// The bus takes none.
    fn send(&mut self, frame: &CanFrame) -> Result<()>;

    /// The next frame until then.
    ///
    /// # Errors
    /// The bus is gone.
    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>>;
}

/// The line.
pub struct CanLink<B> {
    bus: B,
    place: String,
    medium: Medium,
    addresses: Addresses,
    /// Tools and what is heard, by sensor.
    units: Vec<(Tool, Answers)>,
    only: Option<u8>,
    noise: Noise,
}

impl<B: CanBus> CanLink<B> {
    /// On classic CAN or CAN FD, with identifiers from 0x400 on.
    pub fn new(bus: B, name: &str, fd: bool) -> Self {
        let addresses = Addresses::STANDARD;
        let medium = if fd { Medium::CanFd(addresses) } else { Medium::Can(addresses) };
        let sensors = 0..=addresses.most_sensor();
        let units = sensors.map(|sensor| (Tool::new(sensor, medium), Answers::new(sensor, medium))).collect();
        Self { bus, place: name.to_owned(), medium, addresses, units, only: None, noise: Noise::default() }
    }
}

impl<B: CanBus> Link for CanLink<B> {
    fn place(&self) -> &str {
        &self.place
    }

    fn pieces(&self) -> &'static str {
        "frames"
    }

    fn to(&mut self, sensor: Option<u8>) {
        self.only = sensor;
        // half an answer to what was asked before is of no use
        for (sensor, (_, answers)) in (0..).zip(&mut self.units) {
            *answers = Answers::new(sensor, self.medium);
        }
    }

    fn ask(&mut self, what: Ask<'_>) -> Result<()> {
        for (sensor, (tool, _)) in (0..).zip(&mut self.units) {
            if self.only.is_some_and(|only| only != sensor) {
                continue;
            }
            let frames: Vec<CanFrame> = match what {
                Ask::Identify => tool.identify().into_iter().collect(),
                Ask::Address(chip) => tool.address(chip).into_iter().collect(),
                Ask::Read(which) | Ask::ReadPart(which, _) => tool.read(which).into_iter().collect(),
                Ask::Write(block) => tool.write(block).collect(),
                Ask::Again(block, part) => tool.again(block, part).collect(),
                Ask::Restart => tool.restart().into_iter().collect(),
                Ask::Clear(kind) => tool.clear(kind).into_iter().collect(),
                // on the serial line only
                Ask::Part(..) | Ask::Timing => Vec::new(),
            };
            for frame in &frames {
                self.bus.send(frame)?;
                // a unit takes one request a millisecond
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
        }
        Ok(())
    }

    fn hear(&mut self, until: Instant) -> Result<Option<Said>> {
        while let Some(frame) = self.bus.receive(until)? {
            self.noise.pieces += 1;
            let Ok(received) = Received::from_frame(&frame, &self.addresses) else { continue };
            *self.noise.sensors.entry(received.sensor).or_default() += 1;
            if self.only.is_some_and(|only| only != received.sensor) {
                continue;
            }
            let answers = self.units.get_mut(usize::from(received.sensor)).map(|(_, answers)| answers);
            if let Some(said) = answers.and_then(|answers| answers.take(&frame)) {
                return Ok(Some(said));
            }
        }
        Ok(None)
    }

    fn noise(&self) -> &Noise {
        &self.noise
    }

    fn is_bus(&self) -> bool {
        true
    }

    fn restarted(&mut self, _: bool) -> Result<()> {
        Ok(())
    }

    fn next_rate(&mut self) -> Result<bool> {
        Ok(false)
    }
}
