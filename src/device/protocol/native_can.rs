//! Our own protocol on classic CAN.

use otolith_firmware_protocol::can::{
    CanEvent, CanMessage, CanReceiver, CanSample, DEFAULT_BASE, Ids, NODE_STRIDE, Ranges, offset,
};

use super::native_serial::{at_end_of_range, scaled};
use super::{DecodeCounters, DeviceInfo, DeviceTime, DropCount, ImuReading, PacketDecoder};
use crate::device::Traffic;
use crate::units::{RAD_PER_DEG, STANDARD_GRAVITY};

/// Decodes the CAN protocol of `firmware-protocol`, of one node.
///
/// Without a node number the first node whose DESC makes sense is followed; a bus shared with other devices is
/// normal. Samples are withheld until a DESC has told their scale.
#[derive(Debug, Default)]
pub struct NativeCanDecoder {
    receiver: Option<CanReceiver>,
    ranges: Option<Ranges>,
    info: Option<DeviceInfo>,
    dropped: DropCount,
    withheld: u64,
    /// Bytes of traffic that is no CAN bus's.
    foreign_bytes: u64,
}

impl NativeCanDecoder {
    /// A decoder for `node`, or for the first node that describes itself. A node number whose identifiers do not
    /// fit 11 bits (above 69) finds nothing.
    pub fn new(node: Option<u8>) -> Self {
        let receiver = node.and_then(Ids::of_node).map(CanReceiver::new);
        Self { receiver, ..Self::default() }
    }

    /// Samples that could not be scaled, because they came before a DESC.
    pub fn withheld(&self) -> u64 {
        self.withheld
    }

    fn take_sample(&mut self, sample: &CanSample, on_reading: &mut dyn FnMut(ImuReading)) {
        let Some(ranges) = self.ranges else {
            self.withheld += 1;
            return;
        };
        on_reading(ImuReading {
            // The receiver has undone the wraps of the tick.
            device_time: Some(DeviceTime { micros: sample.time_us, wraps_after_us: None }),
            omega_imu: scaled(sample.gyro, ranges.gyro_scale()),
            specific_force_imu: Some(scaled(sample.accel, ranges.accel_scale())),
            clipped: at_end_of_range(sample.gyro) || at_end_of_range(sample.accel),
        });
    }
}

fn plausible(ranges: &Ranges) -> bool {
    ranges.gyro_range_dps > 0 && ranges.accel_range_g > 0 && ranges.rate_hz > 0
}

/// The identifiers of the node that sent this frame, if it is a DESC with ranges that make sense.
fn described_by(id: u32, data: &[u8]) -> Option<Ids> {
    let distance = u16::try_from(id).ok()?.checked_sub(DEFAULT_BASE)?;
    if distance % NODE_STRIDE != offset::DESC {
        return None;
    }
    match CanMessage::decode(offset::DESC, data) {
        Ok(CanMessage::Ranges(ranges)) if plausible(&ranges) => {
            Ids::at_base(DEFAULT_BASE + distance - offset::DESC)
        }
        _ => None,
    }
}

impl PacketDecoder for NativeCanDecoder {
    fn protocol(&self) -> &'static str {
        super::detect::OTOLITH_CAN
    }

    fn push(&mut self, traffic: Traffic<'_>, on_reading: &mut dyn FnMut(ImuReading)) {
        let (id, data) = match traffic {
            Traffic::CanFrame { id, extended: false, data } => (id, data),
            Traffic::CanFrame { extended: true, .. } => return,
            Traffic::Bytes(bytes) => {
                self.foreign_bytes += bytes.len() as u64;
                return;
            }
        };
        if self.receiver.is_none() {
            self.receiver = described_by(id, data).map(CanReceiver::new);
        }
        // Taken out, so that the receiver's events can change the rest.
        let Some(mut receiver) = self.receiver.take() else { return };
        receiver.push(id, data, |event| match event {
            CanEvent::Sample(sample) => self.take_sample(&sample, on_reading),
            CanEvent::Message(CanMessage::Ranges(ranges)) if plausible(&ranges) => {
                self.ranges = Some(ranges);
                let info = self.info.get_or_insert_default();
                info.gyro_range = Some(f64::from(ranges.gyro_range_dps) * RAD_PER_DEG);
                info.accel_range = Some(f64::from(ranges.accel_range_g) * STANDARD_GRAVITY);
            }
            CanEvent::Message(CanMessage::Identity(identity)) => {
                let info = self.info.get_or_insert_default();
                info.device_id = Some(identity.device_id);
                info.firmware = Some(identity.firmware);
            }
            CanEvent::Message(CanMessage::Health(health)) => self.dropped.take_next(health.dropped),
            CanEvent::DeviceRestarted => self.dropped.restart(),
            CanEvent::Message(_) | CanEvent::Unreadable { .. } => {}
        });
        self.receiver = Some(receiver);
    }

    fn counters(&self) -> DecodeCounters {
        let counted = self.receiver.as_ref().map(CanReceiver::counters).unwrap_or_default();
        DecodeCounters {
            packets: counted.frames,
            // The controller checks every frame: a damaged one never gets here.
            bad_checksum: 0,
            bytes_skipped: self.foreign_bytes,
            missing: counted.lost,
            unknown: counted.unknown + counted.malformed,
            device_dropped: self.dropped.total(),
            withheld: self.withheld,
            lone_halves: counted.lone_halves,
            repeated: counted.repeated,
            ..DecodeCounters::default()
        }
    }

    fn announced_rate_hz(&self) -> Option<f64> {
        self.ranges.map(|ranges| f64::from(ranges.rate_hz))
    }

    fn device(&self) -> Option<&DeviceInfo> {
        self.info.as_ref()
    }
}

#[cfg(test)]
mod tests;
