//! `otolith devices`: what is connected, and what it says. Never writes to a port.

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;

use super::failure::Failure;
use super::show;
use crate::device::discover::{Access, DiscoveredPort, PortKind, describe, discover};
use crate::device::probe::{DEFAULT_LENGTH, Heard, Verdict, probe};
use crate::device::{DeviceError, Selector};
use crate::time::{Clock, SystemClock};

/// List serial ports and CAN interfaces, listen to each, and say what it speaks.
///
/// Listens only: nothing is ever written to a port. The first column is what `otolith run --device` takes.
///
/// Opening a serial port raises its DTR line, which resets many Arduino boards; their bootloader is then silent for one
/// or two seconds. --list opens nothing. A name below /dev/serial/by-id stays the same when the device is plugged in
/// elsewhere; `serial:usb=SERIALNUMBER` does too.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith devices\n  \
    otolith devices serial:/dev/ttyUSB0 can:can0 --listen-s 6\n  \
    otolith devices --list --json")]
pub(super) struct DevicesArgs {
    /// Listen to these only: serial:PORT?baud=N, can:IFACE.
    #[arg(value_name = "SELECTOR")]
    selectors: Vec<String>,
    /// List only, open nothing.
    #[arg(long, conflicts_with_all = ["selectors", "listen_s"])]
    list: bool,
    /// Longest time to listen to each port; all are listened to at once [default: 3].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    listen_s: Option<f64>,
}

