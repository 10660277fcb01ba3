//! The initial standing pose: bent knees, level soles, centre of mass a little behind the middle of the support.

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};

use super::Kinematics;
use crate::character::{CONTACTS, CharacterModel, CharacterState, DOF, JointVec};

/// How the character stands at the start.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseSettings {
    /// Hinge angles by name, rad; hinges not named are at zero.
    pub joint_angles: BTreeMap<String, f64>,
    /// Centre of mass ahead of the centroid of the contact points, m.
    pub com_ahead_of_centroid: f64,
    /// Hinges that lean with the body so that the soles stay level.
    pub ankle_joints: Vec<String>,
    /// How far the lowest sphere starts below touching, m: contact starts closed.
    pub initial_overlap: f64,
}

impl Default for PoseSettings {
    /// The pose of `spec/balance.md`: straight knees would make the support Jacobian rank deficient.
    fn default() -> Self {
        let knee = 0.16;
        let mut joint_angles = BTreeMap::new();
        for (side, sign) in [("l", 1.0), ("r", -1.0)] {
            joint_angles.insert(format!("thigh_{side}_y"), -knee * 0.52);
            joint_angles.insert(format!("shank_{side}_y"), knee);
            joint_angles.insert(format!("foot_{side}_y"), -knee * 0.48);
            joint_angles.insert(format!("uarm_{side}_x"), sign * 0.10);
            joint_angles.insert(format!("uarm_{side}_y"), 0.05);
            joint_angles.insert(format!("farm_{side}_y"), -0.30);
        }
        Self {
            joint_angles,
            com_ahead_of_centroid: -0.010,
            ankle_joints: vec!["foot_l_y".to_owned(), "foot_r_y".to_owned()],
            initial_overlap: 2e-5,
        }
    }
}

/// Why a pose cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// A hinge of the pose does not exist in the model.
    #[error("pose: the model has no hinge `{name}`\n\nhint: hinges are {known}")]
    UnknownJoint {
        /// The name that was asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// Numbers with which no pose is found.
    #[error(
        "pose: no standing pose is found with the centre of mass {com_ahead_of_centroid} m ahead of the feet's middle\n\n\
         hint: hinge angles are in rad, within -3.2 to 3.2; com_ahead_of_centroid is within -0.1 to 0.1 m, initial_overlap \
         within 0 to 0.01 m"
    )]
    Impossible {
        /// What was asked for, m.
        com_ahead_of_centroid: f64,
    },
}

/// Rounds after which the standing pose leans as it should: each gains a factor of about 16.
const STANDING_ROUNDS: usize = 6;

/// The standing pose: the hinge angles of the settings, [leaned](PoseSettings::leaned).
///
/// # Errors
/// [`PoseError::UnknownJoint`] for a hinge name the model does not have, [`PoseError::Impossible`] for numbers out of
/// range.
pub fn standing_pose(model: &CharacterModel, settings: &PoseSettings) -> Result<CharacterState, PoseError> {
    settings.leaned(model, &settings.level_angles(model)?, STANDING_ROUNDS)
}

impl PoseSettings {
    /// Hinge angles before the body leans, rad.
    ///
    /// # Errors
    /// As [`standing_pose`].
    pub fn level_angles(&self, model: &CharacterModel) -> Result<JointVec, PoseError> {
        let in_range = self.joint_angles.values().all(|angle| angle.abs() <= 3.2)
            && self.com_ahead_of_centroid.abs() <= 0.1
            && (0.0..=0.01).contains(&self.initial_overlap);
        if !in_range {
            return Err(PoseError::Impossible { com_ahead_of_centroid: self.com_ahead_of_centroid });
        }
        let mut angles = JointVec::zeros();
        for (name, angle) in &self.joint_angles {
            angles[hinge(model, name)?] = *angle;
        }
        Ok(angles)
    }

    /// The ankle hinges' indices.
    ///
    /// # Errors
    /// [`PoseError::UnknownJoint`].
    pub fn ankles(&self, model: &CharacterModel) -> Result<Vec<usize>, PoseError> {
        self.ankle_joints.iter().map(|name| hinge(model, name)).collect()
    }

    /// A pose at rest with the hinges at `angles`: the body above the ankles leans until the centre of mass stands where
    /// the settings ask for, the support's centroid is placed on the vertical axis and the lowest sole on the ground.
    /// A round leaves the share `1 - h / 0.95 m` of the error, h the height of the centre of mass above the ankles.
    ///
    /// # Errors
    /// [`PoseError::UnknownJoint`].
    pub fn leaned(
        &self,
        model: &CharacterModel,
        angles: &JointVec,
        rounds: usize,
    ) -> Result<CharacterState, PoseError> {
        let ankles = self.ankles(model)?;
        let mut state = CharacterState::from_qpos(&std::array::from_fn::<f64, { DOF + 1 }, _>(|_| 0.0));
        state.joint_angles = *angles;
        let mut kinematics = Kinematics::default();
        let mut lean = 0.0;
        for _ in 0..rounds {
            for &ankle in &ankles {
                state.joint_angles[ankle] = angles[ankle] - lean;
            }
            state.root_attitude = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(
                libm::cos(lean / 2.0),
                0.0,
                libm::sin(lean / 2.0),
                0.0,
            ));
            kinematics.update(model, &state);
            let centroid = contact_centroid(&kinematics, model);
            lean -= (kinematics.com(model).x - centroid.x - self.com_ahead_of_centroid) / 0.95;
        }
        let centroid = contact_centroid(&kinematics, model);
        let lowest = (0..CONTACTS)
            .map(|i| kinematics.contact_position(model, i).z - model.contacts[i].radius)
            .fold(f64::INFINITY, f64::min);
        state.root_position -= Vector3::new(centroid.x, centroid.y, lowest + self.initial_overlap);
        Ok(state)
    }
}

fn hinge(model: &CharacterModel, name: &str) -> Result<usize, PoseError> {
    model.joint(name).ok_or_else(|| PoseError::UnknownJoint {
        name: name.to_owned(),
        known: model.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", "),
    })
}

fn contact_centroid(kinematics: &Kinematics, model: &CharacterModel) -> Vector3<f64> {
    (0..CONTACTS).map(|i| kinematics.contact_position(model, i)).sum::<Vector3<f64>>() / CONTACTS as f64
}
