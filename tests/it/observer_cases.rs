//! The stimuli of `tests/golden/observer`, generated from the formulas of its README, and the golden rows.

use core::f64::consts::PI;

use nalgebra::{Rotation3, Vector3, vector};
use otolith::units::{RAD_PER_DEG, RAD_S_PER_RPM, STANDARD_GRAVITY};
use otolith::vestibular::HeadMotion;

pub(crate) const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/observer");

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);

/// True motion of a head at one time, head axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Truth {
    pub(crate) omega: Vector3<f64>,
    pub(crate) accel: Vector3<f64>,
    pub(crate) gravity: Vector3<f64>,
}

impl Truth {
    pub(crate) fn motion(&self) -> HeadMotion {
        HeadMotion { omega_head: self.omega, gif_head: self.gravity - self.accel }
    }
}

/// One golden case.
pub(crate) struct Case {
    /// Name of the golden file, without `.csv`.
    pub(crate) file: String,
    pub(crate) preset: String,
    pub(crate) duration_s: f64,
    /// Believed gravity at the start, where it is not true gravity.
    pub(crate) gravity_hat: Option<Vector3<f64>>,
    pub(crate) rows: Vec<GoldenRow>,
    stimulus: Stimulus,
}

/// One row of a golden file.
pub(crate) struct GoldenRow {
    pub(crate) t_s: f64,
    pub(crate) truth: Truth,
    pub(crate) omega_hat: Vector3<f64>,
    pub(crate) gravity_hat: Vector3<f64>,
    pub(crate) accel_hat: Vector3<f64>,
}

impl Case {
    pub(crate) fn truth(&self, t_s: f64) -> Truth {
        (self.stimulus)(t_s)
    }
}

