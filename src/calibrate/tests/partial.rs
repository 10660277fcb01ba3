//! Which part is refused when a motion is missing, what is given all the same, and what the files hold.

use nalgebra::{Rotation3, Vector3};

use super::bench::Truth;
use super::coverage::settings;
use crate::calibrate::{
    CalibrateSettings, CountedTurn, Findings, Guide, Step, Up, calibrate, calibration_toml, mount_toml,
};
use crate::imu::{Calibration, Mount};
use crate::survey::Sample;
use crate::units::{DEG_PER_RAD, RAD_PER_DEG, STANDARD_GRAVITY};

fn found(truth: &Truth, settings: &CalibrateSettings) -> Findings {
    calibrate(&truth.samples(1), settings)
}

/// Names of what was refused and needed.
fn needed(found: &Findings) -> Vec<&'static str> {
    found.refusals.iter().filter(|refusal| refusal.needed).map(|refusal| refusal.what).collect()
}

/// Angle between the mount found and the true one, deg.
fn error_deg(found: &Findings, truth: &Truth) -> f64 {
    let rows = found.mount.unwrap().matrix;
    let rotation = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_fn(|i, j| rows[i][j]));
    2.0 * libm::asin(0.125_f64.sqrt() * (rotation.matrix() - truth.rot_head_imu.matrix()).norm())
        * DEG_PER_RAD
}

#[test]
fn without_a_nod_only_the_heading_is_refused() {
    let truth = Truth { nods: 0, ..Truth::random(3) };
    let found = found(&truth, &settings(None));
    assert_eq!(needed(&found), ["heading"]);
    assert!(found.refusals[0].why.contains("parallel") && found.refusals[0].hint.contains("forward first"));
    assert!(found.mount.is_none() && found.heading.is_none());
    assert!(found.gyro_bias_rad_s.is_some() && found.gravity.is_some() && found.spin_axis.is_some());
    // The arm is known in the sensor's axes; the chair's are not.
    let arm = found.lever_arm.unwrap();
    assert!(arm.written && arm.sensor_from_axis_head_m.is_none());
    assert!(found.gyro_scale.is_none(), "nothing was counted");
}

#[test]
fn a_heading_that_is_given_takes_the_place_of_the_nod() {
    let rot_head_imu = Rotation3::from_euler_angles(0.05, -0.04, 0.0);
    let truth = Truth { nods: 0, rot_head_imu, ..Truth::random(4) };
    let given = CalibrateSettings { forward_imu: Some(Vector3::x()), ..settings(None) };
    let result = found(&truth, &given);
    assert_eq!(needed(&result), [""; 0]);
    assert!(error_deg(&result, &truth) < 0.2, "{}", error_deg(&result, &truth));
    assert_eq!(result.mount.unwrap().sigma_deg[2], 0.0);
    assert_eq!(result.heading.unwrap().sigma_deg, None);
    let upwards = CalibrateSettings { forward_imu: Some(Vector3::z()), ..settings(None) };
    assert_eq!(needed(&found(&truth, &upwards)), ["heading"]);
}

#[test]
fn without_a_spin_up_must_be_asked_of_gravity_or_of_a_shake() {
    let still = Truth { turned: 0.0, force_bias: Vector3::zeros(), ..Truth::random(5) };
    let truth = Truth { lean: Rotation3::identity(), ..still };
    let by_spin = found(&truth, &settings(None));
    assert_eq!(needed(&by_spin), ["spin axis"]);
    assert!(by_spin.mount.is_none());
    let by_gravity = found(&truth, &CalibrateSettings { up: Up::Gravity, ..settings(None) });
    assert_eq!(needed(&by_gravity), [""; 0]);
    assert!(error_deg(&by_gravity, &truth) < 0.3, "{}", error_deg(&by_gravity, &truth));
    let by_shake = CalibrateSettings { up: Up::Shake, ..settings(None) };
    assert_eq!(needed(&found(&truth, &by_shake)), ["up"]);
    let shaken = Truth { shakes: 3, ..truth };
    let result = found(&shaken, &by_shake);
    assert_eq!(needed(&result), [""; 0]);
    assert!(error_deg(&result, &shaken) < 0.3, "{}", error_deg(&result, &shaken));
    let kinds: Vec<&str> = result.motions.iter().map(|motion| motion.kind).collect();
    assert_eq!(kinds, ["rest", "nod", "rest", "shake", "rest"]);
}

