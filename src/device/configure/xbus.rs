//! Commands to Xsens (Movella) MTi devices on a serial line.
//!
//! | MID | command | data | answer |
//! |---|---|---|---|
//! | 30 | GoToConfig | none | 31 |
//! | C0 | SetOutputConfiguration | entries of data identifier and rate | C1 with the rates the device has made of them |
//! | 18 | SetBaudrate | code | 19; in force after the next start |
//! | 40 | Reset | none | 41, then a start with what was set |
//! | 10 | GoToMeasurement | none | 11 |
//!
//! Error (42) with a code is a refusal. A device keeps every one of these settings over a power cycle: it has no others.
//!
//! Source: MT Low Level Communication Protocol Documentation (MT0101P), sections 5.2 and 5.3.

use super::{Answer, ConfigureError, Plan, Request, Step};
use crate::device::protocol::detect::XBUS;
use crate::device::protocol::xbus::error_text;
use crate::device::protocol::xbus::frame::{ERROR, Message, each_message, message};

mod output;

pub use output::{Output, OutputConfiguration};

const GO_TO_CONFIG: u8 = 0x30;
const SET_OUTPUT_CONFIGURATION: u8 = 0xC0;
const SET_BAUD_RATE: u8 = 0x18;
const RESET: u8 = 0x40;
const GO_TO_MEASUREMENT: u8 = 0x10;

const PACKET_COUNTER: u16 = 0x1020;
const SAMPLE_TIME_FINE: u16 = 0x1060;
const ACCELERATION: u16 = 0x4020;
const RATE_OF_TURN: u16 = 0x8020;
/// With every packet.
const EVERY_PACKET: u16 = 0xFFFF;

/// Rate without one in the request, Hz: that of a new device.
const USUAL_RATE_HZ: f64 = 100.0;
/// A message of 47 bytes: its frame 5, packet counter 5, time 7, acceleration and rate of turn 15 each.
const BYTES_PER_SAMPLE: f64 = 47.0;

type Judge = fn(&[u8]) -> Answer;

/// Rates of acceleration and rate of turn, Hz: 400 and what divides it. An MTi-1 goes up to 100 and says so.
const RATES: [(u16, Judge); 15] = [
    (1, runs_at::<1>),
    (2, runs_at::<2>),
    (4, runs_at::<4>),
    (5, runs_at::<5>),
    (8, runs_at::<8>),
    (10, runs_at::<10>),
    (16, runs_at::<16>),
    (20, runs_at::<20>),
    (25, runs_at::<25>),
    (40, runs_at::<40>),
    (50, runs_at::<50>),
    (80, runs_at::<80>),
    (100, runs_at::<100>),
    (200, runs_at::<200>),
    (400, runs_at::<400>),
];

/// Baud rates and their codes.
const BAUD_CODES: [(u32, u8); 11] = [
    (9_600, 0x09),
    (19_200, 0x07),
    (38_400, 0x05),
    (57_600, 0x04),
    (115_200, 0x02),
    (230_400, 0x01),
    (460_800, 0x00),
    (921_600, 0x80),
    (2_000_000, 0x0C),
    (3_500_000, 0x0E),
    (4_000_000, 0x0D),
];

