//! What to do next: recognises the motions of a live calibration as they come.

use super::heading::kind;
use super::poses::{find_poses, not_yet_up};
use super::{CalibrateSettings, Up};
use crate::survey::{Movement, MovementKind, Sample, Segments};

/// Rest that is asked for at the start, s.
const FIRST_REST_S: f64 = 3.0;
/// Rest that is asked for after a movement, s.
const LAST_REST_S: f64 = 2.0;
/// Time between two looks at the data, s.
const LOOK_S: f64 = 0.5;

/// A spin of at least this share of the counted angle may be the counted one.
const LEAST_COUNTED: f64 = 0.8;

/// A motion that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Stand still at the start.
    Rest,
    /// Tip forward and back.
    Nod,
    /// Turn left and right.
    Shake,
    /// Lie still in one more direction, after so many.
    Pose(usize),
    /// Turn the chair.
    Spin,
    /// Finish the spin and stand still.
    LastRest,
    /// All there is to do is done.
    Done,
}

/// Follows a live stream and says what comes next. Motions may come in any order, with a rest between them.
#[derive(Debug)]
pub struct Guide {
    settings: CalibrateSettings,
    looked_s: f64,
    step: Step,
    /// Sensor axes that have not been up yet, where poses are asked for.
    missing: String,
    /// Movements with a rest after them.
    ended: usize,
}

impl Guide {
    /// A guide at the start.
    pub fn new(settings: &CalibrateSettings) -> Self {
        let missing = not_yet_up(&[]);
        Self { settings: settings.clone(), looked_s: f64::NEG_INFINITY, step: Step::Rest, missing, ended: 0 }
    }

    /// What to tell the person.
    pub fn prompt(&self) -> String {
        let fixed = match self.step {
            Step::Rest if self.settings.poses.is_some() => return self.pose_prompt(0),
            Step::Rest => "keep the sensor still for 3 s",
            Step::Nod => {
                "nod: tip the head (or what carries the sensor) forward first, then back, by 20 deg or more, three times, \
                 and keep still"
            }
            Step::Shake => "shake: turn the head left and right, three times, and keep still",
            Step::Pose(made) => return self.pose_prompt(made),
            Step::Spin => {
                "spin: turn the chair at a steady rate by the turns you count, from mark to mark, and keep still"
            }
            Step::LastRest => "finish the turns you count, then keep still for 2 s",
            Step::Done => "all motions were recognised",
        };
        fixed.to_owned()
    }

    fn pose_prompt(&self, made: usize) -> String {
        let still = "up and keep it still for 3 s";
        match self.settings.poses.as_deref().and_then(|named| named.get(made).map(|up| (up, named.len()))) {
            Some((up, count)) => {
                let sides = [("front", "back"), ("left side", "right side"), ("top", "bottom")][up.iamax()];
                let side = if up.sum() < 0.0 { sides.1 } else { sides.0 };
                format!("pose {} of {count}: turn the head's {side} {still}", made + 1)
            }
            None => {
                let which = if made == 0 { "any" } else { "another" };
                format!("pose {}: turn {which} side {still}; sensor axes to come: {}", made + 1, self.missing)
            }
        }
    }

    /// The motion to make now.
    pub fn step(&self) -> Step {
        self.step
    }

    /// Looks at everything there is so far, at most twice a second; the next motion when it has changed, and the same one
    /// again when something else was done.
    pub fn look(&mut self, samples: &[Sample]) -> Option<Step> {
        let now_s = samples.last()?.time_s;
        if now_s - self.looked_s < LOOK_S {
            return None;
        }
        self.looked_s = now_s;
        let segments = Segments::find(samples, &self.settings.rest);
        let mut made = 0;
        if self.settings.poses.is_some() {
            let poses = find_poses(samples, &segments);
            self.missing = not_yet_up(&poses);
            made = poses.len();
        }
        let step = self.next(samples, &segments, made);
        let ended = segments.movements.iter().filter(|movement| movement.rest_after.is_some()).count();
        let again = ended > self.ended && matches!(step, Step::Nod | Step::Shake | Step::Spin);
        self.ended = self.ended.max(ended);
        (std::mem::replace(&mut self.step, step) != step || again).then_some(step)
    }

    fn next(&self, samples: &[Sample], segments: &Segments, poses: usize) -> Step {
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
        match self.settings.poses.as_deref() {
            Some(named) => {
                let all = if named.is_empty() { self.missing.is_empty() } else { poses >= named.len() };
                if !all {
                    return Step::Pose(poses);
                }
            }
            None if self.settings.forward_imu.is_none() && !made("nod") => return Step::Nod,
            None if self.settings.up == Up::Shake && !made("shake") => return Step::Shake,
            None => {}
        }
        let counted = self.settings.counted.map(|counted| counted.angle.abs());
        // Turning to another pose is a spin, too.
        let far = |m: &Movement| counted.is_none_or(|angle| m.turning.angle.norm() >= LEAST_COUNTED * angle);
        let spin = segments.movements.iter().rfind(|m| m.kind == MovementKind::Spin && far(m));
        let needs_spin = counted.is_some() || (self.settings.poses.is_none() && self.settings.up == Up::Spin);
        // Of a rest that another movement ended there is no more to come.
        let may_grow = |rest: Option<usize>| rest.is_none_or(|rest| rest + 1 == segments.rests.len());
        match spin {
            _ if !needs_spin => Step::Done,
            Some(spin) if may_grow(spin.rest_after) && rest_s(spin.rest_after) < LAST_REST_S => {
                Step::LastRest
            }
            Some(_) => Step::Done,
            None => Step::Spin,
        }
    }
}
