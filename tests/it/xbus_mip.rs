//! Xbus and MIP against bytes of others: the vendors' documents, and captures of real devices.

mod captures;
mod damage;
mod peer;
mod vectors;

use otolith::device::Traffic;
use otolith::device::protocol::detect::decoder_by_name;
use otolith::device::protocol::{DecodeCounters, ImuReading};

/// What the decoder called `protocol` makes of `bytes` that come `cut` at a time, and of their end.
fn decode(protocol: &str, bytes: &[u8], cut: usize) -> (Vec<ImuReading>, DecodeCounters) {
    let mut decoder = decoder_by_name(protocol).expect("known");
    let mut readings = Vec::new();
    for piece in bytes.chunks(cut) {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(reading));
    }
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder.counters())
}

/// The vectors of a protocol, as name, bytes and what they are to mean.
fn vectors(proto: &str) -> Vec<(String, Vec<u8>, serde_json::Value)> {
    let text = include_str!("../golden/devices/vectors.json");
    let all: Vec<serde_json::Value> = serde_json::from_str(text).expect("JSON");
    let of_it: Vec<_> = all
        .iter()
        .filter(|vector| vector["proto"] == proto)
        .map(|vector| {
            let hex = vector["hex"].as_str().expect("text").as_bytes().chunks(2);
            let byte = |digits| u8::from_str_radix(std::str::from_utf8(digits).expect("ASCII"), 16);
            let bytes = hex.map(|digits| byte(digits).expect("hexadecimal")).collect();
            (vector["name"].as_str().expect("text").to_owned(), bytes, vector["expect"].clone())
        })
        .collect();
    assert!(!of_it.is_empty(), "no vector of {proto}");
    of_it
}

/// The bytes of one vector.
fn vector(name: &str) -> Vec<u8> {
    let proto = name.split('/').next().expect("a name");
    let found = vectors(proto).into_iter().find(|(found, ..)| found == name);
    found.unwrap_or_else(|| panic!("no vector {name}")).1
}
