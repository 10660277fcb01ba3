//! Six poses of a box that holds the sensor: error bars, what is refused, and what the guide asks for.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::bench::small_turn;
use super::coverage::{Records, settings};
use crate::calibrate::{
    CalibrateSettings, CountedTurn, Findings, Guide, Step, calibrate, calibration_toml, mount_toml,
};
use crate::device::Noise;
use crate::imu::{Calibration, Mount};
use crate::survey::Sample;
use crate::units::{DEG_PER_RAD, RAD_PER_DEG, STANDARD_GRAVITY};

const RATE_HZ: f64 = 100.0;
const REST_S: f64 = 4.0;
const TURN_S: f64 = 2.0;
const ORDER: [[f64; 3]; 6] =
    [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];

/// A sensor in a box that is laid on its sides.
#[derive(Clone)]
struct Box {
    rot_head_imu: Rotation3<f64>,
    gyro_bias: Vector3<f64>,
    force_bias: Vector3<f64>,
    /// Truth over reading, less the bias.
    force_scale: Vector3<f64>,
    /// Attitudes (head to space).
    attitudes: Vec<UnitQuaternion<f64>>,
}

impl Box {
    /// A sensor that sits in the box up to `aslant` and is laid down to within `level` (standard deviations, rad), with
    /// these directions of the head up.
    fn random(seed: u64, order: &[[f64; 3]], aslant: f64, level: f64) -> Self {
        let mut noise = Noise::new(seed ^ 0xb0c5);
        let mut normal = |rms: f64| Vector3::from_fn(|_, _| rms * noise.normal());
        let rot_head_imu = Rotation3::from_scaled_axis(normal(aslant))
            * Rotation3::from_euler_angles(core::f64::consts::FRAC_PI_2, 0.0, core::f64::consts::PI);
        let attitudes = order.iter().map(|up| {
            let up = Vector3::from(*up);
            let upright = UnitQuaternion::rotation_between(&up, &Vector3::z())
                .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * core::f64::consts::PI));
            let yaw = UnitQuaternion::from_scaled_axis(Vector3::z() * normal(1.0).x);
            yaw * UnitQuaternion::from_scaled_axis(normal(level).component_mul(&Vector3::new(1.0, 1.0, 0.0)))
                * upright
        });
        let attitudes = attitudes.collect();
        Self {
            rot_head_imu,
            gyro_bias: normal(0.01),
            force_bias: normal(0.15),
            force_scale: normal(0.01).add_scalar(1.0),
            attitudes,
        }
    }

    /// Attitude of the head; it turns from pose to pose without a jerk.
    fn attitude(&self, time_s: f64) -> UnitQuaternion<f64> {
        let last = self.attitudes.len() - 1;
        let index = ((time_s / (REST_S + TURN_S)) as usize).min(last);
        let share = ((time_s - index as f64 * (REST_S + TURN_S) - REST_S) / TURN_S).clamp(0.0, 1.0);
        let eased = 0.5 * (1.0 - libm::cos(core::f64::consts::PI * share));
        let (from, to) = (self.attitudes[index], self.attitudes[(index + 1).min(last)]);
        from.try_slerp(&to, eased, 1e-9).unwrap_or(to)
    }

    fn samples(&self, seed: u64) -> Vec<Sample> {
        let mut noise = Noise::new(seed);
        let duration_s = self.attitudes.len() as f64 * (REST_S + TURN_S) - TURN_S;
        let step_s = 1e-3;
        let sample = |index: usize| {
            let time_s = index as f64 / RATE_HZ;
            let [before, now, after] = [-step_s, 0.0, step_s]
                .map(|d| self.attitude(time_s + d).to_rotation_matrix() * self.rot_head_imu);
            let omega = small_turn(&(before.inverse() * after)) / (2.0 * step_s);
            let force = now.inverse() * Vector3::new(0.0, 0.0, STANDARD_GRAVITY);
            let mut noisy = |value: Vector3<f64>, rms: f64| value.map(|v| v + rms * noise.normal());
            Sample {
                time_s,
                omega_imu: noisy(omega + self.gyro_bias, 0.002),
                specific_force_imu: Some(noisy(
                    force.component_div(&self.force_scale) + self.force_bias,
                    0.03,
                )),
                clipped: false,
            }
        };
        (0..(duration_s * RATE_HZ) as usize).map(sample).collect()
    }
}

fn posed(named: &[[f64; 3]]) -> CalibrateSettings {
    CalibrateSettings { poses: Some(named.iter().map(|up| Vector3::from(*up)).collect()), ..settings(None) }
}

fn mount_error(found: &Findings, truth: &Box) -> Vector3<f64> {
    let rows = found.mount.unwrap().matrix;
    let found = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| rows[i][j]));
    small_turn(&(found * truth.rot_head_imu.inverse())) * DEG_PER_RAD
}

