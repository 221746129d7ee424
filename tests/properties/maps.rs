//! What is made of a map: bits, coarser bits, the road's grid, answers to questions.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::trig;
use viewshed::grid::axes::Axes;
use viewshed::map::bitmap::VisibilityBitmap;
use viewshed::map::polar::PolarMap;
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::map::resample::RoadGrid;
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::ground::Ground;
use viewshed::sensor::road::RoadPoint;

use crate::cases;
use crate::setup::setups;

const R: usize = 40;
const A: usize = 12;

type Bitmap = VisibilityBitmap<R, A>;

fn states() -> impl Strategy<Value = Visibility> {
    prop_oneof![1 => Just(Visibility::Unknown), 1 => Just(Visibility::Invisible), 3 => Just(Visibility::Visible)]
}

/// Stretches of equal states along each azimuth, as lines of sight have them.
fn bitmaps() -> impl Strategy<Value = Bitmap> {
    let row = proptest::collection::vec((states(), 1..R), 1..6);
    proptest::collection::vec(row, A).prop_map(|rows| {
        let mut b = Bitmap::UNKNOWN;
        for (a, stretches) in rows.into_iter().enumerate() {
            let states = stretches.into_iter().flat_map(|(state, length)| std::iter::repeat_n(state, length));
            for (r, state) in states.take(R).enumerate() {
                b.row_mut(a).unwrap().set(r, state);
            }
        }
        b
    })
}

/// A map that says something else of every metre.
struct Chequered(u64);

impl VisibilityMap for Chequered {
    fn at(&self, p: RoadPoint) -> CellState {
        let cell = [p.x_cm, p.y_cm].map(|v| i64::from(v.div_euclid(100)) as u64);
        let mixed =
            (cell[0].wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ cell[1].wrapping_mul(0xC2B2_AE3D_27D4_EB4F) ^ self.0)
                .wrapping_mul(0xD6E8_FEB8_6659_FD93);
        let visibility = [Visibility::Unknown, Visibility::Invisible, Visibility::Visible, Visibility::Visible];
        match visibility[(mixed >> 62) as usize] {
            Visibility::Unknown => CellState::UNKNOWN,
            visibility => CellState {
                visibility,
                grade: (mixed >> 40) as u8 | 1,
                occupancy: (mixed >> 32) as u8,
                occupied: mixed & 1 == 1,
            },
        }
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        area.each_cell(|cell| visit(self.at(cell)));
    }
}

