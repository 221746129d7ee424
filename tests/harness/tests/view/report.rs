//! The report: one file that opens offline, is read on screen and paper, and says what is missing.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::browser::Browser;
use crate::looks::{contrast, is_readable, readme};
use crate::server::{SHIPPED, folder};

const MOST_BYTES: usize = 5_000_000;

/// Writes a report, with options.
fn report(folder: &Path, recording: &Path, options: &[&str]) -> (PathBuf, String) {
    let file = folder.join("report.html");
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.arg("replay").arg(recording).args(["--bootstrap", "100", "--force", "--report"]).arg(&file).args(options);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.len() <= MOST_BYTES, "{} bytes", text.len());
    (file, text)
}

/// A copy of the shipped recording without its labels.
fn unlabelled(folder: &Path) -> PathBuf {
    use viewshed_harness::recording::write::RecordingWriter;
    use viewshed_harness::recording::{ReadOptions, read};

    let reading = ReadOptions { to_s: Some(4.0), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let (mut bytes, start) = (std::io::Cursor::new(Vec::new()), recording.frames[0].time_ns);
    let mut writer = RecordingWriter::new(&mut bytes, &recording.sensor, &recording.pose, start).unwrap();
    recording.frames.iter().for_each(|frame| writer.frame(frame).unwrap());
    writer.finish().unwrap();
    let path = folder.join("site.mcap");
    std::fs::write(&path, bytes.into_inner()).unwrap();
    path
}

#[test]
fn a_report_opens_from_a_file_asks_nobody_and_complains_about_nothing() {
    let folder = folder("report");
    let (file, text) = report(&folder, Path::new(SHIPPED), &["--mount-error"]);
    for needed in ["synthetic", "MIT OR Apache-2.0", "How far to trust it", "Fingerprint", "replay", "--bootstrap 100"]
    {
        assert!(text.contains(needed), "{needed}");
    }
    // nothing could be asked for, whatever is opened
    assert!(!text.contains("http://") && !text.contains("https://") && text.contains("default-src 'none'"));
    let Some(browser) = Browser::start("report") else { return };
    let page = browser.open(&format!("file://{}", file.display()));
    page.rests();
    assert_eq!(page.console(), Vec::<String>::new());
    let asked = page.requests();
    assert!(asked.iter().all(|url| url.starts_with("file://") || url.starts_with("data:")), "{asked:?}");
    assert_eq!(asked.iter().filter(|url| url.starts_with("file://")).count(), 1, "{asked:?}");
    // pictures are there, and of each worst moment several
    let broken = page.number("[...document.images].filter((i) => !i.complete || i.naturalWidth === 0).length");
    assert_eq!(broken, 0.0);
    let moments = page.ask("[...document.querySelectorAll('article')].map((a) => a.querySelectorAll('img').length)");
    let moments = moments.as_array().unwrap();
    assert!((4..=6).contains(&moments.len()) && moments.iter().all(|n| n.as_u64().unwrap() >= 3), "{moments:?}");
    // the table's figures are those of the cards
    let fvr = page.ask("document.querySelector('.card .figure').textContent.split(' ')[0]");
    let row = page.ask("document.querySelector('tr.strong').children[2].firstChild.textContent");
    assert_eq!(fvr, row);
    page.picture(&folder.join("top.png"));
    page.size(1120, 820, 1.0);
    page.rests();
    page.picture(&readme(&folder).join("report.png"));
}

#[test]
fn charts_answer_to_mouse_keys_and_buttons() {
    let Some(browser) = Browser::start("charts") else { return };
    let folder = folder("charts");
    let (file, _) = report(&folder, Path::new(SHIPPED), &[]);
    let page = browser.open(&format!("file://{}", file.display()));
    let says = "document.querySelector('.says')?.textContent ?? ''";
    // keys
    page.ask("document.querySelector('.chart svg').scrollIntoView()");
    page.ask("document.querySelector('.chart svg').focus()");
    page.key("ArrowRight");
    page.until("document.querySelector('.says')");
    let first = page.ask(says);
    assert!(first.as_str().unwrap().starts_with("radar-3d, visible from grade"), "{first}");
    page.key("ArrowRight");
    assert_ne!(page.ask(says), first);
    page.key("Escape");
    page.until("!document.querySelector('.says')");
    // the mouse over the operating point
    let at = page.ask(
        "(() => { const dot = document.querySelector('.series.strong circle').getBoundingClientRect();
           return [dot.left + dot.width / 2, dot.top + dot.height / 2]; })()",
    );
    page.click([0, 1].map(|k| at[k].as_f64().unwrap()));
    page.until("document.querySelector('.says')");
    // a button hides its series everywhere in its group
    let shown = "document.querySelectorAll('.group .series:not(.off)').length";
    let before = page.number(shown);
    page.ask("document.querySelector('.legend button[data-series=true-boxes]').click()");
    assert!(page.number(shown) <= before - 5.0, "{} of {before}", page.number(shown));
    // the threshold moves along the curve: nothing visible at its end
    page.ask(
        "(() => { const slider = document.querySelector('.threshold input'); slider.value = 256;
           slider.dispatchEvent(new Event('input')); })()",
    );
    let said = page.ask("document.querySelector('.threshold output').textContent");
    assert!(said.as_str().unwrap().contains("objects FVR 0.0 %, FIR 100.0 %"), "{said}");
    // a mark over time leads to its moment
    page.ask("document.querySelector('.mark').dispatchEvent(new MouseEvent('click', { bubbles: true }))");
    page.until("document.querySelector('article:target')");
}

