use proptest::prelude::*;

use super::*;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

const SIX_COLUMNS: &str = "
    [time]
    column = 1
    unit = \"ms\"
    [gyro]
    columns = [2, 3, 4]
    unit = \"deg/s\"
    signs = [1, -1, 1]
    full_scale = 250
    [specific_force]
    columns = [7, 6, 5]
    unit = \"mg\"
";

fn mapping(text: &str) -> TextMapping {
    TextMapping::from_toml("map.toml", text).unwrap()
}

fn decode(mapping: &TextMapping, pieces: &[&[u8]]) -> (Vec<ImuReading>, DecodeCounters) {
    let mut decoder = TextDecoder::new(mapping);
    let mut readings = Vec::new();
    for piece in pieces {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(reading));
    }
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder.counters())
}

#[test]
fn columns_units_and_signs_become_si() {
    let (readings, counters) = decode(&mapping(SIX_COLUMNS), &[b"1500,10,20,250,1000,-500,0\r\n"]);
    assert_eq!(counters, DecodeCounters { packets: 1, ..DecodeCounters::default() });
    let reading = readings[0];
    assert_eq!(reading.device_time, Some(DeviceTime { micros: 1_500_000, wraps_after_us: None }));
    let omega = nalgebra::Vector3::new(10.0, -20.0, 250.0) * RAD_PER_DEG;
    assert!((reading.omega_imu - omega).norm() < 1e-12);
    let force = nalgebra::Vector3::new(0.0, -0.5, 1.0) * STANDARD_GRAVITY;
    assert!((reading.specific_force_imu.unwrap() - force).norm() < 1e-12);
    assert!(reading.clipped, "250 deg/s is the end of the range");
}

#[test]
fn damaged_rows_are_counted_and_the_rest_is_read() {
    let log =
        b"\n# a comment\n0,1,2,3,4,5,6\n10,1,2,x,4,5,6\n20,1,2,3,4,5,6\n30,1,2,nan,4,5,6\n40,1,inf,3,4,5,6\n\
                50,1,2,3,4,5\n60,1,,3,4,5,6\n70,1,2,3,4,5,\xFF\n80,1,2,3,4,5,6\n90,1,2,3,4";
    let (readings, counters) = decode(&mapping(&format!("comment = \"#\"\n{SIX_COLUMNS}")), &[log]);
    let micros: Vec<_> = readings.iter().map(|reading| reading.device_time.unwrap().micros).collect();
    assert_eq!(micros, [0, 20_000, 80_000]);
    assert_eq!(counters, DecodeCounters { packets: 3, bad_checksum: 7, ..DecodeCounters::default() });
}

#[test]
fn a_cut_row_whose_mapped_columns_are_whole_is_still_seen() {
    let short = "[time]\ncolumn = 1\nunit = \"s\"\n[gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\n";
    let (readings, counters) = decode(&mapping(short), &[b"0,1,2,3,7,7\n1,1,2,3,7,7\n2,1,2,3,7"]);
    assert_eq!((readings.len(), counters.bad_checksum), (2, 1));
    // The first line of a port opened in the middle of a row.
    let (readings, counters) =
        decode(&mapping(&format!("column_count = 6\n{short}")), &[b"2,3,7,7\n1,1,2,3,7,7\n"]);
    assert_eq!((readings.len(), counters.bad_checksum), (1, 1));
}

#[test]
fn overlong_lines_are_skipped_whole() {
    let longest = format!("0,1,2,3,4,5,6{}\n", " ".repeat(MAX_LINE - 13));
    let too_long = format!("0,1,2,3,4,5,6{}\n", " ".repeat(MAX_LINE - 12));
    let log = [longest.as_bytes(), too_long.as_bytes(), b"20,1,2,3,4,5,6\n"].concat();
    for size in [1, 100, log.len()] {
        let pieces: Vec<&[u8]> = log.chunks(size).collect();
        let (readings, counters) = decode(&mapping(SIX_COLUMNS), &pieces);
        assert_eq!(readings.len(), 2, "pieces of {size}");
        assert_eq!((counters.bad_checksum, counters.bytes_skipped), (1, MAX_LINE as u64 + 1));
    }
}

