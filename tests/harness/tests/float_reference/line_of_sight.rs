//! Boxes and their shadows on the map, against the exact line of sight past them.
//!
//! No second pipeline here: a point at slice height is hidden where the straight line from the sensor
//! to it meets a box. The map may place the edge of a shadow a cell off, no more.

#[cfg(test)]
mod tests {
    use viewshed::fixed::angle::Angle;
    use viewshed::fixed::trig;
    use viewshed::grid::raycast::cast;
    use viewshed::grid::shadow;
    use viewshed::map::Visibility;
    use viewshed::map::polar::PolarMap;
    use viewshed::sensor::mount::Mount;
    use viewshed_harness::geometry::solid::Solid;

    use crate::scene::{AZIMUTHS, IntegerAxes, IntegerGrid, RANGES, Random, VIEW, mounts, within};
    use crate::shadow::crossing;

    const SLICE_M: f64 = 1.0;

    /// Height of the slice plane's point and of the sensor; what lies between them.
    struct World {
        sensor_m: f64,
        boxes: Vec<Solid>,
    }

    impl World {
        /// Whether a box stands between the sensor and the point at slice height so far along a bearing.
        fn hidden(&self, bearing: f64, ground: f64) -> bool {
            self.boxes.iter().any(|b| {
                let Some((enter, leave)) = crossing(b, bearing).filter(|c| c.0 < ground) else { return false };
                let height = |at: f64| self.sensor_m + (SLICE_M - self.sensor_m) * at / ground;
                height(enter).min(height(leave.min(ground))) < b.top()
            })
        }

        /// Distance of a point to the nearest footprint.
        fn to_footprint(&self, bearing: f64, ground: f64) -> f64 {
            let p = [ground * bearing.cos(), ground * bearing.sin()];
            self.boxes.iter().map(|b| b.footprint_distance(p)).fold(f64::INFINITY, f64::min)
        }
    }

    /// A box in the library's terms.
    fn integer(b: &Solid) -> viewshed::obstacles::solid::Solid {
        let cm = |m: f64| (m * 100.0).round() as i32;
        viewshed::obstacles::solid::Solid {
            x_cm: cm(b.center[0]),
            y_cm: cm(b.center[1]),
            heading: trig::direction(Angle::from_radians(b.yaw_rad as f32)),
            half_length_cm: cm(b.size[0] / 2.0),
            half_width_cm: cm(b.size[1] / 2.0),
            height_cm: cm(b.top()),
        }
    }

    fn map_of(world: &World, mount: &Mount) -> (Box<IntegerAxes>, Box<PolarMap<RANGES, AZIMUTHS>>) {
        let levelling = mount.levelling().unwrap();
        let axes = Box::new(IntegerAxes::new(&levelling, &VIEW, SLICE_M as f32).unwrap());
        let mut grid = Box::<IntegerGrid>::default();
        let mut map = Box::new(PolarMap::unknown(axes.polar(&levelling), 128, 128));
        cast(&grid, &axes, &mut map);
        world.boxes.iter().for_each(|b| shadow::cast(&integer(b), &axes, &mut grid, &mut map));
        (axes, map)
    }

    /// Cells in free space: all, hidden ones, wrong at their centre, and wrong by more than so many
    /// cells along the ray or half a column across.
    #[derive(Debug, Default)]
    struct Tally {
        free: f64,
        hidden: f64,
        wrong: f64,
        beyond: [f64; 3],
    }

    fn compare(world: &World, mount: &Mount, t: &mut Tally) {
        let (axes, map) = map_of(world, mount);
        let cell_m = f64::from(axes.cell_cm) / 100.0;
        let column = f64::from(axes.azimuth_span) / 65536.0 * std::f64::consts::TAU / AZIMUTHS as f64;
        for (a, r) in (0..AZIMUTHS).flat_map(|a| (0..RANGES).map(move |r| (a, r))) {
            let state = map.cell(a, r);
            let bearing = f64::from(axes.azimuth_of(a as i32 * 256 + 128).radians());
            let ground = (r as f64 + 0.5) * cell_m;
            if state.visibility == Visibility::Unknown || world.to_footprint(bearing, ground) < cell_m {
                continue;
            }
            let hidden = state.visibility == Visibility::Invisible;
            t.free += 1.0;
            t.hidden += f64::from(u8::from(world.hidden(bearing, ground)));
            if hidden == world.hidden(bearing, ground) {
                continue;
            }
            t.wrong += 1.0;
            for (k, cells) in [1.0, 2.0, 3.0].into_iter().enumerate() {
                let around = (-8..=8).flat_map(|i| (-4..=4).map(move |j| (f64::from(i) / 8.0, f64::from(j) / 8.0)));
                let right = |(i, j): (f64, f64)| {
                    hidden == world.hidden(bearing + j * column, (ground + i * cells * cell_m).max(0.01))
                };
                t.beyond[k] += f64::from(u8::from(!around.into_iter().any(right)));
            }
        }
    }

    /// A vehicle somewhere on the road.
    fn any_box(random: &mut Random) -> Solid {
        let (distance, bearing) = (random.between(15.0, 180.0), random.between(-0.9, 0.9));
        let size = [random.between(3.8, 16.5), random.between(1.6, 2.6), random.between(1.3, 4.0)];
        let yaw_rad = random.between(-3.1, 3.1);
        Solid { center: [distance * bearing.cos(), distance * bearing.sin(), size[2] / 2.0], yaw_rad, size }
    }

    fn tally(boxes: usize, worlds: usize, mount: &Mount, random: &mut Random) -> Tally {
        let mut t = Tally::default();
        for _ in 0..worlds {
            let boxes = (0..boxes).map(|_| any_box(random)).collect();
            compare(&World { sensor_m: f64::from(mount.height_m), boxes }, mount, &mut t);
        }
        t
    }

    #[test]
    fn shadows_end_where_the_line_of_sight_says_to_a_cell() {
        let mut random = Random::new(50);
        for mount in mounts() {
            for (boxes, worlds) in [(1, 60), (8, 20)] {
                let t = tally(boxes, worlds, &mount, &mut random);
                println!("{} m, {boxes} boxes: {t:?}", mount.height_m);
                let what = format!("sensor at {} m, {boxes} boxes", mount.height_m);
                // a box narrower than a column hides one of which it need not cover the centre
                within(&format!("{what}: wrong at the centre, % of free cells"), 100.0 * t.wrong / t.free, 0.25);
                within(&format!("{what}: off by more than a cell, % of hidden"), 100.0 * t.beyond[0] / t.hidden, 0.1);
                within(&format!("{what}: off by more than two, % of hidden"), 100.0 * t.beyond[1] / t.hidden, 0.03);
            }
        }
    }
}
