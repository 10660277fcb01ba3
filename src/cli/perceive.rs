//! `otolith perceive`: the observer alone, from a CSV of head motion to a CSV of percepts.

mod error;
mod table;

use std::fs::File;
use std::io::BufWriter;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::builder::PossibleValuesParser;
use nalgebra::Vector3;
use serde::Serialize;

pub use error::PerceiveError;
use table::{HeadMotionReader, PerceptRecord};

use crate::units::DEG_PER_RAD;
use crate::vestibular::{
    DEFAULT_PRESET, NewmanObserver, ObserverParameters, PRESET_NAMES, Perceiver, PerceptRow,
};

/// Run the vestibular observer over recorded head motion.
///
/// Reads t_s, omega_{x,y,z}_rad_s and specific_force_{x,y,z}_m_s2 (head axes: x forward, y left, z up; specific force
/// is +9.81 on the up axis at rest) and writes one percept per row at the same times. Between rows the motion is
/// linear. The first row is taken for rest or steady rotation.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:\n  otolith perceive head.csv --out percept.csv\n  \
                        otolith perceive head.csv --out percept.csv --preset merfeld-zupan-2002 --json\n  \
                        otolith perceive head.csv --out percept.csv --initial-gravity-hat 0,4.903,-8.493")]
pub struct PerceiveArgs {
    /// CSV of head motion; columns by name in any order, others are ignored.
    #[arg(value_name = "IN.csv")]
    pub input: PathBuf,
    /// CSV of percepts to write.
    #[arg(long, value_name = "OUT.csv")]
    pub out: PathBuf,
    /// Parameter set of the observer.
    #[arg(long, value_name = "NAME", default_value = DEFAULT_PRESET)]
    #[arg(value_parser = PossibleValuesParser::new(PRESET_NAMES))]
    pub preset: String,
    /// Gravity believed at the start, m/s², head axes, down [default: minus the first row's specific force].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_gravity)]
    pub initial_gravity_hat: Option<Vector3<f64>>,
    /// Overwrite OUT.csv if it exists.
    #[arg(long)]
    pub force: bool,
}

/// What a run of `otolith perceive` comes to; the object of `--json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PerceiveSummary {
    /// The CSV read.
    pub source: String,
    /// The CSV written.
    pub out: String,
    /// Parameter set used.
    pub preset: String,
    /// Rows read, which is rows written.
    pub rows: u64,
    /// Time from the first row to the last, s.
    pub duration_s: f64,
    /// Largest angle between believed gravity and gravity carried along by the angular velocity, degrees.
    pub peak_gravity_tilt_deg: f64,
    /// Time of that peak as the file counts it, s.
    pub peak_gravity_tilt_at_s: f64,
    /// The same angle in the last row, degrees.
    pub final_gravity_tilt_deg: f64,
    /// Largest believed angular speed, rad/s.
    pub peak_omega_hat_rad_s: f64,
}

/// Runs the observer over `args.input` and writes `args.out`, all or nothing.
///
/// # Errors
/// [`PerceiveError`]: an unknown preset, a file that cannot be read or written, an output that exists, or the first
/// bad row of the input with its line and column. In every case no output file is left or changed.
pub fn run(args: &PerceiveArgs) -> Result<PerceiveSummary, PerceiveError> {
    run_until(args, &AtomicBool::new(false))
}

/// [`run`], given up as soon as `stop` is set.
///
/// # Errors
/// As [`run`], and [`PerceiveError::Interrupted`].
pub fn run_until(args: &PerceiveArgs, stop: &AtomicBool) -> Result<PerceiveSummary, PerceiveError> {
    let parameters = ObserverParameters::preset(&args.preset)
        .ok_or_else(|| PerceiveError::UnknownPreset { name: args.preset.clone() })?;
    let observer = NewmanObserver::new(parameters)?;
    let mut rows = HeadMotionReader::open(&args.input)?;
    if args.out.exists() && !args.force {
        return Err(PerceiveError::OutputExists { path: args.out.clone() });
    }
    let first = rows.next().ok_or_else(|| PerceiveError::NoRows { path: args.input.clone() })??;
    let gravity_hat = args.initial_gravity_hat.unwrap_or(first.motion.gif_head);
    if !GRAVITY_SIZES.contains(&gravity_hat.norm()) {
        return Err(PerceiveError::NoGravity { path: args.input.clone(), size: gravity_hat.norm() });
    }

    let mut output = WholeFile::create(&args.out)?;
    let (mut perceiver, percept) = Perceiver::start(observer, &first, Some(gravity_hat));
    let mut summary = PerceiveSummary::starting(args, &percept);
    output.write(&percept)?;
    for row in rows {
        let percept = perceiver.step(&row?);
        summary.add(first.t_s, &percept);
        output.write(&percept)?;
        if stop.load(Ordering::Relaxed) {
            return Err(PerceiveError::Interrupted { path: args.out.clone() });
        }
    }
    output.finish()?;
    Ok(summary)
}

