//! `otolith replay`: a recording once more, from its own configuration, tick by tick.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::Value;

use super::failure::{Failure, FailureKind};
use super::outputs::Outputs;
use super::session::build_fingerprint;
use super::show;
use crate::character::{CharacterModel, STANDING_MJCF};
use crate::config::Config;
use crate::record::{DamageReport, RecordError, Recording, VerifyReport, verify};
use crate::report::{
    Analysis, Caption, LinkCounters, RunFacts, Summary, TickTimes, TimingSummary, Trace, svg, table,
};
use crate::runtime::Core;
use crate::time::{Clock, SystemClock, TICK_S};

/// Run a recording again from its own configuration and its own tick inputs.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith replay run.mcap --out again\n  \
    otolith replay run.mcap --verify --json\n\n\
    A damaged recording is replayed as far as it is good; its exit code is 3.")]
pub(super) struct ReplayArgs {
    /// The recording.
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Compare every bit of every tick with what was recorded.
    #[arg(long)]
    verify: bool,
    /// Write figure.svg and summary.json into this folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite files.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &ReplayArgs, json: bool) -> Result<ExitCode, Failure> {
    let name = args.file.display().to_string();
    let recording = open(&args.file)?;
    let header = recording.header().ok_or_else(|| {
        Failure::new(
            FailureKind::DataLost,
            format!("{name}: the configuration is lost; {}", damage_text(recording.damage())),
        )
    })?;
    let config = Config::from_toml(&header.config, &format!("{name} (configuration)"))?;
    let (model_name, model_text) = header
        .models
        .iter()
        .find(|(name, _)| !name.starts_with("sensor/"))
        .map_or(("standing.xml", STANDING_MJCF), |(name, text)| (name.as_str(), text.as_str()));
    let model =
        CharacterModel::from_mjcf(model_text, model_name).map_err(crate::config::ConfigError::from)?;
    let push_end_s = config.core.push.map(|push| push.start_s + push.duration_s);
    let mut core = Core::new(config.core.clone(), model)?;
    let support_polygon = core.green().support_outline();
    let outputs = Outputs::claim(args.out.as_deref(), None, args.force)?;

    let (mut trace, mut times) = (Trace::new(), TickTimes::new());
    let clock = SystemClock::start_now();
    let bar = show::progress(Some(recording.damage().ticks_read));
    let report = verify(&recording, |input| {
        let started = clock.now();
        let output = core.step(input);
        times.record(clock.now().saturating_since(started));
        trace.push(input, &output);
        bar.inc(1);
        output
    })?;
    bar.finish_and_clear();

    let analysis = Analysis::new(&trace, push_end_s);
    let simulated_s = trace.span_s().map_or(0.0, |(_, last)| last + TICK_S);
    let (samples, link) = recorded_counters(recording.summary());
    let timing = TimingSummary::new(&times, simulated_s, clock.now().as_secs_f64(), 0);
    let mut summary = Summary::new(
        RunFacts { source: name.clone(), duration_s: simulated_s, samples, link, timing },
        &analysis,
    );
    summary.events = recorded_events(&recording)?;
    let subtitle = format!("replay of {}", config.device.as_deref().unwrap_or("a recording"));
    let figure = svg::render(&trace, &analysis, &Caption { title: name.clone(), subtitle, support_polygon });
    outputs.make_folder()?;
    outputs.write(&mut summary, &figure)?;
    let same_build = header.fingerprint == build_fingerprint();
    present(&summary, &report, args.verify, same_build, json)?;
    conclude(&name, &report, args.verify, same_build, &header.fingerprint)
}

/// Opens a recording; a file cut within its first bytes is damaged, not a file of another kind.
pub(super) fn open(path: &Path) -> Result<Recording, Failure> {
    Recording::open(path).map_err(|error| match (error, length_of_cut_magic(path)) {
        (RecordError::NotMcap { .. }, Some(bytes)) => Failure::new(
            FailureKind::DataLost,
            format!(
                "{}: the recording is damaged: it is cut at byte {bytes}, 0 ticks read\n\n\
                 hint: copy the file again if the original is whole",
                path.display()
            ),
        ),
        (error, _) => error.into(),
    })
}

/// Length of a file that is nothing but a beginning of the magic bytes.
fn length_of_cut_magic(path: &Path) -> Option<usize> {
    let mut start = Vec::new();
    let file = std::fs::File::open(path).ok()?;
    file.take(mcap::MAGIC.len() as u64 + 1).read_to_end(&mut start).ok()?;
    mcap::MAGIC.starts_with(&start).then_some(start.len())
}

