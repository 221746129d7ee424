//! A configuration file whose mount comes with a configuration block: what it says of the place, and what it says in vain.

use viewshed::{ConfigError, FieldOfView, Mount, NoiseConfig, Problem, Sensor, Settings};

use crate::config::Config;

impl Config {
    /// What is wrong with lanes, heights and what was tuned, whatever the mount.
    pub fn place_problem(&self) -> Option<ConfigError> {
        // among the lanes, or halfway along the heights
        let on_lanes: Vec<[f32; 2]> = self.lanes.iter().flat_map(|lane| lane.iter().copied()).collect();
        let along = self.ground.iter().map(|[x, _]| [*x, 0.0]);
        let points: Vec<[f32; 2]> = if on_lanes.is_empty() { along.collect() } else { on_lanes };
        let [x_m, y_m] = [0, 1].map(|axis| middle(points.iter().map(|point| point[axis])));
        let mount = Mount { x_m, y_m, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 };
        let field_of_view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        };
        let any = Settings::of(Sensor { mount, field_of_view, noise: NoiseConfig::default() });
        let refused = self.grid.check().settings(&self.of_place(any)).err()?;
        // another mount may be near enough
        let far = matches!(refused.problem, Problem::TooFar | Problem::OutOfLimits { .. });
        let of_mount = far && ["lanes", "ground.x_m"].contains(&refused.parameter);
        (!of_mount).then_some(refused)
    }

    /// Which tables do nothing, as the mount and all that goes with it are left to a configuration block.
    pub fn unused(&self) -> Option<String> {
        let given = [
            ("[noise]", self.noise.is_some()),
            ("[gate]", self.gate.is_some()),
            ("[visibility]", self.visibility.is_some()),
            ("[health]", self.health.is_some()),
        ];
        let given: Vec<&str> = given.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect();
        let unused = self.settings().is_none() && !given.is_empty();
        unused.then(|| format!("{}: not used without [mount]; a configuration block has its own", given.join(", ")))
    }
}

/// Halfway between the least and the greatest; 0 where no mount could be.
fn middle(values: impl Iterator<Item = f32> + Clone) -> f32 {
    let (least, most) = (values.clone().fold(f32::INFINITY, f32::min), values.fold(f32::NEG_INFINITY, f32::max));
    let middle = least / 2.0 + most / 2.0;
    if middle.abs() <= 10_000.0 { middle } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A daemon whose mount comes with a block, with these tables.
    fn problem(tables: &str) -> Option<String> {
        let text = format!(
            "[input]\nradar = \"ars408\"\ninterface = \"can0\"\n[output]\nmedium = \"can\"\ninterface = \"can1\"\n\
             service = true\n{tables}"
        );
        let problems = Config::parse(&text).err()?;
        Some(problems.into_iter().map(|(line, what)| format!("{}: {what}", line.unwrap_or(0))).collect())
    }

    #[test]
    fn what_the_file_alone_says_of_the_place_is_checked_without_a_mount() {
        for (tables, wrong) in [
            ("[obstacles]\ngap_m = -1.0\n", "9: obstacles.gap_m: "),
            ("[evidence]\ngain = -1.0\n", "9: evidence.gain: "),
            ("[fixtures]\nleast_share = 7.0\n", "9: fixtures.least_share: "),
            ("[ground]\npoints = [[0.0, 0.0], [10.0, 4.0]]\n", "8: ground: before point 1 the road is steeper"),
            ("[ground]\npoints = [[0.0, 0.0], [nan, 4.0]]\n", "8: ground.x_m: is NaN"),
            ("[[lanes]]\npoints = [[0.0, 0.0]]\n", "8: lanes: lane 0 has fewer than two points"),
        ] {
            let found = problem(tables).unwrap_or_default();
            assert!(found.starts_with(wrong), "{tables}: {found}");
        }
    }

    #[test]
    fn what_some_mount_fits_is_no_problem() {
        for tables in [
            "",
            "[ground]\npoints = [[1500.0, 0.0], [1700.0, 4.0]]\n",
            "[[lanes]]\npoints = [[5000.0, -700.0], [5600.0, -700.0]]\n",
            // of a radar that looks across them
            "[[lanes]]\npoints = [[-500.0, 0.0], [500.0, 0.0]]\n",
        ] {
            assert_eq!(problem(tables), None, "{tables}");
        }
    }

    #[test]
    fn tables_that_do_nothing_without_a_mount_are_named() {
        let config = |tables: &str| {
            let text = "[input]\nradar = \"ars408\"\ninterface = \"can0\"\n[output]\nmedium = \"can\"\n\
                        interface = \"can1\"\nservice = true\n";
            Config::parse(&format!("{text}{tables}")).unwrap()
        };
        let said = config("[noise]\nazimuth_deg = 0.3\n[health]\nhold_s = 1.0\n").unused().unwrap();
        assert!(said.starts_with("[noise], [health]: not used without [mount]"), "{said}");
        assert_eq!(config("[evidence]\ngain = 0.4\n").unused(), None);
        let mount = "[mount]\nx_m = 0.0\ny_m = 0.0\nheight_m = 6.0\nyaw_deg = 0.0\npitch_deg = 4.0\nroll_deg = 0.0\n\
                     [field_of_view]\nazimuth_min_deg = -60.0\nazimuth_max_deg = 60.0\nelevation_min_deg = -16.0\n\
                     elevation_max_deg = 16.0\nrange_min_m = 3.0\nrange_max_m = 200.0\n";
        assert_eq!(config(&format!("{mount}[noise]\nazimuth_deg = 0.3\n")).unused(), None);
    }
}
