//! Which protocol a device speaks: by name, or by who understands it.

use super::bno08x_rvc::Bno08xRvcDecoder;
use super::can_map::can_map_names;
use super::mavlink::MavlinkDecoder;
use super::mip::MipDecoder;
use super::native_can::NativeCanDecoder;
use super::native_serial::NativeSerialDecoder;
use super::openimu::OpenImuDecoder;
use super::vectornav::VectorNavDecoder;
use super::witmotion::can::WitMotionCanDecoder;
use super::witmotion::serial::WitMotionDecoder;
use super::xbus::XbusDecoder;
use super::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, SyncEstimate};
use crate::device::{CanDevice, DeviceError, Selector, Traffic};

/// Our protocol on a serial line.
pub const OTOLITH_SERIAL: &str = "otolith-serial";
/// Our protocol on classic CAN.
pub const OTOLITH_CAN: &str = "otolith-can";
/// Aceinna OpenIMU on a serial line.
pub const OPENIMU: &str = "openimu";
/// CEVA BNO08x in UART-RVC mode.
pub const BNO08X_RVC: &str = "bno08x-rvc";
/// WitMotion on a serial line.
pub const WITMOTION: &str = "witmotion";
/// WitMotion on CAN.
pub const WITMOTION_CAN: &str = "witmotion-can";
/// VectorNav's binary frames and ASCII sentences.
pub const VECTORNAV: &str = "vectornav";
/// MAVLink 2 and 1.
pub const MAVLINK: &str = "mavlink";
/// MicroStrain inertial sensors.
pub const MIP: &str = "mip";
/// Xsens (Movella) MTi on a serial line.
pub const XBUS: &str = "xbus";
/// Lines of text, described by a mapping file.
pub const TEXT: &str = "text";
/// CAN frames, described by a DBC file and a mapping.
pub const CAN_MAP: &str = "can-map";

/// What kind of traffic carries a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bus {
    /// Bytes.
    Serial,
    /// CAN frames.
    Can,
}

/// A protocol otolith reads.
#[derive(Clone, Copy, Debug)]
pub struct Protocol {
    /// Name, as `--protocol` takes it.
    pub name: &'static str,
    /// What carries it.
    pub bus: Bus,
    /// Good packets after which it counts as found; `None` when it is never looked for. The weaker the checksum, the
    /// more: 16 bits are right by chance once in 65536, 8 bits once in 256.
    pub certain_after: Option<u64>,
    /// Makes a decoder; `None` when that takes a mapping.
    make: Option<fn() -> Box<dyn PacketDecoder>>,
}

/// Every protocol, those that are looked for in the order in which ties are decided.
pub const PROTOCOLS: &[Protocol] = &[
    Protocol {
        name: OTOLITH_SERIAL,
        bus: Bus::Serial,
        certain_after: Some(3),
        make: Some(|| Box::new(NativeSerialDecoder::new())),
    },
    Protocol {
        name: OTOLITH_CAN,
        bus: Bus::Can,
        certain_after: Some(3),
        make: Some(|| Box::new(NativeCanDecoder::new(None))),
    },
    Protocol {
        name: VECTORNAV,
        bus: Bus::Serial,
        // An XOR of 8 bits alone would be weak, but a sentence has 32 more that must be right.
        certain_after: Some(3),
        make: Some(|| Box::new(VectorNavDecoder::new())),
    },
    Protocol {
        name: MAVLINK,
        bus: Bus::Serial,
        certain_after: Some(3),
        make: Some(|| Box::new(MavlinkDecoder::new())),
    },
    Protocol {
        name: MIP,
        bus: Bus::Serial,
        certain_after: Some(3),
        make: Some(|| Box::new(MipDecoder::new())),
    },
    Protocol {
        name: OPENIMU,
        bus: Bus::Serial,
        certain_after: Some(3),
        make: Some(|| Box::new(OpenImuDecoder::new())),
    },
    Protocol {
        name: XBUS,
        bus: Bus::Serial,
        certain_after: Some(8),
        make: Some(|| Box::new(XbusDecoder::new())),
    },
    Protocol {
        name: BNO08X_RVC,
        bus: Bus::Serial,
        certain_after: Some(12),
        make: Some(|| Box::new(Bno08xRvcDecoder::new(false))),
    },
    Protocol {
        name: WITMOTION,
        bus: Bus::Serial,
        certain_after: Some(20),
        make: Some(|| Box::new(WitMotionDecoder::new())),
    },
    Protocol {
        name: WITMOTION_CAN,
        bus: Bus::Can,
        certain_after: Some(20),
        make: Some(|| Box::new(WitMotionCanDecoder::new(None))),
    },
    Protocol { name: TEXT, bus: Bus::Serial, certain_after: None, make: None },
    Protocol { name: CAN_MAP, bus: Bus::Can, certain_after: None, make: None },
];

