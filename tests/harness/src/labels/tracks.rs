//! Label tracks: a class and a polyline of where a vehicle's near face was, over time.
//!
//! What is drawn are the reflections' near edge, since nothing else is seen of a vehicle; [`super::near_face`] tells
//! what box stands behind it. Between two points the vehicle moves in a straight line at constant speed, before the
//! first and after the last there is no label.

use serde::{Deserialize, Serialize};

use crate::recording::labels::class_size;

/// Where the near face was at one time. In JSON an array of three numbers: `[time_s, x_m, y_m]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct LabelPoint {
    /// Seconds since the first radar frame.
    pub time_s: f64,
    /// Road frame, metres.
    pub x_m: f64,
    pub y_m: f64,
}

impl From<[f64; 3]> for LabelPoint {
    fn from([time_s, x_m, y_m]: [f64; 3]) -> Self {
        Self { time_s, x_m, y_m }
    }
}

impl From<LabelPoint> for [f64; 3] {
    fn from(p: LabelPoint) -> Self {
        [p.time_s, p.x_m, p.y_m]
    }
}

/// One labelled road user.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelTrack {
    pub id: String,
    /// One of those with a known size, see [`class_size`].
    pub class: String,
    /// Length, width, height in metres; without, those of the class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_m: Option<[f64; 3]>,
    /// In the order of time.
    pub points: Vec<LabelPoint>,
}

/// Why a track cannot be kept.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrackError {
    #[error("a track has no id; give it one")]
    NoId,
    #[error("track {id}: an id must not hold line breaks or start with #; rename it")]
    BadId { id: String },
    #[error("two tracks have the id {id}; rename one")]
    SameId { id: String },
    #[error("track {id}: nobody knows the size of class `{class}`; choose another class")]
    UnknownClass { id: String, class: String },
    #[error("track {id}: a size is not between 0 and 100 m")]
    BadSize { id: String },
    #[error("track {id} has {points} point(s); draw at least two")]
    TooFewPoints { id: String, points: usize },
    #[error("track {id}, point {point}: a value is not finite or out of range")]
    NotFinite { id: String, point: usize },
    #[error("track {id}, point {point}: its time is not after that of the point before")]
    TimeOrder { id: String, point: usize },
    #[error("tracks {first} and {second} overlap in time; split one before joining them")]
    Overlap { first: String, second: String },
    #[error("track {id} has no label at {time_s} s with something on both sides; split it elsewhere")]
    NothingToSplit { id: String, time_s: f64 },
}

/// Farthest from the recording's start and from the road frame's origin a point may lie, seconds and metres.
pub const FARTHEST: f64 = 1e6;

impl LabelTrack {
    /// Says that it is of a class; a size that was known was that of another one.
    pub fn classify(&mut self, class: &str) {
        if self.class != class {
            (self.class, self.size_m) = (class.to_owned(), None);
        }
    }

    /// Length, width, height in metres; of a class nobody knows, a car's.
    pub fn size(&self) -> [f64; 3] {
        self.size_m.or_else(|| class_size(&self.class)).unwrap_or([4.6, 1.8, 1.5])
    }

    /// Times of its first and last point.
    pub fn span_s(&self) -> Option<[f64; 2]> {
        Some([self.points.first()?.time_s, self.points.last()?.time_s])
    }

    /// The near face at a time; `None` before the first and after the last point.
    pub fn near_at(&self, time_s: f64) -> Option<[f64; 2]> {
        let next = self.points.partition_point(|p| p.time_s < time_s);
        let b = self.points.get(next)?;
        if b.time_s == time_s {
            return Some([b.x_m, b.y_m]);
        }
        let a = self.points.get(next.checked_sub(1)?)?;
        let f = (time_s - a.time_s) / (b.time_s - a.time_s);
        Some([a.x_m + f * (b.x_m - a.x_m), a.y_m + f * (b.y_m - a.y_m)])
    }

    /// # Errors
    /// What keeps it from being a track, with its id and the point (from 1).
    pub fn check(&self) -> Result<(), TrackError> {
        let id = || self.id.clone();
        if self.id.trim().is_empty() {
            return Err(TrackError::NoId);
        }
        if self.id.starts_with('#') || self.id.trim() != self.id || self.id.contains(['\n', '\r']) {
            return Err(TrackError::BadId { id: id() });
        }
        match self.size_m {
            None if class_size(&self.class).is_none() => {
                return Err(TrackError::UnknownClass { id: id(), class: self.class.clone() });
            }
            Some(size) if size.iter().any(|v| !(*v > 0.0 && *v <= 100.0)) => {
                return Err(TrackError::BadSize { id: id() });
            }
            _ => {}
        }
        if self.points.len() < 2 {
            return Err(TrackError::TooFewPoints { id: id(), points: self.points.len() });
        }
        for (k, p) in self.points.iter().enumerate() {
            // a NaN is in no range
            if [p.time_s, p.x_m, p.y_m].iter().any(|v| !(-FARTHEST..=FARTHEST).contains(v)) {
                return Err(TrackError::NotFinite { id: id(), point: k + 1 });
            }
            if k > 0 && p.time_s <= self.points[k - 1].time_s {
                return Err(TrackError::TimeOrder { id: id(), point: k + 1 });
            }
        }
        Ok(())
    }

