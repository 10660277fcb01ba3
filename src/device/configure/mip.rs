//! Commands to MicroStrain devices on a serial line.
//!
//! | set, field | command | data | answer |
//! |---|---|---|---|
//! | 01 02 | set to idle | none | F1 |
//! | 0C 0E | base rate | set | F1, and 8E: set, u16 Hz |
//! | 0C 0F | message format | function, set, count, then descriptor and u16 decimation each | F1 |
//! | 0C 40 | baud rate of the UART | function, u32 | F1, still at the old baud rate |
//! | 01 06 | resume | none | F1 |
//!
//! F1 holds the command and an error, 0 for done. Function 01 sets, 03 saves what is set. A rate is the base rate of the
//! device divided by a whole number, so the base rate is asked before anything is changed.
//!
//! Source: the vendor's mip_sdk (e5a847d), `commands_base`, `commands_3dm`, `mip_result`.

use super::{Answer, ConfigureError, Plan, Request, Step};
use crate::device::protocol::detect::MIP;
use crate::device::protocol::mip::error_text;
use crate::device::protocol::mip::frame::{ACKNOWLEDGEMENT, Packet, each_packet, packet};

const BASE: u8 = 0x01;
const SET_IDLE: u8 = 0x02;
const RESUME: u8 = 0x06;

const DM: u8 = 0x0C;
const BASE_RATE: u8 = 0x0E;
const BASE_RATE_REPLY: u8 = 0x8E;
const MESSAGE_FORMAT: u8 = 0x0F;
const UART_BAUD: u8 = 0x40;

const SET: u8 = 0x01;
const SAVE: u8 = 0x03;

const SENSOR_DATA: u8 = 0x80;
const REFERENCE_TIME: u8 = 0xD5;
const ACCELERATION: u8 = 0x04;
const ANGULAR_RATE: u8 = 0x05;

/// Base rate a plan is made for when nothing else is known, Hz: an assumption, which the device is asked about before
/// anything is changed.
const USUAL_BASE_RATE_HZ: u16 = 1000;
/// Rate without one in the request, Hz: the vendor's examples have it, and it divides every base rate.
const USUAL_RATE_HZ: f64 = 100.0;
/// A packet of 44 bytes: its frame 6, reference time 10, acceleration and angular rate 14 each.
const BYTES_PER_SAMPLE: f64 = 44.0;

type Judge = fn(&[u8]) -> Answer;

/// Base rates a plan can be made for, Hz.
const BASE_RATES: [(u16, Judge); 3] =
    [(1000, base_rate_is::<1000>), (500, base_rate_is::<500>), (100, base_rate_is::<100>)];

/// Baud rates of a UART.
const BAUD_RATES: [u32; 6] = [9_600, 19_200, 115_200, 230_400, 460_800, 921_600];

/// The commands that make a device with a base rate of 1000 Hz send time, acceleration and angular rate at one rate.
///
/// A device with another base rate stops it at the first command, and nothing is changed: see [`plan_for_base_rate`].
/// Without a rate in the request it is 100 Hz.
///
/// # Errors
/// [`ConfigureError::NotOffered`] for a rate that does not divide the base rate and for a baud rate there is not.
pub fn plan(request: &Request) -> Result<Plan, ConfigureError> {
    plan_for_base_rate(request, USUAL_BASE_RATE_HZ)
}

/// [`plan`] for a device with a base rate of 1000, 500 or 100 Hz.
///
/// # Errors
/// As [`plan`], and [`ConfigureError::NotOffered`] for another base rate.
pub fn plan_for_base_rate(request: &Request, base_rate_hz: u16) -> Result<Plan, ConfigureError> {
    let Some(&(_, has_base_rate)) = BASE_RATES.iter().find(|(rate, _)| *rate == base_rate_hz) else {
        let expected = BASE_RATES.map(|(rate, _)| rate.to_string()).join(", ");
        return Err(refusal(
            "base-rate",
            base_rate_hz.to_string(),
            expected,
            "ask the device for its base rate",
        ));
    };
    let rate_hz = request.rate_hz.unwrap_or(USUAL_RATE_HZ);
    let decimation = decimation(rate_hz, base_rate_hz)?;
    let mut steps = vec![
        step(
            format!("ask whether the base rate is {base_rate_hz} Hz"),
            DM,
            BASE_RATE,
            &[SENSOR_DATA],
            has_base_rate,
        ),
        step("stop measuring".to_owned(), BASE, SET_IDLE, &[], acknowledged::<BASE, SET_IDLE>),
        step(
            format!("time, acceleration and angular rate, {rate_hz} Hz"),
            DM,
            MESSAGE_FORMAT,
            &message_format(decimation),
            acknowledged::<DM, MESSAGE_FORMAT>,
        ),
    ];
    if request.save {
        let what = "save the message format".to_owned();
        let format = [SAVE, SENSOR_DATA];
        steps.push(step(what, DM, MESSAGE_FORMAT, &format, acknowledged::<DM, MESSAGE_FORMAT>));
    }
    if let Some(baud) = request.baud {
        steps.extend(change_baud(baud, request.save)?);
    }
    steps.push(step("measure".to_owned(), BASE, RESUME, &[], acknowledged::<BASE, RESUME>));
    Ok(Plan { steps, rate_hz, bytes_per_sample: BYTES_PER_SAMPLE })
}

