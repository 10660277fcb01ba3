use super::*;
use crate::device::mock::{MockChair, MockParams};
use crate::device::protocol::native_serial::NativeSerialDecoder;
use crate::device::protocol::{DecodeCounters, PacketDecoder};
use crate::device::replay::CandumpReplay;
use crate::device::testing::{Event, ScriptLink, drain};

fn injector(plan: FaultPlan) -> FaultInjector<ScriptLink> {
    FaultInjector::new(ScriptLink::pieces(1000), plan).expect("in range")
}

fn ms(ms: u64) -> HostTime {
    HostTime(ms * 1_000_000)
}

#[test]
fn no_fault_changes_nothing() {
    assert_eq!(drain(&mut injector(FaultPlan::default())), drain(&mut ScriptLink::pieces(1000)));
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    let plan = |seed| FaultPlan {
        seed,
        drop: 0.1,
        bit_flip_per_byte: 0.01,
        duplicate: 0.1,
        delay: 0.1,
        delay_s: 0.01,
        disconnect: 0.001,
        disconnect_s: 0.05,
        ..FaultPlan::default()
    };
    assert_eq!(drain(&mut injector(plan(1))), drain(&mut injector(plan(1))));
    assert_ne!(drain(&mut injector(plan(1))), drain(&mut injector(plan(2))));
}

#[test]
fn certain_faults_are_certain() {
    let count = |plan| drain(&mut injector(plan)).len();
    assert_eq!(count(FaultPlan { drop: 1.0, ..FaultPlan::default() }), 0);
    assert_eq!(count(FaultPlan { disconnect: 1.0, disconnect_s: 1.0, ..FaultPlan::default() }), 0);
    assert_eq!(count(FaultPlan { duplicate: 1.0, ..FaultPlan::default() }), 2000);
    for (_, piece) in drain(&mut injector(FaultPlan { bit_flip_per_byte: 1.0, ..FaultPlan::default() })) {
        assert!(piece.windows(2).any(|pair| pair[0] != pair[1]) || piece[0] != 0, "bits are flipped");
    }
}

#[test]
fn a_frame_of_a_bus_with_a_flipped_bit_never_arrives() {
    let log = "(1.000000) can0 3A0#0011223344556677\n(1.001000) can0 3A1#\n";
    let plan = FaultPlan { bit_flip_per_byte: 1.0, ..FaultPlan::default() };
    let link = CandumpReplay::new("log".into(), log.as_bytes());
    let mut link = FaultInjector::new(link, plan).expect("in range");
    assert!(link.receive(Duration::ZERO).expect("plays").is_none());
    // Nothing to flip in a frame without data.
    let frame = Traffic::CanFrame { id: 0x3A1, extended: false, data: &[] };
    assert_eq!(link.receive(Duration::ZERO).expect("plays"), Some((ms(1), frame)));
}

#[test]
fn a_stall_holds_traffic_back_and_lets_it_out_at_once() {
    let stalls = vec![FaultSpan { at_s: 0.1, length_s: 0.05 }];
    let pieces = drain(&mut injector(FaultPlan { stalls, ..FaultPlan::default() }));
    assert_eq!(pieces.len(), 1000);
    assert_eq!(
        (pieces[99].0, pieces[100].0, pieces[149].0, pieces[151].0),
        (ms(99), ms(150), ms(150), ms(151))
    );
}

