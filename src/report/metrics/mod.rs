//! The numbers a run is judged by, and the intervals they are taken over.
//!
//! Sources: CoM sway, gravity tilt and the 5 mm indicator are those of section 6 of "Motion Sickness Simulation Based
//! on Sensorimotor Control" (the indicator after Lauk et al. and Topper et al., cited there); foot tilt is what its
//! sections 6.1, 6.3 and 6.4 see and give no number for. The others are those of posturography, see their functions.

mod posturography;
mod windows;

use serde::Serialize;

pub use windows::{Window, Windows};

use crate::report::summary::rounded;
use crate::report::trace::{Character, CharacterRow, Row, Trace};

/// Radius around the support centroid the centre of pressure should stay in, m.
pub const COP_RADIUS: f64 = 0.005;

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
    /// Root mean square of that angle after the stop, deg.
    pub rms_com_sway_deg: Option<f64>,
    /// From the beginning of the time after the stop until the gravity tilt has fallen below 0.5 deg for good, s.
    ///
    /// 0 if it never was above. `None` if it is above at the end of the run, or if the character lay on the ground or
    /// was stood up after the stop.
    pub recovery_s: Option<f64>,
    /// Largest angle of a sole against the ground after the stop, deg.
    pub peak_foot_tilt_deg: Option<f64>,
    /// Extent of the CoM's path after the stop along turntable x (forward) and y (left), m.
    pub com_range_after_stop_m: Option<[f64; 2]>,
    /// Length of the CoM's path over the turntable after the stop, at 100 Hz, m.
    pub com_path_m: Option<f64>,
    /// Length of the CoP's path after the stop, at 100 Hz, m; without the ways to and from where there was no CoP.
    pub cop_path_m: Option<f64>,
    /// Area of the 95 % prediction ellipse of the CoP after the stop, at 100 Hz, m².
    pub cop_ellipse_95_m2: Option<f64>,
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
        let rows_after: Vec<&Row> = rows_in(trace, windows.after_stop.as_slice()).collect();
        let after: Vec<&CharacterRow> = rows_after.iter().map(|row| row.of(character)).collect();
        let on_grid = posturography::on_grid(&rows_after, character);
        let coms: Vec<_> = on_grid.iter().map(|row| posturography::place(row, row.com)).collect();
        let cops: Vec<_> = on_grid.iter().map(|row| posturography::place(row, row.cop)).collect();
        let in_spin = rows_in(trace, &windows.in_spin).map(|row| row.of(character));
        let at_stop = windows.stop_s.and_then(|stop_s| {
            trace.rows().iter().find(|row| row.tick.time_s() + 5e-10 >= stop_s).map(|row| row.of(character))
        });
        Self {
            fell_at_s: trace.fell_at(character).map(|tick| rounded(tick.time_s())),
            peak_gravity_tilt_deg: peak_deg(after.iter().copied(), |row| row.gravity_tilt),
            peak_gravity_tilt_in_spin_deg: peak_deg(in_spin, |row| row.gravity_tilt),
            peak_com_sway_deg: peak_deg(after.iter().copied(), |row| row.com_sway),
            rms_com_sway_deg: posturography::rms_sway_deg(&after),
            recovery_s: posturography::recovery_s(&rows_after, character),
            peak_foot_tilt_deg: peak_deg(after.iter().copied(), |row| row.foot_tilt),
            com_range_after_stop_m: com_range(&after),
            com_path_m: posturography::path_m(&coms),
            cop_path_m: posturography::path_m(&cops),
            cop_ellipse_95_m2: posturography::ellipse_95_m2(&cops),
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
