//! Device time to host time.
//!
//! A packet can be late but never early, so the delays `arrival - device time` have a sharp lower edge, and the
//! offset and drift of the device clock are a line along that edge. Batching by a USB chip (up to 16 ms) and stalls
//! of the host (tens of ms) only move points upwards, away from it. The constant part of the delay cannot be seen from
//! one side: it is measured where the device answers clock requests, taken as the time its bytes need on the line where
//! that is known, and stays in the result otherwise.

use super::envelope::Envelope;
use crate::device::protocol::{DeviceTime, SyncEstimate};
use crate::time::HostTime;

/// Longest hold-up of a packet that is believed, ns. A delay that drops further, or a counter that moves further
/// than the arrivals allow, is a step of the device clock.
const LONGEST_STALL_NS: i64 = 1_000_000_000;
/// Device time may go back this far without being a step, ns (jitter of a device's own stamps).
const BACKWARD_JITTER_NS: i64 = 10_000_000;
/// Smallest step from one host time to the next, ns: no two samples share a time.
const LEAST_STEP_NS: i64 = 1_000;

/// Largest constant delay that is believed, ns: a slow line, a USB bridge at its slowest, and more.
const LARGEST_CONSTANT_NS: i64 = 50_000_000;
/// A clock exchange with a longer round trip says less about the constant delay than the line's speed does, µs: it may
/// be wrong by half of it, the part one way took longer than the other.
const LONGEST_ROUND_TRIP_US: u64 = 5_000;

/// Where the times of the samples come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockMode {
    /// No sample yet.
    #[default]
    Waiting,
    /// The device's own clock.
    Device,
    /// The sample index times the nominal period.
    Nominal,
    /// The moment of arrival, for want of both: jitter and batches remain in it.
    Arrival,
}

/// The sample before, on all clocks.
#[derive(Clone, Copy, Debug)]
struct Previous {
    device: Option<DeviceTime>,
    /// Samples since the (re)start.
    index: u64,
    /// Unwrapped source time since the (re)start, ns.
    source_ns: i64,
    arrival_ns: i64,
    host_ns: i64,
}

/// Puts the samples of one device on the host's time. Fixed size, strictly increasing output.
///
/// ```
/// use otolith::device::protocol::DeviceTime;
/// use otolith::imu::ClockSync;
/// use otolith::time::HostTime;
///
/// let mut clock = ClockSync::new(None);
/// let device = |micros| Some(DeviceTime { micros, wraps_after_us: None });
/// assert_eq!(clock.host_time(device(500), HostTime(7_000_000)), HostTime(7_000_000));
/// // The second packet was 9 ms under way; by the device's clock it was taken 10 ms after the first.
/// assert_eq!(clock.host_time(device(10_500), HostTime(26_000_000)), HostTime(17_000_000));
/// ```
#[derive(Clone, Debug)]
pub struct ClockSync {
    nominal_period_ns: Option<f64>,
    mode: ClockMode,
    previous: Option<Previous>,
    envelope: Envelope,
    resets: u64,
    /// Part of the smallest delay that every sample has, subtracted, ns.
    constant_ns: i64,
    /// The clock exchange `constant_ns` is from; `None` while it is only assumed.
    exchange: Option<SyncEstimate>,
}

impl ClockSync {
    /// A clock for a device that may not send its time; `nominal_rate_hz` is used where it does not.
    ///
    /// A rate that is not finite and positive counts as unknown.
    pub fn new(nominal_rate_hz: Option<f64>) -> Self {
        let mut clock = Self {
            nominal_period_ns: None,
            mode: ClockMode::Waiting,
            previous: None,
            envelope: Envelope::default(),
            resets: 0,
            constant_ns: 0,
            exchange: None,
        };
        clock.assume_rate(nominal_rate_hz);
        clock
    }

    /// Sets the rate assumed for samples without device time, Hz. It acts from the next restart of the line on.
    pub fn assume_rate(&mut self, nominal_rate_hz: Option<f64>) {
        self.nominal_period_ns =
            nominal_rate_hz.filter(|rate| rate.is_finite() && *rate > 0.0).map(|rate| 1e9 / rate);
    }

    /// Sets the delay every sample has at least, such as the time its bytes take on the line, ns. A measured one, see
    /// [`ClockSync::take_exchange`], stands above it.
    pub fn assume_constant_delay(&mut self, delay_ns: u64) {
        if self.exchange.is_none() {
            self.constant_ns =
                i64::try_from(delay_ns).unwrap_or(LARGEST_CONSTANT_NS).min(LARGEST_CONSTANT_NS);
        }
    }

    /// Takes what a clock exchange with the device has found, and from it the constant delay: the host time the line of
    /// one-way delays gives to the moment of the exchange, less the host time it had.
    ///
    /// Call it after a sample of the same clock. An exchange already taken, one before the first sample with device
    /// time, one with a round trip above 5 ms, and one that asks for a delay outside 0 to 50 ms (up to the half round
    /// trip it may be wrong by) change nothing. The result is right within half the exchange's round trip.
    pub fn take_exchange(&mut self, exchange: SyncEstimate) {
        let Some(Previous { device: Some(device), source_ns, .. }) = self.previous else { return };
        let slow = exchange.round_trip_us > LONGEST_ROUND_TRIP_US;
        if slow || self.mode != ClockMode::Device || self.exchange == Some(exchange) {
            return;
        }
        let asked_us = i128::from(exchange.host_time_us) + i128::from(exchange.offset_us);
        let mut since_us = asked_us - i128::from(device.micros);
        if let Some(period) = device.wraps_after_us.map(i128::from).filter(|period| *period > 0) {
            since_us = (since_us + period / 2).rem_euclid(period) - period / 2;
        }
        let (Ok(since_ns), Ok(host_ns)) =
            (i64::try_from(since_us * 1000), i64::try_from(i128::from(exchange.host_time_us) * 1000))
        else {
            return;
        };
        let at_ns = source_ns.saturating_add(since_ns);
        let constant_ns = at_ns.saturating_add(self.envelope.delay_ns(at_ns)).saturating_sub(host_ns);
        let unsure_ns = i64::try_from(exchange.round_trip_us * 500).unwrap_or(i64::MAX);
        if (-unsure_ns..=LARGEST_CONSTANT_NS).contains(&constant_ns) {
            self.constant_ns = constant_ns.max(0);
            self.exchange = Some(exchange);
        }
    }

