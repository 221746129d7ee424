//! Points of the road in the image, and why they are no calibration.

use crate::sensor::config::ConfigError;

/// Fewest pairs.
pub(crate) const LEAST_PAIRS: usize = 4;

/// A point of the road that was found in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PointPair {
    /// Along the road and to the left, metres.
    pub road_m: [f32; 2],
    /// Column and row, pixels.
    pub image_px: [f32; 2],
}

/// Why points or a plane are no calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationError {
    /// Fewer than four pairs.
    TooFewPoints {
        /// How many there are.
        points: usize,
    },
    /// A pair has a coordinate that is infinite or not a number.
    NotFinite {
        /// Which, from 0.
        index: usize,
    },
    /// All places on the road lie on one line.
    RoadPointsOnALine,
    /// All pixels lie on one line.
    ImagePointsOnALine,
    /// The pairs leave the homography open.
    Degenerate,
    /// The pairs say nothing about the focal length.
    FocalLengthOpen,
    /// The camera would look at the road from below.
    Mirrored,
    /// The plane has no normal, or the camera lies in it.
    NoPlane,
    /// What came out, or went in, is outside its limits.
    Config(ConfigError),
}

impl From<ConfigError> for CalibrationError {
    fn from(error: ConfigError) -> Self {
        Self::Config(error)
    }
}

impl core::fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFewPoints { points } => {
                write!(f, "{points} pairs of points, it takes {} or more", LEAST_PAIRS)
            }
            Self::NotFinite { index } => write!(f, "pair {index} has a coordinate that is not a finite number"),
            Self::RoadPointsOnALine => {
                write!(f, "all points lie on one line of the road: take some from another lane")
            }
            Self::ImagePointsOnALine => write!(f, "all points lie on one line of the image: take some beside it"),
            Self::Degenerate => write!(
                f,
                "the points leave the view open: no three of the only four may lie on a line, and none may be named twice"
            ),
            Self::FocalLengthOpen => {
                write!(f, "the points say nothing about the focal length (a camera looking straight down): give it")
            }
            Self::Mirrored => write!(
                f,
                "the camera would lie below the road: y runs to the left, rows run down; are two of them mixed up?"
            ),
            Self::NoPlane => write!(f, "a ground plane needs a normal and a distance, each finite and not zero"),
            Self::Config(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for CalibrationError {}