/// No coarse cell says more than any fine cell it shares area with.
fn never_better<const R2: usize, const A2: usize>(fine: &Bitmap) -> Result<(), TestCaseError> {
    let coarse: VisibilityBitmap<R2, A2> = fine.coarsen();
    for (a, r) in (0..A).flat_map(|a| (0..R).map(move |r| (a, r))) {
        let overlap = |i: usize, fine: usize, coarse: usize| i * coarse / fine..((i + 1) * coarse).div_ceil(fine);
        for a2 in overlap(a, A, A2) {
            for r2 in overlap(r, R, R2) {
                prop_assert!(coarse.cell(a2, r2) <= fine.cell(a, r), "({}, {}) of ({}, {})", a2, r2, a, r);
            }
        }
    }
    // and no less than the worst of them
    for (a2, r2) in (0..A2).flat_map(|a| (0..R2).map(move |r| (a, r))) {
        let within = |i: usize, i2: usize, fine: usize, coarse: usize| {
            i * coarse < (i2 + 1) * fine && (i + 1) * coarse > i2 * fine
        };
        let covered = (0..A).flat_map(|a| (0..R).map(move |r| (a, r)));
        let covered = covered.filter(|(a, r)| within(*a, a2, A, A2) && within(*r, r2, R, R2));
        prop_assert_eq!(Some(coarse.cell(a2, r2)), covered.map(|(a, r)| fine.cell(a, r)).min());
    }
    Ok(())
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn coarser_bits_are_the_worst_of_what_they_cover(fine in bitmaps()) {
        never_better::<R, A>(&fine)?;
        never_better::<20, 6>(&fine)?;
        never_better::<17, 5>(&fine)?;
        never_better::<1, 1>(&fine)?;
    }

    #[test]
    fn bits_say_what_the_map_says(
        grades in proptest::collection::vec(any::<u8>(), A * R),
        thresholds in (2..=255_u8, 2..=255_u8),
    ) {
        let levelling = crate::setup::Setup::default().sensor.mount.levelling().unwrap();
        let geometry = viewshed::map::polar::PolarGeometry { levelling, cell_cm: 100, azimuth_origin: Angle::from_degrees(-60.0), azimuth_span: 21_845, narrow: viewshed::map::azimuths::Narrow::NONE };
        let mut map = PolarMap::<R, A>::unknown(geometry, thresholds.0, thresholds.1);
        for (a, row) in grades.chunks(R).enumerate() {
            let (grades, occupancy) = map.rows_mut(a).unwrap();
            grades.copy_from_slice(row);
            occupancy.copy_from_slice(row);
        }
        let bits = Bitmap::of(&map);
        for (a, r) in (0..A + 2).flat_map(|a| (0..R + 2).map(move |r| (a, r))) {
            prop_assert_eq!(bits.cell(a, r), map.cell(a, r).visibility);
            let grade = if a < A && r < R { grades[a * R + r] } else { 0 };
            let expected = match grade {
                0 => Visibility::Unknown,
                g if g < thresholds.0 => Visibility::Invisible,
                _ => Visibility::Visible,
            };
            prop_assert_eq!(bits.cell(a, r), expected);
        }
    }

    #[test]
    fn the_roads_grid_says_what_the_map_says_at_its_centres(seed in any::<u64>(), x in -20_000..20_000, y in -20_000..20_000) {
        let map = Chequered(seed);
        let mut grid = RoadGrid::<12, 9>::unknown(x, y);
        grid.resample(&map);
        for (i, j) in (-1..13).flat_map(|i| (-1..10).map(move |j| (i, j))) {
            let at = RoadPoint::cell_centre(x + i, y + j);
            let inside = (0..12).contains(&i) && (0..9).contains(&j);
            prop_assert_eq!(grid.at(at), if inside { map.at(at) } else { CellState::UNKNOWN });
        }
    }

    #[test]
    fn a_cell_of_a_polar_map_is_found_at_its_centre(setup in setups(), a in 0..A, r in 1..R) {
        let levelling = setup.sensor.mount.levelling().unwrap();
        let far_road = setup.radar_3d.visibility.far_road_deg;
        let axes = Axes::<R, A, 4>::on(Ground::LEVEL, &levelling, &setup.sensor.field_of_view, 1.0, far_road);
        let Ok(axes) = axes else { return Ok(()) };
        let geometry = axes.polar(&levelling);
        let map = PolarMap::<R, A>::unknown(geometry, 128, 128);
        let bearing = f64::from(axes.azimuth_of(a as i32 * 256 + 128).radians());
        let ground = f64::from(axes.cell_cm) * (r as f64 + 0.5);
        // whole centimetres and 2^-16 turns must not leave the cell
        prop_assume!(axes.cell_cm >= 8 && ground * f64::from(axes.azimuth_span) / 65536.0 * std::f64::consts::TAU / f64::from(axes.narrow.units(A)) > 8.0);
        let (x, y) = ((ground * bearing.cos()).round() as i32, (ground * bearing.sin()).round() as i32);
        prop_assert_eq!(map.locate(x, y), Some((a, r)), "{} {}", x, y);
        prop_assert_eq!(axes.column(trig::bearing(x, y)), Some(a));
        prop_assert_eq!(axes.range_cell(ground as i32), Some(r));
    }

    #[test]
    fn an_area_is_no_better_than_an_object_and_neither_than_its_points(
        seed in any::<u64>(),
        centre in prop_oneof![4 => (-30_000..30_000, -30_000..30_000), 1 => (any::<i32>(), any::<i32>())],
        heading in any::<i16>(),
        sides in prop_oneof![4 => (1..1500_i32, 1..300_i32), 1 => (any::<i32>(), any::<i32>())],
    ) {
        let map = Chequered(seed);
        let footprint = Footprint {
            centre: RoadPoint::new(centre.0, centre.1),
            heading: trig::direction(Angle::from_raw(heading)),
            half_length_cm: sides.0,
            half_width_cm: sides.1,
        };
        let (object, area) = (query::object(&map, &footprint), query::area(&map, &footprint));
        let largest = 100 * 50;
        if !(1..=largest).contains(&sides.0) || !(1..=largest).contains(&sides.1) {
            prop_assert_eq!((object, area), (Answer::Unknown, Answer::Unknown));
            return Ok(());
        }
        prop_assert!(area <= object, "{:?} {:?}", area, object);
        let inside = query::point(&map, footprint.centre);
        prop_assert!(area <= inside, "the centre is part of the area");
        let seen = |answer| answer >= Answer::VisibleOccupied;
        prop_assert!(seen(object) || !seen(inside), "one visible cell shows an object");
    }
}
