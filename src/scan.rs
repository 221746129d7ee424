//! The detections of one radar frame that the estimators use: gated, placed, and never too many.

use heapless::Vec;

use crate::detection::Detection;
use crate::gate::{Gate, Rejection, Rejections};
use crate::mount::Levelling;
use crate::reflection::{Noise, Reflection};

/// Up to `D` reflections, the strongest of the frame; a late one takes the place of the one it replaced.
///
/// # Limits
/// When the list is full the weakest makes room for a stronger one and is counted as
/// [`Rejection::Overflow`]; of equals the first stays. A replacement costs one pass over `D` at most, and one
/// in all for those of equal strength.
#[derive(Debug, Clone)]
pub struct Scan<const D: usize> {
    reflections: Vec<Reflection, D, u16>,
    /// Place and strength of the weakest, known once the list is full.
    weakest: Option<(usize, i16)>,
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
        Self { reflections: Vec::new(), weakest: None, rejections: Rejections::NONE }
    }

    /// Starts over for the next frame.
    pub fn clear(&mut self) {
        self.reflections.clear();
        self.weakest = None;
        self.rejections = Rejections::NONE;
    }

    /// Takes a detection with its height, where measured, or counts why not.
    pub fn add(&mut self, d: &Detection, gate: &Gate, noise: &Noise, levelling: &Levelling) {
        self.add_with(d, gate, || Reflection { height_cm: noise.height(d, levelling), ..noise.place(d, levelling) });
    }

    /// Takes a detection without its height, or counts why not.
    pub fn add_flat(&mut self, d: &Detection, gate: &Gate, noise: &Noise, levelling: &Levelling) {
        self.add_with(d, gate, || noise.place(d, levelling));
    }

    fn add_with(&mut self, d: &Detection, gate: &Gate, place: impl Fn() -> Reflection) {
        if let Err(reason) = gate.judge(d) {
            self.rejections.add(reason);
            return;
        }
        if self.reflections.len() < D.min(gate.max_detections) {
            let _ = self.reflections.push(place());
            return;
        }
        self.rejections.add(Rejection::Overflow);
        let (weakest, strength) = self.weakest.unwrap_or_else(|| self.find_weakest());
        if d.strength() > strength {
            if let Some(slot) = self.reflections.get_mut(weakest) {
                *slot = place();
            }
            self.weakest = Some(self.next_weakest(weakest, strength));
        } else {
            self.weakest = Some((weakest, strength));
        }
    }

    /// The weakest once the one at a place has gone: its equals all stand before it.
    fn next_weakest(&self, gone: usize, strength: i16) -> (usize, i16) {
        let before = self.reflections.get(..gone).unwrap_or(&[]);
        match before.iter().rposition(|r| r.strength == strength) {
            Some(i) => (i, strength),
            None => self.find_weakest(),
        }
    }

    /// The last of the weakest: of equals the first to arrive stays longest.
    fn find_weakest(&self) -> (usize, i16) {
        let mut found = (0, i16::MAX);
        for (i, r) in self.reflections.iter().enumerate() {
            if r.strength <= found.1 {
                found = (i, r.strength);
            }
        }
        found
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::field_of_view::FieldOfView;
    use crate::gate::GateConfig;
    use crate::mount::Mount;
    use crate::reflection::NoiseConfig;
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
        let mut scan = Scan::new();
        for (i, &s) in strengths.iter().enumerate() {
            let d = Detection {
                range_cm: 1000 + i as u16 * 100,
                azimuth: Angle::ZERO,
                elevation: None,
                radial_velocity_cm_s: 0,
                rcs_half_dbsm: None,
                snr_half_db: Some(s),
            };
            scan.add(&d, &gate, &NoiseConfig::default().noise().unwrap(), &mount.levelling().unwrap());
        }
        scan
    }

    #[test]
    fn the_strongest_stay_and_the_rest_is_counted() {
        let s: Scan<3> = scan(&[20, 50, 30, 40, 10, 60]);
        let kept: StdVec<i16> = s.reflections().iter().map(|r| r.strength).collect();
        assert_eq!(kept, [40, 50, 60]);
        assert_eq!(s.rejections().count(Rejection::Overflow), 3);
    }

    #[test]
    fn of_equals_the_first_stay() {
        let s: Scan<2> = scan(&[20, 20, 20]);
        let kept: StdVec<u16> = s.reflections().iter().map(|r| r.ground_cm / 100).collect();
        assert_eq!(kept, [8, 9]);
    }

    #[test]
    fn gated_detections_do_not_count_against_the_cap() {
        let s: Scan<3> = scan(&[5, 5, 5, 30]);
        assert_eq!((s.reflections().len(), s.rejections().count(Rejection::Quality)), (1, 3));
    }
}
