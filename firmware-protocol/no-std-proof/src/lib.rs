//! Proof that the wire format needs neither std nor a heap, on any machine and without an embedded target.
//!
//! This library has its own panic handler. If the crate it links used std, there would be two, and the compiler
//! would stop with E0152 "duplicate lang item `panic_impl`"; if it allocated, a global allocator would be missing.
#![no_std]

use core::panic::PanicInfo;

use otolith_firmware_protocol::MAX_FRAME;
use otolith_firmware_protocol::can::{CanEvent, CanReceiver, Ids};
use otolith_firmware_protocol::message::{Message, Sample16};
use otolith_firmware_protocol::stream::{Event, StreamDecoder, StreamEncoder};

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

/// Sends one sample through every part of the crate; returns how many samples came out at the other end.
// The one attribute that lets a linker find the function. Nothing in the body is unsafe.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn otolith_round_trip(t_us: u32, gyro_z: i16, accel_z: i16) -> u32 {
    let sample = Message::Sample16(Sample16 { t_us, gyro: [0, 0, gyro_z], accel: [0, 0, accel_z] });
    let mut samples = 0;

    let mut buffer = [0; MAX_FRAME];
    if let Ok(frame) = StreamEncoder::new().encode(&sample, &mut buffer) {
        StreamDecoder::new().push(frame, |event| {
            samples += u32::from(matches!(event, Event::Message { message, .. } if message == sample));
        });
    }

    let mut receiver = CanReceiver::new(Ids::default());
    for id in [0x3A0, 0x3A1] {
        receiver.push(id, &[0; 8], |event| samples += u32::from(matches!(event, CanEvent::Sample(_))));
    }
    samples
}
