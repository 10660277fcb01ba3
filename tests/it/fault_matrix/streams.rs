//! Streams of several devices with known content, sample by sample, so that a fault can be put anywhere.
//!
//! Streams of foreign protocols are the packets of real captures, with time, sequence number or value set anew and the
//! checksum renewed.

use otolith::device::Traffic;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::detect::decoder_by_name;
use otolith::device::protocol::text::{TextDecoder, TextMapping};
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::can::{CanMessage, HalfSample, Ids, Ranges, Time};
use otolith_firmware_protocol::message::{Hello, Message, SampleF32};
use otolith_firmware_protocol::stream::encode_frame;

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
}

impl Packet {
    pub(super) fn traffic(&self) -> Traffic<'_> {
        match self.id {
            None => Traffic::Bytes(&self.bytes),
            Some(id) => Traffic::CanFrame { id, extended: false, data: &self.bytes },
        }
    }
}

/// A device whose stream can be written.
pub(super) struct Stream {
    pub(super) name: &'static str,
    pub(super) period_ms: u64,
    /// The counter starts again after so many µs, if the protocol says so.
    pub(super) wraps_after_us: Option<u64>,
    /// Packets have a sequence number or a count of what was sent.
    pub(super) counts_packets: bool,
    pub(super) has_checksum: bool,
    pub(super) has_device_time: bool,
    pub(super) tells_clipping: bool,
    pub(super) can_say_nan: bool,
    pub(super) decoder: fn() -> Box<dyn PacketDecoder>,
    /// The packets of these samples; the second argument is the captured packets they are made of.
    encode: fn(&[Sample], &[Vec<u8>]) -> Vec<Packet>,
    captured: Vec<Vec<u8>>,
}

impl Stream {
    pub(super) fn is_can(&self) -> bool {
        self.name == "otolith-can"
    }

    pub(super) fn packets(&self, samples: &[Sample]) -> Vec<Packet> {
        (self.encode)(samples, &self.captured)
    }
}

/// Every stream there is data for.
pub(super) fn all() -> Vec<Stream> {
    let mut streams = vec![otolith_serial(), otolith_can(), text()];
    streams.extend(captured("xsens_mtdata2_100hz_gnss.bin", cut_xbus).map(xbus));
    streams.extend(captured("microstrain_mip_125hz.bin", cut_mip).map(mip));
    streams.extend(captured("openimu_z1.raw", cut_openimu).map(openimu));
    streams
}

/// Packets of a capture; `None` where the shared recordings are not at hand.
fn captured(name: &str, cut: fn(&[u8]) -> Vec<Vec<u8>>) -> Option<Vec<Vec<u8>>> {
    let bytes = crate::shared_capture(&format!("serial_raw/{name}"))?;
    let packets = cut(&bytes);
    assert!(packets.len() > 1000, "{name}: {} packets with motion", packets.len());
    Some(packets)
}

fn otolith_serial() -> Stream {
    Stream {
        name: "otolith-serial",
        period_ms: 1,
        wraps_after_us: Some(1 << 32),
        counts_packets: true,
        has_checksum: true,
        has_device_time: true,
        tells_clipping: true,
        can_say_nan: true,
        decoder: || decoder_by_name("otolith-serial").expect("known"),
        encode: encode_otolith_serial,
        captured: Vec::new(),
    }
}

fn encode_otolith_serial(samples: &[Sample], _captured: &[Vec<u8>]) -> Vec<Packet> {
    let hello = Hello {
        flags: 0,
        device_id: 7,
        firmware: 1,
        rate_millihertz: 1_000_000,
        gyro_scale: 2.66e-4,
        accel_scale: 1.2e-3,
        gyro_range_dps: 500,
        accel_range_g: 4,
        caps: 0,
        name: b"matrix",
    };
    let mut packets: Vec<Packet> = Vec::new();
    let mut say = |at_ms, message: &Message<'_>, sample| {
        let mut buffer = [0; MAX_FRAME];
        let bytes = encode_frame(message, packets.len() as u8, &mut buffer).expect("fits").to_vec();
        packets.push(Packet { at_ms, id: None, bytes, sample });
    };
    for (k, sample) in samples.iter().enumerate() {
        if k % 1000 == 0 {
            say(sample.at_ms, &Message::Hello(hello), false);
        }
        let gyro_x = match sample.content {
            Content::Rest => 1e-4 * (k % 7) as f32,
            Content::Saturated => 9.0,
            Content::NotANumber => f32::NAN,
        };
        let t_us = sample.device_us as u32;
        let values = SampleF32 { t_us, gyro: [gyro_x, 0.0, 0.0], accel: [0.0, 0.0, 9.807] };
        say(sample.at_ms, &Message::SampleF32(values), true);
    }
    packets
}

