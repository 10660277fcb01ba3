//! Readings of a device to head samples: clock, calibration, alignment at the start, mount.

use nalgebra::Vector3;

use super::calibration::{Calibration, MIN_REST_SAMPLES, RestDetector};
use super::clock_sync::{ClockMode, ClockSync};
use super::health::ImuCounters;
use super::mount::{HeadSample, Mount, OmegaDerivative, points_down};
use super::order::{OrderWatch, Place};
use super::rate::{GAP_STEPS, RateWatch};
use super::resample::FRESH_S;
use super::{ImuSample, ImuSettings};
use crate::device::protocol::{ImuReading, SyncEstimate};
use crate::time::HostTime;
use crate::units::DEG_PER_RAD;

/// Factors on the specific force that are believed; beyond them the unit or the range is wrong.
pub const SCALE_LIMITS: (f64, f64) = (0.8, 1.25);
/// Fastest stream whose alignment window is kept whole, Hz. Of a faster one the window is cut short.
const FASTEST_HZ: f64 = 4000.0;

/// A stream that has turned from its first sample for this long begins in motion: nothing is gained by waiting, s.
const TURNING_FROM_THE_START_S: f64 = 0.1;

/// What the first second of a stream said about the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct AlignmentReport {
    /// The sensor rested during the window, and what follows was taken from it.
    pub at_rest: bool,
    /// There were enough samples and they did not rest: bias and levelling come from the settings alone.
    pub started_moving: bool,
    /// Samples in the window.
    pub samples: u64,
    /// Time from the first to the last of them, s.
    pub window_s: f64,
    /// Largest standard deviation of a gyro axis, rad/s.
    pub gyro_std_rad_s: f64,
    /// Largest standard deviation of an accelerometer axis, m/s².
    pub specific_force_std_m_s2: f64,
    /// Gyro bias subtracted beyond the calibration, rad/s, imu frame.
    pub gyro_bias_rad_s: [f64; 3],
    /// Mean specific force in the window, m/s², imu frame; `None` without an accelerometer.
    pub rest_specific_force_m_s2: Option<[f64; 3]>,
    /// Its norm, m/s².
    pub rest_norm_m_s2: Option<f64>,
    /// Tilt of the mount against the specific force at rest, degrees; `None` when not at rest.
    pub mount_tilt_deg: Option<f64>,
    /// That tilt was removed.
    pub levelled: bool,
    /// It was more than 90 deg: the axis of that turn was nobody's choice, and forward and left are not known.
    pub heading_arbitrary: bool,
    /// Factor applied to the specific force.
    pub scale: f64,
    /// The rest norm asked for a factor outside 0.8 to 1.25, so 1 was used.
    pub scale_refused: bool,
    /// No sample of the window had an accelerometer value: upright rest is put in its place.
    pub accelerometer_missing: bool,
}

impl AlignmentReport {
    /// What whoever mounted the sensor should be told.
    pub fn note(&self) -> Option<String> {
        self.mount_tilt_deg.filter(|_| self.heading_arbitrary).map(points_down)
    }
}

/// A sample of the alignment window.
#[derive(Clone, Copy, Debug)]
struct Held {
    sample: ImuSample,
    has_specific_force: bool,
}

/// What is done to every sample after the alignment.
#[derive(Clone, Copy, Debug)]
struct Alignment {
    mount: Mount,
    gyro_bias: Vector3<f64>,
    scale: f64,
}

/// From [`ImuReading`]s with their arrival times to [`HeadSample`]s.
///
/// The first [`ImuSettings::align_window_s`] of a stream are held back. If the sensor rests in them they give the
/// gyro bias, the levelling of the mount and the scale of the accelerometer; then they are given out like all others.
/// A stream that begins while the chair already turns uses calibration and mount as configured, and is given out after
/// a tenth of a second.
///
/// No heap operation after construction.
#[derive(Debug)]
pub struct ImuPipeline {
    settings: ImuSettings,
    calibration: Calibration,
    mount: Mount,
    model_gravity: f64,
    clock: ClockSync,
    order: OrderWatch,
    rate: RateWatch,
    newest: Option<HostTime>,
    window: Vec<Held>,
    window_capacity: usize,
    rest: RestDetector,
    alignment: Option<Alignment>,
    report: Option<AlignmentReport>,
    derivative: OmegaDerivative,
    counters: ImuCounters,
}

