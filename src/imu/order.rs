//! Readings that come twice, or after a newer one.

use crate::device::protocol::ImuReading;

/// A reading up to this far behind the newest may have been overtaken; further back the clock was set, µs.
const LATEST_US: i64 = 1_000_000;
/// So many readings in a row behind the newest, and it is the clock that went back.
const STEP_AFTER: u32 = 3;

/// What the device's clock says about the place of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// After all others, or as far as can be told: a reading without device time is always in order.
    InOrder,
    /// The reading before, once more.
    Repeated,
    /// Older than one already used.
    Late,
}

/// Holds each reading against the newest one. Fixed size.
#[derive(Clone, Debug, Default)]
pub struct OrderWatch {
    newest: Option<ImuReading>,
    late_in_a_row: u32,
}

impl OrderWatch {
    /// Judges a reading. Equal stamps with different values are a coarse clock, not a repetition.
    pub fn judge(&mut self, reading: &ImuReading) -> Place {
        let times = self.newest.and_then(|newest| newest.device_time).zip(reading.device_time);
        let behind_us = times.map_or(0, |(newest, now)| newest.micros_since(now));
        if (1..=LATEST_US).contains(&behind_us) && self.late_in_a_row + 1 < STEP_AFTER {
            self.late_in_a_row += 1;
            return Place::Late;
        }
        self.late_in_a_row = 0;
        if times.is_some() && self.newest == Some(*reading) {
            return Place::Repeated;
        }
        self.newest = Some(*reading);
        Place::InOrder
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::device::protocol::DeviceTime;

    fn judge(readings: &[(u64, f64)], wraps_after_us: Option<u64>) -> Vec<Place> {
        let mut watch = OrderWatch::default();
        let judged = readings.iter().map(|&(micros, rate)| {
            watch.judge(&ImuReading {
                device_time: Some(DeviceTime { micros, wraps_after_us }),
                omega_imu: Vector3::new(0.0, 0.0, rate),
                specific_force_imu: None,
                clipped: false,
            })
        });
        judged.collect()
    }

    #[test]
    fn what_came_before_is_told_from_what_is_new() {
        use Place::{InOrder, Late, Repeated};
        let readings = [(1_000, 0.1), (2_000, 0.2), (2_000, 0.2), (2_000, 0.3), (4_000, 0.4), (3_000, 0.5)];
        assert_eq!(judge(&readings, None), [InOrder, InOrder, Repeated, InOrder, InOrder, Late]);
        // Across the wrap of the counter.
        let readings = [(65_000, 0.1), (400, 0.2), (65_200, 0.3), (900, 0.4)];
        assert_eq!(judge(&readings, Some(65_536)), [InOrder, InOrder, Late, InOrder]);
    }

    #[test]
    fn a_clock_that_went_back_is_believed_at_the_third_reading_or_at_once_if_far() {
        use Place::{InOrder, Late};
        let readings = [(900_000, 0.1), (1_000, 0.2), (2_000, 0.3), (3_000, 0.4), (4_000, 0.5)];
        assert_eq!(judge(&readings, None), [InOrder, Late, Late, InOrder, InOrder]);
        let readings = [(9_000_000, 0.1), (1_000, 0.2), (2_000, 0.3)];
        assert_eq!(judge(&readings, None), [InOrder; 3]);
    }

    #[test]
    fn without_a_device_clock_nothing_can_be_told() {
        let reading = ImuReading {
            device_time: None,
            omega_imu: Vector3::zeros(),
            specific_force_imu: None,
            clipped: false,
        };
        let mut watch = OrderWatch::default();
        assert_eq!([watch.judge(&reading), watch.judge(&reading)], [Place::InOrder; 2]);
    }
}
