//! What stood before it drove off, or stays where it stopped: the path is as long as reflections stand there.
//!
//! # Model
//! Doppler shows a vehicle that drives off across the line of sight late, when it is some metres on. So the place where
//! it stood is looked for behind the beginning of its path, as far as it takes to reach its speed there, and in the same
//! way ahead of the end. There reflections stood while it was there and do not while it is on its way: what stands
//! before and after is of something else. A reflection is of one vehicle.

use std::collections::HashSet;
use std::ops::Range;

use super::path::Path;
use super::reflections::{Instant, Reflection, STANDS_MPS};
use super::tracker::across_m;

/// Speed at an end of a path from which on it did not stand shortly before or after, m/s.
const DRIVES_MPS: f64 = 8.0;
/// Road users pull away and brake at least so hard, and with this on average, m/s².
const LEAST_MPS2: f64 = 0.8;
const MEAN_MPS2: f64 = 1.5;
/// Farthest from an end of a path a place is looked for, and in which steps, metres.
const FARTHEST_M: f64 = 14.0;
const STEP_M: f64 = 0.5;
/// How long before or after it was there what stands is counted, and when it is surely away, seconds.
const WINDOW_S: f64 = 4.0;
const AWAY_S: Range<f64> = 2.0..6.0;
/// Share of what stood there that may stand there without it.
const STAYS: f64 = 0.4;
/// How far beyond the reach of its reflections, and beside its place, others of it stand, metres.
const BEYOND_M: f64 = 0.8;
const BESIDE_M: f64 = 1.0;
/// It is gone when nothing stood there for this long, seconds.
const GONE_S: f64 = 8.0;
/// Share of the frames in which it has to be seen.
const SEEN: f64 = 0.15;
/// Fewest frames in which it is seen standing.
const FEWEST: usize = 5;

/// Adds what stood at both ends of each path.
pub fn stood(mut paths: Vec<Path>, instants: &[Instant]) -> Vec<Path> {
    let mut taken: HashSet<(usize, usize)> = paths.iter().flat_map(|p| p.members.iter().copied()).collect();
    // what was seen most claims first
    paths.sort_by_key(|p| std::cmp::Reverse(p.members.len()));
    let longer = paths.into_iter().map(|path| {
        let mut more = Vec::new();
        for backwards in [true, false] {
            let found = End::of(&path, backwards).and_then(|end| end.standing(instants, &taken));
            more.extend(found.into_iter().flatten());
        }
        if more.is_empty() {
            return path;
        }
        taken.extend(&more);
        let members = [&path.members[..], &more[..]].concat();
        Path::in_queues(members, path.lane.clone(), path.queued.clone(), instants).unwrap_or(path)
    });
    longer.collect()
}

/// One end of a path.
struct End {
    frame: usize,
    time_s: f64,
    place: [f64; 2],
    /// Away from the path.
    on: [f64; 2],
    speed: f64,
    /// Of the vehicle's reflections along [`Self::on`].
    reach: [f64; 2],
    /// -1 where frames before it are meant.
    sign: f64,
}

impl End {
    fn of(path: &Path, backwards: bool) -> Option<Self> {
        let (time_s, motion) = if backwards { path.motions.first()? } else { path.motions.last()? };
        let frame = if backwards { path.first } else { path.last() };
        let sign = if backwards { -1.0 } else { 1.0 };
        let (s, c) = path.heading_at(frame)?.sin_cos();
        let [low, high] = path.reach;
        let reach = if backwards { [-high, -low] } else { [low, high] };
        let (place, speed) = (motion.place(), motion.speed());
        let end = Self { frame, time_s: *time_s, place, on: [sign * c, sign * s], speed, reach, sign };
        (speed < DRIVES_MPS).then_some(end)
    }

    /// Whether a reflection stands in the vehicle's place if that is so far on.
    fn holds(&self, r: &Reflection, on_m: f64) -> bool {
        if r.doppler_mps.abs() > STANDS_MPS {
            return false;
        }
        let ([dx, dy], [c, s]) = ([r.place[0] - self.place[0], r.place[1] - self.place[1]], self.on);
        let (along, left) = (dx * c + dy * s - on_m, dx * s - dy * c);
        let spread = across_m(r.distance_m);
        let [low, high] = self.reach;
        left.abs() < BESIDE_M + spread
            && along > low - BEYOND_M - 0.5 * spread
            && along < high + BEYOND_M + 0.5 * spread
    }

    /// Reflections a frame that stand in its place at these times from the end on.
    fn rate(&self, on_m: f64, times_s: Range<f64>, instants: &[Instant], taken: &HashSet<(usize, usize)>) -> f64 {
        let mut times = [times_s.start, times_s.end].map(|s| self.time_s + self.sign * s);
        times.sort_by(f64::total_cmp);
        let [from, to] = times.map(|t| instants.partition_point(|i| i.time_s < t));
        let count = (from..to).map(|frame| self.own(on_m, frame, &instants[frame], taken).count()).sum::<usize>();
        count as f64 / (to - from).max(1) as f64
    }