/// Share of all bytes that a protocol must understand to count as found: a checksum that is right by chance now and
/// then does not make noise a protocol.
const UNDERSTOOD_SHARE: f64 = 0.5;

/// Bytes, longer than any frame in use, without which nobody can say yet that they are of no packet.
pub const LONGEST_FRAME_BYTES: u64 = 2048;

/// Share of the bytes of a short capture that may be none of the protocol's.
const NOISE_SHARE: f64 = 0.1;

/// The names of all protocols, for people.
pub fn protocol_names() -> String {
    PROTOCOLS.iter().map(|protocol| protocol.name).collect::<Vec<_>>().join(", ")
}

/// The names of the protocols that are looked for on a bus, for people.
pub fn detected_names(bus: Bus) -> String {
    let looked_for =
        PROTOCOLS.iter().filter(|protocol| protocol.bus == bus && protocol.certain_after.is_some());
    looked_for.map(|protocol| protocol.name).collect::<Vec<_>>().join(", ")
}

/// The decoder of the protocol called `name`.
///
/// # Errors
/// [`DeviceError::UnknownProtocol`] with the names there are; [`DeviceError::NeedsMapping`] and
/// [`DeviceError::NeedsCanMap`] for those whose decoder is made from a mapping.
pub fn decoder_by_name(name: &str) -> Result<Box<dyn PacketDecoder>, DeviceError> {
    match PROTOCOLS.iter().find(|protocol| protocol.name == name) {
        Some(Protocol { make: Some(make), .. }) => Ok(make()),
        Some(Protocol { bus: Bus::Serial, .. }) => Err(DeviceError::NeedsMapping),
        Some(Protocol { bus: Bus::Can, .. }) => Err(DeviceError::NeedsCanMap { ready: can_map_names() }),
        None => Err(DeviceError::UnknownProtocol { got: name.to_owned(), known: protocol_names() }),
    }
}

/// The decoder for the device that `selector` names, of the protocol called `name` if one is named.
///
/// # Errors
/// As [`decoder_by_name`], and [`DeviceError::Selector`] for a protocol of another bus or of another device than the
/// selector's.
pub fn decoder_for(selector: &Selector, name: Option<&str>) -> Result<Box<dyn PacketDecoder>, DeviceError> {
    if let Some(name) = name {
        check_fits(selector, name)?;
    }
    Ok(match (selector.can_device(), name) {
        (CanDevice::Node(node), _) => Box::new(NativeCanDecoder::new(Some(node))),
        (CanDevice::WitMotion(id), _) => Box::new(WitMotionCanDecoder::new(Some(id))),
        (CanDevice::First, Some(name)) => decoder_by_name(name)?,
        (CanDevice::First, None) => match selector {
            Selector::Can { .. } | Selector::Slcan { .. } => Box::new(AutoDecoder::on(&[Bus::Can])),
            Selector::Mock(_) => Box::new(NativeSerialDecoder::new()),
            Selector::Serial { .. } => Box::new(AutoDecoder::on(&[Bus::Serial])),
            Selector::Replay { .. } => Box::new(AutoDecoder::on(&[Bus::Serial, Bus::Can])),
        },
    })
}

