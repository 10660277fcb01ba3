//! Whether a serial line or a CAN bus can carry what a device announces, before samples are lost to it.

use super::DeviceError;
use crate::time::HostTime;

/// Largest share of a serial line's capacity that is accepted: a guess that leaves room for status frames and jitter.
pub const MAX_SERIAL_LOAD: f64 = 0.85;
/// Bits on the line per byte: one start bit, 8 data bits, one stop bit.
pub const BITS_PER_BYTE_8N1: f64 = 10.0;
/// Baud rates to propose, slowest first.
const COMMON_BAUDS: [u32; 9] =
    [9_600, 57_600, 115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000, 3_000_000];

/// Share of an 8N1 line's capacity that a stream of samples takes; above 1 it cannot fit.
///
/// `bytes_per_sample` counts everything on the wire; `rate_hz` is samples per second.
pub fn serial_load(baud: u32, rate_hz: f64, bytes_per_sample: f64) -> f64 {
    bytes_per_sample * rate_hz * BITS_PER_BYTE_8N1 / f64::from(baud)
}

/// When the last of `bytes` bytes has arrived on an always busy 8N1 line that started at time zero.
pub fn time_on_line(bytes: u64, baud: u32) -> HostTime {
    let nanos = u128::from(bytes) * 10_000_000_000 / u128::from(baud.max(1));
    HostTime(u64::try_from(nanos).unwrap_or(u64::MAX))
}

/// Refuses a line that would be filled above [`MAX_SERIAL_LOAD`]; returns the load otherwise.
///
/// # Errors
/// [`DeviceError::SerialTooSlow`] with the numbers, the next common baud rate and the sample rate that would fit.
pub fn check_serial(baud: u32, rate_hz: f64, bytes_per_sample: f64) -> Result<f64, DeviceError> {
    let load = serial_load(baud, rate_hz, bytes_per_sample);
    if load <= MAX_SERIAL_LOAD {
        return Ok(load);
    }
    let fitting_rate = (MAX_SERIAL_LOAD * f64::from(baud) / BITS_PER_BYTE_8N1 / bytes_per_sample).floor();
    let fitting_baud = COMMON_BAUDS
        .into_iter()
        .map(|other| (other, serial_load(other, rate_hz, bytes_per_sample)))
        .find(|(_, load)| *load <= MAX_SERIAL_LOAD);
    let hint = match fitting_baud {
        Some((other, load)) => format!(
            "set device and selector to {other} baud ({:.0} %), or the device to at most {fitting_rate} samples/s",
            load * 100.0
        ),
        None => format!("set the device to at most {fitting_rate} samples/s"),
    };
    Err(DeviceError::SerialTooSlow {
        baud,
        rate_hz,
        bytes_per_sample,
        load_percent: load * 100.0,
        limit_percent: MAX_SERIAL_LOAD * 100.0,
        hint,
    })
}

/// Largest share of a CAN bus that is accepted, with worst stuffing: a guess that leaves room for others, who wait as
/// long as a lower identifier is being sent.
pub const MAX_CAN_LOAD: f64 = 0.70;
/// Bit rates to propose, slowest first.
const COMMON_BITRATES: [u32; 4] = [125_000, 250_000, 500_000, 1_000_000];

/// Frames of one identifier on a classic CAN bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanStream {
    /// True for a 29-bit identifier.
    pub extended: bool,
    /// Data bytes of a frame.
    pub bytes: u8,
    /// Frames per second.
    pub rate_hz: f64,
}

impl CanStream {
    /// Bits of a frame with the pause after it, without stuffing and with the most that can be.
    pub fn bits(&self) -> (u32, u32) {
        let data = 8 * u32::from(self.bytes);
        // Frame without data, and the part of it (start to checksum) in which five equal bits are followed by another.
        let (frame, stuffed) = if self.extended { (64, 54) } else { (44, 34) };
        let least = frame + data + 3;
        (least, least + (stuffed + data - 1) / 4)
    }
}

/// Share of a CAN bus that these frames take, without stuffing and with the most that can be.
pub fn can_load(bitrate: u32, streams: &[CanStream]) -> (f64, f64) {
    let bits = streams.iter().fold((0.0, 0.0), |(least, most), stream| {
        let (least_bits, most_bits) = stream.bits();
        (least + f64::from(least_bits) * stream.rate_hz, most + f64::from(most_bits) * stream.rate_hz)
    });
    (bits.0 / f64::from(bitrate), bits.1 / f64::from(bitrate))
}

/// The frames of our own protocol at this sample rate: GYRO and ACCEL, TIME, HEALTH and both kinds of DESC.
pub fn native_can_streams(rate_hz: f64) -> [CanStream; 4] {
    [2.0 * rate_hz, 10.0, 1.0, 2.0].map(|rate_hz| CanStream { extended: false, bytes: 8, rate_hz })
}

