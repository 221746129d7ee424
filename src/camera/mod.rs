//! The camera-3d estimator.

pub mod boxes;
pub mod calibration;
mod homography;
pub mod lift;
mod projection;

/// Most boxes of a frame that are used.
pub const MOST_BOXES: usize = 500;
