//! The C header against the crate and its vectors: C programs print its constants and frames, and what they make of
//! received ones.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests: a vector that is not as described must fail the test"
)]

use std::path::{Path, PathBuf};
use std::process::Command;

use otolith_firmware_protocol::message::{Message, ack_result, command, kind, status_flag};
use otolith_firmware_protocol::stream::{DropReason, Event, StreamDecoder, encode_frame};
use otolith_firmware_protocol::{MAX_BODY, MAX_FRAME, MAX_PAYLOAD, VERSION, can, cobs, message};
use serde_json::Value;

/// How the C program makes each good frame of the vectors: golden name and a C expression of the frame's length. What has
/// no function of its own is made of the header's fields, as a firmware would.
const FRAMES: [(&str, &str); 13] = [
    ("hello", "otolith_hello(frame, 0, &hello)"),
    ("sample16_rest", "otolith_sample16(frame, 1, 1000, (int16_t[]){0, 0, 0}, (int16_t[]){0, 0, 8192})"),
    (
        "sample16_60dps_yaw",
        "otolith_sample16(frame, 2, 2000, (int16_t[]){0, 0, 3932}, (int16_t[]){0, 0, 8192})",
    ),
    (
        "sample16_extremes",
        "otolith_sample16(frame, 255, 0xFFFFFFFF, (int16_t[]){-32768, 32767, -1}, (int16_t[]){-32768, 32767, 1})",
    ),
    (
        "sample16_seq_wrap_t_wrap",
        "otolith_sample16(frame, 0, 999, (int16_t[]){1, 2, 3}, (int16_t[]){4, 5, 6})",
    ),
    ("batch16x5", "batch(frame)"),
    ("sample_f32", "floats(frame)"),
    ("status", "otolith_status(frame, 10, &status)"),
    ("sync_request", "otolith_sync(frame, 11, 1700000000000001ULL, 0, 0)"),
    ("sync_answer", "otolith_sync(frame, 12, 1700000000000001ULL, 123456800000ULL, 123456800042ULL)"),
    ("text", "otolith_text(frame, 13, \"gyro self-test ok\")"),
    ("cmd_set_rate_500hz", "command(frame)"),
    ("ack_set_rate_500hz", "otolith_ack(frame, 15, &cmd, OTOLITH_ACK_OK, 500000)"),
];

/// How the C program makes the 8 data bytes of each CAN vector, in their order: statements that write from `at` on.
const CAN_DATA: [&str; 8] = [
    "otolith_can_half(data, (int16_t[]){0, 0, 3932}, 100);",
    "otolith_can_half(data, (int16_t[]){0, 0, 8192}, 100);",
    "at = otolith_put_u32(at, 12345700); at = otolith_put_u16(at, 12345); otolith_put_u16(at, OTOLITH_FLAG_GYRO_CLIP);",
    "at = otolith_put_u16(at, 2550); at = otolith_put_u16(at, 3); at = otolith_put_u16(at, 0); \
     at = otolith_put_u8(at, OTOLITH_VERSION); otolith_put_u8(at, 0);",
    "at = otolith_put_u8(at, OTOLITH_CAN_DESC_RANGES); at = otolith_put_u16(at, 500); at = otolith_put_u16(at, 4); \
     at = otolith_put_u16(at, 1000); otolith_put_u8(at, OTOLITH_VERSION);",
    "at = otolith_put_u8(at, OTOLITH_CAN_DESC_IDENTITY); at = otolith_put_u32(at, 0x00C0FFEE); \
     otolith_put_u16(at, 0x0102);",
    "at = otolith_put_u8(at, cmd.code); at = otolith_put_u32(at, cmd.arg); otolith_put_u8(at, cmd.token);",
    "at = otolith_put_u8(at, cmd.code); at = otolith_put_u8(at, OTOLITH_ACK_OK); at = otolith_put_u32(at, cmd.arg); \
     otolith_put_u8(at, cmd.token);",
];

