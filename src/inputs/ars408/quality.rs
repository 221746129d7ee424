//! The radar's own marks on its entries, and which of them are wanted.

use crate::inputs::signal::Signal;

/// Fields of the quality message of a cluster.
pub mod cluster {
    use super::Signal;

    /// Number of the cluster.
    pub const NUMBER: Signal = Signal::new(7, 8);
    /// Standard deviation of the distance to the front, an index of [`super::DEVIATION_MM`].
    pub const FRONT_RMS: Signal = Signal::new(15, 5);
    /// Of the distance to the left.
    pub const LEFT_RMS: Signal = Signal::new(10, 5);
    /// Of the velocity to the front, mm/s.
    pub const FRONT_SPEED_RMS: Signal = Signal::new(21, 5);
    /// Of the velocity to the left, mm/s.
    pub const LEFT_SPEED_RMS: Signal = Signal::new(16, 5);
    /// How likely it is an artefact.
    pub const FALSE_ALARM: Signal = Signal::new(26, 3);
    /// Why it is invalid, or what is odd about it.
    pub const INVALID: Signal = Signal::new(39, 5);
    /// Whether its Doppler velocity is ambiguous.
    pub const AMBIGUITY: Signal = Signal::new(34, 3);
}

/// Fields of the quality message of an object.
pub mod object {
    use super::Signal;

    /// Number of the object.
    pub const NUMBER: Signal = Signal::new(7, 8);
    /// Standard deviation of the distance to the front, an index of [`super::DEVIATION_MM`].
    pub const FRONT_RMS: Signal = Signal::new(15, 5);
    /// Of the distance to the left.
    pub const LEFT_RMS: Signal = Signal::new(10, 5);
    /// Of the velocity to the front, mm/s.
    pub const FRONT_SPEED_RMS: Signal = Signal::new(21, 5);
    /// Of the velocity to the left, mm/s.
    pub const LEFT_SPEED_RMS: Signal = Signal::new(16, 5);
    /// Of the acceleration to the front, mm/s².
    pub const FRONT_ACCELERATION_RMS: Signal = Signal::new(27, 5);
    /// Of the acceleration to the left, mm/s².
    pub const LEFT_ACCELERATION_RMS: Signal = Signal::new(38, 5);
    /// Of the orientation, an index of another table, in degrees.
    pub const ORIENTATION_RMS: Signal = Signal::new(33, 5);
    /// Whether it was measured in this scan.
    pub const MEASURED: Signal = Signal::new(52, 3);
    /// How likely it exists.
    pub const EXISTENCE: Signal = Signal::new(55, 3);
}

/// Standard deviations by their index, millimetres, mm/s or mm/s²: upper bounds. Index 31 is invalid.
pub static DEVIATION_MM: [u16; 31] = [
    5, 6, 8, 11, 14, 18, 23, 29, 38, 49, 63, 81, 105, 135, 174, 224, 288, 371, 478, 616, 794, 1023, 1317, 1697, 2187,
    2817, 3630, 4676, 6025, 7762, 10_000,
];

/// Which entries are wanted, by the radar's own marks. Entries without marks always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ars408Wanted {
    /// Bit `n`: clusters whose invalid state is `n`, see [`VALID_CLUSTERS`](Self::VALID_CLUSTERS).
    pub invalid_states: u32,
    /// Bit `n`: clusters whose ambiguity state is `n`.
    pub ambiguities: u8,
    /// Largest class of artefact probability: 1 is below 25 %, then 50, 75, 90, 99, 99.9, 100 %.
    pub most_false_alarm: u8,
    /// Bit `n`: objects whose measurement state is `n`.
    pub measured: u8,
    /// Smallest class of existence probability: 1 is below 25 %, then 50, 75, 90, 99, 99.9, 100 %.
    pub least_existence: u8,
}

impl Default for Ars408Wanted {
    fn default() -> Self {
        Self::MEASURED
    }
}

impl Ars408Wanted {
    /// Bit `n`: the radar itself calls clusters of state `n` valid. Besides plain ones (0x00) these are of a small cross section
    /// (0x04), corrected in azimuth for their elevation (0x08), probably a part of another (0x09), an artefact 50 degrees
    /// beside one (0x0A) or another (0x0C), no local maximum (0x0B), beyond 95 m in the near scan (0x0F), several targets (0x10), at
    /// a doubtful angle (0x11). Not among them: cross section too small (0x01), artefact of the near field (0x02), far
    /// but not confirmed near by (0x03), mirror image (0x06), outside the field of view (0x07), harmonic (0x0E), and what is reserved.
    ///
    /// # References
    /// The vendor's table, as nuScenes' devkit repeats it (`RadarPointCloud.from_file`, `nuscenes/utils/data_classes.py`).
    pub const VALID_CLUSTERS: u32 = 0x0003_9F11;

    /// Clusters that the radar calls valid, whose speed is known or that stand still; objects that were measured, not
    /// predicted or deleted.
    pub const MEASURED: Self = Self {
        invalid_states: Self::VALID_CLUSTERS,
        ambiguities: 1 << 3 | 1 << 4,
        most_false_alarm: 7,
        measured: 1 << 1 | 1 << 2 | 1 << 5,
        least_existence: 0,
    };

