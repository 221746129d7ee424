//! Whether there is room behind what is seen of a vehicle for the rest of it.
//!
//! Of what is tall a radar can see the end that is farther away, and not the nearer one. Nothing tells the two apart but the
//! next vehicle: one that begins where the rest of this one should still be leaves no room for it, so that lies before
//! what is seen.
//!
//! # Limits
//! Of what is tall, and shows no more than 3 m of itself. Tall vehicles that creep in a line are what it is for: many of
//! their boxes are begun by the farther end.

use super::Obstacles;
use super::obstacle::Obstacle;
use super::parameters::{MERGE_PARALLEL, TrackingParameters};

/// Longest outline of one end of something tall, centimetres.
const END_CM: i32 = 300;

impl<const N: usize> Obstacles<N> {
    /// Looks which are seen at their farther end alone.
    pub(super) fn find_farther_ends(&mut self, t: &TrackingParameters) {
        let mut farther = [false; N];
        for (o, farther) in self.list.iter().zip(&mut farther) {
            *farther = o.is_an_end_of_something_tall(t) && self.list.iter().any(|next| o.would_overlap(next, t));
        }
        for (o, farther) in self.list.iter_mut().zip(farther) {
            o.farther_end = farther;
        }
    }
}

impl Obstacle {
    fn is_an_end_of_something_tall(&self, t: &TrackingParameters) -> bool {
        self.tallness.is_tall() && self.speed() < t.slow_speed && self.extent.length_cm() < END_CM
    }

    /// Whether another vehicle, farther away in the same line, begins where the rest of this one should be. What is tall
    /// as well may be a part of it.
    fn would_overlap(&self, next: &Self, t: &TrackingParameters) -> bool {
        if next.existence < t.confirmed || !next.is_mover(t) || next.tallness.is_tall() || !self.is_near(next, t) {
            return false;
        }
        if self.heading.cosine(next.heading) < MERGE_PARALLEL {
            return false;
        }
        let (x, y) = next.global(next.extent.middle_cm(), 0);
        let (middle, left) = self.local(x, y);
        if left.abs() > t.merge_lateral_cm {
            return false;
        }
        let half = next.extent.length_cm() / 2;
        let (beyond, begins) = if self.shows_its_rear() {
            (middle - self.extent.middle_cm(), middle - half - self.extent.rear_cm)
        } else {
            (self.extent.middle_cm() - middle, self.extent.front_cm - middle - half)
        };
        beyond > 0 && begins < self.size(t).length_cm
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{rules, seen_at, tall};
    use super::super::profile::Extent;
    use super::*;
    use crate::fixed::trig::Direction;

    /// An obstacle in a creeping line, its outline from one place to another ahead of the sensor.
    fn seen(from_cm: i32, to_cm: i32, is_tall: bool, heading: Direction) -> Obstacle {
        let t = rules();
        let mut o = Obstacle::new(&seen_at((from_cm + to_cm) / 2, 0, 0), heading, 150);
        let half = (to_cm - from_cm) / 2;
        o.extent = Extent { rear_cm: -half, front_cm: half };
        (o.existence, o.travelled_cm) = (t.existence_max, 1000);
        if is_tall {
            o.tallness = tall();
        }
        o
    }

    /// From where to where the box of the first of these reaches, centimetres.
    fn first_of(vehicles: &[Obstacle]) -> [i32; 2] {
        let t = rules();
        let mut all = Obstacles::<4>::new();
        vehicles.iter().for_each(|o| all.list.push(o.clone()).unwrap());
        all.find_farther_ends(&t);
        let solid = all.iter().next().unwrap().solid(&t);
        [solid.x_cm - solid.half_length_cm, solid.x_cm + solid.half_length_cm]
    }

    #[test]
    fn a_tall_end_with_no_room_behind_it_is_the_farther_end_of_its_vehicle() {
        // whatever way it drives, ahead of the sensor and behind it
        for heading in [Direction::AHEAD, Direction::AHEAD.reversed()] {
            let (end, car) = (seen(5000, 5100, true, heading), seen(5540, 5990, false, heading));
            assert_eq!(first_of(std::slice::from_ref(&end)), [5000, 5600], "nothing is known: behind what is seen");
            assert_eq!(first_of(&[end.clone(), car.clone()]), [4500, 5100]);
            assert_eq!(first_of(&[end, seen(5610, 6060, false, heading)]), [5000, 5600], "room enough");
            let (end, car) = (seen(-5100, -5000, true, heading), seen(-5990, -5540, false, heading));
            assert_eq!(first_of(&[end, car]), [-5100, -4500]);
        }
    }

    #[test]
    fn other_lanes_parts_of_it_and_what_lies_before_it_leave_it_where_it_is() {
        let (t, ahead) = (rules(), Direction::AHEAD);
        let end = seen(5000, 5100, true, ahead);
        let stays = |end: &Obstacle, next: Obstacle| first_of(&[end.clone(), next]) == [5000, 5600];
        let car = seen(5540, 5990, false, ahead);
        assert!(!stays(&end, car.clone()));
        let mut aside = car.clone();
        aside.position.1 += (t.merge_lateral_cm + 10) << super::super::obstacle::FRACTION;
        assert!(stays(&end, aside));
        assert!(stays(&end, seen(5540, 5990, true, ahead)), "tall too, so perhaps the same lorry");
        assert!(stays(&end, seen(4300, 4750, false, ahead)), "before it");
        assert!(stays(&end, seen(5540, 5990, false, ahead.left())), "across the road");
        assert!(stays(&end, Obstacle { existence: t.confirmed - 1, ..car.clone() }), "perhaps nothing");
        assert!(stays(&end, Obstacle { travelled_cm: 0, ..car.clone() }), "a fixture");
        let fast = Obstacle { velocity: (t.slow_speed, 0), ..end.clone() };
        assert!(stays(&fast, car.clone()), "vehicles keep their distance");
        let low = seen(5000, 5100, false, ahead);
        assert_eq!(first_of(&[low, seen(5340, 5790, false, ahead)])[0], 5000, "of a car only the nearer end is seen");
        let long = seen(5000, 5300, true, ahead);
        assert_eq!(first_of(&[long, car])[0], 5000, "more than an end");
    }
}
