//! What is searched: keys of the configuration and how far each may go.

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::estimators::{self, Grid};

/// Most parameters of a space.
pub const MOST: usize = 12;

/// The key that is a choice, not a number: 0 stands for the reference grid, 1 for the small one.
pub const GRID: &str = "grid";

/// One key of `[estimators]` and its limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// For example `radar_3d.visibility.visible_from`.
    pub key: String,
    pub low: f64,
    pub high: f64,
}

/// A search space, as its file (TOML) has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Space {
    pub parameter: Vec<Parameter>,
}

impl Parameter {
    /// A value as a file of the configuration has it.
    pub fn written(&self, value: f64) -> String {
        if self.key == GRID { format!("\"{}\"", grid(value).name()) } else { format!("{value:?}") }
    }
}

/// The grid of a value.
fn grid(value: f64) -> Grid {
    if value < 0.5 { Grid::Reference } else { Grid::Small }
}

impl Default for Space {
    fn default() -> Self {
        let all = [
            ("visibility.visible_from", 0.3, 0.9),
            ("obstacles.headway_s", 0.05, 0.8),
            ("obstacles.gate_sigmas", 0.5, 3.5),
            ("obstacles.half_width_m", 0.3, 1.2),
            ("obstacles.lateral_gate_m", 0.3, 1.6),
            ("obstacles.outline_memory_s", 0.5, 5.0),
            ("obstacles.outline_share", 0.02, 0.12),
            ("obstacles.outline_sigmas", 0.0, 2.0),
            ("obstacles.lateral_memory_s", 0.2, 1.6),
            ("obstacles.visible_loss_per_s", 4.0, 25.0),
            ("obstacles.hidden_loss_per_s", 0.3, 4.0),
            ("evidence.visible_memory_s", 0.2, 3.0),
        ];
        let parameter =
            |(key, low, high): &(&str, f64, f64)| Parameter { key: format!("radar_3d.{key}"), low: *low, high: *high };
        Self { parameter: all.iter().map(parameter).collect() }
    }
}

impl Space {
    /// # Errors
    /// The line and key of what cannot be read, and those of [`Space::check`].
    pub fn parse(text: &str, usual: &estimators::Options) -> Result<Self> {
        let space: Self = toml::from_str(text)?;
        space.check(usual)?;
        Ok(space)
    }

    /// # Errors
    /// No parameter, too many, one twice, one that is no number of the configuration, limits the wrong way round or that
    /// the usual value is not within.
    pub fn check(&self, usual: &estimators::Options) -> Result<()> {
        let n = self.parameter.len();
        ensure!(n > 0, "the search space names no parameter");
        ensure!(n <= MOST, "the search space names {n} parameters, {MOST} at most are searched");
        for (k, p) in self.parameter.iter().enumerate() {
            let key = &p.key;
            ensure!(self.parameter[..k].iter().all(|other| other.key != *key), "`{key}` is named twice");
            ensure!(
                p.low.is_finite() && p.high.is_finite() && p.low < p.high,
                "`{key}` from {} to {} is no interval: the lower limit comes first",
                p.low,
                p.high
            );
            let value = value(usual, key)?;
            ensure!(
                key != GRID || (p.low, p.high) == (0.0, 1.0),
                "`{GRID}` is a choice from 0 (reference) to 1 (small)"
            );
            ensure!(
                (p.low..=p.high).contains(&value),
                "`{key}` is {value} without tuning, outside {} to {}: the search begins there",
                p.low,
                p.high
            );
        }
        Ok(())
    }

    /// Where the usual values lie in the unit cube.
    ///
    /// # Errors
    /// Those of [`Space::check`].
    pub fn usual(&self, usual: &estimators::Options) -> Result<Vec<f64>> {
        self.parameter.iter().map(|p| Ok((value(usual, &p.key)? - p.low) / (p.high - p.low))).collect()
    }

    /// Values of a point of the unit cube, in the parameters' order, rounded to what is worth writing down.
    pub fn values(&self, point: &[f64]) -> Vec<f64> {
        let value = |(p, x): (&Parameter, &f64)| {
            // divided by a power of ten, a value is as short as it looks, and comes back from a file as it was
            if p.key == GRID {
                return f64::from(u8::from(*x >= 0.5));
            }
            let parts = 10_f64.powi(3 - (p.high - p.low).log10().floor() as i32);
            ((p.low + x * (p.high - p.low)) * parts).round() / parts
        };
        self.parameter.iter().zip(point).map(value).collect()
    }

