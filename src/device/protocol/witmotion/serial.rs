//! WitMotion on a serial line. Source: BWT901CL datasheet; the vendor's `REG.h`; storborg/witmotion `protocol.py`.
//!
//! Frames of 11 bytes, numbers little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 0 | 0x55 |
//! | 1 | type, 0x50 to 0x5F |
//! | 2..10 | see below |
//! | 10 | low byte of the sum of bytes 0..10 |
//!
//! | type | bytes 2..10 |
//! |---|---|
//! | 0x50 | time `YY MM DD hh mm ss`, u16 ms; only if the device is set to send it |
//! | 0x51 | accelerometer x y z, i16, 16 g / 32768; i16 temperature, 0.01 °C |
//! | 0x52 | gyroscope x y z, i16, 2000 deg/s / 32768; i16 temperature or voltage |
//! | 0x53 to 0x5A | angles, magnetic field, ports, pressure, position, quaternion: known, not used |
//! | 0x5F | answer to a request for a register: known, not used |
//!
//! A sample is a 0x51 and the 0x52 behind it. There is no counter: losses show in lone halves, and in the device's
//! clock (of 1 ms) where it is sent.

use super::kind::{self, SYNC};
use super::pairing::Pairing;
use crate::device::Traffic;
use crate::device::protocol::frames::{FrameScanner, Look};
use crate::device::protocol::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, detect};

const FRAME_BYTES: usize = 11;

/// Decodes WitMotion's serial protocol. It announces no rate; samples without a time packet are dated by arrival.
#[derive(Clone, Debug, Default)]
pub struct WitMotionDecoder {
    scanner: FrameScanner<FRAME_BYTES>,
    pairing: Pairing,
}

impl WitMotionDecoder {
    /// A decoder that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }
}

fn look(bytes: &[u8]) -> Look {
    match bytes {
        [SYNC] => Look::Incomplete,
        [SYNC, kind::FIRST..=kind::LAST, ..] => match bytes.get(..FRAME_BYTES) {
            None => Look::Incomplete,
            Some([content @ .., sum]) if byte_sum(content) == *sum => Look::Frame(FRAME_BYTES),
            Some(_) => Look::Damaged,
        },
        _ => Look::NoFrame,
    }
}

fn byte_sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

impl PacketDecoder for WitMotionDecoder {
    fn protocol(&self) -> &'static str {
        detect::WITMOTION
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, pairing } = self;
        scanner.take(traffic, look, |frame| take(pairing, frame, on_reading));
    }

    fn counters(&self) -> DecodeCounters {
        DecodeCounters {
            missing: self.pairing.missing(),
            unknown: self.pairing.unknown,
            lone_halves: self.pairing.lone_halves,
            ..self.scanner.counters().into()
        }
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.pairing.device()
    }

    fn rejoin(&mut self) {
        self.scanner.rejoin();
        self.pairing.rejoin();
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let Self { scanner, pairing, .. } = self;
        scanner.finish(look, |frame| take(pairing, frame, on_reading));
        pairing.abandon();
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.pairing.notes();
        if self.pairing.device().is_some() && !self.pairing.is_dated() {
            notes.push(
                "the device sends no time packets; so it comes from the factory, with 10 samples/s at 9600 baud: \
                 --configure changes all three"
                    .to_owned(),
            );
        }
        notes
    }
}

fn take(pairing: &mut Pairing, frame: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
    if let [_, kind, body @ .., _] = frame {
        pairing.take(*kind, body, on_reading);
    }
}
