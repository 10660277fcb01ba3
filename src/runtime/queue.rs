//! The bounded queue from the receiving and the control thread to the journal. A full queue drops and counts.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam_channel::{Receiver, Sender, bounded};

use super::journal::Journal;
use super::offline::name_of;
use crate::device::Traffic;
use crate::imu::{HeadSample, LinkHealth};
use crate::tick::{TickInput, TickOutput};
use crate::time::HostTime;

/// Entries between control and recording: 4 s of ticks and as many other entries.
const CAPACITY: usize = 8192;

/// One entry on the way to the journal.
#[allow(clippy::large_enum_variant)] // ticks are the common case, and boxing them would allocate in the control thread
pub(super) enum Entry {
    /// With the number of ticks lost to a full queue since the one before.
    Tick(TickInput, TickOutput, u32),
    Sample(HeadSample),
    Traffic(HostTime, OwnedTraffic),
    /// Pieces of traffic lost to a full queue here.
    TrafficLost(u32),
    Event(HostTime, String),
    Link(HostTime, LinkHealth),
    Skipped(HostTime, u64),
}

/// A piece of traffic that outlives the link's buffer.
pub(super) enum OwnedTraffic {
    Bytes(Box<[u8]>),
    Frame { id: u32, extended: bool, data: Box<[u8]> },
}

/// The way into the queue. Sending never waits and never allocates.
#[derive(Clone)]
pub(super) struct Notes {
    entries: Sender<Entry>,
    lost: Arc<AtomicU64>,
}

impl Notes {
    /// A queue: its way in and its way out.
    pub(super) fn queue() -> (Self, Receiver<Entry>) {
        let (entries, out) = bounded(CAPACITY);
        (Self { entries, lost: Arc::default() }, out)
    }

    /// Hands an entry over; false when the queue is full and the entry is lost.
    pub(super) fn note(&self, entry: Entry) -> bool {
        let sent = self.entries.try_send(entry).is_ok();
        self.lost.fetch_add(u64::from(!sent), Ordering::Relaxed);
        sent
    }

    /// Counts something that another full queue has lost.
    pub(super) fn count_lost(&self) {
        self.lost.fetch_add(1, Ordering::Relaxed);
    }

    /// Everything lost so far.
    pub(super) fn lost_so_far(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// The counter of everything lost, which outlives the queue.
    pub(super) fn lost(&self) -> Arc<AtomicU64> {
        self.lost.clone()
    }
}

/// Writes entries down until every way into the queue is gone.
pub(super) fn write_journal(entries: &Receiver<Entry>, mut journal: Journal) -> Journal {
    for entry in entries {
        match entry {
            Entry::Tick(input, output, lost_before) => {
                journal.ticks_dropped(lost_before);
                journal.tick(&input, &output);
            }
            Entry::Sample(sample) => journal.sample(&sample),
            Entry::Traffic(at, OwnedTraffic::Bytes(bytes)) => journal.traffic(at, Traffic::Bytes(&bytes)),
            Entry::Traffic(at, OwnedTraffic::Frame { id, extended, data }) => {
                journal.traffic(at, Traffic::CanFrame { id, extended, data: &data });
            }
            Entry::TrafficLost(count) => journal.traffic_dropped(count),
            Entry::Event(at, text) => journal.event(at, &text),
            Entry::Link(at, link) => journal.event(at, &format!("link {}", name_of(link))),
            Entry::Skipped(at, ticks) => journal.event(at, &format!("overrun: {ticks} ticks skipped")),
        }
    }
    journal
}
