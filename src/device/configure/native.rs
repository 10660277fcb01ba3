//! Commands of our own protocol: CMD frames, answered by ACK (firmware-protocol/README.md).

use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::message::{Ack, Cmd, Message, ack_result, command};
use otolith_firmware_protocol::stream::{Event, StreamDecoder, encode_frame};

use super::{Answer, ConfigureError, Plan, Request, Step};

/// A SAMPLE16 on the wire, bytes: the densest frame with one sample, which is what a device sends unless it batches.
const SAMPLE_BYTES: f64 = 22.0;
/// Token of the first command; the answers carry it back.
const TOKEN: u8 = 0x40;

/// Commands for `request`. The protocol has none for the baud rate: a device has the one its firmware was built for.
///
/// # Errors
/// [`ConfigureError::NotOffered`] for a baud rate, and where no rate is asked for.
pub(super) fn plan(request: &Request) -> Result<Plan, ConfigureError> {
    let not_offered = |key, got: String, expected: &str, hint: &str| ConfigureError::NotOffered {
        protocol: crate::device::protocol::detect::OTOLITH_SERIAL,
        key,
        got,
        expected: expected.to_owned(),
        hint: hint.to_owned(),
    };
    if let Some(baud) = request.baud {
        let hint = "build the firmware for another rate, and name it in the selector";
        return Err(not_offered("baud", baud.to_string(), "no baud rate", hint));
    }
    let Some(rate_hz) = request.rate_hz else {
        return Err(not_offered("rate", "(none)".to_owned(), "a rate", "write for example rate=200"));
    };
    let set_rate = Cmd { code: command::SET_RATE, arg: (rate_hz * 1000.0).round() as u32, token: TOKEN };
    let mut steps = vec![step(format!("set the rate to {rate_hz} samples/s"), set_rate, answered::<TOKEN>)?];
    if request.save {
        let save = Cmd { code: command::SAVE, arg: 0, token: TOKEN + 1 };
        steps.push(step("save the settings".to_owned(), save, answered::<{ TOKEN + 1 }>)?);
    }
    Ok(Plan { steps, rate_hz, bytes_per_sample: SAMPLE_BYTES })
}

fn step(what: String, cmd: Cmd, answer: fn(&[u8]) -> Answer) -> Result<Step, ConfigureError> {
    let mut buffer = [0; MAX_FRAME];
    let frame = encode_frame(&Message::Cmd(cmd), cmd.token, &mut buffer)
        .map_err(|error| ConfigureError::Request { text: what.clone(), problem: error.to_string() })?;
    // A delimiter in front ends whatever the device may have half received.
    let bytes = [&[0], frame].concat();
    Ok(Step { what, bytes, answer: Some(answer), baud_after: None })
}

/// Looks for the ACK with this token.
fn answered<const WITH_TOKEN: u8>(received: &[u8]) -> Answer {
    let mut answer = Answer::NotYet;
    StreamDecoder::new().push(received, |event| {
        if let Event::Message { message: Message::Ack(ack), .. } = event
            && ack.token == WITH_TOKEN
        {
            answer = judge(&ack);
        }
    });
    answer
}

fn judge(ack: &Ack) -> Answer {
    let why = match ack.result {
        ack_result::OK => return Answer::Done,
        ack_result::UNKNOWN_CODE => "it does not know this command".to_owned(),
        ack_result::OUT_OF_RANGE => format!("out of range, {} is in force", ack.value),
        ack_result::BUSY => "it is busy".to_owned(),
        ack_result::FAILED => "it failed".to_owned(),
        other => format!("result {other}"),
    };
    Answer::Refused(why)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ack(token: u8, result: u8) -> Vec<u8> {
        let ack = Ack { code: command::SET_RATE, result, value: 100_000, token };
        let mut buffer = [0; MAX_FRAME];
        let frame = encode_frame(&Message::Ack(ack), 9, &mut buffer).expect("fits");
        // Joined in the middle of another frame.
        [&[0x17, 0x2A, 0], frame].concat()
    }

    #[test]
    fn a_rate_becomes_one_command_and_saving_another() {
        let request = Request { rate_hz: Some(200.0), baud: None, save: true };
        let plan = plan(&request).expect("offered");
        assert_eq!((plan.steps.len(), plan.rate_hz, plan.bytes_per_sample), (2, 200.0, 22.0));
        let mut sent = Vec::new();
        for step in &plan.steps {
            StreamDecoder::new().push(&step.bytes, |event| {
                if let Event::Message { message: Message::Cmd(cmd), .. } = event {
                    sent.push((cmd.code, cmd.arg));
                }
            });
        }
        assert_eq!(sent, [(command::SET_RATE, 200_000), (command::SAVE, 0)]);
    }

    #[test]
    fn only_the_answer_to_the_command_counts() {
        let plan = plan(&Request { rate_hz: Some(200.0), ..Request::default() }).expect("offered");
        let answer = plan.steps[0].answer.expect("it is answered");
        assert_eq!(answer(&[]), Answer::NotYet);
        assert_eq!(answer(&ack(TOKEN + 1, ack_result::OK)), Answer::NotYet);
        assert_eq!(answer(&ack(TOKEN, ack_result::OK)), Answer::Done);
        assert_eq!(
            answer(&ack(TOKEN, ack_result::OUT_OF_RANGE)),
            Answer::Refused("out of range, 100000 is in force".to_owned())
        );
    }

    #[test]
    fn what_is_not_offered_is_refused() {
        for request in [Request::default(), Request { baud: Some(9600), ..Request::default() }] {
            assert!(matches!(plan(&request), Err(ConfigureError::NotOffered { .. })));
        }
    }
}
