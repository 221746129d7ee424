//! What stood before it drove off, or stays where it stopped: the path is as long as reflections stand there.

use super::path::Path;
use super::reflections::{Instant, STANDS_MPS};

/// Speed at an end of a path from which on it may have stood there, m/s.
const STOPPED_MPS: f64 = 1.5;
/// How far from the vehicle's place reflections of it stand, metres; across it grows with distance.
const NEAR_M: f64 = 2.0;
/// It is gone when nothing stood there for this long, seconds.
const GONE_S: f64 = 4.0;
/// Share of the frames in which it has to be seen.
const SEEN: f64 = 0.2;
/// Fewest frames in which it is seen standing.
const FEWEST: usize = 5;

/// Adds what stood at both ends of a path.
pub fn stood(path: Path, instants: &[Instant]) -> Path {
    let mut more = Vec::new();
    for backwards in [true, false] {
        let Some((_, end)) = (if backwards { path.motions.first() } else { path.motions.last() }) else { continue };
        if end.speed() > STOPPED_MPS {
            continue;
        }
        let frames: Vec<usize> =
            if backwards { (0..path.first).rev().collect() } else { (path.last() + 1..instants.len()).collect() };
        more.extend(standing(end.place(), &frames, instants));
    }
    if more.is_empty() {
        return path;
    }
    let members = [&path.members[..], &more[..]].concat();
    Path::new(members, path.lane.clone(), instants).unwrap_or(path)
}

/// Reflections that stand at a place, frame by frame away from the end of a path, until there are none.
fn standing(place: [f64; 2], frames: &[usize], instants: &[Instant]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let (mut seen, mut last_s, mut kept) = (0_usize, None, 0);
    for (k, frame) in frames.iter().enumerate() {
        let instant = &instants[*frame];
        let before_s = *last_s.get_or_insert(instant.time_s);
        if (instant.time_s - before_s).abs() > GONE_S {
            break;
        }
        let own = instant.reflections.iter().enumerate().filter(|(_, r)| {
            let away = (r.place[0] - place[0]).hypot(r.place[1] - place[1]);
            r.doppler_mps.abs() < STANDS_MPS && away < NEAR_M + 0.01 * r.distance_m
        });
        let before = found.len();
        found.extend(own.map(|(i, _)| (*frame, i)));
        if found.len() > before {
            seen += 1;
            last_s = Some(instant.time_s);
            if seen as f64 >= SEEN * (k + 1) as f64 {
                kept = found.len();
            }
        }
    }
    found.truncate(kept);
    if seen < FEWEST { Vec::new() } else { found }
}
