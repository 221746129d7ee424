//! One instant: everything that blocks or returns a wave, and the exact lines of sight past it.
//!
//! A path is tried against the boxes of every body that could stand in it; by the road it is the straight
//! line to the point's mirror image, past the boxes and past their mirror images. A box that is touched
//! only at its surface does not block. Where the road is not flat it hides, too, and mirrors about the height below each
//! point: a wave leaves it near what it meets, which stands low.

use super::body::{Block, FRAME_M};
use crate::geometry::ground::Ground;
use crate::geometry::solid::Solid;

/// Shortening at both ends of a path, so that a point on a surface is not blocked by that surface.
const END: f64 = 1e-6;

/// What stands somewhere: a vehicle or a structure.
#[derive(Debug, Clone)]
pub struct Body<'a> {
    /// Box of the ground truth.
    pub solid: Solid,
    /// m/s, road frame.
    pub velocity: [f64; 2],
    /// What blocks, in the body's own axes.
    pub blocks: &'a [Block],
    pub sides: Sides,
}

/// Whether the long sides of a body mirror waves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sides {
    Dull,
    /// The walls of a truck or bus, above its frame.
    Vehicle,
    /// A structure that loses this much, one way.
    Structure {
        loss_db: f64,
    },
}

/// An upright flat face that mirrors.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    pub body: usize,
    /// Points away from the body, horizontal.
    pub normal: [f64; 2],
    /// One way.
    pub loss_db: f64,
    middle: [f64; 2],
    half_m: f64,
    up: [f64; 2],
    /// The body's, m/s.
    velocity: [f64; 2],
}

impl Face {
    /// Distance of a place before the face, metres.
    pub fn distance(&self, p: [f64; 3]) -> f64 {
        (p[0] - self.middle[0]) * self.normal[0] + (p[1] - self.middle[1]) * self.normal[1]
    }

    pub fn mirrored(&self, p: [f64; 3]) -> [f64; 3] {
        let d = 2.0 * self.distance(p);
        [p[0] - d * self.normal[0], p[1] - d * self.normal[1], p[2]]
    }

    /// Velocity of the image of something that moves.
    pub fn mirrored_velocity(&self, v: [f64; 2]) -> [f64; 2] {
        let [nx, ny] = self.normal;
        let toward = 2.0 * ((v[0] - self.velocity[0]) * nx + (v[1] - self.velocity[1]) * ny);
        [v[0] - toward * nx, v[1] - toward * ny]
    }

    /// Whether a point of the face's plane lies on the face.
    pub fn holds(&self, p: [f64; 3]) -> bool {
        let along = (p[0] - self.middle[0]) * -self.normal[1] + (p[1] - self.middle[1]) * self.normal[0];
        along.abs() <= self.half_m && (self.up[0]..=self.up[1]).contains(&p[2])
    }
}

/// All bodies of one instant as one sensor sees them.
#[derive(Debug)]
pub struct World<'a> {
    pub bodies: Vec<Body<'a>>,
    /// The sensor in each body's own axes.
    eyes: Vec<[f64; 3]>,
    /// Bodies that could stand between the sensor and each body, itself included.
    between: Vec<Vec<usize>>,
    eye: [f64; 3],
    ground: Ground,
}

/// Directions a body covers, seen from above.
struct Extent {
    azimuth_rad: f64,
    half_rad: f64,
    near_m: f64,
    far_m: f64,
}

impl<'a> World<'a> {
    #[cfg(test)]
    pub fn new(eye: [f64; 3], bodies: Vec<Body<'a>>) -> Self {
        Self::over(&Ground::default(), eye, bodies)
    }

    /// Bodies that stand on ground which hides, too.
    pub fn over(ground: &Ground, eye: [f64; 3], bodies: Vec<Body<'a>>) -> Self {
        let extents: Vec<Extent> = bodies.iter().map(|b| extent(&b.solid, eye)).collect();
        let between = extents
            .iter()
            .enumerate()
            .map(|(k, own)| {
                let meets = |(i, other): (usize, &Extent)| {
                    let apart = turn(other.azimuth_rad - own.azimuth_rad).abs();
                    (i == k || (other.near_m < own.far_m && apart <= own.half_rad + other.half_rad)).then_some(i)
                };
                extents.iter().enumerate().filter_map(meets).collect()
            })
            .collect();
        let eyes = bodies.iter().map(|b| in_axes(&b.solid, eye)).collect();
        Self { bodies, eyes, between, eye, ground: ground.clone() }
    }

