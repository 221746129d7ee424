//! The whole pipeline in integers and in double precision on random traffic, at every mount.

#[cfg(test)]
mod tests {
    use viewshed::fixed::time::Time;
    use viewshed::frame::detection::{Detection, Measurement};
    use viewshed::grid::settling::SettlingConfig;
    use viewshed::map::polar::PolarMap;
    use viewshed::map::{CellState, Visibility};
    use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters};
    use viewshed::sensor::Sensor;
    use viewshed::sensor::mount::Mount;
    use viewshed::sensor::noise::NoiseConfig;
    use viewshed::unit::profile::reference::State;

    use crate::geometry::{Ground, Levelled, left, moved};
    use crate::pipeline::Pipeline;
    use crate::scene::{AZIMUTHS, ELEVATIONS, RANGES, Random, VIEW, mounts, within};

    const PERIOD_US: u64 = 66_667;
    /// Frames before the first that is compared, and all.
    const FRAMES: (u64, u64) = (30, 75);

    /// A box on the road that drives along it; road frame.
    struct Vehicle {
        middle: Ground,
        size: Ground,
        speed: f64,
        /// What it reflects, dBsm.
        rcs: f64,
    }

    /// Cars, lorries and posts beside the road.
    struct Scene {
        vehicles: Vec<Vehicle>,
        posts: Vec<Ground>,
        has_elevation: bool,
    }

    impl Scene {
        fn new(random: &mut Random, has_elevation: bool) -> Self {
            let vehicles = (0..14).map(|k| {
                // none through a sensor
                let lane = [-10.0, -6.5, 1.0, 4.5][k % 4];
                let speed = random.between(18.0, 33.0) * f64::signum(-1.0 - lane);
                let (size, rcs) = match random.whole(0, 4) {
                    0 | 1 => ([random.between(6.0, 16.5), 2.5], random.between(5.0, 20.0)),
                    2 => ([1.5, 0.6], random.between(-12.0, 0.0)),
                    _ => ([4.5, 1.8], random.between(-2.0, 13.0)),
                };
                // an even spacing keeps lanes apart from start to end
                let middle = [20.0 + 50.0 * (k / 4) as f64 + random.between(-15.0, 15.0), lane];
                Vehicle { middle, size, speed, rcs }
            });
            let posts = (0..12).map(|k| [20.0 * f64::from(k), if k % 2 == 0 { 12.0 } else { -14.0 }]);
            Self { vehicles: vehicles.collect(), posts: posts.collect(), has_elevation }
        }

        /// What a sensor measures at a time: a third of all points on both sides of every vehicle.
        fn measured(&self, levelled: &Levelled, seconds: f64, random: &mut Random) -> Vec<Measurement> {
            let axis = levelled.road_axis();
            let mut points = Vec::new();
            for v in &self.vehicles {
                let middle = levelled.place([v.middle[0] + v.speed * seconds, v.middle[1]]);
                for k in 0..12 {
                    let ahead = (f64::from(k % 6) / 5.0 - 0.5) * v.size[0];
                    let aside = (f64::from(k / 6) - 0.5) * v.size[1];
                    points.push((moved(moved(middle, axis, ahead), left(axis), aside), 0.8, v.speed, v.rcs));
                }
            }
            points.extend(self.posts.iter().map(|p| (levelled.place(*p), 1.6, 0.0, 0.0)));
            points.retain(|_| random.whole(0, 2) == 0);
            points
                .into_iter()
                .map(|([x, y], z, speed, rcs)| {
                    let m = random.measured(levelled, [x, y, z], axis.map(|c| c * speed));
                    let rcs_dbsm = Some((rcs + random.normal(4.0)) as f32);
                    Measurement { elevation_rad: m.elevation_rad.filter(|_| self.has_elevation), rcs_dbsm, ..m }
                })
                .collect()
        }
    }

    /// Cells of all compared frames: known to either, to one only, invisible to either, with different
    /// bits; sum of differences of grades.
    #[derive(Default)]
    struct Tally {
        known: f64,
        one_sided: f64,
        invisible: f64,
        differ: f64,
        off: f64,
    }

    impl Tally {
        fn add(&mut self, a: CellState, b: CellState) {
            let known = |c: CellState| c.visibility != Visibility::Unknown;
            let count = |yes: bool| f64::from(u8::from(yes));
            self.known += count(known(a) || known(b));
            self.one_sided += count(known(a) != known(b));
            if known(a) && known(b) {
                self.invisible += count(!a.visible() || !b.visible());
                self.differ += count(a.visible() != b.visible());
                self.off += f64::from(a.grade.abs_diff(b.grade));
            }
        }
    }

    fn drive(mount: &Mount, scene: &Scene, random: &mut Random, tally: &mut Tally) {
        let sensor = Sensor { mount: *mount, field_of_view: VIEW, noise: NoiseConfig::default() };
        let config = Radar3dConfig { settling: SettlingConfig::AT_ONCE, ..Radar3dConfig::default() };
        let p = Box::new(Radar3dParameters::<RANGES, AZIMUTHS, ELEVATIONS>::new(&sensor, &config).unwrap());
        let mut map: Box<PolarMap<RANGES, AZIMUTHS>> = Box::new(p.map());
        let mut state = Box::new(State::new());
        let mut exact = Pipeline::new(&sensor, &config);
        let levelled = Levelled::new(mount);
        for frame in 0..FRAMES.1 {
            let now = Time::from_micros(1_000_000 + frame * PERIOD_US);
            let measured = scene.measured(&levelled, (frame * PERIOD_US) as f64 * 1e-6, random);
            let detections: Vec<Detection> = measured.iter().filter_map(|m| Detection::new(m).ok()).collect();
            state.process(&p, now, &detections, false, &mut map);
            exact.process(now, &measured);
            if frame < FRAMES.0 {
                continue;
            }
            for (a, r) in (0..AZIMUTHS).flat_map(|a| (0..RANGES).map(move |r| (a, r))) {
                tally.add(map.cell(a, r), exact.cell(a, r));
            }
        }
    }

    #[test]
    fn maps_agree_on_random_traffic_at_every_mount_with_and_without_elevation() {
        let mut random = Random::new(40);
        for (name, has_elevation) in [("elevation", true), ("no elevation", false)] {
            let mut t = Tally::default();
            for mount in mounts() {
                for _ in 0..4 {
                    let scene = Scene::new(&mut random, has_elevation);
                    drive(&mount, &scene, &mut random, &mut t);
                }
            }
            println!("{name}: {:.1} % of known cells invisible", 100.0 * t.invisible / t.known);
            assert!(t.invisible > 0.05 * t.known);
            within(&format!("{name}: known to one only, % of known"), 100.0 * t.one_sided / t.known, 0.02);
            within(&format!("{name}: bits that differ, % of known"), 100.0 * t.differ / t.known, 0.4);
            within(&format!("{name}: bits that differ, % of invisible"), 100.0 * t.differ / t.invisible, 3.0);
            within(&format!("{name}: grades, steps of 255"), t.off / t.known, 1.2);
        }
    }
}
