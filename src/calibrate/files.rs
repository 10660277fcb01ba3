//! The findings as files that a run takes.

use std::fmt::Write as _;

use super::{Findings, MountEstimate};
use crate::survey::VectorEstimate;

/// A mount file as [`crate::imu::Mount::from_toml`] reads it; `source` names the data.
pub fn mount_toml(mount: &MountEstimate, source: &str) -> String {
    let mut out = heading(source);
    let [x, y, z] = mount.sigma_deg;
    let z = if z > 0.0 { format!("{z:.3} deg") } else { "as given".to_owned() };
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "# Standard uncertainty of the rotation about head x, y, z: {x:.3} deg, {y:.3} deg, {z}.\n\
         # A run levels the mount once more by gravity at its start, unless imu.level is false.\n\
         matrix = ["
    );
    for row in mount.matrix {
        let _ = writeln!(out, "  [{:?}, {:?}, {:?}],", row[0], row[1], row[2]);
    }
    out.push_str("]\n");
    match mount.lever_arm_m {
        Some([x, y, z]) => {
            let _ = writeln!(
                out,
                "# To the axis, on the sensor's height: put the height of the head above the sensor in place of the zero.\n\
                 lever_arm_m = [{x:.4}, {y:.4}, {z:.1}]"
            );
        }
        None => out.push_str("# The lever arm was not determined.\nlever_arm_m = [0.0, 0.0, 0.0]\n"),
    }
    out
}

/// A calibration file as [`crate::imu::Calibration::from_toml`] reads it; `None` when there is not even a bias.
///
/// The matrix of the rate is one factor, where a turn was counted; that of the specific force one factor, or one for each
/// axis where there were poses.
pub fn calibration_toml(findings: &Findings, source: &str) -> Option<String> {
    let bias = findings.gyro_bias_rad_s?;
    let mut out = heading(source);
    let _ = writeln!(out, "[gyro]\n{}\nbias_rad_s = {:?}", sigma_line(&bias, "rad/s"), bias.value);
    match findings.gyro_scale {
        Some(found) => {
            let _ = writeln!(
                out,
                "# {:.1} deg counted, {:.1} deg measured: factor {:.5}, standard uncertainty {:.5}.",
                found.counted_deg, found.measured_deg.value, found.scale.value, found.scale.sigma
            );
            out.push_str(&matrix_line([found.scale.value; 3]));
        }
        None => out.push_str("# No turn was counted: the factor on the rate is left at 1.\n"),
    }
    if let Some(found) = &findings.accelerometer {
        let _ = writeln!(
            out,
            "\n[specific_force]\n# From {} poses.\n{}\nbias_m_s2 = {:?}\n{}",
            found.poses,
            sigma_line(&found.bias_m_s2, "m/s2"),
            found.bias_m_s2.value,
            sigma_line(&found.scale, "")
        );
        out.push_str(&matrix_line(found.scale.value));
    } else if let Some(gravity) = findings.gravity {
        out.push_str("\n[specific_force]\n");
        let offset = findings.lever_arm.filter(|arm| arm.offset_written).map(|arm| arm.offset_imu_m_s2);
        if let Some(offset) = offset {
            out.push_str("# Across the axis of the spin only.\n");
            let _ = writeln!(out, "{}\nbias_m_s2 = {:?}", sigma_line(&offset, "m/s2"), offset.value);
        }
        let _ = writeln!(
            out,
            "# At rest it reads {:.4} m/s2, standard uncertainty {:.4}. One pose cannot tell scale from offset along gravity.",
            gravity.norm_m_s2.value, gravity.norm_m_s2.sigma
        );
        out.push_str(&matrix_line([gravity.scale.value; 3]));
    }
    Some(out)
}

fn heading(source: &str) -> String {
    // A name may hold a line break; a comment ends there.
    let source: String = source.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("# Found by `otolith calibrate` in {source}.\n")
}

fn sigma_line(estimate: &VectorEstimate, unit: &str) -> String {
    let [x, y, z] = estimate.sigma;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!("# Standard uncertainty {x:.2e}, {y:.2e}, {z:.2e}{unit}.")
}

fn matrix_line([x, y, z]: [f64; 3]) -> String {
    format!("matrix = [[{x:?}, 0.0, 0.0], [0.0, {y:?}, 0.0], [0.0, 0.0, {z:?}]]\n")
}
