//! How a CAN interface is set up: bitrate, state and restart time, as `ip -details -json link` tells.
//!
//! The kernel gives these by netlink only. `ip` is there wherever a bitrate was ever set, and its JSON is stable;
//! talking netlink ourselves would cost a dependency or a parser of our own for four numbers.

use std::process::Command;

use serde::Deserialize;

use super::bus::BusState;

/// Set-up of a CAN interface.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct CanDetails {
    /// True when the interface is up.
    pub up: bool,
    /// Kind of the interface as the kernel names it: `can`, `vcan`, `vxcan`. `None` where `ip` is missing.
    pub kind: Option<String>,
    /// Bitrate, bit/s. `None` while it is not set, on virtual interfaces, and below `slcand`, which keeps it to itself.
    pub bitrate: Option<u32>,
    /// State of the controller.
    pub state: Option<BusState>,
    /// Time after which a controller that has left the bus restarts by itself, ms; 0 is never.
    pub restart_ms: Option<u32>,
}

/// Asks the system about `interface`. Without the program `ip` only `up` is known. `None` when there is no such
/// interface or this system has no SocketCAN.
pub fn can_details(interface: &str) -> Option<CanDetails> {
    let asked = Command::new("ip").args(["-details", "-json", "link", "show", "dev", interface]).output();
    match asked {
        Ok(answer) if answer.status.success() => {
            CanDetails::from_ip_json(&String::from_utf8_lossy(&answer.stdout))
        }
        _ => known_without_ip(interface),
    }
}

#[cfg(target_os = "linux")]
fn known_without_ip(interface: &str) -> Option<CanDetails> {
    let folder = std::path::Path::new("/sys/class/net").join(interface);
    let up = crate::device::discover::is_up(&folder)?;
    Some(CanDetails { up, kind: None, bitrate: None, state: None, restart_ms: None })
}

#[cfg(not(target_os = "linux"))]
fn known_without_ip(_interface: &str) -> Option<CanDetails> {
    None
}

/// The part of one element of `ip`'s answer that is used.
#[derive(Deserialize)]
struct IpLink {
    #[serde(default)]
    link_type: String,
    #[serde(default)]
    flags: Vec<String>,
    #[serde(default)]
    linkinfo: IpLinkInfo,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct IpLinkInfo {
    info_kind: Option<String>,
    info_data: IpInfoData,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct IpInfoData {
    state: Option<String>,
    restart_ms: Option<u32>,
    bittiming: Option<IpBitTiming>,
}

#[derive(Deserialize)]
struct IpBitTiming {
    bitrate: Option<u32>,
}

impl CanDetails {
    /// Reads what `ip -details -json link show dev INTERFACE` prints; `None` when it is no CAN interface or no such
    /// output.
    pub fn from_ip_json(text: &str) -> Option<Self> {
        let links: Vec<IpLink> = serde_json::from_str(text).ok()?;
        let link = links.into_iter().find(|link| link.link_type == "can")?;
        let IpInfoData { state, restart_ms, bittiming } = link.linkinfo.info_data;
        Some(Self {
            up: link.flags.iter().any(|flag| flag == "UP"),
            kind: link.linkinfo.info_kind,
            bitrate: bittiming.and_then(|timing| timing.bitrate),
            state: state.as_deref().and_then(state_named),
            restart_ms,
        })
    }
}

fn state_named(name: &str) -> Option<BusState> {
    match name {
        "ERROR-ACTIVE" => Some(BusState::ErrorActive),
        "ERROR-WARNING" => Some(BusState::ErrorWarning),
        "ERROR-PASSIVE" => Some(BusState::ErrorPassive),
        "BUS-OFF" => Some(BusState::BusOff),
        "STOPPED" => Some(BusState::InterfaceDown),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As iproute2 6.1 prints a controller, shortened.
    fn controller(flags: &str, data: &str) -> String {
        format!(
            r#"[{{"ifindex":3,"ifname":"can0","flags":[{flags}],"mtu":16,"qdisc":"pfifo_fast","operstate":"UP",
                "txqlen":10,"link_type":"can","promiscuity":0,"linkinfo":{{"info_kind":"can","info_data":{{{data}
                "bittiming_const":{{"name":"sja1000","tseg1":{{"min":1,"max":16}}}},"clock":8000000}}}}}}]"#
        )
    }

    #[test]
    fn a_controller_tells_bitrate_state_and_restart() {
        let data = r#""state":"BUS-OFF","berr_counter":{"tx":248,"rx":0},"restart_ms":100,
                      "bittiming":{"bitrate":500000,"sample_point":"0.875","tq":125,"prop_seg":6},"#;
        let expected = CanDetails {
            up: true,
            kind: Some("can".to_owned()),
            bitrate: Some(500_000),
            state: Some(BusState::BusOff),
            restart_ms: Some(100),
        };
        let text = controller(r#""NOARP","UP","LOWER_UP","ECHO""#, data);
        assert_eq!(CanDetails::from_ip_json(&text), Some(expected));
    }

    #[test]
    fn a_controller_without_a_bitrate_is_down() {
        let text = controller(r#""NOARP","ECHO""#, r#""state":"STOPPED","restart_ms":0,"#);
        let details = CanDetails::from_ip_json(&text).expect("a CAN interface");
        assert_eq!((details.up, details.bitrate, details.restart_ms), (false, None, Some(0)));
        assert_eq!(details.state, Some(BusState::InterfaceDown));
    }

    #[test]
    fn a_virtual_interface_has_neither() {
        // Printed by `ip` of iproute2 6.1 on Linux 6.1, shortened.
        let text = r#"[{"ifindex":2,"ifname":"vcan0","flags":["NOARP","UP","LOWER_UP"],"mtu":72,"operstate":"UNKNOWN",
                       "link_type":"can","linkinfo":{"info_kind":"vcan"},"num_tx_queues":1}]"#;
        let details = CanDetails::from_ip_json(text).expect("a CAN interface");
        assert_eq!((details.up, details.kind.as_deref()), (true, Some("vcan")));
        assert_eq!((details.bitrate, details.state, details.restart_ms), (None, None, None));
    }

    #[test]
    fn other_interfaces_and_other_texts_are_none() {
        for text in ["", "[]", "{}", r#"[{"ifname":"lo","link_type":"loopback"}]"#, "Device does not exist."]
        {
            assert_eq!(CanDetails::from_ip_json(text), None, "{text}");
        }
        assert_eq!(can_details("no-such-can"), None);
    }
}
