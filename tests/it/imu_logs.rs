//! Recordings of real sensors, through decoder, clock, alignment and resampler. The expected numbers are those of
//! `imu-logs/PROVENANCE.md`, found there by independent readers.

#![allow(clippy::unwrap_used)] // The lint spares only functions marked as tests, not what they share.

use otolith::device::Traffic;
use otolith::device::protocol::mavlink::MavlinkDecoder;
use otolith::device::protocol::text::{TextDecoder, TextMapping};
use otolith::device::protocol::{DecodeCounters, PacketDecoder};
use otolith::imu::{
    AlignmentReport, Calibration, HeadSample, ImuPipeline, ImuSample, ImuSettings, LinkHealth, Mount,
    Resampler, RestDetector,
};
use otolith::time::HostTime;
use otolith::units::DEG_PER_RAD;

const GRAVITY: f64 = 9.81;

struct Played {
    samples: Vec<HeadSample>,
    counters: DecodeCounters,
    pipeline: ImuPipeline,
}

impl Played {
    fn report(&self) -> &AlignmentReport {
        self.pipeline.report().unwrap()
    }

    /// Trapezoidal integral of the head's yaw rate, degrees.
    fn turned_deg(&self) -> f64 {
        let steps = self.samples.windows(2).map(|pair| {
            let dt = pair[1].at.as_secs_f64() - pair[0].at.as_secs_f64();
            0.5 * dt * (pair[0].motion.omega_head.z + pair[1].motion.omega_head.z)
        });
        steps.sum::<f64>() * DEG_PER_RAD
    }
}

/// Plays a log line by line, each stamped with its own time, as a replay does.
fn play(log: &[u8], mapping: &str, settings: &ImuSettings) -> Played {
    let path = format!("{}/configs/logs/{mapping}", env!("CARGO_MANIFEST_DIR"));
    let mapping = TextMapping::from_toml(mapping, &std::fs::read_to_string(path).unwrap()).unwrap();
    mapping.check_log("log", "mapping", &log[..log.len().min(4096)]).unwrap();
    mapping.check_rows("log", log).unwrap();
    let mut times = mapping.line_times();
    let mut decoder = TextDecoder::new(&mapping);
    let mut pipeline = ImuPipeline::new(settings, Calibration::default(), Mount::default(), GRAVITY);
    let mut samples = Vec::new();
    let mut at = HostTime::default();
    for line in log.split(|&byte| byte == b'\n') {
        if let Some(seconds) = times.time_of_line(line) {
            at = HostTime::from_secs_f64(seconds);
        }
        for bytes in [line, b"\n"] {
            decoder.push(Traffic::Bytes(bytes), &mut |reading| {
                pipeline.push(&reading, at, &mut |sample| samples.push(sample));
            });
        }
    }
    pipeline.finish(&mut |sample| samples.push(sample));
    Played { samples, counters: decoder.counters(), pipeline }
}

fn assert_near(what: &str, found: f64, expected: f64, tolerance: f64) {
    println!("{what}: {found:.4} (expected {expected})");
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected} +- {tolerance}");
}

/// Rest as PROVENANCE.md takes it: 40 rows from the sixth, in sensor axes.
fn rest_of_its_first_rows(log: &[u8]) -> RestDetector {
    let as_it_is =
        ImuSettings { level: false, find_gyro_bias: false, scale_rest_norm: false, ..ImuSettings::default() };
    let mut rest = RestDetector::default();
    for sample in &play(log, "turntable-lsm9ds1.toml", &as_it_is).samples[5..45] {
        let motion = &sample.motion;
        let (omega_imu, specific_force_imu) = (motion.omega_head, -motion.gif_head);
        rest.push(&ImuSample { at: sample.at, omega_imu, specific_force_imu }, true);
    }
    rest
}

#[test]
fn turntable_circle_matches_its_provenance() {
    let Some(log) = crate::shared_capture("turntable/roomba_circular_start_rotate_stop.txt") else { return };
    let played = play(&log, "turntable-lsm9ds1.toml", &ImuSettings::default());
    assert_eq!(played.counters, DecodeCounters { packets: 1216, ..DecodeCounters::default() });
    assert_eq!(played.samples.len(), 1216);
    assert_eq!(played.pipeline.counters().clock_resets, 0);
    assert_near("duration", played.samples[1215].at.as_secs_f64(), 18.987, 5.1e-4);
    assert_near("turned", played.turned_deg(), -322.2, 3.2);

    let report = played.report();
    assert!(report.at_rest && report.levelled && !report.scale_refused);
    assert_near("tilt in the first second", report.mount_tilt_deg.unwrap(), 4.35, 0.1);
    assert_near("norm in the first second", report.rest_norm_m_s2.unwrap(), 9.487, 0.01);
    assert_near("scale", report.scale, GRAVITY / 9.487, 0.001);
    // The axis of rotation is 3.48 degrees from the sensor's z; levelling by gravity must bring it nearer to up.
    let plateau = &played.samples[300..900];
    let omega = plateau.iter().map(|sample| sample.motion.omega_head).sum::<nalgebra::Vector3<f64>>() / 600.0;
    assert_near("plateau", omega.norm() * DEG_PER_RAD, 21.43, 0.1);
    assert_near("axis from vertical", omega.xy().norm() / omega.norm() * DEG_PER_RAD, 0.0, 2.0);
}

