//! One spin: its steady part, its axis, what shakes in it.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::profile::{Overshoot, Profile, Ramp};
use super::{Against, ChairSettings, Curves, Spectrum, SpinReport, Vibration};
use crate::survey::{
    Estimate, Mean, Movement, Plateau, Sample, Scales, Segments, Span, TRUSTED_GAP_S, TurningForce,
    angle_between, angle_to_line,
};

/// Standard uncertainty of the gyro's factor, which nobody has measured here.
const GYRO_SCALE_SIGMA: f64 = 0.02;
/// Most points of the figure's curve of the rate.
const CURVE_POINTS: usize = 4000;

/// The steady part of a spin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlateauReport {
    /// Beginning, s.
    pub start_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// Mean rate about the axis, deg/s; positive is to the left.
    pub rate_deg_s: Estimate,
    /// The same, rpm.
    pub rate_rpm: f64,
    /// Mean raw rate minus bias, deg/s, imu axes.
    pub omega_imu_deg_s: [f64; 3],
    /// Rate against the commanded one, deg/s.
    pub commanded: Option<Against>,
    /// Slope of the rate, deg/s per minute; positive is faster.
    pub drift_deg_s_per_min: Estimate,
    /// Standard deviation of the rate about its line, deg/s: ripple, vibration and noise.
    pub ripple_rms_deg_s: f64,
    /// The same, percent of the rate.
    pub ripple_percent: f64,
    /// Largest deviation of a sample from that line, deg/s.
    pub ripple_peak_deg_s: f64,
    /// Rate over `ripple_rms_deg_s`, dB.
    pub rate_to_ripple_db: f64,
    /// Rate over the noise at rest, dB; `None` without a rest.
    pub rate_to_noise_db: Option<f64>,
}

/// The axis of rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AxisReport {
    /// Mean axis, unit, imu frame; upwards where there is an accelerometer.
    pub axis_imu: [f64; 3],
    /// Angle to the nearer end of the sensor's z axis, degrees.
    pub tilt_from_sensor_z_deg: f64,
    /// Standard uncertainty of the direction, per direction across it, degrees.
    pub sigma_deg: f64,
    /// Angle of gravity at rest to the nearer end of the sensor's z axis, degrees.
    pub gravity_tilt_from_sensor_z_deg: Option<f64>,
    /// Angle of the axis to the specific force at rest, degrees: lean and accelerometer offset together.
    pub tilt_from_gravity_deg: Option<f64>,
    /// Angle of the axis to the vertical, by gravity going round once per turn, degrees.
    pub lean_deg: Option<Estimate>,
    /// Root mean square angle of single samples' axes to the mean axis, degrees.
    pub wobble_rms_deg: f64,
    /// 95 of 100 samples are within this, degrees.
    pub wobble_p95_deg: f64,
    /// What the noise at rest alone would give for `wobble_rms_deg`, degrees.
    pub wobble_of_noise_deg: Option<f64>,
}

/// A spin on its way to a report.
struct Study<'a> {
    samples: &'a [Sample],
    segments: &'a Segments,
    movement: &'a Movement,
    /// The plateau, or for want of one the whole spin.
    steady: Span,
    plateau: Option<Plateau>,
    /// Mean bias-corrected rate in `steady`.
    omega: Mean,
    /// Axis, upwards or along the nearest sensor axis.
    axis: Vector3<f64>,
    /// +1 when the chair turns about `axis`, -1 when against it.
    sense: f64,
    /// Specific force at rest.
    gravity: Option<Vector3<f64>>,
}

/// The rate of a spin from rest to rest.
#[derive(Default)]
struct Course {
    plateau: Option<PlateauReport>,
    overshoot: Option<Overshoot>,
    ramp_up: Option<Ramp>,
    ramp_down: Option<Ramp>,
}

