//! How long ticks took: a histogram that costs the control thread a few instructions and no heap.

use std::time::Duration;

use super::summary::{TickPercentiles, rounded};

/// Bins per doubling: a bin is at most 1/64 of its value wide.
const SUB_BITS: u32 = 6;
const SUB_BINS: usize = 1 << SUB_BITS;
/// Times from 2^32 ns (4.3 s) on share the last bin.
const MAX_BITS: u32 = 32;
const BINS: usize = (MAX_BITS - SUB_BITS + 1) as usize * SUB_BINS;

/// Histogram of the time ticks took: exact below 64 ns, then 64 bins per doubling.
#[derive(Clone, Debug)]
pub struct TickTimes {
    bins: Box<[u64; BINS]>,
    count: u64,
    max_ns: u64,
}

impl Default for TickTimes {
    fn default() -> Self {
        Self::new()
    }
}

impl TickTimes {
    /// An empty histogram. This allocates its 14 kB; nothing after it does.
    pub fn new() -> Self {
        Self { bins: Box::new([0; BINS]), count: 0, max_ns: 0 }
    }

    /// Adds one tick.
    pub fn record(&mut self, elapsed: Duration) {
        let ns = u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX);
        self.bins[bin_of(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// Ticks added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The time that `share` (0..=1) of the ticks did not exceed, ns: the upper edge of its bin, and never more than
    /// the longest. 0 without ticks.
    pub fn quantile_ns(&self, share: f64) -> u64 {
        let rank = ((self.count as f64 * share).ceil() as u64).max(1);
        let mut seen = 0;
        for (bin, &ticks) in self.bins.iter().enumerate() {
            seen += ticks;
            if seen >= rank {
                return upper_edge_ns(bin).min(self.max_ns);
            }
        }
        self.max_ns
    }

    /// Median, 99th percentile and maximum, µs.
    pub fn percentiles(&self) -> TickPercentiles {
        let us = |ns: u64| rounded(ns as f64 * 1e-3);
        TickPercentiles {
            p50: us(self.quantile_ns(0.5)),
            p99: us(self.quantile_ns(0.99)),
            max: us(self.max_ns),
        }
    }
}

fn bin_of(ns: u64) -> usize {
    if ns < SUB_BINS as u64 {
        return ns as usize;
    }
    let doubling = (ns.ilog2() - SUB_BITS).min(MAX_BITS - SUB_BITS);
    let within = ((ns >> doubling) as usize - SUB_BINS).min(SUB_BINS - 1);
    ((doubling as usize + 1) * SUB_BINS + within).min(BINS - 1)
}

fn upper_edge_ns(bin: usize) -> u64 {
    if bin < SUB_BINS {
        return bin as u64;
    }
    if bin == BINS - 1 {
        return u64::MAX;
    }
    let doubling = bin / SUB_BINS - 1;
    (((bin % SUB_BINS + SUB_BINS + 1) as u64) << doubling) - 1
}
