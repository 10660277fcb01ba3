//! Every vector of `vectors.json`, read and written.

use otolith::device::configure::{Answer, Plan, Request, mip, xbus};
use otolith::device::protocol::ImuReading;
use otolith::units::STANDARD_GRAVITY;
use serde_json::Value;

use super::{decode, vector, vectors};

/// The one sample of a frame.
fn sample(protocol: &str, frame: &[u8]) -> ImuReading {
    let (readings, counters) = decode(protocol, frame, 7);
    assert_eq!((counters.packets, counters.bytes_skipped, readings.len()), (1, 0, 1));
    readings[0]
}

#[track_caller]
fn assert_vector(found: [f64; 3], expected: &Value, unit: f64, tolerance: f64) {
    for (axis, found) in found.iter().enumerate() {
        let expected = expected[axis].as_f64().expect("a number");
        assert!((found / unit - expected).abs() <= tolerance, "{found} is not {expected}");
    }
}

#[test]
fn xbus_samples() {
    for (name, frame, expected) in vectors("xsens-xbus") {
        let reading = sample("xbus", &frame);
        let force = reading.specific_force_imu.expect("an accelerometer").into();
        assert_vector(force, &expected["acc_mps2"], 1.0, 0.0);
        assert_vector(reading.omega_imu.into(), &expected["gyr_radps"], 1.0, 0.0);
        let ticks = expected["sample_time_fine"].as_u64().expect("a number");
        assert_eq!(reading.device_time.map(|time| time.micros), Some(100 * ticks), "{name}");
        assert_eq!((expected["status"].as_u64(), reading.clipped), (Some(129), false));
    }
}

#[test]
fn mip_samples_and_answers() {
    for (name, frame, expected) in vectors("microstrain-mip") {
        if expected.get("ref_time_ns").is_none() {
            let (readings, counters) = decode("mip", &frame, 3);
            assert_eq!((readings.len(), counters.packets, counters.unknown), (0, 1, 0), "{name}");
            assert_eq!(counters.device_errors, 0, "an answer without an error");
            continue;
        }
        let reading = sample("mip", &frame);
        let force = reading.specific_force_imu.expect("an accelerometer").into();
        // The document rounds to six digits.
        assert_vector(force, &expected["accel_g"], STANDARD_GRAVITY, 5e-7);
        assert_vector(reading.omega_imu.into(), &expected["gyro_radps"], 1.0, 5e-7);
        let nanos = expected["ref_time_ns"].as_u64().expect("a number");
        assert_eq!(reading.device_time.map(|time| time.micros), Some(nanos / 1000), "{name}");
    }
}

/// The bytes of a plan's commands.
fn bytes(plan: &Plan) -> Vec<Vec<u8>> {
    plan.steps.iter().map(|step| step.bytes.clone()).collect()
}

fn judge(plan: &Plan, step: usize, received: &[u8]) -> Answer {
    plan.steps[step].answer.expect("every command has an answer")(received)
}

#[test]
fn xbus_commands() {
    let request = Request { rate_hz: Some(400.0), baud: None, save: true };
    let plain = xbus::plan(&request).expect("offered");
    let faster = xbus::plan(&Request { baud: Some(921_600), ..request }).expect("offered");
    for (name, frame, _) in vectors("xsens-xbus-cmd") {
        let written = match name.rsplit('/').next().expect("a name") {
            "goto_config" => bytes(&plain)[0].clone(),
            "goto_config_ack" => {
                assert_eq!(judge(&plain, 0, &frame), Answer::Done);
                assert_eq!(decode("xbus", &frame, 1).1.packets, 1);
                continue;
            }
            "goto_measurement" => bytes(&plain)[2].clone(),
            "req_did" => xbus::command(0x00, &[]),
            "set_baud_921600" => bytes(&faster)[2].clone(),
            "req_baud" => xbus::command(0x18, &[]),
            "set_output_config_imu_400hz" => bytes(&plain)[1].clone(),
            other => panic!("nothing is said of {other}"),
        };
        assert_eq!(written, frame, "{name}");
    }
    // The size of a sample is that of the vendor's example without its status word.
    let (.., counters) = decode("xbus", &vector("xsens-xbus/doc"), 64);
    assert_eq!(counters.packets, 1);
    assert_eq!(plain.bytes_per_sample, (vector("xsens-xbus/doc").len() - 7) as f64);
}

#[test]
fn mip_commands() {
    let plan = mip::plan(&Request { rate_hz: Some(100.0), baud: None, save: false }).expect("offered");
    for (name, frame, _) in vectors("microstrain-mip-cmd") {
        let written = match name.rsplit('/').next().expect("a name") {
            "ping" => mip::command(0x01, 0x01, &[]),
            "set_idle" => bytes(&plan)[1].clone(),
            "resume" => bytes(&plan)[3].clone(),
            "3dm_message_format_set_0x80_d5_04_05_wit" => bytes(&plan)[2].clone(),
            other => panic!("nothing is said of {other}"),
        };
        assert_eq!(written, frame, "{name}");
    }
    let resumed = vector("microstrain-mip/ack_for_cmd_0x06_resume_error_0");
    assert_eq!(judge(&plan, 3, &resumed), Answer::Done);
    assert_eq!(judge(&plan, 1, &resumed), Answer::NotYet);
    // The size of a sample is that of the captured packet without the increment of its time.
    assert_eq!(plan.bytes_per_sample, (vector("microstrain-mip/capture").len() - 10) as f64);
}
