//! The latest state of a live run for whoever shows it: stored by the threads of the run without a lock.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

use super::trouble::Troubles;
use crate::imu::LinkHealth;
use crate::tick::{Posture, TickInput, TickOutput};

/// Latest values. A reader may see values of two neighbouring ticks together, which a status line does not mind.
#[derive(Debug, Default)]
pub struct LiveStatus {
    tick: AtomicU64,
    link: AtomicU8,
    chair_rate: AtomicU64,
    green_tilt: AtomicU64,
    green_sway: AtomicU64,
    blue_sway: AtomicU64,
    fallen: AtomicU8,
    sample_age: AtomicU64,
    dropped: AtomicU64,
    troubles: AtomicU32,
    refusals: OnceLock<Vec<String>>,
}

/// A copy of the latest values, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatusLine {
    /// Number of the tick.
    pub tick: u64,
    /// State of the link.
    pub link: LinkHealth,
    /// Yaw rate of the virtual turntable, rad/s.
    pub chair_rate: f64,
    /// Tilt of the gravity green believes in, rad.
    pub green_tilt: f64,
    /// Sway of green, rad.
    pub green_sway: f64,
    /// Sway of blue, rad.
    pub blue_sway: f64,
    /// True when green has fallen.
    pub green_fallen: bool,
    /// Age of the newest sample when the tick began, s; zero before the first.
    pub sample_age_s: f64,
    /// Samples, ticks and pieces of traffic that full queues have lost so far.
    pub dropped: u64,
    /// What is wrong on the way from the device to its samples.
    pub troubles: Troubles,
}

impl LiveStatus {
    /// Stores the values of one tick.
    pub(super) fn store(&self, input: &TickInput, output: &TickOutput) {
        let put = |slot: &AtomicU64, value: f64| slot.store(value.to_bits(), Ordering::Relaxed);
        self.link.store(input.link as u8, Ordering::Relaxed);
        put(&self.chair_rate, output.platform.rate);
        put(&self.green_tilt, output.green.gravity_tilt);
        put(&self.green_sway, output.green.com_sway);
        put(&self.blue_sway, output.blue.com_sway);
        self.fallen.store(u8::from(output.green.posture == Posture::Fallen), Ordering::Relaxed);
        self.tick.store(input.tick.0, Ordering::Relaxed);
    }

    /// Stores how old the newest sample is, s, and what full queues have lost so far.
    pub(super) fn store_backlog(&self, sample_age_s: f64, dropped: u64) {
        self.sample_age.store(sample_age_s.to_bits(), Ordering::Relaxed);
        self.dropped.store(dropped, Ordering::Relaxed);
    }

    /// Stores what is wrong on the way from the device to its samples.
    pub(super) fn store_troubles(&self, troubles: Troubles) {
        self.troubles.store(troubles.bits(), Ordering::Relaxed);
    }

    /// Stores, once and before the first tick, what the system refused the control thread.
    pub(super) fn refuse(&self, refusals: Vec<String>) {
        // A second set would be the same system's same answer.
        let _kept = self.refusals.set(refusals);
    }

    /// What the system refused the control thread; `None` until it has asked.
    pub fn refusals(&self) -> Option<&[String]> {
        self.refusals.get().map(Vec::as_slice)
    }

    /// The latest values.
    pub fn load(&self) -> StatusLine {
        let value = |slot: &AtomicU64| f64::from_bits(slot.load(Ordering::Relaxed));
        let link = [LinkHealth::Waiting, LinkHealth::Live, LinkHealth::Stale, LinkHealth::Lost];
        StatusLine {
            tick: self.tick.load(Ordering::Relaxed),
            link: link[usize::from(self.link.load(Ordering::Relaxed)).min(3)],
            chair_rate: value(&self.chair_rate),
            green_tilt: value(&self.green_tilt),
            green_sway: value(&self.green_sway),
            blue_sway: value(&self.blue_sway),
            green_fallen: self.fallen.load(Ordering::Relaxed) != 0,
            sample_age_s: value(&self.sample_age),
            dropped: self.dropped.load(Ordering::Relaxed),
            troubles: Troubles::from_bits(self.troubles.load(Ordering::Relaxed)),
        }
    }
}
