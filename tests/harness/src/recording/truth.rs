//! Ground truth over time: labelled boxes joined to tracks, interpolated to any instant.

use std::collections::BTreeMap;

use crate::geometry::solid::Solid;

/// One labelled box at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    pub time_ns: i64,
    pub id: String,
    pub class: String,
    pub solid: Solid,
}

/// All labels of one object, in time order, with velocities by differences.
#[derive(Debug, Clone)]
pub struct Track {
    pub id: String,
    pub class: String,
    times_ns: Vec<i64>,
    solids: Vec<Solid>,
    /// Road-frame velocity at each label; empty for a single label.
    velocities: Vec<[f64; 2]>,
}

/// An object at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Object {
    /// Index into [`Truth::tracks`].
    pub track: usize,
    pub solid: Solid,
    /// m/s in the road frame; `None` for a track of one label.
    pub velocity: Option<[f64; 2]>,
}

impl Object {
    pub fn speed(&self) -> Option<f64> {
        self.velocity.map(|[x, y]| x.hypot(y))
    }

    /// Whether it is known to be slower.
    pub fn slower_than(&self, speed_mps: f64) -> bool {
        self.speed().is_some_and(|speed| speed < speed_mps)
    }
}

/// Every labelled object of a recording.
#[derive(Debug, Clone, Default)]
pub struct Truth {
    pub tracks: Vec<Track>,
    /// Where the labels lie beside the recording, if they do.
    pub beside: Option<LabelsBeside>,
}

/// Labels from a file beside a recording: somebody's, so they lack what nobody labelled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelsBeside {
    pub file: String,
    /// Objects that have the size of their class, since the file gives none.
    pub sized_by_class: usize,
    /// Objects that look along their path where the file gives no heading.
    pub turned_by_path: usize,
    /// Objects of the recording's own labels, whose place they take.
    pub left_out: Option<usize>,
}

/// Labels that put an object elsewhere than another of the same id and time does.
pub fn twice(labels: &[Label]) -> usize {
    let mut places: BTreeMap<(i64, &str), [f64; 3]> = BTreeMap::new();
    let mut twice = 0;
    for l in labels {
        let first = *places.entry((l.time_ns, l.id.as_str())).or_insert(l.solid.center);
        twice += usize::from(first != l.solid.center);
    }
    twice
}

impl Truth {
    pub fn new(mut labels: Vec<Label>) -> Self {
        labels.sort_by_key(|l| l.time_ns);
        let mut by_id: BTreeMap<String, Track> = BTreeMap::new();
        for l in labels {
            let track = by_id.entry(l.id.clone()).or_insert_with(|| Track {
                id: l.id,
                class: l.class,
                times_ns: Vec::new(),
                solids: Vec::new(),
                velocities: Vec::new(),
            });
            if track.times_ns.last() != Some(&l.time_ns) {
                track.times_ns.push(l.time_ns);
                track.solids.push(l.solid);
            }
        }
        let mut tracks: Vec<Track> = by_id.into_values().collect();
        for t in &mut tracks {
            t.velocities = t.differences();
        }
        Self { tracks, beside: None }
    }

    /// Every object at an instant, each only between its first and last label.
    pub fn at(&self, time_ns: i64) -> Vec<Object> {
        self.tracks.iter().enumerate().filter_map(|(i, t)| t.at(i, time_ns)).collect()
    }

    /// Every labelled box, at its own time.
    pub fn solids(&self) -> impl Iterator<Item = &Solid> {
        self.tracks.iter().flat_map(|t| &t.solids)
    }
}

impl Track {
    /// Its boxes, in the order of time.
    pub fn solids(&self) -> impl Iterator<Item = &Solid> {
        self.solids.iter()
    }

    /// When each label but the first is, and how fast the object comes there from the one before, m/s.
    pub fn steps(&self) -> impl Iterator<Item = (i64, f64)> {
        self.times_ns.windows(2).zip(self.solids.windows(2)).map(|(times, solids)| {
            let way = [0, 1].map(|k| solids[1].center[k] - solids[0].center[k]);
            let passed = times[1].saturating_sub(times[0]) as f64 * 1e-9;
            (times[1], way[0].hypot(way[1]) / passed.max(1e-9))
        })
    }

