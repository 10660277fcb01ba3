//! The C header against the crate: a C program prints its constants and frames, and both must agree.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests: a vector that is not as described must fail the test"
)]

use std::process::Command;

use otolith_firmware_protocol::can;
use otolith_firmware_protocol::message::{ack_result, command, kind, status_flag};
use otolith_firmware_protocol::{MAX_BODY, MAX_FRAME, MAX_PAYLOAD, VERSION, message};
use serde_json::Value;

/// Frames the C program encodes: golden name and the C expression of their length.
const FRAMES: [(&str, &str); 5] = [
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
];

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

fn c_program(golden: &Value, constants: &[(&str, u64)]) -> String {
    let mut program = format!(
        "#include <stdio.h>\n#include \"otolith_protocol.h\"\n\n\
         static void show(const char *name, const uint8_t *bytes, size_t length)\n{{\n    size_t i;\n    \
         printf(\"%s \", name);\n    for (i = 0; i < length; i++)\n        printf(\"%02x\", bytes[i]);\n    \
         printf(\"\\n\");\n}}\n\nint main(void)\n{{\n    uint8_t frame[OTOLITH_MAX_FRAME], data[OTOLITH_CAN_DLC];\n    \
         const struct otolith_hello hello = {{0x00C0FFEE, 0x0102, 1000000, {}f, {}f, 500, 4, 1, \"ICM42688\"}};\n",
        golden["gyro_scale"], golden["accel_scale"],
    );
    for (name, expression) in FRAMES {
        program += &format!("    show(\"{name}\", frame, {expression});\n");
    }
    program += "    otolith_can_half(data, (int16_t[]){0, 0, 3932}, 100);\n    show(\"can_gyro\", data, sizeof data);\n";
    program += "    printf(\"crc %x\\n\", otolith_crc16((const uint8_t *)\"123456789\", 9));\n";
    for (name, _) in constants {
        program += &format!("    printf(\"{name} %lu\\n\", (unsigned long)OTOLITH_{name});\n");
    }
    program + "    return 0;\n}\n"
}

#[test]
fn c_header_agrees_with_the_crate() {
    if Command::new("cc").arg("--version").output().is_err() {
        assert!(std::env::var_os("CI").is_none(), "no C compiler `cc` on PATH");
        println!("skipped: no C compiler `cc` on PATH");
        return;
    }
    let golden: Value = serde_json::from_str(include_str!("golden.json")).unwrap();
    let constants = constants();
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, binary) = (folder.join("c_header.c"), folder.join("c_header"));
    std::fs::write(&source, c_program(&golden, &constants)).unwrap();
    let compiled = Command::new("cc")
        .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"])
        .arg(concat!("-I", env!("CARGO_MANIFEST_DIR"), "/include"))
        .arg("-o")
        .args([&binary, &source])
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));

    let vectors = golden["serial"].as_array().unwrap();
    let mut expected: Vec<String> = FRAMES
        .iter()
        .map(|(name, _)| {
            let vector = vectors.iter().find(|vector| vector["name"] == *name).unwrap();
            format!("{name} {}", vector["hex"].as_str().unwrap())
        })
        .collect();
    expected.push(format!("can_gyro {}", golden["can"][0]["data"].as_str().unwrap()));
    expected.push("crc 29b1".into());
    expected.extend(constants.iter().map(|(name, value)| format!("{name} {value}")));
    let printed = Command::new(&binary).output().unwrap();
    let printed = String::from_utf8(printed.stdout).unwrap();
    assert_eq!(printed.lines().collect::<Vec<_>>(), expected);
}

/// A constant added to the header must be compared too.
#[test]
fn every_constant_of_the_header_is_compared() {
    let header = include_str!("../include/otolith_protocol.h");
    let compared = constants();
    let not_in_the_crate =
        ["PROTOCOL_H", "CAN_DLC", "CAN_DESC_RANGES", "CAN_DESC_IDENTITY", "BATCH16_ROW_SIZE"];
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
