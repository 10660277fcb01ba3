//! The CAN receiver against a simulated device: wraps, losses, silence, restarts, any traffic.

use otolith_firmware_protocol::can::{
    CanCounters, CanEvent, CanMessage, CanReceiver, CanSample, HalfSample, Health, Identity, Ids, Ranges,
    Time,
};
use otolith_firmware_protocol::message::{Ack, Cmd};
use proptest::collection::vec;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn can_messages_survive(which in 0..8u8, a: u64, token: u8) {
        let half = HalfSample { xyz: [a as i16, (a >> 16) as i16, (a >> 32) as i16], tick: (a >> 48) as u16 };
        let [low, middle, high] = [a as u16, (a >> 16) as u16, (a >> 32) as u16];
        let message = match which {
            0 => CanMessage::Gyro(half),
            1 => CanMessage::Accel(half),
            2 => CanMessage::Time(Time { time_10us: a as u32, frames_sent: high, status: u16::from(token) }),
            3 => CanMessage::Health(Health {
                temperature_centi_c: low as i16, dropped: middle, tx_overrun: high, self_test: token,
            }),
            4 => CanMessage::Ranges(Ranges { gyro_range_dps: low, accel_range_g: middle, rate_hz: high }),
            5 => CanMessage::Identity(Identity { device_id: a as u32, firmware: high }),
            6 => CanMessage::Cmd(Cmd { code: high as u8, arg: a as u32, token }),
            _ => CanMessage::Ack(Ack { code: high as u8, result: (a >> 40) as u8, value: a as u32, token }),
        };
        prop_assert_eq!(CanMessage::decode(message.offset(), &message.encode()), Ok(message));
    }

    #[test]
    fn any_bus_traffic_is_accounted_for(frames in vec((0x39E..0x3AAu32, vec(any::<u8>(), 0..=8)), 0..200)) {
        let mut receiver = CanReceiver::new(Ids::default());
        let mut samples = 0;
        for (id, data) in &frames {
            receiver.push(*id, data, |event| samples += u64::from(matches!(event, CanEvent::Sample(_))));
        }
        let CanCounters { frames: good, unknown, malformed, foreign, .. } = receiver.counters();
        prop_assert_eq!(good + unknown + malformed + foreign, frames.len() as u64);
        prop_assert_eq!(receiver.counters().samples, samples);
    }
}

/// A device on the bus that can lose frames, fall silent and start again.
struct Bus {
    receiver: CanReceiver,
    samples: Vec<CanSample>,
    restarts: u64,
    frames_sent: u16,
}

impl Bus {
    fn new() -> Self {
        Self { receiver: CanReceiver::new(Ids::default()), samples: Vec::new(), restarts: 0, frames_sent: 0 }
    }

    fn send(&mut self, message: CanMessage, arrives: bool) {
        if message.offset() <= 1 {
            self.frames_sent = self.frames_sent.wrapping_add(1);
        }
        let (id, data) = Ids::default().frame(&message);
        if arrives {
            self.receiver.push(u32::from(id), &data, |event| match event {
                CanEvent::Sample(sample) => self.samples.push(sample),
                CanEvent::DeviceRestarted => self.restarts += 1,
                CanEvent::Message(_) => {}
                CanEvent::Unreadable { error, .. } => panic!("{error}"),
            });
        }
    }

    fn sample(&mut self, time_10us: u64, gyro_arrives: bool, accel_arrives: bool) {
        let half = HalfSample { xyz: [1, 2, 3], tick: time_10us as u16 };
        self.send(CanMessage::Gyro(half), gyro_arrives);
        self.send(CanMessage::Accel(half), accel_arrives);
    }

    fn time(&mut self, time_10us: u64) {
        let time = Time { time_10us: time_10us as u32, frames_sent: self.frames_sent, status: 0 };
        self.send(CanMessage::Time(time), true);
    }
}

