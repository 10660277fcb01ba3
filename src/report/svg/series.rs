//! Curves out of a trace, thinned to what a figure can show.

use crate::report::trace::{Row, Trace};

/// Points per curve at most, but for one or two per interruption: about three per px of width.
const MAX_POINTS: usize = 2000;
/// Points of a path that are nearer than this to the one before are left out, px.
const PATH_STEP: f64 = 0.4;

/// A curve in pieces: it is interrupted where there is nothing to show.
pub(super) type Pieces = Vec<Vec<(f64, f64)>>;

/// The curve of `value` over time (s), interrupted where `value` is `None`.
///
/// Of each bundle of neighbouring rows the lowest and the highest stay, so that no peak is lost.
pub(super) fn over_time(trace: &Trace, value: impl Fn(&Row) -> Option<f64>) -> Pieces {
    let all = pieces(trace.rows(), |row| Some((row.tick.time_s(), value(row)?)));
    let bundle = (2 * trace.rows().len()).div_ceil(MAX_POINTS).max(1);
    all.into_iter().map(|piece| lows_and_highs(&piece, bundle)).collect()
}

/// A curve of points that are there already, thinned in the same way.
pub(super) fn through(points: &[(f64, f64)]) -> Pieces {
    if points.is_empty() {
        return Vec::new();
    }
    vec![lows_and_highs(points, (2 * points.len()).div_ceil(MAX_POINTS).max(1))]
}

/// The path of `place` (px) over the rows that satisfy `shown`, thinned to what is seen.
pub(super) fn path(
    trace: &Trace,
    shown: impl Fn(&Row) -> bool,
    place: impl Fn(&Row) -> Option<(f64, f64)>,
) -> Pieces {
    let rows: Vec<Row> = trace.rows().iter().copied().filter(|row| shown(row)).collect();
    let every = rows.len().div_ceil(MAX_POINTS).max(1);
    let mut all = pieces(&rows, place);
    for piece in &mut all {
        let last = piece.len() - 1;
        let mut before: Option<(f64, f64)> = None;
        let mut index = 0;
        piece.retain(|&point| {
            let far = before.is_none_or(|from| libm::hypot(point.0 - from.0, point.1 - from.1) >= PATH_STEP);
            let kept = index == last || (index % every == 0 && far);
            if kept {
                before = Some(point);
            }
            index += 1;
            kept
        });
    }
    all
}

/// Splits where `point` is `None`. No piece is empty.
fn pieces(rows: &[Row], point: impl Fn(&Row) -> Option<(f64, f64)>) -> Pieces {
    let points: Vec<Option<(f64, f64)>> = rows.iter().map(point).collect();
    let runs = points.split(Option::is_none).filter(|run| !run.is_empty());
    runs.map(|run| run.iter().copied().flatten().collect()).collect()
}

/// The first and last point, and of each `bundle` points the lowest and the highest in their order.
fn lows_and_highs(points: &[(f64, f64)], bundle: usize) -> Vec<(f64, f64)> {
    if bundle == 1 || points.len() <= 2 {
        return points.to_vec();
    }
    let mut kept = vec![points[0]];
    for chunk in points[1..points.len() - 1].chunks(bundle) {
        let (mut low, mut high) = (0, 0);
        for (index, point) in chunk.iter().enumerate() {
            if point.1 < chunk[low].1 {
                low = index;
            }
            if point.1 > chunk[high].1 {
                high = index;
            }
        }
        kept.push(chunk[low.min(high)]);
        if low != high {
            kept.push(chunk[low.max(high)]);
        }
    }
    kept.push(points[points.len() - 1]);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_ends_and_peaks() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|n| (f64::from(n), 0.0)).collect();
        points[4321].1 = 5.0;
        points[4322].1 = -3.0;
        let kept = lows_and_highs(&points, 10);
        assert!(kept.len() <= 2 * 1000 + 2);
        assert_eq!(kept[0], points[0]);
        assert_eq!(kept[kept.len() - 1], points[9999]);
        assert!(kept.contains(&points[4321]) && kept.contains(&points[4322]));
        assert!(kept.is_sorted_by(|a, b| a.0 < b.0));
    }
}