/// Whether the device that `selector` names can speak the protocol called `name`. An unknown name fits: it is refused
/// where its decoder is made.
///
/// # Errors
/// [`DeviceError::Selector`].
pub fn check_fits(selector: &Selector, name: &str) -> Result<(), DeviceError> {
    let wrong = |problem: String, hint: &str| {
        Err(DeviceError::Selector { selector: selector.to_string(), problem, hint: hint.to_owned() })
    };
    let of_device = match selector.can_device() {
        CanDevice::First => None,
        CanDevice::Node(_) => Some(OTOLITH_CAN),
        CanDevice::WitMotion(_) => Some(WITMOTION_CAN),
    };
    if let Some(own) = of_device.filter(|own| *own != name) {
        let hint = "leave the protocol out, or the option that names the device";
        return wrong(format!("it names a device that speaks {own}, and the protocol is to be {name}"), hint);
    }
    let bus = match selector {
        Selector::Serial { .. } => Bus::Serial,
        Selector::Can { .. } | Selector::Slcan { .. } => Bus::Can,
        Selector::Mock(_) | Selector::Replay { .. } => return Ok(()),
    };
    match PROTOCOLS.iter().find(|protocol| protocol.name == name) {
        Some(protocol) if protocol.bus != bus => {
            let (is, needs) = match bus {
                Bus::Serial => ("a serial line", "a CAN bus"),
                Bus::Can => ("a CAN bus", "a serial line"),
            };
            let hint = "leave the protocol out: `otolith devices` says what is spoken where";
            wrong(format!("this is {is}, and the protocol {name} is one of {needs}"), hint)
        }
        _ => Ok(()),
    }
}

/// A protocol that may be the one, with its decoder.
struct Candidate {
    decoder: Box<dyn PacketDecoder>,
    bus: Bus,
    certain_after: u64,
}

impl Candidate {
    /// Whether this is the protocol, after `bytes` bytes of serial traffic.
    fn is_certain(&self, bytes: u64) -> bool {
        let DecodeCounters { packets, bytes_skipped, .. } = self.decoder.counters();
        let understood = bytes.saturating_sub(bytes_skipped) as f64;
        packets >= self.certain_after && understood >= UNDERSTOOD_SHARE * bytes as f64
    }
}

/// Shows the traffic to every decoder until one has understood it, then to that one alone.
///
/// Readings come from the decoder with the most good packets. [`PacketDecoder::protocol`] says `unknown` until a
/// protocol is certain.
pub struct AutoDecoder {
    candidates: Vec<Candidate>,
    bytes: u64,
    /// Frames of a CAN bus.
    frames: u64,
    /// The one candidate left is certain: not being told from others is no proof.
    found: bool,
}

impl std::fmt::Debug for AutoDecoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.candidates.iter().map(|candidate| candidate.decoder.protocol()).collect();
        f.debug_struct("AutoDecoder").field("candidates", &names).finish_non_exhaustive()
    }
}

impl AutoDecoder {
    /// A decoder that knows nothing yet, for traffic of these kinds.
    pub fn on(buses: &[Bus]) -> Self {
        let possible = PROTOCOLS.iter().filter(|protocol| buses.contains(&protocol.bus));
        let candidates = possible
            .filter_map(|protocol| {
                let (decoder, certain_after) = (protocol.make?(), protocol.certain_after?);
                Some(Candidate { decoder, bus: protocol.bus, certain_after })
            })
            .collect();
        Self { candidates, bytes: 0, frames: 0, found: false }
    }

    /// The decoder that understands most; of several that understand nothing, the one that has skipped most, so
    /// that silence and noise look different.
    fn leader(&self) -> Option<&dyn PacketDecoder> {
        let best = self.candidates.iter().max_by_key(|candidate| {
            let DecodeCounters { packets, bytes_skipped, .. } = candidate.decoder.counters();
            (packets, bytes_skipped)
        })?;
        Some(best.decoder.as_ref())
    }

    /// From now on the traffic is shown to this candidate alone.
    fn settle_on(&mut self, found: usize) {
        self.candidates.swap(0, found);
        self.candidates.truncate(1);
        self.found = true;
    }