/// The whole number by which the base rate is divided.
fn decimation(rate_hz: f64, base_rate_hz: u16) -> Result<u16, ConfigureError> {
    let divisors = (1..=base_rate_hz).filter(|divisor| base_rate_hz.is_multiple_of(*divisor));
    let found = divisors.clone().find(|divisor| f64::from(base_rate_hz / divisor) == rate_hz);
    found.ok_or_else(|| {
        let rates: Vec<_> = divisors.map(|divisor| (base_rate_hz / divisor).to_string()).collect();
        let hint = format!("ask for one of these, in Hz: they divide the base rate of {base_rate_hz} Hz");
        refusal("rate", format!("{rate_hz}"), rates.join(", "), &hint)
    })
}

/// Data of the command that sets what set 80 holds.
fn message_format(decimation: u16) -> Vec<u8> {
    let [high, low] = decimation.to_be_bytes();
    let fields = [REFERENCE_TIME, ACCELERATION, ANGULAR_RATE];
    let mut data = vec![SET, SENSOR_DATA, fields.len() as u8];
    data.extend(fields.iter().flat_map(|field| [*field, high, low]));
    data
}

fn change_baud(baud: u32, save: bool) -> Result<Vec<Step>, ConfigureError> {
    if !BAUD_RATES.contains(&baud) {
        let expected = BAUD_RATES.map(|baud| baud.to_string()).join(", ");
        return Err(refusal("baud", baud.to_string(), expected, "ask for one of these"));
    }
    let data = |function: u8| [&[function][..], &baud.to_be_bytes()].concat();
    let judge: Judge = acknowledged::<DM, UART_BAUD>;
    let mut set = step(format!("{baud} baud"), DM, UART_BAUD, &data(SET), judge);
    set.baud_after = Some(baud);
    let save = save.then(|| step("save the baud rate".to_owned(), DM, UART_BAUD, &data(SAVE), judge));
    Ok([Some(set), save].into_iter().flatten().collect())
}

/// The bytes of a command: one field in a packet of its own, with at most 253 bytes of data.
pub fn command(set: u8, field: u8, data: &[u8]) -> Vec<u8> {
    packet(set, field, data)
}

fn step(what: String, set: u8, field: u8, data: &[u8], answer: Judge) -> Step {
    Step { what, bytes: command(set, field, data), answer: Some(answer), baud_after: None }
}

fn refusal(key: &'static str, got: String, expected: String, hint: &str) -> ConfigureError {
    ConfigureError::NotOffered { protocol: MIP, key, got, expected, hint: hint.to_owned() }
}

