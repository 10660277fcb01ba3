//! The figure of a run: chair and belief, gravity tilt, CoM sway over time; paths of CoM and CoP after the stop.
//!
//! The layout follows figures 9 to 13 of "Motion Sickness Simulation Based on Sensorimotor Control". Green is drawn
//! solid and blue dashed, in two colours of the Okabe-Ito palette, so that they differ without colour as well.

mod axis;
mod maps;
mod paint;
mod panels;
mod series;

use self::paint::{Anchor, Canvas, Pen, Type};
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
const LABEL: Type = Type { size: 11.0, colour: FRAME, bold: false, anchor: Anchor::Start };

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
    header(&mut canvas, caption, &analysis.verdict);
    legend(&mut canvas);
    panels::paint(&mut canvas, trace, analysis);
    maps::paint(&mut canvas, trace, analysis, &caption.support_polygon);
    maps::key(&mut canvas, analysis, !caption.support_polygon.is_empty());
    canvas.finish()
}

fn pen_of(character: Character) -> Pen {
    match character {
        Character::Green => GREEN_PEN,
        Character::Blue => BLUE_PEN,
    }
}

/// The bold letter of a panel and what it shows, above the panel's frame.
fn lettered_heading(canvas: &mut Canvas, (left, y): (f64, f64), letter: &str, heading: &str) {
    canvas.text((left - 42.0, y), Type { size: 13.0, colour: INK, bold: true, ..LABEL }, letter);
    canvas.text((left, y), Type { colour: INK, ..LABEL }, heading);
}

fn header(canvas: &mut Canvas, caption: &Caption, verdict: &str) {
    canvas.text(
        (LEFT, 24.0),
        Type { size: 15.0, colour: INK, bold: true, ..LABEL },
        &fitted(&caption.title, 84),
    );
    canvas.text((LEFT, 42.0), LABEL, &fitted(&caption.subtitle, 124));
    canvas.text((LEFT, 59.0), Type { colour: INK, ..LABEL }, verdict);
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

fn legend(canvas: &mut Canvas) {
    let y = 82.0;
    let entries = [
        (LEFT, CHAIR_PEN, "chair, measured"),
        (LEFT + 136.0, GREEN_PEN, "green: trusts its vestibular model"),
        (LEFT + 366.0, BLUE_PEN, "blue: perceives perfectly"),
    ];
    for (x, pen, text) in entries {
        canvas.line((x, y), (x + 26.0, y), pen);
        canvas.text((x + 32.0, y + 4.0), Type { colour: INK, ..LABEL }, text);
    }
    canvas.filled_rect((LEFT + 552.0, y - 6.0), (26.0, 12.0), SPIN);
    canvas.text((LEFT + 584.0, y + 4.0), Type { colour: INK, ..LABEL }, "chair spinning");
}

#[cfg(test)]
mod tests {
    use super::fitted;

    #[test]
    fn long_titles_lose_their_middle() {
        assert_eq!(fitted("replay:short.txt", 16), "replay:short.txt");
        assert_eq!(fitted("replay:/a/long/\u{e9}/path.txt", 12), "repl\u{2026}ath.txt");
    }
}
