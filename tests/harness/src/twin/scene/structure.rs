//! What stands still beside or over the road: barriers, sign gantries, parked vehicles.

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use crate::geometry::solid::Solid;
use crate::recording::truth::Label;
use crate::twin::body::{Block, blocks};
use crate::twin::random::{Dice, Use, name};
use crate::twin::scatter::{Scatterer, scatterers};
use crate::twin::traffic::types::{Class, Kind};
use crate::twin::world::Sides;

/// Longest piece a long structure is cut into, metres: labels and shadows stay near what they are of.
pub const PIECE_M: f64 = 50.0;
/// The same where the road is not flat: pieces are level, one after another follows it.
pub const PIECE_ON_GRADE_M: f64 = 8.0;
/// Spread of RCS among posts, dB (standard deviation; assumption).
const POST_SPREAD_DB: f64 = 4.0;

/// One element of `[[static]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Structure {
    pub id: String,
    /// `barrier`, `sign_gantry` or any other word; a class of vehicle is one that is parked.
    pub class: String,
    /// Middle of the footprint, road frame, metres.
    pub center: [f64; 2],
    /// Direction of its length from the road's x axis, counter-clockwise.
    #[serde(default)]
    pub heading_deg: f64,
    pub length_m: Option<f64>,
    pub width_m: Option<f64>,
    pub height_m: Option<f64>,
    /// Height of its lower edge above the road: a sign hangs.
    #[serde(default)]
    pub bottom_m: f64,
    pub posts: Option<Posts>,
    /// Its long sides mirror waves with this loss, one way.
    pub mirror_loss_db: Option<f64>,
}

/// What returns waves along both long sides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Posts {
    pub spacing_m: f64,
    /// Mean RCS of one.
    pub rcs_dbsm: f64,
    /// Height above the structure's lower edge.
    pub height_m: f64,
}

/// One piece, ready to be put into the world.
#[derive(Debug, Clone)]
pub struct Piece {
    pub label: Label,
    pub blocks: Vec<Block>,
    pub scatterers: Vec<Scatterer>,
    pub sides: Sides,
}

impl Structure {
    fn size(&self) -> Option<[f64; 3]> {
        let class = Class::named(&self.class).map(Class::size);
        let [length, width, height] = [self.length_m, self.width_m, self.height_m];
        Some([length.or(class.map(|s| s[0]))?, width.or(class.map(|s| s[1]))?, height.or(class.map(|s| s[2]))?])
    }

    fn solid(&self, size: [f64; 3]) -> Solid {
        let [x, y] = self.center;
        Solid { center: [x, y, self.bottom_m + size[2] / 2.0], yaw_rad: self.heading_deg.to_radians(), size }
    }

    /// Whether a place is inside.
    pub fn holds(&self, [x, y, z]: [f64; 3]) -> bool {
        self.size().is_some_and(|size| {
            let solid = self.solid(size);
            solid.footprint_distance([x, y]) <= 0.0 && (solid.bottom()..=solid.top()).contains(&z)
        })
    }

    /// # Errors
    /// Names the element and the figure.
    pub fn check(&self) -> Result<()> {
        let id = &self.id;
        ensure!(!id.is_empty(), "an element of [[static]] has an empty id");
        let Some(size) = self.size() else {
            bail!("static `{id}`: class `{}` has no default size; give length_m, width_m and height_m", self.class);
        };
        for (what, value, most) in
            [("length_m", size[0], 10_000.0), ("width_m", size[1], 1000.0), ("height_m", size[2], 100.0)]
        {
            ensure!(value >= 0.01 && value <= most, "static `{id}`: {what} is {value}, it must lie in 0.01 to {most}");
        }
        for (what, value) in [("center", self.center[0]), ("center", self.center[1]), ("heading_deg", self.heading_deg)]
        {
            ensure!(value.is_finite() && value.abs() < 1e5, "static `{id}`: {what} is {value}");
        }
        ensure!((0.0..=50.0).contains(&self.bottom_m), "static `{id}`: bottom_m is {}", self.bottom_m);
        if let Some(posts) = &self.posts {
            ensure!(posts.spacing_m >= 0.1, "static `{id}`: posts.spacing_m is {}", posts.spacing_m);
            ensure!(posts.rcs_dbsm.is_finite(), "static `{id}`: posts.rcs_dbsm is {}", posts.rcs_dbsm);
            ensure!(posts.height_m.is_finite(), "static `{id}`: posts.height_m is {}", posts.height_m);
        }
        if let Some(loss) = self.mirror_loss_db {
            ensure!(loss >= 0.0, "static `{id}`: mirror_loss_db is {loss}, a mirror does not amplify");
        }
        Ok(())
    }

