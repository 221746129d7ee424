//! How far a map can be believed after a start or a gap: what was not looked at for long enough is unknown.
//!
//! # Model
//! A vehicle shows what it is by moving: one that moves within a second or two, one that stands when it drives off. A
//! unit that is switched on in the middle of traffic knows neither. So an azimuth is *settled* from the sensor
//! outwards, the farther the longer it was looked along, for what is near shows more reflections. And for as long as a
//! vehicle may stand, it is settled no farther than to the first thing that stands there and was not seen moving. That
//! may be a vehicle: what one of [`LEAST_HEIGHT_CM`] hides is invisible, and all behind that is unknown, for it may be
//! taller. It has to be there for a second before that, and gone for a second after it, and the distance grows by
//! quarters of the view: a map whose edges flicker costs more on a bus. Healthy frames count, with detections or
//! without: an empty road settles, too.
//!
//! A gap between frames takes off what may have happened in it: its length of the time for what moves, and
//! `GAP_COUNTS` times as much of the time for what stands, since a vehicle may have come and stopped. What stood
//! before the gap and stands there after it hides no more than it did.
//!
//! # Limits
//! A vehicle that stood at the start and still does when the time for it is over hides what the grid alone knows of it.
//!
//! # Cost
//! Three bytes an azimuth. While something that stands is not settled, a search in each column for its nearest evidence.

use crate::fixed::math;
use crate::fixed::time::{Phase, Step};
use crate::grid::axes::Axes;
use crate::grid::raycast::{CLEAR, shade};
use crate::grid::spherical::{Column, SphericalGrid};
use crate::map::polar::PolarMap;
use crate::sensor::config::{ConfigError, above, within};

/// How long azimuths are looked along before the map of them is believed.
///
/// # Units
/// Seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SettlingConfig {
    /// Until what moves close to the sensor has shown itself.
    pub near_s: f32,
    /// Until it has at the far end of the map; no less than near.
    pub far_s: f32,
    /// Until what stands is taken for no vehicle.
    pub standing_s: f32,
}

impl Default for SettlingConfig {
    fn default() -> Self {
        Self { near_s: 0.8, far_s: 2.0, standing_s: 30.0 }
    }
}

impl SettlingConfig {
    /// The first frame is believed, for frames that have nothing to do with each other.
    pub const AT_ONCE: Self = Self { near_s: 0.0, far_s: 0.0, standing_s: 0.0 };

    /// Checks the times.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limits are checked
    pub fn times(&self) -> Result<SettlingTimes, ConfigError> {
        let ticks = |name, v| within(name, v, 0.0, 200.0).map(|s| math::round_i32(s * 256.0) as u16);
        let near = ticks("settling.near_s", self.near_s)?;
        let far = ticks("settling.far_s", self.far_s)?;
        if far < near {
            above("settling.far_s", self.far_s, self.near_s)?;
        }
        Ok(SettlingTimes { near, far, standing: ticks("settling.standing_s", self.standing_s)? })
    }
}

/// [`SettlingConfig`] in 2^-8 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettlingTimes {
    near: u16,
    far: u16,
    standing: u16,
}

/// So many times as long as a gap is what it takes off the time for what stands: within 3 s a vehicle can come and stop.
const GAP_COUNTS: u16 = 10;
/// How far from where something stood before a gap it is the same thing after it, range cells: as far as evidence of one
/// detection spreads.
const SAME: u8 = 2;
/// Evidence from which on something stands in a cell: half of full.
const STANDS: u8 = 128;
/// How long something has to stand before it is held, and to be gone before it no longer is, 2^-6 s.
const LASTS: u8 = 64;
/// Steps in which the distance grows that has settled.
const STEPS: usize = 4;
/// Height of what stands and may be a vehicle, centimetres: as high as a van at least, which is between cars and lorries.
pub const LEAST_HEIGHT_CM: i32 = 200;
/// No range cell.
const NONE: u8 = u8::MAX;

