//! CAN interfaces: SocketCAN on Linux, a clear refusal elsewhere.

pub mod bus;
pub mod details;
#[cfg(target_os = "linux")]
mod socket;
#[cfg(target_os = "linux")]
mod stamp;
#[cfg(not(target_os = "linux"))]
mod unsupported;

pub use details::{CanDetails, can_details};
#[cfg(target_os = "linux")]
pub use socket::CanLink;
#[cfg(not(target_os = "linux"))]
pub use unsupported::CanLink;
