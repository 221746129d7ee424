//! What of a vehicle blocks a wave: boxes that leave the gaps a real one has.
//!
//! Ground truth is one box from the road to the roof. A wave finds more room: below the floor, between
//! the axles of a truck, over the bonnet of a car. Those gaps are why a radar detects vehicles that the
//! boxes of the ground truth hide.
//!
//! # References
//! Clearances, overhangs and axle places are those of common European vehicles; lengths and heights of
//! trucks follow Directive 96/53/EC. They are assumptions of this model, not measurements.

use super::traffic::types::{Class, Kind};

/// A box in the vehicle's own axes, from the middle of its footprint on the road: ahead, left and up, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    pub ahead: [f64; 2],
    pub left: [f64; 2],
    pub up: [f64; 2],
}

impl Block {
    /// As wide as `width_m`, in the middle.
    fn centred(ahead: [f64; 2], width_m: f64, up: [f64; 2]) -> Self {
        Self { ahead, left: [-width_m / 2.0, width_m / 2.0], up }
    }
}

/// Longer ones are articulated: a tractor with a trailer.
pub const LONGEST_RIGID_M: f64 = 12.5;
/// Height of the frame of a truck above the road.
pub const FRAME_M: f64 = 1.05;
/// Length of a truck's cab.
pub const CAB_M: f64 = 2.3;
/// Width of a pair of twin tyres.
const TYRES_M: f64 = 0.6;
/// Height of a truck's wheel.
const WHEEL_M: f64 = 1.0;

/// Where axles (or groups of them) of a truck begin and end, from its front backwards.
pub fn truck_axles(length_m: f64) -> Vec<[f64; 2]> {
    let mut axles = vec![[0.9, 1.9]];
    if length_m > LONGEST_RIGID_M {
        axles.push([4.4, 5.4]);
        axles.push([length_m - 5.0, length_m - 1.2]);
    } else {
        axles.push([length_m - 3.4, length_m - 1.8]);
    }
    axles
}

/// The boxes of a vehicle.
pub fn blocks(kind: &Kind) -> Vec<Block> {
    let [length, width, height] = kind.size;
    let half = length / 2.0;
    let whole = [-half, half];
    match kind.class {
        Class::Car => vec![
            Block::centred(whole, width, [0.18, 0.60 * height]),
            Block::centred([-0.44 * length, 0.20 * length], 0.86 * width, [0.60 * height, height]),
        ],
        Class::Van => vec![
            Block::centred(whole, width, [0.20, 0.50 * height]),
            Block::centred([-half, half - 0.18 * length], width, [0.50 * height, height]),
        ],
        Class::Truck => {
            let mut blocks = vec![
                Block::centred([half - CAB_M, half], width, [0.30, 0.92 * height]),
                Block::centred([-half, half - CAB_M - 0.4], width, [FRAME_M, height]),
            ];
            for [front, rear] in truck_axles(length) {
                let ahead = [half - rear, half - front];
                for left in [[-width / 2.0, TYRES_M - width / 2.0], [width / 2.0 - TYRES_M, width / 2.0]] {
                    blocks.push(Block { ahead, left, up: [0.0, WHEEL_M] });
                }
            }
            blocks
        }
        Class::Bus => vec![Block::centred(whole, width, [0.28, height])],
        // riders and walkers are narrower than their footprint, above it
        Class::Motorcycle | Class::Bicycle => {
            vec![
                Block::centred(whole, 0.3 * width, [0.05, 0.6 * height]),
                Block::centred([-0.25 * length, 0.15 * length], 0.7 * width, [0.5 * height, height]),
            ]
        }
        Class::Pedestrian => vec![Block::centred(whole, width, [0.0, height])],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_block_leaves_the_box_of_the_ground_truth() {
        for class in Class::ALL {
            for scale in [0.6, 1.0, 1.1] {
                let size = class.size().map(|s| s * scale);
                for b in blocks(&Kind { class, size }) {
                    for (range, limits) in [
                        (b.ahead, [-size[0] / 2.0, size[0] / 2.0]),
                        (b.left, [-size[1] / 2.0, size[1] / 2.0]),
                        (b.up, [0.0, size[2]]),
                    ] {
                        assert!(range[0] < range[1], "{class:?} {scale} {b:?}");
                        assert!(range[0] >= limits[0] - 1e-9 && range[1] <= limits[1] + 1e-9, "{class:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_roof_is_as_high_as_the_box() {
        for class in Class::ALL {
            let size = class.size();
            let roof = blocks(&Kind { class, size }).iter().map(|b| b.up[1]).fold(0.0, f64::max);
            assert!((roof - size[2]).abs() < 1e-9, "{class:?}");
        }
    }
}
