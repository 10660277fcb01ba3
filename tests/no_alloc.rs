//! No heap operation in a tick nor in a decoder: a counting allocator watches the core through a spin, and decoders of
//! devices through whole, damaged and foreign bytes.

// An allocator is unsafe by its signature; this one only counts and hands on to the system's. It needs a test binary of
// its own, since a program has one allocator.
#![allow(unsafe_code, clippy::unwrap_used)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::Vector3;
use otolith::character::CharacterModel;
use otolith::device::Traffic;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::can_map::{CAN_MAPS, CanMap, CanMapDecoder};
use otolith::device::protocol::detect::decoder_by_name;
use otolith::imu::LinkHealth;
use otolith::motion::{MotionSettings, shipped_motion};
use otolith::runtime::{Core, CoreSettings, Push};
use otolith::tick::{Posture, TickInput};
use otolith::time::Tick;
use otolith::vestibular::HeadMotion;

struct Counting;

static OPERATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        OPERATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        OPERATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: `pointer` came from `alloc` above with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        OPERATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as for `dealloc`.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs `core` for `ticks` and returns the heap operations of that time, and whether green stood all the time.
fn operations(core: &mut Core, ticks: std::ops::Range<u64>) -> (u64, bool) {
    let before = OPERATIONS.load(Ordering::Relaxed);
    let mut standing = true;
    for k in ticks {
        let tick = Tick(k);
        let rate = std::f64::consts::PI * (tick.time_s() - 0.1).clamp(0.0, 1.0);
        let gif_head = Vector3::new(0.0, 0.0, -9.81);
        let chair =
            (k % 500 != 0).then_some(HeadMotion { omega_head: Vector3::new(0.0, 0.0, rate), gif_head });
        let output = core.step(&TickInput { tick, chair, link: LinkHealth::Live, respawn: false });
        standing &= output.green.posture == Posture::Standing;
    }
    (OPERATIONS.load(Ordering::Relaxed) - before, standing)
}

/// Pushes frames of every ready mapping of CAN signals: whole, short, out of order. Gives heap operations and samples.
fn can_operations() -> (u64, u64) {
    let (mut spent, mut samples) = (0, 0);
    for shipped in CAN_MAPS {
        let map = CanMap::new(shipped.name, shipped.map, shipped.dbc_name, shipped.dbc).unwrap();
        let mut ids: Vec<_> =
            map.messages().map(|message| (message.extended, message.id, message.size)).collect();
        ids.sort_unstable();
        let mut decoder = CanMapDecoder::new(&map);
        let before = OPERATIONS.load(Ordering::Relaxed);
        for k in 0..2000_usize {
            let (extended, id, size) = ids[(k + k / 500) % ids.len()];
            let data = [0x40, k as u8, 0x20, 0x10, 0x40, 0x01, 0, 0];
            let data = &data[..if k % 61 == 7 { 1 } else { size }];
            decoder.push(Traffic::CanFrame { id, extended, data }, &mut |_| samples += 1);
        }
        decoder.rejoin();
        decoder.finish(&mut |_| samples += 1);
        spent += OPERATIONS.load(Ordering::Relaxed) - before;
    }
    (spent, samples)
}

/// All golden frames or lines of a device, one after another.
fn golden(text: &str) -> Vec<u8> {
    let golden: serde_json::Value = serde_json::from_str(text).unwrap();
    let rows = golden["frames"].as_array().or(golden["lines"].as_array()).unwrap();
    rows.iter().flat_map(bytes_of).collect()
}

fn bytes_of(row: &serde_json::Value) -> Vec<u8> {
    let Some(digits) = row["hex"].as_str() else { return row["text"].as_str().unwrap().into() };
    (0..digits.len() / 2).map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).unwrap()).collect()
}