    /// Of a capture too short to be certain: the one decoder that understands anything, if that is nearly all of it.
    fn only_explanation(&self) -> Option<usize> {
        let understands = |candidate: &Candidate| candidate.decoder.counters().packets > 0;
        let only = self.candidates.iter().position(understands)?;
        let alone = self.candidates[only + 1..].iter().all(|other| !understands(other));
        let skipped = self.candidates[only].decoder.counters().bytes_skipped as f64;
        (alone && self.bytes > 0 && skipped <= NOISE_SHARE * self.bytes as f64).then_some(only)
    }

    /// Calls `act` on every candidate of `buses`, with readings from the leader alone.
    fn with_each(
        &mut self,
        buses: &[Bus],
        on_reading: &mut dyn FnMut(ImuReading),
        act: impl Fn(&mut dyn PacketDecoder, &mut dyn FnMut(ImuReading)),
    ) {
        if let [found] = self.candidates.as_mut_slice() {
            return act(found.decoder.as_mut(), on_reading);
        }
        for index in 0..self.candidates.len() {
            if !buses.contains(&self.candidates[index].bus) {
                continue;
            }
            let others = self.candidates.iter().enumerate().filter(|(other, _)| *other != index);
            let most_of_others =
                others.map(|(_, candidate)| candidate.decoder.counters().packets).max().unwrap_or(0);
            let decoder = self.candidates[index].decoder.as_mut();
            let leads = decoder.counters().packets >= most_of_others;
            act(decoder, &mut |reading| {
                if leads {
                    on_reading(reading);
                }
            });
        }
    }
}

impl PacketDecoder for AutoDecoder {
    fn protocol(&self) -> &'static str {
        match self.candidates.as_slice() {
            [found] if self.found => found.decoder.protocol(),
            _ => "unknown",
        }
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let bus = match traffic {
            Traffic::Bytes(_) => Bus::Serial,
            Traffic::CanFrame { .. } => Bus::Can,
        };
        self.with_each(&[bus], on_reading, |decoder, on_reading| decoder.push(traffic, on_reading));
        if !self.found {
            match traffic {
                Traffic::Bytes(bytes) => self.bytes += bytes.len() as u64,
                Traffic::CanFrame { .. } => self.frames += 1,
            }
            if let Some(found) = self.candidates.iter().position(|candidate| candidate.is_certain(self.bytes))
            {
                self.settle_on(found);
            }
        }
    }

    fn counters(&self) -> DecodeCounters {
        let counters = self.leader().map(PacketDecoder::counters).unwrap_or_default();
        if self.found {
            return counters;
        }
        // Before anybody is followed, every frame of a bus is somebody else's.
        DecodeCounters {
            unknown: counters.unknown.max(self.frames.saturating_sub(counters.packets)),
            ..counters
        }
    }

    fn announced_rate_hz(&self) -> Option<f64> {
        self.leader()?.announced_rate_hz()
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.leader()?.device()
    }

    fn sync_estimate(&self) -> Option<SyncEstimate> {
        self.leader()?.sync_estimate()
    }

    fn wire_bytes_per_sample(&self) -> Option<f64> {
        self.leader()?.wire_bytes_per_sample()
    }

    fn poll_transmit(&mut self, host_time_us: u64, out: &mut [u8; 64]) -> Option<usize> {
        match self.candidates.as_mut_slice() {
            [found] if self.found => found.decoder.poll_transmit(host_time_us, out),
            _ => None,
        }
    }

    fn rejoin(&mut self) {
        self.candidates.iter_mut().for_each(|candidate| candidate.decoder.rejoin());
    }

    fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        let buses = [Bus::Serial, Bus::Can];
        self.with_each(&buses, on_reading, |decoder, on_reading| decoder.finish(on_reading));
        if !self.found
            && let Some(only) = self.only_explanation()
        {
            self.settle_on(only);
        }
    }

    fn notes(&self) -> Vec<String> {
        self.leader().map(PacketDecoder::notes).unwrap_or_default()
    }

    fn allow_degraded(&mut self) {
        self.candidates.iter_mut().for_each(|candidate| candidate.decoder.allow_degraded());
    }
}

#[cfg(test)]
mod tests;
