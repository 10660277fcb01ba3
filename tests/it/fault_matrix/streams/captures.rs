//! Packets of raw serial captures.

use super::checksum::{crc_1021, sum};
use super::{Content, Counting, Packet, Sample, Stream, captured, known};

pub(super) fn streams() -> Vec<Stream> {
    let mut streams = Vec::new();
    streams.extend(captured("serial_raw/xsens_mtdata2_100hz_gnss.bin", cut_xbus).map(xbus));
    streams.extend(captured("serial_raw/microstrain_mip_125hz.bin", cut_mip).map(mip));
    streams.extend(captured("serial_raw/openimu_z1.raw", cut_openimu).map(openimu));
    streams
}

const ORIGIN: &str = "Packets of a real capture, time and number set anew";

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

fn xbus(foreign: Vec<Vec<u8>>) -> Stream {
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut bytes = foreign[k % foreign.len()].clone();
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
            let end = bytes.len() - 1;
            bytes[end] = sum(&bytes[1..end]).wrapping_neg();
            Packet::whole(sample, bytes)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    Stream {
        wraps_after_us: Some(100 << 32),
        counting: Counting::Sequence,
        foreign,
        ..Stream::new("xbus", ORIGIN, || known("xbus"), encode)
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

fn mip(foreign: Vec<Vec<u8>>) -> Stream {
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut bytes = foreign[k % foreign.len()].clone();
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
            Packet::whole(sample, bytes)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    Stream {
        period_ms: 8,
        tells_clipping: false,
        foreign,
        ..Stream::new("mip", ORIGIN, || known("mip"), encode)
    }
}

fn cut_openimu(bytes: &[u8]) -> Vec<Vec<u8>> {
    bytes.chunks_exact(47).take_while(|frame| frame.starts_with(b"UUz1")).map(<[u8]>::to_vec).collect()
}

fn openimu(foreign: Vec<Vec<u8>>) -> Stream {
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut bytes = foreign[k % foreign.len()].clone();
            bytes[5..9].copy_from_slice(&(sample.device_us as u32).to_le_bytes());
            if sample.content == Content::NotANumber {
                bytes[21..25].copy_from_slice(&f32::NAN.to_le_bytes());
            }
            let end = bytes.len() - 2;
            let crc = crc_1021(0x1D0F, &bytes[2..end]);
            bytes[end..].copy_from_slice(&crc.to_be_bytes());
            Packet::whole(sample, bytes)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    Stream {
        wraps_after_us: Some(1 << 32),
        tells_clipping: false,
        foreign,
        ..Stream::new("openimu", ORIGIN, || known("openimu"), encode)
    }
}
