//! Listening to a port until it is clear what it speaks. Nothing is ever sent.

use std::sync::Arc;
use std::time::Duration;

use super::can::CanLink;
use super::discover::discover;
use super::find::PortFinder;
use super::protocol::detect::Bus;
use super::selector::DEFAULT_BAUD;
use super::serial::{SerialLink, is_pseudo_terminal};
use super::{DeviceError, Link, LinkError, Selector};
use crate::time::{Clock, HostTime};

mod ear;
mod heard;
mod lines;

use ear::Ear;
pub use heard::{Heard, Look, MeanSample, Verdict};

/// Baud rates tried, in this order.
pub const BAUDS: [u32; 6] = [115_200, 921_600, 460_800, 230_400, 57_600, 9_600];
/// How long a port is listened to unless somebody asks for more.
pub const DEFAULT_LENGTH: Duration = Duration::from_secs(3);
/// Longest look at one baud rate that shows nothing promising.
const LONGEST_LOOK: Duration = Duration::from_millis(300);
/// Share of the time in which the first byte is waited for at the first baud rate: silence says nothing about the
/// speed, and a board that was reset by the opening of its port is silent for a second or two.
const WAIT_SHARE: f64 = 0.6;

/// A serial line whose speed can be changed while it is open. Opening it anew would reset many boards each time.
pub trait Tunable: Link {
    /// Listens at `baud` bit/s from now on and throws away what came at another speed and was not yet taken. False
    /// when the port does not offer this speed.
    fn set_baud(&mut self, baud: u32) -> bool;
}

/// Opens what `selector` names, listens for `length` at most and says what was heard.
///
/// A serial port is tried at the selector's baud rate first, if that is not the usual one, and then at [`BAUDS`].
///
/// # Errors
/// The port cannot be opened or goes away meanwhile, or the selector names no port.
pub fn probe(selector: &Selector, clock: &Arc<dyn Clock>, length: Duration) -> Result<Heard, DeviceError> {
    match selector {
        Selector::Serial { port, baud } => {
            let bauds = bauds_from(*baud);
            let open = |node: &str| SerialLink::open(node, bauds[0], Arc::clone(clock));
            let mut line = PortFinder::new(port, discover).open(open)?;
            let mut heard = scan(&mut line, clock.as_ref(), &bauds, length)?;
            if is_pseudo_terminal(port) {
                heard
                    .notes
                    .push("a pseudo-terminal has no speed: the baud rate cannot be checked".to_owned());
            }
            Ok(heard)
        }
        Selector::Can { interface, .. } => {
            let mut link = CanLink::open(interface, Arc::clone(clock))?;
            listen(&mut link, clock.as_ref(), Bus::Can, length)
        }
        other => Err(DeviceError::Unsupported {
            port: other.to_string(),
            problem: "this is no port to listen to",
            hint: "name a port or an interface, such as serial:/dev/ttyUSB0 or can:can0",
        }),
    }
}

/// The baud rates to try for a selector that says `baud`.
fn bauds_from(baud: u32) -> Vec<u32> {
    let named = Some(baud).filter(|baud| *baud != DEFAULT_BAUD);
    named.into_iter().chain(BAUDS.into_iter().filter(|other| Some(*other) != named)).collect()
}

/// Listens to a link that has one speed only.
///
/// # Errors
/// The port went away.
pub fn listen(
    link: &mut dyn Link,
    clock: &dyn Clock,
    bus: Bus,
    length: Duration,
) -> Result<Heard, DeviceError> {
    let start = clock.now();
    let mut ear = Ear::new(bus);
    let end = start + length;
    attend(link, clock, &mut ear, Patience { look: length, first_byte_until: end, end })?;
    let heard = ear.heard(None, clock.now().saturating_since(start));
    Ok(Heard { bus_errors: link.status().bus_errors, ..heard })
}

/// Listens to a serial line at each of `bauds` in turn, and stays at the one at which it understands something.
///
/// Rounds of looks: a look ends when the bytes mean nothing at this speed, and goes on to the end as long as they are
/// promising. After a round the baud rates with most good packets come first. It ends early when a protocol is certain
/// and half a second of samples has come.
///
/// # Errors
/// The port went away.
pub fn scan(
    line: &mut dyn Tunable,
    clock: &dyn Clock,
    bauds: &[u32],
    length: Duration,
) -> Result<Heard, DeviceError> {
    let start = clock.now();
    let end = start + length;
    let mut looks: Vec<Look> = bauds.iter().map(|baud| Look::at(*baud)).collect();
    let mut first_byte_until = start + length.mul_f64(WAIT_SHARE);
    let mut goes_on = true;
    while goes_on && clock.now() < end {
        goes_on = false;
        for index in 0..looks.len() {
            // An equal share for every speed not yet tried, and one to stay with the last.
            let share = end.saturating_since(clock.now()) / (looks.len() - index + 1) as u32;
            if !line.set_baud(looks[index].baud) {
                continue;
            }
            let mut ear = Ear::new(Bus::Serial);
            let patience = Patience { look: share.min(LONGEST_LOOK), first_byte_until, end };
            goes_on = attend(line, clock, &mut ear, patience)?;
            first_byte_until = HostTime(0);
            looks[index].add(&ear);
            if ear.is_certain() {
                return Ok(ear.heard(Some(looks[index].baud), clock.now().saturating_since(start)));
            }
        }
        looks.sort_by_key(|look| std::cmp::Reverse(look.good_packets));
        // What has been silent at every speed may begin yet.
        first_byte_until = end;
    }
    Ok(Heard::unknown(looks, clock.now().saturating_since(start)))
}

/// How long to stay with one ear.
#[derive(Clone, Copy)]
struct Patience {
    /// As long as nothing is promising.
    look: Duration,
    /// The first byte is waited for until then; the look begins with it.
    first_byte_until: HostTime,
    /// The end in any case.
    end: HostTime,
}

/// Lets `ear` hear the traffic of `link` until it knows enough, hears nonsense or the patience is over. False when the
/// link has nothing more to give.
fn attend(
    link: &mut (impl Link + ?Sized),
    clock: &dyn Clock,
    ear: &mut Ear,
    patience: Patience,
) -> Result<bool, DeviceError> {
    let start = clock.now();
    let mut waits = patience.first_byte_until > start;
    let mut until = (start + patience.look).max(patience.first_byte_until);
    loop {
        let limit = if ear.is_promising() { patience.end } else { until.min(patience.end) };
        let now = clock.now();
        if now >= limit || ear.knows_enough() || ear.hears_nonsense() {
            return Ok(true);
        }
        match link.receive(limit.saturating_since(now)) {
            Ok(Some((at, traffic))) => {
                ear.push(at, traffic);
                if std::mem::take(&mut waits) {
                    until = clock.now() + patience.look;
                }
            }
            Ok(None) => {}
            Err(LinkError::EndOfRecording) => return Ok(false),
            Err(LinkError::Lost { port, source }) => {
                let hint =
                    "it went away while it was listened to: check the cable, then try again".to_owned();
                return Err(DeviceError::Lost { port, source, hint });
            }
        }
    }
}

#[cfg(test)]
mod tests;
