//! The lines of serial CAN adapters.

use otolith::device::slcan::codec::{Command, MAX_LINE, SlcanDecoder, SlcanEvent, SlcanFrame};

pub(crate) fn run(data: &[u8]) {
    let mut decoder = SlcanDecoder::default();
    let mut skipped = 0;
    for event in data.iter().filter_map(|byte| decoder.push(*byte)) {
        match event {
            SlcanEvent::Frame(frame) => {
                let mut line = [0; MAX_LINE];
                let length = frame.encode(&mut line);
                assert_eq!(SlcanFrame::parse(&line[..length - 1]), Some(frame));
            }
            SlcanEvent::Skipped(bytes) => skipped += bytes,
            SlcanEvent::Accepted | SlcanEvent::Refused => {}
        }
    }
    assert!(skipped <= data.len(), "{skipped} of {} bytes", data.len());
    for line in data.split(|byte| *byte == b'\r') {
        if let Some(command) = Command::parse(line) {
            assert_eq!(command.to_string().as_bytes(), line);
        }
    }
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let text = "S6\rO\rV\rN\rZ1\rt3A08000000005C0F6400\rT18FEF10021122ABCD\rr1230\rz\rZ\r\x07\nt1\rC\r";
    vec![text.into(), text.repeat(9).into()]
}
