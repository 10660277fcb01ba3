//! What was found in a file, as an object and as text.

use std::fmt;

use serde::Serialize;

use super::bus::id_line;
use crate::device::protocol::can_map::BusReport;
use crate::record::DamageReport;
use crate::report::LinkCounters;
use crate::units::DEG_PER_RAD;

/// What was found in a file; the object of `--json`.
#[derive(Debug, Serialize)]
pub(super) struct Inspection {
    pub(super) file: String,
    pub(super) kind: String,
    pub(super) protocol: String,
    pub(super) link: LinkCounters,
    pub(super) samples: u64,
    pub(super) duration_s: Option<f64>,
    pub(super) rate_hz: Option<f64>,
    pub(super) omega_rad_s: Option<Range>,
    pub(super) specific_force_m_s2: Option<Range>,
    pub(super) clipped: u64,
    pub(super) unfinished_bytes: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) can: Option<BusReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) ticks: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) damage: Option<DamageReport>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) events: Vec<String>,
    pub(super) notes: Vec<String>,
}

/// Smallest, mean and largest value of each axis, sensor frame.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Range {
    pub(super) min: [f64; 3],
    pub(super) mean: [f64; 3],
    pub(super) max: [f64; 3],
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}, protocol {}", self.file, self.kind, self.protocol)?;
        let link = &self.link;
        writeln!(
            f,
            "  packets {}, bad checksum {}, bytes skipped {}, missing {}, gaps {}",
            link.packets, link.bad_checksum, link.bytes_skipped, link.missing, link.gaps
        )?;
        write!(f, "  samples {}", self.samples)?;
        if let (Some(duration_s), Some(rate_hz)) = (self.duration_s, self.rate_hz) {
            write!(f, " in {duration_s:.3} s: {rate_hz:.2} Hz")?;
        }
        writeln!(f, ", clipped {}", self.clipped)?;
        if let Some(ticks) = self.ticks {
            writeln!(f, "  ticks {ticks}")?;
        }
        let unexplained = self.can.iter().filter(|_| self.samples == 0);
        for found in unexplained.flat_map(|can| &can.identifiers) {
            writeln!(f, "  {}", id_line(found))?;
        }
        let ranges = [
            ("angular velocity, deg/s", self.omega_rad_s, DEG_PER_RAD),
            ("specific force, m/s2", self.specific_force_m_s2, 1.0),
        ];
        for (what, range, unit) in ranges {
            let Some(range) = range else { continue };
            writeln!(f, "  {what}:")?;
            for (i, axis) in ["x", "y", "z"].iter().enumerate() {
                let [min, mean, max] = [range.min[i], range.mean[i], range.max[i]].map(|value| value * unit);
                writeln!(f, "    {axis}  {min:10.3} to {max:10.3}, mean {mean:10.4}")?;
            }
        }
        for event in &self.events {
            writeln!(f, "  event at {event}")?;
        }
        for note in &self.notes {
            writeln!(f, "  note: {note}")?;
        }
        Ok(())
    }
}
