//! `--report`: what a replay gave, as one page.

use std::collections::BTreeSet;

use anyhow::{Result, ensure};
use viewshed::map::Visibility;

use super::{Replayed, SHOWN, SHOWN_OF_CAMERA, pictures};
use crate::command::progress::bar;
use crate::estimators::{self, Estimator};
use crate::evaluation::Settings;
use crate::evaluation::counts::Outcome;
use crate::evaluation::examples::{self, Lasting};
use crate::evaluation::replay::{Replay, visit};
use crate::results::files::Target;
use crate::results::html::charts::Shares;
use crate::results::html::{Picture, Report, Strip};

/// Situations of each false outcome that are shown.
const MOMENTS: usize = 3;
/// What is shown before and after a situation, seconds.
const AROUND_S: f64 = 0.5;
const TILE_PX: i32 = 720;

/// Draws and writes it.
///
/// # Errors
/// A file that cannot be written.
pub fn write(target: &Target, replayed: &Replayed, settings: &Settings) -> Result<()> {
    let Replayed { replay, examples, mount_error, causes, shown_frame } = replayed;
    let drawing = bar("writing the report", 1);
    let shown = if replay.recording.of_camera().is_some() { SHOWN_OF_CAMERA } else { SHOWN };
    let worst = worst(replay, shown);
    let chosen = shown_frame.unwrap_or_else(|| pictures::chosen_frame(replay, examples));
    let frames: Vec<Vec<usize>> = worst.iter().map(|lasting| of_strip(replay, lasting)).collect();
    let mut strips: Vec<Strip> = worst.into_iter().map(|lasting| Strip { lasting, tiles: Vec::new() }).collect();
    let (mut drawn, mut shares) = (Vec::new(), Vec::new());
    let mut all = estimators::all(&replay.recording, &settings.estimators)?;
    all.retain(|estimator| estimator.name() == shown);
    ensure!(!all.is_empty(), "no estimator {shown}");
    let every: Vec<usize> = (0..replay.recording.frames.len()).collect();
    let mut outcome = Ok(());
    visit(&replay.recording, &mut all, &every, |frame, _, estimator| {
        shares.extend(of_frame(replay, estimator, frame));
        let mut draw = || -> Result<()> {
            if frame == chosen {
                drawn = at_chosen(replay, estimator, frame, settings)?;
            }
            for (strip, _) in strips.iter_mut().zip(&frames).filter(|(_, frames)| frames.contains(&frame)) {
                let Some(tile) = pictures::about(replay, estimator, frame, strip.lasting.track, TILE_PX, settings)
                else {
                    continue;
                };
                strip.tiles.push((since(replay, strip.lasting.first, frame), tile.png()?));
            }
            Ok(())
        };
        if outcome.is_ok() {
            outcome = draw();
        }
    });
    outcome?;
    let report = Report {
        replay,
        shown,
        settings,
        mount_error: mount_error.as_deref(),
        causes,
        command: command(std::env::args_os().map(|word| word.to_string_lossy().into_owned())),
        pictures: drawn,
        strips,
        shares,
    };
    target.write(report.html())?;
    drawing.step();
    Ok(())
}

/// The situations that say most of what is wrong, FV first.
fn worst(replay: &Replay, shown: &str) -> Vec<Lasting> {
    let Some(score) = replay.score(shown) else { return Vec::new() };
    let of = |outcome| examples::most_telling(&replay.recording, &replay.samples, score, outcome, MOMENTS);
    [Outcome::Fv, Outcome::Fi].into_iter().flat_map(of).collect()
}

/// Frames of a strip: before, at the beginning, twice in between, at the end, and after.
fn of_strip(replay: &Replay, lasting: &Lasting) -> Vec<usize> {
    let times: Vec<i64> = replay.recording.frames.iter().map(|f| f.time_ns).collect();
    let time = |frame: usize| times.get(frame).copied().unwrap_or(0);
    let around_ns = (AROUND_S * 1e9) as i64;
    let nearest = |time_ns: i64| (0..times.len()).min_by_key(|k| time(*k).abs_diff(time_ns)).unwrap_or(0);
    let (first, last) = (time(lasting.first), time(lasting.last));
    let frames = [
        nearest(first - around_ns),
        lasting.first,
        nearest(first + (last - first) / 3),
        nearest(first + (last - first) / 3 * 2),
        lasting.last,
        nearest(last + around_ns),
    ];
    frames.into_iter().collect::<BTreeSet<_>>().into_iter().collect()
}

/// Seconds from one frame to another.
fn since(replay: &Replay, from: usize, to: usize) -> f64 {
    let time = |frame: usize| replay.recording.frames.get(frame).map_or(0, |f| f.time_ns);
    time(to).saturating_sub(time(from)) as f64 * 1e-9
}

/// What a map says in all, where it has cells of its own.
fn of_frame(replay: &Replay, estimator: &dyn Estimator, frame: usize) -> Option<Shares> {
    let polar = estimator.polar()?;
    let mut shares = Shares {
        time_s: since(replay, 0, frame),
        detections: replay.recording.frames.get(frame).map_or(0, |f| f.detections.len()),
        ..Shares::default()
    };
    let one = 1.0 / (polar.azimuths * polar.ranges).max(1) as f64;
    for (azimuth, range) in (0..polar.azimuths).flat_map(|a| (0..polar.ranges).map(move |r| (a, r))) {
        *match (polar.cell)(azimuth, range).visibility {
            Visibility::Visible => &mut shares.visible,
            Visibility::Invisible => &mut shares.invisible,
            Visibility::Unknown => &mut shares.unknown,
        } += one;
    }
    Some(shares)
}

fn at_chosen(replay: &Replay, estimator: &dyn Estimator, frame: usize, settings: &Settings) -> Result<Vec<Picture>> {
    let name = estimator.name();
    let time_s = since(replay, 0, frame);
    let mut all = Vec::new();
    let mut add = |title: String, canvas: Option<crate::results::pictures::canvas::Canvas>| -> Result<()> {
        if let Some(canvas) = canvas {
            all.push(Picture { title, png: canvas.png()? });
        }
        Ok(())
    };
    let from_above = pictures::from_above(replay, estimator, frame, None, settings);
    add(format!("What {name} says at {time_s:.2} s, from above"), Some(from_above))?;
    add(format!("The same as {name} computes it: azimuth over range"), pictures::polar_grid(replay, estimator, frame))?;
    add("Camera's view with the map drawn into it".into(), pictures::camera_view(replay, estimator, frame, settings)?)?;
    Ok(all)
}

/// A command as it can be typed again.
fn command(words: impl Iterator<Item = String>) -> String {
    let quoted = |(k, word): (usize, String)| {
        // where the program lies is nobody's business
        let word = if k == 0 { "viewshed".to_owned() } else { word };
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
    };
    words.enumerate().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_can_be_typed_again() {
        let words = ["/opt/bin/viewshed", "replay", "my file.mcap", "--report", "it's.html", ""].map(str::to_owned);
        assert_eq!(command(words.into_iter()), "viewshed replay 'my file.mcap' --report 'it'\\''s.html' ''");
    }
}
