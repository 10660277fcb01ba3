//! Which frequencies shake: averaged amplitude spectra.

use core::f64::consts::{PI, TAU};

use serde::Serialize;

use crate::survey::median;

/// Longest piece that is transformed at once, samples.
const LONGEST_PIECE: usize = 1 << 14;
/// Zeros are put behind a piece until it is this many times as long: a peak between two bins loses 1 % then, not 15.
const PADDING: usize = 4;
/// A peak rises this far above the median of the amplitudes around it: of noise, one bin in a million does, ...
const PEAK_OVER_FLOOR: f64 = 4.5;
/// ... taken over this many resolutions to each side.
const FLOOR_REACH: usize = 40;
/// Most peaks that are named.
const MOST_PEAKS: usize = 5;
/// Fewest samples of a spectrum.
const LEAST_SAMPLES: usize = 64;

/// A frequency that stands out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of a sine of that frequency, in the unit of the signal.
    pub amplitude: f64,
}

/// Amplitudes over frequency.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Distance of two frequencies that can be told apart, Hz.
    pub resolution_hz: f64,
    /// Half the sample rate, Hz: what is faster appears at a wrong frequency.
    pub highest_hz: f64,
    /// The strongest peaks, strongest first.
    pub peaks: Vec<Peak>,
    /// Frequency (Hz) and amplitude, for a figure.
    #[serde(skip)]
    pub(super) curve: Vec<(f64, f64)>,
}

/// What shakes in the plateau.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Vibration {
    /// Of the rate about the axis; amplitudes in deg/s.
    pub rate_deg_s: Option<Spectrum>,
    /// Of the specific force, the three axes as root of the sum of squares; amplitudes in m/s².
    pub specific_force_m_s2: Option<Spectrum>,
    /// Standard deviation of the specific force, root of the sum of squares of the axes, m/s².
    pub specific_force_rms_m_s2: Option<f64>,
}

impl Spectrum {
    /// Spectrum of signals sampled at the same `times_s`, put together as the root of the sum of squares.
    ///
    /// Resampled evenly by straight lines, their own line removed, cut into half-overlapping pieces under a Hann window
    /// and averaged (Welch 1967). `None` for fewer than 64 samples or signals of another length.
    pub fn of(times_s: &[f64], signals: &[Vec<f64>]) -> Option<Self> {
        let count = times_s.len();
        if count < LEAST_SAMPLES || signals.iter().any(|signal| signal.len() != count) {
            return None;
        }
        let duration_s = times_s[count - 1] - times_s[0];
        let rate_hz = (count - 1) as f64 / duration_s;
        let piece = count.min(LONGEST_PIECE);
        let padded = (piece * PADDING).next_power_of_two();
        let window: Vec<f64> =
            (0..piece).map(|i| 0.5 * (1.0 - libm::cos(TAU * (i as f64 + 0.5) / piece as f64))).collect();
        let weight: f64 = window.iter().sum();
        let mut power = vec![0.0; padded / 2];
        let starts: Vec<usize> = (0..=count - piece).step_by((piece / 2).max(1)).collect();
        for signal in signals {
            let even = without_line(&resampled(times_s, signal));
            for &start in &starts {
                let mut parts = vec![(0.0, 0.0); padded];
                for (part, (value, share)) in parts.iter_mut().zip(even[start..].iter().zip(&window)) {
                    part.0 = value * share;
                }
                transform(&mut parts);
                for (sum, (re, im)) in power.iter_mut().zip(&parts) {
                    *sum += (re * re + im * im) / starts.len() as f64;
                }
            }
        }
        let step_hz = rate_hz / padded as f64;
        let resolution_hz = rate_hz / piece as f64;
        let curve: Vec<(f64, f64)> = power
            .iter()
            .enumerate()
            .map(|(bin, power)| (bin as f64 * step_hz, 2.0 * power.sqrt() / weight))
            // What is slower than two periods per piece went with the straight line.
            .skip_while(|(frequency_hz, _)| *frequency_hz < 2.0 * resolution_hz)
            .collect();
        Some(Self { resolution_hz, highest_hz: 0.5 * rate_hz, peaks: peaks(&curve, padded / piece), curve })
    }
}

/// The strongest local maxima above the floor around them; `per_resolution` bins are one resolution.
fn peaks(curve: &[(f64, f64)], per_resolution: usize) -> Vec<Peak> {
    let reach = 2 * per_resolution;
    let mut found: Vec<Peak> = Vec::new();
    for index in 1..curve.len().saturating_sub(1) {
        let amplitude = curve[index].1;
        let near = &curve[index.saturating_sub(reach)..(index + reach + 1).min(curve.len())];
        if near.iter().any(|(_, other)| *other > amplitude) {
            continue;
        }
        let wide = FLOOR_REACH * per_resolution;
        let around = &curve[index.saturating_sub(wide)..(index + wide + 1).min(curve.len())];
        let floor = median(&mut around.iter().map(|(_, amplitude)| *amplitude).collect::<Vec<_>>());
        if amplitude > PEAK_OVER_FLOOR * floor {
            // Vertex of the parabola through three bins.
            let (left, right) = (curve[index - 1].1, curve[index + 1].1);
            let bend = left - 2.0 * amplitude + right;
            let aside = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
            let frequency_hz = curve[index].0 + aside * (curve[1].0 - curve[0].0);
            found.push(Peak { frequency_hz, amplitude: amplitude - 0.25 * (left - right) * aside });
        }
    }
    found.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    found.truncate(MOST_PEAKS);
    found
}