/// What every C program begins with.
const PRELUDE: &str = r#"
#include <stdio.h>
#include "otolith_protocol.h"

static void show(const char *name, const uint8_t *bytes, size_t length)
{
    size_t i;
    printf("%s ", name);
    for (i = 0; i < length; i++)
        printf("%02x", bytes[i]);
    printf("\n");
}

static size_t batch(uint8_t frame[OTOLITH_MAX_FRAME])
{
    int16_t k;
    uint8_t *at = otolith_put_u32(otolith_payload(frame), 5000);
    at = otolith_put_u16(at, 1000);
    at = otolith_put_u8(at, 5);
    for (k = 0; k < 5; k++) {
        at = otolith_put_i16x3(at, (int16_t[]){k, 0, 3932});
        at = otolith_put_i16x3(at, (int16_t[]){0, k, 8192});
    }
    return otolith_finish_frame(frame, OTOLITH_BATCH16, 7, (size_t)(at - otolith_payload(frame)));
}

static size_t floats(uint8_t frame[OTOLITH_MAX_FRAME])
{
    const float values[6] = {0, 0, 1.0471976f, 0, 0, 9.80665f};
    int i;
    uint8_t *at = otolith_put_u32(otolith_payload(frame), 3000);
    for (i = 0; i < 6; i++)
        at = otolith_put_f32(at, values[i]);
    return otolith_finish_frame(frame, OTOLITH_SAMPLE_F32, 9, OTOLITH_SAMPLE_F32_SIZE);
}

static size_t command(uint8_t frame[OTOLITH_MAX_FRAME])
{
    uint8_t *at = otolith_put_u8(otolith_payload(frame), OTOLITH_CMD_SET_RATE);
    otolith_put_u8(otolith_put_u32(at, 500000), 0x5A);
    return otolith_finish_frame(frame, OTOLITH_CMD, 14, OTOLITH_CMD_SIZE);
}

/* Says what the receiver makes of a piece, the delimiter left out. */
static void open_piece(const char *name, uint8_t *piece, size_t length)
{
    int payload_length = otolith_open_frame(piece, length);
    if (payload_length < 0) {
        printf("%s %s\n", name, payload_length == OTOLITH_CRC_ERROR ? "crc_error" : "framing_error");
        return;
    }
    printf("%s %02x %02x ", name, piece[OTOLITH_TYPE_AT], piece[OTOLITH_SEQ_AT]);
    show("", piece + OTOLITH_PAYLOAD_AT, (size_t)payload_length);
    if (piece[OTOLITH_TYPE_AT] == OTOLITH_CMD) {
        struct otolith_cmd cmd = otolith_cmd_at(piece + OTOLITH_PAYLOAD_AT);
        printf("cmd %u %lu %u\n", cmd.code, (unsigned long)cmd.arg, cmd.token);
    }
    if (piece[OTOLITH_TYPE_AT] == OTOLITH_SYNC)
        printf("t1 %lu\n", (unsigned long)(otolith_u64_at(piece + OTOLITH_PAYLOAD_AT) / 1000000));
}
"#;

