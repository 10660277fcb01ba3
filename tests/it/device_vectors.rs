//! Packets of foreign devices against the values they stand for. Where each packet comes from is in
//! `tests/golden/devices/vectors.json`: a real capture, a document, or constructed after one.

mod bno08x;
mod openimu;
mod witmotion;

use nalgebra::Vector3;
use otolith::device::Traffic;
use otolith::device::protocol::{ImuReading, PacketDecoder};
use serde_json::Value;

/// The vector called `name`.
fn vector(name: &str) -> Value {
    let text = include_str!("../golden/devices/vectors.json");
    let vectors: Vec<Value> = serde_json::from_str(text).unwrap();
    vectors.into_iter().find(|vector| vector["name"] == name).unwrap_or_else(|| panic!("no vector {name}"))
}

/// The bytes of a vector.
fn bytes_of(vector: &Value) -> Vec<u8> {
    from_hex(vector["hex"].as_str().unwrap())
}

pub(crate) fn from_hex(digits: &str) -> Vec<u8> {
    let digits = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

/// What a decoder makes of bytes and their end.
fn decode(decoder: &mut dyn PacketDecoder, bytes: &[u8]) -> Vec<ImuReading> {
    let mut readings = Vec::new();
    decoder.push(Traffic::Bytes(bytes), &mut |reading| readings.push(reading));
    decoder.finish(&mut |reading| readings.push(reading));
    readings
}

/// The three numbers below `key` among the expected values.
fn three(vector: &Value, key: &str) -> Vector3<f64> {
    let values = vector["expect"][key].as_array().unwrap_or_else(|| panic!("no {key}"));
    Vector3::from_iterator(values.iter().map(|value| value.as_f64().unwrap()))
}

/// The number below `key` among the expected values.
fn one(vector: &Value, key: &str) -> f64 {
    vector["expect"][key].as_f64().unwrap_or_else(|| panic!("no {key}"))
}
