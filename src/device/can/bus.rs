//! What a CAN controller says about its bus: error frames as words and states.
//!
//! Layout of an error frame: `linux/can/error.h` of the kernel. The class stands in the identifier, details in the
//! data bytes.

use std::fmt;

use serde::{Serialize, Serializer};

/// State of a CAN interface, in the words of `ip -details link`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusState {
    /// Nothing has been said yet; a virtual interface never says anything.
    #[default]
    Unknown,
    /// Takes part in everything.
    ErrorActive,
    /// One of the error counters has passed 96.
    ErrorWarning,
    /// One of the error counters has passed 127: errors of others are no longer flagged.
    ErrorPassive,
    /// The controller has left the bus until it is restarted.
    BusOff,
    /// The interface is switched off by the system.
    InterfaceDown,
}

impl BusState {
    /// What the user can do about it, to append to an event; empty where there is nothing to do.
    pub fn advice(self) -> &'static str {
        match self {
            BusState::BusOff => {
                "; nothing is received until it is restarted: `ip link set INTERFACE type can restart`, \
                 or by itself with `restart-ms 100`"
            }
            BusState::InterfaceDown => "; `ip link set INTERFACE up` brings it back",
            BusState::ErrorWarning | BusState::ErrorPassive => "; check bitrate, wiring and termination",
            BusState::Unknown | BusState::ErrorActive => "",
        }
    }
}

impl fmt::Display for BusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            BusState::Unknown => "unknown",
            BusState::ErrorActive => "error-active",
            BusState::ErrorWarning => "error-warning",
            BusState::ErrorPassive => "error-passive",
            BusState::BusOff => "bus-off",
            BusState::InterfaceDown => "interface-down",
        })
    }
}

impl Serialize for BusState {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// One kind of trouble on a CAN bus. States of the controller are in [`BusState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum BusFault {
    /// The driver gave up sending.
    TransmitTimeout,
    /// Another node had the more urgent frame.
    ArbitrationLost,
    /// The controller's receive buffer was full.
    ReceiveOverflow,
    /// The controller's transmit buffer was full.
    TransmitOverflow,
    /// A bit on the bus was not the one sent.
    BitError,
    /// A fixed field of a frame had the wrong form.
    FormError,
    /// More than five equal bits in a row.
    StuffError,
    /// A checksum was wrong.
    ChecksumError,
    /// Another violation of the protocol.
    ProtocolError,
    /// Trouble of the transceiver: a wire is broken or shorted.
    TransceiverFault,
    /// No other node has acknowledged a frame: alone on the bus, or the wrong bitrate.
    NoAcknowledgement,
    /// A bus error without details.
    BusError,
    /// A slcan adapter answered a command or a frame with its error character.
    AdapterError,
}

impl BusFault {
    /// All kinds, in the order of their numbers.
    const ALL: [BusFault; 13] = [
        BusFault::TransmitTimeout,
        BusFault::ArbitrationLost,
        BusFault::ReceiveOverflow,
        BusFault::TransmitOverflow,
        BusFault::BitError,
        BusFault::FormError,
        BusFault::StuffError,
        BusFault::ChecksumError,
        BusFault::ProtocolError,
        BusFault::TransceiverFault,
        BusFault::NoAcknowledgement,
        BusFault::BusError,
        BusFault::AdapterError,
    ];
}

impl fmt::Display for BusFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            BusFault::TransmitTimeout => "transmit timeout",
            BusFault::ArbitrationLost => "arbitration lost",
            BusFault::ReceiveOverflow => "controller receive overflow",
            BusFault::TransmitOverflow => "controller transmit overflow",
            BusFault::BitError => "bit error",
            BusFault::FormError => "form error",
            BusFault::StuffError => "stuff error",
            BusFault::ChecksumError => "checksum error",
            BusFault::ProtocolError => "protocol error",
            BusFault::TransceiverFault => "transceiver fault",
            BusFault::NoAcknowledgement => "no acknowledgement",
            BusFault::BusError => "bus error",
            BusFault::AdapterError => "error answer of the adapter",
        })
    }
}

/// A set of [`BusFault`]s. Serialises as a list of words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusFaults(u16);

impl BusFaults {
    /// Adds one kind.
    pub fn insert(&mut self, fault: BusFault) {
        self.0 |= 1 << fault as u8;
    }

    /// Those in either set.
    pub fn union(self, other: BusFaults) -> BusFaults {
        BusFaults(self.0 | other.0)
    }

    /// Those that are not in `known`.
    pub fn without(self, known: BusFaults) -> BusFaults {
        BusFaults(self.0 & !known.0)
    }

    /// The members.
    pub fn iter(self) -> impl Iterator<Item = BusFault> {
        BusFault::ALL.into_iter().filter(move |fault| self.0 & (1 << *fault as u8) != 0)
    }
}

impl Serialize for BusFaults {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter().map(|fault| fault.to_string()))
    }
}

/// What one error frame says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusReport {
    /// Kinds of trouble.
    pub faults: BusFaults,
    /// The state the controller is in now, if the frame tells.
    pub state: Option<BusState>,
}

/// Error classes in the identifier (`CAN_ERR_...`).
mod class {
    pub(super) const TX_TIMEOUT: u32 = 0x001;
    pub(super) const LOST_ARBITRATION: u32 = 0x002;
    pub(super) const CONTROLLER: u32 = 0x004;
    pub(super) const PROTOCOL: u32 = 0x008;
    pub(super) const TRANSCEIVER: u32 = 0x010;
    pub(super) const NO_ACKNOWLEDGEMENT: u32 = 0x020;
    pub(super) const BUS_OFF: u32 = 0x040;
    pub(super) const BUS_ERROR: u32 = 0x080;
    pub(super) const RESTARTED: u32 = 0x100;
}

