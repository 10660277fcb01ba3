//! Runs to report on: from the golden series, from a real log, and made up.

mod csv;
mod metrics;
mod output;
mod spins;

use std::path::PathBuf;

use nalgebra::{Vector2, Vector3};

use super::Trace;
use crate::imu::LinkHealth;
use crate::tick::{CharacterOutput, PlatformMotion, Posture, TickInput, TickOutput};
use crate::time::Tick;
use crate::units::STANDARD_GRAVITY;
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
        constraint_residual: 0.0,
        saturated_joints: 0,
        posture: Posture::Standing,
        state_hash: 0,
    }
}

pub(super) fn output(tick: u64, green: CharacterOutput, blue: CharacterOutput) -> TickOutput {
    TickOutput { tick: Tick(tick), platform: PlatformMotion::default(), green, blue }
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
