//! Questions a consumer asks a map: what of this point, this object, this area?

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::map::{CellState, Visibility, VisibilityMap, worst_in};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::Levelling;
use crate::sensor::road::RoadPoint;

/// What a map answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// Nobody has current evidence; to be treated as not visible.
    Unknown,
    /// Something stands in the line of sight.
    Invisible,
    /// Seen, and something is there.
    VisibleOccupied,
    /// Seen, and nothing is there.
    VisibleFree,
}

impl From<CellState> for Answer {
    fn from(state: CellState) -> Self {
        match (state.visibility, state.occupied) {
            (Visibility::Unknown, _) => Self::Unknown,
            (Visibility::Invisible, _) => Self::Invisible,
            (Visibility::Visible, true) => Self::VisibleOccupied,
            (Visibility::Visible, false) => Self::VisibleFree,
        }
    }
}

/// A rectangle on the road. One whose sides are not 2 cm to 100 m, or whose heading is no direction, cannot be.
///
/// # Units
/// Centimetres in the road frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Footprint {
    /// Middle.
    pub centre: RoadPoint,
    /// Direction of its length.
    pub heading: Direction,
    /// Half the length.
    pub half_length_cm: i32,
    /// Half the width.
    pub half_width_cm: i32,
}

/// Largest side of a footprint that is looked at, metres; beyond it the answer is unknown.
const MAX_SIDE_M: i32 = 100;

/// What of this point?
pub fn point(map: &(impl VisibilityMap + ?Sized), at: RoadPoint) -> Answer {
    map.at(at).into()
}

/// Could an object with this footprint be seen? As the metrics define it: it is visible if any
/// cell it overlaps is, invisible if none is and some is known.
pub fn object(map: &(impl VisibilityMap + ?Sized), footprint: &Footprint) -> Answer {
    let (mut best, mut occupied) = (Answer::Unknown, false);
    let complete = footprint.each_cell(|cell| {
        let answer = Answer::from(map.at(cell));
        occupied |= answer == Answer::VisibleOccupied;
        best = best.max(answer);
    });
    match best {
        _ if !complete => Answer::Unknown,
        Answer::VisibleFree if occupied => Answer::VisibleOccupied,
        best => best,
    }
}

/// Is this whole area seen and free? The worst answer of all of the map's own cells that hold any point of it: an area
/// that is visible and free is so everywhere.
pub fn area(map: &(impl VisibilityMap + ?Sized), footprint: &Footprint) -> Answer {
    worst_in(map, footprint).into()
}

impl Footprint {
    /// Of an object at a place, with its heading from the road's x axis (degrees, + left) and its length and
    /// width in metres, rounded up to 2 cm.
    ///
    /// # Errors
    /// A heading that is not finite or beyond a turn, a length or width outside 0.02 to 100 m.
    pub fn new(centre: RoadPoint, heading_deg: f32, length_m: f32, width_m: f32) -> Result<Self, ConfigError> {
        let heading = within("footprint.heading_deg", heading_deg, -360.0, 360.0)?;
        let half = |name, m| {
            within(name, m, 0.02, MAX_SIDE_M as f32).map(|m| math::round_i32(m * 50.0 + 0.49).clamp(1, MAX_SIDE_M * 50))
        };
        Ok(Self {
            centre,
            heading: trig::direction(Angle::from_degrees(heading)),
            half_length_cm: half("footprint.length_m", length_m)?,
            half_width_cm: half("footprint.width_m", width_m)?,
        })
    }

    /// A square along the road's axes, of a side of whole centimetres; a centimetre more if that is odd.
    pub(crate) const fn square(centre: RoadPoint, side_cm: i32) -> Self {
        let half = side_cm / 2 + side_cm % 2;
        Self { centre, heading: Direction::AHEAD, half_length_cm: half, half_width_cm: half }
    }

    /// The same in a sensor's levelled frame, 2 cm larger to each side for what is rounded; none if it cannot be.
    #[allow(clippy::cast_possible_truncation)] // components of a direction
    pub(crate) fn levelled(&self, levelling: &Levelling) -> Option<Self> {
        self.reach()?;
        let (x, y) = levelling.place(self.centre);
        let ahead = levelling.heading();
        let heading = Direction { x: ahead.cosine(self.heading) as i16, y: ahead.sine(self.heading) as i16 };
        // a hundredth of a per cent of the sides, and centimetres of places
        let grown = |half: i32| half + 2 + (half >> 12);
        let (half_length_cm, half_width_cm) = (grown(self.half_length_cm), grown(self.half_width_cm));
        Some(Self { centre: RoadPoint::new(x, y), heading, half_length_cm, half_width_cm })
    }

