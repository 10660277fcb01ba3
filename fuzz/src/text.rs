//! Text logs and the mappings that describe them.

use otolith::device::protocol::text::{KNOWN_LOGS, TextDecoder, TextMapping, known_log};

use crate::input::Input;
use crate::serial::decode;

/// A log, or a mapping, a zero byte and a log.
pub(crate) fn run(data: &[u8]) {
    let input = Input::read(data);
    let zero = input.stream.iter().position(|byte| *byte == 0);
    let (mapping, log) = match zero {
        Some(at) => (std::str::from_utf8(&input.stream[..at]).unwrap_or_default(), &input.stream[at + 1..]),
        None => (KNOWN_LOGS[usize::from(input.flags) % KNOWN_LOGS.len()].text, input.stream),
    };
    let Ok(mapping) = TextMapping::from_toml("mapping.toml", mapping) else { return };
    let whole = decode(&mut TextDecoder::new(&mapping), std::iter::once(log));
    let pieces = log.chunks(input.lengths().next().unwrap_or(1));
    assert_eq!(whole, decode(&mut TextDecoder::new(&mapping), pieces), "cuts make a difference");
    // Rows and lines are told in the same way by all that read them.
    let mut times = mapping.line_times();
    let rows =
        log.split(|byte| *byte == b'\n').filter(|line| times.time_of_line(line).is_some()).count() as u64;
    let counters = whole.counters;
    assert!(counters.packets <= rows, "{counters:?}: {rows} rows");
    if let Ok(checked) = mapping.check_rows("log", log) {
        assert!(counters.packets <= checked, "{counters:?}: {checked} rows");
    }
    drop(mapping.check_log("log", "mapping.toml", log));
    drop(known_log("log", log.split(|byte| *byte == b'\n').next().unwrap_or_default()));
}

/// A mapping that is accepted is written as one that says the same.
pub(crate) fn mapping(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(mapping) = TextMapping::from_toml("mapping.toml", text) else { return };
    let written = toml::to_string(&mapping).expect("a mapping can be written");
    assert_eq!(TextMapping::from_toml("written.toml", &written).expect("what was written reads"), mapping);
}
