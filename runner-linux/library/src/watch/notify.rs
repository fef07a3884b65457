//! What systemd is told: ready, what goes on, and that frames are really looked at.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// Between two messages.
const INTERVAL: Duration = Duration::from_secs(1);

/// The service manager's ear, if there is one.
#[derive(Debug)]
pub struct Notify {
    watchdog: bool,
    next: Instant,
}

impl Notify {
    /// Whatever this process's environment says.
    pub fn new() -> Self {
        let mut microseconds = 0;
        Self { watchdog: sd_notify::watchdog_enabled(false, &mut microseconds), next: Instant::now() }
    }

    /// The run has begun.
    pub fn ready(&self) {
        send(&[NotifyState::Ready, NotifyState::Status("waiting for the first frame")]);
    }

    /// A frame was looked at: the only thing that feeds the watchdog.
    pub fn looked(&mut self, status: impl FnOnce() -> String) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + INTERVAL;
        let status = status();
        let told = [NotifyState::Status(&status), NotifyState::Watchdog];
        send(if self.watchdog { &told } else { &told[..1] });
    }

    /// Something else that is worth a line.
    pub fn status(&self, status: &str) {
        send(&[NotifyState::Status(status)]);
    }

    /// The run ends.
    pub fn stopping(&self) {
        send(&[NotifyState::Stopping]);
    }
}

impl Default for Notify {
    fn default() -> Self {
        Self::new()
    }
}

fn send(states: &[NotifyState<'_>]) {
    // Without a service manager there is nobody to tell, and one that does not listen cannot be helped.
    let _ = sd_notify::notify(false, states);
}
