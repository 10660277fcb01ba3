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
use otolith::device::protocol::mavlink::MavlinkDecoder;
use otolith::device::protocol::vectornav::VectorNavDecoder;
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

fn decoders_do_not_touch_the_heap() {
    let vectornav = [
        golden(include_str!("golden/devices/vectornav-lines.json")),
        golden(include_str!("golden/devices/vectornav-frames.json")),
    ];
    let mavlink = golden(include_str!("golden/devices/mavlink-frames.json"));
    let (operations, samples) = decoding_operations(&mut VectorNavDecoder::new(), &vectornav.concat());
    assert!((operations, samples > 0) == (0, true), "vectornav: {operations} in {samples} samples");
    let (operations, samples) = decoding_operations(&mut MavlinkDecoder::new(), &mavlink);
    assert!((operations, samples > 0) == (0, true), "mavlink: {operations} in {samples} samples");
}

// One test only: the counter sees every thread of the binary.
#[test]
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

    decoders_do_not_touch_the_heap();
}
