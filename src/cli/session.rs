//! One run from start to summary: what `demo` and `run` share.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::assemble::{Pace, open_source};
use super::failure::{Failure, FailureKind};
use super::show;
use crate::config::Config;
use crate::device::Selector;
use crate::record::{Recorder, RecordingHeader};
use crate::report::{Analysis, Caption, LinkCounters, RunFacts, Summary, TimingSummary, svg, table};
use crate::runtime::{
    Core, CoreSettings, Journal, LiveStatus, RunOutcome, Signals, SourceFacts, run_live, run_offline,
};
use crate::time::{Clock, SystemClock};
use crate::units::{DEG_PER_RAD, RAD_S_PER_RPM};

/// What to run and where to put the results.
pub(super) struct Session {
    /// The whole configuration, checked.
    pub(super) config: Config,
    /// The device.
    pub(super) selector: Selector,
    /// Real time or as fast as possible.
    pub(super) pace: Pace,
    /// End after this, s.
    pub(super) duration_s: Option<f64>,
    /// Length of the source if it is known, s: for the progress bar.
    pub(super) expected_s: Option<f64>,
    /// Recording to write.
    pub(super) record: Option<PathBuf>,
    /// Folder for the figure and the summary; made if it is missing.
    pub(super) out: Option<PathBuf>,
    /// Overwrite files.
    pub(super) force: bool,
    /// Print JSON.
    pub(super) json: bool,
}

/// Names of the files in the result folder.
const FIGURE: &str = "figure.svg";
const SUMMARY: &str = "summary.json";

impl Session {
    /// Runs, writes the files and prints the summary.
    pub(super) fn run(self) -> Result<ExitCode, Failure> {
        let model = self.config.model()?;
        // About the shipped model there is nothing the user could do.
        for note in model.notes.iter().filter(|_| self.config.character.is_some()) {
            show::note(&format!("note: {note}"));
        }
        let gravity = model.gravity.norm();
        let support_polygon = support_outline(&self.config.core, &model)?;
        let core = Core::new(self.config.core.clone(), model)?;
        let outputs = Outputs::claim(self.out.as_deref(), self.force)?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
        let source = open_source(&self.config, &self.selector, gravity, self.pace, &clock)?;
        let journal = Journal::recording(self.recorder()?);
        let signals = Arc::new(Signals::default());
        stop_on_ctrl_c(&signals)?;

        let started = clock.now();
        let (facts, journal, outcome) = match self.pace {
            Pace::Max => self.offline(source, core, journal, &signals)?,
            Pace::Real => self.live(source, core, journal, &clock, &signals)?,
        };
        let wall_s = clock.now().saturating_since(started).as_secs_f64();
        let push_end_s = self.config.core.push.map(|push| push.start_s + push.duration_s);
        let analysis = Analysis::new(&journal.trace, push_end_s);
        let mut summary = self.summary(&facts, &outcome, &analysis, wall_s);
        summary.events =
            journal.events.iter().map(|event| format!("{:.3} s: {}", event.at_s, event.text)).collect();
        summary.recording = self.record.as_ref().map(|path| path.display().to_string());
        let caption = Caption {
            title: self.selector.to_string(),
            subtitle: format!("{:.1} s simulated", summary.duration_s),
            support_polygon,
        };
        let figure = svg::render(&journal.trace, &analysis, &caption);
        outputs.write(&mut summary, &figure)?;
        let text = serde_json::to_string(&summary).unwrap_or_default();
        journal.finish(&text)?;
        if self.json {
            show::json(&summary)?
        } else {
            show::text(&table::render(&summary, table::stdout_takes_colour()))?
        }
        self.verdict(&facts, &outcome)
    }

