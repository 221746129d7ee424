//! Lanes of motor traffic out of a SUMO net: streets, and the ways through crossings.
//!
//! Lanes of walkers, bicycles and rails are left out. A lane is cut where the radar does not reach, straightened to
//! decimetres, and joined to the one lane it goes on into, so that many fit a unit's table.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use quick_xml::events::{BytesStart, Event};

use super::frame::RoadFrame;
use super::opened;
use crate::estimators::Lane;
use crate::geometry::polyline::{direction, straightened, within};

/// How far a bend may be from its chord, metres.
const STRAIGHT_M: f64 = 0.2;
/// How far apart an end and a beginning of one lane are, metres.
const JOINED_M: f64 = 0.3;
/// Least cosine between two lanes of which one goes on as the other: 2.5 degrees.
const STRAIGHT_ON: f64 = 0.999;

/// How far lanes are of use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// The radar's place, road coordinates, metres.
    pub from: [f64; 2],
    pub reach_m: f64,
}

/// Reads the lanes of a net, in its order.
///
/// # Errors
/// A file that cannot be read or is no net, a shape that is none, and a net without such a lane within reach.
pub fn lanes(path: &Path, frame: &RoadFrame, reach: &Reach) -> Result<Vec<Lane>> {
    let place = || format!("SUMO net {}", path.display());
    let frame = RoadFrame { net_offset: super::frame::net_offset(path)?, ..*frame };
    let mut xml = quick_xml::Reader::from_reader(opened::open(path).with_context(place)?);
    let (mut buffer, mut found) = (Vec::new(), Vec::new());
    loop {
        buffer.clear();
        match xml.read_event_into(&mut buffer).with_context(place)? {
            Event::Start(e) | Event::Empty(e) if e.name().as_ref() == "lane" => {
                let id = opened::attribute(&e, "id").with_context(place)?.unwrap_or_default();
                if let Some(shape) = shape(&e).with_context(|| format!("{}, lane `{id}`", place()))? {
                    found.push(shape.into_iter().map(|p| frame.place(p)).collect::<Vec<_>>());
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    let cut = joined(found).into_iter().map(|lane| within(&lane, reach.from, reach.reach_m));
    let lanes: Vec<Lane> = cut.filter_map(|lane| Lane::of(&straightened(&lane, STRAIGHT_M))).collect();
    let [x, y] = reach.from;
    ensure!(
        !lanes.is_empty(),
        "{}: no lane of motor traffic within {} m of ({x}, {y}) in road coordinates: is the origin right?",
        place(),
        reach.reach_m
    );
    Ok(lanes)
}

/// Points of a lane that motor vehicles use.
fn shape(lane: &BytesStart) -> Result<Option<Vec<[f64; 2]>>> {
    const MOTORS: [&str; 5] = ["passenger", "private", "delivery", "truck", "bus"];
    let classes = |key| opened::attribute(lane, key).map(Option::unwrap_or_default);
    let (allow, disallow) = (classes("allow")?, classes("disallow")?);
    let names = |text: &str, name: &str| text.split_whitespace().any(|word| word == name);
    let is_open = |class: &&str| if allow.is_empty() { !names(&disallow, class) } else { names(&allow, class) };
    if names(&disallow, "all") || !MOTORS.iter().any(|class| names(&allow, "all") || is_open(class)) {
        return Ok(None);
    }
    let text = opened::attribute(lane, "shape")?.unwrap_or_default();
    let point = |word: &str| -> Option<[f64; 2]> {
        let mut numbers = word.split(',').map(|v| v.parse().ok().filter(|v: &f64| v.is_finite()));
        Some([numbers.next()??, numbers.next()??])
    };
    let points: Option<Vec<_>> = text.split_whitespace().map(point).collect();
    let points = points.with_context(|| format!("its shape \"{text}\" is no list of places"))?;
    ensure!(points.len() > 1, "its shape \"{text}\" has fewer than two places");
    Ok(Some(points))
}

/// Lanes, each with those that it goes straight on into.
fn joined(lanes: Vec<Vec<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
    let mut all = lanes;
    let goes_on = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        let (end, begin) = (a[a.len() - 1], b[0]);
        let (from, to) = (direction(a[a.len() - 2], end), direction(begin, b[1]));
        (end[0] - begin[0]).hypot(end[1] - begin[1]) < JOINED_M && from[0] * to[0] + from[1] * to[1] > STRAIGHT_ON
    };
    let mut k = 0;
    while k < all.len() {
        match (0..all.len()).find(|&n| n != k && goes_on(&all[k], &all[n])) {
            Some(next) => {
                let rest = all[next].clone();
                all[k].extend(&rest[1..]);
                all.remove(next);
                k -= usize::from(next < k);
            }
            None => k += 1,
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use viewshed::obstacles::lanes::{MOST_LANES, MOST_SEGMENTS};

    use super::*;
    use crate::twin::scene::Scene;

    fn read(test: &str, text: &str, reach_m: f64) -> Result<Vec<Lane>> {
        let path = std::env::temp_dir().join(format!("viewshed-net-{test}-{}.xml", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let found = lanes(&path, &RoadFrame::default(), &Reach { from: [0.0, 0.0], reach_m });
        std::fs::remove_file(&path).unwrap();
        found
    }

    fn net(lanes: &str) -> String {
        format!("<net><location netOffset=\"100.00,0.00\"/><edge id=\"e\">{lanes}</edge></net>")
    }

    #[test]
    fn lanes_of_motors_are_taken_cut_and_straightened() {
        let text = net("<lane id=\"a\" shape=\"-100.00,2.00 100.00,2.10 300.00,2.00\"/>\
             <lane id=\"walk\" allow=\"pedestrian\" shape=\"0,5 300,5\"/>\
             <lane id=\"cycle\" allow=\"bicycle\" shape=\"0,7 300,7\"/>\
             <lane id=\"bus\" allow=\"bus taxi\" shape=\"100,9 150,9\"/>\
             <lane id=\"rail\" disallow=\"all\" shape=\"100,9 150,9\"/>\
             <lane id=\"away\" disallow=\"pedestrian\" shape=\"500,0 700,0\"/>");
        let found = read("cut", &text, 50.0).unwrap();
        let of = |k: usize| found[k].points.clone();
        assert_eq!(found.len(), 2, "{found:?}");
        assert_eq!(of(1), [[0.0, 9.0], [49.18, 9.0]], "to the circle");
        let [from, to] = of(0)[..] else { panic!("{found:?}") };
        assert!((from[0] + 50.0).abs() < 0.1 && (to[0] - 50.0).abs() < 0.1 && (from[1] - 2.05).abs() < 0.06);
    }

    #[test]
    fn what_goes_straight_on_is_one_lane_and_a_fork_is_two() {
        let text = net("<lane id=\"b\" shape=\"150,0 200,0\"/><lane id=\"a\" shape=\"100,0 150,0\"/>\
             <lane id=\"turn\" shape=\"150,0 155,1 160,5 161,20\"/>");
        let found = read("joined", &text, 300.0).unwrap();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found.iter().any(|lane| lane.points == [[0.0, 0.0], [100.0, 0.0]]), "{found:?}");
        assert!(found.iter().any(|lane| lane.points.len() == 4), "{found:?}");
    }

    #[test]
    fn a_net_that_is_none_is_named_with_what_is_wrong() {
        let said = |text: &str| format!("{:#}", read("bad", text, 50.0).unwrap_err());
        assert!(said("<routes/>").contains("is no SUMO net"));
        assert!(said(&net("")).contains("is the origin right?"));
        let bad = said(&net("<lane id=\"l7\" shape=\"1,2 3\"/>"));
        assert!(bad.contains("lane `l7`") && bad.contains("no list of places"), "{bad}");
    }

    #[test]
    fn traffic_of_the_twins_crossings_drives_on_their_lanes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/crossing");
        for name in ["train-1", "train-2", "skewed-2", "tee-2"] {
            let scene = Scene::read(&folder.join(format!("{name}.toml"))).unwrap();
            let found = scene.lanes().unwrap();
            let segments: usize = found.iter().map(|lane| lane.points.len() - 1).sum();
            let room = [MOST_LANES, MOST_SEGMENTS];
            assert!(found.len() <= room[0] && segments <= room[1], "{name}: {} lanes, {segments}", found.len());
            let simulation = crate::twin::simulate::Simulation::new(scene, None).unwrap();
            let (mut on, mut all) = (0, 0);
            for since_s in 0..80 {
                for (_, pose) in simulation.traffic.at(simulation.scene.from_s() + f64::from(since_s)) {
                    let [length, width, _] = pose.solid.size;
                    // bicycles and walkers have lanes of their own, and none has a heading while it stands aside
                    if length < 3.0 || width < 1.5 || pose.velocity[0].hypot(pose.velocity[1]) < 2.0 {
                        continue;
                    }
                    let [x, y, _] = pose.solid.center;
                    if (x - simulation.scene.radar.mount.x_m).hypot(y - simulation.scene.radar.mount.y_m) > 140.0 {
                        continue;
                    }
                    let heading = [pose.solid.yaw_rad.cos(), pose.solid.yaw_rad.sin()];
                    all += 1;
                    on += u32::from(found.iter().any(|lane| {
                        lane.points.windows(2).any(|pair| {
                            let [a, b] = [pair[0].map(f64::from), pair[1].map(f64::from)];
                            let d = direction(a, b);
                            let (along, left) =
                                ((x - a[0]) * d[0] + (y - a[1]) * d[1], (y - a[1]) * d[0] - (x - a[0]) * d[1]);
                            let long = (b[0] - a[0]).hypot(b[1] - a[1]);
                            let ahead = d[0] * heading[0] + d[1] * heading[1];
                            (-3.0..=long + 3.0).contains(&along) && left.abs() < 1.0 && ahead > 0.94
                        })
                    }));
                }
            }
            assert!(all > 300 && on * 100 >= all * 93, "{name}: {on} of {all} vehicles on a lane");
        }
    }
}
