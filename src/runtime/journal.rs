//! Where a run is written down: the recording on disk and the trace the report is made from.

use crate::device::Traffic;
use crate::imu::HeadSample;
use crate::record::{FileReport, RecordError, Recorder};
use crate::report::Trace;
use crate::tick::{TickInput, TickOutput};
use crate::time::HostTime;

/// An event with its time.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Event {
    /// When, s since the start of the run.
    pub at_s: f64,
    /// What.
    pub text: String,
}

/// Most events kept for the report; the recording has all of them.
const MAX_EVENTS: usize = 200;

/// Takes everything a run produces. The first disk error ends the recording, not the run.
#[derive(Debug, Default)]
pub struct Journal {
    recorder: Option<Recorder>,
    failure: Option<RecordError>,
    /// Time of the newest entry that has one.
    latest: HostTime,
    /// Trace for the report.
    pub trace: Trace,
    /// Events so far, the first of them.
    pub events: Vec<Event>,
    /// Events beyond those.
    pub more_events: u64,
}

impl Journal {
    /// A journal that also writes a recording.
    pub fn recording(recorder: Option<Recorder>) -> Self {
        Self { recorder, ..Self::default() }
    }

    fn record(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordError>) {
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = write(recorder)
        {
            self.recorder = None;
            self.events
                .push(Event { at_s: self.latest.as_secs_f64(), text: format!("recording stopped: {error}") });
            self.failure = Some(error);
        }
    }

    /// One tick.
    pub fn tick(&mut self, input: &TickInput, output: &TickOutput) {
        self.latest = input.tick.host_time();
        self.trace.push(input, output);
        self.record(|recorder| recorder.tick(input, output));
    }

    /// One sample in chair axes.
    pub fn sample(&mut self, sample: &HeadSample) {
        self.record(|recorder| recorder.chair_sample(sample));
    }

    /// One piece of raw traffic.
    pub fn traffic(&mut self, at: HostTime, traffic: Traffic<'_>) {
        self.record(|recorder| recorder.traffic(at, traffic));
    }

    /// Something to note.
    pub fn event(&mut self, at: HostTime, text: &str) {
        if self.events.len() < MAX_EVENTS {
            self.events.push(Event { at_s: at.as_secs_f64(), text: text.to_owned() });
        } else {
            self.more_events += 1;
        }
        self.record(|recorder| recorder.event(at, text));
    }

    /// Ticks that a full queue swallowed before the next one.
    pub fn ticks_dropped(&mut self, count: u32) {
        if let Some(recorder) = self.recorder.as_mut().filter(|_| count > 0) {
            recorder.ticks_dropped(count);
        }
    }

    /// Pieces of traffic that a full queue swallowed before the next one.
    pub fn traffic_dropped(&mut self, count: u32) {
        if let Some(recorder) = &mut self.recorder {
            recorder.traffic_dropped(count);
        }
    }

    /// Closes the recording with the summary inside.
    ///
    /// # Errors
    /// The disk refused, now or during the run.
    pub fn finish(self, summary_json: &str) -> Result<Option<FileReport>, RecordError> {
        match (self.failure, self.recorder) {
            (Some(failure), _) => Err(failure),
            (None, Some(recorder)) => recorder.finish(summary_json).map(Some),
            (None, None) => Ok(None),
        }
    }
}
