//! A device's own count of samples it could not send.

/// Adds up a device's 16-bit count of dropped samples, from the first report on.
///
/// What was dropped before we listened is not ours to report, so the first value is only the start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DropCount {
    last: Option<u16>,
    last_device_us: u64,
    total: u64,
}

impl DropCount {
    /// Takes a report with the device's time; a time that goes back means the device has started again.
    pub(super) fn take(&mut self, dropped: u16, device_us: u64) {
        if device_us < self.last_device_us {
            self.restart();
        }
        self.last_device_us = device_us;
        self.take_next(dropped);
    }

    /// Takes a report known to be of the same run of the device.
    pub(super) fn take_next(&mut self, dropped: u16) {
        if let Some(last) = self.last.replace(dropped) {
            self.total += u64::from(dropped.wrapping_sub(last));
        }
    }

    /// The device counts from zero again.
    pub(super) fn restart(&mut self) {
        self.last = Some(0);
    }

    pub(super) fn total(&self) -> u64 {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_are_counted_from_the_first_report_through_wrap_and_restart() {
        let mut count = DropCount::default();
        for (dropped, device_us, total) in
            [(65_530, 10, 0), (65_530, 20, 0), (4, 30, 10), (3, 5, 13), (3, 6, 13)]
        {
            count.take(dropped, device_us);
            assert_eq!(count.total(), total);
        }
    }
}
