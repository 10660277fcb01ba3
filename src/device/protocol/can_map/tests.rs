mod dbc;
mod decoding;
mod mappings;

use super::*;

/// A ready mapping, compiled.
fn ready(name: &str) -> CanMap {
    let shipped = shipped_can_map(name).unwrap();
    CanMap::new(name, shipped.map, shipped.dbc_name, shipped.dbc).unwrap_or_else(|error| panic!("{error}"))
}

/// Pushes frames (identifier, extended, data); gives the readings.
fn push(decoder: &mut CanMapDecoder, frames: &[(u32, bool, Vec<u8>)]) -> Vec<ImuReading> {
    let mut readings = Vec::new();
    for (id, extended, data) in frames {
        let traffic = Traffic::CanFrame { id: *id, extended: *extended, data };
        decoder.push(traffic, &mut |reading| readings.push(reading));
    }
    readings
}
