//! The numbers a run is judged by, and the intervals they are taken over.
//!
//! Sources: CoM sway, gravity tilt and the 5 mm indicator are those of section 6 of "Motion Sickness Simulation Based
//! on Sensorimotor Control" (the indicator after Lauk et al. and Topper et al., cited there).

use serde::Serialize;

use super::spins::Spin;
use super::summary::rounded;
use super::trace::{Character, CharacterRow, Row, Trace};

/// Radius around the support centroid the centre of pressure should stay in, m.
pub const COP_RADIUS: f64 = 0.005;
/// Start of a run without spin or push that no metric counts, s: the CoM starts 10 mm behind the centroid.
const SETTLE_S: f64 = 2.0;

/// A closed interval of tick time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// First moment, s.
    pub start_s: f64,
    /// Last moment, s.
    pub end_s: f64,
}

impl Window {
    /// The interval, or `None` when it would end before it starts.
    fn new(start_s: f64, end_s: f64) -> Option<Self> {
        (start_s <= end_s).then_some(Self { start_s, end_s })
    }

    /// Whether `time_s` lies in the interval.
    pub fn contains(&self, time_s: f64) -> bool {
        // Half a nanosecond absorbs the rounding of tick times.
        self.start_s - 5e-10 <= time_s && time_s <= self.end_s + 5e-10
    }
}

/// The intervals the metrics are taken over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Windows {
    /// From the end of the last ramp down, or of the push if that is later, to the end of the run; with neither spin
    /// nor push the run after its first 2 s. `None` while the last spin still turns.
    pub after_stop: Option<Window>,
    /// Each spin from the start of its ramp up to the end of its ramp down, or to the end of the run.
    pub in_spin: Vec<Window>,
    /// End of the last ramp down, s.
    pub stop_s: Option<f64>,
    /// End of the push, s.
    pub push_end_s: Option<f64>,
}

impl Windows {
    /// The windows of a run over `span_s` (first and last tick time, s; `None` for a run without ticks).
    pub fn new(spins: &[Spin], push_end_s: Option<f64>, span_s: Option<(f64, f64)>) -> Self {
        let Some((first_s, last_s)) = span_s else {
            return Self::default();
        };
        let in_spin = spins
            .iter()
            .filter_map(|spin| Window::new(spin.start_s, spin.stop_s.unwrap_or(last_s).min(last_s)))
            .collect();
        let stop_s = spins.last().and_then(|spin| spin.stop_s);
        let still_turning = !spins.is_empty() && stop_s.is_none();
        let start_s = match (stop_s, push_end_s) {
            (Some(stop_s), Some(push_end_s)) => stop_s.max(push_end_s),
            (Some(only_s), None) | (None, Some(only_s)) => only_s,
            (None, None) => first_s + SETTLE_S,
        };
        let after_stop = if still_turning { None } else { Window::new(start_s, last_s) };
        Self { after_stop, in_spin, stop_s, push_end_s }
    }
}

/// How one character fared. Every number is `None` where its window is missing or holds no row that counts.
///
/// A fall ends what peaks and ranges count: they go up to and including the tick of the fall, and on again 2 s after
/// the character was stood up. Lying on the ground is no sway.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CharacterMetrics {
    /// First tick in which the character was fallen, tick time, s.
    pub fell_at_s: Option<f64>,
    /// Largest angle between believed and true gravity after the stop, deg.
    pub peak_gravity_tilt_deg: Option<f64>,
    /// The same during the spins, deg.
    pub peak_gravity_tilt_in_spin_deg: Option<f64>,
    /// Largest angle of the line from support centroid to CoM against the vertical after the stop, deg.
    pub peak_com_sway_deg: Option<f64>,
    /// Extent of the CoM's path after the stop along turntable x (forward) and y (left), m.
    pub com_range_after_stop_m: Option<[f64; 2]>,
    /// Share of the ticks after the stop with the CoP within 5 mm of the support centroid, 0..=1.
    ///
    /// Ticks without a CoP, and those after a fall, are outside.
    pub cop_within_5mm_after_stop: Option<f64>,
    /// Believed yaw rate at the end of the last ramp down, rad/s, head z; `None` without a stop or when fallen.
    pub omega_hat_at_stop_rad_s: Option<f64>,
}

impl CharacterMetrics {
    /// Measures `character` over `windows` of `trace`.
    pub fn new(trace: &Trace, windows: &Windows, character: Character) -> Self {
        let after: Vec<&CharacterRow> =
            rows_in(trace, windows.after_stop.as_slice()).map(|row| row.of(character)).collect();
        let in_spin = rows_in(trace, &windows.in_spin).map(|row| row.of(character));
        let at_stop = windows.stop_s.and_then(|stop_s| {
            trace.rows().iter().find(|row| row.tick.time_s() + 5e-10 >= stop_s).map(|row| row.of(character))
        });
        Self {
            fell_at_s: trace.fell_at(character).map(|tick| super::summary::rounded(tick.time_s())),
            peak_gravity_tilt_deg: peak_deg(after.iter().copied(), |row| row.gravity_tilt),
            peak_gravity_tilt_in_spin_deg: peak_deg(in_spin, |row| row.gravity_tilt),
            peak_com_sway_deg: peak_deg(after.iter().copied(), |row| row.com_sway),
            com_range_after_stop_m: com_range(&after),
            cop_within_5mm_after_stop: cop_share(&after),
            omega_hat_at_stop_rad_s: at_stop
                .filter(|row| !row.down)
                .map(|row| rounded(f64::from(row.omega_hat_z))),
        }
    }
}

fn rows_in<'a>(trace: &'a Trace, windows: &'a [Window]) -> impl Iterator<Item = &'a Row> {
    trace.rows().iter().filter(|row| windows.iter().any(|window| window.contains(row.tick.time_s())))
}

fn peak_deg<'a>(
    rows: impl Iterator<Item = &'a CharacterRow>,
    angle: fn(&CharacterRow) -> f32,
) -> Option<f64> {
    rows.filter(|row| row.counts())
        .map(angle)
        .reduce(f32::max)
        .map(|peak| rounded(f64::from(peak).to_degrees()))
}

fn com_range(rows: &[&CharacterRow]) -> Option<[f64; 2]> {
    let extent = |axis: usize| {
        let along = || rows.iter().filter(|row| row.counts()).map(|row| row.com[axis]);
        Some(rounded(f64::from(along().reduce(f32::max)?) - f64::from(along().reduce(f32::min)?)))
    };
    Some([extent(0)?, extent(1)?])
}

fn cop_share(rows: &[&CharacterRow]) -> Option<f64> {
    let counted = rows.iter().filter(|row| !row.settling).count();
    // A missing CoP is NaN and compares as outside.
    let within = |row: &&&CharacterRow| {
        libm::hypot(f64::from(row.cop[0]), f64::from(row.cop[1])) <= COP_RADIUS && row.counts()
    };
    (counted > 0).then(|| rounded(rows.iter().filter(within).count() as f64 / counted as f64))
}