/// Sizes of believed gravity that leave it a direction worth following, m/s².
const GRAVITY_SIZES: RangeInclusive<f64> = 1e-3..=1e3;

impl PerceiveSummary {
    fn starting(args: &PerceiveArgs, first: &PerceptRow) -> Self {
        let mut summary = Self {
            source: args.input.display().to_string(),
            out: args.out.display().to_string(),
            preset: args.preset.clone(),
            rows: 0,
            duration_s: 0.0,
            peak_gravity_tilt_deg: 0.0,
            peak_gravity_tilt_at_s: first.t_s,
            final_gravity_tilt_deg: 0.0,
            peak_omega_hat_rad_s: 0.0,
        };
        summary.add(first.t_s, first);
        summary
    }

    fn add(&mut self, start_s: f64, percept: &PerceptRow) {
        let tilt_deg = percept.gravity_tilt * DEG_PER_RAD;
        self.rows += 1;
        self.duration_s = percept.t_s - start_s;
        self.final_gravity_tilt_deg = tilt_deg;
        self.peak_omega_hat_rad_s = self.peak_omega_hat_rad_s.max(percept.perception.omega_head.norm());
        if tilt_deg > self.peak_gravity_tilt_deg {
            self.peak_gravity_tilt_deg = tilt_deg;
            self.peak_gravity_tilt_at_s = percept.t_s;
        }
    }
}

impl std::fmt::Display for PerceiveSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "rows                 {}", self.rows)?;
        writeln!(f, "duration             {:.3} s", self.duration_s)?;
        writeln!(f, "preset               {}", self.preset)?;
        let (tilt, at) = (self.peak_gravity_tilt_deg, self.peak_gravity_tilt_at_s);
        writeln!(f, "peak gravity tilt    {tilt:.2} deg at {at:.3} s")?;
        writeln!(f, "final gravity tilt   {:.2} deg", self.final_gravity_tilt_deg)?;
        writeln!(f, "peak omega hat       {:.4} rad/s", self.peak_omega_hat_rad_s)?;
        write!(f, "written              {}", self.out)
    }
}

/// Where the output stands until it is complete.
pub(super) fn partial(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.partial", std::process::id()))
}

/// A CSV that appears under its name only when it is complete.
struct WholeFile {
    path: PathBuf,
    partial: PathBuf,
    /// `None` once finished.
    writer: Option<csv::Writer<BufWriter<File>>>,
}

impl WholeFile {
    /// Starts a file beside `path`: renaming is atomic only within a folder's file system.
    fn create(path: &Path) -> Result<Self, PerceiveError> {
        let partial = partial(path);
        let file = File::create(&partial)
            .map_err(|source| PerceiveError::Write { path: path.to_path_buf(), source })?;
        let writer = Some(csv::Writer::from_writer(BufWriter::new(file)));
        Ok(Self { path: path.to_path_buf(), partial, writer })
    }

    fn write(&mut self, percept: &PerceptRow) -> Result<(), PerceiveError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        let written = writer.serialize(PerceptRecord::from(percept));
        written.map_err(|error| PerceiveError::Write { path: self.path.clone(), source: error.into() })
    }

    fn finish(mut self) -> Result<(), PerceiveError> {
        let flushed = self.writer.as_mut().map_or(Ok(()), |writer| writer.flush());
        let renamed = flushed.and_then(|()| std::fs::rename(&self.partial, &self.path));
        renamed.map_err(|source| PerceiveError::Write { path: self.path.clone(), source })?;
        self.writer = None;
        Ok(())
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if self.writer.take().is_some() {
            // Nothing more can be done about a partial file that will not go.
            let _ = std::fs::remove_file(&self.partial);
        }
    }
}

/// Reads `X,Y,Z`, m/s².
fn parse_gravity(text: &str) -> Result<Vector3<f64>, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|number| number.trim().parse::<f64>().map_err(|_| format!("`{number}` is not a number")))
        .collect::<Result<_, _>>()?;
    match numbers.as_slice() {
        [x, y, z] if numbers.iter().all(|number| number.is_finite()) => Ok(Vector3::new(*x, *y, *z)),
        [_, _, _] => Err("expected finite numbers".to_owned()),
        _ => Err(format!("expected three numbers X,Y,Z in m/s², got {}", numbers.len())),
    }
}

#[cfg(test)]
mod tests;
