//! The detections of one radar frame that the estimators use: gated, placed, and never too many.

use heapless::Vec;

use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::gate::{Gate, Rejection, Rejections};
use crate::frame::health::{FrameStatus, Points};
use crate::frame::reflection::Reflection;
use crate::frame::repeats::Repeats;
use crate::frame::thinning::Thinning;

/// Up to `D` reflections of the frame, in order of arrival.
///
/// # Limits
/// When more pass the gate, those of the greatest [priority](Thinning::priority) stay, of equals the first to arrive; the others
/// are counted as [`Rejection::Overflow`]. The cost is three looks at every detection at most, however many there are and in
/// whatever order they come.
#[derive(Debug, Clone)]
pub struct Scan<const D: usize> {
    reflections: Vec<Reflection, D, u16>,
    rejections: Rejections,
    /// Points that cannot be judged.
    unjudged: Repeats,
}

impl<const D: usize> Default for Scan<D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const D: usize> Scan<D> {
    /// An empty scan.
    pub const fn new() -> Self {
        Self { reflections: Vec::new(), rejections: Rejections::NONE, unjudged: Repeats::NEW }
    }

    /// Takes the detections of a frame that pass the gate, as `place` places them, in the place of the last
    /// frame's, and counts why others do not, those refused before among them. Returns where all of them were.
    pub fn gather<'a>(
        &mut self,
        now: Time,
        detections: impl Iterator<Item = &'a Detection> + Clone,
        status: FrameStatus,
        gate: &Gate,
        place: impl Fn(&Detection) -> Reflection,
    ) -> Points {
        self.reflections.clear();
        self.rejections = Rejections::NONE;
        let refused = status.refused.into();
        self.rejections.add_many(Rejection::Refused, refused);
        let room = D.min(gate.max_detections);
        let mut kept: Vec<&Detection, D, u16> = Vec::new();
        let (mut reported, mut passed) = (0_u32, 0_u32);
        let mut unjudged = self.unjudged.frame(now);
        let mut arriving = detections;
        let mut late = None;
        while let Some(d) = arriving.next() {
            reported = reported.saturating_add(1);
            if !gate.takes(d, &mut self.rejections, &mut unjudged) {
                continue;
            }
            passed = passed.saturating_add(1);
            if kept.len() >= room {
                self.rejections.add(Rejection::Overflow);
                continue;
            }
            let _ = kept.push(d);
            if kept.len() == room {
                late = Some(arriving.clone());
            }
        }
        if let Some(late) = late.filter(|_| passed as usize > room) {
            let late = late.filter(|d| gate.judge(d).is_ok());
            let (mut thinning, mut priorities) = (Thinning::NEW, Priorities([0; PRIORITIES]));
            for d in kept.iter().copied().chain(late.clone()) {
                priorities.count(thinning.priority(d));
            }
            let mut greatest = priorities.greatest(room);
            thinning = Thinning::NEW;
            kept.retain(|d| greatest.takes(thinning.priority(d)));
            for d in late {
                if greatest.takes(thinning.priority(d)) {
                    let _ = kept.push(d);
                }
            }
        }
        for d in kept {
            let _ = self.reflections.push(place(d));
        }
        let again = unjudged.end();
        let (outside, unwanted) = (self.rejections.outside(), self.rejections.count(Rejection::Unwanted));
        let inside = reported.saturating_sub(outside).saturating_sub(unwanted);
        Points { inside, outside, refused, unwanted, passed, again }
    }

    /// The same points, where a wrong mount puts all that were kept where no map reaches: they lie outside.
    pub fn within_reach(&self, points: Points, reach: impl Fn(&Reflection) -> bool) -> Points {
        if self.reflections.iter().any(reach) {
            return points;
        }
        let kept = u32::try_from(self.reflections.len())
            .unwrap_or(u32::MAX)
            .saturating_add(self.rejections.count(Rejection::Overflow));
        Points { inside: points.inside.saturating_sub(kept), outside: points.outside.saturating_add(kept), ..points }
    }

    /// What was kept.
    pub fn reflections(&self) -> &[Reflection] {
        &self.reflections
    }

    /// What was not, by reason.
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }
}

/// Priorities there are.
const PRIORITIES: usize = 1 << u8::BITS;

/// How many detections have which priority.
struct Priorities([u16; PRIORITIES]);

impl Priorities {
    fn count(&mut self, priority: u8) {
        if let Some(n) = self.0.get_mut(usize::from(priority)) {
            *n = n.saturating_add(1);
        }
    }

