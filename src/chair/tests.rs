//! The report on a chair whose truth is known.

use core::f64::consts::TAU;

use nalgebra::{Rotation3, Vector3};

use super::{ChairReport, ChairSettings, Commanded, survey_chair};
use crate::device::Noise;
use crate::imu::RestLimits;
use crate::survey::Sample;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// A chair that turns to the left at 60 deg/s with everything a chair can have.
#[derive(Clone, Copy)]
struct Chair {
    rest_s: f64,
    ramp_s: f64,
    /// Share of the rate, dying out with 0.5 s after the ramp.
    overshoot: f64,
    ripple_deg_s: f64,
    drift_deg_s_per_min: f64,
    /// Amplitude of the seat's vibration at 17 Hz, m/s².
    shake: f64,
    tilt: f64,
    lean: f64,
    gyro_noise: f64,
    after_s: f64,
}

const RATE: f64 = 60.0;
const RIPPLE_HZ: f64 = 6.3;
const SHAKE_HZ: f64 = 17.0;
const SPIN_S: f64 = 24.0;
const SAMPLE_HZ: f64 = 250.0;

const PLAIN: Chair = Chair {
    rest_s: 3.0,
    ramp_s: 1.5,
    overshoot: 0.0,
    ripple_deg_s: 0.0,
    drift_deg_s_per_min: 0.0,
    shake: 0.0,
    tilt: 4.0,
    lean: 0.0,
    gyro_noise: 0.001,
    after_s: 3.0,
};

impl Chair {
    /// Rate at `s` seconds after the start of the ramp, deg/s.
    fn rate(&self, s: f64) -> f64 {
        let (top, end) = (self.ramp_s, self.ramp_s + SPIN_S);
        let fall = (1.0 - (s - end) / self.ramp_s).clamp(0.0, 1.0);
        if s <= 0.0 || fall == 0.0 {
            return 0.0;
        }
        if s < top {
            return RATE * s / top;
        }
        // Shoots past, comes back: a critically damped hump.
        let late = (s - top) / 0.5;
        let hump = self.overshoot * RATE * late * libm::exp(1.0 - late);
        let drift = self.drift_deg_s_per_min / 60.0 * (s - top).min(SPIN_S);
        let ripple = self.ripple_deg_s * libm::sin(TAU * RIPPLE_HZ * s);
        (RATE + hump + drift + if s < end { ripple } else { 0.0 }) * fall
    }

    fn samples(&self) -> Vec<Sample> {
        let mut noise = Noise::new(5);
        let up_imu = Rotation3::from_euler_angles(self.tilt * RAD_PER_DEG, 0.0, 0.7) * Vector3::z();
        let side = up_imu.cross(&Vector3::x()).normalize();
        let count = ((self.rest_s + 2.0 * self.ramp_s + SPIN_S + self.after_s) * SAMPLE_HZ) as usize;
        let mut angle = 0.0;
        let mut samples = Vec::new();
        for index in 0..count {
            let s = index as f64 / SAMPLE_HZ - self.rest_s;
            let rate = self.rate(s) * RAD_PER_DEG;
            angle += rate / SAMPLE_HZ;
            let mut noisy = |value: Vector3<f64>, rms: f64| value.map(|v| v + rms * noise.normal());
            // Gravity stands still in space: in the sensor it goes round against the chair.
            let lean = Rotation3::from_scaled_axis(side * self.lean * RAD_PER_DEG);
            let back = Rotation3::from_scaled_axis(-up_imu * angle);
            let gravity = back * (lean * up_imu) * STANDARD_GRAVITY;
            let shake = if rate > 0.0 { self.shake * libm::sin(TAU * SHAKE_HZ * s) } else { 0.0 };
            samples.push(Sample {
                time_s: index as f64 / SAMPLE_HZ,
                omega_imu: noisy(up_imu * rate + Vector3::new(0.01, -0.02, 0.005), self.gyro_noise),
                specific_force_imu: Some(noisy(gravity + Vector3::x() * shake, 0.02)),
                clipped: false,
            });
        }
        samples
    }

    fn report(&self) -> ChairReport {
        let commanded = Commanded { rate_deg_s: Some(RATE), ramp_s: Some(1.0) };
        survey_chair(&self.samples(), &settings(commanded))
    }
}

fn settings(commanded: Commanded) -> ChairSettings {
    ChairSettings { gravity: STANDARD_GRAVITY, commanded, profile: None, rest: RestLimits::default() }
}

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} +- {tolerance}");
}

#[test]
fn a_plain_chair_is_what_it_is() {
    let report = PLAIN.report();
    assert_eq!(report.cannot_tell, [""; 0]);
    let spin = report.spin.unwrap();
    near(spin.start_s.unwrap(), 3.0, 0.02);
    near(spin.stop_s.unwrap(), 3.0 + 1.5 + 24.0 + 1.5, 0.02);
    near(spin.turned_deg, RATE * (SPIN_S + 1.5), 0.5);
    near(spin.noise_at_rest_rms_deg_s.unwrap(), 0.001_f64.to_degrees(), 0.003);
    for (ramp, sense) in [(spin.ramp_up.unwrap(), 1.0), (spin.ramp_down.unwrap(), -1.0)] {
        near(ramp.duration_s, 1.5, 0.01);
        near(ramp.acceleration_deg_s2, sense * 40.0, 0.4);
        near(ramp.commanded.unwrap().error, 0.5, 0.01);
        assert!(!ramp.unresolved);
    }
    let plateau = spin.plateau.unwrap();
    near(plateau.rate_deg_s.value, RATE, 0.05);
    near(plateau.rate_rpm, 10.0, 0.01);
    near(plateau.duration_s, SPIN_S, 0.6);
    near(plateau.commanded.unwrap().error, 0.0, 0.05);
    near(plateau.drift_deg_s_per_min.value, 0.0, 3.0 * plateau.drift_deg_s_per_min.sigma);
    near(plateau.rate_to_noise_db.unwrap(), 20.0 * libm::log10(RATE * RAD_PER_DEG / 0.001), 0.5);
    near(spin.axis.tilt_from_sensor_z_deg, 4.0, 0.02);
    near(spin.axis.tilt_from_gravity_deg.unwrap(), 0.0, 0.05);
    near(spin.axis.wobble_rms_deg, spin.axis.wobble_of_noise_deg.unwrap(), 0.01);
    let overshoot = spin.overshoot.unwrap();
    assert!(overshoot.overshoot_percent < 0.3 && overshoot.settling_s < 1.7, "{overshoot:?}");
    let vibration = spin.vibration.unwrap();
    assert_eq!(vibration.rate_deg_s.unwrap().peaks, []);
}

