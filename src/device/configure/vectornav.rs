//! VectorNav: one binary output with time, specific force and angular rate, and nothing else on the line.
//!
//! | register | written | means |
//! |---|---|---|
//! | 06 | 0 | no ASCII output |
//! | 05 | baud | baud rate of this port; the answer still comes at the old one |
//! | 75 | 1, divisor, 05, 0001, 0600 | binary output 1 on port 1 at 800 Hz / divisor: TimeStartup, Accel, AngularRate |
//! | - | `VNWNV` | keep everything when the power goes off |
//!
//! Source: `devices.md` 3.3.

use super::{Answer, ConfigureError, Plan, Request, Step};
use crate::device::protocol::detect::VECTORNAV;
use crate::device::protocol::vectornav::ascii::{bodies, error_code, error_meaning, sentence};

/// Rate of the inertial sensor, which outputs divide, Hz.
const SENSOR_HZ: f64 = 800.0;
/// Rate where none is asked for: 40 bytes a sample fill the factory's 115200 baud to 69 %.
const USUAL_HZ: f64 = 200.0;
/// Largest share by which a rate may differ from 800 Hz / divisor.
const RATE_TOLERANCE: f64 = 1e-6;
const BAUDS: [u32; 9] = [9600, 19200, 38400, 57600, 115_200, 128_000, 230_400, 460_800, 921_600];
/// Sync, groups, two masks, u64, 6 × f32, checksum.
const BYTES_PER_SAMPLE: f64 = (1 + 1 + 4 + 8 + 24 + 2) as f64;

/// The commands for `request`. Without a rate, 200 Hz; without a baud rate, that of the device stays.
///
/// # Errors
/// [`ConfigureError::NotOffered`] for a rate that is not 800 Hz divided by a whole number, or a baud rate the device
/// does not have.
pub fn plan(request: &Request) -> Result<Plan, ConfigureError> {
    let rate_hz = request.rate_hz.unwrap_or(USUAL_HZ);
    let divisor = divisor(rate_hz)?;
    let mut steps = vec![step("switch the ASCII output off", "VNWRG,06,0", ascii_off)];
    if let Some(baud) = request.baud {
        if !BAUDS.contains(&baud) {
            return Err(not_offered("baud", baud.to_string(), list(&BAUDS), nearest_baud(baud)));
        }
        let what = format!("set {baud} baud");
        let mut step = step(&what, &format!("VNWRG,05,{baud}"), baud_set);
        step.baud_after = Some(baud);
        steps.push(step);
    }
    let what = format!("send time, specific force and angular rate at {} Hz", SENSOR_HZ / f64::from(divisor));
    steps.push(step(&what, &format!("VNWRG,75,1,{divisor},05,0001,0600"), output_set));
    if request.save {
        steps.push(step("save the settings", "VNWNV", saved));
    }
    Ok(Plan { steps, rate_hz: SENSOR_HZ / f64::from(divisor), bytes_per_sample: BYTES_PER_SAMPLE })
}

fn step(what: &str, body: &str, answer: fn(&[u8]) -> Answer) -> Step {
    Step { what: what.to_owned(), bytes: sentence(body), answer: Some(answer), baud_after: None }
}

/// The divisor of 800 Hz that gives `rate_hz`.
fn divisor(rate_hz: f64) -> Result<u16, ConfigureError> {
    let exact = SENSOR_HZ / rate_hz;
    let whole = exact.round().clamp(1.0, SENSOR_HZ);
    if (exact - whole).abs() <= RATE_TOLERANCE * whole {
        return Ok(whole as u16);
    }
    // NaN and negative rates come here with a nearest divisor of their own making: the slowest.
    let nearest = if exact.is_finite() { SENSOR_HZ / whole } else { 1.0 };
    let expected =
        "800 Hz divided by a whole number up to 800: 800, 400, 200, 160, 100, 80, 50, 40, ..".to_owned();
    Err(not_offered("rate", format!("{rate_hz}"), expected, format!("ask for {nearest}")))
}

fn not_offered(key: &'static str, got: String, expected: String, hint: String) -> ConfigureError {
    ConfigureError::NotOffered { protocol: VECTORNAV, key, got, expected, hint }
}

fn list(bauds: &[u32]) -> String {
    bauds.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
}

fn nearest_baud(baud: u32) -> String {
    let nearest = BAUDS.iter().min_by_key(|offered| offered.abs_diff(baud)).copied().unwrap_or_default();
    format!("ask for {nearest}")
}

