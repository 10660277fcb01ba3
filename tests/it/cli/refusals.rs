//! Wrong input: every one with what, where, got and expected, a hint, and the right exit code.

use super::{Place, shipped};

/// Runs the mock for a moment, with more arguments.
fn moment(place: &Place, args: &[&str]) -> super::Run {
    place.run(&[&["run", "--device", "mock:rest", "--duration-s", "0.01", "--pace", "max"], args].concat())
}

#[test]
fn devices_that_are_none() {
    let place = Place::new();
    for (device, parts) in [
        ("serial:/dev/no-such-port", &["/dev/no-such-port: there is no such port", "serial port"][..]),
        ("can:nope", &["nope"]),
        ("usb:1", &["`usb:1`: unknown scheme `usb`", "known: serial:"]),
        ("/dev/ttyUSB0", &["write `serial:/dev/ttyUSB0`"]),
        ("", &["no scheme"]),
        ("replay:", &["nothing after the scheme"]),
        ("serial:/dev/ttyS0?speed=9600", &["unknown option `speed`", "baud"]),
        ("serial:/dev/ttyS0?baud=99999999999", &["baud = `99999999999`"]),
        ("serial:/dev/null", &["/dev/null: cannot open it"]),
        ("mock:table", &["unknown mock `table`", "mock:chair"]),
        ("mock:chair?rpm=3", &["rpm", "rate_rpm"]),
        ("mock:chair?spin_s=-1", &["spin_s = -1", "expected 0 to 86400"]),
        ("mock:chair?rate_rpm=1e300", &["rate_rpm = 1e300", "expected -80 to 80"]),
        ("replay:nope.txt", &["nope.txt: cannot read it"]),
        ("replay:.", &[".: cannot read it", "directory"]),
    ] {
        let run = place.run(&["run", "--device", device, "--out", "out", "--record", "out/r.mcap"]);
        run.refused(2, parts);
        assert!(place.names().is_empty(), "{device} leaves something behind");
    }
    place.run(&["run"]).refused(2, &["no device to read from", "--device", "mock:chair"]);
}

#[test]
fn a_recording_of_zero_bytes() {
    let place = Place::new();
    for name in ["zero.mcap", "zero.txt"] {
        place.write(name, "");
        let device = format!("replay:{name}");
        place.run(&["run", "--device", &device]).refused(3, &[name, "empty"]);
        place.run(&["replay", name]).refused(3, &[name, "empty"]);
        place.run(&["inspect", name]).refused(3, &[name, "empty"]);
    }
}

#[test]
fn times_and_rates_that_cannot_be() {
    let place = Place::new();
    for (args, parts) in [
        (&["--duration-s", "-1"][..], &["--duration-s is -1, expected more than 0 s"][..]),
        (&["--duration-s", "NaN"], &["--duration-s is NaN"]),
        (&["--respawn", "0"], &["--respawn is 0"]),
    ] {
        place.run(&[&["run", "--device", "mock:rest"], args].concat()).refused(2, parts);
    }
    for (args, parts) in [
        (&["--spin-s", "-1"][..], &["spin_s = -1", "expected 0 to 86400"][..]),
        (&["--spin-s", "1", "--ramp-s", "2"], &["spin_s = 1", "at least ramp_s, which is 2"]),
        (&["--rest-s", "-0.5"], &["rest_s = -0.5"]),
        (&["--after-s", "1e300"], &["after_s = 1e300"]),
        (&["--rate-rpm", "NaN"], &["rate_rpm = NaN", "-80 to 80"]),
    ] {
        place.run(&[&["demo"], args].concat()).refused(2, parts);
    }
    place
        .run(&["run", "--device", "can:can0", "--rate-rpm", "3"])
        .refused(2, &["mock:chair, not to can:can0"]);
    assert!(place.names().is_empty());
}

#[test]
fn a_run_that_ends_before_its_sensor_is_known() {
    let run = Place::new().run(&["run", "--device", "mock:rest", "--duration-s", "0.3"]);
    run.complains(1, &["mock:rest: ended after 0.3 s", "in the first 1 s"]);
}

#[test]
fn a_device_has_its_own_pace() {
    for device in ["serial:/dev/ttyS0", "can:can0"] {
        let run = Place::new().run(&["run", "--device", device, "--pace", "max"]);
        run.refused(2, &[device, "--pace max is for recordings and mocks"]);
    }
}

