//! Findings about what a device sends.

use super::{Finding, Level, LinkFacts, PortFacts, SerialFacts};
use crate::device::bandwidth::{BITS_PER_BYTE_8N1, MAX_SERIAL_LOAD, check_serial};
use crate::device::probe::{Heard, Look, MeanSample, Verdict};
use crate::units::{DEG_PER_RAD, RAD_S_PER_RPM, STANDARD_GRAVITY};

/// Samples that show a pattern rather than a chance; a device of 10 Hz gives no more in the time there is.
const ENOUGH_SAMPLES: u64 = 5;
/// Share of packets that may be damaged or missing on a line in order.
const LOSS_SHARE: f64 = 0.01;
/// Share of the announced rate that must arrive; measured over half a second.
const ARRIVING_SHARE: f64 = 0.9;
/// Norms of the mean specific force that are believed, as shares of standard gravity: those that the alignment accepts.
const NORM_SHARES: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Slower than this, deg/s, the mean specific force is gravity.
const NEARLY_STILL_DEG_S: f64 = 30.0;
/// Share of an axis in the norm that makes it the vertical one.
const VERTICAL_SHARE: f64 = 0.9;
/// Bytes, and the share of them with at most one change of bits, that show a slower line.
const ENOUGH_BYTES: u64 = 20;
const SMOOTH_SHARE: f64 = 0.5;

/// Findings about what was heard on the port of `facts`.
pub(super) fn findings(facts: &PortFacts, heard: &Heard) -> Vec<Finding> {
    let serial = match &facts.link {
        LinkFacts::Serial(serial) => Some(serial),
        LinkFacts::Can(_) => None,
    };
    match heard.verdict {
        // A built-in port that nobody has named may have nothing connected.
        Verdict::Silence if serial.is_some_and(|serial| serial.asked_baud.is_none() && !serial.usb) => {
            vec![Finding { level: Level::Note, ..silence(facts, heard, true) }]
        }
        Verdict::Silence => vec![silence(facts, heard, serial.is_some())],
        Verdict::Unknown if serial.is_some() => vec![unknown_bytes(facts, heard)],
        Verdict::Unknown => vec![unknown_frames(facts, heard)],
        Verdict::Text => vec![text(facts, heard)],
        Verdict::Protocol => {
            let line = serial.into_iter().flat_map(|serial| line_findings(facts, serial, heard));
            let sensor = sensor_findings(heard, facts.intended_rate_rpm);
            line.chain(loss_findings(heard)).chain(sensor).collect()
        }
    }
}

fn silence(facts: &PortFacts, heard: &Heard, is_serial: bool) -> Finding {
    let (selector, listened_s) = (&facts.selector, heard.listened_s);
    let mend = match (is_serial, heard.bus_errors) {
        (true, _) => format!(
            "check power and ground, and that its TX is wired to this RX; some devices send only when told to. Then: \
             otolith devices {selector} --listen-s 10"
        ),
        (false, 0) => format!(
            "check power, CAN-H and CAN-L, and two 120 ohm terminators; then: otolith devices {selector} --listen-s 10"
        ),
        (false, errors) => format!(
            "{errors} bus errors came instead: the bitrate is wrong or a terminator is missing; ip -details link shows \
             the bitrate"
        ),
    };
    Finding::mend("silence", format!("not one byte in {listened_s:.1} s"), "nothing can be read", mend)
}

fn unknown_bytes(facts: &PortFacts, heard: &Heard) -> Finding {
    let bauds: Vec<String> = heard.looks.iter().map(|look| look.baud.to_string()).collect();
    let what = format!("{} bytes, but no protocol at {} baud", heard.bytes, bauds.join(", "));
    let smooth = |look: &&Look| {
        look.bytes >= ENOUGH_BYTES && look.smooth_bytes as f64 > SMOOTH_SHARE * look.bytes as f64
    };
    let slower_than = heard.looks.iter().filter(smooth).map(|look| look.baud).min();
    let selector = without_options(facts);
    let mend = match slower_than {
        Some(baud) => format!(
            "its bits are long, as of a line slower than {baud} baud: try the speed its manual names: otolith devices \
             '{selector}?baud=N'"
        ),
        None => format!(
            "try the speed its manual names: otolith devices '{selector}?baud=N'; if that is right, it speaks something \
             otolith does not read"
        ),
    };
    Finding::mend(
        "unknown",
        what,
        "wrong speed, wrong framing (8N1 is read), or a protocol that is not known",
        mend,
    )
}

