//! Help, version, streams, signals: how the program behaves between a person and a pipe.

use std::process::Stdio;
use std::time::Duration;

use otolith::time::{Clock, SystemClock};

use super::{Place, SHORT, number};

const COMMANDS: [&str; 9] =
    ["demo", "run", "replay", "perceive", "devices", "doctor", "inspect", "calibrate", "chair"];

#[test]
fn every_help_teaches_by_examples() {
    let place = Place::new();
    let overview = place.run(&["--help"]).done().stdout;
    assert!(overview.contains("Examples:") && overview.contains("Exit codes:"), "{overview}");
    for command in COMMANDS {
        assert!(overview.contains(&format!("\n  {command} ")), "{overview}");
        let help = place.run(&[command, "--help"]).done();
        assert!(help.stdout.contains("Examples:\n  otolith "), "{}", help.stdout);
        assert!(help.stdout.contains(&format!("  otolith {command}")), "{}", help.stdout);
        assert_eq!(help.stderr, "");
    }
    // The options of the mock chair have a heading of their own, and nothing else stands under it.
    for command in ["demo", "run"] {
        let help = place.run(&[command, "--help"]).done().stdout;
        let (options, rest) = help.split_once("Mock chair:").expect("a heading");
        let (chair, _) = rest.split_once("Examples:").expect("examples");
        assert!(options.contains("--config") && options.contains("--out") && options.contains("--pace"));
        assert!(chair.contains("--rate-rpm") && !chair.contains("--config") && !chair.contains("--pace"));
    }
}

#[test]
fn the_version_is_that_of_the_package() {
    let version = Place::new().run(&["--version"]).done().stdout;
    assert_eq!(version, format!("otolith {}\n", env!("CARGO_PKG_VERSION")));
}

/// What `clap` finds has the layout of every other error.
#[test]
fn wrong_arguments_are_usage_errors_with_a_hint() {
    let place = Place::new();
    for (args, parts) in [
        (
            &["demo", "--bogus"][..],
            &["unexpected argument '--bogus' found\n\n", "; `otolith demo --help` says"][..],
        ),
        (&["demo", "--sed", "1"], &["hint: a similar argument exists: '--seed'; `otolith demo --help`"]),
        (&["bogus"], &["unrecognized subcommand 'bogus'", "usage: otolith", "; `otolith --help` says"]),
        (&["inspect"], &["arguments were not provided: <FILE>\n\n", "usage: otolith inspect"]),
        (&["--json", "perceive", "a"], &["--out <OUT.csv>", "`otolith perceive --help`"]),
        (&["run", "--pace", "slow"], &["'slow' for '--pace <PACE>' [possible values: real, max]"]),
        (&["devices", "--list", "can:can0"], &["'--list' cannot be used with"]),
        (&["demo", "--seed", "99999999999999999999"], &["'99999999999999999999' for '--seed <N>'"]),
    ] {
        place.run(args).refused(2, parts);
    }
}

#[cfg(unix)]
#[test]
fn an_argument_that_is_no_text_is_a_usage_error_too() {
    use std::os::unix::ffi::OsStrExt;

    let place = Place::new();
    let mut command = place.command(&["demo"]);
    super::Run::of(command.arg(std::ffi::OsStr::from_bytes(b"--\xFF")))
        .refused(2, &["`otolith demo --help`"]);
}

