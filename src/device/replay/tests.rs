use std::io::Write;
use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::device::Traffic;
use crate::device::can::bus::BusState;
use crate::device::mock::{MockChair, MockParams};
use crate::device::protocol::PacketDecoder;
use crate::device::protocol::mavlink::MavlinkDecoder;
use crate::device::testing::{drain, from_hex};

fn file(suffix: &str, content: &[u8]) -> tempfile::NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(suffix).tempfile().expect("a temporary file");
    file.write_all(content).expect("written");
    file
}

fn stamper(line: &[u8]) -> Option<u64> {
    let seconds: f64 = std::str::from_utf8(line).ok()?.split(',').next()?.parse().ok()?;
    Some((seconds * 1e9) as u64)
}

#[test]
fn the_kind_is_found_from_the_content() {
    for (suffix, content, kind) in [
        (".txt", &b"t,gx\n1,2\n"[..], FileKind::Text),
        (".bin", "Zeit,\u{b0}/s\n".as_bytes(), FileKind::Text),
        (".bin", b"Zeit;Drehrate in \xB0/s\n0,01;5\n", FileKind::Text), // ISO 8859-1
        (".bin", b"\xFF\xFE\xFD\xFC", FileKind::Raw),
        (".log", b"(1616161616.123456) can0 3A0#00\n", FileKind::Candump),
        (".log", b"cut off\n(1616161616.123456) can0 3A0#00\n", FileKind::Candump),
        (".log", b"# bus\n\n# 500 kbit/s\n\n# car\n  can0  3A0   [1]  00\n", FileKind::Candump),
        (".txt", b"boot\r\n$VNGYR,+00.002801,-00.001186,-00.001582*76\r\n", FileKind::Raw),
        (".txt", b"$GPVTG,054.7,T,034.4,M,005.5,N,010.2,K*48\r\n", FileKind::Text),
        (".txt", b"\x02\x01\x02\x01\x04\xee\xff\xc0\x00", FileKind::Raw),
        (".txt", b"\x89MCAP0\r\n", FileKind::Mcap),
        (".mcap", b"damaged", FileKind::Mcap),
    ] {
        assert_eq!(detect(file(suffix, content).path()).expect("readable"), kind, "{content:?}");
    }
}

#[test]
fn files_that_cannot_be_played_say_why() {
    let open_error = |path: &Path| open(path, None, 115_200, None).err().expect("an error").to_string();
    let missing = open_error(Path::new("/no/such/file.txt"));
    assert!(missing.starts_with("/no/such/file.txt: cannot read it: "), "{missing}");
    let empty = open_error(file(".txt", b"").path());
    assert!(empty.contains("the file is empty (0 bytes)") && empty.contains("\n\nhint: "), "{empty}");
    let folder = tempfile::tempdir().expect("a folder");
    assert!(open_error(folder.path()).contains("cannot read it"));
    assert!(open_error(file(".x", b"\x89MCAP0\r\n").path()).contains("otolith replay"));
}

#[test]
fn a_text_log_is_played_line_by_line_with_its_own_times() {
    let log = file(".csv", b"time,gx\n10.5,1\n10.6,2\n10.59,3\nnoise\n10.8,4");
    let mut link = open(log.path(), None, 115_200, Some(Box::new(stamper))).expect("opens");
    let ms = |ms: u64| HostTime(ms * 1_000_000);
    let expected = [
        (ms(0), "time,gx\n"),
        (ms(0), "10.5,1\n"),
        (ms(100), "10.6,2\n"),
        (ms(100), "10.59,3\n"),
        (ms(100), "noise\n"),
        (ms(300), "10.8,4\n"),
    ];
    let expected: Vec<_> = expected.into_iter().map(|(at, line)| (at, line.as_bytes().to_vec())).collect();
    assert_eq!(drain(link.as_mut()), expected);
}

