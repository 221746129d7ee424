//! What of a vehicle returns a wave: scattering points with a place, an outward side and an RCS.
//!
//! # Model
//! A vehicle is a handful of reflection centres: corners and lamps, wheels, the plates of its sides, axles
//! below, edges above; each returns over the range of aspects it is seen from, `cos^sharpness` of the angle
//! to its outward side. Trucks return low: their flat doors and walls stand upright and throw the wave
//! away, what returns it are bumpers, frames, axles and lamps.
//!
//! # References
//! - M. Bühren, B. Yang, "Automotive Radar Target List Simulation based on Reflection Center Representation
//!   of Objects", WIT 2006: corners, wheel houses and plates with ranges of aspect.
//! - K. Schuler, D. Becker, W. Wiesbeck, "Extraction of Virtual Scattering Centers of Vehicles by
//!   Ray-Tracing Simulations", IEEE Trans. Antennas and Propagation 56 (2008).
//! - RCS: W. Buller et al., "Radar Measurements of NHTSA's Surrogate Vehicle SS_V", DOT HS 811 817 (2013)
//!   (cars from behind, around 10 dBsm); J. Fortuny-Guasch, J.-M. Chareau, JRC report EUR 25762 (2013)
//!   (pedestrians at 77 GHz, around -8 dBsm); M. Skolnik, "Introduction to Radar Systems" (trucks some 10 dB
//!   above cars). How a total is shared among the points is an assumption.
//! - M. Meyer, G. Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D Object Detection", EuRAD 2019
//!   (Astyx HiRes2019): trucks have several times as many detections as cars at the same distance, over their
//!   whole length. `viewshed detections --real` compares: there about 6 times at 50 to 100 m, here about twice.

use super::body::{CAB_M, FRAME_M, truck_axles};
use super::random::Dice;
use super::traffic::types::{Class, Kind};

/// One reflection centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatterer {
    /// Ahead, left, up from the middle of the footprint on the road, metres.
    pub position: [f64; 3],
    /// Side it faces, a unit vector ahead and left; without one it returns to all sides.
    pub outward: Option<[f64; 2]>,
    /// Exponent of the cosine of the angle to that side.
    pub sharpness: f64,
    /// Mean RCS seen straight, dBsm.
    pub rcs_dbsm: f64,
    /// Turns with the wheels: its speed lies between none and twice the vehicle's.
    pub wheel: bool,
    /// Lies behind glass: its own vehicle does not block it.
    pub inside: bool,
}

/// Spread of RCS among vehicles of one kind, dB (standard deviation).
///
/// Buller and LeBlanc 2012 (IEEE APS, 25 cars) fitted distributions of about this width.
const VEHICLE_SPREAD_DB: f64 = 2.5;
/// Spread among the points of one vehicle, dB: no two cars have the same bumper.
const POINT_SPREAD_DB: f64 = 2.0;
/// Spread of the places of axles, seats and edges among vehicles of one kind, metres to each side.
const PLACE_SPREAD_M: f64 = 0.25;
/// How far a point stands off the surface that carries it, metres.
const OFF: f64 = 0.02;
/// Spacing of posts, rails and boxes along the side of a long vehicle, metres.
const SIDE_SPACING_M: f64 = 1.5;

/// Posts, tanks, boxes and brackets along a truck return to nearly all sides: between a post (0) and a rough
/// wall (2). With 3 and nothing between the axles, a truck at 50 to 100 m had hardly more detections than a car,
/// where real recordings have several times as many (see References).
const BRACKET_SHARPNESS: f64 = 1.0;

const AHEAD: [f64; 2] = [1.0, 0.0];
const BEHIND: [f64; 2] = [-1.0, 0.0];

/// Faces, so that a list reads like a vehicle.
struct Points {
    half: [f64; 2],
    height: f64,
    list: Vec<Scatterer>,
}

impl Points {
    fn add(&mut self, position: [f64; 3], outward: Option<[f64; 2]>, sharpness: f64, rcs_dbsm: f64) {
        self.list.push(Scatterer { position, outward, sharpness, rcs_dbsm, wheel: false, inside: false });
    }

    /// On the front (`AHEAD`) or rear (`BEHIND`) face, at a share of the width to the left.
    fn end(&mut self, facing: [f64; 2], across: f64, up: f64, sharpness: f64, rcs_dbsm: f64) {
        let ahead = facing[0] * (self.half[0] + OFF);
        self.add([ahead, across * self.half[1], up], Some(facing), sharpness, rcs_dbsm);
    }

    /// All four vertical edges, facing outward diagonally: the front pair and the rear pair.
    fn corners(&mut self, up: f64, front_dbsm: f64, rear_dbsm: f64) {
        for (facing, rcs) in [(1.0, front_dbsm), (-1.0, rear_dbsm)] {
            for side in [1.0, -1.0] {
                let outward = [facing, side].map(|v: f64| v * std::f64::consts::FRAC_1_SQRT_2);
                let place = [facing * (self.half[0] + OFF), side * (self.half[1] + OFF), up];
                self.add(place, Some(outward), 1.5, rcs);
            }
        }
    }