/// A range cell or [`NONE`], kept as what it lacks to that: a unit's state is all zeros at first, and takes no room in an image.
#[derive(Debug, Clone, Copy)]
struct Kept(u8);

impl Kept {
    const NONE: Self = Self::new(NONE);

    const fn new(cell: u8) -> Self {
        Self(!cell)
    }

    const fn cell(self) -> u8 {
        !self.0
    }
}

/// How long `A` azimuths were looked along.
#[derive(Debug, Clone)]
pub struct Settling<const A: usize> {
    /// For what moves, 2^-8 s, no longer than it takes.
    moving: u16,
    /// For what stands.
    standing: u16,
    /// The nearest range cell in which something stood before the last gap, where that was settled then.
    stood: [Kept; A],
    /// The nearest in which something stands that is not settled.
    held: [Kept; A],
    /// For how long it was seen there, 2^-6 s: up when it is, down when it is not, no longer than twice [`LASTS`].
    seen: [u8; A],
    phase: Phase,
}

impl<const A: usize> Default for Settling<A> {
    fn default() -> Self {
        Self::NEW
    }
}

impl<const A: usize> Settling<A> {
    /// Nothing was looked along.
    pub const NEW: Self = Self {
        moving: 0,
        standing: 0,
        stood: [Kept::NONE; A],
        held: [Kept::NONE; A],
        seen: [0; A],
        phase: Phase::START,
    };

    /// A gap between frames. `grid` holds what stood before it.
    pub fn gap<const R: usize, const E: usize, const W: usize>(
        &mut self,
        gap: Step,
        t: &SettlingTimes,
        grid: &SphericalGrid<R, A, E, W>,
    ) {
        if self.standing >= t.standing {
            for (stood, column) in self.stood.iter_mut().zip(grid.columns()) {
                *stood = Kept::new(nearest(column));
            }
            (self.held, self.seen) = ([Kept::NONE; A], [0; A]);
        }
        let (gap, _) = self.ticks(gap);
        self.moving = self.moving.saturating_sub(gap);
        self.standing = self.standing.saturating_sub(gap.saturating_mul(GAP_COUNTS));
    }

    /// Takes what is not settled off a map, after a healthy frame that came `step` after the last; whether nothing was.
    pub fn settle<const R: usize, const E: usize, const W: usize>(
        &mut self,
        step: Step,
        t: &SettlingTimes,
        axes: &Axes<R, A, E>,
        grid: &SphericalGrid<R, A, E, W>,
        map: &mut PolarMap<R, A>,
    ) -> bool {
        let (passed, seen_for) = self.ticks(step);
        self.moving = self.moving.saturating_add(passed).min(t.far);
        self.standing = self.standing.saturating_add(passed).min(t.standing);
        let reach = self.reach(R, t);
        let stands = self.standing < t.standing;
        if reach >= R && !stands {
            return true;
        }
        let mut settled = reach >= R;
        let watched = self.held.iter_mut().zip(&mut self.seen).zip(&self.stood);
        for ((a, column), ((held, seen), stood)) in grid.columns().enumerate().zip(watched) {
            if stands {
                let nearest = nearest(column);
                (*held, *seen) = watch((*held, *seen), nearest, stood.cell(), seen_for);
            } else {
                (*held, *seen) = (Kept::NONE, 0);
            }
            let end = if *seen < LASTS {
                reach
            } else {
                settled = false;
                reach.min(hide_behind(usize::from(held.cell()), a, axes, map))
            };
            map.forget_from(a, end);
        }
        settled
    }

    /// A step in 2^-8 s and in 2^-6 s, saturating; what is left over counts with the next.
    fn ticks(&mut self, step: Step) -> (u16, u8) {
        let of = |rate| self.phase.times(step, rate);
        let ticks = (u16::try_from(of(256)).unwrap_or(u16::MAX), u8::try_from(of(64)).unwrap_or(u8::MAX));
        self.phase = self.phase.after(step);
        ticks
    }