/// Heap operations of `decoder` in all of `bytes`, three times over: whole, damaged and cut; and its samples.
fn decoding_operations(decoder: &mut dyn PacketDecoder, bytes: &[u8]) -> (u64, u64) {
    let mut damaged = bytes.to_vec();
    damaged.iter_mut().step_by(37).for_each(|byte| *byte ^= 0x20);
    let mut samples = 0;
    let before = OPERATIONS.load(Ordering::Relaxed);
    for (stream, piece) in [(bytes, 4096), (&damaged[..], 64), (bytes, 7)] {
        for piece in stream.chunks(piece) {
            decoder.push(Traffic::Bytes(piece), &mut |_| samples += 1);
        }
    }
    decoder.finish(&mut |_| samples += 1);
    (OPERATIONS.load(Ordering::Relaxed) - before, samples)
}

/// The packets of one protocol among the vectors of other people's devices.
fn vectors(proto: &str) -> Vec<u8> {
    let all: serde_json::Value = serde_json::from_str(include_str!("golden/devices/vectors.json")).unwrap();
    all.as_array().unwrap().iter().filter(|vector| vector["proto"] == proto).flat_map(bytes_of).collect()
}

fn decoders_do_not_touch_the_heap() {
    let vectornav = [
        golden(include_str!("golden/devices/vectornav-lines.json")),
        golden(include_str!("golden/devices/vectornav-frames.json")),
    ];
    for (protocol, bytes) in [
        ("vectornav", vectornav.concat()),
        ("mavlink", golden(include_str!("golden/devices/mavlink-frames.json"))),
        ("xbus", vectors("xsens-xbus")),
        ("mip", vectors("microstrain-mip")),
        ("openimu", vectors("openimu-z1")),
        ("openimu", vectors("aceinna-S1")),
        ("witmotion", vectors("witmotion-serial")),
    ] {
        let mut decoder = decoder_by_name(protocol).unwrap();
        decoder.allow_degraded();
        let (operations, samples) = decoding_operations(decoder.as_mut(), &bytes.repeat(20));
        assert!((operations, samples > 0) == (0, true), "{protocol}: {operations} in {samples} samples");
    }
}

// One test only: the counter sees every thread of the binary.
#[test]
fn neither_ticks_nor_frames_touch_the_heap() {
    ticks_do_not_touch_the_heap_in_a_spin_nor_in_a_motion_nor_in_a_fall();
    let (spent, samples) = can_operations();
    assert_eq!(spent, 0, "decoding CAN frames");
    assert!(samples > 1000, "{samples} samples only");
    decoders_do_not_touch_the_heap();
}

fn ticks_do_not_touch_the_heap_in_a_spin_nor_in_a_motion_nor_in_a_fall() {
    let model = || CharacterModel::standing().unwrap();
    let mut core = Core::new(CoreSettings::default(), model()).unwrap();
    assert!(OPERATIONS.load(Ordering::Relaxed) > 0, "the counter does not count");
    operations(&mut core, 0..100);
    assert_eq!(operations(&mut core, 100..2100), (0, true));

    let motion = MotionSettings::from_toml(shipped_motion("stand-up").unwrap()).unwrap();
    let settings =
        CoreSettings { motion: Some(motion), motion_start_s: Some(0.5), ..CoreSettings::default() };
    let mut core = Core::new(settings, model()).unwrap();
    let squatting = core.blue().state().joint_angles;
    operations(&mut core, 0..100);
    assert_eq!(operations(&mut core, 100..3500), (0, true), "standing up");
    assert!((core.blue().state().joint_angles - squatting).amax() > 1.0, "they stood up");

    let push = Push { start_s: 0.2, duration_s: 0.2, force: [800.0, 0.0] };
    let settings = CoreSettings { push: Some(push), respawn_after_s: Some(1.0), ..CoreSettings::default() };
    let mut core = Core::new(settings, model()).unwrap();
    operations(&mut core, 0..100);
    assert_eq!(operations(&mut core, 100..2500), (0, false), "falling");
    assert_eq!(operations(&mut core, 2500..5000).0, 0, "lying and standing up again");
}
