//! The three panels that share the time axis.

use super::axis::{Plot, Scale, Ticks, padded_range};
use super::paint::{Anchor, Canvas, Pen, Type};
use super::series::{self, Pieces};
use super::{CHAIR_PEN, FRAME, GREEN_PEN, LABEL, LEFT, RIGHT, SPIN, lettered_heading, pen_of};
use crate::report::Analysis;
use crate::report::trace::{Character, CharacterRow, Row, Trace};
use crate::units::RAD_S_PER_RPM;

const TOP: f64 = 116.0;
const HEIGHT: f64 = 112.0;
/// From the top of one panel to that of the next, px.
const PITCH: f64 = 138.0;
const TICKS_WANTED: usize = 4;
const CHARACTERS: [(Character, &str); 2] = [(Character::Blue, "blue"), (Character::Green, "green")];

/// One panel: everything but its place.
struct Panel {
    letter: &'static str,
    heading: &'static str,
    label: &'static str,
    /// The axis spans at least this.
    least: f64,
    curves: Vec<(Pieces, Pen)>,
    /// The angle on which a fall is marked with a cross, if the panel shows one, rad.
    angle: Option<fn(&CharacterRow) -> f32>,
    /// Whether the time of a fall is written here; once in the figure is enough.
    names_falls: bool,
}

pub(super) fn paint(canvas: &mut Canvas, trace: &Trace, analysis: &Analysis) {
    let panels = [
        rate_panel(trace),
        Panel {
            letter: "b",
            heading: "believed gravity against true gravity (blue: of an observer it does not listen to)",
            label: "tilt (deg)",
            ..angle_panel(trace, |row| row.gravity_tilt)
        },
        Panel {
            letter: "c",
            heading: "line from support centroid to centre of mass against the vertical",
            label: "sway (deg)",
            names_falls: true,
            ..angle_panel(trace, |row| row.com_sway)
        },
    ];
    let span_s = trace.span_s().unwrap_or((0.0, 1.0));
    // A single tick has no extent to draw over.
    let span_s = (span_s.0, span_s.1.max(span_s.0 + 1e-3));
    let last = panels.len() - 1;
    for (index, panel) in panels.iter().enumerate() {
        let top = TOP + PITCH * index as f64;
        let range = panel.range();
        let x = Scale { data: span_s, px: (LEFT, RIGHT) };
        let plot = Plot { x, y: Scale { data: range, px: (top + HEIGHT, top) } };
        shade_causes(canvas, &plot, analysis);
        plot.upright_axis(canvas, &Ticks::new(range.0, range.1, TICKS_WANTED), panel.label);
        plot.level_axis(canvas, &Ticks::new(span_s.0, span_s.1, 10), (index == last).then_some("time (s)"));
        plot.frame(canvas);
        plot.inside(canvas, |canvas| panel.paint_curves(canvas, &plot));
        mark_falls(canvas, &plot, trace, panel);
        lettered_heading(canvas, (LEFT, top - 7.0), panel.letter, panel.heading);
    }
}

impl Panel {
    fn range(&self) -> (f64, f64) {
        let points = self.curves.iter().flat_map(|(pieces, _)| pieces.iter().flatten());
        padded_range(points.map(|point| point.1), self.least, TICKS_WANTED)
    }

    fn paint_curves(&self, canvas: &mut Canvas, plot: &Plot) {
        for (pieces, pen) in &self.curves {
            for piece in pieces {
                let points: Vec<(f64, f64)> = piece.iter().map(|&point| plot.point(point)).collect();
                canvas.polyline(&points, *pen);
            }
        }
    }
}

fn rate_panel(trace: &Trace) -> Panel {
    let measured =
        |row: &Row| Some(f64::from(row.chair_rate) / RAD_S_PER_RPM).filter(|rate| rate.is_finite());
    let believed =
        |row: &Row| standing(row, Character::Green, |row| row.omega_hat_z).map(|rate| rate / RAD_S_PER_RPM);
    let curves = vec![
        (series::over_time(trace, measured), CHAIR_PEN),
        (series::over_time(trace, believed), GREEN_PEN),
    ];
    let heading = "yaw rate of the chair, and what green believes it to be";
    Panel {
        letter: "a",
        heading,
        label: "yaw rate (rpm)",
        least: 1.0,
        curves,
        angle: None,
        names_falls: false,
    }
}

/// Both characters' `angle`; green last, so that it lies on top.
fn angle_panel(trace: &Trace, angle: fn(&CharacterRow) -> f32) -> Panel {
    let curve = |(character, _)| {
        let in_deg = |row: &Row| standing(row, character, angle).map(f64::to_degrees);
        (series::over_time(trace, in_deg), pen_of(character))
    };
    let curves = CHARACTERS.map(curve).into();
    Panel { letter: "", heading: "", label: "", least: 1.0, curves, angle: Some(angle), names_falls: false }
}

/// `value` of a character up to and including the tick of its fall.
fn standing(row: &Row, character: Character, value: fn(&CharacterRow) -> f32) -> Option<f64> {
    let row = row.of(character);
    (!row.down).then(|| f64::from(value(row)))
}

/// Shades the spins and marks the end of the push.
fn shade_causes(canvas: &mut Canvas, plot: &Plot, analysis: &Analysis) {
    for spin in &analysis.windows.in_spin {
        let (from, to) = (plot.x.map(spin.start_s), plot.x.map(spin.end_s));
        canvas.filled_rect((from, plot.y.px.1), (to - from, HEIGHT), SPIN);
    }
    if let Some(push_end_s) = analysis.windows.push_end_s {
        let x = plot.x.map(push_end_s).clamp(LEFT, RIGHT);
        canvas.line((x, plot.y.px.0), (x, plot.y.px.1), Pen { colour: FRAME, width: 1.0, dash: "3 3" });
        canvas.text((x + 5.0, plot.y.px.1 + 13.0), LABEL, "push ends");
    }
}

/// A dotted line through the panel at each character's first fall, with its time and a cross where an angle is shown.
fn mark_falls(canvas: &mut Canvas, plot: &Plot, trace: &Trace, panel: &Panel) {
    for (line, (character, name)) in CHARACTERS.into_iter().enumerate() {
        let Some(fell_at) = trace.fell_at(character) else {
            continue;
        };
        let colour = pen_of(character).colour;
        let x = plot.x.map(fell_at.time_s());
        canvas.line((x, plot.y.px.0), (x, plot.y.px.1), Pen { colour, width: 1.0, dash: "1.5 2.5" });
        let (Some(angle), Some(row)) = (panel.angle, trace.rows().iter().find(|row| row.tick >= fell_at))
        else {
            continue;
        };
        let y = plot.y.map(f64::from(angle(row.of(character))).to_degrees());
        canvas.cross((x, y.clamp(plot.y.px.1, plot.y.px.0)), 4.5, Pen::solid(colour, 2.2));
        if !panel.names_falls {
            continue;
        }
        // Right of the line, where that character's curve has ended, as long as the text fits.
        let fits = x + 110.0 < RIGHT;
        let (anchor, offset) = if fits { (Anchor::Start, 9.0) } else { (Anchor::End, -9.0) };
        let look = Type { colour, bold: true, anchor, ..LABEL };
        let text = format!("{name} fell at {:.1} s", fell_at.time_s());
        canvas.text_with_halo((x + offset, plot.y.px.1 + 15.0 + 14.0 * line as f64), look, &text);
    }
}
