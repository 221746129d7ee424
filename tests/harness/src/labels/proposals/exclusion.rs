//! No two vehicles in one place: of proposals that claim the same road, the better one stays.

use std::sync::Arc;

use super::Proposal;
use super::path::Path;
use crate::geometry::solid::Solid;
use crate::labels::near_face::boxes;

/// A mirror image is this far ahead or behind at most, on average, metres, and its speed differs by this, m/s.
const IMAGE_M: f64 = 4.0;
const IMAGE_MPS: f64 = 1.0;
/// Speed from which on images are told from vehicles that drive side by side, m/s.
const IMAGE_FROM_MPS: f64 = 8.0;
/// For this share of its time it has the vehicle beside it, with so many times its reflections.
const IMAGE_SHARE: f64 = 0.7;
const IMAGE_REFLECTIONS: f64 = 1.5;
/// Share of a lane's reflections that are images' from which on it is none.
const IMAGE_LANE: f64 = 0.5;
/// Time between two looks at the boxes, seconds.
const STEP_S: f64 = 0.5;
/// Two boxes intrude into one another from this share of the smaller footprint on.
const INTRUDES: f64 = 0.15;
/// Share of its time in others' places from which on a proposal is none.
const SHARE: f64 = 0.4;

/// Paths without the mirror images that barriers beside the road show: abreast of a vehicle with more reflections, and
/// outside all lanes or in one where most are such images.
pub fn without_images(paths: Vec<Path>) -> Vec<Path> {
    let lane = |p: &Path| p.lane.as_ref().map(Arc::as_ptr);
    let image = |p: &Path| paths.iter().any(|q| q.lane.is_some() && lane(q) != lane(p) && is_image(p, q));
    let images: Vec<bool> = paths.iter().map(image).collect();
    let alike = |p: &Path| {
        let (all, own) = paths
            .iter()
            .zip(&images)
            .filter(|(q, _)| lane(q) == lane(p))
            .fold((0, 0), |(all, own), (q, i)| (all + q.members.len(), own + if *i { q.members.len() } else { 0 }));
        own as f64 >= IMAGE_LANE * all as f64
    };
    let kept: Vec<bool> =
        paths.iter().zip(&images).map(|(p, image)| !(*image && (p.lane.is_none() || alike(p)))).collect();
    paths.into_iter().zip(kept).filter(|(_, kept)| *kept).map(|(p, _)| p).collect()
}

fn is_image(image: &Path, vehicle: &Path) -> bool {
    let (begin, end) = (image.first.max(vehicle.first), image.last().min(vehicle.last()));
    let frames = (end + 1).saturating_sub(begin) as f64;
    // in slow traffic a neighbour stays abreast, too
    if image.mean_speed() < IMAGE_FROM_MPS
        || frames < IMAGE_SHARE * image.motions.len() as f64
        || (vehicle.members.len() as f64) < IMAGE_REFLECTIONS * image.members.len() as f64
    {
        return false;
    }
    let (mut ahead, mut faster) = (0.0, 0.0);
    for frame in begin..=end {
        let (Some(a), Some(b), Some(heading)) = (image.at(frame), vehicle.at(frame), vehicle.heading_at(frame)) else {
            return false;
        };
        let (s, c) = heading.sin_cos();
        let along = |a: [f64; 2], b: [f64; 2]| ((a[0] - b[0]) * c + (a[1] - b[1]) * s).abs();
        ahead += along(a.place(), b.place());
        faster += along(a.velocity(), b.velocity());
    }
    ahead < IMAGE_M * frames && faster < IMAGE_MPS * frames
}

