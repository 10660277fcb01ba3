//! What listening must never do: give a name to bytes that nobody has sent.

use std::path::PathBuf;

use otolith::device::fault::WrongBaud;
use otolith::device::mock::{MockChair, MockParams};
use otolith::device::probe::BAUDS;
use otolith::device::protocol::PacketDecoder;
use otolith::device::protocol::detect::{AutoDecoder, Bus};
use otolith::device::{Link, LinkError, Noise, Traffic};

/// Bytes of each capture that are misread: several seconds of each device.
const CAPTURE_BYTES: usize = 32 * 1024;
/// Bytes of one piece.
const PIECE: usize = 61;

/// Name and bytes of every raw serial capture at hand; empty where the shared recordings are not.
pub(crate) fn raw_captures() -> Vec<(String, Vec<u8>)> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/imu-logs/serial_raw"));
    let Ok(entries) = std::fs::read_dir(&folder) else {
        assert!(std::env::var_os("CI").is_none(), "{} is missing", folder.display());
        crate::say_skipped("../shared is not here");
        return Vec::new();
    };
    let mut captures: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "bin" || extension == "raw"))
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()))
        .collect();
    captures.sort();
    assert!(captures.len() >= 8, "{captures:?}");
    captures
}

/// What our own protocol sends in `rest_s` seconds at rest.
pub(crate) fn our_bytes(rest_s: f64, sample_rate_hz: f64) -> Vec<u8> {
    let params = MockParams { rest_s, sample_rate_hz, ..MockParams::rest() };
    let mut mock = MockChair::new(params).unwrap();
    let mut bytes = Vec::new();
    loop {
        match mock.receive(std::time::Duration::ZERO) {
            Ok(Some((_, Traffic::Bytes(frame)))) => bytes.extend_from_slice(frame),
            Err(LinkError::EndOfRecording) => return bytes,
            other => panic!("{other:?}"),
        }
    }
}

/// The protocol these bytes are taken for; `unknown` for none.
fn named(bytes: &[u8]) -> &'static str {
    let mut decoder = AutoDecoder::on(&[Bus::Serial]);
    for piece in bytes.chunks(PIECE) {
        decoder.push(Traffic::Bytes(piece), &mut |_| {});
    }
    decoder.protocol()
}

#[test]
fn captures_read_at_another_speed_are_nobodys() {
    let mut captures = raw_captures();
    captures.push(("our own".to_owned(), our_bytes(1.0, 1000.0)));
    let mut misread = Vec::new();
    let mut looked = 0;
    for (name, capture) in &captures {
        let capture = &capture[..capture.len().min(CAPTURE_BYTES)];
        for (sent_baud, read_baud) in BAUDS.into_iter().flat_map(|sent| BAUDS.map(|read| (sent, read))) {
            for keep_framing_errors in [false, true] {
                misread.clear();
                WrongBaud { sent_baud, read_baud, keep_framing_errors }.misread(capture, &mut misread);
                if sent_baud == read_baud {
                    assert_eq!(misread, capture);
                } else {
                    let what = format!("{name} sent at {sent_baud}, read at {read_baud}");
                    assert_eq!(
                        named(&misread),
                        "unknown",
                        "{what}, framing errors kept: {keep_framing_errors}"
                    );
                    looked += 1;
                }
            }
        }
    }
    println!("{looked} misreadings of {} captures", captures.len());
    assert!(looked >= 60);
}

#[test]
fn random_bytes_are_nobodys() {
    for seed in 0..200 {
        let mut noise = Noise::new(seed);
        // Every other stream is made of the bytes that frames begin with.
        let bytes: Vec<u8> = (0..20_000)
            .map(|_| match (seed % 2, noise.next_u32()) {
                (0, random) => random as u8,
                (_, random) => {
                    [0x00, 0x55, 0x75, 0x65, 0xFA, 0xFF, 0xFD, 0x24, 0x41, 0x0A][random as usize % 10]
                }
            })
            .collect();
        assert_eq!(named(&bytes), "unknown", "seed {seed}");
    }
}
