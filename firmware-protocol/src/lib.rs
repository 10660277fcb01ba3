//! Wire format of otolith's IMU firmware, for both ends of the wire. `no_std`, no heap, no dependencies, no `unsafe`.
//!
//! ```text
//! serial  Message -> StreamEncoder -> COBS(type | seq | payload | crc16) 0x00 -> StreamDecoder -> Event
//! CAN     CanMessage -> Ids::frame -> identifier + 8 bytes -> CanReceiver -> CanEvent
//! ```
//!
//! | module | what |
//! |---|---|
//! | [`message`] | the nine serial messages: payloads to fields and back |
//! | [`stream`] | frames in a byte stream: sequence numbers, resynchronisation, counters |
//! | [`can`] | the same device on classic CAN: eight messages, pairing and time of samples, loss |
//! | [`crc`], [`cobs`] | the two algorithms of the frame |
//!
//! Everything is little-endian. Angular rate is in the sensor frame; acceleration is **specific force** `a - g`,
//! +1 g on the upward axis at rest. The byte tables, worked frames and the C header are in the crate's folder
//! (`README.md`, `include/otolith_protocol.h`, `otolith.dbc`).
//!
//! # Versions
//! The first payload byte of HELLO is the version of the format and stays there for ever. Within a version the
//! layout of a message never changes: new content gets a new type, which older receivers count as unknown and
//! skip; new command codes, flag bits and capability bits may appear. Any other change raises [`VERSION`]. A
//! HELLO (on CAN: DESC or HEALTH) of another version is not read, so samples are never scaled by guesswork.
//!
//! # Example
//! ```
//! use otolith_firmware_protocol::message::{Message, Sample16};
//! use otolith_firmware_protocol::stream::{Event, StreamDecoder, StreamEncoder};
//! use otolith_firmware_protocol::MAX_FRAME;
//!
//! // In the firmware:
//! let mut encoder = StreamEncoder::new();
//! let mut buffer = [0; MAX_FRAME];
//! let sample = Message::Sample16(Sample16 { t_us: 2000, gyro: [0, 0, 3932], accel: [0, 0, 8192] });
//! let frame = encoder.encode(&sample, &mut buffer)?;
//! assert_eq!(frame.last(), Some(&0));
//!
//! // On the host, bytes arrive cut anywhere and damaged anyhow:
//! let mut decoder = StreamDecoder::new();
//! let mut received = 0;
//! for piece in [&b"tail of a frame\0"[..], &frame[..7], &frame[7..]] {
//!     decoder.push(piece, |event| match event {
//!         Event::Message { message, .. } => {
//!             assert_eq!(message, sample);
//!             received += 1;
//!         }
//!         Event::Dropped { joined_mid_frame, .. } => assert!(joined_mid_frame),
//!         Event::Unreadable { error, .. } => panic!("{error}"),
//!     });
//! }
//! assert_eq!((received, decoder.counters().frames, decoder.counters().lost), (1, 1, 0));
//! # Ok::<(), otolith_firmware_protocol::message::EncodeError>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod can;
pub mod cobs;
pub mod crc;
pub mod message;
mod payload;
pub mod stream;
mod wire;

/// Version of the format, announced in HELLO and, on CAN, in DESC and HEALTH.
pub const VERSION: u8 = 1;

/// Longest frame before COBS: type, seq, payload and CRC, bytes. Keeps every frame inside one COBS block.
pub const MAX_BODY: usize = 250;

/// Longest payload, bytes.
pub const MAX_PAYLOAD: usize = MAX_BODY - 4;

/// Longest frame on the wire, bytes: [`MAX_BODY`], one COBS byte and the delimiter.
pub const MAX_FRAME: usize = MAX_BODY + 2;