    /// The options with these values.
    ///
    /// # Errors
    /// A key that is not there.
    pub fn apply(&self, usual: &estimators::Options, values: &[f64]) -> Result<estimators::Options> {
        let mut all = serde_json::to_value(usual)?;
        for (p, v) in self.parameter.iter().zip(values) {
            if p.key != GRID {
                *all.pointer_mut(&pointer(&p.key)).with_context(|| no_key(&p.key))? = Value::from(*v);
            }
        }
        let mut options: estimators::Options = serde_json::from_value(all)?;
        if let Some((_, v)) = self.parameter.iter().zip(values).find(|(p, _)| p.key == GRID) {
            options.grid = grid(*v);
        }
        Ok(options)
    }
}

fn pointer(key: &str) -> String {
    format!("/{}", key.replace('.', "/"))
}

fn no_key(key: &str) -> String {
    format!("the configuration has no `estimators.{key}`; `viewshed replay --json` lists its keys under \"options\"")
}

fn value(options: &estimators::Options, key: &str) -> Result<f64> {
    if key == GRID {
        return Ok(f64::from(u8::from(options.grid == Grid::Small)));
    }
    let all = serde_json::to_value(options)?;
    match all.pointer(&pointer(key)) {
        // a value of 32 bits as it is written, not as it is stored
        Some(Value::Number(n)) if n.is_f64() => {
            let value = n.as_f64().unwrap_or_default();
            Ok((value as f32).to_string().parse()?)
        }
        Some(_) => bail!("`{key}` is no number with a point: only such are searched"),
        None => bail!("{}", no_key(key)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        format!("{:#}", Space::parse(text, &estimators::Options::default()).unwrap_err())
    }

    fn one(key: &str, low: f64, high: f64) -> String {
        format!("[[parameter]]\nkey = \"{key}\"\nlow = {low:?}\nhigh = {high:?}\n")
    }

    #[test]
    fn the_usual_space_has_no_more_parameters_than_may_be_and_begins_at_the_usual_values() {
        let (space, usual) = (Space::default(), estimators::Options::default());
        space.check(&usual).unwrap();
        let begin = space.usual(&usual).unwrap();
        assert!(begin.len() == MOST && begin.iter().all(|x| (0.0..=1.0).contains(x)), "{begin:?}");
        assert_eq!(space.apply(&usual, &space.values(&begin)).unwrap(), usual);
    }

    #[test]
    fn a_value_goes_where_its_key_says() {
        let usual = estimators::Options::default();
        let space = Space::parse(&one("radar_3d.obstacles.gap_m", 4.0, 10.0), &usual).unwrap();
        assert_eq!(space.values(&[0.25]), [5.5]);
        let mut expected = usual.clone();
        expected.radar_3d.obstacles.gap_m = 5.5;
        assert_eq!(space.apply(&usual, &[5.5]).unwrap(), expected);
    }

    #[test]
    fn the_grid_is_a_choice() {
        let usual = estimators::Options::default();
        let space = Space::parse(&one("grid", 0.0, 1.0), &usual).unwrap();
        assert_eq!((space.values(&[0.49]), space.values(&[0.5])), (vec![0.0], vec![1.0]));
        assert_eq!(space.usual(&usual).unwrap(), [0.0]);
        let small = space.apply(&usual, &[1.0]).unwrap();
        assert_eq!(small, estimators::Options { grid: Grid::Small, ..usual.clone() });
        assert_eq!(space.usual(&small).unwrap(), [1.0], "and back");
        assert_eq!([0.0, 1.0].map(|v| space.parameter[0].written(v)), ["\"reference\"", "\"small\""]);
        assert!(refused(&one("grid", 0.0, 2.0)).contains("a choice"));
    }

    #[test]
    fn a_space_that_cannot_be_searched_is_refused_by_its_key() {
        assert!(refused("parameter = []").contains("names no parameter"));
        assert!(refused(&one("radar_3d.obstacles.gap", 4.0, 10.0)).contains("no `estimators.radar_3d.obstacles.gap`"));
        assert!(refused(&one("max_detections", 1.0, 256.0)).contains("no number with a point"));
        assert!(refused(&one("radar_3d.obstacles.gap_m", 10.0, 4.0)).contains("from 10 to 4 is no interval"));
        assert!(refused(&one("radar_3d.obstacles.gap_m", 8.0, 9.0)).contains("is 7 without tuning, outside 8 to 9"));
        let gap = one("radar_3d.obstacles.gap_m", 4.0, 10.0);
        assert!(refused(&(gap.clone() + &gap)).contains("named twice"));
        assert!(refused(&gap.repeat(13)).contains("13 parameters, 12 at most"));
    }
}