    fn recorder(&self) -> Result<Option<Recorder>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        let (name, text) = self.config.model_text()?;
        let config = Config { device: Some(self.selector.to_string()), ..self.config.clone() };
        let models = BTreeMap::from([(name, text)]);
        let header = RecordingHeader::new(config.to_toml(), models, build_fingerprint());
        Ok(Some(Recorder::create(path, self.force, &header)?))
    }

    fn offline(
        &self,
        mut source: crate::runtime::Source,
        mut core: Core,
        mut journal: Journal,
        signals: &Signals,
    ) -> Result<(SourceFacts, Journal, RunOutcome), Failure> {
        let total_s = self.duration_s.or(self.expected_s);
        let bar = show::progress(total_s.map(|s| (s * 1000.0) as u64));
        let hold = self.config.imu.hold_limit_s;
        let outcome = run_offline(
            &mut source,
            &mut core,
            &mut journal,
            hold,
            self.duration_s,
            &signals.stop,
            |tick| {
                if tick.0.is_multiple_of(100) {
                    bar.set_position(tick.0);
                    bar.set_message(format!("{:.1} s simulated", tick.time_s()));
                }
            },
        )?;
        bar.finish_and_clear();
        Ok((source.facts(), journal, outcome))
    }

    fn live(
        &self,
        source: crate::runtime::Source,
        core: Core,
        journal: Journal,
        clock: &Arc<dyn Clock>,
        signals: &Arc<Signals>,
    ) -> Result<(SourceFacts, Journal, RunOutcome), Failure> {
        let status = Arc::new(LiveStatus::default());
        let total_s = self.duration_s.or(self.expected_s);
        let bar = show::progress(total_s.map(|s| (s * 1000.0) as u64));
        listen_for_keys(signals);
        let shown = std::thread::spawn({
            let (status, signals, clock, bar) = (status.clone(), signals.clone(), clock.clone(), bar.clone());
            move || {
                while !signals.stop.load(Ordering::Relaxed) {
                    let line = status.load();
                    bar.set_position(line.tick);
                    bar.set_message(status_line(&line));
                    clock.sleep_until(clock.now() + Duration::from_millis(100));
                }
                bar.finish_and_clear();
            }
        });
        let hold = self.config.imu.hold_limit_s;
        let live = &self.config.live;
        let result = run_live(source, core, journal, live, hold, self.duration_s, clock, signals, &status);
        signals.stop.store(true, Ordering::Relaxed);
        // The status line has nothing to say any more; a panic there must not hide the run's result.
        let _shown = shown.join();
        let (source, journal, outcome) = result?;
        Ok((source.facts(), journal, outcome))
    }

    fn summary(
        &self,
        facts: &SourceFacts,
        outcome: &RunOutcome,
        analysis: &Analysis,
        wall_s: f64,
    ) -> Summary {
        let simulated_s = outcome.last_tick.time_s();
        let run = RunFacts {
            source: self.selector.to_string(),
            duration_s: simulated_s,
            samples: facts.imu.samples,
            link: LinkCounters {
                packets: facts.decode.packets,
                bad_checksum: facts.decode.bad_checksum,
                bytes_skipped: facts.decode.bytes_skipped + facts.link.bytes_skipped,
                missing: facts.decode.missing,
                gaps: outcome.resample.gaps,
                dropped: outcome.dropped,
            },
            timing: TimingSummary::new(&outcome.times, simulated_s, wall_s, outcome.overruns),
        };
        let mut summary = Summary::new(run, analysis);
        summary.alignment = facts.alignment.and_then(|report| serde_json::to_value(report).ok());
        summary.device = Some(device_facts(facts, outcome));
        summary
    }

    /// Exit code of a run that came to its end.
    fn verdict(&self, facts: &SourceFacts, outcome: &RunOutcome) -> Result<ExitCode, Failure> {
        if facts.imu.samples == 0 {
            return Err(Failure::new(
                FailureKind::Failed,
                format!(
                    "{}: not one sample arrived (protocol {}, {} good packets, {} bytes skipped)\n\nhint: check baud rate \
                     and protocol; `otolith devices` lists what is connected, `otolith inspect FILE` looks into a capture",
                    self.selector,
                    facts.protocol,
                    facts.decode.packets,
                    facts.decode.bytes_skipped + facts.link.bytes_skipped,
                ),
            ));
        }
        if outcome.dropped > 0 {
            return Err(Failure::new(
                FailureKind::DataLost,
                format!(
                    "{} samples, ticks or pieces of traffic were lost to full queues\n\nhint: the machine was too busy; \
                     close other programs, or record to a faster disk",
                    outcome.dropped
                ),
            ));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Facts about the device beyond the counters every run has.
fn device_facts(facts: &SourceFacts, outcome: &RunOutcome) -> serde_json::Value {
    serde_json::json!({
        "protocol": facts.protocol,
        "clock": format!("{:?}", facts.clock).to_lowercase(),
        "clock_drift_ppm": facts.clock_drift_ppm,
        "clock_resets": facts.imu.clock_resets,
        "clipped": facts.imu.clipped,
        "non_finite": facts.imu.non_finite,
        "unknown_packets": facts.decode.unknown,
        "dropped_by_device": facts.decode.device_dropped,
        "losses": facts.link.losses,
        "reconnects": facts.link.reconnects,
        "late_ticks": outcome.late_ticks,
        "stale_episodes": outcome.resample.stale_episodes,
        "lost_episodes": outcome.resample.lost_episodes,
    })
}

/// One line on the state of a live run.
fn status_line(line: &crate::runtime::StatusLine) -> String {
    let fallen = if line.green_fallen { " fallen (r + Enter stands it up)" } else { "" };
    format!(
        "{:7.1} s  link {:<7}  chair {:6.1} rpm  green: gravity off by {:4.1} deg, sway {:4.1} deg{fallen}  blue: sway {:4.1} deg",
        line.tick as f64 * 1e-3,
        format!("{:?}", line.link).to_lowercase(),
        line.chair_rate / RAD_S_PER_RPM,
        line.green_tilt * DEG_PER_RAD,
        line.green_sway * DEG_PER_RAD,
        line.blue_sway * DEG_PER_RAD,
    )
}

/// The first Ctrl-C ends the run cleanly; a second one ends the process.
fn stop_on_ctrl_c(signals: &Arc<Signals>) -> Result<(), Failure> {
    let signals = signals.clone();
    ctrlc::set_handler(move || {
        if signals.stop.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|error| Failure::new(FailureKind::Failed, format!("cannot listen for Ctrl-C: {error}")))
}

/// `r` and Enter stand both characters up again.
fn listen_for_keys(signals: &Arc<Signals>) {
    if !std::io::IsTerminal::is_terminal(&std::io::stdin()) {
        return;
    }
    let signals = signals.clone();
    // The thread ends with the process: reading a terminal cannot be interrupted.
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if line.trim() == "r" {
                signals.respawn.store(true, Ordering::Relaxed);
            }
        }
    });
}

