//! What differs between the original and its clones, as a table.

use crate::frame::detection::Detection;
use crate::inputs::polar::spherical;
use crate::inputs::signal::{Quantity, Signal};

/// How a status message announces clusters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CountRule {
    /// Near ones in byte 0, far ones in byte 1, to be added.
    NearAndFar,
    /// One number in both bytes.
    Wide,
}

/// Where and in which scale a general message holds its entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct General {
    /// The entry's number.
    pub number: Signal,
    /// Distance to the front, centimetres.
    pub front_cm: Quantity,
    /// Distance to the left, centimetres.
    pub left_cm: Quantity,
    /// Height, centimetres, where there is one.
    pub up_cm: Option<Quantity>,
    /// Velocity to the front, cm/s.
    pub front_cm_s: Quantity,
    /// Velocity to the left, cm/s, where there is one.
    pub left_cm_s: Option<Quantity>,
    /// Whether and how it moves.
    pub dynamics: Signal,
    /// Radar cross-section, half dBsm.
    pub rcs_half_dbsm: Quantity,
}

/// A radar with this interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ars408Profile {
    /// Name of the product family.
    pub name: &'static str,
    /// How clusters are announced.
    pub clusters: CountRule,
    /// A cluster.
    pub cluster: General,
    /// An object.
    pub object: General,
}

/// The original's clusters.
const CLUSTER: General = General {
    number: Signal::new(7, 8),
    front_cm: Quantity::new(Signal::new(15, 13), 20, -50_000),
    left_cm: Quantity::new(Signal::new(17, 10), 20, -10_230),
    up_cm: None,
    front_cm_s: Quantity::new(Signal::new(39, 10), 25, -12_800),
    left_cm_s: Some(Quantity::new(Signal::new(45, 9), 25, -6_400)),
    dynamics: Signal::new(50, 3),
    rcs_half_dbsm: Quantity::new(Signal::new(63, 8), 1, -128),
};

/// The original's objects: the lateral distance has a bit more.
const OBJECT: General = General { left_cm: Quantity::new(Signal::new(18, 11), 20, -20_460), ..CLUSTER };

/// A clone's clusters: steps of 5 cm and 5 cm/s, and a height in place of the lateral speed.
const SR75_CLUSTER: General = General {
    front_cm: Quantity::new(Signal::new(15, 13), 5, -10_000),
    left_cm: Quantity::new(Signal::new(18, 11), 5, -5_000),
    up_cm: Some(Quantity::new(Signal::new(45, 9), 25, -6_400)),
    front_cm_s: Quantity::new(Signal::new(39, 10), 5, -1_600),
    left_cm_s: None,
    ..CLUSTER
};

impl Ars408Profile {
    /// ARS404, ARS408, SRR308, and clones that copied all of it (Nanoradar MR76).
    pub const ARS408: Self = Self { name: "ARS408", clusters: CountRule::NearAndFar, cluster: CLUSTER, object: OBJECT };

    /// Nanoradar SR75: the identifiers of the original with scales of its own. Taken from public drivers,
    /// not from the vendor: compare a few distances with the truth before relying on it.
    pub const SR75: Self =
        Self { name: "SR75", clusters: CountRule::Wide, cluster: SR75_CLUSTER, object: SR75_CLUSTER };

    /// All profiles.
    pub const ALL: [Self; 2] = [Self::ARS408, Self::SR75];

    /// The profile of a name, in any case.
    pub fn named(name: &str) -> Option<&'static Self> {
        static ALL: [Ars408Profile; 2] = Ars408Profile::ALL;
        ALL.iter().find(|p| p.name.eq_ignore_ascii_case(name))
    }
}

impl General {
    /// Number and detection of an entry; no detection where the distance is none.
    #[allow(clippy::cast_possible_truncation)] // numbers have 8 bits, quantities are checked
    pub fn read(&self, word: u64) -> (u16, Option<Detection>) {
        let number = self.number.get(word) as u16;
        let (x, y) = (self.front_cm.get(word), self.left_cm.get(word));
        let z = self.up_cm.map(|up| up.get(word));
        let velocity = [self.front_cm_s.get(word), self.left_cm_s.map_or(0, |left| left.get(word))];
        let detection = spherical([x, y, z.unwrap_or(0)]).map(|place| Detection {
            range_cm: place.range_cm,
            azimuth: place.azimuth,
            elevation: z.map(|_| place.elevation),
            // a speed towards the front alone is one along the line of sight already
            radial_velocity_cm_s: match self.left_cm_s {
                Some(_) => place.radial([x, y], velocity),
                None => velocity[0] as i16,
            },
            rcs_half_dbsm: Some(self.rcs_half_dbsm.get(word) as i16),
            snr_half_db: None,
            marked: false,
        });
        (number, detection)
    }
}
