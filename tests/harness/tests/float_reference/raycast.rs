//! Lines of sight: occupancy in, graded visibility and occupancy at slice height out.

use viewshed::map::{CellState, Visibility};

use crate::grid::{Axes, Grid};

/// Occupancy from which a cell belongs to an object of its own.
const OCCUPIED: f64 = 0.5;

/// The polar result; `None` where nobody has evidence.
#[derive(Debug, Clone)]
pub struct Map {
    ranges: usize,
    grades: Vec<Option<f64>>,
    occupancy: Vec<f64>,
}

impl Map {
    /// Everything is unknown.
    pub fn unknown(axes: &Axes) -> Self {
        let cells = axes.ranges * axes.azimuths;
        Self { ranges: axes.ranges, grades: vec![None; cells], occupancy: vec![0.0; cells] }
    }

    pub fn forget(&mut self) {
        self.grades.fill(None);
        self.occupancy.fill(0.0);
    }

    /// The same grade everywhere.
    #[cfg(test)]
    pub fn fill(&mut self, grade: f64) {
        self.grades.fill(Some(grade));
    }

    pub fn grade(&self, azimuth: usize, range: usize) -> Option<f64> {
        self.grades[azimuth * self.ranges + range]
    }

    /// Grade, where known, and occupancy of a cell, to be changed.
    pub fn cell_mut(&mut self, azimuth: usize, range: usize) -> (&mut Option<f64>, &mut f64) {
        let cell = azimuth * self.ranges + range;
        (&mut self.grades[cell], &mut self.occupancy[cell])
    }

    pub fn occupancy(&self, azimuth: usize, range: usize) -> f64 {
        self.occupancy[azimuth * self.ranges + range]
    }

    /// A cell in the library's terms; thresholds are shares.
    pub fn cell(&self, azimuth: usize, range: usize, visible_from: f64, occupied_from: f64) -> CellState {
        let Some(grade) = self.grade(azimuth, range) else { return CellState::UNKNOWN };
        let occupancy = self.occupancy(azimuth, range);
        let visible = grade >= visible_from;
        CellState {
            visibility: if visible { Visibility::Visible } else { Visibility::Invisible },
            grade: byte(grade).max(1.0) as u8,
            occupancy: byte(occupancy) as u8,
            occupied: occupancy >= occupied_from,
        }
    }
}

/// A share in the library's scale.
pub fn byte(share: f64) -> f64 {
    (share * 255.0).round()
}

/// Casts all rays. What blocks a cell is the largest occupancy among the nearer cells of its row;
/// for a cell of an occupied run, only of those before the run.
pub fn cast(grid: &Grid, axes: &Axes, map: &mut Map) {
    map.forget();
    for (a, view) in axes.view.iter().enumerate() {
        let mut passed = vec![0.0; axes.rows];
        let mut before_run: Option<Vec<f64>> = None;
        for r in 0..axes.ranges {
            let stack = grid.stack(a, r);
            let (lower, share) = axes.slice[r];
            let at_slice = |rows: &[f64]| rows[lower] * (1.0 - share) + rows[lower + 1] * share;
            let here = at_slice(stack);
            if here < OCCUPIED {
                before_run = None;
            } else if before_run.is_none() {
                before_run = Some(passed.clone());
            }
            if view.contains(&r) {
                map.grades[a * axes.ranges + r] = Some(1.0 - at_slice(before_run.as_ref().unwrap_or(&passed)));
            }
            map.occupancy[a * axes.ranges + r] = here;
            for (most, cell) in passed.iter_mut().zip(stack) {
                *most = cell.max(*most);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, AZIMUTHS, IntegerGrid, RANGES, Random, mounts, raise, within};
    use viewshed::map::polar::PolarMap;

    /// The same random occupancy in both grids, `density` of the stacks filled in part.
    fn fill(grid: &mut IntegerGrid, exact: &mut Grid, density: f64, random: &mut Random) {
        for a in 0..AZIMUTHS {
            for r in 0..RANGES {
                if random.between(0.0, 1.0) > density {
                    continue;
                }
                let stack = grid.column_mut(a).and_then(|c| c.evidence(r)).unwrap();
                for (cell, exact) in stack.iter_mut().zip(exact.stack_mut(a, r)) {
                    *cell = random.whole(-100, 255).max(0) as u8;
                    *exact = f64::from(*cell) / 255.0;
                }
            }
        }
    }

    #[test]
    fn the_same_occupancy_gives_the_same_grades() {
        let mut random = Random::new(9);
        let [mut occupancy, mut known, mut sum, mut far_off] = [0.0; 4];
        for mount in mounts() {
            let (axes, exact_axes) = scene::axes(&mount);
            for density in [0.003, 0.03, 0.3] {
                let (mut grid, mut exact_grid) = (Box::<IntegerGrid>::default(), Grid::new(&exact_axes));
                fill(&mut grid, &mut exact_grid, density, &mut random);
                let mut map = Box::new(PolarMap::unknown(axes.polar(&mount.levelling().unwrap()), 128, 128));
                let mut exact = Map::unknown(&exact_axes);
                viewshed::grid::raycast::cast(&grid, &axes, &mut map);
                cast(&exact_grid, &exact_axes, &mut exact);
                for (a, r) in (0..AZIMUTHS).flat_map(|a| (0..RANGES).map(move |r| (a, r))) {
                    let got = map.cell(a, r);
                    let Some(grade) = exact.grade(a, r).filter(|_| got.visibility != Visibility::Unknown) else {
                        continue;
                    };
                    let off = (f64::from(got.grade) - (grade * 255.0).max(1.0)).abs();
                    known += 1.0;
                    sum += off;
                    far_off += f64::from(u8::from(off > 5.0));
                    raise(&mut occupancy, f64::from(got.occupancy) - exact.occupancy(a, r) * 255.0);
                }
            }
        }
        within("occupancy at slice height, steps of 255", occupancy, 4.5);
        within("mean difference of grades, steps of 255", sum / known, 0.5);
        // a run that begins at one and not the other: 1 cell
        within("cells more than 5 steps off", far_off, 3.0);
    }
}
