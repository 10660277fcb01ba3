//! An observer run over rows of recorded head motion.

use nalgebra::Vector3;

use super::{HeadMotion, OrientationObserver, Perception, angle_between, carry_gravity};

/// One row of recorded head motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadMotionRow {
    /// Time of the row, s.
    pub t_s: f64,
    /// The motion then; between rows it is linear.
    pub motion: HeadMotion,
}

/// What is believed at the time of one row of head motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerceptRow {
    /// Time of the row, s.
    pub t_s: f64,
    /// The percept then.
    pub perception: Perception,
    /// Angle between believed gravity and gravity carried along by the angular velocity, rad.
    pub gravity_tilt: f64,
}

/// Turns rows of head motion into rows of percepts at the same times, one step of the observer per interval.
///
/// The first row is taken for rest or steady rotation: gravity is minus its specific force, the canals are adapted to
/// its angular velocity. From there true gravity is carried along by the angular velocity alone, so a gyroscope bias
/// adds up in [`PerceptRow::gravity_tilt`].
#[derive(Clone, Debug)]
pub struct Perceiver<O> {
    observer: O,
    gravity_head: Vector3<f64>,
    last: HeadMotionRow,
}

impl<O: OrientationObserver> Perceiver<O> {
    /// Starts at `first` believing `gravity_hat` (m/s², head frame, down), or true gravity if that is `None`; also
    /// returns the percept of the first row.
    pub fn start(
        mut observer: O,
        first: &HeadMotionRow,
        gravity_hat: Option<Vector3<f64>>,
    ) -> (Self, PerceptRow) {
        let gravity_head = first.motion.gif_head;
        observer.reset(gravity_hat.unwrap_or(gravity_head), &first.motion);
        let perceiver = Self { observer, gravity_head, last: *first };
        let percept = perceiver.percept();
        (perceiver, percept)
    }

    /// Advances to `row`, which must be later than the one before.
    ///
    /// # Panics
    /// When it is not.
    pub fn step(&mut self, row: &HeadMotionRow) -> PerceptRow {
        let dt_s = row.t_s - self.last.t_s;
        assert!(dt_s > 0.0, "rows of head motion must be in order of time");
        let (from, to) = (&self.last.motion.omega_head, &row.motion.omega_head);
        self.gravity_head = carry_gravity(&self.gravity_head, from, to, dt_s);
        self.observer.step(&row.motion, dt_s);
        self.last = *row;
        self.percept()
    }

    fn percept(&self) -> PerceptRow {
        let perception = self.observer.perception();
        let gravity_tilt = angle_between(&perception.gravity_head, &self.gravity_head);
        PerceptRow { t_s: self.last.t_s, perception, gravity_tilt }
    }
}
