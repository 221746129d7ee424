//! Every path by which a scatterer returns power: straight, by the road, by mirrors.
//!
//! # Model
//! One way, the field at a scatterer is the straight wave plus the one thrown on by the road,
//! `1 + g R exp(j k d)` (R the road's reflection, d the difference of the ways, g the ratio of gains); back
//! it goes the same ways, so the two-way amplitude is the square: visible targets lobe and fade, hidden ones
//! come back by the road alone, weaker and from below. The elevation that is measured is pulled from the
//! target towards its image by the same ratio (glint). Where the ways differ by more than a range cell, the
//! mixed path is an echo of its own.
//!
//! # References
//! - D. Barton, "Low-Angle Radar Tracking", Proc. IEEE 62 (1974): lobing and elevation glint.
//! - A. Locatelli et al., "Multipath Model Improvement for Automotive Radar Application", EuCAP 2024.

use super::Radar;
use super::echo::{Echo, Seen, fading, radial};
use super::mirrors;
use crate::twin::random::Dice;
use crate::twin::scatter::Scatterer;
use crate::twin::world::World;

/// Echoes weaker than this are not followed, of the noise's power: nothing is detected at a tenth of it.
const FAINTEST: f64 = 0.1;
/// Farthest the measured elevation swings beyond target or image, in their distance.
const GLINT: f64 = 1.0;

/// All echoes of one instant; `noise` is the noise's power, 1 where nothing disturbs.
pub fn collect(radar: &Radar, world: &World, returns: &[&[Scatterer]], noise: f64, dice: &mut Dice) -> Vec<Echo> {
    let mut echoes = Vec::new();
    let mut strong: Vec<(usize, Seen)> = Vec::new();
    for (body, points) in returns.iter().enumerate() {
        for point in *points {
            // the same number of draws for every point, whatever becomes of it
            let fade = fading(radar.model.fading.shape, dice);
            let phase = std::f64::consts::TAU * dice.uniform();
            let wheel = dice.between(-1.0, 1.0);
            let Some(seen) = look(radar, world, body, point, wheel) else { continue };
            let power = |seen: &Seen| {
                let snr_db = radar.snr_db(seen.rcs_dbsm, seen.seen.range_m, 2.0 * seen.gain_db);
                10_f64.powf(snr_db / 10.0) / noise
            };
            // lobing can raise the power sixteenfold at most
            let mean = power(&seen);
            if mean * fade < FAINTEST / 16.0 {
                continue;
            }
            let in_sight = world.in_sight(body, seen.place, seen.inside);
            ways(radar, world, body, &seen, in_sight, (mean * fade).sqrt(), phase, &mut echoes);
            if in_sight && mean > mirrors::FAINTEST {
                strong.push((body, seen));
            }
        }
    }
    mirrors::ghosts(radar, world, &strong, noise, dice, &mut echoes);
    echoes.retain(|e| e.power() >= FAINTEST);
    echoes
}

/// A scatterer as the sensor would see it with nothing in between; `None` outside of the field of view and
/// where it turns away.
fn look(radar: &Radar, world: &World, body: usize, point: &Scatterer, wheel: f64) -> Option<Seen> {
    let place = world.place(body, point.position);
    let seen = radar.pose.to_spherical(place);
    let view = &radar.field_of_view;
    if seen.range_m > view.range_m[1] || !(view.azimuth_rad[0]..=view.azimuth_rad[1]).contains(&seen.azimuth_rad) {
        return None;
    }
    let eye = world.eye();
    let fall_db = aspect_db(point, world.bodies[body].solid.yaw_rad, place, eye)?;
    let [vx, vy] = world.bodies[body].velocity;
    let factor = if point.wheel { 1.0 + wheel * radar.model.fading.wheel_spread } else { 1.0 };
    Some(Seen {
        place,
        seen,
        velocity: [vx * factor, vy * factor],
        rcs_dbsm: point.rcs_dbsm + fall_db,
        gain_db: radar.model.antenna.gain_db(seen.azimuth_rad, seen.elevation_rad),
        inside: point.inside,
    })
}

/// How much less a scatterer returns towards a place than straight, dB; `None` where it faces away.
pub fn aspect_db(point: &Scatterer, yaw_rad: f64, place: [f64; 3], toward: [f64; 3]) -> Option<f64> {
    let Some([ahead, left]) = point.outward else { return Some(0.0) };
    let (s, c) = yaw_rad.sin_cos();
    let outward = [c * ahead - s * left, s * ahead + c * left];
    let d = [0, 1, 2].map(|i| toward[i] - place[i]);
    let cosine = (outward[0] * d[0] + outward[1] * d[1]) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    (cosine > 0.0).then(|| 10.0 * point.sharpness * cosine.log10())
}

