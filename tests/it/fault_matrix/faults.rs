//! What can happen to a stream, and what must come of it.

use std::sync::Arc;

use otolith::device::LinkStatus;
use otolith::device::can::bus::BusState;
use otolith::device::fault::WrongBaud;
use otolith::device::reconnect::{ABSENT_RETRY, FIRST_RETRY};
use otolith::runtime::trouble::Trouble;

use super::device::{NODE, OTHER_NODE, Outage, StatusAt};
use super::fault_bench::{ALIGNED_MS, Expected, Sign};
use super::streams::{Carrier, Content, Counting, Packet, Parts, Sample, Stream};

/// Length of the faults that have one, ms.
const LENGTH_MS: u64 = 300;
/// A device that is unplugged is back after this, ms: between the first and the second attempt to reopen it.
const UNPLUGGED_MS: u64 = 200;
/// The second attempt to reopen comes so long after the loss, ms.
const REOPENED_MS: u64 = (FIRST_RETRY.as_millis() + ABSENT_RETRY.as_millis()) as u64;
/// Device time of the first sample, µs, but for the wrap.
const START_US: u64 = 100_000_000;
/// How far the device's clock jumps, µs.
const JUMP_US: u64 = 10_000_000;

/// What a protocol that counts its packets must count as missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    /// So many, and as many more as samples are lost beyond the fewest.
    AtLeast(u64),
    /// As many as samples are lost.
    AsLost,
    /// The decoder cannot know: no more than what was sent meanwhile.
    Unknown,
}

/// A stream with a fault in it.
pub(super) struct Case {
    pub(super) packets: Vec<Packet>,
    pub(super) outage: Option<Outage>,
    pub(super) status: StatusAt,
    pub(super) expected: Expected,
    /// Samples that may be lost to it, fewest and most.
    pub(super) lost: (u64, u64),
    pub(super) missing: Missing,
    /// Packets that arrive twice or late.
    pub(super) repeated: u64,
}

impl Case {
    fn named(mut self, troubles: impl IntoIterator<Item = Trouble>) -> Self {
        self.expected.signs.extend(troubles.into_iter().map(Sign::Trouble));
        self
    }
}

pub(super) const FAULTS: [&str; 21] = [
    "unplug, replug",
    "unplug, replug as another node",
    "byte flipped",
    "byte inserted",
    "byte deleted",
    "packet truncated",
    "wrong baud",
    "clock jumps ahead",
    "clock starts again",
    "clock wraps",
    "packet twice",
    "packets swapped",
    "rate halved",
    "saturation",
    "NaN",
    "silence",
    "receive overflow",
    "bus off",
    "interface down",
    "interface removed",
    "no fault",
];

/// The device's samples without a fault.
pub(super) fn samples(stream: &Stream, end_ms: u64, start_us: u64) -> Vec<Sample> {
    let sample = |k| {
        let at_ms = k * stream.period_ms;
        Sample { at_ms, device_us: start_us + 1000 * at_ms, content: Content::Rest }
    };
    (0..end_ms / stream.period_ms).map(sample).collect()
}

