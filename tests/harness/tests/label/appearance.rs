//! How the page looks: readable when enlarged, light and dark, every key listed; and its pictures for the README.

use crate::browser::Browser;
use crate::looks::{contrast, is_readable, readme};
use crate::server::{Server, folder, recording};

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
    page.key("o");
    for _ in 0..6 {
        page.until("viewshed.session.proposals.shown");
        page.key("a");
    }
    page.until("viewshed.session.tracks.length === 6 && viewshed.session.proposals.shown");
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