/// Adds the echoes of one scatterer by the straight way and by the road.
#[allow(clippy::too_many_arguments)]
fn ways(
    radar: &Radar,
    world: &World,
    body: usize,
    seen: &Seen,
    in_sight: bool,
    amplitude: f64,
    phase: f64,
    echoes: &mut Vec<Echo>,
) {
    let image = world.mirrored(seen.place);
    let below = radar.pose.to_spherical(image);
    let eye = world.eye();
    let sine = world.fall_by_road(seen.place) / below.range_m;
    let road = radar.model.road.reflection(sine, radar.model.wavelength_m);
    let by_road = road != 0.0 && world.in_sight_by_road(body, seen.place, seen.inside);
    if !in_sight && !by_road {
        return;
    }
    let velocity_mps = radial(seen.place, seen.velocity, eye);
    let mut add = |range_m: f64, elevation_rad: f64, [re, im]: [f64; 2]| {
        let (s, c) = phase.sin_cos();
        let turned = [re * c - im * s, re * s + im * c].map(|v| v * amplitude);
        let azimuth_rad = seen.seen.azimuth_rad;
        echoes.push(Echo { range_m, azimuth_rad, elevation_rad, velocity_mps, amplitude: turned });
    };
    if !by_road {
        return add(seen.seen.range_m, seen.seen.elevation_rad, [1.0, 0.0]);
    }
    let gain_db = radar.model.antenna.gain_db(below.azimuth_rad, below.elevation_rad) - seen.gain_db;
    let strength = road * 10_f64.powf(gain_db / 20.0) * seen.seen.range_m / below.range_m;
    let difference_m = below.range_m - seen.seen.range_m;
    let (s, c) = (std::f64::consts::TAU / radar.model.wavelength_m * difference_m).sin_cos();
    let thrown = [strength * c, strength * s];
    let square = |[re, im]: [f64; 2]| [re * re - im * im, 2.0 * re * im];
    if !in_sight {
        return add(below.range_m, below.elevation_rad, square(thrown));
    }
    let apart_rad = below.elevation_rad - seen.seen.elevation_rad;
    if difference_m > radar.model.resolution.range_m {
        add(seen.seen.range_m, seen.seen.elevation_rad, [1.0, 0.0]);
        let middle_m = seen.seen.range_m + difference_m / 2.0;
        return add(middle_m, seen.seen.elevation_rad + apart_rad / 2.0, thrown.map(|v| 2.0 * v));
    }
    let sum = [1.0 + thrown[0], thrown[1]];
    // real part of thrown / sum: how far the front of the wave is tilted towards the image
    let pull = (thrown[0] * sum[0] + thrown[1] * sum[1]) / (sum[0].powi(2) + sum[1].powi(2)).max(1e-6);
    let pull = pull.clamp(-GLINT, 1.0 + GLINT);
    add(seen.seen.range_m, seen.seen.elevation_rad + pull * apart_rad, square(sum));
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{Scene, radar};
    use super::*;
    use crate::twin::random::Use;
    use crate::twin::road::Road;
    use crate::twin::traffic::types::Class;

    fn mean_power(scene: &Scene, adjust: impl Fn(&mut Radar)) -> f64 {
        let mut radar = radar();
        adjust(&mut radar);
        let mut sum = 0.0;
        for n in 0..200 {
            let mut dice = Dice::new(1, Use::RadarFrame, n);
            scene.with(&radar, |world, returns| {
                sum += collect(&radar, world, returns, 1.0, &mut dice).iter().map(Echo::power).sum::<f64>();
            });
        }
        sum / 200.0
    }

    #[test]
    fn a_hidden_car_returns_by_the_road_only() {
        let truck = (Class::Truck, [150.0, 0.0], [0.0, 0.0]);
        let car = (Class::Car, [165.0, 0.0], [0.0, 0.0]);
        let of_car = |bodies: &[_], adjust: &dyn Fn(&mut Radar)| {
            mean_power(&Scene::new(bodies), adjust) - mean_power(&Scene::new(&bodies[..bodies.len() - 1]), adjust)
        };
        let dry = |r: &mut Radar| r.model.road = Road { permittivity: 0.0, ..Road::default() };
        let free = of_car(&[car], &dry);
        let hidden = of_car(&[truck, car], &dry);
        let beneath = of_car(&[truck, car], &|_| ());
        assert!(hidden.abs() < 1e-6 * free, "{hidden} of {free}");
        assert!(beneath > 1e-4 * free && beneath < free, "{beneath} of {free}");
    }

    #[test]
    fn fading_has_mean_one_and_the_variance_of_its_shape() {
        let mut dice = Dice::new(1, Use::RadarFrame, 1);
        for (shape, variance) in [(0, 0.0), (1, 1.0), (2, 0.5)] {
            let draws: Vec<f64> = (0..40_000).map(|_| fading(shape, &mut dice)).collect();
            let mean = draws.iter().sum::<f64>() / 40_000.0;
            let spread = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 40_000.0;
            assert!((mean - 1.0).abs() < 0.02 && (spread - variance).abs() < 0.05, "{shape}: {mean} {spread}");
        }
    }

    #[test]
    fn receding_is_positive_and_crossing_is_nothing() {
        assert_eq!(radial([30.0, 0.0, 0.0], [10.0, 0.0], [0.0; 3]), 10.0);
        assert_eq!(radial([30.0, 0.0, 0.0], [0.0, 10.0], [0.0; 3]), 0.0);
        let approaching = Scene::new(&[(Class::Car, [80.0, 0.0], [-20.0, 0.0])]);
        let radar = radar();
        approaching.with(&radar, |world, returns| {
            let echoes = collect(&radar, world, returns, 1.0, &mut Dice::new(1, Use::RadarFrame, 1));
            assert!(!echoes.is_empty() && echoes.iter().all(|e| e.velocity_mps < 0.0));
        });
    }
}
