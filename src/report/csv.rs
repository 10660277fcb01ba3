//! The data behind a figure, one row per 10 ms and character.

use std::io::Write;

use csv::Writer;

use super::name_of;
use super::trace::{Character, Row, Trace};
use crate::time::TICK_NS;
use crate::units::DEG_PER_RAD;

/// From one written row to the next, ticks.
const ROW_TICKS: u64 = 10_000_000 / TICK_NS;
const COLUMNS: [&str; 13] = [
    "run",
    "character",
    "time_s",
    "com_sway_deg",
    "gravity_tilt_deg",
    "foot_tilt_deg",
    "com_x_m",
    "com_y_m",
    "cop_x_m",
    "cop_y_m",
    "omega_hat_z_rad_s",
    "chair_rate_rad_s",
    "down",
];

/// One character of one run.
#[derive(Clone, Copy, Debug)]
pub struct Curve<'a> {
    /// Name of the run, the first column.
    pub run: &'a str,
    /// The run.
    pub trace: &'a Trace,
    /// Which of its characters.
    pub character: Character,
}

/// Writes `curves` under each other with one header: for each the first row of every 10 ms of its trace.
///
/// Units are in the column names; positions are relative to the support centroid in turntable axes (x forward, y
/// left). A field is empty where there is nothing: centre of pressure without contact, rate without measurement.
/// `down` is 1 while the character lies on the ground after a fall, else 0.
///
/// # Errors
/// `out` does not take the bytes.
pub fn write<'a>(out: impl Write, curves: impl IntoIterator<Item = Curve<'a>>) -> Result<(), csv::Error> {
    let mut writer = Writer::from_writer(out);
    writer.write_record(COLUMNS)?;
    for curve in curves {
        let mut written = None;
        for row in curve.trace.rows() {
            let slot = Some(row.tick.0 / ROW_TICKS);
            if slot != written {
                writer.write_record(fields(&curve, row))?;
                written = slot;
            }
        }
    }
    writer.flush()?;
    Ok(())
}

fn fields(curve: &Curve, row: &Row) -> [String; COLUMNS.len()] {
    let character = row.of(curve.character);
    [
        curve.run.into(),
        name_of(curve.character).into(),
        number(row.tick.time_s(), 3),
        number(f64::from(character.com_sway) * DEG_PER_RAD, 4),
        number(f64::from(character.gravity_tilt) * DEG_PER_RAD, 4),
        number(f64::from(character.foot_tilt) * DEG_PER_RAD, 4),
        number(character.com[0].into(), 6),
        number(character.com[1].into(), 6),
        number(character.cop[0].into(), 6),
        number(character.cop[1].into(), 6),
        number(character.omega_hat_z.into(), 6),
        number(row.chair_rate.into(), 6),
        u8::from(character.down).to_string(),
    ]
}

/// A number with fixed decimals, without a sign when that leaves zero; empty for what is not finite.
fn number(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let text = format!("{value:.decimals$}");
    let is_zero = text.trim_start_matches('-').chars().all(|digit| matches!(digit, '0' | '.'));
    if is_zero { text.trim_start_matches('-').into() } else { text }
}
