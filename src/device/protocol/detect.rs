//! Which protocol a device speaks: by name, or by who understands it.

use super::native_can::NativeCanDecoder;
use super::native_serial::NativeSerialDecoder;
use super::{DecodeCounters, DeviceInfo, ImuReading, PacketDecoder, SyncEstimate};
use crate::device::{DeviceError, Selector, Traffic};

/// Our protocol on a serial line.
pub const OTOLITH_SERIAL: &str = "otolith-serial";
/// Our protocol on classic CAN.
pub const OTOLITH_CAN: &str = "otolith-can";
/// Lines of text, described by a mapping file.
pub const TEXT: &str = "text";
/// Every name `--protocol` takes.
pub const PROTOCOLS: [&str; 3] = [OTOLITH_SERIAL, OTOLITH_CAN, TEXT];

/// Good packets after which a protocol counts as found. A checksum of 16 bits is right by chance once in 65536.
const CERTAIN_AFTER: u64 = 3;

/// The decoder of the protocol called `name`.
///
/// # Errors
/// [`DeviceError::UnknownProtocol`] with the names there are; [`DeviceError::NeedsMapping`] for text, whose decoder
/// is made from a mapping.
pub fn decoder_by_name(name: &str) -> Result<Box<dyn PacketDecoder>, DeviceError> {
    match name {
        OTOLITH_SERIAL => Ok(Box::new(NativeSerialDecoder::new())),
        OTOLITH_CAN => Ok(Box::new(NativeCanDecoder::new(None))),
        TEXT => Err(DeviceError::NeedsMapping),
        _ => Err(DeviceError::UnknownProtocol { got: name.to_owned(), known: PROTOCOLS.join(", ") }),
    }
}

/// The decoder for a device whose protocol was not named.
pub fn decoder_for(selector: &Selector) -> Box<dyn PacketDecoder> {
    match selector {
        Selector::Can { node, .. } | Selector::Slcan { node, .. } => Box::new(NativeCanDecoder::new(*node)),
        Selector::Mock(_) => Box::new(NativeSerialDecoder::new()),
        Selector::Serial { .. } | Selector::Replay { .. } => Box::new(AutoDecoder::new()),
    }
}

/// Shows the traffic to every decoder until one has understood it, then to that one alone.
///
/// Readings come from the decoder with the most good packets. [`PacketDecoder::protocol`] says `unknown` until a
/// protocol is certain.
pub struct AutoDecoder {
    candidates: Vec<Box<dyn PacketDecoder>>,
}

impl std::fmt::Debug for AutoDecoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.candidates.iter().map(|decoder| decoder.protocol()).collect();
        f.debug_struct("AutoDecoder").field("candidates", &names).finish()
    }
}

impl Default for AutoDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl AutoDecoder {
    /// A decoder that knows nothing yet.
    pub fn new() -> Self {
        Self { candidates: vec![Box::new(NativeSerialDecoder::new()), Box::new(NativeCanDecoder::new(None))] }
    }

    /// The decoder that understands most; of several that understand nothing, the one that has skipped most, so
    /// that silence and noise look different.
    fn leader(&self) -> Option<&dyn PacketDecoder> {
        let best = self.candidates.iter().max_by_key(|decoder| {
            let DecodeCounters { packets, bytes_skipped, .. } = decoder.counters();
            (packets, bytes_skipped)
        })?;
        Some(best.as_ref())
    }
}

impl PacketDecoder for AutoDecoder {
    fn protocol(&self) -> &'static str {
        match self.candidates.as_slice() {
            [found] => found.protocol(),
            _ => "unknown",
        }
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        if let [found] = self.candidates.as_mut_slice() {
            return found.push(traffic, on_reading);
        }
        for index in 0..self.candidates.len() {
            let others = self.candidates.iter().enumerate().filter(|(other, _)| *other != index);
            let most_of_others = others.map(|(_, decoder)| decoder.counters().packets).max().unwrap_or(0);
            let candidate = &mut self.candidates[index];
            let leads = candidate.counters().packets >= most_of_others;
            candidate.push(traffic, &mut |reading| {
                if leads {
                    on_reading(reading);
                }
            });
        }
        let certain = self.candidates.iter().position(|decoder| decoder.counters().packets >= CERTAIN_AFTER);
        if let Some(found) = certain {
            self.candidates.swap(0, found);
            self.candidates.truncate(1);
        }
    }

    fn counters(&self) -> DecodeCounters {
        self.leader().map(PacketDecoder::counters).unwrap_or_default()
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
            [found] => found.poll_transmit(host_time_us, out),
            _ => None,
        }
    }

    fn rejoin(&mut self) {
        self.candidates.iter_mut().for_each(|decoder| decoder.rejoin());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::mock::{MockChair, MockParams};
    use crate::device::testing::drain;

    #[test]
    fn every_name_is_known_and_others_are_refused() {
        for name in [OTOLITH_SERIAL, OTOLITH_CAN] {
            assert_eq!(decoder_by_name(name).expect("known").protocol(), name);
        }
        let text = decoder_by_name("xbus").err().expect("unknown").to_string();
        assert!(
            text.contains("protocol `xbus` is not known")
                && text.contains("otolith-serial, otolith-can, text")
        );
        assert!(decoder_by_name(TEXT).err().expect("needs a mapping").to_string().contains("--log-map"));
    }

    #[test]
    fn the_serial_protocol_is_found_without_losing_a_sample() {
        let params = MockParams { rest_s: 0.5, ..MockParams::rest() };
        let mut decoder = AutoDecoder::new();
        let mut readings = 0;
        assert_eq!(decoder.protocol(), "unknown");
        for (_, bytes) in drain(&mut MockChair::new(params).expect("in range")) {
            decoder.push(Traffic::Bytes(&bytes), &mut |_| readings += 1);
        }
        assert_eq!((decoder.protocol(), readings), (OTOLITH_SERIAL, 501));
        assert_eq!(decoder.counters().bytes_skipped, 0);
        assert_eq!(decoder.announced_rate_hz(), Some(1000.0));
    }

    #[test]
    fn noise_is_nobodys_and_is_counted() {
        let mut decoder = AutoDecoder::new();
        for _ in 0..100 {
            decoder.push(Traffic::Bytes(&[0x55; 50]), &mut |_| panic!("no sample in this"));
        }
        assert_eq!(decoder.protocol(), "unknown");
        assert_eq!((decoder.counters().packets, decoder.counters().bytes_skipped > 4000), (0, true));
        assert_eq!(decoder.poll_transmit(5_000_000, &mut [0; 64]), None, "nothing is sent to a stranger");
    }
}