    /// A point of a body's own axes, in the road frame.
    pub fn place(&self, body: usize, [ahead, left, up]: [f64; 3]) -> [f64; 3] {
        let solid = &self.bodies[body].solid;
        let [x, y] = solid.global([ahead, left]);
        [x, y, solid.bottom() + up]
    }

    /// Whether nothing stands between the sensor and a point of a body (road frame); the body itself
    /// blocks it too, but for a point `inside`.
    pub fn in_sight(&self, body: usize, point: [f64; 3], inside: bool) -> bool {
        !self.ground.hides(self.eye, point)
            && self.between(body, inside).all(|i| !self.hit(i, self.eyes[i], point, Fold::None))
    }

    /// Whether the point is seen by way of the road: sensor, road, point.
    pub fn in_sight_by_road(&self, body: usize, point: [f64; 3], inside: bool) -> bool {
        let image = self.mirrored(point);
        self.fall_by_road(point) > 0.0
            && !self.ground.hides(self.eye, point)
            && self
                .between(body, inside)
                .all(|i| !self.hit(i, self.eyes[i], image, Fold::None) && !self.hit(i, self.eyes[i], image, Fold::Down))
    }

    /// Image of a point in the road.
    pub fn mirrored(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x, y, 2.0 * self.ground.height(x) - z]
    }

    /// How far the way from the sensor by the road to a point falls and rises again, metres; none where the sensor lies
    /// below the plane of the road at the point.
    pub fn fall_by_road(&self, [x, _, z]: [f64; 3]) -> f64 {
        let foot = self.ground.height(x);
        let above = self.eye[2] - (foot + self.ground.grade(x) * (self.eye[0] - x));
        if above > 0.0 { above + (z - foot) } else { 0.0 }
    }

    fn between(&self, body: usize, inside: bool) -> impl Iterator<Item = usize> {
        self.between[body].iter().copied().filter(move |i| !(inside && *i == body))
    }

    /// Whether nothing stands between two places.
    pub fn clear(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy).max(1e-9);
        !self.ground.hides(from, to)
            && (0..self.bodies.len()).all(|i| {
                let solid = &self.bodies[i].solid;
                // the path passes the body at more than its half diagonal
                let (cx, cy) = (solid.center[0] - from[0], solid.center[1] - from[1]);
                let aside = (dx * cy - dy * cx).abs() / length;
                let reach = 0.5 * solid.size[0].hypot(solid.size[1]);
                aside > reach || !self.hit(i, in_axes(solid, from), to, Fold::None)
            })
    }

    /// All faces that mirror; the walls of vehicles lose `vehicle_loss_db`.
    pub fn faces(&self, vehicle_loss_db: f64) -> Vec<Face> {
        let mut faces = Vec::new();
        for (k, body) in self.bodies.iter().enumerate() {
            let (loss_db, foot) = match body.sides {
                Sides::Dull => continue,
                Sides::Vehicle => (vehicle_loss_db, FRAME_M),
                Sides::Structure { loss_db } => (loss_db, 0.0),
            };
            let solid = &body.solid;
            let (s, c) = solid.yaw_rad.sin_cos();
            for side in [1.0, -1.0] {
                faces.push(Face {
                    body: k,
                    normal: [-s * side, c * side],
                    loss_db,
                    middle: solid.global([0.0, side * solid.size[1] / 2.0]),
                    half_m: solid.size[0] / 2.0,
                    up: [solid.bottom() + foot, solid.top()],
                    velocity: body.velocity,
                });
            }
        }
        faces
    }

    pub fn eye(&self) -> [f64; 3] {
        self.eye
    }

    fn hit(&self, body: usize, from: [f64; 3], to: [f64; 3], fold: Fold) -> bool {
        let Body { solid, blocks, .. } = &self.bodies[body];
        let to = in_axes(solid, to);
        let (floor, foot) = (solid.bottom(), self.ground.height(solid.center[0]));
        let outer = Block {
            ahead: [-solid.size[0] / 2.0, solid.size[0] / 2.0],
            left: [-solid.size[1] / 2.0, solid.size[1] / 2.0],
            up: [0.0, solid.size[2]],
        };
        crosses(from, to, &outer, [floor, foot], fold)
            && blocks.iter().any(|b| crosses(from, to, b, [floor, foot], fold))
    }
}