fn unknown_frames(facts: &PortFacts, heard: &Heard) -> Finding {
    let selector = without_options(facts);
    let mend = match heard.fitting_maps() {
        [] => "record it with `candump -l`; `otolith inspect LOG` lists its identifiers and says what a mapping needs".to_owned(),
        [map] => format!("otolith run --device {selector} --map {map}"),
        [map, others @ ..] => {
            format!("otolith run --device {selector} --map {map} (these fit, too: {})", others.join(", "))
        }
    };
    Finding::mend(
        "unknown",
        format!("{} frames with {} identifiers, but no protocol", heard.frames, heard.ids),
        "no sample can be read from them without a mapping of their signals",
        mend,
    )
}

fn text(facts: &PortFacts, heard: &Heard) -> Finding {
    Finding::note(
        "text",
        format!("text lines with {} numbers", heard.text_columns.unwrap_or_default()),
        "nothing says which number is which, or in which unit",
        format!(
            "otolith run --device '{}' --log-map FILE.toml (examples: configs/logs)",
            with_baud(facts, heard)
        ),
    )
}

/// The selector of a port without its options.
fn without_options(facts: &PortFacts) -> &str {
    facts.selector.split('?').next().unwrap_or_default()
}

/// The selector of a port with the baud rate found.
fn with_baud(facts: &PortFacts, heard: &Heard) -> String {
    let selector = without_options(facts);
    heard.baud.map_or_else(|| selector.to_owned(), |baud| format!("{selector}?baud={baud}"))
}

/// Findings about the speed of a serial line.
fn line_findings(facts: &PortFacts, serial: &SerialFacts, heard: &Heard) -> Vec<Finding> {
    let Some(baud) = heard.baud.filter(|_| !serial.pseudo_terminal) else { return Vec::new() };
    let mut findings = Vec::new();
    if let Some(asked) = serial.asked_baud.filter(|asked| *asked != baud) {
        findings.push(Finding::mend(
            "baud",
            format!("the device speaks at {baud} baud, the selector says {asked}"),
            "at the wrong speed nothing can be read",
            format!("otolith run --device '{}'", with_baud(facts, heard)),
        ));
    }
    let rate_hz = heard.announced_rate_hz.or(heard.rate_hz);
    let too_slow = rate_hz.zip(heard.wire_bytes_per_sample).and_then(|(rate_hz, bytes)| {
        let text = check_serial(baud, rate_hz, bytes).err()?.to_string();
        let (what, hint) = text.split_once("\n\nhint: ")?;
        Some((what.to_owned(), hint.to_owned()))
    });
    let too_full = || {
        let load = heard.bytes_per_s? * BITS_PER_BYTE_8N1 / f64::from(baud);
        let what = format!(
            "{:.0} % of {baud} baud are in use, the limit is {:.0} %",
            load * 100.0,
            MAX_SERIAL_LOAD * 100.0
        );
        let hint = "set the device to a higher baud rate, a lower rate or fewer outputs".to_owned();
        (load > MAX_SERIAL_LOAD).then_some((what, hint))
    };
    if let Some((what, hint)) = too_slow.or_else(too_full) {
        findings.push(Finding::mend("bandwidth", what, "a full line delays samples and loses them", hint));
    }
    findings
}

/// Findings about what is lost on the way.
fn loss_findings(heard: &Heard) -> Vec<Finding> {
    let counters = &heard.counters;
    let share = |count: u64| count as f64 / (counters.packets + count).max(1) as f64;
    let mut findings = Vec::new();
    // Listening begins somewhere within a packet: one looks damaged on the best of lines.
    if share(counters.bad_checksum.saturating_sub(1)) > LOSS_SHARE {
        findings.push(Finding::mend(
            "checksum",
            format!(
                "{} of {} packets are damaged",
                counters.bad_checksum,
                counters.packets + counters.bad_checksum
            ),
            "damaged samples are lost",
            "use a shorter or shielded cable with a ground wire, or a lower baud rate".to_owned(),
        ));
    }
    let lost = counters.missing + counters.device_dropped;
    if share(lost) > LOSS_SHARE {
        findings.push(Finding::mend(
            "loss",
            format!("{lost} packets are missing beside {} good ones", counters.packets),
            "the motion in between is not measured",
            "set the device to a lower rate or a higher baud rate; close programs that load this machine"
                .to_owned(),
        ));
    }
    if let (Some(announced), Some(rate_hz)) = (heard.announced_rate_hz, heard.rate_hz)
        && rate_hz < ARRIVING_SHARE * announced
    {
        findings.push(Finding::mend(
            "rate",
            format!("{rate_hz:.1} samples/s arrive of {announced:.1} announced"),
            "the motion in between is not measured",
            "set the device to a lower rate or a higher baud rate".to_owned(),
        ));
    }
    findings
}

