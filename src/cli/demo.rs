//! `otolith demo`: a mock chair, both characters, a recording and a figure.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::assemble::Pace;
use super::failure::Failure;
use super::run::{ChairArgs, Options, expected_s};
use super::session::Session;
use crate::device::Selector;
use crate::device::mock::MockParams;
use crate::time::utc_now_compact;

/// Spin a mock chair (30 rpm for 15 s) and show what both characters do.
///
/// Green trusts its vestibular model, blue perceives perfectly. Prints a summary and writes a recording and a figure.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith demo                               as fast as the machine goes\n  \
    otolith demo --pace real                   in real time\n  \
    otolith demo --spin-s 20                   green falls\n  \
    otolith demo --motion stand-up             spun in a squat, then they stand up; or reach, drink\n  \
    otolith demo --rate-rpm 10 --json --out slow")]
pub(super) struct DemoArgs {
    #[command(flatten)]
    options: Options,
    /// Folder for figure, summary and recording [default: a new folder named by date and time, UTC].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Real time, or as fast as the machine goes.
    #[arg(long, value_enum, default_value_t = Pace::Max)]
    pace: Pace,
    // Last, because its heading would hold for every option behind it.
    #[command(flatten)]
    chair: ChairArgs,
}

pub(super) fn run(args: &DemoArgs, json: bool) -> Result<ExitCode, Failure> {
    let config = args.options.config(None)?;
    let mut selector = Selector::Mock(MockParams::chair());
    args.chair.apply(&mut selector)?;
    let out = args.out.clone().unwrap_or_else(|| new_folder(Path::new("")));
    let record = args.options.record.clone().unwrap_or_else(|| out.join("recording.mcap"));
    Session {
        expected_s: expected_s(&selector),
        config,
        selector,
        pace: args.pace,
        duration_s: None,
        record: Some(record),
        out: Some(out),
        force: args.options.force,
        json,
    }
    .run()
}

/// A folder name that is not taken: date and time, and a number if two runs start in one second.
pub(super) fn new_folder(parent: &Path) -> PathBuf {
    let name = format!("otolith-{}", utc_now_compact());
    let numbered = (2..).map(|n| parent.join(format!("{name}-{n}")));
    std::iter::once(parent.join(&name))
        .chain(numbered)
        .find(|path| !path.exists())
        .unwrap_or_else(|| parent.join(&name))
}
