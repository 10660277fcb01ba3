//! Findings about the way to a device: node, driver, interface.

use crate::device::can::bus::BusState;

use super::{CanFacts, Finding, Refusal, SerialFacts};
use crate::device::discover::Access;

/// The group that owns serial ports where the node does not tell.
const USUAL_GROUP: &str = "dialout";
const INSTALL_RULES: &str =
    "otolith doctor --print-udev-rules | sudo tee /etc/udev/rules.d/70-otolith.rules, then plug it in again";

/// Findings about a serial port's node and driver.
pub(super) fn serial_findings(facts: &SerialFacts, refusal: Option<&Refusal>) -> Vec<Finding> {
    let mut findings = Vec::new();
    match refusal {
        Some(Refusal::Missing(there_is)) => findings.push(missing(there_is)),
        Some(Refusal::Other(why)) => findings.push(unopened(why)),
        Some(Refusal::Lost(why)) => findings.push(lost(why)),
        _ => {}
    }
    if facts.access == Access::Denied || refusal == Some(&Refusal::Denied) {
        findings.push(no_permission(facts));
    }
    if !facts.holders.is_empty() || refusal == Some(&Refusal::Busy) {
        findings.push(busy(facts));
    }
    if let Some(ms) = facts.latency_timer_ms.filter(|ms| *ms > 1) {
        let name = facts.node.rsplit('/').next().unwrap_or_default();
        findings.push(Finding::mend(
            "latency_timer",
            format!("the USB bridge holds bytes back for up to {ms} ms"),
            "samples come in bursts, so that each is older than it need be",
            format!("echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer, or for good: {INSTALL_RULES}"),
        ));
    }
    let held_by_it = facts.holders.iter().any(|holder| holder.program == MODEM_MANAGER);
    if facts.modem_manager && !facts.rules_installed && !held_by_it {
        findings.push(Finding::note(
            "modem_manager",
            "ModemManager runs on this machine".to_owned(),
            "it writes to serial ports it does not know, right after they are plugged in",
            INSTALL_RULES.to_owned(),
        ));
    }
    findings
}

/// Name of the program that looks for modems.
pub(super) const MODEM_MANAGER: &str = "ModemManager";

fn missing(there_is: &str) -> Finding {
    Finding::mend(
        "missing",
        "there is no such port".to_owned(),
        "nothing can be read",
        format!("plug the device in, or name another port: {there_is}"),
    )
}

fn unopened(why: &str) -> Finding {
    Finding::mend(
        "open",
        format!("it does not open: {why}"),
        "nothing can be read",
        "mend what the system names, then run `otolith doctor` again".to_owned(),
    )
}

fn lost(why: &str) -> Finding {
    Finding::mend(
        "lost",
        format!("it went away while it was listened to: {why}"),
        "a measurement would have a gap here",
        "check plug, cable and supply of the device, then run `otolith doctor` again".to_owned(),
    )
}

fn no_permission(facts: &SerialFacts) -> Finding {
    let group = facts.group.as_deref().unwrap_or(USUAL_GROUP);
    // A port of root's own group is opened to nobody by joining it.
    let mend = if group == "root" {
        INSTALL_RULES.to_owned()
    } else {
        format!("sudo usermod -aG {group} $USER, then log in again; or: {INSTALL_RULES}")
    };
    Finding::mend(
        "permission",
        format!("{} belongs to group {group}, and you may not open it", facts.node),
        "nothing can be read",
        mend,
    )
}

fn busy(facts: &SerialFacts) -> Finding {
    let node = &facts.node;
    let Some(first) = facts.holders.first() else {
        return Finding::mend(
            "busy",
            format!("another program holds {node}"),
            "two readers of one port get half of the bytes each",
            format!("sudo fuser -v {node} names it; close it"),
        );
    };
    let names: Vec<String> =
        facts.holders.iter().map(|holder| format!("{} (process {})", holder.program, holder.pid)).collect();
    let mend = if first.program == MODEM_MANAGER {
        format!("sudo systemctl stop ModemManager, or for good: {INSTALL_RULES}")
    } else {
        format!("close it, or: kill {}", first.pid)
    };
    Finding::mend(
        "busy",
        format!("{} holds {node}", names.join(", ")),
        "two readers of one port get half of the bytes each",
        mend,
    )
}

/// Findings about a CAN interface.
pub(super) fn can_findings(selector: &str, facts: &CanFacts, refusal: Option<&Refusal>) -> Vec<Finding> {
    let name = selector.strip_prefix("can:").unwrap_or(selector);
    let name = name.split('?').next().unwrap_or(name);
    let bring_up = if name.starts_with("vcan") || name.starts_with("vxcan") {
        format!("sudo ip link set {name} up")
    } else {
        format!("sudo ip link set {name} up type can bitrate 500000 (the bitrate of the bus)")
    };
    if let (false, Some(Refusal::Other(why))) = (facts.exists, refusal) {
        return vec![unopened(why)];
    }
    if !facts.exists {
        return vec![Finding::mend(
            "missing",
            format!("there is no CAN interface {name}"),
            "nothing can be read",
            "plug the adapter in and look for its name in `ip link`; a serial adapter becomes one with slcand".to_owned(),
        )];
    }
    if !facts.up {
        return vec![Finding::mend(
            "down",
            format!("the interface {name} is down"),
            "no frame comes through",
            bring_up,
        )];
    }
    match refusal {
        Some(Refusal::Other(why) | Refusal::Missing(why)) => vec![unopened(why)],
        Some(Refusal::Lost(why)) => vec![lost(why)],
        Some(Refusal::Denied | Refusal::Busy) => vec![unopened("the system refuses it")],
        None => controller_findings(name, facts),
    }
}

/// What the controller of an interface that is up says about itself.
fn controller_findings(name: &str, facts: &CanFacts) -> Vec<Finding> {
    let Some(details) = &facts.details else { return Vec::new() };
    let bitrate = details.bitrate.map_or_else(String::new, |bitrate| format!(" at {bitrate} bit/s"));
    match details.state {
        Some(BusState::BusOff) => vec![Finding::mend(
            "bus_off",
            format!("the controller of {name} has left the bus{bitrate}"),
            "nothing is received until it is restarted; the usual cause is a wrong bitrate or a broken cable",
            format!("sudo ip link set {name} type can restart, or restart-ms 100 while it is down"),
        )],
        Some(BusState::ErrorWarning | BusState::ErrorPassive) => vec![Finding::mend(
            "bus_errors",
            format!("the controller of {name} has seen many errors{bitrate}"),
            "frames are being lost or repeated",
            format!(
                "check wiring, two resistors of 120 ohm, and the bitrate: ip -details -statistics link show {name}"
            ),
        )],
        _ if details.restart_ms == Some(0) && details.kind.as_deref() == Some("can") => vec![Finding::note(
            "restart",
            format!("{name} runs{bitrate} and does not restart by itself after bus-off"),
            "one fault on the bus would end the measurement",
            format!("sudo ip link set {name} down; sudo ip link set {name} up type can restart-ms 100"),
        )],
        _ => Vec::new(),
    }
}
