//! Our own protocol on a serial line.

use nalgebra::Vector3;
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{BATCH_MAX_ROWS, Hello, Message, Sample16, SampleF32};
use otolith_firmware_protocol::stream::{Event, StreamDecoder, StreamEncoder};

use super::sequence::{Sequel, SequenceWatch};
use super::sync::{ClockExchange, SyncEstimate};
use super::{DecodeCounters, DeviceInfo, DeviceTime, DropCount, ImuReading, PacketDecoder};
use crate::device::Traffic;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// The device's 32-bit microsecond counter starts again after this.
const WRAPS_AFTER_US: u64 = 1 << 32;
/// Bytes of a frame around its payload: COBS byte, type, sequence number, CRC, delimiter.
const FRAME_OVERHEAD: usize = 6;
/// Payload of a SAMPLE16: time and 6 × 16 bit.
const SAMPLE16_BYTES: usize = 16;
/// Payload of a SAMPLE_F32: time and 6 × 32 bit.
const SAMPLE_F32_BYTES: usize = 28;
/// Payload of a BATCH16 before its samples: time, interval, count.
const BATCH16_HEAD_BYTES: usize = 7;
/// One sample of a BATCH16: 6 × 16 bit.
const BATCH16_ROW_BYTES: usize = 12;

/// SI units per count of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountScale {
    /// Angular rate of one count, rad/s.
    pub gyro: f64,
    /// Specific force of one count, m/s².
    pub accel: f64,
}

/// A HELLO, in SI units.
#[derive(Clone, Debug, PartialEq)]
struct Introduction {
    info: DeviceInfo,
    rate_hz: f64,
    scale: CountScale,
    gyro_range: f64,
    accel_range: f64,
}

impl Introduction {
    /// `None` if the scales are no scales.
    fn read(hello: &Hello<'_>) -> Option<Self> {
        let scale = CountScale { gyro: f64::from(hello.gyro_scale), accel: f64::from(hello.accel_scale) };
        let usable = |scale: f64| scale.is_finite() && scale > 0.0;
        if !usable(scale.gyro) || !usable(scale.accel) {
            return None;
        }
        let gyro_range = f64::from(hello.gyro_range_dps) * RAD_PER_DEG;
        let accel_range = f64::from(hello.accel_range_g) * STANDARD_GRAVITY;
        let info = DeviceInfo {
            name: Some(hello.name_str().to_owned()),
            device_id: Some(hello.device_id),
            firmware: Some(hello.firmware),
            gyro_range: Some(gyro_range),
            accel_range: Some(accel_range),
        };
        let rate_hz = f64::from(hello.rate_millihertz) / 1000.0;
        Some(Self { info, rate_hz, scale, gyro_range, accel_range })
    }

    /// True if `hello` says the same. It comes every second: only a new one is worth an allocation.
    fn says(&self, hello: &Hello<'_>) -> bool {
        self.info.device_id == Some(hello.device_id)
            && self.info.firmware == Some(hello.firmware)
            && self.info.name.as_deref() == Some(hello.name_str())
            && self.rate_hz == f64::from(hello.rate_millihertz) / 1000.0
            && self.scale.gyro == f64::from(hello.gyro_scale)
            && self.scale.accel == f64::from(hello.accel_scale)
            && self.gyro_range == f64::from(hello.gyro_range_dps) * RAD_PER_DEG
            && self.accel_range == f64::from(hello.accel_range_g) * STANDARD_GRAVITY
    }
}

/// Decodes the serial protocol of `firmware-protocol`.
///
/// Samples are withheld until a HELLO has told their scale, and counted in [`NativeSerialDecoder::withheld`]. A
/// sample is marked as clipped when an axis stands at either end of its range. Nothing is sent to a device before
/// its HELLO; from then on SYNC once a second.
#[derive(Debug, Default)]
pub struct NativeSerialDecoder {
    stream: StreamDecoder,
    sequence: SequenceWatch,
    content: Content,
    /// Bytes of traffic that is no serial line's.
    foreign_bytes: u64,
    encoder: StreamEncoder,
}

