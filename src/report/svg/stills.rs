//! Stick figures at moments of a run, in rows.
//!
//! Figures 8, 10 and 14 of "Motion Sickness Simulation Based on Sensorimotor Control" are such stills.

use super::legend::{self, Mark};
use super::paint::{Anchor, Canvas, Pen, Type, Words};
use super::{FAINT, FRAME, INK, LABEL, LEFT, Look, MARK, RIGHT, WIDTH, fitted, header};

/// Height of a body that needs no smaller scale, m.
const TALLEST: f64 = 1.8;
/// Height of the space for a body, px.
const BODY: f64 = 230.0;
/// From the top of one row to that of the next: body and two lines of text.
const PITCH: f64 = BODY + 52.0;
const LEGEND: f64 = 64.0;
const TOP: f64 = 90.0;
/// Free on each side of a body, px.
const ASIDE: f64 = 4.0;
/// Radius of a head, m.
const HEAD: f64 = 0.1;
/// Length of the arrow of believed gravity, m.
const ARROW: f64 = 0.55;
const SCALE_BAR: f64 = 0.5;
const VERTICAL: Pen = Pen { colour: FAINT, width: 0.9, dash: "4 3" };

/// From where the bodies are seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// From the right: forward is to the right.
    Side,
    /// From behind: left is to the left.
    Behind,
}

impl View {
    /// Turntable axes, m, to (right, up), m.
    fn project(self, point: [f64; 3]) -> (f64, f64) {
        match self {
            Self::Side => (point[0], point[2]),
            Self::Behind => (-point[1], point[2]),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Side => "0.5 m; seen from the right, forward is right",
            Self::Behind => "0.5 m; seen from behind, left is left",
        }
    }
}

/// A figure of stills: each row one character, each column one moment.
#[derive(Clone, Debug)]
pub struct Stills<'a> {
    /// First line.
    pub title: &'a str,
    /// Second line: parameters and settings.
    pub subtitle: &'a str,
    /// From where the bodies are seen.
    pub view: View,
    /// From top to bottom.
    pub rows: &'a [StillRow<'a>],
}

/// One character at several moments.
#[derive(Clone, Debug)]
pub struct StillRow<'a> {
    /// Name of the row, written beside it.
    pub label: &'a str,
    /// Colour of the bodies; a still has no dashes.
    pub look: Look,
    /// From left to right.
    pub stills: &'a [Still],
}

/// A body at one moment. Points and directions in turntable axes (x forward, y left, z up from the ground), m.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    /// What is written below it, such as its time.
    pub label: String,
    /// From joint to joint.
    pub bones: Vec<[[f64; 3]; 2]>,
    /// Middle of the head.
    pub head: [f64; 3],
    /// Centre of mass.
    pub com: [f64; 3],
    /// Points the body stands on; their mean is the middle of the still.
    pub support: Vec<[f64; 3]>,
    /// Direction of believed gravity, of any length; zero leaves the arrow out.
    pub gravity_hat: [f64; 3],
    /// Angle of the line from the support centroid to the centre of mass against the vertical, deg.
    pub com_sway_deg: f64,
}

/// Draws the stills as one SVG document.
///
/// All at one scale and nothing amplified. The same arguments give the same bytes; no rows give an empty page.
pub fn render(stills: &Stills) -> String {
    let height = TOP + PITCH * stills.rows.len() as f64 + 4.0;
    let mut canvas = Canvas::new(WIDTH, height, stills.title, stills.subtitle);
    header(&mut canvas, stills.title, stills.subtitle);
    let columns = stills.rows.iter().map(|row| row.stills.len()).max().unwrap_or(0).max(1);
    let cell = (RIGHT - LEFT) / columns as f64;
    let scale = scale(stills, 0.5 * cell - ASIDE);
    let entries = [
        (Mark::CentreOfMass, "centre of mass"),
        (Mark::BelievedGravity, "believed gravity"),
        (Mark::Curve(VERTICAL), "true vertical"),
        (Mark::Length(SCALE_BAR * scale), stills.view.words()),
    ];
    legend::paint(&mut canvas, (LEFT, RIGHT), LEGEND, &entries);
    for (index, row) in stills.rows.iter().enumerate() {
        let ground = TOP + PITCH * index as f64 + BODY;
        let look = Type { size: 13.0, colour: INK, bold: true, anchor: Anchor::Middle };
        canvas.text_upwards((LEFT - 24.0, ground - 0.5 * BODY), look, &fitted(row.label, 34));
        for (column, still) in row.stills.iter().enumerate() {
            let middle = LEFT + cell * (column as f64 + 0.5);
            let stage =
                Stage { view: stills.view, origin: still.middle(stills.view), at: (middle, ground), scale };
            canvas.line((middle - 0.5 * cell, ground), (middle + 0.5 * cell, ground), Pen::solid(FRAME, 1.0));
            stage.paint(&mut canvas, still, row.look);
            caption(&mut canvas, (middle, ground), still);
        }
    }
    canvas.finish()
}

