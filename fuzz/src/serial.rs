//! Decoders of bytes: cuts make no difference, every byte is accounted for, no frame is good without its checksum.

use otolith::device::Traffic;
use otolith::device::protocol::detect::{AutoDecoder, Bus, decoder_by_name};
use otolith::device::protocol::{DecodeCounters, ImuReading, PacketDecoder};

use crate::frames::{Checked, checked};
use crate::input::Input;

/// Everything a decoder says about a stream, comparable bit by bit.
#[derive(Debug, PartialEq)]
pub(crate) struct Outcome {
    readings: Vec<[u64; 9]>,
    pub(crate) counters: DecodeCounters,
    device: String,
    notes: Vec<String>,
}

impl Outcome {
    /// The readings: angular velocity, specific force, time, flags.
    pub(crate) fn readings(&self) -> impl Iterator<Item = &[u64; 9]> {
        self.readings.iter()
    }
}

/// A reading as bits, so that NaN is like itself.
pub(crate) fn bits(reading: &ImuReading) -> [u64; 9] {
    let force = reading.specific_force_imu;
    let [x, y, z] = force.unwrap_or_default().map(f64::to_bits).into();
    let [p, q, r] = reading.omega_imu.map(f64::to_bits).into();
    let time = reading.device_time;
    let flags = u64::from(force.is_some()) | u64::from(reading.clipped) << 1 | u64::from(time.is_some()) << 2;
    let wrap = time.and_then(|time| time.wraps_after_us).unwrap_or(u64::MAX);
    [p, q, r, x, y, z, time.map_or(0, |time| time.micros), wrap, flags]
}

/// What `decoder` makes of these pieces and their end.
pub(crate) fn decode<'a>(decoder: &mut dyn PacketDecoder, pieces: impl Iterator<Item = &'a [u8]>) -> Outcome {
    let mut readings = Vec::new();
    for piece in pieces {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(bits(&reading)));
    }
    decoder.finish(&mut |reading| readings.push(bits(&reading)));
    let device = format!(
        "{:?} {:?} {:?}",
        decoder.device(),
        decoder.announced_rate_hz(),
        decoder.wire_bytes_per_sample()
    );
    Outcome { readings, counters: decoder.counters(), device, notes: decoder.notes() }
}

/// A decoder of this protocol; `degraded` where the input's flags say so.
pub(crate) fn decoder(protocol: &str, flags: u8) -> Box<dyn PacketDecoder> {
    let mut decoder = decoder_by_name(protocol).expect("targets are made of what there is");
    if flags & 1 == 1 {
        decoder.allow_degraded();
    }
    decoder
}

/// The target of a protocol on a serial line.
pub(crate) fn run(protocol: &str, data: &[u8]) {
    let input = Input::read(data);
    let whole = decode(&mut decoder(protocol, input.flags), std::iter::once(input.stream));
    let cut = decode(&mut decoder(protocol, input.flags), input.pieces());
    assert_eq!(whole, cut, "cuts make a difference");
    if let Some(checked) = checked(protocol) {
        account(checked, &whole.counters, input.stream);
    }
    interrupted(&mut decoder(protocol, input.flags), input);
}

/// Each byte is in one place, and each good frame is one by its checksum.
pub(crate) fn account(checked: &Checked, counters: &DecodeCounters, stream: &[u8]) {
    let total = stream.len() as u64;
    let outside = counters.bytes_skipped + counters.unfinished_bytes;
    match checked.fixed_length {
        Some(length) => assert_eq!(outside + counters.packets * length, total, "{counters:?}"),
        // No frame is shorter than four bytes.
        None => assert!(outside + counters.packets * 4 <= total, "{counters:?}: {total} bytes"),
    }
    let good = checked.places(stream).count() as u64;
    assert!(counters.packets <= good, "{counters:?}: {good} good frames");
}

/// The connection is lost and found between the pieces, frames of another bus come in, requests are fetched.
fn interrupted(decoder: &mut dyn PacketDecoder, input: Input<'_>) {
    let (mut readings, mut now_us, mut total) = (0, 0, 0);
    for (number, piece) in input.pieces().take(200).enumerate() {
        decoder.push(Traffic::Bytes(piece), &mut |_| readings += 1);
        now_us += 400_000 * piece.len() as u64;
        total += piece.len() as u64;
        let mut out = [0; 64];
        if let Some(length) = decoder.poll_transmit(now_us, &mut out) {
            assert!(length <= out.len());
        }
        if number % 7 == 3 {
            decoder.rejoin();
        }
        if number % 5 == 4 {
            let data = &piece[..piece.len().min(8)];
            decoder.push(Traffic::CanFrame { id: 0x3A0, extended: false, data }, &mut |_| readings += 1);
            total += data.len() as u64;
        }
    }
    decoder.finish(&mut |_| readings += 1);
    let counters = decoder.counters();
    assert!(counters.bytes_skipped + counters.unfinished_bytes <= total, "{counters:?}: {total} bytes");
}

/// Recognition: it never takes back what it found, and counts no byte twice.
pub(crate) fn recognise(data: &[u8]) {
    let input = Input::read(data);
    let mut decoder = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    let mut found = "unknown";
    for piece in input.pieces() {
        decoder.push(Traffic::Bytes(piece), &mut |_| ());
        let now = decoder.protocol();
        assert!(found == "unknown" || now == found, "{found} became {now}");
        found = now;
    }
    decoder.finish(&mut |_| ());
    let counters = decoder.counters();
    let total = input.stream.len() as u64;
    assert!(counters.bytes_skipped + counters.unfinished_bytes <= total, "{counters:?}: {total} bytes");
}
