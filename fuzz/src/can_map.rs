//! CAN frames as a DBC file and a mapping describe them.

use std::sync::OnceLock;

use otolith::device::protocol::can_map::{CAN_MAPS, CanMap, CanMapDecoder, ShippedCanMap};

use crate::can::decode;
use crate::seeds;

/// The maps that come with the program, compiled.
fn shipped() -> &'static [CanMap] {
    static MAPS: OnceLock<Vec<CanMap>> = OnceLock::new();
    let compile = |map: &ShippedCanMap| CanMap::new(map.name, map.map, map.dbc_name, map.dbc);
    MAPS.get_or_init(|| {
        CAN_MAPS.iter().map(compile).collect::<Result<_, _>>().expect("they come with the program")
    })
}

/// The first byte chooses one of them; frames follow.
pub(crate) fn run(data: &[u8]) {
    let Some((&number, frames)) = data.split_first() else { return };
    follow(&shipped()[usize::from(number) % shipped().len()], frames);
}

/// A mapping, a zero byte, a DBC file, a zero byte, frames.
pub(crate) fn files(data: &[u8]) {
    let mut parts = data.splitn(3, |byte| *byte == 0);
    let mut text = || std::str::from_utf8(parts.next().unwrap_or_default()).unwrap_or_default();
    let (mapping, dbc) = (text(), text());
    let Ok(map) = CanMap::new("map.toml", mapping, "map.dbc", dbc) else { return };
    assert!(
        map.messages()
            .all(|message| message.fits(message.id, message.extended) && !message.to_string().is_empty())
    );
    follow(&map, parts.next().unwrap_or_default());
}

fn follow(map: &CanMap, frames: &[u8]) {
    let once = decode(&mut CanMapDecoder::new(map), frames);
    assert_eq!(once, decode(&mut CanMapDecoder::new(map), frames), "the same frames say the same");
}

/// Each map with the frames of each vector.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let frames = seeds::can_frames();
    let with_map = |number: usize| frames.iter().map(move |input| [&[number as u8], &input[1..]].concat());
    (0..CAN_MAPS.len()).flat_map(with_map).collect()
}

/// Each map with its DBC file.
pub(crate) fn file_seeds() -> Vec<Vec<u8>> {
    let frames = seeds::can_frames();
    let with_frames = |(shipped, frames): (&ShippedCanMap, &Vec<u8>)| {
        [shipped.map.as_bytes(), &[0], shipped.dbc.as_bytes(), &[0], &frames[1..]].concat()
    };
    CAN_MAPS.iter().zip(frames.iter().cycle()).map(with_frames).collect()
}
