//! How long frames take on this controller: the last one and the longest, in all and by stage.
//!
//! Counted by a counter that runs with the core's clock, as a Cortex-M's cycle counter does. A frame longer than the counter
//! takes to wrap (8.9 s at 480 MHz) is counted short.

use crate::unit::Event;
use crate::wire::status::FrameTime;

/// A free-running counter of a board.
#[derive(Debug, Clone, Copy)]
pub struct CycleCounter {
    /// Reads it.
    pub count: fn() -> u32,
    /// Counts in a second.
    pub hz: u32,
}

/// Stages that are told apart; an estimator with more has the rest in the last.
pub const STAGES: usize = 8;

/// The last count and the greatest, of one thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Count {
    /// Of the last frame.
    pub last: u32,
    /// Of the longest since the start.
    pub worst: u32,
}

/// What was counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Took {
    /// Counts in a second.
    pub hz: u32,
    /// Frames since the start.
    pub frames: u32,
    /// A whole frame, from its first detection to the offer of its map.
    pub frame: Count,
    /// Its stages, in the order they run; those an estimator does not have are 0.
    pub stages: [Count; STAGES],
}

/// Counts frames.
#[derive(Debug)]
pub struct Timing {
    counter: CycleCounter,
    took: Took,
    began: u32,
    mark: u32,
    stage: usize,
}

impl Timing {
    /// Before the first frame.
    pub const fn new(counter: CycleCounter) -> Self {
        let none = Count { last: 0, worst: 0 };
        let took = Took { hz: counter.hz, frames: 0, frame: none, stages: [none; STAGES] };
        Self { counter, took, began: 0, mark: 0, stage: 0 }
    }

    /// What a unit does with a frame.
    pub fn event(&mut self, event: Event) {
        let now = (self.counter.count)();
        match event {
            Event::Began => (self.began, self.mark, self.stage) = (now, now, 0),
            Event::Ended => {
                if let Some(stage) = self.took.stages.get_mut(self.stage.min(STAGES - 1)) {
                    stage.add(now.wrapping_sub(self.mark));
                }
                (self.mark, self.stage) = (now, self.stage.saturating_add(1));
            }
            Event::Done(_) => {
                self.took.frame.add(now.wrapping_sub(self.began));
                self.took.frames = self.took.frames.saturating_add(1);
            }
        }
    }

    /// The last frame and the longest, as the status says them; not measured before the first frame.
    pub fn frame_times(&self) -> [FrameTime; 2] {
        let Took { hz, frames, frame, .. } = self.took;
        if frames == 0 { Default::default() } else { [frame.last, frame.worst].map(|count| FrameTime::of(count, hz)) }
    }

    /// What was counted so far.
    pub fn took(&self) -> &Took {
        &self.took
    }
}

impl Count {
    fn add(&mut self, count: u32) {
        (self.last, self.worst) = (count, self.worst.max(count));
    }
}
