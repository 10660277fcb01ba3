//! Mapping files: what is refused, and in which words.

use super::*;

const DBC: &str = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: A\n\n\
    BO_ 16 RATE: 8 A\n SG_ X : 0|16@1- (0.1,0) [0|0] \"\" A\n SG_ Y : 16|16@1- (0.1,0) [0|0] \"\" A\n \
    SG_ Z : 32|16@1- (0.1,0) [0|0] \"\" A\n SG_ N : 48|8@1+ (1,0) [0|0] \"\" A\n\n\
    BO_ 17 FORCE: 8 A\n SG_ X : 0|16@1- (0.01,0) [0|0] \"\" A\n SG_ Y : 16|16@1- (0.01,0) [0|0] \"\" A\n \
    SG_ Z : 32|16@1- (0.01,0) [0|0] \"\" A\n SG_ N : 48|8@1+ (1,0) [0|0] \"\" A\n SG_ LONG : 60|8@1+ (1,0) [0|0] \"\" A\n\n\
    BO_ 18 BOTH: 8 A\n SG_ WHICH M : 0|8@1+ (1,0) [0|0] \"\" A\n SG_ GX m0 : 8|16@1- (0.1,0) [0|0] \"\" A\n \
    SG_ GY m0 : 24|16@1- (0.1,0) [0|0] \"\" A\n SG_ GZ m0 : 40|16@1- (0.1,0) [0|0] \"\" A\n \
    SG_ AX m1 : 8|16@1- (0.01,0) [0|0] \"\" A\n SG_ AY m1 : 24|16@1- (0.01,0) [0|0] \"\" A\n \
    SG_ AZ m1 : 40|16@1- (0.01,0) [0|0] \"\" A\n SG_ TICK : 56|8@1+ (1,0) [0|0] \"\" A\n\n\
    BO_ 5000 WIDE: 8 A\n SG_ X : 0|16@1- (1,0) [0|0] \"\" A\n\n\
    BO_ 19 BRIEF: 2 A\n SG_ X : 8|16@1- (1,0) [0|0] \"\" A\n SG_ LOST m3 : 0|8@1- (1,0) [0|0] \"\" A\n";

const MAP: &str = "[gyro]\nx = \"RATE.X\"\ny = \"RATE.Y\"\nz = \"RATE.Z\"\nunit = \"deg/s\"\n\
    [specific_force]\nx = \"FORCE.X\"\ny = \"FORCE.Y\"\nz = \"FORCE.Z\"\nunit = \"m/s^2\"\n\
    [pairing]\norder = [\"RATE\", \"FORCE\"]\n";

fn compile(map: &str) -> Result<CanMap, String> {
    CanMap::new("map.toml", map, "my.dbc", DBC).map_err(|error| error.to_string())
}

#[test]
fn every_ready_mapping_compiles_and_is_known_by_its_name() {
    for shipped in CAN_MAPS {
        let map = ready(shipped.name);
        assert!(map.messages().any(|message| message.required), "{}", shipped.name);
        assert!(can_map_names().contains(shipped.name));
        // The name of the DBC file in the mapping is that of the text beside it.
        let mapping = CanMapping::from_toml(shipped.name, shipped.map).unwrap();
        assert!(mapping.dbc().unwrap().ends_with(shipped.dbc_name), "{}", shipped.name);
    }
    assert!(shipped_can_map("nope").is_none());
}

