//! What can happen to a stream, and what must come of it.

use std::io::ErrorKind;
use std::sync::Arc;

use otolith::device::LinkStatus;
use otolith::device::can::bus::BusState;
use otolith::device::fault::WrongBaud;
use otolith::runtime::trouble::Trouble;

use super::streams::{Content, Packet, Sample, Stream};

/// Length of the faults that have one, ms.
const LENGTH_MS: u64 = 300;
/// Before this time the samples are held back to align the sensor, ms.
pub(super) const ALIGNED_MS: u64 = 1_000;
/// Device time of the first sample, µs, but for the wrap.
const START_US: u64 = 100_000_000;
/// How far the device's clock jumps, µs.
const JUMP_US: u64 = 10_000_000;

/// What names a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    Trouble(Trouble),
    /// The newest sample is too old: `LinkHealth` is no longer live.
    Silence,
}

/// The link's state at a time, ms.
pub(super) type StatusAt = Arc<dyn Fn(u64) -> LinkStatus + Send + Sync>;

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
    pub(super) status: StatusAt,
    pub(super) begins_ms: u64,
    pub(super) ends_ms: u64,
    /// Any of these is the name of the fault; none means that nothing must be named.
    pub(super) signs: Vec<Sign>,
    /// Samples that may be lost to it, fewest and most.
    pub(super) lost: (u64, u64),
    pub(super) missing: Missing,
    /// Packets that arrive twice or late.
    pub(super) repeated: u64,
}

pub(super) const FAULTS: [&str; 20] = [
    "unplug, replug",
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
        status: Arc::new(|_| LinkStatus::default()),
        begins_ms,
        ends_ms: begins_ms,
        signs: Vec::new(),
        lost: (0, 0),
        missing: Missing::AtLeast(0),
        repeated: 0,
    };
    let only_can = || if stream.is_can() { Ok(()) } else { Err("not a CAN bus") };
    let only_bytes = || if stream.is_can() { Err("the controller drops damaged frames") } else { Ok(()) };
    let has_clock = || if stream.has_device_time { Ok(()) } else { Err("no device time") };
    Ok(match fault {
        "no fault" => in_case(packets),
        "unplug, replug" | "interface removed" => {
            if fault == "interface removed" {
                only_can()?;
            }
            let mut case = spanned(stream, in_case(packets), ends_ms);
            case.signs = vec![Sign::Trouble(Trouble::ConnectionLost)];
            case.status = Arc::new(move |now_ms| LinkStatus {
                down: in_span(now_ms),
                losses: u64::from(now_ms >= begins_ms),
                reconnects: u64::from(now_ms >= ends_ms),
                last_loss: (now_ms >= begins_ms).then_some(ErrorKind::BrokenPipe),
                ..LinkStatus::default()
            });
            // Whether the device counted on while nobody listened is not known.
            case.missing = Missing::Unknown;
            case
        }
        "byte flipped" if stream.is_can() => {
            // The gyroscope's half of a sample.
            let mut case = in_case(without(packets, |k| k + 1 == hit));
            (case.signs, case.lost) = (vec![Sign::Trouble(Trouble::LoneHalves)], (1, 1));
            case.missing = Missing::AsLost;
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
        "byte deleted" if !stream.has_checksum => return Err("a missing digit leaves a number: no checksum"),
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
            let mut case = in_case(stream.packets(&late));
            // A tick of 16 bits that jumps is first of all a gap.
            case.signs = vec![Sign::Trouble(Trouble::ClockStep), Sign::Trouble(Trouble::Gap)];
            case.lost = (0, 2);
            case
        }
        "clock wraps" => {
            has_clock()?;
            let wraps_after_us = stream.wraps_after_us.ok_or("64 bits: it does not wrap")?;
            let mut wrapping = samples(stream, end_ms, wraps_after_us - 1000 * begins_ms);
            wrapping.iter_mut().for_each(|sample| sample.device_us %= wraps_after_us);
            in_case(stream.packets(&wrapping))
        }
        "packet twice" => {
            has_clock()?;
            let mut doubled = packets;
            doubled.insert(hit, doubled[hit].clone());
            let mut case = in_case(doubled);
            (case.signs, case.repeated) = (vec![Sign::Trouble(Trouble::RepeatedPackets)], 1);
            case
        }
        "packets swapped" => {
            has_clock()?;
            let mut swapped = packets;
            swapped.swap(hit, hit + 1);
            let mut case = in_case(swapped);
            case.signs = vec![Sign::Trouble(Trouble::RepeatedPackets), Sign::Trouble(Trouble::LoneHalves)];
            (case.lost, case.repeated) = if stream.is_can() { ((2, 2), 0) } else { ((1, 1), 1) };
            case
        }
        "rate halved" => {
            has_clock()?;
            let mut slower = clean;
            slower.retain(|sample| {
                sample.at_ms < begins_ms || (sample.at_ms - begins_ms) / stream.period_ms % 2 == 1
            });
            let missing =
                (stream.packets(&samples(stream, end_ms, START_US)).iter().filter(|p| p.sample).count()
                    - slower.len()) as u64;
            let mut case = in_case(stream.packets(&slower));
            (case.signs, case.lost) = (vec![Sign::Trouble(Trouble::RateChange)], (missing, missing));
            case
        }
        "saturation" | "NaN" => {
            let content = if fault == "NaN" { Content::NotANumber } else { Content::Saturated };
            match content {
                Content::NotANumber if stream.is_can() => return Err("integers only"),
                Content::Saturated if !stream.tells_clipping => {
                    return Err("full scale is not in the stream");
                }
                _ => {}
            }
            let mut changed = clean;
            let mut count = 0;
            for sample in changed.iter_mut().filter(|sample| in_span(sample.at_ms)) {
                sample.content = content;
                count += 1;
            }
            let mut case = in_case(stream.packets(&changed));
            case.ends_ms = ends_ms;
            (case.signs, case.lost) = match content {
                // A log line with `nan` is a line that does not read.
                Content::NotANumber if !stream.can_say_nan => {
                    (vec![Sign::Trouble(Trouble::DamagedPackets)], (count, count))
                }
                Content::NotANumber => (vec![Sign::Trouble(Trouble::NotFinite)], (count, count)),
                _ => (vec![Sign::Trouble(Trouble::Clipping)], (0, 0)),
            };
            case
        }
        "silence" if begins_ms < ALIGNED_MS => return Err("no sample is given out yet: waiting"),
        "silence" => {
            let mut silent = clean;
            let all = silent.len();
            silent.retain(|sample| !in_span(sample.at_ms));
            let lost = (all - silent.len()) as u64;
            let mut case = in_case(stream.packets(&silent));
            (case.signs, case.ends_ms, case.lost) = (vec![Sign::Silence], ends_ms, (lost, lost));
            case
        }
        "receive overflow" => {
            let mut case = spanned(stream, in_case(packets), begins_ms + 40);
            case.signs =
                vec![Sign::Trouble(Trouble::MissingPackets), Sign::Trouble(Trouble::Gap), Sign::Silence];
            case
        }
        "bus off" | "interface down" => {
            only_can()?;
            let is_bus_off = fault == "bus off";
            let mut case = spanned(stream, in_case(packets), ends_ms);
            let state = if is_bus_off { BusState::BusOff } else { BusState::InterfaceDown };
            case.signs =
                vec![Sign::Trouble(if is_bus_off { Trouble::BusOff } else { Trouble::InterfaceDown })];
            case.status = Arc::new(move |now_ms| LinkStatus {
                bus_errors: u64::from(now_ms >= begins_ms),
                bus_off: u64::from(is_bus_off && now_ms >= begins_ms),
                bus_state: if in_span(now_ms) { state } else { BusState::ErrorActive },
                ..LinkStatus::default()
            });
            case
        }
        other => unreachable!("{other}"),
    })
}

