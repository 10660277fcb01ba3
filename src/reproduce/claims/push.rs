//! Figures 10 and 11: 4 N s at the thorax.

use crate::reproduce::{Claim, Runs};
use crate::units::DEG_PER_RAD;

/// Sway at the end with which a pushed body has recovered, deg.
const SETTLED_DEG: f64 = 0.1;
const SCENARIO: &str = "push-4ns";

pub(in crate::reproduce) fn fig11(runs: &Runs) -> Vec<Claim> {
    let (green, blue) = (runs.green(SCENARIO), runs.blue(SCENARIO));
    let end = runs.of(SCENARIO).and_then(|run| run.trace.rows().last());
    let settled = end.is_some_and(|row| f64::from(row.blue.com_sway) * DEG_PER_RAD < SETTLED_DEG);
    let (green_sway, blue_sway) = (green.peak_com_sway_deg, blue.peak_com_sway_deg);
    vec![
        Claim::new("push_sway_green", "pushed, green bends over more than blue", "larger than blue's")
            .is(green_sway, "deg")
            .above(blue_sway),
        Claim::new("push_sway_blue", "pushed, blue sways less and recovers", "much smaller than green's")
            .is(blue_sway.filter(|_| settled), "deg")
            .below(green_sway),
        Claim::new("push_tilt_green", "pushed, green's gravity tilts by up to 5 deg", "up to 5 deg")
            .is(green.peak_gravity_tilt_deg, "deg")
            .within(4.0, 6.0)
            .optional(),
    ]
}
