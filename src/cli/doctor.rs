//! `otolith doctor`: what is wrong with a port, why it matters and what mends it.

use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::devices::{heard_line, listen_to_all, listening_time};
use super::failure::Failure;
use super::show;
use crate::device::Selector;
use crate::device::can::can_details;
use crate::device::discover::{Access, DiscoveredPort, PortKind, describe, discover, node_of};
use crate::device::doctor::survey::Survey;
use crate::device::doctor::{Finding, Level, LinkFacts, PortFacts, Refusal, UDEV_RULES, judge};

/// Examine ports and what comes from them: what is wrong, why it matters, what mends it.
///
/// Listens only: nothing is ever written to a port, and no setting is changed. Permission, other programs, the driver's
/// delay, speed and load of the line, state of a CAN interface, silence, range, dead band, unit and sign of gravity are
/// looked at. Keep the sensor still meanwhile.
///
/// Exit code 0 when nothing has to be mended, 1 when something has; notes do not count.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    otolith doctor\n  \
    otolith doctor serial:/dev/ttyUSB0?baud=921600 --rate-rpm 40\n  \
    otolith doctor can:can0 --json\n  \
    otolith doctor --print-udev-rules | sudo tee /etc/udev/rules.d/70-otolith.rules")]
pub(super) struct DoctorArgs {
    /// Examine these only: serial:PORT?baud=N, can:IFACE.
    #[arg(value_name = "SELECTOR")]
    selectors: Vec<String>,
    /// Rate at which the chair shall turn, to hold it against the sensor's range.
    #[arg(long, value_name = "RPM", allow_hyphen_values = true)]
    rate_rpm: Option<f64>,
    /// Longest time to listen to each port; all are listened to at once [default: 3].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    listen_s: Option<f64>,
    /// Print configs/udev/70-otolith.rules, which gives access to USB serial ports, and stop.
    #[arg(long, conflicts_with_all = ["selectors", "rate_rpm", "listen_s"])]
    print_udev_rules: bool,
}

/// One port, what is known about it, and what is wrong with it.
#[derive(Debug, Serialize)]
struct Examined {
    #[serde(flatten)]
    facts: PortFacts,
    findings: Vec<Finding>,
}

impl Examined {
    fn is_fine(&self) -> bool {
        self.findings.iter().all(|finding| finding.level == Level::Note)
    }
}

pub(super) fn run(args: &DoctorArgs, json: bool) -> Result<ExitCode, Failure> {
    if args.print_udev_rules {
        if json {
            show::json(&serde_json::json!({ "udev_rules": UDEV_RULES }))?;
        } else {
            show::text(UDEV_RULES)?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    if args.rate_rpm.is_some_and(|rate_rpm| !rate_rpm.is_finite()) {
        return Err(Failure::usage(
            "--rate-rpm is no number\n\nhint: give the rate of the chair in revolutions per minute, such as 30",
        ));
    }
    let ports = ports(&args.selectors)?;
    let examined = examine(ports, args)?;
    let fine = !examined.is_empty() && examined.iter().all(Examined::is_fine);
    if json {
        show::json(&serde_json::json!({ "fine": fine, "ports": examined }))?;
    } else if examined.is_empty() {
        show::text(
            "no serial port and no CAN interface: plug the IMU in, and look for it with `dmesg --follow`",
        )?;
    } else {
        let lines: Vec<String> = examined.iter().map(text).collect();
        show::text(&lines.join("\n"))?;
    }
    Ok(if fine { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// A port to examine: the selector with which it is opened, and whether the user has named it.
struct Patient {
    port: DiscoveredPort,
    selector: Selector,
    is_named: bool,
}

/// The ports named, or all there are.
fn ports(selectors: &[String]) -> Result<Vec<Patient>, Failure> {
    if selectors.is_empty() {
        let listed = discover().into_iter();
        return Ok(listed
            .filter_map(|port| {
                let selector = port.selector.parse().ok()?;
                Some(Patient { port, selector, is_named: false })
            })
            .collect());
    }
    selectors
        .iter()
        .map(|text| {
            let selector: Selector = text.parse()?;
            if !matches!(selector, Selector::Serial { .. } | Selector::Can { .. }) {
                return Err(Failure::usage(format!(
                    "{selector}: this is no port to examine\n\nhint: name serial:PORT or can:IFACE"
                )));
            }
            Ok(Patient { port: describe(&selector), selector, is_named: true })
        })
        .collect()
}

/// Gathers the facts and judges them. Listens to what may be opened and is held by nobody else.
fn examine(patients: Vec<Patient>, args: &DoctorArgs) -> Result<Vec<Examined>, Failure> {
    let survey = Survey::here();
    let mut facts: Vec<PortFacts> =
        patients.iter().map(|patient| facts_before(&survey, patient, args.rate_rpm)).collect();
    let to_hear: Vec<(DiscoveredPort, Option<Selector>)> = patients
        .into_iter()
        .zip(&facts)
        .map(|(patient, facts)| {
            let free = match &facts.link {
                LinkFacts::Serial(serial) => serial.holders.is_empty(),
                // Opening one that is missing tells whether the kernel has CAN at all.
                LinkFacts::Can(can) => can.up || !can.exists,
            };
            let may_be_opened = patient.port.access != Access::Denied;
            let selector = Some(patient.selector).filter(|_| free && may_be_opened);
            (patient.port, selector)
        })
        .collect();
    let answers = listen_to_all(&to_hear, listening_time(args.listen_s)?);
    for (facts, answer) in facts.iter_mut().zip(answers) {
        match answer {
            Some(Ok(heard)) => facts.heard = Some(heard),
            Some(Err(error)) => facts.refusal = Some(Refusal::from(&error)),
            None => {}
        }
        if let LinkFacts::Serial(serial) = &mut facts.link {
            // Opening the port has asked the driver for low latency; what is left now needs a hand.
            serial.latency_timer_ms = survey.latency_timer_ms(Path::new(&serial.node));
        }
    }
    Ok(facts.into_iter().map(|facts| Examined { findings: judge(&facts), facts }).collect())
}

/// What is known before listening.
fn facts_before(survey: &Survey, patient: &Patient, intended_rate_rpm: Option<f64>) -> PortFacts {
    let link = match &patient.selector {
        Selector::Can { interface, .. } => {
            let up = patient.port.kind == PortKind::Can { up: true };
            LinkFacts::Can(survey.can(interface, up, can_details(interface)))
        }
        Selector::Serial { port, baud } => {
            let asked_baud = patient.is_named.then_some(*baud);
            LinkFacts::Serial(survey.serial(&node_of(port), patient.port.access, asked_baud))
        }
        other => LinkFacts::Serial(survey.serial(&other.to_string(), Access::Unknown, None)),
    };
    let selector = patient.port.selector.clone();
    PortFacts { selector, link, refusal: None, heard: None, intended_rate_rpm }
}

/// A line for each finding, or one that says that all is well.
fn text(examined: &Examined) -> String {
    let selector = &examined.facts.selector;
    let mut lines: Vec<String> = examined
        .findings
        .iter()
        .map(|finding| {
            let level = match finding.level {
                Level::Mend => "mend",
                Level::Note => "note",
            };
            format!("{level}  {selector}: {}: {} -> {}", finding.what, finding.why, finding.mend)
        })
        .collect();
    if examined.is_fine() {
        let heard = examined.facts.heard.as_ref().map_or_else(|| "not listened to".to_owned(), heard_line);
        lines.insert(0, format!("fine  {selector}: {heard}"));
    }
    lines.join("\n")
}
