//! The study as Markdown.

use std::fmt;

use super::{Row, SeedVerdict, Sensitivity, Threshold};

impl fmt::Display for Sensitivity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| parameter | value | 30 rpm, 15 s: gravity tilt / sway / foot tilt (deg) | falls after a spin of |"
        )?;
        writeln!(f, "|---|---|---|---|")?;
        let mut before = "";
        for row in &self.rows {
            let parameter = if row.parameter == before { "" } else { row.parameter };
            before = row.parameter;
            writeln!(f, "| {parameter} | {} | {} | {} |", row.value, peaks(row), row.fall_threshold)?;
        }
        writeln!(f)?;
        self.write_seeds(f)?;
        writeln!(f)?;
        self.write_scan(f)
    }
}

impl Sensitivity {
    fn write_seeds(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |holds: fn(&SeedVerdict) -> bool| self.seeds.iter().filter(|seed| holds(seed)).count();
        let all = self.seeds.len();
        writeln!(f, "| ordering, with the noise of an IMU | holds in |")?;
        writeln!(f, "|---|---|")?;
        writeln!(f, "| 10 < 20 < 30 rpm for 15 s | {} of {all} seeds |", count(|seed| seed.by_speed))?;
        writeln!(
            f,
            "| 10 < 15 < 20 s at 30 rpm, 20 s a fall | {} of {all} |",
            count(|seed| seed.by_duration)
        )?;
        writeln!(
            f,
            "| canals after 17 s: 2.85 s worst (a fall), 11.4 s mildest | {} of {all} |",
            count(|seed| seed.by_time_constant)
        )?;
        writeln!(
            f,
            "| green above blue, spin and push | {} of {all} |",
            count(|seed| seed.green_above_blue)
        )?;
        writeln!(f, "| all of them | {} of {all} |", count(SeedVerdict::holds))?;
        writeln!(
            f,
            "| (no ordering:) canals of 5.7 s stay up after 17 s | {} of {all} |",
            count(|seed| seed.usual_stands)
        )?;
        writeln!(f)?;
        let spread = |values: Vec<f64>, decimals: usize| match low_middle_high(values) {
            Some([low, middle, high]) => {
                format!("{low:.decimals$} / {middle:.decimals$} / {high:.decimals$}")
            }
            None => "-".to_owned(),
        };
        let tilts = self.seeds.iter().filter_map(|seed| seed.peak_gravity_tilt_deg).collect();
        let sways = self.seeds.iter().filter_map(|seed| seed.peak_com_sway_deg).collect();
        let feet = self.seeds.iter().filter_map(|seed| seed.peak_foot_tilt_deg).collect();
        let thresholds = self.seeds.iter().filter_map(|seed| match seed.fall_threshold {
            Threshold::At(s) => Some(s),
            _ => None,
        });
        writeln!(f, "| over the seeds | least / median / largest |")?;
        writeln!(f, "|---|---|")?;
        writeln!(f, "| peak tilt after 30 rpm, 15 s (deg) | {} |", spread(tilts, 2))?;
        writeln!(f, "| peak sway (deg) | {} |", spread(sways, 2))?;
        writeln!(f, "| peak foot tilt (deg) | {} |", spread(feet, 1))?;
        writeln!(f, "| falls after a spin of (s) | {} |", spread(thresholds.collect(), 1))
    }

    fn write_scan(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first_fall = self.scan.iter().find(|(_, fell)| *fell).map(|(s, _)| *s);
        let last_recovery = self.scan.iter().rev().find(|(_, fell)| !*fell).map(|(s, _)| *s);
        let (Some((from_s, _)), Some((to_s, _))) = (self.scan.first(), self.scan.last()) else {
            return Ok(());
        };
        write!(f, "Without noise, spins of {from_s:.1} to {to_s:.1} s at 30 rpm in steps of 0.1 s: ")?;
        match (first_fall, last_recovery) {
            (Some(fall), Some(recovery)) if fall > recovery => {
                writeln!(f, "green recovers up to {recovery:.1} s and falls from {fall:.1} s on.")
            }
            (Some(fall), Some(recovery)) => {
                writeln!(
                    f,
                    "first fall at {fall:.1} s, last recovery at {recovery:.1} s: both occur between."
                )
            }
            (Some(_), None) => writeln!(f, "green falls after all of them."),
            (None, _) => writeln!(f, "green recovers from all of them."),
        }
    }
}

fn peaks(row: &Row) -> String {
    match (row.peak_gravity_tilt_deg, row.peak_com_sway_deg, row.peak_foot_tilt_deg) {
        (Some(tilt), Some(sway), Some(foot)) => format!("{tilt:.2} / {sway:.2} / {foot:.1}"),
        _ => "falls".to_owned(),
    }
}

/// Least, middle (the upper of two) and largest; `None` without values.
fn low_middle_high(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.sort_by(f64::total_cmp);
    Some([*values.first()?, values[values.len() / 2], *values.last()?])
}
