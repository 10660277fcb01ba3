//! Aceinna OpenIMU and its forerunners (AHRS380, DMU38x) on a serial line. Source: the vendor's packet descriptions
//! in python-openimu (`openimu.json`, `dmu.json`) and the DMU380 manual 7430-0026, section 7.4.
//!
//! | bytes | content |
//! |---|---|
//! | 0, 1 | 0x55 0x55 |
//! | 2, 3 | packet type, two characters; upper and lower case are different types |
//! | 4 | length n of the payload |
//! | 5..5+n | payload |
//! | 5+n, 6+n | CRC-16, polynomial 0x1021, start 0x1D0F, over bytes 2..5+n, most significant byte first |
//!
//! `z1`, 40 bytes, little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | time, u32, see `clock` |
//! | 4..16 | accelerometer x y z, f32, m/s² |
//! | 16..28 | gyroscope x y z, f32, deg/s |
//! | 28..40 | magnetometer, not used |
//!
//! `S1`, 24 bytes, big-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 0..6 | accelerometer x y z, i16, 20 g / 65536 |
//! | 6..12 | gyroscope x y z, i16, 1260 deg/s / 65536 |
//! | 12..20 | temperatures, not used |
//! | 20..22 | counter or timer, u16, see `clock` |
//! | 22..24 | status, not used |
//!
//! Packets of other types with a good checksum are counted as unknown.

mod clock;

use nalgebra::Vector3;

use super::crc;
use super::frames::{FrameScanner, Look};
use super::native_serial::{at_end_of_range, scaled};
use super::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, detect};
use crate::device::Traffic;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};
use clock::{CountClock, Unit};

const SYNC: u8 = 0x55;
/// Bytes before the payload.
const HEAD: usize = 5;
/// Bytes of the longest packet.
const LONGEST: usize = HEAD + 255 + 2;
const Z1: [u8; 2] = *b"z1";
const Z1_BYTES: u8 = 40;
const S1: [u8; 2] = *b"S1";
const S1_BYTES: u8 = 24;
/// Full scale of an `S1` packet: half of the 2^16 counts.
const S1_GYRO_RANGE: f64 = 630.0 * RAD_PER_DEG;
const S1_ACCEL_RANGE: f64 = 10.0 * STANDARD_GRAVITY;
const S1_COUNTS: f64 = 32768.0;

/// Decodes the packets `z1` and `S1`. The first sample of a stream is given out with the second, which tells what the
/// device counts.
#[derive(Clone, Debug)]
pub struct OpenImuDecoder {
    scanner: FrameScanner<LONGEST>,
    content: Content,
}

#[derive(Clone, Debug)]
struct Content {
    z1_clock: CountClock,
    s1_clock: CountClock,
    info: Option<DeviceInfo>,
    unknown: u64,
}

impl Default for OpenImuDecoder {
    fn default() -> Self {
        let content = Content {
            z1_clock: CountClock::of_32_bits(Unit::Millisecond, Unit::Microsecond, 1000),
            s1_clock: CountClock::of_16_bits(Unit::Packet, Unit::Second65536th, 100),
            info: None,
            unknown: 0,
        };
        Self { scanner: FrameScanner::default(), content }
    }
}

impl OpenImuDecoder {
    /// A decoder that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }
}

fn look(bytes: &[u8]) -> Look {
    match bytes {
        [SYNC] | [SYNC, SYNC] => Look::Incomplete,
        [SYNC, SYNC, kind @ ..] if !kind.iter().take(2).all(u8::is_ascii_alphanumeric) => Look::NoFrame,
        // The length of these is known: a wrong one must not hold up what follows.
        [SYNC, SYNC, b'z', b'1', length, ..] if *length != Z1_BYTES => Look::Damaged,
        [SYNC, SYNC, b'S', b'1', length, ..] if *length != S1_BYTES => Look::Damaged,
        [SYNC, SYNC, _, _, length, ..] => {
            let end = HEAD + usize::from(*length);
            match bytes.get(2..end + 2) {
                None => Look::Incomplete,
                // Over its own value as well, the check gives zero.
                Some(checked) if crc::spi_fujitsu(checked) == 0 => Look::Frame(end + 2),
                Some(_) => Look::Damaged,
            }
        }
        [SYNC, SYNC, ..] => Look::Incomplete,
        _ => Look::NoFrame,
    }
}

