//! The JSON object that `run`, `replay` and `demo` print on stdout.

use serde::Serialize;

use super::Analysis;
use super::metrics::CharacterMetrics;
use super::spins::Spin;
use super::timing::TickTimes;

/// `value` to six decimals: micrometres, microradians, microseconds. What is behind them is rounding of the trace.
pub fn rounded(value: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (value * 1e6).round() / 1e6 + 0.0
}

/// What the link delivered and what it lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkCounters {
    /// Frames of the named protocol with a good checksum.
    pub packets: u64,
    /// Frames with a bad one.
    pub bad_checksum: u64,
    /// Bytes that belonged to no frame.
    pub bytes_skipped: u64,
    /// Packets the sequence numbers say were sent but never came.
    pub missing: u64,
    /// Intervals between samples of more than two and a half usual ones: two samples or more are not there.
    pub gaps: u64,
    /// Items a full queue dropped on the host.
    pub dropped: u64,
}

/// What the chair did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ChairSummary {
    /// Largest magnitude of the yaw rate after a 50 ms moving average, rpm.
    pub peak_rate_rpm: f64,
    /// Integral of the measured yaw rate over the run, deg, left positive.
    pub turned_deg: f64,
    /// The spins in order of time.
    pub spins: Vec<Spin>,
}

/// Percentiles of the time one tick took, µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TickPercentiles {
    /// Half the ticks took no longer, within 1.6 %.
    pub p50: f64,
    /// 99 of 100 ticks took no longer, within 1.6 %.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

/// How the control loop kept time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TimingSummary {
    /// Ticks that ran.
    pub ticks: u64,
    /// Simulated time over wall time; 0 when no time was measured.
    pub realtime_factor: f64,
    /// How long ticks took.
    pub tick_us: TickPercentiles,
    /// Ticks skipped because their time had passed.
    pub overruns: u64,
    /// Largest age of the newest sample at a tick, ms, in a live run: how far the device fell behind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_sample_age_ms: Option<f64>,
}

impl TimingSummary {
    /// The timing of a run of `simulated_s` that took `wall_s`.
    pub fn new(times: &TickTimes, simulated_s: f64, wall_s: f64, overruns: u64) -> Self {
        let realtime_factor = if wall_s > 0.0 { rounded(simulated_s / wall_s) } else { 0.0 };
        Self {
            ticks: times.count(),
            realtime_factor,
            tick_us: times.percentiles(),
            overruns,
            max_sample_age_ms: None,
        }
    }
}

/// What only the caller knows about a run.
#[derive(Clone, Debug, Default)]
pub struct RunFacts {
    /// Where the samples came from: the device selector, or the file.
    pub source: String,
    /// Simulated length of the run, s.
    pub duration_s: f64,
    /// IMU samples given out, from the alignment on.
    pub samples: u64,
    /// What the link delivered.
    pub link: LinkCounters,
    /// How the loop kept time.
    pub timing: TimingSummary,
}

/// Everything `--json` says about a run; the field names are the keys.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Where the samples came from: the device selector, or the file.
    pub source: String,
    /// Simulated length of the run, s.
    pub duration_s: f64,
    /// IMU samples given out, from the alignment on.
    pub samples: u64,
    /// What the link delivered.
    pub link: LinkCounters,
    /// What the chair did.
    pub chair: ChairSummary,
    /// The character that trusts its vestibular model.
    pub green: CharacterMetrics,
    /// The character that perceives perfectly; its gravity tilt is that of an observer nobody listens to.
    pub blue: CharacterMetrics,
    /// How the loop kept time.
    pub timing: TimingSummary,
    /// One sentence on how both characters fared.
    pub verdict: String,
    /// What the alignment at rest found (mounting tilt, gyro bias, scale), as its layer reports it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<serde_json::Value>,
    /// Protocol, clock and further counters of the device.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<serde_json::Value>,
    /// What happened to the link and the loop, one line each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<String>,
    /// The recording that was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
    /// The figure that was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figure: Option<String>,
}

impl Summary {
    /// The summary of a run; the optional parts are left empty for the caller to fill.
    pub fn new(facts: RunFacts, analysis: &Analysis) -> Self {
        Self {
            source: facts.source,
            duration_s: facts.duration_s,
            samples: facts.samples,
            link: facts.link,
            chair: analysis.chair.clone(),
            green: analysis.green,
            blue: analysis.blue,
            timing: facts.timing,
            verdict: analysis.verdict.clone(),
            alignment: None,
            device: None,
            events: Vec::new(),
            recording: None,
            figure: None,
        }
    }
}
