//! A simulated sensor on a simulated head on a simulated chair, from its pose alone.
//!
//! Nothing of the estimator's formulas is used: the pose in space is written down as a function of time, the rate is the
//! difference of two attitudes, the acceleration the second difference of three positions. Centripetal, tangential and
//! gravity terms come out by themselves.

use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};

use crate::device::Noise;
use crate::survey::Sample;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// Step of the differences, s.
const STEP_S: f64 = 2e-4;

/// Everything that is true about one simulated calibration.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub(super) rot_head_imu: Rotation3<f64>,
    pub(super) gyro_bias: Vector3<f64>,
    /// Reading over truth.
    pub(super) gyro_gain: f64,
    pub(super) gyro_noise: f64,
    pub(super) force_bias: Vector3<f64>,
    pub(super) force_gain: f64,
    pub(super) force_noise: f64,
    /// From the axis to the sensor in head axes while nobody nods, m.
    pub(super) sensor_head: Vector3<f64>,
    /// The neck, about which nods go, head axes, m.
    pub(super) neck_head: Vector3<f64>,
    /// Attitude of the chair's axes at angle zero in space.
    pub(super) lean: Rotation3<f64>,
    pub(super) rate_hz: f64,
    /// Plateau rate, rad/s.
    pub(super) rate: f64,
    /// Angle of the whole spin, rad, same sign as `rate`.
    pub(super) turned: f64,
    pub(super) nods: usize,
    pub(super) shakes: usize,
    /// Unwanted yaw while nodding: amplitude (rad) and two phases.
    pub(super) wobble: (f64, f64, f64),
    pub(super) first_rest_s: f64,
    pub(super) last_rest_s: f64,
}

const NOD: f64 = 30.0 * RAD_PER_DEG;
const NOD_S: f64 = 2.0;
const MIDDLE_REST_S: f64 = 3.0;
const RAMP_S: f64 = 2.0;

impl Truth {
    /// A sensor drawn at random.
    pub(super) fn random(seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let mut normal = |rms: f64| Vector3::from_fn(|_, _| rms * noise.normal());
        let (attitude, gyro_bias, force_bias) = (normal(1.0), normal(0.01), normal(0.05));
        let mut between = |low: f64, high: f64| low + (high - low) * noise.uniform();
        let quaternion = nalgebra::Quaternion::new(between(-1.0, 1.0), attitude.x, attitude.y, attitude.z);
        let sense = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let side = Unit::new_normalize(Vector3::new(between(-1.0, 1.0), between(-1.0, 1.0), 0.0));
        Self {
            rot_head_imu: UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix(),
            gyro_bias,
            gyro_gain: between(0.98, 1.02),
            gyro_noise: 0.002,
            force_bias,
            force_gain: between(0.99, 1.01),
            force_noise: 0.03,
            sensor_head: Vector3::new(between(-0.3, 0.3), between(-0.3, 0.3), 0.1),
            neck_head: Vector3::new(between(-0.05, 0.05), 0.0, -0.15),
            lean: Rotation3::from_axis_angle(&side, between(0.2, 1.5) * RAD_PER_DEG),
            rate_hz: 200.0,
            rate: sense * between(30.0, 120.0) * RAD_PER_DEG,
            turned: sense * 3.0 * core::f64::consts::TAU,
            nods: 3,
            shakes: 0,
            wobble: (0.15 * RAD_PER_DEG, between(0.0, 6.0), between(0.0, 6.0)),
            first_rest_s: 4.0,
            last_rest_s: 3.0,
        }
    }

    fn nods_end_s(&self) -> f64 {
        self.first_rest_s + NOD_S * self.nods as f64
    }

    fn shakes_end_s(&self) -> f64 {
        let rest_s = if self.shakes > 0 && self.nods > 0 { MIDDLE_REST_S } else { 0.0 };
        self.nods_end_s() + rest_s + NOD_S * self.shakes as f64
    }

    /// When the spin begins, s.
    pub(super) fn spin_start_s(&self) -> f64 {
        self.shakes_end_s() + if self.nods + self.shakes > 0 { MIDDLE_REST_S } else { 0.0 }
    }

    /// How long the spin takes with its ramps, s; zero without a spin.
    fn spin_s(&self) -> f64 {
        if self.turned == 0.0 { 0.0 } else { self.turned / self.rate + RAMP_S }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.spin_start_s() + self.spin_s() + self.last_rest_s
    }