/// Every case of the manifest.
pub(crate) fn all() -> Vec<Case> {
    let text = std::fs::read_to_string(format!("{FOLDER}/manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    let cases = manifest["cases"].as_object().unwrap();
    // The frequency response is no time series; `newman`'s own tests have it.
    let series = cases.iter().filter(|(_, case)| case.get("case").is_some());
    series
        .map(|(file, case)| Case {
            file: file.clone(),
            preset: case["preset"].as_str().unwrap().to_owned(),
            duration_s: case["T"].as_f64().unwrap(),
            gravity_hat: case["ghat0"]
                .as_array()
                .map(|values| Vector3::from_iterator(values.iter().map(|value| value.as_f64().unwrap()))),
            rows: golden_rows(file),
            stimulus: stimulus(case["case"].as_str().unwrap()),
        })
        .collect()
}

pub(crate) fn named(file: &str) -> Case {
    all().into_iter().find(|case| case.file == file).unwrap()
}

fn golden_rows(file: &str) -> Vec<GoldenRow> {
    let text = std::fs::read_to_string(format!("{FOLDER}/{file}.csv")).unwrap();
    let row = |line: &str| {
        let values: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let vector = |first: usize| Vector3::from_column_slice(&values[first..first + 3]);
        GoldenRow {
            t_s: values[0],
            truth: Truth { omega: vector(1), accel: vector(4), gravity: vector(7) },
            omega_hat: vector(10),
            gravity_hat: vector(13),
            accel_hat: vector(16),
        }
    };
    text.lines().skip(1).map(row).collect()
}

type Stimulus = Box<dyn Fn(f64) -> Truth>;

/// Piecewise linear function through knots, constant outside.
#[derive(Clone)]
struct Linear(Vec<(f64, f64)>);

impl Linear {
    fn new(knots: &[(f64, f64)]) -> Self {
        Self(knots.to_vec())
    }

    fn at(&self, t: f64) -> f64 {
        let knots = &self.0;
        match knots.iter().position(|knot| knot.0 > t) {
            None => knots[knots.len() - 1].1,
            Some(0) => knots[0].1,
            Some(next) => {
                let ((t0, v0), (t1, v1)) = (knots[next - 1], knots[next]);
                v0 + (v1 - v0) * (t - t0) / (t1 - t0)
            }
        }
    }

    /// Integral from the first knot to `t`.
    fn integral(&self, t: f64) -> f64 {
        let mut sum = 0.0;
        for pair in self.0.windows(2) {
            let until = t.min(pair[1].0);
            if until > pair[0].0 {
                sum += 0.5 * (pair[0].1 + self.at(until)) * (until - pair[0].0);
            }
        }
        let (last_t, last_v) = self.0[self.0.len() - 1];
        sum + last_v * (t - last_t).max(0.0)
    }
}

/// Angle and rate of a raised-cosine turn by `angle` within one second from `start`.
fn turn(angle: f64, start: f64, t: f64) -> (f64, f64) {
    let x = t - start;
    if x <= 0.0 {
        (0.0, 0.0)
    } else if x >= 1.0 {
        (angle, 0.0)
    } else {
        let phase = 2.0 * PI * x;
        (angle * (x - libm::sin(phase) / (2.0 * PI)), angle * (1.0 - libm::cos(phase)))
    }
}

/// Gravity after a head that started with `gravity` turned by `angle` about one of its axes.
fn turned(gravity: Vector3<f64>, axis: Vector3<f64>, angle: f64) -> Vector3<f64> {
    Rotation3::new(axis * -angle) * gravity
}

/// Rotation about the head's own vertical, starting with `gravity`.
fn yaw(rate: Linear, gravity: Vector3<f64>) -> Stimulus {
    Box::new(move |t| Truth {
        omega: vector![0.0, 0.0, rate.at(t)],
        accel: Vector3::zeros(),
        gravity: turned(gravity, Vector3::z(), rate.integral(t)),
    })
}

/// Numbers in a case's name, after the last underscores: `d_ovar_t20_w60` -> [20, 60].
fn numbers(name: &str) -> Vec<f64> {
    name.split('_').filter_map(|part| part.trim_matches(char::is_alphabetic).parse().ok()).collect()
}

fn stimulus(name: &str) -> Stimulus {
    let numbers = numbers(name);
    match name.split('_').next().unwrap() {
        "a" => {
            let knots = [(0.0, 0.0), (2.0, 0.0), (5.0, 3.0), (65.0, 3.0), (68.0, 0.0), (130.0, 0.0)];
            yaw(Linear::new(&knots), DOWN)
        }
        "b" => {
            let (rate, length) = (numbers[0] * RAD_S_PER_RPM, numbers[1]);
            yaw(
                Linear::new(&[
                    (0.0, 0.0),
                    (2.0, 0.0),
                    (2.5, rate),
                    (2.5 + length, rate),
                    (3.0 + length, 0.0),
                    (63.0 + length, 0.0),
                ]),
                DOWN,
            )
        }
        "c" => tilt_after_rotation(numbers[0] * RAD_PER_DEG),
        "d" => {
            let rate = numbers[1] * RAD_PER_DEG;
            let knots = [(0.0, 0.0), (2.0, 0.0), (2.0 + numbers[1] / 30.0, rate), (202.0, rate)];
            yaw(Linear::new(&knots), turned(DOWN, Vector3::x(), numbers[0] * RAD_PER_DEG))
        }
        "e" if name.starts_with("e_roll") => roll_step(numbers[0] * RAD_PER_DEG),
        "e" => yaw(Linear::new(&[(0.0, 0.0)]), DOWN),
        "f" => fore_and_aft(numbers[0] * STANDARD_GRAVITY),
        "h" => coriolis(numbers[0]),
        "i" => centrifuge(),
        "j" => swing(),
        other => panic!("no stimulus for case {other}"),
    }
}

fn tilt_after_rotation(angle: f64) -> Stimulus {
    let full = 100.0 * RAD_PER_DEG;
    let rate = Linear::new(&[(0.0, 0.0), (1.0, 0.0), (2.0, full), (62.0, full), (63.0, 0.0)]);
    Box::new(move |t| {
        let (pitch, pitch_rate) = turn(angle, 64.0, t);
        Truth {
            omega: vector![0.0, pitch_rate, rate.at(t)],
            accel: Vector3::zeros(),
            gravity: turned(DOWN, Vector3::y(), pitch),
        }
    })
}

fn roll_step(angle: f64) -> Stimulus {
    Box::new(move |t| {
        let (roll, roll_rate) = turn(angle, 2.0, t);
        Truth {
            omega: vector![roll_rate, 0.0, 0.0],
            accel: Vector3::zeros(),
            gravity: turned(DOWN, Vector3::x(), roll),
        }
    })
}

fn fore_and_aft(size: f64) -> Stimulus {
    let accel = Linear::new(&[(0.0, 0.0), (2.0, 0.0), (2.2, size), (62.0, size), (62.2, 0.0), (92.0, 0.0)]);
    Box::new(move |t| Truth { omega: Vector3::zeros(), accel: vector![accel.at(t), 0.0, 0.0], gravity: DOWN })
}

fn coriolis(deg_per_s: f64) -> Stimulus {
    let full = deg_per_s * RAD_PER_DEG;
    let spin = Linear::new(&[(0.0, 0.0), (1.0, 0.0), (1.0 + deg_per_s / 30.0, full)]);
    Box::new(move |t| {
        let (roll, roll_rate) = turn(30.0 * RAD_PER_DEG, 120.0, t);
        let spin = spin.at(t);
        Truth {
            omega: vector![roll_rate, spin * libm::sin(roll), spin * libm::cos(roll)],
            accel: Vector3::zeros(),
            gravity: turned(DOWN, Vector3::x(), roll),
        }
    })
}

fn centrifuge() -> Stimulus {
    let radius = 5.0;
    let full = (STANDARD_GRAVITY * libm::tan(30.0 * RAD_PER_DEG) / radius).sqrt();
    let spin = Linear::new(&[(0.0, 0.0), (5.0, 0.0), (25.0, full), (145.0, full), (165.0, 0.0)]);
    Box::new(move |t| {
        let spin_up = if t > 5.0 && t < 25.0 { full / 20.0 } else { 0.0 };
        let spin_down = if t > 145.0 && t < 165.0 { full / 20.0 } else { 0.0 };
        let rate = spin.at(t);
        Truth {
            omega: vector![0.0, 0.0, rate],
            accel: vector![(spin_up - spin_down) * radius, rate * rate * radius, 0.0],
            gravity: DOWN,
        }
    })
}

fn swing() -> Stimulus {
    let pulsation = 2.0 * PI * 0.45;
    Box::new(move |t| {
        let x = (t / 10.0).min(1.0);
        let envelope = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        let envelope_rate = 3.0 * x * x * (1.0 - x) * (1.0 - x);
        let (sine, cosine) = libm::sincos(pulsation * t);
        let amplitude = 10.0 * RAD_PER_DEG;
        let rate = amplitude * (envelope_rate * sine + envelope * pulsation * cosine);
        Truth {
            omega: vector![rate, 0.0, 0.0],
            accel: Vector3::zeros(),
            gravity: turned(DOWN, Vector3::x(), amplitude * envelope * sine),
        }
    })
}
