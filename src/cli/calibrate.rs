//! `otolith calibrate`: a sensor's constants and its mounting.

mod table;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use nalgebra::Vector3;

use super::failure::{Failure, FailureKind};
use super::outputs::{claim, make_folder, write_file};
use super::readings::ReadingsArgs;
use super::show;
use crate::calibrate::{
    CalibrateSettings, CountedTurn, Findings, Guide, Refusal, Step, Up, calibrate, calibration_toml,
    mount_toml,
};
use crate::imu::RestLimits;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};
use table::Report;

/// Files in the result folder.
const MOUNT: &str = "mount.toml";
const CALIBRATION: &str = "calibration.toml";
const REPORT: &str = "calibration.json";

/// Find a sensor's bias, scales and mounting from a rest, a nod (or six poses) and a counted spin.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith calibrate --device serial:/dev/ttyUSB0 --turned-deg 1080 --out my-sensor\n  \
    otolith calibrate --device serial:/dev/ttyUSB0 --poses z,-z,x,-x,y,-y --out my-sensor\n  \
    otolith calibrate my-run.mcap --json\n  \
    otolith calibrate log.txt --log-map configs/logs/turntable-lsm9ds1.toml --forward x --out my-sensor\n  \
    otolith run --device serial:/dev/ttyUSB0 --mount my-sensor/mount.toml --calibration my-sensor/calibration.toml\n\n\
    The motions, in any order, with 3 s of rest before, between and after: a nod (tip the head, or what carries the \
    sensor, forward first and back again, three times) and a spin of the chair by whole turns. Of a live device they are \
    asked for on stderr and recognised as they come; in a file they are found.\n\n\
    Six poses (--poses) take the place of the nod: 3 s of rest with each side of the sensor up. They give bias and \
    scale of each accelerometer axis, which a nod does not; and the mounting, if the sensor sits in or on something whose \
    own sides are those of the head and the order is named.\n\n\
    Every value has a standard uncertainty, 1 sigma: value ± 2 sigma holds the truth in about 95 of 100 cases. \
    What the data do not determine is refused with the reason, and the exit code is 1; the rest is reported and written \
    all the same.")]
pub(super) struct CalibrateArgs {
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Angle the chair was counted to turn in the longest spin: gives the factor on the rate.
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    turned_deg: Option<f64>,
    /// Standard uncertainty of that counting.
    #[arg(long, value_name = "DEG", default_value_t = 1.0, requires = "turned_deg")]
    turned_sigma_deg: f64,
    /// Gravity at the place, m/s².
    #[arg(long, value_name = "M/S2", default_value_t = STANDARD_GRAVITY)]
    gravity: f64,
    /// What the head's up is taken from.
    #[arg(long, value_enum, default_value_t = UpFrom::Spin)]
    up: UpFrom,
    /// Sensor axis that points forward, for want of a nod.
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true,
          value_parser = clap::builder::PossibleValuesParser::new(["x", "-x", "y", "-y", "z", "-z"]))]
    forward: Option<String>,
    /// Six poses instead of a nod: `any`, or the head's directions that are up in them, in the order of time, such as
    /// z,-z,x,-x,y,-y (x is forward, y left, z up).
    #[arg(long, value_name = "any|ORDER", allow_hyphen_values = true, value_parser = parse_poses,
          conflicts_with_all = ["up", "forward"])]
    poses: Option<Poses>,
    /// Largest rate that is taken for a gyro bias at rest; raise it for a gyro with a large one [default: 3.4].
    #[arg(long, value_name = "DEG/S")]
    rest_rate_max_deg_s: Option<f64>,
    /// Write mount.toml, calibration.toml and calibration.json into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite files.
    #[arg(long)]
    force: bool,
}

/// The head's directions that are up in the poses; empty for `any`.
#[derive(Clone, Debug)]
struct Poses(Vec<Vector3<f64>>);

fn parse_poses(text: &str) -> Result<Poses, String> {
    if text == "any" {
        return Ok(Poses(Vec::new()));
    }
    let named: Option<Vec<_>> = text.split(',').map(|name| axis(name.trim())).collect();
    match named {
        Some(named) if named.len() >= 2 => Ok(Poses(named)),
        _ => Err("expected any, or two or more of x, -x, y, -y, z, -z with commas between them".to_owned()),
    }
}

/// What the head's up is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum UpFrom {
    /// The axis of the spin.
    Spin,
    /// The axis of a shake of the head.
    Shake,
    /// Gravity at rest: right as far as the chair is upright and the accelerometer has no offset.
    Gravity,
}

