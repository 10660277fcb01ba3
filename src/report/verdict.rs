//! One sentence on how both characters fared.

use super::metrics::{CharacterMetrics, Windows};
use super::trace::{Character, Trace};

/// A sway that never exceeds this is standing still, deg (the limit the perfectly perceiving character keeps).
const STILL_DEG: f64 = 0.3;
/// Steadied: the sway of the last seconds stays below this part of the peak.
const STEADY_OF_PEAK: f64 = 0.5;
/// Length of the end of the run that shows whether a character steadied, s.
const LAST_S: f64 = 2.0;

/// For example "green swayed up to 6.0 deg and steadied; blue stayed balanced".
pub fn sentence(
    trace: &Trace,
    windows: &Windows,
    green: &CharacterMetrics,
    blue: &CharacterMetrics,
) -> String {
    let green = fared(trace, windows, green, Character::Green);
    let blue = fared(trace, windows, blue, Character::Blue);
    if green == blue { format!("green and blue {green}") } else { format!("green {green}; blue {blue}") }
}

fn fared(trace: &Trace, windows: &Windows, metrics: &CharacterMetrics, character: Character) -> String {
    if let Some(fell_at_s) = metrics.fell_at_s {
        return fell(windows, fell_at_s);
    }
    let Some(peak_deg) = metrics.peak_com_sway_deg else {
        return "stood".into();
    };
    if peak_deg < STILL_DEG {
        return "stayed balanced".into();
    }
    let end = if last_sway_deg(trace, character) < STEADY_OF_PEAK * peak_deg {
        "steadied"
    } else {
        "still swayed at the end"
    };
    format!("swayed up to {peak_deg:.1} deg and {end}")
}

fn fell(windows: &Windows, fell_at_s: f64) -> String {
    if let Some(spin) = windows.in_spin.iter().find(|spin| spin.contains(fell_at_s)) {
        return format!("fell {:.1} s into the spin", fell_at_s - spin.start_s);
    }
    let ends = windows.in_spin.iter().map(|spin| (spin.end_s, "stop"));
    let ends = ends.chain(windows.push_end_s.map(|end_s| (end_s, "push")));
    let cause = ends.filter(|(end_s, _)| *end_s <= fell_at_s).max_by(|a, b| a.0.total_cmp(&b.0));
    match cause {
        Some((end_s, name)) => format!("fell {:.1} s after the {name}", fell_at_s - end_s),
        None => format!("fell at {fell_at_s:.1} s"),
    }
}

/// Largest sway in the last seconds of the run, deg.
fn last_sway_deg(trace: &Trace, character: Character) -> f64 {
    let Some((_, end_s)) = trace.span_s() else {
        return 0.0;
    };
    let last = trace.rows().iter().rev().take_while(|row| row.tick.time_s() > end_s - LAST_S);
    last.fold(0.0, |peak: f64, row| peak.max(f64::from(row.of(character).com_sway).to_degrees()))
}
