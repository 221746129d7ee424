//! Occupied space ahead of the camera: voxels of 1 x 1 x 0.5 m, four bits each.
//!
//! The grid lies in the levelled frame: rows of 1 m ahead of the camera, in each row columns of 1 m from right to
//! left, in each column eight voxels from the road to 4 m. A column is one word. What a box covers is full; it
//! fades by a constant amount per second, whatever the frame rate, and half of full is occupied.
//!
//! # Limits
//! A box fills the columns whose middle it covers, and always the one that its own middle is in. All columns of a
//! row are faded together or, where nothing is in it, not at all.

use crate::fixed::time::Step;
use crate::fixed::trig::Direction;

/// Side of a column, centimetres.
pub(crate) const CELL_CM: i32 = 100;

/// Height of a voxel, centimetres.
pub(crate) const VOXEL_CM: i32 = 50;

/// Voxels of a column.
pub(crate) const LEVELS: i32 = 8;

/// Evidence of a voxel that is covered.
pub(crate) const FULL: u8 = 15;

/// The top bit of every voxel: occupied.
pub(crate) const TOPS: u32 = 0x8888_8888;

/// A box in the levelled frame, centimetres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Standing {
    pub(crate) at: (i32, i32),
    pub(crate) heading: Direction,
    pub(crate) half_length: i32,
    pub(crate) half_width: i32,
    pub(crate) height: i32,
}

/// `NX` rows of `NY` columns; the camera stands at the middle of the first row's near side.
#[derive(Debug, Clone)]
pub(crate) struct Voxels<const NX: usize, const NY: usize> {
    columns: [[u32; NY]; NX],
    used: [bool; NX],
    /// Evidence to be lost, below one, 2^-16.
    owed: i32,
}

/// Middle of a column across the view, + left, centimetres.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // column indices
pub(crate) const fn middle_of(column: usize, columns: usize) -> i32 {
    (2 * column as i32 + 1 - columns as i32) * (CELL_CM / 2)
}

