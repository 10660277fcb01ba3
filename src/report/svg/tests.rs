//! The figures as documents: what they say, and that every word has its place.

use roxmltree::{Document, Node};

use super::chair::{self, ChairFigure};
use super::comparison::{self, ComparedRun, Comparison};
use super::paint::width_of;
use super::rates::{self, Rates};
use super::stills::{self, Still, StillRow, Stills, View};
use super::{Caption, Look, fitted};
use crate::report::tests::{golden, leaning};
use crate::report::trace::{Character, Trace};
use crate::report::{Analysis, Window, svg};

const POLYGON: [[f64; 2]; 4] = [[0.129, 0.13], [-0.129, 0.13], [-0.129, -0.13], [0.129, -0.13]];
const LOOKS: [Look; 3] = [Look::Orange, Look::Green, Look::Black];

fn analysed(trace: Trace) -> (Trace, Analysis) {
    let analysis = Analysis::new(&trace, None);
    (trace, analysis)
}

/// Green of each run, under the labels "run 0", "run 1", ...
fn compared(runs: &[(Trace, Analysis)], maps: bool) -> String {
    let labels = ["run 0", "run 1", "run 2"];
    let runs: Vec<ComparedRun> = runs
        .iter()
        .zip(labels)
        .zip(LOOKS)
        .map(|(((trace, analysis), label), look)| ComparedRun {
            label,
            trace,
            analysis,
            character: Character::Green,
            look,
        })
        .collect();
    let subtitle = "30 rpm; observer seed, dominant time constant 5.7 s; gain set A";
    comparison::render(&Comparison { title: "runs", subtitle, runs: &runs, support_polygon: &POLYGON, maps })
}

fn all_text(node: Node) -> String {
    node.descendants().filter(Node::is_text).filter_map(|part| part.text()).collect()
}

fn texts(figure: &str) -> Vec<String> {
    let document = Document::parse(figure).expect("well-formed XML");
    document.descendants().filter(|node| node.has_tag_name("text")).map(all_text).collect()
}

fn count(figure: &str, text: &str) -> usize {
    texts(figure).iter().filter(|other| *other == text).count()
}

/// A rectangle: left, top, right, bottom, px.
type Area = [f64; 4];

/// The area of a text and what it says.
fn area(node: Node) -> (Area, String) {
    let number = |name: &str| node.attribute(name).unwrap().parse::<f64>().unwrap();
    let (x, y, size, text) = (number("x"), number("y"), number("font-size"), all_text(node));
    let width = width_of(&text, size);
    let before = match node.attribute("text-anchor").unwrap() {
        "start" => 0.0,
        "middle" => 0.5 * width,
        _ => width,
    };
    // What reaches below the line may touch what stands above it.
    let (above, below) = (0.75 * size, 0.1 * size);
    let area = if node.has_attribute("transform") {
        [x - above, y + before - width, x + below, y + before]
    } else {
        [x - before, y - above, x - before + width, y + below]
    };
    (area, text)
}

fn assert_legible(figure: &str) {
    let document = Document::parse(figure).expect("well-formed XML");
    let page = document.root_element();
    let [width, height] =
        ["width", "height"].map(|side| page.attribute(side).unwrap().parse::<f64>().unwrap());
    let areas: Vec<(Area, String)> =
        document.descendants().filter(|node| node.has_tag_name("text")).map(area).collect();
    assert!(!areas.is_empty());
    for (index, (a, text)) in areas.iter().enumerate() {
        assert!(a[0] >= 0.0 && a[1] >= 0.0 && a[2] <= width && a[3] <= height, "{text} leaves the page");
        for (b, other) in &areas[..index] {
            let apart = a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
            assert!(apart, "{text:?} covers {other:?}: {a:?} {b:?}");
        }
    }
    assert!(!figure.contains("NaN") && !figure.contains("inf\""));
}

#[test]
fn long_titles_lose_their_middle() {
    assert_eq!(fitted("replay:short.txt", 16), "replay:short.txt");
    assert_eq!(fitted("replay:/a/long/\u{e9}/path.txt", 12), "repl\u{2026}ath.txt");
}

#[test]
fn the_figure_of_one_run_is_legible() {
    let (trace, analysis) = analysed(leaning(8.0, 4.0, Some(11_000)));
    let caption =
        Caption { title: "mock:chair".into(), subtitle: String::new(), support_polygon: POLYGON.into() };
    assert_legible(&svg::render(&trace, &analysis, &caption));
}

