//! MAVLink 2.

use super::checksum::crc_8408;
use super::{Content, Counting, Packet, Sample, Stream, captured, known};

/// Bytes before the payload.
const HEADER: usize = 10;
const RAW_IMU: [u8; 3] = [27, 0, 0];
const RAW_IMU_EXTRA: u8 = 144;

pub(super) fn streams() -> Option<Stream> {
    let foreign = captured("mavlink/ardusub_small.tlog", cut)?;
    let encode = |samples: &[Sample], foreign: &[Vec<u8>]| {
        let packet = |(k, sample): (usize, &Sample)| {
            let mut bytes = foreign[k % foreign.len()].clone();
            bytes[4] = k as u8;
            bytes[HEADER..HEADER + 8].copy_from_slice(&sample.device_us.to_le_bytes());
            if sample.content == Content::Saturated {
                bytes[HEADER + 14..HEADER + 16].copy_from_slice(&i16::MAX.to_le_bytes());
            }
            let end = bytes.len() - 2;
            let crc = crc_8408(bytes[1..end].iter().copied().chain([RAW_IMU_EXTRA]));
            bytes[end..].copy_from_slice(&crc.to_le_bytes());
            Packet::whole(sample, bytes)
        };
        samples.iter().enumerate().map(packet).collect()
    };
    let origin = "RAW_IMU of a real telemetry log, time and sequence number set anew";
    Some(Stream {
        counting: Counting::Sequence8,
        not_a_number: Err("integers only"),
        foreign,
        ..Stream::new("mavlink", origin, || known("mavlink"), encode)
    })
}

/// The RAW_IMU frames of a telemetry log: each frame has a stamp of 8 bytes before it.
fn cut(log: &[u8]) -> Vec<Vec<u8>> {
    let (mut frames, mut at) = (Vec::new(), 8);
    while let (Some(0xFD), Some(&length)) = (log.get(at), log.get(at + 1)) {
        let end = at + HEADER + usize::from(length) + 2;
        let Some(frame) = log.get(at..end) else { break };
        // Zeros at the end are cut off; these are long enough for their angular rate, and unsigned.
        if frame[7..10] == RAW_IMU && length >= 20 && frame[2] == 0 {
            frames.push(frame.to_vec());
        }
        at = end + 8;
    }
    frames
}
