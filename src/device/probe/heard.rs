//! What came of listening.

use std::time::Duration;

use serde::Serialize;

use super::ear::Ear;
use crate::device::protocol::can_map::BusReport;
use crate::device::protocol::{DecodeCounters, DeviceInfo};

/// What kind of answer listening gave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// A protocol that otolith reads, beyond doubt.
    Protocol,
    /// Lines of text with numbers in them: somebody must say which is which.
    Text,
    /// Traffic that nobody understands.
    Unknown,
    /// No traffic at all.
    #[default]
    Silence,
}

/// What the samples heard were like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanSample {
    /// Samples the means are of.
    pub samples: u64,
    /// Samples among them whose angular velocity is exactly zero on all axes.
    pub without_rotation: u64,
    /// Samples at the end of the sensor's range.
    pub clipped: u64,
    /// Mean angular velocity, deg/s, sensor frame.
    pub gyro_deg_s: [f64; 3],
    /// Mean specific force, m/s², sensor frame; `None` when no sample has one.
    pub specific_force_m_s2: Option<[f64; 3]>,
}

/// A look at one baud rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Look {
    /// The baud rate, bit/s.
    pub baud: u32,
    /// Bytes heard.
    pub bytes: u64,
    /// Good packets of the protocol that understood most.
    pub good_packets: u64,
    /// Bytes whose bits change at most once: one in sixteen by chance, most when the line is several times slower.
    pub smooth_bytes: u64,
}

impl Look {
    pub(super) fn at(baud: u32) -> Self {
        Self { baud, bytes: 0, good_packets: 0, smooth_bytes: 0 }
    }

    pub(super) fn add(&mut self, ear: &Ear) {
        self.bytes += ear.bytes;
        self.good_packets += ear.good_packets();
        self.smooth_bytes += ear.smooth_bytes;
    }
}

/// What came of listening to one port.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Heard {
    /// What kind of answer this is.
    pub verdict: Verdict,
    /// Name of the protocol.
    pub protocol: Option<&'static str>,
    /// Numbers per line of text.
    pub text_columns: Option<usize>,
    /// Baud rate at which it was understood, bit/s; `None` on a bus, or when nothing was.
    pub baud: Option<u32>,
    /// Samples (lines of text) per second, by their arrival.
    pub rate_hz: Option<f64>,
    /// Samples per second as the device says.
    pub announced_rate_hz: Option<f64>,
    /// Bytes a sample takes on the line.
    pub wire_bytes_per_sample: Option<f64>,
    /// The samples heard.
    pub sample: Option<MeanSample>,
    /// What the device said about itself.
    pub device: Option<DeviceInfo>,
    /// How long it was listened to, s.
    pub listened_s: f64,
    /// Bytes heard: at the baud rate given, or at all that were tried.
    pub bytes: u64,
    /// Bytes per second at the baud rate given.
    pub bytes_per_s: Option<f64>,
    /// CAN frames heard.
    pub frames: u64,
    /// Different identifiers among them.
    pub ids: usize,
    /// Who is on the CAN bus, when no protocol was understood.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub can: Option<BusReport>,
    /// Error frames of the CAN bus.
    pub bus_errors: u64,
    /// Counters of the decoder.
    pub counters: DecodeCounters,
    /// The looks at each baud rate, when none was understood.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub looks: Vec<Look>,
    /// What is missing, assumed or not believed, in words.
    pub notes: Vec<String>,
}

impl Heard {
    /// Names of the ready mappings that fit a CAN bus of which no protocol was understood.
    pub fn fitting_maps(&self) -> &[String] {
        self.can.as_ref().map_or(&[], |bus| &bus.fitting_maps)
    }

    /// Nothing was understood at any of these speeds.
    pub(super) fn unknown(looks: Vec<Look>, listened: Duration) -> Self {
        let bytes = looks.iter().map(|look| look.bytes).sum();
        Self {
            verdict: if bytes == 0 { Verdict::Silence } else { Verdict::Unknown },
            listened_s: listened.as_secs_f64(),
            bytes,
            looks,
            ..Self::default()
        }
    }
}
