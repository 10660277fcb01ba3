//! The findings for a person.

use std::fmt;

use serde::Serialize;

use crate::calibrate::Findings;
use crate::survey::{Estimate, VectorEstimate};
use crate::units::DEG_PER_RAD;

/// Width of the column of names.
const NAMES: usize = 42;

/// The findings with where they come from; the object of `--json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    pub(super) source: &'a str,
    pub(super) protocol: &'a str,
    #[serde(flatten)]
    pub(super) findings: &'a Findings,
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Findings { sampling, motions, refusals, notes, .. } = self.findings;
        writeln!(f, "{}, protocol {}", self.source, self.protocol)?;
        writeln!(
            f,
            "{} samples in {:.2} s, {:.2} Hz, longest pause {:.3} s, clipped {}",
            sampling.samples, sampling.duration_s, sampling.rate_hz, sampling.longest_gap_s, sampling.clipped
        )?;
        for motion in motions {
            write!(f, "  {:6} {:8.2} to {:8.2} s", motion.kind, motion.start_s, motion.end_s)?;
            match motion.kind {
                "rest" => writeln!(f)?,
                _ => writeln!(f, ", ends {:.1} deg further", motion.turned_deg)?,
            }
        }
        writeln!(f, "\n{:<NAMES$}{:>12}{:>12}", "", "value", "1 sigma")?;
        self.sensor_rows(f)?;
        self.mount_rows(f)?;
        for note in notes {
            writeln!(f, "note: {note}")?;
        }
        for refusal in refusals {
            writeln!(f, "not determined: {}: {}", refusal.what, refusal.why)?;
        }
        Ok(())
    }
}

impl Report<'_> {
    fn sensor_rows(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.findings;
        if let Some(bias) = &found.gyro_bias_rad_s {
            vector(f, "gyro bias, sensor {} (deg/s)", &bias.scaled(DEG_PER_RAD), 4)?;
        }
        if let Some(noise) = &found.gyro_noise_density_rad_s_sqrt_hz {
            vector(f, "gyro noise density {} (deg/s/sqrt(Hz))", &noise.scaled(DEG_PER_RAD), 5)?;
        }
        if let Some(scale) = &found.gyro_scale {
            row(f, "gyro scale", &scale.scale, 5)?;
            row(f, "  measured angle of the spin (deg)", &scale.measured_deg, 2)?;
        }
        if let Some(gravity) = &found.gravity {
            row(f, "specific force at rest (m/s2)", &gravity.norm_m_s2, 4)?;
            row(f, "specific force scale", &gravity.scale, 5)?;
            row(f, "gravity from sensor z (deg)", &gravity.tilt_from_sensor_z_deg, 3)?;
        }
        if let Some(known) = &found.accelerometer {
            vector(f, "accelerometer bias, sensor {} (m/s2)", &known.bias_m_s2, 4)?;
            vector(f, "accelerometer scale {}", &known.scale, 5)?;
            if let Some(residual) = known.residual_m_s2 {
                writeln!(f, "{:<NAMES$}{residual:>12.4}", "  norm less gravity over the poses (m/s2)")?;
            }
        }
        if let Some(arm) = found.lever_arm.filter(|arm| arm.offset_written && found.accelerometer.is_none()) {
            vector(f, "accelerometer offset across, {} (m/s2)", &arm.offset_imu_m_s2, 4)?;
        }
        Ok(())
    }

    fn mount_rows(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.findings;
        if let Some(axis) = &found.spin_axis {
            row(f, "spin axis from sensor z (deg)", &axis.tilt_from_sensor_z_deg, 3)?;
            if let Some(apart) = &axis.tilt_from_gravity_deg {
                row(f, "spin axis from gravity at rest (deg)", apart, 3)?;
            }
        }
        if let Some(arm) = &found.lever_arm {
            row(f, "lean of the axis from the vertical (deg)", &arm.lean_deg, 3)?;
            row(f, "sensor from axis (m)", &arm.radius_m, 4)?;
            if let Some(in_head) = &arm.sensor_from_axis_head_m {
                for (i, name) in ["  forward (m)", "  left (m)"].into_iter().enumerate() {
                    row(f, name, &Estimate { value: in_head.value[i], sigma: in_head.sigma[i] }, 4)?;
                }
            }
        }
        if let Some(off) = found.heading.and_then(|heading| heading.nod_axis_off_level_deg) {
            row(f, "nod axis out of the level (deg)", &off, 3)?;
        }
        let Some(mount) = &found.mount else { return Ok(()) };
        writeln!(f, "\nmount: head x, y, z in sensor axes, 1 sigma about each")?;
        for (row, sigma) in mount.matrix.iter().zip(mount.sigma_deg) {
            let sigma = if sigma > 0.0 { format!("{sigma:.3} deg") } else { "as given".to_owned() };
            writeln!(f, "  {:9.6} {:9.6} {:9.6}   {sigma}", row[0], row[1], row[2])?;
        }
        Ok(())
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, estimate: &Estimate, decimals: usize) -> fmt::Result {
    writeln!(f, "{name:<NAMES$}{:>12.decimals$}{:>12.decimals$}", estimate.value, estimate.sigma)
}

/// One row per component; `{}` in the name is its axis.
fn vector(f: &mut fmt::Formatter<'_>, name: &str, vector: &VectorEstimate, decimals: usize) -> fmt::Result {
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        let estimate = Estimate { value: vector.value[i], sigma: vector.sigma[i] };
        row(f, &name.replace("{}", axis), &estimate, decimals)?;
    }
    Ok(())
}
