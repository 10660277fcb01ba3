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
//! Types with samples: `z1`, `s1`, `a1`, `a2`, `e1`, `e2` of the OpenIMU, `S0`, `S1`, `A1`, `A2` of its forerunners; what
//! stands where in them is in `layout.rs`. The angular rates of `a1`, `a2`, `A1` and `A2` are without the bias that the
//! device estimates. Type 0x15 0x15 refuses a command, whose two characters are its payload. Packets of other types, or
//! of another length, with a good checksum are counted as unknown: the firmware of these sensors is made to be changed.

mod clock;
mod layout;

use nalgebra::Vector3;

use super::crc;
use super::followed::Followed;
use super::frames::{FrameScanner, Look};
use super::native_serial::{at_end_of_range, scaled};
use super::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, detect};
use crate::device::Traffic;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};
use clock::{CountClock, Unit};
use layout::{LAYOUTS, Numbers, TYPES};

const SYNC: u8 = 0x55;
/// Bytes before the payload.
const HEAD: usize = 5;
/// Bytes of the longest packet.
const LONGEST: usize = HEAD + 255 + 2;
/// Type of the answer to a command that is refused.
const REFUSAL: [u8; 2] = [0x15, 0x15];
/// Full scale of the whole-number types: half of the 2^16 counts.
const GYRO_RANGE: f64 = 630.0 * RAD_PER_DEG;
const ACCEL_RANGE: f64 = 10.0 * STANDARD_GRAVITY;
const COUNTS: f64 = 32768.0;
/// Lengths of a first specific force that tell its unit: 1 g is 1 or 9.8, and this is half way by ratio.
const BETWEEN_G_AND_M_S2: f64 = 3.13;

/// Decodes the packets with samples, of one type: the first that comes. The first sample of a stream is given out with
/// the second, which tells what the device counts.
#[derive(Clone, Debug, Default)]
pub struct OpenImuDecoder {
    scanner: FrameScanner<LONGEST>,
    content: Content,
}

#[derive(Clone, Debug)]
struct Content {
    /// The packet type in use, by its place among the layouts.
    followed: Followed<usize>,
    clocks: [CountClock; TYPES],
    /// Units of the specific force of types that may be in g, m/s², once they are known.
    force_units: [Option<f64>; TYPES],
    info: Option<DeviceInfo>,
    unknown: u64,
    refusals: u64,
    last_refused: Option<[u8; 2]>,
}

impl Default for Content {
    fn default() -> Self {
        Self {
            followed: Followed::default(),
            clocks: LAYOUTS.map(|layout| layout.clock()),
            force_units: [None; TYPES],
            info: None,
            unknown: 0,
            refusals: 0,
            last_refused: None,
        }
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
        [SYNC] | [SYNC, SYNC] | [SYNC, SYNC, 0x15] => Look::Incomplete,
        [SYNC, SYNC, kind @ ..]
            if !kind.starts_with(&REFUSAL) && !kind.iter().take(2).all(u8::is_ascii_alphanumeric) =>
        {
            Look::NoFrame
        }
        // Captures show the length of these: a wrong one must not hold up what follows. Of the others there are documents
        // only, and a good frame of another length is better told as unknown than lost.
        [SYNC, SYNC, b'z', b'1', length, ..] if *length != 40 => Look::Damaged,
        [SYNC, SYNC, b'S', b'1', length, ..] if *length != 24 => Look::Damaged,
        [SYNC, SYNC, 0x15, 0x15, length, ..] if *length != 2 => Look::Damaged,
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
        let kind = [first, second];
        if kind == REFUSAL {
            self.refusals += 1;
            self.last_refused = payload.first_chunk().copied();
            return;
        }
        let known = LAYOUTS.iter().position(|layout| layout.kind == kind && layout.bytes == payload.len());
        let sample = known.and_then(|index| Some((index, self.sample(index, payload)?)));
        match sample {
            None => self.unknown += 1,
            Some((index, (count, reading))) => {
                if self.followed.takes(0, index) {
                    self.clocks[index].take(count, reading, on_reading);
                }
            }
        }
    }

