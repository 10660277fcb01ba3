//! The person at the terminal of a run: Ctrl-C, keys, the status line.

use std::io::{BufRead, IsTerminal};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use indicatif::ProgressBar;

use super::failure::{Failure, FailureKind};
use super::show;
use crate::runtime::trouble::Troubles;
use crate::runtime::{LiveStatus, Signals, StatusLine};
use crate::time::Clock;
use crate::units::{DEG_PER_RAD, RAD_S_PER_RPM};

/// Time between two updates of the status line.
const REFRESH: Duration = Duration::from_millis(100);

/// Shows the state of a live run on `bar` until the run ends, in a thread of its own.
pub(super) fn show_status(
    bar: ProgressBar,
    status: Arc<LiveStatus>,
    signals: Arc<Signals>,
    clock: Arc<dyn Clock>,
) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let mut warned = false;
        while !signals.stop.load(Ordering::Relaxed) {
            if let Some(refusals) = status.refusals().filter(|_| !warned) {
                warned = true;
                if !refusals.is_empty() {
                    bar.suspend(|| show::note(&format!("warning: {}", refusals.join("; "))));
                }
            }
            let line = status.load();
            bar.set_position(line.tick);
            bar.set_message(status_line(&line));
            clock.sleep_until(clock.now() + REFRESH);
        }
        bar.finish_and_clear();
    })
}

/// One line on the state of a live run.
fn status_line(line: &StatusLine) -> String {
    let dropped = if line.dropped > 0 { format!(", {} dropped", line.dropped) } else { String::new() };
    let fallen = if line.green_fallen { " fallen (r + Enter stands it up)" } else { "" };
    let troubles = troubles_text(line.troubles);
    format!(
        "{:7.1} s  link {:<7} sample {:4.0} ms old{dropped}{troubles}  chair {:6.1} rpm  green: gravity off by {:4.1} deg, sway {:4.1} deg{fallen}  blue: sway {:4.1} deg",
        line.tick as f64 * 1e-3,
        format!("{:?}", line.link).to_lowercase(),
        line.sample_age_s * 1e3,
        line.chair_rate / RAD_S_PER_RPM,
        line.green_tilt * DEG_PER_RAD,
        line.green_sway * DEG_PER_RAD,
        line.blue_sway * DEG_PER_RAD,
    )
}

/// Troubles named in the status line; the events have all of them.
const NAMED_TROUBLES: usize = 2;

/// The gravest troubles by name and how many more there are; empty where there is none.
fn troubles_text(troubles: Troubles) -> String {
    let names: Vec<&str> = troubles.iter().map(|trouble| trouble.name()).collect();
    let (named, rest) = names.split_at(names.len().min(NAMED_TROUBLES));
    let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
    named.iter().map(|name| format!(", {name}")).collect::<String>() + &more
}

/// The first Ctrl-C ends the run cleanly; a second one ends the process.
pub(super) fn stop_on_ctrl_c(signals: &Arc<Signals>) -> Result<(), Failure> {
    stop_on_ctrl_c_without(None, signals)
}

/// The same; a second Ctrl-C, which ends the program at once, removes `scratch`.
pub(super) fn stop_on_ctrl_c_without(
    scratch: Option<PathBuf>,
    signals: &Arc<Signals>,
) -> Result<(), Failure> {
    let signals = signals.clone();
    ctrlc::set_handler(move || {
        if signals.stop.swap(true, Ordering::Relaxed) {
            // It may not be there yet, or not go: the program ends all the same.
            let _gone = scratch.as_ref().map(std::fs::remove_file);
            std::process::exit(130);
        }
    })
    .map_err(|error| Failure::new(FailureKind::Failed, format!("cannot listen for Ctrl-C: {error}")))
}

/// `r` and Enter stand both characters up again.
pub(super) fn listen_for_keys(signals: &Arc<Signals>) {
    if !std::io::stdin().is_terminal() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::trouble::Trouble;

    #[test]
    fn the_gravest_troubles_are_named_and_the_others_counted() {
        let text = |troubles: &[Trouble]| troubles_text(troubles.iter().copied().collect());
        assert_eq!(text(&[]), "");
        assert_eq!(text(&[Trouble::Gap]), ", gaps between samples");
        let many = [Trouble::Clipping, Trouble::Gap, Trouble::BusOff, Trouble::MissingPackets];
        assert_eq!(text(&many), ", bus off, missing packets and 2 more");
        let line = StatusLine { troubles: many.into_iter().collect(), ..LiveStatus::default().load() };
        assert!(status_line(&line).contains("ms old, bus off, missing packets and 2 more  chair"));
    }
}