/// Px per m at which every body fits `room` px to either side of its middle, and in height.
fn scale(stills: &Stills, room: f64) -> f64 {
    let (mut aside, mut tall) = (0.2_f64, TALLEST);
    for still in stills.rows.iter().flat_map(|row| row.stills) {
        let middle = still.middle(stills.view);
        let (x, z) = stills.view.project(still.head);
        (aside, tall) = (aside.max((x - middle).abs() + HEAD), tall.max(z + HEAD));
        for &end in still.bones.iter().flatten() {
            let (x, z) = stills.view.project(end);
            (aside, tall) = (aside.max((x - middle).abs()), tall.max(z));
        }
    }
    (BODY / tall).min(room / aside)
}

fn caption(canvas: &mut Canvas, (middle, ground): (f64, f64), still: &Still) {
    let look = Type { colour: INK, anchor: Anchor::Middle, ..LABEL };
    canvas.text((middle, ground + 17.0), Type { bold: true, ..look }, &still.label);
    let angle = format!("= {:.1}\u{b0}", still.com_sway_deg);
    let words = Words { before: "\u{3b8}", subscript: "CoM", after: &angle };
    canvas.text((middle, ground + 33.0), look, words);
}

impl Still {
    /// Where the middle of what it stands on is seen, m to the right.
    fn middle(&self, view: View) -> f64 {
        let sum: f64 = self.support.iter().map(|&point| view.project(point).0).sum();
        sum / self.support.len().max(1) as f64
    }
}

/// Where one still is drawn.
struct Stage {
    view: View,
    /// What is seen in the middle, m to the right.
    origin: f64,
    /// The middle of the ground, px.
    at: (f64, f64),
    scale: f64,
}

impl Stage {
    fn place(&self, point: [f64; 3]) -> (f64, f64) {
        let (right, up) = self.view.project(point);
        (self.at.0 + self.scale * (right - self.origin), self.at.1 - self.scale * up)
    }

    fn paint(&self, canvas: &mut Canvas, still: &Still, look: Look) {
        let colour = look.pen().colour;
        canvas.line(self.at, (self.at.0, self.at.1 - BODY), VERTICAL);
        for &[from, to] in &still.bones {
            canvas.limb(self.place(from), self.place(to), Pen::solid(colour, 5.0));
        }
        canvas.circle(self.place(still.head), HEAD * self.scale, Pen::solid(colour, 3.0));
        for &point in &still.support {
            canvas.dot(self.place(point), 2.5, INK);
        }
        let com = self.place(still.com);
        canvas.line(com, (com.0, com.1 + ARROW * self.scale), VERTICAL);
        if let Some(tip) = self.arrow_tip(still) {
            legend::arrow(canvas, com, tip, MARK);
        }
        canvas.dot(com, 4.0, INK);
    }

    /// The end of the arrow from the centre of mass along believed gravity.
    fn arrow_tip(&self, still: &Still) -> Option<(f64, f64)> {
        let [x, y, z] = still.gravity_hat;
        let length = libm::sqrt(x * x + y * y + z * z);
        let along = |axis: usize| still.com[axis] + ARROW * still.gravity_hat[axis] / length;
        (length > 0.0 && length.is_finite()).then(|| self.place([along(0), along(1), along(2)]))
    }
}
