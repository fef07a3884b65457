//! The loop of a run: one thread looks, and never waits for longer than a fifth of a second.

use std::fmt;
use std::time::{Duration, Instant};

use super::look::Look;
use super::notify::Notify;
use super::session::Session;
use super::signals::Signals;
use super::table::Reloader;
use crate::frame::capture::Capture;
use crate::frame::queue::Item;
use crate::output::Form;
use crate::output::record::{CameraState, End, EndReason, Record};
use crate::output::target::Sink;

/// How long the loop waits for a frame before it looks around.
const GLANCE: Duration = Duration::from_millis(200);

/// A form and its target.
pub struct Output {
    /// The form.
    pub form: Box<dyn Form>,
    /// The target.
    pub sink: Sink,
}

impl fmt::Debug for Output {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Output").finish_non_exhaustive()
    }
}

/// All that a run needs.
pub struct Run<L> {
    /// Where frames come from.
    pub capture: Capture,
    /// What is made of them.
    pub session: Session<L>,
    /// Where that goes.
    pub outputs: Vec<Output>,
    /// What the system asks.
    pub signals: Signals,
    /// The table's file, if it may be exchanged.
    pub reloader: Option<Reloader>,
    /// Whether times and memory are told at the end.
    pub stats: bool,
    /// How often they are told before.
    pub stats_every: Option<Duration>,
}

impl<L> fmt::Debug for Run<L> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Run").finish_non_exhaustive()
    }
}

impl<L: Look> Run<L> {
    /// Runs until there are no more frames, or it is asked to stop. True if there was an answer, or it was asked to stop.
    ///
    /// # Errors
    /// What the source or the recognizer cannot go on with.
    pub fn run(mut self, source: String) -> Result<bool, String> {
        let mut notify = Notify::new();
        let start = self.session.start(source);
        self.tell(&start);
        notify.ready();
        let mut next_stats = self.stats_every.map(|every| Instant::now() + every);
        let ended = loop {
            if self.signals.stop() || self.outputs.iter().any(|output| output.sink.is_closed()) {
                break Ok(EndReason::Stopped);
            }
            self.exchange_table();
            let due = next_stats.is_some_and(|at| Instant::now() >= at);
            if due {
                next_stats = self.stats_every.map(|every| Instant::now() + every);
            }
            if self.signals.tell() || due {
                self.tell_counters(true);
            }
            match self.capture.next(GLANCE) {
                None => {}
                Some(Item::Tidings(tidings)) => {
                    let records = self.session.tidings(tidings);
                    if let Some(Record::Camera(camera)) = records.first() {
                        notify.status(&camera.message);
                    }
                    self.tell_all(&records);
                }
                Some(Item::Frame(frame, arrived)) => match self.session.frame(frame, arrived) {
                    Ok(records) => {
                        self.tell_all(&records);
                        notify.looked(|| self.session.status());
                    }
                    Err(error) => break Err(error),
                },
                Some(Item::End(Ok(()))) => break Ok(EndReason::NoMoreFrames),
                Some(Item::End(Err(error))) => break Err(error),
            }
        };
        notify.stopping();
        self.finish(ended)
    }

    fn exchange_table(&mut self) {
        let asked = self.signals.reload();
        let Some(ready) = self.reloader.as_mut().and_then(|reloader| reloader.poll(asked)) else { return };
        let records = self.session.table(ready);
        self.tell_all(&records);
    }

    fn finish(mut self, ended: Result<EndReason, String>) -> Result<bool, String> {
        let last = self.session.end();
        self.tell_all(&last);
        self.tell_counters(self.stats);
        let (reason, error) = match &ended {
            Ok(reason) => (*reason, None),
            Err(error) => (EndReason::Failed, Some(error.clone())),
        };
        self.tell(&Record::End(End { reason, error }));
        drop(self.capture);
        for Output { sink, .. } in self.outputs {
            let name = sink.name().to_owned();
            let lost = sink.lost();
            let (closed, finished) = (sink.is_closed(), sink.finish());
            if lost > 0 && !closed {
                tracing::warn!(target = %name, lost, "records were lost, because the output was too slow or broken");
            }
            if !finished {
                tracing::warn!(target = %name, "the output did not take what was left in time");
            }
        }
        ended.map(|reason| reason == EndReason::Stopped || self.session.answers() > 0)
    }

    fn tell_counters(&mut self, in_full: bool) {
        let lost = self.outputs.iter().map(|output| output.sink.lost()).sum();
        let counters = self.session.counters(self.capture.counts(), lost, in_full);
        self.tell(&counters);
    }

    fn tell_all(&mut self, records: &[Record]) {
        // One chunk for each target, whatever a frame gave rise to.
        for Output { form, sink } in &mut self.outputs {
            let mut bytes = Vec::new();
            for record in records {
                form.write(record, &mut bytes);
            }
            if !bytes.is_empty() {
                sink.write(bytes);
            }
        }
        records.iter().for_each(log);
    }

    fn tell(&mut self, record: &Record) {
        self.tell_all(std::slice::from_ref(record));
    }
}

/// What the log says of a record: what goes wrong, and what changes for good.
fn log(record: &Record) {
    match record {
        Record::Start(start) => {
            let table = &start.table;
            tracing::info!(source = %start.source, table = %table.file, landmarks = table.landmarks, "started");
        }
        Record::Camera(camera) => {
            let (fault, count) = (camera.fault.unwrap_or("none"), camera.count);
            let message = &camera.message;
            match (camera.state, camera.again_in_s) {
                (CameraState::Opened, _) => tracing::info!(%message, "the source is open"),
                (CameraState::Lost, again_in_s) => {
                    tracing::warn!(fault, count, again_in_s = again_in_s.unwrap_or_default(), %message, "the source is lost; it will be opened again");
                }
                (CameraState::LeftOut, _) => tracing::warn!(fault, count, %message, "a frame is left out"),
                (CameraState::ClockJumped, _) => tracing::warn!(%message, "the clock jumped"),
            }
        }
        Record::Table(change) => match &change.error {
            None => {
                tracing::info!(table_id = %change.table.table_id, landmarks = change.table.landmarks, "the new table is in use");
            }
            Some(error) => {
                tracing::error!(%error, table_id = %change.table.table_id, "the new table cannot be used; the old one stays in use");
            }
        },
        Record::End(end) => tracing::info!(reason = ?end.reason, "ended"),
        _ => {}
    }
}
