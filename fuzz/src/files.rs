//! Files the user writes. What is accepted is usable, and what is written back reads as the same.

use nalgebra::{Matrix3, Vector3};
use otolith::character::CharacterModel;
use otolith::config::Config;
use otolith::dynamics::PoseSettings;
use otolith::imu::{Calibration, Mount};
use otolith::motion::{MotionSettings, Trajectory};
use otolith::vestibular::{HeadMotion, NewmanObserver, ObserverParameters, OrientationObserver};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn text(data: &[u8]) -> &str {
    std::str::from_utf8(data).unwrap_or_default()
}

pub(crate) fn config(data: &[u8]) {
    let text = text(data);
    // A motion may name any file of this machine. What reads motions is a target of its own.
    if text.contains("motion") && text.contains(['/', '\\']) {
        return;
    }
    let Ok(config) = Config::from_toml(text, "fuzz.toml") else { return };
    let written = config.to_toml();
    let read = Config::from_toml(&written, "written.toml").expect("what was written reads");
    assert_eq!(read.to_toml(), written);
}

pub(crate) fn calibration(data: &[u8]) {
    let Ok(calibration) = Calibration::from_toml("fuzz.toml", text(data)) else { return };
    let raw = Vector3::new(1.0, -2.0, 3.0);
    let all = [calibration.omega(raw), calibration.specific_force(raw)];
    assert!(all.iter().flatten().all(|number| number.abs() < 100.0), "{calibration:?}");
    assert!(
        calibration.gyro_matrix.try_inverse().is_some()
            && calibration.specific_force_matrix.try_inverse().is_some()
    );
}

pub(crate) fn calibrations() -> Vec<Vec<u8>> {
    let text = "[gyro]\nbias_rad_s = [0.01, -0.02, 0.003]\nmatrix = [[1.01, 0, 0], [0.002, 0.99, 0], [0, 0, 1]]\n\
                [specific_force]\nbias_m_s2 = [0.1, 0.2, -0.3]\nmatrix = [[1, 0, 0], [0, 1.0, 0], [0, 0, 1e0]]\n";
    vec![text.into(), Vec::new()]
}

pub(crate) fn mount(data: &[u8]) {
    let Ok(mount) = Mount::from_toml("fuzz.toml", text(data)) else { return };
    let rotation = mount.rot_head_imu.matrix();
    let off = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    assert!(off < 1e-9 && (rotation.determinant() - 1.0).abs() < 1e-9, "{mount:?}");
    assert!(mount.lever_arm_head.iter().all(|metres| metres.abs() <= 2.0), "{mount:?}");
    let (levelled, tilt) = mount.levelled(&Vector3::new(0.3, -0.2, 9.7));
    assert!(
        tilt.is_finite() && (levelled.rot_head_imu.matrix().determinant() - 1.0).abs() < 1e-9,
        "{levelled:?}"
    );
}

/// Parameters that are accepted stay finite over a second of turning.
pub(crate) fn observer(data: &[u8]) {
    let Ok(parameters) = toml::from_str::<ObserverParameters>(text(data)) else { return };
    let Ok(mut observer) = NewmanObserver::new(parameters) else { return };
    let still = HeadMotion { omega_head: Vector3::zeros(), gif_head: GRAVITY };
    observer.reset(GRAVITY, &still);
    for step in 0..50 {
        let omega_head = Vector3::new(0.0, 0.1, f64::from(step) * 0.06);
        let percept = observer.step(&HeadMotion { omega_head, ..still }, 0.02);
        assert!(percept.gravity_head.iter().all(|number| number.is_finite()), "{parameters:?}");
        assert!((percept.gravity_head.norm() - 9.81).abs() < 1e-6, "{parameters:?}");
    }
}

/// A motion that is accepted is finite from beginning to end.
pub(crate) fn motion(data: &[u8]) {
    let Ok(motion) = MotionSettings::from_toml(text(data)) else { return };
    // Each pose takes a search; what many poses have beside few is time.
    if motion.poses.len() > 6 {
        return;
    }
    let model = CharacterModel::standing().expect("it is built in");
    let Ok(trajectory) = Trajectory::new(&model, &PoseSettings::default(), &motion) else { return };
    assert!(trajectory.first_pose().is_finite() && trajectory.duration_s().is_finite());
    for tenth in 0..=10 {
        let reference = trajectory.at(trajectory.duration_s() * f64::from(tenth) / 10.0);
        assert!(!format!("{reference:?}").contains("NaN"), "{reference:?}");
    }
}

pub(crate) fn character(data: &[u8]) {
    let Ok(model) = CharacterModel::from_mjcf(text(data), "fuzz.xml") else { return };
    assert!(model.mass() > 0.0 && model.mass().is_finite());
}