    /// Range cells of `ranges` in which what moves has shown itself.
    fn reach(&self, ranges: usize, t: &SettlingTimes) -> usize {
        if self.moving >= t.far {
            return ranges;
        }
        let growing = usize::from(t.far.saturating_sub(t.near)).max(1);
        ranges * (STEPS * usize::from(self.moving.saturating_sub(t.near)) / growing) / STEPS
    }
}

/// Whether what stands in a cell stood there before, or lies behind what did.
fn is_known(cell: u8, stood: u8) -> bool {
    stood != NONE && cell.saturating_add(SAME) >= stood
}

/// The nearest range cell of a column in which something stands.
fn nearest<const R: usize, const E: usize, const W: usize>(column: &Column<R, E, W>) -> u8 {
    let mut standing = column.stacks().filter(|(_, stack)| stack.iter().any(|cell| *cell >= STANDS));
    standing.next().and_then(|(r, _)| u8::try_from(r).ok()).unwrap_or(NONE)
}

/// What is held and for how long it was seen, a step later, of a column in which something stands `nearest`: it is what
/// did not stand there before a gap. From [`LASTS`] on it counts; what stands nearer or is left takes its place.
fn watch((held, seen): (Kept, u8), nearest: u8, stood: u8, step: u8) -> (Kept, u8) {
    let held = held.cell();
    let now = if is_known(nearest, stood) { NONE } else { nearest };
    let counted = seen >= LASTS;
    let nearer = now.saturating_add(SAME) < held;
    let held = if !counted && nearer { now } else { held };
    // what is nearer than this was handled above, and of what is farther nothing stands here
    let still = nearest != NONE && held != NONE && nearest.abs_diff(held) <= SAME;
    if still {
        return (Kept::new(held), seen.saturating_add(step).min(2 * LASTS));
    }
    let left = seen.saturating_sub(step);
    if counted && left < LASTS {
        (Kept::new(now), if now == NONE { 0 } else { LASTS })
    } else {
        (Kept::new(if left == 0 { now } else { held }), left)
    }
}

