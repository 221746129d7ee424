//! Why cells are wrong: each with the vehicle that is not drawn as it is, or the box that hides too much.
//!
//! # Rule
//! A blocked cell called visible lies in the shadow of one vehicle or several, which share it. Where a box of the estimator
//! would hide it, too, the map's own cells lost it; a box hides its own place here, which the map shows. Otherwise its vehicle has no box yet, or none any more; or the box
//! would hide the cell if it were as high as the vehicle; or it is elsewhere, shorter, narrower or turned.
//!
//! A clear cell called invisible lies in the shadow of boxes, which share it: of one with no vehicle there, of one that
//! would not hide it if it were as low as its vehicle, or of one that is elsewhere or larger. What lies in none is beside one,
//! by less than cells and rounding are wide, or behind what stands unmoving in the grid.
//!
//! Box and vehicle belong together where the middle of one lies on the other's footprint, or `NEAR_M` beside it; of several
//! the nearest.

use std::collections::BTreeMap;

use serde::Serialize;
use viewshed::sensor::road::RoadPoint;

use super::cells::CellCounts;
use super::samples::FrameSamples;
use crate::estimators::Estimator;
use crate::geometry::polygon::{Convex, Point};
use crate::geometry::sight::shadow;
use crate::geometry::solid::Solid;
use crate::recording::Recording;
use crate::recording::truth::{Object, Track};

/// Every so manieth counted frame is looked at: a vehicle moves a car's length in so many, or stands.
const EVERY: usize = 5;
/// How far beside a footprint the middle of a box that belongs to it may lie, metres.
const NEAR_M: f64 = 0.7;
/// Slower stands, m/s.
const STANDS_MPS: f64 = 0.5;
/// A cell is beside a shadow where the box would hide it if it were so much wider and longer, and so much higher, metres.
const BESIDE_M: (f64, f64) = (1.0, 0.3);

/// Why a blocked cell is called visible, in the order of the table.
pub const WRONGLY_VISIBLE: [&str; 5] = [NO_BOX, LOST, TOO_LOW, TOO_SMALL, CELLS];
const NO_BOX: &str = "no box yet";
const LOST: &str = "no box any more";
const TOO_LOW: &str = "box too low";
const TOO_SMALL: &str = "box elsewhere or too small";
const CELLS: &str = "lost between cells";

/// Why a clear cell is called invisible, in the order of the table.
pub const WRONGLY_INVISIBLE: [&str; 5] = [NO_VEHICLE, TOO_HIGH, TOO_LARGE, BESIDE, NO_BOX_NEAR];
const NO_VEHICLE: &str = "box of no vehicle";
const TOO_HIGH: &str = "box too high";
const TOO_LARGE: &str = "box elsewhere or too large";
const BESIDE: &str = "beside the shadow of a box";
const NO_BOX_NEAR: &str = "no box near";

/// How a vehicle moves that a cell is put down to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Motion {
    Stands,
    Across,
    Along,
    Unmoving,
}

/// Cells by cause and motion, `None` where they are put down to no vehicle; shares of several vehicles add up.
type Shares = BTreeMap<(&'static str, Option<Motion>), f64>;

/// Wrong cells of one estimator by cause.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Causes {
    pub estimator: String,
    /// All cells that were looked at.
    pub cells: CellCounts,
    visible: Shares,
    invisible: Shares,
}

/// What one cause adds to a rate, points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    pub name: &'static str,
    pub points: f64,
    pub by_motion: ByMotion,
}

/// The same by how the vehicle moves, as the sensor sees it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByMotion {
    pub stands: f64,
    /// More across the line of sight than along it.
    pub across: f64,
    pub along: f64,
    /// What never moves: masts, parked cars.
    pub unmoving: f64,
    /// Put down to no vehicle.
    pub none: f64,
}

