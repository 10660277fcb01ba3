//! Throughput of the decoders: of our own protocol on a clean and on a damaged stream of SAMPLE16 frames, of others on
//! one golden frame over and over and on captures of real devices, and for MTData2 that of a decoder by others in the
//! same run.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use otolith::device::Traffic;
use otolith::device::protocol::detect::decoder_by_name;
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Message, Sample16};
use otolith_firmware_protocol::stream::{Event, StreamDecoder, StreamEncoder};
use xsens_mti::prelude::{
    Acceleration, DataType, Decoder, MTData2, MessageDecode, PacketCounter, RateOfTurn, SampleTimeFine,
    StatusWord,
};

/// Ten seconds of a 1 kHz IMU.
const FRAMES: u32 = 10_000;

fn stream() -> Vec<u8> {
    let (mut encoder, mut buffer) = (StreamEncoder::new(), [0; MAX_FRAME]);
    let mut bytes = Vec::new();
    for k in 0..FRAMES {
        let count = (k % 4000) as i16;
        let sample = Sample16 { t_us: 1000 * k, gyro: [count, -count, 3932], accel: [0, count / 2, 8192] };
        if let Ok(frame) = encoder.encode(&Message::Sample16(sample), &mut buffer) {
            bytes.extend_from_slice(frame);
        }
    }
    bytes
}

/// Messages that `bytes` hold, read in pieces as a serial port hands them out.
fn count_messages(bytes: &[u8]) -> u64 {
    let (mut decoder, mut messages) = (StreamDecoder::new(), 0);
    for piece in bytes.chunks(64) {
        decoder.push(piece, |event| messages += u64::from(matches!(event, Event::Message { .. })));
    }
    messages
}

fn decode(criterion: &mut Criterion) {
    let clean = stream();
    let mut damaged = clean.clone();
    damaged.iter_mut().step_by(101).for_each(|byte| *byte ^= 0x10);
    assert_eq!(count_messages(&clean), u64::from(FRAMES));
    let mut group = criterion.benchmark_group("decode SAMPLE16");
    group.throughput(Throughput::Bytes(clean.len() as u64));
    group.bench_function("clean", |bencher| bencher.iter(|| count_messages(black_box(&clean))));
    group.bench_function("one byte in 101 damaged", |bencher| {
        bencher.iter(|| count_messages(black_box(&damaged)));
    });
    group.finish();
}

/// A golden frame of a device, ten seconds of it at 1 kHz.
fn repeated(golden: &str, name: &str) -> Vec<u8> {
    let golden: serde_json::Value = serde_json::from_str(golden).unwrap_or_default();
    let rows = golden["frames"].as_array().cloned().unwrap_or_default();
    let row = rows.iter().find(|row| row["name"] == name);
    let digits = row.and_then(|row| row["hex"].as_str()).unwrap_or_default();
    let byte = |at: usize| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).unwrap_or_default();
    (0..digits.len() / 2).map(byte).collect::<Vec<u8>>().repeat(FRAMES as usize)
}

fn decode_devices(criterion: &mut Criterion) {
    let vectornav =
        repeated(include_str!("../tests/golden/devices/vectornav-frames.json"), "what --configure sets");
    let mavlink = repeated(include_str!("../tests/golden/devices/mavlink-frames.json"), "raw_imu/extensions");
    assert_eq!(count_samples("vectornav", &vectornav), u64::from(FRAMES));
    assert_eq!(count_samples("mavlink", &mavlink), u64::from(FRAMES));
    let mut group = criterion.benchmark_group("decode devices");
    group.throughput(Throughput::Bytes(vectornav.len() as u64));
    group.bench_function("VectorNav, time, force and rate", |bencher| {
        bencher.iter(|| count_samples("vectornav", black_box(&vectornav)));
    });
    group.throughput(Throughput::Bytes(mavlink.len() as u64));
    group.bench_function("MAVLink, RAW_IMU", |bencher| {
        bencher.iter(|| count_samples("mavlink", black_box(&mavlink)));
    });
    group.finish();
}

/// Captures of real devices, by protocol; in `../shared/imu-logs/serial_raw`, which is not part of this repository.
const CAPTURES: [(&str, &str); 3] = [
    ("xbus", "xsens_mtdata2_100hz_gnss.bin"),
    ("mip", "microstrain_mip_125hz.bin"),
    ("openimu", "openimu_z1.raw"),
];

/// Samples in `bytes`, read in pieces as a serial port hands them out.
fn count_samples(protocol: &str, bytes: &[u8]) -> u64 {
    let Ok(mut decoder) = decoder_by_name(protocol) else { return 0 };
    let mut samples = 0;
    for piece in bytes.chunks(64) {
        decoder.push(Traffic::Bytes(piece), &mut |reading| {
            black_box(reading);
            samples += 1;
        });
    }
    samples
}

/// The same with the decoder of the crate `xsens-mti`, which reads byte by byte.
fn count_samples_of_peer(bytes: &[u8]) -> u64 {
    let Ok(mut decoder) = Decoder::new([0; 2100]) else { return 0 };
    let mut samples = 0;
    for byte in bytes {
        let Ok(Some(frame)) = decoder.decode(*byte) else { continue };
        let Ok(packets) = MTData2::decode(&frame) else { continue };
        let (mut omega, mut force) = (None, None);
        for packet in packets.into_iter().flatten() {
            let data = packet.payload();
            match packet.data_id().data_type() {
                DataType::PacketCounter => drop(black_box(PacketCounter::from_be_slice(data))),
                DataType::SampleTimeFine => drop(black_box(SampleTimeFine::from_be_slice(data))),
                DataType::StatusWord => drop(black_box(StatusWord::from_be_slice(data))),
                DataType::RateOfTurn => omega = RateOfTurn::<f32>::from_be_slice(data).ok(),
                DataType::Acceleration => force = Acceleration::<f32>::from_be_slice(data).ok(),
                _ => {}
            }
        }
        samples += u64::from(black_box(omega).is_some() && black_box(force).is_some());
    }
    samples
}

fn decode_captures(criterion: &mut Criterion) {
    for (protocol, file) in CAPTURES {
        let path = format!("{}/../shared/imu-logs/serial_raw/{file}", env!("CARGO_MANIFEST_DIR"));
        let Ok(clean) = std::fs::read(&path) else {
            println!("skipped: {path} is not here");
            continue;
        };
        let mut damaged = clean.clone();
        damaged.iter_mut().step_by(1009).for_each(|byte| *byte ^= 0x10);
        let mut group = criterion.benchmark_group(format!("decode {protocol}"));
        group.throughput(Throughput::Bytes(clean.len() as u64));
        for (name, bytes) in [("clean", &clean), ("one byte in 1009 damaged", &damaged)] {
            println!("{protocol}, {name}: {} samples", count_samples(protocol, bytes));
            group.bench_function(name, |bencher| bencher.iter(|| count_samples(protocol, black_box(bytes))));
            if protocol == "xbus" {
                println!("{protocol}, {name}: {} samples by xsens-mti", count_samples_of_peer(bytes));
                group.bench_function(format!("{name}, xsens-mti"), |bencher| {
                    bencher.iter(|| count_samples_of_peer(black_box(bytes)));
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, decode, decode_devices, decode_captures);
criterion_main!(benches);