    /// Half its extent along the road's axes, rounded up; none if it cannot be.
    pub(crate) fn reach(&self) -> Option<(i32, i32)> {
        let sound = 1..=MAX_SIDE_M * 50;
        let direction = UNIT - UNIT / 64..=UNIT + UNIT / 64;
        let can_be = sound.contains(&self.half_length_cm)
            && sound.contains(&self.half_width_cm)
            && direction.contains(&self.heading.cosine_wide(self.heading));
        let (hx, hy) = (i32::from(self.heading.x).abs(), i32::from(self.heading.y).abs());
        let reach = |a: i32, b: i32| ((a * self.half_length_cm + b * self.half_width_cm) >> 14) + 1;
        can_be.then(|| (reach(hx, hy), reach(hy, hx)))
    }

    /// Its corners, rounded down.
    pub(crate) fn corners(&self) -> [RoadPoint; 4] {
        let axis = Direction { y: -self.heading.y, ..self.heading };
        let (length, width) = (self.half_length_cm, self.half_width_cm);
        [(length, width), (length, -width), (-length, width), (-length, -width)].map(|(along, left)| {
            let (x, y) = (axis.along(along, left), axis.across(along, left));
            RoadPoint::new(self.centre.x_cm.saturating_add(x), self.centre.y_cm.saturating_add(y))
        })
    }

    /// Visits parts of at most so many centimetres along and across, which cover it and overlap by a little; none if it
    /// cannot be.
    pub(crate) fn parts(&self, most_cm: i32, mut visit: impl FnMut(&Self)) {
        if self.reach().is_none() {
            return;
        }
        let number = |half: i32| (2 * half / most_cm.max(1)).saturating_add(1);
        let (along, across) = (number(self.half_length_cm), number(self.half_width_cm));
        // the middle of one of so many parts of a side
        let middle = |half: i32, k: i32, number: i32| half * (2 * k + 1 - number) / number.max(1);
        let axis = Direction { y: -self.heading.y, ..self.heading };
        for k in 0..along {
            for l in 0..across {
                let (x, y) = (middle(self.half_length_cm, k, along), middle(self.half_width_cm, l, across));
                let (x, y) = (axis.along(x, y), axis.across(x, y));
                let half = |half: i32, number: i32| half / number.max(1) + 3;
                visit(&Self {
                    centre: RoadPoint::new(self.centre.x_cm.saturating_add(x), self.centre.y_cm.saturating_add(y)),
                    heading: self.heading,
                    half_length_cm: half(self.half_length_cm, along),
                    half_width_cm: half(self.half_width_cm, across),
                });
            }
        }
    }

    /// Visits the centres of the 1 m cells that share area with the footprint; false, and no visit,
    /// if it cannot be.
    pub fn each_cell(&self, mut visit: impl FnMut(RoadPoint)) -> bool {
        self.each_square(RoadPoint::new(0, 0), 100, |i, j| visit(RoadPoint::cell_centre(i, j)))
    }

    /// Visits the cells of a grid along the road's axes that share area with the footprint, counted from a corner of one;
    /// false, and no visit, if it cannot be.
    #[allow(clippy::cast_possible_truncation)] // cell numbers
    pub(crate) fn each_square(&self, corner: RoadPoint, side_cm: i32, mut visit: impl FnMut(i32, i32)) -> bool {
        let Some((reach_x, reach_y)) = self.reach() else { return false };
        let wide = |at: i32, from: i32| i64::from(at) - i64::from(from);
        let (x, y) = (wide(self.centre.x_cm, corner.x_cm), wide(self.centre.y_cm, corner.y_cm));
        let side = i64::from(side_cm.max(1));
        let cells = |centre: i64, reach: i32| {
            let end = |at: i64| at.div_euclid(side) as i32;
            end(centre - i64::from(reach))..=end(centre + i64::from(reach))
        };
        // everything doubled, since middles of cells are, and in 2^-14
        let [length, width] = [self.half_length_cm, self.half_width_cm].map(|half| 2 * i64::from(half));
        let (hx, hy) = (i64::from(self.heading.x), i64::from(self.heading.y));
        let squared = (hx * hx + hy * hy) >> 14;
        let own = (hx.abs() + hy.abs()) * side;
        let extent = |a: i64, b: i64| a.abs() * length + b.abs() * width + (side << 14);
        let (along_x, along_y) = (extent(hx, hy), extent(hy, hx));
        for i in cells(x, reach_x) {
            for j in cells(y, reach_y) {
                let (dx, dy) = ((2 * i64::from(i) + 1) * side - 2 * x, (2 * i64::from(j) + 1) * side - 2 * y);
                let apart = (dx << 14).abs() >= along_x
                    || (dy << 14).abs() >= along_y
                    || (dx * hx + dy * hy).abs() >= length * squared + own
                    || (dy * hx - dx * hy).abs() >= width * squared + own;
                if !apart {
                    visit(i, j);
                }
            }
        }
        true
    }
}

