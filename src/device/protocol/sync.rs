//! Two-way clock exchange with a device that answers SYNC.

use otolith_firmware_protocol::message::Sync;

/// Time between two requests, µs.
const REQUEST_EVERY_US: u64 = 1_000_000;
/// Answers the best is chosen from. At one a second and 100 ppm of drift the oldest is off by 0.8 ms at most.
const WINDOW: usize = 8;

/// Offset between the clocks, from the answer with the shortest round trip of the last eight.
///
/// The shorter the round trip, the less the two ways can differ: the error is at most half of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncEstimate {
    /// Device time minus host time, µs.
    pub offset_us: i64,
    /// Round trip of the answer, µs, without the time inside the device.
    pub round_trip_us: u64,
    /// Host time of the request, µs.
    pub host_time_us: u64,
}

/// Sends requests and judges answers.
#[derive(Clone, Debug, Default)]
pub(super) struct ClockExchange {
    /// `t1` of the request whose answer is awaited.
    asked_us: Option<u64>,
    /// When the last request was sent.
    last_request_us: Option<u64>,
    /// An answer that has come; its time of arrival is known at the next poll.
    answer: Option<Sync>,
    /// The last answers, overwritten in turn.
    window: [Option<SyncEstimate>; WINDOW],
    next: usize,
}

impl ClockExchange {
    /// Takes a SYNC frame from the device. Only the answer to the last request counts.
    pub(super) fn answered(&mut self, sync: Sync) {
        if self.asked_us == Some(sync.t1_us) {
            self.asked_us = None;
            self.answer = Some(sync);
        }
    }

    /// Rates an answer that came with the traffic received at `now_us`, and gives the request to send now, if any.
    pub(super) fn poll(&mut self, now_us: u64) -> Option<Sync> {
        if let Some(estimate) = self.answer.take().and_then(|answer| rate(&answer, now_us)) {
            self.window[self.next] = Some(estimate);
            self.next = (self.next + 1) % WINDOW;
        }
        let due = self.last_request_us.is_none_or(|last| now_us.saturating_sub(last) >= REQUEST_EVERY_US);
        if !due {
            return None;
        }
        self.last_request_us = Some(now_us);
        self.asked_us = Some(now_us);
        Some(Sync { t1_us: now_us, t2_us: 0, t3_us: 0 })
    }

    pub(super) fn best(&self) -> Option<SyncEstimate> {
        self.window.iter().flatten().min_by_key(|estimate| estimate.round_trip_us).copied()
    }
}

/// `None` for an answer that contradicts itself: a negative round trip.
fn rate(answer: &Sync, t4_us: u64) -> Option<SyncEstimate> {
    let round_trip_us = u64::try_from(answer.round_trip_us(t4_us)).ok()?;
    Some(SyncEstimate { offset_us: answer.offset_us(t4_us), round_trip_us, host_time_us: answer.t1_us })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One exchange: `out_us` there, `back_us` back, device clock `offset_us` ahead.
    fn exchange(clocks: &mut ClockExchange, now_us: u64, out_us: u64, back_us: u64, offset_us: u64) {
        let request = clocks.poll(now_us).expect("a request is due");
        let t2_us = request.t1_us + out_us + offset_us;
        let t3_us = t2_us + 40;
        clocks.answered(Sync { t1_us: request.t1_us, t2_us, t3_us });
        assert!(clocks.poll(t3_us - offset_us + back_us).is_none(), "one request a second");
    }

    #[test]
    fn the_shortest_round_trip_of_the_last_eight_wins() {
        let mut clocks = ClockExchange::default();
        assert_eq!(clocks.best(), None);
        exchange(&mut clocks, 1_000_000, 300, 300, 5_000_000);
        exchange(&mut clocks, 2_000_000, 100, 120, 5_000_000);
        exchange(&mut clocks, 3_000_000, 300, 9_000, 5_000_000);
        let expected = SyncEstimate { offset_us: 4_999_990, round_trip_us: 220, host_time_us: 2_000_000 };
        assert_eq!(clocks.best(), Some(expected));
        for second in 4..12 {
            exchange(&mut clocks, second * 1_000_000, 200, 200, 6_000_000);
        }
        assert_eq!(clocks.best().map(|best| best.offset_us), Some(6_000_000), "the old ones have gone");
    }

    #[test]
    fn answers_nobody_asked_for_are_ignored() {
        let mut clocks = ClockExchange::default();
        clocks.poll(1_000_000);
        clocks.answered(Sync { t1_us: 77, t2_us: 1, t3_us: 2 });
        clocks.poll(1_000_100);
        assert_eq!(clocks.best(), None);
        // The device claims to have taken longer than the whole exchange.
        clocks.answered(Sync { t1_us: 1_000_000, t2_us: 5, t3_us: 900_005 });
        clocks.poll(1_000_200);
        assert_eq!(clocks.best(), None);
    }
}
