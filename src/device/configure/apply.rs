//! Carries a plan out on an open line.

use std::time::Duration;

use super::{Answer, ConfigureError, Plan, Step};
use crate::device::probe::Tunable;
use crate::device::{DeviceError, LinkError, Traffic};
use crate::time::Clock;

/// A device that answers at all does so within this time.
pub(super) const ANSWER_WITHIN: Duration = Duration::from_secs(2);
/// Time left to a device to take a command that it does not answer.
const SETTLE: Duration = Duration::from_millis(100);
/// Longest wait for the next bytes at a time.
const POLL: Duration = Duration::from_millis(20);
/// Bytes kept of what came since a command: an answer stands at the end.
const KEPT_BYTES: usize = 4096;

/// Sends the commands of `plan` one after the other, each once the one before was answered. What the device measures
/// meanwhile is not used.
///
/// # Errors
/// [`DeviceError::Configure`] when the device refuses a command or does not answer it; [`DeviceError::Lost`] when the
/// port is lost.
pub fn apply(line: &mut dyn Tunable, port: &str, plan: &Plan, clock: &dyn Clock) -> Result<(), DeviceError> {
    for (done, step) in plan.steps.iter().enumerate() {
        let answer = take_step(line, step, clock).map_err(|error| lost(port, &error))?;
        let (port, what) = (port.to_owned(), step.what.clone());
        match answer {
            Answer::Done => {}
            Answer::NotYet => return Err(ConfigureError::NoAnswer { port, what, done }.into()),
            Answer::Refused(why) => return Err(ConfigureError::Refused { port, what, why, done }.into()),
        }
    }
    Ok(())
}

/// Sends one command and waits for its answer; `NotYet` if none came in time.
fn take_step(line: &mut dyn Tunable, step: &Step, clock: &dyn Clock) -> Result<Answer, LinkError> {
    line.send(Traffic::Bytes(&step.bytes))?;
    let wait = if step.answer.is_some() { ANSWER_WITHIN } else { SETTLE };
    let until = clock.now() + wait;
    let mut received: Vec<u8> = Vec::new();
    let mut answer = if step.answer.is_some() { Answer::NotYet } else { Answer::Done };
    while clock.now() < until {
        if let Some((_, Traffic::Bytes(bytes))) = line.receive(POLL)? {
            received.extend_from_slice(bytes);
            received.drain(..received.len().saturating_sub(KEPT_BYTES));
        }
        if let Some(judge) = step.answer {
            answer = judge(&received);
            if answer != Answer::NotYet {
                break;
            }
        }
    }
    if let (Answer::Done, Some(baud)) = (&answer, step.baud_after)
        && !line.set_baud(baud)
    {
        answer = Answer::Refused(format!("this port has no {baud} baud"));
    }
    Ok(answer)
}

fn lost(port: &str, error: &LinkError) -> DeviceError {
    let kind = match error {
        LinkError::Lost { source, .. } => source.kind(),
        LinkError::EndOfRecording => std::io::ErrorKind::UnexpectedEof,
    };
    DeviceError::Lost {
        port: port.to_owned(),
        source: kind.into(),
        hint: "the port went away while the device was being set up; plug it in and try again".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::device::Link;
    use crate::device::testing::ManualClock;
    use crate::time::HostTime;

    /// Answers each command with the text it was told to.
    struct Device {
        clock: Arc<ManualClock>,
        answers: Vec<&'static [u8]>,
        pending: Vec<u8>,
        current: Vec<u8>,
        sent: Vec<Vec<u8>>,
        bauds: Vec<u32>,
    }

    impl Link for Device {
        fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
            let now = self.clock.now();
            self.clock.set(now + timeout);
            self.current = std::mem::take(&mut self.pending);
            Ok((!self.current.is_empty()).then_some((now, Traffic::Bytes(&self.current))))
        }

        fn send(&mut self, traffic: Traffic<'_>) -> Result<(), LinkError> {
            let Traffic::Bytes(bytes) = traffic else { panic!("bytes only") };
            self.sent.push(bytes.to_vec());
            self.pending = self.answers.remove(0).to_vec();
            Ok(())
        }
    }

    impl Tunable for Device {
        fn set_baud(&mut self, baud: u32) -> bool {
            self.bauds.push(baud);
            true
        }
    }

    fn judge(received: &[u8]) -> Answer {
        match received {
            b"no" => Answer::Refused("because".to_owned()),
            [.., b'!'] => Answer::Done,
            _ => Answer::NotYet,
        }
    }

    fn set_up(answers: &[&'static [u8]]) -> (Result<(), DeviceError>, Device) {
        let clock = Arc::new(ManualClock::default());
        let step = |what: &str, answer, baud_after| Step {
            what: what.to_owned(),
            bytes: what.as_bytes().to_vec(),
            answer,
            baud_after,
        };
        let steps = vec![
            step("unlock", None, None),
            step("set the rate", Some(judge as fn(&[u8]) -> Answer), None),
            step("set the baud rate", Some(judge), Some(9600)),
        ];
        let plan = Plan { steps, rate_hz: 100.0, bytes_per_sample: 22.0 };
        let mut device = Device {
            clock: Arc::clone(&clock),
            answers: answers.to_vec(),
            pending: Vec::new(),
            current: Vec::new(),
            sent: Vec::new(),
            bauds: Vec::new(),
        };
        (apply(&mut device, "port", &plan, clock.as_ref()), device)
    }

    #[test]
    fn each_command_follows_the_answer_to_the_one_before() {
        let (result, device) = set_up(&[b"", b"ok!", b"noise and !"]);
        result.expect("all was taken");
        assert_eq!(device.sent.concat(), b"unlockset the rateset the baud rate");
        assert_eq!(device.bauds, [9600]);
    }

    #[test]
    fn a_refusal_and_a_silence_end_it_and_say_where() {
        let (result, device) = set_up(&[b"", b"no"]);
        let text = result.expect_err("refused").to_string();
        assert!(
            text.contains("refused to set the rate: because") && text.contains("first 1 commands"),
            "{text}"
        );
        assert_eq!((device.sent.len(), device.bauds.len()), (2, 0));
        let (result, _) = set_up(&[b"", b"?"]);
        let text = result.expect_err("no answer").to_string();
        assert!(text.contains("no answer to \"set the rate\" within 2 s"), "{text}");
    }
}
