//! The report as text.

use std::fmt;

use super::{
    Against, AxisReport, ChairReport, Overshoot, PlateauReport, ProfileReport, Ramp, Spectrum, SpinReport,
    SpinRow, Vibration, plus_minus,
};

/// Width of the column of names.
const NAMES: usize = 34;

impl fmt::Display for ChairReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sampling = &self.sampling;
        row(f, "samples", &format!("{} in {:.3} s", sampling.samples, sampling.duration_s))?;
        row(
            f,
            "sample rate (Hz)",
            &format!("{:.2}, longest pause {:.3} s", sampling.rate_hz, sampling.longest_gap_s),
        )?;
        let [x, y, z] = self.integral_imu_deg;
        row(f, "raw integral, sensor x y z (deg)", &format!("{x:.1}  {y:.1}  {z:.1}"))?;
        if self.spins.len() > 1 {
            spin_table(f, &self.spins)?;
        }
        if let Some(spin) = &self.spin {
            spin_rows(f, spin)?;
        }
        if let Some(profile) = &self.profile {
            profile_rows(f, profile)?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        for what in &self.cannot_tell {
            writeln!(f, "cannot tell {what}")?;
        }
        Ok(())
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, value: &str) -> fmt::Result {
    writeln!(f, "{name:<NAMES$}{value}")
}