/// The first acknowledgement of a command in what was received; `judge` is shown the packet of one without an error.
fn first_answer(received: &[u8], set: u8, command: u8, judge: impl Fn(Packet<'_>) -> Answer) -> Answer {
    let mut answer = Answer::NotYet;
    each_packet(received, |packet| {
        let is_it = |field: &[u8]| field.first() == Some(&command);
        let acknowledgement = packet
            .fields()
            .find(|field| packet.set == set && field.descriptor == ACKNOWLEDGEMENT && is_it(field.data));
        answer = match (&answer, acknowledgement.map(|field| field.data)) {
            (Answer::NotYet, Some(&[_, 0])) => judge(packet),
            (Answer::NotYet, Some(&[_, code])) => {
                Answer::Refused(format!("error {code:#04x}, {}", error_text(code)))
            }
            _ => return,
        };
    });
    answer
}

fn acknowledged<const SET: u8, const COMMAND: u8>(received: &[u8]) -> Answer {
    first_answer(received, SET, COMMAND, |_| Answer::Done)
}

fn base_rate_is<const RATE_HZ: u16>(received: &[u8]) -> Answer {
    first_answer(received, DM, BASE_RATE, |packet| {
        let reply = packet.fields().find(|field| field.descriptor == BASE_RATE_REPLY);
        match reply.map(|field| field.data) {
            Some(&[SENSOR_DATA, high, low]) if u16::from_be_bytes([high, low]) == RATE_HZ => Answer::Done,
            Some(&[SENSOR_DATA, high, low]) => Answer::Refused(format!(
                "its base rate is {} Hz, and these commands are for {RATE_HZ} Hz",
                u16::from_be_bytes([high, low])
            )),
            _ => Answer::Refused("it does not tell its base rate".to_owned()),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(rate_hz: f64, baud: Option<u32>, save: bool) -> Request {
        Request { rate_hz: Some(rate_hz), baud, save }
    }

    /// Set and field of every command.
    fn commands(plan: &Plan) -> Vec<[u8; 2]> {
        plan.steps.iter().map(|step| [step.bytes[2], step.bytes[5]]).collect()
    }

    fn judge(plan: &Plan, step: usize, received: &[u8]) -> Answer {
        plan.steps[step].answer.expect("every command has an answer")(received)
    }

    #[test]
    fn the_device_is_asked_stopped_set_and_started_and_saved_only_if_asked() {
        let set = plan(&request(200.0, None, false)).expect("offered");
        assert_eq!(commands(&set), [[12, 14], [1, 2], [12, 15], [1, 6]]);
        assert_eq!(set.steps[2].bytes[6..18], [1, 0x80, 3, 0xD5, 0, 5, 4, 0, 5, 5, 0, 5]);
        let saved = plan(&request(200.0, Some(921_600), true)).expect("offered");
        assert_eq!(commands(&saved), [[12, 14], [1, 2], [12, 15], [12, 15], [12, 64], [12, 64], [1, 6]]);
        assert_eq!(saved.steps[4].baud_after, Some(921_600));
        assert_eq!(saved.steps[4].bytes[6..11], [1, 0, 0x0E, 0x10, 0]);
        assert_eq!(saved.steps[5].bytes[6..11], [3, 0, 0x0E, 0x10, 0]);
    }

    #[test]
    fn an_acknowledgement_counts_for_its_own_command_alone() {
        let plan = plan(&request(100.0, None, false)).expect("offered");
        let acknowledgement = |set, command, error| command_packet(set, &[command, error]);
        assert_eq!(judge(&plan, 1, &acknowledgement(1, 6, 0)), Answer::NotYet);
        assert_eq!(judge(&plan, 1, &acknowledgement(12, 2, 0)), Answer::NotYet);
        assert_eq!(judge(&plan, 1, &acknowledgement(1, 2, 0)), Answer::Done);
        let Answer::Refused(why) = judge(&plan, 2, &acknowledgement(12, 15, 3)) else { panic!("an error") };
        assert_eq!(why, "error 0x03, parameter not valid");
    }

    fn command_packet(set: u8, data: &[u8]) -> Vec<u8> {
        command(set, ACKNOWLEDGEMENT, data)
    }

    #[test]
    fn another_base_rate_stops_the_plan_before_anything_is_changed() {
        let answer = |rate: [u8; 2]| {
            let fields =
                [4, ACKNOWLEDGEMENT, BASE_RATE, 0, 5, BASE_RATE_REPLY, SENSOR_DATA, rate[0], rate[1]];
            // The frame of one field, with its first length and descriptor in the place of the payload's first field.
            let mut packet = command(DM, ACKNOWLEDGEMENT, &fields[2..]);
            packet[4] = 4;
            resum(&mut packet);
            packet
        };
        let plan = plan(&request(100.0, None, false)).expect("offered");
        assert_eq!(judge(&plan, 0, &answer([3, 0xE8])), Answer::Done);
        let Answer::Refused(why) = judge(&plan, 0, &answer([1, 0xF4])) else { panic!("500 is not 1000") };
        assert_eq!(why, "its base rate is 500 Hz, and these commands are for 1000 Hz");
        let half = plan_for_base_rate(&request(100.0, None, false), 500).expect("offered");
        assert_eq!(judge(&half, 0, &answer([1, 0xF4])), Answer::Done);
        assert_eq!(half.steps[2].bytes[11], 5);
    }

    /// Makes the checksum of a changed packet right again.
    fn resum(packet: &mut [u8]) {
        let end = packet.len() - 2;
        let (mut sum, mut sum_of_sums) = (0u8, 0u8);
        for byte in &packet[..end] {
            sum = sum.wrapping_add(*byte);
            sum_of_sums = sum_of_sums.wrapping_add(sum);
        }
        packet[end..].copy_from_slice(&[sum, sum_of_sums]);
    }

    #[test]
    fn what_is_not_offered_is_said_with_what_is() {
        for (request, parts) in [
            (request(300.0, None, false), ["--configure rate=300", "250, 200, 125, 100"]),
            (request(100.0, Some(57_600), false), ["--configure baud=57600", "115200, 230400"]),
        ] {
            let text = plan(&request).expect_err("not offered").to_string();
            assert!(parts.iter().all(|part| text.contains(part)) && text.contains("\n\nhint: "), "{text}");
        }
        assert!(plan_for_base_rate(&request(100.0, None, false), 123).is_err());
    }
}
