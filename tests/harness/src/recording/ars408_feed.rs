//! The library's decoder of ARS408 messages, given the lines of a log.

use std::borrow::Cow;

use viewshed::fixed::time::Time;
use viewshed::inputs::RadarScan;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome};
use viewshed::wire::frame::CanFrame;

use super::can_log::Line;

/// A decoder that is given a bus.
pub struct Feed<const N: usize> {
    pub radar: Box<Ars408<N>>,
    end: u64,
}

impl<const N: usize> Feed<N> {
    pub fn new(config: Ars408Config) -> Self {
        Self { radar: Box::new(Ars408::new(config)), end: 0 }
    }

    /// Takes a line; `scan` is given every scan that comes of it.
    pub fn push(&mut self, line: &Line, scan: &mut dyn FnMut(&RadarScan<'_>)) {
        let Some(frame) = classic(line) else { return };
        let micros = u64::try_from(line.time_ns / 1000).unwrap_or(0);
        let now = Time::from_micros(micros);
        let mut give = |outcome: Ars408Outcome<'_>| {
            if let Ars408Outcome::Scan(s) = outcome {
                scan(&s);
            }
        };
        // what timed out before this frame came
        self.radar.poll(now).map(&mut give);
        give(self.radar.push(&frame, now));
        self.radar.poll(now).map(&mut give);
        self.end = micros;
    }

    /// There is no more; `scan` is given the last scan.
    pub fn end(&mut self, scan: &mut dyn FnMut(&RadarScan<'_>)) {
        if let Some(Ars408Outcome::Scan(s)) = self.radar.poll(Time::from_micros(self.end.saturating_add(10_000_000))) {
            scan(&s);
        }
    }
}

/// A line's frame. One of a radar that a gateway or an adapter marks as CAN FD is the classic one that the radar sent.
pub fn classic(line: &Line) -> Option<Cow<'_, CanFrame>> {
    let frame = line.frame()?;
    if frame.fd && is_classic(frame) && Message::of(frame.id).is_some() {
        return CanFrame::classic(frame.id, frame.data()).map(Cow::Owned);
    }
    Some(Cow::Borrowed(frame))
}

/// Whether a frame is a classic one, also where it is marked as CAN FD.
pub fn is_classic(frame: &CanFrame) -> bool {
    !frame.fd || frame.data().len() <= 8
}
