//! Newman's observer of spatial orientation: one smooth differential equation, both of the paper's loops solved.

use nalgebra::Vector3;

use super::canal::{CanalState, omega_prime};
use super::otolith::{accel_believed, gif_expected, gif_rotation_error};
use super::{HeadMotion, ObserverParameters, OrientationObserver, ParameterError, Perception};

/// Rounding of a time difference that must not cost an extra integration step, in steps.
const STEP_COUNT_SLACK: f64 = 1e-6;

/// What the observer remembers; also, as one value, its time derivative.
#[derive(Clone, Copy, Debug)]
struct State {
    /// The canals, Eq. 8.
    canal: CanalState,
    /// z: the brain's model of the canals, Eq. 9, rad/s.
    internal_canal: Vector3<f64>,
    /// ĝ: believed gravity, Eq. 1, m/s².
    gravity: Vector3<f64>,
    /// Low-passed canal afference, sensed and expected, rad/s; constant without that low-pass.
    canal_sensed: Vector3<f64>,
    canal_expected: Vector3<f64>,
    /// Low-passed otolith afference, sensed and expected, m/s²; constant without that low-pass.
    otolith_sensed: Vector3<f64>,
    otolith_expected: Vector3<f64>,
}

impl State {
    /// `self + rate * dt_s`.
    #[inline]
    fn plus(&self, rate: &State, dt_s: f64) -> State {
        State {
            canal: CanalState {
                omega_forgotten: self.canal.omega_forgotten + rate.canal.omega_forgotten * dt_s,
                omega_adapted: self.canal.omega_adapted + rate.canal.omega_adapted * dt_s,
            },
            internal_canal: self.internal_canal + rate.internal_canal * dt_s,
            gravity: self.gravity + rate.gravity * dt_s,
            canal_sensed: self.canal_sensed + rate.canal_sensed * dt_s,
            canal_expected: self.canal_expected + rate.canal_expected * dt_s,
            otolith_sensed: self.otolith_sensed + rate.otolith_sensed * dt_s,
            otolith_expected: self.otolith_expected + rate.otolith_expected * dt_s,
        }
    }
}

/// What follows from state and input at one moment, without memory.
#[derive(Clone, Copy, Debug)]
struct Signals {
    /// α_ω: canal afference before any low-pass, rad/s.
    canal_afference: Vector3<f64>,
    /// f̂: expected gravito-inertial force, m/s².
    gif_expected: Vector3<f64>,
    /// e_f: gravito-inertial rotation error, rad.
    gif_error: Vector3<f64>,
    /// ω': unscaled believed angular velocity, rad/s.
    omega_prime: Vector3<f64>,
    /// â: believed acceleration, m/s².
    accel: Vector3<f64>,
}

/// Newman's observer (2009), Eqs. 1-10 of the paper, with the optional low-passes of its published descendant.
///
/// ```text
/// f̂ = (ĝ - k_a f)/(1 - k_a)      â = k_a (f - f̂)      e_f: f onto f̂      ω' = [k_ω (α_ω + z) + k_fω e_f]/(1 + k_ω)
/// ω̂ = k1 ω'                      dĝ/dt = -(k_f e_f + k_ωf ω̂) × ĝ,  |ĝ| fixed
/// ```
/// Evaluated in this order nothing is left to iterate: what leads from e_f back to e_f passes through ĝ, a state.
///
/// Integrated by the classical Runge-Kutta method, the input linear across each step; steps longer than 20 ms (5 ms
/// with a low-pass) are cut into equal parts. Afterwards ĝ is scaled back to the size it was given at the last reset.
///
/// # Degenerate inputs
/// Free fall (f = 0) and f opposite to f̂: e_f = 0. Belief exactly opposite to gravity is an unstable equilibrium.
///
/// # Departure from the paper
/// Q is the vector equation above, not a quaternion: the same gravity, no azimuth.
#[derive(Clone, Copy, Debug)]
pub struct NewmanObserver {
    parameters: ObserverParameters,
    /// |ĝ|, m/s².
    gravity_size: f64,
    state: State,
    /// The input at the end of the last step.
    motion: HeadMotion,
    /// Signals at `state` and `motion`: the percept now, and the first stage of the next step.
    signals: Signals,
}

impl NewmanObserver {
    /// An observer with these parameters, at rest and upright until it is reset.
    ///
    /// # Errors
    /// Those of [`ObserverParameters::validate`].
    pub fn new(parameters: ObserverParameters) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let gravity = Vector3::new(0.0, 0.0, -crate::units::STANDARD_GRAVITY);
        let rest = HeadMotion { omega_head: Vector3::zeros(), gif_head: gravity };
        let state = initial_state(&parameters, gravity, &rest);
        let signals = signals(&parameters, &state, &rest);
        Ok(Self { parameters, gravity_size: gravity.norm(), state, motion: rest, signals })
    }

    /// The parameters it was built with.
    pub fn parameters(&self) -> &ObserverParameters {
        &self.parameters
    }

    /// e_f now: rotation from the sensed to the expected gravito-inertial force, rad, head frame (Eq. 2).
    pub fn gif_error(&self) -> Vector3<f64> {
        self.signals.gif_error
    }

    /// One Runge-Kutta step from the present input to `to`.
    fn advance(&mut self, to: &HeadMotion, dt_s: f64) {
        let middle = self.motion.interpolated(to, 0.5);
        let rate_at = |state: State, motion: &HeadMotion| {
            rate(&self.parameters, &state, motion, &signals(&self.parameters, &state, motion))
        };
        let start = self.state;
        let rate_1 = rate(&self.parameters, &start, &self.motion, &self.signals);
        let rate_2 = rate_at(start.plus(&rate_1, 0.5 * dt_s), &middle);
        let rate_3 = rate_at(start.plus(&rate_2, 0.5 * dt_s), &middle);
        let rate_4 = rate_at(start.plus(&rate_3, dt_s), to);
        let mut end = start
            .plus(&rate_1, dt_s / 6.0)
            .plus(&rate_2, dt_s / 3.0)
            .plus(&rate_3, dt_s / 3.0)
            .plus(&rate_4, dt_s / 6.0);
        let size = end.gravity.norm();
        if size > 0.0 {
            end.gravity *= self.gravity_size / size;
        }
        self.state = end;
        self.motion = *to;
        self.signals = signals(&self.parameters, &self.state, to);
    }
}