impl Causes {
    /// What adds up to the cells' FVR.
    pub fn wrongly_visible(&self) -> Vec<Cause> {
        listed(WRONGLY_VISIBLE, &self.visible, self.cells.blocked)
    }

    /// What adds up to the cells' FIR.
    pub fn wrongly_invisible(&self) -> Vec<Cause> {
        listed(WRONGLY_INVISIBLE, &self.invisible, self.cells.clear)
    }
}

impl std::ops::AddAssign<&Self> for Causes {
    fn add_assign(&mut self, o: &Self) {
        self.cells += o.cells;
        for (own, others) in [(&mut self.visible, &o.visible), (&mut self.invisible, &o.invisible)] {
            for (of, cells) in others {
                *own.entry(*of).or_default() += cells;
            }
        }
    }
}

fn listed<const N: usize>(names: [&'static str; N], cells: &Shares, of: u64) -> Vec<Cause> {
    let cause = |name| {
        let points = |motion| cells.get(&(name, motion)).map_or(0.0, |cells| 100.0 * cells / of as f64);
        let by_motion = ByMotion {
            stands: points(Some(Motion::Stands)),
            across: points(Some(Motion::Across)),
            along: points(Some(Motion::Along)),
            unmoving: points(Some(Motion::Unmoving)),
            none: points(None),
        };
        let ByMotion { stands, across, along, unmoving, none } = by_motion;
        Cause { name, points: stands + across + along + unmoving + none, by_motion }
    };
    names.map(cause).into()
}

/// Runs an estimator that has boxes over a recording again; `None` where the road is not flat or no cell is judged.
/// `progress` is called after each frame.
pub fn causes(
    recording: &Recording,
    estimator: &mut dyn Estimator,
    samples: &[FrameSamples],
    slice_height_m: f64,
    progress: &dyn Fn(),
) -> Option<Causes> {
    let truth = recording.truth.as_ref().filter(|_| recording.ground.is_level())?;
    let mut causes = Causes { estimator: estimator.name().to_owned(), ..Causes::default() };
    let mut had_box = vec![false; truth.tracks.len()];
    let moves: Vec<bool> = truth.tracks.iter().map(Track::moves).collect();
    let counted = samples.iter().map(|s| s.counted).scan(0, |n, counted| {
        *n += usize::from(counted);
        Some(counted && (*n - 1).is_multiple_of(EVERY))
    });
    for ((frame, sample), counted) in recording.frames.iter().zip(samples).zip(counted) {
        if recording.sensor.frames_independent {
            estimator.reset();
        }
        estimator.step(frame);
        progress();
        let instant = Instant::new(recording, truth.at(frame.time_ns), estimator.obstacles(), slice_height_m);
        for (object, own) in instant.objects.iter().zip(&instant.box_of) {
            had_box[object.track] |= own.is_some();
        }
        if !counted {
            continue;
        }
        for &((i, j), in_sight) in &sample.cells {
            let visible = estimator.map().at(RoadPoint::cell_centre(i, j)).visible();
            causes.cells.add(in_sight, visible);
            let at = [f64::from(i) + 0.5, f64::from(j) + 0.5];
            match (in_sight, visible) {
                (false, true) => instant.wrongly_visible(at, &had_box, &moves, &mut causes),
                (true, false) => instant.wrongly_invisible(at, &moves, &mut causes),
                _ => {}
            }
        }
    }
    Some(causes).filter(|c| c.cells.blocked + c.cells.clear > 0)
}

/// Vehicles and boxes of one frame, with their shadows.
struct Instant {
    sensor: [f64; 3],
    height_m: f64,
    objects: Vec<Object>,
    boxes: Vec<Solid>,
    shadows: Vec<Option<Convex>>,
    box_shadows: Vec<Option<Convex>>,
    /// The box that belongs to each object.
    box_of: Vec<Option<usize>>,
    /// The object that each box belongs to.
    object_of: Vec<Option<usize>>,
}

impl Instant {
    fn new(recording: &Recording, objects: Vec<Object>, boxes: Vec<Solid>, height_m: f64) -> Self {
        let sensor = recording.pose.position;
        let apart = |a: &Solid, b: &Solid| {
            let [x, y, _] = b.center;
            (x - a.center[0]).hypot(y - a.center[1])
        };
        let on = |a: &Solid, b: &Solid| a.footprint_distance([b.center[0], b.center[1]]) < NEAR_M;
        let nearest = |own: &Solid, all: &[Solid]| {
            let near = all.iter().enumerate().filter(|(_, other)| on(own, other) || on(other, own));
            near.min_by(|a, b| apart(own, a.1).total_cmp(&apart(own, b.1))).map(|(k, _)| k)
        };
        let solids: Vec<Solid> = objects.iter().map(|o| o.solid).collect();
        Self {
            sensor,
            height_m,
            shadows: solids.iter().map(|s| shadow(sensor, s, height_m)).collect(),
            box_shadows: boxes.iter().map(|s| shadow(sensor, s, height_m)).collect(),
            box_of: solids.iter().map(|s| nearest(s, &boxes)).collect(),
            object_of: boxes.iter().map(|b| nearest(b, &solids)).collect(),
            objects,
            boxes,
        }
    }

    fn hides(&self, solid: &Solid, at: Point) -> bool {
        shadow(self.sensor, solid, self.height_m).is_some_and(|s| s.contains(at))
    }

    fn motion(&self, object: &Object, moves: &[bool]) -> Motion {
        let [vx, vy] = object.velocity.unwrap_or_default();
        let [dx, dy] = [0, 1].map(|k| object.solid.center[k] - self.sensor[k]);
        match () {
            () if !moves.get(object.track).copied().unwrap_or(true) => Motion::Unmoving,
            () if vx.hypot(vy) < STANDS_MPS => Motion::Stands,
            () if (vx * dx + vy * dy).abs() < (vx * dy - vy * dx).abs() => Motion::Across,
            () => Motion::Along,
        }
    }

    fn wrongly_visible(&self, at: Point, had_box: &[bool], moves: &[bool], causes: &mut Causes) {
        let hidden_by_box = in_any(&self.box_shadows, at).next().is_some();
        let hidden_by: Vec<usize> = in_any(&self.shadows, at).collect();
        for &k in &hidden_by {
            let object = &self.objects[k];
            let cause = match self.box_of[k].map(|b| &self.boxes[b]) {
                _ if hidden_by_box => CELLS,
                None if had_box[object.track] => LOST,
                None => NO_BOX,
                Some(own) if self.hides(&of_height(own, object.solid.size[2]), at) => TOO_LOW,
                Some(_) => TOO_SMALL,
            };
            let share = 1.0 / hidden_by.len() as f64;
            *causes.visible.entry((cause, Some(self.motion(object, moves)))).or_default() += share;
        }
    }

    fn wrongly_invisible(&self, at: Point, moves: &[bool], causes: &mut Causes) {
        let hidden_by: Vec<usize> = in_any(&self.box_shadows, at).collect();
        let mut add = |cause, motion, share: f64| *causes.invisible.entry((cause, motion)).or_default() += share;
        if hidden_by.is_empty() {
            let beside = self.boxes.iter().position(|b| self.hides(&larger(b), at));
            let object = beside.and_then(|b| self.object_of[b]).map(|k| &self.objects[k]);
            let cause = if beside.is_some() { BESIDE } else { NO_BOX_NEAR };
            add(cause, object.map(|o| self.motion(o, moves)), 1.0);
        }
        for &b in &hidden_by {
            let own = &self.boxes[b];
            let object = self.object_of[b].map(|k| &self.objects[k]);
            let cause = match object {
                None => NO_VEHICLE,
                Some(o) if !self.hides(&of_height(own, o.solid.size[2]), at) => TOO_HIGH,
                Some(_) => TOO_LARGE,
            };
            add(cause, object.map(|o| self.motion(o, moves)), 1.0 / hidden_by.len() as f64);
        }
    }
}

fn in_any(shadows: &[Option<Convex>], at: Point) -> impl Iterator<Item = usize> + '_ {
    let holds = move |s: &Option<Convex>| s.as_ref().is_some_and(|s| s.contains(at));
    shadows.iter().enumerate().filter(move |(_, s)| holds(s)).map(|(k, _)| k)
}

