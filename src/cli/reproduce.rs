//! `otolith reproduce`: the standing paper's results, figure by figure and claim by claim.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::console::stop_on_ctrl_c;
use super::demo::new_folder;
use super::failure::{Failure, FailureKind};
use super::outputs::{make_folder, refuse_file, write_file};
use super::show;
use crate::reproduce::{self, Figure, Report, Runs};
use crate::runtime::{CoreSettings, Signals};
use crate::time::{Clock, SystemClock};

/// Reproduce the results of the standing paper: run its experiments, judge its claims, draw its figures.
///
/// Prints the table "claim | paper | otolith | verdict" and writes a figure (SVG) and the numbers behind it (CSV) for
/// each; the stills of Figures 8 and 10 show moments of fig9.csv and fig11.csv. Ends with exit code 0 when every required claim holds, with 1 when one does not.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith reproduce                          everything: 18 minutes of simulated time\n  \
    otolith reproduce --only fig9,fig13 --out figures\n  \
    otolith reproduce --json                   for machines\n  \
    otolith reproduce --sensitivity            how sharp the verdicts are (minutes)\n\n\
    Each experiment is a scenario: `otolith run --scenario spin-30rpm-20s --pace max` runs one alone.")]
pub(super) struct ReproduceArgs {
    /// Only these, separated by commas [default: all].
    #[arg(long, value_name = "FIGURES", value_delimiter = ',', value_parser = figure_parser())]
    only: Vec<Figure>,
    /// Folder for figures, numbers and claims [default: a new folder named by date and time, UTC].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty.
    #[arg(long)]
    force: bool,
    /// Vary what the paper leaves open, and the noise, and print the fall thresholds as Markdown.
    #[arg(long, conflicts_with_all = ["only", "out", "force"])]
    sensitivity: bool,
}

fn figure_parser() -> impl TypedValueParser<Value = Figure> {
    PossibleValuesParser::new(Figure::ALL.map(Figure::name)).try_map(|name| {
        Figure::ALL.into_iter().find(|figure| figure.name() == name).ok_or("not a figure of the paper")
    })
}

pub(super) fn run(args: &ReproduceArgs, json: bool) -> Result<ExitCode, Failure> {
    let signals = Arc::new(Signals::default());
    stop_on_ctrl_c(&signals)?;
    if args.sensitivity {
        return sensitivity(&signals, json);
    }
    let asked = |figure: &Figure| args.only.is_empty() || args.only.contains(figure);
    let figures: Vec<Figure> = Figure::ALL.into_iter().filter(asked).collect();
    let folder = args.out.clone().unwrap_or_else(|| new_folder(Path::new("")));
    let made = !folder.exists();
    claim_folder(&folder, args.force)?;

    let clock = SystemClock::start_now();
    let runs = run_scenarios(&figures, &signals).inspect_err(|_| {
        // Only an empty folder can be removed this way: nothing is lost, and nothing useless left.
        let _kept = if made { std::fs::remove_dir(&folder) } else { Ok(()) };
    })?;
    let claims = figures.iter().flat_map(|figure| figure.claims(&runs)).collect();
    let files = write_all(&folder, reproduce::drawings(&figures, &runs)?)?;
    let report = Report {
        claims,
        parameters: CoreSettings::default(),
        wall_s: clock.now().as_secs_f64(),
        simulated_s: runs.0.values().map(|run| run.simulated_s).sum(),
        files,
    };
    let text = serde_json::to_string_pretty(&report)
        .map_err(|error| Failure::new(FailureKind::Failed, format!("cannot write JSON: {error}")))?;
    write_file(&folder.join("claims.json"), &text)?;
    show::result(&report, json)?;
    if !json {
        show::text(&format!("figures and numbers: {}", folder.display()))?;
    }
    Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::from(FailureKind::Failed as u8) })
}

fn run_scenarios(figures: &[Figure], signals: &Signals) -> Result<Runs, Failure> {
    let plan = reproduce::Plan::of(figures)?;
    let bar = show::progress(Some(plan.simulated_ms()));
    bar.set_message(format!("{} experiments", plan.len()));
    let runs = plan.run(&signals.stop, |ms| bar.inc(ms))?;
    bar.finish_and_clear();
    interrupted(signals)?;
    Ok(runs)
}

fn sensitivity(signals: &Signals, json: bool) -> Result<ExitCode, Failure> {
    let bar = show::progress(Some(reproduce::sensitivity::planned_runs()));
    bar.set_message("runs");
    let study = reproduce::sensitivity::sensitivity(&signals.stop, |runs| bar.inc(runs))?;
    bar.finish_and_clear();
    interrupted(signals)?;
    show::result(&study, json)?;
    Ok(ExitCode::SUCCESS)
}

/// Half of the experiments prove nothing.
fn interrupted(signals: &Signals) -> Result<(), Failure> {
    if signals.stop.load(Ordering::Relaxed) {
        return Err(Failure::new(
            FailureKind::Failed,
            "interrupted: no claim was judged, nothing was written\n\nhint: --only FIGURES takes less time",
        ));
    }
    Ok(())
}

/// Makes the folder before the runs, and makes sure that nothing is overwritten unasked.
fn claim_folder(folder: &Path, force: bool) -> Result<(), Failure> {
    refuse_file(folder)?;
    let occupied = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if occupied && !force {
        return Err(Failure::usage(format!(
            "{}: the folder is not empty\n\nhint: choose another, or overwrite what has the same name with --force",
            folder.display()
        )));
    }
    make_folder(folder)
}

/// Writes every file and gives their paths.
fn write_all(folder: &Path, drawings: Vec<(String, String)>) -> Result<Vec<String>, Failure> {
    let paths = drawings.into_iter().map(|(name, text)| {
        let path = folder.join(name);
        write_file(&path, &text).map(|()| path.display().to_string())
    });
    paths.collect()
}