/// Measures one spin; `None` when it is too short to have an axis.
pub(super) fn spin_report(
    samples: &[Sample],
    segments: &Segments,
    movement: &Movement,
    settings: &ChairSettings,
    cannot_tell: &mut Vec<String>,
    curves: &mut Curves,
) -> Option<SpinReport> {
    let study = Study::new(samples, segments, movement)?;
    study.say_what_is_missing(cannot_tell);
    let Course { plateau, overshoot, ramp_up, ramp_down } = study.course(settings, curves);
    let bias = |rest: Option<usize>| {
        let mean = Mean::of(&segments.rests[rest?].omegas(samples))?;
        Some(mean.estimate().scaled(1.0_f64.to_degrees()))
    };
    let lean = study.lean(settings.gravity);
    if plateau.is_some() && lean.is_none_or(|lean| lean.sigma > 1.0) {
        let why = "how far the axis leans from the vertical: it takes an accelerometer, a rest and a good part of a turn";
        cannot_tell.push(why.to_owned());
    }
    let (from_s, to_s) = movement.span.times_s(samples);
    Some(SpinReport {
        start_s: movement.rest_before.map(|_| ramp_up.map_or(from_s, |ramp| ramp.start_s)),
        stop_s: movement.rest_after.map(|_| ramp_down.map_or(to_s, |ramp| ramp.start_s + ramp.duration_s)),
        turned_deg: movement.turning.angle.dot(&study.axis).to_degrees(),
        sense_known: study.gravity.is_some(),
        gyro_bias_before_deg_s: bias(movement.rest_before),
        gyro_bias_after_deg_s: bias(movement.rest_after),
        noise_at_rest_rms_deg_s: study.noise_along().map(f64::to_degrees),
        ramp_up,
        ramp_down,
        overshoot,
        axis: study.axis_report(lean),
        vibration: plateau.is_some().then(|| study.vibration(curves)),
        plateau,
    })
}

impl<'a> Study<'a> {
    fn new(samples: &'a [Sample], segments: &'a Segments, movement: &'a Movement) -> Option<Self> {
        let plateau = Plateau::find(samples, movement);
        let steady = plateau.map_or(movement.span, |plateau| plateau.span);
        let corrected = |sample: &Sample| sample.omega_imu - movement.bias.at(sample.time_s);
        let rates: Vec<Vector3<f64>> = steady.of(samples).iter().map(corrected).collect();
        let omega = Mean::of_one_direction(&rates)?;
        let direction = omega.mean.try_normalize(1e-9)?;
        let forces: Vec<Vector3<f64>> =
            segments.rests_around(movement).flat_map(|rest| rest.specific_forces(samples)).collect();
        let gravity = (!forces.is_empty()).then(|| forces.iter().sum::<Vector3<f64>>() / forces.len() as f64);
        // In the spin the specific force shows up as well, where no rest does.
        let in_spin: Vector3<f64> = steady.specific_forces(samples).iter().sum();
        let upward = match gravity.unwrap_or(in_spin) {
            force if force.norm() > 1e-9 => direction.dot(&force),
            _ => direction[direction.iamax()],
        };
        let sense = if upward < 0.0 { -1.0 } else { 1.0 };
        let gravity = gravity.or((in_spin.norm() > 1e-9).then_some(in_spin));
        Some(Self {
            samples,
            segments,
            movement,
            steady,
            plateau,
            omega,
            axis: direction * sense,
            sense,
            gravity,
        })
    }

    fn say_what_is_missing(&self, cannot_tell: &mut Vec<String>) {
        let mut say = |text: &str| cannot_tell.push(text.to_owned());
        if self.gravity.is_none() {
            say("left from right, the lean of the axis and vibration of the seat: there is no accelerometer");
        }
        match (self.movement.rest_before, self.movement.rest_after) {
            (None, None) => {
                say(
                    "the gyro's bias and noise: the sensor rests neither before nor after the spin, so that bias is part \
                     of every rate and angle here",
                );
            }
            (Some(_), None) => say("whether the gyro's bias drifted: there is no rest after the spin"),
            (None, Some(_)) => say("whether the gyro's bias drifted: there is no rest before the spin"),
            _ => {}
        }
        if self.movement.rest_before.is_none() {
            say("the ramp up: the sensor does not rest before the spin");
        }
        if self.movement.rest_after.is_none() {
            say("the ramp down: the sensor does not rest after the spin");
        }
        if self.plateau.is_none() {
            say("a plateau and what belongs to it: the rate never kept steady for 1 s");
        }
        let gap_s = self.movement.span.longest_gap_s(self.samples);
        if gap_s > TRUSTED_GAP_S {
            say(&format!("how far it turned: the data pause for {gap_s:.2} s in the spin"));
        }
    }

    /// Rate about the axis in the sense of the spin, rad/s.
    fn rate(&self, sample: &Sample) -> f64 {
        self.sense * (sample.omega_imu - self.movement.bias.at(sample.time_s)).dot(&self.axis)
    }