/// Puts the fault called `fault` into a stream at `at_ms`; an error says why there is no such fault on this link.
pub(super) fn case(fault: &str, stream: &Stream, at_ms: u64, end_ms: u64) -> Result<Case, &'static str> {
    let clean = samples(stream, end_ms, START_US);
    let packets = stream.packets(&clean);
    let hit = packets.iter().position(|packet| packet.sample && packet.at_ms >= at_ms).expect("a sample");
    let begins_ms = packets[hit].at_ms;
    let ends_ms = begins_ms + LENGTH_MS;
    let in_span = move |at_ms: u64| (begins_ms..ends_ms).contains(&at_ms);
    let in_case = |packets| Case {
        packets,
        outage: None,
        status: Arc::new(|_| LinkStatus::default()),
        expected: Expected { begins_ms, ends_ms: begins_ms, signs: Vec::new() },
        lost: (0, 0),
        missing: Missing::AtLeast(0),
        repeated: 0,
    };
    let only_can = || match stream.carrier {
        Carrier::Can => Ok(()),
        Carrier::Bytes => Err("not a CAN bus"),
        Carrier::Slcan => Err("the adapter does not tell"),
    };
    let only_bytes =
        || if stream.carrier == Carrier::Can { Err("the controller drops damaged frames") } else { Ok(()) };
    let has_clock = || if stream.has_device_time { Ok(()) } else { Err("no device time") };
    Ok(match fault {
        "no fault" => in_case(packets),
        "unplug, replug" => unplugged(stream, in_case(packets), NODE),
        "unplug, replug as another node" if stream.carrier == Carrier::Can => {
            return Err("a CAN interface is known by its name alone");
        }
        "unplug, replug as another node" => unplugged(stream, in_case(packets), OTHER_NODE),
        "interface removed" => {
            only_can()?;
            unplugged(stream, in_case(packets), NODE)
        }
        "byte flipped" if stream.carrier == Carrier::Can && !stream.has_checksum => {
            // The controller drops the frame before the one that ends a sample.
            let mut case = in_case(without(packets, |k| k + 1 == hit)).named([Trouble::LoneHalves]);
            (case.lost, case.missing) = ((1, 1), Missing::AsLost);
            case
        }
        "byte flipped" if !stream.has_checksum => return Err("a changed digit is a digit: no checksum"),
        "byte flipped" => damaged(stream, in_case(packets), hit, |bytes| {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 0x10;
        }),
        "byte inserted" => {
            only_bytes()?;
            damaged(stream, in_case(packets), hit, |bytes| bytes.insert(bytes.len() / 2, b'Z'))
        }
        "byte deleted" if !stream.has_checksum && stream.carrier == Carrier::Bytes => {
            return Err("a missing digit leaves a number: no checksum");
        }
        "byte deleted" => {
            only_bytes()?;
            damaged(stream, in_case(packets), hit, |bytes| {
                bytes.remove(bytes.len() / 2);
            })
        }
        "packet truncated" => {
            only_bytes()?;
            damaged(stream, in_case(packets), hit, |bytes| bytes.truncate(bytes.len() / 2))
        }
        "wrong baud" => {
            only_bytes()?;
            wrong_baud(stream, in_case(packets), ends_ms)
        }
        "clock jumps ahead" | "clock starts again" => {
            has_clock()?;
            let mut late = clean;
            for sample in late.iter_mut().filter(|sample| sample.at_ms >= begins_ms) {
                sample.device_us = match fault {
                    "clock jumps ahead" => sample.device_us + JUMP_US,
                    _ => 1000 * (sample.at_ms - begins_ms),
                };
            }
            // A tick of 16 bits that jumps is first of all a gap.
            let mut case = in_case(stream.packets(&late)).named([Trouble::ClockStep, Trouble::Gap]);
            case.lost = (0, 2);
            case
        }
        "clock wraps" => {
            has_clock()?;
            let wraps_after_us = stream.wraps_after_us.ok_or("it does not wrap")?;
            let mut wrapping = samples(stream, end_ms, wraps_after_us - 1000 * begins_ms);
            wrapping.iter_mut().for_each(|sample| sample.device_us %= wraps_after_us);
            in_case(stream.packets(&wrapping))
        }
        "packet twice" => {
            has_clock()?;
            let mut doubled = packets;
            doubled.insert(hit, doubled[hit].clone());
            let mut case = in_case(doubled);
            if stream.parts == Parts::InOrder {
                return Ok(case.named([Trouble::LoneHalves]));
            }
            case.repeated = 1;
            case.named([Trouble::RepeatedPackets])
        }
        "packets swapped" => {
            has_clock()?;
            let mut swapped = packets;
            swapped.swap(hit, hit + 1);
            let mut case = in_case(swapped);
            (case.lost, case.repeated) = if stream.parts == Parts::One { ((1, 1), 1) } else { ((2, 2), 0) };
            if stream.parts == Parts::InOrder {
                case.missing = Missing::AsLost;
            }
            case.named([Trouble::RepeatedPackets, Trouble::LoneHalves])
        }
        "rate halved" => {
            has_clock()?;
            let all = clean.len();
            let mut slower = clean;
            slower.retain(|sample| {
                sample.at_ms < begins_ms || (sample.at_ms - begins_ms) / stream.period_ms % 2 == 1
            });
            let lost = (all - slower.len()) as u64;
            let mut case = in_case(stream.packets(&slower)).named([Trouble::RateChange]);
            case.lost = (lost, lost);
            case
        }
        "saturation" | "NaN" => {
            let content = if fault == "NaN" { Content::NotANumber } else { Content::Saturated };
            let named = match content {
                Content::NotANumber => stream.not_a_number?,
                _ if stream.tells_clipping => Trouble::Clipping,
                _ => return Err("full scale is not in the stream"),
            };
            let mut changed = clean;
            let mut count = 0;
            for sample in changed.iter_mut().filter(|sample| in_span(sample.at_ms)) {
                sample.content = content;
                count += 1;
            }
            let mut case = in_case(stream.packets(&changed)).named([named]);
            case.expected.ends_ms = ends_ms;
            if content == Content::NotANumber {
                case.lost = (count, count);
            }
            case
        }
        "silence" => {
            let mut silent = clean;
            let all = silent.len();
            silent.retain(|sample| !in_span(sample.at_ms));
            let lost = (all - silent.len()) as u64;
            let mut case = in_case(stream.packets(&silent));
            case.expected.ends_ms = ends_ms;
            case.lost = (lost, lost);
            if stream.counting == Counting::Clock {
                // By its clock a device that pauses is one whose packets are lost.
                case.missing = Missing::AsLost;
            }
            if begins_ms < ALIGNED_MS {
                case = case.named([Trouble::NoSamples]);
            }
            // A stream that begins in motion is given out at once, and has an age.
            case.expected.signs.push(Sign::Stale);
            case
        }
        "receive overflow" => {
            let case = spanned(stream, in_case(packets), begins_ms + 40);
            case.named([Trouble::MissingPackets, Trouble::Gap])
        }
        "bus off" | "interface down" => {
            only_can()?;
            let is_bus_off = fault == "bus off";
            let mut case = spanned(stream, in_case(packets), ends_ms);
            let state = if is_bus_off { BusState::BusOff } else { BusState::InterfaceDown };
            case.status = Arc::new(move |now_ms| LinkStatus {
                bus_errors: u64::from(now_ms >= begins_ms),
                bus_off: u64::from(is_bus_off && now_ms >= begins_ms),
                bus_state: if in_span(now_ms) { state } else { BusState::ErrorActive },
                ..LinkStatus::default()
            });
            case.named([if is_bus_off { Trouble::BusOff } else { Trouble::InterfaceDown }])
        }
        other => unreachable!("{other}"),
    })
}

