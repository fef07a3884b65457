//! What the system asks of a run by signals.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::flag;

/// Signals that came and were not heeded yet.
#[derive(Debug, Clone, Default)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    reload: Arc<AtomicBool>,
    tell: Arc<AtomicBool>,
}

impl Signals {
    /// From now on SIGTERM and SIGINT ask for a clean end (the second time they end the program at once), SIGHUP for the
    /// table to be read again, SIGUSR1 for the counters.
    ///
    /// # Errors
    /// What the system says.
    pub fn listen() -> io::Result<Self> {
        let signals = Self::default();
        for end in [SIGTERM, SIGINT] {
            // First, so that the flag is still down when the first signal comes.
            flag::register_conditional_shutdown(end, 128 + end, Arc::clone(&signals.stop))?;
            flag::register(end, Arc::clone(&signals.stop))?;
        }
        flag::register(SIGHUP, Arc::clone(&signals.reload))?;
        flag::register(SIGUSR1, Arc::clone(&signals.tell))?;
        Ok(signals)
    }

    /// Whether the run shall end.
    pub fn stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Asks for the end, as SIGTERM does.
    pub fn ask_to_stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether the table shall be read again; asked once for each signal.
    pub fn reload(&self) -> bool {
        self.reload.swap(false, Ordering::Relaxed)
    }

    /// Whether the counters shall be told; asked once for each signal.
    pub fn tell(&self) -> bool {
        self.tell.swap(false, Ordering::Relaxed)
    }
}
