//! The link alone.

use otolith::device::can::bus::BusState;
use otolith::device::can::{CanDetails, can_details};
use otolith::device::{LinkError, Selector};

use super::*;

const FRAME: Traffic<'static> =
    Traffic::CanFrame { id: 0x3A0, extended: false, data: &[1, 2, 3, 4, 5, 6, 7, 8] };

#[test]
fn frames_of_cansend_arrive() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith0");
    let mut link = interface.open();
    for (text, expected) in [
        ("3A0#0102030405060708", (0x3A0, false, vec![1, 2, 3, 4, 5, 6, 7, 8])),
        ("1ABCDEF0#", (0x1ABC_DEF0, true, vec![])),
        ("00000001#FF", (1, true, vec![0xFF])),
        ("7FF#00", (0x7FF, false, vec![0])),
    ] {
        run(&format!("cansend otolith0 {text}"));
        assert_eq!(next(&mut link), expected);
    }
    // Remote frames and CAN FD are not ours, and no harm.
    run("cansend otolith0 3A0#R8");
    run("cansend otolith0 001#AA");
    assert_eq!(next(&mut link), (1, false, vec![0xAA]));
    assert!(link.receive(Duration::from_millis(5)).expect("up").is_none());
    assert_eq!((link.status().bus_errors, link.status().overflowed), (0, 0));
}

#[test]
fn candump_receives_what_is_sent() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith1");
    let mut candump = Candump::listen("otolith1");
    interface.wait_for_listener();
    let mut link = interface.open();
    link.send(FRAME).expect("sent");
    link.send(Traffic::CanFrame { id: 0x1ABC_DEF0, extended: true, data: &[] }).expect("sent");
    link.send(Traffic::CanFrame { id: 0x800, extended: false, data: &[] }).expect("dropped");
    link.send(Traffic::CanFrame { id: 7, extended: true, data: &[9] }).expect("sent");
    for expected in ["3A0#0102030405060708", "1ABCDEF0#", "00000007#09"] {
        assert_eq!(candump.next(), expected);
    }
    assert_eq!(link.status().unsent, 1);
}

#[test]
fn error_frames_are_counted_as_words_and_bus_off_ends_with_the_next_frame() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith2");
    let mut link = interface.open();
    // Data of a frame tells that the error frames before it were taken in.
    let mut after = |frames: &[&str]| {
        for frame in frames {
            run(&format!("cansend otolith2 {frame}"));
        }
        let states: Vec<BusState> = frames
            .iter()
            .map(|_| {
                assert!(link.receive(POLL * PATIENCE).expect("up").is_none(), "an error frame is no traffic");
                link.status().bus_state
            })
            .collect();
        (states, link.status())
    };
    let (states, status) = after(&["20000204#0008000000006000", "20000204#0020000000008000"]);
    assert_eq!(states, [BusState::ErrorWarning, BusState::ErrorPassive]);
    assert_eq!((status.bus_errors, status.bus_off), (2, 0));
    let (states, status) = after(&["20000040#0000000000000000", "20000020#0000000000000000"]);
    assert_eq!(states, [BusState::BusOff, BusState::BusOff]);
    assert_eq!((status.bus_errors, status.bus_off), (4, 1));
    let words: Vec<String> = status.bus_faults.iter().map(|fault| fault.to_string()).collect();
    assert_eq!(words, ["no acknowledgement"]);
    let (states, _) = after(&["20000100#0000000000000000", "20000040#0000000000000000"]);
    assert_eq!(states, [BusState::ErrorActive, BusState::BusOff]);
    run("cansend otolith2 3A0#11");
    assert_eq!(next(&mut link), (0x3A0, false, vec![0x11]));
    assert_eq!((link.status().bus_state, link.status().bus_off), (BusState::ErrorActive, 2));
}

#[test]
fn an_interface_that_was_down_goes_on_with_the_same_socket() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith3");
    let (mut a, mut b) = (interface.open(), interface.open());
    run("ip link set otolith3 down");
    assert!(b.receive(POLL).expect("down is no loss").is_none());
    assert_eq!((b.status().bus_errors, b.status().bus_state), (1, BusState::InterfaceDown));
    a.send(FRAME).expect("given up quietly");
    assert_eq!(a.status().unsent, 1);
    assert_eq!(CanLink::open("otolith3", clock()).expect("opens while down").status().bus_errors, 0);
    run("ip link set otolith3 up");
    // It says so without a frame.
    wait_until("up", || {
        assert!(b.receive(POLL).expect("up").is_none());
        b.status().bus_state == BusState::ErrorActive
    });
    a.send(FRAME).expect("sent");
    assert_eq!(next(&mut b).0, 0x3A0);
}

