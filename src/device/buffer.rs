//! One piece of traffic, owned: what middleware needs to hold a piece back.

use super::Traffic;

/// A copy of one piece of traffic. The memory is kept, so refilling it does not allocate in steady state.
#[derive(Clone, Debug, Default)]
pub(crate) struct TrafficBuffer {
    /// Identifier and format of a CAN frame; `None` for bytes.
    frame: Option<(u32, bool)>,
    data: Vec<u8>,
}

impl TrafficBuffer {
    /// Replaces the content with a copy of `traffic`.
    pub(crate) fn store(&mut self, traffic: Traffic<'_>) {
        let (frame, data) = match traffic {
            Traffic::Bytes(data) => (None, data),
            Traffic::CanFrame { id, extended, data } => (Some((id, extended)), data),
        };
        self.frame = frame;
        self.data.clear();
        self.data.extend_from_slice(data);
    }

    /// The content.
    pub(crate) fn traffic(&self) -> Traffic<'_> {
        match self.frame {
            None => Traffic::Bytes(&self.data),
            Some((id, extended)) => Traffic::CanFrame { id, extended, data: &self.data },
        }
    }

    /// The data bytes, to change in place.
    pub(crate) fn data_mut(&mut self) -> &mut [u8] {
        &mut self.data
    }
}