#[test]
fn turntable_rest_window_matches_its_provenance() {
    let Some(log) = crate::shared_capture("turntable/roomba_circular_start_rotate_stop.txt") else { return };
    let rest = rest_of_its_first_rows(&log);
    assert!(rest.is_at_rest(&ImuSettings::default().rest));
    let force = rest.mean_specific_force().unwrap();
    for (found, expected) in force.iter().zip([-0.538, -0.478, 9.460]) {
        assert_near("rest specific force", *found, expected, 5.1e-4);
    }
    assert_near("norm", force.norm(), 9.487, 5.1e-4);
    assert_near("tilt", Mount::default().levelled(&force).1 * DEG_PER_RAD, 4.35, 0.005);
    for (found, expected) in rest.mean_omega().iter().zip([0.012, 0.003, -0.017]) {
        assert_near("gyro bias", found * DEG_PER_RAD, expected, 5.1e-4);
    }
}

#[test]
fn turntable_spin_matches_its_provenance() {
    let Some(log) = crate::shared_capture("turntable/roomba_spin_23dps.txt") else { return };
    let played = play(&log, "turntable-lsm9ds1.toml", &ImuSettings::default());
    assert_eq!(played.samples.len(), 1728);
    assert_near("turned", played.turned_deg(), -583.3, 5.8);
    assert!(played.report().at_rest);
    assert_near("tilt in the first second", played.report().mount_tilt_deg.unwrap(), 6.86, 0.1);
    let force = rest_of_its_first_rows(&log).mean_specific_force().unwrap();
    assert_near("tilt", Mount::default().levelled(&force).1 * DEG_PER_RAD, 6.86, 0.005);
}

#[test]
fn turntable_log_keeps_the_link_alive_at_every_tick() {
    let Some(log) = crate::shared_capture("turntable/roomba_circular_start_rotate_stop.txt") else { return };
    let mut resampler = Resampler::new(ImuSettings::default().hold_limit_s);
    let played = play(&log, "turntable-lsm9ds1.toml", &ImuSettings::default());
    played.samples.iter().for_each(|&sample| resampler.push(sample));
    let mut turned = 0.0;
    for tick in 0..18_987_u64 {
        let (motion, health) = resampler.at(HostTime(tick * 1_000_000));
        assert_eq!(health, LinkHealth::Live, "tick {tick}");
        turned += motion.unwrap().omega_head.z * 1e-3 * DEG_PER_RAD;
    }
    assert_near("turned by ticks", turned, played.turned_deg(), 0.05);
    assert_eq!(resampler.counters(), Default::default());
}

/// The steps of the device's clock, and the losses when frames are taken out.
#[test]
fn telemetry_log_matches_its_provenance() {
    let Some(log) = crate::shared_capture("mavlink/ardusub_small.tlog") else { return };
    let frames = telemetry_frames(&log);
    assert_eq!(frames.len(), 35_916);
    let play = |keep: &dyn Fn(usize, &[u8]) -> bool| {
        let mut decoder = MavlinkDecoder::new();
        let mut times = Vec::new();
        for (_, frame) in frames.iter().enumerate().filter(|(index, frame)| keep(*index, frame)) {
            decoder
                .push(Traffic::Bytes(frame), &mut |reading| times.push(reading.device_time.unwrap().micros));
        }
        decoder.finish(&mut |_| panic!("nothing is held back"));
        (times, decoder.counters())
    };
    let (times, counters) = play(&|_, _| true);
    assert_eq!(counters, DecodeCounters { packets: 35_916, ..DecodeCounters::default() });
    let steps: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!((times.len(), steps.iter().min(), steps.iter().max()), (528, Some(&239_915), Some(&759_987)));
    // Of the autopilot, every frame at a place that ten divides is taken out.
    let of_autopilot = |frame: &[u8]| (frame[5], frame[6]) == (1, 1);
    let first_sample = frames.iter().position(|frame| frame[7..10] == [27, 0, 0]).unwrap();
    let kept = |index: usize, frame: &[u8]| {
        index <= first_sample || !index.is_multiple_of(10) || !of_autopilot(frame)
    };
    let lost = frames.iter().enumerate().filter(|(index, frame)| !kept(*index, frame)).count() as u64;
    let last = frames.iter().rposition(|frame| of_autopilot(frame)).unwrap();
    let (_, counters) = play(&kept);
    let unseen = u64::from(!kept(last, frames[last]));
    assert_eq!((counters.packets, counters.missing), (35_916 - lost, lost - unseen));
    assert!(lost > 3000, "{lost}");
}

/// The frames of a telemetry log, by their lengths alone.
fn telemetry_frames(log: &[u8]) -> Vec<&[u8]> {
    let (mut frames, mut rest) = (Vec::new(), log);
    while !rest.is_empty() {
        let length = 12 + usize::from(rest[9]);
        frames.push(&rest[8..8 + length]);
        rest = &rest[8 + length..];
    }
    frames
}

#[test]
fn phone_logs_are_read_to_the_last_row_without_an_accelerometer() {
    for (name, rows, duration_s, turned_deg, max_rate) in [
        ("phone/phyphox_z_circle_then_stop.csv", 2239, 22.467, 3914.9, 6.371),
        ("phone/phyphox_z_spinup.csv", 982, 9.848, 3645.9, 20.4),
    ] {
        let Some(log) = crate::shared_capture(name) else { return };
        let played = play(&log, "phyphox.toml", &ImuSettings::default());
        assert_eq!((played.counters.packets, played.counters.bad_checksum), (rows, 0), "{name}");
        assert_eq!(played.samples.len() as u64, rows);
        assert!(played.report().started_moving && played.report().accelerometer_missing);
        assert_near("duration", played.samples.last().unwrap().at.as_secs_f64(), duration_s, 6e-4);
        assert_near("turned", played.turned_deg(), turned_deg, 0.05);
        let fastest = played.samples.iter().map(|sample| sample.motion.omega_head.norm()).fold(0.0, f64::max);
        assert_near("fastest", fastest, max_rate, 0.05);
    }
}
