//! Key poses joined by minimum-jerk movements, with the lean and the height that belong to the posture.

use nalgebra::Vector3;

use super::plan::{KeyPose, MotionError, MotionSettings};
use super::polynomial::{NODES, Polynomial, node};
use crate::balance::Reference;
use crate::character::{CONTACTS, CharacterModel, CharacterState, JointVec};
use crate::dynamics::{Kinematics, PoseSettings};

/// Rounds in which a pose with bent knees leans as it should: at 0.5 m above the ankles a round halves the error.
const ROUNDS: usize = 60;
/// How far the feet may be from where they stand in the standing pose, m.
const FEET_TOLERANCE: f64 = 5e-3;

/// The reference of a whole motion: position, rate and acceleration of every hinge and of the height at any time.
///
/// Between two key poses every hinge makes a minimum-jerk movement from rest to rest (Flash & Hogan 1985): it is on
/// the straight line between its two angles at the share `s = 10 x³ - 15 x⁴ + 6 x⁵` of the way, `x` the share of the
/// time. Lean of the ankles and height of the centre of mass are functions of `s`, taken from poses that are balanced
/// over the feet. So everything is twice continuously differentiable, and rates and accelerations are exact.
#[derive(Clone, Debug)]
pub struct Trajectory {
    first: CharacterState,
    /// 1 for hinges that lean with the body, else 0.
    ankles: JointVec,
    movements: Vec<Movement>,
    least_height: f64,
}

/// The way from one key pose to the next.
#[derive(Clone, Debug)]
struct Movement {
    start_s: f64,
    duration_s: f64,
    from: JointVec,
    change: JointVec,
    /// How far the ankles lean, rad.
    lean: Polynomial,
    /// Height of the centre of mass above the ground, m.
    height: Polynomial,
}

impl Trajectory {
    /// The motion through the key poses of `motion`; hinges they do not name stay as in the standing pose `standing`.
    ///
    /// # Errors
    /// [`MotionError`] for a motion that is out of range, names an unknown hinge, passes a hinge's limit or moves the
    /// feet.
    pub fn new(
        model: &CharacterModel,
        standing: &PoseSettings,
        motion: &MotionSettings,
    ) -> Result<Self, MotionError> {
        motion.check()?;
        let level = standing.level_angles(model)?;
        let mut poser =
            Poser { model, standing, feet: [Vector3::zeros(); CONTACTS], least_height: f64::INFINITY };
        poser.feet = poser.balanced(&level)?.feet;
        let mut angles = Vec::new();
        for (index, pose) in motion.poses.iter().enumerate() {
            angles.push(named_angles(model, &level, pose, index + 1)?);
        }
        let mut movements = Vec::new();
        for (index, (times, ends)) in motion.poses.windows(2).zip(angles.windows(2)).enumerate() {
            movements.push(poser.movement(
                [times[0].time_s, times[1].time_s],
                [ends[0], ends[1]],
                index + 2,
            )?);
        }
        let mut ankles = JointVec::zeros();
        for ankle in standing.ankles(model)? {
            ankles[ankle] = 1.0;
        }
        let first = standing.leaned(model, &angles[0], ROUNDS)?;
        Ok(Self { first, ankles, movements, least_height: poser.least_height })
    }

    /// The first pose, at rest, on the axis.
    pub fn first_pose(&self) -> &CharacterState {
        &self.first
    }

    /// From the first to the last pose, s.
    pub fn duration_s(&self) -> f64 {
        self.movements.last().map_or(0.0, |last| last.start_s + last.duration_s)
    }

    /// The reference `t` s after the start; the first pose before it, the last one after the end.
    pub fn at(&self, t: f64) -> Reference {
        let reached = self.movements.iter().rev().find(|movement| movement.start_s <= t);
        // There is at least one movement: a motion has at least two poses.
        let movement = reached.unwrap_or(&self.movements[0]);
        movement.at(t, &self.ankles)
    }

