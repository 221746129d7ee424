//! Classic CAN frames between an interrupt that receives them and the loop that takes them.
//!
//! # Limits
//! `N` frames. Of a full queue the new frame is lost, and counted: the scan it belongs to is then known
//! to be incomplete. 24 bytes a frame.

use heapless::Deque;

use crate::wire::frame::{CanFrame, CanId};

/// A classic frame in as few bytes as it needs.
#[derive(Debug, Clone, Copy)]
struct Classic {
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

    /// Appends a frame; one that does not fit, or is not classic, is lost.
    pub fn push(&mut self, frame: &CanFrame) {
        let mut data = [0; 8];
        let length = frame.data().len();
        let kept = data.get_mut(..length).map(|to| to.copy_from_slice(frame.data()));
        let length = u8::try_from(length).unwrap_or(u8::MAX);
        let pushed = kept.and_then(|()| self.frames.push_back(Classic { id: frame.id, length, data }).ok());
        if pushed.is_none() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Takes the oldest frame.
    pub fn pop(&mut self) -> Option<CanFrame> {
        let classic = self.frames.pop_front()?;
        CanFrame::classic(classic.id, classic.data.get(..usize::from(classic.length))?)
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

    fn frame(k: u8) -> CanFrame {
        CanFrame::classic(CanId::Standard(u16::from(k)), &[k; 3]).unwrap()
    }

    #[test]
    fn frames_come_out_as_they_went_in_and_what_does_not_fit_is_counted() {
        let mut queue = FrameQueue::<4>::new();
        (0..6).for_each(|k| queue.push(&frame(k)));
        assert_eq!((queue.take_lost(), queue.take_lost()), (2, 0));
        assert_eq!(queue.pop(), Some(frame(0)));
        queue.push(&frame(9));
        let rest = std::iter::from_fn(|| queue.pop()).collect::<std::vec::Vec<_>>();
        assert_eq!(rest, [frame(1), frame(2), frame(3), frame(9)]);
    }

    #[test]
    fn a_long_frame_is_lost_not_cut() {
        let mut queue = FrameQueue::<4>::new();
        queue.push(&CanFrame::fd(CanId::Standard(1), &[1; 12]).unwrap());
        assert_eq!((queue.pop(), queue.take_lost()), (None, 1));
        let extended = CanFrame::classic(CanId::Extended(0x0400_0001), &[1; 8]).unwrap();
        queue.push(&extended);
        assert_eq!(queue.pop(), Some(extended));
    }

    #[test]
    fn a_frame_takes_24_bytes() {
        assert!(size_of::<Classic>() <= 24, "{}", size_of::<Classic>());
    }
}
