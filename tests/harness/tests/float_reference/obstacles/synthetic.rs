//! A vehicle made up of reflection points, followed in integers and in real numbers.

#[cfg(test)]
mod tests {
    use viewshed::fixed::time::Step;
    use viewshed::frame::by_range::ByRange;
    use viewshed::frame::detection::Measurement;
    use viewshed::frame::reflection::Reflection;
    use viewshed::obstacles::Obstacles as IntegerObstacles;
    use viewshed::obstacles::config::ObstacleConfig;
    use viewshed::obstacles::obstacle::Obstacle as IntegerObstacle;
    use viewshed::sensor::mount::Mount;
    use viewshed::sensor::noise::NoiseConfig;

    use super::super::{Obstacle, Obstacles, Rules};
    use crate::geometry::{Ground, Levelled, Placed, across, along, difference, left, moved, place};
    use crate::scene::{Random, mounts, raise, reflection, within};

    const PERIOD_US: u64 = 66_972;
    const LIMIT_M: f64 = 225.0;

    /// A box on the road, travelling along it.
    struct Vehicle {
        length: f64,
        width: f64,
        /// Road frame: middle at the start, and speed along x.
        start: Ground,
        speed: f64,
    }

    impl Vehicle {
        fn middle(&self, levelled: &Levelled, frame: usize) -> Ground {
            let t = frame as f64 * PERIOD_US as f64 * 1e-6;
            levelled.place([self.start[0] + self.speed * t, self.start[1]])
        }

        /// Noisy reflections of bumpers, axles and corners on both sides.
        fn measured(&self, levelled: &Levelled, frame: usize, random: &mut Random) -> Vec<Measurement> {
            self.measured_at(0.8, levelled, frame, random)
        }

        /// The same at a height.
        fn measured_at(&self, z: f64, levelled: &Levelled, frame: usize, random: &mut Random) -> Vec<Measurement> {
            let axis = levelled.road_axis();
            let middle = self.middle(levelled, frame);
            (0..10)
                .map(|k| {
                    let ahead = (f64::from(k % 5) / 4.0 - 0.5) * self.length;
                    let aside = (f64::from(k / 5) - 0.5) * self.width;
                    let [x, y] = moved(moved(middle, axis, ahead), left(axis), aside);
                    random.measured(levelled, [x, y, z], axis.map(|c| c * self.speed))
                })
                .collect()
        }
    }

    /// Both trackers at the same mount.
    struct Both {
        levelled: Levelled,
        noise: NoiseConfig,
        levelling: viewshed::sensor::mount::Levelling,
        tracking: viewshed::obstacles::parameters::TrackingParameters,
        rules: Rules,
        integer: IntegerObstacles<16>,
        exact: Obstacles,
    }

    impl Both {
        fn new(mount: &Mount) -> Self {
            let (config, noise) = (ObstacleConfig::default(), NoiseConfig::default());
            let (levelled, levelling) = (Levelled::new(mount), mount.levelling().unwrap());
            Self {
                levelled,
                levelling,
                tracking: config.tracking(noise.noise().unwrap(), levelling.road_axis(), LIMIT_M as i32 * 100).unwrap(),
                rules: Rules::new(&config, &noise, levelled.road_axis(), LIMIT_M),
                noise,
                integer: IntegerObstacles::new(),
                exact: Obstacles::new(16),
            }
        }

        fn step(&mut self, measured: &[Measurement]) {
            self.step_with(measured, true);
        }

        fn step_with(&mut self, measured: &[Measurement], in_view: bool) {
            let noise = self.noise.noise().unwrap();
            let reflections: Vec<Reflection> =
                measured.iter().map(|m| reflection(m, &noise, &self.levelling)).collect();
            let step = Step::from_micros(PERIOD_US);
            let sorted = ByRange::<64>::sort(&reflections, self.tracking.limit_cm);
            self.integer.step(&reflections, &sorted, step, &self.tracking, |_, _| in_view);
            let placed: Vec<Placed> = measured.iter().map(|m| place(m, &self.noise, &self.levelled)).collect();
            self.exact.step(&placed, PERIOD_US as f64 * 1e-6, &self.rules, |_| in_view);
        }

        /// The obstacle with the most detections, in integers and in real numbers.
        fn followed(&self) -> (&IntegerObstacle, &Obstacle) {
            let integer = self.integer.iter().max_by_key(|o| o.hits).unwrap();
            (integer, self.exact.list.iter().max_by(|a, b| a.hits.total_cmp(&b.hits)).unwrap())
        }
    }

