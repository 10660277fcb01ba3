//! What a chair did: its rate over time, and what shakes in the plateau over frequency.

use super::axis::{Plot, Scale, Ticks, padded_range};
use super::legend::{self, Mark};
use super::paint::{Canvas, Pen};
use super::time_panel::{Causes, Panel};
use super::{CHAIR_PEN, LEFT, RIGHT, SPIN, WIDTH, header, lettered_heading, series};
use crate::report::Window;

const LEGEND: f64 = 64.0;
const TOP: f64 = 100.0;
const HEIGHT: f64 = 150.0;
/// From the top of one panel to that of the next, px.
const PITCH: f64 = 220.0;
const TIMES_WANTED: usize = 10;
const VALUES_WANTED: usize = 5;
const SPECTRUM_PEN: Pen = Pen::solid("#0072B2", 1.0);

/// A figure of one spin.
#[derive(Clone, Copy, Debug)]
pub struct ChairFigure<'a> {
    /// First line.
    pub title: &'a str,
    /// Second line: what was found.
    pub subtitle: &'a str,
    /// Time (s) and rate about the axis (deg/s).
    pub rate: &'a [(f64, f64)],
    /// The plateau.
    pub plateau: Option<Window>,
    /// Frequency (Hz) and amplitude (deg/s) of the rate in the plateau.
    pub rate_spectrum: &'a [(f64, f64)],
    /// Frequency (Hz) and amplitude (m/s²) of the specific force in the plateau.
    pub force_spectrum: &'a [(f64, f64)],
}

/// Draws the spin as one SVG document.
///
/// The same arguments give the same bytes. A curve without points gives an empty panel.
pub fn render(figure: &ChairFigure) -> String {
    let mut canvas = Canvas::new(WIDTH, TOP + 2.0 * PITCH + HEIGHT + 46.0, figure.title, figure.subtitle);
    header(&mut canvas, figure.title, figure.subtitle);
    let entries = [
        (Mark::Curve(CHAIR_PEN), "rate about the axis"),
        (Mark::Curve(SPECTRUM_PEN), "amplitude in the plateau"),
        (Mark::Shade(SPIN), "plateau"),
    ];
    legend::paint(&mut canvas, (LEFT, RIGHT), LEGEND, &entries);
    let plateau = Causes { spins: figure.plateau.into_iter().collect(), ..Causes::default() };
    let panels = [
        ("a", "rate of the chair", "rate (deg/s)", "time (s)", figure.rate.to_vec(), CHAIR_PEN, plateau),
        (
            "b",
            "ripple of the rate, amplitude of sines",
            "rate (mdeg/s)",
            "frequency (Hz)",
            in_thousandths(figure.rate_spectrum),
            SPECTRUM_PEN,
            Causes::default(),
        ),
        (
            "c",
            "vibration of the seat, amplitude of sines, all axes",
            "force (mm/s\u{b2})",
            "frequency (Hz)",
            in_thousandths(figure.force_spectrum),
            SPECTRUM_PEN,
            Causes::default(),
        ),
    ];
    for (index, (letter, heading, upright, level, points, pen, causes)) in panels.iter().enumerate() {
        let top = TOP + PITCH * index as f64;
        let panel = Panel {
            label: (*upright).into(),
            curves: vec![(series::through(points), *pen)],
            falls: Vec::new(),
        };
        let (start, end) = match points.as_slice() {
            [first, .., last] if last.0 > first.0 => (first.0, last.0),
            _ => (0.0, 1.0),
        };
        let range = padded_range(panel.values(), 1.0, VALUES_WANTED);
        let plot = Plot {
            x: Scale { data: (start, end), px: (LEFT, RIGHT) },
            y: Scale { data: range, px: (top + HEIGHT, top) },
        };
        let ticks = (&Ticks::new(start, end, TIMES_WANTED), &Ticks::new(range.0, range.1, VALUES_WANTED));
        panel.paint(&mut canvas, &plot, causes, ticks, Some(level));
        lettered_heading(&mut canvas, (LEFT, top - 7.0), letter, heading);
    }
    canvas.finish()
}

/// A curve with its values times thousand: short numbers fit beside the axis.
fn in_thousandths(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().map(|&(x, y)| (x, 1e3 * y)).collect()
}
