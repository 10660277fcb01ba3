//! From packets of half a sample each to samples.

use super::kind;
use crate::device::protocol::calendar::Moment;
use crate::device::protocol::dead_band::DeadBand;
use crate::device::protocol::native_serial::{at_end_of_range, scaled};
use crate::device::protocol::period::PeriodWatch;
use crate::device::protocol::{DeviceInfo, DeviceTime, ImuReading};
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// Full scale of the numbers on the wire, whatever range the sensor chip is set to.
const GYRO_RANGE: f64 = 2000.0 * RAD_PER_DEG;
const ACCEL_RANGE: f64 = 16.0 * STANDARD_GRAVITY;
/// Counts of full scale.
const COUNTS: f64 = 32768.0;
/// Samples without a time in a row after which the device is believed to send none any more.
const UNTIMED_LIMIT: u8 = 8;

/// Puts the halves of a sample together: time (where the device is set to send it), accelerometer, gyroscope, in this
/// order and with nothing between them. No heap.
///
/// There is no counter. A burst of damage that takes away just what stands between an accelerometer packet and a later
/// gyroscope packet joins the halves of two samples, unseen.
#[derive(Clone, Debug, Default)]
pub(super) struct Pairing {
    /// Time of the sample that is coming, µs.
    time_us: Option<u64>,
    accelerometer: Option<[i16; 3]>,
    /// Time of the sample before, µs; `None` as long as the device sends no time.
    last_us: Option<u64>,
    /// Samples dropped in a row because only their time was lost.
    untimed: u8,
    period: PeriodWatch,
    /// Steps of the device's clock and their sum, µs: the mean rate.
    steps: u64,
    steps_us: u64,
    dead_band: DeadBand,
    info: Option<DeviceInfo>,
    accelerometer_seen: bool,
    gyroscope_seen: bool,
    pub(super) lone_halves: u64,
    pub(super) unknown: u64,
}

impl Pairing {
    /// Takes the content of a packet of type `kind`, from its third byte on; what is shorter than three 16-bit numbers
    /// counts as unknown.
    pub(super) fn take(&mut self, kind: u8, body: &[u8], on_reading: &mut dyn FnMut(ImuReading)) {
        match kind {
            kind::REGISTER => {}
            kind::TIME => {
                self.abandon();
                self.time_us = time_us(body);
            }
            kind::ACCELEROMETER => {
                if self.accelerometer.is_some() {
                    self.abandon();
                }
                self.accelerometer = self.numbers(body);
                self.accelerometer_seen = true;
            }
            kind::GYROSCOPE => {
                self.gyroscope_seen = true;
                match (self.numbers(body), self.accelerometer.take()) {
                    (Some(gyroscope), Some(accelerometer)) => {
                        self.publish(gyroscope, accelerometer, on_reading);
                    }
                    (None, None) => {}
                    _ => {
                        self.lone_halves += 1;
                        self.time_us = None;
                    }
                }
            }
            kind => {
                self.abandon();
                self.unknown += u64::from(kind > kind::LAST_KNOWN);
            }
        }
    }

    /// The gyroscope packet of the present sample did not come.
    pub(super) fn abandon(&mut self) {
        self.lone_halves += u64::from(self.accelerometer.take().is_some());
        self.time_us = None;
    }

    fn numbers(&mut self, body: &[u8]) -> Option<[i16; 3]> {
        if let [x0, x1, y0, y1, z0, z1, ..] = *body {
            return Some([[x0, x1], [y0, y1], [z0, z1]].map(i16::from_le_bytes));
        }
        self.unknown += 1;
        None
    }