/// Every constant of the header that the crate also has.
fn constants() -> Vec<(&'static str, u64)> {
    let bytes = [
        ("VERSION", VERSION),
        ("HELLO", kind::HELLO),
        ("SAMPLE16", kind::SAMPLE16),
        ("BATCH16", kind::BATCH16),
        ("SAMPLE_F32", kind::SAMPLE_F32),
        ("STATUS", kind::STATUS),
        ("SYNC", kind::SYNC),
        ("TEXT", kind::TEXT),
        ("CMD", kind::CMD),
        ("ACK", kind::ACK),
        ("CMD_START", command::START),
        ("CMD_STOP", command::STOP),
        ("CMD_SET_RATE", command::SET_RATE),
        ("CMD_SET_GYRO_RANGE", command::SET_GYRO_RANGE),
        ("CMD_SET_ACCEL_RANGE", command::SET_ACCEL_RANGE),
        ("CMD_SELF_TEST", command::SELF_TEST),
        ("CMD_SAVE", command::SAVE),
        ("CMD_SEND_HELLO", command::SEND_HELLO),
        ("ACK_OK", ack_result::OK),
        ("ACK_UNKNOWN_CODE", ack_result::UNKNOWN_CODE),
        ("ACK_OUT_OF_RANGE", ack_result::OUT_OF_RANGE),
        ("ACK_BUSY", ack_result::BUSY),
        ("ACK_FAILED", ack_result::FAILED),
    ];
    let words = [
        ("CAN_BASE", can::DEFAULT_BASE),
        ("CAN_NODE_STRIDE", can::NODE_STRIDE),
        ("CAN_GYRO", can::offset::GYRO),
        ("CAN_ACCEL", can::offset::ACCEL),
        ("CAN_TIME", can::offset::TIME),
        ("CAN_HEALTH", can::offset::HEALTH),
        ("CAN_DESC", can::offset::DESC),
        ("CAN_CMD", can::offset::CMD),
        ("CAN_ACK", can::offset::ACK),
    ];
    let flags = [
        ("FLAG_GYRO_CLIP", status_flag::GYRO_CLIP),
        ("FLAG_ACCEL_CLIP", status_flag::ACCEL_CLIP),
        ("FLAG_SELF_TEST_OK", status_flag::SELF_TEST_OK),
        ("FLAG_FIFO_OVERRUN", status_flag::FIFO_OVERRUN),
        ("FLAG_TIME_SYNCHRONISED", status_flag::TIME_SYNCHRONISED),
        ("FLAG_CALIBRATING", status_flag::CALIBRATING),
    ];
    let sizes = [
        ("MAX_PAYLOAD", MAX_PAYLOAD),
        ("MAX_BODY", MAX_BODY),
        ("MAX_FRAME", MAX_FRAME),
        ("BATCH16_MAX_ROWS", message::BATCH_MAX_ROWS),
        ("HELLO_SIZE", smallest_payload(kind::HELLO)),
        ("SAMPLE16_SIZE", smallest_payload(kind::SAMPLE16)),
        ("BATCH16_SIZE", smallest_payload(kind::BATCH16)),
        ("SAMPLE_F32_SIZE", smallest_payload(kind::SAMPLE_F32)),
        ("STATUS_SIZE", smallest_payload(kind::STATUS)),
        ("SYNC_SIZE", smallest_payload(kind::SYNC)),
        ("CMD_SIZE", smallest_payload(kind::CMD)),
        ("ACK_SIZE", smallest_payload(kind::ACK)),
    ];
    let mut all = vec![("CAN_TICK_US", can::TICK_US)];
    all.extend(bytes.map(|(name, value)| (name, u64::from(value))));
    all.extend(words.map(|(name, value)| (name, u64::from(value))));
    all.extend(flags.map(|(name, value)| (name, u64::from(value))));
    all.extend(sizes.map(|(name, value)| (name, value as u64)));
    all
}

/// Length of the shortest payload that the crate reads as this type.
fn smallest_payload(kind: u8) -> usize {
    let mut payload = [0; MAX_PAYLOAD];
    if kind == kind::HELLO {
        payload[0] = VERSION;
    }
    (0..MAX_PAYLOAD).find(|&length| message::Message::decode(kind, &payload[..length]).is_ok()).unwrap()
}