/// The signal at as many evenly spaced times, by straight lines between its samples.
fn resampled(times_s: &[f64], signal: &[f64]) -> Vec<f64> {
    let count = times_s.len();
    let step_s = (times_s[count - 1] - times_s[0]) / (count - 1) as f64;
    let mut next = 1;
    (0..count)
        .map(|index| {
            let at_s = times_s[0] + index as f64 * step_s;
            while next + 1 < count && times_s[next] < at_s {
                next += 1;
            }
            let share = ((at_s - times_s[next - 1]) / (times_s[next] - times_s[next - 1])).clamp(0.0, 1.0);
            signal[next - 1] + share * (signal[next] - signal[next - 1])
        })
        .collect()
}

/// The signal without its least-squares line.
fn without_line(signal: &[f64]) -> Vec<f64> {
    let count = signal.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = signal.iter().sum::<f64>() / count;
    let along = |i: usize| i as f64 - middle;
    let slope = signal.iter().enumerate().map(|(i, value)| along(i) * value).sum::<f64>()
        / signal.iter().enumerate().map(|(i, _)| along(i) * along(i)).sum::<f64>();
    signal.iter().enumerate().map(|(i, value)| value - mean - slope * along(i)).collect()
}

/// Discrete Fourier transform in place, of a power of two of (real, imaginary) pairs: Cooley-Tukey, radix 2.
fn transform(values: &mut [(f64, f64)]) {
    let count = values.len();
    debug_assert!(count.is_power_of_two());
    let bits = count.trailing_zeros();
    for index in 0..count {
        let mirrored = index.reverse_bits() >> (usize::BITS - bits);
        if mirrored > index {
            values.swap(index, mirrored);
        }
    }
    let mut half = 1;
    while half < count {
        for offset in 0..half {
            let (sin, cos) = libm::sincos(-PI * offset as f64 / half as f64);
            for upper in (offset..count).step_by(2 * half) {
                let (re, im) = values[upper + half];
                let turned = (re * cos - im * sin, re * sin + im * cos);
                let (a, b) = values[upper];
                values[upper] = (a + turned.0, b + turned.1);
                values[upper + half] = (a - turned.0, b - turned.1);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Noise;

    #[test]
    fn the_transform_is_the_sum_it_stands_for() {
        let mut noise = Noise::new(1);
        let values: Vec<(f64, f64)> = (0..64).map(|_| (noise.normal(), noise.normal())).collect();
        let mut fast = values.clone();
        transform(&mut fast);
        for (bin, found) in fast.iter().enumerate() {
            let slow = values.iter().enumerate().fold((0.0, 0.0), |(re, im), (i, value)| {
                let (sin, cos) = libm::sincos(-TAU * (bin * i) as f64 / 64.0);
                (re + value.0 * cos - value.1 * sin, im + value.0 * sin + value.1 * cos)
            });
            assert!((found.0 - slow.0).abs() < 1e-11 && (found.1 - slow.1).abs() < 1e-11);
        }
    }

    #[test]
    fn two_sines_in_noise_are_found_with_their_amplitudes() {
        let mut noise = Noise::new(2);
        // Irregular times, and a frequency between two bins.
        let times: Vec<f64> = (0..6000).map(|i| i as f64 * 5e-3 + 1e-4 * noise.uniform()).collect();
        let signal: Vec<f64> = times
            .iter()
            .map(|t| {
                3.0 + 0.2 * t
                    + 0.5 * libm::sin(TAU * 7.3217 * t)
                    + 0.2 * libm::cos(TAU * 21.0 * t)
                    + 0.3 * noise.normal()
            })
            .collect();
        let spectrum = Spectrum::of(&times, std::slice::from_ref(&signal)).unwrap();
        assert!(
            (spectrum.highest_hz - 100.0).abs() < 0.1 && (spectrum.resolution_hz - 1.0 / 30.0).abs() < 1e-3
        );
        assert_eq!(spectrum.peaks.len(), 2, "{:?}", spectrum.peaks);
        for (peak, (hz, amplitude)) in spectrum.peaks.iter().zip([(7.3217, 0.5), (21.0, 0.2)]) {
            assert!((peak.frequency_hz - hz).abs() < 0.01, "{peak:?}");
            assert!((peak.amplitude - amplitude).abs() < 0.03, "{peak:?}");
        }
        // The same on two axes is √2 as large; a length that differs is no spectrum.
        let both = Spectrum::of(&times, &[signal.clone(), signal.clone()]).unwrap();
        assert!((both.peaks[0].amplitude / spectrum.peaks[0].amplitude - 2.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(Spectrum::of(&times, &[signal[1..].to_vec()]), None);
        assert_eq!(Spectrum::of(&times[..50], &[signal[..50].to_vec()]), None);
    }

    #[test]
    fn long_signals_are_averaged_and_noise_alone_has_no_peak() {
        let mut noise = Noise::new(3);
        let times: Vec<f64> = (0..60_000).map(|i| i as f64 * 1e-3).collect();
        let signal: Vec<f64> = times.iter().map(|_| noise.normal()).collect();
        let spectrum = Spectrum::of(&times, &[signal]).unwrap();
        assert!((spectrum.resolution_hz - 1000.0 / 16384.0).abs() < 1e-3);
        assert_eq!(spectrum.peaks, []);
    }
}
