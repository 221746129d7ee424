//! What belongs together when samples are drawn again: tracks, independent frames, seconds.
//!
//! Samples of one track are correlated, so intervals come from drawing whole tracks; where frames
//! are independent, whole frames. Cells of successive frames are correlated too (the same truck
//! throws the same shadow, the same queue stands for a red light), for 5 to 15 s: so cells are summed
//! up by blocks of one second, and runs of [`RUN_BLOCKS`] of them are drawn. Tracks are taken for independent, which
//! vehicles in one shadow are not: where queues stand, intervals of vehicles are too narrow.

use std::collections::BTreeMap;

use super::samples::FrameSamples;
use crate::recording::Recording;

/// Length of a block of frames, nanoseconds.
pub const BLOCK_NS: i64 = 1_000_000_000;
/// Blocks that are drawn together, one after another.
pub const RUN_BLOCKS: usize = 10;

/// The units of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    /// Unit of each sample, by frame and object.
    pub objects: Vec<Vec<usize>>,
    pub object_units: usize,
    /// Block of each counted frame.
    pub blocks: Vec<Option<usize>>,
    pub block_units: usize,
    /// What an object unit is: `tracks` or `frames`.
    pub kind: &'static str,
    /// What each object unit is called: the track's id, or the frame's number.
    pub names: Vec<String>,
}

impl Units {
    pub fn new(recording: &Recording, samples: &[FrameSamples]) -> Self {
        let independent = recording.sensor.frames_independent;
        let mut units = BTreeMap::new();
        let mut dense = |key: usize| {
            let next = units.len();
            *units.entry(key).or_insert(next)
        };
        let objects: Vec<Vec<usize>> = samples
            .iter()
            .enumerate()
            .map(|(k, frame)| frame.objects.iter().map(|s| dense(if independent { k } else { s.track })).collect())
            .collect();
        let object_units = units.len();
        let start = recording.frames.first().map_or(0, |f| f.time_ns);
        let mut blocks_seen = BTreeMap::new();
        let blocks = recording
            .frames
            .iter()
            .zip(samples)
            .map(|(frame, sample)| {
                let next = blocks_seen.len();
                let second = frame.time_ns.saturating_sub(start).div_euclid(BLOCK_NS);
                sample.counted.then(|| *blocks_seen.entry(second).or_insert(next))
            })
            .collect();
        let mut names = vec![String::new(); object_units];
        for (&key, &unit) in &units {
            let track = recording.truth.as_ref().and_then(|t| t.tracks.get(key)).filter(|_| !independent);
            names[unit] = track.map_or_else(|| key.to_string(), |t| t.id.clone());
        }
        let kind = if independent { "frames" } else { "tracks" };
        Self { objects, object_units, blocks, block_units: blocks_seen.len(), kind, names }
    }

    /// Sums what each sample contributes into one value per object unit.
    pub fn by_object<T: Clone + Default>(&self, mut add: impl FnMut(&mut T, usize, usize)) -> Vec<T> {
        let mut totals = vec![T::default(); self.object_units];
        for (frame, units) in self.objects.iter().enumerate() {
            for (object, &unit) in units.iter().enumerate() {
                add(&mut totals[unit], frame, object);
            }
        }
        totals
    }

    /// Sums what each counted frame contributes into one value per block.
    pub fn by_block<T: Clone + Default>(&self, mut add: impl FnMut(&mut T, usize)) -> Vec<T> {
        let mut totals = vec![T::default(); self.block_units];
        for (frame, block) in self.blocks.iter().enumerate() {
            if let Some(block) = *block {
                add(&mut totals[block], frame);
            }
        }
        totals
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::made_up::{frames, recording, sample};
    use super::*;

    #[test]
    fn samples_of_one_track_are_one_unit_and_ten_frames_one_block() {
        let mut samples = frames((0..25).map(|k| vec![sample(k % 2, 50.0, true, true), sample(7, 60.0, true, true)]));
        samples[0].counted = false;
        samples[0].objects.clear();
        let recording = recording(25, 8);
        let units = Units::new(&recording, &samples);
        assert_eq!((units.object_units, units.block_units, units.kind), (3, 3, "tracks"));
        assert_eq!(units.names, ["1", "7", "0"], "in the order they come");
        assert_eq!(units.by_object(|n: &mut u32, _, _| *n += 1).iter().sum::<u32>(), 48);
        assert_eq!(units.by_block(|n: &mut u32, _| *n += 1), [9, 10, 5]);
    }

    #[test]
    fn independent_frames_are_units_themselves() {
        let samples = frames((0..5).map(|_| vec![sample(0, 50.0, true, true)]));
        let mut recording = recording(5, 1);
        recording.sensor.frames_independent = true;
        let units = Units::new(&recording, &samples);
        assert_eq!((units.object_units, units.kind), (5, "frames"));
    }
}