/// A program that prints the frames and constants of the header.
fn sender(golden: &Value, constants: &[(&str, u64)]) -> String {
    let mut program = format!(
        "{PRELUDE}\nint main(void)\n{{\n    uint8_t frame[OTOLITH_MAX_FRAME], data[OTOLITH_CAN_DLC], *at;\n    \
         const struct otolith_hello hello = {{0x00C0FFEE, 0x0102, 1000000, {}f, {}f, 500, 4, 1, \"ICM42688\"}};\n    \
         const struct otolith_status status = {{123456789012ULL, 2550, 3, 17, 2, 0}};\n    \
         const struct otolith_cmd cmd = {{OTOLITH_CMD_SET_RATE, 500000, 0x5A}};\n    (void)open_piece;\n",
        golden["gyro_scale"], golden["accel_scale"],
    );
    for (name, expression) in FRAMES {
        program += &format!("    show(\"{name}\", frame, {expression});\n");
    }
    for statements in CAN_DATA {
        program += &format!(
            "    memset(data, 0, sizeof data);\n    at = data;\n    (void)at;\n    {statements}\n    \
             show(\"can\", data, sizeof data);\n"
        );
    }
    program += "    printf(\"crc %x\\n\", otolith_crc16((const uint8_t *)\"123456789\", 9));\n";
    for (name, _) in constants {
        program += &format!("    printf(\"{name} %lu\\n\", (unsigned long)OTOLITH_{name});\n");
    }
    program + "    return 0;\n}\n"
}

/// A program that opens `pieces` and says what is in them.
fn receiver(pieces: &[(&str, Vec<u8>)]) -> String {
    let mut program =
        format!("{PRELUDE}\nint main(void)\n{{\n    (void)batch;\n    (void)floats;\n    (void)command;\n");
    for (name, piece) in pieces {
        program += &format!(
            "    open_piece(\"{name}\", (uint8_t[]){{{}}}, {});\n",
            piece.iter().map(u8::to_string).collect::<Vec<_>>().join(", "),
            piece.len()
        );
    }
    program + "    return 0;\n}\n"
}

/// True if `compiler` is there; missing where everything must be checked, it is a failure.
fn have(compiler: &str) -> bool {
    let found = Command::new(compiler).arg("--version").output().is_ok();
    if !found {
        assert!(std::env::var_os("CI").is_none(), "no C compiler `{compiler}` on PATH");
        println!("skipped: no C compiler `{compiler}` on PATH");
    }
    found
}

fn compile(compiler: &str, flags: &[&str], program: &str, name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, output) = (folder.join(format!("{name}.c")), folder.join(name));
    std::fs::write(&source, program).unwrap();
    let compiled = Command::new(compiler)
        .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"])
        .args(flags)
        .arg(concat!("-I", env!("CARGO_MANIFEST_DIR"), "/include"))
        .arg("-o")
        .args([&output, &source])
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    output
}

