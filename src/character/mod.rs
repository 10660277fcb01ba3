//! The simulated body: what never changes ([`CharacterModel`]) and what does ([`CharacterState`]).
//!
//! Sizes are static so that nothing is allocated in a tick and the same build gives the same bits everywhere.

use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};

mod mjcf;
mod mjcf_attributes;
mod state;

pub use mjcf::{ModelError, STANDING_MJCF};
pub use state::CharacterState;

/// Number of bodies of the character.
pub const BODIES: usize = 19;
/// Degrees of freedom: 6 of the floating root, then one for each hinge.
pub const DOF: usize = 41;
/// Actuated hinges.
pub const JOINTS: usize = DOF - 6;
/// Foot contact points: front-left, front-right, heel-left, heel-right of the left foot, then of the right.
pub const CONTACTS: usize = 8;
/// Longest chain of degrees of freedom from the root to a body.
pub const MAX_CHAIN: usize = 24;
/// Degrees of freedom from the root to a foot: 6 + hip 3 + knee 1 + ankle 2.
pub const FOOT_CHAIN: usize = 12;

/// One number for each degree of freedom.
///
/// Order: root linear (world axes), root angular (root body axes), hinges depth first in file order.
pub type GenVec = SVector<f64, DOF>;
/// One number for each hinge.
pub type JointVec = SVector<f64, JOINTS>;

/// The two feet, in the order in which contact points are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foot {
    /// The left foot, contact points 0 to 3.
    Left,
    /// The right foot, contact points 4 to 7.
    Right,
}

impl Foot {
    /// Both feet in storage order.
    pub const BOTH: [Foot; 2] = [Foot::Left, Foot::Right];

    /// The foot a contact point belongs to.
    pub fn of_contact(point: usize) -> Foot {
        if point < CONTACTS / 2 { Foot::Left } else { Foot::Right }
    }
}

/// One rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name in the model file.
    pub name: String,
    /// Index of the parent body; the root is its own parent.
    pub parent: usize,
    /// Origin in the parent's frame, m.
    pub origin_in_parent: Vector3<f64>,
    /// Attitude in the parent's frame before its hinges turn.
    pub rot_parent_body: Matrix3<f64>,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, body frame, m.
    pub com: Vector3<f64>,
    /// Inertia about the centre of mass, body axes, kg m².
    pub inertia: Matrix3<f64>,
    /// Its degrees of freedom: `first_dof..first_dof + dofs`.
    pub first_dof: usize,
    /// Number of its degrees of freedom (6 for the root, hinges otherwise).
    pub dofs: usize,
}

/// One hinge.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name in the model file.
    pub name: String,
    /// Index of the body it moves.
    pub body: usize,
    /// Axis, unit vector in body axes (the same before and after the hinge turns).
    pub axis: Vector3<f64>,
    /// Anchor in the body frame, m.
    pub anchor: Vector3<f64>,
    /// Rotor inertia added to the diagonal of the mass matrix, kg m².
    pub armature: f64,
    /// Limits of the angle, rad; `None` for a free hinge.
    pub range: Option<(f64, f64)>,
}

/// A point of a foot that can touch the ground: a small sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// Index of the foot's body.
    pub body: usize,
    /// Centre of the sphere, body frame, m.
    pub position: Vector3<f64>,
    /// Radius of the sphere, m.
    pub radius: f64,
}

/// Everything about a character that never changes after loading.
#[derive(Clone, Debug, PartialEq)]
pub struct CharacterModel {
    /// Bodies depth first; the parent of a body stands before it. Body 0 is the root.
    pub bodies: Vec<Body>,
    /// Hinges in the order of their degrees of freedom (hinge `j` is degree of freedom `6 + j`).
    pub joints: Vec<Joint>,
    /// The foot contact points.
    pub contacts: [ContactPoint; CONTACTS],
    /// Bodies of the left and of the right foot.
    pub feet: [usize; 2],
    /// Body that carries the vestibular organ.
    pub head: usize,
    /// Position of the vestibular organ, head body frame, m.
    pub vestibule: Vector3<f64>,
    /// Body a push acts on (`thorax`), at its centre of mass.
    pub thorax: usize,
    /// Gravity, world axes, m/s².
    pub gravity: Vector3<f64>,
    /// Coulomb friction coefficient of the feet on the ground.
    pub friction: f64,
    /// Parent of each degree of freedom: the previous one on the way to the root; the root's first has itself.
    pub dof_parent: [usize; DOF],
    /// Chain of each degree of freedom from the root to itself; entries past `chain_len` are unused.
    pub chain: [[usize; MAX_CHAIN]; DOF],
    /// Length of each chain, itself included.
    pub chain_len: [usize; DOF],
    /// Body of each degree of freedom.
    pub dof_body: [usize; DOF],
    /// What the loader noticed and left out (solver settings of another engine).
    pub notes: Vec<String>,
}

impl CharacterModel {
    /// Loads a model from MJCF text.
    ///
    /// # Errors
    /// [`ModelError`] for text that is not XML, for an element or attribute outside the supported subset, and for a
    /// body that does not have 19 bodies, 41 degrees of freedom and two feet with four contact points each.
    pub fn from_mjcf(text: &str, source: &str) -> Result<Self, ModelError> {
        mjcf::load(text, source)
    }

    /// The built-in character: 65 kg, 1.70 m (`configs/characters/standing.xml`).
    ///
    /// # Errors
    /// Never for the shipped file (a test loads it).
    pub fn standing() -> Result<Self, ModelError> {
        Self::from_mjcf(STANDING_MJCF, "configs/characters/standing.xml")
    }

    /// Total mass, kg.
    pub fn mass(&self) -> f64 {
        self.bodies.iter().map(|body| body.mass).sum()
    }

    /// Index of the body named `name`.
    pub fn body(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|body| body.name == name)
    }

    /// Index of the hinge named `name`.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// The last degree of freedom on the way from the root to `body` (its own last, or an ancestor's).
    pub fn last_dof(&self, body: usize) -> usize {
        let mut body = body;
        while self.bodies[body].dofs == 0 {
            body = self.bodies[body].parent;
        }
        self.bodies[body].first_dof + self.bodies[body].dofs - 1
    }

    /// The chain of degrees of freedom that moves `body`, root first.
    pub fn body_chain(&self, body: usize) -> &[usize] {
        let dof = self.last_dof(body);
        &self.chain[dof][..self.chain_len[dof]]
    }
}

/// Attitude from a quaternion (w, x, y, z), normalised; identity for a zero quaternion.
pub(crate) fn attitude_wxyz(w: f64, x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
    let quaternion = nalgebra::Quaternion::new(w, x, y, z);
    UnitQuaternion::try_new(quaternion, 1e-12).unwrap_or_else(UnitQuaternion::identity)
}
