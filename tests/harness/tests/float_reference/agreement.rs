//! The whole pipeline in integers and in double precision over the shipped recording.
//!
//! Whether a detection belongs to an obstacle, or two obstacles to one vehicle, is decided once and
//! lasts, so that half a centimetre can split a lorry for seconds. Rates are therefore compared as
//! means over copies of the recording, each detection moved by less than the sensor's noise: what
//! remains is what the arithmetic does, not what one toss of a coin does.

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rayon::prelude::*;
    use viewshed::grid::settling::SettlingConfig;
    use viewshed::map::{CellState, Visibility};
    use viewshed_harness::estimators::Estimator;
    use viewshed_harness::estimators::{self, Options};
    use viewshed_harness::evaluation::samples::{self, FrameSamples};
    use viewshed_harness::evaluation::score::{Score, score};
    use viewshed_harness::evaluation::{self, Grid};
    use viewshed_harness::recording::{self, ReadOptions, Recording};

    use crate::pipeline::Pipeline;
    use crate::scene::{Random, within};

    const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
    /// Copies over which rates are averaged: of 16, means of the few that are not detected were 0.5 points apart.
    const COPIES: u64 = 64;

    fn recording() -> Recording {
        recording::read(Path::new(RECORDING), &ReadOptions::default()).unwrap()
    }

    /// The estimator of the library, and the same in double precision.
    fn estimators(
        recording: &Recording,
        far_road_deg: Option<i8>,
        settling: SettlingConfig,
    ) -> [Box<dyn Estimator>; 2] {
        let mut options = Options::default();
        options.radar_3d.settling = settling;
        options.radar_3d.visibility.far_road_deg = far_road_deg;
        let mut all = estimators::all(recording, &options).unwrap();
        let integer = all.remove(all.iter().position(|e| e.name() == "radar-3d").unwrap());
        let sensor = estimators::sensor(recording, &options.noise);
        [integer, Box::new(Pipeline::new(&sensor, &options.radar_3d))]
    }

    /// Moves every detection by less than the sensor's own noise: up to 10 cm, 0.05 degrees and 10 cm/s.
    fn moved(recording: &Recording, seed: u64) -> Recording {
        let (mut copy, mut random) = (recording.clone(), Random::new(seed));
        let mut by = |most: f64| random.between(-most, most) as f32;
        let angle = 0.05_f64.to_radians();
        for d in copy.frames.iter_mut().flat_map(|f| &mut f.detections) {
            d.range_m += by(0.1);
            d.azimuth_rad += by(angle);
            d.elevation_rad = d.elevation_rad.map(|e| e + by(angle));
            d.radial_velocity_mps += by(0.1);
        }
        copy
    }

    /// FVR and FIR of objects and of cells, %.
    fn rates(score: &Score, samples: &[FrameSamples]) -> [f64; 4] {
        let (objects, cells) = (score.objects(samples), score.cell_counts());
        [objects.fvr(), objects.fir(), cells.fvr(), cells.fir()].map(|r| r.unwrap() * 100.0)
    }

    /// The polar cells of every frame.
    fn maps(estimator: &mut dyn Estimator, recording: &Recording) -> Vec<Vec<CellState>> {
        let map = |frame| {
            estimator.step(frame);
            let polar = estimator.polar().expect("both maps are polar");
            let cells = (0..polar.azimuths).flat_map(|a| (0..polar.ranges).map(move |r| (a, r)));
            cells.map(|(a, r)| (polar.cell)(a, r)).collect()
        };
        recording.frames.iter().map(map).collect()
    }

    /// Cells known to one map only; % of the others whose bit differs, and of those that either calls
    /// invisible; mean difference of grades, steps of 255.
    fn compare(a: &[CellState], b: &[CellState]) -> [f64; 4] {
        let known = |c: &CellState| c.visibility != Visibility::Unknown;
        let one_sided = a.iter().zip(b).filter(|(a, b)| known(a) != known(b)).count();
        let both: Vec<_> = a.iter().zip(b).filter(|(a, b)| known(a) && known(b)).collect();
        let differ = both.iter().filter(|(a, b)| a.visible() != b.visible()).count() as f64;
        let invisible = both.iter().filter(|(a, b)| !a.visible() || !b.visible()).count() as f64;
        let off: f64 = both.iter().map(|(a, b)| f64::from(a.grade.abs_diff(b.grade))).sum();
        let n = both.len() as f64;
        [one_sided as f64, 100.0 * differ / n, 100.0 * differ / invisible.max(1.0), off / n]
    }

    /// Value below which this share of a list lies.
    fn quantile(values: &[f64], share: f64) -> f64 {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * share).round() as usize]
    }

    #[test]
    fn maps_agree_frame_by_frame() {
        maps_agree(None, 0.6);
    }

    #[test]
    fn maps_of_narrow_columns_agree_frame_by_frame() {
        // nearly half of all cells are of the road, where three times as many could differ
        maps_agree(Some(0), 1.0);
    }

    fn maps_agree(far_road_deg: Option<i8>, bits_median: f64) {
        let recording = recording();
        // which azimuths have settled is decided in whole columns
        let [mut integer, mut exact] = estimators(&recording, far_road_deg, SettlingConfig::AT_ONCE);
        let [maps_integer, maps_exact] = [&mut integer, &mut exact].map(|e| maps(e.as_mut(), &recording));
        assert_eq!(integer.counters(), exact.counters(), "the same detections are refused for the same reasons");
        let frames: Vec<[f64; 4]> = maps_integer.iter().zip(&maps_exact).map(|(a, b)| compare(a, b)).collect();
        let figures = [
            ("cells known to one only", 3.0, 4.0),
            // at worst one of the two takes a vehicle for one that goes its own way a frame before the other
            ("bits that differ, % of known cells", bits_median, 7.5),
            ("bits that differ, % of cells invisible to either", 10.0, 35.0),
            ("grades, steps of 255", 4.0, 18.0),
        ];
        for (k, (name, median, worst)) in figures.into_iter().enumerate() {
            let values: Vec<f64> = frames.iter().map(|f| f[k]).collect();
            within(&format!("{name}, median frame"), quantile(&values, 0.5), median);
            within(&format!("{name}, worst frame"), quantile(&values, 1.0), worst);
        }
    }

    #[test]
    fn the_same_azimuths_settle() {
        let recording = recording();
        let both = estimators(&recording, None, SettlingConfig::default());
        let [maps_integer, maps_exact] = both.map(|mut e| maps(e.as_mut(), &recording));
        let values: Vec<f64> = maps_integer.iter().zip(&maps_exact).map(|(a, b)| compare(a, b)[0]).collect();
        let column = maps_integer[0].len() as f64 / 128.0;
        within("columns known to one only, median frame", quantile(&values, 0.5) / column, 3.0);
        // when a distance grows, it does in one of the two a frame before the other
        within("columns known to one only, worst frame", quantile(&values, 1.0) / column, 32.0);
        let known = |map: &[CellState]| map.iter().filter(|c| c.visibility != Visibility::Unknown).count();
        // 1.3 s: a quarter of the view
        let [begin, end] = [20, maps_exact.len() - 1].map(|k| known(&maps_exact[k]));
        assert!(begin > 0 && begin < 3 * end / 4, "much is not settled at first: {begin}, then {end}");
    }

    #[test]
    fn rates_agree_over_copies_of_the_recording() {
        let recording = recording();
        let samples = samples::collect(&recording, &evaluation::Options::default(), &|| ());
        let runs: Vec<[[f64; 4]; 2]> = (0..COPIES)
            .into_par_iter()
            .map(|seed| {
                let copy = moved(&recording, seed);
                estimators(&recording, None, SettlingConfig::default())
                    .map(|mut e| rates(&score(e.as_mut(), &copy, &samples, Grid::Cartesian, &|| ()), &samples))
            })
            .collect();
        // means are less than 0.25 points apart
        let limits = [("FVR", 0.4), ("FIR", 0.4), ("cell FVR", 0.4), ("cell FIR", 0.4)];
        for (k, (name, limit)) in limits.into_iter().enumerate() {
            let mean = |which: usize| runs.iter().map(|r| r[which][k]).sum::<f64>() / runs.len() as f64;
            println!("{name}: integer {:.2} %, exact {:.2} %", mean(0), mean(1));
            within(&format!("{name}, points"), (mean(0) - mean(1)).abs(), limit);
        }
    }
}
