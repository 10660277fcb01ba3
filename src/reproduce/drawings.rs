//! The figures in the paper's layout, and the numbers behind them.

use super::claims::yaw::Believed;
use super::stills::Moment;
use super::{Experiment, Figure, Runs};
use crate::report::Character;
use crate::report::csv::{self, Curve};
use crate::report::svg::Look;
use crate::report::svg::comparison::{self, ComparedRun, Comparison};
use crate::report::svg::rates::{self, Rates};
use crate::report::svg::stills::{self, Still, StillRow, Stills, View};

/// Part of a motion that is shown in stills when nobody falls, s.
const MOTION_S: f64 = 4.2;
/// What all figures have in common, said in each.
const SETTINGS: &str = "observer (8, 4, 8, \u{2212}4, 1), canals 5.7 s unless said otherwise, gain set A";
/// The same, of figures that show blue's tilt.
const SETTINGS_AND_BLUE: &str = "observer (8, 4, 8, \u{2212}4, 1), canals 5.7 s, gain set A; blue's tilt is of an observer it does not listen to";

/// A file that cannot be made.
pub type DrawingError = ::csv::Error;

/// Name and content of every file of `figures`: one SVG and one CSV for each, three for the motions.
///
/// # Errors
/// The CSV cannot be written, which memory always takes.
pub fn drawings(figures: &[Figure], runs: &Runs) -> Result<Vec<(String, String)>, DrawingError> {
    let mut files = Vec::new();
    for figure in figures {
        match figure {
            Figure::Fig6 => files.extend(fig6(runs)?),
            Figure::Fig9 => {
                files.extend(fig9(runs)?);
                files.extend(fig8(runs));
            }
            Figure::Fig10 => files.extend(fig10(runs)),
            Figure::Fig11 => files.extend(fig11(runs)?),
            Figure::Fig12 | Figure::Fig13 | Figure::Fig14 => files.extend(three(*figure, runs)?),
            Figure::Motions => files.extend(motions(runs)?),
        }
    }
    Ok(files)
}

type Files = Vec<(String, String)>;

fn fig6(runs: &Runs) -> Result<Files, DrawingError> {
    let Some(run) = runs.of("constant-yaw") else { return Ok(Files::new()) };
    let believed = Believed::of(runs).unwrap_or_default();
    let svg = rates::render(&Rates {
        title: "Figure 6: what a constant yaw rate of 3 rad/s feels like",
        subtitle: "observer (8, 4, 8, \u{2212}4, 1), canals 5.7 s, adaptation 80 s; the upright head of the blue character",
        trace: &run.trace,
        character: Character::Blue,
        undershoot: believed.undershoot,
        zero_crossing_s: believed.crossing.map(|(t, _)| t),
    });
    let curves = [Curve { run: "constant-yaw", trace: &run.trace, character: Character::Blue }];
    Ok(vec![("fig6.svg".into(), svg), ("fig6.csv".into(), numbers(&curves)?)])
}

/// Both characters of one run over each other.
fn with_and_without(
    name: &str,
    scenario: &str,
    title: &str,
    maps: bool,
    runs: &Runs,
) -> Result<Files, DrawingError> {
    let Some(run) = runs.of(scenario) else { return Ok(Files::new()) };
    let compared = [
        ("with vestibular model", Character::Green, Look::Green),
        ("without vestibular model", Character::Blue, Look::Blue),
    ]
    .map(|(label, character, look)| ComparedRun {
        label,
        trace: &run.trace,
        analysis: &run.analysis,
        character,
        look,
    });
    let svg = comparison::render(&Comparison {
        title,
        subtitle: SETTINGS_AND_BLUE,
        runs: &compared,
        support_polygon: &run.core.green().support_outline(),
        maps,
    });
    let curves = [Character::Green, Character::Blue].map(|character| Curve {
        run: scenario,
        trace: &run.trace,
        character,
    });
    Ok(vec![(format!("{name}.svg"), svg), (format!("{name}.csv"), numbers(&curves)?)])
}

fn fig9(runs: &Runs) -> Result<Files, DrawingError> {
    with_and_without(
        "fig9",
        "spin-30rpm-15s",
        "Figure 9: standing on a platform rotating at 30 rpm for 15 s",
        true,
        runs,
    )
}

fn fig11(runs: &Runs) -> Result<Files, DrawingError> {
    with_and_without(
        "fig11",
        "push-4ns",
        "Figure 11: a push of 4 N s (40 N, 0.1 s) on the thorax at 2 s",
        false,
        runs,
    )
}

