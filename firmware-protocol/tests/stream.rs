//! Laws of the serial format over generated messages and damage.

use otolith_firmware_protocol::crc::crc16;
use otolith_firmware_protocol::message::{
    Ack, BATCH_MAX_ROWS, Batch16, Cmd, EncodeError, Hello, Message, PayloadError, Sample16, SampleF32,
    Status, Sync, Text, kind,
};
use otolith_firmware_protocol::stream::{
    Counters, DropReason, Event, StreamDecoder, StreamEncoder, encode_frame,
};
use otolith_firmware_protocol::{MAX_FRAME, MAX_PAYLOAD, VERSION, cobs};
use proptest::collection::vec;
use proptest::prelude::*;

/// Content of a message with the variable parts owned.
type Parts = (u8, u64, u64, u64, Vec<u8>, Vec<[u8; 12]>);

fn parts() -> impl Strategy<Value = Parts> {
    (
        0..9u8,
        any::<u64>(),
        any::<u64>(),
        any::<u64>(),
        vec(any::<u8>(), 0..=Hello::NAME_MAX),
        vec(any::<[u8; 12]>(), 0..=BATCH_MAX_ROWS),
    )
}

fn message(parts: &Parts) -> Message<'_> {
    let &(which, a, b, c, ref bytes, ref rows) = parts;
    let half = |word: u64| [word as i16, (word >> 16) as i16, (word >> 32) as i16];
    // Any bit pattern but NaN, which is unequal to itself.
    let real = |bits: u64| Some(f32::from_bits(bits as u32)).filter(|value| !value.is_nan()).unwrap_or(1.5);
    match which {
        0 => Message::Hello(Hello {
            flags: a as u8,
            device_id: b as u32,
            firmware: (a >> 8) as u16,
            rate_millihertz: (b >> 32) as u32,
            gyro_scale: real(c),
            accel_scale: real(c >> 32),
            gyro_range_dps: (a >> 24) as u16,
            accel_range_g: (a >> 40) as u16,
            caps: (a >> 48) as u16,
            name: bytes,
        }),
        1 => Message::Sample16(Sample16 { t_us: a as u32, gyro: half(b), accel: half(c) }),
        2 => Message::Batch16(Batch16 { t_us: a as u32, dt_us: b as u16, rows }),
        3 => Message::SampleF32(SampleF32 {
            t_us: a as u32,
            gyro: [real(a >> 32), real(b), real(b >> 32)],
            accel: [real(c), real(c >> 32), real(a ^ c)],
        }),
        4 => Message::Status(Status {
            t_us: a,
            temperature_centi_c: b as i16,
            flags: c as u32,
            dropped: (b >> 16) as u16,
            tx_overrun: (b >> 32) as u16,
            sensor_err: (b >> 48) as u16,
        }),
        5 => Message::Sync(Sync { t1_us: a, t2_us: b, t3_us: c }),
        6 => Message::Text(Text { bytes }),
        7 => Message::Cmd(Cmd { code: a as u8, arg: b as u32, token: c as u8 }),
        _ => Message::Ack(Ack { code: a as u8, result: (a >> 8) as u8, value: b as u32, token: c as u8 }),
    }
}

/// A frame around any body, as `encode_frame` builds it around a message.
fn raw_frame(body: &[u8]) -> Vec<u8> {
    let mut block = vec![0];
    block.extend_from_slice(body);
    block.extend_from_slice(&crc16(body).to_le_bytes());
    cobs::encode_in_place(&mut block);
    block.push(0);
    block
}

