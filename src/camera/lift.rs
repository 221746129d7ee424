//! A box in the image to a box on the road.
//!
//! # Model
//! A vehicle is an upright box of its class's size that stands on the road, along the traffic's heading. Its place
//! is the one where the camera would see it with the bottom edge of the image box and between its sides; it is
//! found by moving the box by the difference between where the road shows the edges that were measured and where it
//! shows those that are expected, up to four times. Then the top edge, which shows the far end of a roof below the
//! camera, gives the length of a truck or a bus within the limits of the class. Of cars and vans the class's length is
//! surer: 15 cm more of height move the far end of a roof at 60 m, seen from 6 m, by 2 m, and cars differ by less.
//!
//! A detector draws its box around what is visible. Where a nearer box covers the bottom edge, or the image ends
//! there, the top edge and the class's height place the vehicle, or its width, whichever is surer: a roof nearly as
//! high as the camera says little, and a side that is covered nothing of the width. A side that a nearer box covers, or that lies at the image's border, is not
//! used, the other one then is. All of that makes the uncertainty larger.
//!
//! # Limits
//! Boxes of the class's size seen without error are placed within 0.3 m along and 0.1 m across the view up to
//! 100 m. Each box is compared with every other box of the frame.

use crate::camera::boxes::{BoxRejection, ImageBox, SUBPIXELS, VehicleClass};
use crate::camera::projection::Projection;
use crate::fixed::math;
use crate::fixed::trig::{Direction, ONE};
use crate::map::query::Footprint;

/// A vehicle on the road, as a camera sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiftedBox {
    /// Where it stands.
    pub footprint: Footprint,
    /// How high it is, centimetres.
    pub height_cm: i32,
    /// Standard deviation of its place along the line of sight, centimetres.
    pub along_cm: i32,
    /// The same across it.
    pub across_cm: i32,
}

/// A box as tangents (left, top, right, bottom; + left and + up), checked.
#[derive(Debug, Clone, Copy)]
struct Seen {
    edges: [i32; 4],
    class: VehicleClass,
}

/// Which edges show the vehicle's own: left, top, right, bottom.
type Free = [bool; 4];

/// Distance to the border within which an edge counts as cut off: two pixels, and a share of the box, 2^-5. Detectors
/// end the box of a vehicle that goes on beyond the border a little before it: by up to 3 % of the box.
const AT_BORDER: i32 = 2 * SUBPIXELS;
const AT_BORDER_SHARE: i32 = 5;

/// Distance within which two edges touch: three pixels, and a share of the box, 2^-4.
const TOUCHING: i32 = 3 * SUBPIXELS;
const TOUCHING_SHARE: i32 = 4;

/// Steps to the place.
const STEPS: usize = 4;

/// Least height of the camera above a roof from which its far end is seen well enough, centimetres.
const ABOVE_ROOF_CM: i32 = 80;

/// Least cosine of heading and line of sight with which a length is seen at the far end, 2^-14.
const ALONG_SIGHT: i32 = ONE / 2;

/// Lifts boxes of one camera.
#[derive(Debug, Clone)]
pub(crate) struct Lifting {
    /// Heading of the traffic, levelled.
    pub(crate) heading: Direction,
    /// Standard deviation of an edge, tangent.
    pub(crate) edge_noise: i32,
}

/// A vehicle in the levelled frame.
#[derive(Debug, Clone, Copy)]
struct Placed {
    at: [i32; 2],
    length: i32,
    width: i32,
    height: i32,
}

/// What is wrong with a box by itself.
pub(crate) fn check(own: &ImageBox, p: &Projection) -> Result<(), BoxRejection> {
    let [l, t, r, b] = own.edges;
    if l >= r || t >= b {
        return Err(BoxRejection::Inverted);
    }
    let [width, height] = p.size;
    if r <= 0 || b <= 0 || l >= width || t >= height {
        return Err(BoxRejection::Outside);
    }
    let edges = p.tangents_of(own.edges);
    match p.on_plane([(edges[0] + edges[2]) / 2, edges[3]], 0) {
        Some(_) => Ok(()),
        None => Err(BoxRejection::AboveHorizon),
    }
}

