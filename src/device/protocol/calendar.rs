//! Calendar dates of devices as counts of microseconds.

/// Days of a common year before each month.
const DAYS_BEFORE_MONTH: [u64; 12] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334];

/// A date and time of day of one of the years from 2000 to 2099.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// Years since 2000.
    pub(super) year: u8,
    pub(super) month: u8,
    pub(super) day: u8,
    pub(super) hour: u8,
    pub(super) minute: u8,
    pub(super) second: u8,
    /// Microseconds of the second.
    pub(super) micros: u32,
}

impl Moment {
    /// Microseconds since the beginning of 2000; `None` for what is no time. A clock that was never set may have month
    /// and day 0.
    pub(super) fn micros_since_2000(self) -> Option<u64> {
        let Self { year, month, day, hour, minute, second, micros } = self;
        if month > 12 || day > 31 || hour > 23 || minute > 59 || second > 59 || micros > 999_999 {
            return None;
        }
        let year = u64::from(year);
        let is_past_leap_day = month > 2 && year % 4 == 0;
        let days = 365 * year
            + year.div_ceil(4)
            + DAYS_BEFORE_MONTH[usize::from(month.max(1)) - 1]
            + u64::from(is_past_leap_day)
            + u64::from(day.max(1) - 1);
        let seconds = ((days * 24 + u64::from(hour)) * 60 + u64::from(minute)) * 60 + u64::from(second);
        Some(seconds * 1_000_000 + u64::from(micros))
    }
}
