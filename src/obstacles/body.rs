//! The box an obstacle fills: what was seen of it, and what that leaves unseen.

use super::hidden_end::ALL;
use super::lanes::{LEARNT, NO_LANE};
use super::obstacle::Obstacle;
use super::parameters::TrackingParameters;
use super::size::Size;
use crate::fixed::math::root;
use crate::obstacles::solid::Solid;

/// Greatest length of what is low, centimetres.
pub(super) const LONGEST_LOW_CM: i32 = 900;
/// Greatest length of a car, centimetres: longer ones are vans, or two things in one outline.
const LONGEST_CAR_CM: i32 = 530;
/// Greatest length that a pedestrian or rider shows, centimetres.
const LONGEST_RIDER_CM: i32 = 250;
/// Shortest length of what shows its side alone, centimetres.
const SHORTEST_LORRY_CM: i32 = 800;
/// Sine of the angle to the road's axis from which a thing goes across it, 2^-14: 14.5 degrees.
const ACROSS: i32 = (1 << 14) / 4;
/// The same below which it goes along the road: 7.2 degrees.
const ALONG: i32 = (1 << 14) / 8;

impl Obstacle {
    /// The box it fills: the outline lengthened to what is usual, behind the face the radar sees, or
    /// before it where that is its farther end.
    pub fn solid(&self, t: &TrackingParameters) -> Solid {
        let size = self.size(t);
        let (along, aside) = self.middle_of_box(&size);
        let low = self.tallness.is_low() && self.may_be_low(&size, t);
        let lid = if low { self.tallness.ceiling_cm() } else { i32::MAX };
        let margin = self.margin_cm(t);
        let aside = aside + self.towards_lane(self.global(along, aside), t);
        let (x, y) = self.global(along, aside);
        Solid {
            x_cm: x,
            y_cm: y,
            heading: self.heading,
            half_length_cm: size.length_cm / 2,
            half_width_cm: size.width_cm / 2 + margin,
            height_cm: size.height_cm.min(lid).max(self.tallness.floor_cm()),
        }
    }

    /// The middle of a box of this size, ahead of the anchor and to its left, centimetres.
    pub(super) fn middle_of_box(&self, size: &Size) -> (i32, i32) {
        let (x, y) = self.global(self.extent.middle_cm(), 0);
        let (ahead, left) = (self.heading.along(x, y), self.heading.across(x, y));
        let hidden = (size.length_cm - self.extent.length_cm()).max(0) / 2;
        let aside = self.beside_the_detections(size, ahead, left);
        let along = self.extent.middle_cm() + if (ahead >= 0) == self.farther_end { -hidden } else { hidden };
        (along, if left >= 0 { aside } else { -aside })
    }

    /// What its outline, what it has shown for long and its proven height make it.
    pub(super) fn size(&self, t: &TrackingParameters) -> Size {
        let tall = t.sizes.least_length_cm(self.tallness.floor_cm());
        let shown = self.extent.length_cm();
        if shown < LONGEST_RIDER_CM && tall == 0 && self.reflectivity.is_below(t.weak_rcs) {
            return Size { length_cm: shown.max(Size::RIDER.length_cm), ..Size::RIDER };
        }
        t.sizes.of(shown.max(self.remembered_length_cm(t)).max(tall))
    }

    /// Whether something of this size that shows nothing high is low. What is as long as a lorry may be one, unless it is
    /// several cars in a row or hardly reflects; so may what is longer than a car and reflects like a lorry.
    fn may_be_low(&self, size: &Size, t: &TrackingParameters) -> bool {
        if size.length_cm >= LONGEST_LOW_CM {
            return self.profile.is_a_row_of_cars(&self.extent) || self.reflectivity.is_below(t.low_rcs);
        }
        self.extent.length_cm() < LONGEST_CAR_CM || !self.reflectivity.is_above(t.lorry_rcs)
    }

    /// What its box is wider to either side for what is unsure of its place, centimetres: half of it where it goes its
    /// own way nearly along the road, whose axis it had for a heading until then, and a quarter on a lane. On a lane
    /// that was learnt it goes its own way, too, but for an eighth along the road.
    fn margin_cm(&self, t: &TrackingParameters) -> i32 {
        let off_axis = t.road.sine(self.heading).abs();
        match (self.lane, self.free_heading) {
            (NO_LANE, false) => 0,
            (LEARNT, _) if self.goes_along_the_road(t) => t.off_axis_margin_cm / 8,
            (NO_LANE | LEARNT, _) if off_axis > ACROSS => t.off_axis_margin_cm,
            (NO_LANE | LEARNT, _) => t.off_axis_margin_cm / 2,
            _ => t.off_axis_margin_cm / 4,
        }
    }