#[test]
fn can_time_runs_through_every_wrap() {
    let mut bus = Bus::new();
    let start = (1u64 << 32) - 150_000;
    bus.time(start);
    for sample in 1..=3000u64 {
        bus.sample(start + 100 * sample, true, true);
        if sample % 100 == 0 {
            bus.time(start + 100 * sample + 3);
        }
    }
    assert_eq!(bus.samples.len(), 3000);
    for (sample, count) in bus.samples.iter().zip(1..) {
        assert_eq!(sample.time_us, 10 * (start + 100 * count));
    }
    let counters = bus.receiver.counters();
    assert_eq!((counters.lost, counters.lone_halves, bus.restarts), (0, 0, 0));
}

#[test]
fn can_loss_is_counted_end_to_end() {
    let mut bus = Bus::new();
    bus.frames_sent = 65_500; // wraps on the way
    bus.time(0);
    for sample in 1..=101u64 {
        // 10 GYRO and 5 ACCEL lost, and two whole samples.
        let whole = sample == 33 || sample == 34;
        bus.sample(100 * sample, sample % 10 != 0 && !whole, sample % 20 != 5 && !whole);
    }
    assert_eq!(bus.receiver.counters().lost, 0, "known only once TIME tells");
    bus.time(10_101);
    let counters = bus.receiver.counters();
    assert_eq!((counters.lost, counters.lone_halves, counters.samples), (19, 15, 84));
    bus.time(20_101);
    assert_eq!(bus.receiver.counters().lost, 19);
}

#[test]
fn can_silence_is_bridged_by_time() {
    let mut bus = Bus::new();
    bus.time(1_000);
    bus.sample(1_100, true, true);
    // Two seconds without a frame, then TIME.
    bus.time(201_100);
    bus.sample(201_200, true, true);
    assert_eq!(bus.samples[1].time_us - bus.samples[0].time_us, 2_001_000);
    assert_eq!(bus.restarts, 0);
}

#[test]
fn can_restart_is_told_and_is_no_loss() {
    let mut bus = Bus::new();
    bus.time(5_000_000);
    bus.sample(5_000_100, true, true);
    bus.time(5_010_000);
    bus.frames_sent = 0;
    bus.sample(50, true, true);
    bus.time(100);
    bus.sample(150, true, true);
    bus.time(10_100);
    assert_eq!((bus.restarts, bus.receiver.counters().restarts), (1, 1));
    assert_eq!(bus.samples.last().map(|sample| sample.time_us), Some(1500));
    assert_eq!(bus.receiver.counters().lost, 0);
}

#[test]
fn can_halves_pair_in_either_order() {
    let mut receiver = CanReceiver::new(Ids::of_node(2).unwrap());
    let ids = Ids::of_node(2).unwrap();
    let half = |x, tick| HalfSample { xyz: [x, 0, 0], tick };
    let mut samples = Vec::new();
    for message in
        [CanMessage::Accel(half(2, 9)), CanMessage::Gyro(half(1, 9)), CanMessage::Gyro(half(1, 10))]
    {
        let (id, data) = ids.frame(&message);
        receiver.push(u32::from(id), &data, |event| samples.push(event));
        // The same message of another node is nobody's business here.
        receiver.push(u32::from(id) - 0x10, &data, |event| panic!("{event:?}"));
    }
    let expected = CanSample { time_us: 90, gyro: [1, 0, 0], accel: [2, 0, 0] };
    assert_eq!(samples, [CanEvent::Sample(expected)]);
    assert_eq!(receiver.counters().foreign, 3);
}

#[test]
fn can_identifiers_stay_within_11_bits() {
    assert_eq!(Ids::of_node(0), Some(Ids::default()));
    assert_eq!(Ids::of_node(69).map(Ids::base), Some(0x7F0));
    assert_eq!(Ids::of_node(70), None);
    assert_eq!(Ids::at_base(0x7F9).map(Ids::base), Some(0x7F9));
    assert_eq!(Ids::at_base(0x7FA), None);
    assert_eq!(Ids::at_base(u16::MAX), None);
}