#[test]
fn a_restart_of_the_logger_goes_on_from_where_it_was() {
    let mut stamps = RelativeStamps::default();
    let s = 1_000_000_000;
    let got: Vec<u64> = [100, 101, 105, 2, 3, 7].map(|seconds| stamps.at(Some(seconds * s)).0 / s).to_vec();
    assert_eq!(got, [0, 1, 5, 5, 6, 10]);
}

#[test]
fn a_text_log_without_times_is_stamped_by_its_bytes() {
    let log = file(".txt", b"123456789\n123456789\n");
    let mut link = open(log.path(), None, 100_000, None).expect("opens");
    let stamps: Vec<u64> = drain(link.as_mut()).into_iter().map(|(at, _)| at.0).collect();
    assert_eq!(stamps, [1_000_000, 2_000_000]);
}

#[test]
fn a_raw_capture_without_a_clock_is_stamped_by_its_bytes() {
    let bytes: Vec<u8> = (0..1000u32).map(|i| i as u8).collect();
    let capture = file(".bin", &bytes);
    let mut link = open(capture.path(), None, 100_000, None).expect("opens");
    let pieces = drain(link.as_mut());
    assert_eq!(pieces.iter().flat_map(|(_, piece)| piece.clone()).collect::<Vec<u8>>(), bytes);
    assert_eq!(pieces[0], (HostTime(64 * 100_000), bytes[..64].to_vec()));
    assert_eq!(pieces.last().expect("some").0, HostTime(100_000_000));
}