    /// Whether it goes along the road's axis, either way, within 7.2 degrees.
    pub(super) fn goes_along_the_road(&self, t: &TrackingParameters) -> bool {
        t.road.sine(self.heading).abs() < ALONG
    }

    /// How far the middle of its width lies behind its detections, centimetres. A radar beside a
    /// vehicle sees the near side: its detections then spread over less than the width, and have their
    /// centre near that side. One ahead or behind sees both, unless the end is hidden. Waves go under what is shorter
    /// than a lorry and through its windows, so that it reflects all over: as much spread tells more of both sides.
    #[allow(clippy::cast_possible_wrap)] // the root of a clamped variance
    fn beside_the_detections(&self, size: &Size, ahead: i32, left: i32) -> i32 {
        let (side, end) = (size.length_cm * left.abs(), size.width_cm * ahead.abs());
        // from where the side makes up half of what is seen, 2^-8
        let shown = (side / ((side + end) / (ALL * 2)).max(1)).min(ALL).max(i32::from(self.hidden_end));
        // an even spread over the width has a variance of a twelfth of its square; noise makes it a little more
        let weight = if size.length_cm < SHORTEST_LORRY_CM { 16 } else { 9 };
        let half_seen = root((self.spread.max(0) * weight / 8).unsigned_abs()) as i32;
        ((size.width_cm / 2 - half_seen).max(0) * shown) >> 8
    }
}

#[cfg(test)]
mod tests {
    use super::super::Obstacles;
    use super::super::made_up::{PERIOD_S, reflection, rules, seen_at};
    use super::super::obstacle::Obstacle;
    use super::super::size::Size;
    use crate::fixed::time::Step;
    use crate::fixed::trig::Direction;
    use crate::frame::by_range::ByRange;
    use crate::frame::reflection::Reflection;
    use std::vec::Vec;

    const AHEAD: Direction = Direction::AHEAD;

    /// Follows reflections in a row along a lorry 13 m long, and gives the middle of its box aside, metres.
    fn middle_of(rows_m: &[f64], x_m: f64) -> f64 {
        let (mut list, t) = (Obstacles::<16>::new(), rules());
        for k in 0..40 {
            let x = x_m + 5.0 * PERIOD_S * f64::from(k);
            let places = (0..5).flat_map(|i| rows_m.iter().map(move |y| [x + 3.2 * f64::from(i) - 6.4, *y]));
            let reflections: Vec<_> = places.map(|p| reflection(p, [5.0, 0.0])).collect();
            let step = Step::from_micros((PERIOD_S * 1e6) as u64);
            list.step(&reflections, &ByRange::<64>::sort(&reflections, t.limit_cm), step, &t, |_, _| true);
        }
        let boxes: Vec<_> = list.solids(&t).collect();
        assert_eq!(boxes.len(), 1);
        f64::from(boxes[0].y_cm) / 100.0
    }

    #[test]
    fn a_lorry_beside_the_radar_lies_behind_the_side_that_is_seen() {
        // 10 m to either side, where the flank is nearly all there is to see
        for side in [1.0, -1.0] {
            let middle = middle_of(&[side * 10.0], 8.0) * side;
            assert!((10.7..11.4).contains(&middle), "{middle} m, half of 2.5 m farther");
        }
    }

    #[test]
    fn a_lorry_seen_on_both_sides_or_from_behind_stays_where_it_is() {
        let both = middle_of(&[9.15, 10.85], 8.0);
        // the rows lie within a lorry as wide as they are long; from one side only it would be 1.25 m
        assert!((both - 10.0).abs() < 0.5, "{both} m");
        let behind = middle_of(&[2.0], 90.0);
        assert!((behind - 2.0).abs() < 0.3, "{behind} m");
    }

    /// Height of the box of something that reflects at these places along it, metres, so many times at this height.
    fn height_of(places_m: &[f64], times: usize, height_cm: i16) -> f64 {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        for _ in 0..times {
            o.fade_outline(63_000);
            for x in places_m {
                let r = reflection([50.0 + x, 0.0], [20.0, 0.0]);
                o.absorb(&Reflection { height_cm: Some((height_cm, 30)), ..r }, &t);
            }
        }
        o.update_extent(&t);
        assert!(o.extent.length_cm() > 1000, "{:?}", o.extent);
        f64::from(o.solid(&t).height_cm) / 100.0
    }

