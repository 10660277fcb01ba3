//! DBC files, held against cantools: `tests/golden/can`.

use std::path::Path;

use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::device::testing::from_hex;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Frames checked in a golden file, and signals in them.
fn check_against_cantools(path: &Path) -> (usize, usize) {
    let golden: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let dbc_name = golden["dbc"].as_str().unwrap();
    let dbc = Dbc::parse(dbc_name, &std::fs::read_to_string(format!("{ROOT}/{dbc_name}")).unwrap()).unwrap();
    let frames = golden["frames"].as_array().unwrap();
    let mut signals = 0;
    for frame in frames {
        let (id, extended) = (frame["id"].as_u64().unwrap(), frame["extended"].as_bool().unwrap());
        let message =
            dbc.messages.iter().find(|message| u64::from(message.id) == id && message.extended == extended);
        let message = message.unwrap_or_else(|| panic!("{dbc_name}: no message {id}"));
        let data = from_hex(frame["data"].as_str().unwrap());
        let expected = frame["signals"].as_object().unwrap();
        for signal in &message.signals {
            let found = message.value(signal, &data);
            let value = expected.get(&signal.name).map(|value| value.as_f64().unwrap());
            let near = match (found, value) {
                (Some(found), Some(value)) => (found - value).abs() <= 1e-12 * value.abs().max(1.0),
                (found, value) => found == value,
            };
            assert!(
                near,
                "{dbc_name}: {}.{} of {data:02x?}: {found:?}, cantools {value:?}",
                message.name, signal.name
            );
            signals += usize::from(found.is_some());
        }
        assert!(message.signals.len() >= expected.len());
    }
    (frames.len(), signals)
}

#[test]
fn every_signal_reads_as_cantools_reads_it() {
    let folder = format!("{ROOT}/tests/golden/can");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let (frames, signals) = check_against_cantools(&path);
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            println!("{name}: {signals} signals in {frames} frames");
            assert!(frames >= 24 && signals >= 72);
            names.push(name);
        }
    }
    for shipped in CAN_MAPS {
        assert!(names.iter().any(|name| format!("{name}.dbc") == shipped.dbc_name), "{}", shipped.dbc_name);
    }
}

/// The makers' own files load, and give the same numbers as ours.
#[test]
fn the_makers_dbc_files_decode_like_ours() {
    let folder = format!("{ROOT}/../shared/imu-logs/can");
    if !Path::new(&folder).exists() {
        assert!(std::env::var_os("CI").is_none(), "../shared is not here");
        println!("skipped: ../shared is not here");
        return;
    }
    let files = [
        ("sbgCan.dbc", &["sbg", "sbg-no-time"][..]),
        ("xsens_mti.dbc", &["xsens-mti-can", "xsens-mti-can-100us", "xsens-mti-can-no-time"]),
    ];
    let mut state = 1_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state.to_be_bytes()
    };
    for (file, maps) in files {
        let bytes = std::fs::read(format!("{folder}/{file}")).unwrap();
        let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
        for name in maps {
            let theirs = CanMap::new(name, shipped_can_map(name).unwrap().map, file, &text).unwrap();
            let ours = ready(name);
            assert!(ours.messages().eq(theirs.messages()), "{file}");
            let mut frames = Vec::new();
            for _ in 0..500 {
                let messages = ours.messages().filter(|message| message.required);
                let mut ids: Vec<_> = messages.map(|message| (message.id, message.size)).collect();
                ids.sort_unstable();
                frames.extend(ids.iter().map(|&(id, size)| (id, false, random()[..size].to_vec())));
            }
            let readings = push(&mut CanMapDecoder::new(&ours), &frames);
            assert_eq!(readings.len(), 500);
            assert_eq!(readings, push(&mut CanMapDecoder::new(&theirs), &frames), "{name} with {file}");
        }
    }
}

#[test]
fn a_bad_dbc_file_is_named_with_the_line() {
    let text = shipped_can_map("toyota-yaw").unwrap().dbc.replace("1|10@0+", "1|10@7+");
    let error = CanMap::new("toyota-yaw", shipped_can_map("toyota-yaw").unwrap().map, "my.dbc", &text);
    let error = error.unwrap_err().to_string();
    assert!(error.starts_with("my.dbc: this does not read as a DBC file: "), "{error}");
    assert!(error.contains("10:") && error.contains("\n\nhint: "), "{error}");
    // No text at all is a file without messages.
    assert_eq!(Dbc::parse("empty.dbc", "").unwrap().messages, []);
}

/// Lines that a DBC file is made of, damaged and mixed.
fn dbc_like() -> impl Strategy<Value = String> {
    let piece = dbc_piece();
    prop::collection::vec(piece, 0..12).prop_map(|pieces| pieces.concat())
}

fn dbc_piece() -> impl Strategy<Value = String> {
    prop_oneof![
        "[ -~\n]{0,30}",
        Just("BO_ 36 K: 8 X\n".to_owned()),
        Just("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: A\n\n".to_owned()),
        (any::<u64>(), any::<i64>(), any::<u64>(), "[mM0-9]{0,4}", any::<f64>()).prop_map(
            |(start, length, id, mux, factor)| format!(
                "BO_ {id} K: {} X\n SG_ S {mux}: {start}|{length}@0+ ({factor},0) [0|0] \"\" X\n",
                length % 70
            )
        ),
        (0_u64..70, 0_u64..70, 0_u8..3).prop_map(|(start, length, order)| format!(
            " SG_ YAW_RATE : {start}|{length}@{order}- (1,0) [0|0] \"\" X\n"
        )),
        Just("SIG_VALTYPE_ 36 YAW_RATE : 2;\n".to_owned()),
        Just("SG_MUL_VAL_ 36 YAW_RATE S 1-1;\n".to_owned()),
    ]
}

proptest! {
    /// Any text is read or refused, and what is read does not panic on any frame.
    #[test]
    fn no_dbc_text_does_harm(
        text in prop_oneof![dbc_like(), any::<String>(), dbc_like().prop_map(|text| text.replace('0', "99999999999999999999"))],
        data in prop::collection::vec(any::<u8>(), 0..=8),
    ) {
        check_harmless(&text, &data)?;
    }

    /// Nor does a file that was damaged in a few places.
    #[test]
    fn no_damaged_dbc_file_does_harm(
        map in 0..CAN_MAPS.len(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), "[ -~\n]{0,3}"), 1..4),
        data in prop::collection::vec(any::<u8>(), 0..=8),
    ) {
        let mut text = CAN_MAPS[map].dbc.to_owned();
        for (place, with) in damage {
            let at = place.index(text.len());
            text.replace_range(at..=at, &with);
        }
        check_harmless(&text, &data)?;
    }
}

/// Reads a DBC text, with and without the ready mappings, and a frame with what it says.
fn check_harmless(text: &str, data: &[u8]) -> Result<(), TestCaseError> {
    match Dbc::parse("any.dbc", text) {
        Err(error) => prop_assert!(error.to_string().contains("\n\nhint: ")),
        Ok(dbc) => {
            for message in &dbc.messages {
                for signal in &message.signals {
                    let _any = message.value(signal, data);
                }
            }
        }
    }
    for shipped in CAN_MAPS {
        if let Ok(map) = CanMap::new("m", shipped.map, "any.dbc", text) {
            let frames: Vec<_> =
                map.messages().map(|message| (message.id, message.extended, data.to_vec())).collect();
            push(&mut CanMapDecoder::new(&map), &frames);
        }
    }
    Ok(())
}
