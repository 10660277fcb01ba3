//! The faults of docs/fault-matrix.md that a kernel can show: our own frames go through its CAN stack and the faults are
//! its own. Only time is not: the clock of link and program is that of the stream, and stands still while the kernel works.

use std::fmt::Write as _;

use otolith::device::can::bus::BusState;
use otolith::device::protocol::native_can::NativeCanDecoder;
use otolith::device::{LinkError, LinkStatus, Selector};
use otolith::runtime::SourceFacts;
use otolith::runtime::trouble::Trouble;
use otolith::time::HostTime;

use super::chair_can::{Chair, Frame};
use super::fault_bench::{Bench, END_MS, Expected, PHASES, Seen, Sign, StreamClock};
use super::*;

const NAME: &str = "otolith30";
const CHAIR: Chair = Chair { rate_hz: 200, spin_s: 1.0, after_s: 3.0 };
const PERIOD_MS: u64 = 5;
/// Frames of another node.
const STRANGER: u32 = 0x100;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    BusOff,
    InterfaceDown,
    InterfaceRemoved,
    Overflow,
    None,
}

impl Fault {
    /// Name of its row, length in ms, and what is to name it.
    fn facts(self) -> (&'static str, u64, &'static [Trouble]) {
        match self {
            Fault::BusOff => ("bus off", 300, &[Trouble::BusOff]),
            Fault::InterfaceDown => ("interface down", 300, &[Trouble::InterfaceDown]),
            Fault::InterfaceRemoved => ("interface removed", 200, &[Trouble::ConnectionLost]),
            Fault::Overflow => {
                ("receive overflow", 40, &[Trouble::Overflow, Trouble::MissingPackets, Trouble::Gap])
            }
            Fault::None => ("no fault", 0, &[]),
        }
    }

    /// Whether the link has been told.
    fn is_told(self, status: &LinkStatus) -> bool {
        match self {
            Fault::BusOff => status.bus_state == BusState::BusOff,
            Fault::InterfaceDown => status.bus_state == BusState::InterfaceDown,
            Fault::InterfaceRemoved => status.down,
            Fault::Overflow | Fault::None => true,
        }
    }

    /// Samples lost, and frames missing: two a sample, by the device's own count.
    fn account(self, facts: &SourceFacts) -> Result<(), String> {
        let lost = CHAIR.samples() - facts.imu.samples;
        let (expected, missing) = match self {
            Fault::BusOff | Fault::InterfaceDown => (60, 120..=120),
            // It is reopened 300 ms after the loss; what was sent meanwhile need not be known.
            Fault::InterfaceRemoved => (60, 0..=120),
            Fault::Overflow => (8, 16..=16),
            Fault::None => (0, 0..=0),
        };
        let overflowed = facts.link.overflowed > 0;
        if lost != expected
            || !missing.contains(&facts.decode.missing)
            || overflowed != (self == Fault::Overflow)
        {
            return Err(format!(
                "{lost} samples lost, {} frames missing, {} dropped by the kernel",
                facts.decode.missing, facts.link.overflowed
            ));
        }
        Ok(())
    }
}

/// A link whose traffic arrives when the clock of the stream says.
struct InStreamTime {
    link: Box<dyn Link>,
    clock: Arc<StreamClock>,
}

impl Link for InStreamTime {
    fn receive(&mut self, timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        Ok(self.link.receive(timeout)?.map(|(_, traffic)| (self.clock.now(), traffic)))
    }

    fn status(&self) -> LinkStatus {
        self.link.status()
    }

    fn port(&self) -> Option<&str> {
        self.link.port()
    }
}