#[test]
fn configurations() {
    let place = Place::new();
    for (text, parts) in [
        ("foo = 1", &["line 1", "unknown field `foo`", "--print-config"][..]),
        ("[core.balance]\nfrictoin = 1.0", &["line 2", "`frictoin`", "`friction`"]),
        ("[core.balance]\nfriction = -1.0", &["[core]", "balance.friction", "-1", "at most 10"]),
        ("[core]\nrespawn_after_s = -1.0", &["respawn_after_s", "-1", "0 to 3600 s"]),
        ("[core.fall]\nsway_limit_deg = 1e300", &["fall.sway_limit_deg", "1 to 60 deg"]),
        ("[core.pose]\nangles_deg = { nose = 1.0 }", &["c.toml"]),
        ("[live]\ncatch_up_s = -1.0", &["live.catch_up_s", "-1", "0.001 to 10 s"]),
        ("[imu]\nhold_limit_s = -0.1", &["hold_limit_s", "-0.1"]),
        ("[imu]\nhold_limit_s = \"long\"", &["line 2", "expected f64"]),
        ("observer_preset = \"mz\"", &["observer_preset", "`mz`", "merfeld-zupan-2002"]),
        ("motion = \"sleep\"", &["c.toml", "motion `sleep`", "reach, drink, stand-up"]),
        ("[[core.motion.pose]]\ntime_s = 0.0", &["[core]", "motion", "2 to 100"]),
        ("[core]\nmotion_start_s = -1.0", &["motion_start_s", "-1"]),
        ("device = \"usb:1\"", &["unknown scheme `usb`"]),
        ("= ", &["line 1"]),
    ] {
        place.write("c.toml", text);
        place.run(&["run", "--config", "c.toml"]).refused(2, parts);
    }
    place.run(&["run", "--config", "nope.toml"]).refused(2, &["nope.toml: cannot read it", "check the path"]);
}

#[test]
fn motions_that_are_none() {
    let place = Place::new();
    moment(&place, &["--motion", "sleep"])
        .refused(2, &["command line: motion `sleep`", "reach, drink, stand-up"]);
    moment(&place, &["--motion", "."]).refused(2, &[".: cannot read it", "folder"]);
    for (angles, parts) in [
        (
            "neck_y = -90",
            &["m.toml: pose 2: key `angles.neck_y` is -90", "-3.2 to 3.2 rad", "--print-config"][..],
        ),
        ("nose = 0.1", &["motion: pose 2", "no hinge `nose`", "neck_y"]),
        ("shank_l_y = 1.5", &["way to pose 2", "feet", "add up to 0"]),
    ] {
        let text = format!("[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 1\nangles = {{ {angles} }}");
        place.write("m.toml", text);
        moment(&place, &["--motion", "m.toml"]).refused(2, parts);
    }
}

#[test]
fn files_that_are_something_else() {
    let place = Place::new();
    place.write("garbage", [0x00, 0xFF, 0xFE, 0x80, 0x01]);
    for flag in ["--config", "--mount", "--calibration", "--log-map", "--character"] {
        moment(&place, &[flag, "garbage"]).refused(2, &["garbage: cannot read it", "UTF-8"]);
        moment(&place, &[flag, "."]).refused(2, &[".: cannot read it", "folder"]);
    }
    place.write("mount.toml", "matrix = 3");
    moment(&place, &["--mount", "mount.toml"]).refused(2, &["mount.toml", "line 1"]);
    moment(&place, &["--out", "garbage"]).refused(2, &["garbage: this is a file"]);
    moment(&place, &["--record", "none/r.mcap"]).refused(2, &["no folder none", "mkdir"]);
}

#[test]
fn a_mirrored_or_skewed_mount() {
    let place = Place::new();
    for (text, parts) in [
        ("matrix = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", &["mount.toml: matrix is mirrored", "-1.0"][..]),
        ("matrix = [[1, 0, 0], [0, 1, 0.1], [0, 0, 1]]", &["mount.toml: matrix is no rotation"]),
        ("matrix = [[nan, 0, 0], [0, 1, 0], [0, 0, 1]]", &["mount.toml: matrix"]),
        ("lever_arm_m = [0, 0, 0]", &["exactly one of", "matrix"]),
        ("axes = { forward = \"x\", up = \"-x\" }", &["lie on one line"]),
    ] {
        place.write("mount.toml", text);
        moment(&place, &["--mount", "mount.toml"]).refused(2, parts);
    }
}

