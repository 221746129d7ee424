//! `radar-3d-risk`: the map of `radar-3d` with bits that keep a risk, by a unit's table of probabilities.

use viewshed::frame::health::Condition;
use viewshed::map::polar::PolarGeometry;
use viewshed::map::query::Footprint;
use viewshed::map::{CellState, VisibilityMap};
use viewshed::probability::Quantiser;
use viewshed::sensor::road::RoadPoint;

use super::Estimator;
use super::radar_3d::{AZIMUTHS, RANGES};
use crate::geometry::solid::Solid;
use crate::recording::Frame;

/// What it is called in tables.
pub const NAME: &str = "radar-3d-risk";

/// The map of `radar-3d`, a cell of which is visible where its probability is high enough: the bits a unit sends.
pub struct AtRisk {
    inner: Box<dyn Estimator>,
    quantiser: Quantiser,
    grid: PolarGeometry,
}

impl AtRisk {
    pub fn new(inner: Box<dyn Estimator>, quantiser: Quantiser, grid: PolarGeometry) -> Self {
        Self { inner, quantiser, grid }
    }
}

impl VisibilityMap for AtRisk {
    fn at(&self, point: RoadPoint) -> CellState {
        self.quantiser.of_point(&self.grid, [RANGES, AZIMUTHS], self.inner.map().at(point), point).0
    }

    fn cells_in(&self, _: &Footprint, visit: &mut dyn FnMut(CellState)) {
        // its table asks of points only
        visit(CellState::UNKNOWN);
    }
}

impl Estimator for AtRisk {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn condition(&self) -> Condition {
        self.inner.condition()
    }

    fn step(&mut self, frame: &Frame) {
        self.inner.step(frame);
    }

    fn map(&self) -> &dyn VisibilityMap {
        self
    }

    fn obstacles(&self) -> Vec<Solid> {
        self.inner.obstacles()
    }

    fn where_seen(&self) -> Vec<Solid> {
        self.inner.where_seen()
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        self.inner.counters()
    }
}

#[cfg(test)]
mod tests {
    use viewshed::Angle;
    use viewshed::map::Visibility;
    use viewshed::probability::{Edges, Probability, ProbabilityTable, Threshold};
    use viewshed::sensor::mount::Mount;

    use super::*;

    /// Unknown behind x = 0, grade 200 before it, 100 beyond 50 m.
    struct Fixed;

    impl VisibilityMap for Fixed {
        fn at(&self, p: RoadPoint) -> CellState {
            let grade = if p.x_cm < 5000 { 200 } else { 100 };
            match p.x_cm {
                ..0 => CellState::UNKNOWN,
                _ => CellState { visibility: Visibility::Visible, grade, occupancy: 0, occupied: false },
            }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    impl Estimator for Fixed {
        fn name(&self) -> &str {
            "fixed"
        }
        fn reset(&mut self) {}
        fn step(&mut self, _: &Frame) {}
        fn map(&self) -> &dyn VisibilityMap {
            self
        }
    }

    #[test]
    fn a_cell_is_visible_where_its_probability_is_high_enough_and_unknown_stays_unknown() {
        let edges = Edges {
            grades: std::array::from_fn(|k| 150 + k as u8),
            ranges_cm: std::array::from_fn(|k| 1000 * (k as u16 + 1)),
            azimuths: std::array::from_fn(|k| k as i16 * 100),
        };
        // low grades 40; high ones 240, and 160 from 20 m on
        let values = [std::array::from_fn(|r| {
            std::array::from_fn(|g| match (g, r) {
                (0, _) => 40,
                (_, 0 | 1) => 240,
                _ => 160,
            })
        }); 8];
        let table = ProbabilityTable::new(edges, values, 0).unwrap();
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let grid = PolarGeometry {
            levelling: mount.levelling().unwrap(),
            cell_cm: 100,
            azimuth_origin: Angle::from_degrees(-60.0),
            azimuth_span: 21_845,
            narrow: viewshed::map::azimuths::Narrow::NONE,
        };
        let at = |x_m: f32, threshold: Threshold| {
            let quantiser = Quantiser::new(table.clone(), Some(threshold), 0);
            let map = AtRisk::new(Box::new(Fixed), quantiser, grid);
            map.at(RoadPoint::from_metres(x_m, 0.0).unwrap()).visibility
        };
        use Visibility::{Invisible, Unknown, Visible};
        assert_eq!([10.0, 30.0, 60.0].map(|x| at(x, Threshold::From(200))), [Visible, Invisible, Invisible]);
        assert_eq!([10.0, 30.0, 60.0].map(|x| at(x, Threshold::From(160))), [Visible, Visible, Invisible]);
        assert_eq!([10.0, 30.0, 60.0].map(|x| at(x, Threshold::Everything)), [Visible; 3]);
        assert_eq!([10.0, 60.0].map(|x| at(x, Threshold::Nothing)), [Invisible; 2]);
        assert_eq!(at(-5.0, Threshold::Everything), Unknown);
        assert_eq!(table.look_up(200, 100, Angle::ZERO), Some(Probability::from_raw(240)));
    }
}