/// Hides what a vehicle in a range cell hides at least, and says in which cell that ends.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // range cells
fn hide_behind<const R: usize, const A: usize, const E: usize>(
    r: usize,
    column: usize,
    axes: &Axes<R, A, E>,
    map: &mut PolarMap<R, A>,
) -> usize {
    let cell_cm = axes.cell_cm.max(1);
    let (enter_cm, leave_cm) = (r as i32 * cell_cm, (r as i32 + 1) * cell_cm);
    // over a road that is not level all behind it is unknown
    let hidden = axes.hidden_behind(LEAST_HEIGHT_CM, enter_cm, leave_cm).filter(|_| axes.ground().is_level());
    let Some((hidden, (grades, _))) = hidden.zip(map.rows_mut(column)) else { return r + 1 };
    shade(grades, r + 1, hidden, cell_cm, CLEAR);
    ((hidden.1 / cell_cm) as usize).max(r + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::raycast;
    use crate::map::Visibility;
    use crate::sensor::field_of_view::FieldOfView;
    use crate::sensor::mount::Mount;
    use std::string::String;
    use std::vec::Vec;

    /// 60 m in cells of 1 m, four columns, a sensor 6 m above the road.
    struct World {
        axes: Axes<60, 4, 16>,
        grid: SphericalGrid<60, 4, 16>,
        map: PolarMap<60, 4>,
        settling: Settling<4>,
    }

    const STEP: Step = Step::from_micros(100_000);

    fn times() -> SettlingTimes {
        SettlingConfig::default().times().unwrap()
    }

    impl World {
        fn new() -> Self {
            let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
            let view = FieldOfView {
                azimuth_min_deg: -30.0,
                azimuth_max_deg: 30.0,
                elevation_min_deg: -80.0,
                elevation_max_deg: 30.0,
                range_min_m: 1.0,
                range_max_m: 60.0,
            };
            let levelling = mount.levelling().unwrap();
            let axes = Axes::new(&levelling, &view, 1.0).unwrap();
            let map = PolarMap::unknown(axes.polar(&levelling), 128, 128);
            Self { axes, grid: SphericalGrid::new(), map, settling: Settling::NEW }
        }

        /// Something that stands in a cell of a column, too low to hide anything by itself.
        fn put(&mut self, column: usize, cell: usize) {
            self.grid.column_mut(column).unwrap().evidence(cell).unwrap()[0] = 200;
        }

        /// So many frames, 0.1 s apart; whether all is settled after them.
        fn look(&mut self, frames: usize) -> bool {
            let mut settled = false;
            for _ in 0..frames {
                raycast::cast(&self.grid, &self.axes, &mut self.map);
                settled = self.settling.settle(STEP, &times(), &self.axes, &self.grid, &mut self.map);
            }
            settled
        }

        /// A character for each fifth cell of a column from 10 m on: `.` visible, `#` invisible, `?` unknown.
        fn column(&self, column: usize) -> String {
            let cell = |r| match self.map.cell(column, r).visibility {
                Visibility::Visible => '.',
                Visibility::Invisible => '#',
                Visibility::Unknown => '?',
            };
            (10..60).step_by(5).map(cell).collect()
        }
    }

    #[test]
    fn an_empty_road_settles_outwards_from_the_sensor_within_two_seconds() {
        let mut world = World::new();
        let pictures: Vec<(bool, String)> =
            [4, 6, 4, 4, 4].map(|frames| (world.look(frames), world.column(1))).to_vec();
        // 0.4 s; 1.0 s: a sixth of the time; 1.4 s: not yet half, a quarter of the way; 1.8 s: three quarters; 2.2 s
        let expected = ["??????????", "??????????", ".?????????", ".......???", ".........."];
        assert_eq!(pictures, expected.map(|picture| (picture == "..........", picture.into())).to_vec());
    }

    #[test]
    fn what_may_be_a_vehicle_that_stands_hides_what_a_van_would_and_leaves_the_rest_unknown_for_half_a_minute() {
        let mut world = World::new();
        world.put(1, 25);
        assert!(!world.look(25));
        // seen from 6 m over 2 m at 26 m: hidden to 26 * 5 / 4 = 32.5 m
        assert_eq!(world.column(1), "....#?????");
        assert_eq!(world.column(2), "..........", "its own azimuth alone");
        assert!(!world.look(270) && world.column(1) == "....#?????", "29.5 s");
        assert!(world.look(10) && world.column(1) == "..........", "30.5 s");
    }

    #[test]
    fn what_is_seen_now_and_then_stands_in_one_place_until_it_was_gone_for_a_second() {
        let mut world = World::new();
        world.put(1, 25);
        world.look(25);
        for (cell, evidence) in [(26, 200), (25, 60), (24, 200), (25, 90)] {
            world.grid.column_mut(1).unwrap().empty(20..30);
            world.grid.column_mut(1).unwrap().evidence(cell).unwrap()[0] = evidence;
            assert!(!world.look(1));
            assert_eq!(world.column(1), "....#?????", "{cell} {evidence}");
        }
        world.grid.column_mut(1).unwrap().evidence(25).unwrap()[0] = 127;
        assert!(!world.look(9) && world.column(1) == "....#?????", "0.9 s");
        assert!(world.look(2) && world.column(1) == "..........", "1.1 s");
    }

    #[test]
    fn what_was_seen_moving_or_is_gone_holds_nothing_back() {
        let mut world = World::new();
        world.put(1, 25);
        world.look(25);
        // an obstacle's box takes the evidence in its place out of the grid
        world.grid.column_mut(1).unwrap().empty(20..30);
        assert!(world.look(11) && world.column(1) == "..........");
    }

    #[test]
    fn what_passes_within_a_second_stands_nowhere() {
        let mut world = World::new();
        assert!(world.look(25));
        for cell in (20..50).step_by(3) {
            world.grid.column_mut(1).unwrap().empty(0..60);
            world.put(1, cell);
            assert!(world.look(1) && world.column(1) == "..........", "{cell}");
        }
        assert!(world.look(5) && !world.look(6), "half a second, and 1.1 s, in the last");
    }

    #[test]
    fn of_two_things_the_nearer_holds_and_then_the_one_that_is_left() {
        let mut world = World::new();
        world.put(1, 35);
        world.look(25);
        assert_eq!(world.column(1), "......#???");
        world.put(1, 15);
        assert!(!world.look(8) && world.column(1) == "......#???", "0.8 s");
        assert!(!world.look(3) && world.column(1) == "..????????", "1.1 s");
        world.look(10);
        world.grid.column_mut(1).unwrap().empty(10..20);
        assert!(!world.look(9) && world.column(1) == "..????????", "0.9 s");
        assert!(!world.look(2) && world.column(1) == "......#???", "1.1 s; at no time all is let through");
    }

    #[test]
    fn a_gap_takes_off_what_may_have_happened_in_it() {
        let mut world = World::new();
        assert!(world.look(400));
        world.settling.gap(Step::from_micros(500_000), &times(), &world.grid);
        assert!(!world.look(1), "a part of what is far");
        assert!(world.column(1).starts_with("....") && world.column(1).ends_with('?'));
        assert!(world.look(4));
        world.settling.gap(Step::from_micros(20_000_000), &times(), &world.grid);
        assert!(!world.look(1) && world.column(1) == "??????????");
        assert!(world.look(20));
        world.put(1, 25);
        assert!(!world.look(11), "it came in the gap, and stands");
        assert_eq!(world.column(1), "....#?????");
    }

    #[test]
    fn what_stood_before_a_gap_is_no_vehicle_that_came_in_it_and_what_stands_before_that_may_be() {
        let mut world = World::new();
        world.put(1, 25);
        assert!(world.look(400));
        world.settling.gap(Step::from_micros(20_000_000), &times(), &world.grid);
        assert!(world.look(21) && world.column(1) == "..........");
        world.put(1, 15);
        assert!(!world.look(11));
        assert_eq!(world.column(1), "..????????");
    }

    #[test]
    fn frames_that_have_nothing_to_do_with_each_other_are_believed_at_once() {
        let mut world = World::new();
        world.put(1, 25);
        raycast::cast(&world.grid, &world.axes, &mut world.map);
        let at_once = SettlingConfig::AT_ONCE.times().unwrap();
        let none = Step::from_micros(0);
        assert!(world.settling.settle(none, &at_once, &world.axes, &world.grid, &mut world.map));
        assert_eq!(world.column(1), "..........");
    }

    #[test]
    fn what_frames_add_up_to_does_not_depend_on_their_rate() {
        for rate in [5, 15, 60, 1000] {
            let mut world = World::new();
            let step = Step::from_micros(1_000_000 / rate);
            let mut frames = 0;
            while !world.settling.settle(step, &times(), &world.axes, &world.grid, &mut world.map) {
                frames += 1;
            }
            assert!((frames * 1000 / rate).abs_diff(2000) <= 1000 / rate + 20, "{rate}: {frames}");
        }
    }

    #[test]
    fn times_are_refused_by_name() {
        let refused = |config: SettlingConfig| config.times().unwrap_err().parameter;
        let usual = SettlingConfig::default();
        assert_eq!(refused(SettlingConfig { near_s: -1.0, ..usual }), "settling.near_s");
        assert_eq!(refused(SettlingConfig { far_s: 0.5, ..usual }), "settling.far_s");
        assert_eq!(refused(SettlingConfig { standing_s: f32::NAN, ..usual }), "settling.standing_s");
    }
}