/// Corners of the support polygon around its centroid in the standing pose, m: for the figure.
pub(super) fn support_outline(
    settings: &CoreSettings,
    model: &crate::character::CharacterModel,
) -> Result<Vec<[f64; 2]>, Failure> {
    use crate::dynamics::{Engine, GroundSurface, standing_pose};
    let state = standing_pose(model, &settings.pose).map_err(|error| Failure::usage(error.to_string()))?;
    let engine = Engine::new(Arc::new(model.clone()), settings.contact, state);
    let ground = GroundSurface::level(model.friction);
    let support = crate::balance::perceive(&engine, &ground, &model.gravity).support;
    let centre = support.centroid_world.xy();
    Ok(support.corners().iter().map(|corner| [corner.x - centre.x, corner.y - centre.y]).collect())
}

/// What distinguishes builds whose bits may differ.
pub(super) fn build_fingerprint() -> String {
    let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
    format!(
        "otolith {} {} {} {profile}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH,
        std::env::consts::OS
    )
}

/// Files of a run besides the recording.
pub(super) struct Outputs {
    folder: Option<PathBuf>,
}

impl Outputs {
    /// Makes the folder and makes sure nothing is overwritten unasked, before the run costs time.
    pub(super) fn claim(folder: Option<&Path>, force: bool) -> Result<Self, Failure> {
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(|error| {
                Failure::usage(format!(
                    "{}: cannot make this folder: {error}\n\nhint: choose another with --out",
                    folder.display()
                ))
            })?;
            let taken =
                [FIGURE, SUMMARY].into_iter().map(|name| folder.join(name)).find(|path| path.exists());
            if let (Some(path), false) = (taken, force) {
                return Err(Failure::usage(format!(
                    "{}: the file exists already\n\nhint: choose another folder with --out, or overwrite it with --force",
                    path.display()
                )));
            }
        }
        Ok(Self { folder: folder.map(Path::to_owned) })
    }

    /// Writes figure and summary and enters the figure's name into the summary.
    pub(super) fn write(&self, summary: &mut Summary, figure: &str) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).map(|()| path.clone()).map_err(|error| {
                Failure::new(FailureKind::Failed, format!("{}: cannot write it: {error}", path.display()))
            })
        };
        summary.figure = Some(write(FIGURE, figure)?.display().to_string());
        let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
        write(SUMMARY, &text)?;
        Ok(())
    }
}
