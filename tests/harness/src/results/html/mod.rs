//! A replay as one HTML file to send around: tables, charts, pictures, the worst moments, and how it was made.
//!
//! The file holds everything it shows and asks nobody for anything: its own policy forbids it. It is whole without a
//! script, on paper too; the script adds what follows the mouse and the keys.

mod chart;
pub mod charts;
mod tables;
mod trust;

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::json;
use viewshed::ESTIMATOR_VERSION;
use viewshed::unit::settings;
use viewshed::wire::header::fingerprint;

use crate::estimators;
use crate::evaluation::Settings;
use crate::evaluation::bootstrap::Interval;
use crate::evaluation::causes::Causes;
use crate::evaluation::counts::Outcome;
use crate::evaluation::examples::Lasting;
use crate::evaluation::mount_error::Sensitivity;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::Row;
use crate::results::report::{ORIGIN, json, notes, percent};
use charts::Shares;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// Largest file, bytes: most mail servers take it.
pub const MOST_BYTES: usize = 5_000_000;
/// Room that is kept for what is no picture.
const TEXT_BYTES: usize = 1_000_000;

/// A picture with what it shows.
pub struct Picture {
    pub title: String,
    pub png: Vec<u8>,
}

/// A situation, frame by frame.
pub struct Strip {
    pub lasting: Lasting,
    /// Seconds since the situation's first frame, and the picture.
    pub tiles: Vec<(f64, Vec<u8>)>,
}

/// What a report is made of.
pub struct Report<'a> {
    pub replay: &'a Replay,
    /// The estimator it is about.
    pub shown: &'a str,
    pub settings: &'a Settings,
    pub mount_error: Option<&'a [Sensitivity]>,
    pub causes: &'a [Causes],
    /// As it was typed.
    pub command: String,
    /// The first one stands at the head.
    pub pictures: Vec<Picture>,
    pub strips: Vec<Strip>,
    /// Of every frame, where the map has cells of its own.
    pub shares: Vec<Shares>,
}

/// Text as it stands in HTML, also in attributes.
pub fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#39;",
            c => html.push(c),
        }
    }
    html
}

/// The same with what stands between backticks as code.
fn with_code(text: &str) -> String {
    let code = |(k, part)| if k % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) };
    text.split('`').enumerate().map(code).collect()
}

/// Pictures as long as there is room for them.
struct Room(usize);

impl Room {
    fn image(&mut self, png: &[u8], alt: &str) -> String {
        let bytes = png.len().div_ceil(3) * 4;
        if bytes > self.0 {
            return "<p class=\"missing\">This picture was left out to keep the file small; <code>--out DIR</code> writes \
                    all of them.</p>"
                .into();
        }
        self.0 -= bytes;
        format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", escaped(alt), BASE64.encode(png))
    }
}