    /// All of them.
    pub const ALL: Self =
        Self { invalid_states: u32::MAX, ambiguities: 0xFF, most_false_alarm: 7, measured: 0xFF, least_existence: 0 };

    /// The same with clusters of these states and no others; `None` without any, and where one is above 31.
    pub fn with_clusters(self, states: impl IntoIterator<Item = u8>) -> Option<Self> {
        let bits = states.into_iter().try_fold(0, |bits, state| Some(bits | 1_u32.checked_shl(state.into())?));
        bits.filter(|bits| *bits != 0).map(|invalid_states| Self { invalid_states, ..self })
    }

    /// Whether a cluster with this quality message is wanted.
    pub const fn cluster(&self, word: u64) -> bool {
        self.invalid_states >> cluster::INVALID.get(word) & 1 == 1
            && self.ambiguities >> cluster::AMBIGUITY.get(word) & 1 == 1
            && cluster::FALSE_ALARM.get(word) <= self.most_false_alarm as u32
    }

    /// Whether an object with this quality message is wanted.
    pub const fn object(&self, word: u64) -> bool {
        self.measured >> object::MEASURED.get(word) & 1 == 1
            && object::EXISTENCE.get(word) >= self.least_existence as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::signal::word;

    #[test]
    fn a_clusters_marks_have_their_places() {
        // number 0x2A, deviations 3, 17, 9, 21, artefact class 5, invalid state 0x11, ambiguity 4
        let w = word(&[0x2A, 3 << 3 | 17 >> 2, (17 & 3) << 6 | 9 << 1 | 21 >> 4, (21 & 15) << 4 | 5, 0x11 << 3 | 4]);
        assert_eq!(w, word(&[0x2A, 0x1C, 0x53, 0x55, 0x8C]));
        use cluster::*;
        let fields = [NUMBER, FRONT_RMS, LEFT_RMS, FRONT_SPEED_RMS, LEFT_SPEED_RMS, FALSE_ALARM, INVALID, AMBIGUITY];
        assert_eq!(fields.map(|s| s.get(w)), [0x2A, 3, 17, 9, 21, 5, 0x11, 4]);
    }

    #[test]
    fn an_objects_marks_have_their_places() {
        // number 0x5F, 7 deviations 1 to 7, measured, existence class 6
        let w = word(&[0x5F, 1 << 3, 2 << 6 | 3 << 1, 4 << 4 | 5 >> 1, (5 & 1) << 7 | 6 << 2, 7 << 5, 6 << 5 | 2 << 2]);
        assert_eq!(w, word(&[0x5F, 0x08, 0x86, 0x42, 0x98, 0xE0, 0xC8]));
        use object::*;
        let fields = [
            NUMBER,
            FRONT_RMS,
            LEFT_RMS,
            FRONT_SPEED_RMS,
            LEFT_SPEED_RMS,
            FRONT_ACCELERATION_RMS,
            LEFT_ACCELERATION_RMS,
            ORIENTATION_RMS,
            MEASURED,
            EXISTENCE,
        ];
        assert_eq!(fields.map(|s| s.get(w)), [0x5F, 1, 2, 3, 4, 5, 6, 7, 2, 6]);
    }

    #[test]
    fn invalid_and_ambiguous_clusters_are_not_wanted_and_standing_ones_are() {
        let wanted = |invalid, ambiguity| {
            Ars408Wanted::default().cluster(cluster::AMBIGUITY.put(cluster::INVALID.put(0, invalid), ambiguity))
        };
        assert!(wanted(0, 3) && wanted(0, 4));
        assert!(!wanted(0, 1) && !wanted(1, 3) && !wanted(0x1F, 3));
        let valid: std::vec::Vec<u32> = (0..32).filter(|state| wanted(*state, 3)).collect();
        assert_eq!(valid, [0x00, 0x04, 0x08, 0x09, 0x0A, 0x0B, 0x0C, 0x0F, 0x10, 0x11], "the vendor's table");
        let of =
            |states: &[u8]| Ars408Wanted::default().with_clusters(states.iter().copied()).map(|w| w.invalid_states);
        assert_eq!((of(&[0, 31]), of(&[0, 32]), of(&[])), (Some(1 << 31 | 1), None, None));
        let strict = Ars408Wanted { most_false_alarm: 1, ..Ars408Wanted::ALL };
        assert!(strict.cluster(cluster::FALSE_ALARM.put(0, 1)) && !strict.cluster(cluster::FALSE_ALARM.put(0, 2)));
    }

    #[test]
    fn predicted_and_deleted_objects_are_not_wanted() {
        let wanted: std::vec::Vec<u32> =
            (0..8).filter(|state| Ars408Wanted::default().object(object::MEASURED.put(0, *state))).collect();
        assert_eq!(wanted, [1, 2, 5], "new, measured, new from merge");
        let sure = Ars408Wanted { least_existence: 6, ..Ars408Wanted::ALL };
        assert!(sure.object(object::EXISTENCE.put(0, 6)) && !sure.object(object::EXISTENCE.put(0, 5)));
    }

    #[test]
    fn deviations_come_from_the_table() {
        let at = |index: usize| DEVIATION_MM.get(index).copied();
        assert_eq!((at(0), at(30), at(31)), (Some(5), Some(10_000), None));
        assert!(DEVIATION_MM.is_sorted());
    }
}
