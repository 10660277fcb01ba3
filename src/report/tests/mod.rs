//! Runs to report on: from the golden series, from a real log, and made up.

mod csv;
mod metrics;
mod output;
mod posturography;
mod spins;

use std::path::PathBuf;

use nalgebra::{Vector2, Vector3};

use super::Trace;
use crate::imu::LinkHealth;
use crate::tick::{CharacterOutput, PlatformMotion, Posture, TickInput, TickOutput};
use crate::time::Tick;
use crate::units::{RAD_S_PER_RPM, STANDARD_GRAVITY};
use crate::vestibular::{HeadMotion, Perception};

/// The file in the shared material; `None`, said aloud, where that is not at hand.
pub(super) fn shared(file: &str) -> Option<PathBuf> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared"));
    if root.is_dir() {
        return Some(root.join(file));
    }
    assert!(std::env::var_os("CI").is_none(), "../shared must be there in CI");
    println!("skipped: ../shared is not here");
    None
}

pub(super) fn input(tick: u64, chair_rate: Option<f64>) -> TickInput {
    let motion = |rate| HeadMotion {
        omega_head: Vector3::new(0.0, 0.0, rate),
        gif_head: Vector3::new(0.0, 0.0, -STANDARD_GRAVITY),
    };
    TickInput { tick: Tick(tick), chair: chair_rate.map(motion), link: LinkHealth::Live, respawn: false }
}

/// A character at rest exactly over its support.
pub(super) fn upright() -> CharacterOutput {
    let gravity = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);
    CharacterOutput {
        perception: Perception {
            gravity_head: gravity,
            omega_head: Vector3::zeros(),
            accel_head: Vector3::zeros(),
        },
        gravity_platform: gravity,
        gravity_tilt: 0.0,
        com_platform: Vector3::new(0.0, 0.0, 0.95),
        com_sway: 0.0,
        cop_platform: Some(Vector2::zeros()),
        foot_tilt: 0.0,
        constraint_residual: 0.0,
        saturated_joints: 0,
        posture: Posture::Standing,
        state_hash: 0,
    }
}

pub(super) fn output(tick: u64, green: CharacterOutput, blue: CharacterOutput) -> TickOutput {
    TickOutput { tick: Tick(tick), platform: PlatformMotion::default(), green, blue }
}

/// A spin of 30 rpm from 2 s to `stop_s`; from then on green leans forward by `deg_per_s`, and with `falls_at` falls in
/// that tick. Blue stands. 14 s, 10 ms per row.
pub(super) fn leaning(stop_s: f64, deg_per_s: f64, falls_at: Option<u64>) -> Trace {
    let mut trace = Trace::new();
    for tick in (0..=14_000).step_by(10) {
        let time_s = tick as f64 * 1e-3;
        let rate = (time_s - 2.0).min(stop_s - time_s).clamp(0.0, 1.0) * 30.0 * RAD_S_PER_RPM;
        let lean_deg = (time_s - stop_s).max(0.0) * deg_per_s;
        let fallen = falls_at.is_some_and(|falls_at| tick >= falls_at);
        let mut green = CharacterOutput {
            com_sway: lean_deg.to_radians(),
            gravity_tilt: 0.8 * lean_deg.to_radians(),
            foot_tilt: 0.1 * lean_deg.to_radians(),
            posture: if fallen { Posture::Fallen } else { Posture::Standing },
            ..upright()
        };
        green.com_platform.x = 0.95 * lean_deg.to_radians();
        green.perception.omega_head.z = 0.5 * rate - if time_s > stop_s - 1.0 { 1.2 } else { 0.0 };
        trace.push(&input(tick, Some(rate)), &output(tick, green, upright()));
    }
    trace
}

/// The rows of a comma-separated file of numbers, from line `first` on.
pub(super) fn numbers(path: &std::path::Path, first: usize) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).expect("the shared file is readable");
    let parse = |line: &str| line.split(',').map(|cell| cell.trim().parse().expect("a number")).collect();
    text.lines().skip(first).map(parse).collect()
}

/// One row of `golden/balance/*.csv` as chair rate and character.
fn golden_row(row: &[f64]) -> (f64, CharacterOutput) {
    let mut out = upright();
    out.com_platform = Vector3::new(row[1], row[2], row[3]);
    out.cop_platform = (!row[4].is_nan()).then(|| Vector2::new(row[4], row[5]));
    out.gravity_platform = Vector3::new(row[6], row[7], row[8]);
    out.com_sway = row[9].to_radians();
    out.gravity_tilt = row[10].to_radians();
    out.perception.omega_head = Vector3::new(row[13], row[14], row[15]);
    (row[12], out)
}

/// A golden run of green beside one of blue, which stands as it last did where its series is shorter; `None` without
/// the shared material.
pub(super) fn golden(green: &str, blue: &str) -> Option<Trace> {
    let [green, blue] = [green, blue].map(|name| {
        let path = shared(&format!("golden/balance/{name}.csv"))?;
        Some(numbers(&path, 1))
    });
    let (green, blue) = (green?, blue?);
    let mut trace = Trace::new();
    for (index, row) in green.iter().enumerate() {
        let tick = (row[0] * 1e3).round() as u64;
        let ((rate, green), (_, blue)) = (golden_row(row), golden_row(&blue[index.min(blue.len() - 1)]));
        trace.push(&input(tick, Some(rate)), &output(tick, green, blue));
    }
    Some(trace)
}

/// Reproducible noise with unit variance: the sum of twelve uniform numbers.
pub(super) fn noise(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}