#[test]
fn wrong_values_name_file_key_and_what_is_allowed() {
    compile(MAP).unwrap();
    let upright = MAP.replace("z = \"FORCE.Z\"\n", "");
    for (map, said) in [
        (format!("rate_hz = 0.0\n{MAP}"), "map.toml: rate_hz is 0, allowed is 0.1 to 20000 Hz\n\nhint: "),
        (
            MAP.replace("y = \"RATE.Y\"\n", ""),
            "map.toml: gyro.y is missing, allowed is a signal MESSAGE.SIGNAL, or",
        ),
        (format!("absent = [\"gyro.y\"]\n{MAP}"), "map.toml: gyro.y is mapped and absent, allowed is"),
        (
            format!("absent = [\"specific_force.z\"]\n{upright}"),
            "map.toml: assume_upright is false, allowed is true",
        ),
        (
            format!("assume_upright = true\n{MAP}"),
            "map.toml: assume_upright is true, allowed is true exactly where",
        ),
        (
            MAP.replace("[spec", "signs = [1, 0, 1]\n[spec"),
            "map.toml: signs is 0, allowed is 1 or -1 for each axis",
        ),
        (
            MAP.replace("[spec", "full_scale = -1\n[spec"),
            "map.toml: full_scale of gyro.x is -1, allowed is a number above 0",
        ),
        (
            format!("{MAP}[time]\nsignal = \"RATE.N\"\nunit = \"ms\"\nwraps_after = 0\n"),
            "map.toml: time.wraps_after is 0, allowed is",
        ),
        (
            format!("{MAP}[counter]\nsignal = \"RATE.N\"\nwraps_after = 1\n"),
            "map.toml: counter.wraps_after is 1, allowed is 2 to",
        ),
    ] {
        let error = compile(&map).unwrap_err();
        assert!(error.starts_with(said) && error.contains("\n\nhint: "), "{error}");
    }
    compile(&format!("absent = [\"specific_force.z\"]\nassume_upright = true\n{upright}")).unwrap();
}

#[test]
fn wrong_keys_and_types_name_line_and_choice() {
    for (map, word) in [
        (MAP.replace("deg/s", "dps"), "`rad/s` or `deg/s`"),
        (format!("bitrate = 5\n{MAP}"), "unknown field `bitrate`"),
        (format!("absent = [\"gyro.w\"]\n{MAP}"), "unknown variant `gyro.w`"),
        (format!("checksum = \"crc\"\n{MAP}"), "`toyota`"),
        (MAP.replace("RATE.X", "RATE"), "`RATE` is no signal, expected MESSAGE.SIGNAL"),
        ("rate_hz = 9".to_owned(), "missing field `gyro`"),
        (format!("id_mask = -1\n{MAP}"), "id_mask"),
    ] {
        let error = compile(&map).unwrap_err();
        assert!(
            error.starts_with("map.toml: ") && error.contains(word) && error.contains("\n\nhint: "),
            "{error}"
        );
    }
}

#[test]
fn names_that_the_dbc_file_lacks_are_shown_with_those_it_has() {
    for (map, said) in [
        (
            MAP.replace("RATE.Z", "RATES.Z"),
            "map.toml: gyro.z names RATES.Z, my.dbc has the messages RATE, FORCE, BOTH, WIDE, BRIEF\n\nhint: correct gyro.z",
        ),
        (
            MAP.replace("FORCE.Z", "FORCE.UP"),
            "map.toml: specific_force.z names FORCE.UP, my.dbc has in FORCE the signals X, Y",
        ),
        (
            MAP.replace("FORCE.Z", "FORCE.LONG"),
            "map.toml: specific_force.z names FORCE.LONG, which in my.dbc does not fit a frame",
        ),
        (
            MAP.replace("FORCE.Z", "BRIEF.X"),
            "map.toml: specific_force.z names BRIEF.X, which in my.dbc does not fit its message",
        ),
        (
            MAP.replace("FORCE.Z", "WIDE.X"),
            "map.toml: specific_force.z names WIDE.X, which in my.dbc is in a message whose identifier",
        ),
        (
            MAP.replace("FORCE.Z", "BRIEF.LOST"),
            "map.toml: specific_force.z names BRIEF.LOST, which in my.dbc is multiplexed by a switch",
        ),
        (
            format!("{MAP}[counter]\nsignal = \"FORCE.M\"\nwraps_after = 256\n"),
            "map.toml: counter.signal names FORCE.M, my.dbc has in FORCE the signals",
        ),
    ] {
        let error = compile(&map).unwrap_err();
        assert!(error.starts_with(said), "{error}");
    }
    let nested = DBC.to_owned() + "\nSG_MUL_VAL_ 16 X N 1-1;\n";
    let error = CanMap::new("map.toml", MAP, "my.dbc", &nested).unwrap_err().to_string();
    assert!(error.contains("RATE.X, which in my.dbc is multiplexed by more than one switch"), "{error}");
}

