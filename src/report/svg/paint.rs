//! Writing SVG elements, and nothing about what they mean.

use std::fmt::Write as _;

/// Ink of one line: colour, width in px and dash pattern (empty: solid).
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) colour: &'static str,
    pub(super) width: f64,
    pub(super) dash: &'static str,
}

impl Pen {
    pub(super) const fn solid(colour: &'static str, width: f64) -> Self {
        Self { colour, width, dash: "" }
    }

    fn attributes(&self) -> String {
        let dash = if self.dash.is_empty() { "" } else { &format!(" stroke-dasharray=\"{}\"", self.dash) };
        format!("fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{dash}", self.colour, number(self.width))
    }
}

/// Which point of a text its position is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// Look of a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Type {
    pub(super) size: f64,
    pub(super) colour: &'static str,
    pub(super) bold: bool,
    pub(super) anchor: Anchor,
}

/// What a text says, with one subscript in it or none, and after the subscript a space.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Words<'a> {
    pub(super) before: &'a str,
    pub(super) subscript: &'a str,
    pub(super) after: &'a str,
}

impl<'a> From<&'a str> for Words<'a> {
    fn from(before: &'a str) -> Self {
        Self { before, ..Self::default() }
    }
}

impl<'a> From<&'a String> for Words<'a> {
    fn from(before: &'a String) -> Self {
        before.as_str().into()
    }
}

impl Words<'_> {
    /// The words as content of a text element of `size` px.
    fn content(&self, size: f64) -> String {
        let before = escaped(self.before);
        if self.subscript.is_empty() {
            return before;
        }
        // A space at the beginning of a tspan is not shown everywhere, a shift is.
        let (drop, small, space) = (number(0.27 * size), number(0.78 * size), number(0.28 * size));
        let (subscript, after) = (escaped(self.subscript), escaped(self.after));
        format!(
            "{before}<tspan dy=\"{drop}\" font-size=\"{small}\">{subscript}</tspan>\
             <tspan dx=\"{space}\" dy=\"-{drop}\">{after}</tspan>"
        )
    }
}

/// Width of `text` at `size` px in Helvetica, px; other letters than Latin ones count as an average one.
pub(super) fn width_of(text: &str, size: f64) -> f64 {
    let share = |letter: char| match letter {
        'i' | 'j' | 'l' | '\'' => 0.222,
        'f' | 't' | 'I' | ' ' | '.' | ',' | ':' | ';' | '/' => 0.278,
        'r' | '(' | ')' | '-' => 0.333,
        'c' | 'k' | 's' | 'v' | 'x' | 'y' | 'z' | 'J' => 0.5,
        'm' | 'M' => 0.833,
        'W' | '%' | '\u{2026}' => 0.95,
        wide if wide == 'w' || wide.is_uppercase() => 0.72,
        _ => 0.556,
    };
    size * text.chars().map(share).sum::<f64>()
}

/// An SVG document in the making. Positions in px from the top left corner.
#[derive(Debug)]
pub(super) struct Canvas {
    out: String,
    clips: usize,
}

