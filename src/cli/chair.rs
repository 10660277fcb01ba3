//! `otolith chair`: what a rotating chair really did.

mod profile;

use std::path::PathBuf;
use std::process::ExitCode;

use serde::Serialize;

use super::failure::{Failure, FailureKind};
use super::outputs::{claim, make_folder, write_file};
use super::readings::ReadingsArgs;
use super::show;
use crate::chair::{ChairReport, ChairSettings, Commanded, survey_chair};
use crate::imu::RestLimits;
use crate::report::Window;
use crate::report::svg::chair::{ChairFigure, render};
use crate::units::STANDARD_GRAVITY;

/// Files in the result folder.
const FIGURE: &str = "chair.svg";
const REPORT: &str = "chair.json";

/// Say what a rotating chair really did: rate, ramps, overshoot, ripple, vibration, axis, drift.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith chair my-run.mcap\n  \
    otolith chair my-run.mcap --commanded-rpm 30 --commanded-ramp-s 1 --out my-chair\n  \
    otolith chair my-run.mcap --commanded profile.csv\n  \
    otolith chair log.txt --log-map configs/logs/turntable-lsm9ds1.toml --json\n  \
    otolith chair --device serial:/dev/ttyUSB0 --duration-s 60\n\n\
    The sensor may be mounted in any way. It should rest for 2 s before and after the spin: that gives bias, noise and \
    ramps. Of several spins the one that turns furthest is taken apart, the others get a row each. Ctrl-C ends a live one \
    with what there is.\n\n\
    The file of --commanded is a CSV with the columns time_s and rate_deg_s (or rate_rpm), positive to the left: straight \
    lines between its rows, two rows of the same time for a step, at rest before and after.")]
pub(super) struct ChairArgs {
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Rate the chair was told to keep; positive is to the left.
    #[arg(long, value_name = "RPM", allow_hyphen_values = true)]
    commanded_rpm: Option<f64>,
    /// Length of each ramp it was told to make.
    #[arg(long, value_name = "S")]
    commanded_ramp_s: Option<f64>,
    /// Rate the chair was told to have over time: a CSV with time_s and rate_deg_s (or rate_rpm).
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["commanded_rpm", "commanded_ramp_s"])]
    commanded: Option<PathBuf>,
    /// When the time of that file was zero, in the log's time as the report has it [default: where it fits best].
    #[arg(long, value_name = "S", allow_hyphen_values = true, requires = "commanded")]
    commanded_start_s: Option<f64>,
    /// Write chair.svg and chair.json into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite files.
    #[arg(long)]
    force: bool,
}

/// The report with where it comes from; the object of `--json`.
#[derive(Serialize)]
struct Sourced<'a> {
    source: &'a str,
    protocol: &'a str,
    #[serde(flatten)]
    report: &'a ChairReport,
}

impl std::fmt::Display for Sourced<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, protocol {}\n{}", self.source, self.protocol, self.report)
    }
}

pub(super) fn run(args: &ChairArgs, json: bool) -> Result<ExitCode, Failure> {
    let settings = ChairSettings {
        gravity: STANDARD_GRAVITY,
        commanded: Commanded {
            rate_deg_s: nonzero("--commanded-rpm", args.commanded_rpm)?.map(|rpm| rpm * 6.0),
            ramp_s: nonzero("--commanded-ramp-s", args.commanded_ramp_s)?,
        },
        profile: match &args.commanded {
            Some(path) => Some(profile::read(path, args.commanded_start_s)?),
            None => None,
        },
        rest: RestLimits::default(),
    };
    claim(args.out.as_deref(), &[FIGURE, REPORT], None, args.force)?;
    let readings = args.readings.collect(|_| false)?;
    let mut report = survey_chair(&readings.samples, &settings);
    report.notes.splice(0..0, readings.notes.iter().cloned());
    let sourced = Sourced { source: &readings.source, protocol: readings.protocol, report: &report };
    show::result(&sourced, json)?;
    if let Some(folder) = &args.out {
        make_folder(folder)?;
        write_file(&folder.join(FIGURE), &figure(&readings.source, &report))?;
        write_file(&folder.join(REPORT), &serde_json::to_string_pretty(&sourced).unwrap_or_default())?;
    }
    if report.spin.is_none() {
        return Err(Failure::new(
            FailureKind::Failed,
            format!(
                "{}: there is no spin: nowhere does the sensor turn by 90 deg or more in one direction\n\n\
                 hint: `otolith inspect` shows the range of the rates; the unit of a log is in its mapping",
                readings.source
            ),
        ));
    }
    readings.check_whole()?;
    Ok(ExitCode::SUCCESS)
}

fn nonzero(flag: &str, value: Option<f64>) -> Result<Option<f64>, Failure> {
    match value {
        Some(got) if !got.is_finite() || got == 0.0 => Err(Failure::usage(format!(
            "{flag} is {got}, expected a finite number other than 0\n\nhint: leave {flag} out if it is not known"
        ))),
        value => Ok(value),
    }
}

fn figure(source: &str, report: &ChairReport) -> String {
    let plateau = report.spin.as_ref().and_then(|spin| spin.plateau.as_ref());
    let subtitle = plateau.map_or("no plateau".to_owned(), |plateau| {
        format!(
            "plateau {:.2} deg/s ({:.3} rpm), ripple {:.2} deg/s rms",
            plateau.rate_deg_s.value, plateau.rate_rpm, plateau.ripple_rms_deg_s
        )
    });
    render(&ChairFigure {
        title: source,
        subtitle: &subtitle,
        rate: &report.curves.rate,
        plateau: plateau
            .map(|plateau| Window { start_s: plateau.start_s, end_s: plateau.start_s + plateau.duration_s }),
        rate_spectrum: &report.curves.rate_spectrum,
        force_spectrum: &report.curves.force_spectrum,
    })
}