    fn publish(
        &mut self,
        gyroscope: [i16; 3],
        accelerometer: [i16; 3],
        on_reading: &mut dyn FnMut(ImuReading),
    ) {
        let time_us = self.time_us.take();
        // A sample among dated ones whose time packet was damaged cannot be placed: it is lost with it.
        if time_us.is_none() && self.last_us.is_some() && self.untimed < UNTIMED_LIMIT {
            self.untimed += 1;
            return;
        }
        self.untimed = 0;
        if let (Some(time_us), Some(last_us)) = (time_us, self.last_us) {
            let step_us = time_us.saturating_sub(last_us);
            self.period.step(step_us);
            self.steps += 1;
            self.steps_us += step_us;
        }
        self.last_us = time_us;
        let omega_imu = scaled(gyroscope, GYRO_RANGE / COUNTS);
        let specific_force_imu = scaled(accelerometer, ACCEL_RANGE / COUNTS);
        self.dead_band.take(&omega_imu, &specific_force_imu);
        self.info.get_or_insert_with(|| DeviceInfo {
            gyro_range: Some(GYRO_RANGE),
            accel_range: Some(ACCEL_RANGE),
            ..DeviceInfo::default()
        });
        on_reading(ImuReading {
            device_time: time_us.map(|micros| DeviceTime { micros, wraps_after_us: None }),
            omega_imu,
            specific_force_imu: Some(specific_force_imu),
            clipped: at_end_of_range(gyroscope) || at_end_of_range(accelerometer),
        });
    }

    /// The connection was lost: the other half will not come.
    pub(super) fn rejoin(&mut self) {
        self.abandon();
        self.period.restart();
    }

    pub(super) fn missing(&self) -> u64 {
        self.period.missing()
    }

    /// Whether the device sends its time with its samples.
    pub(super) fn is_dated(&self) -> bool {
        self.last_us.is_some()
    }

    pub(super) fn device(&self) -> Option<&DeviceInfo> {
        self.info.as_ref()
    }

    /// What is worth knowing about a WitMotion sensor's settings.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let missing = match (self.accelerometer_seen, self.gyroscope_seen) {
            (true, false) => Some("gyroscope packets (0x52)"),
            (false, true) => Some("accelerometer packets (0x51)"),
            _ => None,
        };
        if let Some(missing) = missing {
            notes.push(format!(
                "the device sends no {missing}: a sample takes both (--configure sets the content)"
            ));
        }
        if self.dead_band.is_found() {
            notes.push(
                "gyroscope reads exactly 0 at rest: dead band (static threshold, 0.122 deg/s from the factory); slower \
                 rotation is not seen"
                    .to_owned(),
            );
        }
        let mean_us = (self.steps >= 10).then(|| self.steps_us as f64 / self.steps as f64);
        if mean_us.is_some_and(|mean_us| (90e3..=110e3).contains(&mean_us)) {
            notes.push(
                "10 samples/s, the factory setting (at 9600 baud): too slow for a head; --configure changes it".to_owned(),
            );
        }
        notes
    }
}

