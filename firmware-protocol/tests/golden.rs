//! The vectors of the executable specification, both ways: bytes to fields and counts, fields to identical bytes.
//!
//! `golden.json` is the output of the specification's `proto.py`, copied unchanged.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests: a vector that is not as described must fail the test"
)]

use otolith_firmware_protocol::can::{
    CanEvent, CanMessage, CanReceiver, HalfSample, Health, Identity, Ids, Ranges, Time,
};
use otolith_firmware_protocol::message::{
    Ack, Batch16, Cmd, Hello, Message, Sample16, SampleF32, Status, Sync, Text,
};
use otolith_firmware_protocol::stream::{
    Counters, DropReason, Event, StreamDecoder, StreamEncoder, encode_frame,
};
use otolith_firmware_protocol::{MAX_FRAME, VERSION};
use serde_json::Value;

const GOLDEN: &str = include_str!("golden.json");

fn golden() -> Value {
    serde_json::from_str(GOLDEN).unwrap()
}

fn bytes_of(hex: &Value) -> Vec<u8> {
    let hex = hex.as_str().unwrap();
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn serial_vector(golden: &Value, name: &str) -> (Vec<u8>, Value) {
    let all = golden["serial"].as_array().unwrap();
    let vector = all.iter().find(|vector| vector["name"] == name).unwrap();
    (bytes_of(&vector["hex"]), vector["expect"].clone())
}

fn counts_of(expect: &Value) -> [u64; 4] {
    ["frames", "framing_errors", "crc_errors", "lost"].map(|key| expect["counts"][key].as_u64().unwrap())
}

fn counted(counters: Counters) -> [u64; 4] {
    [counters.frames, counters.framing_errors, counters.crc_errors, counters.lost]
}

fn int<T: TryFrom<i64, Error: std::fmt::Debug>>(value: &Value) -> T {
    T::try_from(value.as_i64().unwrap()).unwrap()
}

fn i16x3(value: &Value) -> [i16; 3] {
    [int(&value[0]), int(&value[1]), int(&value[2])]
}

fn f32x3(value: &Value) -> [f32; 3] {
    [0, 1, 2].map(|axis| value[axis].as_f64().unwrap() as f32)
}

fn batch_rows(expect: &Value) -> Vec<[u8; 12]> {
    let Some(rows) = expect["rows"].as_array() else { return Vec::new() };
    rows.iter()
        .map(|row| {
            Batch16::row(
                [int(&row[0]), int(&row[1]), int(&row[2])],
                [int(&row[3]), int(&row[4]), int(&row[5])],
            )
        })
        .collect()
}

/// The message that a vector describes in words and numbers, not by its bytes.
fn described<'a>(name: &str, golden: &Value, expect: &'a Value, rows: &'a [[u8; 12]]) -> Message<'a> {
    let t_us = || int(&expect["t_us"]);
    match name {
        "hello" => {
            assert_eq!(expect["version"], VERSION);
            Message::Hello(Hello {
                flags: int(&expect["flags"]),
                device_id: int(&expect["device_id"]),
                firmware: int(&expect["firmware"]),
                rate_millihertz: int(&expect["rate_mhz"]),
                gyro_scale: golden["gyro_scale"].as_f64().unwrap() as f32,
                accel_scale: golden["accel_scale"].as_f64().unwrap() as f32,
                gyro_range_dps: int(&expect["gyro_range_dps"]),
                accel_range_g: int(&expect["accel_range_g"]),
                caps: int(&expect["caps"]),
                name: expect["name_text"].as_str().unwrap().as_bytes(),
            })
        }
        "batch16x5" => Message::Batch16(Batch16 { t_us: t_us(), dt_us: int(&expect["dt_us"]), rows }),
        "sample_f32" => Message::SampleF32(SampleF32 {
            t_us: t_us(),
            gyro: f32x3(&expect["gyro_radps"]),
            accel: f32x3(&expect["accel_mps2"]),
        }),
        "status" => Message::Status(Status {
            t_us: expect["t_us"].as_u64().unwrap(),
            temperature_centi_c: int(&expect["temp_centi_c"]),
            flags: int(&expect["flags"]),
            dropped: int(&expect["dropped"]),
            tx_overrun: int(&expect["tx_overrun"]),
            sensor_err: int(&expect["sensor_err"]),
        }),
        "sync_request" | "sync_answer" => Message::Sync(Sync {
            t1_us: int(&expect["t1_us"]),
            t2_us: int(&expect["t2_us"]),
            t3_us: int(&expect["t3_us"]),
        }),
        "text" => Message::Text(Text { bytes: expect["message"].as_str().unwrap().as_bytes() }),
        "cmd_set_rate_500hz" => Message::Cmd(Cmd {
            code: int(&expect["code"]),
            arg: int(&expect["arg"]),
            token: int(&expect["token"]),
        }),
        "ack_set_rate_500hz" => Message::Ack(Ack {
            code: int(&expect["code"]),
            result: int(&expect["result"]),
            value: int(&expect["value"]),
            token: int(&expect["token"]),
        }),
        _ => {
            assert!(name.starts_with("sample16_"), "vector {name} is new: describe it here");
            Message::Sample16(Sample16 {
                t_us: t_us(),
                gyro: i16x3(&expect["gyro"]),
                accel: i16x3(&expect["accel"]),
            })
        }
    }
}

const DAMAGED: [&str; 3] = ["bad_crc", "bad_cobs", "stream_resync"];

#[test]
fn serial_frames_both_ways() {
    let golden = golden();
    let mut checked = 0;
    for vector in golden["serial"].as_array().unwrap() {
        let (name, expect, wire) =
            (vector["name"].as_str().unwrap(), &vector["expect"], bytes_of(&vector["hex"]));
        if DAMAGED.contains(&name) {
            continue;
        }
        let rows = batch_rows(expect);
        let message = described(name, &golden, expect, &rows);
        let seq = expect.get("seq").map_or(0, int);

        let mut buffer = [0; MAX_FRAME];
        assert_eq!(encode_frame(&message, seq, &mut buffer).unwrap(), wire, "{name}");
        assert_eq!(StreamEncoder::starting_at(seq).encode(&message, &mut buffer).unwrap(), wire, "{name}");

        let mut decoder = StreamDecoder::new();
        let mut found = 0;
        decoder.push(&wire, |event| {
            assert_eq!(event, Event::Message { seq, lost_before: 0, message }, "{name}");
            found += 1;
        });
        assert_eq!(found, 1, "{name}");
        assert_eq!(counted(decoder.counters()), counts_of(expect), "{name}");
        checked += 1;
    }
    assert_eq!(checked, 13);
}

#[test]
fn damaged_streams_count_as_specified() {
    let golden = golden();
    for name in DAMAGED {
        let (wire, expect) = serial_vector(&golden, name);
        // The counts do not depend on how the bytes are cut.
        for cut in 1..=wire.len() {
            let mut decoder = StreamDecoder::new();
            wire.chunks(cut).for_each(|piece| decoder.push(piece, |_| {}));
            assert_eq!(counted(decoder.counters()), counts_of(&expect), "{name} in pieces of {cut}");
        }
    }
}

#[test]
fn joining_mid_frame_is_told_apart_from_damage() {
    let (wire, _) = serial_vector(&golden(), "stream_resync");
    let mut seen = Vec::new();
    StreamDecoder::new().push(&wire, |event| match event {
        Event::Message { seq, lost_before, .. } => seen.push(format!("seq {seq}, {lost_before} lost")),
        Event::Dropped { reason, joined_mid_frame } => {
            assert_eq!(reason, DropReason::Crc);
            seen.push(if joined_mid_frame { "joined".into() } else { "damaged".into() });
        }
        Event::Unreadable { error, .. } => panic!("{error}"),
    });
    assert_eq!(seen, ["joined", "seq 3, 0 lost", "damaged", "seq 5, 1 lost"]);
}

#[test]
fn sequence_and_time_wrap_together() {
    let golden = golden();
    let mut times = Vec::new();
    let mut decoder = StreamDecoder::new();
    for name in ["sample16_extremes", "sample16_seq_wrap_t_wrap"] {
        decoder.push(&serial_vector(&golden, name).0, |event| {
            if let Event::Message { message: Message::Sample16(sample), .. } = event {
                times.push(sample.t_us);
            }
        });
    }
    assert_eq!(times[1].wrapping_sub(times[0]), 1000);
    assert_eq!(decoder.counters().lost, 0);
}

#[test]
fn batch_samples_have_their_own_times() {
    let (wire, expect) = serial_vector(&golden(), "batch16x5");
    StreamDecoder::new().push(&wire, |event| {
        let Event::Message { message: Message::Batch16(batch), .. } = event else { panic!("{event:?}") };
        let samples: Vec<_> = batch.samples().collect();
        assert_eq!(samples.len(), 5);
        for (index, sample) in samples.iter().enumerate() {
            assert_eq!(sample.t_us, 5000 + 1000 * index as u32);
            assert_eq!(sample.gyro[0], int::<i16>(&expect["rows"][index][0]));
            assert_eq!(sample.accel[2], 8192);
        }
    });
}

/// Exhaustive over the vectors. For frames in general only 65535 of 65536 flips inside COBS codes are certain to
/// be found, as one wrong code moves zeros to other places.
#[test]
fn no_flipped_bit_yields_another_message() {
    let golden = golden();
    let follower = serial_vector(&golden, "sample16_rest").0;
    for vector in golden["serial"].as_array().unwrap() {
        let wire = bytes_of(&vector["hex"]);
        if DAMAGED.iter().any(|name| vector["name"] == *name) {
            continue;
        }
        for bit in 0..8 * wire.len() {
            let mut damaged = wire.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            damaged.extend_from_slice(&[0]);
            damaged.extend_from_slice(&follower);
            let mut accepted = 0;
            StreamDecoder::new().push(&damaged, |event| match event {
                Event::Dropped { .. } => {}
                Event::Message {
                    seq: 1, message: Message::Sample16(Sample16 { t_us: 1000, .. }), ..
                } => {
                    accepted += 1;
                }
                // The frame's own delimiter was hit and the next one closed it.
                _ => panic!("{}: bit {bit} went unnoticed: {event:?}", vector["name"]),
            });
            assert_eq!(accepted, 1, "{}: the frame after bit {bit} was lost", vector["name"]);
        }
    }
}

#[test]
fn can_frames_both_ways() {
    let expected = [
        CanMessage::Gyro(HalfSample { xyz: [0, 0, 3932], tick: 100 }),
        CanMessage::Accel(HalfSample { xyz: [0, 0, 8192], tick: 100 }),
        CanMessage::Time(Time { time_10us: 12_345_700, frames_sent: 0x3039, status: 1 }),
        CanMessage::Health(Health { temperature_centi_c: 2550, dropped: 3, tx_overrun: 0, self_test: 0 }),
        CanMessage::Ranges(Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 }),
        CanMessage::Identity(Identity { device_id: 0x00C0_FFEE, firmware: 0x0102 }),
        CanMessage::Cmd(Cmd { code: 3, arg: 500_000, token: 0x5A }),
        CanMessage::Ack(Ack { code: 3, result: 0, value: 500_000, token: 0x5A }),
    ];
    let golden = golden();
    let frames = golden["can"].as_array().unwrap();
    assert_eq!(frames.len(), expected.len());
    let ids = Ids::default();
    for (frame, message) in frames.iter().zip(expected) {
        // DESC's second page carries an unused byte, so the identical bytes are the proof of its zero.
        let (id, data) = (int::<u16>(&frame["id"]), bytes_of(&frame["data"]));
        let (made_id, made_data) = ids.frame(&message);
        assert_eq!((made_id, &made_data[..]), (id, &data[..]), "{}", frame["desc"]);
        let offset = ids.offset_of(u32::from(id)).unwrap();
        assert_eq!(CanMessage::decode(offset, &data), Ok(message), "{}", frame["desc"]);
    }
}

