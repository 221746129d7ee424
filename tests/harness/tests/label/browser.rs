//! A real browser, driven as a person drives it: keys, mouse, and looks at what is shown.

use std::ffi::OsStr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use headless_chrome::protocol::cdp::Emulation::{MediaFeature, SetDeviceMetricsOverride, SetEmulatedMedia};
use headless_chrome::protocol::cdp::Input::{
    DispatchKeyEvent, DispatchKeyEventTypeOption, DispatchMouseEvent, DispatchMouseEventTypeOption, MouseButton,
};
use headless_chrome::protocol::cdp::Network;
use headless_chrome::protocol::cdp::Page::CaptureScreenshotFormatOption;
use headless_chrome::protocol::cdp::types::Event;
use headless_chrome::types::PrintToPdfOptions;
use headless_chrome::{LaunchOptions, Tab};
use serde_json::Value;
use viewshed_harness::results::figures::photo;

use crate::skipped::skipped;

pub const ALT: u32 = 1;
pub const CTRL: u32 = 2;
pub const SHIFT: u32 = 8;

/// How long anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(240);

pub struct Browser(headless_chrome::Browser);

impl Browser {
    /// Starts one; without any on this machine, says so once a test.
    pub fn start(test: &str) -> Option<Self> {
        let Some(program) = photo::browser() else {
            skipped("browser", &format!("the page, {test}: no Chromium (apt-get install chromium-headless-shell)"));
            return None;
        };
        let flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"];
        let options = LaunchOptions::default_builder()
            .path(Some(program))
            // Chromium has no sandbox for root
            .sandbox(false)
            .window_size(Some((1400, 1000)))
            .args(flags.iter().map(OsStr::new).collect())
            .idle_browser_timeout(PATIENCE)
            .build();
        Some(Self(headless_chrome::Browser::new(options.unwrap()).expect("the browser starts")))
    }

    /// A tab on an address, when its page has loaded.
    pub fn open(&self, url: &str) -> Page {
        let tab = self.0.new_tab().unwrap();
        tab.set_default_timeout(PATIENCE);
        let [errors, noted, requests] = [(); 3].map(|()| Arc::<Mutex<Vec<String>>>::default());
        let (found, notes, asked) = (errors.clone(), noted.clone(), requests.clone());
        let listener = move |event: &Event| match event {
            Event::RuntimeExceptionThrown(thrown) => {
                found.lock().unwrap().push(format!("{:?}", thrown.params.exception_details));
            }
            Event::LogEntryAdded(added) => notes.lock().unwrap().push(format!("{:?}", added.params.entry)),
            Event::RuntimeConsoleAPICalled(called) => notes.lock().unwrap().push(format!("{:?}", called.params)),
            Event::NetworkRequestWillBeSent(sent) => asked.lock().unwrap().push(sent.params.request.url.clone()),
            _ => {}
        };
        tab.add_event_listener(Arc::new(listener)).unwrap();
        tab.enable_runtime().unwrap();
        tab.enable_log().unwrap();
        let network = Network::Enable {
            max_total_buffer_size: None,
            max_resource_buffer_size: None,
            max_post_data_size: None,
            report_direct_socket_traffic: None,
            enable_durable_messages: None,
        };
        tab.call_method(network).unwrap();
        let page = Page { tab, errors, noted, requests };
        page.size(1400, 1000, 1.0);
        page.goes_to(url);
        page
    }
}

/// A tab; fails the test when it is dropped after an error in a script.
pub struct Page {
    tab: Arc<Tab>,
    errors: Arc<Mutex<Vec<String>>>,
    noted: Arc<Mutex<Vec<String>>>,
    requests: Arc<Mutex<Vec<String>>>,
}

impl Drop for Page {
    fn drop(&mut self) {
        let errors = self.errors.lock().unwrap();
        assert!(errors.is_empty() || std::thread::panicking(), "errors in the page: {errors:#?}");
    }
}

impl Page {
    pub fn goes_to(&self, url: &str) {
        // the page keeps a connection, so it is never idle; what was loaded before is not taken for it
        let _ = self.tab.evaluate("delete document.documentElement.dataset.ready", false);
        self.tab.navigate_to(url).unwrap();
        self.until("document.documentElement?.dataset.ready === 'true'");
    }

    /// Whatever stands in the console: what scripts write, and what the browser complains about.
    pub fn console(&self) -> Vec<String> {
        self.noted.lock().unwrap().clone()
    }

    /// Addresses of everything that was asked for.
    pub fn requests(&self) -> Vec<String> {
        self.requests.lock().unwrap().clone()
    }

    /// The page as it is printed, as PDF.
    pub fn printed(&self) -> Vec<u8> {
        let options = PrintToPdfOptions { print_background: Some(true), ..PrintToPdfOptions::default() };
        self.tab.print_to_pdf(Some(options)).unwrap()
    }

    /// Shows the page as on paper.
    pub fn paper(&self) {
        self.tab.call_method(SetEmulatedMedia { media: Some("print".into()), features: None }).unwrap();
    }

    pub fn close(self) {
        self.tab.close(true).unwrap();
    }

    /// What an expression gives.
    pub fn ask(&self, expression: &str) -> Value {
        // only strings are sure to come back whole
        let asked = format!("(async () => JSON.stringify(await ({expression})) ?? 'null')()");
        let answer = self.tab.evaluate(&asked, true).unwrap_or_else(|e| panic!("{expression}: {e}"));
        let Some(Value::String(text)) = answer.value else { panic!("{expression}: {answer:?}") };
        serde_json::from_str(&text).unwrap()
    }

    pub fn number(&self, expression: &str) -> f64 {
        self.ask(expression).as_f64().unwrap_or_else(|| panic!("{expression} is no number"))
    }