/// Which edges of a box neither the image's border nor a nearer box covers.
pub(crate) fn free_edges(own: &ImageBox, others: &[ImageBox], p: &Projection) -> Free {
    let [l, t, r, b] = own.edges;
    let [width, height] = p.size;
    let (border_x, border_y) = (AT_BORDER + ((r - l) >> AT_BORDER_SHARE), AT_BORDER + ((b - t) >> AT_BORDER_SHARE));
    let mut free = [l > border_x, t > border_y, r < width - border_x, b < height - border_y];
    let (near_x, near_y) = (TOUCHING + ((r - l) >> TOUCHING_SHARE), TOUCHING + ((b - t) >> TOUCHING_SHARE));
    for other in others {
        let [ol, ot, or, ob] = other.edges;
        // what ends lower in the image stands nearer
        if ob <= b + AT_BORDER || or < l || ol > r || ot > b + near_y {
            continue;
        }
        let (beside, within) = (or.min(r) - ol.max(l), ob.min(b) - ot.max(t));
        // bottom: most of it ends where the nearer one begins
        if beside * 4 >= (r - l) * 3 && b <= ot + near_y + (ob - ot) / 4 {
            free[3] = false;
        }
        if within * 2 >= b - t {
            if ol < l && (or - l).abs() <= near_x {
                free[0] = false;
            }
            if or > r && (ol - r).abs() <= near_x {
                free[2] = false;
            }
        }
    }
    free
}

impl Lifting {
    /// Places a checked box.
    pub(crate) fn lift(&self, own: &ImageBox, free: Free, p: &Projection) -> Result<LiftedBox, BoxRejection> {
        let seen = Seen { edges: p.tangents_of(own.edges), class: own.class };
        let size = own.class.size();
        let mut placed = Placed { at: [0; 2], length: size.length, width: size.width, height: size.height };
        let [_, top_free, _, bottom_free] = free;
        let roof_below = p.height_cm - size.height >= ABOVE_ROOF_CM;
        let by_top = !bottom_free && top_free && roof_below && self.surer_by_top(&seen, free, p);
        let off = BoxRejection::AboveHorizon;
        placed.at = self.start(&seen, by_top, p).ok_or(off)?;
        if bottom_free || by_top {
            self.approach(&mut placed, &seen, free, by_top, p).ok_or(off)?;
            if bottom_free
                && top_free
                && roof_below
                && own.class.has_any_length()
                && self.fit_length(&mut placed, &seen, p).ok_or(off)?
            {
                self.approach(&mut placed, &seen, free, by_top, p).ok_or(off)?;
            }
        } else {
            self.by_width(&mut placed, &seen, free, p).ok_or(off)?;
        }
        Ok(self.lifted(&placed, &seen, free, by_top, p))
    }

    /// Whether the top edge places a vehicle better than its width does.
    fn surer_by_top(&self, seen: &Seen, free: Free, p: &Projection) -> bool {
        let [left, top, right, _] = seen.edges;
        let place = p.on_plane([(left + right) / 2, top], seen.class.size().height);
        place.is_none_or(|[x, y]| {
            let distance = math::length(x, y);
            self.along_by_top(seen, distance, p) <= self.along_by_width(seen, free, distance)
        })
    }

    /// Standard deviation along the line of sight by the top edge: an edge moves the roof by the height above it
    /// over the distance, and height and length are not known.
    fn along_by_top(&self, seen: &Seen, distance: i32, p: &Projection) -> i32 {
        let size = seen.class.size();
        let above = (p.height_cm - size.height).max(1);
        let noise = math::mul_shift(distance, self.edge_noise, 16);
        math::mul_shift(noise + size.height_spread, math::ratio::<8>(distance, above), 8)
            + (size.lengths[1] - size.lengths[0]) / 4
    }

    /// The same by the width, of which a covered side leaves nothing but a guess.
    fn along_by_width(&self, seen: &Seen, free: Free, distance: i32) -> i32 {
        if !(free[0] && free[2]) {
            return distance / 2;
        }
        let size = seen.class.size();
        let wide = (seen.edges[0] - seen.edges[2]).max(1);
        let of_size = math::ratio::<12>(size.width_spread, size.width);
        let of_edges = math::ratio::<12>(self.edge_noise.min(wide), wide);
        math::mul_shift(distance, of_size + of_edges, 12)
    }

