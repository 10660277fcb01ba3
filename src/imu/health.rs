//! Counters of the IMU path and the state of the link.

use super::LinkHealth;

/// What [`super::ImuPipeline`] has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ImuCounters {
    /// Readings taken in, good or not.
    pub readings: u64,
    /// Head samples given out.
    pub samples: u64,
    /// Readings at the end of the sensor's range (used all the same).
    pub clipped: u64,
    /// Readings with a NaN or an infinity (dropped).
    pub non_finite: u64,
    /// Readings without an accelerometer (upright rest is put in its place).
    pub missing_specific_force: u64,
    /// Times the device clock stepped or the stream lost its place.
    pub clock_resets: u64,
    /// Readings that came twice, by the device's clock (dropped).
    pub repeated: u64,
    /// Readings that came after a newer one, by the device's clock (dropped).
    pub out_of_order: u64,
    /// Intervals in which at least one sample is not there, of a stream that is regular otherwise.
    pub time_gaps: u64,
    /// Times the device changed its sample rate.
    pub rate_changes: u64,
}

/// What [`super::Resampler`] has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ResampleCounters {
    /// Intervals longer than two and a half usual ones.
    pub gaps: u64,
    /// Samples not later than the one before (dropped).
    pub out_of_order: u64,
    /// Samples pushed out of the full buffer before a tick used them.
    pub dropped: u64,
    /// Times the link became [`LinkHealth::Stale`].
    pub stale_episodes: u64,
    /// Times the link became [`LinkHealth::Lost`].
    pub lost_episodes: u64,
}

/// Ages that separate the states of a link, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgeLimits {
    /// A newest sample up to this old is [`LinkHealth::Live`].
    pub fresh_s: f64,
    /// Up to this old it is held ([`LinkHealth::Stale`]), beyond it the measurement is gone.
    pub hold_s: f64,
}

/// State machine of a link, driven by the age of its newest sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct LinkMonitor {
    state: LinkHealth,
    stale_episodes: u64,
    lost_episodes: u64,
}

impl LinkMonitor {
    /// State after seeing a newest sample `age_s` old; `None` when there is no sample at all.
    ///
    /// Without a sample a link that was never up keeps waiting, any other is lost.
    pub fn observe(&mut self, age_s: Option<f64>, limits: AgeLimits) -> LinkHealth {
        let next = match age_s {
            None if self.state == LinkHealth::Waiting => LinkHealth::Waiting,
            None => LinkHealth::Lost,
            Some(age) if age <= limits.fresh_s => LinkHealth::Live,
            Some(age) if age <= limits.hold_s => LinkHealth::Stale,
            Some(_) => LinkHealth::Lost,
        };
        if next != self.state {
            self.stale_episodes += u64::from(next == LinkHealth::Stale);
            self.lost_episodes += u64::from(next == LinkHealth::Lost);
            self.state = next;
        }
        next
    }

    /// The state last observed.
    pub fn state(&self) -> LinkHealth {
        self.state
    }

    /// How often the link became stale, and lost.
    pub fn episodes(&self) -> (u64, u64) {
        (self.stale_episodes, self.lost_episodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_waits_lives_goes_stale_is_lost_and_returns() {
        let limits = AgeLimits { fresh_s: 0.02, hold_s: 0.05 };
        let mut monitor = LinkMonitor::default();
        let ages = [None, Some(0.0), Some(0.03), Some(0.05), Some(0.051), None, Some(0.01), Some(0.04)];
        let states: Vec<_> = ages.iter().map(|&age| monitor.observe(age, limits)).collect();
        use LinkHealth::{Live, Lost, Stale, Waiting};
        assert_eq!(states, [Waiting, Live, Stale, Stale, Lost, Lost, Live, Stale]);
        assert_eq!(monitor.episodes(), (2, 1));
    }
}
