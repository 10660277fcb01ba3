//! The only conversion constants of the crate. Everything else is SI.

/// Standard gravity, m/s² (the value the observer's golden data use).
pub const STANDARD_GRAVITY: f64 = 9.80665;
/// Radians in one degree.
pub const RAD_PER_DEG: f64 = core::f64::consts::PI / 180.0;
/// Degrees in one radian.
pub const DEG_PER_RAD: f64 = 180.0 / core::f64::consts::PI;
/// Radians per second in one revolution per minute.
pub const RAD_S_PER_RPM: f64 = 2.0 * core::f64::consts::PI / 60.0;
