//! How much and how long a character sways, in the numbers of posturography.
//!
//! Sources: path length and 95 % ellipse area after Prieto et al. 1996, "Measures of postural steadiness"; the ellipse
//! as Schubert & Kirchner 2014, "Ellipse area calculations and their applicability in posturography", recommend it.

use crate::report::summary::rounded;
use crate::report::trace::{Character, CharacterRow, Row};
use crate::time::TICK_NS;

/// Ticks between two places: 100 Hz, where posturography samples at 20 to 100 Hz. Every further sample only makes a
/// path longer by its noise.
const GRID_TICKS: u64 = 10_000_000 / TICK_NS;
/// Upper 5 % point of the chi-square distribution with two degrees of freedom: -2 ln 0.05.
const CHI_SQUARE_95: f64 = 5.991_464_547_107_98;
/// How exactly healthy people know the vertical, deg (Horak 2006, set against the gravity tilt in section 6.4 of the
/// paper).
const RECOVERED_DEG: f64 = 0.5;

/// A point of the turntable, m; `None` where a path is broken.
pub(super) type Place = Option<[f64; 2]>;

/// The first kept row of every 10 ms of tick time: every tenth tick, or the next one where that one is missing.
///
/// A run so long that its trace keeps fewer rows has a coarser grid.
pub(super) fn on_grid<'a>(rows: &[&'a Row], character: Character) -> Vec<&'a CharacterRow> {
    let mut cell = None;
    let first_of_its_cell =
        |row: &&&Row| cell.replace(row.tick.0 / GRID_TICKS) != Some(row.tick.0 / GRID_TICKS);
    rows.iter().filter(first_of_its_cell).map(|row| row.of(character)).collect()
}

/// `place` of a row that counts and has one.
pub(super) fn place(row: &CharacterRow, place: [f32; 2]) -> Place {
    (row.counts() && !place[0].is_nan()).then(|| place.map(f64::from))
}

/// Sum of the distances between neighbours that are both there, m; `None` if there are none ("total excursions" of
/// Prieto et al. 1996, without their low-pass filter: noise of the chair's sensor lengthens the path of the CoP).
pub(super) fn path_m(places: &[Place]) -> Option<f64> {
    let steps = places.windows(2).filter_map(|pair| {
        let ([x, y], [next_x, next_y]) = (pair[0]?, pair[1]?);
        Some(libm::hypot(next_x - x, next_y - y))
    });
    steps.reduce(|path, step| path + step).map(rounded)
}

/// Area of the ellipse that holds a further point of the same normal distribution with 95 % probability, m²:
/// π χ² sqrt(det cov) with χ² = 5.991; `None` for fewer than three points, 0 for points on a line.
///
/// It is the limit of Prieto's 2 π F sqrt(det cov) for many points. The F form's correction for few points counts
/// independent ones, which neighbours at 100 Hz are not; at 25 s the two differ by 0.2 %. A confidence ellipse would
/// be that of the mean and shrink with the length of the run (Schubert & Kirchner 2014).
pub(super) fn ellipse_95_m2(places: &[Place]) -> Option<f64> {
    let present = || places.iter().copied().flatten();
    let count = present().count();
    if count < 3 {
        return None;
    }
    let mean = [0, 1].map(|axis| present().map(|place| place[axis]).sum::<f64>() / count as f64);
    let covariance = |a: usize, b: usize| {
        let products = present().map(|place| (place[a] - mean[a]) * (place[b] - mean[b]));
        products.sum::<f64>() / (count - 1) as f64
    };
    let determinant = covariance(0, 0) * covariance(1, 1) - covariance(0, 1) * covariance(0, 1);
    let area = std::f64::consts::PI * CHI_SQUARE_95 * determinant.max(0.0).sqrt();
    // To a square micrometre: places are known to one micrometre.
    Some((area * 1e12).round() / 1e12)
}

/// Root mean square of the CoM sway over the rows that count, deg.
pub(super) fn rms_sway_deg(rows: &[&CharacterRow]) -> Option<f64> {
    let counted = || rows.iter().filter(|row| row.counts());
    let squares: f64 = counted().map(|row| f64::from(row.com_sway) * f64::from(row.com_sway)).sum();
    let count = counted().count();
    (count > 0).then(|| rounded((squares / count as f64).sqrt().to_degrees()))
}

/// Time from the first row until the gravity tilt is below 0.5 deg and stays there, s; 0 if it always is.
///
/// The tilt and not the sway, because 0.5 deg is known of the sense of the vertical; the body follows later.
///
/// `None` if it is above at the end, or if a row does not count: who was stood up has not recovered.
pub(super) fn recovery_s(rows: &[&Row], character: Character) -> Option<f64> {
    let first = rows.first()?;
    if !rows.iter().all(|row| row.of(character).counts()) {
        return None;
    }
    let below = |row: &&Row| f64::from(row.of(character).gravity_tilt).to_degrees() < RECOVERED_DEG;
    let recovered = match rows.iter().rposition(|row| !below(row)) {
        Some(last_above) => rows.get(last_above + 1)?,
        None => first,
    };
    Some(rounded(recovered.tick.time_s() - first.tick.time_s()))
}
