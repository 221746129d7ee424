//! Ghosts: what shows in upright flat faces, and takes the detour by them.
//!
//! # Model
//! A target and its mirror image. Both ways by the mirror, the echo is at the image (behind the face), with
//! the image's velocity; one way by it, the range and the velocity are the mean of target and image, and the
//! power comes from both directions. A ghost needs the point of reflection on the face and both legs free.
//! Faces are the long sides of trucks and buses and of structures that state a loss.

use super::Radar;
use super::echo::{Echo, Seen, fading, radial};
use crate::twin::random::Dice;
use crate::twin::world::{Face, World};

/// Echoes need this much power for their ghosts to be looked for: 100 is 20 dB above the noise.
pub const FAINTEST: f64 = 100.0;

/// Adds the ghosts of all strong echoes.
pub fn ghosts(
    radar: &Radar,
    world: &World,
    strong: &[(usize, Seen)],
    noise: f64,
    dice: &mut Dice,
    echoes: &mut Vec<Echo>,
) {
    let faces = world.faces(radar.model.mirrors.vehicle_loss_db);
    for (body, seen) in strong {
        // three draws a target, whatever it meets
        let (fade, phase) = (fading(radar.model.fading.shape, dice), std::f64::consts::TAU * dice.uniform());
        for face in faces.iter().filter(|f| f.body != *body) {
            ghost(radar, world, face, seen, noise, fade, phase, echoes);
        }
    }
}

#[allow(clippy::too_many_arguments)]
fn ghost(
    radar: &Radar,
    world: &World,
    face: &Face,
    seen: &Seen,
    noise: f64,
    fade: f64,
    phase: f64,
    echoes: &mut Vec<Echo>,
) {
    let eye = world.eye();
    let (target_m, eye_m) = (face.distance(seen.place), face.distance(eye));
    // both must stand before the face
    if target_m <= 0.05 || eye_m <= 0.05 || target_m > radar.model.mirrors.reach_m {
        return;
    }
    let image = face.mirrored(seen.place);
    let part = eye_m / (eye_m + target_m);
    let meeting = [0, 1, 2].map(|i| eye[i] + part * (image[i] - eye[i]));
    if !face.holds(meeting) {
        return;
    }
    let from_image = radar.pose.to_spherical(image);
    let view = &radar.field_of_view;
    if from_image.range_m > view.range_m[1]
        || !(view.azimuth_rad[0]..=view.azimuth_rad[1]).contains(&from_image.azimuth_rad)
    {
        return;
    }
    let gain_db = radar.model.antenna.gain_db(from_image.azimuth_rad, from_image.elevation_rad);
    let amplitude = |two_way_loss_db: f64, two_way_gain_db: f64, range_m: f64| {
        let snr_db = radar.snr_db(seen.rcs_dbsm - two_way_loss_db, range_m, two_way_gain_db);
        (10_f64.powf(snr_db / 10.0) / noise * fade).sqrt()
    };
    let both = amplitude(2.0 * face.loss_db, 2.0 * gain_db, from_image.range_m);
    let mean_m = (seen.seen.range_m + from_image.range_m) / 2.0;
    let single = amplitude(face.loss_db, gain_db + seen.gain_db, mean_m);
    if both.max(single) < 1.0 {
        return;
    }
    // a little off the face, which would block itself
    let before = [0, 1].map(|i| meeting[i] + 0.02 * face.normal[i]);
    let before = [before[0], before[1], meeting[2]];
    if !world.clear(eye, before) || !world.clear(before, seen.place) {
        return;
    }
    let image_velocity = face.mirrored_velocity(seen.velocity);
    let (straight, detour) = (radial(seen.place, seen.velocity, eye), radial(image, image_velocity, eye));
    let (sine, cosine) = phase.sin_cos();
    let mut add = |range_m: f64, azimuth_rad: f64, elevation_rad: f64, velocity_mps: f64, amplitude: f64| {
        let amplitude = [amplitude * cosine, amplitude * sine];
        echoes.push(Echo { range_m, azimuth_rad, elevation_rad, velocity_mps, amplitude });
    };
    add(from_image.range_m, from_image.azimuth_rad, from_image.elevation_rad, detour, both);
    let mean_mps = (straight + detour) / 2.0;
    add(mean_m, from_image.azimuth_rad, from_image.elevation_rad, mean_mps, single);
    add(mean_m, seen.seen.azimuth_rad, seen.seen.elevation_rad, mean_mps, single);
}

#[cfg(test)]
mod tests {
    use super::super::echoes::collect;
    use super::super::made_up::{Scene, radar};
    use super::*;
    use crate::twin::random::Use;
    use crate::twin::traffic::types::Class;

    #[test]
    fn a_car_shows_in_the_side_of_a_truck() {
        // the truck's side is at y = 5 - 1.275, half way to the car, whose image drives at y = 7.45
        let truck = (Class::Truck, [32.0, 5.0], [25.0, 0.0]);
        let car = (Class::Car, [62.0, 0.0], [30.0, 0.0]);
        let near = |scene: &Scene, loss_db: f64| {
            let mut radar = radar();
            radar.model.mirrors.vehicle_loss_db = loss_db;
            let mut found = Vec::new();
            scene.with(&radar, |world, returns| {
                for n in 0..20 {
                    found.extend(collect(&radar, world, returns, 1.0, &mut Dice::new(1, Use::RadarFrame, n)));
                }
            });
            // where nothing drives, as fast as the car
            found.retain(|e| e.range_m > 55.0 && e.range_m * e.azimuth_rad.sin() > 6.5 && e.velocity_mps > 28.0);
            found.len()
        };
        assert!(near(&Scene::new(&[truck, car]), 10.0) > 0);
        assert_eq!(near(&Scene::new(&[truck, car]), 190.0), 0, "a dull side shows nothing");
        assert_eq!(near(&Scene::new(&[truck]), 10.0), 0, "without the car there is nothing to show");
    }
}
