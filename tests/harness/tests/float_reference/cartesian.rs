//! The flat grid's Gaussian around a detection, in integers and by its formula.

use viewshed::radar_2d::cartesian::CartesianConfig;
use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::{Ground, Placed, across, along, difference};

/// Standard deviations at which the Gaussian is cut off.
const REACH: f64 = 1.5;

/// Occupancy that one detection gives the cell with this centre; levelled frame.
pub fn occupancy(d: &Placed, centre: Ground, noise: &NoiseConfig, config: &CartesianConfig) -> f64 {
    // a cell is no point: its own spread, a side over the root of twelve, joins the noise
    let spread = |sigma: f64| sigma.hypot(12.0_f64.sqrt().recip());
    let ground = d.ground();
    let sight = d.at.map(|c| c / ground);
    let off = difference(centre, d.at);
    let [ahead, aside] =
        [along(sight, off) / spread(f64::from(noise.range_m)), across(sight, off) / spread(d.sigma_across)];
    let square = ahead * ahead + aside * aside;
    if square > REACH * REACH { 0.0 } else { f64::from(config.peak) * (-0.5 * square).exp() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Levelled, place};
    use crate::scene::{self, Random, mounts, within};
    use viewshed::radar_2d::cartesian::CartesianGrid;
    use viewshed::sensor::road::RoadPoint;

    /// Cells of the grid along and across the road, in eights.
    const NX: usize = 512;
    const NW: usize = 64;

    #[test]
    fn a_detection_raises_the_same_cells() {
        let (config, noise) = (CartesianConfig::default(), NoiseConfig::default());
        let noises = noise.noise().unwrap();
        let mut random = Random::new(60);
        let (mut sum, mut n, mut centre_off, mut detections) = (0.0, 0.0, 0.0, 0.0);
        for mount in mounts() {
            let (levelled, levelling) = (Levelled::new(&mount), mount.levelling().unwrap());
            let corner = |x, y| RoadPoint::new(levelling.origin().x_cm + x, levelling.origin().y_cm + y);
            let corners = [corner(-20_000, -20_000), corner(20_000, 20_000)].into_iter();
            let p = config.parameters::<NX, NW>(corners, 200.0).unwrap();
            let mut grid = Box::<CartesianGrid<NX, NW>>::default();
            for _ in 0..60 {
                let m = random.reflection(&levelled);
                let d = place(&m, &noise, &levelled);
                grid.clear();
                grid.add(&scene::reflection(&m, &noises, &levelling), &noises, &levelling, &p);
                // integer weight and its centre, and the formula's
                let mut centres = [[0.0; 3]; 2];
                let middle = levelling.unplace((d.at[0] * 100.0) as i32, (d.at[1] * 100.0) as i32);
                let (ci, cj) = (middle.x_cm.div_euclid(100), middle.y_cm.div_euclid(100));
                for (i, j) in (ci - 10..=ci + 10).flat_map(|i| (cj - 10..=cj + 10).map(move |j| (i, j))) {
                    let at = levelled.place([f64::from(i) + 0.5, f64::from(j) + 0.5]);
                    let exact = occupancy(&d, at, &noise, &config) * 255.0;
                    let got = f64::from(grid.occupancy(i, j, &p).unwrap());
                    if got > 0.0 || exact > 0.0 {
                        sum += (got - exact).abs();
                        n += 1.0;
                    }
                    for (c, weight) in centres.iter_mut().zip([got, exact]) {
                        *c = [c[0] + weight, c[1] + weight * at[0], c[2] + weight * at[1]];
                    }
                }
                if centres.iter().any(|c| c[0] == 0.0) {
                    // a detection at a corner reaches no centre: in one and not the other, its only cell
                    continue;
                }
                let [got, exact] = centres.map(|c| [c[1] / c[0], c[2] / c[0]]);
                let off = difference(got, exact);
                centre_off += off[0].hypot(off[1]);
                detections += 1.0;
            }
        }
        assert!(detections > 150.0);
        // distances are in quarters of a standard deviation
        within("mean difference, steps of 255", sum / n, 20.0);
        within("centres apart, mean, m", centre_off / detections, 0.2);
    }
}
