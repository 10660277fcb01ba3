//! The command line: one file per command. Results go to stdout, all else to stderr.

mod assemble;
mod calibrate;
mod chair;
mod console;
mod decoder_flags;
mod demo;
mod devices;
mod doctor;
mod failure;
mod inspect;
mod outputs;
pub mod perceive;
mod readings;
mod replay;
mod reproduce;
mod run;
mod session;
mod show;

use std::process::ExitCode;
use std::sync::Arc;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

use crate::runtime::Signals;
use console::stop_on_ctrl_c_without;
pub use failure::{Failure, FailureKind};

/// Strap any IMU to a chair and watch, live, what the inner ear believes and how a body that trusts it sways.
///
/// Exit codes: 0 done, 1 failed, 2 usage or configuration, 3 data lost or damaged.
#[derive(Debug, Parser)]
#[command(
    name = "otolith",
    version,
    after_help = "Examples:\n  \
    otolith demo                                      a mock chair: 30 rpm for 15 s\n  \
    otolith run --device serial:/dev/ttyUSB0 --out my-run --record my-run.mcap\n  \
    otolith run --device replay:log.txt --log-map configs/logs/turntable-lsm9ds1.toml --pace max\n  \
    otolith replay my-run.mcap --verify\n  \
    otolith calibrate --device serial:/dev/ttyUSB0 --turned-deg 1080 --out my-sensor\n  \
    otolith chair my-run.mcap                         what the chair really did\n  \
    otolith reproduce                                 the paper's claims and figures"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object instead of text.
    #[arg(long, global = true)]
    json: bool,
}

// No texts here: they would stand above those of the arguments.
#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoArgs),
    Run(Box<run::RunArgs>),
    Replay(replay::ReplayArgs),
    Reproduce(reproduce::ReproduceArgs),
    Perceive(perceive::PerceiveArgs),
    Devices(devices::DevicesArgs),
    Doctor(doctor::DoctorArgs),
    Inspect(inspect::InspectArgs),
    Calibrate(Box<calibrate::CalibrateArgs>),
    Chair(chair::ChairArgs),
}

/// Parses the arguments of the process, runs the command, and gives its exit code.
pub fn main() -> ExitCode {
    let result = match Cli::try_parse() {
        Ok(cli) => run(&cli),
        Err(error) if is_help(error.kind()) => error.exit(),
        Err(error) => Err(error.into()),
    };
    result.unwrap_or_else(|failure| {
        show::note(&format!("error: {failure}"));
        failure.exit_code()
    })
}

/// Whether `clap` answers with a text that was asked for, or with the help because there was nothing else.
fn is_help(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    )
}

fn run(cli: &Cli) -> Result<ExitCode, Failure> {
    let json = cli.json;
    match &cli.command {
        Command::Demo(args) => demo::run(args, json),
        Command::Run(args) => run::run(args, json),
        Command::Replay(args) => replay::run(args, json),
        Command::Reproduce(args) => reproduce::run(args, json),
        Command::Perceive(args) => {
            let signals = Arc::new(Signals::default());
            // Ctrl-C is seen at the next row, and a pipe may never give one.
            stop_on_ctrl_c_without(Some(perceive::partial(&args.out)), &signals)?;
            show::result(&perceive::run_until(args, &signals.stop)?, json)?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Devices(args) => devices::run(args, json),
        Command::Doctor(args) => doctor::run(args, json),
        Command::Inspect(args) => inspect::run(args, json),
        Command::Calibrate(args) => calibrate::run(args, json),
        Command::Chair(args) => chair::run(args, json),
    }
}