    fn metres(cm: (i32, i32)) -> Ground {
        [cm.0, cm.1].map(|v| f64::from(v) / 100.0)
    }

    /// What is compared of an obstacle: middle, velocity, length.
    fn state_of(o: &IntegerObstacle) -> (Ground, Ground, f64) {
        let middle = metres(o.global(o.extent.middle_cm(), 0));
        (middle, metres(o.velocity()), f64::from(o.extent.length_cm()) / 100.0)
    }

    /// Largest and mean differences along the road, to the left of travel, in speed and in length.
    #[derive(Default)]
    struct Differences {
        worst: [f64; 4],
        /// Sum of absolute differences, and of signed ones to the left.
        sum: [f64; 4],
        left: f64,
        n: f64,
    }

    impl Differences {
        fn add(&mut self, travel: Ground, a: (Ground, Ground, f64), b: (Ground, Ground, f64)) {
            let (place, velocity) = (difference(a.0, b.0), difference(a.1, b.1));
            let all = [along(travel, place), across(travel, place), along(travel, velocity), a.2 - b.2];
            for (k, off) in all.into_iter().enumerate() {
                raise(&mut self.worst[k], off);
                self.sum[k] += off.abs();
            }
            self.left += all[1];
            self.n += 1.0;
        }

        /// Along and aside in metres, speed in m/s, length in metres: means and worst.
        fn limit(&self, what: &str, means: [f64; 4], worst: [f64; 4]) {
            for (k, name) in ["along", "aside", "speed", "length"].into_iter().enumerate() {
                within(&format!("{what}, {name}, mean"), self.sum[k] / self.n, means[k]);
                within(&format!("{what}, {name}, worst"), self.worst[k], worst[k]);
            }
        }
    }

    #[test]
    fn vehicles_are_followed_alike_and_where_they_are() {
        let vehicles = [
            Vehicle { length: 4.6, width: 1.8, start: [25.0, 5.0], speed: 28.0 },
            Vehicle { length: 13.5, width: 2.5, start: [30.0, -7.0], speed: 24.0 },
            Vehicle { length: 4.6, width: 1.8, start: [160.0, 9.0], speed: -30.0 },
            Vehicle { length: 12.0, width: 2.5, start: [150.0, 12.0], speed: -23.0 },
        ];
        let [mut apart, mut integer_off, mut exact_off] = <[Differences; 3]>::default();
        for (mount, v) in mounts().iter().flat_map(|m| vehicles.iter().map(move |v| (m, v))) {
            let (mut both, mut random) = (Both::new(mount), Random::new(30));
            let axis = both.levelled.road_axis();
            let travel = axis.map(|c| c * v.speed.signum());
            for frame in 0..75 {
                both.step(&v.measured(&both.levelled, frame, &mut random));
                // two seconds until the outline is drawn
                if frame < 30 {
                    continue;
                }
                let (integer, exact) = both.followed();
                let exact = (exact.ahead(exact.extent.middle()), exact.velocity, exact.extent.length());
                let truth = (v.middle(&both.levelled, frame), axis.map(|c| c * v.speed), v.length);
                apart.add(travel, state_of(integer), exact);
                integer_off.add(travel, state_of(integer), truth);
                exact_off.add(travel, exact, truth);
            }
        }
        // a lorry that is followed as two halves side by side is off by half its width
        apart.limit("integer and exact", [0.02, 0.06, 0.009, 0.02], [0.15, 3.0, 0.06, 0.06]);
        within("integer to the right of exact", -apart.left / apart.n, 0.05);
        // bins of half a metre and noise lengthen the outline
        let (means, worst) = ([0.07, 0.35, 0.045, 0.6], [0.2, 1.6, 0.22, 0.75]);
        integer_off.limit("integer and truth", means, worst);
        exact_off.limit("exact and truth", means, worst);
    }

    #[test]
    fn a_slow_car_whose_end_is_hidden_lies_behind_its_side_by_the_same() {
        let car = Vehicle { length: 4.6, width: 0.0, start: [60.0, 5.0], speed: 2.5 };
        for mount in mounts() {
            let aside = |in_view: bool| {
                let (mut both, mut random) = (Both::new(&mount), Random::new(35));
                for frame in 0..150 {
                    both.step_with(&car.measured(&both.levelled, frame, &mut random), in_view);
                }
                let (integer, exact) = both.followed();
                let (integer, exact) = (integer.solid(&both.tracking), exact.solid(&both.rules));
                let middle = car.middle(&both.levelled, 149);
                let off = |x, y| across(both.levelled.road_axis(), difference([x, y], middle));
                let [x, y, _] = exact.center;
                [off(f64::from(integer.x_cm) / 100.0, f64::from(integer.y_cm) / 100.0), off(x, y)]
            };
            let ([hidden, hidden_exact], [seen, seen_exact]) = (aside(false), aside(true));
            within("end hidden, m", (hidden - hidden_exact).abs(), 0.12);
            within("end in sight, m", (seen - seen_exact).abs(), 0.12);
            assert!((hidden - seen).abs() > 0.2, "{hidden} m aside, {seen} m with its end in sight");
        }
    }

