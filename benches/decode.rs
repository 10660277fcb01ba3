//! Throughput of the serial decoder on a clean and on a damaged stream of SAMPLE16 frames.

#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
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

criterion_group!(benches, decode);
criterion_main!(benches);
