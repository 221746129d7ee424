//! What consumers see of any visibility map: "what is at this point?"
//!
//! Evaluation, queries, pictures and fusion ask through [`VisibilityMap`] and never see the grid
//! behind it, so polar radar maps, Cartesian maps and camera maps serve alike.

use crate::sensor::road::RoadPoint;

pub mod azimuths;
pub mod bitmap;
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

    /// Whether it can be seen; unknown is not visible.
    pub const fn visible(&self) -> bool {
        matches!(self.visibility, Visibility::Visible)
    }
}

/// A map of what one sensor, or several, can see.
pub trait VisibilityMap {
    /// What is known of a point of the road plane.
    fn at(&self, point: RoadPoint) -> CellState;
}
