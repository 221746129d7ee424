//! Frames in, maps of several sensors out: the receiver, and why it can be trusted.
//!
//! # Fail-safe
//! Let `A` be the greatest age ([`ReceiverLimits::max_age_us`]) and `D` the greatest delay between measurement
//! and reception that the integrator guarantees ([`ReceiverLimits::max_delay_us`]). *When the receiver answers
//! visible, the sender's map of the same sensor, epoch and geometry, measured at most `A + D` ago, had
//! that cell visible, and no accepted frame of a newer scan says otherwise.* It holds under any loss,
//! truncation and interleaving, and under repetition and reordering displaced by less than the
//! period of the scan numbers less `D`. Why:
//!
//! - *The cell was visible in the scan the sector is marked with.* A refresh decodes alone. A delta
//!   decodes only against the refresh of exactly the scan it names, azimuth by azimuth. Words are joined
//!   only within one plane, scan and start, where a sender encodes one block; words missing end the
//!   decoding before the first ray that needs them.
//! - *The scan is the one its number says.* Numbers come again after 5.12 s. What is accepted was
//!   measured at most `2 D` before it came: the measure refuses what is later by less than half a
//!   period, the sender's clock in the header what is later by more. Sectors, refreshes and words are
//!   dropped long before 5.12 s: 400 ms and twice the greater of `A` and `D` after their scan while frames come (1 s if
//!   `A` is 300 ms, 2.4 s at most), all of them after a second without any.
//! - *The scan was measured at most `A + D` ago.* A sector is shown while its number is at most `A` (less
//!   25 ms for a tick and for drifting clocks) behind the clocks' difference as the fastest frame of
//!   the measure showed it. So it is enough that this frame took at most `D`. Suppose all frames of a measure
//!   took longer. Either they are the sender's only ones: a delay that all frames have no receiver sees, and
//!   the integrator guarantees that there is none. Or a queue drains, and each frame is faster than the one
//!   before: a measure is trusted when it is `A + D` old, and begins anew when its smallest lag has sunk by
//!   more than `D`, less 1 in 1024 of the time, which is what it crept up and what clocks drift; and it is `A + D`
//!   old only if its frames came without a pause of more than `A` meanwhile. So nothing
//!   is shown out of a queue that shortens by more than `D` in `A + D`. Or faster frames were refused, because
//!   the sender's clock had not come so far: then the header it is known by was late, too. Those that are faster
//!   by less than 1.5 s are refused only after two headers `A + D` apart and a measure that is trusted agreed,
//!   which a queue that shortens like that does not let them. A session that
//!   refused any frame waits for a second header that agrees `A + D` later; headers come every 0.5 s, so the
//!   first that was in time lies between, and after it the maps' fastest frame would be more than `D` behind
//!   the sender's clock, which is not trusted either.
//! - *The receiver's clock goes forward.* Where a frame or a look comes with a time that is more than a tick
//!   before the latest, no age is known: every session is over.
//! - *Sensor, epoch and geometry are the same.* The sensor is in the identifier or in the message, and in
//!   the protection's data ID. The second frame of a new epoch within `A + D` empties the maps, the old epoch
//!   is refused for `A + D`, and a header's groups are checked together. Senders are quiet for `A + D` after a
//!   change. Two epochs that alternate, and groups that contradict those of the same epoch, are two senders
//!   with one number: a conflict is reported and everything is unknown.
//! - *No newer frame says otherwise.* A sector takes what is newer by its number, whatever order frames
//!   come in. Frames that cannot be decoded say nothing; what they would have said stays unsaid until the
//!   sector has aged.
//!
//! Corruption passes at the check sum's residual rate. What the integrator owes: `D`, and a sender whose
//! mailboxes are aborted after its deadline. Delays within `D` of a multiple of 5.12 s no receiver sees.
//!
//! # Order
//! Words of a block may come in any order, between those of other blocks: 36 of them wait for the others, which is
//! every first word of a map before any second one.
//!
//! # Limits
//! For 128 azimuths by 200 ranges 8.5 kB a sensor, ages included.

mod assembly;
mod collector;
mod epochs;
mod map;
mod measure;
mod sectors;
#[cfg(feature = "secoc")]
mod secured;
mod sensor;
mod session;

pub use collector::{Brought, Collector};
pub use map::{ReceivedMap, Together};
pub use measure::{ENOUGH, ReceiverLimits};
#[cfg(feature = "secoc")]
pub use secured::SecuredReceiver;
pub use sensor::{Accepted, Counters, Refused, SenderCondition, SensorReceiver};

use core::cell::Cell;

use super::frame::CanFrame;
use super::message::{Addresses, NotAMessage, Received};
use crate::fixed::time::Time;