impl Canvas {
    /// A white page. `title` and `description` are for screen readers and file managers.
    pub(super) fn new(width: f64, height: f64, title: &str, description: &str) -> Self {
        let (width, height) = (number(width), number(height));
        let mut out = String::new();
        let _ = write!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" \
             font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\">\n\
             <title>{}</title>\n<desc>{}</desc>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n",
            escaped(title),
            escaped(description)
        );
        Self { out, clips: 0 }
    }

    pub(super) fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), pen: Pen) {
        let _ = writeln!(
            self.out,
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {}/>",
            number(from.0),
            number(from.1),
            number(to.0),
            number(to.1),
            pen.attributes()
        );
    }

    pub(super) fn filled_rect(&mut self, corner: (f64, f64), size: (f64, f64), fill: &str) {
        self.rect(corner, size, &format!("fill=\"{fill}\""));
    }

    pub(super) fn framed_rect(&mut self, corner: (f64, f64), size: (f64, f64), pen: Pen) {
        self.rect(corner, size, &pen.attributes());
    }

    fn rect(&mut self, corner: (f64, f64), size: (f64, f64), attributes: &str) {
        let _ = writeln!(
            self.out,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {attributes}/>",
            number(corner.0),
            number(corner.1),
            number(size.0),
            number(size.1)
        );
    }

    /// A line with round ends.
    pub(super) fn limb(&mut self, from: (f64, f64), to: (f64, f64), pen: Pen) {
        self.through("polyline", &[from, to], &format!("stroke-linecap=\"round\" {}", pen.attributes()));
    }

    /// A line through `points`; nothing for fewer than two.
    pub(super) fn polyline(&mut self, points: &[(f64, f64)], pen: Pen) {
        self.through("polyline", points, &format!("stroke-linejoin=\"round\" {}", pen.attributes()));
    }

    pub(super) fn polygon(&mut self, points: &[(f64, f64)], pen: Pen) {
        self.through("polygon", points, &pen.attributes());
    }

    pub(super) fn filled_polygon(&mut self, points: &[(f64, f64)], fill: &str) {
        self.through("polygon", points, &format!("fill=\"{fill}\""));
    }

    fn through(&mut self, element: &str, points: &[(f64, f64)], attributes: &str) {
        if points.len() < 2 {
            return;
        }
        let _ = write!(self.out, "<{element} {attributes} points=\"");
        for (index, (x, y)) in points.iter().enumerate() {
            let gap = if index == 0 { "" } else { " " };
            let _ = write!(self.out, "{gap}{},{}", number(*x), number(*y));
        }
        self.out.push_str("\"/>\n");
    }

    pub(super) fn circle(&mut self, centre: (f64, f64), radius: f64, pen: Pen) {
        self.disc(centre, radius, &pen.attributes());
    }

    pub(super) fn dot(&mut self, centre: (f64, f64), radius: f64, fill: &str) {
        self.disc(centre, radius, &format!("fill=\"{fill}\" stroke=\"#ffffff\" stroke-width=\"0.8\""));
    }

    fn disc(&mut self, centre: (f64, f64), radius: f64, attributes: &str) {
        let (x, y, radius) = (number(centre.0), number(centre.1), number(radius));
        let _ = writeln!(self.out, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" {attributes}/>");
    }

    /// A diagonal cross.
    pub(super) fn cross(&mut self, centre: (f64, f64), arm: f64, pen: Pen) {
        let (x, y) = centre;
        self.line((x - arm, y - arm), (x + arm, y + arm), pen);
        self.line((x - arm, y + arm), (x + arm, y - arm), pen);
    }

    pub(super) fn text<'a>(&mut self, at: (f64, f64), look: Type, words: impl Into<Words<'a>>) {
        self.text_with(at, look, words.into(), "");
    }

    /// Text that stays readable on top of a curve.
    pub(super) fn text_with_halo<'a>(&mut self, at: (f64, f64), look: Type, words: impl Into<Words<'a>>) {
        let halo = " stroke=\"#ffffff\" stroke-width=\"3\" stroke-linejoin=\"round\" paint-order=\"stroke\"";
        self.text_with(at, look, words.into(), halo);
    }

    /// Text that reads from bottom to top.
    pub(super) fn text_upwards<'a>(&mut self, at: (f64, f64), look: Type, words: impl Into<Words<'a>>) {
        let turn = format!(" transform=\"rotate(-90 {} {})\"", number(at.0), number(at.1));
        self.text_with(at, look, words.into(), &turn);
    }

    fn text_with(&mut self, at: (f64, f64), look: Type, words: Words, more: &str) {
        let weight = if look.bold { " font-weight=\"bold\"" } else { "" };
        let _ = writeln!(
            self.out,
            "<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\" text-anchor=\"{}\"{weight}{more}>{}</text>",
            number(at.0),
            number(at.1),
            number(look.size),
            look.colour,
            look.anchor.name(),
            words.content(look.size)
        );
    }

    /// Paints inside a rectangle only.
    pub(super) fn clipped(&mut self, corner: (f64, f64), size: (f64, f64), paint: impl FnOnce(&mut Self)) {
        let id = self.clips;
        self.clips += 1;
        let _ = writeln!(self.out, "<clipPath id=\"clip{id}\">");
        self.rect(corner, size, "fill=\"#000000\"");
        let _ = writeln!(self.out, "</clipPath>\n<g clip-path=\"url(#clip{id})\">");
        paint(self);
        self.out.push_str("</g>\n");
    }
}

/// A coordinate with at most two decimals; what is not finite becomes 0, since SVG has no word for it.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return "0".into();
    }
    let rounded = (value * 100.0).round() / 100.0 + 0.0;
    format!("{rounded}")
}

/// `text` as XML character data and attribute value; control characters, which XML 1.0 forbids, become spaces.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            control if control.is_control() || matches!(control, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_always_valid() {
        assert_eq!(number(1.005), "1");
        assert_eq!(number(-0.001), "0");
        assert_eq!(number(12.3456), "12.35");
        assert_eq!(number(f64::NAN), "0");
    }

    #[test]
    fn a_subscript_is_lowered_and_the_rest_raised_again() {
        let words = Words { before: "\u{3b8}", subscript: "a<b", after: "(deg)" };
        let expected = "\u{3b8}<tspan dy=\"2.7\" font-size=\"7.8\">a&lt;b</tspan>\
                        <tspan dx=\"2.8\" dy=\"-2.7\">(deg)</tspan>";
        assert_eq!(words.content(10.0), expected);
        assert_eq!(Words::from("a & b").content(10.0), "a &amp; b");
    }

    #[test]
    fn text_cannot_break_the_document() {
        assert_eq!(escaped("a<b>&\"c\"\u{7}'"), "a&lt;b&gt;&amp;&quot;c&quot; &apos;");
    }
}
