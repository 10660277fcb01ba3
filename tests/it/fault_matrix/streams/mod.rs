//! Streams of several devices with known content, sample by sample, so that a fault can be put anywhere.
//!
//! Streams of foreign protocols are the packets of real captures, or of test vectors, with time, sequence number or value
//! set anew and the checksum renewed.

mod can_map;
mod captures;
mod checksum;
mod mavlink;
mod native;
mod vectornav;
mod witmotion;

use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::detect::decoder_by_name;
use otolith::device::{DeviceError, Link, Traffic};
use otolith::runtime::trouble::Trouble;
use serde_json::Value;

use super::device::Port;

/// What a sample says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Rest,
    /// The gyroscope stands at the end of its range.
    Saturated,
    /// The gyroscope's x is NaN.
    NotANumber,
}

/// A sample as the device takes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// When it is taken and arrives, ms.
    pub(super) at_ms: u64,
    /// The device's clock then, µs.
    pub(super) device_us: u64,
    pub(super) content: Content,
}

/// One packet on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Packet {
    pub(super) at_ms: u64,
    /// Identifier of a CAN frame; `None` for bytes.
    pub(super) id: Option<u32>,
    pub(super) bytes: Vec<u8>,
    /// Whether it ends a sample.
    pub(super) sample: bool,
    /// Whether the protocol's counter counts it.
    pub(super) counted: bool,
}

impl Packet {
    /// Bytes that are a whole sample.
    fn whole(sample: &Sample, bytes: Vec<u8>) -> Self {
        Self { at_ms: sample.at_ms, id: None, bytes, sample: true, counted: true }
    }

    pub(super) fn traffic(&self) -> Traffic<'_> {
        match self.id {
            None => Traffic::Bytes(&self.bytes),
            Some(id) => Traffic::CanFrame { id, extended: false, data: &self.bytes },
        }
    }
}

/// How packets come to the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Carrier {
    /// Over a serial line.
    Bytes,
    /// Over a CAN bus of the kernel.
    Can,
    /// Over a CAN bus behind a serial adapter.
    Slcan,
}

/// How losses can be counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counting {
    /// Packets have a number of 8 bits.
    Sequence8,
    /// Packets have a longer number, or the device says how many it has sent.
    Sequence,
    /// By the time between two samples.
    Clock,
    Nothing,
}

/// What a sample is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parts {
    One,
    /// Several packets with one tick.
    ByTick,
    /// Several packets, one after the other.
    InOrder,
}

type Encode = fn(&[Sample], &[Vec<u8>]) -> Vec<Packet>;

/// A device whose stream can be written.
pub(super) struct Stream {
    pub(super) name: &'static str,
    /// Where its packets come from.
    pub(super) origin: &'static str,
    pub(super) period_ms: u64,
    pub(super) carrier: Carrier,
    /// The counter starts again after so many µs, if the protocol says so.
    pub(super) wraps_after_us: Option<u64>,
    pub(super) counting: Counting,
    pub(super) parts: Parts,
    /// Packets have a checksum of their own, beside that of a CAN bus.
    pub(super) has_checksum: bool,
    /// Packets are told apart by what stands between them.
    pub(super) delimited: bool,
    pub(super) has_device_time: bool,
    pub(super) tells_clipping: bool,
    /// What names a value that is no number, or why there is none.
    pub(super) not_a_number: Result<Trouble, &'static str>,
    pub(super) decoder: fn() -> Box<dyn PacketDecoder>,
    pub(super) open_line: fn(Port) -> Result<Box<dyn Link>, DeviceError>,
    /// The packets of these samples; the second argument is the foreign packets they are made of.
    encode: Encode,
    foreign: Vec<Vec<u8>>,
}

impl Stream {
    /// Whole samples as bytes with a checksum and a device time that does not wrap, every 10 ms.
    fn new(
        name: &'static str,
        origin: &'static str,
        decoder: fn() -> Box<dyn PacketDecoder>,
        encode: Encode,
    ) -> Self {
        Self {
            name,
            origin,
            period_ms: 10,
            carrier: Carrier::Bytes,
            wraps_after_us: None,
            counting: Counting::Clock,
            parts: Parts::One,
            has_checksum: true,
            delimited: false,
            has_device_time: true,
            tells_clipping: true,
            not_a_number: Ok(Trouble::NotFinite),
            decoder,
            open_line: |port| Ok(Box::new(port)),
            encode,
            foreign: Vec::new(),
        }
    }

    pub(super) fn packets(&self, samples: &[Sample]) -> Vec<Packet> {
        (self.encode)(samples, &self.foreign)
    }
}

/// Every stream there is data for.
pub(super) fn all() -> Vec<Stream> {
    let mut streams = Vec::from(native::streams());
    streams.extend(captures::streams());
    streams.extend(witmotion::streams());
    streams.extend(vectornav::streams());
    streams.extend(mavlink::streams());
    streams.extend(can_map::streams());
    streams
}

fn known(name: &str) -> Box<dyn PacketDecoder> {
    decoder_by_name(name).expect("known")
}

/// Packets of a capture; `None` where the shared recordings are not at hand.
fn captured(path: &str, cut: fn(&[u8]) -> Vec<Vec<u8>>) -> Option<Vec<Vec<u8>>> {
    let packets = cut(&crate::shared_capture(path)?);
    assert!(packets.len() > 500, "{path}: {} packets with motion", packets.len());
    Some(packets)
}

/// The entry called `name` of a list of test vectors.
fn entry(list: &Value, name: &str) -> Value {
    let mut entries = list.as_array().expect("a list").iter();
    entries.find(|entry| entry["name"] == name).unwrap_or_else(|| panic!("no vector {name}")).clone()
}

/// The packet an entry holds as hexadecimal digits.
fn packet_of(entry: &Value) -> Vec<u8> {
    crate::device_vectors::from_hex(entry["hex"].as_str().expect("digits"))
}
