use std::path::Path;

use super::survey::Survey;
use super::*;
use crate::device::can::CanDetails;
use crate::device::can::bus::BusState;
use crate::device::probe::{Look, MeanSample, Verdict};
use crate::device::protocol::can_map::BusReport;
use crate::device::protocol::{DecodeCounters, DeviceInfo};
use crate::units::RAD_PER_DEG;

fn serial() -> SerialFacts {
    SerialFacts {
        node: "/dev/ttyUSB0".into(),
        access: Access::Granted,
        group: Some("dialout".into()),
        holders: Vec::new(),
        latency_timer_ms: Some(1),
        modem_manager: false,
        rules_installed: false,
        usb: true,
        pseudo_terminal: false,
        asked_baud: Some(115_200),
    }
}

/// A sensor at rest that has nothing wrong with it: 100 Hz in 40 bytes at 115200 baud, 2000 deg/s.
fn healthy() -> Heard {
    Heard {
        verdict: Verdict::Protocol,
        protocol: Some("some"),
        baud: Some(115_200),
        rate_hz: Some(99.8),
        announced_rate_hz: Some(100.0),
        wire_bytes_per_sample: Some(40.0),
        bytes_per_s: Some(4000.0),
        sample: Some(MeanSample {
            samples: 100,
            without_rotation: 0,
            clipped: 0,
            gyro_deg_s: [0.1, -0.2, 0.05],
            specific_force_m_s2: Some([0.1, 0.2, 9.8]),
        }),
        device: Some(DeviceInfo { gyro_range: Some(2000.0 * RAD_PER_DEG), ..DeviceInfo::default() }),
        counters: DecodeCounters { packets: 100, ..DecodeCounters::default() },
        ..Heard::default()
    }
}

fn facts(serial: SerialFacts, refusal: Option<Refusal>, heard: Option<Heard>) -> PortFacts {
    PortFacts {
        selector: "serial:/dev/ttyUSB0".into(),
        link: LinkFacts::Serial(serial),
        refusal,
        heard,
        intended_rate_rpm: Some(30.0),
    }
}

/// The checks that complain, and all they say in one string.
fn told(facts: &PortFacts) -> (Vec<&'static str>, String) {
    let findings = judge(facts);
    let text = findings.iter().map(|finding| format!("{} {} {}\n", finding.what, finding.why, finding.mend));
    (findings.iter().map(|finding| finding.check).collect(), text.collect())
}

/// What is said about a sensor that is healthy but for `change`.
fn told_of(change: impl FnOnce(&mut Heard)) -> (Vec<&'static str>, String) {
    let mut heard = healthy();
    change(&mut heard);
    told(&facts(serial(), None, Some(heard)))
}

fn sample(heard: &mut Heard) -> &mut MeanSample {
    heard.sample.as_mut().expect("it has one")
}

