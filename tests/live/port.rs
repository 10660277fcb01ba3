//! A pseudo-terminal as a device has it.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::Duration;

use rustix::fs::OFlags;
use rustix::io::Errno;
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

    /// Writes bytes; requests of the host are read and ignored.
    ///
    /// A terminal holds 4 kB. Where a busy computer kept this test or the program from running, bytes come in a burst that
    /// no line makes, and wait for their reader; what nobody reads within a second is lost.
    pub(super) fn write(&self, mut bytes: &[u8]) {
        let mut requests = [0; 256];
        let _request = rustix::io::read(&self.master, &mut requests);
        for _ in 0..1000 {
            match rustix::io::write(&self.master, bytes) {
                Ok(written) => bytes = &bytes[written..],
                Err(Errno::AGAIN) => {}
                Err(_) => return,
            }
            if bytes.is_empty() {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