/// Whether boxes are taken as they stand or as the road mirrors them.
#[derive(Clone, Copy, PartialEq)]
enum Fold {
    None,
    Down,
}

/// Whether a segment passes through the inside of a block (both in the body's axes, heights those of the road frame; the
/// block's lowest, and the road's).
fn crosses(from: [f64; 3], to: [f64; 3], block: &Block, [floor, foot]: [f64; 2], fold: Fold) -> bool {
    let up = [floor + block.up[0], floor + block.up[1]];
    let up = if fold == Fold::Down { [2.0 * foot - up[1], 2.0 * foot - up[0]] } else { up };
    let (mut enter, mut leave) = (END, 1.0 - END);
    for (axis, [low, high]) in [block.ahead, block.left, up].into_iter().enumerate() {
        let step = to[axis] - from[axis];
        if step.abs() < 1e-12 {
            if from[axis] <= low || from[axis] >= high {
                return false;
            }
            continue;
        }
        let (a, b) = ((low - from[axis]) / step, (high - from[axis]) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
        if enter >= leave {
            return false;
        }
    }
    true
}

/// A road point in a body's axes; heights stay above the road.
fn in_axes(solid: &Solid, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [ahead, left] = solid.local([x, y]);
    [ahead, left, z]
}

fn extent(solid: &Solid, eye: [f64; 3]) -> Extent {
    let toward = |p: [f64; 2]| (p[1] - eye[1]).atan2(p[0] - eye[0]);
    let near_m = solid.footprint_distance([eye[0], eye[1]]);
    let far_m = solid.footprint().iter().map(|p| (p[0] - eye[0]).hypot(p[1] - eye[1])).fold(0.0, f64::max);
    let azimuth_rad = toward([solid.center[0], solid.center[1]]);
    // below the sensor, a body is in every direction
    let half_rad = if near_m < 0.1 {
        std::f64::consts::PI
    } else {
        solid.footprint().iter().map(|p| turn(toward(*p) - azimuth_rad).abs()).fold(0.0, f64::max) + 1e-3
    };
    Extent { azimuth_rad, half_rad, near_m, far_m }
}

/// An angle within half a turn to either side.
fn turn(angle_rad: f64) -> f64 {
    (angle_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    use super::super::body::blocks;
    use super::super::traffic::types::{Class, Kind};
    use super::*;
    use crate::geometry::sight::shadow;

    const EYE: [f64; 3] = [0.0, 0.0, 6.0];

    fn standing(class: Class, x: f64, y: f64, yaw_rad: f64) -> (Solid, Vec<Block>) {
        let size = class.size();
        let solid = Solid { center: [x, y, size[2] / 2.0], yaw_rad, size };
        (solid, blocks(&Kind { class, size }))
    }

    fn world(bodies: &[(Solid, Vec<Block>)]) -> World<'_> {
        World::new(
            EYE,
            bodies.iter().map(|(s, b)| Body { solid: *s, velocity: [0.0; 2], blocks: b, sides: Sides::Dull }).collect(),
        )
    }

    #[test]
    fn a_car_behind_a_truck_is_hidden_and_seen_beneath_it_by_the_road() {
        // far away the path is flat enough to pass below the frame from end to end
        let far = [standing(Class::Truck, 150.0, 0.0, 0.0), standing(Class::Car, 165.0, 0.0, 0.0)];
        let w = world(&far);
        let bumper = w.place(1, [-2.32, 0.0, 0.3]);
        assert!(!w.in_sight(1, bumper, false));
        assert!(w.in_sight_by_road(1, bumper, false), "between the wheels, below the frame");
        let wheel = w.place(1, [-2.32, 0.9, 0.3]);
        assert!(!w.in_sight_by_road(1, wheel, false), "the truck's wheels stand in the way");
        // at 60 m it would have to rise through the trailer's floor: similar triangles give 64 m at most
        let near = [standing(Class::Truck, 60.0, 0.0, 0.0), standing(Class::Car, 73.0, 0.0, 0.0)];
        let w = world(&near);
        assert!(!w.in_sight_by_road(1, w.place(1, [-2.32, 0.0, 0.15]), false));
        let aside = [standing(Class::Truck, 60.0, 0.0, 0.0), standing(Class::Car, 73.0, 4.0, 0.0)];
        let w = world(&aside);
        assert!(w.in_sight(1, w.place(1, [-2.32, 0.0, 0.5]), false));
    }

    #[test]
    fn a_body_hides_its_own_far_side_and_not_its_near_one() {
        let all = [standing(Class::Car, 40.0, 0.0, 0.0)];
        let w = world(&all);
        assert!(w.in_sight(0, w.place(0, [-2.32, 0.0, 0.5]), false));
        assert!(!w.in_sight(0, w.place(0, [2.32, 0.0, 0.5]), false));
        let turned = [standing(Class::Car, 40.0, 0.0, std::f64::consts::PI)];
        let w = world(&turned);
        assert!(w.in_sight(0, w.place(0, [2.32, 0.0, 0.5]), false), "now its front looks here");
    }

    #[test]
    fn sight_agrees_with_the_analytic_shadow_of_a_full_box() {
        let (solid, _) = standing(Class::Van, 40.0, 3.0, 0.4);
        let [l, wide, h] = solid.size;
        let whole = vec![Block { ahead: [-l / 2.0, l / 2.0], left: [-wide / 2.0, wide / 2.0], up: [0.0, h] }];
        let shade = shadow(EYE, &solid, 1.0).unwrap();
        let probe = Solid { center: [60.0, 0.0, 0.5], yaw_rad: 0.0, size: [90.0, 40.0, 1.0] };
        let all = [(solid, whole), (probe, Vec::new())];
        let w = world(&all);
        let mut hidden = 0;
        for i in 0..90 {
            for j in 0..40 {
                let p = [15.5 + f64::from(i), -19.5 + f64::from(j), 1.0];
                let blocked = !w.in_sight(1, p, false);
                assert_eq!(blocked, shade.contains([p[0], p[1]]), "{p:?}");
                assert_eq!(blocked, !w.clear(EYE, p), "{p:?}");
                hidden += u32::from(blocked);
            }
        }
        assert!(hidden > 50);
    }

    #[test]
    fn a_sign_over_the_road_blocks_what_looks_through_it_only() {
        let sign = Solid { center: [30.0, 0.0, 6.0], yaw_rad: 0.0, size: [0.3, 8.0, 1.5] };
        let plate = vec![Block { ahead: [-0.15, 0.15], left: [-4.0, 4.0], up: [0.0, 1.5] }];
        let all = [(sign, plate), standing(Class::Car, 60.0, 0.0, 0.0)];
        let w = world(&all);
        assert!(w.in_sight(1, w.place(1, [-2.32, 0.0, 0.5]), false), "below the sign");
        assert!(!w.clear(EYE, [200.0, 0.0, 6.0]));
    }

    #[test]
    fn a_face_mirrors_places_and_velocities_on_its_own_side() {
        let (solid, blocks) = standing(Class::Truck, 60.0, 5.0, 0.0);
        let truck = Body { solid, velocity: [20.0, 0.0], blocks: &blocks, sides: Sides::Vehicle };
        let w = World::new(EYE, vec![truck]);
        let faces = w.faces(10.0);
        // its right side is at y = 3.725 and faces -y
        let face = faces.iter().find(|f| f.normal[1] < 0.0).unwrap();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        close(face.distance([0.0, 0.0, 1.0]), 3.725);
        close(face.mirrored([50.0, 0.0, 1.0])[1], 7.45);
        let [along, across] = face.mirrored_velocity([25.0, 1.0]);
        close(along, 25.0);
        close(across, -1.0);
        assert!(face.holds([60.0, 3.725, 2.0]) && !face.holds([60.0, 3.725, 0.5]) && !face.holds([70.0, 3.725, 2.0]));
    }
}
