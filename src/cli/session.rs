//! One run from start to summary: what `demo` and `run` share.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::assemble::{Pace, known_log, open_source};
use super::console::{listen_for_keys, show_status, stop_on_ctrl_c};
use super::failure::{Failure, FailureKind};
use super::outputs::Outputs;
use super::show;
use crate::config::{Config, SENSOR_LOG_MAP};
use crate::device::Selector;
use crate::record::{Recorder, RecordingHeader};
use crate::report::{Analysis, Caption, LinkCounters, RunFacts, Summary, TimingSummary, rounded, svg, table};
use crate::runtime::{
    Core, Journal, LiveRun, LiveStatus, RunOutcome, Signals, Source, SourceFacts, run_offline,
};
use crate::time::{Clock, SystemClock};

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

impl Session {
    /// Runs, writes the files and prints the summary.
    pub(super) fn run(self) -> Result<ExitCode, Failure> {
        let model = self.config.model()?;
        // About the shipped model there is nothing the user could do.
        for note in model.notes.iter().filter(|_| self.config.character.is_some()) {
            show::note(&format!("note: {note}"));
        }
        let gravity = model.gravity.norm();
        let core = Core::new(self.config.core.clone(), model)?;
        let support_polygon = core.green().support_outline();
        let outputs = Outputs::claim(self.out.as_deref(), self.record.as_deref(), self.force)?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
        // Before the device is opened: one that is being set up must not be left half way.
        let signals = Arc::new(Signals::default());
        stop_on_ctrl_c(&signals)?;
        let source = open_source(&self.config, &self.selector, gravity, self.pace, &clock)?;
        if signals.stop.load(Ordering::Relaxed) {
            return Err(Failure::new(
                FailureKind::Failed,
                format!("{}: stopped before the first sample\n\nhint: run it again", self.selector),
            ));
        }
        outputs.make_folder()?;
        let journal = Journal::recording(self.recorder()?);

        let started = clock.now();
        let (facts, journal, outcome) = match self.pace {
            Pace::Max => self.offline(source, core, journal, &signals)?,
            Pace::Real => self.live(source, core, journal, &clock, &signals)?,
        };
        let wall_s = clock.now().saturating_since(started).as_secs_f64();
        self.conclude(&facts, journal, &outcome, wall_s, support_polygon, &outputs)
    }

    /// Measures the run, writes its files and prints the summary. What cannot be written does not keep the summary
    /// from the user.
    fn conclude(
        &self,
        facts: &SourceFacts,
        journal: Journal,
        outcome: &RunOutcome,
        wall_s: f64,
        support_polygon: Vec<[f64; 2]>,
        outputs: &Outputs,
    ) -> Result<ExitCode, Failure> {
        let push_end_s = self.config.core.push.map(|push| push.start_s + push.duration_s);
        let analysis = Analysis::new(&journal.trace, push_end_s);
        let mut summary = self.summary(facts, outcome, &analysis, wall_s);
        summary.events =
            journal.events.iter().map(|event| format!("{:.3} s: {}", event.at_s, event.text)).collect();
        if journal.more_events > 0 {
            summary.events.push(format!("and {} more; the recording has all of them", journal.more_events));
        }
        summary.recording = self.record.as_ref().map(|path| path.display().to_string());
        let caption = Caption {
            title: self.selector.to_string(),
            subtitle: format!("{:.1} s simulated", summary.duration_s),
            support_polygon,
        };
        let figure = svg::render(&journal.trace, &analysis, &caption);
        let written = outputs.write(&mut summary, &figure);
        let recorded = journal.finish(&serde_json::to_string(&summary).unwrap_or_default());
        if self.json {
            show::json(&summary)?;
        } else {
            show::text(&table::render(&summary, table::stdout_takes_colour()))?;
        }
        // Of a run without samples the error has them.
        for note in facts.notes.iter().filter(|_| facts.imu.samples > 0) {
            show::note(&format!("note: {note}"));
        }
        written?;
        recorded?;
        self.verdict(facts, outcome)
    }

