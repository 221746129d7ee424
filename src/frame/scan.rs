//! The detections of one radar frame that the estimators use: gated, placed, and never too many.

use heapless::Vec;

use crate::frame::detection::Detection;
use crate::frame::gate::{Gate, Rejection, Rejections};
use crate::frame::health::Points;
use crate::frame::reflection::Reflection;

/// Up to `D` reflections, the strongest of the frame, in order of arrival.
///
/// # Limits
/// When more pass the gate, the strongest stay, of equals the first to arrive; the others are counted as
/// [`Rejection::Overflow`]. Strengths below -48 dB and above 79.5 dB count as these. The cost is two looks at
/// every detection at most, however many there are and in whatever order they come.
#[derive(Debug, Clone)]
pub struct Scan<const D: usize> {
    reflections: Vec<Reflection, D, u16>,
    rejections: Rejections,
}

impl<const D: usize> Default for Scan<D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const D: usize> Scan<D> {
    /// An empty scan.
    pub const fn new() -> Self {
        Self { reflections: Vec::new(), rejections: Rejections::NONE }
    }

    /// Takes the detections of a frame that pass the gate, as `place` places them, in the place of the last
    /// frame's, and counts why others do not, the `refused` points among them. Returns where all of them were.
    pub fn gather<'a>(
        &mut self,
        detections: impl Iterator<Item = &'a Detection> + Clone,
        refused: u16,
        gate: &Gate,
        place: impl Fn(&Detection) -> Reflection,
    ) -> Points {
        self.reflections.clear();
        self.rejections = Rejections::NONE;
        self.rejections.add_many(Rejection::Refused, refused.into());
        let room = D.min(gate.max_detections);
        let mut kept: Vec<&Detection, D, u16> = Vec::new();
        let mut strengths = Strengths([0; STEPS]);
        let (mut reported, mut passed) = (0_u32, 0);
        let mut arriving = detections;
        let mut late = None;
        while let Some(d) = arriving.next() {
            reported = reported.saturating_add(1);
            if let Err(reason) = gate.judge(d) {
                self.rejections.add(reason);
                continue;
            }
            passed += 1;
            strengths.count(d);
            if passed > room {
                self.rejections.add(Rejection::Overflow);
                continue;
            }
            let _ = kept.push(d);
            if passed == room {
                late = Some(arriving.clone());
            }
        }
        if let Some(late) = late.filter(|_| passed > room) {
            let mut strongest = strengths.strongest(room);
            kept.retain(|d| strongest.takes(d));
            for d in late.filter(|d| gate.judge(d).is_ok()) {
                if strongest.takes(d) {
                    let _ = kept.push(d);
                }
            }
        }
        for d in kept {
            let _ = self.reflections.push(place(d));
        }
        let outside = self.rejections.outside();
        Points { inside: reported.saturating_sub(outside), outside, refused: refused.into() }
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

/// Steps of strength that are distinguished, of half a decibel.
const STEPS: usize = 256;

/// The first step's strength, half dB.
const LEAST_HALF_DB: i16 = -96;

fn step_of(d: &Detection) -> u8 {
    u8::try_from(d.strength().saturating_sub(LEAST_HALF_DB).max(0)).unwrap_or(u8::MAX)
}

/// How many detections are how strong.
struct Strengths([u16; STEPS]);

impl Strengths {
    fn count(&mut self, d: &Detection) {
        if let Some(n) = self.0.get_mut(usize::from(step_of(d))) {
            *n = n.saturating_add(1);
        }
    }

    /// What it takes to be among the `room` strongest.
    fn strongest(&self, room: usize) -> Strongest {
        let mut left = room;
        let mut least = u8::MAX;
        for n in self.0.iter().rev() {
            match left.checked_sub(usize::from(*n)) {
                Some(rest) => left = rest,
                None => return Strongest { least, of_least: left },
            }
            least = least.saturating_sub(1);
        }
        Strongest { least: 0, of_least: left }
    }
}

/// All that are stronger than a step, and the first so many of that step.
struct Strongest {
    least: u8,
    of_least: usize,
}

impl Strongest {
    fn takes(&mut self, d: &Detection) -> bool {
        let step = step_of(d);
        if step != self.least || self.of_least == 0 {
            return step > self.least;
        }
        self.of_least -= 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::frame::gate::GateConfig;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::mount::Mount;
    use crate::sensor::noise::NoiseConfig;
    use std::vec::Vec as StdVec;

    fn scan<const D: usize>(strengths: &[i16]) -> Scan<D> {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        };
        let gate = GateConfig::default().gate(&view.limits().unwrap()).unwrap();
        let detections: StdVec<Detection> = strengths
            .iter()
            .enumerate()
            .map(|(i, &s)| Detection {
                range_cm: 1000 + i as u16 * 100,
                azimuth: Angle::ZERO,
                elevation: None,
                radial_velocity_cm_s: 0,
                rcs_half_dbsm: None,
                snr_half_db: Some(s),
            })
            .collect();
        let (noise, levelling) = (NoiseConfig::default().noise().unwrap(), mount.levelling().unwrap());
        let mut scan = Scan::new();
        let points = scan.gather(detections.iter(), 7, &gate, |d| noise.place(d, &levelling));
        assert_eq!(points, Points { inside: strengths.len() as u32, outside: 0, refused: 7 });
        assert_eq!(scan.rejections().count(Rejection::Refused), 7);
        scan
    }

    #[test]
    fn the_strongest_stay_and_the_rest_is_counted() {
        let s: Scan<3> = scan(&[20, 50, 30, 40, 10, 60]);
        let kept: StdVec<i16> = s.reflections().iter().map(|r| r.strength).collect();
        assert_eq!(kept, [50, 40, 60], "in order of arrival");
        assert_eq!(s.rejections().count(Rejection::Overflow), 3);
    }

    #[test]
    fn of_equals_the_first_stay() {
        let s: Scan<2> = scan(&[20, 20, 20]);
        let kept: StdVec<u16> = s.reflections().iter().map(|r| r.ground_cm / 100).collect();
        assert_eq!(kept, [8, 9]);
    }

    #[test]
    fn of_the_weakest_that_stay_the_first_do() {
        let s: Scan<4> = scan(&[20, 50, 20, 20, 50, 20]);
        let kept: StdVec<(i16, u16)> = s.reflections().iter().map(|r| (r.strength, r.ground_cm / 100)).collect();
        assert_eq!(kept, [(20, 8), (50, 9), (20, 10), (50, 12)]);
        assert_eq!(s.rejections().count(Rejection::Overflow), 2);
    }

    #[test]
    fn strengths_beyond_the_scale_count_as_its_end() {
        let s: Scan<2> = scan(&[159, 160, 400, 12, 10_000]);
        let kept: StdVec<i16> = s.reflections().iter().map(|r| r.strength).collect();
        assert_eq!(kept, [159, 160]);
    }

    #[test]
    fn gated_detections_do_not_count_against_the_cap() {
        let s: Scan<3> = scan(&[5, 5, 5, 30]);
        assert_eq!((s.reflections().len(), s.rejections().count(Rejection::Quality)), (1, 3));
    }
}
