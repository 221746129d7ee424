//! Gain of the antenna and the strength of a path.

use super::Radar;
use super::model::Antenna;

impl Antenna {
    /// One-way gain relative to the boresight, dB: `-min(12 (angle / beam)^2, side lobe)`, both angles together.
    pub fn gain_db(&self, azimuth_rad: f64, elevation_rad: f64) -> f64 {
        let fall = |angle_rad: f64, beam_deg: f64| 12.0 * (angle_rad.to_degrees() / beam_deg).powi(2);
        let down = fall(azimuth_rad, self.azimuth_beam_deg) + fall(elevation_rad, self.elevation_beam_deg);
        -down.min(self.side_lobe_db)
    }
}

/// Range and RCS the reference SNR is stated for.
const REFERENCE_M: f64 = 100.0;
const REFERENCE_DBSM: f64 = 10.0;

impl Radar {
    /// SNR of an RCS at a range, with the two-way gain of its direction, dB (the radar equation).
    pub fn snr_db(&self, rcs_dbsm: f64, range_m: f64, two_way_gain_db: f64) -> f64 {
        self.model.reference_snr_db + rcs_dbsm - REFERENCE_DBSM + two_way_gain_db
            - 40.0 * (range_m / REFERENCE_M).log10()
    }

    /// The RCS that an SNR means there, dBsm; the inverse of [`Radar::snr_db`].
    pub fn rcs_dbsm(&self, snr_db: f64, range_m: f64, two_way_gain_db: f64) -> f64 {
        snr_db - self.snr_db(0.0, range_m, two_way_gain_db)
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::RadarModel;
    use super::*;
    use crate::geometry::pose::SensorPose;
    use crate::recording::FieldOfView;

    fn radar() -> Radar {
        Radar {
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            field_of_view: FieldOfView { azimuth_rad: [-1.0, 1.0], elevation_rad: [-0.3, 0.3], range_m: [3.0, 200.0] },
            has_elevation: true,
            model: RadarModel::default(),
        }
    }

    #[test]
    fn the_beam_is_3_db_down_at_half_its_width() {
        let a = Antenna::default();
        assert_eq!(a.gain_db(0.0, 0.0), 0.0);
        assert!((a.gain_db(45_f64.to_radians(), 0.0) + 3.0).abs() < 1e-9);
        assert!((a.gain_db(0.0, -8_f64.to_radians()) + 3.0).abs() < 1e-9);
        assert_eq!(a.gain_db(0.0, 1.5), -a.side_lobe_db);
    }

    #[test]
    fn twice_the_range_is_a_sixteenth_of_the_power() {
        let r = radar();
        assert_eq!(r.snr_db(10.0, 100.0, 0.0), r.model.reference_snr_db);
        assert!((r.snr_db(10.0, 100.0, 0.0) - r.snr_db(10.0, 200.0, 0.0) - 12.041).abs() < 1e-3);
        assert!((r.rcs_dbsm(r.snr_db(7.0, 150.0, -3.0), 150.0, -3.0) - 7.0).abs() < 1e-9);
    }
}
