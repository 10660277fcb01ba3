use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::device::protocol::trials::{Damage, damage, damaged, decode, holds_in_order};
use crate::device::testing::from_hex;

fn golden(text: &str) -> Value {
    serde_json::from_str(text).expect("the golden file is JSON")
}

fn frames() -> Value {
    golden(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/vectornav-frames.json")))
}

fn lines() -> Value {
    golden(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/vectornav-lines.json")))
}

fn vectors() -> Value {
    golden(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/devices/vectors.json")))
}

/// The golden frame of this name.
fn frame(name: &str) -> Vec<u8> {
    let frames = frames();
    let row = frames["frames"].as_array().expect("rows").iter().find(|row| row["name"] == name);
    from_hex(row.expect("there is one")["hex"].as_str().expect("digits"))
}

fn triple(value: &Value) -> Option<Vector3<f64>> {
    let axis = |i: usize| value[i].as_f64().expect("a number");
    (!value.is_null()).then(|| Vector3::new(axis(0), axis(1), axis(2)))
}

/// A frame of TimeStartup, Accel and AngularRate, changed to come at `time_ns` and to turn at `rate` about z.
fn sample(time_ns: u64, rate: f32) -> Vec<u8> {
    let mut frame = frame("what --configure sets");
    let end = frame.len() - 2;
    frame[6..14].copy_from_slice(&time_ns.to_le_bytes());
    frame[end - 4..end].copy_from_slice(&rate.to_le_bytes());
    let crc = xmodem(&frame[1..end]).to_be_bytes();
    frame[end..].copy_from_slice(&crc);
    frame
}

#[test]
fn every_frame_of_the_other_encoder_is_read() {
    for row in frames()["frames"].as_array().expect("rows") {
        let (name, expect) = (&row["name"], &row["expect"]);
        let bytes = from_hex(row["hex"].as_str().expect("digits"));
        let (readings, counters, notes) = decode(VectorNavDecoder::new(), [&bytes[..]]);
        assert_eq!(counters, DecodeCounters { packets: 1, ..DecodeCounters::default() }, "{name}");
        let [reading] = readings[..] else { panic!("{name}: {readings:?}") };
        assert_eq!(reading.device_time.map(|time| time.micros), expect["time_us"].as_u64(), "{name}");
        assert_eq!(reading.specific_force_imu, triple(&expect["force"]), "{name}");
        assert_eq!(Some(reading.omega_imu), triple(&expect["rate"]), "{name}");
        assert_eq!(reading.clipped, expect["clipped"].as_bool().expect("a flag"), "{name}");
        let says = |what: &str| notes.iter().any(|note| note.contains(what));
        assert_eq!(says("no device time"), expect["time_us"].is_null(), "{name}: {notes:?}");
        let uncompensated = name.as_str().is_some_and(|name| name.starts_with("uncompensated"));
        assert_eq!(says("uncompensated"), uncompensated, "{name}: {notes:?}");
    }
}

#[test]
fn every_line_of_a_device_is_read() {
    for row in lines()["lines"].as_array().expect("rows") {
        let text = row["text"].as_str().expect("a line");
        let (readings, counters, notes) = decode(VectorNavDecoder::new(), [text.as_bytes()]);
        assert_eq!(counters, DecodeCounters { packets: 1, ..DecodeCounters::default() }, "{text}");
        let [reading] = readings[..] else { panic!("{text}: {readings:?}") };
        assert_eq!(reading.device_time, None);
        assert_eq!(reading.specific_force_imu, triple(&row["expect"]["force"]), "{text}");
        assert_eq!(Some(reading.omega_imu), triple(&row["expect"]["rate"]), "{text}");
        assert!(notes[0].contains("carry no device time"), "{notes:?}");
    }
}

/// The document's examples: the first is good (attitude only), the second fails its own checksum, commands are good.
#[test]
fn the_document_s_vectors() {
    let mut seen = 0;
    for row in vectors().as_array().expect("rows") {
        let name = row["name"].as_str().expect("a name");
        if !name.starts_with("vectornav") {
            continue;
        }
        seen += 1;
        let bytes = match row["hex"].as_str() {
            Some(digits) => from_hex(digits),
            None => row["text"].as_str().expect("bytes or text").as_bytes().to_vec(),
        };
        let (readings, counters, _) = decode(VectorNavDecoder::new(), [&bytes[..]]);
        assert!(readings.is_empty(), "{name}");
        let bad = row["expect"]["crc_ok"] == false;
        assert_eq!((counters.packets, counters.bad_checksum), (u64::from(!bad), u64::from(bad)), "{name}");
        if let Some(text) = row["text"].as_str() {
            let body = text.split(['$', '*']).nth(1).expect("a body");
            assert_eq!(ascii::sentence(body), bytes, "{name}");
        }
    }
    assert_eq!(seen, 8);
}

#[test]
fn both_checksums_of_a_sentence_are_checked() {
    let read = |text: &str| {
        let (_, counters, _) = decode(VectorNavDecoder::new(), [text.as_bytes()]);
        (counters.packets, counters.bad_checksum)
    };
    let crc = xmodem(b"VNRRG,01,VN-100");
    assert_eq!(read(&format!("$VNRRG,01,VN-100*{crc:04X}\r\n")), (1, 0));
    assert_eq!(read(&format!("$VNRRG,01,VN-100*{crc:04x}\n")), (1, 0));
    assert_eq!(read(&format!("$VNRRG,01,VN-100*{:04X}\r\n", crc ^ 0x100)), (0, 1));
    assert_eq!(read("$VNRRG,01*72\r\n"), (1, 0));
    assert_eq!(read("$VNRRG,01*73\r\n"), (0, 1));
    assert_eq!(read("$VNRRG,01*XX\r\n"), (0, 0), "nobody can judge it");
    assert_eq!(read("$GPGGA,1,2,3*55\r\n"), (0, 0));
    assert_eq!(read("$VN*\r\n$VNRRG\r\n$VNrrg,01*72\r\n"), (0, 0));
}

/// Sentences of UM001 and, of the INS state, the field order of the vendor's library (`parseVNISL`).
#[test]
fn outputs_without_a_rate_say_so_and_the_ins_state_has_one() {
    let read = |body: &str| {
        let stream = String::from_utf8(ascii::sentence(body)).expect("text");
        decode(VectorNavDecoder::new(), [stream.as_bytes()])
    };
    for name in ["VNYPR", "VNMAG", "VNACC", "VNQTN"] {
        let (readings, counters, notes) = read(&format!("{name},+1.0,+2.0,+3.0"));
        assert_eq!((readings.len(), counters.packets), (0, 1));
        assert!(notes[0].contains(&format!("{name} sentences carry no angular rate")), "{notes:?}");
    }
    let (readings, ..) = read("VNISL,10,1,2,48.1,11.5,500,1,2,3,0.1,0.2,0.3,+0.25,-0.5,+1.5");
    let [reading] = readings[..] else { panic!("{readings:?}") };
    assert_eq!((reading.omega_imu, reading.specific_force_imu), (Vector3::new(0.25, -0.5, 1.5), None));
    assert!(read("VNRRG,01,VN-100").2.is_empty());
    // The document's example of a binary frame: yaw, pitch and roll.
    let (_, _, notes) =
        decode(VectorNavDecoder::new(), [&from_hex("fa01080093502e42833ef13f48b504bb9288")[..]]);
    assert!(notes[0].contains("add AngularRate"), "{notes:?}");
}

#[test]
fn errors_of_the_device_are_counted_and_explained() {
    let stream = "$VNERR,0C*02\r\n$VNERR,12*72\r\n$VNERR,03*72\r\n$VNERR,77*71\r\n";
    let (_, counters, notes) = decode(VectorNavDecoder::new(), [stream.as_bytes()]);
    assert_eq!((counters.packets, counters.device_errors, counters.bad_checksum), (4, 4, 0));
    for part in
        ["error 12 (the baud rate is too low for the output) 2 times", "error 3", "error 0 (in no manual)"]
    {
        assert!(notes.iter().any(|note| note.contains(part)), "{part} is missing in {notes:?}");
    }
}

#[test]
fn binary_and_text_share_a_line_and_no_sample_comes_twice() {
    let line = lines()["lines"][0]["text"].as_str().expect("a line").as_bytes().to_vec();
    let foreign = b"$GPRMC,foreign*00\r\nhello \xFA\x00 $VN\r\n".to_vec();
    let mut stream = line.clone();
    for k in 0..20 {
        stream.extend(sample(5_000_000 * k, 0.5));
        stream.extend(if k % 2 == 0 { &line } else { &foreign });
    }
    let (readings, counters, notes) = decode(VectorNavDecoder::new(), stream.chunks(7));
    // The first line comes before any binary frame.
    assert_eq!(readings.len(), 1 + 20);
    assert!(readings[1..].iter().all(|reading| reading.device_time.is_some()));
    assert_eq!((counters.packets, counters.bad_checksum, counters.missing), (31, 0, 0));
    assert_eq!(counters.bytes_skipped, 10 * foreign.len() as u64);
    assert!(notes.iter().any(|note| note.starts_with("10 samples of other outputs")), "{notes:?}");
}

#[test]
fn gaps_in_device_time_are_counted() {
    let stream: Vec<u8> =
        (0..50).filter(|k| ![20, 30, 31].contains(k)).flat_map(|k| sample(5_000_000 * k, 1.0)).collect();
    let (readings, counters, _) = decode(VectorNavDecoder::new(), [&stream[..]]);
    assert_eq!((readings.len(), counters.missing), (47, 3));
}

#[test]
fn floats_are_given_out_as_they_are_and_fields_must_read() {
    let stream = [sample(0, f32::NAN), sample(5_000_000, f32::INFINITY), sample(10_000_000, 1.0)].concat();
    let text = b"$VNGYR,+00.1,,+00.3*7A\r\n$VNGYR,+00.1*4C\r\n";
    let (readings, counters, _) = decode(VectorNavDecoder::new(), [&text[..], &stream[..]]);
    assert_eq!((readings.len(), counters.packets, counters.unknown), (3, 5, 2));
    let text = ascii::sentence("VNGYR,+00.1,nan,+00.3");
    let (readings, counters, _) = decode(VectorNavDecoder::new(), [&text[..]]);
    assert!(readings.len() == 1 && readings[0].omega_imu.y.is_nan() && counters.unknown == 0);
}

#[test]
fn masks_with_fields_of_unknown_size_are_not_guessed_at() {
    // Raw GNSS measurements beside time and motion, and a second group byte.
    for head in [&[0xFA, 0x09, 0x21, 0x01, 0x00, 0x80][..], &[0xFA, 0x81, 0x08, 0x01, 0x00]] {
        let frame = [head, &[0; 60]].concat();
        let (readings, counters, notes) = decode(VectorNavDecoder::new(), [&frame.repeat(10)[..]]);
        assert_eq!((readings.len(), counters.packets), (0, 0));
        assert_eq!(counters.bytes_skipped, 10 * frame.len() as u64);
        assert!(notes[0].contains(&format!("0x{:02X}", head[1])), "{notes:?}");
    }
}

#[test]
fn a_rejoined_line_starts_anew() {
    let mut decoder = VectorNavDecoder::new();
    let mut readings = 0;
    let line = lines()["lines"][0]["text"].as_str().expect("a line").as_bytes().to_vec();
    let cut = &sample(5_000_000, 1.0)[..20];
    for piece in [&sample(0, 1.0)[..], cut] {
        decoder.push(Traffic::Bytes(piece), &mut |_| readings += 1);
    }
    decoder.rejoin();
    // It was reset by the loss of power and sends its factory output.
    decoder.push(Traffic::Bytes(&line), &mut |_| readings += 1);
    assert_eq!((readings, decoder.counters().bytes_skipped, decoder.counters().packets), (2, 20, 2));
}

#[test]
fn frames_of_a_bus_are_not_ours() {
    let mut decoder = VectorNavDecoder::new();
    let traffic = Traffic::CanFrame { id: 1, extended: false, data: &[0xFA, 1] };
    decoder.push(traffic, &mut |_| panic!("no sample"));
    assert_eq!(decoder.counters().bytes_skipped, 2);
}

/// Twenty binary samples, each with a rate of its own, and a line behind every third.
fn stream() -> Vec<Vec<u8>> {
    let line = lines()["lines"][2]["text"].as_str().expect("a line").as_bytes().to_vec();
    let mut frames = Vec::new();
    for k in 0..20_u64 {
        frames.push(sample(5_000_000 * k, k as f32));
        if k % 3 == 0 {
            frames.push(line.clone());
        }
    }
    frames
}

proptest! {
    #[test]
    fn any_bytes_are_survived_and_accounted_for(
        bytes in proptest::collection::vec(
            prop_oneof![Just(0xFAu8), Just(b'$'), Just(b'V'), Just(b'N'), Just(b'*'), Just(1), any::<u8>()],
            0..4000,
        ),
        cut in 1usize..50,
    ) {
        let (readings, counters, _) = decode(VectorNavDecoder::new(), bytes.chunks(cut));
        let whole = decode(VectorNavDecoder::new(), [&bytes[..]]);
        prop_assert_eq!((&readings, counters), (&whole.0, whole.1));
        prop_assert!(counters.bytes_skipped + counters.unfinished_bytes <= bytes.len() as u64);
    }

    #[test]
    fn cuts_do_not_matter(cut in 1usize..200) {
        let bytes = stream().concat();
        let (readings, counters, notes) = decode(VectorNavDecoder::new(), bytes.chunks(cut));
        prop_assert_eq!(readings.len(), 20);
        prop_assert_eq!((counters, notes), {
            let whole = decode(VectorNavDecoder::new(), [&bytes[..]]);
            (whole.1, whole.2)
        });
    }

    #[test]
    fn damage_costs_what_it_hits(damages in proptest::collection::vec((0.0..1.0f64, damage()), 0..12)) {
        let frames = stream();
        let (bytes, hit) = damaged(&frames, &damages);
        let unhit: Vec<_> = frames.iter().zip(hit).filter(|(_, hit)| !hit).map(|(frame, _)| frame).collect();
        let expected: Vec<ImuReading> = unhit
            .iter()
            .filter(|frame| frame[0] == fields::SYNC)
            .flat_map(|frame| decode(VectorNavDecoder::new(), [&frame[..]]).0)
            .collect();
        let (readings, _, _) = decode(VectorNavDecoder::new(), bytes.chunks(64));
        prop_assert!(holds_in_order(&readings, &expected), "{:?}", damages);
    }
}

#[test]
fn a_longer_length_hides_nothing_for_good() {
    // A flipped mask bit announces 24 more bytes: the next frame is inside them.
    let (bytes, hit) = damaged(&stream(), &[(0.001, Damage::Flip(0))]);
    assert!(hit.iter().any(|hit| *hit) && decode(VectorNavDecoder::new(), [&bytes[..]]).0.len() == 20);
    let mut frames = stream();
    frames[4][3] |= 0x01;
    let (readings, counters, _) = decode(VectorNavDecoder::new(), [&frames.concat()[..]]);
    assert_eq!(readings.len(), 19);
    assert!(counters.bad_checksum >= 1);
}
