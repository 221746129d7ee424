//! What a detector gives of one vehicle: a box in the image and its class.

use crate::fixed::math;

/// What a detector takes something for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs)] // the names say it
pub enum VehicleClass {
    Car,
    Van,
    Truck,
    Bus,
    Motorcycle,
    Bicycle,
    Pedestrian,
}

/// Size of a class, centimetres.
pub(crate) struct ClassSize {
    pub(crate) length: i32,
    pub(crate) width: i32,
    pub(crate) height: i32,
    /// Least and greatest length: what the far end of a box can make of it.
    pub(crate) lengths: [i32; 2],
    /// How much height and width spread.
    pub(crate) height_spread: i32,
    pub(crate) width_spread: i32,
}

impl VehicleClass {
    /// Typical sizes; lengths from the shortest to the longest that is allowed on European roads, or is sold.
    pub(crate) fn size(self) -> ClassSize {
        let of = |[length, width, height]: [i32; 3], lengths, [height_spread, width_spread]: [i32; 2]| ClassSize {
            length,
            width,
            height,
            lengths,
            height_spread,
            width_spread,
        };
        match self {
            Self::Car => of([460, 180, 150], [350, 520], [15, 8]),
            Self::Van => of([600, 205, 260], [480, 740], [30, 8]),
            Self::Truck => of([1650, 255, 400], [600, 1875], [40, 5]),
            Self::Bus => of([1300, 255, 360], [900, 1875], [40, 5]),
            Self::Motorcycle => of([220, 80, 150], [220, 220], [20, 10]),
            Self::Bicycle => of([180, 60, 170], [180, 180], [20, 10]),
            Self::Pedestrian => of([60, 60, 175], [60, 60], [15, 10]),
        }
    }

    /// Whether its vehicles are too different in length for a typical one.
    pub(crate) fn has_any_length(self) -> bool {
        matches!(self, Self::Truck | Self::Bus)
    }

    /// Every class, by its number on the wire from 1.
    const NUMBERED: [Self; 7] =
        [Self::Car, Self::Van, Self::Truck, Self::Bus, Self::Motorcycle, Self::Bicycle, Self::Pedestrian];

    /// Its number on the wire, from 1.
    pub(crate) const fn number(self) -> u8 {
        self as u8 + 1
    }

    /// From its number on the wire.
    pub(crate) fn numbered(number: u8) -> Option<Self> {
        Self::NUMBERED.get(usize::from(number.checked_sub(1)?)).copied()
    }

    /// From the name detectors and recordings use: those of COCO, and `van` and `pedestrian`.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "car" => Self::Car,
            "van" => Self::Van,
            "truck" => Self::Truck,
            "bus" => Self::Bus,
            "motorcycle" | "motorbike" => Self::Motorcycle,
            "bicycle" => Self::Bicycle,
            "pedestrian" | "person" => Self::Pedestrian,
            _ => return None,
        })
    }
}

/// A box around the visible part of a vehicle, in the rectified image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImageBox {
    /// Left, top, right, bottom, sixteenths of a pixel from the upper left corner.
    pub(crate) edges: [i32; 4],
    pub(crate) class: VehicleClass,
}

/// Sixteenths of a pixel in one.
pub(crate) const SUBPIXELS: i32 = 16;

/// Sides of a normalised picture, pixels: a sixteenth of one is 2^-14 of it.
pub(crate) const NORMAL_PX: u16 = 1024;

/// Farthest from the image's corner that an edge may lie, pixels.
const FARTHEST_PX: f32 = 32_000.0;

impl ImageBox {
    /// From left, top, right and bottom edge in pixels; `None` where one is not finite or beyond 32 000 pixels:
    /// whoever decodes a frame drops such a box and counts it as refused. A box that is inverted or outside of the
    /// image is one: the estimator counts it with its reason.
    pub fn from_pixels(edges: [f32; 4], class: VehicleClass) -> Option<Self> {
        let near = edges.iter().all(|v| v.is_finite() && v.abs() <= FARTHEST_PX);
        near.then(|| Self { edges: edges.map(|v| math::round_i32(v * SUBPIXELS as f32)), class })
    }

    /// The same as shares of a picture of this size, width and height in pixels, as the native format sends it. It
    /// goes with a [normalised](crate::camera::calibration::Calibration::normalised) calibration. `None` for a
    /// picture without pixels too.
    pub fn of_picture([l, t, r, b]: [f32; 4], size_px: [u16; 2], class: VehicleClass) -> Option<Self> {
        let [width, height] = size_px.map(|side| f32::from(NORMAL_PX) / f32::from(side));
        Self::from_pixels([l * width, t * height, r * width, b * height], class)
    }

    /// From edges in 2^-14 of the picture.
    pub(crate) fn of_shares(shares: [i16; 4], class: VehicleClass) -> Self {
        Self { edges: shares.map(i32::from), class }
    }

    /// Edges in 2^-14 of a normalised picture; beyond two of its sides cut off.
    #[allow(clippy::cast_possible_truncation)] // cut
    pub(crate) fn shares(&self) -> [i16; 4] {
        self.edges.map(|edge| edge.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16)
    }