#[test]
fn frames_of_a_sample_need_a_rule_that_fits() {
    let pairing = |rule: &str| compile(&MAP.replace("order = [\"RATE\", \"FORCE\"]", rule));
    for (rule, part) in [
        ("order = [\"RATE\"]", "pairing.order is RATE, the messages of a sample are RATE, FORCE"),
        ("order = [\"RATE\", \"FORCE\", \"BOTH\"]", "the messages of a sample are RATE, FORCE"),
        ("counters = [\"RATE.N\"]", "pairing.counters has no signal of FORCE"),
        ("counters = [\"RATE.K\"]", "pairing.counters names RATE.K"),
        ("", "neither"),
        ("order = [\"RATE\", \"FORCE\"]\ncounters = [\"RATE.N\", \"FORCE.N\"]", "both order and counters"),
    ] {
        let error = pairing(rule).unwrap_err();
        assert!(error.starts_with("map.toml: ") && error.contains(part), "{error}");
        assert!(error.contains("\n\nhint: "), "{error}");
    }
    let error = compile(MAP.split("[pairing]").next().unwrap()).unwrap_err();
    assert!(error.contains("2 messages") && error.contains("order = [\"RATE\", \"FORCE\"]"), "{error}");
    pairing("counters = [\"RATE.N\", \"FORCE.N\"]").unwrap();
}

/// Gyro and accelerometer in one message, told apart by its switch and joined by a tick that stands in both.
#[test]
fn one_message_may_be_two_halves_by_its_switch() {
    let map = "[gyro]\nx = \"BOTH.GX\"\ny = \"BOTH.GY\"\nz = \"BOTH.GZ\"\nunit = \"rad/s\"\n\
        [specific_force]\nx = \"BOTH.AX\"\ny = \"BOTH.AY\"\nz = \"BOTH.AZ\"\nunit = \"m/s^2\"\n\
        [time]\nsignal = \"BOTH.TICK\"\nunit = \"ms\"\nwraps_after = 256\n[pairing]\n";
    let frame = |switch: u8, z: u8, tick: u8| (18, false, vec![switch, 0, 0, 0, 0, z, 0, tick]);
    // By order the first half of one sample and the second of the next are joined, by counters never.
    for (rule, first_rate) in
        [("order = [\"BOTH/m0\", \"BOTH/m1\"]", 1.0), ("counters = [\"BOTH.TICK\"]", 2.0)]
    {
        let map = compile(&format!("{map}{rule}\n")).unwrap();
        let whole = [frame(0, 10, 1), frame(1, 100, 1), frame(7, 1, 1), frame(0, 20, 2), frame(1, 100, 2)];
        // The second half of the first sample is lost; the second comes the other way round.
        let mixed = [frame(0, 10, 1), frame(1, 100, 2), frame(0, 20, 2), frame(0, 30, 3), frame(1, 100, 3)];
        let mut decoder = CanMapDecoder::new(&map);
        let readings = push(&mut decoder, &whole);
        assert_eq!((readings.len(), decoder.counters().lone_halves), (2, 0), "{rule}");
        assert!((readings[1].omega_imu.z - 2.0).abs() < 1e-12);
        assert!((readings[1].specific_force_imu.unwrap().z - 1.0).abs() < 1e-12);
        assert_eq!(readings[1].device_time.unwrap().micros, 2000);
        assert_eq!(decoder.counters().packets, 5);
        let mut decoder = CanMapDecoder::new(&map);
        let readings = push(&mut decoder, &mixed);
        assert_eq!((readings.len(), decoder.counters().lone_halves), (2, 1), "{rule}");
        assert!((readings[0].omega_imu.z - first_rate).abs() < 1e-12, "{rule}: {readings:?}");
    }
    let error = compile(&format!("{}order = [\"BOTH\"]\n", map.replace("BOTH.GX", "BOTH.TICK"))).unwrap_err();
    assert!(error.contains("multiplexed and others that are not"), "{error}");
}
