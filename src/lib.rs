#![doc = "Hardware in the loop from an IMU to the inner ear's belief to a balancing body."]
//!
//! `Link -> PacketDecoder -> clock sync -> calibration -> mount -> HeadMotion -> OrientationObserver -> Perception
//! -> PerceivedBalance -> BalanceController -> torques -> dynamics -> CharacterState`, every tick recorded.

pub mod device;
pub mod imu;
pub mod report;
pub mod tick;
pub mod time;
pub mod units;
pub mod vestibular;
