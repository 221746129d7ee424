//! Ray casting, the slice and resampling on lopsided pictures: a swapped sign or axis shows.

use viewshed::grid::axes::Axes;
use viewshed::grid::raycast::cast;
use viewshed::grid::spherical::SphericalGrid;
use viewshed::map::polar::PolarMap;
use viewshed::map::resample::RoadGrid;
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;

const R: usize = 40;
const A: usize = 12;
const E: usize = 8;

const VIEW: FieldOfView = FieldOfView {
    azimuth_min_deg: -30.0,
    azimuth_max_deg: 45.0,
    elevation_min_deg: -40.0,
    elevation_max_deg: 10.0,
    range_min_m: 2.0,
    range_max_m: 40.0,
};

fn mount(height_m: f32) -> Mount {
    Mount { x_m: 0.0, y_m: 0.0, height_m, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 }
}

fn axes(mount: &Mount) -> Axes<R, A, E> {
    Axes::new(&mount.levelling().unwrap(), &VIEW, 1.0).unwrap()
}

fn unknown(mount: &Mount, axes: &Axes<R, A, E>) -> PolarMap<R, A> {
    PolarMap::unknown(axes.polar(&mount.levelling().unwrap()), 128, 128)
}

fn mark(state: CellState) -> char {
    match (state.visibility, state.occupied) {
        (Visibility::Unknown, _) => '?',
        (Visibility::Invisible, _) => '#',
        (Visibility::Visible, false) => '.',
        (Visibility::Visible, true) => 'O',
    }
}

/// What the sensor sees on the slice plane of one column, its occupancy given as seen from the side:
/// top line the highest row, range to the right, `#` full.
fn cast_picture(height_m: f32, picture: &str) -> String {
    let mount = mount(height_m);
    let (axes, mut grid) = (axes(&mount), SphericalGrid::<R, A, E>::new());
    let column = 3;
    for (row, line) in picture.split_whitespace().rev().enumerate() {
        for (r, _) in line.chars().enumerate().filter(|(_, c)| *c == '#') {
            grid.column_mut(column).and_then(|c| c.evidence(r)).unwrap()[row] = 255;
        }
    }
    let mut map = unknown(&mount, &axes);
    cast(&grid, &axes, &mut map);
    for a in (0..A).filter(|a| *a != column) {
        assert!((0..R).all(|r| matches!(mark(map.cell(a, r)), '.' | '?')), "column {a} is empty");
    }
    (0..R).map(|r| mark(map.cell(column, r))).collect()
}

/// The row nearest to the slice plane at every range cell, as seen from the side.
fn slice_picture(height_m: f32) -> String {
    let axes = axes(&mount(height_m));
    let mut lines = vec![vec!['.'; R]; E];
    for (r, share) in axes.slice_share().iter().enumerate() {
        let lower = axes.slice_rows().iter().find(|s| usize::from(s.end) > r).unwrap().lower;
        let row = usize::from(lower) + usize::from(*share >= 128);
        lines[E - 1 - row][r] = '=';
    }
    let lines: Vec<String> = lines.iter().map(|l| l.iter().collect()).collect();
    format!("\n{}\n", lines.join("\n"))
}

#[test]
fn the_slice_rises_to_the_horizon_under_a_high_sensor() {
    let expected = "
..................................======
.............................=====......
........................=====...........
....................====................
................====....................
............====........................
.........===............................
=========...............................
";
    let got = slice_picture(6.0);
    assert_eq!(got, expected, "{got}");
}

#[test]
fn the_slice_falls_to_the_horizon_over_a_low_sensor() {
    let expected = "
======..................................
......===...............................
.........====...........................
.............====.......................
.................=====..................
......................=====.............
...........................======.......
.................................=======
";
    let got = slice_picture(0.5);
    assert_eq!(got, expected, "{got}");
}

#[test]
fn a_block_hides_what_lies_behind_it_on_its_own_rows() {
    let low = "
        ........................................
        ........................................
        ........................................
        .............###........................
        .............###........................
        .............###........................
        .............###........................
        .............###........................";
    assert_eq!(cast_picture(6.0, low), "??????.......OOO########................");
}

#[test]
fn something_overhead_hides_only_what_is_far() {
    let high = "
        .......###..............................
        .......###..............................
        ........................................
        ........................................
        ........................................
        ........................................
        ........................................
        ........................................";
    assert_eq!(cast_picture(6.0, high), "??????.......................###########");
}

/// The road from above, a character a metre square of every other: x to the right, y up.
fn road_picture(map: &impl VisibilityMap) -> String {
    let mut grid = Box::new(RoadGrid::<50, 60>::unknown(0, -20));
    grid.resample(map);
    let line = |j: i32| (0..25).map(|i| mark(grid.cell(2 * i, 2 * j))).collect::<String>();
    let lines: Vec<String> = (-10..20).rev().map(line).collect();
    format!("\n{}\n", lines.join("\n"))
}

#[test]
fn a_lopsided_map_comes_out_on_the_road_the_right_way_round() {
    let mount = Mount { x_m: 6.0, y_m: -4.0, yaw_deg: 20.0, ..mount(6.0) };
    let axes = axes(&mount);
    let mut map = unknown(&mount, &axes);
    for a in 0..A {
        let view = axes.view(a);
        let (grades, occupancy) = map.rows_mut(a).unwrap();
        grades[view].fill(255);
        // blocked behind 20 m in the three rightmost columns; a ring of things at 30 m, but on the left
        if a < 3 {
            grades[20..].iter_mut().for_each(|g| *g = (*g).min(1));
        } else if a < 9 {
            occupancy[30..32].fill(255);
        }
    }
    let expected = "
?????????????????????????
?????????????????????????
?????????????????????????
?????????????????????????
????????????.????????????
???????????...???????????
???????????.....?????????
??????????.......????????
??????????........???????
?????????..........??????
?????????....OO....??????
????????......OO....?????
????????.......OO....????
???????........OO....????
???????.........OO...????
???????.........OO....???
??????...........OO...???
??????...........OO...???
?????.............O...#??
??????..........#######??
??????.......##########??
???????......##########??
?????????....##########??
???????????????########??
????????????????????###??
?????????????????????????
?????????????????????????
?????????????????????????
?????????????????????????
?????????????????????????
";
    let got = road_picture(&map);
    assert_eq!(got, expected, "{got}");
}