/// Refuses a bus that these frames would fill above [`MAX_CAN_LOAD`]; returns the load with worst stuffing otherwise.
///
/// # Errors
/// [`DeviceError::CanTooSlow`] with the numbers, the next common bit rate and the share of the frames that would fit.
pub fn check_can(bitrate: u32, streams: &[CanStream]) -> Result<f64, DeviceError> {
    let (least, most) = can_load(bitrate, streams);
    if most <= MAX_CAN_LOAD {
        return Ok(most);
    }
    let slower = format!("this device to at most {:.0} % of its rate", (MAX_CAN_LOAD / most * 100.0).floor());
    let fitting = COMMON_BITRATES
        .into_iter()
        .map(|other| (other, can_load(other, streams).1))
        .find(|(_, load)| *load <= MAX_CAN_LOAD);
    let hint = match fitting {
        Some((other, load)) => {
            format!("set the whole bus to {other} bit/s (up to {:.0} %), or {slower}", load * 100.0)
        }
        None => format!("set {slower}"),
    };
    let (least_percent, most_percent) = (least * 100.0, most * 100.0);
    Err(DeviceError::CanTooSlow {
        bitrate,
        least_percent,
        most_percent,
        limit_percent: MAX_CAN_LOAD * 100.0,
        hint,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(extended: bool, bytes: u8) -> CanStream {
        CanStream { extended, bytes, rate_hz: 1000.0 }
    }

    /// Percent of 500 kbit/s at 1 kHz in the wire format's README, in its roundings.
    #[test]
    fn can_loads_match_the_published_table() {
        let ours = [stream(false, 8); 2];
        assert_eq!(ours[0].bits(), (111, 135), "222 to 270 for a sample");
        for (what, streams, percent) in [
            ("ours", ours.to_vec(), ["44.4", "54.0"]),
            ("MTi", vec![stream(false, 6), stream(false, 6), stream(false, 4)], ["53.8", "65.0"]),
            ("Racelogic", vec![stream(false, 8); 4], ["88.8", "108.0"]),
            ("MM7.10", vec![stream(false, 8); 3], ["66.6", "81.0"]),
            ("J1939", vec![stream(true, 8); 2], ["52.4", "64.0"]),
        ] {
            let (least, most) = can_load(500_000, &streams);
            assert_eq!([least, most].map(|load| format!("{:.1}", load * 100.0)), percent, "{what}");
        }
        for (bitrate, percent) in [(250_000, ["88.8", "108.0"]), (1_000_000, ["22.2", "27.0"])] {
            let (least, most) = can_load(bitrate, &ours);
            assert_eq!([least, most].map(|load| format!("{:.1}", load * 100.0)), percent);
        }
    }

    #[test]
    fn too_slow_a_bus_is_refused_with_what_fits() {
        let text = check_can(250_000, &[stream(false, 8); 2]).expect_err("108 %").to_string();
        for part in [
            "89 to 108 % of 250000 bit/s",
            "limit is 70 %",
            "hint:",
            "500000 bit/s (up to 54 %)",
            "at most 64 % of",
        ] {
            assert!(text.contains(part), "{part} is missing in: {text}");
        }
        let text = check_can(1_000_000, &[stream(true, 8); 5]).expect_err("80 %").to_string();
        assert!(text.contains("hint: set this device to at most 87 % of its rate"), "{text}");
    }

    #[test]
    fn our_own_device_fits_at_half_the_rate_only_on_a_slow_bus() {
        assert!((check_can(500_000, &native_can_streams(1000.0)).expect("fits") - 0.5435).abs() < 1e-4);
        assert!(check_can(250_000, &native_can_streams(500.0)).is_ok());
        assert!(check_can(250_000, &native_can_streams(1000.0)).is_err());
        assert!(check_can(125_000, &native_can_streams(500.0)).is_err());
    }

    /// The table of the wire format's README: 1 kHz of SAMPLE16 (22 bytes) and of BATCH16 x 5 (14.6).
    #[test]
    fn loads_match_the_published_table() {
        for (baud, single, batch) in
            [(115_200, 191, 127), (230_400, 95, 63), (460_800, 48, 32), (921_600, 24, 16)]
        {
            assert_eq!((serial_load(baud, 1000.0, 22.0) * 100.0).round() as i32, single);
            assert_eq!((serial_load(baud, 1000.0, 14.6) * 100.0).round() as i32, batch);
        }
    }

    #[test]
    fn too_slow_a_line_is_refused_with_what_fits() {
        let text = check_serial(115_200, 1000.0, 22.0).expect_err("191 %").to_string();
        for part in
            ["191 % of 115200 baud", "limit is 85 %", "hint:", "460800 baud (48 %)", "at most 445 samples/s"]
        {
            assert!(text.contains(part), "{part} is missing in: {text}");
        }
        let text = check_serial(115_200, 1e6, 22.0).expect_err("no baud fits").to_string();
        assert!(text.contains("hint: set the device to at most 445 samples/s"), "{text}");
    }

    #[test]
    fn a_line_that_fits_reports_its_load() {
        assert!((check_serial(921_600, 1000.0, 22.0).expect("fits") - 0.2387).abs() < 1e-3);
        assert!(check_serial(115_200, 445.0, 22.0).is_ok());
        assert!(check_serial(115_200, 446.0, 22.0).is_err());
    }
}
