//! Throughput of the decoders: our serial one on a clean and on a damaged stream of SAMPLE16 frames, those of devices on
//! clean streams of one golden frame over and over.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use otolith::device::Traffic;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::mavlink::MavlinkDecoder;
use otolith::device::protocol::vectornav::VectorNavDecoder;
use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Message, Sample16};
use otolith_firmware_protocol::stream::{Event, StreamDecoder, StreamEncoder};

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

/// Samples that `decoder` finds in `bytes`, read in pieces as a serial port hands them out.
fn count_samples(mut decoder: impl PacketDecoder, bytes: &[u8]) -> u64 {
    let mut samples = 0;
    bytes.chunks(64).for_each(|piece| decoder.push(Traffic::Bytes(piece), &mut |_| samples += 1));
    samples
}

fn decode_devices(criterion: &mut Criterion) {
    let vectornav =
        repeated(include_str!("../tests/golden/devices/vectornav-frames.json"), "what --configure sets");
    let mavlink = repeated(include_str!("../tests/golden/devices/mavlink-frames.json"), "raw_imu/extensions");
    assert_eq!(count_samples(VectorNavDecoder::new(), &vectornav), u64::from(FRAMES));
    assert_eq!(count_samples(MavlinkDecoder::new(), &mavlink), u64::from(FRAMES));
    let mut group = criterion.benchmark_group("decode devices");
    group.throughput(Throughput::Bytes(vectornav.len() as u64));
    group.bench_function("VectorNav, time, force and rate", |bencher| {
        bencher.iter(|| count_samples(VectorNavDecoder::new(), black_box(&vectornav)));
    });
    group.throughput(Throughput::Bytes(mavlink.len() as u64));
    group.bench_function("MAVLink, RAW_IMU", |bencher| {
        bencher.iter(|| count_samples(MavlinkDecoder::new(), black_box(&mavlink)));
    });
    group.finish();
}

criterion_group!(benches, decode, decode_devices);
criterion_main!(benches);
