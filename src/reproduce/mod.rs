//! The standing paper's results: a list of scenarios, and of claims about what comes out of them.
//!
//! "The paper" is *Motion Sickness Simulation Based on Sensorimotor Control*, sections 6.1 to 6.4; "the reference" is
//! the project's own implementation of it in MuJoCo (`spec/balance.md`). One parameter set, the default, is used for all.

mod claim;
mod claims;
mod drawings;
mod experiment;
mod plan;
mod pool;
mod report;
pub mod sensitivity;
pub mod stills;

use serde::Serialize;

pub use claim::Claim;
pub use drawings::{DrawingError, drawings};
pub use experiment::{Experiment, ExperimentError, Runs, chair_of, experiment};
pub use plan::Plan;
pub use pool::in_parallel;
pub use report::Report;

/// A figure of the paper, or the motions that it only describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Figure {
    /// Believed yaw rate for a constant yaw rate.
    Fig6,
    /// 30 rpm for 15 s, with and without vestibular model.
    Fig9,
    /// Stills of a push.
    Fig10,
    /// The same push over time.
    Fig11,
    /// Three speeds.
    Fig12,
    /// Three durations, and the people on the swivel chair.
    Fig13,
    /// Three time constants of the canals.
    Fig14,
    /// Reaching, drinking and standing up.
    Motions,
}

impl Figure {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 8] = [
        Self::Fig6,
        Self::Fig9,
        Self::Fig10,
        Self::Fig11,
        Self::Fig12,
        Self::Fig13,
        Self::Fig14,
        Self::Motions,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fig6 => "fig6",
            Self::Fig9 => "fig9",
            Self::Fig10 => "fig10",
            Self::Fig11 => "fig11",
            Self::Fig12 => "fig12",
            Self::Fig13 => "fig13",
            Self::Fig14 => "fig14",
            Self::Motions => "motions",
        }
    }

    /// Names of the scenarios it shows and its claims are about.
    pub fn scenarios(self) -> &'static [&'static str] {
        match self {
            Self::Fig6 => &["constant-yaw"],
            Self::Fig9 => &["spin-30rpm-15s", "recovery-30rpm-15s"],
            Self::Fig10 | Self::Fig11 => &["push-4ns"],
            Self::Fig12 => &[
                "spin-10rpm-15s",
                "spin-20rpm-15s",
                "spin-30rpm-15s",
                "recovery-10rpm-15s",
                "recovery-20rpm-15s",
                "recovery-30rpm-15s",
            ],
            Self::Fig13 => &[
                "spin-30rpm-10s",
                "spin-30rpm-15s",
                "spin-30rpm-20s",
                "spin-30rpm-14s",
                "recovery-30rpm-10s",
                "recovery-30rpm-15s",
            ],
            Self::Fig14 => &["spin-30rpm-17s-tau-2-85", "spin-30rpm-17s", "spin-30rpm-17s-tau-11-4"],
            Self::Motions => &["motion-reach", "motion-drink", "motion-stand-up"],
        }
    }

    /// Its claims, judged by `runs`. What a missing run would have to show does not hold.
    pub fn claims(self, runs: &Runs) -> Vec<Claim> {
        match self {
            Self::Fig6 => claims::yaw::fig6(runs),
            Self::Fig9 => claims::spin::fig9(runs),
            Self::Fig10 => Vec::new(),
            Self::Fig11 => claims::push::fig11(runs),
            Self::Fig12 => claims::spin::fig12(runs),
            Self::Fig13 => claims::spin::fig13(runs),
            Self::Fig14 => claims::spin::fig14(runs),
            Self::Motions => claims::motions::motions(runs),
        }
    }
}

#[cfg(test)]
mod tests;
