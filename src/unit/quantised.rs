//! Who sends the maps of a unit that may have a table of probabilities.

use crate::fixed::time::Time;
use crate::map::polar::PolarMap;
use crate::probability::Quantiser;
use crate::sensor::config::ConfigError;
use crate::unit::sender::MapSender;
use crate::wire::broadcast::{BroadcastConfig, Broadcaster};
use crate::wire::frame::CanFrame;
use crate::wire::header::Header;
use crate::wire::message::Epoch;
use crate::wire::planes::Quantised;
use crate::wire::status::Status;

/// With a table, sends its bits in two planes and says so in the header; without one, the visibility plane alone, by
/// grades.
#[derive(Debug, Clone)]
pub struct QuantisedSender<const A: usize, const W: usize> {
    broadcast: Broadcaster<A, W, 2>,
    quantiser: Option<Quantiser>,
}

impl<const A: usize, const W: usize> QuantisedSender<A, W> {
    /// Starts an epoch.
    ///
    /// # Errors
    /// Names the parameter that cannot be worked with.
    pub fn new(
        config: BroadcastConfig,
        header: Header,
        quantiser: Option<Quantiser>,
        epoch: Epoch,
        now: Time,
    ) -> Result<Self, ConfigError> {
        let header = Header { probability: quantiser.as_ref().map(Quantiser::levels), ..header };
        let config = Self::config(config, quantiser.is_some());
        Ok(Self { broadcast: Broadcaster::new(config, header, epoch, now)?, quantiser })
    }

    /// With as many planes as there are.
    fn config(config: BroadcastConfig, has_table: bool) -> BroadcastConfig {
        BroadcastConfig { planes: if has_table { 2 } else { 1 }, ..config }
    }

    /// What is said of the sender.
    pub fn status_mut(&mut self) -> &mut Status {
        self.broadcast.status_mut()
    }

    /// The epoch; it goes on by itself where the clock steps back.
    pub fn epoch(&self) -> Epoch {
        self.broadcast.epoch()
    }

    /// Begins a new epoch on another clock.
    pub fn start_over(&mut self, now: Time) {
        self.broadcast.start_over(now);
    }

    /// Whether everything of the last map is handed out or dropped.
    pub fn idle(&self) -> bool {
        self.broadcast.idle()
    }
}

impl<const R: usize, const A: usize, const W: usize> MapSender<PolarMap<R, A>> for QuantisedSender<A, W> {
    const TAKES_TABLES: bool = true;

    fn fits(header: &Header) -> Result<(), ConfigError> {
        Broadcaster::<A, W, 2>::fits(header)
    }

    fn start(
        place: &mut Option<Self>,
        config: BroadcastConfig,
        header: Header,
        epoch: Epoch,
        now: Time,
    ) -> Result<(), ConfigError> {
        *place = None;
        config.check()?;
        Broadcaster::<A, W, 2>::fits(&header)?;
        let config = Self::config(config, header.probability.is_some());
        let broadcast = Broadcaster::blank(config, header, epoch, now);
        place.insert(Self { broadcast, quantiser: None }).broadcast.begin(header, now)
    }

    fn set_quantiser(&mut self, quantiser: Quantiser) {
        self.quantiser = Some(quantiser);
    }

    fn offer(&mut self, measured: Time, map: &PolarMap<R, A>) {
        // as of any sender: while the epoch is new there is none
        let _ = match &self.quantiser {
            Some(quantiser) => self.broadcast.scan(measured, &Quantised { map, quantiser }),
            None => self.broadcast.scan(measured, map),
        };
    }

    fn next_frame(&mut self, now: Time) -> Option<CanFrame> {
        self.broadcast.next_frame(now)
    }

    fn next_line(&mut self, now: Time, line: &mut [u8]) -> Option<usize> {
        self.broadcast.next_line(now, line)
    }

    fn deadline(&self) -> Option<Time> {
        self.broadcast.deadline()
    }

    fn status_mut(&mut self) -> &mut Status {
        self.broadcast.status_mut()
    }

    fn count_dropped(&mut self, messages: u16) {
        self.broadcast.count_dropped(messages);
    }

    fn take_overload(&mut self) -> bool {
        self.broadcast.take_overload()
    }
}