/// The box with another height, still on the road.
fn of_height(solid: &Solid, height_m: f64) -> Solid {
    let ([x, y, _], [length, width, _]) = (solid.center, solid.size);
    Solid { center: [x, y, solid.bottom() + height_m / 2.0], size: [length, width, height_m], ..*solid }
}

fn larger(solid: &Solid) -> Solid {
    let higher = of_height(solid, solid.size[2] + BESIDE_M.1);
    Solid { size: [solid.size[0] + BESIDE_M.0, solid.size[1] + BESIDE_M.0, higher.size[2]], ..higher }
}

#[cfg(test)]
mod tests {
    use viewshed::map::query::Footprint;
    use viewshed::map::{CellState, Visibility, VisibilityMap};

    use super::super::samples::made_up::recording;
    use super::*;
    use crate::geometry::ground::Ground;
    use crate::recording::Frame;
    use crate::recording::truth::{Label, Truth};

    const SLICE_M: f64 = 1.0;
    const CAR: Solid = Solid { center: [40.0, 0.0, 0.75], yaw_rad: 0.0, size: [4.6, 1.8, 1.5] };

    /// Boxes of each frame, and a map that is blind in the shadows of these or of others.
    struct Drawn {
        frames: Vec<Vec<Solid>>,
        blind_behind: Option<Vec<Solid>>,
        /// From there on the map is blind, or sees everything, centimetres.
        blind_from_x_cm: i32,
        seen_from_x_cm: i32,
        shadows: Vec<Option<Convex>>,
        at: usize,
    }

