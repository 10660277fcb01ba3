//! Round trips, every kind of damage, verification.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

use super::topic::Topic;
use super::*;
use crate::device::Traffic;
use crate::imu::LinkHealth;
use crate::tick::{CharacterOutput, PlatformMotion, Posture, TickInput, TickOutput};
use crate::time::Tick;
use crate::vestibular::{HeadMotion, Perception};

mod layouts;

/// Numbers without end from a seed: all bit patterns, so also NaN payloads, infinities and subnormals.
struct Bits(u64);

impl Bits {
    fn next(&mut self) -> u64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn f64(&mut self) -> f64 {
        match self.next() % 8 {
            0 => f64::from_bits(0x7ff0_0000_0000_0001 | self.next()),
            1 => f64::NEG_INFINITY,
            2 => -0.0,
            _ => f64::from_bits(self.next()),
        }
    }

    fn flag(&mut self) -> bool {
        self.next() & 1 == 1
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.f64(), self.f64(), self.f64())
    }

    fn character(&mut self) -> CharacterOutput {
        CharacterOutput {
            perception: Perception {
                gravity_head: self.vector(),
                omega_head: self.vector(),
                accel_head: self.vector(),
            },
            gravity_platform: self.vector(),
            gravity_tilt: self.f64(),
            com_platform: self.vector(),
            com_sway: self.f64(),
            cop_platform: self.flag().then(|| Vector2::new(self.f64(), self.f64())),
            foot_tilt: self.f64(),
            constraint_residual: self.f64(),
            saturated_joints: self.next() as u8,
            posture: [Posture::Standing, Posture::Fallen][self.next() as usize % 2],
            state_hash: self.next(),
        }
    }

    fn tick(&mut self, tick: u64) -> (TickInput, TickOutput) {
        let links = [LinkHealth::Waiting, LinkHealth::Live, LinkHealth::Stale, LinkHealth::Lost];
        let chair = HeadMotion { omega_head: self.vector(), gif_head: self.vector() };
        let input = TickInput {
            tick: Tick(tick),
            chair: self.flag().then_some(chair),
            link: links[self.next() as usize % 4],
            respawn: self.flag(),
        };
        let platform = PlatformMotion { angle: self.f64(), rate: self.f64(), acceleration: self.f64() };
        let output =
            TickOutput { tick: Tick(tick), platform, green: self.character(), blue: self.character() };
        (input, output)
    }
}

/// The bits of a tick: comparing floats would call NaN different.
fn bits(input: &TickInput, output: &TickOutput) -> Vec<u8> {
    let (mut first, mut second) = (Vec::new(), Vec::new());
    layout::encode_input(&mut first, input);
    layout::encode_output(&mut second, output);
    [first, second].concat()
}

fn header() -> RecordingHeader {
    let models = BTreeMap::from([("standing.xml".to_owned(), "<mujoco>\u{e9}</mujoco>".to_owned())]);
    RecordingHeader::new("[chair]\nrate_rpm = 30\n".to_owned(), models, "fp-1".to_owned())
}

const TICKS: u64 = 24;
const TICKS_PER_CHUNK: u64 = 6;

/// A small recording of several chunks, and its ticks. Tick 10 was late.
fn small_recording() -> (Vec<u8>, Vec<(TickInput, TickOutput)>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.mcap");
    let mut recorder = Recorder::create(&path, false, &header()).unwrap();
    let mut bits = Bits(7);
    let mut ticks = Vec::new();
    for index in 0..TICKS {
        let (input, output) = bits.tick(if index < 10 { index } else { index + 1 });
        let at = input.tick.host_time();
        recorder.traffic(at, Traffic::Bytes(&[index as u8; 5])).unwrap();
        recorder.tick(&input, &output).unwrap();
        ticks.push((input, output));
        if index % TICKS_PER_CHUNK == TICKS_PER_CHUNK - 1 {
            recorder.event(at, "one tick late").unwrap();
            recorder.flush().unwrap();
        }
    }
    recorder.finish("{\"ok\":true}").unwrap();
    (fs::read(&path).unwrap(), ticks)
}

