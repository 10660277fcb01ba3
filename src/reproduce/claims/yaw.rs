//! Figure 6: what a constant yaw rate of 3 rad/s feels like.

use crate::report::{Character, Window};
use crate::reproduce::{Claim, Runs};

const SCENARIO: &str = "constant-yaw";
/// The yaw rate of the figure, rad/s.
const RATE: f64 = 3.0;
/// Length of the ramps of the scenario, s.
const RAMP_S: f64 = 3.0;

pub(in crate::reproduce) fn fig6(runs: &Runs) -> Vec<Claim> {
    let believed = Believed::of(runs).unwrap_or_default();
    let after = |point: Option<(f64, f64)>| point.map(|(t, _)| t - believed.from_s);
    let rate = |point: Option<(f64, f64)>| point.map(|(_, felt)| felt);
    vec![
        Claim::new(
            "fig6_decay",
            "a constant yaw rate fades: from the middle of the ramp to 1/e of 3 rad/s",
            "decays; the model's closed form 27.2 s",
        )
        .is(after(believed.decayed).map(|s| s + 0.5 * RAMP_S), "s")
        .within(26.0, 28.5),
        Claim::new(
            "fig6_zero_crossing",
            "it is believed to have stopped while it still turns",
            "tends to zero",
        )
        .is(after(believed.crossing), "s")
        .within(0.0, 120.0),
        Claim::new("fig6_undershoot", "then it is believed to turn the other way", "adaptation, Eq. 8")
            .is(rate(believed.undershoot), "rad/s")
            .within(-0.5, -0.01),
        Claim::new(
            "fig6_post_reversal",
            "after the stop it is believed to turn backwards",
            "reversed, then exponential rise to 0",
        )
        .is(rate(believed.after_stop), "rad/s")
        .within(-3.5, -2.0),
    ]
}

/// What the upright head believes.
#[derive(Default)]
pub(in crate::reproduce) struct Believed {
    /// Tick time at which the chair has come to its rate, s.
    from_s: f64,
    /// First (tick time in s, believed rate in rad/s) below 1/e of the rate.
    decayed: Option<(f64, f64)>,
    /// First one below zero while the chair turns.
    pub(in crate::reproduce) crossing: Option<(f64, f64)>,
    /// The least one while the chair turns.
    pub(in crate::reproduce) undershoot: Option<(f64, f64)>,
    /// The least one after the stop.
    after_stop: Option<(f64, f64)>,
}

impl Believed {
    /// Blue's observer: nobody listens to it, so its head stays upright.
    pub(in crate::reproduce) fn of(runs: &Runs) -> Option<Self> {
        let run = runs.of(SCENARIO)?;
        let spin = run.analysis.chair.spins.first()?;
        let (from_s, stop_s) = (spin.start_s + RAMP_S, spin.stop_s?);
        let constant = Window { start_s: from_s, end_s: stop_s - RAMP_S };
        let after = Window { start_s: stop_s, end_s: f64::INFINITY };
        let believed = |window: Window| {
            let rows = run.trace.rows().iter();
            rows.map(|row| (row.tick.time_s(), f64::from(row.of(Character::Blue).omega_hat_z)))
                .filter(move |(t, _)| window.contains(*t))
        };
        let first_below = |rate: f64| believed(constant).find(|(_, felt)| *felt < rate);
        let least = |window: Window| believed(window).min_by(|one, other| one.1.total_cmp(&other.1));
        Some(Self {
            from_s,
            decayed: first_below(RATE / std::f64::consts::E),
            crossing: first_below(0.0),
            undershoot: least(constant),
            after_stop: least(after),
        })
    }
}