    /// Makes sure that the centre of mass stays above `least`, m.
    ///
    /// # Errors
    /// [`MotionError::TooLow`].
    pub fn check_height(&self, least: f64) -> Result<(), MotionError> {
        let height = self.least_height;
        if height > least { Ok(()) } else { Err(MotionError::TooLow { height, least }) }
    }
}

impl Movement {
    fn at(&self, t: f64, ankles: &JointVec) -> Reference {
        let x = ((t - self.start_s) / self.duration_s).clamp(0.0, 1.0);
        let s = x * x * x * (10.0 + x * (6.0 * x - 15.0));
        let rate = 30.0 * x * x * (1.0 - x) * (1.0 - x) / self.duration_s;
        let acceleration = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (self.duration_s * self.duration_s);
        // Chain rule for a function of s: value, rate, acceleration.
        let in_time = |function: &Polynomial| {
            let [value, first, second] = function.at(s);
            [value, first * rate, second * rate * rate + first * acceleration]
        };
        let (lean, height) = (in_time(&self.lean), in_time(&self.height));
        Reference {
            angles: self.from + s * self.change - lean[0] * ankles,
            rates: rate * self.change - lean[1] * ankles,
            accelerations: acceleration * self.change - lean[2] * ankles,
            height: height[0],
            height_rate: height[1],
            height_acceleration: height[2],
        }
    }
}

/// The standing pose's angles with those of `pose` in their place.
fn named_angles(
    model: &CharacterModel,
    level: &JointVec,
    pose: &KeyPose,
    number: usize,
) -> Result<JointVec, MotionError> {
    let mut angles = *level;
    for (name, &angle) in &pose.angles {
        let hinge = model.joint(name).ok_or_else(|| MotionError::UnknownJoint {
            pose: number,
            name: name.clone(),
            known: model.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", "),
        })?;
        if let Some((low, high)) =
            model.joints[hinge].range.filter(|(low, high)| angle < *low || angle > *high)
        {
            let allowed = format!("{low} to {high} rad in this model");
            return Err(MotionError::Range {
                pose: number,
                key: format!("angles.{name}"),
                got: angle,
                allowed,
            });
        }
        angles[hinge] = angle;
    }
    Ok(angles)
}

/// Balances poses over the feet and watches them.
struct Poser<'a> {
    model: &'a CharacterModel,
    standing: &'a PoseSettings,
    /// Contact points of the standing pose.
    feet: [Vector3<f64>; CONTACTS],
    least_height: f64,
}

/// What is kept of a balanced pose.
struct Balanced {
    state: CharacterState,
    height: f64,
    feet: [Vector3<f64>; CONTACTS],
}

impl Poser<'_> {
    fn balanced(&self, angles: &JointVec) -> Result<Balanced, MotionError> {
        let state = self.standing.leaned(self.model, angles, ROUNDS)?;
        let mut kinematics = Kinematics::default();
        kinematics.update(self.model, &state);
        let feet = std::array::from_fn(|i| kinematics.contact_position(self.model, i));
        Ok(Balanced { state, height: kinematics.com(self.model).z, feet })
    }

    /// The movement between two postures that ends in pose `number`.
    fn movement(
        &mut self,
        times: [f64; 2],
        ends: [JointVec; 2],
        number: usize,
    ) -> Result<Movement, MotionError> {
        let [from, change] = [ends[0], ends[1] - ends[0]];
        let (mut lean, mut height) = ([0.0; NODES], [0.0; NODES]);
        for i in 0..NODES {
            let balanced = self.balanced(&(from + node(i) * change))?;
            let off = self.feet.iter().zip(&balanced.feet).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            if off > FEET_TOLERANCE {
                return Err(MotionError::Feet { pose: number, off });
            }
            let attitude = balanced.state.root_attitude;
            lean[i] = 2.0 * libm::atan2(attitude.j, attitude.w);
            height[i] = balanced.height;
            self.least_height = self.least_height.min(balanced.height);
        }
        Ok(Movement {
            start_s: times[0],
            duration_s: times[1] - times[0],
            from,
            change,
            lean: Polynomial::through(lean),
            height: Polynomial::through(height),
        })
    }
}

#[cfg(test)]
#[path = "trajectory_tests.rs"]
mod tests;
