//! Yaw rate of the chair and what a character believes it to be.
//!
//! Figure 6 of "Motion Sickness Simulation Based on Sensorimotor Control".

use super::axis::{Plot, Scale, Ticks, padded_range};
use super::legend::{self, Mark};
use super::paint::{Anchor, Canvas, Pen, Type};
use super::subject::standing;
use super::time_panel::{Causes, Panel};
use super::{BLUE_PEN, GREEN_PEN, INK, LABEL, LEFT, RIGHT, WIDTH, header, series};
use crate::report::trace::{Character, Row, Trace};

const LEGEND: f64 = 64.0;
const TOP: f64 = 86.0;
const BOTTOM: f64 = TOP + 230.0;
const TIMES_WANTED: usize = 10;
const VALUES_WANTED: usize = 6;

/// A figure of the yaw rate that is and the one that is felt.
#[derive(Clone, Debug)]
pub struct Rates<'a> {
    /// First line.
    pub title: &'a str,
    /// Second line: parameters and settings.
    pub subtitle: &'a str,
    /// The run.
    pub trace: &'a Trace,
    /// Whose belief is shown.
    pub character: Character,
    /// Time (s) and value (rad/s) of the believed rate's peak to the other side, to be named.
    pub undershoot: Option<(f64, f64)>,
    /// Time at which the believed rate crosses zero, to be named, s.
    pub zero_crossing_s: Option<f64>,
}

/// Draws the rates as one SVG document.
///
/// The same arguments give the same bytes. A trace without rows gives empty axes. The belief ends at a fall.
pub fn render(rates: &Rates) -> String {
    let mut canvas = Canvas::new(WIDTH, BOTTOM + 46.0, rates.title, rates.subtitle);
    header(&mut canvas, rates.title, rates.subtitle);
    let entries = [
        (Mark::Curve(BLUE_PEN), "yaw rate of the head, input"),
        (Mark::Curve(GREEN_PEN), "believed yaw rate, output of the vestibular model"),
    ];
    legend::paint(&mut canvas, (LEFT, RIGHT), LEGEND, &entries);

    let measured = |row: &Row| Some(f64::from(row.chair_rate)).filter(|rate| rate.is_finite());
    let believed = |row: &Row| standing(row, rates.character, |row| row.omega_hat_z);
    let curves = vec![
        (series::over_time(rates.trace, believed), GREEN_PEN),
        (series::over_time(rates.trace, measured), BLUE_PEN),
    ];
    let panel = Panel { label: "yaw rate (rad/s)".into(), curves, falls: Vec::new() };
    let (start_s, end_s) = rates.trace.span_s().unwrap_or((0.0, 1.0));
    let end_s = end_s.max(start_s + 1e-3);
    let range = padded_range(panel.values(), 1.0, VALUES_WANTED);
    let plot = Plot {
        x: Scale { data: (start_s, end_s), px: (LEFT, RIGHT) },
        y: Scale { data: range, px: (BOTTOM, TOP) },
    };
    let ticks = (&Ticks::new(start_s, end_s, TIMES_WANTED), &Ticks::new(range.0, range.1, VALUES_WANTED));
    let zero = plot.y.map(0.0);
    canvas.line((LEFT, zero), (RIGHT, zero), Pen::solid(INK, 0.9));
    panel.paint(&mut canvas, &plot, &Causes::default(), ticks, Some("time (s)"));
    if let Some((time_s, rate)) = rates.undershoot {
        let minus = if rate < 0.0 { "\u{2212}" } else { "" };
        let text = format!("{minus}{:.2} rad/s at {time_s:.1} s", rate.abs());
        name(&mut canvas, plot.point((time_s, rate)), (8.0, if rate < 0.0 { 14.0 } else { -7.0 }), &text);
    }
    if let Some(time_s) = rates.zero_crossing_s {
        // Left of the crossing the curve lies on the other side of the line than right of it.
        let later = rates.trace.rows().iter().find(|row| row.tick.time_s() > time_s + 0.05);
        let falls = later.is_some_and(|row| row.of(rates.character).omega_hat_z < 0.0);
        let text = format!("crosses zero at {time_s:.1} s");
        name(&mut canvas, plot.point((time_s, 0.0)), (-8.0, if falls { 15.0 } else { -7.0 }), &text);
    }
    canvas.finish()
}

/// A dot at a point of the believed rate, and words that begin `aside` and below it, or end there when `aside` is
/// negative.
fn name(canvas: &mut Canvas, (x, y): (f64, f64), (aside, below): (f64, f64), text: &str) {
    canvas.dot((x, y), 3.6, INK);
    let anchor = if aside < 0.0 { Anchor::End } else { Anchor::Start };
    canvas.text_with_halo((x + aside, y + below), Type { colour: INK, anchor, ..LABEL }, text);
}