#[track_caller]
fn assert_told(told: (Vec<&'static str>, String), check: &str, parts: &[&str]) {
    assert_eq!(told.0, [check], "{}", told.1);
    for part in parts {
        assert!(told.1.contains(part), "`{part}` is missing in: {}", told.1);
    }
}

#[test]
fn a_healthy_sensor_has_no_finding() {
    assert_eq!(told_of(|_| ()).0, [""; 0]);
}

#[test]
fn what_keeps_a_port_from_opening_is_named_with_its_command() {
    let denied = SerialFacts { access: Access::Denied, group: Some("uucp".into()), ..serial() };
    assert_told(
        told(&facts(denied, None, None)),
        "permission",
        &["group uucp", "sudo usermod -aG uucp $USER"],
    );
    let denied_late = facts(SerialFacts { group: None, ..serial() }, Some(Refusal::Denied), None);
    assert_told(told(&denied_late), "permission", &["sudo usermod -aG dialout $USER", "--print-udev-rules"]);
    let roots = SerialFacts { access: Access::Denied, group: Some("root".into()), ..serial() };
    let (_, text) = told(&facts(roots, None, None));
    assert!(!text.contains("usermod") && text.contains("--print-udev-rules"), "{text}");

    let holder = |program: &str| Holder { pid: 4711, program: program.into() };
    let held = |program: &str| facts(SerialFacts { holders: vec![holder(program)], ..serial() }, None, None);
    assert_told(told(&held("minicom")), "busy", &["minicom (process 4711) holds /dev/ttyUSB0", "kill 4711"]);
    assert_told(told(&held("ModemManager")), "busy", &["sudo systemctl stop ModemManager"]);
    let by_somebody = facts(serial(), Some(Refusal::Busy), None);
    assert_told(told(&by_somebody), "busy", &["sudo fuser -v /dev/ttyUSB0"]);

    let missing = facts(serial(), Some(Refusal::Missing("ports: a, b".into())), None);
    assert_told(told(&missing), "missing", &["no such port", "ports: a, b"]);
    let other = facts(serial(), Some(Refusal::Other("not a typewriter".into())), None);
    assert_told(told(&other), "open", &["not a typewriter"]);
}

#[test]
fn the_drivers_delay_and_modem_manager_are_told() {
    let slow = SerialFacts { latency_timer_ms: Some(16), ..serial() };
    let command = "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
    assert_told(told(&facts(slow, None, None)), "latency_timer", &["up to 16 ms", command]);
    let asked = SerialFacts { modem_manager: true, ..serial() };
    let findings = judge(&facts(asked.clone(), None, None));
    assert_eq!((findings[0].check, findings[0].level, findings.len()), ("modem_manager", Level::Note, 1));
    let told_off = SerialFacts { rules_installed: true, ..asked };
    assert_eq!(judge(&facts(told_off, None, None)), []);
}

#[test]
fn a_wrong_speed_and_a_full_line_are_told_with_numbers() {
    let parts = ["speaks at 57600 baud, the selector says 115200", "'serial:/dev/ttyUSB0?baud=57600'"];
    assert_told(told_of(|heard| heard.baud = Some(57_600)), "baud", &parts);
    let parts = ["400 samples/s of at least 40.0 bytes are 139 % of 115200 baud", "230400 baud (69 %)"];
    let announced = |heard: &mut Heard| (heard.announced_rate_hz, heard.rate_hz) = (Some(400.0), Some(399.0));
    assert_told(told_of(announced), "bandwidth", &parts);
    let measured = |heard: &mut Heard| {
        (heard.wire_bytes_per_sample, heard.bytes_per_s) = (None, Some(11_000.0));
    };
    assert_told(told_of(measured), "bandwidth", &["95 % of 115200 baud", "the limit is 85 %"]);
    // A pseudo-terminal has no speed to be wrong about.
    let mut heard = healthy();
    heard.baud = Some(57_600);
    let pseudo = SerialFacts { pseudo_terminal: true, ..serial() };
    assert_eq!(judge(&facts(pseudo, None, Some(heard))), []);
}

#[test]
fn silence_and_strangers_are_told_apart() {
    let silent = Heard { listened_s: 3.0, ..Heard::default() };
    assert_told(
        told(&facts(serial(), None, Some(silent))),
        "silence",
        &["not one byte in 3.0 s", "TX", "power"],
    );
    let silent = Heard { listened_s: 3.0, ..Heard::default() };
    let level = |usb, asked_baud| {
        let serial = SerialFacts { usb, asked_baud, ..serial() };
        judge(&facts(serial, None, Some(silent.clone())))[0].level
    };
    assert_eq!((level(false, None), level(true, None)), (Level::Note, Level::Mend), "nobody has named it");
    assert_eq!(level(false, Some(9600)), Level::Mend);
    let gone = facts(serial(), Some(Refusal::Lost("broken pipe".into())), None);
    assert_told(told(&gone), "lost", &["went away while it was listened to: broken pipe", "cable"]);

    let look = |baud, smooth_bytes| Look { baud, bytes: 500, good_packets: 0, smooth_bytes };
    let unknown = |looks| Heard { verdict: Verdict::Unknown, bytes: 1000, looks, ..Heard::default() };
    let slower = unknown(vec![look(115_200, 450), look(57_600, 400), look(9600, 40)]);
    let parts = ["1000 bytes, but no protocol at 115200, 57600, 9600 baud", "slower than 57600 baud"];
    assert_told(told(&facts(serial(), None, Some(slower))), "unknown", &parts);
    let stranger = unknown(vec![look(115_200, 31)]);
    assert_told(told(&facts(serial(), None, Some(stranger))), "unknown", &["does not read"]);

    let text = Heard { verdict: Verdict::Text, text_columns: Some(7), baud: Some(9600), ..Heard::default() };
    let findings = judge(&facts(serial(), None, Some(text)));
    assert_eq!((findings[0].check, findings[0].level), ("text", Level::Note));
    assert!(findings[0].mend.contains("'serial:/dev/ttyUSB0?baud=9600' --log-map"), "{:?}", findings[0]);
}

#[test]
fn losses_are_told_when_they_are_more_than_a_few() {
    let bad = |bad_checksum| {
        told_of(|heard| heard.counters = DecodeCounters { packets: 1000, bad_checksum, ..heard.counters })
    };
    assert_eq!(bad(9).0, [""; 0]);
    let first_cut = |heard: &mut Heard| (heard.counters.packets, heard.counters.bad_checksum) = (30, 1);
    assert_eq!(told_of(first_cut).0, [""; 0]);
    assert_told(bad(20), "checksum", &["20 of 1020 packets are damaged"]);
    let missing = |heard: &mut Heard| heard.counters.missing = 5;
    assert_told(told_of(missing), "loss", &["5 packets are missing"]);
    assert_told(told_of(|heard| heard.rate_hz = Some(60.0)), "rate", &["60.0 samples/s arrive of 100.0"]);
}

#[test]
fn a_sensor_that_cannot_measure_the_spin_is_told() {
    let range =
        |dps: f64| told_of(|heard| heard.device.as_mut().expect("told").gyro_range = Some(dps * RAD_PER_DEG));
    assert_eq!(range(181.0).0, [""; 0]);
    assert_told(range(163.0), "range", &["up to 163 deg/s, 30 rpm are 180 deg/s", "27 rpm at most"]);
    assert_told(told_of(|heard| sample(heard).clipped = 3), "clipping", &["3 of 100 samples"]);
    assert_told(
        told_of(|heard| sample(heard).without_rotation = 100),
        "dead_band",
        &["exactly 0 in all 100"],
    );
    assert_eq!(told_of(|heard| sample(heard).without_rotation = 99).0, [""; 0]);
    assert_told(told_of(|heard| heard.sample = None), "no_samples", &["no angular velocity"]);
    let without = |heard: &mut Heard| sample(heard).specific_force_m_s2 = None;
    assert_told(told_of(without), "accelerometer", &["no specific force"]);
}

#[test]
fn unit_and_sign_of_gravity_are_judged_at_rest() {
    let force = |force: [f64; 3]| told_of(|heard| sample(heard).specific_force_m_s2 = Some(force));
    assert_told(force([0.01, -0.02, 0.99]), "gravity", &["0.99 m/s2, expected 9.81", "looks like g"]);
    assert_told(force([0.01, 0.02, 0.03]), "gravity", &["without gravity"]);
    assert_told(force([0.0, 0.0, 13.0]), "gravity", &["13.00 m/s2", "keep the sensor still"]);
    assert_eq!(force([6.9, 0.0, -6.9]).0, [""; 0], "no axis is vertical");
    let findings = judge(&{
        let mut heard = healthy();
        sample(&mut heard).specific_force_m_s2 = Some([0.0, -9.7, -1.6]);
        facts(serial(), None, Some(heard))
    });
    assert_eq!((findings[0].check, findings[0].level), ("gravity_sign", Level::Note));
    assert!(findings[0].what.starts_with("-y points up: -9.70"), "{findings:?}");
    let turning = |heard: &mut Heard| {
        sample(heard).gyro_deg_s = [0.0, 0.0, 200.0];
        sample(heard).specific_force_m_s2 = Some([9.0, 0.0, 9.81]);
    };
    assert_eq!(told_of(turning).0, [""; 0]);
}

#[test]
fn a_can_interface_is_judged_by_its_state_and_its_silence() {
    let can = |exists, up, refusal, heard| PortFacts {
        selector: "can:can0?node=2".into(),
        link: LinkFacts::Can(CanFacts { exists, up, details: None }),
        refusal,
        heard,
        intended_rate_rpm: None,
    };
    assert_told(told(&can(false, false, None, None)), "missing", &["no CAN interface can0"]);
    let no_can = can(false, false, Some(Refusal::Other("no CAN in the kernel".into())), None);
    assert_told(told(&no_can), "open", &["no CAN in the kernel"]);
    let command = "sudo ip link set can0 up type can bitrate";
    assert_told(told(&can(true, false, None, None)), "down", &["can0 is down", command]);
    let silent = |bus_errors| Heard { bus_errors, ..Heard::default() };
    assert_told(told(&can(true, true, None, Some(silent(0)))), "silence", &["120 ohm"]);
    assert_told(told(&can(true, true, None, Some(silent(9)))), "silence", &["9 bus errors", "bitrate"]);
    let strangers = Heard { verdict: Verdict::Unknown, frames: 100, ids: 7, ..Heard::default() };
    let said = ["100 frames with 7 identifiers", "candump -l"];
    assert_told(told(&can(true, true, None, Some(strangers.clone()))), "unknown", &said);
    let fitting = BusReport { fitting_maps: vec!["sbg".to_owned()], ..BusReport::default() };
    let described = Heard { can: Some(fitting), ..strangers };
    let command = "otolith run --device can:can0 --map sbg";
    assert_told(told(&can(true, true, None, Some(described))), "unknown", &[command]);
    let refused = can(true, true, Some(Refusal::Other("no".into())), None);
    assert_told(told(&refused), "open", &["does not open: no"]);
}

#[test]
fn a_can_controller_is_judged_by_its_state() {
    let with = |state, restart_ms| {
        let kind = Some("can".to_owned());
        let details = CanDetails { up: true, kind, bitrate: Some(250_000), state, restart_ms };
        told(&PortFacts {
            selector: "can:can0".into(),
            link: LinkFacts::Can(CanFacts { exists: true, up: true, details: Some(details) }),
            refusal: None,
            heard: None,
            intended_rate_rpm: None,
        })
    };
    assert_told(with(Some(BusState::BusOff), Some(0)), "bus_off", &["250000 bit/s", "type can restart"]);
    assert_told(with(Some(BusState::ErrorPassive), Some(100)), "bus_errors", &["120 ohm", "250000"]);
    assert_told(with(Some(BusState::ErrorActive), Some(0)), "restart", &["restart-ms 100"]);
    let (checks, _) = with(Some(BusState::ErrorActive), Some(100));
    assert_eq!(checks, [""; 0]);
}

/// Writes a file with the folders it lies in.
fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    std::fs::write(path, text).expect("written");
}

