//! A receiver beside a board's bus, and whether what it shows is what was sent.

use std::collections::VecDeque;

use viewshed::estimator::Estimator;
use viewshed::fixed::time::Time;
use viewshed::map::polar::PolarMap;
use viewshed::unit::profile::reference::State;
use viewshed::unit::{MapSender, Unit};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::code::ray::Ray;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Epoch, Plane};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::scan_number::ScanNumber;

/// The sensor's number on the bus, and where its messages are.
pub const SENSOR: u8 = 0;
pub const MEDIUM: Medium = Medium::Can(Addresses::STANDARD);

const AZIMUTHS: usize = State::AZIMUTHS;
const WORDS: usize = State::WORDS;
const LIMITS: ReceiverLimits = ReceiverLimits::DEFAULT;
const AGE_AND_DELAY_US: u64 = 400_000;

/// Age at which a sender sends no map any more.
const STALE_US: u64 = 100_000;

/// A map a unit of the reference grid sent.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    pub measured: Time,
    pub epoch: Epoch,
    pub rays: Vec<Ray<WORDS>>,
}

impl Map {
    /// The map that a unit offered to its sender last in this epoch; `None` if it offered none.
    pub fn offered<E, S, const R: usize, const A: usize>(unit: &mut Unit<'_, E, S>, epoch: Epoch) -> Option<Self>
    where
        E: Estimator<Map = PolarMap<R, A>>,
        S: MapSender<PolarMap<R, A>>,
    {
        let deadline = unit.broadcast().deadline()?;
        let measured = Time::from_micros(deadline.micros().checked_sub(STALE_US)?);
        let rays = (0..A).map(|a| unit.map().ray(Plane::Visibility, a)).collect();
        Some(Self { measured, epoch, rays })
    }
}

/// A receiver, and what was sent to it.
pub struct Listener {
    receiver: Box<Receiver<1, AZIMUTHS, WORDS>>,
    sent: VecDeque<Map>,
    /// What each azimuth showed last.
    newest: Vec<Option<(Epoch, Time)>>,
}

/// What a receiver shows at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Look {
    pub azimuths: usize,
    pub visible_cells: u32,
    /// Every cell is that of the map sent last.
    pub equal: bool,
}

impl Default for Listener {
    fn default() -> Self {
        Self { receiver: Self::deaf(), sent: VecDeque::new(), newest: vec![None; AZIMUTHS] }
    }
}

impl Listener {
    fn deaf() -> Box<Receiver<1, AZIMUTHS, WORDS>> {
        let addresses = match MEDIUM {
            Medium::Can(addresses) | Medium::CanFd(addresses) => addresses,
            Medium::Serial => Addresses::STANDARD,
        };
        Box::new(Receiver::new([SENSOR], addresses, LIMITS))
    }

    /// The receiver loses its power.
    pub fn restart(&mut self) {
        self.receiver = Self::deaf();
        self.newest.fill(None);
    }

    /// The unit sends a map.
    pub fn sent(&mut self, map: &Map) {
        self.sent.push_back(map.clone());
        if self.sent.len() > 100 {
            self.sent.pop_front();
        }
    }

    /// A frame arrives.
    pub fn frame(&mut self, now: Time, frame: &CanFrame) {
        // what is refused is counted there
        let _ = self.receiver.frame(now, frame);
    }

    /// A message of a serial line arrives.
    pub fn message(&mut self, now: Time, message: &[u8]) {
        let _ = self.receiver.message(now, message);
    }

    pub fn receiver(&self) -> &Receiver<1, AZIMUTHS, WORDS> {
        &self.receiver
    }

    /// What it shows, and whether it may: visible is only what the sender's map of the scan that is shown
    /// had visible, measured at most A + D ago and not before what was shown already.
    ///
    /// # Errors
    /// It may not: why.
    pub fn look(&mut self, now: Time) -> Result<Look, String> {
        let map = self.receiver.map(SENSOR, now);
        let epoch = self.receiver.sensor(SENSOR).and_then(|s| s.epoch());
        let last = self.sent.back();
        let mut look = Look { equal: last.is_some(), ..Look::default() };
        for azimuth in 0..AZIMUTHS {
            let ray = map.ray(Plane::Visibility, azimuth);
            look.equal &= last.is_some_and(|last| last.rays.get(azimuth) == Some(&ray));
            let Some((scan, epoch)) = map.scan(azimuth).zip(epoch) else { continue };
            look.azimuths += 1;
            look.visible_cells += ray.bits().count();
            let is_it = |map: &&Map| map.epoch == epoch && ScanNumber::at(map.measured) == scan;
            let Some(sent) = self.sent.iter().rev().find(is_it) else {
                return Err(format!("azimuth {azimuth} shows {scan:?} of {epoch:?}, which was not sent lately"));
            };
            let age = now.since(sent.measured).unwrap_or(u64::MAX);
            if age > AGE_AND_DELAY_US {
                return Err(format!("azimuth {azimuth} is {age} us old"));
            }
            if sent.rays.get(azimuth).is_none_or(|sent| ray.bits().and(sent.bits()) != *ray.bits()) {
                return Err(format!("azimuth {azimuth} is shown visible where it was not at {:?}", sent.measured));
            }
            let before = self.newest.get(azimuth).copied().flatten().filter(|(e, _)| *e == epoch);
            if let Some((_, newest)) = before.filter(|(_, newest)| sent.measured < *newest) {
                return Err(format!("azimuth {azimuth} went back from {newest:?} to {:?}", sent.measured));
            }
            self.newest[azimuth] = Some((epoch, sent.measured));
        }
        Ok(look)
    }
}
