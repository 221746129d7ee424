//! Single stages: what a stage promises for any input within the others' promises.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Step;
use viewshed::fixed::trig;
use viewshed::frame::reflection::Reflection;
use viewshed::grid::axes::Axes;
use viewshed::grid::evidence::{Around, EvidenceConfig};
use viewshed::grid::raycast::cast;
use viewshed::grid::shadow;
use viewshed::grid::spherical::SphericalGrid;
use viewshed::map::Visibility;
use viewshed::map::polar::PolarMap;
use viewshed::obstacles::solid::Solid;
use viewshed::sensor::ground::Ground;

use crate::cases;
use crate::setup::{Setup, setups};
use crate::traffic::crowd;

const R: usize = 40;
const A: usize = 16;
const E: usize = 6;

type Grid = SphericalGrid<R, A, E, 2>;
type Map = PolarMap<R, A>;

fn axes(setup: &Setup) -> Option<Axes<R, A, E>> {
    let levelling = setup.sensor.mount.levelling().unwrap();
    let visibility = setup.radar_3d.visibility;
    Axes::on(Ground::LEVEL, &levelling, &setup.sensor.field_of_view, visibility.slice_height_m, visibility.far_road_deg)
        .ok()
}

fn map(axes: &Axes<R, A, E>) -> Map {
    let levelling = Setup::default().sensor.mount.levelling().unwrap();
    PolarMap::unknown(axes.polar(&levelling), 128, 128)
}

/// What every cell holds.
fn contents(grid: &Grid) -> Vec<[u8; E]> {
    let mut cells = vec![[0; E]; A * R];
    for (a, column) in grid.columns().enumerate() {
        column.stacks().for_each(|(r, stack)| cells[a * R + r] = *stack);
    }
    cells
}

fn none_higher(before: &[[u8; E]], after: &[[u8; E]]) -> bool {
    before.iter().flatten().zip(after.iter().flatten()).all(|(before, after)| after <= before)
}

/// Stacks of random occupancy: column, range cell, content.
fn stacks() -> impl Strategy<Value = Vec<(usize, usize, [u8; E])>> {
    let value = prop_oneof![2 => Just(0_u8), 1 => Just(255), 2 => any::<u8>()];
    proptest::collection::vec((0..A, 0..R, proptest::array::uniform6(value)), 0..60)
}

fn put(grid: &mut Grid, stacks: &[(usize, usize, [u8; E])]) {
    for &(a, r, stack) in stacks {
        *grid.column_mut(a).and_then(|c| c.evidence(r)).unwrap() = stack;
    }
}

fn reflections(setup: &Setup, seed: u64) -> Vec<Reflection> {
    let (noise, levelling) = (setup.sensor.noise.noise().unwrap(), setup.sensor.mount.levelling().unwrap());
    crowd(setup, seed, 60).iter().map(|d| noise.place(d, &levelling)).collect()
}

