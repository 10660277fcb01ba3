//! What a link has counted.

use std::io;

use super::can::bus::{BusFaults, BusReport, BusState};

/// State and losses of a link since it was opened. Read it after each `receive`; a change is an event to note.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LinkStatus {
    /// True while the connection is down and reopening is tried.
    pub down: bool,
    /// What the operating system said when the connection was last lost.
    #[serde(skip)]
    pub last_loss: Option<io::ErrorKind>,
    /// Times the connection was lost.
    pub losses: u64,
    /// Times it was reopened after a loss. The decoder should then [`super::protocol::PacketDecoder::rejoin`].
    pub reconnects: u64,
    /// Bytes that are no traffic: malformed lines of a candump log or of a slcan adapter.
    pub bytes_skipped: u64,
    /// Bytes at the end of a file that are the beginning of a line or of a stamp.
    pub unfinished_bytes: u64,
    /// Error frames of a CAN bus (of any class), read errors of an interface that is down, error answers of a slcan
    /// adapter.
    pub bus_errors: u64,
    /// The CAN error frames among `bus_errors` that said bus off.
    pub bus_off: u64,
    /// State of the CAN interface, as far as it has told.
    pub bus_state: BusState,
    /// Kinds of trouble on the CAN bus so far.
    pub bus_faults: BusFaults,
    /// Frames the kernel dropped because they were not taken in time.
    pub overflowed: u64,
    /// Receive stamps of the kernel that could not be right, because the wall clock was set or the program stopped.
    pub stamps_refused: u64,
    /// Writes that were given up because the device or bus did not take them in time.
    pub unsent: u64,
    /// The driver of the serial port hands bytes on at once; false where it has no such flag.
    pub low_latency: bool,
}

impl LinkStatus {
    /// Takes in an error frame of a CAN controller: identifier without flag bits, data bytes.
    pub(super) fn note_error_frame(&mut self, id: u32, data: &[u8]) {
        let report = BusReport::decode(id, data);
        self.bus_errors += 1;
        self.bus_off += u64::from(report.state == Some(BusState::BusOff));
        self.bus_faults = self.bus_faults.union(report.faults);
        self.bus_state = report.state.unwrap_or(self.bus_state);
    }

    /// Takes in that a data frame has come: a controller that was off or down must have been started again.
    pub(super) fn note_data_frame(&mut self) {
        if matches!(self.bus_state, BusState::BusOff | BusState::InterfaceDown) {
            self.bus_state = BusState::ErrorActive;
        }
    }

    /// This status with what `past`, a link before this one, had counted. The state is this one's.
    pub(super) fn after(self, past: &LinkStatus) -> LinkStatus {
        LinkStatus {
            bytes_skipped: past.bytes_skipped + self.bytes_skipped,
            unfinished_bytes: past.unfinished_bytes + self.unfinished_bytes,
            bus_errors: past.bus_errors + self.bus_errors,
            bus_off: past.bus_off + self.bus_off,
            bus_faults: past.bus_faults.union(self.bus_faults),
            overflowed: past.overflowed + self.overflowed,
            stamps_refused: past.stamps_refused + self.stamps_refused,
            unsent: past.unsent + self.unsent,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bus_off_ends_with_the_next_frame_or_restart() {
        let mut status = LinkStatus::default();
        status.note_data_frame();
        assert_eq!(status.bus_state, BusState::Unknown);
        status.note_error_frame(0x040, &[0; 8]);
        assert_eq!((status.bus_state, status.bus_off, status.bus_errors), (BusState::BusOff, 1, 1));
        status.note_error_frame(0x002, &[0; 8]);
        assert_eq!(status.bus_state, BusState::BusOff, "says nothing about the state");
        status.note_data_frame();
        assert_eq!(status.bus_state, BusState::ErrorActive);
        status.note_error_frame(0x040, &[0; 8]);
        status.note_error_frame(0x100, &[0; 8]);
        assert_eq!((status.bus_state, status.bus_off, status.bus_errors), (BusState::ErrorActive, 2, 4));
    }

    #[test]
    fn counts_outlive_the_link_and_states_do_not() {
        let mut past = LinkStatus { bytes_skipped: 1, overflowed: 2, unsent: 3, ..LinkStatus::default() };
        past.note_error_frame(0x060, &[]);
        let now = LinkStatus { bytes_skipped: 10, overflowed: 20, unsent: 30, ..LinkStatus::default() };
        let total = now.after(&past);
        assert_eq!((total.bytes_skipped, total.overflowed, total.unsent), (11, 22, 33));
        assert_eq!((total.bus_errors, total.bus_off, total.bus_faults), (1, 1, past.bus_faults));
        assert_eq!(total.bus_state, BusState::Unknown);
    }
}