    fn recorder(&self) -> Result<Option<Recorder>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        if let Selector::Replay { path: played, .. } = &self.selector
            && is_same_file(path, played)
        {
            return Err(Failure::usage(format!(
                "{}: cannot be played and written at once\n\nhint: choose another name with --record",
                path.display()
            )));
        }
        let (name, text) = self.config.model_text()?;
        let config = Config { device: Some(self.selector.to_string()), ..self.config.clone() };
        let mut models = BTreeMap::from([(name, text)]);
        models.extend(self.config.sensor_texts()?);
        if let Some(known) = known_log(&self.config, &self.selector)? {
            models.insert(SENSOR_LOG_MAP.to_owned(), known.mapping_text());
        }
        let header = RecordingHeader::new(config.to_toml(), models, build_fingerprint());
        Ok(Some(Recorder::create(path, self.force, &header)?))
    }

    fn offline(
        &self,
        mut source: Source,
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
            |_, output| {
                let tick = output.tick;
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
        source: Source,
        core: Core,
        journal: Journal,
        clock: &Arc<dyn Clock>,
        signals: &Arc<Signals>,
    ) -> Result<(SourceFacts, Journal, RunOutcome), Failure> {
        let status = Arc::new(LiveStatus::default());
        let total_s = self.duration_s.or(self.expected_s);
        let bar = show::progress(total_s.map(|s| (s * 1000.0) as u64));
        listen_for_keys(signals);
        let shown = show_status(bar, status.clone(), signals.clone(), clock.clone());
        let run = LiveRun {
            settings: self.config.live,
            hold_limit_s: self.config.imu.hold_limit_s,
            duration_s: self.duration_s,
            clock: clock.clone(),
            signals: signals.clone(),
            status,
        };
        let result = run.run(source, core, journal);
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
            timing: TimingSummary {
                max_sample_age_ms: outcome.max_sample_age_s.map(|age_s| rounded(age_s * 1e3)),
                ..TimingSummary::new(&outcome.times, simulated_s, wall_s, outcome.overruns)
            },
        };
        let mut summary = Summary::new(run, analysis);
        summary.alignment = facts.alignment.and_then(|report| serde_json::to_value(report).ok());
        summary.device = Some(device_facts(facts, outcome));
        summary
    }

    /// Exit code of a run that came to its end.
    fn verdict(&self, facts: &SourceFacts, outcome: &RunOutcome) -> Result<ExitCode, Failure> {
        if facts.imu.samples == 0 {
            return Err(self.no_samples(facts, outcome));
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

    /// Why a run came to nothing.
    fn no_samples(&self, facts: &SourceFacts, outcome: &RunOutcome) -> Failure {
        let (ran_s, window_s) = (outcome.last_tick.time_s(), self.config.imu.align_window_s);
        if facts.imu.readings > 0 && ran_s < window_s + self.config.live.input_delay_s {
            return Failure::new(
                FailureKind::Failed,
                format!(
                    "{}: ended after {ran_s:.1} s, before rest and mounting could be found in the first {window_s} s\n\n\
                     hint: let it run for longer",
                    self.selector
                ),
            );
        }
        let hint = match &self.selector {
            Selector::Replay { .. } => {
                "`otolith inspect FILE` says what is in it; --protocol names a decoder, --log-map the columns of a text log, --map the signals \
                 of a CAN log"
            }
            Selector::Can { .. } | Selector::Slcan { .. } => {
                "check bitrate, wiring, terminators and, behind slcan:, that the adapter speaks slcan; frames of other kinds \
                 need --map; `otolith doctor can:IFACE` says more"
            }
            _ => "check baud rate, wiring and protocol; `otolith devices` lists what is connected",
        };
        Failure::new(
            FailureKind::Failed,
            format!(
                "{}: not one sample arrived (protocol {}, {} good packets, {} bytes skipped, {} packets of other \
                 kinds){}\n\nhint: {hint}",
                self.selector,
                facts.protocol,
                facts.decode.packets,
                facts.decode.bytes_skipped + facts.link.bytes_skipped,
                facts.decode.unknown,
                facts.notes.iter().map(|note| format!("; {note}")).collect::<String>(),
            ),
        )
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
        "before_scale": facts.decode.withheld,
        "lone_halves": facts.decode.lone_halves,
        "device_errors": facts.decode.device_errors,
        "without_specific_force": facts.imu.missing_specific_force,
        "bus_errors": facts.link.bus_errors,
        "bus_off": facts.link.bus_off,
        "bus_state": facts.link.bus_state,
        "bus_faults": facts.link.bus_faults,
        "overflowed": facts.link.overflowed,
        "stamps_refused": facts.link.stamps_refused,
        "unsent": facts.link.unsent,
        "sync_offset_us": facts.sync.map(|sync| sync.offset_us),
        "sync_round_trip_us": facts.sync.map(|sync| sync.round_trip_us),
        "constant_delay_us": facts.constant_delay.0 as f64 * 1e-3,
        "constant_delay_measured": facts.constant_delay.1,
        "losses": facts.link.losses,
        "reconnects": facts.link.reconnects,
        "low_latency": facts.link.low_latency,
        "late_ticks": outcome.late_ticks,
        "stale_episodes": outcome.resample.stale_episodes,
        "lost_episodes": outcome.resample.lost_episodes,
        "notes": facts.notes,
    })
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

/// Whether two names lead to one existing file.
fn is_same_file(one: &Path, other: &Path) -> bool {
    matches!((one.canonicalize(), other.canonicalize()), (Ok(one), Ok(other)) if one == other)
}
