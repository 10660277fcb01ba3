//! The wire format for firmware, by itself.

use otolith_firmware_protocol::can::{CanEvent, CanMessage, CanReceiver, Ids};
use otolith_firmware_protocol::message::Message;
use otolith_firmware_protocol::stream::{Event, StreamDecoder, encode_frame};
use otolith_firmware_protocol::{MAX_FRAME, MAX_PAYLOAD};

use crate::input::Input;

/// Every byte is in a good frame, skipped, an empty piece's end, or not yet ended; cuts make no difference.
pub(crate) fn stream(data: &[u8]) {
    let input = Input::read(data);
    let mut whole = StreamDecoder::new();
    let (mut framed, mut events) = (0, Vec::new());
    whole.push(input.stream, |event| {
        let mut frame = [0; MAX_FRAME];
        framed += match event {
            Event::Message { seq, message, .. } => {
                encode_frame(&message, seq, &mut frame).map_or(0, <[u8]>::len)
            }
            // Type, sequence number and checksum; a byte of COBS; the delimiter.
            Event::Unreadable { payload, .. } => payload.len() + 6,
            Event::Dropped { .. } => 0,
        };
        events.push(format!("{event:?}"));
    });
    let pieces = || input.stream.split_inclusive(|byte| *byte == 0);
    let empty = pieces().filter(|piece| *piece == [0]).count();
    let pending = pieces().next_back().filter(|piece| piece.last() != Some(&0)).map_or(0, <[u8]>::len);
    let counters = whole.counters();
    let told = framed as u64 + counters.bytes_skipped + empty as u64;
    let total = input.stream.len() as u64;
    // What is too long is counted before its end.
    assert!(
        told == total || told + pending as u64 == total,
        "{counters:?}: {told} and {pending} of {total} bytes"
    );

    let (mut cut, mut same) = (StreamDecoder::new(), Vec::new());
    input.pieces().for_each(|piece| cut.push(piece, |event| same.push(format!("{event:?}"))));
    assert_eq!((events, counters), (same, cut.counters()), "cuts make a difference");
}

/// A payload that reads is written as it was, but for what a reader does not keep.
pub(crate) fn payload(data: &[u8]) {
    let &[kind, ref payload @ ..] = data else { return };
    let payload = &payload[..payload.len().min(MAX_PAYLOAD)];
    let Ok(message) = Message::decode(kind, payload) else { return };
    let mut written = [0; MAX_PAYLOAD];
    let length = message.encode_payload(&mut written).expect("what was read fits");
    let again = Message::decode(kind, &written[..length]).expect("what was written reads");
    let mut twice = [0; MAX_PAYLOAD];
    assert_eq!(again.encode_payload(&mut twice).ok(), Some(length));
    assert_eq!(twice, written);
}

/// Frames of one node: identifier (two bytes), length, data. What reads is written as something that reads the same.
pub(crate) fn can(data: &[u8]) {
    let Some((&node, mut rest)) = data.split_first() else { return };
    let Some(ids) = Ids::of_node(node % 70) else { return };
    let mut receiver = CanReceiver::new(ids);
    while let [high, low, length, after @ ..] = rest {
        let (payload, after) = after.split_at(usize::from(*length % 9).min(after.len()));
        rest = after;
        let id = u32::from(*high & 7) << 8 | u32::from(*low);
        let mut events = 0;
        receiver.push(id, payload, |event| {
            events += 1;
            if let CanEvent::Message(message) = event {
                let offset = ids.offset_of(id).expect("it is of this node");
                assert_eq!(CanMessage::decode(offset, &message.encode()), Ok(message));
            }
        });
        assert!(events <= 2, "at most two events");
    }
    let counters = receiver.counters();
    assert!(
        counters.samples * 2 + counters.lone_halves + counters.repeated <= counters.frames,
        "{counters:?}"
    );
}