    /// The time field and the sample of a packet, still without its time.
    fn sample(&mut self, index: usize, payload: &[u8]) -> Option<(u32, ImuReading)> {
        let layout = &LAYOUTS[index];
        let (force, omega) = (payload.get(layout.force_at..)?, payload.get(layout.omega_at..)?);
        let (omega_imu, specific_force, clipped) = if layout.numbers == Numbers::Counts {
            self.info.get_or_insert_with(|| DeviceInfo {
                gyro_range: Some(GYRO_RANGE),
                accel_range: Some(ACCEL_RANGE),
                ..DeviceInfo::default()
            });
            let (force, omega) = (counts(force)?, counts(omega)?);
            let clipped = at_end_of_range(force) || at_end_of_range(omega);
            (scaled(omega, GYRO_RANGE / COUNTS), scaled(force, ACCEL_RANGE / COUNTS), clipped)
        } else {
            (floats(omega)? * RAD_PER_DEG, floats(force)?, false)
        };
        let specific_force_imu = Some(match layout.numbers {
            Numbers::FloatsMaybeG => specific_force * self.force_unit(index, specific_force.norm()),
            Numbers::Floats | Numbers::Counts => specific_force,
        });
        let reading = ImuReading { device_time: None, omega_imu, specific_force_imu, clipped };
        Some((layout.time(payload)?, reading))
    }

    /// Unit of a specific force that may be in g, m/s². The first one that is about 1 g long in either unit tells.
    fn force_unit(&mut self, index: usize, length: f64) -> f64 {
        let unit = &mut self.force_units[index];
        if unit.is_none() && (0.3..30.0).contains(&length) {
            *unit = Some(if length < BETWEEN_G_AND_M_S2 { STANDARD_GRAVITY } else { 1.0 });
        }
        unit.unwrap_or(1.0)
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
            missing: self.content.clocks.iter().map(CountClock::missing).sum(),
            unknown: self.content.unknown,
            device_errors: self.content.refusals,
            ..self.scanner.counters().into()
        }
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.content.info.as_ref()
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.content.followed.restart();
        self.content.clocks.iter_mut().for_each(CountClock::rejoin);
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, content, .. } = self;
        scanner.finish(look, |frame| content.take(frame, on_reading));
        content.clocks.iter_mut().for_each(|clock| clock.finish(on_reading));
    }

    fn notes(&self) -> Vec<String> {
        let content = &self.content;
        let mut notes = Vec::new();
        if let Some(index) = content.followed.stream() {
            notes.extend(content.notes_on(index));
        }
        if content.followed.unused() > 0 {
            notes.push(format!(
                "{} packets of other types with samples were not used",
                content.followed.unused()
            ));
        }
        if let Some(refused) = content.last_refused {
            notes.push(format!("the device refused the command {}", refused.escape_ascii()));
        }
        notes
    }
}

impl Content {
    /// What the documents leave open about the packet type in use.
    fn notes_on(&self, index: usize) -> Vec<String> {
        let name = LAYOUTS[index].name();
        let time = match self.clocks[index].unit() {
            Some(Unit::Microsecond) => Some(format!(
                "the time of {name} packets is documented in ms; its steps here are those of a time in us, and so it is read"
            )),
            Some(Unit::Packet) => {
                Some(format!("{name} packets are numbered, not dated: samples are dated by arrival"))
            }
            Some(Unit::Second65536th) => Some(format!(
                "the counter of {name} packets advances in 1/65536 s here and is read as a clock; it wraps every second"
            )),
            Some(Unit::Millisecond) | None => None,
        };
        let force = self.force_units[index].map(|unit| {
            let unit = if unit == 1.0 { "m/s^2" } else { "g" };
            format!(
                "the acceleration of {name} packets is documented in g for some firmware and in m/s^2 for other; by the \
                 length of the first one it is in {unit} here"
            )
        });
        time.into_iter().chain(force).collect()
    }
}
