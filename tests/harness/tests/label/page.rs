//! The page itself: drawing, changing, saving, and what it says when that fails.

use std::fs;

use serde_json::Value;

use crate::browser::{ALT, Browser, CTRL, Page, SHIFT};
use crate::offered::{is_in_view, point_at};
use crate::server::{Server, recording};

/// Times and places of a track that is drawn by clicks, along the road.
const LINE: [[f64; 2]; 3] = [[1.0, 150.0], [3.0, 110.0], [5.0, 60.0]];

fn tracks(page: &Page) -> Vec<Value> {
    page.ask("viewshed.session.tracks").as_array().unwrap().clone()
}

fn points(track: &Value) -> Vec<[f64; 3]> {
    let points = track["points"].as_array().unwrap();
    points.iter().map(|point| [0, 1, 2].map(|k| point[k].as_f64().unwrap())).collect()
}

/// Draws a track by clicks along the road.
fn draw(page: &Page, line: &[[f64; 2]]) {
    page.key("0");
    page.key("n");
    line.iter().for_each(|[time, x]| page.click_plot("along", *time, *x));
    page.key("Enter");
}

#[test]
fn a_track_that_is_drawn_is_saved_and_there_after_a_reload() {
    let Some(browser) = Browser::start("drawing") else { return };
    let server = Server::start(&recording("drawing"));
    let page = browser.open(&server.url);
    page.until_saved();
    draw(&page, &LINE);
    page.key("3");
    page.until_saved();
    let drawn = tracks(&page);
    assert_eq!((&drawn[0]["id"], &drawn[0]["class"]), (&"1".into(), &"truck".into()), "{drawn:?}");
    for (point, [time, x]) in points(&drawn[0]).iter().zip(LINE) {
        assert!((point[0] - time).abs() < 0.1 && (point[1] - x).abs() < 2.0, "{drawn:?}");
    }
    let file = fs::read_to_string(&server.labels).unwrap();
    assert!(file.lines().count() > 10 && file.contains(",1,truck,"), "{file}");
    page.goes_to(&server.url);
    page.until_saved();
    let read = tracks(&page);
    assert_eq!((read.len(), points(&read[0]).len()), (1, 3), "{read:?}");
    assert_eq!(page.ask("document.querySelectorAll('#tracks button').length"), 1);
    for (a, b) in points(&read[0]).iter().flatten().zip(points(&drawn[0]).iter().flatten()) {
        assert!((a - b).abs() < 0.002, "{read:?} {drawn:?}");
    }
    // and back
    page.key("PageDown");
    page.key("Delete");
    page.until("viewshed.session.tracks.length === 0");
    page.key_with("z", CTRL);
    page.until("viewshed.session.tracks.length === 1");
    page.key_with("z", CTRL | SHIFT);
    page.until_saved();
    assert_eq!((tracks(&page).len(), fs::read_to_string(&server.labels).unwrap().lines().count()), (0, 1));
}