    #[test]
    fn a_tall_end_close_before_a_creeping_car_is_the_farther_end_of_its_vehicle_in_both() {
        let car = Vehicle { length: 4.6, width: 1.8, start: [37.2, 5.0], speed: 2.0 };
        for mount in mounts() {
            // nearer face of the end's box, along the road from the middle of the end
            let begins = |with_car: bool| {
                let (mut both, mut random) = (Both::new(&mount), Random::new(36));
                let end = Vehicle { length: 0.5, width: 1.8, start: [30.0, 5.0], speed: 2.0 };
                for frame in 0..100 {
                    let mut measured = end.measured_at(3.5, &both.levelled, frame, &mut random);
                    measured.truncate(5);
                    if with_car {
                        measured.extend(car.measured(&both.levelled, frame, &mut random));
                    }
                    both.step(&measured);
                }
                let (axis, middle) = (both.levelled.road_axis(), end.middle(&both.levelled, 99));
                let toward = along(axis, middle).signum();
                let face = |place: Ground, length: f64| along(axis, difference(place, middle)) * toward - length / 2.0;
                let nearest = |faces: Vec<f64>| faces.into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap();
                let of_end = |height: f64| height > 2.0;
                let integer = both.integer.solids(&both.tracking).filter(|s| of_end(f64::from(s.height_cm) / 100.0));
                let integer = integer.map(|s| face(metres((s.x_cm, s.y_cm)), f64::from(s.half_length_cm) / 50.0));
                let exact = both.exact.solids(&both.rules).filter(|s| of_end(s.size[2]));
                let exact = exact.map(|s| face([s.center[0], s.center[1]], s.size[0]));
                (nearest(integer.collect()), nearest(exact.collect()))
            };
            let ((alone, alone_exact), (before_car, before_car_exact)) = (begins(false), begins(true));
            within("alone, m", (alone - alone_exact).abs(), 0.15);
            within("before a car, m", (before_car - before_car_exact).abs(), 0.15);
            assert!(alone > -1.0 && before_car < -4.0, "from {alone} m, before a car from {before_car} m");
        }
    }

    #[test]
    fn what_reflects_like_a_rider_a_lorry_or_neither_has_the_same_box_in_both() {
        // length and what it reflects; how high its box is at most, where it is low
        let (rider, car) = ((1.2, -7.0), (4.6, 6.0));
        let (strong_van, van, weak_row) = ((6.2, 15.0), (6.2, 7.0), (11.0, 0.0));
        let low = Some(1.6);
        let cases =
            [(rider, Some(1.7)), (car, low), (strong_van, None), (van, low), (weak_row, low), ((11.0, 8.0), None)];
        for (mount, ((length, rcs), height)) in mounts().iter().flat_map(|m| cases.iter().map(move |c| (m, *c))) {
            let (mut both, mut random) = (Both::new(mount), Random::new(37));
            let v = Vehicle { length, width: 0.5, start: [25.0, 5.0], speed: 6.0 };
            for frame in 0..90 {
                let mut measured = v.measured(&both.levelled, frame, &mut random);
                for m in &mut measured {
                    m.rcs_dbsm = Some((rcs + random.normal(1.0) - 1.5) as f32);
                }
                both.step(&measured);
            }
            let (integer, exact) = both.followed();
            let (integer, exact) = (integer.solid(&both.tracking), exact.solid(&both.rules));
            let sizes = [2 * integer.half_length_cm, 2 * integer.half_width_cm, integer.height_cm];
            // an end in another bin lengthens the box by half a metre
            for ((got, exact), limit) in sizes.into_iter().zip(exact.size).zip([0.55, 0.1, 0.2]) {
                within("size, m", (f64::from(got) / 100.0 - exact).abs(), limit);
            }
            let found = f64::from(integer.height_cm) / 100.0;
            match height {
                Some(height) => assert!(found <= height, "{length} m, {rcs} dBsm: {found} m high"),
                None => assert!(found > 2.2, "{length} m, {rcs} dBsm: {found} m high"),
            }
            assert_eq!(sizes[1] < 100, rcs < -3.0, "{length} m, {rcs} dBsm: {sizes:?} cm");
        }
    }