#[test]
fn no_command_is_answered_with_the_help() {
    let run = Place::new().run(&[]);
    assert_eq!((run.code, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.contains("Commands:") && run.stderr.contains("Examples:"), "{}", run.stderr);
}

#[test]
fn the_printed_configuration_is_accepted() {
    let place = Place::new();
    let args = ["run", "--device", "mock:rest?rest_s=0.1", "--preset", "newman-lpf", "--respawn", "2.5"];
    let printed = place.run(&[&args[..], &["--print-config"]].concat()).done().stdout;
    place.write("c.toml", &printed);
    let again = place.run(&["run", "--config", "c.toml", "--print-config"]).done().stdout;
    assert_eq!(again, printed);
    let json = place.run(&["run", "--config", "c.toml", "--print-config", "--json"]).done().json();
    assert_eq!(number(&json, "/core/respawn_after_s"), 2.5);
    place.run(&["run", "--config", "c.toml", "--pace", "max"]).done();
}

#[test]
fn stdout_holds_the_result_and_stderr_all_else() {
    let place = Place::new();
    let run = place.run(&[&["demo", "--out", "x"], &SHORT[..]].concat()).done();
    assert_eq!(run.stderr, "", "no progress bar in a pipe");
    for part in ["green", "blue", "peak CoM sway", "x/figure.svg", "x/recording.mcap"] {
        assert!(run.stdout.contains(part), "{part} is missing in {}", run.stdout);
    }
    assert!(!run.stdout.contains('\x1b'), "no colour in a pipe");
}

#[test]
fn devices_are_listed_as_json() {
    let place = Place::new();
    let json = place.run(&["devices", "--json"]).done().json();
    for device in json["devices"].as_array().expect("a list") {
        let selector = device["selector"].as_str().expect("a selector");
        assert!(selector.parse::<otolith::device::Selector>().is_ok(), "{selector}");
    }
    assert!(!place.run(&["devices"]).done().stdout.is_empty());
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_is_no_panic() {
    for args in [&["devices", "--json"][..], &["run", "--print-config"], &["--help"]] {
        let place = Place::new();
        let mut child = place.spawn(args);
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("ends");
        assert_eq!(String::from_utf8_lossy(&output.stderr), "");
        assert!(output.status.code().is_some_and(|code| code == 0), "{args:?}: {:?}", output.status);
    }
}

/// A result that cannot be written is a failure, and says so.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_is_an_error() {
    let place = Place::new();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
    let mut command = place.command(&["devices", "--list", "--json"]);
    let output = command.stdin(Stdio::null()).stdout(full).output().expect("starts");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(
        stderr.starts_with("error: cannot write to stdout: ") && stderr.contains("\n\nhint: "),
        "{stderr}"
    );
}

/// A device without its last commands would be in a state that nobody asked for.
#[cfg(unix)]
#[test]
fn ctrl_c_while_a_device_is_set_up_lets_it_be_set_up_whole() {
    let place = Place::new();
    let device = crate::pty::Device::plug_in(&place.path(""));
    let selector = format!("serial:{}", device.port());
    let args = ["run", "--device", &selector, "--protocol", "witmotion", "--configure", "rate=100"];
    let mut command = place.command(&args);
    let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let child = child.expect("starts");
    assert_eq!(device.read(5), [0xFF, 0xAA, 0x69, 0x88, 0xB5], "the first command unlocks");
    let pid = child.id().to_string();
    let killed = std::process::Command::new("kill").args(["-INT", &pid]).status().expect("kill exists");
    assert!(killed.success());
    assert_eq!(device.read(10), [0xFF, 0xAA, 0x02, 0x07, 0x00, 0xFF, 0xAA, 0x03, 0x09, 0x00]);
    let output = child.wait_with_output().expect("ends");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with(&format!("error: {selector}")) && stderr.contains("\n\nhint: "), "{stderr}");
}

/// Colours are for terminals, and NO_COLOR forbids them even there.
#[cfg(unix)]
#[test]
fn no_color_is_respected_on_a_terminal() {
    let place = Place::new();
    for (no_color, coloured) in [("", true), ("1", false)] {
        let terminal = crate::pty::Device::plug_in(&place.path(""));
        let screen = std::fs::OpenOptions::new().write(true).open(terminal.port()).expect("a terminal");
        let out = format!("out{no_color}");
        let mut command = place.command(&[&["demo", "--out", &out], &SHORT[..]].concat());
        command.env("TERM", "xterm").env_remove("NO_COLOR").stdin(Stdio::null()).stderr(Stdio::null());
        if !no_color.is_empty() {
            command.env("NO_COLOR", no_color);
        }
        let mut child = command.stdout(screen).spawn().expect("starts");
        // The command keeps its copy of the terminal until it is dropped.
        drop(command);
        assert!(child.wait().expect("ends").success());
        let shown = terminal.read_all();
        assert!(shown.contains("peak CoM sway"), "{shown}");
        assert_eq!(shown.contains("\x1b["), coloured, "NO_COLOR=`{no_color}`: {shown}");
    }
}

/// Ctrl-C is a way to end a run, not a failure: the summary is printed, the files are whole, the exit code is 0.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_run_with_summary_and_whole_files() {
    /// Ends a hang; never decides the test.
    const PATIENCE: u32 = 200;

    let place = Place::new();
    let args = ["demo", "--pace", "real", "--json", "--out", "x"];
    let child = place.spawn(&args);
    let clock = SystemClock::start_now();
    let recording = place.path("x/recording.mcap");
    let begun = (0..PATIENCE).any(|_| {
        clock.sleep_until(clock.now() + Duration::from_millis(50));
        std::fs::metadata(&recording).is_ok_and(|file| file.len() > 1_200_000)
    });
    assert!(begun, "the recording grows past the first second");
    let pid = child.id().to_string();
    let killed = std::process::Command::new("kill").args(["-INT", &pid]).status().expect("kill exists");
    assert!(killed.success());
    let output = child.wait_with_output().expect("ends");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert!((1.0..40.0).contains(&number(&summary, "/duration_s")), "{summary:#}");
    assert!(place.path("x/figure.svg").exists() && place.path("x/summary.json").exists());
    let verified = place.run(&["replay", "x/recording.mcap", "--verify", "--json"]).done().json();
    assert_eq!(verified["verify"]["bit_identical"], true);
    assert_eq!(verified["timing"]["ticks"], summary["timing"]["ticks"]);
}
