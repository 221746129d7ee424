//! No two vehicles in one place: of proposals that claim the same road, the better one stays.

use super::Proposal;
use crate::geometry::polygon::Convex;
use crate::geometry::solid::Solid;
use crate::labels::near_face::boxes;

/// Time between two looks at the boxes, seconds.
const STEP_S: f64 = 0.5;
/// Two boxes intrude into one another from this share of the smaller footprint on.
const INTRUDES: f64 = 0.15;
/// Share of its time in others' places from which on a proposal is none.
const SHARE: f64 = 0.4;

/// Proposals, the best first, without those that are in the places of better ones.
pub fn without_intruders(all: Vec<Proposal>, sensor: [f64; 2]) -> Vec<Proposal> {
    let mut taken: Vec<Vec<Solid>> = Vec::new();
    let mut kept = Vec::new();
    for proposal in all {
        let own = solids(&proposal, sensor);
        let meets = |k: usize, s: &Solid| taken.get(k).is_some_and(|t| t.iter().any(|other| intrudes(s, other)));
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
            let [x, y] = step.center;
            all.push((k, Solid { center: [x, y, size[2] / 2.0], yaw_rad: step.heading_rad, size }));
        }
    }
    all
}

fn intrudes(a: &Solid, b: &Solid) -> bool {
    let reach = a.size[0].hypot(a.size[1]) + b.size[0].hypot(b.size[1]);
    if (a.center[0] - b.center[0]).hypot(a.center[1] - b.center[1]) * 2.0 > reach {
        return false;
    }
    let [p, q] = [a, b].map(|s| Convex::hull(s.footprint().to_vec()));
    p.within(&q).area() >= INTRUDES * p.area().min(q.area())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::tracks::LabelTrack;

    fn proposal(id: &str, points: &[[f64; 3]]) -> Proposal {
        let points = points.iter().map(|p| (*p).into()).collect();
        let track = LabelTrack { id: id.into(), class: "car".into(), size_m: None, points };
        Proposal { track, score: 0.9, detections: 100 }
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
