//! The semicircular canals and the loop that inverts them.

use nalgebra::Vector3;

/// What the semicircular canals remember, per axis of the head.
///
/// The transfer function of Eq. 8, `scc(s) = τ_a τ_d s² / ((τ_a s + 1)(τ_d s + 1))`, in state space:
///
/// ```text
/// x1' = (ω - x1) / τ_d        x2' = ((ω - x1) - x2) / τ_a        α_ω = (ω - x1) - x2          (Eq. 8)
/// ```
///
/// | symbol | here             | unit  | frame | meaning                                     |
/// |--------|------------------|-------|-------|---------------------------------------------|
/// | x1     | `omega_forgotten`| rad/s | head  | rotation the cupula no longer deflects for  |
/// | x2     | `omega_adapted`  | rad/s | head  | deflection the nerve has adapted to         |
/// | τ_d    | argument         | s     | -     | dominant time constant                      |
/// | τ_a    | argument         | s     | -     | adaptation time constant                    |
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CanalState {
    /// x1: slow copy of the angular velocity, rad/s, head frame.
    pub omega_forgotten: Vector3<f64>,
    /// x2: slow copy of the deflection, rad/s, head frame.
    pub omega_adapted: Vector3<f64>,
}

impl CanalState {
    /// Canals that have been turning at `omega_head` for ever, rad/s: they report nothing.
    ///
    /// At rest this is the zero state. A known gyroscope bias given here causes no percept at all.
    pub fn adapted_to(omega_head: Vector3<f64>) -> Self {
        Self { omega_forgotten: omega_head, omega_adapted: Vector3::zeros() }
    }

    /// Afference α_ω, rad/s, head frame, while the head turns at `omega_head`: a jump of ω passes at once.
    #[inline]
    pub fn afference(&self, omega_head: &Vector3<f64>) -> Vector3<f64> {
        omega_head - self.omega_forgotten - self.omega_adapted
    }

    /// Time derivative of the state, rad/s², while the head turns at `omega_head`; both time constants in s.
    #[inline]
    pub fn rate(&self, omega_head: &Vector3<f64>, dominant_s: f64, adaptation_s: f64) -> Self {
        let deflection = omega_head - self.omega_forgotten;
        Self {
            omega_forgotten: deflection / dominant_s,
            omega_adapted: (deflection - self.omega_adapted) / adaptation_s,
        }
    }
}

/// Unscaled believed angular velocity ω', rad/s: the canal loop solved for its own output.
///
/// ```text
/// ω' = k_ω (α_ω - α̂_ω) + k_fω e_f                                                     (Eq. 7)
/// α̂_ω = ω' - z          z' = (ω' - z) / τ̂_d                                            (Eq. 9)
/// =>  ω' = [k_ω (α_ω + z) + k_fω e_f] / (1 + k_ω)                                      (Eq. 10)
/// ```
/// The internal canal is fed ω', as in Eq. 10; Eq. 9 prints ω̂, with which a jump would be perceived at 9/10.
///
/// | symbol | here              | unit  | frame | meaning                                       |
/// |--------|-------------------|-------|-------|-----------------------------------------------|
/// | α_ω    | `canal_afference` | rad/s | head  | what the canals report                        |
/// | z      | `internal_canal`  | rad/s | head  | state of the brain's model of the canals      |
/// | e_f    | `gif_error`       | rad   | head  | gravito-inertial rotation error               |
/// | k_ω    | `canal_gain`      | 1     | -     | weight of the canal conflict, not -1          |
/// | k_fω   | `gif_gain`        | 1/s   | -     | weight of the gravito-inertial rotation error |
///
/// # Departure from the paper
/// Evaluated in reading order with the last sample's α̂_ω, Eqs. 7 and 9 are an iteration with multiplier -k_ω = -8:
/// it diverges at every sample rate.
#[inline]
pub fn omega_prime(
    canal_afference: &Vector3<f64>,
    internal_canal: &Vector3<f64>,
    gif_error: &Vector3<f64>,
    canal_gain: f64,
    gif_gain: f64,
) -> Vector3<f64> {
    ((canal_afference + internal_canal) * canal_gain + gif_error * gif_gain) / (1.0 + canal_gain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn adapted_canals_are_silent_and_stay_so() {
        let omega = vector![0.1, -0.2, 3.0];
        let canal = CanalState::adapted_to(omega);
        assert_eq!(canal.afference(&omega), Vector3::zeros());
        assert_eq!(canal.rate(&omega, 5.7, 80.0), CanalState::default());
    }

    #[test]
    fn the_closed_loop_satisfies_equations_7_and_9() {
        let (afference, internal, gif_error) =
            (vector![0.3, -1.0, 2.0], vector![0.5, 0.25, -0.125], vector![0.01, 0.1, -0.2]);
        let omega = omega_prime(&afference, &internal, &gif_error, 8.0, 4.0);
        let expected_afference = omega - internal;
        let residual = (afference - expected_afference) * 8.0 + gif_error * 4.0 - omega;
        assert!(residual.norm() < 1e-14, "{residual}");
    }
}
