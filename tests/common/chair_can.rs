//! Frames of our CAN protocol, as a chair's IMU sends them: 2 s of rest, 30 rpm with ramps of 1 s, rest.

use std::fmt::Write as _;

use otolith_firmware_protocol::can::{CanMessage, HalfSample, Identity, Ids, Ranges, Time};

/// One frame and when it is sent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) t_us: u32,
    pub(crate) id: u16,
    pub(crate) data: [u8; 8],
}

/// How a chair turns, and how often its IMU samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chair {
    pub(crate) rate_hz: u32,
    /// From the first movement until the brake, s.
    pub(crate) spin_s: f64,
    /// From the brake to the end, s.
    pub(crate) after_s: f64,
}

const REST_S: f64 = 2.0;

impl Chair {
    /// Length, s.
    pub(crate) fn length_s(&self) -> f64 {
        REST_S + self.spin_s + self.after_s
    }

    /// Samples the IMU takes: two frames each.
    pub(crate) fn samples(&self) -> u64 {
        (self.length_s() * f64::from(self.rate_hz)).round() as u64
    }

    /// Yaw rate at `t_s`, deg/s.
    fn rate_dps(&self, t_s: f64) -> f64 {
        180.0 * ((t_s - REST_S).clamp(0.0, 1.0) - (t_s - REST_S - self.spin_s).clamp(0.0, 1.0))
    }

    /// Every frame, in order.
    pub(crate) fn frames(&self) -> Vec<Frame> {
        let ranges = Ranges { gyro_range_dps: 500, accel_range_g: 4, rate_hz: self.rate_hz as u16 };
        let identity = Identity { device_id: 7, firmware: 0x0100 };
        let up = (9.80665 / ranges.accel_scale()).round() as i16;
        let mut frames = Vec::new();
        let mut frames_sent = 0u16;
        let mut send = |t_us: u32, message: CanMessage| {
            let (id, data) = Ids::default().frame(&message);
            frames.push(Frame { t_us, id, data });
        };
        for k in 0..self.samples() as u32 {
            let t_us = k * (1_000_000 / self.rate_hz);
            if k % self.rate_hz == 0 {
                send(t_us, CanMessage::Ranges(ranges));
                send(t_us, CanMessage::Identity(identity));
            }
            if k % (self.rate_hz / 10) == 0 {
                send(t_us, CanMessage::Time(Time { time_10us: t_us / 10, frames_sent, status: 0 }));
            }
            let tick = (t_us / 10) as u16;
            let rate = self.rate_dps(f64::from(t_us) * 1e-6).to_radians();
            let counts = (rate / ranges.gyro_scale()).round() as i16;
            frames_sent = frames_sent.wrapping_add(2);
            send(t_us + 100, CanMessage::Gyro(HalfSample { xyz: [0, 0, counts], tick }));
            send(t_us + 200, CanMessage::Accel(HalfSample { xyz: [0, 0, up], tick }));
        }
        frames
    }
}

/// `frames` as `candump -l can0` writes them.
#[allow(dead_code, reason = "not every binary writes logs")]
pub(crate) fn candump_log(frames: &[Frame]) -> String {
    let mut log = String::new();
    for Frame { t_us, id, data } in frames {
        let hex: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        let (seconds, micros) = (1_700_000_000 + t_us / 1_000_000, t_us % 1_000_000);
        writeln!(log, "({seconds}.{micros:06}) can0 {id:03X}#{hex}").unwrap();
    }
    log
}
