//! The controller's parts against slow, independent solutions.

mod cone;
mod fall;
mod kkt;
mod perceive;

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use crate::character::{CharacterModel, JointVec};
use crate::dynamics::{ContactSettings, Dynamics, Engine, PoseSettings, standing_pose};

/// The standing character.
fn standing() -> Engine {
    let model = Arc::new(CharacterModel::standing().unwrap());
    let state = standing_pose(&model, &PoseSettings::default()).unwrap();
    Engine::new(model, ContactSettings::default(), state)
}

/// Numbers in -1..1 from a seed.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.unit(), self.unit(), self.unit())
    }

    /// A body near the standing pose, moving.
    fn swaying(&mut self, amount: f64) -> Engine {
        let engine = standing();
        let mut state = *engine.state();
        state.joint_angles += amount * JointVec::from_fn(|_, _| self.unit());
        state.root_attitude *= UnitQuaternion::from_scaled_axis(amount * self.vector());
        state.velocity.iter_mut().for_each(|v| *v = 3.0 * amount * self.unit());
        Engine::new(Arc::new(engine.model().clone()), ContactSettings::default(), state)
    }
}