/// The clock of a time packet, `YY MM DD hh mm ss ms16`, as µs since the beginning of 2000; `None` for what is no
/// time.
fn time_us(body: &[u8]) -> Option<u64> {
    let &[year, month, day, hour, minute, second, ms_low, ms_high] = body else { return None };
    let micros = 1000 * u32::from(u16::from_le_bytes([ms_low, ms_high]));
    Moment { year, month, day, hour, minute, second, micros }.micros_since_2000()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds packets of type and three counts; the readings' z counts of the gyroscope.
    fn feed(pairing: &mut Pairing, packets: &[(u8, i16)]) -> Vec<i16> {
        let mut found = Vec::new();
        for (kind, z) in packets {
            let [low, high] = z.to_le_bytes();
            pairing.take(*kind, &[0, 0, 0, 0, low, high, 0, 0], &mut |reading| {
                found.push((reading.omega_imu.z / GYRO_RANGE * COUNTS).round() as i16);
            });
        }
        found
    }

    fn time(pairing: &mut Pairing, ms: u16) {
        let [low, high] = ms.to_le_bytes();
        pairing.take(kind::TIME, &[26, 11, 22, 10, 0, 0, low, high], &mut |_| panic!("a time is no sample"));
    }

    #[test]
    fn only_an_accelerometer_packet_and_the_gyroscope_packet_after_it_are_a_sample() {
        let mut pairing = Pairing::default();
        assert_eq!(
            feed(&mut pairing, &[(0x51, 1), (0x52, 2), (0x53, 0), (0x51, 3), (0x5F, 0), (0x52, 4)]),
            [2, 4]
        );
        assert_eq!((pairing.lone_halves, pairing.unknown), (0, 0));
        // Without the other half: a gyroscope; an accelerometer before another, before angles, and at a new connection.
        assert!(feed(&mut pairing, &[(0x52, 5), (0x51, 0), (0x51, 0), (0x53, 0), (0x52, 6)]).is_empty());
        assert_eq!(pairing.lone_halves, 4);
        feed(&mut pairing, &[(0x51, 0)]);
        pairing.rejoin();
        assert!(feed(&mut pairing, &[(0x52, 7)]).is_empty());
        assert_eq!(pairing.lone_halves, 6);
        assert!(feed(&mut pairing, &[(0x5B, 0), (0x5E, 0)]).is_empty());
        assert_eq!(pairing.unknown, 2);
    }

    #[test]
    fn a_time_counts_for_the_sample_behind_it_alone() {
        let mut pairing = Pairing::default();
        let mut times = Vec::new();
        for ms in 0..40_u16 {
            if ms != 20 {
                time(&mut pairing, 5 * ms);
            }
            for kind in [0x51, 0x52, 0x53] {
                pairing.take(kind, &[0; 8], &mut |reading| times.push(reading.device_time));
            }
        }
        let times: Vec<u64> = times.into_iter().map(|time| time.expect("dated").micros % 1_000_000).collect();
        assert_eq!(times.len(), 39, "the sample whose time was lost is lost");
        assert_eq!((times[19], times[20], times[38]), (95_000, 105_000, 195_000));
        assert_eq!(pairing.missing(), 1);
        // The device is set to send no time any more.
        let packets = [(0x51, 0), (0x52, 1)].repeat(10);
        assert_eq!(feed(&mut pairing, &packets).len(), 2);
    }

    #[test]
    fn times_go_on_over_the_ends_of_days_months_and_years() {
        let at = |text: [u8; 6], ms: u16| {
            let [low, high] = ms.to_le_bytes();
            time_us(&[&text[..], &[low, high]].concat())
        };
        assert_eq!(at([0, 1, 1, 0, 0, 1], 2), Some(1_002_000));
        for (before, after) in [
            ([23, 12, 31, 23, 59, 59], [24, 1, 1, 0, 0, 0]),
            ([24, 2, 28, 23, 59, 59], [24, 2, 29, 0, 0, 0]),
            ([24, 2, 29, 23, 59, 59], [24, 3, 1, 0, 0, 0]),
            ([25, 2, 28, 23, 59, 59], [25, 3, 1, 0, 0, 0]),
            ([24, 12, 31, 23, 59, 59], [25, 1, 1, 0, 0, 0]),
        ] {
            assert_eq!(at(after, 0).zip(at(before, 999)).map(|(after, before)| after - before), Some(1000));
        }
        // 2026-11-22 is day 9822 from 2000-01-01 on (as `date` counts).
        assert_eq!(at([26, 11, 22, 0, 0, 0], 0), Some(9822 * 86_400_000_000));
        assert!(at([0, 0, 0, 0, 0, 0], 5).is_some(), "a clock that was never set");
        for wrong in [[26, 13, 1, 0, 0, 0], [26, 1, 32, 0, 0, 0], [26, 1, 1, 24, 0, 0], [26, 1, 1, 0, 60, 0]]
        {
            assert_eq!(at(wrong, 0), None);
        }
        assert_eq!(at([26, 1, 1, 0, 0, 0], 1000), None);
    }

    #[test]
    fn the_factory_rate_and_the_dead_band_are_told() {
        let mut pairing = Pairing::default();
        for k in 0..60_u16 {
            let (second, ms) = ((k / 10) as u8, (k % 10 * 100).to_le_bytes());
            pairing.take(kind::TIME, &[26, 11, 22, 10, 0, second, ms[0], ms[1]], &mut |_| {});
            pairing.take(kind::ACCELEROMETER, &[0, 0, 0, 0, (k % 3) as u8, 8, 0, 0], &mut |_| {});
            pairing.take(kind::GYROSCOPE, &[0; 8], &mut |_| {});
        }
        let notes = pairing.notes().join("\n");
        assert!(notes.contains("exactly 0 at rest: dead band") && notes.contains("10 samples/s"), "{notes}");
        assert!(Pairing::default().notes().is_empty());
        for (kind, missing) in [(kind::GYROSCOPE, "accelerometer"), (kind::ACCELEROMETER, "gyroscope")] {
            let mut pairing = Pairing::default();
            feed(&mut pairing, &[(kind, 1), (kind, 2)]);
            assert!(pairing.notes()[0].contains(&format!("no {missing} packets")), "{:?}", pairing.notes());
        }
    }
}