impl NativeSerialDecoder {
    /// A decoder that waits for a HELLO.
    pub fn new() -> Self {
        Self::default()
    }

    /// A decoder that uses `scale` until a HELLO says otherwise.
    pub fn with_scale(scale: CountScale) -> Self {
        Self { content: Content { given_scale: Some(scale), ..Content::default() }, ..Self::default() }
    }

    /// Samples that could not be scaled, because they came before a HELLO.
    pub fn withheld(&self) -> u64 {
        self.content.withheld
    }
}

/// What the frames say, apart from how they are found.
#[derive(Debug, Default)]
struct Content {
    given_scale: Option<CountScale>,
    hello: Option<Introduction>,
    clocks: ClockExchange,
    dropped: DropCount,
    withheld: u64,
    /// Bytes on the wire per sample, of the last frame with samples.
    bytes_per_sample: Option<f64>,
}

impl Content {
    fn take(&mut self, message: &Message<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        match message {
            Message::Hello(hello) => self.take_hello(hello),
            Message::Sample16(sample) => {
                self.note_size(SAMPLE16_BYTES, 1);
                self.take_counts(sample, on_reading);
            }
            Message::Batch16(batch) => {
                let rows = batch.rows.len();
                self.note_size(BATCH16_HEAD_BYTES + BATCH16_ROW_BYTES * rows, rows);
                batch.samples().for_each(|sample| self.take_counts(&sample, on_reading));
            }
            Message::SampleF32(sample) => {
                self.note_size(SAMPLE_F32_BYTES, 1);
                self.take_floats(sample, on_reading);
            }
            Message::Status(status) => self.dropped.take(status.dropped, status.t_us),
            Message::Sync(sync) => self.clocks.answered(*sync),
            // Log lines and answers to commands carry no motion. A device does not send commands.
            Message::Text(_) | Message::Ack(_) | Message::Cmd(_) => {}
        }
    }

    fn take_hello(&mut self, hello: &Hello<'_>) {
        if !self.hello.as_ref().is_some_and(|known| known.says(hello))
            && let Some(introduction) = Introduction::read(hello)
        {
            self.hello = Some(introduction);
        }
    }

    fn note_size(&mut self, payload_bytes: usize, samples: usize) {
        if samples > 0 {
            self.bytes_per_sample = Some((FRAME_OVERHEAD + payload_bytes) as f64 / samples as f64);
        }
    }

    fn take_counts(&mut self, sample: &Sample16, on_reading: &mut dyn FnMut(ImuReading)) {
        let Some(scale) = self.hello.as_ref().map(|hello| hello.scale).or(self.given_scale) else {
            self.withheld += 1;
            return;
        };
        on_reading(ImuReading {
            device_time: Some(device_time(sample.t_us)),
            omega_imu: scaled(sample.gyro, scale.gyro),
            specific_force_imu: Some(scaled(sample.accel, scale.accel)),
            clipped: at_end_of_range(sample.gyro) || at_end_of_range(sample.accel),
        });
    }

    fn take_floats(&mut self, sample: &SampleF32, on_reading: &mut dyn FnMut(ImuReading)) {
        if self.hello.is_none() && self.given_scale.is_none() {
            self.withheld += 1;
            return;
        }
        let clipped = self.hello.as_ref().is_some_and(|hello| {
            // The highest count stands one below full scale; half a count more for rounding.
            let beyond = |values: [f32; 3], range: f64, count: f64| {
                range > 0.0 && values.iter().any(|value| f64::from(value.abs()) >= range - 1.5 * count)
            };
            beyond(sample.gyro, hello.gyro_range, hello.scale.gyro)
                || beyond(sample.accel, hello.accel_range, hello.scale.accel)
        });
        on_reading(ImuReading {
            device_time: Some(device_time(sample.t_us)),
            omega_imu: Vector3::from(sample.gyro).map(f64::from),
            specific_force_imu: Some(Vector3::from(sample.accel).map(f64::from)),
            clipped,
        });
    }
}

