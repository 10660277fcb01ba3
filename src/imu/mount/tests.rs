use nalgebra::Unit;
use proptest::prelude::*;

use super::*;

fn rotation(axis: [f64; 3], angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::from(axis)), angle)
}

fn still(specific_force: Vector3<f64>, omega: Vector3<f64>) -> ImuSample {
    ImuSample { at: HostTime(0), omega_imu: omega, specific_force_imu: specific_force }
}

#[test]
fn named_axes_quaternion_and_matrix_agree() {
    // x forward, z down: half a turn about x.
    let expected = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    for text in [
        "axes = { forward = \"x\", up = \"-z\" }",
        "quaternion = [0.0, 1.0, 0.0, 0.0]",
        "matrix = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]",
    ] {
        let mount = Mount::from_toml("m.toml", text).unwrap();
        assert!((mount.rot_head_imu.matrix() - expected).amax() < 1e-15, "{text}");
    }
    // The sensor's y points forward and its x up: what it measures along y the head feels along x.
    let mount = Mount::from_toml("m.toml", "axes = { forward = \"+y\", up = \"x\" }").unwrap();
    assert_eq!(mount.rot_head_imu * Vector3::new(3.0, 1.0, 2.0), Vector3::new(1.0, 2.0, 3.0));
}

#[test]
fn shipped_mounts_load() {
    for name in ["level", "upside-down"] {
        let path = format!("{}/configs/mounts/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let mount = Mount::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap();
        assert!((mount.rot_head_imu.matrix().determinant() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn bad_mounts_are_refused_with_file_key_and_determinant() {
    for (text, said) in [
        (
            "matrix = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]",
            "m.toml: matrix is mirrored: its determinant is -1.000000, a rotation has +1\n\nhint: ",
        ),
        (
            "matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.001], [0.0, 0.0, 1.0]]",
            "m.toml: matrix is no rotation: its columns are off orthonormal by 1.0e-3 (determinant +1.000000)",
        ),
        (
            "quaternion = [0.0, 0.0, 0.0, 0.0]",
            "m.toml: norm of quaternion is 0, allowed is 0.999 to 1.001\n\nhint: ",
        ),
        (
            "axes = { forward = \"-x\", up = \"x\" }",
            "m.toml: axes.forward = \"-x\" and axes.up = \"x\" lie on one line",
        ),
        ("", "m.toml: exactly one of matrix, quaternion and axes is needed, 0 given\n\nhint: "),
        (
            "axes = { forward = \"x\", up = \"z\" }\nlever_arm_m = [0.0, 0.0, 90.0]",
            "m.toml: lever_arm_m (z) is 90, allowed is -2 to 2 m\n\nhint: ",
        ),
    ] {
        let error = Mount::from_toml("m.toml", text).unwrap_err().to_string();
        assert!(error.starts_with(said), "{error}");
    }
    let error = Mount::from_toml("m.toml", "axes = { forward = \"w\", up = \"z\" }").unwrap_err().to_string();
    assert!(error.starts_with("m.toml: ") && error.contains("unknown variant `w`"), "{error}");
    assert!(error.contains("\n\nhint: "), "{error}");
}

#[test]
fn a_matrix_with_seven_digits_becomes_a_rotation() {
    let exact = rotation([1.0, 2.0, 3.0], 0.7);
    let rows: Vec<String> = exact
        .matrix()
        .row_iter()
        .map(|row| format!("[{:.7}, {:.7}, {:.7}]", row[0], row[1], row[2]))
        .collect();
    let mount = Mount::from_toml("m.toml", &format!("matrix = [{}]", rows.join(", "))).unwrap();
    let gram = mount.rot_head_imu.matrix().transpose() * mount.rot_head_imu.matrix();
    assert!((gram - Matrix3::identity()).amax() < 1e-12);
    assert!((mount.rot_head_imu.matrix() - exact.matrix()).amax() < 1e-7);
}

proptest! {
    #[test]
    fn levelling_points_rest_up_by_the_smallest_turn(
        axis in prop::array::uniform3(-1.0..1.0_f64), angle in 0.0..3.1_f64,
        x in -9.0..9.0_f64, y in -9.0..9.0_f64, z in -9.0..9.0_f64,
    ) {
        prop_assume!(Vector3::from(axis).norm() > 0.1 && Vector3::new(x, y, z).norm() > 0.1);
        let mount = Mount { rot_head_imu: rotation(axis, angle), ..Mount::default() };
        let force = Vector3::new(x, y, z);
        let (levelled, tilt) = mount.levelled(&force);
        let up = levelled.rot_head_imu * force.normalize();
        prop_assert!((up - Vector3::z()).norm() < 1e-7, "{up}");
        let turn = levelled.rot_head_imu * mount.rot_head_imu.inverse();
        prop_assert!((turn.angle() - tilt).abs() < 1e-6);
        // The smallest turn has a horizontal axis: its matrix is symmetric in x and y.
        prop_assert!((turn.matrix()[(0, 1)] - turn.matrix()[(1, 0)]).abs() < 1e-7);
    }
}

#[test]
fn levelling_an_upside_down_sensor_keeps_forward() {
    let (levelled, tilt) = Mount::default().levelled(&Vector3::new(0.0, 0.0, -9.81));
    assert!((tilt - core::f64::consts::PI).abs() < 1e-12);
    assert_eq!(levelled.rot_head_imu * Vector3::x(), Vector3::x());
    assert_eq!(levelled.rot_head_imu * -Vector3::z(), Vector3::z());
    assert_eq!(Mount::default().levelled(&Vector3::zeros()), (Mount::default(), 0.0));
}

#[test]
fn a_steady_turn_adds_the_centripetal_term() {
    // 0.1 m off the axis at 30 rpm: spec observer.md section 4 speaks of 5.75 degrees of GIF error.
    let omega = Vector3::new(0.0, 0.0, 30.0 * crate::units::RAD_S_PER_RPM);
    let mount = Mount { lever_arm_head: Vector3::new(-0.1, 0.0, 0.0), ..Mount::default() };
    // The sensor 0.1 m ahead of the axis feels -omega² 0.1 along x; the head point on the axis feels gravity alone.
    let force = Vector3::new(-omega.z * omega.z * 0.1, 0.0, 9.81);
    let head = mount.to_head(&still(force, omega), &mut OmegaDerivative::default());
    assert!((head.motion.gif_head - Vector3::new(0.0, 0.0, -9.81)).norm() < 1e-12);
    assert_eq!(head.motion.omega_head, omega);
    let error_deg = libm::atan2(-force.x, force.z) * crate::units::DEG_PER_RAD;
    assert!((error_deg - 5.75).abs() < 0.02, "{error_deg}");
}

#[test]
fn spinning_up_adds_the_euler_term_for_long_arms_only() {
    // A ramp of 2 rad/s²; the arm along y, so the term is (-2 r, 0, 0), and r is small enough for omega² r to vanish.
    let head_force_x = |arm: f64| {
        let mount = Mount { lever_arm_head: Vector3::new(0.0, arm, 0.0), ..Mount::default() };
        let mut derivative = OmegaDerivative::default();
        let mut last = 0.0;
        for step in 0..200_u64 {
            let sample = ImuSample {
                at: HostTime(step * 5_000_000),
                omega_imu: Vector3::new(0.0, 0.0, 2.0 * step as f64 * 5e-3),
                specific_force_imu: Vector3::zeros(),
            };
            last = -mount.to_head(&sample, &mut derivative).motion.gif_head.x;
        }
        last
    };
    assert!((head_force_x(0.1) - -0.2).abs() < 1e-9);
    assert_eq!(head_force_x(0.049), 0.0);
}

#[test]
fn the_derivative_ignores_pauses_and_repeated_times() {
    let mut derivative = OmegaDerivative::default();
    let at = |ms: u64| HostTime(ms * 1_000_000);
    assert_eq!(derivative.push(at(0), Vector3::zeros()), Vector3::zeros());
    let ramp = derivative.push(at(10), Vector3::x());
    // (1 - 0) / (10.6 ms + 10 ms).
    assert!((ramp.x - 1.0 / (0.01 + 0.5 / (core::f64::consts::PI * 15.0))).abs() < 1e-9);
    assert_eq!(derivative.push(at(10), Vector3::y()), ramp);
    assert_eq!(derivative.push(at(300), Vector3::x() * 5.0), Vector3::zeros());
}
