//! What is understood of the traffic at one speed.

use std::time::Duration;

use nalgebra::Vector3;

use super::heard::{Heard, MeanSample, Verdict};
use super::lines::NumberLines;
use crate::device::Traffic;
use crate::device::protocol::can_map::BusCensus;
use crate::device::protocol::detect::{AutoDecoder, Bus, LONGEST_FRAME_BYTES};
use crate::device::protocol::{ImuReading, PacketDecoder};
use crate::time::HostTime;
use crate::units::DEG_PER_RAD;

/// Samples, and time from the first to the last, that are enough for a rate and a mean.
const ENOUGH_SAMPLES: u64 = 10;
const ENOUGH_TIME: Duration = Duration::from_millis(500);

/// Listens at one speed: shows everything to every decoder, and to a reader of text lines.
pub(super) struct Ear {
    decoder: AutoDecoder,
    lines: NumberLines,
    samples: SampleTally,
    pub(super) bytes: u64,
    /// Arrival of the first piece, bytes in it, arrival of the last.
    pieces: Option<(HostTime, u64, HostTime)>,
    bus: BusCensus,
    /// Bytes whose bits change at most once.
    pub(super) smooth_bytes: u64,
}

/// Samples by their arrival.
#[derive(Default)]
struct SampleTally {
    first_at: HostTime,
    last_at: HostTime,
    count: u64,
    /// Samples of the first piece: there is no telling when they were taken.
    in_first_piece: u64,
    sum_omega: Vector3<f64>,
    sum_force: Vector3<f64>,
    with_force: u64,
    without_rotation: u64,
    clipped: u64,
}

impl SampleTally {
    fn add(&mut self, at: HostTime, reading: &ImuReading) {
        if self.count == 0 {
            self.first_at = at;
        }
        self.last_at = at;
        self.count += 1;
        self.in_first_piece += u64::from(at == self.first_at);
        self.sum_omega += reading.omega_imu;
        if let Some(force) = reading.specific_force_imu {
            self.sum_force += force;
            self.with_force += 1;
        }
        self.without_rotation += u64::from(reading.omega_imu == Vector3::zeros());
        self.clipped += u64::from(reading.clipped);
    }

    fn span(&self) -> Duration {
        self.last_at.saturating_since(self.first_at)
    }

    fn rate_hz(&self) -> Option<f64> {
        let span_s = self.span().as_secs_f64();
        (span_s > 0.0).then(|| (self.count - self.in_first_piece) as f64 / span_s)
    }

    fn mean(&self) -> Option<MeanSample> {
        (self.count > 0).then(|| MeanSample {
            samples: self.count,
            without_rotation: self.without_rotation,
            clipped: self.clipped,
            gyro_deg_s: (self.sum_omega * (DEG_PER_RAD / self.count as f64)).into(),
            specific_force_m_s2: (self.with_force > 0)
                .then(|| (self.sum_force / self.with_force as f64).into()),
        })
    }
}

impl Ear {
    pub(super) fn new(bus: Bus) -> Self {
        Self {
            decoder: AutoDecoder::on(&[bus]),
            lines: NumberLines::default(),
            samples: SampleTally::default(),
            bytes: 0,
            pieces: None,
            bus: match bus {
                Bus::Can => BusCensus::trying_maps(),
                Bus::Serial => BusCensus::default(),
            },
            smooth_bytes: 0,
        }
    }

    pub(super) fn push(&mut self, at: HostTime, traffic: Traffic<'_>) {
        let Self { decoder, samples, .. } = self;
        decoder.push(traffic, &mut |reading| samples.add(at, &reading));
        match traffic {
            Traffic::Bytes(bytes) => {
                let length = bytes.len() as u64;
                self.bytes += length;
                let (first_at, first_bytes, _) = self.pieces.unwrap_or((at, length, at));
                self.pieces = Some((first_at, first_bytes, at));
                self.smooth_bytes += bytes.iter().filter(|byte| is_smooth(**byte)).count() as u64;
                self.lines.push(at, bytes);
            }
            Traffic::CanFrame { .. } => self.bus.take(at, traffic),
        }
    }

