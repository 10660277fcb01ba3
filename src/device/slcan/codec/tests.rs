use proptest::prelude::*;

use super::*;

fn decode(bytes: &[u8]) -> Vec<SlcanEvent> {
    let mut decoder = SlcanDecoder::default();
    bytes.iter().filter_map(|byte| decoder.push(*byte)).collect()
}

fn frames(bytes: &[u8]) -> Vec<SlcanFrame> {
    let frame = |event| if let SlcanEvent::Frame(frame) = event { Some(frame) } else { None };
    decode(bytes).into_iter().filter_map(frame).collect()
}

fn line(frame: &SlcanFrame) -> Vec<u8> {
    let mut out = [0; MAX_LINE];
    let length = frame.encode(&mut out);
    out[..length].to_vec()
}

/// The lines that the kernel's slcan driver and the LAWICEL manual give for these frames.
#[test]
fn documented_lines_are_read_and_written() {
    let extended = SlcanFrame::new(0x1234_5678, true, &[0x11, 0x22, 0x33]).expect("fits");
    let stamped = SlcanFrame { stamp_ms: Some(0x0B8B), ..extended };
    for (text, frame) in [
        ("t7E02CAFE\r", SlcanFrame::new(0x7E0, false, &[0xCA, 0xFE]).expect("fits")),
        ("t1230\r", SlcanFrame::new(0x123, false, &[]).expect("fits")),
        ("T123456783112233\r", extended),
        ("T1234567831122330B8B\r", stamped),
        ("r1238\r", SlcanFrame::remote(0x123, false, 8).expect("fits")),
        ("R000001230\r", SlcanFrame::remote(0x123, true, 0).expect("fits")),
    ] {
        assert_eq!(decode(text.as_bytes()), [SlcanEvent::Frame(frame)], "{text}");
        assert_eq!(line(&frame), text.as_bytes());
    }
    assert_eq!(frames(b"t7e02cafe\r"), frames(b"t7E02CAFE\r"), "digits of either case");
    let remote = frames(b"r1238\r")[0];
    assert_eq!((remote.data(), remote.length()), (&[][..], 8));
}

#[test]
fn answers_and_errors_are_told_apart() {
    use SlcanEvent::{Accepted, Refused};
    assert_eq!(decode(b"\rz\rZ\rV1013\rNA123\rF00\r"), [Accepted; 6]);
    assert_eq!(decode(b"\x07\r"), [Refused, Accepted]);
    assert_eq!(decode(b"t12\x07t1230\r").len(), 2, "an error inside a line ends it");
    assert_eq!(decode(b"\r\n\r\n"), [Accepted, Accepted], "both ends of a line");
}

#[test]
fn lines_that_are_no_frames_are_counted() {
    for text in [
        "t1239\r", // more than 8 bytes
        "t123F\r",
        "t8000\r", // identifier too large
        "T200000000\r",
        "t1231\r",           // data missing
        "t123111122\r",      // half a stamp
        "t12311122334455\r", // too much
        "t1g30\r",
        "t+230\r",
        "hello\r",
        "V?\r",
        "T1234567881122334455667788123456\r",
    ] {
        assert_eq!(frames(text.as_bytes()), [], "{text:?}");
        let skipped = |event: &SlcanEvent| if let SlcanEvent::Skipped(n) = event { *n } else { 0 };
        assert_eq!(decode(text.as_bytes()).iter().map(skipped).sum::<usize>(), text.len(), "{text:?}");
    }
}

#[test]
fn bytes_without_an_end_are_reported_as_they_come() {
    let mut decoder = SlcanDecoder::default();
    let mut reported = 0;
    for count in 1..=1000 {
        if let Some(SlcanEvent::Skipped(bytes)) = decoder.push(b'\xF8') {
            reported += bytes;
        }
        assert!(reported <= count && count - reported < MAX_LINE, "{reported} of {count}");
    }
    assert_eq!(decoder.push(END), Some(SlcanEvent::Skipped(1001 - reported)), "no answer");
    assert_eq!(decoder.push(END), Some(SlcanEvent::Accepted));
}

#[test]
fn commands_are_as_documented() {
    for (index, bitrate) in BITRATES.into_iter().enumerate() {
        assert_eq!(Command::bitrate(bitrate).map(Command::line), Some(format!("S{index}\r")));
    }
    assert_eq!(Command::bitrate(33_333), None);
    for (text, command) in [
        ("O", Command::Open),
        ("C", Command::Close),
        ("V", Command::Version),
        ("N", Command::SerialNumber),
        ("Z1", Command::Stamps(true)),
        ("Z0", Command::Stamps(false)),
        ("S8", Command::Bitrate(8)),
    ] {
        assert_eq!((Command::parse(text.as_bytes()), command.to_string()), (Some(command), text.to_owned()));
    }
    for text in ["", "S9", "S", "O1", "t1230"] {
        assert_eq!(Command::parse(text.as_bytes()), None, "{text}");
    }
}

prop_compose! {
    fn any_frame()(
        extended: bool, id in 0u32..0x2000_0000, data in proptest::collection::vec(any::<u8>(), 0..=8),
        remote: bool, stamp_ms in proptest::option::of(0u16..60_000),
    ) -> SlcanFrame {
        let id = if extended { id } else { id & 0x7FF };
        let frame = if remote {
            SlcanFrame::remote(id, extended, data.len() as u8)
        } else {
            SlcanFrame::new(id, extended, &data)
        };
        SlcanFrame { stamp_ms, ..frame.expect("fits") }
    }
}

proptest! {
    #[test]
    fn frames_survive_the_line(frames_sent in proptest::collection::vec(any_frame(), 0..20)) {
        let bytes: Vec<u8> = frames_sent.iter().flat_map(line).collect();
        prop_assert_eq!(frames(&bytes), frames_sent);
    }

    #[test]
    fn any_bytes_are_legal_and_the_next_frame_is_found(
        garbage in proptest::collection::vec(any::<u8>(), 0..100), frame in any_frame(),
    ) {
        let mut bytes = garbage;
        bytes.extend(line(&frame));
        prop_assert_eq!(frames(&bytes).pop(), Some(frame), "no end of a line between them");
    }

    #[test]
    fn garbage_made_of_the_letters_of_slcan_is_legal(
        text in "[tTrR0-9A-FzZVNF\r\x07\n]{0,200}", frame in any_frame(),
    ) {
        let mut bytes = text.into_bytes();
        bytes.extend(line(&frame));
        prop_assert_eq!(frames(&bytes).pop(), Some(frame));
    }
}
