//! A unit on one CAN bus with its radar, its integrator and the time.
//!
//! # Model
//! On the road time is the controller's. In a test bench it comes over the bus: a frame with the identifier
//! [`TIME_ID`] and eight bytes, microseconds, big-endian, before the frames it is for.

use crate::estimator::Estimator;
use crate::fixed::time::Time;
use crate::inputs::Feed;
use crate::unit::can_bus::{BusKeeper, CanPort};
use crate::unit::can_service::CanService;
use crate::unit::settings::SettingsSlots;
use crate::unit::{Flow, MapSender, Unit};
use crate::wire::frame::{CanFrame, CanId};
use crate::wire::status::Status;

/// Identifier of the time.
pub const TIME_ID: CanId = CanId::Standard(0x0F0);

/// The loop between a bus and a unit.
#[derive(Debug)]
pub struct CanBench<F> {
    radar: F,
    now: Time,
}

impl<F: Feed<Piece = CanFrame>> CanBench<F> {
    /// Before the first frame.
    pub const fn new(radar: F) -> Self {
        Self { radar, now: Time::from_micros(0) }
    }

    /// The time that came last.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Starts the clock: no unit starts before the time came. Whether a frame brought it now.
    pub fn clock(&mut self, keeper: &mut BusKeeper, port: &mut impl CanPort) -> bool {
        let came = keeper.receive(port).as_ref().and_then(time);
        self.now = came.unwrap_or(self.now);
        came.is_some()
    }

    /// One turn of the loop: at most one frame in, all that is due out.
    pub fn turn<E: Estimator<Input = F::Input>, S: MapSender<E::Map>>(
        &mut self,
        (keeper, port): (&mut BusKeeper, &mut impl CanPort),
        service: &mut CanService,
        unit: &mut Option<Unit<'_, E, S>>,
        slots: &mut impl SettingsSlots,
    ) -> Flow {
        keeper.poll(self.now, port);
        if let Some(frame) = keeper.receive(port) {
            match service.take(&frame, slots) {
                Some(Flow::Restart) => return Flow::Restart,
                Some(Flow::Continue) => {}
                None => self.take(&frame, unit.as_mut()),
            }
        }
        // nothing is taken from a unit that cannot be sent
        while keeper.is_active() {
            let answer = service.next_frame(self.now, slots);
            let frame = answer.or_else(|| match unit {
                Some(unit) => unit.next_frame(self.now),
                None => service.next_status(self.now, Status::starting(0)),
            });
            if !frame.is_some_and(|frame| keeper.send(&frame, port)) {
                break;
            }
        }
        Flow::Continue
    }

    fn take<E, S>(&mut self, frame: &CanFrame, unit: Option<&mut Unit<'_, E, S>>)
    where
        E: Estimator<Input = F::Input>,
        S: MapSender<E::Map>,
    {
        let came = time(frame);
        self.now = came.unwrap_or(self.now);
        match (came, unit) {
            (Some(now), Some(unit)) => unit.wait(&mut self.radar, now),
            (None, Some(unit)) => unit.take(&mut self.radar, frame, self.now),
            (_, None) => {}
        }
    }
}

/// The time a frame brings.
fn time(frame: &CanFrame) -> Option<Time> {
    let micros = <[u8; 8]>::try_from(frame.data()).ok().filter(|_| frame.id == TIME_ID)?;
    Some(Time::from_micros(u64::from_be_bytes(micros)))
}
