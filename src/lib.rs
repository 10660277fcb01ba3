#![doc = "Hardware in the loop from an IMU to the inner ear's belief to a balancing body."]
//!
//! `Link -> PacketDecoder -> clock sync -> calibration -> mount -> HeadMotion -> OrientationObserver -> Perception
//! -> PerceivedBalance -> BalanceController -> torques -> dynamics -> CharacterState`, every tick recorded.

pub mod balance;
pub mod calibrate;
pub mod chair;
pub mod character;
pub mod cli;
pub mod config;
pub mod device;
pub mod dynamics;
pub mod hil;
pub mod imu;
pub mod motion;
pub mod record;
pub mod report;
pub mod reproduce;
pub mod runtime;
pub mod survey;
pub mod tick;
pub mod time;
pub mod units;
pub mod vestibular;
