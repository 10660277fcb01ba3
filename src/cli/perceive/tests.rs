//! Wrong input is named with file, line and column, and leaves nothing behind.

use std::fs;

use super::*;

const HEADER: &str = "t_s,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,\
                      specific_force_x_m_s2,specific_force_y_m_s2,specific_force_z_m_s2";
const REST: &str = "0,0,0,0,0,0,9.80665\n0.01,0,0,0,0,0,9.80665\n";

fn args(folder: &tempfile::TempDir, text: &str) -> PerceiveArgs {
    let input = folder.path().join("in.csv");
    fs::write(&input, text).unwrap();
    let out = folder.path().join("out.csv");
    PerceiveArgs { input, out, preset: DEFAULT_PRESET.to_owned(), initial_gravity_hat: None, force: false }
}

/// Runs on `text`, expects an error that names all of `parts` and has a hint, and no file but the input.
fn refused(text: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let error = run(&args(&folder, text)).unwrap_err();
    let message = error.to_string();
    for part in parts.iter().chain(&["\n\nhint: "]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    assert!(error.is_bad_input());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{message}");
}

#[test]
fn rest_is_perceived_as_rest() {
    let folder = tempfile::tempdir().unwrap();
    let args = args(&folder, &format!("{HEADER}\n{REST}"));
    let summary = run(&args).unwrap();
    assert_eq!((summary.rows, summary.duration_s, summary.peak_gravity_tilt_deg), (2, 0.01, 0.0));
    let out = fs::read_to_string(&args.out).unwrap();
    assert_eq!(
        out.lines().next().unwrap(),
        "t_s,omega_hat_x_rad_s,omega_hat_y_rad_s,omega_hat_z_rad_s,gravity_hat_x_m_s2,gravity_hat_y_m_s2,\
         gravity_hat_z_m_s2,acceleration_hat_x_m_s2,acceleration_hat_y_m_s2,acceleration_hat_z_m_s2,gravity_tilt_deg"
    );
    assert_eq!(out.lines().count(), 3);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn columns_are_found_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let text = "note, specific_force_z_m_s2,specific_force_y_m_s2,specific_force_x_m_s2,\
                omega_z_rad_s,omega_y_rad_s,omega_x_rad_s,t_s\n\
                first, 9.8,0,0,1,0,0,5\nsecond, 9.8,0,0,1,0,0,5.01\n";
    let summary = run(&args(&folder, text)).unwrap();
    assert_eq!((summary.rows, summary.peak_gravity_tilt_at_s), (2, 5.0));
    // Adapted to the turn it starts in.
    assert_eq!(summary.peak_omega_hat_rad_s, 0.0);
}

#[test]
fn wrong_input_is_named() {
    let header_without = HEADER.replace("omega_y_rad_s,", "");
    refused("", &["in.csv", "no rows"]);
    refused(&format!("{HEADER}\n"), &["in.csv", "no rows"]);
    refused(&format!("{header_without}\n0,0,0,0,0,9.8\n"), &["in.csv:1:", "`omega_y_rad_s` is missing"]);
    refused(&format!("{HEADER},t_s\n0,0,0,0,0,0,9.8,0\n"), &["in.csv:1:", "`t_s` appears more than once"]);
    refused(&format!("{HEADER}\n{REST}0.02,0,NaN,0,0,0,9.8\n"), &["in.csv:4:", "`omega_y_rad_s` is `NaN`"]);
    refused(&format!("{HEADER}\n{REST}0.02,0,0,inf,0,0,9.8\n"), &["in.csv:4:", "`omega_z_rad_s` is `inf`"]);
    refused(&format!("{HEADER}\n{REST}0.02,0,0,0,0,0,9,8\n"), &["in.csv:4:", "cannot read this row"]);
    refused(
        &format!("{HEADER}\n{REST}0.02,1e300,0,0,0,0,9.8\n"),
        &["in.csv:4:", "`omega_x_rad_s` is `1e300`"],
    );
    refused(&format!("{HEADER}\n0,,0,0,0,0,9.8\n"), &["in.csv:2:", "`omega_x_rad_s` is ``"]);
    refused(&format!("{HEADER}\n{REST}0.01,0,0,0,0,0,9.8\n"), &["in.csv:4:", "0.01", "expected more than"]);
    refused(&format!("{HEADER}\n{REST}-1,0,0,0,0,0,9.8\n"), &["in.csv:4:", "-1", "expected more than"]);
    refused(&format!("{HEADER}\n{REST}10000,0,0,0,0,0,9.8\n"), &["in.csv:4:", "10000", "in seconds?"]);
    refused(&format!("{HEADER}\n0,0,0,0,0,0,0\n"), &["in.csv", "is no gravity", "--initial-gravity-hat"]);
}

#[test]
fn an_output_is_only_overwritten_by_force() {
    let folder = tempfile::tempdir().unwrap();
    let mut args = args(&folder, &format!("{HEADER}\n{REST}"));
    fs::write(&args.out, "mine").unwrap();
    let error = run(&args).unwrap_err();
    assert!(error.to_string().contains("out.csv exists") && error.is_bad_input(), "{error}");
    assert_eq!(fs::read_to_string(&args.out).unwrap(), "mine");
    args.force = true;
    run(&args).unwrap();
    assert!(fs::read_to_string(&args.out).unwrap().starts_with("t_s,"));
}

#[test]
fn missing_files_and_folders_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut args = args(&folder, &format!("{HEADER}\n{REST}"));
    args.out = folder.path().join("no/such/folder/out.csv");
    let error = run(&args).unwrap_err();
    assert!(error.to_string().contains("cannot write") && !error.is_bad_input(), "{error}");
    args.input = folder.path().join("none.csv");
    let error = run(&args).unwrap_err();
    assert!(error.to_string().contains("none.csv") && error.is_bad_input(), "{error}");
}

#[test]
fn the_command_line_is_understood() {
    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: PerceiveArgs,
    }
    let parse = |extra: &[&str]| {
        let base = ["perceive", "in.csv", "--out", "out.csv"];
        <Command as clap::Parser>::try_parse_from(base.iter().chain(extra)).map(|command| command.args)
    };
    let args = parse(&["--initial-gravity-hat", "-0.5,4.9,-8.5", "--preset", "irmak-2023"]).unwrap();
    assert_eq!(args.initial_gravity_hat, Some(Vector3::new(-0.5, 4.9, -8.5)));
    assert_eq!(args.preset, "irmak-2023");
    assert_eq!(parse(&[]).unwrap().preset, "seed");
    for wrong in [
        &["--preset", "human"][..],
        &["--initial-gravity-hat", "1,2"],
        &["--initial-gravity-hat", "1,2,NaN"],
        &["--initial-gravity-hat", "1,2,down"],
    ] {
        assert!(parse(wrong).is_err(), "{wrong:?}");
    }
}