impl OrientationObserver for NewmanObserver {
    /// # Panics
    /// On gravity or motion that is not finite.
    fn reset(&mut self, gravity_head: Vector3<f64>, motion: &HeadMotion) {
        assert!(
            motion.is_finite() && gravity_head.norm().is_finite(),
            "the observer must start from finite numbers"
        );
        self.gravity_size = gravity_head.norm();
        self.state = initial_state(&self.parameters, gravity_head, motion);
        self.motion = *motion;
        self.signals = signals(&self.parameters, &self.state, motion);
    }

    /// # Panics
    /// On a motion that is not finite, or a negative or infinite `dt_s`.
    fn step(&mut self, motion: &HeadMotion, dt_s: f64) -> Perception {
        assert!(dt_s >= 0.0 && dt_s.is_finite(), "time only goes forward: dt_s is {dt_s}");
        assert!(motion.is_finite(), "the observer must be fed finite numbers");
        let from = self.motion;
        let parts = (dt_s / self.parameters.longest_step_s() - STEP_COUNT_SLACK).ceil().max(1.0);
        for part in 1..=parts as u64 {
            self.advance(&from.interpolated(motion, part as f64 / parts), dt_s / parts);
        }
        self.perception()
    }

    fn perception(&self) -> Perception {
        Perception {
            gravity_head: self.state.gravity,
            omega_head: self.signals.omega_prime * self.parameters.omega_scale(),
            accel_head: self.signals.accel,
        }
    }
}

/// State after a long time of turning at `motion.omega_head` with the belief `gravity` given at last.
///
/// The low-passed otolith signals start as if the low-passes were not there, so nothing is felt to jump.
fn initial_state(parameters: &ObserverParameters, gravity: Vector3<f64>, motion: &HeadMotion) -> State {
    State {
        canal: CanalState::adapted_to(motion.omega_head),
        internal_canal: Vector3::zeros(),
        gravity,
        canal_sensed: Vector3::zeros(),
        canal_expected: Vector3::zeros(),
        otolith_sensed: motion.gif_head,
        otolith_expected: gif_expected(&gravity, &motion.gif_head, parameters.accel_gain),
    }
}

/// The memoryless part of the model. A low-passed loop has nothing to solve: its feedback is a state.
#[inline]
fn signals(parameters: &ObserverParameters, state: &State, motion: &HeadMotion) -> Signals {
    let accel_gain = parameters.accel_gain;
    let (gif_expected, gif_error, accel) = if parameters.otolith_low_pass_hz.is_some() {
        let accel = accel_believed(&state.otolith_sensed, &state.otolith_expected, accel_gain);
        let gif_error = gif_rotation_error(&state.otolith_sensed, &state.otolith_expected);
        (state.gravity - accel, gif_error, accel)
    } else {
        let expected = gif_expected(&state.gravity, &motion.gif_head, accel_gain);
        let accel = accel_believed(&motion.gif_head, &expected, accel_gain);
        (expected, gif_rotation_error(&motion.gif_head, &expected), accel)
    };
    let canal_afference = state.canal.afference(&motion.omega_head);
    let (canal_gain, gif_gain) = (parameters.canal_gain, parameters.gif_to_omega_gain_per_s);
    let omega_prime = if parameters.canal_low_pass_hz.is_some() {
        (state.canal_sensed - state.canal_expected) * canal_gain + gif_error * gif_gain
    } else {
        omega_prime(&canal_afference, &state.internal_canal, &gif_error, canal_gain, gif_gain)
    };
    Signals { canal_afference, gif_expected, gif_error, omega_prime, accel }
}

/// Time derivative of the state.
#[inline]
fn rate(parameters: &ObserverParameters, state: &State, motion: &HeadMotion, signals: &Signals) -> State {
    let internal_afference = signals.omega_prime - state.internal_canal;
    let turn = signals.gif_error * parameters.gif_to_gravity_gain_per_s
        + signals.omega_prime * (parameters.omega_to_gravity_gain * parameters.omega_scale());
    let low_pass = |corner_hz: Option<f64>, input: &Vector3<f64>, output: &Vector3<f64>| match corner_hz {
        Some(hz) => (input - output) * (2.0 * core::f64::consts::PI * hz),
        None => Vector3::zeros(),
    };
    let (canal_hz, otolith_hz) = (parameters.canal_low_pass_hz, parameters.otolith_low_pass_hz);
    State {
        canal: state.canal.rate(
            &motion.omega_head,
            parameters.dominant_time_constant_s,
            parameters.adaptation_time_constant_s,
        ),
        internal_canal: internal_afference / parameters.internal_dominant_time_constant_s,
        gravity: -turn.cross(&state.gravity),
        canal_sensed: low_pass(canal_hz, &signals.canal_afference, &state.canal_sensed),
        canal_expected: low_pass(canal_hz, &internal_afference, &state.canal_expected),
        otolith_sensed: low_pass(otolith_hz, &motion.gif_head, &state.otolith_sensed),
        otolith_expected: low_pass(otolith_hz, &signals.gif_expected, &state.otolith_expected),
    }
}

#[cfg(test)]
mod tests;