#[test]
fn it_is_read_light_dark_enlarged_and_on_paper() {
    let Some(browser) = Browser::start("report, appearance") else { return };
    let folder = folder("appearance");
    let (file, _) = report(&folder, Path::new(SHIPPED), &[]);
    let page = browser.open(&format!("file://{}", file.display()));
    page.size(1120, 900, 1.0);
    is_readable(&page, 1120);
    for mode in ["light", "dark"] {
        if mode == "dark" {
            page.dark();
            page.rests();
            page.picture(&folder.join("dark.png"));
        }
        for selector in
            ["h1", ".banner", ".card p", ".card .spread", "td", "td small", ".note", "nav a", ".legend button", "dt"]
        {
            let found = contrast(&page, selector);
            assert!(found >= 4.5, "{mode}, {selector}: {found}");
        }
    }
    page.size(600, 800, 2.0);
    page.rests();
    is_readable(&page, 600);
    let pdf = page.printed();
    let pages = pdf.windows(11).filter(|bytes| bytes == b"/Type /Page").count();
    assert!(pdf.starts_with(b"%PDF") && (4..=20).contains(&pages), "{pages} pages");
    std::fs::write(folder.join("report.pdf"), pdf).unwrap();
    page.paper();
    page.size(794, 1123, 1.0);
    page.rests();
    page.picture(&folder.join("paper.png"));
    assert_eq!(page.ask("getComputedStyle(document.querySelector('nav')).display"), "none");
    assert!(contrast(&page, "h1") > 7.0, "dark letters on paper, whatever the screen was");
}

#[test]
fn without_labels_it_says_what_is_missing_and_shows_the_map() {
    let folder = folder("unlabelled");
    let recording = unlabelled(&folder);
    let (file, text) = report(&folder, &recording, &[]);
    assert!(
        text.contains("This recording has no labels") && text.contains("<code>viewshed label RECORDING</code>"),
        "{text}"
    );
    assert!(!text.contains("id=\"rates\"") && !text.contains("id=\"worst\""), "no empty sections");
    assert!(text.contains("What the map says over time") && text.contains("Nothing was compared"));
    let Some(browser) = Browser::start("report without labels") else { return };
    let page = browser.open(&format!("file://{}", file.display()));
    assert_eq!(page.console(), Vec::<String>::new());
    assert!(page.number("document.images.length") >= 2.0);
    page.picture(&folder.join("unlabelled.png"));
}

#[test]
fn several_recordings_and_a_file_that_exists_are_refused() {
    let folder = folder("refused");
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        let output = command.current_dir(&folder).arg("replay").args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, error) = run(&[SHIPPED, SHIPPED, "--report", "r.html"]);
    assert!(code == Some(2) && error.contains("--report writes one recording"), "{error}");
    std::fs::write(folder.join("r.html"), "mine").unwrap();
    let (code, error) = run(&[SHIPPED, "--report", "r.html"]);
    assert!(code == Some(2) && error.contains("--force"), "{error}");
    assert_eq!(std::fs::read_to_string(folder.join("r.html")).unwrap(), "mine");
    let (code, error) = run(&[SHIPPED, "--report", "new.html", "--board", "mps2-an386"]);
    assert!(code == Some(2) && error.contains("--report") && !folder.join("new.html").exists(), "{error}");
}