    /// What the detector takes it for.
    pub fn class(&self) -> VehicleClass {
        self.class
    }

    /// Its area in pixels, saturating.
    pub(crate) fn area(&self) -> i32 {
        let [l, t, r, b] = self.edges;
        let side = |from: i32, to: i32| (to.saturating_sub(from) / SUBPIXELS).max(0);
        side(l, r).saturating_mul(side(t, b))
    }
}

/// Why a box is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BoxRejection {
    /// Left of its right edge is not its left one, or above its bottom not its top.
    Inverted,
    /// No part of it is in the image.
    Outside,
    /// It ends above the horizon, or so near to it that it shows no place.
    AboveHorizon,
    /// Its place lies beyond the voxels.
    OffGrid,
    /// More than [`MOST_BOXES`](crate::camera::MOST_BOXES) came before it in its frame.
    TooMany,
    /// It was no box: not finite.
    Refused,
}

impl BoxRejection {
    /// Every reason.
    pub const ALL: [Self; 6] =
        [Self::Inverted, Self::Outside, Self::AboveHorizon, Self::OffGrid, Self::TooMany, Self::Refused];

    /// Short name for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inverted => "box inverted",
            Self::Outside => "box outside of the image",
            Self::AboveHorizon => "box above the horizon",
            Self::OffGrid => "box beyond the grid",
            Self::TooMany => "box too many",
            Self::Refused => "no box",
        }
    }
}

/// How many boxes were rejected, by reason; saturating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoxRejections {
    counts: [u32; BoxRejection::ALL.len()],
}

impl BoxRejections {
    /// Nothing rejected.
    pub const NONE: Self = Self { counts: [0; BoxRejection::ALL.len()] };

    pub(crate) fn add(&mut self, reason: BoxRejection, count: u32) {
        if let Some(n) = self.counts.get_mut(reason as usize) {
            *n = n.saturating_add(count);
        }
    }

    pub(crate) fn add_all(&mut self, other: &Self) {
        self.counts.iter_mut().zip(other.counts).for_each(|(n, m)| *n = n.saturating_add(m));
    }

    /// Count of one reason.
    pub fn count(&self, reason: BoxRejection) -> u32 {
        self.counts.get(reason as usize).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_become_sixteenths_and_what_is_no_number_no_box() {
        let b = ImageBox::from_pixels([1.0, 2.25, 3.5, -4.0], VehicleClass::Car).unwrap();
        assert_eq!(b.edges, [16, 36, 56, -64]);
        assert_eq!(ImageBox::from_pixels([1.0, 2.0, f32::NAN, 4.0], VehicleClass::Car), None);
        assert_eq!(ImageBox::from_pixels([1.0, 2.0, 1e9, 4.0], VehicleClass::Car), None);
    }

    #[test]
    fn a_share_of_the_picture_does_not_depend_on_its_size() {
        let of = |scale: f32, size| {
            ImageBox::of_picture([480.0, 270.0, 960.0, 1080.0].map(|v| v * scale), size, VehicleClass::Bus)
        };
        let whole = of(1.0, [1920, 1080]).unwrap();
        assert_eq!(whole.edges, [4096, 4096, 8192, 16384], "a quarter, a quarter, a half, all");
        assert_eq!(of(1.0 / 3.0, [640, 360]), Some(whole));
        assert_eq!(ImageBox::of_shares(whole.shares(), whole.class), whole);
        assert_eq!(of(1.0, [0, 1080]), None);
        let far = ImageBox::of_picture([-9000.0, 0.0, 9000.0, 1.0], [1920, 1080], VehicleClass::Car).unwrap();
        assert_eq!(far.shares(), [i16::MIN, 0, i16::MAX, 15]);
    }

    #[test]
    fn classes_have_the_numbers_of_the_wire() {
        let all: std::vec::Vec<Option<VehicleClass>> = (0..=8).map(VehicleClass::numbered).collect();
        assert_eq!(
            (all[0], all[1], all[7], all[8]),
            (None, Some(VehicleClass::Car), Some(VehicleClass::Pedestrian), None)
        );
        assert!((1..=7).all(|n| VehicleClass::numbered(n).map(VehicleClass::number) == Some(n)));
    }

    #[test]
    fn every_reason_has_its_own_count_and_name() {
        let mut counts = BoxRejections::NONE;
        for (k, reason) in BoxRejection::ALL.into_iter().enumerate() {
            counts.add(reason, k as u32 + 1);
        }
        counts.add(BoxRejection::Inverted, u32::MAX);
        let all: std::vec::Vec<u32> = BoxRejection::ALL.iter().map(|r| counts.count(*r)).collect();
        assert_eq!(all, [u32::MAX, 2, 3, 4, 5, 6]);
        let names: std::collections::BTreeSet<&str> = BoxRejection::ALL.iter().map(|r| r.name()).collect();
        assert_eq!(names.len(), 6);
    }

    #[test]
    fn names_are_those_of_coco() {
        assert_eq!(VehicleClass::named("motorbike"), Some(VehicleClass::Motorcycle));
        assert_eq!(VehicleClass::named("zebra"), None);
    }
}