fn otolith_can() -> Stream {
    Stream {
        name: "otolith-can",
        period_ms: 5,
        wraps_after_us: Some(10 << 32),
        counts_packets: true,
        // The controller's: a damaged frame never arrives.
        has_checksum: true,
        has_device_time: true,
        tells_clipping: true,
        can_say_nan: false,
        decoder: || decoder_by_name("otolith-can").expect("known"),
        encode: encode_otolith_can,
        captured: Vec::new(),
    }
}

fn encode_otolith_can(samples: &[Sample], _captured: &[Vec<u8>]) -> Vec<Packet> {
    let ids = Ids::of_node(0).expect("fits");
    let mut packets = Vec::new();
    let mut frames_sent = 0_u16;
    for (k, sample) in samples.iter().enumerate() {
        let mut say = |message: CanMessage, sample_ends| {
            let (id, bytes) = ids.frame(&message);
            packets.push(Packet {
                at_ms: sample.at_ms,
                id: Some(u32::from(id)),
                bytes: bytes.to_vec(),
                sample: sample_ends,
            });
        };
        let ticks = sample.device_us / 10;
        if k % 200 == 0 {
            say(CanMessage::Ranges(Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 200 }), false);
        }
        if k % 20 == 0 {
            say(CanMessage::Time(Time { time_10us: ticks as u32, frames_sent, status: 0 }), false);
        }
        let x = if sample.content == Content::Saturated { i16::MAX } else { (k % 7) as i16 };
        say(CanMessage::Gyro(HalfSample { xyz: [x, 0, 0], tick: ticks as u16 }), false);
        say(CanMessage::Accel(HalfSample { xyz: [0, 0, 8192], tick: ticks as u16 }), true);
        frames_sent = frames_sent.wrapping_add(2);
    }
    packets
}

fn text() -> Stream {
    Stream {
        name: "text",
        period_ms: 10,
        wraps_after_us: Some(1 << 32),
        counts_packets: false,
        has_checksum: false,
        has_device_time: true,
        tells_clipping: true,
        can_say_nan: false,
        decoder: || {
            let mapping = "column_count = 7\n[time]\ncolumn = 1\nunit = \"us\"\nwraps_after = 4294967296\n\
                [gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\nfull_scale = 9.0\n\
                [specific_force]\ncolumns = [5, 6, 7]\nunit = \"g\"";
            Box::new(TextDecoder::new(&TextMapping::from_toml("matrix", mapping).expect("a mapping")))
        },
        encode: |samples, _| {
            let line = |(k, sample): (usize, &Sample)| {
                let gyro_x = match sample.content {
                    Content::Rest => format!("{:.4}", 1e-4 * (k % 7) as f64),
                    Content::Saturated => "9.0".to_owned(),
                    Content::NotANumber => "nan".to_owned(),
                };
                let bytes = format!("{},{gyro_x},0,0,0.001,0,1.000\n", sample.device_us).into_bytes();
                Packet { at_ms: sample.at_ms, id: None, bytes, sample: true }
            };
            samples.iter().enumerate().map(line).collect()
        },
        captured: Vec::new(),
    }
}

/// Where the data of an MTData2 item stand in a message.
fn xbus_item(message: &[u8], wanted: u16) -> Option<std::ops::Range<usize>> {
    let mut at = 4;
    while at + 3 < message.len() {
        let (id, size) = (u16::from_be_bytes([message[at], message[at + 1]]), usize::from(message[at + 2]));
        if id == wanted {
            return Some(at + 3..at + 3 + size);
        }
        at += 3 + size;
    }
    None
}

fn cut_xbus(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut messages = Vec::new();
    let mut at = bytes.windows(3).position(|start| start == [0xFA, 0xFF, 0x36]).expect("a message");
    while let Some(&length) = bytes.get(at + 3) {
        let end = at + usize::from(length) + 5;
        let Some(message) = bytes.get(at..end) else { break };
        if xbus_item(message, 0x8020).is_some() {
            messages.push(message.to_vec());
        }
        at = end;
    }
    messages
}

