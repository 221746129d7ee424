//! When each epoch was heard or left.

use crate::fixed::time::Time;
use crate::wire::message::Epoch;
use crate::wire::scan_number::PERIOD_US;

/// What is remembered of an epoch without a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mark {
    None,
    /// A frame of it was heard.
    Heard,
    /// It had a session.
    Left,
}

/// Whole milliseconds at which each epoch was heard or left.
#[derive(Debug, Clone, Copy)]
pub(super) struct Epochs {
    pub(super) at_ms: [u32; 16],
    pub(super) heard: u16,
    pub(super) left: u16,
}

impl Epochs {
    pub(super) const NONE: Self = Self { at_ms: [0; 16], heard: 0, left: 0 };

    pub(super) fn mark(&mut self, epoch: Epoch, mark: Mark, now: Time) {
        let bit = 1 << epoch.number();
        (self.heard, self.left) = (self.heard & !bit, self.left & !bit);
        match mark {
            Mark::None => return,
            Mark::Heard => self.heard |= bit,
            Mark::Left => self.left |= bit,
        }
        if let Some(at) = self.at_ms.get_mut(usize::from(epoch.number())) {
            *at = milliseconds(now);
        }
    }

    pub(super) fn since_ms(&self, epoch: Epoch, now: Time) -> u32 {
        let at = self.at_ms.get(usize::from(epoch.number())).copied().unwrap_or(0);
        milliseconds(now).wrapping_sub(at)
    }

    pub(super) fn is_left(&self, epoch: Epoch) -> bool {
        self.left >> epoch.number() & 1 == 1
    }

    /// Milliseconds since an epoch was left, if that is not a period ago.
    pub(super) fn since_left(&mut self, epoch: Epoch, now: Time) -> Option<u32> {
        let since = Some(self.since_ms(epoch, now)).filter(|_| self.is_left(epoch))?;
        if since > PERIOD_US / 1000 {
            self.mark(epoch, Mark::None, now);
            return None;
        }
        Some(since)
    }

    /// Notes a frame; whether the one before it came within this time.
    pub(super) fn again(&mut self, epoch: Epoch, now: Time, within_ms: u64) -> bool {
        let again = self.heard >> epoch.number() & 1 == 1 && u64::from(self.since_ms(epoch, now)) <= within_ms;
        self.mark(epoch, Mark::Heard, now);
        again
    }
}

#[allow(clippy::cast_possible_truncation)] // modulo 49 days
fn milliseconds(now: Time) -> u32 {
    (now.micros() / 1000) as u32
}
