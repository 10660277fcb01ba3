//! Byte layouts of the messages. The texts in `msg/` are their tables, and the schemas in the file.

use nalgebra::{Vector2, Vector3};

use super::cdr::{CdrReader, CdrWriter, DecodeError};
use crate::device::Traffic;
use crate::imu::{HeadSample, LinkHealth};
use crate::tick::{CharacterOutput, PlatformMotion, Posture, TickInput, TickOutput};
use crate::time::Tick;
use crate::vestibular::{HeadMotion, Perception};

/// Version of the layouts of traffic, tick input and tick output.
pub(super) const LAYOUT: u8 = 2;

const KIND_BYTES: u8 = 0;
const KIND_CAN_STANDARD: u8 = 1;
const KIND_CAN_EXTENDED: u8 = 2;

/// Takes the fields of a tick one by one, in the order of the layout, under the names of the schema.
pub(super) trait FieldSink {
    fn u8(&mut self, name: &'static str, value: u8);
    fn u64(&mut self, name: &'static str, value: u64);
    fn f64(&mut self, name: &'static str, value: f64);
    /// The fields up to the matching [`FieldSink::leave`] are parts of `name`.
    fn enter(&mut self, _name: &'static str) {}
    fn leave(&mut self) {}

    fn vector(&mut self, name: &'static str, value: &Vector3<f64>) {
        self.enter(name);
        self.f64("x", value.x);
        self.f64("y", value.y);
        self.f64("z", value.z);
        self.leave();
    }
}

impl FieldSink for CdrWriter<'_> {
    fn u8(&mut self, _name: &'static str, value: u8) {
        self.u8(value);
    }

    fn u64(&mut self, _name: &'static str, value: u64) {
        self.u64(value);
    }

    fn f64(&mut self, _name: &'static str, value: f64) {
        self.f64(value);
    }
}

/// Writes a tick input into `bytes`.
pub(super) fn encode_input(bytes: &mut Vec<u8>, input: &TickInput) {
    input_fields(input, &mut CdrWriter::start(bytes));
}

/// Writes a tick output into `bytes`.
pub(super) fn encode_output(bytes: &mut Vec<u8>, output: &TickOutput) {
    output_fields(output, &mut CdrWriter::start(bytes));
}

/// Hands over the fields of a tick input.
pub(super) fn input_fields(input: &TickInput, sink: &mut impl FieldSink) {
    let absent = HeadMotion { omega_head: Vector3::zeros(), gif_head: Vector3::zeros() };
    let chair = input.chair.unwrap_or(absent);
    sink.u8("layout", LAYOUT);
    sink.u8("link", link_code(input.link));
    sink.u8("respawn", u8::from(input.respawn));
    sink.u8("chair_present", u8::from(input.chair.is_some()));
    sink.u64("tick", input.tick.0);
    sink.enter("chair");
    sink.vector("omega_head", &chair.omega_head);
    sink.vector("gif_head", &chair.gif_head);
    sink.leave();
}

/// Hands over the fields of a tick output.
pub(super) fn output_fields(output: &TickOutput, sink: &mut impl FieldSink) {
    sink.u8("layout", LAYOUT);
    sink.u64("tick", output.tick.0);
    sink.enter("platform");
    sink.f64("angle", output.platform.angle);
    sink.f64("rate", output.platform.rate);
    sink.f64("acceleration", output.platform.acceleration);
    sink.leave();
    for (name, character) in [("green", &output.green), ("blue", &output.blue)] {
        sink.enter(name);
        character_fields(character, sink);
        sink.leave();
    }
}

fn character_fields(character: &CharacterOutput, sink: &mut impl FieldSink) {
    let cop = character.cop_platform.unwrap_or_default();
    sink.enter("perception");
    sink.vector("gravity_head", &character.perception.gravity_head);
    sink.vector("omega_head", &character.perception.omega_head);
    sink.vector("accel_head", &character.perception.accel_head);
    sink.leave();
    sink.vector("gravity_platform", &character.gravity_platform);
    sink.f64("gravity_tilt", character.gravity_tilt);
    sink.vector("com_platform", &character.com_platform);
    sink.f64("com_sway", character.com_sway);
    sink.f64("cop_platform_x", cop.x);
    sink.f64("cop_platform_y", cop.y);
    sink.f64("foot_tilt", character.foot_tilt);
    sink.f64("constraint_residual", character.constraint_residual);
    sink.u64("state_hash", character.state_hash);
    sink.u8("saturated_joints", character.saturated_joints);
    sink.u8("posture", posture_code(character.posture));
    sink.u8("cop_platform_present", u8::from(character.cop_platform.is_some()));
}

/// Reads what [`encode_input`] wrote.
pub(super) fn decode_input(message: &[u8]) -> Result<TickInput, DecodeError> {
    let mut cdr = CdrReader::start(message)?;
    read_layout(&mut cdr)?;
    let link = read_link(&mut cdr)?;
    let respawn = cdr.bool("respawn")?;
    let chair_present = cdr.bool("chair_present")?;
    let tick = Tick(cdr.u64()?);
    let chair = HeadMotion { omega_head: read_vector(&mut cdr)?, gif_head: read_vector(&mut cdr)? };
    cdr.finish()?;
    Ok(TickInput { tick, chair: chair_present.then_some(chair), link, respawn })
}

/// Reads what [`encode_output`] wrote.
pub(super) fn decode_output(message: &[u8]) -> Result<TickOutput, DecodeError> {
    let mut cdr = CdrReader::start(message)?;
    read_layout(&mut cdr)?;
    let tick = Tick(cdr.u64()?);
    let platform = PlatformMotion { angle: cdr.f64()?, rate: cdr.f64()?, acceleration: cdr.f64()? };
    let output =
        TickOutput { tick, platform, green: read_character(&mut cdr)?, blue: read_character(&mut cdr)? };
    cdr.finish()?;
    Ok(output)
}

fn read_character(cdr: &mut CdrReader<'_>) -> Result<CharacterOutput, DecodeError> {
    let perception = Perception {
        gravity_head: read_vector(cdr)?,
        omega_head: read_vector(cdr)?,
        accel_head: read_vector(cdr)?,
    };
    let gravity_platform = read_vector(cdr)?;
    let gravity_tilt = cdr.f64()?;
    let com_platform = read_vector(cdr)?;
    let com_sway = cdr.f64()?;
    let cop = Vector2::new(cdr.f64()?, cdr.f64()?);
    let foot_tilt = cdr.f64()?;
    let constraint_residual = cdr.f64()?;
    let state_hash = cdr.u64()?;
    let saturated_joints = cdr.u8()?;
    let posture = read_posture(cdr)?;
    let cop_platform = cdr.bool("cop_platform_present")?.then_some(cop);
    Ok(CharacterOutput {
        perception,
        gravity_platform,
        gravity_tilt,
        com_platform,
        com_sway,
        cop_platform,
        foot_tilt,
        constraint_residual,
        saturated_joints,
        posture,
        state_hash,
    })
}

/// Writes a piece of traffic into `bytes`.
pub(super) fn encode_traffic(bytes: &mut Vec<u8>, traffic: Traffic<'_>) {
    let (kind, id, data) = match traffic {
        Traffic::Bytes(data) => (KIND_BYTES, 0, data),
        Traffic::CanFrame { id, extended: false, data } => (KIND_CAN_STANDARD, id, data),
        Traffic::CanFrame { id, extended: true, data } => (KIND_CAN_EXTENDED, id, data),
    };
    let mut cdr = CdrWriter::start(bytes);
    cdr.u8(LAYOUT);
    cdr.u8(kind);
    cdr.u32(id);
    cdr.sequence(data);
}

/// Reads what [`encode_traffic`] wrote.
pub(super) fn decode_traffic(message: &[u8]) -> Result<Traffic<'_>, DecodeError> {
    let mut cdr = CdrReader::start(message)?;
    read_layout(&mut cdr)?;
    let kind = cdr.u8()?;
    let id = cdr.u32()?;
    let data = cdr.sequence()?;
    cdr.finish()?;
    match kind {
        KIND_BYTES => Ok(Traffic::Bytes(data)),
        KIND_CAN_STANDARD => Ok(Traffic::CanFrame { id, extended: false, data }),
        KIND_CAN_EXTENDED => Ok(Traffic::CanFrame { id, extended: true, data }),
        value => Err(DecodeError::Code { field: "kind", value }),
    }
}

/// Writes an IMU sample into `bytes` as `sensor_msgs/msg/Imu` in chair axes (after calibration and mount), its stamp
/// counted from the start of the run.
pub(super) fn encode_imu(bytes: &mut Vec<u8>, sample: &HeadSample) {
    const NS_PER_S: u64 = 1_000_000_000;
    let mut cdr = CdrWriter::start(bytes);
    cdr.i32(i32::try_from(sample.at.0 / NS_PER_S).unwrap_or(i32::MAX));
    cdr.u32((sample.at.0 % NS_PER_S) as u32);
    cdr.string("chair");
    // The orientation is not known: ROS marks that by -1 in front of its covariance. The unit quaternion keeps
    // tools alive that normalise without looking.
    const NO_ORIENTATION: [f64; 13] = [0., 0., 0., 1., -1., 0., 0., 0., 0., 0., 0., 0., 0.];
    const UNKNOWN_COVARIANCE: [f64; 9] = [0.; 9];
    NO_ORIENTATION.iter().for_each(|&value| cdr.f64(value));
    for vector in [sample.motion.omega_head, -sample.motion.gif_head] {
        vector.iter().chain(&UNKNOWN_COVARIANCE).for_each(|&value| cdr.f64(value));
    }
}

/// Writes a text into `bytes` as `std_msgs/msg/String`.
pub(super) fn encode_text(bytes: &mut Vec<u8>, text: &str) {
    CdrWriter::start(bytes).string(text);
}

/// Reads what [`encode_text`] wrote.
pub(super) fn decode_text(message: &[u8]) -> Result<&str, DecodeError> {
    let mut cdr = CdrReader::start(message)?;
    let text = cdr.string()?;
    cdr.finish()?;
    Ok(text)
}

fn read_layout(cdr: &mut CdrReader<'_>) -> Result<(), DecodeError> {
    match cdr.u8()? {
        LAYOUT => Ok(()),
        got => Err(DecodeError::Layout { got, expected: LAYOUT }),
    }
}

fn read_vector(cdr: &mut CdrReader<'_>) -> Result<Vector3<f64>, DecodeError> {
    Ok(Vector3::new(cdr.f64()?, cdr.f64()?, cdr.f64()?))
}

fn link_code(link: LinkHealth) -> u8 {
    match link {
        LinkHealth::Waiting => 0,
        LinkHealth::Live => 1,
        LinkHealth::Stale => 2,
        LinkHealth::Lost => 3,
    }
}

fn read_link(cdr: &mut CdrReader<'_>) -> Result<LinkHealth, DecodeError> {
    match cdr.u8()? {
        0 => Ok(LinkHealth::Waiting),
        1 => Ok(LinkHealth::Live),
        2 => Ok(LinkHealth::Stale),
        3 => Ok(LinkHealth::Lost),
        value => Err(DecodeError::Code { field: "link", value }),
    }
}

fn posture_code(posture: Posture) -> u8 {
    match posture {
        Posture::Standing => 0,
        Posture::Fallen => 1,
    }
}

fn read_posture(cdr: &mut CdrReader<'_>) -> Result<Posture, DecodeError> {
    match cdr.u8()? {
        0 => Ok(Posture::Standing),
        1 => Ok(Posture::Fallen),
        value => Err(DecodeError::Code { field: "posture", value }),
    }
}