    /// What stands in its place in a frame and is nobody's.
    fn own<'a>(
        &'a self,
        on_m: f64,
        frame: usize,
        instant: &'a Instant,
        taken: &'a HashSet<(usize, usize)>,
    ) -> impl Iterator<Item = (usize, usize)> + 'a {
        let all = instant.reflections.iter().enumerate();
        all.filter(move |(_, r)| self.holds(r, on_m)).map(move |(i, _)| (frame, i)).filter(|m| !taken.contains(m))
    }

    /// The reflections that stand where it stood.
    fn standing(&self, instants: &[Instant], taken: &HashSet<(usize, usize)>) -> Option<Vec<(usize, usize)>> {
        let farthest_m = (self.speed * self.speed / (2.0 * LEAST_MPS2)).min(FARTHEST_M);
        let places = (0..=(farthest_m / STEP_M) as u32).map(|k| f64::from(k) * STEP_M);
        let rated = places.filter_map(|on_m| {
            let since_s = (2.0 * on_m / MEAN_MPS2).sqrt().min(2.0 * on_m / self.speed.max(0.5));
            let there = self.rate(on_m, since_s..since_s + WINDOW_S, instants, taken);
            let away = self.rate(on_m, -AWAY_S.end..-AWAY_S.start, instants, taken);
            (away < STAYS * there).then_some((there - away, on_m, since_s))
        });
        let (_, on_m, since_s) = rated.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let backwards = self.sign < 0.0;
        let frames: Vec<usize> =
            if backwards { (0..self.frame).rev().collect() } else { (self.frame + 1..instants.len()).collect() };
        let mut found = Vec::new();
        let (mut all, mut seen, mut kept) = (0_usize, 0_usize, 0);
        let mut last_s = since_s;
        for frame in frames {
            let instant = &instants[frame];
            let now_s = self.sign * (instant.time_s - self.time_s);
            if now_s < since_s {
                continue;
            }
            if now_s - last_s > GONE_S {
                break;
            }
            all += 1;
            let before = found.len();
            found.extend(self.own(on_m, frame, instant, taken));
            if found.len() > before {
                (seen, last_s) = (seen + 1, now_s);
                if seen as f64 >= SEEN * all as f64 {
                    kept = found.len();
                }
            }
        }
        found.truncate(kept);
        (seen >= FEWEST).then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::reflections::tests::seen_from_origin;
    use super::*;

    const STOPPED_X: f64 = 40.0;

    fn reflection(x: f64, speed: f64) -> Reflection {
        seen_from_origin([x, 30.0], speed)
    }

    /// A car at x = 40 m pulls away along x at 6 s, seen by a sensor beside it, and reflects from `seen_from_s` on.
    /// Its path begins at 8 s, when it is 5 m on. Something stands 15 m behind it, and `posts` where it stood.
    fn recording(seen_from_s: f64, posts: &[f64]) -> (Vec<Instant>, Path) {
        let instants: Vec<Instant> = (0..200)
            .map(|frame| {
                let time_s = f64::from(frame) * 0.1;
                let speed = 2.5 * (time_s - 6.0).max(0.0);
                let x = STOPPED_X + 1.25 * (time_s - 6.0).max(0.0).powi(2);
                let mut reflections = vec![reflection(25.0, 0.0)];
                if time_s >= seen_from_s {
                    reflections.extend([reflection(x - 2.0, speed), reflection(x + 2.0, speed)]);
                }
                reflections.extend(posts.iter().map(|x| reflection(*x, 0.0)));
                Instant { time_s, reflections }
            })
            .collect();
        let members = (80..110).flat_map(|frame| [(frame, 1), (frame, 2)]).collect();
        let path = Path::new(members, None, &instants).unwrap();
        (instants, path)
    }

    #[test]
    fn what_pulls_away_stood_where_its_reflections_end_and_not_where_its_path_begins() {
        let (instants, path) = recording(0.0, &[]);
        assert_eq!(path.first, 80);
        let longer = stood(vec![path.clone()], &instants).remove(0);
        assert!(longer.first < 5, "from frame {}", longer.first);
        let [x, y] = longer.at(30).unwrap().place();
        assert!((x - STOPPED_X).abs() < 1.5 && (y - 30.0).abs() < 0.5, "{x} {y}");
        // what stands behind it is of something else
        assert!(longer.reflections(&instants).all(|(_, r)| r.place[0] > 30.0));
        // and what is another path's already is not taken
        let members = (0..60).flat_map(|frame| [(frame, 1), (frame, 2)]).collect();
        let other = Path::new(members, None, &instants).unwrap();
        let longer = stood(vec![other, path], &instants).into_iter().find(|p| p.last() > 100).unwrap();
        assert!(longer.members.iter().all(|m| m.0 >= 60), "from frame {}", longer.first);
    }

    #[test]
    fn what_still_stands_there_when_it_has_left_is_not_it() {
        let (instants, path) = recording(7.5, &[38.0, 41.0]);
        assert_eq!(stood(vec![path.clone()], &instants)[0].first, path.first);
    }
}