    /// Two pieces of one road user as one track, with the id, class and size of the longer piece; the gap becomes a
    /// straight line.
    ///
    /// # Errors
    /// They overlap in time.
    pub fn joined(&self, other: &Self) -> Result<Self, TrackError> {
        let start = |t: &Self| t.span_s().map_or(f64::INFINITY, |[a, _]| a);
        let (first, second) = if start(self) <= start(other) { (self, other) } else { (other, self) };
        if let (Some([_, end]), Some([begin, _])) = (first.span_s(), second.span_s())
            && begin <= end
        {
            return Err(TrackError::Overlap { first: first.id.clone(), second: second.id.clone() });
        }
        let lasts = |t: &Self| t.span_s().map_or(0.0, |[a, b]| b - a);
        let named = if lasts(second) > lasts(first) { second } else { first };
        Ok(Self { points: [&first.points[..], &second.points[..]].concat(), ..named.clone() })
    }

    /// The track up to a time and from there on; the second part gets `id`.
    ///
    /// # Errors
    /// Nothing would be left on one side.
    pub fn split(&self, time_s: f64, id: &str) -> Result<[Self; 2], TrackError> {
        let none = || TrackError::NothingToSplit { id: self.id.clone(), time_s };
        let [begin, end] = self.span_s().ok_or_else(none)?;
        let [x_m, y_m] = self.near_at(time_s).filter(|_| begin < time_s && time_s < end).ok_or_else(none)?;
        let at = LabelPoint { time_s, x_m, y_m };
        let before = self.points.iter().copied().filter(|p| p.time_s < time_s).chain([at]).collect();
        let after = [at].into_iter().chain(self.points.iter().copied().filter(|p| p.time_s > time_s)).collect();
        Ok([Self { points: before, ..self.clone() }, Self { id: id.to_owned(), points: after, ..self.clone() }])
    }
}

/// # Errors
/// The first track that cannot be kept, or two of one id.
pub fn check_all(tracks: &[LabelTrack]) -> Result<(), TrackError> {
    let mut ids = std::collections::BTreeSet::new();
    for track in tracks {
        track.check()?;
        if !ids.insert(&track.id) {
            return Err(TrackError::SameId { id: track.id.clone() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(id: &str, points: &[[f64; 3]]) -> LabelTrack {
        LabelTrack {
            id: id.into(),
            class: "car".into(),
            size_m: None,
            points: points.iter().map(|p| (*p).into()).collect(),
        }
    }

    #[test]
    fn the_near_face_moves_in_straight_lines_between_points_and_is_nowhere_beyond() {
        let t = track("a", &[[1.0, 10.0, 0.0], [3.0, 30.0, 4.0], [4.0, 30.0, 4.0]]);
        assert_eq!(t.near_at(2.0), Some([20.0, 2.0]));
        assert_eq!((t.near_at(1.0), t.near_at(4.0)), (Some([10.0, 0.0]), Some([30.0, 4.0])));
        assert_eq!((t.near_at(0.999), t.near_at(4.001)), (None, None));
    }

    #[test]
    fn what_is_no_track_is_named_with_its_point() {
        let wrong = |t: LabelTrack| t.check().unwrap_err().to_string();
        assert!(wrong(track("a", &[[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])).contains("track a, point 2"));
        assert!(wrong(track("a", &[[1.0, 0.0, 0.0], [2.0, f64::NAN, 0.0]])).contains("point 2"));
        assert!(wrong(track("a", &[[1.0, 0.0, 0.0]])).contains("1 point"));
        assert!(wrong(track(" ", &[])).contains("no id"));
        assert!(wrong(track("a\nb", &[])).contains("line breaks"));
        let ship = LabelTrack { class: "ship".into(), ..track("a", &[[0.0; 3], [1.0; 3]]) };
        assert!(wrong(ship.clone()).contains("`ship`"));
        assert_eq!(LabelTrack { size_m: Some([20.0, 5.0, 3.0]), ..ship }.check(), Ok(()));
        let good = track("a", &[[0.0; 3], [1.0; 3]]);
        assert_eq!(check_all(std::slice::from_ref(&good)), Ok(()));
        assert_eq!(check_all(&[good.clone(), good]), Err(TrackError::SameId { id: "a".into() }));
    }

    #[test]
    fn pieces_are_joined_in_the_order_of_time_and_split_again() {
        let early = track("1", &[[0.0, 0.0, 0.0], [1.0, 10.0, 0.0]]);
        let late = track("2", &[[2.0, 20.0, 0.0], [5.0, 50.0, 0.0]]);
        let whole = late.joined(&early).unwrap();
        assert_eq!((whole.id.as_str(), whole.near_at(1.5)), ("2", Some([15.0, 0.0])));
        assert!(matches!(whole.joined(&early), Err(TrackError::Overlap { .. })));
        let [a, b] = whole.split(1.5, "new").unwrap();
        assert_eq!((a.span_s(), b.span_s(), b.id.as_str()), (Some([0.0, 1.5]), Some([1.5, 5.0]), "new"));
        assert!(whole.split(5.0, "new").is_err() && whole.split(-1.0, "new").is_err());
    }

    #[test]
    fn json_gives_a_point_as_three_numbers() {
        let t = track("7", &[[0.5, 80.0, -3.5], [1.0, 70.0, -3.5]]);
        let text = serde_json::to_string(&t).unwrap();
        assert_eq!(text, r#"{"id":"7","class":"car","points":[[0.5,80.0,-3.5],[1.0,70.0,-3.5]]}"#);
        assert_eq!(serde_json::from_str::<LabelTrack>(&text).unwrap(), t);
    }

    #[test]
    fn what_is_of_another_class_has_another_size() {
        let mut lorry =
            LabelTrack { class: "truck".into(), size_m: Some([9.2, 2.5, 3.6]), ..track("a", &[[0.0, 9.0, 1.0]]) };
        lorry.classify("truck");
        assert_eq!(lorry.size(), [9.2, 2.5, 3.6]);
        lorry.classify("bus");
        assert_eq!((lorry.class.as_str(), lorry.size()), ("bus", [13.0, 2.55, 3.6]));
    }
}
