//! What a sensor sees of a level road, and whether that can be meant.

use viewshed::sensor::Sensor;

/// A sensor that sees the road over less of its range is hardly meant so.
const LEAST_SHARE: f64 = 0.5;
/// More is a slip, or a radar that hangs on its side.
const MOST_ROLL_DEG: f32 = 20.0;

/// What is doubtful about how a sensor hangs, each with why.
pub fn doubts(sensor: &Sensor) -> Vec<String> {
    let (mount, view) = (&sensor.mount, &sensor.field_of_view);
    let (height, far) = (f64::from(mount.height_m), f64::from(view.range_max_m));
    let [lower, upper] = [view.elevation_min_deg, view.elevation_max_deg].map(|e| f64::from(e - mount.pitch_deg));
    // where a line of sight so far above the horizon meets the road
    let meets = |deg: f64| if deg < 0.0 { height / (-deg).to_radians().tan() } else { f64::INFINITY };
    let of = format!(
        "mount.pitch_deg {} with an elevation of {} to {} degrees",
        mount.pitch_deg, view.elevation_min_deg, view.elevation_max_deg
    );
    let mut doubts = Vec::new();
    if meets(lower) > LEAST_SHARE * far {
        let begins = if lower < 0.0 { format!("only from {:.0} m on", meets(lower)) } else { "nowhere".into() };
        doubts.push(format!("{of}: the road is in view {begins}, of {far:.0} m; pitch is + nose down"));
    } else if meets(upper) < LEAST_SHARE * far {
        doubts.push(format!("{of}: the road is in view only up to {:.0} m, of {far:.0} m", meets(upper)));
    }
    if mount.roll_deg.abs() > MOST_ROLL_DEG {
        doubts.push(format!("mount.roll_deg {}: a radar hangs level but for a few degrees", mount.roll_deg));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use viewshed::sensor::field_of_view::FieldOfView;
    use viewshed::sensor::mount::Mount;
    use viewshed::sensor::noise::NoiseConfig;

    use super::*;

    fn said(pitch_deg: f32, roll_deg: f32) -> String {
        doubts(&Sensor {
            mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg, roll_deg },
            field_of_view: FieldOfView {
                azimuth_min_deg: -60.0,
                azimuth_max_deg: 60.0,
                elevation_min_deg: -16.0,
                elevation_max_deg: 16.0,
                range_min_m: 3.0,
                range_max_m: 200.0,
            },
            noise: NoiseConfig::default(),
        })
        .join("\n")
    }

    #[test]
    fn a_mount_that_sees_little_of_the_road_is_doubtful() {
        for pitch in [-8.0, 0.0, 4.0, 12.0] {
            assert_eq!(said(pitch, 3.0), "", "{pitch}");
        }
        assert!(said(40.0, 0.0).contains("only up to 13 m, of 200 m"), "{}", said(40.0, 0.0));
        assert!(said(22.0, 0.0).contains("only up to 57 m, of 200 m"), "{}", said(22.0, 0.0));
        assert!(said(-14.0, 0.0).contains("only from 172 m on, of 200 m"), "{}", said(-14.0, 0.0));
        assert!(said(-30.0, 0.0).contains("nowhere"), "{}", said(-30.0, 0.0));
        assert!(said(4.0, -30.0).contains("mount.roll_deg -30"));
    }
}