#[test]
fn a_deleted_interface_is_lost_and_found_again() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith4");
    let mut raw = interface.open();
    let selector: Selector = "can:otolith4".parse().expect("a selector");
    let mut link = otolith::device::open(&selector, &clock(), None).expect("opens");
    interface.open().send(FRAME).expect("sent");
    run("ip link delete otolith4");
    // What came before is not lost, although the kernel tells first that the interface is gone.
    assert_eq!((next(&mut raw).0, next(&mut link).0), (0x3A0, 0x3A0));
    let error = (0..PATIENCE).find_map(|_| raw.receive(POLL).map(|piece| assert!(piece.is_none())).err());
    assert!(matches!(error, Some(LinkError::Lost { .. })), "{error:?}");
    assert!((0..PATIENCE).any(|_| link.receive(POLL).expect("silence").is_none() && link.status().down));

    let back = Interface::make("otolith4");
    assert!((0..PATIENCE).any(|_| link.receive(POLL).expect("silence").is_none() && !link.status().down));
    back.open().send(FRAME).expect("sent");
    assert_eq!(next(&mut link).0, 0x3A0);
    assert_eq!((link.status().losses, link.status().reconnects), (1, 1));
}

#[test]
fn frames_carry_the_time_they_arrived() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith5");
    let clock = clock();
    let mut link = CanLink::open("otolith5", Arc::clone(&clock)).expect("opens");
    let before = clock.now();
    run("cansend otolith5 3A0#01");
    run("cansend otolith5 3A0#02");
    let sent = clock.now();
    std::thread::sleep(Duration::from_millis(200));
    let mut stamps = Vec::new();
    while let Some((at, _)) = link.receive(POLL).expect("up") {
        stamps.push(at);
    }
    assert_eq!(stamps.len(), 2);
    assert!(
        before < stamps[0] && stamps[0] < stamps[1] && stamps[1] < sent,
        "{before:?} {stamps:?} {sent:?}"
    );
    assert_eq!(link.status().stamps_refused, 0);
    drop(interface);
}

#[test]
fn frames_of_canplayer_keep_order_and_number() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith6");
    let folder = tempfile::tempdir().expect("a folder");
    let text: String =
        (0..100).map(|k| format!("(1700000000.{:06}) can0 {k:03X}#{k:02X}\n", 5000 * k)).collect();
    let log = write_log(folder.path(), "pace.log", &text);
    let mut link = interface.open();
    let mut player =
        command(&format!("canplayer -I {} otolith6=can0", log.display())).spawn().expect("started");
    let mut stamps = Vec::new();
    for _ in 0..PATIENCE {
        if let Some((at, Traffic::CanFrame { id, data, .. })) = link.receive(POLL).expect("up") {
            assert_eq!((id as usize, data), (stamps.len(), &[stamps.len() as u8][..]));
            stamps.push(at);
        }
        if stamps.len() == 100 {
            break;
        }
    }
    assert!(player.wait().expect("ended").success());
    assert!(stamps.is_sorted(), "{stamps:?}");
    let span = stamps[99].saturating_since(stamps[0]);
    println!("canplayer's 0.495 s took {span:?}");
}

#[test]
fn frames_dropped_by_a_full_queue_are_counted() {
    let Some(_turn) = turn() else { return };
    let interface = Interface::make("otolith7");
    let mut link = interface.open();
    // As fast as it can, and nobody reads. The last one waits until there is room again.
    const SENT: u64 = 20_000;
    run(&format!("cangen otolith7 -g 0 -p 10 -n {SENT} -I 3A0 -L 8 -D i"));
    let mut received = 0;
    while link.receive(POLL).expect("up").is_some() {
        received += 1;
    }
    // The count is asked for now and then.
    wait_until("the count of the kernel", || {
        assert!(link.receive(POLL).expect("up").is_none());
        link.status().overflowed > 0
    });
    println!("{received} of {SENT} frames kept");
    assert_eq!(received + link.status().overflowed, SENT);
    drop(interface);
}

#[test]
fn the_set_up_of_interfaces_is_told() {
    let Some(_turn) = turn() else { return };
    let _interface = Interface::make("otolith8");
    let expected =
        CanDetails { up: true, kind: Some("vcan".to_owned()), bitrate: None, state: None, restart_ms: None };
    assert_eq!(can_details("otolith8"), Some(expected.clone()));
    run("ip link set otolith8 down");
    assert_eq!(can_details("otolith8"), Some(CanDetails { up: false, ..expected }));
    assert_eq!(can_details("lo"), None);
}