/// The commands that make a device send packet counter, time, acceleration and rate of turn at one rate.
///
/// Without a rate in the request it is 100 Hz.
///
/// # Errors
/// [`ConfigureError::NotOffered`] for a rate or baud rate there is not, and for a request that does not ask to save:
/// the device saves all the same.
pub fn plan(request: &Request) -> Result<Plan, ConfigureError> {
    let rate_hz = request.rate_hz.unwrap_or(USUAL_RATE_HZ);
    let Some(&(rate, runs_at_it)) = RATES.iter().find(|(rate, _)| f64::from(*rate) == rate_hz) else {
        let expected = RATES.map(|(rate, _)| rate.to_string()).join(", ");
        return Err(refusal("rate", format!("{rate_hz}"), expected, "ask for one of these, in Hz"));
    };
    if !request.save {
        let hint = "an Xsens device keeps its settings over a power cycle: ask to save if that is wanted";
        return Err(refusal("save", "no".to_owned(), "yes".to_owned(), hint));
    }
    let configuration = output_configuration(rate).data();
    let what = format!("packet counter, time, acceleration and rate of turn, {rate} Hz (saved)");
    let mut steps = vec![
        step("stop measuring".to_owned(), GO_TO_CONFIG, &[], acknowledged::<0x31>),
        step(what, SET_OUTPUT_CONFIGURATION, &configuration, runs_at_it),
    ];
    match request.baud {
        Some(baud) => steps.extend(change_baud(baud)?),
        None => steps.push(step("measure".to_owned(), GO_TO_MEASUREMENT, &[], acknowledged::<0x11>)),
    }
    Ok(Plan { steps, rate_hz, bytes_per_sample: BYTES_PER_SAMPLE })
}

/// What the device is to send.
fn output_configuration(rate_hz: u16) -> OutputConfiguration {
    let outputs = [
        (PACKET_COUNTER, EVERY_PACKET),
        (SAMPLE_TIME_FINE, EVERY_PACKET),
        (ACCELERATION, rate_hz),
        (RATE_OF_TURN, rate_hz),
    ];
    let outputs = outputs.map(|(data_id, rate_hz)| Output { data_id, rate_hz });
    OutputConfiguration { outputs: outputs.to_vec() }
}

/// A new baud rate is in force once the device has started again; then it measures by itself.
fn change_baud(baud: u32) -> Result<[Step; 2], ConfigureError> {
    let Some(&(_, code)) = BAUD_CODES.iter().find(|(offered, _)| *offered == baud) else {
        let expected = BAUD_CODES.map(|(baud, _)| baud.to_string()).join(", ");
        return Err(refusal("baud", baud.to_string(), expected, "ask for one of these"));
    };
    let set = step(
        format!("{baud} baud after the next start (saved)"),
        SET_BAUD_RATE,
        &[code],
        acknowledged::<0x19>,
    );
    let mut reset = step("start again and measure".to_owned(), RESET, &[], acknowledged::<0x41>);
    reset.baud_after = Some(baud);
    Ok([set, reset])
}

/// The bytes of a command; its data have at most 254 bytes.
pub fn command(id: u8, data: &[u8]) -> Vec<u8> {
    message(id, data)
}

fn step(what: String, id: u8, data: &[u8], answer: Judge) -> Step {
    Step { what, bytes: command(id, data), answer: Some(answer), baud_after: None }
}

fn refusal(key: &'static str, got: String, expected: String, hint: &str) -> ConfigureError {
    ConfigureError::NotOffered { protocol: XBUS, key, got, expected, hint: hint.to_owned() }
}

/// The first answer in what was received: an error, or what `judge` says of the message `id`.
fn first_answer(received: &[u8], id: u8, judge: impl Fn(&[u8]) -> Answer) -> Answer {
    let mut answer = Answer::NotYet;
    each_message(received, |message: Message<'_>| {
        if answer == Answer::NotYet && message.id == ERROR {
            let code = message.data.first().copied().unwrap_or(0);
            answer = Answer::Refused(format!("error {code:#04x}, {}", error_text(code)));
        } else if answer == Answer::NotYet && message.id == id {
            answer = judge(message.data);
        }
    });
    answer
}

fn acknowledged<const ID: u8>(received: &[u8]) -> Answer {
    first_answer(received, ID, |_| Answer::Done)
}