fn without(packets: Vec<Packet>, gone: impl Fn(usize) -> bool) -> Vec<Packet> {
    packets.into_iter().enumerate().filter(|(k, _)| !gone(*k)).map(|(_, packet)| packet).collect()
}

/// The device is pulled out, and back at `node` before the second attempt to reopen it. What it sends until then is lost.
fn unplugged(stream: &Stream, case: Case, node: &'static str) -> Case {
    let (packets, out_ms) = (case.packets.clone(), case.expected.begins_ms);
    let mut case = spanned(stream, case, out_ms + REOPENED_MS);
    case.packets = packets;
    let back_ms = out_ms + UNPLUGGED_MS;
    case.outage = Some(Outage { out_ms, back_ms, node, has_serial_number: true });
    case.expected.ends_ms = back_ms;
    // Opening an adapter takes in what comes first.
    case.lost.1 += u64::from(stream.carrier == Carrier::Slcan);
    // Whether the device counted on while nobody listened is not known.
    case.missing = Missing::Unknown;
    case.named([Trouble::ConnectionLost])
}

/// Packets from the fault's beginning to `ends_ms` do not arrive.
fn spanned(stream: &Stream, mut case: Case, ends_ms: u64) -> Case {
    let (begins_ms, all) = (case.expected.begins_ms, std::mem::take(&mut case.packets));
    let (gone, left): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|packet| (begins_ms..ends_ms).contains(&packet.at_ms));
    let samples = gone.iter().filter(|packet| packet.sample).count() as u64;
    let packets = gone.iter().filter(|packet| packet.counted).count() as u64;
    case.lost = (samples, samples);
    case.missing = Missing::AtLeast(if stream.counting == Counting::Clock { samples } else { packets });
    (case.packets, case.expected.ends_ms) = (left, ends_ms);
    case
}

/// One packet arrives damaged. Where packets are told apart by what stands between them, the next may go with it.
fn damaged(stream: &Stream, mut case: Case, hit: usize, damage: impl Fn(&mut Vec<u8>)) -> Case {
    damage(&mut case.packets[hit].bytes);
    (case.lost, case.missing) = ((1, if stream.delimited { 2 } else { 1 }), Missing::AsLost);
    case.named([Trouble::DamagedPackets, Trouble::StrayBytes])
}

/// The port reads at half the device's baud for a while: each byte comes as it would.
fn wrong_baud(stream: &Stream, case: Case, ends_ms: u64) -> Case {
    let begins_ms = case.expected.begins_ms;
    let damaged: Vec<Packet> = case
        .packets
        .iter()
        .map(|packet| match (begins_ms..ends_ms).contains(&packet.at_ms) {
            true => Packet { bytes: misread(&packet.bytes), ..packet.clone() },
            false => packet.clone(),
        })
        .collect();
    let mut case = spanned(stream, case, ends_ms);
    case.packets = damaged;
    // Where packets are told apart by what stands between them, the first good one may go with the last bad one.
    case.lost.1 += 1;
    case.named([Trouble::DamagedPackets, Trouble::StrayBytes])
}

fn misread(sent: &[u8]) -> Vec<u8> {
    let wrong = WrongBaud { sent_baud: 115_200, read_baud: 57_600, keep_framing_errors: true };
    let mut read = Vec::new();
    wrong.misread(sent, &mut read);
    read
}
