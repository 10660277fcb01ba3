//! No heap operation in a tick nor in a decoder: a counting allocator watches the core through a spin.

// An allocator is unsafe by its signature; this one only counts and hands on to the system's. It needs a test binary of
// its own, since a program has one allocator.
#![allow(unsafe_code, clippy::unwrap_used)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::Vector3;
use otolith::character::CharacterModel;
use otolith::device::Traffic;
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

/// Heap operations of the decoder called `protocol` while it takes `frames` a hundred times, some damaged, in pieces of
/// 61 bytes; and the samples it found.
fn operations_of_decoder(protocol: &str, frames: &[u8]) -> (u64, u64) {
    let mut stream = frames.repeat(100);
    stream.iter_mut().step_by(1009).for_each(|byte| *byte ^= 0x10);
    let (mut decoder, mut samples) = (decoder_by_name(protocol).unwrap(), 0);
    let before = OPERATIONS.load(Ordering::Relaxed);
    for piece in stream.chunks(61) {
        decoder.push(Traffic::Bytes(piece), &mut |_| samples += 1);
    }
    decoder.finish(&mut |_| samples += 1);
    (OPERATIONS.load(Ordering::Relaxed) - before, samples)
}

/// The frames of one protocol in the vectors of other people's devices.
fn vectors(proto: &str) -> Vec<u8> {
    let all: serde_json::Value = serde_json::from_str(include_str!("golden/devices/vectors.json")).unwrap();
    let of_it = all.as_array().unwrap().iter().filter(|vector| vector["proto"] == proto);
    let digits: String = of_it.map(|vector| vector["hex"].as_str().unwrap()).collect();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    digits.as_bytes().chunks(2).map(byte).collect()
}

fn decoders_do_not_touch_the_heap() {
    for (protocol, proto, least) in [("xbus", "xsens-xbus", 90), ("mip", "microstrain-mip", 170)] {
        let (operations, samples) = operations_of_decoder(protocol, &vectors(proto));
        assert_eq!(operations, 0, "{protocol}");
        assert!(samples >= least, "{protocol}: {samples} samples");
    }
}

// One test only: the counter sees every thread of the binary.
#[test]
fn ticks_do_not_touch_the_heap_in_a_spin_nor_in_a_motion_nor_in_a_fall() {
    decoders_do_not_touch_the_heap();
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
