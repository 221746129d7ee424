//! Classic CAN frames between an interrupt that receives them and the loop that takes them.
//!
//! # Limits
//! `N` frames. Of a full queue the new frame is lost, and counted: the scan it belongs to is then known
//! to be incomplete. 32 bytes a frame.

use heapless::Deque;

use crate::fixed::time::Time;
use crate::wire::frame::{CanFrame, CanId};

/// A classic frame in as few bytes as it needs.
#[derive(Debug, Clone, Copy)]
struct Classic {
    came: Time,
    id: CanId,
    length: u8,
    data: [u8; 8],
}

/// First in, first out. Shared with an interrupt, it lies in the board's critical section.
#[derive(Debug)]
pub struct FrameQueue<const N: usize> {
    frames: Deque<Classic, N>,
    lost: u32,
}

impl<const N: usize> Default for FrameQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> FrameQueue<N> {
    /// Empty.
    pub const fn new() -> Self {
        Self { frames: Deque::new(), lost: 0 }
    }

    /// Appends a frame that came at this time; one that does not fit, or is not classic, is lost.
    pub fn push(&mut self, frame: &CanFrame, came: Time) {
        let mut data = [0; 8];
        let length = frame.data().len();
        let kept = data.get_mut(..length).map(|to| to.copy_from_slice(frame.data()));
        let length = u8::try_from(length).unwrap_or(u8::MAX);
        let pushed = kept.and_then(|()| self.frames.push_back(Classic { came, id: frame.id, length, data }).ok());
        if pushed.is_none() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Takes the oldest frame and the time it came.
    pub fn pop(&mut self) -> Option<(CanFrame, Time)> {
        let classic = self.frames.pop_front()?;
        let frame = CanFrame::classic(classic.id, classic.data.get(..usize::from(classic.length))?)?;
        Some((frame, classic.came))
    }

    /// Counts a frame that was lost before it came here.
    pub fn count_lost(&mut self) {
        self.lost = self.lost.saturating_add(1);
    }

    /// Frames lost since the last call.
    pub fn take_lost(&mut self) -> u32 {
        core::mem::take(&mut self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(k: u8) -> (CanFrame, Time) {
        (CanFrame::classic(CanId::Standard(u16::from(k)), &[k; 3]).unwrap(), Time::from_micros(u64::from(k)))
    }

    #[test]
    fn frames_come_out_as_they_went_in_and_what_does_not_fit_is_counted() {
        let mut queue = FrameQueue::<4>::new();
        let push = |queue: &mut FrameQueue<4>, k| queue.push(&frame(k).0, frame(k).1);
        (0..6).for_each(|k| push(&mut queue, k));
        assert_eq!((queue.take_lost(), queue.take_lost()), (2, 0));
        assert_eq!(queue.pop(), Some(frame(0)));
        push(&mut queue, 9);
        let rest = std::iter::from_fn(|| queue.pop()).collect::<std::vec::Vec<_>>();
        assert_eq!(rest, [frame(1), frame(2), frame(3), frame(9)]);
    }

    #[test]
    fn a_long_frame_is_lost_not_cut() {
        let mut queue = FrameQueue::<4>::new();
        let now = Time::from_micros(1);
        queue.push(&CanFrame::fd(CanId::Standard(1), &[1; 12]).unwrap(), now);
        assert_eq!((queue.pop(), queue.take_lost()), (None, 1));
        let extended = CanFrame::classic(CanId::Extended(0x0400_0001), &[1; 8]).unwrap();
        queue.push(&extended, now);
        assert_eq!(queue.pop(), Some((extended, now)));
    }

    #[test]
    fn a_frame_takes_32_bytes() {
        assert!(size_of::<Classic>() <= 32, "{}", size_of::<Classic>());
    }
}
