//! Several characters or runs over each other: sway, tilt, paths of CoM and CoP after the stop.
//!
//! The panels are those of figures 9 and 11 to 13 of "Motion Sickness Simulation Based on Sensorimotor Control".

use super::axis::{Plot, Scale, Ticks, padded_range};
use super::legend::{self, Mark};
use super::paint::{Canvas, Words};
use super::subject::{Angle, Position, Subject};
use super::time_panel::{Causes, FallMark, Panel};
use super::{FAINT, LEFT, Look, RIGHT, SPIN, WIDTH, header, lettered_heading, maps};
use crate::report::trace::{Character, Trace};
use crate::report::{Analysis, Window};

/// Width of a panel and side of a map, px.
const SIDE: f64 = 300.0;
/// Left edges of both columns, px.
const COLUMNS: [f64; 2] = [LEFT, RIGHT - SIDE];
const LEGEND: f64 = 64.0;
/// From the last row of the legend to the first panels: a heading, and above the frame the ends of spins.
const TO_PANELS: f64 = 27.0;
/// From a heading to the frame below it.
const HEADING: f64 = 14.0;
const PANEL_HEIGHT: f64 = 190.0;
/// From the bottom of a frame over its axis to the top of the next frame.
const TO_NEXT: f64 = 70.0;
const TIMES_WANTED: usize = 6;
const VALUES_WANTED: usize = 6;
/// The upright axes reach at least this far, deg.
const LEAST_DEG: f64 = 0.5;
/// Where the upright axes end at the latest when only a falling run goes further, deg.
const MOST_SWAY_DEG: f64 = 12.0;
const MOST_TILT_DEG: f64 = 10.0;
/// Spins and pushes that begin and end this near to each other are the same in all runs, s.
const SAME_S: f64 = 0.1;

/// A figure that compares runs or the characters of one run.
#[derive(Clone, Debug)]
pub struct Comparison<'a> {
    /// First line.
    pub title: &'a str,
    /// Second line: parameters and settings.
    pub subtitle: &'a str,
    /// What is compared, in the order of the legend. None gives empty axes.
    pub runs: &'a [ComparedRun<'a>],
    /// Corners of the support polygon minus its centroid, turntable axes x and y, m; empty to leave it out.
    pub support_polygon: &'a [[f64; 2]],
    /// Whether the paths after the stop are shown below the two angles.
    pub maps: bool,
}

/// One curve in each panel of a [`Comparison`].
#[derive(Clone, Copy, Debug)]
pub struct ComparedRun<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// The run.
    pub trace: &'a Trace,
    /// What was found in `trace`.
    pub analysis: &'a Analysis,
    /// Which of its characters.
    pub character: Character,
    /// Colour and dashes, different for each run.
    pub look: Look,
}

impl<'a> ComparedRun<'a> {
    fn subject(&self) -> Subject<'a> {
        let Self { trace, analysis, character, .. } = *self;
        Subject { trace, analysis, character, pen: self.look.pen() }
    }
}

/// Draws the comparison as one SVG document.
///
/// The same arguments give the same bytes. A curve ends with a cross where its character falls. The angles' axes end
/// at 12 and 10 deg when only a falling run goes further. Spins that all runs share are shaded; otherwise a triangle in
/// each run's colour marks the end of each of its spins.
pub fn render(comparison: &Comparison) -> String {
    let mut subjects: Vec<Subject> = comparison.runs.iter().map(ComparedRun::subject).collect();
    // Dashes over solid lines, so that curves that coincide all show.
    subjects.sort_by_key(|subject| !subject.pen.dash.is_empty());
    let causes = causes(&subjects);
    let curve_entries = curve_entries(comparison, &subjects, &causes);
    let map_entries = map_entries(comparison);
    let maps_legend = LEGEND + legend::height((LEFT, RIGHT), &curve_entries);
    let panels_top = maps_legend + legend::height((LEFT, RIGHT), &map_entries) + TO_PANELS;
    let maps_top = panels_top + PANEL_HEIGHT + TO_NEXT;
    let frames_end = if comparison.maps { maps_top + SIDE } else { panels_top + PANEL_HEIGHT };

    let labels: Vec<&str> = comparison.runs.iter().map(|run| run.label).collect();
    let mut canvas = Canvas::new(WIDTH, frames_end + 46.0, comparison.title, &labels.join("; "));
    header(&mut canvas, comparison.title, comparison.subtitle);
    legend::paint(&mut canvas, (LEFT, RIGHT), LEGEND, &curve_entries);
    legend::paint(&mut canvas, (LEFT, RIGHT), maps_legend, &map_entries);
    angles(&mut canvas, panels_top, &subjects, &causes);
    if comparison.maps {
        let beginning = subjects.first().map_or("stop", |first| maps::beginning(&first.analysis.windows));
        let panels: [(&str, &str, Position); 2] = [("c", "CoM", |row| row.com), ("d", "CoP", |row| row.cop)];
        for ((letter, what, position), left) in panels.into_iter().zip(COLUMNS) {
            maps::map(&mut canvas, ((left, maps_top), SIDE), &subjects, comparison.support_polygon, position);
            let heading = format!("{what} after the {beginning}, seen from above");
            lettered_heading(&mut canvas, (left, maps_top - HEADING + 5.0), letter, &heading);
        }
    }
    canvas.finish()
}

