//! Recursive Newton-Euler: the generalised forces that belong to a motion.

use nalgebra::Vector3;

use super::inertia::Inertias;
use super::kinematics::Kinematics;
use super::spatial::{Motion, Wrench};
use crate::character::{BODIES, CharacterModel, GenVec};

/// Velocity-product forces: `C(q, q̇)` without gravity, and the wrench of the whole character.
#[derive(Clone, Debug)]
pub struct VelocityForces {
    /// `C(q, q̇)`, generalised.
    pub generalised: GenVec,
    /// Rate of change of the character's momentum at zero generalised acceleration, about the reference point.
    pub momentum_rate: Wrench,
}

impl Default for VelocityForces {
    fn default() -> Self {
        Self { generalised: GenVec::zeros(), momentum_rate: Wrench::default() }
    }
}

/// `C(q, q̇)` by one backward pass over the velocity-product accelerations found by the kinematics.
pub(super) fn velocity_forces(
    model: &CharacterModel,
    kinematics: &Kinematics,
    inertias: &Inertias,
) -> VelocityForces {
    let wrench = std::array::from_fn(|i| {
        let (inertia, velocity) = (&inertias.body[i], &kinematics.velocity[i]);
        let mut wrench = inertia.apply(&kinematics.bias_acceleration[i]);
        wrench += velocity.cross_wrench(&inertia.apply(velocity));
        wrench
    });
    let (generalised, momentum_rate) = project(model, kinematics, wrench);
    VelocityForces { generalised, momentum_rate }
}

/// Inverse dynamics: `tau = M qdd + C(q, q̇) + G(q)` for the stated acceleration, armature included, no contact.
///
/// One pass without velocities on top of the `forces` that belong to them.
pub(super) fn inverse_dynamics(
    model: &CharacterModel,
    kinematics: &Kinematics,
    inertias: &Inertias,
    forces: &VelocityForces,
    qdd: &GenVec,
    gravity: &Vector3<f64>,
) -> GenVec {
    let mut acceleration = [Motion::default(); BODIES];
    for (i, body) in model.bodies.iter().enumerate() {
        let mut a = if i == 0 {
            // Uniform gravity is an upward acceleration of the whole frame.
            Motion { angular: Vector3::zeros(), linear: -gravity }
        } else {
            acceleration[body.parent]
        };
        for dof in body.first_dof..body.first_dof + body.dofs {
            a = a.plus_scaled(qdd[dof], &kinematics.axis[dof]);
        }
        acceleration[i] = a;
    }
    let wrench = std::array::from_fn(|i| inertias.body[i].apply(&acceleration[i]));
    let (mut tau, _) = project(model, kinematics, wrench);
    tau += forces.generalised;
    for (j, joint) in model.joints.iter().enumerate() {
        tau[6 + j] += joint.armature * qdd[6 + j];
    }
    tau
}

/// Generalised forces that hold one wrench per body, and the sum of the wrenches.
fn project(
    model: &CharacterModel,
    kinematics: &Kinematics,
    mut wrench: [Wrench; BODIES],
) -> (GenVec, Wrench) {
    for i in (1..BODIES).rev() {
        let carried = wrench[i];
        wrench[model.bodies[i].parent] += carried;
    }
    let tau = GenVec::from_fn(|dof, _| kinematics.axis[dof].dot(&wrench[model.dof_body[dof]]));
    (tau, wrench[0])
}