/// Location of a protocol error in data byte 3 that means the checksum (`CAN_ERR_PROT_LOC_CRC_SEQ`, `..._CRC_DEL`).
const AT_CHECKSUM: [u8; 2] = [0x08, 0x18];

impl BusReport {
    /// Reads an error frame: identifier without flag bits and data bytes. Missing bytes count as 0.
    pub fn decode(id: u32, data: &[u8]) -> Self {
        let byte = |index: usize| data.get(index).copied().unwrap_or(0);
        let mut faults = BusFaults::default();
        for (bit, fault) in [
            (class::TX_TIMEOUT, BusFault::TransmitTimeout),
            (class::LOST_ARBITRATION, BusFault::ArbitrationLost),
            (class::TRANSCEIVER, BusFault::TransceiverFault),
            (class::NO_ACKNOWLEDGEMENT, BusFault::NoAcknowledgement),
        ] {
            if id & bit != 0 {
                faults.insert(fault);
            }
        }
        let controller = if id & class::CONTROLLER != 0 { byte(1) } else { 0 };
        if controller & 0x01 != 0 {
            faults.insert(BusFault::ReceiveOverflow);
        }
        if controller & 0x02 != 0 {
            faults.insert(BusFault::TransmitOverflow);
        }
        if id & class::PROTOCOL != 0 {
            faults = faults.union(protocol_faults(byte(2), byte(3)));
        } else if id & class::BUS_ERROR != 0 {
            // Drivers set it beside the protocol class, which says more.
            faults.insert(BusFault::BusError);
        }
        Self { faults, state: state(id, controller) }
    }
}

fn protocol_faults(kind: u8, location: u8) -> BusFaults {
    let mut faults = BusFaults::default();
    for (bits, fault) in
        [(0x19, BusFault::BitError), (0x02, BusFault::FormError), (0x04, BusFault::StuffError)]
    {
        if kind & bits != 0 {
            faults.insert(fault);
        }
    }
    if AT_CHECKSUM.contains(&location) {
        faults.insert(BusFault::ChecksumError);
    }
    if faults == BusFaults::default() {
        faults.insert(BusFault::ProtocolError);
    }
    faults
}

/// The state that class bits and the controller byte announce; the worst one where there are several.
fn state(id: u32, controller: u8) -> Option<BusState> {
    if id & class::BUS_OFF != 0 {
        Some(BusState::BusOff)
    } else if controller & 0x30 != 0 {
        Some(BusState::ErrorPassive)
    } else if controller & 0x0C != 0 {
        Some(BusState::ErrorWarning)
    } else if controller & 0x40 != 0 || id & class::RESTARTED != 0 {
        Some(BusState::ErrorActive)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn words(report: BusReport) -> Vec<String> {
        report.faults.iter().map(|fault| fault.to_string()).collect()
    }

    #[test]
    fn error_frames_become_words_and_states() {
        // Meanings from the kernel's linux/can/error.h; the frames are what its drivers send.
        for (id, data, faults, state) in [
            (0x040, &[0; 8][..], "", Some(BusState::BusOff)),
            (0x204, &[0, 0x0C, 0, 0, 0, 0, 97, 97], "", Some(BusState::ErrorWarning)),
            (0x204, &[0, 0x20, 0, 0, 0, 0, 128, 0], "", Some(BusState::ErrorPassive)),
            (0x204, &[0, 0x40, 0, 0, 0, 0, 90, 0], "", Some(BusState::ErrorActive)),
            (0x004, &[0, 0x01], "controller receive overflow", None),
            (0x100, &[0; 8], "", Some(BusState::ErrorActive)),
            (0x002, &[5], "arbitration lost", None),
            (0x020, &[], "no acknowledgement", None),
            (0x088, &[0, 0, 0x04, 0x0A], "stuff error", None),
            (0x088, &[0, 0, 0x00, 0x08], "checksum error", None),
            (0x088, &[0; 8], "protocol error", None),
            (0x080, &[0; 8], "bus error", None),
            (0x200, &[0, 0, 0, 0, 0, 0, 1, 2], "", None),
        ] {
            let report = BusReport::decode(id, data);
            assert_eq!((words(report).join(", ").as_str(), report.state), (faults, state), "{id:03X}");
        }
        // A driver puts several classes into one frame; the worst state counts.
        let many = BusReport::decode(0x06C, &[0, 0x30, 0x01, 0, 0, 0, 0, 0]);
        assert_eq!(words(many), ["bit error", "no acknowledgement"]);
        assert_eq!(many.state, Some(BusState::BusOff));
    }

    #[test]
    fn sets_serialise_as_words() {
        let mut faults = BusFaults::default();
        faults.insert(BusFault::NoAcknowledgement);
        faults.insert(BusFault::ArbitrationLost);
        let json = serde_json::to_string(&(faults, BusState::BusOff)).expect("serialises");
        assert_eq!(json, r#"[["arbitration lost","no acknowledgement"],"bus-off"]"#);
        assert_eq!(faults.without(faults), BusFaults::default());
    }

    #[test]
    fn every_kind_has_its_own_number() {
        for (index, fault) in BusFault::ALL.into_iter().enumerate() {
            assert_eq!(fault as usize, index);
        }
    }

    proptest! {
        #[test]
        fn any_error_frame_is_read(id: u32, data in proptest::collection::vec(any::<u8>(), 0..9)) {
            let _report = BusReport::decode(id, &data);
        }
    }
}
