use nalgebra::{Rotation3, Unit};
use proptest::prelude::*;

use super::*;
use crate::device::protocol::DeviceTime;
use crate::units::RAD_PER_DEG;

const GRAVITY: f64 = 9.81;

fn reading(us: u64, omega: [f64; 3], force: Option<[f64; 3]>) -> ImuReading {
    ImuReading {
        device_time: Some(DeviceTime { micros: us, wraps_after_us: None }),
        omega_imu: omega.into(),
        specific_force_imu: force.map(Into::into),
        clipped: false,
    }
}

/// Feeds 200 Hz readings of sample index to (omega, force); returns all head samples and the pipeline.
fn run(
    settings: &ImuSettings,
    mount: Mount,
    count: u64,
    motion: impl Fn(u64) -> ([f64; 3], Option<[f64; 3]>),
) -> (Vec<HeadSample>, ImuPipeline) {
    let mut pipeline = ImuPipeline::new(settings, Calibration::default(), mount, GRAVITY);
    let mut samples = Vec::new();
    for k in 0..count {
        let (omega, force) = motion(k);
        pipeline.push(&reading(k * 5000, omega, force), HostTime(k * 5_000_000), &mut |sample| {
            samples.push(sample)
        });
    }
    pipeline.finish(&mut |sample| samples.push(sample));
    (samples, pipeline)
}

#[test]
fn rest_gives_bias_level_and_scale_and_no_sample_is_lost() {
    // A sensor rolled by 4 degrees, 2 % too much gravity, a bias of 1 deg/s, then a turn of 60 deg/s about the true up.
    let tilted = Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::x()), 4.0 * RAD_PER_DEG);
    let bias = Vector3::new(0.01, -0.005, 0.008);
    let spin = Vector3::new(0.0, 0.0, 60.0 * RAD_PER_DEG);
    let force: [f64; 3] = (tilted.inverse() * Vector3::new(0.0, 0.0, 1.02 * GRAVITY)).into();
    let (samples, pipeline) = run(&ImuSettings::default(), Mount::default(), 600, |k| {
        let omega = if k < 300 { bias } else { bias + tilted.inverse() * spin };
        (omega.into(), Some(force))
    });
    assert_eq!(samples.len(), 600);
    assert_eq!(pipeline.counters(), ImuCounters { readings: 600, samples: 600, ..ImuCounters::default() });
    let upright = Vector3::new(0.0, 0.0, -GRAVITY);
    for (k, sample) in samples.iter().enumerate() {
        assert_eq!(sample.at, HostTime(k as u64 * 5_000_000));
        assert!((sample.motion.gif_head - upright).norm() < 1e-9);
        let omega = if k < 300 { Vector3::zeros() } else { spin };
        assert!((sample.motion.omega_head - omega).norm() < 1e-9, "{k}: {}", sample.motion.omega_head);
    }
    let report = pipeline.report().unwrap();
    assert!(report.at_rest && report.levelled && !report.started_moving && !report.scale_refused);
    assert_eq!(report.samples, 201);
    assert!((report.mount_tilt_deg.unwrap() - 4.0).abs() < 1e-9);
    assert!((report.scale - 1.0 / 1.02).abs() < 1e-12);
    assert!((Vector3::from(report.gyro_bias_rad_s) - bias).norm() < 1e-12);
}

#[test]
fn each_part_of_the_alignment_can_be_switched_off() {
    let force = [0.5, 0.0, 9.9];
    let settings =
        ImuSettings { level: false, find_gyro_bias: false, scale_rest_norm: false, ..ImuSettings::default() };
    let (samples, pipeline) = run(&settings, Mount::default(), 300, |_| ([0.01, 0.0, 0.0], Some(force)));
    assert_eq!(samples[0].motion.gif_head, -Vector3::from(force));
    assert_eq!(samples[0].motion.omega_head.x, 0.01);
    let report = pipeline.report().unwrap();
    assert!(report.at_rest && !report.levelled);
    assert!((report.mount_tilt_deg.unwrap() - 2.891).abs() < 1e-3, "the tilt is told all the same");
}

#[test]
fn a_stream_that_begins_in_the_turn_keeps_its_rate() {
    let spin = 180.0 * RAD_PER_DEG;
    let (samples, pipeline) =
        run(&ImuSettings::default(), Mount::default(), 400, |_| ([0.0, 0.0, spin], Some([0.3, 0.0, 9.5])));
    assert_eq!(samples.len(), 400);
    assert_eq!(samples[0].motion.omega_head.z, spin);
    assert_eq!(samples[0].motion.gif_head, -Vector3::new(0.3, 0.0, 9.5));
    let report = pipeline.report().unwrap();
    assert!(report.started_moving && !report.at_rest && report.mount_tilt_deg.is_none());
    assert_eq!((report.scale, report.gyro_bias_rad_s), (1.0, [0.0; 3]));
}

#[test]
fn a_wrong_unit_is_flagged_not_scaled() {
    let (samples, pipeline) =
        run(&ImuSettings::default(), Mount::default(), 300, |_| ([0.0; 3], Some([0.0, 0.0, 1.0])));
    assert!(pipeline.report().unwrap().scale_refused);
    assert_eq!(samples[0].motion.gif_head.z, -1.0);
}

