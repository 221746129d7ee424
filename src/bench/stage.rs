//! The stages of a frame of radar-3d, as their costs are reported.
//!
//! The estimator says that a stage ended, not which: they always end in this order.

/// A stage of the radar-3d estimator in the order of its picture, and what follows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// Gate, and reflections on the ground.
    Gate,
    /// Moving obstacles.
    Obstacles,
    /// Evidence of the frames before fades.
    Fade,
    /// Lines of sight clear what they pass.
    Clear,
    /// Detections add evidence.
    Add,
    /// Ray casting and slice.
    RayCast,
    /// Obstacles and their shadows on the map.
    Shadows,
    /// The map into messages; no part of the estimator.
    Broadcast,
}

impl Stage {
    /// How many of them are the estimator's.
    pub const ESTIMATOR: usize = Self::COUNT - 1;

    /// How many there are.
    pub const COUNT: usize = Self::ALL.len();

    /// All, in the order they run.
    pub const ALL: [Self; 8] = [
        Self::Gate,
        Self::Obstacles,
        Self::Fade,
        Self::Clear,
        Self::Add,
        Self::RayCast,
        Self::Shadows,
        Self::Broadcast,
    ];

    /// Short name for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gate => "gate",
            Self::Obstacles => "obstacles",
            Self::Fade => "fade",
            Self::Clear => "clear",
            Self::Add => "add",
            Self::RayCast => "ray cast",
            Self::Shadows => "shadows",
            Self::Broadcast => "broadcast",
        }
    }
}