impl Report<'_> {
    /// The whole file.
    pub fn html(&self) -> String {
        let recording = &self.replay.recording;
        let mut room = Room(MOST_BYTES - TEXT_BYTES);
        let name = escaped(&recording.name);
        let mut html = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
             content=\"width=device-width\">\n<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src \
             data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n<meta name=\"referrer\" \
             content=\"no-referrer\">\n<title>{name} – viewshed report</title>\n<link rel=\"icon\" \
             href=\"data:,\">\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
        );
        html += &self.head();
        html += "<main>\n";
        html += &self.summary();
        if let Some(picture) = self.pictures.first() {
            let _ = writeln!(
                html,
                "<section id=\"map\"><h2>One frame from above</h2>\n{}</section>",
                figure(&mut room, picture)
            );
        }
        html += &self.rates();
        html += &self.worst(&mut room);
        html += &self.over_time();
        if self.pictures.len() > 1 {
            html += "<section id=\"pictures\"><h2>More pictures</h2>\n";
            self.pictures.iter().skip(1).for_each(|picture| html += &figure(&mut room, picture));
            html += "</section>\n";
        }
        html += &self.trust();
        html += &self.made();
        let _ = writeln!(html, "</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>");
        html
    }

    fn row(&self) -> Option<&Row> {
        self.replay.summary.rows.iter().find(|row| row.name == self.shown)
    }

    fn labelled(&self) -> bool {
        self.replay.recording.truth.is_some()
    }

    fn head(&self) -> String {
        let recording = &self.replay.recording;
        let mut html = format!(
            "<header>\n<p class=\"kind\">viewshed report</p>\n<h1>{}</h1>\n<p>{} · {} frames · {:.1} s · estimator \
             <strong>{}</strong></p>\n<nav aria-label=\"Sections\">",
            escaped(&recording.name),
            escaped(&recording.sensor.name),
            recording.frames.len(),
            recording.duration_s(),
            escaped(self.shown)
        );
        let sections = [
            ("map", "Map", !self.pictures.is_empty()),
            ("rates", "Rates", self.labelled()),
            ("worst", "Worst moments", self.labelled()),
            ("time", "Over time", !self.shares.is_empty()),
            ("trust", "How far to trust it", true),
            ("made", "How it was made", true),
        ];
        for (id, name, _) in sections.iter().filter(|(.., there)| *there) {
            let _ = write!(html, "<a href=\"#{id}\">{name}</a> ");
        }
        html += "</nav>\n</header>\n";
        if recording.sensor.synthetic {
            let _ = writeln!(html, "<p class=\"banner\"><strong>Synthetic.</strong> {}</p>", escaped(ORIGIN));
        }
        html
    }

    /// The figures that decide, each with what it means.
    fn summary(&self) -> String {
        let Some(row) = self.row().filter(|_| self.labelled()) else {
            let missing = [
                "Rates: how often the map calls visible what the sensor did not detect, and the reverse.",
                "The worst moments, and rates by class, by distance and over time.",
                "What a wrong mount would cost.",
            ];
            let list: String = missing.iter().map(|what| format!("<li>{what}</li>")).collect();
            return format!(
                "<section id=\"summary\" class=\"nothing\"><h2>This recording has no labels</h2>\n<p>So nobody can say how \
                 often its map is wrong, and this report lacks:</p>\n<ul>{list}</ul>\n<p>{}</p>\n<h3>What the map rests \
                 on</h3>\n<p>{}</p>\n{}</section>\n",
                with_code(notes::WITHOUT_LABELS),
                escaped(&notes::heading(self.replay)),
                self.notes()
            );
        };
        let i = &row.intervals;
        let card = |name: &str, rate: Option<f64>, interval: Option<Interval>, means: &str, kind: &str| {
            let spread = interval
                .map(|Interval(low, high)| format!("95 % interval {:.1} to {:.1}", 100.0 * low, 100.0 * high))
                .unwrap_or_else(|| "no interval".into());
            let unit = if rate.is_some() { "<small> %</small>" } else { "" };
            format!(
                "<div class=\"card {kind}\"><h3>{name}</h3><p class=\"figure\">{}{unit}</p><p class=\"spread\">{spread}</p>\
                 <p>{means}</p></div>\n",
                percent(rate)
            )
        };
        let cards = [
            card(
                "FVR – unsafe",
                row.counts.fvr(),
                i.fvr,
                "of the vehicles that the sensor did <em>not</em> detect, so many stood where the map said visible",
                "unsafe",
            ),
            card(
                "FIR – availability",
                row.counts.fir(),
                i.fir,
                "of the vehicles that it detected, so many stood where the map said invisible",
                "",
            ),
            card(
                "Cell FVR – unsafe",
                row.cell_fvr(),
                i.cell_fvr,
                "of the road cells out of sight by exact geometry, so many were called visible",
                "unsafe",
            ),
            card(
                "Cell FIR – availability",
                row.cell_fir(),
                i.cell_fir,
                "of the road cells in sight, so many were called invisible",
                "",
            ),
        ];
        format!(
            "<section id=\"summary\"><h2>In four figures</h2>\n<p>{}</p>\n<div class=\"cards\">{}</div></section>\n",
            escaped(&notes::heading(self.replay)),
            cards.concat()
        )
    }

    fn rates(&self) -> String {
        if !self.labelled() {
            return String::new();
        }
        let marks: Vec<(f64, String, String)> = self
            .strips
            .iter()
            .enumerate()
            .map(|(k, strip)| {
                (self.time_s(strip.lasting.example.time_ns), title(&strip.lasting), format!("moment-{k}"))
            })
            .collect();
        let mut html = String::from("<section id=\"rates\"><h2>Rates</h2>\n");
        html += &tables::rates(&self.replay.summary, self.shown);
        html += "<p class=\"note\">TVR + FIR = 100 % of the detected, FVR + TIR = 100 % of the undetected. The rows geometry-slice \
                 (1 m above the road) and geometry-box (all of a vehicle) are exact lines of sight past the labelled boxes: the bounds \
                 of any such method. Slice in the last columns is geometry-slice.</p>\n";
        html += &self.notes();
        html += "<p class=\"note\">Point at a curve, or give a chart the focus and use the arrow keys; the buttons hide and show. \
                 Hollow points are of fewer than 50 samples; triangles lead to the worst moments.</p>\n";
        html += &charts::of_rates(self.replay, self.shown, &marks);
        let broken_down = tables::breakdown(&self.replay.summary, self.shown);
        let _ = writeln!(html, "<details><summary>By class, distance and occlusion</summary>\n{broken_down}</details>");
        if let Some(sensitivities) = self.mount_error {
            html += &tables::mount_error(sensitivities);
        }
        for causes in self.causes {
            html += &tables::causes(causes);
        }
        html += "</section>\n";
        if let Some(camera) = &self.replay.camera {
            let shown = camera.summary.rows.first().map_or("", |row| row.name.as_str());
            let _ = writeln!(
                html,
                "<section id=\"camera\"><h2>The camera beside the radar</h2>\n<p>{}</p>",
                escaped(&notes::heading(camera))
            );
            html += &tables::rates(&camera.summary, shown);
            html += &list(&notes::of_camera(camera));
            html += &charts::of_rates(camera, shown, &[]);
            html += "</section>\n";
        }
        html
    }

    /// What was counted, left out and assumed, and what was wrong with the input.
    fn notes(&self) -> String {
        format!("<div id=\"notes\">\n{}</div>\n", list(&notes::below(self.replay, &self.settings.evaluation)))
    }

    fn time_s(&self, time_ns: i64) -> f64 {
        let start = self.replay.recording.frames.first().map_or(0, |f| f.time_ns);
        time_ns.saturating_sub(start) as f64 * 1e-9
    }

    fn worst(&self, room: &mut Room) -> String {
        if !self.labelled() {
            return String::new();
        }
        let mut html = String::from("<section id=\"worst\"><h2>Worst moments</h2>\n");
        if self.strips.is_empty() {
            html += "<p>No vehicle stood where the map was wrong.</p>\n";
        }
        for outcome in [Outcome::Fv, Outcome::Fi] {
            let of_this = || self.strips.iter().enumerate().filter(|(_, s)| s.lasting.example.outcome == outcome);
            if of_this().next().is_none() {
                continue;
            }
            html += match outcome {
                Outcome::Fv => {
                    "<h3>Called visible, and not detected</h3>\n<p>Unknown blind spots: a vehicle stood there, the \
                                sensor said nothing, and the map promised sight. Longest first, those first that exact \
                                geometry calls hidden.</p>\n"
                }
                _ => {
                    "<h3>Called invisible, and yet detected</h3>\n<p>Lost availability: the map denied sight of a vehicle that \
                      the sensor saw. Longest first, those first that exact geometry calls in sight.</p>\n"
                }
            };
            for (k, strip) in of_this() {
                html += &self.moment(k, strip, room);
            }
        }
        html + "</section>\n"
    }

    fn moment(&self, number: usize, strip: &Strip, room: &mut Room) -> String {
        let example = &strip.lasting.example;
        let time_ns = |frame: usize| self.replay.recording.frames.get(frame).map_or(0, |f| f.time_ns);
        let begin_s = self.time_s(time_ns(strip.lasting.first));
        let lasts_s = self.time_s(time_ns(strip.lasting.last)) - begin_s;
        let geometry = if example.slice_in_sight { "in sight" } else { "hidden" };
        let mut html = format!(
            "<article id=\"moment-{number}\"><h4><span class=\"outcome {}\">{}</span> {}</h4>\n<p>From {begin_s:.1} s for {lasts_s:.1} s \
             ({} frames), {:.0} m away in the middle of it; by exact geometry it is {geometry} then. The vehicle is ringed; the \
             dotted line runs to the sensor. Each picture shows 72 m x 26 m.</p>\n<div class=\"strip\">",
            example.outcome.name().to_lowercase(),
            example.outcome.name(),
            escaped(&title(&strip.lasting)),
            example.lasts,
            example.distance_m
        );
        for (since_s, png) in &strip.tiles {
            let alt = format!("{} {since_s:+.1} s from its beginning", title(&strip.lasting));
            let _ = writeln!(
                html,
                "<figure>{}<figcaption>{:.2} s ({since_s:+.2})</figcaption></figure>",
                room.image(png, &alt),
                begin_s + since_s
            );
        }
        html + "</div></article>\n"
    }

    fn over_time(&self) -> String {
        if self.shares.is_empty() {
            return String::new();
        }
        format!("<section id=\"time\"><h2>The map over time</h2>\n{}</section>\n", charts::of_shares(&self.shares))
    }

    fn trust(&self) -> String {
        let lines: String = trust::lines(self.replay).iter().map(|line| format!("<li>{line}</li>\n")).collect();
        format!("<section id=\"trust\"><h2>How far to trust it</h2>\n<ul>\n{lines}</ul></section>\n")
    }

    fn made(&self) -> String {
        let recording = &self.replay.recording;
        let view = &recording.sensor.field_of_view;
        let [azimuth, elevation] = [view.azimuth_rad, view.elevation_rad].map(|ends| ends.map(f64::to_degrees));
        let [x, y, z] = recording.pose.position;
        let options = json!({
            "evaluation": self.settings.evaluation,
            "reading": json::reading(&self.settings.reading),
            "estimators": self.settings.estimators,
        });
        let options = serde_json::to_string_pretty(&options).unwrap_or_default();
        let detections: usize = recording.frames.iter().map(|f| f.detections.len()).sum();
        let facts = [
            ("Command", format!("<code>{}</code>", escaped(&self.command))),
            (
                "Program",
                format!("viewshed {}, version {ESTIMATOR_VERSION} of the estimator", env!("CARGO_PKG_VERSION")),
            ),
            (
                "Recording",
                escaped(&format!(
                    "{}, {} frames, {detections} detections, {:.1} s",
                    recording.name,
                    recording.frames.len(),
                    recording.duration_s()
                )),
            ),
            (
                "Licence of the recording",
                escaped(
                    recording
                        .sensor
                        .licence
                        .as_deref()
                        .unwrap_or("the recording names none; ask who made it before you pass it on"),
                ),
            ),
            ("Sensor", escaped(&recording.sensor.name)),
            (
                "Mount",
                format!(
                    "{}x {x:.2} m, y {y:.2} m, {z:.2} m above the road; yaw {:.2}°, pitch {:.2}°, roll {:.2}°",
                    if self.is_assumed("no mount") { "assumed: " } else { "" },
                    recording.pose.yaw_rad().to_degrees(),
                    recording.pose.pitch_rad().to_degrees(),
                    recording.pose.roll_rad().to_degrees()
                ),
            ),
            (
                "Field of view",
                format!(
                    "{}azimuth {:.1}° to {:.1}°, elevation {:.1}° to {:.1}°, range {:.1} to {:.1} m",
                    if self.is_assumed("no field of view") { "assumed: " } else { "" },
                    azimuth[0],
                    azimuth[1],
                    elevation[0],
                    elevation[1],
                    view.range_m[0],
                    view.range_m[1]
                ),
            ),
            (
                "Fingerprint of the options",
                format!("<code>{:08X}</code> (CRC-32 of the text below)", fingerprint(options.as_bytes())),
            ),
            ("Fingerprint of a unit", self.unit()),
        ];
        let facts: String = facts.iter().map(|(name, what)| format!("<dt>{name}</dt><dd>{what}</dd>\n")).collect();
        format!(
            "<section id=\"made\"><h2>How it was made</h2>\n<dl>\n{facts}</dl>\n<details><summary>All options</summary>\n\
             <pre>{}</pre></details></section>\n",
            escaped(&options)
        )
    }

    /// Whether the recording lacks this, and something usual was taken.
    fn is_assumed(&self, what: &str) -> bool {
        self.replay.recording.problems.iter().any(|p| p.what.contains(what) && p.what.contains(" assumed; "))
    }

    /// What a unit with this configuration broadcasts of it.
    fn unit(&self) -> String {
        let recording = &self.replay.recording;
        if recording.of_camera().is_some() {
            return "none: a camera's unit has other settings".into();
        }
        let options = &self.settings.estimators;
        let sensor = estimators::sensor(recording, &options.noise);
        let (gate, visibility, health) = (options.radar_3d.gate, options.radar_3d.visibility, options.radar_3d.health);
        let unit = settings::Settings { gate, visibility, health, ..settings::Settings::of(sensor) };
        if unit.radar_3d() != options.radar_3d {
            return "none: these options hold values that are no settings of a unit".into();
        }
        format!(
            "<code>{:08X}</code>: what <code>viewshed listen</code> shows of a unit with this mount and configuration",
            unit.fingerprint()
        )
    }
}

fn title(lasting: &Lasting) -> String {
    format!("{} {}", lasting.example.class, lasting.example.object_id)
}

fn figure(room: &mut Room, picture: &Picture) -> String {
    let caption = escaped(&picture.title);
    format!(
        "<figure class=\"picture\">{}<figcaption>{caption}</figcaption></figure>\n",
        room.image(&picture.png, &picture.title)
    )
}

fn list(lines: &[String]) -> String {
    let items: String = lines.iter().map(|line| format!("<li>{}</li>\n", with_code(line.trim()))).collect();
    if items.is_empty() { items } else { format!("<ul class=\"note\">\n{items}</ul>\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(escaped("<a href='x'>\"&"), "&lt;a href=&#39;x&#39;&gt;&quot;&amp;");
    }

    #[test]
    fn commands_in_a_text_are_code() {
        assert_eq!(with_code("a `b <c>` d"), "a <code>b &lt;c&gt;</code> d");
    }

    #[test]
    fn a_picture_that_does_not_fit_is_said_to_be_missing() {
        let mut room = Room(8);
        assert!(room.image(&[0; 6], "a").contains("data:image/png;base64,AAAAAAAA"));
        assert!(room.image(&[0; 1], "b").contains("left out"), "there is no room any more");
    }
}
