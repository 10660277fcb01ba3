//! What Linux tells about a port in `/dev`, `/sys`, `/proc` and `/etc`. Elsewhere nothing is found, and nothing is said.

use std::fs;
use std::path::{Path, PathBuf};

use super::line::MODEM_MANAGER;
use crate::device::can::CanDetails;

use super::{CanFacts, Holder, SerialFacts};
use crate::device::discover::Access;

/// A file system to look at.
#[derive(Debug)]
pub struct Survey {
    root: PathBuf,
}

impl Survey {
    /// This machine.
    pub fn here() -> Self {
        Self::below(Path::new("/"))
    }

    /// A machine whose file system starts at `root`.
    pub(super) fn below(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// Facts about the serial port `port`, whose `access` is known. `asked_baud` is for [`SerialFacts::asked_baud`].
    pub fn serial(&self, port: &str, access: Access, asked_baud: Option<u32>) -> SerialFacts {
        let node = self.at(port);
        let node = fs::canonicalize(&node).unwrap_or(node);
        let programs = self.programs();
        SerialFacts {
            access,
            group: self.group_of(&node),
            holders: self.holders(&node, &programs),
            latency_timer_ms: self.latency_timer_ms(&node),
            usb: is_usb(&node),
            modem_manager: programs.iter().any(|holder| holder.program == MODEM_MANAGER) && is_usb(&node),
            rules_installed: self.at("/etc/udev/rules.d/70-otolith.rules").exists(),
            pseudo_terminal: node.starts_with("/dev/pts"),
            asked_baud,
            node: node.display().to_string(),
        }
    }

    /// The setting of the driver of the open or closed port at `node`; opening it may have changed it.
    pub fn latency_timer_ms(&self, node: &Path) -> Option<u32> {
        let name = node.file_name()?.to_str()?;
        let file = self.at(&format!("/sys/bus/usb-serial/devices/{name}/latency_timer"));
        fs::read_to_string(file).ok()?.trim().parse().ok()
    }

    /// Facts about the CAN interface `interface`, of which `up` is known, and what `details` the system gave.
    pub fn can(&self, interface: &str, up: bool, details: Option<CanDetails>) -> CanFacts {
        CanFacts { exists: self.at(&format!("/sys/class/net/{interface}")).exists(), up, details }
    }

    fn at(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// Name of the group that owns a file.
    #[cfg(unix)]
    fn group_of(&self, node: &Path) -> Option<String> {
        use std::os::unix::fs::MetadataExt;
        let wanted = fs::metadata(node).ok()?.gid().to_string();
        let groups = fs::read_to_string(self.at("/etc/group")).ok()?;
        let named = groups.lines().find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)? == wanted).then(|| name.to_owned())
        });
        named.or(Some(wanted))
    }

    #[cfg(not(unix))]
    fn group_of(&self, _node: &Path) -> Option<String> {
        None
    }

    /// Every other process.
    fn programs(&self) -> Vec<Holder> {
        let Ok(entries) = fs::read_dir(self.at("/proc")) else { return Vec::new() };
        let mut programs: Vec<Holder> = entries
            .flatten()
            .filter_map(|entry| {
                let pid =
                    entry.file_name().to_str()?.parse().ok().filter(|pid| *pid != std::process::id())?;
                let program = fs::read_to_string(entry.path().join("comm")).ok()?.trim().to_owned();
                Some(Holder { pid, program })
            })
            .collect();
        programs.sort_by_key(|holder| holder.pid);
        programs
    }

    /// The programs among `programs` that have `node` open. Those of other users only root can see.
    fn holders(&self, node: &Path, programs: &[Holder]) -> Vec<Holder> {
        let holds = |holder: &&Holder| {
            let files = fs::read_dir(self.at(&format!("/proc/{}/fd", holder.pid)));
            files.is_ok_and(|mut files| {
                files.any(|file| {
                    file.is_ok_and(|file| fs::read_link(file.path()).is_ok_and(|target| target == node))
                })
            })
        };
        programs.iter().filter(holds).cloned().collect()
    }
}

/// Whether a node is that of a USB serial port, by its name: those are the ones ModemManager asks.
fn is_usb(node: &Path) -> bool {
    let name = node.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    name.starts_with("ttyUSB") || name.starts_with("ttyACM")
}
