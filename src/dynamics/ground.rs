//! The ground as a surface with a velocity field: plane, slope, turntable or treadmill, without extra bodies.

use nalgebra::{Matrix3, Vector3};

/// A flat surface that moves as a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundSurface {
    /// Unit normal, world axes, pointing up out of the ground.
    pub normal: Vector3<f64>,
    /// Any point of the surface; also the centre of its rotation, world axes, m.
    pub point: Vector3<f64>,
    /// Velocity of `point`, m/s (a treadmill's belt).
    pub velocity: Vector3<f64>,
    /// Angular velocity at the start of the tick, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration during the tick, rad/s².
    pub angular_acceleration: Vector3<f64>,
    /// Attitude of axes that turn with the surface, surface to world.
    pub rot_world_surface: Matrix3<f64>,
    /// Coulomb friction coefficient.
    pub friction: f64,
}

impl GroundSurface {
    /// Level ground at rest through the world's origin.
    pub fn level(friction: f64) -> Self {
        Self::plane(Vector3::z(), friction)
    }

    /// A plane at rest through the world's origin. `normal` is normalised; a zero vector means level.
    pub fn plane(normal: Vector3<f64>, friction: f64) -> Self {
        Self {
            normal: normal.try_normalize(1e-12).unwrap_or_else(Vector3::z),
            point: Vector3::zeros(),
            velocity: Vector3::zeros(),
            angular_velocity: Vector3::zeros(),
            angular_acceleration: Vector3::zeros(),
            rot_world_surface: Matrix3::identity(),
            friction,
        }
    }

    /// A level turntable about the world's vertical axis at `angle`, turning with `rate` and `acceleration`.
    pub fn turntable(angle: f64, rate: f64, acceleration: f64, friction: f64) -> Self {
        let (s, c) = libm::sincos(angle);
        Self {
            angular_velocity: Vector3::new(0.0, 0.0, rate),
            angular_acceleration: Vector3::new(0.0, 0.0, acceleration),
            rot_world_surface: Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0),
            ..Self::level(friction)
        }
    }

    /// Height of `point` above the surface along the normal, m.
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(&(point - self.point))
    }

    /// Velocity of the surface at `point` at the start of the tick.
    pub fn velocity_at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.angular_velocity.cross(&(point - self.point))
    }

    /// Velocity of the surface at `point` at the end of a tick of `dt_s`: what a velocity-level contact must reach.
    pub fn velocity_after(&self, point: &Vector3<f64>, dt_s: f64) -> Vector3<f64> {
        let omega = self.angular_velocity + dt_s * self.angular_acceleration;
        self.velocity + omega.cross(&(point - self.point))
    }

    /// Acceleration of the material point of the surface at `point`.
    pub fn acceleration_at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let r = point - self.point;
        self.angular_acceleration.cross(&r) + self.angular_velocity.cross(&self.angular_velocity.cross(&r))
    }

    /// Two tangents and the normal as rows: world to contact axes.
    pub fn contact_axes(&self) -> Matrix3<f64> {
        // The tangent nearest to the world's x axis, so that level ground gives the identity.
        let x = (Vector3::x() - self.normal * self.normal.x).try_normalize(1e-9).unwrap_or_else(Vector3::y);
        let y = self.normal.cross(&x);
        Matrix3::from_rows(&[x.transpose(), y.transpose(), self.normal.transpose()])
    }
}