/// Findings about the sensor itself.
fn sensor_findings(heard: &Heard, intended_rate_rpm: Option<f64>) -> Vec<Finding> {
    let Some(sample) = &heard.sample else {
        return vec![Finding::mend(
            "no_samples",
            format!("{} good packets, but no angular velocity in them", heard.counters.packets),
            "the chair's rotation cannot be measured",
            "set the device to send angular velocity and acceleration".to_owned(),
        )];
    };
    let mut findings = range_findings(heard, sample, intended_rate_rpm);
    if sample.samples >= ENOUGH_SAMPLES && sample.without_rotation == sample.samples {
        findings.push(Finding::mend(
            "dead_band",
            format!("the gyro reads exactly 0 in all {} samples", sample.samples),
            "a sensor that zeroes small rates hides slow rotation, and its bias cannot be found",
            "switch its automatic zeroing off in the maker's program (WitMotion: set the 6-axis algorithm)"
                .to_owned(),
        ));
    }
    match sample.specific_force_m_s2 {
        None => findings.push(Finding::mend(
            "accelerometer",
            "no specific force in the samples".to_owned(),
            "tilt cannot be measured, upright rest is put in its place",
            "set the device to send acceleration too, with gravity in it".to_owned(),
        )),
        Some(force) => findings.extend(gravity_finding(sample, force)),
    }
    findings
}

fn range_findings(heard: &Heard, sample: &MeanSample, intended_rate_rpm: Option<f64>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let range = heard.device.as_ref().and_then(|device| device.gyro_range);
    if let (Some(range), Some(rate_rpm)) = (range, intended_rate_rpm)
        && rate_rpm.abs() * RAD_S_PER_RPM > range
    {
        findings.push(Finding::mend(
            "range",
            format!(
                "the gyro measures up to {:.0} deg/s, {rate_rpm} rpm are {:.0} deg/s",
                range * DEG_PER_RAD,
                rate_rpm.abs() * RAD_S_PER_RPM * DEG_PER_RAD
            ),
            "faster rotation is clipped",
            format!(
                "set the device to a wider range, or spin at {:.0} rpm at most",
                (range / RAD_S_PER_RPM).floor()
            ),
        ));
    }
    if sample.clipped > 0 {
        findings.push(Finding::mend(
            "clipping",
            format!("{} of {} samples stand at the end of the range", sample.clipped, sample.samples),
            "the true value is beyond it",
            "set the device to a wider range, or keep it still and run `otolith doctor` again".to_owned(),
        ));
    }
    findings
}

/// What the mean specific force says about unit and direction, while the sensor is nearly still.
fn gravity_finding(sample: &MeanSample, force: [f64; 3]) -> Option<Finding> {
    let norm = |vector: [f64; 3]| libm::sqrt(vector.iter().map(|value| value * value).sum());
    let found: f64 = norm(force);
    if norm(sample.gyro_deg_s) > NEARLY_STILL_DEG_S {
        return None;
    }
    if !NORM_SHARES.contains(&(found / STANDARD_GRAVITY)) {
        let mend = if NORM_SHARES.contains(&found) {
            "it looks like g: the unit is set wrong"
        } else if found < 0.2 * STANDARD_GRAVITY {
            "it looks like acceleration without gravity: set the device to send it with gravity"
        } else {
            "keep the sensor still and try again; if it stays, check the unit, the range and the calibration"
        };
        return Some(Finding::mend(
            "gravity",
            format!("the specific force at rest is {found:.2} m/s2, expected {STANDARD_GRAVITY:.2}"),
            "tilt and translation come out wrong",
            mend.to_owned(),
        ));
    }
    let (axis, value) =
        ["x", "y", "z"].into_iter().zip(force).find(|(_, value)| value.abs() >= VERTICAL_SHARE * found)?;
    (value < 0.0).then(|| {
        Finding::note(
            "gravity_sign",
            format!("-{axis} points up: {value:.2} m/s2 along {axis}"),
            "right if the sensor is mounted that way up; otherwise it reports gravity, which is minus specific force",
            format!("say in a mount file that -{axis} is up (configs/mounts), or turn the sensor over"),
        )
    })
}
