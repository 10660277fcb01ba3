//! Golden numbers of an independent engine, and physical laws.

mod contact;
mod golden;
mod laws;
mod motors;

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::{ContactSettings, Engine, PoseSettings, standing_pose};
use crate::character::{CharacterModel, CharacterState, DOF, GenVec};

pub(super) fn model() -> Arc<CharacterModel> {
    Arc::new(CharacterModel::standing().unwrap())
}

pub(super) fn engine_at(state: CharacterState) -> Engine {
    Engine::new(model(), ContactSettings::default(), state)
}

pub(super) fn standing() -> Engine {
    let model = model();
    let state = standing_pose(&model, &PoseSettings::default()).unwrap();
    Engine::new(model, ContactSettings::default(), state)
}

/// Small deterministic generator for random states: the laws must hold anywhere.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// Uniform in -1..1.
    pub(super) fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(super) fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.unit(), self.unit(), self.unit())
    }

    pub(super) fn generalised(&mut self, scale: f64) -> GenVec {
        GenVec::from_fn(|_, _| scale * self.unit())
    }

    pub(super) fn state(&mut self) -> CharacterState {
        let mut qpos = [0.0; DOF + 1];
        qpos.iter_mut().for_each(|x| *x = self.unit());
        let mut state = CharacterState::from_qpos(&qpos);
        state.root_attitude = UnitQuaternion::from_scaled_axis(2.0 * self.vector());
        state.velocity = self.generalised(2.0);
        state
    }
}
