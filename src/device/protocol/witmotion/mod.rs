//! WitMotion sensors (WT901, BWT901, HWT905, WT901C-CAN and others), on a serial line and on CAN.

pub mod can;
mod kind;
mod pairing;
pub mod serial;
