//! Of boxes around the same vehicle, the surest.
//!
//! Cars, vans, trucks and buses are one kind here: a detector calls one vehicle both. A rider and what they ride
//! overlap as well, and both are there.

use viewshed_harness::recording::camera::Box2d;

/// Keeps the surest of boxes that overlap (intersection over union) by `overlap` or more; the surest come first.
pub fn suppress(mut boxes: Vec<Box2d>, overlap: f64) -> Vec<Box2d> {
    boxes.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Box2d> = Vec::new();
    for own in boxes {
        if !kept.iter().any(|k| one_kind(&k.class, &own.class) && k.overlap(&own) >= overlap) {
            kept.push(own);
        }
    }
    kept
}

fn one_kind(a: &str, b: &str) -> bool {
    let large = |class: &str| matches!(class, "car" | "van" | "truck" | "bus");
    a == b || (large(a) && large(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn b(class: &str, score: f64, left: f64) -> Box2d {
        Box2d { class: class.into(), score, edges: [left, 0.0, left + 10.0, 10.0] }
    }

    #[test]
    fn the_surest_of_one_vehicle_is_left() {
        let kept =
            suppress(vec![b("car", 0.4, 0.0), b("truck", 0.6, 2.0), b("car", 0.5, 20.0), b("car", 0.3, 8.0)], 0.45);
        let lefts: Vec<(&str, f64)> = kept.iter().map(|b| (b.class.as_str(), b.edges[0])).collect();
        // 2 and 0 overlap by 8 of 12; 8 overlaps 2 by 4 of 16 only
        assert_eq!(lefts, [("truck", 2.0), ("car", 20.0), ("car", 8.0)]);
    }

    #[test]
    fn what_was_suppressed_suppresses_nothing() {
        let kept = suppress(vec![b("car", 0.9, 0.0), b("car", 0.8, 3.0), b("car", 0.7, 6.0)], 0.45);
        assert_eq!(kept.len(), 2, "the third overlaps the second alone");
    }

    #[test]
    fn a_rider_is_not_a_double() {
        assert_eq!(suppress(vec![b("pedestrian", 0.5, 0.0), b("motorcycle", 0.6, 1.0)], 0.45).len(), 2);
    }
}
