//! How wide and high a vehicle of a given length is.
//!
//! A detection marks a reflection point, not the height of the thing, and trucks reflect low. The
//! length is what a radar measures best, and it separates the classes: few cars exceed 5.2 m,
//! delivery vans are about 6 m long and 2.6 m high, and goods vehicles fill what the law allows
//! (2.55 m wide and 4.00 m high in the European Union, directive 96/53/EC). An outline is a little shorter than what drew
//! it, so the table reaches a height half a metre to a metre before the class does.

use crate::fixed::math;
use crate::sensor::config::{ConfigError, above, within};

/// One point of the size table.
///
/// # Units
/// Metres.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct SizePoint {
    /// Length from which this size holds.
    pub length_m: f32,
    /// Width over all.
    pub width_m: f32,
    /// Height over all.
    pub height_m: f32,
}

/// Sizes by length: linear between the points, constant beyond them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SizeConfig {
    /// Points in ascending length.
    pub points: [SizePoint; 4],
    /// No vehicle is taken to be shorter, metres.
    pub min_length_m: f32,
}

impl Default for SizeConfig {
    fn default() -> Self {
        let point = |length_m, width_m, height_m| SizePoint { length_m, width_m, height_m };
        Self {
            points: [point(5.2, 1.8, 1.5), point(6.0, 2.05, 2.6), point(8.5, 2.5, 3.6), point(11.0, 2.55, 4.0)],
            min_length_m: 3.8,
        }
    }
}

/// The size table in centimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    points: [Size; 4],
    /// No vehicle is taken to be shorter.
    pub min_length_cm: i32,
}

/// Length, width and height, centimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Along the heading.
    pub length_cm: i32,
    /// Across it.
    pub width_cm: i32,
    /// Above the road.
    pub height_cm: i32,
}

impl Size {
    /// Someone on a bicycle; a pedestrian, whose legs and arms spread what he shows, takes no more room.
    pub const RIDER: Self = Self { length_cm: 180, width_cm: 70, height_cm: 170 };
}

impl SizeConfig {
    /// Checks the table and rounds it.
    ///
    /// # Errors
    /// Sizes outside what vehicles are, or lengths that do not ascend.
    pub fn sizes(&self) -> Result<Sizes, ConfigError> {
        let cm = |m: f32| math::round_i32(m * 100.0);
        let mut lower = 0.0;
        for p in &self.points {
            within("sizes.points.length_m", p.length_m, 0.5, 40.0)?;
            above("sizes.points.length_m", p.length_m, lower)?;
            within("sizes.points.width_m", p.width_m, 0.3, 6.0)?;
            within("sizes.points.height_m", p.height_m, 0.3, 8.0)?;
            lower = p.length_m;
        }
        within("sizes.min_length_m", self.min_length_m, 0.3, 20.0)?;
        Ok(Sizes {
            points: self.points.map(|p| Size {
                length_cm: cm(p.length_m),
                width_cm: cm(p.width_m),
                height_cm: cm(p.height_m),
            }),
            min_length_cm: cm(self.min_length_m),
        })
    }
}

impl Sizes {
    /// Size of a vehicle of this measured length.
    pub fn of(&self, length_cm: i32) -> Size {
        let mut size = self.points[0];
        for pair in self.points.windows(2) {
            let [a, b] = pair else { continue };
            let run = length_cm.max(a.length_cm).min(b.length_cm) - a.length_cm;
            let span = (b.length_cm - a.length_cm).max(1);
            size.width_cm += (b.width_cm - a.width_cm) * run / span;
            size.height_cm += (b.height_cm - a.height_cm) * run / span;
        }
        Size { length_cm: length_cm.max(self.min_length_cm), ..size }
    }

    /// Shortest length whose usual height reaches this one, centimetres; 0 for what is lower than all.
    pub fn least_length_cm(&self, height_cm: i32) -> i32 {
        let Some(first) = self.points.first().filter(|p| p.height_cm < height_cm) else { return 0 };
        let mut length = first.length_cm;
        for pair in self.points.windows(2) {
            let [a, b] = pair else { continue };
            let rise = (height_cm - a.height_cm).clamp(0, (b.height_cm - a.height_cm).max(0));
            length += (b.length_cm - a.length_cm) * rise / (b.height_cm - a.height_cm).max(1);
        }
        length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cars_are_low_and_lorries_high() {
        let sizes = SizeConfig::default().sizes().unwrap();
        assert_eq!(sizes.of(440), Size { length_cm: 440, width_cm: 180, height_cm: 150 });
        assert_eq!(sizes.of(100).length_cm, 380);
        assert_eq!(sizes.of(600).height_cm, 260);
        assert_eq!(sizes.of(1650), Size { length_cm: 1650, width_cm: 255, height_cm: 400 });
        assert_eq!(sizes.of(560).height_cm, 205, "half way from car to van");
    }

    #[test]
    fn what_is_proven_high_is_long() {
        let sizes = SizeConfig::default().sizes().unwrap();
        assert_eq!([0, 150, 260, 400, 900].map(|h| sizes.least_length_cm(h)), [0, 0, 600, 1100, 1100]);
        let length = sizes.least_length_cm(310);
        assert!((sizes.of(length).height_cm - 310).abs() <= 1, "the inverse of the table, {length} cm");
    }

    #[test]
    fn a_table_that_does_not_ascend_is_named() {
        let mut config = SizeConfig::default();
        config.points[2].length_m = 5.0;
        assert_eq!(config.sizes().unwrap_err().parameter, "sizes.points.length_m");
    }
}