    /// The constant delay taken off every sample, ns, and whether a clock exchange measured it.
    pub fn constant_delay(&self) -> (u64, bool) {
        (self.constant_ns.unsigned_abs(), self.exchange.is_some())
    }

    /// Host time at which a sample was taken.
    ///
    /// Later than any time given before, by at least 1 µs and, after a correction backwards, by half the device's
    /// step until the correction is worked off. A step of the device clock starts the line again.
    pub fn host_time(&mut self, device: Option<DeviceTime>, arrival: HostTime) -> HostTime {
        let arrival_ns = i64::try_from(arrival.0).unwrap_or(i64::MAX);
        let mode = match (device, self.nominal_period_ns) {
            (Some(_), _) => ClockMode::Device,
            (None, Some(_)) => ClockMode::Nominal,
            (None, None) => ClockMode::Arrival,
        };
        let Some(previous) = self.previous.filter(|_| mode == self.mode) else {
            return self.restart(mode, device, arrival_ns);
        };
        let index = previous.index + 1;
        let source_ns = match (device.zip(previous.device), self.nominal_period_ns) {
            (Some((now, before)), _) => {
                let step_ns = device_step_ns(before, now, arrival_ns - previous.arrival_ns);
                if step_ns < -BACKWARD_JITTER_NS {
                    return self.restart(mode, device, arrival_ns);
                }
                previous.source_ns.saturating_add(step_ns)
            }
            (None, Some(period)) => (index as f64 * period).round() as i64,
            (None, None) => previous.source_ns + (arrival_ns - previous.arrival_ns),
        };
        let delay_ns = arrival_ns.saturating_sub(source_ns);
        if delay_ns < self.envelope.delay_ns(source_ns).saturating_sub(LONGEST_STALL_NS) {
            return self.restart(mode, device, arrival_ns);
        }
        self.envelope.push(source_ns, delay_ns);
        if self.envelope.is_left_behind() {
            return self.restart(mode, device, arrival_ns);
        }
        let step_ns = (source_ns - previous.source_ns).max(0);
        let earliest_ns = previous.host_ns.saturating_add(LEAST_STEP_NS.max(step_ns / 2));
        let delay_ns = self.envelope.delay_ns(source_ns).saturating_sub(self.constant_ns);
        let host_ns = source_ns.saturating_add(delay_ns).max(earliest_ns);
        self.previous = Some(Previous { device, index, source_ns, arrival_ns, host_ns });
        HostTime(host_ns.unsigned_abs())
    }

    /// Begins a new line at this sample, which is taken to have had only the constant delay.
    fn restart(&mut self, mode: ClockMode, device: Option<DeviceTime>, arrival_ns: i64) -> HostTime {
        let earliest_ns = self.previous.map_or(0, |previous| previous.host_ns.saturating_add(LEAST_STEP_NS));
        self.resets += u64::from(self.previous.is_some());
        self.mode = mode;
        self.exchange = None;
        self.envelope = Envelope::default();
        self.envelope.push(0, arrival_ns);
        let host_ns = arrival_ns.saturating_sub(self.constant_ns).max(earliest_ns);
        self.previous = Some(Previous { device, index: 0, source_ns: 0, arrival_ns, host_ns });
        HostTime(host_ns.unsigned_abs())
    }

    /// Where the times come from now.
    pub fn mode(&self) -> ClockMode {
        self.mode
    }

    /// How often the device clock stepped, or the stream fell behind the line for good (lost samples without
    /// device time), so that the line was started again.
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Rate of the host clock against the device clock, minus one, in millionths; zero before 3 s of data.
    pub fn drift_ppm(&self) -> f64 {
        self.envelope.drift() * 1e6
    }
}

/// Unwrapped step of the device clock, ns; negative when it went back.
///
/// Of the steps that a wrapping counter leaves open, the shortest forward one is taken, unless the silence was
/// longer than any stall (then the one nearest to it) or the arrivals do not allow even the shortest (then back).
fn device_step_ns(before: DeviceTime, now: DeviceTime, arrival_step_ns: i64) -> i64 {
    let to_ns =
        |micros: i128| i64::try_from(micros * 1000).unwrap_or(if micros < 0 { i64::MIN } else { i64::MAX });
    let step = i128::from(now.micros) - i128::from(before.micros);
    let period = match now.wraps_after_us {
        Some(period) if period > 0 => i128::from(period),
        _ => return to_ns(step),
    };
    let ahead = step.rem_euclid(period);
    let silence = i128::from(arrival_step_ns / 1000);
    let stall = i128::from(LONGEST_STALL_NS / 1000);
    if silence > stall {
        let whole_turns = (silence - ahead + period / 2).div_euclid(period).max(0);
        if whole_turns > 0 {
            return to_ns(ahead + whole_turns * period);
        }
    }
    if ahead > period / 2 && ahead > silence + stall {
        return to_ns(ahead - period);
    }
    to_ns(ahead)
}

#[cfg(test)]
mod tests;
