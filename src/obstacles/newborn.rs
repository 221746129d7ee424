//! Where obstacles come from: detections that move and belong to none.

use super::obstacle::Obstacle;
use super::parameters::TrackingParameters;
use super::{Claimed, Obstacles};
use crate::fixed::time::Step;
use crate::frame::by_range::ByRange;
use crate::frame::reflection::Reflection;

impl<const N: usize> Obstacles<N> {
    /// Starts obstacles from detections that move and belong to nobody: along the road, or along the line of sight where
    /// nothing drives so fast along the road (`TrackingParameters::course`). At most half as many in a frame as there is room for in
    /// all; the rest waits for the next.
    pub(super) fn found<const D: usize>(
        &mut self,
        reflections: &[Reflection],
        by_range: &ByRange<D>,
        of_fixtures: &Claimed<D>,
        claimed: &mut Claimed<D>,
        t: &TrackingParameters,
    ) {
        let mut room = N / 2;
        for (i, seed) in reflections.iter().enumerate() {
            if claimed.contains(i) {
                continue;
            }
            let Some((heading, speed)) = t.course(seed) else { continue };
            if room == 0 {
                return;
            }
            if self.list.is_full() && self.list.iter().all(|o| o.existence >= t.confirmed) {
                // there will be none in this frame
                self.dropped = self.dropped.saturating_add(1);
                return;
            }
            room -= 1;
            let mut newborn = Obstacle::new(seed, heading, speed);
            newborn.find_any_lane(&self.lanes, t);
            newborn.absorb(seed, t);
            claimed.insert(i);
            let mut search = newborn.search(t);
            let (from, to) = search.distances_cm();
            for place in by_range.between(from - t.max_length_cm, to + t.max_length_cm) {
                if !search.reaches(place.x_cm, place.y_cm) {
                    continue;
                }
                let j = usize::from(place.index);
                let Some(r) = reflections.get(j).filter(|_| !claimed.contains(j) && !of_fixtures.contains(j)) else {
                    continue;
                };
                let error = search.speed_error(r);
                if error <= t.doppler_gate
                    && search.offset(r, t).and_then(|offset| search.misfit(r, offset, error, t)).is_some()
                {
                    newborn.absorb(r, t);
                    newborn.reach(r);
                    claimed.insert(j);
                    search = newborn.search(t);
                }
            }
            newborn.settle(Step::from_micros(0), t);
            self.admit(newborn, t);
        }
    }

    pub(super) fn admit(&mut self, newborn: Obstacle, t: &TrackingParameters) {
        let Err(newborn) = self.list.push(newborn) else { return };
        let weakest = self.list.iter_mut().min_by_key(|o| o.existence);
        match weakest {
            Some(o) if o.existence < t.confirmed && o.existence < newborn.existence => *o = newborn,
            _ => self.dropped = self.dropped.saturating_add(1),
        }
    }
}
