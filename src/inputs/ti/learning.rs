//! Which family it is, from what frames have in common.

use super::family::{FrameHeader, ITEM_HEADER, LONGEST, PADDING, TiFamily};

/// Frames in a row that have to be consistent.
const ENOUGH: u8 = 3;

/// Follows a stream as each family would read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Learning {
    readings: [Trial; TiFamily::ALL.len()],
}

/// A frame as one family reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Trial {
    header: Option<FrameHeader>,
    /// Where the next item begins.
    next: u32,
    items_left: u32,
    /// Consistent frames in a row.
    consistent: u8,
}

impl Learning {
    pub(super) const NEW: Self =
        Self { readings: [Trial { header: None, next: 0, items_left: 0, consistent: 0 }; TiFamily::ALL.len()] };

    /// Takes a byte of a frame: its position counted from the magic word, one for the first byte;
    /// `window` has the eight bytes up to it, `head` the frame's first ones.
    pub(super) fn take(&mut self, position: u32, window: u64, head: &[u8; LONGEST]) {
        for (family, reading) in TiFamily::ALL.into_iter().zip(&mut self.readings) {
            reading.take(family, position, window, head);
        }
    }

    /// The frame ended at a magic word after so many bytes. The family, if it is certain now.
    pub(super) fn end(&mut self, length: u32) -> Option<TiFamily> {
        for (family, reading) in TiFamily::ALL.into_iter().zip(&mut self.readings) {
            reading.end(family, length);
        }
        let mut certain =
            TiFamily::ALL.into_iter().zip(&self.readings).filter(|(_, r)| r.consistent >= ENOUGH).map(|(f, _)| f);
        // two that fit equally well are none
        certain.next().filter(|_| certain.next().is_none())
    }
}

impl Trial {
    #[allow(clippy::cast_possible_truncation)] // the upper half of the window
    fn take(&mut self, family: TiFamily, position: u32, window: u64, head: &[u8; LONGEST]) {
        if position == family.header() {
            self.header = family.read(head);
            self.next = position;
            self.items_left = self.header.map_or(0, |h| h.items);
        } else if position > family.header() && self.items_left > 0 && position == self.next + ITEM_HEADER {
            let length = (window >> 32) as u32;
            match family.payload(length).map(|payload| position + payload) {
                Some(end) if self.header.is_some_and(|h| end <= h.total) => {
                    self.next = end;
                    self.items_left -= 1;
                }
                _ => self.header = None,
            }
        }
    }

    fn end(&mut self, family: TiFamily, length: u32) {
        let items = self.header.map_or(0, |h| h.items);
        let filled = self.header.is_some_and(|h| {
            length > family.header().saturating_sub(1)
                && h.total == length
                && self.items_left == 0
                && length.checked_sub(self.next).is_some_and(|rest| rest < PADDING)
        });
        self.consistent = match (filled, items) {
            // a frame without items fits all headers of one layout
            (true, 0) => self.consistent,
            (true, _) => self.consistent.saturating_add(1),
            (false, _) => 0,
        };
        (self.header, self.next, self.items_left) = (None, 0, 0);
    }
}
