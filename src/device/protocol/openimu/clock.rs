//! What the count in a packet counts: documents and devices differ, the size of its steps decides.
//!
//! - 32 bits: documented in ms; a real device was seen to send µs in `z1`. A step is 1 to 500 at 1000 to 2 Hz in ms, 1000
//!   to 500 000 in µs: 1000 and more is µs.
//! - 16 bits: a packet counter (`S1`) by the DMU380 manual, a timer of 15.259 µs by the vendor's later software. A real
//!   device was seen to advance 3276.8 a packet, which is 20 Hz (one of the rates on offer) in units of 1/65536 s, so that
//!   the 16 bits wrap once a second. 100 and more is this timer.

use crate::device::protocol::period::PeriodWatch;
use crate::device::protocol::{DeviceTime, ImuReading};

/// Steps in a row that must speak against the unit before it is given up: a device that starts again makes one.
const STEPS_AGAINST: u8 = 3;

/// What a count counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Packet,
    Millisecond,
    Microsecond,
    Second65536th,
}

impl Unit {
    /// µs of a time, rounded down; `None` where packets are counted.
    fn micros(self, count: u64) -> Option<u64> {
        match self {
            Self::Packet => None,
            Self::Millisecond => Some(count * 1000),
            Self::Microsecond => Some(count),
            Self::Second65536th => Some((count * 1_000_000) >> 16),
        }
    }
}

/// Dates readings by the count in their packets, and counts those that are missing by it.
#[derive(Clone, Debug)]
pub(super) struct CountClock {
    small: Unit,
    large: Unit,
    /// Steps of so much and more are of the large kind.
    boundary: u32,
    /// Highest count.
    highest: u32,
    unit: Option<Unit>,
    against: u8,
    last: Option<u32>,
    /// A reading that waits for the unit to be known, with its count.
    held: Option<(u32, ImuReading)>,
    period: PeriodWatch,
    missing_packets: u64,
}

impl CountClock {
    /// A count of 32 bits whose steps below `boundary` are in unit `small`.
    pub(super) fn of_32_bits(small: Unit, large: Unit, boundary: u32) -> Self {
        Self {
            small,
            large,
            boundary,
            highest: u32::MAX,
            unit: None,
            against: 0,
            last: None,
            held: None,
            period: PeriodWatch::default(),
            missing_packets: 0,
        }
    }

    /// The same of 16 bits.
    pub(super) fn of_16_bits(small: Unit, large: Unit, boundary: u32) -> Self {
        Self { highest: u32::from(u16::MAX), ..Self::of_32_bits(small, large, boundary) }
    }

    /// Takes a reading without time and gives it out with its time, or holds it until the unit is known.
    pub(super) fn take(&mut self, count: u32, reading: ImuReading, on_reading: &mut dyn FnMut(ImuReading)) {
        if let Some(last) = self.last.replace(count) {
            self.judge(count.wrapping_sub(last) & self.highest);
        }
        if let Some((count, held)) = self.held.take() {
            on_reading(self.dated(count, held));
        }
        if self.unit.is_some() {
            on_reading(self.dated(count, reading));
        } else {
            self.held = Some((count, reading));
        }
    }

    /// The traffic has ended: gives out what was held.
    pub(super) fn finish(&mut self, on_reading: &mut dyn FnMut(ImuReading)) {
        if let Some((count, held)) = self.held.take() {
            on_reading(self.dated(count, held));
        }
    }

    /// The line was lost and is back: what was sent in between is nobody's loss to count, as with any other device.
    pub(super) fn rejoin(&mut self) {
        self.last = None;
        self.period.restart();
    }

    /// Learns from the step from one count to the next.
    fn judge(&mut self, step: u32) {
        if step == 0 {
            return;
        }
        let seems = if step < self.boundary { self.small } else { self.large };
        if self.unit.is_some_and(|unit| unit != seems) {
            self.against += 1;
        } else {
            self.against = 0;
        }
        if self.unit.is_none() || self.against == STEPS_AGAINST {
            self.unit = Some(seems);
            self.against = 0;
            self.period.restart();
        }
        match self.unit.and_then(|unit| unit.micros(u64::from(step))) {
            Some(step_us) => self.period.step(step_us),
            None if step < self.boundary => self.missing_packets += u64::from(step - 1),
            None => {}
        }
    }

