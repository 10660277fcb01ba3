//! Up and forward: which way the head looks.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::rest::{ForceAtRest, GyroAtRest};
use super::rocking::{Rocking, RockingAxis, common_axis};
use super::spin::Spin;
use super::{Direction, Motion, Refusal, Study, Up, in_degrees};
use crate::survey::{Estimate, Movement, MovementKind, angle_between, angle_to_line};
use crate::units::{DEG_PER_RAD, RAD_PER_DEG};

/// A rocking whose axis is within this of up is a shake, rad; one within this of the horizontal is a nod.
const CLASS_ANGLE: f64 = 30.0 * RAD_PER_DEG;
/// Nods whose axes differ by more than this do not belong together, rad.
const NODS_AGREE: f64 = 45.0 * RAD_PER_DEG;
/// A sensor axis nearer to the vertical than this cannot be called forward, rad.
const FORWARD_FROM_UP: f64 = 20.0 * RAD_PER_DEG;

const NOD_HINT: &str = "rest, tip the head (or what carries the sensor) forward first and back again, three times, by 20 \
                        deg or more, and rest; or say which sensor axis points forward with --forward";

/// Where the head's y axis (left) was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Heading {
    /// Head y (left), unit, imu frame, across up.
    pub left_imu: [f64; 3],
    /// Standard uncertainty of the heading, degrees; `None` where it was given.
    pub sigma_deg: Option<f64>,
    /// Strokes of nods it was taken from; none where it was given.
    pub strokes: usize,
    /// Angle of the nods' axis out of the plane across up, degrees: how cleanly they were made.
    pub nod_axis_off_level_deg: Option<Estimate>,
}

/// Heading with what the mount needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundHeading {
    pub(super) left: Vector3<f64>,
    /// Variance of the angle about up, rad².
    pub(super) variance: f64,
    /// Component of the nods' axis along up: it lets an error of up turn the heading.
    pub(super) along_up: f64,
    pub(super) finding: Heading,
}

