//! `otolith perceive` on golden stimuli, file to file.

use super::{Place, number};
use crate::observer_cases::named;
use crate::observer_golden::{check_percepts, head_motion_csv};

#[test]
fn the_golden_percepts_come_out_of_the_program() {
    for (case, rate_hz) in
        [("b_30rpm_15s", 1000), ("c_postrot_tilt45__mz2002", 100), ("e_ghat_offset30", 1000)]
    {
        let (case, place) = (named(case), Place::new());
        place.write("in.csv", head_motion_csv(&case, rate_hz));
        let mut args = vec!["perceive", "in.csv", "--out", "out.csv", "--json", "--preset", &case.preset];
        let gravity_hat = case.gravity_hat.map(|g| format!("{},{},{}", g.x, g.y, g.z));
        if let Some(gravity_hat) = &gravity_hat {
            args.extend(["--initial-gravity-hat", gravity_hat]);
        }
        let summary = place.run(&args).done().json();
        assert_eq!(number(&summary, "/rows"), case.duration_s * f64::from(rate_hz) + 1.0);
        let out = std::fs::read_to_string(place.path("out.csv")).expect("written");
        check_percepts(&case, &out, rate_hz);
    }
}

#[test]
fn the_output_has_the_named_columns_and_is_not_overwritten() {
    let place = Place::new();
    place.write("in.csv", head_motion_csv(&named("e_roll30"), 100));
    let args = ["perceive", "in.csv", "--out", "out.csv"];
    let run = place.run(&args).done();
    assert!(run.stdout.contains("peak gravity tilt"), "{}", run.stdout);
    let out = std::fs::read_to_string(place.path("out.csv")).expect("written");
    assert_eq!(
        out.lines().next().expect("a header"),
        "t_s,omega_hat_x_rad_s,omega_hat_y_rad_s,omega_hat_z_rad_s,gravity_hat_x_m_s2,gravity_hat_y_m_s2,\
         gravity_hat_z_m_s2,acceleration_hat_x_m_s2,acceleration_hat_y_m_s2,acceleration_hat_z_m_s2,gravity_tilt_deg"
    );
    place.run(&args).refused(2, &["out.csv", "--force"]);
    place.run(&[&args[..], &["--force"]].concat()).done();
    assert_eq!(place.names(), ["in.csv", "out.csv"]);
}

#[test]
fn a_bad_table_is_refused_with_line_and_column() {
    const HEADER: &str = "t_s,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,\
                          specific_force_x_m_s2,specific_force_y_m_s2,specific_force_z_m_s2\n";
    let place = Place::new();
    for (table, parts) in [
        (
            format!("{HEADER}0,0,0,0,0,0,9.8\n0.1,0,0,NaN,0,0,9.8\n"),
            &["in.csv:3", "omega_z_rad_s", "`NaN`"][..],
        ),
        (format!("{HEADER}0,0,0,0,0,0,9.8\n0.1,0,0,inf,0,0,9.8\n"), &["in.csv:3", "`inf`"]),
        (format!("{HEADER}0,0,0,0,0,0,9.8\n0.1,0,0,1e300,0,0,9.8\n"), &["in.csv:3", "`1e300`"]),
        (format!("{HEADER}0.1,0,0,0,0,0,9.8\n0.0,0,0,0,0,0,9.8\n"), &["in.csv:3", "`t_s` is 0", "0.1"]),
        (format!("{HEADER}0,0,0,0,0,0,9.8\n0,0,0,0,0,0,9.8\n"), &["in.csv:3", "`t_s` is 0"]),
        (format!("{HEADER}0,0,0,0,0,0,9.8\n0.1,0,0\n"), &["in.csv:3"]),
        (
            HEADER.replace("omega_y", "omega_q") + "0,0,0,0,0,0,9.8\n",
            &["in.csv:1", "`omega_y_rad_s` is missing"],
        ),
        (HEADER.to_owned(), &["in.csv", "no rows"]),
        (String::new(), &["in.csv", "no rows"]),
        (format!("{HEADER}0,0,0,0,0,0,0\n"), &["in.csv", "no gravity"]),
    ] {
        place.write("in.csv", &table);
        place.run(&["perceive", "in.csv", "--out", "out.csv"]).refused(2, parts);
    }
    place.write("in.csv", [0xFF, 0xFE, 0x00, b'\n']);
    place.run(&["perceive", "in.csv", "--out", "out.csv"]).refused(2, &["in.csv:1"]);
    place.run(&["perceive", ".", "--out", "out.csv"]).refused(2, &["cannot open .", "directory"]);
    place.run(&["perceive", "nope.csv", "--out", "out.csv"]).refused(2, &["cannot open nope.csv"]);
    place.write("in.csv", format!("{HEADER}0,0,0,0,0,0,9.8\n"));
    place.run(&["perceive", "in.csv", "--out", "none/out.csv"]).refused(1, &["cannot write none/out.csv"]);
    assert_eq!(place.names(), ["in.csv"], "no refused call leaves a file");
}