#[test]
fn tracks_are_dragged_split_joined_renamed_and_every_step_is_undone() {
    let Some(browser) = Browser::start("changing") else { return };
    let server = Server::start(&recording("changing"));
    let page = browser.open(&server.url);
    page.until_saved();
    draw(&page, &LINE);
    let drawn = points(&tracks(&page)[0]);
    // a drag is one step; the coordinate that the plot does not show stays
    let [from, to] = [[drawn[1][0], drawn[1][1]], [3.5, 120.0]].map(|[time, x]| page.screen("along", time, x));
    let middle = [(from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0];
    page.drag(&[from, middle, to], 0);
    let dragged = points(&tracks(&page)[0]);
    assert!((dragged[1][0] - 3.5).abs() < 0.1 && (dragged[1][1] - 120.0).abs() < 2.0, "{dragged:?}");
    assert_eq!((dragged[1][2], dragged[0], dragged[2]), (drawn[1][2], drawn[0], drawn[2]));
    // the same with keys, in the other plot
    page.focus("across");
    page.key_with("ArrowUp", ALT);
    page.key_with("ArrowUp", ALT);
    let nudged = points(&tracks(&page)[0]);
    assert!(nudged[1][2] > dragged[1][2] && nudged[1][1] == dragged[1][1], "{nudged:?}");
    // split at the cursor, then joined again
    page.click_plot("along", 2.0, 190.0);
    page.key("PageDown");
    page.key("s");
    page.until("viewshed.session.tracks.length === 2");
    let halves = tracks(&page);
    let cut = points(&halves[0]).last().unwrap()[0];
    assert!((cut - 2.0).abs() < 0.1 && points(&halves[1])[0][0] == cut, "{halves:?}");
    page.key("j");
    page.key("PageUp");
    page.key("j");
    page.until("viewshed.session.tracks.length === 1");
    assert_eq!(points(&tracks(&page)[0]).len(), 4);
    // either end is cut off at the cursor, one step each
    let whole = points(&tracks(&page)[0]);
    for (key, kept) in [("(", &whole[2..]), (")", &whole[..2])] {
        page.click_plot("along", 2.5, 190.0);
        page.key("PageDown");
        page.key(key);
        page.until(&format!("viewshed.session.tracks[0].points.length === {}", kept.len() + 1));
        let cut = points(&tracks(&page)[0]);
        let (at, rest) = if key == "(" { (cut[0], &cut[1..]) } else { (cut[2], &cut[..2]) };
        assert!((at[0] - 2.5).abs() < 0.1 && rest == kept, "{key}: {cut:?}");
        page.key_with("z", CTRL);
        page.until("viewshed.session.tracks[0].points.length === 4");
    }
    // a name in use is refused, another is taken
    page.key("i");
    page.ask("(document.getElementById('track-id').value = 'lorry', document.getElementById('track-id').dispatchEvent(new Event('change')), 1)");
    page.until("viewshed.session.tracks.some((track) => track.id === 'lorry')");
    page.focus("along");
    page.until_saved();
    assert!(fs::read_to_string(&server.labels).unwrap().contains(",lorry,"));
    // all the way back, and forth again
    let last = tracks(&page);
    while page.ask("viewshed.session.history.past.length") != 0 {
        page.key_with("z", CTRL);
    }
    assert!(tracks(&page).is_empty());
    while page.ask("viewshed.session.history.future.length") != 0 {
        page.key_with("y", CTRL);
    }
    page.until_saved();
    assert_eq!(tracks(&page), last);
}

#[test]
fn a_track_is_drawn_with_the_keyboard_alone_and_in_the_plan() {
    let Some(browser) = Browser::start("keyboard") else { return };
    let server = Server::start(&recording("keyboard"));
    let page = browser.open(&server.url);
    page.until_saved();
    // everything can be reached with Tab
    let mut reached = Vec::new();
    for _ in 0..40 {
        page.key("Tab");
        reached.push(page.ask("document.activeElement.id || document.activeElement.dataset.key || ''"));
    }
    for id in ["help-button", "along", "across", "plan", "now", "window", "play", "new"] {
        assert!(reached.contains(&id.into()), "{id} in {reached:?}");
    }
    page.key("0");
    page.focus("along");
    page.key("n");
    for _ in 0..2 {
        page.key(" ");
        (0..6).for_each(|_| page.key("ArrowRight"));
        (0..3).for_each(|_| page.key("ArrowDown"));
    }
    page.key(" ");
    page.key("Enter");
    page.key("+");
    page.key("<");
    page.key_with("ArrowLeft", SHIFT);
    let drawn = points(&tracks(&page)[0]);
    assert!(drawn.len() == 3 && drawn[0][0] < drawn[1][0] && drawn[0][1] > drawn[1][1], "{drawn:?}");
    // from above: a point a time, places as clicked
    page.key("Escape");
    page.key("0");
    page.ask("viewshed.session.goTo(2)");
    page.key("n");
    page.click_plot("plan", 60.0, -4.0);
    (0..10).for_each(|_| page.key("."));
    page.click_plot("plan", 75.0, -5.0);
    page.key("Enter");
    page.until_saved();
    let from_above = points(&tracks(&page)[1]);
    assert_eq!(from_above[0][0], 2.0);
    assert!((from_above[1][0] - 2.0 - 10.0 / 15.0).abs() < 0.05, "{from_above:?}");
    for (point, [x, y]) in from_above.iter().zip([[60.0, -4.0], [75.0, -5.0]]) {
        assert!((point[1] - x).abs() < 1.0 && (point[2] - y).abs() < 1.0, "{from_above:?}");
    }
    // the box that follows is shown, ahead of the face that is seen of a vehicle that drives away
    page.until("viewshed.session.boxes.size === 2");
    let first = page.ask("viewshed.session.boxes.get('2').steps[0]");
    assert!((first[1].as_f64().unwrap() - from_above[0][1] - 2.3).abs() < 0.3, "{first}");
}

#[test]
fn a_vehicle_that_is_pointed_at_is_followed_by_one_key() {
    let Some(browser) = Browser::start("following") else { return };
    let server = Server::start(&recording("following"));
    let page = browser.open(&server.url);
    page.until_saved();
    page.until("viewshed.session.proposals.shown");
    // the machine's first proposal is right; it stands beside the file, so that it can be compared
    let offered = page.ask("viewshed.session.proposals.current.track");
    let span = [0, points(&offered).len() - 1].map(|k| points(&offered)[k][0]);
    let at = |time: f64| {
        let all = points(&offered);
        let k = (1..all.len() - 1).find(|k| all[*k][0] >= time).unwrap_or(all.len() - 1);
        let share = (time - all[k - 1][0]) / (all[k][0] - all[k - 1][0]);
        [1, 2].map(|i| all[k - 1][i] + share * (all[k][i] - all[k - 1][i]))
    };
    let agrees = |track: &Value, what: &str| {
        let of = points(track);
        let [first, last] = [of[0][0], of[of.len() - 1][0]];
        assert!(last - first > 0.8 * (span[1] - span[0]), "{what}: {first} to {last} s of {span:?}");
        for [time, x, y] in of.iter().filter(|p| p[0] > span[0] && p[0] < span[1]) {
            let place = at(*time);
            assert!((x - place[0]).hypot(y - place[1]) < 3.0, "{what}: {x} {y} at {time} s, not {place:?}");
        }
    };
    // from above, at the time of the slider
    let middle = 0.5 * (span[0] + span[1]);
    page.ask(&format!("viewshed.session.goTo({middle})"));
    page.focus("plan");
    page.hover(page.screen("plan", at(middle)[0], at(middle)[1]));
    page.key("g");
    page.until("viewshed.session.tracks.length === 1");
    agrees(&tracks(&page)[0], "from above");
    assert_eq!((&tracks(&page)[0]["id"], &tracks(&page)[0]["class"]), (&"1".into(), &"car".into()));
    page.until_saved();
    assert!(fs::read_to_string(&server.labels).unwrap().contains(",1,car,"));
    // its second half cut off comes back, pointed at over time; one step back takes it away again
    page.hover(page.screen("along", middle, at(middle)[0]));
    page.focus("along");
    page.key("s");
    page.until("viewshed.session.tracks.length === 2 && viewshed.session.selected === '2'");
    page.key_with("Delete", SHIFT);
    page.until("viewshed.session.tracks.length === 1");
    page.key("PageDown");
    let half = tracks(&page);
    let late = 0.25 * span[0] + 0.75 * span[1];
    page.hover(page.screen("along", late, at(late)[0]));
    page.key("g");
    page.until(&format!("viewshed.session.tracks[0].points.at(-1)[0] > {late}"));
    assert_eq!(tracks(&page).len(), 1);
    agrees(&tracks(&page)[0], "over time");
    page.key_with("z", CTRL);
    assert_eq!(tracks(&page), half);
    // the button waits for a click, for a new track where none is selected
    page.key("Escape");
    page.ask("(document.querySelector('button[data-key=follow]').click(), 1)");
    assert_eq!((page.ask("viewshed.session.pointing"), tracks(&page)), (true.into(), half.clone()));
    page.key("Escape");
    assert_eq!(page.ask("viewshed.session.pointing"), false);
    page.ask("(document.querySelector('button[data-key=follow]').click(), 1)");
    page.click_plot("along", late, at(late)[0]);
    page.until("viewshed.session.tracks.length === 2");
    assert_eq!(page.ask("viewshed.session.pointing"), false);
    page.key_with("z", CTRL);
    assert_eq!(tracks(&page), half);
    // while the mouse rests the way is shown, and nothing is changed; a key takes what is shown, without another request
    page.key("PageDown");
    page.until("viewshed.session.selected === '1'");
    page.hover(page.screen("along", late, at(late)[0]));
    page.until("viewshed.session.shownWay !== null");
    assert_eq!(tracks(&page), half);
    let shown = page.ask("viewshed.session.shownWay.track");
    let requests = || page.requests().iter().filter(|r| r.ends_with("/follow")).count();
    let asked = requests();
    page.key("g");
    page.until("viewshed.session.way === null");
    assert_eq!((&tracks(&page)[0], requests()), (&shown, asked));
    assert!(asked > 3, "{asked} requests");
    agrees(&shown, "looked at");
    page.key_with("z", CTRL);
    assert_eq!(tracks(&page), half);
    // moved away from it, it is gone, and it is not shown where it is not wanted
    page.hover(page.screen("along", late, at(late)[0]));
    page.until("viewshed.session.shownWay !== null");
    page.hover(page.screen("along", middle, at(middle)[0]));
    assert_eq!(page.ask("viewshed.session.way"), Value::Null);
    // where it came to rest while the server was busy, the way is shown once the answer before is there
    page.ask(
        "(window.sent = window.fetch, window.held = [], \
         window.fetch = (...a) => new Promise((go) => held.push(go)).then(() => sent(...a)), 1)",
    );
    page.hover(page.screen("along", middle, at(middle)[0]));
    page.until("held.length === 1");
    page.hover(page.screen("along", late, at(late)[0]));
    page.until("viewshed.session.lookNext !== null");
    page.ask("(window.fetch = sent, held.forEach((go) => go()), 1)");
    page.until("viewshed.session.shownWay !== null");
    assert_eq!(page.ask("viewshed.session.shownWay.place"), page.ask("viewshed.plots.along.cursor"));
    page.key("h");
    assert_eq!(page.ask("viewshed.session.looks"), false);
    page.hover(page.screen("along", late, at(late)[0]));
    std::thread::sleep(std::time::Duration::from_millis(700));
    assert_eq!(page.ask("viewshed.session.way"), Value::Null);
    page.key("h");
    // where nothing is, nothing is followed, and the page says what to do
    page.key("Escape");
    page.key("0");
    let [x, y] = [page.number("viewshed.plots.plan.view.right"), page.number("viewshed.plots.plan.view.top")];
    page.focus("plan");
    page.hover(page.screen("plan", x - 2.0, y - 2.0));
    page.key("g");
    page.until("viewshed.session.message.includes('nothing to follow')");
    assert_eq!(tracks(&page), half);
}

#[test]
fn a_second_tab_only_reads_until_the_first_is_closed() {
    let Some(browser) = Browser::start("two tabs") else { return };
    let server = Server::start(&recording("tabs"));
    let first = browser.open(&server.url);
    first.until_saved();
    draw(&first, &LINE);
    first.until_saved();
    let second = browser.open(&server.url);
    second.until("document.getElementById('state').dataset.kind === 'read-only'");
    assert_eq!(tracks(&second).len(), 1);
    draw(&second, &LINE);
    assert_eq!(tracks(&second).len(), 1);
    assert!(second.ask("viewshed.session.message").as_str().unwrap().contains("may only read"));
    draw(&first, &[[6.0, 50.0], [8.0, 90.0]]);
    first.until_saved();
    first.close();
    second.until_saved();
    assert_eq!(tracks(&second).len(), 2, "what the first had drawn since");
    draw(&second, &[[7.0, 20.0], [9.0, 90.0]]);
    second.until_saved();
    assert!(fs::read_to_string(&server.labels).unwrap().matches(",3,car,").count() > 2);
}

#[test]
fn a_size_is_shown_and_is_kept_until_the_class_is_another() {
    let Some(browser) = Browser::start("sizes") else { return };
    let recording = recording("sizes");
    let sized = "time_s,object_id,class,x_m,y_m,heading_rad,length_m,width_m,height_m\n\
                 0.5,a,truck,90,4,3.14159,9.2,2.5,3.6\n2.5,a,truck,50,4,3.14159,9.2,2.5,3.6\n";
    fs::write(recording.with_extension("labels.csv"), sized).unwrap();
    let server = Server::start(&recording);
    let page = browser.open(&server.url);
    page.until_saved();
    page.key("PageDown");
    page.until("document.getElementById('selected-text').textContent.includes('9.2 × 2.5 × 3.6 m')");
    let saved = || fs::read_to_string(&server.labels).unwrap();
    page.key("3");
    page.until_saved();
    assert!(saved().contains(",9.200,2.500,3.600"), "{}", saved());
    page.key("4");
    page.until_saved();
    assert!(saved().contains(",bus,") && !saved().contains("9.200"), "{}", saved());
    assert_eq!(page.ask("document.getElementById('selected-text').textContent.includes('×')"), false);
}

#[test]
fn what_cannot_be_saved_is_said_and_stays_in_the_page() {
    let Some(browser) = Browser::start("not saved") else { return };
    let recording = recording("unsaved");
    let mut server = Server::start(&recording);
    let page = browser.open(&server.url);
    page.until_saved();
    draw(&page, &LINE);
    page.until_saved();
    // another program writes
    let foreign = "time_s,object_id,class,x_m,y_m\n1,z,car,50,0\n2,z,car,70,0\n";
    fs::write(&server.labels, foreign).unwrap();
    page.key("5");
    page.until("document.getElementById('state').dataset.kind === 'conflict'");
    assert!(page.ask("viewshed.session.message").as_str().unwrap().contains("changed by another"));
    assert_eq!(fs::read_to_string(&server.labels).unwrap(), foreign);
    assert_eq!(tracks(&page)[0]["class"], "motorcycle");
    page.ask("(viewshed.saver.waiting = null, 1)");
    page.goes_to(&server.url);
    page.until_saved();
    assert_eq!(tracks(&page)[0]["id"], "z");
    // nothing can be written, then it can again
    let folder = recording.parent().unwrap();
    let away = folder.with_extension("away");
    let _ = fs::remove_dir_all(&away);
    fs::rename(folder, &away).unwrap();
    page.key("PageDown");
    page.key("3");
    page.until("document.getElementById('state').dataset.kind !== 'saved'");
    page.until("document.getElementById('state').dataset.kind === 'failed' || viewshed.saver.conflict");
    fs::rename(&away, folder).unwrap();
    page.ask("(viewshed.saver.conflict = false, viewshed.saver.send(), 1)");
    page.until_saved();
    assert!(fs::read_to_string(&server.labels).unwrap().contains(",z,truck,"));
    // the server is gone
    server.kill();
    let kept = fs::read_to_string(&server.labels).unwrap();
    page.until("document.getElementById('state').dataset.kind === 'failed'");
    assert!(page.ask("viewshed.session.message").as_str().unwrap().contains("does not answer"));
    assert_eq!(fs::read_to_string(&server.labels).unwrap(), kept);
    assert_eq!(tracks(&page).len(), 1);
    page.ask("(viewshed.saver.waiting = null, 1)");
}

#[test]
fn proposals_are_shown_before_one_key_decides() {
    let Some(browser) = Browser::start("proposals") else { return };
    let server = Server::start(&recording("proposals"));
    let page = browser.open(&server.url);
    page.until_saved();
    page.until("viewshed.session.proposals.shown");
    let offered = page.number("viewshed.session.proposals.waiting.length");
    assert!(offered > 4.0, "{offered}");
    page.key("o");
    page.until("!viewshed.session.proposals.together && viewshed.session.proposals.shown");
    // before it was drawn, no key takes it
    page.ask("(viewshed.session.proposals.shown = false, viewshed.session.accept(), 1)");
    assert_eq!(tracks(&page).len(), 0);
    page.until("viewshed.session.proposals.shown");
    let first = page.ask("viewshed.session.proposals.current.track");
    is_in_view(&page);
    page.key("a");
    page.until("viewshed.session.tracks.length === 1 && viewshed.session.proposals.shown");
    let taken = &tracks(&page)[0];
    assert_eq!((&taken["points"], &taken["class"], &taken["id"]), (&first["points"], &first["class"], &"1".into()));
    page.key("x");
    page.until("viewshed.session.proposals.decided === 2 && viewshed.session.proposals.shown");
    page.key("m");
    page.until("viewshed.session.tracks.length === 2 && viewshed.session.selected === '2'");
    page.key("]");
    page.key_with("ArrowUp", ALT);
    page.until_saved();
    assert_eq!(page.number("viewshed.session.proposals.waiting.length"), offered - 3.0);
    // after a reload what is labelled is not offered again
    page.goes_to(&server.url);
    page.until("viewshed.session.proposals.ready");
    assert!(page.number("viewshed.session.proposals.waiting.length") < offered);
    assert_eq!(tracks(&page).len(), 2);
}

#[test]
fn proposals_of_one_way_are_decided_about_together() {
    let Some(browser) = Browser::start("ways") else { return };
    let server = Server::start(&recording("ways"));
    let page = browser.open(&server.url);
    page.until_saved();
    page.until("viewshed.session.proposals.shown");
    let waiting = || page.number("viewshed.session.proposals.waiting.length");
    let ids = || page.ask("viewshed.session.proposals.offered.map(({ track }) => track.id)");
    let (all, group) = (waiting(), ids());
    let count = group.as_array().unwrap().len();
    assert!(count > 3 && all > count as f64, "{count} of {all}");
    is_in_view(&page);
    assert!(
        page.ask("document.getElementById('proposal-text').textContent").as_str().unwrap().contains("together, of")
    );
    // where nothing is pointed at, nothing is rejected
    page.ask("(viewshed.session.pointed = null, 1)");
    page.key("x");
    assert!(page.ask("viewshed.session.message").as_str().unwrap().contains("Point at one"));
    assert_eq!(waiting(), all);
    // the second line, pointed at; the view stays, and what is left is offered still
    point_at(&page, 1);
    let view = page.ask("viewshed.plots.along.view");
    page.key("3");
    assert_eq!(page.ask("viewshed.session.proposals.offered[1].track.class"), "truck");
    page.key("x");
    page.until(&format!("viewshed.session.proposals.waiting.length === {}", all - 1.0));
    assert_eq!(page.ask("viewshed.plots.along.view"), view);
    let mut left = group.as_array().unwrap().clone();
    let rejected = left.remove(1);
    assert_eq!((ids(), page.ask("viewshed.session.proposals.shown")), (Value::Array(left.clone()), true.into()));
    // one step back brings it back, another decision follows
    page.key_with("z", CTRL);
    page.until("viewshed.session.proposals.shown");
    assert!(ids().as_array().unwrap().contains(&rejected));
    point_at(&page, 1);
    page.key("x");
    // all others are taken over by one key, and one step takes them back, too
    page.key("a");
    page.until(&format!("viewshed.session.tracks.length === {}", count - 1));
    page.until_saved();
    assert_eq!(waiting(), all - count as f64);
    let saved = tracks(&page);
    page.key_with("z", CTRL);
    page.until("viewshed.session.tracks.length === 0 && viewshed.session.proposals.shown");
    assert_eq!(ids(), Value::Array(left));
    page.key_with("y", CTRL);
    page.until(&format!("viewshed.session.tracks.length === {}", count - 1));
    assert_eq!((tracks(&page), waiting()), (saved, all - count as f64));
    // one is taken out to be mended, the others of its way go
    page.until("viewshed.session.proposals.shown");
    let next = ids().as_array().unwrap().len();
    point_at(&page, 0);
    page.key("m");
    page.until(&format!("viewshed.session.tracks.length === {count} && viewshed.session.selected !== null"));
    if next > 1 {
        page.key("d");
    }
    page.until(&format!("viewshed.session.proposals.waiting.length === {}", all - (count + next) as f64));
    assert_eq!(tracks(&page).len(), count);
    page.until_saved();
}