#[test]
fn a_line_that_is_no_text_teaches_nobody_how_many_columns_there_are() {
    let log = b"0,1,2,3,4,5,6,7,8\x01\n10,1,2,3,4,5,6\n20,1,2,3,4,5,6\n";
    let map = mapping(SIX_COLUMNS);
    let (readings, counters) = decode(&map, &[log]);
    assert_eq!((readings.len(), counters.bad_checksum), (2, 1));
    let mut times = map.line_times();
    let stamped: Vec<Option<f64>> =
        log.split_inclusive(|byte| *byte == b'\n').map(|line| times.time_of_line(line)).collect();
    assert_eq!(stamped, [None, Some(0.01), Some(0.02)]);
    let text = map.check_rows("a.csv", log).unwrap_err().to_string();
    assert!(text.contains("a.csv, line 1: it has control characters"), "{text}");
}

#[test]
fn names_are_found_in_a_quoted_header() {
    let by_name = mapping(
        "header = true\n[time]\ncolumn = \"Time, local\"\nunit = \"s\"\n\
         [gyro]\ncolumns = [\"gx\", \"gy\", \"gz\"]\nunit = \"rad/s\"\n",
    );
    let log = b"\xEF\xBB\xBF\"gz\" , gy,\"Time, local\",gx\n3,2,1.0E-2,1\n";
    let (readings, counters) = decode(&by_name, &[log]);
    assert_eq!(counters.packets, 1);
    assert_eq!(readings[0].omega_imu, nalgebra::Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(readings[0].device_time.unwrap().micros, 10_000);
    assert_eq!(readings[0].specific_force_imu, None);
    by_name.check_log("log.csv", "map.toml", log).unwrap();

    let other = b"t,gx,gy,gz\n0,1,2,3\n";
    let error = by_name.check_log("log.csv", "map.toml", other).unwrap_err().to_string();
    assert_eq!(
        error,
        "log.csv: no column \"Time, local\" for time.column, found are \"t\", \"gx\", \"gy\", \"gz\"\n\n\
         hint: correct time.column in map.toml"
    );
    assert_eq!(decode(&by_name, &[other]).1.bad_checksum, 2, "the decoder itself only counts");

    let titled = [b"second run\n\n", &log[3..]].concat();
    let (readings, counters) = decode(&by_name, &[&titled]);
    assert_eq!((readings.len(), counters.bad_checksum), (1, 1));
    by_name.check_log("log.csv", "map.toml", &titled).unwrap();
    assert_eq!(by_name.check_rows("log.csv", &titled).unwrap(), 1);
    let by_number = mapping("header = true\nrate_hz = 50.0\n[gyro]\ncolumns = [1, 2, 3]\nunit = \"rad/s\"\n");
    assert_eq!(decode(&by_number, &[b"x,y,z\n1,2,3\n"]).1.packets, 1, "any line is a header without names");
}

#[test]
fn a_decimal_comma_is_read_where_it_separates_no_columns() {
    let read = |delimiter: &str, row: &str| {
        let text = format!(
            "delimiter = \"{delimiter}\"\nrate_hz = 50.0\n[gyro]\ncolumns = [1, 2, 3]\nunit = \"rad/s\"\n"
        );
        let (readings, counters) = decode(&mapping(&text), &[row.as_bytes()]);
        assert_eq!(readings.len() + counters.bad_checksum as usize, 1);
        readings.first().map(|reading| <[f64; 3]>::from(reading.omega_imu))
    };
    assert_eq!(read(";", "1,5;-0,25;2,5E-1"), Some([1.5, -0.25, 0.25]));
    assert_eq!(read("blank", "1,5 2 3.5"), Some([1.5, 2.0, 3.5]));
    // Thousands, a comma behind a number, more digits than a number has.
    for row in ["1,234.5;2;3", "1.234,5;2;3", "1,234,567;2;3", "1,;2;3"] {
        assert_eq!(read(";", row), None, "{row}");
    }
    assert_eq!(read(";", &format!("0,{};2;3", "0".repeat(80))), None);
}

#[test]
fn a_log_that_does_not_fit_is_named() {
    let mapping = mapping(SIX_COLUMNS);
    let error = mapping.check_log("a.csv", "map.toml", b"\n1,2,3\n").unwrap_err().to_string();
    assert!(
        error.starts_with("a.csv: no column 4 for gyro.columns, found are 3 columns\n\nhint: "),
        "{error}"
    );
    let counted = TextMapping::from_toml("map.toml", &format!("column_count = 8\n{SIX_COLUMNS}")).unwrap();
    let error = counted.check_log("a.csv", "map.toml", b"0,1,2,3,4,5,6\n").unwrap_err().to_string();
    assert!(error.starts_with("a.csv: the first line has 7 columns, expected 8\n\nhint: "), "{error}");
    let error = mapping.check_log("a.csv", "map.toml", b"\n\n").unwrap_err().to_string();
    assert!(error.starts_with("a.csv: no line with data\n\nhint: "), "{error}");
}

#[test]
fn the_first_bad_row_of_a_file_is_explained() {
    let mapping = mapping(SIX_COLUMNS);
    let check = |log: &str| mapping.check_rows("a.csv", log.as_bytes()).map_err(|error| error.to_string());
    assert_eq!(check("0,1,2,3,4,5,6\n\n10,1,2,3,4,5,6\n20,1,2"), Ok(2));
    for (row, what) in [
        ("10,1,NaN,3,4,5,6", "column 3 (gyro.columns) is \"NaN\", expected a finite number"),
        ("10,1,2,3,4,5", "column 7 (specific_force.columns) is missing"),
        ("late,1,2,3,4,5,6", "column 1 (time.column) is \"late\", expected a finite number"),
    ] {
        let error = check(&format!("0,1,2,3,4,5,6\n{row}\n20,1,2,3,4,5,6\n")).unwrap_err();
        assert!(error.starts_with(&format!("a.csv, line 2: {what}\n\nhint: ")), "{error}");
    }
    let error = check("0,1,2,3,4,5,6,7\n0,1,2,3,4,5,6\n0,1,2,3,4,5,6,7\n").unwrap_err();
    assert!(error.starts_with("a.csv, line 2: 7 columns, another number"), "{error}");
}

#[test]
fn blanks_separate_and_times_may_start_below_zero() {
    let blank = mapping(
        "delimiter = \"blank\"\n[time]\ncolumn = 1\nunit = \"s\"\n[gyro]\ncolumns = [2, 3, 4]\nunit = \"rad/s\"\n",
    );
    let (readings, counters) = decode(&blank, &[b"  -0.5 1\t2   3 \n 0.25 1 2 3\n-0.75 1 2 3\n"]);
    let micros: Vec<_> = readings.iter().map(|reading| reading.device_time.unwrap().micros).collect();
    assert_eq!(micros, [0, 750_000]);
    assert_eq!(counters.bad_checksum, 1, "before the start of the log");
}

#[test]
fn without_a_time_column_the_rate_is_announced_and_rows_are_stamped_by_index() {
    let rated = mapping("rate_hz = 50.0\nheader = true\n[gyro]\ncolumns = [1, 2, 3]\nunit = \"rad/s\"\n");
    let mut decoder = TextDecoder::new(&rated);
    let mut times = Vec::new();
    decoder.push(Traffic::Bytes(b"x,y,z\n1,2,3\n"), &mut |reading| times.push(reading.device_time));
    assert_eq!((decoder.announced_rate_hz(), times), (Some(50.0), vec![None]));
    let mut lines = rated.line_times();
    let stamps: Vec<_> = [&b"x,y,z"[..], b"1,2,3", b"bad,2,3", b"", b"1,2,3"]
        .iter()
        .map(|line| lines.time_of_line(line))
        .collect();
    assert_eq!(stamps, [None, Some(0.0), None, None, Some(0.02)]);
    let mut lines = mapping(SIX_COLUMNS).line_times();
    assert_eq!(lines.time_of_line(b"-1500,1,2,3,4,5,6\r"), Some(-1.5));
}

#[test]
fn wrong_mappings_name_file_key_and_what_is_allowed() {
    let gyro = "[gyro]\ncolumns = [1, 2, 3]\nunit = \"rad/s\"\n";
    for (text, said) in [
        (gyro.to_owned(), "map.toml: rate_hz is missing, allowed is a rate, or a [time] table"),
        (format!("rate_hz = 0.0\n{gyro}"), "map.toml: rate_hz is 0, allowed is 0.1 to 20000 Hz\n\nhint: "),
        (
            format!("rate_hz = 9\ndelimiter = \"ab\"\n{gyro}"),
            "map.toml: delimiter is \"ab\", allowed is \",\", ",
        ),
        (
            "rate_hz = 9\n[gyro]\ncolumns = [0, 1, 2]\nunit = \"rad/s\"".to_owned(),
            "map.toml: gyro.columns is 0, allowed is 1 to 1024: columns are counted from 1",
        ),
        (
            "rate_hz = 9\n[gyro]\ncolumns = [\"x\", 1, 2]\nunit = \"rad/s\"".to_owned(),
            "map.toml: gyro.columns is \"x\", allowed is a number from 1, or header = true",
        ),
        (
            format!("rate_hz = 9\n{gyro}signs = [1, 2, 1]"),
            "map.toml: signs is 2, allowed is 1 or -1 for each axis",
        ),
    ] {
        let error = TextMapping::from_toml("map.toml", &text).unwrap_err().to_string();
        assert!(error.starts_with(said), "{error}");
    }
    for (text, word) in [
        (gyro.replace("rad/s", "dps"), "`rad/s` or `deg/s`"),
        (format!("baud = 9\n{gyro}"), "unknown field `baud`"),
        ("rate_hz = 9".to_owned(), "missing field `gyro`"),
    ] {
        let error = TextMapping::from_toml("map.toml", &text).unwrap_err().to_string();
        assert!(
            error.starts_with("map.toml: ") && error.contains(word) && error.contains("\nhint: "),
            "{error}"
        );
    }
}

#[test]
fn shipped_mappings_load() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/logs");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        TextMapping::from_toml(&name, &std::fs::read_to_string(&path).unwrap()).unwrap();
        names.push(name);
    }
    assert!(names.len() >= 3, "{names:?}");
    let sketch = std::fs::read_to_string(format!("{folder}/arduino-mpu6050.toml")).unwrap();
    let (readings, counters) = decode(&mapping(&sketch), &[b"# ready\n4294967290 0 0 1 0 0 90\n"]);
    assert_eq!(counters.packets, 1);
    assert_eq!(
        readings[0].device_time,
        Some(DeviceTime { micros: 4_294_967_290, wraps_after_us: Some(1 << 32) })
    );
}

proptest! {
    /// How the bytes are cut makes no difference, and no bytes do harm.
    #[test]
    fn cuts_and_garbage_are_harmless(
        log in prop::collection::vec(prop_oneof![4 => prop::sample::select(b"0123456789,.-eE\n\"# ".to_vec()), 1 => any::<u8>()], 0..600),
        cut in 1..50_usize,
    ) {
        let mapping = mapping(SIX_COLUMNS);
        let whole = decode(&mapping, &[&log]);
        let pieces: Vec<&[u8]> = log.chunks(cut).collect();
        prop_assert_eq!(&whole, &decode(&mapping, &pieces));
        let garbage_then_row = [&log[..], b"\n5,1,2,3,4,5,6,7,8,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9,9\n"].concat();
        prop_assert!(decode(&mapping, &[&garbage_then_row]).1.packets <= whole.1.packets + 1);
    }
}
