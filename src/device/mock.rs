//! Simulated devices: the real bytes of our serial protocol, without hardware.

use std::time::Duration;

use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Hello, Message, SampleF32, Status, status_flag};
use otolith_firmware_protocol::stream::StreamEncoder;

use super::bandwidth::time_on_line;
use super::selector::DEFAULT_BAUD;
use super::{DeviceError, Link, LinkError, Noise, Traffic};
use crate::time::HostTime;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

mod params;

pub use params::{MockKind, MockParams};

/// Default gyro noise per sample, rad/s rms and axis. The ICM-42688-P's data sheet states 0.0028 °/s/√Hz, which is
/// 0.0011 rad/s over the 500 Hz that 1 kHz sampling lets pass; rounded up for mounting and drive.
pub const GYRO_NOISE: f64 = 0.002;
/// Default accelerometer noise per sample, m/s² rms and axis. The data sheet's 70 µg/√Hz is 0.015 m/s² over 500 Hz;
/// rounded up likewise.
pub const SPECIFIC_FORCE_NOISE: f64 = 0.02;
/// Full scale announced, deg/s.
const GYRO_RANGE_DPS: u16 = 500;
/// Full scale announced, g.
const ACCEL_RANGE_G: u16 = 4;
/// Counts from zero to full scale.
const COUNTS: f64 = 32768.0;
/// Identity announced: nobody's serial number.
const DEVICE_ID: u32 = 0xD0_0DAD;

/// The frame to send next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    Hello,
    Sample,
    Status,
}

/// A chair with an IMU on its axis that speaks our serial protocol: HELLO once a second, SAMPLE_F32, STATUS at 10 Hz.
///
/// One call of `receive` gives one frame, stamped with the time at which its last byte would arrive on a line of
/// 921600 baud. It does not wait: wrap it in [`super::pacer::Paced`] for real time. The device's clock starts at
/// zero with the run and does not drift.
#[derive(Debug)]
pub struct MockChair {
    params: MockParams,
    noise: Noise,
    encoder: StreamEncoder,
    frame: [u8; MAX_FRAME],
    /// Number of the current sample; its time is `sample / sample_rate_hz`.
    sample: u64,
    sample_count: u64,
    next: Next,
    hellos_sent: u64,
    statuses_sent: u64,
    /// When the line has carried everything sent so far.
    line_free: HostTime,
}

impl MockChair {
    /// A device at the start of its run.
    ///
    /// # Errors
    /// [`DeviceError::Range`] for a parameter out of its range.
    pub fn new(params: MockParams) -> Result<Self, DeviceError> {
        params.validate()?;
        let sample_count = (params.duration_s() * params.sample_rate_hz).round() as u64 + 1;
        Ok(Self {
            noise: Noise::new(params.seed),
            params,
            encoder: StreamEncoder::new(),
            frame: [0; MAX_FRAME],
            sample: 0,
            sample_count,
            next: Next::Hello,
            hellos_sent: 0,
            statuses_sent: 0,
            line_free: HostTime(0),
        })
    }

    /// The frame that is due now, and a step on in the schedule; `None` when nothing of that kind is due.
    fn next_message(&mut self) -> Option<Message<'static>> {
        let t_s = self.sample as f64 / self.params.sample_rate_hz;
        match self.next {
            Next::Hello => {
                self.next = Next::Sample;
                let due = t_s >= self.hellos_sent as f64;
                self.hellos_sent += u64::from(due);
                due.then(|| self.hello())
            }
            Next::Sample => {
                self.next = Next::Status;
                Some(self.sample_at(t_s))
            }
            Next::Status => {
                self.next = Next::Hello;
                self.sample += 1;
                let due = t_s >= self.statuses_sent as f64 * 0.1;
                self.statuses_sent += u64::from(due);
                due.then(|| status_at(t_s))
            }
        }
    }

    fn hello(&self) -> Message<'static> {
        Message::Hello(Hello {
            flags: 0,
            device_id: DEVICE_ID,
            firmware: 0x0100,
            rate_millihertz: (self.params.sample_rate_hz * 1000.0).round() as u32,
            gyro_scale: (f64::from(GYRO_RANGE_DPS) * RAD_PER_DEG / COUNTS) as f32,
            accel_scale: (f64::from(ACCEL_RANGE_G) * STANDARD_GRAVITY / COUNTS) as f32,
            gyro_range_dps: GYRO_RANGE_DPS,
            accel_range_g: ACCEL_RANGE_G,
            caps: 0,
            name: match self.params.kind {
                MockKind::Chair => "mock:chair".as_bytes(),
                MockKind::Rest => "mock:rest".as_bytes(),
            },
        })
    }

    /// The chair's vertical is (0, sin tilt, cos tilt) in the axes of a sensor tilted about its x axis.
    fn sample_at(&mut self, t_s: f64) -> Message<'static> {
        let (sin, cos) = libm::sincos(self.params.tilt_deg * RAD_PER_DEG);
        let up = [0.0, sin, cos];
        let omega = self.params.omega(t_s);
        let MockParams { gyro_noise, specific_force_noise, .. } = self.params;
        let mut vector = |along_up: f64, noise_rms: f64| {
            up.map(|component| {
                let noise = if self.params.noise { self.noise.normal() * noise_rms } else { 0.0 };
                (component * along_up + noise) as f32
            })
        };
        let gyro = vector(omega, gyro_noise);
        let accel = vector(STANDARD_GRAVITY, specific_force_noise);
        // The counter of the protocol has 32 bits and wraps.
        Message::SampleF32(SampleF32 { t_us: micros(t_s) as u32, gyro, accel })
    }
}

fn micros(t_s: f64) -> u64 {
    (t_s * 1e6).round() as u64
}

fn status_at(t_s: f64) -> Message<'static> {
    Message::Status(Status {
        t_us: micros(t_s),
        temperature_centi_c: 2500,
        flags: status_flag::SELF_TEST_OK,
        dropped: 0,
        tx_overrun: 0,
        sensor_err: 0,
    })
}

impl Link for MockChair {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let (taken_s, message) = loop {
            if self.sample == self.sample_count {
                return Err(LinkError::EndOfRecording);
            }
            let taken_s = self.sample as f64 / self.params.sample_rate_hz;
            if let Some(message) = self.next_message() {
                break (taken_s, message);
            }
        };
        let length = match self.encoder.encode(&message, &mut self.frame) {
            Ok(frame) => frame.len(),
            // None of the three can be too long; a frame that were would be lost like any other.
            Err(_) => return Ok(None),
        };
        let wire_time = Duration::from_nanos(time_on_line(length as u64, DEFAULT_BAUD).0);
        let sent = HostTime::from_secs_f64(taken_s + self.params.latency_s);
        self.line_free = self.line_free.max(sent) + wire_time;
        Ok(Some((self.line_free, Traffic::Bytes(&self.frame[..length]))))
    }
}

#[cfg(test)]
mod tests;