/// Square of a direction's length.
const UNIT: i32 = 1 << 28;

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Visible for x < 10 m, free but for the cell at (5, 2); unknown for y < 0.
    struct HalfPlane;

    impl VisibilityMap for HalfPlane {
        fn at(&self, p: RoadPoint) -> CellState {
            if p.y_cm < 0 {
                return CellState::UNKNOWN;
            }
            let visibility = if p.x_cm < 1000 { Visibility::Visible } else { Visibility::Invisible };
            let occupied = p.x_cm / 100 == 5 && p.y_cm / 100 == 2;
            CellState { visibility, grade: 200, occupancy: if occupied { 255 } else { 0 }, occupied }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    fn footprint(x_m: i32, y_m: i32, length_m: i32, width_m: i32) -> Footprint {
        Footprint {
            centre: RoadPoint::new(x_m * 100, y_m * 100),
            heading: Direction::AHEAD,
            half_length_cm: length_m * 50,
            half_width_cm: width_m * 50,
        }
    }

    #[test]
    fn one_visible_cell_shows_an_object_but_not_an_area() {
        let across = footprint(10, 8, 4, 2);
        assert_eq!(object(&HalfPlane, &across), Answer::VisibleFree);
        assert_eq!(area(&HalfPlane, &across), Answer::Invisible);
        assert_eq!(object(&HalfPlane, &footprint(20, 8, 4, 2)), Answer::Invisible);
    }

    #[test]
    fn unknown_outweighs_all_in_an_area() {
        assert_eq!(area(&HalfPlane, &footprint(3, 0, 2, 4)), Answer::Unknown);
        assert_eq!(object(&HalfPlane, &footprint(3, 0, 2, 4)), Answer::VisibleFree);
        assert_eq!(object(&HalfPlane, &footprint(3, -5, 2, 4)), Answer::Unknown);
    }

    #[test]
    fn an_occupied_cell_makes_its_object_and_area_occupied() {
        assert_eq!(object(&HalfPlane, &footprint(5, 3, 4, 2)), Answer::VisibleOccupied);
        assert_eq!(area(&HalfPlane, &footprint(5, 3, 4, 2)), Answer::VisibleOccupied);
        assert_eq!(point(&HalfPlane, RoadPoint::new(550, 250)), Answer::VisibleOccupied);
        assert_eq!(point(&HalfPlane, RoadPoint::new(650, 250)), Answer::VisibleFree);
    }

    #[test]
    fn touching_is_not_overlapping() {
        let mut cells = Vec::new();
        assert!(footprint(2, 1, 4, 2).each_cell(|c| cells.push((c.x_cm / 100, c.y_cm / 100))));
        assert_eq!(cells.len(), 8);
        let mut turned = Vec::new();
        let heading = trig::direction(Angle::from_degrees(45.0));
        let diagonal = Footprint { heading, centre: RoadPoint::new(0, 0), ..footprint(0, 0, 4, 2) };
        assert!(diagonal.each_cell(|c| turned.push((c.x_cm.div_euclid(100), c.y_cm.div_euclid(100)))));
        assert!(turned.contains(&(1, 1)) && !turned.contains(&(1, -2)), "{turned:?}");
    }

    #[test]
    fn footprints_are_named_in_metres_and_refused_by_name() {
        let (centre, left) = (RoadPoint::new(0, 0), Direction { x: 0, y: 1 << 14 });
        let truck = Footprint::new(centre, 90.0, 16.5, 2.55).unwrap();
        assert_eq!(truck, Footprint { centre, heading: left, half_length_cm: 825, half_width_cm: 128 });
        let refused = |heading, length, width| Footprint::new(centre, heading, length, width).unwrap_err().parameter;
        assert_eq!(refused(0.0, 100.1, 2.0), "footprint.length_m");
        assert_eq!(refused(0.0, 4.0, 0.0), "footprint.width_m");
        assert_eq!(refused(f32::NAN, 4.0, 2.0), "footprint.heading_deg");
        assert!(Footprint::new(centre, 0.0, 100.0, 100.0).unwrap().each_cell(|_| ()), "the largest is looked at");
    }

    #[test]
    fn absurd_footprints_are_unknown() {
        assert_eq!(area(&HalfPlane, &footprint(5, 5, 0, 2)), Answer::Unknown);
        assert_eq!(object(&HalfPlane, &footprint(5, 5, 1000, 2)), Answer::Unknown);
        let far = Footprint { centre: RoadPoint::new(i32::MAX, 0), ..footprint(0, 0, 2, 2) };
        assert_eq!(area(&HalfPlane, &far), Answer::Unknown);
    }
}