    #[test]
    fn two_low_cars_taken_for_one_vehicle_are_low_and_a_lorry_is_not() {
        let cars = [-6.1, -5.0, -3.9, -2.6, -1.6, 1.6, 2.6, 3.9, 5.0, 6.1];
        assert!(height_of(&cars, 40, 70) < 1.7, "{}", height_of(&cars, 40, 70));
        assert!(height_of(&cars, 2, 70) > 3.0, "two frames make nothing low");
        assert!(height_of(&cars, 40, 250) > 3.0, "and those are no cars");
        for lorry in [&[-6.1, -5.0, -3.9, -2.6, -1.6, -0.4, 0.9, 1.6, 2.6, 3.9, 5.0, 6.1][..], &[-6.1, -5.6, 5.6, 6.1]]
        {
            assert!(height_of(lorry, 40, 70) > 3.0, "{lorry:?}: {}", height_of(lorry, 40, 70));
        }
    }

    /// An obstacle that shows so much of itself, and reflects so much in each of ten frames.
    fn reflecting(length_cm: i32, dbsm: Option<i16>) -> Obstacle {
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        for _ in 0..10 {
            o.predict(Step::from_micros(1), 1 << 16, &rules());
            for (along, less) in [(-length_cm / 2, 10), (length_cm / 2, 0)] {
                let r = seen_at(5000 + along, 0, 2000);
                o.absorb(&Reflection { rcs_half_dbsm: dbsm.map(|v| 2 * (v - less)), ..r }, &rules());
            }
            o.settle(Step::from_micros(1), &rules());
        }
        o
    }

    #[test]
    fn what_is_short_and_reflects_weakly_is_a_rider_and_without_a_cross_section_everything_is_a_vehicle() {
        let t = rules();
        let size = |length_cm, dbsm| reflecting(length_cm, dbsm).size(&t);
        assert_eq!(size(100, Some(-7)), Size::RIDER);
        assert!((180..=250).contains(&size(200, Some(-7)).length_cm), "no shorter than it shows");
        for vehicle in [size(100, Some(0)), size(100, None), size(400, Some(-7))] {
            assert_eq!((vehicle.width_cm, vehicle.length_cm >= 380), (180, true), "{vehicle:?}");
        }
        let mut high = reflecting(100, Some(-7));
        high.tallness = super::super::made_up::tall();
        assert!(high.size(&t).length_cm >= 600, "a weak echo of something that is tall for certain");
    }

    #[test]
    fn what_reflects_like_a_lorry_is_not_low_and_what_hardly_reflects_is_no_lorry() {
        let t = rules();
        let height = |length_cm, dbsm| {
            let mut o = reflecting(length_cm, dbsm);
            (0..100).for_each(|_| o.tallness.add(70, 30));
            assert!(o.tallness.is_low());
            o.solid(&t).height_cm
        };
        for (length_cm, dbsm, is_low) in
            [(440, 14, true), (700, 14, false), (700, 8, true), (1200, 8, false), (1200, 3, true)]
        {
            let height_cm = height(length_cm, Some(dbsm));
            assert_eq!(height_cm <= 160, is_low, "{length_cm} cm, {dbsm} dBsm: {height_cm} cm high");
        }
        assert!(height(700, None) <= 160 && height(1200, None) > 300, "where the radar does not measure it");
    }

    #[test]
    fn what_leaves_the_axis_is_drawn_wider_by_what_is_unsure_of_its_place() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 0), AHEAD, 2000);
        let along_the_road = o.solid(&t).half_width_cm;
        o.free_heading = true;
        assert_eq!(o.solid(&t).half_width_cm, along_the_road + t.off_axis_margin_cm / 2);
        for across in [AHEAD.left(), AHEAD.left().reversed(), Direction::of(-3, 1), Direction::of(3, -1)] {
            o.heading = across;
            assert_eq!(o.solid(&t).half_width_cm, along_the_road + t.off_axis_margin_cm, "{across:?}");
        }
        assert!(t.off_axis_margin_cm > 0);
    }

    #[test]
    fn what_was_hidden_of_a_vehicle_lies_behind_its_face() {
        let t = rules();
        for heading in [AHEAD, AHEAD.reversed()] {
            let solid = Obstacle::new(&seen_at(5000, 0, 0), heading, 2000).solid(&t);
            assert!(solid.x_cm - solid.half_length_cm > 4900, "{heading:?}: {solid:?}");
        }
    }
}
