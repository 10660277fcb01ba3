//! From the stream of ticks to what a person reads: metrics, the JSON summary, a terminal table, figures, CSV.
//!
//! [`Trace`] collects the ticks, [`Analysis`] finds the spins and measures both characters once, and the outputs
//! ([`summary::Summary`], [`table::render`], the figures of [`svg`]) only show what the analysis found. [`csv::write`]
//! gives the curves themselves.

pub mod csv;
pub mod metrics;
pub mod spins;
pub mod summary;
pub mod svg;
pub mod table;
#[cfg(test)]
mod tests;
pub mod timing;
pub mod trace;
pub mod verdict;

pub use metrics::{CharacterMetrics, Window, Windows};
pub use spins::Spin;
pub use summary::{ChairSummary, LinkCounters, RunFacts, Summary, TimingSummary, rounded};
pub use svg::Caption;
pub use timing::TickTimes;
pub use trace::{Character, Trace};

use crate::units::RAD_S_PER_RPM;

/// Everything that is found in a trace, measured once and shown by all outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// What the chair did.
    pub chair: ChairSummary,
    /// The intervals the metrics are taken over.
    pub windows: Windows,
    /// The character that trusts its vestibular model.
    pub green: CharacterMetrics,
    /// The character that perceives perfectly.
    pub blue: CharacterMetrics,
    /// One sentence on how both fared.
    pub verdict: String,
}

impl Analysis {
    /// Measures `trace`. `push_end_s` is the end of a push on the thorax, if there was one, tick time in s.
    ///
    /// An empty trace has no spin and no metric.
    pub fn new(trace: &Trace, push_end_s: Option<f64>) -> Self {
        let yaw = spins::YawRate::new(trace.chair_rates());
        let peak_rate_rpm = summary::rounded(yaw.peak() / RAD_S_PER_RPM);
        let chair = ChairSummary {
            peak_rate_rpm,
            turned_deg: summary::rounded(trace.turned().to_degrees()),
            spins: yaw.spins(),
        };
        let windows = Windows::new(&chair.spins, push_end_s, trace.span_s());
        let green = CharacterMetrics::new(trace, &windows, Character::Green);
        let blue = CharacterMetrics::new(trace, &windows, Character::Blue);
        let verdict = verdict::sentence(trace, &windows, &green, &blue);
        Self { chair, windows, green, blue, verdict }
    }
}

/// The word for a character in tables and figures.
fn name_of(character: Character) -> &'static str {
    match character {
        Character::Green => "green",
        Character::Blue => "blue",
    }
}
