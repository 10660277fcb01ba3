//! The paths of CoM and CoP seen from above, and the table of numbers beside them.

use super::axis::{Plot, Scale, Ticks};
use super::legend::{self, CIRCLE, Mark};
use super::paint::{Anchor, Canvas, Pen, Type};
use super::subject::{Position, Subject};
use super::{BLUE_PEN, FAINT, FRAME, GREEN_PEN, INK, LABEL, LEFT, OUTLINE, RIGHT, lettered_heading};
use crate::report::metrics::COP_RADIUS;
use crate::report::{Analysis, CharacterMetrics, Windows};

const TOP: f64 = 574.0;
const SIDE: f64 = 220.0;
const SECOND_LEFT: f64 = LEFT + SIDE + 56.0;
const KEY_LEFT: f64 = SECOND_LEFT + SIDE + 18.0;

/// Paints the two maps of one run, the last of `subjects` on top.
pub(super) fn paint(canvas: &mut Canvas, subjects: &[Subject], polygon: &[[f64; 2]]) {
    let maps: [(&str, &str, f64, Position); 2] = [
        ("d", "centre of mass", LEFT, |row| row.com),
        ("e", "centre of pressure", SECOND_LEFT, |row| row.cop),
    ];
    for (letter, heading, left, position) in maps {
        map(canvas, ((left, TOP), SIDE), subjects, polygon, position);
        lettered_heading(canvas, (left, TOP - 7.0), letter, heading);
    }
}

/// The paths of `position` after the stop in a square with the given corner and side, px, each
/// with a dot where it begins and a cross where a fall ends it (on the frame when that is outside).
pub(super) fn map(
    canvas: &mut Canvas,
    ((left, top), side): ((f64, f64), f64),
    subjects: &[Subject],
    polygon: &[[f64; 2]],
    position: Position,
) {
    let reach_cm = reach_cm(polygon);
    // Seen from above with forward up, left is to the left: the level axis runs backwards.
    let plot = Plot {
        x: Scale { data: (reach_cm, -reach_cm), px: (left, left + side) },
        y: Scale { data: (-reach_cm, reach_cm), px: (top + side, top) },
    };
    let ticks = Ticks::new(-reach_cm, reach_cm, 7);
    let at = |[x, y]: [f64; 2]| plot.point((1e2 * y, 1e2 * x));
    plot.upright_axis(canvas, &ticks, "x, forward (cm)".into());
    plot.level_axis(canvas, &ticks, Some("y, left (cm)"));
    plot.inside(canvas, |canvas| {
        let outline: Vec<(f64, f64)> = polygon.iter().copied().map(at).collect();
        canvas.polygon(&outline, OUTLINE);
        for subject in subjects {
            path(canvas, subject, position, &at);
        }
        let radius = 1e2 * COP_RADIUS * side / (2.0 * reach_cm);
        canvas.circle(at([0.0; 2]), radius, CIRCLE);
    });
    plot.frame(canvas);
    for subject in subjects {
        if let Some(end) = subject.fell_after_stop_at(position) {
            let (x, y) = at(end);
            let inside = (x.clamp(left, left + side), y.clamp(top, top + side));
            legend::fall(canvas, inside, subject.pen.colour);
        }
    }
}

/// Half the side of a map, cm: room for the support polygon, or 16 cm without one.
fn reach_cm(polygon: &[[f64; 2]]) -> f64 {
    let farthest = polygon.iter().flatten().fold(0.0_f64, |far, along| far.max(along.abs()));
    if farthest > 0.0 && farthest.is_finite() { 1e2 * farthest * 1.2 } else { 16.0 }
}

/// One path after the stop, with a dot where it begins.
fn path(canvas: &mut Canvas, subject: &Subject, position: Position, at: &dyn Fn([f64; 2]) -> (f64, f64)) {
    let pieces = subject.path_after_stop(position, at);
    for piece in &pieces {
        canvas.polyline(piece, Pen { width: 1.3, ..subject.pen });
    }
    if let Some(&begin) = pieces.first().and_then(|piece| piece.first()) {
        legend::start(canvas, begin, subject.pen.colour);
    }
}

/// What the marks of the maps mean, and the numbers of both characters.
pub(super) fn key(canvas: &mut Canvas, analysis: &Analysis, has_polygon: bool) {
    let ink = Type { colour: INK, ..LABEL };
    canvas.text(
        (KEY_LEFT, TOP + 6.0),
        Type { bold: true, ..ink },
        &format!("d, e: after the {}", beginning(&analysis.windows)),
    );
    let mut y = TOP + 24.0;
    Mark::Circle.sample(canvas, (KEY_LEFT + 2.0, y - 4.0));
    canvas.text((KEY_LEFT + 24.0, y), ink, "5 mm around the");
    canvas.text((KEY_LEFT + 24.0, y + 13.0), ink, "support centroid");
    y += 31.0;
    if has_polygon {
        canvas.line((KEY_LEFT, y - 4.0), (KEY_LEFT + 18.0, y - 4.0), OUTLINE);
        canvas.text((KEY_LEFT + 24.0, y), ink, "support polygon");
        y += 18.0;
    }
    Mark::Start(FAINT).sample(canvas, (KEY_LEFT + 2.0, y - 4.0));
    canvas.text((KEY_LEFT + 24.0, y), ink, "where it begins");
    numbers(canvas, analysis, y + 28.0);
}

/// A number of the table, if the run has it.
type Number = fn(&CharacterMetrics) -> Option<f64>;

/// What the time that counts begins with.
pub(super) fn beginning(windows: &Windows) -> &'static str {
    match (windows.stop_s, windows.push_end_s) {
        (Some(stop_s), Some(push_end_s)) if push_end_s > stop_s => "push",
        (None, Some(_)) => "push",
        (None, None) if windows.in_spin.is_empty() => "first 2 s",
        _ => "stop",
    }
}

fn numbers(canvas: &mut Canvas, analysis: &Analysis, top: f64) {
    let columns = [(RIGHT - 46.0, GREEN_PEN.colour, "green"), (RIGHT, BLUE_PEN.colour, "blue")];
    let end = Type { anchor: Anchor::End, ..LABEL };
    for (x, colour, name) in columns {
        canvas.text((x, top), Type { colour, bold: true, ..end }, name);
    }
    canvas.line((KEY_LEFT, top + 5.0), (RIGHT, top + 5.0), Pen::solid(FRAME, 0.8));
    let rows: [(&str, Number, usize); 5] = [
        ("peak tilt, deg", |m| m.peak_gravity_tilt_deg, 2),
        ("peak sway, deg", |m| m.peak_com_sway_deg, 2),
        ("CoM x, cm", |m| m.com_range_after_stop_m.map(|range| 1e2 * range[0]), 1),
        ("CoM y, cm", |m| m.com_range_after_stop_m.map(|range| 1e2 * range[1]), 1),
        ("CoP \u{2264} 5 mm, %", |m| m.cop_within_5mm_after_stop.map(|share| 1e2 * share), 0),
    ];
    for (index, (label, value, decimals)) in rows.into_iter().enumerate() {
        let y = top + 20.0 + 16.0 * index as f64;
        canvas.text((KEY_LEFT, y), Type { colour: INK, ..LABEL }, label);
        for ((x, ..), metrics) in columns.into_iter().zip([&analysis.green, &analysis.blue]) {
            let text = value(metrics).map_or("\u{2013}".into(), |value| format!("{value:.decimals$}"));
            canvas.text((x, y), Type { colour: INK, ..end }, &text);
        }
    }
}
