//! Decoders: raw traffic to IMU readings in SI units, sensor frame. Pure, one file per protocol.

use nalgebra::Vector3;

use super::Traffic;

pub mod bno08x_rvc;
mod calendar;
pub mod can_map;
mod crc;
mod dead_band;
pub mod detect;
mod drops;
mod followed;
mod frames;
mod halves;
pub mod mavlink;
pub mod mip;
pub mod native_can;
pub mod native_serial;
pub mod openimu;
mod period;
mod quantity;
mod sequence;
mod sync;
pub mod text;
#[cfg(test)]
mod trials;
pub mod vectornav;
pub mod witmotion;
pub mod xbus;

use drops::DropCount;
pub use sync::SyncEstimate;

/// A device's own clock at the moment of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceTime {
    /// Counter value, µs.
    pub micros: u64,
    /// The counter returns to zero after this many µs; `None` when it never does.
    pub wraps_after_us: Option<u64>,
}

impl DeviceTime {
    /// Time since `before` by this clock, µs: the nearest the counter allows, negative when it has gone back.
    pub fn micros_since(self, before: DeviceTime) -> i64 {
        let step_us = self.micros.wrapping_sub(before.micros) as i64;
        match self.wraps_after_us.and_then(|wrap_us| i64::try_from(wrap_us).ok()) {
            Some(wrap_us) if wrap_us > 0 => {
                let ahead_us = step_us.rem_euclid(wrap_us);
                if ahead_us > wrap_us / 2 { ahead_us - wrap_us } else { ahead_us }
            }
            _ => step_us,
        }
    }
}

/// One sample of an IMU as its protocol states it, converted to SI. A device that sends NaN or an infinity is taken at
/// its word: the IMU path counts and drops such readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuReading {
    /// The device's clock at the sample, where the protocol carries one.
    pub device_time: Option<DeviceTime>,
    /// Angular velocity, rad/s, sensor frame.
    pub omega_imu: Vector3<f64>,
    /// Specific force a - g, m/s², sensor frame (+9.81 on the up axis at rest); `None` without an accelerometer.
    pub specific_force_imu: Option<Vector3<f64>>,
    /// True when an axis stood at the end of its range.
    pub clipped: bool,
}

/// What a decoder has counted since it was made. Nothing is lost silently.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct DecodeCounters {
    /// Checksum-good frames of the protocol, of any type (data rows for a text log).
    pub packets: u64,
    /// Frames dropped for a wrong checksum or broken framing (unreadable rows for a text log).
    pub bad_checksum: u64,
    /// Bytes that belong to no frame.
    pub bytes_skipped: u64,
    /// Frames known to be lost, by sequence number, tick or the device's own count.
    pub missing: u64,
    /// Checksum-good frames of a type this decoder does not know.
    pub unknown: u64,
    /// Samples the device says it dropped before sending.
    pub device_dropped: u64,
    /// Samples that came before the device had told their scale, and are therefore not used.
    pub withheld: u64,
    /// Halves of a sample (gyroscope or accelerometer) that came without the other half.
    pub lone_halves: u64,
    /// Packets that came more than once, or later than a newer one, and are therefore not used.
    pub repeated: u64,
    /// Errors the device itself reported.
    pub device_errors: u64,
    /// Bytes of a frame that had begun when the traffic ended.
    pub unfinished_bytes: u64,
}

/// What a device says about itself. Fields its protocol does not carry, or has not carried yet, are `None`.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct DeviceInfo {
    /// Name, for people.
    pub name: Option<String>,
    /// Serial number.
    pub device_id: Option<u32>,
    /// Firmware version, major in the high byte.
    pub firmware: Option<u16>,
    /// Full scale of the gyro, rad/s: faster rotation is clipped.
    pub gyro_range: Option<f64>,
    /// Full scale of the accelerometer, m/s².
    pub accel_range: Option<f64>,
}

/// Turns raw traffic into IMU readings. Sans-I/O: no clock, no port, and any bytes are legal input.
pub trait PacketDecoder: Send {
    /// Short name of the protocol, as `--protocol` takes it.
    fn protocol(&self) -> &'static str;
    /// Takes the next piece of traffic and calls `on_reading` for each complete sample in it.
    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading));
    /// Everything counted so far.
    fn counters(&self) -> DecodeCounters;
    /// Nominal sample rate in Hz if the device announced one.
    fn announced_rate_hz(&self) -> Option<f64> {
        None
    }
    /// What the device said about itself, once it has.
    fn device(&self) -> Option<&DeviceInfo> {
        None
    }
    /// Offset of the device's clock from the host's, once the device has answered a clock request.
    fn sync_estimate(&self) -> Option<SyncEstimate> {
        None
    }
    /// Least number of bytes the serial line carries per sample, as far as is known; `None` before the device has
    /// identified itself, or where the line's speed does not matter. For [`super::bandwidth::check_serial`].
    fn wire_bytes_per_sample(&self) -> Option<f64> {
        None
    }
    /// Bytes to write to the device now (a clock or identity request), or `None`.
    ///
    /// Called after `push`, with the arrival time of what was pushed, µs: an answer in it is rated with that time.
    fn poll_transmit(&mut self, _host_time_us: u64, _out: &mut [u8; 64]) -> Option<usize> {
        None
    }
    /// The connection was lost and is back: forgets the unfinished frame, keeps counters and identity.
    fn rejoin(&mut self) {}
    /// The traffic has ended: gives out what only its end completes, and counts what stays unfinished.
    fn finish(&mut self, _on_reading: &mut dyn FnMut(ImuReading)) {}
    /// What the protocol or this device does not say, in words: what is missing, assumed or not believed.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
    /// Gives out readings that are worse than this program promises, where a protocol has no better ones.
    fn allow_degraded(&mut self) {}
}

impl PacketDecoder for Box<dyn PacketDecoder> {
    fn protocol(&self) -> &'static str {
        (**self).protocol()
    }
    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        (**self).push(traffic, on_reading);
    }
    fn counters(&self) -> DecodeCounters {
        (**self).counters()
    }
    fn announced_rate_hz(&self) -> Option<f64> {
        (**self).announced_rate_hz()
    }
    fn device(&self) -> Option<&DeviceInfo> {
        (**self).device()
    }
    fn sync_estimate(&self) -> Option<SyncEstimate> {
        (**self).sync_estimate()
    }
    fn wire_bytes_per_sample(&self) -> Option<f64> {
        (**self).wire_bytes_per_sample()
    }
    fn poll_transmit(&mut self, host_time_us: u64, out: &mut [u8; 64]) -> Option<usize> {
        (**self).poll_transmit(host_time_us, out)
    }
    fn rejoin(&mut self) {
        (**self).rejoin();
    }
    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        (**self).finish(on_reading);
    }
    fn notes(&self) -> Vec<String> {
        (**self).notes()
    }
    fn allow_degraded(&mut self) {
        (**self).allow_degraded();
    }
}
