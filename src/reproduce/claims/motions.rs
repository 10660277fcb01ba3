//! The motions of section 6.1 after a spin: green falls or sways wide, blue completes the motion and settles.

use crate::reproduce::{Claim, Runs};
use crate::units::DEG_PER_RAD;

/// How many times blue's peak green must sway at least, if it does not fall.
const LEAST_RATIO: f64 = 5.0;
/// A hinge within this of its reference has arrived, deg.
const ARRIVED_DEG: f64 = 3.0;
/// A blue character that sways by less at the end has settled, deg.
const SETTLED_DEG: f64 = 0.3;

pub(in crate::reproduce) fn motions(runs: &Runs) -> Vec<Claim> {
    let reach = "reaching: green's peak sway over blue's, who completes the motion and settles";
    let drink = "drinking: green's peak sway over blue's, who completes the motion and settles";
    let stand_up = "standing up: green's peak sway over blue's, who completes the motion and settles";
    vec![
        motion("motion_reach", reach, "motion-reach", runs),
        motion("motion_drink", drink, "motion-drink", runs),
        motion("motion_stand_up", stand_up, "motion-stand-up", runs),
    ]
}

fn motion(id: &'static str, claim: &'static str, scenario: &'static str, runs: &Runs) -> Claim {
    Claim::new(id, claim, "green falls quickly, blue recovers soon")
        .is(sway_ratio(scenario, runs), "")
        .at_least(LEAST_RATIO)
}

/// Green's peak sway over blue's after the stop; `None` when blue did not complete the motion and settle. A fall
/// counts with the sway at which it began.
fn sway_ratio(scenario: &str, runs: &Runs) -> Option<f64> {
    let run = runs.of(scenario)?;
    let (green, blue) = (runs.green(scenario), runs.blue(scenario));
    let figure = run.core.blue();
    let arrived = figure.has_finished_motion() && figure.posture_error() * DEG_PER_RAD < ARRIVED_DEG;
    let last = run.trace.rows().last()?;
    let settled = f64::from(last.blue.com_sway) * DEG_PER_RAD < SETTLED_DEG;
    if blue.fell_at_s.is_some() || !arrived || !settled {
        return None;
    }
    Some(green.peak_com_sway_deg? / blue.peak_com_sway_deg?)
}
