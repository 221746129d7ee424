//! Keys of other layouts than the US one: what is written counts, and the place of the key where that is no Latin letter or sign.

use crate::browser::Browser;
use crate::server::{Server, recording};

/// Events of layouts as browsers send them, and the key of the table each means.
const EVENTS: &[(&str, &str, &str)] = &[
    ("German Windows, AltGr and 8", "{key: '[', code: 'Digit8', ctrlKey: true, altKey: true}", "["),
    ("German Linux, AltGr and 9", "{key: ']', code: 'Digit9'}", "]"),
    ("German macOS, Option and 5", "{key: '[', code: 'Digit5', altKey: true}", "["),
    ("German, Shift and 8", "{key: '(', code: 'Digit8', shiftKey: true}", "("),
    ("German, the letter on the US [", "{key: 'ü', code: 'BracketLeft'}", "ü"),
    ("French, Shift and &", "{key: '1', code: 'Digit1', shiftKey: true}", "1"),
    ("Russian", "{key: 'ф', code: 'KeyA'}", "a"),
    ("Russian, no place told", "{key: 'ф'}", "a"),
    ("Russian, undo", "{key: 'я', code: 'KeyZ', ctrlKey: true}", "Ctrl+z"),
    ("Russian, redo", "{key: 'Я', code: 'KeyZ', ctrlKey: true, shiftKey: true}", "Ctrl+Shift+z"),
    ("Russian, the US [", "{key: 'х', code: 'BracketLeft'}", "["),
    ("Russian, the US >", "{key: 'Ю', code: 'Period', shiftKey: true}", ">"),
    ("Greek", "{key: 'α', code: 'KeyA'}", "a"),
    ("Spanish, a dead key", "{key: 'Dead', code: 'BracketLeft'}", "["),
    ("Japanese, input method", "{key: 'Process', code: 'KeyX'}", "x"),
    ("Caps Lock", "{key: 'A', code: 'KeyA'}", "a"),
    ("a point moved", "{key: 'ArrowUp', code: 'ArrowUp', altKey: true}", "Alt+ArrowUp"),
    ("a track deleted", "{key: 'Delete', code: 'Delete', shiftKey: true}", "Shift+Delete"),
    ("the browser's own", "{key: 'a', code: 'KeyA', altKey: true}", "Alt+a"),
    ("macOS, undo", "{key: 'z', code: 'KeyZ', metaKey: true}", "Ctrl+z"),
];

#[test]
fn keys_of_other_layouts_mean_what_they_write_or_where_they_lie() {
    let Some(browser) = Browser::start("layouts") else { return };
    let server = Server::start(&recording("layouts"));
    let page = browser.open(&server.url);
    let without = "{ctrlKey: false, metaKey: false, altKey: false, shiftKey: false}";
    for (what, event, meant) in EVENTS {
        let event = format!("{{...{without}, ...{event}}}");
        let named = page.ask(&format!("import('./assets/keys.js').then((keys) => keys.named({event}))"));
        assert_eq!(named, *meant, "{what}: {event}");
    }
}