#[test]
fn can_scales_and_pairing() {
    let golden = golden();
    let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: 1000 };
    assert_eq!(ranges.gyro_scale(), golden["gyro_scale"].as_f64().unwrap());
    assert_eq!(ranges.accel_scale(), golden["accel_scale"].as_f64().unwrap());

    let mut receiver = CanReceiver::new(Ids::default());
    let mut samples = Vec::new();
    for frame in golden["can"].as_array().unwrap() {
        receiver.push(int(&frame["id"]), &bytes_of(&frame["data"]), |event| {
            if let CanEvent::Sample(sample) = event {
                samples.push(sample);
            }
        });
    }
    let [sample] = samples[..] else { panic!("{samples:?}") };
    assert_eq!(sample.time_us, 1000);
    assert!((f64::from(sample.gyro[2]) * ranges.gyro_scale().to_degrees() - 59.998).abs() < 5e-4);
    assert!((f64::from(sample.accel[2]) * ranges.accel_scale() - 9.80665).abs() < 1e-12);
    let counters = receiver.counters();
    assert_eq!((counters.frames, counters.samples, counters.lone_halves, counters.lost), (8, 1, 0, 0));
}

/// The worked frames of the README are bytes of the vectors.
#[test]
fn readme_frames_are_the_vectors() {
    let readme: String = include_str!("../README.md").split_whitespace().collect();
    let golden = golden();
    for name in ["hello", "sample16_60dps_yaw", "sync_answer", "cmd_set_rate_500hz", "bad_crc"] {
        let hex = serial_vector(&golden, name).0.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        assert!(readme.contains(&hex), "README.md does not spell {name} as {hex}");
    }
    for frame in golden["can"].as_array().unwrap() {
        let hex = frame["data"].as_str().unwrap().to_uppercase();
        let cansend = format!("{:X}#{hex}", int::<u16>(&frame["id"]));
        assert!(readme.contains(&cansend), "README.md does not spell {cansend}");
    }
}