#[test]
fn without_an_accelerometer_the_head_is_upright_whatever_the_mount() {
    let mount = Mount {
        rot_head_imu: Rotation3::from_axis_angle(&Vector3::y_axis(), 2.0),
        lever_arm_head: Vector3::new(0.3, 0.0, 0.5),
    };
    let (samples, pipeline) =
        run(&ImuSettings::default(), mount, 300, |k| ([if k < 250 { 0.0 } else { 2.0 }, 0.0, 0.0], None));
    for sample in &samples {
        assert!((sample.motion.gif_head - Vector3::new(0.0, 0.0, -GRAVITY)).norm() < 1e-12);
    }
    let report = pipeline.report().unwrap();
    assert!(
        report.accelerometer_missing && report.at_rest && report.rest_norm_m_s2.is_none() && !report.levelled
    );
    assert_eq!(pipeline.counters().missing_specific_force, 300);
}

#[test]
fn a_short_stream_is_given_out_at_its_end() {
    let (samples, pipeline) =
        run(&ImuSettings::default(), Mount::default(), 50, |_| ([0.0; 3], Some([0.0, 0.0, 9.5])));
    assert_eq!(samples.len(), 50);
    assert!(pipeline.report().unwrap().at_rest);
    let (samples, pipeline) =
        run(&ImuSettings::default(), Mount::default(), 3, |_| ([0.0; 3], Some([0.0, 0.0, 9.5])));
    let report = pipeline.report().unwrap();
    assert_eq!(samples.len(), 3);
    assert!(!report.at_rest && !report.started_moving, "three samples prove neither rest nor motion");
    let (samples, pipeline) = run(&ImuSettings::default(), Mount::default(), 0, |_| unreachable!());
    assert!(samples.is_empty() && pipeline.report().is_none());
}

#[test]
fn a_stream_too_fast_for_the_window_cuts_it_short() {
    let mut pipeline =
        ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), GRAVITY);
    let (capacity, mut given) = (pipeline.window.capacity(), 0);
    for k in 0..10_000_u64 {
        let reading = reading(k * 50, [0.0; 3], Some([0.0, 0.0, GRAVITY]));
        pipeline.push(&reading, HostTime(k * 50_000), &mut |_| given += 1);
    }
    assert_eq!(given, 10_000);
    assert_eq!(pipeline.report().unwrap().samples, 4001);
    assert_eq!(pipeline.window.capacity(), capacity);
}

#[test]
fn clips_are_counted_and_an_announced_rate_gives_times() {
    let mut pipeline =
        ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), GRAVITY);
    pipeline.announce_rate(200.0);
    let mut times = Vec::new();
    for k in 0..300_u64 {
        let reading = ImuReading { device_time: None, clipped: k % 100 == 0, ..reading(0, [0.0; 3], None) };
        // Two samples to a packet.
        pipeline.push(&reading, HostTime((k / 2 + 1) * 10_000_000), &mut |sample| times.push(sample.at.0));
    }
    assert_eq!(pipeline.clock_mode(), ClockMode::Nominal);
    assert_eq!(pipeline.counters().clipped, 3);
    assert!(times.windows(2).skip(2).all(|pair| pair[1] - pair[0] == 5_000_000));
}

proptest! {
    /// Any numbers may come: finite readings all come out, others are counted, nothing non-finite is given on.
    #[test]
    fn nothing_non_finite_passes(values in prop::collection::vec(prop::array::uniform6(any::<f64>()), 0..60)) {
        let mut pipeline =
            ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), GRAVITY);
        let mut given = 0;
        let mut count = |_| given += 1;
        let finite = values.iter().filter(|row| row.iter().all(|value| value.is_finite())).count();
        for (k, &[a, b, c, d, e, f]) in values.iter().enumerate() {
            let at = HostTime(k as u64 * 10_000_000);
            pipeline.push(&reading(k as u64 * 10_000, [a, b, c], Some([d, e, f])), at, &mut count);
        }
        pipeline.finish(&mut count);
        prop_assert_eq!(given, finite);
        prop_assert_eq!(pipeline.counters().non_finite as usize, values.len() - finite);
    }
}

#[test]
fn a_stream_that_turns_from_its_first_sample_is_not_held_back_for_the_whole_window() {
    let mut pipeline =
        ImuPipeline::new(&ImuSettings::default(), Calibration::default(), Mount::default(), GRAVITY);
    let mut first_out = None;
    for k in 0..400 {
        let reading = reading(k * 5000, [0.0, 0.0, 1.0], Some([0.0, 0.0, GRAVITY]));
        pipeline.push(&reading, HostTime(k * 5_000_000), &mut |_| {
            first_out.get_or_insert(k);
        });
    }
    // 0.1 s at 200 Hz.
    assert_eq!(first_out, Some(20));
    assert!(pipeline.report().unwrap().started_moving);
    assert_eq!(pipeline.counters().samples, 400);
}