fn without(packets: Vec<Packet>, gone: impl Fn(usize) -> bool) -> Vec<Packet> {
    packets.into_iter().enumerate().filter(|(k, _)| !gone(*k)).map(|(_, packet)| packet).collect()
}

/// Packets from the fault's beginning to `ends_ms` do not arrive.
fn spanned(stream: &Stream, mut case: Case, ends_ms: u64) -> Case {
    let (begins_ms, all) = (case.begins_ms, std::mem::take(&mut case.packets));
    let (gone, left): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|packet| (begins_ms..ends_ms).contains(&packet.at_ms));
    let lost = gone.iter().filter(|packet| packet.sample).count() as u64;
    case.lost = (lost, lost);
    // Of a CAN device only the halves of samples are counted.
    let counted = |packet: &&Packet| !stream.is_can() || packet.id.is_some_and(|id| id & 0xF < 2);
    case.missing = Missing::AtLeast(gone.iter().filter(counted).count() as u64);
    (case.packets, case.ends_ms) = (left, ends_ms);
    case
}

/// One packet arrives damaged. Where packets are told apart by what stands between them, the next may go with it.
fn damaged(stream: &Stream, mut case: Case, hit: usize, damage: impl Fn(&mut Vec<u8>)) -> Case {
    damage(&mut case.packets[hit].bytes);
    case.signs = vec![Sign::Trouble(Trouble::DamagedPackets), Sign::Trouble(Trouble::StrayBytes)];
    let delimited = matches!(stream.name, "otolith-serial" | "text");
    (case.lost, case.missing) = ((1, if delimited { 2 } else { 1 }), Missing::AsLost);
    case
}

/// The port reads at half the device's baud for a while: each byte comes as it would.
fn wrong_baud(stream: &Stream, case: Case, ends_ms: u64) -> Case {
    let begins_ms = case.begins_ms;
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
    case.signs =
        vec![Sign::Trouble(Trouble::DamagedPackets), Sign::Trouble(Trouble::StrayBytes), Sign::Silence];
    // Where packets are told apart by what stands between them, the first good one may go with the last bad one.
    case.lost.1 += 1;
    case
}

fn misread(sent: &[u8]) -> Vec<u8> {
    let wrong = WrongBaud { sent_baud: 115_200, read_baud: 57_600, keep_framing_errors: true };
    let mut read = Vec::new();
    wrong.misread(sent, &mut read);
    read
}
