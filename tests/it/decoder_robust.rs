//! What every decoder of bytes owes its user: no bytes do harm, cuts make no difference, damage costs what it hits.

use otolith::device::Traffic;
use otolith::device::protocol::bno08x_rvc::Bno08xRvcDecoder;
use otolith::device::protocol::detect::{Bus, PROTOCOLS, decoder_by_name};
use otolith::device::protocol::openimu::OpenImuDecoder;
use otolith::device::protocol::witmotion::serial::WitMotionDecoder;
use otolith::device::protocol::{DecodeCounters, ImuReading, PacketDecoder};
use proptest::prelude::*;

fn decode(decoder: &mut dyn PacketDecoder, pieces: &[&[u8]]) -> (Vec<ImuReading>, DecodeCounters) {
    let mut readings = Vec::new();
    for piece in pieces {
        decoder.push(Traffic::Bytes(piece), &mut |reading| readings.push(reading));
    }
    decoder.finish(&mut |reading| readings.push(reading));
    (readings, decoder.counters())
}

fn byte_sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// The accelerometer's x reads `k` counts in sample `k`, so that samples can be told apart.
mod encode {
    use super::byte_sum;

    pub(super) fn witmotion(k: u16) -> Vec<u8> {
        let packet = |kind: u8, body: [u8; 8]| {
            let mut packet = [&[0x55, kind][..], &body].concat();
            packet.push(byte_sum(&packet));
            packet
        };
        let [low, high] = k.to_le_bytes();
        let [ms_low, ms_high] = (k % 200 * 5).to_le_bytes();
        let time = packet(0x50, [26, 11, 22, 10, 0, (k / 200) as u8, ms_low, ms_high]);
        let accelerometer = packet(0x51, [low, high, 3, 0, 0, 8, 1, 2]);
        [time, accelerometer, packet(0x52, [5, 0, low, 0, 0x55, 0x51, 1, 2])].concat()
    }

    pub(super) fn openimu(k: u16) -> Vec<u8> {
        let mut packet = b"\x55\x55z1\x28".to_vec();
        packet.extend((1_000_000 + 10_000 * u32::from(k)).to_le_bytes());
        for value in [f32::from(k), 0.0, 9.8, 0.0, 0.0, 60.0, 0.3, 0.3, 0.3] {
            packet.extend(value.to_le_bytes());
        }
        let crc = packet[2..].iter().fold(0x1D0F_u16, |crc, byte| {
            (0..8)
                .fold(crc ^ u16::from(*byte) << 8, |crc, _| crc << 1 ^ if crc >= 0x8000 { 0x1021 } else { 0 })
        });
        packet.extend(crc.to_be_bytes());
        packet
    }

    pub(super) fn bno08x(k: u16) -> Vec<u8> {
        let [low, high] = k.to_le_bytes();
        let mut packet = vec![0xAA, 0xAA, low, low, 0, 0, 0, 0, 0, low, high, 0, 0, 0xE8, 3, 0, 0, 0];
        packet.push(byte_sum(&packet[2..]));
        packet
    }
}

/// Which sample a reading is, by its accelerometer; `counts_per_unit` undoes the scale.
fn number_of(reading: &ImuReading, counts_per_unit: f64) -> i64 {
    (reading.specific_force_imu.unwrap().x * counts_per_unit).round() as i64
}

struct Device {
    make: fn() -> Box<dyn PacketDecoder>,
    encode: fn(u16) -> Vec<u8>,
    counts_per_unit: f64,
}

/// Samples that one damaged byte may take along: it may stand between two.
const COST: usize = 2;

const DEVICES: [Device; 3] = [
    Device {
        make: || Box::new(WitMotionDecoder::new()),
        encode: encode::witmotion,
        counts_per_unit: 32768.0 / (16.0 * 9.80665),
    },
    Device { make: || Box::new(OpenImuDecoder::new()), encode: encode::openimu, counts_per_unit: 1.0 },
    Device {
        make: || Box::new(Bno08xRvcDecoder::new(true)),
        encode: encode::bno08x,
        counts_per_unit: 1000.0 / 9.80665,
    },
];

#[derive(Clone, Copy, Debug)]
enum Damage {
    Flip(u8),
    Insert(u8),
    Delete,
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![(0_u8..8).prop_map(Damage::Flip), any::<u8>().prop_map(Damage::Insert), Just(Damage::Delete)]
}

proptest! {
    #[test]
    fn no_bytes_do_harm_and_cuts_make_no_difference(
        bytes in prop::collection::vec(
            prop_oneof![
                4 => prop::sample::select(vec![0x55_u8, 0x50, 0x51, 0x52, 0xAA, b'z', b'1', b'S', 40, 24, 0]),
                1 => any::<u8>(),
            ],
            0..400,
        ),
        cut in 1_usize..60,
    ) {
        for protocol in PROTOCOLS.iter().filter(|protocol| protocol.bus == Bus::Serial) {
            let Ok(mut whole) = decoder_by_name(protocol.name) else { continue };
            let mut cut_up = decoder_by_name(protocol.name).unwrap();
            let pieces: Vec<&[u8]> = bytes.chunks(cut).collect();
            let (found, counters) = decode(&mut whole, &[&bytes]);
            prop_assert_eq!(decode(&mut cut_up, &pieces), (found, counters), "{}", protocol.name);
        }
    }

    #[test]
    fn good_streams_may_be_cut_anywhere(cut in 1_usize..100) {
        for device in &DEVICES {
            let stream: Vec<u8> = (1..60).flat_map(device.encode).collect();
            let (readings, counters) = decode(&mut (device.make)(), &stream.chunks(cut).collect::<Vec<_>>());
            let numbers: Vec<i64> = readings.iter().map(|r| number_of(r, device.counts_per_unit)).collect();
            // A rate needs two angles: the first of those is none.
            let first = 60 - numbers.len() as i64;
            prop_assert!(first <= 2);
            prop_assert_eq!(numbers, (first..60).collect::<Vec<_>>());
            let losses = (counters.bad_checksum, counters.bytes_skipped, counters.missing, counters.lone_halves);
            prop_assert_eq!(losses, (0, 0, 0, 0));
        }
    }

    #[test]
    fn damage_costs_what_it_hits(at in 0.2_f64..0.8, damage in damage(), cut in 1_usize..100) {
        for device in &DEVICES {
            let mut stream: Vec<u8> = (1..60).flat_map(device.encode).collect();
            let (all, _) = decode(&mut (device.make)(), &[&stream]);
            let at = (at * stream.len() as f64) as usize;
            match damage {
                Damage::Flip(bit) => stream[at] ^= 1 << bit,
                Damage::Insert(byte) => stream.insert(at, byte),
                Damage::Delete => drop(stream.remove(at)),
            }
            let (readings, _) = decode(&mut (device.make)(), &stream.chunks(cut).collect::<Vec<_>>());
            let number = |reading: &ImuReading| number_of(reading, device.counts_per_unit);
            let found: Vec<i64> = readings.iter().map(number).collect();
            let lost = all.iter().map(number).filter(|k| !found.contains(k)).count();
            prop_assert!(lost <= COST, "{} lost by {:?} at {}", lost, damage, at);
        }
    }
}
