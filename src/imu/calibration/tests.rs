use super::*;
use crate::time::HostTime;

fn sample(omega: [f64; 3], force: [f64; 3]) -> ImuSample {
    ImuSample { at: HostTime(0), omega_imu: omega.into(), specific_force_imu: force.into() }
}

#[test]
fn a_file_removes_bias_scale_and_misalignment() {
    let text = "
        [gyro]
        bias_rad_s = [0.1, 0.0, -0.1]
        matrix = [[1.0, 0.02, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 0.9]]
        [specific_force]
        bias_m_s2 = [0.0, 0.0, 0.5]
    ";
    let calibration = Calibration::from_toml("imu7.toml", text).unwrap();
    let omega = calibration.omega(Vector3::new(1.1, 2.0, 0.9));
    assert!((omega - Vector3::new(1.04, 2.2, 0.9)).norm() < 1e-12, "{omega}");
    assert_eq!(calibration.specific_force(Vector3::new(1.0, 2.0, 10.5)), Vector3::new(1.0, 2.0, 10.0));
    assert_eq!(Calibration::from_toml("empty", "").unwrap(), Calibration::default());
}

#[test]
fn impossible_values_name_file_key_and_range() {
    for (text, said) in [
        (
            "[gyro]\nbias_rad_s = [0.0, 2.0, 0.0]",
            "c.toml: gyro.bias_rad_s (y) is 2, allowed is -1 to 1 rad/s",
        ),
        (
            "[specific_force]\nmatrix = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]",
            "c.toml: determinant of specific_force.matrix is 0, allowed is 0.2 to 5",
        ),
        (
            "[gyro]\nmatrix = [[nan, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
            "c.toml: gyro.matrix[0][0] is NaN, allowed is -2 to 2",
        ),
    ] {
        let error = Calibration::from_toml("c.toml", text).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{said}\n\nhint: ")), "{error}");
    }
    let error = Calibration::from_toml("c.toml", "[gyroscope]").unwrap_err().to_string();
    assert!(
        error.contains("c.toml: ") && error.contains("gyroscope") && error.contains("\nhint: "),
        "{error}"
    );
}

#[test]
fn the_detector_knows_mean_and_scatter() {
    let mut detector = RestDetector::default();
    for step in 0..100 {
        let noise = if step % 2 == 0 { 0.01 } else { -0.01 };
        detector.push(&sample([0.02 + noise, 0.0, -0.01], [0.1, 0.0, 9.8 + noise]), true);
    }
    assert!((detector.mean_omega() - Vector3::new(0.02, 0.0, -0.01)).norm() < 1e-12);
    assert!((detector.mean_specific_force().unwrap() - Vector3::new(0.1, 0.0, 9.8)).norm() < 1e-12);
    assert!((detector.gyro_std() - 0.01).abs() < 1e-12);
    assert!((detector.specific_force_std() - 0.01).abs() < 1e-12);
    assert!(detector.is_at_rest(&RestLimits::default()));
}

#[test]
fn steady_rotation_shaking_and_short_windows_are_not_rest() {
    let judge = |omega: fn(usize) -> f64, force: fn(usize) -> f64, count: usize| {
        let mut detector = RestDetector::default();
        (0..count).for_each(|k| detector.push(&sample([0.0, 0.0, omega(k)], [force(k), 0.0, 9.81]), true));
        detector.is_at_rest(&RestLimits::default())
    };
    assert!(judge(|_| 0.05, |_| 0.0, 100));
    assert!(!judge(|_| 0.07, |_| 0.0, 100), "steady turn");
    assert!(!judge(|k| if k % 2 == 0 { 0.03 } else { -0.03 }, |_| 0.0, 100), "rocking");
    assert!(!judge(|_| 0.0, |k| if k % 2 == 0 { 0.4 } else { -0.4 }, 100), "shaking");
    assert!(!judge(|_| 0.0, |_| 0.0, MIN_REST_SAMPLES as usize - 1), "too few");
}