    /// Angle of the chair: the rate rises and falls by half a cosine.
    fn chair_angle(&self, t: f64) -> f64 {
        let rise = |s: f64| {
            let s = s.clamp(0.0, RAMP_S);
            0.5 * (s - RAMP_S / core::f64::consts::PI * libm::sin(core::f64::consts::PI * s / RAMP_S))
        };
        let s = (t - self.spin_start_s()).clamp(0.0, self.spin_s());
        let steady = (s - RAMP_S).clamp(0.0, (self.spin_s() - 2.0 * RAMP_S).max(0.0));
        let fall_s = (s - (self.spin_s() - RAMP_S)).clamp(0.0, RAMP_S);
        self.rate * (rise(s) + steady + fall_s - rise(fall_s))
    }

    /// Attitude of the head on the chair.
    fn head_on_chair(&self, t: f64) -> Rotation3<f64> {
        // Rises from 0 to 1 and returns, once per nod, with no jerk at the ends.
        let hump = |s: f64, count: usize| {
            let end = NOD_S * count as f64;
            if (0.0..=end).contains(&s) {
                0.5 * (1.0 - libm::cos(core::f64::consts::TAU * s / NOD_S))
            } else {
                0.0
            }
        };
        let nod_s = t - self.first_rest_s;
        let shake_s = t - (self.shakes_end_s() - NOD_S * self.shakes as f64);
        let (amplitude, one, other) = self.wobble;
        let nodding = hump(nod_s, self.nods);
        // Once in neutral, and dying out towards the ends of each nod.
        let yaw = amplitude * nodding * (libm::sin(2.9 * t + one) + libm::sin(4.7 * t + other));
        let shake = 40.0 * RAD_PER_DEG * hump(shake_s, self.shakes);
        Rotation3::from_axis_angle(&Vector3::z_axis(), yaw + shake)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), NOD * nodding)
    }

    /// Attitude (sensor to space) and position of the sensor.
    fn pose(&self, t: f64) -> (Rotation3<f64>, Vector3<f64>) {
        let chair = self.lean * Rotation3::from_axis_angle(&Vector3::z_axis(), self.chair_angle(t));
        let head = self.head_on_chair(t);
        let place = self.neck_head + head * (self.sensor_head - self.neck_head);
        (chair * head * self.rot_head_imu, chair * place)
    }

    /// True rate and specific force in sensor axes.
    pub(super) fn motion(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [(before, from), (now, at), (after, to)] = [-STEP_S, 0.0, STEP_S].map(|d| self.pose(t + d));
        let omega = small_turn(&(before.inverse() * after)) / (2.0 * STEP_S);
        let accel = (to - 2.0 * at + from) / (STEP_S * STEP_S);
        (omega, now.inverse() * (accel + Vector3::new(0.0, 0.0, STANDARD_GRAVITY)))
    }

    /// What the sensor reads at one moment without noise.
    pub(super) fn reading(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (omega, force) = self.motion(t);
        (self.gyro_gain * omega + self.gyro_bias, self.force_gain * force + self.force_bias)
    }

    /// The whole recording.
    pub(super) fn samples(&self, seed: u64) -> Vec<Sample> {
        let mut noise = Noise::new(seed ^ 0x5eed);
        let count = (self.duration_s() * self.rate_hz) as usize;
        let sample = |index: usize| {
            let time_s = index as f64 / self.rate_hz;
            let (omega, force) = self.reading(time_s);
            let mut noisy = |value: Vector3<f64>, rms: f64| value.map(|v| v + rms * noise.normal());
            Sample {
                time_s,
                omega_imu: noisy(omega, self.gyro_noise),
                specific_force_imu: Some(noisy(force, self.force_noise)),
                clipped: false,
            }
        };
        (0..count).map(sample).collect()
    }
}

/// The rotation vector of a small rotation: half of what is skew in it.
pub(super) fn small_turn(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let skew = rotation.matrix() - rotation.matrix().transpose();
    0.5 * Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)])
}

#[test]
fn the_bench_turns_as_far_as_it_says_and_feels_what_a_body_on_a_circle_feels() {
    let truth = Truth { lean: Rotation3::identity(), ..Truth::random(1) };
    assert!((truth.chair_angle(truth.duration_s()) - truth.turned).abs() < 1e-12);
    let middle_s = truth.spin_start_s() + 0.5 * truth.spin_s();
    let (omega, force) = truth.motion(middle_s);
    let (omega, force) = (truth.rot_head_imu * omega, truth.rot_head_imu * force);
    assert!((omega - Vector3::z() * truth.rate).norm() < 1e-6, "{omega}");
    let inwards = -truth.rate * truth.rate * Vector3::new(truth.sensor_head.x, truth.sensor_head.y, 0.0);
    assert!((force - Vector3::z() * STANDARD_GRAVITY - inwards).norm() < 1e-5, "{force}");
    // A nod begins nose down: forward sinks, so that the specific force leaves backwards along x.
    let (_, force) = truth.motion(truth.first_rest_s + 0.5 * NOD_S);
    assert!((truth.rot_head_imu * force).x < -3.0);
}
