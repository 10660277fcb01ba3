//! Systems without SocketCAN.

use std::sync::Arc;
use std::time::Duration;

use crate::device::{DeviceError, Link, LinkError, Traffic};
use crate::time::{Clock, HostTime};

/// Stands for a CAN interface where there is no SocketCAN; it cannot be opened.
#[derive(Debug)]
pub enum CanLink {}

impl CanLink {
    /// Always refuses.
    ///
    /// # Errors
    /// [`DeviceError::Unsupported`].
    pub fn open(name: &str, _clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        Err(DeviceError::Unsupported {
            port: name.to_owned(),
            problem: "CAN interfaces need SocketCAN, which only Linux has",
            hint: "use a serial CAN adapter with `slcan:PORT`, or record with candump on Linux and use `replay:FILE`",
        })
    }
}

impl Link for CanLink {
    fn receive(&mut self, _timeout: Duration) -> Result<Option<(HostTime, Traffic<'_>)>, LinkError> {
        match *self {}
    }
}
