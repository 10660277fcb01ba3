//! Throughput of the decoders, beside that of a decoder by others in the same run where there is one for Rust: of our own
//! protocol on a clean and on a damaged stream of SAMPLE16 frames, of others on one golden frame over and over and on
//! captures of real devices.

#![allow(missing_docs)]

mod peers;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use otolith::device::Traffic;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::can_map::{CAN_MAPS, CanMap, CanMapDecoder};
use otolith::device::protocol::detect::decoder_by_name;
use otolith::device::protocol::text::{TextDecoder, TextMapping};
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
    let rows = golden.get("frames").unwrap_or(&golden).as_array().cloned().unwrap_or_default();
    let row = rows.iter().find(|row| row["name"] == name);
    let digits = row.and_then(|row| row["hex"].as_str()).unwrap_or_default();
    let byte = |at: usize| u8::from_str_radix(&digits[2 * at..2 * at + 2], 16).unwrap_or_default();
    (0..digits.len() / 2).map(byte).collect::<Vec<u8>>().repeat(FRAMES as usize)
}

/// A decoder by name: how many samples it finds.
type Decoder<'a> = (&'a str, &'a mut dyn FnMut(&[u8]) -> u64);

/// Decoders on the same bytes, of which each must find every frame.
fn compare(criterion: &mut Criterion, protocol: &str, bytes: &[u8], decoders: &mut [Decoder<'_>]) {
    let mut group = criterion.benchmark_group(format!("decode {protocol}"));
    group.throughput(Throughput::Bytes(bytes.len() as u64));
    for (name, decode) in decoders {
        assert_eq!(decode(bytes), u64::from(FRAMES), "{protocol} by {name}");
        group.bench_function(*name, |bencher| bencher.iter(|| decode(black_box(bytes))));
    }
    group.finish();
}

fn decode_devices(criterion: &mut Criterion) {
    let ours = |protocol: &'static str| move |bytes: &[u8]| count_samples(protocol, bytes);
    let vectornav = include_str!("../../tests/golden/devices/vectornav-frames.json");
    let vectornav = repeated(vectornav, "what --configure sets");
    compare(criterion, "vectornav", &vectornav, &mut [("otolith", &mut ours("vectornav"))]);

    let mavlink = include_str!("../../tests/golden/devices/mavlink-frames.json");
    let mavlink = repeated(mavlink, "raw_imu/extensions");
    let mut decoders: [Decoder<'_>; 2] =
        [("otolith", &mut ours("mavlink")), ("mavlink", &mut peers::mavlink)];
    compare(criterion, "mavlink", &mavlink, &mut decoders);

    let vectors = include_str!("../../tests/golden/devices/vectors.json");
    let witmotion = repeated(vectors, "witmotion-serial/constructed");
    compare(criterion, "witmotion", &witmotion, &mut [("otolith", &mut ours("witmotion"))]);
}

/// Lines of 15 numbers, of which seven are asked for.
fn decode_text(criterion: &mut Criterion) {
    let mapping = include_str!("../../configs/logs/turntable-lsm9ds1.toml");
    let Ok(mapping) = TextMapping::from_toml("turntable-lsm9ds1.toml", mapping) else { return };
    let line = |k: u32| {
        let time_s = f64::from(k) * 1e-3;
        format!(
            "{time_s:.6}, -1.134796, -0.124427, 9.599406, -0.078321, 0.168105, {k}.5, 0.3, -0.5, 0.1, 0, 0, 3425, -3794, 0.0\n"
        )
    };
    let lines = (0..FRAMES).map(line).collect::<String>();
    let mut ours = |bytes: &[u8]| count(&mut TextDecoder::new(&mapping), bytes);
    let mut decoders: [Decoder<'_>; 2] = [("otolith", &mut ours), ("csv", &mut peers::csv)];
    compare(criterion, "text", lines.as_bytes(), &mut decoders);
}

/// Our own CAN messages through the generic decoder: 10,000 samples of two frames each.
fn decode_can(criterion: &mut Criterion) {
    let Some(shipped) = CAN_MAPS.iter().find(|map| map.name == "otolith-can") else { return };
    let Ok(map) = CanMap::new(shipped.name, shipped.map, shipped.dbc_name, shipped.dbc) else { return };
    let ids: Vec<u32> = map.messages().map(|message| message.id).collect();
    let mut frames = Vec::new();
    for k in 0..FRAMES {
        let [low, high] = (k as u16).to_le_bytes();
        frames.extend(ids.iter().map(|id| (*id, vec![1, low, 3, high, 5, 6, low, high])));
    }
    let Ok(dbc) = dbc_rs::Dbc::parse(shipped.dbc) else { return };
    let ours = || {
        let (mut decoder, mut samples) = (CanMapDecoder::new(&map), 0);
        for (id, data) in &frames {
            let frame = Traffic::CanFrame { id: *id, extended: false, data };
            decoder.push(frame, &mut |reading| {
                black_box(reading);
                samples += 1;
            });
        }
        samples
    };
    assert_eq!((ours(), peers::dbc_rs(&dbc, &frames)), (FRAMES, frames.len() as u64));
    let mut group = criterion.benchmark_group("decode CAN by DBC");
    group.throughput(Throughput::Elements(frames.len() as u64));
    group.bench_function("otolith", |bencher| bencher.iter(ours));
    group.bench_function("dbc-rs", |bencher| bencher.iter(|| peers::dbc_rs(&dbc, black_box(&frames))));
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
    decoder_by_name(protocol).map_or(0, |mut decoder| count(decoder.as_mut(), bytes))
}

/// The same of a decoder that has seen nothing yet.
fn count(decoder: &mut dyn PacketDecoder, bytes: &[u8]) -> u64 {
    let mut samples = 0;
    for piece in bytes.chunks(64) {
        decoder.push(Traffic::Bytes(piece), &mut |reading| {
            black_box(reading);
            samples += 1;
        });
    }
    samples
}

fn decode_captures(criterion: &mut Criterion) {
    for (protocol, file) in CAPTURES {
        let path = format!("{}/../../../shared/imu-logs/serial_raw/{file}", env!("CARGO_MANIFEST_DIR"));
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
                println!("{protocol}, {name}: {} samples by xsens-mti", peers::xsens_mti(bytes));
                group.bench_function(format!("{name}, xsens-mti"), |bencher| {
                    bencher.iter(|| peers::xsens_mti(black_box(bytes)));
                });
            }
        }
        group.finish();
    }
}

criterion_group!(benches, decode, decode_devices, decode_text, decode_can, decode_captures);
criterion_main!(benches);