fn xbus(captured: Vec<Vec<u8>>) -> Stream {
    Stream {
        name: "xbus",
        period_ms: 10,
        wraps_after_us: Some(100 << 32),
        counts_packets: true,
        has_checksum: true,
        has_device_time: true,
        tells_clipping: true,
        can_say_nan: true,
        decoder: || decoder_by_name("xbus").expect("known"),
        encode: |samples, captured| {
            let packet = |(k, sample): (usize, &Sample)| {
                let mut bytes = captured[k % captured.len()].clone();
                let mut set = |id, value: &[u8]| {
                    let item = xbus_item(&bytes, id).expect("every message has it");
                    bytes[item.start..item.start + value.len()].copy_from_slice(value);
                };
                set(0x1020, &(k as u16).to_be_bytes());
                set(0x1060, &((sample.device_us / 100) as u32).to_be_bytes());
                match sample.content {
                    Content::Rest => {}
                    Content::Saturated => set(0xE020, &0x0000_0801_u32.to_be_bytes()),
                    Content::NotANumber => set(0x8020, &f32::NAN.to_be_bytes()),
                }
                let sum = bytes[1..bytes.len() - 1].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
                *bytes.last_mut().expect("a checksum") = sum.wrapping_neg();
                Packet { at_ms: sample.at_ms, id: None, bytes, sample: true }
            };
            samples.iter().enumerate().map(packet).collect()
        },
        captured,
    }
}

/// Where the data of a MIP field stand in a packet.
fn mip_field(packet: &[u8], wanted: u8) -> Option<usize> {
    let mut at = 4;
    while at + 2 < packet.len() - 2 {
        if packet[at + 1] == wanted {
            return Some(at + 2);
        }
        at += usize::from(packet[at]).max(2);
    }
    None
}

fn cut_mip(bytes: &[u8]) -> Vec<Vec<u8>> {
    let (mut packets, mut at) = (Vec::new(), 0);
    while let Some(&length) = bytes.get(at + 3) {
        let end = at + usize::from(length) + 6;
        let Some(packet) = bytes.get(at..end) else { break };
        if packet[2] == 0x80 && mip_field(packet, 0x05).is_some() && mip_field(packet, 0xD5).is_some() {
            packets.push(packet.to_vec());
        }
        at = end;
    }
    packets
}

fn mip(captured: Vec<Vec<u8>>) -> Stream {
    Stream {
        name: "mip",
        period_ms: 8,
        wraps_after_us: None,
        counts_packets: false,
        has_checksum: true,
        has_device_time: true,
        tells_clipping: false,
        can_say_nan: true,
        decoder: || decoder_by_name("mip").expect("known"),
        encode: |samples, captured| {
            let packet = |(k, sample): (usize, &Sample)| {
                let mut bytes = captured[k % captured.len()].clone();
                let time = mip_field(&bytes, 0xD5).expect("every packet has it");
                bytes[time..time + 8].copy_from_slice(&(sample.device_us * 1000).to_be_bytes());
                if sample.content == Content::NotANumber {
                    let gyro = mip_field(&bytes, 0x05).expect("every packet has it");
                    bytes[gyro..gyro + 4].copy_from_slice(&f32::NAN.to_be_bytes());
                }
                let end = bytes.len() - 2;
                let (mut first, mut second) = (0_u8, 0_u8);
                for byte in &bytes[..end] {
                    first = first.wrapping_add(*byte);
                    second = second.wrapping_add(first);
                }
                bytes[end..].copy_from_slice(&[first, second]);
                Packet { at_ms: sample.at_ms, id: None, bytes, sample: true }
            };
            samples.iter().enumerate().map(packet).collect()
        },
        captured,
    }
}

fn cut_openimu(bytes: &[u8]) -> Vec<Vec<u8>> {
    bytes.chunks_exact(47).take_while(|frame| frame.starts_with(b"UUz1")).map(<[u8]>::to_vec).collect()
}

fn openimu(captured: Vec<Vec<u8>>) -> Stream {
    Stream {
        name: "openimu",
        period_ms: 10,
        wraps_after_us: Some(1 << 32),
        counts_packets: false,
        has_checksum: true,
        has_device_time: true,
        tells_clipping: false,
        can_say_nan: true,
        decoder: || decoder_by_name("openimu").expect("known"),
        encode: |samples, captured| {
            let packet = |(k, sample): (usize, &Sample)| {
                let mut bytes = captured[k % captured.len()].clone();
                bytes[5..9].copy_from_slice(&(sample.device_us as u32).to_le_bytes());
                if sample.content == Content::NotANumber {
                    bytes[21..25].copy_from_slice(&f32::NAN.to_le_bytes());
                }
                let end = bytes.len() - 2;
                let crc = bytes[2..end].iter().fold(0x1D0F_u16, |crc, byte| {
                    (0..8).fold(crc ^ (u16::from(*byte) << 8), |crc, _| {
                        if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x1021 }
                    })
                });
                bytes[end..].copy_from_slice(&crc.to_be_bytes());
                Packet { at_ms: sample.at_ms, id: None, bytes, sample: true }
            };
            samples.iter().enumerate().map(packet).collect()
        },
        captured,
    }
}
