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

use clap::{Parser, Subcommand};

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
    let cli = Cli::parse();
    let json = cli.json;
    let result = match &cli.command {
        Command::Demo(args) => demo::run(args, json),
        Command::Run(args) => run::run(args, json),
        Command::Replay(args) => replay::run(args, json),
        Command::Reproduce(args) => reproduce::run(args, json),
        Command::Perceive(args) => perceive::run(args).map_err(Failure::from).and_then(|summary| {
            show::result(&summary, json)?;
            Ok(ExitCode::SUCCESS)
        }),
        Command::Devices(args) => devices::run(args, json),
        Command::Doctor(args) => doctor::run(args, json),
        Command::Inspect(args) => inspect::run(args, json),
        Command::Calibrate(args) => calibrate::run(args, json),
        Command::Chair(args) => chair::run(args, json),
    };
    result.unwrap_or_else(|failure| {
        show::note(&format!("error: {failure}"));
        failure.exit_code()
    })
}