/// Holds the rates the device says it has made of the request against the rate that was asked for.
fn runs_at<const RATE_HZ: u16>(received: &[u8]) -> Answer {
    first_answer(received, SET_OUTPUT_CONFIGURATION + 1, |data| {
        let made = OutputConfiguration::parse(data);
        let rate_of = |data_id| made.as_ref().and_then(|made| made.rate_of(data_id));
        match (rate_of(ACCELERATION), rate_of(RATE_OF_TURN)) {
            (Some(force), Some(omega)) if [force, omega] == [RATE_HZ; 2] => Answer::Done,
            (None, None) if data.is_empty() => Answer::Done,
            (force, omega) => {
                let hz = |rate: Option<u16>| rate.map_or("off".to_owned(), |rate| format!("{rate} Hz"));
                let made = format!("acceleration {}, rate of turn {}", hz(force), hz(omega));
                Answer::Refused(format!("asked for {RATE_HZ} Hz, it has set {made}"))
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(rate_hz: f64, baud: Option<u32>) -> Request {
        Request { rate_hz: Some(rate_hz), baud, save: true }
    }

    fn judge(plan: &Plan, step: usize, received: &[u8]) -> Answer {
        plan.steps[step].answer.expect("every command has an answer")(received)
    }

    #[test]
    fn the_device_is_stopped_set_and_started() {
        let steps = plan(&request(100.0, None)).expect("offered").steps;
        let ids: Vec<u8> = steps.iter().map(|step| step.bytes[2]).collect();
        assert_eq!(ids, [GO_TO_CONFIG, SET_OUTPUT_CONFIGURATION, GO_TO_MEASUREMENT]);
        let steps = plan(&request(100.0, Some(460_800))).expect("offered").steps;
        let ids: Vec<u8> = steps.iter().map(|step| step.bytes[2]).collect();
        assert_eq!(ids, [GO_TO_CONFIG, SET_OUTPUT_CONFIGURATION, SET_BAUD_RATE, RESET]);
        assert_eq!(
            steps.iter().map(|step| step.baud_after).collect::<Vec<_>>(),
            [None, None, None, Some(460_800)]
        );
    }

    #[test]
    fn answers_are_found_among_data_and_cut_packets() {
        let plan = plan(&request(400.0, None)).expect("offered");
        let data = command(0x36, &[0x10, 0x20, 2, 0, 1]);
        assert_eq!(judge(&plan, 0, &data), Answer::NotYet);
        let acknowledged = [&data[3..], &command(0x31, &[]), &data[..4]].concat();
        assert_eq!(judge(&plan, 0, &acknowledged), Answer::Done);
        let Answer::Refused(why) = judge(&plan, 1, &command(0x42, &[0x21])) else { panic!("an error") };
        assert_eq!(why, "error 0x21, parameter not valid or out of range");
    }

    #[test]
    fn a_device_that_is_slower_than_asked_has_refused() {
        let plan = plan(&request(400.0, None)).expect("offered");
        let made = |rate| command(0xC1, &output_configuration(rate).data());
        assert_eq!(judge(&plan, 1, &made(400)), Answer::Done);
        assert_eq!(judge(&plan, 1, &command(0xC1, &[])), Answer::Done);
        let Answer::Refused(why) = judge(&plan, 1, &made(100)) else { panic!("100 is not 400") };
        assert_eq!(why, "asked for 400 Hz, it has set acceleration 100 Hz, rate of turn 100 Hz");
    }

    #[test]
    fn what_is_not_offered_is_said_with_what_is() {
        for (request, parts) in [
            (request(300.0, None), ["--configure rate=300", "200, 400"]),
            (request(100.0, Some(123)), ["--configure baud=123", "115200, 230400"]),
            (Request { save: false, ..request(100.0, None) }, ["--configure save=no", "keeps its settings"]),
        ] {
            let text = plan(&request).expect_err("not offered").to_string();
            assert!(parts.iter().all(|part| text.contains(part)) && text.contains("\n\nhint: "), "{text}");
        }
    }

    #[test]
    fn an_output_configuration_is_whole_entries() {
        for data in [&[][..], &[1, 2, 3], &[0; 33 * 4]] {
            assert_eq!(OutputConfiguration::parse(data), None);
        }
        assert_eq!(
            OutputConfiguration::parse(&[0x80, 0x2C, 0, 100]).and_then(|all| all.rate_of(0x8020)),
            Some(100)
        );
    }
}
