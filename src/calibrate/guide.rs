//! What to do next: recognises the motions of a live calibration as they come.

use super::heading::kind;
use super::{CalibrateSettings, Up};
use crate::survey::{MovementKind, Sample, Segments};

/// Rest that is asked for at the start, s.
const FIRST_REST_S: f64 = 3.0;
/// Rest that is asked for after a movement, s.
const LAST_REST_S: f64 = 2.0;
/// Time between two looks at the data, s.
const LOOK_S: f64 = 0.5;

/// A motion that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Stand still at the start.
    Rest,
    /// Tip forward and back.
    Nod,
    /// Turn left and right.
    Shake,
    /// Turn the chair.
    Spin,
    /// Finish the spin and stand still.
    LastRest,
    /// All there is to do is done.
    Done,
}

impl Step {
    /// What to tell the person.
    pub fn prompt(self) -> &'static str {
        match self {
            Self::Rest => "keep the sensor still for 3 s",
            Self::Nod => {
                "nod: tip the head (or what carries the sensor) forward first, then back, by 20 deg or more, three times, \
                 and keep still"
            }
            Self::Shake => "shake: turn the head left and right, three times, and keep still",
            Self::Spin => {
                "spin: turn the chair at a steady rate by the turns you count, from mark to mark, and keep still"
            }
            Self::LastRest => "finish the turns you count, then keep still for 2 s",
            Self::Done => "all motions were recognised",
        }
    }
}

/// Follows a live stream and says what comes next. Motions may come in any order, with a rest between them.
#[derive(Debug)]
pub struct Guide {
    settings: CalibrateSettings,
    looked_s: f64,
    step: Step,
}

impl Guide {
    /// A guide at the start.
    pub fn new(settings: &CalibrateSettings) -> Self {
        Self { settings: *settings, looked_s: f64::NEG_INFINITY, step: Step::Rest }
    }

    /// The motion to make now.
    pub fn step(&self) -> Step {
        self.step
    }

    /// Looks at everything there is so far, at most twice a second; the next motion when it has changed.
    pub fn look(&mut self, samples: &[Sample]) -> Option<Step> {
        let now_s = samples.last()?.time_s;
        if now_s - self.looked_s < LOOK_S {
            return None;
        }
        self.looked_s = now_s;
        let step = self.next(samples, &Segments::find(samples, &self.settings.rest));
        (std::mem::replace(&mut self.step, step) != step).then_some(step)
    }

    fn next(&self, samples: &[Sample], segments: &Segments) -> Step {
        let rest_s = |index: Option<usize>| {
            index.map_or(0.0, |index: usize| segments.rests[index].duration_s(samples))
        };
        let Some(first) = segments.rests.first() else { return Step::Rest };
        if segments.movements.is_empty() && rest_s(Some(0)) < FIRST_REST_S {
            return Step::Rest;
        }
        let up = first.of(samples).iter().filter_map(|sample| sample.specific_force_imu).sum();
        let made = |wanted: &str| {
            segments
                .movements
                .iter()
                .any(|m| kind(m, Some(up)) == wanted && m.rest_before.is_some() && m.rest_after.is_some())
        };
        if self.settings.forward_imu.is_none() && !made("nod") {
            return Step::Nod;
        }
        if self.settings.up == Up::Shake && !made("shake") {
            return Step::Shake;
        }
        let spin = segments.movements.iter().rfind(|m| m.kind == MovementKind::Spin);
        let needs_spin = self.settings.up == Up::Spin || self.settings.counted.is_some();
        match spin {
            Some(spin) if rest_s(spin.rest_after) < LAST_REST_S => Step::LastRest,
            Some(_) => Step::Done,
            None if needs_spin => Step::Spin,
            None => Step::Done,
        }
    }
}
