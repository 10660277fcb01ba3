//! Inputs to start from: vectors and examples of this repository, and where it is at hand the shared recordings.

use std::path::{Path, PathBuf};

use otolith::device::mock::{MockChair, MockParams};
use otolith::device::protocol::detect::decoder_by_name;
use otolith::device::protocol::text::KNOWN_LOGS;
use otolith::device::replay::parse_candump_line;
use otolith::device::{Link, Traffic};
use serde_json::Value;

use crate::frames::Checked;
use crate::{can, input, serial};

/// How much of a recording is used, and in what pieces, bytes.
const USED: usize = 64 * 1024;
const PIECE: usize = 4 * 1024;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn bytes(digits: &str) -> Vec<u8> {
    let digits = digits.as_bytes().chunks(2).filter_map(|pair| std::str::from_utf8(pair).ok());
    digits.filter_map(|pair| u8::from_str_radix(pair, 16).ok()).collect()
}

/// The vectors of foreign devices, and of our own protocol under `serial` and `can`.
fn vectors() -> [Value; 2] {
    [
        serde_json::from_str(include_str!("../../tests/golden/devices/vectors.json")).unwrap_or_default(),
        serde_json::from_str(include_str!("../../firmware-protocol/tests/golden.json")).unwrap_or_default(),
    ]
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// Each vector of bytes or of text.
fn serial_vectors() -> Vec<Vec<u8>> {
    let [foreign, ours] = vectors();
    let all = list(&foreign).iter().chain(list(&ours["serial"]));
    let of_vector = |vector: &Value| match (vector["hex"].as_str(), vector["text"].as_str()) {
        (Some(hex), _) => Some(bytes(hex)),
        (None, text) => text.map(|text| text.as_bytes().to_vec()),
    };
    all.filter_map(of_vector).collect()
}

/// The beginnings of the shared recordings in a folder, in pieces.
fn shared(folder: &str) -> Vec<Vec<u8>> {
    let contents = files_in(&root().join("../shared/imu-logs").join(folder)).into_iter();
    contents
        .flat_map(|all| all[..all.len().min(USED)].chunks(PIECE).map(<[u8]>::to_vec).collect::<Vec<_>>())
        .collect()
}

fn files_in(folder: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    paths.sort();
    paths.iter().filter_map(|path| std::fs::read(path).ok()).collect()
}

/// The texts in a folder of this repository.
pub(crate) fn texts_in(folder: &str) -> Vec<Vec<u8>> {
    files_in(&root().join(folder))
}

/// What the simulated chair sends in a twentieth of a second.
fn mock() -> Vec<u8> {
    let params = MockParams { rest_s: 0.05, ..MockParams::rest() };
    let Ok(mut chair) = MockChair::new(params) else { return Vec::new() };
    let mut all = Vec::new();
    while let Ok(Some((_, Traffic::Bytes(piece)))) = chair.receive(std::time::Duration::ZERO) {
        all.extend_from_slice(piece);
    }
    all
}

/// Streams of bytes, cut in some ways.
pub(crate) fn streams() -> Vec<Vec<u8>> {
    let mut streams = serial_vectors();
    streams.extend(serial_vectors().iter().map(|vector| vector.repeat(12)));
    streams.push(mock());
    streams.extend(["serial_raw", "mavlink"].into_iter().flat_map(shared));
    let cut = |(number, stream): (usize, &Vec<u8>)| {
        input::with_cuts(number as u8 & 1, &[number as u8, 21, 2], stream)
    };
    streams.iter().enumerate().map(cut).collect()
}

/// Frames of a bus.
pub(crate) fn can_frames() -> Vec<Vec<u8>> {
    let [foreign, ours] = vectors();
    let frame = |frame: &Value| {
        let id = u32::try_from(frame["id"].as_u64()?).ok()?;
        Some((id, frame["extended"].as_bool().unwrap_or(false), bytes(frame["data"].as_str()?)))
    };
    let lists = list(&foreign).iter().map(|vector| &vector["can"]).chain([&ours["can"]]);
    let of_list = |frames: &Value| -> Vec<u8> {
        let frames: Vec<_> = list(frames).iter().filter_map(frame).collect();
        can::input_of(frames.iter().map(|(id, extended, data)| (*id, *extended, &data[..])))
    };
    let mut inputs: Vec<Vec<u8>> = lists.map(of_list).filter(|input| input.len() > 1).collect();
    inputs.extend(inputs.clone().iter().map(|input| [&input[..1], &input[1..].repeat(12)].concat()));
    for piece in shared("can") {
        let frames: Vec<_> = piece.split(|byte| *byte == b'\n').filter_map(parse_candump_line).collect();
        inputs.push(can::input_of(frames.iter().map(|frame| (frame.id, frame.extended, frame.data()))));
    }
    inputs
}

/// Frames of a protocol among the vectors whose content can be replaced; of our own, a device's HELLO and samples.
pub(crate) fn good_frames(checked: &Checked) -> Vec<Vec<u8>> {
    let streams = if checked.protocol == "otolith-serial" { vec![mock()] } else { serial_vectors() };
    let mut good = Vec::new();
    for stream in streams {
        let mut at = 0;
        while let Some(length) = (checked.valid)(&stream[at..]).filter(|_| good.len() < 8) {
            let frame = &stream[at..at + length];
            at += length;
            let Ok(mut decoder) = decoder_by_name(checked.protocol) else { return good };
            let known = serial::decode(&mut decoder, std::iter::once(frame)).counters.packets == 1;
            if known && (checked.content)(frame).len() >= 8 {
                good.push(frame.to_vec());
            }
        }
    }
    good
}

/// Text logs, cut in some ways.
pub(crate) fn logs() -> Vec<Vec<u8>> {
    let own = [
        "Time (s),Gyroscope x (rad/s),Gyroscope y (rad/s),Gyroscope z (rad/s)\n0.0,1,2,3\n0.01,1e-3,-2,3\r\n",
        "t,gx\n1,2\n# x\n\n3,4",
    ];
    let shared = ["csv", "phone", "turntable"].into_iter().flat_map(shared);
    let all = own.map(|text| text.as_bytes().to_vec()).into_iter().chain(shared);
    all.enumerate()
        .map(|(number, log)| input::with_cuts(number as u8 & 3, &[number as u8, 40], &log))
        .collect()
}

/// A mapping, a zero byte, rows.
pub(crate) fn logs_with_mappings() -> Vec<Vec<u8>> {
    let row = "1,0.1,0.2,-0.3,0,0,9.81,4,5,6,7,8,9\n0;0;0\t1 2 3\n";
    let mappings = texts_in("configs/logs").into_iter().chain(KNOWN_LOGS.map(|known| known.text.into()));
    let pairs = mappings
        .map(|mapping| input::with_cuts(0, &[5], &[&mapping, &[0][..], row.repeat(4).as_bytes()].concat()));
    pairs.chain(logs()).collect()
}

pub(crate) fn candump_logs() -> Vec<Vec<u8>> {
    let own = b"(1614981013.853137) can0 3A0#000000005C0F6400\n(1614981013.854) can0 18FEF100#11\r\nx\n\
                (1614981013.860000) can0 20000040#0000000000000000\n"
        .to_vec();
    let logs = std::iter::once(own).chain(shared("can"));
    logs.map(|log| input::with_cuts(0, &[30], &log)).collect()
}

/// Configurations: those of this repository, and one with every key written out.
pub(crate) fn configs() -> Vec<Vec<u8>> {
    let whole = otolith::config::Config::default().to_toml().into_bytes();
    ["configs", "configs/scenarios"].into_iter().flat_map(texts_in).chain([whole]).collect()
}