/// Checks that every tick that can be read is one of `ticks`, unchanged and in its place; returns how many.
fn read_back(recording: &Recording, ticks: &[(TickInput, TickOutput)]) -> u64 {
    let mut count = 0;
    let mut last = None;
    for tick in recording.ticks().unwrap() {
        let tick = tick.unwrap();
        let (input, output) = &ticks[tick.index as usize];
        assert!(last < Some(tick.index), "ticks in order");
        assert_eq!(bits(&tick.input, &tick.output), bits(input, output));
        last = Some(tick.index);
        count += 1;
    }
    assert_eq!(recording.damage().ticks_read, count);
    count
}

#[test]
fn a_whole_recording_is_complete_and_reads_back() {
    let (bytes, ticks) = small_recording();
    let recording = Recording::from_bytes("small", bytes).unwrap();
    assert_eq!(recording.damage().findings, []);
    assert!(recording.damage().complete);
    assert_eq!(recording.damage().ticks_lost_at_least, 0);
    assert_eq!(read_back(&recording, &ticks), TICKS);
    assert_eq!(recording.header(), Some(&header()));
    assert_eq!(recording.summary(), Some("{\"ok\":true}"));
    let traffic: Vec<_> = recording.traffic().unwrap().map(Result::unwrap).collect();
    assert_eq!(traffic.len() as u64, TICKS);
    assert_eq!(traffic[3].traffic(), Traffic::Bytes(&[3; 5]));
    assert_eq!(traffic[23].at, Tick(24).host_time());
    let events: Vec<_> = recording.events().unwrap().map(Result::unwrap).collect();
    assert_eq!(events.len() as u64, TICKS / TICKS_PER_CHUNK);
    assert_eq!(events[0], (Tick(5).host_time(), "one tick late".to_owned()));
}

/// Flips bits of every byte (one each, or all eight) and checks what must hold for any single flip.
fn flip_everywhere(all_bits: bool) {
    let (bytes, ticks) = small_recording();
    for at in 0..bytes.len() {
        let chosen = if all_bits { 0..8 } else { at * 5 % 8..at * 5 % 8 + 1 };
        for bit in chosen {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            let case = format!("byte {at} bit {bit}");
            let recording = Recording::from_bytes("flipped", damaged).expect(&case);
            let damage = recording.damage();
            assert!(!damage.complete, "{case}");
            let place = |finding: &Finding| finding.offset <= at as u64 && (at as u64) < finding.end;
            assert!(damage.findings.iter().any(place), "{case}: {:?}", damage.findings);
            let read = read_back(&recording, &ticks);
            assert!(read >= TICKS - TICKS_PER_CHUNK, "{case}: {read} ticks");
            assert_eq!(read + damage.ticks_lost_at_least, TICKS, "{case}");
            assert_eq!(recording.header(), Some(&header()), "{case}");
        }
    }
}

#[test]
fn a_flipped_bit_is_found_at_its_place_and_costs_one_chunk_at_most() {
    flip_everywhere(false);
}

#[test]
#[ignore = "eight times longer than the test with one bit of each byte"]
fn any_flipped_bit_is_found_at_its_place() {
    flip_everywhere(true);
}

#[test]
fn a_file_cut_anywhere_is_reported_and_its_beginning_is_usable() {
    let (bytes, ticks) = small_recording();
    let mut longest = 0;
    for len in 0..bytes.len() {
        match Recording::from_bytes("cut", &bytes[..len]) {
            Ok(recording) => {
                let damage = recording.damage();
                assert!(!damage.complete, "cut to {len}");
                assert_eq!(damage.findings.len(), 1, "cut to {len}: {:?}", damage.findings);
                assert_eq!(damage.findings[0].end, len as u64);
                let read = read_back(&recording, &ticks);
                assert!(read >= longest && damage.ticks_lost_at_least == 0, "cut to {len}");
                longest = read;
            }
            Err(RecordError::Empty { .. }) => assert_eq!(len, 0),
            Err(RecordError::NotMcap { .. }) => assert!(len < 8),
            Err(RecordError::NothingUsable { .. }) => assert_eq!(longest, 0),
            Err(other) => panic!("cut to {len}: {other}"),
        }
    }
    assert_eq!(longest, TICKS);
}