#[test]
fn overshoot_and_settling_are_measured() {
    let overshoot = Chair { overshoot: 0.12, ..PLAIN }.report().spin.unwrap().overshoot.unwrap();
    near(overshoot.overshoot_percent, 12.0, 0.6);
    near(overshoot.overshoot_deg_s, 7.2, 0.36);
    // 12 % x e^(1 - x) is down to 2 % at x = 4.19 half seconds after the ramp.
    near(overshoot.settling_s, 1.5 + 0.5 * 4.19, 0.15);
    near(overshoot.settled_band_percent, 2.0, 0.01);
}

#[test]
fn ripple_and_vibration_are_found_at_their_frequencies() {
    let chair = Chair { ripple_deg_s: 1.5, shake: 0.4, ..PLAIN };
    let spin = chair.report().spin.unwrap();
    let plateau = spin.plateau.unwrap();
    near(plateau.ripple_rms_deg_s, 1.5 / 2.0_f64.sqrt(), 0.05);
    near(plateau.ripple_peak_deg_s, 1.5, 0.25);
    near(plateau.rate_to_ripple_db, 20.0 * libm::log10(RATE / (1.5 / 2.0_f64.sqrt())), 0.4);
    let vibration = spin.vibration.unwrap();
    let of_rate = &vibration.rate_deg_s.unwrap().peaks[0];
    near(of_rate.frequency_hz, RIPPLE_HZ, 0.02);
    near(of_rate.amplitude, 1.5, 0.05);
    let of_force = &vibration.specific_force_m_s2.unwrap().peaks[0];
    near(of_force.frequency_hz, SHAKE_HZ, 0.02);
    near(of_force.amplitude, 0.4, 0.02);
    near(vibration.specific_force_rms_m_s2.unwrap(), 0.4 / 2.0_f64.sqrt(), 0.02);
}

#[test]
fn drift_and_lean_are_measured() {
    let spin = Chair { drift_deg_s_per_min: 2.0, lean: 1.2, ..PLAIN }.report().spin.unwrap();
    let drift = spin.plateau.unwrap().drift_deg_s_per_min;
    near(drift.value, 2.0, 0.02 + 3.0 * drift.sigma);
    assert!(drift.sigma < 0.05, "{drift:?}");
    let lean = spin.axis.lean_deg.unwrap();
    near(lean.value, 1.2, 0.05);
    // Mostly the gyro's factor, which nobody measured: 2 % of four turns is 30 deg.
    assert!(lean.sigma < 0.3, "{lean:?}");
}

#[test]
fn what_is_not_in_the_data_is_said() {
    let whole = PLAIN.samples();
    let cut: Vec<Sample> = whole.iter().copied().filter(|s| (6.0..25.0).contains(&s.time_s)).collect();
    let report = survey_chair(&cut, &settings(Commanded::default()));
    let told = report.cannot_tell.join("\n");
    assert!(
        told.contains("rests neither before nor after")
            && told.contains("ramp up")
            && told.contains("ramp down")
    );
    let spin = report.spin.unwrap();
    assert_eq!((spin.start_s, spin.stop_s, spin.ramp_up, spin.ramp_down), (None, None, None, None));
    near(spin.plateau.unwrap().rate_deg_s.value, RATE, 2.0);
    assert_eq!(spin.axis.tilt_from_gravity_deg, None);

    let blind: Vec<Sample> = whole.iter().map(|s| Sample { specific_force_imu: None, ..*s }).collect();
    let report = survey_chair(&blind, &settings(Commanded::default()));
    assert!(report.cannot_tell.join("\n").contains("no accelerometer"));
    let spin = report.spin.unwrap();
    assert!(!spin.sense_known && spin.vibration.unwrap().specific_force_m_s2.is_none());

    let still = survey_chair(&whole[..500], &settings(Commanded::default()));
    assert!(still.spin.is_none() && still.cannot_tell[0].contains("nowhere"));
    assert!(survey_chair(&[], &settings(Commanded::default())).spin.is_none());
}

#[test]
fn the_text_names_every_unit_and_shows_what_cannot_be_told() {
    let chair = Chair { ripple_deg_s: 1.5, shake: 0.4, overshoot: 0.1, ..PLAIN };
    let text = chair.report().to_string();
    for part in [
        "turned (deg)",
        "to the left",
        "ramp up (s)",
        "ramp down (deg/s2)",
        "against the commanded",
        "overshoot",
        "ripple (deg/s)",
        "lean from the vertical (deg)",
        "wobble (deg)",
        "6.30 Hz",
        "17.00 Hz",
    ] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
    let cut = Chair { after_s: 0.0, ..PLAIN }.samples();
    let text = survey_chair(&cut[..4000], &settings(Commanded::default())).to_string();
    assert!(text.contains("behind the end") && text.contains("cannot tell the ramp down"), "{text}");
}