    /// On both sides, at a distance from the front.
    fn sides(&mut self, from_front: f64, up: f64, sharpness: f64, rcs_dbsm: f64, wheel: bool) {
        for side in [1.0, -1.0] {
            let place = [self.half[0] - from_front, side * (self.half[1] + OFF), up];
            let outward = Some([0.0, side]);
            self.list.push(Scatterer { position: place, outward, sharpness, rcs_dbsm, wheel, inside: false });
        }
    }

    /// Below the floor, seen from all sides where the gap lets a wave through.
    fn below(&mut self, from_front: f64, up: f64, rcs_dbsm: f64) {
        self.add([self.half[0] - from_front, 0.0, up], None, 0.0, rcs_dbsm);
    }

    /// Seats and steering gear behind the windows, from all sides; the glass is in the RCS.
    fn seats(&mut self, from_front: f64, up: f64, rcs_dbsm: f64) {
        let position = [self.half[0] - from_front, 0.0, up];
        self.list.push(Scatterer { position, outward: None, sharpness: 0.0, rcs_dbsm, wheel: false, inside: true });
    }

    /// Along the front and rear edge of the roof, seen from all around.
    fn roof(&mut self, from_front: [f64; 2], rcs_dbsm: f64) {
        for from_front in from_front {
            self.add([self.half[0] - from_front, 0.0, self.height + OFF], None, 0.0, rcs_dbsm);
        }
    }
}

/// The points of one vehicle; `dice` makes it differ from others of its kind.
pub fn scatterers(kind: &Kind, dice: &mut Dice) -> Vec<Scatterer> {
    let [length, width, height] = kind.size;
    let mut p = Points { half: [length / 2.0, width / 2.0], height, list: Vec::new() };
    match kind.class {
        Class::Car | Class::Van => {
            let more = if kind.class == Class::Van { 2.0 } else { 0.0 };
            p.end(BEHIND, 0.0, 0.55, 4.0, 5.0 + more);
            p.end(BEHIND, 0.6, 0.75, 3.0, 2.0 + more);
            p.end(BEHIND, -0.6, 0.75, 3.0, 2.0 + more);
            p.end(AHEAD, 0.0, 0.50, 4.0, 6.0 + more);
            p.end(AHEAD, 0.6, 0.65, 3.0, 2.0 + more);
            p.end(AHEAD, -0.6, 0.65, 3.0, 2.0 + more);
            p.corners(0.60, 3.0, 3.0);
            p.sides(0.42 * length, 0.65, 30.0, 12.0 + more, false);
            p.sides(0.62 * length, 0.65, 30.0, 12.0 + more, false);
            p.sides(0.30 * length, 0.95, 1.0, -6.0, false);
            p.sides(0.18 * length, 0.30, 2.0, 2.0, true);
            p.sides(0.78 * length, 0.30, 2.0, 2.0, true);
            p.below(0.18 * length, 0.15, 0.0);
            p.below(0.50 * length, 0.15, -3.0);
            p.below(0.78 * length, 0.15, 0.0);
            p.seats(0.45 * length, 0.65 * height, -2.0);
            p.seats(0.70 * length, 0.65 * height, -2.0);
            let roof =
                if kind.class == Class::Van { [0.2 * length, length - 0.05] } else { [0.34 * length, 0.9 * length] };
            p.roof(roof, -8.0);
        }
        Class::Truck => {
            for across in [-0.8, 0.0, 0.8] {
                p.end(BEHIND, across, 0.55, 4.0, 8.0);
            }
            p.end(BEHIND, 0.0, FRAME_M, 4.0, 6.0);
            p.end(BEHIND, 0.9, 2.4, 3.0, -1.0);
            p.end(BEHIND, -0.9, 2.4, 3.0, -1.0);
            for across in [-0.7, 0.0, 0.7] {
                p.end(AHEAD, across, 0.60, 4.0, 9.0);
            }
            p.end(AHEAD, 0.0, 1.60, 6.0, 7.0);
            p.corners(0.90, 7.0, 6.0);
            p.corners(2.60, 2.0, -2.0);
            let mut from_front = CAB_M + 0.7;
            while from_front < length - 0.8 {
                p.sides(from_front, 0.80, BRACKET_SHARPNESS, 4.0, false);
                p.sides(from_front, 1.25, 20.0, 6.0, false);
                p.below(from_front, 0.70, -1.0);
                from_front += SIDE_SPACING_M;
            }
            for [front, rear] in truck_axles(length) {
                let groups = (((rear - front) / 1.3) as u32).max(1);
                for k in 0..groups {
                    let place = front + (rear - front) * (f64::from(k) + 0.5) / f64::from(groups);
                    p.sides(place, 0.50, 2.0, 6.0, true);
                    // the front axle lies below the cab's floor
                    p.below(place, if place < CAB_M { 0.28 } else { 0.48 }, 5.0);
                }
            }
            p.roof([CAB_M + 0.5, length - 0.05], -3.0);
        }
        Class::Bus => {
            for across in [-0.7, 0.0, 0.7] {
                p.end(BEHIND, across, 0.60, 4.0, 7.0);
                p.end(AHEAD, across, 0.55, 4.0, 7.0);
            }
            p.corners(0.80, 6.0, 6.0);
            p.corners(2.40, 0.0, 0.0);
            let mut from_front = 1.0;
            while from_front < length - 0.5 {
                p.sides(from_front, 0.60, 2.0 * BRACKET_SHARPNESS, 4.0, false);
                p.sides(from_front, 1.00, 25.0, 7.0, false);
                from_front += SIDE_SPACING_M;
            }
            for place in [0.22 * length, 0.75 * length] {
                p.sides(place, 0.50, 2.0, 5.0, true);
                p.below(place, 0.22, 2.0);
            }
            p.roof([0.05, length - 0.05], -4.0);
        }
        Class::Motorcycle => {
            p.end(BEHIND, 0.0, 0.60, 1.0, 0.0);
            p.end(AHEAD, 0.0, 0.70, 1.0, 0.0);
            p.sides(0.5 * length, 0.50, 2.0, 4.0, false);
            p.sides(0.15 * length, 0.30, 2.0, -3.0, true);
            p.sides(0.85 * length, 0.30, 2.0, -3.0, true);
            p.below(0.5 * length, 0.04, -6.0);
        }
        Class::Bicycle => {
            p.end(BEHIND, 0.0, 0.70, 1.0, -6.0);
            p.end(AHEAD, 0.0, 0.90, 1.0, -6.0);
            p.sides(0.5 * length, 0.60, 2.0, -2.0, false);
            p.sides(0.18 * length, 0.34, 2.0, -6.0, true);
            p.sides(0.82 * length, 0.34, 2.0, -6.0, true);
        }
        Class::Pedestrian => {
            p.end(BEHIND, 0.0, 1.10, 0.5, -9.0);
            p.end(AHEAD, 0.0, 1.10, 0.5, -9.0);
            p.sides(0.5 * length, 0.60, 0.5, -12.0, false);
        }
    }
    let vehicle_db = VEHICLE_SPREAD_DB * dice.normal();
    for point in &mut p.list {
        if point.outward.is_none() {
            // what lies below, behind or above the walls lies somewhere else in every model
            point.position[0] += PLACE_SPREAD_M * dice.between(-1.0, 1.0);
            point.position[1] += PLACE_SPREAD_M * dice.between(-1.0, 1.0);
        }
        point.rcs_dbsm += vehicle_db + POINT_SPREAD_DB * dice.normal();
    }
    p.list
}