/// Three runs of the green character over each other.
fn three(figure: Figure, runs: &Runs) -> Result<Files, DrawingError> {
    let (title, scenarios): (_, [(&str, &str, Look); 3]) = match figure {
        Figure::Fig12 => (
            "Figure 12: rotating for 15 s at different speeds, with vestibular model",
            [
                ("10 rpm", "spin-10rpm-15s", Look::Orange),
                ("20 rpm", "spin-20rpm-15s", Look::Black),
                ("30 rpm", "spin-30rpm-15s", Look::Green),
            ],
        ),
        Figure::Fig13 => (
            "Figure 13: rotating at 30 rpm for different durations, with vestibular model",
            [
                ("10 s", "spin-30rpm-10s", Look::Orange),
                ("15 s", "spin-30rpm-15s", Look::Green),
                ("20 s", "spin-30rpm-20s", Look::Black),
            ],
        ),
        _ => (
            "Figure 14: different susceptibility: canals of 2.85, 5.7 and 11.4 s, 30 rpm for 17 s",
            [
                ("2.85 s", "spin-30rpm-17s-tau-2-85", Look::Black),
                ("5.7 s", "spin-30rpm-17s", Look::Green),
                ("11.4 s", "spin-30rpm-17s-tau-11-4", Look::Orange),
            ],
        ),
    };
    let found: Vec<(&str, &str, Look, &Experiment)> = scenarios
        .iter()
        .filter_map(|&(label, scenario, look)| Some((label, scenario, look, runs.of(scenario)?)))
        .collect();
    let compared: Vec<ComparedRun> = found
        .iter()
        .map(|&(label, _, look, run)| ComparedRun {
            label,
            trace: &run.trace,
            analysis: &run.analysis,
            character: Character::Green,
            look,
        })
        .collect();
    let Some((.., first)) = found.first() else { return Ok(Files::new()) };
    let polygon = first.core.green().support_outline();
    let svg = comparison::render(&Comparison {
        title,
        subtitle: SETTINGS,
        runs: &compared,
        support_polygon: &polygon,
        maps: true,
    });
    let curves: Vec<Curve> = found
        .iter()
        .map(|(_, scenario, _, run)| Curve { run: scenario, trace: &run.trace, character: Character::Green })
        .collect();
    let name = figure.name();
    Ok(vec![(format!("{name}.svg"), svg), (format!("{name}.csv"), numbers(&curves)?)])
}

/// Green above blue at some moments.
fn pair_of_rows(run: &Experiment, times_s: &[f64], title: &str, subtitle: &str, view: View) -> String {
    let moments: Vec<&Moment> = times_s.iter().filter_map(|&time_s| run.stills.at(time_s)).collect();
    let green: Vec<Still> = moments.iter().map(|moment| moment.green.clone()).collect();
    // Its balance does not listen to what blue's observer believes.
    let deaf = |still: &Still| Still { gravity_hat: [0.0; 3], ..still.clone() };
    let blue: Vec<Still> = moments.iter().map(|moment| deaf(&moment.blue)).collect();
    let rows = [
        StillRow { label: "with vestibular model", look: Look::Green, stills: &green },
        StillRow { label: "without vestibular model", look: Look::Blue, stills: &blue },
    ];
    stills::render(&Stills { title, subtitle, view, rows: &rows })
}

/// The stills of Figure 8: the sway after the stop.
fn fig8(runs: &Runs) -> Option<(String, String)> {
    let run = runs.of("spin-30rpm-15s")?;
    let stop_s = run.analysis.windows.stop_s?;
    let times_s: Vec<f64> = (0..6).map(|n| stop_s + 1.0 * f64::from(n)).collect();
    let title = "Figure 8: after 30 rpm for 15 s, from the stop on";
    Some(("fig8.svg".into(), pair_of_rows(run, &times_s, title, SETTINGS, View::Behind)))
}

fn fig10(runs: &Runs) -> Option<(String, String)> {
    let run = runs.of("push-4ns")?;
    let times_s: Vec<f64> = [1.9, 2.1, 2.2, 2.3, 2.5, 3.0].to_vec();
    let title = "Figure 10: a push of 4 N s on the thorax at 2 s";
    Some(("fig10.svg".into(), pair_of_rows(run, &times_s, title, SETTINGS, View::Side)))
}

/// Stills and curves of each motion.
fn motions(runs: &Runs) -> Result<Files, DrawingError> {
    let mut files = Files::new();
    for (name, title) in [
        ("motion-reach", "Reaching after 30 rpm for 15 s"),
        ("motion-drink", "Drinking after 30 rpm for 15 s"),
        ("motion-stand-up", "Standing up from a squat after 30 rpm for 15 s"),
    ] {
        let Some(run) = runs.of(name) else { continue };
        files.extend(with_and_without(name, name, title, true, runs)?);
        let stop_s = run.analysis.windows.stop_s.unwrap_or_default();
        // A lying body is no part of the motion.
        let end_s = run.analysis.green.fell_at_s.unwrap_or(stop_s + MOTION_S);
        let step_s = (end_s - stop_s) / 6.0;
        let times_s: Vec<f64> = (0..7).map(|n| stop_s + step_s * f64::from(n)).collect();
        files.push((format!("{name}-stills.svg"), pair_of_rows(run, &times_s, title, SETTINGS, View::Side)));
    }
    Ok(files)
}

fn numbers(curves: &[Curve<'_>]) -> Result<String, DrawingError> {
    let mut bytes = Vec::new();
    csv::write(&mut bytes, curves.iter().copied())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
