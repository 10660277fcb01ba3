//! The figure of a run: chair and belief, gravity tilt, CoM sway over time; paths of CoM and CoP after the stop.
//!
//! The layout follows figures 9 to 13 of "Motion Sickness Simulation Based on Sensorimotor Control". Green is drawn
//! solid and blue dashed, in two colours of the Okabe-Ito palette, so that they differ without colour as well.
//!
//! The other figures of that paper: [`comparison`] of several runs, [`rates`] felt and true, [`stills`] of bodies.
//! What a chair did: [`chair`].

mod axis;
pub mod chair;
pub mod comparison;
mod legend;
mod maps;
mod paint;
mod panels;
pub mod rates;
mod series;
pub mod stills;
mod subject;
#[cfg(test)]
mod tests;
mod time_panel;

use self::legend::Mark;
use self::paint::{Anchor, Canvas, Pen, Type};
use self::subject::Subject;
use super::Analysis;
use super::trace::{Character, Trace};

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 848.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 742.0;

const INK: &str = "#222222";
const FAINT: &str = "#666666";
const FRAME: &str = "#555555";
const GRID: &str = "#e3e3e3";
const SPIN: &str = "#f0ece2";
const MARK: &str = "#c0392b";
const GREEN_PEN: Pen = Pen::solid("#009E73", 1.7);
const BLUE_PEN: Pen = Pen { colour: "#0072B2", width: 1.5, dash: "5 2.5" };
const CHAIR_PEN: Pen = Pen::solid("#333333", 1.2);
const OUTLINE: Pen = Pen { colour: FRAME, width: 1.0, dash: "6 2 1.5 2" };
const LABEL: Type = Type { size: 11.0, colour: FRAME, bold: false, anchor: Anchor::Start };

/// How a curve or a body is drawn: a colour of the Okabe-Ito palette and a dash pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Bluish green, solid: with the vestibular model.
    Green,
    /// Blue, dashed: without the vestibular model, and nothing else.
    Blue,
    /// Orange, dotted: beside green and black, which are darker, for the least of three runs.
    Orange,
    /// Black, long dashes: for the most of three runs.
    Black,
}

impl Look {
    const fn pen(self) -> Pen {
        match self {
            Self::Green => GREEN_PEN,
            Self::Blue => BLUE_PEN,
            Self::Orange => Pen { colour: "#E69F00", width: 2.0, dash: "2.5 2" },
            Self::Black => Pen { colour: "#000000", width: 1.5, dash: "8 3" },
        }
    }
}

/// What the figure says about itself, and the outline the character stands on.
#[derive(Clone, Debug, Default)]
pub struct Caption {
    /// First line: the source.
    pub title: String,
    /// Second line: parameters and settings.
    pub subtitle: String,
    /// Corners of the support polygon minus its centroid, turntable axes x and y, m; empty to leave it out.
    pub support_polygon: Vec<[f64; 2]>,
}

/// Draws a run as one SVG document.
///
/// The same arguments give the same bytes. A trace without rows gives empty axes. Curves of a character end at its
/// fall, which is marked, and go on when it is stood up.
pub fn render(trace: &Trace, analysis: &Analysis, caption: &Caption) -> String {
    let mut canvas = Canvas::new(WIDTH, HEIGHT, &caption.title, &analysis.verdict);
    header(&mut canvas, &caption.title, &caption.subtitle);
    canvas.text((LEFT, 59.0), Type { colour: INK, ..LABEL }, &analysis.verdict);
    let entries = [
        (Mark::Curve(CHAIR_PEN), "chair, measured"),
        (Mark::Curve(GREEN_PEN), "green: trusts its vestibular model"),
        (Mark::Curve(BLUE_PEN), "blue: perceives perfectly"),
        (Mark::Shade(SPIN), "chair spinning"),
    ];
    legend::paint(&mut canvas, (LEFT, RIGHT), 82.0, &entries);
    // Green last, so that it lies on top.
    let subjects = [(Character::Blue, BLUE_PEN), (Character::Green, GREEN_PEN)]
        .map(|(character, pen)| Subject { trace, analysis, character, pen });
    panels::paint(&mut canvas, trace, &analysis.windows, &subjects);
    maps::paint(&mut canvas, &subjects, &caption.support_polygon);
    maps::key(&mut canvas, analysis, !caption.support_polygon.is_empty());
    canvas.finish()
}

/// The bold letter of a panel and what it shows, above the panel's frame.
fn lettered_heading(canvas: &mut Canvas, (left, y): (f64, f64), letter: &str, heading: &str) {
    canvas.text((left - 42.0, y), Type { size: 13.0, colour: INK, bold: true, ..LABEL }, letter);
    canvas.text((left, y), Type { colour: INK, ..LABEL }, heading);
}

fn header(canvas: &mut Canvas, title: &str, subtitle: &str) {
    canvas.text((LEFT, 24.0), Type { size: 15.0, colour: INK, bold: true, ..LABEL }, &fitted(title, 84));
    canvas.text((LEFT, 42.0), LABEL, &fitted(subtitle, 124));
}

/// `text` in at most `room` characters; what is cut is the middle, for the ends of a path say most.
fn fitted(text: &str, room: usize) -> String {
    let count = text.chars().count();
    if count <= room {
        return text.into();
    }
    let (head, tail) = (room / 3, room - 1 - room / 3);
    text.chars().take(head).chain(['\u{2026}']).chain(text.chars().skip(count - tail)).collect()
}