    /// What it takes to be among the `room` greatest.
    fn greatest(&self, room: usize) -> Greatest {
        let mut left = room;
        let mut least = u8::MAX;
        for n in self.0.iter().rev() {
            match left.checked_sub(usize::from(*n)) {
                Some(rest) => left = rest,
                None => return Greatest { least, of_least: left },
            }
            least = least.saturating_sub(1);
        }
        Greatest { least: 0, of_least: left }
    }
}

/// All above a priority, and the first so many of that priority.
struct Greatest {
    least: u8,
    of_least: usize,
}

impl Greatest {
    fn takes(&mut self, priority: u8) -> bool {
        if priority != self.least || self.of_least == 0 {
            return priority > self.least;
        }
        self.of_least -= 1;
        true
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::frame::gate::GateConfig;
    use crate::sensor::field_of_view::tests::VIEW;
    use crate::sensor::mount::Mount;
    use crate::sensor::noise::NoiseConfig;
    use std::vec::Vec as StdVec;

    /// A sensor as it may be installed.
    pub(crate) const MOUNT: Mount =
        Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };

    fn detection(range_cm: u16, strength: i16) -> Detection {
        Detection {
            range_cm,
            azimuth: Angle::ZERO,
            elevation: None,
            radial_velocity_cm_s: 0,
            rcs_half_dbsm: None,
            snr_half_db: Some(strength),
            marked: false,
        }
    }

    /// Detections of these strengths, each from a place of its own.
    fn scan<const D: usize>(strengths: &[i16]) -> Scan<D> {
        let of = |(i, s): (usize, &i16)| detection(1000 + i as u16 * 300, *s);
        gathered(&strengths.iter().enumerate().map(of).collect::<StdVec<_>>())
    }

    /// A frame of detections that all lie in the field of view.
    pub(crate) fn gathered<const D: usize>(detections: &[Detection]) -> Scan<D> {
        let gate = GateConfig::default().gate(&VIEW.limits().unwrap()).unwrap();
        let (noise, levelling) = (NoiseConfig::default().noise().unwrap(), MOUNT.levelling().unwrap());
        let mut scan = Scan::new();
        let status = FrameStatus { fault: false, refused: 7 };
        let marked = [Detection { marked: true, ..detection(2000, 40) }; 3];
        let all = marked.iter().chain(detections);
        let points = scan.gather(Time::from_micros(1), all, status, &gate, |d| noise.place(d, &levelling));
        let passed = detections.iter().filter(|d| gate.judge(d).is_ok()).count() as u32;
        let inside = detections.len() as u32;
        assert_eq!(points, Points { inside, outside: 0, refused: 7, unwanted: 3, passed, again: 0 });
        let counted = [Rejection::Refused, Rejection::Unwanted].map(|reason| scan.rejections().count(reason));
        assert_eq!(counted, [7, 3]);
        scan
    }

    /// Which of the detections stayed.
    fn kept<const D: usize>(s: &Scan<D>) -> StdVec<usize> {
        s.reflections().iter().map(|r| usize::from(r.ground_cm - 800) / 300).collect()
    }

    #[test]
    fn the_strongest_of_places_of_their_own_stay_and_the_rest_is_counted() {
        let s: Scan<3> = scan(&[20, 50, 30, 40, 10, 60]);
        assert_eq!(kept(&s), [1, 3, 5], "in order of arrival");
        assert_eq!(s.rejections().count(Rejection::Overflow), 3);
    }

    #[test]
    fn of_equals_the_first_stay() {
        assert_eq!(kept::<2>(&scan(&[20, 20, 20])), [0, 1]);
    }

    #[test]
    fn of_the_weakest_that_stay_the_first_do() {
        let s: Scan<4> = scan(&[20, 50, 20, 20, 50, 20]);
        assert_eq!(kept(&s), [0, 1, 2, 4]);
        assert_eq!(s.rejections().count(Rejection::Overflow), 2);
    }

    #[test]
    fn strengths_beyond_the_scale_count_as_its_end() {
        assert_eq!(kept::<2>(&scan(&[159, 160, 400, 12, 10_000])), [0, 1]);
    }

    #[test]
    fn gated_detections_do_not_count_against_the_cap() {
        let s: Scan<3> = scan(&[5, 5, 5, 30]);
        assert_eq!((s.reflections().len(), s.rejections().count(Rejection::Quality)), (1, 3));
    }

    #[test]
    fn a_weak_detection_of_a_place_of_its_own_stays_before_the_third_of_a_strong_one() {
        let strong = detection(1000, 80);
        let far = detection(9000, 20);
        let s: Scan<3> = gathered(&[strong, strong, strong, strong, far]);
        assert_eq!(s.reflections().iter().map(|r| r.ground_cm > 8000).collect::<StdVec<_>>(), [false, false, true]);
    }
}
