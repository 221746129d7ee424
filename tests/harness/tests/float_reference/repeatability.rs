//! The azimuth's noise, as fixtures show it.

use viewshed::sensor::noise::NoiseConfig;

use crate::geometry::Placed;

/// Within this of another's range nobody can tell the two apart, metres; and how near a thing may be, how far.
const ALONE_M: f64 = 1.0;
const REACH_M: [f64; 2] = [10.0, 256.0];
/// Median of the difference of two measurements, in standard deviations of one.
const MEDIAN: f64 = 0.674_49 * std::f64::consts::SQRT_2;

#[derive(Default)]
pub struct Repeatability {
    /// Of the last frame.
    fixtures: Vec<Placed>,
    /// Standard deviation, radians, once there was a pair.
    pub azimuth_rad: Option<f64>,
    pairs: u32,
}

impl Repeatability {
    /// The configured noise, its azimuth as fixtures have shown it and half as much again.
    pub fn noise(&self, configured: &NoiseConfig) -> NoiseConfig {
        let shown = self.azimuth_rad.map_or(f64::INFINITY, |v| 1.5 * v.to_degrees());
        NoiseConfig { azimuth_deg: shown.min(f64::from(configured.azimuth_deg)) as f32, ..*configured }
    }

    pub fn compare(&mut self, placed: &[Placed], configured: &NoiseConfig) {
        let same = |a: &Placed, b: &Placed| (a.ground() - b.ground()).abs() <= ALONE_M;
        let alone = |d: &&Placed| placed.iter().filter(|other| same(d, other)).count() == 1;
        let slow = 2.0 * f64::from(configured.radial_velocity_mps);
        let unmoving = |d: &&Placed| d.radial_velocity.abs() <= slow;
        let in_reach = |d: &&Placed| (REACH_M[0]..REACH_M[1]).contains(&d.ground());
        let fixtures: Vec<Placed> = placed.iter().filter(in_reach).filter(unmoving).filter(alone).copied().collect();
        for d in &fixtures {
            let before: Vec<&Placed> = self.fixtures.iter().filter(|other| same(d, other)).collect();
            if let [before] = before[..] {
                let bearing = |p: &Placed| p.sight[1].atan2(p.sight[0]);
                let difference = (bearing(d) - bearing(before)).abs();
                self.learn(difference, f64::from(configured.azimuth_deg).to_radians());
            }
        }
        self.fixtures = fixtures;
    }

    fn learn(&mut self, difference: f64, configured: f64) {
        let estimate = self.azimuth_rad.unwrap_or(configured);
        let step = estimate / 2_f64.powi((5 + self.pairs / 256).min(8) as i32);
        let moved = if difference > MEDIAN * estimate { estimate + step } else { estimate - step };
        self.azimuth_rad = Some(moved.clamp(configured / 4.0, configured));
        self.pairs += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Levelled, place};
    use crate::scene::{Random, mounts, reflection, within};
    use viewshed::frame::by_range::ByRange;
    use viewshed::frame::detection::Measurement;

    /// Posts every 4 m, a vehicle and a pair at one range, from every mount.
    #[test]
    fn both_learn_the_same_noise() {
        let configured = NoiseConfig::default();
        let integer = configured.noise().unwrap();
        let mut random = Random::new(7);
        let mut worst = 0.0_f64;
        for (mount, noise_deg) in mounts().into_iter().zip([0.15, 0.2, 0.3].into_iter().cycle()) {
            let (levelled, levelling) = (Levelled::new(&mount), mount.levelling().unwrap());
            let (mut exact, mut got) = (Repeatability::default(), viewshed::frame::repeatability::Repeatability::new());
            for _ in 0..60 {
                let measured: Vec<Measurement> = (0..30)
                    .map(|k| {
                        let off = random.normal(noise_deg);
                        Measurement {
                            range_m: 20.0 + 4.0 * k as f32,
                            azimuth_rad: ((f64::from(k * 29 % 80) - 40.0) + off).to_radians() as f32,
                            elevation_rad: None,
                            radial_velocity_mps: if k % 10 == 3 { 20.0 } else { 0.1 },
                            ..random.measurement()
                        }
                    })
                    .collect();
                let placed: Vec<_> = measured.iter().map(|m| place(m, &configured, &levelled)).collect();
                exact.compare(&placed, &configured);
                let reflections: Vec<_> = measured.iter().map(|m| reflection(m, &integer, &levelling)).collect();
                got.compare(&reflections, &ByRange::<64>::sort(&reflections, 22_500), &integer);
            }
            let learnt = f64::from(got.noise(&integer).azimuth_deg());
            let shown = f64::from(exact.noise(&configured).azimuth_deg);
            worst = worst.max((learnt / shown - 1.0).abs());
            assert!((shown / 1.5 / noise_deg - 1.0).abs() < 0.2, "{shown} degrees of {noise_deg}");
        }
        within("noise learnt, share of it", worst, 0.03);
    }
}