    /// Bytes per second after the first piece.
    fn bytes_per_s(&self) -> Option<f64> {
        let (first_at, first_bytes, last_at) = self.pieces?;
        let span_s = last_at.saturating_since(first_at).as_secs_f64();
        (span_s > 0.0).then(|| (self.bytes - first_bytes) as f64 / span_s)
    }

    fn protocol(&self) -> Option<&'static str> {
        Some(self.decoder.protocol()).filter(|name| *name != "unknown")
    }

    pub(super) fn good_packets(&self) -> u64 {
        self.decoder.counters().packets
    }

    /// True when it is clear what is spoken.
    pub(super) fn is_certain(&self) -> bool {
        self.protocol().is_some() || self.lines.columns().is_some()
    }

    /// True while what was heard fits what is known: at least half of it, or all of it is text.
    pub(super) fn is_promising(&self) -> bool {
        let counters = self.decoder.counters();
        self.is_certain()
            || (counters.packets > 0 && 2 * counters.bytes_skipped <= self.bytes)
            || self.lines.is_promising()
    }

    /// True when much was heard and nothing understood.
    pub(super) fn hears_nonsense(&self) -> bool {
        self.bytes >= LONGEST_FRAME_BYTES && self.good_packets() == 0 && !self.lines.is_promising()
    }

    /// True when there is nothing more to find out.
    pub(super) fn knows_enough(&self) -> bool {
        match (self.protocol(), self.lines.columns()) {
            (Some(_), _) => self.samples.count >= ENOUGH_SAMPLES && self.samples.span() >= ENOUGH_TIME,
            (None, Some(_)) => self.lines.span() >= ENOUGH_TIME,
            (None, None) => false,
        }
    }

    /// The result. Before a protocol is certain nothing but counts is believed.
    pub(super) fn heard(&self, baud: Option<u32>, listened: Duration) -> Heard {
        let verdict = match (self.protocol(), self.lines.columns()) {
            (Some(_), _) => Verdict::Protocol,
            (None, Some(_)) => Verdict::Text,
            (None, None) if self.bytes == 0 && self.bus.frames() == 0 => Verdict::Silence,
            (None, None) => Verdict::Unknown,
        };
        let mut heard = Heard {
            verdict,
            protocol: self.protocol(),
            baud: baud.filter(|_| self.is_certain()),
            listened_s: listened.as_secs_f64(),
            bytes: self.bytes,
            bytes_per_s: self.bytes_per_s(),
            frames: self.bus.frames(),
            ids: self.bus.identifiers(),
            counters: self.decoder.counters(),
            ..Heard::default()
        };
        match verdict {
            Verdict::Protocol => {
                heard.rate_hz = self.samples.rate_hz();
                heard.announced_rate_hz = self.decoder.announced_rate_hz();
                heard.wire_bytes_per_sample = self.decoder.wire_bytes_per_sample();
                heard.sample = self.samples.mean();
                heard.device = self.decoder.device().cloned();
                heard.notes = self.decoder.notes();
            }
            Verdict::Text => {
                heard.text_columns = self.lines.columns();
                heard.rate_hz = self.lines.rate_hz();
            }
            Verdict::Unknown => heard.can = self.bus.report(),
            Verdict::Silence => {}
        }
        heard
    }
}

/// True for a byte whose bits change at most once. One in sixteen does by chance; on a line that is several times
/// slower than it is listened to, most do.
fn is_smooth(byte: u8) -> bool {
    (byte ^ (byte >> 1)) & 0x7F == 0 || ((byte ^ (byte >> 1)) & 0x7F).is_power_of_two()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bytes_are_smooth() {
        let smooth: Vec<u8> = (0..=255).filter(|byte| is_smooth(*byte)).collect();
        assert_eq!(
            smooth,
            [0, 1, 3, 7, 15, 31, 63, 127, 0x80, 0xC0, 0xE0, 0xF0, 0xF8, 0xFC, 0xFE, 0xFF],
            "{smooth:02x?}"
        );
    }
}