#[test]
fn several_damages_are_all_found() {
    let (bytes, ticks) = small_recording();
    let chunks: Vec<usize> = chunk_offsets(&bytes);
    let mut damaged = bytes.clone();
    damaged[chunks[1] + 60] ^= 1;
    damaged[chunks[3] + 60] ^= 1;
    damaged.truncate(bytes.len() - 100);
    let recording = Recording::from_bytes("several", damaged).unwrap();
    assert_eq!(read_back(&recording, &ticks), TICKS - 2 * TICKS_PER_CHUNK);
    assert_eq!(recording.damage().ticks_lost_at_least, 2 * TICKS_PER_CHUNK);
    assert_eq!(recording.damage().findings.len(), 3);
}

#[test]
fn a_killed_recorder_loses_the_last_100_ms_at_most() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut recorder = Recorder::create(&path, false, &header()).unwrap();
    let mut bits = Bits(11);
    let ticks: Vec<_> = (0..250).map(|tick| bits.tick(tick)).collect();
    for (input, output) in &ticks {
        recorder.tick(input, output).unwrap();
    }
    // Nothing of it runs any more, as after a kill.
    std::mem::forget(recorder);
    let recording = Recording::open(&path).unwrap();
    assert!(!recording.damage().complete);
    assert!(read_back(&recording, &ticks) >= 150);
    assert_eq!(recording.header(), Some(&header()));
}

/// Where the chunks of a whole file begin.
fn chunk_offsets(bytes: &[u8]) -> Vec<usize> {
    let mut at = 8;
    let mut offsets = Vec::new();
    while bytes[at] != mcap::records::op::DATA_END {
        if bytes[at] == mcap::records::op::CHUNK {
            offsets.push(at);
        }
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    offsets
}

#[test]
fn other_files_are_refused() {
    let open = |bytes: &[u8]| Recording::from_bytes("other", bytes).unwrap_err().to_string();
    assert!(open(b"").contains("0 bytes"));
    let text = open(b"time_s,gyro_x\n0.00,1.5\n");
    assert!(text.contains("starts with \"time_s,g\"") && text.contains("hint: "), "{text}");
    let mut foreign = std::io::Cursor::new(Vec::new());
    mcap::Writer::new(&mut foreign).unwrap().finish().unwrap();
    assert!(open(foreign.get_ref()).contains("nothing usable"));
    let mut older = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut older).unwrap();
    let channel_id = writer.add_channel(0, Topic::Traffic.name(), "cdr", &BTreeMap::new()).unwrap();
    let message = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
    let mut bytes = Vec::new();
    layout::encode_traffic(&mut bytes, Traffic::Bytes(b"x"));
    bytes[4] = 1;
    writer.write_to_known_channel(&message, &bytes).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let text = open(older.get_ref());
    assert!(text.contains("has layout 1, expected 2") && text.contains("version of otolith"), "{text}");
}

#[test]
fn creating_refuses_what_would_lose_data_and_names_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    fs::write(&path, "precious").unwrap();
    let error = Recorder::create(&path, false, &header()).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }));
    assert!(error.to_string().contains("run.mcap") && error.to_string().contains("hint: "));
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    Recorder::create(&path, true, &header()).unwrap().finish("{}").unwrap();
    assert!(Recording::open(&path).unwrap().damage().complete);

    let nowhere = folder.path().join("missing").join("run.mcap");
    let error = Recorder::create(&nowhere, false, &header()).unwrap_err();
    assert!(matches!(error, RecordError::NoFolder { .. }), "{error}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_with_the_path() {
    let error = Recorder::create(Path::new("/dev/full"), true, &header()).unwrap_err();
    assert!(matches!(error, RecordError::Io { .. }), "{error}");
    assert!(error.to_string().contains("/dev/full"));
}