    #[test]
    fn an_unseen_vehicle_is_given_up_at_the_same_frame() {
        let car = Vehicle { length: 4.6, width: 1.8, start: [30.0, 5.0], speed: 10.0 };
        let c = ObstacleConfig::default();
        for (seen, in_view) in [(2, true), (30, true), (30, false)] {
            // two detections a frame up to the most; then down at one rate, and unconfirmed at another
            let evidence = f64::from((2 * seen) as f32).min(f64::from(c.max_evidence));
            let loss = f64::from(if in_view { c.visible_loss_per_s } else { c.hidden_loss_per_s });
            let confirmed = f64::from(c.confirm_hits);
            let seconds = (evidence - confirmed) / loss + confirmed / f64::from(c.tentative_loss_per_s);
            let expected = (seconds / (PERIOD_US as f64 * 1e-6)) as usize;
            let (mut both, mut random) = (Both::new(&mounts()[0]), Random::new(32));
            for frame in 0..seen {
                both.step(&car.measured(&both.levelled, frame, &mut random)[..2]);
            }
            let mut followed = [0_usize; 2];
            for _ in 0..200 {
                let nothing = ByRange::<64>::sort(&[], both.tracking.limit_cm);
                both.integer.step(&[], &nothing, Step::from_micros(PERIOD_US), &both.tracking, |_, _| in_view);
                both.exact.step(&[], PERIOD_US as f64 * 1e-6, &both.rules, |_| in_view);
                followed[0] += usize::from(both.integer.iter().count() > 0);
                followed[1] += usize::from(!both.exact.list.is_empty());
            }
            assert!(followed[1].abs_diff(expected) <= 1, "{followed:?} frames, not {expected}");
            assert!(followed[0].abs_diff(followed[1]) <= 1, "{followed:?} frames");
        }
    }

    #[test]
    fn parts_are_joined_and_neighbours_are_not() {
        // bumpers may lie as far apart as vehicles never keep for long at this speed
        let apart = |speed: f64| {
            let c = ObstacleConfig::default();
            f64::from(c.standstill_m) + f64::from(c.coupled_headway_s) * speed
        };
        let cases = [
            (apart(22.0) - 1.5, 22.0, 1),
            (apart(22.0) + 1.5, 22.0, 2),
            (apart(10.0) - 1.5, 10.0, 1),
            (apart(10.0) + 1.5, 10.0, 2),
        ];
        for (length, speed, expected) in cases {
            let van = Vehicle { length, width: 2.0, start: [60.0, 5.0], speed };
            let (mut both, mut random) = (Both::new(&mounts()[0]), Random::new(33));
            for frame in 0..45 {
                let measured = van.measured(&both.levelled, frame, &mut random);
                // bumpers only
                let ends: Vec<Measurement> = [0, 4, 5, 9].map(|k| measured[k]).into();
                both.step(&ends);
            }
            let lengths = both.integer.iter().map(|o| f64::from(o.extent.length_cm()) / 100.0);
            let found: Vec<(f64, f64)> = lengths.zip(both.exact.list.iter().map(|o| o.extent.length())).collect();
            assert_eq!(
                (both.integer.iter().count(), both.exact.list.len()),
                (expected, expected),
                "{length} m at {speed} m/s"
            );
            for (got, exact) in found {
                within("length, m", (got - exact).abs(), 0.05);
            }
        }
    }

    #[test]
    fn an_unseen_obstacle_coasts_to_the_same_place() {
        let mut random = Random::new(31);
        for mount in mounts() {
            let both = Both::new(&mount);
            let seed = random.measured(&both.levelled, [60.0, 5.0, 0.8], [20.0, 0.0]);
            let reflection = reflection(&seed, &both.noise.noise().unwrap(), &both.levelling);
            let mut integer = IntegerObstacle::new(&reflection, both.tracking.road, 2500);
            let mut exact = Obstacle::new(&place(&seed, &both.noise, &both.levelled), both.rules.road, 25.0);
            let step = Step::from_micros(PERIOD_US);
            for _ in 0..15 {
                integer.predict(step, both.tracking.kept_over(step).lateral, &both.tracking);
                exact.predict(PERIOD_US as f64 * 1e-6, &both.rules);
            }
            let off = difference(metres(integer.anchor()), exact.anchor);
            within("after 25 m, m", off[0].hypot(off[1]), 0.03);
        }
    }
}
