//! The byte layouts against their tables and against themselves.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use proptest::prelude::*;

use super::super::cdr::DecodeError;
use super::super::layout;
use super::{Bits, bits};
use crate::device::Traffic;
use crate::imu::HeadSample;
use crate::tick::TickOutput;
use crate::time::HostTime;
use crate::vestibular::HeadMotion;

#[test]
fn the_schema_texts_are_the_tables_of_the_layouts() {
    let (input, output) = Bits(1).tick(5);
    let mut fields = Schema::default();
    layout::input_fields(&input, &mut fields);
    assert_eq!(fields.paths, schema_fields(include_str!("../msg/TickInput.msg")));
    let mut fields = Schema::default();
    layout::output_fields(&output, &mut fields);
    assert_eq!(fields.paths, schema_fields(include_str!("../msg/TickOutput.msg")));
}

/// Paths and types of the fields as the layout writes them.
#[derive(Default)]
struct Schema {
    scope: Vec<&'static str>,
    paths: Vec<String>,
}

impl Schema {
    fn note(&mut self, kind: &str, name: &'static str) {
        self.paths.push(format!("{kind} {}", [self.scope.as_slice(), &[name]].concat().join(".")));
    }
}

impl layout::FieldSink for Schema {
    fn u8(&mut self, name: &'static str, _: u8) {
        self.note("uint8", name);
    }
    fn u64(&mut self, name: &'static str, _: u64) {
        self.note("uint64", name);
    }
    fn f64(&mut self, name: &'static str, _: f64) {
        self.note("float64", name);
    }
    fn enter(&mut self, name: &'static str) {
        self.scope.push(name);
    }
    fn leave(&mut self) {
        self.scope.pop();
    }
}

/// Paths and types of the basic fields of a message definition, in order.
fn schema_fields(text: &str) -> Vec<String> {
    fn expand(types: &BTreeMap<&str, Vec<(&str, &str)>>, kind: &str, prefix: &str, out: &mut Vec<String>) {
        for (field_kind, name) in &types[kind] {
            let path = format!("{prefix}{name}");
            match *field_kind {
                "bool" => out.push(format!("uint8 {path}")),
                basic @ ("uint8" | "uint64" | "float64") => out.push(format!("{basic} {path}")),
                nested => {
                    let nested = nested.rsplit('/').next().unwrap();
                    expand(types, nested, &format!("{path}."), out);
                }
            }
        }
    }
    let mut types: BTreeMap<&str, Vec<(&str, &str)>> = BTreeMap::new();
    let mut current = "";
    for line in text.lines() {
        let line = line.split('#').next().unwrap().trim();
        if let Some(name) =
            line.strip_prefix("MSG: otolith_msgs/").or(line.strip_prefix("MSG: geometry_msgs/"))
        {
            current = name;
        } else if let Some((kind, name)) = line.split_once(' ') {
            types.entry(current).or_default().push((kind, name.trim()));
        }
    }
    let mut out = Vec::new();
    expand(&types, "", "", &mut out);
    out
}

#[test]
fn the_lengths_are_those_of_the_tables() {
    let (input, output) = Bits(1).tick(5);
    let mut bytes = Vec::new();
    layout::encode_input(&mut bytes, &input);
    assert_eq!(bytes.len(), 68);
    assert_eq!(bytes[12..20], 5_u64.to_le_bytes());
    layout::encode_output(&mut bytes, &output);
    assert_eq!(bytes.len(), 407);
    for (start, character) in [(44, &output.green), (228, &output.blue)] {
        assert_eq!(bytes[start + 152..][..8], character.foot_tilt.to_le_bytes());
        assert_eq!(bytes[start + 168..][..8], character.state_hash.to_le_bytes());
    }
}

#[test]
fn an_imu_sample_has_the_bytes_of_ros() {
    let motion =
        HeadMotion { omega_head: Vector3::new(1.0, 2.0, 3.0), gif_head: Vector3::new(-4.0, -5.0, -6.0) };
    let sample = HeadSample { at: HostTime(3_000_000_007), motion };
    let mut bytes = Vec::new();
    layout::encode_imu(&mut bytes, &sample);
    // 4 encapsulation, 8 stamp, 4 + 6 "chair\0", 6 to align, then 37 doubles.
    assert_eq!(bytes.len(), 4 + 24 + 37 * 8);
    assert_eq!(bytes[4..22], *b"\x03\0\0\0\x07\0\0\0\x06\0\0\0chair\0");
    let double = |index: usize| f64::from_le_bytes(bytes[28 + 8 * index..][..8].try_into().unwrap());
    assert_eq!([double(3), double(4), double(5)], [1.0, -1.0, 0.0]);
    assert_eq!([double(13), double(15), double(25), double(27)], [1.0, 3.0, 4.0, 6.0]);
}

#[test]
fn another_layout_version_is_named() {
    let mut bytes = Vec::new();
    layout::encode_input(&mut bytes, &Bits(1).tick(5).0);
    bytes[4] = 1;
    assert_eq!(layout::decode_input(&bytes), Err(DecodeError::Layout { got: 1, expected: 2 }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn ticks_keep_their_bits(seed: u64, tick: u64) {
        let (input, output) = Bits(seed).tick(tick);
        let mut bytes = Vec::new();
        layout::encode_input(&mut bytes, &input);
        let input_again = layout::decode_input(&bytes).unwrap();
        layout::encode_output(&mut bytes, &output);
        let output_again = layout::decode_output(&bytes).unwrap();
        prop_assert_eq!(bits(&input_again, &output_again), bits(&input, &output));
        prop_assert_eq!(input_again.chair.is_some(), input.chair.is_some());
        prop_assert_eq!(output_again.green.cop_platform.is_some(), output.green.cop_platform.is_some());
        let y = |output: &TickOutput| output.blue.com_platform.y.to_bits();
        prop_assert_eq!(y(&output_again), y(&output));
    }

    #[test]
    fn traffic_keeps_its_bytes(data: Vec<u8>, id: u32, extended: bool) {
        for traffic in [Traffic::Bytes(&data), Traffic::CanFrame { id, extended, data: &data }] {
            let mut bytes = Vec::new();
            layout::encode_traffic(&mut bytes, traffic);
            prop_assert_eq!(layout::decode_traffic(&bytes), Ok(traffic));
        }
    }
}