proptest! {
    #![proptest_config(cases(120))]

    #[test]
    fn higher_points_lie_no_lower_on_the_row_axis(
        setup in setups(),
        ground_cm in 0..=65_535_i32,
        heights in proptest::collection::vec(-30_000..=30_000_i32, 2..20),
    ) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let mut heights = heights;
        heights.sort_unstable();
        let mut least = 0;
        for h in heights {
            let slope = axes.slope(h, ground_cm);
            prop_assert!(slope == 0 || (slope > 0) == (h > axes.sensor_height_cm()), "{} cm: {}", h, slope);
            let place = axes.row_place(slope);
            prop_assert!((least..=E as i32 * 256).contains(&place), "{} cm: {} after {}", h, place, least);
            least = place;
        }
    }

    #[test]
    fn what_lies_beyond_a_cell_never_changes_it(setup in setups(), stacks in stacks(), split in 0..R) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let [mut all, mut near] = [Grid::new(), Grid::new()];
        put(&mut all, &stacks);
        put(&mut near, &stacks.iter().copied().filter(|s| s.1 <= split).collect::<Vec<_>>());
        let [mut with, mut without] = [map(&axes), map(&axes)];
        cast(&all, &axes, &mut with);
        cast(&near, &axes, &mut without);
        for (a, r) in (0..A).flat_map(|a| (0..=split).map(move |r| (a, r))) {
            prop_assert_eq!(with.cell(a, r), without.cell(a, r));
        }
    }

    #[test]
    fn more_in_the_way_never_shows_more_of_free_space(setup in setups(), stacks in stacks(), more in stacks()) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let [mut grid, mut fuller] = [Grid::new(), Grid::new()];
        put(&mut grid, &stacks);
        let cells = contents(&grid);
        put(&mut fuller, &stacks);
        for (a, r, stack) in more {
            let old = cells[a * R + r];
            let highest = std::array::from_fn(|row| old[row].max(stack[row]));
            put(&mut fuller, &[(a, r, highest)]);
        }
        let [mut before, mut after] = [map(&axes), map(&axes)];
        cast(&grid, &axes, &mut before);
        cast(&fuller, &axes, &mut after);
        for (a, r) in (0..A).flat_map(|a| (0..R).map(move |r| (a, r))) {
            let (before, after) = (before.cell(a, r), after.cell(a, r));
            // a cell of an occupied run is judged by what lies before the run, which more can lengthen
            prop_assert!(after.occupancy >= 128 || after.grade <= before.grade);
            prop_assert!(after.occupancy >= before.occupancy);
        }
    }

    #[test]
    fn boxes_anywhere_hide_and_sweep_and_show_nothing(
        setup in setups(),
        stacks in stacks(),
        boxes in proptest::collection::vec((-60_000..60_000_i32, -60_000..60_000_i32, any::<i16>(), 0..2500_i32, 0..400_i32, 0..1200_i32), 1..6),
        near in any::<bool>(),
    ) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let (mut grid, mut map) = (Grid::new(), map(&axes));
        put(&mut grid, &stacks);
        cast(&grid, &axes, &mut map);
        for (x_cm, y_cm, heading, half_length_cm, half_width_cm, height_cm) in boxes {
            // around and over the sensor too
            let (x_cm, y_cm) = if near { (x_cm / 40, y_cm / 40) } else { (x_cm, y_cm) };
            let heading = trig::direction(Angle::from_raw(heading));
            let solid = Solid { x_cm, y_cm, heading, half_length_cm, half_width_cm, height_cm };
            let (held, before) = (contents(&grid), map.clone());
            shadow::cast(&solid, &axes, &mut grid, &mut map);
            prop_assert!(none_higher(&held, &contents(&grid)), "a box brings no evidence");
            for (a, r) in (0..A).flat_map(|a| (0..R).map(move |r| (a, r))) {
                let (before, after) = (before.cell(a, r), map.cell(a, r));
                prop_assert!(after.grade <= before.grade && after.occupancy >= before.occupancy);
                prop_assert_eq!(after.visibility == Visibility::Unknown, before.visibility == Visibility::Unknown);
            }
        }
    }

    #[test]
    fn fading_and_clearing_never_raise(setup in setups(), stacks in stacks(), seed in any::<u64>(), micros in 0..70_000_000_u64) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let sensor = setup.radar_3d.evidence.inverse_sensor(&setup.sensor.noise, &axes).unwrap();
        let mut grid = Grid::new();
        put(&mut grid, &stacks);
        let mut seen = map(&axes);
        cast(&grid, &axes, &mut seen);
        let before = contents(&grid);
        let [mut short, mut long] = [grid.clone(), grid.clone()];
        sensor.fade(&mut short, &seen, Step::from_micros(micros / 2));
        sensor.fade(&mut long, &seen, Step::from_micros(micros));
        prop_assert!(none_higher(&before, &contents(&short)));
        prop_assert!(none_higher(&contents(&short), &contents(&long)), "longer keeps no more");
        sensor.clear(&reflections(&setup, seed), &axes, &mut grid);
        prop_assert!(none_higher(&before, &contents(&grid)));
    }

    #[test]
    fn evidence_of_one_detection_stays_around_it(setup in setups(), seed in any::<u64>(), around in 0..3_usize) {
        let Some(axes) = axes(&setup) else { return Ok(()) };
        let sensor = EvidenceConfig::default().inverse_sensor(&setup.sensor.noise, &axes).unwrap();
        for r in reflections(&setup, seed) {
            let mut grid = Grid::new();
            sensor.add(&r, [Around::Unknown, Around::Nothing, Around::Body][around], &axes, &mut grid);
            for (a, column) in grid.columns().enumerate() {
                for (cell, _) in column.stacks() {
                    let centre = (cell as i32) * axes.cell_cm + axes.cell_cm / 2;
                    // two standard deviations of range, at most 8 cells
                    let reach = (setup.sensor.noise.range_m * 200.0) as i32 + 2 * axes.cell_cm;
                    prop_assert!((centre - i32::from(r.ground_cm)).abs() <= reach.min(9 * axes.cell_cm));
                    let middle = axes.narrow.unit(a as i32 * 256 + 128);
                    let units = (axes.column_unit(r.bearing()) - middle).abs();
                    let unit = f32::from(axes.azimuth_span) / axes.narrow.units(A) as f32;
                    let sigma = setup.sensor.noise.azimuth_deg / 360.0 * 65536.0 / unit;
                    // to the middle of the column beside, which may be a wide one
                    let half = (axes.narrow.unit((a as i32 + 1) * 256) - middle) as f32;
                    prop_assert!(units as f32 <= 256.0 * (2.0 * sigma + 0.1) + half, "{} of 256", units);
                }
            }
        }
    }
}
