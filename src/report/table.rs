//! The summary for a person: a few lines and one table for the terminal.

use std::fmt::Write as _;
use std::io::IsTerminal;

use super::metrics::CharacterMetrics;
use super::summary::{LinkCounters, Summary};
use crate::units::RAD_S_PER_RPM;

const GREEN: &str = "\x1b[32m";
const BLUE: &str = "\x1b[34m";
const BOLD: &str = "\x1b[1m";
const RESET: &str = "\x1b[0m";

/// Whether text for stdout should be coloured: it is a terminal and `NO_COLOR` is unset or empty.
pub fn stdout_takes_colour() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// The summary as text, at most 80 columns where names allow, ending with a newline.
///
/// `colour` adds ANSI colours and changes nothing else: every column is labelled.
pub fn render(summary: &Summary, colour: bool) -> String {
    let mut out = String::new();
    let paint = |code: &'static str, text: String| {
        if colour { format!("{code}{text}{RESET}") } else { text }
    };
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "{}  {:.1} s, {} samples",
        paint(BOLD, summary.source.clone()),
        summary.duration_s,
        summary.samples
    );
    out.push_str(&chair_lines(summary));
    out.push_str(&link_line(&summary.link));
    if let Some(alignment) = &summary.alignment {
        let _ = writeln!(out, "sensor  {}", sensor_line(alignment));
    }
    let timing = &summary.timing;
    let _ = writeln!(
        out,
        "ticks   {}, {:.1} x real time, {:.0} us median, {:.0} us max, {} overruns{}",
        timing.ticks,
        timing.realtime_factor,
        timing.tick_us.p50,
        timing.tick_us.max,
        timing.overruns,
        timing
            .max_sample_age_ms
            .map_or_else(String::new, |age| format!("\nage     newest sample {age:.0} ms at most"))
    );
    let heading = |code, name: &str| paint(code, format!("{name:>14}"));
    let _ = writeln!(out, "\n{:<34}{}{}", "", heading(GREEN, "green"), heading(BLUE, "blue"));
    for (label, green, blue) in rows(&summary.green, &summary.blue) {
        let _ = writeln!(
            out,
            "{label:<34}{}{}",
            paint(GREEN, format!("{green:>14}")),
            paint(BLUE, format!("{blue:>14}"))
        );
    }
    let _ = writeln!(out, "\n{}", paint(BOLD, format!("{}.", summary.verdict)));
    for event in &summary.events {
        let _ = writeln!(out, "- {event}");
    }
    for (label, file) in [("recording", &summary.recording), ("figure", &summary.figure)] {
        if let Some(file) = file {
            let _ = writeln!(out, "{label:<10}{file}");
        }
    }
    out
}

fn chair_lines(summary: &Summary) -> String {
    let chair = &summary.chair;
    let mut out =
        format!("chair   peak {:.1} rpm, turned {} deg\n", chair.peak_rate_rpm, tenths(chair.turned_deg));
    for spin in &chair.spins {
        let stop = match spin.stop_s {
            Some(stop_s) => format!("{stop_s:.2} s"),
            None => "the end".into(),
        };
        let _ = writeln!(out, "spin    {:.1} rpm from {:.2} s to {stop}", spin.rate_rpm, spin.start_s);
    }
    out
}

/// What the first second said about the sensor, and what could not be had from it.
fn sensor_line(alignment: &serde_json::Value) -> String {
    let flag = |key: &str| alignment[key].as_bool().unwrap_or(false);
    let number = |key: &str| alignment[key].as_f64();
    let mut parts = Vec::new();
    if flag("at_rest") {
        parts.push("rested at the start".to_owned());
    } else {
        parts.push("did not rest at the start: no bias, tilt or scale is taken from it".to_owned());
    }
    if let Some(tilt) = number("mount_tilt_deg") {
        let removed = if flag("levelled") { "removed" } else { "not removed" };
        parts.push(format!("mounting tilt {tilt:.2} deg {removed}"));
    }
    if flag("heading_arbitrary") {
        parts.push("forward and left are not known: give a mount".to_owned());
    }
    if flag("scale_refused") {
        parts.push(format!(
            "at rest it reads {:.2} m/s2: not believed",
            number("rest_norm_m_s2").unwrap_or(0.0)
        ));
    } else if flag("at_rest") && !flag("accelerometer_missing") {
        parts.push(format!("specific force scaled by {:.4}", number("scale").unwrap_or(1.0)));
    }
    if flag("accelerometer_missing") {
        parts.push("no accelerometer: upright rest is put in its place".to_owned());
    }
    parts.join(", ")
}

/// One decimal, never a negative zero.
fn tenths(value: f64) -> String {
    format!("{:.1}", (value * 10.0).round() / 10.0 + 0.0)
}

/// The link's counters, those of trouble only where there was some; nothing for a run without a link.
fn link_line(link: &LinkCounters) -> String {
    if *link == LinkCounters::default() {
        return String::new();
    }
    let mut out = format!("link    {} packets", link.packets);
    let troubles = [
        (link.bad_checksum, "bad checksums"),
        (link.bytes_skipped, "bytes skipped"),
        (link.missing, "missing"),
        (link.gaps, "gaps"),
        (link.dropped, "dropped"),
    ];
    for (count, name) in troubles.into_iter().filter(|(count, _)| *count > 0) {
        let _ = write!(out, ", {count} {name}");
    }
    out.push('\n');
    out
}

/// The rows of the table: label with unit, green's value, blue's value.
fn rows(green: &CharacterMetrics, blue: &CharacterMetrics) -> Vec<(&'static str, String, String)> {
    let both = |label, show: &dyn Fn(&CharacterMetrics) -> Option<String>| {
        let shown = |metrics| show(metrics).unwrap_or_else(|| "-".into());
        (label, shown(green), shown(blue))
    };
    let fixed = |value: Option<f64>, decimals: usize| value.map(|value| format!("{value:.decimals$}"));
    vec![
        both("fell at (s)", &|m| fixed(m.fell_at_s, 2)),
        both("peak gravity tilt in spin (deg)", &|m| fixed(m.peak_gravity_tilt_in_spin_deg, 2)),
        both("peak gravity tilt (deg)", &|m| fixed(m.peak_gravity_tilt_deg, 2)),
        both("peak CoM sway (deg)", &|m| fixed(m.peak_com_sway_deg, 2)),
        both("peak foot tilt (deg)", &|m| fixed(m.peak_foot_tilt_deg, 2)),
        both("recovery, tilt < 0.5 deg (s)", &|m| fixed(m.recovery_s, 1)),
        both("CoM range, forward x left (mm)", &|m| {
            m.com_range_after_stop_m.map(|[x, y]| format!("{:.1} x {:.1}", 1e3 * x, 1e3 * y))
        }),
        both("CoP path (mm)", &|m| fixed(m.cop_path_m.map(|path| 1e3 * path), 1)),
        both("CoP 95 % ellipse (mm2)", &|m| fixed(m.cop_ellipse_95_m2.map(|area| 1e6 * area), 1)),
        both("CoP within 5 mm (% of ticks)", &|m| {
            fixed(m.cop_within_5mm_after_stop.map(|share| 1e2 * share), 1)
        }),
        both("believed rate at stop (rpm)", &|m| {
            fixed(m.omega_hat_at_stop_rad_s.map(|rate| rate / RAD_S_PER_RPM), 1)
        }),
    ]
}