#[test]
fn without_rest_there_is_nothing() {
    let truth = Truth { gyro_noise: 0.1, ..Truth::random(6) };
    let result = found(&truth, &settings(Some(CountedTurn { angle: 1.0, sigma: 0.0 })));
    assert!(needed(&result).contains(&"gyro bias") && needed(&result).contains(&"gyro scale"));
    assert!(result.mount.is_none() && result.gravity.is_none());
    assert_eq!(calibration_toml(&result, "x"), None);
    let nothing = calibrate(&[], &settings(None));
    assert!(needed(&nothing).contains(&"gyro bias") && nothing.motions.is_empty());
}

#[test]
fn without_an_accelerometer_bias_and_scale_are_left() {
    let truth = Truth::random(7);
    let blind: Vec<Sample> =
        truth.samples(1).iter().map(|s| Sample { specific_force_imu: None, ..*s }).collect();
    let counted = CountedTurn { angle: truth.turned, sigma: 0.001 };
    let result = calibrate(&blind, &settings(Some(counted)));
    assert_eq!(needed(&result), ["gravity"]);
    assert!((result.gyro_scale.unwrap().scale.value * truth.gyro_gain - 1.0).abs() < 1e-3);
    assert!(result.mount.is_none() && result.lever_arm.is_none());
}

#[test]
fn a_miscounted_turn_is_not_believed() {
    let truth = Truth::random(8);
    let counted = CountedTurn { angle: truth.turned.abs() - core::f64::consts::TAU, sigma: 0.001 };
    let result = found(&truth, &settings(Some(counted)));
    assert_eq!(needed(&result), ["gyro scale"]);
    assert!(result.refusals[0].why.contains("720.0 deg were counted"), "{}", result.refusals[0].why);
}

#[test]
fn lost_and_clipped_samples_in_the_spin_forbid_the_scale() {
    let truth = Truth::random(9);
    let counted = settings(Some(CountedTurn { angle: truth.turned, sigma: 0.001 }));
    let whole = truth.samples(1);
    let in_spin = |s: &Sample| s.time_s > truth.spin_start_s() + 5.0 && s.time_s < truth.spin_start_s() + 5.5;
    let gapped: Vec<Sample> = whole.iter().copied().filter(|s| !in_spin(s)).collect();
    assert_eq!(needed(&calibrate(&gapped, &counted)), ["gyro scale"]);
    let clipped: Vec<Sample> = whole.iter().map(|s| Sample { clipped: in_spin(s), ..*s }).collect();
    assert_eq!(needed(&calibrate(&clipped, &counted)), ["gyro scale"]);
}

#[test]
fn a_gyro_of_the_wrong_sign_is_found_out_by_the_nod() {
    let truth = Truth::random(10);
    let flipped: Vec<Sample> =
        truth.samples(1).iter().map(|s| Sample { omega_imu: -s.omega_imu, ..*s }).collect();
    let result = calibrate(&flipped, &settings(None));
    assert_eq!(needed(&result), ["heading"]);
    assert!(result.refusals[0].why.contains("the other way than the gyro"), "{}", result.refusals[0].why);
}

#[test]
fn a_slow_spin_has_no_lever_arm_to_write() {
    let truth = Truth { rate: 8.0 * RAD_PER_DEG, turned: core::f64::consts::TAU, ..Truth::random(11) };
    let result = found(&truth, &settings(None));
    let arm = result.lever_arm.unwrap();
    assert!(!arm.written && arm.radius_m.sigma > 0.02, "{arm:?}");
    assert_eq!(result.mount.unwrap().lever_arm_m, None);
    assert_eq!(needed(&result), [""; 0]);
    assert!(result.refusals.iter().any(|refusal| refusal.what == "lever arm"));
}