/// Proposals, the best first, without those that are in the places of better ones.
pub fn without_intruders(all: Vec<Proposal>, sensor: [f64; 2]) -> Vec<Proposal> {
    let mut taken: Vec<Vec<Solid>> = Vec::new();
    let mut kept = Vec::new();
    for proposal in all {
        let own = solids(&proposal, sensor);
        let meets =
            |k: usize, s: &Solid| taken.get(k).is_some_and(|t| t.iter().any(|other| s.shared(other) >= INTRUDES));
        let intruding = own.iter().filter(|(k, s)| meets(*k, s)).count();
        if intruding as f64 >= SHARE * own.len() as f64 {
            continue;
        }
        for (k, solid) in own {
            if taken.len() <= k {
                taken.resize(k + 1, Vec::new());
            }
            taken[k].push(solid);
        }
        kept.push(proposal);
    }
    kept
}

/// Its boxes, by the number of the look.
fn solids(proposal: &Proposal, sensor: [f64; 2]) -> Vec<(usize, Solid)> {
    let size = proposal.track.size();
    let mut all: Vec<(usize, Solid)> = Vec::new();
    for step in boxes(&proposal.track, sensor) {
        let k = (step.time_s / STEP_S).round().max(0.0) as usize;
        if all.last().is_none_or(|(last, _)| *last != k) {
            all.push((k, step.solid(size)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::lane::Lane;
    use super::super::motion::Motion;
    use super::*;
    use crate::labels::tracks::LabelTrack;

    /// A path along x at 20 m/s, `reflections` a frame.
    fn path(left_m: f64, reflections: usize, lane: Option<Arc<Lane>>) -> Path {
        let motion = |frame: usize| Motion::new([2.0 * frame as f64, left_m], [20.0, 0.0], 0.1, [1.0, 0.0], [0.1; 2]);
        let motions: Vec<(f64, Motion)> = (0..60).map(|k| (k as f64 * 0.1, motion(k))).collect();
        let members = (0..60 * reflections).map(|k| (k / reflections, k)).collect();
        Path {
            members,
            first: 0,
            headings_rad: vec![0.0; 60],
            motions,
            reach: [0.0; 2],
            top_m: 1.5,
            lane,
            queued: Vec::new(),
        }
    }

    #[test]
    fn a_mirror_image_beside_the_road_is_dropped_and_a_neighbour_in_its_lane_stays() {
        let lane = || Some(Arc::new(Lane::default()));
        let lefts = |paths: Vec<Path>| -> Vec<f64> { paths.iter().map(|p| p.motions[0].1.place()[1]).collect() };
        let own = lane();
        // the neighbour's lane has others that are nobody's image
        let other = |first| Path { first, ..path(7.0, 6, own.clone()) };
        let all = vec![path(3.5, 8, lane()), path(7.0, 4, own.clone()), other(100), path(16.0, 2, None)];
        assert_eq!(lefts(without_images(all)), [3.5, 7.0, 7.0]);
        // without a vehicle beside it, it is none
        assert_eq!(lefts(without_images(vec![path(16.0, 2, None)])), [16.0]);
    }

    fn proposal(id: &str, points: &[[f64; 3]]) -> Proposal {
        let points = points.iter().map(|p| (*p).into()).collect();
        let track = LabelTrack { id: id.into(), class: "car".into(), size_m: None, points };
        Proposal { track, score: 0.9, detections: 100, way: 0 }
    }

    #[test]
    fn of_two_proposals_for_one_place_the_better_stays_and_neighbours_stay_both() {
        let best = proposal("best", &[[0.0, 20.0, 3.5], [5.0, 120.0, 3.5]]);
        let again = proposal("again", &[[1.0, 41.0, 3.9], [4.0, 101.0, 3.9]]);
        let beside = proposal("beside", &[[0.0, 20.0, 7.0], [5.0, 120.0, 7.0]]);
        let behind = proposal("behind", &[[0.5, 20.0, 3.5], [5.5, 120.0, 3.5]]);
        let all = vec![best.clone(), again, beside.clone(), behind.clone()];
        assert_eq!(without_intruders(all, [0.0, 0.0]), [best, beside, behind]);
    }
}