#[cfg(unix)]
#[test]
fn a_machine_is_surveyed_by_its_files() {
    use std::os::unix::fs::{MetadataExt, symlink};

    let folder = tempfile::tempdir().expect("a folder");
    let root = std::fs::canonicalize(folder.path()).expect("exists");
    write(&root, "dev/ttyUSB0", "");
    std::fs::create_dir_all(root.join("dev/serial/by-id")).expect("made");
    symlink(root.join("dev/ttyUSB0"), root.join("dev/serial/by-id/usb-FTDI")).expect("linked");
    let gid = std::fs::metadata(root.join("dev/ttyUSB0")).expect("exists").gid();
    write(&root, "etc/group", &format!("adm:x:999999:\nimu:x:{gid}:alice\n"));
    write(&root, "sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16\n");
    write(&root, "proc/17/comm", "minicom\n");
    write(&root, "proc/18/comm", "ModemManager\n");
    write(&root, "proc/uptime", "1 2\n");
    for (pid, target) in [(17, "dev/ttyUSB0"), (18, "dev/null")] {
        let fds = root.join(format!("proc/{pid}/fd"));
        std::fs::create_dir_all(&fds).expect("made");
        symlink(root.join(target), fds.join("3")).expect("linked");
    }
    let survey = Survey::below(&root);
    let facts = survey.serial("/dev/serial/by-id/usb-FTDI", Access::Granted, None);
    assert_eq!(facts.node, root.join("dev/ttyUSB0").display().to_string());
    assert_eq!(facts.group.as_deref(), Some("imu"));
    assert_eq!(facts.holders, [Holder { pid: 17, program: "minicom".into() }]);
    assert_eq!(facts.latency_timer_ms, Some(16));
    assert!(facts.modem_manager && !facts.rules_installed && !facts.pseudo_terminal);

    write(&root, "etc/udev/rules.d/70-otolith.rules", UDEV_RULES);
    write(&root, "dev/ttyS0", "");
    let other = survey.serial("/dev/ttyS0", Access::Granted, None);
    assert!(other.rules_installed && !other.modem_manager && other.holders.is_empty());
    assert_eq!(other.latency_timer_ms, None);

    write(&root, "sys/class/net/can0/type", "280\n");
    assert!(survey.can("can0", true, None).exists && !survey.can("can1", false, None).exists);
}

/// A rule is matches and assignments, `KEY operator "value"`, between commas.
#[test]
fn the_rules_for_udev_are_rules() {
    let rules: Vec<&str> =
        UDEV_RULES.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
    assert_eq!(rules.len(), 2);
    for rule in rules {
        for part in rule.split(", ") {
            let (key, value) = part.split_once('=').expect("an operator");
            let value = value.trim_start_matches('=');
            assert!(value.len() > 2 && value.starts_with('"') && value.ends_with('"'), "{part}");
            assert!(key.starts_with(|c: char| c.is_ascii_uppercase()), "{part}");
        }
    }
    for part in [
        r#"DRIVER=="ftdi_sio", ATTR{latency_timer}="1""#,
        r#"TAG+="uaccess""#,
        "ID_MM_DEVICE_IGNORE",
        "dialout",
    ] {
        assert!(UDEV_RULES.contains(part), "{part}");
    }
}