impl ImuPipeline {
    /// A pipeline for one stream. `model_gravity` is the gravity of the model that is fed, m/s².
    ///
    /// # Panics
    /// If `model_gravity` is not positive, or `settings` were not validated.
    pub fn new(settings: &ImuSettings, calibration: Calibration, mount: Mount, model_gravity: f64) -> Self {
        assert!(model_gravity > 0.0, "the model's gravity is a length: {model_gravity}");
        assert!(settings.validate("settings").is_ok(), "settings are validated before they are used");
        let window_capacity = (settings.align_window_s * FASTEST_HZ) as usize + 1;
        Self {
            settings: *settings,
            calibration,
            mount,
            model_gravity,
            clock: ClockSync::new(settings.nominal_rate_hz),
            order: OrderWatch::default(),
            rate: RateWatch::default(),
            newest: None,
            window: Vec::with_capacity(window_capacity),
            window_capacity,
            rest: RestDetector::default(),
            alignment: None,
            report: None,
            derivative: OmegaDerivative::default(),
            counters: ImuCounters::default(),
        }
    }

    /// Tells the rate a device announced, for samples without device time. A rate in the settings takes precedence.
    pub fn announce_rate(&mut self, rate_hz: f64) {
        if self.settings.nominal_rate_hz.is_none() {
            self.clock.assume_rate(Some(rate_hz));
        }
    }

    /// Tells the delay every sample has at least, such as the time its bytes take on the line, ns.
    pub fn assume_constant_delay(&mut self, delay_ns: u64) {
        self.clock.assume_constant_delay(delay_ns);
    }

    /// Tells what a clock exchange with the device has found. Call it after the readings that came with the answer.
    pub fn take_exchange(&mut self, exchange: SyncEstimate) {
        self.clock.take_exchange(exchange);
    }

    /// The constant delay taken off every sample, ns, and whether a clock exchange measured it.
    pub fn constant_delay(&self) -> (u64, bool) {
        self.clock.constant_delay()
    }

    /// Takes in a reading and calls `on_sample` for every head sample that is ready: none during the alignment, all
    /// of its window at its end, then one for each reading.
    pub fn push(&mut self, reading: &ImuReading, arrival: HostTime, on_sample: &mut dyn FnMut(HeadSample)) {
        self.counters.readings += 1;
        let omega_imu = self.calibration.omega(reading.omega_imu);
        let force_imu = reading.specific_force_imu.map(|force| self.calibration.specific_force(force));
        let is_finite = |vector: &Vector3<f64>| vector.iter().all(|value| value.is_finite());
        if !is_finite(&omega_imu) || !force_imu.as_ref().is_none_or(is_finite) {
            self.counters.non_finite += 1;
            return;
        }
        match self.order.judge(reading) {
            Place::InOrder => {}
            Place::Repeated => {
                self.counters.repeated += 1;
                return;
            }
            Place::Late => {
                self.counters.out_of_order += 1;
                return;
            }
        }
        self.counters.clipped += u64::from(reading.clipped);
        self.counters.missing_specific_force += u64::from(force_imu.is_none());
        let at = self.date(reading, arrival);
        let held = Held {
            sample: ImuSample { at, omega_imu, specific_force_imu: force_imu.unwrap_or_default() },
            has_specific_force: force_imu.is_some(),
        };
        match self.alignment {
            Some(alignment) => self.give_out(&alignment, &held, on_sample),
            None => self.hold_back(held, on_sample),
        }
    }

    /// Ends the alignment with what there is and gives it out. For the end of a stream; harmless at any time.
    pub fn finish(&mut self, on_sample: &mut dyn FnMut(HeadSample)) {
        if self.alignment.is_none() && !self.window.is_empty() {
            self.align(on_sample);
        }
    }

    /// What the alignment found; `None` until its window is over.
    pub fn report(&self) -> Option<&AlignmentReport> {
        self.report.as_ref()
    }

    /// Longest time between two readings in a row that is no silence, s: 1.75 mean intervals of the samples held back, and
    /// at least 40 ms. `None` before the second sample and after the alignment.
    pub fn longest_pause_s(&self) -> Option<f64> {
        let intervals = self.window.len().checked_sub(1).filter(|intervals| *intervals > 0)?;
        Some(FRESH_S.max(GAP_STEPS * self.window_s() / intervals as f64))
    }

    /// Everything counted so far.
    pub fn counters(&self) -> ImuCounters {
        ImuCounters {
            clock_resets: self.clock.resets(),
            time_gaps: self.rate.gaps(),
            rate_changes: self.rate.changes(),
            ..self.counters
        }
    }

    /// Where the times of the samples come from.
    pub fn clock_mode(&self) -> ClockMode {
        self.clock.mode()
    }

    /// Drift of the host clock against the device clock, millionths.
    pub fn clock_drift_ppm(&self) -> f64 {
        self.clock.drift_ppm()
    }

