//! WitMotion on a serial line. Source: the vendor's `REG.h`; storborg/witmotion.
//!
//! Every command is `FF AA register low high`. None has an answer; what was done shows in the samples.

use super::{ConfigureError, Plan, Request, Step};
use crate::device::protocol::detect::WITMOTION;

/// Sample rates, Hz, with the code of each.
const RATES: [(f64, u8); 6] = [(10.0, 6), (20.0, 7), (50.0, 8), (100.0, 9), (125.0, 10), (200.0, 11)];
/// Baud rates with the code of each.
const BAUDS: [(u32, u8); 4] = [(9_600, 2), (115_200, 6), (230_400, 7), (921_600, 9)];
/// Time, accelerometer and gyroscope packets of 11 bytes each.
const BYTES_PER_SAMPLE: f64 = 33.0;

/// Registers that are written.
mod register {
    pub(super) const SAVE: u8 = 0x00;
    pub(super) const CONTENT: u8 = 0x02;
    pub(super) const RATE: u8 = 0x03;
    pub(super) const BAUD: u8 = 0x04;
}

/// Unlocks the registers for about 10 s.
const UNLOCK: [u8; 5] = [0xFF, 0xAA, 0x69, 0x88, 0xB5];
/// Content of the output: bit 0 time, bit 1 accelerometer, bit 2 gyroscope.
const TIME_ACCELEROMETER_GYROSCOPE: u8 = 0b111;

/// The commands for `request`: unlock, output of time, accelerometer and gyroscope alone, rate, and where asked for
/// baud rate and saving.
///
/// # Errors
/// [`ConfigureError::NotOffered`] for a rate or baud rate that has no code, and for no rate at all: the device does
/// not say the one it has, so whether its line can carry the samples could not be told.
pub fn plan(request: &Request) -> Result<Plan, ConfigureError> {
    let rate = request.rate_hz.and_then(|asked| RATES.into_iter().find(|(rate_hz, _)| *rate_hz == asked));
    let Some((rate_hz, rate_code)) = rate else {
        let got = request.rate_hz.map_or_else(|| "(none)".to_owned(), |rate_hz| rate_hz.to_string());
        return Err(not_offered("rate", got, RATES.map(|(rate_hz, _)| rate_hz.to_string()).join(", ")));
    };
    let mut steps = vec![
        Step {
            what: "unlock the registers".to_owned(),
            bytes: UNLOCK.to_vec(),
            answer: None,
            baud_after: None,
        },
        write("send time, accelerometer and gyroscope", register::CONTENT, TIME_ACCELEROMETER_GYROSCOPE),
        write(&format!("{rate_hz} samples/s"), register::RATE, rate_code),
    ];
    if let Some(asked) = request.baud {
        let Some((baud, code)) = BAUDS.into_iter().find(|(baud, _)| *baud == asked) else {
            return Err(not_offered(
                "baud",
                asked.to_string(),
                BAUDS.map(|(baud, _)| baud.to_string()).join(", "),
            ));
        };
        steps.push(Step { baud_after: Some(baud), ..write(&format!("{baud} baud"), register::BAUD, code) });
    }
    if request.save {
        steps.push(write("save the settings", register::SAVE, 0));
    }
    Ok(Plan { steps, rate_hz, bytes_per_sample: BYTES_PER_SAMPLE })
}

fn write(what: &str, register: u8, value: u8) -> Step {
    Step {
        what: what.to_owned(),
        bytes: vec![0xFF, 0xAA, register, value, 0],
        answer: None,
        baud_after: None,
    }
}

fn not_offered(key: &'static str, got: String, expected: String) -> ConfigureError {
    let hint = format!("give {key} one of these values");
    ConfigureError::NotOffered { protocol: WITMOTION, key, got, expected, hint }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_changed_or_saved_that_was_not_asked_for() {
        let request = Request { rate_hz: Some(100.0), ..Request::default() };
        let plan = plan(&request).unwrap();
        assert_eq!((plan.steps.len(), plan.rate_hz, plan.bytes_per_sample), (3, 100.0, 33.0));
        assert!(plan.steps.iter().all(|step| step.baud_after.is_none() && step.answer.is_none()));
    }

    #[test]
    fn what_has_no_code_is_refused_with_what_there_is() {
        let refuse = |rate_hz, baud| plan(&Request { rate_hz, baud, save: true }).unwrap_err().to_string();
        for (text, parts) in [
            (refuse(Some(1000.0), None), ["rate=1000", "expected 10, 20, 50, 100, 125, 200"]),
            (refuse(None, Some(9600)), ["rate=(none)", "\n\nhint: "]),
            (refuse(Some(f64::NAN), None), ["rate=NaN", "witmotion"]),
            (refuse(Some(10.0), Some(57_600)), ["baud=57600", "expected 9600, 115200, 230400, 921600"]),
        ] {
            for part in parts {
                assert!(text.contains(part), "{part} is missing in: {text}");
            }
        }
    }
}
