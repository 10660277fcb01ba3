//! A CAN bus in words, and what a user can do about one that nobody understands.

use crate::device::protocol::can_map::{BusReport, IdReport, PartlyKnown};
use crate::device::protocol::detect::{Bus, detected_names};

/// What a bus without a sample is.
pub(super) fn in_words(bus: &BusReport) -> String {
    format!(
        "no sample was found: {} frames of {} identifiers, none of the CAN protocols {}",
        bus.frames,
        bus.identifiers.len(),
        detected_names(Bus::Can)
    )
}

/// One identifier in a line.
pub(super) fn id_line(found: &IdReport) -> String {
    let rate = found.rate_hz.map_or_else(String::new, |rate_hz| format!(", {rate_hz:.1} Hz"));
    let length = match (found.shortest_bytes, found.longest_bytes) {
        (shortest, longest) if shortest == longest => format!("{longest} bytes"),
        (shortest, longest) => format!("{shortest} to {longest} bytes"),
    };
    format!("id {:<8}  {} frames{rate}, {length}", found.id, found.frames)
}

/// What a user who has named no mapping can do with the `file` of this bus.
pub(super) fn advice(bus: &BusReport, file: &str) -> Vec<String> {
    let file = shell_word(file);
    let fitting = bus.fitting_maps.iter();
    let fitting: Vec<String> = fitting
        .map(|map| format!("the mapping {map} fits this bus: otolith inspect {file} --map {map}"))
        .collect();
    if !fitting.is_empty() {
        return fitting;
    }
    let partly: Vec<String> = bus.partly_known.iter().map(partly_text).collect();
    let partly = match partly.as_slice() {
        [] => String::new(),
        partly => format!(" (some identifiers are known to {}, but its frames differ)", partly.join(", to ")),
    };
    vec![format!(
        "no ready mapping fits{partly}; describe the sensor by a DBC file and a mapping (examples in configs/can): --map \
         FILE.toml --dbc FILE.dbc"
    )]
}

fn partly_text(known: &PartlyKnown) -> String {
    format!("{}: {}", known.map, known.identifiers.join(" "))
}

/// A word as a shell takes it.
fn shell_word(text: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "/._-+:@".contains(letter);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_is_a_command_or_what_is_needed_for_one() {
        let mut bus = BusReport { fitting_maps: vec!["sbg".to_owned()], ..BusReport::default() };
        assert!(advice(&bus, "my log.txt")[0].ends_with("otolith inspect 'my log.txt' --map sbg"));
        bus.fitting_maps.clear();
        assert!(advice(&bus, "x")[0].starts_with("no ready mapping fits; describe"));
        bus.partly_known.push(PartlyKnown { map: "sbg".to_owned(), identifiers: vec!["121".to_owned()] });
        let text = &advice(&bus, "x")[0];
        assert!(text.contains("known to sbg: 121, but") && text.contains("--dbc"), "{text}");
    }

    #[test]
    fn words_are_quoted_for_the_shell() {
        assert_eq!(shell_word("a/b-1.log"), "a/b-1.log");
        assert_eq!(shell_word("it's"), r"'it'\''s'");
    }
}
