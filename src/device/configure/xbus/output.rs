//! The output configuration of an Xsens device: what it sends, and how often.

/// Bytes of an entry.
const ENTRY: usize = 4;
/// Most entries a device takes (SetOutputConfiguration, MID C0).
const MOST_ENTRIES: usize = 32;

/// One kind of output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Data identifier (DID).
    pub data_id: u16,
    /// Times per second; FFFF is with every packet or as often as possible.
    pub rate_hz: u16,
}

/// The data of SetOutputConfiguration and of its answer: entries of data identifier and rate, both u16 big-endian.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputConfiguration {
    /// What is sent, in the order in which it stands in a packet.
    pub outputs: Vec<Output>,
}

impl OutputConfiguration {
    /// Reads the data of a message; `None` unless it is 1 to 32 whole entries.
    pub fn parse(data: &[u8]) -> Option<Self> {
        let (entries, []) = data.as_chunks::<ENTRY>() else { return None };
        if !(1..=MOST_ENTRIES).contains(&entries.len()) {
            return None;
        }
        let outputs = entries.iter().map(|&[id_high, id_low, rate_high, rate_low]| Output {
            data_id: u16::from_be_bytes([id_high, id_low]),
            rate_hz: u16::from_be_bytes([rate_high, rate_low]),
        });
        Some(Self { outputs: outputs.collect() })
    }

    /// The data of a message.
    pub fn data(&self) -> Vec<u8> {
        let entries = self.outputs.iter().map(|output| (output.data_id, output.rate_hz));
        entries.flat_map(|(id, rate)| [id.to_be_bytes(), rate.to_be_bytes()].concat()).collect()
    }

    /// The rate of a data identifier in any number format and axes; `None` if it is not sent.
    pub fn rate_of(&self, data_id: u16) -> Option<u16> {
        let is_it = |output: &&Output| output.data_id & 0xFFF0 == data_id & 0xFFF0;
        self.outputs.iter().find(is_it).map(|output| output.rate_hz)
    }
}