    /// Plateau, overshoot and ramps, and the curve of the rate.
    fn course(&self, settings: &ChairSettings, curves: &mut Curves) -> Course {
        let every = self.samples.len().div_ceil(CURVE_POINTS).max(1);
        curves.rate = self
            .samples
            .iter()
            .step_by(every)
            .map(|sample| (sample.time_s, (self.sense * self.rate(sample)).to_degrees()))
            .collect();
        if self.plateau.is_none() {
            return Course::default();
        }
        let inside = self.movement.span.of(self.samples);
        let times_s: Vec<f64> = inside.iter().map(|sample| sample.time_s).collect();
        let profile = Profile::new(times_s, inside.iter().map(|sample| self.rate(sample)).collect());
        let level = self.omega.mean.norm();
        let offset = self.movement.span.first;
        let ends = (self.steady.first - offset, self.steady.end - 1 - offset);
        let ramp_s = settings.commanded.ramp_s;
        let up = self.movement.rest_before.and_then(|_| profile.ramp_up(ends.0, level, ramp_s));
        let down = self.movement.rest_after.and_then(|_| profile.ramp_down(ends.1, level, ramp_s));
        let overshoot = up.map(|ramp| profile.overshoot(ramp.start_s, ends, level));
        let report = self.plateau_report(
            &profile.times_s[ends.0..=ends.1],
            &profile.rates[ends.0..=ends.1],
            settings.commanded.rate_deg_s,
        );
        Course { plateau: Some(report), overshoot, ramp_up: up, ramp_down: down }
    }

    fn plateau_report(&self, times_s: &[f64], rates: &[f64], commanded: Option<f64>) -> PlateauReport {
        let line = Line::through(times_s, rates);
        let off: Vec<f64> = times_s.iter().zip(rates).map(|(t, rate)| rate - line.at(*t)).collect();
        let rms = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
        let level = self.omega.mean.norm();
        let along =
            (self.axis.transpose() * (self.omega.covariance + self.bias_covariance()) * self.axis)[(0, 0)];
        let rate_deg_s = (self.sense * level).to_degrees();
        let decibel = |ratio: f64| 20.0 * libm::log10(ratio);
        PlateauReport {
            start_s: times_s[0],
            duration_s: times_s[times_s.len() - 1] - times_s[0],
            rate_deg_s: Estimate { value: rate_deg_s, sigma: along.max(0.0).sqrt().to_degrees() },
            rate_rpm: rate_deg_s / 6.0,
            omega_imu_deg_s: self.omega.mean.map(f64::to_degrees).into(),
            commanded: commanded.map(|commanded| Against::of(rate_deg_s, commanded)),
            drift_deg_s_per_min: Estimate { value: line.slope, sigma: line.slope_sigma(times_s, &off) }
                .scaled(60.0_f64.to_degrees()),
            ripple_rms_deg_s: rms.to_degrees(),
            ripple_percent: 100.0 * rms / level,
            ripple_peak_deg_s: off.iter().map(|off| off.abs()).fold(0.0, f64::max).to_degrees(),
            rate_to_ripple_db: decibel(level / rms),
            rate_to_noise_db: self.noise_along().map(|noise| decibel(level / noise)),
        }
    }

    /// Covariance of the bias that was taken off, (rad/s)².
    fn bias_covariance(&self) -> Matrix3<f64> {
        self.segments.bias_covariance(self.samples, self.movement)
    }

    /// The gyro in the first rest next to the spin.
    fn first_rest(&self) -> Option<Mean> {
        Mean::of(&self.segments.rests_around(self.movement).next()?.omegas(self.samples))
    }

    /// Standard deviation of the rate along the axis at rest, rad/s.
    fn noise_along(&self) -> Option<f64> {
        let mean = self.first_rest()?;
        Some(mean.std.component_mul(&self.axis).norm())
    }

    fn axis_report(&self, lean: Option<Estimate>) -> AxisReport {
        let rate = self.omega.mean.norm();
        let across = Matrix3::identity() - self.axis * self.axis.transpose();
        let covariance = across * (self.omega.covariance + self.bias_covariance()) * across / (rate * rate);
        let mut angles: Vec<f64> = self
            .steady
            .of(self.samples)
            .iter()
            .map(|sample| {
                let omega = self.sense * (sample.omega_imu - self.movement.bias.at(sample.time_s));
                angle_between(&omega, &self.axis)
            })
            .collect();
        let mean_square = angles.iter().map(|angle| angle * angle).sum::<f64>() / angles.len() as f64;
        angles.sort_by(f64::total_cmp);
        let noise = self.first_rest().map(|mean| (across * Matrix3::from_diagonal(&mean.std)).norm() / rate);
        let from_z = |direction: &Vector3<f64>| angle_to_line(direction, &Vector3::z()).to_degrees();
        // Without a rest the specific force holds the centripetal part.
        let at_rest = self.gravity.filter(|_| self.movement.bias.is_known());
        AxisReport {
            axis_imu: self.axis.into(),
            tilt_from_sensor_z_deg: from_z(&self.axis),
            sigma_deg: (0.5 * covariance.trace()).max(0.0).sqrt().to_degrees(),
            gravity_tilt_from_sensor_z_deg: at_rest.as_ref().map(from_z),
            tilt_from_gravity_deg: at_rest.map(|force| angle_between(&force, &self.axis).to_degrees()),
            lean_deg: lean,
            wobble_rms_deg: mean_square.sqrt().to_degrees(),
            wobble_p95_deg: angles[(angles.len() - 1) * 95 / 100].to_degrees(),
            wobble_of_noise_deg: noise.map(f64::to_degrees),
        }
    }

