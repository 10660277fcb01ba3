use super::*;
use crate::device::fault::WrongBaud;
use crate::device::mock::{MockChair, MockParams};
use crate::device::protocol::detect::OTOLITH_SERIAL;
use crate::device::testing::{Event, ManualClock, ScriptLink, drain};
use crate::device::{Noise, Traffic};

const LENGTH: Duration = DEFAULT_LENGTH;

/// A line in simulated time: a device that sends pieces at its speed, a host that may listen at another.
struct Line {
    clock: Arc<ManualClock>,
    device_baud: u32,
    host_baud: u32,
    /// The fastest speed the port offers.
    fastest_baud: u32,
    pieces: std::vec::IntoIter<(HostTime, Vec<u8>)>,
    next: Option<(HostTime, Vec<u8>)>,
    read: Vec<u8>,
    sent: usize,
}

impl Line {
    fn new(device_baud: u32, pieces: Vec<(HostTime, Vec<u8>)>) -> Self {
        let mut pieces = pieces.into_iter();
        let next = pieces.next();
        let clock = Arc::new(ManualClock::default());
        Self {
            clock,
            device_baud,
            host_baud: 0,
            fastest_baud: u32::MAX,
            pieces,
            next,
            read: Vec::new(),
            sent: 0,
        }
    }

    fn scan(mut self) -> Heard {
        let clock = Arc::clone(&self.clock);
        let heard = scan(&mut self, clock.as_ref(), &BAUDS, LENGTH).expect("stays");
        assert!(clock.now() <= HostTime(0) + LENGTH, "{:?}", clock.now());
        assert_eq!(self.sent, 0, "nothing is ever written");
        heard
    }
}

impl Link for Line {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        let limit = self.clock.now() + timeout;
        let Some((at, sent)) = self.next.take_if(|(at, _)| *at <= limit) else {
            self.clock.sleep_until(limit);
            return Ok(None);
        };
        self.next = self.pieces.next();
        self.clock.sleep_until(at);
        let (sent_baud, read_baud) = (self.device_baud, self.host_baud);
        self.read.clear();
        WrongBaud { sent_baud, read_baud, keep_framing_errors: true }.misread(&sent, &mut self.read);
        Ok((!self.read.is_empty()).then_some((at, Traffic::Bytes(&self.read))))
    }

    fn send(&mut self, _traffic: Traffic<'_>) -> Result<(), LinkError> {
        self.sent += 1;
        Ok(())
    }
}

impl Tunable for Line {
    fn set_baud(&mut self, baud: u32) -> bool {
        if baud > self.fastest_baud {
            return false;
        }
        self.host_baud = baud;
        true
    }
}

/// A device at rest that speaks our protocol from `start_s` on.
fn ours(sample_rate_hz: f64, start_s: f64) -> Vec<(HostTime, Vec<u8>)> {
    let params = MockParams { rest_s: 5.0, sample_rate_hz, ..MockParams::rest() };
    let mut pieces = drain(&mut MockChair::new(params).expect("in range"));
    for (at, _) in &mut pieces {
        *at = *at + Duration::from_secs_f64(start_s);
    }
    pieces
}

#[test]
fn our_protocol_is_found_at_every_speed_in_three_seconds() {
    for device_baud in BAUDS {
        let heard = Line::new(device_baud, ours(20.0, 0.0)).scan();
        assert_eq!((heard.protocol, heard.baud), (Some(OTOLITH_SERIAL), Some(device_baud)), "{heard:?}");
        let rate_hz = heard.rate_hz.expect("samples came");
        assert!((rate_hz - 20.0).abs() < 0.5, "{rate_hz} Hz at {device_baud}");
        let force = heard.sample.and_then(|sample| sample.specific_force_m_s2).expect("it has one");
        assert!((force[2] - 9.807).abs() < 0.05, "{force:?}");
    }
}

#[test]
fn a_board_that_its_opening_has_reset_is_found_when_it_speaks() {
    for device_baud in [115_200, 57_600] {
        let heard = Line::new(device_baud, ours(100.0, 1.5)).scan();
        assert_eq!((heard.protocol, heard.baud), (Some(OTOLITH_SERIAL), Some(device_baud)), "{heard:?}");
    }
}

