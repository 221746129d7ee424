//! What is sent to the service manager: that the daemon is ready, lives, what it does, and that it stops.

use std::time::{Duration, Instant};

use log::debug;
use sd_notify::NotifyState;

/// Time between two status lines.
const STATUS_EVERY: Duration = Duration::from_secs(5);

/// The service manager, if there is one.
pub struct Systemd {
    /// Time between two signs of life; `None` where no watchdog runs.
    every: Option<Duration>,
    fed: Option<Instant>,
    sent: Option<Instant>,
}

impl Systemd {
    /// Reads what the service manager wants from the environment.
    pub fn new() -> Self {
        // well within the watchdog's time
        Self { every: sd_notify::watchdog_enabled().map(|time| time / 4), fed: None, sent: None }
    }

    fn send(states: &[NotifyState]) {
        if let Err(e) = sd_notify::notify(states) {
            debug!("the service manager does not listen: {e}");
        }
    }

    pub fn ready(&self) {
        Self::send(&[NotifyState::Ready]);
    }

    pub fn stopping(&self) {
        Self::send(&[NotifyState::Stopping]);
    }

    /// A frame was completed: the only thing that counts as life.
    pub fn frame_done(&mut self) {
        let now = Instant::now();
        let Some(every) = self.every else { return };
        if self.fed.is_none_or(|fed| now.duration_since(fed) >= every) {
            self.fed = Some(now);
            Self::send(&[NotifyState::Watchdog]);
        }
    }

    /// A line for `systemctl status`, now and then.
    pub fn status(&mut self, text: impl FnOnce() -> String) {
        let now = Instant::now();
        if self.sent.is_none_or(|sent| now.duration_since(sent) >= STATUS_EVERY) {
            self.sent = Some(now);
            Self::send(&[NotifyState::Status(&text())]);
        }
    }
}