/// Frames and looks may be handed in out of order by so much, microseconds: a time stamp was taken before the
/// look that is handed in after it.
const BACK_US: u64 = 20_000;

/// Receives the maps of `N` sensors: at most `A` azimuths of `32 W` ranges, the first `P` planes.
#[derive(Debug, Clone)]
pub struct Receiver<const N: usize, const A: usize, const W: usize, const P: usize = 1> {
    addresses: Addresses,
    limits: ReceiverLimits,
    sensors: [(u8, SensorReceiver<A, W, P>); N],
    foreign: u32,
    /// The latest time handed in.
    latest: Cell<Time>,
}

impl<const N: usize, const A: usize, const W: usize, const P: usize> Receiver<N, A, W, P> {
    /// Of these sensors, and no others.
    pub fn new(sensors: [u8; N], addresses: Addresses, limits: ReceiverLimits) -> Self {
        Self {
            addresses,
            limits: limits.bounded(),
            sensors: sensors.map(|number| (number, SensorReceiver::new())),
            foreign: 0,
            latest: Cell::new(Time::from_micros(0)),
        }
    }

    /// Takes a CAN or CAN FD frame.
    ///
    /// # Errors
    /// Why it is not used.
    pub fn frame(&mut self, now: Time, frame: &CanFrame) -> Result<Accepted, Refused> {
        let label = self.addresses.message(frame.id);
        let received = label.ok_or(NotAMessage::Foreign).and_then(|label| Received::labelled(frame, label));
        self.received(now, received, label.map(|(sensor, _)| sensor))
    }

    /// Takes a message from a serial line.
    ///
    /// # Errors
    /// Why it is not used.
    pub fn message(&mut self, now: Time, bytes: &[u8]) -> Result<Accepted, Refused> {
        let sensor = bytes.get(4).copied();
        self.received(now, Received::from_bytes(bytes), sensor)
    }

    /// Takes a message that is checked already, and opened if it was secured.
    ///
    /// # Errors
    /// Why it is not used.
    pub fn checked(&mut self, now: Time, message: &Received<'_>) -> Result<Accepted, Refused> {
        self.received(now, Ok(*message), Some(message.sensor))
    }

    fn received(
        &mut self,
        now: Time,
        received: Result<Received<'_>, NotAMessage>,
        sensor: Option<u8>,
    ) -> Result<Accepted, Refused> {
        let now = self.watch(now);
        let limits = self.limits;
        let found = self.sensors.iter_mut().find(|(number, _)| Some(*number) == sensor);
        let Some((_, sensor)) = found.filter(|_| received != Err(NotAMessage::Foreign)) else {
            self.foreign = self.foreign.saturating_add(1);
            return Err(Refused::NotAMessage(NotAMessage::Foreign));
        };
        match received {
            Ok(received) => sensor.take(now, &received, &limits),
            Err(error) => Err(sensor.refuse(Refused::NotAMessage(error))),
        }
    }

    /// Follows the receiver's clock, at frames and at looks; the time to count with. A little before the latest
    /// counts as the latest. Where it steps back, nothing is shown before each sensor's next session: no age is
    /// known any more.
    fn watch(&self, now: Time) -> Time {
        let latest = self.latest.get();
        match latest.since(now) {
            Some(back) if back <= BACK_US => return latest,
            Some(_) => self.sensors.iter().for_each(|(_, sensor)| sensor.step_back()),
            None => {}
        }
        self.latest.set(now);
        now
    }

    /// Counts what is refused before it is looked at.
    #[cfg(feature = "secoc")]
    fn refuse(&mut self, sensor: u8, why: Refused) -> Refused {
        let found = self.sensors.iter_mut().find(|(number, _)| *number == sensor);
        found.map_or(why, |(_, sensor)| sensor.refuse(why))
    }

    /// Frames of nobody's, or of sensors that are not listened to.
    pub fn foreign(&self) -> u32 {
        self.foreign
    }

    /// What is known of a sensor.
    pub fn sensor(&self, number: u8) -> Option<&SensorReceiver<A, W, P>> {
        self.sensors.iter().find(|(n, _)| *n == number).map(|(_, sensor)| sensor)
    }

    /// A sensor's map as it is now; everything is unknown where it cannot be trusted.
    pub fn map(&self, number: u8, now: Time) -> ReceivedMap<'_, A, W, P> {
        let now = self.watch(now);
        ReceivedMap::new(self.sensor(number), now, self.limits)
    }

    /// All sensors' maps as they are now.
    pub fn together(&self, now: Time) -> Together<'_, N, A, W, P> {
        let now = self.watch(now);
        Together::new(self.sensors.each_ref().map(|(_, sensor)| ReceivedMap::new(Some(sensor), now, self.limits)))
    }
}