/// What is seen of the chair's frames with a fault among them, blind to the signs given.
fn seen(fault: Fault, at_ms: u64, blind_to: &[Sign]) -> Seen {
    let ends_ms = at_ms + fault.facts().1;
    let clock = Arc::new(StreamClock::default());
    let link_clock = Arc::clone(&clock) as Arc<dyn Clock>;
    let open = || CanLink::open(NAME, Arc::clone(&link_clock)).expect("opens");
    let mut interface = Some(Interface::make(NAME));
    let (mut sender, mut witness) = (open(), open());
    let selector: Selector = format!("can:{NAME}").parse().expect("a selector");
    let link = otolith::device::open(&selector, &link_clock, None).expect("opens");
    let link = Box::new(InStreamTime { link, clock: Arc::clone(&clock) });
    let mut bench = Bench::new(&clock, link, Box::new(NativeCanDecoder::new(None)), blind_to);
    let frames = CHAIR.frames();
    for ms in 0..END_MS {
        clock.set_ms(ms);
        if ms == at_ms {
            match fault {
                Fault::BusOff => run(&format!("cansend {NAME} 20000040#0000000000000000")),
                Fault::InterfaceDown => run(&format!("ip link set {NAME} down")),
                Fault::InterfaceRemoved => interface = None,
                // More than fits, and nobody reads.
                Fault::Overflow => {
                    run(&format!("cangen {NAME} -g 0 -p 10 -n 20000 -I {STRANGER:X} -L 8"));
                    witness = open();
                }
                Fault::None => {}
            }
            wait_until("the kernel's word", || {
                fault.is_told(&bench.facts().link) || {
                    bench.take_in(POLL);
                    false
                }
            });
        }
        if ms == ends_ms {
            match fault {
                Fault::BusOff => run(&format!("cansend {NAME} 20000100#0000000000000000")),
                Fault::InterfaceDown => run(&format!("ip link set {NAME} up")),
                Fault::InterfaceRemoved => interface = Some(Interface::make(NAME)),
                Fault::Overflow => while bench.take_in(POLL) {},
                Fault::None => {}
            }
            // The old ones would tell of the fault once more.
            (sender, witness) = (open(), open());
        }
        let lasts = (at_ms..ends_ms).contains(&ms);
        let held_up = lasts && fault == Fault::Overflow;
        let on_bus = !lasts || held_up;
        if !held_up {
            // An interface that is back is opened.
            while bench.take_in(Duration::ZERO) {}
        }
        let due = frames.iter().filter(|frame| on_bus && u64::from(frame.t_us / 1000) == ms);
        for Frame { id, data, .. } in due {
            let frame = Traffic::CanFrame { id: u32::from(*id), extended: false, data };
            sender.send(frame).expect("sent");
            // The kernel hands out a frame not always before `send` is over.
            while next(&mut witness).0 == STRANGER {}
            if !held_up && !bench.facts().link.down {
                wait_until("the frame", || bench.take_in(POLL));
            }
        }
        if held_up {
            bench.look_away();
        } else {
            bench.look();
        }
    }
    drop(interface);
    bench.end()
}

#[test]
fn faults_of_the_kernels_can_stack_are_named_in_time_over_in_time_and_counted_once() {
    let Some(_turn) = turn() else { return };
    let mut table = format!("\n## otolith-can through a kernel, a sample every {PERIOD_MS} ms\n\n");
    let _ = writeln!(table, "| fault | {} | {} |\n|---|---|---|", PHASES[0].0, PHASES[1].0);
    let mut wrong = Vec::new();
    for fault in [Fault::BusOff, Fault::InterfaceDown, Fault::InterfaceRemoved, Fault::Overflow, Fault::None]
    {
        let (name, length_ms, troubles) = fault.facts();
        let cells = PHASES.map(|(phase, begins_ms)| {
            let signs = troubles.iter().map(|trouble| Sign::Trouble(*trouble)).collect();
            let expected = Expected { begins_ms, ends_ms: begins_ms + length_ms, signs };
            let cell = expected.cell(PERIOD_MS, |blind_to| seen(fault, begins_ms, blind_to));
            let text = cell.and_then(|(text, seen)| fault.account(&seen.facts).map(|()| text));
            text.unwrap_or_else(|why| {
                wrong.push(format!("{name}, {phase}: {why}"));
                format!("**{why}**")
            })
        });
        let _ = writeln!(table, "| {name} | {} | {} |", cells[0], cells[1]);
    }
    println!("{table}");
    assert!(wrong.is_empty(), "{} cells are wrong:\n{}", wrong.len(), wrong.join("\n"));
    assert_documented(&table);
}

/// The table stands in docs/fault-matrix.md between two marks. It cannot be written there: the guest of `.ci/uml` does not
/// write to the host.
fn assert_documented(table: &str) {
    const MARK: &str = "<!-- from `.ci/run socketcan`, which prints it -->\n";
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/fault-matrix.md");
    let page = std::fs::read_to_string(path).expect("docs/fault-matrix.md");
    let (_, documented) = page.split_once(MARK).expect("the mark");
    let (documented, _) = documented.split_once("\n<!--").expect("the next mark");
    assert_eq!(documented, table, "docs/fault-matrix.md has the left one; put the right one there");
}