    /// The mount in use: levelled once the alignment is over.
    pub fn mount(&self) -> Mount {
        self.alignment.map_or(self.mount, |alignment| alignment.mount)
    }

    /// Host time of a reading.
    fn date(&mut self, reading: &ImuReading, arrival: HostTime) -> HostTime {
        let resets = self.clock.resets();
        let at = self.clock.host_time(reading.device_time, arrival);
        match self.newest.replace(at) {
            Some(before) if self.clock.resets() == resets => {
                self.rate.step(at.saturating_since(before).as_secs_f64());
            }
            _ => self.rate.restart(),
        }
        at
    }

    fn hold_back(&mut self, held: Held, on_sample: &mut dyn FnMut(HeadSample)) {
        self.window.push(held);
        self.rest.push(&held.sample, held.has_specific_force);
        let full =
            self.window_s() >= self.settings.align_window_s || self.window.len() == self.window_capacity;
        if full || self.turns_from_the_start() {
            self.align(on_sample);
        }
    }

    fn turns_from_the_start(&self) -> bool {
        let limit = self.settings.rest.gyro_mean_max_rad_s;
        self.window_s() >= TURNING_FROM_THE_START_S
            && self.window.iter().all(|held| held.sample.omega_imu.norm() > limit)
    }

    /// Time from the first to the last sample held back, s.
    fn window_s(&self) -> f64 {
        match (self.window.first(), self.window.last()) {
            (Some(first), Some(last)) => last.sample.at.saturating_since(first.sample.at).as_secs_f64(),
            _ => 0.0,
        }
    }

    fn align(&mut self, on_sample: &mut dyn FnMut(HeadSample)) {
        let (alignment, report) = self.find_alignment();
        self.alignment = Some(alignment);
        self.report = Some(report);
        // The window moves out and back so that its samples can be given out while the pipeline changes.
        let mut window = std::mem::take(&mut self.window);
        for held in &window {
            self.give_out(&alignment, held, on_sample);
        }
        window.clear();
        self.window = window;
    }

    fn find_alignment(&self) -> (Alignment, AlignmentReport) {
        let at_rest = self.rest.is_at_rest(&self.settings.rest);
        let force = self.rest.mean_specific_force();
        let mut alignment = Alignment { mount: self.mount, gyro_bias: Vector3::zeros(), scale: 1.0 };
        let mut report = AlignmentReport {
            at_rest,
            started_moving: !at_rest && self.rest.samples() >= MIN_REST_SAMPLES,
            samples: self.rest.samples(),
            window_s: self.window_s(),
            gyro_std_rad_s: self.rest.gyro_std(),
            specific_force_std_m_s2: self.rest.specific_force_std(),
            rest_specific_force_m_s2: force.map(Into::into),
            rest_norm_m_s2: force.map(|force| force.norm()),
            accelerometer_missing: force.is_none(),
            scale: 1.0,
            ..AlignmentReport::default()
        };
        if !at_rest {
            return (alignment, report);
        }
        if self.settings.find_gyro_bias {
            alignment.gyro_bias = self.rest.mean_omega();
            report.gyro_bias_rad_s = alignment.gyro_bias.into();
        }
        if let Some(force) = force {
            let (levelled, tilt) = self.mount.levelled(&force);
            report.mount_tilt_deg = Some(tilt * DEG_PER_RAD);
            if self.settings.level {
                alignment.mount = levelled;
                report.levelled = true;
                report.heading_arbitrary = tilt > core::f64::consts::FRAC_PI_2;
            }
            if self.settings.scale_rest_norm {
                let factor = self.model_gravity / force.norm();
                report.scale_refused = !(SCALE_LIMITS.0..=SCALE_LIMITS.1).contains(&factor);
                alignment.scale = if report.scale_refused { 1.0 } else { factor };
                report.scale = alignment.scale;
            }
        }
        (alignment, report)
    }

    fn give_out(&mut self, alignment: &Alignment, held: &Held, on_sample: &mut dyn FnMut(HeadSample)) {
        let mut mount = alignment.mount;
        let mut sample = held.sample;
        sample.omega_imu -= alignment.gyro_bias;
        if held.has_specific_force {
            sample.specific_force_imu *= alignment.scale;
        } else {
            // Upright rest is what the head would feel, so nothing is to be moved from sensor to head.
            mount.lever_arm_head = Vector3::zeros();
            sample.specific_force_imu =
                mount.rot_head_imu.inverse() * Vector3::new(0.0, 0.0, self.model_gravity);
        }
        self.counters.samples += 1;
        on_sample(mount.to_head(&sample, &mut self.derivative));
    }
}

#[cfg(test)]
mod tests;
