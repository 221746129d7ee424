//! Colours shared by all pictures, distinct with any colour vision.
//!
//! Ground: blue is visible, orange invisible, hatched grey unknown; the surer the grade, the
//! stronger the tone. A dark lattice over it is occupied. Outlines: the dash says "not detected", the hue says what the map said.

use viewshed::map::{CellState, Visibility};

use super::canvas::{Colour, Pen};

pub const INK: Colour = Colour::hex(0x1B1F24);
pub const FAINT_INK: Colour = Colour::hex(0x5A626B);
pub const GRID: Colour = Colour::hex(0xDDE0E4);
/// A detection's dot.
pub const DETECTION: Colour = Colour::hex(0x101216);

const VISIBLE: [Colour; 2] = [Colour::hex(0xE6F2FA), Colour::hex(0x9CCBEC)];
/// From sure (grade 0) to doubtful (grade 255).
const INVISIBLE: [Colour; 2] = [Colour::hex(0xE28F4E), Colour::hex(0xFBE6D2)];
const UNKNOWN: [Colour; 2] = [Colour::hex(0xD3D3D3), Colour::hex(0xA9A9A9)];
const OCCUPIED: Colour = Colour::hex(0x2A3340);

/// Distance between the lines of the hatching, pixels.
const HATCH_PX: i32 = 7;

/// Distance between the bars of the lattice over what is occupied, and their width, pixels.
const LATTICE_PX: i32 = 5;
const LATTICE_BAR_PX: i32 = 2;

/// Colour of a cell at one pixel of the picture.
pub fn ground(state: &CellState, x: i32, y: i32) -> Colour {
    let grade = f32::from(state.grade) / 255.0;
    let base = match state.visibility {
        Visibility::Visible => VISIBLE[0].mix(VISIBLE[1], grade),
        Visibility::Invisible => INVISIBLE[0].mix(INVISIBLE[1], grade),
        Visibility::Unknown => UNKNOWN[usize::from((x + y).rem_euclid(HATCH_PX) == 0)],
    };
    // a lattice, through whose holes the ground is seen
    let bar = |v: i32| v.rem_euclid(LATTICE_PX) < LATTICE_BAR_PX;
    if state.occupied && (bar(x) || bar(y)) { base.mix(OCCUPIED, 0.92) } else { base }
}

/// What the evaluation says of an object: visibility V against detection D.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Outcome {
    TrueVisible,
    FalseVisible,
    TrueInvisible,
    FalseInvisible,
}

impl Outcome {
    pub const ALL: [Self; 4] = [Self::TrueVisible, Self::FalseVisible, Self::TrueInvisible, Self::FalseInvisible];

    pub const fn of(visible: bool, detected: bool) -> Self {
        match (visible, detected) {
            (true, true) => Self::TrueVisible,
            (true, false) => Self::FalseVisible,
            (false, false) => Self::TrueInvisible,
            (false, true) => Self::FalseInvisible,
        }
    }

    pub const fn short(self) -> &'static str {
        match self {
            Self::TrueVisible => "TV",
            Self::FalseVisible => "FV",
            Self::TrueInvisible => "TI",
            Self::FalseInvisible => "FI",
        }
    }

    pub const fn meaning(self) -> &'static str {
        match self {
            Self::TrueVisible => "TV: visible and detected",
            Self::FalseVisible => "FV: visible, not detected",
            Self::TrueInvisible => "TI: invisible, not detected",
            Self::FalseInvisible => "FI: invisible, yet detected",
        }
    }
}

const NOT_DETECTED: &[f32] = &[5.0, 3.0];

/// Outline of a box; `None` is a box that does not count.
pub const fn outline(outcome: Option<Outcome>) -> Pen {
    match outcome {
        Some(Outcome::TrueVisible) => Pen::new(Colour::hex(0x006B4F), 2.0),
        Some(Outcome::FalseVisible) => Pen::new(Colour::hex(0xC8001E), 3.0).dashed(NOT_DETECTED),
        Some(Outcome::TrueInvisible) => Pen::new(Colour::hex(0x1B1F24), 2.0).dashed(NOT_DETECTED),
        Some(Outcome::FalseInvisible) => Pen::new(Colour::hex(0x8A1F9C), 3.0),
        None => Pen::new(Colour::hex(0x777D85), 1.5),
    }
}

/// Colours and dashes of the curves of a chart, in order (Okabe and Ito's palette, darker yellow).
pub const CURVES: [Pen; 6] = [
    Pen::new(Colour::hex(0x0072B2), 2.5),
    Pen::new(Colour::hex(0xD55E00), 2.5).dashed(&[9.0, 4.0]),
    Pen::new(Colour::hex(0x009E73), 2.5).dashed(&[2.5, 3.5]),
    Pen::new(Colour::hex(0xB04F8C), 2.5).dashed(&[9.0, 3.0, 2.5, 3.0]),
    Pen::new(Colour::hex(0x8C7300), 2.5).dashed(&[15.0, 4.0]),
    Pen::new(Colour::hex(0x3C9CDC), 2.5).dashed(&[5.0, 3.0]),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance, 0 to 255.
    fn luminance(c: Colour) -> f32 {
        0.2126 * f32::from(c.red) + 0.7152 * f32::from(c.green) + 0.0722 * f32::from(c.blue)
    }

    fn state(visibility: Visibility, grade: u8) -> CellState {
        CellState { visibility, grade, occupancy: 0, occupied: false }
    }

    #[test]
    fn sure_places_differ_in_lightness_too() {
        let visible = luminance(ground(&state(Visibility::Visible, 255), 1, 1));
        let invisible = luminance(ground(&state(Visibility::Invisible, 0), 1, 1));
        assert!(visible - invisible > 25.0, "{visible} {invisible}");
    }

    #[test]
    fn visible_without_a_detection_is_the_unknown_blind_spot() {
        assert_eq!(Outcome::of(true, false), Outcome::FalseVisible);
        assert_eq!(Outcome::of(false, true), Outcome::FalseInvisible);
        assert_eq!(Outcome::ALL.map(Outcome::short), ["TV", "FV", "TI", "FI"]);
        let dashed = |o| !outline(Some(o)).dash.is_empty();
        assert_eq!(Outcome::ALL.map(dashed), [false, true, true, false], "dashed is not detected");
    }

    #[test]
    fn doubt_is_paler_on_both_sides() {
        for (visibility, sure, doubtful) in [(Visibility::Visible, 255, 140), (Visibility::Invisible, 0, 110)] {
            let light = |grade| luminance(ground(&state(visibility, grade), 1, 1));
            assert!(light(doubtful) > light(sure) + 10.0);
        }
    }

    #[test]
    fn unknown_is_hatched_and_occupied_is_a_lattice_that_the_ground_is_seen_through() {
        let unknown = |x| ground(&CellState::UNKNOWN, x, 0);
        assert_ne!(unknown(0), unknown(1));
        for free in [state(Visibility::Visible, 255), state(Visibility::Invisible, 0)] {
            let occupied = CellState { occupied: true, ..free };
            // on any 6 x 6 pixels, which a cell has on an overview
            for (left, top) in [(0, 0), (3, 1), (101, 58)] {
                let pixels = || (left..left + 6).flat_map(|x| (top..top + 6).map(move |y| (x, y)));
                let seen = pixels().filter(|&(x, y)| ground(&occupied, x, y) == ground(&free, x, y)).count();
                let dark = pixels().filter(|&(x, y)| luminance(ground(&occupied, x, y)) < 80.0).count();
                assert!(seen >= 9 && dark >= 18, "{seen} {dark}");
            }
        }
    }
}