/// Takes `loss`, up to 15, from each of eight voxels, none below zero.
fn fade_column(column: u32, loss: u32) -> u32 {
    const LOW: u32 = 0x0F0F_0F0F;
    const GUARD: u32 = 0x1010_1010;
    let fade = |four: u32| {
        // a guard above each voxel is gone where there was less than the loss
        let left = (four | GUARD) - loss * 0x0101_0101;
        let kept = (left & GUARD) >> 4;
        left & (kept * 15)
    };
    fade(column & LOW) | fade((column >> 4) & LOW) << 4
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // cell indices
impl<const NX: usize, const NY: usize> Voxels<NX, NY> {
    pub(crate) const EMPTY: Self = Self { columns: [[0; NY]; NX], used: [false; NX], owed: 0 };

    pub(crate) fn clear(&mut self) {
        for (row, used) in self.columns.iter_mut().zip(&mut self.used) {
            if *used {
                *row = [0; NY];
                *used = false;
            }
        }
        self.owed = 0;
    }

    /// Lets everything fade by a time step; `loss` is evidence per second, 2^-8.
    pub(crate) fn fade(&mut self, step: Step, loss: i32) {
        let lost = (i64::from(loss) * i64::from(step.raw())) >> 8;
        let owed = i64::from(self.owed) + lost.clamp(0, 16 << 16);
        self.owed = (owed & 0xFFFF) as i32;
        let loss = ((owed >> 16) as u32).min(u32::from(FULL));
        if loss == 0 {
            return;
        }
        for (row, used) in self.columns.iter_mut().zip(&mut self.used) {
            if *used {
                let mut any = 0;
                for column in row.iter_mut() {
                    *column = fade_column(*column, loss);
                    any |= *column;
                }
                *used = any != 0;
            }
        }
    }

    /// Fills what a box covers; whether any of that is in the grid.
    pub(crate) fn fill(&mut self, b: &Standing) -> bool {
        let levels = ((b.height + VOXEL_CM / 2) / VOXEL_CM).clamp(1, LEVELS);
        let mask = u32::MAX >> (4 * (LEVELS - levels));
        let ((x, y), (hx, hy)) = (b.at, (i32::from(b.heading.x).abs(), i32::from(b.heading.y).abs()));
        let reach_x = ((hx * b.half_length + hy * b.half_width) >> 14) + 1;
        let reach_y = ((hy * b.half_length + hx * b.half_width) >> 14) + 1;
        let right = NY as i32 * (CELL_CM / 2);
        let cells = |from: i32, to: i32, size: usize| {
            let first = from.div_euclid(CELL_CM).clamp(0, size as i32);
            first as usize..(to.div_euclid(CELL_CM) + 1).clamp(first, size as i32) as usize
        };
        let own = (x.div_euclid(CELL_CM), (y + right).div_euclid(CELL_CM));
        let columns = cells(y - reach_y + right, y + reach_y + right, NY);
        let mut any = false;
        for i in cells(x - reach_x, x + reach_x, NX) {
            let dx = i as i32 * CELL_CM + CELL_CM / 2 - x;
            let (Some(row), Some(used)) = (self.columns.get_mut(i), self.used.get_mut(i)) else { continue };
            for j in columns.clone() {
                let dy = middle_of(j, NY) - y;
                let covered =
                    b.heading.along(dx, dy).abs() <= b.half_length && b.heading.across(dx, dy).abs() <= b.half_width;
                if let Some(column) = row.get_mut(j).filter(|_| covered || own == (i as i32, j as i32)) {
                    *column |= mask;
                    *used = true;
                    any = true;
                }
            }
        }
        any
    }

    /// A row's columns; `None` where nothing is in it.
    pub(crate) fn row(&self, row: usize) -> Option<&[u32; NY]> {
        self.used.get(row).filter(|used| **used).and(self.columns.get(row))
    }
}

/// Height up to which a column is occupied, centimetres. What stands on the road fills it from below.
#[allow(clippy::cast_possible_wrap)] // at most 8
pub(crate) fn top_of(column: u32) -> i32 {
    (35 - (column & TOPS).leading_zeros() as i32) / 4 * VOXEL_CM
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::fixed::trig;
    use std::string::String;

    type Grid = Voxels<12, 9>;

    fn standing(x: i32, y: i32, length: i32, width: i32, height: i32, heading_deg: f32) -> Standing {
        let heading = trig::direction(Angle::from_degrees(heading_deg));
        Standing { at: (x, y), heading, half_length: length / 2, half_width: width / 2, height }
    }

    /// Tops in half metres, far rows first, left columns first.
    fn picture(grid: &Grid) -> String {
        let row = |i: usize| {
            let columns = grid.row(i).copied().unwrap_or([0; 9]);
            let marks = columns.iter().rev().map(|c| match top_of(*c) / 50 {
                0 => '.',
                n => char::from(b'0' + n as u8),
            });
            marks.chain(['\n']).collect::<String>()
        };
        (0..12).rev().map(row).collect()
    }

    #[test]
    fn boxes_fill_the_columns_they_stand_on_up_to_their_height() {
        let mut grid = Grid::EMPTY;
        assert!(grid.fill(&standing(800, 310, 400, 200, 150, 0.0)), "a car ahead on the left");
        assert!(grid.fill(&standing(400, -260, 300, 200, 400, 90.0)), "a truck across on the right");
        assert!(grid.fill(&standing(120, 0, 60, 60, 175, 0.0)), "one who covers no middle");
        assert!(!grid.fill(&standing(5000, 0, 400, 200, 150, 0.0)));
        assert!(!grid.fill(&standing(-600, 0, 400, 200, 150, 0.0)), "behind the camera");
        let expected = [
            ".........",
            ".........",
            "33.......",
            "33.......",
            "33.......",
            "33.......",
            ".........",
            "......888",
            "......888",
            ".........",
            "....4....",
            ".........\n",
        ];
        assert_eq!(picture(&grid), expected.join("\n"));
    }

    #[test]
    fn eight_voxels_fade_as_one_does() {
        for loss in 0..=15 {
            for base in 0..=15_u32 {
                let voxels: [u32; 8] = core::array::from_fn(|k| (base + 5 * k as u32) % 16);
                let pack = |v: [u32; 8]| v.iter().enumerate().fold(0, |sum, (k, v)| sum | v << (4 * k));
                assert_eq!(
                    fade_column(pack(voxels), loss),
                    pack(voxels.map(|v| v.saturating_sub(loss))),
                    "{loss} {base}"
                );
            }
        }
    }

    #[test]
    fn full_evidence_fades_in_its_memory_at_any_frame_rate() {
        for memory_s in [0.2_f64, 1.0, 10.0] {
            for frames in [5, 15, 50] {
                let loss = (f64::from(FULL) * 256.0 / memory_s).round() as i32;
                let mut grid = Grid::EMPTY;
                grid.fill(&standing(400, 0, 200, 200, 150, 0.0));
                let mut lasted = 0;
                while grid.row(3).is_some() {
                    grid.fade(Step::from_micros(1_000_000 / frames), loss);
                    lasted += 1;
                }
                let error_s = lasted as f64 / frames as f64 - memory_s;
                assert!(error_s.abs() < 0.01 * memory_s + 1.01 / frames as f64, "{memory_s} s at {frames}: {error_s}");
            }
        }
    }

    #[test]
    fn half_of_full_is_occupied() {
        assert_eq!(
            (top_of(0x7777_7777), top_of(0x0000_0008), top_of(0x0000_8000), top_of(u32::MAX)),
            (0, 50, 200, 400)
        );
    }
}
