//! A pseudo-terminal as a device has it.

use std::os::fd::OwnedFd;
use std::path::Path;

use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The device's end of a pseudo-terminal.
pub(super) struct Port {
    pub(super) master: OwnedFd,
}

impl Port {
    pub(super) fn plug_in(link: &Path) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        // Raw from the start: what is sent before the program opens the port must not be echoed or cooked.
        let mut settings = tcgetattr(&master).unwrap();
        settings.make_raw();
        tcsetattr(&master, OptionalActions::Now, &settings).unwrap();
        rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let _old = std::fs::remove_file(link);
        std::os::unix::fs::symlink(name, link).unwrap();
        Self { master }
    }

    /// Writes what fits; a device does not wait for its host. Requests of the host are read and ignored.
    pub(super) fn write(&self, bytes: &[u8]) {
        let mut requests = [0; 256];
        let _request = rustix::io::read(&self.master, &mut requests);
        let _overflow = rustix::io::write(&self.master, bytes);
    }
}