#[cfg(test)]
mod tests {
    use super::super::body::blocks;
    use super::super::random::Use;
    use super::*;

    fn of(class: Class) -> (Kind, Vec<Scatterer>) {
        let kind = Kind { class, size: class.size() };
        (kind, scatterers(&kind, &mut Dice::new(1, Use::Vehicle, 3)))
    }

    /// Sum over all points of a mean vehicle seen from a side, dBsm.
    fn total_dbsm(class: Class, toward: [f64; 2]) -> f64 {
        let kind = Kind { class, size: class.size() };
        const N: u64 = 400;
        let mut sum = 0.0;
        for n in 0..N {
            for s in scatterers(&kind, &mut Dice::new(1, Use::Vehicle, n)) {
                if s.position[2] < 0.3 {
                    continue; // what lies below is not seen
                }
                let cosine = s.outward.map_or(1.0, |o| (o[0] * toward[0] + o[1] * toward[1]).max(0.0));
                sum += 10_f64.powf(s.rcs_dbsm / 10.0) * cosine.powf(s.sharpness);
            }
        }
        10.0 * (sum / N as f64).log10()
    }

    #[test]
    fn totals_agree_with_what_is_measured() {
        let range = |class, toward, expected: f64| {
            let total = total_dbsm(class, toward);
            assert!((total - expected).abs() < 3.0, "{class:?} {toward:?}: {total:.1} dBsm, expected {expected}");
        };
        range(Class::Car, BEHIND, 11.0);
        range(Class::Car, [0.0, 1.0], 16.0);
        range(Class::Truck, BEHIND, 17.0);
        range(Class::Truck, [0.0, 1.0], 22.0);
        range(Class::Motorcycle, BEHIND, 2.0);
        range(Class::Pedestrian, AHEAD, -8.0);
    }

    #[test]
    fn only_seats_lie_inside_a_block_of_their_own_vehicle() {
        for class in Class::ALL {
            let (kind, points) = of(class);
            for s in points.into_iter().filter(|s| !s.inside) {
                let [a, l, u] = s.position;
                let inside = |r: [f64; 2], v: f64| r[0] < v && v < r[1];
                let hit =
                    blocks(&kind).into_iter().find(|b| inside(b.ahead, a) && inside(b.left, l) && inside(b.up, u));
                assert_eq!(hit, None, "{class:?} {s:?}");
            }
        }
    }

    #[test]
    fn two_cars_differ_and_one_stays_itself() {
        assert_eq!(of(Class::Car).1, of(Class::Car).1);
        let kind = of(Class::Car).0;
        assert_ne!(of(Class::Car).1, scatterers(&kind, &mut Dice::new(1, Use::Vehicle, 4)));
    }
}