pub(super) fn run(args: &CalibrateArgs, json: bool) -> Result<ExitCode, Failure> {
    let settings = settings(args)?;
    claim(args.out.as_deref(), &[MOUNT, CALIBRATION, REPORT], None, args.force)?;
    let guided = args.readings.is_live()?;
    let mut guide = Guide::new(&settings);
    if guided {
        show::note(&format!("calibrate: {} (Ctrl-C ends with what there is)", guide.prompt()));
    }
    let readings = args.readings.collect(|samples| {
        let before = guide.step();
        let Some(step) = (if guided { guide.look(samples) } else { None }) else { return false };
        let again = if step == before { "not recognised, once more: " } else { "" };
        show::note(&format!("calibrate: {again}{}", guide.prompt()));
        step == Step::Done
    })?;
    let mut findings = calibrate(&readings.samples, &settings);
    findings.notes.splice(0..0, readings.notes.iter().cloned());
    let report = Report { source: &readings.source, protocol: readings.protocol, findings: &findings };
    show::result(&report, json)?;
    if let Some(folder) = &args.out {
        write(folder, &readings.source, &findings, &report)?;
    }
    verdict(&findings, args.out.is_some())?;
    readings.check_whole()?;
    Ok(ExitCode::SUCCESS)
}

fn settings(args: &CalibrateArgs) -> Result<CalibrateSettings, Failure> {
    let check = |flag: &str, value: f64, (low, high): (f64, f64), unit: &str| {
        if value.is_finite() && (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(Failure::usage(format!(
            "{flag} is {value}, allowed is {low} to {high} {unit}\n\nhint: the unit is part of the flag's name"
        )))
    };
    let counted = match args.turned_deg {
        Some(turned_deg) => {
            let angle = check("--turned-deg", turned_deg.abs(), (90.0, 1e6), "deg")? * RAD_PER_DEG;
            let sigma = check("--turned-sigma-deg", args.turned_sigma_deg, (0.0, 90.0), "deg")? * RAD_PER_DEG;
            Some(CountedTurn { angle, sigma })
        }
        None => None,
    };
    let mut rest = RestLimits::default();
    if let Some(limit) = args.rest_rate_max_deg_s {
        let limit = check("--rest-rate-max-deg-s", limit, (0.01, 50.0), "deg/s")?;
        rest.gyro_mean_max_rad_s = limit * RAD_PER_DEG;
    }
    Ok(CalibrateSettings {
        gravity: check("--gravity", args.gravity, (9.7, 9.9), "m/s2")?,
        counted,
        up: match args.up {
            UpFrom::Spin => Up::Spin,
            UpFrom::Shake => Up::Shake,
            UpFrom::Gravity => Up::Gravity,
        },
        forward_imu: args.forward.as_deref().and_then(axis),
        poses: args.poses.as_ref().map(|poses| poses.0.clone()),
        rest,
    })
}

/// The unit vector of an axis by its name, x, -x, y, -y, z or -z.
fn axis(name: &str) -> Option<Vector3<f64>> {
    let (name, sense) = name.strip_prefix('-').map_or((name, 1.0), |name| (name, -1.0));
    let index = ["x", "y", "z"].iter().position(|axis| *axis == name)?;
    Some(Vector3::ith(index, sense))
}

fn write(folder: &Path, source: &str, findings: &Findings, report: &Report) -> Result<(), Failure> {
    make_folder(folder)?;
    if let Some(mount) = &findings.mount {
        write_file(&folder.join(MOUNT), &mount_toml(mount, source))?;
    }
    if let Some(text) = calibration_toml(findings, source) {
        write_file(&folder.join(CALIBRATION), &text)?;
    }
    write_file(&folder.join(REPORT), &serde_json::to_string_pretty(report).unwrap_or_default())
}

/// Fails when something that was asked for is missing.
fn verdict(findings: &Findings, writes: bool) -> Result<(), Failure> {
    let missing: Vec<&Refusal> = findings.refusals.iter().filter(|refusal| refusal.needed).collect();
    let Some(first) = missing.first() else { return Ok(()) };
    let reasons: Vec<String> =
        missing.iter().map(|refusal| format!("{}: {}", refusal.what, refusal.why)).collect();
    let mount = match (findings.mount.is_none(), writes) {
        (true, true) => "; mount.toml was not written",
        _ => "",
    };
    Err(Failure::new(
        FailureKind::Failed,
        format!("not determined{mount}\n  {}\n\nhint: {}", reasons.join("\n  "), first.hint),
    ))
}