    /// Where the middle of the edge that is used lies, half the length farther.
    fn start(&self, seen: &Seen, by_top: bool, p: &Projection) -> Option<[i32; 2]> {
        let [left, top, right, bottom] = seen.edges;
        let size = seen.class.size();
        let (row, height) = if by_top { (top, size.height) } else { (bottom, 0) };
        let [x, y] = p.on_plane([(left + right) / 2, row], height)?;
        let sight = Direction::of(x, y);
        let half = if by_top { -size.length / 2 } else { size.length / 2 };
        Some([x + ((half * i32::from(sight.x)) >> 14), y + ((half * i32::from(sight.y)) >> 14)])
    }

    /// Moves a box until the camera would see it where it did.
    fn approach(&self, placed: &mut Placed, seen: &Seen, free: Free, by_top: bool, p: &Projection) -> Option<()> {
        let (row, height) = if by_top { (1, placed.height) } else { (3, 0) };
        for _ in 0..STEPS {
            let expected = self.outline(placed, p)?;
            let (aim, now) = (column(&seen.edges, free), column(&expected, free));
            let edge = |edges: &[i32; 4]| edges.get(row).copied().unwrap_or(0);
            let target = p.on_plane([aim, edge(&seen.edges)], height)?;
            let current = p.on_plane([now, edge(&expected)], height)?;
            let moved = [target[0] - current[0], target[1] - current[1]];
            // where the next step would begin it ended already
            if moved == [0, 0] {
                break;
            }
            let [x, y] = placed.at;
            placed.at = [x + moved[0], y + moved[1]];
        }
        Some(())
    }

    /// Takes the length from where the far end of the roof is seen; whether that changed it.
    fn fit_length(&self, placed: &mut Placed, seen: &Seen, p: &Projection) -> Option<bool> {
        let [shortest, longest] = seen.class.size().lengths;
        let sight = Direction::of(placed.at[0], placed.at[1]);
        let cosine = sight.cosine(self.heading).abs();
        if shortest >= longest || cosine < ALONG_SIGHT {
            return Some(false);
        }
        let expected = self.outline(placed, p)?;
        let middle = (seen.edges[0] + seen.edges[2]) / 2;
        // a top at the horizon is too far to measure: the class's length stays
        let Some(far) = p.on_plane([middle, seen.edges[1]], placed.height) else { return Some(false) };
        let now = p.on_plane([(expected[0] + expected[2]) / 2, expected[1]], placed.height)?;
        let farther = sight.along(far[0] - now[0], far[1] - now[1]);
        let length = (placed.length + (farther.clamp(-4000, 4000) << 14) / cosine.max(1)).clamp(shortest, longest);
        // the near end stays
        let longer = (length - placed.length) / 2;
        let [x, y] = placed.at;
        placed.at = [x + ((longer * i32::from(sight.x)) >> 14), y + ((longer * i32::from(sight.y)) >> 14)];
        let changed = length != placed.length;
        placed.length = length;
        Some(changed)
    }

    /// Moves a box along its line of sight until it is as wide as it was seen.
    fn by_width(&self, placed: &mut Placed, seen: &Seen, free: Free, p: &Projection) -> Option<()> {
        let wide = (seen.edges[0] - seen.edges[2]).max(1);
        for _ in 0..STEPS {
            let expected = self.outline(placed, p)?;
            let own = (expected[0] - expected[2]).max(1);
            // never more than twice or half as far in one step
            let scale = math::ratio::<12>(own, wide).clamp(1 << 11, 1 << 13);
            let [x, y] = placed.at.map(|v| (v * scale) >> 12);
            // across the line of sight as in every other case
            let (aim, now) =
                (column(&seen.edges, free), column(&self.outline(&Placed { at: [x, y], ..*placed }, p)?, free));
            let distance = math::length(x, y);
            let aside = math::mul_shift(distance, aim - now, 16);
            let sight = Direction::of(x, y).left();
            placed.at = [x + ((aside * i32::from(sight.x)) >> 14), y + ((aside * i32::from(sight.y)) >> 14)];
        }
        Some(())
    }

