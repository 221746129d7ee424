//! The visibility grid as it is computed: azimuth against ground range.

use viewshed::map::CellState;

use super::axes::{BELOW_PX, LEFT_PX, Plot, RIGHT_PX};
use super::canvas::{Area, Canvas, Colour};
use super::cells::{self, Carries};
use super::legend::{Surround, WIDTH_PX};
use crate::geometry::azimuths::bearing_rad;

const HEIGHT_PX: i32 = 620;

/// A polar grid. The plot shows ground range to the right, azimuth (+ left) up.
pub struct PolarGrid<'a> {
    /// Rows, the first at `azimuth_rad[0]`.
    pub azimuths: usize,
    /// Columns, the first at `range_m[0]`.
    pub ranges: usize,
    /// Outer edges of the first and last row, radians, + left.
    pub azimuth_rad: [f64; 2],
    /// The first row that is narrower than the others, the first behind them, how many times.
    pub narrow: [u8; 3],
    /// Outer edges of the first and last column, metres over ground.
    pub range_m: [f64; 2],
    /// State of (row, column).
    pub state: &'a dyn Fn(usize, usize) -> CellState,
    pub carries: Carries,
    /// Recording, estimator, time.
    pub title: String,
    /// What has to be said of the data.
    pub caption: Option<String>,
}

/// Draws a polar grid, 1400 px wide.
pub fn draw(grid: &PolarGrid) -> Canvas {
    let (surround, plot) = layout(grid);
    let bottom = plot.area.bottom() + BELOW_PX;
    let mut canvas = Canvas::new(WIDTH_PX, bottom + surround.below_px());
    surround.draw(&mut canvas, bottom);
    let edge = |[lo, hi]: [f64; 2], k: usize, of: usize| lo + (hi - lo) * k as f64 / of as f64;
    for row in 0..grid.azimuths {
        let y = [row, row + 1].map(|k| bearing_rad(plot.y, grid.narrow, grid.azimuths, k as f64));
        for column in 0..grid.ranges {
            let x = [column, column + 1].map(|k| edge(plot.x, k, grid.ranges));
            cells::fill(&mut canvas, &plot, x, y, &(grid.state)(row, column));
        }
    }
    plot.grid(&mut canvas, Colour::hex(0x3C434C).opacity(38));
    plot.axes(&mut canvas, "ground range (m)", "azimuth (degrees, + left)");
    canvas
}

fn layout(grid: &PolarGrid) -> (Surround, Plot) {
    let surround = Surround {
        title: grid.title.clone(),
        caption: grid.caption.clone(),
        legend: vec![cells::legend(grid.carries)],
    };
    let area = Area::new(LEFT_PX, surround.above_px(), WIDTH_PX - LEFT_PX - RIGHT_PX, HEIGHT_PX);
    (surround, Plot { area, x: grid.range_m, y: grid.azimuth_rad.map(f64::to_degrees) })
}

#[cfg(test)]
mod tests {
    use viewshed::map::Visibility;

    use super::*;
    use crate::geometry::azimuths::EVEN;
    use crate::results::pictures::palette;

    #[test]
    fn the_first_row_is_at_the_bottom_and_the_first_column_at_the_left() {
        let of = |visibility| CellState { visibility, grade: 0, occupancy: 0, occupied: false };
        let state = |row, column| {
            of(if (row, column) == (0, 0) {
                Visibility::Visible
            } else if row == 3 {
                Visibility::Invisible
            } else {
                Visibility::Unknown
            })
        };
        let grid = PolarGrid {
            azimuths: 4,
            ranges: 5,
            azimuth_rad: [-0.5, 0.5],
            narrow: EVEN,
            range_m: [0.0, 100.0],
            state: &state,
            carries: Carries::ALL,
            title: "title".into(),
            caption: None,
        };
        let (canvas, (_, plot)) = (draw(&grid), layout(&grid));
        let shown = |range_m: f64, azimuth_deg: f64, visibility| {
            let [x, y] = plot.at([range_m, azimuth_deg]).map(|v| v as i32);
            let expected = of(visibility);
            // off the grid lines
            (0..9).filter(|k| canvas.pixel(x + k, y + 2 * k) == palette::ground(&expected, x + k, y + 2 * k)).count()
                > 5
        };
        assert!(shown(7.0, -22.0, Visibility::Visible));
        assert!(shown(7.0, 22.0, Visibility::Invisible) && shown(90.0, 22.0, Visibility::Invisible));
        assert!(shown(90.0, -22.0, Visibility::Unknown));
        assert_eq!(plot.at([0.0, 0.0])[1] as i32, plot.area.top + plot.area.height / 2);
    }
}