impl Study<'_> {
    /// The head's up by the chosen way.
    pub(super) fn up(
        &mut self,
        spin: Option<&Spin>,
        gravity: Option<&ForceAtRest>,
        gyro: Option<&GyroAtRest>,
    ) -> Option<Direction> {
        let of_gravity = gravity.and_then(ForceAtRest::direction)?;
        match self.settings.up {
            Up::Gravity => Some(of_gravity),
            Up::Spin => spin.map(|spin| spin.axis),
            Up::Shake => {
                let axis =
                    self.common_axis(gyro, |axis| angle_to_line(axis, &of_gravity.direction) <= CLASS_ANGLE);
                if axis.is_none() {
                    let why = "there is no shake: no movement back and forth about a vertical axis between two rests";
                    self.refuse("up", why, "rest, shake the head left and right three times, and rest", true);
                }
                let RockingAxis { axis, covariance, .. } = axis?;
                let sense = if axis.dot(&of_gravity.direction) < 0.0 { -1.0 } else { 1.0 };
                Some(Direction { direction: axis * sense, covariance })
            }
        }
    }

    /// The head's left, from nods or as given.
    pub(super) fn heading(
        &mut self,
        up: Option<&Direction>,
        gyro: Option<&GyroAtRest>,
    ) -> Option<FoundHeading> {
        let up = up?;
        match self.settings.forward_imu {
            Some(forward) => self.given_heading(up, &forward),
            None => self.nodded_heading(up, gyro),
        }
    }

    fn given_heading(&mut self, up: &Direction, forward: &Vector3<f64>) -> Option<FoundHeading> {
        if angle_to_line(forward, &up.direction) < FORWARD_FROM_UP {
            let why = format!(
                "the axis given as forward is {:.1} deg from the vertical",
                angle_to_line(forward, &up.direction) * DEG_PER_RAD
            );
            self.refuse("heading", why, "name another sensor axis with --forward", true);
            return None;
        }
        let left = up.direction.cross(forward).normalize();
        let finding =
            Heading { left_imu: left.into(), sigma_deg: None, strokes: 0, nod_axis_off_level_deg: None };
        Some(FoundHeading { left, variance: 0.0, along_up: 0.0, finding })
    }

    fn nodded_heading(&mut self, up: &Direction, gyro: Option<&GyroAtRest>) -> Option<FoundHeading> {
        let is_nod =
            |axis: &Vector3<f64>| angle_to_line(axis, &up.direction) >= 90.0 * RAD_PER_DEG - CLASS_ANGLE;
        let nods: Vec<Rocking> = self.rockings(is_nod);
        if nods.is_empty() {
            let why = match self.settings.up {
                Up::Gravity => "gravity says nothing about heading, and there is no nod",
                _ => {
                    "gravity and the axis of the spin are (nearly) parallel: turned about the vertical, the sensor would \
                     have read the same, and there is no nod that tells where forward is"
                }
            };
            self.refuse("heading", why, NOD_HINT, true);
            return None;
        }
        if let Some(refusal) = self.inconsistency(&nods) {
            self.refusals.push(refusal);
            return None;
        }
        let RockingAxis { axis, covariance, strokes } = self.common_axis(gyro, is_nod)?;
        let along_up = axis.dot(&up.direction);
        let left = (axis - up.direction * along_up).normalize();
        let about_up = up.direction.cross(&left);
        let variance = (about_up.transpose() * covariance * about_up)[(0, 0)];
        let out_of_level = (up.direction.transpose() * (covariance + up.covariance) * up.direction)[(0, 0)];
        let finding = Heading {
            left_imu: left.into(),
            sigma_deg: Some(variance.max(0.0).sqrt() * DEG_PER_RAD),
            strokes,
            nod_axis_off_level_deg: Some(in_degrees(libm::asin(along_up.clamp(-1.0, 1.0)), out_of_level)),
        };
        Some(FoundHeading { left, variance, along_up, finding })
    }

    /// What speaks against a set of nods.
    fn inconsistency(&self, nods: &[Rocking]) -> Option<Refusal> {
        let refusal =
            |why: &str, hint| Some(Refusal { what: "heading", why: why.to_owned(), hint, needed: true });
        if nods.iter().any(|nod| nod.senses_agree(self.samples) == Some(false)) {
            return refusal(
                "in the nod gravity turns the other way than the gyro says: one of the two sensors has a wrong sign or \
                 swapped axes",
                "check signs and order of the columns in the log mapping",
            );
        }
        let first = nods.first()?.strokes.first()?.angle;
        let apart =
            |nod: &Rocking| nod.strokes.first().is_some_and(|s| angle_between(&s.angle, &first) > NODS_AGREE);
        if nods.iter().any(apart) {
            return refusal(
                "the nods do not begin in the same direction: forward cannot be told from backward",
                "begin each nod forward, or nod several times without a rest in between",
            );
        }
        None
    }

    /// Strokes of all rockings whose axis is wanted.
    fn rockings(&self, wanted: impl Fn(&Vector3<f64>) -> bool) -> Vec<Rocking> {
        let rockings = self.wanted_movements(wanted);
        rockings.filter_map(|movement| Rocking::of(self.samples, movement)).collect()
    }

    fn wanted_movements(&self, wanted: impl Fn(&Vector3<f64>) -> bool) -> impl Iterator<Item = &Movement> {
        self.segments.movements.iter().filter(move |movement| {
            movement.kind == MovementKind::Rocking && movement.bias.is_known() && wanted(&movement.main_axis)
        })
    }

    fn common_axis(
        &self,
        gyro: Option<&GyroAtRest>,
        wanted: impl Fn(&Vector3<f64>) -> bool + Copy,
    ) -> Option<RockingAxis> {
        let bias = |nod| self.segments.bias_covariance(self.samples, nod);
        let bias: Matrix3<f64> = self.wanted_movements(wanted).map(bias).sum();
        common_axis(&self.rockings(wanted), &gyro?.walk, &bias)
    }

    /// All segments with their kinds; without `up` a rocking is just that.
    pub(super) fn motions(&self, up: Option<Vector3<f64>>) -> Vec<Motion> {
        let rests = self.segments.rests.iter().map(|rest| {
            let (start_s, end_s) = rest.times_s(self.samples);
            Motion { kind: "rest", start_s, end_s, turned_deg: 0.0 }
        });
        let movements = self.segments.movements.iter().map(|movement| {
            let (start_s, end_s) = movement.span.times_s(self.samples);
            let turned_deg = movement.turning.angle.norm() * DEG_PER_RAD;
            Motion { kind: kind(movement, up), start_s, end_s, turned_deg }
        });
        let mut motions: Vec<Motion> = rests.chain(movements).collect();
        motions.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        motions
    }
}

/// The word for a movement.
pub(super) fn kind(movement: &Movement, up: Option<Vector3<f64>>) -> &'static str {
    match (movement.kind, up.map(|up| angle_to_line(&movement.main_axis, &up))) {
        (MovementKind::Spin, _) => "spin",
        (MovementKind::Other, _) => "other",
        (MovementKind::Rocking, Some(angle)) if angle <= CLASS_ANGLE => "shake",
        (MovementKind::Rocking, Some(angle)) if angle >= 90.0 * RAD_PER_DEG - CLASS_ANGLE => "nod",
        (MovementKind::Rocking, _) => "rocking",
    }
}