#[test]
fn models_outside_the_subset() {
    let place = Place::new();
    let model = std::fs::read_to_string(shipped("configs/characters/standing.xml")).expect("shipped");
    let refuse = |text: &str, parts: &[&str]| {
        place.write("model.xml", text);
        moment(&place, &["--character", "model.xml"]).refused(2, parts);
    };
    refuse(
        &model.replacen("<worldbody>", "<worldbody><camera name=\"c\"/>", 1),
        &["model.xml:", "<camera>", "not supported", "supported there: "],
    );
    let (before, after) = model.split_once("<worldbody>").expect("has one");
    refuse(
        &format!("{before}<worldbody>{}", after.replacen("<body ", "<body mocap=\"true\" ", 1)),
        &["model.xml:", "`mocap` of <body>", "not supported"],
    );
    refuse(&model[..model.len() / 2], &["model.xml: not XML"]);
    refuse("<mujoco/>", &["model.xml: 0 bodies", "expected 19"]);
    refuse("", &["model.xml: not XML"]);
}

#[test]
fn logs_and_mappings_that_do_not_fit() {
    let place = Place::new();
    let mapping = shipped("configs/logs/arduino-mpu6050.toml");
    let good = "0 0 0 1 0 0 10\n".repeat(20);
    let run =
        |args: &[&str]| place.run(&[&["run", "--device", "replay:log.txt", "--pace", "max"], args].concat());
    place.write("log.txt", &good);
    run(&[]).refused(2, &["log.txt: ", "mapping", "--log-map"]);
    run(&["--protocol", "text"]).refused(2, &["log.txt: ", "mapping", "--log-map"]);
    let known = otolith::device::protocol::detect::protocol_names();
    run(&["--protocol", "morse"]).refused(2, &["protocol `morse` is not known", &known]);
    let phone = shipped("configs/logs/phyphox.toml");
    run(&["--log-map", &phone]).refused(2, &["log.txt: no column \"Gyroscope x (rad/s)\"", "gyro.columns"]);
    for (line, parts) in [
        (
            "0 0 0 1 0 0 NaN\n",
            &["log.txt, line 21: column 7 (gyro.columns)", "\"NaN\", expected a finite number"][..],
        ),
        ("0 0 0 1 0 0 inf\n", &["line 21", "\"inf\""]),
        ("0 0 0 1 0 x 10\n", &["line 21", "\"x\""]),
        ("0 0 0 1 0 0\n", &["line 21", "column 7"]),
    ] {
        place.write("log.txt", format!("{good}{line}{good}"));
        run(&["--log-map", &mapping]).refused(2, parts);
    }
    place.write("log.txt", "0 0 0 1 0 0\n");
    run(&["--log-map", &mapping]).refused(2, &["log.txt"]);
    place.write("log.txt", "# nothing\n\n");
    run(&["--log-map", &mapping]).refused(2, &["log.txt: no line with data"]);
    place.write("map.toml", "header = false\n[gyro]\ncolumns = [1, 2, 3]\nunit = \"rpm\"\n");
    run(&["--log-map", "map.toml"]).refused(2, &["map.toml", "rpm"]);
}

#[test]
fn a_source_is_not_overwritten_by_its_recording() {
    let place = Place::new();
    place.write("capture.bin", super::inspect::raw_capture());
    let before = std::fs::read(place.path("capture.bin")).expect("written");
    let args =
        ["run", "--device", "replay:capture.bin", "--pace", "max", "--record", "./capture.bin", "--force"];
    place.run(&args).refused(2, &["played and written at once"]);
    assert_eq!(std::fs::read(place.path("capture.bin")).expect("still there"), before);
}

#[cfg(unix)]
#[test]
fn a_line_too_slow_for_the_announced_rate() {
    use std::time::Duration;

    use otolith::time::{Clock, SystemClock};

    /// Ends a hang; never decides the test.
    const PATIENCE: u32 = 80;

    let place = Place::new();
    let device = crate::pty::Device::plug_in(&place.path(""));
    let selector = format!("serial:{}?baud=115200", device.port());
    let args = ["run", "--device", &selector, "--duration-s", "20"];
    let mut child = place.spawn(&args);
    let capture = super::inspect::raw_capture();
    let hello = &capture[..capture.iter().position(|byte| *byte == 0).expect("a frame ends with 0") + 1];
    let clock = SystemClock::start_now();
    for _ in 0..PATIENCE {
        if child.try_wait().expect("a child").is_some() {
            break;
        }
        device.write(hello);
        clock.sleep_until(clock.now() + Duration::from_millis(50));
    }
    let output = child.wait_with_output().expect("ends");
    let run = super::Run {
        code: output.status.code().expect("not killed"),
        stdout: String::from_utf8(output.stdout).expect("UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("UTF-8"),
    };
    run.refused(
        2,
        &["serial line too slow: 1000 samples/s", "115200 baud", "set device and selector to 230400 baud"],
    );
}