    /// The structure in pieces of at most so many metres. What differs from post to post is drawn from the seed.
    pub fn pieces(&self, seed: u64, longest_m: f64) -> Vec<Piece> {
        let Some(size) = self.size() else { return Vec::new() };
        let mut dice = Dice::new(seed, Use::Structure, name(&self.id));
        if let Some(class) = Class::named(&self.class) {
            let kind = Kind { class, size };
            let sides = if matches!(class, Class::Truck | Class::Bus) { Sides::Vehicle } else { Sides::Dull };
            let label = self.label(self.id.clone(), self.solid(size));
            return vec![Piece { label, blocks: blocks(&kind), scatterers: scatterers(&kind, &mut dice), sides }];
        }
        let whole = self.solid(size);
        let count = (size[0] / longest_m).ceil().max(1.0);
        let length = size[0] / count;
        let sides = self.mirror_loss_db.map_or(Sides::Dull, |loss_db| Sides::Structure { loss_db });
        (0..count as u32)
            .map(|k| {
                let [x, y] = whole.global([(f64::from(k) + 0.5) * length - size[0] / 2.0, 0.0]);
                let solid = Solid { center: [x, y, whole.center[2]], size: [length, size[1], size[2]], ..whole };
                let block = Block {
                    ahead: [-length / 2.0, length / 2.0],
                    left: [-size[1] / 2.0, size[1] / 2.0],
                    up: [0.0, size[2]],
                };
                let id = if count > 1.0 { format!("{}/{}", self.id, k + 1) } else { self.id.clone() };
                let scatterers = self.posts.map_or_else(Vec::new, |p| posts(p, solid.size, &mut dice));
                Piece { label: self.label(id, solid), blocks: vec![block], scatterers, sides }
            })
            .collect()
    }

    fn label(&self, id: String, solid: Solid) -> Label {
        Label { time_ns: 0, id, class: self.class.clone(), solid }
    }
}

/// Posts on both long sides, each seen from its own.
fn posts(posts: Posts, [length, width, _]: [f64; 3], dice: &mut Dice) -> Vec<Scatterer> {
    const OFF: f64 = 0.02;
    let count = (length / posts.spacing_m).floor().max(1.0);
    let mut list = Vec::new();
    for k in 0..count as u32 {
        let ahead = (f64::from(k) + 0.5) * length / count - length / 2.0;
        for side in [1.0, -1.0] {
            list.push(Scatterer {
                position: [ahead, side * (width / 2.0 + OFF), posts.height_m],
                outward: Some([0.0, side]),
                sharpness: 0.3,
                rcs_dbsm: posts.rcs_dbsm + POST_SPREAD_DB * dice.normal(),
                wheel: false,
                inside: false,
            });
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    fn barrier() -> Structure {
        Structure {
            id: "median".into(),
            class: "barrier".into(),
            center: [100.0, 1.0],
            heading_deg: 0.0,
            length_m: Some(240.0),
            width_m: Some(0.6),
            height_m: Some(0.9),
            bottom_m: 0.0,
            posts: Some(Posts { spacing_m: 4.0, rcs_dbsm: -10.0, height_m: 0.5 }),
            mirror_loss_db: None,
        }
    }

    #[test]
    fn a_long_barrier_comes_in_pieces_that_join() {
        let pieces = barrier().pieces(1, PIECE_M);
        assert_eq!(pieces.len(), 5);
        let edges: Vec<[f64; 2]> = pieces
            .iter()
            .map(|p| [-1.0, 1.0].map(|e| p.label.solid.center[0] + e * p.label.solid.size[0] / 2.0))
            .collect();
        assert!((edges[0][0] + 20.0).abs() < 1e-9 && (edges[4][1] - 220.0).abs() < 1e-9);
        assert!(edges.windows(2).all(|e| (e[0][1] - e[1][0]).abs() < 1e-9));
        assert_eq!(pieces.iter().map(|p| p.scatterers.len()).sum::<usize>(), 5 * 2 * 12);
        assert_eq!(pieces[1].label.id, "median/2");
    }

    #[test]
    fn a_parked_truck_is_a_truck() {
        let parked = Structure { class: "truck".into(), length_m: None, width_m: None, height_m: None, ..barrier() };
        parked.check().unwrap();
        let pieces = parked.pieces(1, PIECE_M);
        assert_eq!((pieces.len(), pieces[0].label.solid.size), (1, Class::Truck.size()));
        assert!(pieces[0].blocks.len() > 3 && pieces[0].sides == Sides::Vehicle);
        assert!(parked.holds([100.0, 1.0, 2.0]) && !parked.holds([100.0, 1.0, 6.0]));
    }

    #[test]
    fn impossible_structures_are_named() {
        let error = |s: Structure| s.check().unwrap_err().to_string();
        assert!(
            error(Structure { length_m: None, ..barrier() }).contains("`median`: class `barrier` has no default size")
        );
        assert!(error(Structure { height_m: Some(-1.0), ..barrier() }).contains("height_m is -1"));
        assert!(error(Structure { center: [f64::NAN, 0.0], ..barrier() }).contains("center is NaN"));
    }
}