fn ascii_off(received: &[u8]) -> Answer {
    answered(received, b"VNWRG,06")
}

fn baud_set(received: &[u8]) -> Answer {
    answered(received, b"VNWRG,05")
}

fn output_set(received: &[u8]) -> Answer {
    answered(received, b"VNWRG,75")
}

fn saved(received: &[u8]) -> Answer {
    answered(received, b"VNWNV")
}

/// Looks for the echo of a command or an error in what came since it was sent. The first of the two counts.
fn answered(received: &[u8], echo: &[u8]) -> Answer {
    for body in bodies(received) {
        if let Some(code) = error_code(body) {
            let meaning = error_meaning(code).unwrap_or("in no manual");
            return Answer::Refused(format!("error {code}: {meaning}"));
        }
        if body.starts_with(echo) {
            return Answer::Done;
        }
    }
    Answer::NotYet
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(step: &Step) -> String {
        String::from_utf8(step.bytes.clone()).expect("ASCII")
    }

    /// The constructed vectors of `devices/vectors.json`.
    #[test]
    fn commands_are_those_of_the_document() {
        let request = Request { rate_hz: Some(400.0), baud: Some(921_600), save: true };
        let plan = plan(&request).expect("offered");
        let commands: Vec<String> = plan.steps.iter().map(text).collect();
        let expected = [
            "$VNWRG,06,0*6C\r\n",
            "$VNWRG,05,921600*53\r\n",
            "$VNWRG,75,1,2,05,0001,0600*59\r\n",
            "$VNWNV*57\r\n",
        ];
        assert_eq!(commands, expected);
        assert_eq!((plan.rate_hz, plan.bytes_per_sample), (400.0, 40.0));
        let bauds: Vec<_> = plan.steps.iter().map(|step| step.baud_after).collect();
        assert_eq!(bauds, [None, Some(921_600), None, None]);
    }

    #[test]
    fn nothing_is_saved_and_no_baud_rate_changed_unasked() {
        let plan = plan(&Request::default()).expect("offered");
        let commands: Vec<String> = plan.steps.iter().map(text).collect();
        assert_eq!(commands, ["$VNWRG,06,0*6C\r\n", "$VNWRG,75,1,4,05,0001,0600*5F\r\n"]);
        assert_eq!(plan.rate_hz, 200.0);
    }

    #[test]
    fn rates_are_those_that_divide_the_sensor_s() {
        for (rate_hz, expected) in [(800.0, 1), (400.0, 2), (100.0, 8), (1.0, 800), (800.0 / 3.0, 3)] {
            assert_eq!(divisor(rate_hz).expect("offered"), expected);
        }
        for rate_hz in [0.0, -100.0, 0.5, 300.0, 801.0, 1000.0, f64::NAN, f64::INFINITY] {
            let error = divisor(rate_hz).expect_err("not offered").to_string();
            assert!(error.contains("--configure rate=") && error.contains("800, 400"), "{error}");
        }
        assert!(
            divisor(300.0).expect_err("between").to_string().ends_with("hint: ask for 266.6666666666667")
        );
        let request = Request { baud: Some(250_000), ..Request::default() };
        let error = plan(&request).expect_err("not offered").to_string();
        assert!(error.contains("baud=250000") && error.ends_with("hint: ask for 230400"), "{error}");
    }

    #[test]
    fn answers_are_found_among_data() {
        let data: Vec<u8> = (0..=255).cycle().take(700).collect();
        let among = |answer: &str| [&data[..], answer.as_bytes(), &data].concat();
        assert_eq!(output_set(&among("")), Answer::NotYet);
        assert_eq!(output_set(&among("$VNWRG,75,1,2,05,0001,0600*59\r\n")), Answer::Done);
        // The same with the 16-bit checksum.
        assert_eq!(output_set(&among("$VNWRG,75,1,2,05,0001,0600*59")), Answer::NotYet, "its end is missing");
        assert_eq!(ascii_off(&among("$VNWRG,75,1,2,05,0001,0600*59\r\n")), Answer::NotYet);
        assert_eq!(output_set(&among("$VNWRG,75,1,2,05,0001,0600*58\r\n")), Answer::NotYet, "damaged");
        let Answer::Refused(why) = baud_set(&among("$VNERR,07*76\r\n")) else { panic!("refused") };
        assert!(why.contains("error 7"), "{why}");
        assert_eq!(saved(&among("$VNWNV*57\r\n")), Answer::Done);
    }
}
