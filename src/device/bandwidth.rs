//! Whether a serial line can carry what a device announces, before samples are lost to it.

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

#[cfg(test)]
mod tests {
    use super::*;

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
