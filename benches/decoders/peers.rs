//! Decoders by others, each with what our own decoder does with the same bytes: find the samples, look at every number.

use std::hint::black_box;

use mavlink::dialects::common::MavMessage;
use mavlink::error::MessageReadError;
use mavlink::{MavlinkReader, Message};
use xsens_mti::prelude::{
    Acceleration, DataType, Decoder, MTData2, MessageDecode, PacketCounter, RateOfTurn, SampleTimeFine,
    StatusWord,
};

/// Samples that the crate `xsens-mti` finds; it reads byte by byte.
pub(crate) fn xsens_mti(bytes: &[u8]) -> u64 {
    let Ok(mut decoder) = Decoder::new([0; 2100]) else { return 0 };
    let mut samples = 0;
    for byte in bytes {
        let Ok(Some(frame)) = decoder.decode(*byte) else { continue };
        let Ok(packets) = MTData2::decode(&frame) else { continue };
        let (mut omega, mut force) = (None, None);
        for packet in packets.into_iter().flatten() {
            let data = packet.payload();
            match packet.data_id().data_type() {
                DataType::PacketCounter => drop(black_box(PacketCounter::from_be_slice(data))),
                DataType::SampleTimeFine => drop(black_box(SampleTimeFine::from_be_slice(data))),
                DataType::StatusWord => drop(black_box(StatusWord::from_be_slice(data))),
                DataType::RateOfTurn => omega = RateOfTurn::<f32>::from_be_slice(data).ok(),
                DataType::Acceleration => force = Acceleration::<f32>::from_be_slice(data).ok(),
                _ => {}
            }
        }
        samples += u64::from(black_box(omega).is_some() && black_box(force).is_some());
    }
    samples
}

/// Messages with IMU data that the crate `mavlink` finds. It makes a value of every other message too, ours only frames
/// it: so the two do the same work on a stream of IMU messages alone.
pub(crate) fn mavlink(bytes: &[u8]) -> u64 {
    const IMU: [&str; 5] = ["RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "HIGHRES_IMU"];
    let (mut reader, mut samples) = (MavlinkReader::new(bytes), 0);
    loop {
        match reader.read_any_message::<MavMessage>() {
            Ok((_, message)) => samples += u64::from(IMU.contains(&black_box(message).message_name())),
            Err(MessageReadError::Parse(_)) => {}
            Err(_) => return samples,
        }
    }
}

/// Rows of a table without a header in which the crate `csv` finds the first seven numbers.
pub(crate) fn csv(bytes: &[u8]) -> u64 {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(bytes);
    let (mut row, mut rows) = (csv::ByteRecord::new(), 0);
    while reader.read_byte_record(&mut row).unwrap_or(false) {
        let number = |field: &[u8]| std::str::from_utf8(field).ok()?.parse::<f64>().ok();
        let numbers: Option<Vec<f64>> = row.iter().take(7).map(number).collect();
        rows += u64::from(black_box(numbers).is_some());
    }
    rows
}

/// Frames whose signals the crate `dbc-rs` decodes. It joins none of them to samples and follows no counter.
pub(crate) fn dbc_rs(dbc: &dbc_rs::Dbc, frames: &[(u32, Vec<u8>)]) -> u64 {
    let decoded = |(id, data): &(u32, Vec<u8>)| black_box(dbc.decode(*id, data, false)).is_ok();
    frames.iter().filter(|frame| decoded(frame)).count() as u64
}
