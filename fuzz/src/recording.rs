//! Our own recordings: damage is reported, and what is said to be readable is.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use otolith::device::Traffic;
use otolith::imu::{HeadSample, LinkHealth};
use otolith::record::{Recorder, Recording, RecordingHeader};
use otolith::tick::{CharacterOutput, PlatformMotion, Posture, TickInput, TickOutput};
use otolith::time::{HostTime, Tick};
use otolith::vestibular::{HeadMotion, Perception};

pub(crate) fn run(data: &[u8]) {
    let Ok(recording) = Recording::from_bytes("recording", data) else { return };
    let damage = recording.damage();
    let ticks = recording.ticks().expect("memory does not fail").filter(Result::is_ok).count() as u64;
    let traffic = recording.traffic().expect("memory does not fail").filter(Result::is_ok).count() as u64;
    assert_eq!((ticks, traffic), (damage.ticks_read, damage.traffic_read), "{damage:?}");
    for piece in recording.traffic().expect("memory does not fail") {
        drop(piece.map(|piece| format!("{:?}", piece.traffic())));
    }
    assert!(recording.events().expect("memory does not fail").all(|event| event.is_ok()));
    assert_eq!(damage.complete, damage.findings.is_empty(), "{damage:?}");
    assert!(!format!("{damage:?}{:?}{:?}", recording.header(), recording.summary()).is_empty());
}

fn character() -> CharacterOutput {
    let zero = Vector3::zeros();
    CharacterOutput {
        perception: Perception { gravity_head: zero, omega_head: zero, accel_head: zero },
        gravity_platform: zero,
        gravity_tilt: 0.0,
        com_platform: zero,
        com_sway: 0.0,
        cop_platform: None,
        foot_tilt: 0.0,
        constraint_residual: 0.0,
        saturated_joints: 0,
        posture: Posture::Standing,
        state_hash: 7,
    }
}

/// A recording with everything in it, of so many ticks.
fn recording_of(ticks: u64) -> Option<Vec<u8>> {
    let path = std::env::temp_dir().join(format!("otolith-fuzz-{}-{ticks}.mcap", std::process::id()));
    let models = BTreeMap::from([("standing.xml".to_owned(), "<mujoco/>".to_owned())]);
    let header = RecordingHeader::new("device = \"mock:chair\"\n".to_owned(), models, "fuzz".to_owned());
    let motion = HeadMotion { omega_head: Vector3::zeros(), gif_head: Vector3::new(0.0, 0.0, -9.81) };
    let record = || {
        let mut recorder = Recorder::create(&path, true, &header)?;
        for tick in 0..ticks {
            let at = HostTime(tick * 1_000_000);
            recorder.traffic(at, Traffic::Bytes(&[tick as u8; 22]))?;
            recorder.traffic(at, Traffic::CanFrame { id: 0x3A0, extended: false, data: &[1, 2, 3] })?;
            recorder.chair_sample(&HeadSample { at, motion })?;
            let (tick, link) = (Tick(tick), LinkHealth::Live);
            let platform = PlatformMotion::default();
            let input = TickInput { tick, chair: Some(motion), link, respawn: false };
            recorder.tick(&input, &TickOutput { tick, platform, green: character(), blue: character() })?;
            recorder.event(at, "link lost")?;
        }
        recorder.finish("{}")
    };
    record().ok()?;
    let bytes = std::fs::read(&path).ok()?;
    std::fs::remove_file(&path).ok()?;
    Some(bytes)
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let whole: Vec<Vec<u8>> = [0, 2, 300].into_iter().filter_map(recording_of).collect();
    let cut = whole.iter().map(|bytes| bytes[..bytes.len() / 2].to_vec()).collect();
    [whole.clone(), cut].concat()
}
