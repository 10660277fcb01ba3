//! Joint motors solved implicitly with the contacts: `tau = tau_ff + D (w - v⁺)`, limited in torque.
//!
//! An implicit motor only adds `h D` to the diagonal of the mass matrix, so tree sparsity and the contact rows stay
//! as they are. A motor at its limit is taken out of the diagonal and becomes a constant torque (active set). The
//! same form carries implicit PD (`D = k_d + h k_p`), limp damped joints (`w = 0`) and joint limits.

use crate::character::{CharacterModel, CharacterState, DOF, GenVec, JOINTS, JointVec};

/// Most rounds of the active set in one step; more were never seen in the prototype's 60-s runs.
pub const MAX_MOTOR_ROUNDS: usize = 10;

/// Stiffness of the implicit spring that holds a hinge inside its range, N m/rad.
const LIMIT_STIFFNESS: f64 = 2000.0;
/// Damping of that spring, N m s/rad.
const LIMIT_DAMPING: f64 = 20.0;

/// What the hinges are asked to do in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorSet {
    /// Gain D of the velocity motor, N m s/rad; 0 is a pure torque motor.
    pub damping: JointVec,
    /// Target rate w, rad/s.
    pub target_rate: JointVec,
    /// Feed-forward torque, N m.
    pub torque: JointVec,
    /// Limit of the whole torque, N m.
    pub torque_limit: JointVec,
}

impl MotorSet {
    /// Torques only, each limited to `limit`.
    pub fn torques(torque: JointVec, limit: f64) -> Self {
        Self {
            damping: JointVec::zeros(),
            target_rate: JointVec::zeros(),
            torque: torque.map(|t| t.clamp(-limit, limit)),
            torque_limit: JointVec::repeat(limit),
        }
    }

    /// Every joint limp with damping `damping` N m s/rad.
    pub fn limp(damping: f64) -> Self {
        Self {
            damping: JointVec::repeat(damping),
            target_rate: JointVec::zeros(),
            torque: JointVec::zeros(),
            torque_limit: JointVec::repeat(f64::INFINITY),
        }
    }

    /// Implicit PD toward `target` with gains `kp`, `kd` and torque limit: the spring and damper act at the end of the
    /// step, which is stable at any stiffness.
    pub fn implicit_pd(
        state: &CharacterState,
        target: &JointVec,
        kp: &JointVec,
        kd: &JointVec,
        limit: f64,
        dt_s: f64,
    ) -> Self {
        let damping = kd + dt_s * kp;
        let spring = kp.component_mul(&(target - state.joint_angles));
        let target_rate =
            JointVec::from_fn(|j, _| if damping[j] > 0.0 { spring[j] / damping[j] } else { 0.0 });
        Self { damping, target_rate, torque: JointVec::zeros(), torque_limit: JointVec::repeat(limit) }
    }
}

/// State of one joint in the active set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Saturation {
    Free,
    AtUpper,
    AtLower,
}

/// The active set of the motors during one step.
#[derive(Clone, Debug)]
pub(super) struct MotorSolve {
    saturation: [Saturation; JOINTS],
    limit_damping: JointVec,
    limit_torque: JointVec,
}

impl MotorSolve {
    /// Starts with every motor inside its limit; hinges outside their range get the limit's spring.
    pub(super) fn new(model: &CharacterModel, state: &CharacterState, dt_s: f64) -> Self {
        let (mut limit_damping, mut limit_torque) = (JointVec::zeros(), JointVec::zeros());
        for (j, joint) in model.joints.iter().enumerate() {
            let Some((low, high)) = joint.range else { continue };
            let angle = state.joint_angles[j];
            let outside = if angle < low {
                angle - low
            } else if angle > high {
                angle - high
            } else {
                continue;
            };
            limit_damping[j] = LIMIT_DAMPING + dt_s * LIMIT_STIFFNESS;
            limit_torque[j] = -LIMIT_STIFFNESS * outside;
        }
        Self { saturation: [Saturation::Free; JOINTS], limit_damping, limit_torque }
    }

    /// Whether anything stands on the diagonal at all: plain torque motors need no second factorisation.
    pub(super) fn is_plain(&self, motors: &MotorSet) -> bool {
        let absent = |damping: &JointVec| damping.as_slice().iter().all(|d| *d == 0.0);
        absent(&motors.damping) && absent(&self.limit_damping)
    }

    /// The diagonal addition `h D` of the present set.
    pub(super) fn diagonal(&self, motors: &MotorSet, dt_s: f64) -> GenVec {
        let mut addition = GenVec::zeros();
        for j in 0..JOINTS {
            let own = if self.saturation[j] == Saturation::Free { motors.damping[j] } else { 0.0 };
            addition[6 + j] = dt_s * (own + self.limit_damping[j]);
        }
        addition
    }

    /// The explicit torques of the present set: `tau_ff + D w` or the limit. `D v⁺` is in the diagonal; the caller's
    /// right-hand side must hold `-D v` of the start velocity, which [`Self::start_drag`] gives. A pure torque motor
    /// never enters the active set: its torque is clamped here.
    pub(super) fn explicit_torque(&self, motors: &MotorSet) -> JointVec {
        JointVec::from_fn(|j, _| {
            let own = match self.saturation[j] {
                Saturation::Free if motors.damping[j] == 0.0 => {
                    motors.torque[j].min(motors.torque_limit[j]).max(-motors.torque_limit[j])
                }
                Saturation::Free => motors.torque[j] + motors.damping[j] * motors.target_rate[j],
                Saturation::AtUpper => motors.torque_limit[j],
                Saturation::AtLower => -motors.torque_limit[j],
            };
            own + self.limit_torque[j]
        })
    }

    /// `D v`: moves the implicit term onto the increment `v⁺ - v`, for which the step solves.
    pub(super) fn start_drag(&self, motors: &MotorSet, velocity: &GenVec) -> JointVec {
        JointVec::from_fn(|j, _| {
            let own = if self.saturation[j] == Saturation::Free { motors.damping[j] } else { 0.0 };
            (own + self.limit_damping[j]) * velocity[6 + j]
        })
    }

    /// Torque each motor (and limit spring) really gave, for the end velocity `velocity`.
    pub(super) fn realised(&self, motors: &MotorSet, velocity: &GenVec) -> JointVec {
        let explicit = self.explicit_torque(motors);
        explicit - self.start_drag(motors, velocity)
    }

    /// Updates the set for the end velocity; true when it did not change (the step is done).
    pub(super) fn settle(&mut self, motors: &MotorSet, velocity: &GenVec) -> bool {
        let mut unchanged = true;
        for j in 0..JOINTS {
            if motors.damping[j] == 0.0 {
                continue;
            }
            let wanted = motors.torque[j] + motors.damping[j] * (motors.target_rate[j] - velocity[6 + j]);
            let limit = motors.torque_limit[j];
            let next = if wanted > limit {
                Saturation::AtUpper
            } else if wanted < -limit {
                Saturation::AtLower
            } else {
                Saturation::Free
            };
            unchanged &= next == self.saturation[j];
            self.saturation[j] = next;
        }
        unchanged
    }
}

const _: () = assert!(DOF == JOINTS + 6);
