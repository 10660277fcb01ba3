//! `otolith devices`: what is connected, and whether it may be opened. Opens nothing.

use std::process::ExitCode;

use super::failure::Failure;
use super::show;
use crate::device::discover::{Access, DiscoveredPort, PortKind, discover};

/// List serial ports and CAN interfaces, and whether you may open them.
///
/// Opens nothing. The first column is what `otolith run --device` takes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  otolith devices\n  otolith devices --json")]
pub(super) struct DevicesArgs;

pub(super) fn run(json: bool) -> Result<ExitCode, Failure> {
    let ports = discover();
    if json {
        show::json(&serde_json::json!({ "devices": ports }))?;
    } else if ports.is_empty() {
        show::text("no serial port and no CAN interface")?;
        show::note("\nhint: plug the IMU in, or try `otolith run --device mock:chair`");
    } else {
        let lines: Vec<String> = ports.iter().map(line).collect();
        show::text(&lines.join("\n"))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// One line for one port.
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
        Access::Denied => "you may not open it: sudo usermod -aG dialout $USER, then log in again",
        Access::Unknown => "access unknown",
    };
    format!("{:<28} {what}; {access}", port.selector)
}