    /// The box a camera would see a vehicle in: left, top, right, bottom.
    fn outline(&self, placed: &Placed, p: &Projection) -> Option<[i32; 4]> {
        if placed.at.iter().any(|v| v.abs() > FARTHEST_CM) {
            return None;
        }
        let (hx, hy) = (i32::from(self.heading.x), i32::from(self.heading.y));
        let (l, w) = (placed.length / 2, placed.width / 2);
        let along = [(l * hx) >> 14, (l * hy) >> 14];
        let across = [(-w * hy) >> 14, (w * hx) >> 14];
        let mut edges = [i32::MIN, i32::MIN, i32::MAX, i32::MAX];
        let rise = p.towards([0, 0, placed.height]);
        for (a, b) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let x = placed.at[0] + a * along[0] + b * across[0];
            let y = placed.at[1] + a * along[1] + b * across[1];
            let foot = p.towards([x, y, -p.height_cm]);
            let roof = [foot[0] + rise[0], foot[1] + rise[1], foot[2] + rise[2]];
            for corner in [foot, roof] {
                let [left, up] = Projection::tangents(corner)?;
                edges = [edges[0].max(left), edges[1].max(up), edges[2].min(left), edges[3].min(up)];
            }
        }
        Some(edges)
    }

    /// In the road frame, with its uncertainty.
    fn lifted(&self, placed: &Placed, seen: &Seen, free: Free, by_top: bool, p: &Projection) -> LiftedBox {
        let size = seen.class.size();
        let [x, y] = placed.at;
        let distance = math::length(x, y).max(1);
        let noise = math::mul_shift(distance, self.edge_noise, 16);
        let [left_free, _, right_free, bottom_free] = free;
        // along: how far the road moves with an edge, which falls by the height over the distance
        let along = if bottom_free {
            math::mul_shift(noise, math::ratio::<8>(distance, p.height_cm.max(1)), 8)
        } else if by_top {
            self.along_by_top(seen, distance, p)
        } else {
            self.along_by_width(seen, free, distance)
        };
        let covered = if left_free && right_free { 0 } else { size.width / 6 };
        let (hx, hy) = p.levelling.unturn(i32::from(self.heading.x), i32::from(self.heading.y));
        LiftedBox {
            footprint: Footprint {
                centre: p.levelling.unplace(x, y),
                heading: Direction::of(hx, hy),
                half_length_cm: placed.length / 2,
                half_width_cm: placed.width / 2,
            },
            height_cm: placed.height,
            along_cm: along.clamp(LEAST_CM, FARTHEST_CM),
            across_cm: (noise + covered).clamp(LEAST_CM, FARTHEST_CM),
        }
    }
}

/// Least standard deviation of a place: no calibration is better, centimetres.
const LEAST_CM: i32 = 10;

/// Farthest a box is placed, centimetres.
const FARTHEST_CM: i32 = 45_000;

