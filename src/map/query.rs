//! Questions a consumer asks a map: what of this point, this object, this area?

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::map::{CellState, Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
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

/// A rectangle on the road.
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
pub fn point(map: &impl VisibilityMap, at: RoadPoint) -> Answer {
    map.at(at).into()
}

/// Could an object with this footprint be seen? As the metrics define it: it is visible if any
/// cell it overlaps is, invisible if none is and some is known.
pub fn object(map: &impl VisibilityMap, footprint: &Footprint) -> Answer {
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

/// Is this whole area seen and free? The worst answer of all cells it overlaps.
pub fn area(map: &impl VisibilityMap, footprint: &Footprint) -> Answer {
    let mut worst = Answer::VisibleFree;
    let mut any = false;
    let complete = footprint.each_cell(|cell| {
        any = true;
        worst = worst.min(map.at(cell).into());
    });
    if complete && any { worst } else { Answer::Unknown }
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

    /// Visits the centres of the 1 m cells that share area with the footprint; false, and no visit,
    /// if it is larger than 100 m or turned inside out.
    pub(crate) fn each_cell(&self, mut visit: impl FnMut(RoadPoint)) -> bool {
        let limit = MAX_SIDE_M * 50;
        if !(1..=limit).contains(&self.half_length_cm) || !(1..=limit).contains(&self.half_width_cm) {
            return false;
        }
        let (hx, hy) = (i32::from(self.heading.x).abs(), i32::from(self.heading.y).abs());
        // half the extent along the road's axes, rounded up
        let reach_x = ((hx * self.half_length_cm + hy * self.half_width_cm) >> 14) + 1;
        let reach_y = ((hy * self.half_length_cm + hx * self.half_width_cm) >> 14) + 1;
        let span = |centre: i32, reach: i32| {
            (centre.saturating_sub(reach)).div_euclid(100)..=(centre.saturating_add(reach)).div_euclid(100)
        };
        // half a cell's extent along the footprint's axes
        let cell = ((hx + hy) * 50) >> 14;
        for i in span(self.centre.x_cm, reach_x) {
            for j in span(self.centre.y_cm, reach_y) {
                let at = RoadPoint::cell_centre(i, j);
                let (dx, dy) = (at.x_cm.saturating_sub(self.centre.x_cm), at.y_cm.saturating_sub(self.centre.y_cm));
                let apart = dx.abs() >= reach_x + 50
                    || dy.abs() >= reach_y + 50
                    || self.heading.along(dx, dy).abs() >= self.half_length_cm + cell
                    || self.heading.across(dx, dy).abs() >= self.half_width_cm + cell;
                if !apart {
                    visit(at);
                }
            }
        }
        true
    }
}

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
