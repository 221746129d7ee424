//! How the page looks: readable when enlarged, light and dark, every key listed; and its pictures for the README.

use std::path::{Path, PathBuf};

use crate::browser::{Browser, Page};
use crate::server::{Server, folder, recording};

/// Where the README's pictures go: the folder in `VIEWSHED_PICTURES`, to renew them, or the one for all others.
fn readme(others: &Path) -> PathBuf {
    std::env::var_os("VIEWSHED_PICTURES").map_or_else(|| others.to_owned(), PathBuf::from)
}

/// Nothing is cut off or hidden to the right, and no text is smaller than it may be.
fn is_readable(page: &Page, width: u32) {
    let wide = page.number("document.documentElement.scrollWidth");
    assert!(wide <= f64::from(width), "{wide} px of {width}");
    let small = page.ask(
        "[...document.querySelectorAll('body *')].filter((e) => e.checkVisibility() && e.childNodes.length &&
          parseFloat(getComputedStyle(e).fontSize) < 11).map((e) => e.outerHTML.slice(0, 80))",
    );
    assert_eq!(small.as_array().unwrap().len(), 0, "{small}");
}

/// Contrast of text with the page, after WCAG 2.
fn contrast(page: &Page, selector: &str) -> f64 {
    page.number(&format!(
        "(() => {{
           const luminance = (colour) => {{
             const [r, g, b] = colour.match(/[\\d.]+/g).slice(0, 3).map((v) => v / 255)
               .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
             return 0.2126 * r + 0.7152 * g + 0.0722 * b;
           }};
           const element = document.querySelector('{selector}');
           const clear = 'rgba(0, 0, 0, 0)';
           let behind = element;
           while (getComputedStyle(behind).backgroundColor === clear && behind.parentElement) behind = behind.parentElement;
           const both = [getComputedStyle(element).color, getComputedStyle(behind).backgroundColor].map(luminance);
           return (Math.max(...both) + 0.05) / (Math.min(...both) + 0.05);
         }})()"
    ))
}

#[test]
fn the_page_is_readable_light_dark_and_enlarged_and_lists_its_keys() {
    let Some(browser) = Browser::start("appearance") else { return };
    let server = Server::start(&recording("appearance"));
    let page = browser.open(&server.url);
    page.until_saved();
    page.until("viewshed.session.proposals.shown");
    page.until("viewshed.ground.map !== null");
    let pictures = folder("pictures");
    page.size(1120, 820, 1.0);
    page.rests();
    page.picture(&readme(&pictures).join("label-proposal.png"));
    for _ in 0..6 {
        page.key("a");
        page.until("viewshed.session.proposals.shown || !viewshed.session.proposals.current");
    }
    page.key("c");
    page.key("PageDown");
    page.key("PageDown");
    page.key("f");
    page.until_saved();
    is_readable(&page, 1120);
    page.picture(&readme(&pictures).join("label-track.png"));
    // every key is in the list, and the list closes with Escape
    page.key("?");
    page.until("document.getElementById('help').open");
    page.picture(&pictures.join("label-keys.png"));
    let listed = page.number("document.querySelectorAll('#keys dt').length");
    assert!(listed >= 30.0, "{listed}");
    page.ask("document.getElementById('help').close()");
    for mode in ["light", "dark"] {
        if mode == "dark" {
            page.dark();
            page.rests();
            page.picture(&pictures.join("label-dark.png"));
        }
        for selector in ["h1", "#state", "#proposal-text", "#tracks button", "#tracks span", "#legend", "#now-text"] {
            let found = contrast(&page, selector);
            assert!(found >= 4.5, "{mode}, {selector}: {found}");
        }
    }
    // 200 %: half as many units of style on the same screen
    page.size(700, 500, 2.0);
    page.rests();
    is_readable(&page, 700);
    for plot in ["along", "across", "plan"] {
        let height = page.number(&format!("viewshed.plots.{plot}.area.height"));
        assert!(height > 120.0, "{plot}: {height}");
    }
    page.picture(&pictures.join("label-enlarged.png"));
}