#[test]
fn delays_never_reorder() {
    let pieces = drain(&mut injector(FaultPlan { delay: 0.3, delay_s: 0.02, ..FaultPlan::default() }));
    assert!(pieces.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    let late = pieces.iter().enumerate().filter(|(i, (at, _))| *at > ms(*i as u64)).count();
    assert!(late > 300, "{late} of 1000 late");
}

#[test]
fn a_disconnect_is_silence_with_a_state() {
    let disconnects = vec![FaultSpan { at_s: 0.2, length_s: 0.1 }];
    let mut link = injector(FaultPlan { disconnects, ..FaultPlan::default() });
    let mut down_calls = 0;
    while let Ok(piece) = link.receive(Duration::ZERO) {
        let got_nothing = piece.is_none();
        assert_eq!(link.status().down, got_nothing);
        down_calls += usize::from(got_nothing);
    }
    assert_eq!(down_calls, 100);
    let status = link.status();
    assert_eq!(
        (status.losses, status.reconnects, status.last_loss),
        (1, 1, Some(io::ErrorKind::NotConnected))
    );
}

#[test]
fn a_wrong_baud_misreads_bytes_and_leaves_frames_alone() {
    let wrong_baud = Some(WrongBaud { sent_baud: 9600, read_baud: 19_200, keep_framing_errors: true });
    let plan = || FaultPlan { wrong_baud, ..FaultPlan::default() };
    let pieces = [0xFF, 0x00].map(|byte| Event::Piece(ms(1), vec![byte]));
    let mut link = FaultInjector::new(ScriptLink::new(pieces), plan()).expect("in range");
    assert_eq!(drain(&mut link), [(ms(1), vec![0xFE]), (ms(1), vec![0x00])]);

    let log = CandumpReplay::new("log".into(), "(1.000000) can0 3A0#FF\n".as_bytes());
    let mut link = FaultInjector::new(log, plan()).expect("in range");
    let frame = Traffic::CanFrame { id: 0x3A0, extended: false, data: &[0xFF] };
    assert_eq!(link.receive(Duration::ZERO).expect("plays"), Some((ms(0), frame)));
}

#[test]
fn send_is_forwarded_while_connected() {
    let mut link = injector(FaultPlan::default());
    link.send(Traffic::Bytes(b"hi")).expect("forwarded");
    assert_eq!(link.link.sent, [b"hi".to_vec()]);
}

#[test]
fn values_out_of_range_are_refused() {
    for (plan, what) in [
        (FaultPlan { drop: 1.5, ..FaultPlan::default() }, "drop = 1.5"),
        (FaultPlan { delay_s: -1.0, ..FaultPlan::default() }, "delay_s = -1"),
        (
            FaultPlan { stalls: vec![FaultSpan { at_s: f64::NAN, length_s: 1.0 }], ..FaultPlan::default() },
            "at_s = NaN",
        ),
    ] {
        let text = FaultInjector::new(ScriptLink::pieces(1), plan).expect_err(what).to_string();
        assert!(text.starts_with(what), "{text}");
    }
}

/// Samples that reach the far side of a line with faults, and the decoder's account of the rest.
fn survivors(plan: FaultPlan) -> (u64, DecodeCounters) {
    let params = MockParams { rest_s: 10.0, ..MockParams::rest() };
    let mut link = FaultInjector::new(MockChair::new(params).expect("in range"), plan).expect("in range");
    let mut decoder = NativeSerialDecoder::new();
    let mut samples = 0;
    for (_, bytes) in drain(&mut link) {
        decoder.push(Traffic::Bytes(&bytes), &mut |_| samples += 1);
    }
    (samples, decoder.counters())
}

/// Loss against fault rate over 10 s of a mock: every frame that does not arrive shows in a counter.
#[test]
fn what_is_lost_is_counted() {
    let frames_sent = 11 + 10_001 + 101;
    println!("drop   flip/B   samples packets bad_checksum missing");
    for (drop, bit_flip_per_byte) in
        [(0.0, 0.0), (0.01, 0.0), (0.1, 0.0), (0.0, 1e-4), (0.0, 1e-3), (0.05, 1e-3)]
    {
        let (samples, counters) =
            survivors(FaultPlan { seed: 5, drop, bit_flip_per_byte, ..FaultPlan::default() });
        let DecodeCounters { packets, bad_checksum, missing, .. } = counters;
        println!(
            "{drop:<6} {bit_flip_per_byte:<8} {samples:>7} {packets:>7} {bad_checksum:>12} {missing:>7}"
        );
        // A lost run at either end of the stream leaves no gap between sequence numbers.
        assert!((frames_sent - 20..=frames_sent).contains(&(packets + missing)), "{counters:?}");
        let expected = frames_sent as f64 * (1.0 - drop) * libm::pow(1.0 - bit_flip_per_byte, 34.0);
        assert!(
            (packets as f64 - expected).abs() < 5.0 * (frames_sent as f64 - expected).sqrt() + 1.0,
            "{counters:?}"
        );
        assert_eq!(bad_checksum > 0, bit_flip_per_byte > 0.0);
    }
}