/// A number of a table, or a dash.
fn cell(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// All spins; the one that turned furthest follows in full.
fn spin_table(f: &mut fmt::Formatter<'_>, spins: &[SpinRow]) -> fmt::Result {
    writeln!(f, "\n{} spins", spins.len())?;
    writeln!(
        f,
        "{:>9}{:>9}{:>11}{:>12}{:>9}{:>9}{:>11}{:>9}",
        "from s", "to s", "deg", "rate deg/s", "+-", "ripple", "overshoot%", "tilt deg"
    )?;
    for spin in spins {
        writeln!(
            f,
            "{:>9}{:>9}{:>11.1}{:>12}{:>9}{:>9}{:>11}{:>9.2}",
            cell(spin.start_s, 2),
            cell(spin.stop_s, 2),
            spin.turned_deg,
            cell(spin.rate_deg_s.map(|rate| rate.value), 3),
            cell(spin.rate_deg_s.map(|rate| rate.sigma), 3),
            cell(spin.ripple_rms_deg_s, 3),
            cell(spin.overshoot_percent, 1),
            spin.tilt_from_sensor_z_deg
        )?;
    }
    Ok(())
}

fn profile_rows(f: &mut fmt::Formatter<'_>, profile: &ProfileReport) -> fmt::Result {
    writeln!(f, "\ncommanded profile")?;
    let how = if profile.start_given { "as given" } else { "where it fits best: delays are against that" };
    row(f, "its zero in the log (s)", &format!("{:.2}, {how}", profile.start_s))?;
    row(f, "measured minus commanded (deg/s)", &format!("{:.3} rms", profile.rms_error_deg_s))?;
    writeln!(
        f,
        "{:>9}{:>8}{:>11}{:>11}{:>9}{:>9}{:>9}{:>9}{:>11}{:>9}",
        "from s",
        "for s",
        "commanded",
        "executed",
        "+-",
        "error",
        "error%",
        "delay s",
        "overshoot%",
        "ripple"
    )?;
    for plateau in &profile.plateaus {
        writeln!(
            f,
            "{:>9.2}{:>8.2}{:>11.3}{:>11.3}{:>9.3}{:>+9.3}{:>+9.2}{:>9}{:>11.1}{:>9.3}",
            plateau.start_s,
            plateau.duration_s,
            plateau.commanded_deg_s,
            plateau.executed_deg_s.value,
            plateau.executed_deg_s.sigma,
            plateau.error.error,
            plateau.error.error_percent,
            cell(plateau.delay_s, 3),
            plateau.overshoot_percent,
            plateau.ripple_rms_deg_s
        )?;
    }
    Ok(())
}

fn spin_rows(f: &mut fmt::Formatter<'_>, spin: &SpinReport) -> fmt::Result {
    let time =
        |time_s: Option<f64>, none: &str| time_s.map_or(none.to_owned(), |time_s| format!("{time_s:.2}"));
    writeln!(f, "\nspin")?;
    let span =
        format!("{} to {}", time(spin.start_s, "before the start"), time(spin.stop_s, "behind the end"));
    row(f, "turns from, to (s)", &span)?;
    let sense = match (spin.sense_known, spin.turned_deg < 0.0) {
        (true, true) => ", to the right",
        (true, false) => ", to the left",
        (false, _) => "",
    };
    row(f, "turned (deg)", &format!("{:.1}{sense}", spin.turned_deg))?;
    for (name, ramp) in [("ramp up", &spin.ramp_up), ("ramp down", &spin.ramp_down)] {
        if let Some(ramp) = ramp {
            ramp_rows(f, name, ramp)?;
        }
    }
    if let Some(overshoot) = &spin.overshoot {
        overshoot_rows(f, overshoot)?;
    }
    if let Some(plateau) = &spin.plateau {
        plateau_rows(f, plateau)?;
    }
    for (name, bias) in
        [("bias before", &spin.gyro_bias_before_deg_s), ("bias after", &spin.gyro_bias_after_deg_s)]
    {
        if let Some(bias) = bias {
            let [x, y, z] = bias.value;
            let sigma = bias.sigma.into_iter().fold(0.0, f64::max);
            row(
                f,
                &format!("{name}, sensor x y z (deg/s)"),
                &format!("{x:.3}  {y:.3}  {z:.3}  \u{b1} {sigma:.3}"),
            )?;
        }
    }
    if let Some(noise) = spin.noise_at_rest_rms_deg_s {
        row(f, "noise at rest, rms (deg/s)", &format!("{noise:.3}"))?;
    }
    axis_rows(f, &spin.axis)?;
    spin.vibration.as_ref().map_or(Ok(()), |vibration| vibration_rows(f, vibration))
}

fn against(against: &Option<Against>, unit: &str) -> String {
    against.map_or(String::new(), |off| {
        format!(", {:+.2} {unit} ({:+.2} %) against the commanded", off.error, off.error_percent)
    })
}

fn ramp_rows(f: &mut fmt::Formatter<'_>, name: &str, ramp: &Ramp) -> fmt::Result {
    let bound = if ramp.unresolved { " (within a few samples)" } else { "" };
    let text =
        format!("from {:.2}, {:.3}{bound}{}", ramp.start_s, ramp.duration_s, against(&ramp.commanded, "s"));
    row(f, &format!("{name} (s)"), &text)?;
    row(f, &format!("{name} (deg/s2)"), &format!("{:.2}", ramp.acceleration_deg_s2))
}

fn overshoot_rows(f: &mut fmt::Formatter<'_>, overshoot: &Overshoot) -> fmt::Result {
    let Overshoot { overshoot_deg_s, overshoot_percent, smoothed_ripple_percent, .. } = overshoot;
    let text = format!(
        "{overshoot_deg_s:.2} deg/s, {overshoot_percent:.1} % (ripple of the same smoothing: {smoothed_ripple_percent:.1} % rms)"
    );
    row(f, "overshoot", &text)?;
    let text = format!("{:.2}, to within {:.1} %", overshoot.settling_s, overshoot.settled_band_percent);
    row(f, "settling from ramp start (s)", &text)
}

fn plateau_rows(f: &mut fmt::Formatter<'_>, plateau: &PlateauReport) -> fmt::Result {
    row(f, "plateau (s)", &format!("from {:.2}, {:.2}", plateau.start_s, plateau.duration_s))?;
    let rate = format!(
        "{} = {:.3} rpm{}",
        plus_minus(&plateau.rate_deg_s, 3),
        plateau.rate_rpm,
        against(&plateau.commanded, "deg/s")
    );
    row(f, "rate (deg/s)", &rate)?;
    let [x, y, z] = plateau.omega_imu_deg_s;
    row(f, "rate, sensor x y z (deg/s)", &format!("{x:.2}  {y:.2}  {z:.2}"))?;
    row(f, "drift of the rate (deg/s per min)", &plus_minus(&plateau.drift_deg_s_per_min, 2))?;
    let ripple = format!(
        "{:.3} rms ({:.2} %), {:.2} peak",
        plateau.ripple_rms_deg_s, plateau.ripple_percent, plateau.ripple_peak_deg_s
    );
    row(f, "ripple (deg/s)", &ripple)?;
    let noise = plateau.rate_to_noise_db.map_or(String::new(), |db| format!(", over noise at rest {db:.1}"));
    row(f, "rate over ripple (dB)", &format!("{:.1}{noise}", plateau.rate_to_ripple_db))
}

fn axis_rows(f: &mut fmt::Formatter<'_>, axis: &AxisReport) -> fmt::Result {
    let [x, y, z] = axis.axis_imu;
    writeln!(f, "\naxis")?;
    row(f, "axis, sensor x y z", &format!("{x:.4}  {y:.4}  {z:.4}"))?;
    row(
        f,
        "tilt from sensor z (deg)",
        &format!("{:.2} \u{b1} {:.2}", axis.tilt_from_sensor_z_deg, axis.sigma_deg),
    )?;
    if let Some(tilt) = axis.gravity_tilt_from_sensor_z_deg {
        row(f, "gravity from sensor z (deg)", &format!("{tilt:.2}"))?;
    }
    if let Some(tilt) = axis.tilt_from_gravity_deg {
        row(f, "axis from gravity at rest (deg)", &format!("{tilt:.2}"))?;
    }
    if let Some(lean) = &axis.lean_deg {
        row(f, "lean from the vertical (deg)", &plus_minus(lean, 2))?;
    }
    let noise = axis.wobble_of_noise_deg.map_or(String::new(), |noise| format!(" (noise alone: {noise:.2})"));
    row(
        f,
        "wobble (deg)",
        &format!("{:.2} rms{noise}, 95 % within {:.2}", axis.wobble_rms_deg, axis.wobble_p95_deg),
    )
}

fn vibration_rows(f: &mut fmt::Formatter<'_>, vibration: &Vibration) -> fmt::Result {
    writeln!(f, "\nvibration in the plateau")?;
    if let Some(rms) = vibration.specific_force_rms_m_s2 {
        row(f, "specific force, rms (m/s2)", &format!("{rms:.3}"))?;
    }
    let spectra = [
        ("rate", "deg/s", &vibration.rate_deg_s),
        ("specific force", "m/s2", &vibration.specific_force_m_s2),
    ];
    for (name, unit, spectrum) in spectra {
        let Some(Spectrum { peaks, resolution_hz, highest_hz, .. }) = spectrum else { continue };
        let range = format!("{resolution_hz:.2} Hz apart, up to {highest_hz:.1} Hz");
        row(f, &format!("{name}, peaks"), &if peaks.is_empty() { format!("none ({range})") } else { range })?;
        for peak in peaks {
            let frequency = format!("  {:.2} Hz", peak.frequency_hz);
            row(f, &frequency, &format!("{:.3} {unit}", peak.amplitude))?;
        }
    }
    Ok(())
}