#[test]
fn runs_with_one_spin_share_its_shade() {
    let runs = [leaning(8.0, 1.0, None), leaning(8.05, 0.5, None)].map(analysed);
    let figure = compared(&runs, true);
    assert_legible(&figure);
    for entry in ["run 0", "run 1", "platform turns", "support polygon", "5 mm around the support centroid"] {
        assert_eq!(count(&figure, entry), 1, "{entry}");
    }
    assert_eq!(count(&figure, "platform stops"), 0);
    assert_eq!(figure.matches(super::SPIN).count(), 2 + 1, "two panels and the legend");
    assert_eq!(figure, compared(&runs, true), "the same runs, the same bytes");
}

#[test]
fn spins_of_different_length_end_with_triangles() {
    let runs = [leaning(6.0, 1.0, None), leaning(7.0, 1.0, None), leaning(8.0, 1.0, None)].map(analysed);
    let figure = compared(&runs, false);
    assert_legible(&figure);
    assert_eq!(count(&figure, "platform stops"), 1);
    assert_eq!(count(&figure, "platform turns"), 0);
    assert_eq!(figure.matches("<polygon").count(), 2 * 3 + 1, "two panels and the legend");
    assert_eq!(count(&figure, "x, forward (cm)"), 0, "no maps");
}

#[test]
fn only_a_falling_run_is_cut_off_and_its_end_is_marked() {
    let standing = [leaning(8.0, 5.0, None), leaning(8.0, 1.0, None)].map(analysed);
    let figure = compared(&standing, true);
    assert_eq!((count(&figure, "30"), count(&figure, "fall")), (2, 0), "the axes hold all 30 deg");

    // At the fall 30 deg of sway and 24 deg of tilt.
    let falling = [leaning(8.0, 10.0, Some(11_000)), leaning(8.0, 1.0, None)].map(analysed);
    let figure = compared(&falling, true);
    assert_legible(&figure);
    assert_eq!((count(&figure, "fall"), count(&figure, "falls at 11.0 s")), (1, 2));
    let labels = texts(&figure);
    assert!(["14", "20", "30"].iter().all(|tick| !labels.contains(&(*tick).into())), "{labels:?}");
    // The cross of the sway lies on the upper end of the frame: its four arms are 4.5 px around it.
    let document = Document::parse(&figure).unwrap();
    let frame = document.descendants().filter(|node| node.attribute("stroke") == Some(super::FRAME));
    let top: f64 = frame
        .filter(|node| node.has_tag_name("rect"))
        .map(|node| node.attribute("y").unwrap().parse().unwrap())
        .next()
        .unwrap();
    let arms = document.descendants().filter(|node| {
        let ends = ["y1", "y2"].map(|end| node.attribute(end).and_then(|y| y.parse::<f64>().ok()));
        ends == [Some(top - 4.5), Some(top + 4.5)]
    });
    assert_eq!(arms.count(), 2, "one of each cross's two lines goes down, in two panels");
}

#[test]
fn comparing_nothing_gives_empty_axes() {
    let figure = compared(&[], true);
    assert_legible(&figure);
    assert_eq!(count(&figure, "time (s)"), 2);
    let figure = compared(&[analysed(Trace::new())], true);
    assert_legible(&figure);
}

#[test]
fn golden_runs_fit_their_comparison() {
    let names = ["A_g30_10", "A_g30_15", "A_g30_20"];
    let runs: Option<Vec<Trace>> = names.into_iter().map(|name| golden(name, "A_blue30_15")).collect();
    let Some(runs) = runs else { return };
    let runs: Vec<(Trace, Analysis)> = runs.into_iter().map(analysed).collect();
    let figure = compared(&runs, true);
    assert_legible(&figure);
    assert_eq!(count(&figure, "platform stops"), 1);
}

#[test]
fn peak_and_crossing_of_the_believed_rate_are_named_when_given() {
    let trace = leaning(8.0, 0.0, None);
    let (title, subtitle) = ("rates", "3 rad/s");
    let bare = Rates {
        title,
        subtitle,
        trace: &trace,
        character: Character::Green,
        undershoot: None,
        zero_crossing_s: None,
    };
    let figure = rates::render(&bare);
    assert_legible(&figure);
    assert!(!texts(&figure).iter().any(|text| text.contains(" at ")));
    let figure = rates::render(&Rates { undershoot: Some((8.0, -1.2)), zero_crossing_s: Some(7.6), ..bare });
    assert_legible(&figure);
    assert_eq!(count(&figure, "\u{2212}1.20 rad/s at 8.0 s"), 1);
    assert_eq!(count(&figure, "crosses zero at 7.6 s"), 1);
    assert_legible(&rates::render(&Rates { trace: &Trace::new(), ..bare }));
}