fn counters_after(bytes: &[u8]) -> Counters {
    let mut decoder = StreamDecoder::new();
    decoder.push(bytes, |_| {});
    decoder.counters()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_encoded_is_decoded(parts in parts(), seq: u8, cut in 1..MAX_FRAME) {
        let message = message(&parts);
        let mut buffer = [0; MAX_FRAME];
        let frame = encode_frame(&message, seq, &mut buffer).unwrap();
        prop_assert_eq!(frame.iter().position(|&byte| byte == 0), Some(frame.len() - 1));
        let mut decoder = StreamDecoder::new();
        let mut found = 0;
        for piece in frame.chunks(cut) {
            decoder.push(piece, |event| {
                assert_eq!(event, Event::Message { seq, lost_before: 0, message });
                found += 1;
            });
        }
        prop_assert_eq!(found, 1);
        prop_assert_eq!(decoder.counters(), Counters { frames: 1, ..Counters::default() });
    }

    #[test]
    fn cobs_is_its_own_inverse(body in vec(prop_oneof![Just(0u8), any::<u8>()], 0..=cobs::MAX_ENCODED - 1)) {
        let mut block = vec![0];
        block.extend_from_slice(&body);
        cobs::encode_in_place(&mut block);
        prop_assert!(!block.contains(&0));
        prop_assert_eq!(cobs::decode_in_place(&mut block), Ok(&body[..]));
    }

    #[test]
    fn any_block_decodes_or_is_refused(mut block in vec(any::<u8>(), 0..300)) {
        let length = block.len();
        if let Ok(body) = cobs::decode_in_place(&mut block) {
            prop_assert_eq!(body.len() + 1, length);
        }
    }

    /// No panic, every byte accounted for, and the first frame after a delimiter is read.
    #[test]
    fn one_delimiter_ends_any_garbage(
        garbage in vec(prop_oneof![1 => Just(0u8), 20 => any::<u8>()], 0..1200),
        parts in parts(),
        cut in 1..400usize,
    ) {
        let message = message(&parts);
        let mut stream = garbage.clone();
        stream.push(0);
        let mut buffer = [0; MAX_FRAME];
        stream.extend_from_slice(encode_frame(&message, 7, &mut buffer).unwrap());

        let mut decoder = StreamDecoder::new();
        let (mut last_is_message, mut errors, mut joined) = (false, 0, 0);
        for piece in stream.chunks(cut) {
            decoder.push(piece, |event| {
                last_is_message = matches!(event, Event::Message { seq: 7, message: m, .. } if m == message);
                if let Event::Dropped { joined_mid_frame, .. } = event {
                    errors += 1;
                    joined += u64::from(joined_mid_frame);
                }
            });
        }
        let counters = decoder.counters();
        prop_assert!(last_is_message);
        prop_assert_eq!(errors, counters.framing_errors + counters.crc_errors);
        prop_assert!(joined <= 1, "the piece before the first delimiter counts once");
        prop_assert_eq!(counters, counters_after(&stream), "counts depend on how the bytes were cut");
        let bare_delimiters = stream.iter().filter(|&&byte| byte == 0).count() as u64 - counters.frames - errors;
        if counters.frames == 1 {
            let frame_bytes = (stream.len() - garbage.len() - 1) as u64;
            prop_assert_eq!(counters.bytes_skipped + bare_delimiters + frame_bytes, stream.len() as u64);
        }
    }

    #[test]
    fn any_payload_is_read_or_refused(which: u8, payload in vec(any::<u8>(), 0..=MAX_PAYLOAD)) {
        for kind in [which, kind::HELLO, kind::BATCH16, kind::SAMPLE16, kind::TEXT] {
            if let Ok(message) = Message::decode(kind, &payload) {
                let mut out = [0; MAX_PAYLOAD];
                let length = message.encode_payload(&mut out).unwrap();
                prop_assert_eq!((message.kind(), &out[..length]), (kind, &payload[..]));
            }
        }
    }

    /// CRC-16 finds every single-bit error of a body; after COBS that is every flip of a data byte that stays
    /// non-zero.
    #[test]
    fn a_flipped_bit_of_the_body_is_a_crc_error(parts in parts(), seq: u8, at: prop::sample::Index) {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode_frame(&message(&parts), seq, &mut buffer).unwrap();
        let mut block = frame[..frame.len() - 1].to_vec();
        let body = cobs::decode_in_place(&mut block).unwrap();
        let mut damaged = vec![0];
        damaged.extend_from_slice(body);
        let bit = at.index(8 * body.len());
        damaged[1 + bit / 8] ^= 1 << (bit % 8);
        cobs::encode_in_place(&mut damaged);
        damaged.push(0);
        let counters = counters_after(&damaged);
        prop_assert_eq!((counters.frames, counters.crc_errors), (0, 1));
    }

    #[test]
    fn every_missing_frame_is_counted(lost in 0..=255usize, start: u8) {
        let mut encoder = StreamEncoder::starting_at(start);
        let message = Message::Cmd(Cmd { code: 1, arg: 0, token: 0 });
        let mut decoder = StreamDecoder::new();
        for index in 0..lost + 2 {
            let mut buffer = [0; MAX_FRAME];
            let frame = encoder.encode(&message, &mut buffer).unwrap();
            if index == 0 || index == lost + 1 {
                decoder.push(frame, |_| {});
            }
        }
        prop_assert_eq!(decoder.counters(), Counters { frames: 2, lost: lost as u64, ..Counters::default() });
    }
}