#[test]
fn a_bias_that_drifts_is_followed_from_rest_to_rest() {
    let truth = Truth { nods: 0, ..Truth::random(12) };
    let drift = Vector3::new(1e-4, -2e-4, 3e-4);
    let drifting: Vec<Sample> =
        truth.samples(1).iter().map(|s| Sample { omega_imu: s.omega_imu + drift * s.time_s, ..*s }).collect();
    let counted = CountedTurn { angle: truth.turned, sigma: 1e-4 };
    let scale = calibrate(&drifting, &settings(Some(counted))).gyro_scale.unwrap().scale;
    assert!((scale.value * truth.gyro_gain - 1.0).abs() < 1e-3, "{}", scale.value * truth.gyro_gain);
}

#[test]
fn the_files_are_read_back_as_they_were_meant() {
    let truth = Truth::random(13);
    let counted = CountedTurn { angle: truth.turned, sigma: 0.001 };
    let found = found(&truth, &settings(Some(counted)));
    let estimate = found.mount.unwrap();
    let mount = Mount::from_toml("m", &mount_toml(&estimate, "a\nb.mcap")).unwrap();
    assert!((mount.rot_head_imu.matrix() - truth.rot_head_imu.matrix()).norm() < 0.01);
    let across = Vector3::new(truth.sensor_head.x, truth.sensor_head.y, 0.0);
    assert!((mount.lever_arm_head + across).norm() < 0.02, "{}", mount.lever_arm_head + across);

    let calibration = Calibration::from_toml("c", &calibration_toml(&found, "a\nb.mcap").unwrap()).unwrap();
    let (omega, force) = truth.motion(truth.spin_start_s() + 4.0);
    let (raw_omega, raw_force) = truth.reading(truth.spin_start_s() + 4.0);
    assert!((calibration.omega(raw_omega) - omega).norm() < 2e-3 * omega.norm());
    assert!((calibration.omega(raw_omega) - omega).norm() < 0.2 * (raw_omega - omega).norm());
    let (after, before) =
        ((calibration.specific_force(raw_force) - force).norm(), (raw_force - force).norm());
    assert!(after < 0.02 && after < 0.5 * before, "{after} m/s2 off, before {before}");
    assert!((force.norm() - STANDARD_GRAVITY).abs() < 2.0);
}

#[test]
fn the_guide_asks_for_one_motion_after_the_other() {
    let truth = Truth::random(14);
    let samples = truth.samples(1);
    let mut guide = Guide::new(&settings(None));
    assert_eq!(guide.step(), Step::Rest);
    let mut steps = Vec::new();
    for end in (0..samples.len()).step_by(20) {
        steps.extend(guide.look(&samples[..end]).map(|step| (step, samples[end.max(1) - 1].time_s)));
    }
    let order: Vec<Step> = steps.iter().map(|(step, _)| *step).collect();
    assert_eq!(order, [Step::Nod, Step::Spin, Step::LastRest, Step::Done]);
    // Not before the motion has been made, and soon after.
    assert!((3.0..4.0).contains(&steps[0].1), "{steps:?}");
    assert!(steps[1].1 > 10.0 && steps[1].1 < truth.spin_start_s(), "{steps:?}");
}

#[test]
fn a_bias_that_differs_from_rest_to_rest_is_known_as_well_as_it_stays() {
    let truth = Truth { nods: 0, ..Truth::random(15) };
    let step = Vector3::new(0.0, 0.0, 0.01);
    let middle_s = 0.5 * (truth.spin_start_s() + truth.duration_s());
    let later = |s: &Sample| if s.time_s > middle_s { step } else { Vector3::zeros() };
    let stepped: Vec<Sample> =
        truth.samples(1).iter().map(|s| Sample { omega_imu: s.omega_imu + later(s), ..*s }).collect();
    let bias = calibrate(&stepped, &settings(None)).gyro_bias_rad_s.unwrap();
    // Two rests, 0.01 rad/s apart: half of that is what their mean may be off.
    assert!((bias.sigma[2] - 0.005).abs() < 5e-4 && bias.sigma[0] < 5e-4, "{bias:?}");
}