    /// Whether it is ever anywhere else.
    pub fn moves(&self) -> bool {
        self.solids.windows(2).any(|pair| pair[0].center != pair[1].center)
    }

    /// Central differences, one-sided at the ends.
    fn differences(&self) -> Vec<[f64; 2]> {
        let n = self.times_ns.len();
        if n < 2 {
            return Vec::new();
        }
        (0..n)
            .map(|i| {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
                let dt = self.times_ns[b].saturating_sub(self.times_ns[a]) as f64 * 1e-9;
                [0, 1].map(|k| (self.solids[b].center[k] - self.solids[a].center[k]) / dt)
            })
            .collect()
    }

    fn at(&self, index: usize, time_ns: i64) -> Option<Object> {
        let next = self.times_ns.partition_point(|&t| t < time_ns);
        let hi = *self.times_ns.get(next)?;
        let velocity = |i: usize| self.velocities.get(i).copied();
        if hi == time_ns {
            return Some(Object { track: index, solid: self.solids[next], velocity: velocity(next) });
        }
        let previous = next.checked_sub(1)?;
        let lo = self.times_ns[previous];
        let f = time_ns.saturating_sub(lo) as f64 / hi.saturating_sub(lo).max(1) as f64;
        let (a, b) = (self.solids[previous], self.solids[next]);
        let mix = |x: f64, y: f64| x + f * (y - x);
        let turn =
            (b.yaw_rad - a.yaw_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        Some(Object {
            track: index,
            solid: Solid {
                center: [0, 1, 2].map(|k| mix(a.center[k], b.center[k])),
                yaw_rad: a.yaw_rad + f * turn,
                size: [0, 1, 2].map(|k| mix(a.size[k], b.size[k])),
            },
            velocity: velocity(previous).zip(velocity(next)).map(|(u, v)| [mix(u[0], v[0]), mix(u[1], v[1])]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(time_s: f64, x: f64, yaw: f64) -> Label {
        Label {
            time_ns: (time_s * 1e9) as i64,
            id: "a".into(),
            class: "car".into(),
            solid: Solid { center: [x, 0.0, 0.75], yaw_rad: yaw, size: [4.6, 1.8, 1.5] },
        }
    }

    #[test]
    fn poses_are_interpolated_between_labels_and_not_beyond() {
        let t = Truth::new(vec![label(1.0, 10.0, 3.0), label(0.0, 0.0, -3.0)]);
        let o = t.at(250_000_000)[0];
        assert!((o.solid.center[0] - 2.5).abs() < 1e-12);
        // from -3 to 3 rad the short way passes through pi
        assert!((o.solid.yaw_rad - (-3.0 - 0.25 * (std::f64::consts::TAU - 6.0))).abs() < 1e-9);
        assert_eq!(o.velocity, Some([10.0, 0.0]));
        assert!(t.at(-1).is_empty() && t.at(1_000_000_001).is_empty());
        assert_eq!(t.at(1_000_000_000).len(), 1);
    }

    #[test]
    fn velocity_is_central_inside_and_one_sided_at_the_ends() {
        let t = Truth::new(vec![label(0.0, 0.0, 0.0), label(1.0, 1.0, 0.0), label(2.0, 4.0, 0.0)]);
        let v = |s: i64| t.at(s * 1_000_000_000)[0].velocity.unwrap()[0];
        assert_eq!((v(0), v(1), v(2)), (1.0, 2.0, 3.0));
    }

    #[test]
    fn labels_of_one_id_at_two_places_are_counted() {
        let (a, b) = (label(0.0, 1.0, 0.0), label(0.0, 9.0, 0.0));
        let other = Label { id: "b".into(), ..b.clone() };
        assert_eq!(twice(&[a.clone(), a.clone(), other, label(1.0, 9.0, 0.0)]), 0);
        assert_eq!(twice(&[a.clone(), b, a]), 1);
    }

    #[test]
    fn a_single_label_has_no_velocity() {
        assert_eq!(Truth::new(vec![label(0.0, 0.0, 0.0)]).at(0)[0].velocity, None);
    }
}
