//! Curves over time in one frame, with what caused them and where they end.

use super::axis::{Plot, Ticks};
use super::paint::{Anchor, Canvas, Pen, Type, Words, width_of};
use super::series::Pieces;
use super::subject::{Angle, Subject};
use super::{FRAME, INK, LABEL, SPIN, legend};
use crate::report::metrics::{Window, Windows};

/// From the top of a panel to its first line of words, px.
const FIRST_LINE: f64 = 15.0;
/// From one line of words to the next, px.
const LINE: f64 = 14.0;

/// Everything in a panel but its place.
pub(super) struct Panel {
    /// What the upright axis shows.
    pub(super) label: Words<'static>,
    pub(super) curves: Vec<(Pieces, Pen)>,
    pub(super) falls: Vec<FallMark>,
}

/// A dotted line through the panel where a character fell.
pub(super) struct FallMark {
    time_s: f64,
    /// The last angle, marked with a cross, if the panel shows one, deg.
    angle_deg: Option<f64>,
    colour: &'static str,
    /// What is written beside the line.
    text: Option<String>,
}

impl FallMark {
    /// The mark of `subject`'s first fall, if it fell; `text` makes words of the time of the fall in s.
    pub(super) fn of(
        subject: &Subject,
        angle: Option<Angle>,
        text: impl Fn(f64) -> Option<String>,
    ) -> Option<Self> {
        let fall = subject.fall()?;
        Some(Self {
            time_s: fall.time_s,
            angle_deg: angle.map(|angle| f64::from(angle(fall.row)).to_degrees()),
            colour: subject.pen.colour,
            text: text(fall.time_s),
        })
    }
}

/// What happened to the characters, marked on the time axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Causes {
    /// Stretches in which the chair spins.
    pub(super) spins: Vec<Window>,
    /// Ends of single runs' spins, s, with the run's colour.
    pub(super) spin_ends: Vec<(f64, &'static str)>,
    /// End of the push, s.
    pub(super) push_end_s: Option<f64>,
}

impl Causes {
    pub(super) fn of(windows: &Windows) -> Self {
        Self { spins: windows.in_spin.clone(), spin_ends: Vec::new(), push_end_s: windows.push_end_s }
    }

    fn paint(&self, canvas: &mut Canvas, plot: &Plot) {
        let ((left, top), (width, height)) = (plot.corner(), plot.size());
        for spin in &self.spins {
            let (from, to) = (plot.x.map(spin.start_s), plot.x.map(spin.end_s));
            canvas.filled_rect((from, top), (to - from, height), SPIN);
        }
        for &(end_s, colour) in &self.spin_ends {
            legend::spin_end(canvas, (plot.x.map(end_s), top - 1.0), colour);
        }
        if let Some(push_end_s) = self.push_end_s {
            let x = plot.x.map(push_end_s).clamp(left, left + width);
            canvas.line((x, top + height), (x, top), Pen { colour: FRAME, width: 1.0, dash: "3 3" });
            beside(canvas, plot, (x, top + FIRST_LINE), LABEL, "push ends");
        }
    }
}

impl Panel {
    /// All numbers of all curves.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        self.curves.iter().flat_map(|(pieces, _)| pieces.iter().flatten()).map(|point| point.1)
    }

    /// Paints axes, curves and marks; `time_label` also writes the numbers of the time axis.
    pub(super) fn paint(
        &self,
        canvas: &mut Canvas,
        plot: &Plot,
        causes: &Causes,
        (times, values): (&Ticks, &Ticks),
        time_label: Option<&str>,
    ) {
        causes.paint(canvas, plot);
        plot.upright_axis(canvas, values, self.label);
        plot.level_axis(canvas, times, time_label);
        plot.frame(canvas);
        plot.inside(canvas, |canvas| {
            for (pieces, pen) in &self.curves {
                for piece in pieces {
                    let points: Vec<(f64, f64)> = piece.iter().map(|&point| plot.point(point)).collect();
                    canvas.polyline(&points, *pen);
                }
            }
        });
        let lines_above = if causes.push_end_s.is_some() { LINE } else { 0.0 };
        self.mark_falls(canvas, plot, plot.corner().1 + FIRST_LINE + lines_above);
    }

    /// The words of the first fall stand on height `first_line`.
    fn mark_falls(&self, canvas: &mut Canvas, plot: &Plot, first_line: f64) {
        let (bottom, top) = plot.y.px;
        for (line, fall) in self.falls.iter().enumerate() {
            let x = plot.x.map(fall.time_s);
            let dotted = Pen { colour: fall.colour, width: 1.0, dash: "1.5 2.5" };
            canvas.line((x, bottom), (x, top), dotted);
            if let Some(angle_deg) = fall.angle_deg {
                let y = plot.y.map(angle_deg).clamp(top, bottom);
                legend::fall(canvas, (x, y), fall.colour);
            }
            if let Some(text) = &fall.text {
                let y = first_line + LINE * line as f64;
                beside(canvas, plot, (x, y), Type { colour: INK, bold: true, ..LABEL }, text);
            }
        }
    }
}

/// Text right of the upright line at `x`, or left of it where it would leave the panel.
fn beside(canvas: &mut Canvas, plot: &Plot, (x, y): (f64, f64), look: Type, text: &str) {
    let fits = x + 9.0 + 1.1 * width_of(text, look.size) < plot.x.px.1;
    let (anchor, offset) = if fits { (Anchor::Start, 9.0) } else { (Anchor::End, -9.0) };
    canvas.text_with_halo((x + offset, y), Type { anchor, ..look }, text);
}