impl Content {
    fn take(&mut self, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        let &[_, _, first, second, _, ref payload @ .., _, _] = frame else { return };
        let taken = match [first, second] {
            Z1 => self.take_z1(payload, on_reading),
            S1 => self.take_s1(payload, on_reading),
            _ => None,
        };
        self.unknown += u64::from(taken.is_none());
    }

    /// `None` for what is too short.
    fn take_z1(&mut self, payload: &[u8], on_reading: &mut dyn FnMut(ImuReading)) -> Option<()> {
        let (count, rest) = payload.split_first_chunk()?;
        let acceleration = floats(rest)?;
        let rate = floats(rest.get(12..)?)?;
        let reading = ImuReading {
            device_time: None,
            omega_imu: rate * RAD_PER_DEG,
            specific_force_imu: Some(acceleration),
            clipped: false,
        };
        self.z1_clock.take(u32::from_le_bytes(*count), reading, on_reading);
        Some(())
    }

    fn take_s1(&mut self, payload: &[u8], on_reading: &mut dyn FnMut(ImuReading)) -> Option<()> {
        let accelerometer = counts(payload)?;
        let gyroscope = counts(payload.get(6..)?)?;
        let count = u16::from_be_bytes(*payload.get(20..)?.first_chunk()?);
        self.info.get_or_insert_with(|| DeviceInfo {
            gyro_range: Some(S1_GYRO_RANGE),
            accel_range: Some(S1_ACCEL_RANGE),
            ..DeviceInfo::default()
        });
        let reading = ImuReading {
            device_time: None,
            omega_imu: scaled(gyroscope, S1_GYRO_RANGE / S1_COUNTS),
            specific_force_imu: Some(scaled(accelerometer, S1_ACCEL_RANGE / S1_COUNTS)),
            clipped: at_end_of_range(gyroscope) || at_end_of_range(accelerometer),
        };
        self.s1_clock.take(u32::from(count), reading, on_reading);
        Some(())
    }
}

/// Three little-endian floats.
fn floats(bytes: &[u8]) -> Option<Vector3<f64>> {
    let mut values = [0.0; 3];
    for (value, bytes) in values.iter_mut().zip(bytes.first_chunk::<12>()?.chunks_exact(4)) {
        *value = f64::from(f32::from_le_bytes(*bytes.first_chunk()?));
    }
    Some(values.into())
}

/// Three big-endian 16-bit numbers.
fn counts(bytes: &[u8]) -> Option<[i16; 3]> {
    let [x0, x1, y0, y1, z0, z1] = *bytes.first_chunk()?;
    Some([[x0, x1], [y0, y1], [z0, z1]].map(i16::from_be_bytes))
}

impl PacketDecoder for OpenImuDecoder {
    fn protocol(&self) -> &'static str {
        detect::OPENIMU
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content } = self;
        scanner.take(traffic, look, |frame| content.take(frame, on_reading));
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters {
            missing: self.content.z1_clock.missing() + self.content.s1_clock.missing(),
            unknown: self.content.unknown,
            ..self.scanner.counters().into()
        }
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.content.info.as_ref()
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.finish(look, |frame| content.take(frame, on_reading));
        content.z1_clock.finish(on_reading);
        content.s1_clock.finish(on_reading);
    }

    fn notes(&self) -> Vec<String> {
        let note = |text: &str| Some(text.to_owned());
        let z1 = match self.content.z1_clock.unit() {
            Some(Unit::Microsecond) => note(
                "the time of z1 packets is documented in ms; its steps here are those of a time in us, and so it is read",
            ),
            _ => None,
        };
        let s1 = match self.content.s1_clock.unit() {
            Some(Unit::Packet) => note("S1 packets are numbered, not dated: samples are dated by arrival"),
            Some(Unit::Second65536th) => note(
                "the counter of S1 packets advances in 1/65536 s here and is read as a clock; it wraps every second",
            ),
            _ => None,
        };
        [z1, s1].into_iter().flatten().collect()
    }
}