/// Time of the first sample of a frame that has any, µs.
fn sample_time_us(message: &Message<'_>) -> Option<u32> {
    match message {
        Message::Sample16(sample) => Some(sample.t_us),
        Message::Batch16(batch) => Some(batch.t_us),
        Message::SampleF32(sample) => Some(sample.t_us),
        _ => None,
    }
}

fn device_time(t_us: u32) -> DeviceTime {
    DeviceTime { micros: u64::from(t_us), wraps_after_us: Some(WRAPS_AFTER_US) }
}

/// Counts in SI units.
pub(super) fn scaled(counts: [i16; 3], scale: f64) -> Vector3<f64> {
    Vector3::from(counts).map(|count| f64::from(count) * scale)
}

/// True when an axis stands at either end of its range. The lower end is one count longer; both ends count.
pub(super) fn at_end_of_range(counts: [i16; 3]) -> bool {
    counts.iter().any(|count| count.unsigned_abs() >= i16::MAX.unsigned_abs())
}

impl PacketDecoder for NativeSerialDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::OTOLITH_SERIAL
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        match traffic {
            Traffic::Bytes(bytes) => self.stream.push(bytes, |event| {
                let (seq, kind, message) = match event {
                    Event::Message { seq, message, .. } => (seq, message.kind(), Some(message)),
                    Event::Unreadable { seq, kind, .. } => (seq, kind, None),
                    Event::Dropped { .. } => return,
                };
                let sequel = self.sequence.judge(seq, kind, message.as_ref().and_then(sample_time_us));
                if let Some(message) = message.filter(|_| sequel == Sequel::New) {
                    self.content.take(&message, on_reading);
                }
            }),
            Traffic::CanFrame { data, .. } => self.foreign_bytes += data.len() as u64,
        }
    }

    fn counters(&self) -> DecodeCounters {
        let stream = self.stream.counters();
        let (repeated, late) = self.sequence.disorder();
        DecodeCounters {
            packets: stream.frames,
            bad_checksum: stream.framing_errors + stream.crc_errors,
            bytes_skipped: stream.bytes_skipped + self.foreign_bytes,
            missing: self.sequence.missing(),
            unknown: stream.unknown + stream.malformed,
            device_dropped: self.content.dropped.total(),
            withheld: self.content.withheld,
            repeated: repeated + late,
            ..DecodeCounters::default()
        }
    }

    fn announced_rate_hz(&self) -> Option<f64> {
        self.content.hello.as_ref().map(|hello| hello.rate_hz).filter(|rate_hz| *rate_hz > 0.0)
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.content.hello.as_ref().map(|hello| &hello.info)
    }

    fn sync_estimate(&self) -> Option<SyncEstimate> {
        self.content.clocks.best()
    }

    fn wire_bytes_per_sample(&self) -> Option<f64> {
        self.content.hello.as_ref()?;
        // Before the first sample: the densest form there is, so that a line refused for it is too slow for all.
        let densest = (FRAME_OVERHEAD + BATCH16_HEAD_BYTES + BATCH16_ROW_BYTES * BATCH_MAX_ROWS) as f64
            / BATCH_MAX_ROWS as f64;
        Some(self.content.bytes_per_sample.unwrap_or(densest))
    }

    fn poll_transmit(&mut self, host_time_us: u64, out: &mut [u8; 64]) -> Option<usize> {
        self.content.hello.as_ref()?;
        let request = self.content.clocks.poll(host_time_us)?;
        let mut frame = [0; MAX_FRAME];
        let frame = self.encoder.encode(&Message::Sync(request), &mut frame).ok()?;
        out.get_mut(..frame.len())?.copy_from_slice(frame);
        Some(frame.len())
    }

    fn rejoin(&mut self) {
        self.stream.rejoin();
        self.sequence.rejoin();
    }
}

#[cfg(test)]
mod tests;
