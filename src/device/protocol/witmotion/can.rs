//! WitMotion on CAN (WT901C-CAN, HWT9073-CAN). Source: the vendor's HWT9073CAN Python example.
//!
//! Frames of 8 bytes with one standard identifier, which can be set in the device; the serial packet without
//! temperature and sum:
//!
//! | bytes | content |
//! |---|---|
//! | 0 | 0x55 |
//! | 1 | type: 0x51 accelerometer, 0x52 gyroscope; others known, not used |
//! | 2..8 | x y z, i16 little-endian, 16 g / 32768 or 2000 deg/s / 32768 |
//!
//! The layout of the time frame (0x50) is not documented where the rest is; samples are dated by arrival. Nothing but
//! the first two bytes tells these frames from other traffic.

use super::kind::{self, SYNC};
use super::pairing::Pairing;
use crate::device::Traffic;
use crate::device::protocol::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, detect};

/// Decodes WitMotion's CAN protocol, of one device.
#[derive(Clone, Debug, Default)]
pub struct WitMotionCanDecoder {
    /// The identifier that is followed.
    id: Option<u32>,
    /// An identifier that has sent an accelerometer frame, and that frame: a gyroscope frame after it makes it the one.
    seen: Option<(u32, [u8; 8])>,
    pairing: Pairing,
    packets: u64,
    /// Frames of the followed identifier that are none of this protocol.
    strange: u64,
    /// Bytes of traffic that is no CAN bus's.
    foreign_bytes: u64,
}

impl WitMotionCanDecoder {
    /// A decoder for the standard identifier `id`, or for the first that sends an accelerometer frame and then a
    /// gyroscope frame. An identifier above 0x7FF finds nothing.
    pub fn new(id: Option<u16>) -> Self {
        Self { id: id.map(u32::from), ..Self::default() }
    }

    /// Whether to follow `id`, given that it sent `data`. When it is found, its first frame is taken in.
    fn follows(&mut self, id: u32, data: &[u8], on_reading: &mut dyn FnMut(ImuReading)) -> bool {
        if let Some(followed) = self.id {
            return followed == id;
        }
        match (<[u8; 8]>::try_from(data), self.seen) {
            (Ok(frame @ [SYNC, kind::ACCELEROMETER, ..]), _) => self.seen = Some((id, frame)),
            (Ok([SYNC, kind::GYROSCOPE, ..]), Some((seen, first))) if seen == id => {
                self.id = Some(id);
                self.take(&first, on_reading);
                return true;
            }
            _ if self.seen.is_some_and(|(seen, _)| seen == id) => self.seen = None,
            _ => {}
        }
        false
    }

    fn take(&mut self, data: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        match data {
            [SYNC, kind @ kind::FIRST..=kind::LAST, body @ ..] if body.len() == 6 => {
                self.packets += 1;
                self.pairing.take(*kind, body, on_reading);
            }
            _ => self.strange += 1,
        }
    }
}

impl PacketDecoder for WitMotionCanDecoder {
    fn protocol(&self) -> &'static str {
        detect::WITMOTION_CAN
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        match traffic {
            Traffic::CanFrame { id, extended: false, data } => {
                if self.follows(id, data, on_reading) {
                    self.take(data, on_reading);
                }
            }
            Traffic::CanFrame { extended: true, .. } => {}
            Traffic::Bytes(bytes) => self.foreign_bytes += bytes.len() as u64,
        }
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters {
            packets: self.packets,
            bytes_skipped: self.foreign_bytes,
            unknown: self.pairing.unknown + self.strange,
            lone_halves: self.pairing.lone_halves,
            ..DecodeCounters::default()
        }
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.pairing.device()
    }

    fn rejoin(&mut self) {
        self.seen = None;
        self.pairing.rejoin();
    }

    fn finish(&mut self, _on_reading: &mut dyn FnMut(ImuReading)) {
        self.pairing.abandon();
    }

    fn notes(&self) -> Vec<String> {
        self.pairing.notes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push(decoder: &mut WitMotionCanDecoder, id: u32, data: &[u8]) -> usize {
        let mut readings = 0;
        decoder.push(Traffic::CanFrame { id, extended: false, data }, &mut |_| readings += 1);
        readings
    }

    const ACCELEROMETER: [u8; 8] = [0x55, 0x51, 0, 0, 0, 0, 0, 8];
    const GYROSCOPE: [u8; 8] = [0x55, 0x52, 0, 0, 0, 0, 1, 0];
    const ANGLE: [u8; 8] = [0x55, 0x53, 3, 0, 0x90, 0x5F, 1, 0];

    #[test]
    fn the_first_identifier_with_both_halves_is_followed_and_no_other() {
        let mut decoder = WitMotionCanDecoder::new(None);
        assert_eq!(push(&mut decoder, 0x40, &GYROSCOPE), 0);
        assert_eq!(push(&mut decoder, 0x41, &ACCELEROMETER), 0);
        assert_eq!(push(&mut decoder, 0x41, &[0; 8]), 0, "not a frame of this protocol: forgotten");
        assert_eq!(push(&mut decoder, 0x41, &GYROSCOPE), 0);
        assert_eq!(push(&mut decoder, 0x50, &ACCELEROMETER), 0);
        assert_eq!(push(&mut decoder, 0x99, &[1, 2, 3]), 0, "others in between do not matter");
        assert_eq!(push(&mut decoder, 0x50, &GYROSCOPE), 1);
        assert_eq!(push(&mut decoder, 0x50, &ANGLE), 0);
        for id in [0x41, 0x50] {
            assert_eq!(push(&mut decoder, id, &ACCELEROMETER), 0);
            assert_eq!(push(&mut decoder, id, &GYROSCOPE), usize::from(id == 0x50));
        }
        assert_eq!(push(&mut decoder, 0x50, &ACCELEROMETER[..7]), 0);
        let expected = DecodeCounters { packets: 5, unknown: 1, ..DecodeCounters::default() };
        assert_eq!(decoder.counters(), expected);
    }

    #[test]
    fn a_given_identifier_is_waited_for() {
        let mut decoder = WitMotionCanDecoder::new(Some(0x60));
        for (id, readings) in [(0x50, 0), (0x60, 1)] {
            assert_eq!(push(&mut decoder, id, &ACCELEROMETER), 0);
            assert_eq!(push(&mut decoder, id, &GYROSCOPE), readings);
        }
        let extended = Traffic::CanFrame { id: 0x60, extended: true, data: &ACCELEROMETER };
        decoder.push(extended, &mut |_| panic!("a half"));
        assert_eq!(decoder.counters().packets, 2);
    }
}