    /// Waits for something.
    pub fn until(&self, expression: &str) {
        let begin = Instant::now();
        while self.tab.evaluate(&format!("Boolean({expression})"), true).ok().and_then(|r| r.value) != Some(true.into())
        {
            if begin.elapsed() > PATIENCE {
                let shown =
                    self.ask("['state', 'message'].map((id) => document.getElementById(id)?.textContent ?? null)");
                panic!("waited in vain for {expression}; the page says {shown}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the page may write and everything is saved.
    pub fn until_saved(&self) {
        self.until("viewshed.saver.writable && !viewshed.saver.unsaved");
    }

    pub fn size(&self, width: u32, height: u32, scale: f64) {
        let size = SetDeviceMetricsOverride {
            width,
            height,
            device_scale_factor: scale,
            mobile: false,
            scale: None,
            screen_width: None,
            screen_height: None,
            position_x: None,
            position_y: None,
            dont_set_visible_size: None,
            screen_orientation: None,
            viewport: None,
            display_feature: None,
            device_posture: None,
        };
        self.tab.call_method(size).unwrap();
    }

    pub fn dark(&self) {
        let feature = MediaFeature { name: "prefers-color-scheme".into(), value: "dark".into() };
        self.tab.call_method(SetEmulatedMedia { media: None, features: Some(vec![feature]) }).unwrap();
    }

    pub fn key(&self, key: &str) {
        self.key_with(key, 0);
    }

    pub fn key_with(&self, key: &str, modifiers: u32) {
        let text = (key.chars().count() == 1 && modifiers & (ALT | CTRL) == 0).then(|| key.to_owned());
        // keys without a character need their number to have an effect of the browser's own
        let number = match key {
            "Enter" => Some(13),
            "Tab" => Some(9),
            _ => None,
        };
        for (kind, text) in [(DispatchKeyEventTypeOption::KeyDown, text), (DispatchKeyEventTypeOption::KeyUp, None)] {
            let event = DispatchKeyEvent {
                Type: kind,
                modifiers: Some(modifiers),
                timestamp: None,
                text,
                unmodified_text: None,
                key_identifier: None,
                code: None,
                key: Some(key.to_owned()),
                windows_virtual_key_code: number,
                native_virtual_key_code: number,
                auto_repeat: None,
                is_keypad: None,
                is_system_key: None,
                location: None,
                commands: None,
            };
            self.tab.call_method(event).unwrap();
        }
    }

    fn mouse(&self, kind: DispatchMouseEventTypeOption, [x, y]: [f64; 2], modifiers: u32, delta_y: Option<f64>) {
        let held = matches!(kind, DispatchMouseEventTypeOption::MousePressed);
        let wheel = matches!(kind, DispatchMouseEventTypeOption::MouseWheel);
        let event = DispatchMouseEvent {
            Type: kind,
            x,
            y,
            modifiers: Some(modifiers),
            timestamp: None,
            button: (!wheel).then_some(MouseButton::Left),
            buttons: Some(u32::from(held)),
            click_count: (!wheel).then_some(1),
            force: None,
            tangential_pressure: None,
            tilt_x: None,
            tilt_y: None,
            twist: None,
            delta_x: delta_y.map(|_| 0.0),
            delta_y,
            pointer_Type: None,
        };
        self.tab.call_method(event).unwrap();
    }

    pub fn click(&self, at: [f64; 2]) {
        self.drag(&[at], 0);
    }

    /// Presses at the first place, moves over all, releases at the last.
    pub fn drag(&self, places: &[[f64; 2]], modifiers: u32) {
        use DispatchMouseEventTypeOption::{MouseMoved, MousePressed, MouseReleased};
        let (first, last) = (places[0], places[places.len() - 1]);
        self.mouse(MouseMoved, first, modifiers, None);
        self.mouse(MousePressed, first, modifiers, None);
        for place in &places[1..] {
            self.mouse(MouseMoved, *place, modifiers, None);
        }
        self.mouse(MouseReleased, last, modifiers, None);
    }

    pub fn hover(&self, at: [f64; 2]) {
        self.mouse(DispatchMouseEventTypeOption::MouseMoved, at, 0, None);
    }

    pub fn wheel(&self, at: [f64; 2], delta: f64) {
        self.mouse(DispatchMouseEventTypeOption::MouseWheel, at, 0, Some(delta));
    }

    /// Where a place of a plot is on the screen.
    pub fn screen(&self, plot: &str, x: f64, y: f64) -> [f64; 2] {
        let found = self.ask(&format!(
            "(() => {{ const plot = viewshed.plots.{plot}; const box = plot.element.getBoundingClientRect();
               const [x, y] = plot.toPixel({x}, {y}); return [box.left + 1 + x, box.top + 1 + y]; }})()"
        ));
        [0, 1].map(|k| found[k].as_f64().unwrap())
    }

    /// Brings a plot into the window and gives it the keys.
    pub fn focus(&self, plot: &str) {
        self.ask(&format!("viewshed.plots.{plot}.element.scrollIntoView({{ block: 'nearest' }})"));
        self.ask(&format!("viewshed.plots.{plot}.element.focus()"));
    }

    pub fn click_plot(&self, plot: &str, x: f64, y: f64) {
        self.focus(plot);
        self.click(self.screen(plot, x, y));
    }

    /// Waits until every plot rests.
    pub fn rests(&self) {
        self.ask("new Promise((done) => setTimeout(() => requestAnimationFrame(done), 300))");
    }

    /// A picture of what is shown.
    pub fn picture(&self, path: &Path) {
        self.rests();
        let png = self.tab.capture_screenshot(CaptureScreenshotFormatOption::Png, None, None, true).unwrap();
        std::fs::write(path, png).unwrap();
    }
}