    impl Drawn {
        fn new(frames: Vec<Vec<Solid>>) -> Self {
            let (blind_from_x_cm, seen_from_x_cm) = (i32::MAX, i32::MAX);
            Self { frames, blind_behind: None, blind_from_x_cm, seen_from_x_cm, shadows: Vec::new(), at: 0 }
        }
    }

    impl VisibilityMap for Drawn {
        fn at(&self, p: RoadPoint) -> CellState {
            let at = [f64::from(p.x_cm) / 100.0, f64::from(p.y_cm) / 100.0];
            let hidden = in_any(&self.shadows, at).next().is_some() && p.x_cm < self.seen_from_x_cm;
            let visibility = match hidden || p.x_cm >= self.blind_from_x_cm {
                true => Visibility::Invisible,
                false => Visibility::Visible,
            };
            CellState { visibility, grade: 0, occupancy: 0, occupied: false }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    impl Estimator for Drawn {
        fn name(&self) -> &str {
            "drawn"
        }
        fn reset(&mut self) {}
        fn step(&mut self, _: &Frame) {
            self.at += 1;
            let behind = self.blind_behind.clone().unwrap_or_else(|| self.obstacles());
            self.shadows = behind.iter().map(|s| shadow([0.0, 0.0, 6.0], s, SLICE_M)).collect();
        }
        fn map(&self) -> &dyn VisibilityMap {
            self
        }
        fn obstacles(&self) -> Vec<Solid> {
            self.frames[self.at - 1].clone()
        }
    }

    /// What is found of a vehicle that is at one place after the other, and how it is drawn.
    fn found(places: &[Solid], mut drawn: Drawn) -> Causes {
        let mut recording = recording(places.len(), 0);
        let label = |(k, solid): (usize, &Solid)| Label {
            time_ns: recording.frames[k].time_ns,
            id: "1".into(),
            class: "car".into(),
            solid: *solid,
        };
        recording.truth = Some(Truth::new(places.iter().enumerate().map(label).collect()));
        let samples: Vec<FrameSamples> = places
            .iter()
            .map(|solid| {
                let hidden = shadow(recording.pose.position, solid, SLICE_M);
                let road = (20..80).flat_map(|i| (-20..20).map(move |j| (i, j)));
                let cells = road.map(|(i, j)| {
                    let at = [f64::from(i) + 0.5, f64::from(j) + 0.5];
                    ((i, j), !hidden.as_ref().is_some_and(|h| h.contains(at)))
                });
                FrameSamples { counted: true, objects: Vec::new(), cells: cells.collect() }
            })
            .collect();
        let causes = causes(&recording, &mut drawn, &samples, SLICE_M, &|| ()).unwrap();
        // nothing is lost, nothing counted twice
        for (causes, rate) in
            [(causes.wrongly_visible(), causes.cells.fvr()), (causes.wrongly_invisible(), causes.cells.fir())]
        {
            let sum: f64 = causes.iter().map(|c| c.points).sum();
            assert!((sum - 100.0 * rate.unwrap()).abs() < 1e-9, "{causes:?}");
        }
        causes
    }

    /// The one cause there is, and of which motion.
    fn only(all: &[Cause]) -> (&'static str, [bool; 5]) {
        let with: Vec<&Cause> = all.iter().filter(|c| c.points > 0.0).collect();
        assert_eq!(with.len(), 1, "{all:?}");
        let m = with[0].by_motion;
        (with[0].name, [m.stands, m.across, m.along, m.unmoving, m.none].map(|points| points > 0.0))
    }

    const STANDS: [bool; 5] = [true, false, false, false, false];
    const ACROSS: [bool; 5] = [false, true, false, false, false];
    const ALONG: [bool; 5] = [false, false, true, false, false];
    const UNMOVING: [bool; 5] = [false, false, false, true, false];
    const NONE: [bool; 5] = [false, false, false, false, true];

    fn moved(solid: Solid, ahead_m: f64, left_m: f64) -> Solid {
        let [x, y, z] = solid.center;
        Solid { center: [x + ahead_m, y + left_m, z], ..solid }
    }

    /// One frame in which it is so drawn, of a car that never moves.
    fn drawn_as(boxes: Vec<Solid>) -> Causes {
        found(&[CAR], Drawn::new(vec![boxes]))
    }

    #[test]
    fn a_box_like_its_vehicle_makes_no_cell_wrong() {
        let causes = drawn_as(vec![CAR]);
        assert!(causes.cells.blocked > 3 && causes.cells.blocked_visible + causes.cells.clear_not_visible == 0);
    }

    #[test]
    fn what_hides_and_has_no_box_is_told_from_what_had_one() {
        assert_eq!(only(&drawn_as(vec![]).wrongly_visible()), (NO_BOX, UNMOVING));
        let frames = (0..6).map(|k| if k < 2 { vec![CAR] } else { vec![] }).collect();
        assert_eq!(only(&found(&[CAR; 6], Drawn::new(frames)).wrongly_visible()), (LOST, UNMOVING));
    }

    #[test]
    fn a_box_that_is_too_low_or_too_high_is_told_from_one_that_is_elsewhere() {
        assert_eq!(only(&drawn_as(vec![of_height(&CAR, 1.2)]).wrongly_visible()), (TOO_LOW, UNMOVING));
        assert_eq!(only(&drawn_as(vec![of_height(&CAR, 2.0)]).wrongly_invisible()), (TOO_HIGH, UNMOVING));
        let beside = drawn_as(vec![moved(CAR, 0.0, 1.2)]);
        assert_eq!(only(&beside.wrongly_visible()), (TOO_SMALL, UNMOVING));
        assert_eq!(only(&beside.wrongly_invisible()), (TOO_LARGE, UNMOVING));
        let short = Solid { size: [2.0, 1.8, 1.5], ..CAR };
        assert_eq!(only(&drawn_as(vec![moved(short, -1.3, 0.0)]).wrongly_visible()), (TOO_SMALL, UNMOVING));
    }

    #[test]
    fn a_box_of_no_vehicle_is_named_and_its_shadow_is_no_vehicles() {
        let causes = drawn_as(vec![CAR, moved(CAR, 0.0, 8.0)]);
        assert_eq!(only(&causes.wrongly_invisible()), (NO_VEHICLE, NONE));
    }

    #[test]
    fn what_cells_make_of_a_right_box_is_put_down_to_them() {
        let seen = Drawn { seen_from_x_cm: 4300, ..Drawn::new(vec![vec![CAR]]) };
        assert_eq!(only(&found(&[CAR], seen).wrongly_visible()), (CELLS, UNMOVING));
        let wider = Some(vec![Solid { size: [5.4, 2.6, 1.5], ..CAR }]);
        let beside = Drawn { blind_behind: wider, ..Drawn::new(vec![vec![CAR]]) };
        assert_eq!(only(&found(&[CAR], beside).wrongly_invisible()), (BESIDE, UNMOVING));
        let far = Drawn { blind_from_x_cm: 7900, ..Drawn::new(vec![vec![CAR]]) };
        assert_eq!(only(&found(&[CAR], far).wrongly_invisible()), (NO_BOX_NEAR, NONE));
    }

    #[test]
    fn causes_are_told_by_how_the_vehicle_moves_for_the_sensor() {
        // right at the first instant that is looked at, without a box at the second
        let lost = |places: [Solid; 6]| {
            let frames = (0..6).map(|k| if k == 0 { vec![places[0]] } else { vec![] }).collect();
            only(&found(&places, Drawn::new(frames)).wrongly_visible())
        };
        let by = |ahead_m: f64, left_m: f64| std::array::from_fn(|k| moved(CAR, ahead_m * k as f64, left_m * k as f64));
        assert_eq!(lost(by(1.0, 0.0)), (LOST, ALONG));
        assert_eq!(lost(by(-1.0, 0.0)), (LOST, ALONG));
        assert_eq!(lost(by(0.0, 1.0)), (LOST, ACROSS));
        assert_eq!(lost(by(0.0, -1.0)), (LOST, ACROSS));
        let stopped = std::array::from_fn(|k| moved(CAR, if k == 0 { -1.0 } else { 0.0 }, 0.0));
        assert_eq!(lost(stopped), (LOST, STANDS));
    }

    #[test]
    fn causes_of_recordings_add_up() {
        let mut sum = Causes::default();
        let one = drawn_as(vec![of_height(&CAR, 1.2)]);
        sum += &one;
        sum += &drawn_as(vec![CAR]);
        let points = |c: &Causes| c.wrongly_visible()[2].points;
        assert!((points(&sum) - points(&one) / 2.0).abs() < 1e-9 && points(&one) > 1.0);
    }

    #[test]
    fn without_labels_or_a_flat_road_nothing_is_said() {
        let mut recording = recording(1, 1);
        let samples = [FrameSamples { counted: true, cells: vec![((50, 0), true)], ..FrameSamples::default() }];
        let none = [FrameSamples { counted: true, ..FrameSamples::default() }];
        let found = |recording: &Recording, samples: &[FrameSamples]| {
            causes(recording, &mut Drawn::new(vec![vec![]]), samples, SLICE_M, &|| ())
        };
        assert!(found(&recording, &samples).is_some());
        assert_eq!(found(&recording, &none), None);
        let flat = std::mem::replace(&mut recording.ground, Ground::new(vec![[0.0, 0.0], [100.0, 4.0]]).unwrap());
        assert_eq!(found(&recording, &samples), None);
        (recording.ground, recording.truth) = (flat, None);
        assert_eq!(found(&recording, &samples), None);
    }
}
