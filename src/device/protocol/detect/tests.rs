use super::*;
use crate::device::mock::{MockChair, MockParams};
use crate::device::testing::drain;

#[test]
fn every_name_is_known_and_others_are_refused() {
    for protocol in PROTOCOLS.iter().filter(|protocol| protocol.make.is_some()) {
        assert_eq!(decoder_by_name(protocol.name).expect("known").protocol(), protocol.name);
    }
    let text = decoder_by_name("morse").err().expect("unknown").to_string();
    assert!(text.contains("protocol `morse` is not known") && text.contains(&protocol_names()));
    assert!(decoder_by_name(TEXT).err().expect("needs a mapping").to_string().contains("--log-map"));
    let text = decoder_by_name(CAN_MAP).err().expect("needs a mapping").to_string();
    assert!(text.contains("--map NAME") && text.contains("toyota-yaw"), "{text}");
}

#[test]
fn the_serial_protocol_is_found_without_losing_a_sample() {
    let params = MockParams { rest_s: 0.5, ..MockParams::rest() };
    let mut decoder = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    let mut readings = 0;
    assert_eq!(decoder.protocol(), "unknown");
    for (_, bytes) in drain(&mut MockChair::new(params).expect("in range")) {
        decoder.push(Traffic::Bytes(&bytes), &mut |_| readings += 1);
    }
    assert_eq!((decoder.protocol(), readings), (OTOLITH_SERIAL, 501));
    assert_eq!(decoder.counters().bytes_skipped, 0);
    assert_eq!(decoder.announced_rate_hz(), Some(1000.0));
}

#[test]
fn a_short_capture_is_named_at_its_end_if_one_protocol_explains_it() {
    // The document's example of a VectorNav frame, alone and in noise.
    let frame =
        [0xFA, 1, 8, 0, 0x93, 0x50, 0x2E, 0x42, 0x83, 0x3E, 0xF1, 0x3F, 0x48, 0xB5, 4, 0xBB, 0x92, 0x88];
    for (noise, name) in [(0, "vectornav"), (40, "unknown")] {
        let mut decoder = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
        decoder.push(Traffic::Bytes(&[&frame[..], &vec![0x33; noise]].concat()), &mut |_| {});
        assert_eq!(decoder.protocol(), "unknown");
        decoder.finish(&mut |_| {});
        assert_eq!((decoder.protocol(), decoder.counters().packets), (name, 1));
    }
}

fn refusal(selector: &str, name: &str) -> String {
    decoder_for(&selector.parse().expect("a selector"), Some(name)).err().expect("refused").to_string()
}

#[test]
fn a_device_named_by_the_selector_is_followed_and_no_other() {
    let selector: Selector = "can:can0?witmotion_id=0x51".parse().expect("a selector");
    for name in [None, Some(WITMOTION_CAN)] {
        let mut decoder = decoder_for(&selector, name).expect("fits");
        let mut samples = 0;
        for id in [0x50, 0x51] {
            for kind in [0x51, 0x52] {
                let data = &[0x55, kind, 0, 0, 0, 0, 0, 8];
                decoder.push(Traffic::CanFrame { id, extended: false, data }, &mut |_| samples += 1);
            }
        }
        assert_eq!((decoder.protocol(), samples, decoder.counters().packets), (WITMOTION_CAN, 1, 2));
    }
    let text = refusal("can:can0?witmotion_id=80", OTOLITH_CAN);
    assert!(text.contains("speaks witmotion-can, and the protocol is to be otolith-can"), "{text}");
    let text = refusal("slcan:/dev/ttyACM0?node=3", CAN_MAP);
    assert!(text.contains("speaks otolith-can, and the protocol is to be can-map"), "{text}");
}

#[test]
fn a_protocol_of_another_bus_is_refused() {
    let text = refusal("serial:/dev/ttyUSB0", OTOLITH_CAN);
    assert!(text.contains("this is a serial line, and the protocol otolith-can is one of a CAN bus"));
    assert!(refusal("can:can0", XBUS).contains("this is a CAN bus, and the protocol xbus is"));
    assert!(refusal("can:can0", "morse").contains("protocol `morse` is not known"));
    let replay: Selector = "replay:a.bin".parse().expect("a selector");
    assert!(decoder_for(&replay, Some(XBUS)).is_ok() && decoder_for(&replay, Some(OTOLITH_CAN)).is_ok());
}

#[test]
fn frames_that_nobody_follows_are_unknown_packets_and_no_junk() {
    let mut decoder = AutoDecoder::on(&[Bus::Serial, Bus::Can]);
    for id in 0..100 {
        decoder.push(Traffic::CanFrame { id, extended: false, data: &[7; 8] }, &mut |_| panic!("no sample"));
    }
    let expected = DecodeCounters { unknown: 100, ..DecodeCounters::default() };
    assert_eq!((decoder.protocol(), decoder.counters()), ("unknown", expected));
}

#[test]
fn noise_is_nobodys_and_is_counted() {
    let mut decoder = AutoDecoder::on(&[Bus::Serial]);
    for _ in 0..100 {
        decoder.push(Traffic::Bytes(&[0x55; 50]), &mut |_| panic!("no sample in this"));
    }
    assert_eq!(decoder.protocol(), "unknown");
    assert_eq!((decoder.counters().packets, decoder.counters().bytes_skipped > 4000), (0, true));
    assert_eq!(decoder.poll_transmit(5_000_000, &mut [0; 64]), None, "nothing is sent to a stranger");
}
