//! Parts of one vehicle that were taken for several.

use super::gathered::sigma_of_weight;
use super::obstacle::{FRACTION, Obstacle};
use super::profile::BIN_CM;
use super::tracking::{MERGE_PARALLEL, Tracking};
use crate::math::hypot_gate;

impl Obstacle {
    /// Whether another obstacle is near enough to be a part of the same vehicle, or to lie within it.
    #[inline]
    pub fn is_near(&self, other: &Self, t: &Tracking) -> bool {
        let far = (2 * t.max_length_cm) << FRACTION;
        (self.position.0 - other.position.0).abs() <= far && (self.position.1 - other.position.1).abs() <= far
    }

    /// Whether another obstacle, a [near](Self::is_near) one, is a part of the same vehicle: in line, equally fast, and no farther
    /// away than vehicles keep from each other at this speed.
    #[inline]
    pub fn is_one_with(&self, other: &Self, t: &Tracking) -> bool {
        let (dvx, dvy) = (self.velocity.0 - other.velocity.0, self.velocity.1 - other.velocity.1);
        if hypot_gate(dvx, dvy) > t.merge_speed {
            return false;
        }
        if self.heading.cosine(other.heading) < MERGE_PARALLEL {
            return false;
        }
        let (ox, oy) = other.global(other.extent.middle_cm(), 0);
        let (along, left) = self.local(ox, oy);
        let half = other.extent.length_cm() / 2;
        let (rear, front) = (along - half, along + half);
        let gap = (rear - self.extent.front_cm).max(self.extent.rear_cm - front);
        let uncertain = (t.sigmas * (self.lateral_sigma() + other.lateral_sigma())) >> 4;
        let abreast = if gap <= 0 { t.abreast_cm } else { 0 };
        if left.abs() > abreast.max(t.merge_lateral_cm + uncertain) {
            return false;
        }
        let length = front.max(self.extent.front_cm) - rear.min(self.extent.rear_cm);
        let coupled = i32::from(self.travelled_cm.min(other.travelled_cm)) >= t.coupled_way_cm
            && hypot_gate(dvx, dvy) <= t.coupled_speed
            && left.abs() <= t.merge_lateral_cm;
        let widest = if coupled { self.headway_cm(t.coupled_headway, t) } else { self.gap_cm(t) };
        gap <= widest && length <= t.max_length_cm
    }

    /// Whether another obstacle lies within this one, where nothing else can be: a wheel that was taken
    /// for a vehicle, or an echo between the two.
    #[inline]
    pub fn encloses(&self, other: &Self, t: &Tracking) -> bool {
        let far = t.max_length_cm << FRACTION;
        if (self.position.0 - other.position.0).abs() > far || (self.position.1 - other.position.1).abs() > far {
            return false;
        }
        let (x, y) = other.global(other.extent.middle_cm(), 0);
        let (along, left) = self.local(x, y);
        left.abs() <= t.merge_lateral_cm && self.extent.beyond_cm(along) == 0
    }

    /// Standard deviation of the lateral place, centimetres.
    fn lateral_sigma(&self) -> i32 {
        sigma_of_weight(self.lateral_weight)
    }

    /// Takes over what another obstacle knows of the same vehicle.
    #[allow(clippy::cast_possible_truncation)] // a share of the offset
    pub fn join(&mut self, other: &Self, t: &Tracking) {
        // the histogram is no longer than the longest vehicle: its middle first
        let (ax, ay) = other.anchor();
        let (along, _) = self.local(ax, ay);
        let rear = self.extent.rear_cm.min(along + other.extent.rear_cm);
        let front = self.extent.front_cm.max(along + other.extent.front_cm);
        self.recentre((rear + front) / 2 / BIN_CM);
        let (along, left) = self.local(ax, ay);
        self.profile.merge(&other.profile, along);
        let weight = self.lateral_weight.saturating_add(other.lateral_weight).max(1);
        let share = (i64::from(left << FRACTION) * i64::from(other.lateral_weight) / i64::from(weight)) as i32;
        self.move_left(share);
        self.lateral_weight = weight;
        self.existence = (self.existence + other.existence).min(t.existence_max);
        self.hits = self.hits.saturating_add(other.hits);
        self.travelled_cm = self.travelled_cm.max(other.travelled_cm);
        self.tallness.join(&other.tallness);
        self.update_extent(t);
    }
}
