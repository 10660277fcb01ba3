//! Gyroscope and accelerometer of one sample, for protocols that send both in one packet.

use nalgebra::Vector3;

/// Puts the two halves of a packet together, and counts those that come alone.
///
/// Which outputs a device has is its own setting, and a packet does not tell it: rotation alone is a sample of a device
/// without an accelerometer until the first specific force is seen, and half a sample from then on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Halves {
    force_seen: bool,
    lone: u64,
}

impl Halves {
    /// The sample of a packet: angular velocity, and specific force where the device has it. `None` for a packet
    /// without motion and for half a sample.
    pub(super) fn join(
        &mut self,
        omega: Option<Vector3<f64>>,
        force: Option<Vector3<f64>>,
    ) -> Option<(Vector3<f64>, Option<Vector3<f64>>)> {
        self.force_seen |= force.is_some();
        let is_whole = force.is_some() || !self.force_seen;
        if let Some(omega) = omega.filter(|_| is_whole) {
            return Some((omega, force));
        }
        self.lone += u64::from(omega.is_some() || force.is_some());
        None
    }

    /// Halves that came alone.
    pub(super) fn lone(&self) -> u64 {
        self.lone
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gyroscope_alone_is_a_sample_until_an_accelerometer_is_seen() {
        let (omega, force) = (Vector3::x(), Vector3::z() * 9.81);
        let mut halves = Halves::default();
        assert_eq!(halves.join(Some(omega), None), Some((omega, None)));
        assert_eq!(halves.join(None, None), None);
        assert_eq!(halves.lone(), 0);
        assert_eq!(halves.join(Some(omega), Some(force)), Some((omega, Some(force))));
        assert_eq!(halves.join(Some(omega), None), None);
        assert_eq!(halves.join(None, Some(force)), None);
        assert_eq!(halves.lone(), 2);
    }
}
