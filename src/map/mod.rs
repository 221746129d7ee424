//! What consumers see of any visibility map: "what is at this point?"
//!
//! Evaluation, queries, pictures and fusion ask through [`VisibilityMap`] and never see the grid
//! behind it, so polar radar maps, Cartesian maps and camera maps serve alike.

use crate::map::query::Footprint;
use crate::sensor::road::RoadPoint;

pub mod azimuths;
pub mod bitmap;
pub(crate) mod overlap;
pub mod polar;
pub mod query;
pub mod resample;

/// Whether the sensor can see a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Visibility {
    /// Nobody has current evidence. To be treated as not visible.
    Unknown,
    /// Something stands in the line of sight.
    Invisible,
    /// Some line of sight reaches the place.
    Visible,
}

/// Grade of a cell nobody has evidence for.
pub(crate) const UNKNOWN: u8 = 0;

/// What a map knows of one place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CellState {
    /// Whether the sensor can see it.
    pub visibility: Visibility,
    /// Graded visibility, 1 (blocked) to 255 (clear); 0 where unknown.
    pub grade: u8,
    /// Occupancy at the slice height, 0 (free) to 255 (occupied); 0 where unknown.
    pub occupancy: u8,
    /// Whether the map's occupancy threshold is reached.
    pub occupied: bool,
}

impl CellState {
    /// A place nobody has current evidence for.
    pub const UNKNOWN: Self = Self { visibility: Visibility::Unknown, grade: 0, occupancy: 0, occupied: false };

    /// What a grade (0 = unknown) and an occupancy say by a map's thresholds.
    pub(crate) const fn judged(grade: u8, occupancy: u8, visible_from: u8, occupied_from: u8) -> Self {
        if grade == UNKNOWN {
            return Self::UNKNOWN;
        }
        let visibility = if grade >= visible_from { Visibility::Visible } else { Visibility::Invisible };
        Self { visibility, grade, occupancy, occupied: occupancy >= occupied_from }
    }

    /// What two places are together: no better than either, and occupied if either is.
    #[must_use]
    pub(crate) fn worse(self, other: Self) -> Self {
        if self.visibility == Visibility::Unknown || other.visibility == Visibility::Unknown {
            return Self::UNKNOWN;
        }
        Self {
            visibility: self.visibility.min(other.visibility),
            grade: self.grade.min(other.grade),
            occupancy: self.occupancy.max(other.occupancy),
            occupied: self.occupied || other.occupied,
        }
    }

    /// Whether it can be seen; unknown is not visible.
    pub const fn visible(&self) -> bool {
        matches!(self.visibility, Visibility::Visible)
    }
}

/// A map of what one sensor, or several, can see.
pub trait VisibilityMap {
    /// What is known of a point of the road plane: the state of the cell it lies in.
    fn at(&self, point: RoadPoint) -> CellState;

    /// Visits states of which the worst is no better than what is known of any point of an area: those of all of the map's
    /// own cells that hold a point of it, and [`CellState::UNKNOWN`] if a part of it lies on none. A few cells beside it may be
    /// among them. Nothing is visited of a footprint that cannot be.
    ///
    /// A map of the 1 m cells of the road has [`Footprint::each_cell`] for it.
    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState));
}

/// The worst of all that a map says within an area: what is unknown in part is unknown, what is hidden in part is
/// hidden, and it is occupied if any of it is.
pub(crate) fn worst_in(map: &(impl VisibilityMap + ?Sized), area: &Footprint) -> CellState {
    let mut worst = None::<CellState>;
    map.cells_in(area, &mut |state| worst = Some(worst.map_or(state, |worst| worst.worse(state))));
    worst.unwrap_or(CellState::UNKNOWN)
}
