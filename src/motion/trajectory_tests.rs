//! Trajectories against closed forms, finite differences and the poses they were made from.

use super::*;
use crate::dynamics::standing_pose;
use crate::motion::{MOTION_NAMES, shipped_motion};

fn model() -> CharacterModel {
    CharacterModel::standing().unwrap()
}

fn made(text: &str) -> Result<Trajectory, MotionError> {
    let motion = MotionSettings::from_toml(text)?;
    Trajectory::new(&model(), &PoseSettings::default(), &motion)
}

fn shipped() -> impl Iterator<Item = (&'static str, MotionSettings, Trajectory)> {
    MOTION_NAMES.into_iter().map(|name| {
        let text = shipped_motion(name).unwrap();
        (name, MotionSettings::from_toml(text).unwrap(), made(text).unwrap())
    })
}

#[test]
fn the_middle_of_a_movement_is_the_closed_form() {
    let trajectory = made(
        "[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 1.5\n[[pose]]\ntime_s = 3.5\nangles = { neck_y = -0.4 }",
    )
    .unwrap();
    let neck = model().joint("neck_y").unwrap();
    let middle = trajectory.at(2.5);
    assert!((middle.angles[neck] + 0.2).abs() < 1e-15);
    assert!((middle.rates[neck] - 15.0 / 8.0 * -0.4 / 2.0).abs() < 1e-15);
    assert!(middle.accelerations[neck].abs() < 1e-14);
    // The largest acceleration, 10/√3 Δq/T², stands at x = (1 - 1/√3) / 2.
    let early = trajectory.at(1.5 + (1.0 - 1.0 / 3_f64.sqrt()));
    assert!((early.accelerations[neck] - 10.0 / 3_f64.sqrt() * -0.4 / 4.0).abs() < 1e-12);
    assert_eq!(trajectory.duration_s(), 3.5);
}

#[test]
fn key_poses_are_passed_at_rest_and_balanced_over_the_feet() {
    let model = model();
    for (name, motion, trajectory) in shipped() {
        let first = trajectory.at(-1.0);
        assert!((first.angles - trajectory.first_pose().joint_angles).amax() < 1e-12, "{name}");
        for pose in &motion.poses {
            let at = trajectory.at(pose.time_s);
            for (hinge, angle) in pose.angles.iter().filter(|(hinge, _)| !hinge.starts_with("foot")) {
                assert!((at.angles[model.joint(hinge).unwrap()] - angle).abs() < 1e-12, "{name}: {hinge}");
            }
            assert!(at.rates.amax() < 1e-12 && at.accelerations.amax() < 1e-12, "{name} at {}", pose.time_s);
            assert!(at.height_rate.abs() < 1e-12 && at.height_acceleration.abs() < 1e-12, "{name}");
        }
        let last = trajectory.at(1e6);
        let standing = standing_pose(&model, &PoseSettings::default()).unwrap();
        assert!((last.angles - standing.joint_angles).amax() < 1e-6, "{name} ends standing");
    }
}

/// Height and distance ahead of the feet of the centre of mass, with the root placed so that the soles are level.
fn centre_of_mass(model: &CharacterModel, angles: &JointVec) -> (f64, f64) {
    let mut state = standing_pose(model, &PoseSettings::default()).unwrap();
    state.joint_angles = *angles;
    state.root_attitude = nalgebra::UnitQuaternion::identity();
    let mut kinematics = Kinematics::default();
    kinematics.update(model, &state);
    // Whatever turns the foot's body back is the root's attitude in a pose with level soles.
    let foot = nalgebra::Rotation3::from_matrix_unchecked(kinematics.rot_world_body[model.feet[0]]);
    state.root_attitude = nalgebra::UnitQuaternion::from_rotation_matrix(&foot.inverse());
    kinematics.update(model, &state);
    let com = kinematics.com(model);
    let feet: Vec<_> = (0..CONTACTS).map(|i| kinematics.contact_position(model, i)).collect();
    let ground = feet.iter().map(|point| point.z).fold(f64::INFINITY, f64::min) - model.contacts[0].radius;
    (com.z - ground, com.x - feet.iter().map(|point| point.x).sum::<f64>() / CONTACTS as f64)
}

#[test]
fn between_the_poses_height_and_lean_belong_to_the_posture() {
    let (model, pose) = (model(), PoseSettings::default());
    for (name, _, trajectory) in shipped() {
        for i in 0..=200 {
            let at = trajectory.at(trajectory.duration_s() * f64::from(i) / 200.0);
            let (height, ahead) = centre_of_mass(&model, &at.angles);
            assert!(
                (at.height + pose.initial_overlap - height).abs() < 1e-7,
                "{name}: {} {height}",
                at.height
            );
            assert!((ahead - pose.com_ahead_of_centroid).abs() < 1e-7, "{name}: {ahead}");
        }
    }
}

#[test]
fn rates_and_accelerations_are_the_derivatives() {
    const H: f64 = 1e-4;
    for (name, _, trajectory) in shipped() {
        let steps = (trajectory.duration_s() / 0.013) as usize;
        for t in (0..steps).map(|k| 0.013 * k as f64) {
            let [before, at, after] = [t - H, t, t + H].map(|t| trajectory.at(t));
            let rates = (after.angles - before.angles) / (2.0 * H);
            let accelerations = (after.rates - before.rates) / (2.0 * H);
            assert!((rates - at.rates).amax() < 1e-5, "{name} at {t}");
            // The jerk jumps at a key pose, so a difference across it is off by half the jump times H.
            assert!((accelerations - at.accelerations).amax() < 2e-2, "{name} at {t}");
            let (rate, acceleration) = (
                (after.height - before.height) / (2.0 * H),
                (after.height_rate - before.height_rate) / (2.0 * H),
            );
            assert!((rate - at.height_rate).abs() < 1e-5, "{name} at {t}");
            assert!((acceleration - at.height_acceleration).abs() < 2e-2, "{name} at {t}");
        }
    }
}

#[test]
fn what_the_body_cannot_do_is_refused() {
    for (angles, parts) in [
        ("nose = 1", &["pose 2", "no hinge `nose`", "hint: hinges are", "neck_y"][..]),
        ("shank_l_y = 1.0", &["way to pose 2", "mm", "hint:"]),
        ("thigh_l_x = 0.3", &["way to pose 2", "allowed are 5 mm"]),
    ] {
        let error = made(&format!("[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 1\nangles = {{ {angles} }}"));
        let error = error.unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{angles}: {error}");
    }
    let low = made(shipped_motion("stand-up").unwrap()).unwrap();
    assert!(low.check_height(0.6).is_ok());
    let error = low.check_height(0.9).unwrap_err().to_string();
    assert!(error.contains("0.90 m") && error.contains("fall.least_com_height"), "{error}");
}
