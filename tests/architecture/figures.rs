//! What was measured has one home: `tests/RESULTS.md`, which `viewshed results` writes, and `tests/STUDIES.md`, the log of what was tried.
//! Elsewhere it stands only between markers that the same command fills.

use std::fs;
use std::path::Path;

use crate::files::{below, name};

/// Pages where figures may stand as they were measured, and why.
const HOMES: [(&str, &str); 3] = [
    ("tests/RESULTS.md", "written by `viewshed results`"),
    ("tests/STUDIES.md", "the log of what was tried, each figure with its date's estimator"),
    ("CHANGELOG.md", "what a release was worth"),
];

/// Lines that look like figures of a measurement and are none.
const NONE: [(&str, &str); 1] = [("src/wire/SPECIFICATION.md", "points of the road, in the receiver's rules")];

/// What is measured, in words.
const MEASURED: [&str; 6] = ["FVR", "FIR", "points of", "points more", "points fewer", "M instructions"];

#[test]
fn no_page_and_no_comment_has_a_figure_of_its_own() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for path in below(root, &[".md", ".rs"], &|_| false) {
        let name = name(&path, root);
        if HOMES.iter().chain(&NONE).any(|(page, _)| *page == name) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        let of = if name.ends_with(".rs") { comments(&text) } else { page(&text) };
        found.extend(of.into_iter().filter(|(_, line)| is_figure(line)).map(|(k, line)| format!("{name}:{k}: {line}")));
    }
    assert!(found.is_empty(), "{} figures outside their home:\n{}", found.len(), found.join("\n"));
}

/// Whether a line says what something measured came to: two rates as `a / b`, or a decimal beside what is measured.
fn is_figure(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    let decimal = |word: &&str| {
        let word = word.trim_start_matches(['+', '-', '*']).trim_end_matches(|c: char| !c.is_ascii_digit());
        word.split_once('.').is_some_and(|(a, b)| a.parse::<u32>().is_ok() && b.parse::<u32>().is_ok())
    };
    let is_pair = words.windows(3).any(|three| three[1] == "/" && decimal(&three[0]) && decimal(&three[2]));
    let near = |what: &str| {
        line.match_indices(what).any(|(at, _)| {
            let from = line[..at].char_indices().rev().nth(24).map_or(0, |(k, _)| k);
            let end = at + what.len();
            let to = line[end..].char_indices().nth(24).map_or(line.len(), |(k, _)| end + k);
            line[from..to].split_whitespace().any(|word| decimal(&word))
        })
    };
    is_pair || MEASURED.iter().any(|what| near(what))
}

/// Lines of a page outside markers and code.
fn page(text: &str) -> Vec<(usize, String)> {
    let (mut inside, mut code) = (false, false);
    let mut lines = Vec::new();
    for (k, line) in text.lines().enumerate() {
        inside |= line.starts_with("<!-- results ");
        code ^= line.starts_with("```");
        if !inside && !code && !line.starts_with("    ") {
            lines.push((k + 1, line.to_owned()));
        }
        inside &= line != "<!-- end of results -->";
    }
    lines
}

/// Lines of a source's documentation and comments.
fn comments(text: &str) -> Vec<(usize, String)> {
    let comment = |line: &str| line.split_once("//").map(|(_, comment)| comment.to_owned());
    text.lines().enumerate().filter_map(|(k, line)| Some((k + 1, comment(line)?))).collect()
}

#[test]
fn figures_are_told_from_constants() {
    for line in [
        "crossings come to 17.2 / 11.4 now",
        "that takes 0.4 points of FVR off",
        "cell FVR falls to 9.9 %",
        "about 1.3 M instructions a frame",
    ] {
        assert!(is_figure(line), "{line}");
    }
    for line in ["a column is 0.95 degrees wide", "FVR and FIR, by tracks", "at 1 m / 5 m", "needs 2 of 8 points"] {
        assert!(!is_figure(line), "{line}");
    }
    let text = "a\n<!-- results x -->\n1.0 / 2.0\n<!-- end of results -->\nb\n";
    assert_eq!(page(text), [(1, "a".to_owned()), (5, "b".to_owned())]);
}
