//! Wire format of otolith's IMU firmware.
#![no_std]