    /// Lean of the axis from the vertical, degrees.
    fn lean(&self, gravity: f64) -> Option<Estimate> {
        let norm = self.gravity.filter(|_| self.movement.bias.is_known())?.norm();
        let scales = Scales {
            gyro: Estimate { value: 1.0, sigma: GYRO_SCALE_SIGMA },
            specific_force: Estimate { value: gravity / norm, sigma: 0.0 },
        };
        let axis = (&self.axis, &Matrix3::zeros());
        let spin = (self.movement, self.plateau.as_ref()?);
        let fit = TurningForce::fit(self.samples, &self.segments.rests, spin, axis, &scales)?;
        let sigma = (0.5 * fit.lean_covariance.trace()).max(0.0).sqrt();
        Some(
            Estimate { value: fit.lean.norm() / gravity, sigma: sigma / gravity }
                .scaled(1.0_f64.to_degrees()),
        )
    }

    fn vibration(&self, curves: &mut Curves) -> Vibration {
        let inside = self.steady.of(self.samples);
        let times_s: Vec<f64> = inside.iter().map(|sample| sample.time_s).collect();
        let rates: Vec<f64> = inside.iter().map(|sample| self.rate(sample).to_degrees()).collect();
        let forces = self.steady.specific_forces(self.samples);
        let by_axis: Vec<Vec<f64>> = (0..3).map(|i| forces.iter().map(|force| force[i]).collect()).collect();
        let vibration = Vibration {
            rate_deg_s: Spectrum::of(&times_s, &[rates]),
            specific_force_m_s2: Spectrum::of(&times_s, &by_axis),
            specific_force_rms_m_s2: Mean::of(&forces).map(|mean| mean.std.norm()),
        };
        let curve =
            |spectrum: &Option<Spectrum>| spectrum.as_ref().map_or(Vec::new(), |found| found.curve.clone());
        curves.rate_spectrum = curve(&vibration.rate_deg_s);
        curves.force_spectrum = curve(&vibration.specific_force_m_s2);
        vibration
    }
}

/// A least-squares line.
struct Line {
    middle_s: f64,
    mean: f64,
    slope: f64,
}

impl Line {
    fn through(times_s: &[f64], values: &[f64]) -> Self {
        let count = times_s.len() as f64;
        let middle_s = times_s.iter().sum::<f64>() / count;
        let mean = values.iter().sum::<f64>() / count;
        let products: f64 =
            times_s.iter().zip(values).map(|(t, value)| (t - middle_s) * (value - mean)).sum();
        let squares: f64 = times_s.iter().map(|t| (t - middle_s) * (t - middle_s)).sum();
        Self { middle_s, mean, slope: if squares > 0.0 { products / squares } else { 0.0 } }
    }

    fn at(&self, time_s: f64) -> f64 {
        self.mean + self.slope * (time_s - self.middle_s)
    }

    /// Standard uncertainty of the slope. The residuals `off` weighted by their distance from the middle are what the
    /// slope is the mean of: the error of that mean knows that neighbours are alike.
    fn slope_sigma(&self, times_s: &[f64], off: &[f64]) -> f64 {
        let squares: f64 = times_s.iter().map(|t| (t - self.middle_s) * (t - self.middle_s)).sum();
        let weighted: Vec<Vector3<f64>> =
            times_s.iter().zip(off).map(|(t, off)| Vector3::x() * ((t - self.middle_s) * off)).collect();
        let Some(mean) = Mean::of(&weighted) else { return f64::INFINITY };
        mean.covariance[(0, 0)].max(0.0).sqrt() * off.len() as f64 / squares.max(1e-12)
    }
}