#[test]
fn the_figure_of_a_chair_is_legible_with_and_without_curves() {
    let rate: Vec<(f64, f64)> = (0..9000).map(|i| (f64::from(i) * 0.01, -180.0)).collect();
    let spectrum: Vec<(f64, f64)> = (1..20_000).map(|i| (f64::from(i) * 0.01, 1.0 / f64::from(i))).collect();
    let whole = ChairFigure {
        title: "chair.mcap",
        subtitle: "plateau",
        rate: &rate,
        plateau: Some(Window { start_s: 10.0, end_s: 70.0 }),
        rate_spectrum: &spectrum,
        force_spectrum: &spectrum,
    };
    let figure = chair::render(&whole);
    assert_legible(&figure);
    assert_eq!(count(&figure, "frequency (Hz)"), 2);
    assert!(figure.len() < 200_000, "thinned: {} bytes", figure.len());
    let empty = ChairFigure { rate: &[], plateau: None, rate_spectrum: &[], force_spectrum: &[], ..whole };
    assert_legible(&chair::render(&empty));
}

/// A stick of 1.6 m that leans to the left, on a turntable with the feet off the axis.
fn stick(label: &str, lean: f64) -> Still {
    let (y, z) = (libm::sin(lean), libm::cos(lean));
    let at = |far: f64| [0.3, 0.2 + far * y, far * z];
    Still {
        label: label.into(),
        bones: vec![[at(0.0), at(1.6)]],
        head: at(1.7),
        com: at(0.95),
        support: vec![[0.2, 0.1, 0.0], [0.4, 0.3, 0.0]],
        gravity_hat: [0.0, -9.81 * y, -9.81 * z],
        com_sway_deg: lean.to_degrees(),
    }
}

#[test]
fn stills_show_true_angles_at_the_scale_of_their_bar() {
    let stills = [stick("18.0 s", 0.0), stick("20.0 s", 0.2)];
    let rows = [
        StillRow { label: "with vestibular model", look: Look::Green, stills: &stills },
        StillRow { label: "without", look: Look::Blue, stills: &stills[..1] },
    ];
    let figure = Stills { title: "stills", subtitle: "30 rpm", view: View::Behind, rows: &rows };
    let figure = stills::render(&figure);
    assert_legible(&figure);
    for (text, times) in
        [("18.0 s", 2), ("20.0 s", 1), ("\u{3b8}CoM= 0.0\u{b0}", 2), ("\u{3b8}CoM= 11.5\u{b0}", 1)]
    {
        assert_eq!(count(&figure, text), times, "{text}");
    }
    let document = Document::parse(&figure).unwrap();
    let bar = document
        .descendants()
        .filter(|node| node.attribute("stroke-width") == Some("1.2"))
        .map(|node| ["x1", "x2"].map(|end| node.attribute(end).unwrap().parse::<f64>().unwrap()))
        .map(|[from, to]| to - from)
        .fold(0.0, f64::max);
    let bones: Vec<[f64; 2]> = document
        .descendants()
        .filter(|node| node.has_tag_name("polyline"))
        .map(|node| {
            let numbers = node.attribute("points").unwrap().split([' ', ',']);
            let [x1, y1, x2, y2] = numbers.map(|n| n.parse::<f64>().unwrap()).collect::<Vec<_>>()[..] else {
                panic!("a bone has two ends")
            };
            [x2 - x1, y1 - y2]
        })
        .collect();
    let per_m = bar / 0.5;
    assert!(per_m > 100.0, "1.8 m on about 220 px");
    for ([right, up], lean) in bones.into_iter().zip([0.0, 0.2, 0.0]) {
        // Left is to the left, and coordinates are rounded to 0.01 px.
        assert!((right + per_m * 1.6 * libm::sin(lean)).abs() < 0.1, "{right}");
        assert!((up - per_m * 1.6 * libm::cos(lean)).abs() < 0.1, "{up}");
    }
}

#[test]
fn stills_of_a_lying_body_shrink_until_it_fits() {
    let row: Vec<Still> = ["1 s", "2 s", "3 s", "4 s", "5 s"].map(|label| stick(label, 1.5)).into();
    for view in [View::Side, View::Behind] {
        let rows = [StillRow { label: "green", look: Look::Green, stills: &row }];
        let figure = stills::render(&Stills { title: "lying", subtitle: "", view, rows: &rows });
        assert_legible(&figure);
        let document = Document::parse(&figure).unwrap();
        let points = document.descendants().filter_map(|node| node.attribute("points"));
        for x in points.flat_map(|points| points.split(' ')).map(|point| point.split_once(',').unwrap().0) {
            assert!((super::LEFT..=super::RIGHT).contains(&x.parse::<f64>().unwrap()), "{x}");
        }
    }
}

#[test]
fn no_stills_give_an_empty_page() {
    assert_legible(&stills::render(&Stills { title: "none", subtitle: "", view: View::Side, rows: &[] }));
}