/// The two panels of angles over time.
fn angles(canvas: &mut Canvas, top: f64, subjects: &[Subject], causes: &Causes) {
    let spans = || subjects.iter().filter_map(|subject| subject.trace.span_s());
    let start_s = spans().map(|span| span.0).reduce(f64::min).unwrap_or(0.0);
    let end_s = spans().map(|span| span.1).reduce(f64::max).unwrap_or(1.0).max(start_s + 1e-3);
    let times = Ticks::new(start_s, end_s, TIMES_WANTED);
    let panels: [(&str, &str, &str, Angle, f64); 2] = [
        ("a", "CoM sway angle", "CoM", |row| row.com_sway, MOST_SWAY_DEG),
        ("b", "tilt of believed gravity against gravity", "\u{11d}", |row| row.gravity_tilt, MOST_TILT_DEG),
    ];
    for ((letter, heading, subscript, angle, most_deg), left) in panels.into_iter().zip(COLUMNS) {
        let label = Words { before: "\u{3b8}", subscript, after: "(deg)" };
        let curves = subjects.iter().map(|subject| (subject.angle_over_time(angle), subject.pen)).collect();
        let text = |time_s: f64| Some(format!("falls at {time_s:.1} s"));
        let falls = subjects.iter().filter_map(|subject| FallMark::of(subject, Some(angle), text)).collect();
        let panel = Panel { label, curves, falls };
        let range = (0.0, upper_end(&panel, subjects, most_deg));
        let plot = Plot {
            x: Scale { data: (start_s, end_s), px: (left, left + SIDE) },
            y: Scale { data: range, px: (top + PANEL_HEIGHT, top) },
        };
        let values = Ticks::new(range.0, range.1, VALUES_WANTED);
        panel.paint(canvas, &plot, causes, (&times, &values), Some("time (s)"));
        lettered_heading(canvas, (left, top - HEADING), letter, heading);
    }
}

/// Where the upright axis ends, deg: beyond all curves, but when only falling ones go past `most_deg`, there.
fn upper_end(panel: &Panel, subjects: &[Subject], most_deg: f64) -> f64 {
    let standing = panel.curves.iter().zip(subjects).filter(|(_, subject)| subject.fall().is_none());
    let standing = standing.flat_map(|((pieces, _), _)| pieces.iter().flatten()).map(|point| point.1);
    let highest = |values: &mut dyn Iterator<Item = f64>| padded_range(values, LEAST_DEG, VALUES_WANTED).1;
    highest(&mut panel.values()).min(most_deg.max(highest(&mut standing.into_iter())))
}

/// What all runs share, and the ends of the spins when they do not share those.
fn causes(subjects: &[Subject]) -> Causes {
    let Some((first, others)) = subjects.split_first() else {
        return Causes::default();
    };
    let mut causes = Causes::of(&first.analysis.windows);
    let near = |a: f64, b: f64| (a - b).abs() < SAME_S;
    let same_spins = |spins: &[Window]| {
        spins.len() == causes.spins.len()
            && spins
                .iter()
                .zip(&causes.spins)
                .all(|(a, b)| near(a.start_s, b.start_s) && near(a.end_s, b.end_s))
    };
    if !others.iter().all(|other| same_spins(&other.analysis.windows.in_spin)) {
        causes.spins.clear();
        causes.spin_ends = subjects.iter().flat_map(spin_ends).collect();
    }
    let same_push = |other: &Subject| match (causes.push_end_s, other.analysis.windows.push_end_s) {
        (Some(a), Some(b)) => near(a, b),
        (a, b) => a == b,
    };
    if !others.iter().all(same_push) {
        causes.push_end_s = None;
    }
    causes
}

fn spin_ends<'a>(subject: &'a Subject) -> impl Iterator<Item = (f64, &'static str)> + use<'a> {
    let spins = subject.analysis.chair.spins.iter();
    spins.filter_map(|spin| Some((spin.stop_s?, subject.pen.colour)))
}

/// What is seen over time.
fn curve_entries<'a>(
    comparison: &Comparison<'a>,
    subjects: &[Subject],
    causes: &Causes,
) -> Vec<(Mark, &'a str)> {
    let mut entries: Vec<(Mark, &str)> =
        comparison.runs.iter().map(|run| (Mark::Curve(run.look.pen()), run.label)).collect();
    if !causes.spins.is_empty() {
        entries.push((Mark::Shade(SPIN), "platform turns"));
    }
    if !causes.spin_ends.is_empty() {
        entries.push((Mark::SpinEnd(FAINT), "platform stops"));
    }
    if subjects.iter().any(|subject| subject.fall().is_some()) {
        entries.push((Mark::Fall(FAINT), "fall"));
    }
    entries
}

/// What is seen from above.
fn map_entries(comparison: &Comparison) -> Vec<(Mark, &'static str)> {
    let mut entries =
        vec![(Mark::Circle, "5 mm around the support centroid"), (Mark::Start(FAINT), "path begins")];
    if !comparison.support_polygon.is_empty() {
        entries.push((Mark::SupportPolygon, "support polygon"));
    }
    if comparison.maps { entries } else { Vec::new() }
}