fn printed_by(binary: &Path) -> Vec<String> {
    let output = Command::new(binary).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

fn golden() -> Value {
    serde_json::from_str(include_str!("golden.json")).unwrap()
}

/// True if a vector is one good frame.
fn is_good(vector: &Value) -> bool {
    vector["expect"]["counts"]
        == serde_json::json!({"frames": 1, "framing_errors": 0, "crc_errors": 0, "lost": 0})
}

fn bytes_of(vector: &Value) -> Vec<u8> {
    let hex = vector["hex"].as_str().unwrap();
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

#[test]
fn what_the_header_sends_agrees_with_the_crate_and_every_good_vector() {
    if !have("cc") {
        return;
    }
    let (golden, constants) = (golden(), constants());
    let good = golden["serial"].as_array().unwrap().iter().filter(|vector| is_good(vector));
    let mut expected: Vec<String> = good
        .map(|vector| format!("{} {}", vector["name"].as_str().unwrap(), vector["hex"].as_str().unwrap()))
        .collect();
    let can = golden["can"].as_array().unwrap();
    expected.extend(can.iter().map(|frame| format!("can {}", frame["data"].as_str().unwrap())));
    expected.push("crc 29b1".into());
    expected.extend(constants.iter().map(|(name, value)| format!("{name} {value}")));
    let binary = compile("cc", &["-Wconversion"], &sender(&golden, &constants), "c_header_sender");
    assert_eq!(printed_by(&binary), expected);
}

/// What a receiver in C makes of the vectors, damaged ones too, is what the crate makes of them.
#[test]
fn what_the_header_receives_agrees_with_the_crate() {
    if !have("cc") {
        return;
    }
    let golden = golden();
    let (mut pieces, mut expected) = (Vec::new(), Vec::new());
    for vector in golden["serial"].as_array().unwrap() {
        let name = vector["name"].as_str().unwrap();
        let stream = bytes_of(vector);
        pieces.extend(
            stream.split_inclusive(|&byte| byte == 0).map(|piece| (name, piece[..piece.len() - 1].to_vec())),
        );
        StreamDecoder::new().push(&stream, |event| match event {
            Event::Message { seq, message, .. } => {
                let mut payload = [0; MAX_FRAME];
                let frame = encode_frame(&message, seq, &mut payload).unwrap();
                let body = cobs::decode_in_place(&mut frame.to_vec()[..frame.len() - 1]).unwrap().to_vec();
                let hex: String = body[2..body.len() - 2].iter().map(|byte| format!("{byte:02x}")).collect();
                expected.push(format!("{name} {:02x} {seq:02x}  {hex}", message.kind()));
                match message {
                    Message::Cmd(cmd) => expected.push(format!("cmd {} {} {}", cmd.code, cmd.arg, cmd.token)),
                    Message::Sync(sync) => expected.push(format!("t1 {}", sync.t1_us / 1_000_000)),
                    _ => {}
                }
            }
            Event::Dropped { reason: DropReason::Crc, .. } => expected.push(format!("{name} crc_error")),
            Event::Dropped { .. } => expected.push(format!("{name} framing_error")),
            Event::Unreadable { .. } => panic!("{name} cannot be read"),
        });
    }
    // Beyond the vectors: too short, a code of zero, a code past the end.
    for (name, piece) in
        [("short", vec![1, 1, 1, 1]), ("zero", vec![1, 0, 1, 1, 1, 1]), ("past", vec![7, 1, 1, 1, 1, 1])]
    {
        pieces.push((name, piece));
        expected.push(format!("{name} framing_error"));
    }
    let binary = compile("cc", &["-Wconversion"], &receiver(&pieces), "c_header_receiver");
    assert_eq!(printed_by(&binary), expected);
}

/// 16-bit `int`, another compiler.
#[test]
fn the_header_compiles_for_a_small_microcontroller() {
    if !have("avr-gcc") {
        return;
    }
    let flags = ["-mmcu=atmega328p", "-Os", "-c"];
    compile("avr-gcc", &flags, &sender(&golden(), &constants()), "c_header_sender.avr");
    compile("avr-gcc", &flags, &receiver(&[("piece", vec![1, 1])]), "c_header_receiver.avr");
}

/// A constant added to the header must be compared too.
#[test]
fn every_constant_of_the_header_is_compared() {
    let header = include_str!("../include/otolith_protocol.h");
    let compared = constants();
    let not_in_the_crate = [
        "PROTOCOL_H",
        "CAN_DLC",
        "CAN_DESC_RANGES",
        "CAN_DESC_IDENTITY",
        "BATCH16_ROW_SIZE",
        "FRAMING_ERROR",
        "CRC_ERROR",
        "TYPE_AT",
        "SEQ_AT",
        "PAYLOAD_AT",
    ];
    for line in header.lines() {
        let defined = line.strip_prefix("#define OTOLITH_").and_then(|rest| rest.split(' ').next());
        let enumerated = line.strip_prefix("    OTOLITH_").and_then(|rest| rest.split_once(" = "));
        let Some(name) = defined.or(enumerated.map(|(name, _)| name)) else { continue };
        assert!(
            not_in_the_crate.contains(&name) || compared.iter().any(|(compared, _)| *compared == name),
            "OTOLITH_{name} is not compared"
        );
    }
}