#[test]
fn dropped_ticks_are_no_late_ticks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dropped.mcap");
    let mut recorder = Recorder::create(&path, false, &header()).unwrap();
    let mut bits = Bits(3);
    for tick in [0, 1, 5] {
        let (input, output) = bits.tick(tick);
        recorder.tick(&input, &output).unwrap();
    }
    recorder.ticks_dropped(2);
    let (input, output) = bits.tick(8);
    recorder.tick(&input, &output).unwrap();
    assert_eq!(recorder.finish("{}").unwrap().ticks, 4);
    let recording = Recording::open(&path).unwrap();
    assert_eq!((recording.damage().ticks_read, recording.damage().ticks_lost_at_least), (4, 2));
    assert!(recording.damage().findings[0].what.contains("2 ticks before here were dropped while recording"));
    let mut seen = Vec::new();
    let report = verify(&recording, |input| {
        seen.push(input.tick.0);
        Bits(0).tick(input.tick.0).1
    });
    let report = report.unwrap();
    assert_eq!(seen, [0, 1, 5]);
    assert_eq!((report.ticks_compared, report.ticks_not_compared), (3, 1));
}

#[test]
fn verification_names_the_first_difference() {
    let (bytes, ticks) = small_recording();
    let recording = Recording::from_bytes("small", bytes).unwrap();
    let mut outputs = ticks.iter().map(|(_, output)| *output);
    let report = verify(&recording, |_| outputs.next().unwrap()).unwrap();
    assert!(report.is_bit_identical());
    assert_eq!(report.ticks_compared, TICKS);

    let mut outputs = ticks.iter().map(|(_, output)| *output);
    let report = verify(&recording, |input| {
        let mut output = outputs.next().unwrap();
        if input.tick >= Tick(12) {
            let y = &mut output.blue.perception.omega_head.y;
            *y = f64::from_bits(y.to_bits() ^ 1);
        }
        output
    });
    let report = report.unwrap();
    let difference = report.first_difference.clone().unwrap();
    assert_eq!((difference.tick, difference.field.as_str()), (12, "blue.perception.omega_head.y"));
    assert_eq!(difference.recorded_bits ^ difference.computed_bits, 1);
    assert_eq!(report.differing_ticks, TICKS - 11);
    assert!(!report.is_bit_identical());
}

#[test]
fn verification_stops_at_a_gap() {
    let (bytes, ticks) = small_recording();
    let mut damaged = bytes.clone();
    damaged[chunk_offsets(&bytes)[2] + 60] ^= 1;
    let recording = Recording::from_bytes("gap", damaged).unwrap();
    let mut outputs = ticks.iter().map(|(_, output)| *output);
    let report = verify(&recording, |_| outputs.next().unwrap()).unwrap();
    assert_eq!(report.ticks_compared, TICKS_PER_CHUNK);
    assert_eq!(report.ticks_not_compared, TICKS - 2 * TICKS_PER_CHUNK);
    assert_eq!(report.differing_ticks, 0);
    assert!(!report.is_bit_identical());
}

#[test]
fn recorder_and_readers_may_move_to_another_thread() {
    fn movable<T: Send + 'static>() {}
    movable::<Recorder>();
    movable::<Recording>();
    movable::<Ticks>();
    movable::<TrafficPieces>();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn garbage_after_the_magic_is_survived(garbage in prop::collection::vec(any::<u8>(), 0..400)) {
        let bytes = [mcap::MAGIC, &garbage].concat();
        prop_assert!(Recording::from_bytes("garbage", bytes).is_err());
    }
}