#[test]
fn unknown_types_versions_and_lengths_are_good_frames() {
    let mut decoder = StreamDecoder::new();
    let mut errors = Vec::new();
    let next_version = VERSION + 1;
    for body in [
        &[0x7F, 0, 1, 2, 3][..],
        &[kind::HELLO, 1, next_version, 9],
        &[kind::SAMPLE16, 2, 1, 2],
        &[kind::HELLO, 3],
    ] {
        decoder.push(&raw_frame(body), |event| match event {
            Event::Unreadable { kind, payload, error, .. } => {
                assert_eq!((kind, payload), (body[0], &body[2..]));
                errors.push(error);
            }
            other => panic!("{other:?}"),
        });
    }
    assert_eq!(
        errors,
        [
            PayloadError::UnknownType { kind: 0x7F },
            PayloadError::Version { got: next_version },
            PayloadError::Length { kind: kind::SAMPLE16, expected: 16, got: 2 },
            PayloadError::Length { kind: kind::HELLO, expected: 27, got: 0 },
        ]
    );
    assert_eq!(errors[1].to_string(), "the device speaks format version 2, expected 1");
    assert_eq!(decoder.counters(), Counters { frames: 4, unknown: 2, malformed: 2, ..Counters::default() });
}

#[test]
fn variable_parts_fit_or_are_refused() {
    let (bytes, rows) = ([0xFF; MAX_PAYLOAD + 1], [[0xFF; 12]; BATCH_MAX_ROWS + 1]);
    let mut buffer = [0; MAX_FRAME];
    let longest = encode_frame(&Message::Text(Text { bytes: &bytes[1..] }), 0xFF, &mut buffer).unwrap();
    assert_eq!(longest.len(), MAX_FRAME);
    assert_eq!(counters_after(longest).frames, 1);

    let mut encoder = StreamEncoder::new();
    let too_long = Message::Text(Text { bytes: &bytes });
    let error = EncodeError { kind: kind::TEXT, got: MAX_PAYLOAD + 1, most: MAX_PAYLOAD };
    assert_eq!(encoder.encode(&too_long, &mut buffer), Err(error));
    let too_many = Message::Batch16(Batch16 { t_us: 0, dt_us: 0, rows: &rows });
    let error = EncodeError { kind: kind::BATCH16, got: 20, most: 19 };
    assert_eq!(encoder.encode(&too_many, &mut buffer), Err(error));

    // A refused message leaves no gap in the sequence.
    let frame = encoder.encode(&Message::Text(Text { bytes: b"ok" }), &mut buffer).unwrap();
    StreamDecoder::new().push(frame, |event| assert!(matches!(event, Event::Message { seq: 0, .. })));
}

#[test]
fn a_line_without_zeros_is_noticed_at_once() {
    let mut decoder = StreamDecoder::new();
    let mut dropped = Vec::new();
    for _ in 0..10 {
        decoder.push(&[b'x'; 100], |event| dropped.push(format!("{event:?}")));
    }
    assert_eq!(dropped.len(), 1, "{dropped:?}");
    assert!(dropped[0].contains(&format!("{:?}", DropReason::TooLong)));
    assert_eq!(
        decoder.counters(),
        Counters { framing_errors: 1, bytes_skipped: 1000, ..Counters::default() }
    );
}

#[test]
fn a_reopened_port_is_no_loss() {
    let mut decoder = StreamDecoder::new();
    let message = Message::Cmd(Cmd { code: 8, arg: 0, token: 0 });
    let mut buffer = [0; MAX_FRAME];
    decoder.push(encode_frame(&message, 10, &mut buffer).unwrap(), |_| {});
    decoder.push(&[5, 1], |_| {});
    decoder.rejoin();
    decoder.push(encode_frame(&message, 99, &mut buffer).unwrap(), |_| {});
    assert_eq!(decoder.counters(), Counters { frames: 2, ..Counters::default() });
}

#[test]
fn damaged_text_shows_its_readable_part() {
    assert_eq!(Text { bytes: b"self-test \xFF ok" }.as_str(), "self-test ");
    assert_eq!(Text { bytes: "20 °C".as_bytes() }.as_str(), "20 °C");
}

#[test]
fn sync_gives_offset_and_round_trip() {
    // Device 5 s ahead; 300 µs there, 42 µs inside, 500 µs back.
    let sync = Sync { t1_us: 1_000_000, t2_us: 6_000_300, t3_us: 6_000_342 };
    assert_eq!(sync.round_trip_us(1_000_842), 800);
    assert_eq!(sync.offset_us(1_000_842), 4_999_900, "wrong by half the difference of the two ways");
}