/// One port, and what was heard there.
#[derive(Debug, Serialize)]
struct Entry {
    #[serde(flatten)]
    port: DiscoveredPort,
    #[serde(skip_serializing_if = "Option::is_none")]
    heard: Option<Heard>,
    /// Why it could not be listened to.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

pub(super) fn run(args: &DevicesArgs, json: bool) -> Result<ExitCode, Failure> {
    let length = listening_time(args.listen_s)?;
    let named: Vec<Selector> = args.selectors.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let ports: Vec<(DiscoveredPort, Option<Selector>)> = if named.is_empty() {
        let with_selector = |port: DiscoveredPort| {
            let selector = port.selector.parse().ok().filter(|_| !args.list && may_be_listened_to(&port));
            (port, selector)
        };
        discover().into_iter().map(with_selector).collect()
    } else {
        named.into_iter().map(|selector| (describe(&selector), Some(selector))).collect()
    };
    let mut refused = None;
    let entries: Vec<Entry> = listen_to_all(&ports, length)
        .into_iter()
        .zip(ports)
        .map(|(answer, (port, _))| match answer {
            None => Entry { port, heard: None, error: None },
            Some(Ok(heard)) => Entry { port, heard: Some(heard), error: None },
            Some(Err(error)) => {
                let text = error.to_string();
                refused.get_or_insert(error);
                Entry { port, heard: None, error: Some(text) }
            }
        })
        .collect();
    print(&entries, json)?;
    match refused {
        // A port nobody asked for may be anything; one that was named should have opened.
        Some(error) if !args.selectors.is_empty() => Err(error.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// `--listen-s` as a length.
pub(super) fn listening_time(listen_s: Option<f64>) -> Result<Duration, Failure> {
    match listen_s {
        None => Ok(DEFAULT_LENGTH),
        Some(length_s) if (0.1..=3600.0).contains(&length_s) => Ok(Duration::from_secs_f64(length_s)),
        Some(got) => Err(Failure::usage(format!(
            "--listen-s is {got}, expected 0.1 to 3600 s\n\nhint: give a number of seconds, or leave --listen-s out"
        ))),
    }
}

/// Whether a port that nobody has named is worth opening.
fn may_be_listened_to(port: &DiscoveredPort) -> bool {
    port.access != Access::Denied && port.kind != PortKind::Can { up: false }
}

/// Listens to every port that has a selector, all at once.
pub(super) fn listen_to_all(
    ports: &[(DiscoveredPort, Option<Selector>)],
    length: Duration,
) -> Vec<Option<Result<Heard, DeviceError>>> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::start_now());
    let listened: Vec<&str> = ports
        .iter()
        .filter(|(_, selector)| selector.is_some())
        .map(|(port, _)| port.selector.as_str())
        .collect();
    let bar = show::progress(None);
    bar.set_message(format!("listening to {}", listened.join(", ")));
    let answers = std::thread::scope(|scope| {
        let clock = &clock;
        let threads: Vec<_> = ports
            .iter()
            .map(|(_, selector)| {
                selector.as_ref().map(|selector| scope.spawn(move || probe(selector, clock, length)))
            })
            .collect();
        threads.into_iter().map(|thread| thread.map(|thread| joined(thread.join()))).collect()
    });
    bar.finish_and_clear();
    answers
}

/// A panic of a thread is a bug: it goes on here.
fn joined<T>(result: std::thread::Result<T>) -> T {
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn print(entries: &[Entry], json: bool) -> Result<(), Failure> {
    if json {
        return show::json(&serde_json::json!({ "devices": entries }));
    }
    if entries.is_empty() {
        show::text("no serial port and no CAN interface")?;
        show::note("\nhint: plug the IMU in, or try `otolith run --device mock:chair`");
        return Ok(());
    }
    let lines: Vec<String> = entries.iter().map(text).collect();
    show::text(&lines.join("\n"))
}

/// One line for one port, one more for what was heard, one for each note.
fn text(entry: &Entry) -> String {
    // Of what cannot be opened the reason says all there is.
    let mut text = if entry.error.is_some() { entry.port.selector.clone() } else { line(&entry.port) };
    let mut add = |line: &str| text.push_str(&format!("\n    {line}"));
    if let Some(heard) = &entry.heard {
        add(&heard_line(heard));
        heard.notes.iter().for_each(|note| add(note));
    }
    if let Some(error) = &entry.error {
        error.lines().filter(|line| !line.is_empty()).for_each(add);
    }
    text
}

/// What a port is and who may open it.
fn line(port: &DiscoveredPort) -> String {
    let what = match &port.kind {
        PortKind::Serial { usb: None } => "serial port".to_owned(),
        PortKind::Serial { usb: Some(usb) } => {
            let names = [&usb.manufacturer, &usb.product, &usb.serial_number];
            let names: Vec<&str> = names.into_iter().flatten().map(String::as_str).collect();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, names.join(" "))
        }
        PortKind::Can { up: true } => "CAN interface, up".to_owned(),
        PortKind::Can { up: false } => {
            format!(
                "CAN interface, down: sudo ip link set {} up type can bitrate 500000",
                port.selector.trim_start_matches("can:")
            )
        }
    };
    let access = match port.access {
        Access::Granted => "you may open it",
        Access::Denied => "you may not open it: `otolith doctor` says what helps",
        Access::Unknown => "access unknown",
    };
    format!("{:<28} {what}; {access}", port.selector)
}

/// What was heard, in one line.
pub(super) fn heard_line(heard: &Heard) -> String {
    let at_baud = heard.baud.map_or_else(String::new, |baud| format!(" at {baud} baud"));
    let rate = heard.rate_hz.map_or_else(String::new, |rate_hz| format!(", {rate_hz:.1} Hz"));
    match heard.verdict {
        Verdict::Protocol => {
            let protocol = heard.protocol.unwrap_or_default();
            format!("speaks {protocol}{at_baud}{rate}; {}", sample_text(heard))
        }
        Verdict::Text => {
            let columns = heard.text_columns.unwrap_or_default();
            format!("text lines with {columns} numbers{at_baud}{rate}: needs --log-map")
        }
        Verdict::Unknown if heard.frames > 0 => {
            let (frames, ids, listened_s) = (heard.frames, heard.ids, heard.listened_s);
            let maps = match heard.fitting_maps() {
                [] => {
                    "; a mapping of its signals is needed (--map), and none of the ready ones fits".to_owned()
                }
                maps => format!("; ready mappings that fit (--map): {}", maps.join(", ")),
            };
            format!(
                "unknown: {frames} frames with {ids} identifiers in {listened_s:.1} s, but no protocol{maps}"
            )
        }
        Verdict::Unknown => {
            let bauds: Vec<String> = heard.looks.iter().map(|look| look.baud.to_string()).collect();
            format!("unknown: {} bytes but no protocol at {} baud", heard.bytes, bauds.join(", "))
        }
        Verdict::Silence => format!("silence: nothing in {:.1} s", heard.listened_s),
    }
}

/// The mean of the samples heard.
fn sample_text(heard: &Heard) -> String {
    let Some(sample) = &heard.sample else { return "no sample yet".to_owned() };
    let [x, y, z] = sample.gyro_deg_s;
    let force = match sample.specific_force_m_s2 {
        Some([x, y, z]) => format!("specific force ({x:.2}, {y:.2}, {z:.2}) m/s2"),
        None => "no accelerometer".to_owned(),
    };
    format!("gyro ({x:.2}, {y:.2}, {z:.2}) deg/s, {force}, means of {} samples", sample.samples)
}
