//! Which options of the groups were given: those a command cannot use for what it reads are named, not passed over.

use super::{
    ConfigArgs, EstimatorArgs, EvaluationArgs, HeightArgs, JudgingArgs, KindArgs, ReadingArgs, SettingsArgs, UnitArgs,
};

/// Of options and whether they are given, those that are.
pub(in crate::command) fn given<const N: usize>(options: [(&'static str, bool); N]) -> Vec<&'static str> {
    options.into_iter().filter(|(_, given)| *given).map(|(option, _)| option).collect()
}

// each is taken apart whole, so that an option that is added is not forgotten here

impl SettingsArgs {
    /// The options that are given, in the order of the help.
    pub fn given(&self) -> Vec<&'static str> {
        let Self { reading, judging: JudgingArgs { evaluation, estimators, config: ConfigArgs { config } } } = self;
        let config = given([("--config", config.is_some())]);
        [reading.given(), evaluation.given(), estimators.given(), config].concat()
    }
}

impl ReadingArgs {
    fn given(&self) -> Vec<&'static str> {
        let Self {
            radar_topic,
            truth_topic,
            labels,
            road_frame,
            radar_frame,
            velocity_sign,
            velocity_scale,
            mount,
            fov,
            interface,
            sensor_id,
            kind: KindArgs { radar, cluster_states, ti_header, ti_dialect },
            frame_period,
            from,
            to,
        } = self;
        given([
            ("--radar-topic", radar_topic.is_some()),
            ("--truth-topic", truth_topic.is_some()),
            ("--labels", labels.is_some()),
            ("--road-frame", road_frame.is_some()),
            ("--radar-frame", radar_frame.is_some()),
            ("--velocity-sign", velocity_sign.is_some()),
            ("--velocity-scale", velocity_scale.is_some()),
            ("--mount", mount.is_some()),
            ("--fov", fov.is_some()),
            ("--interface", interface.is_some()),
            ("--sensor-id", sensor_id.is_some()),
            ("--radar", radar.is_some()),
            ("--cluster-states", cluster_states.is_some()),
            ("--ti-header", ti_header.is_some()),
            ("--ti-dialect", ti_dialect.is_some()),
            ("--frame-period", frame_period.is_some()),
            ("--from", from.is_some()),
            ("--to", to.is_some()),
        ])
    }
}

impl EvaluationArgs {
    fn given(&self) -> Vec<&'static str> {
        let Self {
            min_speed,
            height: HeightArgs { slice_height },
            warm_up,
            growth,
            growth_azimuth,
            doppler_tolerance,
            min_detections,
            grid,
            bootstrap,
            seed,
        } = self;
        given([
            ("--min-speed", min_speed.is_some()),
            ("--slice-height", slice_height.is_some()),
            ("--warm-up", warm_up.is_some()),
            ("--growth", growth.is_some()),
            ("--growth-azimuth", growth_azimuth.is_some()),
            ("--doppler-tolerance", doppler_tolerance.is_some()),
            ("--min-detections", min_detections.is_some()),
            ("--grid", grid.is_some()),
            ("--bootstrap", bootstrap.is_some()),
            ("--seed", seed.is_some()),
        ])
    }
}

impl EstimatorArgs {
    fn given(&self) -> Vec<&'static str> {
        let Self { unit: UnitArgs { max_detections, grid_size, far_road, noise, ground_error }, reference_share } =
            self;
        given([
            ("--max-detections", max_detections.is_some()),
            ("--grid-size", grid_size.is_some()),
            ("--far-road", far_road.is_some()),
            ("--noise", noise.is_some()),
            ("--ground-error", ground_error.is_some()),
            ("--reference-share", reference_share.is_some()),
        ])
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: SettingsArgs,
    }

    #[test]
    fn every_option_that_is_given_is_named() {
        let parsed = |line: &[&str]| Line::try_parse_from([&["viewshed"], line].concat()).unwrap().settings.given();
        assert_eq!(parsed(&[]), Vec::<&str>::new());
        let mut all = Vec::new();
        for option in Line::command().get_arguments() {
            let name = format!("--{}", option.get_long().unwrap());
            let value = match &*name {
                "--velocity-sign" => "receding",
                "--mount" => "0,0,6,0,4,0",
                "--fov" => "-60,60,-16,16,3,200",
                "--radar" => "ARS408",
                "--ti-header" => "36",
                "--ti-dialect" => "degrees",
                "--grid" => "polar",
                "--grid-size" => "small",
                "--far-road" => "along-road",
                "--noise" => "0.25,0.5,1,0.15",
                "--ground-error" => "1,0",
                _ => "1",
            };
            assert_eq!(parsed(&[&format!("{name}={value}")]), [&*name]);
            all.push(format!("{name}={value}"));
        }
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        assert_eq!(parsed(&all).len(), all.len());
    }
}
