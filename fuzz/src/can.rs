//! Decoders of CAN frames: any frames are legal, and the same frames say the same.

use otolith::device::Traffic;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::detect::{AutoDecoder, Bus};

use crate::serial::{bits, decoder};

/// One frame or something else that happens on a bus.
struct Event<'a> {
    traffic: Traffic<'a>,
    rejoin: bool,
}

/// Reads events off the front of an input: a byte with length (low four bits), kind of identifier, kind of traffic and
/// loss of the connection, then the identifier in two or four bytes, then the data.
fn events(mut data: &[u8]) -> impl Iterator<Item = Event<'_>> {
    std::iter::from_fn(move || {
        let (&head, rest) = data.split_first()?;
        let extended = head & 0x10 != 0;
        let (id, rest) = rest.split_at_checked(if extended { 4 } else { 2 })?;
        let (payload, rest) = rest.split_at(usize::from(head & 0x0F).min(8).min(rest.len()));
        data = rest;
        let id = id.iter().fold(0, |id, byte| id << 8 | u32::from(*byte));
        let id = id & if extended { 0x1FFF_FFFF } else { 0x7FF };
        let frame = Traffic::CanFrame { id, extended, data: payload };
        let traffic = if head & 0x20 == 0 { frame } else { Traffic::Bytes(payload) };
        Some(Event { traffic, rejoin: head & 0xC0 == 0xC0 })
    })
}

/// An input with these frames: identifier, whether it is one of 29 bits, data.
pub(crate) fn input_of<'a>(frames: impl IntoIterator<Item = (u32, bool, &'a [u8])>) -> Vec<u8> {
    let mut input = vec![0];
    for (id, extended, data) in frames {
        input.push(data.len() as u8 | if extended { 0x10 } else { 0 });
        let id = id.to_be_bytes();
        input.extend_from_slice(if extended { &id } else { &id[2..] });
        input.extend_from_slice(data);
    }
    input
}

/// What `decoder` makes of these events and their end.
pub(crate) fn decode(decoder: &mut dyn PacketDecoder, data: &[u8]) -> (Vec<[u64; 9]>, String) {
    let (mut readings, mut bytes) = (Vec::new(), 0);
    for event in events(data) {
        decoder.push(event.traffic, &mut |reading| readings.push(bits(&reading)));
        if let Traffic::Bytes(piece) = event.traffic {
            bytes += piece.len() as u64;
        }
        if event.rejoin {
            decoder.rejoin();
        }
    }
    decoder.finish(&mut |reading| readings.push(bits(&reading)));
    assert!(decoder.counters().bytes_skipped <= bytes, "only bytes are skipped, a bus has frames");
    let said = format!("{:?} {:?} {:?}", decoder.counters(), decoder.device(), decoder.notes());
    (readings, said)
}

/// The target of a protocol on CAN. The first byte holds flags.
pub(crate) fn run(protocol: &str, data: &[u8]) {
    let (&flags, data) = data.split_first().unwrap_or((&0, &[]));
    let once = decode(&mut decoder(protocol, flags), data);
    assert_eq!(once, decode(&mut decoder(protocol, flags), data), "the same frames say the same");
}

/// Recognition among all protocols of both buses.
pub(crate) fn recognise(data: &[u8]) {
    let mut decoder = AutoDecoder::on(&[Bus::Can, Bus::Serial]);
    for event in events(data.get(1..).unwrap_or_default()) {
        decoder.push(event.traffic, &mut |_| ());
        if event.rejoin {
            decoder.rejoin();
        }
    }
    decoder.finish(&mut |_| ());
}