/// Most recorded events that a replay repeats.
const MAX_EVENTS: usize = 200;

/// What was noted during the recorded run, and what it could not note any more.
fn recorded_events(recording: &Recording) -> Result<Vec<String>, Failure> {
    let mut events = Vec::new();
    for event in recording.events()?.take(MAX_EVENTS) {
        let (at, text) = event?;
        events.push(format!("{:.3} s: {text}", at.as_secs_f64()));
    }
    if recording.summary().is_none() {
        events.push(
            "the recorded run never wrote its summary: samples and link counters are unknown, shown as 0"
                .to_owned(),
        );
    }
    Ok(events)
}

/// Samples and link counters as the recorded run summed them up; zero when it never did.
fn recorded_counters(summary: Option<&str>) -> (u64, LinkCounters) {
    let recorded: Value = summary.and_then(|text| serde_json::from_str(text).ok()).unwrap_or(Value::Null);
    let count = |value: &Value| value.as_u64().unwrap_or(0);
    let link = &recorded["link"];
    let counters = LinkCounters {
        packets: count(&link["packets"]),
        bad_checksum: count(&link["bad_checksum"]),
        bytes_skipped: count(&link["bytes_skipped"]),
        missing: count(&link["missing"]),
        gaps: count(&link["gaps"]),
        dropped: count(&link["dropped"]),
    };
    (count(&recorded["samples"]), counters)
}

fn present(
    summary: &Summary,
    report: &VerifyReport,
    verify: bool,
    same_build: bool,
    json: bool,
) -> Result<(), Failure> {
    if json {
        let mut object = serde_json::to_value(summary)
            .map_err(|error| Failure::new(FailureKind::Failed, format!("cannot write JSON: {error}")))?;
        object["damage"] = serde_json::json!(report.damage);
        if verify {
            object["verify"] = serde_json::json!({
                "bit_identical": report.is_bit_identical(),
                "ticks_compared": report.ticks_compared,
                "ticks_not_compared": report.ticks_not_compared,
                "differing_ticks": report.differing_ticks,
                "first_difference": report.first_difference,
                "same_build": same_build,
            });
        }
        return show::json(&object);
    }
    show::text(&table::render(summary, table::stdout_takes_colour()))?;
    if verify && report.is_bit_identical() {
        show::text(&format!("bit-identical: {0} of {0} ticks", report.ticks_compared))?;
    } else if verify && report.differing_ticks == 0 {
        show::text(&format!(
            "bit-identical as far as the recording is whole: {} ticks compared, {} behind the first gap not",
            report.ticks_compared, report.ticks_not_compared
        ))?;
    }
    Ok(())
}

fn conclude(
    name: &str,
    report: &VerifyReport,
    verify: bool,
    same_build: bool,
    fingerprint: &str,
) -> Result<ExitCode, Failure> {
    if !report.damage.complete {
        return Err(Failure::new(FailureKind::DataLost, format!("{name}: {}", damage_text(&report.damage))));
    }
    match &report.first_difference {
        Some(first) if verify => {
            let hint = if same_build {
                "the core is not deterministic: please report this recording".to_owned()
            } else {
                format!(
                    "it was recorded by another build ({fingerprint}): bits are promised for the same build only"
                )
            };
            Err(Failure::new(
                FailureKind::DataLost,
                format!(
                    "{name}: {} of {} ticks differ, first at tick {} in {}: recorded bits {:016x}, computed {:016x}\n\nhint: {hint}",
                    report.differing_ticks,
                    report.ticks_compared,
                    first.tick,
                    first.field,
                    first.recorded_bits,
                    first.computed_bits
                ),
            ))
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// What is damaged, where, and how much is lost.
pub(super) fn damage_text(damage: &DamageReport) -> String {
    let places: Vec<String> = damage.findings.iter().take(8).map(|finding| format!("  {finding}")).collect();
    let more = damage.findings.len().saturating_sub(places.len());
    let more = if more > 0 { format!("\n  and {more} more places") } else { String::new() };
    format!(
        "the recording is damaged: {} ticks read, at least {} lost\n{}{more}\n\nhint: what could be read is shown above and can be \
         replayed; copy the file again if the original is whole",
        damage.ticks_read,
        damage.ticks_lost_at_least,
        places.join("\n")
    )
}
