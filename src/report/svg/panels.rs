//! The three panels of one run that share the time axis.

use super::axis::{Plot, Scale, Ticks, padded_range};
use super::paint::Canvas;
use super::series;
use super::subject::{Angle, Subject, standing};
use super::time_panel::{Causes, FallMark, Panel};
use super::{CHAIR_PEN, GREEN_PEN, LEFT, RIGHT, lettered_heading};
use crate::report::trace::{Character, Row, Trace};
use crate::report::{Windows, name_of};
use crate::units::RAD_S_PER_RPM;

const TOP: f64 = 116.0;
const HEIGHT: f64 = 112.0;
/// From the top of one panel to that of the next, px.
const PITCH: f64 = 138.0;
const TICKS_WANTED: usize = 4;

/// Paints the panels of both characters of one run, the last of `subjects` on top.
pub(super) fn paint(canvas: &mut Canvas, trace: &Trace, windows: &Windows, subjects: &[Subject]) {
    let tilt = "believed gravity against true gravity (blue: of an observer it does not listen to)";
    let sway = "line from support centroid to centre of mass against the vertical";
    let mut sway_panel = angle_panel(subjects, "sway (deg)", |row| row.com_sway);
    // Once in the figure is enough.
    sway_panel.falls = falls(subjects, Some(|row| row.com_sway), |subject, time_s| {
        Some(format!("{} fell at {time_s:.1} s", name_of(subject.character)))
    });
    let panels = [
        ("a", "yaw rate of the chair, and what green believes it to be", rate_panel(trace, subjects)),
        ("b", tilt, angle_panel(subjects, "tilt (deg)", |row| row.gravity_tilt)),
        ("c", sway, sway_panel),
    ];
    let span_s = trace.span_s().unwrap_or((0.0, 1.0));
    // A single tick has no extent to draw over.
    let span_s = (span_s.0, span_s.1.max(span_s.0 + 1e-3));
    let times = Ticks::new(span_s.0, span_s.1, 10);
    let causes = Causes::of(windows);
    let last = panels.len() - 1;
    for (index, (letter, heading, panel)) in panels.iter().enumerate() {
        let top = TOP + PITCH * index as f64;
        let range = padded_range(panel.values(), 1.0, TICKS_WANTED);
        let x = Scale { data: span_s, px: (LEFT, RIGHT) };
        let plot = Plot { x, y: Scale { data: range, px: (top + HEIGHT, top) } };
        let values = Ticks::new(range.0, range.1, TICKS_WANTED);
        panel.paint(canvas, &plot, &causes, (&times, &values), (index == last).then_some("time (s)"));
        lettered_heading(canvas, (LEFT, top - 7.0), letter, heading);
    }
}

fn rate_panel(trace: &Trace, subjects: &[Subject]) -> Panel {
    let measured =
        |row: &Row| Some(f64::from(row.chair_rate) / RAD_S_PER_RPM).filter(|rate| rate.is_finite());
    let believed =
        |row: &Row| standing(row, Character::Green, |row| row.omega_hat_z).map(|rate| rate / RAD_S_PER_RPM);
    let curves = vec![
        (series::over_time(trace, measured), CHAIR_PEN),
        (series::over_time(trace, believed), GREEN_PEN),
    ];
    Panel { label: "yaw rate (rpm)".into(), curves, falls: falls(subjects, None, |_, _| None) }
}

fn angle_panel(subjects: &[Subject], label: &'static str, angle: Angle) -> Panel {
    let curves = subjects.iter().map(|subject| (subject.angle_over_time(angle), subject.pen)).collect();
    Panel { label: label.into(), curves, falls: falls(subjects, Some(angle), |_, _| None) }
}

fn falls(
    subjects: &[Subject],
    angle: Option<Angle>,
    text: impl Fn(&Subject, f64) -> Option<String>,
) -> Vec<FallMark> {
    let mark = |subject| FallMark::of(subject, angle, |time_s| text(subject, time_s));
    subjects.iter().filter_map(mark).collect()
}