fn refused(found: &Findings) -> Vec<(&'static str, &str)> {
    found.refusals.iter().map(|refusal| (refusal.what, refusal.why.as_str())).collect()
}

#[test]
fn error_bars_of_six_poses_hold_the_truth_and_are_not_wide() {
    let mut records = Records::default();
    for seed in 0..super::coverage::SEEDS {
        let truth = Box::random(seed, &ORDER, 0.1, 0.3 * RAD_PER_DEG);
        let found = calibrate(&truth.samples(seed), &posed(&ORDER));
        assert_eq!(refused(&found), [], "seed {seed}");
        let known = found.accelerometer.unwrap();
        assert!(!known.common_scale && known.poses == 6 && known.residual_m_s2.is_none());
        records.add_vector("bias", &known.bias_m_s2, &truth.force_bias);
        records.add_vector("scale", &known.scale, &truth.force_scale);
        let error = mount_error(&found, &truth);
        for (i, name) in ["mount about x", "mount about y", "mount about z"].into_iter().enumerate() {
            records.add(name, error[i], found.mount.unwrap().sigma_deg[i]);
        }
        assert!(error.norm() < 1.0, "seed {seed}: {error}");
    }
    records.check(9, 3.0);
}

#[test]
fn ten_poses_leave_something_to_check_with() {
    // Four more, aslant.
    let more = [[0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [-0.8, 0.6, 0.0], [0.0, 0.8, -0.6]];
    let truth = Box::random(1, &[&ORDER[..], &more].concat(), 0.1, 0.01);
    let found = calibrate(&truth.samples(1), &posed(&[]));
    let known = found.accelerometer.unwrap();
    assert_eq!(known.poses, 10);
    assert!(known.residual_m_s2.unwrap() < 0.01, "{known:?}");
    assert!((Vector3::from(known.bias_m_s2.value) - truth.force_bias).norm() < 0.01);
    assert!(found.mount.is_none() && found.refusals.is_empty(), "nothing was named, nothing is missing");
}

#[test]
fn a_sensor_that_lies_aslant_gets_one_factor_and_is_told_so() {
    let mut truth = Box::random(2, &ORDER, 0.0, 0.001);
    truth.rot_head_imu = Rotation3::from_euler_angles(0.0, 0.0, 45.0 * RAD_PER_DEG);
    truth.force_scale = Vector3::repeat(1.01);
    let found = calibrate(&truth.samples(2), &posed(&ORDER));
    let known = found.accelerometer.unwrap();
    assert!(known.common_scale && found.notes.iter().any(|note| note.contains("x, -x, y, -y")), "{found:?}");
    assert!((Vector3::from(known.bias_m_s2.value) - truth.force_bias).norm() < 0.02, "{known:?}");
    assert!((known.scale.value[0] - 1.01).abs() < 1e-3 && known.scale.value[0] == known.scale.value[2]);
    assert!(mount_error(&found, &truth).norm() < 0.3);
}

#[test]
fn missing_poses_are_named() {
    // The sensor's z is the head's y, its y is the head's -z, its x the head's -x.
    let truth = Box::random(3, &ORDER[..4], 0.02, 0.001);
    let found = calibrate(&truth.samples(3), &posed(&ORDER));
    let [(accelerometer, why), (mount, count)] = refused(&found)[..] else { panic!("{:?}", refused(&found)) };
    assert_eq!((accelerometer, mount), ("accelerometer bias and scale", "mount"));
    assert!(why.contains("4 poses") && why.ends_with("missing: z, -z"), "{why}");
    assert!(count.contains("6 poses were named and 4"), "{count}");
    assert!(found.accelerometer.is_none() && found.mount.is_none() && found.gyro_bias_rad_s.is_some());
    // The mounting needs no more than two of them.
    let found = calibrate(&truth.samples(3), &posed(&ORDER[..4]));
    assert_eq!(refused(&found).len(), 1);
    assert!(mount_error(&found, &truth).norm() < 2.0, "{}", mount_error(&found, &truth));
    let upright = Box { attitudes: truth.attitudes[..2].to_vec(), ..truth };
    let found = calibrate(&upright.samples(3), &posed(&ORDER[..2]));
    assert!(refused(&found)[1].1.contains("same axis up"), "{:?}", refused(&found));
}

#[test]
fn a_counted_turn_after_the_poses_gives_the_gyro_scale_and_its_rest_is_no_pose_too_many() {
    let truth = Box::random(8, &[&ORDER[..], &ORDER[..1]].concat(), 0.05, 0.005);
    // Two turns upright after the last pose: on top of the attitude, so that sensor and bias stay what they are.
    let upright = truth.attitudes[6];
    let end_s = 7.0 * (REST_S + TURN_S) - TURN_S;
    let mut samples = truth.samples(8);
    let up = (upright.to_rotation_matrix() * truth.rot_head_imu).inverse() * Vector3::z();
    let mut noise = Noise::new(9);
    let (rate, ramp_s, turned) = (1.5, 1.0, 2.0 * core::f64::consts::TAU);
    let spin_s = turned / rate + ramp_s;
    let rest = *samples.last().unwrap();
    let force = rest.specific_force_imu.unwrap();
    for index in 0..((spin_s + REST_S) * RATE_HZ) as usize {
        let s = index as f64 / RATE_HZ;
        let share = (s / ramp_s).min((spin_s - s) / ramp_s).clamp(0.0, 1.0);
        let mut noisy = |value: Vector3<f64>, rms: f64| value.map(|v| v + rms * noise.normal());
        samples.push(Sample {
            time_s: end_s + s,
            omega_imu: noisy(0.98 * up * rate * share + truth.gyro_bias, 0.002),
            specific_force_imu: Some(noisy(force, 0.03)),
            clipped: false,
        });
    }
    let counted = CountedTurn { angle: turned, sigma: 0.002 };
    let settings = CalibrateSettings { counted: Some(counted), ..posed(&ORDER) };
    let found = calibrate(&samples, &settings);
    assert!(refused(&found).iter().all(|(what, _)| *what == "lever arm"), "{:?}", refused(&found));
    assert!((found.gyro_scale.unwrap().scale.value * 0.98 - 1.0).abs() < 2e-3, "{:?}", found.gyro_scale);
    assert!(mount_error(&found, &truth).norm() < 1.0);
    assert!(!found.notes.iter().any(|note| note.contains("several spins")), "{:?}", found.notes);
    // Asked for nothing to count, that last pose is one too many.
    assert_eq!(refused(&calibrate(&samples, &posed(&ORDER)))[0].0, "mount");
}

#[test]
fn a_wrong_order_is_found_out() {
    let truth = Box::random(4, &ORDER, 0.05, 0.01);
    let mut swapped = ORDER;
    swapped.swap(3, 5);
    let found = calibrate(&truth.samples(4), &posed(&swapped));
    let [(what, why)] = refused(&found)[..] else { panic!("{:?}", refused(&found)) };
    assert!(what == "mount" && why.contains("the order is another one"), "{why}");
    assert!(found.accelerometer.is_some(), "that needs no names");
    // A left-handed sensor fits no rotation.
    let mirrored: Vec<Sample> = truth
        .samples(4)
        .iter()
        .map(|s| Sample {
            specific_force_imu: s.specific_force_imu.map(|f| Vector3::new(-f.x, f.y, f.z)),
            ..*s
        })
        .collect();
    assert_eq!(refused(&calibrate(&mirrored, &posed(&ORDER))).len(), 1);
}

#[test]
fn without_an_accelerometer_poses_say_so() {
    let truth = Box::random(5, &ORDER, 0.05, 0.01);
    let blind: Vec<Sample> =
        truth.samples(5).iter().map(|s| Sample { specific_force_imu: None, ..*s }).collect();
    let found = calibrate(&blind, &posed(&[]));
    assert!(refused(&found)[0].1.contains("no accelerometer"), "{:?}", refused(&found));
}

#[test]
fn the_guide_asks_for_one_side_after_the_other() {
    let truth = Box::random(6, &ORDER, 0.05, 0.01);
    let samples = truth.samples(6);
    for named in [&ORDER[..], &[]] {
        let mut guide = Guide::new(&posed(named));
        let first =
            if named.is_empty() { "pose 1: turn any side up" } else { "pose 1 of 6: turn the head's top up" };
        assert!(guide.prompt().starts_with(first), "{}", guide.prompt());
        let (mut steps, mut prompts) = (Vec::new(), Vec::new());
        for end in (0..samples.len()).step_by(20) {
            if let Some(step) = guide.look(&samples[..end]) {
                steps.push(step);
                prompts.push(guide.prompt());
            }
        }
        let poses: Vec<Step> = (1..6).map(Step::Pose).collect();
        assert_eq!(steps, [&poses[..], &[Step::Done]].concat());
        let part = if named.is_empty() {
            "sensor axes to come: z, -z"
        } else {
            "5 of 6: turn the head's left side up"
        };
        assert!(prompts[3].contains(part), "{prompts:?}");
    }
}

#[test]
fn the_files_of_six_poses_are_read_back() {
    let truth = Box::random(7, &ORDER, 0.1, 0.002);
    let found = calibrate(&truth.samples(7), &posed(&ORDER));
    let calibration = Calibration::from_toml("c", &calibration_toml(&found, "x").unwrap()).unwrap();
    let force = Vector3::new(3.0, -4.0, 8.0);
    let read = calibration.specific_force(force.component_div(&truth.force_scale) + truth.force_bias);
    assert!((read - force).norm() < 0.01, "{read}");
    let mount = Mount::from_toml("m", &mount_toml(&found.mount.unwrap(), "x")).unwrap();
    assert!((mount.rot_head_imu.matrix() - truth.rot_head_imu.matrix()).norm() < 0.01);
}