#[test]
fn a_raw_capture_is_played_at_the_pace_of_the_device() {
    let params = MockParams { rest_s: 2.0, ..MockParams::rest() };
    let mut bytes = Vec::new();
    for (_, piece) in drain(&mut MockChair::new(params).expect("in range")) {
        bytes.extend_from_slice(&piece);
    }
    for baud in [9_600, 3_000_000] {
        let mut link = RawReplay::new("capture".into(), &bytes[..], baud);
        let pieces = drain(&mut link);
        assert!(pieces.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        // 1 kHz from the first sample on; before it there is the line's time for what introduces the device.
        let took = pieces.last().expect("some").0.saturating_since(pieces[5].0).as_secs_f64();
        assert!((took - 2.0).abs() < 0.02, "{took} s at {baud} baud");
    }
}

#[test]
fn a_candump_log_is_played_frame_by_frame() {
    let good = "(1614981013.853137) can0 3A0#000000005C0F6400\n\
                (1614981013.854137) can0 18FEF100#11\r\n\
                (1614981013.855) vcan1 7ff#\n";
    let bad = "not a frame\n(1614981013.86) can0 3A0#0\n";
    let error = "(1614981013.860000) can0 20000040#0000000000000000\n";
    let log = file(".log", format!("{good}{bad}{error}").as_bytes());
    let mut link = open(log.path(), None, 0, None).expect("opens");
    let mut frames = Vec::new();
    while let Ok(Some((at, Traffic::CanFrame { id, extended, data }))) = link.receive(Duration::ZERO) {
        frames.push((at.0, id, extended, data.to_vec()));
    }
    let expected = [
        (0, 0x3A0, false, vec![0, 0, 0, 0, 0x5C, 0x0F, 0x64, 0]),
        (1_000_000, 0x18FE_F100, true, vec![0x11]),
        (1_863_000, 0x7FF, false, vec![]),
    ];
    assert_eq!(frames, expected);
    let status = link.status();
    assert_eq!((status.bytes_skipped, status.bus_errors, status.bus_off), (bad.len() as u64, 1, 1));
    assert_eq!(status.bus_state, BusState::BusOff);
}

/// Frames of pymavlink as a ground station logs them: RAW_IMU and HIGHRES_IMU in turn, 10 ms apart.
fn tlog() -> Vec<(u64, Vec<u8>)> {
    let golden =
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/mavlink-frames.json"));
    let golden: serde_json::Value = serde_json::from_str(golden).expect("the golden file is JSON");
    let frame = |row: usize| from_hex(golden["frames"][row]["hex"].as_str().expect("digits"));
    (0..20).map(|k| (1_683_220_541_055_000 + 10_000 * k, frame(6 * (k as usize % 2)))).collect()
}

fn logged(frames: &[(u64, Vec<u8>)]) -> Vec<u8> {
    frames.iter().flat_map(|(stamp, frame)| [&stamp.to_be_bytes()[..], frame].concat()).collect()
}

#[test]
fn a_telemetry_log_is_played_frame_by_frame_with_its_own_times() {
    let frames = tlog();
    for end in [logged(&frames).len(), 200] {
        let log = file(".log", &logged(&frames)[..end]);
        assert_eq!(detect(log.path()).expect("readable"), FileKind::Tlog);
        let mut link = open(log.path(), None, 0, None).expect("opens");
        let pieces = drain(link.as_mut());
        let whole = if end == 200 { 3 } else { 20 };
        for (k, ((at, piece), (_, frame))) in pieces.iter().zip(&frames).take(whole).enumerate() {
            assert_eq!((at.0, piece), (10_000_000 * k as u64, frame));
        }
        // The last frame is cut, its stamp is whole.
        let rest = logged(&frames)[..end].len() - logged(&frames[..whole]).len();
        assert_eq!(
            pieces[whole..].iter().map(|(_, piece)| piece.len()).sum::<usize>(),
            rest.saturating_sub(8)
        );
    }
}

/// Wherever a log was cut, its tail is the beginning of a frame and no junk.
#[test]
fn the_tail_of_a_cut_telemetry_log_is_unfinished() {
    let (log, first) = (logged(&tlog()[..3]), logged(&tlog()[..2]).len());
    for end in first..log.len() {
        let mut link = TlogReplay::new("log".to_owned(), &log[..end]);
        let mut decoder = MavlinkDecoder::new();
        for (_, piece) in drain(&mut link) {
            decoder.push(Traffic::Bytes(&piece), &mut |_| {});
        }
        decoder.finish(&mut |_| {});
        let counters = decoder.counters();
        assert_eq!((counters.packets, counters.bytes_skipped, counters.bad_checksum), (2, 0, 0), "{end}");
        let tail = (end - first) as u64;
        let in_frame = tail.saturating_sub(8);
        assert_eq!(counters.unfinished_bytes, in_frame, "{end}");
        assert_eq!(link.status().unfinished_bytes, if in_frame == 0 { tail } else { 0 }, "{end}");
    }
}

#[test]
fn the_tail_of_a_cut_candump_log_is_unfinished() {
    let mut link = CandumpReplay::new("log".to_owned(), &b"(1.0) can0 3A0#00\njunk\n(1.1) can0 3A0#0"[..]);
    assert_eq!(drain(&mut link).len(), 1);
    assert_eq!((link.status().bytes_skipped, link.status().unfinished_bytes), (5, 16));
}

#[test]
fn damage_in_a_telemetry_log_costs_the_damaged_frame_alone() {
    let frames = tlog();
    let mut hurt = frames.clone();
    // A wrong length, a wrong checksum, a stamp of another century; and a byte too many in front.
    hurt[3].1[1] ^= 0x10;
    hurt[7].1[20] ^= 0x01;
    hurt[12].0 ^= 1 << 50;
    let log = file(".bin", &[b"x", &logged(&hurt)[..]].concat());
    let mut link = open(log.path(), None, 0, None).expect("opens");
    let pieces = drain(link.as_mut());
    let times: Vec<u64> = pieces.iter().map(|(at, _)| at.0 / 10_000_000).collect();
    // The junk in front and the two damaged frames are pieces of their own; two steps take no time for the bad stamp.
    assert_eq!(times, [0, 0, 1, 2, 2, 4, 5, 6, 6, 8, 9, 10, 11, 11, 11, 12, 13, 14, 15, 16, 17]);
    let expected: Vec<Vec<u8>> = hurt.into_iter().map(|(_, frame)| frame).collect();
    let got: Vec<Vec<u8>> = pieces[1..].iter().map(|(_, piece)| piece.clone()).collect();
    assert_eq!(got, expected);
}

#[test]
fn frames_without_stamps_are_a_raw_capture() {
    let frames: Vec<u8> = tlog().into_iter().flat_map(|(_, frame)| frame).collect();
    assert_eq!(detect(file(".tlog", &frames).path()).expect("readable"), FileKind::Raw);
}

#[test]
fn lines_that_are_no_frames_are_refused() {
    for line in [
        "",
        "(1.0) can0",
        "(1.0) can0 3A0",
        "1.0 can0 3A0#00",
        "(1) can0 3A0#00",
        "(1.) can0 3A0#00",
        "(1.0000000001) can0 3A0#00",
        "(-1.0) can0 3A0#00",
        "(1.0) can0 800#00",
        "(1.0) can0 3A#00",
        "(1.0) can0 4FFFFFFF#00",
        "(1.0) can0 3A0#001",
        "(1.0) can0 3A0#+1",
        "(1.0) can0 +A0#11",
        "(1.0) can0 3A0#000000000000000000",
        "(1.0) can0 3A0#R",
        "(1.0) can0 3A0##100",
        "(1.0) can0 3A0#00 X",
        "(1.0)can0 3A0#00",
        "can0  3A0   [2]  00",
        "can0  3A0   [1]  00 01",
        "can0  3A0   [1]  0",
        "can0  3A0   [9]  00 00 00 00 00 00 00 00 00",
        "can0  3A0  [08]  00 00 00 00 00 00 00 00",
        "can0  3A0   [2]  remote request",
        "can0  3A0   1  00",
        "(2021-13-19 18:13:36.5)  can0  3A0   [1]  00",
        "(99999999999999999999.0) can0 3A0#00",
        "(1.0) can0 3A0#0\u{e9}",
        // A log has a stamp in every line; this is what somebody called a session.
        "Subject 042#",
    ] {
        assert_eq!(parse_candump_line(line.as_bytes()), None, "{line}");
    }
    assert!(parse_candump_line(b"(1.0) can0 3A0#00 R").is_some());
}

/// Lines of can-utils 2023.03 (`candump -L`, `-ta`, `-tz`, `-tA`, `-x`, `-a`, `-e`), as its `candump.c` prints them.
#[test]
fn what_candump_writes_to_the_screen_is_read_as_its_log() {
    let logged = parse_candump_line(b"(1616177616.123456) can0 3A0#005C0F64").expect("a frame");
    for line in [
        " (1616177616.123456)  can0  3A0   [4]  00 5C 0F 64\n",
        " (2021-03-19 18:13:36.123456)  can0  3A0   [4]  00 5C 0F 64\r\n",
        " (1616177616.123456)  can0  RX - -  3A0   [4]  00 5C 0F 64",
        " (1616177616.123456)  can0  TX B E  3A0   [4]  00 5C 0F 64",
        " (1616177616.123456)  can0  3A0   [4]  00 5C 0F 64               '. .d'",
    ] {
        assert_eq!(parse_candump_line(line.as_bytes()), Some(logged), "{line}");
    }
    let mut unstamped = logged;
    unstamped.stamp_ns = None;
    for line in ["  can0  3A0   [4]  00 5C 0F 64", "\u{feff}  can0  3A0   [4]  00 5c 0f 64"] {
        assert_eq!(parse_candump_line(line.as_bytes()), Some(unstamped), "{line}");
    }
    let empty = parse_candump_line(b"  can0  18FF1234   [0] ").expect("a frame");
    assert_eq!((empty.id, empty.extended, empty.data().len()), (0x18FF_1234, true, 0));
    let error =
        parse_candump_line(b"  can0  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME").expect("one");
    assert_eq!((error.id, error.error), (0x40, true));
}

#[test]
fn times_since_the_frame_before_are_summed() {
    let log = |stamps: &[u32]| -> Vec<u8> {
        let line = |ms: &u32| format!(" (000.{ms:03}000)  can0  3A0   [1]  00\n");
        stamps.iter().map(line).collect::<String>().into_bytes()
    };
    for (stamps, expected) in [
        ([0, 5, 5, 5, 5], [0, 5, 10, 15, 20]),
        ([0, 5, 4, 6, 5], [0, 5, 9, 15, 20]),
        ([0, 5, 10, 16, 20], [0, 5, 10, 16, 20]),
    ] {
        let log = file(".log", &log(&stamps));
        let mut link = open(log.path(), None, 115_200, None).expect("opens");
        let times: Vec<u64> = drain(link.as_mut()).into_iter().map(|(at, _)| at.0 / 1_000_000).collect();
        assert_eq!(times, expected, "{stamps:?}");
    }
}

/// `candump -t d` counts from whatever line came before.
#[test]
fn lines_that_are_no_data_frame_take_their_time_as_well() {
    let data = " (000.005000)  can0  3A0   [1]  00\n";
    let error = " (000.050000)  can0  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n";
    let request = " (000.040000)  can0  3A1   [0]  remote request\n";
    let log = file(".log", [data, data, data, data, error, request, data].concat().as_bytes());
    let mut link = open(log.path(), None, 115_200, None).expect("opens");
    let times: Vec<u64> = drain(link.as_mut()).into_iter().map(|(at, _)| at.0 / 1_000_000).collect();
    assert_eq!(times, [0, 5, 10, 15, 110]);
}

proptest! {
    #[test]
    fn a_written_frame_reads_back(
        seconds in 0u64..4_000_000_000, micros in 0u32..1_000_000, id in 0u32..0x2000_0000, extended: bool,
        data in proptest::collection::vec(any::<u8>(), 0..=8),
    ) {
        let id = if extended { id } else { id & 0x7FF };
        let digits: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        let width = if extended { 8 } else { 3 };
        let line = format!("({seconds}.{micros:06}) can0 {id:0width$X}#{digits}\n");
        let frame = parse_candump_line(line.as_bytes()).expect("well formed");
        prop_assert_eq!(frame.stamp_ns, Some(seconds * 1_000_000_000 + u64::from(micros) * 1000));
        prop_assert_eq!((frame.id, frame.extended, frame.error), (id, extended, false));
        prop_assert_eq!(frame.data(), &data[..]);
    }

    #[test]
    fn any_line_is_read_or_refused(line: Vec<u8>) {
        let _ = parse_candump_line(&line);
    }

    #[test]
    fn every_byte_of_a_damaged_telemetry_log_is_given_out_but_stamps(
        flips in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 0..20), cut in 0usize..2000,
    ) {
        let mut bytes = logged(&tlog());
        flips.iter().for_each(|(at, flip)| *at.get_mut(&mut bytes[..]) ^= flip);
        bytes.truncate(bytes.len().saturating_sub(cut));
        let mut link = TlogReplay::new("log".to_owned(), &bytes[..]);
        let pieces = drain(&mut link);
        let given: usize = pieces.iter().map(|(_, piece)| piece.len()).sum();
        let told = given + link.status().unfinished_bytes as usize;
        prop_assert!(told <= bytes.len() && bytes.len() <= told + 8 * pieces.len());
        prop_assert!(pieces.is_sorted_by_key(|(at, _)| *at));
    }

    #[test]
    fn host_times_never_go_back(stamps in proptest::collection::vec(proptest::option::of(prop_oneof![0u64..20_000_000_000, any::<u64>()]), 1..50)) {
        let mut relative = RelativeStamps::default();
        let mut last = HostTime(0);
        for stamp in stamps {
            let at = relative.at(stamp);
            prop_assert!(at >= last);
            last = at;
        }
    }
}