    fn dated(&self, count: u32, reading: ImuReading) -> ImuReading {
        let device_time = self.unit.and_then(|unit| {
            let micros = unit.micros(u64::from(count))?;
            Some(DeviceTime { micros, wraps_after_us: unit.micros(u64::from(self.highest) + 1) })
        });
        ImuReading { device_time, ..reading }
    }

    /// What is counted, once that is known.
    pub(super) fn unit(&self) -> Option<Unit> {
        self.unit
    }

    /// Samples missing so far.
    pub(super) fn missing(&self) -> u64 {
        self.period.missing() + self.missing_packets
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn z1() -> CountClock {
        CountClock::of_32_bits(Unit::Millisecond, Unit::Microsecond, 1000)
    }

    fn s1() -> CountClock {
        CountClock::of_16_bits(Unit::Packet, Unit::Second65536th, 100)
    }

    /// Times and wraps of the readings with these counts, µs.
    fn times(
        clock: &mut CountClock,
        counts: impl IntoIterator<Item = u32>,
    ) -> Vec<Option<(u64, Option<u64>)>> {
        let reading = ImuReading {
            device_time: None,
            omega_imu: Vector3::zeros(),
            specific_force_imu: None,
            clipped: false,
        };
        let mut times = Vec::new();
        let mut note = |reading: ImuReading| {
            times.push(reading.device_time.map(|time| (time.micros, time.wraps_after_us)));
        };
        counts.into_iter().for_each(|count| clock.take(count, reading, &mut note));
        clock.finish(&mut note);
        times
    }

    #[test]
    fn the_first_step_tells_the_unit_of_both_its_samples() {
        let wrap = Some(1 << 32);
        assert_eq!(
            times(&mut z1(), [u32::MAX - 4_999, 5_000]),
            [Some(((1 << 32) - 5_000, wrap)), Some((5_000, wrap))]
        );
        let wrap = Some(1000 << 32);
        assert_eq!(times(&mut z1(), [7, 12]), [Some((7_000, wrap)), Some((12_000, wrap))]);
        assert_eq!(times(&mut z1(), [7]), [None], "one sample tells nothing");
        assert_eq!(times(&mut s1(), [65_000, 2_740])[1], Some((41_809, Some(1_000_000))));
        assert_eq!(times(&mut s1(), [65_535, 0]), [None, None], "numbers are no times");
    }

    #[test]
    fn losses_are_counted_in_either_unit() {
        for (clock, step) in [(z1(), 10), (z1(), 10_000), (s1(), 1), (s1(), 3_277)] {
            let mut clock = clock;
            let highest = clock.highest;
            let counts = (0..60_u32).filter(|k| ![20, 40, 41].contains(k)).map(|k| (k * step) & highest);
            assert_eq!(times(&mut clock, counts).len(), 57);
            assert_eq!(clock.missing(), 3, "steps of {step}");
        }
    }

    #[test]
    fn what_was_sent_while_the_line_was_lost_is_not_missing() {
        let mut clock = z1();
        times(&mut clock, (0..20).map(|k| 10_000 * k));
        clock.rejoin();
        assert_eq!(times(&mut clock, (50..70).map(|k| 10_000 * k)).len(), 20);
        assert_eq!(clock.missing(), 0);
    }

    #[test]
    fn a_restart_does_not_change_the_unit_but_three_steps_do() {
        let mut clock = z1();
        let counts = (0..20).map(|k| 900_000 + 5 * k).chain((0..20).map(|k| 5 * k));
        assert_eq!(times(&mut clock, counts).len(), 40);
        assert_eq!((clock.unit(), clock.missing()), (Some(Unit::Millisecond), 0));
        times(&mut clock, (0..20).map(|k| 1_000_000 + 5_000 * k));
        assert_eq!((clock.unit(), clock.missing()), (Some(Unit::Microsecond), 0));
    }
}