/// The column a box is placed by: its middle, or the side that is free.
fn column([left, _, right, _]: &[i32; 4], free: Free) -> i32 {
    match (free[0], free[2]) {
        (true, false) => *left,
        (false, true) => *right,
        _ => (left + right) / 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::calibration::{Calibration, Intrinsics};
    use crate::camera::projection::exact;
    use crate::sensor::mount::Mount;

    fn calibration(yaw_deg: f32) -> Calibration {
        Calibration {
            intrinsics: Intrinsics { size_px: [1920, 1080], focal_px: [1663.0, 1663.0], center_px: [960.0, 540.0] },
            mount: Mount { x_m: 5.0, y_m: 2.0, height_m: 6.0, yaw_deg, pitch_deg: 6.0, roll_deg: 0.0 },
        }
    }

    /// A vehicle along the road, metres: its near and far end, its middle across, its width and height.
    #[derive(Clone, Copy)]
    struct Vehicle(f64, f64, f64, f64, f64);

    const fn car(x: f64, y: f64) -> Vehicle {
        Vehicle(x, x + 4.6, y, 1.8, 1.5)
    }

    /// The box around all of it, by double precision.
    fn seen(c: &Calibration, Vehicle(near, far, y, width, height): Vehicle, class: VehicleClass) -> ImageBox {
        let mut edges = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        for x in [near, far] {
            for y in [y - width / 2.0, y + width / 2.0] {
                for z in [0.0, height] {
                    let [u, v] = exact::pixel(c, [x, y, z]).unwrap();
                    edges = [edges[0].min(u), edges[1].min(v), edges[2].max(u), edges[3].max(v)];
                }
            }
        }
        ImageBox::from_pixels(edges.map(|v| v as f32), class).unwrap()
    }

    fn lifting(c: &Calibration) -> (Lifting, Projection) {
        let p = Projection::new(c).unwrap();
        // two pixels; the traffic follows the road
        let lifting = Lifting { heading: p.levelling.road_axis(), edge_noise: p.tangent_of_rows(2 * SUBPIXELS) };
        (lifting, p)
    }

    fn lifted(c: &Calibration, own: &ImageBox, others: &[ImageBox]) -> LiftedBox {
        let (lifting, p) = lifting(c);
        check(own, &p).unwrap();
        lifting.lift(own, free_edges(own, others, &p), &p).unwrap()
    }

    /// Error of the near end along the road and of the middle across it, metres.
    fn error(got: &LiftedBox, Vehicle(near, _, y, ..): Vehicle) -> [f64; 2] {
        let f = &got.footprint;
        [f64::from(f.centre.x_cm - f.half_length_cm) / 100.0 - near, f64::from(f.centre.y_cm) / 100.0 - y]
    }

    #[test]
    fn a_vehicle_of_its_classs_size_is_placed_where_it_is() {
        for yaw in [0.0, 10.0, -12.0] {
            let c = calibration(yaw);
            for x in [25.0, 40.0, 60.0, 80.0, 105.0] {
                for y in [-4.0, 0.0, 6.0] {
                    let at = car(x, y);
                    let [along, across] = error(&lifted(&c, &seen(&c, at, VehicleClass::Car), &[]), at);
                    assert!(along.abs() < 0.3 && across.abs() < 0.1, "{yaw} {x} {y}: {along} {across}");
                }
            }
        }
    }

    #[test]
    fn left_of_the_axis_is_left_on_the_road() {
        let c = calibration(0.0);
        let place = |y| lifted(&c, &seen(&c, car(50.0, y), VehicleClass::Car), &[]).footprint.centre.y_cm;
        assert!(place(6.0) > 500 && place(-4.0) < -300);
    }

    #[test]
    fn a_car_lower_or_higher_than_its_class_keeps_its_length() {
        let c = calibration(0.0);
        for (x, height) in [(30.0, 1.3), (60.0, 1.35), (60.0, 1.7), (90.0, 1.4), (90.0, 1.65)] {
            let at = Vehicle(x, x + 4.3, 2.0, 1.8, height);
            let got = lifted(&c, &seen(&c, at, VehicleClass::Car), &[]);
            let middle = f64::from(got.footprint.centre.x_cm) / 100.0 - (x + 2.15);
            assert!(middle.abs() < 0.4, "{x} {height}: {middle}, length {}", got.footprint.half_length_cm * 2);
        }
    }

    #[test]
    fn the_far_end_of_the_roof_tells_the_length() {
        let c = calibration(0.0);
        for length in [8.0, 12.0, 16.5] {
            let truck = Vehicle(40.0, 40.0 + length, -3.0, 2.55, 4.0);
            let got = lifted(&c, &seen(&c, truck, VehicleClass::Truck), &[]);
            let lifted = f64::from(got.footprint.half_length_cm) / 50.0;
            assert!((lifted - length).abs() < 0.5, "{length}: {lifted}");
            let [along, across] = error(&got, truck);
            assert!(along.abs() < 0.3 && across.abs() < 0.15, "{along} {across}");
        }
        let endless = Vehicle(40.0, 90.0, -3.0, 2.55, 4.0);
        assert_eq!(lifted(&c, &seen(&c, endless, VehicleClass::Truck), &[]).footprint.half_length_cm, 937);
    }

    /// A car of which a nearer one, in the same lane, shows the upper third only.
    fn covered(c: &Calibration) -> (ImageBox, ImageBox, Vehicle) {
        let at = car(60.0, 0.0);
        let mut own = seen(c, at, VehicleClass::Car);
        let height = own.edges[3] - own.edges[1];
        own.edges[3] = own.edges[1] + height / 3;
        let nearer = ImageBox {
            edges: [own.edges[0] - 200, own.edges[3] + 8, own.edges[2] + 200, own.edges[3] + 2 * height],
            class: VehicleClass::Van,
        };
        (own, nearer, at)
    }

    #[test]
    fn a_covered_bottom_is_replaced_by_the_top_with_more_uncertainty() {
        let c = calibration(0.0);
        let (own, nearer, at) = covered(&c);
        let alone = lifted(&c, &own, &[]);
        let by_top = lifted(&c, &own, &[nearer]);
        assert!(error(&alone, at)[0] > 8.0, "taken for its bottom the cut lies far behind: {:?}", error(&alone, at));
        let [along, across] = error(&by_top, at);
        assert!(along.abs() < 1.0 && across.abs() < 0.1, "{along} {across}");
        let free = lifted(&c, &seen(&c, at, VehicleClass::Car), &[]);
        assert!(by_top.along_cm > free.along_cm, "{} {}", by_top.along_cm, free.along_cm);
        // what ends higher in the image stands behind and covers nothing
        let behind = ImageBox { edges: [nearer.edges[0], own.edges[1] - 300, nearer.edges[2], own.edges[1]], ..nearer };
        assert_eq!(lifted(&c, &own, &[behind]), alone);
    }

    #[test]
    fn a_bottom_below_the_image_is_replaced_by_the_top() {
        let c = calibration(0.0);
        let at = car(16.0, 1.0);
        let mut own = seen(&c, at, VehicleClass::Car);
        assert!(own.edges[3] > 1080 * SUBPIXELS);
        own.edges[3] = 1080 * SUBPIXELS;
        let got = lifted(&c, &own, &[]);
        let [along, across] = error(&got, at);
        assert!(along.abs() < 0.5 && across.abs() < 0.1, "{along} {across}");
    }

    #[test]
    fn a_box_that_ends_a_little_before_the_border_is_cut_as_well() {
        let c = calibration(0.0);
        let at = car(16.0, -5.5);
        let mut own = seen(&c, at, VehicleClass::Car);
        assert!(own.edges[2] > 1920 * SUBPIXELS && own.edges[3] > 1080 * SUBPIXELS);
        own.edges[2] = 1910 * SUBPIXELS;
        own.edges[3] = 1074 * SUBPIXELS;
        let [along, across] = error(&lifted(&c, &own, &[]), at);
        assert!(along.abs() < 0.8 && across.abs() < 0.3, "{along} {across}");
        // a small one that is near the border is whole
        let small = seen(&c, car(90.0, -12.0), VehicleClass::Car);
        let moved = (1920 - 6) * SUBPIXELS - small.edges[2];
        let beside = ImageBox {
            edges: [small.edges[0] + moved, small.edges[1], small.edges[2] + moved, small.edges[3]],
            ..small
        };
        assert_eq!(free_edges(&beside, &[], &lifting(&c).1), [true; 4]);
    }

    #[test]
    fn a_roof_above_the_camera_is_placed_by_its_width() {
        let mut c = calibration(0.0);
        c.mount.height_m = 3.5;
        let at = Vehicle(60.0, 76.5, 2.0, 2.55, 4.0);
        let mut own = seen(&c, at, VehicleClass::Truck);
        own.edges[3] -= (own.edges[3] - own.edges[1]) / 4;
        let nearer =
            ImageBox { edges: [own.edges[0] - 99, own.edges[3], own.edges[2] + 99, 9000], class: VehicleClass::Car };
        let got = lifted(&c, &own, &[nearer]);
        let [along, across] = error(&got, at);
        assert!(along.abs() < 3.0 && across.abs() < 0.3, "{along} {across}");
        // 2 % of the width, and two pixels of seventy
        assert!((200..500).contains(&got.along_cm), "{}", got.along_cm);
    }

    #[test]
    fn of_a_truck_behind_a_truck_the_width_tells_more_than_the_roof() {
        let c = calibration(0.0);
        // shorter and lower than its class is taken to be
        let at = Vehicle(80.0, 89.2, 0.0, 2.5, 3.6);
        let mut own = seen(&c, at, VehicleClass::Truck);
        own.edges[3] -= (own.edges[3] - own.edges[1]) / 2;
        let nearer =
            ImageBox { edges: [own.edges[0] - 99, own.edges[3], own.edges[2] + 99, 9000], class: VehicleClass::Truck };
        let [along, _] = error(&lifted(&c, &own, &[nearer]), at);
        assert!(along.abs() < 5.0, "{along}");
    }

    #[test]
    fn a_side_that_is_covered_is_not_used() {
        let c = calibration(0.0);
        let at = car(60.0, 3.0);
        let whole = seen(&c, at, VehicleClass::Car);
        for (cut, other) in [(0, 2), (2, 0)] {
            let mut own = whole;
            let half = (whole.edges[2] - whole.edges[0]) / 2;
            own.edges[cut] += if cut == 0 { half } else { -half };
            let mut edges = [0, own.edges[1] - 400, 0, own.edges[3] + 600];
            edges[other] = own.edges[cut];
            edges[cut] = if cut == 0 { own.edges[0] - 1500 } else { own.edges[2] + 1500 };
            let nearer = ImageBox { edges, class: VehicleClass::Truck };
            let got = lifted(&c, &own, &[nearer]);
            let [along, across] = error(&got, at);
            assert!(along.abs() < 0.3 && across.abs() < 0.1, "edge {cut}: {along} {across}");
            assert!(error(&lifted(&c, &own, &[]), at)[1].abs() > 0.3, "without the nearer one the middle is off");
            assert!(got.across_cm > lifted(&c, &whole, &[]).across_cm);
        }
    }

    #[test]
    fn the_uncertainty_is_an_ellipse_along_the_ray() {
        let c = calibration(0.0);
        let ellipse = |x| {
            let got = lifted(&c, &seen(&c, car(x, 0.0), VehicleClass::Car), &[]);
            (f64::from(got.along_cm), f64::from(got.across_cm))
        };
        // two pixels of 1663 at 60 m, seen from 6 m: 7 cm across and ten times that along
        let (along, across) = ellipse(65.0 - 2.3);
        assert!((along - 72.0).abs() < 8.0 && across == 10.0, "{along} {across}");
        let (along, across) = ellipse(125.0);
        assert!((along / across - 20.0).abs() < 3.0, "{along} {across}");
    }

    #[test]
    fn a_box_that_shows_no_vehicle_has_its_reason() {
        let (_, p) = lifting(&calibration(0.0));
        let reason = |edges| check(&ImageBox::from_pixels(edges, VehicleClass::Car).unwrap(), &p);
        use BoxRejection::*;
        assert_eq!(reason([900.0, 500.0, 800.0, 600.0]), Err(Inverted));
        assert_eq!(reason([800.0, 600.0, 900.0, 600.0]), Err(Inverted));
        assert_eq!(reason([1930.0, 600.0, 2000.0, 700.0]), Err(Outside));
        assert_eq!(reason([-90.0, 600.0, -10.0, 700.0]), Err(Outside));
        // 6 degrees down: the horizon is 175 px above the middle
        assert_eq!(reason([900.0, 300.0, 950.0, 360.0]), Err(AboveHorizon));
        assert_eq!(reason([900.0, 300.0, 950.0, 400.0]), Ok(()));
    }

    #[test]
    fn any_box_is_lifted_or_refused_in_bounded_time() {
        let c = calibration(0.0);
        let (lifting, p) = lifting(&c);
        let mut seed = 1_u32;
        let mut next = |most: i32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as i32 % most
        };
        let classes = [VehicleClass::Car, VehicleClass::Truck, VehicleClass::Pedestrian];
        for k in 0..20_000 {
            let (l, t) = (next(40_000) - 5000, next(20_000) - 2000);
            let own = ImageBox { edges: [l, t, l + next(30_000), t + next(20_000)], class: classes[k % 3] };
            let free = [next(2) > 0, next(2) > 0, next(2) > 0, next(2) > 0];
            if check(&own, &p).is_ok() {
                let _ = lifting.lift(&own, free, &p);
            }
        }
    }
}
