//! What the marks of a figure mean.

use super::paint::{Canvas, Pen, Type, width_of};
use super::{INK, LABEL, MARK, OUTLINE};

/// Width of a sample, px.
const SAMPLE: f64 = 26.0;
/// Between a sample and its text, px.
const GAP: f64 = 6.0;
/// Between two entries, px.
const PITCH: f64 = 22.0;
/// From one row of entries to the next, px.
const ROW: f64 = 17.0;

/// A mark that a legend explains.
#[derive(Clone, Copy, Debug)]
pub(super) enum Mark {
    Curve(Pen),
    /// A shaded stretch of time.
    Shade(&'static str),
    /// The circle the centre of pressure should stay in.
    Circle,
    SupportPolygon,
    /// Where a path begins.
    Start(&'static str),
    /// Where a curve ends because the character fell.
    Fall(&'static str),
    /// The end of one run's spin.
    SpinEnd(&'static str),
    CentreOfMass,
    BelievedGravity,
    /// A bar as long as a length in the figure, px.
    Length(f64),
}

/// Circle around the support centroid.
pub(super) const CIRCLE: Pen = Pen::solid(MARK, 1.3);

impl Mark {
    /// Paints the mark around the point `at`, which is the middle of its left end.
    pub(super) fn sample(self, canvas: &mut Canvas, (x, y): (f64, f64)) {
        let middle = (x + 0.5 * self.width(), y);
        match self {
            Self::Curve(pen) => canvas.line((x, y), (x + SAMPLE, y), pen),
            Self::Shade(fill) => canvas.filled_rect((x, y - 6.0), (SAMPLE, 12.0), fill),
            Self::Circle => canvas.circle(middle, 4.5, CIRCLE),
            Self::SupportPolygon => canvas.line((x, y), (x + SAMPLE, y), OUTLINE),
            Self::Start(fill) => start(canvas, middle, fill),
            Self::Fall(colour) => fall(canvas, middle, colour),
            Self::SpinEnd(fill) => spin_end(canvas, (middle.0, y + 4.0), fill),
            Self::CentreOfMass => canvas.dot(middle, 4.0, INK),
            Self::BelievedGravity => arrow(canvas, (x, y), (x + SAMPLE, y), MARK),
            Self::Length(width) => scale_bar(canvas, (x, y), width),
        }
    }

    fn width(self) -> f64 {
        match self {
            Self::Curve(_) | Self::Shade(_) | Self::SupportPolygon | Self::BelievedGravity => SAMPLE,
            Self::Circle | Self::Start(_) | Self::Fall(_) | Self::SpinEnd(_) | Self::CentreOfMass => 12.0,
            Self::Length(width) => width,
        }
    }
}

/// The first point of a path.
pub(super) fn start(canvas: &mut Canvas, at: (f64, f64), fill: &str) {
    canvas.dot(at, 3.2, fill);
}

/// The last point of a curve that ends in a fall.
pub(super) fn fall(canvas: &mut Canvas, at: (f64, f64), colour: &'static str) {
    canvas.cross(at, 4.5, Pen::solid(colour, 2.2));
}

/// A triangle that points down at `at`.
pub(super) fn spin_end(canvas: &mut Canvas, (x, y): (f64, f64), fill: &str) {
    canvas.filled_polygon(&[(x, y), (x - 4.0, y - 7.0), (x + 4.0, y - 7.0)], fill);
}

/// An arrow with a white edge, which parts it from what it lies on; nothing when both ends are one point.
pub(super) fn arrow(canvas: &mut Canvas, from: (f64, f64), tip: (f64, f64), colour: &'static str) {
    let (dx, dy) = (tip.0 - from.0, tip.1 - from.1);
    let length = libm::hypot(dx, dy);
    if length > 0.0 {
        let (dx, dy) = (dx / length, dy / length);
        let neck = (tip.0 - 7.0 * dx, tip.1 - 7.0 * dy);
        canvas.line(from, neck, Pen::solid("#ffffff", 4.0));
        canvas.line(from, neck, Pen::solid(colour, 1.8));
        let barb = |side: f64| (neck.0 - side * 3.2 * dy, neck.1 + side * 3.2 * dx);
        canvas.filled_polygon(&[tip, barb(1.0), barb(-1.0)], colour);
    }
}

fn scale_bar(canvas: &mut Canvas, (x, y): (f64, f64), width: f64) {
    let pen = Pen::solid(INK, 1.2);
    canvas.line((x, y), (x + width, y), pen);
    for end in [x, x + width] {
        canvas.line((end, y - 4.0), (end, y + 4.0), pen);
    }
}

/// Where each entry begins: as many in a row between `left` and `right` as fit, px below the first row.
fn places((left, right): (f64, f64), entries: &[(Mark, &str)]) -> Vec<(f64, f64)> {
    let (mut x, mut y) = (left, 0.0);
    let place = |&(mark, text): &(Mark, &str)| {
        let width = mark.width() + GAP + width_of(text, LABEL.size);
        if x > left && x + width > right {
            (x, y) = (left, y + ROW);
        }
        let place = (x, y);
        x += width + PITCH;
        place
    };
    entries.iter().map(place).collect()
}

/// Height of all rows, px.
pub(super) fn height(span: (f64, f64), entries: &[(Mark, &str)]) -> f64 {
    places(span, entries).last().map_or(0.0, |place| place.1 + ROW)
}

/// Paints rows of entries between both ends of `span`, the first on height `top`.
pub(super) fn paint(canvas: &mut Canvas, span: (f64, f64), top: f64, entries: &[(Mark, &str)]) {
    for (&(mark, text), (x, y)) in entries.iter().zip(places(span, entries)) {
        mark.sample(canvas, (x, top + y));
        let at = (x + mark.width() + GAP, top + y + 4.0);
        canvas.text(at, Type { colour: INK, ..LABEL }, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_that_do_not_fit_begin_a_row() {
        let entries =
            [(Mark::Circle, "one"), (Mark::Fall("#000000"), "two"), (Mark::SupportPolygon, "three")];
        assert_eq!(height((0.0, 500.0), &entries), ROW);
        assert_eq!(height((0.0, 120.0), &entries), 2.0 * ROW);
        assert_eq!(height((0.0, 120.0), &[]), 0.0);
        // Nothing is too long for a row of its own.
        assert_eq!(height((0.0, 1.0), &entries), 3.0 * ROW);
    }
}