#[test]
fn a_speed_the_port_does_not_offer_is_left_out() {
    let line = Line { fastest_baud: 115_200, ..Line::new(57_600, ours(20.0, 0.0)) };
    assert_eq!(line.scan().baud, Some(57_600));
    let line = Line { fastest_baud: 300, ..Line::new(57_600, ours(20.0, 0.0)) };
    assert_eq!(line.scan().verdict, Verdict::Silence);
}

#[test]
fn silence_is_silence() {
    let heard = Line::new(9600, Vec::new()).scan();
    assert_eq!((heard.verdict, heard.bytes, heard.listened_s), (Verdict::Silence, 0, 3.0));
}

#[test]
fn lines_of_numbers_are_text_with_a_count_and_a_rate() {
    let line = |k: u64| format!("{k},0.01,-0.02,9.81,0.1,0.2,0.3\r\n").into_bytes();
    for device_baud in [115_200, 9600] {
        let pieces = (0..40).map(|k| (HostTime(k * 100_000_000), line(k))).collect();
        let heard = Line::new(device_baud, pieces).scan();
        assert_eq!((heard.verdict, heard.text_columns), (Verdict::Text, Some(7)), "{heard:?}");
        assert_eq!(heard.baud, Some(device_baud));
        assert!((heard.rate_hz.expect("several lines") - 10.0).abs() < 1e-6);
    }
}

#[test]
fn noise_stays_unknown_with_the_bytes_of_every_look() {
    let mut noise = Noise::new(7);
    let mut piece = |k: u64| (HostTime(k * 1_000_000), (0..50).map(|_| noise.next_u32() as u8).collect());
    let heard = Line::new(921_600, (0..3000).map(&mut piece).collect()).scan();
    assert_eq!((heard.verdict, heard.protocol, heard.baud), (Verdict::Unknown, None, None));
    assert!(heard.looks.len() == BAUDS.len() && heard.looks.iter().all(|look| look.bytes > 500), "{heard:?}");
    assert_eq!(heard.bytes, heard.looks.iter().map(|look| look.bytes).sum::<u64>());
}

/// The frames of an SBG sensor without its time, 100 times a second.
struct Sbg(Arc<ManualClock>, u64);

impl Link for Sbg {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        self.1 += 1;
        self.0.sleep_until(self.0.now() + timeout.min(Duration::from_millis(5)));
        let id = [0x121, 0x122][self.1 as usize % 2];
        Ok(Some((self.0.now(), Traffic::CanFrame { id, extended: false, data: &[0; 6] })))
    }
}

#[test]
fn a_bus_that_only_a_mapping_understands_is_described_with_the_one_that_fits() {
    let clock = Arc::new(ManualClock::default());
    let heard = listen(&mut Sbg(Arc::clone(&clock), 0), clock.as_ref(), Bus::Can, LENGTH).expect("stays");
    assert_eq!((heard.verdict, heard.protocol, heard.ids), (Verdict::Unknown, None, 2));
    assert_eq!(heard.fitting_maps(), ["sbg-no-time"]);
    assert_eq!((heard.counters.unknown, heard.counters.bytes_skipped), (heard.frames, 0));
}

#[test]
fn a_link_that_ends_or_goes_away_ends_the_listening() {
    let clock = ManualClock::default();
    let mut link = ScriptLink::new([Event::Silence, Event::Piece(HostTime(5), vec![1, 2, 3])]);
    let heard = listen(&mut link, &clock, Bus::Serial, LENGTH).expect("an end is no loss");
    assert_eq!((heard.verdict, heard.bytes), (Verdict::Unknown, 3));
    let error = listen(&mut ScriptLink::new([Event::Lost]), &clock, Bus::Serial, LENGTH).expect_err("lost");
    assert!(error.to_string().contains("went away"), "{error}");
}

#[test]
fn the_selectors_speed_comes_first_unless_it_is_the_usual_one() {
    assert_eq!(bauds_from(DEFAULT_BAUD), BAUDS);
    assert_eq!(bauds_from(57_600)[..2], [57_600, 115_200]);
    assert_eq!(bauds_from(57_600).len(), BAUDS.len());
    assert_eq!(bauds_from(38_400).len(), BAUDS.len() + 1);
}
